/* The model: sizes, tables, rates and readings. */
#ifndef FB_MODEL_H
#define FB_MODEL_H
#define N_STATES 1
#define N_SLOW 0
#define N_AFTER 0
#define N_PARAMETERS 2
#define N_INPUTS 1
#define N_OUTPUTS 1
#define N_IMPLICIT 0
#define N_NOISY 1
#define NOISE_GROWS 0
#define N_SMOOTH 0
#define N_CONDITIONS 0
#define MODEL_CONDITION (-1)
#define N_LINEAR 0
#define N_V 4
#define N_RATE_SLOPES 4
#define N_READING_SLOPES 2
#define SUBSTEPS 1
#define AHEAD 300
#define N_AHEAD 30
#define RATES_ARE_LINEAR 0
#define READINGS_ARE_LINEAR 0
#define KIND_STEP 0
#define KIND_DRIFT 1
#define KIND_INTERMITTENT 2
#define KIND_BIAS 3
#define KIND_GAIN 4
#define KIND_STUCK 5
#define KIND_NOISE 6
#define KIND_RAMP 7
#define N_KINDS 8
#define CHECK_COMPONENT 0
#define CHECK_INPUT 1
#define CHECK_SIGNAL 2
#define N_PARTS 4
#define N_SIGNALS 0
#define N_SETS 2
#define N_INSTRUMENTS 2
#define N_RESERVE 0
#define N_GROWN 0
#define PER_SET 3
#define N_MIXED 0
#define N_BOTH 0
#define N_COUPLES 0
#define MOST_MIXED 0
#define MOST_BOTH 0
#define N_COUPLED 0
#define PER_COUPLE 3
#define LARGEST_SET 1
#define MOST_LIMITS 0
#define N_PLANNED 12
#define N_SINGLE_LANES 12
#define N_SLOT_LANES 65
#define RAMPED 25
#define SWITCHED 39
#define STEPS_LAG 0
#define DRIFTS_KEEP 1
#define SAMPLE_TIME 0.02
#define CUSUM_DRIFT 0.3
#define CUSUM_LIMIT 26.0
#define CUSUM_CLIP 3.0
#define FAST_DRIFT 1.0
#define FAST_LIMIT 1000.0
#define SCATTER_RATIO 2.5
#define SCATTER_LIMIT 50.0
#define LEARNING_BOUND 6.0
#define BANK_BOUND 20.0
#define WILDEST 400.0
#define GROUP_NATS 3.0
#define BLANK_FACTOR 10000.0
#define WARM_UP_SAMPLES 20
#define FALSE_ALARMS 0
#define HISTORY_SAMPLES 330
#define MOST_NOISES 5
#define INPUT_CHANGE 0.5
#define OUTPUT_CHANGE 300.0
#define MAX_CANDIDATES 100
#define MOST_RIVALS 8
#define SURE 0.95
#include "layout.h"
static const uint64_t MODEL_HASH[] = {0xdaa39eb937988d24ULL, 0x994bec7b012b66a9ULL, 0x63869a75fdddd6cfULL, 0x4dd0cc09639d8258ULL};
static const double STATE_VARIANCE[] = {4e-06};
static const double SLOW_VARIANCE[] = {0.0};
static const double SLOW_MEMORY[] = {0.0};
static const double LOWER[] = {0.02, 0.02};
static const double UPPER[] = {50.0, 50.0};
static const double OUTPUT_VARIANCE[] = {0.010000000000000002};
static const double OUTPUT_GROWTH[] = {0.0};
static const double INPUT_VARIANCE[] = {0.010000000000000002};
static const int NOISY[] = {0};
static const int NOISE_OF_INPUT[] = {0};
static const int SMOOTH_NOISE[] = {0};
static const double CONDITION_SETTLING[] = {0.0};
static const int OUTPUT_CONDITION[] = {-1};
static const int INPUT_LINEAR[] = {0};
static const int INPUT_NEXT[] = {0};
static const int SYMMETRIC_plain[6][6] = {
    {0, 1, 2, 3, 4, 5},
    {1, 6, 7, 8, 9, 10},
    {2, 7, 11, 12, 13, 14},
    {3, 8, 12, 15, 16, 17},
    {4, 9, 13, 16, 18, 19},
    {5, 10, 14, 17, 19, 20}};
