/* Ranking: posterior probabilities of the hypotheses, their estimates, and which cannot yet be told apart.

   score = likelihood averaged over kinds of fault and starts (in logarithm) - cost of the suspects; posterior =
   exp(score) normalised; hypotheses within GROUP_NATS of the best are one group. Source: Magill, IEEE Trans.
   Automatic Control 10 (1965).

   Of n samples since the alarm likelihoods count as of n / (1 + n / AS_MANY), see `share_of_evidence`; and by how much of what
   they say lies within the ranges of their suspects, see fault_range.h. Records of inputs that have stopped speak for a stuck meter,
   see stopped.h. Formulas: docs/method.md, "Ranking". */
#ifndef FB_RANKING_H
#define FB_RANKING_H

#include "fault_range.h"
#include "given.h"
#include "stopped.h"

#define SELDOM 1e-6          /* least probability that counts */
#define UNSAID 1e-12         /* probability that changes no sum */
#define TIES 1048576.0       /* steps of a nat in which two of them are told apart */
#define LIKELY_KIND 0.05     /* probability of a kind from which its value counts beside that which is told */

/* Lanes that are left out of a ranking; they count as those whose likelihood is no number. */
enum { OUT_NONE = 0, OUT_REJECTED = 1 };

/* Scores in logarithm, -inf: without lanes. */
typedef struct {
    double most, share;                             /* likelihood of the likeliest lane, and the part that counts of what others lack */
    double weighted[FB_ROOM(N_LANES)];              /* likelihood of each lane with its weight */
    double kinds[FB_ROOM(N_HYPOTHESES)][N_KINDS];   /* of each hypothesis and kind */
    double score[FB_ROOM(N_HYPOTHESES)];            /* of each hypothesis, with its cost */
    int64_t leading[FB_ROOM(N_HYPOTHESES)];         /* its likeliest kind, */
    int64_t likeliest[FB_ROOM(N_HYPOTHESES)][N_KINDS]; /* its likeliest lane of each kind; -1: none, */
    int64_t best[FB_ROOM(N_HYPOTHESES)];            /* and that of its likeliest kind, which tells of it */
    double within;                                  /* score of no fault but what lies within the accuracy, see within.h, */
    double shared[FB_ROOM(N_HYPOTHESES)];           /* and its memory: what each hypothesis is worth, */
    Given given;                                    /* and how suspects depend on other parameters */
} Ranking;

FB_SELDOM

static int is_out(const Bank *bank, int out, int64_t hypothesis)
{
    return (out & OUT_REJECTED) && bank->rejected[hypothesis];
}

/* Of a fault that comes and goes the probability, in logarithm, that it has done so: one that came and is still there is of
   another kind. */
static double log_returns(const Bank *bank, int64_t lane)
{
    return SLOT_KIND[lane] == KIND_INTERMITTENT ? log(fmax(of_slot(bank, lane, ROLE_RETURNS), SELDOM)) : 0.0;
}

/* The log-likelihood of a lane beside the likeliest one, as far as it counts; that of one that is no number is below all. A
   lane that rests has no chance: what it lacks counts whole. */
static inline double coarse(const Ranking *ranking, double likelihood, int64_t rests)
{
    const double known = finite_or_lowest(likelihood);
    return known > LOWEST ? (known - ranking->most) * (rests ? 1.0 : ranking->share) : LOWEST;
}

/* The likelihood of each lane of couples with its prior weight: slots have their own, and lanes of a couple weigh the same. */
static void weigh_couples(const Bank *bank, int out, const Ranking *ranking, double *weighted)
{
    for (int64_t lane = 0; lane < N_COUPLE_LANES; lane++) {
        const int64_t slot = bank->base[lane], rests = bank->rests[FIRST_COUPLES + lane / GROUP];
        weighted[lane] = -INFINITY;
        if (slot < 0) continue;
        const double likelihood = coarse(ranking, of_slot(bank, N_SLOT_LANES + lane, WIDE_LIKELIHOOD), rests);
        const int left_out = is_out(bank, out, hypothesis_of(bank, N_STEPS + N_SLOT_LANES + lane));
        weighted[lane] = (left_out ? LOWEST : likelihood) + weight_of_couple(bank, lane, slot) - log((double)PER_COUPLE);
    }
}

