/* Work on the bank that takes longer than a sample may: beginning all lanes at the alarm, and beginning lanes again from what
   they have found. It is done in portions, one at each sample, so that none takes much longer than the others.

   Lanes begin in groups. A group takes this way: OPENING it says which lanes it has and which onsets they may try; at each
   onset they begin, and take all samples of the trail, which ends where the work began (NEAR_ONSETS; again from CLOSER, where
   stores jump); the best of their onsets then go on up to now (CATCHING_UP), and take their place in the bank. Groups of
   single parameters come first: sets of several parameters are tried only at the onsets that some single one makes likely.
   Nothing here depends on how large the portions are, but when it ends. How much of it a sample does: docs/method.md, "The
   bank". */
#ifndef FB_WORK_H
#define FB_WORK_H

#include "couples.h"
#include "first.h"
#include "ramps.h"

FB_SELDOM

/* Samples after the alarm at which the bank begins again from what it has found, at the earliest. */
#define FIRST_RENEWAL 30
#define SECOND_RENEWAL 100
#define LAST_RENEWAL 200
#define N_RENEWALS 3

#define BANK_STEPS 7.0 /* of the whole bank in one portion, or in a second, whichever is more */
#define WIDE_COST ((int64_t)WIDE_NUMBERS / PLAIN_NUMBERS + 1) /* of a sample of lanes with a slot, in that of plain ones */
#define KEPT_NATS 10.0 /* by which an onset may be less likely than the best for single parameters, and is tried for sets */
#define AWAITED 96     /* samples in which all lanes are to begin */
#define ENOUGH 10      /* of so many parts of the work one tells what the others will cost */
#define BEFORE 60      /* samples before all onsets so far with which a trail begins from which lanes begin again */
#define HOPELESS 40.0  /* nats by which a lane may be less likely than the best, and its onset is still sought */
#define FIRST_PART 0.4 /* of the time for beginning again twice; the second takes longer, since more samples lie behind */
#define NEARLY 0.9     /* of a group may be done, by what it has cost, as long as it is not */
#define TO_BEGIN 8     /* of beginning a group at an onset, in that of a sample */

enum { IDLE, BEGINNING, RENEWING, RENEWING_ALL };             /* kinds of work, */
enum { SINGLES, SETS, RESERVES, SLOTS, RAMPS, PAIRS, COUPLES, N_STAGES }; /* which lanes it is at, */
enum { OPENING, NEAR_ONSETS, CLOSER, CATCHING_UP };           /* and what is done with a group of them */

typedef struct {
    StepMemory steps;
    SlotMemory slots;
    FirstMemory first;
    double innovations[2 * N_OUTPUTS][FB_ROOM(N_LANES)];
} BankMemory;

/* Sample after the alarm from which on the bank begins again next. */
static int64_t next_renewal(const Job *job)
{
    return job->renewals == 0 ? FIRST_RENEWAL : job->renewals == 1 ? SECOND_RENEWAL : LAST_RENEWAL;
}

/* Lanes, or pairs, that begin in a stage. */
static int64_t lanes_of_stage(Bank *bank, const Job *job, int64_t stage, SlotMemory *memory)
{
    const int begins = job->kind == BEGINNING;
    if (stage == SINGLES) return job->n_singles;
    if (stage == SETS) return job->n_wanted - job->n_singles;
    if (stage == RESERVES) return begins ? 0 : N_LATER;
    if (stage == SLOTS) return begins ? RAMPED : find_renewed(bank, memory->renewed);
    if (stage == RAMPS) return begins || N_RAMPS < GROUP ? N_RAMPS : GROUP;
    if (stage == PAIRS) return begins ? N_PAIRS : 0;
    return begins ? 0 : N_COUPLE_LANES;
}

/* Lane number k of the stage, of steps or with a slot, which the group begins; `renewed`: where slots begin again. */
static int64_t lane_of_stage(const Job *job, int64_t k, const Renewed *renewed)
{
    if (job->stage == RESERVES) return reserve_lane(k);
    if (job->stage == SLOTS) return job->kind == BEGINNING ? k : renewed[k].spread;
    return job->wanted[job->stage == SETS ? job->n_singles + k : k];
}

