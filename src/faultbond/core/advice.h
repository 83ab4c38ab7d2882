/* What to check next: the check that would tell most about which candidate is right, for its cost.

   A check parts the candidates in groups that would still be together after it. What it is expected to tell is the entropy
   of the groups' probabilities, in bits. Looking at a part separates the candidates that hold it from the others. A
   measurement by hand, and a move of an input, separate candidates that expect different values: their lanes are run on,
   without measurements, under the inputs that the move would bring.
   Source: de Kleer and Williams, Artificial Intelligence 32 (1987) 97 (probing by expected entropy).

   Parts are components, sensors and inputs, numbered as in `EngineSpec.parts`; tables of parts, inputs and signals: _COST,
   and _ORDER, which comes first of checks that are worth the same. INPUT_MOVE: by how much an input may be moved, SI; 0: it
   cannot be; nan: the model file does not say. INPUT_HAS_ZERO: 0 where it is a value like any other, as in degC. INPUT_FITTED_LOW and _HIGH:
   where it was in the recordings of a fit, SI. Formulas: docs/method.md, "Ranking". */
#ifndef FB_ADVICE_H
#define FB_ADVICE_H

#include "diagnosis.h"

FB_SELDOM

#define LEAST_LIKELY 0.01 /* probability below which a candidate is left out */
#define APART 1.5         /* standard deviations by which what is expected has to differ */
#define ENDLESS_APART 1e6 /* as which a difference counts that has no end */
#define WORTH 0.1         /* bits that a check has to tell; a move, more than waiting would */
#define LEAST_COST 1e-9
#define N_MOVE_PARTS 3
/* Moves of an input, in its largest value or 100 percent, where none is stated. */
static const double MOVE_PARTS[N_MOVE_PARTS] = {0.2, 0.4, 0.6};

/* The candidates that matter, the first of the diagnosis, with probabilities that add up to 1, and their lanes: plain ones,
   then wide ones. */
typedef struct {
    int64_t n, n_plain, n_wide;
    int64_t is_wide[MOST_RIVALS], at[MOST_RIVALS]; /* where its lane stands among those of its kind */
    double probability[MOST_RIVALS];
    PlainBlock plain[BLOCKS(MOST_RIVALS)];
    WideBlock wide[BLOCKS(MOST_RIVALS)];
    double told[2][BLOCKS(MOST_RIVALS)][2 * N_OUTPUTS][GROUP]; /* innovations of plain and of wide lanes */
    double signal[FB_ROOM(N_SIGNALS)][MOST_RIVALS];               /* what each expects to be measured by hand, SI */
    double squares[MOST_RIVALS][MOST_RIVALS]; /* of the differences of two, in sd of the noise, */
    double along[MOST_RIVALS][MOST_RIVALS];   /* and of these with the sd of what was predicted */
    double apart[MOST_RIVALS][MOST_RIVALS];   /* how far two are from each other, sd */
    int64_t same[MOST_RIVALS][MOST_RIVALS];   /* 1: whatever the inputs do, the one says what the other says */
    double held[FB_ROOM(N_INPUTS)], sample[N_SAMPLE];
} Rivals;

static double step_ahead(void) { return SAMPLE_TIME > 0.0 ? SAMPLE_TIME : 1.0; }

/* Whether one suspect is a wrong gain of an input, and the other the parameter with which alone that acts. */
static int is_gain_of(const Suspect *gain, const Suspect *factor)
{
    return gain->input >= 0 && gain->word == WORD_GAIN && factor->parameter >= 0 && INPUT_FACTOR[gain->input] == factor->parameter;
}

/* Whether two candidates say the same of each suspect, but for such a gain in place of its parameter: no move of an input tells
   them apart, though their lanes are not to the last digit alike. */
static int say_the_same(const Candidate *one, const Candidate *other)
{
    if (one->n_suspects != other->n_suspects || one->kinds[0] == KIND_INTERMITTENT || other->kinds[0] == KIND_INTERMITTENT) return 0;
    for (int64_t i = 0; i < one->n_suspects; i++) {
        int is_there = 0;
        for (int64_t k = 0; k < other->n_suspects; k++) {
            const Suspect *mine = &one->suspects[i], *its = &other->suspects[k];
            const int is_same = mine->parameter == its->parameter && mine->input == its->input && mine->output == its->output;
            is_there |= (is_same && mine->word == its->word) || is_gain_of(mine, its) || is_gain_of(its, mine);
        }
        if (!is_there) return 0;
    }
    return 1;
}

