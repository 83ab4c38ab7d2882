/* Many assets of one model, watched side by side: lanes are assets. All of them see the same times, and each has its own
   inputs and readings.

   FB_LANES assets take the usual way of a sample together, by the same text as one plant (watching.h, filter.h). For which of
   them a sample is not usual, as after a missing input or at a surprise, is told by flags on the way; these go back to where
   they stood, and take the sample alone, by the way of one plant (alone.h).

   What is kept of an asset is small: what is remembered of a plant that is watched, but neither trail nor bank; the last
   samples as they were told; and what was remembered a while ago. A whole state is made from these when it is needed, since
   what it holds follows from what was remembered then and the samples since. */
#ifndef FB_FLEET_H
#define FB_FLEET_H

#include <stddef.h>

#include "plant.h"

#define KEPT_EVERY ((DEPTH + 1) / 2)                       /* samples; what is remembered is kept once in so many, */
#define N_KEPT 3                                           /* and is still there after DEPTH more */
#define TOLD (DEPTH + KEPT_EVERY)                          /* samples that are kept as they were told */
#define TIMES (TOLD + KEPT_EVERY)                        /* times that are kept: those of a block stand there before its samples do */
#define N_TOLD (N_INPUTS + N_OUTPUTS)

/* Numbers of one asset: all that is remembered of it, these but the lanes kept for long, and what was accepted. */
enum {
    N_WATCHED = (int)(sizeof(Watched) / sizeof(double)),
    N_LIVE = (int)(offsetof(Watched, healthy.snapshots) / sizeof(double)),
    N_NORMAL = (int)(sizeof(Normal) / sizeof(double))
};

enum { AWAY, USUAL, CHANGED }; /* where an asset is: elsewhere, or none; here; here, and a diagnosis of it was accepted */

/* FB_LANES assets; number k of asset l is [k][l]. */
typedef struct {
    double watched[N_WATCHED][FB_LANES];
    double kept[N_KEPT][N_LIVE][FB_LANES]; /* the same as it was before samples whose number is divided by KEPT_EVERY, in turn */
    double told[TOLD][N_TOLD][FB_LANES];   /* inputs and readings; those of sample k are told[k % TOLD] */
    double normal[N_NORMAL][FB_LANES];     /* what was accepted */
    int64_t place[FB_LANES];               /* where each is, */
    int64_t left[FB_LANES];                /* and the sample before which it went elsewhere; -1: never */
} Group;

/* What all assets share; the groups follow. */
typedef struct {
    int64_t n_assets, index, spare[6];              /* how many; samples seen */
    double times[(TIMES + 7) / 8 * 8], steps[(TIMES + 7) / 8 * 8]; /* s, those of sample k at k % TIMES */
} Fleet;

#define N_GROUPS(n_assets) (((n_assets) + FB_LANES - 1) / FB_LANES)

static inline Group *group_of(Fleet *fleet, int64_t k) { return (Group *)(void *)(fleet + 1) + k; }

/* Samples for all assets: inputs [assets][stride][N_INPUTS] and readings [assets][stride][N_OUTPUTS], of which n are taken from
   each; `left` [assets] gets the place of that before which an asset went away, -1: it did not. */
typedef struct {
    int64_t n, stride;
    const double *inputs, *readings;
    int64_t *left;
} Portion;

/* Take the samples of a block into groups from `first` to before `end`. lanes_memory: LANES_MEMORY bytes, alone: see alone.h. */
FB_OF_FLEETS void watch_groups(Fleet *fleet, const Portion *portion, int64_t first, int64_t end, void *lanes_memory, void *alone);
FB_OF_FLEETS int64_t lanes_memory_size(void);

/* Take the sample of now into asset l of a group, by the way of one plant; 1 where it has to go away before it, and is as it
   was. Stands in alone.h. */
FB_OF_FLEETS int64_t watch_alone(Fleet *fleet, int64_t group, int l, int64_t index, void *alone);

/* Lane l of numbers that stand side by side. */
static inline void lane_from(double (*block)[FB_LANES], int l, int64_t n, double *numbers)
{
    for (int64_t k = 0; k < n; k++) memcpy(&numbers[k], &block[k][l], sizeof *numbers);
}

static inline void lane_to(double (*block)[FB_LANES], int l, int64_t n, const double *numbers)
{
    for (int64_t k = 0; k < n; k++) memcpy(&block[k][l], &numbers[k], sizeof *numbers);
}

