"""The joint filter: missing values, slow errors, bent readings, ranges, and a covariance that stays one."""

from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.lanes import plan_lanes
from faultbond.contract.spec import EngineSpec, pack, unpack
from faultbond.equations.step import StepModel
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine, build_model
from lanes import suspect_lanes

EXAMPLES = Path(__file__).parents[3] / "examples"
RC = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8")


def built(text: str) -> tuple[EngineSpec, StepModel, Core]:
    """Specification, step and engine of a model text."""
    graph = parse_model(text)
    spec, engine = build_engine(graph)
    return spec, build_model(graph), engine


def sample_of(spec: EngineSpec, **fields: float | list[float]) -> FloatArray:
    """One packed sample; scale is 1, noise of inputs white and the rest 0 where it is not given."""
    packed = np.zeros((1, spec.n_sample))
    packed[:, spec.sample_fields["scale"]] = 1.0
    packed[:, spec.sample_fields["fresh"]] = spec.input_variance
    for name, value in fields.items():
        packed[:, spec.sample_fields[name]] = value
    return packed


def correlated(engine: Core, seed: int = 0) -> FloatArray:
    """A healthy lane, shape (n_numbers, 1), with a covariance that is full."""
    spec, generator = engine.spec, np.random.default_rng(seed)
    lane = engine.healthy_lane(np.full(len(spec.states), 2.0), np.eye(len(spec.states)))
    root = 0.05 * generator.normal(size=(spec.n_joint, spec.n_joint))
    lane[spec.covariance_slice, 0] = pack(root @ root.T + 0.01 * np.eye(spec.n_joint))
    return lane


def test_missing_value_is_a_pure_prediction() -> None:
    """With its value missing, a sample leaves the predicted mean and covariance and no likelihood."""
    spec, model, engine = built(RC)
    lane = correlated(engine)
    found, _ = engine.advance(lane, sample_of(spec, dt=0.02, u_before=5.0, u=7.0, y=123.0))
    mean, slope, _ = model.predict(lane[:4, 0], [5.0], [], 0.02)
    F = np.eye(4)
    F[:1], F[3, 3] = slope.full(), 0.0
    P = F @ unpack(spec, lane[spec.covariance_slice, 0]) @ F.T
    P[3, 3] += spec.inputs[0].noise ** 2
    P[0, 0] += spec.states[0].noise ** 2
    assert found[0, 0] == pytest.approx(float(mean), rel=1e-14)
    assert found[1:3, 0] == pytest.approx(lane[1:3, 0], rel=1e-14)
    assert found[3, 0] == 0.0
    assert unpack(spec, found[spec.covariance_slice, 0]) == pytest.approx(P, rel=1e-12)
    assert found[-1, 0] == 0.0


def test_first_sample_moves_nothing() -> None:
    """A blind sample of no time leaves states, parameters and their covariance to the last bit."""
    spec, _, engine = built(RC)
    lane = correlated(engine)
    found, _ = engine.advance(lane, sample_of(spec, u_before=5.0, u=5.0))
    before, after = (unpack(spec, item[spec.covariance_slice, 0]) for item in (lane, found))
    assert np.array_equal(found[:3], lane[:3])
    assert np.array_equal(after[:3, :3], before[:3, :3])
    assert after[3] == pytest.approx([0.0, 0.0, 0.0, 0.01])


def test_likelihood_is_that_of_the_prediction() -> None:
    """The log-likelihood of a value is the normal density of its innovation in units of the sensor's noise."""
    spec, _, engine = built(RC)
    lane, noise = correlated(engine), spec.outputs[0].noise
    found, innovations = engine.advance(lane, sample_of(spec, dt=0.02, u_before=5.0, u=5.0, y=2.4, use=1.0))
    error, variance = innovations[0, :, 0]
    expected = -0.5 * (error**2 / variance + np.log(2.0 * np.pi * variance / noise**2))
    assert found[-1, 0] == pytest.approx(expected, rel=1e-12)


