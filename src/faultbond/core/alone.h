/* Assets of a fleet one by one: those for which a sample is not usual, and those that come and go. */
#ifndef FB_ALONE_H
#define FB_ALONE_H

#include "fleet.h"
#include "watch.h"

/* Memory of one asset: what it remembers, for as long as it takes a sample. */
typedef struct {
    State state;
    Work work;
} AloneMemory;

/* A sample as an asset was told. */
static void told_sample(const Fleet *fleet, Group *group, int l, int64_t index, Sample *sample)
{
    double(*told)[FB_LANES] = group->told[index % TOLD];
    sample->time = fleet->times[index % TIMES];
    sample->dt = fleet->steps[index % TIMES];
    for (int k = 0; k < N_INPUTS; k++) sample->u[k] = told[k][l];
    for (int j = 0; j < N_OUTPUTS; j++) sample->y[j] = told[N_INPUTS + j][l];
}

/* What is remembered of an asset before a sample, but for its trail, which is made from what was kept of it and the samples
   since: all rows of the trail that the sample may ask for. */
static void remake(const Fleet *fleet, Group *group, int l, int64_t index, State *state, Work *work)
{
    Report report;
    Sample sample;
    int64_t from = -1;
    for (int slot = 0; slot < N_KEPT; slot++) { /* the latest that is old enough */
        int64_t kept;
        lane_from(group->kept[slot], l, 1, (double *)(void *)&kept);
        if (kept > from && (kept <= index - DEPTH + 1 || kept == 0)) from = kept;
    }
    lane_from(group->kept[from / KEPT_EVERY % N_KEPT], l, N_LIVE, (double *)(void *)state);
    const int64_t quiet = state->clock.quiet;
    state->clock.quiet = 1; /* there was no alarm, so what it would bring is not asked for */
    for (int64_t k = from; k < index; k++) {
        told_sample(fleet, group, l, k, &sample);
        watch(state, &sample, &report, &work->found, work);
    }
    state->clock.quiet = quiet;
}

FB_OF_FLEETS int64_t watch_alone(Fleet *fleet, int64_t number, int l, int64_t index, void *alone)
{
    Group *group = group_of(fleet, number);
    AloneMemory *memory = (AloneMemory *)alone;
    State *state = &memory->state;
    Report report;
    Sample sample;
    lane_from(group->watched, l, N_LIVE, (double *)(void *)state);
    /* lanes that are kept for long are asked for at few samples only */
    const int64_t n = index % WALK_EVERY == 0 || !state->clock.running ? N_WATCHED : N_LIVE;
    if (n > N_LIVE) lane_from(group->watched, l, n, (double *)(void *)state);
    lane_from(group->normal, l, N_NORMAL, (double *)(void *)&state->normal);
    if (!state->clock.running) remake(fleet, group, l, index, state, &memory->work); /* the start is found from the trail */
    const int64_t quiet = state->clock.quiet;
    state->clock.quiet = 1; /* the trail is not there */
    told_sample(fleet, group, l, index, &sample);
    watch(state, &sample, &report, &memory->work.found, &memory->work);
    if (report.status == LOST) return 1;
    Clock now = state->clock;
    now.index = index;
    if (!quiet && report.status == WATCHING && is_alarming(&now, &state->sensors, &state->healthy)) return 1;
    state->clock.quiet = quiet;
    lane_to(group->watched, l, n, (const double *)(const void *)state);
    return 0;
}

/* Begin a fleet before the first sample, at time t0 (s); quiet 1: no alarm is ever raised. */
static void begin_fleet(Fleet *fleet, int64_t n_assets, double t0, int64_t quiet, State *state)
{
    memset(fleet, 0, sizeof *fleet);
    fleet->n_assets = n_assets;
    begin_state(state, t0, quiet);
    for (int64_t g = 0; g < N_GROUPS(n_assets); g++) {
        Group *group = group_of(fleet, g);
        for (int l = 0; l < FB_LANES; l++) {
            lane_to(group->watched, l, N_WATCHED, (const double *)(const void *)state);
            lane_to(group->normal, l, N_NORMAL, (const double *)(const void *)&state->normal);
            for (int slot = 0; slot < N_KEPT; slot++) {
                const int64_t none = -1;
                lane_to(group->kept[slot], l, 1, (const double *)(const void *)&none);
            }
            group->place[l] = g * FB_LANES + l < n_assets ? USUAL : AWAY;
            group->left[l] = -1;
        }
    }
}

