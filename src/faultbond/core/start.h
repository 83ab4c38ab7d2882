/* The start of the plant, solved from the first samples where the model does not give it.

   Least squares over the first samples with nominal parameters; the filter itself predicts (with every measurement
   switched off and nothing uncertain), so no other form of the model is needed. A state that these samples do not
   show is taken from where the nominal plant would settle under the first inputs, and is as uncertain as it is
   large. Formulas: docs/method.md, "The joint filter"; Levenberg 1944 and Marquardt 1963. */
#ifndef FB_START_H
#define FB_START_H

#include "given.h"
#include "shown.h"

FB_SELDOM

#define START_PATIENCE 300 /* samples for which a sensor without any value holds up the start */
#define MOST_FIRST (START_PATIENCE + 2 < DEPTH ? START_PATIENCE + 2 : DEPTH) /* samples that a start is solved from */
#define FIRST_READINGS (MOST_FIRST * N_OUTPUTS)
#define N_UNKNOWN (AT_SLOT - N_STATES) /* slow errors and parameters */

#define GUESSES 5            /* from which the start is sought */
#define SHOWN 4              /* that of the first readings */
#define START_ITERATIONS 12
#define START_SECANTS 8
#define DOUBLINGS 12         /* of the step, while the plant settles */
#define ABSURD_STATE 1e12
#define FAR_SETTLED 1e3      /* sizes of a state that a settled value may lie off; the plant reached none farther off */
#define FAR_SHOWN 10.0       /* sizes of a state that it may be shown off, where these are to be believed */
#define PART_OF_SD 0.1       /* of what a parameter may be off, over which slopes are taken */
#define PART_OF_SIZE 1e-6    /* of a state, alike */
#define RUN_AWAY 1e6         /* misfit, sd of the noise, of a plant that has run away */
#define STEEPEST 1e100       /* slope that can still be squared */
#define WIDER 3.0            /* how much wider than the fit says the start is: the same samples are filtered again */
#define LEAST_TRIED 1e-6     /* size of a state, SI, at which laws are tried that have no value where they begin, */
#define DECADES 16           /* and how often ten times as much */
#define UNEQUAL 0.125        /* parts by which states are apart there, as a flow may have no slope between equal pressures */
#define NOTHING_OF_SIZE 1e-9 /* part of a state's size below which it is zero but for rounding, which tells nothing */
#define REACH_OF_STATE 2.0   /* a state is at most about this many times what the measured outputs suggest */
#define PART_OF_INPUT 0.1    /* of an input, by which what lags behind it may be off at first */
#define AT_INPUTS 2          /* beside `again`: what lags behind inputs begins where these are, and is not sought */

/* One guess on its way. Columns stand in memory one after the other. */
typedef struct {
    double state[FB_ROOM(N_STATES)], trial[FB_ROOM(N_STATES)];
    double cost, damping;
    int moved;                                        /* whether `slope` is not that at `state` */
    double misfit[FIRST_READINGS], tried[FIRST_READINGS]; /* at `state`, and at `trial` */
    double slope[FB_ROOM(N_STATES)][FIRST_READINGS];  /* of the misfits by the free states, in units of their size */
} Guess;

/* Memory of a solution. `sure` is the healthy lane without uncertainty; lanes that were asked for wait until there
   are enough of them, or nothing else can be done. */
typedef struct {
    Filter_plain *filter;
    const Normal *normal;
    const double *known;                      /* lane whose parameters hold; NULL: the nominal ones do */
    int64_t count, n_readings;
    double off[MOST_FIRST][N_SAMPLE];         /* the samples with every measurement switched off */
    double weight[FIRST_READINGS];            /* of each misfit; 0 where missing */
    double sure[PLAIN_NUMBERS];
    int asked;
    double z[FB_ROOM(AT_SLOT)][FB_LANES];     /* where the lanes begin that were asked for, */
    double *to[FB_LANES];                     /* and where their misfits go */
    int n_free, free[FB_ROOM(N_STATES)];      /* states that are not known exactly, */
    double centre[FB_ROOM(N_STATES)], size[FB_ROOM(N_STATES)]; /* what is known of all beforehand, mean and sd */
    double from[FB_ROOM(N_STATES)];           /* where laws have values: the stated means, if they have there */
    double shown[FB_ROOM(N_STATES)];          /* what the first readings show, begun there */
    Guess guesses[GUESSES];
    double rows[FB_ROOM(N_STATES)][FIRST_READINGS + 2 * N_STATES]; /* reflections, see `triangularise` */
    double diagonal[FB_ROOM(N_STATES)];
    double right[FIRST_READINGS + 2 * N_STATES];
    double inverse[FB_ROOM(N_STATES)][FB_ROOM(N_STATES)]; /* of R, column by column */
    double spread[FB_ROOM(N_STATES)][FB_ROOM(N_STATES)];
    double columns[FB_LANES][FIRST_READINGS];
    double still[N_SAMPLE], settling[PLAIN_NUMBERS];
    int held;                                 /* 1: what lags behind inputs begins where these are */
    double led[FB_ROOM(N_STATES)][FB_ROOM(N_UNKNOWN)]; /* slopes of the states that were found by what is unknown */
} SolveMemory;

