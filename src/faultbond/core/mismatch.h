/* A model that is off. A parameter that is in no tested set counts as healthy under every hypothesis. Where an alarm was raised
   since such a parameter walked too far, every hypothesis takes it back to where it was and has to explain by its suspects what
   it had been moved for. The best one fits best, but nothing says that it is true: a model that is off fits none. So that
   is a hypothesis of its own. As it may bring about whatever the data are, no likelihood tells it from the others, and its
   probability is that of before. Reasons and figures: docs/decisions/020-walks.md.

   So it is where such a parameter is a suspect, but an input is where no recording of the fit had it, or has been so far: how far a parameter may
   be off is what a fit has learned where it was, and of a law that is a little off elsewhere the healthy filter makes a parameter
   that walks. Nothing tells that from a fault. One that comes at once is none of it.

   So is a model that is known to alarm on healthy data. Of n + 1 alarms, n of them false, this one is taken to be the one that is
   none; which of them it is nobody knows, and so it is one more false one with n / (n + 1). Figures: docs/decisions/034-false-alarms.md.

   So it is where another hypothesis takes the place of one that has been sure for so long that a person may have accepted it, or
   where that did not explain the data any more. A fault does not stop being one: either that was wrong all the time, or something
   else changed besides, later, and no hypothesis is of two things that changed one after the other. Figures:
   docs/decisions/039-one-after-the-other.md.

   So it is where the likeliest hypothesis has to move a parameter far that it leaves healthy, of another part than its suspects: a
   healthy one keeps to its accuracy, or to what else it may change by. Then that changed besides, at another time, or the model is off there. Of what a fault does to
   other parameters of its own part nothing is said. Figures: docs/decisions/045-strained.md.

   And where nothing that is tested changed, but the likeliest lane has such a parameter far from where it is declared: then that is
   what changed, or the model is off there. Of a trusted drive that travels at a third of its rate every lane learns so, in time. */
#ifndef FB_MISMATCH_H
#define FB_MISMATCH_H

#include "ranking.h"
#include "within.h"

FB_SELDOM

#define OFF_FROM_START 0.9 /* probability that the model is off where what counts as healthy is not as declared, */
#define OFF_SINCE 0.5      /* and where it was for a while, and then moved: a fault may move what it is not */
#define OFF_UNFAMILIAR 0.5 /* and where a suspect had to move too far, of a plant that was where the model was never fitted, */
#define OFF_SUPERSEDED 0.5 /* and where another one was sure before */
#define OFF_STRAINED 0.5   /* and where the first candidate moves what it leaves healthy, */
#define STRAINED 4.0       /* by so many accuracies, or healthy changes, since the alarm, and from where it is declared */
#define FAR_OFF 8.0        /* accuracies from where it is declared, of what counts as healthy */
#define MORE_THAN_HALF 0.5

/* Whether a tested set of parameters has this one. */
static int is_in_a_set(int64_t parameter)
{
    for (int k = 0; k < SET_ROW[N_SETS]; k++)
        if (SET_MEMBER[k] == parameter) return 1;
    return 0;
}

/* Probability that the model is off, given how the alarm came, and how many false ones there were before. */
static double probability_off(const State *state, const Diagnosis *found)
{
    const double alarms = (double)FALSE_ALARMS / (FALSE_ALARMS + 1.0);
    const double more = found->n_superseded > 0 ? OFF_SUPERSEDED : found->n_strained > 0 ? OFF_STRAINED : 0.0;
    const double known = fmax(alarms, more);
    if (state->alarm.walker < 0) return known;
    if (is_in_a_set(state->alarm.walker)) return state->alarm.unfamiliar ? fmax(known, OFF_UNFAMILIAR) : known;
    return fmax(known, state->alarm.window == WALKS ? OFF_FROM_START : OFF_SINCE);
}

