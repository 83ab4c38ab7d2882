"""Accepting and rejecting in the core."""

from math import inf, nan

import numpy as np
import pytest

from cell_course import ACCEPTED, cell, course
from diagnosed import N_P, SPEC, Diagnosed
from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import SlotLane, plan_slots
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.runtime.monitor import Monitor
from faultbond.types import FaultKind

WIDE, SLOTS, STEPS = SPEC.slotted, plan_slots(SPEC).lanes, plan_lanes(SPEC)
LAST = 499  # number of the last sample
N_SETS, N_H = len(SPEC.hypotheses), SPEC.n_hypotheses
NO_ALARM, NO_SUCH_NUMBER, NOT_LISTED, REJECTED_ALREADY, LAST_ONE = range(-1, -6, -1)


@pytest.fixture
def state() -> Diagnosed:
    """A state with an alarm, in which all that a decision changes is something."""
    state = Diagnosed()
    generator = np.random.default_rng(4)
    for name in ("cusum", "cusum_start", "fast", "scatter", "scatter_start", "before", "spent"):
        state[f"sensors.{name}"] = generator.random(len(state[f"sensors.{name}"]))
    state["bank.sums"], state["bank.since"], state["bank.healthy"] = 1.0, 300.0, 2.0
    state["normal.gain"], state["normal.offset"], state["normal.noise"] = [1.1, 0.9], [0.2, -0.3], [1.0, 2.0]
    state["normal.rates"], state["inputs.held"] = 1e-5 * np.arange(N_P), 3.0
    return state


def any_lane(spec: EngineSpec, seed: int) -> FloatArray:
    """Any numbers of a lane, with a covariance."""
    generator = np.random.default_rng(seed)
    numbers, root = generator.normal(size=spec.n_numbers), generator.normal(size=(spec.n_joint, spec.n_joint))
    numbers[spec.covariance_slice] = pack(root @ root.T)
    return numbers


def slot_lane(state: Diagnosed, lane: int, size: float, rate: float) -> FloatArray:
    """Write any numbers to a lane with a slot, and let it explain the data."""
    numbers = any_lane(WIDE, lane)
    numbers[WIDE.slot_slice] = size, rate
    state.write("slot", lane, numbers)
    state.only(state.n_steps + lane)
    numbers[-1] = 50.0
    return numbers


def normal(state: Diagnosed) -> dict[str, list[float]]:
    """What is accepted as normal, apart from the lane, and what hangs together with it."""
    names = ("gain", "offset", "noise", "input_gain", "input_offset", "rates", "wander")
    return {name: list(state[f"normal.{name}"]) for name in names} | {
        name: list(state[name]) for name in ("inputs.held", "sensors.nis")
    }


def accepted(state: Diagnosed, hypothesis: int) -> FloatArray:
    """Accept; give the healthy lane. The alarms are on again, and nothing is left of the bank."""
    spent = state["sensors.spent"].copy()
    answer, candidate = state.decide("accept", hypothesis)
    assert (answer, candidate["hypothesis"]) == (0, hypothesis)
    assert (state["clock.alarm"], state["clock.accepted"], state["clock.index"]) == (-1, LAST, LAST + 1)
    for name in ("cusum", "fast", "scatter"):
        assert not state[f"sensors.{name}"].any()
    for name in ("cusum_start", "scatter_start"):
        assert (state[f"sensors.{name}"] == LAST).all()
    assert np.isnan(state["sensors.before"]).all()
    assert np.array_equal(state["sensors.spent"], spent)
    for name in ("sums", "since", "healthy", "rejected"):
        assert not state[f"bank.{name}"].any()
    assert (state["bank.grown"] == -1).all()
    assert not any(state.lane("step", k)[n] for k in range(state.n_steps) for n in (0, SPEC.n_numbers - 1))
    assert not any(state.lane("slot", k)[n] for k in range(state.n_slots) for n in (0, WIDE.n_numbers - 1))
    lane: FloatArray = state["healthy.lane"].copy()
    assert np.array_equal(state["normal.lane"], lane)
    row = state.lane("row", LAST)
    assert np.array_equal([row[k] for k in range(SPEC.n_numbers)], lane)
    return lane


def test_the_lane_of_a_step_becomes_the_healthy_one(state: Diagnosed) -> None:
    """An accepted set of parameters goes on as its likeliest lane; nothing is wrong with instruments."""
    hypothesis = N_SETS - 1
    lane = int(np.flatnonzero(STEPS.hypothesis == hypothesis)[3])
    numbers = any_lane(SPEC, 1)
    state.write("step", lane, numbers)
    state.only(lane)
    before = normal(state)
    assert np.array_equal(accepted(state, hypothesis), [*numbers[:-1], 50.0])
    assert normal(state) == before


