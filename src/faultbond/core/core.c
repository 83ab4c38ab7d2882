/* The core: filters of one model over blocks of samples. A sample takes this way through the files:

     core.c       lanes of filters, FB_LANES at a time, over the samples of a block
     filter.h     predict, expect, innovate, update, one sample of the joint filter
     integrate.h  implicit signals, states and their slopes over one step
     maths.h      functions of lanes
     lanes.h      numbers of several filters side by side
     port.h       what the compiler is asked for
     model.h      generated: sizes, tables, rates and readings of one model */
#include "model.h"

#include "filter.h"

#define WORK_IS_LARGE (N_JOINT > 40) /* else it is on the stack: some hundred KB at most */

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of memory that `faultbond_advance` needs, from an address that a cache line of 64 bytes begins at. */
int64_t faultbond_work_size(void) { return WORK_IS_LARGE ? (int64_t)sizeof(Work) : 0; }

/* numbers: [N_NUMBERS][n_lanes], samples: [n_samples][N_SAMPLE], innovations: [n_samples][2 N_OUTPUTS][n_lanes]; n_lanes
   is a multiple of FB_LANES. Updates `numbers` in place. memory: see `faultbond_work_size`; not used where that is 0. */
void faultbond_advance(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations,
                       void *memory)
{
#if WORK_IS_LARGE
    Work *FB_RESTRICT work = (Work *)memory;
#else
    Work own, *FB_RESTRICT work = &own;
    (void)memory;
#endif
    work->step.dt = NAN;
    for (int64_t first = 0; first < n_lanes; first += FB_LANES) {
        for (int64_t i = 0; i < N_NUMBERS; i++) work->lane[i] = load(numbers + i * n_lanes + first);
        for (int64_t t = 0; t < n_samples; t++) {
            filter_step(work->lane, samples + t * N_SAMPLE, work->innovations, work);
            double *out = innovations + t * 2 * N_OUTPUTS * n_lanes + first;
            for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) store(out + i * n_lanes, work->innovations[i]);
        }
        for (int64_t i = 0; i < N_NUMBERS; i++) store(numbers + i * n_lanes + first, work->lane[i]);
    }
}

#ifdef __cplusplus
}
#endif
