/* Numbers of a text, as Python's float() reads them, but without `_`: each the double that is nearest. */
#ifndef WATCH_NUMBER_H
#define WATCH_NUMBER_H

#include <float.h>
#include <math.h>
#include <stdlib.h>

#include "text.h"

#define NUMBER_WIDTH 512  /* bytes of a number with digits of other scripts; a longer one is none */
#define FARTHEST 1000000  /* of an exponent: what is beyond is 0 or infinite */
#define FROM_POWER (-40)  /* of FIVES */
#define TO_POWER 22

/* 5^q for q from FROM_POWER on, as 64 bits of which the first is 1, cut off behind them: 5^q = FIVES * 2^(e - 63) with e the
   whole part of q log2 5. */
static const uint64_t FIVES[TO_POWER - FROM_POWER + 1] = {
    0x8b61313bbabce2c6ULL, 0xae397d8aa96c1b77ULL, 0xd9c7dced53c72255ULL, 0x881cea14545c7575ULL, 0xaa242499697392d2ULL,
    0xd4ad2dbfc3d07787ULL, 0x84ec3c97da624ab4ULL, 0xa6274bbdd0fadd61ULL, 0xcfb11ead453994baULL, 0x81ceb32c4b43fcf4ULL,
    0xa2425ff75e14fc31ULL, 0xcad2f7f5359a3b3eULL, 0xfd87b5f28300ca0dULL, 0x9e74d1b791e07e48ULL, 0xc612062576589ddaULL,
    0xf79687aed3eec551ULL, 0x9abe14cd44753b52ULL, 0xc16d9a0095928a27ULL, 0xf1c90080baf72cb1ULL, 0x971da05074da7beeULL,
    0xbce5086492111aeaULL, 0xec1e4a7db69561a5ULL, 0x9392ee8e921d5d07ULL, 0xb877aa3236a4b449ULL, 0xe69594bec44de15bULL,
    0x901d7cf73ab0acd9ULL, 0xb424dc35095cd80fULL, 0xe12e13424bb40e13ULL, 0x8cbccc096f5088cbULL, 0xafebff0bcb24aafeULL,
    0xdbe6fecebdedd5beULL, 0x89705f4136b4a597ULL, 0xabcc77118461cefcULL, 0xd6bf94d5e57a42bcULL, 0x8637bd05af6c69b5ULL,
    0xa7c5ac471b478423ULL, 0xd1b71758e219652bULL, 0x83126e978d4fdf3bULL, 0xa3d70a3d70a3d70aULL, 0xccccccccccccccccULL,
    0x8000000000000000ULL, 0xa000000000000000ULL, 0xc800000000000000ULL, 0xfa00000000000000ULL, 0x9c40000000000000ULL,
    0xc350000000000000ULL, 0xf424000000000000ULL, 0x9896800000000000ULL, 0xbebc200000000000ULL, 0xee6b280000000000ULL,
    0x9502f90000000000ULL, 0xba43b74000000000ULL, 0xe8d4a51000000000ULL, 0x9184e72a00000000ULL, 0xb5e620f480000000ULL,
    0xe35fa931a0000000ULL, 0x8e1bc9bf04000000ULL, 0xb1a2bc2ec5000000ULL, 0xde0b6b3a76400000ULL, 0x8ac7230489e80000ULL,
    0xad78ebc5ac620000ULL, 0xd8d726b7177a8000ULL, 0x878678326eac9000ULL};

/* The upper 64 bits of a product. */
static inline uint64_t upper_product(uint64_t a, uint64_t b)
{
    const uint64_t low = (a & 0xFFFFFFFFu) * (b & 0xFFFFFFFFu), left = (a >> 32) * (b & 0xFFFFFFFFu);
    const uint64_t right = (a & 0xFFFFFFFFu) * (b >> 32);
    const uint64_t middle = (low >> 32) + (left & 0xFFFFFFFFu) + (right & 0xFFFFFFFFu);
    return (a >> 32) * (b >> 32) + (left >> 32) + (right >> 32) + (middle >> 32);
}

/* digits * 10^power where 64 bits of the product tell how it is rounded; else, about once in 500 times, 0.

   With digits = w 2^-s, w of 64 bits, the product is between P and P + w, P = w FIVES: its upper 64 bits are known up to 2.
   They round to 53 in one way unless what is cut off is as near as that to one half. */
