/* All that is remembered from sample to sample: numbers only, all of eight bytes, no pointer, no hole. So a state can be
   copied, kept and sent. `State` has seven parts, and what was found last. */
#ifndef FB_STATE_H
#define FB_STATE_H

#include "filters.h"

#define LAGS 4            /* innovations with which each new one is compared */
#define SNAPSHOTS 12      /* healthy lanes that are kept for long, */
#define SNAPSHOT_EVERY 300 /* one after so many samples */
#define DEPTH (HISTORY_SAMPLES + 2) /* samples that are kept */

#define N_LATER (PER_SET * N_GROWN)           /* lanes for sets taken from the reserve */
#define N_STEPS (N_PLANNED + N_LATER)         /* plain lanes of the bank: steps of parameters, */
#define N_LANES (N_STEPS + N_SLOT_LANES)      /* then wide ones: all other kinds of fault */
#define N_BEGUN (N_SETS + N_INSTRUMENTS)      /* hypotheses that are tested from the alarm on, */
#define N_HYPOTHESES (N_BEGUN + N_RESERVE)    /* then those in reserve */
#define BLOCKS(n) (((n) + FB_LANES - 1) / FB_LANES)

#define real double
#define whole int64_t
#include "watched.h"
#undef real
#undef whole

/* A sample that is kept: packed, with the healthy lane after it, its time, and its largest innovation in sd. */
typedef struct {
    double sample[N_SAMPLE], lane[PLAIN_NUMBERS], time, wildness;
} Row;

/* The last samples; that of number k is rows[k % DEPTH]. What no run has reached yet is zero. */
typedef struct {
    Row rows[DEPTH];
} Past;

/* FB_LANES lanes side by side: number k of lane l is [k][l]. */
typedef double PlainBlock[PLAIN_NUMBERS][FB_LANES];
typedef double WideBlock[WIDE_NUMBERS][FB_LANES];

/* All lanes: of steps (N_PLANNED, then PER_SET of each set that is taken from the reserve), then those with a slot. Lanes
   that fill up the last block repeat its first. */
typedef struct {
    PlainBlock steps[FB_ROOM(BLOCKS(N_STEPS))];
    WideBlock slots[FB_ROOM(BLOCKS(N_SLOT_LANES))];
    double sums[2][N_OUTPUTS][FB_ROOM(N_LANES)];  /* of the innovations of each lane, */
    double since[2][N_OUTPUTS][FB_ROOM(N_LANES)]; /* and the sample after which each began */
    double healthy[PLAIN_NUMBERS];                /* the healthy lane before the fault, where there is a reserve */
    int64_t grown[FB_ROOM(N_GROWN)];              /* which sets of the reserve have lanes; -1: not yet */
    int64_t rejected[FB_ROOM(N_HYPOTHESES)];      /* 1 where a person has ruled it out */
} Bank;

/* What was accepted as the new normal. A sensor reads `gain` times the truth plus `offset`, with `noise` times the variance
   declared (inf: it is no longer used); `input_offset` is added to an input, and parameters move on at `rates` (factors
   per second), give or take `wander`. */
typedef struct {
    double lane[PLAIN_NUMBERS]; /* that which was accepted last */
    double gain[N_OUTPUTS], offset[N_OUTPUTS], noise[N_OUTPUTS];
    double input_offset[FB_ROOM(N_INPUTS)];
    double rates[FB_ROOM(N_PARAMETERS)], wander[FB_ROOM(N_PARAMETERS)];
} Normal;

/* The last alarm. */
typedef struct {
    double time, change_time;   /* s: when it was raised, and the estimated onset */
    int64_t crossed[N_OUTPUTS]; /* 1: the sensors whose sums crossed */
} Alarm;

typedef struct {
    Clock clock;
    Inputs inputs;
    Sensors sensors;
    Healthy healthy;
    Past past;
    Bank bank;
    Normal normal;
    Alarm alarm;
} State;

/* Number k of a lane of steps, and of one with a slot. */
static inline double *number_of_step(Bank *bank, int64_t lane, int64_t k) { return &bank->steps[lane / FB_LANES][k][lane % FB_LANES]; }
static inline double *number_of_slot(Bank *bank, int64_t lane, int64_t k) { return &bank->slots[lane / FB_LANES][k][lane % FB_LANES]; }

/* The row of a sample that is kept. */
static inline Row *row_of(Past *past, int64_t number) { return &past->rows[number % DEPTH]; }

#endif
