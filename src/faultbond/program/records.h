/* The records of a run: lines of JSON for programs, SI units, percent stays percent. What each key means stands in the
   messages' page of the documents of faultbond; names are those of the model, by number, from names.h. */
#ifndef WATCH_RECORDS_H
#define WATCH_RECORDS_H

#include "json.h"
#include "plant.h"
#include "point.h"
#include "presence.h"

#define MOST_REJECTED 64 /* hypotheses that were ruled out since the last alarm and are known by number */

/* What a run has found so far. is_open: nothing was accepted yet for the last alarm, raised at the sample `opened`. accepted,
   rejected: how many hypotheses, the latter since the last alarm; last_accepted, ruled_out: which; is_repaired: whether that
   which was accepted last was the fault and is mended. */
typedef struct {
    int64_t detections, watched, waiting, wild, outside, sensors_outside, is_open, opened, accepted, rejected;
    int64_t last_accepted, is_repaired, ruled_out[MOST_REJECTED];
} Found;

/* Note that a hypothesis was accepted. */
static void note_accepted(Found *found, int64_t hypothesis, int is_repaired)
{
    found->is_open = found->rejected = 0;
    found->accepted++;
    found->last_accepted = hypothesis;
    found->is_repaired = is_repaired;
}

/* Note that nothing was at fault. */
static void note_nothing(Found *found) { found->is_open = found->rejected = 0; }

/* Note that a hypothesis was ruled out. */
static void note_rejected(Found *found, int64_t hypothesis)
{
    if (found->rejected < MOST_REJECTED) found->ruled_out[found->rejected] = hypothesis;
    found->rejected++;
}

/* Whether a hypothesis was ruled out since the last alarm. */
static int is_ruled_out(const Found *found, int64_t hypothesis)
{
    for (int64_t k = 0; k < found->rejected && k < MOST_REJECTED; k++)
        if (found->ruled_out[k] == hypothesis) return 1;
    return 0;
}

static void begin_record(Json *json, const char *kind)
{
    json_open(json, '{');
    json_key(json, "record");
    json_text(json, kind);
}

static void end_record(Json *json)
{
    json_close(json, '}');
    json_end(json);
}

static void tell_real(Json *json, const char *key, double value)
{
    json_key(json, key);
    json_real(json, value);
}

static void tell_whole(Json *json, const char *key, int64_t value)
{
    json_key(json, key);
    json_whole(json, value);
}

static void tell_text(Json *json, const char *key, const char *text)
{
    json_key(json, key);
    json_text(json, text);
}

static void tell_truth(Json *json, const char *key, int64_t is_true)
{
    json_key(json, key);
    json_truth(json, is_true);
}

/* The first record: what is run on what. continues: last time of the run from which this one goes on; nan: of none. */
static void write_run(Json *json, double continues)
{
    begin_record(json, "run");
    tell_text(json, "model", PLANT_NAME);
    tell_text(json, "model_sha256", PLANT_SHA256);
    tell_text(json, "method", METHOD_NAME);
    tell_text(json, "version", FAULTBOND_VERSION);
    tell_real(json, "sample_time", SAMPLE_TIME > 0.0 ? SAMPLE_TIME : NAN);
    json_key(json, "explain_anything");
    json_open(json, '[');
    for (int set = 0; set < N_UNTESTABLE; set++) {
        json_open(json, '[');
        for (int e = UNTESTABLE_ROW[set]; e < UNTESTABLE_ROW[set + 1]; e++)
            json_text(json, PARAMETER_NAMES[UNTESTABLE_PARAMETER[e]]);
        json_close(json, ']');
    }
    json_close(json, ']');
    tell_real(json, "continues", continues);
    end_record(json);
}

/* An alarm; `walk` only where that raised it. */
static void write_detection(Json *json, const PlantAlarm *alarm)
{
    begin_record(json, "detection");
    tell_real(json, "time", alarm->time);
    tell_whole(json, "sample", alarm->sample);
    tell_real(json, "change_time", alarm->change_time);
    json_key(json, "signals");
    json_open(json, '[');
    for (int j = 0; j < N_OUTPUTS; j++)
        if (alarm->crossed[j]) json_text(json, OUTPUT_NAMES[j]);
    json_close(json, ']');
    if (alarm->walker >= 0) {
        json_key(json, "walk");
        json_open(json, '{');
        tell_text(json, "parameter", PARAMETER_NAMES[alarm->walker]);
        tell_real(json, "sd", alarm->walk);
        tell_truth(json, "from_start", alarm->window == WINDOW_FROM_START);
        tell_truth(json, "together", alarm->window > WINDOW_FROM_START);
        json_close(json, '}');
    }
    end_record(json);
}

/* The part that a suspect belongs to. */
static const char *component_of(const Suspect *suspect)
{
    if (suspect->parameter >= 0) return PARAMETER_COMPONENTS[suspect->parameter];
    return suspect->input >= 0 ? INPUT_NAMES[suspect->input] : OUTPUT_NAMES[suspect->output];
}