/* The likelihood of each lane with its prior weight, as far as it counts; starts of a hypothesis weigh the same. */
static void weigh_lanes(const Bank *bank, int out, Ranking *ranking)
{
    double *weighted = ranking->weighted;
    for (int64_t set = 0; set < N_SETS; set++) {
        const double weight = -log((double)(FIRST_LANE[set + 1] - FIRST_LANE[set]));
        for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++) {
            const double likelihood = coarse(ranking, of_step(bank, lane, PLAIN_LIKELIHOOD), bank->rests[lane / GROUP]);
            weighted[lane] = weight + (is_out(bank, out, set) ? LOWEST : likelihood);
        }
    }
    for (int64_t lane = N_PLANNED; lane < N_STEPS; lane++) {
        const int is_grown = bank->grown[(lane - N_PLANNED) / PER_SET] >= 0;
        const double likelihood = coarse(ranking, of_step(bank, lane, PLAIN_LIKELIHOOD), bank->rests[lane / GROUP]);
        weighted[lane] = is_out(bank, out, hypothesis_of(bank, lane)) ? LOWEST : likelihood - log((double)PER_SET);
        if (!is_grown) weighted[lane] = -INFINITY;
    }
    for (int64_t lane = 0; lane < N_SLOT_LANES; lane++) {
        const int left_out = is_out(bank, out, SLOT_HYPOTHESIS[lane]);
        const int64_t rests = lane < SWITCHED && bank->rests[BLOCKS(N_STEPS) + lane / GROUP];
        const double likelihood = coarse(ranking, of_slot(bank, lane, WIDE_LIKELIHOOD), rests);
        weighted[N_STEPS + lane] = (left_out ? LOWEST : likelihood) + SLOT_WEIGHT[lane] + log_returns(bank, lane);
    }
    weigh_couples(bank, out, ranking, weighted + N_STEPS + N_SLOT_LANES);
}

/* The prior weight of a wrong gain among the faults of an instrument. */
static double weight_of_gain(int64_t instrument)
{
    double weight = -INFINITY;
    for (int64_t k = 0; k < SWITCHED; k++)
        if (SLOT_HYPOTHESIS[k] == instrument && SLOT_KIND[k] == KIND_GAIN) weight = log_add(weight, SLOT_WEIGHT[k]);
    return weight;
}

/* What the lanes of a couple of two instruments say in which the gain of the input with a factor is wrong, and the other has a bias,
   but for the weight of that gain. */
static double said_of_gain(const Bank *bank, const Ranking *ranking, int64_t couple)
{
    double said = -INFINITY;
    for (int64_t lane = 0; lane < N_COUPLE_LANES; lane++) {
        const int64_t slot = bank->base[lane];
        if (slot < 0 || bank->coupled[row_of_lane(lane)] != couple) continue;
        if (SLOT_HYPOTHESIS[slot] != COUPLE_GAINS[couple] || SLOT_KIND[slot] != KIND_GAIN) continue;
        said = log_add(said, ranking->weighted[N_STEPS + N_SLOT_LANES + lane] - SLOT_WEIGHT[slot]);
    }
    return said;
}

/* Let a wrong gain of an input, and a step of the parameter with which alone the input acts, say what either
   says beside another suspect: they are the same, and lanes that begin elsewhere, or are not there, would tell them apart; where the
   input lags, nobody knows whether it is not the sensor. Beside a sensor of each of its kinds, since not all of them have a lane with
   that gain. What is ruled out stays so. */
static void share_products(const Bank *bank, int out, Ranking *ranking)
{
    for (int64_t couple = 0; couple < N_MIXED + N_BOTH; couple++) {
        if (COUPLE_ALIKE[couple] < 0) continue;
        if (is_out(bank, out, COUPLE_HYPOTHESIS[couple]) || is_out(bank, out, COUPLE_ALIKE[couple])) continue;
        double *own = ranking->kinds[COUPLE_HYPOTHESIS[couple]], *other = ranking->kinds[COUPLE_ALIKE[couple]];
        const double weight = weight_of_gain(COUPLE_GAINS[couple]);
        if (couple < N_MIXED) {
            if (!(own[KIND_GAIN] > -INFINITY && other[KIND_STEP] > -INFINITY)) continue;
            other[KIND_STEP] = fmax(other[KIND_STEP], own[KIND_GAIN] - weight);
            own[KIND_GAIN] = other[KIND_STEP] + weight;
            continue;
        }
        if (other[KIND_BIAS] > -INFINITY) other[KIND_BIAS] = fmax(other[KIND_BIAS], said_of_gain(bank, ranking, couple));
        for (int kind = 0; kind < N_KINDS; kind++)
            if (own[kind] > -INFINITY && other[kind] + weight > own[kind]) own[kind] = other[kind] + weight;
    }
}

