"""Two faults of different kinds at once: they are found together, accepted, rejected and saved together."""

from collections.abc import Sequence
from functools import cache

import numpy as np
import pytest

from faultbond.contract.couples import n_coupled, plan_couples
from faultbond.contract.findings import Candidate, Untested
from faultbond.contract.samples import Sample
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.names import find_hypothesis
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from made import EXAMPLES, differing, graph_of, plant_in_full, run, samples_of, spec_of

NAME = "dc_motor_current"
SPEC = spec_of(NAME)
ROWS, BEGINS = 700, 5.0
SENSOR = Fault(parameter="omega.bias", value=0.6, start=BEGINS)
COMPONENT = Fault(parameter="R", factor=1.5, start=BEGINS)
STORE = Fault(parameter="J", factor=1.5, start=BEGINS)
INPUT = Fault(parameter="V.bias", value=-1.5, start=BEGINS)
OTHER = Fault(parameter="i.bias", value=0.3, start=BEGINS)
STUCK = Fault(parameter="omega.stuck", value=3.0, start=BEGINS)
DRIFT = Fault(parameter="R", factor=1.6, start=BEGINS, end=ROWS * 0.02)


def core() -> Core:
    """The motor's core, which is compiled when the first test asks."""
    return plant_in_full(NAME)[2]


@cache
def recording(faults: tuple[Fault, ...]) -> tuple[Sample, ...]:
    """The motor with these faults."""
    time = np.asarray(np.arange(ROWS) * 0.02, dtype=np.float64)
    voltage = random_steps(time, np.random.default_rng(6), low=2, high=12, shortest=0.5, longest=1.5)
    made = simulate(graph_of(NAME), Inputs(time=time, values=voltage[:, None]), faults, seed=12)
    return samples_of(time, made.inputs, made.outputs)


@cache
def ended(faults: tuple[Fault, ...]) -> Monitor:
    """The monitor at the end."""
    return run(core(), recording(faults))[0]


def first_of(faults: tuple[Fault, ...]) -> Candidate:
    """What comes first at the end, without anything unexplained."""
    diagnosis = ended(faults).conclude()
    assert diagnosis.unexplained is None
    return diagnosis.candidates[0]


def near(candidate: Candidate, values: Sequence[float]) -> bool:
    """Whether all suspects have these values, within four standard deviations and a tenth."""
    pairs = zip(candidate.suspects, values, strict=True)
    return all(abs(item.estimate - value) < min(4.0 * item.sd, 0.1 * abs(value)) for item, value in pairs)


@pytest.mark.parametrize(
    ("faults", "kind", "values"),
    [
        ((SENSOR, COMPONENT), FaultKind.BIAS, {"omega.bias": 0.6, "R": 4.5}),
        ((INPUT, STORE), FaultKind.BIAS, {"V.bias": -1.5, "J": 2.25}),
        ((DRIFT, STORE), FaultKind.DRIFT, {"R": 4.8, "J": 2.25}),
        ((SENSOR, OTHER), FaultKind.BIAS, {"omega.bias": 0.6, "i.bias": 0.3}),
        ((SENSOR, INPUT), FaultKind.BIAS, {"omega.bias": 0.6, "V.bias": -1.5}),
        ((STUCK, OTHER), FaultKind.STUCK, {"omega.stuck": 3.0, "i.bias": 0.3}),
    ],
)
def test_two_faults_of_different_kinds(faults: tuple[Fault, ...], kind: FaultKind, values: dict[str, float]) -> None:
    """A sensor and a component, an input and a store that keeps its content, a drift and a step, two instruments.

    Both come first, and are as large. What is said of the slot comes first, and only a drift has a rate.
    """
    best = first_of(faults)
    assert (best.parameters, best.kind) == (tuple(values), kind)
    assert best.probability > 0.99
    assert near(best, list(values.values()))
    assert [item.rate is None for item in best.suspects] == [kind is not FaultKind.DRIFT, True]


