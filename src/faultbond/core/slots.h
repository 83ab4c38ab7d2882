/* Lanes with a slot: begun at the alarm, carried on sample by sample, begun again from what they have found.

   Drifts and faults of instruments begin at the onsets that are tried. A fault that comes and goes needs no onset: each
   of its pairs of lanes, fault there and fault gone, begins healthy at the oldest sample kept, and before each sample
   every lane of a pair becomes the mixture of both, as likely as the fault is to come or go.
   Source: Blom and Bar-Shalom, IEEE Trans. Automatic Control 33 (1988) 780 (interacting multiple models). In the same way
   what moves comes to stay, but for good: see ramps.h.

   When which lanes do stands in work.h. Formulas: docs/method.md, "The bank". */
#ifndef FB_SLOTS_H
#define FB_SLOTS_H

#include "all_along.h"
#include "onsets.h"

#define SWITCHING (1.0 / 300.0) /* probability per sample that a fault that comes and goes does so */
#define EARLY_SWITCHING 2.061153622438558e-9 /* the same where no onset is sought, exp(-20) */
#define WALK 12                 /* steps in which a fault comes up that takes a while to settle */
#define RENEWED_KINDS 5         /* of an instrument: bias, gain, drifts of both, stuck */
#define N_PAIRS ((N_SLOT_LANES - SWITCHED) / 2)

/* From what lanes begin: the healthy lane at one place, and what was seen up to there. */
typedef struct {
    double healthy[PLAIN_NUMBERS];
    double wide[WIDE_NUMBERS], old[WIDE_NUMBERS]; /* with an empty slot; with what was learned since long ago in doubt */
    double step;                                  /* usual s from sample to sample */
    int64_t n_seen;
    int all_along;                                /* 1: faults have been there since before the samples that are kept */
} SlotStart;

/* Lanes of one fault that are begun again as one: the likeliest, the least likely, and that whose start it has. */
typedef struct {
    int64_t best, worst, spread;
} Renewed;

/* Memory of these lanes, apart from the stack. */
typedef struct {
    lanes there[WIDE_NUMBERS], gone[WIDE_NUMBERS]; /* pairs side by side */
    lanes apart[2][WIDE_JOINT], kept[2], ready[2], found[2][2 * N_OUTPUTS];
    SlotStart start;
    Renewed renewed[FB_ROOM(2 * N_SETS + RENEWED_KINDS * N_INSTRUMENTS)];
    double plain[PLAIN_NUMBERS], sample[N_SAMPLE];
    double moves[WIDE_NUMBERS][FB_LANES], stays[WIDE_NUMBERS][FB_LANES]; /* see ramps.h */
} SlotMemory;

/* Where number i of z stands in that of a wide lane. */
static inline int place_in_wide(int i) { return i < AT_SLOT ? i : i + 2; }

/* A plain lane as one with an empty slot; its roles are zero. */
static void widen(const double *plain, double *wide)
{
    memset(wide, 0, WIDE_NUMBERS * sizeof *wide);
    for (int i = 0; i < PLAIN_JOINT; i++) {
        const int row = place_in_wide(i);
        wide[row] = plain[i];
        for (int j = i; j < PLAIN_JOINT; j++) wide[WIDE_PLACE(row, place_in_wide(j))] = plain[PLAIN_PLACE(i, j)];
    }
    for (int k = 0; k < N_IMPLICIT; k++) wide[WIDE_IMPLICIT + k] = plain[PLAIN_IMPLICIT + k];
    wide[WIDE_LIKELIHOOD] = plain[PLAIN_LIKELIHOOD];
}

/* A wide lane without its slot; `weight` times its size is added to a parameter (-1: to none). */
static void narrow(const double *wide, double weight, int parameter, double *plain)
{
    const int target = parameter >= 0 ? AT_PARAMETERS + parameter : -1;
    for (int i = 0; i < PLAIN_JOINT; i++) {
        const int row = place_in_wide(i);
        plain[i] = wide[row] + (i == target ? weight * wide[AT_SLOT] : 0.0);
        for (int j = i; j < PLAIN_JOINT; j++) {
            const int column = place_in_wide(j);
            double sum = wide[WIDE_PLACE(row, column)];
            if (i == target)
                sum += weight * wide[column < AT_SLOT ? WIDE_PLACE(column, AT_SLOT) : WIDE_PLACE(AT_SLOT, column)];
            if (j == target) sum += weight * wide[WIDE_PLACE(row, AT_SLOT)]; /* as i <= j, it is before the slot too */
            if (i == target && j == target) sum += weight * weight * wide[WIDE_PLACE(AT_SLOT, AT_SLOT)];
            plain[PLAIN_PLACE(i, j)] = sum;
        }
    }
    for (int k = 0; k < N_IMPLICIT; k++) plain[PLAIN_IMPLICIT + k] = wide[WIDE_IMPLICIT + k];
    plain[PLAIN_LIKELIHOOD] = wide[WIDE_LIKELIHOOD];
}

