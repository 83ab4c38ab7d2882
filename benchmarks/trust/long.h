/* Before the text of a core: the same text with long double for its numbers, one lane at a time. Functions are those of the
   C library for long double: our own ones take a double apart. */
#include <math.h>
#include <stddef.h>
#include <stdint.h>
#include <string.h>
#include <tgmath.h>

#define LONG
#define FB_LANES 1
#define double long double
#define v_exp v_exp_double
#define v_log v_log_double
#define v_pow v_pow_double
#define exp_one exp_one_double
#define log_one log_one_double
#define pow_one pow_one_double
#include "maths.h"
#undef v_exp
#undef v_log
#undef v_pow
#undef exp_one
#undef log_one
#undef pow_one

static inline lanes v_exp(lanes x) { return exp(x); }
static inline lanes v_log(lanes x) { return x > 0.0 ? log(x) : x == 0.0 ? -INFINITY : NAN; }
static inline lanes v_pow(lanes x, lanes y) { return pow(x, y); }
static inline double exp_one(double a) { return v_exp(a); }
static inline double log_one(double a) { return v_log(a); }
static inline double pow_one(double a, double b) { return v_pow(a, b); }
