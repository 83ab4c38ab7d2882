/* The self-test on a board without an operating system: the recorded samples of check/samples.h pass through the library. Each
   alarm and diagnosis is told as a line of JSON, and at the end how much memory and time that took. The exit code is 0 where
   all is as `run` told of these samples: the alarm, the likeliest candidate and its probability. */
#include <string.h>

#include "../faultbond.h"
#include "../check/samples.h"

#include "say.h"
#include "stack.h"

/* The timer of the processor counts down from 2^24 - 1, a tick for each cycle. */
#define TIMER ((volatile uint32_t *)0xE000E010u) /* control, reload, now */
#define TIMER_ON 5u                              /* by the processor's clock, without interrupts */
#define TIMER_MOST 0xFFFFFFu

#define NEAR 1e-6 /* relative: a probability that is as expected */

static Report report;
static Diagnosis found;
static Saying saying;

int main(void);

static void say_key(const char *key, double value)
{
    say(&saying, key);
    say_number(&saying, value);
}

static void say_suspects(const Candidate *candidate)
{
    for (int64_t k = 0; k < candidate->n_suspects; k++) {
        say(&saying, k ? ", \"" : "\"");
        say(&saying, fb_suspect_name(&candidate->suspects[k]));
        say_key("\": ", candidate->suspects[k].estimate);
    }
}

static void say_diagnosis(double time)
{
    say_key("{\"record\": \"diagnosis\", \"time\": ", time);
    say(&saying, ", \"candidates\": [");
    for (int64_t k = 0; k < found.n_candidates; k++) {
        say(&saying, k ? ", {\"suspects\": {" : "{\"suspects\": {");
        say_suspects(&found.candidates[k]);
        say_key("}, \"probability\": ", found.candidates[k].probability);
        say(&saying, "}");
    }
    say(&saying, "]}\n");
    say_now(&saying);
}

static void say_alarm(double time)
{
    say_key("{\"record\": \"detection\", \"time\": ", time);
    say(&saying, "}\n");
    say_now(&saying);
}

/* Ticks and steps before the alarm, once the start is known, and the longest step of all. */
typedef struct {
    int64_t watching, n_watching, longest;
} Ticks;

static void say_end(const Ticks *ticks)
{
    const int64_t told[] = {N_SAMPLES, fb_state_size(), fb_work_size(), (int64_t)stack_used(), ticks->watching, ticks->n_watching,
                            ticks->longest};
    static const char *const keys[] = {"{\"record\": \"end\", \"samples\": ", ", \"state\": ",          ", \"work\": ",
                                       ", \"stack\": ",                       ", \"watching_ticks\": ", ", \"watching_steps\": ",
                                       ", \"longest_ticks\": "};
    for (int k = 0; k < (int)(sizeof told / sizeof *told); k++) {
        say(&saying, keys[k]);
        say_whole(&saying, told[k]);
    }
    say(&saying, "}\n");
    say_now(&saying);
}

/* Take a sample; gives its ticks, if it took less than 2^24 of them. */
static int64_t timed_step(const double *sample)
{
    TIMER[1] = TIMER_MOST;
    TIMER[2] = 0;
    TIMER[0] = TIMER_ON;
    const uint32_t before = TIMER[2];
    (void)fb_step(fb_memory_state, fb_memory_work, sample, &report, &found);
    return (int64_t)((before - TIMER[2]) & TIMER_MOST);
}

/* Whether the likeliest candidate is the expected one. */
static int is_expected(void)
{
    if (found.n_candidates == 0) return EXPECTED_BEST[0] == '\0';
    const double off = fabs(found.candidates[0].probability - EXPECTED_PROBABILITY);
    return strcmp(fb_suspect_name(&found.candidates[0].suspects[0]), EXPECTED_BEST) == 0 && off <= NEAR;
}

int main(void)
{
    double alarm = -1.0;
    Ticks ticks = {0, 0, 0};
    fb_init(fb_memory_state, SAMPLES[0][0], 0);
    for (int k = 0; k < N_SAMPLES; k++) {
        const int64_t taken = timed_step(SAMPLES[k]);
        if (taken > ticks.longest) ticks.longest = taken;
        if (report.status == WATCHING) {
            ticks.watching += taken;
            ticks.n_watching++;
        }
        if (report.detected) {
            alarm = SAMPLES[k][0];
            say_alarm(alarm);
        }
        if (report.due) say_diagnosis(SAMPLES[k][0]);
    }
    if (alarm >= 0.0) {
        fb_diagnosis(fb_memory_state, fb_memory_work, &found);
        say_diagnosis(SAMPLES[N_SAMPLES - 1][0]);
    }
    say_end(&ticks);
    if (alarm != EXPECTED_ALARM || !is_expected()) {
        host_text("not as expected\n");
        return 1;
    }
    host_text("as expected\n");
    return 0;
}
