/* One step in time: implicit signals by Newton's method, states by ROS2, and their slopes by everything else.

   The model gives (all of one moment, for the vector v = [states, slow errors, parameters, errors of the inputs]):
     model_newton(v, u, z, step, misfit)   Newton's step of the implicit signals z, and the square of what is left
     model_misfit(v, u, z, misfit)         the square alone
     model_rates(v, u, z, rates, slopes)   rates of the states, and their slopes by v, those that are not zero
     model_readings(v, u, z, y, slopes)    readings of the sensors, and their slopes by v
     model_signals(v, u, z, values)        signals that are measured by hand, where there are such

   Tables: RATE_ROW[i] .. RATE_ROW[i + 1] are the places of row i in `slopes`, RATE_COLUMN their columns in v. A state
   feels the columns REACH_COLUMN[REACH_ROW[i] ..] in the course of a step; where REACHES_ALL, every state feels all, and
   there is no such table. LOWER_ROW, LOWER_PLACE: the rows below the diagonal that column k has entries in once the
   columns before it are eliminated; UPPER_ROW, UPPER_PLACE: the columns right of the diagonal that row k has. Formulas:
   docs/method.md, "One step in time", and of the implicit signals "Order of computation". */
#ifndef FB_INTEGRATE_H
#define FB_INTEGRATE_H

#include "layout.h"

#define NEWTON_STEPS 10
#define WELL_SOLVED 0.01 /* part of the misfit, a square, that is left */
#define LAST_STEP 1e-9
#define GAMMA (1.0 - 1.0 / FB_SQRT2)

/* The columns c of v that state i feels. What it does not feel is not touched: zero times a slope without end is none. */
#if REACHES_ALL
#define FOR_REACH(i, c) for (int c = 0; c < N_V; c++)
#else
#define FOR_REACH(i, c) \
    for (int place_ = REACH_ROW[i], c; place_ < REACH_ROW[(i) + 1] && (c = REACH_COLUMN[place_], 1); place_++)
#endif

/* Whether slopes by column c of v are asked for: inputs may have some for `find_force` alone. */
#ifndef IS_SLOPED
#define IS_SLOPED(c) 1
#endif

/* Where the laws are linear, slopes are the same in all lanes. */
#if RATES_ARE_LINEAR
typedef double steep;
#define STEEP(a) (a)
#define WIDE(a) broadcast(a)
#else
typedef lanes steep;
#define STEEP(a) broadcast(a)
#define WIDE(a) (a)
#endif

/* Memory of a step, apart from the stack. Where the laws are linear it is worked out once for each length of step. */
typedef struct {
    double dt;                             /* of the step that `decay` is of, and nan: of none yet; */
    double moved;                          /* that of `m` and `slope`: nothing where the states stay */
    double decay[FB_ROOM(N_SLOW)];         /* what is left of the slow errors after it, as the filter works it out */
    steep m[FB_ROOM(N_STATES)][FB_ROOM(N_STATES)];
    steep slope[FB_ROOM(N_STATES)][N_V];   /* of the states after the step by v before it */
    steep k1[FB_ROOM(N_STATES)][N_V];      /* slopes of the rates of both stages, */
    steep k2[FB_ROOM(N_STATES)][N_V];
    steep middle[FB_ROOM(N_STATES)][N_V];  /* and of the states between them */
} Step;

#ifdef FB_HOLDS_FILTERS
/* Solve the implicit signals z in place. A step of Newton's that leaves a tenth of the misfit or less is taken as it is. Else parts
   and multiples of it are tried, and the best is kept: parts, since an exponential is overshot from its flat side, and multiples,
   since from its steep side Newton's step is ever the same small one. After a step so small that its square is no digit of z, or
   where nothing moves any more, nothing will; each lane ends by itself. */
static void solve_implicit(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u, lanes *FB_RESTRICT z)
{
#if N_IMPLICIT > 0
    static const double parts[] = {1.0 / 64, 1.0 / 16, 1.0 / 4, 1.0, 4.0, 16.0, 64.0};
    mask open = (mask)(broadcast(0.0) < 1.0);
    for (int k = 0; k < NEWTON_STEPS && any_of(open); k++) {
        lanes move[N_IMPLICIT], trial[N_IMPLICIT], kept[N_IMPLICIT], best, misfit;
        mask is_last = open, moved = (mask)(broadcast(0.0) > 1.0);
        model_newton(v, u, z, move, &best);
        for (int i = 0; i < N_IMPLICIT; i++) {
            trial[i] = z[i] + move[i];
            is_last = is_last & (magnitude(move[i]) <= LAST_STEP * magnitude(z[i]));
        }
        model_misfit(v, u, trial, &misfit);
        const mask taken = (misfit <= WELL_SOLVED * best) | (is_last & (misfit <= best)); /* false where it is no number */
        for (int i = 0; i < N_IMPLICIT; i++) kept[i] = choose(taken, trial[i], z[i]);
        const mask sought = opposite(taken | is_last);
        for (unsigned p = 0; any_of(open & sought) && p < sizeof parts / sizeof parts[0]; p++) {
            for (int i = 0; i < N_IMPLICIT; i++) trial[i] = z[i] + parts[p] * move[i];
            model_misfit(v, u, trial, &misfit);
            const mask better = sought & (misfit <= best); /* a wild step is never kept */
            for (int i = 0; i < N_IMPLICIT; i++) kept[i] = choose(better, trial[i], kept[i]);
            best = choose(better, misfit, best);
        }
        for (int i = 0; i < N_IMPLICIT; i++) {
            moved = moved | (kept[i] != z[i]);
            z[i] = choose(open, kept[i], z[i]);
        }
        open = open & moved & opposite(is_last);
    }
#else
    (void)v, (void)u, (void)z;
#endif
}