/* Find the candidates that matter. */
static void find_rivals(const Diagnosis *found, Rivals *rivals)
{
    double total = 0.0;
    rivals->n = rivals->n_plain = rivals->n_wide = 0;
    for (int64_t r = 0; r < MOST_RIVALS && r < found->n_candidates; r++) {
        const Candidate *candidate = &found->candidates[r];
        if (!(candidate->probability >= LEAST_LIKELY)) break;
        rivals->is_wide[r] = candidate->lane >= N_STEPS;
        rivals->at[r] = rivals->is_wide[r] ? rivals->n_wide++ : rivals->n_plain++;
        rivals->probability[r] = candidate->probability;
        total += candidate->probability;
        rivals->n++;
    }
    for (int64_t r = 0; r < rivals->n; r++) {
        rivals->probability[r] /= total;
        for (int64_t other = 0; other < r; other++) rivals->same[r][other] = say_the_same(&found->candidates[r], &found->candidates[other]);
    }
}

/* Take the lanes of the rivals out of the bank; lanes that fill up the last block repeat its first. */
static void take_lanes(const Bank *bank, const Diagnosis *found, Rivals *rivals)
{
    for (int64_t r = 0; r < rivals->n; r++) {
        const int64_t lane = found->candidates[r].lane, block = rivals->at[r] / GROUP, l = rivals->at[r] % GROUP;
        for (int64_t k = 0; k < PLAIN_NUMBERS && !rivals->is_wide[r]; k++)
            rivals->plain[block][k][l] = of_step(bank, lane, k);
        for (int64_t k = 0; k < WIDE_NUMBERS && rivals->is_wide[r]; k++)
            rivals->wide[block][k][l] = of_slot(bank, lane - N_STEPS, k);
    }
    for (int64_t at = rivals->n_plain; at % GROUP; at++)
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
            rivals->plain[at / GROUP][k][at % GROUP] = rivals->plain[at / GROUP][k][0];
    for (int64_t at = rivals->n_wide; at % GROUP; at++)
        for (int64_t k = 0; k < WIDE_NUMBERS; k++)
            rivals->wide[at / GROUP][k][at % GROUP] = rivals->wide[at / GROUP][k][0];
}

/* The inputs of now; where the model does not hold, the last for which it did. */
static const double *inputs_now(const State *state) { return state->clock.outside ? state->inputs.inside : state->inputs.held; }

/* A sample without measurements while inputs that are `now` are `held`, `length` samples after the one before, and the last of
   `t` from now on; what settles first is not counted. */
static void pack_ahead(const double *now, const double *held, const Normal *normal, int64_t t, int64_t length, double *packed)
{
    memset(packed, 0, N_SAMPLE * sizeof *packed);
    packed[SAMPLE_DT] = (double)length * step_ahead();
    packed[SAMPLE_AGAIN] = 1.0;
    for (int k = 0; k < N_INPUTS; k++) {
        packed[SAMPLE_U_BEFORE + k] = t == length ? now[k] : held[k];
        packed[SAMPLE_U + k] = held[k];
    }
    for (int k = 0; k < N_NOISY; k++) packed[SAMPLE_FRESH + k] = INPUT_VARIANCE[k];
    for (int m = 0; m < N_SMOOTH; m++) { /* what is left of the noise of a smooth one stays */
        packed[SAMPLE_FADE + SMOOTH_NOISE[m]] = 1.0;
        packed[SAMPLE_FRESH + SMOOTH_NOISE[m]] = 0.0;
    }
    for (int j = 0; j < N_OUTPUTS; j++) {
        double blank = 0.0;
        for (int e = DIRECT_ROW[j]; e < DIRECT_ROW[j + 1]; e++)
            if (held[DIRECT_INPUT[e]] != now[DIRECT_INPUT[e]])
                blank = larger(blank, INPUT_SETTLING[DIRECT_INPUT[e]]);
        packed[SAMPLE_SCALE + j] = (double)t <= ceil(blank / step_ahead()) ? BLANK_FACTOR : normal->noise[j];
    }
}

/* Take one packed sample into the lanes of all rivals. */
static void advance_rivals(const Normal *normal, Rivals *rivals, Filters *filters)
{
    for (int64_t first = 0; first < rivals->n_plain; first += GROUP) {
        const int64_t block = first / GROUP;
        advance_plain(rivals->plain[block], rivals->sample, normal, rivals->told[0][block], &filters->plain);
    }
    for (int64_t first = 0; first < rivals->n_wide; first += GROUP) {
        const int64_t block = first / GROUP;
        advance_wide(rivals->wide[block], rivals->sample, normal, rivals->told[1][block], &filters->wide);
    }
}

