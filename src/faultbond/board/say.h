/* Lines of an image: texts and numbers, without a C library. */
#ifndef BOARD_SAY_H
#define BOARD_SAY_H

#include <math.h>

#include "decimal.h"
#include "host.h"

#define SAY_ROOM 128 /* bytes that are said at a time */

typedef struct {
    char text[SAY_ROOM + 1];
    int n;
} Saying;

static void say_now(Saying *saying)
{
    saying->text[saying->n] = '\0';
    host_text(saying->text);
    saying->n = 0;
}

static void say(Saying *saying, const char *text)
{
    for (; *text; text++) {
        if (saying->n == SAY_ROOM) say_now(saying);
        saying->text[saying->n++] = *text;
    }
}

static void say_whole(Saying *saying, int64_t value)
{
    char digits[24];
    int n = (int)sizeof digits - 1;
    uint64_t left = value < 0 ? 0 - (uint64_t)value : (uint64_t)value;
    digits[n] = '\0';
    do {
        digits[--n] = (char)('0' + left % 10);
        left /= 10;
    } while (left);
    if (value < 0) digits[--n] = '-';
    say(saying, digits + n);
}

/* A number by its shortest digits, as d.ddde-3; what is not finite as null. */
static void say_number(Saying *saying, double value)
{
    char digit[2] = {'0', '\0'};
    if (!isfinite(value)) {
        say(saying, "null");
        return;
    }
    if (value < 0.0) say(saying, "-");
    if (value == 0.0) {
        say(saying, "0.0");
        return;
    }
    const Decimal decimal = shortest_decimal(fabs(value));
    for (int k = 0; k < decimal.n; k++) {
        if (k == 1) say(saying, ".");
        digit[0] = (char)('0' + decimal.digit[k]);
        say(saying, digit);
    }
    say(saying, "e");
    say_whole(saying, decimal.point - 1);
}

#endif
