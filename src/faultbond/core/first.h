/* Faults that were there at the first sample of all.

   The start is solved from the first readings, so a sensor that is wrong leads the states astray, a parameter that is off goes with them,
   and what the filter learns after that makes up for it: no healthy lane is left from which a lane of that fault could begin. So while
   the first sample is kept, lanes of steps and with a slot begin there too: of a sensor from a start that is solved without it, of a
   parameter from one that goes with it as its covariance says, of an input from what sensors read then. Were only those of sensors
   there, a sensor would win what a parameter explains better. */
#ifndef FB_FIRST_H
#define FB_FIRST_H

#include "slots.h"
#include "start.h"
#include "steps.h"

FB_SELDOM

/* The lane whose parameters hold where the filter begins; NULL: the nominal ones do. */
static const double *known_at_first(const Clock *clock, const Normal *normal, FirstMemory *memory)
{
    if (clock->accepted < 0) return NULL;
    memcpy(memory->known, normal->lane, sizeof memory->known);
    forget_slow_errors(memory->known);
    return memory->known;
}

/* How a start is solved but without a sensor: with all, or, where an input is wrong, from so few samples that it moves little. */
#define WITH_ALL (-1)
#define AS_READ (-2)
#define SAMPLES_READ 2

/* The healthy lane before the first sample, solved without sensor j, or as told above; into `lane` of the memory. What lags behind inputs
   begins where these are: of a plant that is off it would make up for that. */
static void start_without(int j, const Trail *trail, const Clock *clock, const Normal *normal, FirstMemory *memory, Filter_plain *work)
{
    const Beginning *beginning = trail->beginning;
    const double *known = known_at_first(clock, normal, memory);
    const int64_t most = beginning->count < trail->n ? beginning->count : trail->n;
    const int64_t count = j == AS_READ && most > SAMPLES_READ ? SAMPLES_READ : most;
    for (int64_t k = 0; k < count; k++) {
        memcpy(memory->samples[k], sample_at(trail, k), sizeof memory->samples[k]);
        if (j >= 0) memory->samples[k][SAMPLE_USE + j] = 0.0;
    }
    solve_start(memory->samples, count, known, (int)beginning->again | AT_INPUTS, normal, memory->mean, memory->covariance, &memory->solve, work);
    healthy_lane(memory->mean, memory->covariance, AT_SLOT, known, memory->lane);
}

/* Begin the lanes with a slot of a group at the first sample, those of one sensor side by side; one that scatters leads nothing
   astray. */
static void begin_slots_at_first(const int64_t *lane, const Trail *trail, const double *peak, const Clock *clock, const Normal *normal,
                                 double (*group)[GROUP], Walk *walk, SlotMemory *memory, FirstMemory *first, Filter_plain *work)
{
    int without = N_OUTPUTS; /* no lane is of that sensor, */
    memset(walk, 0, sizeof *walk);
    for (int l = 0; l < GROUP; l++) {
        const int how = SLOT_INPUT[lane[l]] >= 0 ? AS_READ : SLOT_OUTPUT[lane[l]]; /* and WITH_ALL of a parameter */
        if (how != without) {
            without = how;
            start_without(without, trail, clock, normal, first, work);
            prepare_slots(trail, first->lane, 1, NULL, memory);
        }
        begin_slot(lane[l], trail, peak, &memory->start, group, l);
        go_along(lane[l], trail, 1, group, l); /* nothing does with a sensor without which the start was solved */
        if (SLOT_KIND[lane[l]] == KIND_NOISE) group[WIDE_LIKELIHOOD][l] = LOWEST;
    }
}

/* Begin the lanes of steps of a group at the first sample. No store jumps there: what it held before nobody knows. */
static void begin_steps_at_first(Start *starts, const Trail *trail, const Clock *clock, const Normal *normal, double (*group)[GROUP],
                                 StepMemory *memory, FirstMemory *first, Filter_plain *work)
{
    start_without(WITH_ALL, trail, clock, normal, first, work);
    for (int l = 0; l < GROUP; l++) starts[l].all_along = 1;
    suspect_lanes(starts, first->lane, group, memory->lane);
    for (int l = 0; l < GROUP; l++)
        if (any_jump(&starts[l])) group[PLAIN_LIKELIHOOD][l] = LOWEST;
}

FB_OFTEN

#endif
