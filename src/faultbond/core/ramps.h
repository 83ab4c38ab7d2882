/* Faults that move on for a while and then stay: a valve that closes in a minute, a sensor that has drifted away.

   What moves is a drift. Each hypothesis with one has a lane for what has come to stay, too, which begins with the first of
   its drifts. Before each sample the likeliest drift hands on to it what it knows, as likely as it is to end now, less its
   rate; nothing goes back. A ramp may take seconds or hours: after n samples it ends with a probability that falls as 1 / n,
   so that all lengths of it are alike, in logarithm.
   With the renewals the pairs of the likeliest suspects begin again: at the alarm little was seen of what moves, so the onset that
   was best then is often wrong, and a drift from a wrong onset has another rate and hands on what does not fit.
   Source: as of slots.h, with modes that only go one way. Formulas: docs/method.md, "The bank". */
#ifndef FB_RAMPS_H
#define FB_RAMPS_H

#include "slots.h"
#include "steps.h"

#define ENDING 0.5       /* probability that a ramp ends at a sample, in one over the samples that it has taken, */
#define ENDS_EARLY 10.0 /* and so many more */
#define MOVING_SDS 2.0   /* of its sd a rate is half sure to be one */
#define LONGEST_RAMP 1e9 /* s */
#define HALF_AT_ONCE 2.0 /* times as long as it was there: what would have taken longer was there by half at once */
#define N_RAMPS ((SWITCHED - RAMPED) / 2)

/* The drift of a pair, and what has come to stay. */
static inline int64_t drift_of(int64_t pair) { return RAMPED + 2 * pair; }
static inline int64_t stay_of(int64_t pair) { return RAMPED + 2 * pair + 1; }

/* Probability that a ramp ends after so many samples. What is not known to move cannot come to its end: that would be a
   step. Nor can what moves back, since it has not come to its size so. */
static double ends_now(int64_t age, double size, double rate, double variance)
{
    if (!(size * rate > 0.0)) return 1e-300;
    const double sure = rate * rate / (rate * rate + MOVING_SDS * MOVING_SDS * variance);
    return sure > 0.0 ? sure * ENDING / ((double)(age > 0 ? age : 0) + ENDS_EARLY) : 1e-300;
}

/* The longest that what began so many samples ago can have taken, s. A drift begins with any size: after a change at once that
   settles a little it has a small rate, at which all of it would have taken hours, since long before the fault. */
static inline double longest_ramp(int64_t age)
{
    return SAMPLE_TIME > 0.0 ? HALF_AT_ONCE * SAMPLE_TIME * (double)age : LONGEST_RAMP;
}

/* Let what moves end at a moment, s, in the pairs of the memory; what was there by half at once took no time. age: samples since
   each began; longest: that each can have taken, s; extra: weight, in logarithm, that what moves has beside what stays. */
static void end_ramps(const int64_t *age, const double *longest, const double *extra, double time, SlotMemory *memory)
{
    const int size = AT_SLOT, rate = AT_SLOT + 1;
    double sizes[FB_LANES], rates[FB_LANES], variances[FB_LANES];
    lanes *gone = memory->gone;
    Exchange by;
    store(sizes, memory->there[size]);
    store(rates, memory->there[rate]);
    store(variances, memory->there[WIDE_PLACE(rate, rate)]);
    for (int l = 0; l < FB_LANES; l++) {
        const double ends = ends_now(age[l], sizes[l], rates[l], variances[l]), took = sizes[l] / rates[l];
        by.there_stays[l] = log1p(-ends);
        by.there_comes[l] = -INFINITY;
        by.gone_stays[l] = 0.0;
        by.gone_comes[l] = log(ends) + extra[l];
        sizes[l] = took > 0.0 && took < longest[l] ? took : 0.0;
    }
    mix_modes(&by, memory);
    gone[ROLE_ENDED] = blend(memory->kept[1], gone[ROLE_ENDED], broadcast(time));
    gone[ROLE_TOOK] = blend(memory->kept[1], gone[ROLE_TOOK], load(sizes));
    gone[rate] = broadcast(0.0);
    for (int i = 0; i < WIDE_JOINT; i++) gone[i < rate ? WIDE_PLACE(i, rate) : WIDE_PLACE(rate, i)] = broadcast(0.0);
}

FB_SELDOM

