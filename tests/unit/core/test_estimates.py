"""What a lane has found, with its names: values, spreads and rates in SI, for every kind of fault."""

from functools import cache

import numpy as np
import pytest

from diagnosed import SPEC, Diagnosed
from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Suspect
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, covariance_place, pack, unpack
from faultbond.runtime.candidates import diagnosis_of
from faultbond.types import FaultKind

PLAN, WIDE = plan_slots(SPEC), SPEC.slotted
SIZE, RATE = WIDE.slot_slice.start, WIDE.slot_slice.start + 1
N_SETS = len(SPEC.hypotheses)


def lanes_of(spec: EngineSpec, n_lanes: int) -> FloatArray:
    """Lanes of random positive numbers with full covariances, no two alike."""
    generator = np.random.default_rng(7)
    lanes = generator.uniform(0.5, 2.0, (spec.n_numbers, n_lanes))
    for lane in lanes.T:
        root = 0.1 * generator.normal(size=(spec.n_joint, spec.n_joint))
        lane[spec.covariance_slice] = pack(root @ root.T + 1e-3 * np.eye(spec.n_joint))
    return lanes


SLOTS = lanes_of(WIDE, PLAN.n_lanes)
SLOTS[RATE] = 3.0 * np.sqrt(SLOTS[covariance_place(WIDE, RATE, RATE)])  # of what is less sure no rate is told


@cache
def state() -> Diagnosed:
    """A state whose lanes with a slot are these, at its alarm: likelihoods still count whole."""
    state = Diagnosed()
    state["clock.index"] = state["clock.alarm"]
    for lane in range(PLAN.n_lanes):
        state.write("slot", lane, SLOTS[:, lane])
    return state


def best() -> Candidate:
    """The best candidate."""
    return diagnosis_of(SPEC, state().diagnose()).candidates[0]


def found(lane: int) -> tuple[Suspect, bool]:
    """The one suspect of a lane with a slot, and whether its fault is there."""
    state().only(state().n_steps + lane)
    candidate = best()
    (suspect,) = candidate.suspects
    assert candidate.lane == state().n_steps + lane
    return suspect, candidate.present


def lanes_with(kind: FaultKind) -> list[int]:
    """Lanes of a kind."""
    return [k for k, item in enumerate(PLAN.lanes) if item.kind is kind]


def test_covariance_place_is_that_of_the_matrix() -> None:
    """The place of a covariance in a lane is where the packed triangle holds it."""
    full = unpack(WIDE, SLOTS[WIDE.covariance_slice, 3])
    for i in range(WIDE.n_joint):
        for j in range(i, WIDE.n_joint):
            assert SLOTS[covariance_place(WIDE, i, j), 3] == full[i, j]


def test_a_step_is_the_parameter_itself() -> None:
    """The suspects of a lane of steps are its parameters, in the order of the set, with their sd, in SI."""
    chosen, (lane,) = SPEC.hypotheses[N_SETS - 1], lanes_of(SPEC, 1).T
    assert len(chosen) == 2
    full, number = unpack(SPEC, lane[SPEC.covariance_slice]), state().n_steps - 3 * len(SPEC.reserve) - 1
    state().write("step", number, lane)
    state().only(number)
    candidate = best()
    assert (candidate.hypothesis, candidate.lane, candidate.present) == (N_SETS - 1, number, True)
    for suspect, index in zip(candidate.suspects, chosen, strict=True):
        item, k = SPEC.parameters[index], SPEC.parameter_slice.start + index
        assert (suspect.parameter, suspect.component, suspect.nominal) == (item.name, item.component, item.nominal)
        assert suspect.estimate == pytest.approx(item.scale * lane[k])
        assert suspect.sd == pytest.approx(abs(item.scale) * np.sqrt(full[k, k]))
        assert (suspect.rate, suspect.rate_sd, suspect.forecasts) == (None, None, ())


def in_numbers(lane: int) -> tuple[FloatArray, FloatArray]:
    """Value and rate of a lane's parameter, and their covariance, from a linear map of z, SI."""
    item = SPEC.parameters[PLAN.lanes[lane].parameter]
    z, full = SLOTS[: WIDE.n_joint, lane], unpack(WIDE, SLOTS[WIDE.covariance_slice, lane])
    rows = np.zeros((2, WIDE.n_joint))
    rows[0, WIDE.parameter_slice.start + PLAN.lanes[lane].parameter] = rows[0, SIZE] = rows[1, RATE] = 1.0
    value, rate = rows @ z
    assert item.lower < value < item.upper
    return item.scale * np.array([value, rate]), item.scale**2 * rows @ full @ rows.T


def test_a_drift_is_the_healthy_value_and_what_moves() -> None:
    """The value of a drift is the healthy one plus the size, its sd that of the sum; the rate is per second."""
    chosen = [k for k in lanes_with(FaultKind.DRIFT) if PLAN.lanes[k].parameter >= 0]
    assert {PLAN.lanes[k].parameter for k in chosen} == set(range(len(SPEC.parameters)))
    for lane in chosen:
        suspect, present = found(lane)
        item = SPEC.parameters[PLAN.lanes[lane].parameter]
        value, covariance = in_numbers(lane)
        assert present
        assert (suspect.parameter, suspect.component, suspect.nominal) == (item.name, item.component, item.nominal)
        assert [suspect.estimate, suspect.rate] == pytest.approx(value)
        assert [suspect.sd, suspect.rate_sd] == pytest.approx(np.sqrt(np.diag(covariance)))
        assert tuple(limit.limit for limit in suspect.forecasts) == item.limits


