/* Rows of standard input, put on the grid of times at which the engine steps.

   Nothing about a row's time is an error: rows may be missing, late, repeated or between two grid points, and the clock may
   be set; each case has one defined outcome that is counted. A row serves its grid point at once, and a later row for the same
   point is not used; only where rows that came without gaps lack one, it waits until that has come or is too late. Where the
   clock was set back, or rows are absent for long, the grid begins anew at the next row. Source: docs/commands.md. */
#ifndef WATCH_GRID_H
#define WATCH_GRID_H

#include "frozen.h"

#define GRID_PATIENCE 5    /* rows that wait, in order, for one that is absent before them */
#define GRID_MAX_GAP 600   /* grid points without a row that are given; after more of them the grid begins anew */
#define GRID_GAP 1.5       /* usual intervals between two rows beyond which one between them is absent */
#define GRID_LATEST 253402300799.0 /* s, in Unix seconds the end of the year 9999; beyond, time was not given in seconds */
#define GRID_CLOCK_ROWS 10 /* rows in a row that are too old, and go on from each other: the clock was set back */
#define GRID_SERVED (GRID_PATIENCE + GRID_CLOCK_ROWS + 1) /* rows that one row may let go: all that wait and were too old */

#define GRID_ERROR (-1)

/* A row that waits for its place. */
typedef struct {
    TableRow row;
    int is_late;
} WaitingRow;

/* A row at its grid point, `index`, and the number of the first point that is to be given: of those before it, empty, too. */
typedef struct {
    int64_t first, index, began, resumes;
    double start, time, dt;
    int place; /* of the row, among those placed */
} ServedRow;

/* waiting: in the order of time. newest: time of the newest row. behind: the last rows, if they are too old and go on from each
   other. placed: the last rows placed, a ring in which the next one goes to `next_place`. has_origin, origin_index,
   origin_time: the point at which the grid began. usual: interval of rows before it began anew. passed: rows up to this time
   were passed by an earlier grid. n_rows, n_dropped, n_again: rows with a time that were taken since the grid began, those of
   them that came too late to be used, and those that have the time of another row. served: rows whose points are to be given, of which `n_given` are. */
typedef struct {
    Counts counts;
    Frozen frozen;
    WaitingRow waiting[GRID_PATIENCE + 1];
    TableRow behind[GRID_CLOCK_ROWS];
    TableRow placed[LAST_ROWS];
    ServedRow served[GRID_SERVED];
    int n_waiting, n_behind, n_placed, next_place, n_served, n_given;
    int has_origin, has_begun;
    int64_t n_rows, n_dropped, n_again;
    int64_t origin_index, last_index, n_firsts;
    double newest, origin_time, usual, last_time, passed;
    uint64_t firsts[KEPT_FIRSTS];
} Grid;

static inline void grid_begin(Grid *grid)
{
    memset(grid, 0, sizeof *grid);
    frozen_begin(&grid->frozen);
    grid->newest = -INFINITY;
    grid->passed = -INFINITY;
    grid->last_index = -1;
    grid->last_time = NAN;
}

/* Go on from where an earlier grid stood. */
static inline void grid_go_on(Grid *grid, const GridClock *clock)
{
    grid->counts = clock->counts;
    grid->n_placed = (int)clock->n_placed;
    grid->next_place = grid->n_placed % LAST_ROWS;
    memcpy(grid->placed, clock->placed, (size_t)clock->n_placed * sizeof *grid->placed);
    grid->newest = grid->placed[grid->n_placed - 1].time;
    grid->has_origin = 1;
    grid->origin_index = clock->origin_index;
    grid->origin_time = clock->origin_time;
    grid->usual = clock->usual;
    grid->last_index = clock->last_index;
    grid->last_time = clock->last_time;
    memcpy(grid->frozen.last, clock->last_value, sizeof clock->last_value);
    memcpy(grid->frozen.finest, clock->finest, sizeof clock->finest);
    memcpy(grid->frozen.alike, clock->alike, sizeof clock->alike);
    grid->n_firsts = clock->n_firsts;
    memcpy(grid->firsts, clock->firsts, sizeof clock->firsts);
}

/* Row `k` of those placed last, the oldest first. */
static inline const TableRow *placed_row(const Grid *grid, int k)
{
    return &grid->placed[(grid->next_place + LAST_ROWS - grid->n_placed + k) % LAST_ROWS];
}

/* The time of the row that was placed last. */
static inline double placed_time(const Grid *grid) { return placed_row(grid, grid->n_placed - 1)->time; }

