"""Inputs whose record scatters while what acts does not: the trends that follow it, the filter, and a fit."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from faultbond.app.likelihood import likelihood_engine
from faultbond.arrays import FloatArray
from faultbond.contract.samples import Sample
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import ModelError
from faultbond.fit.imperfections import Kind, possible
from faultbond.fit.likelihood import build_begin, nominal_q, sample_fields
from faultbond.fit.samples import healthy_recording
from faultbond.model.builder import ModelBuilder
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Fault, Inputs, Simulation, simulate
from faultbond.synthesis.engine import build_core, build_engine
from faultbond.synthesis.specify import build_spec
from made import run, samples_of

COILS = """\
name: filter of coils
sample_time: 0.1 ms
inputs: {U: {unit: V, noise: 1 V, noise_of: record}}
components:
  supply: {type: Se, law: e = U}
  L1: {type: I, parameters: {L1: 5 mH}}
  R1: {type: R, parameters: {R1: 1 ohm}}
  C1: {type: C, parameters: {C1: 470 uF}}
  load: {type: R, parameters: {RL: 20 ohm}}
junctions: {a: 1, out: 0}
bonds: [supply -> a -> L1, a -> R1, a -> out -> C1, out -> load]
sensors:
  i: {reads: a.f, unit: A, noise: 0.02 A}
  v: {reads: out.e, unit: V, noise: 0.3 V}
