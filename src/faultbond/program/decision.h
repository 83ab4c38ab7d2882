/* What a person makes of the candidates of a kept run: one becomes the new healthy model, or is mended, or is ruled out. The
   file is read, the core decides, and the file is written; a run goes on from it. One that keeps itself in that file heeds it at
   its next rows. */
#ifndef WATCH_DECISION_H
#define WATCH_DECISION_H

#include "keep.h"
#include "likeness.h"

#define MOST_NAMES 32 /* that a person gives */
#define LISTED 24     /* names in a message */
#define MOST_KNOWN 4096 /* names of the model that are looked at */
#define COUNT_OF(table) (sizeof table / sizeof *table)

enum { DECIDE_NOTHING, DECIDE_ACCEPT, DECIDE_REPAIRED, DECIDE_REJECT };

/* What a person decides of a candidate. names: of its parts, or its parameters; none: the best one. */
typedef struct {
    int what, n_names;
    const char *names[MOST_NAMES];
} Decision;

/* What a suspect is called: a parameter by its name, what is wrong with a sensor or input by that of the instrument. */
static const char *called_of(const Suspect *suspect)
{
    return suspect->parameter >= 0 ? PARAMETER_NAMES[suspect->parameter] : component_of(suspect);
}

typedef const char *(*Naming)(const Suspect *suspect);

/* Whether the names that a person gave are those of the suspects, in any order, each of them. */
static int are_names(const Decision *decision, const Candidate *candidate, Naming naming)
{
    int all = 1;
    for (int k = 0; k < decision->n_names; k++) {
        int is_there = 0;
        for (int64_t i = 0; i < candidate->n_suspects; i++)
            is_there |= strcmp(decision->names[k], naming(&candidate->suspects[i])) == 0;
        all &= is_there;
    }
    for (int64_t i = 0; i < candidate->n_suspects; i++) {
        int is_there = 0;
        for (int k = 0; k < decision->n_names; k++)
            is_there |= strcmp(decision->names[k], naming(&candidate->suspects[i])) == 0;
        all &= is_there;
    }
    return all;
}

/* The names that a suspect may be called by, each once. */
typedef struct {
    const char *names[MOST_KNOWN];
    int n;
} Known;

static void add_known(Known *known, const char *name)
{
    if (*name != '\0' && known->n < MOST_KNOWN && !is_among(name, known->names, known->n)) known->names[known->n++] = name;
}

static void add_all_known(Known *known)
{
    known->n = 0;
    for (size_t k = 0; k < COUNT_OF(PARAMETER_NAMES); k++) {
        add_known(known, PARAMETER_COMPONENTS[k]);
        add_known(known, PARAMETER_NAMES[k]);
    }
    for (size_t k = 0; k < COUNT_OF(OUTPUT_NAMES); k++) add_known(known, OUTPUT_NAMES[k]);
    for (size_t k = 0; k < COUNT_OF(INPUT_NAMES); k++) add_known(known, INPUT_NAMES[k]);
}

/* Say which names are nobody's, and which are meant, or which there are; 0 where all are somebody's. */
static int tell_strange(const Decision *decision)
{
    static Known known;
    const char *alike[MOST_NAMES];
    int n_strange = 0, n_alike = 0;
    add_all_known(&known);
    for (int k = 0; k < decision->n_names; k++) {
        const char *const name = decision->names[k];
        if (is_among(name, known.names, known.n)) continue;
        fprintf(stderr, "%s%s", n_strange++ ? ", " : "", name);
        const char *const meant = most_alike(name, known.names, known.n);
        if (meant != NULL) alike[n_alike++] = meant;
    }
    if (!n_strange) return 0;
    fprintf(stderr, ": nothing that is suspected is called so. %s ", n_alike ? "Did you mean" : "There are");
    for (int k = 0; k < n_alike; k++) fprintf(stderr, "%s%s", k ? " and " : "", alike[k]);
    if (n_alike) return fprintf(stderr, "?\n"), 1;
    for (int k = 0; k < known.n && k < LISTED; k++) fprintf(stderr, "%s%s", k ? ", " : "", known.names[k]);
    if (known.n > LISTED) fprintf(stderr, " and %d more", known.n - LISTED);
    return fprintf(stderr, ".\n"), 1;
}

