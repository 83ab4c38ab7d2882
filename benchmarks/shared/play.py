"""What the monitor makes of a recording, sample by sample."""

from collections.abc import Callable, Iterable, Iterator
from functools import cache

import numpy as np

from benchmarks.shared.plants import graph_of
from faultbond.contract.samples import Report, Sample, Samples
from faultbond.contract.spec import EngineSpec
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Simulation
from faultbond.synthesis.engine import build_core, build_engine
from faultbond.synthesis.specify import build_spec

EPSILON = 1e-9  # s
Seen = tuple[Sample, Monitor, Report]


@cache
def engine_of(folder: str) -> tuple[EngineSpec, Core]:
    """Give specification and core of an example, built once per process."""
    return build_engine(graph_of(folder))


def core_with(graph: BondGraph, change: Callable[[EngineSpec], EngineSpec]) -> Core:
    """Give the core of a model whose specification is changed."""
    plant = build_plant(graph)
    return build_core(plant, change(build_spec(build_step_model(plant))))


def samples(recording: Simulation) -> list[Sample]:
    """Give the samples of a recording."""
    block = block_of(recording)
    rows = zip(block.time, block.dt, block.u, block.y, strict=True)
    return [Sample(time=float(time), dt=float(dt), u=u, y=y) for time, dt, u, y in rows]


def block_of(recording: Simulation) -> Samples:
    """Give the samples of a recording as one block."""
    steps = np.diff(recording.time, prepend=recording.time[0])
    return Samples(time=recording.time, dt=steps, u=recording.inputs, y=recording.outputs)


def passed(core: Core, given: Iterable[Sample]) -> Monitor:
    """Give a monitor that has seen some samples."""
    monitor = Monitor(core)
    for _ in watched(monitor, given):
        pass
    return monitor


def watched(monitor: Monitor, given: Iterable[Sample]) -> Iterator[Seen]:
    """Pass samples through a monitor; give each with the monitor as it then is, and what was said to it."""
    for sample in given:
        report = monitor.step(sample)
        yield sample, monitor, report
