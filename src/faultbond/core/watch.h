/* A sample passes: the healthy filter, the sums of the detector, the alarm, and from the alarm on the bank. */
#ifndef FB_WATCH_H
#define FB_WATCH_H

#include "advice.h"
#include "outliers.h"
#include "over.h"
#include "spikes.h"

#define START_SAMPLES 20 /* gathered before an unknown start is solved */
#define DIAGNOSIS_EVERY 20 /* samples between diagnoses */
#define OLD_WINDOW 3 /* window of the lane of long ago, from which drifts under way begin */

/* Memory of a call. */
typedef struct {
    Filters filters;
    SampleMemory sample;
    StartMemory start;
    BankMemory bank;
    RankingMemory ranking;
    Rivals rivals;
    Diagnosis found; /* where nobody asked for one */
    double lane[PLAIN_NUMBERS];  /* the healthy lane after the sample */
    Normal normal; /* where nothing was accepted */
    double earlier[FB_ROOM(N_INPUTS)], packed[N_SAMPLE];
    double walks[FB_ROOM(TRIANGLE(N_PARAMETERS))];
} Work;

FB_SELDOM

/* The first samples are not kept any more. */
static void forget_beginning(Beginning *beginning)
{
    beginning->sample = -1;
    beginning->count = beginning->again = 0;
}

/* Begin to learn what the sensors show, and how far the states go. */
static void begin_shown(Sensors *sensors)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        sensors->shown[0][j] = INFINITY;
        sensors->shown[1][j] = -INFINITY;
    }
}

static void begin_travel(Healthy *healthy)
{
    for (int i = 0; i < N_STATES; i++) {
        healthy->travel[0][i] = INFINITY;
        healthy->travel[1][i] = -INFINITY;
    }
}

/* Give the state before the first sample, at time t0 (s). quiet 1: no alarm is ever raised; ALARMS_ONLY: after one no lanes begin. */
static void begin_state(State *state, double t0, int64_t quiet)
{
    memset(state, 0, sizeof *state);
    Clock *clock = &state->clock;
    clock->begun = clock->alarm = clock->accepted = clock->over = -1;
    clock->time = t0;
    clock->quiet = quiet;
    for (int k = 0; k < N_INPUTS; k++) {
        Inputs *inputs = &state->inputs;
        inputs->held[k] = inputs->earlier[k] = inputs->odd[k] = NAN;
        inputs->lowest[k] = inputs->since_step[k] = INFINITY;
        inputs->highest[k] = -INFINITY;
        inputs->habit[k] = state->normal.input_gain[k] = 1.0;
        inputs->inside[k] = NAN;
    }
#if N_NOISY > 0
    for (int k = 0; k < N_NOISY; k++) state->inputs.record[k] = NAN;
#endif
    for (int c = 0; c < N_CONDITIONS; c++) state->inputs.true_for[c] = INFINITY;
    state->inputs.odd_since = -1;
    for (int j = 0; j < N_OUTPUTS; j++) {
        state->sensors.nis[j] = state->sensors.run[j] = state->normal.gain[j] = state->normal.noise[j] = 1.0;
    }
    begin_shown(&state->sensors);
    begin_sums(&state->sensors, 0.0);
    begin_travel(&state->healthy);
    clear_bank(state);
    forget_sure(&state->sure);
    forget_settled(&state->settled);
    state->alarm.walker = state->alarm.window = state->alarm.old = -1;
    forget_beginning(&state->beginning);
}

FB_OFTEN

/* A report without anything in it. */
static void report_nothing(Report *report, int64_t status)
{
    memset(report, 0, sizeof *report);
    report->status = status;
    for (int j = 0; j < N_OUTPUTS; j++) report->expected[j] = report->variance[j] = report->cusum[j] = NAN;
    for (int k = 0; k < N_SLOW; k++) report->slow[k] = NAN;
}

