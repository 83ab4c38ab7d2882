/* Accepting and rejecting a candidate: what a person, or a rule, makes of a diagnosis.

   An accepted candidate becomes the healthy model: its lane goes on as the healthy filter, what is wrong with an
   instrument is corrected from then on, and the alarms are on again. One that was repaired is as it was declared instead, and
   the others are as they were known before it. A rejected one is out until the next alarm, and with it all sets that contain
   it: that all of a set are at fault is claimed by each of these too. Formulas: docs/method.md, "The bank". */
#ifndef FB_DECIDE_H
#define FB_DECIDE_H

#include "rest.h"
#include "rule.h"

FB_SELDOM

#define ACCEPTED_WANDER 0.5 /* of what an accepted drift moves in a sample, the parameter may move otherwise */
#define MOST_NOISE 0.25     /* of the variance of a blanked sensor: one accepted with more would count as such */
#define INDEFINITE 1e-6     /* part of a variance that rounding may take off it, and it is still one */

/* Why nothing was accepted or rejected; the state is then as it was. */
enum {
    NO_ALARM = -1,         /* there is nothing to explain */
    NO_SUCH_NUMBER = -2,   /* no hypothesis has it */
    NOT_LISTED = -3,       /* it is not among the candidates, or its lane has run away */
    REJECTED_ALREADY = -4, /* alone, or with a set that it contains */
    LAST_ONE = -5,         /* all that are left contain it */
};

/* Find the candidate of a hypothesis as it stands now; 0, or why there is none. found, memory: as of `conclude`. */
static int candidate_of(const State *state, int64_t hypothesis, Candidate *candidate, Diagnosis *found,
                        RankingMemory *memory)
{
    if (state->clock.alarm < 0) return NO_ALARM;
    if (hypothesis < 0 || hypothesis >= N_HYPOTHESES) return NO_SUCH_NUMBER;
    conclude(state, found, memory);
    for (int64_t row = 0; row < found->n_candidates; row++)
        if (found->candidates[row].hypothesis == hypothesis) {
            *candidate = found->candidates[row];
            return 0;
        }
    return NOT_LISTED;
}

/* Whether the numbers of a lane are such; one that ran away cannot go on as the healthy filter. */
static int is_left(const Bank *bank, int64_t lane)
{
    const int64_t count = lane < N_STEPS ? PLAIN_NUMBERS : WIDE_NUMBERS;
    for (int64_t k = 0; k < count; k++)
        if (!isfinite(lane < N_STEPS ? of_step(bank, lane, k) : of_slot(bank, lane - N_STEPS, k))) return 0;
    return 1;
}

/* Whether the covariance of a plain lane is one: knowing some of its numbers leaves no other less than certain, but for
   rounding. Of states beyond all sense rounding may leave none. Elimination of one number after the other; `left`: memory. */
static int is_definite(const double *lane, double *left)
{
    memcpy(left, lane, PLAIN_NUMBERS * sizeof *left);
    for (int k = 0; k < PLAIN_JOINT; k++) {
        const double own = lane[PLAIN_PLACE(k, k)], rest = left[PLAIN_PLACE(k, k)];
        if (!(rest >= -INDEFINITE * own)) return 0;
        for (int i = k + 1; rest > INDEFINITE * own && i < PLAIN_JOINT; i++)
            for (int j = i; j < PLAIN_JOINT; j++)
                left[PLAIN_PLACE(i, j)] -= left[PLAIN_PLACE(k, i)] / rest * left[PLAIN_PLACE(k, j)];
    }
    return 1;
}

/* Correct a sensor, or do without it where it no longer follows the plant, drifts, or errs at times. kind, estimate: what the
   diagnosis tells of it, SI. */
