/* Every number of a state by name: where it stands, and what it may be. Saving, restoring and looking into a state go by
   this table. Names are stable: kept states are read by them. */
#ifndef FB_FIELDS_H
#define FB_FIELDS_H

#include <stddef.h>

#include "state.h"

#define MOST_GROUPS (BLOCKS(N_STEPS) + BLOCKS(N_SLOT_LANES) + BLOCKS(N_COUPLE_LANES) + 1.0)
#define LARGEST_COUNT 4503599627370496.0 /* 2^52: whole numbers up to it, and their sums, are exact */

typedef struct {
    const char *name;
    int64_t offset, count; /* bytes from the beginning of the state, and numbers */
    double least, most;
    int is_whole;          /* int64_t; else double */
    int may_be_nan, may_be_infinite;
} Field;

#define FIELD(name, least, most, whole, nan, infinite) \
    {#name, (int64_t)offsetof(State, name), (int64_t)(sizeof(((State *)0)->name) / 8), least, most, whole, nan, infinite}
#define FINITE(name) FIELD(name, -INFINITY, INFINITY, 0, 0, 0)
#define POSITIVE(name) FIELD(name, 0.0, INFINITY, 0, 0, 0)
#define ENDLESS(name) FIELD(name, 0.0, INFINITY, 0, 0, 1)
#define MISSING(name) FIELD(name, -INFINITY, INFINITY, 0, 1, 0)   /* nan: nothing there */
#define REACHING(name) FIELD(name, -INFINITY, INFINITY, 0, 0, 1)  /* infinite: nothing seen */
#define ANYTHING(name) FIELD(name, -INFINITY, INFINITY, 0, 1, 1)  /* of filters that may have run away */
#define FRACTION(name) FIELD(name, 0.0, 1.0, 0, 0, 0)
#define WHOLE(name, least, most) FIELD(name, least, most, 1, 0, 0)
#define COUNT(name) WHOLE(name, 0.0, LARGEST_COUNT)
#define COUNTED(name) FIELD(name, 0.0, LARGEST_COUNT, 0, 0, 0)
#define NUMBER(name) WHOLE(name, -1.0, LARGEST_COUNT)             /* of a sample; -1: none */
#define FLAG(name) WHOLE(name, 0.0, 1.0)

/* All but the rows of the past and the lanes of the bank, whose places go by the number of the sample and of the lane. */
static const Field FIELDS[] = {
    COUNT(clock.index), NUMBER(clock.begun), FLAG(clock.running), NUMBER(clock.alarm), COUNT(clock.detections),
    NUMBER(clock.accepted), NUMBER(clock.over), COUNT(clock.silent), WHOLE(clock.quiet, 0.0, ALARMS_ONLY), COUNT(clock.outside), POSITIVE(clock.doubt), POSITIVE(clock.pause), FINITE(clock.time),
    MISSING(inputs.held), MISSING(inputs.earlier), REACHING(inputs.lowest), REACHING(inputs.highest),
    ENDLESS(inputs.leap), POSITIVE(inputs.guessed), FRACTION(inputs.habit), ENDLESS(inputs.since_step),
    ANYTHING(inputs.change), FIELD(inputs.true_for, -1.0, INFINITY, 0, 0, 1), ANYTHING(inputs.trends), POSITIVE(inputs.rough),
#if N_NOISY > 0
    MISSING(inputs.record), COUNTED(inputs.still), COUNTED(inputs.stood), COUNTED(inputs.turns), COUNTED(inputs.idle), FINITE(inputs.since),
    FIELD(inputs.way, -1.0, 1.0, 0, 0, 0),
#endif
    MISSING(inputs.inside), MISSING(inputs.odd), NUMBER(inputs.odd_since), ANYTHING(inputs.rival), FINITE(inputs.gain),
    ANYTHING(refused), REACHING(sensors.shown), POSITIVE(sensors.spent), FRACTION(sensors.surprised), POSITIVE(sensors.nis), FINITE(sensors.mean), POSITIVE(sensors.run), POSITIVE(sensors.cusum),
    FIELD(sensors.cusum_start, -1.0, LARGEST_COUNT, 0, 0, 0), POSITIVE(sensors.fast), POSITIVE(sensors.scatter),
    FIELD(sensors.scatter_start, -1.0, LARGEST_COUNT, 0, 0, 0), MISSING(sensors.before),
    ANYTHING(healthy.lane), REACHING(healthy.travel), ENDLESS(healthy.astray), POSITIVE(healthy.windows),
    POSITIVE(healthy.walks), POSITIVE(healthy.walk), FIELD(healthy.walker, 0.0, LARGEST_COUNT, 0, 0, 0),
    FIELD(healthy.blind, 0.0, LARGEST_COUNT, 0, 0, 0), FINITE(healthy.snapshots),
    NUMBER(beginning.sample), WHOLE(beginning.count, 0.0, MOST_FIRST), FLAG(beginning.again),
    POSITIVE(bank.sums), FIELD(bank.since, 0.0, LARGEST_COUNT, 0, 0, 0), ANYTHING(bank.healthy), COUNT(bank.onset), FLAG(bank.rests),
    WHOLE(bank.grown, -1.0, N_RESERVE > 0 ? N_RESERVE - 1.0 : 0.0), FLAG(bank.rejected),
    FLAG(bank.missed.is_noted), WHOLE(bank.missed.signal, 0.0, N_OUTPUTS - 1.0), POSITIVE(bank.missed.sd), FINITE(bank.missed.since),
    FINITE(bank.missed.until),
    WHOLE(bank.coupled, -1.0, N_COUPLES > 0 ? N_COUPLES - 1.0 : 0.0), WHOLE(bank.base, -1.0, FB_ROOM(SWITCHED) - 1.0),
    ANYTHING(bank.noted), COUNT(bank.noted_at),
    WHOLE(job.kind, 0.0, 3.0), WHOLE(job.renewals, 0.0, 3.0), NUMBER(job.ended), NUMBER(job.settled), COUNT(job.oldest),
    COUNT(job.end), WHOLE(job.old, -1.0, SNAPSHOTS - 1.0), WHOLE(job.change, -LARGEST_COUNT, LARGEST_COUNT),
    ENDLESS(job.peak), COUNT(job.spent), COUNT(job.opened), POSITIVE(job.price), WHOLE(job.stage, 0.0, 7.0), WHOLE(job.group, 0.0, MOST_GROUPS),
    WHOLE(job.pass, 0.0, 3.0), WHOLE(job.onset, -1.0, MOST_ONSETS - 1.0), COUNT(job.next),
    WHOLE(job.n_wanted, 0.0, N_STEPS), WHOLE(job.n_singles, 0.0, N_STEPS),
    WHOLE(job.wanted, 0.0, N_PLANNED > 0 ? N_PLANNED - 1.0 : 0.0),
    WHOLE(job.stands_for, -1.0, N_PLANNED > 0 ? N_PLANNED - 1.0 : 0.0), ANYTHING(job.factors),
    WHOLE(job.bases, -1.0, FB_ROOM(SWITCHED) - 1.0), ANYTHING(job.values), ANYTHING(job.most), ANYTHING(job.heard),
    WHOLE(job.likeliest, -1.0, DEPTH - 1.0),
    WHOLE(job.lane, 0.0, FB_ROOM(N_STEPS > N_WIDE ? N_STEPS : N_WIDE) - 1.0), COUNT(job.begins), COUNT(job.began), ANYTHING(job.found),
    COUNT(job.walk.samples), COUNT(job.walk.steps), ANYTHING(job.walk.variance),
    WHOLE(job.search.n, 0.0, MOST_ONSETS), WHOLE(job.search.place, 0.0, DEPTH - 1.0),
    WHOLE(job.search.standing, 0.0, 3.0), WHOLE(job.search.best, 0.0, MOST_ONSETS - 1.0), ANYTHING(job.search.said), ANYTHING(job.search.most), ANYTHING(job.search.least), FLAG(job.search.fixed), FLAG(job.search.early),
    ANYTHING(job.run), ANYTHING(job.best), ANYTHING(job.stays), ANYTHING(job.best_stays), ANYTHING(job.before), ANYTHING(job.before_most),
    FINITE(normal.lane), FINITE(normal.gain), FINITE(normal.offset), ENDLESS(normal.noise), FINITE(normal.input_gain), FINITE(normal.input_offset),
    FINITE(normal.rates), ENDLESS(normal.wander),
    FINITE(alarm.time), FINITE(alarm.change_time), FLAG(alarm.crossed),
    WHOLE(alarm.walker, -1.0, N_PARAMETERS > 0 ? N_PARAMETERS - 1.0 : 0.0), WHOLE(alarm.window, -1.0, 2.0 * WALKS), POSITIVE(alarm.walk),
    WHOLE(alarm.old, -1.0, SNAPSHOTS - 1.0), FLAG(alarm.slow), COUNT(alarm.outside), FLAG(alarm.unfamiliar),
    WHOLE(sure.hypothesis, -1.0, N_HYPOTHESES - 1.0), NUMBER(sure.since), NUMBER(sure.clear_since),
    WHOLE(settled.now.hypothesis, -1.0, N_HYPOTHESES - 1.0), NUMBER(settled.now.since), NUMBER(settled.now.clear_since),
    WHOLE(settled.hypothesis, -1.0, N_HYPOTHESES - 1.0), WHOLE(settled.n_parts, 0.0, LARGEST_SET),
    WHOLE(settled.parts, 0.0, N_PARTS > 0 ? N_PARTS - 1.0 : 0.0), NUMBER(settled.harmless_since), FINITE(settled.until),
};
#define N_FIELDS ((int64_t)(sizeof FIELDS / sizeof FIELDS[0]))

#endif
