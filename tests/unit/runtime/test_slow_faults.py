"""Faults that the healthy filter has learned from the first sample on: alarms by how far a parameter walks."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Detection, Diagnosis
from faultbond.contract.samples import Sample
from faultbond.contract.spec import covariance_place
from faultbond.model.amend import amended
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import find_hypothesis
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from made import EXAMPLES, graph_of, plant, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
ROWS = 1600


@cache
def motor(factor: float, seed: int, parameter: str = "J") -> tuple[Sample, ...]:
    """A motor whose inertia is another one from the first sample on; its supply steps all the time."""
    time = np.asarray(0.02 * np.arange(ROWS), dtype=np.float64)
    generator = np.random.default_rng(seed)
    u = random_steps(time, generator, low=2, high=12, shortest=0.4, longest=1.2)[:, None]
    faults = [] if factor == 1.0 else [Fault(parameter=parameter, factor=factor, start=0.0)]
    made = simulate(graph_of("dc_motor"), Inputs(time=time, values=u), faults, seed=seed)
    return samples_of(time, made.inputs, made.outputs)


def watched(factor: float, seed: int) -> tuple[Monitor, Detection | None]:
    """The monitor at the end, and its alarm."""
    monitor, alarm = Monitor(plant("dc_motor")[2]), None
    for sample in motor(factor, seed):
        alarm = monitor.step(sample).detection or alarm
    return monitor, alarm


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_fault_from_the_first_sample_is_found_and_named(seed: int) -> None:
    """An inertia that is 30 % off, where 3 % is declared, alarms by its walk, and comes first with its value."""
    monitor, alarm = watched(1.3, seed)
    assert alarm is not None
    assert alarm.walk is not None
    assert alarm.walk.from_start
    assert alarm.change_time == 0.0
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("J",)
    suspect = best.suspects[0]
    assert suspect.nominal is not None
    assert suspect.estimate / suspect.nominal == pytest.approx(1.3, abs=0.1)


@pytest.mark.parametrize(("ends", "is_known"), [("[2 V, 12 V]", True), ("[2 V, 11 V]", False)])
def test_where_no_fit_has_been_a_walk_may_be_a_law_that_is_off(ends: str, *, is_known: bool) -> None:
    """An inertia that walks is as likely that as a fault where the supply was where no recording of the fit had it."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    monitor = Monitor(build_engine(parse_model(amended(text, [(("inputs", "V", "fitted_range"), ends)])))[1])
    alarms = [found for item in motor(1.3, 11) if (found := monitor.step(item).detection) is not None]
    assert [alarm.walk is not None for alarm in alarms] == [True]
    last = monitor.conclude()
    assert last.candidates[0].parameters == ("J",)
    assert last.mismatch == (0.0 if is_known else 0.5)
    assert (last.candidates[0].probability > 0.9) == is_known


@pytest.mark.parametrize("tied", ["", "correlations: {J: {K: 0.5}}"], ids=["", "tied"])
def test_what_was_not_repaired_is_found_again(tied: str) -> None:
    """An inertia that is called repaired is judged anew from then on, as from the first sample, also beside others."""
    seed = 11  # of which no sum alarms first
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    monitor = Monitor(build_engine(parse_model(f"{text}\n{tied}\n", "model.yaml"))[1])
    alarms = [item for item in motor(1.3, seed) if monitor.step(item).detection is not None]
    assert len(alarms) == 1
    began = motor(1.3, seed)[-1].time
    monitor.accept(find_hypothesis(monitor.spec, ["J"]), repaired=True)
    later = [replace(item, time=item.time + ROWS * 0.02) for item in motor(1.3, seed)]
    again = next((found for item in later if (found := monitor.step(item).detection) is not None), None)
    assert again is not None
    assert again.walk is not None
    assert (again.walk.parameter, again.walk.from_start, again.change_time) == ("J", True, began)