/* Whether a wrong gain of an input, and a change of the parameter with which alone it acts, are both tested and not ruled out, so that
   the one may stand for the other; gives their hypotheses. */
static int are_interchangeable(const Bank *bank, int out, int input, int64_t *set, int64_t *instrument)
{
    *set = INPUT_FACTOR[input] < 0 ? -1 : single_of(INPUT_FACTOR[input]);
    *instrument = -1;
    for (int64_t lane = 0; lane < SWITCHED; lane++)
        if (SLOT_INPUT[lane] == input && SLOT_SCALES[lane]) *instrument = SLOT_HYPOTHESIS[lane];
    return *set >= 0 && *instrument >= 0 && !is_out(bank, out, *set) && !is_out(bank, out, *instrument);
}

/* What the lanes of wrong gains of an input say, whatever their kind. */
static double said_of_gains(const Ranking *ranking, int input)
{
    double said = -INFINITY;
    for (int64_t lane = 0; lane < SWITCHED; lane++)
        if (SLOT_INPUT[lane] == input && SLOT_SCALES[lane]) said = log_add(said, ranking->weighted[N_STEPS + lane]);
    return said;
}

/* The same of a parameter alone, but for what comes and goes. */
static double said_of_parameter(const Ranking *ranking, int64_t set, int parameter)
{
    double said = -INFINITY;
    for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++) said = log_add(said, ranking->weighted[lane]);
    for (int64_t lane = 0; lane < SWITCHED; lane++)
        if (SLOT_PARAMETER[lane] == parameter) said = log_add(said, ranking->weighted[N_STEPS + lane]);
    return said;
}

/* Let a wrong gain of an input, and a change of the parameter with which alone it acts, say what either says: which of both it is
   nobody knows. Their lanes begin elsewhere and from other spreads, and what the parameter wanders goes on as large as before after
   a change of it, and smaller after one of the input. What comes and goes, and what is ruled out, says its own. */
static void share_gains(const Bank *bank, int out, Ranking *ranking)
{
    for (int input = 0; input < N_INPUTS; input++) {
        int64_t set, instrument;
        if (!are_interchangeable(bank, out, input, &set, &instrument)) continue;
        const double own = said_of_parameter(ranking, set, INPUT_FACTOR[input]), weight = weight_of_gain(instrument);
        const double more = said_of_gains(ranking, input) - weight - own;
        if (!isfinite(more)) continue;
        for (int kind = 0; kind < N_KINDS && more > 0.0; kind++)
            if (kind != KIND_INTERMITTENT) ranking->kinds[set][kind] += more;
        double *gain = &ranking->kinds[instrument][KIND_GAIN];
        if (more < 0.0) *gain = fmax(*gain, own + weight);
    }
}

/* The scores of all hypotheses, and their best lanes; of lanes or kinds that are equally likely the first. */
static void score_all(const State *state, int out, Ranking *ranking)
{
    const Bank *bank = &state->bank;
    const int64_t leader = leader_of(bank);
    ranking->most = leader < 0 ? LOWEST : likelihood_in(bank, leader);
    ranking->within = -INFINITY;
    ranking->share = share_of_evidence(state);
    weigh_lanes(bank, out, ranking);
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        for (int kind = 0; kind < N_KINDS; kind++) {
            ranking->kinds[k][kind] = -INFINITY;
            ranking->likeliest[k][kind] = -1;
        }
        ranking->leading[k] = 0;
    }
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        if (ranking->weighted[lane] > -INFINITY) ranking->weighted[lane] += log_in_range(bank, lane, ranking->share);
        double *total = &ranking->kinds[hypothesis_of(bank, lane)][kind_of(bank, lane)];
        *total = log_add(*total, ranking->weighted[lane]);
    }
    share_products(bank, out, ranking);
    share_gains(bank, out, ranking);
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        const double *kinds = ranking->kinds[k];
        double total = kinds[0];
        for (int kind = 1; kind < N_KINDS; kind++) {
            total = log_add(total, kinds[kind]);
            if (kinds[kind] > kinds[ranking->leading[k]]) ranking->leading[k] = kind;
        }
        ranking->score[k] = total - COST[k] + log_of_records(state, k);
    }
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        int64_t *best = &ranking->likeliest[hypothesis_of(bank, lane)][kind_of(bank, lane)];
        if (ranking->weighted[lane] > (*best < 0 ? -INFINITY : ranking->weighted[*best])) *best = lane;
    }
    for (int64_t k = 0; k < N_HYPOTHESES; k++) ranking->best[k] = ranking->likeliest[k][ranking->leading[k]];
}

