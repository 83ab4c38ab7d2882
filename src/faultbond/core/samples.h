/* A sample as the filters take it: records smoothed (smooth.h), inputs held, steps blanked, missing values off, accepted
   faults corrected; and what nobody saw: where states may have gone in a gap, and inputs while their values are missing.

   An input that is missing is held. If it usually is told, and moves, it may stand elsewhere, so the states are less
   certain. Formulas: docs/method.md, "The joint filter". */
#ifndef FB_SAMPLES_H
#define FB_SAMPLES_H

#include "plant.h"

#define GAP_WHOLE 20.0      /* samples of a gap in which a state may go as far as it has ever been */
#define GAP_AGAIN 0.3       /* part of this that the next sample adds again, */
#define GAP_NOTHING 1e-3    /* and part that is not worth it */
#define DOUBT_LESS 0.1      /* part of a doubt that is left at the next sample: as GAP_AGAIN, of a variance */
#define LONGEST_DOUBT 50.0  /* samples without an input, after which the plant has felt most of what it does */

/* Memory of a filter that only tries what would be. */
typedef struct {
    double lane[PLAIN_NUMBERS], sample[N_SAMPLE];
} Trial;

static inline double bounded(double a, double least, double most) { return a < least ? least : a > most ? most : a; }

/* A run goes on after a time of unknown length. */
static void resume(Clock *clock) { clock->silent = GAP_UNKNOWN; }

/* Take the faults of instruments that were accepted out of a sample; a sensor that is out of use is missing. */
static void correct(const Normal *normal, Sample *sample)
{
    for (int k = 0; k < N_INPUTS; k++) {
        const double recorded = normal->input_gain[k] != 0.0 ? normal->input_gain[k] * sample->u[k] : 0.0; /* of one that stuck it tells nothing */
        sample->u[k] = recorded + normal->input_offset[k];
    }
    for (int j = 0; j < N_OUTPUTS; j++)
        sample->y[j] = isfinite(normal->noise[j]) ? (sample->y[j] - normal->offset[j]) / normal->gain[j] : NAN;
}

/* Take out of a sample what is not to be judged, by the conditions under which the model and its sensors hold: of inputs that
   are told, and else of their last values. `left_out` [N_OUTPUTS]: 1 of each reading that is. Gives whether the model does not
   hold. */
static int leave_out(Inputs *inputs, Sample *sample, int64_t *left_out)
{
    double u[FB_ROOM(N_INPUTS)];
    int holds[FB_ROOM(N_CONDITIONS) + 1] = {0};
    for (int k = 0; k < N_INPUTS; k++) u[k] = isfinite(sample->u[k]) ? sample->u[k] : inputs->held[k];
    for (int c = 0; c < N_CONDITIONS; c++) {
        double *since = &inputs->true_for[c];
        *since = !model_holds(c, u) ? -1.0 : *since < 0.0 ? 0.0 : *since + sample->dt;
        holds[c] = *since >= CONDITION_SETTLING[c] * (1.0 - 1e-9);
        if (holds[c]) *since = INFINITY;
    }
    const int outside = MODEL_CONDITION >= 0 && !holds[MODEL_CONDITION >= 0 ? MODEL_CONDITION : 0];
    for (int j = 0; j < N_OUTPUTS; j++) {
        left_out[j] = outside || (OUTPUT_CONDITION[j] >= 0 && !holds[OUTPUT_CONDITION[j] >= 0 ? OUTPUT_CONDITION[j] : 0]);
        if (left_out[j]) sample->y[j] = NAN;
    }
    return outside;
}

/* How far state i has ever moved, SI. */
static double travelled(const Healthy *healthy, int i)
{
    return larger(healthy->travel[1][i] - healthy->travel[0][i], 0.0);
}

/* How far state i may go by chance in a gap: while a fault is sought no farther than it is large in use, or now, or has moved. Where
   sensors hardly show it, as the temperature of a winding, they would let it be anywhere; lanes in which a sensor is at fault have
   nothing else by which to find it, and follow the laws to where these were never meant. */
static double farthest(const Healthy *healthy, int is_sought, int i)
{
    if (!is_sought || !(STATE_REACH[i] > 0.0)) return INFINITY;
    return larger(larger(STATE_REACH[i], fabs(healthy->lane[i])), travelled(healthy, i));
}

