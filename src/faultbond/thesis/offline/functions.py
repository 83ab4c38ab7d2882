"""The functions of a plant that method `classic` needs, as routes of the constraint analysis and their closed forms.

States from several samples (A), states from one sample and the states before it (B), each output from all other
measurements. Source: thesis 4.2.1, 4.2.4, 5.3.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace
from itertools import islice

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes import questions
from faultbond.algebra.routes.matched import alternatives, find_route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.formula import to_one_line
from faultbond.algebra.solving.problem import name_of
from faultbond.algebra.solving.solution import Root, Solution
from faultbond.algebra.solving.solve import SolvingLimits, solve
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError
from faultbond.thesis.offline.torn import Torn, tear

MOST_SAMPLES = 4  # from which a state is found; each further one multiplies the noise by the rate of sampling
MOST_ROUTES = 20  # looked at for one along which no state is differentiated


@dataclass(frozen=True, slots=True, kw_only=True)
class Closed:
    """An answered question, in closed form, or torn where there is none; without route where it is simply measured."""

    question: Question
    route: Route | None
    roots: tuple[Root, ...]
    formula: str
    torn: Torn | None = None

    @property
    def targets(self) -> tuple[str, ...]:
        """Names of what is found."""
        return tuple(map(name_of, self.question.targets))


def state_signals(network: ComponentNetwork) -> tuple[str, ...]:
    """Give the signals that are states, each once."""
    return tuple(dict.fromkeys(state.signal for state in network.states))


def answer_closed(network: ComponentNetwork, question: Question, route: Route | None, plant: NumericPlant) -> Closed:
    """Give the closed form of a route, or, where there is none, the way to find its targets by Newton's method.

    Raises
    ------
    StructureError
        Where there is neither.
    """
    if route is None:
        return Closed(question=question, route=None, roots=(Root(lines=()),), formula="measured")
    solution = solve(network, route, plant, SolvingLimits())
    if solution.roots:
        return Closed(question=question, route=route, roots=solution.roots, formula=to_one_line(solution) or "")
    states = [f"{name}_0" for name in state_signals(network)]
    torn = tear(network, route, plant, prefer=states)
    return Closed(
        question=question,
        route=route,
        roots=(),
        formula=f"by Newton's method for {', '.join(torn.guessed)}: {_why(solution)}",
        torn=torn,
    )


def _why(solution: Solution) -> str:
    return next(iter(solution.remarks), solution.kind.value).removeprefix("no closed form: ")


def from_samples(network: ComponentNetwork) -> tuple[tuple[Question, Route | None] | None, ...]:
    """Ask for each state from as many samples as it takes.

    None where no number of them fixes it, or only so many that differences of differences leave nothing but noise; such
    a state is followed by the model alone.
    """
    found: list[tuple[Question, Route | None] | None] = []
    for question in questions.states(network):
        if question.is_known(_signal(question)):
            found.append((question, None))
            continue
        try:
            route = find_route(network, question)
        except StructureError:
            found.append(None)
        else:
            found.append((question, route) if route.observations <= MOST_SAMPLES else None)
    return tuple(found)


def _signal(question: Question) -> tuple[str, int]:
    (target,) = question.targets
    if isinstance(target, str):
        raise TypeError(target)
    return target


def read_by(network: ComponentNetwork, item: tuple[Question, Route | None] | None) -> frozenset[str]:
    """Give the outputs whose newest sample a state is found from."""
    if item is None:
        return frozenset()
    question, route = item
    used = [_signal(question)] if route is None else route.samples
    return frozenset(name for name, frame in used if frame == 0 and name in network.outputs)


def from_before(network: ComponentNetwork, state: str, hidden: Iterable[str]) -> tuple[Question, Route]:
    """Ask for a state from the states before and one sample without some outputs. Source: thesis 5.3."""
    question = Question(
        targets=((state, 0),),
        observed=network.observed,
        known=_start(network),
        hidden=frozenset({(state, 0), *((name, 0) for name in hidden)}),
        frames=1,
        title=f"state {state} from the states before",
    )
    return question, forward_route(network, question)


def expected(network: ComponentNetwork, output: str, *, inputs_only: bool = False) -> tuple[Question, Route]:
    """Ask for an output from the states before and all else that is measured. Source: thesis 4.2.4."""
    hidden = network.outputs if inputs_only else (output,)
    question = Question(
        targets=((output, 0),),
        observed=network.observed,
        known=_start(network),
        hidden=frozenset((name, 0) for name in hidden),
        frames=1,
        title=f"output {output}",
    )
    return question, forward_route(network, question)


def _start(network: ComponentNetwork) -> frozenset[tuple[str, int]]:
    return frozenset((state, 1) for state in state_signals(network))


def forward_route(network: ComponentNetwork, question: Question) -> Route:
    """Give the shortest route along which stores integrate, and which passes the stores that cause the target.

    A measured signal may be passed on in any direction: that a meter reads through a component is no reason not to use
    it. But no state is differentiated, and a target that a state causes is not found round about that state.

    Raises
    ------
    StructureError
        Where there is no route.
    """
    sums = {state.sum: (state.signal, 0) for state in network.states}
    along = find_route(network, replace(question, causal=True))
    needed = _nearest_sums(along, sums, network)
    first = find_route(network, question)
    if _is_forward(first, sums, needed):
        return first
    found = [
        route
        for route in islice(alternatives(network, question, MOST_ROUTES), MOST_ROUTES)
        if _is_forward(route, sums, needed)
    ]
    return min(found, key=lambda route: len(route.steps), default=along)


def _is_forward(route: Route, sums: dict[str, tuple[str, int]], needed: frozenset[str]) -> bool:
    used = {step.equation for step in route.steps if step.equation in sums}
    integrates = all(step.finds == sums[step.equation] for step in route.steps if step.equation in sums)
    return integrates and needed <= used


def _nearest_sums(route: Route, sums: dict[str, tuple[str, int]], network: ComponentNetwork) -> frozenset[str]:
    """Give the sums of stores first met on the way back from the target."""
    steps = {step.finds: step for step in route.steps}
    signals = {item.name: item.signals for item in network.equations}
    found, seen = set(), set(route.question.targets)
    queue = list(route.question.targets)
    for target in queue:
        step = steps.get(target)
        if step is None:
            continue
        if step.equation in sums:
            found.add(step.equation)
            continue
        for name, back in signals[step.equation]:
            if (other := (name, step.frame + back)) not in seen:
                seen.add(other)
                queue.append(other)
    return frozenset(found)
