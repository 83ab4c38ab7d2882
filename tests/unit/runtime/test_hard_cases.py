"""Readings far off, filters that are lost, corrections that were accepted: what must not spoil the diagnosis."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.contract.core_settings import core_settings
from faultbond.contract.findings import Diagnosis
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.samples import Sample, Status
from faultbond.model.text import parse_model
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import find_hypothesis, hypothesis_names
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine
from made import EXAMPLES, plant, recorded, run, samples_of

WILD_BEFORE = 100
FAULT = Fault(parameter="C", factor=1.6, start=20.0)


def diagnosed(samples: list[Sample]) -> tuple[Monitor, Diagnosis]:
    """Pass samples of the R-L-C circuit; give the monitor and the last diagnosis."""
    monitor, _ = run(plant("rlc")[2], samples)
    found = monitor.finish()
    assert found is not None
    return monitor, found


@pytest.fixture(scope="module")
def samples() -> list[Sample]:
    """The circuit whose C changes at 20 s, up to some while after the alarm."""
    return list(recorded("rlc", 1100, FAULT))


@pytest.mark.parametrize("value", [1e9, 1e30, 1e300])
def test_one_wild_reading_long_before_the_fault(samples: list[Sample], value: float) -> None:
    """It costs each hypothesis as much, and no digit of what comes later."""
    wild = [*samples]
    wild[WILD_BEFORE] = replace(wild[WILD_BEFORE], y=np.full_like(wild[WILD_BEFORE].y, value))
    _, found = diagnosed(wild)
    assert found.candidates[0].parameters == ("C",)
    assert found.candidates[0].probability > 0.95


@pytest.mark.parametrize("value", [100.0, 1000.0, 1e300])
def test_one_wild_reading_after_the_alarm(samples: list[Sample], value: float) -> None:
    """No lane is thrown off by it, and no sensor is noisy because of it."""
    monitor, _ = diagnosed(samples)
    place = int(monitor.number("clock.alarm")) + 60
    wild = [*samples]
    wild[place] = replace(wild[place], y=np.array([*wild[place].y[:-1], value]))
    _, found = diagnosed(wild)
    assert found.candidates[0].parameters == ("C",)
    assert found.candidates[0].probability > 0.95
    assert found.unexplained is None


def test_a_bank_goes_on_while_the_healthy_filter_begins_again(samples: list[Sample]) -> None:
    """A healthy lane that is lost takes nothing from the lanes of the bank, nor are these renewed from nowhere."""
    _, spec, core = plant("rlc")
    whole, expected = diagnosed(samples)
    after = int(whole.number("clock.alarm") + core_settings()["FIRST_RENEWAL"]) + 5
    lost, _ = run(core, samples[:after])
    lost.go_on(np.full((spec.n_numbers, 1), np.nan))
    reports = [lost.step(sample) for sample in samples[after:]]
    assert {Status.LOST, Status.STARTING} <= {report.status for report in reports}
    found = lost.finish()
    assert found is not None
    assert found.candidates[0].parameters == expected.candidates[0].parameters == ("C",)
    n = plan_lanes(spec).n_lanes
    here, there = (max(monitor.lane(k)[-1] for k in range(n)) for monitor in (lost, whole))
    assert here == pytest.approx(there, abs=60.0)


def test_a_held_input_is_corrected_too() -> None:
    """Where inputs are given when they change, an accepted bias acts at once, not from the next value on."""
    graph, spec, core = plant("rc")
    time = np.asarray(np.arange(900) * 0.02, dtype=np.float64)
    values = random_steps(time, np.random.default_rng(1), low=2.0, high=12.0, shortest=2.0, longest=4.0)[:, None]
    made = simulate(graph, Inputs(time=time, values=values), [Fault(parameter="V.bias", value=2.0, start=8.0)], seed=1)
    moved = np.diff(values[:, 0], prepend=np.nan) != 0.0
    given = [
        replace(sample, u=values[k].copy() if moved[k] else np.array([np.nan]))
        for k, sample in enumerate(samples_of(time, made.inputs, made.outputs))
    ]
    monitor, reports = run(core, given[:640])
    assert any(report.detection for report in reports)
    before = monitor.number("inputs.held")
    monitor.accept(find_hypothesis(spec, ["V"]))
    assert monitor.number("inputs.held") - before == pytest.approx(2.0, abs=0.3)
    assert not any(monitor.step(sample).detection for sample in given[640:])


def test_noise_comes_on_top_of_what_was_accepted() -> None:
    """A sensor that was accepted with three times its noise, and has nine times, is told with nine times."""
    _, spec, core = plant("rc")
    generator, declared = np.random.default_rng(0), spec.outputs[0].noise
    times = np.repeat([1.0, 3.0, 9.0], [600, 700, 700])
    noisy = [
        replace(sample, y=sample.y + generator.normal(0.0, declared * np.sqrt(more**2 - 1.0), 1))
        for sample, more in zip(recorded("rc", len(times)), times, strict=True)
    ]
    monitor, _ = run(core, noisy[:1200])
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("V_C.noise",)
    monitor.accept(best.hypothesis)
    sd = np.sqrt(np.mean([monitor.step(sample).variance for sample in noisy[1200:1300]]))
    assert sd == pytest.approx(3.0 * declared, rel=0.4)
    for sample in noisy[1300:]:
        monitor.step(sample)
    found = monitor.finish()
    assert found is not None
    (suspect,) = found.candidates[0].suspects
    assert suspect.estimate == pytest.approx(9.0 * declared, rel=0.35)


def test_an_accepted_noise_is_no_blanking() -> None:
    """However large: a sensor that counts as blanked would never raise an alarm again."""
    _, spec, core = plant("rc")
    monitor, _ = run(core, recorded("rc", 400))
    noise = monitor.numbers("normal.noise")
    quiet = list(recorded("rc", 1200))[400:]
    generator, accepted = np.random.default_rng(2), 0
    for _ in range(4):
        for item in quiet[:300]:
            monitor.step(replace(item, y=item.y + generator.normal(0.0, 300.0 * np.sqrt(noise), 1)))
        if monitor.number("clock.alarm") < 0:
            break
        monitor.accept(find_hypothesis(spec, ["V_C"]))
        accepted += 1
        noise = monitor.numbers("normal.noise")
        assert noise[0] < spec.thresholds.blank_factor
    assert accepted


def test_a_sensor_with_the_name_of_a_parameter_is_a_candidate_of_its_own() -> None:
    """What is accepted is the hypothesis that was asked for, not the first of that name."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8").replace("{V_C: {reads", "{C: {reads")
    spec, core = build_engine(parse_model(text))
    monitor, _ = run(core, recorded("rc", 450, Fault(parameter="C", factor=1.5, start=6.0)))
    sensor = len(spec.hypotheses) + [item.name for item in spec.instruments].index("C")
    (part,) = (k for k in range(len(spec.hypotheses)) if hypothesis_names(spec, k) == {"C"})
    by_number = {item.hypothesis: item.parameters for item in monitor.conclude().candidates}
    assert by_number[sensor][0].startswith("C.")
    assert by_number[part] == ("C",)
    assert monitor.copy().accept(sensor).parameters == by_number[sensor]
    assert monitor.accept(part).parameters == ("C",)


