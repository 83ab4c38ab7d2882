"""Sensors that are wrong at the first sample of all: the start is solved from what they read."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Candidate
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from made import run, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
# Two stores with a line between whose flow says little about so large a difference: each gauge is judged by the other.
GRAPH = parse_model(
    """
name: compressed air
sample_time: 1 s
constants: {RT: 84000 J/kg}
inputs: {load: {}, tool: {}}
components:
  compressor: {type: Sf, law: f = G*load/100, parameters: {G: {nominal: 0.12 kg/s, accuracy: 5 %}}}
  receiver: {type: C, law: e = RT*q/V1, parameters: {V1: {nominal: 5 m^3, accuracy: 3 %}}}
  line: {type: R, law: e = K*f*abs(f), parameters: {K: {nominal: 8e6 Pa*s^2/kg^2, accuracy: 10 %}}}
  net: {type: C, law: e = RT*q/V2, parameters: {V2: {nominal: 2 m^3, accuracy: 3 %}}}
  use: {type: R, law: f = A*tool/100*e, parameters: {A: {nominal: 1.4e-7 kg/s/Pa, accuracy: 5 %}}}
junctions: {store: 0, between: 1, away: 0}
bonds: [compressor -> store -> between -> away -> use, store -> receiver, between -> line, away -> net]
slow_error: {compressor.f: 2 % over 10 min, use.f: 3 % over 10 min}
sensors:
  p_rec: {reads: store.e, unit: bar, noise: 0.02 bar}
  p_net: {reads: away.e, unit: bar, noise: 0.02 bar}
  flow: {reads: compressor.f, unit: kg/s, noise: 0.002 kg/s}
"""
)
ROWS = 500
SENSORS = ("p_rec", "p_net", "flow")


@cache
def core() -> Core:
    """The core of the plant."""
    return build_engine(GRAPH)[1]


def read(seed: int, sensor: str, bias: float) -> Monitor:
    """The plant watched with a sensor that reads so much too much from the first sample on, SI."""
    generator = np.random.default_rng(seed)
    time = np.arange(ROWS, dtype=np.float64)
    load, tool = (
        random_steps(time, generator, low=a, high=b, shortest=40.0, longest=160.0) for a, b in ((40, 100), (20, 90))
    )
    start = {"receiver.q": 45.0, "net.q": 15.0}
    made = simulate(GRAPH, Inputs(time=time, values=np.stack([load, tool], axis=1)), seed=seed, start=start)
    outputs = made.outputs.copy()
    outputs[:, SENSORS.index(sensor)] += bias
    return run(core(), samples_of(time, made.inputs, outputs))[0]


def of_sensor(monitor: Monitor, sensor: str) -> Candidate:
    """What is said of a sensor alone."""
    return next(item for item in monitor.conclude().candidates if item.components == (sensor,))


@pytest.mark.parametrize("seed", [1, 2])
@pytest.mark.parametrize(("sensor", "bias"), [("p_rec", -1.013e5), ("p_net", -1.013e5), ("p_rec", 2e4), ("flow", 0.02)])
def test_a_sensor_that_was_wrong_from_the_first_sample_on_has_its_value(seed: int, sensor: str, bias: float) -> None:
    """A gauge that shows gauge pressure: its own share is found, and nobody else is surely blamed."""
    monitor = read(seed, sensor, bias)
    found, best = of_sensor(monitor, sensor), monitor.conclude().candidates[0]
    assert found.probability > 0.1
    assert best.components == (sensor,) or best.probability < 0.9
    (suspect,) = found.suspects
    assert abs(suspect.estimate - bias) < 5.0 * suspect.sd + 0.01 * abs(bias)


def test_the_first_samples_are_forgotten_with_the_trail() -> None:
    """A healthy plant remembers where it began for as long as it keeps that sample."""
    monitor = read(3, "flow", 0.0)
    assert monitor.number("clock.alarm") == -1
    assert monitor.number("beginning.sample") == -1
