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
from faultbond.algebra.solving.solution import Root
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
    why = next(iter(solution.remarks), solution.kind.value).removeprefix("no closed form: ")
    formula = f"by Newton's method for {', '.join(torn.guessed)}: {why}"
    return Closed(question=question, route=route, roots=(), formula=formula, torn=torn)


def from_samples(network: ComponentNetwork) -> tuple[tuple[Question, Route | None] | None, ...]:
    """Ask for each state from as many samples as it takes.

    None where no number of them fixes it, or only so many that differences of differences leave nothing but noise; such
    a state is followed by the model alone.
    """
    found: list[tuple[Question, Route | None] | None] = []
    for state, question in zip(state_signals(network), questions.states(network), strict=True):
        if question.is_known((state, 0)):
            found.append((question, None))
            continue
        try:
            route = find_route(network, question)
        except StructureError:
            found.append(None)
        else:
            found.append((question, route) if route.observations <= MOST_SAMPLES else None)
    return tuple(found)


def read_by(network: ComponentNetwork, item: tuple[Question, Route | None] | None) -> frozenset[str]:
    """Give the outputs whose newest sample a state is found from."""
    if item is None:
        return frozenset()
    question, route = item
    used = question.targets if route is None else route.samples
    return frozenset(name for name in network.outputs if (name, 0) in used)


def from_before(network: ComponentNetwork, state: str, hidden: Iterable[str]) -> tuple[Question, Route]:
    """Ask for a state from the states before and one sample without some outputs. Source: thesis 5.3."""
    return _one_sample(network, state, (state, *hidden), f"state {state} from the states before")


def expected(network: ComponentNetwork, output: str, *, inputs_only: bool = False) -> tuple[Question, Route]:
    """Ask for an output from the states before and all else that is measured. Source: thesis 4.2.4."""
    hidden = network.outputs if inputs_only else (output,)
    return _one_sample(network, output, hidden, f"output {output}")


def _one_sample(network: ComponentNetwork, target: str, hidden: Iterable[str], title: str) -> tuple[Question, Route]:
    """Ask for a signal from the states before and one sample, by the shortest route along which stores integrate.

    A measured signal may be passed on in any direction: that a meter reads through a component is no reason not to use
    it. But no state is differentiated, and a target that a state causes is not found round about that state.
    """
    question = Question(
        targets=((target, 0),),
        observed=network.observed,
        known=frozenset((state, 1) for state in state_signals(network)),
        hidden=frozenset((name, 0) for name in hidden),
        frames=1,
        title=title,
    )
    sums = {state.sum: (state.signal, 0) for state in network.states}
    along = find_route(network, replace(question, causal=True))
    needed = _nearest_sums(along, sums, network)

    def is_forward(route: Route) -> bool:
        used = {step.equation: step.finds for step in route.steps if step.equation in sums}
        return needed <= used.keys() and all(found == sums[name] for name, found in used.items())

    first = find_route(network, question)
    if is_forward(first):
        return question, first
    found = filter(is_forward, islice(alternatives(network, question, MOST_ROUTES), MOST_ROUTES))
    return question, min(found, key=lambda route: len(route.steps), default=along)


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
