/* The program `watch`: rows of CSV on standard input, records as lines of JSON on standard output. It says what
   `faultbond run MODEL - --json -` says, with the same exit codes, and needs nothing but a C library.

   reader.h reads rows and puts them on the grid of times; course.h passes its points to the core (core/fb.h) and writes
   the records (records.h); keep.h keeps the run in a file. */
#include "system.h"

/* Sizes and tables of the model are needed here; its laws, and lanes side by side, are the core's. */
#define FB_APART
#undef FB_LANES
#define FB_LANES 1
#include "model.h"

#include "fb.h"
#include "found.h"
#include "names.h"

#include "reader.h"

#include "decision.h"

#include <stdlib.h>

enum { DONE = 0, FAULT_DETECTED = 1, USER_MISTAKE = 2, INTERNAL_ERROR = 3, NO_VERDICT = 4, SIGNALLED = 128, NOBODY_READS = 141 };

#define LOWEST_LEVEL 0.5 /* a diagnosis that is less likely than its opposite is accepted by no rule */

static const char HELP[] =
    "usage: watch [--state FILE] [--accept P] [--help] [--version] < rows.csv > records.jsonl\n"
    "       watch --state FILE accept [--repaired] [NAME...]\n"
    "       watch --state FILE reject NAME...\n"
    "\n"
    "Watches the plant \"%s\": reads rows of CSV on standard input, with a line of names first, and writes records as\n"
    "lines of JSON on standard output (see README.md).\n"
    "\n"
    "  --state FILE  go on from the run kept in this file, if it exists, and keep this\n"
    "  --accept P    accept a diagnosis once it has been at least as sure as this, such as 0.99, for a while; auto: %g\n"
    "  --help        show this and stop\n"
    "  --version     show the model and the version and stop\n"
    "  accept, reject  take a candidate of the run kept in FILE as the new normal (without names the best one), or rule it\n"
    "                  out; its parts or parameters are named; --repaired: it was the fault, and is mended\n"
    "\n"
    "Exit codes: 0 no fault; 1 a fault was detected; 2 a mistake in the command or the recording; 3 a defect of the\n"
    "program; 4 no verdict could be given; 130 stopped by Ctrl-C, 143 and 129 by the signals TERM and HUP.\n";

/* What is asked for. state: NULL: no run is kept. */
typedef struct {
    const char *state;
    double level;
    Decision decision;
    int is_over, code; /* whether the program ends at once, and with which exit code */
} Wishes;

static Reader the_reader;
static Course the_course;
static Keeper the_keeper;
static Out the_out;
static char the_bytes[INPUT_ROOM];

static void tell(const char *line) { fprintf(stderr, "faultbond: %s\n", line); }

static int complain(const char *what, const char *of)
{
    fprintf(stderr, "watch: %s%s\n", what, of);
    return USER_MISTAKE;
}

/* Read the probability from which a rule accepts; 0 where it is none. */
static int read_level(const char *text, double *level)
{
    char *end;
    if (strcmp(text, "auto") == 0) {
        *level = SURE;
        return 1;
    }
    *level = strtod(text, &end);
    return end != text && *end == '\0' && *level >= LOWEST_LEVEL && *level <= 1.0;
}

/* Read an option that stands alone; 0 where this is none. */
static int read_flag(Wishes *wishes, const char *name)
{
    if (strcmp(name, "--help") == 0 || strcmp(name, "-h") == 0) {
        printf(HELP, PLANT_NAME, SURE);
        wishes->is_over = 1;
    } else if (strcmp(name, "--version") == 0) {
        printf("watch of \"%s\", %s, made by faultbond %s\n", PLANT_NAME, PLANT_SHA256, FAULTBOND_VERSION);
        wishes->is_over = 1;
    } else if (strcmp(name, "--repaired") == 0 && wishes->decision.what == DECIDE_ACCEPT) {
        wishes->decision.what = DECIDE_REPAIRED;
    } else {
        return 0;
    }
    return 1;
}

/* Read an option with its value, which may lack; 0 where this is none, or a mistake, which is told. */
static int read_option(Wishes *wishes, const char *name, const char *value)
{
    const char *expected = ": --accept expects auto, or a probability from 0.5 to 1, such as 0.99";
    const int is_state = strcmp(name, "--state") == 0, is_accept = strcmp(name, "--accept") == 0;
    if (!is_state && !is_accept) {
        wishes->code = complain(name, ": there is no such argument. See --help.");
    } else if (!value) {
        wishes->code = complain(name, is_state ? ": name a file" : expected);
    } else if (is_accept && !read_level(value, &wishes->level)) {
        wishes->code = complain(value, expected);
    } else {
        if (is_state) wishes->state = value;
        return 1;
    }
    return 0;
}

