/* All that is remembered from sample to sample: numbers only, all of eight bytes, no pointer, no hole. So a state can be
   copied, kept and sent. `State`, below, is all of it. */
#ifndef FB_STATE_H
#define FB_STATE_H

#include "filters.h"
#include "found.h"

#define LAGS 4            /* innovations with which each new one is compared */
#define TRENDS 9          /* that follow a record which scatters, see smooth.h; the numbers of each: level and slope, SI, */
enum { TREND_LEVEL, TREND_SLOPE, TREND_VARIANCE, TREND_TIE, TREND_SLOPES, TREND_LATELY, TREND_MISS, TREND_NUMBERS }; /* how sure these are
                             (of the level, both, the slope), what was not foretold lately, and its square over longer; in the noise */
#define WALK_EVERY 100    /* samples after which it is judged how far the parameters have walked, */
#define WALKS 6           /* over so many windows: the first is as long as that, */
#define WALK_RATIO 3      /* and each so many times as long as the one before */
#define SNAPSHOTS (2 * WALKS + 1) /* healthy lanes that are kept for long: two of each window, and that of the start, or of what was accepted last */
#define AT_START (2 * WALKS)
#define ALARMS_ONLY 2      /* `quiet`: an alarm ends the watch, and no lanes begin */
#define DEPTH (HISTORY_SAMPLES + 2) /* samples of a trail */
#define SPREAD 128                  /* samples over which work on the bank may be spread, */
#define N_ROWS (DEPTH + (N_LANES > 0 ? SPREAD : 0)) /* and those that are kept: with these, if there is a bank */
#define GROUP 8                     /* lanes that begin and are kept side by side: a multiple of FB_LANES */
#define MOST_ONSETS 128             /* that a group of lanes may try */
#define FOUND (LARGEST_SET > 2 ? LARGEST_SET : 2)

#define N_LATER (PER_SET * N_GROWN)           /* lanes for sets taken from the reserve */
#define N_STEPS (N_PLANNED + N_LATER)         /* plain lanes of the bank: steps of parameters, */
#define N_COUPLE_LANES (PER_COUPLE * N_COUPLED) /* lanes for couples, see couples.h */
#define N_WIDE (N_SLOT_LANES + N_COUPLE_LANES)  /* then wide ones: all other kinds of fault, alone and in couples */
#define N_LANES (N_STEPS + N_WIDE)
#define BLOCKS(n) (((n) + GROUP - 1) / GROUP)
#define FIRST_COUPLES (BLOCKS(N_STEPS) + BLOCKS(SWITCHED))     /* of the groups that may rest, that of the first couples, */
#define N_RESTING (FIRST_COUPLES + BLOCKS(N_COUPLE_LANES))      /* and how many there are */

#define PENDING 20 /* samples for which an input that goes on may wait for the readings to tell, see wild.h */
#define AS_MANY 1000.0       /* samples that tell as much as ever so many do */
#define MOST_AS_MANY 10000.0 /* and how many do at most: what is shown after a day still counts */

#define real double
#define whole int64_t
#include "watched.h"
#undef real
#undef whole

/* A sample that is kept: packed, with the healthy lane after it, its time, and its largest innovation in sd. */
typedef struct {
    double sample[N_SAMPLE], lane[PLAIN_NUMBERS], time, wildness;
} Row;

/* The last samples; that of number k is rows[k % N_ROWS]. What no run has reached yet is zero. */
typedef struct {
    Row rows[N_ROWS];
} Past;

/* From which samples the filter began last: the number of the first (-1: not here), how many its start was solved from, and whether
   it had run before. */
typedef struct {
    int64_t sample, count, again;
} Beginning;

/* GROUP lanes side by side: number k of lane l is [k][l]. */
typedef double PlainBlock[PLAIN_NUMBERS][GROUP];
typedef double WideBlock[WIDE_NUMBERS][GROUP];

/* Of each hypothesis, whether it led and was far off (`is_noted`), at which sensor the last time, by how many sd, since when
   the first time, and until when, s. See unexplained.h. */
typedef struct {
    int64_t is_noted[FB_ROOM(N_HYPOTHESES)], signal[FB_ROOM(N_HYPOTHESES)];
    double sd[FB_ROOM(N_HYPOTHESES)], since[FB_ROOM(N_HYPOTHESES)], until[FB_ROOM(N_HYPOTHESES)];
} Missed;

/* All lanes: of steps (N_PLANNED, then PER_SET of each set that is taken from the reserve), then those with a slot (of the
   plan, then PER_COUPLE of each couple). Lanes that fill up the last block repeat its first. */