/* Number k of what the filter of a rival told of the last sample. */
static double told_by(const Rivals *rivals, int64_t r, int64_t k)
{
    return rivals->told[rivals->is_wide[r]][rivals->at[r] / GROUP][k][rivals->at[r] % GROUP];
}

/* Add how far two rivals are apart at the last sample, which stands for so many. A prediction's own uncertainty is what its
   variance is beyond the noise; what is no number counts as nothing, or as wholly uncertain. The noise of a
   sensor out of use has no end, so nothing is apart there. */
static void add_apart(int64_t r, int64_t other, double count, Rivals *rivals)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double usual = 0.5 * (noise_at(j, told_by(rivals, r, j)) + noise_at(j, told_by(rivals, other, j)));
        const double noise = usual * rivals->sample[SAMPLE_SCALE + j];
        const double apart = fabs(told_by(rivals, r, j) - told_by(rivals, other, j)) / sqrt(noise);
        const double variance = told_by(rivals, r, N_OUTPUTS + j) + told_by(rivals, other, N_OUTPUTS + j);
        const double own = variance / noise - 2.0; /* each of both has the noise */
        const double scaled = isnan(apart) ? 0.0 : isinf(apart) ? ENDLESS_APART : apart;
        rivals->squares[r][other] += count * scaled * scaled;
        rivals->along[r][other] += count * scaled * (isnan(own) || own == INFINITY ? ENDLESS_APART : root_of(own));
    }
}

/* How far two predictions are apart, in sd, from the sums over all samples. Their own uncertainty is taken as wholly
   correlated in time, in the direction of the difference. */
static double separation(double squares, double along)
{
    const double size = sqrt(squares), own = along / size;
    return size == 0.0 ? 0.0 : size / sqrt(1.0 + own * own);
}

/* Part the rivals in groups in which each is close to another one; gives how many. */
static int64_t part_rivals(const Rivals *rivals, int64_t *group)
{
    int64_t n = 0;
    for (int64_t r = 0; r < rivals->n; r++) {
        int64_t is_near[MOST_RIVALS] = {0}, after[MOST_RIVALS] = {0}, kept = 0;
        for (int64_t other = 0; other < r; other++)
            if (rivals->same[r][other] || !(rivals->apart[r][other] >= APART)) is_near[group[other]] = 1;
        for (int64_t k = 0; k < n; k++) after[k] = is_near[k] ? -1 : kept++;
        for (int64_t other = 0; other < r; other++)
            group[other] = after[group[other]] < 0 ? kept : after[group[other]]; /* joined, they are the last */
        group[r] = kept;
        n = kept + 1;
    }
    return n;
}

/* Part the rivals in those that readings would not tell apart while inputs are held. Steps become longer once what a move does at
   first has died away. */
static int64_t part_ahead(const State *state, const Diagnosis *found, int64_t *group, Rivals *rivals, Filters *filters)
{
    take_lanes(&state->bank, found, rivals);
    memset(rivals->squares, 0, sizeof rivals->squares);
    memset(rivals->along, 0, sizeof rivals->along);
    int64_t passed = 0;
    for (int step = 0; step < N_AHEAD; step++) {
        passed += AHEAD_LENGTH[step];
        pack_ahead(inputs_now(state), rivals->held, &state->normal, passed, AHEAD_LENGTH[step], rivals->sample);
        advance_rivals(&state->normal, rivals, filters);
        for (int64_t r = 0; r < rivals->n; r++)
            for (int64_t other = 0; other < r; other++) add_apart(r, other, (double)AHEAD_LENGTH[step], rivals);
    }
    for (int64_t r = 0; r < rivals->n; r++)
        for (int64_t other = 0; other < r; other++)
            rivals->apart[r][other] = separation(rivals->squares[r][other], rivals->along[r][other]);
    return part_rivals(rivals, group);
}

/* What it tells to know the group of the right candidate, bits. */
static double entropy(const Rivals *rivals, const int64_t *group, int64_t n_groups)
{
    double total = 0.0;
    for (int64_t k = 0; k < n_groups; k++) {
        double part = 0.0;
        for (int64_t r = 0; r < rivals->n; r++)
            if (group[r] == k) part += rivals->probability[r];
        if (part > 0.0) total -= part * log2(part);
    }
    return total;
}

