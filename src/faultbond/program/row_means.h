/* Rows averaged for the samples that they are nearest to, in the order of arrival.

   A reading that jumps among the rows of one sample, as at the moment at which something breaks, has a mean at which the
   plant never was: to the filter it would be far off by what a mean scatters. So it is left out, which costs one sample. */
#ifndef WATCH_ROW_MEANS_H
#define WATCH_ROW_MEANS_H

#include "point.h"

#define MEANS_TOO_SELDOM 1.5     /* times the stated time between rows that their usual one may be */
#define MEANS_FIRST_ROWS 20      /* by which it is judged */
#define MEANS_JUMP 4.0           /* standard deviations by which a jump must explain the rows better than a straight line */
#define MEANS_LEAST_ROWS 5       /* of a sample in which a jump is looked for */
#define MEANS_SCATTER_ROWS 1000.0 /* over which the scatter from row to row is a mean */
#define MEANS_KNOWN_ROWS 100     /* from which on it is known well enough for a jump to be seen */
#define MEANS_ON_GRID 1e-6       /* of a sample; a row that is so near to its begin is at it */
#define MEANS_ROUNDING 1e-24     /* of the square of a value: what is less is no jump */
#define MEANS_WAITING 4          /* samples that wait for what acts until the next one; there are 2 at most */
#define MEANS_ROOM (MEANS_WAITING + 2) /* rows that one row may complete, itself among them */

/* Sums of the numbers in each column of some rows, and how many there are. */
typedef struct {
    double u[FB_ROOM(N_INPUTS)], n[FB_ROOM(N_INPUTS)];
} InputSums;

/* The rows of a sample. last: their last readings. square: half the squares of steps from row to row, added, and
   the largest; n_steps: how many there are. */
typedef struct {
    int64_t n, saturated, line;
    InputSums inputs;
    double y_sum[FB_ROOM(N_OUTPUTS)], n_y[FB_ROOM(N_OUTPUTS)], last[FB_ROOM(N_OUTPUTS)];
    double square[FB_ROOM(N_OUTPUTS)], largest[FB_ROOM(N_OUTPUTS)], n_steps[FB_ROOM(N_OUTPUTS)];
} Gathered;

/* origin: s, time of a sample; nan: that of the first row. index: number of the sample that is gathered, whole; nan: none.
   y: readings of the first MEANS_KEPT rows of the sample. slot: number of the sample from which on the last rows were gathered, and `since` their inputs. made: samples that wait
   for the mean of what acts until the next one. scatter: variance of each sensor from row to row; learned: of how many. */
typedef struct {
    double origin, index, first, last, slot;
    int64_t seen;
    Gathered rows;
    double y[FB_ROOM(N_OUTPUTS)][MEANS_KEPT];
    InputSums since;
    TableRow made[MEANS_WAITING];
    int n_made;
    double scatter[FB_ROOM(N_OUTPUTS)], learned[FB_ROOM(N_OUTPUTS)];
} RowMeans;

static inline int means_hold_inputs(void)
{
    int any = 0;
    for (int k = 0; k < N_INPUTS; k++) any = any || INPUT_HELD[k];
    return any;
}

static inline void means_begin(RowMeans *means, double origin)
{
    memset(means, 0, sizeof *means);
    means->origin = origin;
    means->index = NAN;
    means->first = NAN;
    means->last = -INFINITY;
}

static inline void sums_begin(InputSums *sums) { memset(sums, 0, sizeof *sums); }

static inline void sums_add(InputSums *sums, const double *u)
{
    for (int k = 0; k < N_INPUTS; k++) {
        if (!isfinite(u[k])) continue;
        sums->u[k] += u[k];
        sums->n[k] += 1.0;
    }
}

static inline double sums_mean(const InputSums *sums, int k) { return sums->n[k] > 0.0 ? sums->u[k] / sums->n[k] : NAN; }