/* Begin work on the bank; `change`: place in the trail of the onset to try for sure. */
static void begin_job(State *state, int64_t kind, const Trail *trail, int64_t change)
{
    Job *job = &state->job;
    job->kind = kind;
    job->oldest = trail->oldest;
    job->end = trail->oldest + trail->n - 1;
    job->old = trail->old ? (trail->old - state->healthy.snapshots[0]) / KEPT_NUMBERS : -1;
    job->change = change;
    for (int k = 0; k < N_INPUTS; k++) job->peak[k] = peak_of(&state->inputs, k);
    job->spent = job->opened = job->stage = job->group = 0;
    job->pass = OPENING;
    job->onset = job->likeliest = -1;
    job->most = LOWEST;
    for (int k = 0; k < MOST_ONSETS; k++) job->heard[k] = LOWEST;
}

/* Forget all work, as where there is no alarm. */
static void clear_job(Job *job)
{
    memset(job, 0, sizeof *job);
    job->ended = job->settled = job->onset = job->old = job->likeliest = -1;
}

/* Let all lanes of the plan begin. */
static void begin_all(State *state, const Trail *trail, int64_t change)
{
    Job *job = &state->job;
    Bank *bank = &state->bank;
    restate_all(trail, &state->past);
    clear_job(job);
    begin_job(state, BEGINNING, trail, change);
    job->n_singles = N_SINGLE_LANES;
    job->n_wanted = N_PLANNED;
    for (int64_t lane = 0; lane < N_PLANNED; lane++) job->wanted[lane] = lane;
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) bank->healthy[k] = healthy_at(trail, 0)[k];
}

/* Leave out what lies long before the onsets of all lanes: the work then may take as much longer. */
static void shorten(const Bank *bank, Trail *trail)
{
    int64_t first = trail->oldest + trail->alarm;
    for (int64_t lane = 0; lane < N_STEPS + SWITCHED; lane++)
        if ((lane < N_PLANNED || lane >= N_STEPS) && bank->onset[lane] < first) first = bank->onset[lane];
    const int64_t cut = first - BEFORE - trail->oldest;
    if (cut <= 0) return;
    trail->oldest += cut;
    trail->n -= cut;
    trail->alarm -= cut;
}

/* Let lanes begin again from what they have found, and those of the likeliest sets in reserve that are not rejected; at the
   last time all that may come to lead. */
static void begin_again(State *state, Trail *trail, BankMemory *memory)
{
    Job *job = &state->job;
    shorten(&state->bank, trail);
    restate_all(trail, &state->past);
    job->renewals++;
    begin_job(state, job->renewals == N_RENEWALS ? RENEWING_ALL : RENEWING, trail, trail->alarm);
    if (job->kind == RENEWING_ALL) want_leading(&state->bank, job->stands_for, memory->steps.known);
    else want_best(&state->bank, job->stands_for);
    job->n_singles = list_wanted(job->stands_for, job->wanted, &job->n_wanted);
}

/* The trail from which lanes begin. */
static void trail_of_job(const State *state, Trail *trail)
{
    const Job *job = &state->job;
    trail->past = &state->past;
    trail->oldest = job->oldest;
    trail->n = job->end - job->oldest + 1;
    trail->alarm = state->clock.alarm - job->oldest;
    trail->old = job->old >= 0 ? state->healthy.snapshots[job->old] : NULL;
    find_first(&state->clock, &state->alarm, &state->beginning, trail);
    find_bursts(trail);
}

/* Hear what single parameters say for the onsets that they tried, and at which they are likeliest. */
static void hear(Job *job)
{
    double most = LOWEST;
    for (int64_t k = 0; k < job->search.n; k++) {
        for (int l = 0; l < GROUP && job->search.standing[k] == TRIED; l++)
            job->heard[k] = fmax(job->heard[k], job->search.said[k][l]);
        if (!(job->heard[k] > most)) continue;
        most = job->heard[k];
        job->likeliest = job->search.place[k];
    }
}

