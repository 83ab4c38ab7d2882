/* The core of one plant, and its memory, for a page of a browser. */
#include "core.c"

#include "memory.h"

static State the_state;
static Work the_work;

PlantMemory plant_memory(void)
{
    PlantMemory memory;
    memory.state = &the_state;
    memory.work = &the_work;
    memory.saved = NULL; /* a page keeps no run */
    memory.saved_room = fb_saved_size();
    return memory;
}
