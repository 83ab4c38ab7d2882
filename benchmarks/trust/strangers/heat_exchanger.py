"""A counter-flow water heater: eight cells a side, a wall with heat capacity, pumps whose curves are not straight."""

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels, moments, wandering

CP = 4180.0  # J/(kg K)
CELLS = 8
HOT, COLD, WALL = 5.2, 4.7, 3500.0  # kg of water a side; J/K of the wall
ROWS, STEP = 4000, 1.0


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw how the pumps are run, and the two supplies, which wander."""
    seconds = ROWS * STEP
    hot, cold = (levels(generator, 45.0, 95.0, (150.0, 400.0), seconds) for _ in range(2))
    time = moments(ROWS, STEP)
    hot_in = 62.0 + generator.normal(0.0, 2.0) + 2.0 * wandering(time, 600.0, generator)
    cold_in = 14.0 + generator.normal(0.0, 1.0) + 0.7 * wandering(time, 900.0, generator)

    def command(now: float, _: Values) -> Values:
        k = round(now / STEP)
        return hot(now), cold(now), float(hot_in[k]), float(cold_in[k])

    return [*np.linspace(60.0, 45.0, CELLS), *np.linspace(45.0, 30.0, CELLS), *np.linspace(30.0, 16.0, CELLS)], command


def flows(u: Values, p: Parameters) -> tuple[float, float]:
    """Give the flows of the two sides, kg/s; the curves of the pumps bend by up to 5 %."""
    hot, cold = u[0] / 100.0, u[1] / 100.0
    return p["K_h"] * hot * (1.0 + 0.2 * (hot - 0.7) ** 2), p["K_c"] * cold * (1.05 - 0.07 * cold)


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Water gives heat to the wall, the wall to water; the films grow with the flow."""
    hot, wall, cold = x[:CELLS], x[CELLS : 2 * CELLS], x[2 * CELLS :]  # along the hot water's way
    f_h, f_c = flows(u, p)
    g_h = 2.0 * p["UA"] / CELLS * (f_h / 0.25) ** 0.7
    g_c = 2.0 * p["UA"] / CELLS * (f_c / 0.25) ** 0.7
    d_hot, d_wall, d_cold = [], [], []
    for k in range(CELLS):
        from_hot, to_cold = g_h * (hot[k] - wall[k]), g_c * (wall[k] - cold[k])
        before = hot[k - 1] if k else u[2]
        after = cold[k + 1] if k + 1 < CELLS else u[3]
        d_hot.append((f_h * CP * (before - hot[k]) - from_hot) * CELLS / (HOT * CP))
        d_wall.append((from_hot - to_cold) * CELLS / WALL)
        d_cold.append((f_c * CP * (after - cold[k]) + to_cold) * CELLS / (COLD * CP))
    return [*d_hot, *d_wall, *d_cold]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give flows in l/min and the temperatures of the outlets in degC."""
    f_h, f_c = flows(u, p)
    return 60.0 * f_h, 60.0 * f_c, x[CELLS - 1], x[2 * CELLS]


RIG = Rig(
    name="heat_exchanger",
    step=STEP,
    rows=ROWS,
    substeps=2,
    parameters={"K_h": 0.345, "K_c": 0.362, "UA": 870.0},
    wander={"UA": (0.015, 1200.0), "K_h": (0.01, 600.0), "K_c": (0.01, 600.0)},
    inputs={
        "u_h": Input(lag=2.0, play=0.5),
        "u_c": Input(lag=2.5, play=0.5),
        "T_hi": Input(measured=True, noise=0.08, quantum=0.1),
        "T_ci": Input(measured=True, noise=0.08, quantum=0.1),
    },
    sensors={
        "F_h": Sensor(noise=0.12, quantum=0.05, lag=1.5, si=1e-3 / 60.0),
        "F_c": Sensor(noise=0.12, quantum=0.05, lag=1.5, si=1e-3 / 60.0),
        "T_ho": Sensor(noise=0.08, quantum=0.1, lag=4.0),
        "T_co": Sensor(noise=0.08, quantum=0.1, lag=4.0),
    },
    begin=begin,
    rate=rate,
    reads=reads,
)
