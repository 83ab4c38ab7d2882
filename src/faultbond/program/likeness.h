/* Which name of a recording is like one that is not there, for a message. Source: Ratcliff and Metzener 1988, as Python's
   difflib has it; capitals count as small letters in ASCII only. */
#ifndef WATCH_LIKENESS_H
#define WATCH_LIKENESS_H

#include "point.h"
#include "text.h"

#define LIKE_LETTERS 100 /* of a name that are compared */
#define LIKE_NAMES 1000  /* that are compared */
#define LIKE_ENOUGH 0.6  /* likeness from which on a name is told */

typedef struct {
    uint32_t letters[LIKE_LETTERS];
    int n;
} Name;

/* Parts of two names, and the longest run of letters that both have. */
typedef struct {
    int a_first, a_stop, b_first, b_stop;
} NamePair;

static inline Name name_of(const char *text)
{
    Name name = {{0}, 0};
    while (*text != '\0' && name.n < LIKE_LETTERS) {
        const uint32_t letter = text_letter(&text);
        name.letters[name.n++] = letter >= 'A' && letter <= 'Z' ? letter - 'A' + 'a' : letter;
    }
    return name;
}

/* The longest run that two parts share, the first of such; its length is a_stop - a_first. */
static inline NamePair longest_run(const Name *a, const Name *b, NamePair within)
{
    NamePair best = {within.a_first, within.a_first, within.b_first, within.b_first};
    for (int i = within.a_first; i < within.a_stop; i++)
        for (int j = within.b_first; j < within.b_stop; j++) {
            int k = 0;
            while (i + k < within.a_stop && j + k < within.b_stop && a->letters[i + k] == b->letters[j + k]) k++;
            if (k <= best.a_stop - best.a_first) continue;
            best.a_first = i;
            best.a_stop = i + k;
            best.b_first = j;
            best.b_stop = j + k;
        }
    return best;
}

/* Part of the letters of two names that runs have in common which follow each other in both, from 0 to 1. */
static inline double likeness(const Name *a, const Name *b)
{
    NamePair open[LIKE_LETTERS + 1] = {{0, a->n, 0, b->n}};
    int n = 1, shared = 0;
    while (n > 0) {
        const NamePair within = open[--n], run = longest_run(a, b, within);
        if (run.a_stop == run.a_first) continue;
        shared += run.a_stop - run.a_first;
        const NamePair before = {within.a_first, run.a_first, within.b_first, run.b_first};
        const NamePair behind = {run.a_stop, within.a_stop, run.b_stop, within.b_stop};
        if (before.a_stop > before.a_first && before.b_stop > before.b_first) open[n++] = before;
        if (behind.a_stop > behind.a_first && behind.b_stop > behind.b_first) open[n++] = behind;
    }
    return a->n + b->n > 0 ? 2.0 * shared / (a->n + b->n) : 1.0;
}

/* Whether a name comes behind another one in the order of letters. */
static inline int is_behind(const Name *a, const Name *b)
{
    for (int k = 0; k < a->n && k < b->n; k++)
        if (a->letters[k] != b->letters[k]) return a->letters[k] > b->letters[k];
    return a->n > b->n;
}

/* Whether a name is one of some. */
static inline int is_among(const char *name, const char *const *some, int n)
{
    for (int k = 0; k < n; k++)
        if (strcmp(name, some[k]) == 0) return 1;
    return 0;
}

/* Which of some names is most like another one; NULL where none is. */
static inline const char *most_alike(const char *wanted, const char *const *some, int n)
{
    const Name word = name_of(wanted);
    Name best = {{0}, 0};
    double most = -1.0;
    const char *meant = NULL;
    for (int k = 0; k < n && k < LIKE_NAMES; k++) {
        const Name name = name_of(some[k]);
        const double like = likeness(&name, &word);
        if (like < LIKE_ENOUGH || like < most || (like == most && !is_behind(&name, &best))) continue;
        best = name;
        most = like;
        meant = some[k];
    }
    return meant;
}

/* Append what to do where a column is not among n names; what is `taken`, since others read it, is not meant. */
static inline void add_advice(char *message, const char *wanted, const char *names, int64_t n, const char *const *taken, int n_taken)
{
    const Name word = name_of(wanted);
    Name best = {{0}, 0};
    double most = -1.0;
    const char *meant = NULL;
    for (int64_t k = 0; k < n && k < LIKE_NAMES; k++, names += strlen(names) + 1) {
        if (is_among(names, taken, n_taken)) continue;
        const Name name = name_of(names);
        const double like = likeness(&name, &word);
        if (like < LIKE_ENOUGH || like < most || (like == most && is_behind(&best, &name))) continue;
        best = name;
        most = like;
        meant = names;
    }
    if (meant == NULL) {
        text_add(message, MESSAGE_ROOM, ". Name it in the model file with `column`.", MESSAGE_ROOM);
        return;
    }
    text_add(message, MESSAGE_ROOM, ". Did you mean '", MESSAGE_ROOM);
    text_add(message, MESSAGE_ROOM, meant, LIKE_LETTERS);
    text_add(message, MESSAGE_ROOM, "'? State that as `column` in the model file.", MESSAGE_ROOM);
}

#endif