FB_SELDOM

/* A plain lane of `healthy`, whose parameters may have learned wrongly since `old`: they are as they were then, and all that they
   have moved by since may as well be true. Only along that way are they less known, and none by itself: what was read up to now
   still says what they come to together. */
static void doubted(const double *healthy, const double *old, double *lane)
{
    memcpy(lane, healthy, PLAIN_NUMBERS * sizeof *lane);
    for (int i = AT_PARAMETERS; i < AT_SLOT; i++) {
        lane[i] = old[i];
        for (int j = i; j < AT_SLOT; j++) lane[PLAIN_PLACE(i, j)] += (healthy[i] - old[i]) * (healthy[j] - old[j]);
    }
}

/* What its size adds for each of it to what sensor j reads, or to what that shows while it is stuck, SI. A gain multiplies what the
   sensor shows in its own unit, y = z + (1 + size) (h - z) with z where that is 0: in degC it is none of kelvin. */
static inline double adds_to_reading(int64_t k, int j)
{
    if (SLOT_SCALES[k]) return -OUTPUT_ZERO[j];
    return SLOT_KIND[k] != KIND_NOISE ? OUTPUT_NOISE[j] : 0.0;
}

/* The roles of lane k of the plan: on what its slot acts. */
static void set_roles(int64_t k, double (*block)[GROUP], int l)
{
    for (int64_t i = WIDE_ROLES; i < WIDE_LIKELIHOOD; i++) block[i][l] = 0.0;
    block[ROLE_MOVES][l] = 1.0;
    block[ROLE_FADES][l] = SLOT_LAG[k] > 0.0 ? 1.0 / SLOT_LAG[k] : 0.0;
    block[ROLE_KEEPS][l] = SLOT_KEEPS[k];
    for (int j = 0; j < N_OUTPUTS; j++) block[ROLE_READS + j][l] = block[ROLE_NOISE + j][l] = 1.0;
    for (int i = 0; i < N_INPUTS; i++) block[ROLE_OBEYS + i][l] = !(SLOT_STICKS[k] && SLOT_INPUT[k] == i);
    if (SLOT_PARAMETER[k] >= 0) block[ROLE_THETA + SLOT_PARAMETER[k]][l] = SLOT_ACTS[k];
    if (SLOT_INPUT[k] >= 0) {
        const int scales = SLOT_SCALES[k]; /* what the input is in its own unit, see adds_to_reading */
        block[ROLE_INPUT + SLOT_INPUT[k]][l] = scales ? -INPUT_ZERO[SLOT_INPUT[k]] : SLOT_ACTS[k];
        block[ROLE_INPUT_GAIN + SLOT_INPUT[k]][l] = scales;
    }
    if (SLOT_OUTPUT[k] >= 0) {
        const int j = SLOT_OUTPUT[k];
        block[ROLE_READS + j][l] = !(SLOT_STICKS[k] && SLOT_ACTS[k]);
        block[ROLE_GAIN + j][l] = SLOT_SCALES[k];
        block[ROLE_BIAS + j][l] = SLOT_ACTS[k] ? adds_to_reading(k, j) : 0.0;
        block[ROLE_NOISE + j][l] = SLOT_NOISE[k];
    }
}

/* The last value of a sensor among the first samples; 0 if it has had none. */
static double last_reading(const Trail *trail, int64_t n_seen, int j)
{
    for (int64_t place = n_seen - 1; place >= 0; place--)
        if (sample_at(trail, place)[SAMPLE_USE + j] != 0.0) return sample_at(trail, place)[SAMPLE_Y + j];
    return 0.0;
}

/* Time from sample to sample, s: that of the model, else the mean of the first samples, or 1. */
static double usual_step(const Trail *trail, int64_t n_seen)
{
    if (SAMPLE_TIME > 0.0) return SAMPLE_TIME;
    double sum = 0.0;
    for (int64_t place = 0; place < n_seen; place++) sum += sample_at(trail, place)[SAMPLE_DT];
    return sum != 0.0 ? sum / (double)n_seen : 1.0;
}

/* Make ready to begin lanes from a healthy lane, having seen the first samples; `old`: see `Trail`, or NULL. */
static void prepare_slots(const Trail *trail, const double *healthy, int64_t n_seen, const double *old,
                          SlotMemory *memory)
{
    SlotStart *start = &memory->start;
    memcpy(start->healthy, healthy, sizeof start->healthy);
    widen(start->healthy, start->wide);
    if (old) {
        doubted(start->healthy, old, memory->plain);
        widen(memory->plain, start->old);
    } else {
        memcpy(start->old, start->wide, sizeof start->old);
    }
    start->step = usual_step(trail, n_seen);
    start->n_seen = n_seen;
    start->all_along = old && trail->all_along;
}

