/* Where a fault may have begun: which onsets a group of lanes tries, and how these become one lane.

   The onset is not known, so every lane is begun at several places before the alarm, from the healthy filter as it stood
   there; up to its onset a lane's likelihood is that of the healthy plant, after it its own. All onsets have thus seen the
   same samples, and the likelihood of a lane is the mean over its onsets (a change-point mixture); from the alarm on, the
   best onset of each lane goes on. The likelihood is smooth in the onset but for a peak, so few onsets are tried first,
   and others only where it moves. Reasons and figures: docs/decisions/006-onset-mixture.md. */
#ifndef FB_ONSETS_H
#define FB_ONSETS_H

#include "trail.h"

FB_SELDOM

#define DENSE 40         /* samples before the alarm of which each may be tried as onset; */
#define RATIO 20         /* further back each is by one part in so many farther away */
#define COARSE 4         /* of so many onsets one is tried first */
#define MATTERS 8.0      /* nats by which an onset may be less likely than the best and still matters */
#define SMOOTH 3.0       /* nats by which the likelihood may move between two onsets that are tried */

#define PASSED 3         /* onsets in a row before the best that do not matter, before which none is sought any more */

enum { SPARE, WANTED, REQUIRED, TRIED }; /* onsets of a search: those between, the first, what is tried in any case */

/* Let a place be one that may be tried, or (`standing`) first is or surely is, if it is one. */
static void mark(uint8_t *marks, const Trail *trail, int64_t place, int standing)
{
    if (place >= 1 && place >= trail->first && place < trail->n && marks[place] < 1 + standing) marks[place] = (uint8_t)(1 + standing);
}

/* The distance after one, farther by one part in `RATIO`, to the nearest sample, of two the even one. In whole numbers:
   else the last digit would decide what half a sample is. */
static int64_t farther(int64_t back)
{
    const int64_t next = back + back / RATIO, rest = 2 * (back % RATIO);
    return next + (rest > RATIO || (rest == RATIO && next % 2));
}

/* Mark onsets, dense before the alarm, sparse far from it. */
static void mark_usual(uint8_t *marks, const Trail *trail)
{
    int64_t count = 0, last = 0;
    mark(marks, trail, trail->alarm, WANTED);
    for (int64_t back = 1; back < trail->alarm && trail->alarm - back >= trail->first;) {
        mark(marks, trail, trail->alarm - back, ++count % COARSE == 0 ? WANTED : SPARE);
        last = back;
        back = back < DENSE ? back + 1 : farther(back);
    }
    mark(marks, trail, trail->alarm - last, WANTED);
    for (int64_t ahead = last = 1; trail->alarm + ahead < trail->n; ahead *= 2)
        mark(marks, trail, trail->alarm + (last = ahead), SPARE);
    mark(marks, trail, trail->alarm + last, WANTED);
}

/* Mark the samples from which on the model held again: while it did not, a fault may have begun. */
static void mark_returns(uint8_t *marks, const Trail *trail)
{
    for (int64_t place = 1; place < trail->n; place++)
        if (IS_OUTSIDE(sample_at(trail, place - 1)) && !IS_OUTSIDE(sample_at(trail, place)))
            mark(marks, trail, place, REQUIRED);
}

/* Begin a search; `change`: place of the onset that the detector estimates; `likeliest`: that at which other lanes were, or -1;
   `early`: 1 where lanes may begin at the first sample of all. All three are tried: the estimate may be so bad that the right lane
   has no hope there. So is where the innovations became wild: what happens within a few samples, as a jump does whose trace the
   plant soon loses, only fits a lane that begins there. */
static void begin_search(const Trail *trail, int64_t change, int64_t likeliest, int early, Search *search)
{
    uint8_t marks[DEPTH] = {0};
    mark(marks, trail, change, REQUIRED);
    mark(marks, trail, likeliest, REQUIRED);
    mark_returns(marks, trail);
    for (int k = 0; k < trail->n_bursts; k++)
        for (int64_t late = 0; late < 2; late++) mark(marks, trail, trail->bursts[k] - late, REQUIRED);
    mark_usual(marks, trail);
    search->n = search->early = early;
    search->place[0] = 0;
    search->standing[0] = REQUIRED;
    for (int64_t place = 1; place < trail->n && search->n < MOST_ONSETS; place++) {
        if (!marks[place]) continue;
        search->place[search->n] = place;
        search->standing[search->n++] = marks[place] - 1;
    }
    if (search->n == early) {
        search->place[search->n] = trail->n - 1;
        search->standing[search->n++] = WANTED;
    }
    for (int l = 0; l < GROUP; l++) search->most[l] = -FB_LARGEST;
    search->fixed = 0;
}

/* The onset of a search that is nearest to a place. */
static int64_t nearest_onset(const Search *search, int64_t place)
{
    int64_t after = 0;
    while (after + 1 < search->n && search->place[after] < place) after++;
    return after > 0 && place - search->place[after - 1] < search->place[after] - place ? after - 1 : after;
}

/* Where the first sample of all is tried, let one be beside it, for the mean. */
static void require_beside(Search *search)
{
    if (search->early && search->standing[0] == REQUIRED) search->standing[1] = REQUIRED;
}

/* Let a search begin near the places that were best before, of each lane, and not elsewhere; what lies between them is tried
   here and there. */
static void begin_near(const int64_t *places, Search *search)
{
    int64_t last = -1;
    for (int64_t k = 0; k < search->n; k++) search->standing[k] = SPARE;
    for (int l = 0; l < GROUP; l++) search->standing[nearest_onset(search, places[l])] = REQUIRED;
    require_beside(search);
    for (int64_t k = 0; k < search->n; k++) {
        if (search->standing[k] != REQUIRED) continue;
        if (last >= 0 && k - last > 2 * COARSE) search->standing[(last + k) / 2] = REQUIRED;
        last = k;
    }
}

