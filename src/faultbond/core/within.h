/* What lies within the declared accuracy. That of a parameter says what is not known of it, so a change of less than that is
   no fault: a healthy parameter may move by half its accuracy (sd) where the model leaves something out, and by what is found
   of it on healthy data, if that is more. A sensor or input may be off by the bias that is found of it there; where none was,
   and where a parameter is known exactly, a healthy one is off by nothing.

   Each hypothesis says of its suspects that they are at fault. Of what it says, the part for which the change of a suspect is
   that of a healthy parameter goes to the hypothesis without it; where none is left, to none at all. Both are taken to be as
   likely before, so this part is q = h / (h + f), with h and f the densities of the change under what healthy and faulty
   parameters do. Source: Bayes' rule for a mixture of two normal distributions. Formulas: docs/method.md, "Ranking"; reasons
   and figures: docs/decisions/029-healthy-bias.md. */
#ifndef FB_WITHIN_H
#define FB_WITHIN_H

#include "ranking.h"

#define MOVES_BY 0.5 /* sd by which a healthy parameter may move, in its accuracy */
#define FAINT 1e-15  /* part of what a hypothesis is worth that stays with it */

FB_SELDOM

/* Logarithm of the normal density, but for a constant. */
static double log_density(double off, double variance) { return -0.5 * (off * off / variance + log(variance)); }

/* A parameter beside what others let expect of it: how far it is off, since before the fault and from nominal, the variance of its
   value, and the sd to which a healthy one is known. */
typedef struct {
    double since, from_nominal, variance, accuracy;
} Off;

/* How far suspect i of n of a lane is off, beside parameters that go with it and are not suspects: what is not known of all
   in common is then no part of it. `alone`: how far it is by itself. */
static Off off_beside(const State *state, int64_t lane, const Suspect *suspects, int64_t n, int64_t i, Off alone, Given *given)
{
    const Bank *bank = &state->bank;
    const int k = (int)suspects[i].parameter;
    int chosen[LARGEST_SET], n_chosen = 1;
    chosen[0] = k;
    for (int64_t m = 0; m < n; m++)
        if (m != i && suspects[m].parameter >= 0) chosen[n_chosen++] = (int)suspects[m].parameter;
    Off off = alone;
    off.accuracy = sqrt(depends_on(chosen, n_chosen, given));
    double *row = given->row[0], own = 0.0, all = 0.0;
    const int moves = lane >= N_STEPS && SLOT_PARAMETER[plan_of(bank, lane - N_STEPS)] == k;
    for (int a = 0; a < N_PARAMETERS + moves; a++) /* its value may be that of the parameter and what the slot adds */
        for (int b = 0; b < N_PARAMETERS + moves; b++) {
            const double part = (a < N_PARAMETERS ? row[a] : 1.0) * (b < N_PARAMETERS ? row[b] : 1.0);
            if (part == 0.0) continue;
            const double covariance = part * covariance_in(bank, lane, AT_PARAMETERS + a, AT_PARAMETERS + b);
            all += covariance;
            if ((a == k || a == N_PARAMETERS) && (b == k || b == N_PARAMETERS)) own += covariance;
        }
    if (own > 0.0 && all > 0.0) off.variance *= all / own;
    for (int j = 0; j < N_PARAMETERS; j++) {
        if (j == k || row[j] == 0.0) continue;
        const double now = number_in(bank, lane, AT_PARAMETERS + j);
        off.since += row[j] * (now - bank->healthy[AT_PARAMETERS + j]);
        off.from_nominal += row[j] * (now - HEALTHY[j]);
    }
    return off;
}

/* Log-odds that something is off by what a healthy one may be, and not by what a faulty one may be; sds, and a variance of it.
   -inf where that is not to be told. */
static double odds_healthy(double off, double healthy, double faulty, double variance)
{
    const double least = healthy * healthy + variance, most = fmax(faulty, healthy);
    if (!(least > 0.0 && most > 0.0)) return -INFINITY;
    const double odds = log_density(off, least) - log_density(off, most * most + variance);
    return isnan(odds) ? -INFINITY : odds; /* so far off that its square is no number */
}

/* Largest size of input k in its own unit, of which a gain is, SI; 0 where none was seen. */
static double largest_shown(const Inputs *inputs, int k)
{
    const double size = fmax(fabs(inputs->lowest[k] - INPUT_ZERO[k]), fabs(inputs->highest[k] - INPUT_ZERO[k]));
    return inputs->lowest[k] <= inputs->highest[k] ? size : 0.0;
}

/* Log-odds that the bias of a sensor or an input is that of a healthy one, or what a gain of an input makes of its largest value;
   -inf of what is neither. */
static double odds_unbiased(const State *state, const Suspect *suspect)
{
    const int k = (int)suspect->input, j = (int)suspect->output;
    const double healthy = k >= 0 ? INPUT_HEALTHY_BIAS[k] : OUTPUT_HEALTHY_BIAS[j];
    const int is_gain = k >= 0 && suspect->word == WORD_GAIN;
    if (suspect->word != WORD_BIAS && !is_gain) return -INFINITY;
    const double largest = is_gain ? largest_shown(&state->inputs, k) : k >= 0 ? peak_of(&state->inputs, k) : 0.0;
    const double faulty = k >= 0 ? INPUT_CHANGE * largest : OUTPUT_CHANGE * OUTPUT_NOISE[j];
    const double unit = is_gain ? largest : 1.0, sd = unit * suspect->sd;
    return odds_healthy(unit * fabs(suspect->estimate - suspect->nominal), healthy, faulty, sd * sd);
}

/* Log-odds that the change of suspect i of n of a lane is that of a healthy one. Before a first diagnosis was accepted the change
   of a parameter counts from the nominal value too, whichever is farther; and from there alone where the fault began with the plant:
   what the healthy filter had made of the first samples was made of faulty ones. */
