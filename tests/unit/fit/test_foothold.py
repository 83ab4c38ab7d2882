"""Where a search stands, and where another fit begins that goes on from there."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.app.likelihood import likelihood_engine
from faultbond.contract.samples import Sample
from faultbond.fit.foothold import Added, Footing, as_fitted, begun_as_found, values_of, with_noise
from faultbond.fit.imperfections import Imperfection, Kind, parameter_name
from faultbond.fit.session import build_fit, free_parameters, likelier_begin
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_engine, build_model

RC = """
name: rc
sample_time: 0.1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C: {type: C, parameters: {C: 50 mF}}
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {v: {reads: C.e, unit: V, noise: 0.1 V}, i: {reads: loop.f, unit: A, noise: 0.05 A}}
slow_error: {v: 0.3 V over 2 s, R.e: 0.2 V over 1 s}
"""


def test_a_fit_goes_on_with_all_that_was_found() -> None:
    """It begins with parameters, noise and slow errors as they stand; those of which nothing was found as declared."""
    graph = parse_model(RC)
    points = [Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.ones(1), y=np.array([1.0, 0.0])) for k in range(40)]
    model, core = build_model(graph), build_engine(graph)[1]
    plant, _, _ = build_fit(model, likelihood_engine(model), core, [("made", points)], free_parameters(graph))
    stand = Footing(
        graph=with_noise(graph, np.array([0.13, 0.02])), values={"R": 11.0}, starts={}, slow={("v", False): 0.1}
    )
    found = plant.unknowns.fill(plant.base, values_of(plant, graph, stand))[0]
    layout = plant.layout
    assert found[: layout.n_p] == pytest.approx([1.1, 1.0])
    assert np.exp(found[layout.n_p : layout.n_p + 4]) == pytest.approx([0.13, 0.02, 0.1, 0.2])


def test_each_recording_begins_where_that_is_likelier() -> None:
    """Of two places from which a fit may begin one suits the first recording, and the other one the second."""
    graph = parse_model(RC)
    points = [Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.ones(1), y=np.array([1.0, 0.0])) for k in range(40)]
    model, core = build_model(graph), build_engine(graph)[1]
    engine, recordings = likelihood_engine(model), [("one", points), ("other", points)]
    plant, records, begin = build_fit(model, engine, core, recordings, free_parameters(graph))
    assert begin.starts[:, 0] == pytest.approx([1.0, 1.0], abs=0.1)  # the voltage of C
    far, none = np.array([[0.0], [30.0]]), np.array([[np.nan], [0.0]])
    first = replace(begin, starts=begin.starts + far, sizes=begin.sizes + far)
    other = replace(begin, values=begin.values + 1.0, starts=begin.starts + none, sizes=2.0 * begin.sizes)
    found = likelier_begin(plant, records, first, other)
    assert np.array_equal(found.values, begin.values)
    assert np.array_equal(found.starts, begin.starts)
    assert np.array_equal(found.sizes, [begin.sizes[0], 2.0 * begin.sizes[1]])
    stand = Footing(graph=graph, values={}, starts={"C.e": np.array([7.0]), "V.lagged": np.array([1.0])})
    assert begun_as_found(begin, ("C.e",), stand).starts[:, 0].tolist() == [7.0, begin.starts[1, 0]]


def test_what_was_added_has_the_size_that_is_written() -> None:
    """A fit to all recordings comes after the search; what is no parameter stays as it was found."""
    lag = Imperfection(kind=Kind.LAG, place="v", is_sensor=True, size=0.3)
    slow = Imperfection(kind=Kind.ABSOLUTE, place="v", is_sensor=True, size=0.2)
    added = [Added(what=item, trained=9.0, held=8.0) for item in (lag, slow)]
    found = as_fitted(added, {parameter_name(lag): 0.5, "R": 3.0})
    assert [item.what.size for item in found] == [0.5, 0.2]
    assert [(item.trained, item.held) for item in found] == [(9.0, 8.0)] * 2
    assert as_fitted(added, {}) == tuple(added)
