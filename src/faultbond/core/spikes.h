/* Inputs that leave their value for one sample: whether they did, or the record is wrong there, the readings say.

   They say so by what is expected after either past. While the plant is healthy the healthy filter expects it. Of a faulty plant
   it is that filter which is wrong, and would take true values out of all lanes alike. So it has no say where the sample before
   surprised it, too, and after an alarm the likeliest lane has. Formulas: docs/method.md, "The joint filter". */
#ifndef FB_SPIKES_H
#define FB_SPIKES_H

#include "bank.h"
#include "wild.h"

FB_SELDOM

/* Innovations of one lane of the bank at a packed sample, [2 * N_OUTPUTS]. sample, plain: memory. */
static void innovate(const Bank *bank, int64_t lane, const double *packed, const Normal *normal, double *innovations, double *sample,
                     double *plain, Filters *filters)
{
    Filter_wide *wide = &filters->wide;
    bank_sample(packed, sample);
    if (lane < N_STEPS) {
        for (int64_t i = 0; i < PLAIN_NUMBERS; i++) plain[i] = of_step(bank, lane, i);
        advance_one(plain, sample, normal, innovations, &filters->plain);
        return;
    }
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) wide->lane[i] = broadcast(of_slot(bank, lane - N_STEPS, i));
    step_wide(wide->lane, sample, normal, wide);
    for (int i = 0; i < 2 * N_OUTPUTS; i++) innovations[i] = first_of(wide->innovations[i]);
}

/* How much the likeliest lane has the readings say for the second of two pasts of a sample; 0 while not all lanes have begun. */
static double said_by_leader(const State *state, const double *packed, const double *other, SampleMemory *memory, Filters *filters)
{
    const int64_t leader = is_ready(&state->job) ? leader_of(&state->bank) : -1;
    double first[2 * N_OUTPUTS], second[2 * N_OUTPUTS];
    if (leader < 0) return 0.0;
    innovate(&state->bank, leader, packed, &state->normal, first, memory->judged, memory->one, filters);
    innovate(&state->bank, leader, other, &state->normal, second, memory->judged, memory->one, filters);
    return said_by_readings(packed, first, other, second);
}

/* How much the healthy filter has the readings say for the second of two pasts of a sample; 0 where it is off already. */
static double said_by_healthy(State *state, const double *packed, const double *other, SampleMemory *memory, Filters *filters)
{
    if (state->sensors.surprised > 0.0) return 0.0;
    memcpy(memory->one, state->healthy.lane, sizeof memory->one);
    memcpy(memory->two, state->healthy.lane, sizeof memory->two);
    return compare(&state->normal, memory->one, packed, memory->two, other, &filters->plain);
}

/* Change a packed sample to what it is if inputs that left their value for one sample had not, if the readings say so; gives
   1 where they do. All lanes stand before the sample; `earlier`: see `admit`. */
static int without_spike(State *state, const double *earlier, double *packed, SampleMemory *memory, Filters *filters)
{
    double *other = memory->other;
    int spikes = 0;
    memcpy(other, packed, sizeof memory->other);
    for (int k = 0; k < N_INPUTS; k++) {
        const double before = packed[SAMPLE_U_BEFORE + k];
        if (!(fabs(packed[SAMPLE_U + k] - earlier[k]) < SPIKE_BACK * fabs(before - earlier[k]))) continue;
        other[SAMPLE_U_BEFORE + k] = earlier[k];
        spikes++;
    }
    if (!spikes) return 0;
    const double said = state->clock.alarm < 0 ? said_by_healthy(state, packed, other, memory, filters)
                                               : said_by_leader(state, packed, other, memory, filters);
    if (!(said > TELLING)) return 0;
    memcpy(packed, other, sizeof memory->other);
    return 1;
}

FB_OFTEN

#endif
