/* A sample as the filters take it: inputs held, steps blanked, missing values off, accepted faults corrected; and what
   nobody saw: where states may have gone in a gap, and inputs while their values are missing.

   An input that is missing is held. If it usually is told, and moves, it may stand elsewhere, so the states are less
   certain. Formulas: docs/method.md, "The joint filter". */
#ifndef FB_SAMPLES_H
#define FB_SAMPLES_H

#include "advance.h"

#define GAP_FROM 3          /* samples without any value from which on the states are uncertain after them, */
#define GAP_UNUSUAL 3.0     /* beside so many times the usual number, since rows may come more slowly than samples */
#define GAP_UNKNOWN 1000    /* samples; a gap of unknown length counts as one of so many */
#define GAP_WHOLE 20.0      /* samples of a gap in which a state may go as far as it has ever been */
#define GAP_AGAIN 0.3       /* part of this that the next sample adds again, */
#define GAP_NOTHING 1e-3    /* and part that is not worth it */
#define PAUSES 20.0         /* rows over which the usual number is a mean; longer pauses do not count as more */
#define CHANGE_MEMORY 16.0  /* s for which a change of an input disturbs the slow errors that follow it */
#define LONGEST_DOUBT 50.0  /* samples without an input, after which the plant has felt most of what it does */
#define MOVES 300.0         /* samples over which the moves, */
#define HABIT 1000.0        /* and the presence, of inputs are means */
#define UNKNOWN_FROM 3.0    /* samples for which an input has not been told from which on it is unknown where it stands */
#define RARELY 0.5          /* presence of an input that is logged when it changes */

/* One grid point: s, and s since the one before; SI; nan: missing. */
typedef struct {
    double time, dt, u[FB_ROOM(N_INPUTS)], y[N_OUTPUTS];
} Sample;

/* Memory of a filter that only tries what would be. */
typedef struct {
    double lane[PLAIN_NUMBERS], sample[N_SAMPLE];
} Trial;

/* The larger, and the smaller, of two numbers; what is no number stays none. */
static inline double larger(double a, double b) { return a >= b || isnan(a) ? a : b; }
static inline double smaller(double a, double b) { return a <= b || isnan(a) ? a : b; }
static inline double bounded(double a, double least, double most) { return a < least ? least : a > most ? most : a; }

/* A run goes on after a time of unknown length. */
static void resume(Clock *clock) { clock->silent = GAP_UNKNOWN; }

/* Take the faults of instruments that were accepted out of a sample; a sensor that is out of use is missing. */
static void correct(const Normal *normal, Sample *sample)
{
    for (int k = 0; k < N_INPUTS; k++) sample->u[k] += normal->input_offset[k];
    for (int j = 0; j < N_OUTPUTS; j++)
        sample->y[j] = isfinite(normal->noise[j]) ? (sample->y[j] - normal->offset[j]) / normal->gain[j] : NAN;
}

/* Largest size of input k, SI; 0 where none was seen. */
static double peak_of(const Inputs *inputs, int k)
{
    return inputs->lowest[k] <= inputs->highest[k] ? larger(fabs(inputs->lowest[k]), fabs(inputs->highest[k])) : 0.0;
}

/* Whether input k usually is told, and moves; where it stands while it is not told nobody knows. */
static int is_restless(const Inputs *inputs, int k) { return inputs->leap[k] > 0.0 && inputs->habit[k] > RARELY; }

/* Whether some input has been missing for some samples, though it usually is told and does move. */
static int any_unknown(const Inputs *inputs)
{
    for (int k = 0; k < N_INPUTS; k++)
        if (inputs->guessed[k] >= UNKNOWN_FROM && is_restless(inputs, k)) return 1;
    return 0;
}

/* Whether sensor j has a value in a packed sample, and is not blanked. */
static int is_trusted(const double *packed, int j)
{
    return packed[SAMPLE_USE + j] > 0.0 && packed[SAMPLE_SCALE + j] < BLANK_FACTOR;
}

