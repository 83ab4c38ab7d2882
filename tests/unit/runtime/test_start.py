"""The start of a plant, found from its first samples."""

from dataclasses import replace
from functools import cache
from typing import Any

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.core_settings import core_settings
from faultbond.contract.samples import Sample, Status
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.equations.plant import build_plant
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.engine import build_core, build_engine
from made import TANK_START, graph_of, plant, recorded, run, samples_of, spec_of
from plants import HOT_DRIVE, TWO_STORES, hot_motor

START_SAMPLES = int(core_settings()["START_SAMPLES"])
MOTOR = {"L.p": 2.5 * 1.5, "J.p": 1.5 * -2.0}  # 1.5 A, -2 rad/s


def packed(spec: EngineSpec, samples: tuple[Sample, ...]) -> FloatArray:
    """Samples as the engine takes them; missing values are switched off."""
    rows, place = np.zeros((len(samples), spec.n_sample)), spec.sample_fields
    u, y = (np.array([getattr(item, field) for item in samples]) for field in "uy")
    rows[1:, place["dt"]] = np.array([[item.dt] for item in samples[1:]])
    rows[:, place["u"]], rows[:, place["scale"]] = u, 1.0
    rows[:, place["fresh"]] = spec.input_variance
    rows[:, place["u_before"]] = u[[0, *range(len(u) - 1)]]
    rows[:, place["y"]], rows[:, place["use"]] = np.nan_to_num(y), np.isfinite(y)
    return rows


def solved(core: Core, rows: FloatArray) -> tuple[FloatArray, FloatArray]:
    """The states of the start, and their covariance."""
    mean, covariance = core.solve_start(rows)
    return mean, covariance[: len(mean), : len(mean)]


def started(name: str, start: dict[str, float], seed: int) -> tuple[Core, FloatArray]:
    """The core, and the first samples, packed, of a nominal plant that begins at `start`."""
    graph, spec, core = plant(name)
    time = np.asarray(np.arange(START_SAMPLES) * (graph.sample_time or 1.0), dtype=np.float64)
    low = np.array([60.0, 40.0]) if name == "tank" else np.array([6.0])
    made = simulate(graph, Inputs(time=time, values=np.tile(low, (len(time), 1))), seed=seed, start=start)
    dt = graph.sample_time or 1.0
    samples = [Sample(time=t, dt=dt, u=u, y=y) for t, u, y in zip(time, made.inputs, made.outputs, strict=True)]
    return core, packed(spec, tuple(samples))


@pytest.mark.parametrize("lag", ["", ", lag: 2 s"])
@pytest.mark.parametrize("voltage", [20.0, 135.0, 200.0])
def test_a_start_is_found_where_the_plant_runs_away_from_nothing(voltage: float, lag: str) -> None:
    """A winding at 0 K has a resistance below zero: the readings show where the motor is, one after the other.

    A thermometer that lags shows what it follows as if it were at rest.
    """
    graph = parse_model(hot_motor(lag=lag))
    spec, core = build_engine(graph)
    time = np.asarray(np.arange(START_SAMPLES) * 0.25, dtype=np.float64)
    speed, load, warm = voltage / 1.4, 10.0, 40.0
    values = np.tile([voltage, load, 290.0], (len(time), 1))
    lagged = {"T.lagged": 293.15 + warm} if lag else {}
    start = {"rotor.p": 0.3 * speed, "mass.q": 4000.0 * warm} | lagged
    made = simulate(graph, Inputs(time=time, values=values), seed=4, start=start)
    mean, covariance = solved(core, packed(spec, samples_of(time, made.inputs, made.outputs)))
    true = [speed, 293.15 + warm, *lagged.values()]
    sds = np.sqrt(np.diag(covariance))
    assert np.abs(mean - true) == pytest.approx(0.0, abs=3.0)
    assert np.all(np.abs(mean - true) < 3.0 * sds)


def driven(voltage: float, load: float) -> tuple[EngineSpec, Core, tuple[Sample, ...], list[float]]:
    """A drive with a rope, warm and turning: its core, its first samples, and where it began."""
    spec, core = build_engine(parse_model(HOT_DRIVE))
    time, torque = np.asarray(np.arange(START_SAMPLES) * 0.25, dtype=np.float64), 80.0 + load
    speed = (voltage - 0.6 * torque / 20.0 / 1.2) / 1.2
    start = {"rotor.p": 0.15 * speed, "rope.q": torque / 300.0, "drum.p": 60.0 * speed / 20.0, "mass.q": 160_000.0}
    values = np.tile([voltage, load, 290.0], (len(time), 1))
    made = simulate(parse_model(HOT_DRIVE), Inputs(time=time, values=values), seed=4, start=start)
    return spec, core, samples_of(time, made.inputs, made.outputs), [speed, torque, speed / 20.0, 333.15]


