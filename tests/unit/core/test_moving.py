"""Values that still move: noted now and then after the last work on the bank, and as uncertain as they moved."""

from math import hypot, sqrt

import numpy as np
import pytest

from bare_core import CELL, Bare, bare
from faultbond.contract.core_settings import core_settings
from faultbond.contract.lanes import plan_lanes
from faultbond.synthesis.compile import find_compiler

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
SETTINGS = core_settings()
FROM, STILL, LEAST, USUAL = (int(SETTINGS["NOTED_FROM"]), *(SETTINGS[k] for k in ("STILL", "WALK_LEAST", "WALK_USUAL")))
ALARM = 700  # the sample of it
CALLS = """
void t_set(State *state, const double *lane, const double *value, const double *variance)
{
    const int64_t l = (int64_t)*lane, k = AT_PARAMETERS + SET_MEMBER[SET_ROW[LANE_HYPOTHESIS[l]]];
    *number_of_step(&state->bank, l, k) = *value;
    *number_of_step(&state->bank, l, PLAIN_PLACE(k, k)) = *variance;
}
void t_slot(State *state, const double *lane, const double *value, const double *variance)
{
    const int64_t l = (int64_t)*lane;
    *number_of_slot(&state->bank, l, AT_SLOT) = *value;
    *number_of_slot(&state->bank, l, WIDE_PLACE(AT_SLOT, AT_SLOT)) = *variance;
}
int64_t t_ramp(State *state)
{
    (void)state;
    for (int64_t l = RAMPED; l < SWITCHED; l++)
        if (SLOT_KIND[l] == KIND_RAMP && SLOT_OUTPUT[l] == 0) return l;
    return -1;
}
void t_moves(State *state, const double *lane, const double *likelihood)
{
    *number_of_slot(&state->bank, (int64_t)*lane, ROLE_TOOK) = 1e3;
    *number_of_slot(&state->bank, (int64_t)*lane, WIDE_LIKELIHOOD) = *likelihood;
}
void t_ended(State *state, const double *lane, const double *time)
{
    *number_of_slot(&state->bank, (int64_t)*lane, ROLE_ENDED) = *time;
}
int64_t t_bias(State *state)
{
    (void)state;
    for (int64_t l = 0; l < SWITCHED; l++)
        if (SLOT_KIND[l] == KIND_BIAS && SLOT_OUTPUT[l] == 0) return l;
    return -1;
}
void t_note(State *state) { note_values(state); }
void t_found(State *state, const double *lane, double *found)
{
    Suspect suspects[LARGEST_SET];
    const int64_t l = (int64_t)*lane;
    judged_suspects(state, l, suspects);
    const Suspect *suspect = &suspects[0];
    const double unit = l < N_STEPS ? SCALE[suspect->parameter] : OUTPUT_NOISE[0];
    found[0] = suspect->estimate / unit;
    found[1] = suspect->sd / fabs(unit);
    found[2] = suspect->moved;
}
"""


def wider(index: int) -> float:
    """By how much more than the filter says a value is uncertain, since model and plant differ."""
    return sqrt(1.0 + (index - ALARM) / SETTINGS["AS_MANY"])


def settled(renewals: int = 3) -> Bare:
    """A core whose bank has begun again for the last time at sample 1000."""
    core = bare(CALLS, CELL)
    core["clock.alarm"], core["job.renewals"], core["job.settled"], core["job.ended"] = ALARM, renewals, 1000, 1000
    return core


def noted(core: Bare, path: dict[int, tuple[float, float]], lane: int = 0, call: str = "t_set") -> list[float]:
    """Let a lane go through values and sds, each from a sample on, and note; what it says at the end."""
    now = (1.0, 1.0)
    for index in range(1000, max(path) + 1):
        now = path.get(index, now)
        core["clock.index"] = index
        core.call(call, np.array([float(lane)]), np.array([now[0]]), np.array([now[1] ** 2]))
        core.call("t_note")
    found = np.zeros(3)
    core.call("t_found", np.array([float(lane)]), found)
    return [float(value) for value in found]


def test_a_value_is_compared_with_that_of_two_notes_ago() -> None:
    """Notes are taken 100, 200, 400, ... samples after the last work; the one before the last counts."""
    core = settled()
    noted(core, {1000 + FROM * 4: (1.3, 0.1)})
    assert np.array(core["bank.noted_at"]).tolist() == [1000 + 2 * FROM, 1000 + 4 * FROM]
    noted(core, {1000 + FROM * 7: (1.3, 0.1)})
    assert np.array(core["bank.noted_at"]).tolist() == [1000 + 2 * FROM, 1000 + 4 * FROM]


