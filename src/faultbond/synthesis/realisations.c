/* Whether faults of many sizes raise the alarm in many realisations of noise: FB_LANES realisations at a time, by the sums of the
   detector itself, `core/sums.h`. Its limits stand before this text, see `detector_text`.

   Arrays have the axes samples w, faults c, onsets o, sensors j or slow errors s, and realisations m, a multiple of FB_LANES:

     effects  [w][c][o][j]   of each fault on innovations, in their sd
     strayed  [w][c][o][s]   and on slow errors that alarm, in their declared sd
     factor   [c][o][m]      by how much each is larger
     noise    [w][o][j][m], slow [w][o][s][m]   the same without a fault
     begun    [o][j][SUMS][m]   the sums before the onset
     counted, blanked [w][o][j]  whether the sums take the value; or forget those before
     limits   [s]            of slow errors
     found    [c][o][m]      whether the alarm is raised */
#include "maths.h"

#define LAGS 4 /* innovations with which each new one is compared */
#define SUMS (4 + 2 * LAGS)

#define real lanes
#define flag mask
#define SAME(a) broadcast(a)
#define PICK(is, a, b) choose(is, a, b)
#define SIZE magnitude

/* Of one sensor. */
typedef struct {
    real cusum[2][1], fast[2][1], scatter[LAGS][1], before[LAGS][1];
} Sensors;

#include "real.h"
#include "sums.h"

typedef struct {
    int64_t samples, faults, onsets, sensors, slow, realisations;
} Extent;

/* The sums of a sensor as they begin, of some realisations. */
static void begin(Sensors *sums, const double *begun, int64_t m)
{
    real *const each[SUMS] = {sums->cusum[0],   sums->cusum[1],   sums->fast[0],    sums->fast[1],
                              sums->scatter[0], sums->scatter[1], sums->scatter[2], sums->scatter[3],
                              sums->before[0],  sums->before[1],  sums->before[2],  sums->before[3]};
    for (int k = 0; k < SUMS; k++) *each[k] = load(begun + k * m);
}

/* The realisations, of those from number `first`, in which innovations of sensor j raise the alarm after onset o of fault c; `known`:
   those of which that is known. */
static mask sensor_alarms(const Extent *n, int64_t c, int64_t o, int64_t j, int64_t first, const double *effects, lanes larger_by,
                          const double *noise, const double *begun, const uint8_t *counted, const uint8_t *blanked, mask known)
{
    const lanes limit = broadcast(CUSUM_LIMIT);
    const int64_t m = n->realisations;
    Sensors sums;
    begin(&sums, begun + (o * n->sensors + j) * SUMS * m + first, m);
    known |= statistic(&sums, 0) > limit;
    for (int64_t w = 0; w < n->samples && !all_of(known); w++) {
        const int64_t place = (w * n->onsets + o) * n->sensors + j;
        const double effect = effects[((w * n->faults + c) * n->onsets + o) * n->sensors + j];
        const lanes score = larger_by * broadcast(effect) + load(noise + place * m + first);
        if (counted[place]) add_score(&sums, 0, score, is_finite(score));
        if (blanked[place])
            for (int k = 0; k < LAGS; k++) sums.before[k][0] = broadcast(NAN);
        known |= statistic(&sums, 0) > limit;
    }
    return known;
}

/* The same of slow error s, of which only the size counts. */
static mask slow_error_alarms(const Extent *n, int64_t c, int64_t o, int64_t s, int64_t first, const double *strayed, lanes larger_by,
                              const double *slow, double limit, mask known)
{
    for (int64_t w = 0; w < n->samples && !all_of(known); w++) {
        const double effect = strayed[((w * n->faults + c) * n->onsets + o) * n->slow + s];
        const lanes ratio = larger_by * broadcast(effect) + load(slow + ((w * n->onsets + o) * n->slow + s) * n->realisations + first);
        known |= magnitude(ratio) > broadcast(limit);
    }
    return known;
}

void faultbond_detector(const int64_t *extent, const double *effects, const double *strayed, const double *factor, const double *noise,
                      const double *slow, const double *begun, const uint8_t *counted, const uint8_t *blanked,
                      const double *limits, uint8_t *found);

void faultbond_detector(const int64_t *extent, const double *effects, const double *strayed, const double *factor, const double *noise,
                      const double *slow, const double *begun, const uint8_t *counted, const uint8_t *blanked,
                      const double *limits, uint8_t *found)
{
    const Extent n = {extent[0], extent[1], extent[2], extent[3], extent[4], extent[5]};
    for (int64_t c = 0; c < n.faults; c++)
        for (int64_t o = 0; o < n.onsets; o++)
            for (int64_t first = 0; first < n.realisations; first += FB_LANES) {
                const int64_t place = (c * n.onsets + o) * n.realisations + first;
                const lanes larger_by = load(factor + place);
                mask known = larger_by != larger_by; /* none */
                for (int64_t s = 0; s < n.slow; s++)
                    known = slow_error_alarms(&n, c, o, s, first, strayed, larger_by, slow, limits[s], known);
                for (int64_t j = 0; j < n.sensors; j++)
                    known = sensor_alarms(&n, c, o, j, first, effects, larger_by, noise, begun, counted, blanked, known);
                for (int l = 0; l < FB_LANES; l++) found[place + l] = (uint8_t)holds(known, l);
            }
}
