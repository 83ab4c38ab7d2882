/* Values that still move: under the hypothesis that is true what a lane has found settles, and moves only as its variance
   shrinks, var(theta_t - theta_s) = P_s - P_t. One that moves farther is not to be relied on as its standard deviation says.

   After the bank has begun for the last time the suspects of each lane are noted 100, 200, 400, ... samples later. Formulas:
   docs/method.md, "Ranking". */
#ifndef FB_MOVING_H
#define FB_MOVING_H

#include "estimates.h"

#define NOTED_FROM 100   /* samples after the last work on the bank at which values are noted first */
#define AT_ONCE 3.0      /* samples in which what moves is a step */
#define MOVES_SDS 2.0    /* of its sd a rate has to be for what has it to move, or what moved as much likelier than a step */
#define STILL 4.0        /* sd of what is usual by which a value may move and count as settled */

FB_SELDOM

/* Parameters of a hypothesis, and how many; none of an instrument. */
static int members_of(int64_t hypothesis, const int **members)
{
    if (hypothesis < N_SETS) {
        *members = &SET_MEMBER[SET_ROW[hypothesis]];
        return SET_ROW[hypothesis + 1] - SET_ROW[hypothesis];
    }
    *members = RESERVE_MEMBER;
    if (hypothesis < N_BEGUN) return 0;
    const int64_t row = hypothesis - N_BEGUN;
    if (row >= N_RESERVE) { /* couples with an instrument are the first */
        *members = &COUPLE_PARAMETER[row - N_RESERVE];
        return COUPLE_BESIDE[row - N_RESERVE] < 0;
    }
    *members = &RESERVE_MEMBER[RESERVE_ROW[row]];
    return RESERVE_ROW[row + 1] - RESERVE_ROW[row];
}

/* The first instrument of a hypothesis, as a hypothesis, and the second; -1: none. */
static int64_t instrument_of(int64_t hypothesis)
{
    if (hypothesis >= FIRST_MIXED) return COUPLE_SLOT[hypothesis - FIRST_MIXED];
    return hypothesis >= N_SETS && hypothesis < N_BEGUN ? hypothesis : -1;
}

static int64_t second_instrument_of(int64_t hypothesis)
{
    return hypothesis >= FIRST_MIXED ? COUPLE_BESIDE[hypothesis - FIRST_MIXED] : -1;
}

/* Whether a hypothesis is another one, or contains it. */
static int has_all_of(int64_t hypothesis, int64_t part)
{
    const int *chosen, *members;
    const int n = members_of(part, &chosen), n_members = members_of(hypothesis, &members);
    const int64_t wanted[2] = {instrument_of(part), second_instrument_of(part)};
    for (int i = 0; i < 2; i++)
        if (wanted[i] >= 0 && instrument_of(hypothesis) != wanted[i] && second_instrument_of(hypothesis) != wanted[i]) return 0;
    for (int i = 0; i < n; i++) {
        int is_there = 0;
        for (int k = 0; k < n_members; k++) is_there |= members[k] == chosen[i];
        if (!is_there) return 0;
    }
    return 1;
}

/* The hypothesis of a lane, steps first. */
static int64_t hypothesis_of(const Bank *bank, int64_t lane)
{
    if (lane < N_PLANNED) return LANE_HYPOTHESIS[lane];
    if (lane >= N_STEPS + N_SLOT_LANES) {
        const int64_t couple = couple_of(bank, lane - N_STEPS);
        return couple < 0 ? 0 : COUPLE_HYPOTHESIS[couple];
    }
    if (lane >= N_STEPS) return SLOT_HYPOTHESIS[lane - N_STEPS];
    const int64_t set = bank->grown[(lane - N_PLANNED) / PER_SET];
    return N_BEGUN + (set < 0 ? 0 : set);
}

/* The kind of fault of what a lane of the plan looks for, where that does not move. */
static inline int still_kind(int64_t slot)
{
    return SLOT_PARAMETER[slot] >= 0 ? KIND_STEP : SLOT_SCALES[slot] ? KIND_GAIN : KIND_BIAS;
}

/* Log-likelihood of the likeliest lane of what a lane of the plan looks for, had that changed at once. */
static double most_of_changes(const Bank *bank, int64_t slot)
{
    const int64_t hypothesis = SLOT_HYPOTHESIS[slot];
    double most = LOWEST;
    for (int64_t lane = 0; lane < RAMPED; lane++)
        if (SLOT_HYPOTHESIS[lane] == hypothesis && SLOT_KIND[lane] == still_kind(slot))
            most = fmax(most, finite_or_lowest(of_slot(bank, lane, WIDE_LIKELIHOOD)));
    if (hypothesis >= N_SETS) return most;
    for (int64_t lane = FIRST_LANE[hypothesis]; lane < FIRST_LANE[hypothesis + 1]; lane++)
        most = fmax(most, finite_or_lowest(of_step(bank, lane, PLAIN_LIKELIHOOD)));
    return most;
}

/* Whether what a lane with a slot has found does not move, as far as data tell: a rate that may as well be 0, or what came to
   stay within a few samples, or after a while but no likelier than at once. */
static int is_at_rest(const Bank *bank, int64_t lane)
{
    const int64_t slot = plan_of(bank, lane);
    const int rate = AT_SLOT + 1;
    const double speed = of_slot(bank, lane, rate), variance = of_slot(bank, lane, WIDE_PLACE(rate, rate));
    if (SLOT_KIND[slot] == KIND_DRIFT) return speed * speed < MOVES_SDS * MOVES_SDS * variance;
    if (SLOT_KIND[slot] != KIND_RAMP) return 0;
    if (of_slot(bank, lane, ROLE_TOOK) <= AT_ONCE * (SAMPLE_TIME > 0.0 ? SAMPLE_TIME : 0.0)) return 1;
    const double likelihood = finite_or_lowest(of_slot(bank, lane, WIDE_LIKELIHOOD));
    return likelihood < most_of_changes(bank, slot) + 0.5 * MOVES_SDS * MOVES_SDS;
}

