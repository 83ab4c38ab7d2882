/* A plant that is watched by the core: its samples come from steps of a simulator's clock, and what was found stands in
   variables. The core allocates nothing; an FMU has instances, whose memory is allocated here. */
#include <stdio.h>
#include <stdlib.h>

#include "core.c"

#include "variables.h"
#include "watcher.h"

#define CLOSE 1e-3 /* of a sample: times of a simulator are sums, which round */
#define LINE 64    /* bytes of a cache line, at which memory of the core begins */
#define NOTHING (-1)

/* Where an instance stands in its life. */
enum { MODE_NEW, MODE_STARTING, MODE_RUNNING, MODE_OVER };

/* What was told and what was found, as variables have it: numbers of eight bytes only. */
typedef struct {
    int64_t mode;
    double start;                  /* time of the first sample, s */
    int64_t samples;               /* that were taken */
    double u[FB_ROOM(N_INPUTS)], y[N_OUTPUTS];
    int64_t status, alarm;         /* 1: there is one */
    double alarm_time, change_time;
    int64_t concluded;             /* samples at the last diagnosis; 0: none yet */
    int64_t best, kind, group;     /* the best hypothesis and what kind of fault; -1: none. How many cannot be told from it */
    double diagnosis_time, probability, within_accuracy, mismatch;
    double estimate[FB_ROOM(N_PARAMETERS)], sd[FB_ROOM(N_PARAMETERS)];
} Desk;

struct Watcher {
    State state;
    Desk desk;
    char message[160];
    void *memory; /* of `work`, which a copy lacks */
    Work *work;
    Report report;
    Diagnosis found;
};

const char *watcher_token(void) { return FMU_TOKEN; }

/* Let the parameters be as the model says. */
static void tell_nominal(Desk *desk)
{
    for (int k = 0; k < N_PARAMETERS; k++) {
        desk->estimate[k] = NOMINAL_VALUE[k];
        desk->sd[k] = NOMINAL_SD[k];
    }
}

void watcher_reset(Watcher *watcher)
{
    Desk *desk = &watcher->desk;
    memset(desk, 0, sizeof *desk);
    for (int k = 0; k < N_INPUTS; k++) desk->u[k] = NAN;
    for (int j = 0; j < N_OUTPUTS; j++) desk->y[j] = NAN;
    desk->best = desk->kind = NOTHING;
    tell_nominal(desk);
    watcher->message[0] = '\0';
    fb_init(&watcher->state, 0.0, 0);
}

Watcher *watcher_new(void)
{
    Watcher *watcher = (Watcher *)calloc(1, sizeof(Watcher));
    if (!watcher) return NULL;
    watcher->memory = calloc(1, sizeof(Work) + LINE);
    if (!watcher->memory) {
        free(watcher);
        return NULL;
    }
    watcher->work = (Work *)(((uintptr_t)watcher->memory + LINE - 1) / LINE * LINE);
    watcher_reset(watcher);
    return watcher;
}

void watcher_free(Watcher *watcher)
{
    if (!watcher) return;
    free(watcher->memory);
    free(watcher);
}

/* Note a diagnosis: its best candidate, and parameters that it does not suspect as the model says. */
static void tell_diagnosis(Desk *desk, const Diagnosis *found)
{
    const Candidate *best = found->candidates;
    desk->concluded = desk->samples;
    desk->diagnosis_time = found->time;
    desk->within_accuracy = found->within_accuracy;
    desk->mismatch = found->mismatch;
    desk->best = desk->kind = NOTHING;
    desk->group = 0;
    desk->probability = 0.0;
    tell_nominal(desk);
    if (found->n_candidates == 0) return;
    desk->best = best->hypothesis;
    desk->kind = best->n_kinds > 0 ? best->kinds[0] : NOTHING;
    desk->probability = best->probability;
    for (int64_t k = 0; k < found->n_candidates; k++) desk->group += found->candidates[k].group != 0;
    for (int64_t k = 0; k < best->n_suspects; k++) {
        const Suspect *suspect = &best->suspects[k];
        if (suspect->parameter < 0) continue;
        desk->estimate[suspect->parameter] = suspect->estimate;
        desk->sd[suspect->parameter] = suspect->sd;
    }
}