/* Begin a check. */
static Check check_of(int64_t kind, int64_t target, double cost)
{
    Check check;
    memset(&check, 0, sizeof check);
    check.kind = kind;
    check.target = target;
    check.cost = cost;
    check.value = check.within = NAN;
    return check;
}

static int holds_part(const Candidate *candidate, int part)
{
    for (int64_t k = 0; k < candidate->n_suspects; k++)
        if (part_of(&candidate->suspects[k]) == part) return 1;
    return 0;
}

/* Looking at one part tells whether it is among the faulty ones. */
static void find_looks(const Diagnosis *found, const Rivals *rivals, Advice *advice)
{
    for (int64_t r = 0; r < rivals->n; r++)
        for (int64_t k = 0; k < found->candidates[r].n_suspects; k++) {
            const int part = part_of(&found->candidates[r].suspects[k]);
            Check check = check_of(CHECK_COMPONENT, part, PART_COST[part]);
            int is_new = 1;
            for (int64_t other = 0; other < advice->n_checks; other++) is_new &= advice->checks[other].target != part;
            if (!is_new) continue;
            check.n_groups = 2;
            for (int64_t other = 0; other < rivals->n; other++)
                check.group[other] = !holds_part(&found->candidates[other], part);
            check.gain = entropy(rivals, check.group, check.n_groups);
            if (check.gain >= WORTH) advice->checks[advice->n_checks++] = check;
        }
}

/* The values to which input k may be moved, the nearest first, and how many: up and down, not beyond where it has been. Zero
   counts as a place where it has been, but for that of degC, which is no special one. Percentages may go from 0 to 100. None
   goes to where the model was not fitted, and none beyond what the input can be; how far a stated move may go is else left to whoever
   stated it. */
static int values_of(const Inputs *inputs, double now, int k, double *values)
{
    const double stated = INPUT_MOVE[k];
    double low = inputs->lowest[k], high = inputs->highest[k], full = high - low;
    int n = 0;
    if (INPUT_HAS_ZERO[k]) {
        low = smaller(low, 0.0);
        high = larger(high, 0.0);
        full = peak_of(inputs, k);
    }
    if (INPUT_PERCENT[k]) {
        low = 0.0;
        high = full = 100.0;
    }
    if (isnan(stated)) {
        low = larger(low, INPUT_FITTED_LOW[k]);
        high = smaller(high, INPUT_FITTED_HIGH[k]);
    } else if (!INPUT_PERCENT[k]) {
        low = -INFINITY;
        high = INFINITY;
    }
    low = larger(low, INPUT_END_LOW[k]);
    high = smaller(high, INPUT_END_HIGH[k]);
    const double least = isnan(stated) ? MOVE_PARTS[0] * full : stated;
    for (int move = 0; move < (isnan(stated) ? 2 * N_MOVE_PARTS : 2); move++) {
        const double size = isnan(stated) ? MOVE_PARTS[move / 2] * full : stated;
        const double value = bounded(move % 2 ? now - size : now + size, low, high);
        int is_new = fabs(value - now) > 0.5 * least && least > 0.0;
        for (int other = 0; other < n; other++) is_new &= values[other] != value;
        if (is_new) values[n++] = value;
    }
    return n;
}

/* The most that a check can tell, bits: which candidate is right. */
static double most_told(const Rivals *rivals)
{
    int64_t alone[MOST_RIVALS];
    for (int64_t r = 0; r < rivals->n; r++) alone[r] = r;
    return entropy(rivals, alone, rivals->n);
}

/* Moving an input lets candidates go apart that agree now. Of its moves the nearest is advised that tells most, to 0.01; where
   waiting, or a move, tells all that there is to tell, no other is asked. */
static void find_moves(const State *state, const Diagnosis *found, Rivals *rivals, Filters *filters, Advice *advice)
{
    int64_t group[MOST_RIVALS];
    double values[2 * N_MOVE_PARTS];
    const double *now = inputs_now(state);
    memcpy(rivals->held, now, sizeof rivals->held);
    const int64_t n_waited = part_ahead(state, found, group, rivals, filters);
    const double waited = entropy(rivals, group, n_waited), most = most_told(rivals);
    for (int k = 0; k < N_INPUTS && most >= waited + WORTH; k++) {
        Check check = check_of(CHECK_INPUT, k, INPUT_COST[k]), best = check;
        const int n = values_of(&state->inputs, now[k], k, values);
        check.within = (double)AHEAD * step_ahead();
        for (int move = 0; move < n && rint(100.0 * best.gain) < rint(100.0 * most); move++) {
            check.value = rivals->held[k] = values[move];
            if (MODEL_CONDITION >= 0 && !model_holds(MODEL_CONDITION, rivals->held)) continue;
            check.n_groups = part_ahead(state, found, check.group, rivals, filters);
            check.gain = entropy(rivals, check.group, check.n_groups);
            const int is_worth = check.gain >= waited + WORTH;
            if (is_worth && (best.n_groups == 0 || rint(100.0 * check.gain) > rint(100.0 * best.gain))) best = check;
        }
        rivals->held[k] = now[k];
        if (best.n_groups > 0) advice->checks[advice->n_checks++] = best;
    }
}

