/* Wild values: readings and inputs far beyond all that was seen before, which count as missing.

   A reading is wild if it lies far from what the healthy filter expects and far from all that the sensor has shown. What
   goes on is let in after some samples, since a fault may bring about what was never seen before: then the alarm and the
   bank judge it. Of an input nothing is expected; so one that is far from all it has been is held, and what feels it at
   once is not judged. At the next sample it is believed, unless the readings follow the past without it, or do not tell
   and it has come back. Where the model states a range nothing within it is wild. Formulas: docs/method.md, "The joint
   filter". */
#ifndef FB_WILD_H
#define FB_WILD_H

#include "samples.h"

#define STRAY_FAR 3.0       /* widths of what was seen by which a value must lie beyond it, */
#define LEAST_WIDTH 100.0   /* of a sensor at least so many sd of its noise wide, */
#define SURPRISE 20.0       /* and sd by which a reading must lie off what is expected */
#define CUT_FAR 10.0        /* widths beyond what was seen at which a value counts that goes on: wilder ones only teach nonsense */
#define PATIENCE 5.0        /* wild readings of a sensor that are refused, */
#define RECOVERY 50.0       /* and samples after which it is one more again */
#define TELLING 9.0         /* difference of the sums of squares, in sd, that decides between two pasts */
#define SPIKE_BACK 0.5      /* part of the way that an input may be off after it */
#define MOST_SAID 20.0      /* sd of an innovation beyond which it counts no more there */
#define VAGUE 1e4           /* sd that the other past expects of a reading, beyond which one says nothing of it */
#define ABSURD 100.0        /* sizes of a state beyond which no past is believed to have taken it */

/* What two pasts have each for itself. */
typedef struct {
    Clock clock;
    Inputs inputs;
    double astray[FB_ROOM(N_STATES)], lane[PLAIN_NUMBERS];
} Version;

/* Memory of a sample while it is judged. */
typedef struct {
    Trial trial;
    Version before, real; /* before a sample, and after it if inputs that were refused are real, */
    double other[N_SAMPLE]; /* for which this is the sample */
    double judged[N_SAMPLE]; /* as a lane of the bank takes it */
    double one[PLAIN_NUMBERS], two[PLAIN_NUMBERS];
} SampleMemory;

FB_SELDOM

static void keep_version(const State *state, Version *version)
{
    version->clock = state->clock;
    version->inputs = state->inputs;
    memcpy(version->astray, state->healthy.astray, sizeof version->astray);
    memcpy(version->lane, state->healthy.lane, sizeof version->lane);
}

static void go_by_version(State *state, const Version *version)
{
    state->clock = version->clock;
    state->inputs = version->inputs;
    memcpy(state->healthy.astray, version->astray, sizeof version->astray);
    memcpy(state->healthy.lane, version->lane, sizeof version->lane);
}

FB_OFTEN

/* Take inputs that are refused out of a sample, and remember them; gives how many there are. */
static int screen(const Clock *clock, Inputs *inputs, Sample *sample)
{
    int found = 0;
    inputs->odd_since = clock->index;
    inputs->gain = 0.0;
    for (int k = 0; k < N_INPUTS; k++) {
        const double low = inputs->lowest[k], high = inputs->highest[k], u = sample->u[k];
        const double size = STRAY_FAR * larger(high - low, peak_of(inputs, k));
        const int far = low <= high && !INPUT_RANGED[k] && isfinite(u) && (u < low - size || u > high + size);
        inputs->odd[k] = far ? u : NAN;
        if (far) sample->u[k] = NAN;
        found += far;
    }
    return found;
}

/* Pack a sample with inputs far beyond their range held, for as long as there is patience; the state becomes that after. */
static void take_sample(State *state, const Sample *sample, double *packed, Trial *trial, Filter_plain *work)
{
    Inputs *inputs = &state->inputs;
    Sample told = *sample;
    double change[FB_ROOM(N_INPUTS)], count[FB_ROOM(N_INPUTS)];
    int guessed = 0, beyond = 0, refused = 0;
    for (int k = 0; k < N_INPUTS && state->clock.running; k++) {
        guessed |= inputs->guessed[k] != 0.0;
        beyond |= sample->u[k] < inputs->lowest[k] || sample->u[k] > inputs->highest[k];
    }
    if (guessed || beyond) refused = screen(&state->clock, inputs, &told);
    for (int k = 0; k < N_INPUTS && guessed; k++) change[k] = doubt(inputs, &told, k, &count[k]);
    pack_sample(state, &told, &state->clock, inputs, state->healthy.astray, packed);
    for (int j = 0; j < N_OUTPUTS && refused; j++) /* what feels a refused input at once cannot be judged yet */
        for (int e = DIRECT_ROW[j]; e < DIRECT_ROW[j + 1]; e++)
            if (isfinite(inputs->odd[DIRECT_INPUT[e]])) packed[SAMPLE_SCALE + j] = BLANK_FACTOR;
    if (guessed) allow(&state->healthy, &state->normal, change, count, packed, trial, work);
}

FB_SELDOM

