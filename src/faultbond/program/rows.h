/* Rows in SI: where the columns of the model stand in a recording, and how its records become rows. */
#ifndef WATCH_ROWS_H
#define WATCH_ROWS_H

#include "csv.h"
#include "likeness.h"
#include "moment.h"

#include <stdlib.h>

#define N_COLUMNS (1 + N_INPUTS + N_OUTPUTS) /* time, inputs, sensors: so are the tables of columns.h */
#define SHOWN_COLUMNS 20
#define SHOWN_LETTERS 40
#define SAID_LETTERS 200 /* of a field that is shown in a message */
#define TOLD_COLUMNS 6   /* of which it is said that they hold text */

/* place: of each column in a record; -1: it has none. wanted: the places in order, each once. slot: of each column in
   `wanted`. count: rows so far. first_time: of the first row, where there is no column of time. is_told: whether it was said that
   a column holds text; n_told: of how many; tell: takes a line of what is said beside the records, without an end of line. */
typedef struct {
    int64_t n_fields, place[N_COLUMNS], wanted[N_COLUMNS];
    int slot[N_COLUMNS], n_wanted;
    int64_t count;
    double first_time;
    int is_told[N_COLUMNS], n_told;
    void (*tell)(const char *line);
} Layout;

/* Whether a column is looked for. */
static inline int column_is_needed(int column, int has_time) { return column > 0 || READ_TIME == 1 || (READ_TIME == 2 && has_time); }

/* Say what the first columns of a recording are. `names`: n texts, one behind the other. */
static inline void add_names(char *message, const char *names, int64_t n)
{
    for (int64_t k = 0; k < n && k < SHOWN_COLUMNS; k++, names += strlen(names) + 1) {
        if (k > 0) text_add(message, MESSAGE_ROOM, ", ", 2);
        text_add(message, MESSAGE_ROOM, names, SHOWN_LETTERS);
    }
    if (n <= SHOWN_COLUMNS) return;
    const size_t said = strlen(message);
    (void)snprintf(message + said, MESSAGE_ROOM - said, " and %lld more", (long long)(n - SHOWN_COLUMNS));
}

/* Say that a column is not there, or is there `times`, and what is there. */
static inline int refuse_header(int column, int times, const char *names, int64_t n, char *message)
{
    const char *const shown = COLUMN_SHOWN[column], *name = names;
    int64_t n_numbers = 0;
    for (int64_t k = 0; k < n; k++, name += strlen(name) + 1) n_numbers += isfinite(number_in(name)) != 0;
    if (times > 0) {
        (void)snprintf(message, MESSAGE_ROOM, "%s: column %s (%s) appears %d times. Leave one of them.", CSV_TITLE, shown, COLUMN_ROLE[column], times);
    } else if (n_numbers == n) {
        (void)snprintf(message, MESSAGE_ROOM, "%s: the first row holds numbers; it must name the columns, among them %s.", CSV_TITLE,
                       shown);
    } else {
        (void)snprintf(message, MESSAGE_ROOM, "%s: no column %s (%s); found: ", CSV_TITLE, shown, COLUMN_ROLE[column]);
        add_names(message, names, n);
        const int first = READ_TIME == 0; /* no column is looked for as the time */
        add_advice(message, COLUMN_HEADER[column], names, n, COLUMN_HEADER + first, N_COLUMNS - first);
    }
    return CSV_ERROR;
}

/* Put the names of a header one behind the other, in the place of the record. Gives how many there are. */
static inline int64_t take_names(Csv *csv, const CsvRecord *record, int *says)
{
    CsvFields fields = csv_fields(csv, record);
    char *to = fields.at;
    int64_t n = 0;
    *says = 0;
    for (char *field = csv_field(&fields); field != NULL; field = csv_field(&fields), n++) {
        const char *const name = text_strip(field);
        const size_t size = strlen(name) + 1;
        *says = *says || size > 1;
        memmove(to, name, size);
        to += size;
    }
    return n;
}

/* Find a column among the names of a header; gives how often it is there. */
static inline int find_column(int column, const char *names, int64_t n, int64_t *place)
{
    int times = 0;
    *place = -1;
    for (int64_t k = 0; k < n; k++, names += strlen(names) + 1) {
        if (strcmp(names, COLUMN_HEADER[column]) != 0) continue;
        if (times == 0) *place = k;
        times++;
    }
    return times;
}

