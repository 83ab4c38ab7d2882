/* The joint filter (`filter.h`) for its kinds of lanes: Filter_plain, filter_step_plain, Filter_wide, filter_step_wide, ...
   In that text the names below stand for those of one kind. */
#ifndef FB_FILTERS_H
#define FB_FILTERS_H

#include "integrate.h"

#define NO_BOUND 1e6   /* standard deviations */
#define SAYS_MUCH 0.1  /* variance of what a sensor is expected to read, in that of its noise */
#define ROUNDING 1e-16  /* part of a number that cancellation may leave of it */
#define LOG_2_PI 1.8378770664093453
#define MANY_OUTPUTS (N_OUTPUTS > 4)

#define N_JOINT (PLAIN_JOINT + N_SLOT)
#define N_PACKED TRIANGLE(N_JOINT)
#define AT_NOISE (AT_SLOT + N_SLOT)
#define AT_COVARIANCE N_JOINT
#define AT_IMPLICIT (AT_COVARIANCE + N_PACKED)
#define N_NUMBERS (N_SLOT ? WIDE_NUMBERS : PLAIN_NUMBERS)
#define AT_LIKELIHOOD (N_NUMBERS - 1)
#define PLACE(i, j) IN_TRIANGLE(N_JOINT, i, j)
#define LINEAR_READINGS (READINGS_ARE_LINEAR && !N_SLOT)

#define FB_JOINED(name, kind) name##kind
#define FB_PASTE(name, kind) FB_JOINED(name, kind)
#define OF_KIND(name) FB_PASTE(name, FB_KIND)
#define SYMMETRIC OF_KIND(SYMMETRIC)
#define STATE_ROW OF_KIND(STATE_ROW)
#define STATE_PLACE OF_KIND(STATE_PLACE)
#define OUT_ROW OF_KIND(OUT_ROW)
#define OUT_PLACE OF_KIND(OUT_PLACE)
#define Expected OF_KIND(Expected)
#define Filter OF_KIND(Filter)
#define joint_to_model OF_KIND(joint_to_model)
#define add_by_z OF_KIND(add_by_z)
#define added_by_slot OF_KIND(added_by_slot)
#define inputs_of OF_KIND(inputs_of)
#define hold_states OF_KIND(hold_states)
#define spread_states OF_KIND(spread_states)
#define scatter OF_KIND(scatter)
#define spread_rest OF_KIND(spread_rest)
#define move_states OF_KIND(move_states)
#define predict OF_KIND(predict)
#define noise_of OF_KIND(noise_of)
#define along OF_KIND(along)
#define times OF_KIND(times)
#define take_off OF_KIND(take_off)
#define read_sensors OF_KIND(read_sensors)
#define expect OF_KIND(expect)
#define update OF_KIND(update)
#define shifted OF_KIND(shifted)
#define innovate OF_KIND(innovate)
#define update_again OF_KIND(update_again)
#define filter_step OF_KIND(filter_step)
#define filter_follow OF_KIND(filter_follow)
#define left_of_relation OF_KIND(left_of_relation)
#define filter_lanes OF_KIND(filter_lanes)
#define expect_signals OF_KIND(expect_signals)

/* The filter of one lane is compiled once more, one lane wide, where it is a text of its own, one.c: it takes half the time of
   one that is as wide as the bank's. It needs memory of its own, which begins with `Step.dt`. */
#define ONE_NUMBERS \
    (4 + FB_ROOM(N_SLOW) + FB_ROOM(N_STATES) * (FB_ROOM(N_STATES) + 4 * N_V + 2 * PLAIN_JOINT) + \
     2 * N_OUTPUTS * (2 + 2 * PLAIN_JOINT) + 2 * TRIANGLE(PLAIN_JOINT) + PLAIN_NUMBERS)
#if defined(FB_APART) && FB_LANES > 1
#define FB_ONE_IS_APART
void filter_step_one(double *lane, const double *sample, double *innovations, double *memory);
#endif

/* A sample is the same for all lanes, */
#define given double
#define SHARED(a) (a)
#define EACH(a) broadcast(a)
#define GIVEN(is, a, b) ((is) ? (a) : (b))

#define FB_KIND _plain
#define N_SLOT 0
#include "filter.h"

#undef FB_KIND
#undef N_SLOT
#define FB_KIND _wide
#define N_SLOT 2
#include "filter.h"

/* or each lane, an asset of a fleet, has its own, but for the step in time and what the filter is to do. */
#ifdef FB_HOLDS_FLEET
#undef FB_KIND
#undef N_SLOT
#undef given
#undef SHARED
#undef EACH
#undef GIVEN
#define FB_KIND _beside
#define N_SLOT 0
#define FB_OWN_SAMPLES
#define given lanes
#define SHARED(a) first_of(a)
#define EACH(a) (a)
#define GIVEN(is, a, b) choose(is, a, broadcast(b))
#define SYMMETRIC_beside SYMMETRIC_plain
#define STATE_ROW_beside STATE_ROW_plain
#define STATE_PLACE_beside STATE_PLACE_plain
#define OUT_ROW_beside OUT_ROW_plain
#define OUT_PLACE_beside OUT_PLACE_plain
#include "filter.h"
#undef FB_OWN_SAMPLES
#endif

#undef FB_KIND
#undef N_SLOT
#undef given
#undef SHARED
#undef EACH
#undef GIVEN
#undef N_JOINT
#undef N_PACKED
#undef AT_NOISE
#undef AT_COVARIANCE
#undef AT_IMPLICIT
#undef N_NUMBERS
#undef AT_LIKELIHOOD
#undef PLACE
#undef LINEAR_READINGS
#undef SYMMETRIC
#undef STATE_ROW
#undef STATE_PLACE
#undef OUT_ROW
#undef OUT_PLACE
#undef Expected
#undef Filter
#undef joint_to_model
#undef add_by_z
#undef added_by_slot
#undef inputs_of
#undef hold_states
#undef spread_states
#undef scatter
#undef spread_rest
#undef move_states
#undef predict
#undef noise_of
#undef along
#undef times
#undef take_off
#undef read_sensors
#undef expect
#undef update
#undef shifted
#undef innovate
#undef update_again
#undef filter_step
#undef filter_follow
#undef left_of_relation
#undef filter_lanes
#undef expect_signals

#endif