/* Take over the assets of another fleet, again and again. */
static void repeat_assets(Fleet *fleet, const Fleet *few)
{
    const int64_t n_assets = fleet->n_assets;
    *fleet = *few;
    fleet->n_assets = n_assets;
    for (int64_t asset = 0; asset < n_assets; asset++) {
        const Group *from = (const Group *)(const void *)(few + 1) + asset % few->n_assets / FB_LANES;
        Group *to = group_of(fleet, asset / FB_LANES);
        const int64_t other = asset % few->n_assets % FB_LANES, here = asset % FB_LANES;
        for (size_t at = 0; at < sizeof(Group); at += FB_LANES * sizeof(double))
            memcpy((char *)to + at + (size_t)here * 8, (const char *)from + at + (size_t)other * 8, 8);
    }
}

/* The whole state of an asset as it is here; of one that went away, as it was before the sample at which it did. */
static void leave(Fleet *fleet, int64_t asset, State *state, Work *work)
{
    Group *group = group_of(fleet, asset / FB_LANES);
    const int l = (int)(asset % FB_LANES);
    begin_state(state, 0.0, 0);
    lane_from(group->watched, l, N_WATCHED, (double *)(void *)state);
    lane_from(group->normal, l, N_NORMAL, (double *)(void *)&state->normal);
    if (fleet->index == 0 && group->place[l] != AWAY) return;
    remake(fleet, group, l, state->clock.index, state, work);
    lane_from(group->watched, l, N_WATCHED, (double *)(void *)state); /* with lanes kept for long that are as they were */
}

/* Whether what was accepted has to be taken out of each sample, or moves parameters. */
static int is_corrected(const Normal *normal)
{
    int found = drifts(normal);
    for (int j = 0; j < N_OUTPUTS; j++) found |= normal->gain[j] != 1.0 || normal->offset[j] != 0.0 || normal->noise[j] != 1.0;
    for (int k = 0; k < N_INPUTS; k++) found |= normal->input_gain[k] != 1.0 || normal->input_offset[k] != 0.0;
    return found;
}

/* Let an asset that is away come back; between two samples, of which the next one has a number that is divided by KEPT_EVERY.
   It can once its trail, since a diagnosis was accepted or its filter began anew, can be made again; 1 where it is here. */
static int64_t come_back(Fleet *fleet, int64_t asset, const State *state)
{
    Group *group = group_of(fleet, asset / FB_LANES);
    const int l = (int)(asset % FB_LANES);
    const Clock *clock = &state->clock;
    if (clock->alarm >= 0 || !clock->running || fleet->index % KEPT_EVERY != 0) return 0;
    lane_to(group->kept[fleet->index / KEPT_EVERY % N_KEPT], l, N_LIVE, (const double *)(const void *)state);
    const int64_t since = clock->accepted > group->left[l] ? clock->accepted : group->left[l];
    for (int64_t back = fleet->index; back > fleet->index - N_KEPT * KEPT_EVERY; back -= KEPT_EVERY) {
        int64_t kept; /* the first number is that of samples seen */
        if (back <= since) return 0;
        lane_from(group->kept[back / KEPT_EVERY % N_KEPT], l, 1, (double *)(void *)&kept);
        if (kept != back) return 0;
    }
    lane_to(group->watched, l, N_WATCHED, (const double *)(const void *)state);
    lane_to(group->normal, l, N_NORMAL, (const double *)(const void *)&state->normal);
    group->place[l] = is_corrected(&state->normal) ? CHANGED : USUAL;
    return 1;
}

#endif