typedef struct {
    PlainBlock steps[FB_ROOM(BLOCKS(N_STEPS))];
    WideBlock slots[FB_ROOM(BLOCKS(N_SLOT_LANES))];
    WideBlock couples[FB_ROOM(BLOCKS(N_COUPLE_LANES))];
    double sums[2][N_OUTPUTS][FB_ROOM(N_LANES)];  /* of the innovations of each lane, */
    double since[2][N_OUTPUTS][FB_ROOM(N_LANES)]; /* and the sample after which each began */
    double healthy[PLAIN_NUMBERS];                /* the healthy lane before the fault */
    int64_t rests[FB_ROOM(N_RESTING)];            /* 1: groups of steps, with a slot, of couples, that do not go on */
    int64_t onset[FB_ROOM(N_LANES)];              /* sample at which each began */
    int64_t grown[FB_ROOM(N_GROWN)];              /* which sets of the reserve have lanes; -1: not yet */
    int64_t coupled[FB_ROOM(N_COUPLED)];          /* the same of couples, */
    int64_t base[FB_ROOM(N_COUPLE_LANES)];        /* and the lane of the plan whose slot each has; -1: it has not begun */
    int64_t rejected[FB_ROOM(N_HYPOTHESES)];      /* 1 where a person has ruled it out */
    Missed missed;
    double noted[2][2][FB_ROOM(LARGEST_SET)][FB_ROOM(N_LANES)]; /* suspects of each lane as they were noted last, and before
                                                     that ([0]): values and their sds, SI */
    int64_t noted_at[2];                          /* and at which samples; 0: not yet */
} Bank;

/* Onsets that a group of lanes may try, oldest first, and what those say that were tried. */
typedef struct {
    int64_t n;
    int64_t place[MOST_ONSETS];      /* in the trail */
    int64_t standing[MOST_ONSETS];   /* SPARE, WANTED, REQUIRED or TRIED */
    double said[MOST_ONSETS][GROUP]; /* log-likelihood of each lane, */
    double most[GROUP];              /* and that of its best onset; the least number: none yet */
    int64_t best[GROUP];             /* which that is */
    double least;                    /* lanes whose best onset is less likely do not count */
    int64_t fixed;                   /* 1: only those are tried that surely are */
    int64_t early;                   /* 1: the first of them is the first sample of all, and stands apart */
} Search;

/* How the size of each lane of a group walks while its input settles: samples that it takes, in so many steps (0: it
   does not walk), each of which adds a variance. */
typedef struct {
    int64_t samples[GROUP], steps[GROUP];
    double variance[GROUP];
} Walk;

/* Work on the bank, which may be spread over samples: lanes begin at the alarm, and begin again later. See work.h. */
typedef struct {
    int64_t kind;        /* IDLE, BEGINNING, RENEWING or RENEWING_ALL */
    int64_t renewals;    /* times that the bank has begun again since the alarm, or does so now */
    int64_t ended;       /* sample at which work ended last; -1: it never did since the alarm */
    int64_t settled;     /* the same of work after which the lanes are judged anew */
    int64_t oldest, end; /* samples between which the trail lies from which lanes begin */
    int64_t old;         /* the lane of long ago, one of the snapshots; -1: none is kept */
    int64_t change;      /* place of the estimated onset */
    double peak[FB_ROOM(N_INPUTS)]; /* largest size of each input up to `end`, SI */
    int64_t spent;       /* what the work has cost so far, in samples of a group of plain lanes, */
    int64_t opened;      /* and what it had when the group began */
    double price;        /* of a share in the work before; 0: there was none since the alarm, see work.h */
    int64_t stage, group, pass; /* which group it is at */
    int64_t onset;       /* that which its lanes now begin at, of those in the search; -1: none */
    int64_t next;        /* sample that they take next */
    int64_t n_wanted, n_singles;           /* lanes of the plan that begin; steps of one parameter stand first */
    int64_t wanted[FB_ROOM(N_STEPS)];
    int64_t stands_for[FB_ROOM(N_PLANNED)]; /* lane whose new beginning is that of each; NOT_AGAIN: none */
    double factors[FB_ROOM(N_GROWN)][FB_ROOM(LARGEST_SET)]; /* at which sets of the reserve begin */
    int64_t bases[FB_ROOM(N_COUPLE_LANES)]; /* lanes of the plan whose slots those of couples get; -1: it does not begin, */
    double values[FB_ROOM(N_COUPLE_LANES)]; /* and at which factors their parameters begin */
    double most;               /* log-likelihood of the likeliest lane that was begun */
    double heard[MOST_ONSETS]; /* log-likelihood of the likeliest single parameter at each onset; LOWEST: not tried */
    int64_t likeliest;         /* place of that at which it is most; -1: none was heard */
    int64_t lane[GROUP];       /* the lanes of the group, */
    int64_t begins[GROUP];     /* samples of their best onsets so far, */
    int64_t began[GROUP];      /* and of those before they began from closer, */
    double found[GROUP][FOUND]; /* and what they have found, where they begin again */
    Walk walk;
    Search search;
    WideBlock run, best;       /* lanes that begin at an onset, and those of the best onset so far; */
    WideBlock stays, best_stays; /* where they are drifts in pairs, what has come to stay of each */
    PlainBlock before;         /* those that began from farther away, */
    double before_most[GROUP]; /* and the log-likelihood of their best onset */
} Job;

