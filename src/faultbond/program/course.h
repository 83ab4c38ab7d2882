/* A run in progress: points pass through the core, the records come out, and what was found is kept. Points that are there
   together are passed together, up to BLOCK; none waits for another. */
#ifndef WATCH_COURSE_H
#define WATCH_COURSE_H

#include "records.h"

#define BLOCK 64         /* points that are passed at once */
#define NO_LEVEL (-1.0)  /* a person accepts */
#define FEW_DROPPED 20   /* of so many rows one may come too late to be used */
#define REASON_ROOM 1024 /* bytes of why there is no verdict; a longer name is cut */

enum { VERDICT_HEALTHY, VERDICT_FAULT, VERDICT_NONE };

typedef struct Course {
    Plant *plant;
    Json *json;
    void (*show)(const struct Course *course, int first, int n); /* sees points that have passed; NULL: nobody does */
    double level; /* probability from which a diagnosis is accepted by rule; NO_LEVEL: a person accepts */
    int goes_on;  /* whether this run goes on from another one, */
    Found found, before; /* what that had found, and what has been found since */
    double time;  /* of the last point, s; nan: there was none */
    Presence presence;        /* of inputs and sensors in this run */
    int64_t n_rows, n_dropped; /* rows of this run, and those that came too late to be used; set before the run ends, */
    int64_t n_again;           /* as is how many have the time of another row, where these are too many */
    int64_t told; /* point of the last diagnosis; -1: none in this run */
    int64_t lost; /* points at which the filter lost the plant in this run */
    int is_refused; /* whether the core refused what its own rule accepts: a defect */
    int n;          /* points that wait */
    int64_t index[BLOCK];
    double times[BLOCK], steps[BLOCK], inputs[BLOCK * FB_ROOM(N_INPUTS)], readings[BLOCK * FB_ROOM(N_OUTPUTS)];
    Report reports[BLOCK];
    Diagnosis diagnosis;
    Advice advice;
    Candidate candidate;
} Course;

static void course_begin(Course *course, Plant *plant, Json *json, double level)
{
    memset(course, 0, sizeof *course);
    course->plant = plant;
    course->json = json;
    course->level = level;
    course->time = NAN;
    course->told = -1;
    presence_begin(&course->presence);
}

/* Go on from a run that ended at some time, with what it had found. */
static void course_go_on(Course *course, double time, const Found *found)
{
    course->goes_on = 1;
    course->found = course->before = *found;
    course->time = time;
}

/* Count what the core says to n points from number `first` of the block on. */
static void count_points(Course *course, int first, int n)
{
    Found *found = &course->found;
    int in_use[N_OUTPUTS];
    plant_in_use(course->plant, in_use);
    for (int k = 0; k < n; k++) {
        const Report *report = &course->reports[k];
        const double *u = course->inputs + (first + k) * N_INPUTS, *y = course->readings + (first + k) * N_OUTPUTS;
        const int is_outside = report->status == OUTSIDE;
        int is_judged = 0, left_out = 0;
        presence_add(&course->presence, course->times[first + k], u, y);
        for (int j = 0; j < N_OUTPUTS; j++) {
            const int is_read = isfinite(y[j]) != 0;
            is_judged |= is_read && in_use[j] && !report->left_out[j];
            left_out += is_read && report->left_out[j];
        }
        found->watched += (report->status == WATCHING || report->status == DIAGNOSING) && is_judged;
        found->waiting += report->status == WAITING;
        found->wild += report->wild;
        found->outside += is_outside;
        found->sensors_outside += is_outside ? 0 : left_out;
        course->lost += report->status == LOST;
    }
}

static void tell_detection(Course *course)
{
    const PlantAlarm alarm = plant_alarm(course->plant);
    course->found.detections++;
    course->found.is_open = 1;
    course->found.opened = alarm.sample;
    course->found.rejected = 0;
    write_detection(course->json, &alarm);
}

