"""Which samples are tried as onset: near the alarm, far from it, and where innovations became wild."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultbond.model.text import load_model
from faultbond.runtime import monitor
from faultbond.runtime import onsets as module
from faultbond.runtime.onsets import DENSE, onsets
from faultbond.runtime.state import Sample
from faultbond.runtime.trail import MOST_BURSTS, Trail, bursts
from faultbond.simulate import Fault, Inputs, simulate
from faultbond.synthesis.engine import build_engine
from made import changed, plant, recorded, run, samples_of

_, SPEC, ENGINE = plant("dc_motor")
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


def trail_of(length: int, **fields: object) -> Trail:
    """A trail of zeros."""
    trail = Trail(samples=np.zeros((length, SPEC.n_sample)), lanes=np.zeros((length, SPEC.n_numbers)))
    return replace(trail, **fields)  # type: ignore[arg-type]


def test_onsets_are_dense_before_the_alarm_and_stand_for_all_samples() -> None:
    """Each of the last samples before the alarm, sparse ones elsewhere; their widths cover what lies between."""
    found = dict(onsets(SPEC, trail_of(330, alarm=250), 240))
    assert set(range(250 - DENSE, 251)) <= set(found)
    assert {240, 251, 252, 254, 258, 266, 282, 314} <= set(found)
    back = np.array(sorted(250 - place for place in found if place <= 250))
    assert np.all(np.diff(back) <= 0.05 * back[:-1] + 1.0)
    assert np.count_nonzero(back > DENSE) < 50
    places = sorted(found)
    assert sum(found.values()) == pytest.approx(places[-1] - places[0] + 1)
    assert all(width > 0.0 for width in found.values())
    assert max(onsets(SPEC, trail_of(330), 240))[0] == 329  # the last sample is that of the alarm


def test_a_bank_of_many_lanes_tries_fewer(monkeypatch: pytest.MonkeyPatch) -> None:
    """The last eight samples, then ever farther apart, with the estimated onset, and as widely spread in all."""
    all_places = dict(onsets(SPEC, trail_of(330, alarm=250), 193))
    monkeypatch.setattr(module, "MANY", 0)
    found = dict(onsets(SPEC, trail_of(330, alarm=250), 193))
    assert {193, *range(242, 251), 251, 252, 254, 258, 266, 282, 314} <= set(found)
    assert len(found) < 0.4 * len(all_places)
    back = np.array(sorted(250 - place for place in found if place <= 250))
    assert np.all(np.diff(back) <= 0.25 * back[:-1] + 1.0)
    assert sum(found.values()) == pytest.approx(max(found) - min(found) + 1)


@pytest.mark.parametrize("large", [False, True])
def test_bursts_are_tried(large: bool, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where innovations became wild, and one sample before it, in banks of any size; never before the trail."""
    if large:
        monkeypatch.setattr(module, "LARGE_BANK", 0)
    plain = {place for place, _ in onsets(SPEC, trail_of(330), 320)}
    found = {place for place, _ in onsets(SPEC, trail_of(330, bursts=(1, 137)), 320)}
    assert found - plain <= {1, 136, 137}
    assert {1, 136, 137} <= found
    assert min(found) >= 1


def test_bursts_begin_where_innovations_become_wild() -> None:
    """Of a run of wild samples the first counts, missing values do not, and of many the wildest are kept."""
    state, _ = run(SPEC, ENGINE, samples_of(*_still(200, {60: 40.0, 61: 45.0, 120: 30.0, 150: np.nan})))
    trail = monitor._cut_trail(state, state.clock.index - 1)[0]
    first = state.clock.begun
    assert trail.bursts == (60 - first, 120 - first)
    wild = {60 + 10 * k: 20.0 + k for k in range(12)}
    state, _ = run(SPEC, ENGINE, samples_of(*_still(200, wild)))
    found = bursts(state.past.wildness[state.past.place(state.clock.begun) :])
    assert len(found) == MOST_BURSTS
    assert found == tuple(place - state.clock.begun for place in sorted(wild)[-MOST_BURSTS:])


def test_the_first_sample_of_a_trail_begins_no_burst() -> None:
    """What was wild before the trail begins there in no place that a lane could begin at."""
    assert bursts(np.array([9.0, 8.0, 0.0, 9.0, 9.0])) == (1, 3)
    assert bursts(np.array([9.0, 0.0, 0.0])) == ()


def test_a_trail_knows_where_the_alarm_was() -> None:
    """Cut when the bank begins again, it has samples of after the alarm, but looks for bursts before it only."""
    state, _ = run(SPEC, ENGINE, recorded("dc_motor", 260, Fault(parameter="K", factor=0.6, start=2.4)))
    oldest = max(state.clock.begun, state.clock.index - len(state.past.times))
    assert state.clock.index - state.clock.alarm > 50
    trail = monitor._cut_trail(changed(state, index=state.clock.index - 1), state.clock.alarm)[0]
    assert trail.alarmed == state.clock.alarm - oldest < len(trail.samples) - 50
    later = bursts(state.past.wildness[state.past.place(oldest) :])
    assert max(later) > trail.alarmed
    assert all(place <= trail.alarmed for place in trail.bursts)


def _still(rows: int, wild: dict[int, float]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """A motor at rest whose sensor errs at some rows, in its noise."""
    time, noise = 0.02 * np.arange(rows), SPEC.outputs[0].noise
    y = noise * np.random.default_rng(3).standard_normal((rows, len(SPEC.outputs)))
    for row, size in wild.items():
        y[row] = size * noise
    return time, np.zeros((rows, len(SPEC.inputs))), y


def test_a_jump_that_is_soon_forgotten(tmp_path: Path) -> None:
    """A shaft that goes on with its momentum at a fault is itself again within a second; the alarm comes much later."""
    (tmp_path / "pump.yaml").write_text(PUMP, encoding="utf-8")
    graph = load_model(tmp_path / "pump.yaml")
    spec, engine = build_engine(graph)
    time = np.arange(0.0, 160.0, 0.2)
    volts = np.random.default_rng(6).uniform(16.0, 40.0, 9)[(time / 20.0).astype(int)][:, None]
    fault = Fault(parameter="J", factor=1.3, start=83.3)
    made = simulate(graph, Inputs(time=time, values=volts), [fault], seed=4, start={"tank.q": 0.1})
    samples: tuple[Sample, ...] = samples_of(time, made.inputs, made.outputs)
    state, reports = run(spec, engine, samples)
    assert state.clock.alarm - 83.3 / 0.2 > DENSE
    found = [report.diagnosis.candidates[0] for report in reports if report.diagnosis is not None]
    assert {best.parameters for best in found} == {("J",)}
    assert found[-1].suspects[0].estimate == pytest.approx(0.065, rel=0.03)
