/* One sample of the joint filter: z = [states, slow errors, parameters, slot (size, rate), input noise].

   Extended Kalman filter; covariance as a packed triangle, which cannot become asymmetric; measurements one at a time,
   so that no matrix is inverted. A lane holds z, the triangle, the implicit signals, the roles of the slot, and the
   logarithm of its likelihood. `filters.h` includes this text for each kind of lanes, and says what the names stand for.
   Source: Bierman, Factorization Methods for Discrete Sequential Estimation, 1977 (one measurement at a time, a triangle);
   Bell and Cathey, IEEE Trans. Automatic Control 38 (1993) 294 (a measurement linearised twice). Formulas: docs/method.md,
   "The joint filter". */

typedef struct {
    lanes y[N_OUTPUTS];             /* readings expected */
    lanes slope[N_OUTPUTS][N_JOINT]; /* by z; columns OUT_PLACE only */
    lanes cross[N_OUTPUTS][N_JOINT]; /* covariance times slope */
} Expected;

/* Memory of a sample, apart from the stack where it is large. */
typedef struct {
    Step step;
    lanes a[FB_ROOM(N_STATES)][N_JOINT]; /* slopes of the states by z */
    lanes t[FB_ROOM(N_STATES)][N_JOINT]; /* these times the covariance */
    Expected first, second;
    lanes p_first[N_PACKED], p_second[N_PACKED];
    lanes lane[N_NUMBERS], innovations[2 * N_OUTPUTS];
#if defined(FB_ONE_IS_APART) && !N_SLOT
    double one[ONE_NUMBERS]; /* that of the filter that is one lane wide */
#endif
} Filter;

/* Take one sample into FB_LANES lanes: predict, compare, update.

   Where the readings are not linear, lanes of the bank (`again`) update a second time, if the sample says much. If it
   says little, the first result differs from the mean by little but noise: slopes taken there go with the noise they are
   to weigh, and thousands of such samples drag the estimates away. The healthy lane never does: after a fault the first
   result lies far off, and a second update would explain any fault away. */
FB_OF_FILTERS void filter_step(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample,
                               lanes *FB_RESTRICT innovations, Filter *FB_RESTRICT work);

#ifndef FB_OWN_SAMPLES
#if !N_SLOT
/* Let lanes follow a sample without taking it in: of z and the implicit signals alone. Gives innovations [N_OUTPUTS]. */
FB_OF_FILTERS void filter_follow(lanes *FB_RESTRICT lane, const double *FB_RESTRICT sample, lanes *FB_RESTRICT innovations,
                                 Filter *FB_RESTRICT work);

/* What a relation leaves at the moment of a sample, and its slope by state i: of a sensor, number `relation`, what it reads
   beyond what is expected; of a state, number relation - N_OUTPUTS, its rate. */
FB_OF_FILTERS lanes left_of_relation(const lanes *FB_RESTRICT lane, const double *FB_RESTRICT sample, int relation, int i,
                                     lanes *FB_RESTRICT slope);
#endif

/* Take samples [n_samples][N_SAMPLE] into lanes without a state, see `fb_advance_plain`; where plain ones follow them alone, see
   `fb_follow`, there are no variances, and zeros in their place. */
FB_OF_FILTERS void filter_lanes(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers,
                                double *innovations, int follows, Filter *FB_RESTRICT work);

#if N_SIGNALS > 0
/* What lanes expect of the signals that a person can measure by hand, [N_SIGNALS], SI, under these inputs. */
FB_OF_FILTERS void expect_signals(const lanes *FB_RESTRICT lane, const double *FB_RESTRICT u, lanes *FB_RESTRICT values);
#endif
#endif

#ifdef FB_HOLDS_FILTERS
#include "triangle.h"

#if N_SLOT > 0
/* What the slot adds for each of its size to input k, of which u is recorded. */
static inline lanes added_by_slot(const lanes *FB_RESTRICT lane, int k, given u)
{
    return lane[ROLE_INPUT + k] + lane[ROLE_INPUT_GAIN + k] * u;
}
#endif

