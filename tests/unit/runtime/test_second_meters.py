"""Sensors that read what the plant takes in: a second meter of an input, and the power that a pump draws."""

from pathlib import Path

import numpy as np
import pytest

import faultbond as fb

PLANT = """\
name: vessel with two meters of its inflow
sample_time: 1 s
inputs: {u: {unit: l/s}}
blocks:
  vessel: {law: der(h) = (u*G - q)/A, parameters: {A: {nominal: 2 m^2, suspect: no}, G: {nominal: 1, suspect: no}}}
  outlet: {law: q = K*sqrt(h), parameters: {K: 0.05 m^2.5/s}}
  pump: {law: P = P0 + P1*u, parameters: {P0: {nominal: 60 W, suspect: no}, P1: 9000 W*s/m^3}}
sensors:
  level: {reads: h, unit: cm, noise: 1 cm}
  meter: {reads: u, unit: l/s, noise: 0.5 l/s}
  draw: {reads: P0 + P1*u, unit: W, noise: 5 W}
"""


@pytest.mark.parametrize(
    ("fault", "named", "value"),
    [("meter.bias=5", "meter", 5.0), ("u.bias=5", "u", 5.0), ("P1=x1.2", "pump", 10800.0)],
)
def test_the_one_that_is_wrong_is_named(tmp_path: Path, fault: str, named: str, value: float) -> None:
    """Of two meters of a flow the level tells which is wrong; a pump that draws more is neither."""
    file = tmp_path / "vessel.yaml"
    file.write_text(PLANT, encoding="utf-8")
    model = fb.load(file)
    time = np.arange(600.0)
    flow = 50.0 + 20.0 * np.sign(np.sin(time / 40.0))
    made = fb.simulate(model, {"time": time, "u": flow}, faults=[f"{fault}@200"], seed=3)
    best = fb.run(model, made.to_frame()).best
    assert best is not None
    ((name, suspect),) = best.parameters.items()
    assert (name, best.components, best.probability > 0.9) == (fault.partition("=")[0], (named,), True)
    assert suspect.estimate == pytest.approx(value, abs=4.0 * suspect.sd)
