/* CSV text in, grid points out: all of the reading side behind ten functions, without allocation.

   static Reader reader;                                      (some 300 KiB: not on a stack)
   reader_begin(&reader, tell);                               (tell: takes lines that are said beside the points)
   reader_go_on(&reader, &clock);                             (only where a run is gone on from)
   for (int last = 0; !last;) {
       const long n = read(0, bytes, sizeof bytes);
       last = n <= 0;
       for (size_t taken = 0, done = 0; !done;) {
           taken += reader_take(&reader, bytes + taken, (size_t)n - taken, last);
           while ((got = reader_next(&reader, &point)) == READER_POINT) ...;
           if (got == READER_ERROR) ... reader.message, exit code 2;
           done = taken == (size_t)n;
       }
   }

   Points come in the order of `run -`, and those before an error come before it. What differs from `run`:
   - a record of more than CSV_ROOM bytes (256 KiB) is refused, and one of more than 100 lines before it ends;
   - letters between the seconds and a zone are not read;
   - a name that is meant is sought without regard to capitals in ASCII only, and shown as it is, printable or not;
   - a sample of more rows than MEANS_KEPT, four times those that the model file states and 64 at least, is not searched for
     a jump; means of rows are summed in their order, so that last digits may differ;
   - of lines that end with \r alone and hold a quoted line break, the lines are counted as they stand;
   - a row with which a recording began is known by a hash of 64 bits. */
#ifndef WATCH_READER_H
#define WATCH_READER_H

#include "grid.h"
#include "row_means.h"
#include "rows.h"

#define READER_WAITS 0  /* no point until more bytes come; after the last bytes: none any more */
#define READER_POINT 1
#define READER_ERROR (-1) /* reader->message is one line, without an end of line: what `run` says after "faultbond: " */

typedef enum { READING_HEADER, READING_ROWS, MEANS_ARE_LEFT, GRID_IS_LEFT, ALL_IS_READ } ReaderStage;

/* pending: means of rows that the grid has yet to take. stage: what is read next. */
typedef struct {
    Csv csv;
    Layout layout;
    RowMeans means;
    Grid grid;
    TableRow pending[MEANS_ROOM];
    int n_pending, n_pushed;
    ReaderStage stage;
    int is_stopped, has_failed, has_passed_over;
    char message[MESSAGE_ROOM];
} Reader;

/* Before the first byte. */
static inline void reader_begin(Reader *reader, void (*tell)(const char *line))
{
    csv_begin(&reader->csv);
    reader->layout.tell = tell;
    reader->layout.first_time = 0.0;
    means_begin(&reader->means, NAN);
    grid_begin(&reader->grid);
    reader->n_pending = reader->n_pushed = 0;
    reader->stage = READING_HEADER;
    reader->is_stopped = reader->has_failed = reader->has_passed_over = 0;
    reader->message[0] = '\0';
}

/* After reader_begin and before the first byte: go on from where an earlier reader stood. Without a column of time the clock
   goes on from there, too. */
static inline void reader_go_on(Reader *reader, const GridClock *clock)
{
    reader->layout.first_time = clock->last_time + READ_NUMBERED_STEP;
    means_begin(&reader->means, clock->origin_time);
    grid_go_on(&reader->grid, clock);
}

/* Take bytes as they come, any number of them, also 0; gives how many were taken. If fewer than n were, call reader_next
   until it gives READER_WAITS, then give it the rest. `last`: no more come after these n. */
static inline size_t reader_take(Reader *reader, const char *bytes, size_t n, int last)
{
    return reader->is_stopped || reader->has_failed ? n : csv_take(&reader->csv, bytes, n, last);
}

/* No more come, and what is read but not given is dropped, as where a person stops the run, or after an error; points that were held back come
   with the next calls of reader_next. No recording is then too short. */
static inline void reader_stop(Reader *reader)
{
    if (reader->stage < MEANS_ARE_LEFT) reader->stage = MEANS_ARE_LEFT;
    reader->is_stopped = 1;
    reader->has_failed = 0;
}

static inline int reader_fails(Reader *reader)
{
    reader->has_failed = 1;
    return 0;
}

/* Read the header, once it is there. Gives whether anything is to be done next. */
static inline int reader_read_header(Reader *reader)
{
    Csv *const csv = &reader->csv;
    CsvRecord record;
    int found = csv_find_delimiter(csv, reader->message);
    if (found == CSV_RECORD) found = csv_find_record(csv, &record, reader->message);
    if (found == CSV_WAITS && !csv->is_ended) return 0;
    if (found == CSV_ERROR || found == CSV_NO_ROW) return reader_fails(reader);
    if (layout_begin(&reader->layout, csv, found == CSV_RECORD ? &record : NULL, reader->message) == CSV_ERROR)
        return reader_fails(reader);
    csv_pass(csv, &record);
    reader->stage = READING_ROWS;
    return 1;
}

