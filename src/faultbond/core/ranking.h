/* Ranking: posterior probabilities of the hypotheses, their estimates, and which cannot yet be told apart.

   score = likelihood averaged over kinds of fault and starts (in logarithm) - cost of the suspects; posterior =
   exp(score) normalised; hypotheses within GROUP_NATS of the best are one group. Source: Magill, IEEE Trans.
   Automatic Control 10 (1965). */
#ifndef FB_RANKING_H
#define FB_RANKING_H

#include "moving.h"

#define MOST_CANDIDATES (N_HYPOTHESES < MAX_CANDIDATES ? FB_ROOM(N_HYPOTHESES) : MAX_CANDIDATES) /* that are listed */

/* A hypothesis with the estimates of its best lane. kinds: the likeliest first, to which the estimates belong;
   shares: the probability of each, given that this is the hypothesis. */
typedef struct {
    int64_t hypothesis;
    int64_t lane;    /* that tells of it: of steps, then of those with a slot */
    int64_t group;   /* 1: cannot be told from the best */
    int64_t present; /* 0 while a fault that comes and goes is gone */
    int64_t n_kinds, kinds[N_KINDS], n_suspects;
    double probability, shares[N_KINDS];
    Suspect suspects[LARGEST_SET];
} Candidate;

/* Ranked candidates, the best first. Where none explains the data, the best is off by `unexplained_sd` at a sensor,
   `signal`, from `since` to `until`; else these are nan, and -1. Of the sets that are not tested
   `untested_probability` is at most how likely it is that one is the true one; 1: no bound. */
typedef struct {
    double time; /* s */
    int64_t n_candidates, is_unexplained, has_untested, untested_sets, signal;
    double unexplained_sd, since, until, untested_probability;
    Candidate candidates[MOST_CANDIDATES];
} Diagnosis;

/* Lanes that are left out of a ranking; they count as those whose likelihood is no number. */
enum { OUT_NONE = 0, OUT_REJECTED = 1, OUT_UNSTEADY = 2 };

/* Scores in logarithm, -inf: without lanes. */
typedef struct {
    double weighted[FB_ROOM(N_LANES)];              /* likelihood of each lane with its weight */
    double kinds[FB_ROOM(N_HYPOTHESES)][N_KINDS];   /* of each hypothesis and kind */
    double score[FB_ROOM(N_HYPOTHESES)];            /* of each hypothesis, with its cost */
    int64_t leading[FB_ROOM(N_HYPOTHESES)];         /* its likeliest kind, */
    int64_t best[FB_ROOM(N_HYPOTHESES)];            /* and its likeliest lane among those of this kind; -1: none */
} Ranking;

static int is_out(const Bank *bank, int out, int64_t hypothesis)
{
    return (out & OUT_REJECTED) && bank->rejected[hypothesis];
}

/* The likelihood of each lane with its prior weight; starts of a hypothesis weigh the same. */
static void weigh_lanes(const Bank *bank, int out, double *weighted)
{
    for (int64_t set = 0; set < N_SETS; set++) {
        const double weight = -log((double)(FIRST_LANE[set + 1] - FIRST_LANE[set]));
        for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++)
            weighted[lane] = weight
                + (is_out(bank, out, set) ? LOWEST : finite_or_lowest(of_step(bank, lane, PLAIN_LIKELIHOOD)));
    }
    for (int64_t lane = N_PLANNED; lane < N_STEPS; lane++) {
        const int is_grown = bank->grown[(lane - N_PLANNED) / PER_SET] >= 0;
        const double likelihood = finite_or_lowest(of_step(bank, lane, PLAIN_LIKELIHOOD));
        weighted[lane] = is_out(bank, out, hypothesis_of(bank, lane)) ? LOWEST : likelihood - log((double)PER_SET);
        if (!is_grown) weighted[lane] = -INFINITY;
    }
    for (int64_t lane = 0; lane < N_SLOT_LANES; lane++) {
        const int unsteady = (out & OUT_UNSTEADY) && SLOT_SPAN[lane] > 0.0;
        const int left_out = unsteady || is_out(bank, out, SLOT_HYPOTHESIS[lane]);
        const double likelihood = left_out ? LOWEST : finite_or_lowest(of_slot(bank, lane, WIDE_LIKELIHOOD));
        weighted[N_STEPS + lane] = likelihood + SLOT_WEIGHT[lane];
    }
}

