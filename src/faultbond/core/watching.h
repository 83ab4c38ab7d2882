/* What is the same for every sample of a plant that is watched: how inputs move, what the sensors show, the sums of the
   detector. `plant.h` and `fleet.h` include this text for one plant and for FB_LANES assets side by side, and say what the words
   stand for: `real` and `whole` numbers, a `flag` that is true or not, SAME for all, PICK one where a flag is true and else the
   other, NOT. Formulas: docs/method.md, "The joint filter" and "The alarm". */

#include "real.h"

#include "smooth.h"

/* Largest size of input k, SI; 0 where none was seen. */
static inline real peak_of(const Inputs *inputs, int k)
{
    const real size = larger(SIZE(inputs->lowest[k]), SIZE(inputs->highest[k]));
    return PICK(inputs->lowest[k] <= inputs->highest[k], size, SAME(0.0));
}

/* Whether input k usually is told, and moves; where it stands while it is not told nobody knows. */
static inline flag is_restless(const Inputs *inputs, int k) { return (inputs->leap[k] > 0.0) & (inputs->habit[k] > RARELY); }

/* Whether some input has been missing for some samples, though it usually is told and does move. */
static inline flag any_unknown(const Inputs *inputs)
{
    flag found = NEVER;
    for (int k = 0; k < N_INPUTS; k++) found |= (inputs->guessed[k] >= UNKNOWN_FROM) & is_restless(inputs, k);
    return found;
}

/* Whether sensor j has a value in a packed sample, and is not blanked. */
static inline flag is_trusted(const real *packed, int j)
{
    return (packed[SAMPLE_USE + j] > 0.0) & (packed[SAMPLE_SCALE + j] < BLANK_FACTOR);
}

/* Whether the sums take a sample of sensor j. While an input is unknown for several samples none does: it may stand
   elsewhere, and then errs to one side. */
static inline flag is_counted(const Inputs *inputs, const real *packed, int j)
{
    return is_trusted(packed, j) & NOT(any_unknown(inputs));
}

/* Whether a sample has any value. */
static inline flag has_value(const Sample *sample)
{
    flag found = NEVER;
    for (int k = 0; k < N_INPUTS; k++) found |= is_finite(sample->u[k]);
    for (int j = 0; j < N_OUTPUTS; j++) found |= is_finite(sample->y[j]);
    return found;
}

/* Let inputs go to where they are told to be, and others stay. At the first sample nothing moves. */
static inline void move_inputs(Inputs *inputs, const Sample *sample, int first, double dt)
{
    for (int k = 0; k < N_INPUTS; k++) {
        const real u = PICK(is_finite(sample->u[k]), sample->u[k], inputs->held[k]);
        const real before = first ? u : inputs->held[k], moved = u - before;
        const real limit = larger(SAME(INPUT_STEP[k]), INPUT_STEP_PART[k] * larger(peak_of(inputs, k), SIZE(u)));
        const real since = inputs->since_step[k] + dt;
        inputs->since_step[k] = first ? since : PICK(SIZE(moved) > limit, SAME(0.0), since);
        inputs->earlier[k] = before;
        inputs->held[k] = u;
    }
}

/* What is known of the inputs after a sample in which some were told; `gap`: there was one before it. An input that is mostly
   not told is one that is logged when it changes: between, its value is known after all. */
static inline void learn_inputs(Inputs *inputs, const Sample *sample, flag gap, flag silent)
{
    for (int k = 0; k < N_INPUTS; k++) {
        const real u = inputs->held[k], moved = u - inputs->earlier[k], less = sqrt(1.0 - 1.0 / MOVES) * inputs->leap[k];
        const flag told = is_finite(sample->u[k]);
        const flag seen = told & (inputs->guessed[k] == 0.0) & NOT(gap); /* both ends of the move were seen */
        const real leap = ANY(moved != 0.0) ? HYPOT(less, sqrt(1.0 / MOVES) * moved) : SIZE(less);
        inputs->leap[k] = PICK(seen, leap, inputs->leap[k]);
        inputs->lowest[k] = PICK(told, smaller(inputs->lowest[k], u), inputs->lowest[k]);
        inputs->highest[k] = PICK(told, larger(inputs->highest[k], u), inputs->highest[k]);
        inputs->guessed[k] = PICK(told, SAME(0.0), inputs->guessed[k] + 1.0);
        const real habit = inputs->habit[k] + (PICK(told, SAME(1.0), SAME(0.0)) - inputs->habit[k]) / HABIT;
        inputs->habit[k] = PICK(silent, inputs->habit[k], habit);
    }
}

#if N_NOISY > 0
/* Whether a value of an input is at an end of where it has been. */
static inline flag is_at_end(const Inputs *inputs, int k, real value)
{
    return (value <= inputs->lowest[k]) | (value >= inputs->highest[k]);
}

