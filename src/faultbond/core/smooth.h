/* What acts, from a record that scatters about it: so many local linear trends follow the record of an input, each a Kalman
   filter that lets level or slope wander by another part of the noise, and count by how well each has foretold the record of
   late. So no size has to be stated, and a record that hardly changes is averaged over many samples. A trend that misses by
   more than chance allows begins anew where the record is: a step is followed at once.

   What is left is an error of what acts that lasts: variance and correlation from one sample to the next are those of the
   filters. The joint filter takes the mean of the trends as the input, and this error as its noise.

   Source: local level and local linear trend, Harvey, Forecasting, Structural Time Series Models and the Kalman Filter, 1989,
   section 4.1; weights by the recent square of what was not foretold, in place of likelihoods.

   watching.h includes this text, for one plant and for FB_LANES assets side by side. */

/* One trend takes the record u: `trend` moves on. Gives the covariance of its errors before and after, in that of the noise. */
static inline real follow_record(int t, real u, double sd, real *trend)
{
    const real level = trend[TREND_LEVEL] + trend[TREND_SLOPE], shared = trend[TREND_VARIANCE] + trend[TREND_TIE];
    const real foretold = shared + trend[TREND_TIE] + trend[TREND_SLOPES] + TREND_WANDERS[t];
    const real tie = trend[TREND_TIE] + trend[TREND_SLOPES], slopes = trend[TREND_SLOPES] + TREND_TURNS[t];
    const real miss = (u - level) / sd, square = miss * miss;
    const real lately = trend[TREND_LATELY] + TREND_SHARE * (miss - trend[TREND_LATELY]), twice = lately * lately;
    const flag jumps = twice > TREND_JUMP * (TREND_SHARE / (2.0 - TREND_SHARE)) * (foretold + 1.0);
    const real variance = PICK(jumps, foretold + greater(square, twice), foretold);
    const real gain = variance / (variance + 1.0), turn = tie / (variance + 1.0);
    trend[TREND_LEVEL] = level + gain * miss * sd;
    trend[TREND_SLOPE] = trend[TREND_SLOPE] + turn * miss * sd;
    trend[TREND_VARIANCE] = gain;
    trend[TREND_TIE] = turn;
    trend[TREND_SLOPES] = slopes - turn * tie;
    trend[TREND_LATELY] = PICK(jumps, SAME(0.0), lately);
    trend[TREND_MISS] = trend[TREND_MISS] + (lesser(square, SAME(TREND_MOST)) - trend[TREND_MISS]) / TREND_MEMORY;
    return (1.0 - gain) * shared;
}

/* A trend begins where the record is, u; nothing is known of its slope, if it has one. */
static inline void begin_trend(int t, real u, flag is_first, real *trend)
{
    const double known[TREND_NUMBERS] = {0.0, 0.0, 1.0, 0.0, TREND_TURNS[t] > 0.0 ? TREND_STEEPEST : 0.0, 0.0, 1.0};
    for (int k = 0; k < TREND_NUMBERS; k++) trend[k] = PICK(is_first, k == TREND_LEVEL ? u : SAME(known[k]), trend[k]);
}

/* The mean of the trends of smooth input m, which becomes its value u, and how the error of what acts goes on: it is `fade` times
   the one before, and a `fresh` variance is added. */
static inline void smooth_input(Inputs *inputs, int m, real *u, real *fade, real *fresh)
{
    real(*trends)[TREND_NUMBERS] = inputs->trends[m];
    const double noise = INPUT_VARIANCE[SMOOTH_NOISE[m]], sd = sqrt(noise);
    const flag told = is_finite(*u) & (greater(*u, -*u) < TREND_FARTHEST * sd), is_first = told & (inputs->rough[m] == 0.0);
    real passed[TRENDS], weight[TRENDS], least = SAME(INFINITY), sum = SAME(0.0), mean = SAME(0.0);
    real variance = SAME(0.0), shared = SAME(0.0);
    for (int t = 0; t < TRENDS; t++) {
        real trend[TREND_NUMBERS];
        memcpy(trend, trends[t], sizeof trend);
        passed[t] = PICK(is_first, SAME(0.0), follow_record(t, *u, sd, trend));
        begin_trend(t, *u, is_first, trend);
        for (int k = 0; k < TREND_NUMBERS; k++) trends[t][k] = PICK(told, trend[k], trends[t][k]);
        least = lesser(trends[t][TREND_MISS], least);
    }
    for (int t = 0; t < TRENDS; t++) {
        weight[t] = least / trends[t][TREND_MISS];
        for (int k = 0; k < TREND_DOUBLINGS; k++) weight[t] *= weight[t];
        sum += weight[t];
        mean += weight[t] * trends[t][TREND_LEVEL];
    }
    mean = mean / sum;
    for (int t = 0; t < TRENDS; t++) {
        const real apart = (trends[t][TREND_LEVEL] - mean) / sd;
        variance += weight[t] / sum * (trends[t][TREND_VARIANCE] + apart * apart);
        shared += weight[t] / sum * passed[t];
    }
    const real before = inputs->rough[m], kept = PICK(before > 0.0, lesser(shared / before, SAME(1.0)), SAME(0.0));
    *u = PICK(told, mean, *u);
    *fade = PICK(told, kept, SAME(1.0));
    *fresh = PICK(told, noise * greater(variance - kept * kept * before, TREND_LEAST * variance), SAME(0.0));
    inputs->rough[m] = PICK(told, greater(variance, kept * kept * before + TREND_LEAST * variance), before);
}

/* Let what acts take the place of the records of smooth inputs in a sample, and state how the errors of all noisy inputs go
   on; those of inputs that scatter themselves begin anew. */
static inline void smooth_inputs(Inputs *inputs, Sample *sample)
{
    for (int k = 0; k < N_NOISY; k++) {
        sample->record[k] = sample->u[NOISY[k]];
        sample->fade[k] = SAME(0.0);
        sample->fresh[k] = SAME(INPUT_VARIANCE[k]);
    }
    for (int m = 0; m < N_SMOOTH; m++) {
        const int k = SMOOTH_NOISE[m];
        smooth_input(inputs, m, &sample->u[NOISY[k]], &sample->fade[k], &sample->fresh[k]);
    }
}
