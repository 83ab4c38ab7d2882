"""The parameter of a store that changes over a while: its content goes on meanwhile, or its effort or flow."""

from functools import cache

import numpy as np
import pytest

from faultbond.contract.findings import Diagnosis
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

VESSEL = """\
name: vessels
sample_time: 1 s
max_faults: 2
constants: {RT: 84000 m^2/s^2}
inputs: {u: {unit: kg/s}, v: {}}
components:
  compressor: {type: Sf, law: f = G*u, parameters: {G: 1}}
  receiver: {type: C, law: e = RT*q/V, parameters: {V: 2 m^3}}
  consumer: {type: R, law: f = K*v*e, parameters: {K: 1e-7 kg/s/Pa}}
junctions: {node: 0}
bonds: [compressor -> node -> receiver, node -> consumer]
sensors:
  p: {reads: node.e, unit: Pa, noise: 600 Pa}
  w: {reads: consumer.f, unit: kg/s, noise: 0.0005 kg/s}
"""
BEGINS, ENDS = 600, 1000


@cache
def vessel() -> tuple[BondGraph, Core]:
    """A vessel that a compressor fills, and its core."""
    graph = parse_model(VESSEL)
    built = build_plant(graph)
    with in_full():
        return graph, build_core(built, build_spec(build_step_model(built)))


@cache
def diagnoses(what: str, seed: int) -> tuple[Diagnosis, ...]:
    """What is said of a change between two moments, at all times of it."""
    graph, core = vessel()
    time, generator = np.arange(1800.0), np.random.default_rng(seed)
    steps = [
        random_steps(time, generator, low=low, high=high, shortest=90.0, longest=250.0)
        for low, high in ((0.04, 0.07), (0.8, 1.3))
    ]
    fault = fault_in_si(parse_fault(f"{what}@{BEGINS}..{ENDS}"), graph)
    made = simulate(
        graph, Inputs(time=time, values=np.column_stack(steps)), [fault], seed=seed, start={"receiver.q": 12}
    )
    reports = run(core, samples_of(time, made.inputs, made.outputs))[1]
    return tuple(item.diagnosis for item in reports if item.diagnosis)


@pytest.mark.parametrize("factor", [0.75, 1.3])
@pytest.mark.parametrize("seed", range(2))
def test_a_vessel_that_fills_with_water_presses_its_gas(factor: float, seed: int) -> None:
    """Its volume is named, with its value and its course, and nothing else is sure from half way on.

    Without lanes whose content goes on the gas that is pressed out, or let in, was the compressor's: a fault of it that
    comes and goes. In the first minutes one diagnosis or a few may be sure of it, see docs/limits.md.
    """
    found = diagnoses(f"V=x{factor}", seed)
    last = found[-1]
    best, (suspect,) = last.candidates[0], last.candidates[0].suspects
    assert (suspect.parameter, best.kind) == ("V", FaultKind.RAMP)
    assert best.probability > 0.9
    assert not any(item.unexplained for item in found if item.time > ENDS)
    assert suspect.estimate == pytest.approx(2.0 * factor, rel=0.03)
    assert suspect.began == pytest.approx(BEGINS, abs=40.0)
    assert suspect.ended == pytest.approx(ENDS, abs=40.0)
    late = (item for item in found if item.time > (BEGINS + ENDS) / 2.0)
    assert {item.candidates[0].parameters for item in late if item.candidates[0].probability > 0.95} == {("V",)}
