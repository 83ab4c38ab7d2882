/* Functions of lanes. Powers, exponentials and logarithms are our own: the same digits on every processor, as many at a time as
   there are lanes. The others, that few laws use, are the C library's, lane by lane. Source: the reduction of Cody and Waite,
   Software Manual for the Elementary Functions, 1980, chapters 5 and 6; series by Taylor. */
#ifndef FB_MATHS_H
#define FB_MATHS_H

#include "lanes.h"

FB_EACH(sin)
FB_EACH(cos)
FB_EACH(tan)
FB_EACH(tanh)
FB_EACH(sqrt)
FB_EACH_PAIR(hypot)

#define FB_LN2 0.6931471805599453
#define FB_LN2_HIGH 0.6931471803691238     /* its first 32 bits, so that a whole number of them is exact; */
#define FB_LN2_LOW 1.9082149292705877e-10  /* and the rest */
#define FB_SQRT2 1.4142135623730951
#define FB_TAU 6.283185307179586
#define FB_LARGEST 1.7976931348623157e308
#define FB_WHOLE 6755399441055744.0        /* 1.5 * 2^52: the last bit of what is added to it stands for 1 */

/* Natural logarithm. x = 2^e m with m in [sqrt(1/2), sqrt(2)); log m = 2 atanh((m - 1) / (m + 1)), by its series up to the 21st
   power, to 4e-16 of the result or of 1. Numbers below the least normal one count as near it. */
static inline lanes v_log(lanes x)
{
    const mask bits = bits_of(x);
    mask e = ((bits >> 52) & 0x7ff) - 1023;
    lanes m = of_bits((bits & 0xfffffffffffffLL) | 0x3ff0000000000000LL);
    const mask big = m > FB_SQRT2;
    m = choose(big, m * 0.5, m);
    e = e + (big & 1); /* true is -1 in vectors, 1 alone */
    const lanes f = (m - 1.0) / (m + 1.0), g = f * f;
    lanes series = broadcast(1.0 / 21.0);
    for (int power = 19; power >= 3; power -= 2) series = series * g + 1.0 / power;
    const lanes found = of_whole(e) * FB_LN2 + 2.0 * (f + f * g * series);
    const lanes none = choose(x == 0.0, broadcast(-INFINITY), broadcast(NAN)); /* of what is not positive */
    return choose(x > 0.0, choose(x <= FB_LARGEST, found, x), none);
}

/* Exponential. x = k log 2 + r with a whole k and |r| <= log(2)/2; e^r by its series up to the 13th power, to 4e-16 of the
   result. 2^k in two factors, since the largest and the least numbers have one that is none. */
static inline lanes v_exp(lanes x)
{
    const lanes within = v_fmin(v_fmax(x, broadcast(-746.0)), broadcast(710.0)), moved = within * (1.0 / FB_LN2) + FB_WHOLE;
    const mask k = bits_of(moved) - bits_of(broadcast(FB_WHOLE)), half = ((k + 2048) >> 1) - 1024;
    const lanes whole = moved - FB_WHOLE, r = (within - whole * FB_LN2_HIGH) - whole * FB_LN2_LOW;
    lanes series = broadcast(1.0);
    for (int n = 13; n >= 1; n--) series = series * (r * (1.0 / n)) + 1.0;
    const lanes found = series * of_bits((half + 1023) << 52) * of_bits((k - half + 1023) << 52);
    return choose(x == x, found, x);
}

/* x to the power of y, to 4e-16 of the result for each e-fold of it. As in C: one where y is 0, and of a negative x, whole powers
   alone. */
static inline lanes v_pow(lanes x, lanes y)
{
    const lanes size = v_exp(y * v_log(magnitude(x))), moved = y + FB_WHOLE;
    const lanes sign = choose((bits_of(moved) & 1) == 0, broadcast(1.0), broadcast(-1.0));
    const lanes turned = choose(moved - FB_WHOLE == y, sign * size, broadcast(NAN));
    return choose(y == 0.0, broadcast(1.0), choose(x < 0.0, turned, size));
}

/* The same of numbers that all lanes share. */
static inline double exp_one(double a) { return first_of(v_exp(broadcast(a))); }
static inline double log_one(double a) { return first_of(v_log(broadcast(a))); }
static inline double pow_one(double a, double b) { return first_of(v_pow(broadcast(a), broadcast(b))); }

#endif