@pytest.mark.parametrize("item", [lane for lane in SLOTS if lane.parameter in {0, N_P - 1}])
@pytest.mark.parametrize("rate", [90.0, 2e-4])
def test_a_parameter_becomes_what_it_and_the_slot_add_up_to(state: Diagnosed, item: SlotLane, rate: float) -> None:
    """Mean and covariance are those of the sum, none of it while the fault is gone; a drift that is one goes on."""
    numbers = slot_lane(state, SLOTS.index(item), 0.3, rate)
    kept = [k for k in range(WIDE.n_joint) if k not in range(WIDE.slot_slice.start, WIDE.slot_slice.stop)]
    take = np.eye(WIDE.n_joint)[kept]
    take[SPEC.parameter_slice.start + item.parameter, WIDE.slot_slice.start] = item.acts
    before = normal(state)
    lane = accepted(state, item.hypothesis)
    assert lane[: SPEC.n_joint] == pytest.approx(take @ numbers[: WIDE.n_joint])
    full = take @ unpack(WIDE, numbers[WIDE.covariance_slice]) @ take.T
    assert unpack(SPEC, lane[SPEC.covariance_slice]) == pytest.approx(full)
    assert len(SPEC.loops) == 1
    assert np.array_equal(lane[SPEC.loop_slice], numbers[WIDE.loop_slice])
    assert lane[-1] == 50.0
    if item.kind is FaultKind.DRIFT and rate > 1.0:
        before["rates"][item.parameter] += rate
        before["wander"][item.parameter] = 0.5 * before["rates"][item.parameter]
    assert normal(state) == before


@pytest.mark.parametrize("item", [lane for lane in SLOTS if lane.parameter < 0])
@pytest.mark.parametrize("rate", [90.0, 0.1])
def test_an_instrument_is_corrected(state: Diagnosed, item: SlotLane, rate: float) -> None:
    """A bias, a gain and a noise are known from then on; what cannot be corrected is done without; the plant stays."""
    numbers = slot_lane(state, SLOTS.index(item), 0.3, rate)
    after, j = normal(state), item.output
    lane = accepted(state, item.hypothesis)
    if item.input >= 0 and item.sticks:
        after["input_gain"][item.input] = 0.0
        after["input_offset"][item.input] = after["inputs.held"][item.input] = 0.3
    elif item.scales and item.input >= 0:
        zero = SPEC.inputs[item.input].unit_offset
        after["input_gain"][item.input] *= 1.3
        after["input_offset"][item.input] += 0.3 * (after["input_offset"][item.input] - zero)
        after["inputs.held"][item.input] += 0.3 * (after["inputs.held"][item.input] - zero)
    elif item.input >= 0 and item.acts:
        after["input_offset"][item.input] += 0.3
        after["inputs.held"][item.input] += 0.3
    elif item.scales and (item.kind is not FaultKind.DRIFT or rate < 1.0):
        after["offset"][j] -= after["gain"][j] * 0.3 * SPEC.outputs[j].unit_offset
        after["gain"][j] *= 1.3
    elif (
        item.acts
        and not item.scales
        and (item.kind in (FaultKind.BIAS, FaultKind.RAMP) or (item.kind is FaultKind.DRIFT and rate < 1.0))
    ):
        after["offset"][j] += after["gain"][j] * 0.3 * SPEC.outputs[j].noise
    elif item.acts and item.kind is FaultKind.NOISE:
        suspect = state.one.view(state.record["candidates"].base)[0]["suspects"][0]
        after["noise"][j], after["sensors.nis"][j] = (suspect["estimate"] / SPEC.outputs[j].noise) ** 2, 1.0
    elif item.acts and item.input < 0:
        after["noise"][j] = inf
    assert {name: pytest.approx(values) for name, values in after.items()} == normal(state)
    assert np.array_equal(lane[: SPEC.parameter_slice.stop], numbers[: SPEC.parameter_slice.stop])


def test_a_noise_that_is_accepted_does_not_count_as_blanked(state: Diagnosed) -> None:
    """However wild a sensor is, its variance stays below that of one that is blanked."""
    state["normal.noise"] = [1e12, 1.0]
    item = next(lane for lane in SLOTS if lane.kind is FaultKind.NOISE and lane.output == 0)
    slot_lane(state, SLOTS.index(item), 0.0, 0.0)
    accepted(state, item.hypothesis)
    assert state["normal.noise"][0] == 0.25 * SPEC.thresholds.blank_factor


@pytest.mark.parametrize("what", ["accept", "reject"])
def test_what_cannot_be_decided_changes_nothing(state: Diagnosed, what: str) -> None:
    """No alarm, no such number, a set without lanes: each has its own answer, and the state stays."""
    state.only(0)
    for hypothesis, answer in ((-1, NO_SUCH_NUMBER), (N_H, NO_SUCH_NUMBER), (N_H - 1, NOT_LISTED)):
        before = state.state.copy()
        assert state.decide(what, hypothesis)[0] == answer
        assert np.array_equal(before.view(np.int64), state.state.view(np.int64))
    state["clock.alarm"] = -1
    before = state.state.copy()
    assert state.decide(what, 0)[0] == NO_ALARM
    assert np.array_equal(before.view(np.int64), state.state.view(np.int64))


