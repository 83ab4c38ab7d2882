/* Sensors whose value stays the same to the last digit although they have noise; only counted.

   A reading of a healthy sensor repeats itself where its resolution is coarse beside its noise, so a sensor is judged only
   once it has shown a step much smaller than its declared noise, and only after many repeats. */
#ifndef WATCH_FROZEN_H
#define WATCH_FROZEN_H

#include "point.h"

#define FROZEN_AFTER 60  /* values one after the other that are the same */
#define FROZEN_FINE 0.5  /* a sensor resolves its noise if it has moved by less than this many standard deviations */

/* Of each sensor: the last value, the finest step, and how many values are like the last one, itself among them. */
typedef struct {
    double last[FB_ROOM(N_OUTPUTS)], finest[FB_ROOM(N_OUTPUTS)];
    int64_t alike[FB_ROOM(N_OUTPUTS)];
} Frozen;

static inline void frozen_begin(Frozen *frozen)
{
    for (int j = 0; j < FB_ROOM(N_OUTPUTS); j++) {
        frozen->last[j] = NAN;
        frozen->finest[j] = INFINITY;
        frozen->alike[j] = 1;
    }
}

/* Take the values of one point, and give by how much the count of frozen values grows. */
static inline int64_t frozen_add(Frozen *frozen, const double *y)
{
    int64_t grown = 0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        if (!isfinite(y[j])) continue;
        const double moved = fabs(y[j] - frozen->last[j]);
        if (moved == 0.0) {
            frozen->alike[j]++;
        } else {
            if (moved < frozen->finest[j]) frozen->finest[j] = moved;
            frozen->alike[j] = 1;
        }
        frozen->last[j] = y[j];
        if (!(frozen->finest[j] < FROZEN_FINE * SENSOR_NOISE[j])) continue;
        grown += frozen->alike[j] == FROZEN_AFTER ? FROZEN_AFTER : frozen->alike[j] > FROZEN_AFTER;
    }
    return grown;
}

#endif
