"""An air handling unit: damper, heating coil and fan warm a zone; the valve sticks and is slow, people come and go."""

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels, moments, wandering

CP = 1006.0  # J/(kg K)
ROWS, STEP = 4000, 10.0


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw weather, people, and set points; a controller keeps the supply air at its set point by the valve."""
    seconds = ROWS * STEP
    time = moments(ROWS, STEP)
    out = 4.0 + generator.normal(0.0, 3.0) + 3.0 * np.sin(2 * np.pi * time / 86400.0 + generator.uniform(0, 6.28))
    out += 0.5 * wandering(time, 1800.0, generator)
    goal = levels(generator, 19.0, 29.0, (900.0, 2700.0), seconds)
    damper = levels(generator, 15.0, 60.0, (1800.0, 5400.0), seconds)
    fan = levels(generator, 55.0, 95.0, (1500.0, 4000.0), seconds)
    total = 40.0

    def command(now: float, readings: Values) -> Values:
        nonlocal total
        error = goal(now) - (readings[2] if np.isfinite(readings[2]) else goal(now))
        total = float(np.clip(total + 0.02 * error * STEP, 5.0, 95.0))
        return damper(now), float(np.clip(total + 2.0 * error, 2.0, 100.0)), fan(now), float(out[round(now / STEP)])

    return [20.5, 22.0, 21.0], command


def air(x: Values, u: Values, p: Parameters) -> tuple[float, float]:
    """Give the flow of air, kg/s, and its temperature after the damper; fan and damper follow their curves to 5 %."""
    fan, opened = u[2] / 100.0, u[0] / 100.0
    flow = p["K_f"] * fan * (1.04 - 0.06 * fan)
    fresh = p["K_d"] * opened * (0.95 + 0.1 * opened)
    return flow, x[2] + fresh * (u[3] - x[2])


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Give the rates of the coil, of the air behind it, and of the zone."""
    coil, supply, zone = x
    flow, mixed = air(x, u, p)
    opened = u[1] / 100.0
    water = p["Q_v"] * opened * (0.96 + 0.08 * opened)
    given = 1500.0 * (flow / 0.8) ** 0.6 * (coil - 0.5 * (mixed + supply))
    loss = p["UA"] * (zone - u[3]) * (1.0 + 0.003 * (zone - u[3]))
    return [
        (water - given) / 9000.0,
        (flow * CP * (mixed - supply) + given) / 4000.0,
        (flow * CP * (supply - zone) - loss + p["gain"]) / 1.15e6,
    ]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give the flow, kg/s, and the temperatures of mixed, supply and zone air, degC."""
    flow, mixed = air(x, u, p)
    return flow, mixed, x[1], x[2]


RIG = Rig(
    name="air_handling",
    step=STEP,
    rows=ROWS,
    substeps=4,
    parameters={"K_f": 0.93, "K_d": 0.97, "Q_v": 19.4e3, "UA": 215.0, "gain": 900.0},
    wander={"gain": (0.4, 3600.0), "UA": (0.03, 7200.0), "Q_v": (0.015, 3600.0)},
    inputs={
        "u_d": Input(lag=20.0, play=1.0),
        "u_v": Input(lag=15.0, play=1.5),
        "u_f": Input(lag=4.0),
        "T_o": Input(measured=True, noise=0.1, quantum=0.1),
    },
    sensors={
        "F": Sensor(noise=0.008, quantum=0.005, lag=5.0),
        "T_m": Sensor(noise=0.1, quantum=0.1, lag=20.0),
        "T_s": Sensor(noise=0.1, quantum=0.1, lag=20.0),
        "T_z": Sensor(noise=0.06, quantum=0.1, lag=60.0),
    },
    begin=begin,
    rate=rate,
    reads=reads,
)
