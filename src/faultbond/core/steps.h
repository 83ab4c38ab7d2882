/* Steps of parameters in the bank: lanes for every hypothesis and start, begun at the alarm from what was known before
   the change, and begun again from what they have found.

   A faulty parameter keeps a linear factor, since its logarithm overshoots. Single starts fail for parameters that act
   by their inverse, so each suspect starts from several sizes. A store whose own parameter changes may keep its content
   (charge, volume, momentum) or its effort or flow (a level, a speed); both happen and both are tried.

   Lanes begin in groups, each at several onsets (onsets.h); when which does stands in work.h. Formulas: docs/method.md, "The
   bank". */
#ifndef FB_STEPS_H
#define FB_STEPS_H

#include "all_along.h"
#include "onsets.h"

#define ASTRAY 10.0       /* nats by which a lane that begins from closer may be less likely, as chance has it */
#define IN_REACH 20.0     /* nats by which a filter, or a hypothesis, may lag behind the best and still come to lead */
#define ALIKE 0.3         /* standard deviations by which two filters that found the same may differ, */
#define TINY 1e-12        /* and rounding */
#define FOUND_SPREAD 0.35 /* sd of a start that was found, in starts; */
#define LEAST_CHANGE 0.05 /* the most it is allowed is at least this, in healthy factors */
#define NOT_AGAIN (-1)    /* of a lane that does not begin again */
#define NEAR (-2)         /* of one that does; from where is not known yet */

/* Where a lane begins. */
typedef struct {
    int64_t n;                           /* suspects, */
    int parameter[FB_ROOM(LARGEST_SET)]; /* which they are, */
    double value[FB_ROOM(LARGEST_SET)];  /* starts: times the healthy factor (plus it where the nominal is 0), and */
    double sd[FB_ROOM(LARGEST_SET)];     /* how far they may be off, alike */
    int jumps[FB_ROOM(N_STATES)];        /* 1: the content goes on at the change, else the effort (C) or flow (I) */
    int tied;                            /* 1: a jump is bound to the factor of its suspect, which is nearly known */
    int all_along;                       /* 1: the suspects have been off since before the samples that are kept */
} Start;

/* Memory of a call. */
typedef struct {
    PlainBlock early;
    Start starts[GROUP];
    double healthy[PLAIN_NUMBERS], later[PLAIN_NUMBERS], lane[PLAIN_NUMBERS], sample[N_SAMPLE];
    double innovations[2 * N_OUTPUTS][GROUP];
    int64_t best[FB_ROOM(N_SETS)];     /* likeliest lane of each hypothesis */
    int64_t known[FB_ROOM(N_PLANNED)]; /* lanes of a hypothesis that found different things, the likeliest first */
} StepMemory;

FB_SELDOM

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

static int any_jump(const Start *start)
{
    for (int64_t i = 0; i < N_STATES; i++)
        if (start->jumps[i]) return 1;
    return 0;
}

/* Let the effort or flow of a store jump with its suspect, entry e of JUMP, where its content goes on.

   The state x becomes x * factor**exponent, and as uncertain as the factor makes it. From a wide start it is left
   uncorrelated with the factor: linear correlation over so wide a start would fix the factor, wrongly, at the first
   measurement of x. From what was found (`tied`) it goes with the factor, else the two could part for good. */
static void let_jump(int state, int64_t e, int tied, const double *healthy, double *lane)
{
    const int k = AT_PARAMETERS + JUMP_PARAMETER[e];
    const double scale = pow_one(lane[k] / healthy[k], JUMP_EXPONENT[e]);
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
    const int all_along = start->all_along && !any_jump(start);
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
        replace_number(k, bounded(mean, LOWER[index], UPPER[index]), sd * sd, all_along, lane);
    }
    for (int state = 0; state < N_STATES; state++)
        for (int64_t e = JUMP_ROW[state]; start->jumps[state] && e < JUMP_ROW[state + 1]; e++)
            if (moves_store(start, e, healthy)) let_jump(state, e, start->tied, healthy, lane);
}