/* Memory of beginning from the first samples: these, packed, and what was solved from them. `known`: a lane whose parameters hold. */
typedef struct {
    double samples[MOST_FIRST][N_SAMPLE], known[PLAIN_NUMBERS];
    double mean[FB_ROOM(N_STATES)], covariance[FB_ROOM(AT_SLOT * AT_SLOT)], lane[PLAIN_NUMBERS];
    SolveMemory solve;
} FirstMemory;

/* Covariance of numbers i <= j of z of a healthy plant, j being no state; `known`: a lane whose parameters hold, or
   NULL. */
static double healthy_covariance(const double *known, int i, int j)
{
    if (known && i >= AT_SLOW && j < AT_SLOT) return known[PLAIN_PLACE(i, j)];
    if (i >= AT_PARAMETERS && j < AT_SLOT) return declared_covariance(i - AT_PARAMETERS, j - AT_PARAMETERS);
    if (i != j) return 0.0;
    const double sd = i < AT_PARAMETERS ? SLOW_SD[i - AT_SLOW] : INPUT_NOISE[NOISY[i - AT_SLOT]];
    return sd * sd;
}

/* The lane of a healthy plant. `covariance`: [n][n], of the states, or of states, slow errors and parameters. `known`: a
   lane whose parameters, and sizes of slow errors, are taken in place of the nominal ones; NULL: these hold. */
static void healthy_lane(const double *mean, const double *covariance, int n, const double *known, double *lane)
{
    for (int i = 0; i < PLAIN_JOINT; i++) {
        const int is_parameter = i >= AT_PARAMETERS && i < AT_SLOT;
        lane[i] = i < N_STATES ? mean[i] : !is_parameter ? 0.0 : known ? known[i] : HEALTHY[i - AT_PARAMETERS];
        for (int j = i; j < PLAIN_JOINT; j++)
            lane[PLAIN_PLACE(i, j)] = j < n          ? covariance[i * n + j]
                                      : i < N_STATES ? 0.0
                                                     : healthy_covariance(known, i, j);
    }
    for (int k = 0; k < N_IMPLICIT; k++) lane[PLAIN_IMPLICIT + k] = LOOP_GUESS[k];
    lane[PLAIN_LIKELIHOOD] = 0.0;
}

/* Take the samples that misfits are of, and the parameters that hold. */
static void take_first(double (*samples)[N_SAMPLE], int64_t count, const double *known, const Normal *normal,
                       SolveMemory *memory, Filter_plain *work)
{
    memory->filter = work;
    memory->normal = normal;
    memory->known = known;
    memory->count = count;
    memory->n_readings = count * N_OUTPUTS;
    memory->asked = 0;
    for (int64_t t = 0; t < count; t++) {
        memcpy(memory->off[t], samples[t], sizeof memory->off[t]);
        for (int j = 0; j < N_OUTPUTS; j++) {
            const double used = samples[t][SAMPLE_USE + j], scale = samples[t][SAMPLE_SCALE + j];
            memory->weight[t * N_OUTPUTS + j] = used / sqrt(scale * noise_at(j, used * samples[t][SAMPLE_Y + j]));
            memory->off[t][SAMPLE_USE + j] = 0.0;
        }
    }
    healthy_lane(START_MEAN, NULL, 0, known, memory->sure);
    for (int k = 0; k < TRIANGLE(PLAIN_JOINT); k++) memory->sure[PLAIN_COVARIANCE + k] = 0.0;
}

