"""A tank that empties through a pipe whose resistance wanders: its model, and recordings that scipy alone makes."""

from dataclasses import dataclass

import numpy as np
from scipy.integrate import solve_ivp

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Samples

STEP, HELD = 10.0, 90  # s; rows for which the inflow is held
C, R = 2e-4, 2e6  # m^3/Pa, Pa*s/m^3
NOISES = np.array([50.0, 5e-5])  # Pa, m^3/s
WANDER = "wander: 5 % over 1 h"

MODEL = """\
name: tank with a pipe
sample_time: 10 s
inputs: {inflow: {unit: l/s}}
components:
  pump: {type: Sf, law: f = inflow}
  tank: {type: C, parameters: {C: {nominal: 2e-4 m^3/Pa, accuracy: 2 %}}}
  pipe: {type: R, parameters: {R: {nominal: 2e6 Pa*s/m^3, accuracy: 3 %}}}
junctions: {node: 0}
bonds: [pump -> node, node -> tank, node -> pipe]
sensors:
  pressure: {reads: tank.e, unit: Pa, noise: 50 Pa}
  flow: {reads: pipe.f, unit: l/s, noise: 0.05 l/s}
"""
WANDERING = MODEL.replace("accuracy: 3 %", f"accuracy: 3 %, {WANDER}")


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Course:
    """What a tank showed, and what was true: usual, the resistance about which it wanders; resistance (n,)."""

    samples: Samples
    usual: float
    resistance: FloatArray


def course(
    seed: int, rows: int = 4000, *, size: float = 0.05, memory: float = 3600.0, factor: float = 1.0, at: int = 0
) -> Course:
    """Give a tank whose pipe wanders by `size`, and is `factor` times as narrow from row `at` on; off as declared."""
    random = np.random.default_rng(seed)
    usual, content = R * (1.0 + 0.03 * random.standard_normal()), C * (1.0 + 0.02 * random.standard_normal())
    decay, path = np.exp(-STEP / memory), size * random.standard_normal(rows)
    for k in range(1, rows):
        path[k] = decay * path[k - 1] + np.sqrt(1.0 - decay**2) * path[k]
    resistance = usual * (1.0 + path) * np.where(np.arange(rows) < (at if factor != 1.0 else rows), 1.0, factor)
    inflow = np.repeat(random.uniform(4e-3, 12e-3, rows // HELD + 1), HELD)[:rows]
    time, pressure = STEP * np.arange(rows), np.zeros(rows)
    pressure[0] = inflow[0] * resistance[0]
    for first in range(0, rows - 1, HELD):
        last = min(first + HELD, rows - 1)
        part = slice(first, last + 1)
        solved = solve_ivp(
            lambda t, p, inflow=inflow[first]: (inflow - p / np.interp(t, time, resistance)) / content,
            (time[first], time[last]),
            pressure[first : first + 1],
            t_eval=time[part],
            max_step=STEP,
            rtol=1e-6,
        )
        pressure[part] = solved.y[0]
    shown = np.column_stack([pressure, pressure / resistance]) + NOISES * random.standard_normal((rows, 2))
    steps = np.concatenate([[0.0], np.full(rows - 1, STEP)])
    return Course(
        samples=Samples(time=time, dt=steps, u=inflow[:, None], y=shown), usual=usual * factor, resistance=resistance
    )