/* The sd that states gain by a gap of so many samples before this one: by chance, or to where they have been. From so far off
   one linear update leads to near the truth only. So the samples that follow add a part of it again, each of them a step of
   Newton's method, down to what counts as nothing. */
static void wander(const Healthy *healthy, double gap, int is_sought, double *astray)
{
    int strays = gap != 0.0;
    for (int i = 0; i < N_STATES; i++) strays |= astray[i] != 0.0;
    if (!strays) return;
    for (int i = 0; i < N_STATES; i++) {
        const double far = travelled(healthy, i), rest = GAP_AGAIN * astray[i];
        const double again = rest > larger(STATE_NOISE[i], GAP_NOTHING * far) ? rest : 0.0;
        const double chance = smaller(gap * STATE_DRIFT[i], farthest(healthy, is_sought, i));
        astray[i] = larger(larger(chance, smaller(gap / GAP_WHOLE, 1.0) * far), again);
    }
}

/* Where the states may be anywhere, and readings are not linear, what a reading says by its slope is off by more than its noise:
   taken at their word the first ones would teach the parameters what is wrong only of the slope. */
static void doubt_readings(Clock *clock, double *packed)
{
    for (int j = 0; j < N_OUTPUTS; j++)
        packed[SAMPLE_SCALE + j] = smaller(packed[SAMPLE_SCALE + j] * clock->doubt, larger(packed[SAMPLE_SCALE + j], BLANK_FACTOR));
    clock->doubt *= DOUBT_LESS;
    if (clock->doubt <= 1.0) clock->doubt = 0.0;
}

/* A sensor that lags is behind what it reads, by a law that may have no value while the sensor does not read as stated. So then
   its state is not followed, and may be wherever it has been. */
static void hold_lags(const Healthy *healthy, const Inputs *inputs, double *packed)
{
#if N_HELD > 0
    for (int h = 0; h < N_HELD; h++) /* 0 where it has settled */
        packed[SAMPLE_HELD + h] = isinf(inputs->true_for[OUTPUT_CONDITION[HELD_OUTPUT[h]]]) ? 0.0 : 1.0;
    for (int s = 0; s < N_HELD_STATES; s++) {
        const int i = HELD_STATE[s];
        if (packed[SAMPLE_HELD + HELD_BY[s]] > 0.0) packed[SAMPLE_GAP + i] = larger(packed[SAMPLE_GAP + i], travelled(healthy, i));
    }
#else
    (void)healthy, (void)inputs, (void)packed;
#endif
}

/* Pack a sample: hold inputs, blank after steps, kick slow errors, switch off missing values. `clock`, `inputs` and `astray`,
   that of the states, become those after it; of `state`, which they may be parts of, the rest is read: how far the states
   have moved, and the noise of the sensors. Each input has been told before, or is now. */
static void pack_sample(const State *state, const Sample *sample, Clock *clock, Inputs *inputs, double *astray, double *packed)
{
    int first = 0, present = 0;
    for (int k = 0; k < N_INPUTS; k++) first |= !isfinite(inputs->held[k]);
    double gap = pack_values(sample, first, &state->sensors, state->normal.noise, clock, inputs, packed);
    if (clock->outside) { /* what the plant has done since is not what the model says */
        gap = larger(gap, GAP_UNKNOWN);
        packed[SAMPLE_STILL] = 1.0;
        for (int k = 0; k < N_INPUTS; k++)
            packed[SAMPLE_U_BEFORE + k] = isfinite(inputs->inside[k]) ? inputs->inside[k] : inputs->held[k];
        clock->outside = 0;
        clock->doubt = BLANK_FACTOR;
    }
    for (int j = 0; j < N_OUTPUTS; j++) present |= packed[SAMPLE_USE + j] > 0.0;
    if (present && clock->doubt > 0.0) doubt_readings(clock, packed);
    if (gap != 0.0 || present) { /* else the states are not looked for */
        wander(&state->healthy, gap, clock->alarm >= 0, astray);
        for (int i = 0; i < N_STATES; i++) packed[SAMPLE_GAP + i] = astray[i];
    }
    hold_lags(&state->healthy, inputs, packed);
    if (clock->begun < 0 || (gap != 0.0 && !clock->running)) clock->begun = clock->index;
    if (clock->index - clock->begun >= WARM_UP_SAMPLES) packed[SAMPLE_BOUND] = LEARNING_BOUND;
    learn_inputs(inputs, sample, gap != 0.0, !has_value(sample));
}

