/* JSON as Python writes it: numbers by their shortest digits, what is not finite as null, letters as they are. One line for
   each record; after a value a comma comes before the next. */
#ifndef WATCH_JSON_H
#define WATCH_JSON_H

#include "decimal.h"
#include "out.h"

#define LEAST_POINT (-3) /* numbers from 0.0001 on, */
#define MOST_POINT 16    /* and below 1e16, are written without an exponent */

typedef struct {
    Out *out;
    int follows; /* whether a value stands before, so that a comma is needed */
} Json;

static void json_next(Json *json)
{
    if (json->follows) out_text(json->out, ", ");
    json->follows = 1;
}

/* A text in UTF-8, as it stands between quotation marks. */
static void write_escaped(Out *out, const char *text)
{
    static const char letters[] = "btn?fr", hex[] = "0123456789abcdef"; /* of 8 to 13 */
    for (; *text; text++) {
        const unsigned char code = (unsigned char)*text;
        if (code == '"' || code == '\\') {
            out_byte(out, '\\');
            out_byte(out, *text);
        } else if (code >= 8 && code <= 13 && code != 11) {
            out_byte(out, '\\');
            out_byte(out, letters[code - 8]);
        } else if (code < 32) {
            out_text(out, "\\u00");
            out_byte(out, hex[code / 16]);
            out_byte(out, hex[code % 16]);
        } else {
            out_byte(out, *text);
        }
    }
}

/* Open an object or a list, with { or [, and close it. */
static void json_open(Json *json, char bracket)
{
    json_next(json);
    out_byte(json->out, bracket);
    json->follows = 0;
}

static void json_close(Json *json, char bracket)
{
    out_byte(json->out, bracket);
    json->follows = 1;
}

static void json_key(Json *json, const char *name)
{
    json_next(json);
    out_byte(json->out, '"');
    write_escaped(json->out, name);
    out_text(json->out, "\": ");
    json->follows = 0;
}

/* A key of two words with a dot between. */
static void json_key_of_two(Json *json, const char *first, const char *second)
{
    json_next(json);
    out_byte(json->out, '"');
    write_escaped(json->out, first);
    out_byte(json->out, '.');
    write_escaped(json->out, second);
    out_text(json->out, "\": ");
    json->follows = 0;
}

static void json_text(Json *json, const char *text)
{
    json_next(json);
    out_byte(json->out, '"');
    write_escaped(json->out, text);
    out_byte(json->out, '"');
}

static void json_word(Json *json, const char *word)
{
    json_next(json);
    out_text(json->out, word);
}

static void json_none(Json *json) { json_word(json, "null"); }

static void json_truth(Json *json, int64_t is_true) { json_word(json, is_true ? "true" : "false"); }

static void write_whole(Out *out, int64_t value)
{
    char digits[20];
    int n = 0;
    uint64_t left = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    do {
        digits[n++] = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (value < 0) out_byte(out, '-');
    while (n > 0) out_byte(out, digits[--n]);
}

static void json_whole(Json *json, int64_t value)
{
    json_next(json);
    write_whole(json->out, value);
}

/* Digits of a decimal from `first` up to before `end`; where there are none, zeros. */
static void write_digits(Out *out, const Decimal *decimal, int first, int end)
{
    for (int k = first; k < end; k++) out_byte(out, (char)('0' + (k >= 0 && k < decimal->n ? decimal->digit[k] : 0)));
}

static void write_real(Out *out, double value)
{
    uint64_t bits;
    memcpy(&bits, &value, sizeof bits);
    if (bits >> 63) out_byte(out, '-');
    if (bits << 1 == 0) {
        out_text(out, "0.0");
        return;
    }
    const Decimal decimal = shortest_decimal(value < 0.0 ? -value : value);
    const int point = decimal.point;
    if (point >= LEAST_POINT && point <= MOST_POINT) {
        write_digits(out, &decimal, point < 1 ? -1 : 0, point < 1 ? 0 : point); /* a zero, where there is none before the point */
        out_byte(out, '.');
        write_digits(out, &decimal, point, decimal.n > point + 1 ? decimal.n : point + 1);
        return;
    }
    write_digits(out, &decimal, 0, 1);
    if (decimal.n > 1) out_byte(out, '.');
    write_digits(out, &decimal, 1, decimal.n);
    out_text(out, point > 0 ? "e+" : "e-");
    const int exponent = point > 0 ? point - 1 : 1 - point;
    if (exponent < 10) out_byte(out, '0');
    write_whole(out, exponent);
}

/* A number; null where it is none, or has no end. */
static void json_real(Json *json, double value)
{
    if (!(value - value == 0.0)) {
        json_none(json);
        return;
    }
    json_next(json);
    write_real(json->out, value);
}

/* End a record, and write it. */
static void json_end(Json *json)
{
    out_end_line(json->out);
    json->follows = 0;
}

#endif
