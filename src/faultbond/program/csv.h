/* The records of a CSV text that arrives in portions: lines, quotation marks, and what separates the fields. */
#ifndef WATCH_CSV_H
#define WATCH_CSV_H

#include "point.h"
#include "text.h"

#ifndef CSV_ROOM
#define CSV_ROOM 262144 /* bytes of a record, which may have several lines, and of what is read ahead */
#endif
#define CSV_MAX_LINE 200000     /* letters */
#define CSV_MAX_FIELD 131072    /* letters */
#define CSV_MAX_LINES 100       /* of a record: a quoted text may hold line breaks */
#define CSV_TITLE "standard input"

#define CSV_WAITS 0 /* the record is not whole yet; after the last bytes: there is none any more */
#define CSV_RECORD 1
#define CSV_ERROR (-1)
#define CSV_NO_ROW (-2) /* a record that says nothing for sure; the next one may */

/* A text from `begin` to `end`. whole: up to there it has whole lines. lines: number of the last line that was given.
   is_fresh: nothing was given yet. is_ended: no more come. is_padded: the last line had no end of line. */
typedef struct {
    char text[CSV_ROOM + 2];
    size_t begin, end, whole;
    int64_t lines;
    char delimiter;
    int is_fresh, is_ended, is_padded;
} Csv;

/* A record as it stands in the text, and how many lines it has. */
typedef struct {
    size_t begin, stop;
    int n_lines;
} CsvRecord;

/* Fields of a record, one after the other. */
typedef struct {
    char *at, *stop;
    char delimiter;
    int is_over;
} CsvFields;

typedef enum { FIELD_BEGINS, IN_FIELD, IN_QUOTES, BEHIND_QUOTE } CsvPlace;

/* Where the search for the end of a record stands. length: letters of the field. */
typedef struct {
    CsvPlace place;
    size_t length;
} CsvSearch;

static inline void csv_begin(Csv *csv)
{
    csv->begin = csv->end = csv->whole = 0;
    csv->lines = 0;
    csv->delimiter = ',';
    csv->is_fresh = 1;
    csv->is_ended = csv->is_padded = 0;
}

/* Pass over the mark with which some programs begin a text in UTF-8, once it is known whether it is one. */
static inline void csv_pass_mark(Csv *csv)
{
    static const char MARK[] = "\xEF\xBB\xBF";
    const size_t n = csv->end < 3 ? csv->end : 3;
    if (memcmp(csv->text, MARK, n) != 0 || (n == 0 && !csv->is_ended)) {
        csv->is_fresh = n == 0;
    } else if (n == 3 || csv->is_ended) {
        csv->begin = n;
        csv->is_fresh = 0;
    }
}

/* Find up to where there are whole lines, among the bytes from `from` on. */
static inline void csv_find_whole(Csv *csv, size_t from)
{
    for (size_t k = csv->end; k > from; k--)
        if (csv->text[k - 1] == '\n') {
            csv->whole = k;
            return;
        }
    if (csv->whole > csv->begin || csv->end - csv->begin < CSV_ROOM) return;
    for (size_t k = csv->end - 1; k > csv->begin; k--) /* lines of a text that has no \n */
        if (csv->text[k - 1] == '\r') {
            csv->whole = k;
            return;
        }
}

/* Take what there is room for of n bytes; gives how many. `last`: no more come after them. */
static inline size_t csv_take(Csv *csv, const char *bytes, size_t n, int last)
{
    if (csv->begin > 0) {
        memmove(csv->text, csv->text + csv->begin, csv->end - csv->begin);
        csv->end -= csv->begin;
        csv->whole -= csv->whole > csv->begin ? csv->begin : csv->whole;
        csv->begin = 0;
    }
    const size_t before = csv->end, room = CSV_ROOM - csv->end, taken = n < room ? n : room;
    if (taken > 0) memcpy(csv->text + csv->end, bytes, taken);
    csv->end += taken;
    if (last && taken == n) csv->is_ended = 1;
    if (csv->is_fresh) csv_pass_mark(csv);
    if (csv->is_ended && csv->end > csv->begin && csv->text[csv->end - 1] != '\n') {
        csv->text[csv->end++] = '\n';
        csv->is_padded = 1;
    }
    csv_find_whole(csv, before);
    return taken;
}