static void absorb_sensor(State *state, int j, int64_t kind, double size, double estimate)
{
    Normal *normal = &state->normal;
    switch (kind) {
    case KIND_BIAS:
    case KIND_RAMP:
        normal->offset[j] += normal->gain[j] * size * OUTPUT_NOISE[j];
        break;
    case KIND_GAIN:
        normal->offset[j] -= normal->gain[j] * size * OUTPUT_ZERO[j];
        normal->gain[j] *= 1.0 + size;
        break;
    case KIND_NOISE: {
        const double ratio = estimate / OUTPUT_NOISE[j], most = MOST_NOISE * BLANK_FACTOR;
        normal->noise[j] = most < ratio * ratio ? most : ratio * ratio;
        state->sensors.nis[j] = state->sensors.run[j] = 1.0; /* the noise that was found is what squares are now taken in */
        break;
    }
    default:
        normal->noise[j] = INFINITY;
    }
}

/* What is known of input k by its records, which become `gain` times what they were plus `offset`: what acts is not changed by
   knowing of it. For how long they were the same as long as they were wrong tells nothing of healthy ones. */
static void change_records(Inputs *inputs, int k, double gain, double offset)
{
    inputs->held[k] = gain * inputs->held[k] + offset;
    for (int m = 0; m < N_SMOOTH; m++)
        for (int t = 0; t < TRENDS && NOISY[SMOOTH_NOISE[m]] == k; t++) {
            inputs->trends[m][t][TREND_LEVEL] = gain * inputs->trends[m][t][TREND_LEVEL] + offset;
            inputs->trends[m][t][TREND_SLOPE] *= gain;
        }
#if N_NOISY > 0
    for (int n = 0; n < N_NOISY; n++) {
        if (NOISY[n] != k) continue;
        inputs->record[n] = gain * inputs->record[n] + offset;
        inputs->still[n] = 0.0;
    }
#endif
}

/* Make what a lane of the plan is about part of the plant or its instruments, of this kind, size and rate: a parameter becomes
   what it and the slot add up to, and goes on as it drifts. */
static void absorb(State *state, int64_t slot, int64_t kind, double size, double rate, double estimate)
{
    const int parameter = SLOT_PARAMETER[slot], input = SLOT_INPUT[slot];
    if (parameter >= 0 && kind == KIND_DRIFT) {
        state->normal.rates[parameter] += rate;
        state->normal.wander[parameter] = fabs(ACCEPTED_WANDER * state->normal.rates[parameter]);
    } else if (input >= 0 && SLOT_STICKS[slot]) {
        state->normal.input_gain[input] = 0.0;
        state->normal.input_offset[input] = size;
        change_records(&state->inputs, input, 0.0, size);
    } else if (input >= 0 && SLOT_SCALES[slot]) {
        state->normal.input_gain[input] *= 1.0 + size;
        state->normal.input_offset[input] += size * (state->normal.input_offset[input] - INPUT_ZERO[input]);
        change_records(&state->inputs, input, 1.0 + size, -size * INPUT_ZERO[input]);
    } else if (input >= 0 && SLOT_ACTS[slot]) {
        state->normal.input_offset[input] += size;
        change_records(&state->inputs, input, 1.0, size);
    } else if (parameter < 0 && SLOT_ACTS[slot]) {
        absorb_sensor(state, SLOT_OUTPUT[slot], SLOT_SCALES[slot] && kind == KIND_RAMP ? KIND_GAIN : kind, size, estimate);
    }
}

/* The same of all that a lane with a slot holds. */
static void absorb_lane(State *state, int64_t lane, const Candidate *candidate)
{
    const Bank *bank = &state->bank;
    const double size = of_slot(bank, lane, AT_SLOT), rate = of_slot(bank, lane, AT_SLOT + 1);
    const int64_t slot = plan_of(bank, lane), beside = lane < N_SLOT_LANES ? -1 : beside_of(bank, lane - N_SLOT_LANES, slot);
    absorb(state, slot, kind_of(bank, N_STEPS + lane), size, rate, candidate->suspects[0].estimate);
    const int second = LARGEST_SET > 1; /* where no set has two suspects, none is beside another */
    if (beside >= 0) absorb(state, beside, SLOT_KIND[beside], rate, 0.0, candidate->suspects[second].estimate);
}

