"""Answers to the questions of fault analysis: which route is preferred, and what is said where there is none."""

from dataclasses import replace
from pathlib import Path

import pytest
from solved import example

from faultbond.algebra.routes import questions
from faultbond.algebra.routes.functions import (
    MOST_ALTERNATIVES,
    Preference,
    answer,
    asked,
    choose_route,
    components_passed,
    equations_passed,
    trial_record,
)
from faultbond.algebra.routes.matched import alternatives, find_route
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of
from faultbond.algebra.solving.noise import noise_gain
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.text import parse_model

TWO_METERS = """
name: two meters
sample_time: 0.2 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R1: {type: R, parameters: {R1: 2 ohm}}
  C1: {type: C, parameters: {C1: 0.5 F}}
  R2: {type: R, parameters: {R2: 3 ohm}}
  C2: {type: C, parameters: {C2: 0.3 F}}
junctions: {a: 1, b: 0, c: 1, d: 0}
bonds: [source -> a -> R1, a -> b -> C1, b -> c -> R2, c -> d -> C2]
sensors:
  coarse: {reads: b.e, unit: V, noise: 100 mV}
  fine: {reads: d.e, unit: V, noise: 1 mV}
  i: {reads: 1000*a.f, unit: A, noise: 0.5 A}
"""


@pytest.fixture(scope="module")
def meters() -> tuple[ComponentNetwork, NumericPlant]:
    """A ladder whose first voltage is read coarsely, its second finely."""
    graph = parse_model(TWO_METERS)
    return build_components(graph, build_network(graph, assign_causality(graph))), plant_of(graph)


def test_least_noise(meters: tuple[ComponentNetwork, NumericPlant]) -> None:
    """The route with the least noise of all alternatives is taken: for C1 and the flow into it not the shortest."""
    network, plant = meters
    record = trial_record(network, plant, 1)
    better = set()
    for question in asked(network, 1):
        if question.causal:
            continue
        chosen = choose_route(network, question, Preference.NOISE, plant, record)
        gains = [noise_gain(network, route, plant, record).worst for route in alternatives(network, question)]
        assert len(gains) <= MOST_ALTERNATIVES
        assert noise_gain(network, chosen, plant, record).worst == min(gains)
        if min(gains) < gains[0]:
            better.add(question.title)
    assert better == {"signals at C1", "signals at C2", "parameter C1"}


def test_of_equal_noise_the_shorter_route(meters: tuple[ComponentNetwork, NumericPlant]) -> None:
    """Without any noise all routes are equally good, and the one with the fewest equations is taken."""
    network, plant = meters
    silent, record = replace(plant, sds={}), trial_record(network, plant, 1)
    question = questions.parameters(network, ("C1",))
    sizes = {len(route.steps) for route in alternatives(network, question)}
    chosen = choose_route(network, question, Preference.NOISE, silent, record)
    assert len(sizes) > 1
    assert len(chosen.steps) == min(sizes)


@pytest.mark.parametrize("preference", list(Preference))
def test_outputs_follow_causality(meters: tuple[ComponentNetwork, NumericPlant], preference: Preference) -> None:
    """An output is predicted along causality whatever is preferred, though another sensor gives it with less noise."""
    network, plant = meters
    record = trial_record(network, plant, 1)
    for question in questions.outputs(network):
        assert choose_route(network, question, preference, plant, record) == find_route(network, question)


def test_without_a_record_noise_is_not_known(meters: tuple[ComponentNetwork, NumericPlant]) -> None:
    """Where the nominal plant cannot be simulated there is a route all the same, and no figure of its noise."""
    network, plant = meters
    question = questions.parameters(network, ("C1",))
    found = answer(network, question, plant, None, preference=Preference.NOISE)
    assert (found.route, found.gain, found.solution) == (find_route(network, question), None, None)


def test_refusal() -> None:
    """No route is an answer, with the reason and what would help."""
    network, plant = example("rc")
    blind = replace(questions.parameters(network, ("R",)), observed=frozenset({"V"}))
    found = answer(network, blind, plant, None)
    assert found.route is None
    assert "R cannot be found from V" in found.refusal


def test_closed_form_on_request(tmp_path: Path) -> None:
    """With a folder for solutions an answer holds a closed form, without one none."""
    network, plant = example("rc")
    question = questions.parameters(network, ("R",))
    with_form = answer(network, question, plant, None, cache=tmp_path)
    assert with_form.solution is not None
    assert with_form.solution.roots
    assert with_form.route is not None
    assert equations_passed(network, with_form.route) == ("R_0", "loop_0", "C_0", "C.sum_0")
    assert components_passed(network, with_form.route) == ("R", "loop", "C")