/* Write a diagnosis that was due at a point, and accept its best candidate if it has been sure for long enough. */
static void tell_diagnosis(Course *course, int64_t point, int is_outside)
{
    const PlantMemory *memory = &course->plant->memory;
    fb_advice(memory->state, memory->work, &course->diagnosis, &course->advice);
    write_diagnosis(course->json, &course->diagnosis, &course->advice, is_outside);
    course->told = point;
    if (course->diagnosis.is_over) {
        note_nothing(&course->found);
        memset(&course->candidate, 0, sizeof course->candidate); /* without suspects: nothing is at fault */
        course->candidate.probability = course->diagnosis.within_accuracy;
        write_decision(course->json, "accepted", course->diagnosis.time, &course->candidate, "rule", 0);
        return;
    }
    if (course->level < 0.0 || is_outside) return;
    const int64_t hypothesis = fb_sure(memory->state, &course->diagnosis, course->level);
    if (hypothesis < 0) return;
    if (fb_accept(memory->state, memory->work, hypothesis, &course->candidate)) {
        course->is_refused = 1;
        return;
    }
    note_accepted(&course->found, hypothesis, 0);
    write_decision(course->json, "accepted", course->diagnosis.time, &course->candidate, "rule", 0);
}

/* Decide as a person did, in the file of this run, of the alarm that is open; `other`: what was found there. A candidate that
   is not among the listed ones any more is passed over. */
static void course_heed(Course *course, const Found *other)
{
    Found *found = &course->found;
    const PlantMemory *memory = &course->plant->memory;
    Candidate *candidate = &course->candidate;
    if (!found->is_open || other->detections != found->detections) return; /* what was decided of is past */
    if (other->is_open && other->opened != found->opened) return;          /* of another run */
    if (other->accepted > found->accepted) {
        const int64_t chosen = other->last_accepted;
        const int is_repaired = other->is_repaired != 0;
        if (is_repaired ? fb_repair(memory->state, memory->work, chosen, candidate)
                        : fb_accept(memory->state, memory->work, chosen, candidate))
            return;
        note_accepted(found, chosen, is_repaired);
        write_decision(course->json, "accepted", course->time, candidate, "person", is_repaired);
        return;
    }
    for (int64_t k = 0; k < other->rejected && k < MOST_REJECTED; k++) {
        const int64_t gone = other->ruled_out[k];
        if (is_ruled_out(found, gone) || fb_reject(memory->state, memory->work, gone, candidate)) continue;
        note_rejected(found, gone);
        write_decision(course->json, "rejected", course->time, candidate, "person", 0);
    }
}

/* Pass the points that wait, and write what the core says to them. */
static void course_pass(Course *course)
{
    const PlantMemory *memory = &course->plant->memory;
    for (int first = 0; first < course->n;) {
        const double *inputs = course->inputs + first * N_INPUTS, *readings = course->readings + first * N_OUTPUTS;
        const int taken = (int)fb_block(memory->state, memory->work, course->n - first, course->times + first,
                                        course->steps + first, inputs, readings, course->reports, &course->diagnosis);
        const Report *last = &course->reports[taken - 1];
        count_points(course, first, taken);
        if (course->show) course->show(course, first, taken);
        first += taken;
        course->time = course->times[first - 1];
        if (last->detected) tell_detection(course);
        if (last->due) tell_diagnosis(course, course->index[first - 1], last->status == OUTSIDE);
    }
    course->n = 0;
}

/* Take a point; it is passed when there are many, or with course_pass. */
static void course_take(Course *course, const Point *point)
{
    if (point->resumes || course->n == BLOCK) course_pass(course);
    if (point->resumes) fb_resume(course->plant->memory.state);
    const int k = course->n++;
    course->index[k] = point->index;
    course->times[k] = point->time;
    course->steps[k] = point->dt;
    memcpy(course->inputs + k * N_INPUTS, point->u, N_INPUTS * sizeof(double));
    memcpy(course->readings + k * N_OUTPUTS, point->y, N_OUTPUTS * sizeof(double));
}

/* Write the last diagnosis and the end. The state is not as it was after this: to be saved before. */
static void course_finish(Course *course, const Counts *counts)
{
    const PlantMemory *memory = &course->plant->memory;
    if (course->told != counts->samples - 1 && plant_has_alarm(course->plant)) {
        fb_diagnosis(memory->state, memory->work, &course->diagnosis);
        fb_advice(memory->state, memory->work, &course->diagnosis, &course->advice);
        write_diagnosis(course->json, &course->diagnosis, &course->advice, 0);
    }
    write_end(course->json, counts->samples ? course->time : NAN, counts, &course->found, course->n_dropped, &course->presence);
}

