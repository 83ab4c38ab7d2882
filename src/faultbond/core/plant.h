/* One plant that is watched: `watching.h` for numbers of one. */
#ifndef FB_PLANT_H
#define FB_PLANT_H

#include "advance.h"

#define GAP_FROM 3          /* samples without any value from which on the states are uncertain after them, */
#define GAP_UNUSUAL 3.0     /* beside so many times the usual number, since rows may come more slowly than samples */
#define GAP_UNKNOWN 1000    /* samples; a gap of unknown length counts as one of so many */
#define PAUSES 20.0         /* rows over which the usual number is a mean; longer pauses do not count as more */
#define MOVES 300.0         /* samples over which the moves, */
#define HABIT 1000.0        /* and the presence, of inputs are means */
#define UNKNOWN_FROM 3.0    /* samples for which an input has not been told from which on it is unknown where it stands */
#define RARELY 0.5          /* presence of an input that is logged when it changes */
#define SPIKE 4.0           /* sd of an innovation that may be due to one; */
#define WALK_LIMIT 7.0       /* sd of what is usual, that a parameter may walk over a window, */
#define WALK_DEGREES 8       /* number of parameters, at most, that count as walking each for itself */
#define START_LIMIT 3.5      /* and of what its accuracy allows, since the start */
#define WALK_USUAL 4.0       /* square of a walk over the first window that counts as usual before any was seen, */
#define WALK_TRUST 10.0      /* for as much as so many windows; the same of what one window says for the next */
#define WALK_MOST 16.0       /* part of the usual square that one window may add */
#define AS_DECLARED 1e-3     /* part by which a variance that is as declared may be off that, of rounding */
#define WALK_LEAST 0.02      /* part of its variance that a parameter may walk in any case */
#define WALK_PIVOT 1e-3      /* part of its variance that of a parameter beside the others has to be for it to be judged there */
#define WALK_SETTLES 200     /* samples after the start, or a diagnosis that was accepted, from which on lanes are kept */
#define TREND_JUMP 9.0      /* square of what a trend missed lately, in its variance, from which on it begins anew where the record is; */
#define TREND_SHARE 0.5     /* part of the last miss in that */
#define TREND_FARTHEST 1e100 /* sd of the noise, beyond which a record says nothing: its square would be no number, and then for ever */
#define TREND_MOST 25.0     /* square of a miss, in the noise, that counts, */
#define TREND_MEMORY 200.0  /* samples over which it is a mean, */
#define TREND_DOUBLINGS 6   /* and 2 to this the power of their ratio that is a weight: a third of those samples */
#define TREND_STEEPEST 1e4  /* variance of a slope of which nothing is known, in that of the noise, per sample squared */
#define TREND_LEAST 1e-6    /* part of a variance that is fresh in any case */
#define NIS_TRUST 1000    /* samples for which the declared noise counts, */
#define NIS_MEMORY 10000  /* and over which squares are a mean */
#define NIS_LEAST 0.25
#define NIS_MOST 4.0
#define RUN_LENGTH 100.0    /* samples over which innovations that go together are told, */
#define RUN_MOST 100.0      /* and what their variance is at most */

/* By how much the level, or the slope, of each trend wanders: variance per sample, in that of the noise. That of 100 is the record
   itself. */
static const double TREND_WANDERS[TRENDS] = {1e-6, 1e-4, 1e-2, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0};
static const double TREND_TURNS[TRENDS] = {0.0, 0.0, 0.0, 0.0, 1e-8, 1e-6, 1e-4, 1e-2, 1.0};

/* Samples of a window over which walks are judged. */
static inline int64_t length_of_walk(int window)
{
    int64_t length = WALK_EVERY;
    for (int k = 0; k < window; k++) length *= WALK_RATIO;
    return length;
}

/* Number of the lane of a window with which that after sample `index` is compared; below 0: none. */
static inline int64_t compared_with(int64_t index, int64_t length) { return (index + length - 1) / length - 2; }

/* The walk of n parameters together, root of the mean of squares, that is as rare as one of WALK_LIMIT sd: models err in few
   directions, so no more than some degrees of freedom count. Source: Wilson and Hilferty, Proc. National Academy of Sciences 17
   (1931) 684. */
static inline double limit_together(int n)
{
    const double ninth = 2.0 / (9.0 * (double)(n < 1 ? 1 : n < WALK_DEGREES ? n : WALK_DEGREES));
    return pow_one(1.0 - ninth + WALK_LIMIT * sqrt(ninth), 1.5);
}

/* Whether a parameter moves by itself; rates: NULL: none does. */
static inline int is_moving(const double *rates, int k) { return rates && rates[k] != 0.0; }

/* How many parameters are judged together: that can move, and do not by themselves. */
static inline int n_together(const double *rates)
{
    int n = 0;
    for (int k = 0; k < N_PARAMETERS; k++) n += ACCURACY[k] > 0.0 && !is_moving(rates, k);
    return n;
}

/* Where lane number `number` of a window is kept. */
static inline int64_t kept_at(int window, int64_t number) { return 2 * window + number % 2; }

#define real double
#define whole int64_t
#define flag int
#define NEVER 0
#define SAME(a) (a)
#define PICK(is, a, b) ((is) ? (a) : (b))
#define WHERE(is, a) ((is) ? (a) : 0)
#define NOT(is) (!(is))
#define ANY(is) (is)
#define AS_REAL(a) ((double)(a))
#define SIZE fabs
#define ROOT sqrt
#define HYPOT hypot
#include "watching.h"

#endif