/* Bring I - step * (slopes by the states) to triangular form: factors below its diagonal, its inverse on it. */
static void factorise(const steep *FB_RESTRICT slopes, double step, steep (*FB_RESTRICT m)[FB_ROOM(N_STATES)])
{
    for (int i = 0; i < N_STATES; i++) {
        for (int j = 0; j < N_STATES; j++) m[i][j] = STEEP(i == j ? 1.0 : 0.0);
        for (int e = RATE_ROW[i]; e < RATE_ROW[i + 1]; e++)
            if (RATE_COLUMN[e] < N_STATES) m[i][RATE_COLUMN[e]] -= step * slopes[e];
    }
    for (int k = 0; k < N_STATES; k++) {
        m[k][k] = 1.0 / m[k][k];
        for (int below = LOWER_ROW[k]; below < LOWER_ROW[k + 1]; below++) {
            const int i = LOWER_PLACE[below];
            m[i][k] *= m[k][k];
            for (int e = UPPER_ROW[k]; e < UPPER_ROW[k + 1]; e++) m[i][UPPER_PLACE[e]] -= m[i][k] * m[k][UPPER_PLACE[e]];
        }
    }
}

/* Solve in place for rates. */
static void solve_rates(steep (*FB_RESTRICT m)[FB_ROOM(N_STATES)], lanes *FB_RESTRICT rate)
{
    for (int k = 0; k < N_STATES; k++)
        for (int e = LOWER_ROW[k]; e < LOWER_ROW[k + 1]; e++) rate[LOWER_PLACE[e]] -= m[LOWER_PLACE[e]][k] * rate[k];
    for (int k = N_STATES - 1; k >= 0; k--) {
        for (int e = UPPER_ROW[k]; e < UPPER_ROW[k + 1]; e++) rate[k] -= m[k][UPPER_PLACE[e]] * rate[UPPER_PLACE[e]];
        rate[k] *= m[k][k];
    }
}

/* Take a multiple of a row of slopes off another one, in the columns that it has. */
static inline void subtract(steep *FB_RESTRICT slope, steep factor, const steep *FB_RESTRICT of, int row)
{
    (void)row;
    FOR_REACH (row, c) slope[c] -= factor * of[c];
}

/* Solve in place for the slopes of rates, in the columns that each state feels. */
static void solve_slopes(steep (*FB_RESTRICT m)[FB_ROOM(N_STATES)], steep (*FB_RESTRICT slope)[N_V])
{
    for (int k = 0; k < N_STATES; k++)
        for (int e = LOWER_ROW[k]; e < LOWER_ROW[k + 1]; e++) {
            const int i = LOWER_PLACE[e];
            subtract(slope[i], m[i][k], slope[k], k);
        }
    for (int k = N_STATES - 1; k >= 0; k--) {
        for (int e = UPPER_ROW[k]; e < UPPER_ROW[k + 1]; e++) {
            const int j = UPPER_PLACE[e];
            subtract(slope[k], m[k][j], slope[j], j);
        }
        FOR_REACH (k, c) slope[k][c] *= m[k][k];
    }
}

/* Add the slopes of the rates by v at the start of the step, of which the states now have the slopes `by`. */
static void chain(const steep *FB_RESTRICT slopes, steep (*FB_RESTRICT by)[N_V],
                  steep (*FB_RESTRICT result)[N_V])
{
    for (int i = 0; i < N_STATES; i++)
        for (int e = RATE_ROW[i]; e < RATE_ROW[i + 1]; e++) {
            const int column = RATE_COLUMN[e];
            if (column >= N_STATES) {
                if (IS_SLOPED(column)) result[i][column] += slopes[e];
            } else FOR_REACH (column, c) result[i][c] += slopes[e] * by[column][c];
        }
}

/* Slopes of the first stage, and those of the states between both. In the first part of a step the states have slopes
   by themselves only. */