def test_a_fault_that_comes_and_goes_is_told_as_the_lane_remembers_it() -> None:
    """Gone or there, the value is what the healthy one and the size of the same lane add up to."""
    for lane in lanes_with(FaultKind.INTERMITTENT):
        if PLAN.lanes[lane].parameter < 0:
            continue
        suspect, present = found(lane)
        value, covariance = in_numbers(lane)
        assert present is PLAN.lanes[lane].acts
        assert suspect.estimate == pytest.approx(value[0])
        assert suspect.sd == pytest.approx(np.sqrt(covariance[0, 0]))
        assert (suspect.rate, suspect.forecasts) == (None, ())


def test_an_instrument_that_errs_at_times() -> None:
    """A sensor's bias or the value at which it sticks, an input's bias, as the lane remembers it, there or gone."""
    words = []
    for lane in lanes_with(FaultKind.INTERMITTENT):
        item = PLAN.lanes[lane]
        if item.parameter >= 0:
            continue
        unit = SPEC.outputs[item.output].noise if item.output >= 0 else 1.0
        name = SPEC.outputs[item.output].name if item.output >= 0 else SPEC.inputs[item.input].name
        suspect, present = found(lane)
        assert present is item.acts
        assert suspect.parameter == f"{name}.{'stuck' if item.sticks else 'bias'}"
        assert suspect.nominal == (None if item.sticks else 0.0)
        assert suspect.estimate == pytest.approx(unit * SLOTS[SIZE, lane])
        spread = unpack(WIDE, SLOTS[WIDE.covariance_slice, lane])[SIZE, SIZE]
        assert suspect.sd == pytest.approx(unit * np.sqrt(spread))
        words.append(suspect.parameter)
    assert sorted(words) == ["V.bias"] * 4 + ["i.bias"] * 4 + ["i.stuck"] * 2 + ["v.bias"] * 4 + ["v.stuck"] * 2


@pytest.mark.parametrize(
    ("kind", "word", "nominal"),
    [
        (FaultKind.BIAS, "bias", 0.0),
        (FaultKind.DRIFT, "bias", 0.0),
        (FaultKind.DRIFT, "gain", 1.0),
        (FaultKind.STUCK, "stuck", None),
        (FaultKind.GAIN, "gain", 1.0),
    ],
)
def test_faults_of_a_sensor(kind: FaultKind, word: str, nominal: float | None) -> None:
    """A bias, also one that drifts, and a value to which a sensor is stuck are in SI, a gain is relative to 1."""
    scales = word == "gain"
    chosen = [k for k in lanes_with(kind) if PLAN.lanes[k].output >= 0 and PLAN.lanes[k].scales == scales]
    assert {PLAN.lanes[k].output for k in chosen} == {0, 1}
    for lane in chosen:
        output = SPEC.outputs[PLAN.lanes[lane].output]
        suspect, present = found(lane)
        unit, offset = (1.0, 1.0) if scales else (output.noise, 0.0)
        full = unpack(WIDE, SLOTS[WIDE.covariance_slice, lane])
        assert present
        assert (suspect.parameter, suspect.component, suspect.nominal) == (
            f"{output.name}.{word}",
            output.name,
            nominal,
        )
        assert suspect.estimate == pytest.approx(offset + unit * SLOTS[SIZE, lane])
        assert suspect.sd == pytest.approx(unit * np.sqrt(full[SIZE, SIZE]))
        if kind is FaultKind.DRIFT:
            assert suspect.rate == pytest.approx(unit * SLOTS[RATE, lane])
            assert suspect.rate_sd == pytest.approx(unit * np.sqrt(full[RATE, RATE]))
        else:
            assert (suspect.rate, suspect.rate_sd) == (None, None)


def test_a_fault_of_an_input_is_in_si() -> None:
    """The bias of an input is what acts on the plant beyond what is recorded."""
    chosen = [k for k in lanes_with(FaultKind.BIAS) if PLAN.lanes[k].input >= 0]
    assert chosen
    for lane in chosen:
        suspect, _ = found(lane)
        assert (suspect.parameter, suspect.component, suspect.nominal) == ("V.bias", "V", 0.0)
        assert suspect.estimate == pytest.approx(SLOTS[SIZE, lane])
        assert suspect.sd == pytest.approx(np.sqrt(SLOTS[covariance_place(WIDE, SIZE, SIZE), lane]))


def scattering(output: int, likelihoods: FloatArray) -> Suspect:
    """The noise of a sensor whose lanes are as likely as this, while nothing else is likely."""
    own = [k for k in lanes_with(FaultKind.NOISE) if PLAN.lanes[k].output == output]
    state().only(state().n_steps + own[0])
    for lane, likelihood in zip(own, likelihoods, strict=True):
        state().lane("slot", lane)[WIDE.n_numbers - 1] = float(likelihood)
    (suspect,) = best().suspects
    return suspect