/* Give a sample as it is read: a value at an end of its range, or an input beyond it, is missing, as in a recording. */
static void read_desk(const Desk *desk, int with_readings, Sample *sample)
{
    for (int k = 0; k < N_INPUTS; k++)
        sample->u[k] = isfinite(desk->u[k]) && desk->u[k] >= INPUT_LEAST[k] && desk->u[k] <= INPUT_MOST[k] ? desk->u[k] : NAN;
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double y = desk->y[j];
        sample->y[j] = with_readings && isfinite(y) && y > READING_LOWEST[j] && y < READING_HIGHEST[j] ? y : NAN;
    }
}

/* Take one sample. */
static void take_one(Watcher *watcher, int with_readings)
{
    Desk *desk = &watcher->desk;
    const State *state = &watcher->state;
    Sample sample;
    sample.time = watcher_time(watcher);
    sample.dt = desk->samples > 0 ? SAMPLE_TIME : 0.0;
    read_desk(desk, with_readings, &sample);
    fb_block(&watcher->state, watcher->work, 1, &sample.time, &sample.dt, sample.u, sample.y, &watcher->report, &watcher->found);
    desk->samples++;
    desk->status = watcher->report.status;
    desk->alarm = state->clock.alarm >= 0;
    if (watcher->report.detected) {
        desk->alarm_time = state->alarm.time;
        desk->change_time = state->alarm.change_time;
    }
    if (watcher->report.due) tell_diagnosis(desk, &watcher->found);
}

double watcher_time(const Watcher *watcher) { return watcher->desk.start + (double)watcher->desk.samples * SAMPLE_TIME; }

void watcher_start_at(Watcher *watcher, double time) { watcher->desk.start = time; }

const char *watcher_begin(Watcher *watcher)
{
    if (watcher->desk.mode != MODE_NEW) return "this instance has begun already; reset it first";
    fb_init(&watcher->state, watcher->desk.start, 0);
    watcher->desk.mode = MODE_STARTING;
    return NULL;
}

const char *watcher_run(Watcher *watcher)
{
    if (watcher->desk.mode != MODE_STARTING) return "enter the initialization mode first";
    watcher->desk.mode = MODE_RUNNING;
    return NULL;
}

const char *watcher_step(Watcher *watcher, double time, double step)
{
    const double due = watcher_time(watcher), count = step / SAMPLE_TIME, whole = floor(count + 0.5);
    if (watcher->desk.mode != MODE_RUNNING) return "only an instance that was initialized can make a step";
    if (!(fabs(time - due) <= CLOSE * SAMPLE_TIME)) {
        snprintf(watcher->message, sizeof watcher->message,
                 "the step begins at %.15g s, but the one before ended at %.15g s; steps follow each other", time, due);
        return watcher->message;
    }
    if (!(whole >= 1.0 && fabs(count - whole) <= CLOSE)) {
        snprintf(watcher->message, sizeof watcher->message,
                 "a communication step of %.15g s; take a multiple of the model's sample_time, %.15g s", step, (double)SAMPLE_TIME);
        return watcher->message;
    }
    for (int64_t k = 0; (double)k < whole; k++) take_one(watcher, k == 0);
    return NULL;
}

const char *watcher_end(Watcher *watcher)
{
    if (watcher->desk.mode != MODE_RUNNING) return "only an instance that runs can be terminated";
    watcher->desk.mode = MODE_OVER;
    if (watcher->state.clock.alarm < 0 || watcher->desk.concluded == watcher->desk.samples) return NULL;
    fb_diagnosis(&watcher->state, watcher->work, &watcher->found);
    tell_diagnosis(&watcher->desk, &watcher->found);
    return NULL;
}

/* Whether `number` is one of n variables from `first` on; which one is written to k. */
static int is_one_of(uint32_t number, uint32_t first, uint32_t n, uint32_t *k)
{
    *k = number - first;
    return number >= first && *k < n;
}