/* What the healthy filter says of a packed sample. While a sensor is blanked, that is no part of what the model expects. */
static void report_filter(const State *state, int64_t status, const double *packed, const double *innovations, Report *report)
{
    report_nothing(report, status);
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double measured = packed[SAMPLE_USE + j] > 0.0 ? packed[SAMPLE_Y + j] : 0.0, scale = packed[SAMPLE_SCALE + j];
        report->expected[j] = measured - innovations[j];
        const double blank = scale >= BLANK_FACTOR ? (scale - 1.0) * noise_at(j, report->expected[j]) : 0.0;
        report->variance[j] = innovations[N_OUTPUTS + j] - blank;
        report->cusum[j] = statistic(&state->sensors, j);
    }
    for (int k = 0; k < N_SLOW; k++) report->slow[k] = state->healthy.lane[AT_SLOW + k] / SLOW_SD[k];
}

FB_SELDOM

/* The lane of long ago from which drifts under way begin: that from before a walk that raised the alarm, else the oldest of the
   windows up to OLD_WINDOW; NULL: none is kept. */
static const double *oldest_lane(const State *state)
{
    const Clock *clock = &state->clock;
    const int64_t index = clock->alarm >= 0 ? clock->alarm : clock->index;
    if (clock->alarm >= 0 && state->alarm.old >= 0) return state->healthy.snapshots[state->alarm.old];
    for (int window = OLD_WINDOW; window >= 0; window--) {
        const int64_t length = length_of_walk(window);
        for (int64_t number = index / length - 1; number <= index / length; number++)
            if (number >= 0 && (double)(number * length) >= walks_from(clock, &state->healthy) && number * length < index)
                return state->healthy.snapshots[kept_at(window, number)];
    }
    return NULL;
}

FB_OFTEN

/* Keep a packed sample with the healthy lane after it, and after an alarm take it into the bank. */
static void keep(State *state, const double *packed, const double *lane, double wildness, Work *work)
{
    Row *row = row_of(&state->past, state->clock.index);
    memcpy(row->sample, packed, sizeof row->sample);
    if (lane) memcpy(row->lane, lane, sizeof row->lane);
    else memset(row->lane, 0, sizeof row->lane);
    row->time = state->clock.time;
    row->wildness = wildness;
    state->sensors.surprised = wildness > SPIKE;
    if (state->clock.alarm < 0 || state->clock.quiet == ALARMS_ONLY) return;
    const double *old = oldest_lane(state);
    advance_bank(state, packed, old ? old[KEPT_TIME] : -INFINITY, &work->bank, &work->filters);
    work_on(state, &work->bank, &work->filters);
}

/* Take the healthy lane after a sample, with what is kept of it for long. walks: of TRIANGLE(N_PARAMETERS), memory. */
static void remember(State *state, const double *lane, double *walks)
{
    Healthy *healthy = &state->healthy;
    memcpy(healthy->lane, lane, sizeof healthy->lane);
    learn_travel(healthy);
    judge_walks(state->clock.index, &state->clock, &state->inputs, state->normal.rates, healthy, walks);
    keep_for_long(state->clock.index, &state->clock, 1, healthy);
}

FB_SELDOM

/* The trail up to now. */
static void trail_of(const State *state, Trail *trail)
{
    const Clock *clock = &state->clock;
    int64_t oldest = clock->index - DEPTH + 1;
    if (clock->begun > oldest) oldest = clock->begun;
    if (clock->accepted > oldest) oldest = clock->accepted;
    if (clock->over > oldest) oldest = clock->over;
    trail->past = &state->past;
    trail->oldest = oldest;
    trail->n = clock->index - oldest + 1;
    trail->alarm = (clock->alarm >= 0 ? clock->alarm : clock->index) - oldest;
    trail->old = oldest_lane(state);
    find_first(clock, &state->alarm, &state->beginning, trail);
    find_bursts(trail);
}

/* The filter lost the plant: it starts anew. Where a lost one believed the plant it has not been. An alarm of which no lane is
   left has nothing more to tell. */
static void lose(State *state)
{
    if (state->clock.alarm >= 0 && leader_of(&state->bank) < 0) end_alarm(state);
    state->clock.begun = -1;
    state->clock.running = 0;
    for (int k = 0; k < N_INPUTS; k++) state->inputs.odd[k] = NAN;
    begin_sums(&state->sensors, 0.0);
    begin_travel(&state->healthy);
}

