/* Memory for a plant whose core is a library, as tests have it: in place of memory.c, which a project has with its sizes. */
#include <stdlib.h>

#include "fb.h"
#include "memory.h"

PlantMemory plant_memory(void)
{
    PlantMemory memory;
    void *found[2];
    const int64_t sizes[] = {fb_state_size(), fb_work_size()};
    for (int k = 0; k < 2; k++) {
        char *bytes = (char *)calloc(1, (size_t)sizes[k] + 64);
        found[k] = bytes + (64 - (uintptr_t)bytes % 64) % 64; /* where a line of the cache begins */
    }
    memory.state = found[0];
    memory.work = found[1];
    memory.saved_room = fb_saved_size();
    memory.saved = (uint8_t *)calloc(1, (size_t)memory.saved_room);
    return memory;
}
