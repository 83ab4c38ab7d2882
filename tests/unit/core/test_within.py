"""What lies within the declared accuracy is no fault, and what lies beyond its range no answer."""

from dataclasses import replace
from math import exp, log, log1p, pi, sqrt
from typing import Any

import numpy as np
import pytest

from diagnosed import RESERVE, SPEC, Diagnosed, share_of, slot_of
from faultbond.contract.claims import CERTAINTY, claimed_parameter
from faultbond.contract.core_settings import core_settings
from faultbond.contract.couples import n_coupled, plan_couples
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import BIASES, INPUT_BIASES, plan_slots
from faultbond.contract.spec import EngineSpec, covariance_place
from faultbond.synthesis.compile import find_compiler
from faultbond.types import FaultKind

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
STEPS, SLOTS, WIDE = plan_lanes(SPEC), plan_slots(SPEC), SPEC.slotted
FIRST, SIZE = SPEC.parameter_slice.start, WIDE.slot_slice.start
MOVES_BY = core_settings()["MOVES_BY"]
SHARE = share_of(400)
NAMES = [item.name for item in SPEC.parameters]


def diagnosed(spec: object = SPEC) -> Diagnosed:
    """A state whose parameters are healthy before the fault, and far off in all lanes."""
    state = Diagnosed(spec) if spec is not SPEC else Diagnosed()  # type: ignore[arg-type]
    state.far_off()
    healthy = np.zeros(SPEC.n_numbers)
    healthy[SPEC.parameter_slice] = [item.healthy for item in SPEC.parameters]
    state["bank.healthy"] = healthy
    return state


def found_at(state: Diagnosed, lane: int, changes: dict[int, float], sd: float = 1e-4) -> None:
    """Let a lane of steps have found these changes of parameters, in factors, each with this sd of its filter."""
    numbers = state.lane("step", lane)
    for index, change in changes.items():
        numbers[FIRST + index] = SPEC.parameters[index].healthy + change
        numbers[covariance_place(SPEC, FIRST + index, FIRST + index)] = sd**2


def told(state: Diagnosed) -> tuple[float, dict[tuple[int, ...], float]]:
    """The probability of nothing at fault, and those of the sets beside it, instruments by negative numbers.

    Of the former each set has an even share: what lies within the accuracy tells none from another.
    """
    found = state.diagnose()
    rows = found["candidates"][: found["n_candidates"]]
    assert rows["probability"].sum() == pytest.approx(1.0)
    even = found["within_accuracy"] / len(rows) if found["within_accuracy"] > core_settings()["UNSAID"] else 0.0
    assert np.all(rows["probability"] >= even * (1.0 - 1e-12))
    sets = {}
    for row in rows:
        k = int(row["hypothesis"])
        instrument = (-1 - (k - len(SPEC.hypotheses)),) if len(SPEC.hypotheses) <= k < SPEC.n_begun else ()
        sets[instrument or tuple(SPEC.members(k))] = float(row["probability"] - even)
    return float(found["within_accuracy"]), sets


def part_within(index: int, change: float, sd: float = 1e-4, healthy_change: float = 0.0) -> float:
    """The part of a hypothesis that says no more than that a parameter is healthy, by its density."""
    item, variance = SPEC.parameters[index], sd**2 / SHARE

    def density(spread: float) -> float:
        square = spread**2 + variance
        return exp(-0.5 * change**2 / square) / sqrt(2.0 * pi * square)

    healthy, faulty = density(max(MOVES_BY * item.accuracy, healthy_change)), density(item.change)
    return healthy / (healthy + faulty)


@pytest.mark.parametrize("parts", [0.0, 0.3, 1.0, 1.5, 2.0, 4.0])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_change_within_the_accuracy_is_no_fault(parts: float, side: float) -> None:
    """The surest hypothesis loses its share to nothing at fault where its change is that of a healthy parameter."""
    state, index = diagnosed(), 1
    change = side * parts * SPEC.parameters[index].accuracy
    lane = int(np.flatnonzero(STEPS.hypothesis == index)[0])
    state.only(lane)
    found_at(state, lane, {index: change})
    within, sets = told(state)
    assert within == pytest.approx(part_within(index, change), rel=1e-6)
    assert sets[(index,)] == pytest.approx(1.0 - part_within(index, change), rel=1e-6)
    assert within + sum(sets.values()) == pytest.approx(1.0)
    assert (within > 0.9) == (parts <= 1.0)
    assert (within < 0.05) == (parts >= 2.0)