/* The vector v of the model: parameters with what the slot adds to them, within their range, and errors of inputs: one that
   does not obey is off by all of what is recorded, u. */
static void joint_to_model(const lanes *FB_RESTRICT lane, const lanes *FB_RESTRICT z, const given *FB_RESTRICT u,
                           lanes *FB_RESTRICT v)
{
    for (int i = 0; i < AT_SLOT; i++) v[i] = z[i];
    for (int k = 0; k < N_INPUTS; k++) v[AT_SLOT + k] = broadcast(0.0);
#if N_SLOT > 0
    for (int k = 0; k < N_PARAMETERS; k++)
        v[AT_PARAMETERS + k] = clamp(z[AT_PARAMETERS + k] + lane[ROLE_THETA + k] * z[AT_SLOT], LOWER[k], UPPER[k]);
    for (int k = 0; k < N_INPUTS; k++)
        v[AT_SLOT + k] = added_by_slot(lane, k, u[k]) * z[AT_SLOT] + lane[ROLE_INPUT_BESIDE + k] * z[AT_SLOT + 1] +
                         (lane[ROLE_OBEYS + k] - 1.0) * u[k];
#else
    (void)lane;
    (void)u;
#endif
    for (int k = 0; k < N_NOISY; k++) v[AT_SLOT + NOISY[k]] += z[AT_NOISE + k];
}

/* The inputs as the model takes them. Where each lane has its own, or they move in the course of a step, they are taken as
   errors of inputs that are zero. */
static inline const double *inputs_of(const given *FB_RESTRICT u, lanes *FB_RESTRICT v)
{
#if defined(FB_OWN_SAMPLES) || N_LINEAR > 0
    static const double none[FB_ROOM(N_INPUTS)] = {0.0};
    for (int k = 0; k < N_INPUTS; k++) v[AT_SLOT + k] += u[k];
    return none;
#else
    (void)v;
    return u;
#endif
}

/* Add a slope by column c of v to a row of slopes by z, under recorded inputs u. */
static inline void add_by_z(const lanes *FB_RESTRICT lane, const given *FB_RESTRICT u, int c, lanes slope,
                            lanes *FB_RESTRICT row)
{
    if (c < AT_SLOT) row[c] = slope;
#if N_SLOT > 0
    if (c >= AT_SLOT) {
        row[AT_SLOT] += slope * added_by_slot(lane, c - AT_SLOT, u[c - AT_SLOT]);
        row[AT_SLOT + 1] += slope * lane[ROLE_INPUT_BESIDE + c - AT_SLOT];
    } else if (c >= AT_PARAMETERS) row[AT_SLOT] += slope * lane[ROLE_THETA + c - AT_PARAMETERS];
#else
    (void)lane;
    (void)u;
#endif
    if (N_NOISY > 0 && c >= AT_SLOT && NOISE_OF_INPUT[c - AT_SLOT] >= 0)
        row[AT_NOISE + NOISE_OF_INPUT[c - AT_SLOT]] = slope;
}

#if N_HELD_STATES > 0 && !defined(FB_OWN_SAMPLES)
/* What lags before sensors that do not read as stated stays where it was before the step, `before`, and goes with nothing else:
   the law that it would follow may have no value. Its variance is that of before, or of the gap. a NULL: there is none. */
static void hold_states(const lanes *FB_RESTRICT before, const given *FB_RESTRICT sample, lanes *FB_RESTRICT lane,
                        lanes (*FB_RESTRICT a)[N_JOINT])
{
    for (int s = 0; s < N_HELD_STATES; s++) {
        const int i = HELD_STATE[s];
        if (!(sample[SAMPLE_HELD + HELD_BY[s]] > 0.0)) continue;
        lane[i] = before[s];
        for (int e = STATE_ROW[i]; a && e < STATE_ROW[i + 1]; e++) a[i][STATE_PLACE[e]] = broadcast(0.0);
    }
}
#endif

