/* Steps of parameters in the bank: lanes for every hypothesis and start, begun at the alarm from what was known before
   the change, and begun again from what they have found.

   A faulty parameter keeps a linear factor, since its logarithm overshoots. Single starts fail for parameters that act
   by their inverse, so each suspect starts from several sizes. A store whose own parameter changes may keep its content
   (charge, volume, momentum) or its effort or flow (a level, a speed); both happen and both are tried.

   The unit of work is a block of FB_LANES starts at one onset, `begin_onset`. */
#ifndef FB_STEPS_H
#define FB_STEPS_H

#include "trail.h"

#define KEPT_NATS 15.0    /* by which an onset may be less likely than the best and still is tried for larger sets */
#define ASTRAY 10.0       /* nats by which a lane that begins from closer may be less likely, as chance has it */
#define IN_REACH 20.0     /* nats by which a filter, or a hypothesis, may lag behind the best and still come to lead */
#define SAME 0.3          /* standard deviations by which two filters that found the same may differ, */
#define TINY 1e-12        /* and rounding */
#define FOUND_SPREAD 0.35 /* sd of a start that was found, in starts; */
#define LEAST_CHANGE 0.05 /* the most it is allowed is at least this, in healthy factors */
#define NOT_AGAIN (-1)          /* of a lane that does not begin again */
#define NEAR (-2)         /* of one that does; from where is not known yet */

/* Where a lane begins. */
typedef struct {
    int64_t n;                           /* suspects, */
    int parameter[FB_ROOM(LARGEST_SET)]; /* which they are, */
    double value[FB_ROOM(LARGEST_SET)];  /* starts: times the healthy factor (plus it where the nominal is 0), and */
    double sd[FB_ROOM(LARGEST_SET)];     /* how far they may be off, alike */
    int jumps[FB_ROOM(N_STATES)];        /* 1: the content goes on at the change, else the effort (C) or flow (I) */
    int tied;                            /* 1: a jump is bound to the factor of its suspect, which is nearly known */
} Start;

/* Memory of a call. */
typedef struct {
    PlainBlock early, late, near, again;
    Mixture mixture;
    Onsets onsets;
    double said[DEPTH]; /* likelihood of the likeliest lane that was begun at each onset */
    Start starts[FB_LANES], closer[FB_LANES];
    double healthy[PLAIN_NUMBERS], later[PLAIN_NUMBERS], lane[PLAIN_NUMBERS], sample[N_SAMPLE];
    double innovations[2 * N_OUTPUTS][FB_LANES];
    int64_t best[FB_ROOM(N_SETS)];          /* likeliest lane of each hypothesis */
    int64_t wanted[FB_ROOM(N_STEPS)];       /* lanes to be begun again, those without a jump first */
    int64_t stands_for[FB_ROOM(N_PLANNED)]; /* lane whose new beginning is that of each; NOT_AGAIN: none */
    int64_t known[FB_ROOM(N_PLANNED)];      /* lanes of a hypothesis that found different things, the likeliest first */
    uint8_t changed[FB_ROOM(N_STEPS)];      /* 1: the last renewal gave the lane other numbers, or it is lost */
} StepMemory;

/* Place of a covariance in a plain lane, in either order. */
static inline int64_t plain_place(int64_t i, int64_t j) { return i <= j ? PLAIN_PLACE(i, j) : PLAIN_PLACE(j, i); }

/* Let number i of a lane be what it is and `factor` times number k: its row and column of the covariance. */
static void add_to_row(double *lane, int64_t i, int64_t k, double factor)
{
    const double before = lane[plain_place(i, k)];
    for (int64_t j = 0; j < PLAIN_JOINT; j++)
        if (j != i) lane[plain_place(i, j)] += factor * lane[plain_place(k, j)];
    lane[plain_place(i, i)] += factor * before;
    lane[plain_place(i, i)] += factor * lane[plain_place(i, k)];
}

/* Whether entry e of JUMP, a parameter of a store, makes it jump: a suspect whose factor is there. */
static int moves_store(const Start *start, int64_t e, const double *healthy)
{
    const int index = JUMP_PARAMETER[e];
    if (HEALTHY[index] == 0.0 || healthy[AT_PARAMETERS + index] == 0.0) return 0;
    for (int64_t s = 0; s < start->n; s++)
        if (start->parameter[s] == index) return 1;
    return 0;
}