/* Let only those onsets be tried at which a single parameter explains the samples nearly as well as at the best; where that moves
   little, not each of them. Where single parameters say little, sets count as saying nothing. */
static void keep_likely(Job *job)
{
    double most = LOWEST;
    int64_t first = -1, last = -1, kept = -1;
    Search *search = &job->search;
    for (int64_t k = 0; k < search->n; k++) most = fmax(most, job->heard[k]);
    if (!(most > LOWEST)) return;
    for (int64_t k = 0; k < search->n; k++) {
        search->standing[k] = job->heard[k] > LOWEST ? TRIED : SPARE;
        for (int l = 0; l < GROUP; l++) search->said[k][l] = LOWEST;
        if (job->heard[k] < most - KEPT_NATS) continue;
        search->standing[k] = SPARE;
        if (first < 0 || job->heard[k] == most || fabs(job->heard[k] - job->heard[kept]) > SMOOTH) {
            search->standing[k] = REQUIRED;
            kept = k;
        }
        if (first < 0) first = k;
        last = k;
    }
    search->standing[last] = REQUIRED;
    require_beside(search);
    search->fixed = 1;
}

/* Let a group try onsets: lanes that begin again near those that were best. */
static void open_search(Job *job, const Trail *trail)
{
    int64_t places[GROUP];
    const int early = trail->beginning && job->stage <= SLOTS;
    begin_search(trail, job->change, job->likeliest, early, &job->search);
    job->search.least = job->most - HOPELESS;
    for (int l = 0; l < GROUP; l++) places[l] = job->begins[l] - job->oldest;
    if (job->pass == CLOSER || (job->kind != BEGINNING && job->stage != RESERVES)) begin_near(places, &job->search);
    else if (job->stage == SETS || job->stage == RESERVES) keep_likely(job);
    if (job->pass == CLOSER) job->search.fixed = 1;
    job->onset = -1;
}

/* The start of lane l of the group, one of steps, where it begins first. */
static void planned_or_chosen(const State *state, const Trail *trail, int64_t l, Start *start)
{
    const Job *job = &state->job;
    const int64_t lane = job->lane[l], row = (lane - N_PLANNED) / PER_SET;
    if (lane < N_PLANNED) planned_start(lane, start);
    else start_of_choice(state->bank.grown[row], job->factors[row], (lane - N_PLANNED) % PER_SET, healthy_at(trail, 0), start);
    start->all_along = trail->all_along;
}

/* The starts of the group. Of those that begin from closer, others repeat the first whose stores jump. */
static void starts_of_group(const State *state, const Trail *trail, Start *starts)
{
    const Job *job = &state->job;
    int64_t first = -1;
    for (int64_t l = 0; l < GROUP; l++) {
        planned_or_chosen(state, trail, l, &starts[l]);
        if (job->pass == CLOSER && any_jump(&starts[l]) && first < 0) first = l;
    }
    for (int64_t l = 0; l < GROUP; l++) {
        const int64_t of = job->pass == CLOSER && first >= 0 && !any_jump(&starts[l]) ? first : l;
        if (of != l) planned_or_chosen(state, trail, of, &starts[l]);
        if (job->pass == CLOSER || (job->kind != BEGINNING && job->stage != RESERVES))
            move_to_found(&starts[l], job->found[of], healthy_at(trail, 0));
    }
}

/* Note what lanes of steps have found, from which they begin again. */
static void note_steps(State *state, const Trail *trail, StepMemory *memory)
{
    Job *job = &state->job;
    for (int64_t l = 0; l < GROUP; l++) {
        const int64_t lane = job->lane[l];
        planned_or_chosen(state, trail, l, &memory->starts[l]);
        note_found(&memory->starts[l], state->bank.steps[lane / GROUP], lane % GROUP, job->found[l]);
        job->begins[l] = state->bank.onset[lane];
    }
}

/* Time since the end of the trail, s. */
static double since_trail(State *state)
{
    double elapsed = 0.0;
    for (int64_t number = state->job.end + 1; number <= state->clock.index; number++)
        elapsed += row_of(&state->past, number)->sample[SAMPLE_DT];
    return elapsed;
}

