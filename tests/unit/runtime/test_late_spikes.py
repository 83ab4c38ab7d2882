"""Values that an input has for one sample after an alarm: the healthy filter, which is wrong by then, has no say."""

from functools import cache

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Diagnosis
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from made import samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
GRAPH = parse_model("""
name: cell
sample_time: 0.1 s
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  series: {type: R, parameters: {R: 10 ohm}}
  cell: {type: C, parameters: {C: 0.1 F}}
  leak: {type: Sf, law: f = L, parameters: {L: {nominal: 0 A, accuracy: 1 mA, change: 1 A}}}
junctions: {first: 1, node: 0}
bonds: [source -> first -> series, first -> node -> cell, node -> leak]
sensors: {v: {reads: node.e, unit: V, noise: 20 mV}}
""")
ROWS, START, SPIKE, DT = 900, 30.0, 700, 0.1
FAULTS = {
    "series": Fault(parameter="R", factor=2.0, start=START),
    "v": Fault(parameter="v.bias", value=-4.0, start=START),
}


@cache
def core() -> Core:
    """Give the core of the cell."""
    return build_engine(GRAPH)[1]


@cache
def recording(fault: str) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Give times, voltages that differ from sample to sample, and readings of a cell with a fault."""
    time = np.linspace(0.0, DT * (ROWS - 1), ROWS)
    voltage = 10.0 + np.random.default_rng(8).standard_normal(ROWS)
    made = simulate(GRAPH, Inputs(time=time, values=voltage[:, None]), (FAULTS[fault],), seed=4, start={"cell.q": 1.0})
    return time, made.inputs, made.outputs


def watched(fault: str, u: FloatArray) -> tuple[list[int], Diagnosis]:
    """Run a recording; give the samples at which values were wild, and the verdict."""
    time, _, y = recording(fault)
    monitor, wild = Monitor(core()), list[int]()
    for k, sample in enumerate(samples_of(time, u, y)):
        wild += [k] if monitor.step(sample).wild else []
    assert START / DT <= monitor.number("clock.alarm") < SPIKE - 60
    return wild, monitor.conclude()


@pytest.mark.parametrize("fault", FAULTS)
def test_what_acted_is_believed_once_a_fault_is_there(fault: str) -> None:
    """No voltage is taken for wild, whatever the healthy filter makes of it, so the fault is no other one."""
    wild, found = watched(fault, recording(fault)[1])
    assert wild == []
    best = found.candidates[0]
    assert (best.components, best.kind) == ((fault,), FaultKind.BIAS if fault == "v" else FaultKind.STEP)


@pytest.mark.parametrize("fault", FAULTS)
def test_what_did_not_act_is_taken_out_after_an_alarm(fault: str) -> None:
    """Of a record that is off for one sample the likeliest lane says so, of a parameter or of an instrument."""
    u = recording(fault)[1].copy()
    u[SPIKE] += 12.0
    wild, found = watched(fault, u)
    assert wild[0] == SPIKE + 1
    assert found.candidates[0].components == (fault,)
