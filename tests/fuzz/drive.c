/* Drives the core of one model, for tests: a whole run, and runs in which samples, saved states and the order of calls are
   changed at random. It is compiled behind core.c, in one text, and asks the core by its calls only.

   drive whole RECORDING OUT         the recording, with candidates rejected and accepted, saved and restored on the way
   drive wild RECORDING SAMPLES SEED the recording over and over, with values that no plant gives
   drive case RECORDING SEED         one case
   drive fuzz RECORDING SECONDS SEED cases one after the other, each told by its seed before it runs
   drive fleet RECORDING -           the recording for each asset of a fleet, if the core serves fleets (FB_FLEETS)

   A recording is one number of rows (int64_t), then rows of time, step, inputs and readings (double). What must not be ends
   the program with 1 and a line that says so; the sanitizers end it otherwise. */
#include <stdio.h>
#include <stdlib.h>
#include <time.h>

#define COLUMNS (2 + N_INPUTS + N_OUTPUTS)
#define MOST_ROWS 20000
#define WILD_RUN 10000 /* samples */
#define LEAST_PIVOT (-1e-9) /* part of a variance that rounding may take off */

typedef struct {
    State *state;
    void *work;
    uint8_t *saved;
    Report report;
    Diagnosis found;
    Candidate candidate;
    Advice advice;
    double time;
    int is_true;   /* the state is one that samples led to, not one that was made up */
    int is_strict; /* no variance is lost by rounding, as where a state has grown to 1e60 */
} Drive;

static double recorded[MOST_ROWS][COLUMNS];
static int64_t n_recorded;
static uint64_t seed_now;

static void fail(const char *what)
{
    printf("seed %llu: %s\n", (unsigned long long)seed_now, what);
    exit(1);
}

/* Memory that begins where a cache line does, as the core asks for. Exactly so long: what is read beyond it is found. */
static void *room(int64_t bytes)
{
    void *start = NULL;
    if (posix_memalign(&start, 64, (size_t)bytes)) fail("memory");
    memset(start, 0, (size_t)bytes);
    return start;
}

/* Random numbers: splitmix64. */
static uint64_t drawn(uint64_t *seed)
{
    uint64_t z = (*seed += 0x9e3779b97f4a7c15u);
    z = (z ^ (z >> 30)) * 0xbf58476d1ce4e5b9u;
    z = (z ^ (z >> 27)) * 0x94d049bb133111ebu;
    return z ^ (z >> 31);
}

static int64_t below(uint64_t *seed, int64_t n) { return (int64_t)(drawn(seed) % (uint64_t)n); }

static void begin_drive(Drive *drive)
{
    drive->state = (State *)room(fb_state_size());
    drive->work = room(fb_work_size());
    drive->saved = (uint8_t *)malloc((size_t)fb_saved_size());
    fb_init(drive->state, 0.0, 0);
    drive->time = 0.0;
    drive->is_true = 1;
    drive->is_strict = 0;
}

static void end_drive(Drive *drive)
{
    free(drive->state);
    free(drive->work);
    free(drive->saved);
}

static int is_number_or_none(const double *values, int n)
{
    for (int k = 0; k < n; k++)
        if (isinf(values[k])) return 0;
    return 1;
}

static void check_diagnosis(const Drive *drive, const Diagnosis *found)
{
    double sum = 0.0, last = INFINITY;
    if (found->n_candidates < 0 || found->n_candidates > MOST_CANDIDATES) fail("number of candidates");
    if (!drive->is_true) return;
    for (int64_t k = 0; k < found->n_candidates; k++) {
        const Candidate *item = &found->candidates[k];
        if (!(item->probability >= 0.0 && item->probability <= 1.0 + 1e-9)) fail("probability");
        if (item->probability > last * (1.0 + 2.0 / TIES)) fail("order of the candidates"); /* equal ones stand as their numbers */
        if (item->hypothesis < 0 || item->hypothesis >= N_HYPOTHESES) fail("hypothesis");
        if (item->lane < 0 || item->lane >= N_LANES) fail("lane");
        if (item->n_suspects < 1 || item->n_suspects > LARGEST_SET) fail("number of suspects");
        if (item->n_kinds < 1 || item->n_kinds > N_KINDS) fail("number of kinds");
        for (int64_t s = 0; s < item->n_suspects; s++) {
            const Suspect *suspect = &item->suspects[s];
            if (isinf(suspect->estimate) || isinf(suspect->rate)) fail("estimate");
            if (suspect->sd < 0.0) fail("sd");
        }
        sum += item->probability;
        last = item->probability;
    }
    if (sum > 1.0 + 1e-9) fail("sum of the probabilities");
}

