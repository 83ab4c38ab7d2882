"""The thesis' search on networks small enough to follow by hand."""

from dataclasses import replace

import pytest
from benchmarks.shared.ladders import example, ladder

from faultbond.algebra.route import Question
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import outputs, parameters, states_at_start
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError
from faultbond.thesis.search import Ending, search_route
from faultbond.thesis.trace import trace_lines
from small_networks import ask, network


def passed(search_question: Question, net: ComponentNetwork, **options: bool) -> str | None:
    """The components passed, in order; None where there is no route."""
    search = search_route(net, search_question, **options)
    return " ".join(f"{s.equation}{s.frame}" for s in search.route.steps) if search.route is not None else None


def test_a_chain() -> None:
    """A signal is found by the component that leads on to what is measured."""
    net = network("a: x z; b: z y")
    assert passed(ask(net, ("x", 0)), net) == "a0 b0"


def test_what_is_known_needs_no_route() -> None:
    """A measured signal is found without any step."""
    net = network("a: x y")
    search = search_route(net, ask(net, ("y", 0)))
    assert search.ending is Ending.FOUND
    assert search.route is not None
    assert search.route.steps == ()
    assert search.route.samples == (("y", 0),)


def test_the_shorter_of_two_ways() -> None:
    """Of two ways the one with fewer components is taken, though it is met later."""
    net = network("a: x p; b: p q; c: q y; d: x r; e: r y")
    assert passed(ask(net, ("x", 0)), net) == "d0 e0"


def test_dead_ends_are_left() -> None:
    """A way that ends at something that nothing finds is given up, and the other way is taken."""
    net = network("a: x p; d: x r; e: r y")
    assert passed(ask(net, ("x", 0)), net) == "d0 e0"


def test_a_loop_is_solved_as_one_block() -> None:
    """Two components that need each other's signals are one block."""
    net = network("a: x z y; b: x z")
    search = search_route(net, ask(net, ("x", 0)))
    assert search.route is not None
    assert search.route.blocks == ((0, 1),)


def test_orders_of_the_same_components_are_one() -> None:
    """Ways round a loop that pass the same components are followed once."""
    net = network("a: x z y; b: x z y")
    search = search_route(net, ask(net, ("x", 0)))
    assert (search.expanded, search.distinct) == (2, 3)


def test_back_in_time_only_when_nothing_else_is_possible() -> None:
    """The store is passed where nothing else finds its signal, and then the older frame is opened."""
    net = network("a: x z; sx: dx x x@; b: dx y", states="x")
    search = search_route(net, ask(net, ("x", 0)))
    assert [passage.frames for passage in search.passages][:2] == [1, 1]
    assert search.route is None
    stays = network("a: x z; c: z y; sx: dx x x@; b: dx y", states="x")
    assert passed(ask(stays, ("x", 0)), stays) == "a0 c0"


def test_parameter_in_the_newest_unused_frame() -> None:
    """A parameter is found by its component of frame 0; met again, by that of frame 1."""
    net = network("p: x P; a: x Q y", outputs="y")
    search = search_route(net, ask(net, "P", "Q"))
    assert search.passages[0].place == ("p", 0)
    assert [place for passage in search.passages for place in passage.choices if place[0] == "a"] == [
        ("a", 0),
        ("a", 1),
    ]


def test_never_forward_again() -> None:
    """A route that has gone back through a store does not go forward through another, unless it is told that it may.

    x is found through its store, its sample before from w one frame back, and that only through the store of frame 0.
    """
    net = network("sx: x x@ y; c: x w; sw: w@ dw; b: dw y", states="x w")
    question = ask(net, ("x", 0))
    assert passed(question, net) is None
    assert passed(question, net, forward=True) == "sx0 c1 sw0 b0"