static inline int round_product(uint64_t digits, int power, double *value)
{
    int shift = 0;
    while (digits >> 63 == 0) {
        digits <<= 1;
        shift++;
    }
    const uint64_t upper = upper_product(digits, FIVES[power - FROM_POWER]);
    const int cut = upper >> 63 != 0 ? 11 : 10;
    const uint64_t half = 1ULL << (cut - 1), rest = upper & (2 * half - 1);
    if (rest == half || rest == half - 1) return 0;
    const uint64_t whole = (upper >> cut) + (rest > half);
    const int fives = (power * 152170 - (power < 0 ? 65535 : 0)) / 65536; /* the whole part of power * log2 5 */
    *value = ldexp((double)whole, cut + 64 + fives - 63 + power - shift);
    return 1;
}

/* digits * 10^power, rounded once; 0 where that takes more. Up to 2^53 and 10^22 both factors are doubles, so that one
   operation rounds (Clinger 1990). */
static inline int compose(uint64_t digits, int power, double *value)
{
    static const double TENS[] = {1e0,  1e1,  1e2,  1e3,  1e4,  1e5,  1e6,  1e7,  1e8,  1e9,  1e10, 1e11,
                                  1e12, 1e13, 1e14, 1e15, 1e16, 1e17, 1e18, 1e19, 1e20, 1e21, 1e22};
    if (digits == 0) {
        *value = 0.0;
        return 1;
    }
#if FLT_EVAL_METHOD == 0
    if (digits <= 1ULL << 53 && power >= -22 && power <= 22) {
        *value = power < 0 ? (double)digits / TENS[-power] : (double)digits * TENS[power];
        return 1;
    }
#else
    (void)TENS;
#endif
    return power >= FROM_POWER && power <= TO_POWER && round_product(digits, power, value);
}

/* Read an exponent behind its e; NULL where there is none. */
static inline const char *read_exponent(const char *at, int64_t *power)
{
    const int is_negative = *at == '-';
    int64_t size = 0;
    at += *at == '-' || *at == '+';
    if (!is_digit(*at)) return NULL;
    for (; is_digit(*at); at++)
        if (size < FARTHEST) size = 10 * size + (*at - '0');
    *power += is_negative ? -size : size;
    return at;
}

/* Read the number that begins at `at` without a blank; gives where it ends, or NULL where there is none. The text behind it
   must not go on a number, as a separator does not. */
static inline const char *read_number(const char *at, double *value)
{
    const char *const begin = at;
    const int is_negative = *at == '-';
    at += *at == '-' || *at == '+';
    uint64_t digits = 0;
    const char *const first = at;
    for (; is_digit(*at); at++) digits = 10 * digits + (uint64_t)(*at - '0');
    int64_t n = at - first, power = 0;
    if (*at == '.') {
        const char *const point = ++at;
        for (; is_digit(*at); at++) digits = 10 * digits + (uint64_t)(*at - '0');
        power = point - at;
        n -= power;
    }
    if (n == 0) return NULL;
    if (n > 19) /* zeros before the first other digit do not count */
        for (const char *zero = first; *zero == '0' || *zero == '.'; zero++) n -= *zero == '0';
    if (*at == 'e' || *at == 'E') at = read_exponent(at + 1, &power);
    if (at == NULL) return NULL;
    const int is_near = n <= 19 && power > -FARTHEST && power < FARTHEST;
    if (is_near && compose(digits, (int)power, value))
        *value = is_negative ? -*value : *value;
    else
        *value = strtod(begin, NULL); /* in the locale "C", where a program begins */
    return at;
}

/* The number that a text is that ends with 0, blanks about it apart; nan where it is none, or none that is finite. */
static inline double number_in(const char *text)
{
    char plain[NUMBER_WIDTH];
    size_t n = 0;
    int is_plain = 1;
    double value = NAN;
    for (const char *at = text; *at != '\0'; at++) is_plain = is_plain && (unsigned char)*at < 0x80;
    if (!is_plain) { /* float() takes digits and blanks of all scripts */
        while (*text != '\0') {
            const uint32_t letter = text_letter(&text);
            const int digit = text_digit(letter);
            if (n + 1 == NUMBER_WIDTH || (letter >= 0x80 && digit < 0 && !text_is_space(letter))) return NAN;
            plain[n++] = letter < 0x80 ? (char)letter : digit < 0 ? ' ' : (char)('0' + digit);
        }
        plain[n] = '\0';
        text = plain;
    }
    while (is_ascii_space(*text)) text++;
    text = read_number(text, &value);
    while (text != NULL && is_ascii_space(*text)) text++;
    return text != NULL && *text == '\0' && isfinite(value) ? value : NAN;
}

#endif