/* Whether the first samples suffice to begin; `count` of them are there. */
static int is_gathered(const State *state, int64_t count, int again)
{
    int unknown = again, silent = 0;
    for (int i = 0; i < N_STATES; i++) unknown |= isnan(START_SD[i]);
    for (int j = 0; j < N_OUTPUTS && unknown; j++) {
        int read = 0;
        for (int64_t k = 0; k < count && !read; k++)
            read = state->past.rows[(state->clock.index - k) % N_ROWS].sample[SAMPLE_USE + j] > 0.0;
        silent |= !read;
    }
    return count >= START_SAMPLES && !(unknown && count < START_PATIENCE && silent);
}

/* Of a long wait only the last samples are taken, with the last value of each sensor: over all of it nominal parameters would
   not hold. Gives how many; `count` are there. */
static int64_t worth_starting_from(const State *state, int64_t count, int again)
{
    int64_t skipped = count - START_SAMPLES;
    for (int i = 0; i < N_STATES && !again; i++)
        if (!isnan(START_SD[i])) return count;
    for (int j = 0; j < N_OUTPUTS; j++)
        for (int64_t k = 0; k < count; k++)
            if (state->past.rows[(state->clock.index - k) % N_ROWS].sample[SAMPLE_USE + j] > 0.0) {
                if (count - 1 - k < skipped) skipped = count - 1 - k;
                break;
            }
    return count - skipped;
}

/* Solve the start from the last samples; into `first` of the work. Gives how many values were wild; `sound`: whether the filter runs
   from there. `again`: see `solve_start`. */
static int64_t begin_from(State *state, int64_t count, int again, int *sound, Work *work)
{
    FirstMemory *first = &work->bank.first;
    const double *known = known_at_first(&state->clock, &state->normal, first);
    for (int64_t k = 0; k < count; k++)
        memcpy(first->samples[k], row_of(&state->past, state->clock.index - count + 1 + k)->sample, sizeof first->samples[k]);
    const int64_t wild = begin(state, count, known, again, first->samples, first->mean, first->covariance, &work->start,
                               &first->solve, &work->filters.plain);
    healthy_lane(first->mean, first->covariance, AT_SLOT, known, first->lane);
    memcpy(work->lane, first->lane, sizeof first->lane);
    for (int64_t k = 0; k < count; k++) advance_one(work->lane, first->samples[k], &state->normal, NULL, &work->filters.plain);
    *sound = is_sound(work->lane);
    return wild;
}

/* The same, and again with all that lags behind inputs where these are, if the filter does not run: of a plant that is off it may make up
   for that, as a valve that never was open. */
static int64_t begin_soundly(State *state, int64_t count, int again, Work *work)
{
    int sound;
    const Clock clock = state->clock;
    const Inputs inputs = state->inputs;
    double astray[FB_ROOM(N_STATES)];
    memcpy(astray, state->healthy.astray, sizeof astray);
    const int64_t wild = begin_from(state, count, again, &sound, work);
    if (sound) return wild;
    state->clock = clock;
    state->inputs = inputs;
    memcpy(state->healthy.astray, astray, sizeof astray);
    return begin_from(state, count, again | AT_INPUTS, &sound, work);
}