@pytest.mark.parametrize("seed", [11, 12])
def test_what_was_accepted_is_judged_by_what_was_found(seed: int) -> None:
    """A plant that stays as it was accepted is quiet, though it is far from what the model file says."""
    monitor, alarm = watched(1.3, seed)
    assert alarm is not None
    monitor.accept(find_hypothesis(monitor.spec, ["J"]))
    monitor.resume()  # the plant was elsewhere meanwhile
    later = [replace(item, time=item.time + ROWS * 0.02) for item in motor(1.3, seed)]
    assert all(monitor.step(item).detection is None for item in later)


def test_where_parameters_are_taken_back_slow_errors_begin_anew() -> None:
    """After an alarm by a walk from the start no slow error was found with other parameters; states go with it."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    core = build_engine(parse_model(f"{text}\nslow_error: {{omega: 0.01 rad/s over 2 s}}\n", "model.yaml"))[1]
    monitor = Monitor(core)
    found = any(monitor.step(sample).detection is not None for sample in motor(1.3, 11))
    spec, alarm = monitor.spec, int(monitor.number("clock.alarm"))
    assert found
    assert monitor.number("alarm.old") >= 0
    (k,) = range(*spec.slow_slice.indices(spec.n_joint))
    for number in (alarm - 100, alarm):
        lane = monitor.row(number)[1]
        row = np.array([lane[covariance_place(spec, min(i, k), max(i, k))] for i in range(spec.n_joint)])
        assert lane[k] == 0.0
        assert row[k] == pytest.approx(spec.slow_errors[0].sd ** 2)
        assert not row[spec.parameter_slice].any()
        assert row[: len(spec.states)].any()  # what the sensor reads less its error is what a state is


@cache
def trusting(parameter: str, value: str) -> Core:
    """The core of a motor one of whose parameters counts as healthy."""
    text = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")
    declared = f"{{{parameter}: {value}}}"
    assert declared in text
    return build_engine(parse_model(text.replace(declared, f"{{{parameter}: {{nominal: {value}, suspect: no}}}}")))[1]


def concluded(core: Core, samples: Sequence[Sample]) -> tuple[Detection | None, list[Diagnosis]]:
    """The alarm, and all diagnoses."""
    monitor, alarm, told = Monitor(core), None, []
    for sample in samples:
        report = monitor.step(sample)
        alarm = report.detection or alarm
        told += [report.diagnosis] if report.diagnosis is not None else []
    return alarm, [item for item in [*told, monitor.conclude()] if item.candidates]


@pytest.mark.parametrize(
    ("parameter", "value", "seed"), [("L", "2.5 H", 11), ("J", "1.5 kg*m^2", 11), ("J", "1.5 kg*m^2", 12)]
)
def test_a_trusted_parameter_that_is_off_accuses_nobody(parameter: str, value: str, seed: int) -> None:
    """The alarm is by its walk; no diagnosis says of a part that it is at fault, and each that the model is off."""
    alarm, told = concluded(trusting(parameter, value), motor(1.3, seed, parameter))
    assert alarm is not None
    assert alarm.walk is not None
    assert alarm.walk.parameter == parameter
    assert len(told) > 20
    for item in told:
        even = item.mismatch / sum(candidate.probability > 0.0 for candidate in item.candidates)  # a share of each set
        assert item.candidates[0].probability - even <= 0.1 + 1e-9 < item.mismatch
        assert sum(candidate.probability for candidate in item.candidates) == pytest.approx(1.0)


def test_beside_a_trusted_parameter_a_fault_from_the_first_sample_is_named() -> None:
    """Where that of a suspect walks, nothing else is said than before."""
    alarm, told = concluded(trusting("L", "2.5 H"), motor(1.3, 11, "J"))
    assert alarm is not None
    assert alarm.walk is not None
    assert alarm.walk.parameter == "J"
    assert told[-1].mismatch == 0.0
    assert told[-1].candidates[0].parameters == ("J",)
    assert told[-1].candidates[0].probability > 0.9


@pytest.mark.parametrize("seed", [11, 12, 13])
def test_a_healthy_plant_walks_little(seed: int) -> None:
    """No alarm; what walks farthest stays below its limit by far."""
    monitor, most = Monitor(plant("dc_motor")[2]), 0.0
    for sample in motor(1.0, seed):
        assert monitor.step(sample).detection is None
        most = max(most, monitor.number("healthy.walk"))
    assert 0.0 < most < 0.7


def test_an_asset_of_a_fleet_goes_away_at_the_sample_at_which_a_monitor_alarms() -> None:
    """And the monitor that it becomes finds what one of its own finds."""
    graph = graph_of("dc_motor")
    core = build_engine(graph, fleets=True)[1]
    runs = [motor(1.3 if k % 2 else 1.0, 11 + k // 2) for k in range(4)]
    time = np.array([item.time for item in runs[0]])
    u, y = (np.array([[getattr(item, key) for item in run] for run in runs]) for key in ("u", "y"))
    fleet = Fleet(core, 4)
    left: dict[int, int] = {}
    for first in range(0, ROWS, 50):
        rows = slice(first, first + 50)
        for event in fleet.block(time[rows], u[:, rows], y[:, rows]):
            if event.detection is not None:
                left[event.asset] = event.detection.sample
    alarms = [watched(1.3 if k % 2 else 1.0, 11 + k // 2)[1] for k in range(4)]
    assert left == {k: alarm.sample for k, alarm in enumerate(alarms) if alarm is not None}
    assert set(left) == {1, 3}


ROOM = """
name: heated room
sample_time: 10 s
accuracy: 4 %
time_between_false_alarms: 30 d
inputs: {Q: {unit: W, noise: 20 W}, T_o: {unit: degC, noise: 0.1 K}}
constants: {T_0: 293.15 K}
blocks:
  people: {law: W = gain, parameters: {gain: {nominal: 500 W, accuracy: 16 %, change: 2 kW, range: any, suspect: no}}}
  walls: {law: loss = UA*(z + T_0 - T_o), parameters: {UA: 200 W/K}}
  room: {law: der(z) = (Q - loss + W)/C, parameters: {C: 1.2 MJ/K}}