/* Whether a sample has any value. */
static int has_value(const Sample *sample)
{
    for (int k = 0; k < N_INPUTS; k++)
        if (isfinite(sample->u[k])) return 1;
    for (int j = 0; j < N_OUTPUTS; j++)
        if (isfinite(sample->y[j])) return 1;
    return 0;
}

/* How far state i has ever moved, SI. */
static double travelled(const Healthy *healthy, int i)
{
    return larger(healthy->travel[1][i] - healthy->travel[0][i], 0.0);
}

/* Let inputs go to where they are told to be, and others stay; what is felt of a change fades. At the first sample nothing
   moves. */
static void move_inputs(Inputs *inputs, const Sample *sample, int first, double dt)
{
    for (int k = 0; k < N_INPUTS; k++) {
        const double u = isfinite(sample->u[k]) ? sample->u[k] : inputs->held[k];
        const double before = first ? u : inputs->held[k], moved = u - before;
        const double limit = larger(INPUT_STEP[k], INPUT_STEP_PART[k] * larger(peak_of(inputs, k), fabs(u)));
        inputs->since_step[k] = !first && fabs(moved) > limit ? 0.0 : inputs->since_step[k] + dt;
        inputs->change[k] = inputs->change[k] * exp(-dt / CHANGE_MEMORY) + moved;
        inputs->earlier[k] = before;
        inputs->held[k] = u;
    }
}

/* What is known of the inputs after a sample in which some were told, after a gap of so many samples. An input that is mostly
   not told is one that is logged when it changes: between, its value is known after all. */
static void learn_inputs(Inputs *inputs, const Sample *sample, double gap, int silent)
{
    for (int k = 0; k < N_INPUTS; k++) {
        const double u = inputs->held[k], moved = u - inputs->earlier[k];
        const int told = isfinite(sample->u[k]);
        if (told && inputs->guessed[k] == 0.0 && gap == 0.0) /* both ends of the move were seen */
            inputs->leap[k] = hypot(sqrt(1.0 - 1.0 / MOVES) * inputs->leap[k], sqrt(1.0 / MOVES) * moved);
        if (told) {
            inputs->lowest[k] = smaller(inputs->lowest[k], u);
            inputs->highest[k] = larger(inputs->highest[k], u);
        }
        inputs->guessed[k] = told ? 0.0 : inputs->guessed[k] + 1.0;
        if (!silent) inputs->habit[k] += ((double)told - inputs->habit[k]) / HABIT;
    }
}

/* Whether an input that reaches sensor j directly is still settling after a step, or not known. */
static int is_blanked(const Inputs *inputs, const Sample *sample, int j)
{
    for (int e = DIRECT_ROW[j]; e < DIRECT_ROW[j + 1]; e++) {
        const int k = DIRECT_INPUT[e];
        if (inputs->since_step[k] < INPUT_SETTLING[k] || (!isfinite(sample->u[k]) && is_restless(inputs, k))) return 1;
    }
    return 0;
}

/* Variance that slow error k gains in dt seconds, since inputs changed that it follows. */
static double kick_of(const Inputs *inputs, int k, double dt)
{
    double sum = 0.0;
    for (int e = AFTER_ROW[k]; e < AFTER_ROW[k + 1]; e++) {
        const double part = AFTER_EACH[e] * inputs->change[AFTER_INPUT[e]];
        sum += part * part;
    }
    return (1.0 - exp(-2.0 * dt / CHANGE_MEMORY)) * sum; /* adds up to 1 over the memory of a step */
}

/* Tell the clock whether a sample has any value; gives the gap before it, in samples, 0 where there was none. Where rows are
   the grid, a gap is told by the time since the row before. */
static double gap_before(Clock *clock, double dt, int silent)
{
    double absent = (double)clock->silent, usual = clock->pause, counted = smaller(absent, PAUSES);
    clock->silent = silent ? clock->silent + 1 : 0;
    if (silent) return 0.0;
    if (!(SAMPLE_TIME > 0.0)) {
        absent = usual == 0.0 ? 0.0 : dt / usual - 1.0;
        counted = smaller(dt, PAUSES * usual);
        clock->pause = usual == 0.0 ? dt : usual + (counted - usual) / PAUSES;
        usual = 1.0;
    } else {
        clock->pause = usual + (counted - usual) / PAUSES;
    }
    return absent > GAP_FROM - 1 + GAP_UNUSUAL * usual ? absent : 0.0;
}

