"""Random plants and ladders: what holds of every route."""

from dataclasses import replace
from random import Random

import pytest
from benchmarks.shared.ladders import components_of, ladder_text
from hypothesis import HealthCheck, assume, given, settings
from hypothesis import strategies as st
from strategies import as_text, plants

from faultbond.algebra.route import Question, Route, Target
from faultbond.algebra.routes.fewest import fewest_components
from faultbond.algebra.routes.matched import alternatives, find_route
from faultbond.algebra.routes.questions import all_questions
from faultbond.equations.component_network import ComponentNetwork, Equation
from faultbond.equations.matching import closure, match
from faultbond.errors import CausalityError, StructureError
from faultbond.thesis.search import Ending, search_route

slow = [HealthCheck.too_slow, HealthCheck.filter_too_much, HealthCheck.data_too_large]
fast = settings(max_examples=40, deadline=None, suppress_health_check=slow)
faster = settings(max_examples=15, deadline=None, suppress_health_check=slow)


def network_of(text: str) -> ComponentNetwork:
    """The component network of a model; those without causality are passed over."""
    try:
        return components_of(text)
    except CausalityError:
        assume(False)
        raise


@st.composite
def ladders(draw: st.DrawFn) -> ComponentNetwork:
    """A short ladder with some sensors."""
    return components_of(ladder_text(draw(st.integers(1, 3)), draw(st.sampled_from(["ends", "ends+i", "all"]))))


@st.composite
def asked(draw: st.DrawFn) -> tuple[ComponentNetwork, Question]:
    """A network and one of the questions to it."""
    network = network_of(as_text(draw(plants()))) if draw(st.booleans()) else draw(ladders())
    questions = all_questions(network, 2)
    assume(questions)
    return network, draw(st.sampled_from(questions))


def answer(network: ComponentNetwork, question: Question) -> Route | None:
    """The default route, or None."""
    try:
        return find_route(network, question)
    except StructureError:
        return None


def unknowns(network: ComponentNetwork, question: Question, place: tuple[str, int]) -> list[Target]:
    """What an equation in a frame contains and is not known: by definition, not by the package."""
    equation = network.equation(place[0])
    found: list[Target] = [name for name in equation.parameters if name in question.unknown]
    for name, back in equation.signals:
        signal = (name, place[1] + back)
        if signal in question.hidden or (name not in question.observed and signal not in question.known):
            found.append(signal)
    return found


def rows_of(network: ComponentNetwork, route: Route) -> tuple[list[list[int]], list[Target]]:
    """The equations of a route by the unknowns that they contain, and these."""
    contents = [unknowns(network, route.question, (step.equation, step.frame)) for step in route.steps]
    order = list(dict.fromkeys(target for content in contents for target in content))
    return [[order.index(target) for target in content] for content in contents], order


def sought(route: Route) -> list[Target]:
    """The targets that are not known."""
    return [
        target for target in route.question.targets if isinstance(target, str) or not route.question.is_known(target)
    ]


def check_route(network: ComponentNetwork, route: Route) -> None:
    """Fail where a route is not square, not matched, or uses what it may not."""
    places = [(step.equation, step.frame) for step in route.steps]
    assert len(set(places)) == len(places)
    contents = [unknowns(network, route.question, place) for place in places]
    found = [step.finds for step in route.steps]
    assert all(step.finds in content for step, content in zip(route.steps, contents, strict=True))
    assert len(set(found)) == len(found)
    assert {target for content in contents for target in content} | set(sought(route)) == set(found)
    assert not route.question.suspended & {name for name, _ in places}
    assert all(frame >= route.question.newest for _, frame in places)
    check_blocks(route, contents)
    check_knowns(network, route)


def check_blocks(route: Route, contents: list[list[Target]]) -> None:
    """Fail where blocks are not in an order in which they can be computed."""
    assert sorted(k for block in route.blocks for k in block) == list(range(len(route.steps)))
    computed: set[Target] = set()
    for block in route.blocks:
        computed |= {route.steps[k].finds for k in block}
        assert all(set(contents[k]) <= computed for k in block)


