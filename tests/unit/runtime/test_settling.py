"""An input that settles or lags: a component is not taken for it where the meter lags, nor a slow actuator for that."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.samples import Sample
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io import parse_fault
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Inputs, fault_in_si, random_steps, simulate
from faultbond.synthesis.engine import build_core
from faultbond.synthesis.specify import build_spec
from faultbond.types import FaultKind
from made import in_full, run, samples_of
from plants import pumped_tank

LESS, ONSET = 0.84, 600
START = {"h": 1.0}


def pumped(*, speed: str = "", meter: str = "") -> BondGraph:
    """A tank that a pump fills; the meter of its flow is late, or its speed."""
    return parse_model(pumped_tank(speed=speed, meter=meter))


@cache
def watching(late: str) -> Core:
    """The core of the model that knows only of an input that is late."""
    built = build_plant(pumped(speed=late))
    with in_full():
        return build_core(built, build_spec(build_step_model(built)))


def recording(graph: BondGraph, what: str, seed: int, rows: int, moment: float = ONSET) -> tuple[Sample, ...]:
    """Samples of a plant with a fault, or several, from one moment on."""
    time = np.arange(float(rows))
    steps = random_steps(time, np.random.default_rng(seed), low=40.0, high=80.0, shortest=60.0, longest=200.0)
    faults = [fault_in_si(parse_fault(f"{each}@{moment}"), graph) for each in what.split()]
    made = simulate(graph, Inputs(time=time, values=steps[:, None]), faults, seed=seed, start=START)
    return samples_of(time, made.inputs, made.outputs)


@pytest.mark.parametrize("seed", range(3))
def test_a_pump_is_not_taken_for_its_speed(seed: int) -> None:
    """What the pump gives may come up within the time its speed settles, as a gain of that may."""
    reports = run(watching(", settling: 10 s"), recording(pumped(meter=", lag: 1.5 s"), f"K=x{LESS}", seed, 1200))[1]
    alarm = next(item.detection for item in reports if item.detection)
    assert alarm.sample >= ONSET
    last = next(item.diagnosis for item in reversed(reports) if item.diagnosis)
    best, (suspect,) = last.candidates[0], last.candidates[0].suspects
    assert (suspect.parameter, best.kind) == ("K", FaultKind.STEP)
    assert suspect.estimate == pytest.approx(LESS * (suspect.nominal or 0.0), rel=0.05)


@pytest.mark.parametrize(("seed", "seconds"), [(3, 8.0), (0, 15.0), (3, 15.0), (1, 30.0)])
def test_a_speed_that_has_become_slow_is_no_scatter_of_the_meter(seed: int, seconds: float) -> None:
    """The meter is off for a while after each move and right between; that contradicts scatter from then on."""
    reports = run(watching(", settling: 10 s"), recording(pumped(speed=", lag: 1 s"), f"u_lag={seconds}", seed, 2400))[
        1
    ]
    found = [item.diagnosis for item in reports if item.diagnosis]
    assert found[-1].unexplained is not None


@pytest.mark.parametrize(
    ("lags", "what", "moment"),
    [("meter", f"K=x{LESS}", ONSET), ("meter", f"K=x{LESS}", ONSET + 0.4), ("speed", f"u.gain={LESS}", ONSET)],
)
@pytest.mark.parametrize("seed", range(2))
def test_which_of_two_lags_nobody_can_tell(lags: str, what: str, moment: float, seed: int) -> None:
    """A model that lays the lag of the meter to the speed names neither the pump nor the gain of the speed alone.

    Neither does it where it is right. Both make the same of the flow at all times, so neither can be sure; where in its
    sample the fault came makes no difference.
    """
    plant = pumped(meter=", lag: 1.5 s") if lags == "meter" else pumped(speed=", lag: 1.5 s")
    reports = run(watching(", lag: 1.5 s"), recording(plant, what, seed, 1200, moment))[1]
    for diagnosis in (item.diagnosis for item in reports if item.diagnosis):
        first, second = diagnosis.candidates[:2]
        assert {item.suspects[0].parameter for item in (first, second)} <= {"K", "u.gain", "u.bias"}
        assert first.components != second.components
        assert second.probability > 0.15
        assert diagnosis.unexplained is None
        for suspect in (*first.suspects, *second.suspects):
            if suspect.parameter != "u.bias":
                assert suspect.estimate == pytest.approx(LESS * (suspect.nominal or 0.0), rel=0.03)


@pytest.mark.parametrize("seed", range(2))
def test_which_of_two_lags_nobody_can_tell_beside_a_sensor_either(seed: int) -> None:
    """Beside a level gauge that is off the pump is not taken for a gain of its speed, though that alone lags."""
    made = recording(pumped(meter=", lag: 2 s"), f"K=x{LESS} level.bias=0.2", seed, 1500)
    reports = run(watching(", lag: 2 s"), made)[1]
    for item in (report.diagnosis for report in reports[ONSET + 300 :]):
        if item is not None:
            best = item.candidates[0]
            assert set(best.parameters) in ({"K", "level.bias"}, {"u.gain", "level.bias"}, {"u.bias", "level.bias"})
            assert best.probability < 0.95


@pytest.mark.parametrize(("what", "name"), [("u.bias=-12", "u.bias"), ("u.stuck=50", "u.stuck")])
def test_what_is_no_gain_of_an_input_is_no_pump_beside_a_sensor(what: str, name: str) -> None:
    """Only a wrong gain is the same as the pump: a speed that is off by as much, or the same, at all times is told."""
    made = recording(pumped(speed=", lag: 2 s"), f"{what} level.bias=0.2", 0, 1500)
    best = run(watching(", lag: 2 s"), made)[0].conclude().candidates[0]
    assert set(best.parameters) == {name, "level.bias"}
    assert best.probability > 0.95