#ifdef FB_HOLDS_FLEET
#define SIDE(name) name##_beside
#define Clock SIDE(Clock)
#define Inputs SIDE(Inputs)
#define Sensors SIDE(Sensors)
#define Healthy SIDE(Healthy)
#define Watched SIDE(Watched)
#define Sample SIDE(Sample)
#define larger SIDE(larger)
#define smaller SIDE(smaller)
#define lesser SIDE(lesser)
#define greater SIDE(greater)
#define is_finite SIDE(is_finite)
#define positive SIDE(positive)
#define peak_of SIDE(peak_of)
#define is_restless SIDE(is_restless)
#define any_unknown SIDE(any_unknown)
#define is_trusted SIDE(is_trusted)
#define is_counted SIDE(is_counted)
#define has_value SIDE(has_value)
#define move_inputs SIDE(move_inputs)
#define learn_inputs SIDE(learn_inputs)
#define learn_records SIDE(learn_records)
#define is_at_end SIDE(is_at_end)
#define follow_record SIDE(follow_record)
#define begin_trend SIDE(begin_trend)
#define smooth_input SIDE(smooth_input)
#define smooth_inputs SIDE(smooth_inputs)
#define is_blanked SIDE(is_blanked)
#define gap_before SIDE(gap_before)
#define kick SIDE(kick)
#define pack_values SIDE(pack_values)
#define is_off SIDE(is_off)
#define is_surprising SIDE(is_surprising)
#define see SIDE(see)
#define scale_of_fast SIDE(scale_of_fast)
#define scale_of_scatter SIDE(scale_of_scatter)
#define clip SIDE(clip)
#define scatter_gain SIDE(scatter_gain)
#define add_score SIDE(add_score)
#define least_scatter SIDE(least_scatter)
#define statistic SIDE(statistic)
#define usual_square SIDE(usual_square)
#define long_run SIDE(long_run)
#define accumulate SIDE(accumulate)
#define slow_error_alarms SIDE(slow_error_alarms)
#define is_alarming SIDE(is_alarming)
#define is_sound SIDE(is_sound)
#define learn_travel SIDE(learn_travel)
#define walks_from SIDE(walks_from)
#define own_value SIDE(own_value)
#define own_variance SIDE(own_variance)
#define usual_walk SIDE(usual_walk)
#define take_walk SIDE(take_walk)
#define judge_walk SIDE(judge_walk)
#define learn_walk SIDE(learn_walk)
#define walk_together SIDE(walk_together)
#define judge_window SIDE(judge_window)
#define judge_start SIDE(judge_start)
#define judge_walks SIDE(judge_walks)
#define keep_for_long SIDE(keep_for_long)

#define real lanes
#define whole mask
#define flag mask
#define SAME(a) broadcast(a)
#define AS_REAL(a) of_whole(a)
#define SIZE magnitude
#define ROOT v_sqrt
#define HYPOT v_hypot
#define ANY(is) any_of(is)
#define PICK(is, a, b) choose(is, a, b)
#define NEVER ((mask)(broadcast(0.0) > 1.0))
#define NOT(is) opposite(is)
#if FB_LANES == 1
#define WHERE(is, a) ((is) ? (a) : 0)
#else
#define WHERE(is, a) ((is) & (a))
#endif
#include "watched.h"
#include "watching.h"

/* Memory of the usual way. */
typedef struct {
    Filter_beside filter;
    Watched before; /* but the lanes kept for long */
    lanes packed[N_SAMPLE], innovations[2 * N_OUTPUTS];
    lanes walks[FB_ROOM(TRIANGLE(N_PARAMETERS))];
} LanesMemory;

FB_OF_FLEETS int64_t lanes_memory_size(void) { return (int64_t)sizeof(LanesMemory); }

/* For which assets all conditions are true, and have been for so long that they have settled. */
static mask all_hold(const Inputs *inputs, const Sample *sample)
{
    double told[FB_ROOM(N_INPUTS)][FB_LANES], holds[FB_LANES], u[FB_ROOM(N_INPUTS)];
    for (int k = 0; k < N_INPUTS; k++) store(told[k], sample->u[k]);
    for (int l = 0; l < FB_LANES; l++) {
        for (int k = 0; k < N_INPUTS; k++) u[k] = told[k][l];
        holds[l] = 1.0;
        for (int c = 0; c < N_CONDITIONS; c++) holds[l] *= model_holds(c, u);
    }
    mask found = load(holds) != 0.0;
    for (int c = 0; c < N_CONDITIONS; c++) found &= opposite(is_finite(inputs->true_for[c]));
    return found;
}

/* Which assets a sample finds as usual: they watch, the model holds, every input is told, and none is wild or was, nor was there
   a gap. */
