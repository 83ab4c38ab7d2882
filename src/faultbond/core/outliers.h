/* The first samples without their wild values, and the start of the plant from the others.

   Before the filter runs nothing is known of what the sensors and inputs usually show. So the first samples judge
   each other: a reading is wild if it lies far from the start that all others are fitted with, and of an input that
   leaves the others for a moment the readings decide whether it did. Huber and Ronchetti, Robust Statistics, 2009.
   */
#ifndef FB_OUTLIERS_H
#define FB_OUTLIERS_H

#include "start.h"
#include "wild.h"

FB_SELDOM

#define FIT_FAR 10.0    /* sd of its noise, or usual misfits, that a reading may lie from the start of the others */
#define INPUT_APART 3.0 /* usual distances from the middle that an input may lie from it */
#define MOST_WILD 0.45  /* part of the values of a column that may be wild; where more are, the model is off */
#define STEP_LEFT 0.1   /* of what a fit leaves: without wild values less is left, without a step of a plant that is off it may be less, too */
#define SHORT_PART 0.25 /* part of an input's values that is held for wild also where the readings do not tell */
#define HUBER 1.5       /* usual misfits from which on a reading counts less, */
#define PASSES 5        /* and how often such weights are found anew */
#define TRIED_SPIKES 3  /* values of an input that are tried as off for one sample, where a misfit may be due to that */
#define USUAL_SD 1.5    /* median misfits that are one sd */
#define MOST_SUSPECTED (FB_ROOM(N_INPUTS) * (MOST_FIRST + 1 + TRIED_SPIKES))

/* A start; readings of sensor j at sample t stand at t * N_OUTPUTS + j. */
typedef struct {
    double mean[FB_ROOM(N_STATES)], covariance[FB_ROOM(AT_SLOT * AT_SLOT)];
    double misfit[FIRST_READINGS];                      /* how far all readings that are there lie from it, sd, */
    double scale[FIRST_READINGS];                       /* and by how much each was blanked */
    uint8_t left_out[FIRST_READINGS], used[FIRST_READINGS]; /* 1: the reading is; it is there, and is not */
} Fit;

/* Samples in which an input may be wild. */
typedef struct {
    int input, strays; /* whether it leaves its other values; else it only stands out from both beside */
    int64_t first, last;
} Suspected;

/* What is known of the inputs after the first samples, if some values were missing. */
typedef struct {
    Clock clock;
    Inputs inputs;
    double astray[FB_ROOM(N_STATES)];
} Told;

typedef struct {
    Fit fits[3]; /* the one that is kept, and two for the next */
    double again[MOST_FIRST][N_SAMPLE], weighted[MOST_FIRST][N_SAMPLE]; /* samples with inputs refused; as they are fitted */
    double factor[FIRST_READINGS], sorted[MOST_FIRST], apart[MOST_FIRST];
    uint8_t alone[FIRST_READINGS], far[FIRST_READINGS];
    uint8_t refused[MOST_FIRST][FB_ROOM(N_INPUTS)], without[MOST_FIRST][FB_ROOM(N_INPUTS)];
    int n_suspected;
    Suspected suspected[MOST_SUSPECTED];
    Told kept, trial;
} StartMemory;

/* What is the same for all fits of one start. */
typedef struct {
    int64_t count;
    const double *known;
    int again;
    const Normal *normal;
    StartMemory *memory;
    SolveMemory *solve;
    Filter_plain *work;
} Task;

/* Sort n numbers, few of them, in place. */
static void sort_few(double *values, int64_t n)
{
    for (int64_t i = 1; i < n; i++) {
        const double value = values[i];
        int64_t k = i;
        for (; k > 0 && values[k - 1] > value; k--) values[k] = values[k - 1];
        values[k] = value;
    }
}

/* The median of n numbers, which are sorted; n > 0. */
static double median_of(double *values, int64_t n)
{
    sort_few(values, n);
    return 0.5 * (values[(n - 1) / 2] + values[n / 2]);
}

/* How far numbers, `width` apart, are from the middle of those that are there (`there` NULL: all); gives how far
   all but a part of these are. */
