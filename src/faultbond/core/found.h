/* What calls give: all that can be said of a sample, of a fault, and of what to check next, as numbers. Needs the sizes of
   model.h only, so that a program that links the core can include it. Numbers are SI; nan: there is none. */
#ifndef FB_FOUND_H
#define FB_FOUND_H

#include "port.h"

#define N_BEGUN (N_SETS + N_INSTRUMENTS)      /* hypotheses that are tested from the alarm on, */
#define FIRST_MIXED (N_BEGUN + N_RESERVE)     /* then those in reserve, then instruments with a parameter, */
#define N_HYPOTHESES (FIRST_MIXED + N_MIXED + N_BOTH) /* and two instruments */
#define MOST_CANDIDATES (N_HYPOTHESES < MAX_CANDIDATES ? FB_ROOM(N_HYPOTHESES) : MAX_CANDIDATES) /* that are listed */
#define MOST_LOOKS (MOST_RIVALS * LARGEST_SET < N_PARTS ? MOST_RIVALS * LARGEST_SET : N_PARTS)
#define MOST_CHECKS (MOST_LOOKS + N_INPUTS + N_SIGNALS)

enum { WAITING, STARTING, WARMING, WATCHING, DIAGNOSING, LOST, OUTSIDE }; /* what a run is doing */

/* What one sample brought; nan: nothing yet. */
typedef struct {
    int64_t status;
    int64_t wild;               /* values that were refused, or cut, since they lie far beyond all that was seen */
    int64_t detected;           /* 1: an alarm was raised, see State.alarm */
    int64_t due;                /* 1: time for a diagnosis */
    int64_t left_out[N_OUTPUTS]; /* 1: the model, or the sensor, does not hold, so the reading is not judged */
    double expected[N_OUTPUTS]; /* readings of the healthy plant, SI */
    double variance[N_OUTPUTS]; /* of what is measured, SI squared */
    double cusum[N_OUTPUTS];    /* largest sum of each sensor */
    double slow[FB_ROOM(N_SLOW)]; /* slow errors in their declared sd */
} Report;

/* When a drifting value reaches a limit: s, where that is as likely as not, 5 % and 95 % likely; nan: never. */
typedef struct {
    double limit, time, earliest, latest;
} Forecast;

/* What is wrong with a sensor or an input. */
enum { WORD_NONE, WORD_BIAS, WORD_STUCK, WORD_GAIN, WORD_NOISE };

/* A parameter, or what is wrong with an input or a sensor: of the three numbers two are -1. nan: there is none. */
typedef struct {
    int64_t parameter, input, output, word;
    double nominal, estimate, sd;
    double rate, rate_sd; /* of a drift, per second */
    double began, ended;  /* s; of a ramp that has come to its end */
    double moved;         /* sd by which it has moved lately, beyond what its variance allows; 0: it has settled */
    double stopped;       /* s, from when on the record of the input stands still */
    int64_t n_forecasts;
    Forecast forecasts[FB_ROOM(MOST_LIMITS)];
} Suspect;

/* A hypothesis with the estimates of its best lane, as uncertain as its kinds leave them. kinds: the likeliest first, to which the
   estimates belong; shares: the probability of each, given that this is the hypothesis. */
typedef struct {
    int64_t hypothesis;
    int64_t lane;    /* that tells of it: of steps, then of those with a slot */
    int64_t group;   /* 1: cannot be told from the best */
    int64_t present; /* 0 while a fault that comes and goes is gone */
    int64_t n_kinds, kinds[N_KINDS], n_suspects;
    double probability, shares[N_KINDS];
    Suspect suspects[LARGEST_SET];
} Candidate;

/* Ranked candidates, the best first. Where none explains the data, the best is off by `unexplained_sd` at a sensor,
   `signal`, from `since` to `until`; else these are nan, and -1. Of the sets that are not tested
   `untested_probability` is at most how likely it is that one is the true one; 1: no bound. `within_accuracy`: probability that
   nothing is at fault but what the declared accuracy allows; `is_over`: 1 where it has been so for so long that the alarm is over. `mismatch`: that the model is off, see mismatch.h. `superseded`: the parts
   [n_superseded] that were sure to be at fault until `superseded_until`, s, and are none of the likeliest any more, or did not explain
   the data since. `elsewhere`: the parameters [n_elsewhere] that count as healthy and are far from where they are declared. `strained`:
   those [n_strained] which the first candidate leaves healthy, and has had to move far. */
typedef struct {
    double time; /* s */
    int64_t n_candidates, is_over, is_unexplained, has_untested, untested_sets, signal, n_superseded, n_elsewhere, n_strained;
    double unexplained_sd, since, until, untested_probability, within_accuracy, mismatch, superseded_until;
    int64_t superseded[FB_ROOM(LARGEST_SET)], elsewhere[FB_ROOM(N_PARAMETERS)], strained[FB_ROOM(N_PARAMETERS)];
    Candidate candidates[MOST_CANDIDATES];
} Diagnosis;

/* One thing to do that would tell candidates apart. group: of each of the likeliest candidates, the number of those that it
   would still be together with. */
typedef struct {
    int64_t kind, target; /* CHECK_COMPONENT: a part; CHECK_INPUT: an input to move; CHECK_SIGNAL: one to measure */
    int64_t n_groups, group[MOST_RIVALS];
    double gain, cost;    /* bits; as the model file states it */
    double value, within; /* SI value to which an input is moved, and s until the answer is there; nan of other checks */
} Check;

/* Checks, the best for its cost first. */
typedef struct {
    int64_t n_checks, n_rivals;
    Check checks[MOST_CHECKS];
} Advice;

#endif
