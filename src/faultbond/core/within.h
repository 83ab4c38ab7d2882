/* What lies within the declared accuracy. That of a parameter says what is not known of it, so a change of less than that is
   no fault: a healthy parameter may move by half its accuracy (sd) where the model leaves something out, and by what is found
   of it on healthy data, if that is more.

   Each hypothesis says of its suspects that they are at fault. Of what it says, the part for which the change of a suspect is
   that of a healthy parameter goes to the hypothesis without it; where none is left, to none at all. Both are taken to be as
   likely before, so this part is q = h / (h + f), with h and f the densities of the change under what healthy and faulty
   parameters do. Source: Bayes' rule for a mixture of two normal distributions. */
#ifndef FB_WITHIN_H
#define FB_WITHIN_H

#include "ranking.h"

#define MOVES_BY 0.5 /* sd by which a healthy parameter may move, in its accuracy */
#define FAINT 1e-15  /* part of what a hypothesis is worth that stays with it */

/* Logarithm of the normal density, but for a constant. */
static double log_density(double off, double variance) { return -0.5 * (off * off / variance + log(variance)); }

/* Log-odds that the change of a suspect is that of a healthy parameter; -inf of an instrument. Before a first diagnosis was
   accepted the change counts from the nominal value too, whichever is farther. */
static double odds_within(const State *state, const Suspect *suspect)
{
    const int64_t k = suspect->parameter;
    if (k < 0 || !(ACCURACY[k] > 0.0) || !isfinite(suspect->estimate) || !isfinite(suspect->sd)) return -INFINITY;
    const double value = suspect->estimate / SCALE[k], sd = suspect->sd / SCALE[k];
    const double since = fabs(value - state->bank.healthy[AT_PARAMETERS + k]);
    const double off = state->clock.accepted < 0 ? fmax(since, fabs(value - HEALTHY[k])) : since;
    const double healthy = fmax(MOVES_BY * ACCURACY[k], HEALTHY_CHANGE[k]), faulty = fmax(CHANGE[k], healthy);
    return log_density(off, healthy * healthy + sd * sd) - log_density(off, faulty * faulty + sd * sd);
}

/* Whether the suspects of a hypothesis are those of another one, `whole`, that are kept. */
static int is_rest_of(int64_t hypothesis, int64_t whole, const Suspect *suspects, int64_t n, unsigned kept)
{
    const int *members;
    const int n_members = members_of(hypothesis, &members);
    int64_t instrument = -1;
    int n_kept = 0;
    for (int64_t i = 0; i < n; i++) {
        int is_member = 0;
        if (!(kept >> i & 1u)) continue;
        if (suspects[i].parameter < 0) {
            instrument = instrument_of(whole);
            continue;
        }
        for (int m = 0; m < n_members; m++) is_member |= members[m] == suspects[i].parameter;
        if (!is_member) return 0;
        n_kept++;
    }
    return n_kept == n_members && instrument_of(hypothesis) == instrument;
}

/* The tested hypothesis of the suspects that are kept of another one; that one where there is none. */
static int64_t rest_of(const Ranking *ranking, int64_t whole, const Suspect *suspects, int64_t n, unsigned kept)
{
    for (int64_t k = 0; k < N_HYPOTHESES; k++)
        if (ranking->best[k] >= 0 && is_rest_of(k, whole, suspects, n, kept)) return k;
    return whole;
}

/* Share out what a hypothesis is worth, `share`, among itself and those of fewer suspects. */
static void share_out(const State *state, int64_t hypothesis, double share, Ranking *ranking)
{
    Suspect suspects[LARGEST_SET];
    double within[LARGEST_SET];
    const int64_t lane = ranking->best[hypothesis], n = suspects_of(state, lane, suspects);
    for (int64_t i = 0; i < n; i++) {
        judge_value(state, lane, i, &suspects[i]);
        within[i] = odds_within(state, &suspects[i]);
    }
    for (unsigned kept = 0; kept < 1u << n; kept++) {
        double part = share;
        for (int64_t i = 0; i < n; i++) part /= 1.0 + exp(kept >> i & 1u ? within[i] : -within[i]);
        if (kept == 0) ranking->within += part;
        else if (kept == (1u << n) - 1u) ranking->shared[hypothesis] += part;
        else if (part > FAINT * share) ranking->shared[rest_of(ranking, hypothesis, suspects, n, kept)] += part;
        else ranking->shared[hypothesis] += part;
    }
}

/* Take from the scores what lies within the declared accuracy; the rest of all is ranking->within, beside the best. */
static void leave_out_small(const State *state, Ranking *ranking)
{
    const double top = ranking->score[leading_hypothesis(ranking)];
    for (int64_t k = 0; k < N_HYPOTHESES; k++) ranking->shared[k] = 0.0;
    ranking->within = 0.0;
    if (!(top > -INFINITY)) return;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        const double share = exp(ranking->score[k] - top);
        if (share > 0.0 && ranking->best[k] >= 0) share_out(state, k, share, ranking);
        else ranking->shared[k] += share;
    }
    for (int64_t k = 0; k < N_HYPOTHESES; k++)
        if (ranking->shared[k] > 0.0) ranking->score[k] = top + log(ranking->shared[k]);
    ranking->within = log(ranking->within) + top;
}

#endif
