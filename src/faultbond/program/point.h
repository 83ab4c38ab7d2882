/* What comes out of a recording: the points of a grid, what was wrong with the rows, and where the grid stands. */
#ifndef WATCH_POINT_H
#define WATCH_POINT_H

#include "columns.h"
#include "port.h"

#define LAST_ROWS 60     /* rows that were placed last and are known when they come again */
#define KEPT_FIRSTS 20   /* recordings, or parts of them, that are known when they are given again */
#define MESSAGE_ROOM 6144 /* bytes of a line for standard error */

/* One row of a recording, in SI; a value that is absent is nan.
   saturated: values at or beyond an end of their range, which are absent. line: of the text, from 1. */
typedef struct {
    double time;
    double u[FB_ROOM(N_INPUTS)], y[FB_ROOM(N_OUTPUTS)];
    int64_t saturated, line;
} TableRow;

/* One step of the engine: dt seconds after the point before it, 0 for the first; u, y in SI, nan where there is no value.
   resumes: 1 where what was between the point before and this one is not known; dt is then one sample. */
typedef struct {
    int64_t index;
    double time, dt;
    double u[FB_ROOM(N_INPUTS)], y[FB_ROOM(N_OUTPUTS)];
    int64_t resumes;
} Point;

/* What was passed and what was wrong with it, as the record `end` says it. */
typedef struct {
    int64_t samples, missing, late, duplicate, untimed, unused, clock_jumps, saturated, frozen;
} Counts;

/* Where a grid stands that holds nothing back: enough for a later run to go on from there. Plain numbers, to be kept as
   they are by a program for the same model.
   placed: the last rows, the oldest first. origin_index, origin_time: the point at which the grid began. usual: interval of
   rows before it began anew. last_value, finest, alike: of each sensor, for those that are frozen. firsts: hashes of the
   rows with which the last recordings began. */
typedef struct {
    Counts counts;
    int64_t n_placed;
    TableRow placed[LAST_ROWS];
    int64_t origin_index;
    double origin_time, usual;
    int64_t last_index;
    double last_time;
    double last_value[FB_ROOM(N_OUTPUTS)], finest[FB_ROOM(N_OUTPUTS)];
    int64_t alike[FB_ROOM(N_OUTPUTS)];
    int64_t n_firsts;
    uint64_t firsts[KEPT_FIRSTS];
} GridClock;

#endif