@pytest.mark.parametrize("index", [0, 1])
def test_what_is_said_to_be_claimed_is(index: int) -> None:
    """Of a change that `analyse` says is claimed the core leaves as much to nothing at fault as that allows."""
    state, item = diagnosed(), SPEC.parameters[index]
    lane = int(np.flatnonzero(STEPS.hypothesis == index)[0])
    state.only(lane)
    found_at(state, lane, {index: claimed_parameter(SPEC, index) / item.scale}, sd=1e-7)
    assert told(state)[0] == pytest.approx(1.0 - CERTAINTY, rel=1e-6)


def test_a_change_counts_from_before_the_fault_too() -> None:
    """A parameter that comes back to its nominal value has changed; what was accepted before is the new normal."""
    state, index = diagnosed(), 0
    accuracy, lane = SPEC.parameters[index].accuracy, int(np.flatnonzero(STEPS.hypothesis == index)[0])
    state.only(lane)
    found_at(state, lane, dict.fromkeys(range(len(SPEC.parameters)), 0.0))
    before = state["bank.healthy"].copy()
    before[FIRST + index] = 1.0 + 5.0 * accuracy
    state["clock.accepted"] = -1
    state["bank.healthy"] = before
    begun = float(state["clock.begun"][0])
    state["bank.onset"] = np.full_like(state["bank.onset"], begun + 2)
    assert told(state)[0] < 1e-6
    state["bank.onset"] = np.full_like(
        state["bank.onset"], begun + 1
    )  # from faulty samples the filter learned what it had before
    assert told(state)[0] == pytest.approx(part_within(index, 0.0), rel=1e-6)
    found_at(state, lane, {index: 5.2 * accuracy})
    assert told(state)[0] < 1e-6
    state["clock.accepted"] = 50
    assert told(state)[0] == pytest.approx(part_within(index, 0.2 * accuracy), rel=1e-6)


@pytest.mark.parametrize(("off", "healthy"), [(1.0, True), (9.0, False)])
def test_what_is_far_from_where_it_is_declared_is_at_fault_where_nothing_else_is(off: float, healthy: bool) -> None:
    """What was there from the first sample every lane learns in time; after a diagnosis was accepted it is normal."""
    state, suspect, other = diagnosed(), 0, 1
    lanes = [int(np.flatnonzero(STEPS.hypothesis == k)[0]) for k in (suspect, other)]
    accuracy = SPEC.parameters[other].accuracy
    state.only(lanes[0])
    found_at(state, lanes[0], dict.fromkeys(range(len(SPEC.parameters)), 0.0) | {other: off * accuracy})
    state["clock.accepted"] = -1
    state["bank.onset"] = np.full_like(state["bank.onset"], float(state["clock.begun"][0]) + 2)
    within, sets = told(state)
    assert (within > 0.9) == healthy
    assert (sets[other,] > 0.9) == (not healthy)
    state["clock.accepted"] = 50
    assert told(state)[0] > 0.9


def test_a_change_that_comes_and_goes_counts_from_before_it_too() -> None:
    """Its lanes have no onset of their own, so that it did not begin with the plant."""
    slot = slot_of(kind=FaultKind.INTERMITTENT, parameter=0)
    state = diagnosed()
    state.only(state.n_steps + slot)
    state["clock.accepted"], state["bank.onset"] = -1, 0
    state.lane("slot", slot)[FIRST] = SPEC.parameters[0].healthy
    before = state["bank.healthy"].copy()
    before[FIRST] = 1.0 + 5.0 * SPEC.parameters[0].accuracy
    state["bank.healthy"] = before
    assert told(state)[0] < 1e-6


def test_of_a_pair_the_part_within_the_accuracy_goes_to_the_other_alone() -> None:
    """A second suspect that hardly changed is none; where both hardly did, nothing is at fault."""
    k = len(SPEC.hypotheses) - 1
    one, two = SPEC.hypotheses[k]
    lane, state = int(np.flatnonzero(STEPS.hypothesis == k)[0]), diagnosed()
    state.only(lane)
    large, small = 0.5, 0.4 * SPEC.parameters[two].accuracy
    found_at(state, lane, {one: large, two: small})
    part = part_within(two, small)
    within, sets = told(state)
    assert part > 0.95
    assert sets[(one,)] == pytest.approx(part, rel=1e-6)
    assert sets[(one, two)] == pytest.approx(1.0 - part, rel=1e-6)
    assert within < 1e-9
    found_at(state, lane, {one: -small, two: small})
    assert told(state)[0] == pytest.approx(part * part_within(one, small), rel=1e-6)