/* The parts of a candidate, each once. */
static void write_components(Json *json, const Candidate *candidate)
{
    json_open(json, '[');
    for (int64_t k = 0; k < candidate->n_suspects; k++) {
        const char *name = component_of(&candidate->suspects[k]);
        int is_told = 0;
        for (int64_t i = 0; i < k; i++) is_told |= strcmp(component_of(&candidate->suspects[i]), name) == 0;
        if (!is_told) json_text(json, name);
    }
    json_close(json, ']');
}

static void write_forecasts(Json *json, const Suspect *suspect)
{
    json_open(json, '[');
    for (int64_t k = 0; k < suspect->n_forecasts; k++) {
        json_open(json, '{');
        tell_real(json, "limit", suspect->forecasts[k].limit);
        tell_real(json, "time", suspect->forecasts[k].time);
        tell_real(json, "earliest", suspect->forecasts[k].earliest);
        tell_real(json, "latest", suspect->forecasts[k].latest);
        json_close(json, '}');
    }
    json_close(json, ']');
}

/* A suspect with its name; a rate where it drifts, times where it has come to stay, `moved` where it moves,
   `stopped` of an input whose record stands still. */
static void write_suspect(Json *json, const Suspect *suspect)
{
    if (suspect->parameter >= 0) json_key(json, PARAMETER_NAMES[suspect->parameter]);
    else json_key_of_two(json, component_of(suspect), INSTRUMENT_WORDS[suspect->word]);
    json_open(json, '{');
    tell_real(json, "nominal", suspect->nominal);
    tell_real(json, "estimate", suspect->estimate);
    tell_real(json, "sd", suspect->sd);
    if (suspect->moved != 0.0) tell_real(json, "moved", suspect->moved);
    if (!isnan(suspect->began)) {
        tell_real(json, "began", suspect->began);
        tell_real(json, "ended", suspect->ended);
    }
    if (!isnan(suspect->stopped)) tell_real(json, "stopped", suspect->stopped);
    if (!isnan(suspect->rate)) {
        tell_real(json, "rate", suspect->rate);
        tell_real(json, "rate_sd", suspect->rate_sd);
        json_key(json, "forecasts");
        write_forecasts(json, suspect);
    }
    json_close(json, '}');
}

static void tell_components(Json *json, const Candidate *candidate)
{
    json_key(json, "components");
    write_components(json, candidate);
    json_key(json, "parameters");
    json_open(json, '{');
    for (int64_t k = 0; k < candidate->n_suspects; k++) write_suspect(json, &candidate->suspects[k]);
    json_close(json, '}');
    tell_real(json, "probability", candidate->probability);
}

static void tell_kind(Json *json, const Candidate *candidate)
{
    json_key(json, "kind");
    if (candidate->n_kinds > 0) json_text(json, KIND_WORDS[candidate->kinds[0]]);
    else json_none(json);
}

static void write_candidate(Json *json, const Candidate *candidate)
{
    json_open(json, '{');
    tell_components(json, candidate);
    tell_truth(json, "group", candidate->group);
    tell_kind(json, candidate);
    json_key(json, "kinds");
    json_open(json, '{');
    for (int64_t k = 0; k < candidate->n_kinds; k++) tell_real(json, KIND_WORDS[candidate->kinds[k]], candidate->shares[k]);
    json_close(json, '}');
    tell_truth(json, "present", candidate->present);
    json_close(json, '}');
}

static const char *target_of(const Check *check)
{
    if (check->kind == CHECK_INPUT) return INPUT_NAMES[check->target];
    return check->kind == CHECK_SIGNAL ? SIGNAL_NAMES[check->target] : PART_NAMES[check->target];
}

/* Something to check; groups are of the first candidates. */
static void write_check(Json *json, const Check *check, int64_t n_rivals, const Candidate *candidates)
{
    json_open(json, '{');
    tell_text(json, "check", CHECK_WORDS[check->kind]);
    tell_text(json, "target", target_of(check));
    tell_real(json, "gain", check->gain);
    tell_real(json, "cost", check->cost);
    tell_real(json, "value", check->value);
    tell_real(json, "within", check->within);
    json_key(json, "separates");
    json_open(json, '[');
    for (int64_t group = 0; group < check->n_groups; group++) {
        json_open(json, '[');
        for (int64_t r = 0; r < n_rivals; r++)
            if (check->group[r] == group) write_components(json, &candidates[r]);
        json_close(json, ']');
    }
    json_close(json, ']');
    json_close(json, '}');
}

static void tell_unexplained(Json *json, const Diagnosis *found)
{
    json_key(json, "unexplained");
    if (!found->is_unexplained) {
        json_none(json);
        return;
    }
    json_open(json, '{');
    tell_text(json, "signal", OUTPUT_NAMES[found->signal]);
    tell_real(json, "sd", found->unexplained_sd);
    tell_real(json, "since", found->since);
    tell_real(json, "until", found->until);
    json_close(json, '}');
}

