"""What is wrong at the first sample of all: the start is solved from readings, by parameters as stated."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Candidate
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
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
# Slow errors learn much of what parameters have done before the alarm.
COOLING = """
name: cooler
sample_time: 4 s
inputs: {load: {unit: kW, lag: 8 s}, m: {unit: kg/s}}
constants: {cp: 4.18 kJ/kg/K, T0: 20 degC, T_sea: 18 degC}
components:
  engine: {type: Sf, law: f = g*load, parameters: {g: {nominal: 0.5, accuracy: 2 %}}}
  jacket: {type: C, law: q = Cj*(e - T0), parameters: {Cj: {nominal: 1700 kJ/K, accuracy: 4 %}}}
  plates: {type: R, law: f = UA*e, parameters: {UA: {nominal: 8 kW/K, accuracy: 2 %}}}
  side: {type: C, law: q = Cc*(e - T0), parameters: {Cc: {nominal: 640 kJ/K, accuracy: 10 %, suspect: no}}}
  sea: {type: Sf, law: f = cp*m*k*(sw.e - T_sea), parameters: {k: {nominal: 1, accuracy: 2 %}}}
junctions: {hot: 0, wall: 1, sw: 0}
bonds: [engine -> hot -> jacket, hot -> wall -> plates, wall -> sw -> side, sw -> sea]
sensors: {t_hot: {reads: hot.e, unit: degC, noise: 0.1 K}, t_sw: {reads: sw.e, unit: degC, noise: 0.06 K}}
slow_error: {t_hot: 0.5 K over 2200 s, t_sw: 0.3 K over 2200 s}
"""
COOLER = parse_model(COOLING)
# A flow that lags behind its input has no value below 0.
_LAGGING = COOLING.replace("m: {unit: kg/s}", "m: {unit: kg/s, lag: 12 s}").replace("cp*m*k", "cp*k*m**0.8")
LAGGING = parse_model(_LAGGING.replace("{nominal: 1, accuracy", "{nominal: 1.6 kg^0.2/s^0.2, accuracy"))
# A voltage that is wrong moves the current within a few samples, and so a start that is solved from twenty.
DRIVE = parse_model(
    """
name: drive
sample_time: 0.05 s
inputs: {u: {unit: V}, load: {unit: N*m}}
components:
  supply: {type: Se, law: e = u}
  winding: {type: R, law: e = R*f, parameters: {R: {nominal: 0.8 ohm, accuracy: 5 %}}}
  coil: {type: I, law: p = L*f, parameters: {L: {nominal: 0.2 H, accuracy: 5 %}}}
  machine: {type: GY, law: [e1 = k*f2, e2 = k*f1], parameters: {k: {nominal: 0.5 V*s/rad, accuracy: 2 %}}}
  rotor: {type: I, law: p = J*f, parameters: {J: {nominal: 0.05 kg*m^2, accuracy: 5 %}}}
  bearing: {type: R, law: e = d*f, parameters: {d: {nominal: 0.02 N*m*s, accuracy: 10 %}}}
  brake: {type: Se, law: e = -load}
junctions: {electric: 1, shaft: 1}
bonds: [supply -> electric -> winding, electric -> coil, electric -> machine -> shaft, shaft -> rotor, shaft -> bearing,
        brake -> shaft]
