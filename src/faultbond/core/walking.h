/* How far the parameters of the healthy filter walk. A constant that is learned moves only as its variance shrinks: over a
   window from s to t var(theta_t - theta_s) = P_s - P_t. A slow fault, which the filter follows so that no innovation tells of
   it, moves it farther, and so does one that was there from the first sample, or after it was said to be repaired, in what the
   declared accuracy allows.

   What one parameter has to make up for is shared among all that resemble it, so they are judged together, too: by
   d' (P_s - P_t)^-1 d, with d = theta_t - theta_s.

   Models are never perfect, and their parameters walk somewhat farther: by how much is learned, for each window as it was
   before that began, and what one window says counts for the next longer one until that has been seen often enough.

   The last two lanes at multiples of each window are kept, and compared is that of one to two windows ago. This text stands in
   watching.h. Reasons and figures: docs/decisions/020-walks.md. Formulas: docs/method.md, "The alarm". */

/* The sample from which on healthy lanes are kept for long: a while after the start, or after what was accepted, or an alarm that
   was over, or after an input was unknown: then parameters walk to make up for it. */
static inline real walks_from(const Clock *clock, const Healthy *healthy)
{
    const double settled = WARM_UP_SAMPLES > WALK_SETTLES ? WARM_UP_SAMPLES : WALK_SETTLES;
    const real decided = greater(AS_REAL(clock->accepted), AS_REAL(clock->over));
    return greater(greater(AS_REAL(clock->begun), decided), healthy->blind) + settled;
}

/* A parameter less what those that go with it let expect of it, but for a constant; and the variance of that. A walk of all in
   common is none: it is what the declared accuracies say of their scale. See given.h. */
static inline real own_value(const real *lane, int k)
{
    real sum = lane[AT_PARAMETERS + k];
    for (int e = TIE_ROW[k]; e < TIE_ROW[k + 1]; e++) sum += TIE_WEIGHT[e] * lane[AT_PARAMETERS + TIE_PARAMETER[e]];
    return sum;
}

static inline real own_variance(const real *lane, int k)
{
    const int i = AT_PARAMETERS + k;
    real sum = lane[PLAIN_PLACE(i, i)];
    for (int e = TIE_ROW[k]; e < TIE_ROW[k + 1]; e++) {
        const int j = AT_PARAMETERS + TIE_PARAMETER[e];
        sum += 2.0 * TIE_WEIGHT[e] * lane[i < j ? PLAIN_PLACE(i, j) : PLAIN_PLACE(j, i)];
        sum += TIE_WEIGHT[e] * TIE_WEIGHT[e] * lane[PLAIN_PLACE(j, j)];
        for (int f = TIE_ROW[k]; f < e; f++) {
            const int m = AT_PARAMETERS + TIE_PARAMETER[f];
            sum += 2.0 * TIE_WEIGHT[e] * TIE_WEIGHT[f] * lane[m < j ? PLAIN_PLACE(m, j) : PLAIN_PLACE(j, m)];
        }
    }
    return sum;
}

/* The usual square of a walk of parameter k over a window, in what its variances allow. */
static inline real usual_walk(const Healthy *healthy, int window, int k)
{
    real usual = SAME(WALK_USUAL);
    for (int w = 0; w <= window; w++) usual = (WALK_TRUST * usual + healthy->walks[w][k]) / (WALK_TRUST + healthy->windows[w]);
    return usual;
}

/* Note a walk, in its limit, if it is the largest so far and counts. */
static inline void take_walk(Healthy *healthy, int window, real k, real part, flag counts)
{
    const flag larger_one = counts & (part > healthy->walk);
    healthy->walk = PICK(larger_one, part, healthy->walk);
    healthy->walker = PICK(larger_one, k + (double)(N_PARAMETERS * window), healthy->walker);
}

/* Learn the square of a walk, in what its variances allow, as that of parameter k, TOGETHER: of all. */
static inline void learn_walk(Healthy *healthy, int window, int k, real square, real weight, flag counts)
{
    const real usual = greater(usual_walk(healthy, window, k), SAME(1.0));
    healthy->walks[window][k] += PICK(counts, weight * lesser(square, WALK_MOST * usual), SAME(0.0));
}