/* Read names with commas between them; `flow.bias` is of `flow`. */
static void read_names(Decision *decision, char *word)
{
    for (char *name = strtok(word, ","); name != NULL; name = strtok(NULL, ",")) {
        name[strcspn(name, ".")] = '\0';
        if (decision->n_names < MOST_NAMES) decision->names[decision->n_names++] = name;
    }
}

/* Read a word of a decision: accept or reject, then names; 0 where this is none. */
static int read_decision(Decision *decision, char *word)
{
    const int is_accept = strcmp(word, "accept") == 0, is_reject = strcmp(word, "reject") == 0;
    if (word[0] == '-' || (decision->what == DECIDE_NOTHING && !is_accept && !is_reject)) return 0;
    if (decision->what == DECIDE_NOTHING) decision->what = is_accept ? DECIDE_ACCEPT : DECIDE_REJECT;
    else read_names(decision, word);
    return 1;
}

static Wishes read_arguments(int count, char **words)
{
    Wishes wishes;
    memset(&wishes, 0, sizeof wishes);
    wishes.level = NO_LEVEL;
    for (int k = 1; k < count && !wishes.is_over; k++) {
        if (read_decision(&wishes.decision, words[k]) || read_flag(&wishes, words[k])) continue;
        char *const value = strncmp(words[k], "--", 2) == 0 ? strchr(words[k], '=') : NULL;
        if (value != NULL) { /* --state=FILE */
            *value = '\0';
            wishes.is_over = !read_option(&wishes, words[k], value + 1);
            continue;
        }
        wishes.is_over = !read_option(&wishes, words[k], k + 1 < count ? words[k + 1] : NULL);
        k++;
    }
    if (wishes.is_over) return wishes;
    if (wishes.decision.what && !wishes.state) wishes.code = complain("--state", ": name the file that keeps the run");
    if (wishes.decision.what == DECIDE_REJECT && !wishes.decision.n_names)
        wishes.code = complain("reject", ": name the parts of a candidate");
    wishes.is_over = wishes.code != DONE;
    return wishes;
}

/* Whether nobody reads the records any more. */
static int is_output_closed(const Out *out) { return out->lost && out->error == EPIPE; }

/* Say that records cannot be written, the first time. */
static void mind_output(const Out *out)
{
    static int is_told;
    if (!out->lost || is_told || is_output_closed(out)) return;
    is_told = 1;
    fprintf(stderr, "faultbond: standard output: records cannot be written: %s.\n", strerror(out->error));
}

/* Keep the run, if that is due and the clock of the recording is of the same moment as the core. */
static void keep_now(Keeper *keeper, const Reader *reader, Course *course)
{
    static GridClock clock;
    if (!keeper->path || course->n || !is_keeping_due(keeper, &course->found)) return;
    if (reader_is_between_rows(reader) && reader_clock(reader, &clock)) keep_run(keeper, &clock, course, 0);
}

/* Pass all points that are there; READER_WAITS or READER_ERROR. */
static int pass_points(Reader *reader, Course *course, Keeper *keeper)
{
    static Point point;
    int got;
    while ((got = reader_next(reader, &point)) == READER_POINT) {
        course_take(course, &point);
        if (course->n < BLOCK) continue;
        course_pass(course);
        keep_now(keeper, reader, course);
    }
    course_pass(course);
    mind_output(course->json->out);
    if (got == READER_WAITS) keep_now(keeper, reader, course);
    return got;
}

/* Pass bytes of standard input; READER_WAITS or READER_ERROR. */
static int pass_bytes(Reader *reader, Course *course, Keeper *keeper, const char *bytes, size_t n, int is_last)
{
    size_t taken = 0;
    for (;;) {
        taken += reader_take(reader, bytes + taken, n - taken, is_last);
        const int got = pass_points(reader, course, keeper);
        if (got == READER_ERROR || taken == n || is_output_closed(course->json->out)) return got;
    }
}

/* Pass all rows, until there are no more, or a signal comes; exit code of an error, SIGNALLED and the signal's number, or 0. */
static int pass_all(Reader *reader, Course *course, Keeper *keeper)
{
    for (;;) {
        const long n = system_read(the_bytes, sizeof the_bytes);
        if (n == SYSTEM_STOPPED) {
            reader_stop(reader);
            (void)pass_points(reader, course, keeper);
            return SIGNALLED + system_signal();
        }
        if (n == SYSTEM_FAILED) {
            fprintf(stderr, "-: standard input cannot be read: %s.\n", strerror(errno));
            return USER_MISTAKE;
        }
        const int got = pass_bytes(reader, course, keeper, the_bytes, (size_t)n, n == 0);
        if (is_output_closed(course->json->out)) return NOBODY_READS;
        if (got == READER_ERROR) {
            fprintf(stderr, "%s\n", reader->message);
            reader_stop(reader);
            (void)pass_points(reader, course, keeper);
            return USER_MISTAKE;
        }
        if (n == 0) return DONE;
    }
}