static const int SYMMETRIC_wide[6][6] = {
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
static const int STATE_ROW_plain[] = {0, 6};
static const int STATE_PLACE_plain[] = {0, 1, 2, 3, 4, 5};
static const int STATE_ROW_wide[] = {0, 6};
static const int STATE_PLACE_wide[] = {0, 1, 2, 3, 4, 5};
static const int READING_ROW[] = {0, 2};
static const int READING_COLUMN[] = {0, 2};
static const int OUT_ROW_plain[] = {0, 4};
static const int OUT_PLACE_plain[] = {0, 2, 3, 4};
static const int OUT_ROW_wide[] = {0, 4};
static const int OUT_PLACE_wide[] = {0, 2, 3, 4};
static const double START_MEAN[] = {0.0};
static const double START_SD[] = {NAN};
static const double STATE_USUAL[] = {86.46691031830844};
static const double STATE_REACH[] = {0.0};
static const int START_INPUT[] = {-1};
static const double STATE_NOISE[] = {0.002};
static const double STATE_DRIFT[] = {0.1};
static const int JUMP_ROW[] = {0, 1};
static const int JUMP_PARAMETER[] = {1};
static const double JUMP_EXPONENT[] = {(-1.0)};
static const double SLOW_SD[] = {0.0};
static const double SLOW_LIMIT[] = {0.0};
static const double SLOW_WATCHED[] = {0.0};
static const int SLOW_OF_OUTPUT[] = {-1};
static const int AFTER_ROW[] = {0};
static const int AFTER_INPUT[] = {0};
static const double AFTER_EACH[] = {0.0};
static const double LOOP_GUESS[] = {0.0};
static const double NOMINAL[] = {10000.0, 9.999999999999999e-05};
static const double SCALE[] = {10000.0, 9.999999999999999e-05};
static const double HEALTHY[] = {1.0, 1.0};
static const double ACCURACY[] = {0.03, 0.03};
static const double CHANGE[] = {2.0, 2.0};
static const double HEALTHY_CHANGE[] = {0.0, 0.0};
static const double RANGE_LEAST[] = {0.0, 0.0};
static const double RANGE_MOST[] = {INFINITY, INFINITY};
static const int LIMIT_ROW[] = {0, 0, 0};
static const double LIMIT[] = {0.0};
static const double INPUT_NOISE[] = {0.1};
static const double INPUT_SETTLING[] = {0.0};
static const double INPUT_STEP[] = {0.6000000000000001};
static const double INPUT_STEP_PART[] = {0.01};
static const double INPUT_HEALTHY_BIAS[] = {0.0};
static const double INPUT_ZERO[] = {0.0};
static const int INPUT_FACTOR[] = {-1};
static const int INPUT_TERM[] = {-1};
static const double INPUT_TERM_PART[] = {0.0};
static const double INPUT_FAMILIAR_LOW[] = {(-INFINITY)};
static const double INPUT_FAMILIAR_HIGH[] = {INFINITY};
static const int INPUT_RANGED[] = {0};
static const double OUTPUT_NOISE[] = {0.1};
static const double OUTPUT_HEALTHY_BIAS[] = {0.0};
static const double OUTPUT_ZERO[] = {0.0};
static const int OUTPUT_RANGED[] = {0};
static const int DIRECT_ROW[] = {0, 0};
static const int DIRECT_INPUT[] = {0};
static const int SET_ROW[] = {0, 1, 2};
static const int SET_MEMBER[] = {0, 1};
static const int RESERVE_ROW[] = {0};
static const int RESERVE_MEMBER[] = {0};
static const double COST[] = {5.0, 5.0, 4.0, 5.0};
#define N_EXTENSIONS 0
static const int EXTENSION_RESERVE[] = {0};
static const int EXTENSION_SET[] = {0};
static const int EXTENSION_ROW[] = {0};
static const int EXTENSION_MEMBER[] = {0};
static const int FIRST_LANE[] = {0, 4, 12};
static const int LANE_HYPOTHESIS[] = {0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1};
static const int LANE_START[] = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12};
static const int8_t START_OF[] = {0, 1, 2, 3, 0, 0, 1, 1, 2, 2, 3, 3};
static const double START_VALUE[] = {0.45, 0.9, 1.8, 3.6};
static const double START_SPREAD[] = {0.1575, 0.315, 0.63, 1.26};
static const int LANE_JUMP_ROW[] = {0, 0, 0, 0, 0, 0, 1, 1, 2, 2, 3, 3, 4};
static const int LANE_JUMP_STATE[] = {0, 0, 0, 0};
static const int8_t SLOT_KIND[] = {1, 1, 1, 1, 1, 1, 1, 1, 3, 3, 1, 4, 5, 5, 6, 6, 6, 6, 6, 3, 3, 1, 4, 5, 5, 1, 7, 1,
    7, 1, 7, 1, 7, 1, 7, 1, 7, 1, 7, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2};
static const int8_t SLOT_HYPOTHESIS[] = {0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 2, 3, 3, 3, 3, 3, 3, 0,
    0, 1, 1, 1, 1, 2, 2, 2, 2, 3, 3, 3, 3, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1, 2, 2, 2, 2, 2, 2, 3, 3, 3,
    3};
