/* What a lane has found: values of its suspects with their standard deviations, in SI, and when a drift reaches a
   limit. Formulas: docs/method.md, "The bank". */
#ifndef FB_ESTIMATES_H
#define FB_ESTIMATES_H

#include "bank.h"

FB_SELDOM

#define LONGEST 1e12 /* s: a limit that is not reached by then is not reached */
#define HALVINGS 200

/* A value that drifts towards a limit, and the covariance of value and rate. */
typedef struct {
    double ahead, speed;
    double variance, both, rate_variance;
} Drift;

static inline double root_of(double variance) { return sqrt(0.0 > variance ? 0.0 : variance); }

/* Probability that the limit has been passed after some seconds. A straight line v + r t with v, r normal has passed
   it by t with the probability that v + r t lies beyond it, which is normal too. */
static double passed(const Drift *drift, double after)
{
    const double spread = drift->variance + 2.0 * drift->both * after + drift->rate_variance * (after * after);
    const double score = (drift->speed * after - drift->ahead) / sqrt(1e-300 > spread ? 1e-300 : spread);
    return 0.5 * erfc(-score / FB_SQRT2);
}

/* First time after `time` at which that probability has been reached, s; nan if it never is. */
static double first_time(const Drift *drift, double time, double part)
{
    double low = 0.0, high = 1.0;
    while (passed(drift, high) < part) {
        high *= 2.0;
        if (high > LONGEST) return NAN;
    }
    for (int k = 0; k < HALVINGS; k++) {
        const double middle = 0.5 * (low + high);
        if (middle == low || middle == high) break;
        if (passed(drift, middle) >= part) {
            high = middle;
        } else {
            low = middle;
        }
    }
    return time + high;
}

/* When the value of a suspect that drifts reaches a limit; now, where it has passed it. What lies beyond the nominal
   value is passed from there. covariance: variance of the value, covariance of both, variance of the rate. */
static Forecast forecast(double time, double limit, const Suspect *suspect, const double *covariance)
{
    const double side = limit >= suspect->nominal ? 1.0 : -1.0;
    const double ahead = side * (limit - suspect->estimate), speed = side * suspect->rate;
    const Drift drift = {ahead, speed, covariance[0], covariance[1], covariance[2]};
    const double early = first_time(&drift, time, 0.05), late = first_time(&drift, time, 0.95);
    const Forecast found = {limit, first_time(&drift, time, 0.5), early, late};
    return found;
}

static void no_suspect(Suspect *suspect)
{
    memset(suspect, 0, sizeof *suspect);
    suspect->parameter = suspect->input = suspect->output = -1;
    suspect->word = WORD_NONE;
    suspect->nominal = suspect->rate = suspect->rate_sd = suspect->began = suspect->ended = suspect->stopped = NAN;
}

/* Number i of a lane, and a covariance of it: of steps, or with a slot. */
static double number_in(const Bank *bank, int64_t lane, int64_t i)
{
    return lane < N_STEPS ? of_step(bank, lane, i) : of_slot(bank, lane - N_STEPS, i);
}

static double covariance_in(const Bank *bank, int64_t lane, int64_t i, int64_t j)
{
    const int64_t a = i < j ? i : j, b = i < j ? j : i;
    return lane < N_STEPS ? of_step(bank, lane, PLAIN_PLACE(a, b)) : of_slot(bank, lane - N_STEPS, WIDE_PLACE(a, b));
}

/* A parameter as a lane has it: of steps, or beside a slot. */
static void parameter_suspect(const Bank *bank, int64_t lane, int parameter, Suspect *suspect)
{
    const int k = AT_PARAMETERS + parameter;
    no_suspect(suspect);
    suspect->parameter = parameter;
    suspect->nominal = NOMINAL[parameter];
    suspect->estimate = SCALE[parameter] * number_in(bank, lane, k);
    suspect->sd = fabs(SCALE[parameter]) * root_of(covariance_in(bank, lane, k, k));
}

