/* Filters of a plant of which all parameters are given, FB_LANES at a time: what its sensors read that the past and the sensors
   before them did not foretell.

   The same extended Kalman filter as that of the core, but for states, slow errors and input noise alone; each lane has
   parameters and sizes of noise of its own. The model stands before this text: its sizes, tables, rates and readings, see
   `likelihood_text`. A lane is

     z          [states, slow errors, noise of inputs]
     triangle   of its covariance
     felt       what slow errors feel of the moves of inputs
     given      factors of parameters; variances of sensors, slow errors and noise of inputs; rates at which slow errors fade,
                1/s; by how much the variance of these grows with the square of what is felt
     implicit   signals

   A row is [dt, inputs before, inputs, readings, use (1 or 0), held, fade, fresh], see `fit/likelihood.py`. */
#include "integrate.h"

#define ROUNDING 1e-16 /* part of a number that cancellation may leave of it */
#define N_JOINT (N_STATES + N_SLOW + N_NOISY)
#define PLACE(i, j) IN_TRIANGLE(N_JOINT, i, j)
#include "triangle.h"

#define AT_NOISE (N_STATES + N_SLOW)
#define AT_TRIANGLE N_JOINT
#define AT_FELT (AT_TRIANGLE + TRIANGLE(N_JOINT))
#define AT_FACTORS (AT_FELT + N_FELT)
#define AT_OUTPUT_VARIANCE (AT_FACTORS + N_PARAMETERS)
#define AT_SLOW_VARIANCE (AT_OUTPUT_VARIANCE + N_OUTPUTS)
#define AT_NOISE_VARIANCE (AT_SLOW_VARIANCE + N_SLOW)
#define AT_FADING (AT_NOISE_VARIANCE + N_NOISY)
#define AT_EACH (AT_FADING + N_SLOW)
#define AT_SIGNALS (AT_EACH + N_FELT)
#define N_NUMBERS (AT_SIGNALS + N_IMPLICIT)

#define ROW_DT 0
#define ROW_U_BEFORE 1
#define ROW_U (ROW_U_BEFORE + N_INPUTS)
#define ROW_Y (ROW_U + N_INPUTS)
#define ROW_USE (ROW_Y + N_OUTPUTS)
#define ROW_HELD (ROW_USE + N_OUTPUTS)
#define ROW_FADE (ROW_HELD + N_HELD_SENSORS)
#define ROW_FRESH (ROW_FADE + N_INPUTS)
#define N_ROW (ROW_FRESH + N_INPUTS)

/* Memory apart from the stack. */
typedef struct {
    Step step;
    double dt;                           /* of the step that `left` is of; nan: of none yet */
    lanes left[FB_ROOM(N_SLOW)];         /* of the slow errors after it */
    lanes a[FB_ROOM(N_STATES)][N_JOINT]; /* slopes of the states by z */
    lanes t[FB_ROOM(N_STATES)][N_JOINT]; /* these times the covariance */
    lanes lane[N_NUMBERS];
} Work;

/* The vector v of the model under recorded inputs, and these as it takes them: where they move in the course of a step, as errors
   of inputs that are zero. */
static const double *model_at(const lanes *FB_RESTRICT lane, const double *FB_RESTRICT u, lanes *FB_RESTRICT v)
{
    static const double none[FB_ROOM(N_INPUTS)] = {0.0};
    for (int i = 0; i < AT_PARAMETERS; i++) v[i] = lane[i];
    for (int k = 0; k < N_PARAMETERS; k++) v[AT_PARAMETERS + k] = lane[AT_FACTORS + k];
    for (int k = 0; k < N_INPUTS; k++) v[AT_SLOT + k] = broadcast(N_LINEAR > 0 ? u[k] : 0.0);
    for (int k = 0; k < N_NOISY; k++) v[AT_SLOT + NOISY[k]] += lane[AT_NOISE + k];
    return N_LINEAR > 0 ? none : u;
}

