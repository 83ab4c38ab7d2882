/* The library: the core with this model, and the names of what it finds. With -DFB_APART the filters are compiled beside it, from
   core/filters.c and core/one.c, as the Makefile does; without, this is all of it. */
#include "core/core.c"

#include "faultbond.h"

/* The constants of faultbond.h are those of this compiler. */
typedef char state_has_room[sizeof(State) <= FB_STATE_BYTES ? 1 : -1];
typedef char work_has_room[sizeof(Work) <= FB_WORK_BYTES ? 1 : -1];

#ifdef FB_MEMORY
FB_ALIGNED unsigned char fb_memory_state[sizeof(State)], fb_memory_work[sizeof(Work)];
#endif

const char *fb_suspect_name(const Suspect *suspect)
{
    static const char *const parameters[] = {{{parameter_texts}}};
    static const char *const inputs[] = {{{input_texts}}};
    static const char *const sensors[] = {{{sensor_texts}}};
    if (suspect->parameter >= 0) return parameters[suspect->parameter];
    return suspect->output >= 0 ? sensors[suspect->output] : inputs[suspect->input];
}