/* Give the misfits of the lanes that were asked for: measured less predicted in sd of the noise, 0 where missing. */
static void answer(SolveMemory *memory)
{
    Filter_plain *FB_RESTRICT work = memory->filter;
    const int asked = memory->asked;
    memory->asked = 0;
    if (asked == 0) return;
    for (int i = 0; i < PLAIN_NUMBERS; i++)
        if (i < PLAIN_COVARIANCE || i >= PLAIN_IMPLICIT) work->lane[i] = broadcast(memory->sure[i]);
    for (int i = 0; i < AT_SLOT; i++) {
        for (int l = asked; l < FB_LANES; l++) memory->z[i][l] = memory->z[i][0];
        work->lane[i] = load(memory->z[i]);
    }
    for (int64_t t = 0; t < memory->count; t++) {
        if (drifts(memory->normal)) drift_on(memory->normal, memory->off[t][SAMPLE_DT], work->lane, PLAIN_JOINT);
        filter_follow_plain(work->lane, memory->off[t], work->innovations, work);
        for (int j = 0; j < N_OUTPUTS; j++) {
            const int64_t k = t * N_OUTPUTS + j;
            const double weight = memory->weight[k];
            const lanes misfit = weight > 0.0 ? work->innovations[j] * weight : broadcast(0.0); /* what is not used may be none */
            const lanes lost = choose(misfit < 0.0, broadcast(-RUN_AWAY), broadcast(RUN_AWAY));
            double found[FB_LANES];
            store(found, choose(misfit - misfit == 0.0, misfit, lost));
            for (int l = 0; l < asked; l++) memory->to[l][k] = found[l];
        }
    }
}

/* Ask for the misfits of a plant that begins at `state`, with number `place` of z moved; they stand in `to` after
   `answer`. */
static void ask(const double *state, int place, double move, double *to, SolveMemory *memory)
{
    const int l = memory->asked++;
    for (int i = 0; i < AT_SLOT; i++) memory->z[i][l] = i < N_STATES ? state[i] : memory->sure[i];
    if (move != 0.0) memory->z[place][l] += move;
    memory->to[l] = to;
    if (memory->asked == FB_LANES) answer(memory);
}

/* The sds of the stated starts; contents are stated, so the parameters of the stores count too. */
static void stated_sds(double *sd)
{
    for (int i = 0; i < N_STATES; i++) {
        double sum = isnan(START_SD[i]) ? 0.0 : START_SD[i] * START_SD[i];
        for (int e = JUMP_ROW[i]; e < JUMP_ROW[i + 1]; e++) {
            const double slope = START_MEAN[i] * JUMP_EXPONENT[e], off = slope * ACCURACY[JUMP_PARAMETER[e]];
            sum += off * off;
            for (int f = JUMP_ROW[i]; f < e; f++)
                sum += 2.0 * slope * START_MEAN[i] * JUMP_EXPONENT[f] * declared_covariance(JUMP_PARAMETER[e], JUMP_PARAMETER[f]);
        }
        sd[i] = sqrt(sum);
    }
}

/* The states of the nominal plant after a long while under the first inputs; their stated means where they run
   away. The step is L-stable, so ever longer ones settle what can settle. */
static void settle(SolveMemory *memory, double *settled)
{
    double *sample = memory->still, *lane = memory->settling;
    memcpy(sample, memory->off[0], sizeof memory->still);
    for (int k = 0; k < N_SLOW; k++) sample[SAMPLE_KICK + k] = 0.0;
    for (int i = 0; i < N_STATES; i++) sample[SAMPLE_GAP + i] = 0.0;
    for (int k = 0; k < N_INPUTS; k++) sample[SAMPLE_U_BEFORE + k] = sample[SAMPLE_U + k];
    sample[SAMPLE_DT] = SAMPLE_TIME > 0.0 ? SAMPLE_TIME : 1.0;
    memcpy(lane, memory->sure, sizeof memory->settling);
    for (int doubling = 0; doubling < DOUBLINGS; doubling++) {
        for (int k = 0; k < 4; k++) advance_one(lane, sample, memory->normal, NULL, memory->filter);
        for (int i = 0; i < N_STATES; i++) /* a law may have no value at the start alone, as a quotient by a flow of 0 */
            if (!isfinite(lane[i])) lane[i] = START_MEAN[i];
        sample[SAMPLE_DT] *= 2.0;
    }
    for (int i = 0; i < N_STATES; i++) settled[i] = fabs(lane[i]) < ABSURD_STATE ? lane[i] : START_MEAN[i];
}

/* Sum of squares of n numbers. */
static double sum_of_squares(const double *of, int64_t n)
{
    double sum = 0.0;
    for (int64_t k = 0; k < n; k++) sum += of[k] * of[k];
    return sum;
}

/* Whether a plant has run away, or a law has no value. */
static int is_lost(const double *misfit, int64_t n)
{
    for (int64_t k = 0; k < n; k++)
        if (fabs(misfit[k]) >= RUN_AWAY) return 1;
    return 0;
}

/* Whether a law has no value, see `answer`; a sensor that is very precise may well be off by more. */
static int has_no_value(const double *misfit, int64_t n)
{
    for (int64_t k = 0; k < n; k++)
        if (fabs(misfit[k]) == RUN_AWAY) return 1;
    return 0;
}