/* Begin a group of pairs at an onset: they move. drift: the first lane of each. */
static void begin_ramps(const int64_t *drift, const Trail *trail, int64_t onset, const double *peak, double (*moves)[GROUP],
                        double (*stays)[GROUP], SlotMemory *memory)
{
    prepare_slots(trail, before_onset(trail, onset), onset, trail->old, memory);
    for (int l = 0; l < GROUP; l++) {
        begin_slot(drift[l], trail, peak, &memory->start, moves, l);
        begin_slot(drift[l] + 1, trail, peak, &memory->start, stays, l);
        stays[WIDE_LIKELIHOOD][l] = LOWEST; /* none has ended yet */
    }
}

FB_OFTEN

/* Take samples of the trail, or after it, from one place up to another into a group of pairs. onset: sample at which each
   began. */
static void run_ramps(double (*moves)[GROUP], double (*stays)[GROUP], const Trail *trail, int64_t from, int64_t end,
                      const int64_t *onset, const Normal *normal, Filter_wide *filter, SlotMemory *memory)
{
    static const double none[FB_LANES] = {0.0};
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            memory->there[i] = load(moves[i] + part);
            memory->gone[i] = load(stays[i] + part);
        }
        for (int64_t place = from; place < end; place++) {
            int64_t age[FB_LANES];
            double longest[FB_LANES];
            for (int l = 0; l < FB_LANES; l++) {
                age[l] = trail->oldest + place - onset[part + l];
                longest[l] = longest_ramp(age[l]);
            }
            if (!IS_OUTSIDE(sample_at(trail, place)))
                end_ramps(age, longest, none, trail->past->rows[(trail->oldest + place) % N_ROWS].time, memory);
            step_both(sample_at(trail, place), normal, filter, memory);
        }
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            store(moves[i] + part, memory->there[i]);
            store(stays[i] + part, memory->gone[i]);
        }
    }
}

FB_SELDOM

/* Log-likelihoods of a group of pairs, both their lanes together. */
static void join_ramps(double (*moves)[GROUP], double (*stays)[GROUP], double *both)
{
    for (int l = 0; l < GROUP; l++)
        both[l] = log_add(finite_or_lowest(moves[WIDE_LIKELIHOOD][l]), finite_or_lowest(stays[WIDE_LIKELIHOOD][l]));
}

/* Let lane l of a group of pairs take the place of one, `drift`, if it is likelier, both its lanes together. */
static int replace_pair(Bank *bank, int64_t drift, double (*moves)[GROUP], double (*stays)[GROUP], int64_t l)
{
    const double moving = finite_or_lowest(likelihood_of_slot(bank, drift));
    const double ended = finite_or_lowest(likelihood_of_slot(bank, drift + 1));
    double again[GROUP];
    join_ramps(moves, stays, again);
    if (!(again[l] > log_add(moving, ended))) return 0;
    put_slot(bank, drift, moves, l);
    put_slot(bank, drift + 1, stays, l);
    return 1;
}

/* The likeliest lane of the suspect of a pair, of a parameter its steps too; steps come first; of an instrument one of a wrong
   gain where the pair is. One that sticks does not count: it may lead for a while, and where it begins tells nothing of what
   moves. */
static int64_t likeliest_beside(Bank *bank, int64_t pair, double *likelihood)
{
    const int64_t hypothesis = SLOT_HYPOTHESIS[drift_of(pair)], scales = SLOT_SCALES[drift_of(pair)];
    int64_t best = hypothesis < N_SETS ? likeliest_lane(bank, hypothesis) : -1;
    *likelihood = best < 0 ? LOWEST : likelihood_of(bank, best);
    for (int64_t lane = 0; lane < SWITCHED; lane++) {
        const double own = finite_or_lowest(likelihood_of_slot(bank, lane));
        if (SLOT_HYPOTHESIS[lane] != hypothesis || SLOT_SCALES[lane] != scales || SLOT_STICKS[lane]) continue;
        if (best >= 0 && !(own > *likelihood)) continue;
        *likelihood = own;
        best = N_STEPS + lane;
    }
    return best;
}

/* Which pairs begin again, by their drifts: those of the likeliest suspects, as many as are in a group, each near the onset of
   the likeliest lane of its suspect. */
static void choose_ramps(Bank *bank, int64_t *drift, int64_t *begins)
{
    double said[GROUP];
    int64_t n = 0;
    for (int64_t pair = 0; pair < N_RAMPS; pair++) {
        double likelihood;
        const int64_t lane = likeliest_beside(bank, pair, &likelihood);
        int64_t at = n;
        while (at > 0 && likelihood > said[at - 1]) at--;
        if (at == GROUP) continue;
        if (n < GROUP) n++;
        for (int64_t k = n - 1; k > at; k--) {
            said[k] = said[k - 1];
            drift[k] = drift[k - 1];
            begins[k] = begins[k - 1];
        }
        said[at] = likelihood;
        drift[at] = drift_of(pair);
        begins[at] = bank->onset[lane];
    }
    for (; n < GROUP; n++) {
        drift[n] = drift[0];
        begins[n] = begins[0];
    }
}

