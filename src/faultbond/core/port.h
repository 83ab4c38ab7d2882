/* What the compiler is asked for: pointers that do not overlap, and how many lanes are computed at a time. */
#ifndef FB_PORT_H
#define FB_PORT_H

#include <math.h>
#include <stdint.h>
#include <string.h>

/* 1, 2, 4 or 8: as many as a register of the processor holds. Of a number that takes two registers gcc keeps most in memory, and
   takes twice to four times as long; see docs/decisions/017-core-in-loops.md. */
#ifndef FB_LANES
#if !defined(__GNUC__)
#define FB_LANES 1
#elif defined(__AVX512F__)
#define FB_LANES 8
#elif defined(__AVX__)
#define FB_LANES 4
#else
#define FB_LANES 2
#endif
#endif

/* The filters take half the time of a compiler, and nearly all of that of a run. Where FB_APART is defined they are a text of
   their own, filters.c, that can be compiled beside core.c, and with other options; else core.c holds them. */
#ifdef FB_APART
#define FB_OF_FILTERS
#else
#define FB_OF_FILTERS static
#define FB_HOLDS_FILTERS
#endif

/* So is the usual way of many assets side by side: fleet.c. */
#if defined(FB_APART) || defined(FB_FLEET_APART)
#define FB_OF_FLEETS
#else
#define FB_OF_FLEETS static
#endif
#if defined(FB_FLEET_APART) || (defined(FB_FLEETS) && !defined(FB_APART))
#define FB_HOLDS_FLEET
#endif

#if defined(__cplusplus)
#define FB_RESTRICT __restrict
#else
#define FB_RESTRICT restrict
#endif

/* What runs seldom, between FB_SELDOM and FB_OFTEN, is not optimised far where the text can ask for that: it is two thirds of what
   there is to compile, and a first run waits for it. */
#if defined(__OPTIMIZE__) && defined(__GNUC__) && !defined(__clang__)
#define FB_SELDOM _Pragma("GCC push_options") _Pragma("GCC optimize(\"Og\")")
#define FB_OFTEN _Pragma("GCC pop_options")
#else
#define FB_SELDOM
#define FB_OFTEN
#endif

/* An array needs an entry, also where a model has none of its kind. */
#define FB_ROOM(n) ((n) > 0 ? (n) : 1)

#endif
