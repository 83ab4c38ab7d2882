/* The reading side of the program for tests: bytes in portions, points out. As a program it takes cases from standard input. */
#include "reader.h"

#include <stdlib.h>

#ifdef __cplusplus
extern "C" {
#endif

typedef struct {
    int64_t n_points, has_failed, has_clock;
    Counts counts;
    char message[MESSAGE_ROOM];
} Outcome;

static Reader reader;

int64_t size_of_point(void) { return (int64_t)sizeof(Point); }
int64_t size_of_clock(void) { return (int64_t)sizeof(GridClock); }
int64_t size_of_outcome(void) { return (int64_t)sizeof(Outcome); }
double number_of(const char *text) { return number_in(text); }
double moment_of(char *text) { return moment_in(text_strip(text)); }

static void tell(const char *line) { fprintf(stderr, "faultbond: %s\n", line); }

/* Read a text of n bytes in portions of pseudo-random size up to `most`, from where `before` stood if it is not NULL; where
   `stops`, it ends by a stop behind the last byte. */
void read_text(const char *bytes, size_t n, size_t most, int stops, const GridClock *before, Point *points, size_t room,
               GridClock *after, Outcome *outcome)
{
    size_t at = 0;
    uint32_t state = 1;
    Point point;
    int got;
    memset(outcome, 0, sizeof *outcome);
    reader_begin(&reader, tell);
    if (before != NULL) reader_go_on(&reader, before);
    for (int last = 0; !last;) {
        state = state * 1664525u + 1013904223u;
        const size_t wanted = 1 + (state >> 8) % most, portion = wanted < n - at ? wanted : n - at;
        last = portion == n - at && !stops && (state & 128u || portion == 0);
        char *const given = (char *)malloc(portion + 1); /* of its own, so that a reading beyond it is seen */
        memcpy(given, bytes + at, portion);
        for (size_t taken = 0, done = 0; !done; done = taken == portion) {
            taken += reader_take(&reader, given + taken, portion - taken, last);
            if (last && taken == portion) last = 1;
            while ((got = reader_next(&reader, &point)) == READER_POINT) {
                if ((size_t)outcome->n_points < room) points[outcome->n_points] = point;
                outcome->n_points++;
            }
            if (got == READER_ERROR) break;
        }
        free(given);
        at += portion;
        if (got == READER_ERROR) break;
        if (stops && at == n) {
            reader_stop(&reader);
            last = 1;
            while ((got = reader_next(&reader, &point)) == READER_POINT) {
                if ((size_t)outcome->n_points < room) points[outcome->n_points] = point;
                outcome->n_points++;
            }
        }
    }
    outcome->has_failed = got == READER_ERROR;
    outcome->counts = reader_counts(&reader);
    outcome->has_clock = reader_clock(&reader, after);
    memcpy(outcome->message, reader.message, sizeof outcome->message);
}

#ifdef __cplusplus
}
#endif

#ifdef AS_PROGRAM
int main(void)
{
    static Point points[20000];
    const size_t room = sizeof points / sizeof *points;
    static GridClock clock;
    static Outcome outcome;
    uint32_t head[2];
    while (fread(head, sizeof head, 1, stdin) == 1) {
        char *const bytes = (char *)malloc(head[0] + 1u);
        if (bytes == NULL || fread(bytes, 1, head[0], stdin) != head[0]) return 1;
        read_text(bytes, head[0], head[1], 0, NULL, points, room, &clock, &outcome);
        free(bytes);
        const size_t n = (size_t)outcome.n_points < room ? (size_t)outcome.n_points : room;
        fwrite(&outcome, sizeof outcome, 1, stdout);
        fwrite(points, sizeof *points, n, stdout);
    }
    return 0;
}
#endif
