/* Couples: a fault with a slot, and a parameter that changed or an instrument that is off beside it, as a sensor that is off and a valve that sticks, or a
   pipe that fouls and a pump that lost head at once.

   A lane with a slot has all parameters too, each with its narrow prior. So the closed form of growing.h holds for it: what it
   would gain if one of them were a suspect as well. That tells which couples with an instrument are tested, MOST_MIXED of
   them, at the times at which sets of the reserve are chosen anew. Of drifts beside a step those are tested whose parameters
   explain most as steps: so they first look. A lane of a couple has the slot of a lane of the plan, its `base`, and a wide
   start of the parameter. Not the kinds that scatter or come and go.

   Lanes of a couple: the likeliest base; the likeliest base of another kind of fault, since a sensor that reads too much may
   look stuck while nothing moves, or where there is none the first again, with the parameter at its healthy value; and of a
   store, with its content going on, each of both in turn: without its jump the likeliest base may be one that follows the jump,
   as a drift does. Of what is no store the third has a kind that none of the others has, at each renewal the next one: a base
   says how well it explains the data while the parameter is healthy, and a wrong gain may say least of all where it is true. A
   lane that is begun again keeps what is likelier. Formulas: docs/method.md, "The bank". */
#ifndef FB_COUPLES_H
#define FB_COUPLES_H

#include "growing.h"
#include "slots.h"

enum { LIKELIEST, SECOND, THIRD };

/* A couple that may be tested: its likelihood by the closed form, by steps, or by its lanes, its cost taken off; the likeliest
   base and another one (-1: none), what these say, and where the parameter begins. */
typedef struct {
    int64_t couple, row, base[2];
    double score, said[2], value[2];
} Match;

/* Lane of a row, and the row of a lane, of couples. */
static inline int64_t lane_of_couple(int64_t row, int64_t part) { return part * N_COUPLED + row; }
static inline int64_t row_of_lane(int64_t lane) { return lane % FB_ROOM(N_COUPLED); }
static inline int64_t part_of_lane(int64_t lane) { return lane / FB_ROOM(N_COUPLED); }

/* The couple that a lane is of; -1: it is one of the plan, or none has it. The lane of the plan whose slot it has. */
static inline int64_t couple_of(const Bank *bank, int64_t lane)
{
    return lane < N_SLOT_LANES ? -1 : bank->coupled[row_of_lane(lane - N_SLOT_LANES)];
}

static inline int64_t plan_of(const Bank *bank, int64_t lane)
{
    if (lane < N_SLOT_LANES) return lane;
    return bank->base[lane - N_SLOT_LANES] < 0 ? 0 : bank->base[lane - N_SLOT_LANES];
}

/* The lane of the plan whose bias is beside a slot in a lane of couples: the narrowest of the other instrument; -1: it is a
   parameter. */
static int64_t beside_of(const Bank *bank, int64_t lane, int64_t slot)
{
    const int64_t couple = bank->coupled[row_of_lane(lane)];
    if (couple < 0 || COUPLE_BESIDE[couple] < 0) return -1;
    const int64_t other = SLOT_HYPOTHESIS[slot] == COUPLE_SLOT[couple] ? COUPLE_BESIDE[couple] : COUPLE_SLOT[couple];
    for (int64_t k = 0; k < SWITCHED; k++)
        if (SLOT_HYPOTHESIS[k] == other && SLOT_KIND[k] == KIND_BIAS) return k;
    return -1;
}

/* The prior weight of a lane of couples with this slot. */
static double weight_of_couple(const Bank *bank, int64_t lane, int64_t slot)
{
    const int64_t beside = beside_of(bank, lane, slot);
    return SLOT_WEIGHT[slot] + (beside < 0 ? 0.0 : SLOT_WEIGHT[beside]);
}

/* The parameter beside the slot of a lane of couples; -1: it is an instrument. */
static inline int parameter_of(const Bank *bank, int64_t lane) { return COUPLE_PARAMETER[bank->coupled[row_of_lane(lane)]]; }

/* Whether a parameter is one of a store, whose content may go on where it changes. */
static int is_of_store(int index)
{
    for (int64_t e = 0; e < JUMP_ROW[N_STATES]; e++)
        if (JUMP_PARAMETER[e] == index && HEALTHY[index] != 0.0) return 1;
    return 0;
}

