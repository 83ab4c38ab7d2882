"""Couples of a sensor and a parameter: chosen also by what the parameter alone leaves to explain at the sensor."""

from math import log
from typing import NamedTuple

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.contract.slots import plan_slots
from faultbond.synthesis.compile import find_compiler
from faultbond.types import FaultKind

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SAMPLES, LEFT = 50, 40.0  # of a sum, and that
CALLS = """
static int64_t couple_with(int input, int output)
{
    for (int64_t couple = 0; couple < N_MIXED; couple++)
        for (int64_t k = 0; k < SWITCHED; k++) {
            if (SLOT_HYPOTHESIS[k] != COUPLE_SLOT[couple] || COUPLE_PARAMETER[couple] != 1) continue;
            if (SLOT_OUTPUT[k] == output && SLOT_INPUT[k] == input) return couple;
        }
    return -1;
}
/* The second parameter alone, at 1.4, says given[0], and leaves a sum at the second sensor; lanes with a slot say
   given[1], those that are stuck a nat more. given[2], given[3]: the input and the sensor of the
   couple. */
void t_match(State *state, const double *given, double *found)
{
    Bank *bank = &state->bank;
    const int64_t place = AT_PARAMETERS + 1, own = likeliest_lane(bank, single_of(1));
    state->clock.index = 1000;
    bank->healthy[place] = 1.0;
    bank->healthy[PLAIN_PLACE(place, place)] = 0.01;
    for (int64_t lane = 0; lane < N_STEPS; lane++) *number_of_step(bank, lane, PLAIN_LIKELIHOOD) = -1e5;
    *number_of_step(bank, own, PLAIN_LIKELIHOOD) = given[0];
    *number_of_step(bank, own, place) = 1.4;
    bank->sums[1][1][own] = LEFT;
    bank->since[1][1][own] = 1000.0 - SAMPLES;
    for (int64_t lane = 0; lane < N_SLOT_LANES; lane++) {
        const double more = SLOT_KIND[lane] == KIND_STUCK ? 1.0 : 0.0;
        *number_of_slot(bank, lane, WIDE_LIKELIHOOD) = given[1] + more - SLOT_WEIGHT[lane];
        *number_of_slot(bank, lane, place) = 1.0;
        *number_of_slot(bank, lane, WIDE_PLACE(place, place)) = 0.01;
    }
    const Match match = match_of(bank, couple_with((int)given[2], (int)given[3]), NULL, state->clock.index);
    found[0] = (double)SLOT_KIND[match.base[0]];
    found[1] = match.base[1] < 0 ? -1.0 : (double)SLOT_KIND[match.base[1]];
    found[2] = match.said[0];
    found[3] = match.value[1];
    found[4] = match.score;
}
""".replace("LEFT", str(LEFT)).replace("SAMPLES", str(float(SAMPLES)))


class Matched(NamedTuple):
    """Kinds of both bases, what is said, where the parameter begins with the second, and the score."""

    first: int
    second: int
    said: float
    value: float
    score: float


def matched(core: Bare, step: float, slot: float, *, sensor: int = 1, uses: int = -1) -> Matched:
    """Give what is said of a couple."""
    found = np.zeros(5)
    core.call("t_match", np.array([step, slot, float(uses), float(sensor)]), found)
    return Matched(int(found[0]), int(found[1]), *(float(value) for value in found[2:]))


def test_a_sensor_is_tried_beside_a_parameter_by_what_that_leaves_at_it() -> None:
    """With a bias, where the step of the parameter has that, beside what the sensor alone says best."""
    core = bare(CALLS, CELL.replace("max_faults: 1", "max_faults: 2"))
    settings, kinds = core.spec.thresholds, list(FaultKind)
    bias, stuck = kinds.index(FaultKind.BIAS), kinds.index(FaultKind.STUCK)
    likeliest = max(x.weight for x in plan_slots(core.spec).lanes if x.output == 1 and x.kind is FaultKind.BIAS)
    left = 0.5 * SAMPLES * (settings.cusum_drift + LEFT / SAMPLES) ** 2
    cost = settings.cost_per_suspect + settings.cost_per_sensor
    found = matched(core, -100.0, -100.0)
    assert (found.first, found.second, found.value) == (stuck, bias, 1.4)
    assert found.said == pytest.approx(-100.0 + likeliest + left)
    assert found.score == pytest.approx(found.said - cost)
    alone = matched(core, -100.0 - left - 20.0, -100.0)
    assert alone.first == stuck
    assert alone.said == pytest.approx(-99.0, abs=log(1e3))
    assert alone.value != 1.4
    # Not of a sensor at which nothing is left, nor of an input, whose fault shows at any sensor.
    assert matched(core, -100.0, -90.0, sensor=0).value != 1.4
    assert matched(core, -100.0, -190.0, sensor=-1, uses=0).value != 1.4
