"""Three tanks in a row as in a laboratory: pumps with lag and a bent curve, valves not quite Torricelli's, waves."""

import math

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels

ROWS, STEP = 4000, 1.0
AREA = 0.0154  # m2
G2 = 19.62  # m/s2, twice gravity


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw how both pumps are run; each slows down where its tank is nearly full."""
    one = levels(generator, 15.0, 65.0, (100.0, 350.0), ROWS * STEP)
    two = levels(generator, 10.0, 55.0, (120.0, 400.0), ROWS * STEP)

    def command(now: float, readings: Values) -> Values:
        full = [np.isfinite(level) and level > 56.0 for level in (readings[0], readings[2])]
        return 10.0 if full[0] else one(now), 10.0 if full[1] else two(now)

    return [0.38, 0.28, 0.20], command


def valve(p: Parameters, name: str, over: float) -> float:
    """Give the flow through a valve under a head, m: laminar below a few millimetres, else a bent square root."""
    head = abs(over)
    return math.copysign(p[name] * (G2 * head) ** 0.5 * (1.04 - 0.12 * head) * math.tanh(head / 0.004), over)


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Give the rates of the levels: tank 1, the one in the middle, tank 2."""
    first, second = (p[name] * v / 100.0 * (1.05 - 0.1 * v / 100.0) for name, v in (("P1", u[0]), ("P2", u[1])))
    q13, q32, q20 = valve(p, "a13", x[0] - x[1]), valve(p, "a32", x[1] - x[2]), valve(p, "a20", max(x[2], 0.0))
    d1 = first - q13 - p["leak1"] * (G2 * max(x[0], 0.0)) ** 0.5
    d3 = q13 - q32 - p["leak3"] * (G2 * max(x[1], 0.0)) ** 0.5
    return [d1 / AREA, d3 / (0.98 * AREA), (second + q32 - q20) / (1.02 * AREA)]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give the three levels, cm."""
    return [100.0 * level for level in x]


RIG = Rig(
    name="three_tanks",
    step=STEP,
    rows=ROWS,
    substeps=2,
    parameters={"P1": 1.06e-4, "P2": 0.96e-4, "a13": 2.4e-5, "a32": 2.35e-5, "a20": 3.6e-5, "leak1": 0.0, "leak3": 0.0},
    wander={"P1": (0.01, 600.0), "P2": (0.01, 600.0), "a20": (0.01, 1200.0)},
    inputs={"u1": Input(lag=4.0, play=0.5), "u2": Input(lag=4.0, play=0.5)},
    sensors={name: Sensor(noise=0.1, quantum=0.05, lag=1.0, si=1e-2) for name in ("h1", "h3", "h2")},
    begin=begin,
    rate=rate,
    reads=reads,
)