/* Where the grid stands, as if nothing were held back; 0 before the first point. */
static inline int grid_clock(const Grid *grid, GridClock *clock)
{
    if (!grid->has_origin || grid->last_index < 0) return 0;
    memset(clock, 0, sizeof *clock);
    clock->counts = grid->counts;
    clock->n_placed = grid->n_placed;
    for (int k = 0; k < grid->n_placed; k++) clock->placed[k] = *placed_row(grid, k);
    clock->origin_index = grid->origin_index;
    clock->origin_time = grid->origin_time;
    clock->usual = grid->usual;
    clock->last_index = grid->last_index;
    clock->last_time = grid->last_time;
    memcpy(clock->last_value, grid->frozen.last, sizeof clock->last_value);
    memcpy(clock->finest, grid->frozen.finest, sizeof clock->finest);
    memcpy(clock->alike, grid->frozen.alike, sizeof clock->alike);
    clock->n_firsts = grid->n_firsts;
    memcpy(clock->firsts, grid->firsts, sizeof clock->firsts);
    return 1;
}

/* Whether all numbers are the same, nan like nan. */
static inline int are_same(const double *a, const double *b, int n)
{
    for (int k = 0; k < n; k++)
        if (!(a[k] == b[k] || (isnan(a[k]) && isnan(b[k])))) return 0;
    return 1;
}

/* Whether a row is another one once more. */
static inline int repeats(const TableRow *row, const TableRow *other)
{
    return row->time == other->time && are_same(row->u, other->u, N_INPUTS) && are_same(row->y, other->y, N_OUTPUTS);
}

/* Add a number to a hash, one byte after the other. Source: Fowler, Noll and Vo's FNV-1a. */
static inline uint64_t hash_number(uint64_t hash, double number)
{
    const double value = isnan(number) ? (double)NAN : number; /* there are many */
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (isnan(number)) bits = 0x7ff8000000000000ULL;
    for (int k = 0; k < 8; k++) hash = (hash ^ (bits >> (8 * k) & 0xFFu)) * 0x100000001b3ULL;
    return hash;
}

/* What tells a row from others: a clock that was set back repeats times, never a row to a digit. */
static inline uint64_t hash_row(const TableRow *row)
{
    uint64_t hash = hash_number(0xcbf29ce484222325ULL, row->time);
    for (int k = 0; k < N_INPUTS; k++) hash = hash_number(hash, row->u[k]);
    for (int j = 0; j < N_OUTPUTS; j++) hash = hash_number(hash, row->y[j]);
    return hash;
}

/* Note the first row that has a time; where a recording is given again, pass over what earlier grids had of it. */
static inline void note_first(Grid *grid, const TableRow *row)
{
    const uint64_t hash = hash_row(row);
    int64_t kept = 0;
    for (int64_t k = 0; k < grid->n_firsts; k++) {
        if (grid->firsts[k] == hash) grid->passed = grid->newest;
        if (grid->firsts[k] != hash) grid->firsts[kept++] = grid->firsts[k];
    }
    if (kept == KEPT_FIRSTS) memmove(grid->firsts, grid->firsts + 1, (size_t)--kept * sizeof *grid->firsts);
    grid->firsts[kept++] = hash;
    grid->n_firsts = kept;
    grid->has_begun = 1;
}

/* Mean interval of the last rows; 0 as long as they are few. */
static inline double usual_interval(const Grid *grid)
{
    const int n = grid->n_placed;
    return n >= GRID_CLOCK_ROWS ? (placed_time(grid) - placed_row(grid, 0)->time) / (n - 1) : 0.0;
}

/* Whether most rows have the time of another one, and the others are too few for the grid, if there is one. */
static inline int repeats_times(const Grid *grid)
{
    const double interval = usual_interval(grid), usual = interval != 0.0 ? interval : grid->usual;
    return 2 * grid->n_again > grid->n_rows && (READ_IS_VARIABLE || usual > GRID_GAP * READ_STEP || usual == 0.0);
}

/* Whether a time is that of one of the rows placed last, which are in order. */
static inline int was_placed(const Grid *grid, double time)
{
    if (grid->n_placed == 0 || time > placed_time(grid)) return 0;
    for (int k = 0; k < grid->n_placed; k++)
        if (placed_row(grid, k)->time == time) return 1;
    return 0;
}

/* Whether there is no place for a row any more, and it is not one of the last rows sent again. There is none either where a
   row that waits has its time and other values: the clock may have been set back by less than what rows wait. */
static inline int is_too_old(const Grid *grid, const TableRow *row)
{
    for (int k = 0; row->time < grid->newest && k < grid->n_waiting; k++) {
        const TableRow *const other = &grid->waiting[k].row;
        if (other->time == row->time && !repeats(other, row)) return 1;
    }
    if (grid->n_placed == 0 || !(row->time < placed_time(grid))) return 0;
    for (int k = 0; k < grid->n_placed; k++)
        if (repeats(row, placed_row(grid, k))) return 0;
    return 1;
}