@pytest.mark.parametrize("fault", [SENSOR, COMPONENT, STORE])
def test_of_one_fault_nothing_is_made_of_two(fault: Fault) -> None:
    """Where one thing is wrong it comes first, and alone in its group, though all couples with it are tested."""
    best = first_of((fault,))
    diagnosis = ended((fault,)).conclude()
    assert best.parameters == (fault.parameter,)
    assert [item.group for item in diagnosis.candidates].count(True) == 1
    pairs = [item.parameters for item in diagnosis.candidates if len(item.parameters) == 2]
    assert sum(fault.parameter in names and any("." in name for name in names) for names in pairs) >= 3


@cache
def wandering() -> Core:
    """The core of the motor whose meter of speed is off by 0.3 rad/s or so, by another value every 100 s."""
    text = (EXAMPLES / NAME / "model.yaml").read_text(encoding="utf-8")
    return build_engine(parse_model(f"{text}\nslow_error: {{omega: 0.3 rad/s over 100 s}}\n", "model.yaml"))[1]


@pytest.mark.parametrize("faults", [(SENSOR, COMPONENT), (SENSOR,), (COMPONENT,)])
def test_a_second_fault_is_no_jump_of_a_slow_error(faults: tuple[Fault, ...]) -> None:
    """A meter that is off at once, by two sd of its slow error, is named beside a component, and alone."""
    best = run(wandering(), recording(faults))[0].conclude().candidates[0]
    assert best.parameters == tuple(item.parameter for item in faults)
    assert best.probability > 0.99


ROOMS = """name: two rooms
sample_time: 10 s
accuracy: 1 %
inputs: {u1: {unit: percent}, u2: {unit: percent}}
components:
  heater1: {type: Sf, law: f = H1*u1, parameters: {H1: 60 W/percent}}
  heater2: {type: Sf, law: f = H2*u2, parameters: {H2: 80 W/percent}}
  zone1: {type: C, parameters: {C1: 40 kJ/K}}
  zone2: {type: C, parameters: {C2: 60 kJ/K}}
  gap: {type: R, parameters: {R12: 0.05 K/W}}
  wall1: {type: R, parameters: {R1: 0.15 K/W}}
  wall2: {type: R, parameters: {R2: 0.12 K/W}}
junctions: {z1: 0, z2: 0, between: 1}
bonds: [heater1 -> z1 -> zone1, heater2 -> z2 -> zone2, z1 -> between -> z2, between -> gap, z1 -> wall1, z2 -> wall2]
sensors:
  T1: {reads: z1.e, unit: K, noise: 0.25 K}
  T2: {reads: z2.e, unit: K, noise: 0.25 K}
  P: {reads: heater1.f + heater2.f, unit: kW, noise: 0.05 kW}
slow_error: {T1: 1.5 K over 3 h, wall1.f: 4 % over 3 h, wall2.f: 4 % over 3 h, heater2.f: 1.6 % over 11 min}
"""


def ended_in_rooms(*faults: Fault) -> Monitor:
    """The monitor of two rooms at the end."""
    graph = parse_model(ROOMS, "model.yaml")
    time, random = np.asarray(10.0 * np.arange(700), dtype=np.float64), np.random.default_rng(0)
    power = np.column_stack([random_steps(time, random, low=5, high=60, shortest=1500, longest=4000) for _ in "12"])
    made = simulate(graph, Inputs(time=time, values=power), faults, seed=0)
    return run(build_engine(graph)[1], samples_of(time, made.inputs, made.outputs))[0]


def first_in_rooms(sensor: Fault, component: Fault) -> Candidate:
    """What comes first at the end where a thermometer of two rooms and a wall are at fault."""
    return ended_in_rooms(sensor, component).conclude().candidates[0]