/* Tell which parameters that are in no tested set are far from where they are declared in the likeliest lane. */
static void find_elsewhere(const State *state, int64_t lane, Diagnosis *found)
{
    for (int j = 0; lane >= 0 && j < N_PARAMETERS; j++) {
        const double off = fabs(number_in(&state->bank, lane, AT_PARAMETERS + j) - HEALTHY[j]);
        if (ACCURACY[j] > 0.0 && off > FAR_OFF * ACCURACY[j] && !is_in_a_set(j)) found->elsewhere[found->n_elsewhere++] = j;
    }
}

/* The part that a suspect is, or is of. */
static int part_of(const Suspect *suspect)
{
    if (suspect->parameter >= 0) return PARAMETER_PART[suspect->parameter];
    return suspect->input >= 0 ? INPUT_PART[suspect->input] : OUTPUT_PART[suspect->output];
}

/* Whether a candidate has a suspect that is a part, or is of it. */
static int has_part(const Candidate *candidate, int64_t part)
{
    for (int64_t k = 0; k < candidate->n_suspects; k++)
        if (part_of(&candidate->suspects[k]) == part) return 1;
    return 0;
}

/* Whether a candidate has all parts that were sure to be at fault. */
static int has_settled(const Candidate *candidate, const Settled *settled)
{
    for (int64_t i = 0; i < settled->n_parts; i++)
        if (!has_part(candidate, settled->parts[i])) return 0;
    return 1;
}

/* Tell which hypothesis was sure for long, and is none of the likeliest any more, nor part of the likeliest; or is over. */
static void find_superseded(const State *state, const Ranking *ranking, Diagnosis *found)
{
    const int64_t before = state->settled.hypothesis, leading = leading_hypothesis(ranking);
    if (before < 0 || leading < 0 || state->bank.rejected[before]) return;
    const int is_likely = ranking->score[before] >= ranking->score[leading] - GROUP_NATS;
    const Missed *missed = &state->bank.missed; /* what led and was far off is over, though it lead again */
    if (!missed->is_noted[before] && (is_likely || has_settled(&found->candidates[0], &state->settled))) return;
    found->n_superseded = state->settled.n_parts;
    memcpy(found->superseded, state->settled.parts, sizeof found->superseded);
    found->superseded_until = missed->is_noted[before] ? missed->since[before] : state->settled.until;
}

/* Tell which parameters the first candidate has to move far though it leaves them healthy, by its likeliest lane. */
static void find_strained(const State *state, int64_t lane, Diagnosis *found)
{
    for (int j = 0; lane >= 0 && j < N_PARAMETERS; j++) {
        const double now = number_in(&state->bank, lane, AT_PARAMETERS + j), before = state->bank.healthy[AT_PARAMETERS + j];
        const double moved = fmin(fabs(now - before), fabs(now - HEALTHY[j]));
        if (!(ACCURACY[j] > 0.0) || !(moved > STRAINED * fmax(ACCURACY[j], HEALTHY_CHANGE[j]))) continue;
        if (has_part(&found->candidates[0], PARAMETER_PART[j])) continue;
        found->strained[found->n_strained++] = j;
    }
}

/* Leave to a model that is off what is its part of a ranking. It tells no tested set from another, so each has an even share. */
static void leave_to_mismatch(const State *state, const Ranking *ranking, Diagnosis *found)
{
    const int64_t leading = leading_hypothesis(ranking), lane = leading >= 0 ? ranking->best[leading] : -1;
    int64_t n_tested = 0;
    if (found->within_accuracy > MORE_THAN_HALF) find_elsewhere(state, lane, found);
    else find_strained(state, lane, found);
    const double off = probability_off(state, found), left = 1.0 - off, within = found->within_accuracy;
    found->mismatch = off + (found->n_elsewhere > 0 ? left * within : 0.0); /* of both each set has an even share already */
    found->within_accuracy = found->n_elsewhere > 0 ? 0.0 : left * within;
    if (!(off > 0.0)) return;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) n_tested += is_tested(ranking, k);
    for (int64_t row = 0; row < found->n_candidates; row++) {
        Candidate *candidate = &found->candidates[row];
        candidate->probability *= left;
        if (is_tested(ranking, candidate->hypothesis)) candidate->probability += off / (double)n_tested;
    }
}

FB_OFTEN

#endif