def test_what_moves_as_its_variance_shrinks_has_settled() -> None:
    """Its sd is that of the filter, as far as likelihoods count."""
    value, sd, moved = noted(settled(), {1000: (1.30, 0.10), 1250: (1.45, 0.04)})
    assert value == pytest.approx(1.45)
    assert moved == 0.0
    assert sd == pytest.approx(0.04 * wider(1250))


def test_what_moves_farther_still_moves_and_is_as_uncertain_as_that() -> None:
    """By so many sd of what its variance allows, times how far the parameter usually walks."""
    for before, left in ((0.05, 0.04), (0.04, 0.04)):
        value, sd, moved = noted(settled(), {1000: (1.30, before), 1250: (1.65, left)})
        allowed = sqrt(max(before**2 - left**2, LEAST * left**2) * USUAL)
        assert moved == pytest.approx(0.35 / allowed)
        assert moved > STILL
        assert sd == pytest.approx(hypot(left * wider(1250), 0.35))
        assert value == pytest.approx(1.65)


def test_before_two_notes_nothing_is_said() -> None:
    """Nor before the bank has begun for the last time."""
    assert noted(settled(), {1000: (1.3, 0.05), 1000 + 2 * FROM - 1: (1.9, 0.04)})[2] == 0.0
    assert noted(settled(renewals=2), {1000: (1.3, 0.05), 1250: (1.9, 0.04)})[2] == 0.0


def test_a_bias_of_a_sensor_may_move_too() -> None:
    """In the noise of the sensor; no usual walk is known of it."""
    core = settled()
    lane = int(core.call("t_bias"))
    steps = plan_lanes(core.spec).n_lanes
    for index in range(1000, 1000 + 2 * FROM + 1):
        core["clock.index"] = index
        core.call("t_slot", np.array([float(lane)]), np.array([20.0]), np.array([4.0]))
        core.call("t_note")
    core.call("t_slot", np.array([float(lane)]), np.array([26.0]), np.array([3.0]))
    found = np.zeros(3)
    core.call("t_found", np.array([float(steps + lane)]), found)
    assert found[2] == pytest.approx(6.0)
    assert found[1] == pytest.approx(hypot(sqrt(3.0) * wider(1000 + 2 * FROM), 6.0))


def test_of_what_moved_when_it_was_noted_nothing_is_said_once_it_is_at_rest() -> None:
    """A ramp that is no likelier than a step any more is told as one; its notes are from before it had stopped."""
    core = settled()
    lane = int(core.call("t_ramp"))
    steps = plan_lanes(core.spec).n_lanes
    core.call("t_moves", np.array([float(lane)]), np.array([50.0]))
    core["clock.time"] = 1000.0
    core.call("t_ended", np.array([float(lane)]), np.array([1000.0]))
    for index in range(1000, 1000 + 2 * FROM + 1):
        core["clock.index"] = index
        core.call("t_slot", np.array([float(lane)]), np.array([0.02 * (index - 1000)]), np.array([4.0]))
        core.call("t_note")
    core.call("t_moves", np.array([float(lane)]), np.array([-1e300]))
    core.call("t_slot", np.array([float(lane)]), np.array([20.0]), np.array([4.0]))
    found = np.zeros(3)
    core.call("t_found", np.array([float(steps + lane)]), found)
    assert found[0] == pytest.approx(20.0)
    assert found[1] == pytest.approx(2.0 * wider(1000 + 2 * FROM))
    assert found[2] == 0.0


@pytest.mark.parametrize(("ended", "said"), [(2.0, True), (950.0, False)])
def test_what_came_to_stay_may_move_too(ended: float, said: bool) -> None:
    """Once it has stopped, for a note from before is of another value: a slow drift goes on in what came to stay."""
    core = settled()
    lane = int(core.call("t_ramp"))
    steps = plan_lanes(core.spec).n_lanes
    core.call("t_moves", np.array([float(lane)]), np.array([50.0]))
    core.call("t_ended", np.array([float(lane)]), np.array([ended]))
    for index in range(1000, 1000 + 2 * FROM + 1):
        core["clock.index"] = index
        core.call("t_slot", np.array([float(lane)]), np.array([20.0]), np.array([4.0]))
        core.call("t_note")
    core["clock.time"] = 1000.0
    core.call("t_slot", np.array([float(lane)]), np.array([26.0]), np.array([3.0]))
    found = np.zeros(3)
    core.call("t_found", np.array([float(steps + lane)]), found)
    assert found[2] == (pytest.approx(6.0) if said else 0.0)
    assert found[1] == pytest.approx(hypot(sqrt(3.0) * wider(1000 + 2 * FROM), 6.0 if said else 0.0))
