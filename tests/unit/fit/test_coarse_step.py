"""In how many times fewer parts a search takes steps."""

import numpy as np
import pytest

from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.contract.samples import Sample
from faultbond.equations.step import StepModel
from faultbond.fit.coarse_step import coarsest, is_enough
from faultbond.fit.foothold import Footing
from faultbond.fit.objective import FitPoint, FittedPlant
from faultbond.fit.quiet_search import Search
from faultbond.fit.samples import HealthyRecording
from faultbond.fit.session import build_fit, free_parameters
from faultbond.model.graph import BondGraph
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


Prepared = tuple[BondGraph, StepModel, FittedPlant, tuple[HealthyRecording, ...], FitPoint]


def prepared(noise: float, step: float) -> Prepared:
    """Give a capacitor that follows in half a sample, with a sensor of some noise, and moves of so many volts."""
    graph = parse_model(QUICK.replace("noise: 0.1 V", f"noise: {noise} V"))
    volts = step * (np.arange(200) // 10 % 2)
    points = [
        Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.array([u]), y=np.array([volts[k - 1] if k else 0.0]))
        for k, u in enumerate(volts)
    ]
    model = build_model(graph)
    assert model.substeps == 8
    engine, core = likelihood_engine(model), build_engine(graph)[1]
    return graph, model, *build_fit(model, engine, core, [("made", points)], free_parameters(graph))


@pytest.mark.parametrize(("noise", "step", "enough"), [(0.1, 3.0, True), (1e-4, 3.0, False), (1e-4, 0.003, True)])
def test_what_coarse_steps_move_counts_beside_the_noise_of_sensors(noise: float, step: float, enough: bool) -> None:
    """Four parts leave 0.2 % of a move too much or too little.

    That is nothing beside a sensor that scatters by a thirtieth of the moves, and much beside one that hardly does.
    """
    _, model, plant, records, point = prepared(noise, step)
    assert is_enough(plant, records, point, begun_likelihood(model, 2)()) is enough
    assert is_enough(plant, records, point, begun_likelihood(model)())


@pytest.mark.parametrize(("noise", "fewer"), [(0.1, 4), (0.01, 2), (1e-4, 1)])
def test_as_few_parts_as_are_enough(noise: float, fewer: int) -> None:
    """A quarter, a half, or all of them; a search that does with all finds out later that fewer do, and goes on so."""
    graph, model, plant, records, point = prepared(noise, 3.0)
    assert coarsest(plant, records, point, model, begun_likelihood) == fewer
    search = Search(
        graph, begun_likelihood, 1, lambda _: None, free_parameters(graph), (), (records, records), (point, point)
    )
    stand = Footing(graph=graph, values={"R": 1.0, "C": 0.05}, starts={})
    fine = search.all
    coarser = search.coarsened(stand)
    assert search.fewer == fewer
    assert (coarser is stand) is (fewer == 1)
    assert (search.all is fine) is (fewer == 1)
    assert np.isfinite(coarser.held)
