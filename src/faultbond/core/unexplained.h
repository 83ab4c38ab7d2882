/* What nothing explains: the likeliest lane does not fit where the detector would raise an alarm on it.

   What led and was far off does not explain the data later either, though it lead and fit again: its lanes have taken what was missing
   for other values of healthy parameters and for slow errors, or the sums by which they are judged began anew. Either something else
   changed besides, or it is wrong. A true one passes the limit at times, since no model is exact, but not by as much. Figures:
   docs/decisions/039-one-after-the-other.md. */
#ifndef FB_UNEXPLAINED_H
#define FB_UNEXPLAINED_H

#include "ranking.h"

#define FAR_PAST 1.5 /* limits that a sum has passed which counts for good */

FB_SELDOM

/* The lane by which a hypothesis is contradicted: its best one, or, of a wrong gain of an input and a change of the parameter with
   which alone it acts, the best one of the other if that fits better: what the one explains, the other does (`share_gains`). */
static int64_t judged_lane(const Bank *bank, const Ranking *ranking, int64_t hypothesis)
{
    const int64_t own = ranking->best[hypothesis];
    int side, signal;
    for (int input = 0; input < N_INPUTS; input++) {
        int64_t set, instrument;
        if (!are_interchangeable(bank, OUT_REJECTED, input, &set, &instrument) || (hypothesis != set && hypothesis != instrument)) continue;
        if (ranking->leading[instrument] != KIND_GAIN || ranking->leading[set] == KIND_INTERMITTENT) continue;
        const int64_t other = ranking->best[hypothesis == set ? instrument : set];
        if (other < 0) return own;
        return largest_sum(bank, other, &side, &signal) < largest_sum(bank, own, &side, &signal) ? other : own;
    }
    return own;
}

/* Tell where the best lane does not fit; without candidates there is none. Not of an input by itself whose record has stopped: what acts
   is not known, so that nothing speaks against it. */
static void find_unexplained(const State *state, int64_t lane, Diagnosis *found)
{
    const Bank *bank = &state->bank;
    int side, signal;
    if (found->n_candidates == 0 || has_stopped(&found->candidates[0])) return;
    const double sum = largest_sum(bank, lane, &side, &signal);
    if (sum <= CUSUM_LIMIT) return;
    const int64_t length = state->clock.index - (int64_t)bank->since[side][signal][lane];
    const int64_t back = length < DEPTH - 1 ? length : DEPTH - 1;
    found->is_unexplained = 1;
    found->signal = signal;
    found->unexplained_sd = sum / (double)(length > 1 ? length : 1) + CUSUM_DRIFT;
    found->since = back > 0 ? state->past.rows[(state->clock.index - back) % N_ROWS].time : state->clock.time;
    found->until = state->clock.time;
}

/* Note what the leading hypothesis does not explain now, if that is much. */
static void note_missed(const Ranking *ranking, const Diagnosis *found, Bank *bank)
{
    Missed *missed = &bank->missed;
    int side, signal;
    if (!found->is_unexplained || found->until < found->time) return;
    const int64_t leading = found->candidates[0].hypothesis;
    if (!(largest_sum(bank, judged_lane(bank, ranking, leading), &side, &signal) > FAR_PAST * CUSUM_LIMIT)) return;
    if (!missed->is_noted[leading]) missed->since[leading] = found->since;
    missed->is_noted[leading] = 1;
    missed->signal[leading] = found->signal;
    missed->sd[leading] = found->unexplained_sd;
    missed->until[leading] = found->until;
}

/* Tell what the leading hypothesis did not explain before, where it explains what is read now. What is superseded says so itself. */
static void recall_missed(const Missed *missed, Diagnosis *found)
{
    if (found->n_candidates == 0 || found->is_unexplained || found->n_superseded > 0) return;
    const int64_t leading = found->candidates[0].hypothesis;
    if (!missed->is_noted[leading]) return;
    found->is_unexplained = 1;
    found->signal = missed->signal[leading];
    found->unexplained_sd = missed->sd[leading];
    found->since = missed->since[leading];
    found->until = missed->until[leading];
}

FB_OFTEN

#endif
