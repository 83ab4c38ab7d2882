/* Moments as ISO 8601 writes them, or with the day first, in Unix seconds. */
#ifndef WATCH_MOMENT_H
#define WATCH_MOMENT_H

#include "number.h"

#define DAY 86400

/* Part of a day: hours, minutes, seconds and millionths of one. */
typedef struct {
    int hour, minute, second, millionths;
} DayTime;

/* Read so many digits; gives where they end, or NULL. */
static inline const char *read_digits(const char *at, int n, int *value)
{
    *value = 0;
    for (; n > 0; n--, at++) {
        if (!is_digit(*at)) return NULL;
        *value = 10 * *value + (*at - '0');
    }
    return at;
}

/* Read HH, HH:MM, HH:MM:SS or the same without colons, and behind seconds a fraction of any length, of which six digits
   count; gives where it ends, or NULL. */
static inline const char *read_day_time(const char *at, DayTime *time)
{
    time->minute = time->second = time->millionths = 0;
    at = read_digits(at, 2, &time->hour);
    if (at == NULL) return NULL;
    const int has_colons = *at == ':';
    if (!has_colons && !is_digit(*at)) return at;
    at = read_digits(at + has_colons, 2, &time->minute);
    if (at == NULL || (has_colons ? *at != ':' : !is_digit(*at))) return at;
    at = read_digits(at + has_colons, 2, &time->second);
    if (at == NULL || (*at != '.' && *at != ',')) return at;
    if (!is_digit(*++at)) return NULL;
    for (int unit = 100000; is_digit(*at); unit /= 10) time->millionths += unit * (*at++ - '0');
    return at;
}

/* Days since 1970 of the first of January of a year. */
static inline int64_t days_before_year(int year)
{
    const int64_t before = year - 1;
    return 365 * before + before / 4 - before / 100 + before / 400 - 719162;
}

/* Read what follows the year of YYYY-Www, YYYY-Www-D, YYYYWww or YYYYWwwD, as days since 1970; gives where it ends, or NULL
   where there is no such week. A year's first week is the one with its first Thursday. */
static inline const char *read_week(const char *at, int year, int64_t *days)
{
    int week, day = 1;
    const int has_dash = *at == '-';
    at = read_digits(at + has_dash + 1, 2, &week);
    if (at == NULL) return NULL;
    if (*at == '-' ? has_dash : !has_dash && is_digit(*at)) at = read_digits(at + has_dash, 1, &day);
    if (at != NULL && is_digit(*at)) return NULL;
    const int64_t first = days_before_year(year), next = days_before_year(year + 1);
    const int64_t weekday = ((first + 3) % 7 + 7) % 7, after = ((next + 3) % 7 + 7) % 7; /* 0: Monday */
    const int64_t begin = first - weekday + 7 * (weekday > 3), end = next - after + 7 * (after > 3);
    if (at == NULL || year < 1 || week < 1 || day < 1 || day > 7 || begin + 7 * (week - 1) >= end) return NULL;
    *days = begin + 7 * (week - 1) + day - 1;
    return at;
}

/* Read D.M.YYYY, with one or two digits of day and month; gives where it ends, or NULL where it is of another form. */
static inline const char *read_day_first(const char *at, int *year, int *month, int *day)
{
    at = read_digits(at, 1 + (is_digit(*at) && is_digit(at[1])), day);
    if (at == NULL || *at++ != '.') return NULL;
    at = read_digits(at, 1 + (is_digit(*at) && is_digit(at[1])), month);
    if (at == NULL || *at++ != '.') return NULL;
    at = read_digits(at, 4, year);
    return at != NULL && !is_digit(*at) ? at : NULL;
}

/* Read YYYY-MM-DD or YYYYMMDD, the week of a year, or D.M.YYYY, as days since 1970; gives where it ends, or NULL where there
   is no such day. */
static inline const char *read_date(const char *at, int64_t *days)
{
    static const int BEFORE_MONTH[] = {0, 31, 59, 90, 120, 151, 181, 212, 243, 273, 304, 334, 365};
    int year, month, day;
    const char *const end = read_day_first(at, &year, &month, &day);
    if (end == NULL) {
        at = read_digits(at, 4, &year);
        if (at == NULL) return NULL;
        const int has_dashes = *at == '-';
        if (at[has_dashes] == 'W') return read_week(at, year, days);
        at = read_digits(at + has_dashes, 2, &month);
        if (at == NULL || (has_dashes && *at != '-')) return NULL;
        at = read_digits(at + has_dashes, 2, &day);
    } else
        at = end;
    if (at == NULL || year < 1 || month < 1 || month > 12 || day < 1) return NULL;
    const int is_leap = (year % 4 == 0 && year % 100 != 0) || year % 400 == 0;
    if (day > BEFORE_MONTH[month] - BEFORE_MONTH[month - 1] + (month == 2 && is_leap)) return NULL;
    *days = days_before_year(year) + BEFORE_MONTH[month - 1] + (month > 2 && is_leap) + day - 1;
    return at;
}

/* Read Z or an offset such as +01:00 up to the end of a text, in millionths of a second; nothing is UTC. Gives whether it is
   one: less than a day. */
static inline int read_zone(const char *at, int64_t *offset)
{
    DayTime time;
    *offset = 0;
    if (*at == 'Z') at++;
    if (*at == '\0') return 1;
    if (*at != '+' && *at != '-') return 0;
    const int sign = *at == '-' ? -1 : 1;
    const char *const end = at[-1] == 'Z' ? NULL : read_day_time(at + 1, &time);
    if (end == NULL || *end != '\0') return 0;
    const int64_t seconds = 3600 * (int64_t)time.hour + 60 * time.minute + time.second;
    *offset = sign * (1000000 * seconds + time.millionths);
    return *offset > -(int64_t)DAY * 1000000 && *offset < (int64_t)DAY * 1000000;
}

/* Millionths of a second as seconds, rounded once: beyond 2^53 both terms are so far apart that their sum is. */
static inline double seconds_of(int64_t millionths)
{
    if (millionths > -(1LL << 53) && millionths < 1LL << 53) return (double)millionths / 1e6;
    return (double)(millionths / 1000000) + (double)(millionths % 1000000) / 1e6;
}

/* The moment that a text is that ends with 0 and has no blanks about it: a date, and behind it any letter and a time of day,
   and a zone, in Unix seconds; nan where it is none. */
static inline double moment_in(const char *text)
{
    DayTime time = {0, 0, 0, 0};
    int64_t days, offset = 0;
    const char *at = read_date(text, &days);
    if (at == NULL) return NAN;
    if (*at != '\0') (void)text_letter(&at);
    if (*at != '\0') {
        at = read_day_time(at, &time);
        if (at == NULL || time.hour > 23 || time.minute > 59 || time.second > 59 || !read_zone(at, &offset)) return NAN;
    }
    const int64_t seconds = days * DAY + 3600 * (int64_t)time.hour + 60 * time.minute + time.second;
    return seconds_of(1000000 * seconds + time.millionths - offset);
}

#endif