static double distances(const double *values, const double *there, int64_t width, double most, int64_t count,
                        StartMemory *memory)
{
    double *sorted = memory->sorted;
    int64_t n = 0;
    for (int64_t t = 0; t < count; t++) {
        memory->apart[t] = 0.0;
        if (!there || there[t * width] > 0.0) sorted[n++] = values[t * width];
    }
    if (n == 0) return 0.0;
    const double middle = median_of(sorted, n);
    n = 0;
    for (int64_t t = 0; t < count; t++) {
        memory->apart[t] = fabs(values[t * width] - middle);
        if (!there || there[t * width] > 0.0) sorted[n++] = memory->apart[t];
    }
    sort_few(sorted, n);
    return sorted[(int64_t)((1.0 - most) * (double)n)];
}

/* Fit the start without the readings that are left out (NULL: none are), others with a variance that is `factor`
   times as large (NULL: none is). */
static void fit_start(const Task *task, double (*samples)[N_SAMPLE], const uint8_t *left_out, const double *factor,
                      Fit *fit)
{
    StartMemory *memory = task->memory;
    for (int64_t t = 0; t < task->count; t++) {
        memcpy(memory->weighted[t], samples[t], sizeof memory->weighted[t]);
        for (int j = 0; j < N_OUTPUTS; j++) {
            const int64_t k = t * N_OUTPUTS + j;
            fit->left_out[k] = left_out ? left_out[k] : 0;
            fit->scale[k] = samples[t][SAMPLE_SCALE + j];
            fit->used[k] = samples[t][SAMPLE_USE + j] > 0.0 && !fit->left_out[k];
            memory->weighted[t][SAMPLE_USE + j] = fit->used[k];
            if (factor) memory->weighted[t][SAMPLE_SCALE + j] *= factor[k];
        }
    }
    solve_start(memory->weighted, task->count, task->known, task->again, task->normal, fit->mean, fit->covariance,
                task->solve, task->work);
    find_misfits(samples, task->count, task->known, task->normal, fit->mean, fit->misfit, task->solve, task->work);
    for (int64_t k = 0; k < task->count * N_OUTPUTS; k++) fit->misfit[k] = fabs(fit->misfit[k]);
}

/* Whether the plant runs away from everywhere, so that no reading is to blame. */
static int runs_away(const Fit *fit, int64_t count)
{
    for (int64_t k = 0; k < count * N_OUTPUTS; k++)
        if (fit->used[k] && fit->misfit[k] != RUN_AWAY) return 0;
    return 1;
}

/* Whether any reading lies farther from a fit than so many sd. */
static int any_farther(const Fit *fit, int64_t count, double sd)
{
    for (int64_t k = 0; k < count * N_OUTPUTS; k++)
        if (fit->misfit[k] > sd) return 1;
    return 0;
}

/* The usual misfit of sensor j in sd; 1 or more. */
static double usual_misfit(const Fit *fit, double (*samples)[N_SAMPLE], int64_t count, int j, StartMemory *memory)
{
    int64_t n = 0;
    for (int64_t t = 0; t < count; t++)
        if (samples[t][SAMPLE_USE + j] > 0.0) memory->sorted[n++] = fit->misfit[t * N_OUTPUTS + j];
    return n > 0 ? fmax(1.0, USUAL_SD * median_of(memory->sorted, n)) : 1.0;
}

/* Tell which readings are so far from all others that not even a fit should see them. */
static void find_alone(double (*samples)[N_SAMPLE], int64_t count, StartMemory *memory)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double *y = samples[0] + SAMPLE_Y + j, *use = samples[0] + SAMPLE_USE + j;
        const double usual = distances(y, use, N_SAMPLE, MOST_WILD, count, memory);
        const double most = FIT_FAR * fmax(usual, OUTPUT_NOISE[j]);
        for (int64_t t = 0; t < count; t++)
            memory->alone[t * N_OUTPUTS + j] = samples[t][SAMPLE_USE + j] > 0.0 && memory->apart[t] > most;
    }
}