sensors: {i: {reads: electric.f, unit: A, noise: 0.05 A}, w: {reads: shaft.f, unit: rad/s, noise: 0.1 rad/s}}
slow_error: {w: 0.3 rad/s over 20 s, i: 0.1 A over 30 s}
"""
)
ROWS, BEFORE = 500, 600  # of the cooler: rows before the first that is seen
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


@cache
def cooled(seed: int, factor: float = 1.0, load_bias: float = 0.0, *, lags: bool = False) -> Monitor:
    """The cooler watched; its plates have had so many times their conductance for long, or more load acts, W."""
    model, generator = LAGGING if lags else COOLER, np.random.default_rng(seed)
    time = np.linspace(0.0, 4.0 * (ROWS + BEFORE - 1), ROWS + BEFORE)
    load = random_steps(time, generator, low=2.2e5, high=5.6e5, shortest=300.0, longest=900.0)
    flow = random_steps(time, generator, low=8.0, high=14.0, shortest=400.0, longest=1200.0)
    inputs = Inputs(time=time, values=np.stack([load, flow], axis=1))
    start = {"jacket.q": 7e7, "side.q": 3.5e6}
    made = simulate(model, inputs, [Fault(parameter="UA", factor=factor, start=0.0)], seed=seed, start=start)
    seen = samples_of(time[BEFORE:], made.inputs[BEFORE:] - [load_bias, 0.0], made.outputs[BEFORE:])
    return run(build_engine(model)[1], seen)[0]


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


@pytest.mark.parametrize(("seed", "factor"), [(1, 0.65), (2, 0.65), (4, 1.45)])
def test_a_parameter_that_was_off_from_the_first_sample_on_is_no_sensor(seed: int, factor: float) -> None:
    """Plates are named with their value, not the thermometer, whose lanes begin at that sample too."""
    monitor = cooled(seed, factor)
    best = monitor.conclude().candidates[0]
    assert monitor.number("clock.alarm") < monitor.spec.thresholds.history_samples
    assert (best.components, best.kind) == (("plates",), FaultKind.STEP)
    assert best.probability > 0.9
    (suspect,) = best.suspects
    assert abs(suspect.estimate - factor * 8e3) < 4.0 * suspect.sd < 0.2 * 8e3


@pytest.mark.parametrize("seed", [1, 3, 4])
def test_what_lags_behind_an_input_makes_up_for_no_fault_at_the_start(seed: int) -> None:
    """The filter runs from the first sample on, and plates that conduct 1.8 times as much are no thermometer."""
    monitor = cooled(seed, 1.8, lags=True)
    best = monitor.conclude().candidates[0]
    assert monitor.number("clock.begun") == 0
    assert (best.components, best.kind) == (("plates",), FaultKind.STEP)
    assert best.probability > 0.9
    (suspect,) = best.suspects
    assert abs(suspect.estimate - 1.8 * 8e3) < 4.0 * suspect.sd


@cache
def driven(seed: int, gain: float) -> Monitor:
    """The drive watched, on which so many times the recorded voltage has acted for long."""
    generator = np.random.default_rng(seed)
    time = np.linspace(0.0, 0.05 * (ROWS + BEFORE - 1), ROWS + BEFORE)
    voltage = random_steps(time, generator, low=4.0, high=24.0, shortest=1.0, longest=6.0)
    load = random_steps(time, generator, low=0.0, high=1.5, shortest=2.0, longest=10.0)
    inputs = Inputs(time=time, values=np.stack([voltage, load], axis=1))
    made = simulate(DRIVE, inputs, seed=seed, start={"coil.p": 1.0, "rotor.p": 0.8})
    seen = samples_of(time[BEFORE:], made.inputs[BEFORE:] / [gain, 1.0], made.outputs[BEFORE:])
    return run(build_engine(DRIVE)[1], seen)[0]


@pytest.mark.parametrize(("seed", "gain"), [(1, 1.15), (2, 0.82), (3, 1.2)])
def test_an_input_that_had_another_gain_from_the_first_sample_on_is_no_sensor(seed: int, gain: float) -> None:
    """Its lanes begin with what sensors read, not with a start that was solved by what the input was taken for."""
    monitor = driven(seed, gain)
    best = monitor.conclude().candidates[0]
    assert monitor.number("clock.alarm") <= monitor.spec.thresholds.history_samples
    assert best.components == ("u",)
    assert best.probability > 0.9
    (suspect,) = best.suspects
    assert suspect.parameter == "u.gain"
    assert abs(suspect.estimate - gain) < 4.0 * suspect.sd


@pytest.mark.parametrize(("seed", "bias"), [(2, 9e4), (6, 8e4)])
def test_an_input_that_was_off_from_the_first_sample_on_has_its_value(seed: int, bias: float) -> None:
    """What begins with the start goes with the input: a store's content, and the lag behind it."""
    monitor = cooled(seed, load_bias=bias)
    best = monitor.conclude().candidates[0]
    assert best.components == ("load",)
    assert best.probability > 0.9
    (suspect,) = best.suspects
    assert suspect.parameter == "load.bias"
    assert abs(suspect.estimate - bias) < 4.0 * suspect.sd


def test_the_first_samples_are_forgotten_with_the_trail() -> None:
    """A healthy plant remembers where it began for as long as it keeps that sample."""
    monitor = read(3, "flow", 0.0)
    assert monitor.number("clock.alarm") == -1
    assert monitor.number("beginning.sample") == -1
