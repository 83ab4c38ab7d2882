/* Further suspects: what one says beside others counts for sure only beyond what a model may be off by.

   A model leaves something out, and what it leaves out looks like one more fault beside the one that is there: friction, at a
   table that stands still, for a curve. That is bought by a few hundredths of a nat at each sample, which add up. A model that is off by
   OFF_AT_EACH sd of an innovation at each of n samples is worth allowed = n OFF_AT_EACH^2 / 2 nats to whatever makes up for it. So the
   best part of a set, by itself, is as likely as the set, but for LEFT_OF_IT, where the set says no more than that; where it
   does, the part lags by what is more. Other parts keep their distance from the best one. The set stays ahead, and is sure
   where a model's errors cannot be all there is to it. Figures: docs/decisions/042-further-suspects.md. */
#ifndef FB_FURTHER_H
#define FB_FURTHER_H

#include "ranking.h"

#define OFF_AT_EACH 0.3 /* sd of an innovation by which a model may be off at each sample */
#define LEFT_OF_IT 1.5  /* nats by which a set is likelier than a part of it that may be all there is */
#define FAR_BEHIND 25.0 /* nats behind the best from which on what a set says of its parts changes nothing */

FB_SELDOM

/* How many suspects a hypothesis has. */
static int n_suspects_of(int64_t hypothesis)
{
    const int *members;
    return members_of(hypothesis, &members) + (instrument_of(hypothesis) >= 0) + (second_instrument_of(hypothesis) >= 0);
}

/* The hypotheses that are part of a set, and how many. */
static int parts_of(int64_t set, int64_t *parts)
{
    const int size = n_suspects_of(set);
    int n = 0;
    for (int64_t k = 0; size > 1 && k < N_HYPOTHESES; k++)
        if (n_suspects_of(k) < size && has_all_of(set, k)) parts[n++] = k;
    return n;
}

/* Raise the parts of likely sets to where what a model may be off by leaves them. */
static void allow_for_model(const State *state, Ranking *ranking)
{
    const double allowed = 0.5 * OFF_AT_EACH * OFF_AT_EACH * (double)since_alarm(state) * ranking->share;
    const double least = ranking->score[leading_hypothesis(ranking)] - FAR_BEHIND;
    double *raised = ranking->shared;
    int64_t parts[1 << LARGEST_SET];
    memcpy(raised, ranking->score, sizeof ranking->score);
    for (int64_t set = 0; set < N_HYPOTHESES; set++) {
        const int n = ranking->score[set] > least ? parts_of(set, parts) : 0;
        double most = -INFINITY;
        for (int i = 0; i < n; i++) most = larger(most, ranking->score[parts[i]]);
        const double gained = smaller(ranking->score[set] - LEFT_OF_IT - most, allowed);
        for (int i = 0; i < n && gained > 0.0; i++)
            raised[parts[i]] = larger(raised[parts[i]], ranking->score[parts[i]] + gained);
    }
    memcpy(ranking->score, raised, sizeof ranking->score);
}

FB_OFTEN

#endif