@pytest.mark.parametrize("times", [0.4, 3.0])
def test_what_is_found_of_it_on_healthy_data_is_no_fault(times: float) -> None:
    """A second suspect must change by more than it seems to while healthy, if that is more than half its accuracy."""
    k = len(SPEC.hypotheses) - 1
    one, two = SPEC.hypotheses[k]
    moves = times * SPEC.parameters[two].accuracy
    moving = replace(SPEC.parameters[two], healthy_change=moves)
    state = diagnosed(replace(SPEC, parameters=(*SPEC.parameters[:two], moving, *SPEC.parameters[two + 1 :])))
    lane, change = int(np.flatnonzero(STEPS.hypothesis == k)[0]), 3.0 * SPEC.parameters[two].accuracy
    state.only(lane)
    found_at(state, lane, {one: 0.5, two: change})
    sets = told(state)[1]
    part = part_within(two, change, healthy_change=moves)
    assert sets[(one,)] == pytest.approx(part, rel=1e-6)
    assert sets[(one, two)] == pytest.approx(1.0 - part, rel=1e-6)
    assert (part > 0.5) == (times > 1.0)


def test_without_a_test_of_the_rest_a_set_keeps_its_share() -> None:
    """Where the set without the small change is not tested, nothing else can have it."""
    pairs = tuple(chosen for chosen in SPEC.hypotheses if len(chosen) == 2)
    spec = replace(SPEC, hypotheses=pairs, reserve=())
    state = diagnosed(spec)
    lane = int(np.flatnonzero(plan_lanes(spec).hypothesis == 0)[0])
    state.only(lane)
    one, two = pairs[0]
    found_at(state, lane, {one: 0.5, two: 0.0})
    found = state.diagnose()
    assert found["candidates"][0]["probability"] > 0.99
    assert found["within_accuracy"] < 1e-9


OFF = 0.02  # A and V, by which instruments are off on healthy data
BIASED = replace(
    SPEC,
    inputs=tuple(replace(item, healthy_bias=OFF) for item in SPEC.inputs),
    outputs=tuple(replace(item, healthy_bias=OFF) for item in SPEC.outputs),
)
MIXED = replace(BIASED, coupled=True, reserve=())
PEAK = 4.0  # V, the largest size of the input


def part_unbiased(bias: float, sd: float, faulty: float, healthy: float = OFF) -> float:
    """The part of a hypothesis that says no more than that an instrument is as on healthy data, by its density."""
    variance = sd**2 / SHARE

    def density(spread: float) -> float:
        square = spread**2 + variance
        return exp(-0.5 * bias**2 / square) / sqrt(2.0 * pi * square)

    return density(healthy) / (density(healthy) + density(faulty))


def seen_inputs(state: Diagnosed) -> Diagnosed:
    """A state whose input went up to its largest size."""
    state["inputs.lowest"], state["inputs.highest"] = -1.0, PEAK
    return state


def faulty_bias(is_output: bool) -> float:
    """The sd of what a sensor or an input is off by that is at fault, SI."""
    return BIASES[-1] * SPEC.outputs[0].noise if is_output else INPUT_BIASES[-1] * PEAK


def biased(spec: EngineSpec, bias: float, sd: float, is_output: bool) -> Diagnosed:
    """A state in which nothing is likely but that a sensor or an input is off, by so much give or take an sd, SI."""
    state = seen_inputs(diagnosed(spec))
    lane = slot_of(kind=FaultKind.BIAS, **({"output": 0} if is_output else {"input": 0}))
    unit = SPEC.outputs[0].noise if is_output else 1.0
    state.only(state.n_steps + lane)
    numbers = state.lane("slot", lane)
    numbers[SIZE], numbers[covariance_place(WIDE, SIZE, SIZE)] = bias / unit, (sd / unit) ** 2
    return state


@pytest.mark.parametrize("parts", [0.0, 1.0, 2.0, 4.0])
@pytest.mark.parametrize("is_output", [True, False])
def test_a_bias_as_on_healthy_data_is_no_fault(parts: float, is_output: bool) -> None:
    """A bias of what is seen of the instrument while healthy says that nothing is at fault; a larger one does not."""
    sd = 0.1 * OFF
    right = part_unbiased(parts * OFF, sd, faulty_bias(is_output))
    state = biased(BIASED, parts * OFF, sd, is_output)
    assert told(state)[0] == pytest.approx(right, rel=1e-6)
    assert (right > 0.5) == (parts <= 2.0)
    assert (right < 0.1) == (parts == 4.0)