/* The bias of an instrument beside the slot of a lane, as it has it. */
static void instrument_beside(const Bank *bank, int64_t lane, Suspect *suspect)
{
    const int64_t beside = beside_of(bank, lane - N_SLOT_LANES, plan_of(bank, lane));
    const double unit = SLOT_INPUT[beside] >= 0 ? 1.0 : OUTPUT_NOISE[SLOT_OUTPUT[beside]];
    no_suspect(suspect);
    suspect->input = SLOT_INPUT[beside];
    suspect->output = SLOT_OUTPUT[beside];
    suspect->word = WORD_BIAS;
    suspect->nominal = 0.0;
    suspect->estimate = unit * of_slot(bank, lane, AT_SLOT + 1);
    suspect->sd = unit * root_of(of_slot(bank, lane, WIDE_PLACE(AT_SLOT + 1, AT_SLOT + 1)));
}

/* A parameter that is its healthy value and what the slot adds. */
static void moved_suspect(const State *state, int64_t lane, Suspect *suspect)
{
    const Bank *bank = &state->bank;
    const int parameter = SLOT_PARAMETER[plan_of(bank, lane)], k = AT_PARAMETERS + parameter, size = AT_SLOT, rate = AT_SLOT + 1;
    const double scale = SCALE[parameter];
    double value = of_slot(bank, lane, k) + of_slot(bank, lane, size);
    if (LOWER[parameter] > value) value = LOWER[parameter]; /* the filter itself lets the sum act up to the ends only */
    if (UPPER[parameter] < value) value = UPPER[parameter];
    const double variance = of_slot(bank, lane, WIDE_PLACE(k, k)) + 2.0 * of_slot(bank, lane, WIDE_PLACE(k, size))
        + of_slot(bank, lane, WIDE_PLACE(size, size));
    no_suspect(suspect);
    suspect->parameter = parameter;
    suspect->nominal = NOMINAL[parameter];
    suspect->estimate = scale * value;
    suspect->sd = fabs(scale) * root_of(variance);
    if (SLOT_KIND[plan_of(bank, lane)] != KIND_DRIFT) return;
    const double both = of_slot(bank, lane, WIDE_PLACE(k, rate)) + of_slot(bank, lane, WIDE_PLACE(size, rate));
    const double rate_variance = of_slot(bank, lane, WIDE_PLACE(rate, rate)), square = scale * scale / share_of_evidence(state);
    const double covariance[3] = {variance * square, both * square, rate_variance * square};
    suspect->rate = scale * (state->normal.rates[parameter] + of_slot(bank, lane, rate)); /* it may move already */
    suspect->rate_sd = root_of(rate_variance * scale * scale);
    for (int at = LIMIT_ROW[parameter]; at < LIMIT_ROW[parameter + 1]; at++)
        suspect->forecasts[suspect->n_forecasts++] = forecast(state->clock.time, LIMIT[at], suspect, covariance);
}

/* Whether a lane tries a noise of the sensor of another one. */
static inline int tries_noise(int64_t lane, int64_t other)
{
    return SLOT_KIND[lane] == KIND_NOISE && SLOT_HYPOTHESIS[lane] == SLOT_HYPOTHESIS[other];
}

/* Noise sd of a sensor and its spread, from how likely each of the noises tried is beside that known.

   Of n readings with mean square s, the log-likelihood of a variance c is -n (log c + s/c) / 2, largest at c = s,
   and sqrt(s) is then known to sqrt(s / 2n). The three noises tried about the best one tell n and s. is_out: the
   hypothesis is rejected, so that no likelihood counts. */
