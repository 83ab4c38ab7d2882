"""A skid: sump, pump, pipe and valve into an elevated tank, from which water falls back through an orifice."""

import numpy as np

from benchmarks.trust.strangers.rig import Command, Input, Parameters, Rig, Sensor, Values, levels

RHO_G = 9790.0  # Pa/m
ROWS, STEP = 4000, 1.0
SUMP, TANK = 0.40, 0.203  # m2
LIFT = 3.1  # m, from sump to tank


def begin(generator: np.random.Generator) -> tuple[Values, Command]:
    """Draw how speed and valve are set; the valve closes where the tank is full, and opens where it is empty."""
    speed = levels(generator, 78.0, 100.0, (120.0, 360.0), ROWS * STEP)
    wanted = levels(generator, 0.4, 1.1, (200.0, 500.0), ROWS * STEP)
    held, moved = 50.0, -1e9

    def command(now: float, readings: Values) -> Values:
        nonlocal held, moved
        if now - moved >= 40.0 and np.isfinite(readings[3]):  # an operator, every 40 s
            held = float(np.clip(held + 20.0 * np.clip(wanted(now) - readings[3] / 100.0, -0.5, 0.5), 25.0, 90.0))
            moved = now
        return speed(now), round(held)

    return [1.2, 0.75], command


def flow(x: Values, u: Values, p: Parameters) -> tuple[float, float]:
    """Give flow, m3/s, and the pump's pressure, Pa. Pump and valve follow their curves to 5 %; the pipe is rough."""
    n, opened = u[0] / 100.0, u[1] / 100.0
    shut_off = p["H"] * n**1.9
    valve = p["Kv"] * opened * (0.93 + 0.12 * opened)
    static = RHO_G * (LIFT + x[1] - x[0])
    drive = max(shut_off - static, 0.0)
    loss = p["K_pipe"] + 1.6e10 + 1.0 / max(valve, 1e-9) ** 2
    q = (drive / loss) ** 0.5
    q = (drive / (loss * max(q / 1.0e-3, 0.05) ** -0.08)) ** 0.5  # friction falls as the flow grows
    return q, shut_off - 1.6e10 * q * q


def rate(x: Values, u: Values, p: Parameters) -> Values:
    """Give the rates of both levels; what leaks is lost."""
    q, _ = flow(x, u, p)
    back = p["K_out"] * max(x[1], 0.0) ** 0.47  # not quite a square root
    return [(back - q) / SUMP, (q - back - p["leak"]) / TANK]


def reads(x: Values, u: Values, p: Parameters) -> Values:
    """Give the pump's pressure in kPa, the flow in l/min, and both levels in cm."""
    q, pressure = flow(x, u, p)
    return (pressure + RHO_G * x[0]) / 1e3, 6e4 * q, 100.0 * x[0], 100.0 * x[1]


RIG = Rig(
    name="pump_skid",
    step=STEP,
    rows=ROWS,
    substeps=2,
    parameters={"H": 1.22e5, "K_pipe": 2.15e10, "Kv": 8.4e-6, "K_out": 9.2e-4, "leak": 0.0},
    wander={"H": (0.006, 900.0), "K_out": (0.01, 1200.0), "K_pipe": (0.02, 900.0)},
    inputs={"n": Input(lag=1.5), "v": Input(lag=3.0, play=0.8)},
    sensors={
        "P": Sensor(noise=0.5, quantum=0.2, lag=0.5, si=1e3),
        "Q": Sensor(noise=0.5, quantum=0.2, lag=2.0, si=1e-3 / 60.0),
        "L1": Sensor(noise=0.15, quantum=0.1, si=1e-2),
        "L2": Sensor(noise=0.15, quantum=0.1, si=1e-2),
    },
    begin=begin,
    rate=rate,
    reads=reads,
)
