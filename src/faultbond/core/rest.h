/* Lanes that cannot win any more rest: a group of which each lane is far behind the leading one, once no lane begins again. It
   keeps its distance from then on. What rests goes on where a person rules a hypothesis out.

   A sensor or an input that sticks does not lead here: while nothing moves it explains whatever is quiet, far better than any
   other lane, and once the plant moves it is out; what rested by then would not come back. */
#ifndef FB_REST_H
#define FB_REST_H

#include "work.h"

FB_SELDOM

#define TO_REST 100.0 /* nats by which all lanes of a group are less likely than the leading one */

/* Log-likelihood of a lane of the bank, of steps, then with a slot, then of couples; LOWEST where none has begun there, or it is
   no number. */
static double likelihood_in(const Bank *bank, int64_t lane)
{
    const int64_t slot = lane - N_STEPS, couple = slot - N_SLOT_LANES, grown = lane - N_PLANNED;
    if (slot < 0) return grown >= 0 && bank->grown[grown / PER_SET] < 0 ? LOWEST : finite_or_lowest(of_step(bank, lane, PLAIN_LIKELIHOOD));
    return couple >= 0 && bank->base[couple] < 0 ? LOWEST : finite_or_lowest(of_slot(bank, slot, WIDE_LIKELIHOOD));
}

/* The likeliest lane of the bank; -1: none has a likelihood. */
static int64_t leader_of(const Bank *bank)
{
    double most = LOWEST;
    int64_t leader = -1;
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        const double likelihood = likelihood_in(bank, lane);
        if (!(likelihood > most)) continue;
        most = likelihood;
        leader = lane;
    }
    return leader;
}

/* Log-likelihood of the likeliest of some lanes with a slot; `leading`: without those whose sensor sticks. */
static double most_of_slots(const Bank *bank, int64_t first, int64_t end, int leading)
{
    double most = LOWEST;
    for (int64_t lane = first; lane < end; lane++)
        if (!leading || !SLOT_STICKS[plan_of(bank, lane)]) most = fmax(most, likelihood_in(bank, N_STEPS + lane));
    return most;
}

/* The same of a group that may rest; groups of steps come first, then those of slots, then those of couples. */
static double most_of_group(Bank *bank, int64_t group, int leading)
{
    double most = LOWEST;
    const int64_t slots = group - BLOCKS(N_STEPS), couples = group - FIRST_COUPLES;
    const int64_t first = (slots < 0 ? group : couples < 0 ? slots : couples) * GROUP;
    const int64_t all = slots < 0 ? N_STEPS : couples < 0 ? SWITCHED : N_COUPLE_LANES;
    const int64_t end = first + GROUP < all ? first + GROUP : all, before = couples < 0 ? 0 : N_SLOT_LANES;
    if (slots >= 0) return most_of_slots(bank, before + first, before + end, leading);
    for (int64_t lane = first; lane < end; lane++) most = fmax(most, likelihood_in(bank, lane));
    return most;
}

/* Log-likelihood of the likeliest lane that goes on. */
static double leading_of_bank(Bank *bank)
{
    double most = LOWEST;
    for (int64_t group = 0; group < N_RESTING; group++)
        if (!bank->rests[group]) most = fmax(most, most_of_group(bank, group, 1));
    return fmax(most, most_of_slots(bank, SWITCHED, N_SLOT_LANES, 1));
}

/* Put groups to rest that are far behind. */
static void put_to_rest(Bank *bank)
{
    const double least = leading_of_bank(bank) - TO_REST;
    for (int64_t group = 0; group < N_RESTING; group++)
        if (most_of_group(bank, group, 0) < least) bank->rests[group] = 1;
}

/* Let lanes that rest keep their distance where the leading one has moved on. */
static void keep_distance(Bank *bank, double moved)
{
    for (int64_t group = 0; group < N_RESTING; group++) {
        const int64_t slots = group - BLOCKS(N_STEPS), couples = group - FIRST_COUPLES;
        double *of = slots < 0 ? bank->steps[group][PLAIN_LIKELIHOOD]
                   : couples < 0 ? bank->slots[slots][WIDE_LIKELIHOOD] : bank->couples[couples][WIDE_LIKELIHOOD];
        for (int64_t l = 0; l < GROUP && bank->rests[group]; l++)
            if (slots < 0 || couples >= 0 || slots * GROUP + l < SWITCHED) of[l] += moved;
    }
}

/* Let all lanes go on. */
static void wake(Bank *bank) { memset(bank->rests, 0, sizeof bank->rests); }

FB_OFTEN

#endif
