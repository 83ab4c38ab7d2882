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

#ifdef __cplusplus
extern "C"
#endif
    /* numbers: [N_NUMBERS][n_lanes], samples: [n_samples][N_SAMPLE], innovations: [n_samples][2 N_OUTPUTS][n_lanes];
       n_lanes is a multiple of FB_LANES. Updates `numbers` in place. */
    void
    faultbond_advance(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations)
{
    lanes now[N_NUMBERS], found[2 * N_OUTPUTS];
    Step step;
    step.dt = NAN;
    for (int64_t first = 0; first < n_lanes; first += FB_LANES) {
        for (int64_t i = 0; i < N_NUMBERS; i++) now[i] = load(numbers + i * n_lanes + first);
        for (int64_t t = 0; t < n_samples; t++) {
            filter_step(now, samples + t * N_SAMPLE, found, &step);
            double *out = innovations + t * 2 * N_OUTPUTS * n_lanes + first;
            for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) store(out + i * n_lanes, found[i]);
        }
        for (int64_t i = 0; i < N_NUMBERS; i++) store(numbers + i * n_lanes + first, now[i]);
    }
}