static void begin_slopes(const steep *FB_RESTRICT slopes, double h, int first, Step *FB_RESTRICT step)
{
    factorise(slopes, GAMMA * h, step->m);
    for (int i = 0; i < N_STATES; i++) {
        FOR_REACH (i, c) step->k1[i][c] = STEEP(0.0);
        for (int e = RATE_ROW[i]; first && e < RATE_ROW[i + 1]; e++)
            if (IS_SLOPED(RATE_COLUMN[e])) step->k1[i][RATE_COLUMN[e]] = slopes[e];
    }
    if (!first) chain(slopes, step->slope, step->k1);
    solve_slopes(step->m, step->k1);
    for (int i = 0; i < N_STATES; i++) {
        if (first) FOR_REACH (i, c) step->slope[i][c] = STEEP(c == i ? 1.0 : 0.0);
        FOR_REACH (i, c) step->middle[i][c] = step->slope[i][c] + h * step->k1[i][c];
    }
}

/* Slopes of the second stage, and those of the states after a part of the step. */
static void end_slopes(const steep *FB_RESTRICT slopes, double h, Step *FB_RESTRICT step)
{
    for (int i = 0; i < N_STATES; i++) FOR_REACH (i, c) step->k2[i][c] = -2.0 * step->k1[i][c];
    chain(slopes, step->middle, step->k2);
    solve_slopes(step->m, step->k2);
    for (int i = 0; i < N_STATES; i++)
        FOR_REACH (i, c) step->slope[i][c] += h * (1.5 * step->k1[i][c] + 0.5 * step->k2[i][c]);
}

/* What inputs that go linearly from row to row bring to the stages of a part: gamma h times the rate of the rates by time. */
static inline void find_force(const steep *FB_RESTRICT slopes, const lanes *FB_RESTRICT climb, lanes *FB_RESTRICT force)
{
    for (int i = 0; i < N_STATES; i++) {
        force[i] = broadcast(0.0);
        for (int e = RATE_ROW[i]; e < RATE_ROW[i + 1]; e++)
            if (RATE_COLUMN[e] >= AT_SLOT) force[i] += (GAMMA / SUBSTEPS) * slopes[e] * climb[RATE_COLUMN[e] - AT_SLOT];
    }
}

/* Take v over dt in equal parts of ROS2; the slope treats the Jacobian inside the method as constant. Inputs go from what v
   holds of them by `climb` [N_INPUTS], which is zero of those that are held; a part takes the time as one more state. Where
   they are `still` the states stay where they are. sloped 0: slopes are not asked for.
   Source: Verwer, Spee, Blom and Hundsdorfer, SIAM J. Sci. Comput. 20 (1999) 1456. Changes v (its states and, where there
   is a climb, its inputs), z and `step`. */
static void integrate(lanes *FB_RESTRICT v, const double *FB_RESTRICT u, const lanes *FB_RESTRICT climb, double dt, int still,
                      int sloped, lanes *FB_RESTRICT z, Step *FB_RESTRICT step)
{
    const double moved = still ? 0.0 : dt, h = moved / SUBSTEPS;
    const int anew = RATES_ARE_LINEAR ? dt != step->dt || moved != step->moved : sloped;
    lanes first[FB_ROOM(N_STATES)], second[FB_ROOM(N_STATES)], x[FB_ROOM(N_STATES)], force[FB_ROOM(N_STATES)];
    steep slopes[FB_ROOM(N_RATE_SLOPES)];
    step->dt = dt;
    step->moved = moved;
    for (int part = 0; part < SUBSTEPS; part++) {
        solve_implicit(v, u, z);
        model_rates(v, u, z, first, slopes);
        if (anew) begin_slopes(slopes, h, part == 0, step);
        else if (!RATES_ARE_LINEAR) factorise(slopes, GAMMA * h, step->m);
        if (N_LINEAR > 0) find_force(slopes, climb, force);
        for (int i = 0; N_LINEAR > 0 && i < N_STATES; i++) first[i] += force[i];
        solve_rates(step->m, first);
        for (int i = 0; i < N_STATES; i++) {
            x[i] = v[i];
            v[i] = x[i] + h * first[i];
        }
        for (int k = 0; N_LINEAR > 0 && k < N_INPUTS; k++) v[AT_SLOT + k] += climb[k] * (1.0 / SUBSTEPS);
        solve_implicit(v, u, z);
        model_rates(v, u, z, second, slopes);
        if (anew) end_slopes(slopes, h, step);
        for (int i = 0; i < N_STATES; i++) second[i] -= 2.0 * first[i];
        for (int i = 0; N_LINEAR > 0 && i < N_STATES; i++) second[i] -= force[i];
        solve_rates(step->m, second);
        for (int i = 0; i < N_STATES; i++) v[i] = x[i] + h * (1.5 * first[i] + 0.5 * second[i]);
    }
}
#endif

#endif