/* Begin lane k of the plan in a block; its likelihood is that of the healthy lane. peak: [N_INPUTS], the largest size
   of each input so far, SI. Sizes and rates are in the units that `SLOT_SIZE` has: parameters in what they are now,
   sensors in their noise, inputs in their peak; gains have none. */
static void begin_slot(int64_t k, const Trail *trail, const double *peak, const SlotStart *start,
                       double (*block)[GROUP], int l)
{
    const int parameter = SLOT_PARAMETER[k], input = SLOT_INPUT[k], output = SLOT_OUTPUT[k];
    const double *from = SLOT_OLD[k] ? start->old : start->wide;
    double unit = 1.0, size;
    if (parameter >= 0 && HEALTHY[parameter] != 0.0) unit = start->healthy[AT_PARAMETERS + parameter];
    else if (input >= 0 && !SLOT_SCALES[k] && peak[input] != 0.0) unit = peak[input];
    const double per = SLOT_LAG[k] > 0.0 ? SLOT_LAG[k] : start->step; /* seconds that rates are stated for */
    const double sd = SLOT_SIZE_SD[k] * unit, rate_sd = SLOT_RATE_SD[k] * unit / per;
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) block[i][l] = from[i];
    set_roles(k, block, l);
    if (!SLOT_STICKS[k]) size = SLOT_SIZE[k] * unit;
    else if (input >= 0) size = sample_at(trail, start->n_seen > 0 ? start->n_seen - 1 : 0)[SAMPLE_U + input];
    else size = last_reading(trail, start->n_seen, output) / OUTPUT_NOISE[output];
    block[AT_SLOT][l] = size;
    block[WIDE_PLACE(AT_SLOT, AT_SLOT)][l] = sd * sd;
    block[AT_SLOT + 1][l] = SLOT_RATE[k] * unit / per;
    block[WIDE_PLACE(AT_SLOT + 1, AT_SLOT + 1)][l] = rate_sd * rate_sd;
}

/* By how much an input is off for each of the size of lane k of the plan, while it reads u. */
static double changes_input(int64_t k, double u) { return SLOT_SCALES[k] ? u - INPUT_ZERO[SLOT_INPUT[k]] : SLOT_ACTS[k]; }

/* What lane k of the plan, whose fault has been there all along, does like a parameter, or in the place of a slow error: by how much
   that would be off for each of its size; `place`: where that stands in a lane, -1: nowhere. An input does what the parameter does
   with which alone it acts, theta u (1 + change / u), or which acts as it does. */
static double acts_like(int64_t k, const Trail *trail, int64_t n_seen, double (*block)[GROUP], int l, int *place)
{
    const int output = SLOT_OUTPUT[k], input = SLOT_INPUT[k];
    *place = -1;
    if (SLOT_PARAMETER[k] >= 0) {
        *place = AT_PARAMETERS + SLOT_PARAMETER[k];
        return SLOT_ACTS[k];
    }
    if (input >= 0) {
        const double u = sample_at(trail, n_seen - 1)[SAMPLE_U + input];
        if (INPUT_FACTOR[input] >= 0 && u != 0.0) {
            *place = AT_PARAMETERS + INPUT_FACTOR[input];
            return block[*place][l] * changes_input(k, u) / u;
        }
        if (INPUT_TERM[input] < 0) return 0.0;
        *place = AT_PARAMETERS + INPUT_TERM[input];
        return INPUT_TERM_PART[input] * changes_input(k, u);
    }
    if (SLOW_OF_OUTPUT[output] < 0) return 0.0;
    *place = AT_SLOW + SLOW_OF_OUTPUT[output];
    if (SLOT_SCALES[k]) return SLOT_ACTS[k] * (last_reading(trail, n_seen, output) - OUTPUT_ZERO[output]);
    return SLOT_ACTS[k] * adds_to_reading(k, output);
}

/* Let the states of a wide lane go with its slot, as the fault of lane k of the plan has been there all along: as they do with what it
   acts like, and those that follow an input with that. */
