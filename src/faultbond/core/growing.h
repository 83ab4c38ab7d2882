/* Sets that are too many to be tested at once: which of them to test later, in lanes of their own.

   A lane knows more than its own set: every other parameter j has a narrow prior N(m, a^2) in it and a posterior
   N(p, v). What the data say of j beside this set is therefore known, an information l = 1/v - 1/a^2 about a change d,
   and so is how much likelier the data are if j is a suspect too, with the wide prior N(m, w^2) of one:

       log (likelihood with j / without) = (log (1 + l a^2) - log (1 + l w^2)
                                            + d^2 l (1 / (1 + l a^2) - 1 / (1 + l w^2))) / 2,      d = (p - m) / (v l)

   exactly so where the plant is linear. The likeliest sets of the reserve are then tested. Source: the ratio of
   evidences of nested Gaussian models, Kass and Raftery, J. American Statistical Association 90 (1995) 773. */
#ifndef FB_GROWING_H
#define FB_GROWING_H

#include "detector.h"
#include "steps.h"

#define NEUTRAL_SD 0.6         /* of the start at healthy values, in healthy factors */
#define LEAST_SD 0.1           /* of the others */
#define LEAST_INFORMATION 1e-9 /* in that of the narrow prior */

/* Three lanes of each set: from the closed form, where effort or flow goes on; the same, where the content does; and
   from healthy values. */
enum { AS_FOUND, WITH_JUMPS, FROM_HEALTHY };

/* A set of the reserve that is to be tested. */
typedef struct {
    int64_t set;     /* which it is, */
    double cost;     /* that of its suspects, less its likelihood; */
    int64_t row;     /* the lanes it has had, as a row of PER_SET; -1: none; */
    int64_t base;    /* the tested set from which it follows; -1: none; */
    int added;       /* and what that lacks */
    double value[FB_ROOM(LARGEST_SET)]; /* factors of its members to begin at */
} Choice;

FB_SELDOM

/* What the sums of a lane, steps first, leave to explain at a sensor, nats: s over n samples is worth n (k + s / n)^2 / 2. output -1:
   it is none. `least`: what a sum says that counts. */
static double left_at(const Bank *bank, int64_t lane, int output, double least, int64_t index)
{
    double most = 0.0;
    for (int side = 0; side < 2 && output >= 0; side++) {
        const double sum = bank->sums[side][output][lane];
        const double n = fmax((double)index - bank->since[side][output][lane], 1.0), shift = CUSUM_DRIFT + sum / n;
        if (sum > least) most = fmax(most, 0.5 * n * shift * shift);
    }
    return most;
}

/* What one more suspect would add to the likelihood of a lane, and its change. mean, variance: of its narrow prior; found, after:
   those that it has in the lane. */
static double gain_from(double mean, double variance, double found, double after, int index, double *change)
{
    const double least = LEAST_INFORMATION / variance;
    const double size = (HEALTHY[index] != 0.0 ? fabs(mean) : 1.0) * CHANGE[index], wide = size * size;
    const double told = 1.0 / after - 1.0 / variance, information = told < least ? least : told;
    const double off = (found - mean) / (after * information);
    const double narrow = 1.0 + information * variance, broad = 1.0 + information * wide;
    const double gain = 0.5 * (log(narrow) - log(broad) + off * off * information * (1.0 / narrow - 1.0 / broad));
    *change = bounded(off, -sqrt(wide), sqrt(wide));
    return isnan(gain) ? -INFINITY : bounded(gain, -FB_LARGEST, FB_LARGEST);
}

/* The same of a tested set, by its best lane. */
static double gain_of(Bank *bank, int64_t lane, int index, double *change)
{
    const int64_t k = AT_PARAMETERS + index;
    const double mean = bank->healthy[k], variance = bank->healthy[PLAIN_PLACE(k, k)];
    return gain_from(mean, variance, *number_of_step(bank, lane, k), *number_of_step(bank, lane, PLAIN_PLACE(k, k)), index, change);
}

/* A set of the reserve as a tested one with one more suspect, from the best of those it may come from; gives its
   likelihood by the closed form. `best`: likeliest lane of each tested set; `entry`: the first extension by one suspect
   of this set or a later one, to be moved on; the last of a set lacks the first of its members. */