/* Whether all laws have values at `from`; the misfits there go to `base`. */
static int has_values(double *base, SolveMemory *memory)
{
    ask(memory->from, 0, 0.0, base, memory);
    answer(memory);
    return !is_lost(base, memory->n_readings);
}

/* Set `from` to the decade of the unknown states in which the readings are nearest. */
static void find_decade(const int *unknown, int n, double *base, SolveMemory *memory)
{
    double least = INFINITY, tried = LEAST_TRIED, nearest = LEAST_TRIED;
    for (int decade = 0; decade <= DECADES; decade++) {
        const double at = decade < DECADES ? tried : nearest;
        for (int c = 0; c < n; c++) memory->from[unknown[c]] = START_MEAN[unknown[c]] + at * (1.0 + UNEQUAL * (double)(n - c));
        has_values(base, memory);
        const double square = sum_of_squares(base, memory->n_readings);
        if (square < least) {
            least = square;
            nearest = at;
        }
        tried *= 10.0;
    }
}

/* The size of each unknown state at which it would explain outputs, `total` sd of the noise on the whole, and its `effect` with
   it, by secants from `from`. Where laws have no value, as of an accumulator that holds more than its volume, what they miss says nothing:
   then halfway, in logarithm, to where they had. Gives whether they have values there. */
static int follow_secants(const int *unknown, int n, double total, const double *base, double *effect, SolveMemory *memory)
{
    double *size = memory->size, reached[FB_ROOM(N_STATES)];
    int lost = 0;
    for (int c = 0; c < n; c++) {
        size[unknown[c]] = 1.0;
        reached[c] = effect[c] = 0.0;
    }
    for (int secant = 0; secant < START_SECANTS; secant++) {
        for (int c = 0; c < n; c++) ask(memory->from, unknown[c], size[unknown[c]], memory->guesses[0].slope[c], memory);
        answer(memory);
        for (int c = 0; c < n; c++) {
            double *slope = memory->guesses[0].slope[c], *own = &size[unknown[c]];
            lost |= secant >= START_SECANTS - 2 && is_lost(slope, memory->n_readings);
            if (has_no_value(slope, memory->n_readings)) {
                *own *= reached[c] > 0.0 ? sqrt(reached[c] / *own) : 1e-3;
                continue;
            }
            reached[c] = *own;
            for (int64_t k = 0; k < memory->n_readings; k++) slope[k] = (slope[k] - base[k]) / *own;
            effect[c] = sqrt(sum_of_squares(slope, memory->n_readings)) * *own;
            const double factor = total / (effect[c] < 1e-300 ? 1e-300 : effect[c]);
            *own *= factor < 1e-3 ? 1e-3 : factor > 1e3 ? 1e3 : factor;
        }
    }
    return !lost;
}

/* The size of each unknown state at which it would explain outputs as large as the measured ones. By secants of
   that size, not by slopes: at rest the slope of a turbulent flow says nothing about the plant in use. Begun where laws have
   values, there and nearby: as stated, else where the plant settles, else where the readings are nearest. Between equal
   pressures a flow has no slope: there a plant may have values where it begins and nowhere else. */
static void find_sizes(double (*samples)[N_SAMPLE], const int *unknown, int n, const double *const *footings, int n_footings,
                       SolveMemory *memory)
{
    double *base = memory->guesses[0].misfit, *size = memory->size, squares = 0.0, effect[FB_ROOM(N_STATES)];
    for (int64_t t = 0; t < memory->count; t++)
        for (int j = 0; j < N_OUTPUTS; j++) {
            const double measured = samples[t][SAMPLE_Y + j] * samples[t][SAMPLE_USE + j] / OUTPUT_NOISE[j];
            squares += measured * measured;
        }
    const double total = sqrt(squares) + sqrt((double)memory->n_readings);
    for (int k = 0; k <= n_footings; k++) {
        memcpy(memory->from, k < n_footings ? footings[k] : memory->centre, sizeof memory->from);
        if (k == n_footings) find_decade(unknown, n, base, memory);
        else if (!has_values(base, memory)) continue;
        if (follow_secants(unknown, n, total, base, effect, memory)) break;
    }
    for (int c = 0; c < n; c++) {
        double *own = &size[unknown[c]], usual = fabs(memory->centre[unknown[c]]);
        if (!(usual > NOTHING_OF_SIZE * *own)) usual = STATE_USUAL[unknown[c]]; /* at rest an empty store, as a belt, settles empty */
        const int hidden = usual > 0.0 && *own / total > usual; /* even its whole usual value would drown in noise */
        *own = effect[c] <= 0.0 ? (usual > 0.0 ? usual : 1.0) : hidden ? usual : *own * REACH_OF_STATE;
    }
}

