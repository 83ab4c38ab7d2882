"""An input that settles: a component is not taken for it where the meter lags, nor a slow actuator for the meter."""

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

LESS, ONSET = 0.84, 600
START = {"h": 1.0}


def pumped(*, settling: str = "", lag: str = "") -> BondGraph:
    """A tank that a pump fills; the meter of its flow lags, or its speed settles."""
    return parse_model(f"""\
name: pumped tank
sample_time: 1 s
accuracy: 4 %
constants: {{all: 100 percent}}
inputs: {{u: {{unit: percent{settling}}}}}
blocks:
  pump: {{law: F = K*u/all, parameters: {{K: 0.5 l/s}}}}
  tank: {{law: der(h) = (F - C*h)/A, parameters: {{C: 0.3 l/s/m, A: 0.2 m^2}}}}
sensors:
  flow: {{reads: F, unit: l/s, noise: 0.001 l/s{lag}}}
  level: {{reads: h, unit: m, noise: 0.01 m}}
slow_error: {{F: 1 % over 5 min}}
""")


@cache
def watching() -> Core:
    """The core of the model that knows of an input that settles."""
    built = build_plant(pumped(settling=", settling: 10 s"))
    with in_full():
        return build_core(built, build_spec(build_step_model(built)))


def recording(graph: BondGraph, what: str, seed: int, rows: int) -> tuple[Sample, ...]:
    """Samples of a plant with a fault from one moment on."""
    time = np.arange(float(rows))
    steps = random_steps(time, np.random.default_rng(seed), low=40.0, high=80.0, shortest=60.0, longest=200.0)
    fault = fault_in_si(parse_fault(f"{what}@{ONSET}"), graph)
    made = simulate(graph, Inputs(time=time, values=steps[:, None]), [fault], seed=seed, start=START)
    return samples_of(time, made.inputs, made.outputs)


@pytest.mark.parametrize("seed", range(3))
def test_a_pump_is_not_taken_for_its_speed(seed: int) -> None:
    """What the pump gives may come up within the time its speed settles, as a gain of that may."""
    reports = run(watching(), recording(pumped(lag=", lag: 1.5 s"), f"K=x{LESS}", seed, 1200))[1]
    alarm = next(item.detection for item in reports if item.detection)
    assert alarm.sample >= ONSET
    last = next(item.diagnosis for item in reversed(reports) if item.diagnosis)
    best, (suspect,) = last.candidates[0], last.candidates[0].suspects
    assert (suspect.parameter, best.kind) == ("K", FaultKind.STEP)
    assert suspect.estimate == pytest.approx(LESS * (suspect.nominal or 0.0), rel=0.05)


@pytest.mark.parametrize(("seed", "seconds"), [(3, 8.0), (0, 15.0), (3, 15.0), (1, 30.0)])
def test_a_speed_that_has_become_slow_is_no_scatter_of_the_meter(seed: int, seconds: float) -> None:
    """The meter is off for a while after each move and right between; that contradicts scatter from then on."""
    reports = run(watching(), recording(pumped(settling=", lag: 1 s"), f"u_lag={seconds}", seed, 2400))[1]
    found = [item.diagnosis for item in reports if item.diagnosis]
    assert found[-1].unexplained is not None