def test_states_at_the_start_by_the_newest_frame() -> None:
    """The current at the start of the present observation follows from two samples of omega and one of V (4.2.1)."""
    motor = example("dc_motor")
    search = search_route(motor, states_at_start(motor)[0])
    assert search.route is not None
    assert search.route.frames == 1
    assert set(search.route.samples) == {("omega", 0), ("omega", 1), ("V", 0)}


def test_state_limit() -> None:
    """At the limit the search stops, says so, and names the other method."""
    net = ladder(4)
    search = search_route(net, parameters(net, ("C2",)), limit=100)
    assert (search.ending, search.route, search.expanded) == (Ending.LIMIT, None, 100)
    assert "stopped at the limit; 100 states expanded" in search.message
    assert "use the default method" in search.message


def test_search_explodes() -> None:
    """With sensors at the ends each section of a ladder takes about ten times the states; matching does not mind."""
    expanded = []
    for sections in (2, 3, 4):
        net = ladder(sections)
        expanded.append(search_route(net, parameters(net, (f"C{(sections + 1) // 2}",))).expanded)
    assert expanded[1] > 5 * expanded[0]
    assert expanded[2] > 5 * expanded[1]


def test_sensors_everywhere_keep_the_search_small() -> None:
    """With every voltage measured the number of states does not grow with the ladder (4.4.1)."""
    expanded = []
    for sections in (4, 12):
        net = ladder(sections, "all")
        expanded.append(search_route(net, parameters(net, (f"C{sections // 2}",))).expanded)
    assert expanded[1] <= expanded[0] + 3


@pytest.mark.parametrize("sensors", ["ends", "ends+i", "all"])
@pytest.mark.parametrize("sections", [2, 3, 4])
def test_as_long_as_by_matching(sections: int, sensors: str) -> None:
    """On ladders the default method gives a route as short as the search, for every single parameter."""
    net = ladder(sections, sensors)
    for name in net.suspects:
        search = search_route(net, parameters(net, (name,)))
        assert search.route is not None
        assert len(search.route.steps) == len(find_route(net, parameters(net, (name,))).steps)


def test_gyrator_whose_equations_are_needed_in_two_frames() -> None:
    """Where one equation of a parameter leads nowhere in its newest frame, the other is taken in an older one."""
    net = network("g: p q P; h: y z P; e: p; r: y w Q; k: q w")
    search = search_route(net, ask(net, "Q", "P"))
    assert search.route is not None
    assert find_route(net, ask(net, "Q", "P")).frames == search.route.frames == 2


def test_along_causality() -> None:
    """With the current measured, omega follows along causality from it and from omega before, without the voltage."""
    motor = example("dc_motor_current")
    question = outputs(motor)[0]
    search = search_route(motor, question)
    assert search.route is not None
    assert {step.equation for step in search.route.steps} == {"J.sum", "J", "shaft", "K.2", "C"}
    assert all(len(passage.choices) == 1 for passage in search.passages)


def test_unknown_name() -> None:
    """What the model does not have is refused by name."""
    motor = example("dc_motor")
    with pytest.raises(StructureError, match="there is no parameter X"):
        search_route(motor, ask(motor, "X"))
    with pytest.raises(StructureError, match=r"there is no signal R\.x"):
        search_route(motor, ask(motor, ("R.x", 0)))


def test_trace_of_a_search_without_route() -> None:
    """A trace shows the way to the last state, and says how the search ended."""
    motor = replace(example("dc_motor"), outputs=())
    lines = list(trace_lines(search_route(motor, ask(motor, "R"))))
    assert lines[:2] == ["To find R:", "         U = {R}"]
    assert lines[2] == "         K = {V_x, L, K, J, C}"
    assert lines[-1].startswith("R: no route from what is measured")


def test_trace_names_what_is_hidden_and_known() -> None:
    """K lists an output that must be predicted with its exception, and the states at the start."""
    motor = example("dc_motor")
    lines = list(trace_lines(search_route(motor, outputs(motor)[0])))
    assert lines[2] == "         K = {V_x, omega_x except omega_0, armature.f_1, omega_1, R, L, K, J, C}"
