"""What the tests of solving share: plants by name, and static networks written as equations."""

from collections.abc import Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from pathlib import Path

from faultbond.algebra.route import Question, Route, RouteStep
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, Equation, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.expression import names
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def example(folder: str) -> tuple[ComponentNetwork, NumericPlant]:
    """An example plant and its numbers."""
    graph = load_model(EXAMPLES / folder / "model.yaml")
    return build_components(graph, build_network(graph, assign_causality(graph))), plant_of(graph)


def static(
    equations: Mapping[str, str], inputs: Sequence[str], outputs: Sequence[str], values: Mapping[str, float]
) -> tuple[ComponentNetwork, NumericPlant]:
    """A network without states from residuals, and parameters with their nominal values; inputs move from 1 to 10."""
    parsed = {name: parse_expression(text) for name, text in equations.items()}
    items = tuple(
        Equation(
            name=name,
            owner=name,
            residual=residual,
            signals=tuple((used, 0) for used in names(residual) if used not in values),
            parameters=tuple(used for used in names(residual) if used in values),
        )
        for name, residual in parsed.items()
    )
    network = ComponentNetwork(
        name="static",
        equations=items,
        signals=tuple(dict.fromkeys(signal for item in items for signal, _ in item.signals)),
        inputs=tuple(inputs),
        outputs=tuple(outputs),
        states=(),
        parameters=tuple(values),
        suspects=tuple(values),
    )
    ranges = {name: (Fraction(1), Fraction(10)) for name in inputs}
    exact = {name: Fraction(repr(value)) for name, value in values.items()}
    return network, NumericPlant(values=exact, inputs=ranges)


def route_to(network: ComponentNetwork, *targets: str) -> Route:
    """The route to some parameters."""
    return find_route(network, Question(targets=targets, observed=network.observed, unknown=targets))


def earlier(route: Route, frames: int = 1) -> Route:
    """Give the same route some frames earlier: what it found then, from what was known then."""
    question = route.question
    shifted = replace(
        question,
        targets=tuple(t if isinstance(t, str) else (t[0], t[1] + frames) for t in question.targets),
        known=frozenset((name, frame + frames) for name, frame in question.known),
        hidden=frozenset((name, frame + frames) for name, frame in question.hidden),
        newest=question.newest + frames,
    )
    return replace(
        route,
        question=shifted,
        steps=tuple(
            RouteStep(
                equation=step.equation,
                frame=step.frame + frames,
                finds=step.finds if isinstance(step.finds, str) else (step.finds[0], step.finds[1] + frames),
            )
            for step in route.steps
        ),
        samples=tuple((name, frame + frames) for name, frame in route.samples),
        known=tuple((name, frame + frames) for name, frame in route.known),
    )
