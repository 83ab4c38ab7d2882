/* Faults of sensors that were there at the first sample of all.

   The start is solved from the first readings, so one that is wrong leads the states astray, and what the filter learns after that
   makes up for it: no healthy lane is left from which a lane of that fault could begin. So while the first sample is kept, such lanes
   begin there too, from a start that is solved without their sensor. */
#ifndef FB_FIRST_H
#define FB_FIRST_H

#include "slots.h"
#include "start.h"

FB_SELDOM

/* The lane whose parameters hold where the filter begins; NULL: the nominal ones do. */
static const double *known_at_first(const Clock *clock, const Normal *normal, FirstMemory *memory)
{
    if (clock->accepted < 0) return NULL;
    memcpy(memory->known, normal->lane, sizeof memory->known);
    forget_slow_errors(memory->known);
    return memory->known;
}

/* Whether lane k is of a sensor that may lead the start. */
static inline int is_misleading(int64_t k) { return SLOT_OUTPUT[k] >= 0 && SLOT_KIND[k] != KIND_NOISE; }

/* The healthy lane before the first sample, solved without sensor j; into `lane` of the memory. */
static void start_without(int j, const Trail *trail, const Clock *clock, const Normal *normal, FirstMemory *memory, Filter_plain *work)
{
    const Beginning *beginning = trail->beginning;
    const double *known = known_at_first(clock, normal, memory);
    const int64_t count = beginning->count < trail->n ? beginning->count : trail->n;
    for (int64_t k = 0; k < count; k++) {
        memcpy(memory->samples[k], sample_at(trail, k), sizeof memory->samples[k]);
        memory->samples[k][SAMPLE_USE + j] = 0.0;
    }
    solve_start(memory->samples, count, known, (int)beginning->again, normal, memory->mean, memory->covariance, &memory->solve, work);
    healthy_lane(memory->mean, memory->covariance, AT_SLOT, known, memory->lane);
}

/* Begin those lanes of a group at the first sample whose sensors may lead the start, the lanes of one sensor side by side; no other
   lane can be likely there. */
static void begin_at_first(const int64_t *lane, const Trail *trail, const double *peak, const Clock *clock, const Normal *normal,
                           double (*group)[GROUP], Walk *walk, SlotMemory *memory, FirstMemory *first, Filter_plain *work)
{
    int without = -1;
    memset(walk, 0, sizeof *walk);
    prepare_slots(trail, healthy_at(trail, 0), 1, NULL, memory);
    for (int l = 0; l < GROUP; l++) {
        const int misleading = is_misleading(lane[l]);
        if (misleading && SLOT_OUTPUT[lane[l]] != without) {
            without = SLOT_OUTPUT[lane[l]];
            start_without(without, trail, clock, normal, first, work);
            prepare_slots(trail, first->lane, 1, NULL, memory);
        }
        begin_slot(lane[l], trail, peak, &memory->start, group, l);
        if (!misleading) group[WIDE_LIKELIHOOD][l] = LOWEST;
    }
}

FB_OFTEN

#endif
