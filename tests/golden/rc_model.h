/* The model: sizes, tables, rates and readings. */
#define N_STATES 1
#define N_SLOW 0
#define N_PARAMETERS 2
#define N_INPUTS 1
#define N_OUTPUTS 1
#define N_IMPLICIT 0
#define N_NOISY 1
#define N_SLOT 2
#define N_V 4
#define N_SAMPLE 10
#define N_NUMBERS 36
#define N_RATE_SLOPES 4
#define N_READING_SLOPES 2
#define SUBSTEPS 1
#define RATES_ARE_LINEAR 0
#define READINGS_ARE_LINEAR 0
#define WILDEST 400.0
#define BLANK_FACTOR 10000.0
#define SAMPLE_DT 0
#define SAMPLE_U_BEFORE 1
#define SAMPLE_U 2
#define SAMPLE_Y 3
#define SAMPLE_USE 4
#define SAMPLE_SCALE 5
#define SAMPLE_KICK 6
#define SAMPLE_GAP 6
#define SAMPLE_AGAIN 7
#define SAMPLE_BOUND 8
#define SAMPLE_NIS 9
#define ROLE_THETA 27
#define ROLE_INPUT 29
#define ROLE_READS 30
#define ROLE_GAIN 31
#define ROLE_BIAS 32
#define ROLE_NOISE 33
#define ROLE_WANDER 34
static const double STATE_VARIANCE[] = {4e-06};
static const double SLOW_VARIANCE[] = {0.0};
static const double SLOW_MEMORY[] = {0.0};
static const double LOWER[] = {0.02, 0.02};
static const double UPPER[] = {50.0, 50.0};
static const double OUTPUT_VARIANCE[] = {0.010000000000000002};
static const double INPUT_VARIANCE[] = {0.010000000000000002};
static const int NOISY[] = {0};
static const int NOISE_OF_INPUT[] = {0};
static const int SYMMETRIC[6][6] = {
    {0, 1, 2, 3, 4, 5},
    {1, 6, 7, 8, 9, 10},
    {2, 7, 11, 12, 13, 14},
    {3, 8, 12, 15, 16, 17},
    {4, 9, 13, 16, 18, 19},
    {5, 10, 14, 17, 19, 20}};
static const int RATE_ROW[] = {0, 4};
static const int RATE_COLUMN[] = {0, 1, 2, 3};
#define REACHES_ALL 1
static const int LOWER_ROW[] = {0, 0};
static const int LOWER_PLACE[] = {0};
static const int UPPER_ROW[] = {0, 0};
static const int UPPER_PLACE[] = {0};
static const int STATE_ROW[] = {0, 5};
static const int STATE_PLACE[] = {0, 1, 2, 3, 5};
static const int READING_ROW[] = {0, 2};
static const int READING_COLUMN[] = {0, 2};
static const int OUT_ROW[] = {0, 3};
static const int OUT_PLACE[] = {0, 2, 3};

static void model_rates(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u,
    const lanes *FB_RESTRICT z, lanes *FB_RESTRICT value, lanes *FB_RESTRICT slopes)
{
    (void)v, (void)u, (void)z;
    const lanes v2 = u[0] + v[3];
    const lanes v7 = 9.999999999999999e-05 * v[2];
    const lanes v8 = (-1.0) / v7;
    const lanes v9 = v[0] / v8;
    const lanes v10 = v9 / v7;
    const lanes v11 = v2 + v10;
    const lanes v14 = 10000.0 * v[1];
    const lanes v15 = v11 / v14;
    const lanes v16 = v15 / v7;
    value[0] = v16;
    const lanes v18 = 1.0 / v14;
    const lanes v19 = v18 / v7;
    const lanes v20 = v19 / v7;
    const lanes v21 = v20 / v8;
    slopes[0] = v21;
    const lanes v23 = v15 / v14;
    const lanes v24 = v23 / v7;
    const lanes v25 = 10000.0 * v24;
    const lanes v26 = -v25;
    slopes[1] = v26;
    const lanes v28 = v8 / v7;
    const lanes v29 = v9 / v8;
    const lanes v30 = v29 * v20;
    const lanes v31 = v28 * v30;
    const lanes v32 = v16 / v7;
    const lanes v33 = v10 / v7;
    const lanes v34 = v33 * v19;
    const lanes v35 = v32 + v34;
    const lanes v36 = v31 - v35;
    const lanes v37 = 9.999999999999999e-05 * v36;
    slopes[2] = v37;
    slopes[3] = v19;
}

static void model_readings(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u,
    const lanes *FB_RESTRICT z, lanes *FB_RESTRICT value, lanes *FB_RESTRICT slopes)
{
    (void)v, (void)u, (void)z;
    const lanes v4 = 9.999999999999999e-05 * v[2];
    const lanes v5 = (-1.0) / v4;
    const lanes v6 = v[0] / v5;
    const lanes v7 = v6 / v4;
    const lanes v8 = -v7;
    value[0] = v8;
    const lanes v10 = 1.0 / v4;
    const lanes v11 = v10 / v5;
    const lanes v12 = -v11;
    slopes[0] = v12;
    const lanes v14 = v6 / v5;
    const lanes v15 = v5 / v4;
    const lanes v16 = 9.999999999999999e-05 * v15;
    const lanes v17 = v14 * v16;
    const lanes v18 = v17 / v4;
    const lanes v19 = v7 / v4;
    const lanes v20 = 9.999999999999999e-05 * v19;
    const lanes v21 = v18 - v20;
    const lanes v22 = -v21;
    slopes[1] = v22;
}
