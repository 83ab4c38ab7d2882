/* CSV text in, grid points out: all of the reading side behind seven functions, without allocation.

   static Reader reader;                                      (some 300 KiB: not on a stack)
   reader_begin(&reader);
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

   Points come in the order of `run -`, and those before an error come before it. */
#ifndef WATCH_READER_H
#define WATCH_READER_H

#include <stddef.h>

#include "point.h"

#define READER_WAITS 0  /* no point until more bytes come; after the last bytes: none any more */
#define READER_POINT 1
#define READER_ERROR (-1) /* reader->message is one line, without an end of line: what `run` says after "faultbond: " */

typedef struct Reader Reader;

/* Before the first byte. */
static inline void reader_begin(Reader *reader);

/* After reader_begin and before the first byte: go on from where an earlier reader stood. Without a column of time the clock
   goes on from there, too. */
static inline void reader_go_on(Reader *reader, const GridClock *clock);

/* Take bytes as they come, any number of them, also 0; gives how many were taken. If fewer than n were, call reader_next
   until it gives READER_WAITS, then give it the rest. `last`: no more come after these n. */
static inline size_t reader_take(Reader *reader, const char *bytes, size_t n, int last);

/* No more come, and what is read but not given is dropped, as where a person stops the run; points that were held back come
   with the next calls of reader_next. No recording is then too short. */
static inline void reader_stop(Reader *reader);

/* Give the next point: READER_POINT, READER_WAITS or READER_ERROR, which then stays. */
static inline int reader_next(Reader *reader, Point *point);

/* What has been passed so far, with what an earlier reader passed. */
static inline Counts reader_counts(const Reader *reader);

/* Whether all points of the rows so far are given, so that the clock and the points are of one moment. It is so after each
   READER_WAITS, and between two points wherever the next one is of another row. */
static inline int reader_is_between_rows(const Reader *reader);

/* Where the grid stands, as if nothing were held back. Gives 0, and leaves the clock alone, before the first point. */
static inline int reader_clock(const Reader *reader, GridClock *clock);

#endif