@pytest.mark.parametrize("ratio", [1.6, 4.0, 6.5**2, 14.0**2, 1000.0, 2500.0])
def test_noise_is_found_between_those_tried(ratio: float) -> None:
    """From lanes as likely as n readings make them, the very noise and its spread are told, wherever it lies."""
    count = 400.0
    for output, item in enumerate(SPEC.outputs):
        tried = np.array([lane.noise for lane in PLAN.lanes if lane.output == output and lane.kind is FaultKind.NOISE])
        fit = -0.5 * count * (np.log(tried) + ratio / tried)
        suspect = scattering(output, fit - fit.max() + 50.0)
        assert (suspect.parameter, suspect.nominal) == (f"{item.name}.noise", item.noise)
        assert suspect.estimate == pytest.approx(item.noise * np.sqrt(ratio), rel=1e-6)
        assert suspect.sd == pytest.approx(suspect.estimate / np.sqrt(2.0 * count), rel=1e-6)


def test_noise_of_lanes_that_say_nothing_yet() -> None:
    """Lanes that are alike give the best one's noise, no finer than the noises tried lie."""
    count = sum(lane.output == 0 for lane in PLAN.lanes if lane.kind is FaultKind.NOISE)
    for likelihoods in (np.zeros(count), np.linspace(0.0, 5.0, count)):
        suspect = scattering(0, likelihoods + 50.0)
        assert suspect.sd == pytest.approx(suspect.estimate / 3.0)
        assert suspect.estimate >= 2.0 * SPEC.outputs[0].noise


def test_noise_of_a_sensor_that_is_out_of_use() -> None:
    """What is not read has no noise of its own: the declared one is told, by the factor of the best lane."""
    count = sum(lane.output == 0 for lane in PLAN.lanes if lane.kind is FaultKind.NOISE)
    used, state()["normal.noise"][0] = scattering(0, np.full(count, 50.0)), np.inf
    unused = scattering(0, np.full(count, 50.0))
    state()["normal.noise"][0] = 1.0
    assert (unused.estimate, unused.sd) == (used.estimate, used.sd)


def test_noise_of_which_too_little_is_known() -> None:
    """Where fewer than three of the noises tried have a likelihood, the smallest is told, as coarse as these lie."""
    tried = [lane.noise for lane in PLAN.lanes if lane.output == 0 and lane.kind is FaultKind.NOISE]
    fit = np.full(len(tried), np.nan)
    fit[0], fit[-1] = 45.0, 50.0
    suspect, least = scattering(0, fit), SPEC.outputs[0].noise * np.sqrt(tried[0])
    assert (suspect.estimate, suspect.sd) == pytest.approx((least, least / 3.0))


@pytest.mark.parametrize("size", [-5.0, 1e3])
def test_a_value_stays_in_its_range(size: float) -> None:
    """A slot that leads a parameter beyond its range is told as the end of the range, where the filter keeps it."""
    lane = next(k for k in lanes_with(FaultKind.DRIFT) if PLAN.lanes[k].parameter == 1)
    item, slot = SPEC.parameters[1], state().lane("slot", lane)
    slot[SIZE] = size
    suspect, _ = found(lane)
    slot[SIZE] = float(SLOTS[SIZE, lane])
    assert suspect.estimate == pytest.approx(item.scale * (item.lower if size < 0.0 else item.upper))


@pytest.mark.parametrize("behind", [0.5, 2.0, 4.5])
def test_a_value_is_as_uncertain_as_its_kinds_leave_it(behind: float) -> None:
    """The mean square about what is told, over the kinds that give it a value with 5 % and more; stuck is no bias."""
    lanes = [
        next(k for k in lanes_with(kind) if PLAN.lanes[k].output >= 0 and PLAN.lanes[k].hypothesis == N_SETS)
        for kind in (FaultKind.BIAS, FaultKind.DRIFT, FaultKind.STUCK)
    ]
    alone = [found(lane)[0] for lane in lanes]
    values = np.full(state().n_steps + state().n_slots, -1000.0)
    for lane, below in zip(lanes, (0.0, behind, 1.0), strict=True):
        values[state().n_steps + lane] = 50.0 - below - PLAN.lanes[lane].weight
    state().likelihoods(values)
    candidate = best()
    shares, (told,) = dict(candidate.kinds), candidate.suspects
    assert (candidate.kind, told.estimate) == (FaultKind.BIAS, alone[0].estimate)
    both = [(shares[kind], item) for kind, item in zip((FaultKind.BIAS, FaultKind.DRIFT), alone, strict=False)]
    both = [(share, item) for share, item in both if share >= 0.05]
    assert len(both) == (1 if behind > 4.0 else 2)
    square = sum(share * (item.sd**2 + (item.estimate - told.estimate) ** 2) for share, item in both)
    assert told.sd == pytest.approx(np.sqrt(square / sum(share for share, _ in both)), rel=1e-9)
