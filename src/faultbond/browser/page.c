/* The program `watch` as a library for a page of a browser: bytes of CSV in, records as lines of JSON out, and the samples
   as the plots show them. It needs nothing of the machine: what it says goes to three functions of the page.

   page_begin();                                            1, or 0 where the core is of another model
   page_take(n, is_last) for n bytes at page_room();        0, or 1 where the recording is refused: see page_text()
   page_end();                                              0 no fault, 1 a fault, 2 refused, 4 no verdict: see page_text() */
#define FB_APART
#include "model.h"

#include "fb.h"
#include "found.h"
#include "names.h"

#include "reader.h"

#include "course.h"

#define INPUT_ROOM 65536 /* bytes that are taken at a time */
#define SAMPLE_NUMBERS (2 + N_INPUTS + 4 * N_OUTPUTS + N_SLOW)

#define EXPORTED(name) __attribute__((export_name(name)))
#define IMPORTED(name) __attribute__((import_module("page"), import_name(name)))

IMPORTED("records") void page_records(const char *bytes, size_t n);
IMPORTED("samples") void page_samples(const double *numbers, int n);
IMPORTED("remark") void page_remark(const char *line);

static Plant the_plant;
static Reader the_reader;
static Course the_course;
static Out the_out;
static Json the_json = {&the_out, 0};
static char the_bytes[INPUT_ROOM];
static char the_reason[REASON_ROOM];
static const char *the_text = "";

/* Copy n numbers, and give where the next ones go. */
static double *put(double *to, const double *numbers, int n)
{
    for (int k = 0; k < n; k++) to[k] = numbers[k];
    return to + n;
}

/* Show samples: time, what the run is doing, inputs, readings, and of each sensor what is expected, its variance, and its
   largest sum; then the slow errors. */
static void show_samples(const Course *course, int first, int n)
{
    static double numbers[BLOCK * SAMPLE_NUMBERS];
    double *to = numbers;
    for (int k = 0; k < n; k++) {
        const Report *report = &course->reports[k];
        *to++ = course->times[first + k];
        *to++ = (double)report->status;
        to = put(to, course->inputs + (first + k) * N_INPUTS, N_INPUTS);
        to = put(to, course->readings + (first + k) * N_OUTPUTS, N_OUTPUTS);
        to = put(to, report->expected, N_OUTPUTS);
        to = put(to, report->variance, N_OUTPUTS);
        to = put(to, report->cusum, N_OUTPUTS);
        to = put(to, report->slow, N_SLOW);
    }
    page_samples(numbers, n);
}

EXPORTED("begin") int page_begin(void)
{
    out_begin(&the_out, NULL);
    the_out.hand = page_records;
    if (!plant_begin(&the_plant)) return 0;
    course_begin(&the_course, &the_plant, &the_json, NO_LEVEL);
    the_course.show = show_samples;
    reader_begin(&the_reader, page_remark);
    write_run(&the_json, NAN);
    return 1;
}

EXPORTED("room") char *page_room(void) { return the_bytes; }
EXPORTED("room_size") int page_room_size(void) { return INPUT_ROOM; }
EXPORTED("sample_numbers") int page_sample_numbers(void) { return SAMPLE_NUMBERS; }
EXPORTED("text") const char *page_text(void) { return the_text; }

/* Pass all points that are there; READER_WAITS or READER_ERROR. */
static int pass_points(void)
{
    static Point point;
    int got;
    while ((got = reader_next(&the_reader, &point)) == READER_POINT) {
        course_take(&the_course, &point);
        if (the_course.n == BLOCK) course_pass(&the_course);
    }
    course_pass(&the_course);
    return got;
}

EXPORTED("take") int page_take(int n, int is_last)
{
    size_t taken = 0;
    for (;;) {
        taken += reader_take(&the_reader, the_bytes + taken, (size_t)n - taken, is_last);
        if (pass_points() == READER_ERROR) {
            the_text = the_reader.message;
            return 1;
        }
        if (taken == (size_t)n) return 0;
    }
}

EXPORTED("end") int page_end(void)
{
    static const int codes[] = {0, 1, 4};
    const Counts counts = reader_counts(&the_reader);
    the_course.n_rows = reader_rows(&the_reader);
    the_course.n_dropped = reader_dropped(&the_reader);
    the_course.n_again = reader_again(&the_reader);
    course_finish(&the_course, &counts);
    if (!counts.samples) {
        the_text = NO_TIMES;
        return 2;
    }
    if (no_verdict(&the_course, counts.samples, the_reason)) the_text = the_reason;
    return codes[verdict_of(&the_course, counts.samples)];
}