@pytest.mark.parametrize(("voltage", "load"), [(135.0, 430.0), (135.0, 100.0), (60.0, 100.0)])
def test_what_is_shown_far_off_says_how_large_states_are(voltage: float, load: float) -> None:
    """Sizes of states that are taken where the plant runs away say nothing: no winding is within a hundredth of 0 K."""
    spec, core, samples, true = driven(voltage, load)
    mean, covariance = solved(core, packed(spec, samples))
    sds = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(mean - true) < 3.0 * sds)
    assert sds == pytest.approx(0.0, abs=0.1 * np.max(true))


WINDING = """
name: winding
sample_time: 0.1 s
constants: {T_20: 293.15 K, alpha: 0.0039 1/K}
inputs: {u: {unit: V}, T_air: {unit: K}}
blocks:
  resistance: {law: "r = R*(max(th, 150)/310)**slope*(1 + alpha*(th - T_20))",
    parameters: {R: 0.84 ohm, slope: {nominal: -2.3, range: any}}}
  coil: {law: der(i) = (u - r*i - k*w)/L, parameters: {L: 0.046 H, k: 1.056 V*s/rad}}
  rotor: {law: der(w) = (k*i - B*w)/J, parameters: {B: 0.06 N*m*s/rad, J: 0.2 kg*m^2}}
  copper: {law: der(th) = (r*i**2 - (th - T_air)/R_th)/C, parameters: {R_th: 0.44 K/W, C: 390 J/K}}
sensors:
  I: {reads: i, unit: A, noise: 0.1 A}
  n: {reads: w, unit: rad/s, noise: 0.1 rad/s}
  T: {reads: th, unit: K, noise: 0.12 K, lag: 6.8 s}
"""


@pytest.mark.parametrize("voltage", [85.0, 98.0, 113.0])
def test_a_slow_sensor_shows_what_it_reads_before_what_does_not_rest(voltage: float) -> None:
    """By the current of a coil, which moves, at rest its winding had a temperature that no plant has."""
    _, core = build_engine(parse_model(WINDING))
    time = np.asarray(np.arange(START_SAMPLES) * 0.1, dtype=np.float64)
    values = np.tile([voltage, 297.0], (len(time), 1))
    true = [6.0, 101.0, 316.5, 316.2]
    start = dict(zip(("i", "w", "th", "T.lagged"), true, strict=True))
    made = simulate(parse_model(WINDING), Inputs(time=time, values=values), seed=2, start=start)
    mean, covariance = solved(core, packed(core.spec, samples_of(time, made.inputs, made.outputs)))
    assert np.all(np.abs(mean - true) < 3.0 * np.sqrt(np.diag(covariance)))
    assert mean == pytest.approx(true, abs=1.5)


BOX = """
name: box
sample_time: 1 s
constants: {T_0: 293.15 K}
inputs: {P: {unit: W}, T_air: {unit: degC}}
blocks:
  skin: {law: der(th) = (P - h*(th + T_0 - T_air))/C, parameters: {h: 1.2 W/K, C: 900 J/K}}
sensors: {T: {reads: th + T_0, unit: degC, noise: 0.08 K, lag: 14 s}}
"""


@pytest.mark.parametrize("settled", [0.006, -0.02, 0.3, 4.0])
def test_what_would_settle_at_nothing_may_be_elsewhere(settled: float) -> None:
    """A box at 21.5 degC in air of 20 degC: that it would come to next to nothing over 20 degC is no size of it."""
    graph = parse_model(BOX)
    _, core = build_engine(graph)
    time = np.asarray(np.arange(START_SAMPLES), dtype=np.float64)
    values = np.tile([0.0, 293.15 + settled], (len(time), 1))
    made = simulate(graph, Inputs(time=time, values=values), seed=3, start={"th": 1.5, "T.lagged": 294.65})
    mean, covariance = solved(core, packed(core.spec, samples_of(time, made.inputs, made.outputs)))
    assert np.all(np.abs(mean - [1.5, 294.65]) < 3.0 * np.sqrt(np.diag(covariance)))
    assert mean == pytest.approx([1.5, 294.65], abs=0.4)


