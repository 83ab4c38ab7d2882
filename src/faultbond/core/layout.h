/* Where the numbers of a lane stand. A plain lane is [z, triangle of its covariance, implicit signals, log-likelihood];
   a wide one has a slot in z, the size of one more fault and its rate, and roles, on what that acts, before the last. Where
   it does not move, the second number is no rate but the size of the bias of one more instrument. */
#ifndef FB_LAYOUT_H
#define FB_LAYOUT_H

#include "maths.h"

#define TRIANGLE(n) ((n) * ((n) + 1) / 2)
#define IN_TRIANGLE(n, i, j) ((i) * (n) - (i) * ((i) - 1) / 2 + (j) - (i)) /* of i <= j, row by row */

#define AT_SLOW N_STATES
#define AT_PARAMETERS (AT_SLOW + N_SLOW)
#define AT_SLOT (AT_PARAMETERS + N_PARAMETERS)

#define PLAIN_JOINT (AT_SLOT + N_NOISY)
#define PLAIN_COVARIANCE PLAIN_JOINT
#define PLAIN_IMPLICIT (PLAIN_COVARIANCE + TRIANGLE(PLAIN_JOINT))
#define PLAIN_LIKELIHOOD (PLAIN_IMPLICIT + N_IMPLICIT)
#define PLAIN_NUMBERS (PLAIN_LIKELIHOOD + 1)
#define PLAIN_PLACE(i, j) (PLAIN_COVARIANCE + IN_TRIANGLE(PLAIN_JOINT, i, j)) /* in a lane, of i <= j */

/* The same in either order. */
static inline int64_t plain_place(int64_t i, int64_t j) { return i <= j ? PLAIN_PLACE(i, j) : PLAIN_PLACE(j, i); }

/* What is kept for long of a healthy lane: all of it, the usual squares of walks over its window, the last of which is that of
   all parameters together, and its time. */
#define KEPT_USUAL PLAIN_NUMBERS
#define TOGETHER N_PARAMETERS
#define KEPT_TIME (KEPT_USUAL + N_PARAMETERS + 1)
#define KEPT_NUMBERS (KEPT_TIME + 1)

#define WIDE_JOINT (PLAIN_JOINT + 2)
#define WIDE_COVARIANCE WIDE_JOINT
#define WIDE_IMPLICIT (WIDE_COVARIANCE + TRIANGLE(WIDE_JOINT))
#define WIDE_ROLES (WIDE_IMPLICIT + N_IMPLICIT)
#define ROLE_THETA WIDE_ROLES
#define ROLE_INPUT (ROLE_THETA + N_PARAMETERS)
#define ROLE_OBEYS (ROLE_INPUT + N_INPUTS)
#define ROLE_INPUT_GAIN (ROLE_OBEYS + N_INPUTS)
#define ROLE_READS (ROLE_INPUT_GAIN + N_INPUTS)
#define ROLE_GAIN (ROLE_READS + N_OUTPUTS)
#define ROLE_BIAS (ROLE_GAIN + N_OUTPUTS)
#define ROLE_NOISE (ROLE_BIAS + N_OUTPUTS)
#define ROLE_MOVES (ROLE_NOISE + N_OUTPUTS)
#define ROLE_FADES (ROLE_MOVES + 1)
#define ROLE_KEEPS (ROLE_FADES + 1)
#define ROLE_INPUT_BESIDE (ROLE_KEEPS + 1)
#define ROLE_BIAS_BESIDE (ROLE_INPUT_BESIDE + N_INPUTS)
#define ROLE_ENDED (ROLE_BIAS_BESIDE + N_OUTPUTS)
#define ROLE_TOOK (ROLE_ENDED + 1)
#define ROLE_RETURNS (ROLE_TOOK + 1)
#define WIDE_LIKELIHOOD (ROLE_RETURNS + 1)
#define WIDE_NUMBERS (WIDE_LIKELIHOOD + 1)
#define WIDE_PLACE(i, j) (WIDE_COVARIANCE + IN_TRIANGLE(WIDE_JOINT, i, j))

#ifndef N_HELD
#define N_HELD 0        /* sensors that do not always read as stated */
#define N_HELD_STATES 0 /* by which these lag */
#endif

/* A packed sample: what the filters take. */
#define SAMPLE_DT 0                               /* s since the sample before */
#define SAMPLE_U_BEFORE 1                         /* inputs at the sample before, held since or left, SI */
#define SAMPLE_U (SAMPLE_U_BEFORE + N_INPUTS)     /* and now */
#define SAMPLE_Y (SAMPLE_U + N_INPUTS)            /* readings, SI */
#define SAMPLE_USE (SAMPLE_Y + N_OUTPUTS)         /* 1: there; 0: missing */
#define SAMPLE_SCALE (SAMPLE_USE + N_OUTPUTS)     /* factor on the noise variance */
#define SAMPLE_KICK (SAMPLE_SCALE + N_OUTPUTS)    /* variance that a slow error gains */
#define SAMPLE_GAP (SAMPLE_KICK + N_SLOW)         /* sd that a state gains, since nobody saw what acted */
#define SAMPLE_AGAIN (SAMPLE_GAP + N_STATES)      /* 1: update a second time */
#define SAMPLE_BOUND (SAMPLE_AGAIN + 1)           /* sd up to which innovations count; 0: without bound */
#define SAMPLE_NIS (SAMPLE_BOUND + 1)             /* usual square of a normalised innovation; 0: as declared, 1 */
#define SAMPLE_RUN (SAMPLE_NIS + N_OUTPUTS)       /* and their variance over long runs, for likelihoods; less counts as that */
#define SAMPLE_HELD (SAMPLE_RUN + N_OUTPUTS)      /* 1: what lags before a sensor is not followed, see `hold_lags` */
#define SAMPLE_STILL (SAMPLE_HELD + N_HELD)       /* 1: the states stay, since the model did not hold before it; 2: it does not now */
#define SAMPLE_FADE (SAMPLE_STILL + 1)            /* part of the error of a noisy input that is still there, */
#define SAMPLE_FRESH (SAMPLE_FADE + N_NOISY)      /* and variance that it gains */
#define N_SAMPLE (SAMPLE_FRESH + N_NOISY)
#define IS_OUTSIDE(packed) ((packed)[SAMPLE_STILL] > 1.0)

/* Parameters whose accuracies go together, see given.h; a model without any says nothing of it. */
#ifndef TIED
static const int TIE_ROW[N_PARAMETERS + 1] = {0}, TIE_PARAMETER[] = {0};
static const double OWN_PRECISION[FB_ROOM(N_PARAMETERS)] = {0.0};
static const double TIE_COVARIANCE[] = {0.0}, TIE_PRECISION[] = {0.0}, TIE_WEIGHT[] = {0.0};
#endif

#endif
