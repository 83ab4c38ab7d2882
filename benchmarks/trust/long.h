/* Before the text of a core: the same text with long double for its numbers, one lane at a time. Functions are those of the
   C library for long double, the logarithm of variances among them, whose own one takes a double apart. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <tgmath.h>

#define LONG
#define FB_LANES 1
#define double long double
#define log_of log_of_double
#include "maths.h"
#undef log_of

static inline lanes log_of(lanes x) { return x > 0.0 ? log(x) : x == 0.0 ? -INFINITY : NAN; }