@pytest.mark.parametrize("at", [0, 1])
def test_a_wild_value_among_the_first_readings_leads_no_start(at: int) -> None:
    """It is left out when the first samples judge each other: who shows 3000 degC once has no warm motor before him."""
    _, core, samples, true = driven(135.0, 100.0)
    wild = replace(samples[at], y=np.where(np.arange(4) == 3, 3273.15, samples[at].y))
    monitor, _ = run(core, (*samples[:at], wild, *samples[at + 1 :]))
    assert monitor.numbers("healthy.lane")[: len(true)] == pytest.approx(true, rel=0.03)


@cache
def restated(name: str, *states: tuple[tuple[str, Any], ...]) -> Core:
    """The core of a plant with other fields of what is known of the start of its first states."""
    graph, spec = graph_of(name), spec_of(name)
    known = [replace(state, **dict(fields)) for state, fields in zip(spec.states, states, strict=False)]
    return build_core(build_plant(graph), replace(spec, states=(*known, *spec.states[len(known) :])))


def stated(mean: float, sd: float) -> tuple[tuple[str, Any], ...]:
    """A start that is stated."""
    return ("start_mean", mean), ("start_sd", sd)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(
    ("name", "start", "true", "good"),
    [
        ("tank", {"tank.q": TANK_START}, [1.3e5 * TANK_START], [180.0]),
        ("tank", {"tank.q": 0.0}, [0.0], [180.0]),
        ("dc_motor_current", {"L.p": 2.5 * 1.5, "J.p": 1.5 * -2.0}, [1.5, -2.0], [0.2, 0.1]),
        ("dc_motor", {"L.p": 2.5 * 1.5, "J.p": 1.5 * 4.0}, [1.5, 4.0], [1.0, 0.2]),
        ("rc", {"C.q": 1e-4 * 8.0}, [8.0], [0.2]),
    ],
)
def test_start_is_found(name: str, start: dict[str, float], true: list[float], good: list[float], seed: int) -> None:
    """The start is within three of its own standard deviations, and these are no larger than the data allow."""
    mean, covariance = solved(*started(name, start, seed))
    sd = np.sqrt(np.diag(covariance))
    assert np.all(np.abs(mean - true) < 3.0 * sd)
    assert np.all(sd < 3.0 * np.array(good))
    assert np.all(np.linalg.eigvalsh(covariance) > 0.0)


def test_missing_values_do_not_count() -> None:
    """What stands in a missing value changes nothing, and the rest is enough."""
    core, rows = started("tank", {"tank.q": TANK_START}, 5)
    place = core.spec.sample_fields
    rows[3:17, place["use"]] = 0.0
    other = rows.copy()
    other[3:17, place["y"]] = 1e9
    one, two = core.solve_start(rows), core.solve_start(other)
    assert np.array_equal(one[0], two[0])
    assert np.array_equal(one[1], two[1])
    assert one[0][0] == pytest.approx(1.3e5 * TANK_START, abs=3.0 * np.sqrt(one[1][0, 0]))


@pytest.mark.parametrize("off", [-2.0, 0.0, 2.0])
def test_stated_start_may_be_off(off: float) -> None:
    """A start that is stated beside others that are not is known to its sd, and does not put these off."""
    core, true = restated("dc_motor", (*stated(1.5, 0.3), ("jumps", ()))), np.array([1.5 - 0.3 * off, -2.0])
    rows = started("dc_motor", {"L.p": 2.5 * true[0], "J.p": 1.5 * true[1]}, 1)[1]
    mean, covariance = solved(core, rows)
    error = mean - true
    assert error @ np.linalg.solve(covariance, error) < 4.0


def test_exact_start_stays() -> None:
    """A start that is stated with no uncertainty is exact; the others are solved."""
    core = restated("dc_motor_current", (*stated(1.4, 0.0), ("jumps", ())))
    mean, covariance = solved(core, started("dc_motor_current", MOTOR, 1)[1])
    assert mean[0] == 1.4
    assert covariance[0].tolist() == [0.0, 0.0]
    assert covariance[1, 1] > 0.0


def test_no_output_in_the_first_samples() -> None:
    """Where the first samples have no output at all, the filter still finds the plant once outputs come."""
    _, spec, core = plant("dc_motor_current")
    samples = list(recorded("dc_motor_current", 400))
    nothing = np.full(2, np.nan)
    samples[:40] = [replace(item, y=nothing) for item in samples[:40]]
    monitor, reports = run(core, samples)
    assert monitor.number("clock.alarm") < 0
    sd = np.sqrt(np.diag(unpack(spec, monitor.numbers("healthy.lane")[spec.covariance_slice])))
    assert np.all(np.isfinite(sd))
    assert np.all(sd[:2] < [1.0, 1.0])
    assert np.all(np.abs(reports[-1].expected - samples[-1].y) < 6.0 * np.sqrt(reports[-1].variance))