/* What slow errors feel of the inputs, and the rest of z with its covariance: these fade, and noise of inputs begins anew or
   lasts. */
static void spread_rest(lanes *FB_RESTRICT lane, const double *FB_RESTRICT row, Work *FB_RESTRICT work)
{
    lanes fade[FB_ROOM(N_SLOW + N_NOISY)], grown[FB_ROOM(N_SLOW + N_NOISY)], *FB_RESTRICT p = lane + AT_TRIANGLE;
    for (int k = 0; k < N_SLOW && row[ROW_DT] != work->dt; k++) work->left[k] = v_exp(-row[ROW_DT] * lane[AT_FADING + k]);
    work->dt = row[ROW_DT];
    for (int k = 0; k < N_SLOW; k++) {
        fade[k] = work->left[k];
        grown[k] = lane[AT_SLOW_VARIANCE + k];
    }
    for (int e = 0; e < N_FELT; e++) {
        const int error = FELT_ERROR[e], input = FELT_INPUT[e];
        lane[AT_FELT + e] = lane[AT_FELT + e] * fade[error] + (row[ROW_U + input] - row[ROW_U_BEFORE + input]);
        grown[error] += lane[AT_EACH + e] * lane[AT_FELT + e] * lane[AT_FELT + e];
    }
    for (int k = 0; k < N_SLOW; k++) grown[k] *= 1.0 - fade[k] * fade[k];
    for (int k = 0; k < N_NOISY; k++) {
        fade[N_SLOW + k] = broadcast(row[ROW_FADE + NOISY[k]]);
        grown[N_SLOW + k] = lane[AT_NOISE_VARIANCE + k] * row[ROW_FRESH + NOISY[k]];
    }
    for (int i = N_STATES; i < N_JOINT; i++) {
        const lanes left = fade[i - N_STATES];
        for (int j = 0; j < i; j++) p[PLACE(j, i)] *= left;
        p[PLACE(i, i)] = p[PLACE(i, i)] * (left * left) + grown[i - N_STATES];
        for (int j = i + 1; j < N_JOINT; j++) p[PLACE(i, j)] *= left;
        lane[i] *= left;
    }
}

/* From the row before to this one. What lags before a sensor that does not read as stated stays where it was, and may be anywhere
   once the sensor does: the law that it would follow may have no value. */
static void predict(lanes *FB_RESTRICT lane, const double *FB_RESTRICT row, Work *FB_RESTRICT work)
{
    lanes v[N_V], climb[FB_ROOM(N_INPUTS)], before[FB_ROOM(N_HELD_STATES)], *FB_RESTRICT p = lane + AT_TRIANGLE;
    double begin[FB_ROOM(N_INPUTS)];
    for (int s = 0; s < N_HELD_STATES; s++) before[s] = lane[HELD_STATE[s]];
    for (int k = 0; k < N_INPUTS; k++) {
        begin[k] = row[(INPUT_NEXT[k] ? ROW_U : ROW_U_BEFORE) + k];
        climb[k] = broadcast(INPUT_LINEAR[k] ? row[ROW_U + k] - row[ROW_U_BEFORE + k] : 0.0);
    }
    const double *FB_RESTRICT u = model_at(lane, begin, v);
    integrate(v, u, climb, row[ROW_DT], 0, 1, lane + AT_SIGNALS, &work->step);
    for (int i = 0; i < N_STATES; i++) {
        for (int e = STATE_ROW[i]; e < STATE_ROW[i + 1]; e++) work->a[i][STATE_PLACE[e]] = broadcast(0.0);
        FOR_REACH (i, c) if (JOINT_OF[c] >= 0) work->a[i][JOINT_OF[c]] = WIDE(work->step.slope[i][c]);
        lane[i] = v[i];
    }
    for (int s = 0; s < N_HELD_STATES; s++) {
        const int i = HELD_STATE[s];
        if (!(row[ROW_HELD + HELD_BY[s]] > 0.0)) continue;
        lane[i] = before[s];
        for (int e = STATE_ROW[i]; e < STATE_ROW[i + 1]; e++) work->a[i][STATE_PLACE[e]] = broadcast(0.0);
    }
    spread_states(p, work->a, work->t);
    for (int s = 0; s < N_HELD_STATES; s++)
        if (row[ROW_HELD + HELD_BY[s]] > 0.0) p[PLACE(HELD_STATE[s], HELD_STATE[s])] += HELD_VARIANCE[s];
    spread_rest(lane, row, work);
}