FB_SELDOM

/* What lane k of the plan would say with one more suspect, and where that begins: where the closed form has it, which is exact
   for a linear plant; at its healthy value where it would have it beyond what it can be. old: see `Trail`, or NULL. */
static double said_with(Bank *bank, int64_t k, int index, const double *old, double *value)
{
    const int64_t place = AT_PARAMETERS + index;
    const double mean = SLOT_OLD[k] && old ? old[place] : bank->healthy[place], moved = bank->healthy[place] - mean;
    const double variance = bank->healthy[PLAIN_PLACE(place, place)] + moved * moved; /* as of `doubted` */
    double change;
    const double gain = gain_from(mean, variance, of_slot(bank, k, place), of_slot(bank, k, WIDE_PLACE(place, place)), index, &change);
    *value = mean + change;
    if (!(*value > RANGE_LEAST[index] && *value < RANGE_MOST[index])) *value = bank->healthy[place];
    return likelihood_of_slot(bank, k) + SLOT_WEIGHT[k] + gain;
}

/* The best two bases of a couple; with an instrument, of two kinds of fault. */
static void find_bases_of(Bank *bank, const double *old, Match *match)
{
    match->base[0] = match->base[1] = -1;
    match->said[0] = match->said[1] = -INFINITY;
    for (int64_t k = 0; k < SWITCHED; k++) {
        double value;
        if (SLOT_HYPOTHESIS[k] != COUPLE_SLOT[match->couple]) continue;
        if (!is_for_couples(k)) continue;
        const double said = said_with(bank, k, COUPLE_PARAMETER[match->couple], old, &value);
        const int alike = match->couple < N_MIXED && match->base[0] >= 0 && SLOT_KIND[match->base[0]] == SLOT_KIND[k];
        const int first = said > match->said[0];
        if (!first && (alike || !(said > match->said[1]))) continue;
        if (first && !alike) {
            match->base[1] = match->base[0];
            match->said[1] = match->said[0];
            match->value[1] = match->value[0];
        }
        match->base[!first] = k;
        match->said[!first] = said;
        match->value[!first] = value;
    }
}

/* Let one of the two bases be a wrong gain, of an input that acts with one parameter alone: see `share_products`
   in ranking.h. */
static void include_gain(Bank *bank, const double *old, Match *match)
{
    if (match->couple >= N_MIXED || COUPLE_ALIKE[match->couple] < 0 || match->base[0] < 0 || SLOT_KIND[match->base[0]] == KIND_GAIN) return;
    if (match->base[1] >= 0 && SLOT_KIND[match->base[1]] == KIND_GAIN) return;
    for (int64_t k = 0; k < SWITCHED; k++) {
        if (SLOT_HYPOTHESIS[k] != COUPLE_SLOT[match->couple] || SLOT_KIND[k] != KIND_GAIN) continue;
        match->base[1] = k;
        match->said[1] = said_with(bank, k, COUPLE_PARAMETER[match->couple], old, &match->value[1]);
    }
}

/* Likelihood of a lane of a couple with the weight of its slot; -inf: it has not begun, or says nothing. */
static double said_by_couple(Bank *bank, int64_t lane)
{
    const double likelihood = bank->base[lane] < 0 ? -INFINITY : likelihood_of_slot(bank, N_SLOT_LANES + lane);
    return isfinite(likelihood) ? likelihood + weight_of_couple(bank, lane, bank->base[lane]) : -INFINITY;
}

/* The likeliest lane of a row. */
static int64_t likeliest_of_couple(Bank *bank, int64_t row)
{
    int64_t best = lane_of_couple(row, 0);
    for (int64_t part = 1; part < PER_COUPLE; part++)
        if (said_by_couple(bank, lane_of_couple(row, part)) > said_by_couple(bank, best)) best = lane_of_couple(row, part);
    return best;
}

/* The row of a couple that has lanes which say something; -1: none. */
static int64_t row_of_couple(Bank *bank, int64_t couple)
{
    for (int64_t row = 0; row < N_COUPLED; row++)
        if (bank->coupled[row] == couple && said_by_couple(bank, likeliest_of_couple(bank, row)) > -INFINITY) return row;
    return -1;
}

