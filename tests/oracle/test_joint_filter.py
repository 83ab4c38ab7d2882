"""The filter against a plain one: dense matrices, all measurements at once, the motor's equations written by hand."""

from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.simulate import Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine

EXAMPLES = Path(__file__).parents[2] / "examples"
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
NOMINAL = np.array([3.0, 2.5, 2.0, 1.5, 0.4])  # R L K J C
NOISE_V, NOISE_Y = 0.16, np.array([0.06, 0.02])
H = np.zeros((2, 8))
H[0, 1] = H[1, 0] = 1.0  # speed and current are the states, in the other order


def motor(z: FloatArray, voltage: float) -> tuple[FloatArray, FloatArray]:
    """Rates of current and speed, and their slopes by z = [i, omega, factors of R L K J C, voltage noise]."""
    i, omega = z[:2]
    R, L, K, J, C = z[2:7] * NOMINAL
    current = voltage + z[7] - R * i - K * omega
    torque = K * i - C * omega
    slope = np.zeros((2, 8))
    slope[0] = [-R / L, -K / L, -i * 3.0 / L, -current / L**2 * 2.5, -omega * 2.0 / L, 0.0, 0.0, 1.0 / L]
    slope[1] = [K / J, -C / J, 0.0, 0.0, i * 2.0 / J, -torque / J**2 * 1.5, -omega * 0.4 / J, 0.0]
    return np.array([current / L, torque / J]), slope