/* Let the effort or flow of a store jump with its suspect, entry e of JUMP, where its content goes on.

   The state x becomes x * factor**exponent, and as uncertain as the factor makes it. From a wide start it is left
   uncorrelated with the factor: linear correlation over so wide a start would fix the factor, wrongly, at the first
   measurement of x. From what was found (`tied`) it goes with the factor, else the two could part for good. */
static void let_jump(int state, int64_t e, int tied, const double *healthy, double *lane)
{
    const int k = AT_PARAMETERS + JUMP_PARAMETER[e];
    const double scale = pow(lane[k] / healthy[k], JUMP_EXPONENT[e]);
    for (int64_t j = 0; j < PLAIN_JOINT; j++) lane[plain_place(state, j)] *= scale;
    lane[plain_place(state, state)] *= scale;
    lane[state] *= scale;
    const double slope = JUMP_EXPONENT[e] * lane[state] / lane[k];
    if (tied) add_to_row(lane, state, k, slope);
    else lane[plain_place(state, state)] += slope * slope * lane[plain_place(k, k)];
}

/* The lane of a start: the suspects wide about it, the rest as in `healthy`. */
static void suspect_lane(const Start *start, const double *healthy, double *lane)
{
    memcpy(lane, healthy, PLAIN_NUMBERS * sizeof *lane);
    for (int state = 0; state < N_STATES; state++)
        for (int64_t e = JUMP_ROW[state]; start->jumps[state] && e < JUMP_ROW[state + 1]; e++)
            if (moves_store(start, e, healthy)) { /* the state as its factor does not move it: what the content says */
                const int64_t k = AT_PARAMETERS + JUMP_PARAMETER[e];
                add_to_row(lane, state, k, -(JUMP_EXPONENT[e] * healthy[state] / healthy[k]));
            }
    for (int64_t s = 0; s < start->n; s++) {
        const int index = start->parameter[s], k = AT_PARAMETERS + index, additive = HEALTHY[index] == 0.0;
        const double sd = start->sd[s] * (additive ? 1.0 : fabs(healthy[k]));
        const double mean = additive ? healthy[k] + start->value[s] : healthy[k] * start->value[s];
        for (int64_t j = 0; j < PLAIN_JOINT; j++) lane[plain_place(k, j)] = 0.0;
        lane[plain_place(k, k)] = sd * sd;
        lane[k] = bounded(mean, LOWER[index], UPPER[index]);
    }
    for (int state = 0; state < N_STATES; state++)
        for (int64_t e = JUMP_ROW[state]; start->jumps[state] && e < JUMP_ROW[state + 1]; e++)
            if (moves_store(start, e, healthy)) let_jump(state, e, start->tied, healthy, lane);
}

/* The lanes of a block of starts. */
static void suspect_lanes(const Start *starts, const double *healthy, double (*block)[FB_LANES], double *lane)
{
    for (int64_t l = 0; l < FB_LANES; l++) {
        suspect_lane(&starts[l], healthy, lane);
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) block[k][l] = lane[k];
    }
}

/* Lanes predicted to the sample of the onset, before its measurements, into `late`; memory: `healthy` and `sample`.

   The fault came at some moment since the sample before, so the states lie between those of a fault from that sample on
   (`early`) and of one that comes only now (`late`). */
static void begin_lanes(const Start *starts, const Normal *normal, StepMemory *memory, Filter_plain *work)
{
    double (*early)[FB_LANES] = memory->early, (*late)[FB_LANES] = memory->late;
    for (int64_t j = 0; j < N_OUTPUTS; j++) memory->sample[SAMPLE_USE + j] = 0.0;
    suspect_lanes(starts, memory->healthy, early, memory->lane);
    advance_plain(early, memory->sample, normal, NULL, work);
    memcpy(memory->later, memory->healthy, sizeof memory->later);
    advance_one(memory->later, memory->sample, normal, NULL, work);
    suspect_lanes(starts, memory->later, late, memory->lane);
    for (int64_t l = 0; l < FB_LANES; l++) {
        double half[FB_ROOM(N_STATES)];
        for (int64_t i = 0; i < N_STATES; i++) {
            half[i] = 0.5 * (early[i][l] - late[i][l]);
            if (!isfinite(half[i])) half[i] = 0.0;
            late[i][l] += half[i];
        }
        for (int64_t i = 0; i < N_STATES; i++)
            for (int64_t j = i; j < N_STATES; j++) late[PLAIN_PLACE(i, j)][l] += half[i] * half[j];
    }
}