/* The likeliest lane of steps of both parameters, of a drift beside a step; -1: none is tested. */
static int64_t lane_of_steps(Bank *bank, int64_t couple)
{
    const int64_t set = COUPLE_HYPOTHESIS[couple];
    if (set < N_SETS) return likeliest_lane(bank, set);
    const int64_t row = set < N_BEGUN + N_RESERVE ? row_of_set(bank, set - N_BEGUN) : -1;
    return row < 0 ? -1 : likeliest_of_row(bank, row);
}

/* Let a drift beside a step count by what both say as steps, if that is more, and the step begin where these are. */
static void match_steps(Bank *bank, Match *match)
{
    const int64_t lane = lane_of_steps(bank, match->couple);
    if (lane < 0 || match->base[0] < 0 || !(likelihood_or_none(bank, lane) > match->said[0])) return;
    match->said[0] = likelihood_or_none(bank, lane);
    match->value[0] = match->value[1] = *number_of_step(bank, lane, AT_PARAMETERS + COUPLE_PARAMETER[match->couple]);
}

/* The set of a parameter alone; -1: it is not tested. */
static int64_t single_of(int index)
{
    for (int64_t set = 0; set < N_SETS; set++)
        if (SET_ROW[set + 1] - SET_ROW[set] == 1 && SET_MEMBER[SET_ROW[set]] == index) return set;
    return -1;
}

/* The likeliest lane of an instrument which does not move: a bias, or (`other`) another kind; -1: none. */
static int64_t still_slot(Bank *bank, int64_t instrument, int other)
{
    int64_t best = -1;
    for (int64_t k = 0; k < RAMPED; k++) {
        const int kind = SLOT_KIND[k], fits = other ? kind == KIND_STUCK || kind == KIND_GAIN : kind == KIND_BIAS;
        if (SLOT_HYPOTHESIS[k] != instrument || !fits) continue;
        if (best < 0 || likelihood_of_slot(bank, k) + SLOT_WEIGHT[k] > likelihood_of_slot(bank, best) + SLOT_WEIGHT[best]) best = k;
    }
    return best;
}

/* Let a couple of a sensor count by what the best step of the parameter alone says, and what that leaves to explain at the sensor,
   if that is more; then the sensor is off beside the parameter where that step has it. A sensor that is off by itself, beside a load
   that is heavier, has made of it what the closed form does not undo. */
static void match_single(Bank *bank, int64_t index, Match *match)
{
    const int64_t set = single_of(COUPLE_PARAMETER[match->couple]), instrument = COUPLE_SLOT[match->couple];
    const int64_t lane = set < 0 ? -1 : likeliest_lane(bank, set), slot = still_slot(bank, instrument, 0);
    if (lane < 0 || slot < 0 || SLOT_OUTPUT[slot] < 0 || match->base[0] < 0) return;
    const double said = likelihood_or_none(bank, lane) + SLOT_WEIGHT[slot] + left_at(bank, lane, SLOT_OUTPUT[slot], 0.0, index);
    if (!(said > match->said[0])) return;
    match->said[0] = said;
    match->base[1] = slot; /* the second lane begins where the step does */
    match->value[1] = *number_of_step(bank, lane, AT_PARAMETERS + COUPLE_PARAMETER[match->couple]);
}

/* What two instruments would say: the likeliest of either, and what that leaves to explain at the other. */
static void match_instruments(Bank *bank, int64_t index, Match *match)
{
    const int64_t both[2] = {COUPLE_SLOT[match->couple], COUPLE_BESIDE[match->couple]};
    match->base[0] = match->base[1] = -1;
    match->said[0] = -INFINITY;
    for (int one = 0; one < 2; one++) {
        const int64_t other = still_slot(bank, both[!one], 0);
        for (int kind = 0; kind < 2; kind++) {
            const int64_t lane = still_slot(bank, both[one], kind);
            if (lane < 0 || other < 0) continue;
            const double said = likelihood_of_slot(bank, lane) + SLOT_WEIGHT[lane] + SLOT_WEIGHT[other] +
                                left_at(bank, N_STEPS + lane, SLOT_OUTPUT[other], 0.0, index);
            if (said > match->said[0]) match->said[0] = said;
        }
    }
}

