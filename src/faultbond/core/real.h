/* Numbers compared, of one plant or of some side by side; see `watching.h`. */

/* The larger, and the smaller, of two numbers; what is no number stays none. */
static inline real larger(real a, real b) { return PICK((a >= b) | (a != a), a, b); }
static inline real smaller(real a, real b) { return PICK((a <= b) | (a != a), a, b); }

/* The same of two that are numbers. */
static inline real lesser(real a, real b) { return PICK(a < b, a, b); }
static inline real greater(real a, real b) { return PICK(a > b, a, b); }

static inline flag is_finite(real a) { return a - a == 0.0; }
static inline real positive(real sum) { return PICK(sum > 0.0, sum, SAME(0.0)); }