@pytest.mark.parametrize("parts", [0.0, 2.0, 3.0, 6.0])
@pytest.mark.parametrize("is_output", [True, False])
def test_where_nothing_was_found_of_it_a_healthy_instrument_is_right(parts: float, is_output: bool) -> None:
    """A bias that may still be 0 by its standard deviation says that nothing is at fault, the surer it is the more."""
    faulty = faulty_bias(is_output)
    sd = 0.01 * faulty
    bias = parts * sd / sqrt(SHARE)
    right = part_unbiased(bias, sd, faulty, healthy=0.0)
    state = biased(SPEC, bias, sd, is_output)
    assert told(state)[0] == pytest.approx(right, rel=1e-6)
    assert (right > 0.5) == (parts <= 2.0)
    assert (right < 1e-3) == (parts == 6.0)


def test_a_bias_whose_square_is_no_number_is_a_fault() -> None:
    """As of a lane that has run away: probabilities stay numbers."""
    assert told(biased(SPEC, 1e200, 1e150, is_output=True))[0] < 1e-9


def test_of_an_input_that_was_always_nothing_no_bias_is_within() -> None:
    """Nobody knows how large its faults are."""
    state, lane = diagnosed(), slot_of(input=0, kind=FaultKind.BIAS)
    state["inputs.lowest"] = state["inputs.highest"] = 0.0
    state.only(state.n_steps + lane)
    assert told(state)[0] < 1e-9


def test_a_parameter_that_is_known_exactly_may_still_be_nominal() -> None:
    """A change of less than its own standard deviation says that nothing is at fault; one of many does not."""
    index, sd = 1, 0.01
    known = tuple(replace(item, accuracy=0.0) if k == index else item for k, item in enumerate(SPEC.parameters))
    for change, is_fault in ((0.5 * sd, False), (20.0 * sd, True)):
        state = diagnosed(replace(SPEC, parameters=known))
        lane = int(np.flatnonzero(STEPS.hypothesis == index)[0])
        state.only(lane)
        found_at(state, lane, {index: change}, sd)
        assert (told(state)[0] < 0.5) == is_fault


ZERO = 0.5  # V, of the unit of the input


@pytest.mark.parametrize("parts", [0.0, 1.0, 2.0, 4.0])
def test_a_gain_that_makes_no_more_than_a_healthy_bias_is_no_fault(parts: float) -> None:
    """Of an input, by what it makes of the largest value that was seen, in its own unit."""
    spec = replace(BIASED, inputs=tuple(replace(item, unit_offset=ZERO) for item in BIASED.inputs))
    state, lane = seen_inputs(diagnosed(spec)), slot_of(kind=FaultKind.GAIN, input=0)
    state.only(state.n_steps + lane)
    numbers, sd, largest = state.lane("slot", lane), 0.1 * OFF, PEAK - ZERO
    numbers[SIZE], numbers[covariance_place(WIDE, SIZE, SIZE)] = parts * OFF / largest, (sd / largest) ** 2
    right = part_unbiased(parts * OFF, sd, INPUT_BIASES[-1] * largest)
    assert told(state)[0] == pytest.approx(right, rel=1e-6)
    assert (right > 0.5) == (parts <= 2.0)


def test_what_is_stuck_scatters_or_has_a_wrong_gain_has_no_healthy_bias() -> None:
    """Where a sensor is stuck its value is no bias, whatever it is."""
    for kind in (FaultKind.STUCK, FaultKind.GAIN, FaultKind.NOISE):
        state, lane = diagnosed(BIASED), slot_of(output=0, kind=kind)
        state.only(state.n_steps + lane)
        assert told(state)[0] < 1e-9


