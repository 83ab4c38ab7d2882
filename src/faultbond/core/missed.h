/* What led and did not explain the data for a while does not explain them later either, though it lead and fit again: its lanes have taken
   what was missing for other values of healthy parameters and for slow errors, or the sums by which they are judged began anew. Either
   something else changed besides, or it is wrong. Figures: docs/decisions/039-one-after-the-other.md. */
#ifndef FB_MISSED_H
#define FB_MISSED_H

#include "state.h"

#define MISSED_SAMPLES 100 /* for which a hypothesis led and did not explain the data, until that counts for good */

static void forget_missed(Missed *missed) { memset(missed, 0, sizeof *missed); }

/* Take the diagnosis of now, after which `judged` samples since the alarm have been judged. */
static void note_missed(Missed *missed, const Diagnosis *found, int64_t judged)
{
    const int64_t passed = judged - missed->judged;
    missed->judged = judged;
    if (passed <= 0 || !found->is_unexplained || found->until < found->time) return;
    const int64_t leading = found->candidates[0].hypothesis;
    if (missed->samples[leading] == 0) missed->since[leading] = found->since;
    missed->samples[leading] += passed;
    missed->signal[leading] = found->signal;
    missed->sd[leading] = found->unexplained_sd;
    missed->until[leading] = found->until;
}

/* Tell what the leading hypothesis did not explain before, where it explains what is read now. */
static void recall_missed(const Missed *missed, Diagnosis *found)
{
    if (found->n_candidates == 0 || found->is_unexplained) return;
    const int64_t leading = found->candidates[0].hypothesis;
    if (missed->samples[leading] < MISSED_SAMPLES) return;
    found->is_unexplained = 1;
    found->signal = missed->signal[leading];
    found->unexplained_sd = missed->sd[leading];
    found->since = missed->since[leading];
    found->until = missed->until[leading];
}

#endif