/* What is said of a couple, costs taken off; of one that is rejected -inf. */
static Match match_of(Bank *bank, int64_t couple, const double *old, int64_t index)
{
    Match match = {couple, row_of_couple(bank, couple), {-1, -1}, -INFINITY, {0.0, 0.0}, {0.0, 0.0}};
    if (bank->rejected[COUPLE_HYPOTHESIS[couple]]) return match;
    if (COUPLE_BESIDE[couple] >= 0) match_instruments(bank, index, &match);
    else find_bases_of(bank, old, &match);
    include_gain(bank, old, &match);
    if (couple < N_MIXED) match_single(bank, index, &match);
    match_steps(bank, &match);
    match.score = match.row < 0 ? match.said[0] : said_by_couple(bank, likeliest_of_couple(bank, match.row));
    match.score -= COST[COUPLE_HYPOTHESIS[couple]];
    return match;
}

/* Whether a couple is among the first that are chosen, so many. */
static int is_chosen(const Match *chosen, int64_t n, int64_t couple)
{
    for (int64_t k = 0; k < n; k++)
        if (chosen[k].couple == couple) return 1;
    return 0;
}

/* Add the likeliest of some couples, up to `most`, to those that are chosen, `had`, but for these; gives how many there are
   then. */
static int64_t match_couples(Bank *bank, int64_t first, int64_t end, int64_t most, const double *old, int64_t index, int64_t had,
                             Match *chosen)
{
    int64_t n = had;
    for (int64_t couple = first; couple < end; couple++) {
        if (is_chosen(chosen, had, couple)) continue;
        const Match match = match_of(bank, couple, old, index);
        if (!(match.score > -INFINITY)) continue;
        int64_t at = n;
        while (at > had && match.score > chosen[at - 1].score) at--;
        if (at == had + most) continue;
        if (n < had + most) n++;
        for (int64_t k = n - 1; k > at; k--) chosen[k] = chosen[k - 1];
        chosen[at] = match;
    }
    return n;
}

/* Add to the couples of two instruments, n, those that are the same but for a parameter in the place of an input with which alone
   it acts: what is tested of the one says as much of the other, see `share_products`. Gives how many are chosen then. */
static int64_t match_alike(Bank *bank, const double *old, int64_t index, int64_t n, Match *chosen)
{
    const int64_t end = n;
    for (int64_t k = 0; k < end; k++) {
        const int64_t couple = COUPLE_ALIKE[chosen[k].couple] - FIRST_MIXED;
        if (couple < 0 || couple >= N_MIXED || n == end + MOST_MIXED || is_chosen(chosen, n, couple)) continue;
        chosen[n] = match_of(bank, couple, old, index);
        if (chosen[n].score > -INFINITY) n++;
    }
    return n;
}

/* Let the third lane of a couple with an instrument begin with the likeliest base of a kind that neither of the first two is of;
   with the next such kind at each later renewal, and where there is none any more with the last one again. */
static void plan_further(Bank *bank, const Match *match, const double *old, Job *job)
{
    const int64_t first = job->bases[lane_of_couple(match->row, LIKELIEST)], second = job->bases[lane_of_couple(match->row, SECOND)];
    const int64_t third = lane_of_couple(match->row, THIRD);
    int64_t had = (int64_t)1 << SLOT_KIND[first] | (int64_t)1 << SLOT_KIND[second];
    for (int64_t turn = 0; match->couple < N_MIXED && turn < job->renewals; turn++) {
        double most = -INFINITY;
        for (int64_t k = 0; k < SWITCHED; k++) {
            double value;
            if (SLOT_HYPOTHESIS[k] != COUPLE_SLOT[match->couple] || !is_for_couples(k) || (had >> SLOT_KIND[k] & 1) != 0) continue;
            const double said = said_with(bank, k, COUPLE_PARAMETER[match->couple], old, &value);
            if (!(said > most)) continue;
            most = said;
            job->bases[third] = k;
            job->values[third] = value;
        }
        if (!(most > -INFINITY)) return;
        had |= (int64_t)1 << SLOT_KIND[job->bases[third]];
    }
}

/* Say what lanes of a couple begin: of one that has lanes, the likeliest from what it has found, where it is, and another kind
   in the place of the other. */
