/* The last samples and healthy lanes: what the bank begins from at the alarm, where a fault may have begun, and how the
   onsets that are tried become one lane.

   The onset is not known, so every lane is begun at several places before the alarm, from the healthy filter as it stood
   there; up to its onset a lane's likelihood is that of the healthy plant, after it its own. All onsets have thus seen the
   same samples, and the likelihood of a lane is the mean over its onsets (a change-point mixture); from the alarm on, the
   best onset of each lane goes on. Reasons and figures: docs/decisions/006-onset-mixture.md. */
#ifndef FB_TRAIL_H
#define FB_TRAIL_H

#include "advance.h"

#define WILD 5.0         /* innovation in its sd that noise alone does not bring about */
#define MOST_BURSTS 8
#define DENSE 40         /* samples before the alarm of which each is tried as onset; */
#define RATIO 1.05       /* ratio of their distances further back */
#define MANY 200000      /* numbers in the covariances of all lanes from which on fewer are: */
#define MANY_DENSE 8
#define MANY_RATIO 1.25
#define LARGE_BANK 1000000 /* beyond so many only those near the estimated onset are */
#define LOWEST (-1e300)  /* likelihood of a lane that is no number */

/* The last samples and healthy lanes; a place counts from the oldest, 0, up to now, n - 1. */
typedef struct {
    const Past *past;
    int64_t oldest, n;     /* number of the oldest sample, and how many there are */
    int64_t alarm;         /* place of the alarm */
    const double *old;     /* the healthy lane as it stood long ago, before a slow drift taught it wrongly; NULL: not kept */
    int n_bursts;
    int64_t bursts[MOST_BURSTS]; /* places at which innovations became wild */
} Trail;

/* Onsets that are tried, oldest first, and the samples for which each stands. */
typedef struct {
    int n;
    int64_t place[DEPTH];
    double width[DEPTH];
} Onsets;

/* Log-likelihood of the best onset of each lane of a block, and of all onsets together. */
typedef struct {
    double best[FB_LANES], total[FB_LANES];
} Mixture;

static inline const double *sample_at(const Trail *trail, int64_t place)
{
    return trail->past->rows[(trail->oldest + place) % DEPTH].sample;
}

static inline const double *healthy_at(const Trail *trail, int64_t place)
{
    return trail->past->rows[(trail->oldest + place) % DEPTH].lane;
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

/* Begin the slow errors of a plain lane anew: near the alarm they already hold a part of the fault. */
static void forget_slow_errors(double *lane)
{
    for (int k = 0; k < N_SLOW; k++) {
        const int i = AT_SLOW + k;
        lane[i] = 0.0;
        for (int j = 0; j < PLAIN_JOINT; j++) lane[j < i ? PLAIN_PLACE(j, i) : PLAIN_PLACE(i, j)] = 0.0;
    }
    for (int k = 0; k < N_SLOW; k++) lane[PLAIN_PLACE(AT_SLOW + k, AT_SLOW + k)] = SLOW_VARIANCE[k];
}

/* Places at which innovations became wild up to the alarm, in order; the wildest if there are many. The first sample tells
   nothing. */
static void find_bursts(Trail *trail)
{
    double height[MOST_BURSTS];
    trail->n_bursts = 0;
    for (int64_t place = 1; place <= trail->alarm; place++) {
        const Row *row = &trail->past->rows[(trail->oldest + place) % DEPTH];
        const int was_wild = place > 1 && trail->past->rows[(trail->oldest + place - 1) % DEPTH].wildness > WILD;
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

/* Mark a place as tried, if it is one. */
static void mark(uint8_t *tried, const Trail *trail, int64_t place)
{
    if (place >= 1 && place < trail->n) tried[place] = 1;
}

/* The onsets to try; `change`: place of that which the detector estimates. Dense before the alarm, sparse far from it.
   Where the innovations became wild is tried too: what happens within a few samples, as a jump does whose trace the plant
   soon loses, only fits a lane that begins there. A bank with many lanes would take too long to begin at all places; it
   tries fewer, and one with very many only some about `change`. */
static void find_onsets(const Trail *trail, int64_t change, Onsets *onsets)
{
    const int64_t size = (int64_t)N_PLANNED * TRIANGLE(PLAIN_JOINT);
    uint8_t tried[DEPTH] = {0};
    mark(tried, trail, change);
    for (int k = 0; k < trail->n_bursts; k++)
        for (int64_t late = 0; late < 2; late++) mark(tried, trail, trail->bursts[k] - late);
    if (size > LARGE_BANK) {
        for (int64_t back = 1; back <= 32; back *= 2) {
            mark(tried, trail, change - back);
            mark(tried, trail, change + back);
        }
    } else {
        const int64_t dense = size > MANY ? MANY_DENSE : DENSE;
        const double ratio = size > MANY ? MANY_RATIO : RATIO;
        mark(tried, trail, trail->alarm);
        for (int64_t back = 1; back < trail->alarm; back = back < dense ? back + 1 : (int64_t)nearbyint((double)back * ratio))
            mark(tried, trail, trail->alarm - back);
        for (int64_t ahead = 1; trail->alarm + ahead < trail->n; ahead *= 2) mark(tried, trail, trail->alarm + ahead);
    }
    onsets->n = 0;
    for (int64_t place = 1; place < trail->n; place++)
        if (tried[place]) onsets->place[onsets->n++] = place;
    if (onsets->n == 0) onsets->place[onsets->n++] = trail->n - 1;
    double left = (double)onsets->place[0] - 0.5;
    for (int k = 0; k < onsets->n; k++) {
        const double here = (double)onsets->place[k];
        const double right = k + 1 < onsets->n ? 0.5 * (here + (double)onsets->place[k + 1]) : here + 0.5;
        onsets->width[k] = right - left;
        left = right;
    }
}

/* Add a block of lanes, begun at one more onset, which stands for `width` samples, to the best of the onsets before;
   likelihoods stand in its last row. `first`: there is none before. */
static void mix(int first, double (*block)[FB_LANES], int64_t n_numbers, double width, double (*best)[FB_LANES],
                Mixture *mixture)
{
    for (int l = 0; l < FB_LANES; l++) {
        const double likelihood = finite_or_lowest(block[n_numbers - 1][l]);
        if (first || likelihood > mixture->best[l]) {
            mixture->best[l] = likelihood;
            for (int64_t k = 0; k < n_numbers; k++) best[k][l] = block[k][l];
        }
        mixture->total[l] = first ? likelihood + log(width) : log_add(mixture->total[l], likelihood + log(width));
    }
}

/* Give the best onset of each lane the mean likelihood over all. */
static void conclude_mixture(const Mixture *mixture, int64_t n_numbers, double (*best)[FB_LANES])
{
    for (int l = 0; l < FB_LANES; l++) best[n_numbers - 1][l] = mixture->total[l] - log((double)HISTORY_SAMPLES);
}

#endif
