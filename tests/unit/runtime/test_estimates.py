"""What a lane has found: values, spreads, rates and forecasts in SI, for every kind of fault."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Suspect
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, covariance_place, pack, unpack
from faultbond.runtime.estimates import Absorbed, nothing_absorbed, slot_suspects, step_suspects
from faultbond.runtime.forecast import forecast
from faultbond.types import FaultKind
from made import plant

PLAIN = plant("dc_motor_current")[1]
SPEC = replace(PLAIN, parameters=(replace(PLAIN.parameters[0], limits=(6.0, 1.0)), *PLAIN.parameters[1:]))
PLAN, WIDE = plan_slots(SPEC), SPEC.slotted
SIZE, RATE = WIDE.slot_slice.start, WIDE.slot_slice.start + 1


def lanes_of(spec: EngineSpec, n_lanes: int) -> FloatArray:
    """Lanes of random positive numbers with full covariances, no two alike."""
    generator = np.random.default_rng(7)
    lanes = generator.uniform(0.5, 2.0, (spec.n_numbers, n_lanes))
    for lane in lanes.T:
        root = 0.1 * generator.normal(size=(spec.n_joint, spec.n_joint))
        lane[spec.covariance_slice] = pack(root @ root.T + 1e-3 * np.eye(spec.n_joint))
    return lanes


SLOTS = lanes_of(WIDE, PLAN.n_lanes)


def found(lane: int, slots: FloatArray = SLOTS) -> tuple[Suspect, bool]:
    """The one suspect of a lane, and whether its fault is there."""
    suspects, present = slot_suspects(SPEC, slots, lane, 40.0, nothing_absorbed(SPEC))
    assert len(suspects) == 1
    return suspects[0], present


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
    """The suspects of a lane of steps are its parameters with their sd, in SI."""
    lane = lanes_of(SPEC, 1)[:, 0]
    full = unpack(SPEC, lane[SPEC.covariance_slice])
    for suspect, index in zip(step_suspects(SPEC, lane, (3, 0)), (3, 0), strict=True):
        item, k = SPEC.parameters[index], SPEC.parameter_slice.start + index
        assert (suspect.parameter, suspect.component, suspect.nominal) == (item.name, item.component, item.nominal)
        assert suspect.estimate == pytest.approx(item.scale * lane[k])
        assert suspect.sd == pytest.approx(item.scale * np.sqrt(full[k, k]))
        assert (suspect.rate, suspect.rate_sd, suspect.forecasts) == (None, None, ())


def in_numbers(lane: int) -> tuple[FloatArray, FloatArray]:
    """Value and rate of a lane's parameter, and their covariance, from a linear map of z, SI."""
    item = SPEC.parameters[PLAN.lanes[lane].parameter]
    z, full = SLOTS[: WIDE.n_joint, lane], unpack(WIDE, SLOTS[WIDE.covariance_slice, lane])
    rows = np.zeros((2, WIDE.n_joint))
    rows[0, WIDE.parameter_slice.start + PLAN.lanes[lane].parameter] = rows[0, SIZE] = rows[1, RATE] = item.scale
    return rows @ z, rows @ full @ rows.T


def test_a_drift_is_the_healthy_value_and_what_moves() -> None:
    """The value of a drift is the healthy one plus the size, its sd that of the sum; the rate is per second."""
    for lane in lanes_with(FaultKind.DRIFT):
        if PLAN.lanes[lane].parameter < 0:
            continue
        suspect, present = found(lane)
        value, covariance = in_numbers(lane)
        assert present
        assert suspect.parameter == SPEC.parameters[PLAN.lanes[lane].parameter].name
        assert [suspect.estimate, suspect.rate] == pytest.approx(value)
        assert [suspect.sd, suspect.rate_sd] == pytest.approx(np.sqrt(np.diag(covariance)))


def test_a_drift_has_a_forecast_for_each_limit() -> None:
    """Each limit of the model file has the forecast of value and rate of now, with their covariance."""
    for lane in lanes_with(FaultKind.DRIFT):
        index = PLAN.lanes[lane].parameter
        suspect, _ = found(lane)
        wanted = []
        for limit in SPEC.parameters[index].limits if index >= 0 else ():
            (value, rate), covariance = in_numbers(lane)
            spread = (covariance[0, 0], covariance[0, 1], covariance[1, 1])
            healthy = SPEC.parameters[index].nominal
            wanted.append(forecast(40.0, limit, float(value), float(rate), spread, healthy))
        assert len(suspect.forecasts) == len(wanted) == 2 * (index == 0)
        for one, two in zip(suspect.forecasts, wanted, strict=True):
            assert one.limit == two.limit
            for a, b in ((one.time, two.time), (one.earliest, two.earliest), (one.latest, two.latest)):
                assert a == (b if b is None else pytest.approx(b, rel=1e-6))


