"""Made-up recordings of the built-in plants, and runs of the monitor over them, for tests."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.monitor import step
from faultbond.runtime.state import Report, Sample, State, init
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine

EXAMPLES = Path(__file__).parents[2] / "examples"
TANK_START = 0.2  # m^3
PARTS = ("clock", "inputs", "sensors", "healthy", "bank", "normal")


@cache
def plant(name: str) -> tuple[BondGraph, EngineSpec, Engine]:
    """A built-in plant with its engine."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    return (graph, *build_engine(graph))


@cache
def recorded(name: str, rows: int, fault: Fault | None = None) -> tuple[Sample, ...]:
    """Samples of a plant with noise, inputs stepping at random, and perhaps a fault."""
    graph = plant(name)[0]
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


def run(
    spec: EngineSpec, engine: Engine, samples: Sequence[Sample], state: State | None = None
) -> tuple[State, list[Report]]:
    """The last state and all reports."""
    state, reports = state or init(spec), []
    for sample in samples:
        state, report = step(spec, engine, state, sample)
        reports.append(report)
    return state, reports


def differing(one: State, two: State) -> list[str]:
    """Names of the numbers in which two states differ, to the last bit; nan equals nan."""
    first, second = one.save(), two.save()
    return [name for name in first if not np.array_equal(first[name], second[name], equal_nan=True)]


def changed(state: State, **numbers: Any) -> State:
    """A state with other numbers, each by the name that it has in one of the parts."""
    for name, value in numbers.items():
        part = next(part for part in PARTS if hasattr(getattr(state, part), name))
        state = replace(state, **{part: replace(getattr(state, part), **{name: value})})
    return state