/* The lanes of a block of starts. */
static void suspect_lanes(const Start *starts, const double *healthy, double (*block)[GROUP], double *lane)
{
    for (int64_t l = 0; l < GROUP; l++) {
        suspect_lane(&starts[l], healthy, lane);
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) block[k][l] = lane[k];
    }
}

/* Let the states of a group, whose z has `joint` numbers, lie half-way between those of `early` and their own, as uncertain as that. */
static void stand_between(double (*early)[GROUP], int64_t joint, double (*late)[GROUP])
{
    for (int64_t l = 0; l < GROUP; l++) {
        double half[FB_ROOM(N_STATES)];
        for (int64_t i = 0; i < N_STATES; i++) {
            half[i] = 0.5 * (early[i][l] - late[i][l]);
            if (!isfinite(half[i])) half[i] = 0.0;
            late[i][l] += half[i];
        }
        for (int64_t i = 0; i < N_STATES; i++)
            for (int64_t j = i; j < N_STATES; j++) late[joint + IN_TRIANGLE(joint, i, j)][l] += half[i] * half[j];
    }
}

/* Lanes predicted to the sample of the onset, before its measurements, into `late`; memory: `healthy` and `sample`.

   The fault came at some moment since the sample before, so the states lie between those of a fault from that sample on
   (`early`) and of one that comes only now (`late`). */
static void begin_lanes(const Start *starts, const Normal *normal, double (*late)[GROUP], StepMemory *memory,
                        Filter_plain *work)
{
    double (*early)[GROUP] = memory->early;
    for (int64_t j = 0; j < N_OUTPUTS; j++) memory->sample[SAMPLE_USE + j] = 0.0;
    suspect_lanes(starts, memory->healthy, early, memory->lane);
    advance_plain(early, memory->sample, normal, NULL, work);
    memcpy(memory->later, memory->healthy, sizeof memory->later);
    advance_one(memory->later, memory->sample, normal, NULL, work);
    suspect_lanes(starts, memory->later, late, memory->lane);
    stand_between(early, PLAIN_JOINT, late);
}

/* Begin a group of starts at an onset: it stands at that sample, and has not taken it. */
static void begin_steps(const Start *starts, const Trail *trail, int64_t onset, const Normal *normal,
                        double (*group)[GROUP], StepMemory *memory, Filter_plain *work)
{
    memcpy(memory->healthy, before_onset(trail, onset), sizeof memory->healthy);
    const double likelihood = memory->healthy[PLAIN_LIKELIHOOD];
    bank_sample(sample_at(trail, onset), memory->sample);
    begin_lanes(starts, normal, group, memory, work);
    for (int64_t l = 0; l < GROUP; l++) group[PLAIN_LIKELIHOOD][l] = likelihood;
}

FB_OFTEN

/* Take samples of the trail, or after it, from one place up to another into a group of lanes; `standing`: the place at which
   these stand already, -1: none. */
static void run_steps(double (*group)[GROUP], const Trail *trail, int64_t from, int64_t end, int64_t standing,
                      const Normal *normal, double *sample, Filter_plain *work)
{
    const int moving = drifts(normal);
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) work->lane[k] = load(group[k] + part);
        for (int64_t place = from; place < end; place++) {
            bank_sample(sample_at(trail, place), sample);
            if (place == standing) stand_at(sample);
            if (moving) drift_on(normal, sample[SAMPLE_DT], work->lane, PLAIN_JOINT);
            filter_step_plain(work->lane, sample, work->innovations, work);
        }
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++) store(group[k] + part, work->lane[k]);
    }
}

FB_SELDOM

/* The start of a lane of the plan. */
static void planned_start(int64_t lane, Start *start)
{
    const int64_t members = SET_ROW[LANE_HYPOTHESIS[lane]];
    start->n = start->tied = start->all_along = 0;
    for (int64_t e = LANE_START[lane]; e < LANE_START[lane + 1]; e++) {
        const int64_t of = START_OF[e];
        if (!(START_SPREAD[of] > 0.0)) continue;
        start->parameter[start->n] = SET_MEMBER[members + e - LANE_START[lane]];
        start->value[start->n] = START_VALUE[of];
        start->sd[start->n++] = START_SPREAD[of];
    }
    memset(start->jumps, 0, sizeof start->jumps);
    for (int64_t e = LANE_JUMP_ROW[lane]; e < LANE_JUMP_ROW[lane + 1]; e++) start->jumps[LANE_JUMP_STATE[e]] = 1;
}

