"""A cell under a drive cycle: resistance that falls as it warms, two relaxations, hysteresis, a noisy meter."""

import math

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels, moments, wandering

ROWS, STEP = 4000, 1.0


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw a drive cycle: current in steps with a rest now and then, and the air, which wanders."""
    time = moments(ROWS, STEP)
    slow, fast = (levels(generator, -50.0, 130.0, hold, ROWS * STEP) for hold in ((40.0, 150.0), (5.0, 25.0)))
    air = 22.0 + generator.normal(0.0, 3.0) + wandering(time, 1500.0, generator)
    warm = float(air[0]) + generator.uniform(0.0, 3.0)

    def command(now: float, _: Values) -> Values:
        rest = (now // 100.0) % 7 == 6
        return 0.0 if rest else 0.6 * slow(now) + 0.4 * fast(now), float(air[round(now / STEP)])

    return [0.9 + generator.normal(0.0, 0.01), 0.0, 0.0, warm, 0.0], command


def open_voltage(soc: float) -> float:
    """Give the voltage of the cell at rest, V: a cubic with a ripple, which makes its slope wrong by 5 %."""
    s = soc - 0.6
    return 3.68 + 0.62 * s + 0.35 * s**2 + 0.5 * s**3 + 0.003 * math.sin(10.0 * s)


def losses(x: Values, u: Values, p: Parameters) -> tuple[float, float, float]:
    """Give the voltages over the resistance and the two relaxations; the resistance falls by 0.6 % a kelvin."""
    return p["R0"] * math.exp(-0.006 * (x[3] - 28.0)) * u[0], x[1], x[2]


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Give the rates of charge, two relaxations, temperature and hysteresis."""
    ohmic, first, second = losses(x, u, p)
    heat = ohmic * u[0] + first**2 / p["R1"] + second**2 / 0.9e-3
    return [
        -u[0] / (3600.0 * p["Q"]),
        (u[0] - first / p["R1"]) / 17e3,
        (u[0] - second / 0.9e-3) / 230e3,
        (heat - p["hA"] * (x[3] - u[1])) / 880.0,
        -abs(u[0]) / 18000.0 * (x[4] + math.copysign(1.0, u[0])),
    ]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give voltage, V, and the temperature of the skin, degC."""
    return open_voltage(x[0]) - sum(losses(x, u, p)) + 0.004 * x[4], x[3]


RIG = Rig(
    name="battery_cell",
    step=STEP,
    rows=ROWS,
    substeps=1,
    parameters={"Q": 48.6, "R0": 1.55e-3, "R1": 0.82e-3, "hA": 1.15},
    wander={"hA": (0.04, 900.0)},
    inputs={"I": Input(measured=True, noise=0.2, quantum=0.1), "T_air": Input(measured=True, noise=0.1, quantum=0.1)},
    sensors={"V": Sensor(noise=1.2e-3, quantum=1e-3), "T": Sensor(noise=0.08, quantum=0.1, lag=15.0)},
    begin=begin,
    rate=rate,
    reads=reads,
)