/* Add a row to those of a sample. */
static inline void gather_row(RowMeans *means, const TableRow *row)
{
    Gathered *const rows = &means->rows;
    if (rows->n == 0) rows->line = row->line;
    rows->saturated += row->saturated;
    sums_add(&rows->inputs, row->u);
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double y = row->y[j], step = y - rows->last[j], square = step * step / 2.0;
        if (rows->n > 0 && isfinite(square)) {
            rows->square[j] += square;
            rows->n_steps[j] += 1.0;
            if (square > rows->largest[j]) rows->largest[j] = square;
        }
        if (isfinite(y)) {
            rows->y_sum[j] += y;
            rows->n_y[j] += 1.0;
        }
        rows->last[j] = y;
        if (rows->n < MEANS_KEPT) means->y[j][rows->n] = y;
    }
    rows->n++;
}

/* By how much the squares of n values are less about two levels, of which one follows the other, than about a line. */
static inline double jump_of(const double *y, int64_t n)
{
    double mean = 0.0, along = 0.0, squares = 0.0, first = 0.0, by_levels = 0.0;
    for (int64_t k = 0; k < n; k++) mean += y[k];
    mean /= (double)n;
    for (int64_t k = 0; k < n; k++) {
        const double place = (double)k - ((double)n - 1.0) / 2.0;
        along += place * (y[k] - mean);
        squares += place * place;
    }
    for (int64_t k = 1; k < n; k++) {
        first += y[k - 1] - mean;
        const double less = first * first * (double)n / (double)(k * (n - k));
        if (less > by_levels) by_levels = less;
    }
    return by_levels - along * along / squares;
}

/* The mean of a sensor's readings in a sample, nan if they jump by more than their scatter; learn that. A sample of more than
   MEANS_KEPT rows, several times what the model file says, is not judged. */
static inline double steady_mean(RowMeans *means, int j)
{
    Gathered *const rows = &means->rows;
    double *const scatter = &means->scatter[j], *const learned = &means->learned[j];
    double found = rows->n_y[j] > 0.0 ? rows->y_sum[j] / rows->n_y[j] : NAN;
    const int is_whole = rows->n_y[j] == (double)rows->n && rows->n >= MEANS_LEAST_ROWS && rows->n <= MEANS_KEPT;
    if (is_whole && *learned >= MEANS_KNOWN_ROWS) {
        const double noise = fmax(*scatter, MEANS_ROUNDING * found * found);
        if (jump_of(means->y[j], rows->n) > MEANS_JUMP * MEANS_JUMP * noise) {
            found = NAN; /* what is left without the jump teaches: a sensor may have been still for long */
            rows->square[j] -= rows->largest[j];
            rows->n_steps[j] -= 1.0;
        }
    }
    *learned += rows->n_steps[j];
    if (rows->n_steps[j] <= 0.0) return found;
    const double most = fmin(fmax(*learned, 1.0), MEANS_SCATTER_ROWS);
    *scatter += (rows->square[j] / rows->n_steps[j] - *scatter) * fmin(rows->n_steps[j] / most, 1.0);
    return found;
}

/* Put the mean of the rows that were gathered last into `mean`, and forget them; 0 where there are none. */
static inline int mean_about(RowMeans *means, TableRow *mean)
{
    Gathered *const rows = &means->rows;
    if (rows->n == 0) return 0;
    mean->time = means->origin + means->index * READ_STEP;
    for (int k = 0; k < N_INPUTS; k++) mean->u[k] = sums_mean(&rows->inputs, k);
    for (int j = 0; j < N_OUTPUTS; j++) mean->y[j] = steady_mean(means, j);
    mean->saturated = rows->saturated;
    mean->line = rows->line;
    memset(rows, 0, sizeof *rows);
    return 1;
}

/* Refuse a recording whose first rows come too seldom; gives whether they do not. */
static inline int judge_pace(RowMeans *means, const TableRow *row, char *message)
{
    if (means->seen == 0) means->first = row->time;
    means->seen++;
    const double usual = (row->time - means->first) / (MEANS_FIRST_ROWS - 1);
    if (means->seen != MEANS_FIRST_ROWS || !(usual > MEANS_TOO_SELDOM * READ_ROW_TIME)) return 1;
    (void)snprintf(message, MESSAGE_ROOM,
                   "line %lld: the rows come every %.6g s, but by the model file every %g s, so their means have more noise than it "
                   "says. Mend `row_time`, or remove it.",
                   (long long)row->line, usual, READ_ROW_TIME);
    return 0;
}