@pytest.mark.parametrize("instruments", [1, 2])
def test_beside_another_fault_a_bias_as_on_healthy_data_is_left_out(instruments: int) -> None:
    """What a couple of a bias and a parameter, or of two biases, is worth goes to the other suspect alone."""
    state = seen_inputs(diagnosed(MIXED))
    couples = plan_couples(MIXED)
    first, other = len(SPEC.hypotheses), len(SPEC.hypotheses) + 1  # biases of the sensors
    number = next(
        k for k, item in enumerate(couples) if item.slot == first and item.beside == (other if instruments == 2 else -1)
    )
    couple, at = couples[number], 0 if instruments == 1 else n_coupled(MIXED)[0]
    coupled, base = state["bank.coupled"].copy(), state["bank.base"].copy()
    coupled[at], base[at] = number, slot_of(output=0, kind=FaultKind.BIAS)
    state["bank.coupled"], state["bank.base"] = coupled, base
    state.likelihoods(np.full(state.n_steps + state.n_slots, -1000.0))
    numbers, sd, noise = state.lane("slot", len(SLOTS.lanes) + at), 0.1 * OFF, SPEC.outputs[0].noise
    numbers[WIDE.n_numbers - 1] = 50.0
    numbers[SIZE], numbers[covariance_place(WIDE, SIZE, SIZE)] = 0.5 * OFF / noise, (sd / noise) ** 2
    if instruments == 1:
        numbers[FIRST + couple.parameter] = 1.5
    else:
        numbers[SIZE + 1] = 20.0 * OFF / SPEC.outputs[1].noise
    sets = told(state)[1]
    rest = (couple.parameter,) if instruments == 1 else (-2,)
    assert sets[rest] == pytest.approx(part_unbiased(0.5 * OFF, sd, BIASES[-1] * noise), rel=1e-3)


def test_a_set_of_the_reserve_loses_its_part_too() -> None:
    """It goes to the pair or single that is tested."""
    state, row = diagnosed(), next(k for k, chosen in enumerate(RESERVE) if len(chosen) == 2)
    one, two = RESERVE[row]
    grown = state["bank.grown"].copy()
    grown[0] = row
    state["bank.grown"] = grown
    lane = STEPS.n_lanes
    state.only(lane)
    found_at(state, lane, {one: 0.5, two: 0.1 * SPEC.parameters[two].accuracy})
    assert told(state)[1][(one,)] == pytest.approx(part_within(two, 0.1 * SPEC.parameters[two].accuracy), rel=1e-6)


def log_below(x: float) -> float:
    """Logarithm of the normal distribution function far below, where it has no digits left otherwise."""
    square = x * x
    return -0.5 * square - log(-x) - 0.5 * log(2.0 * pi) + log1p(-1.0 / square + 3.0 / square**2)


@pytest.mark.parametrize("off", [6.0, 12.0, 35.0])
def test_what_lies_beyond_its_range_is_no_answer(off: float) -> None:
    """Its likelihood counts by the part of what it says that lies within; a drift that runs on beyond its end alike."""
    kept, out = 0, 1
    reach = sqrt(1e-4 / SHARE + SPEC.parameters[out].accuracy ** 2)
    value = -off * reach
    single, drift = int(np.flatnonzero(STEPS.hypothesis == out)[0]), slot_of(hypothesis=out, kind=FaultKind.DRIFT)
    for lane, what, spec in ((single, "step", SPEC), (STEPS.n_lanes + 3 * len(RESERVE) + drift, "slot", WIDE)):
        state = diagnosed()
        number = lane if what == "step" else lane - state.n_steps
        values = np.full(state.n_steps + state.n_slots, -1e6)
        values[int(np.flatnonzero(STEPS.hypothesis == kept)[0])] = values[lane] = 50.0
        state.likelihoods(values)
        before = told(state)[1]
        numbers = state.lane(what, number)
        numbers[FIRST + out] = value if what == "step" else 1.0
        numbers[covariance_place(spec, FIRST + out, FIRST + out)] = 1e-4
        if what == "slot":
            numbers[SIZE] = value - 1.0
        after = told(state)[1]
        lost = log(after[(out,)] / after[(kept,)]) - log(before[(out,)] / before[(kept,)])
        assert lost == pytest.approx(log_below(-off), abs=0.03)
    state = diagnosed()  # a value at the end of its range is an answer
    state.only(single)
    found_at(state, single, {out: -0.98})
    assert told(state)[1][(out,)] > 0.99


TOGETHER = ((0, 1, 0.95), (0, 2, 0.9), (1, 2, 0.85))  # of the resistors
TIED = replace(SPEC, correlations=TOGETHER)


def beside_others(index: int, others: tuple[int, ...]) -> tuple[np.ndarray, float]:
    """What a parameter is beside those that are no suspects: weights of all of them, and its sd there."""
    prior = np.diag([item.accuracy for item in SPEC.parameters]) ** 2
    for one, two, value in TOGETHER:
        prior[one, two] = prior[two, one] = value * SPEC.parameters[one].accuracy * SPEC.parameters[two].accuracy
    rest = [k for k in range(len(prior)) if k not in (index, *others)]
    slopes = prior[index, rest] @ np.linalg.inv(prior[np.ix_(rest, rest)])
    weights = np.zeros(len(prior))
    weights[index], weights[rest] = 1.0, -slopes
    return weights, float(np.sqrt(prior[index, index] - slopes @ prior[rest, index]))