/* Tell which readings lie far from a robust fit; of a sensor of which too many do, none. Gives whether any does. */
static int find_far(double (*samples)[N_SAMPLE], int64_t count, const Fit *fit, StartMemory *memory)
{
    int any = 0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double most = FIT_FAR * usual_misfit(fit, samples, count, j, memory);
        int64_t there = 0, n = 0;
        for (int64_t t = 0; t < count; t++) {
            const int used = samples[t][SAMPLE_USE + j] > 0.0, far = used && fit->misfit[t * N_OUTPUTS + j] > most;
            memory->far[t * N_OUTPUTS + j] = (uint8_t)far;
            there += used;
            n += far;
        }
        const int judged = (double)n <= MOST_WILD * (double)there;
        for (int64_t t = 0; t < count && !judged; t++) memory->far[t * N_OUTPUTS + j] = 0;
        any |= judged && n > 0;
    }
    return any;
}

/* Fit the start to all readings, and if some lie far off, anew without those that are far from a robust fit. Gives
   that of the two fits which holds it. */
static Fit *fit_robustly(const Task *task, double (*samples)[N_SAMPLE], Fit *first, Fit *fit)
{
    StartMemory *memory = task->memory;
    const int64_t count = task->count, n_readings = count * N_OUTPUTS;
    fit_start(task, samples, NULL, NULL, first);
    if (!any_farther(first, count, FIT_FAR) || runs_away(first, count)) return first;
    find_alone(samples, count, memory);
    for (int64_t k = 0; k < n_readings; k++)
        memory->factor[k] = memory->alone[k] ? 1.0 : fmax(1.0, first->misfit[k] / HUBER);
    for (int pass = 0; pass < PASSES; pass++) { /* Huber's weights, as a larger variance */
        fit_start(task, samples, memory->alone, memory->factor, fit);
        for (int j = 0; j < N_OUTPUTS; j++) {
            const double usual = HUBER * usual_misfit(fit, samples, count, j, memory);
            for (int64_t k = j; k < n_readings; k += N_OUTPUTS) memory->factor[k] = fmax(1.0, fit->misfit[k] / usual);
        }
    }
    if (!find_far(samples, count, fit, memory)) return first;
    fit_start(task, samples, memory->far, NULL, fit);
    return fit;
}

static void suspect(int input, int strays, int64_t first, int64_t last, StartMemory *memory)
{
    for (int k = 0; k < memory->n_suspected; k++) {
        const Suspected *known = &memory->suspected[k];
        if (known->input == input && known->first == first && known->last == last) return;
    }
    const Suspected found = {input, strays, first, last};
    memory->suspected[memory->n_suspected++] = found;
}

/* Suspect each run of samples in which an input leaves its other values. */
static void find_strays(double (*samples)[N_SAMPLE], int64_t count, StartMemory *memory)
{
    static const double parts[] = {0.0, SHORT_PART, MOST_WILD};
    for (int input = 0; input < N_INPUTS; input++)
        for (int length = 0; length < 2; length++) {
            const double *u = samples[0] + SAMPLE_U + input;
            const double usual = distances(u, NULL, N_SAMPLE, parts[length + 1], count, memory);
            const double most = INPUT_APART * fmax(usual, INPUT_NOISE[input]);
            for (int64_t first = 0, end; first < count; first = end + 1) {
                for (end = first; end < count && memory->apart[end] > most; end++) continue;
                const double n = (double)(end - first);
                if (end > first && parts[length] * (double)count <= n && n < parts[length + 1] * (double)count)
                    suspect(input, 1, first, end - 1, memory);
            }
        }
}

/* Suspect the values of each input that stand out most from both beside. */
static void find_spikes(double (*samples)[N_SAMPLE], int64_t count, StartMemory *memory)
{
    double *apart = memory->apart;
    for (int input = 0; input < N_INPUTS && count > 2; input++) {
        for (int64_t t = 0; t < count; t++) {
            const double before = samples[t > 0 ? t - 1 : 1][SAMPLE_U + input];
            const double after = samples[t + 1 < count ? t + 1 : count - 2][SAMPLE_U + input];
            apart[t] = fabs(samples[t][SAMPLE_U + input] - 0.5 * (before + after)) - fabs(before - after);
            if (isnan(apart[t])) apart[t] = -INFINITY;
        }
        for (int n = 0; n < TRIED_SPIKES; n++) {
            int64_t most = 0;
            for (int64_t t = 1; t < count; t++)
                if (apart[t] > apart[most]) most = t;
            if (apart[most] > 0.0 && most > 0 && most < count - 1) suspect(input, 0, most, most, memory);
            apart[most] = -INFINITY;
        }
    }
}