/* What states scatter by themselves, and by what nobody saw act. */
static void scatter(lanes *FB_RESTRICT p, const given *FB_RESTRICT sample)
{
    for (int i = 0; i < N_STATES; i++) {
        const given gap = sample[SAMPLE_GAP + i];
        p[PLACE(i, i)] += (SHARED(sample[SAMPLE_DT]) > 0.0 ? STATE_VARIANCE[i] : 0.0) + gap * gap;
    }
}

#if N_SLOT > 0 && DRIFTS_KEEP
/* Add so much of number k of z, which stands behind it, to state i, and to its row of the covariance. */
static inline void add_to_state(lanes *FB_RESTRICT p, int i, int k, lanes much)
{
    p[PLACE(i, i)] += much * (2.0 * p[PLACE(i, k)] + much * p[PLACE(k, k)]);
    for (int j = 0; j < N_JOINT; j++)
        if (j != i) p[j < i ? PLACE(j, i) : PLACE(i, j)] += much * p[j < k ? PLACE(j, k) : PLACE(k, j)];
}

/* Stores whose content goes on while the slot moves their parameter for dt: the state x, an effort or a flow, becomes
   x (after / before)^m, with m = d ln x / d ln theta at constant content. p: their covariance. */
static void keep_contents(lanes *FB_RESTRICT lane, lanes *FB_RESTRICT p, lanes dt)
{
    const lanes none = broadcast(0.0), one = broadcast(1.0);
    for (int i = 0; i < N_STATES; i++)
        for (int e = JUMP_ROW[i]; e < JUMP_ROW[i + 1]; e++) {
            const int k = AT_PARAMETERS + JUMP_PARAMETER[e];
            const lanes acts = lane[ROLE_THETA + JUMP_PARAMETER[e]], by = acts * lane[ROLE_KEEPS] * dt;
            const lanes before = lane[k] + acts * lane[AT_SLOT], after = before + by * lane[AT_SLOT + 1];
            const mask moves = (by > 0.0) & (before > 0.0) & (after > 0.0);
            if (!any_of(moves)) continue;
            const lanes factor = v_pow(choose(moves, after, one) / choose(moves, before, one), broadcast(JUMP_EXPONENT[e]));
            for (int j = 0; j < N_JOINT; j++) p[j < i ? PLACE(j, i) : PLACE(i, j)] *= j == i ? factor * factor : factor;
            lane[i] *= factor;
            const lanes slope = choose(moves, JUMP_EXPONENT[e] * lane[i] / after, none);
            const lanes other = choose(moves, slope - JUMP_EXPONENT[e] * lane[i] / before, none);
            add_to_state(p, i, AT_SLOT + 1, slope * by);
            add_to_state(p, i, AT_SLOT, other * acts);
            add_to_state(p, i, k, other);
        }
}
#endif

/* The rest of z and its covariance: slow errors fade, the slot moves at its rate, input noise begins anew or lasts. */
static void spread_rest(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, const double *FB_RESTRICT decays)
{
    lanes *FB_RESTRICT p = lane + AT_COVARIANCE;
    for (int k = 0; k < N_SLOW; k++) {
        const int i = AT_SLOW + k;
        const double decay = decays[k];
        for (int j = 0; j < i; j++) p[PLACE(j, i)] *= decay;
        p[PLACE(i, i)] *= decay * decay;
        p[PLACE(i, i)] += SLOW_VARIANCE[k] * (1.0 - decay * decay) + sample[SAMPLE_KICK + k];
        for (int j = i + 1; j < N_JOINT; j++) p[PLACE(i, j)] *= decay;
        lane[i] *= decay;
    }
#if N_SLOT > 0
    const int size = AT_SLOT, rate = AT_SLOT + 1;
    lanes dt = SHARED(sample[SAMPLE_DT]) * lane[ROLE_MOVES], left = broadcast(1.0);
    if (STEPS_LAG) { /* the rate fades meanwhile; dt: in what time it would have done as much, had it not */
        const lanes fades = lane[ROLE_FADES];
        left = v_exp(-dt * fades);
        dt = choose(fades > 0.0, (1.0 - left) / choose(fades > 0.0, fades, left), dt);
    }
#if DRIFTS_KEEP
    keep_contents(lane, p, dt);
#endif
    for (int i = 0; i < size; i++) p[PLACE(i, size)] += dt * p[PLACE(i, rate)];
    p[PLACE(size, size)] += dt * (2.0 * p[PLACE(size, rate)] + dt * p[PLACE(rate, rate)]);
    p[PLACE(size, rate)] += dt * p[PLACE(rate, rate)];
    lane[size] += dt * lane[rate];
    for (int i = 0; i < N_JOINT && STEPS_LAG; i++) p[i < rate ? PLACE(i, rate) : PLACE(rate, i)] *= i == rate ? left * left : left;
    lane[rate] *= left;
#endif
    for (int k = 0; k < N_NOISY; k++) {
        const int i = AT_NOISE + k;
        const given fade = sample[SAMPLE_FADE + k];
        for (int j = 0; j < i; j++) p[PLACE(j, i)] *= fade;
        p[PLACE(i, i)] = p[PLACE(i, i)] * (fade * fade) + sample[SAMPLE_FRESH + k];
        for (int j = i + 1; j < N_JOINT; j++) p[PLACE(i, j)] *= fade;
        lane[i] *= fade;
    }
}