/* A parameter, the first of n, is again what the model file says, as well known as that; nothing is known by it but of those
   that go with it, and by them. The n - 1 others are renewed later. */
static void renew_parameter(State *state, const int *chosen, int n, Given *given)
{
    double *lane = state->healthy.lane;
    const int k = chosen[0], i = AT_PARAMETERS + k;
    state->normal.rates[k] = state->normal.wander[k] = 0.0;
    for (int j = 0; j < PLAIN_JOINT; j++) lane[plain_place(i, j)] = 0.0;
    lane[PLAIN_PLACE(i, i)] = ACCURACY[k] * ACCURACY[k];
    lane[i] = HEALTHY[k];
    if (!is_tied(k)) return;
    lane[PLAIN_PLACE(i, i)] = depends_on(chosen, n, given);
    for (int m = 0; m < N_PARAMETERS; m++) {
        const int at = AT_PARAMETERS + m;
        if (m == k || given->row[0][m] == 0.0) continue;
        lane[i] -= given->row[0][m] * (lane[at] - HEALTHY[m]);
        for (int j = 0; j < PLAIN_JOINT; j++)
            if (j != i) lane[plain_place(i, j)] -= given->row[0][m] * lane[plain_place(at, j)];
    }
    for (int m = 0; m < N_PARAMETERS; m++)
        if (m != k) lane[PLAIN_PLACE(i, i)] -= given->row[0][m] * lane[plain_place(i, AT_PARAMETERS + m)];
}

/* The sensor or input of a lane of the plan (-1: none) is as declared. */
static void renew_instrument(State *state, int64_t slot)
{
    const int output = slot < 0 ? -1 : SLOT_OUTPUT[slot], input = slot < 0 ? -1 : SLOT_INPUT[slot];
    Normal *normal = &state->normal;
    if (output >= 0) {
        normal->gain[output] = normal->noise[output] = state->sensors.nis[output] = state->sensors.run[output] = 1.0;
        normal->offset[output] = 0.0;
    }
    if (input >= 0) {
        const double gain = normal->input_gain[input] != 0.0 ? normal->input_gain[input] : 1.0; /* where one stuck it may stay */
        change_records(&state->inputs, input, 1.0 / gain, normal->input_gain[input] != 0.0 ? -normal->input_offset[input] / gain : 0.0);
        normal->input_gain[input] = 1.0;
        normal->input_offset[input] = 0.0;
    }
}

/* Let a plain lane have the parameters of an old one, uncorrelated with all else. */
static void take_back_parameters(const double *old, double *lane)
{
    for (int i = AT_PARAMETERS; i < AT_SLOT; i++) {
        lane[i] = old[i];
        for (int j = 0; j < AT_PARAMETERS; j++) lane[PLAIN_PLACE(j, i)] = 0.0;
        for (int j = i; j < AT_SLOT; j++) lane[PLAIN_PLACE(i, j)] = old[PLAIN_PLACE(i, j)];
        for (int j = AT_SLOT; j < PLAIN_JOINT; j++) lane[PLAIN_PLACE(i, j)] = 0.0;
    }
}

/* Parameters are again as they were known before the fault, and slow errors begin anew. What they have learned since holds with
   the fault only, and after the repair, until somebody told of it, they made up for a fault that was gone. One that moves by
   itself goes on from where it is. */
static void forget_fault(State *state)
{
    double *lane = state->healthy.lane, moving[FB_ROOM(N_PARAMETERS)][2];
    for (int k = 0; k < N_PARAMETERS; k++) {
        moving[k][0] = lane[AT_PARAMETERS + k];
        moving[k][1] = lane[PLAIN_PLACE(AT_PARAMETERS + k, AT_PARAMETERS + k)];
    }
    take_back_parameters(state->alarm.old >= 0 ? state->healthy.snapshots[state->alarm.old] : state->bank.healthy, lane);
    forget_slow_errors(lane);
    for (int k = 0; k < N_PARAMETERS; k++) {
        const int i = AT_PARAMETERS + k;
        if (state->normal.rates[k] == 0.0) continue;
        for (int j = 0; j < PLAIN_JOINT; j++) lane[plain_place(i, j)] = 0.0;
        lane[i] = moving[k][0];
        lane[PLAIN_PLACE(i, i)] = moving[k][1];
    }
}