/* Take s v off a vector so that it is reflected; `half`: half the square of v, which begins at number `first`. */
static void reflect(const double *v, double half, int64_t first, int64_t n_rows, double *vector)
{
    double sum = 0.0;
    for (int64_t i = first; i < n_rows; i++) sum += v[i] * vector[i];
    sum /= half;
    for (int64_t i = first; i < n_rows; i++) vector[i] -= sum * v[i];
}

/* Half the square of the vector that column k was reflected by. */
static double half_square(const SolveMemory *memory, int k) { return -memory->diagonal[k] * memory->rows[k][k]; }

/* Bring the n columns of `rows` to triangular form R by reflections. R stands above the diagonal and in `diagonal`,
   the vectors of the reflections on the diagonal and below. Source: Golub and Van Loan, Matrix Computations, 4th
   ed., 5.2.2. */
static void triangularise(int n, int64_t n_rows, SolveMemory *memory)
{
    for (int k = 0; k < n; k++) {
        double *column = memory->rows[k];
        const double norm = sqrt(sum_of_squares(column + k, n_rows - k));
        memory->diagonal[k] = column[k] > 0.0 ? -norm : norm;
        column[k] -= memory->diagonal[k];
        for (int c = k + 1; c < n; c++) reflect(column, half_square(memory, k), k, n_rows, memory->rows[c]);
    }
}

/* Solve R x = x in place. */
static void solve_triangle(int n, const SolveMemory *memory, double *x)
{
    for (int k = n - 1; k >= 0; k--) {
        const double *column = &memory->rows[k][0];
        x[k] /= memory->diagonal[k];
        for (double *to = x; to < x + k; to++) *to -= *column++ * x[k];
    }
}

/* The x with the least square of `rows` x - `right`, after `triangularise`; changes `right`, whose numbers may be
   too large to be squared. */
static void least_squares(int n, int64_t n_rows, SolveMemory *memory, double *x)
{
    double *right = memory->right, largest = 0.0;
    for (int64_t i = 0; i < n_rows; i++) largest = fabs(right[i]) > largest ? fabs(right[i]) : largest;
    if (largest == 0.0) largest = 1.0;
    for (int64_t i = 0; i < n_rows; i++) right[i] /= largest;
    for (int k = 0; k < n; k++) reflect(memory->rows[k], half_square(memory, k), k, n_rows, right);
    solve_triangle(n, memory, right);
    for (int i = 0; i < n; i++) x[i] = right[i] * largest;
}

/* How far a free state is moved for its slope. */
static double move_of(const Guess *guess, const SolveMemory *memory, int i)
{
    return PART_OF_SIZE * fmax(fabs(guess->state[i]), memory->size[i]);
}

/* Differences, as they were asked for, as slopes by free states in units of their size. */
static void take_slopes(Guess *guess, const SolveMemory *memory)
{
    for (int c = 0; c < memory->n_free; c++) {
        const double move = move_of(guess, memory, memory->free[c]), size = memory->size[memory->free[c]];
        for (int64_t k = 0; k < memory->n_readings; k++) {
            const double slope = (guess->slope[c][k] - guess->misfit[k]) / move * size;
            guess->slope[c][k] = isnan(slope) ? 0.0 : fmax(fmin(slope, STEEPEST), -STEEPEST);
        }
    }
}

/* Lay slopes into `rows`, and under them a unit matrix: what is known beforehand, in units of the sizes. */
static void lay_rows(const Guess *guess, SolveMemory *memory)
{
    for (int c = 0; c < memory->n_free; c++) {
        double *column = memory->rows[c], *below = column + memory->n_readings;
        memcpy(column, guess->slope[c], (size_t)memory->n_readings * sizeof *column);
        for (int i = 0; i < memory->n_free; i++) below[i] = i == c;
    }
}

/* The damped step to the least sum of squares of misfit and distance (Levenberg-Marquardt): by least squares on the
   slopes themselves, not on their squares, so that no direction is lost however precise the sensors are. */
static void try_step(Guess *guess, SolveMemory *memory)
{
    const int n = memory->n_free;
    const int64_t n_readings = memory->n_readings, n_rows = n_readings + 2 * n;
    double step[FB_ROOM(N_STATES)], *right = memory->right;
    lay_rows(guess, memory);
    for (int c = 0; c < n; c++) {
        double *damped = memory->rows[c] + n_readings + n;
        for (int i = 0; i < n; i++) damped[i] = 0.0;
        damped[c] = sqrt(guess->damping * (1.0 + sum_of_squares(guess->slope[c], n_readings)));
        const int i = memory->free[c];
        right[n_readings + c] = (guess->state[i] - memory->centre[i]) / memory->size[i];
        right[n_readings + n + c] = 0.0;
    }
    memcpy(right, guess->misfit, (size_t)n_readings * sizeof *right);
    triangularise(n, n_rows, memory);
    least_squares(n, n_rows, memory, step);
    memcpy(guess->trial, guess->state, sizeof guess->trial);
    for (int c = 0; c < n; c++) guess->trial[memory->free[c]] += memory->size[memory->free[c]] * -step[c];
}

