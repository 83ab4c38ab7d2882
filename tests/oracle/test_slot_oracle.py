"""Lanes with a slot against a plain filter: the RC circuit and every kind of fault in it, written by hand."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.slots import SlotLane, plan_slots
from faultbond.contract.spec import EngineSpec, unpack
from faultbond.model.text import load_model
from faultbond.runtime.core import Core
from faultbond.simulate import Inputs, random_steps, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.types import FaultKind
from lanes import relinearised, slot_lanes

RC = Path(__file__).parents[2] / "examples" / "rc" / "model.yaml"
GAMMA = 1.0 - 1.0 / np.sqrt(2.0)
SAYS_MUCH = 0.1  # expected variance, in that of the noise, above which a reading is read twice
MOST = 20.0  # standard deviations
R, C, NOISE_V, NOISE_Y = 1e4, 1e-4, 0.1, 0.1
VOLTAGE, FACTOR_R, FACTOR_C, SIZE, RATE, INPUT = range(6)  # z = [V_C, factors of R and C, size, rate, input noise]


@dataclass(frozen=True)
class Acts:
    """What the size in the slot acts on, and what it does to the reading."""

    resistor: float = 0.0
    capacitor: float = 0.0
    voltage: float = 0.0
    obeys: float = 1.0
    of_record: float = 0.0  # what it adds to the voltage, in what is recorded of that
    reads: float = 1.0
    gain: float = 0.0
    added: float = 0.0
    scatter: float = 1.0  # noise variance in that declared
    keeps: float = 0.0  # 1: the capacitor keeps its charge while its capacity moves, else its voltage


def acts_of(lane: SlotLane) -> Acts:
    """What each kind of fault means, in the units of its size: noise of a sensor, volts of the input, or of none."""
    if lane.parameter >= 0:
        there = float(lane.acts)
        keeps = float(lane.keeps)
        return Acts(resistor=there * (lane.parameter == 0), capacitor=there * (lane.parameter == 1), keeps=keeps)
    if lane.scales:
        return Acts(of_record=1.0) if lane.input >= 0 else Acts(gain=1.0)
    if lane.input >= 0:
        return Acts(voltage=float(lane.acts), obeys=float(not lane.sticks))
    if not lane.acts:
        return Acts()
    return {
        FaultKind.BIAS: Acts(added=NOISE_Y),
        FaultKind.DRIFT: Acts(added=NOISE_Y),
        FaultKind.RAMP: Acts(added=NOISE_Y),
        FaultKind.STUCK: Acts(reads=0.0, added=NOISE_Y, scatter=lane.noise),
        FaultKind.NOISE: Acts(scatter=lane.noise),
        FaultKind.INTERMITTENT: Acts(reads=float(not lane.sticks), added=NOISE_Y),
    }[lane.kind]


def charging(z: FloatArray, voltage: float, acts: Acts) -> tuple[float, FloatArray]:
    """Rate of the capacitor's voltage and its slope by z."""
    r = R * (z[FACTOR_R] + acts.resistor * z[SIZE])
    c = C * (z[FACTOR_C] + acts.capacitor * z[SIZE])
    by_each = acts.voltage + acts.of_record * voltage  # V, of each of the size
    rate = (acts.obeys * voltage + z[INPUT] + by_each * z[SIZE] - z[VOLTAGE]) / (r * c)
    by_r, by_c = -rate * R / r, -rate * C / c
    by_size = by_r * acts.resistor + by_c * acts.capacitor + by_each / (r * c)
    return rate, np.array([-1.0 / (r * c), by_r, by_c, by_size, 0.0, 1.0 / (r * c)])


def predicted(
    z: FloatArray, P: FloatArray, voltage: float, dt: float, unknown: float, acts: Acts
) -> tuple[FloatArray, FloatArray]:
    """Mean and covariance one step later: ROS2, Jacobian inside the method held; the size goes on at its rate."""
    f, slope = charging(z, voltage, acts)
    inside = 1.0 / (1.0 - GAMMA * dt * slope[VOLTAGE])
    k1, d1 = inside * f, inside * slope
    middle, moved = z.copy(), np.eye(6)
    middle[VOLTAGE] += dt * k1
    moved[VOLTAGE] += dt * d1
    f, slope = charging(middle, voltage, acts)
    k2, d2 = inside * (f - 2.0 * k1), inside * (slope @ moved - 2.0 * d1)
    F = np.eye(6)
    F[VOLTAGE] += dt * (1.5 * d1 + 0.5 * d2)
    following = z.copy()
    following[VOLTAGE] += dt * (1.5 * k1 + 0.5 * k2)
    scattered = np.diag([unknown * (dt > 0.0), 0.0, 0.0, 0.0, 0.0, 0.0])
    if acts.keeps:  # q = C e stays: e goes as 1 / C
        before = z[FACTOR_C] + acts.capacitor * z[SIZE]
        after = before + acts.capacitor * dt * z[RATE]
        kept = np.eye(6)
        kept[VOLTAGE, VOLTAGE] = before / after
        following[VOLTAGE] *= before / after
        kept[VOLTAGE, FACTOR_C] = following[VOLTAGE] * (1.0 / before - 1.0 / after)
        kept[VOLTAGE, SIZE] = acts.capacitor * kept[VOLTAGE, FACTOR_C]
        kept[VOLTAGE, RATE] = -following[VOLTAGE] * acts.capacitor * dt / after
        F, scattered = kept @ F, kept @ scattered @ kept.T
    F[SIZE, RATE] = dt
    F[INPUT, INPUT] = 0.0
    following[SIZE] += dt * z[RATE]
    following[INPUT] = 0.0
    return following, F @ P @ F.T + scattered + np.diag([0.0, 0.0, 0.0, 0.0, 0.0, NOISE_V**2])