/* List the places of all columns in order, each once. */
static inline void order_places(Layout *layout)
{
    layout->n_wanted = 0;
    for (int c = 0; c < N_COLUMNS; c++) {
        int k = layout->n_wanted;
        while (k > 0 && layout->wanted[k - 1] > layout->place[c]) k--;
        if (layout->place[c] < 0 || (k > 0 && layout->wanted[k - 1] == layout->place[c])) continue;
        for (int later = layout->n_wanted++; later > k; later--) layout->wanted[later] = layout->wanted[later - 1];
        layout->wanted[k] = layout->place[c];
    }
    for (int c = 0; c < N_COLUMNS; c++) {
        layout->slot[c] = 0;
        while (layout->place[c] >= 0 && layout->wanted[layout->slot[c]] != layout->place[c]) layout->slot[c]++;
    }
}

/* Take a header: gives CSV_RECORD or CSV_ERROR. No record at all is an empty one. */
static inline int layout_begin(Layout *layout, Csv *csv, const CsvRecord *record, char *message)
{
    const char *const names = csv->text + csv->begin;
    int says = 0, has_time = 0;
    layout->count = layout->n_told = 0;
    memset(layout->is_told, 0, sizeof layout->is_told);
    layout->n_fields = record != NULL ? take_names(csv, record, &says) : 0;
    if (!says) {
        (void)snprintf(message, MESSAGE_ROOM, "%s: it is empty. The first row must name the columns.", CSV_TITLE);
        return CSV_ERROR;
    }
    for (int c = 0; c < N_COLUMNS; c++) {
        const int times = c > 0 || READ_TIME != 0 ? find_column(c, names, layout->n_fields, &layout->place[c]) : 0;
        if (c == 0) has_time = times > 0;
        if (!column_is_needed(c, has_time))
            layout->place[c] = -1;
        else if (times != 1)
            return refuse_header(c, times, names, layout->n_fields, message);
    }
    order_places(layout);
    return CSV_RECORD;
}

/* The value of a column in SI. */
static inline double to_si(int column, double value) { return COLUMN_FACTOR[column] * value + COLUMN_OFFSET[column]; }

/* The time of the row that comes next where there is no column of it. */
static inline double numbered_time(const Layout *layout)
{
    return layout->first_time + (double)layout->count * READ_NUMBERED_STEP;
}

/* Put numbers into a row: in SI, of each of the wanted places one, nan where there is none. Values at an end of their range,
   of inputs those beyond it, are absent. */
static inline void fill_row(const Layout *layout, const double *numbers, TableRow *row)
{
    row->saturated = 0;
    for (int k = 0; k < N_INPUTS; k++) {
        const int c = 1 + k;
        const double value = to_si(c, numbers[layout->slot[c]]);
        const int is_beyond = value < COLUMN_LEAST[c] || value > COLUMN_MOST[c];
        row->u[k] = is_beyond ? NAN : value;
        row->saturated += is_beyond;
    }
    for (int j = 0; j < N_OUTPUTS; j++) {
        const int c = 1 + N_INPUTS + j;
        const double value = to_si(c, numbers[layout->slot[c]]);
        const int is_saturated = value <= COLUMN_LEAST[c] || value >= COLUMN_MOST[c];
        row->y[j] = is_saturated ? NAN : value;
        row->saturated += is_saturated;
    }
}

/* Read a line that has plain numbers, or nothing, at the wanted places and as many fields as the header: nearly all lines.
   Gives where it ends, NULL where it is of another form and has to be looked at more closely. */
static inline const char *plain_line(const Layout *layout, const char *at, char delimiter, double *numbers)
{
    int next = 0;
    for (int64_t k = 0;; k++) {
        if (next < layout->n_wanted && layout->wanted[next] == k) {
            double *const value = &numbers[next++];
            *value = NAN;
            while (*at == ' ') at++;
            if (*at != delimiter && *at != '\n' && *at != '\r') at = read_number(at, value);
            if (at == NULL) return NULL;
            while (*at == ' ') at++;
        } else {
            while (*at != delimiter && *at >= ' ' && *at < 127 && *at != '"') at++;
        }
        if (*at != delimiter) {
            at += *at == '\r' && at[1] == '\n';
            return *at == '\n' && k + 1 == layout->n_fields ? at + 1 : NULL;
        }
        at++;
    }
}

/* Read the next line as a plain one; gives whether it is. */
static inline int read_plain(Layout *layout, Csv *csv, TableRow *row)
{
    double numbers[N_COLUMNS];
    const char *const line = csv->text + csv->begin;
    if (csv->begin >= csv->whole || csv->text[csv->whole - 1] != '\n' || csv_is_empty(csv)) return 0;
    const char *const end = plain_line(layout, line, csv->delimiter, numbers);
    if (end == NULL || end - line >= CSV_MAX_FIELD) return 0;
    for (int k = 0; k < layout->n_wanted; k++)
        if (!isfinite(numbers[k])) numbers[k] = NAN;
    const int has_time = layout->place[0] >= 0;
    csv->begin += (size_t)(end - line);
    row->line = ++csv->lines;
    row->time = has_time ? to_si(0, numbers[layout->slot[0]]) : numbered_time(layout);
    fill_row(layout, numbers, row);
    layout->count++;
    return 1;
}

