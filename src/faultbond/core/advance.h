/* Filters on their way: one lane, or a block of lanes side by side, over samples. Parameters whose drift was accepted move
   on before each sample. Formulas: docs/method.md, "The bank". */
#ifndef FB_ADVANCE_H
#define FB_ADVANCE_H

#include "state.h"

#define FARTHEST_DRIFT 10.0 /* nominals, or changes of what is nominally zero, that a drift is followed over a gap */

/* Memory of the filters, apart from the stack. */
typedef struct {
    Filter_plain plain;
    Filter_wide wide;
} Filters;

/* Noise variance of sensor j at a reading. */
static inline double noise_at(int j, double y) { return OUTPUT_VARIANCE[j] * (1.0 + OUTPUT_GROWTH[j] * y * y); }

/* To be called once at the entry to the core: slopes that were kept may be another model's. */
static void prepare_filters(Filters *filters)
{
    filters->plain.step.dt = filters->wide.step.dt = NAN;
#ifdef FB_ONE_IS_APART
    filters->plain.one[0] = NAN;
#endif
}

/* Whether any parameter moves on by itself. */
static int drifts(const Normal *normal)
{
    for (int k = 0; k < N_PARAMETERS; k++)
        if (normal->rates[k] != 0.0) return 1;
    return 0;
}

/* Let parameters of a lane drift for dt seconds; `n_joint`: length of its z. None leaves its range, goes farther in them than
   FARTHEST_DRIFT, or becomes less certain than that: after a step without end one without a range would be anywhere, with a
   variance of 1e30 and more, of which rounding alone is more than the readings then leave of it. */
static void drift_on(const Normal *normal, double dt, lanes *lane, int n_joint)
{
    for (int k = 0; k < N_PARAMETERS; k++) {
        const int i = AT_PARAMETERS + k;
        const double rate = normal->rates[k], fastest = fmax(fabs(rate), normal->wander[k]);
        if (fastest == 0.0) continue;
        const double after = fastest * dt > FARTHEST_DRIFT ? FARTHEST_DRIFT / fastest : dt, sd = normal->wander[k] * after;
        lanes *variance = &lane[n_joint + IN_TRIANGLE(n_joint, i, i)];
        const lanes room = v_fmax(FARTHEST_DRIFT * FARTHEST_DRIFT - *variance, broadcast(0.0));
        lane[i] = clamp(lane[i] + rate * after, LOWER[k], UPPER[k]);
        *variance += v_fmin(broadcast(sd * sd), room);
    }
}

/* Take one sample into a group of plain lanes. innovations: measured less expected reading of each sensor, then their
   variances; NULL: not asked for. */
static void advance_plain(double (*group)[GROUP], const double *sample, const Normal *normal,
                          double (*innovations)[GROUP], Filter_plain *work)
{
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) work->lane[i] = load(group[i] + part);
        if (drifts(normal)) drift_on(normal, sample[SAMPLE_DT], work->lane, PLAIN_JOINT);
        filter_step_plain(work->lane, sample, work->innovations, work);
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) store(group[i] + part, work->lane[i]);
        for (int64_t i = 0; innovations && i < 2 * N_OUTPUTS; i++) store(innovations[i] + part, work->innovations[i]);
    }
}

/* The same of wide lanes. */
static void advance_wide(double (*group)[GROUP], const double *sample, const Normal *normal,
                         double (*innovations)[GROUP], Filter_wide *work)
{
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) work->lane[i] = load(group[i] + part);
        if (drifts(normal)) drift_on(normal, sample[SAMPLE_DT], work->lane, WIDE_JOINT);
        filter_step_wide(work->lane, sample, work->innovations, work);
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) store(group[i] + part, work->lane[i]);
        for (int64_t i = 0; innovations && i < 2 * N_OUTPUTS; i++) store(innovations[i] + part, work->innovations[i]);
    }
}

/* Take one sample into one plain lane whose parameters stay; innovations: [2 * N_OUTPUTS], as above. */
static void step_one(double *lane, const double *sample, double *innovations, Filter_plain *work)
{
#ifdef FB_ONE_IS_APART
    double unused[2 * N_OUTPUTS];
    filter_step_one(lane, sample, innovations ? innovations : unused, work->one);
#else
    for (int64_t i = 0; i < PLAIN_NUMBERS; i++) work->lane[i] = broadcast(lane[i]);
    filter_step_plain(work->lane, sample, work->innovations, work);
    for (int64_t i = 0; i < PLAIN_NUMBERS; i++) lane[i] = first_of(work->lane[i]);
    for (int64_t i = 0; innovations && i < 2 * N_OUTPUTS; i++) innovations[i] = first_of(work->innovations[i]);
#endif
}

/* The same of one whose parameters may drift. */
static void advance_one(double *lane, const double *sample, const Normal *normal, double *innovations, Filter_plain *work)
{
    if (drifts(normal)) {
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) work->lane[i] = broadcast(lane[i]);
        drift_on(normal, sample[SAMPLE_DT], work->lane, PLAIN_JOINT);
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) lane[i] = first_of(work->lane[i]);
    }
    step_one(lane, sample, innovations, work);
}

#endif
