/* The core, with memory for one plant: what a program needs that has no other. A text of its own, since its functions are the
   core's, and it takes longer to compile than all else. */
#include "../core/core.c"

#include "memory.h"

static State the_state;
static Work the_work;
static uint8_t the_saved[sizeof(State) + 64]; /* each number once, in eight bytes, and what stands around them */

PlantMemory plant_memory(void)
{
    PlantMemory memory;
    memory.state = &the_state;
    memory.work = &the_work;
    memory.saved = the_saved;
    memory.saved_room = (int64_t)sizeof the_saved;
    return memory;
}
