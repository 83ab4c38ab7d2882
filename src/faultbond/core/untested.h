/* Sets that are too many to be tested: at most how likely it is that the truth is among them.

   What a set S of the reserve can be worth is bounded from each tested set T within it. Its likelihood is that of T,
   times what more suspects A = S - T can add, which is the larger of two things:

   - what T's best lane knows of A. The lane has a narrow prior N(m, D) for them and a posterior N(p, P), so the data's
     information is L = 1/P - 1/D, about (p - m), h = (p - m)/P, and with the wide prior N(m, W) of suspects

         log gain = (h' (L + 1/W)^-1 h - log det (I + L W) - h' (L + 1/D)^-1 h + log det (I + L D)) / 2

     exactly so where the plant is linear;
   - what is left to explain in T's lane: a sum s of its innovations over n samples is worth n (k + s/n)^2 / 2 nats, if
     these are a shift (k: drift of the sums). What the largest of m healthy sums may well be, log (2 m) / 2k, is worth
     nothing: each passes s with the probability exp (-2 k s), about.

   The bound holds if a tested set is near enough to the truth to tell what the others would add. So there is none
   soon after the bank was begun or renewed, where nothing explains the data, and where no step of a tested set is in
   the group: a drift, or a fault of an instrument, that imitates a large set says nothing about it. A bound of a
   half and more is none either. How often it is wrong is measured in docs/method.md.

   Couples of different kinds wait for the first renewals. A pair of parameters costs as much, so before that nobody knows of one that
   leads whether a couple is not likelier: they count among the untested sets, without a bound. */
#ifndef FB_UNTESTED_H
#define FB_UNTESTED_H

#include "growing.h"
#include "ranking.h"

FB_SELDOM

#define OPEN 0.5               /* a bound from which on there is none */
#define LEAST_SPREAD 1e-12     /* variance that is left, in that of the narrow prior */
#define SWEEPS 60

typedef double Square[LARGEST_SET][LARGEST_SET];

/* Sets of the reserve that are neither tested nor rejected, and what each can be worth; of tested sets their best
   lane, its likelihood, and what its sums leave to be explained, nats. */
typedef struct {
    uint8_t left[FB_ROOM(N_RESERVE)];
    double most[FB_ROOM(N_RESERVE)];
    int64_t best[FB_ROOM(N_SETS)];
    double likelihood[FB_ROOM(N_SETS)], unexplained[FB_ROOM(N_SETS)];
} Hidden;

/* Turn rows and columns p < q of a symmetric matrix so that their common entry vanishes, and the columns of
   `vectors`. */
static void rotate(int n, int p, int q, Square matrix, Square vectors)
{
    const double apart = (matrix[q][q] - matrix[p][p]) / (2.0 * matrix[p][q]);
    const double t = (apart < 0.0 ? -1.0 : 1.0) / (fabs(apart) + hypot(apart, 1.0));
    const double c = 1.0 / sqrt(t * t + 1.0), s = t * c;
    for (int k = 0; k < n; k++) {
        const double one = matrix[k][p], two = matrix[k][q];
        matrix[k][p] = c * one - s * two;
        matrix[k][q] = s * one + c * two;
    }
    for (int k = 0; k < n; k++) {
        const double one = matrix[p][k], two = matrix[q][k];
        matrix[p][k] = c * one - s * two;
        matrix[q][k] = s * one + c * two;
        const double first = vectors[k][p], second = vectors[k][q];
        vectors[k][p] = c * first - s * second;
        vectors[k][q] = s * first + c * second;
    }
    matrix[p][q] = matrix[q][p] = 0.0;
}

/* Leave the eigenvalues of a symmetric matrix on its diagonal; eigenvectors are the columns of `vectors`. Source:
   Golub and Van Loan, Matrix Computations, section 8.5 (cyclic Jacobi). */
static void find_eigenvectors(int n, Square matrix, Square vectors)
{
    for (int i = 0; i < n; i++)
        for (int j = 0; j < n; j++) vectors[i][j] = i == j;
    for (int sweep = 0; sweep < SWEEPS; sweep++) {
        int turned = 0;
        for (int p = 0; p < n; p++)
            for (int q = p + 1; q < n; q++) {
                const double size = sqrt(fabs(matrix[p][p])) * sqrt(fabs(matrix[q][q]));
                if (matrix[p][q] == 0.0 || fabs(matrix[p][q]) < 1e-17 * size) continue;
                rotate(n, p, q, matrix, vectors);
                turned = 1;
            }
        if (!turned) break;
    }
}

