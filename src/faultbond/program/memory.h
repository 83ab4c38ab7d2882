/* Memory that the core needs for one plant. */
#ifndef WATCH_MEMORY_H
#define WATCH_MEMORY_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* saved: room for a saved state, of so many bytes. */
typedef struct {
    void *state, *work;
    uint8_t *saved;
    int64_t saved_room;
} PlantMemory;

PlantMemory plant_memory(void); /* memory.c of a project */

#ifdef __cplusplus
}
#endif

#endif
