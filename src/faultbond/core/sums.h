/* The sums of the detector: CUSUMs of the innovations of each sensor, slow and fast, and of their scatter; see `detector.h`.
   Of one plant, of some side by side, and of the trials with which `analyse` asks for the smallest fault: see `watching.h`.
   Formulas: docs/method.md, "The alarm". */

/* The limit of the slow sums in those of the fast ones, and in those of the scatter. */
static inline real scale_of_fast(void) { return SAME(isfinite(CUSUM_LIMIT) ? CUSUM_LIMIT / FAST_LIMIT : 1.0); }
static inline real scale_of_scatter(void) { return SAME(isfinite(CUSUM_LIMIT) ? CUSUM_LIMIT / SCATTER_LIMIT : 1.0); }

/* Limit what one sample contributes. */
static inline real clip(real score)
{
    return PICK(score > CUSUM_CLIP, SAME(CUSUM_CLIP), PICK(score < -CUSUM_CLIP, SAME(-CUSUM_CLIP), score));
}

/* Log-likelihood ratio of SCATTER_RATIO times the declared noise, for the difference of two innovations. To each of the last
   ones, since a bias, or what the model gets wrong slowly, is no noise; nor is an oscillation, which returns to where it
   was after some samples. */
static inline real scatter_gain(real apart)
{
    const real size = lesser(SIZE(apart), SAME(FB_SQRT2 * CUSUM_CLIP));
    return 0.25 * (1.0 - 1.0 / (SCATTER_RATIO * SCATTER_RATIO)) * size * size - log(SCATTER_RATIO);
}

/* Take the innovation of sensor j, in its standard deviation, into its sums where it counts. */
static inline void add_score(Sensors *sensors, int j, real score, flag counts)
{
    const real limited = clip(score);
    for (int side = 0; side < 2; side++) {
        const real one = side ? -limited : limited;
        real *slow = &sensors->cusum[side][j], *fast = &sensors->fast[side][j];
        *slow = PICK(counts, positive(*slow + (one - CUSUM_DRIFT)), *slow);
        *fast = PICK(counts, positive(*fast + (one - FAST_DRIFT)), *fast);
    }
    for (int k = 0; k < LAGS; k++) {
        const real gained = sensors->scatter[k][j] + scatter_gain(score - sensors->before[k][j]);
        const flag compared = counts & is_finite(sensors->before[k][j]);
        sensors->scatter[k][j] = PICK(compared, positive(gained), sensors->scatter[k][j]);
    }
    for (int k = LAGS - 1; k >= 0; k--)
        sensors->before[k][j] = PICK(counts, k > 0 ? sensors->before[k - 1][j] : score, sensors->before[k][j]);
}

/* The scatter counts as far as it is seen against each of the last innovations. */
static inline real least_scatter(const Sensors *sensors, int j)
{
    real found = sensors->scatter[0][j];
    for (int k = 1; k < LAGS; k++) found = lesser(found, sensors->scatter[k][j]);
    return found;
}

/* The largest sum of sensor j, in the scale of the slow ones: above CUSUM_LIMIT is an alarm. How far the others are on their
   way counts. */
static inline real statistic(const Sensors *sensors, int j)
{
    const real fast = scale_of_fast() * greater(sensors->fast[0][j], sensors->fast[1][j]);
    const real slow = greater(sensors->cusum[0][j], sensors->cusum[1][j]);
    return greater(greater(slow, fast), scale_of_scatter() * least_scatter(sensors, j));
}