/* The least pivot of a plain lane's covariance in units of its variances: below zero by more than rounding, it is none. */
static double least_pivot(const double *lane)
{
    static double low[PLAIN_JOINT][PLAIN_JOINT];
    double least = 1.0;
    for (int i = 0; i < PLAIN_JOINT; i++) {
        const double own = lane[PLAIN_PLACE(i, i)];
        if (own <= 0.0) { /* known exactly: it goes with nothing */
            for (int j = 0; j < PLAIN_JOINT; j++) low[i][j] = 0.0;
            continue;
        }
        for (int j = 0; j <= i; j++) {
            const double other = lane[PLAIN_PLACE(j, j)];
            double sum = i == j ? 1.0 : other <= 0.0 ? 0.0 : lane[PLAIN_PLACE(j, i)] / sqrt(own) / sqrt(other);
            for (int k = 0; k < j; k++) sum -= low[i][k] * low[j][k];
            if (i == j && !(sum >= least)) least = sum;
            low[i][j] = i == j ? sqrt(fmax(sum, 0.0)) : low[j][j] > 0.0 ? sum / low[j][j] : 0.0;
        }
    }
    return least;
}

/* Whether any sensor is in use. Where none is, states wander off, and nothing takes rounding off their covariance again. */
static int is_told(const State *state)
{
    for (int j = 0; j < N_OUTPUTS; j++)
        if (isfinite(state->normal.noise[j])) return 1;
    return 0;
}

static void check(const Drive *drive)
{
    const Report *report = &drive->report;
    if (report->status < WAITING || report->status > LOST) fail("status");
    if (!drive->is_true) return;
    if (report->wild < 0) fail("wild");
    if (!is_number_or_none(report->expected, N_OUTPUTS)) fail("expected");
    if (!is_number_or_none(report->variance, N_OUTPUTS)) fail("variance");
    if (!is_number_or_none(report->cusum, N_OUTPUTS)) fail("cusum");
    if (!is_number_or_none(report->slow, N_SLOW)) fail("slow");
    if (report->status >= WARMING && report->status <= DIAGNOSING)
        for (int j = 0; j < N_OUTPUTS; j++)
            if (isnan(report->expected[j]) || !(report->variance[j] > 0.0)) {
                printf("sensor %d: %g, variance %g; status %d\n", j, report->expected[j], report->variance[j], (int)report->status);
                fail("report of a running filter");
            }
    if (!drive->state->clock.running) return;
    for (int i = 0; i < PLAIN_JOINT; i++) {
        const double variance = drive->state->healthy.lane[PLAIN_PLACE(i, i)];
        if (!isfinite(drive->state->healthy.lane[i])) fail("healthy filter");
        if (!(variance > 0.0) && (drive->is_strict || !(variance >= 0.0)) && !(i >= AT_PARAMETERS && i < AT_SLOT && ACCURACY[i - AT_PARAMETERS] == 0.0)) {
            printf("number %d of the joint vector: %g, variance %g, status %d, sample %lld\n", i,
                   drive->state->healthy.lane[i], variance, (int)report->status, (long long)drive->state->clock.index);
            fail("variance of the healthy filter");
        }
    }
    if (drive->is_strict && is_told(drive->state) && !(least_pivot(drive->state->healthy.lane) >= LEAST_PIVOT))
        fail("the healthy covariance is not definite");
    if (report->due) check_diagnosis(drive, &drive->found);
}

static void take(Drive *drive, const double *row)
{
    if (fb_block(drive->state, drive->work, 1, row, row + 1, row + 2, row + 2 + N_INPUTS, &drive->report, &drive->found) != 1)
        fail("number of samples taken");
    drive->time = row[0];
    check(drive);
}

/* Save, restore into memory that held something else, save again: the same bytes. */
static void keep_and_restore(Drive *drive)
{
    uint8_t *again = (uint8_t *)malloc((size_t)fb_saved_size());
    fb_save(drive->state, drive->saved);
    memset(drive->state, 0x5a, sizeof(State));
    const int64_t refused = fb_restore(drive->state, drive->saved, fb_saved_size());
    if (refused) fail("a saved state is refused");
    fb_save(drive->state, again);
    if (memcmp(drive->saved, again, (size_t)fb_saved_size())) fail("a restored state is another");
    free(again);
}