static double extend(Bank *bank, const int64_t *best, int64_t *entry, Choice *choice)
{
    double likelihood = -INFINITY;
    const int64_t first = *entry;
    while (*entry < N_EXTENSIONS && EXTENSION_RESERVE[*entry] == choice->set &&
           EXTENSION_ROW[*entry + 1] - EXTENSION_ROW[*entry] == 1)
        ++*entry;
    choice->base = -1;
    for (int64_t e = *entry - 1; e >= first; e--) {
        const int64_t lane = best[EXTENSION_SET[e]];
        const int index = EXTENSION_MEMBER[EXTENSION_ROW[e]];
        double change;
        const double found = *number_of_step(bank, lane, PLAIN_LIKELIHOOD) + gain_of(bank, lane, index, &change);
        if (!(found > likelihood)) continue;
        likelihood = found;
        choice->base = EXTENSION_SET[e];
        choice->added = index;
    }
    return likelihood;
}

/* Likelihood of a lane for a set of the reserve; none where it is no number. */
static inline double likelihood_or_none(Bank *bank, int64_t lane)
{
    const double likelihood = *number_of_step(bank, lane, PLAIN_LIKELIHOOD);
    return isfinite(likelihood) ? likelihood : -INFINITY;
}

static inline int64_t lane_of_row(int64_t row) { return N_PLANNED + PER_SET * row; }

/* The likeliest lane of a row. */
static int64_t likeliest_of_row(Bank *bank, int64_t row)
{
    int64_t best = lane_of_row(row);
    for (int64_t lane = best + 1; lane < lane_of_row(row + 1); lane++)
        if (likelihood_or_none(bank, lane) > likelihood_or_none(bank, best)) best = lane;
    return best;
}

/* The row of lanes of a set of the reserve; -1: it has none that says anything. */
static int64_t row_of_set(Bank *bank, int64_t set)
{
    for (int64_t row = N_GROWN - 1; row >= 0; row--)
        if (bank->grown[row] == set && likelihood_or_none(bank, likeliest_of_row(bank, row)) > -INFINITY) return row;
    return -1;
}

/* The likeliest sets of the reserve, costs taken off, N_GROWN of them; of equals the first. `best`: likeliest lane of
   each tested set. A set that has lanes counts by what they say, one that was rejected not at all. */
static void choose_sets(Bank *bank, const int64_t *best, Choice *chosen)
{
    int64_t n = 0, entry = 0;
    while (entry < N_EXTENSIONS && EXTENSION_ROW[entry + 1] - EXTENSION_ROW[entry] != 1) entry++;
    for (int64_t set = 0; set < N_RESERVE; set++) {
        Choice choice = {set, 0.0, -1, -1, 0, {0.0}};
        double likelihood = extend(bank, best, &entry, &choice);
        if (bank->rejected[N_BEGUN + set]) likelihood = -INFINITY;
        else choice.row = row_of_set(bank, set);
        if (choice.row >= 0) likelihood = likelihood_or_none(bank, likeliest_of_row(bank, choice.row));
        choice.cost = COST[N_BEGUN + set] - likelihood;
        int64_t at = n;
        while (at > 0 && choice.cost < chosen[at - 1].cost) at--;
        if (at == N_GROWN) continue;
        if (n < N_GROWN) n++;
        for (int64_t k = n - 1; k > at; k--) chosen[k] = chosen[k - 1];
        chosen[at] = choice;
    }
}

/* The factors at which a chosen set begins: those of its best lane, if it has any, else by the closed form. */
static void find_values(Bank *bank, const int64_t *best, Choice *choice)
{
    const int64_t tested = choice->base >= 0 ? best[choice->base] : -1;
    const int64_t lane = choice->row >= 0 ? likeliest_of_row(bank, choice->row) : tested;
    for (int64_t e = RESERVE_ROW[choice->set]; e < RESERVE_ROW[choice->set + 1]; e++) {
        const int64_t k = AT_PARAMETERS + RESERVE_MEMBER[e];
        double change = 0.0, *value = &choice->value[e - RESERVE_ROW[choice->set]];
        *value = lane >= 0 ? *number_of_step(bank, lane, k) : bank->healthy[k];
        if (choice->row >= 0 || choice->base < 0 || choice->added != RESERVE_MEMBER[e]) continue;
        (void)gain_of(bank, lane, choice->added, &change);
        *value = bank->healthy[k] + change;
    }
}

/* Let two rows of lanes change places, after sample `index`. */
static void swap_rows(Bank *bank, int64_t one, int64_t two, int64_t index)
{
    if (N_GROWN == 0) return; /* said to compilers: there are no such lanes */
    for (int64_t part = 0; part < PER_SET; part++) {
        const int64_t a = lane_of_row(one) + part, b = lane_of_row(two) + part;
        const int64_t onset = bank->onset[a];
        begin_misfit_again(bank, a, index);
        begin_misfit_again(bank, b, index);
        bank->onset[a] = bank->onset[b];
        bank->onset[b] = onset;
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) {
            const double kept = *number_of_step(bank, a, k);
            *number_of_step(bank, a, k) = *number_of_step(bank, b, k);
            *number_of_step(bank, b, k) = kept;
        }
    }
}