/* Whether a hypothesis is likelier than another one. What sums of logarithms round counts as equal, so that those that look
   alike, as two tanks of one kind, stand in the same order however the core is compiled. */
static inline int is_likelier(const Ranking *ranking, int64_t hypothesis, int64_t other)
{
    return rint(ranking->score[hypothesis] * TIES) > rint(ranking->score[other] * TIES);
}

/* The best hypothesis; of those equally likely the first. */
static int64_t leading_hypothesis(const Ranking *ranking)
{
    int64_t best = 0;
    for (int64_t k = 1; k < N_HYPOTHESES; k++)
        if (is_likelier(ranking, k, best)) best = k;
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
        while (at > 0 && is_likelier(ranking, k, order[at - 1])) at--;
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

/* Add to the mean square of what a value may be off by what other suspects say of it, with a probability, if they do. */
static void mix_value(const Suspect *told, const Suspect *others, int64_t n, double share, double *square, double *total)
{
    for (int64_t k = 0; k < n; k++) {
        const Suspect *other = &others[k];
        const double off = other->estimate - told->estimate;
        if (other->parameter != told->parameter || other->input != told->input || other->output != told->output) continue;
        if (other->word != told->word || !isfinite(off)) continue;
        *square += share * (off * off + other->sd * other->sd);
        *total += share;
    }
}

/* The suspects of a candidate, as its best lane has them. A value is as uncertain as the kinds of fault together leave it: what
   rises for as long as a valve is shut, and what has come to stay meanwhile, are far apart, and nobody knows which it is. */
static void find_suspects(const State *state, const int64_t *likeliest, Candidate *candidate)
{
    const int64_t lane = candidate->lane;
    double square[LARGEST_SET], total[LARGEST_SET];
    Suspect others[LARGEST_SET];
    candidate->present = lane < N_STEPS || SLOT_ACTS[plan_of(&state->bank, lane - N_STEPS)];
    candidate->n_suspects = judged_suspects(state, lane, candidate->suspects);
    for (int64_t k = 0; k < candidate->n_suspects; k++) {
        Suspect *suspect = &candidate->suspects[k];
        if (suspect->input >= 0) suspect->stopped = stopped_at(state, suspect->input);
        square[k] = candidate->shares[0] * (suspect->sd * suspect->sd);
        total[k] = candidate->shares[0];
    }
    for (int64_t row = 1; row < candidate->n_kinds && candidate->shares[row] >= LIKELY_KIND; row++) {
        const int64_t n = judged_suspects(state, likeliest[candidate->kinds[row]], others);
        for (int64_t k = 0; k < candidate->n_suspects; k++)
            mix_value(&candidate->suspects[k], others, n, candidate->shares[row], &square[k], &total[k]);
    }
    for (int64_t k = 0; k < candidate->n_suspects; k++)
        if (total[k] > candidate->shares[0]) candidate->suspects[k].sd = sqrt(square[k] / total[k]);
}

/* Whether a hypothesis was not ruled out, and has a lane. */
static inline int is_tested(const Ranking *ranking, int64_t hypothesis) { return ranking->score[hypothesis] > 0.5 * LOWEST; }

/* Write the ranked candidates of a bank that has been scored; the rest of `found` stays. What lies within the accuracy tells
   no tested set from another, so each that was not ruled out has an even share of that, where it is anything to speak of. */
static void rank(const State *state, const Ranking *ranking, Diagnosis *found)
{
    int64_t order[MOST_CANDIDATES], n_tested = 0;
    double total;
    found->n_candidates = best_hypotheses(ranking, order);
    if (found->n_candidates == 0) return;
    total = exp(ranking->within - ranking->score[order[0]]);
    found->within_accuracy = total;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        n_tested += is_tested(ranking, k);
        total += exp(ranking->score[k] - ranking->score[order[0]]);
    }
    found->within_accuracy /= total;
    const double even = found->within_accuracy > UNSAID ? found->within_accuracy / (double)n_tested : 0.0;
    for (int64_t row = 0; row < found->n_candidates; row++) {
        const int64_t k = order[row];
        Candidate *candidate = &found->candidates[row];
        candidate->hypothesis = k;
        candidate->lane = ranking->best[k];
        candidate->group = ranking->score[k] >= ranking->score[order[0]] - GROUP_NATS;
        candidate->probability = exp(ranking->score[k] - ranking->score[order[0]]) / total + (is_tested(ranking, k) ? even : 0.0);
        rank_kinds(ranking->kinds[k], ranking->leading[k], candidate);
        find_suspects(state, ranking->likeliest[k], candidate);
    }
}

FB_OFTEN

#endif