/* Take a block of lanes, which stand at the sample of the onset already, over the samples from there up to now. */
static void run_lanes(double (*block)[FB_LANES], const Trail *trail, int64_t onset, const Normal *normal,
                      double *sample, Filter_plain *work)
{
    const int moving = drifts(normal);
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) work->lane[k] = load(block[k]);
    for (int64_t place = onset; place < trail->n; place++) {
        bank_sample(sample_at(trail, place), sample);
        if (place == onset) { /* no time passes before it */
            sample[SAMPLE_DT] = 0.0;
            for (int64_t k = 0; k < N_SLOW; k++) sample[SAMPLE_KICK + k] = 0.0;
            for (int64_t i = 0; i < N_STATES; i++) sample[SAMPLE_GAP + i] = 0.0;
        }
        if (moving) drift_on(normal, sample[SAMPLE_DT], work->lane, PLAIN_JOINT);
        filter_step_plain(work->lane, sample, work->innovations, work);
    }
    for (int64_t k = 0; k < PLAIN_NUMBERS; k++) store(block[k], work->lane[k]);
}

/* Begin a block of starts at onset number k, and add what they are by now to the best of the onsets before it. */
static void begin_onset(const Start *starts, const Trail *trail, const Onsets *onsets, int k, const Normal *normal,
                        double (*best)[FB_LANES], Mixture *mixture, StepMemory *memory, Filter_plain *work)
{
    const int64_t onset = onsets->place[k];
    memcpy(memory->healthy, before_onset(trail, onset), sizeof memory->healthy);
    const double likelihood = memory->healthy[PLAIN_LIKELIHOOD];
    forget_slow_errors(memory->healthy);
    bank_sample(sample_at(trail, onset), memory->sample);
    begin_lanes(starts, normal, memory, work);
    for (int64_t l = 0; l < FB_LANES; l++) memory->late[PLAIN_LIKELIHOOD][l] = likelihood;
    run_lanes(memory->late, trail, onset, normal, memory->sample, work);
    mix(k == 0, memory->late, PLAIN_NUMBERS, onsets->width[k], best, mixture);
}

/* Hear what a block of lanes that was begun at onset number k says for it; those that follow lane `count` say nothing. */
static void hear(int k, int64_t count, StepMemory *memory)
{
    for (int64_t l = 0; l < count && l < FB_LANES; l++)
        memory->said[k] = fmax(memory->said[k], finite_or_lowest(memory->late[PLAIN_LIKELIHOOD][l]));
}

/* Begin FB_LANES starts at all onsets: `block` gets the lanes, which have seen all samples of the trail. */
static void begin_steps(const Start *starts, const Trail *trail, const Onsets *onsets, const Normal *normal,
                        double (*block)[FB_LANES], StepMemory *memory, Filter_plain *work)
{
    for (int k = 0; k < onsets->n; k++)
        begin_onset(starts, trail, onsets, k, normal, block, &memory->mixture, memory, work);
    conclude_mixture(&memory->mixture, PLAIN_NUMBERS, block);
}

/* The start of a lane of the plan. */
static void planned_start(int64_t lane, Start *start)
{
    const int64_t members = SET_ROW[LANE_HYPOTHESIS[lane]];
    start->n = start->tied = 0;
    for (int64_t e = LANE_START[lane]; e < LANE_START[lane + 1]; e++) {
        if (!(START_SPREAD[e] > 0.0)) continue;
        start->parameter[start->n] = SET_MEMBER[members + e - LANE_START[lane]];
        start->value[start->n] = START_VALUE[e];
        start->sd[start->n++] = START_SPREAD[e];
    }
    memset(start->jumps, 0, sizeof start->jumps);
    for (int64_t e = LANE_JUMP_ROW[lane]; e < LANE_JUMP_ROW[lane + 1]; e++) start->jumps[LANE_JUMP_STATE[e]] = 1;
}

