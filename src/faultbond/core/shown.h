/* The states as the first readings show them, one after the other: a guess from which the start is sought.

   A sensor of which one state alone is not known shows that; and a state that is known shows, as it were at rest, the one that
   it follows. What has fewest states tells first: a temperature that a slow sensor reads is about what that says, while a current
   that does not rest, and goes by a resistance that hardly moves with it, says nearly anything. No step in time is made, so no
   plant can run away: one whose winding begins at 0 K, with a resistance below zero, is beyond all measure after a second. Formulas: docs/method.md, "The joint filter". */
#ifndef FB_SHOWN_H
#define FB_SHOWN_H

#include "advance.h"

FB_SELDOM

#define SHOWN_STEPS 30    /* of Newton's method for one state, */
#define SHOWN_CLOSE 1e-6  /* the last of which is at most this part of it */

/* What is known while states are found. */
typedef struct {
    double (*samples)[N_SAMPLE];
    int64_t count;
    double *state;
    unsigned char is_known[FB_ROOM(N_STATES)];
} Shown;

/* The only state among columns of v that is not known; -1: none, or more than one. `n_states`: how many of them are states. */
static int only_unknown(const Shown *shown, const int *columns, int n, int *n_states)
{
    int found = -1;
    *n_states = 0;
    for (int e = 0; e < n; e++) {
        if (columns[e] >= N_STATES) continue;
        ++*n_states;
        if (shown->is_known[columns[e]]) continue;
        if (found >= 0) return -1;
        found = columns[e];
    }
    return found;
}

/* The first of the samples that a sensor has a value in; -1: none. One that is wild is left out when the start is solved anew. */
static int64_t first_reading(const Shown *shown, int j)
{
    for (int64_t t = 0; t < shown->count; t++)
        if (shown->samples[t][SAMPLE_USE + j] > 0.0 && shown->samples[t][SAMPLE_SCALE + j] < BLANK_FACTOR) return t;
    return -1;
}

/* Find state i by a relation in which all others are known, by Newton's method; gives whether that comes to an end. */
static int find_shown(Shown *shown, int relation, const double *sample, int i, lanes *lane)
{
    double value = shown->state[i];
    for (int k = 0; k < N_STATES; k++) lane[k] = broadcast(shown->state[k]);
    for (int step = 0; step < SHOWN_STEPS; step++) {
        lanes slope;
        lane[i] = broadcast(value);
        const double left = first_of(left_of_relation_plain(lane, sample, relation, i, &slope)), move = -left / first_of(slope);
        if (!isfinite(move)) return 0;
        value += move;
        if (!(fabs(move) > SHOWN_CLOSE * fabs(value))) {
            shown->state[i] = value;
            return 1;
        }
    }
    return 0;
}

/* Find one more state by what has `n_states` of them, by a sensor before what only rests; gives whether there was one. */
static int find_next(Shown *shown, int n_states, lanes *lane)
{
    for (int relation = 0; relation < N_OUTPUTS + N_STATES; relation++) {
        const int state = relation - N_OUTPUTS, reads = state < 0;
        const int64_t at = reads ? first_reading(shown, relation) : 0;
        if (at < 0 || (!reads && !shown->is_known[state])) continue;
        const int *columns = reads ? READING_COLUMN + READING_ROW[relation] : RATE_COLUMN + RATE_ROW[state];
        const int n = reads ? READING_ROW[relation + 1] - READING_ROW[relation] : RATE_ROW[state + 1] - RATE_ROW[state];
        int those;
        const int i = only_unknown(shown, columns, n, &those);
        if (i < 0 || those != n_states || !find_shown(shown, relation, shown->samples[at], i, lane)) continue;
        shown->is_known[i] = 1;
        return 1;
    }
    return 0;
}

/* Set those states that the first samples show. known: [N_STATES], 1 where a state is known beforehand. lane: where the plant
   begins, apart from its states, which are free to use. */
static void find_all_shown(double (*samples)[N_SAMPLE], int64_t count, const unsigned char *known, double *state, lanes *lane)
{
    Shown shown = {samples, count, state, {0}};
    memcpy(shown.is_known, known, N_STATES);
    for (int n_states = 1; n_states <= N_STATES;) n_states = find_next(&shown, n_states, lane) ? 1 : n_states + 1;
}

FB_OFTEN

#endif
