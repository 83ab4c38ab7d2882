"""A motor turns a load through a soft shaft: Coulomb and Stribeck friction, a torque that lags, encoders that step."""

import math

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels

ROWS, STEP = 6000, 0.005
SLIP = 0.08  # rad/s


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw the speeds that are wanted; a controller of the motor's speed sets the torque."""
    wanted = levels(generator, -30.0, 30.0, (0.6, 2.0), ROWS * STEP)
    aim, total = 0.0, 0.0

    def command(now: float, readings: Values) -> Values:
        nonlocal aim, total
        aim += float(np.clip(wanted(now) - aim, -0.6, 0.6))  # 120 rad/s2
        error = aim - (readings[0] if np.isfinite(readings[0]) else 0.0)
        total = float(np.clip(total + 1.2 * error * STEP, -6.0, 6.0))
        return (float(np.clip(0.35 * error + total, -12.0, 12.0)),)

    return [0.0, 0.0, 0.0], command


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Give the rates of both speeds and of the twist; the shaft stiffens by 5 % where it is wound up."""
    w1, w2, twist = x
    torque = p["k"] * twist * (1.0 + 0.05 * (twist / 0.05) ** 2) + p["d"] * (w1 - w2)
    stribeck = 1.0 + 0.4 * math.exp(-((w1 / 1.5) ** 2))
    motor = p["b1"] * w1 + p["Tc"] * stribeck * math.tanh(w1 / SLIP)
    load = p["b2"] * w2 + (0.05 + 0.01 * abs(torque)) * math.tanh(w2 / SLIP)
    return [(p["Kt"] * u[0] - motor - torque) / p["J1"], (torque - load) / p["J2"], w1 - w2]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give both speeds, rad/s."""
    return x[0], x[1]


RIG = Rig(
    name="two_mass_drive",
    step=STEP,
    rows=ROWS,
    substeps=4,
    parameters={"Kt": 0.78, "J1": 0.0208, "J2": 0.0315, "k": 57.0, "d": 0.06, "b1": 0.021, "b2": 0.011, "Tc": 0.31},
    wander={"Tc": (0.05, 3.0), "b1": (0.03, 10.0), "Kt": (0.005, 10.0)},
    inputs={"i": Input(lag=0.002)},
    sensors={"w1": Sensor(noise=0.03, quantum=0.06), "w2": Sensor(noise=0.05, quantum=0.12, lag=0.003)},
    begin=begin,
    rate=rate,
    reads=reads,
)
