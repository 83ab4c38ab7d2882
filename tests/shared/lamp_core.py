"""The core of a lamp with an implicit loop and samples at any time: its lanes with a slot, for tests."""

from functools import cache

import numpy as np

from bare_core import Bare, bare
from faultbond.arrays import FloatArray
from plants import LAMP

CALLS = """
static SlotMemory slots;
static Trail trail;
static Past past;
void t_widen(State *state, const double *plain, double *wide) { (void)state; widen(plain, wide); }
void t_narrow(State *state, const double *wide, double *plain) { (void)state; narrow(wide, 0.0, -1, plain); }
/* The usual step of some samples, of these lengths. */
void t_usual_step(State *state, const double *lengths, const double *n, double *found)
{
    (void)state;
    trail.past = &past;
    trail.oldest = DEPTH - 1;
    for (int64_t k = 0; k < (int64_t)*n; k++) row_of(&past, trail.oldest + k)->sample[SAMPLE_DT] = lengths[k];
    *found = usual_step(&trail, (int64_t)*n);
}
/* Mix FB_LANES pairs: [2][WIDE_NUMBERS][FB_LANES], fault there and gone. */
void t_interact(State *state, double *pairs)
{
    (void)state;
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
        slots.there[i] = load(pairs + i * FB_LANES);
        slots.gone[i] = load(pairs + (WIDE_NUMBERS + i) * FB_LANES);
    }
    interact(SWITCHING, &slots);
    for (int64_t i = 0; i < WIDE_NUMBERS; i++) {
        store(pairs + i * FB_LANES, slots.there[i]);
        store(pairs + (WIDE_NUMBERS + i) * FB_LANES, slots.gone[i]);
    }
}
"""
WIDTH = 8  # lanes at a time


@cache
def lamp() -> Bare:
    """The core, whose state no call changes."""
    return bare(CALLS, LAMP.replace("sample_time: 0.1 s", "sample_time: variable"), f"-DFB_LANES={WIDTH}")


def interacted(lanes: FloatArray) -> FloatArray:
    """Lanes (n_numbers, 2 n) of pairs, n at most eight, after they have mixed."""
    n = lanes.shape[1] // 2
    pairs = np.zeros((2, lanes.shape[0], WIDTH))
    pairs[0], pairs[1] = lanes[:, :1], lanes[:, 1:2]
    pairs[0, :, :n], pairs[1, :, :n] = lanes[:, ::2], lanes[:, 1::2]
    lamp().call("t_interact", pairs)
    found = np.empty_like(lanes)
    found[:, ::2], found[:, 1::2] = pairs[0, :, :n], pairs[1, :, :n]
    return found