AIR = """name: compressed air
sample_time: 2 s
inputs: {speed: {unit: percent}, valve: {unit: percent}}
components:
  compressor: {type: Sf, law: f = G*speed, parameters: {G: {nominal: 0.38 g/s/percent, accuracy: 1 %}}}
  receiver: {type: C, law: q = C1*e, parameters: {C1: {nominal: 6e-6 kg/Pa, accuracy: 1 %}}}
  line: {type: R, law: e = R*f*abs(f), parameters: {R: {nominal: 5e7 Pa*s^2/kg^2, accuracy: 1 %}}}
  buffer: {type: C, law: q = C2*e, parameters: {C2: {nominal: 3.6e-6 kg/Pa, accuracy: 1 %}}}
  consumer: {type: R, law: f = K*valve*sqrt(e), parameters: {K: {nominal: 5.8e-7 kg/s/percent/Pa^0.5, accuracy: 1 %}}}
junctions: {node1: 0, pipe: 1, node2: 0}
bonds: [compressor -> node1 -> receiver, node1 -> pipe -> line, pipe -> node2 -> buffer, node2 -> consumer]
sensors:
  p1: {reads: node1.e, unit: kPa, noise: 0.5 kPa}
  p2: {reads: node2.e, unit: kPa, noise: 0.4 kPa}
  flow: {reads: pipe.f, unit: g/s, noise: 0.15 g/s}
slow_error: {pipe.f: 3e-5 kg/s over 2 s, compressor.f: 2.4 % over 970 s}
"""


GAIN = Fault(parameter="speed.gain", value=0.85, start=1400.0)
FACTOR = Fault(parameter="G", factor=0.85, start=1400.0)
OUTLET = Fault(parameter="valve.gain", value=0.8, start=1400.0)
FOULING = Fault(parameter="R", factor=1.4, start=1400.0)
GAUGE = Fault(parameter="p1.bias", value=20e3, start=1400.0)


@pytest.mark.parametrize(
    ("gain", "beside", "names"),
    [
        (GAIN, FOULING, [{"G", "R"}, {"speed", "R"}]),
        (FACTOR, FOULING, [{"G", "R"}, {"speed", "R"}]),
        (OUTLET, FOULING, [{"K", "R"}, {"valve", "R"}]),
        (GAIN, GAUGE, [{"G", "p1"}, {"speed", "p1"}]),
    ],
)
def test_a_gain_of_an_input_and_a_factor_beside_it_are_alike(gain: Fault, beside: Fault, names: list[set[str]]) -> None:
    """Of G*speed nothing tells which changed, also beside a further fault: neither is sure, as each by itself.

    Which of them somebody has ruled out stays so, whatever the other says.
    """
    graph = parse_model(AIR, "model.yaml")
    time, random = np.asarray(2.0 * np.arange(1500), dtype=np.float64), np.random.default_rng(3)
    values = np.column_stack([random_steps(time, random, low=40, high=95, shortest=60, longest=300) for _ in "12"])
    made = simulate(graph, Inputs(time=time, values=values), (gain, beside), seed=1)
    monitor = run(build_engine(graph)[1], samples_of(time, made.inputs, made.outputs))[0]
    first, second, *_ = monitor.conclude().candidates
    assert [{item.parameter.partition(".")[0] for item in one.suspects} for one in (first, second)] == names
    assert second.group
    assert 0.05 < second.probability < 0.5 < first.probability < 0.95
    for out, left in ((first, second), (second, first)):
        rejecting = monitor.copy()
        rejecting.reject(out.hypothesis)
        likeliest, *others = rejecting.conclude().candidates
        assert likeliest.hypothesis == left.hypothesis
        assert all(item.probability == 0.0 for item in others if item.hypothesis == out.hypothesis)


HEATER = Fault(parameter="H2", factor=0.8, start=3000.0)
WALL = Fault(parameter="R1", factor=1.5, start=3000.0)
FIRST_ROOM, SECOND_ROOM = (Fault(parameter=f"T{k}.bias", value=4.0, start=3000.0) for k in (1, 2))