/* Find the candidate that is meant; its hypothesis, or -1 after a line on standard error that says why there is none. */
static int64_t chosen_of(const Decision *decision, const Diagnosis *found)
{
    int64_t chosen = -1;
    int many = 0;
    for (int64_t k = 0; k < found->n_candidates; k++) {
        const Candidate *candidate = &found->candidates[k];
        const int is_meant = are_names(decision, candidate, component_of) || are_names(decision, candidate, called_of);
        if (decision->n_names > 0 && !is_meant) continue;
        if (decision->n_names == 0 && k > 0) break;
        chosen = candidate->hypothesis;
        many++;
    }
    if (many == 1) return chosen;
    if (!many && tell_strange(decision)) return -1;
    for (int k = 0; k < decision->n_names; k++) fprintf(stderr, "%s%s", k ? ", " : "", decision->names[k]);
    if (many > 1) {
        fprintf(stderr, ": several candidates have these components. Name their parameters instead.\n");
        return -1;
    }
    fprintf(stderr, ": no candidate has just these components. Name those of one candidate of the diagnosis.\n");
    return -1;
}

/* Say why the core refused, by what it gave; exit code. */
static int refused_decision(int64_t why)
{
    static const char *const reasons[] = {
        "not among the candidates that are listed.",
        "rejected already, alone or with a set that it contains.",
        "the last hypothesis cannot be rejected, and all that are left contain this.",
    };
    const char *no_alarm = "There is no alarm to explain, so nothing to accept or reject.";
    fprintf(stderr, "%s\n", why <= -3 && why >= -5 ? reasons[-3 - why] : no_alarm);
    return 2;
}

/* Let the core decide; 0, or why it refused. */
static int64_t call_core(int what, const PlantMemory *memory, int64_t hypothesis, Candidate *candidate)
{
    if (what == DECIDE_REJECT) return fb_reject(memory->state, memory->work, hypothesis, candidate);
    if (what == DECIDE_REPAIRED) return fb_repair(memory->state, memory->work, hypothesis, candidate);
    return fb_accept(memory->state, memory->work, hypothesis, candidate);
}

/* Decide of a kept run, write what was decided as a record, and after a candidate is ruled out the diagnosis that is left;
   exit code. course: memory. */
static int decide(Keeper *keeper, const Decision *decision, Course *course, const Found *found)
{
    static GridClock clock;
    const PlantMemory *memory = &course->plant->memory;
    Diagnosis *diagnosis = &course->diagnosis;
    const int is_rejected = decision->what == DECIDE_REJECT;
    course->found = *found;
    if (!plant_has_alarm(course->plant)) return refused_decision(-1);
    fb_diagnosis(memory->state, memory->work, diagnosis);
    if (diagnosis->n_candidates == 0) return refused_decision(-1);
    const int64_t hypothesis = chosen_of(decision, diagnosis);
    if (hypothesis < 0) return 2;
    const int64_t refused = call_core(decision->what, memory, hypothesis, &course->candidate);
    if (refused) return refused_decision(refused);
    if (is_rejected) note_rejected(&course->found, hypothesis);
    else note_accepted(&course->found, hypothesis, decision->what == DECIDE_REPAIRED);
    clock = keeper->clock;
    keep_run(keeper, &clock, course, 1);
    if (keeper->is_failing) return 2;
    write_decision(course->json, is_rejected ? "rejected" : "accepted", diagnosis->time, &course->candidate, "person",
                   decision->what == DECIDE_REPAIRED);
    if (!is_rejected) return 0;
    fb_diagnosis(memory->state, memory->work, diagnosis);
    fb_advice(memory->state, memory->work, diagnosis, &course->advice);
    write_diagnosis(course->json, diagnosis, &course->advice, 0);
    return 0;
}

#endif
