/* Parts of a fleet at the same time, each by a thread of its own, where the system has threads of POSIX; else one after the
   other. The only text beside the core that needs more than math.h. */
#include "fb.h"

#if !defined(FB_NO_THREADS) && (defined(__unix__) || defined(__APPLE__))
#include <pthread.h>
#define FB_THREADS
#endif

#define MOST_PARTS 64 /* at a time; more take turns */

typedef struct {
    void *fleet, *work;
    int64_t part, n_parts, n, stride;
    const double *inputs, *readings;
    int64_t *left;
} Part;

static void *take_part(void *given)
{
    const Part *part = (const Part *)given;
    fb_fleet_watch(part->fleet, part->work, part->part, part->n_parts, part->n, part->stride, part->inputs, part->readings,
                   part->left);
    return NULL;
}

/* Take some parts; the first of them by the thread that calls, and so each for which there is no other. */
static void take_parts(Part *parts, int64_t count)
{
#ifdef FB_THREADS
    pthread_t threads[MOST_PARTS];
    int is_begun[MOST_PARTS] = {0};
    for (int64_t k = 1; k < count; k++) is_begun[k] = pthread_create(&threads[k], NULL, take_part, &parts[k]) == 0;
    for (int64_t k = 0; k < count; k++)
        if (!is_begun[k]) take_part(&parts[k]);
    for (int64_t k = 1; k < count; k++)
        if (is_begun[k]) pthread_join(threads[k], NULL);
#else
    for (int64_t k = 0; k < count; k++) take_part(&parts[k]);
#endif
}

void fb_fleet_watch_all(void *fleet, void **work, int64_t n_parts, int64_t n, int64_t stride, const double *inputs,
                        const double *readings, int64_t *left)
{
    Part parts[MOST_PARTS];
    for (int64_t first = 0; first < n_parts; first += MOST_PARTS) {
        const int64_t rest = n_parts - first, count = rest < MOST_PARTS ? rest : MOST_PARTS;
        for (int64_t k = 0; k < count; k++) {
            const Part part = {fleet, work[first + k], first + k, n_parts, n, stride, inputs, readings, left};
            parts[k] = part;
        }
        take_parts(parts, count);
    }
}
