/* The diagnosis: ranked candidates, whether any explains the data, and what is not tested. */
#ifndef FB_DIAGNOSIS_H
#define FB_DIAGNOSIS_H

#include "further.h"
#include "mismatch.h"
#include "unexplained.h"
#include "untested.h"
#include "within.h"

FB_SELDOM

/* Memory of `conclude`. */
typedef struct {
    Ranking ranking;
    Hidden hidden;
    double wide[WIDE_NUMBERS], plain[PLAIN_NUMBERS], left[PLAIN_NUMBERS]; /* a lane that is accepted */
} RankingMemory;

#define FRESH 30       /* samples for which sums that began anew tell nothing; twice as many where the lanes had just begun */

/* Whether the bank began, or began again, just now. */
static int is_fresh(const State *state)
{
    const Job *job = &state->job;
    return !is_ready(job) || state->clock.index - job->settled <= (job->renewals < 2 ? 2 * FRESH : FRESH);
}

/* Give the diagnosis of now, after a detection; without candidates where there was none, where nothing is a suspect, or where
   not all lanes have begun. */
static void conclude(const State *state, Diagnosis *found, RankingMemory *memory)
{
    Ranking *ranking = &memory->ranking;
    memset(found, 0, sizeof *found);
    found->time = state->clock.time;
    found->signal = -1;
    found->unexplained_sd = found->since = found->until = found->untested_probability = found->superseded_until = NAN;
    if (N_HYPOTHESES == 0 || state->clock.alarm < 0 || state->job.kind == BEGINNING) return;
    score_all(state, OUT_REJECTED, ranking);
    allow_for_model(state, ranking);
    leave_out_small(state, ranking);
    rank(state, ranking, found);
    find_superseded(state, ranking, found);
    leave_to_mismatch(state, ranking, found);
    find_unexplained(state, judged_lane(&state->bank, ranking, leading_hypothesis(ranking)), found);
    recall_missed(&state->bank.missed, found);
    const int bounded = !found->is_unexplained && !is_fresh(state);
    find_untested(&state->bank, ranking, state->clock.index, bounded, &memory->hidden, found);
}

FB_OFTEN

#endif