/* The clock and the inputs before the first of the samples, as if no input had been told. */
static void forget_inputs(const State *state, Told *told)
{
    Inputs *inputs = &told->inputs;
    told->clock = state->clock;
    told->clock.silent = 0;
    *inputs = state->inputs;
    for (int k = 0; k < N_INPUTS; k++) {
        inputs->held[k] = NAN;
        inputs->lowest[k] = INFINITY;
        inputs->highest[k] = -INFINITY;
        inputs->leap[k] = inputs->guessed[k] = 0.0;
        inputs->habit[k] = 1.0;
        inputs->since_step[k] = INFINITY;
    }
    for (int e = 0; e < N_AFTER; e++) inputs->change[e] = 0.0;
    memcpy(told->astray, state->healthy.astray, sizeof told->astray);
}

/* Pack the first samples anew as if the refused inputs had been missing; `told`: what is known after them. */
static void pack_again(const State *state, double (*samples)[N_SAMPLE], int64_t count,
                       uint8_t (*refused)[FB_ROOM(N_INPUTS)], Told *told, double (*rows)[N_SAMPLE])
{
    Sample sample;
    int64_t good[FB_ROOM(N_INPUTS)]; /* before the first value that is good, that holds */
    for (int k = 0; k < N_INPUTS; k++)
        for (good[k] = 0; good[k] + 1 < count && refused[good[k]][k];) good[k]++;
    forget_inputs(state, told);
    for (int64_t t = 0; t < count; t++) {
        sample.time = state->clock.time;
        sample.dt = samples[t][SAMPLE_DT];
        for (int k = 0; k < N_INPUTS; k++)
            sample.u[k] = t > good[k] && refused[t][k] ? NAN : samples[t < good[k] ? good[k] : t][SAMPLE_U + k];
        for (int j = 0; j < N_OUTPUTS; j++)
            sample.y[j] = samples[t][SAMPLE_USE + j] > 0.0 ? samples[t][SAMPLE_Y + j] : NAN;
        for (int k = 0; k < N_NOISY; k++) sample.record[k] = sample.u[NOISY[k]];
        memcpy(sample.fade, samples[t] + SAMPLE_FADE, N_NOISY * sizeof(double));
        memcpy(sample.fresh, samples[t] + SAMPLE_FRESH, N_NOISY * sizeof(double));
        told->clock.index = state->clock.begun + t;
        pack_sample(state, &sample, &told->clock, &told->inputs, told->astray, rows[t]);
        for (int i = 0; i < N_STATES; i++) rows[t][SAMPLE_GAP + i] = samples[t][SAMPLE_GAP + i];
    }
    told->clock.index = state->clock.index;
}

/* How much the readings say for a second fit, of which those count that are no more blanked in one past than in the
   other. */
static double said_for_trial(const Fit *fit, const Fit *trial, int64_t count)
{
    double sum = 0.0;
    for (int64_t k = 0; k < count * N_OUTPUTS; k++)
        if (fit->scale[k] == trial->scale[k]) sum += said_for_second(fit->misfit[k], trial->misfit[k]);
    return sum;
}

/* Whether suspected values are the first or the last, and more than one: an input that steps has such, too. */
static int may_be_step(const Suspected *suspected, int64_t count)
{
    return suspected->last > suspected->first && (suspected->first == 0 || suspected->last == count - 1);
}

/* By how much the readings must speak for a past without some values of an input. A short stray is held for wild
   also where they do not tell, unless it may be a step. */
static double needed(const Suspected *suspected, int64_t count)
{
    const double more = (double)(suspected->last - suspected->first);
    return suspected->strays && more < SHORT_PART * (double)count && !may_be_step(suspected, count) ? -TELLING : TELLING;
}

/* What readings lie off from a fit, squared and summed up. */
static double left_by(const Fit *fit, int64_t count)
{
    double sum = 0.0;
    for (int64_t k = 0; k < count * N_OUTPUTS; k++) sum += said_for_second(fit->misfit[k], 0.0);
    return sum;
}

