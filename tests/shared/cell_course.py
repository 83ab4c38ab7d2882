"""A course of a small cell, sample by sample: holes, gaps, wild values, a fault, and what a person makes of it."""

from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray

from bare_core import CELL
from faultbond.contract.samples import Report, Samples
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io.cache import loadable
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core, load_core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.compile import compile_library, required_compiler
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.model_text import core_text
from faultbond.synthesis.specify import build_spec

REJECTED, ACCEPTED, ROWS = 120, 200, 320  # samples before which a candidate is rejected, and one accepted; and all
EXACT = "-ffp-contract=off"  # sums and products are not fused, so that digits do not hang on the number of lanes


@cache
def cell(lanes: int = 8) -> Core:
    """The core of the cell, with so many lanes side by side."""
    graph, compiler = parse_model(CELL), required_compiler()
    spec, wide = build_spec(build_model(graph)), build_step_model(build_plant(graph), all_inputs=True)
    flags = (EXACT, f"-DFB_LANES={lanes}")
    with loadable([compile_library(core_text(spec, wide) + '#include "threads.c"\n', (*compiler, *flags))]) as (path,):
        return load_core(path, spec, "test")


@cache
def rows() -> Samples:
    """A capacity that falls at 40 s and, at 125 s, a sensor that is off; with values missing, gaps and wild ones."""
    generator, time = np.random.default_rng(4), np.asarray(0.5 * np.arange(ROWS), dtype=np.float64)
    u = np.repeat(generator.uniform([1.0, 0.1], [4.0, 0.4], (ROWS // 20, 2)), 20, axis=0)
    fault = Fault(parameter="C1", factor=0.6, start=40.0)
    made = simulate(parse_model(CELL), Inputs(time=time, values=u), [fault], seed=5)
    u, y = made.inputs.copy(), made.outputs.copy()
    y[250:, 1] += 0.3
    u[generator.random(u.shape) < [0.03, 0.1]] = np.nan
    y[generator.random(y.shape) < 0.05] = np.nan
    for row in (60, 150):
        u[row : row + 6], y[row : row + 6] = np.nan, np.nan
    u[0], u[70, 0], y[75, 1], y[180:184, 0] = (np.nan, 0.2), 1e5, -1e6, 1e4
    return Samples(time=time, dt=np.diff(time, prepend=0.0), u=u, y=y)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """What a monitor saved before each sample, as it goes on from there, and after the last; and its reports."""

    saved: tuple[NDArray[np.uint8], ...]
    reports: tuple[Report, ...]


def decide(monitor: Monitor, row: int) -> None:
    """Do what is done before a sample."""
    if row == REJECTED:
        monitor.reject(monitor.conclude().candidates[-1].hypothesis)
    if row == ACCEPTED:
        monitor.accept(monitor.conclude().candidates[0].hypothesis)


@cache
def course() -> Course:
    """Go through all samples one by one."""
    monitor, samples, saved, reports = Monitor(cell()), rows(), [], []
    for k in range(ROWS):
        decide(monitor, k)
        saved.append(monitor.save())
        reports.append(monitor.take(samples[k : k + 1]).last)
    return Course(saved=(*saved, monitor.save()), reports=tuple(reports))
