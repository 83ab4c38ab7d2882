/* The detector: sums of the innovations of each sensor, slow and fast, and of their scatter; the alarm; and the same sums of
   every lane of the bank, which tell how well it explains what came since.

   A sum with a small drift finds small faults; one with a large drift and a low limit finds large ones in half the time. The
   latter alarms only where a time between false alarms is promised: a few wild values in a row, which real sensors have,
   are enough for it. They also scatter in bursts, of some hundred samples; so the sum of the scatter has patience.
   Source: Page, Biometrika 41 (1954) 100. */
#ifndef FB_DETECTOR_H
#define FB_DETECTOR_H

#include "wild.h"

/* The sums as they begin after a sample. */
static void begin_sums(Sensors *sensors, double last)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        for (int side = 0; side < 2; side++) {
            sensors->cusum[side][j] = sensors->fast[side][j] = 0.0;
            sensors->cusum_start[side][j] = last;
        }
        for (int k = 0; k < LAGS; k++) {
            sensors->scatter[k][j] = 0.0;
            sensors->scatter_start[k][j] = last;
            sensors->before[k][j] = NAN;
        }
    }
}

/* The sample after which the largest sum of a sensor began to grow. */
static double beginning(const Sensors *sensors, int j)
{
    const int side = sensors->cusum[1][j] > sensors->cusum[0][j];
    if (!(scale_of_scatter() * least_scatter(sensors, j) > sensors->cusum[side][j])) return sensors->cusum_start[side][j];
    double first = sensors->scatter_start[0][j];
    for (int k = 1; k < LAGS; k++) first = fmin(first, sensors->scatter_start[k][j]);
    return first;
}

/* Judge from now on how far parameters are from where a lane has them, which begins at a time. */
static void begin_walks(Healthy *healthy, const double *lane, double time)
{
    memcpy(healthy->snapshots[AT_START], lane, PLAIN_NUMBERS * sizeof *lane);
    healthy->snapshots[AT_START][KEPT_TIME] = time;
}

/* Note the walk that raised an alarm; gives the sample at which it began, by its window. */
static int64_t note_walk(const State *state, Alarm *found)
{
    const Clock *clock = &state->clock;
    const Healthy *healthy = &state->healthy;
    const int64_t walker = (int64_t)healthy->walker, kind = walker / (N_PARAMETERS > 0 ? N_PARAMETERS : 1);
    const int64_t window = kind > WALKS ? kind - WALKS - 1 : kind; /* of all together, or of one */
    const double limit = kind > WALKS ? limit_together(n_together(state->normal.rates)) : kind == WALKS ? START_LIMIT : WALK_LIMIT;
    const int64_t length = length_of_walk((int)window), number = compared_with(clock->index, length);
    const int64_t slot = window == WALKS ? AT_START : kept_at((int)window, number);
    const int64_t began = window == WALKS ? clock->begun : number * length;
    found->walker = walker - kind * N_PARAMETERS;
    found->window = kind;
    found->walk = healthy->walk * limit;
    found->change_time = healthy->snapshots[slot][KEPT_TIME];
    if (began <= clock->index - DEPTH + 1 || window == WALKS) found->old = slot;
    return began;
}

/* Whether an input is, or has been ever, where no recording of the fit had it, and so the model was never compared with the plant. */
static int is_unfamiliar(const Inputs *inputs, int ever)
{
    int found = 0;
    for (int k = 0; k < N_INPUTS; k++) {
        const double low = ever ? inputs->lowest[k] : inputs->held[k], high = ever ? inputs->highest[k] : inputs->held[k];
        found |= low < INPUT_FAMILIAR_LOW[k] || high > INPUT_FAMILIAR_HIGH[k];
    }
    return found;
}

/* Raise the alarm if a sum crossed its limit, a slow error left its size, or a parameter walked too far: gives the number of the
   sample of the estimated onset, at the earliest that of the oldest sample kept, and -1 where there is no alarm. */