/* Note what the best lanes of some faults have found, as it was at the end of the trail. */
static void note_slots(State *state, const Renewed *renewed, int64_t n)
{
    Job *job = &state->job;
    const double elapsed = since_trail(state);
    for (int64_t l = 0; l < GROUP; l++) {
        const int64_t best = renewed[l < n ? l : 0].best;
        job->begins[l] = state->bank.onset[N_STEPS + best];
        note_slot(best, of_slot(&state->bank, best, AT_SLOT), of_slot(&state->bank, best, AT_SLOT + 1), elapsed, job->found[l]);
    }
}

/* The same of a group of couples, with the first of which they are chosen; one of which none begins is passed over. */
static void open_couples(State *state, const Trail *trail, int64_t first)
{
    Job *job = &state->job;
    if (first == 0) choose_couples(&state->bank, trail->old, state->clock.index, job);
    if (list_couples(first, job) == 0) {
        job->pass = OPENING;
        job->group++;
        return;
    }
    note_couples(&state->bank, since_trail(state), job);
    open_search(job, trail);
}

/* Say which lanes the group has, and let them try onsets. */
static void open_group(State *state, const Trail *trail, BankMemory *memory)
{
    Job *job = &state->job;
    Bank *bank = &state->bank;
    const Renewed *renewed = memory->slots.renewed;
    const int64_t first = job->group * GROUP, n = lanes_of_stage(bank, job, job->stage, &memory->slots);
    job->pass = NEAR_ONSETS;
    if (job->stage == PAIRS) {
        begin_pairs(first, trail, job->peak, job->run, job->best, &memory->slots);
        job->pass = CATCHING_UP;
        job->next = job->oldest + 1;
        return;
    }
    if (job->stage == RESERVES && first == 0) choose_reserve(bank, state->clock.index, job->factors, memory->steps.best);
    if (job->stage == COUPLES) {
        open_couples(state, trail, first);
        return;
    }
    for (int64_t l = 0; l < GROUP; l++)
        job->lane[l] = job->stage == RAMPS ? drift_of(first + l < n ? first + l : first)
                                           : lane_of_stage(job, first + l < n ? first + l : first, renewed);
    if (job->kind != BEGINNING && job->stage == RAMPS) choose_ramps(bank, job->lane, job->begins);
    else if (job->kind != BEGINNING && job->stage == SLOTS) note_slots(state, renewed + first, n - first);
    else if (job->kind != BEGINNING) note_steps(state, trail, &memory->steps);
    open_search(job, trail);
}

/* Begin the group at an onset. */
static void begin_onset(State *state, const Trail *trail, int64_t k, BankMemory *memory, Filters *filters)
{
    Job *job = &state->job;
    const int64_t place = job->search.place[k];
    const int at_first = job->search.early && k == 0;
    if (job->stage == RAMPS) {
        begin_ramps(job->lane, trail, place, job->peak, job->run, job->stays, &memory->slots);
    } else if (job->stage == COUPLES) {
        begin_couples(&state->bank, trail, place, &state->normal, job, &memory->steps, &memory->slots, filters);
    } else if (job->stage == SLOTS && at_first) {
        begin_slots_at_first(job->lane, trail, job->peak, &state->clock, &state->normal, job->run, &job->walk, &memory->slots, &memory->first,
                             &filters->plain);
    } else if (job->stage == SLOTS) {
        begin_slots(job->lane, job->kind == BEGINNING ? NULL : job->found, trail, place, job->peak, job->run, &job->walk,
                    &memory->slots);
    } else {
        starts_of_group(state, trail, memory->steps.starts);
        if (at_first)
            begin_steps_at_first(memory->steps.starts, trail, &state->clock, &state->normal, job->run, &memory->steps, &memory->first,
                                 &filters->plain);
        else begin_steps(memory->steps.starts, trail, place, &state->normal, job->run, &memory->steps, &filters->plain);
    }
    job->onset = k;
    job->next = job->oldest + place;
}

/* Whether the group, which is none of pairs, has slots. */
static inline int is_wide(const Job *job) { return job->stage == SLOTS || job->stage == RAMPS || job->stage == COUPLES; }
static inline int64_t numbers_of_group(const Job *job) { return is_wide(job) ? WIDE_NUMBERS : PLAIN_NUMBERS; }