static void go_along(int64_t k, const Trail *trail, int64_t n_seen, double (*block)[GROUP], int l)
{
    int place;
    double by[FB_ROOM(WIDE_JOINT)];
    if (SLOT_STICKS[k] || SLOT_KIND[k] == KIND_NOISE || SLOT_SETTLING[k] > 0.0) return;
    const double each = acts_like(k, trail, n_seen, block, l, &place), variance = block[WIDE_PLACE(AT_SLOT, AT_SLOT)][l];
    const double own = place < 0 ? 0.0 : block[WIDE_PLACE(place, place)][l];
    for (int i = 0; i < WIDE_JOINT; i++) {
        const int goes = own > 0.0 && (i < AT_SLOW || i > AT_SLOT + 1);
        by[i] = goes ? each / own * block[i < place ? WIDE_PLACE(i, place) : WIDE_PLACE(place, i)][l] : 0.0;
    }
    for (int i = 0; i < N_STATES; i++)
        if (SLOT_INPUT[k] >= 0 && START_INPUT[i] == SLOT_INPUT[k])
            by[i] += changes_input(k, sample_at(trail, n_seen - 1)[SAMPLE_U + START_INPUT[i]]);
    for (int i = 0; i < WIDE_JOINT; i++) {
        block[i][l] += by[i] * block[AT_SLOT][l];
        for (int j = i; j < WIDE_JOINT; j++) block[WIDE_PLACE(i, j)][l] += by[i] * by[j] * variance;
        block[i < AT_SLOT ? WIDE_PLACE(i, AT_SLOT) : WIDE_PLACE(AT_SLOT, i)][l] += by[i] * variance;
    }
}

/* Let lane k of the plan, a bias, be that of one more instrument in a lane whose own slot does not move. */
static void begin_beside(int64_t k, const double *peak, double (*block)[GROUP], int l)
{
    const int input = SLOT_INPUT[k], rate = AT_SLOT + 1;
    const double unit = input >= 0 && peak[input] != 0.0 ? peak[input] : 1.0, sd = SLOT_SIZE_SD[k] * unit;
    if (input >= 0) block[ROLE_INPUT_BESIDE + input][l] = 1.0;
    else block[ROLE_BIAS_BESIDE + SLOT_OUTPUT[k]][l] = OUTPUT_NOISE[SLOT_OUTPUT[k]];
    block[ROLE_MOVES][l] = block[rate][l] = 0.0;
    block[WIDE_PLACE(rate, rate)][l] = sd * sd;
}

/* Let a fault that takes a while to settle come up within that time: until then its size walks at random from where it is,
   with steps that together are as wide as the start of the lane says. */
static void begin_walk(int64_t k, const Trail *trail, int64_t onset, double (*block)[GROUP], int l, Walk *walk)
{
    const int size = WIDE_PLACE(AT_SLOT, AT_SLOT);
    int64_t n = 0;
    double elapsed = 0.0;
    if (!(SLOT_SETTLING[k] > 0.0)) return;
    for (int64_t place = onset; place < trail->n; place++) {
        elapsed += sample_at(trail, place)[SAMPLE_DT];
        n += elapsed <= SLOT_SETTLING[k];
    }
    if (n == 0) return;
    walk->samples[l] = n;
    walk->steps[l] = n < WALK ? n : WALK;
    walk->variance[l] = block[size][l] / (double)walk->steps[l];
    block[size][l] = 0.0;
}

/* Whether a step of a walk begins at sample t of it; where the steps cannot be of one length, the first are longer by
   one. */
static int begins_step(int64_t samples, int64_t steps, int64_t t)
{
    if (t >= samples) return 0;
    const int64_t length = samples / steps, longer = samples % steps * (length + 1);
    return t < longer ? t % (length + 1) == 0 : (t - longer) % length == 0;
}

/* Let the sizes of lanes walk at sample t; `part`: the first of them in their group. */
static void walk_on(const Walk *walk, int64_t t, int part, lanes *lane)
{
    double more[FB_LANES];
    for (int l = 0; l < FB_LANES; l++)
        more[l] = begins_step(walk->samples[part + l], walk->steps[part + l], t) ? walk->variance[part + l] : 0.0;
    lane[WIDE_PLACE(AT_SLOT, AT_SLOT)] += load(more);
}

FB_OFTEN

/* Take one sample, as lanes of the bank have it, into vectors of wide lanes; leaves the innovations in the filter. */
static void step_wide(lanes *lane, const double *sample, const Normal *normal, Filter_wide *filter)
{
    if (drifts(normal)) drift_on(normal, sample[SAMPLE_DT], lane, WIDE_JOINT);
    filter_step_wide(lane, sample, filter->innovations, filter);
}

/* Take samples of the trail, or after it, from one place up to another into a group of wide lanes. walk: of sizes, from
   place `onset` on; NULL: none walks. standing: the place at which they stand already; -1: none. */
static void run_slots(double (*block)[GROUP], const Trail *trail, int64_t from, int64_t end, int64_t onset, const Walk *walk,
                      int64_t standing, const Normal *normal, double *sample, Filter_wide *filter)
{
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) filter->lane[i] = load(block[i] + part);
        for (int64_t place = from; place < end; place++) {
            bank_sample(sample_at(trail, place), sample);
            if (place == standing) stand_at(sample);
            if (walk) walk_on(walk, place - onset, part, filter->lane);
            step_wide(filter->lane, sample, normal, filter);
        }
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) store(block[i] + part, filter->lane[i]);
    }
}