/* Take the sensors one after the other; `seen`: for each the difference from what the past and the sensors before it foretell, then
   the variances of these. Of a sensor that reads only at times as stated nothing is expected at others. */
static void update(lanes *FB_RESTRICT lane, const double *FB_RESTRICT row, lanes *FB_RESTRICT seen)
{
    lanes v[N_V], y[N_OUTPUTS], slopes[FB_ROOM(N_READING_SLOPES)], shift[N_JOINT], *p = lane + AT_TRIANGLE;
    const double *FB_RESTRICT u = model_at(lane, row + ROW_U, v);
    solve_implicit(v, u, lane + AT_SIGNALS);
    model_readings(v, u, lane + AT_SIGNALS, y, slopes);
    for (int i = 0; i < N_JOINT; i++) shift[i] = broadcast(0.0);
    for (int j = 0; j < N_OUTPUTS; j++) {
        lanes slope[N_JOINT], cross[1][N_JOINT], weight[1][N_JOINT];
        const double use = row[ROW_USE + j];
        const int stated = !CONDITIONAL[j] || use > 0.0;
        for (int e = OUT_ROW[j]; e < OUT_ROW[j + 1]; e++) slope[OUT_PLACE[e]] = broadcast(0.0);
        for (int e = READING_ROW[j]; stated && e < READING_ROW[j + 1]; e++) slope[JOINT_OF[READING_COLUMN[e]]] = slopes[e];
        if (!stated) y[j] = broadcast(0.0);
        times(j, p, slope, cross[0]);
        const lanes noise = lane[AT_OUTPUT_VARIANCE + j] * (1.0 + OUTPUT_GROWTH[j] * y[j] * y[j]);
        seen[j] = row[ROW_Y + j] - y[j] - along(slope, shift, j);
        seen[N_OUTPUTS + j] = along(slope, cross[0], j) + noise;
        if (!(use > 0.0)) continue;
        for (int i = 0; i < N_JOINT; i++) {
            weight[0][i] = cross[0][i] / seen[N_OUTPUTS + j];
            shift[i] += weight[0][i] * seen[j];
        }
        take_off(p, weight, cross, 1, p);
    }
    for (int i = 0; i < N_JOINT; i++) lane[i] += shift[i];
}

/* Take rows [n_rows][N_ROW] into lanes `first` to `end`, a multiple of FB_LANES, of `numbers` [N_NUMBERS][n_lanes], in
   place; `seen` [n_rows][2 * N_OUTPUTS][n_lanes]. */
void faultbond_advance(
    int64_t first, int64_t end, int64_t n_lanes, int64_t n_rows, const double *rows, double *numbers, double *seen)
{
    Work work;
    lanes found[2 * N_OUTPUTS];
    for (; first < end; first += FB_LANES) {
        work.dt = work.step.dt = NAN;
        for (int64_t i = 0; i < N_NUMBERS; i++) work.lane[i] = load(numbers + i * n_lanes + first);
        for (int64_t t = 0; t < n_rows; t++) {
            predict(work.lane, rows + t * N_ROW, &work);
            update(work.lane, rows + t * N_ROW, found);
            for (int64_t i = 0; i < 2 * N_OUTPUTS; i++) store(seen + (t * 2 * N_OUTPUTS + i) * n_lanes + first, found[i]);
        }
        for (int64_t i = 0; i < N_NUMBERS; i++) store(numbers + i * n_lanes + first, work.lane[i]);
    }
}