/* Pack a sample at which the model does not hold: time passes, but the states stay, under the last inputs for which it held;
   others may be such that it has no value. What becomes of `clock` and `inputs`: see `pack_sample`. */
static void pack_outside(const State *state, const Sample *sample, Clock *clock, Inputs *inputs, double *packed)
{
    int first = 0;
    for (int k = 0; k < N_INPUTS; k++) {
        first |= !isfinite(inputs->held[k]);
        inputs->odd[k] = NAN;
        if (!clock->outside) inputs->inside[k] = inputs->held[k];
    }
    (void)pack_values(sample, first, &state->sensors, state->normal.noise, clock, inputs, packed);
    learn_inputs(inputs, sample, 1, !has_value(sample));
    hold_lags(&state->healthy, inputs, packed);
    packed[SAMPLE_STILL] = 2.0;
    for (int k = 0; k < N_INPUTS; k++) {
        packed[SAMPLE_U_BEFORE + k] = inputs->inside[k];
        packed[SAMPLE_U + k] = inputs->inside[k];
    }
    clock->outside++;
}

/* By how much input k may have been off before a sample, SI, and over how many samples. When it is told again, it may have
   changed at any sample since; while it is not, and sensors are, it may be off by as much as it usually moves. */
static double doubt(const Inputs *inputs, const Sample *sample, int k, double *count)
{
    const int told = isfinite(sample->u[k]);
    if (!(inputs->guessed[k] > 0.0 && inputs->habit[k] > RARELY) || !has_value(sample)) return *count = 0.0;
    *count = told ? smaller(inputs->guessed[k], LONGEST_DOUBT) : 1.0;
    return told ? sample->u[k] - inputs->held[k] : inputs->leap[k];
}

/* Where a step of the filter takes the states [N_STATES] of a lane; readings are not used. */
static void foresee(const double *lane, const double *packed, const Normal *normal, double *x, Trial *trial, Filter_plain *work)
{
    memcpy(trial->lane, lane, sizeof trial->lane);
    memcpy(trial->sample, packed, sizeof trial->sample);
    for (int j = 0; j < N_OUTPUTS; j++) trial->sample[SAMPLE_USE + j] = 0.0;
    advance_one(trial->lane, trial->sample, normal, NULL, work);
    memcpy(x, trial->lane, N_STATES * sizeof *x);
}

/* Let states be as uncertain, in a packed sample, as what inputs may have done unseen makes them, by one step of the healthy
   filter. `change`, SI, and `count`, samples: see `doubt`. No state goes farther by that than it ever has, unless one step
   takes it there. */
static void allow(const Healthy *healthy, const Normal *normal, const double *change, const double *count, double *packed,
                  Trial *trial, Filter_plain *work)
{
    double base[FB_ROOM(N_STATES)], x[FB_ROOM(N_STATES)], total[FB_ROOM(N_STATES)];
    int doubted = 0;
    for (int k = 0; k < N_INPUTS; k++) doubted |= change[k] != 0.0;
    if (!doubted) return;
    foresee(healthy->lane, packed, normal, base, trial, work);
    for (int i = 0; i < N_STATES; i++) total[i] = packed[SAMPLE_GAP + i] * packed[SAMPLE_GAP + i];
    for (int k = 0; k < N_INPUTS; k++) {
        if (change[k] == 0.0) continue;
        const double before = packed[SAMPLE_U_BEFORE + k], now = packed[SAMPLE_U + k];
        packed[SAMPLE_U_BEFORE + k] = before + change[k];
        packed[SAMPLE_U + k] = before + change[k];
        foresee(healthy->lane, packed, normal, x, trial, work);
        packed[SAMPLE_U_BEFORE + k] = before;
        packed[SAMPLE_U + k] = now;
        for (int i = 0; i < N_STATES; i++) {
            const double far = travelled(healthy, i), step = fabs(x[i] - base[i]);
            const double off = isfinite(step) ? smaller(count[k] * step, larger(far, step)) : far;
            total[i] += off * off;
        }
    }
    for (int i = 0; i < N_STATES; i++) packed[SAMPLE_GAP + i] = sqrt(total[i]);
}

#endif
