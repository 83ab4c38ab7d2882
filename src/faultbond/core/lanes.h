/* Numbers of several filters side by side: one operation works on all of them. */
#ifndef FB_LANES_H
#define FB_LANES_H

#include "port.h"

#if FB_LANES == 1
typedef double lanes;
typedef int64_t mask;
static inline lanes choose(mask m, lanes a, lanes b) { return m ? a : b; }
static inline lanes broadcast(double a) { return a; }
static inline int any_of(mask m) { return m != 0; }
static inline int all_of(mask m) { return m != 0; }
static inline mask opposite(mask m) { return m == 0; }
static inline int holds(mask m, int lane) { return lane == 0 && m != 0; }
static inline int64_t whole_of(mask m, int lane) { return lane == 0 ? m : 0; }
static inline mask larger_whole(mask a, mask b) { return a > b ? a : b; }
static inline mask bits_of(lanes a) { mask r; memcpy(&r, &a, sizeof r); return r; }
static inline lanes of_bits(mask a) { lanes r; memcpy(&r, &a, sizeof r); return r; }
static inline lanes of_whole(mask a) { return (double)a; }
#define FB_EACH(name) \
    static inline lanes v_##name(lanes a) { return name(a); }
#define FB_EACH_PAIR(name) \
    static inline lanes v_##name(lanes a, lanes b) { return name(a, b); }
#else
typedef double lanes __attribute__((vector_size(FB_LANES * sizeof(double))));
typedef int64_t mask __attribute__((vector_size(FB_LANES * sizeof(int64_t))));

static inline mask bits_of(lanes a) { return (mask)a; }
static inline lanes of_bits(mask a) { return (lanes)a; }
static inline lanes of_whole(mask a) { return __builtin_convertvector(a, lanes); }

/* Where a mask is true a, else b; bit by bit, so that what is not chosen may be anything. */
static inline lanes choose(mask m, lanes a, lanes b) { return (lanes)(((mask)a & m) | ((mask)b & ~m)); }

static inline lanes broadcast(double a)
{
    const lanes nothing = {0.0};
    return a - nothing; /* keeps the sign of a zero */
}

static inline int any_of(mask m)
{
    int64_t found = 0;
    for (int l = 0; l < FB_LANES; l++) found |= m[l];
    return found != 0;
}
static inline int all_of(mask m) { return !any_of(~m); }
static inline mask opposite(mask m) { return ~m; }
static inline int holds(mask m, int lane) { return m[lane] != 0; }
static inline int64_t whole_of(mask m, int lane) { return m[lane]; }
static inline mask larger_whole(mask a, mask b) { return (a & (mask)(a > b)) | (b & ~(mask)(a > b)); }

#define FB_EACH(name) \
    static inline lanes v_##name(lanes a) { for (int l = 0; l < FB_LANES; l++) a[l] = name(a[l]); return a; }
#define FB_EACH_PAIR(name) \
    static inline lanes v_##name(lanes a, lanes b) { for (int l = 0; l < FB_LANES; l++) a[l] = name(a[l], b[l]); return a; }
#endif

/* The number of the first lane. */
static inline double first_of(lanes a) { double r; memcpy(&r, &a, sizeof r); return r; }

static inline lanes load(const double *from) { lanes r; memcpy(&r, from, sizeof r); return r; }
static inline void store(double *to, lanes a) { memcpy(to, &a, sizeof a); }

/* Where a comparison with what is no number decides, b is taken. */
static inline lanes v_fmin(lanes a, lanes b) { return choose(a < b, a, b); }
static inline lanes v_fmax(lanes a, lanes b) { return choose(a > b, a, b); }
static inline lanes v_fabs(lanes a) { return choose(a < 0.0, -a, a); }
static inline lanes magnitude(lanes a) { return of_bits(bits_of(a) & 0x7fffffffffffffffLL); } /* of -0 too */

/* Within a range; an end that is infinite is none. */
static inline lanes clamp(lanes a, double low, double high)
{
    if (low > -INFINITY) a = v_fmax(a, broadcast(low));
    return high < INFINITY ? v_fmin(a, broadcast(high)) : a;
}

/* Truth as numbers, 1 and 0, as the laws of a model use it. */
static inline lanes truth(mask m) { return choose(m, broadcast(1.0), broadcast(0.0)); }
static inline lanes v_sign_of(lanes a) { return truth(a > 0.0) - truth(a < 0.0); }
static inline lanes v_less(lanes a, lanes b) { return truth(a < b); }
static inline lanes v_less_equal(lanes a, lanes b) { return truth(a <= b); }
static inline lanes v_equal(lanes a, lanes b) { return truth(a == b); }
static inline lanes v_not_equal(lanes a, lanes b) { return truth(a != b); }
static inline lanes v_not_true(lanes a) { return truth(a == 0.0); }
static inline lanes v_both(lanes a, lanes b) { return truth((a != 0.0) & (b != 0.0)); }
static inline lanes v_either(lanes a, lanes b) { return truth((a != 0.0) | (b != 0.0)); }
static inline lanes v_where_true(lanes a, lanes b) { return choose(a != 0.0, b, broadcast(0.0)); }

/* The same of numbers that all lanes share. */
static inline double sign_of(double a) { return a > 0.0 ? 1.0 : (a < 0.0 ? -1.0 : 0.0); }
static inline double less(double a, double b) { return a < b; }
static inline double less_equal(double a, double b) { return a <= b; }
static inline double equal(double a, double b) { return a == b; }
static inline double not_equal(double a, double b) { return a != b; }
static inline double not_true(double a) { return a == 0.0; }
static inline double both(double a, double b) { return a != 0.0 && b != 0.0; }
static inline double either(double a, double b) { return a != 0.0 || b != 0.0; }
static inline double where_true(double a, double b) { return a != 0.0 ? b : 0.0; }

#endif
