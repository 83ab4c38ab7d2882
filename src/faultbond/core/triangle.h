/* A covariance as a packed triangle, which cannot become asymmetric: moved on with the states, and with what a sensor has told
   taken off.

   A text for each kind of lanes: N_JOINT numbers z go together, of which the first N_STATES are states; PLACE(i, j) is where the
   triangle has an entry with i <= j, and SYMMETRIC[i][j] where it has any. State i feels the columns STATE_PLACE[STATE_ROW[i] ..]
   of z in a step, sensor j the columns OUT_PLACE[OUT_ROW[j] ..]; others are not touched. Formulas: docs/method.md, "The joint
   filter"; Bierman, Factorization Methods for Discrete Sequential Estimation, 1977. */

/* Covariance of the states after a step with slopes A by z: A P A' and A P with the rest, which is still as before. */
static void spread_states(lanes *FB_RESTRICT p, lanes (*FB_RESTRICT a)[N_JOINT], lanes (*FB_RESTRICT t)[N_JOINT])
{
    for (int i = 0; i < N_STATES; i++)
        for (int j = 0; j < N_JOINT; j += 4) { /* four sums beside each other, as each waits for its last product */
            const int k = j + 1 < N_JOINT ? j + 1 : j, l = j + 2 < N_JOINT ? j + 2 : j, m = j + 3 < N_JOINT ? j + 3 : j;
            lanes at_j = broadcast(0.0), at_k = at_j, at_l = at_j, at_m = at_j;
            for (int e = STATE_ROW[i]; e < STATE_ROW[i + 1]; e++) {
                const lanes slope = a[i][STATE_PLACE[e]];
                at_j += slope * p[SYMMETRIC[STATE_PLACE[e]][j]];
                at_k += slope * p[SYMMETRIC[STATE_PLACE[e]][k]];
                at_l += slope * p[SYMMETRIC[STATE_PLACE[e]][l]];
                at_m += slope * p[SYMMETRIC[STATE_PLACE[e]][m]];
            }
            t[i][m] = at_m; /* past the end they are the first */
            t[i][l] = at_l;
            t[i][k] = at_k;
            t[i][j] = at_j;
        }
    for (int i = 0; i < N_STATES; i++) {
        for (int j = i; j < N_STATES; j++) {
            lanes sum = broadcast(0.0);
            for (int e = STATE_ROW[j]; e < STATE_ROW[j + 1]; e++) sum += t[i][STATE_PLACE[e]] * a[j][STATE_PLACE[e]];
            p[PLACE(i, j)] = sum;
        }
        for (int j = N_STATES; j < N_JOINT; j++) p[PLACE(i, j)] = t[i][j];
    }
}

/* Slope of sensor j along a vector. */
static inline lanes along(const lanes *FB_RESTRICT slope, const lanes *FB_RESTRICT vector, int j)
{
    lanes sum = broadcast(0.0);
    for (int e = OUT_ROW[j]; e < OUT_ROW[j + 1]; e++) sum += slope[OUT_PLACE[e]] * vector[OUT_PLACE[e]];
    return sum;
}

/* Covariance times the slope of sensor j. */
static inline void times(int j, const lanes *FB_RESTRICT p, const lanes *FB_RESTRICT slope, lanes *FB_RESTRICT cross)
{
    for (int i = 0; i < N_JOINT; i++) {
        lanes sum = broadcast(0.0);
        for (int e = OUT_ROW[j]; e < OUT_ROW[j + 1]; e++) sum += p[SYMMETRIC[OUT_PLACE[e]][i]] * slope[OUT_PLACE[e]];
        cross[i] = sum;
    }
}

/* What n sensors have told, taken off a covariance; `to` may be `from`. Of a variance at least its rounding error is left: a
   number that was not known at all is not certain after one precise reading. */
static inline void take_off(const lanes *from, lanes weight[][N_JOINT], lanes cross[][N_JOINT], int n, lanes *to)
{
    for (int i = 0; i < N_JOINT; i++) {
        const lanes least = from[PLACE(i, i)] * ROUNDING;
        for (int k = i; k < N_JOINT; k++) {
            lanes left = from[PLACE(i, k)];
            for (int j = 0; j < n; j++) left -= weight[j][i] * cross[j][k];
            to[PLACE(i, k)] = left;
        }
        to[PLACE(i, i)] = v_fmax(least, to[PLACE(i, i)]);
    }
}
