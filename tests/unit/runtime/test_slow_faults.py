"""Faults that the healthy filter has learned from the first sample on: alarms by how far a parameter walks."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Detection
from faultbond.contract.samples import Sample
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from made import graph_of, plant, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
ROWS = 1600


@cache
def motor(factor: float, seed: int) -> tuple[Sample, ...]:
    """A motor whose inertia is another one from the first sample on; its supply steps all the time."""
    time = np.asarray(0.02 * np.arange(ROWS), dtype=np.float64)
    generator = np.random.default_rng(seed)
    u = random_steps(time, generator, low=2, high=12, shortest=0.4, longest=1.2)[:, None]
    faults = [] if factor == 1.0 else [Fault(parameter="J", factor=factor, start=0.0)]
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
