/* What the core offers. One library holds the on-line part of one model.

   A state (`fb_state_size` bytes) is all that is remembered from sample to sample; `work` (`fb_work_size` bytes, beginning
   where a cache line of 64 bytes does) is memory that a call needs and that holds nothing between calls. Both are the
   caller's. States are independent of each other: several threads may each run theirs, with work memory of their own.

   Numbers are SI; nan is a missing value. Nothing is wrong with data: what is missing, late or wild is counted. */
#ifndef FB_H
#define FB_H

#include <stdint.h>

#ifdef __cplusplus
extern "C" {
#endif

/* Bytes of a state, of work memory, of a saved state, and of what calls give (see found.h). */
int64_t fb_state_size(void);
int64_t fb_work_size(void);
int64_t fb_saved_size(void);
int64_t fb_report_size(void);
int64_t fb_diagnosis_size(void);
int64_t fb_candidate_size(void);
int64_t fb_advice_size(void);

/* Give the state before the first sample, at `time` (s). quiet 1: no alarm is ever raised; 2: the first alarm ends it, and nothing
   is named, which takes long where a bank is large. */
void fb_init(void *state, double time, int64_t quiet);

/* Expect a sample after a time of unknown length. */
void fb_resume(void *state);

/* Take n samples: times, and steps since the sample before, [n], s; inputs [n][N_INPUTS], readings [n][N_OUTPUTS]. Writes a
   Report for each sample, and stops after one at which an alarm is raised or a diagnosis is due, which is then written to
   `found`. Gives how many samples were taken. */
int64_t fb_block(void *state, void *work, int64_t n, const double *times, const double *steps, const double *inputs,
                 const double *readings, void *reports, void *found);

/* Take one sample: its time, the step before it, inputs, readings. 1 where an alarm is raised or a diagnosis is due. */
int64_t fb_step(void *state, void *work, const double *sample, void *report, void *found);

/* Give the diagnosis of now, after an alarm; as long as there is none, it has no candidates. Beginning all filters is spread over samples, until one brings the first diagnosis;
   where that is not awaited, this call, or a decision, does the rest of it. */
void fb_diagnosis(void *state, void *work, void *found);

/* Give what to check next, an Advice, after the diagnosis that was `found` last. */
void fb_advice(const void *state, void *work, const void *found, void *advice);

/* For who lets a rule accept: take the diagnosis that was due, `found`, and give the hypothesis that has been sure for so long
   that it is to be accepted now; -1: none yet. level: probability from which it is sure, such as SURE. */
int64_t fb_sure(void *state, const void *found, double level);

/* Take a hypothesis as the new healthy model, or what it says as repaired, so that it is again as the model says and all else as
   it was known before, or rule it out until the next alarm, with all sets that contain it; `candidate`: as it stood. 0, or why
   not (decide.h). */
int64_t fb_accept(void *state, void *work, int64_t hypothesis, void *candidate);
int64_t fb_repair(void *state, void *work, int64_t hypothesis, void *candidate);
int64_t fb_reject(void *state, void *work, int64_t hypothesis, void *candidate);

/* Give a state as fb_saved_size bytes, and take one from n bytes: 0, or why not (save.h), and then it is as it was. */
void fb_save(const void *state, uint8_t *bytes);
int64_t fb_restore(void *state, const uint8_t *bytes, int64_t n);

/* Number k of the fields of a state by name: where it stands (bytes), how many numbers it has, and whether they are int64_t,
   not double; 0 where there is none. */
int64_t fb_field(int64_t k, const char **name, int64_t *offset, int64_t *count, int64_t *is_whole);

/* Give the numbers of a lane of the bank (PLAIN_NUMBERS, or WIDE_NUMBERS from N_STEPS on), and a sample that is kept (Row). */
void fb_lane(const void *state, int64_t lane, double *numbers);
void fb_row(const void *state, int64_t number, double *row);

/* For trials and fits of a model, off-line. Pack one sample as the monitor does before its filter runs, [N_SAMPLE]: 1, or 2 where
   the model does not hold, so that the states stay; 0 while an input has not had a value. */
int64_t fb_pack(void *state, double time, double step, const double *inputs, const double *readings, double *packed);

/* Give the lane of a healthy plant, [PLAIN_NUMBERS], whose states, or states, slow errors and parameters, have this mean
   [N_STATES] and covariance [n][n]. known: a lane whose parameters and sizes of slow errors hold; NULL: the nominal ones. */
void fb_healthy_lane(const double *mean, const double *covariance, int64_t n, const double *known, double *lane);

/* Solve the start from n packed samples, [n][N_SAMPLE]: mean [N_STATES] and covariance [AT_SLOT][AT_SLOT] (start.h). Gives how
   many samples were used. */
int64_t fb_solve_start(void *work, int64_t n, const double *samples, const double *known, int64_t again, double *mean,
                       double *covariance);

/* Let the healthy filter go on from a lane. */
void fb_go_on(void *state, const double *lane);

/* Filters without a state. numbers: [PLAIN_NUMBERS or WIDE_NUMBERS][n_lanes], updated in place; samples: packed,
   [n_samples][N_SAMPLE]; innovations: [n_samples][2 N_OUTPUTS][n_lanes]; n_lanes is a multiple of FB_LANES. */
void fb_advance_plain(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations,
                      void *work);
void fb_advance_wide(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations,
                     void *work);

/* The same for one plain lane, lane: [PLAIN_NUMBERS], in half the time; innovations: [n_samples][2 N_OUTPUTS]. numbers: `count`
   numbers of it from the `first` after each sample, [n_samples][count]. */
void fb_course(int64_t n_samples, const double *samples, double *lane, int64_t first, int64_t count, double *numbers,
               double *innovations, void *work);

/* Plain lanes as plants that nobody watches: what samples bring to act on them moves their states and signals, and no reading
   is taken in: innovations are readings less what the plants give, and variances zero. */
void fb_follow(int64_t n_lanes, int64_t n_samples, const double *samples, double *numbers, double *innovations, void *work);

/* A fleet: many assets of one model that see samples at the same times, watched side by side. It is fb_fleet_size bytes, and
   each thread needs fb_fleet_work_size bytes of memory, which is zero at first; both begin where a cache line does.

   A block of samples: fb_fleet_begin tells its times and steps, and gives how many of them are taken now (the others come in a
   block of their own); fb_fleet_watch takes them into one of n_parts parts of the fleet, which several threads may do at a
   time (threads.c), each part once; fb_fleet_end ends the block. */
int64_t fb_fleet_size(int64_t n_assets);
int64_t fb_fleet_work_size(void);
void fb_fleet_init(void *fleet, void *work, int64_t n_assets, double time, int64_t quiet);
void fb_fleet_repeat(void *fleet, const void *few); /* take over the assets of another fleet, again and again */
int64_t fb_fleet_begin(void *fleet, int64_t n, const double *times, const double *steps);

/* inputs [assets][stride][N_INPUTS] and readings [assets][stride][N_OUTPUTS], of which n samples of each asset are taken. An
   asset that raises an alarm, or whose filter is lost, at a sample goes away before it: its place in the block is written to
   left [assets], whose entries are not touched else. */
void fb_fleet_watch(void *fleet, void *work, int64_t part, int64_t n_parts, int64_t n, int64_t stride, const double *inputs,
                    const double *readings, int64_t *left);
void fb_fleet_end(void *fleet, int64_t n);

/* Give the state of an asset that is here, or that went away in this block, as it was before the sample at which it did; `work`:
   fb_work_size bytes. That of one that is away takes samples by itself. */
void fb_fleet_leave(void *fleet, int64_t asset, void *state, void *work);

/* Let an asset come back, whose state has taken all samples so far; 1 where it does. It cannot before some hundred samples
   have passed since a diagnosis was accepted, and only at the end of some blocks: to be tried at each. */
int64_t fb_fleet_return(void *fleet, int64_t asset, const void *state);

/* The part of fb_fleet_watch for all parts, each by a thread of its own with its own memory: work [n_parts], where the system
   has threads; else one after the other. Stands in threads.c, apart from the core. */
void fb_fleet_watch_all(void *fleet, void **work, int64_t n_parts, int64_t n, int64_t stride, const double *inputs,
                        const double *readings, int64_t *left);

#ifdef __cplusplus
}
#endif

#endif
