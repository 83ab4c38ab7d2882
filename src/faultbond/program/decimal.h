/* The shortest decimal digits that read back as a number, and of those the nearest to it. So a number stands in a record as
   Python writes it, on every machine alike: the C library is not asked.

   v = f 2^e lies between two neighbours; what lies less than half the way to them reads back as v, and at half the way where
   f is even. Digits of r / s are made until the rest is less than that way, m below and above. Whole numbers of any length.
   Source: G. L. Steele, J. L. White, How to print floating-point numbers accurately, PLDI 1990, in the form of R. G. Burger,
   R. K. Dybvig, Printing floating-point numbers quickly and accurately, PLDI 1996, free format. */
#ifndef WATCH_DECIMAL_H
#define WATCH_DECIMAL_H

#include <stdint.h>
#include <string.h>

#define MOST_DIGITS 17
#define LARGE_WORDS 38      /* 2^1077 times 10^324 is never needed; 2^1130 and a digit is the most */
#define FRACTION_BITS 52
#define LEAST_POWER (-1074) /* of two, in numbers next to zero */
#define LOG10_OF_2 0.30102999566398120

/* 0.d1 d2 d3 ... times 10^point. */
typedef struct {
    int n, point;
    char digit[MOST_DIGITS]; /* 0 to 9 */
} Decimal;

/* A whole number, the lowest word first; words from n on are zero. */
typedef struct {
    int n;
    uint32_t word[LARGE_WORDS];
} Large;

static void large_set(Large *a, uint64_t value)
{
    memset(a, 0, sizeof *a);
    a->word[0] = (uint32_t)(value & 0xffffffffu);
    a->word[1] = (uint32_t)(value >> 32);
    a->n = a->word[1] ? 2 : a->word[0] ? 1 : 0;
}

static void large_times(Large *a, uint32_t factor)
{
    uint64_t carry = 0;
    for (int k = 0; k < a->n; k++) {
        carry += (uint64_t)a->word[k] * factor;
        a->word[k] = (uint32_t)(carry & 0xffffffffu);
        carry >>= 32;
    }
    if (carry) a->word[a->n++] = (uint32_t)carry;
}

static void large_times_power_of_two(Large *a, int power)
{
    const int words = power / 32, bits = power % 32;
    if (a->n == 0) return;
    memmove(a->word + words, a->word, (size_t)a->n * sizeof a->word[0]);
    memset(a->word, 0, (size_t)words * sizeof a->word[0]);
    a->n += words;
    large_times(a, (uint32_t)1 << bits);
}

static void large_times_power_of_ten(Large *a, int power)
{
    for (; power >= 9; power -= 9) large_times(a, 1000000000u);
    for (; power > 0; power--) large_times(a, 10u);
}

/* Below, at or above zero where a + b is less than, equal to or more than c; b may be NULL. */
static int large_compare(const Large *a, const Large *b, const Large *c)
{
    int64_t over = 0; /* what is left of a + b - c from the words above, in units of the word at hand */
    int n = a->n > c->n ? a->n : c->n;
    if (b && b->n > n) n = b->n;
    for (int k = n - 1; k >= 0; k--) {
        over = over * 4294967296 + (int64_t)a->word[k] + (b ? (int64_t)b->word[k] : 0) - (int64_t)c->word[k];
        if (over > 2 || over < -2) return over > 0 ? 1 : -1; /* words below bring less than two of these */
    }
    return over > 0 ? 1 : over < 0 ? -1 : 0;
}

/* a - b, which is not negative. */
static void large_take(Large *a, const Large *b)
{
    int64_t borrow = 0;
    for (int k = 0; k < a->n; k++) {
        const int64_t rest = (int64_t)a->word[k] - (int64_t)b->word[k] - borrow;
        borrow = rest < 0;
        a->word[k] = (uint32_t)((uint64_t)rest & 0xffffffffu);
    }
    while (a->n > 0 && a->word[a->n - 1] == 0) a->n--;
}

/* What is worked on: the rest r of r / s, how far digits may stray to each side, and whether as far as that is near enough. */
typedef struct {
    Large r, s, below, above;
    int ends_count;
} Digits;

/* The digits of a number in units of their least power of ten, and which power stands before the first: v = r / s. */
static int begin_digits(Digits *work, uint64_t fraction, int power)
{
    const int is_edge = fraction == (uint64_t)1 << FRACTION_BITS && power > LEAST_POWER; /* below it, steps are half as long */
    int bits = -1, tens;
    for (uint64_t left = fraction; left; left >>= 1) bits++;
    large_set(&work->r, fraction);
    large_set(&work->s, 1);
    large_set(&work->below, 1);
    large_times_power_of_two(&work->r, (power > 0 ? power : 0) + 1 + is_edge);
    large_times_power_of_two(&work->s, (power < 0 ? -power : 0) + 1 + is_edge);
    large_times_power_of_two(&work->below, power > 0 ? power : 0);
    work->above = work->below;
    large_times_power_of_two(&work->above, is_edge);
    work->ends_count = !(fraction & 1);
    const double log = (bits + power) * LOG10_OF_2 - 1e-10; /* v is at least 10^log, and less than twice that */
    tens = (int)log + (log > 0.0);
    large_times_power_of_ten(&work->s, tens > 0 ? tens : 0);
    large_times_power_of_ten(&work->r, tens < 0 ? -tens : 0);
    large_times_power_of_ten(&work->below, tens < 0 ? -tens : 0);
    large_times_power_of_ten(&work->above, tens < 0 ? -tens : 0);
    const int beyond = large_compare(&work->r, &work->above, &work->s);
    if (beyond > 0 || (beyond == 0 && work->ends_count)) {
        large_times(&work->s, 10u);
        tens++;
    }
    return tens;
}

/* The next digit, r = r - digit s. */
static int next_digit(Digits *work)
{
    int digit = 0;
    large_times(&work->r, 10u);
    large_times(&work->below, 10u);
    large_times(&work->above, 10u);
    for (; large_compare(&work->r, NULL, &work->s) >= 0; digit++) large_take(&work->r, &work->s);
    return digit;
}

/* The digits of a positive finite number. */
static Decimal shortest_decimal(double value)
{
    Digits work;
    Decimal found;
    uint64_t word;
    memcpy(&word, &value, sizeof word);
    const int exponent = (int)(word >> FRACTION_BITS & 0x7ff);
    const uint64_t low = word & (((uint64_t)1 << FRACTION_BITS) - 1);
    memset(&found, 0, sizeof found);
    found.point = exponent ? begin_digits(&work, low | (uint64_t)1 << FRACTION_BITS, exponent - 1 + LEAST_POWER)
                           : begin_digits(&work, low, LEAST_POWER);
    for (int near_below = 0, near_above = 0; !near_below && !near_above;) {
        int digit = next_digit(&work);
        const int below = large_compare(&work.r, NULL, &work.below), above = large_compare(&work.r, &work.above, &work.s);
        near_below = below < 0 || (below == 0 && work.ends_count);
        near_above = above > 0 || (above == 0 && work.ends_count);
        if (near_above) {
            const int half = large_compare(&work.r, &work.r, &work.s);
            digit += !near_below || half > 0 || (half == 0 && digit % 2 == 1);
        }
        found.digit[found.n++] = (char)digit;
    }
    return found;
}

#endif