/* Drop the rows that were too old; they were late after all, or repeats. */
static inline void give_up_behind(Grid *grid)
{
    for (int m = 0; m < grid->n_behind; m++) {
        int is_known = was_placed(grid, grid->behind[m].time);
        for (int k = 0; k < grid->n_waiting; k++) is_known = is_known || grid->waiting[k].row.time == grid->behind[m].time;
        grid->counts.duplicate += is_known;
        grid->counts.late += !is_known;
        grid->n_dropped += !is_known;
    }
    grid->n_behind = 0;
}

/* Forget where the grid began; the next row begins it. */
static inline void begin_anew(Grid *grid)
{
    const double interval = usual_interval(grid);
    if (interval != 0.0) grid->usual = interval;
    grid->n_placed = 0;
    grid->has_origin = 0;
}

/* Where a time lies on the grid, in points. */
static inline double grid_position(const Grid *grid, double time)
{
    return (double)grid->origin_index + (time - grid->origin_time) / READ_STEP;
}

/* Whether a row waits for one that is absent before it, as none has been of late. */
static inline int awaits(const Grid *grid, double time, int n_waiting)
{
    const double usual = usual_interval(grid);
    if (usual == 0.0 || READ_IS_VARIABLE || !grid->has_origin || n_waiting > GRID_PATIENCE) return 0;
    if (!(time - placed_time(grid) > GRID_GAP * usual)) return 0; /* a rate below the grid's leaves points empty, too */
    return grid_position(grid, time) >= (double)grid->last_index + 1.5;
}

/* Whether too much is absent before a row for the gap to be filled; GRID_ERROR where no row follows another. */
static inline int jumps(const Grid *grid, const TableRow *row, char *message)
{
    const double step = READ_IS_VARIABLE ? usual_interval(grid) : READ_STEP, before = placed_time(grid);
    const double gap = step != 0.0 ? (row->time - before) / step - 1.0 : 0.0; /* points without a row */
    if (!(gap > GRID_MAX_GAP)) return 0;
    const int64_t n_jumps = grid->counts.clock_jumps;
    if (n_jumps != grid->counts.samples - 1 || n_jumps < GRID_CLOCK_ROWS) return 1;
    (void)snprintf(message, MESSAGE_ROOM,
                   "line %lld: the time jumps from %.15g s to %.15g s, more than %d samples of %g s. Check the unit of the time "
                   "column and sample_time.",
                   (long long)row->line, before, row->time, GRID_MAX_GAP, step);
    return GRID_ERROR;
}

/* Let the empty points before `index`, if any, and the point of the row that was placed last be given. */
static inline void serve(Grid *grid, int64_t index, const TableRow *row)
{
    ServedRow *const served = &grid->served[grid->n_served++];
    const int64_t first = grid->last_index + 1, began = grid->origin_index;
    int is_complete = 1;
    served->first = first;
    served->index = index;
    served->began = began;
    served->start = grid->origin_time;
    served->resumes = index == began && began > 0;
    served->time = READ_IS_VARIABLE ? row->time : grid->origin_time + (double)(index - began) * READ_STEP;
    served->dt = READ_STEP;
    if (READ_IS_VARIABLE) served->dt = served->resumes ? grid->usual : served->time - grid->last_time;
    if (index == 0) served->dt = 0.0;
    served->place = (grid->next_place + LAST_ROWS - 1) % LAST_ROWS;
    grid->last_index = index;
    grid->last_time = served->time;
    for (int k = 0; k < N_INPUTS; k++) is_complete = is_complete && isfinite(row->u[k]);
    for (int j = 0; j < N_OUTPUTS; j++) is_complete = is_complete && isfinite(row->y[j]);
    grid->counts.samples += index - first + 1;
    grid->counts.missing += index - first + !is_complete;
    grid->counts.clock_jumps += served->resumes;
    grid->counts.saturated += row->saturated;
    grid->counts.frozen += frozen_add(&grid->frozen, row->y);
}

/* Assign a row to its grid point; rows come here in the order of time, each time once. 0 or GRID_ERROR. */
static inline int place_row(Grid *grid, const TableRow *row, char *message)
{
    const int is_jump = grid->has_origin ? jumps(grid, row, message) : 0;
    if (is_jump < 0) return GRID_ERROR;
    if (is_jump) begin_anew(grid);
    TableRow *const placed = &grid->placed[grid->next_place];
    *placed = *row;
    grid->next_place = (grid->next_place + 1) % LAST_ROWS;
    grid->n_placed += grid->n_placed < LAST_ROWS;
    if (!grid->has_origin) {
        grid->has_origin = 1;
        grid->origin_index = grid->last_index + 1;
        grid->origin_time = row->time;
    }
    const int64_t index =
        READ_IS_VARIABLE ? grid->last_index + 1 : (int64_t)floor(grid_position(grid, row->time) + 0.5);
    if (index <= grid->last_index)
        grid->counts.unused++;
    else
        serve(grid, index, placed);
    return 0;
}

