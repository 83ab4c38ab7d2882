/* The bank: lanes for every hypothesis, begun at the alarm (work.h), and how well each explains what came since. Steps of
   parameters run in plain lanes (steps.h, growing.h), all other kinds of fault in lanes with a slot (slots.h,
   ramps.h). */
#ifndef FB_BANK_H
#define FB_BANK_H

#include "rest.h"

/* Give a bank of zeros, in which no set of the reserve has lanes, and on which nobody works. */
static void clear_bank(State *state)
{
    memset(&state->bank, 0, sizeof state->bank);
    for (int k = 0; k < FB_ROOM(N_GROWN); k++) state->bank.grown[k] = -1;
    for (int k = 0; k < FB_ROOM(N_COUPLED); k++) state->bank.coupled[k] = -1;
    for (int k = 0; k < FB_ROOM(N_COUPLE_LANES); k++) state->bank.base[k] = -1;
    clear_job(&state->job);
}

/* Whether all lanes have begun since the alarm. */
static inline int is_ready(const Job *job) { return job->settled >= 0; }

/* Let all lanes begin: each has then seen all samples of the trail, the last of which is that of the alarm. `change`: place in
   it of the onset that the detector estimates. */
static void begin_bank(State *state, const Trail *trail, int64_t change)
{
    clear_bank(state);
    begin_all(state, trail, change);
}

/* Whether the bank is to begin again from what it has found. */
static int is_renewal(const State *state)
{
    const Job *job = &state->job;
    return is_ready(job) && job->kind == IDLE && job->ended < state->clock.index && job->renewals < N_RENEWALS &&
           since_alarm(state) >= next_renewal(job);
}

/* Of the lanes that begin at the alarm, how many have: those of steps, then those with a slot. */
static int64_t steps_begun(const Job *job)
{
    const int64_t done = job->group * GROUP;
    if (job->kind != BEGINNING || job->stage > SETS) return N_PLANNED;
    return job->stage == SINGLES ? done : job->n_singles + done;
}

static int64_t slots_begun(const Job *job)
{
    const int64_t done = job->group * GROUP;
    if (job->kind != BEGINNING || job->stage > PAIRS) return N_SLOT_LANES;
    if (job->stage == PAIRS) return SWITCHED + 2 * done;
    if (job->stage == RAMPS) return RAMPED + 2 * done;
    return job->stage == SLOTS ? done : 0;
}

/* Take one more packed sample into all lanes that have begun. old: see `hand_on`. */
static void advance_bank(State *state, const double *packed, double old, BankMemory *memory, Filters *filters)
{
    Bank *bank = &state->bank;
    int64_t resting = 0;
    for (int64_t group = 0; group < N_RESTING; group++) resting += bank->rests[group];
    const double before = resting ? likelihood_in(bank, leading_of_bank(bank)) : 0.0;
    advance_steps(bank, steps_begun(&state->job), packed, &state->normal, memory->innovations, &memory->steps, &filters->plain);
    if (!IS_OUTSIDE(packed))
        hand_on(bank, slots_begun(&state->job), state->clock.index > state->clock.alarm + AWAITED, state->clock.index,
                state->clock.time, old, &memory->slots);
    advance_slots(bank, slots_begun(&state->job), since_alarm(state), packed, &state->normal,
                  memory->innovations[0] + N_STEPS, FB_ROOM(N_LANES), &filters->wide, &memory->slots);
    advance_couples(bank, packed, &state->normal, memory->innovations[0] + N_STEPS + N_SLOT_LANES, FB_ROOM(N_LANES), &filters->wide,
                    &memory->slots);
    const int64_t leading = resting ? leading_of_bank(bank) : -1;
    if (resting) keep_distance(bank, likelihood_in(bank, leading) - before);
    if (is_ready(&state->job)) add_misfit(bank, &state->inputs, packed, memory->innovations, state->clock.index);
    if (is_contradicted(bank, leading)) wake(bank, state->clock.index);
}

/* Work on the bank for as long as a sample may take. */
static void work_on(State *state, BankMemory *memory, Filters *filters)
{
    if (state->job.kind != IDLE) work_for(state, portion_of(state, &memory->slots), memory, filters);
}

/* Between samples, do at once what is left of beginning the lanes, as where no more samples come. */
static void finish_bank(State *state, BankMemory *memory, Filters *filters)
{
    if (state->job.kind != BEGINNING) return;
    state->clock.index--; /* to the last sample that is kept */
    work_for(state, INT64_MAX, memory, filters);
    state->clock.index++;
}

#endif
