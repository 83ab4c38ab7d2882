/* The detector: sums of the innovations of each sensor, slow and fast, and of their scatter; the alarm; and the same sums of
   every lane of the bank, which tell how well it explains what came since.

   A sum with a small drift finds small faults; one with a large drift and a low limit finds large ones in half the time. The
   latter alarms only where a time between false alarms is promised: a few wild values in a row, which real sensors have,
   are enough for it. They also scatter in bursts, of some hundred samples; so the sum of the scatter has patience.
   Source: Page, Biometrika 41 (1954) 100. */
#ifndef FB_DETECTOR_H
#define FB_DETECTOR_H

#include "wild.h"

#define NIS_TRUST 1000    /* samples for which the declared noise counts, */
#define NIS_MEMORY 10000  /* and over which squares are a mean */
#define NIS_LEAST 0.25
#define NIS_MOST 4.0

/* Limit what one sample contributes. */
static inline double clip(double score) { return score > CUSUM_CLIP ? CUSUM_CLIP : score < -CUSUM_CLIP ? -CUSUM_CLIP : score; }

static inline double positive(double sum) { return sum > 0.0 ? sum : 0.0; }

/* Log-likelihood ratio of SCATTER_RATIO times the declared noise, for the difference of two innovations. To each of the last
   ones, since a bias, or what the model gets wrong slowly, is no noise; nor is an oscillation, which returns to where it
   was after some samples. */
static double scatter_gain(double apart)
{
    const double size = fmin(fabs(apart), FB_SQRT2 * CUSUM_CLIP);
    return 0.25 * (1.0 - 1.0 / (SCATTER_RATIO * SCATTER_RATIO)) * size * size - log(SCATTER_RATIO);
}

/* Take the innovation of sensor j, in its standard deviation, into its sums. */
static void add_score(Sensors *sensors, int j, double score)
{
    const double limited = clip(score);
    sensors->cusum[0][j] = positive(sensors->cusum[0][j] + (limited - CUSUM_DRIFT));
    sensors->cusum[1][j] = positive(sensors->cusum[1][j] + (-limited - CUSUM_DRIFT));
    sensors->fast[0][j] = positive(sensors->fast[0][j] + (limited - FAST_DRIFT));
    sensors->fast[1][j] = positive(sensors->fast[1][j] + (-limited - FAST_DRIFT));
    for (int k = 0; k < LAGS; k++) {
        const double gained = sensors->scatter[k][j] + scatter_gain(score - sensors->before[k][j]);
        if (isfinite(sensors->before[k][j])) sensors->scatter[k][j] = positive(gained);
    }
    for (int k = LAGS - 1; k > 0; k--) sensors->before[k][j] = sensors->before[k - 1][j];
    sensors->before[0][j] = score;
}

/* The limit of the slow sums in those of the fast ones, and in those of the scatter. */
static double scale_of_fast(void) { return isfinite(CUSUM_LIMIT) ? CUSUM_LIMIT / FAST_LIMIT : 1.0; }
static double scale_of_scatter(void) { return isfinite(CUSUM_LIMIT) ? CUSUM_LIMIT / SCATTER_LIMIT : 1.0; }

/* The scatter counts as far as it is seen against each of the last innovations. */
static double least_scatter(const Sensors *sensors, int j)
{
    double least = sensors->scatter[0][j];
    for (int k = 1; k < LAGS; k++) least = fmin(least, sensors->scatter[k][j]);
    return least;
}

/* The largest sum of sensor j, in the scale of the slow ones: above CUSUM_LIMIT is an alarm. How far the others are on their
   way counts. */
static double statistic(const Sensors *sensors, int j)
{
    const double fast = scale_of_fast() * fmax(sensors->fast[0][j], sensors->fast[1][j]);
    const double slow = fmax(sensors->cusum[0][j], sensors->cusum[1][j]);
    return fmax(fmax(slow, fast), scale_of_scatter() * least_scatter(sensors, j));
}

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

/* Whether the sums take a sample of sensor j. While an input is unknown for several samples none does: it may stand
   elsewhere, and then errs to one side. */
static int is_counted(const Inputs *inputs, const double *packed, int j)
{
    return is_trusted(packed, j) && !any_unknown(inputs);
}