def predicted(
    spec: EngineSpec, z: FloatArray, P: FloatArray, voltage: float, dt: float, gap: FloatArray
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance one step later: ROS2 and its slopes, Jacobian inside the method held."""
    f, D = motor(z, voltage)
    W = np.linalg.inv(np.eye(2) - GAMMA * dt * D[:, :2])
    k1, d1 = W @ f, W @ D
    middle, moved = z.copy(), np.eye(8)
    middle[:2] += dt * k1
    moved[:2] += dt * d1
    f, D = motor(middle, voltage)
    k2, d2 = W @ (f - 2.0 * k1), W @ (D @ moved - 2.0 * d1)
    F = np.eye(8)
    F[:2] += dt * (1.5 * d1 + 0.5 * d2)
    F[7, 7] = 0.0
    z_next = z.copy()
    z_next[:2] += dt * (1.5 * k1 + 0.5 * k2)
    z_next[7] = 0.0
    unknown = [item.noise**2 * (dt > 0.0) + sd**2 for item, sd in zip(spec.states, gap, strict=True)]
    return z_next, F @ P @ F.T + np.diag([*unknown, *[0.0] * 5, NOISE_V**2])


def updated(
    z: FloatArray, P: FloatArray, y: FloatArray, rows: FloatArray, scale: FloatArray
) -> tuple[FloatArray, FloatArray, float]:
    """Mean, covariance and log-likelihood after all present measurements at once (Joseph's form)."""
    h, noise = H[rows], np.diag((NOISE_Y**2 * scale)[rows])
    S = h @ P @ h.T + noise
    gain = P @ h.T @ np.linalg.inv(S)
    error = (y - H @ z)[rows]
    rest = np.eye(8) - gain @ h
    relative = S / np.outer(NOISE_Y[rows], NOISE_Y[rows])
    likelihood = -0.5 * (error @ np.linalg.solve(S, error) + np.log(np.linalg.det(2.0 * np.pi * relative)))
    return z + gain @ error, rest @ P @ rest.T + gain @ noise @ gain.T, float(likelihood)


@pytest.fixture(scope="module")
def motor_engine() -> tuple[EngineSpec, Core]:
    """The motor with measured current."""
    return build_engine(load_model(EXAMPLES / "dc_motor_current" / "model.yaml"))


def recording(spec: EngineSpec, rows: int) -> FloatArray:
    """Packed samples of the motor with noise, now and then a missing or a blanked value."""
    generator = np.random.default_rng(7)
    time = np.asarray(np.arange(rows) * 0.02, dtype=np.float64)
    V = random_steps(time, generator, low=2.0, high=12.0, shortest=0.2, longest=1.0)
    graph = load_model(EXAMPLES / "dc_motor_current" / "model.yaml")
    made = simulate(graph, Inputs(time=time, values=V[:, None]), seed=5)
    samples, place = np.zeros((rows, spec.n_sample)), spec.sample_fields
    samples[1:, place["dt"]] = 0.02
    samples[:, place["u"]] = made.inputs
    samples[:, place["u_before"]] = made.inputs[[0, *range(rows - 1)]]
    samples[:, place["y"]] = made.outputs
    samples[:, place["use"]] = generator.random((rows, 2)) > 0.2
    samples[:, place["scale"]] = np.where(generator.random((rows, 2)) > 0.9, 1e4, 1.0)
    samples[:, place["fresh"]] = spec.input_variance
    samples[60:, place["dt"]] = 0.03  # an irregular grid is allowed
    samples[70:71, place["gap"]] = [0.4, 0.7]
    samples[80:81, place["gap"]] = [0.0, 0.2]
    return samples


def test_two_hundred_samples_equal_the_plain_filter(motor_engine: tuple[EngineSpec, Core]) -> None:
    """Mean, covariance and log-likelihood of 200 samples are those of the plain filter to nine digits."""
    spec, engine = motor_engine
    samples, place = recording(spec, 200), spec.sample_fields
    start = np.array([0.4, -0.3])
    lane = engine.healthy_lane(start, np.diag([0.5, 0.7]))
    z = np.array([*start, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0])
    P = np.diag([0.5, 0.7, *[0.03**2] * 5, NOISE_V**2])
    total = 0.0
    for sample in samples:
        lane, innovations = engine.advance(lane, sample[None, :])
        before, dt = (float(sample[place[name]][0]) for name in ("u_before", "dt"))
        z, P = predicted(spec, z, P, before, dt, sample[place["gap"]])
        y, scale = sample[place["y"]], sample[place["scale"]]
        assert innovations[0, :2, 0] == pytest.approx(y - H @ z, rel=1e-9, abs=1e-9)
        assert innovations[0, 2:, 0] == pytest.approx(np.diag(H @ P @ H.T) + NOISE_Y**2 * scale, rel=1e-9)
        z, P, gain = updated(z, P, y, sample[place["use"]] > 0, scale)
        total += gain
        assert lane[:8, 0] == pytest.approx(z, rel=1e-9, abs=1e-9)
        covariance, sd = unpack(spec, lane[spec.covariance_slice, 0]), np.sqrt(np.diag(P))
        assert np.max(np.abs(covariance - P) / np.outer(sd, sd)) < 1e-9
        assert lane[-1, 0] == pytest.approx(total, rel=1e-9, abs=1e-9)


def test_order_of_the_sensors_does_not_matter(motor_engine: tuple[EngineSpec, Core]) -> None:
    """Where readings are linear, both sensors in one sample equal one after the other, in samples of no time."""
    spec, engine = motor_engine
    place = spec.sample_fields
    sample = recording(spec, 12)[-1]
    sample[place["use"]], sample[place["scale"]] = 1.0, 1.0
    lane = engine.healthy_lane(np.array([1.0, 2.0]), np.array([[0.5, 0.2], [0.2, 0.7]]))
    both, _ = engine.advance(lane, sample[None, :])
    before = unpack(spec, lane[spec.covariance_slice, 0])
    z, P = predicted(spec, lane[:8, 0], before, float(sample[place["u_before"]][0]), 0.02, np.zeros(2))
    total = 0.0
    for j in (1, 0):
        z, P, gain = updated(z, P, sample[place["y"]], np.arange(2) == j, np.ones(2))
        total += gain
    assert both[:8, 0] == pytest.approx(z, rel=1e-10, abs=1e-12)
    assert both[-1, 0] == pytest.approx(total, rel=1e-10)