/* Sum of squares of the misfits, and of how far a state is from what is known of it. */
static double cost_of(const double *state, const double *misfit, const SolveMemory *memory)
{
    double away = 0.0;
    for (int c = 0; c < memory->n_free; c++) {
        const int i = memory->free[c];
        const double apart = (state[i] - memory->centre[i]) / memory->size[i];
        away += apart * apart;
    }
    return sum_of_squares(misfit, memory->n_readings) + away;
}

/* Whether state i lags behind an input and begins where that is. */
static inline int is_held(const SolveMemory *memory, int i) { return memory->held && START_INPUT[i] >= 0; }

/* Begin all guesses: settled, where laws have values, away from zero on the positive side, and as the first readings show. */
static void begin_guesses(SolveMemory *memory)
{
    static const double parts[] = {0.0, 0.0, 0.3, 1.0, 0.0};
    for (int g = 0; g < GUESSES; g++) {
        Guess *guess = &memory->guesses[g];
        const double *const at = g == 0 ? memory->centre : g == 1 ? memory->from : g == SHOWN ? memory->shown : START_MEAN;
        memcpy(guess->state, at, sizeof guess->state);
        for (int i = 0; i < N_STATES; i++)
            if (is_held(memory, i)) guess->state[i] = memory->centre[i];
        for (int c = 0; parts[g] > 0.0 && c < memory->n_free; c++)
            guess->state[memory->free[c]] += parts[g] * memory->size[memory->free[c]] / REACH_OF_STATE;
        guess->damping = 1e-3;
        guess->moved = 1;
        ask(guess->state, 0, 0.0, guess->misfit, memory);
    }
    answer(memory);
    for (int g = 0; g < GUESSES; g++)
        memory->guesses[g].cost = cost_of(memory->guesses[g].state, memory->guesses[g].misfit, memory);
}

/* One step of Levenberg and Marquardt with each guess, all side by side. */
static void better_guesses(SolveMemory *memory)
{
    for (int g = 0; g < GUESSES; g++) {
        Guess *guess = &memory->guesses[g];
        for (int c = 0; guess->moved && c < memory->n_free; c++)
            ask(guess->state, memory->free[c], move_of(guess, memory, memory->free[c]), guess->slope[c], memory);
    }
    answer(memory);
    for (int g = 0; g < GUESSES; g++) {
        Guess *guess = &memory->guesses[g];
        if (guess->moved) take_slopes(guess, memory);
        try_step(guess, memory);
        ask(guess->trial, 0, 0.0, guess->tried, memory);
    }
    answer(memory);
    for (int g = 0; g < GUESSES; g++) {
        Guess *guess = &memory->guesses[g];
        const double cost = cost_of(guess->trial, guess->tried, memory);
        guess->moved = cost < guess->cost;
        guess->damping = guess->moved ? fmax(guess->damping / 10.0, 1e-9) : fmin(guess->damping * 10.0, 1e9);
        if (!guess->moved) continue;
        guess->cost = cost;
        memcpy(guess->state, guess->trial, sizeof guess->state);
        memcpy(guess->misfit, guess->tried, (size_t)memory->n_readings * sizeof *guess->misfit);
    }
}

/* What slopes S and a unit prior leave of the free states, (1 + S'S)^-1: with the triangle R of both, R^-1 R^-T. */
static void find_spread(SolveMemory *memory)
{
    const int n = memory->n_free;
    for (int c = 0; c < n; c++) {
        for (int i = 0; i < n; i++) memory->inverse[c][i] = i == c;
        solve_triangle(c + 1, memory, memory->inverse[c]);
    }
    for (int i = 0; i < n; i++)
        for (int j = i; j < n; j++) {
            double sum = 0.0;
            for (int c = j; c < n; c++) sum += memory->inverse[c][i] * memory->inverse[c][j];
            memory->spread[i][j] = memory->spread[j][i] = sum;
        }
}

/* How the free states that were found go with slow errors and parameters: what explains their slopes of the
   misfits, which count nothing where the plant runs away. After `lay_rows` and `triangularise`. */