@pytest.mark.parametrize(("component", "sensor"), [(HEATER, SECOND_ROOM), (WALL, FIRST_ROOM)])
def test_what_is_the_same_as_two_instruments_is_tested_too(component: Fault, sensor: Fault) -> None:
    """Of a thermometer beside the gain of a heater, that beside the heater: there are more couples than places.

    Where it had no lanes the pair with the input was more than 99.9 % sure, and wrong where the heater had changed.
    """
    monitor = ended_in_rooms(component, sensor)
    spec, couples = monitor.core.spec, plan_couples(monitor.core.spec)
    tested = {couples[int(k)].hypothesis for k in monitor.numbers("bank.coupled") if k >= 0}
    mixed = {item.hypothesis for item in couples if item.slot >= len(spec.hypotheses) and item.parameter >= 0}
    assert len(mixed) > n_coupled(spec)[0] == len(mixed & tested)
    alike = {item.alike for item in couples if item.beside >= 0 and item.hypothesis in tested and item.alike in mixed}
    assert len(alike) > 2
    assert alike <= tested
    first, second, *_ = monitor.conclude().candidates
    assert component.parameter in first.parameters
    if component is HEATER:
        assert {frozenset(one.components) for one in (first, second)} == {
            frozenset({"T2", "heater2"}),
            frozenset({"T2", "u2"}),
        }
        assert first.probability < 0.95


def test_a_parameter_begins_where_it_can_be() -> None:
    """A wall that lets through three times as much is beyond 0 for who takes its law to be straight.

    With a thermometer that is off beside it both are named, and no heat capacity in place of the thermometer.
    """
    sensor, wall = (
        Fault(parameter="T1.bias", value=-5.0, start=3000.0),
        Fault(parameter="R2", factor=0.3, start=3000.0),
    )
    best = first_in_rooms(sensor, wall)
    assert best.parameters == ("T1.bias", "R2")
    assert best.probability > 0.95
    assert near(best, [-5.0, 0.036])


def test_each_kind_of_fault_of_an_instrument_is_tried_beside_a_parameter() -> None:
    """A wrong gain, which explains less than a bias and a drift do while the wall counts as healthy, is found."""
    sensor, gap = (
        Fault(parameter="T2.gain", value=1.1, start=3000.0),
        Fault(parameter="R12", factor=0.4, start=3000.0),
    )
    best = first_in_rooms(sensor, gap)
    assert (best.parameters, best.kind) == (("T2.gain", "R12"), FaultKind.GAIN)
    assert best.probability > 0.95
    assert near(best, [1.1, 0.02])


def test_none_is_tested_before_the_bank_is_renewed() -> None:
    """Soon after the alarm no couple has lanes, and none is a candidate; at the end as many have as can be tested."""
    alarm = int(ended((SENSOR, COMPONENT)).number("clock.alarm"))
    begun = run(core(), recording((SENSOR, COMPONENT))[: alarm + 25])[0]
    assert np.all(begun.numbers("bank.coupled") == -1.0)
    assert {item.hypothesis for item in begun.conclude().candidates} <= set(range(SPEC.n_begun))
    coupled = ended((SENSOR, COMPONENT)).numbers("bank.coupled")
    couples = plan_couples(SPEC)
    assert len(coupled) == sum(n_coupled(SPEC))
    chosen = [couples[int(k)] for k in coupled if k >= 0]
    assert len({(item.slot, item.parameter, item.beside) for item in chosen}) == len(chosen)
    assert sum(item.parameter >= 0 and item.slot >= len(SPEC.hypotheses) for item in chosen) == n_coupled(SPEC)[0]
    assert sum(item.beside >= 0 for item in chosen) == n_coupled(SPEC)[1]