/* Whether lanes of the group are to begin a second time, from what they then know: a jump that is tied to its factor says much
   and is linearised. */
static int begins_closer(const State *state, const Trail *trail, StepMemory *memory)
{
    const Job *job = &state->job;
    int jumping = 0;
    if (job->kind == BEGINNING || is_wide(job) || job->pass == CLOSER) return 0;
    for (int64_t l = 0; l < GROUP; l++) {
        planned_or_chosen(state, trail, l, &memory->starts[l]);
        jumping |= any_jump(&memory->starts[l]);
    }
    return jumping;
}

/* Of lanes that began from closer, take back those which that led astray. */
static void take_back(State *state, const Trail *trail, StepMemory *memory)
{
    Job *job = &state->job;
    for (int64_t l = 0; l < GROUP; l++) {
        planned_or_chosen(state, trail, l, &memory->starts[l]);
        const double spread = job->before[PLAIN_LIKELIHOOD][l] - job->before_most[l]; /* of the onset: the same from closer */
        const double again = finite_or_lowest(job->search.most[l] + spread);
        job->best[PLAIN_LIKELIHOOD][l] = again;
        if (any_jump(&memory->starts[l]) && again > finite_or_lowest(job->before[PLAIN_LIKELIHOOD][l]) - ASTRAY) continue;
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) job->best[k][l] = job->before[k][l];
        job->begins[l] = job->began[l];
    }
}

/* Give the lanes of the group the likelihood of the mixture over onsets; of pairs, in the shares that both lanes have. */
static void conclude_mixture(Job *job)
{
    double mean[GROUP];
    mean_over_onsets(&job->search, mean);
    for (int l = 0; l < GROUP; l++) {
        if (job->stage != RAMPS) {
            job->best[numbers_of_group(job) - 1][l] = mean[l];
            continue;
        }
        job->best[WIDE_LIKELIHOOD][l] += mean[l] - job->search.most[l];
        job->best_stays[WIDE_LIKELIHOOD][l] += mean[l] - job->search.most[l];
    }
}

/* The group has taken the trail from an onset on: keep it where that is the best so far. */
static void hear_onset(Job *job)
{
    const double *said = job->run[numbers_of_group(job) - 1];
    double both[GROUP];
    if (job->stage == RAMPS) {
        join_ramps(job->run, job->stays, both);
        said = both;
    }
    mix(&job->search, job->onset, said, job->run, numbers_of_group(job), job->best);
    for (int l = 0; l < GROUP && job->stage == RAMPS; l++)
        for (int64_t i = 0; i < WIDE_NUMBERS && job->search.best[l] == job->onset; i++)
            job->best_stays[i][l] = job->stays[i][l];
}

/* All onsets of the group were tried: it begins from closer, or goes on with the best of them. */
static void close_search(State *state, const Trail *trail, BankMemory *memory)
{
    Job *job = &state->job;
    conclude_mixture(job);
    memcpy(job->began, job->begins, sizeof job->began);
    for (int l = 0; l < GROUP; l++) job->begins[l] = job->oldest + job->search.place[job->search.best[l]];
    for (int l = 0; l < GROUP; l++) job->most = fmax(job->most, job->search.most[l]);
    if (job->stage == SINGLES && job->pass == NEAR_ONSETS) hear(job);
    if (begins_closer(state, trail, &memory->steps)) {
        memcpy(job->before, job->best, sizeof job->before);
        memcpy(job->before_most, job->search.most, sizeof job->before_most);
        for (int64_t l = 0; l < GROUP; l++) note_found(&memory->steps.starts[l], job->before, l, job->found[l]);
        job->pass = CLOSER;
        open_search(job, trail);
        return;
    }
    if (job->pass == CLOSER) take_back(state, trail, &memory->steps);
    memcpy(job->run, job->best, sizeof job->run);
    if (job->stage == RAMPS) memcpy(job->stays, job->best_stays, sizeof job->stays);
    job->pass = CATCHING_UP;
    job->next = job->end + 1;
}