/* Whether a text is a number as half of the world writes it. */
static inline int has_decimal_comma(const char *at)
{
    const char *before = at;
    uint32_t letter = text_letter(&at);
    while (text_is_space(letter)) letter = text_letter(&at);
    if (letter == '+' || letter == '-') letter = text_letter(&at);
    while (text_digit(letter) >= 0) letter = text_letter(&at);
    if (letter != ',') return 0;
    before = at;
    letter = text_letter(&at);
    if (text_digit(letter) < 0) return 0;
    for (; text_digit(letter) >= 0; letter = text_letter(&at)) before = at;
    if (letter == 'e' || letter == 'E') {
        letter = text_letter(&at);
        if (letter == '+' || letter == '-') letter = text_letter(&at);
        if (text_digit(letter) < 0) return 0;
        for (; text_digit(letter) >= 0; letter = text_letter(&at)) before = at;
    }
    return !text_says(before);
}

/* Add to a message which column has which text. */
static inline void add_field(const Layout *layout, char *const *fields, int column, char *message)
{
    text_add(message, MESSAGE_ROOM, COLUMN_SHOWN[column], SAID_LETTERS);
    text_add(message, MESSAGE_ROOM, " is '", SAID_LETTERS);
    text_add(message, MESSAGE_ROOM, text_strip(fields[layout->slot[column]]), SAID_LETTERS);
    text_add(message, MESSAGE_ROOM, "'", SAID_LETTERS);
}

/* Where fields are separated by something else, a comma in a number is its decimal mark: put a point in its place. Gives whether
   all marks are commas, or all points: one of two may separate thousands. */
static inline int put_points(const Layout *layout, char *const *fields, int64_t line, char *message)
{
    int with_comma = -1, with_point = -1;
    for (int c = 0; c < N_COLUMNS; c++) {
        char *const field = layout->place[c] >= 0 ? fields[layout->slot[c]] : NULL;
        if (field == NULL) continue;
        if (with_point < 0 && strchr(field, '.') != NULL && isfinite(number_in(field))) with_point = c;
        if (with_comma < 0 && has_decimal_comma(field)) with_comma = c;
    }
    if (with_comma >= 0 && with_point >= 0) {
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: ", CSV_TITLE, (long long)line);
        add_field(layout, fields, with_comma, message);
        text_add(message, MESSAGE_ROOM, " and ", SAID_LETTERS);
        add_field(layout, fields, with_point, message);
        text_add(message, MESSAGE_ROOM, ". Decimal commas or points? Write all numbers with one of them.", SAID_LETTERS);
        return 0;
    }
    for (int k = 0; with_comma >= 0 && k < layout->n_wanted; k++)
        if (fields[k] != NULL && has_decimal_comma(fields[k])) *strchr(fields[k], ',') = '.';
    return 1;
}

/* Refuse a row with decimal commas, which would pass for missing values; gives whether it has none. */
static inline int has_no_commas(const Layout *layout, char *const *fields, int64_t line, char *message)
{
    for (int c = 0; c < N_COLUMNS; c++) {
        char *const field = layout->place[c] >= 0 ? fields[layout->slot[c]] : NULL;
        if (field == NULL || !has_decimal_comma(field)) continue;
        (void)snprintf(message, MESSAGE_ROOM, "%s:%lld: ", CSV_TITLE, (long long)line);
        add_field(layout, fields, c, message);
        text_add(message, MESSAGE_ROOM, ". Decimal commas? Write numbers with a point.", SAID_LETTERS);
        return 0;
    }
    return 1;
}

/* Find the fields at the wanted places, NULL where a record has fewer. Gives whether all others are the header's. */
static inline int find_fields(const Layout *layout, Csv *csv, const CsvRecord *record, char **found, char *message)
{
    CsvFields fields = csv_fields(csv, record);
    int next = 0, is_more = 0;
    int64_t n = 0;
    for (int k = 0; k < layout->n_wanted; k++) found[k] = NULL;
    for (char *field = csv_field(&fields); field != NULL; field = csv_field(&fields), n++) {
        if (next < layout->n_wanted && layout->wanted[next] == n) found[next++] = field;
        is_more = is_more || (n >= layout->n_fields && text_says(field));
    }
    if (is_more)
        (void)snprintf(message, MESSAGE_ROOM,
                       "%s:%lld: this row has %lld fields, the header %lld. Decimal commas? Write numbers with a point; a text "
                       "that holds a separator needs quotation marks.",
                       CSV_TITLE, (long long)csv->lines, (long long)n, (long long)layout->n_fields);
    return !is_more;
}