static void plan_match(Bank *bank, const Match *match, const double *old, Job *job)
{
    const int64_t best = likeliest_of_couple(bank, match->row), own = bank->base[best], part = part_of_lane(best);
    const int place = AT_PARAMETERS + COUPLE_PARAMETER[match->couple];
    const int64_t base = own < 0 ? match->base[0] : own;
    const double value = own < 0 ? match->value[0] : of_slot(bank, N_SLOT_LANES + best, place);
    const int other = match->base[0] >= 0 && match->base[0] != base && SLOT_KIND[match->base[0]] != SLOT_KIND[base] ? 0 : 1;
    const int is_alone = match->base[other] < 0 || match->base[other] == base;
    for (int64_t k = LIKELIEST; k <= SECOND; k++) {
        const int64_t lane = lane_of_couple(match->row, k);
        const int is_first = own < 0 || part == THIRD ? k == LIKELIEST : k == part;
        job->bases[lane] = is_first || is_alone ? base : match->base[other];
        job->values[lane] = is_first ? value : is_alone ? bank->healthy[place] : match->value[other];
    }
    if (!is_of_store(COUPLE_PARAMETER[match->couple])) {
        plan_further(bank, match, old, job);
        return;
    }
    job->bases[lane_of_couple(match->row, THIRD)] = job->renewals % 2 == 0 && !is_alone ? match->base[other] : base;
    job->values[lane_of_couple(match->row, THIRD)] = value;
}

/* Say the same of two instruments: both are off; the one is stuck or has a wrong gain, and the other is off; the other way
   round. */
static void plan_instruments(Bank *bank, const Match *match, Job *job)
{
    const int64_t one = COUPLE_SLOT[match->couple], two = COUPLE_BESIDE[match->couple];
    job->bases[lane_of_couple(match->row, 0)] = still_slot(bank, one, 0);
    job->bases[lane_of_couple(match->row, 1)] = still_slot(bank, one, 1);
    job->bases[lane_of_couple(match->row, 2)] = still_slot(bank, two, 1);
}

/* Let lanes of couples that have not begun, and those that fill up the last block, repeat one that has. */
static void fill_up_couples(Bank *bank)
{
    for (int64_t first = 0; first < N_COUPLE_LANES; first += GROUP) {
        double (*block)[GROUP] = bank->couples[first / GROUP];
        int64_t one = -1;
        for (int64_t l = 0; l < GROUP && first + l < N_COUPLE_LANES && one < 0; l++)
            if (bank->base[first + l] >= 0) one = l;
        for (int64_t l = 0; l < GROUP && one >= 0; l++)
            if (first + l >= N_COUPLE_LANES || bank->base[first + l] < 0)
                for (int64_t i = 0; i < WIDE_NUMBERS; i++) block[i][l] = block[i][one];
    }
}

/* Choose the couples that are tested from now on, and what begins. Those that are tested already keep their lanes. */
static void choose_couples(Bank *bank, const double *old, int64_t index, Job *job)
{
    Match chosen[FB_ROOM(N_COUPLED)];
    const int64_t drifting = N_MIXED + N_BOTH, most = N_COUPLED - MOST_MIXED - MOST_BOTH;
    int64_t n = match_couples(bank, N_MIXED, drifting, MOST_BOTH, old, index, 0, chosen);
    const int64_t room = n + MOST_MIXED;
    n = match_alike(bank, old, index, n, chosen);
    n = match_couples(bank, 0, N_MIXED, room - n, old, index, n, chosen);
    n = match_couples(bank, drifting, N_COUPLES, most, old, index, n, chosen);
    for (int64_t lane = 0; lane < N_COUPLE_LANES; lane++) job->bases[lane] = -1;
    for (int64_t row = 0; row < N_COUPLED; row++) {
        int is_kept = 0;
        for (int64_t k = 0; k < n; k++) is_kept |= chosen[k].row == row;
        if (is_kept) continue;
        bank->coupled[row] = -1;
        for (int64_t part = 0; part < PER_COUPLE; part++) bank->base[lane_of_couple(row, part)] = -1;
    }
    for (int64_t k = 0; k < n; k++) {
        for (int64_t row = 0; chosen[k].row < 0 && row < N_COUPLED; row++)
            if (bank->coupled[row] < 0) chosen[k].row = row;
        bank->coupled[chosen[k].row] = chosen[k].couple;
        if (COUPLE_BESIDE[chosen[k].couple] >= 0) plan_instruments(bank, &chosen[k], job);
        else plan_match(bank, &chosen[k], old, job);
    }
    fill_up_couples(bank);
}