/* Let the first n starts be followed by repetitions of the first. */
static void repeat_first(Start *starts, int64_t n)
{
    for (int64_t l = n; l < FB_LANES; l++) starts[l] = starts[0];
}

/* The starts of a block of the plan. */
static void planned_starts(int64_t block, Start *starts)
{
    int64_t n = 0;
    for (int64_t lane = block * FB_LANES; lane < N_PLANNED && n < FB_LANES; lane++)
        planned_start(lane, &starts[n++]);
    repeat_first(starts, n);
}

/* Let a start that was run be at the estimates of its lane, of a block; `healthy`: the lane of the healthy plant, to
   which starts are relative. */
static void move_to_found(Start *start, double (*block)[FB_LANES], int64_t l, const double *healthy)
{
    for (int64_t s = 0; s < start->n; s++) {
        const int index = start->parameter[s], k = AT_PARAMETERS + index;
        const double most = CHANGE[index] > LEAST_CHANGE ? CHANGE[index] : LEAST_CHANGE;
        double least = 0.0;
        if (HEALTHY[index] == 0.0) {
            start->value[s] = block[k][l] - healthy[k];
            least = ACCURACY[index] < most ? ACCURACY[index] : most;
        } else {
            start->value[s] = block[k][l] / (healthy[k] == 0.0 ? 1.0 : healthy[k]);
        }
        start->sd[s] = bounded(FOUND_SPREAD * fabs(start->value[s]), least, most);
    }
    start->tied = 1;
}

static int any_jump(const Start *start)
{
    for (int64_t i = 0; i < N_STATES; i++)
        if (start->jumps[i]) return 1;
    return 0;
}

/* Begin starts that were found, as `begin_steps` does.

   A jump that is tied to its factor says much and is linearised: where a store jumps, the lane begins a second time,
   from what it then knows, and stays so unless that led astray. */
static void begin_near(const Start *starts, const Trail *trail, const Onsets *onsets, const Normal *normal,
                       double (*block)[FB_LANES], StepMemory *memory, Filter_plain *work)
{
    int64_t n = 0, from[FB_LANES];
    begin_steps(starts, trail, onsets, normal, block, memory, work);
    for (int64_t l = 0; l < FB_LANES; l++) {
        if (!any_jump(&starts[l])) continue;
        memory->closer[n] = starts[l];
        move_to_found(&memory->closer[n], block, l, healthy_at(trail, 0));
        from[n++] = l;
    }
    if (n == 0) return;
    repeat_first(memory->closer, n);
    begin_steps(memory->closer, trail, onsets, normal, memory->again, memory, work);
    for (int64_t l = 0; l < n; l++) {
        const double again = finite_or_lowest(memory->again[PLAIN_LIKELIHOOD][l]);
        if (!(again > finite_or_lowest(block[PLAIN_LIKELIHOOD][from[l]]) - ASTRAY)) continue;
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) block[k][from[l]] = memory->again[k][l];
    }
}

/* Lanes that fill up the last block of steps repeat its first. */
static void fill_last_block(Bank *bank)
{
    for (int64_t lane = N_STEPS; lane % FB_LANES != 0; lane++)
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
            *number_of_step(bank, lane, k) = *number_of_step(bank, lane - lane % FB_LANES, k);
}

/* Leave out the onsets at which no step of a single parameter explains the samples nearly as well as at the best. */
static void keep_likely(Onsets *onsets, const double *said)
{
    double most = LOWEST;
    int n = 0;
    for (int k = 0; k < onsets->n; k++) most = fmax(most, said[k]);
    for (int k = 0; k < onsets->n; k++) {
        if (said[k] < most - KEPT_NATS) continue;
        onsets->place[n] = onsets->place[k];
        onsets->width[n++] = onsets->width[k];
    }
    onsets->n = n;
}

/* Begin a block of the plan that holds lanes of single parameters, and hear at which onsets these explain the samples. */
static void begin_singles(Bank *bank, int64_t b, const Trail *trail, const Normal *normal, StepMemory *memory,
                          Filter_plain *work)
{
    planned_starts(b, memory->starts);
    for (int k = 0; k < memory->onsets.n; k++) {
        begin_onset(memory->starts, trail, &memory->onsets, k, normal, bank->steps[b], &memory->mixture, memory, work);
        hear(k, N_SINGLE_LANES - b * FB_LANES, memory);
    }
    conclude_mixture(&memory->mixture, PLAIN_NUMBERS, bank->steps[b]);
}