/* Lane l of the group has taken the place of a lane of the bank, which is judged anew from now on. */
static void note_change(State *state, int64_t lane, int64_t l)
{
    state->bank.onset[lane] = state->job.begins[l];
    begin_misfit_again(&state->bank, lane, state->clock.index);
}

/* Put lane l of the group into the bank, where lanes begin at the alarm. */
static void put_first(State *state, int64_t l)
{
    Bank *bank = &state->bank;
    Job *job = &state->job;
    const int64_t lane = job->lane[l], pair = SWITCHED + 2 * (job->group * GROUP + l);
    if (job->stage == PAIRS) {
        put_slot(bank, pair, job->run, l);
        put_slot(bank, pair + 1, job->best, l);
    } else if (job->stage == RAMPS) {
        put_slot(bank, lane, job->run, l);
        put_slot(bank, lane + 1, job->stays, l);
        bank->onset[N_STEPS + lane] = bank->onset[N_STEPS + lane + 1] = job->begins[l];
    } else if (job->stage == SLOTS) {
        put_slot(bank, lane, job->run, l);
        bank->onset[N_STEPS + lane] = job->begins[l];
    } else {
        (void)replace_lane(bank, lane, job->run, l, PLAIN_NUMBERS);
        bank->onset[lane] = job->begins[l];
    }
}

/* The same of lanes of steps that begin again. A lane that may come to lead stands for all that have found the same, and they
   stay as they were where the new beginning led astray. */
static void put_leading(State *state, int64_t l)
{
    Bank *bank = &state->bank;
    Job *job = &state->job;
    const int64_t lane = job->lane[l], set = LANE_HYPOTHESIS[lane];
    const double again = finite_or_lowest(job->run[PLAIN_LIKELIHOOD][l]);
    for (int64_t k = FIRST_LANE[set]; k < FIRST_LANE[set + 1]; k++)
        if (job->stands_for[k] == lane && again > likelihood_of(bank, k) - ASTRAY &&
            replace_lane(bank, k, job->run, l, PLAIN_NUMBERS))
            note_change(state, k, l);
}

static void put_again(State *state, int64_t l, const Renewed *renewed)
{
    Bank *bank = &state->bank;
    Job *job = &state->job;
    int64_t changed = -1;
    if (job->stage == RESERVES) changed = replace_grown(bank, job->lane[l], job->run, l) ? job->lane[l] : -1;
    else if (job->stage == COUPLES) changed = put_couple(bank, job, l);
    else if (job->stage == RAMPS) changed = replace_pair(bank, job->lane[l], job->run, job->stays, l) ? job->lane[l] : -1;
    else if (job->stage == SLOTS) changed = replace_worst_slot(bank, &renewed[l], job->run, l);
    else if (job->kind == RENEWING) changed = replace_worst(bank, LANE_HYPOTHESIS[job->lane[l]], job->run, l);
    else put_leading(state, l);
    if (changed >= 0) note_change(state, (is_wide(job) ? N_STEPS : 0) + changed, l);
    if (changed >= 0 && job->stage == RAMPS) note_change(state, N_STEPS + changed + 1, l);
}

/* Put the group, which is at the sample of now, into the bank. */
static void put_group(State *state, SlotMemory *memory)
{
    Job *job = &state->job;
    Bank *bank = &state->bank;
    const int64_t first = job->group * GROUP, n = lanes_of_stage(bank, job, job->stage, memory);
    for (int64_t l = 0; l < in_group(first, n); l++) {
        if (job->stage == COUPLES && job->lane[l] != first + l) continue; /* repeats another one */
        if (job->kind == BEGINNING) put_first(state, l);
        else put_again(state, l, memory->renewed + first);
    }
    fill_last_block(bank);
    fill_up_slots(bank);
    fill_up_couples(bank);
}

/* After all that may come to lead have begun again, the others go on from the best of their hypothesis, as little likely as they
   were. */