def test_of_two_parameters_that_lead_nobody_is_sure_before_couples_are_tested() -> None:
    """They count among the untested sets, without a bound; one parameter that leads is likelier than any of them."""
    for faults, counts in (((COMPONENT, STORE), True), ((COMPONENT,), False)):
        alarm = int(ended(faults).number("clock.alarm"))
        early = run(core(), recording(faults)[: alarm + 25])[0]
        assert np.all(early.numbers("bank.coupled") == -1.0)
        best, *_ = early.conclude().candidates
        assert (len(best.parameters) == 2) is counts
        couples = [item for item in plan_couples(SPEC) if item.slot >= len(SPEC.hypotheses)]
        told = early.conclude().untested
        assert told == (Untested(sets=len(couples), probability=1.0) if counts else None)
        sensor = find_hypothesis(SPEC, ["omega"])
        early.reject(sensor)
        left = [item for item in couples if sensor not in (item.slot, item.beside)]
        assert early.conclude().untested == (Untested(sets=len(left), probability=1.0) if counts else None)
        assert ended(faults).conclude().untested is None


def test_an_accepted_couple_becomes_the_healthy_model() -> None:
    """The sensor is corrected and the component keeps its new value; both are normal from then on."""
    samples, late = recording((SENSOR, COMPONENT)), ROWS - 150
    monitor, _ = run(core(), samples[:late])
    best = monitor.conclude().candidates[0]
    accepted = monitor.accept(best.hypothesis)
    assert accepted.parameters == ("omega.bias", "R")
    assert monitor.numbers("normal.offset")[0] == pytest.approx(best.suspects[0].estimate)
    assert np.all(monitor.numbers("normal.offset")[1:] == 0.0)
    resistance = monitor.numbers("healthy.lane")[SPEC.parameter_slice.start]
    assert SPEC.parameters[0].scale * resistance == pytest.approx(best.suspects[1].estimate)
    _, reports = run(core(), samples[late:], monitor)
    assert all(report.detection is None for report in reports)


@pytest.mark.parametrize("repaired", [False, True])
def test_two_instruments_are_accepted_and_repaired(repaired: bool) -> None:
    """Accepted, both are corrected by their biases and no parameter has moved; repaired, both are as declared."""
    samples, late = recording((SENSOR, INPUT)), ROWS - 150
    monitor, _ = run(core(), samples[:late])
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("omega.bias", "V.bias")
    monitor.accept(best.hypothesis, repaired=repaired)
    wanted = [0.0, 0.0] if repaired else [item.estimate for item in best.suspects]
    assert monitor.numbers("normal.offset") == pytest.approx([wanted[0], 0.0])
    assert monitor.numbers("normal.input_offset") == pytest.approx([wanted[1]])
    assert monitor.numbers("healthy.lane")[SPEC.parameter_slice] == pytest.approx(1.0, abs=0.05)
    _, reports = run(core(), samples[late:], monitor)
    assert any(report.detection is not None for report in reports) is repaired


def test_of_two_instruments_that_are_rejected_each_stays() -> None:
    """Who has ruled out that both are off has said nothing of either."""
    monitor = ended((SENSOR, OTHER)).copy()
    both = find_hypothesis(SPEC, ["omega", "i"])
    monitor.reject(both)
    assert np.flatnonzero(monitor.numbers("bank.rejected")).tolist() == [both]


def test_with_an_instrument_all_couples_with_it_are_rejected() -> None:
    """Who has found the sensor healthy has said so of all sets with it; of a rejected couple each part stays."""
    monitor = ended((SENSOR, COMPONENT)).copy()
    couple, sensor = (find_hypothesis(SPEC, names) for names in (["omega", "R"], ["omega"]))
    monitor.reject(couple)
    left = {item.hypothesis for item in monitor.conclude().candidates if item.probability > 0.0}
    assert couple not in left
    assert np.flatnonzero(monitor.numbers("bank.rejected")).tolist() == [couple]
    monitor.reject(sensor)
    out = {k for k in range(SPEC.n_hypotheses) if "omega" in {item.name for item in SPEC.instruments_in(k)}}
    assert set(np.flatnonzero(monitor.numbers("bank.rejected"))) == out
    assert len(out) == 8


