"""Made-up recordings of the built-in plants, and runs of the monitor over them, for tests."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Report, Sample
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_core
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[2] / "examples"
TANK_START = 0.2  # m^3


@cache
def graph_of(name: str) -> BondGraph:
    """A built-in plant."""
    return load_model(EXAMPLES / name / "model.yaml")


@cache
def spec_of(name: str) -> EngineSpec:
    """The specification of a built-in plant, for which nothing is compiled."""
    return build_spec(build_step_model(build_plant(graph_of(name))))


@cache
def plant(name: str) -> tuple[BondGraph, EngineSpec, Core]:
    """A built-in plant with its core."""
    return graph_of(name), spec_of(name), build_core(build_plant(graph_of(name)), spec_of(name))


@contextmanager
def in_full() -> Iterator[None]:
    """What is built meanwhile is optimised as that of users: for tests that run a core for long."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("FAULTBOND_HASTY", "0")
        yield


@cache
def plant_in_full(name: str) -> tuple[BondGraph, EngineSpec, Core]:
    """The same, its core optimised as that of users: for tests that diagnose for long it pays, by 2.5 times."""
    with in_full():
        return graph_of(name), spec_of(name), build_core(build_plant(graph_of(name)), spec_of(name))


@cache
def with_thresholds(name: str, **settings: float) -> Core:
    """The core of a built-in plant with other settings of its thresholds."""
    spec = spec_of(name)
    chosen = replace(spec.thresholds, **settings)  # type: ignore[arg-type]
    return build_core(build_plant(graph_of(name)), replace(spec, thresholds=chosen))


@cache
def recorded(name: str, rows: int, fault: Fault | None = None) -> tuple[Sample, ...]:
    """Samples of a plant with noise, inputs stepping at random, and perhaps a fault."""
    graph = graph_of(name)
    dt = graph.sample_time or 1.0
    time, generator = np.asarray(np.arange(rows) * dt, dtype=np.float64), np.random.default_rng(6)
    if name == "tank":
        u = np.array([random_steps(time, generator, low=low, high=90, shortest=30, longest=90) for low in (50, 30)]).T
    else:
        u = random_steps(time, generator, low=2, high=12, shortest=20 * dt, longest=60 * dt)[:, None]
    start = {"tank.q": TANK_START} if name == "tank" else None
    made = simulate(graph, Inputs(time=time, values=u), [fault] if fault else [], seed=2, start=start)
    return samples_of(time, made.inputs, made.outputs)


def samples_of(time: FloatArray, u: FloatArray, y: FloatArray) -> tuple[Sample, ...]:
    """Samples of rows of values."""
    steps = np.diff(time, prepend=time[0])
    return tuple(
        Sample(time=float(t), dt=float(dt), u=row_u.copy(), y=row_y.copy())
        for t, dt, row_u, row_y in zip(time, steps, u, y, strict=True)
    )


def run(core: Core, samples: Sequence[Sample], monitor: Monitor | None = None) -> tuple[Monitor, list[Report]]:
    """The monitor after the samples, a copy of that given, and all reports."""
    watching = Monitor(core) if monitor is None else monitor.copy()
    return watching, [watching.step(sample) for sample in samples]


def stepped(monitor: Monitor, sample: Sample) -> tuple[Monitor, Report]:
    """A copy of a monitor after one more sample, and its report."""
    after, (report,) = run(monitor.core, [sample], monitor)
    return after, report


class Course:
    """Monitors along a recording, each made from one before it and the samples between; not to be changed."""

    def __init__(self, core: Core, samples: Sequence[Sample]) -> None:
        self.samples, self.known = samples, {0: Monitor(core)}

    def after(self, rows: int) -> Monitor:
        """The monitor after a number of samples."""
        if rows not in self.known:
            begun = max(k for k in self.known if k < rows)
            self.known[rows] = run(self.known[begun].core, self.samples[begun:rows], self.known[begun])[0]
        return self.known[rows]


def differing(one: Monitor, two: Monitor) -> list[str]:
    """Names of the numbers in which two monitors differ, to the last bit; nan equals nan."""
    pairs = ((name, one.numbers(name), two.numbers(name)) for name in one.core.fields)
    names = [name for name, first, second in pairs if not np.array_equal(first, second, equal_nan=True)]
    return names if names or np.array_equal(one.save(), two.save()) else ["past or lanes"]


def changed(monitor: Monitor, **numbers: Any) -> Monitor:
    """A copy of a monitor with other numbers, by name in `fields.h`, whole or its last part where that is one's own."""
    other = monitor.copy()
    for name, value in numbers.items():
        (full,) = (item for item in other.core.fields if name in (item, item.partition(".")[2]))
        field = other.core.fields[full]
        part = other._state[field.offset : field.offset + 8 * field.count]
        kind = np.int64 if field.whole else np.float64
        part.view(kind)[:] = np.broadcast_to(np.ravel(np.asarray(value, dtype=kind)), (field.count,))
    return other


def packed(monitor: Monitor) -> FloatArray:
    """The last sample as the filter took it, (1, n_sample)."""
    return monitor.row(int(monitor.number("clock.index")) - 1)[0][None, :]