/* Let the lanes that fill up the last block repeat its first. */
static void fill_up_slots(Bank *bank)
{
    if (N_SLOT_LANES == 0) return;
    double (*block)[GROUP] = bank->slots[(N_SLOT_LANES - 1) / GROUP];
    for (int64_t l = (N_SLOT_LANES - 1) % GROUP + 1; l < GROUP; l++)
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) block[i][l] = block[i][0];
}

/* Put some lanes of vectors into their places in the bank: lane l becomes lane first + l * apart. */
static void put_slots(Bank *bank, int64_t first, int64_t apart, int64_t n, const lanes *from)
{
    double *to[FB_LANES], numbers[FB_LANES];
    for (int64_t l = 0; l < n; l++) to[l] = number_of_slot(bank, first + l * apart, 0);
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
        store(numbers, from[i]);
        for (int64_t l = 0; l < n; l++) to[l][i * GROUP] = numbers[l];
    }
}

/* Take lanes of the bank into vectors, in the same way; the first of them fills up. */
static void take_slots(Bank *bank, int64_t first, int64_t apart, int64_t n, lanes *to)
{
    const double *from[FB_LANES];
    double numbers[FB_LANES];
    for (int64_t l = 0; l < FB_LANES; l++) from[l] = number_of_slot(bank, first + (l < n ? l * apart : 0), 0);
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
        for (int64_t l = 0; l < FB_LANES; l++) numbers[l] = from[l][i * GROUP];
        to[i] = load(numbers);
    }
}

/* How many of n lanes from `first` on are computed at a time, and how many are in a group. */
static inline int64_t in_block(int64_t first, int64_t n) { return n - first < FB_LANES ? n - first : FB_LANES; }
static inline int64_t in_group(int64_t first, int64_t n) { return n - first < GROUP ? n - first : GROUP; }

FB_SELDOM

/* Whether a lane may be in a couple. What stays follows from what moves, and of two steps there are sets. */
static inline int is_for_couples(int64_t k)
{
    return SLOT_KIND[k] != KIND_NOISE && SLOT_KIND[k] != KIND_RAMP && SLOT_KIND[k] != KIND_STEP;
}

/* Whether lanes of this fault are begun again: all that may be in a couple, and steps. What begins again has the better onset:
   were it not begun again by itself, a needless second suspect would bring that. */
static inline int is_renewed(int64_t k) { return is_for_couples(k) || SLOT_KIND[k] == KIND_STEP; }

/* Whether they then begin at what was found: drifts of parameters and inputs, biases and gains of inputs, and steps that lag,
   which the plant bends. All others begin as at first. */
static inline int is_of_found(int64_t k)
{
    if (SLOT_LAG[k] > 0.0) return 1;
    return SLOT_OUTPUT[k] < 0 && (SLOT_KIND[k] == KIND_DRIFT || SLOT_KIND[k] == KIND_BIAS || SLOT_KIND[k] == KIND_GAIN);
}

/* Note what lane k of the plan has found, its size and rate, as they were `elapsed` s before; of what lags where its size ends,
   d + r T, since the rate fades. */
static void note_slot(int64_t k, double size, double rate, double elapsed, double *found)
{
    found[0] = SLOT_LAG[k] > 0.0 ? size + rate * SLOT_LAG[k] : size - rate * elapsed;
    found[1] = rate;
}

/* Let lane l of a group begin at what was found of lane k of the plan, `elapsed` s before. */
static void begin_at_found(int64_t k, const double *found, double elapsed, double (*group)[GROUP], int l)
{
    if (SLOT_LAG[k] > 0.0) {
        group[AT_SLOT + 1][l] = found[0] / SLOT_LAG[k];
    } else {
        group[AT_SLOT][l] = found[0] - found[1] * elapsed;
        group[AT_SLOT + 1][l] = found[1];
    }
}

/* Begin a group of lanes of the plan at an onset. Where they begin again, found holds what `note_slot` noted at the end of the
   trail; NULL: they have found nothing. */
static void begin_slots(const int64_t *lane, double (*found)[FOUND], const Trail *trail, int64_t onset, const double *peak,
                        double (*group)[GROUP], Walk *walk, SlotMemory *memory)
{
    double elapsed = 0.0; /* from before the onset */
    for (int64_t place = onset; found && place < trail->n; place++) elapsed += sample_at(trail, place)[SAMPLE_DT];
    prepare_slots(trail, before_onset(trail, onset), onset, trail->old, memory);
    for (int l = 0; l < GROUP; l++) {
        begin_slot(lane[l], trail, peak, &memory->start, group, l);
        walk->samples[l] = walk->steps[l] = 0;
        walk->variance[l] = 0.0;
        if (found && is_of_found(lane[l])) begin_at_found(lane[l], found[l], elapsed, group, l);
        else begin_walk(lane[l], trail, onset, group, l, walk);
        if (memory->start.all_along) go_along(lane[l], trail, onset, group, l);
    }
}