/* From the sample before to this one: the states move on. An input was held at `u_before`, or went linearly from there to where
   it is, or was there all the time; `middle` [N_INPUTS]: where it was half way. */
static void move_states(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, int sloped, given *FB_RESTRICT middle,
                        Filter *FB_RESTRICT work)
{
    lanes v[N_V], climb[FB_ROOM(N_INPUTS)];
    given begin[FB_ROOM(N_INPUTS)]; /* of the step */
    for (int k = 0; k < N_INPUTS; k++) begin[k] = sample[(INPUT_NEXT[k] ? SAMPLE_U : SAMPLE_U_BEFORE) + k];
    joint_to_model(lane, lane, begin, v);
    const double *FB_RESTRICT u = inputs_of(begin, v);
    for (int k = 0; k < N_INPUTS; k++) {
        climb[k] = INPUT_LINEAR[k] ? EACH(sample[SAMPLE_U + k] - sample[SAMPLE_U_BEFORE + k]) : broadcast(0.0);
#if N_SLOT > 0
        climb[k] *= lane[ROLE_OBEYS + k] + lane[ROLE_INPUT_GAIN + k] * lane[AT_SLOT];
#endif
        middle[k] = begin[k];
        if (INPUT_LINEAR[k]) middle[k] += 0.5 * (sample[SAMPLE_U + k] - sample[SAMPLE_U_BEFORE + k]);
    }
    const double dt = SHARED(sample[SAMPLE_DT]);
    for (int k = 0; k < N_SLOW && dt != work->step.dt; k++) work->step.decay[k] = exp(-dt / SLOW_MEMORY[k]);
    integrate(v, u, climb, dt, SHARED(sample[SAMPLE_STILL]) > 0.0, sloped, lane + AT_IMPLICIT, &work->step);
    for (int i = 0; i < N_STATES; i++) lane[i] = v[i];
}

/* From the sample before to this one: z and covariance move on. */
static void predict(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, Filter *FB_RESTRICT work)
{
    given middle[FB_ROOM(N_INPUTS)];
#if N_HELD_STATES > 0 && !defined(FB_OWN_SAMPLES)
    lanes before[FB_ROOM(N_HELD_STATES)], variance[FB_ROOM(N_HELD_STATES)];
    for (int s = 0; s < N_HELD_STATES; s++) {
        before[s] = lane[HELD_STATE[s]];
        variance[s] = lane[AT_COVARIANCE + PLACE(HELD_STATE[s], HELD_STATE[s])];
    }
#endif
    move_states(lane, sample, 1, middle, work);
    for (int i = 0; i < N_STATES; i++) {
        for (int e = STATE_ROW[i]; e < STATE_ROW[i + 1]; e++) work->a[i][STATE_PLACE[e]] = broadcast(0.0);
        FOR_REACH (i, c) add_by_z(lane, middle, c, WIDE(work->step.slope[i][c]), work->a[i]);
    }
#if N_HELD_STATES > 0 && !defined(FB_OWN_SAMPLES)
    hold_states(before, sample, lane, work->a);
    spread_states(lane + AT_COVARIANCE, work->a, work->t);
    scatter(lane + AT_COVARIANCE, sample);
    for (int s = 0; s < N_HELD_STATES; s++) {
        if (!(sample[SAMPLE_HELD + HELD_BY[s]] > 0.0)) continue;
        lanes *own = &lane[AT_COVARIANCE + PLACE(HELD_STATE[s], HELD_STATE[s])];
        *own = v_fmax(*own, variance[s]);
    }
#else
    spread_states(lane + AT_COVARIANCE, work->a, work->t);
    scatter(lane + AT_COVARIANCE, sample);
#endif
    spread_rest(lane, sample, work->step.decay);
}

