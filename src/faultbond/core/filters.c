/* The filters of one model, where they are compiled apart from core.c. */
#define FB_APART
#define FB_HOLDS_FILTERS
#include "model.h"

#include "filters.h"
