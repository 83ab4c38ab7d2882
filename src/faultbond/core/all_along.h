/* What has been off since before the samples that are kept, as an alarm tells of that comes from far walks alone; see walking.h.

   The healthy filter has followed it: its parameters and slow errors z make up for it, and the states x are what goes with those. What
   it knows of the states once z is given, x = m + G (z - mean z) + e, holds all the same. So in the lanes of the trail, from which
   those of the bank begin, z is what it was before, and x goes with it; and in a lane of a fault x goes with that z which the fault
   moves, or in whose place it is read. Source: probability kinematics, Jeffrey, The Logic of Decision, 1965, chapter 11; the
   regression by sweeping, Goodnight, The American Statistician 33 (1979) 149. Reasons and figures:
   docs/decisions/043-off-all-along.md. */
#ifndef FB_ALL_ALONG_H
#define FB_ALL_ALONG_H

#include "trail.h"

FB_SELDOM

#define SINGULAR 1e-9 /* of its variance that is left of a number once others are given, at which these tell it */

/* Whether number i of a lane is a parameter or a slow error. */
static inline int is_learned(int64_t i) { return i >= AT_SLOW && i < AT_SLOT; }

/* Let the covariance of a lane be what it is once number k is given, and the row of k by how much the others go with it; nothing
   does with one of which no more is left than `least`. */
static void sweep(int64_t k, double least, double *lane)
{
    const double own = lane[PLAIN_PLACE(k, k)], inverse = own > least ? 1.0 / own : 0.0;
    double row[FB_ROOM(PLAIN_JOINT)];
    for (int64_t i = 0; i < PLAIN_JOINT; i++) row[i] = i == k ? 0.0 : lane[plain_place(i, k)];
    for (int64_t i = 0; i < PLAIN_JOINT; i++)
        for (int64_t j = i; j < PLAIN_JOINT; j++) lane[PLAIN_PLACE(i, j)] -= inverse * row[i] * row[j];
    for (int64_t i = 0; i < PLAIN_JOINT; i++) lane[plain_place(i, k)] = inverse * row[i];
    lane[PLAIN_PLACE(k, k)] = -inverse;
}

/* The covariance that parameters had, as uncertain as their usual walks have made them since, and that of slow errors that begin
   anew. */
static double before_it(const double *old, int64_t k, int64_t m)
{
    const double *usual = old + KEPT_USUAL;
    if (k < AT_PARAMETERS || m < AT_PARAMETERS) return k == m ? SLOW_VARIANCE[k - AT_SLOW] : 0.0;
    return old[plain_place(k, m)] * sqrt(fmax(usual[k - AT_PARAMETERS], 1.0) * fmax(usual[m - AT_PARAMETERS], 1.0));
}

/* Let a lane have the parameters of an old one, and slow errors that begin anew; all else goes with these as it has. Where what is
   off is none of them, such as an input, it may be as it was: it is as uncertain as it went, too, along that way. */
static void restate(const double *old, double *lane)
{
    double away[FB_ROOM(PLAIN_JOINT)], moved[FB_ROOM(AT_SLOT)], least[FB_ROOM(AT_SLOT)], with[FB_ROOM(AT_SLOT)];
    for (int64_t k = AT_SLOW; k < AT_SLOT; k++) least[k] = SINGULAR * lane[PLAIN_PLACE(k, k)];
    for (int64_t k = AT_SLOW; k < AT_SLOT; k++) sweep(k, least[k], lane);
    for (int64_t k = AT_SLOW; k < AT_SLOT; k++) {
        moved[k] = (k < AT_PARAMETERS ? 0.0 : old[k]) - lane[k];
        lane[k] += moved[k];
        for (int64_t m = k; m < AT_SLOT; m++) lane[PLAIN_PLACE(k, m)] = before_it(old, k, m);
    }
    for (int64_t i = 0; i < PLAIN_JOINT; i++) {
        if (is_learned(i)) continue;
        away[i] = lane[i];
        for (int64_t k = AT_SLOW; k < AT_SLOT; k++) {
            lane[i] += lane[plain_place(i, k)] * moved[k];
            with[k] = 0.0;
            for (int64_t m = AT_SLOW; m < AT_SLOT; m++) with[k] += lane[plain_place(i, m)] * lane[plain_place(m, k)];
        }
        for (int64_t j = i; j < PLAIN_JOINT; j++)
            for (int64_t k = AT_SLOW; k < AT_SLOT && !is_learned(j); k++) lane[PLAIN_PLACE(i, j)] += with[k] * lane[plain_place(j, k)];
        for (int64_t k = AT_SLOW; k < AT_SLOT; k++) lane[plain_place(i, k)] = with[k];
        away[i] -= lane[i];
    }
    for (int64_t i = 0; i < PLAIN_JOINT; i++)
        for (int64_t j = i; j < PLAIN_JOINT; j++)
            if (!is_learned(i) && !is_learned(j)) lane[PLAIN_PLACE(i, j)] += away[i] * away[j];
}

/* The same of all lanes of a trail, if what is off has been so for longer. */
static void restate_all(const Trail *trail, Past *past)
{
    for (int64_t place = 0; trail->all_along && place < trail->n; place++)
        restate(trail->old, past->rows[(trail->oldest + place) % N_ROWS].lane);
}

/* Let number k of a lane have another mean and variance, and go with nothing but, where it has been so `all_along`, with all that is
   not learned. */
static void replace_number(int64_t k, double mean, double variance, int all_along, double *lane)
{
    const double own = lane[PLAIN_PLACE(k, k)], moved = mean - lane[k];
    double by[FB_ROOM(PLAIN_JOINT)];
    for (int64_t i = 0; i < PLAIN_JOINT; i++) {
        by[i] = all_along && own > 0.0 && !is_learned(i) ? lane[plain_place(i, k)] / own : 0.0;
        lane[plain_place(i, k)] = 0.0;
    }
    for (int64_t i = 0; i < PLAIN_JOINT; i++) {
        lane[i] += by[i] * moved;
        for (int64_t j = i; j < PLAIN_JOINT; j++) lane[PLAIN_PLACE(i, j)] += by[i] * by[j] * (variance - own);
        lane[plain_place(i, k)] += by[i] * variance;
    }
    lane[k] = mean;
    lane[PLAIN_PLACE(k, k)] = variance;
}

FB_OFTEN

#endif