/* Begin the lanes of all hypotheses of the plan; `change`: place in the trail of the onset that the detector estimates.
   Sets of several parameters, which are most, are tried only at the onsets that one of them by itself makes likely.
   Lanes of sets in reserve are zero, and of no weight until the sets are chosen. */
static void begin_all_steps(Bank *bank, const Trail *trail, int64_t change, const Normal *normal, StepMemory *memory,
                            Filter_plain *work)
{
    const int64_t n_singles = BLOCKS(N_SINGLE_LANES), mixed = N_SINGLE_LANES % FB_LANES;
    find_onsets(trail, change, &memory->onsets);
    for (int k = 0; k < memory->onsets.n; k++) memory->said[k] = LOWEST;
    for (int64_t b = 0; b < n_singles; b++) begin_singles(bank, b, trail, normal, memory, work);
    if (n_singles > 0) keep_likely(&memory->onsets, memory->said);
    for (int64_t b = n_singles - (mixed > 0); b < BLOCKS(N_PLANNED); b++) {
        planned_starts(b, memory->starts);
        begin_steps(memory->starts, trail, &memory->onsets, normal, memory->near, memory, work);
        for (int64_t l = b < n_singles ? mixed : 0; l < FB_LANES; l++) /* after singles, the others of their block */
            for (int64_t k = 0; k < PLAIN_NUMBERS; k++) bank->steps[b][k][l] = memory->near[k][l];
    }
    for (int64_t lane = N_PLANNED; lane < N_STEPS; lane++)
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) *number_of_step(bank, lane, k) = 0.0;
    fill_last_block(bank);
    for (int64_t k = 0; N_RESERVE > 0 && k < PLAIN_NUMBERS; k++) bank->healthy[k] = healthy_at(trail, 0)[k];
    for (int64_t k = 0; k < N_GROWN; k++) bank->grown[k] = -1;
}

/* Whether any lane of a block has begun: it is of the plan, or of a set that was taken from the reserve. */
static int has_begun(const Bank *bank, int64_t block)
{
    if (block * FB_LANES < N_PLANNED) return 1;
    for (int64_t lane = block * FB_LANES; lane < N_STEPS && lane < (block + 1) * FB_LANES; lane++)
        if (bank->grown[(lane - N_PLANNED) / PER_SET] >= 0) return 1;
    return 0;
}

/* Take one more packed sample into all lanes of steps. innovations: of each lane measured less expected readings, then
   their variances; 0 and 1 of lanes that have not begun. */
static void advance_steps(Bank *bank, const double *packed, const Normal *normal,
                          double (*innovations)[FB_ROOM(N_LANES)], StepMemory *memory, Filter_plain *work)
{
    bank_sample(packed, memory->sample);
    for (int64_t b = 0; b < BLOCKS(N_STEPS); b++) {
        const int begun = has_begun(bank, b);
        if (begun) advance_plain(bank->steps[b], memory->sample, normal, memory->innovations, work);
        for (int64_t lane = b * FB_LANES; lane < N_STEPS && lane < (b + 1) * FB_LANES; lane++)
            for (int64_t k = 0; k < 2 * N_OUTPUTS; k++)
                innovations[k][lane] = begun ? memory->innovations[k][lane % FB_LANES] : (k < N_OUTPUTS ? 0.0 : 1.0);
    }
}

/* Log-likelihood of a lane of the bank; LOWEST where it is no number. */
static inline double likelihood_of(Bank *bank, int64_t lane)
{
    return finite_or_lowest(*number_of_step(bank, lane, PLAIN_LIKELIHOOD));
}

/* The likeliest lane of a set, and the least likely one. */
static int64_t likeliest_lane(Bank *bank, int64_t set)
{
    int64_t best = FIRST_LANE[set];
    for (int64_t lane = best + 1; lane < FIRST_LANE[set + 1]; lane++)
        if (likelihood_of(bank, lane) > likelihood_of(bank, best)) best = lane;
    return best;
}

