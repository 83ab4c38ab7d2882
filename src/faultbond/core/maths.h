/* Functions of lanes. Those of the filter are our own; those that only laws use are the C library's, lane by lane. */
#ifndef FB_MATHS_H
#define FB_MATHS_H

#include "lanes.h"

FB_EACH(exp)
FB_EACH(log)
FB_EACH(sin)
FB_EACH(cos)
FB_EACH(tan)
FB_EACH(tanh)
FB_EACH(sqrt)
FB_EACH_PAIR(pow)
FB_EACH_PAIR(hypot)

#define FB_LN2 0.6931471805599453
#define FB_SQRT2 1.4142135623730951
#define FB_TAU 6.283185307179586
#define FB_LARGEST 1.7976931348623157e308

/* Natural logarithm of variances. x = 2^e m with m in [sqrt(1/2), sqrt(2)); log m = 2 atanh((m - 1) / (m + 1)), by its
   series up to the 21st power, to 4e-16 of the result or of 1. Numbers below the least normal one count as near it. */
static inline lanes log_of(lanes x)
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

#endif
