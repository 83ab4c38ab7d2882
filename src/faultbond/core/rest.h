/* Lanes that cannot win any more rest: a group of which each lane is far behind the leading one, once no lane begins again. It
   keeps its distance from then on. What rests goes on where a person rules a hypothesis out. */
#ifndef FB_REST_H
#define FB_REST_H

#include "work.h"

#define TO_REST 100.0 /* nats by which all lanes of a group are less likely than the leading one */

/* Log-likelihood of the likeliest lane of a group of couples. */
static double most_of_couples(Bank *bank, int64_t group)
{
    double most = LOWEST;
    for (int64_t lane = group * GROUP; lane < N_COUPLE_LANES && lane < (group + 1) * GROUP; lane++)
        if (bank->base[lane] >= 0) most = fmax(most, finite_or_lowest(of_slot(bank, N_SLOT_LANES + lane, WIDE_LIKELIHOOD)));
    return most;
}

/* Log-likelihood of the likeliest lane of a group that goes on; groups of steps come first, then those of slots, then those of
   couples. */
static double most_of_group(Bank *bank, int64_t group)
{
    double most = LOWEST;
    if (group >= FIRST_COUPLES) return most_of_couples(bank, group - FIRST_COUPLES);
    const int64_t slots = group - BLOCKS(N_STEPS), first = (slots < 0 ? group : slots) * GROUP;
    const int64_t end = slots < 0 ? N_STEPS : SWITCHED;
    for (int64_t lane = first; lane < first + GROUP && lane < end; lane++) {
        if (slots < 0 && lane >= N_PLANNED && bank->grown[(lane - N_PLANNED) / PER_SET] < 0) continue;
        most = fmax(most, slots < 0 ? likelihood_of(bank, lane) : finite_or_lowest(*number_of_slot(bank, lane, WIDE_LIKELIHOOD)));
    }
    return most;
}

/* Log-likelihood of the likeliest lane that goes on. */
static double leading_of_bank(Bank *bank)
{
    double most = LOWEST;
    for (int64_t group = 0; group < N_RESTING; group++)
        if (!bank->rests[group]) most = fmax(most, most_of_group(bank, group));
    for (int64_t lane = SWITCHED; lane < N_SLOT_LANES; lane++)
        most = fmax(most, finite_or_lowest(*number_of_slot(bank, lane, WIDE_LIKELIHOOD)));
    return most;
}

/* Put groups to rest that are far behind. */
static void put_to_rest(Bank *bank)
{
    const double least = leading_of_bank(bank) - TO_REST;
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

/* Let all lanes go on. */
static void wake(Bank *bank) { memset(bank->rests, 0, sizeof bank->rests); }

#endif