/* Pass over a record that is no row, and say so of the first; it counts as one without a time. Gives whether that is done: not
   where it is the first record, as then all of them are likely so. */
static inline int reader_passes_over(Reader *reader)
{
    if (reader->layout.count == 0) return 0;
    if (!reader->has_passed_over) {
        text_add(reader->message, MESSAGE_ROOM, " The line is passed over.", MESSAGE_ROOM);
        reader->layout.tell(reader->message);
    }
    reader->has_passed_over = 1;
    reader->layout.count++;
    reader->grid.counts.untimed++;
    return 1;
}

/* Read the next row, and pass it on. Gives whether anything is to be done next. */
static inline int reader_read_row(Reader *reader)
{
    TableRow row;
    const int found = read_row(&reader->layout, &reader->csv, &row, reader->message);
    if (found == CSV_NO_ROW) return reader_passes_over(reader) || reader_fails(reader);
    if (found == CSV_ERROR) return reader_fails(reader);
    if (found == CSV_WAITS) {
        if (!reader->csv.is_ended) return 0;
        reader->stage = MEANS_ARE_LEFT;
        if (reader->layout.count > 0) return 1;
        (void)snprintf(reader->message, MESSAGE_ROOM, "%s: there is no row below the header.", CSV_TITLE);
        return reader_fails(reader);
    }
    if (!READ_MEANS) return grid_push(&reader->grid, &row, reader->message) == 0 || reader_fails(reader);
    const int n = means_push(&reader->means, &row, reader->pending, reader->message);
    reader->n_pushed = 0;
    reader->n_pending = n > 0 ? n : 0;
    return n >= 0 || reader_fails(reader);
}

/* Do what is next, where no point is to be given. Gives whether anything is to be done after it. */
static inline int reader_go(Reader *reader)
{
    if (reader->n_pushed < reader->n_pending) {
        const TableRow *const mean = &reader->pending[reader->n_pushed++];
        return grid_push(&reader->grid, mean, reader->message) == 0 || reader_fails(reader);
    }
    switch (reader->stage) {
    case READING_HEADER:
        return reader_read_header(reader);
    case READING_ROWS:
        return reader_read_row(reader);
    case MEANS_ARE_LEFT:
        reader->n_pushed = 0;
        reader->n_pending = READ_MEANS ? means_finish(&reader->means, reader->pending) : 0;
        reader->stage = GRID_IS_LEFT;
        return 1;
    case GRID_IS_LEFT:
        reader->stage = ALL_IS_READ;
        return grid_finish(&reader->grid, reader->message) == 0 || reader_fails(reader);
    case ALL_IS_READ:
    default:
        return 0;
    }
}

/* Give the next point: READER_POINT, READER_WAITS or READER_ERROR, which then stays. */
static inline int reader_next(Reader *reader, Point *point)
{
    while (!grid_next(&reader->grid, point))
        if (reader->has_failed || !reader_go(reader)) return reader->has_failed ? READER_ERROR : READER_WAITS;
    return READER_POINT;
}

/* What has been passed so far, with what an earlier reader passed. */
static inline Counts reader_counts(const Reader *reader) { return reader->grid.counts; }

/* How many rows with a time were taken since this reader began, how many of them came too late to be used, and how many have the
   time of another row; those only where they are too many. */
static inline int64_t reader_rows(const Reader *reader) { return reader->grid.n_rows; }

static inline int64_t reader_dropped(const Reader *reader) { return reader->grid.n_dropped; }

static inline int64_t reader_again(const Reader *reader) { return repeats_times(&reader->grid) ? reader->grid.n_again : 0; }

/* Whether all points of the rows so far are given, so that the clock and the points are of one moment. It is so after each
   READER_WAITS, and between two points wherever the next one is of another row. */
static inline int reader_is_between_rows(const Reader *reader)
{
    return reader->n_pushed == reader->n_pending && reader->grid.n_given == reader->grid.n_served;
}

/* Where the grid stands, as if nothing were held back. Gives 0, and leaves the clock alone, before the first point. */
static inline int reader_clock(const Reader *reader, GridClock *clock) { return grid_clock(&reader->grid, clock); }

#endif