/* What is known of records that scatter: how long each has been the same to the last digit, and for how long at most, and how
   often it turned back, up to the alarm. What is not told stays the same, and for how long nobody knows where it usually is. One that
   is switched off stands at an end of where it has been, and tells nothing there of how it scatters; nor does a command that goes
   from end to end. */
static inline void learn_records(const Clock *clock, const Sample *sample, Inputs *inputs)
{
    const flag healthy = clock->alarm < 0;
    for (int k = 0; k < N_NOISY; k++) {
        const real u = sample->record[k], moved = u - inputs->record[k], way = PICK(moved > 0.0, SAME(1.0), SAME(-1.0));
        const flag told = is_finite(u), goes = told & (moved != 0.0);
        const flag within = healthy & goes & NOT(is_at_end(inputs, NOISY[k], inputs->record[k]));
        const flag rests = is_at_end(inputs, NOISY[k], inputs->held[NOISY[k]]);
        const flag turns = within & (way * inputs->way[k] < 0.0);
        inputs->stood[k] = PICK(within, greater(inputs->stood[k], inputs->still[k]), inputs->stood[k]);
        inputs->idle[k] = PICK(healthy & rests, inputs->idle[k] + 1.0, inputs->idle[k]);
        inputs->since[k] = PICK(goes, SAME(sample->time), inputs->since[k]);
        inputs->turns[k] = PICK(turns, inputs->turns[k] + 1.0, inputs->turns[k]);
        inputs->way[k] = PICK(goes, way, inputs->way[k]);
        inputs->still[k] = PICK(told | NOT(is_restless(inputs, NOISY[k])), inputs->still[k] + 1.0, inputs->still[k]);
        inputs->still[k] = PICK(goes, SAME(0.0), inputs->still[k]);
        inputs->record[k] = PICK(told, u, inputs->record[k]);
    }
}
#endif

/* Whether an input that reaches sensor j directly is still settling after a step, or not known. */
static inline flag is_blanked(const Inputs *inputs, const Sample *sample, int j)
{
    flag found = NEVER;
    for (int e = DIRECT_ROW[j]; e < DIRECT_ROW[j + 1]; e++) {
        const int k = DIRECT_INPUT[e];
        found |= (inputs->since_step[k] < INPUT_SETTLING[k]) | (NOT(is_finite(sample->u[k])) & is_restless(inputs, k));
    }
    return found;
}

/* Tell the clock whether a sample has any value; gives the gap before it, in samples, 0 where there was none. Where rows are
   the grid, a gap is told by the time since the row before; but that of a run that goes on, or without a value for as long, is one. */
static inline real gap_before(Clock *clock, double dt, flag silent)
{
    const real usual = clock->pause, silence = AS_REAL(clock->silent);
    clock->silent = WHERE(silent, clock->silent + 1);
    const real counted = SAMPLE_TIME > 0.0 ? smaller(silence, SAME(PAUSES)) : smaller(SAME(dt), PAUSES * usual);
    const real learned = usual + (counted - usual) / PAUSES;
    if (SAMPLE_TIME > 0.0) {
        clock->pause = PICK(silent, usual, learned);
        return PICK(NOT(silent) & (silence > GAP_FROM - 1 + GAP_UNUSUAL * usual), silence, SAME(0.0));
    }
    const real away = PICK(silence < GAP_UNKNOWN, SAME(0.0), silence);
    const real absent = greater(PICK(usual == 0.0, SAME(0.0), dt / usual - 1.0), away);
    clock->pause = PICK(silent, usual, PICK(usual == 0.0, SAME(dt), learned));
    return PICK(NOT(silent) & (absent > GAP_FROM - 1 + GAP_UNUSUAL), absent, SAME(0.0));
}

/* Variances that slow errors gain in dt seconds, since inputs changed that they follow. What is felt of a change fades as the
   error itself does. */
static inline void kick(Inputs *inputs, double dt, real *kicks)
{
    for (int k = 0; k < N_SLOW; k++) {
        real sum = SAME(0.0);
        const double fade = AFTER_ROW[k] < AFTER_ROW[k + 1] ? exp(-dt / SLOW_MEMORY[k]) : 1.0;
        for (int e = AFTER_ROW[k]; e < AFTER_ROW[k + 1]; e++) {
            const int i = AFTER_INPUT[e];
            inputs->change[e] = inputs->change[e] * fade + (inputs->held[i] - inputs->earlier[i]);
            const real part = AFTER_EACH[e] * inputs->change[e];
            sum += part * part;
        }
        kicks[k] = (1.0 - fade * fade) * sum; /* of a step, adds up to all of it */
    }
}

/* Pack a sample but for what a gap brings and its bound: hold inputs, blank after steps, kick slow errors, switch off missing
   values. noise: factors on the variances of the sensors. Gives the gap before it, see `gap_before`. */