/* Noise variance of a sensor of which y is expected: what is measured would make a reading that is too large by chance count
   less than one that is too small. While it is blanked, whatever noise it has is nothing. */
static inline lanes noise_of(const lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, lanes y, int j)
{
    const given declared = OUTPUT_VARIANCE[j] * sample[SAMPLE_SCALE + j];
    lanes noise = EACH(declared);
    if (NOISE_GROWS) noise *= 1.0 + OUTPUT_GROWTH[j] * y * y;
#if N_SLOT > 0
    if (sample[SAMPLE_SCALE + j] < BLANK_FACTOR) return noise * lane[ROLE_NOISE + j];
#else
    (void)lane;
    (void)y;
#endif
    return noise;
}

/* What the sensors read at z, with the implicit signals found from `implicit` on, and their slopes by the model's vector. */
static void read_sensors(const lanes *FB_RESTRICT lane, const lanes *FB_RESTRICT z, const given *FB_RESTRICT sample,
                         lanes *FB_RESTRICT implicit, lanes *FB_RESTRICT y, lanes *FB_RESTRICT slopes)
{
    lanes v[N_V];
    joint_to_model(lane, z, sample + SAMPLE_U, v);
    const double *FB_RESTRICT u = inputs_of(sample + SAMPLE_U, v);
    solve_implicit(v, u, implicit);
    model_readings(v, u, implicit, y, slopes);
}

/* What the sensors are expected to read at z. */
static void expect(const lanes *FB_RESTRICT lane, const lanes *FB_RESTRICT z, const given *FB_RESTRICT sample,
                   lanes *FB_RESTRICT implicit, Expected *FB_RESTRICT found)
{
    lanes slopes[FB_ROOM(N_READING_SLOPES)];
    read_sensors(lane, z, sample, implicit, found->y, slopes);
    for (int j = 0; j < N_OUTPUTS; j++) {
        lanes *FB_RESTRICT row = found->slope[j];
        for (int e = OUT_ROW[j]; e < OUT_ROW[j + 1]; e++) row[OUT_PLACE[e]] = broadcast(0.0);
        for (int e = READING_ROW[j]; e < READING_ROW[j + 1]; e++) add_by_z(lane, sample + SAMPLE_U, READING_COLUMN[e], slopes[e], row);
#if N_SLOT > 0
        const lanes plain = found->y[j], factor = lane[ROLE_READS + j] + lane[ROLE_GAIN + j] * z[AT_SLOT];
        for (int e = OUT_ROW[j]; e < OUT_ROW[j + 1]; e++) row[OUT_PLACE[e]] *= factor;
        row[AT_SLOT] += lane[ROLE_BIAS + j] + lane[ROLE_GAIN + j] * plain;
        row[AT_SLOT + 1] += lane[ROLE_BIAS_BESIDE + j];
        found->y[j] = plain * factor + lane[ROLE_BIAS + j] * z[AT_SLOT] + lane[ROLE_BIAS_BESIDE + j] * z[AT_SLOT + 1];
#endif
        times(j, lane + AT_COVARIANCE, row, found->cross[j]);
    }
}