/* What more suspects would add to the likelihood of a tested set; in units in which their narrow prior is 1. off:
   posterior less prior means; spread: posterior covariance, which is changed; wide: variances of the wide prior. */
static double gain_of_members(int n, const double *off, Square spread, const double *wide)
{
    Square vectors, matrix;
    double told[LARGEST_SET], known[LARGEST_SET], vector[LARGEST_SET], narrow = 0.0, broad = 0.0, size = 0.0;
    for (int i = 0; i < n; i++) {
        if (!isfinite(off[i])) return -INFINITY;
        for (int j = 0; j < n; j++)
            if (!isfinite(spread[i][j])) return -INFINITY;
    }
    find_eigenvectors(n, spread, vectors);
    for (int j = 0; j < n; j++) {
        const double found = spread[j][j], most = 1.0 - LEAST_INFORMATION;
        const double value = found < LEAST_SPREAD ? LEAST_SPREAD : found > most ? most : found;
        told[j] = 0.0;
        for (int i = 0; i < n; i++) told[j] += vectors[i][j] * off[i] / value;
        known[j] = 1.0 / value - 1.0;
        narrow += 0.5 * (told[j] * told[j] * value + log(value));
    }
    for (int i = 0; i < n; i++) {
        vector[i] = 0.0;
        for (int j = 0; j < n; j++) vector[i] += vectors[i][j] * told[j];
        for (int k = 0; k < n; k++) {
            matrix[i][k] = i == k ? 1.0 / wide[i] : 0.0;
            for (int j = 0; j < n; j++) matrix[i][k] += vectors[i][j] * known[j] * vectors[k][j];
        }
    }
    for (int k = 0; k < n; k++) { /* L D L' of it: D gives the determinant, and the squares that make up the form */
        for (int i = k + 1; i < n; i++) {
            const double factor = matrix[i][k] / matrix[k][k];
            for (int j = k + 1; j < n; j++) matrix[i][j] -= factor * matrix[k][j];
            vector[i] -= factor * vector[k];
        }
        broad += vector[k] * vector[k] / matrix[k][k];
        size += log(fabs(matrix[k][k])) + log(wide[k]);
    }
    return 0.5 * (broad - size) - narrow;
}

/* What the sums of a lane leave to be explained, nats. */
static double left_to_explain(const Bank *bank, int64_t lane, int64_t index)
{
    const double usual = log(4.0 * N_OUTPUTS) / (2.0 * CUSUM_DRIFT);
    double total = 0.0;
    for (int j = 0; j < N_OUTPUTS; j++)
        total += left_at(bank, lane, j, usual, index);
    return total;
}

/* The best lane of each tested set. That of a rejected one is not asked for: with it all sets fall that contain it. */
static void find_bases(const Bank *bank, int64_t index, Hidden *hidden)
{
    for (int64_t set = 0; set < N_SETS; set++) {
        int64_t best = FIRST_LANE[set];
        double most = -INFINITY;
        for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++) {
            const double likelihood = of_step(bank, lane, PLAIN_LIKELIHOOD);
            if (!isfinite(likelihood) || !(likelihood > most)) continue;
            best = lane;
            most = likelihood;
        }
        hidden->best[set] = best;
        hidden->likelihood[set] = most;
        hidden->unexplained[set] = left_to_explain(bank, best, index);
    }
}

