/* What the library of {{model}} offers: sizes, the order of numbers, and what calls give and take.

   Needs the folder core beside it, and no more. Programs include this file; model.h and the rest of core are the library's own. */
#ifndef FAULTBOND_H
#define FAULTBOND_H

#ifndef FB_MODEL_H
{{sizes}}
#endif

#include "core/found.h"
#include "core/fb.h"

/* Memory of a plant that is watched, and of a call; a saved state. Bytes. */
#define FB_STATE_BYTES {{state_bytes}}
#define FB_WORK_BYTES {{work_bytes}}
#define FB_SAVED_BYTES {{saved_bytes}}

/* Before a definition of such memory: it begins where a cache line does. */
#if defined(__cplusplus)
#define FB_ALIGNED alignas(64)
#elif defined(__GNUC__)
#define FB_ALIGNED __attribute__((aligned(64)))
#else
#define FB_ALIGNED _Alignas(64)
#endif

/* The order of inputs, readings and parameters, all in SI (percent stays percent): temperatures in K, also of columns that a
   recording has in degC. */
{{input_order}}
{{sensor_order}}
{{parameter_order}}

#ifdef __cplusplus
extern "C" {
#endif

/* The name of a suspect, as the model file has it: of a parameter, a sensor or an input. */
const char *fb_suspect_name(const Suspect *suspect);

/* With -DFB_MEMORY the library has memory for one plant and its calls, no more than it needs where it computes one lane at a
   time: FB_WORK_BYTES is for as many lanes as any machine computes. */
#ifdef FB_MEMORY
extern unsigned char fb_memory_state[], fb_memory_work[];
#endif

#ifdef __cplusplus
}
#endif

#endif