/* What a lane of a group has found of the suspects of a start. */
static void note_found(const Start *start, double (*group)[GROUP], int64_t l, double *found)
{
    for (int64_t s = 0; s < start->n; s++) found[s] = group[AT_PARAMETERS + start->parameter[s]][l];
}

/* Let a start that was run be at what its lane has found; `healthy`: the lane of the healthy plant, to which starts are
   relative. */
static void move_to_found(Start *start, const double *found, const double *healthy)
{
    for (int64_t s = 0; s < start->n; s++) {
        const int index = start->parameter[s], k = AT_PARAMETERS + index;
        const double most = CHANGE[index] > LEAST_CHANGE ? CHANGE[index] : LEAST_CHANGE;
        double least = 0.0;
        if (HEALTHY[index] == 0.0) {
            start->value[s] = found[s] - healthy[k];
            least = ACCURACY[index] < most ? ACCURACY[index] : most;
        } else {
            start->value[s] = found[s] / (healthy[k] == 0.0 ? 1.0 : healthy[k]);
        }
        start->sd[s] = bounded(FOUND_SPREAD * fabs(start->value[s]), least, most);
    }
    start->tied = 1;
}

/* Lanes that fill up the last block of steps repeat its first. */
static void fill_last_block(Bank *bank)
{
    for (int64_t lane = N_STEPS; lane % GROUP != 0; lane++)
        for (int64_t k = 0; k < PLAIN_NUMBERS; k++)
            *number_of_step(bank, lane, k) = *number_of_step(bank, lane - lane % GROUP, k);
}

FB_OFTEN

/* Whether any lane of a block has begun: one of the plan, of which so many have, or one of a set that was taken from the
   reserve. */
static int has_begun(const Bank *bank, int64_t block, int64_t n_begun)
{
    if (block * GROUP < n_begun) return 1;
    for (int64_t lane = block * GROUP; lane < N_STEPS && lane < (block + 1) * GROUP; lane++)
        if (lane >= N_PLANNED && bank->grown[(lane - N_PLANNED) / PER_SET] >= 0) return 1;
    return 0;
}

/* Take one more packed sample into the lanes of steps, of the plan into those of which the first n_begun have begun.
   innovations: of each lane measured less expected readings, then their variances; 0 and 1 of those that have not, or rest. */
static void advance_steps(Bank *bank, int64_t n_begun, const double *packed, const Normal *normal,
                          double (*innovations)[FB_ROOM(N_LANES)], StepMemory *memory, Filter_plain *work)
{
    bank_sample(packed, memory->sample);
    for (int64_t b = 0; b < BLOCKS(N_STEPS); b++) {
        const int begun = has_begun(bank, b, n_begun) && !bank->rests[b];
        if (begun) advance_plain(bank->steps[b], memory->sample, normal, memory->innovations, work);
        for (int64_t lane = b * GROUP; lane < N_STEPS && lane < (b + 1) * GROUP; lane++)
            for (int64_t k = 0; k < 2 * N_OUTPUTS; k++)
                innovations[k][lane] = begun ? memory->innovations[k][lane % GROUP] : (k < N_OUTPUTS ? 0.0 : 1.0);
    }
}

/* Log-likelihood of a lane of the bank; LOWEST where it is no number. */
static inline double likelihood_of(Bank *bank, int64_t lane)
{
    return finite_or_lowest(*number_of_step(bank, lane, PLAIN_LIKELIHOOD));
}

FB_SELDOM

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

/* Give a lane of the bank the first `count` numbers of lane l of a group; gives whether that changes it. */
static int replace_lane(Bank *bank, int64_t lane, double (*group)[GROUP], int64_t l, int64_t count)
{
    int changed = 0;
    for (int64_t k = 0; k < count; k++) {
        double *number = number_of_step(bank, lane, k);
        changed |= *number != group[k][l];
        *number = group[k][l];
    }
    return changed;
}

