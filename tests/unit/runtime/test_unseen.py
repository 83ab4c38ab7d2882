"""Inputs that move while nobody sees them: in a gap, between lost rows, in empty cells."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np
import pytest
from made import run, samples_of

from faultbond.model.text import parse_model
from faultbond.runtime.monitor import finish
from faultbond.runtime.state import Sample, State
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine

# An accumulator behind a long pipe: its pressure is far from linear in what it holds.
GRAPH = parse_model(
    """
name: pump, pipe and accumulator
sample_time: 50 ms
accuracy: 2 %
inputs: {n: {unit: percent}, u: {unit: percent}}
components:
  pump: {type: Se, law: e = H*n**2, parameters: {H: 1.2e-3 bar/percent^2}}
  pipe: {type: R, law: e = Kp*f*abs(f), parameters: {Kp: 8e10 Pa*s^2/m^6}}
  water: {type: I, parameters: {I: 4e7 Pa*s^2/m^3}}
  gas: {type: C, law: e = P0*((V0/(V0 - q))**1.2 - 1), parameters: {P0: 4 bar, V0: 20 l}}
  valve: {type: R, law: f = Kv*u*sqrt(abs(e))*sign(e), parameters: {Kv: 5e-8 m^3/s/Pa^0.5/percent}}
junctions: {line: 1, node: 0}
bonds: [pump -> line -> pipe, line -> water, line -> node -> gas, node -> valve]
sensors:
  Q: {reads: line.f, unit: l/min, noise: 0.5 l/min}
  p: {reads: node.e, unit: kPa, noise: 3 kPa}
"""
)
SPEC, ENGINE = build_engine(GRAPH)
ROWS, ONSET = 2400, 100.0


def made(seed: int, *faults: Fault) -> tuple[Sample, ...]:
    """Samples of the plant, whose pump and valve move every few seconds."""
    generator = np.random.default_rng(seed)
    time = np.asarray(0.05 * np.arange(ROWS), dtype=np.float64)
    n, u = (random_steps(time, generator, low=a, high=b, shortest=3.0, longest=12.0) for a, b in ((50, 90), (20, 80)))
    found = simulate(GRAPH, Inputs(time=time, values=np.stack([n, u], axis=1)), faults, seed=seed)
    return samples_of(time, found.inputs, found.outputs)


def blind(samples: Iterable[Sample], rows: Iterable[int], *, sensors: bool) -> list[Sample]:
    """Take the inputs out of some rows, and the sensors too unless they go on."""
    lost = set(rows)
    return [
        item
        if k not in lost
        else replace(item, u=np.full_like(item.u, np.nan), y=item.y if sensors else np.full_like(item.y, np.nan))
        for k, item in enumerate(samples)
    ]


def alarmed(samples: Iterable[Sample]) -> State:
    """The state at the end."""
    return run(SPEC, ENGINE, tuple(samples))[0]


@pytest.mark.parametrize("length", [5, 40, 500, 900])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_gap_is_no_fault(length: int, seed: int) -> None:
    """Wherever the plant has gone meanwhile, a healthy one raises no alarm after a gap."""
    assert alarmed(blind(made(seed), range(1000, 1000 + length), sensors=False)).alarm < 0


@pytest.mark.parametrize("sensors", [True, False])
def test_empty_cells_and_lost_rows_are_no_fault(sensors: bool) -> None:
    """A tenth of the inputs missing, alone or with their whole rows, at steps of inputs too."""
    for seed in (1, 2, 3):
        lost = np.flatnonzero(np.random.default_rng(seed).random(ROWS) < 0.1)
        assert alarmed(blind(made(seed), lost[lost > 0], sensors=sensors)).alarm < 0


@pytest.mark.parametrize("lost", [range(1200, 1700), range(1, ROWS, 2)])
def test_a_fault_is_found_behind_what_was_not_seen(lost: range) -> None:
    """After a gap, and with every second row only, a valve that changed is found, as the step that it is."""
    fault = Fault(parameter="Kv", factor=0.75, start=ONSET)
    state = alarmed(blind(made(4, fault), lost, sensors=False))
    assert ONSET < 0.05 * state.alarm < ONSET + 5.0
    diagnosis = finish(SPEC, state)
    assert diagnosis is not None
    best = diagnosis.candidates[0]
    assert (best.parameters, best.kind.value) == (("Kv",), "step")
    assert best.suspects[0].estimate == pytest.approx(0.75 * 5e-8, rel=0.03)
