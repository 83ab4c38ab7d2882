"""A room warmed by a fan heater that rests at times: how warm the air leaves it no law says while nothing flows."""

from functools import cache

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.samples import Samples
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.synthesis.engine import build_engine

RESTS = ((300, 460), (800, 1000))  # s
CAPACITY, LOSS, AIR, LAG = 2e4, 50.0, 1200.0, 6.0
VALID = ", valid_when: {when: flow > still, settling: 30 s}"
TEXT = """\
name: fan heater
sample_time: 1 s
constants: {rho_c: 1200 J/m^3/K, still: 0.01 m^3/s}
inputs: {power: {unit: W}, flow: {unit: m^3/s, suspect: no}}
components:
  heater: {type: Sf, law: f = G*power, parameters: {G: 1}}
  room: {type: C, law: q = C*e, parameters: {C: 20 kJ/K}}
  wall: {type: R, law: f = K*e, parameters: {K: 50 W/K}}
junctions: {node: 0}
bonds: [heater -> node -> room, node -> wall]
sensors:
  inside: {reads: node.e, unit: K, noise: 0.05 K}
  blown: {reads: node.e + heater.f/(rho_c*flow), unit: K, noise: 0.1 K{lag}{valid}}
"""


def text(*, lag: bool = True, valid: bool = True, order: int = 1) -> str:
    """Give the model, with or without a lag of the sensor at the heater and a word on when that reads as stated."""
    stated = "6 s" if order == 1 else f"{{value: 6 s, order: {order}}}"
    return TEXT.replace("{lag}", f", lag: {stated}" if lag else "").replace("{valid}", VALID if valid else "")


@cache
def core(*, lag: bool = True, order: int = 1) -> Core:
    """Give the core of the model."""
    return build_engine(parse_model(text(lag=lag, order=order)))[1]


def course(n: int, *, lag: bool = True, order: int = 1, gain: float = 1.0, begins: int = 0, seed: int = 1) -> Samples:
    """Give a recording, one row a second; from `begins` on the heater gives `gain` of what it is told."""
    rng = np.random.default_rng(seed)
    time = np.arange(n, dtype=float)
    power = np.where((time // 150) % 2 == 0, 1500.0, 600.0)
    flow = np.full(n, 0.1)
    for a, b in RESTS:
        power[a:b], flow[a:b] = 0.0, 0.0
    y: FloatArray = np.zeros((n, 2))
    gains = np.where(np.arange(n) < begins, 1.0, gain)
    warm = before = 10.0
    blown = [10.0] * order
    for k in range(n):
        if k:
            for stage, behind in enumerate([before, *blown[:-1]]):
                blown[stage] += (1.0 - np.exp(-order / LAG)) * (behind - blown[stage])
            warm += (gains[k] * power[k - 1] - LOSS * warm) / CAPACITY
        now = warm + gains[k] * power[k] / (AIR * flow[k]) if flow[k] > 0 else warm - 3.0
        before = now
        y[k] = warm, blown[-1] if lag and k else now
    dt = np.diff(time, prepend=time[0])
    noisy = y + rng.standard_normal((n, 2)) * [0.05, 0.1]
    return Samples(time=time, dt=dt, u=np.column_stack([power, flow]), y=noisy)
