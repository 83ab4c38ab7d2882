/* The core at work on one plant: its memory, and the few numbers of its state that are told. Needs model.h, found.h, fb.h. */
#ifndef WATCH_PLANT_H
#define WATCH_PLANT_H

#include <math.h>
#include <string.h>

#include "memory.h"

/* Numbers of a state that are told, where they stand in it. */
typedef struct {
    int64_t alarm, alarm_time, change_time, crossed, walker, window, walk, noise;
} PlantPlaces;

typedef struct {
    PlantMemory memory;
    PlantPlaces at;
} Plant;

/* An alarm: when, at which sample, when the fault may have begun, which sensors' sums crossed, and what walked. */
typedef struct {
    double time, change_time, walk;
    int64_t sample, walker, window;
    int64_t crossed[N_OUTPUTS];
} PlantAlarm;

/* Where a number of a state stands; -1 where there is none of this name. */
static int64_t place_of(const char *wanted)
{
    const char *name;
    int64_t offset, count, is_whole;
    for (int64_t k = 0; fb_field(k, &name, &offset, &count, &is_whole); k++)
        if (strcmp(name, wanted) == 0) return offset;
    return -1;
}

/* Begin a plant at time 0; 0 where the core is of another model or version than what this was compiled with. */
static int plant_begin(Plant *plant)
{
    PlantPlaces *at = &plant->at;
    plant->memory = plant_memory();
    at->alarm = place_of("clock.alarm");
    at->alarm_time = place_of("alarm.time");
    at->change_time = place_of("alarm.change_time");
    at->crossed = place_of("alarm.crossed");
    at->walker = place_of("alarm.walker");
    at->window = place_of("alarm.window");
    at->walk = place_of("alarm.walk");
    at->noise = place_of("normal.noise");
    const int known = at->alarm >= 0 && at->alarm_time >= 0 && at->change_time >= 0 && at->crossed >= 0 && at->walker >= 0 &&
                      at->window >= 0 && at->walk >= 0 && at->noise >= 0;
    const int fits = fb_report_size() == (int64_t)sizeof(Report) && fb_diagnosis_size() == (int64_t)sizeof(Diagnosis) &&
                     fb_candidate_size() == (int64_t)sizeof(Candidate) && fb_advice_size() == (int64_t)sizeof(Advice);
    if (!known || !fits || fb_saved_size() > plant->memory.saved_room) return 0;
    fb_init(plant->memory.state, 0.0, 0);
    return 1;
}

/* Copy n numbers of eight bytes out of the state. */
static void plant_numbers(const Plant *plant, int64_t place, void *numbers, size_t n)
{
    memcpy(numbers, (const char *)plant->memory.state + place, 8 * n);
}

static PlantAlarm plant_alarm(const Plant *plant)
{
    PlantAlarm alarm;
    plant_numbers(plant, plant->at.alarm, &alarm.sample, 1);
    plant_numbers(plant, plant->at.alarm_time, &alarm.time, 1);
    plant_numbers(plant, plant->at.change_time, &alarm.change_time, 1);
    plant_numbers(plant, plant->at.crossed, alarm.crossed, N_OUTPUTS);
    plant_numbers(plant, plant->at.walker, &alarm.walker, 1);
    plant_numbers(plant, plant->at.window, &alarm.window, 1);
    plant_numbers(plant, plant->at.walk, &alarm.walk, 1);
    return alarm;
}

/* Whether there is an alarm that nothing was accepted for. */
static int plant_has_alarm(const Plant *plant)
{
    int64_t alarm;
    plant_numbers(plant, plant->at.alarm, &alarm, 1);
    return alarm >= 0;
}

/* Which sensors are used: one that was accepted as stuck is not. */
static void plant_in_use(const Plant *plant, int in_use[N_OUTPUTS])
{
    double noise[N_OUTPUTS];
    plant_numbers(plant, plant->at.noise, noise, N_OUTPUTS);
    for (int j = 0; j < N_OUTPUTS; j++) in_use[j] = isfinite(noise[j]) != 0;
}

#endif