static int64_t least_likely_lane(Bank *bank, int64_t set)
{
    int64_t worst = FIRST_LANE[set];
    for (int64_t lane = worst + 1; lane < FIRST_LANE[set + 1]; lane++)
        if (likelihood_of(bank, lane) < likelihood_of(bank, worst)) worst = lane;
    return worst;
}

/* Give a lane of the bank its first `count` numbers anew, those of lane l of a block. */
static void replace_lane(Bank *bank, int64_t lane, double (*block)[FB_LANES], int64_t l, int64_t count,
                         uint8_t *changed)
{
    for (int64_t k = 0; k < count; k++) {
        double *number = number_of_step(bank, lane, k);
        if (*number != block[k][l]) changed[lane] = 1;
        *number = block[k][l];
    }
}

/* After a renewal of lanes from `first` up to `end`: one that is no number counts as changed. */
static void conclude_renewal(Bank *bank, int64_t first, int64_t end, uint8_t *changed)
{
    for (int64_t lane = first; lane < end; lane++)
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
            if (isnan(*number_of_step(bank, lane, k))) changed[lane] = 1;
    fill_last_block(bank);
}

/* Run up to FB_LANES lanes of the plan again at the onsets, from what they have found, into `near`; gives how many. */
static int64_t begin_found(Bank *bank, const int64_t *chosen, int64_t n, const Trail *trail, const Normal *normal,
                           StepMemory *memory, Filter_plain *work)
{
    const int64_t count = n < FB_LANES ? n : FB_LANES;
    for (int64_t l = 0; l < count; l++) {
        planned_start(chosen[l], &memory->starts[l]);
        move_to_found(&memory->starts[l], bank->steps[chosen[l] / FB_LANES], chosen[l] % FB_LANES,
                      healthy_at(trail, 0));
    }
    repeat_first(memory->starts, count);
    begin_near(memory->starts, trail, &memory->onsets, normal, memory->near, memory, work);
    return count;
}

static inline int lane_jumps(int64_t lane) { return LANE_JUMP_ROW[lane + 1] > LANE_JUMP_ROW[lane]; }

/* Begin one filter per hypothesis again at the onset, from what the best of its filters has found by now.

   A filter that began far from the truth has linearised there, and may be stuck; the same samples, taken again from
   nearby, say more. It takes the place of the least likely filter of its hypothesis, if it is likelier. */
static void renew_steps(Bank *bank, const Trail *trail, const Normal *normal, StepMemory *memory, Filter_plain *work)
{
    int64_t n = 0;
    find_onsets(trail, trail->alarm, &memory->onsets);
    memset(memory->changed, 0, sizeof memory->changed);
    for (int64_t set = 0; set < N_SETS; set++) memory->best[set] = likeliest_lane(bank, set);
    for (int jumping = 0; jumping < 2; jumping++)
        for (int64_t set = 0; set < N_SETS; set++)
            if (lane_jumps(memory->best[set]) == jumping) memory->wanted[n++] = memory->best[set];
    for (int64_t first = 0; first < n; first += FB_LANES) {
        const int64_t count = begin_found(bank, memory->wanted + first, n - first, trail, normal, memory, work);
        for (int64_t l = 0; l < count; l++) {
            const int64_t worst = least_likely_lane(bank, LANE_HYPOTHESIS[memory->wanted[first + l]]);
            if (finite_or_lowest(memory->near[PLAIN_LIKELIHOOD][l]) > likelihood_of(bank, worst))
                replace_lane(bank, worst, memory->near, l, PLAIN_NUMBERS, memory->changed);
        }
    }
    conclude_renewal(bank, 0, N_PLANNED, memory->changed);
}

/* Whether a lane begins with the same jumps as another of its hypothesis, and has found the same. */
static int is_alike(Bank *bank, int64_t lane, int64_t other)
{
    const int64_t first = LANE_JUMP_ROW[lane], count = LANE_JUMP_ROW[lane + 1] - first;
    if (LANE_JUMP_ROW[other + 1] - LANE_JUMP_ROW[other] != count) return 0;
    for (int64_t e = 0; e < count; e++)
        if (LANE_JUMP_STATE[first + e] != LANE_JUMP_STATE[LANE_JUMP_ROW[other] + e]) return 0;
    for (int64_t k = AT_PARAMETERS; k < AT_SLOT; k++) {
        const double variance = *number_of_step(bank, other, PLAIN_PLACE(k, k));
        const double off = fabs(*number_of_step(bank, lane, k) - *number_of_step(bank, other, k));
        if (!(off / (SAME * sqrt(variance < 0.0 ? 0.0 : variance) + TINY) <= 1.0)) return 0;
    }
    return 1;
}