/* Try each suspected stretch of an input as missing, beside those that were refused before; gives the fit that is
   kept. */
static Fit *refuse_inputs(const Task *task, const State *state, double (*samples)[N_SAMPLE], Fit *kept)
{
    StartMemory *memory = task->memory;
    for (int k = 0; k < memory->n_suspected; k++) {
        const Suspected *suspected = &memory->suspected[k];
        Fit *others[2];
        int n = 0;
        for (int f = 0; f < 3; f++)
            if (&memory->fits[f] != kept) others[n++ & 1] = &memory->fits[f];
        memcpy(memory->without, memory->refused, sizeof memory->without);
        for (int64_t t = suspected->first; t <= suspected->last; t++) memory->without[t][suspected->input] = 1;
        pack_again(state, samples, task->count, memory->without, &memory->trial, memory->again);
        Fit *trial = fit_robustly(task, memory->again, others[0], others[1]);
        if (!(said_for_trial(kept, trial, task->count) > needed(suspected, task->count))) continue;
        if (may_be_step(suspected, task->count) && !(left_by(trial, task->count) < STEP_LEFT * left_by(kept, task->count))) continue;
        memcpy(memory->refused, memory->without, sizeof memory->refused);
        memory->kept = memory->trial;
        kept = trial;
    }
    return kept;
}

/* Go on as if the refused inputs had been missing, from the samples too; whether one that is refused at the last of them is
   wild, the next sample tells. Gives how many values were refused before it. */
static int64_t go_without(State *state, double (*samples)[N_SAMPLE], int64_t count, StartMemory *memory)
{
    int64_t n = 0;
    int any = 0;
    double last[FB_ROOM(N_INPUTS)];
    for (int64_t t = 0; t < count; t++)
        for (int k = 0; k < N_INPUTS; k++) {
            any |= memory->refused[t][k];
            n += t < count - 1 && memory->refused[t][k];
        }
    if (!any) return 0;
    memcpy(last, samples[count - 1] + SAMPLE_U, N_INPUTS * sizeof *last);
    pack_again(state, samples, count, memory->refused, &memory->trial, memory->again);
    memcpy(samples, memory->again, (size_t)count * sizeof *samples);
    state->clock = memory->kept.clock;
    state->inputs = memory->kept.inputs;
    memcpy(state->healthy.astray, memory->kept.astray, sizeof memory->kept.astray);
    for (int k = 0; k < N_INPUTS; k++)
        state->inputs.odd[k] = memory->refused[count - 1][k] ? last[k] : NAN;
    state->inputs.odd_since = state->clock.index;
    return n;
}

/* Solve the start from the first samples, with the wild values among them missing. `state`: after the last of them,
   `begun` is the number of the first; it becomes what it is without wild inputs. `samples`: packed, in order; they
   lose what was wild. `mean` [N_STATES], `covariance` [AT_SLOT][AT_SLOT], `known`, `again`: see `solve_start`.
   Gives how many values were wild. */
static int64_t begin(State *state, int64_t count, const double *known, int again, double (*samples)[N_SAMPLE],
                     double *mean, double *covariance, StartMemory *memory, SolveMemory *solve, Filter_plain *work)
{
    const Task task = {count, known, again, &state->normal, memory, solve, work};
    memset(memory->refused, 0, sizeof memory->refused);
    Fit *fit = fit_robustly(&task, samples, &memory->fits[0], &memory->fits[1]);
    memory->n_suspected = 0;
    find_strays(samples, count, memory);
    if (any_farther(fit, count, SPIKE) && !runs_away(fit, count)) find_spikes(samples, count, memory);
    fit = refuse_inputs(&task, state, samples, fit);
    int64_t n_wild = go_without(state, samples, count, memory);
    for (int64_t k = 0; k < count * N_OUTPUTS; k++) {
        n_wild += fit->left_out[k];
        samples[k / N_OUTPUTS][SAMPLE_USE + k % N_OUTPUTS] = fit->used[k];
    }
    memcpy(mean, fit->mean, N_STATES * sizeof *mean);
    memcpy(covariance, fit->covariance, AT_SLOT * AT_SLOT * sizeof *covariance);
    return n_wild;
}

FB_OFTEN

#endif
