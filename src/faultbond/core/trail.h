/* The last samples and healthy lanes: what the bank begins from at the alarm. */
#ifndef FB_TRAIL_H
#define FB_TRAIL_H

#include "advance.h"

#define WILD 5.0         /* innovation in its sd that noise alone does not bring about */
#define MOST_BURSTS 8
#define LOWEST (-1e300)  /* likelihood of a lane that is no number */

/* The last samples and healthy lanes; a place counts from the oldest, 0, up to now, n - 1. */
typedef struct {
    const Past *past;
    int64_t oldest, n;     /* number of the oldest sample, and how many there are */
    int64_t alarm;         /* place of the alarm */
    int64_t first;         /* earliest place that may be an onset; 0: any */
    const double *old;     /* the healthy lane as it stood long ago, before a slow drift taught it wrongly; NULL: not kept */
    int all_along;         /* 1: what the alarm tells of has been there since then, see all_along.h */
    const Beginning *beginning; /* where the oldest sample is the first of all; else NULL */
    int n_bursts;
    int64_t bursts[MOST_BURSTS]; /* places at which innovations became wild */
} Trail;

static inline const double *sample_at(const Trail *trail, int64_t place)
{
    return trail->past->rows[(trail->oldest + place) % N_ROWS].sample;
}

static inline const double *healthy_at(const Trail *trail, int64_t place)
{
    return trail->past->rows[(trail->oldest + place) % N_ROWS].lane;
}

/* The healthy lane before an onset; of a trail of one sample, that after it. */
static inline const double *before_onset(const Trail *trail, int64_t onset)
{
    return healthy_at(trail, onset > 0 ? onset - 1 : trail->n - 1);
}

/* log (exp a + exp b). */
static inline double log_add(double a, double b)
{
    const double most = a > b ? a : b;
    return most == -INFINITY || most == INFINITY || isnan(a) || isnan(b) ? (isnan(a) ? a : isnan(b) ? b : most)
                                                                        : most + log1p(exp(-fabs(a - b)));
}

static inline double finite_or_lowest(double likelihood) { return isfinite(likelihood) ? likelihood : LOWEST; }

/* The sample at a place as lanes of the bank take it: they may be far from the truth, so they linearise twice and learn from
   nearly any innovation. */
static void bank_sample(const double *packed, double *sample)
{
    memcpy(sample, packed, N_SAMPLE * sizeof *sample);
    sample[SAMPLE_AGAIN] = 1.0;
    sample[SAMPLE_BOUND] = BANK_BOUND;
}

/* Let no time pass before a sample: lanes stand there already. */
static void stand_at(double *sample)
{
    sample[SAMPLE_DT] = 0.0;
    for (int64_t k = 0; k < N_SLOW; k++) sample[SAMPLE_KICK + k] = 0.0;
    for (int64_t i = 0; i < N_STATES; i++) sample[SAMPLE_GAP + i] = 0.0;
}

FB_SELDOM

/* Begin the slow errors of a plain lane anew, as where its parameters are those of another time. */
static void forget_slow_errors(double *lane)
{
    for (int k = 0; k < N_SLOW; k++) {
        const int i = AT_SLOW + k;
        lane[i] = 0.0;
        for (int j = 0; j < PLAIN_JOINT; j++) lane[j < i ? PLAIN_PLACE(j, i) : PLAIN_PLACE(i, j)] = 0.0;
    }
    for (int k = 0; k < N_SLOW; k++) lane[PLAIN_PLACE(AT_SLOW + k, AT_SLOW + k)] = SLOW_VARIANCE[k];
}

/* Say from where on an onset is sought: after the warm-up, while a model is at its worst and a lane of any fault gains by that.
   A fault that came earlier and showed has raised an alarm soon after, or without a sum; one that did not show begins as well later.
   The first sample of all stands apart, see first.h. */
static void find_first(const Clock *clock, const Alarm *alarm, const Beginning *beginning, Trail *trail)
{
    const int64_t warm = clock->begun + WARM_UP_SAMPLES - trail->oldest;
    trail->first = warm > 1 && !alarm->slow && trail->alarm >= warm + WARM_UP_SAMPLES ? warm : 1;
    trail->all_along = alarm->old >= 0 && trail->old;
    trail->beginning = beginning->sample == trail->oldest ? beginning : NULL;
}

/* Places at which innovations became wild up to the alarm, in order; the wildest if there are many. The first sample tells
   nothing. */
static void find_bursts(Trail *trail)
{
    double height[MOST_BURSTS];
    trail->n_bursts = 0;
    for (int64_t place = 1; place <= trail->alarm; place++) {
        const Row *row = &trail->past->rows[(trail->oldest + place) % N_ROWS];
        const int was_wild = place > 1 && trail->past->rows[(trail->oldest + place - 1) % N_ROWS].wildness > WILD;
        if (!(row->wildness > WILD) || was_wild) continue;
        int at = trail->n_bursts;
        if (at == MOST_BURSTS) { /* in the place of the mildest, the latest of these, if wilder */
            at = 0;
            for (int k = 1; k < MOST_BURSTS; k++)
                if (height[k] <= height[at]) at = k;
            if (row->wildness <= height[at]) continue;
            for (int k = at; k + 1 < MOST_BURSTS; k++) {
                height[k] = height[k + 1];
                trail->bursts[k] = trail->bursts[k + 1];
            }
            at = MOST_BURSTS - 1;
        } else {
            trail->n_bursts++;
        }
        height[at] = row->wildness;
        trail->bursts[at] = place;
    }
}

FB_OFTEN

#endif