/* Scalar updates with all sensors, one after the other: how z moves, and the covariance after them, p_next (may be the
   lane's own; NULL: it is not asked for). Gives the gain in log-likelihood where that is `counted`. Missing sensors have
   use 0.

   Once warm, the healthy lane learns from an innovation only up to a bound (Huber's): a fault, or a wild value, must not
   drag it along before the alarm. Lanes of the bank have a wide bound, beyond which likelihoods do not fall any more: one
   reading that nothing explains must not decide between them.

   The covariance is written once, at the end. Of many sensors what each has told would add up to rounding errors of what
   was not known before, so there it is written after each of them. */
static lanes update(const lanes *lane, const given *FB_RESTRICT sample, Expected *FB_RESTRICT found,
                    lanes *FB_RESTRICT shift, lanes *p_next, int counted)
{
    const double limit = SHARED(sample[SAMPLE_BOUND]), bound = limit > 0.0 ? limit : NO_BOUND;
    lanes weight[N_OUTPUTS][N_JOINT], gained = broadcast(0.0);
    for (int i = 0; i < N_JOINT; i++) shift[i] = broadcast(0.0);
    for (int j = 0; j < N_OUTPUTS; j++) {
        lanes *FB_RESTRICT cross = found->cross[j];
        const given use = sample[SAMPLE_USE + j];
        if (MANY_OUTPUTS && j > 0) times(j, p_next, found->slope[j], cross);
        for (int k = 0; !MANY_OUTPUTS && k < j; k++) { /* what the sensors before have told already */
            const lanes told = along(found->slope[j], found->cross[k], j);
            for (int i = 0; i < N_JOINT; i++) cross[i] -= weight[k][i] * told;
        }
#ifndef FB_OWN_SAMPLES
        if (!(use > 0.0)) { /* where its law has no value a weight of 0 would be no number */
            for (int i = 0; i < N_JOINT; i++) weight[j][i] = cross[i] = broadcast(0.0);
            if (MANY_OUTPUTS) take_off(j == 0 ? lane + AT_COVARIANCE : p_next, &weight[j], &found->cross[j], 1, p_next);
            continue;
        }
#endif
        const lanes variance = noise_of(lane, sample, found->y[j], j) + along(found->slope[j], cross, j);
        const lanes innovation = sample[SAMPLE_Y + j] - found->y[j] - along(found->slope[j], shift, j);
        const lanes inverse = 1.0 / variance, most = bound * v_sqrt(variance);
        const lanes step = v_fmin(v_fmax(innovation, -most), most);
        for (int i = 0; i < N_JOINT; i++) {
            weight[j][i] = cross[i] * (use * inverse);
            shift[i] += weight[j][i] * step;
        }
        if (MANY_OUTPUTS) take_off(j == 0 ? lane + AT_COVARIANCE : p_next, &weight[j], &found->cross[j], 1, p_next);
        if (!counted) continue;
        /* In units of the sensor's noise, so that likelihoods keep a sensible size whatever the unit. */
        const lanes misfit = v_fmin(innovation * innovation * inverse, broadcast(WILDEST));
        const lanes width = v_log(variance * (1.0 / OUTPUT_VARIANCE[j]));
        const given nis = sample[SAMPLE_NIS + j], usual = GIVEN(nis > 0.0, nis, 1.0), least = GIVEN(usual > 1.0, usual, 1.0);
        const given run = sample[SAMPLE_RUN + j], temper = least + GIVEN(run > least, run - least, 0.0);
        gained -= 0.5 * use * (misfit + usual * width + LOG_2_PI) / temper;
    }
    if (!MANY_OUTPUTS && p_next) take_off(lane + AT_COVARIANCE, weight, found->cross, N_OUTPUTS, p_next);
    return gained;
}

/* z after a shift, parameters within their range. */
static void shifted(const lanes *FB_RESTRICT z, const lanes *FB_RESTRICT shift, lanes *FB_RESTRICT to)
{
    for (int i = 0; i < N_JOINT; i++) to[i] = z[i] + shift[i];
    for (int k = 0; k < N_PARAMETERS; k++) to[AT_PARAMETERS + k] = clamp(to[AT_PARAMETERS + k], LOWER[k], UPPER[k]);
}