static const int8_t SLOT_PARAMETER[] = {0, 0, 0, 0, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    -1, -1, -1, -1, 0, 0, 1, 1, 1, 1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 1, 1, 1, 1,
    -1, -1, -1, -1, -1, -1, -1, -1, -1, -1};
static const int8_t SLOT_INPUT[] = {-1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0,
    0, 0, 0, 0, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0};
static const int8_t SLOT_OUTPUT[] = {-1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, -1, -1, -1, -1,
    -1, -1, -1, -1, -1, -1, -1, -1, 0, 0, 0, 0, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1, -1,
    -1, -1, -1, 0, 0, 0, 0, 0, 0, -1, -1, -1, -1};
static const int8_t SLOT_ACTS[] = {1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1,
    1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0, 1, 0};
static const int8_t SLOT_STICKS[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 0, 0};
static const int8_t SLOT_SCALES[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 1, 1, 0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
static const int8_t SLOT_OLD[] = {1, 1, 1, 1, 1, 1, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
static const int8_t SLOT_KEEPS[] = {0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0,
    0, 0, 1, 1, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0};
static const double SLOT_SIZE[] = {(-0.55), (-0.09999999999999998), 0.8, 2.6, (-0.55), (-0.09999999999999998), 0.8,
    2.6, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, (-0.55), (-0.55), (-0.09999999999999998), (-0.09999999999999998),
    0.8, 0.8, 2.6, 2.6, (-0.55), (-0.55), (-0.09999999999999998), (-0.09999999999999998), 0.8, 0.8, 2.6, 2.6, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
static const double SLOT_SIZE_SD[] = {0.1575, 0.315, 0.63, 1.26, 0.1575, 0.315, 0.63, 1.26, 10.0, 300.0, 10.0, 0.3,
    1.0, 1000.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.05, 0.5, 0.05, 0.3, 0.02, 0.5, 0.03, 0.03, 0.03, 0.03, 0.03, 0.03, 1.0,
    1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.1575, 0.1575, 0.315, 0.315, 0.63, 0.63, 1.26, 1.26, 0.1575, 0.1575, 0.315,
    0.315, 0.63, 0.63, 1.26, 1.26, 10.0, 10.0, 300.0, 300.0, 1000.0, 1000.0, 0.05, 0.05, 0.5, 0.5};
static const double SLOT_RATE[] = {(-0.000275), (-4.999999999999999e-05), 0.0004, 0.0013, (-0.000275),
    (-4.999999999999999e-05), 0.0004, 0.0013, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
static const double SLOT_RATE_SD[] = {0.00020023739816777485, 0.00011567222008762518, 0.0003563990039267787,
    0.0010112274719369526, 0.00020023739816777485, 0.00011567222008762518, 0.0003563990039267787,
    0.0010112274719369526, 0.0, 0.0, 0.005, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.5e-05, 0.0, 0.0, 0.0,
    0.1, 0.1, 0.1, 0.1, 0.1, 0.1, 0.5, 0.5, 0.015, 0.015, 0.025, 0.025, 0.015, 0.015, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0};
static const double SLOT_SETTLING[] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0};
static const double SLOT_LAG[] = {0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0,
    0.0, 0.0};
static const double SLOT_NOISE[] = {1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 4.0, 9.0,
    25.0, 100.0, 1000.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
    1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 1.0,
    1.0, 1.0, 1.0, 1.0, 1.0};
static const double SLOT_WEIGHT[] = {(-2.772588722239781), (-2.772588722239781), (-2.772588722239781),
    (-2.772588722239781), (-2.772588722239781), (-2.772588722239781), (-2.772588722239781), (-2.772588722239781),
    (-1.2430601930339829), (-1.2430601930339829), (-2.8134107167600364), (-2.8134107167600364), (-2.3025850929940455),
    (-2.3025850929940455), (-3.912023005428146), (-3.912023005428146), (-3.912023005428146), (-3.912023005428146),
    (-3.912023005428146), (-1.8971199848858813), (-1.8971199848858813), (-2.4079456086518722), (-1.7147984280919268),
    (-3.101092789211817), (-3.101092789211817), (-1.3862943611198906), (-1.3862943611198906), (-2.0794415416798357),
    (-2.0794415416798357), (-2.0794415416798357), (-2.0794415416798357), (-2.8134107167600364), (-2.8134107167600364),
    (-3.506557897319982), (-3.506557897319982), (-2.4079456086518722), (-2.4079456086518722), (-2.407945608651872),
    (-2.407945608651872), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991),
    (-2.995732273553991), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991),
    (-2.995732273553991), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991), (-2.995732273553991),
    (-2.995732273553991), (-2.995732273553991), (-3.4011973816621555), (-3.4011973816621555), (-3.4011973816621555),
    (-3.4011973816621555), (-3.4011973816621555), (-3.4011973816621555), (-3.506557897319982), (-3.506557897319982),
    (-3.506557897319982), (-3.506557897319982)};