#if N_SIGNALS > 0
/* What each rival expects of the signals that can be measured by hand. */
static void expect_by_hand(const State *state, Rivals *rivals, Filters *filters)
{
    lanes values[N_SIGNALS];
    double by_lane[FB_LANES];
    for (int64_t r = 0; r < rivals->n; r++) {
        const int64_t block = rivals->at[r] / GROUP, l = rivals->at[r] % GROUP, part = l - l % FB_LANES;
        if (rivals->is_wide[r]) {
            for (int64_t i = 0; i < WIDE_NUMBERS; i++) filters->wide.lane[i] = load(rivals->wide[block][i] + part);
            expect_signals_wide(filters->wide.lane, inputs_now(state), values);
        } else {
            for (int64_t i = 0; i < PLAIN_NUMBERS; i++) filters->plain.lane[i] = load(rivals->plain[block][i] + part);
            expect_signals_plain(filters->plain.lane, inputs_now(state), values);
        }
        for (int k = 0; k < N_SIGNALS; k++) {
            store(by_lane, values[k]);
            rivals->signal[k][r] = by_lane[l - part];
        }
    }
}

/* Measuring a signal by hand tells candidates apart that expect different values of it. */
static void find_measurements(const State *state, const Diagnosis *found, Rivals *rivals, Filters *filters, Advice *advice)
{
    take_lanes(&state->bank, found, rivals);
    expect_by_hand(state, rivals, filters);
    for (int k = 0; k < N_SIGNALS; k++) {
        Check check = check_of(CHECK_SIGNAL, k, SIGNAL_COST[k]);
        for (int64_t r = 0; r < rivals->n; r++)
            for (int64_t other = 0; other < r; other++)
                rivals->apart[r][other] = fabs(rivals->signal[k][r] - rivals->signal[k][other]) / SIGNAL_NOISE[k];
        check.n_groups = part_rivals(rivals, check.group);
        check.gain = entropy(rivals, check.group, check.n_groups);
        if (check.gain >= WORTH) advice->checks[advice->n_checks++] = check;
    }
}
#endif

/* Whether a check comes before another one: it tells more for its cost. */
static int comes_before(const Check *check, const Check *other)
{
    const double worth = check->gain / larger(check->cost, LEAST_COST), more = other->gain / larger(other->cost, LEAST_COST);
    const Check *both[2] = {check, other};
    int order[2];
    for (int k = 0; k < 2; k++)
        switch (both[k]->kind) {
        case CHECK_COMPONENT: order[k] = PART_ORDER[both[k]->target]; break;
        case CHECK_INPUT: order[k] = INPUT_ORDER[both[k]->target]; break;
        default: order[k] = SIGNAL_ORDER[both[k]->target];
        }
    return worth > more || (worth == more && order[0] < order[1]);
}

/* Give what to do next after a diagnosis; nothing while one candidate stands alone, nor where most likely the model is off: to
   expect anything of a move it would have to be right. */
static void advise(const State *state, const Diagnosis *found, Rivals *rivals, Filters *filters, Advice *advice)
{
    memset(advice, 0, sizeof *advice);
    if (found->mismatch > 0.0 || found->is_over) return;
    find_rivals(found, rivals);
    advice->n_rivals = rivals->n;
    if (most_told(rivals) < WORTH) return;
    find_looks(found, rivals, advice);
    find_moves(state, found, rivals, filters, advice);
#if N_SIGNALS > 0
    find_measurements(state, found, rivals, filters, advice);
#endif
    for (int64_t k = 1; k < advice->n_checks; k++) {
        const Check check = advice->checks[k];
        int64_t at = k;
        for (; at > 0 && comes_before(&check, &advice->checks[at - 1]); at--) advice->checks[at] = advice->checks[at - 1];
        advice->checks[at] = check;
    }
}

FB_OFTEN

#endif