/* Judge how far parameter k has walked over a window, since an old lane; learn from it where it `counts`, with a weight: the
   shortest window as a part of the time since. Gives the walk in what is usual. */
static inline real judge_walk(Healthy *healthy, int window, int k, const real *old, real weight, flag counts)
{
    const real left = own_variance(healthy->lane, k), moved = own_value(healthy->lane, k) - own_value(old, k);
    const real allowed = greater(own_variance(old, k) - left, WALK_LEAST * left);
    const flag judged = counts & (allowed > 0.0);
    const real square = moved * moved / PICK(judged, allowed, SAME(1.0));
    const real walk = ROOT(square / greater(old[KEPT_USUAL + k], SAME(1.0)));
    take_walk(healthy, window, SAME((double)k), walk / WALK_LIMIT, judged);
    learn_walk(healthy, window, k, square, weight, judged);
    return walk;
}

/* The mean square of the walk of all parameters together since an old lane, in what their variances allow: L D L' of the
   matrix. Of what the others tell all but the whole there is nothing to judge. matrix: of TRIANGLE(N_PARAMETERS), memory. */
static inline real walk_together(const Healthy *healthy, const real *old, const double *rates, int n, real *matrix)
{
    real moved[FB_ROOM(N_PARAMETERS)], total = SAME(0.0);
    for (int i = 0; i < N_PARAMETERS; i++) {
        moved[i] = healthy->lane[AT_PARAMETERS + i] - old[AT_PARAMETERS + i];
        for (int j = i; j < N_PARAMETERS; j++) {
            const int at = PLAIN_PLACE(AT_PARAMETERS + i, AT_PARAMETERS + j);
            matrix[IN_TRIANGLE(N_PARAMETERS, i, j)] = old[at] - (1.0 - WALK_LEAST) * healthy->lane[at];
        }
    }
    for (int k = 0; k < N_PARAMETERS; k++) {
        if (is_moving(rates, k)) continue;
        const real *row = &matrix[IN_TRIANGLE(N_PARAMETERS, k, 0)];
        const flag judged = row[k] > WALK_PIVOT * healthy->lane[PLAIN_PLACE(AT_PARAMETERS + k, AT_PARAMETERS + k)];
        const real inverse = PICK(judged, 1.0 / PICK(judged, row[k], SAME(1.0)), SAME(0.0));
        total += moved[k] * moved[k] * inverse;
        for (int i = k + 1; i < N_PARAMETERS; i++) {
            const real factor = row[i] * inverse;
            moved[i] -= factor * moved[k];
            for (int j = i; j < N_PARAMETERS; j++) matrix[IN_TRIANGLE(N_PARAMETERS, i, j)] -= factor * row[j];
        }
    }
    return total / (double)n;
}

/* Judge how far all parameters have walked over a window, each for itself and together, and learn from it; see `judge_walk`. */
static inline void judge_window(Healthy *healthy, int window, const real *old, const double *rates, real weight, flag counts,
                                real *matrix)
{
    real most = SAME(0.0), farthest = SAME(0.0);
    const int n = n_together(rates);
    for (int k = 0; k < N_PARAMETERS; k++) {
        if (is_moving(rates, k)) continue;
        const real walk = judge_walk(healthy, window, k, old, weight, counts);
        farthest = PICK(walk > most, SAME((double)k), farthest);
        most = greater(most, walk);
    }
    if (n < 2) return;
    const real square = walk_together(healthy, old, rates, n, matrix);
    const real walk = ROOT(square / greater(old[KEPT_USUAL + TOGETHER], SAME(1.0)));
    take_walk(healthy, WALKS + 1 + window, farthest, walk / limit_together(n), counts);
    learn_walk(healthy, window, TOGETHER, square, weight, counts);
}

/* Judge how far parameter k is from where it started. Its true value lies off by its accuracy, of which it has found the part
   1 - r, where r of its variance is left; it walks about that as it is usual, and by what was found of it on healthy data.
   After a diagnosis was accepted only what was known just as declared then (of one that is tied, beside the others) is judged,
   such as what was repaired: what a lane has found may be off by more than it says. */
