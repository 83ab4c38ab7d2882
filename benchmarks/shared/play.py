"""What the monitor makes of a recording, sample by sample."""

from collections.abc import Iterable, Iterator
from functools import cache

import numpy as np

from benchmarks.shared.plants import graph_of
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.runtime.monitor import step
from faultbond.runtime.state import Report, Sample, State, init
from faultbond.simulate import Simulation
from faultbond.synthesis.engine import build_engine

EPSILON = 1e-9  # s
Seen = tuple[Sample, State, Report]


@cache
def engine_of(folder: str) -> tuple[EngineSpec, Engine]:
    """Give specification and engine of an example, built once per process."""
    return build_engine(graph_of(folder))


def samples(recording: Simulation) -> list[Sample]:
    """Give the samples of a recording."""
    steps = np.diff(recording.time, prepend=recording.time[0])
    rows = zip(recording.time, steps, recording.inputs, recording.outputs, strict=True)
    return [Sample(time=float(time), dt=float(dt), u=u, y=y) for time, dt, u, y in rows]


def passed(spec: EngineSpec, engine: Engine, given: Iterable[Sample]) -> State:
    """Give the state of the monitor after some samples."""
    state = init(spec)
    for _, after, _ in watched(spec, engine, given):
        state = after
    return state


def watched(spec: EngineSpec, engine: Engine, given: Iterable[Sample], state: State | None = None) -> Iterator[Seen]:
    """Pass samples through the monitor; give each with the state after it and what was said to it."""
    state = init(spec) if state is None else state
    for sample in given:
        state, report = step(spec, engine, state, sample)
        yield sample, state, report