@pytest.mark.parametrize("what", ["step", "slot"])
def test_a_lane_that_ran_away_is_not_accepted(state: Diagnosed, what: str) -> None:
    """Where a number of a lane is none, or without end, it is not made the healthy filter, and the state stays."""
    lane, hypothesis = (3, SLOTS[3].hypothesis) if what == "slot" else (0, int(STEPS.hypothesis[0]))
    state.only(lane + state.n_steps * (what == "slot"))
    for value in (nan, -inf):
        state.lane(what, lane)[(WIDE if what == "slot" else SPEC).n_joint] = value
        before = state.state.copy()
        assert state.decide("accept", hypothesis)[0] == NOT_LISTED
        assert np.array_equal(before.view(np.int64), state.state.view(np.int64))


@pytest.mark.parametrize("what", ["step", "slot"])
def test_a_lane_whose_covariance_is_none_is_not_accepted(state: Diagnosed, what: str) -> None:
    """Where numbers of a lane go together more than exactly, but for rounding, it is not made the healthy filter."""
    bias = next(k for k, item in enumerate(SLOTS) if item.kind is FaultKind.BIAS and item.output >= 0)
    spec, place = (WIDE, bias) if what == "slot" else (SPEC, 0)
    hypothesis = SLOTS[bias].hypothesis if what == "slot" else int(STEPS.hypothesis[0])
    state.only(place + state.n_steps * (what == "slot"))
    full = np.diag(np.random.default_rng(2).uniform(1e-9, 1e9, spec.n_joint))
    for correlation, answer in ((-1.01, NOT_LISTED), (1.00001, NOT_LISTED), (1.0 + 1e-8, 0)):
        full[0, 1] = full[1, 0] = correlation * np.sqrt(full[0, 0] * full[1, 1])
        for k, number in enumerate(pack(full)):
            state.lane(what, place)[spec.n_joint + k] = number
        before = state.state.copy()
        assert state.decide("accept", hypothesis)[0] == answer
        assert np.array_equal(before.view(np.int64), state.state.view(np.int64)) == (answer != 0)


def test_with_a_set_all_fall_that_contain_it(state: Diagnosed) -> None:
    """What is rejected is out with all larger sets, in reserve and with instruments too; the others share."""
    state.far_off()
    state.only(0)
    state["bank.grown"][:2] = [0, 3]
    before = state.diagnose()["candidates"].copy()
    for hypothesis in (0, SPEC.n_begun - 1):
        assert state.decide("reject", hypothesis)[0] == 0
    last = SPEC.instruments[-1]
    out = [k for k in range(N_H) if 0 in SPEC.members(k) or last in SPEC.instruments_in(k)]
    assert SPEC.n_begun - 1 in out
    assert len(out) < N_H - SPEC.n_begun
    assert list(np.flatnonzero(state["bank.rejected"])) == out
    assert state.decide("reject", out[1])[0] == REJECTED_ALREADY
    found = state.diagnose()["candidates"]
    left = {int(row["hypothesis"]): row["probability"] for row in found if row["probability"] > 0.0}
    assert set(left) == {int(k) for k in before["hypothesis"][: SPEC.n_begun + 2]} - set(out)
    ratio = {int(row["hypothesis"]): row["probability"] for row in before}
    assert len({round(left[k] / ratio[k] * ratio[1] / left[1], 9) for k in left if ratio[k] > 0.0}) <= 1
    assert sum(left.values()) == pytest.approx(1.0)


def test_the_last_cannot_be_rejected(state: Diagnosed) -> None:
    """Where all that are left contain a set, it stays; a set of the reserve without lanes is none that is left."""
    state.only(0)
    for hypothesis in (*range(1, N_P), *range(N_SETS, SPEC.n_begun)):
        assert state.decide("reject", hypothesis)[0] == 0
    state["bank.rejected"][SPEC.n_begun :] = 0
    before = state.state.copy()
    assert state.decide("reject", 0)[0] == LAST_ONE
    assert np.array_equal(before.view(np.int64), state.state.view(np.int64))


def test_what_was_rejected_may_be_accepted(state: Diagnosed) -> None:
    """A person may change their mind: the likeliest lane is that without the rejection."""
    lane = int(np.flatnonzero(STEPS.hypothesis == 0)[2])
    state.lane("step", lane)[0] = 0.7
    state.only(lane)
    assert state.decide("reject", 0)[0] == 0
    assert accepted(state, 0)[0] == 0.7


def test_slow_errors_begin_anew_where_the_fault_was_repaired() -> None:
    """What they have learned they made up for a fault that is gone: only their declared size is left."""
    spec, monitor = cell().spec, Monitor(cell(), course().saved[ACCEPTED - 1])
    slow = spec.slow_slice
    assert monitor.numbers("healthy.lane")[slow] != 0.0
    monitor.accept(monitor.conclude().candidates[0].hypothesis, repaired=True)
    lane = monitor.numbers("healthy.lane")
    expected = np.zeros(spec.n_joint)
    expected[slow] = spec.slow_sizes**2
    assert lane[slow] == 0.0
    assert unpack(spec, lane[spec.covariance_slice])[slow.start] == pytest.approx(expected)