/* What was at fault has been repaired: parameters, or the sensors or inputs of two lanes of the plan (-1: none), are as declared.
   The plant was handled meanwhile, so that its states may be elsewhere. */
static void renew(State *state, int64_t hypothesis, int64_t slot, int64_t beside, Given *given)
{
    const int *members;
    const int n = members_of(hypothesis, &members);
    forget_fault(state);
    for (int i = 0; i < n; i++) renew_parameter(state, members + i, n - i, given);
    renew_instrument(state, slot);
    renew_instrument(state, beside);
    resume(&state->clock);
}

/* Take a hypothesis as the new healthy model, or as `repaired`; `candidate`: as it stood. Gives 0, or why not. */
static int accept(State *state, int64_t hypothesis, int repaired, Candidate *candidate, Diagnosis *found,
                  RankingMemory *memory)
{
    const int failure = candidate_of(state, hypothesis, candidate, found, memory);
    if (failure) return failure;
    score_all(state, OUT_NONE, &memory->ranking); /* what was rejected may be accepted, with its best lane */
    const int64_t lane = memory->ranking.best[hypothesis], slot = lane - N_STEPS, last = state->clock.index - 1;
    const int64_t of_plan = slot < 0 ? -1 : plan_of(&state->bank, slot);
    for (int64_t k = 0; slot < 0 && k < PLAIN_NUMBERS; k++) memory->plain[k] = of_step(&state->bank, lane, k);
    for (int64_t k = 0; slot >= 0 && k < WIDE_NUMBERS; k++) memory->wide[k] = of_slot(&state->bank, slot, k);
    if (slot >= 0) narrow(memory->wide, SLOT_ACTS[of_plan], SLOT_PARAMETER[of_plan], memory->plain);
    if (!is_left(&state->bank, lane) || !is_definite(memory->plain, memory->left)) return NOT_LISTED;
    const int64_t beside = slot < N_SLOT_LANES ? -1 : beside_of(&state->bank, slot - N_SLOT_LANES, of_plan);
    if (slot >= 0 && !repaired) absorb_lane(state, slot, candidate);
    memcpy(state->healthy.lane, memory->plain, sizeof memory->plain);
    if (repaired) renew(state, hypothesis, of_plan, beside, &memory->ranking.given);
    memcpy(state->normal.lane, state->healthy.lane, sizeof state->normal.lane);
    begin_walks(&state->healthy, state->healthy.lane, row_of(&state->past, last)->time);
    memcpy(row_of(&state->past, last)->lane, state->healthy.lane, sizeof state->normal.lane);
    state->clock.accepted = last;
    begin_sums(&state->sensors, (double)last);
    end_alarm(state);
    return 0;
}

/* Rule a hypothesis out until the next alarm, with all sets that contain it; the others share their probability.
   Gives 0, or why not. */
static int reject(State *state, int64_t hypothesis, Candidate *candidate, Diagnosis *found, RankingMemory *memory)
{
    Bank *bank = &state->bank;
    const int failure = candidate_of(state, hypothesis, candidate, found, memory);
    if (failure) return failure;
    if (bank->rejected[hypothesis]) return REJECTED_ALREADY;
    int is_last = 1;
    for (int64_t k = 0; k < N_HYPOTHESES; k++)
        if (memory->ranking.score[k] > -INFINITY && !bank->rejected[k] && !has_all_of(k, hypothesis)) is_last = 0;
    if (is_last) return LAST_ONE;
    for (int64_t k = 0; k < N_HYPOTHESES; k++)
        if (has_all_of(k, hypothesis)) bank->rejected[k] = 1;
    wake(bank, state->clock.index);
    forget_sure(&state->sure);
    forget_sure(&state->settled.now); /* what was sure before stays so, unless that is what is rejected */
    return 0;
}

FB_OFTEN

#endif