/* The kind of fault of a lane. What moves is a step, of an instrument a bias or a wrong gain, as long as no more is known of it:
   drifts and ramps have these among them, and must not take from what is simpler. */
static int64_t kind_of(const Bank *bank, int64_t lane)
{
    if (lane < N_STEPS) return KIND_STEP;
    const int64_t slot = plan_of(bank, lane - N_STEPS);
    return is_at_rest(bank, lane - N_STEPS) ? still_kind(slot) : SLOT_KIND[slot];
}

/* The suspects of a lane, and how many. */
static int64_t suspects_of(const State *state, int64_t lane, Suspect *suspects)
{
    const Bank *bank = &state->bank;
    const int *members;
    if (lane >= N_STEPS) {
        const int64_t couple = couple_of(bank, lane - N_STEPS);
        slot_suspect(state, lane - N_STEPS, &suspects[0]);
        if (is_at_rest(bank, lane - N_STEPS)) { /* what it is told as has neither times nor a rate */
            suspects[0].began = suspects[0].ended = suspects[0].rate = suspects[0].rate_sd = NAN;
            suspects[0].n_forecasts = 0;
        }
        if (couple < 0) return 1;
        if (COUPLE_BESIDE[couple] >= 0) instrument_beside(bank, lane - N_STEPS, &suspects[1]);
        else parameter_suspect(bank, lane, COUPLE_PARAMETER[couple], &suspects[1]);
        return 2;
    }
    const int64_t n = members_of(hypothesis_of(bank, lane), &members);
    for (int64_t k = 0; k < n; k++) parameter_suspect(bank, lane, members[k], &suspects[k]);
    return n;
}

/* Whether what a lane looks for stays the same, as what has come to stay does; not of one that has a rate, whatever that is. */
static int is_constant(const Bank *bank, int64_t lane)
{
    const int64_t kind = kind_of(bank, lane);
    if (lane >= N_STEPS && SLOT_KIND[plan_of(bank, lane - N_STEPS)] == KIND_DRIFT) return 0;
    return kind == KIND_STEP || kind == KIND_BIAS || kind == KIND_GAIN || kind == KIND_RAMP;
}

/* Note what all lanes have found, where it is time to. */
static void note_values(State *state)
{
    Bank *bank = &state->bank;
    const Job *job = &state->job;
    const int64_t since = state->clock.index - job->settled, times = since / NOTED_FROM;
    if (job->kind != IDLE || job->renewals < N_RENEWALS || since < NOTED_FROM) return;
    if (since % NOTED_FROM != 0 || (times & (times - 1)) != 0) return;
    memcpy(bank->noted[0], bank->noted[1], sizeof bank->noted[0]);
    bank->noted_at[0] = bank->noted_at[1];
    bank->noted_at[1] = state->clock.index;
    for (int64_t lane = 0; lane < N_LANES; lane++) {
        Suspect suspects[LARGEST_SET];
        const int64_t n = suspects_of(state, lane, suspects);
        const int is_value = is_constant(bank, lane); /* of one that was none then, nothing is said later */
        for (int64_t k = 0; k < n; k++) {
            bank->noted[1][0][k][lane] = is_value ? suspects[k].estimate : NAN;
            bank->noted[1][1][k][lane] = is_value ? suspects[k].sd : NAN;
        }
    }
}

/* Whether what a lane was when it was noted is what it is now: of what came to stay, if it had stopped by then. */
static int was_there(const State *state, int64_t lane)
{
    const double ago = SAMPLE_TIME * (double)(state->clock.index - state->bank.noted_at[0]);
    if (lane < N_STEPS || SLOT_KIND[plan_of(&state->bank, lane - N_STEPS)] != KIND_RAMP) return 1;
    return of_slot(&state->bank, lane - N_STEPS, ROLE_ENDED) < state->clock.time - ago;
}

/* Judge suspect k of a lane, as far as likelihoods count: its value is as uncertain as that (see `share_of_evidence`), and where
   it moved too far since it was noted, as uncertain as it moved, too. */
static void judge_value(const State *state, int64_t lane, int64_t k, Suspect *suspect)
{
    const Bank *bank = &state->bank;
    const double left = suspect->sd * suspect->sd, share = share_of_evidence(state);
    suspect->sd = sqrt(left / share);
    suspect->rate_sd = sqrt(suspect->rate_sd * suspect->rate_sd / share);
    if (bank->noted_at[0] == 0 || !is_constant(bank, lane) || !was_there(state, lane)) return;
    const double moved = suspect->estimate - bank->noted[0][0][k][lane], before = bank->noted[0][1][k][lane];
    const double shrunk = before * before - left;
    const double usual = suspect->parameter >= 0 ? usual_walk(&state->healthy, WALKS - 1, (int)suspect->parameter) : 1.0;
    const double far = fabs(moved) / sqrt(fmax(shrunk, WALK_LEAST * left) * fmax(usual, 1.0));
    if (!(far > STILL)) return;
    suspect->moved = far;
    suspect->sd = sqrt(left / share + moved * moved);
}

/* The suspects of a lane, each as far as likelihoods count, and how many. */
static int64_t judged_suspects(const State *state, int64_t lane, Suspect *suspects)
{
    const int64_t n = suspects_of(state, lane, suspects);
    for (int64_t k = 0; k < n; k++) judge_value(state, lane, k, &suspects[k]);
    return n;
}

FB_OFTEN

#endif
