/* The plain filter of one model, one lane wide, where it is compiled apart from core.c. */
#undef FB_LANES
#define FB_LANES 1
#include "model.h"

#include "filters.h"

void filter_step_one(double *lane, const double *sample, double *innovations, double *memory);

typedef char one_has_room[sizeof(Filter_plain) <= ONE_NUMBERS * sizeof(double) ? 1 : -1];

void filter_step_one(double *lane, const double *sample, double *innovations, double *memory)
{
    filter_step_plain(lane, sample, innovations, (Filter_plain *)memory);
}