static void tell_untested(Json *json, const Diagnosis *found)
{
    json_key(json, "untested");
    if (!found->has_untested) {
        json_none(json);
        return;
    }
    json_open(json, '{');
    tell_whole(json, "sets", found->untested_sets);
    tell_real(json, "probability", found->untested_probability);
    json_close(json, '}');
}

/* What was sure before, where there is such. */
static void tell_superseded(Json *json, const Diagnosis *found)
{
    if (found->n_superseded == 0) return;
    json_key(json, "superseded");
    json_open(json, '{');
    json_key(json, "components");
    json_open(json, '[');
    for (int64_t k = 0; k < found->n_superseded; k++) json_text(json, PART_NAMES[found->superseded[k]]);
    json_close(json, ']');
    tell_real(json, "until", found->superseded_until);
    json_close(json, '}');
}

/* Names of parameters, where there are some. */
static void tell_parameters(Json *json, const char *key, const int64_t *parameters, int64_t n)
{
    if (n == 0) return;
    json_key(json, key);
    json_open(json, '[');
    for (int64_t k = 0; k < n; k++) json_text(json, PARAMETER_NAMES[parameters[k]]);
    json_close(json, ']');
}

/* A diagnosis, the best candidate first, with what to check next. is_outside: the model does not hold then. */
static void write_diagnosis(Json *json, const Diagnosis *found, const Advice *advice, int is_outside)
{
    begin_record(json, "diagnosis");
    tell_real(json, "time", found->time);
    json_key(json, "candidates");
    json_open(json, '[');
    for (int64_t k = 0; k < found->n_candidates; k++) write_candidate(json, &found->candidates[k]);
    json_close(json, ']');
    tell_unexplained(json, found);
    json_key(json, "advice");
    json_open(json, '[');
    for (int64_t k = 0; k < advice->n_checks; k++) write_check(json, &advice->checks[k], advice->n_rivals, found->candidates);
    json_close(json, ']');
    tell_untested(json, found);
    tell_real(json, "within_accuracy", found->n_candidates > 0 ? found->within_accuracy : NAN);
    tell_real(json, "mismatch", found->mismatch);
    tell_superseded(json, found);
    tell_parameters(json, "elsewhere", found->elsewhere, found->n_elsewhere);
    tell_parameters(json, "strained", found->strained, found->n_strained);
    if (is_outside) tell_truth(json, "outside", 1);
    end_record(json);
}

/* A candidate that was accepted, or rejected, by a `person` or a `rule`. */
static void write_decision(Json *json, const char *kind, double time, const Candidate *candidate, const char *by, int repaired)
{
    const int is_rejected = strcmp(kind, "rejected") == 0;
    begin_record(json, kind);
    tell_real(json, "time", time);
    tell_components(json, candidate);
    tell_kind(json, candidate);
    tell_text(json, "by", by);
    if (!is_rejected) tell_truth(json, "repaired", repaired);
    end_record(json);
}

/* Sensors and inputs that gave no value, hardly any, or none for long. */
static void tell_silent(Json *json, const Presence *presence)
{
    json_key(json, "silent");
    json_open(json, '[');
    for (int k = 0; k < N_HEARD; k++) {
        double since, until;
        if (!is_silent(presence, k)) continue;
        longest_silence(presence, k, &since, &until);
        json_open(json, '{');
        tell_text(json, "name", signal_name(k));
        tell_text(json, "role", signal_role(k));
        tell_whole(json, "values", presence->values[k]);
        tell_real(json, "since", since);
        tell_real(json, "until", until);
        json_close(json, '}');
    }
    json_close(json, ']');
}

/* The last record. time: last grid point; nan: there was none. dropped, presence: of this run alone. */
static void write_end(Json *json, double time, const Counts *counts, const Found *found, int64_t dropped, const Presence *presence)
{
    begin_record(json, "end");
    tell_real(json, "time", time);
    tell_whole(json, "samples", counts->samples);
    tell_whole(json, "watched", found->watched);
    tell_whole(json, "detections", found->detections);
    tell_whole(json, "missing", counts->missing);
    tell_whole(json, "late", counts->late);
    tell_whole(json, "duplicate", counts->duplicate);
    tell_whole(json, "untimed", counts->untimed);
    tell_whole(json, "unused", counts->unused);
    tell_whole(json, "clock_jumps", counts->clock_jumps);
    tell_whole(json, "saturated", counts->saturated);
    tell_whole(json, "frozen", counts->frozen);
    tell_whole(json, "wild", found->wild);
    tell_whole(json, "outside", found->outside);
    tell_whole(json, "sensors_outside", found->sensors_outside);
    tell_whole(json, "dropped", dropped);
    tell_silent(json, presence);
    end_record(json);
}

#endif