static const int COUPLE_SLOT[] = {0};
static const int COUPLE_PARAMETER[] = {0};
static const int COUPLE_BESIDE[] = {0};
static const int COUPLE_HYPOTHESIS[] = {0};
static const int COUPLE_ALIKE[] = {0};
static const int COUPLE_GAINS[] = {0};
static const int PARAMETER_PART[] = {0, 1};
static const int INPUT_PART[] = {2};
static const int OUTPUT_PART[] = {3};
static const double PART_COST[] = {1.0, 1.0, 1.0, 1.0};
static const int PART_ORDER[] = {1, 0, 2, 3};
static const double INPUT_COST[] = {1.0};
static const int INPUT_ORDER[] = {2};
static const int SIGNAL_ORDER[] = {0};
static const double INPUT_MOVE[] = {NAN};
static const int INPUT_PERCENT[] = {0};
static const double INPUT_FITTED_LOW[] = {(-INFINITY)};
static const double INPUT_END_LOW[] = {(-INFINITY)};
static const double INPUT_FITTED_HIGH[] = {INFINITY};
static const double INPUT_END_HIGH[] = {INFINITY};
static const int INPUT_HAS_ZERO[] = {1};
static const int8_t AHEAD_LENGTH[] = {10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10, 10,
    10, 10, 10, 10, 10, 10, 10, 10, 10, 10};

static inline int model_holds(int condition, const double *FB_RESTRICT u)
{
    (void)condition, (void)u;
    return 1;
}
#ifdef FB_HOLDS_FILTERS

static void model_rates(const lanes *FB_RESTRICT v, const double *FB_RESTRICT u,
    const lanes *FB_RESTRICT z, lanes *FB_RESTRICT value, lanes *FB_RESTRICT slopes)
{
    (void)v, (void)u, (void)z, (void)value, (void)slopes;
    const lanes v2 = u[0] + v[3];
    const lanes v7 = 9.999999999999999e-05 * v[2];
    const lanes by_v7 = 1.0 / v7;
    const lanes v8 = (-1.0) * by_v7;
    const lanes by_v8 = 1.0 / v8;
    const lanes v9 = v[0] * by_v8;
    const lanes v10 = v9 * by_v7;
    const lanes v11 = v2 + v10;
    const lanes v14 = 10000.0 * v[1];
    const lanes by_v14 = 1.0 / v14;
    const lanes v15 = v11 * by_v14;
    const lanes v16 = v15 * by_v7;
    value[0] = v16;
    const lanes v18 = by_v14;
    const lanes v19 = v18 * by_v7;
    const lanes v20 = v19 * by_v7;
    const lanes v21 = v20 * by_v8;
    slopes[0] = v21;
    const lanes v23 = v15 * by_v14;
    const lanes v24 = v23 * by_v7;
    const lanes v25 = 10000.0 * v24;
    const lanes v26 = -v25;
    slopes[1] = v26;
    const lanes v28 = v8 * by_v7;
    const lanes v29 = v9 * by_v8;
    const lanes v30 = v29 * v20;
    const lanes v31 = v28 * v30;
    const lanes v32 = v16 * by_v7;
    const lanes v33 = v10 * by_v7;
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
    (void)v, (void)u, (void)z, (void)value, (void)slopes;
    const lanes v4 = 9.999999999999999e-05 * v[2];
    const lanes by_v4 = 1.0 / v4;
    const lanes v5 = (-1.0) * by_v4;
    const lanes by_v5 = 1.0 / v5;
    const lanes v6 = v[0] * by_v5;
    const lanes v7 = v6 * by_v4;
    const lanes v8 = -v7;
    value[0] = v8;
    const lanes v10 = by_v4;
    const lanes v11 = v10 * by_v5;
    const lanes v12 = -v11;
    slopes[0] = v12;
    const lanes v14 = v6 * by_v5;
    const lanes v15 = v5 * by_v4;
    const lanes v16 = 9.999999999999999e-05 * v15;
    const lanes v17 = v14 * v16;
    const lanes v18 = v17 * by_v4;
    const lanes v19 = v7 * by_v4;
    const lanes v20 = 9.999999999999999e-05 * v19;
    const lanes v21 = v18 - v20;
    const lanes v22 = -v21;
    slopes[1] = v22;
}
#endif
#endif