/* Why a recording without any point says nothing. */
#define NO_TIMES                                                                                                                \
    "standard input: no row has a time that can be read, before the year 9999. Check the column and unit of `time`: seconds, " \
    "or dates as 2026-05-31 10:00:00 or 31.5.2026 10:00:00, are read; ms and ns need `unit`."

/* How the word for so many of something ends. */
static const char *plural(int64_t many) { return many == 1 ? "" : "s"; }

/* The first name of n that gave no value. */
static const char *first_absent(const char *const *names, const int64_t *values, int n)
{
    for (int k = 0; k < n; k++)
        if (!values[k]) return names[k];
    return "";
}

static int any_value(const int64_t *values, int n)
{
    int any = 0;
    for (int k = 0; k < n; k++) any |= values[k] != 0;
    return any;
}

/* Whether too many rows came too late to be used, or have the time of another row. */
static int is_disordered(const Course *course) { return course->n_again > 0 || course->n_dropped * FEW_DROPPED > course->n_rows; }

/* Say why this run says nothing about the plant; 0 where it does. samples: passed so far. */
static int no_verdict(const Course *course, int64_t samples, char reason[REASON_ROOM])
{
    const Found *found = &course->found;
    const int64_t holds = samples - found->waiting - found->outside;
    const int64_t *values = course->presence.values;
    const char *silent = first_absent(OUTPUT_NAMES, values, N_OUTPUTS);
    if (course->n_again > 0) {
        snprintf(reason, REASON_ROOM,
                 "%lld of %lld rows have the time of another row, as where times are cut to whole seconds; write times with all their "
                 "digits, or, of rows at even steps, state `time: none` in the model file",
                 (long long)course->n_again, (long long)course->n_rows);
        return 1;
    }
    if (is_disordered(course)) {
        snprintf(reason, REASON_ROOM, "%lld of %lld rows came too late to be used; sort the rows by time", (long long)course->n_dropped,
                 (long long)course->n_rows);
        return 1;
    }
    if (found->watched > course->before.watched) return 0;
    if (found->waiting == samples)
        snprintf(reason, REASON_ROOM, "no row has a value of the input %s", first_absent(INPUT_NAMES, values + N_OUTPUTS, N_INPUTS));
    else if (found->outside && holds <= WARM_UP_SAMPLES)
        snprintf(reason, REASON_ROOM,
                 "the model holds, by `valid_when`, in %lld of %lld sample%s, and the alarms are off for the first %d",
                 (long long)holds, (long long)samples, plural(samples), WARM_UP_SAMPLES);
    else if (holds <= WARM_UP_SAMPLES)
        snprintf(reason, REASON_ROOM, "the recording ended after %lld sample%s, and the alarms are off for the first %d",
                 (long long)samples, plural(samples), WARM_UP_SAMPLES);
    else if (course->lost)
        snprintf(reason, REASON_ROOM,
                 "the filter lost the plant again and again; check units, noise and accuracies in the model file");
    else if (*silent && !any_value(values, N_OUTPUTS))
        snprintf(reason, REASON_ROOM, "no row has a value of %s %s; check the column",
                 N_OUTPUTS == 1 ? "the sensor" : "any sensor, such as", silent);
    else if (*silent)
        snprintf(reason, REASON_ROOM, "no row has a value of the sensor %s, and the start still waited for one", silent);
    else
        snprintf(reason, REASON_ROOM, "no row has a value of a sensor that is in use once the alarms are on");
    return 1;
}

/* Whether there was a detection in this run, or stood open at its beginning; else whether it could judge. */
static int verdict_of(const Course *course, int64_t samples)
{
    char reason[REASON_ROOM];
    const int is_found = course->found.detections > course->before.detections && !is_disordered(course);
    if (is_found || course->before.is_open) return VERDICT_FAULT;
    return no_verdict(course, samples, reason) ? VERDICT_NONE : VERDICT_HEALTHY;
}

#endif
