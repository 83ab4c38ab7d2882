/* Lanes that cannot win any more rest: a group of which each lane is far behind the leading one, once no lane begins again. It
   keeps its distance from then on. What rests goes on where a person rules a hypothesis out, and where the leading lane does not
   explain the data any more: then nobody knows what the others would say. An accumulator had lost a third of its pressure, as a ramp, and then the load
   grew: the same as a drift, which rested, was a hundred nats behind whatever led, and that was likely by itself to less.

   A sensor or an input that sticks does not lead here: while nothing moves it explains whatever is quiet, far better than any
   other lane, and once the plant moves it is out; what rested by then would not come back. */
#ifndef FB_REST_H
#define FB_REST_H

#include "work.h"

FB_SELDOM

#define TO_REST 100.0 /* nats by which all lanes of a group are less likely than the leading one */

/* Log-likelihood of a lane of the bank, of steps, then with a slot, then of couples; LOWEST of none, where none has begun there, or it
   is no number. */
static double likelihood_in(const Bank *bank, int64_t lane)
{
    const int64_t slot = lane - N_STEPS, couple = slot - N_SLOT_LANES, grown = lane - N_PLANNED;
    if (lane < 0) return LOWEST;
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

/* Log-likelihood of the likeliest lane of a group that may rest; groups of steps come first, then those of slots, then those of
   couples. */
static double most_of_group(const Bank *bank, int64_t group)
{
    double most = LOWEST;
    const int64_t slots = group - BLOCKS(N_STEPS), couples = group - FIRST_COUPLES;
    const int64_t first = (slots < 0 ? group : couples < 0 ? slots : couples) * GROUP;
    const int64_t all = slots < 0 ? N_STEPS : couples < 0 ? SWITCHED : N_COUPLE_LANES;
    const int64_t end = first + GROUP < all ? first + GROUP : all, before = slots < 0 ? 0 : couples < 0 ? N_STEPS : N_STEPS + N_SLOT_LANES;
    for (int64_t lane = first; lane < end; lane++) most = fmax(most, likelihood_in(bank, before + lane));
    return most;
}

/* The group of a lane, among those that may rest, or -1. */
static int64_t resting_group(int64_t lane)
{
    const int64_t slot = lane - N_STEPS, couple = slot - N_SLOT_LANES;
    if (slot < 0) return lane / GROUP;
    if (couple >= 0) return FIRST_COUPLES + couple / GROUP;
    return slot < SWITCHED ? BLOCKS(N_STEPS) + slot / GROUP : -1;
}

/* Whether a lane rests. */
static int does_rest(const Bank *bank, int64_t lane) { return resting_group(lane) >= 0 && bank->rests[resting_group(lane)]; }

/* The likeliest lane that goes on, or -1. */
static int64_t leading_of_bank(const Bank *bank)
{
    double most = LOWEST;
    int64_t leading = -1;
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        if (does_rest(bank, lane) || (lane >= N_STEPS && SLOT_STICKS[plan_of(bank, lane - N_STEPS)])) continue;
        if (!(likelihood_in(bank, lane) > most)) continue;
        most = likelihood_in(bank, lane);
        leading = lane;
    }
    return leading;
}

/* Whether a lane of the bank does not explain the data. */
static int is_contradicted(const Bank *bank, int64_t lane)
{
    int side, signal;
    return lane >= 0 && largest_sum(bank, lane, &side, &signal) > CUSUM_LIMIT;
}

/* Put groups to rest that are far behind. */
static void put_to_rest(Bank *bank)
{
    const int64_t leading = leading_of_bank(bank);
    if (leading < 0 || is_contradicted(bank, leading)) return;
    const double least = likelihood_in(bank, leading) - TO_REST;
    for (int64_t group = 0; group < N_RESTING; group++)
        if (most_of_group(bank, group) < least) bank->rests[group] = 1;
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

/* Let all lanes go on after a sample. */
static void wake(Bank *bank, int64_t index)
{
    for (int64_t lane = 0; lane < N_LANES; lane++)
        if (does_rest(bank, lane)) begin_misfit_again(bank, lane, index);
    memset(bank->rests, 0, sizeof bank->rests);
}

FB_OFTEN

#endif