FB_OFTEN

/* A mixture of weight w of one number and the rest of another; what has no weight may be anything. */
static inline lanes blend(lanes w, lanes own, lanes other)
{
    const lanes none = broadcast(0.0);
    return choose(w > 0.0, w * own, none) + choose(w < 1.0, (1.0 - w) * other, none);
}

/* Log-likelihood of mixtures of `own` that stays and `other` that comes over, and the weight of the first. stay, come:
   logarithms of their probabilities. */
static lanes weigh_each(lanes own, lanes other, const double *stay, const double *come, lanes *weight)
{
    double a[FB_LANES], b[FB_LANES];
    store(a, own);
    store(b, other);
    for (int l = 0; l < FB_LANES; l++) {
        const double one = finite_or_lowest(a[l]) + stay[l], total = log_add(one, finite_or_lowest(b[l]) + come[l]);
        a[l] = total;
        b[l] = exp(one - total);
    }
    *weight = load(b);
    return load(a);
}

/* The same where the probabilities are those of all lanes. */
static lanes weigh(lanes own, lanes other, double stay, double come, lanes *weight)
{
    double stays[FB_LANES], comes[FB_LANES];
    for (int l = 0; l < FB_LANES; l++) {
        stays[l] = stay;
        comes[l] = come;
    }
    return weigh_each(own, other, stays, comes, weight);
}

/* Probabilities, in logarithm, that a lane of a pair stays in its mode, and comes over to it from the other. */
typedef struct {
    double there_stays[FB_LANES], there_comes[FB_LANES], gone_stays[FB_LANES], gone_comes[FB_LANES];
} Exchange;

/* Let the two lanes of each pair mix: each becomes what both say of a plant that is now in its mode, with mean,
   covariance and likelihood of the mixture. Roles stay. What each keeps of its own is left in the memory. */
static void mix_modes(const Exchange *by, SlotMemory *memory)
{
    const lanes none = broadcast(0.0);
    lanes *there = memory->there, *gone = memory->gone, *one = memory->apart[0], *two = memory->apart[1], w, v;
    const lanes likelihood =
        weigh_each(there[WIDE_LIKELIHOOD], gone[WIDE_LIKELIHOOD], by->there_stays, by->there_comes, &w);
    gone[WIDE_LIKELIHOOD] = weigh_each(gone[WIDE_LIKELIHOOD], there[WIDE_LIKELIHOOD], by->gone_stays, by->gone_comes, &v);
    memory->kept[0] = w;
    memory->kept[1] = v;
    there[WIDE_LIKELIHOOD] = likelihood;
    for (int i = 0; i < WIDE_JOINT; i++) {
        one[i] = choose((w > 0.0) & (w < 1.0), there[i] - gone[i], none);
        two[i] = choose((v > 0.0) & (v < 1.0), there[i] - gone[i], none);
    }
    for (int64_t i = 0; i < WIDE_ROLES; i++) {
        const lanes first = there[i], second = gone[i];
        there[i] = blend(w, first, second);
        gone[i] = blend(v, second, first);
    }
    for (int i = 0; i < WIDE_JOINT; i++) {
        const lanes by_one = w * (1.0 - w) * one[i], by_two = v * (1.0 - v) * two[i];
        for (int j = i; j < WIDE_JOINT; j++) {
            there[WIDE_PLACE(i, j)] += by_one * one[j];
            gone[WIDE_PLACE(i, j)] += by_two * two[j];
        }
    }
}

/* Let faults come and go, with a probability; what goes has been there. */
static void interact(double switching, SlotMemory *memory)
{
    lanes *there = memory->there, *gone = memory->gone;
    const lanes was_gone = gone[ROLE_RETURNS];
    Exchange by;
    for (int l = 0; l < FB_LANES; l++) {
        by.there_stays[l] = by.gone_stays[l] = log1p(-switching);
        by.there_comes[l] = by.gone_comes[l] = log(switching);
    }
    mix_modes(&by, memory);
    gone[ROLE_RETURNS] = blend(memory->kept[1], was_gone, broadcast(1.0));
    there[ROLE_RETURNS] = blend(memory->kept[0], there[ROLE_RETURNS], was_gone);
}

/* Take one sample into a block of pairs that have mixed; leaves their likelihoods before it, and the innovations of both
   halves. */
