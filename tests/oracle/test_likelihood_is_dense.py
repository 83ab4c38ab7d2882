"""The likelihood in loops against a textbook filter in full matrices, on plants with all that a model may declare."""

import numpy as np
import pytest

from faultbond.app.likelihood import likelihood_engine
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.fit.likelihood import build_begin, layout_of, nominal_q, sample_fields
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_model

TANK = """
name: tank
sample_time: 2 s
constants: {full: 100 percent, rg: 9810 Pa/m, bend: 20 Pa, curve: 50 Pa, h0: 5000 kW}
inputs:
  feed: {unit: L/s, noise: 0.02 L/s}
  gate: {unit: percent, hold: linear}
  heat: {unit: kW, hold: next, noise: 0.1 kW}
components:
  pump: {type: Sf, law: f = feed*(1 + heat/h0)}
  tank: {type: C, law: e = rg/A*q, parameters: {A: 0.4 m^2}, start: {q: 0.3 m^3, sd: 0.05 m^3}}
  pipe: {type: R, law: "f = K*gate/full*e/sqrt(abs(e) + bend)", parameters: {K: 2e-5 m^3/(s*Pa^0.5)}}
  valve: {type: R, law: "f = V*e/sqrt(abs(e) + curve)", parameters: {V: 3e-5 m^3/(s*Pa^0.5)}}
junctions: {level: 0, out: 1}
bonds: [pump -> level -> tank, level -> out, out -> pipe, out -> valve]
sensors:
  p: {reads: tank.e, unit: Pa, noise: 30 Pa}
  f: {reads: pipe.f, unit: L/s, noise: 0.01 L/s + 2 %, lag: 5 s}
  g: {reads: pipe.f, unit: L/s, noise: 0.03 L/s, lag: 3 s, valid_when: gate > 50}
slow_error: {pump.f: 3 % over 60 s, p: {size: 50 Pa over 100 s, after: [feed], each: 90 Pa*s/L}}
"""


HELD = ((0, 2),)  # sensors with a condition, among these, and the states by which they lag


