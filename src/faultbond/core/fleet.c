/* The usual way of many assets of one model side by side, where it is compiled apart from core.c. */
#define FB_FLEET_APART
#include "model.h"

#include "fleet.h"
