"""The compiled engine against the interpreter: the same graph, run by two independent machines."""

from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.slots import plan_slots
from faultbond.contract.spec import EngineSpec
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.runtime.slotted import slot_lanes
from faultbond.runtime.start import healthy_lane
from faultbond.runtime.stepped import relinearised, suspect_lanes
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.machine import VirtualMachine
from faultbond.types import FaultKind

EXAMPLES = Path(__file__).parents[2] / "examples"
ROWS = 5000
RANGES = {"percent": (40.0, 90.0, 30.0), "V": (2.0, 12.0, 0.5)}  # by unit: lowest, highest, shortest step in s

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")


def recording(graph: BondGraph, spec: EngineSpec) -> FloatArray:
    """Packed samples of a plant with noise and a fault, some values missing, some blanked."""
    generator = np.random.default_rng(11)
    dt = graph.sample_time or 1.0
    time = np.asarray(np.arange(ROWS) * dt, dtype=np.float64)
    columns = []
    for item in graph.inputs:
        low, high, shortest = RANGES[item.unit.text]
        columns.append(random_steps(time, generator, low=low, high=high, shortest=shortest, longest=5 * shortest))
    suspect = graph.parameters[0].name
    fault = Fault(parameter=suspect, factor=1.6, start=float(time[ROWS // 3]))
    made = simulate(graph, Inputs(time=time, values=np.array(columns).T), [fault], seed=4)
    samples, place = np.zeros((ROWS, spec.n_sample)), spec.sample_fields
    samples[1:, place["dt"]] = dt
    samples[:, place["u"]] = made.inputs
    samples[1:, place["u_before"]] = made.inputs[:-1]
    samples[:, place["y"]] = made.outputs
    samples[:, place["use"]] = generator.random(made.outputs.shape) > 0.05
    samples[:, place["scale"]] = np.where(generator.random(made.outputs.shape) > 0.95, 1e4, 1.0)
    return samples


@pytest.mark.parametrize("name", ["tank", "dc_motor", "dc_motor_current", "rlc", "rc"])
def test_compiled_engine_equals_the_interpreter(name: str) -> None:
    """Over 5000 samples, likelihoods, estimates and innovations of both engines agree to nine digits."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    spec, compiled = build_engine(graph)
    same, machine = build_engine(graph, compiled=False)
    assert same == spec
    assert isinstance(machine, VirtualMachine)
    assert not isinstance(compiled, VirtualMachine)
    samples = recording(graph, spec)
    n_x, plan = len(spec.states), plan_lanes(spec)
    healthy = healthy_lane(spec, np.zeros(n_x), np.diag(np.full(n_x, 1e8 if name == "tank" else 1.0)))
    suspects = suspect_lanes(spec, plan, healthy[:, 0])[:, [plan.first[0], plan.first[-1]]]
    one = two = np.concatenate([healthy, suspects], axis=1)
    for block in np.split(samples, 10):
        one, seen_one = compiled.advance(one, block)
        two, seen_two = machine.advance(two, block)
        assert np.all(np.isfinite(two))
        assert np.max(np.abs(one[-1] / two[-1] - 1.0)) < 1e-9
        assert one[: spec.n_joint] == pytest.approx(two[: spec.n_joint], rel=1e-9, abs=1e-9)
        size = np.abs(seen_two).max(axis=0)
        assert np.max(np.abs(seen_one - seen_two) / size) < 1e-9


@pytest.mark.parametrize("name", ["tank", "dc_motor_current", "rlc", "rc"])
def test_lanes_with_a_slot_are_the_same_on_both_engines(name: str) -> None:
    """For every kind of fault, 500 samples through both engines of lanes with a slot agree to eight digits."""
    graph = load_model(EXAMPLES / name / "model.yaml")
    spec, compiled = build_engine(graph)
    _, machine = build_engine(graph, compiled=False)
    samples = relinearised(spec, recording(graph, spec)[:500])
    n_x, plan, place = len(spec.states), plan_slots(spec), spec.sample_fields
    healthy = healthy_lane(spec, np.zeros(n_x), np.diag(np.full(n_x, 1e8 if name == "tank" else 1.0)))[:, 0]
    peak = np.abs(samples[:, place["u"]]).max(axis=0)
    first = {(lane.kind, lane.output, lane.acts): k for k, lane in reversed(list(enumerate(plan.lanes)))}
    one = two = slot_lanes(spec, plan, list(first.values()), healthy, samples[:1], peak)
    assert {kind for kind, _, _ in first} == set(FaultKind) - {FaultKind.STEP}
    for block in np.split(samples, 5):
        one, seen_one = compiled.slot.advance(one, block)
        two, seen_two = machine.slot.advance(two, block)
        assert np.all(np.isfinite(two))
        sizes = np.abs(two).max(axis=1, keepdims=True) + 1e-300
        assert np.max(np.abs(one - two) / sizes) < 1e-8
        assert np.max(np.abs(seen_one - seen_two) / np.abs(seen_two).max(axis=0)) < 1e-8
