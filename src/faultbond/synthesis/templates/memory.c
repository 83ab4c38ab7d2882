/* Memory of the program for its one plant. */
#include "../faultbond.h"
#include "memory.h"

FB_ALIGNED static unsigned char the_state[FB_STATE_BYTES], the_work[FB_WORK_BYTES], the_saved[FB_SAVED_BYTES];

PlantMemory plant_memory(void)
{
    PlantMemory memory;
    memory.state = the_state;
    memory.work = the_work;
    memory.saved = the_saved;
    memory.saved_room = FB_SAVED_BYTES;
    return memory;
}
