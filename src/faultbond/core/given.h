/* What a healthy parameter is, given what others are. Accuracies may go together: of two inertias the ratio is known better
   than their common scale. A table says of each parameter those that go with it, TIE_PARAMETER, with their covariance and the
   entries of its inverse, which stand as declared, in factors.

   Given all others, a normal parameter k is known to 1 / sqrt(Q_kk), about its own mean less the sum of Q_kj / Q_kk times what
   the others are off, where Q is the inverse of the covariance. Source: Rue and Held, Gaussian Markov Random Fields, 2005,
   theorem 2.3. */
#ifndef FB_GIVEN_H
#define FB_GIVEN_H

#include "state.h"

/* Whether something goes with parameter k. */
static inline int is_tied(int k) { return TIE_ROW[k + 1] > TIE_ROW[k]; }

/* Entry of a table of ties for parameters k and j, which are not the same; 0 where they do not go together. */
static double tie_of(const double *table, int k, int j)
{
    for (int e = TIE_ROW[k]; e < TIE_ROW[k + 1]; e++)
        if (TIE_PARAMETER[e] == j) return table[e];
    return 0.0;
}

/* Declared covariance of two parameters, in factors. */
static double declared_covariance(int k, int j) { return k == j ? ACCURACY[k] * ACCURACY[k] : tie_of(TIE_COVARIANCE, k, j); }

/* Rows of the inverse of the declared covariance, of parameters that are looked at together. */
typedef struct {
    double row[FB_ROOM(LARGEST_SET)][FB_ROOM(N_PARAMETERS)];
} Given;

/* How parameter k, the first of n different ones, depends on all that are not among these: row[0][j] is by how much of what j
   is off it is off on the other side, 1 of itself, 0 of the n - 1 others, about which nothing is said. Gives its variance. */
static double depends_on(const int *chosen, int n, Given *given)
{
    const int k = chosen[0];
    for (int i = 0; i < n; i++)
        for (int j = 0; j < N_PARAMETERS; j++)
            given->row[i][j] = j == chosen[i] ? OWN_PRECISION[j] : tie_of(TIE_PRECISION, chosen[i], j);
    for (int i = n - 1; i > 0; i--) { /* the sum over what is not known: Schur's complement */
        const double *gone = given->row[i];
        for (int m = 0; m < i; m++) {
            const double part = given->row[m][chosen[i]] / gone[chosen[i]];
            for (int j = 0; part != 0.0 && j < N_PARAMETERS; j++) given->row[m][j] -= part * gone[j];
            given->row[m][chosen[i]] = 0.0;
        }
    }
    const double own = given->row[0][k];
    for (int j = 0; j < N_PARAMETERS; j++) given->row[0][j] /= own;
    return 1.0 / own;
}

#endif