/* Place a row that does not wait any more; those that come when later ones are placed are only counted. */
static inline int let_go(Grid *grid, const TableRow *row, int is_late, char *message)
{
    if (was_placed(grid, row->time)) {
        grid->counts.duplicate++;
        grid->n_again++;
        return 0;
    }
    grid->counts.late += is_late;
    if (grid->n_placed == 0 || row->time > placed_time(grid)) return place_row(grid, row, message);
    grid->n_dropped++;
    return 0;
}

/* Place the oldest waiting rows, but keep those that a row yet to come may precede; all where it is final. */
static inline int release(Grid *grid, int is_final, char *message)
{
    int n = 0, is_wrong = 0;
    while (!is_wrong && n < grid->n_waiting) {
        const WaitingRow *const oldest = &grid->waiting[n];
        if (!is_final && awaits(grid, oldest->row.time, grid->n_waiting - n)) break;
        is_wrong = let_go(grid, &oldest->row, oldest->is_late, message);
        n++;
    }
    grid->n_waiting -= n;
    memmove(grid->waiting, grid->waiting + n, (size_t)grid->n_waiting * sizeof *grid->waiting);
    return is_wrong;
}

/* Let a row wait for those that may precede it. At most GRID_PATIENCE do. */
static inline int take_row(Grid *grid, const TableRow *row, char *message)
{
    const int is_late = row->time < grid->newest;
    if (!is_late) grid->newest = row->time;
    if (grid->n_waiting == 0 && !awaits(grid, row->time, 1)) return let_go(grid, row, is_late, message);
    int k = grid->n_waiting++;
    for (; k > 0 && grid->waiting[k - 1].row.time > row->time; k--) grid->waiting[k] = grid->waiting[k - 1];
    grid->waiting[k].row = *row;
    grid->waiting[k].is_late = is_late;
    return release(grid, 0, message);
}

/* The clock was set back: the grid begins anew with the rows that were too old. */
static inline int set_clock_back(Grid *grid, char *message)
{
    int is_wrong = release(grid, 1, message);
    begin_anew(grid);
    grid->newest = -INFINITY;
    for (int k = 0; k < grid->n_behind && !is_wrong; k++) is_wrong = take_row(grid, &grid->behind[k], message);
    grid->n_behind = 0;
    return is_wrong;
}

/* Take one row; its points are given by grid_next. Gives 0, or GRID_ERROR and a message. */
static inline int grid_push(Grid *grid, const TableRow *row, char *message)
{
    const double reach = READ_IS_VARIABLE ? INFINITY : LAST_ROWS * READ_STEP;
    if (!(fabs(row->time) <= GRID_LATEST)) {
        grid->counts.untimed++;
        return 0;
    }
    if (!grid->has_begun) note_first(grid, row);
    if (row->time <= grid->passed) {
        grid->counts.duplicate++;
        return 0;
    }
    grid->passed = -INFINITY;
    grid->n_rows++;
    int is_wrong = 0;
    if (!is_too_old(grid, row)) {
        give_up_behind(grid);
        is_wrong = take_row(grid, row, message);
    } else {
        const double since = grid->n_behind > 0 ? row->time - grid->behind[grid->n_behind - 1].time : reach;
        if (!(since > 0.0 && since <= reach)) give_up_behind(grid); /* it does not follow the last one */
        grid->behind[grid->n_behind++] = *row;
        if (grid->n_behind == GRID_CLOCK_ROWS) is_wrong = set_clock_back(grid, message);
    }
    return is_wrong;
}

/* After the last row: let go what is held back. */
static inline int grid_finish(Grid *grid, char *message)
{
    give_up_behind(grid);
    return release(grid, 1, message);
}

/* Give the next point of the rows so far: 1, or 0 where there is none. */
static inline int grid_next(Grid *grid, Point *point)
{
    if (grid->n_given == grid->n_served) {
        grid->n_given = grid->n_served = 0;
        return 0;
    }
    ServedRow *const served = &grid->served[grid->n_given];
    const TableRow *const row = &grid->placed[served->place];
    const int is_row = served->first == served->index;
    point->index = served->first++;
    point->time = is_row ? served->time : served->start + (double)(point->index - served->began) * READ_STEP;
    point->dt = is_row ? served->dt : READ_STEP;
    point->resumes = is_row ? served->resumes : 0;
    for (int k = 0; k < N_INPUTS; k++) point->u[k] = is_row ? row->u[k] : NAN;
    for (int j = 0; j < N_OUTPUTS; j++) point->y[j] = is_row ? row->y[j] : NAN;
    grid->n_given += is_row;
    return 1;
}

#endif