/* The scores of all hypotheses, and their best lanes; of lanes or kinds that are equally likely the first. */
static void score_all(const Bank *bank, int out, Ranking *ranking)
{
    weigh_lanes(bank, out, ranking->weighted);
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        for (int kind = 0; kind < N_KINDS; kind++) ranking->kinds[k][kind] = -INFINITY;
        ranking->leading[k] = 0;
        ranking->best[k] = -1;
    }
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        double *total = &ranking->kinds[hypothesis_of(bank, lane)][kind_of(lane)];
        *total = log_add(*total, ranking->weighted[lane]);
    }
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        const double *kinds = ranking->kinds[k];
        double total = kinds[0];
        for (int kind = 1; kind < N_KINDS; kind++) {
            total = log_add(total, kinds[kind]);
            if (kinds[kind] > kinds[ranking->leading[k]]) ranking->leading[k] = kind;
        }
        ranking->score[k] = total - COST[k];
    }
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        const int64_t k = hypothesis_of(bank, lane);
        const double before = ranking->best[k] < 0 ? -INFINITY : ranking->weighted[ranking->best[k]];
        if (kind_of(lane) == ranking->leading[k] && ranking->weighted[lane] > before) ranking->best[k] = lane;
    }
}

/* The best hypothesis; of those equally likely the first. */
static int64_t leading_hypothesis(const Ranking *ranking)
{
    int64_t best = 0;
    for (int64_t k = 1; k < N_HYPOTHESES; k++)
        if (ranking->score[k] > ranking->score[best]) best = k;
    return best;
}

/* The numbers of the best hypotheses, up to MOST_CANDIDATES, the best first, and how many; those that are equally
   likely in their order. */
static int64_t best_hypotheses(const Ranking *ranking, int64_t *order)
{
    int64_t n = 0;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        if (!(ranking->score[k] > -INFINITY)) continue;
        int64_t at = n;
        while (at > 0 && ranking->score[k] > ranking->score[order[at - 1]]) at--;
        if (at == MOST_CANDIDATES) continue;
        if (n < MOST_CANDIDATES) n++;
        for (int64_t last = n - 1; last > at; last--) order[last] = order[last - 1];
        order[at] = k;
    }
    return n;
}

/* The kinds of fault of a candidate, the likeliest first; those that are equally likely in their order. They add up
   also where rejected lanes have lost all scale. */
static void rank_kinds(const double *kinds, int64_t leading, Candidate *candidate)
{
    double total = 0.0;
    candidate->n_kinds = 0;
    for (int kind = 0; kind < N_KINDS; kind++) {
        const double share = exp(kinds[kind] - kinds[leading]);
        total += share;
        if (!isfinite(kinds[kind])) continue;
        int64_t at = candidate->n_kinds++;
        for (; at > 0 && share > candidate->shares[at - 1]; at--) {
            candidate->shares[at] = candidate->shares[at - 1];
            candidate->kinds[at] = candidate->kinds[at - 1];
        }
        candidate->shares[at] = share;
        candidate->kinds[at] = kind;
    }
    for (int64_t k = 0; k < candidate->n_kinds; k++) candidate->shares[k] /= total;
}

/* The suspects of a candidate, as its best lane has them. */
static void find_suspects(const State *state, int64_t lane, Candidate *candidate)
{
    candidate->present = lane < N_STEPS || SLOT_ACTS[lane - N_STEPS];
    candidate->n_suspects = suspects_of(state, lane, candidate->suspects);
    for (int64_t k = 0; k < candidate->n_suspects; k++) judge_value(state, lane, k, &candidate->suspects[k]);
}

/* Write the ranked candidates of a bank that has been scored; the rest of `found` stays. */
static void rank(const State *state, const Ranking *ranking, Diagnosis *found)
{
    int64_t order[MOST_CANDIDATES];
    double total = 0.0;
    found->n_candidates = best_hypotheses(ranking, order);
    if (found->n_candidates == 0) return;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) total += exp(ranking->score[k] - ranking->score[order[0]]);
    for (int64_t row = 0; row < found->n_candidates; row++) {
        const int64_t k = order[row];
        Candidate *candidate = &found->candidates[row];
        candidate->hypothesis = k;
        candidate->lane = ranking->best[k];
        candidate->group = ranking->score[k] >= ranking->score[order[0]] - GROUP_NATS;
        candidate->probability = exp(ranking->score[k] - ranking->score[order[0]]) / total;
        rank_kinds(ranking->kinds[k], ranking->leading[k], candidate);
        find_suspects(state, ranking->best[k], candidate);
    }
}

#endif