/* Go on as if the inputs that were refused at the last sample were real; `has_rival`: a filter has run beside as if so. */
static void believe(State *state, int has_rival)
{
    Inputs *inputs = &state->inputs;
    if (has_rival) memcpy(state->healthy.lane, inputs->rival, sizeof inputs->rival);
    for (int k = 0; k < N_INPUTS; k++) {
        const int odd = isfinite(inputs->odd[k]);
        const double held = odd ? inputs->odd[k] : inputs->held[k];
        inputs->lowest[k] = smaller(inputs->lowest[k], held);
        inputs->highest[k] = larger(inputs->highest[k], held);
        if (odd) inputs->guessed[k] = inputs->since_step[k] = 0.0;
        for (int e = 0; e < N_AFTER; e++)
            if (AFTER_INPUT[e] == k) inputs->change[e] += held - inputs->held[k];
        inputs->held[k] = held;
        inputs->odd[k] = NAN;
    }
}

/* How much a reading speaks for the second of two pasts: the difference of the squares of what each leaves of it, in sd; what
   is no number counts as far off. */
static double said_for_second(double one, double two)
{
    const double first = fmin(fabs(one), MOST_SAID), second = fmin(fabs(two), MOST_SAID); /* fmin passes over what is none */
    return first * first - second * second;
}

/* Innovation j of a past, in sd; none where that has run away, and is so uncertain beside the other one that it expects
   any reading. */
static double score_of(const double *innovations, const double *other, int j)
{
    const double variance = innovations[N_OUTPUTS + j], most = VAGUE * VAGUE * other[N_OUTPUTS + j];
    return variance > most || !isfinite(variance) ? NAN : innovations[j] / sqrt(variance);
}

/* What the readings that both trust say for the second of two pasts of a sample, by the innovations of each. */
static double said_by_readings(const double *packed, const double *first, const double *other, const double *second)
{
    double sum = 0.0;
    for (int j = 0; j < N_OUTPUTS; j++)
        if (is_trusted(packed, j) && is_trusted(other, j))
            sum += said_for_second(score_of(first, second, j), score_of(second, first, j));
    return sum;
}

/* Take a sample after two pasts, each with its own lane, in place: what the readings say for the second. */
static double compare(const Normal *normal, double *one, const double *packed, double *two, const double *other, Filter_plain *work)
{
    double first[2 * N_OUTPUTS], second[2 * N_OUTPUTS];
    advance_one(one, packed, normal, first, work);
    advance_one(two, other, normal, second, work);
    return said_by_readings(packed, first, other, second);
}

/* Let the states be as uncertain, in the sample of the first past, as the two pasts lead them apart. Where the second leads
   beyond all sense nothing is doubted: of a state that uncertain a precise reading would leave rounding errors alone. */
static void doubt_past(const State *state, const Version *real, const double *other, double *packed, Trial *trial, Filter_plain *work)
{
    double one[FB_ROOM(N_STATES)], two[FB_ROOM(N_STATES)];
    foresee(state->healthy.lane, packed, &state->normal, one, trial, work);
    foresee(real->lane, other, &state->normal, two, trial, work);
    for (int i = 0; i < N_STATES; i++) {
        const double most = ABSURD * larger(travelled(&state->healthy, i), fabs(one[i]));
        const double apart = fabs(two[i] - one[i]);
        packed[SAMPLE_GAP + i] = hypot(packed[SAMPLE_GAP + i], apart <= ABSURD * most ? smaller(apart, most) : 0.0);
    }
}

FB_OFTEN

/* Largest innovation of a packed sample in its standard deviation. */
static double wildness_of(const double *packed, const double *innovations)
{
    double most = 0.0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        if (!(packed[SAMPLE_USE + j] > 0.0)) continue;
        const double score = fabs(innovations[j]) / sqrt(innovations[N_OUTPUTS + j]);
        if (isnan(score)) return NAN; /* of a filter that has run away */
        most = fmax(most, score);
    }
    return most;
}

FB_SELDOM

/* Keep the samples after number `since` as they are if the inputs that waited from then on are real: from them lanes begin at an
   alarm. lane: memory. */
static void keep_as_believed(State *state, int64_t since, double *lane, Filter_plain *work)
{
    double innovations[2 * N_OUTPUTS];
    if (since < 0 || state->clock.index - since > PENDING) return;
    memcpy(lane, row_of(&state->past, since)->lane, PLAIN_NUMBERS * sizeof *lane);
    for (int64_t number = since + 1; number < state->clock.index; number++) {
        Row *row = row_of(&state->past, number);
        memcpy(row->sample, state->refused[number % PENDING], sizeof row->sample);
        advance_one(lane, row->sample, &state->normal, innovations, work);
        memcpy(row->lane, lane, sizeof row->lane);
        row->wildness = wildness_of(row->sample, innovations);
        state->sensors.surprised = row->wildness > SPIKE;
    }
}

/* Decide whether inputs that were refused at the last sample are real. While they are refused a second filter, the rival, runs
   beside as if they were, until the readings tell which of the two is right. If the rival is, it is the healthy filter from
   then on. Gives how many inputs are wild. */
