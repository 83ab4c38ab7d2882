"""Inputs that move while nobody sees them: in a gap, between lost rows, in empty cells."""

from collections.abc import Iterable
from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from faultbond.contract.samples import Sample
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine, build_model
from faultbond.synthesis.specify import build_spec
from made import changed, run, samples_of

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
SPEC = build_spec(build_model(GRAPH))
ROWS, ONSET = 2400, 100.0


@cache
def core() -> Core:
    """The core of the plant."""
    return build_engine(GRAPH)[1]


@cache
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


def alarmed(samples: Iterable[Sample]) -> Monitor:
    """The monitor at the end."""
    return run(core(), tuple(samples))[0]


@pytest.mark.parametrize("length", [5, 40, 500, 900])
@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_gap_is_no_fault(length: int, seed: int) -> None:
    """Wherever the plant has gone meanwhile, a healthy one raises no alarm after a gap."""
    assert alarmed(blind(made(seed), range(1000, 1000 + length), sensors=False)).number("clock.alarm") < 0


@pytest.mark.parametrize("sensors", [True, False])
def test_empty_cells_and_lost_rows_are_no_fault(sensors: bool) -> None:
    """A tenth of the inputs missing, alone or with their whole rows, at steps of inputs too."""
    for seed in (1, 2, 3):
        lost = np.flatnonzero(np.random.default_rng(seed).random(ROWS) < 0.1)
        assert alarmed(blind(made(seed), lost[lost > 0], sensors=sensors)).number("clock.alarm") < 0


@pytest.mark.parametrize("lost", [range(1200, 1700), range(1, ROWS, 2)])
def test_a_fault_is_found_behind_what_was_not_seen(lost: range) -> None:
    """After a gap, and with every second row only, a valve that changed is found, as the step that it is."""
    fault = Fault(parameter="Kv", factor=0.75, start=ONSET)
    state = alarmed(blind(made(4, fault), lost, sensors=False))
    assert ONSET < 0.05 * state.number("clock.alarm") < ONSET + 5.0
    diagnosis = state.finish()
    assert diagnosis is not None
    best = diagnosis.candidates[0]
    assert (best.parameters, best.kind.value) == (("Kv",), "step")
    assert best.suspects[0].estimate == pytest.approx(0.75 * 5e-8, rel=0.03)


def moved_by(change: float, count: int, travel: float) -> tuple[float, float]:
    """What the gas is uncertain by, m^3, and in steps under the move, once the valve is told after blind rows."""
    samples, place = made(5), SPEC.sample_fields["gap"]
    begun = run(core(), samples[:200])[0]
    begun = changed(begun, leap=np.zeros(2))  # inputs that never moved
    before, _ = run(core(), blind(samples[200 : 200 + count], range(count), sensors=True), begun)
    before = changed(before, travel=np.stack([np.zeros(2), np.full(2, travel)]))
    gas = before.numbers("healthy.lane")[1]
    told = replace(samples[200 + count], u=before.numbers("inputs.held") + np.array([0.0, change]))
    after, _ = run(core(), [told], before)
    assert not any(before.row(200 + k)[0][place].any() for k in range(count))
    pressure = 4e5 * ((0.02 / (0.02 - gas)) ** 1.2 - 1.0)
    found = float(after.row(200 + count)[0][place][1])
    return found, found / (5e-8 * abs(change) * np.sqrt(pressure) * 0.05)


@pytest.mark.parametrize("change", [20.0, -20.0])
def test_what_an_unseen_move_does_to_the_states(change: float) -> None:
    """As far as one step takes the accumulator under the move, times the samples, at most as far as it ever moved."""
    assert moved_by(change, 1, 1e3)[1] == pytest.approx(1.0, rel=0.1)
    assert moved_by(change, 7, 1e3)[1] == pytest.approx(7.0, rel=0.1)
    assert moved_by(change, 7, 0.0)[1] == pytest.approx(1.0, rel=0.1)
    assert moved_by(change, 7, 1e-4)[0] == pytest.approx(1e-4, rel=1e-9)


def test_scatter_is_found_where_rows_come_slowly() -> None:
    """A row at every fifth sample, between which inputs move, does not keep the sum of the scatter from filling."""
    generator, samples = np.random.default_rng(8), list(made(6))
    for k in range(800, ROWS):
        samples[k] = replace(samples[k], y=samples[k].y + np.array([0.0, 9e3]) * generator.standard_normal())
    lost = [k for k in range(ROWS) if k % 5]
    state = alarmed(blind(samples, lost, sensors=False))
    assert 800 < state.number("clock.alarm") < 1600


def test_an_input_that_is_missing_for_long_raises_no_alarm() -> None:
    """While sensors are seen and the pump is not, it moves; the sums stand still, and go on when it is told again."""
    samples = list(made(2))
    lost = range(1000, 1120)
    assert np.ptp([samples[k].u[0] for k in lost]) > 5.0
    for k in lost:
        samples[k] = replace(samples[k], u=np.array([np.nan, samples[k].u[1]]))
    assert alarmed(samples).number("clock.alarm") < 0
    state = run(core(), tuple(samples[:1002]))[0]
    later = run(core(), tuple(samples[1002:1110]), state)[0]
    assert np.array_equal(later.numbers("sensors.cusum"), state.numbers("sensors.cusum"))
    fault = Fault(parameter="Kv", factor=0.75, start=52.0)
    broken = [replace(item, u=was.u) for item, was in zip(made(2, fault), samples, strict=True)]
    assert 1120 <= alarmed(broken).number("clock.alarm") < 1300