/* Change saved bytes at random, with a checksum that fits, and restore them: refused, or a state to go on from. */
static void forge(Drive *drive, uint64_t *seed)
{
    static const double odd[] = {0.0, 1.0, -1.0, 1e300, -1e300, 5e-324, 4503599627370496.0, 1e9, 0.5, -0.0};
    const int64_t head = 8 * (2 + MODEL_WORDS), size = fb_saved_size(), words = (size - head) / 8 - 1;
    int64_t n_fields = 0, of_fields = 0;
    const char *name;
    int64_t offset, count, is_whole;
    while (fb_field(n_fields, &name, &offset, &count, &is_whole)) {
        of_fields += count;
        n_fields++;
    }
    fb_save(drive->state, drive->saved);
    for (int64_t n = 1 + below(seed, 12); n > 0; n--) {
        const int64_t place = below(seed, 4) ? below(seed, of_fields) : below(seed, words);
        uint64_t word = drawn(seed);
        switch (below(seed, 6)) {
        case 0: break;
        case 1: word = (uint64_t)(below(seed, 400) - 2); break;                 /* a small whole number */
        case 2: word = get_word(drive->saved + head + 8 * place) ^ (1ULL << below(seed, 64)); break;
        case 3: word = (uint64_t)1 << below(seed, 53); break;
        default: memcpy(&word, &odd[below(seed, 10)], 8);
        }
        put_word(drive->saved + head + 8 * place, word);
    }
    put_word(drive->saved + size - 8, checksum(drive->saved, size - 8));
    if (fb_restore(drive->state, drive->saved, size) == 0) drive->is_true = 0;
}

/* Change some of a row's values to what no plant gives. */
static void spoil(double *row, uint64_t *seed, int64_t one_in)
{
    for (int k = 2; k < COLUMNS; k++) {
        if (below(seed, one_in)) continue;
        const double was = row[k], sign = below(seed, 2) ? 1.0 : -1.0;
        switch (below(seed, 12)) {
        case 0: case 1: row[k] = NAN; break;
        case 2: row[k] = sign * INFINITY; break;
        case 3: row[k] = sign * 1e300; break;
        case 4: row[k] = sign * 5e-324; break;
        case 5: row[k] = sign * 2.2e-308 * (double)below(seed, 1000) / 1000.0; break;
        case 6: row[k] = 0.0; break;
        case 7: row[k] = was * 10.0; break;
        case 8: row[k] = -was; break;
        case 9: row[k] = was * (1.0 + 0.1 * (double)below(seed, 20)); break;
        case 10: row[k] = sign * ldexp(1.0, (int)below(seed, 2000) - 1000); break;
        default: row[k] = sign * 1.7e308;
        }
    }
}

/* Let time pass as no grid does, now and then. */
static double odd_step(double step, uint64_t *seed, int64_t one_in)
{
    if (below(seed, one_in)) return step;
    const double factors[] = {0.0, 0.1, 2.0, 50.0, 1e4, 1e9};
    return step * factors[below(seed, 6)];
}

/* Ask what to check next, of a diagnosis that was just given. */
static void advise_next(Drive *drive)
{
    const Advice *advice = &drive->advice;
    fb_advice(drive->state, drive->work, &drive->found, &drive->advice);
    if (advice->n_checks < 0 || advice->n_checks > MOST_CHECKS) fail("number of checks");
    for (int64_t k = 0; k < advice->n_checks; k++) {
        const Check *check = &advice->checks[k];
        if (!(check->gain >= WORTH && check->gain <= 3.01)) fail("a check that tells nothing, or more than there is");
        if (check->n_groups < 2 || check->n_groups > advice->n_rivals) fail("groups of a check");
        for (int64_t r = 0; r < advice->n_rivals; r++)
            if (check->group[r] < 0 || check->group[r] >= check->n_groups) fail("group of a candidate");
    }
}

static void decide(Drive *drive, uint64_t *seed)
{
    const int64_t chosen = below(seed, N_HYPOTHESES + 3) - 1;
    fb_diagnosis(drive->state, drive->work, &drive->found);
    check_diagnosis(drive, &drive->found);
    if (drive->state->clock.index % 4 == 0) advise_next(drive); /* no number is drawn: cases that are kept stay the same */
    const int64_t sure = fb_sure(drive->state, &drive->found, 0.5);
    if (sure < -1 || sure >= N_HYPOTHESES) fail("what the rule accepts");
    const int64_t listed = drive->found.n_candidates;
    const int64_t one = listed && below(seed, 4) ? drive->found.candidates[below(seed, listed)].hypothesis : chosen;
    if (below(seed, 3)) fb_reject(drive->state, drive->work, one, &drive->candidate);
    else fb_accept(drive->state, drive->work, one, &drive->candidate);
}