/* Differences and variances of each sensor by itself, as the detector wants them; tells where the sample says much: the
   variance of what is expected of a sensor that is used, in that of its noise. */
static mask innovate(const lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, const Expected *FB_RESTRICT found,
                      lanes *FB_RESTRICT innovations)
{
    lanes foretold = broadcast(0.0);
    for (int j = 0; j < N_OUTPUTS; j++) {
        const lanes noise = noise_of(lane, sample, found->y[j], j), variance = along(found->slope[j], found->cross[j], j) + noise;
        innovations[j] = sample[SAMPLE_Y + j] - found->y[j];
        innovations[N_OUTPUTS + j] = variance;
        foretold = v_fmax(sample[SAMPLE_USE + j] * (variance - (1.0 + SAYS_MUCH) * noise), foretold);
    }
    return foretold > 0.0;
}

/* Update a second time, linearised at the parameters and the slot of the first result, where `again` is true. `guess`,
   `p_first`: the first result; the former is changed, the latter NULL where no lane keeps it. The states are taken where
   they were predicted. */
static void update_again(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample, mask again, lanes *FB_RESTRICT guess,
                         const lanes *FB_RESTRICT p_first, Filter *FB_RESTRICT work)
{
    lanes middle[N_JOINT], apart[N_JOINT], shift[N_JOINT], second[N_JOINT], better[FB_ROOM(N_IMPLICIT)];
    Expected *FB_RESTRICT found = &work->second;
    for (int i = 0; i < N_JOINT; i++) {
        middle[i] = i >= AT_PARAMETERS && i < AT_NOISE ? guess[i] : lane[i];
        apart[i] = lane[i] - middle[i];
    }
    for (int k = 0; k < N_IMPLICIT; k++) better[k] = lane[AT_IMPLICIT + k];
    expect(lane, middle, sample, better, found);
    for (int j = 0; j < N_OUTPUTS; j++) found->y[j] += along(found->slope[j], apart, j);
    update(lane, sample, found, shift, p_first ? work->p_second : lane + AT_COVARIANCE, 0);
    shifted(lane, shift, second);
    for (int i = 0; i < N_JOINT; i++) guess[i] = choose(again, second[i], guess[i]);
    for (int i = 0; p_first && i < N_PACKED; i++)
        lane[AT_COVARIANCE + i] = choose(again, work->p_second[i], p_first[i]);
    for (int k = 0; k < N_IMPLICIT; k++) lane[AT_IMPLICIT + k] = choose(again, better[k], lane[AT_IMPLICIT + k]);
}

FB_OF_FILTERS void filter_step(lanes *FB_RESTRICT lane, const given *FB_RESTRICT sample,
                               lanes *FB_RESTRICT innovations, Filter *FB_RESTRICT work)
{
    lanes shift[N_JOINT], guess[N_JOINT];
    Expected *FB_RESTRICT found = &work->first;
    predict(lane, sample, work);
    expect(lane, lane, sample, lane + AT_IMPLICIT, found);
    const mask says_much = innovate(lane, sample, found, innovations);
    const int again = !LINEAR_READINGS && SHARED(sample[SAMPLE_AGAIN]) > 0.0 && any_of(says_much);
    lanes *p_first = !again ? lane + AT_COVARIANCE : MANY_OUTPUTS || !all_of(says_much) ? work->p_first : NULL;
    lane[AT_LIKELIHOOD] += update(lane, sample, found, shift, p_first, 1);
    shifted(lane, shift, guess);
    if (again) update_again(lane, sample, says_much, guess, p_first, work);
    memcpy(lane, guess, sizeof guess);
}