/* Whether a field without a number says that there is none: empty, null, nan or inf. */
static inline int is_nothing(const char *field)
{
    char *end;
    return !text_says(field) || text_is(field, "null") || (!isfinite(strtod(field, &end)) && !text_says(end));
}

/* Say once of each column which text stands in place of a number, or of a time. */
static inline void tell_texts(Layout *layout, char *const *fields, const TableRow *row)
{
    static const char *const SWITCHES[] = {"on", "off", "true", "false", "yes", "no", "open", "closed", "running", "stopped"};
    for (int c = 0; c < N_COLUMNS && layout->n_told < TOLD_COLUMNS; c++) {
        const char *const field = layout->place[c] >= 0 ? fields[layout->slot[c]] : NULL;
        char shown[4 * SHOWN_LETTERS + 1], line[MESSAGE_ROOM];
        int is_switch = 0;
        if (field == NULL || layout->is_told[c] || isfinite(c > 0 ? number_in(field) : row->time) || is_nothing(field)) continue;
        layout->is_told[c] = 1;
        layout->n_told++;
        shown[0] = '\0';
        text_add(shown, sizeof shown, field, SHOWN_LETTERS);
        for (char *at = shown; *at != '\0'; at++)
            if ((*at > 0 && *at < ' ') || *at == 127) *at = '?'; /* what a terminal would obey */
        for (size_t k = 0; k < sizeof SWITCHES / sizeof SWITCHES[0]; k++) is_switch = is_switch || text_is(field, SWITCHES[k]);
        if (c == 0)
            (void)snprintf(line, sizeof line, "column %s, line %lld: '%s' is no time; its row is not used.", COLUMN_SHOWN[c],
                           (long long)row->line, shown);
        else
            (void)snprintf(line, sizeof line, "column %s (%s), line %lld: '%s' is no number%s; it counts as missing.", COLUMN_SHOWN[c],
                           COLUMN_ROLE[c], (long long)row->line, shown, is_switch ? ", write 1 or 0 for it" : "");
        layout->tell(line);
    }
}

/* Make a row of a record that was passed; gives CSV_RECORD or CSV_NO_ROW. */
static inline int row_of_record(Layout *layout, Csv *csv, const CsvRecord *record, TableRow *row, char *message)
{
    char *fields[N_COLUMNS];
    double numbers[N_COLUMNS];
    int is_missing = 0;
    if (!find_fields(layout, csv, record, fields, message)) return CSV_NO_ROW;
    if (csv->delimiter != ',' && !put_points(layout, fields, csv->lines, message)) return CSV_NO_ROW;
    for (int k = 0; k < layout->n_wanted; k++) numbers[k] = fields[k] != NULL ? number_in(fields[k]) : NAN;
    row->line = csv->lines;
    row->time = numbered_time(layout);
    if (layout->place[0] >= 0) row->time = to_si(0, numbers[layout->slot[0]]);
    for (int c = 1; c < N_COLUMNS; c++) is_missing = is_missing || isnan(to_si(c, numbers[layout->slot[c]]));
    char *const moment = layout->place[0] >= 0 ? fields[layout->slot[0]] : NULL;
    if (moment != NULL && isnan(numbers[layout->slot[0]])) row->time = moment_in(text_strip(moment));
    if ((is_missing || isnan(row->time)) && !has_no_commas(layout, fields, row->line, message)) return CSV_NO_ROW;
    if (is_missing || isnan(row->time)) tell_texts(layout, fields, row);
    fill_row(layout, numbers, row);
    layout->count++;
    return CSV_RECORD;
}

/* Read the next row: CSV_RECORD, CSV_NO_ROW, CSV_WAITS or CSV_ERROR. */
static inline int read_row(Layout *layout, Csv *csv, TableRow *row, char *message)
{
    CsvRecord record;
    for (;;) {
        if (read_plain(layout, csv, row)) return CSV_RECORD;
        const int found = csv_find_record(csv, &record, message);
        if (found == CSV_NO_ROW) csv_pass(csv, &record);
        if (found != CSV_RECORD) return found;
        const int is_empty = csv_is_empty(csv);
        csv_pass(csv, &record);
        if (!is_empty) return row_of_record(layout, csv, &record, row, message);
    }
}

#endif