/* Which lanes of a set begin again: those within `reach` of its likeliest. Of lanes alike the likeliest stands for
   all. */
static void find_alike(Bank *bank, int64_t set, double reach, StepMemory *memory)
{
    int64_t *stands_for = memory->stands_for, n_known = 0;
    const double least = likelihood_of(bank, memory->best[set]) - reach;
    for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++)
        stands_for[lane] = likelihood_of(bank, lane) >= least ? NEAR : NOT_AGAIN;
    for (;;) {
        int64_t lane = -1, same = 0;
        for (int64_t k = FIRST_LANE[set]; k < FIRST_LANE[set + 1]; k++)
            if (stands_for[k] == NEAR && (lane < 0 || likelihood_of(bank, k) > likelihood_of(bank, lane))) lane = k;
        if (lane < 0) return;
        while (same < n_known && !is_alike(bank, lane, memory->known[same])) same++;
        if (same == n_known) memory->known[n_known++] = lane;
        stands_for[lane] = memory->known[same];
    }
}

/* Which lanes begin again, and for whom; gives how many. */
static int64_t find_wanted(Bank *bank, StepMemory *memory)
{
    int64_t n = 0;
    double most = LOWEST;
    for (int64_t set = 0; set < N_SETS; set++) {
        memory->best[set] = likeliest_lane(bank, set);
        if (likelihood_of(bank, memory->best[set]) > most) most = likelihood_of(bank, memory->best[set]);
    }
    for (int64_t set = 0; set < N_SETS; set++)
        find_alike(bank, set, likelihood_of(bank, memory->best[set]) > most - IN_REACH ? IN_REACH : 0.0, memory);
    for (int jumping = 0; jumping < 2; jumping++)
        for (int64_t lane = 0; lane < N_PLANNED; lane++)
            if (memory->stands_for[lane] == lane && lane_jumps(lane) == jumping) memory->wanted[n++] = lane;
    return n;
}

/* Begin every filter that may come to lead again at the onset, from what it has found itself.

   These are the best of each hypothesis and, of hypotheses within reach of the best, all within reach of its best. What
   a filter has once linearised far from the truth stays in its covariance. It then follows the data too well, and over
   thousands of samples its likelihood passes that of filters which began nearer. It is kept as it was where the new
   beginning led astray. All others go on from the best of their hypothesis, as little likely as they were. */
static void renew_all_steps(Bank *bank, const Trail *trail, const Normal *normal, StepMemory *memory,
                            Filter_plain *work)
{
    find_onsets(trail, trail->alarm, &memory->onsets);
    memset(memory->changed, 0, sizeof memory->changed);
    const int64_t n = find_wanted(bank, memory);
    for (int64_t first = 0; first < n; first += FB_LANES) {
        const int64_t count = begin_found(bank, memory->wanted + first, n - first, trail, normal, memory, work);
        for (int64_t l = 0; l < count; l++) {
            const int64_t chosen = memory->wanted[first + l], set = LANE_HYPOTHESIS[chosen];
            const double again = finite_or_lowest(memory->near[PLAIN_LIKELIHOOD][l]);
            for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++)
                if (memory->stands_for[lane] == chosen && again > likelihood_of(bank, lane) - ASTRAY)
                    replace_lane(bank, lane, memory->near, l, PLAIN_NUMBERS, memory->changed);
        }
    }
    for (int64_t lane = 0; lane < N_PLANNED; lane++) {
        const int64_t best = memory->best[LANE_HYPOTHESIS[lane]];
        if (memory->stands_for[lane] == NOT_AGAIN)
            replace_lane(bank, lane, bank->steps[best / FB_LANES], best % FB_LANES, PLAIN_LIKELIHOOD, memory->changed);
    }
    conclude_renewal(bank, 0, N_PLANNED, memory->changed);
}

#endif