#ifndef FB_OWN_SAMPLES
#if !N_SLOT
FB_OF_FILTERS void filter_follow(lanes *FB_RESTRICT lane, const double *FB_RESTRICT sample, lanes *FB_RESTRICT innovations,
                                 Filter *FB_RESTRICT work)
{
    double middle[FB_ROOM(N_INPUTS)];
    lanes slopes[FB_ROOM(N_READING_SLOPES)];
#if N_HELD_STATES > 0
    lanes before[FB_ROOM(N_HELD_STATES)];
    for (int s = 0; s < N_HELD_STATES; s++) before[s] = lane[HELD_STATE[s]];
#endif
    move_states(lane, sample, 0, middle, work);
#if N_HELD_STATES > 0
    hold_states(before, sample, lane, NULL);
#endif
    for (int k = 0; k < N_SLOW; k++) lane[AT_SLOW + k] *= work->step.decay[k];
    for (int k = 0; k < N_NOISY; k++) lane[AT_NOISE + k] *= sample[SAMPLE_FADE + k];
    read_sensors(lane, lane, sample, lane + AT_IMPLICIT, innovations, slopes);
    for (int j = 0; j < N_OUTPUTS; j++) innovations[j] = sample[SAMPLE_Y + j] - innovations[j];
    for (int k = 0; k < N_PARAMETERS; k++) lane[AT_PARAMETERS + k] = clamp(lane[AT_PARAMETERS + k], LOWER[k], UPPER[k]);
}

FB_OF_FILTERS lanes left_of_relation(const lanes *FB_RESTRICT lane, const double *FB_RESTRICT sample, int relation, int i,
                                     lanes *FB_RESTRICT slope)
{
    lanes v[N_V], implicit[FB_ROOM(N_IMPLICIT)], rates[FB_ROOM(N_STATES)], y[N_OUTPUTS], of_readings[FB_ROOM(N_READING_SLOPES)];
    steep of_rates[FB_ROOM(N_RATE_SLOPES)];
    const int state = relation - N_OUTPUTS;
    *slope = broadcast(0.0);
    for (int k = 0; k < N_IMPLICIT; k++) implicit[k] = lane[AT_IMPLICIT + k];
    joint_to_model(lane, lane, sample + SAMPLE_U, v);
    const double *FB_RESTRICT u = inputs_of(sample + SAMPLE_U, v);
    solve_implicit(v, u, implicit);
    if (state < 0) {
        model_readings(v, u, implicit, y, of_readings);
        for (int e = READING_ROW[relation]; e < READING_ROW[relation + 1]; e++)
            if (READING_COLUMN[e] == i) *slope = -of_readings[e];
        return sample[SAMPLE_Y + relation] - y[relation];
    }
    model_rates(v, u, implicit, rates, of_rates);
    for (int e = RATE_ROW[state]; e < RATE_ROW[state + 1]; e++)
        if (RATE_COLUMN[e] == i) *slope = WIDE(of_rates[e]);
    return rates[state];
}
#endif

FB_OF_FILTERS void filter_lanes(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers,
                                double *innovations, int follows, Filter *FB_RESTRICT work)
{
    work->step.dt = NAN;
    for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) work->innovations[i] = broadcast(0.0);
    for (int64_t first = 0; first < n_lanes; first += FB_LANES) {
        for (int64_t i = 0; i < N_NUMBERS; i++) work->lane[i] = load(numbers + i * n_lanes + first);
        for (int64_t t = 0; t < n_samples; t++) {
#if !N_SLOT
            if (follows) filter_follow(work->lane, samples + t * N_SAMPLE, work->innovations, work);
            else
#else
            (void)follows;
#endif
            filter_step(work->lane, samples + t * N_SAMPLE, work->innovations, work);
            double *out = innovations + t * 2 * N_OUTPUTS * n_lanes + first;
            for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) store(out + i * n_lanes, work->innovations[i]);
        }
        for (int64_t i = 0; i < N_NUMBERS; i++) store(numbers + i * n_lanes + first, work->lane[i]);
    }
}

#if N_SIGNALS > 0
FB_OF_FILTERS void expect_signals(const lanes *FB_RESTRICT lane, const double *FB_RESTRICT u, lanes *FB_RESTRICT values)
{
    lanes v[N_V], implicit[FB_ROOM(N_IMPLICIT)];
    joint_to_model(lane, lane, u, v);
    for (int k = 0; k < N_IMPLICIT; k++) implicit[k] = lane[AT_IMPLICIT + k];
    solve_implicit(v, u, implicit);
    model_signals(v, u, implicit, values);
}
#endif
#endif
#endif