/* Where the line that begins at `from` ends, behind its end of line; 0 if it is not whole yet. */
static inline size_t csv_line_end(const Csv *csv, size_t from)
{
    if (from >= csv->whole) return 0;
    const char *const line = csv->text + from;
    const char *const end = (const char *)memchr(line, '\n', csv->whole - from);
    const size_t size = end != NULL ? (size_t)(end - line) + 1 : csv->whole - from;
    const char *const back = (const char *)memchr(line, '\r', size);
    if (back == NULL) return from + size;
    return from + (size_t)(back - line) + (back[1] == '\n' ? 2 : 1);
}

/* How many letters a line has, its end among them. */
static inline size_t csv_length(const Csv *csv, size_t from, size_t stop)
{
    return text_length(csv->text + from, csv->text + stop) - (csv->is_padded && stop == csv->end);
}

/* Look at a line: CSV_RECORD, CSV_NO_ROW where it is no text, or CSV_ERROR where it is beyond all measure. */
static inline int csv_see_line(const Csv *csv, size_t from, size_t stop, int64_t number, char *message)
{
    const char *const line = csv->text + from;
    if (stop - from >= CSV_MAX_LINE && csv_length(csv, from, stop) >= CSV_MAX_LINE) {
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: a line of more than %d,%03d characters is no row of a recording.", CSV_TITLE,
                       (long long)number, CSV_MAX_LINE / 1000, CSV_MAX_LINE % 1000);
        return CSV_ERROR;
    }
    if (memchr(line, '\0', stop - from) != NULL) {
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: this is not text in UTF-8. Recordings are CSV or Parquet files; export a spreadsheet as CSV.", CSV_TITLE,
                       (long long)number);
        return CSV_NO_ROW;
    }
    return CSV_RECORD;
}

/* Say that a record goes on and on. `n_lines`: whole ones of it. */
static inline int csv_refuse_long(const Csv *csv, int n_lines, char *message)
{
    const long long first = (long long)csv->lines + 1;
    if (n_lines > 0)
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: a quotation mark is opened here and never closed.", CSV_TITLE, first);
    else if (CSV_ROOM >= CSV_MAX_LINE && csv_length(csv, csv->begin, csv->end) >= CSV_MAX_LINE)
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: a line of more than %d,%03d characters is no row of a recording.", CSV_TITLE,
                       first, CSV_MAX_LINE / 1000, CSV_MAX_LINE % 1000);
    else
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: a line of more than %ld bytes is no row of a recording.", CSV_TITLE, first,
                       (long)CSV_ROOM);
    return CSV_ERROR;
}

/* Go on by a letter; gives whether its field is not too long. */
static inline int csv_search_letter(CsvSearch *search, char c, char delimiter)
{
    const int is_end = c == '\n' || c == '\r';
    switch (search->place) {
    case IN_QUOTES:
        if (c != '"') break;
        search->place = BEHIND_QUOTE;
        return 1;
    case BEHIND_QUOTE:
        if (c == '"') {
            search->place = IN_QUOTES;
            break;
        }
        search->place = IN_FIELD; /* fall through */
    case FIELD_BEGINS:
    case IN_FIELD:
    default:
        if (is_end || c == delimiter) {
            search->place = FIELD_BEGINS;
            search->length = 0;
            return 1;
        }
        if (c == '"' && search->place == FIELD_BEGINS) {
            search->place = IN_QUOTES;
            return 1;
        }
        search->place = IN_FIELD;
    }
    search->length += ((unsigned char)c & 0xC0u) != 0x80u;
    return search->length <= CSV_MAX_FIELD;
}

