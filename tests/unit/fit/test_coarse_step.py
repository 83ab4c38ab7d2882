"""Whether steps in fewer parts are enough for a search."""

from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.contract.samples import Sample
from faultbond.fit.coarse_step import is_enough
from faultbond.fit.session import build_fit, free_parameters
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_engine, build_model

QUICK = """
name: quick
sample_time: 0.1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 1 ohm}}
  C: {type: C, parameters: {C: 50 mF}, start: {q: 0 C, sd: 0.02 C}}
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {v: {reads: C.e, unit: V, noise: 0.1 V}}
"""


@pytest.mark.parametrize(("noise", "step", "enough"), [(0.1, 3.0, True), (1e-4, 3.0, False), (1e-4, 0.003, True)])
def test_what_coarse_steps_move_counts_beside_the_noise_of_sensors(noise: float, step: float, enough: bool) -> None:
    """A capacitor that follows in half a sample: four parts leave 0.2 % of a move too much or too little.

    That is nothing beside a sensor that scatters by a thirtieth of the moves, and much beside one that hardly does.
    """
    graph = parse_model(QUICK.replace("noise: 0.1 V", f"noise: {noise} V"))
    volts = step * (np.arange(200) // 10 % 2)
    points = [
        Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.array([u]), y=np.array([volts[k - 1] if k else 0.0]))
        for k, u in enumerate(volts)
    ]
    model = build_model(graph)
    assert model.substeps == 8
    plant, records, point = build_fit(
        model, likelihood_engine(model), build_engine(graph)[1], [("made", points)], free_parameters(graph)
    )
    found = SimpleNamespace(plant=plant, records=records, summit=SimpleNamespace(point=point))
    assert is_enough(cast(Any, found), begun_likelihood(model, coarse=True)()) is enough
    assert is_enough(cast(Any, found), begun_likelihood(model)())
