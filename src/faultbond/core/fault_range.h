/* Values that a fault cannot have. `range` bounds what may be the answer, the scatter of an estimate allowed for: that of the
   lane, and the declared accuracy. A hypothesis whose value lies beyond by more than that tells of something else, and is as
   much less likely: its likelihood is multiplied by the part of what it says that lies within the range. Formulas:
   docs/method.md, "Ranking". */
#ifndef FB_FAULT_RANGE_H
#define FB_FAULT_RANGE_H

#include "moving.h"

#define FAR_TAIL (-30.0) /* from here on the normal distribution is taken by the first term of its expansion */

FB_SELDOM

/* Logarithm of the probability that a normal number lies below x, in its sd. Source: Abramowitz and Stegun, 26.2.12. */
static double log_below(double x)
{
    if (x < FAR_TAIL) return -0.5 * x * x - log(-x) - 0.5 * log(FB_TAU);
    return log(0.5 * erfc(-x / FB_SQRT2));
}

/* Logarithm of the probability that a parameter lies within its range; value, variance in factors. share: part of its
   likelihood that counts. */
static double log_within_range(int parameter, double value, double variance, double share)
{
    const double least = RANGE_LEAST[parameter], most = RANGE_MOST[parameter];
    const double sd = sqrt(fmax(variance, 0.0) / share + ACCURACY[parameter] * ACCURACY[parameter]);
    double sum = 0.0;
    if (!isfinite(value) || !(sd > 0.0)) return 0.0;
    if (isfinite(least)) sum += log_below((value - least) / sd);
    if (isfinite(most)) sum += log_below((most - value) / sd);
    return sum;
}

/* The same of the parameters of a lane that are suspects. What a slot adds counts whole: the filter lets it act up to the ends
   only, so a drift that runs on beyond them tells by how far it has. */
static double log_in_range(const Bank *bank, int64_t lane, double share)
{
    const int *members;
    double sum = 0.0;
    if (lane < N_STEPS) {
        const int n = members_of(hypothesis_of(bank, lane), &members);
        for (int i = 0; i < n; i++) {
            const int k = AT_PARAMETERS + members[i];
            sum += log_within_range(members[i], of_step(bank, lane, k), of_step(bank, lane, PLAIN_PLACE(k, k)), share);
        }
        return sum;
    }
    const int64_t slot = lane - N_STEPS, couple = couple_of(bank, slot);
    const int parameter = SLOT_PARAMETER[plan_of(bank, slot)], size = AT_SLOT;
    if (parameter >= 0) {
        const int k = AT_PARAMETERS + parameter;
        sum += log_within_range(parameter, of_slot(bank, slot, k) + of_slot(bank, slot, size),
                                of_slot(bank, slot, WIDE_PLACE(k, k)) + 2.0 * of_slot(bank, slot, WIDE_PLACE(k, size)) +
                                    of_slot(bank, slot, WIDE_PLACE(size, size)), share);
    }
    const int beside = couple >= 0 ? COUPLE_PARAMETER[couple] : -1;
    if (beside >= 0) { /* not of two instruments */
        const int k = AT_PARAMETERS + beside;
        sum += log_within_range(beside, of_slot(bank, slot, k), of_slot(bank, slot, WIDE_PLACE(k, k)), share);
    }
    return sum;
}

FB_OFTEN

#endif
