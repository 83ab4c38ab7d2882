"""Plants in which something is open, beside the one that was stated."""

import numpy as np
import pytest

from faultbond.app.likelihood import begun_likelihood, likelihood_engine
from faultbond.contract.samples import Sample
from faultbond.errors import StructureError
from faultbond.fit import quiet_search
from faultbond.fit.foothold import Footing
from faultbond.fit.further import _weighed
from faultbond.fit.imperfections import Imperfection, Kind
from faultbond.fit.quiet_search import Search
from faultbond.fit.session import build_fit, free_parameters
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_engine, build_model

BELT = """
name: belt
sample_time: 0.1 s
constants: {m0: 20 kg}
inputs: {pull: {unit: N}, load: {unit: kg}}
components:
  drive: {type: Se, law: e = pull}
  belt: {type: I, law: p = (m0 + load)*f}
  idlers: {type: R, parameters: {b: 30 N*s/m}}
junctions: {moving: 1}
bonds: [drive -> moving -> belt, moving -> idlers]
sensors: {speed: {reads: moving.f, unit: m/s, noise: 0.01 m/s}}
"""


def test_a_lag_that_brings_another_state_is_left_alone() -> None:
    """A mass that goes with a load is followed by its momentum, and by its speed once the load lags."""
    graph, rng = parse_model(BELT), np.random.default_rng(1)
    model = build_model(graph)
    points = [
        Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.array([30.0, 5.0 * (k // 20 % 2)]), y=rng.normal(1.0, 0.01, 1))
        for k in range(100)
    ]
    parameters, core = free_parameters(graph), build_engine(graph)[1]
    _, records, begin = build_fit(model, likelihood_engine(model), core, [("made", points)], parameters)
    recorded = (records, records), (begin, begin)
    search = Search(graph, begun_likelihood, 1, lambda _: None, parameters, (), *recorded)
    stand = search.ground(graph).climbed(Footing(graph=graph, values={"b": 30.0}, starts={}))
    lags = [Imperfection(kind=Kind.LAG, place=name, size=0.1) for name in ("pull", "load")]
    assert search.ground_with(stand, lags[:1]).columns == ("belt.p", "pull.lagged")
    with pytest.raises(StructureError, match="no start is known of moving"):
        search.ground_with(stand, lags[1:])
    assert {item.place for _, item, _ in _weighed(search, stand, lags)} == {"pull"}


@pytest.mark.parametrize(
    ("lengths", "most", "few", "are_all"),
    [
        ((60, 40), 100, [60, 40], True),
        ((60, 40), 99, [60, 39], False),
        ((92, 8), 100, [92], False),  # so short a part is left out, though there is room for it
    ],
)
def test_it_is_known_whether_what_compares_is_all(
    lengths: tuple[int, int], most: int, few: list[int], are_all: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Then no climb is done twice."""
    monkeypatch.setattr(quiet_search, "FEW_SAMPLES", most)
    graph, rng = parse_model(BELT), np.random.default_rng(1)
    model, core = build_model(graph), build_engine(graph)[1]
    read = [
        (f"{n}", [Sample(time=0.1 * k, dt=0.1 if k else 0.0, u=np.zeros(2), y=rng.normal(size=1)) for k in range(n)])
        for n in lengths
    ]
    parameters = free_parameters(graph)
    _, records, begin = build_fit(model, likelihood_engine(model), core, read, parameters)
    search = Search(graph, begun_likelihood, 1, lambda _: None, parameters, (), (records, records), (begin, begin))
    assert [len(item.time) for item in search.few] == few
    assert search.few_are_all is are_all