@pytest.mark.parametrize("name", ["dc_motor", "dc_motor_current", "rlc"])
def test_plant_at_rest_without_outputs(name: str) -> None:
    """Where the inputs are zero and the first outputs are missing, the covariance is still one once outputs come."""
    graph, spec, core = plant(name)
    time = np.asarray(np.arange(46) * (graph.sample_time or 1.0), dtype=np.float64)
    made = simulate(graph, Inputs(time=time, values=np.zeros((46, 1))), seed=1)
    outputs = np.where(np.arange(46)[:, None] < 40, np.nan, made.outputs)
    monitor, reports = run(core, samples_of(time, np.zeros((46, 1)), outputs))
    assert all(report.status is not Status.LOST for report in reports)
    full = unpack(spec, monitor.numbers("healthy.lane")[spec.covariance_slice])
    sd = np.sqrt(np.diag(full))
    assert np.linalg.eigvalsh(full / np.outer(sd, sd)).min() > 1e-9


def test_a_sensor_of_a_sum_that_is_far_too_precise() -> None:
    """However precise a sensor is that shows two states only together, the start is found and their sum is known."""
    text = TWO_STORES.replace("1e-6 V", "1e-12 V")
    spec, core = build_engine(parse_model(text, file="two"))
    rows, place = np.zeros((START_SAMPLES, spec.n_sample)), spec.sample_fields
    rows[1:, place["dt"]] = rows[:, place["scale"]] = rows[:, place["use"]] = 1.0
    rows[:, place["fresh"]] = spec.input_variance
    rows[:, place["u"]] = rows[:, place["u_before"]] = rows[:, place["y"]] = 3e6  # settled
    mean, covariance = solved(core, rows)
    assert mean.sum() == pytest.approx(3e6, rel=1e-3)
    assert np.all(np.isfinite(covariance))
    assert float(covariance.sum()) < 1.0


PRESS = """
name: press with accumulator
sample_time: 10 ms
inputs: {n: {unit: rpm, noise: 3 rpm}, xv: {unit: percent}}
components:
  pump: {type: Sf, law: f = D*n, parameters: {D: 2.55 cm^3/rad}}
  slip: {type: R, law: f = kl*e, parameters: {kl: 0.05 l/min/bar}}
  acc: {type: C, law: e = K*q, parameters: {K: 60 bar/l}}
  valve: {type: R, law: "f*abs(f) = (kv*xv)**2*e", parameters: {kv: 0.03 l/min/bar^0.5/percent}}
  cyl: {type: TF, law: [e2 = A*e1, f1 = A*f2], parameters: {A: 12 cm^2}}
  mass: {type: I, parameters: {m: 200 kg}}
  fric: {type: R, parameters: {b: 4000 N*s/m}}
  load: {type: Se, law: e = F, parameters: {F: 3 kN}}
junctions: {line: 0, feed: 1, rod: 1}
bonds: [pump -> line -> slip, line -> acc, line -> feed -> valve, feed -> cyl -> rod -> mass, rod -> fric, rod -> load]
sensors: {p: {reads: line.e, unit: bar, noise: 0.3 bar}, v: {reads: rod.f, unit: mm/s, noise: 2 mm/s}}
"""


def test_a_plant_whose_steps_run_away_starts_where_its_sensors_say() -> None:
    """What the nominal plant is said to settle at is far beyond what the sensors read, so it counts nothing."""
    graph = parse_model(PRESS)
    spec, core = build_engine(graph)
    time = np.asarray(np.arange(START_SAMPLES) * 0.01, dtype=np.float64)
    inputs = Inputs(time=time, values=np.tile([1160.0 * 2.0 * np.pi / 60.0, 20.0], (len(time), 1)))
    made = simulate(graph, inputs, seed=1, start={"acc.q": 1e-3, "mass.p": 20.0})
    samples = [Sample(time=t, dt=0.01, u=u, y=y) for t, u, y in zip(time, made.inputs, made.outputs, strict=True)]
    mean, covariance = solved(core, packed(spec, tuple(samples)))
    assert [state.name for state in spec.states] == ["line.e", "rod.f"]
    assert np.all(np.abs(mean - [60e5, 0.1]) < 4.0 * np.sqrt(np.diag(covariance)))
    assert np.all(np.abs(mean / [60e5, 0.1] - 1.0) < 0.05)


