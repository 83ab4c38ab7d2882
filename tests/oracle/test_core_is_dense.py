"""The core in C against the textbook filter with full matrices: every field of a sample, every kind of lane."""

from dataclasses import dataclass
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.ladders import ladder_text

from dense_filter import DenseFilter, dense_filter
from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from lanes import slot_lanes, suspect_lanes
from plants import NINE_SENSORS, pumped_tank

EXAMPLES = Path(__file__).parents[2] / "examples"
RANGES = {"percent": (40.0, 90.0, 30.0), "V": (2.0, 12.0, 0.5)}  # by unit: lowest, highest, shortest step in s
LAMP = """\
name: lamp
sample_time: 0.1 s
constants: {Vt: 0.1 V, top: 0.8 V, low: 20 mA}
inputs: {V: {unit: V, noise: 50 mV}}
components:
  source: {type: Se, law: e = V}
  series: {type: R, parameters: {R1: 10 ohm}}
  cell: {type: C, parameters: {C1: 0.1 F}}
  wire: {type: R, parameters: {R2: 5 ohm}}
  lamp: {type: R, parameters: {Is: 1e-6 A}, law: "f = Is*(exp(e/Vt) - 1)"}
  spur: {type: R, parameters: {R3: 10 ohm}}
  spare: {type: C, parameters: {C2: 5 mF}}
junctions: {first: 1, node: 0, branch: 1, side: 1}
bonds:
  - source -> first
  - first -> series
  - first -> node
  - node -> cell
  - node -> branch
  - branch -> wire
  - branch -> lamp
  - node -> side
  - side -> spur
  - side -> spare
sensors:
  i: {reads: "max(branch.f, low)", unit: A, noise: 1 mA}
  v: {reads: "min(node.e, top)", unit: V, noise: 10 mV}
  side: {reads: spare.e, unit: V, noise: 5 mV}
slow_error: {wire.e: 2 % over 60 s, v: 20 mV over 5 s}
"""
STARTS = {"tank": (0.0, 1e8), "cascaded_tanks": (4.0, 0.01), "ladder": (0.0, 1e-4)}  # and variances


@dataclass(frozen=True, kw_only=True, eq=False)
class Both:
    """A plant with the core and the textbook filter."""

    graph: BondGraph
    spec: EngineSpec
    core: Core
    dense: DenseFilter


@cache
def both(name: str) -> Both:
    """A built-in plant, the lamp, or a ladder."""
    made = {"lamp": LAMP, "ladder": ladder_text(3), "nine": NINE_SENSORS}
    made["late pump"] = pumped_tank(speed=", lag: 2 s, noise: 1 percent")
    made |= {
        f"{hold} lamp": LAMP.replace("noise: 50 mV}", f"noise: 50 mV, hold: {hold}}}") for hold in ("linear", "next")
    }
    graph = parse_model(made[name]) if name in made else load_model(EXAMPLES / name / "model.yaml")
    (spec, core), (same, dense) = build_engine(graph), dense_filter(graph)
    assert same == spec
    return Both(graph=graph, spec=spec, core=core, dense=dense)