def check_knowns(network: ComponentNetwork, route: Route) -> None:
    """Fail where samples and further known signals are not those that the equations contain."""
    question = route.question
    related = {
        (name, step.frame + back) for step in route.steps for name, back in network.equation(step.equation).signals
    }
    related |= {target for target in question.targets if not isinstance(target, str)}
    used = {signal for signal in related if question.is_known(signal)}
    assert {*route.samples, *route.known} == used
    assert len({*route.samples, *route.known}) == len(route.samples) + len(route.known)
    assert all(name in question.observed for name, _ in route.samples)
    assert not question.hidden & used


@given(asked())
@fast
def test_routes_are_square_and_matched(case: tuple[ComponentNetwork, Question]) -> None:
    """A route holds as many equations as unknowns, each found by one, in computable blocks, from known signals only."""
    network, question = case
    route = answer(network, question)
    assume(route is not None)
    assert route is not None
    check_route(network, route)


@given(asked())
@fast
def test_nothing_can_be_left_out(case: tuple[ComponentNetwork, Question]) -> None:
    """No equation of a route can be left out: the targets are then not fixed by the others."""
    network, question = case
    route = answer(network, question)
    assume(route is not None and route.steps)
    assert route is not None
    rows, order = rows_of(network, route)
    targets = [order.index(target) for target in sought(route)]
    for k in range(len(rows)):
        fewer = [row if e != k else [] for e, row in enumerate(rows)]
        matched = match(fewer, len(order))
        assert any(matched[unknown] < 0 for unknown in closure(targets, fewer, matched)[1])


@given(asked())
@fast
def test_search_and_matching_agree(case: tuple[ComponentNetwork, Question]) -> None:
    """Where the search ends, it finds a route if and only if the matching does; neither is then wrong."""
    network, question = case
    question = replace(question, causal=False)
    assume(all(isinstance(target, str) or target[1] == question.newest for target in question.targets))
    search = search_route(network, question, limit=400, forward=True)
    assume(search.ending is not Ending.LIMIT)
    route = answer(network, question)
    assert (route is None) == (search.route is None)
    if search.route is not None:
        check_route(network, search.route)


@given(asked())
@fast
def test_forbidden_ways_forward_only_lengthen(case: tuple[ComponentNetwork, Question]) -> None:
    """What the search finds without going forward in time is a route, and none is shorter than the unrestricted one."""
    network, question = case
    strict = search_route(network, question, limit=400)
    free = search_route(network, question, limit=400, forward=True)
    assume(strict.ending is Ending.FOUND)
    assert strict.route is not None
    check_route(network, strict.route)
    assert free.ending is not Ending.EXHAUSTED
    if free.route is not None:
        assert len(free.route.steps) <= len(strict.route.steps)


@given(asked(), st.randoms(use_true_random=False))
@settings(fast, derandomize=True)  # that no exchange helps does not prove that no shorter route exists
def test_order_of_components_does_not_matter(case: tuple[ComponentNetwork, Question], random: Random) -> None:
    """Whether there is a route, and through how many components it passes, does not depend on their order."""
    network, question = case
    equations: list[Equation] = list(network.equations)
    random.shuffle(equations)
    one, two = answer(network, question), answer(replace(network, equations=tuple(equations)), question)
    assert (one is None) == (two is None)
    if one is not None and two is not None:
        assert passed(network, one) == passed(network, two)


def passed(network: ComponentNetwork, route: Route) -> int:
    """Components of the plant in a route."""
    return sum(network.equation(step.equation).weight for step in route.steps)


@given(asked())
@faster
def test_fewest_components(case: tuple[ComponentNetwork, Question]) -> None:
    """Integer programming finds a route through fewer components within the same frames, or the default one is it."""
    network, question = case
    question = replace(question, causal=False)
    route = answer(network, question)
    if route is None:
        with pytest.raises(StructureError):
            fewest_components(network, question)
        return
    fewest = fewest_components(network, question)
    check_route(network, fewest)
    assert fewest == route or passed(network, fewest) < passed(network, route)


@given(asked())
@faster
def test_alternatives_differ(case: tuple[ComponentNetwork, Question]) -> None:
    """Alternatives are routes, all different, the default first."""
    network, question = case
    route = answer(network, question)
    assume(route is not None)
    found = list(alternatives(network, question, 6))
    assert found[0] == route
    assert len(found) <= 6
    assert len({frozenset((step.equation, step.frame) for step in item.steps) for item in found}) == len(found)
    for item in found:
        check_route(network, item)