static mask are_ready(const Watched *watched, const Sample *sample)
{
    const Clock *clock = &watched->clock;
    const Inputs *inputs = &watched->inputs;
    mask ready = (clock->running != 0) & (clock->alarm < 0) & (clock->index - clock->begun >= WARM_UP_SAMPLES);
    for (int k = 0; k < N_INPUTS; k++) {
        const lanes u = sample->u[k];
        ready &= is_finite(u) & is_finite(inputs->held[k]) & (inputs->guessed[k] == 0.0) & opposite(is_finite(inputs->odd[k]));
    }
    for (int i = 0; i < N_STATES; i++) ready &= watched->healthy.astray[i] == 0.0;
    if (N_CONDITIONS > 0) ready &= (clock->outside == 0) & (clock->doubt == 0.0) & all_hold(inputs, sample);
    return ready;
}

/* For which assets no input goes beyond all that was seen. */
static mask are_within(const Inputs *inputs, const Sample *sample)
{
    mask found = broadcast(0.0) == 0.0;
    for (int k = 0; k < N_INPUTS; k++) found &= (sample->u[k] >= inputs->lowest[k]) & (sample->u[k] <= inputs->highest[k]);
    return found;
}

/* Take a sample the usual way; gives the assets, among those that `may`, for which all was as usual. What the others are then
   means nothing. */
static mask watch_usually(Watched *watched, const Sample *told, int64_t index, mask may, LanesMemory *memory)
{
    Sample smooth = *told;
    const Sample *sample = &smooth;
    Clock *clock = &watched->clock;
    Inputs *inputs = &watched->inputs;
    Sensors *sensors = &watched->sensors;
    lanes noise[N_OUTPUTS], *packed = memory->packed, *innovations = memory->innovations;
    for (int j = 0; j < N_OUTPUTS; j++) noise[j] = broadcast(1.0);
    smooth_inputs(inputs, &smooth);
    may &= are_within(inputs, sample);
    const lanes gap = pack_values(sample, 0, sensors, noise, clock, inputs, packed);
    packed[SAMPLE_BOUND] = broadcast(LEARNING_BOUND);
    learn_inputs(inputs, sample, gap != 0.0, opposite(has_value(sample)));
    clock->time = broadcast(sample->time);
    filter_step_beside(watched->healthy.lane, packed, innovations, &memory->filter);
    mask done = may & (gap == 0.0) & opposite(is_surprising(sensors, packed, innovations)) & is_sound(watched->healthy.lane);
    see(sensors, packed);
    sensors->surprised = broadcast(0.0);
    accumulate(clock, inputs, &watched->healthy, sensors, packed, innovations);
    learn_travel(&watched->healthy);
    judge_walks(index, clock, inputs, NULL, &watched->healthy, memory->walks);
    done &= opposite(is_alarming(clock, sensors, &watched->healthy) & (clock->quiet == 0));
    keep_for_long(index, clock, done, &watched->healthy);
    clock->index += 1;
    return done;
}

/* The sample of a group at one time; inputs as a plant without an accepted fault takes them. */
static void gather_sample(const Fleet *fleet, const Portion *portion, int64_t group, int64_t t, Sample *sample)
{
    double given[N_TOLD][FB_LANES];
    for (int l = 0; l < FB_LANES; l++) {
        int64_t asset = group * FB_LANES + l;
        if (asset >= fleet->n_assets) asset = fleet->n_assets - 1;
        const int64_t row = asset * portion->stride + t;
        for (int k = 0; k < N_INPUTS; k++) given[k][l] = portion->inputs[row * N_INPUTS + k];
        for (int j = 0; j < N_OUTPUTS; j++) given[N_INPUTS + j][l] = portion->readings[row * N_OUTPUTS + j];
    }
    sample->time = fleet->times[(fleet->index + t) % TIMES];
    sample->dt = fleet->steps[(fleet->index + t) % TIMES];
    for (int k = 0; k < N_INPUTS; k++) sample->u[k] = load(given[k]);
    for (int j = 0; j < N_OUTPUTS; j++) sample->y[j] = load(given[N_INPUTS + j]);
}

/* Keep a sample as it was told, but for assets that went away in this block: what they are made from ends before it. */
static void keep_told(Group *group, const Sample *sample, int64_t index, mask leaving)
{
    double(*told)[FB_LANES] = group->told[index % TOLD];
    for (int k = 0; k < N_INPUTS; k++) store(told[k], choose(leaving, load(told[k]), sample->u[k]));
    for (int j = 0; j < N_OUTPUTS; j++) store(told[N_INPUTS + j], choose(leaving, load(told[N_INPUTS + j]), sample->y[j]));
}