/* One case, all of it drawn from the seed. */
static void run_case(uint64_t number)
{
    uint64_t seed = number;
    Drive drive;
    seed_now = number;
    begin_drive(&drive);
    int64_t at = below(&seed, n_recorded);
    const int64_t length = 100 + below(&seed, 500), calm = below(&seed, 300);
    const int64_t one_in = 2 + below(&seed, 60), rare = 20 + below(&seed, 200);
    for (int64_t k = 0; k < length; k++, at = (at + 1) % n_recorded) {
        double row[COLUMNS];
        memcpy(row, recorded[at], sizeof row);
        if (k > calm) spoil(row, &seed, one_in);
        row[1] = k > calm ? odd_step(row[1], &seed, one_in) : row[1];
        row[0] = drive.time + row[1];
        take(&drive, row);
        if (below(&seed, rare)) continue;
        switch (below(&seed, 8)) {
        case 0: fb_resume(drive.state); break;
        case 1: if (drive.is_true) keep_and_restore(&drive); break;
        case 2: if (!below(&seed, 3)) forge(&drive, &seed); break;
        case 3: fb_diagnosis(drive.state, drive.work, &drive.found); break;
        case 4: at = below(&seed, n_recorded); break;
        default: decide(&drive, &seed);
        }
    }
    end_drive(&drive);
}

/* The recording over and over, with wild values; what is true of it is checked at each sample. It begins anew now and then,
   since what was accepted at random is another plant in the end. */
static void run_wild(int64_t n, uint64_t number)
{
    uint64_t seed = number;
    int64_t counts[LOST + 1] = {0}, detections = 0;
    Drive drive;
    seed_now = number;
    begin_drive(&drive);
    drive.is_strict = 1;
    for (int64_t k = 0; k < n; k++) {
        double row[COLUMNS];
        if (k % WILD_RUN == 0) fb_init(drive.state, drive.time, 0);
        memcpy(row, recorded[k % n_recorded], sizeof row);
        /* wild ones come in bursts: between them the plant is found again */
        if (k / 500 % 2) spoil(row, &seed, 30);
        row[1] = k / 500 % 2 ? odd_step(row[1], &seed, 100) : row[1];
        row[0] = drive.time + row[1];
        take(&drive, row);
        counts[drive.report.status]++;
        detections += drive.report.detected;
        if (drive.report.due && !below(&seed, 10)) decide(&drive, &seed);
    }
    for (int k = 0; k <= LOST; k++) printf("%lld ", (long long)counts[k]);
    printf("%lld\n", (long long)detections);
}

static void write_all(FILE *out, const void *bytes, size_t n)
{
    if (fwrite(bytes, 1, n, out) != n) fail("writing");
}

/* Whole run: every report, diagnosis and state that is due is written out. */
static void run_whole(const char *path)
{
    Drive drive;
    FILE *out = fopen(path, "wb");
    int64_t decisions = 0, due = 0;
    if (!out) fail("no place for results");
    begin_drive(&drive);
    for (int64_t k = 0; k < n_recorded; k++) {
        if (k == n_recorded / 2) fb_resume(drive.state);
        take(&drive, recorded[k]);
        write_all(out, &drive.report, sizeof drive.report);
        if (!drive.report.due) continue;
        due++;
        keep_and_restore(&drive);
        check_diagnosis(&drive, &drive.found);
        write_all(out, &drive.found, sizeof drive.found);
        advise_next(&drive);
        write_all(out, &drive.advice, sizeof drive.advice);
        write_all(out, drive.saved, (size_t)fb_saved_size() - 8); /* but for the checksum */
        if (due == 2 && drive.found.n_candidates > 1)
            decisions += !fb_reject(drive.state, drive.work, drive.found.candidates[1].hypothesis, &drive.candidate);
        if (due == 14 && drive.found.n_candidates > 0)
            decisions += !fb_accept(drive.state, drive.work, drive.found.candidates[0].hypothesis, &drive.candidate);
    }
    fb_save(drive.state, drive.saved);
    write_all(out, drive.saved, (size_t)fb_saved_size() - 8); /* but for the checksum */
    fclose(out);
    printf("%lld %lld %lld\n", (long long)drive.state->clock.detections, (long long)due, (long long)decisions);
}

#ifdef FB_FLEETS
#include "threads.c"

#define ASSETS (FB_LANES + 1) /* the last one in a group of its own */
#define PARTS 2
#define ACCEPTED_AT 3 /* diagnoses */