def test_couples_are_saved_too() -> None:
    """Saved and restored while couples begin, and after, the run goes on to the same end, to the last bit."""
    samples = recording((SENSOR, COMPONENT))
    stage = 5  # of the work, that of couples
    monitor, seen = Monitor(core()), 0
    for k, sample in enumerate(samples):
        monitor.step(sample)
        kind, at, done = (monitor.number(f"job.{name}") for name in ("kind", "stage", "pass"))
        amid = kind > 0 and at == stage and done > 0
        if not amid and k != ROWS - 100:
            continue
        seen += amid
        restored = Monitor(core(), monitor.save())
        assert not differing(restored, monitor)
        if seen in {1, 3} or k == ROWS - 100:
            again, _ = run(core(), samples[k + 1 :], restored)
            assert not differing(again, ended((SENSOR, COMPONENT)))
    assert seen >= 3


MAIN = """
name: water main
sample_time: 1 s
accuracy: 3 %
constants: {g: 9810 Pa/m, full: 100 percent}
inputs: {n: {unit: percent}}
components:
  pump: {type: Se, law: e = H*(n/full)**2, parameters: {H: 400 kPa}}
  water: {type: I, law: p = M*f, parameters: {M: {nominal: 3e7 Pa*s^2/m^3, suspect: no}}}
  pipe: {type: R, law: e = K*f*abs(f), parameters: {K: 9e7 Pa*s^2/m^6}}
  leak:
    type: R
    law: f = L*sqrt(e)
    parameters:
      L: {nominal: 0 m^3/s/Pa^0.5, accuracy: 5e-7 m^3/s/Pa^0.5, change: 1e-5 m^3/s/Pa^0.5, range: [0 m^3/s/Pa^0.5, inf]}
  tank: {type: C, law: e = g*q/A, parameters: {A: 12 m^2}}
  outlet: {type: R, law: e = Ko*f*abs(f), parameters: {Ko: 2e7 Pa*s^2/m^6}}
junctions: {head: 0, main: 1, node: 0}
bonds: [pump -> head -> leak, head -> main -> water, main -> pipe, main -> node -> tank, node -> outlet]
sensors:
  flow: {reads: pump.f, unit: l/s, noise: 0.25 l/s}
  level: {reads: tank.e/g, unit: m, noise: 8 mm}
  inflow: {reads: main.f, unit: l/s, noise: 0.4 l/s}
"""


@pytest.mark.parametrize("seed", [0, 1])
@pytest.mark.parametrize(("begins", "least"), [(300.0, 0.2), (300.5, 0.01), (300.9, 0.2)])
def test_a_sensor_and_a_component_begin_at_some_moment_of_a_sample(seed: int, begins: float, least: float) -> None:
    """A reading is wrong at once, and the water slows down from then on, so neither is a sample early.

    While the pump stands still a leak does about what the meter does, but for those first seconds: it led by
    hundreds of nats.
    """
    graph, time = parse_model(MAIN), np.arange(400.0)
    speed = np.where(time < 150.0, 90.0, np.where(time < 220.0, 75.0, 95.0))[:, None]
    faults = [Fault(parameter="H", factor=0.85, start=begins), Fault(parameter="flow.bias", value=3e-3, start=begins)]
    made = simulate(graph, Inputs(time=time, values=speed), faults, seed=seed, start={"tank.q": 360.0})
    _, engine = build_engine(graph)
    found = run(engine, samples_of(time, made.inputs, made.outputs))[0].conclude()
    both = next(item for item in found.candidates if set(item.components) == {"flow", "pump"})
    assert both.probability > least
    values = {item.parameter: item.estimate for item in both.suspects}
    assert values["H"] == pytest.approx(0.85 * 400e3, rel=0.02)
    assert values["flow.bias"] == pytest.approx(3e-3, rel=0.1)