/* Find the end of the record at `begin`; nothing is changed. One that is no text ends where that shows. */
static inline int csv_find_record(const Csv *csv, CsvRecord *record, char *message)
{
    CsvSearch search = {FIELD_BEGINS, 0};
    record->n_lines = 0;
    record->begin = record->stop = csv->begin;
    do {
        const size_t from = record->stop, stop = csv_line_end(csv, from);
        if (stop == 0) {
            if (!csv->is_ended) return csv->end - csv->begin < CSV_ROOM ? CSV_WAITS : csv_refuse_long(csv, record->n_lines, message);
            return record->n_lines > 0 ? CSV_RECORD : CSV_WAITS; /* a text that is quoted up to the end */
        }
        const int64_t number = csv->lines + ++record->n_lines;
        const int seen = csv_see_line(csv, from, stop, number, message);
        if (seen != CSV_RECORD) {
            record->stop = stop;
            return seen;
        }
        for (size_t k = from; k < stop; k++) {
            if (csv_search_letter(&search, csv->text[k], csv->delimiter)) continue;
            (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: this is not a row of a CSV file (field larger than field limit (%d)).",
                           CSV_TITLE, (long long)number, CSV_MAX_FIELD);
            return CSV_ERROR;
        }
        record->stop = stop;
        if (record->n_lines > CSV_MAX_LINES) return csv_refuse_long(csv, record->n_lines, message);
    } while (search.place == IN_QUOTES);
    return CSV_RECORD;
}

/* Go behind a record. */
static inline void csv_pass(Csv *csv, const CsvRecord *record)
{
    csv->begin = record->stop;
    csv->lines += record->n_lines;
}

/* Whether a record is an empty line. */
static inline int csv_is_empty(const Csv *csv) { return csv->text[csv->begin] == '\n' || csv->text[csv->begin] == '\r'; }

static inline CsvFields csv_fields(Csv *csv, const CsvRecord *record)
{
    CsvFields fields = {csv->text + record->begin, csv->text + record->stop, csv->delimiter, 0};
    return fields;
}

/* Give the next field, which ends with 0, without its quotation marks; NULL where there is none. It is made in the place of
   the record, so that this works once. */
static inline char *csv_field(CsvFields *fields)
{
    char *const begin = fields->at, *const stop = fields->stop;
    char *at = begin, *to = begin;
    if (fields->is_over) return NULL;
    if (at < stop && *at == '"') {
        for (at++; at < stop && (*at != '"' || at[1] == '"'); at++) {
            at += *at == '"';
            *to++ = *at;
        }
        at += at < stop;
    }
    while (at < stop && *at != fields->delimiter && *at != '\n' && *at != '\r') *to++ = *at++;
    fields->is_over = at >= stop || *at != fields->delimiter;
    fields->at = at + 1;
    *to = '\0';
    return begin;
}

/* Count how often a letter stands in the first line. */
static inline size_t csv_count(const char *at, const char *stop, char c)
{
    size_t n = 0;
    for (; at < stop; at++) n += *at == c;
    return n;
}

/* Find what separates the fields, by the first line that is not empty; lines before it are passed over. CSV_RECORD where it
   is known, CSV_WAITS where no such line is there. */
static inline int csv_find_delimiter(Csv *csv, char *message)
{
    static const char DELIMITERS[] = ",;\t";
    for (;;) {
        const size_t stop = csv_line_end(csv, csv->begin);
        if (stop == 0) return csv->is_ended || csv->end - csv->begin < CSV_ROOM ? CSV_WAITS : csv_refuse_long(csv, 0, message);
        if (csv_see_line(csv, csv->begin, stop, csv->lines + 1, message) != CSV_RECORD) return CSV_ERROR;
        const char *const line = csv->text + csv->begin, *const end = csv->text + stop;
        size_t size = stop - csv->begin, most = 0;
        while (size > 0 && (line[size - 1] == '\n' || line[size - 1] == '\r')) size--;
        if (size == 0) {
            csv->begin = stop;
            csv->lines++;
            continue;
        }
        size_t n_strange = 0;
        for (const char *at = line; at < end;) n_strange += text_letter(&at) == TEXT_REPLACED;
        if (n_strange > csv_length(csv, csv->begin, stop) / 10) {
            (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: this is not text in UTF-8. Recordings are CSV or Parquet files; export a spreadsheet as CSV.", CSV_TITLE,
                           (long long)csv->lines + 1);
            return CSV_ERROR;
        }
        for (const char *c = DELIMITERS; *c != '\0'; c++) {
            const size_t n = csv_count(line, end, *c);
            if (n <= most && c != DELIMITERS) continue;
            csv->delimiter = *c;
            most = n;
        }
        return CSV_RECORD;
    }
}

#endif