def updated(z: FloatArray, P: FloatArray, y: float, acts: Acts) -> tuple[FloatArray, FloatArray, float]:
    """Mean, covariance and log-likelihood: if the sample says much, it updates again at the faults that it found."""
    guess, spread, gained = z, P, []
    for _ in range(2):
        size = guess[SIZE]
        factor = acts.reads + acts.gain * size
        h = np.array([factor, 0.0, 0.0, acts.gain * z[VOLTAGE] + acts.added, 0.0, 0.0])
        expected = factor * z[VOLTAGE] + acts.added * size + h[SIZE] * (z[SIZE] - size)
        S = h @ P @ h + NOISE_Y**2 * acts.scatter
        off = float(np.clip((y - expected) / np.sqrt(S), -MOST, MOST))  # what is farther off counts as no farther
        gained.append(-0.5 * (off**2 + np.log(2.0 * np.pi * S / NOISE_Y**2)))
        guess, spread = z + P @ h / np.sqrt(S) * off, P - np.outer(P @ h, P @ h) / S
        if h @ P @ h <= SAYS_MUCH * NOISE_Y**2 * acts.scatter:
            break
    return guess, spread, float(gained[0])


def recording(spec: EngineSpec, rows: int) -> FloatArray:
    """Packed samples of the circuit with noise, some values missing, an irregular grid at the end."""
    generator = np.random.default_rng(3)
    time = np.asarray(np.arange(rows) * 0.02, dtype=np.float64)
    V = random_steps(time, generator, low=2.0, high=12.0, shortest=0.2, longest=1.0)
    made = simulate(load_model(RC), Inputs(time=time, values=V[:, None]), seed=5)
    samples, place = np.zeros((rows, spec.n_sample)), spec.sample_fields
    samples[1:, place["dt"]] = 0.02
    samples[rows // 2 :, place["dt"]] = 0.03
    samples[:, place["u"]] = made.inputs
    samples[:, place["u_before"]] = made.inputs[[0, *range(rows - 1)]]
    samples[:, place["y"]] = made.outputs
    samples[:, place["use"]] = generator.random((rows, 1)) > 0.2
    samples[:, place["scale"]] = 1.0
    samples[:, place["fresh"]] = spec.input_variance
    return relinearised(spec, samples)


@pytest.fixture(scope="module")
def circuit() -> tuple[EngineSpec, Core]:
    """The circuit and the engine of its lanes with a slot."""
    spec, engine = build_engine(load_model(RC))
    return spec, engine.slot


def test_every_kind_of_fault_equals_the_plain_filter(circuit: tuple[EngineSpec, Core]) -> None:
    """For every lane with a slot, mean, covariance and log-likelihood of 100 samples are those of the plain filter."""
    spec, engine = circuit
    wide, plan, place = spec.slotted, plan_slots(spec), spec.sample_fields
    samples = recording(spec, 101)
    healthy = engine.healthy_lane(np.array([4.0]), np.array([[0.5]]))[:, 0]
    healthy[spec.parameter_slice] = [1.1, 0.95]
    lanes = slot_lanes(
        spec, plan, range(plan.n_lanes), healthy, np.array([9.0]), samples[0, place["y"]], samples[0, place["u"]]
    )
    lanes[wide.slot_slice.start + 1] = 0.02  # something moves in every lane
    z, P = lanes[: wide.n_joint].T.copy(), np.array([unpack(wide, lane[wide.covariance_slice]) for lane in lanes.T])
    total = np.zeros(plan.n_lanes)
    assert {lane.kind for lane in plan.lanes} == set(FaultKind) - {FaultKind.STEP}
    for sample in samples[1:]:
        lanes, innovations = engine.advance(lanes, sample[None, :])
        y, dt, before = (float(sample[place[name]][0]) for name in ("y", "dt", "u_before"))
        for k, lane in enumerate(plan.lanes):
            acts = acts_of(lane)
            z[k], P[k] = predicted(z[k], P[k], before, dt, spec.states[0].noise ** 2, acts)
            reading = (acts.reads + acts.gain * z[k, SIZE]) * z[k, VOLTAGE] + acts.added * z[k, SIZE]
            assert innovations[0, 0, k] == pytest.approx(y - reading, rel=1e-8, abs=1e-8)
            if sample[place["use"]] > 0:
                z[k], P[k], gained = updated(z[k], P[k], y, acts)
                total[k] += gained
            sd = np.sqrt(np.diag(P[k])) + 1e-9
            assert np.max(np.abs(lanes[: wide.n_joint, k] - z[k]) / sd) < 1e-7
            covariance = unpack(wide, lanes[wide.covariance_slice, k])
            assert np.max(np.abs(covariance - P[k]) / np.outer(sd, sd)) < 1e-7
    assert lanes[-1] == pytest.approx(total, rel=1e-8)