/* List the lanes of a group that begin; others repeat the first of these. Gives how many do. */
static int64_t list_couples(int64_t first, Job *job)
{
    int64_t n = 0, one = -1;
    for (int64_t lane = first; lane < first + GROUP && lane < N_COUPLE_LANES; lane++) {
        if (job->bases[lane] < 0) continue;
        if (one < 0) one = lane;
        n++;
    }
    for (int64_t l = 0; l < GROUP && n > 0; l++)
        job->lane[l] = first + l < N_COUPLE_LANES && job->bases[first + l] >= 0 ? first + l : one;
    return n;
}

/* The onset at which the best step of a single parameter began; where that is not tested, another one. */
static int64_t onset_of_single(Bank *bank, int index, int64_t other)
{
    const int64_t set = single_of(index);
    return set < 0 ? other : bank->onset[likeliest_lane(bank, set)];
}

/* Note from which onsets the lanes of a group begin, near those of the slot or of the parameter by itself, and what the slots
   that begin again have found, as it was `elapsed` seconds ago. */
static void note_couples(Bank *bank, double elapsed, Job *job)
{
    for (int64_t l = 0; l < GROUP; l++) {
        const int64_t lane = job->lane[l], base = job->bases[lane];
        const int64_t from = bank->base[lane] == base ? N_SLOT_LANES + lane : base;
        job->begins[l] = bank->onset[N_STEPS + from];
        if (part_of_lane(lane) != LIKELIEST) job->begins[l] = onset_of_single(bank, parameter_of(bank, lane), job->begins[l]);
        const double rate = beside_of(bank, lane, base) < 0 ? of_slot(bank, from, AT_SLOT + 1) : 0.0;
        note_slot(base, of_slot(bank, from, AT_SLOT), rate, elapsed, job->found[l]);
    }
}

/* Whether the parameter of a lane begins at its healthy value: a second lane with the base of the first, and where nothing
   tells another value. */
static int is_neutral(const Bank *bank, const Job *job, int64_t lane)
{
    return parameter_of(bank, lane) >= 0 && job->values[lane] == bank->healthy[AT_PARAMETERS + parameter_of(bank, lane)];
}

/* Whether a lane begins again with the slot that it has. */
static int is_again(const Bank *bank, const Job *job, int64_t lane) { return bank->base[lane] == job->bases[lane]; }

/* Let the parameter of a lane be a suspect in a plain lane; healthy: that to which starts are relative. */
static void suspect_too(const Bank *bank, const Job *job, int64_t lane, int all_along, const double *healthy, double *plain, double *to)
{
    Start start;
    start.n = 1;
    start.parameter[0] = parameter_of(bank, lane);
    start.tied = is_again(bank, job, lane);
    start.all_along = all_along;
    start_about(start.parameter[0], job->values[lane], is_neutral(bank, job, lane) ? FROM_HEALTHY : AS_FOUND, healthy,
                &start.value[0], &start.sd[0]);
    for (int i = 0; i < N_STATES; i++) {
        start.jumps[i] = 0;
        for (int e = JUMP_ROW[i]; part_of_lane(lane) == THIRD && e < JUMP_ROW[i + 1]; e++)
            start.jumps[i] |= JUMP_PARAMETER[e] == start.parameter[0];
    }
    suspect_lane(&start, plain, to);
}