/* Keep what is remembered of the assets that are here. */
static void keep_watched(Group *group, int64_t index)
{
    double(*kept)[FB_LANES] = group->kept[index / KEPT_EVERY % N_KEPT];
    for (int l = 0; l < FB_LANES; l++)
        for (int64_t k = 0; group->place[l] != AWAY && k < N_LIVE; k++) memcpy(&kept[k][l], &group->watched[k][l], sizeof(double));
}

/* Parts of what is remembered that the usual way changes: all but the rival, and the lanes kept for long. */
#define END_OF_FIRST offsetof(Watched, inputs.rival)
#define SECOND_PART offsetof(Watched, inputs.gain)
#define END_OF_PARTS offsetof(Watched, healthy.snapshots)

/* Keep what is remembered before a sample, and let asset l go back to it. */
static void keep_before(const Watched *watched, Watched *before)
{
    memcpy(before, watched, END_OF_FIRST);
    memcpy((char *)before + SECOND_PART, (const char *)watched + SECOND_PART, END_OF_PARTS - SECOND_PART);
}

static void go_back(const Watched *before, int l, Watched *watched)
{
    for (size_t at = 0; at < END_OF_PARTS; at = at + sizeof(lanes) == END_OF_FIRST ? SECOND_PART : at + sizeof(lanes)) {
        const size_t here = at + (size_t)l * sizeof(double);
        memcpy((char *)watched + here, (const char *)before + here, sizeof(double));
    }
}

/* Take a sample into a group. */
static void watch_group(Fleet *fleet, const Portion *portion, int64_t number, int64_t t, LanesMemory *memory, void *alone)
{
    Group *group = group_of(fleet, number);
    Watched *watched = (Watched *)(void *)group->watched;
    const int64_t index = fleet->index + t;
    double usual[FB_LANES], leaving[FB_LANES];
    Sample sample;
    for (int l = 0; l < FB_LANES; l++) {
        usual[l] = group->place[l] == USUAL;
        leaving[l] = group->place[l] == AWAY && group->left[l] >= fleet->index;
    }
    gather_sample(fleet, portion, number, t, &sample);
    keep_told(group, &sample, index, load(leaving) != 0.0);
    for (int k = 0; k < N_INPUTS; k++) sample.u[k] += 0.0; /* as `correct` does: no zero has a sign */
    mask done = (load(usual) != 0.0) & are_ready(watched, &sample);
    const int any = any_of(done);
    if (any) {
        keep_before(watched, &memory->before);
        done = watch_usually(watched, &sample, index, done, memory);
    }
    for (int l = 0; l < FB_LANES && !all_of(done); l++) {
        if (holds(done, l)) continue;
        if (any) go_back(&memory->before, l, watched);
        if (group->place[l] == AWAY || !watch_alone(fleet, number, l, index, alone)) continue;
        group->place[l] = AWAY;
        group->left[l] = index;
        portion->left[number * FB_LANES + l] = t;
    }
}

FB_OF_FLEETS void watch_groups(Fleet *fleet, const Portion *portion, int64_t first, int64_t end, void *lanes_memory, void *alone)
{
    LanesMemory *memory = (LanesMemory *)lanes_memory;
    memory->filter.step.dt = NAN;
    for (int64_t number = first; number < end; number++) {
        if (fleet->index % KEPT_EVERY == 0) keep_watched(group_of(fleet, number), fleet->index);
        for (int64_t t = 0; t < portion->n; t++) watch_group(fleet, portion, number, t, memory, alone);
    }
}

#undef END_OF_FIRST
#undef SECOND_PART
#undef END_OF_PARTS
#undef Clock
#undef Inputs
#undef Sensors
#undef Healthy
#undef Watched
#undef Sample
#undef larger
#undef smaller
#undef lesser
#undef greater
#undef is_finite
#undef positive
#undef peak_of
#undef is_restless
#undef any_unknown
#undef is_trusted
#undef is_counted
#undef has_value
#undef move_inputs
#undef learn_inputs
#undef learn_records
#undef is_at_end
#undef is_blanked
#undef follow_record
#undef begin_trend
#undef smooth_input
#undef smooth_inputs
#undef gap_before
#undef kick
#undef pack_values
#undef is_off
#undef is_surprising
#undef see
#undef scale_of_fast
#undef scale_of_scatter
#undef clip
#undef scatter_gain
#undef add_score
#undef least_scatter
#undef statistic
#undef usual_square
#undef long_run
#undef accumulate
#undef slow_error_alarms
#undef is_alarming
#undef is_sound
#undef learn_travel
#undef walks_from
#undef own_value
#undef own_variance
#undef usual_walk
#undef take_walk
#undef judge_walk
#undef learn_walk
#undef walk_together
#undef judge_window
#undef judge_start
#undef judge_walks
#undef keep_for_long
#undef SIDE
#endif

#endif
