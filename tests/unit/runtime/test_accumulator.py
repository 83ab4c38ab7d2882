"""A lift with an accumulator, whose law has no value where it would hold more than its volume, begins in motion."""

import numpy as np
import pytest

from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Inputs, simulate
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_core
from faultbond.synthesis.specify import build_spec
from made import run, samples_of

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
LIFT = """
name: lift
sample_time: 0.2 s
accuracy: 1 %
constants: {g: 9.81 m/s^2, V0: 3 l, gas: 1.2, v_dry: 5 mm/s}
inputs: {speed: {unit: rpm, lag: 1 s}, spool: {unit: percent, lag: 0.3 s}}
components:
  pump: {type: Sf, law: f = D*speed, parameters: {D: 1.26 cm^3}}
  accumulator: {type: C, law: e = p0*(V0/(V0-q))**gas, parameters: {p0: 39.1 bar}}
  bleed: {type: R, law: f = Kb*sign(e)*sqrt(abs(e)), parameters: {Kb: 5.6e-8 m^3/s/Pa^0.5}}
  lift: {type: R, law: "f = Kv*max(spool, 0)*sign(e)*sqrt(abs(e))", parameters: {Kv: 0.93e-9 m^3/s/Pa^0.5/percent}}
  hose: {type: C, law: q = Cc*e, parameters: {Cc: 4e-11 m^3/Pa}}
  cylinder: {type: TF, law: [e2 = A*e1, f2 = f1/A], parameters: {A: 20 cm^2}}
  table: {type: I, law: p = M*f, parameters: {M: 800 kg}}
  weight: {type: Se, law: e = M*g}
  friction: {type: R, law: e = B*f + Fc*tanh(f/v_dry), parameters: {B: 5000 N*s/m, Fc: 400 N}}
junctions: {line: 0, up: 1, cyl: 0, motion: 1}
bonds: [pump -> line -> accumulator, line -> bleed, line -> up -> cyl, up -> lift, cyl -> hose,
        cyl -> cylinder -> motion -> table, motion -> friction, motion -> weight]
sensors:
  p_line: {reads: line.e, unit: bar, noise: 0.4 bar, lag: 0.15 s}
  p_cyl: {reads: cyl.e, unit: bar, noise: 0.25 bar}
  v: {reads: motion.f, unit: mm/s, noise: 2 mm/s}
"""


@pytest.fixture(scope="module")
def monitor() -> Monitor:
    """One that has seen nothing."""
    built = build_plant(parse_model(LIFT))
    return Monitor(build_core(built, build_spec(build_step_model(built))))


@pytest.mark.parametrize("seed", [4, 5, 12, 16, 21, 24])
def test_what_it_holds_is_found_from_its_pressure(monitor: Monitor, seed: int) -> None:
    """Guesses beyond its volume say nothing of the size of what it holds; and nothing is taken for wild."""
    time = np.asarray(0.2 * np.arange(60), dtype=np.float64)
    values = np.stack([np.full(60, 178.0236), np.where(time < 3.0, 38.0, 35.0)], axis=1)
    start = {"accumulator.q": 1.73e-3, "hose.q": 1.57e-4, "table.p": 0.0}
    made = simulate(parse_model(LIFT), Inputs(time=time, values=values), seed=seed, start=start)
    after, reports = run(monitor.core, samples_of(time, made.inputs, made.outputs), monitor)
    held = [state.name for state in after.spec.states].index("accumulator.q")
    assert after.numbers("healthy.lane")[held] == pytest.approx(made.states[-1, held], rel=0.03)
    assert sum(report.wild for report in reports) == 0