ONE_NUMBER = """
name: one number
sample_time: 0.1 s
inputs: {V: {unit: V}}
constants: {r: 10 ohm, c: 0.1 F}
components: {s: {type: Se, law: e = V}, R: {type: R, law: e = r*f}, C: {type: C, law: q = c*e}}
junctions: {j: 1}
bonds: [s -> j -> R, j -> C]
sensors: {v: {reads: C.e, unit: V, noise: 0.1 V}}
"""
ONE_PARAMETER = """
name: a resistor
sample_time: 0.1 s
inputs: {V: {unit: V}}
components: {s: {type: Se, law: e = V}, R: {type: R, parameters: {R: 10 ohm}}}
junctions: {j: 1}
bonds: [s -> j -> R]
sensors: {i: {reads: R.f, unit: A, noise: 0.01 A}}
"""


@pytest.mark.parametrize("text", [ONE_NUMBER, ONE_PARAMETER], ids=["one state", "one parameter"])
def test_a_filter_of_one_number_is_built(text: str) -> None:
    """The smallest plants are plants too."""
    spec, core = build_engine(parse_model(text))
    assert spec.n_joint == 1
    made = [Sample(time=0.1 * k, dt=0.1 * (k > 0), u=np.array([1.0]), y=np.array([0.1])) for k in range(40)]
    monitor, reports = run(core, made)
    assert np.isfinite(monitor.numbers("healthy.lane")).all()
    assert np.isfinite(reports[-1].expected).all()