/* What was accepted as the new normal. A sensor reads `gain` times the truth plus `offset`, with `noise` times the variance
   declared (inf: it is no longer used); an input acts `input_gain` times what is recorded plus `input_offset`, and parameters move on at `rates` (factors
   per second), give or take `wander`. */
typedef struct {
    double lane[PLAIN_NUMBERS]; /* that which was accepted last */
    double gain[N_OUTPUTS], offset[N_OUTPUTS], noise[N_OUTPUTS];
    double input_gain[FB_ROOM(N_INPUTS)], input_offset[FB_ROOM(N_INPUTS)];
    double rates[FB_ROOM(N_PARAMETERS)], wander[FB_ROOM(N_PARAMETERS)];
} Normal;

/* The last alarm. */
typedef struct {
    double time, change_time;   /* s: when it was raised, and the estimated onset */
    int64_t crossed[N_OUTPUTS]; /* 1: the sensors whose sums crossed */
    int64_t walker, window;     /* the parameter that has walked too far, and over which window, WALKS: since the start,
                                   WALKS + 1 and more: it and others together;
                                   -1: it was not raised by that */
    double walk;                /* how far, in standard deviations of what is usual */
    int64_t old;                /* the snapshot from before a walk that began before the trail; -1: it did not */
    int64_t slow;               /* 1: no sum raised it, so what it tells may have begun long before */
    int64_t outside;            /* samples since then at which the model did not hold */
    int64_t unfamiliar;         /* 1: an input was where no recording of the fit had it; of a walk since the start: or had been */
} Alarm;

/* What the rule has in mind that accepts without a person: which hypothesis has been sure, since which sample, and since when
   its kind has been, too; -1: none. */
typedef struct {
    int64_t hypothesis, since, clear_since;
} Sure;

/* The hypothesis that was sure for so long that a person may have accepted it (`settle_on` in rule.h), or -1; the parts
   that are at fault by it, and when it was among the likeliest last, s. harmless_since: the sample since which nothing has been
   further off than it may be while healthy; -1: something is. */
typedef struct {
    Sure now;
    int64_t hypothesis, n_parts, parts[FB_ROOM(LARGEST_SET)], harmless_since;
    double until;
} Settled;

typedef struct {
    Clock clock;
    Inputs inputs;
    Sensors sensors;
    Healthy healthy;
    Past past;
    Beginning beginning;
    double refused[PENDING][N_SAMPLE]; /* samples as they are if the inputs that wait are real; number k is [k % PENDING] */
    Bank bank;
    Job job;
    Normal normal;
    Alarm alarm;
    Sure sure;
    Settled settled;
} State;

/* Samples since the alarm that tell of it. */
static inline int64_t since_alarm(const State *state) { return state->clock.index - state->clock.alarm - state->alarm.outside; }

/* The part of differences of log-likelihoods that counts, so many samples after the alarm. No model is exact: that one
   hypothesis fits better by less than 0.1 sd of an innovation at each sample makes it no likelier than what it costs, however long
   that lasts. A likelihood that counts by a part knows its parameters by that part, too: variances are divided by it.
   Source: J. W. Miller, D. B. Dunson, "Robust Bayesian inference via coarsening", J. American Statistical Association 114
   (2019) 1113. */
static inline double share_after(int64_t n)
{
    const double seen = n < 0 ? 0.0 : (double)n < MOST_AS_MANY ? (double)n : MOST_AS_MANY;
    return 1.0 / (1.0 + seen / AS_MANY);
}

static inline double share_of_evidence(const State *state) { return share_after(since_alarm(state)); }

/* Number k of a lane of steps, and of one with a slot: where it stands, and what it is. */
static inline double *number_of_step(Bank *bank, int64_t lane, int64_t k)
{
    return &bank->steps[lane / GROUP][k][lane % GROUP];
}

static inline double *number_of_slot(Bank *bank, int64_t lane, int64_t k)
{
    WideBlock *blocks = lane < N_SLOT_LANES ? bank->slots : bank->couples;
    const int64_t at = lane < N_SLOT_LANES ? lane : lane - N_SLOT_LANES;
    return &blocks[at / GROUP][k][at % GROUP];
}

static inline double of_step(const Bank *bank, int64_t lane, int64_t k) { return bank->steps[lane / GROUP][k][lane % GROUP]; }
static inline double of_slot(const Bank *bank, int64_t lane, int64_t k)
{
    if (lane < N_SLOT_LANES) return bank->slots[lane / GROUP][k][lane % GROUP];
    return bank->couples[(lane - N_SLOT_LANES) / GROUP][k][(lane - N_SLOT_LANES) % GROUP];
}

/* The row of a sample that is kept. */
static inline Row *row_of(Past *past, int64_t number) { return &past->rows[number % N_ROWS]; }

#endif