GAS = """
name: two vessels of compressed air
sample_time: 1 s
inputs: {{w: {{unit: g/s}}}}
constants: {{RT: 85000 J/kg, eps: 1 Pa, usual: 7 bar}}
components:
  source: {{type: Sf, law: f = w}}
  one: {{type: C, law: e = q*RT/V1, parameters: {{V1: 5 m^3}}}}
  dryer: {{type: R, law: "{law}", parameters: {{K: 1.3e13 Pa^2*s^2/kg^2}}}}
  two: {{type: C, law: e = q*RT/V2, parameters: {{V2: 1.6 m^3}}}}
  user: {{type: R, law: f = e/R, parameters: {{R: 1e7 Pa*s/kg}}}}
junctions: {{a: 0, line: 1, b: 0}}
bonds: [source -> a -> one, a -> line -> dryer, line -> b -> two, b -> user]
sensors:
  p1: {{reads: a.e, unit: bar, noise: {noise} bar}}
  p2: {{reads: b.e, unit: bar, noise: {noise} bar}}
"""


@pytest.mark.parametrize("noise", [0.005, 0.5])
@pytest.mark.parametrize(
    "law", ["e = K*f*abs(f)/(a.e + b.e)", "e = K*f*abs(f)/usual", "e = K*f*abs(f)/(a.e + b.e + eps)"]
)
def test_laws_without_a_value_where_all_is_empty(law: str, noise: float) -> None:
    """The flow has no value at no pressure, or no slope between equal ones: the start is where the sensors say."""
    spec, core = build_engine(graph := parse_model(GAS.format(law=law, noise=noise)))
    time = np.asarray(np.arange(START_SAMPLES), dtype=np.float64)
    inputs = Inputs(time=time, values=np.full((len(time), 1), 0.07))
    made = simulate(graph, inputs, seed=1, start={"one.q": 7.2e5 * 5.0 / 85000.0, "two.q": 7.0e5 * 1.6 / 85000.0})
    samples = [Sample(time=t, dt=1.0, u=u, y=y) for t, u, y in zip(time, made.inputs, made.outputs, strict=True)]
    mean, covariance = solved(core, packed(spec, tuple(samples)))
    assert [state.name for state in spec.states] == ["a.e", "b.e"]
    assert np.all(np.abs(mean - [7.2e5, 7.0e5]) < 4.0 * np.sqrt(np.diag(covariance)))
    assert np.all(np.abs(mean - [7.2e5, 7.0e5]) < 1e5 * noise)


NETWORK = """
name: compressed air for two halls
sample_time: 1 s
inputs: {speed: {unit: percent}, users: {}}
constants: {full: 100 percent, ambient: 101325 Pa}
components:
  compressor: {type: Sf, law: f = Q*speed/full, parameters: {Q: 0.125 m^3/s}}
  receiver: {type: C, law: q = C1*e, parameters: {C1: 3e-5 m^3/Pa}}
  dryer: {type: R, law: e = Kd*f*abs(f), parameters: {Kd: 4.5e6 Pa*s^2/m^6}}
  near: {type: C, law: q = C2*e, parameters: {C2: 1.3e-5 m^3/Pa}}
  presses: {type: Sf, law: f = G*users, parameters: {G: 0.0055 m^3/s}}
  leaks: {type: R, law: f = L*(e + ambient), parameters: {L: 7.5e-9 m^3/s/Pa}}
  pipe: {type: R, law: e = Kp*f*abs(f), parameters: {Kp: 1.4e7 Pa*s^2/m^6}}
  far: {type: C, law: q = C3*e, parameters: {C3: 8e-6 m^3/Pa}}
  nozzle: {type: R, law: f = Kn*(e + ambient), parameters: {Kn: 4.3e-8 m^3/s/Pa}}
junctions: {a: 0, dry: 1, b: 0, ring: 1, c: 0}
bonds: [compressor -> a -> receiver, a -> dry -> b -> near, dry -> dryer, b -> presses, b -> leaks,
  b -> ring -> c -> far, ring -> pipe, c -> nozzle]
sensors:
  p1: {reads: a.e, unit: kPa, noise: 3 kPa}
  p2: {reads: b.e, unit: kPa, noise: 3 kPa}
  p3: {reads: c.e, unit: kPa, noise: 3 kPa}
"""