def part_beside(index: int, others: tuple[int, ...], changes: np.ndarray, covariance: np.ndarray) -> float:
    """The part of a hypothesis that says no more than that a parameter beside others is healthy."""
    weights, accuracy = beside_others(index, others)
    change, variance = float(weights @ changes), float(weights @ covariance @ weights) / SHARE

    def density(spread: float) -> float:
        square = spread**2 + variance
        return exp(-0.5 * change**2 / square) / sqrt(2.0 * pi * square)

    healthy, faulty = density(MOVES_BY * accuracy), density(SPEC.parameters[index].change)
    return healthy / (healthy + faulty)


def known_in_common(numbers: Any, layout: EngineSpec, changes: np.ndarray) -> np.ndarray:
    """Let a lane have found these changes, its parameters known to 3 % in common, and to a tenth of that beside it."""
    n = len(changes)
    covariance = 9e-4 * np.ones((n, n)) + 9e-6 * np.eye(n)
    for i in range(n):
        numbers[FIRST + i] = SPEC.parameters[i].healthy + changes[i]
        for j in range(i, n):
            numbers[covariance_place(layout, FIRST + i, FIRST + j)] = covariance[i, j]
    return covariance


@pytest.mark.parametrize("index", [0, 1, 2])
@pytest.mark.parametrize("off", [0.0, 0.03, 0.08])
def test_of_parameters_that_go_together_the_change_beside_the_others_counts(index: int, off: float) -> None:
    """A scale that is off in common is no change, and what is not known of it hides none; without ties it would."""
    state = diagnosed(TIED)
    lane = int(np.flatnonzero(STEPS.hypothesis == index)[0])
    state.only(lane)
    changes = np.array([0.04, 0.04, 0.04, 0.0])
    changes[index] += off
    covariance = known_in_common(state.lane("step", lane), SPEC, changes)
    right = part_beside(index, (), changes, covariance)
    assert told(state)[0] == pytest.approx(right, rel=1e-6)
    apart = diagnosed()
    apart.only(lane)
    known_in_common(apart.lane("step", lane), SPEC, changes)
    if off == 0.03:
        assert right < 0.5 < told(apart)[0]


def test_of_a_pair_each_counts_beside_what_is_no_suspect() -> None:
    """The other suspect of a pair tells nothing of it."""
    k = len(SPEC.hypotheses) - 1
    one, two = SPEC.hypotheses[k]
    lane, state = int(np.flatnonzero(STEPS.hypothesis == k)[0]), diagnosed(TIED)
    state.only(lane)
    changes = np.array([0.04, 0.04, 0.04, 0.0])
    changes[one] += 0.05
    covariance = known_in_common(state.lane("step", lane), SPEC, changes)
    parts = [part_beside(one, (two,), changes, covariance), part_beside(two, (one,), changes, covariance)]
    assert told(state)[0] == pytest.approx(parts[0] * parts[1], rel=1e-6)
    alone = part_beside(one, (), changes, covariance)
    assert alone * parts[1] != pytest.approx(parts[0] * parts[1], rel=1e-2)


def test_of_a_drift_what_it_added_counts_with_its_parameter() -> None:
    """Its value is that of the parameter and of the slot; what others let expect of it is taken off both."""
    index = 1
    slot = slot_of(kind=FaultKind.DRIFT, parameter=index)
    state = diagnosed(TIED)
    state.only(state.n_steps + slot)
    numbers = state.lane("slot", slot)
    changes = np.array([0.04, 0.03, 0.04, 0.0])
    covariance = known_in_common(numbers, WIDE, changes)
    numbers[SIZE], numbers[SIZE + 1] = 0.06, 1.0
    numbers[covariance_place(WIDE, SIZE, SIZE)] = 1e-4
    numbers[covariance_place(WIDE, FIRST + index, SIZE)] = -1e-5
    moved = changes.copy()
    moved[index] += 0.06
    with_slot = covariance.copy()
    with_slot[index, index] += 1e-4 - 2e-5
    assert told(state)[0] == pytest.approx(part_beside(index, (), moved, with_slot), rel=1e-6)