static inline real pack_values(const Sample *sample, int first, const Sensors *sensors, const real *noise, Clock *clock, Inputs *inputs,
                               real *packed)
{
    const double dt = first ? 0.0 : sample->dt;
    move_inputs(inputs, sample, first, dt);
    packed[SAMPLE_DT] = SAME(dt);
    packed[SAMPLE_AGAIN] = packed[SAMPLE_BOUND] = packed[SAMPLE_STILL] = SAME(0.0);
    for (int k = 0; k < N_INPUTS; k++) {
        packed[SAMPLE_U_BEFORE + k] = inputs->earlier[k];
        packed[SAMPLE_U + k] = inputs->held[k];
    }
    for (int j = 0; j < N_OUTPUTS; j++) {
        const flag there = is_finite(sample->y[j]);
        packed[SAMPLE_Y + j] = PICK(there, sample->y[j], SAME(0.0));
        packed[SAMPLE_USE + j] = PICK(there, SAME(1.0), SAME(0.0));
        packed[SAMPLE_SCALE + j] = PICK(is_blanked(inputs, sample, j), SAME(BLANK_FACTOR), PICK(there, noise[j], SAME(1.0)));
        packed[SAMPLE_NIS + j] = sensors->nis[j];
        packed[SAMPLE_RUN + j] = sensors->run[j];
    }
    for (int i = 0; i < N_STATES; i++) packed[SAMPLE_GAP + i] = SAME(0.0);
    for (int h = 0; h < N_HELD; h++) packed[SAMPLE_HELD + h] = SAME(0.0);
    for (int k = 0; k < N_NOISY; k++) {
        packed[SAMPLE_FADE + k] = sample->fade[k];
        packed[SAMPLE_FRESH + k] = sample->fresh[k];
    }
    kick(inputs, dt, packed + SAMPLE_KICK);
#if N_NOISY > 0
    learn_records(clock, sample, inputs);
#endif
    return gap_before(clock, dt, NOT(has_value(sample)));
}

/* Whether innovation j lies more than so many sd off. */
static inline flag is_off(const real *innovations, int j, double sd)
{
    return SIZE(innovations[j]) > sd * ROOT(larger(innovations[N_OUTPUTS + j], SAME(0.0)));
}

/* Whether a reading lies so far from what the healthy filter expects, by its innovations [2 * N_OUTPUTS], that it, or an
   input before it, may be wild; or one did so lately. */
static inline flag is_surprising(const Sensors *sensors, const real *packed, const real *innovations)
{
    flag found = NEVER;
    for (int j = 0; j < N_OUTPUTS; j++)
        found |= (sensors->spent[j] != 0.0) | ((packed[SAMPLE_USE + j] > 0.0) & is_off(innovations, j, SPIKE));
    return found;
}

/* What is known of the sensors after the readings of a packed sample. */
static inline void see(Sensors *sensors, const real *packed)
{
    for (int j = 0; j < N_OUTPUTS; j++) {
        const flag used = packed[SAMPLE_USE + j] > 0.0;
        real *low = &sensors->shown[0][j], *high = &sensors->shown[1][j];
        *low = PICK(used, smaller(*low, packed[SAMPLE_Y + j]), *low);
        *high = PICK(used, larger(*high, packed[SAMPLE_Y + j]), *high);
    }
}

#include "sums.h"

/* The usual square of a normalised innovation after one more. Declared noises and slow errors are bounds more often than
   facts. Likelihoods reckon with the squares that are seen while the plant is healthy: else a hypothesis would win by the
   size of what it foretells, sample by sample. */
static inline real usual_square(real nis, real score, whole learned)
{
    const real memory = lesser(NIS_TRUST + AS_REAL(learned), SAME(NIS_MEMORY));
    return lesser(greater(nis + (score * score - nis) / memory, SAME(NIS_LEAST)), SAME(NIS_MOST));
}

/* The variance of normalised innovations over long runs after one more, from their exponential mean over RUN_LENGTH samples:
   of white ones of variance 1 that has a variance of 1 / RUN_LENGTH. What innovations that go together say is not said
   anew by each of them: where the model is imperfect, likelihoods that take them one by one would be sure of what makes up
   for it. Source: the spectrum at frequency 0, M. B. Priestley, Spectral Analysis and Time Series (1981), 6.2. */
static inline real long_run(real run, real mean, whole learned)
{
    const real memory = lesser(NIS_TRUST + AS_REAL(learned), SAME(NIS_MEMORY));
    return lesser(run + (RUN_LENGTH * mean * mean - run) / memory, SAME(RUN_MOST));
}

/* Take the innovations [2 * N_OUTPUTS] of a packed sample into the sums. Missing and blanked values leave them as they are;
   after a step of an input, and after a gap, the scatter is compared with nothing before. */