def test_a_drift_comes_on_top_of_one_that_was_accepted() -> None:
    """The rate is that of the parameter, whatever part of it was known before; so forecasts are of where it goes."""
    lane = next(k for k in lanes_with(FaultKind.DRIFT) if PLAN.lanes[k].parameter == 0)
    (value, rate), covariance = in_numbers(lane)
    rates = np.where(np.arange(len(SPEC.parameters)) == 0, 0.25, 9.0)
    absorbed = Absorbed(rates=rates, noise=np.ones(len(SPEC.outputs)))
    (suspect,), _ = slot_suspects(SPEC, SLOTS, lane, 40.0, absorbed)
    whole = float(rate) + 0.25 * SPEC.parameters[0].scale
    assert suspect.rate == pytest.approx(whole)
    spread = (covariance[0, 0], covariance[0, 1], covariance[1, 1])
    expected = forecast(40.0, 6.0, float(value), whole, spread, SPEC.parameters[0].nominal)
    assert suspect.forecasts[0].time == (None if expected.time is None else pytest.approx(expected.time, rel=1e-6))


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
    assert sorted(words) == ["V.bias"] * 4 + ["i.bias"] * 4 + ["i.stuck"] * 2 + ["omega.bias"] * 4 + ["omega.stuck"] * 2


@pytest.mark.parametrize(
    ("kind", "word", "nominal"),
    [
        (FaultKind.BIAS, "bias", 0.0),
        (FaultKind.DRIFT, "bias", 0.0),
        (FaultKind.STUCK, "stuck", None),
        (FaultKind.GAIN, "gain", 1.0),
    ],
)
def test_faults_of_a_sensor(kind: FaultKind, word: str, nominal: float | None) -> None:
    """A bias, a drift and a value to which a sensor is stuck are in SI, a gain is relative to 1."""
    chosen = [k for k in lanes_with(kind) if PLAN.lanes[k].output >= 0]
    assert {PLAN.lanes[k].output for k in chosen} == {0, 1}
    for lane in chosen:
        output = SPEC.outputs[PLAN.lanes[lane].output]
        suspect, present = found(lane)
        unit, offset = (1.0, 1.0) if kind is FaultKind.GAIN else (output.noise, 0.0)
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
    for lane in [k for k in lanes_with(FaultKind.BIAS) if PLAN.lanes[k].input >= 0]:
        suspect, _ = found(lane)
        assert (suspect.parameter, suspect.component, suspect.nominal) == ("V.bias", "V", 0.0)
        assert suspect.estimate == pytest.approx(SLOTS[SIZE, lane])
        assert suspect.sd == pytest.approx(np.sqrt(SLOTS[covariance_place(WIDE, SIZE, SIZE), lane]))


@pytest.mark.parametrize("ratio", [1.6, 4.0, 6.5**2, 14.0**2, 1000.0, 2500.0])
def test_noise_is_found_between_those_tried(ratio: float) -> None:
    """From lanes as likely as n readings make them, the very noise and its spread are told, wherever it lies."""
    count = 400.0
    for output, item in enumerate(SPEC.outputs):
        own = [k for k in lanes_with(FaultKind.NOISE) if PLAN.lanes[k].output == output]
        tried = np.array([PLAN.lanes[k].noise for k in own])
        slots = SLOTS.copy()
        slots[-1, own] = -0.5 * count * (np.log(tried) + ratio / tried)
        suspect, _ = found(own[int(np.argmax(slots[-1, own]))], slots)
        assert (suspect.parameter, suspect.nominal) == (f"{item.name}.noise", item.noise)
        assert suspect.estimate == pytest.approx(item.noise * np.sqrt(ratio), rel=1e-6)
        assert suspect.sd == pytest.approx(suspect.estimate / np.sqrt(2.0 * count), rel=1e-6)


def test_noise_of_lanes_that_say_nothing_yet() -> None:
    """Lanes that are alike, or no numbers, give the best one's noise, no finer than the noises tried lie."""
    own = [k for k in lanes_with(FaultKind.NOISE) if PLAN.lanes[k].output == 0]
    for likelihoods in (np.zeros(len(own)), np.full(len(own), np.nan), np.linspace(0.0, 5.0, len(own))):
        slots = SLOTS.copy()
        slots[-1, own] = likelihoods
        suspect, _ = found(own[0], slots)
        assert suspect.sd == pytest.approx(suspect.estimate / 3.0)
        assert suspect.estimate >= 2.0 * SPEC.outputs[0].noise


def test_a_value_stays_in_its_range() -> None:
    """A slot that leads a parameter beyond its range is told as the end of the range, where the filter keeps it."""
    _, spec, _ = plant("dc_motor")
    plan, wide = plan_slots(spec), spec.slotted
    lane = next(k for k, item in enumerate(plan.lanes) if item.kind is FaultKind.DRIFT)
    index = plan.lanes[lane].parameter
    slots = np.zeros((wide.n_numbers, plan.n_lanes))
    slots[wide.parameter_slice.start + index] = 1.0
    for size, expected in ((-5.0, spec.parameters[index].lower), (1e3, spec.parameters[index].upper)):
        slots[wide.slot_slice.start] = size
        (suspect,), _ = slot_suspects(spec, slots, lane, 0.0, nothing_absorbed(spec))
        assert suspect.estimate == pytest.approx(spec.parameters[index].scale * expected)