/* Gather the first samples; once there are enough, solve the start and filter what was gathered. */
static void gather(State *state, Report *report, Work *work)
{
    Clock *clock = &state->clock;
    FirstMemory *first = &work->bank.first;
    int64_t count = clock->index - clock->begun + 1;
    int again = 0; /* the filter ran before: the start that the model gives is long past */
    for (int64_t i = 0; i < PLAIN_NUMBERS; i++) again |= state->healthy.lane[i] != 0.0;
    report_nothing(report, STARTING);
    if (!is_gathered(state, count, again)) return;
    count = worth_starting_from(state, count, again);
    clock->begun = clock->index - count + 1;
    if (count > MOST_FIRST) count = MOST_FIRST;
    const Beginning beginning = {clock->index - count + 1, count, again};
    double innovations[2 * N_OUTPUTS];
    const int64_t wild = begin_soundly(state, count, again, work);
    state->beginning = beginning;
    memcpy(work->lane, first->lane, sizeof first->lane);
    begin_walks(&state->healthy, work->lane, row_of(&state->past, clock->begun)->time);
    begin_shown(&state->sensors);
    for (int64_t k = 0; k < count; k++) {
        Row *row = row_of(&state->past, clock->index - count + 1 + k);
        advance_one(work->lane, first->samples[k], &state->normal, innovations, &work->filters.plain);
        memcpy(row->sample, first->samples[k], sizeof row->sample);
        memcpy(row->lane, work->lane, sizeof row->lane);
        row->wildness = wildness_of(first->samples[k], innovations);
        state->sensors.surprised = row->wildness > SPIKE;
        see(&state->sensors, first->samples[k]);
    }
    if (is_sound(work->lane)) {
        clock->running = 1;
        memcpy(state->healthy.lane, work->lane, sizeof state->healthy.lane);
        report_filter(state, WARMING, first->samples[count - 1], innovations, report);
    } else {
        lose(state);
        report_nothing(report, LOST);
    }
    report->wild = wild;
}

FB_OFTEN

/* Whether it is time for a diagnosis: every so many samples after an alarm, once the bank has begun, and as soon as it has. */
static int is_due(const State *state)
{
    const Clock *clock = &state->clock;
    const Job *job = &state->job;
    if (clock->alarm < 0 || !is_ready(job)) return 0;
    return (clock->index - clock->alarm) % DIAGNOSIS_EVERY == 0 || (job->renewals == 0 && job->settled == clock->index);
}

/* Give the diagnosis of now, and keep in mind what is sure; or it is the last one, as the alarm is over. */
static void conclude_and_settle(State *state, Diagnosis *found, RankingMemory *memory)
{
    conclude(state, found, memory);
    note_missed(&memory->ranking, found, &state->bank);
    settle_on(&state->settled, found, state->clock.index);
    found->is_over = end_harmless(state, memory);
}

/* Update the sums, raise the alarm, renew the bank. */
static void judge_sample(State *state, const double *innovations, Report *report, Diagnosis *found, Work *work)
{
    Clock *clock = &state->clock;
    Trail trail;
    const int warm = clock->index - clock->begun >= WARM_UP_SAMPLES, diagnosing = clock->alarm >= 0;
    const double *packed = work->packed;
    if (warm) accumulate(clock, &state->inputs, &state->healthy, &state->sensors, packed, innovations);
    remember(state, work->lane, work->walks);
    report_filter(state, diagnosing ? DIAGNOSING : warm ? WATCHING : WARMING, packed, innovations, report);
    if (diagnosing && state->job.kind == IDLE && clock->alarm <= clock->index - DEPTH)
        state->job.renewals = N_RENEWALS; /* the samples about the alarm are not kept any more */
    if (diagnosing && is_renewal(state) && clock->alarm > clock->begun) { /* of a filter that was lost, no lanes are kept */
        trail_of(state, &trail);
        begin_again(state, &trail, &work->bank);
        work_on(state, &work->bank, &work->filters);
    } else if (!diagnosing && warm && clock->quiet != 1) {
        const int64_t change = detect(state);
        if (change >= 0) {
            clock->alarm = clock->index;
            clock->detections++;
            if (clock->quiet != ALARMS_ONLY) {
                trail_of(state, &trail);
                begin_bank(state, &trail, change - trail.oldest);
                work_on(state, &work->bank, &work->filters);
            }
            report->status = DIAGNOSING;
            report->detected = 1;
        }
    }
    if (clock->alarm >= 0) note_values(state);
    report->due = is_due(state);
    if (report->due && state->job.kind == IDLE && state->job.renewals == N_RENEWALS) put_to_rest(&state->bank);
    if (report->due) conclude_and_settle(state, found, &work->ranking);
}

/* Take the packed sample with the healthy filter, from where it stood before. */
static void filter_packed(const State *state, double *innovations, Work *work)
{
    memcpy(work->lane, state->healthy.lane, sizeof work->lane);
    advance_one(work->lane, work->packed, &state->normal, innovations, &work->filters.plain);
}