/* The samples of all assets as a fleet takes them, each asset with values of its own that miss, and one that is wild. */
static void spread(double *times, double *steps, double *inputs, double *readings)
{
    for (int64_t a = 0; a < ASSETS; a++)
        for (int64_t k = 0; k < n_recorded; k++) {
            const int64_t at = a * n_recorded + k;
            double *y = readings + at * N_OUTPUTS;
            times[k] = recorded[k][0];
            steps[k] = recorded[k][1];
            memcpy(inputs + at * N_INPUTS, recorded[k] + 2, N_INPUTS * sizeof(double));
            memcpy(y, recorded[k] + 2 + N_INPUTS, N_OUTPUTS * sizeof(double));
            if (k % (20 + a) == 0) y[0] = NAN;
            if (k == 60 + a) y[0] = 1e4 * y[0] + 1.0;
        }
}

/* A fleet takes the recording. Who goes away takes it by itself, is accepted what leads, and comes back. */
static void run_fleet(void)
{
    static Drive drives[ASSETS];
    void *fleet = room(fb_fleet_size(ASSETS)), *works[PARTS];
    double *times = (double *)room(8 * n_recorded), *steps = (double *)room(8 * n_recorded);
    double *inputs = (double *)room(8 * ASSETS * n_recorded * N_INPUTS), *readings = (double *)room(8 * ASSETS * n_recorded * N_OUTPUTS);
    int64_t due[ASSETS] = {0}, left[ASSETS], n_left = 0, n_back = 0, n;
    int is_away[ASSETS] = {0};
    for (int p = 0; p < PARTS; p++) works[p] = room(fb_fleet_work_size());
    for (int64_t a = 0; a < ASSETS; a++) begin_drive(&drives[a]);
    spread(times, steps, inputs, readings);
    fb_fleet_init(fleet, works[0], ASSETS, 0.0, 0);
    for (int64_t at = 0; at < n_recorded; at += n) {
        n = fb_fleet_begin(fleet, n_recorded - at, times + at, steps + at);
        for (int64_t a = 0; a < ASSETS; a++) left[a] = -1;
        fb_fleet_watch_all(fleet, works, PARTS, n, n_recorded, inputs + at * N_INPUTS, readings + at * N_OUTPUTS, left);
        for (int64_t a = 0; a < ASSETS; a++) {
            Drive *drive = &drives[a];
            if (left[a] >= 0) {
                fb_fleet_leave(fleet, a, drive->state, drive->work);
                is_away[a] = 1;
                n_left++;
            }
            for (int64_t k = left[a] >= 0 ? left[a] : 0; is_away[a] && k < n; k++) {
                double row[COLUMNS];
                memcpy(row, recorded[at + k], sizeof row);
                memcpy(row + 2 + N_INPUTS, readings + (a * n_recorded + at + k) * N_OUTPUTS, N_OUTPUTS * sizeof(double));
                take(drive, row);
                if (drive->report.due && ++due[a] == ACCEPTED_AT)
                    fb_accept(drive->state, drive->work, drive->found.candidates[0].hypothesis, &drive->candidate);
            }
        }
        fb_fleet_end(fleet, n);
        for (int64_t a = 0; a < ASSETS; a++) {
            if (!is_away[a] || !fb_fleet_return(fleet, a, drives[a].state)) continue;
            is_away[a] = 0;
            n_back++;
        }
    }
    printf("%lld %lld\n", (long long)n_left, (long long)n_back);
}
#endif

static void read_recording(const char *path)
{
    FILE *file = fopen(path, "rb");
    if (!file || fread(&n_recorded, 8, 1, file) != 1 || n_recorded < 1 || n_recorded > MOST_ROWS) fail("no recording");
    if (fread(recorded, 8 * COLUMNS, (size_t)n_recorded, file) != (size_t)n_recorded) fail("recording too short");
    fclose(file);
}

int main(int n, char **words)
{
    setvbuf(stdout, NULL, _IONBF, 0);
    if (n < 4) fail("no task");
    read_recording(words[2]);
    if (!strcmp(words[1], "whole")) run_whole(words[3]);
    else if (!strcmp(words[1], "wild") && n > 4) run_wild(atoll(words[3]), strtoull(words[4], NULL, 10));
    else if (!strcmp(words[1], "case")) run_case(strtoull(words[3], NULL, 10));
    else if (!strcmp(words[1], "fuzz") && n > 4) {
        const clock_t end = clock() + (clock_t)atoll(words[3]) * CLOCKS_PER_SEC;
        for (uint64_t seed = strtoull(words[4], NULL, 10); clock() < end; seed++) {
            printf("%llu\n", (unsigned long long)seed);
            run_case(seed);
        }
    }
#ifdef FB_FLEETS
    else if (!strcmp(words[1], "fleet")) run_fleet();
#endif
    else fail("no task");
    return 0;
}