/* The sd that states gain by a gap of so many samples before this one: by chance, or to where they have been. From so far off
   one linear update leads to near the truth only. So the samples that follow add a part of it again, each of them a step of
   Newton's method, down to what counts as nothing. */
static void wander(const Healthy *healthy, double gap, double *astray)
{
    int strays = gap != 0.0;
    for (int i = 0; i < N_STATES; i++) strays |= astray[i] != 0.0;
    if (!strays) return;
    for (int i = 0; i < N_STATES; i++) {
        const double far = travelled(healthy, i), rest = GAP_AGAIN * astray[i];
        const double again = rest > larger(STATE_NOISE[i], GAP_NOTHING * far) ? rest : 0.0;
        astray[i] = larger(larger(gap * STATE_DRIFT[i], smaller(gap / GAP_WHOLE, 1.0) * far), again);
    }
}

/* Pack a sample: hold inputs, blank after steps, kick slow errors, switch off missing values. `clock`, `inputs` and `astray`,
   that of the states, become those after it; of `state`, which they may be parts of, the rest is read: how far the states
   have moved, and the noise of the sensors. Each input has been told before, or is now. */
static void pack_sample(const State *state, const Sample *sample, Clock *clock, Inputs *inputs, double *astray, double *packed)
{
    int first = 0, present = 0;
    for (int k = 0; k < N_INPUTS; k++) first |= !isfinite(inputs->held[k]);
    const double dt = first ? 0.0 : sample->dt;
    memset(packed, 0, N_SAMPLE * sizeof *packed);
    move_inputs(inputs, sample, first, dt);
    packed[SAMPLE_DT] = dt;
    for (int k = 0; k < N_INPUTS; k++) {
        packed[SAMPLE_U_BEFORE + k] = inputs->earlier[k];
        packed[SAMPLE_U + k] = inputs->held[k];
    }
    for (int j = 0; j < N_OUTPUTS; j++) {
        const int there = isfinite(sample->y[j]);
        present |= there;
        packed[SAMPLE_Y + j] = there ? sample->y[j] : 0.0;
        packed[SAMPLE_USE + j] = there;
        packed[SAMPLE_SCALE + j] = is_blanked(inputs, sample, j) ? BLANK_FACTOR : there ? state->normal.noise[j] : 1.0;
        packed[SAMPLE_NIS + j] = state->sensors.nis[j];
    }
    for (int k = 0; k < N_SLOW; k++) packed[SAMPLE_KICK + k] = kick_of(inputs, k, dt);
    const int silent = !has_value(sample);
    const double gap = gap_before(clock, dt, silent);
    if (gap != 0.0 || present) { /* else the states are not looked for */
        wander(&state->healthy, gap, astray);
        for (int i = 0; i < N_STATES; i++) packed[SAMPLE_GAP + i] = astray[i];
    }
    if (clock->begun < 0 || (gap != 0.0 && !clock->running)) clock->begun = clock->index;
    if (clock->index - clock->begun >= WARM_UP_SAMPLES) packed[SAMPLE_BOUND] = LEARNING_BOUND;
    learn_inputs(inputs, sample, gap, silent);
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
        const double before = packed[SAMPLE_U_BEFORE + k];
        packed[SAMPLE_U_BEFORE + k] = before + change[k];
        foresee(healthy->lane, packed, normal, x, trial, work);
        packed[SAMPLE_U_BEFORE + k] = before;
        for (int i = 0; i < N_STATES; i++) {
            const double far = travelled(healthy, i), step = fabs(x[i] - base[i]);
            const double off = isfinite(step) ? smaller(count[k] * step, larger(far, step)) : far;
            total[i] += off * off;
        }
    }
    for (int i = 0; i < N_STATES; i++) packed[SAMPLE_GAP + i] = sqrt(total[i]);
}

#endif