"""
PLAIN = COILS.replace(", noise_of: record", "")
WANDERS = np.array([1e-6, 1e-4, 1e-2, 100.0, 0.0, 0.0, 0.0, 0.0, 0.0])
TURNS = np.array([0.0, 0.0, 0.0, 0.0, 1e-8, 1e-6, 1e-4, 1e-2, 1.0])
TIME: FloatArray = np.asarray(np.arange(2000) * 1e-4, dtype=np.float64)


@cache
def engine(text: str = COILS) -> Core:
    """A core of the filter."""
    return build_engine(parse_model(text))[1]


def packed(record: FloatArray) -> FloatArray:
    """What the core makes of a record: the input, the part of its error that lasts, and the new variance, (n, 3)."""
    monitor, place, rows = Monitor(engine()), engine().spec.sample_fields, []
    for k, u in enumerate(record):
        row = monitor.pack(Sample(time=k * 1e-4, dt=1e-4, u=np.array([u]), y=np.full(2, np.nan)))
        assert row is not None
        rows.append([row[place[name]][0] for name in ("u", "fade", "fresh")])
    return np.array(rows)


def expected(record: FloatArray, sd: float) -> FloatArray:
    """The same by matrices: a Kalman filter for each trend, in SI."""
    forward, n = np.array([[1.0, 1.0], [0.0, 1.0]]), len(WANDERS)
    means = np.array([[record[0], 0.0]] * n)
    spreads = np.array([np.diag([1.0, 1e4 * (turn > 0.0)]) for turn in TURNS]) * sd**2
    lately, square, rough = np.zeros(n), np.ones(n), 1.0
    rows = [[record[0], 0.0, sd**2]]
    for u in record[1:]:
        passed = np.zeros(n)
        for t in range(n):
            mean = forward @ means[t]
            spread = forward @ spreads[t] @ forward.T + np.diag([WANDERS[t], TURNS[t]]) * sd**2
            miss = u - mean[0]
            lately[t] += 0.5 * (miss / sd - lately[t])
            square[t] += (min((miss / sd) ** 2, 25.0) - square[t]) / 200.0
            if lately[t] ** 2 > 9.0 / 3.0 * (spread[0, 0] / sd**2 + 1.0):
                spread[0, 0] += max(miss**2, lately[t] ** 2 * sd**2)
                lately[t] = 0.0
            gain = spread[:, 0] / (spread[0, 0] + sd**2)
            passed[t] = (1.0 - gain[0]) * (forward @ spreads[t])[0, 0] / sd**2
            means[t], spreads[t] = mean + gain * miss, spread - np.outer(gain, spread[0])
        weight = (square.min() / square) ** 64
        weight /= weight.sum()
        value = float(weight @ means[:, 0])
        variance = float(weight @ (spreads[:, 0, 0] + (means[:, 0] - value) ** 2)) / sd**2
        fade = min(float(weight @ passed) / rough, 1.0)
        fresh = max(variance - fade**2 * rough, 1e-6 * variance)
        rough = fade**2 * rough + fresh
        rows.append([value, fade, fresh * sd**2])
    return np.array(rows)


def courses() -> dict[str, FloatArray]:
    """What acts: still, with small and large steps, with ramps, and swinging."""
    steps = np.random.default_rng(5).uniform(-1.0, 1.0, 10)
    return {
        "still": np.full(2000, 325.0),
        "small steps": 325.0 + np.repeat(4.0 * steps, 200),
        "steps": 325.0 + np.repeat(40.0 * steps, 200),
        "ramps": 325.0 + np.interp(TIME, [0.0, 0.05, 0.1, 0.2], [0.0, 0.0, 50.0, 50.0]),
        "slow": 325.0 + 10.0 * np.sin(2.0 * np.pi * 5.0 * TIME),
        "mains": 325.0 * np.sin(2.0 * np.pi * 50.0 * TIME),
    }


def recorded(text: str, seed: int, *faults: Fault) -> Simulation:
    """A recording of the filter: what acts is smooth, with a step, and its record scatters."""
    graph = parse_model(text)
    values = 325.0 + 10.0 * np.sin(2.0 * np.pi * 5.0 * TIME) + np.where(TIME > 0.05, 20.0, 0.0)
    amps = 325.0 / 21.0
    start = {"L1.p": 5e-3 * amps, "C1.q": 470e-6 * 20.0 * amps}
    inputs, effects = Inputs(time=TIME, values=values[:, None]), Effects(spread=0.02)
    return simulate(graph, inputs, faults, seed=seed, effects=effects, start=start)


@pytest.mark.parametrize("name", courses())
def test_trends_are_kalman_filters(name: str) -> None:
    """What the core takes for the input, and says of its error, is what filters written with matrices give."""
    record = courses()[name] + np.random.default_rng(1).standard_normal(2000)
    assert packed(record)[:600] == pytest.approx(expected(record[:600], 1.0), rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("wild", [1e120, -1e300, 1.7e308])
def test_a_record_beyond_all_measure_is_not_followed(wild: float) -> None:
    """Its square is no number, nor would any mean be one after it."""
    record = 24.0 + np.random.default_rng(3).normal(0.0, 1.0, 400)
    spoilt = record.copy()
    spoilt[200:203] = wild
    found, without = packed(spoilt), packed(record)
    assert np.isfinite(found[203:]).all()
    np.testing.assert_allclose(found[300:, 0], without[300:, 0], atol=0.5)


@pytest.mark.parametrize(
    ("name", "most"),
    [("still", 0.3), ("small steps", 0.4), ("steps", 0.35), ("ramps", 0.35), ("slow", 0.4), ("mains", 0.9)],
)
def test_errors_are_as_large_as_said(name: str, most: float) -> None:
    """What is taken for the input is nearer to what acts than the record, and as near as it says."""
    generator, squares, said = np.random.default_rng(3), [], []
    for _ in range(3):
        found = packed(courses()[name] + generator.standard_normal(2000))
        variance = 0.0
        for (_, fade, fresh), error in zip(found, found[:, 0] - courses()[name], strict=True):
            variance = fade**2 * variance + fresh
            squares.append(error**2)
            said.append(variance)
    assert np.sqrt(np.mean(squares)) < most
    assert 0.3 < np.mean(np.array(squares) / said) < 1.6


def test_a_step_is_followed_at_once() -> None:
    """In the row of a large step the input is where the record is."""
    truth = np.where(np.arange(400) < 200, 325.0, 300.0)
    record = truth + np.random.default_rng(2).standard_normal(400)
    found = packed(record)
    assert found[200, 0] == pytest.approx(record[200], abs=0.1)
    assert found[200, 2] > 0.5  # as uncertain as one reading
    assert found[199, 1] > 0.5 > found[200, 1]


def test_a_missing_value_is_held() -> None:
    """An input that is missing stays where it was taken to be, and so does its error."""
    record = 325.0 + np.random.default_rng(2).standard_normal(300)
    record[200:205] = np.nan
    found = packed(record)
    assert np.all(found[200:205, 0] == found[199, 0])
    assert np.all(found[200:205, 1:] == [1.0, 0.0])


def test_the_fault_is_valued() -> None:
    """With a supply whose meter scatters a changed coil has its value; taken for what acts, it is wrong."""
    made = recorded(PLAIN, 3, Fault(parameter="L1", factor=1.3, start=0.12))
    off = {}
    for text in (COILS, PLAIN):
        monitor, _ = run(engine(text), samples_of(made.time, made.inputs, made.outputs))
        best = monitor.conclude().candidates[0]
        assert best.parameters == ("L1",)
        assert 0.12 < monitor.number("alarm.time") < 0.125
        off[text] = abs(best.suspects[0].estimate - made.parameters[-1][0]) / best.suspects[0].sd
    assert off[COILS] < 3.0
    assert off[PLAIN] > 4.0


def test_healthy_is_quiet() -> None:
    """A healthy recording raises no alarm; taken for what acts, the scatter raises one."""
    made = [recorded(PLAIN, seed) for seed in (4, 5, 6)]
    alarms = {
        text: [
            run(engine(text), samples_of(item.time, item.inputs, item.outputs))[0].number("clock.alarm")
            for item in made
        ]
        for text in (COILS, PLAIN)
    }
    assert max(alarms[COILS]) < 0
    assert max(alarms[PLAIN]) >= 0


def test_a_fit_takes_it_as_the_engine_does() -> None:
    """At known parameters the likelihood foretells readings as the filter of the engine does."""
    certain = COILS.replace("name: filter of coils", "name: filter of coils\naccuracy: 0.0001 %")
    text = certain.replace("C1: 470 uF}", "C1: 470 uF}, start: {q: 0.1453 C, sd: 1e-4 C}").replace(
        "L1: 5 mH}", "L1: 5 mH}, start: {p: 0.0774 Wb, sd: 1e-4 Wb}"
    )
    plant = build_plant(parse_model(text))
    usual = build_spec(build_step_model(plant))
    core = build_core(plant, replace(usual, states=tuple(replace(item, noise=0.0) for item in usual.states)))
    made = recorded(PLAIN, 3)
    record = healthy_recording("made", samples_of(made.time, made.inputs, made.outputs)[:300], core)
    model, spec = build_step_model(plant), core.spec
    start = build_begin(model)(nominal_q(model), np.zeros(2)).full()[:, 0]
    own = np.zeros((spec.n_numbers, 1))
    own[: spec.n_joint, 0] = [*start[:2], 1.0, 1.0, 1.0, 1.0, 0.0]
    rows, columns = np.triu_indices(spec.n_joint)
    full = np.zeros((spec.n_joint, spec.n_joint))
    full[:2, :2] = [[start[3], start[4]], [start[4], start[6]]]
    own[spec.n_joint : spec.n_joint + len(rows), 0] = full[rows, columns]
    place = sample_fields(1, 2, 0)
    assert 0.0 < record.samples[200, place["fade"]] < 1.0
    rows_packed = record.packed.copy()
    rows_packed[:, spec.sample_fields["bound"]] = 0.0
    _, seen = core.advance(own, rows_packed)
    for k, found in enumerate(likelihood_engine(model).advance(start[:, None], record.samples)[1][:, :, 0]):
        # Of the first sensor: nothing was told before it.
        assert found[2] == pytest.approx(seen[k, 2, 0], rel=1e-5)
        assert found[0] == pytest.approx(seen[k, 0, 0], abs=1e-4 * np.sqrt(found[2]))


def test_nobody_adds_noise_to_it() -> None:
    """What a model may leave out is not the scatter of a record that is known to be its own."""
    kinds = {text: {item.kind for item in possible(parse_model(text), ())} for text in (COILS, PLAIN)}
    assert Kind.INPUT_NOISE not in kinds[COILS]
    assert Kind.INPUT_NOISE in kinds[PLAIN]


def test_mistakes() -> None:
    """Another word, no noise, or a network without time is refused by name and line."""
    with pytest.raises(ModelError, match=r":3: input U: noise_of is `input`, what acts scatters, or `record`"):
        parse_model(COILS.replace("of: record", "of: meter"))
    with pytest.raises(ModelError, match="input U: noise_of: there is no `noise` beside it"):
        parse_model(COILS.replace("noise: 1 V, ", ""))
    static = "name: s\nsample_time: none\ninputs: {u: {noise: 1, noise_of: record}}\n"
    with pytest.raises(ModelError, match="input u: noise_of: with `sample_time: none` each row stands by itself"):
        parse_model(static + "blocks: {a: {law: x = 2*u}}\nsensors: {y: {reads: x}}")


def test_the_text_says_it() -> None:
    """It is in the canonical text, where it is not the default, and the builder knows the word."""
    text = parse_model(COILS).text
    assert "noise_of: record" in text
    assert parse_model(text).inputs[0].smooth
    assert parse_model(PLAIN.replace("noise: 1 V", "noise: 1 V, noise_of: input")).text == parse_model(PLAIN).text
    built = ModelBuilder("m", sample_time="1 s").input("u", noise=1, noise_of="record")
    assert built.block("a", "der(x) = u").sensor("y", "x", noise=1).build().inputs[0].smooth