static void step_both(const double *packed, const Normal *normal, Filter_wide *filter, SlotMemory *memory)
{
    memory->ready[0] = memory->there[WIDE_LIKELIHOOD];
    memory->ready[1] = memory->gone[WIDE_LIKELIHOOD];
    bank_sample(packed, memory->sample);
    step_wide(memory->there, memory->sample, normal, filter);
    memcpy(memory->found[0], filter->innovations, sizeof memory->found[0]);
    step_wide(memory->gone, memory->sample, normal, filter);
    memcpy(memory->found[1], filter->innovations, sizeof memory->found[1]);
}

/* The same of faults that come and go; where the model does not hold nobody knows of that. */
static void step_pairs(double switching, const double *packed, const Normal *normal, Filter_wide *filter, SlotMemory *memory)
{
    if (!IS_OUTSIDE(packed)) interact(switching, memory);
    step_both(packed, normal, filter, memory);
}

/* Put the innovations of the mixture of each pair in found[0]: with them both its lanes are judged, since while the
   fault is gone one of them does not fit. */
static void join_innovations(SlotMemory *memory)
{
    lanes *one = memory->found[0], *two = memory->found[1], weight;
    (void)weigh(memory->ready[0], memory->ready[1], 0.0, 0.0, &weight);
    for (int j = 0; j < N_OUTPUTS; j++) {
        const int variance = N_OUTPUTS + j;
        const lanes apart = choose((weight > 0.0) & (weight < 1.0), one[j] - two[j], broadcast(0.0));
        one[variance] = blend(weight, one[variance], two[variance]) + weight * (1.0 - weight) * apart * apart;
        one[j] = blend(weight, one[j], two[j]);
    }
}

FB_SELDOM

/* Probability per sample that a fault comes or goes, so many samples after the alarm. It is a prior, of which all counts where of
   likelihoods only a part does: else a fault that comes and goes follows at little cost what the model is off by. */
static double switching_after(int64_t since) { return exp(log(SWITCHING) / share_after(since)); }

/* Begin a group of pairs, healthy at the oldest sample; `there` and `gone` are their lanes, `first` the first pair. */
static void begin_pairs(int64_t first, const Trail *trail, const double *peak, double (*there)[GROUP], double (*gone)[GROUP],
                        SlotMemory *memory)
{
    const int64_t n = in_group(first, N_PAIRS);
    prepare_slots(trail, healthy_at(trail, 0), 1, NULL, memory);
    for (int l = 0; l < GROUP; l++) {
        const int64_t lane = SWITCHED + 2 * (first + (l < n ? l : 0));
        begin_slot(lane, trail, peak, &memory->start, there, l);
        begin_slot(lane + 1, trail, peak, &memory->start, gone, l);
        there[WIDE_LIKELIHOOD][l] = LOWEST; /* healthy so far */
    }
}

FB_OFTEN

/* Take samples of the trail, or after it, from one place up to another into a group of pairs. */
static void run_pairs(double (*there)[GROUP], double (*gone)[GROUP], const Trail *trail, int64_t from, int64_t end,
                      const Normal *normal, Filter_wide *filter, SlotMemory *memory)
{
    for (int part = 0; part < GROUP; part += FB_LANES) {
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            memory->there[i] = load(there[i] + part);
            memory->gone[i] = load(gone[i] + part);
        }
        for (int64_t place = from; place < end; place++)
            step_pairs(place < trail->first ? EARLY_SWITCHING : switching_after(place - trail->alarm), sample_at(trail, place),
                       normal, filter, memory);
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
            store(there[i] + part, memory->there[i]);
            store(gone[i] + part, memory->gone[i]);
        }
    }
}

/* Give a lane with a slot the numbers of lane l of a group. */
static void put_slot(Bank *bank, int64_t lane, double (*group)[GROUP], int64_t l)
{
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) *number_of_slot(bank, lane, i) = group[i][l];
}

/* Write innovations of lanes, those of lane l to the place of lane first + l * apart. */
static void put_innovations(const lanes *found, int64_t first, int64_t apart, int64_t n, double *innovations,
                            int64_t stride)
{
    double numbers[FB_LANES];
    for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) {
        store(numbers, found[i]);
        for (int64_t l = 0; l < n; l++) innovations[i * stride + first + l * apart] = numbers[l];
    }
}

/* The same of lanes that expect nothing: 0, of variance 1. */
static void put_none(int64_t first, int64_t n, double *innovations, int64_t stride)
{
    for (int64_t i = 0; i < 2 * N_OUTPUTS; i++)
        for (int64_t l = first; l < first + n; l++) innovations[i * stride + l] = i < N_OUTPUTS ? 0.0 : 1.0;
}

/* Take one more packed sample into the lanes with a slot, of which the first n_begun have begun. `since`: samples
   after the alarm. innovations:
   [2 * N_OUTPUTS][stride], measured less expected readings, then their variances, of the lanes in order; those of a pair
   have the innovations of their mixture. */