def recording(plant: Both, rows: int) -> FloatArray:
    """Packed samples of a plant with noise and a fault, with every field of a sample in use somewhere."""
    graph, spec, generator = plant.graph, plant.spec, np.random.default_rng(11)
    dt = graph.sample_time or 1.0
    time = np.asarray(np.arange(rows) * dt, dtype=np.float64)
    columns = []
    for item in graph.inputs:
        low, high, shortest = RANGES.get(item.unit.text, (1.0, 2.0, 20 * dt))
        columns.append(random_steps(time, generator, low=low, high=high, shortest=shortest, longest=5 * shortest))
    begin = float(time[rows // 3])
    faults = [Fault(parameter=item.name, factor=1.6, start=begin) for item in graph.parameters if item.nominal][:1]
    inputs = Inputs(time=time, values=np.array(columns).reshape(-1, rows).T)
    made = simulate(graph, inputs, faults, seed=4)
    samples, place, size = np.zeros((rows, spec.n_sample)), spec.sample_fields, made.outputs.shape
    samples[1:, place["dt"]] = dt
    samples[rows // 2 :: 7, place["dt"]] = 0.6 * dt
    samples[:, place["u"]] = made.inputs
    samples[1:, place["u_before"]] = made.inputs[:-1]
    samples[:, place["y"]] = made.outputs
    samples[:, place["use"]] = generator.random(size) > 0.05
    samples[:, place["scale"]] = np.where(generator.random(size) > 0.95, 1e4, 1.0)
    samples[:, place["fresh"]] = spec.input_variance
    samples[:, place["again"]] = generator.random((rows, 1)) > 0.5
    samples[:, place["bound"]] = np.where(generator.random((rows, 1)) > 0.5, 6.0, 0.0)
    samples[:, place["nis"]] = generator.choice([0.0, 0.5, 3.0], size)
    samples[:, place["run"]] = np.resize([0.0, 0.5, 2.0, 8.0], size)
    samples[::50, place["kick"]] = 0.1 * spec.slow_sizes**2
    samples[30::60, place["gap"]] = [0.1 * (abs(state.start_mean) + 1.0) for state in spec.states]
    return samples


def healthy_of(plant: Both, name: str) -> FloatArray:
    """A healthy lane, (n_numbers, 1), that knows little of the states."""
    n_x, (mean, variance) = len(plant.spec.states), STARTS.get(name, (0.0, 1.0))
    return plant.core.healthy_lane(np.full(n_x, mean), np.diag(np.full(n_x, variance)))


def apart(spec: EngineSpec, one: FloatArray, two: FloatArray) -> float:
    """The largest difference of numbers of lanes: of z and P in standard deviations, of the others in their size."""
    rest = slice(spec.loop_slice.start, None)
    found = [np.abs(one[rest] - two[rest]) / (np.abs(two[rest]) + 1.0)]
    for a, b in zip(one.T, two.T, strict=True):
        P, Q = (unpack(spec, lane[spec.covariance_slice]) for lane in (a, b))
        sd = np.sqrt(np.diag(Q)) + 1e-9  # the rate of what does not move is known
        found += [np.abs(a[: spec.n_joint] - b[: spec.n_joint]) / sd, np.abs(P - Q) / np.outer(sd, sd)]
    return max(float(item.max()) for item in found)


def innovations_apart(spec: EngineSpec, one: FloatArray, two: FloatArray) -> float:
    """The largest difference of innovations in standard deviations, and of their variances in these."""
    variances = two[:, len(spec.outputs) :]
    sizes = np.concatenate([np.sqrt(variances), variances], axis=1)
    return float(np.max(np.abs(one - two) / sizes))


PLAIN = {"tank": 400, "dc_motor": 400, "dc_motor_current": 400, "rlc": 400, "rc": 1000, "cascaded_tanks": 400}
PLAIN |= {
    "three_tank": 400,
    "lamp": 150,
    "ladder": 150,
    "pipe": 300,
    "skab": 400,
    "nine": 150,
    "linear lamp": 150,
    "next lamp": 150,
}
NEAR = {"ladder": 1e-8, "nine": 1e-9}  # their starts are a thousand times as wide as what the sensors leave
SLOTTED = {"tank": 200, "dc_motor_current": 200, "rlc": 200, "rc": 200, "cascaded_tanks": 100, "lamp": 35}
NEAR_SLOTS = {"rlc": 2e-10}  # rounding adds up to 0.94e-10 or 1.05e-10, as the compiler contracts products
SLOTTED |= {"linear lamp": 35, "next lamp": 35, "late pump": 100}


@pytest.mark.parametrize("name", PLAIN)
def test_every_number_is_that_of_the_textbook(name: str) -> None:
    """Over hundreds of samples, every number of healthy and suspected lanes and innovations agree to 1e-10."""
    plant = both(name)
    spec, samples = plant.spec, recording(plant, PLAIN[name])
    healthy, plan = healthy_of(plant, name), plan_lanes(plant.spec)
    suspects = suspect_lanes(spec, plan, healthy[:, 0])[:, [plan.first[0], plan.first[-1]]]
    one = two = np.concatenate([healthy, suspects], axis=1)
    for block in np.split(samples, 10):
        one, seen_one = plant.core.advance(one, block)
        two, seen_two = plant.dense.advance(two, block)
        assert np.all(np.isfinite(two))
        assert apart(spec, one, two) < NEAR.get(name, 1e-10)
        assert innovations_apart(spec, seen_one, seen_two) < NEAR.get(name, 1e-10)


@pytest.mark.parametrize("name", SLOTTED)
def test_lanes_with_a_slot_are_those_of_the_textbook(name: str) -> None:
    """For every kind of fault, lanes with a slot agree to 1e-10."""
    plant = both(name)
    spec, samples = plant.spec, recording(plant, SLOTTED[name])
    plan, peak = plan_slots(spec), np.abs(samples[:, spec.sample_fields["u"]]).max(axis=0)
    y, u = (samples[0, spec.sample_fields[name]] for name in ("y", "u"))
    first = {
        (lane.kind, lane.output, lane.input, lane.acts, lane.keeps): k
        for k, lane in reversed(list(enumerate(plan.lanes)))
    }
    at_once = set() if any(item.settling or item.lag for item in spec.parameters) else {FaultKind.STEP}
    assert {kind for kind, *_ in first} == set(FaultKind) - at_once
    one = two = slot_lanes(spec, plan, list(first.values()), healthy_of(plant, name)[:, 0], peak, y, u)
    one[spec.slotted.slot_slice.start + 1] += 0.01  # something moves in every lane
    for block in np.split(samples, 5):
        one, seen_one = plant.core.slot.advance(one, block)
        two, seen_two = plant.dense.slot.advance(two, block)
        assert np.all(np.isfinite(two))
        assert apart(spec.slotted, one, two) < NEAR_SLOTS.get(name, 1e-10)
        assert innovations_apart(spec, seen_one, seen_two) < 1e-10


def test_what_the_plants_above_have() -> None:
    """Implicit signals, several steps in one, slow errors, noisy inputs, many sensors: each is there at least once."""
    plants = [both(name) for name in PLAIN]
    assert max(len(item.spec.loops) for item in plants) > 0
    assert {item.dense.model.substeps for item in plants} >= {1, 2, 8}
    assert max(len(item.spec.slow_errors) for item in plants) > 2
    assert {bool(item.spec.noisy_inputs) for item in plants} == {True, False}
    assert {bool(item.dense.model.measure_is_linear) for item in plants} == {True, False}
    assert max(len(item.spec.outputs) for item in plants) > 4
    assert max(len(item.spec.states) for item in plants) > 20
    assert min(len(item.spec.states) for item in plants) == 0