static int64_t detect(State *state)
{
    const Clock *clock = &state->clock;
    Alarm found;
    double highest = -INFINITY;
    int leading = 0, crossed = 0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double height = statistic(&state->sensors, j);
        found.crossed[j] = height > CUSUM_LIMIT;
        crossed |= height > CUSUM_LIMIT;
        if (height > highest) {
            highest = height;
            leading = j;
        }
    }
    const int is_slow = slow_error_alarms(clock, state->healthy.lane), walks = !crossed && !is_slow;
    if (walks && !(state->healthy.walk > 1.0)) return -1;
    if (!crossed) found.crossed[leading] = 1; /* of an alarm that no sum raised, the sensor with the largest */
    int64_t oldest = clock->begun;
    if (clock->accepted + 1 > oldest) oldest = clock->accepted + 1;
    if (clock->index - HISTORY_SAMPLES > oldest) oldest = clock->index - HISTORY_SAMPLES;
    found.walker = found.window = found.old = -1;
    found.walk = 0.0;
    found.outside = 0;
    found.slow = !crossed;
    const double began = walks ? (double)note_walk(state, &found) : beginning(&state->sensors, leading);
    found.unfamiliar = is_unfamiliar(&state->inputs, found.window == WALKS);
    const int64_t change = began >= (double)clock->index ? clock->index : began > (double)oldest ? (int64_t)began : oldest;
    found.time = clock->time;
    if (!walks) found.change_time = row_of(&state->past, change)->time;
    state->alarm = found;
    return change;
}

/* Sums of all lanes as they begin after a sample. */
static void begin_misfit(Bank *bank, int64_t index)
{
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < N_OUTPUTS; j++)
            for (int lane = 0; lane < N_LANES; lane++) {
                bank->sums[side][j][lane] = 0.0;
                bank->since[side][j][lane] = (double)index;
            }
}

/* Whether what has once contradicted a lane does so from then on. A fault that comes and goes is always right while it is
   gone; and a sensor that scatters has room for whatever is off for a while only, as after each move of an actuator that
   has become slow. */
static int stays_contradicted(int lane)
{
    const int slot = lane - N_STEPS;
    return slot >= 0 && slot < N_SLOT_LANES && (slot >= SWITCHED || SLOT_KIND[slot] == KIND_NOISE);
}

/* Take the innovations [2 * N_OUTPUTS][N_LANES] of all lanes into their sums. A model that explains the plant has white
   innovations, whatever it is a model of: a lane whose sums cross the limit that raises alarms is contradicted by the
   data. */
static void add_misfit(Bank *bank, const Inputs *inputs, const double *packed, double (*innovations)[FB_ROOM(N_LANES)],
                       int64_t index)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        const int counts = is_counted(inputs, packed, j);
        for (int lane = 0; lane < N_LANES; lane++) {
            const double off = innovations[j][lane] / sqrt(innovations[N_OUTPUTS + j][lane]);
            const double score = isnan(off) ? CUSUM_CLIP : clip(off);
            for (int side = 0; side < 2; side++) {
                const double before = bank->sums[side][j][lane];
                double sum = counts ? positive(before + ((side ? -score : score) - CUSUM_DRIFT)) : before;
                if (stays_contradicted(lane) && before > CUSUM_LIMIT) sum = fmax(sum, before);
                bank->sums[side][j][lane] = sum;
                if (sum <= 0.0) bank->since[side][j][lane] = (double)index;
            }
        }
    }
}

/* Begin the sums of a lane anew after a sample. */
static void begin_misfit_again(Bank *bank, int64_t lane, int64_t index)
{
    for (int side = 0; side < 2; side++)
        for (int j = 0; j < N_OUTPUTS; j++) {
            bank->sums[side][j][lane] = 0.0;
            bank->since[side][j][lane] = (double)index;
        }
}

/* The largest sum of a lane: its side, and its sensor. */
static double largest_sum(const Bank *bank, int64_t lane, int *side, int *signal)
{
    *side = *signal = 0;
    for (int s = 0; s < 2; s++)
        for (int j = 0; j < N_OUTPUTS; j++)
            if (bank->sums[s][j][lane] > bank->sums[*side][*signal][lane]) {
                *side = s;
                *signal = j;
            }
    return bank->sums[*side][*signal][lane];
}

#endif
