"""Readings far off, filters that are lost, corrections that were accepted: what must not spoil the diagnosis."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from faultbond.contract.findings import Diagnosis
from faultbond.contract.spec import Engine, EngineSpec
from faultbond.model.text import parse_model
from faultbond.runtime import monitor
from faultbond.runtime.accepting import accept, candidate_of, find_hypothesis, hypothesis_names
from faultbond.runtime.alarm import detect
from faultbond.runtime.drifting import Drifting, drifting
from faultbond.runtime.monitor import RENEWALS, _cut_trail, _oldest, finish
from faultbond.runtime.state import SNAPSHOT_EVERY, Sample, State, Status, init
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine
from made import EXAMPLES, changed, plant, recorded, run, samples_of

WILD_BEFORE = 100
FAULT = Fault(parameter="C", factor=1.6, start=20.0)


def diagnosed(samples: list[Sample]) -> tuple[State, Diagnosis]:
    """Pass samples of the R-L-C circuit; give the state and the last diagnosis."""
    _, spec, engine = plant("rlc")
    state, _ = run(spec, engine, samples)
    found = finish(spec, state)
    assert found is not None
    return state, found


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
    state, _ = diagnosed(samples)
    place = state.clock.alarm + 60
    wild = [*samples]
    wild[place] = replace(wild[place], y=np.array([*wild[place].y[:-1], value]))
    _, found = diagnosed(wild)
    assert found.candidates[0].parameters == ("C",)
    assert found.candidates[0].probability > 0.95
    assert found.unexplained is None


def test_a_bank_goes_on_while_the_healthy_filter_begins_again(samples: list[Sample]) -> None:
    """A healthy lane that is lost takes nothing from the lanes of the bank, nor are these renewed from nowhere."""
    _, spec, engine = plant("rlc")
    whole, _ = diagnosed(samples)
    after = whole.clock.alarm + RENEWALS[0] + 5
    state, _ = run(spec, engine, samples[:after])
    lost, reports = run(spec, engine, samples[after:], changed(state, lane=np.full_like(state.healthy.lane, np.nan)))
    assert {Status.LOST, Status.STARTING} <= {report.status for report in reports}
    found, expected = finish(spec, lost), finish(spec, whole)
    assert found is not None
    assert expected is not None
    assert found.candidates[0].parameters == expected.candidates[0].parameters == ("C",)
    steps = slice(0, lost.bank.steps.shape[1])
    assert np.max(lost.bank.steps[-1, steps]) == pytest.approx(np.max(whole.bank.steps[-1, steps]), abs=60.0)


def test_no_lane_of_after_the_alarm_is_an_old_one() -> None:
    """A short run has no healthy lane from long before the alarm, at the alarm or later."""
    _, spec, _ = plant("rlc")
    fresh = changed(init(spec), begun=0, index=SNAPSHOT_EVERY + 1, running=1)
    kept = np.ones_like(fresh.healthy.snapshots)
    assert _oldest(changed(fresh, snapshots=kept)) is not None
    assert _oldest(changed(fresh, snapshots=kept, alarm=SNAPSHOT_EVERY - 1)) is None
    assert _oldest(changed(fresh, snapshots=kept, alarm=SNAPSHOT_EVERY)) is not None


def test_a_held_input_is_corrected_too() -> None:
    """Where inputs are given when they change, an accepted bias acts at once, not from the next value on."""
    graph, spec, engine = plant("rc")
    time = np.asarray(np.arange(900) * 0.02, dtype=np.float64)
    values = random_steps(time, np.random.default_rng(1), low=2.0, high=12.0, shortest=2.0, longest=4.0)[:, None]
    made = simulate(graph, Inputs(time=time, values=values), [Fault(parameter="V.bias", value=2.0, start=8.0)], seed=1)
    changed = np.diff(values[:, 0], prepend=np.nan) != 0.0
    given = [
        replace(sample, u=values[k].copy() if changed[k] else np.array([np.nan]))
        for k, sample in enumerate(samples_of(time, made.inputs, made.outputs))
    ]
    state, reports = run(spec, engine, given[:640])
    assert any(report.detection for report in reports)
    corrected, _ = accept(spec, state, find_hypothesis(spec, ["V"]))
    assert corrected.inputs.held[0] - state.inputs.held[0] == pytest.approx(2.0, abs=0.3)
    _, reports = run(spec, engine, given[640:], corrected)
    assert not any(report.detection for report in reports)


def test_noise_comes_on_top_of_what_was_accepted() -> None:
    """A sensor that was accepted with three times its noise, and has nine times, is told with nine times."""
    _, spec, engine = plant("rc")
    generator, declared = np.random.default_rng(0), spec.outputs[0].noise
    times = np.repeat([1.0, 3.0, 9.0], [600, 700, 700])
    noisy = [
        replace(sample, y=sample.y + generator.normal(0.0, declared * np.sqrt(more**2 - 1.0), 1))
        for sample, more in zip(recorded("rc", len(times)), times, strict=True)
    ]
    state, _ = run(spec, engine, noisy[:1200])
    found = finish(spec, state)
    assert found is not None
    assert found.candidates[0].parameters == ("V_C.noise",)
    state, _ = accept(spec, state, found.candidates[0].hypothesis)
    state, reports = run(spec, engine, noisy[1200:1300], state)
    sd = np.sqrt(np.mean([report.variance for report in reports]))
    assert sd == pytest.approx(3.0 * declared, rel=0.4)
    state, _ = run(spec, engine, noisy[1300:], state)
    found = finish(spec, state)
    assert found is not None
    (suspect,) = found.candidates[0].suspects
    assert suspect.estimate == pytest.approx(9.0 * declared, rel=0.35)


def test_an_accepted_noise_is_no_blanking() -> None:
    """However large: a sensor that counts as blanked would never raise an alarm again."""
    _, spec, engine = plant("rc")
    state, _ = run(spec, engine, recorded("rc", 400))
    noise = state.normal.noise.copy()
    quiet = list(recorded("rc", 1200))[400:]
    generator = np.random.default_rng(2)
    for _ in range(4):
        wild = [replace(item, y=item.y + generator.normal(0.0, 300.0 * np.sqrt(noise), 1)) for item in quiet[:300]]
        state, _ = run(spec, engine, wild, state)
        if state.clock.alarm < 0:
            break
        state, _ = accept(spec, state, find_hypothesis(spec, ["V_C"]))
        noise = state.normal.noise.copy()
        assert noise[0] < spec.thresholds.blank_factor


def test_lanes_that_begin_again_drift_too() -> None:
    """After a drift was accepted, what the trail is passed with moves as the healthy lane did; so they end alike."""
    _, spec, engine = plant("dc_motor")
    k = [item.name for item in spec.parameters].index("R")
    place = spec.parameter_slice.start + k
    moves = np.arange(len(spec.parameters)) == k
    samples = recorded("dc_motor", 900)
    state, _ = run(spec, engine, samples[:600])
    rates = np.where(moves, 0.001 / samples[1].dt, 0.0)
    state, _ = run(spec, engine, samples[600:800], changed(state, accepted=state.clock.index - 1, rates=rates))
    trail, _ = _cut_trail(changed(state, index=state.clock.index - 1), state.clock.index - 60)
    kept = trail.lanes[0][:, None]
    for advancing, ends in ((drifting(spec, engine, rates, state.normal.wander), True), (engine, False)):
        lanes, innovations = advancing.advance(kept, trail.samples[1:])
        assert innovations.shape == (len(trail.samples) - 1, 2 * len(spec.outputs), 1)
        assert bool(np.isclose(lanes[place, 0], state.healthy.lane[place, 0], rtol=1e-9)) is ends
    assert drifting(spec, engine, np.zeros(len(moves)), state.normal.wander) is engine


def test_the_bank_begins_with_the_drifts_that_were_accepted(monkeypatch: pytest.MonkeyPatch) -> None:
    """At the alarm and at each new beginning the bank gets an engine in which parameters move on."""
    _, spec, engine = plant("rc")
    rows = recorded("rc", 700, Fault(parameter="C", factor=1.5, start=6.0))
    state, _ = run(spec, engine, rows[:250])
    assert state.clock.alarm < 0
    used: list[tuple[str, Engine]] = []
    for name in ("begin_bank", "renew_bank"):
        inner = getattr(monitor, name)

        def kept(
            spec: EngineSpec, engine: Engine, *others: Any, name: str = name, inner: Any = inner, **more: Any
        ) -> Any:
            used.append((name, engine))
            return inner(spec, engine, *others, **more)

        monkeypatch.setattr(monitor, name, kept)
    rates = np.full(len(spec.parameters), 1e-6)
    run(spec, engine, rows[250:], changed(state, rates=rates, accepted=state.clock.index - 1))
    assert [name for name, _ in used] == ["begin_bank", *["renew_bank"] * len(RENEWALS)]
    assert all(isinstance(given, Drifting) and np.array_equal(given.rates, rates) for _, given in used)


@pytest.mark.parametrize(("pause", "alarms"), [(1.0, False), (12.0, True)])
def test_slow_errors_are_watched_by_the_clock(pause: float, alarms: bool) -> None:
    """Where rows are the grid, a slow error alarms after its memory in seconds, not after as many rows."""
    _, tank, _ = plant("tank")
    spec = replace(tank, sample_time=None)
    assert spec.slow_errors[0].memory == 600.0
    lane = np.zeros((spec.n_numbers, 1))
    lane[spec.slow_slice] = 3.0 * spec.thresholds.slow_error_limit * spec.slow_sizes[:, None]
    state = changed(init(spec), begun=0, index=60, lane=lane, pause=pause)
    detection, _ = detect(spec, state, np.zeros(len(spec.outputs)))
    assert (detection is not None) is alarms


def test_a_sensor_with_the_name_of_a_parameter_is_a_candidate_of_its_own() -> None:
    """What is accepted is the hypothesis that was asked for, not the first of that name."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8").replace("{V_C: {reads", "{C: {reads")
    spec, engine = build_engine(parse_model(text))
    state, _ = run(spec, engine, recorded("rc", 450, Fault(parameter="C", factor=1.5, start=6.0)))
    sensor = len(spec.hypotheses) + [item.name for item in spec.instruments].index("C")
    assert candidate_of(spec, state, sensor).parameters[0].startswith("C.")
    (part,) = (k for k in range(len(spec.hypotheses)) if hypothesis_names(spec, k) == {"C"})
    assert candidate_of(spec, state, part).parameters == ("C",)


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
    spec, engine = build_engine(parse_model(text), compiled=False)
    assert spec.n_joint == 1
    state = init(spec)
    made = [Sample(time=0.1 * k, dt=0.1 * (k > 0), u=np.array([1.0]), y=np.array([0.1])) for k in range(40)]
    state, reports = run(spec, engine, made, state)
    assert np.isfinite(state.healthy.lane).all()
    assert np.isfinite(reports[-1].expected).all()