def test_slow_error_forgets_and_is_kicked() -> None:
    """A slow error decays with its memory towards its declared variance, and a kick adds to it."""
    spec, _, engine = built(RC + "slow_error: {V_C: 0.3 V over 2 s}\n")
    lane = correlated(engine)
    lane[1, 0] = 0.5
    found, _ = engine.advance(lane, sample_of(spec, dt=0.5, u_before=5.0, u=5.0, kick=0.04))
    decay = np.exp(-0.5 / 2.0)
    before, after = (unpack(spec, item[spec.covariance_slice, 0])[1, 1] for item in (lane, found))
    assert found[1, 0] == pytest.approx(0.5 * decay, rel=1e-12)
    assert after == pytest.approx(before * decay**2 + 0.3**2 * (1.0 - decay**2) + 0.04, rel=1e-12)


BENT = RC.replace("reads: C.e", "reads: C.e*R/R_ref") + "constants: {R_ref: 10 kohm}\n"


def test_bent_reading_is_read_twice() -> None:
    """Where a reading is not linear, its slopes are taken again at the parameters that were found, and the old states.

    States that follow the noise of the sample would put it into the slopes that are to weigh it.
    """
    spec, model, engine = built(BENT)
    assert not model.measure_is_linear
    lane, noise = correlated(engine), spec.outputs[0].noise
    sample = sample_of(spec, dt=0.02, u_before=5.0, u=5.0, y=2.9, use=1.0, again=1.0)
    blind = sample.copy()
    blind[:, spec.sample_fields["use"]] = 0.0
    predicted = engine.advance(lane, blind)[0]
    m, P = predicted[:4, 0], unpack(spec, predicted[spec.covariance_slice, 0])
    at, likelihoods = m.copy(), []
    for _ in range(2):
        h = np.array([at[1], at[0], 0.0, 0.0])  # by the voltage, the factor of R, that of C, and the input's noise
        S = h @ P @ h + noise**2
        error = 2.9 - at[0] * at[1] - h @ (m - at)
        likelihoods.append(-0.5 * (error**2 / S + np.log(2.0 * np.pi * S / noise**2)))
        guess = m + P @ h / S * error
        at = np.array([m[0], guess[1], guess[2], m[3]])
    found, innovations = engine.advance(lane, sample)
    assert found[:4, 0] == pytest.approx(guess, rel=1e-10)
    assert unpack(spec, found[spec.covariance_slice, 0]) == pytest.approx(P - np.outer(P @ h, P @ h) / S, abs=1e-12)
    assert found[-1, 0] == pytest.approx(likelihoods[0], rel=1e-10)
    once, _ = engine.advance(lane, sample_of(spec, dt=0.02, u_before=5.0, u=5.0, y=2.9, use=1.0))
    h = np.array([m[1], m[0], 0.0, 0.0])
    error = 2.9 - m[0] * m[1]
    assert once[:4, 0] == pytest.approx(m + P @ h / (h @ P @ h + noise**2) * error, rel=1e-10)
    assert not np.allclose(once[:4, 0], guess, rtol=1e-6)
    assert innovations[0, 0, 0] == pytest.approx(error, rel=1e-12)


@pytest.mark.parametrize(("part", "twice"), [(0.09, False), (0.11, True)])
def test_sample_that_says_little_is_read_once(part: float, twice: bool) -> None:
    """A bent reading is read again only if what is expected of it is uncertain by a tenth of the noise and more."""
    spec, _, engine = built(BENT)
    lane = correlated(engine)
    slope = np.array([lane[1, 0], lane[0, 0], 0.0, 0.0])
    full = unpack(spec, lane[spec.covariance_slice, 0])
    full[3, :] = full[:, 3] = 0.0
    full *= part * spec.outputs[0].noise ** 2 / (slope @ full @ slope)
    lane[spec.covariance_slice, 0] = pack(full)
    fields = {"u_before": 5.0, "u": 5.0, "y": 2.3, "use": 1.0}  # no time passes: only input noise is added
    found, once = (engine.advance(lane, sample_of(spec, **fields, again=again))[0] for again in (1.0, 0.0))
    assert bool(np.any(found != once)) is twice