/* Whether an onset that was tried matters for a lane. */
static int matters(const Search *search, int64_t k)
{
    for (int l = 0; l < GROUP; l++)
        if (search->most[l] >= search->least && search->said[k][l] >= search->most[l] - MATTERS) return 1;
    return 0;
}

/* Whether the likelihood of a lane for which one of two onsets matters moves from one of them to the other. */
static int moves(const Search *search, int64_t one, int64_t two)
{
    for (int l = 0; l < GROUP; l++) {
        const double a = search->said[one][l], b = search->said[two][l];
        if (search->most[l] < search->least) continue;
        if (fmax(a, b) >= search->most[l] - MATTERS && fabs(a - b) > SMOOTH) return 1;
    }
    return 0;
}

/* The onset after k that was tried, or before it, but for one that stands apart; -1: none. */
static int64_t tried_after(const Search *search, int64_t k)
{
    for (k = k < search->early ? search->early : k + 1; k < search->n; k++)
        if (search->standing[k] == TRIED) return k;
    return -1;
}

static int64_t tried_before(const Search *search, int64_t k)
{
    for (k--; k >= search->early; k--)
        if (search->standing[k] == TRIED) return k;
    return -1;
}

/* Whether an onset that was tried lies before the best of each lane, and says little for any; lanes without hope do not count. */
static int is_before(const Search *search, int64_t k)
{
    for (int l = 0; l < GROUP; l++) {
        if (search->most[l] < search->least) continue;
        if (search->best[l] <= k || search->said[k][l] >= search->most[l] - MATTERS) return 0;
    }
    return 1;
}

/* The next of the first ones, from the last back: the likelihood rises up to the true onset and falls before it, so far enough
   before that none needs to be tried. -1: none is left. */
static int64_t next_wanted(const Search *search)
{
    int passed = 0;
    for (int64_t k = search->n - 1; k >= 0; k--) {
        if (search->standing[k] == WANTED) return passed < PASSED ? k : -1;
        if (search->standing[k] == TRIED) passed = is_before(search, k) ? passed + 1 : 0;
    }
    return -1;
}

/* The onset but the first sample of all that is tried next, -1 if those that were suffice: one farther out where an end still matters,
   twice as far each time, or one between two where a likelihood moves. */
static int64_t next_later(const Search *search)
{
    for (int64_t k = search->early; k < search->n; k++)
        if (search->standing[k] == REQUIRED) return k;
    const int64_t wanted = next_wanted(search), first = tried_after(search, -1), last = tried_before(search, search->n);
    if (wanted >= 0) return wanted;
    if (search->fixed) return -1;
    if (first > search->early && matters(search, first)) {
        const int64_t step = 2 * (tried_after(search, first) - first), next = first - (step > COARSE ? step : COARSE);
        return next > search->early ? next : search->early;
    }
    if (last + 1 < search->n && matters(search, last)) {
        const int64_t step = 2 * (last - tried_before(search, last)), next = last + (step > COARSE ? step : COARSE);
        return next < search->n ? next : search->n - 1;
    }
    for (int64_t k = first, after; (after = tried_after(search, k)) >= 0; k = after)
        if (after - k > 1 && moves(search, k, after)) return (k + after) / 2;
    return -1;
}

/* The onset that is tried next; -1 if those that were suffice. The first sample of all comes last: what a lane says there is no
   measure of what its neighbours say elsewhere. */
static int64_t next_onset(const Search *search)
{
    const int64_t next = next_later(search);
    return next < 0 && search->early && search->standing[0] == REQUIRED ? 0 : next;
}

/* Keep those lanes of a group that began at onset k which are likelier than the best of the onsets before. said: [GROUP],
   their likelihoods. */
static void mix(Search *search, int64_t k, const double *said, double (*group)[GROUP], int64_t n_numbers,
                double (*best)[GROUP])
{
    search->standing[k] = TRIED;
    for (int l = 0; l < GROUP; l++) {
        const double likelihood = finite_or_lowest(said[l]);
        search->said[k][l] = likelihood;
        if (!(likelihood > search->most[l])) continue;
        search->most[l] = likelihood;
        search->best[l] = k;
        for (int64_t i = 0; i < n_numbers; i++) best[i][l] = group[i][l];
    }
}

/* Log of the sum of exp at n - 1 places between two, n apart, where the exponent is a and b and straight between. */
static double sum_between(double a, double b, double n)
{
    const double least = a < b ? a : b, step = fabs(b - a) / n;
    if (n < 2.0) return -INFINITY;
    if (step < 1e-6) return 0.5 * (a + b) + log(n - 1.0);
    return least + (n - 1.0) * step + log(expm1(-(n - 1.0) * step) / expm1(-step));
}

/* The mean likelihood of each lane over all samples of the trail as onsets: [GROUP]. */
static void mean_over_onsets(const Search *search, double *mean)
{
    for (int l = 0; l < GROUP; l++) {
        int64_t k = tried_after(search, -1), after;
        double total = search->said[k][l];
        if (search->early && search->standing[0] == TRIED) total = log_add(total, search->said[0][l]);
        for (; (after = tried_after(search, k)) >= 0; k = after) {
            const double n = (double)(search->place[after] - search->place[k]);
            total = log_add(total, sum_between(search->said[k][l], search->said[after][l], n));
            total = log_add(total, search->said[after][l]);
        }
        mean[l] = total - log((double)HISTORY_SAMPLES);
    }
}

FB_OFTEN

#endif
