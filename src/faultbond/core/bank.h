/* The bank: lanes for every hypothesis, begun at the alarm, and how well each explains what came since. Steps of parameters
   run in plain lanes (steps.h, growing.h), all other kinds of fault in lanes with a slot (slots.h). */
#ifndef FB_BANK_H
#define FB_BANK_H

#include "detector.h"
#include "growing.h"
#include "slots.h"

/* Samples after the alarm at which the bank begins again from what it has found. */
#define FIRST_RENEWAL 30
#define SECOND_RENEWAL 100
#define LAST_RENEWAL 200

typedef struct {
    StepMemory steps;
    SlotMemory slots;
    double innovations[2 * N_OUTPUTS][FB_ROOM(N_LANES)];
    double peak[FB_ROOM(N_INPUTS)]; /* largest size of each input so far, SI */
} BankMemory;

/* Give a bank of zeros, in which no set of the reserve has lanes. */
static void clear_bank(Bank *bank)
{
    memset(bank, 0, sizeof *bank);
    for (int k = 0; k < FB_ROOM(N_GROWN); k++) bank->grown[k] = -1;
}

static int is_renewal(int64_t since)
{
    return since == FIRST_RENEWAL || since == SECOND_RENEWAL || since == LAST_RENEWAL;
}

static void find_peaks(const Inputs *inputs, double *peak)
{
    for (int k = 0; k < N_INPUTS; k++) peak[k] = peak_of(inputs, k);
}

/* Begin all lanes: they have seen all samples of the trail, the last of which is that of the alarm. `change`: place in it of
   the onset that the detector estimates. */
static void begin_bank(State *state, const Trail *trail, int64_t change, BankMemory *memory, Filters *filters)
{
    Bank *bank = &state->bank;
    clear_bank(bank);
    find_peaks(&state->inputs, memory->peak);
    begin_all_steps(bank, trail, change, &state->normal, &memory->steps, &filters->plain);
    find_onsets(trail, change, &memory->steps.onsets);
    begin_slots(bank, trail, &memory->steps.onsets, memory->peak, &state->normal, &filters->wide, &memory->slots);
    begin_misfit(bank, state->clock.index);
}

/* Take one more packed sample into all lanes. */
static void advance_bank(State *state, const double *packed, BankMemory *memory, Filters *filters)
{
    Bank *bank = &state->bank;
    advance_steps(bank, packed, &state->normal, memory->innovations, &memory->steps, &filters->plain);
    advance_slots(bank, packed, &state->normal, memory->innovations[0] + N_STEPS, FB_ROOM(N_LANES), &filters->wide,
                  &memory->slots);
    add_misfit(bank, &state->inputs, packed, memory->innovations, state->clock.index);
}

/* Begin lanes again from what the bank has found, and those of the likeliest sets in reserve that are not rejected. After the
   last renewal all filters of steps begin again. */
static void renew_bank(State *state, const Trail *trail, int64_t since, BankMemory *memory, Filters *filters)
{
    Bank *bank = &state->bank;
    const Normal *normal = &state->normal;
    find_peaks(&state->inputs, memory->peak);
    if (since == LAST_RENEWAL) renew_all_steps(bank, trail, normal, &memory->steps, &filters->plain);
    else renew_steps(bank, trail, normal, &memory->steps, &filters->plain);
    if (N_RESERVE > 0) renew_reserve(bank, trail, normal, &memory->steps, &filters->plain);
    renew_slots(bank, trail, memory->peak, normal, &filters->wide, &memory->slots);
    for (int64_t lane = 0; lane < N_LANES; lane++)
        if (lane < N_STEPS ? memory->steps.changed[lane] : memory->slots.changed[lane - N_STEPS])
            begin_misfit_again(bank, lane, state->clock.index);
}

#endif