static void advance_slots(Bank *bank, int64_t n_begun, int64_t since, const double *packed, const Normal *normal,
                          double *innovations, int64_t stride, Filter_wide *filter, SlotMemory *memory)
{
    const double switching = switching_after(since);
    bank_sample(packed, memory->sample);
    for (int64_t first = 0; first < SWITCHED && first < n_begun; first += FB_LANES) {
        const int64_t n = in_block(first, SWITCHED);
        double (*block)[GROUP] = bank->slots[first / GROUP];
        if (bank->rests[BLOCKS(N_STEPS) + first / GROUP]) {
            put_none(first, n, innovations, stride);
            continue;
        }
        for (int64_t i = 0; i < WIDE_NUMBERS; i++) filter->lane[i] = load(block[i] + first % GROUP);
        step_wide(filter->lane, memory->sample, normal, filter);
        put_innovations(filter->innovations, first, 1, n, innovations, stride);
        if (n < FB_LANES) put_slots(bank, first, 1, n, filter->lane);
        else for (int64_t i = 0; i < WIDE_NUMBERS; i++) store(block[i] + first % GROUP, filter->lane[i]);
    }
    for (int64_t pair = 0; pair < N_PAIRS && SWITCHED + 2 * pair < n_begun; pair += FB_LANES) {
        const int64_t n = in_block(pair, N_PAIRS), first = SWITCHED + 2 * pair;
        take_slots(bank, first, 2, n, memory->there);
        take_slots(bank, first + 1, 2, n, memory->gone);
        step_pairs(switching, packed, normal, filter, memory);
        put_slots(bank, first, 2, n, memory->there);
        put_slots(bank, first + 1, 2, n, memory->gone);
        join_innovations(memory);
        put_innovations(memory->found[0], first, 2, n, innovations, stride);
        put_innovations(memory->found[0], first + 1, 2, n, innovations, stride);
    }
    fill_up_slots(bank);
}

/* The log-likelihood of a lane; that of one that is no number is below all others. */
static inline double likelihood_of_slot(Bank *bank, int64_t lane)
{
    const double likelihood = *number_of_slot(bank, lane, WIDE_LIKELIHOOD);
    return isnan(likelihood) ? -INFINITY : likelihood;
}

FB_SELDOM

/* Whether two lanes look for the same fault. */
static inline int is_same_fault(int64_t one, int64_t two)
{
    return SLOT_HYPOTHESIS[one] == SLOT_HYPOTHESIS[two] && SLOT_KIND[one] == SLOT_KIND[two] && SLOT_SCALES[one] == SLOT_SCALES[two] &&
           SLOT_KEEPS[one] == SLOT_KEEPS[two];
}

/* Find the lanes of each fault that are begun again. The spread is that of the least likely of them, or, of a bias, the
   widest: else what was found would count twice. What begins as at first has its own spread, and takes its own place. */
static int64_t find_renewed(Bank *bank, Renewed *renewed)
{
    int64_t n = 0;
    for (int64_t lane = 0; lane < SWITCHED; lane++) {
        int64_t at = 0;
        if (!is_renewed(lane)) continue;
        while (at < n && !is_same_fault(lane, renewed[at].best)) at++;
        if (at == n) {
            const Renewed alone = {lane, lane, lane};
            renewed[n++] = alone;
        }
        Renewed *group = &renewed[at];
        if (likelihood_of_slot(bank, lane) > likelihood_of_slot(bank, group->best)) group->best = lane;
        if (likelihood_of_slot(bank, lane) < likelihood_of_slot(bank, group->worst)) group->worst = lane;
        if (!is_of_found(lane) || SLOT_KIND[lane] == KIND_STEP) group->worst = group->spread = group->best;
        else if (SLOT_KIND[lane] == KIND_DRIFT) group->spread = group->worst;
        else if (SLOT_SIZE_SD[lane] > SLOT_SIZE_SD[group->spread]) group->spread = lane;
    }
    return n;
}

/* The lane of the same kind of fault that begins widest. */
static int64_t widest_slot(int64_t k)
{
    int64_t widest = k;
    for (int64_t lane = 0; lane < SWITCHED; lane++)
        if (is_same_fault(lane, k) && SLOT_SIZE_SD[lane] > SLOT_SIZE_SD[widest]) widest = lane;
    return widest;
}

/* A lane in the place of the least likely one of its fault, if it is likelier. Only where it begins, and so where it
   linearises, is what was found; the spread is that of one of the starts. Gives the lane that was changed; -1: none. */
static int64_t replace_worst_slot(Bank *bank, const Renewed *renewed, double (*group)[GROUP], int64_t l)
{
    if (!(group[WIDE_LIKELIHOOD][l] > likelihood_of_slot(bank, renewed->worst))) return -1;
    put_slot(bank, renewed->worst, group, l);
    return renewed->worst;
}

FB_OFTEN

#endif
