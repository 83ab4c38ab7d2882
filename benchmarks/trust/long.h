/* Before the text of a core: the same text with long double for its numbers, one lane at a time. Functions are those of the
   C library for long double, the logarithm of variances among them, whose own one takes a double apart. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <tgmath.h>

/* Samples are counted off by factors as 1.05: what comes out as half a sample as a double is to be one here, too. */
static inline double whole_of_double(double x) { return (nearbyint)(x); }
#undef nearbyint
#define nearbyint(x) whole_of_double((x))

#define LONG
#define FB_LANES 1
#define double long double
#define log_of log_of_double
#include "maths.h"
#undef log_of

static inline lanes log_of(lanes x) { return x > 0.0 ? log(x) : x == 0.0 ? -INFINITY : NAN; }