static void follow_best(State *state)
{
    Bank *bank = &state->bank;
    for (int64_t lane = 0; lane < N_PLANNED; lane++) {
        if (state->job.stands_for[lane] != NOT_AGAIN) continue;
        const int64_t best = likeliest_lane(bank, LANE_HYPOTHESIS[lane]);
        bank->onset[lane] = bank->onset[best];
        if (replace_lane(bank, lane, bank->steps[best / GROUP], best % GROUP, PLAIN_LIKELIHOOD))
            begin_misfit_again(bank, lane, state->clock.index);
    }
    fill_last_block(bank);
}

/* What a group is likely to cost, in that of one at the alarm that is told where to look. Where lanes begin again, they do so at
   every sample about their onset. */
static inline int64_t share_of(const Job *job, int64_t stage)
{
    const int again = job->kind != BEGINNING;
    if (stage == SLOTS || stage == COUPLES) return (again ? 6 : 4) * WIDE_COST;
    if (stage == RAMPS) return (again ? 20 : 8) * WIDE_COST;
    return again ? 6 : stage == SETS ? 1 : 4;
}

/* Shares of all groups of the work; `done`: of those that are. */
static int64_t shares_of(State *state, SlotMemory *memory, int64_t *done)
{
    const Job *job = &state->job;
    int64_t all = 0;
    *done = job->stage < N_STAGES ? job->group * share_of(job, job->stage) : 0;
    for (int64_t stage = 0; stage < N_STAGES; stage++) {
        const int64_t share = share_of(job, stage) * BLOCKS(lanes_of_stage(&state->bank, job, stage, memory));
        all += share;
        if (stage < job->stage) *done += share;
    }
    return all;
}

/* The work is done. */
static void end_job(State *state, SlotMemory *memory)
{
    Job *job = &state->job;
    int64_t done;
    const int64_t all = shares_of(state, memory, &done);
    if (all > 0) job->price = (double)job->spent / (double)all;
    if (job->kind == RENEWING_ALL) follow_best(state);
    if (job->kind == BEGINNING) begin_misfit(&state->bank, state->clock.index);
    job->ended = state->clock.index;
    if (job->renewals != 1) job->settled = job->ended;
    job->kind = IDLE;
}

/* Move on to the next group there is, or end. */
static void next_group(State *state, SlotMemory *memory)
{
    Job *job = &state->job;
    while (job->stage < N_STAGES && job->group >= BLOCKS(lanes_of_stage(&state->bank, job, job->stage, memory))) {
        job->stage++;
        job->group = 0;
    }
    if (job->stage == N_STAGES) end_job(state, memory);
}

/* What a sample costs that the group takes. */
static inline int64_t cost_of_group(const Job *job)
{
    if (job->stage == PAIRS || job->stage == RAMPS) return 2 * WIDE_COST;
    return is_wide(job) ? WIDE_COST : 1;
}

/* Let the lanes that run take samples, of a cost of up to `most`; gives what they took. */
static int64_t run_group(State *state, const Trail *trail, int64_t most, BankMemory *memory, Filters *filters)
{
    Job *job = &state->job;
    const int64_t cost = cost_of_group(job);
    const int64_t last = job->pass == CATCHING_UP ? state->clock.index : job->end, left = last + 1 - job->next;
    const int64_t n = left <= most / cost ? left : most / cost + 1, from = job->next - job->oldest;
    const int64_t onset = job->pass == CATCHING_UP ? 0 : job->search.place[job->onset];
    int64_t begun[GROUP];
    for (int l = 0; l < GROUP; l++) begun[l] = job->pass == CATCHING_UP ? job->begins[l] : job->oldest + onset;
    if (job->stage == RAMPS)
        run_ramps(job->run, job->stays, trail, from, from + n, begun, &state->normal, &filters->wide, &memory->slots);
    else if (job->stage == PAIRS)
        run_pairs(job->run, job->best, trail, from, from + n, &state->normal, &filters->wide, &memory->slots);
    else if (is_wide(job))
        run_slots(job->run, trail, from, from + n, onset, job->pass == CATCHING_UP ? NULL : &job->walk,
                  job->stage == COUPLES && job->pass != CATCHING_UP ? onset : -1, &state->normal, memory->slots.sample, &filters->wide);
    else
        run_steps(job->run, trail, from, from + n, job->search.early && job->onset == 0 ? -1 : onset, &state->normal,
                  memory->steps.sample, &filters->plain); /* those of the first sample of all stand before it */
    job->next += n;
    return n * cost;
}