static void find_scatter(const Bank *bank, int64_t lane, double known, int is_out, Suspect *suspect)
{
    double likelihood[MOST_NOISES], tried[MOST_NOISES];
    int n = 0, n_finite = 0;
    for (int64_t k = 0; k < N_SLOT_LANES; k++)
        if (tries_noise(k, lane)) n_finite += !is_out && isfinite(of_slot(bank, k, WIDE_LIKELIHOOD));
    for (int64_t k = 0; k < N_SLOT_LANES; k++) {
        const double own = of_slot(bank, k, WIDE_LIKELIHOOD);
        if (!tries_noise(k, lane) || (n_finite > 2 && !isfinite(own))) continue;
        likelihood[n] = n_finite > 2 ? own : 0.0;
        tried[n++] = SLOT_NOISE[k];
    }
    int best = 0;
    for (int k = 1; k < n; k++)
        if (likelihood[k] > likelihood[best]) best = k;
    const int at = best < 1 ? 0 : best - 1 > n - 3 ? n - 3 : best - 1;
    const double a = -0.5 * log(tried[at + 1] / tried[at]), b = -0.5 * (1.0 / tried[at + 1] - 1.0 / tried[at]);
    const double c = -0.5 * log(tried[at + 2] / tried[at]), d = -0.5 * (1.0 / tried[at + 2] - 1.0 / tried[at]);
    const double one = likelihood[at + 1] - likelihood[at], two = likelihood[at + 2] - likelihood[at];
    const double count = (one * d - b * two) / (a * d - b * c), squares = (a * two - one * c) / (a * d - b * c);
    if (!(count > 1.0 && squares > 0.0)) { /* what is no noise, or too short to tell: no finer than those tried lie */
        suspect->estimate = known * sqrt(tried[best]);
        suspect->sd = suspect->estimate / 3.0;
        return;
    }
    const double square = squares / count, most = 4.0 * tried[n - 1];
    suspect->estimate = known * sqrt(square < 1.0 ? 1.0 : square > most ? most : square);
    suspect->sd = suspect->estimate / sqrt(2.0 * count);
}

/* What is wrong with a sensor or an input. */
static void instrument_suspect(const State *state, int64_t lane, Suspect *suspect)
{
    const Bank *bank = &state->bank;
    const int64_t slot = plan_of(bank, lane);
    const int output = SLOT_OUTPUT[slot], kind = SLOT_KIND[slot];
    const double unit = SLOT_INPUT[slot] >= 0 || SLOT_SCALES[slot] ? 1.0 : OUTPUT_NOISE[output];
    no_suspect(suspect);
    suspect->input = SLOT_INPUT[slot];
    suspect->output = output;
    suspect->estimate = unit * of_slot(bank, lane, AT_SLOT);
    suspect->sd = unit * root_of(of_slot(bank, lane, WIDE_PLACE(AT_SLOT, AT_SLOT)));
    suspect->word = WORD_BIAS;
    if (SLOT_STICKS[slot]) {
        suspect->word = WORD_STUCK;
    } else if (SLOT_SCALES[slot]) {
        suspect->word = WORD_GAIN;
        suspect->nominal = 1.0;
        suspect->estimate += 1.0;
    } else if (kind != KIND_NOISE) {
        suspect->nominal = 0.0;
    } else {
        const double noise = state->normal.noise[output]; /* inf: the sensor is out of use, and shows nothing */
        const double known = unit * sqrt((isfinite(noise) ? noise : 1.0) * state->sensors.nis[output]);
        suspect->word = WORD_NOISE;
        suspect->nominal = unit;
        find_scatter(bank, lane, known, bank->rejected[SLOT_HYPOTHESIS[lane]] > 0, suspect);
    }
    if (kind != KIND_DRIFT) return;
    suspect->rate = unit * of_slot(bank, lane, AT_SLOT + 1);
    suspect->rate_sd = unit * root_of(of_slot(bank, lane, WIDE_PLACE(AT_SLOT + 1, AT_SLOT + 1)));
}

/* The suspect of a lane with a slot. While a fault that comes and goes is gone, its size is that which the lane
   without it remembers: the other one has just been told that the fault is there, and bends the size to that. Of a ramp
   that has come to its end it is told when that began, not after the alarm that it raised, and when it ended. */
static void slot_suspect(const State *state, int64_t lane, Suspect *suspect)
{
    if (SLOT_PARAMETER[plan_of(&state->bank, lane)] >= 0) {
        moved_suspect(state, lane, suspect);
    } else {
        instrument_suspect(state, lane, suspect);
    }
    if (SLOT_KIND[plan_of(&state->bank, lane)] != KIND_RAMP) return;
    suspect->ended = of_slot(&state->bank, lane, ROLE_ENDED);
    suspect->began = fmin(suspect->ended - of_slot(&state->bank, lane, ROLE_TOOK), state->alarm.time);
}

FB_OFTEN

#endif