sensors: {T: {reads: z + T_0, unit: degC, noise: 0.06 K}}
slow_error: {W: 200 W over 1 h}
"""


def room(growth: float, seed: int, rows: int = 6000, step: float = 10.0) -> tuple[Sample, ...]:
    """A room for 17 hours; people come and go, and after 7 hours its walls begin to lose more, `growth` at the end."""
    generator, keep = np.random.default_rng(seed), float(np.exp(-step / 3600.0))
    outside = 5.0 + 3.0 * np.sin(2.0 * np.pi * np.arange(rows) * step / 86400.0 + generator.uniform(0.0, 6.0))
    heat = np.repeat(generator.uniform(1500.0, 4500.0, rows // 180 + 1), 180)[:rows]
    noise = generator.standard_normal((4, rows))
    inside, people, readings = 20.0, 0.0, []
    for k in range(rows):
        readings.append(inside + 0.06 * noise[0, k])
        people = keep * people + 200.0 * np.sqrt(1.0 - keep**2) * noise[1, k]
        walls = 204.0 * (1.0 + growth * max(k / rows - 0.4, 0.0) / 0.6)
        given = heat[k] + 20.0 * noise[2, k] + 520.0 + people
        inside += step * (given - walls * (inside - outside[k])) / 1.2e6
    told = np.column_stack([heat, outside + 0.1 * noise[3] + 273.15])
    time = np.asarray(step * np.arange(rows), dtype=np.float64)
    return samples_of(time, told, np.array(readings)[:, None] + 273.15)


def test_a_fault_that_an_absolute_error_takes_is_found() -> None:
    """Heat that goes through the walls looks like people who left; so many do not leave."""
    graph = parse_model(ROOM, file="room.yaml")
    core = build_engine(graph)[1]
    for growth, seed, found in ((0.0, 11, False), (0.5, 11, True), (0.5, 13, True), (0.5, 14, True)):
        monitor = Monitor(core)
        alarm = next((item for item in (monitor.step(x).detection for x in room(growth, seed)) if item), None)
        assert (alarm is not None) == found
