"""Fewest components by integer programming, beside the search, which is exact where it ends."""

from dataclasses import replace

import pytest
from benchmarks.shared.ladders import example, ladder

from faultbond.algebra.route import Question
from faultbond.algebra.routes import fewest
from faultbond.algebra.routes.fewest import fewest_components
from faultbond.algebra.routes.questions import parameters
from faultbond.errors import StructureError
from faultbond.thesis.search import search_route


@pytest.mark.parametrize("sensors", ["ends", "ends+i", "all"])
def test_as_few_as_the_search(sensors: str) -> None:
    """On a ladder of three sections every pair of parameters takes as many components as the search finds."""
    net = ladder(3, sensors)
    for names in (("R1", "C3"), ("R2", "C1"), ("C2", "C3"), ("R3", "R1")):
        search = search_route(net, parameters(net, names))
        assert search.route is not None
        assert len(fewest_components(net, parameters(net, names)).steps) == len(search.route.steps)


def test_shorter_than_what_was_known(monkeypatch: pytest.MonkeyPatch) -> None:
    """From a route of 16 components, which is not shortened, integer programming reaches the 7 of the search."""
    net = ladder(6, "all")
    monkeypatch.setattr(fewest, "shorten", lambda found: found.matched)
    assert len(fewest_components(net, parameters(net, ("C4",))).steps) == 7


def test_sensors_count_nothing() -> None:
    """Where a sensor equation saves a component it is used: the tank's flow is read, not computed."""
    tank = example("tank")
    question = Question(targets=(("valve.e", 0),), observed=tank.observed)
    assert {step.equation for step in fewest_components(tank, question).steps} == {"valve", "orifice", "flow"}


def test_known_target() -> None:
    """What is measured takes no component."""
    motor = example("dc_motor")
    route = fewest_components(motor, Question(targets=(("omega", 0),), observed=motor.observed))
    assert (route.steps, route.samples) == ((), (("omega", 0),))


def test_no_route() -> None:
    """What cannot be found is refused as by the default method."""
    motor = replace(example("dc_motor"), outputs=())
    with pytest.raises(StructureError, match="R cannot be found from V"):
        fewest_components(motor, parameters(motor, ("R",)))


def test_too_little_time() -> None:
    """Where time is too short the message says how long the default route is."""
    net = ladder(8, "ends+i")
    with pytest.raises(StructureError, match=r"C4: no route .* within 0\.0001 s; use the default route, of 90"):
        fewest_components(net, parameters(net, ("C4",)), time_limit=1e-4)
