/* A plant that is watched, as an FMU needs it: variables by number, steps of a simulator's clock, copies, and bytes. What stands
   behind the functions of the standard, fmi2.c and fmi3.c. variables.h, which is generated, numbers the variables. */
#ifndef WATCHER_H
#define WATCHER_H

#include <stddef.h>
#include <stdint.h>

typedef struct Watcher Watcher;

/* What modelDescription.xml must have, too: which FMU it is. */
const char *watcher_token(void);

/* What there is at an instance's beginning; NULL where there is no memory. Each is one thread's at a time. */
Watcher *watcher_new(void);
void watcher_free(Watcher *watcher);

/* Let all be as in a new one. */
void watcher_reset(Watcher *watcher);

/* The life of an instance: time of the first sample, s, then begin, run, steps, and end, after which no step may follow. Each gives
   NULL, or in words why it is refused.

   A step takes the samples from `time` on, as many as fit in `step`, s. The readings are of the first one, and missing at those
   between two steps, where nobody told them; inputs stay. At the end the last diagnosis is given, if a fault was detected. */
void watcher_start_at(Watcher *watcher, double time);
const char *watcher_begin(Watcher *watcher);
const char *watcher_run(Watcher *watcher);
const char *watcher_step(Watcher *watcher, double time, double step);
const char *watcher_end(Watcher *watcher);

/* Time after the last step, s. */
double watcher_time(const Watcher *watcher);

/* Give a variable by its number, or let one be told; 0 where there is none of that kind. Numbers are SI, nan: missing. */
int watcher_get_real(const Watcher *watcher, uint32_t number, double *value);
int watcher_set_real(Watcher *watcher, uint32_t number, double value);
int watcher_get_whole(const Watcher *watcher, uint32_t number, int64_t *value);
int watcher_get_flag(const Watcher *watcher, uint32_t number, int *value);
int watcher_get_text(const Watcher *watcher, uint32_t number, const char **value);

/* Give a copy, which takes no samples itself, NULL where there is no memory; and become like a copy. */
Watcher *watcher_copy(const Watcher *watcher);
void watcher_become(Watcher *watcher, const Watcher *copy);

/* Give a watcher as bytes that every processor reads alike, and take one from n bytes: 1, or 0 where they are not of this FMU. */
size_t watcher_saved_size(void);
void watcher_save(const Watcher *watcher, uint8_t *bytes);
int watcher_restore(Watcher *watcher, const uint8_t *bytes, size_t n);

#endif