/* Do the next piece of work, of a cost of up to `most`; gives what it took. */
static int64_t work_a_little(State *state, const Trail *trail, int64_t most, BankMemory *memory, Filters *filters)
{
    Job *job = &state->job;
    if (job->pass == OPENING) {
        next_group(state, &memory->slots);
        job->opened = job->spent;
        if (job->kind != IDLE) open_group(state, trail, memory);
        return 1;
    }
    if (job->pass != CATCHING_UP && job->onset < 0) {
        const int64_t k = next_onset(&job->search);
        if (k < 0) close_search(state, trail, memory);
        else begin_onset(state, trail, k, memory, filters);
        return k < 0 ? 1 : TO_BEGIN * cost_of_group(job);
    }
    const int64_t n = run_group(state, trail, most, memory, filters);
    if (job->pass == CATCHING_UP && job->next > state->clock.index) {
        put_group(state, &memory->slots);
        job->group++;
        job->pass = OPENING;
    } else if (job->pass != CATCHING_UP && job->next > job->end) {
        hear_onset(job);
        job->onset = -1;
    }
    return n;
}

/* Sample at which the work may end at the latest. Samples that it needs are not kept for ever; and where the bank is to begin
   again once more, those about the alarm are still needed then, if there is time enough for it: in a part of that where it is to do
   so twice. */
static int64_t latest_end(const State *state)
{
    const Job *job = &state->job;
    const int64_t of_trail = job->oldest + N_ROWS - 1, spread = job->end + SPREAD;
    const int64_t kept = of_trail < spread ? of_trail : spread, about_alarm = state->clock.alarm + DEPTH - 2;
    if (job->kind == BEGINNING) return job->end + AWAITED;
    const int64_t both = about_alarm - job->end;
    if (job->renewals >= N_RENEWALS || both < SPREAD / 2) return kept;
    const int64_t latest = job->renewals + 1 < N_RENEWALS ? job->end + (int64_t)(FIRST_PART * (double)both) : about_alarm;
    return latest < kept ? latest : kept;
}

/* What is left of the work is likely to cost, by what a share did so far, or in the work before; 0: nobody knows. */
static double cost_left(State *state, SlotMemory *memory)
{
    const Job *job = &state->job;
    int64_t done;
    const int64_t all = shares_of(state, memory, &done);
    const double price = done > 0 && ENOUGH * done >= all ? (double)job->opened / (double)done : job->price;
    const double group = price * (double)(job->stage < N_STAGES ? share_of(job, job->stage) : 0);
    return price * (double)(all - done) - fmin((double)(job->spent - job->opened), NEARLY * group);
}

/* What the work may cost now, in samples of a group of plain lanes, so that no step takes long, and the work ends in time: the
   first diagnosis waits for it, and samples that it needs are not kept for ever. */
static int64_t portion_of(State *state, SlotMemory *memory)
{
    const double groups = (double)(BLOCKS(N_STEPS) + WIDE_COST * (BLOCKS(SWITCHED) + 2 * BLOCKS(N_PAIRS)));
    const double usual = BANK_STEPS * groups * (SAMPLE_TIME > 1.0 ? SAMPLE_TIME : 1.0);
    const int64_t left = latest_end(state) - state->clock.index;
    if (left <= 0 || !(usual < 1e15)) return INT64_MAX;
    const double needed = cost_left(state, memory) / (double)left;
    return (int64_t)(needed > usual && needed < 1e15 ? needed : usual) + 1;
}

/* Work on the bank for a portion of this cost. */
static void work_for(State *state, int64_t portion, BankMemory *memory, Filters *filters)
{
    Job *job = &state->job;
    Trail trail;
    if (job->kind == IDLE) return;
    trail_of_job(state, &trail);
    while (job->kind != IDLE && portion > 0) {
        const int64_t n = work_a_little(state, &trail, portion, memory, filters);
        job->spent += n;
        portion -= n;
    }
}

FB_OFTEN

#endif