@pytest.mark.parametrize("capacity", ["7.9e-6", "8.0e-6", "8.1e-6", "8.3e-6", "8.6e-6"])
def test_where_only_the_very_zero_has_values_a_start_is_sought_from_elsewhere(capacity: str) -> None:
    """Between equal pressures a turbulent flow has no slope: with all at zero the plant has a course, else none.

    By rounding, so that one capacity does and another does not. No state stays at zero where its sensor reads 680 kPa.
    """
    graph = parse_model(NETWORK.replace("8e-6", capacity))
    spec, core = build_engine(graph)
    time = np.asarray(np.arange(START_SAMPLES) * 1.0, dtype=np.float64)
    inputs = Inputs(time=time, values=np.tile([0.62, 7.0], (len(time), 1)))
    true = {"receiver.q": 3e-5 * 720e3, "near.q": 1.3e-5 * 695e3, "far.q": float(capacity) * 680e3}
    made = simulate(graph, inputs, seed=1, start=true)
    samples = [Sample(time=t, dt=1.0, u=u, y=y) for t, u, y in zip(time, made.inputs, made.outputs, strict=True)]
    mean, covariance = solved(core, packed(spec, tuple(samples)))
    assert [state.name for state in spec.states] == ["a.e", "b.e", "c.e"]
    assert np.all(np.abs(mean - made.outputs[0]) < 6.0 * 3e3)
    assert np.all(np.sqrt(np.diag(covariance)) < 20e3)


BELT = """
name: belt
sample_time: 1 s
inputs: {torque: {}, load: {}}
components:
  motor: {type: Se, law: e = torque}
  feed: {type: Sf, law: f = load}
  inertia: {type: I, law: p = J*f, parameters: {J: {nominal: 20, accuracy: 5 %}}}
  rolling: {type: R, law: e = mu*belt.e*tanh(f/0.4), parameters: {mu: {nominal: 0.05, accuracy: 5 %}}}
  bearing: {type: R, law: e = b*f, parameters: {b: {nominal: 4, accuracy: 5 %}}}
  mass: {type: C, law: q = 10*e}
  falls: {type: Sf, law: f = belt.e*drum.f}
  hall: {type: Se, law: e = 290}
  wall: {type: R, law: f = e/tau, parameters: {tau: {nominal: 20 s, accuracy: 5 %}}}
  housing: {type: C, law: q = 50*e}
junctions: {drum: 1, belt: 0, cooling: 1, house: 0}
bonds: [motor -> drum -> inertia, drum -> rolling, drum -> bearing, feed -> belt -> mass, belt -> falls,
        hall -> cooling -> house -> housing, cooling -> wall]
sensors: {speed: {reads: drum.f, noise: 0.02}, warmth: {reads: house.e, noise: 0.1}}
"""


@pytest.mark.parametrize("seed", range(3))
def test_what_nothing_shows_of_a_plant_at_rest_is_about_as_in_use(seed: int) -> None:
    """A belt that stands has any load: the noise of the encoder would be one of 1e14 kg on it."""
    graph = parse_model(BELT)
    spec, core = build_engine(graph)
    read = np.random.default_rng(seed).normal([0.0, 290.0], [0.02, 0.1], (40, 2))
    given = tuple(Sample(time=float(k), dt=float(k > 0), u=np.zeros(2), y=y) for k, y in enumerate(read))
    mean, covariance = solved(core, packed(spec, given))
    place = [item.name for item in spec.states].index("belt.e")
    assert 0.0 < spec.states[place].usual < 1e3
    assert np.hypot(mean[place], np.sqrt(covariance[place, place])) < 10.0 * spec.states[place].usual


def test_what_lags_behind_an_input_is_about_where_that_is_though_all_else_is_far_off() -> None:
    """The same drive, whose voltage lags: what other states are shown to be says nothing of the size of that."""
    spec, core = build_engine(parse_model(HOT_DRIVE.replace("voltage: {unit: V}", "voltage: {unit: V, lag: 1 s}")))
    _, _, samples, _ = driven(60.0, 100.0)
    rows = packed(spec, samples)
    rows[:, spec.sample_fields["use"]] = [0.0, 0.0, 0.0, 1.0]  # the temperature alone is read, which hardly tells of it
    mean, covariance = solved(core, rows)
    assert mean[-1] == pytest.approx(60.0, abs=6.0)
    assert np.sqrt(covariance[-1, -1]) == pytest.approx(18.0, rel=0.01)  # thrice a tenth of 60 V