/* What one of the ways from a tested set to one of the reserve says its likelihood (in logarithm) is at most. */
static double most_by(const Bank *bank, const Ranking *ranking, const Hidden *hidden, int64_t extension)
{
    const int set = EXTENSION_SET[extension], n = EXTENSION_ROW[extension + 1] - EXTENSION_ROW[extension];
    const int *more = &EXTENSION_MEMBER[EXTENSION_ROW[extension]];
    const int64_t lane = hidden->best[set];
    double off[LARGEST_SET], wide[LARGEST_SET], scale[LARGEST_SET];
    Square spread;
    for (int i = 0; i < n; i++) {
        const int k = AT_PARAMETERS + more[i];
        const double mean = bank->healthy[k], own = bank->healthy[PLAIN_PLACE(k, k)];
        const double variance = own < 1e-300 ? 1e-300 : own;
        const double size = (HEALTHY[more[i]] != 0.0 ? fabs(mean) : 1.0) * CHANGE[more[i]];
        scale[i] = sqrt(variance);
        off[i] = (of_step(bank, lane, k) - mean) / scale[i];
        wide[i] = size * size / variance;
        for (int j = 0; j <= i; j++) {
            const int other = AT_PARAMETERS + more[j], low = k < other ? k : other, high = k < other ? other : k;
            spread[i][j] = spread[j][i] = of_step(bank, lane, PLAIN_PLACE(low, high)) / (scale[i] * scale[j]);
        }
    }
    const double most = hidden->likelihood[set] + larger(gain_of_members(n, off, spread, wide), hidden->unexplained[set]);
    return isfinite(most) ? coarse(ranking, most, 0) : most;
}

/* Probability that the truth is at most among the sets of the reserve that are left. */
static double untested_part(const Bank *bank, const Ranking *ranking, int64_t index, Hidden *hidden)
{
    double best = -INFINITY, best_step = -INFINITY, tested = ranking->within, rest = -INFINITY;
    for (int64_t k = 0; k < N_HYPOTHESES; k++) {
        best = larger(best, ranking->score[k]);
        best_step = larger(best_step, ranking->kinds[k][KIND_STEP] - COST[k]);
        tested = log_add(tested, ranking->score[k]);
    }
    if (best_step < best - GROUP_NATS) return 1.0;
    find_bases(bank, index, hidden);
    for (int64_t row = 0; row < N_RESERVE; row++) hidden->most[row] = -INFINITY;
    for (int64_t k = 0; k < N_EXTENSIONS; k++) {
        const int row = EXTENSION_RESERVE[k];
        if (hidden->left[row]) hidden->most[row] = larger(hidden->most[row], most_by(bank, ranking, hidden, k));
    }
    for (int64_t row = 0; row < N_RESERVE; row++) {
        if (!hidden->left[row]) continue;
        if (!isfinite(hidden->most[row])) return 1.0; /* not known */
        rest = log_add(rest, hidden->most[row] - COST[N_BEGUN + row]);
    }
    return exp(rest - log_add(rest, tested));
}

/* Couples that wait until the bank is renewed, where what leads has as many suspects; of those that are tested by then 0. */
static int64_t waiting_couples(const Bank *bank, const Ranking *ranking)
{
    const int64_t leading = leading_hypothesis(ranking);
    const int *members;
    int64_t n = 0;
    if (N_HYPOTHESES == 0 || members_of(leading, &members) < 2) return 0;
    for (int64_t row = 0; row < N_COUPLED; row++)
        if (bank->coupled[row] >= 0) return 0;
    for (int64_t couple = 0; couple < N_MIXED + N_BOTH; couple++) n += !bank->rejected[COUPLE_HYPOTHESIS[couple]];
    return n;
}

/* Write how many sets of the reserve are neither tested nor rejected, and a bound on their probability; 1: none.
   ranking: scores of the hypotheses that are not rejected; bounded: whether there may be a bound at all. */
static void find_untested(const Bank *bank, const Ranking *ranking, int64_t index, int bounded, Hidden *hidden,
                          Diagnosis *found)
{
    found->has_untested = N_RESERVE > 0;
    found->untested_sets = 0;
    found->untested_probability = N_RESERVE > 0 ? 0.0 : NAN;
    for (int64_t row = 0; row < N_RESERVE; row++) hidden->left[row] = !bank->rejected[N_BEGUN + row];
    for (int64_t k = 0; k < N_GROWN; k++)
        if (bank->grown[k] >= 0) hidden->left[bank->grown[k]] = 0;
    for (int64_t row = 0; row < N_RESERVE; row++) found->untested_sets += hidden->left[row];
    if (found->untested_sets > 0) {
        const double part = bounded ? untested_part(bank, ranking, index, hidden) : 1.0;
        found->untested_probability = part < OPEN ? part : 1.0;
    }
    const int64_t waiting = waiting_couples(bank, ranking);
    if (waiting == 0) return;
    found->has_untested = 1;
    found->untested_sets += waiting;
    found->untested_probability = 1.0;
}

FB_OFTEN

#endif