/* Bring the lanes that chosen sets have had to the rows that they have now. */
static void order_rows(Bank *bank, const Choice *chosen, int64_t index)
{
    int64_t stands[FB_ROOM(N_GROWN)]; /* where each row was before */
    for (int64_t row = 0; row < N_GROWN; row++) stands[row] = row;
    for (int64_t row = 0; row < N_GROWN; row++) {
        int64_t now = 0;
        if (chosen[row].row < 0) continue;
        while (stands[now] != chosen[row].row) now++;
        if (now == row) continue;
        swap_rows(bank, row, now, index);
        stands[now] = stands[row];
        stands[row] = chosen[row].row;
    }
}

/* The start of a suspect at a factor, or, of lanes that begin there, at the healthy one. */
static void start_about(int index, double factor, int64_t part, const double *healthy, double *value, double *sd)
{
    const double reference = healthy[AT_PARAMETERS + index];
    const int additive = HEALTHY[index] == 0.0;
    if (part == FROM_HEALTHY) {
        *value = additive ? 0.0 : 1.0;
        *sd = additive || CHANGE[index] < NEUTRAL_SD ? CHANGE[index] : NEUTRAL_SD;
    } else {
        *value = additive ? factor - reference : factor / (reference == 0.0 ? 1.0 : reference);
        const double spread = FOUND_SPREAD * fabs(*value);
        *sd = spread < LEAST_SD ? LEAST_SD : spread;
    }
}

/* The start of one of the lanes of a set of the reserve at these factors; `healthy`: lane of the healthy plant. */
static void start_of_choice(int64_t set, const double *factors, int64_t part, const double *healthy, Start *start)
{
    const int64_t first = RESERVE_ROW[set];
    start->n = RESERVE_ROW[set + 1] - first;
    start->tied = start->all_along = 0;
    for (int64_t s = 0; s < start->n; s++) {
        const int index = RESERVE_MEMBER[first + s];
        start->parameter[s] = index;
        start_about(index, factors[s], part, healthy, &start->value[s], &start->sd[s]);
    }
    for (int64_t i = 0; i < N_STATES; i++) {
        start->jumps[i] = 0;
        for (int64_t e = JUMP_ROW[i]; part == WITH_JUMPS && e < JUMP_ROW[i + 1]; e++)
            for (int64_t s = 0; s < start->n; s++)
                if (JUMP_PARAMETER[e] == start->parameter[s]) start->jumps[i] = 1;
    }
}

/* Choose the sets of the reserve that are tested from now on, after sample `index`: the factors at which they begin. Sets that
   are tested already keep their lanes; those of new ones say nothing until they begin. */
static void choose_reserve(Bank *bank, int64_t index, double (*factors)[FB_ROOM(LARGEST_SET)], int64_t *best)
{
    Choice chosen[FB_ROOM(N_GROWN)];
    for (int64_t set = 0; set < N_SETS; set++) best[set] = likeliest_lane(bank, set);
    choose_sets(bank, best, chosen);
    for (int64_t row = 0; row < N_GROWN; row++) find_values(bank, best, &chosen[row]);
    order_rows(bank, chosen, index);
    for (int64_t row = 0; row < N_GROWN; row++) {
        bank->grown[row] = chosen[row].set;
        memcpy(factors[row], chosen[row].value, sizeof chosen[row].value);
        for (int64_t part = 0; part < PER_SET && chosen[row].row < 0; part++)
            *number_of_step(bank, lane_of_row(row) + part, PLAIN_LIKELIHOOD) = -INFINITY;
    }
}

/* Lanes of sets of the reserve in the order in which they begin: those whose stores jump, which begin twice, last. */
static inline int64_t reserve_lane(int64_t k)
{
    const int64_t calm = N_GROWN * (PER_SET - 1);
    if (k >= calm) return lane_of_row(k - calm) + WITH_JUMPS;
    return lane_of_row(k / (PER_SET - 1)) + (k % (PER_SET - 1) ? FROM_HEALTHY : AS_FOUND);
}

/* A lane in the place of the same lane of a set of the reserve, if it is likelier. */
static int replace_grown(Bank *bank, int64_t lane, double (*group)[GROUP], int64_t l)
{
    return group[PLAIN_LIKELIHOOD][l] > likelihood_or_none(bank, lane) && replace_lane(bank, lane, group, l, PLAIN_NUMBERS);
}

FB_OFTEN

#endif