static double odds_within(const State *state, int64_t lane, const Suspect *suspects, int64_t n, int64_t i, Given *given)
{
    const Suspect *suspect = &suspects[i];
    const int k = (int)suspect->parameter;
    if (!isfinite(suspect->estimate) || !isfinite(suspect->sd)) return -INFINITY;
    if (k < 0) return odds_unbiased(state, suspect);
    const double value = suspect->estimate / SCALE[k], sd = suspect->sd / SCALE[k];
    Off is = {value - state->bank.healthy[AT_PARAMETERS + k], value - HEALTHY[k], sd * sd, ACCURACY[k]};
    if (is_tied(k)) is = off_beside(state, lane, suspects, n, i, is, given);
    if (state->clock.accepted < 0) {
        const int has_onset = lane < N_STEPS + SWITCHED || lane >= N_STEPS + N_SLOT_LANES; /* what comes and goes has none */
        const int began_with_plant = has_onset && state->bank.onset[lane] <= state->clock.begun + 1;
        is.since = fmax(began_with_plant ? 0.0 : fabs(is.since), fabs(is.from_nominal));
    }
    return odds_healthy(fabs(is.since), fmax(MOVES_BY * is.accuracy, HEALTHY_CHANGE[k]), CHANGE[k], is.variance);
}

/* The hypothesis that a sensor or an input is at fault by itself; -1: there is none. */
static int64_t alone_at_fault(const Suspect *suspect)
{
    for (int64_t lane = 0; lane < N_SLOT_LANES; lane++)
        if (SLOT_PARAMETER[lane] < 0 && SLOT_INPUT[lane] == suspect->input && SLOT_OUTPUT[lane] == suspect->output)
            return SLOT_HYPOTHESIS[lane];
    return -1;
}

/* Whether the suspects of a hypothesis are those of another one that are kept. */
static int is_rest_of(int64_t hypothesis, const Suspect *suspects, int64_t n, unsigned kept)
{
    const int *members;
    const int n_members = members_of(hypothesis, &members);
    const int64_t one = instrument_of(hypothesis), other = second_instrument_of(hypothesis);
    int n_kept = 0, n_instruments = (one >= 0) + (other >= 0);
    for (int64_t i = 0; i < n; i++) {
        int is_member = 0;
        if (!(kept >> i & 1u)) continue;
        if (suspects[i].parameter < 0) {
            const int64_t alone = alone_at_fault(&suspects[i]);
            if (alone < 0 || (alone != one && alone != other)) return 0;
            n_instruments--;
            continue;
        }
        for (int m = 0; m < n_members; m++) is_member |= members[m] == suspects[i].parameter;
        if (!is_member) return 0;
        n_kept++;
    }
    return n_kept == n_members && n_instruments == 0;
}

/* The tested hypothesis of the suspects that are kept of another one; that one where there is none. */
static int64_t rest_of(const Ranking *ranking, int64_t whole, const Suspect *suspects, int64_t n, unsigned kept)
{
    for (int64_t k = 0; k < N_HYPOTHESES; k++)
        if (ranking->best[k] >= 0 && is_rest_of(k, suspects, n, kept)) return k;
    return whole;
}

/* Share out what is worth that no suspect of a lane has changed. It says that nothing has, but where the lane has another
   parameter farther from where it is declared than is likely of a healthy one: of what was there from the first sample on every
   lane learns so, in time, and then that parameter is at fault. What was accepted is no more where it is declared, what goes
   with others may go with all of them, and what was ruled out stays so. */
static void share_rest(const State *state, int64_t lane, const Suspect *suspects, int64_t n, double share, Ranking *ranking)
{
    double least = 0.0;
    int64_t farthest = -1;
    for (int k = 0; k < N_PARAMETERS && state->clock.accepted < 0; k++) {
        const int64_t set = is_tied(k) ? -1 : single_of(k);
        int is_suspect = 0;
        for (int64_t i = 0; i < n; i++) is_suspect |= suspects[i].parameter == k;
        if (set < 0 || is_suspect || ranking->best[set] < 0 || state->bank.rejected[set]) continue;
        const double off = fabs(number_in(&state->bank, lane, AT_PARAMETERS + k) - HEALTHY[k]);
        const double variance = covariance_in(&state->bank, lane, AT_PARAMETERS + k, AT_PARAMETERS + k) / ranking->share;
        const double odds = odds_healthy(off, fmax(MOVES_BY * ACCURACY[k], HEALTHY_CHANGE[k]), CHANGE[k], variance);
        if (!(odds < least)) continue;
        least = odds;
        farthest = set;
    }
    const double healthy = farthest < 0 ? 1.0 : 1.0 / (1.0 + exp(-least));
    ranking->within += healthy * share;
    if (farthest >= 0) ranking->shared[farthest] += (1.0 - healthy) * share;
}

/* Share out what a hypothesis is worth, `share`, among itself and those of fewer suspects. */
static void share_out(const State *state, int64_t hypothesis, double share, Ranking *ranking)
{
    Suspect suspects[LARGEST_SET];
    double within[LARGEST_SET];
    const int64_t lane = ranking->best[hypothesis], n = judged_suspects(state, lane, suspects);
    for (int64_t i = 0; i < n; i++) within[i] = odds_within(state, lane, suspects, n, i, &ranking->given);
    for (unsigned kept = 0; kept < 1u << n; kept++) {
        double part = share;
        for (int64_t i = 0; i < n; i++) part /= 1.0 + exp(kept >> i & 1u ? within[i] : -within[i]);
        if (kept == 0) share_rest(state, lane, suspects, n, part, ranking);
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

FB_OFTEN

#endif