/* The usual square of a normalised innovation after one more. Declared noises and slow errors are bounds more often than
   facts. Likelihoods reckon with the squares that are seen while the plant is healthy: else a hypothesis would win by the
   size of what it foretells, sample by sample. */
static double usual_square(double nis, double score, int64_t learned)
{
    const int64_t memory = NIS_TRUST + learned < NIS_MEMORY ? NIS_TRUST + learned : NIS_MEMORY;
    return fmin(fmax(nis + (score * score - nis) / (double)memory, NIS_LEAST), NIS_MOST);
}

/* Take the innovations [2 * N_OUTPUTS] of a packed sample into the sums. Missing and blanked values leave them as they are;
   after a step of an input, and after a gap, the scatter is compared with nothing before. */
static void accumulate(const Clock *clock, const Inputs *inputs, const Healthy *healthy, Sensors *sensors,
                       const double *packed, const double *innovations)
{
    const double index = (double)clock->index;
    const double asleep = (double)(clock->begun + WARM_UP_SAMPLES - 1); /* the last sample before the sums began */
    int gap = 0;
    for (int i = 0; i < N_STATES; i++) gap |= healthy->astray[i] != 0.0;
    for (int j = 0; j < N_OUTPUTS; j++) {
        const double score = innovations[j] / sqrt(innovations[N_OUTPUTS + j]);
        const int counts = is_counted(inputs, packed, j) && isfinite(score);
        const int blanked = packed[SAMPLE_USE + j] > 0.0 && !is_trusted(packed, j);
        double scatter[LAGS];
        for (int k = 0; k < LAGS; k++) scatter[k] = sensors->scatter[k][j];
        if (counts) add_score(sensors, j, score);
        if (counts && clock->alarm < 0)
            sensors->nis[j] = usual_square(sensors->nis[j], clip(score), clock->index - clock->begun);
        for (int side = 0; side < 2; side++)
            sensors->cusum_start[side][j] = sensors->cusum[side][j] <= 0.0 ? index : fmax(sensors->cusum_start[side][j], asleep);
        for (int k = 0; k < LAGS; k++) {
            if (gap) sensors->scatter[k][j] = scatter[k];
            if (gap || blanked) sensors->before[k][j] = NAN;
            if (sensors->scatter[k][j] <= 0.0) sensors->scatter_start[k][j] = index;
        }
    }
}

/* Whether a slow error has left its declared size. It counts once it has been watched for as long as its memory: until
   then it stands for parameters that the filter has not learned yet. */
static int slow_error_alarms(const Clock *clock, const double *lane)
{
    const int64_t from = clock->begun > clock->accepted ? clock->begun : clock->accepted;
    const double watched = (double)(clock->index - from) * (SAMPLE_TIME > 0.0 ? SAMPLE_TIME : clock->pause);
    for (int k = 0; k < N_SLOW; k++)
        if (SLOW_ALARMS[k] && fabs(lane[AT_SLOW + k] / SLOW_SD[k]) > SLOW_ERROR_LIMIT && watched >= SLOW_MEMORY[k]) return 1;
    return 0;
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

/* Raise the alarm if a sum crossed its limit, or a slow error left its size: gives the number of the sample of the estimated
   onset, and -1 where there is none. */
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
    if (!crossed && !slow_error_alarms(clock, state->healthy.lane)) return -1;
    if (!crossed) found.crossed[leading] = 1; /* of an alarm of a slow error, the sensor with the largest sum */
    int64_t oldest = clock->begun;
    if (clock->accepted + 1 > oldest) oldest = clock->accepted + 1;
    if (clock->index - HISTORY_SAMPLES > oldest) oldest = clock->index - HISTORY_SAMPLES;
    const double began = beginning(&state->sensors, leading);
    const int64_t change = began >= (double)clock->index ? clock->index : began > (double)oldest ? (int64_t)began : oldest;
    found.time = clock->time;
    found.change_time = row_of(&state->past, change)->time;
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

/* Take the innovations [2 * N_OUTPUTS][N_LANES] of all lanes into their sums. A model that explains the plant has white
   innovations, whatever it is a model of: a lane whose sums cross the limit that raises alarms is contradicted by the
   data. A fault that comes and goes is always right while it is gone; so what has once contradicted it does so from then
   on. */
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
                if (lane >= N_STEPS + SWITCHED && before > CUSUM_LIMIT) sum = fmax(sum, before);
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

#endif
