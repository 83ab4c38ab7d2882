/* The core: the on-line part of one model, in plain C: no allocation, no file, no clock, no state but what it is given. What
   it offers stands in fb.h. A sample takes this way:

     1. core.c       a block of samples comes in, one after the other (fb_block)
     2. wild.h       values far beyond all that was seen are refused; until it is known whether an input is, two pasts go on
        smooth.h     what acts, from records that scatter; spikes.h: inputs that were off for one sample
        samples.h    the sample as the filters take it: inputs held, steps blanked, gaps allowed for
     3. start.h      the first samples tell where the plant begins, from a guess by shown.h, outliers.h without those that are wild
     4. advance.h    the healthy filter: filters.h (filter.h, triangle.h), which steps in time by integrate.h
     5. detector.h   sums of what it did not expect (sums.h), walking.h how far it had to move its parameters, and the alarm
     6. trail.h      the samples before the alarm, and the places where the fault may have begun; all_along.h: if that was before them
     7. bank.h       a filter for every hypothesis from there, begun little by little (work.h, onsets.h): steps.h and growing.h
                     for steps of parameters, slots.h and ramps.h for all other kinds of fault, couples.h for two kinds at once,
                     first.h for what was there at the first sample of all; rest.h: which cannot win any more
     8. ranking.h    how likely each hypothesis is, and what is wrong by how much (estimates.h); moving.h: which values still move;
                     fault_range.h: which cannot be, stopped.h: meters that have stuck, further.h: what a model's errors may be all of,
                     within.h: what is no more than the accuracy; mismatch.h: that the model is off;
                     unexplained.h: what nothing explains; untested.h: what else it could be
     9. diagnosis.h  what is said; advice.h: what to check next
    10. over.h       an alarm by which nothing is at fault is over
        decide.h     a diagnosis becomes the healthy model, by rule.h without a person, or is ruled out; save.h: a state as
                     bytes, by the table of fields.h

   watch.h holds 2 to 9 together, but for the advice; with a diagnosis that is due it keeps in mind what has been sure for long
   (`settle_on` in rule.h). A sample at which the model does not hold (`leave_out` in samples.h) goes another way: `pass_outside`
   lets time pass, the states stay, and nothing is judged.

   watching.h, with smooth.h, sums.h, walking.h and real.h, is the part of 2, 4 and 5 that is the same for every sample. plant.h says
   what its words stand for where one plant is watched. Fleets of many assets take it side by side (fleet.h), and the whole way one by
   one where a sample is not usual (alone.h), if FB_FLEETS is defined.

   found.h says what calls give, state.h what is remembered, watched.h what of that fleets remember too, layout.h where the numbers of
   a lane and of a sample stand, given.h what a parameter is beside those that go with it; maths.h, lanes.h and port.h compute. model.h
   is generated: sizes, tables, rates and readings of one model. filters.c, one.c and fleet.c are what is compiled apart from this
   text, faster, where FB_APART is defined; threads.c lets parts of a fleet go on at a time. */
#ifndef FB_MODEL_H
#include "model.h"
#endif

#include "decide.h"
#include "fb.h"
#include "save.h"
#ifdef FB_FLEETS
#include "alone.h"
#endif