@pytest.mark.parametrize("use", [0.0, 1.0])
def test_missing_sensor_says_nothing(use: float) -> None:
    """A precise sensor, of which much would be expected, makes a sample say much only if it has a value."""
    bent = "{reads: C.e*R/R_ref, unit: V, noise: "
    two = f"sensors: {{rough: {bent}1 V}}, fine: {bent}1 mV}}}}\nconstants: {{R_ref: 10 kohm}}\n"
    spec, _, engine = built(RC[: RC.index("sensors:")] + two)
    lane = correlated(engine)
    lane[spec.covariance_slice] *= 1e-2 / unpack(spec, lane[spec.covariance_slice, 0])[0, 0] / 16.0
    fields: dict[str, float | list[float]] = {"u_before": 5.0, "u": 5.0, "y": [2.3, 2.1], "use": [1.0, use]}
    found, once = (engine.advance(lane, sample_of(spec, **fields, again=again))[0] for again in (1.0, 0.0))
    assert bool(np.any(found != once)) is (use > 0.0)


def test_estimates_are_not_dragged_along() -> None:
    """Thousands of samples that say little each leave a pipe's resistance where it is, within what is known of it."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    spec, engine = build_engine(graph)
    names = [item.name for item in spec.parameters]
    pipe, generator = spec.parameter_slice.start + names.index("K1"), np.random.default_rng(5)
    rows, off = 2500, []
    time = np.arange(rows, dtype=float)
    for seed in range(4):
        valves = ({"low": 30.0, "high": 90.0}, {"low": 35.0, "high": 65.0})
        u = np.array([random_steps(time, generator, shortest=200, longest=400, **between) for between in valves]).T
        made = simulate(graph, Inputs(time=time, values=u), [], seed=seed, start={"tank.q": 0.04})
        samples, place = np.repeat(sample_of(spec, dt=1.0, use=1.0, again=1.0), rows, axis=0), spec.sample_fields
        samples[0, place["dt"]] = 0.0
        samples[:, place["u"]], samples[:, place["y"]] = made.inputs, made.outputs
        samples[:, place["u_before"]] = made.inputs[[0, *range(rows - 1)]]
        lane = engine.healthy_lane(made.outputs[0, 1:], np.array([[180.0**2]]))
        full = unpack(spec, lane[spec.covariance_slice, 0])
        full[pipe, pipe] = 0.6**2
        lane[spec.covariance_slice, 0] = pack(full)
        last = engine.advance(lane, samples)[0][:, 0]
        off.append((last[pipe] - 1.0) / np.sqrt(unpack(spec, last[spec.covariance_slice])[pipe, pipe]))
    assert abs(np.mean(off)) < 0.5


def test_likelihood_reckons_with_the_usual_squares() -> None:
    """Where squares are usually smaller or larger than 1, foretelling less variance gains nothing on average.

    Smaller ones make nothing surer than it was, larger ones make all less sure.
    """
    spec, _, engine = built(RC)
    lane, common = correlated(engine), {"dt": 0.02, "u_before": 5.0, "u": 5.0, "use": 1.0, "y": 2.4}
    as_declared, innovations = engine.advance(lane, sample_of(spec, **common))
    error, variance = innovations[0, :, 0]
    gain = np.log(variance / spec.outputs[0].noise ** 2)
    for usual in (0.5, 1.0, 3.0):
        found, _ = engine.advance(lane, sample_of(spec, **common, nis=usual))
        assert np.array_equal(found[:-1], as_declared[:-1])
        expected = -0.5 * (error**2 / variance + usual * gain + np.log(2.0 * np.pi)) / max(usual, 1.0)
        assert found[-1, 0] == pytest.approx(expected, rel=1e-12)


def test_bounded_innovation_counts_so_far() -> None:
    """With a bound, a far-off value moves the mean as far as one at the bound; the likelihood sees 20 sd of it."""
    spec, _, engine = built(RC)
    lane, common = correlated(engine), {"dt": 0.02, "u_before": 5.0, "u": 5.0, "use": 1.0}
    blind, found = engine.advance(lane, sample_of(spec, **common | {"use": 0.0}))
    expected, sd = -found[0, 0, 0], np.sqrt(found[0, 1, 0])
    at_bound, _ = engine.advance(lane, sample_of(spec, **common, y=expected + 3.0 * sd))
    for far, counts in ((15.0, 15.0), (30.0, 20.0), (1e200, 20.0)):
        beyond, _ = engine.advance(lane, sample_of(spec, **common, y=expected + far * sd, bound=3.0))
        assert beyond[: spec.n_joint, 0] == pytest.approx(at_bound[: spec.n_joint, 0], rel=1e-9)
        assert np.any(beyond[: spec.n_joint, 0] != blind[: spec.n_joint, 0])
        assert beyond[-1, 0] == pytest.approx(at_bound[-1, 0] - 0.5 * (counts**2 - 3.0**2), rel=1e-9)


def test_parameters_stay_in_their_range() -> None:
    """A value that no parameter in its range explains leaves every parameter inside its range."""
    spec, _, engine = built(RC)
    for y in (-1e4, 1e4):
        found, _ = engine.advance(correlated(engine), sample_of(spec, dt=0.02, u_before=5.0, u=5.0, y=y, use=1.0))
        factors = found[spec.parameter_slice, 0]
        assert all(p.lower <= f <= p.upper for p, f in zip(spec.parameters, factors, strict=True))
        assert any(f in (p.lower, p.upper) for p, f in zip(spec.parameters, factors, strict=True))


def test_blanked_value_hardly_counts() -> None:
    """A value with a large factor on its variance moves the filter by about that much less."""
    spec, _, engine = built(RC)
    lane = correlated(engine)
    moves = []
    for scale in (1.0, 1e4, 1e8):
        sample = sample_of(spec, dt=0.0, u_before=5.0, u=5.0, y=9.0, use=1.0, scale=scale)
        moves.append(abs(engine.advance(lane, sample)[0][0, 0] - 2.0))
    assert moves[1] < 0.01 * moves[0]
    assert moves[2] == pytest.approx(1e-4 * moves[1], rel=0.05)


def test_lanes_do_not_see_each_other() -> None:
    """A lane gives the same numbers to the last bit alone and beside others, in any order."""
    spec, _, engine = built(RC)
    lanes = np.concatenate([correlated(engine, seed) for seed in range(5)], axis=1)
    samples = np.repeat(sample_of(spec, dt=0.02, u_before=5.0, u=5.0, y=3.0, use=1.0), 20, axis=0)
    together, seen = engine.advance(lanes, samples)
    order = [3, 0, 4, 2, 1]
    mixed, _ = engine.advance(lanes[:, order], samples)
    assert np.array_equal(mixed, together[:, order])
    alone, seen_alone = engine.advance(lanes[:, 2:3], samples)
    assert np.array_equal(alone[:, 0], together[:, 2])
    assert np.array_equal(seen_alone[:, :, 0], seen[:, :, 2])


def test_covariance_stays_positive_over_thousands_of_samples() -> None:
    """Over 3000 samples of a tank with a fault, every lane stays finite with a positive covariance."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    spec, engine = build_engine(graph)
    rows, generator = 3000, np.random.default_rng(2)
    time = np.arange(rows, dtype=float)
    u = np.array([random_steps(time, generator, low=low, high=90, shortest=20, longest=200) for low in (40, 20)]).T
    fault = Fault(parameter="K1", factor=1.8, start=300.0)
    made = simulate(graph, Inputs(time=time, values=u), [fault], seed=3, start={"tank.q": 0.2})
    samples, place = np.repeat(sample_of(spec, dt=1.0, use=1.0), rows, axis=0), spec.sample_fields
    samples[0, place["dt"]] = 0.0
    samples[:, place["u"]], samples[:, place["y"]] = made.inputs, made.outputs
    samples[:, place["u_before"]] = made.inputs[[0, *range(rows - 1)]]
    healthy = engine.healthy_lane(made.outputs[0, 1:], np.array([[180.0**2]]))
    lanes = suspect_lanes(spec, plan_lanes(spec), healthy[:, 0])
    for block in np.split(samples, 6):
        lanes, innovations = engine.advance(lanes, block)
        assert np.all(np.isfinite(lanes))
        assert np.all(np.isfinite(innovations))
        assert np.all(innovations[:, 2:] > 0.0)
        full = np.array([unpack(spec, lane[spec.covariance_slice]) for lane in lanes.T])
        sd = np.sqrt(np.einsum("kii->ki", full))
        assert np.all(sd > 0.0)
        smallest = np.linalg.eigvalsh(full / (sd[:, :, None] * sd[:, None, :]))[:, 0]
        assert smallest.min() > 1e-13