int watcher_get_real(const Watcher *watcher, uint32_t number, double *value)
{
    const Desk *desk = &watcher->desk;
    uint32_t k;
    if (is_one_of(number, VR_INPUTS, N_INPUTS, &k)) *value = desk->u[k];
    else if (is_one_of(number, VR_READINGS, N_OUTPUTS, &k)) *value = desk->y[k];
    else if (is_one_of(number, VR_ESTIMATES, N_PARAMETERS, &k)) *value = desk->estimate[k];
    else if (is_one_of(number, VR_SDS, N_PARAMETERS, &k)) *value = desk->sd[k];
    else if (number == VR_TIME) *value = watcher_time(watcher);
    else if (number == VR_ALARM_TIME) *value = desk->alarm_time;
    else if (number == VR_CHANGE_TIME) *value = desk->change_time;
    else if (number == VR_DIAGNOSIS_TIME) *value = desk->diagnosis_time;
    else if (number == VR_PROBABILITY) *value = desk->probability;
    else if (number == VR_WITHIN_ACCURACY) *value = desk->within_accuracy;
    else if (number == VR_MISMATCH) *value = desk->mismatch;
    else return 0;
    return 1;
}

int watcher_set_real(Watcher *watcher, uint32_t number, double value)
{
    uint32_t k;
    if (is_one_of(number, VR_INPUTS, N_INPUTS, &k)) watcher->desk.u[k] = value;
    else if (is_one_of(number, VR_READINGS, N_OUTPUTS, &k)) watcher->desk.y[k] = value;
    else return 0;
    return 1;
}

int watcher_get_whole(const Watcher *watcher, uint32_t number, int64_t *value)
{
    const Desk *desk = &watcher->desk;
    if (number == VR_STATUS) *value = desk->status;
    else if (number == VR_BEST) *value = desk->best;
    else if (number == VR_KIND) *value = desk->kind;
    else if (number == VR_GROUP) *value = desk->group;
    else if (number == VR_SAMPLES) *value = desk->samples;
    else return 0;
    return 1;
}

int watcher_get_flag(const Watcher *watcher, uint32_t number, int *value)
{
    if (number != VR_ALARM) return 0;
    *value = watcher->desk.alarm != 0;
    return 1;
}

int watcher_get_text(const Watcher *watcher, uint32_t number, const char **value)
{
    if (number != VR_BEST_NAME) return 0;
    *value = watcher->desk.best < 0 ? "" : HYPOTHESIS_NAME[watcher->desk.best];
    return 1;
}

void watcher_become(Watcher *watcher, const Watcher *copy)
{
    watcher->state = copy->state;
    watcher->desk = copy->desk;
}

Watcher *watcher_copy(const Watcher *watcher)
{
    Watcher *copy = (Watcher *)calloc(1, sizeof(Watcher));
    if (copy) watcher_become(copy, watcher);
    return copy;
}

#define DESK_WORDS ((int64_t)(sizeof(Desk) / 8))

size_t watcher_saved_size(void) { return (size_t)(fb_saved_size() + 8 * (DESK_WORDS + 1)); }

void watcher_save(const Watcher *watcher, uint8_t *bytes)
{
    uint8_t *at = bytes + fb_saved_size();
    fb_save(&watcher->state, bytes);
    for (int64_t k = 0; k < DESK_WORDS; k++) {
        uint64_t word;
        memcpy(&word, (const uint8_t *)&watcher->desk + 8 * k, sizeof word);
        put_word(at + 8 * k, word);
    }
    put_word(at + 8 * DESK_WORDS, checksum(at, 8 * DESK_WORDS));
}

int watcher_restore(Watcher *watcher, const uint8_t *bytes, size_t n)
{
    const uint8_t *at = bytes + fb_saved_size();
    Desk desk;
    if (n != watcher_saved_size() || get_word(at + 8 * DESK_WORDS) != checksum(at, 8 * DESK_WORDS)) return 0;
    for (int64_t k = 0; k < DESK_WORDS; k++) {
        const uint64_t word = get_word(at + 8 * k);
        memcpy((uint8_t *)&desk + 8 * k, &word, sizeof word);
    }
    if (desk.mode < MODE_NEW || desk.mode > MODE_OVER || desk.best < NOTHING || desk.best >= N_HYPOTHESES) return 0;
    if (fb_restore(&watcher->state, bytes, fb_saved_size())) return 0;
    watcher->desk = desk;
    return 1;
}