static inline void judge_start(Healthy *healthy, int k, flag first, flag counts)
{
    const double declared = TIE_ROW[k + 1] > TIE_ROW[k] ? 1.0 / OWN_PRECISION[k] : ACCURACY[k] * ACCURACY[k];
    const real *start = healthy->snapshots[AT_START];
    const real before = own_variance(start, k), left = own_variance(healthy->lane, k);
    const real moved = own_value(healthy->lane, k) - own_value(start, k);
    const flag as_declared = (before > (1.0 - AS_DECLARED) * declared) & (before < (1.0 + AS_DECLARED) * declared);
    const flag judged = counts & (before > 0.0) & (first | as_declared);
    const real r = left / PICK(judged, before, SAME(1.0)), found = greater(1.0 - r, SAME(WALK_LEAST));
    const real usual = greater(usual_walk(healthy, WALKS - 1, k), SAME(1.0));
    const double moves = HEALTHY_CHANGE[k] * HEALTHY_CHANGE[k];
    const real sd = ROOT(PICK(judged, before, SAME(1.0)) * found * (found + usual * r) + moves);
    take_walk(healthy, WALKS, SAME((double)k), SIZE(moved) / (sd * START_LIMIT), judged);
}

/* Judge how far the parameters have walked up to sample `index`, where it is time to, and learn how far is usual. rates: of
   parameters that move by themselves, which are not judged; NULL: none does. After an alarm nothing is judged. Once an input was
   unknown, what parameters have learned since the start is not only of the plant. matrix: of TRIANGLE(N_PARAMETERS), memory. */
static inline void judge_walks(int64_t index, const Clock *clock, const Inputs *inputs, const double *rates, Healthy *healthy,
                               real *matrix)
{
    const flag watched = clock->alarm < 0;
    healthy->blind = PICK(watched & any_unknown(inputs), SAME((double)index), healthy->blind);
    healthy->walk = healthy->walker = SAME(0.0);
    if (index % WALK_EVERY != 0) return;
    const real from = walks_from(clock, healthy);
    const flag first = clock->accepted < 0;
    const flag from_start = healthy->blind <= greater(AS_REAL(clock->begun), AS_REAL(clock->accepted));
    for (int window = 0; window < WALKS; window++) {
        const int64_t length = length_of_walk(window), number = compared_with(index, length);
        if (number < 0) break;
        const real weight = SAME((double)WALK_EVERY / (double)(index - number * length));
        const flag counts = watched & (SAME((double)(number * length)) >= from);
        healthy->windows[window] += PICK(counts, weight, SAME(0.0));
        judge_window(healthy, window, healthy->snapshots[kept_at(window, number)], rates, weight, counts, matrix);
    }
    for (int k = 0; k < N_PARAMETERS; k++)
        if (!is_moving(rates, k)) judge_start(healthy, k, first, watched & from_start & (SAME((double)index) >= from));
}

/* Keep the healthy lane for long, where it is time to, of plants that `may`. At an alarm by a walk the lane with which it was
   compared stays. */
static inline void keep_for_long(int64_t index, const Clock *clock, flag may, Healthy *healthy)
{
    const flag goes_on = (healthy->walk <= 1.0) | (clock->quiet == 1);
    const flag kept = may & goes_on & (clock->alarm < 0) & (SAME((double)index) >= walks_from(clock, healthy));
    for (int window = 0; window < WALKS && index % length_of_walk(window) == 0; window++) {
        real *to = healthy->snapshots[kept_at(window, index / length_of_walk(window))];
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) to[i] = PICK(kept, healthy->lane[i], to[i]);
        for (int k = 0; k <= N_PARAMETERS; k++)
            to[KEPT_USUAL + k] = PICK(kept, usual_walk(healthy, window, k), to[KEPT_USUAL + k]);
        to[KEPT_TIME] = PICK(kept, clock->time, to[KEPT_TIME]);
    }
}