def dense(model: StepModel, q: FloatArray, start: FloatArray, samples: FloatArray) -> FloatArray:
    """Give innovations and their variances, (n_samples, 2 * n_outputs), of one filter in full matrices."""
    size, graph = layout_of(model), model.plant.graph
    n, n_x, n_b, n_y = size.n_mean, size.n_x, size.n_b, size.n_y
    place = size.sample_fields
    lane = build_begin(model)(q, start).full()[:, 0]
    mean, covariance = lane[:n].copy(), np.zeros((n, n))
    covariance[np.triu_indices(n)] = lane[n : n + n * (n + 1) // 2]
    covariance += np.triu(covariance, 1).T
    factors, sd = q[: size.n_p], np.exp(q[size.n_p : size.first_memory])
    memory, each = np.exp(q[size.first_memory : size.first_each]), np.exp(q[size.first_each :])
    order = [item.name for item in graph.inputs]
    follows = [(k, order.index(name)) for k, item in enumerate(graph.slow_errors) for name in item.after]
    kept = [*range(n_x + n_b), *range(n_x + n_b + size.n_p, n_x + n_b + size.n_p + size.n_w)]
    felt, z, seen = np.zeros(len(follows)), model.reference_implicit, []

    def joint() -> FloatArray:
        return np.concatenate([mean[: n_x + n_b], factors, mean[n_x + n_b :]])

    for row in samples:
        dt, before, u = row[0], row[place["u_before"]], row[place["u"]]
        x, slope, z = (item.full() for item in model.follow(joint(), before, u, z, dt))
        decay = np.exp(-dt / memory)
        felt = felt * decay[[k for k, _ in follows]] + [u[i] - before[i] for _, i in follows]
        squares = sd[n_y : n_y + n_b] ** 2
        for (k, _), size_each, moved in zip(follows, each, felt, strict=True):
            squares[k] += (size_each * moved) ** 2
        fade, fresh = row[place["fade"]][list(model.noisy)], row[place["fresh"]][list(model.noisy)]
        transition = np.vstack([slope[:, kept], np.diag(np.concatenate([np.zeros(n_x), decay, fade]))[n_x:]])
        added = np.concatenate([np.zeros(n_x), squares * (1.0 - decay**2), sd[n_y + n_b :] ** 2 * fresh])
        for number, lagging in HELD:
            if row[place["held"]][number]:  # its law may have no value
                x[lagging], transition[lagging], added[lagging] = (
                    mean[lagging],
                    0.0,
                    (1e3 * graph.sensors[2].noise) ** 2,
                )
        mean = np.concatenate([x[:, 0], np.concatenate([decay, fade]) * mean[n_x:]])
        covariance = transition @ covariance @ transition.T + np.diag(added)
        expected, slope, z = (item.full() for item in model.measure(joint(), u, z))
        for j, item in enumerate(graph.sensors):  # of what does not read as stated nothing is expected
            if item.valid_when is not None and not row[place["use"]][j]:
                expected[j], slope[j] = 0.0, 0.0
        e, s, shift = np.zeros(n_y), np.zeros(n_y), np.zeros(n)
        for j, item in enumerate(graph.sensors):
            by = slope[j, kept]
            s[j] = by @ covariance @ by + sd[j] ** 2 * (1.0 + (item.growth * expected[j, 0]) ** 2)
            e[j] = row[place["y"]][j] - expected[j, 0] - by @ shift
            if row[place["use"]][j]:
                gain = covariance @ by / s[j]
                shift, covariance = shift + gain * e[j], covariance - np.outer(gain, by @ covariance)
        mean = mean + shift
        seen.append(np.concatenate([e, s]))
    return np.array(seen)


def made(model: StepModel, n: int, seed: int) -> FloatArray:
    """Give samples in which everything moves, and some readings are missing."""
    rng, size = np.random.default_rng(seed), layout_of(model)
    place, rows = sample_fields(size.n_u, size.n_y, size.n_held), np.zeros((n, size.n_sample))
    rows[1:, 0] = rng.choice([2.0, 2.0, 5.0], n - 1)
    u = np.array([1e-3, 60.0, 500.0]) * rng.uniform(0.5, 1.5, (n, 3))
    rows[:, place["u"]], rows[1:, place["u_before"]], rows[0, place["u_before"]] = u, u[:-1], u[0]
    rows[:, place["y"]] = np.array([7e3, 1e-3, 1e-3]) * rng.uniform(0.9, 1.1, (n, 3))
    rows[:, place["use"]] = rng.uniform(size=(n, 3)) < 0.8
    rows[:, place["held"]] = rng.uniform(size=(n, 1)) < 0.3
    rows[:, place["fade"]], rows[:, place["fresh"]] = 0.3, 0.91
    return rows


def test_loops_give_what_full_matrices_give() -> None:
    """Of each lane, whatever its parameters and sizes of noise, and of those beside it."""
    model = build_model(parse_model(TANK))
    assert model.z.numel()
    assert model.states[HELD[0][1]].startswith("g")
    engine, size, begin = likelihood_engine(model), layout_of(model), build_begin(model)
    rng, samples = np.random.default_rng(5), made(model, 60, 6)
    q = nominal_q(model) + np.concatenate(
        [np.zeros((11, size.n_p)), rng.normal(0, 0.4, (11, size.n_q - size.n_p))], axis=1
    )
    q[:, : size.n_p] *= rng.uniform(0.7, 1.4, (11, size.n_p))
    starts = rng.uniform(1e-4, 2e-3, (11, size.n_x))
    lanes = begin(q.T, starts.T).full()
    found = np.empty((len(samples), 2 * size.n_y, 11))
    for part in (slice(0, 23), slice(23, 60)):
        lanes, found[part] = engine.advance(lanes, samples[part])
    for k in range(11):
        expected = dense(model, q[k], starts[k], samples)
        assert found[:, :, k] == pytest.approx(expected, rel=1e-7, abs=1e-12)