/* Write the last records, and keep the run as it was before them. */
static void end_run(const Reader *reader, Course *course, Keeper *keeper)
{
    static GridClock clock;
    const Counts counts = reader_counts(reader);
    if (keeper->path && reader_clock(reader, &clock)) keep_run(keeper, &clock, course, 1);
    course->n_rows = reader_rows(reader);
    course->n_dropped = reader_dropped(reader);
    course->n_again = reader_again(reader);
    course_finish(course, &counts);
    mind_output(course->json->out);
    if (course->json->out->lost && !is_output_closed(course->json->out))
        fprintf(stderr, "faultbond: standard output: %lld record%s could not be written.\n", (long long)course->json->out->lost,
                plural(course->json->out->lost));
}

/* Say that no row is of use, and why. passed: rows that the run before had passed. */
static int no_rows(const Course *course, int64_t passed, double last_time)
{
    if (course->goes_on && passed)
        fprintf(stderr,
                "standard input: no row is later than %.15g s, where the saved run ended. Give a recording that goes on from there, or "
                "another state file.\n",
                last_time);
    else
        fprintf(stderr, NO_TIMES "\n");
    return USER_MISTAKE;
}

/* Say what the run is, and why it has no verdict where it has none; exit code. before: counts at its beginning. */
static int conclude_run(const Reader *reader, const Course *course, const Counts *before, double last_time)
{
    static const int codes[] = {DONE, FAULT_DETECTED, NO_VERDICT};
    const Counts counts = reader_counts(reader);
    char reason[REASON_ROOM];
    if (counts.samples == before->samples) return no_rows(course, counts.duplicate - before->duplicate, last_time);
    if (no_verdict(course, counts.samples, reason)) fprintf(stderr, "faultbond: no verdict: %s.\n", reason);
    else tell_silence(&course->presence);
    return codes[verdict_of(course, counts.samples)];
}

static int no_run(const char *path)
{
    fprintf(stderr, "%s: there is no such file. `watch --state %s` writes it.\n", path, path);
    return USER_MISTAKE;
}

/* Watch the plant, from the run that is kept, if one is; or decide of that. */
static int watch_plant(const Wishes *wishes, Plant *plant, Json *json)
{
    Found found;
    int goes_on;
    const int refused = keeper_begin(&the_keeper, wishes->state, &plant->memory, &found, &goes_on);
    if (refused) return refused;
    const double last_time = goes_on ? the_keeper.clock.last_time : NAN;
    course_begin(&the_course, plant, json, wishes->level);
    if (wishes->decision.what && !goes_on) return no_run(wishes->state);
    if (wishes->decision.what) return decide(&the_keeper, &wishes->decision, &the_course, &found);
    reader_begin(&the_reader, tell);
    if (goes_on) {
        reader_go_on(&the_reader, &the_keeper.clock);
        course_go_on(&the_course, last_time, &found);
    }
    const Counts before = reader_counts(&the_reader);
    write_run(json, last_time);
    const int code = pass_all(&the_reader, &the_course, &the_keeper);
    const int is_stopped = code == SIGNALLED + system_signal();
    if (code != DONE && !is_stopped && (code != USER_MISTAKE || reader_counts(&the_reader).samples == before.samples)) return code;
    end_run(&the_reader, &the_course, &the_keeper);
    if (is_output_closed(json->out)) return NOBODY_READS;
    return code != DONE ? code : conclude_run(&the_reader, &the_course, &before, last_time);
}

int main(int count, char **words)
{
    static Plant plant;
    Json json = {&the_out, 0};
    const Wishes wishes = read_arguments(count, words);
    if (wishes.is_over) return wishes.code;
    system_begin();
    out_begin(&the_out, stdout);
    if (!plant_begin(&plant)) {
        fprintf(stderr, "watch: internal error: the core is of another model or version than this program. Build all anew.\n");
        return INTERNAL_ERROR;
    }
    const int code = watch_plant(&wishes, &plant, &json);
    if (the_course.is_refused) {
        fprintf(stderr, "watch: internal error: the core refused a candidate that it had accepted.\n");
        return INTERNAL_ERROR;
    }
    return code;
}