static inline void accumulate(const Clock *clock, const Inputs *inputs, const Healthy *healthy, Sensors *sensors,
                              const real *packed, const real *innovations)
{
    const real index = AS_REAL(clock->index);
    const real asleep = AS_REAL(clock->begun + WARM_UP_SAMPLES - 1); /* the last sample before the sums began */
    const flag learns = clock->alarm < 0;
    flag gap = NEVER;
    for (int i = 0; i < N_STATES; i++) gap |= healthy->astray[i] != 0.0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        const real score = innovations[j] / ROOT(innovations[N_OUTPUTS + j]);
        const flag counts = is_counted(inputs, packed, j) & is_finite(score);
        const flag blanked = (packed[SAMPLE_USE + j] > 0.0) & NOT(is_trusted(packed, j));
        real scatter[LAGS];
        for (int k = 0; k < LAGS; k++) scatter[k] = sensors->scatter[k][j];
        add_score(sensors, j, score, counts);
        const real nis = usual_square(sensors->nis[j], clip(score), clock->index - clock->begun);
        sensors->nis[j] = PICK(counts & learns, nis, sensors->nis[j]);
        const real mean = sensors->mean[j] + (clip(score) - sensors->mean[j]) * (2.0 / (RUN_LENGTH + 1.0));
        sensors->mean[j] = PICK(counts, mean, sensors->mean[j]);
        const real run = long_run(sensors->run[j], mean, clock->index - clock->begun);
        sensors->run[j] = PICK(counts & learns, run, sensors->run[j]);
        for (int side = 0; side < 2; side++) {
            real *start = &sensors->cusum_start[side][j];
            *start = PICK(sensors->cusum[side][j] <= 0.0, index, greater(*start, asleep));
        }
        for (int k = 0; k < LAGS; k++) {
            sensors->scatter[k][j] = PICK(gap, scatter[k], sensors->scatter[k][j]);
            sensors->before[k][j] = PICK(gap | blanked, SAME(NAN), sensors->before[k][j]);
            sensors->scatter_start[k][j] = PICK(sensors->scatter[k][j] <= 0.0, index, sensors->scatter_start[k][j]);
        }
    }
}

/* Whether a slow error has left its declared size. It counts once it has been watched for as long as its memory: until
   then it stands for parameters that the filter has not learned yet. What wanders is as large as declared, and its limit
   allows for that, so it counts at once. What never alarms has an infinite limit. */
static inline flag slow_error_alarms(const Clock *clock, const real *lane)
{
    const real begun = AS_REAL(clock->begun), accepted = AS_REAL(clock->accepted), from = greater(begun, accepted);
    const real watched = (AS_REAL(clock->index) - from) * (SAMPLE_TIME > 0.0 ? SAME(SAMPLE_TIME) : clock->pause);
    flag found = NEVER;
    for (int k = 0; k < N_SLOW; k++)
        found |= (SIZE(lane[AT_SLOW + k] / SLOW_SD[k]) > SLOW_LIMIT[k]) & (watched >= SLOW_WATCHED[k]);
    return found;
}

#include "walking.h"

/* Whether a sum crossed its limit, a slow error left its size, or a parameter walked too far. */
static inline flag is_alarming(const Clock *clock, const Sensors *sensors, const Healthy *healthy)
{
    flag found = slow_error_alarms(clock, healthy->lane) | (healthy->walk > 1.0);
    for (int j = 0; j < N_OUTPUTS; j++) found |= statistic(sensors, j) > CUSUM_LIMIT;
    return found;
}

/* Whether the healthy lane is one to go on from. */
static inline flag is_sound(const real *lane)
{
    real sums[4] = {SAME(0.0), SAME(0.0), SAME(0.0), SAME(0.0)}; /* no number unless each is finite */
    for (int i = 0; i < PLAIN_NUMBERS; i++) sums[i % 4] += lane[i] - lane[i];
    return sums[0] + sums[1] + sums[2] + sums[3] == 0.0;
}

/* How far the states go; after a gap they are sought, and not known well. */
static inline void learn_travel(Healthy *healthy)
{
    flag sought = NEVER;
    for (int i = 0; i < N_STATES; i++) sought |= healthy->astray[i] != 0.0;
    for (int i = 0; i < N_STATES; i++) {
        real *low = &healthy->travel[0][i], *high = &healthy->travel[1][i];
        *low = PICK(sought, *low, lesser(healthy->lane[i], *low));
        *high = PICK(sought, *high, greater(healthy->lane[i], *high));
    }
}

#undef real
#undef whole
#undef flag
#undef NEVER
#undef SAME
#undef PICK
#undef WHERE
#undef NOT
#undef ANY
#undef AS_REAL
#undef SIZE
#undef ROOT
#undef HYPOT