static void find_led(const Guess *best, SolveMemory *memory)
{
    const int n = memory->n_free;
    const int64_t n_readings = memory->n_readings;
    double found[FB_ROOM(N_STATES)], sd[FB_LANES];
    for (int first = 0; first < N_UNKNOWN; first += FB_LANES) {
        const int count = first + FB_LANES < N_UNKNOWN ? FB_LANES : N_UNKNOWN - first;
        for (int l = 0; l < count; l++) {
            sd[l] = sqrt(healthy_covariance(memory->known, AT_SLOW + first + l, AT_SLOW + first + l));
            ask(best->state, AT_SLOW + first + l, PART_OF_SD * sd[l], memory->columns[l], memory);
        }
        answer(memory);
        for (int l = 0; l < count; l++) {
            for (int64_t k = 0; k < n_readings; k++) {
                const double misfit = memory->columns[l][k], base = best->misfit[k];
                const int near = fmax(fabs(misfit), fabs(base)) < RUN_AWAY;
                memory->right[k] = near ? (misfit - base) / (sd[l] > 0.0 ? PART_OF_SD * sd[l] : 1.0) : 0.0;
            }
            for (int c = 0; c < n; c++) memory->right[n_readings + c] = 0.0;
            least_squares(n, n_readings + n, memory, found);
            for (int c = 0; c < n; c++)
                memory->led[memory->free[c]][first + l] = -memory->size[memory->free[c]] * found[c];
        }
    }
}

/* Let states that were found with parameters that are off be off with them. `covariance`: [AT_SLOT][AT_SLOT]. */
static void follow_unknown(const double *known, double (*led)[FB_ROOM(N_UNKNOWN)], double *covariance)
{
    double cross[FB_ROOM(N_UNKNOWN)];
    for (int i = 0; i < N_STATES; i++) {
        for (int k = 0; k < N_UNKNOWN; k++) {
            cross[k] = 0.0;
            for (int m = 0; m < N_UNKNOWN; m++)
                cross[k] += led[i][m] * healthy_covariance(known, AT_SLOW + (m < k ? m : k), AT_SLOW + (m < k ? k : m));
            covariance[i * AT_SLOT + AT_SLOW + k] = covariance[(AT_SLOW + k) * AT_SLOT + i] = cross[k];
        }
        for (int j = i; j < N_STATES; j++) {
            double sum = 0.0;
            for (int k = 0; k < N_UNKNOWN; k++) sum += cross[k] * led[j][k];
            covariance[i * AT_SLOT + j] += sum;
            covariance[j * AT_SLOT + i] = covariance[i * AT_SLOT + j];
        }
    }
}

/* How far what lags behind input k may be from where that is at first: a part of it, and what counts as no step. */
static double lag_behind(double (*samples)[N_SAMPLE], int64_t count, int k)
{
    double largest = 0.0;
    for (int64_t t = 0; t < count; t++) largest = fmax(largest, fabs(samples[t][SAMPLE_U + k]));
    return PART_OF_INPUT * largest + INPUT_STEP[k];
}

/* Find what the first readings show, from where laws have values. Gives whether an unknown state is shown far from where it was
   thought to be: then the plant is in use far from where its sizes were taken. */
static int is_shown_far(double (*samples)[N_SAMPLE], const int *unknown, int n_unknown, SolveMemory *memory)
{
    unsigned char known[FB_ROOM(N_STATES)];
    lanes *lane = memory->filter->lane;
    memcpy(memory->shown, memory->from, sizeof memory->shown);
    for (int i = 0; i < N_STATES; i++) {
        known[i] = START_INPUT[i] >= 0 || !(memory->size[i] > 0.0);
        if (known[i]) memory->shown[i] = memory->centre[i];
    }
    for (int k = 0; k < PLAIN_NUMBERS; k++) lane[k] = broadcast(memory->sure[k]);
    find_all_shown(samples, memory->count, known, memory->shown, lane);
    for (int c = 0; c < n_unknown; c++) {
        const int i = unknown[c];
        if (fabs(memory->shown[i] - memory->centre[i]) > FAR_SHOWN * memory->size[i]) return 1;
    }
    return 0;
}

/* What lags behind an input is about where that is. */
static void know_followers(double (*samples)[N_SAMPLE], SolveMemory *memory)
{
    for (int i = 0; i < N_STATES; i++) {
        const int k = START_INPUT[i];
        if (k < 0) continue;
        memory->centre[i] = samples[0][SAMPLE_U + k];
        memory->size[i] = lag_behind(samples, memory->count, k);
    }
}

/* What is known of the states beforehand: stated, or settled and of a size that the readings suggest. Sets
   `centre`, `size` and `free`; what is stated may be off too, and would put the others off, so only what is exact
   stays. */
