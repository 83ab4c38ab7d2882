/* The rule that accepts a diagnosis without a person: the same candidate has been sure for long enough.

   Sure is a candidate whose set and kind of fault are, together. Where the kind stays open, as between a bias and a drift
   that hardly moves, waiting longer does not help, and the next fault would be laid to the first; so a candidate whose set
   alone has been sure for much longer is accepted too, with its likeliest kind. Formulas: docs/method.md, "The bank". */
#ifndef FB_RULE_H
#define FB_RULE_H

#include "diagnosis.h"

#define SURE_SAMPLES 200 /* for which a candidate has been the sure one before it is accepted, */
#define LONG_SAMPLES 600 /* and a set, before it is although its kind is not sure */

#define SETTLED 0.9         /* probability from which a hypothesis is kept in mind, a person may have accepted it, */
#define SETTLED_SAMPLES 100 /* once it has had that for so long */

/* Nothing is sure, as before the first diagnosis and after each decision. */
static void forget_sure(Sure *sure) { sure->hypothesis = sure->since = sure->clear_since = -1; }

static void forget_settled(Settled *settled)
{
    forget_sure(&settled->now);
    settled->hypothesis = settled->harmless_since = -1;
    settled->n_parts = 0;
    settled->until = 0.0;
}

/* Samples that were not judged do not count. */
static void put_off(Sure *sure)
{
    if (sure->since >= 0) sure->since++;
    if (sure->clear_since >= 0) sure->clear_since++;
}

static void put_off_settling(Settled *settled)
{
    put_off(&settled->now);
    if (settled->harmless_since >= 0) settled->harmless_since++;
}

/* Whether the best candidate is likely enough, alone in its group, and explains the data with a model that holds; `whole`: with
   its kind. What acts of an input whose record has stopped is not known, so that is nothing to be corrected by. */
static int is_sure(const Diagnosis *found, double level, int whole)
{
    const Candidate *best = &found->candidates[0];
    int64_t alike = 0;
    for (int64_t k = 0; k < found->n_candidates; k++) alike += found->candidates[k].group;
    const double share = whole && best->n_kinds > 0 ? best->shares[0] : 1.0;
    return alike == 1 && best->probability * share >= level && !found->is_unexplained && !has_stopped(best) && !(found->mismatch > 0.0);
}

/* Take the diagnosis of a sample; `level`: probability from which a candidate is sure. Gives the hypothesis that is to be
   accepted now; -1: none yet. */
static int64_t take_diagnosis(Sure *sure, const Diagnosis *found, int64_t sample, double level)
{
    const Sure before = *sure;
    forget_sure(sure);
    if (!is_sure(found, level, 0)) return -1;
    const int64_t best = found->candidates[0].hypothesis;
    const int same = best == before.hypothesis, clear = is_sure(found, level, 1);
    sure->hypothesis = best;
    sure->since = same ? before.since : sample;
    if (clear) sure->clear_since = same && before.clear_since >= 0 ? before.clear_since : sample;
    const int ripe = (clear && sample - sure->clear_since >= SURE_SAMPLES) || sample - sure->since >= LONG_SAMPLES;
    return ripe ? best : -1;
}

/* Note the parts that are at fault by a candidate, each once. */
static void note_parts(const Candidate *candidate, Settled *settled)
{
    settled->n_parts = 0;
    for (int64_t k = 0; k < candidate->n_suspects; k++) {
        const int64_t part = part_of(&candidate->suspects[k]);
        int is_new = 1;
        for (int64_t i = 0; i < settled->n_parts; i++) is_new &= settled->parts[i] != part;
        if (is_new) settled->parts[settled->n_parts++] = part;
    }
}

/* Probability that nothing is at fault, if the alarm is no further one of a model that is known to alarm on healthy data. */
static double within_if_called_for(const Diagnosis *found)
{
    const double alarms = (double)FALSE_ALARMS / (FALSE_ALARMS + 1.0);
    return found->mismatch > alarms ? found->within_accuracy : found->within_accuracy / (1.0 - alarms);
}

/* Take the diagnosis of a sample, so that what is sure now is known later. What counts is the set: nothing is corrected, so its kind
   may stay open. */
static void settle_on(Settled *settled, const Diagnosis *found, int64_t sample)
{
    take_diagnosis(&settled->now, found, sample, SETTLED);
    if (settled->now.hypothesis >= 0 && sample - settled->now.since >= SETTLED_SAMPLES) {
        settled->hypothesis = settled->now.hypothesis;
        note_parts(&found->candidates[0], settled);
    }
    if (found->n_candidates > 0 && found->n_superseded == 0) settled->until = found->time;
    const int harmless = within_if_called_for(found) >= SETTLED && !found->is_unexplained && found->n_superseded == 0;
    if (!harmless) settled->harmless_since = -1;
    else if (settled->harmless_since < 0) settled->harmless_since = sample;
}

/* There is no alarm any more. */
static void end_alarm(State *state)
{
    state->clock.alarm = -1;
    clear_bank(state);
    forget_sure(&state->sure);
    forget_settled(&state->settled);
}

#endif