/* Whether the clock was set back before a row. */
static inline int is_set_back(const RowMeans *means, const TableRow *row)
{
    return row->time < means->last - READ_STEP * MEANS_FIRST_ROWS;
}

/* Take one row, and put what is complete with it into `done`: the mean of a sample, or the row itself where its time cannot
   be read or is older than the sample that is gathered, which the grid knows what to do with. Gives how many: 0 or 1, or -1
   and a message where rows come too seldom. *is_row: whether it is the row. */
static inline int gather(RowMeans *means, const TableRow *row, TableRow *done, int *is_row, char *message)
{
    *is_row = 0;
    if (!isfinite(row->time) || row->time == means->last) {
        *is_row = 1;
        *done = *row;
        return 1;
    }
    if (isnan(means->origin)) means->origin = row->time;
    const double index = floor((row->time - means->origin) / READ_STEP + 0.5);
    if (index < means->index) {
        if (!is_set_back(means, row)) {
            *is_row = 1;
            *done = *row;
            return 1;
        }
        const int n = mean_about(means, done);
        means->origin = means->last = row->time;
        means->index = 0.0;
        gather_row(means, row);
        return n;
    }
    const int n = index != means->index ? mean_about(means, done) : 0;
    means->index = index;
    means->last = fmax(means->last, row->time);
    gather_row(means, row);
    return judge_pace(means, row, message) ? n : -1;
}

/* Put samples before a time that wait for what acts until the next one into `done`; of whom that is known, with it. Gives how
   many. */
static inline int give_acted(RowMeans *means, double before, double origin, double slot, TableRow *done)
{
    int n = 0, kept = 0;
    while (n < means->n_made && means->made[n].time < before - MEANS_ON_GRID * READ_STEP) n++;
    for (int m = 0; m < n; m++) {
        done[m] = means->made[m];
        if (!(fabs(done[m].time - (origin + slot * READ_STEP)) < 0.5 * READ_STEP)) continue;
        for (int k = 0; k < N_INPUTS; k++) {
            const double mean = sums_mean(&means->since, k);
            if (INPUT_HELD[k] && isfinite(mean)) done[m].u[k] = mean;
        }
    }
    for (int m = n; m < means->n_made; m++) means->made[kept++] = means->made[m];
    means->n_made = kept;
    return n;
}

/* Take one row, and put what is complete with it into `done`, MEANS_ROOM rows. Gives how many, or -1 and a message. An input
   that stays where it is until the next sample acts between the two: of such a one the mean is that of the rows from this
   sample on up to the next, and the sample is given when that has come. */
static inline int means_push(RowMeans *means, const TableRow *row, TableRow *done, char *message)
{
    TableRow found;
    int is_row;
    const int begins = isnan(means->origin) || is_set_back(means, row);
    const int n_found = gather(means, row, &found, &is_row, message);
    if (n_found < 0) return -1;
    if (!means_hold_inputs() || isnan(means->origin) || is_row) {
        if (n_found > 0) done[0] = found;
        return n_found;
    }
    if (begins) {
        int n = give_acted(means, INFINITY, means->origin, means->slot, done);
        if (n_found > 0) done[n++] = found;
        means->slot = 0.0;
        sums_begin(&means->since);
        sums_add(&means->since, row->u);
        return n;
    }
    if (n_found > 0 && means->n_made < MEANS_WAITING) means->made[means->n_made++] = found;
    const double slot = floor((row->time - means->origin) / READ_STEP + MEANS_ON_GRID);
    const double begin = means->origin + slot * READ_STEP;
    const int n = slot > means->slot ? give_acted(means, begin, means->origin, means->slot, done) : 0;
    if (slot != means->slot) sums_begin(&means->since);
    sums_add(&means->since, row->u);
    means->slot = slot;
    return n;
}

/* Put what was gathered last into `done`, if there is any; gives how many rows. */
static inline int means_finish(RowMeans *means, TableRow *done)
{
    TableRow found;
    if (mean_about(means, &found) && means->n_made < MEANS_WAITING) means->made[means->n_made++] = found;
    return give_acted(means, INFINITY, means->origin, means->slot, done);
}

#endif