FB_OFTEN

/* Whether a lane that begins at the onset rests. */
static inline int rests(const Bank *bank, int64_t lane) { return bank->rests[BLOCKS(N_STEPS) + lane / GROUP] != 0; }

/* The likeliest drift of what that of a pair is of, that does not rest; -1: none. */
static int64_t likeliest_drift(Bank *bank, int64_t pair)
{
    int64_t best = -1;
    double most = -INFINITY;
    for (int64_t lane = 0; lane < SWITCHED; lane++) {
        if (!is_same_fault(lane, drift_of(pair))) continue;
        const double likelihood = likelihood_of_slot(bank, lane) + SLOT_WEIGHT[lane];
        if (rests(bank, lane) || !(likelihood > most)) continue;
        most = likelihood;
        best = lane;
    }
    return best;
}

/* Put one lane of the bank into vectors, and back. */
static void take_slot(const Bank *bank, int64_t lane, int l, double (*to)[FB_LANES])
{
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) to[i][l] = of_slot(bank, lane, i);
}

/* What has come to stay only now has fitted as what moved until then: its sums are those of both, as likely as it is which. */
static void mix_misfit(Bank *bank, int64_t drift, int64_t stay, double kept)
{
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < N_OUTPUTS; j++) {
            double *sums = bank->sums[side][j] + N_STEPS, *since = bank->since[side][j] + N_STEPS;
            sums[stay] = kept * sums[stay] + (1.0 - kept) * sums[drift];
            if (kept < 0.5) since[stay] = since[drift];
        }
}

/* Let what moves come to stay before a sample, `number`, at a time, s, in those lanes of which the first n_begun have
   begun. old: when what has been under way for long was not there yet, s. Until all have, each pair is by itself (not
   `together`), as it is where it begins. */
static void hand_on(Bank *bank, int64_t n_begun, int together, int64_t number, double time, double old,
                    SlotMemory *memory)
{
    const int64_t *onset = bank->onset + N_STEPS;
    const int rate = AT_SLOT + 1;
    for (int64_t first = 0; first < N_RAMPS; first += FB_LANES) {
        int64_t age[FB_LANES] = {0}, pairs[FB_LANES], drifts[FB_LANES], n = 0;
        double kept[FB_LANES];
        double extra[FB_LANES] = {0.0}, longest[FB_LANES] = {0.0};
        for (int64_t pair = first; pair < N_RAMPS && pair < first + FB_LANES; pair++) {
            const int64_t drift = together ? likeliest_drift(bank, pair) : drift_of(pair);
            if (drift < 0 || stay_of(pair) >= n_begun || rests(bank, stay_of(pair))) continue;
            take_slot(bank, drift, (int)n, memory->moves);
            take_slot(bank, stay_of(pair), (int)n, memory->stays);
            age[n] = number - onset[drift];
            longest[n] = SLOT_OLD[drift] ? time - old : longest_ramp(age[n]);
            extra[n] = SLOT_WEIGHT[drift] - SLOT_WEIGHT[stay_of(pair)];
            drifts[n] = drift;
            pairs[n++] = pair;
        }
        if (n == 0) continue;
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            for (int64_t l = n; l < FB_LANES; l++) memory->moves[i][l] = memory->moves[i][0], memory->stays[i][l] = memory->stays[i][0];
            memory->there[i] = load(memory->moves[i]);
            memory->gone[i] = load(memory->stays[i]);
        }
        end_ramps(age, longest, extra, time, memory);
        store(kept, memory->kept[1]);
        for (int64_t l = 0; l < n; l++) mix_misfit(bank, drifts[l], stay_of(pairs[l]), kept[l]);
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            store(memory->stays[i], memory->gone[i]);
            for (int64_t l = 0; l < n; l++) *number_of_slot(bank, stay_of(pairs[l]), i) = memory->stays[i][l];
        }
    }
    for (int64_t lane = together ? 0 : RAMPED; lane < SWITCHED && lane < n_begun; lane++)
        if (SLOT_KIND[lane] == KIND_DRIFT)
            *number_of_slot(bank, lane, WIDE_LIKELIHOOD) += log1p(-ends_now(
                number - onset[lane], of_slot(bank, lane, AT_SLOT), of_slot(bank, lane, rate), of_slot(bank, lane, WIDE_PLACE(rate, rate))));
}

#endif