/* Take the packed sample with a running filter; `wild`: how many of its inputs are. */
static void filter_sample(State *state, int64_t wild, Report *report, Diagnosis *found, Work *work)
{
    double innovations[2 * N_OUTPUTS];
    filter_packed(state, innovations, work);
    if (is_surprising(&state->sensors, work->packed, innovations)) {
        if (without_spike(state, work->earlier, work->packed, &work->sample, &work->filters)) {
            filter_packed(state, innovations, work);
            wild++;
        }
        const int64_t n_wild = judge(&state->clock, &state->sensors, innovations, work->packed);
        if (n_wild) filter_packed(state, innovations, work);
        wild += n_wild;
    } else {
        see(&state->sensors, work->packed);
    }
    keep(state, work->packed, work->lane, wildness_of(work->packed, innovations), work);
    if (is_sound(work->lane)) {
        judge_sample(state, innovations, report, found, work);
    } else {
        lose(state);
        report_nothing(report, LOST);
    }
    report->wild = wild;
}

FB_SELDOM

/* Take a sample at which the model does not hold. Nothing is judged: no sum grows, no lane becomes likelier, and no time passes
   for what waits for samples that are. */
static void pass_outside(State *state, const Sample *sample, Report *report, Diagnosis *found, Work *work)
{
    Clock *clock = &state->clock;
    double innovations[2 * N_OUTPUTS];
    pack_outside(state, sample, clock, &state->inputs, work->packed);
    clock->time = sample->time;
    if (clock->running) {
        filter_packed(state, innovations, work);
        keep(state, work->packed, work->lane, 0.0, work);
        memcpy(state->healthy.lane, work->lane, sizeof work->lane);
        state->healthy.walk = state->healthy.walker = 0.0;
        keep_for_long(clock->index, clock, 1, &state->healthy);
        if (clock->index - clock->begun < WARM_UP_SAMPLES) clock->begun++;
    } else {
        clock->begun = -1;
        if (clock->alarm >= 0) keep(state, work->packed, NULL, 0.0, work);
    }
    if (clock->alarm >= 0) state->alarm.outside++;
    put_off(&state->sure);
    put_off_settling(&state->settled);
    report_nothing(report, OUTSIDE);
    for (int j = 0; j < N_OUTPUTS && clock->running; j++) report->cusum[j] = statistic(&state->sensors, j);
    report->due = is_due(state);
    if (report->due) conclude_and_settle(state, found, &work->ranking);
}

FB_OFTEN

/* Whether every input has had a value; while it has not, those of the sample are held. */
static int has_inputs(Inputs *inputs, const Sample *sample)
{
    int ready = 1;
    for (int k = 0; k < N_INPUTS; k++) ready &= isfinite(sample->u[k]) || isfinite(inputs->held[k]);
    for (int k = 0; k < N_INPUTS && !ready; k++)
        if (isfinite(sample->u[k])) inputs->held[k] = sample->u[k];
    return ready;
}

/* Take one sample; `found` gets the diagnosis where one is due. */
static void watch(State *state, const Sample *told, Report *report, Diagnosis *found, Work *work)
{
    Sample sample = *told;
    int64_t left_out[N_OUTPUTS] = {0};
    correct(&state->normal, &sample);
    smooth_inputs(&state->inputs, &sample);
    if (!has_inputs(&state->inputs, &sample)) {
        state->clock.time = sample.time;
        report_nothing(report, WAITING);
    } else if (leave_out(&state->inputs, &sample, left_out)) {
        pass_outside(state, &sample, report, found, work);
    } else {
        const int64_t wild = admit(state, &sample, work->earlier, work->packed, &work->sample, &work->filters.plain);
        state->clock.time = sample.time;
        if (state->clock.running) {
            filter_sample(state, wild, report, found, work);
        } else {
            keep(state, work->packed, NULL, 0.0, work);
            gather(state, report, work);
        }
    }
    memcpy(report->left_out, left_out, sizeof left_out);
    if (state->clock.alarm < 0 && state->clock.index - state->beginning.sample >= DEPTH) forget_beginning(&state->beginning);
    state->clock.index++;
}

#endif