/* Fill the group with its lanes as they begin from a healthy lane, having seen the samples before an onset. */
static void fill_couples(const Bank *bank, const Trail *trail, int64_t onset, const double *healthy, Job *job, StepMemory *steps,
                         SlotMemory *memory)
{
    SlotStart *start = &memory->start;
    double elapsed = 0.0, *old = steps->later, *plain = steps->lane; /* elapsed: to the end of the trail */
    for (int64_t place = onset; place < trail->n; place++) elapsed += sample_at(trail, place)[SAMPLE_DT];
    prepare_slots(trail, healthy, onset, NULL, memory);
    start->all_along = trail->all_along;
    if (trail->old) doubted(start->healthy, trail->old, old);
    else memcpy(old, start->healthy, sizeof start->healthy);
    for (int l = 0; l < GROUP; l++) {
        const int64_t lane = job->lane[l], base = job->bases[lane];
        const int64_t beside = beside_of(bank, lane, base);
        double *from = SLOT_OLD[base] ? old : start->healthy;
        if (beside < 0) suspect_too(bank, job, lane, start->all_along, start->healthy, from, plain);
        else memcpy(plain, from, sizeof start->healthy);
        widen(plain, SLOT_OLD[base] ? start->old : start->wide);
        const int from_found = is_of_found(base) && is_again(bank, job, lane);
        begin_slot(from_found && SLOT_KIND[base] == KIND_BIAS ? widest_slot(base) : base, trail, job->peak, start, job->run, l);
        if (from_found) begin_at_found(base, job->found[l], elapsed, job->run, l);
        if (beside >= 0) begin_beside(beside, job->peak, job->run, l);
        if (start->all_along) go_along(base, trail, onset, job->run, l);
    }
}

/* Begin a group of lanes of couples at an onset: they stand at that sample, and have not taken it. As with steps (`begin_lanes`) both
   faults came at some moment since the sample before; a sensor's fault is in the very next reading, a component's in its effects. */
static void begin_couples(const Bank *bank, const Trail *trail, int64_t onset, const Normal *normal, Job *job, StepMemory *steps,
                          SlotMemory *memory, Filters *filters)
{
    double early[FB_ROOM(N_STATES)][GROUP], *sample = memory->sample, *healthy = steps->healthy;
    memset(&job->walk, 0, sizeof job->walk);
    bank_sample(sample_at(trail, onset), sample);
    for (int64_t j = 0; j < N_OUTPUTS; j++) sample[SAMPLE_USE + j] = 0.0;
    fill_couples(bank, trail, onset, before_onset(trail, onset), job, steps, memory);
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) filters->wide.lane[i] = load(job->run[i] + part);
        step_wide(filters->wide.lane, sample, normal, &filters->wide);
        for (int64_t i = 0; i < N_STATES; i++) store(early[i] + part, filters->wide.lane[i]);
    }
    memcpy(healthy, before_onset(trail, onset), sizeof steps->healthy);
    advance_one(healthy, sample, normal, NULL, &filters->plain);
    fill_couples(bank, trail, onset, healthy, job, steps, memory);
    stand_between(early, WIDE_JOINT, job->run);
}

/* Put lane l of a group into the bank, if it is likelier than what is there; gives the lane of the bank, -1: it is not. */
static int64_t put_couple(Bank *bank, Job *job, int64_t l)
{
    const int64_t lane = job->lane[l], base = job->bases[lane];
    const double said = job->run[WIDE_LIKELIHOOD][l] + weight_of_couple(bank, lane, base);
    if (!isfinite(said) || !(said > said_by_couple(bank, lane))) return -1;
    put_slot(bank, N_SLOT_LANES + lane, job->run, l);
    bank->base[lane] = base;
    return N_SLOT_LANES + lane;
}

FB_OFTEN

/* Whether any lane of a block has begun. */
static int any_couple(const Bank *bank, int64_t block)
{
    for (int64_t lane = block * GROUP; lane < N_COUPLE_LANES && lane < (block + 1) * GROUP; lane++)
        if (bank->base[lane] >= 0) return 1;
    return 0;
}

/* Take one more packed sample into the lanes of couples; innovations: as of `advance_slots`, 0 and 1 of those that have not
   begun, or rest. */
static void advance_couples(Bank *bank, const double *packed, const Normal *normal, double *innovations, int64_t stride,
                            Filter_wide *filter, SlotMemory *memory)
{
    bank_sample(packed, memory->sample);
    put_none(0, N_COUPLE_LANES, innovations, stride);
    for (int64_t first = 0; first < N_COUPLE_LANES; first += FB_LANES) {
        double (*block)[GROUP] = bank->couples[first / GROUP];
        if (bank->rests[FIRST_COUPLES + first / GROUP] || !any_couple(bank, first / GROUP)) continue;
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) filter->lane[i] = load(block[i] + first % GROUP);
        step_wide(filter->lane, memory->sample, normal, filter);
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) store(block[i] + first % GROUP, filter->lane[i]);
        put_innovations(filter->innovations, first, 1, in_block(first, N_COUPLE_LANES), innovations, stride);
    }
}

#endif
