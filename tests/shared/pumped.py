"""A pump that fills a tank and is switched off at times; then, and while it starts, the model of it is wrong by far."""

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np

from faultbond.contract.samples import Reports, Samples
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.engine import build_engine

VALID = "valid_when: {when: running == 1, settling: 20 s}\n"
TEXT = """name: pumped tank
sample_time: 1 s
max_faults: 2
inputs: {speed: {unit: percent, settling: 3 s}, running: {}}
components:
  pump:   {type: Se, law: e = K*speed**2, parameters: {K: 12 Pa/percent^2}}
  pipe:   {type: R, law: e = Rp*f*abs(f), parameters: {Rp: 4e10 Pa*s^2/m^6}}
  tank:   {type: C, law: e = q/C, parameters: {C: 5e-6 m^3/Pa}}
  outlet: {type: R, law: e = Ro*f, parameters: {Ro: 3e7 Pa*s/m^3}}
junctions: {line: 1, vessel: 0}
bonds: [pump -> line -> pipe, line -> vessel -> tank, vessel -> outlet]
sensors:
  flow:  {reads: line.f, unit: m^3/s, noise: 2e-6 m^3/s}
  level: {reads: vessel.e, unit: Pa, noise: 100 Pa}
"""
START_UP = 8.0  # s
PARTS = 10  # of a second


@cache
def graph(*, states: bool = True) -> BondGraph:
    """The model, with its operating states or as if it always held."""
    return parse_model(VALID + TEXT if states else TEXT)


@cache
def core(*, states: bool = True) -> Core:
    """Its core."""
    return build_engine(graph(states=states), fleets=True)[1]


def course(
    off: Sequence[tuple[int, int]], n: int, fault: tuple[str, float, int] | None = None, seed: int = 1
) -> Samples:
    """Samples of the plant, by steps of Euler's method.

    Parameters
    ----------
    off : from when to when the pump is off, s; a check valve closes, and somebody drains the tank
    n : how many
    fault : parameter, factor, and when it begins, s
    seed : of noise, speeds, and how far the plant is from its nominal
    """
    rng = np.random.default_rng(seed)
    healthy = {name: value * (1 + 0.02 * rng.standard_normal()) for name, value in nominal().items()}
    speed = np.repeat(rng.uniform(72.0, 95.0, n // 200 + 1), 200)[:n]
    running = np.ones(n)
    for first, last in off:
        running[first:last] = 0.0
    flow, level, x, turns = np.zeros(n), np.zeros(n), 3e4, 1.0
    for k in range(n):
        now = healthy if fault is None or k < fault[2] else {**healthy, fault[0]: fault[1] * healthy[fault[0]]}
        turns = min(1.0, turns + 1.0 / START_UP) if running[k] else 0.0
        level[k] = x
        for part in range(PARTS):
            head = now["K"] * (speed[k] * turns) ** 2 - x
            q = np.sqrt(max(head, 0.0) / now["Rp"]) if running[k] else 0.0
            drained = 0.0 if running[k] else 3.6e-4 * np.sqrt(max(x, 0.0) / 3e4)
            flow[k] = q if part == 0 else flow[k]
            x = max(x + (q - x / now["Ro"] - drained) / now["C"] / PARTS, 0.0)
    y = np.column_stack([flow, level]) + rng.standard_normal((n, 2)) * [2e-6, 100.0]
    time = np.arange(float(n))
    return Samples(time=time, dt=np.minimum(time, 1.0), u=np.column_stack([speed, running]), y=y)


def nominal() -> dict[str, float]:
    """The parameters of the model file."""
    return {item.name: item.nominal for item in graph(states=False).parameters}


def watched(monitor: Monitor, samples: Samples) -> list[Reports]:
    """Blocks of reports of all samples, each but the last one up to where something was found."""
    found, taken = list[Reports](), 0
    while taken < len(samples):
        found.append(monitor.take(samples[taken:]))
        taken += len(found[-1])
    return found


def with_inputs(samples: Samples, u: np.ndarray) -> Samples:
    """The same samples under other inputs (n, n_inputs)."""
    return replace(samples, u=u)
