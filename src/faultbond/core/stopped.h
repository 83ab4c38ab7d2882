/* Records that have stopped, or never begun. A meter that scatters, and shows the same to the last digit from one moment on, has stuck. No
   likelihood knows: it takes what is recorded of an input for given, and asks only what the plant makes of it.

   Of a record that turned back n times before the alarm, not at an end, and was the same for h samples at most, h is where one of n
   stretches is longest. If their lengths fall off as exp(-l t), that is n exp(-l h) = 1, and one of t samples is to be expected
   n exp(-l t) = n^(1 - t/h) times. So much likelier than by chance is it where the meter has stuck. Source: Gumbel, Statistics of
   Extremes, 1958, section 1.2 (the largest of n exponential numbers). Stretches at an end of where it had been are none of these:
   what is switched off rests there.

   A sensor that has never read explains nothing. Its lanes are as likely as the healthy filter, so that where no fault fits well
   it would come first. */
#ifndef FB_STOPPED_H
#define FB_STOPPED_H

#include "moving.h"

FB_SELDOM

#define TURNS 100         /* that a record has to show before it is known how it scatters, */
#define SELDOM_TURNS 8.0  /* and samples to each of them, at most: a command goes to a place and stays there */
#define STOPPED_NATS 15.0 /* what a record that has stopped says at most, */
#define STOPPED_SURELY 7.0 /* and from where on it is told that it has: about 1000 : 1 */

/* How much likelier, in logarithm, a record is if its meter has stuck; only what stopped before the alarm can tell of it. One that
   stands at the end of where it has been may have come to a stop there: a valve that is open, a motor at rest. */
static double log_stopped(const State *state, int64_t input)
{
#if N_NOISY > 0
    const Inputs *inputs = &state->inputs;
    for (int k = 0; k < N_NOISY; k++) {
        if (NOISY[k] != input || inputs->turns[k] < TURNS) continue;
        const double held = inputs->held[input], most = fmax(inputs->stood[k], 1.0);
        if ((double)state->clock.index - inputs->still[k] - inputs->idle[k] > SELDOM_TURNS * inputs->turns[k]) return 0.0;
        if (inputs->still[k] < (double)(state->clock.index - state->clock.alarm)) return 0.0;
        if (!(held > inputs->lowest[input] && held < inputs->highest[input])) return 0.0;
        return fmin(fmax((inputs->still[k] / most - 1.0) * log(inputs->turns[k]), 0.0), STOPPED_NATS);
    }
#endif
    (void)state, (void)input;
    return 0.0;
}

/* When the record of an input stopped, s; nan: as far as is known it goes on. */
static double stopped_at(const State *state, int64_t input)
{
#if N_NOISY > 0
    for (int k = 0; k < N_NOISY; k++)
        if (NOISY[k] == input && log_stopped(state, input) >= STOPPED_SURELY) return state->inputs.since[k];
#endif
    (void)state, (void)input;
    return NAN;
}

/* Whether a candidate is an input whose record has stopped, and nothing else. */
static inline int has_stopped(const Candidate *candidate)
{
    return candidate->n_suspects == 1 && !isnan(candidate->suspects[0].stopped);
}

/* Whether a sensor has given a value that was used. */
static int has_read(const Sensors *sensors, int j) { return sensors->shown[0][j] <= sensors->shown[1][j]; }

/* What the record of an instrument says for it, as log-likelihood; `instrument` as a hypothesis, -1: none. */
static double log_of_record(const State *state, int64_t instrument)
{
    for (int64_t lane = 0; instrument >= 0 && lane < N_SLOT_LANES; lane++) {
        if (SLOT_HYPOTHESIS[lane] != instrument) continue;
        if (SLOT_INPUT[lane] >= 0) return log_stopped(state, SLOT_INPUT[lane]);
        return has_read(&state->sensors, SLOT_OUTPUT[lane]) ? 0.0 : -INFINITY;
    }
    return 0.0;
}

/* The same of a hypothesis: what the records of its instruments say for it. */
static double log_of_records(const State *state, int64_t hypothesis)
{
    return log_of_record(state, instrument_of(hypothesis)) + log_of_record(state, second_instrument_of(hypothesis));
}

FB_OFTEN

#endif