static int64_t decide_inputs(State *state, const Sample *sample, double *packed, SampleMemory *memory, Filter_plain *work)
{
    Inputs *after = &state->inputs;
    const Inputs *before = &memory->before.inputs;
    keep_version(state, &memory->before);
    const int64_t length = state->clock.index - before->odd_since;
    believe(state, length > 1);
    take_sample(state, sample, memory->other, &memory->trial, work);
    keep_version(state, &memory->real);
    go_by_version(state, &memory->before);
    for (int k = 0; k < N_INPUTS; k++) after->odd[k] = NAN;
    take_sample(state, sample, packed, &memory->trial, work);
    memcpy(memory->one, state->healthy.lane, sizeof memory->one);
    memcpy(memory->two, memory->real.lane, sizeof memory->two);
    const double gain = compare(&state->normal, memory->one, packed, memory->two, memory->other, work) + before->gain;
    int odd = 0, goes_on = 1, is_back = 1, untold = 0;
    for (int k = 0; k < N_INPUTS; k++) {
        if (!isfinite(before->odd[k])) continue;
        const int missing = !isfinite(sample->u[k]);
        odd++;
        goes_on &= missing || isfinite(after->odd[k]);
        untold |= missing && is_restless(before, k); /* usually told */
        is_back &= fabs(sample->u[k] - before->held[k]) < SPIKE_BACK * fabs(before->odd[k] - before->held[k]);
    }
    if (gain < -TELLING) return odd * length;
    if (gain <= TELLING) { /* the readings do not tell */
        if (goes_on && length < PENDING) {
            for (int k = 0; k < N_INPUTS; k++)
                if (isfinite(before->odd[k]) && !isfinite(sample->u[k])) after->odd[k] = before->odd[k];
            after->odd_since = before->odd_since;
            memcpy(after->rival, memory->two, sizeof after->rival);
            memcpy(state->refused[state->clock.index % PENDING], memory->other, sizeof memory->other);
            after->gain = gain;
            return 0;
        }
        if (goes_on && untold) return odd * length;
        if (is_back) {
            doubt_past(state, &memory->real, memory->other, packed, &memory->trial, work);
            return odd * length;
        }
    }
    go_by_version(state, &memory->real);
    keep_as_believed(state, before->odd_since, memory->one, work);
    memcpy(packed, memory->other, sizeof memory->other);
    return 0;
}

FB_OFTEN

/* Pack a sample, without the faults that were accepted; every input has had a value. The state becomes that after it but for
   the healthy lane, which stays before it, and is the rival where that is believed. `earlier` [N_INPUTS]: the inputs two
   samples ago, which `without_spike` asks for. Gives how many inputs are wild. */
static int64_t admit(State *state, const Sample *sample, double *earlier, double *packed, SampleMemory *memory, Filter_plain *work)
{
    int odd = 0;
    for (int k = 0; k < N_INPUTS; k++) {
        earlier[k] = state->inputs.earlier[k];
        odd |= isfinite(state->inputs.odd[k]);
    }
    if (odd && state->clock.running) return decide_inputs(state, sample, packed, memory, work);
    take_sample(state, sample, packed, &memory->trial, work);
    return 0;
}

/* Widen what sensor j has shown by a reading. */
static void show(Sensors *sensors, int j, double y)
{
    sensors->shown[0][j] = smaller(sensors->shown[0][j], y);
    sensors->shown[1][j] = larger(sensors->shown[1][j], y);
}

/* A reading within what sensor j has shown and so many widths of it more; any where it showed nothing. */
static double within(const Sensors *sensors, int j, double widths, double y)
{
    const double low = sensors->shown[0][j], high = sensors->shown[1][j];
    const double beyond = widths * larger(high - low, LEAST_WIDTH * OUTPUT_NOISE[j]);
    return low <= high ? bounded(y, low - beyond, high + beyond) : y;
}

FB_SELDOM

/* Take wild readings out of a packed sample, by the innovations [2 * N_OUTPUTS] of the healthy filter, and learn what the
   sensors show; `clock` after packing it. Gives how many were wild; the sample is as it was where none is. */
static int64_t judge(const Clock *clock, Sensors *sensors, const double *innovations, double *packed)
{
    const int warm = clock->index - clock->begun >= WARM_UP_SAMPLES; /* before, the range is not known yet */
    int64_t found = 0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        double *y = &packed[SAMPLE_Y + j], *used = &packed[SAMPLE_USE + j], *spent = &sensors->spent[j];
        const int far = !warm || within(sensors, j, STRAY_FAR, *y) != *y;
        const int wild = *used > 0.0 && is_off(innovations, j, SURPRISE) && far && !OUTPUT_RANGED[j];
        if (!wild) {
            if (*used > 0.0) show(sensors, j, *y);
            *spent = larger(*spent - 1.0 / RECOVERY, 0.0);
            continue;
        }
        found++;
        if (*spent <= PATIENCE - 1.0) {
            *spent += 1.0;
            *used = *y = 0.0;
            continue;
        }
        const double cut = within(sensors, j, CUT_FAR, *y);
        if (cut == *y) show(sensors, j, *y);
        *y = cut;
    }
    return found;
}

FB_OFTEN

#endif