static void know_beforehand(double (*samples)[N_SAMPLE], const double *sd, const int *unknown, int n_unknown,
                            SolveMemory *memory)
{
    const double *const footings[] = {START_MEAN, memory->centre}, *const seen = memory->shown;
    double settled[FB_ROOM(N_STATES)];
    settle(memory, settled);
    for (int i = 0; i < N_STATES; i++) {
        memory->centre[i] = START_MEAN[i];
        memory->size[i] = sd[i];
    }
    for (int c = 0; c < n_unknown; c++) memory->centre[unknown[c]] = settled[unknown[c]];
    find_sizes(samples, unknown, n_unknown, footings, 2, memory);
    know_followers(samples, memory);
    memory->n_free = 0;
    for (int i = 0; i < N_STATES; i++) {
        if (START_INPUT[i] < 0 && fabs(memory->centre[i] - START_MEAN[i]) > FAR_SETTLED * memory->size[i]) memory->centre[i] = START_MEAN[i];
        if (memory->size[i] > 0.0 && !is_held(memory, i)) memory->free[memory->n_free++] = i;
    }
    if (!is_shown_far(samples, unknown, n_unknown, memory)) return;
    for (int c = 0; c < n_unknown; c++) memory->centre[unknown[c]] = seen[unknown[c]];
    find_sizes(samples, unknown, n_unknown, &seen, 1, memory);
    know_followers(samples, memory);
}

/* Solve the start: the states before the first of the packed samples, SI, and the covariance [AT_SLOT][AT_SLOT] of
   states, slow errors and parameters: a start that was found with parameters that are off is off with them.
   `known`: a lane whose parameters hold, or NULL. `again`: the plant has run before, so that what the model says of
   the start does not hold; and AT_INPUTS, or 0. */
static void solve_start(double (*samples)[N_SAMPLE], int64_t count, const double *known, int again, const Normal *normal,
                        double *mean, double *covariance, SolveMemory *memory, Filter_plain *work)
{
    int unknown[FB_ROOM(N_STATES)], n_unknown = 0;
    double sd[FB_ROOM(N_STATES)];
    stated_sds(sd);
    for (int i = 0; i < N_STATES; i++)
        if ((again & ~AT_INPUTS) || isnan(START_SD[i])) unknown[n_unknown++] = i;
    for (int i = 0; i < AT_SLOT; i++)
        for (int j = i; j < AT_SLOT; j++)
            covariance[i * AT_SLOT + j] = covariance[j * AT_SLOT + i] =
                i < N_STATES ? 0.0 : healthy_covariance(known, i, j);
    if (n_unknown == 0) {
        for (int i = 0; i < N_STATES; i++) {
            mean[i] = START_MEAN[i];
            covariance[i * AT_SLOT + i] = sd[i] * sd[i];
        }
        return;
    }
    memory->held = (again & AT_INPUTS) != 0;
    take_first(samples, count, known, normal, memory, work);
    know_beforehand(samples, sd, unknown, n_unknown, memory);
    begin_guesses(memory);
    for (int k = 0; k < START_ITERATIONS; k++) better_guesses(memory);
    const Guess *best = &memory->guesses[0];
    for (int g = 1; g < GUESSES; g++)
        if (memory->guesses[g].cost < best->cost) best = &memory->guesses[g];
    lay_rows(best, memory);
    triangularise(memory->n_free, memory->n_readings + memory->n_free, memory);
    find_spread(memory);
    memset(memory->led, 0, sizeof memory->led);
    find_led(best, memory);
    memcpy(mean, best->state, N_STATES * sizeof *mean);
    for (int c = 0; c < memory->n_free; c++)
        for (int d = 0; d < memory->n_free; d++) {
            const int i = memory->free[c], j = memory->free[d];
            covariance[i * AT_SLOT + j] = WIDER * WIDER * (memory->size[i] * memory->spread[c][d] * memory->size[j]);
        }
    for (int i = 0; i < N_STATES; i++)
        if (is_held(memory, i)) covariance[i * AT_SLOT + i] = memory->size[i] * memory->size[i];
    follow_unknown(known, memory->led, covariance);
}

/* Measured less predicted, in sd of the noise, of a plant that began at `state`: [count][N_OUTPUTS]; 0 where
   missing. */
static void find_misfits(double (*samples)[N_SAMPLE], int64_t count, const double *known, const Normal *normal,
                         const double *state, double *misfit, SolveMemory *memory, Filter_plain *work)
{
    take_first(samples, count, known, normal, memory, work);
    ask(state, 0, 0.0, misfit, memory);
    answer(memory);
}

FB_OFTEN

#endif