PUMP = """
name: motor, pump and tank
sample_time: 0.2 s
constants: {d: 1e-5 m^3/rad, Ct: 5e-6 m^3/Pa}
inputs: {V: {unit: V}}
components:
  supply: {type: Se, law: e = V}
  winding: {type: R, parameters: {Ra: 0.8 ohm}}
  motor: {type: GY, parameters: {k: 0.3 V*s/rad}}
  rotor: {type: I, parameters: {J: 0.05 kg*m^2}}
  bearing: {type: R, parameters: {B: 0.01 N*m*s/rad}}
  pump: {type: TF, law: [e1 = d*e2, f2 = d*f1]}
  pipe: {type: R, law: e = Rp*f*abs(f), parameters: {Rp: 6e10 Pa*s^2/m^6}}
  tank: {type: C, law: e = q/Ct}
  drain: {type: R, law: f = cd*sqrt(abs(e))*sign(e), parameters: {cd: 3e-6 m^3/s/Pa^0.5}}
junctions: {circuit: 1, shaft: 1, line: 1, vessel: 0}
bonds: [supply -> circuit -> winding, circuit -> motor -> shaft -> rotor, shaft -> bearing,
  shaft -> pump -> line -> pipe, line -> vessel -> tank, vessel -> drain]
sensors:
  i: {reads: winding.f, unit: A, noise: 0.3 A}
  w: {reads: rotor.f, unit: rad/s, noise: 0.5 rad/s}
  p: {reads: vessel.e, unit: Pa, noise: 200 Pa}
"""


def test_a_jump_that_is_soon_forgotten() -> None:
    """A shaft that goes on with its momentum at a fault is itself again within a second; the alarm comes much later."""
    graph = parse_model(PUMP)
    _, core = build_engine(graph)
    time = np.arange(0.0, 160.0, 0.2)
    volts = np.random.default_rng(6).uniform(16.0, 40.0, 9)[(time / 20.0).astype(int)][:, None]
    fault = Fault(parameter="J", factor=1.3, start=83.3)
    made = simulate(graph, Inputs(time=time, values=volts), [fault], seed=4, start={"tank.q": 0.1})
    monitor, reports = run(core, samples_of(time, made.inputs, made.outputs))
    assert monitor.number("clock.alarm") - 83.3 / 0.2 > core_settings()["DENSE"]
    found = [report.diagnosis.candidates[0] for report in reports if report.diagnosis is not None]
    assert {best.parameters for best in found} == {("J",)}
    assert found[-1].suspects[0].estimate == pytest.approx(0.065, rel=0.03)


def test_the_true_fault_leaves_nothing_unexplained() -> None:
    """After a change of a resistance the lane that leads has small sums, and that of another parameter has not."""
    fault = Fault(parameter="R", factor=2.0, start=2.4)
    monitor, reports = run(plant("dc_motor_current")[2], recorded("dc_motor_current", 400, fault))
    diagnosis = [report.diagnosis for report in reports if report.diagnosis][-1]
    assert diagnosis.candidates[0].parameters == ("R",)
    assert diagnosis.unexplained is None
    sums = monitor.numbers("bank.sums").reshape(2 * len(monitor.spec.outputs), -1)
    assert np.sum(sums.max(axis=0) > monitor.spec.thresholds.cusum_limit) > 10