static inline int lane_jumps(int64_t lane) { return LANE_JUMP_ROW[lane + 1] > LANE_JUMP_ROW[lane]; }

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
        if (!(off / (ALIKE * sqrt(variance < 0.0 ? 0.0 : variance) + TINY) <= 1.0)) return 0;
    }
    return 1;
}

/* Which lanes of a set begin again: those within `reach` of its likeliest. Of lanes alike the likeliest stands for
   all; known: memory for those that stand for others. */
static void find_alike(Bank *bank, int64_t set, double reach, int64_t *stands_for, int64_t *known)
{
    int64_t n_known = 0;
    const double least = likelihood_of(bank, likeliest_lane(bank, set)) - reach;
    for (int64_t lane = FIRST_LANE[set]; lane < FIRST_LANE[set + 1]; lane++)
        stands_for[lane] = likelihood_of(bank, lane) >= least ? NEAR : NOT_AGAIN;
    for (;;) {
        int64_t lane = -1, same = 0;
        for (int64_t k = FIRST_LANE[set]; k < FIRST_LANE[set + 1]; k++)
            if (stands_for[k] == NEAR && (lane < 0 || likelihood_of(bank, k) > likelihood_of(bank, lane))) lane = k;
        if (lane < 0) return;
        while (same < n_known && !is_alike(bank, lane, known[same])) same++;
        if (same == n_known) known[n_known++] = lane;
        stands_for[lane] = known[same];
    }
}

/* Let the best filter of each hypothesis begin again, for itself alone.

   A filter that began far from the truth has linearised there, and may be stuck; the same samples, taken again from
   nearby, say more. */
static void want_best(Bank *bank, int64_t *stands_for)
{
    for (int64_t lane = 0; lane < N_PLANNED; lane++) stands_for[lane] = NOT_AGAIN;
    for (int64_t set = 0; set < N_SETS; set++) {
        const int64_t best = likeliest_lane(bank, set);
        stands_for[best] = best;
    }
}

/* Let every filter begin again that may come to lead.

   These are the best of each hypothesis and, of hypotheses within reach of the best, all within reach of its best. What
   a filter has once linearised far from the truth stays in its covariance. It then follows the data too well, and over
   thousands of samples its likelihood passes that of filters which began nearer. */
static void want_leading(Bank *bank, int64_t *stands_for, int64_t *known)
{
    double most = LOWEST;
    for (int64_t set = 0; set < N_SETS; set++) most = fmax(most, likelihood_of(bank, likeliest_lane(bank, set)));
    for (int64_t set = 0; set < N_SETS; set++) {
        const double best = likelihood_of(bank, likeliest_lane(bank, set));
        find_alike(bank, set, best > most - IN_REACH ? IN_REACH : 0.0, stands_for, known);
    }
}

/* List the lanes that begin again, those of single parameters first, of each kind those without a jump first, which begin
   once; gives how many are of single parameters, and in n how many in all. */
static int64_t list_wanted(const int64_t *stands_for, int64_t *wanted, int64_t *n)
{
    int64_t n_singles = 0;
    *n = 0;
    for (int larger = 0; larger < 2; larger++) {
        for (int jumping = 0; jumping < 2; jumping++)
            for (int64_t lane = larger ? N_SINGLE_LANES : 0; lane < (larger ? N_PLANNED : N_SINGLE_LANES); lane++)
                if (stands_for[lane] == lane && lane_jumps(lane) == jumping) wanted[(*n)++] = lane;
        if (!larger) n_singles = *n;
    }
    return n_singles;
}

/* A lane in the place of the least likely one of its hypothesis, if it is likelier. Gives the lane that was changed; -1: none. */
static int64_t replace_worst(Bank *bank, int64_t set, double (*group)[GROUP], int64_t l)
{
    const int64_t worst = least_likely_lane(bank, set);
    if (!(finite_or_lowest(group[PLAIN_LIKELIHOOD][l]) > likelihood_of(bank, worst))) return -1;
    return replace_lane(bank, worst, group, l, PLAIN_NUMBERS) ? worst : -1;
}

FB_OFTEN

#endif
