/* An alarm that is over by itself. While one stands no other is raised, so a false one would hide each later fault. It is over once
   nothing has been further off than it may be while healthy, for long, and nothing ever was sure; what was stays for a person to
   decide. The watch goes on with the likeliest change of parameters, which is one within the accuracy: who is sure of a parameter to a
   tenth of that may be wrong by half of it, and the healthy filter would alarm again. Where there is none it goes on itself. Figures:
   docs/decisions/044-over-by-itself.md. */
#ifndef FB_OVER_H
#define FB_OVER_H

#include "decide.h"

FB_SELDOM

#define HARMLESS_SAMPLES 600 /* for which nothing has been at fault before an alarm is over */

/* Whether nothing has been at fault for long, by diagnoses that are all in. */
static int is_harmless(const State *state)
{
    const int64_t since = state->settled.harmless_since;
    return state->settled.hypothesis < 0 && since >= 0 && state->clock.index - since >= HARMLESS_SAMPLES && state->job.kind == IDLE;
}

/* The likeliest lane of steps that goes on and explains the data, with slow errors of their size; -1: there is none. */
static int64_t likeliest_step(const State *state, const Ranking *ranking, double *lane)
{
    const Bank *bank = &state->bank;
    double most = LOWEST;
    int64_t likeliest = -1;
    for (int64_t k = 0; k < N_STEPS; k++) {
        const double score = ranking->weighted[k] - COST[hypothesis_of(bank, k)];
        if (does_rest(bank, k) || !(score > most) || is_contradicted(bank, k) || !is_left(bank, k)) continue;
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) lane[i] = of_step(bank, k, i);
        if (slow_error_alarms(&state->clock, lane)) continue;
        most = score;
        likeliest = k;
    }
    for (int64_t i = 0; i < PLAIN_NUMBERS && likeliest >= 0; i++) lane[i] = of_step(bank, likeliest, i);
    return likeliest;
}

/* End an alarm, if it is over; 1 where it is. */
static int end_harmless(State *state, RankingMemory *memory)
{
    const int64_t last = state->clock.index;
    if (!is_harmless(state)) return 0;
    if (likeliest_step(state, &memory->ranking, memory->plain) >= 0 && is_definite(memory->plain, memory->left)) {
        memcpy(state->healthy.lane, memory->plain, sizeof memory->plain);
        memcpy(row_of(&state->past, last)->lane, memory->plain, sizeof memory->plain);
    } else if (is_alarming(&state->clock, &state->sensors, &state->healthy)) {
        return 0;
    }
    begin_sums(&state->sensors, (double)last);
    end_alarm(state);
    state->clock.over = last;
    return 1;
}

FB_OFTEN

#endif