#ifdef __cplusplus
extern "C" {
#endif

int64_t fb_state_size(void) { return (int64_t)sizeof(State); }
int64_t fb_work_size(void) { return (int64_t)sizeof(Work); }
int64_t fb_saved_size(void) { return saved_size(); }
int64_t fb_report_size(void) { return (int64_t)sizeof(Report); }
int64_t fb_diagnosis_size(void) { return (int64_t)sizeof(Diagnosis); }
int64_t fb_candidate_size(void) { return (int64_t)sizeof(Candidate); }
int64_t fb_advice_size(void) { return (int64_t)sizeof(Advice); }

void fb_init(void *state, double time, int64_t quiet) { begin_state((State *)state, time, quiet); }

static void finish(void *state, void *work)
{
    Work *memory = (Work *)work;
    prepare_filters(&memory->filters);
    finish_bank((State *)state, &memory->bank, &memory->filters);
}

void fb_resume(void *state) { resume(&((State *)state)->clock); }

int64_t fb_step(void *state, void *work, const double *sample, void *report, void *found)
{
    (void)fb_block(state, work, 1, sample, sample + 1, sample + 2, sample + 2 + N_INPUTS, report, found);
    return ((Report *)report)->detected || ((Report *)report)->due;
}

int64_t fb_block(void *state, void *work, int64_t n, const double *times, const double *steps, const double *inputs,
                 const double *readings, void *reports, void *found)
{
    Work *memory = (Work *)work;
    prepare_filters(&memory->filters);
    for (int64_t k = 0; k < n; k++) {
        Report *report = (Report *)reports + k;
        Sample sample;
        sample.time = times[k];
        sample.dt = steps[k];
        memcpy(sample.u, inputs + k * N_INPUTS, N_INPUTS * sizeof(double));
        memcpy(sample.y, readings + k * N_OUTPUTS, N_OUTPUTS * sizeof(double));
        watch((State *)state, &sample, report, (Diagnosis *)found, memory);
        if (report->due || report->detected) return k + 1;
    }
    return n;
}

void fb_diagnosis(void *state, void *work, void *found)
{
    finish(state, work);
    conclude((const State *)state, (Diagnosis *)found, &((Work *)work)->ranking);
}

void fb_advice(const void *state, void *work, const void *found, void *advice)
{
    Work *memory = (Work *)work;
    prepare_filters(&memory->filters);
    advise((const State *)state, (const Diagnosis *)found, &memory->rivals, &memory->filters, (Advice *)advice);
}

int64_t fb_sure(void *state, const void *found, double level)
{
    State *known = (State *)state;
    return take_diagnosis(&known->sure, (const Diagnosis *)found, known->clock.index - 1, level);
}

int64_t fb_accept(void *state, void *work, int64_t hypothesis, void *candidate)
{
    Work *memory = (Work *)work;
    finish(state, work);
    return accept((State *)state, hypothesis, 0, (Candidate *)candidate, &memory->found, &memory->ranking);
}

int64_t fb_repair(void *state, void *work, int64_t hypothesis, void *candidate)
{
    Work *memory = (Work *)work;
    finish(state, work);
    return accept((State *)state, hypothesis, 1, (Candidate *)candidate, &memory->found, &memory->ranking);
}

int64_t fb_reject(void *state, void *work, int64_t hypothesis, void *candidate)
{
    Work *memory = (Work *)work;
    finish(state, work);
    return reject((State *)state, hypothesis, (Candidate *)candidate, &memory->found, &memory->ranking);
}

void fb_save(const void *state, uint8_t *bytes) { save_state((const State *)state, bytes); }

int64_t fb_restore(void *state, const uint8_t *bytes, int64_t n) { return restore_state((State *)state, bytes, n); }

/* Number `k` of the fields of a state; 0 where there is none. */
int64_t fb_field(int64_t k, const char **name, int64_t *offset, int64_t *count, int64_t *is_whole)
{
    if (k < 0 || k >= N_FIELDS) return 0;
    *name = FIELDS[k].name;
    *offset = FIELDS[k].offset;
    *count = FIELDS[k].count;
    *is_whole = FIELDS[k].is_whole;
    return 1;
}

void fb_lane(const void *state, int64_t lane, double *numbers)
{
    const Bank *bank = &((const State *)state)->bank;
    const int64_t count = lane < N_STEPS ? PLAIN_NUMBERS : WIDE_NUMBERS;
    for (int64_t k = 0; k < count; k++) numbers[k] = lane < N_STEPS ? of_step(bank, lane, k) : of_slot(bank, lane - N_STEPS, k);
}

void fb_row(const void *state, int64_t number, double *row)
{
    memcpy(row, &((const State *)state)->past.rows[number % N_ROWS], sizeof(Row));
}

int64_t fb_pack(void *state, double time, double step, const double *inputs, const double *readings, double *packed)
{
    State *known = (State *)state;
    Sample sample;
    sample.time = time;
    sample.dt = step;
    memcpy(sample.u, inputs, N_INPUTS * sizeof(double));
    memcpy(sample.y, readings, N_OUTPUTS * sizeof(double));
    int64_t left_out[N_OUTPUTS];
    smooth_inputs(&known->inputs, &sample);
    if (!has_inputs(&known->inputs, &sample)) return 0;
    const int outside = leave_out(&known->inputs, &sample, left_out);
    if (outside) pack_outside(known, &sample, &known->clock, &known->inputs, packed);
    else pack_sample(known, &sample, &known->clock, &known->inputs, known->healthy.astray, packed);
    known->clock.index++;
    return outside ? 2 : 1;
}

void fb_healthy_lane(const double *mean, const double *covariance, int64_t n, const double *known, double *lane)
{
    healthy_lane(mean, covariance, (int)n, known, lane);
}

int64_t fb_solve_start(void *work, int64_t n, const double *samples, const double *known, int64_t again, double *mean,
                       double *covariance)
{
    Work *memory = (Work *)work;
    FirstMemory *first = &memory->bank.first;
    const int64_t count = n < MOST_FIRST ? n : MOST_FIRST;
    prepare_filters(&memory->filters);
    memcpy(first->samples, samples, (size_t)count * sizeof first->samples[0]);
    memset(&memory->normal, 0, sizeof memory->normal);
    solve_start(first->samples, count, known, (int)again, &memory->normal, mean, covariance, &first->solve,
                &memory->filters.plain);
    return count;
}

void fb_go_on(void *state, const double *lane)
{
    State *known = (State *)state;
    known->clock.running = 1;
    memcpy(known->healthy.lane, lane, sizeof known->healthy.lane);
}

void fb_advance_plain(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations,
                      void *memory)
{
    filter_lanes_plain(n_lanes, n_samples, samples, numbers, innovations, 0, &((Work *)memory)->filters.plain);
}

void fb_advance_wide(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations,
                     void *memory)
{
    filter_lanes_wide(n_lanes, n_samples, samples, numbers, innovations, 0, &((Work *)memory)->filters.wide);
}

void fb_course(int64_t n_samples, const double *samples, double *lane, int64_t first, int64_t count, double *numbers,
               double *innovations, void *memory)
{
    Filter_plain *filter = &((Work *)memory)->filters.plain;
    prepare_filters(&((Work *)memory)->filters);
    for (int64_t t = 0; t < n_samples; t++) {
        step_one(lane, samples + t * N_SAMPLE, innovations + t * 2 * N_OUTPUTS, filter);
        for (int64_t i = 0; i < count; i++) numbers[t * count + i] = lane[first + i];
    }
}

void fb_follow(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations, void *memory)
{
    filter_lanes_plain(n_lanes, n_samples, samples, numbers, innovations, 1, &((Work *)memory)->filters.plain);
}

#ifdef FB_FLEETS
int64_t fb_fleet_size(int64_t n_assets) { return (int64_t)(sizeof(Fleet) + (size_t)N_GROUPS(n_assets) * sizeof(Group)); }

/* Bytes up to which memory is used, up to whole lines of the cache. */
static int64_t in_lines(int64_t bytes) { return (bytes + 63) / 64 * 64; }

int64_t fb_fleet_work_size(void) { return in_lines((int64_t)sizeof(AloneMemory)) + in_lines(lanes_memory_size()); }

void fb_fleet_init(void *fleet, void *work, int64_t n_assets, double time, int64_t quiet)
{
    begin_fleet((Fleet *)fleet, n_assets, time, quiet, &((AloneMemory *)work)->state);
}

void fb_fleet_repeat(void *fleet, const void *few) { repeat_assets((Fleet *)fleet, (const Fleet *)few); }

int64_t fb_fleet_begin(void *fleet, int64_t n, const double *times, const double *steps)
{
    Fleet *known = (Fleet *)fleet;
    const int64_t most = KEPT_EVERY - known->index % KEPT_EVERY, count = n < most ? n : most;
    for (int64_t t = 0; t < count; t++) {
        known->times[(known->index + t) % TIMES] = times[t];
        known->steps[(known->index + t) % TIMES] = steps[t];
    }
    return count;
}

void fb_fleet_watch(void *fleet, void *work, int64_t part, int64_t n_parts, int64_t n, int64_t stride, const double *inputs,
                    const double *readings, int64_t *left)
{
    Fleet *known = (Fleet *)fleet;
    AloneMemory *alone = (AloneMemory *)work;
    const int64_t n_groups = N_GROUPS(known->n_assets);
    const Portion portion = {n, stride, inputs, readings, left};
    prepare_filters(&alone->work.filters);
    watch_groups(known, &portion, n_groups * part / n_parts, n_groups * (part + 1) / n_parts,
                 (char *)work + in_lines((int64_t)sizeof(AloneMemory)), alone);
}

void fb_fleet_end(void *fleet, int64_t n) { ((Fleet *)fleet)->index += n; }

void fb_fleet_leave(void *fleet, int64_t asset, void *state, void *work)
{
    prepare_filters(&((Work *)work)->filters);
    leave((Fleet *)fleet, asset, (State *)state, (Work *)work);
}

int64_t fb_fleet_return(void *fleet, int64_t asset, const void *state)
{
    return come_back((Fleet *)fleet, asset, (const State *)state);
}
#endif

#ifdef __cplusplus
}
#endif
