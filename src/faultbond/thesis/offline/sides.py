"""What a parameter is estimated from: a suspended law, and the signals that arrive on its sides (thesis 4.2.2, 6.2).

Known are the inputs, the blended states and their rates, and those outputs that no state shows: the flow through a
meter, say. A relation is a law and the others that bring its signals; the smallest relations that are independent of
each other are taken, as many as there are equations to spare. In each the law of a suspended component is the one left
over, so that for a single suspect the parameter follows from the signals on its two sides.
"""

from collections.abc import Iterable
from dataclasses import dataclass, replace

from faultbond.algebra.route import Question
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import NumericPlant
from faultbond.algebra.solving.solution import Line, Root
from faultbond.equations.component_network import ComponentNetwork, Equation, SignalAt, in_frame
from faultbond.equations.inversion import substitute
from faultbond.equations.matching import match
from faultbond.errors import StructureError
from faultbond.model.expression import Number
from faultbond.model.parser import to_text
from faultbond.thesis.offline.functions import answer_closed, state_signals

MISFIT = "misfit"  # name of what is left over of a law


@dataclass(frozen=True, slots=True, kw_only=True)
class Side:
    """A law with the closed forms of the signals on its sides; the last line of each root is what is left over."""

    equation: str
    suspended: tuple[str, ...]  # parameters of the law itself
    relation: frozenset[str]
    roots: tuple[Root, ...]
    formula: str


def known_signals(network: ComponentNetwork) -> tuple[frozenset[str], frozenset[SignalAt]]:
    """Give the inputs and outputs whose samples are used, and the states and rates that are given."""
    states = state_signals(network)
    given = frozenset((name, 0) for name in (*states, *(state.rate for state in network.states)))
    suspects = set(network.suspects)
    suspended = _sums(network) | {item.name for item in network.equations if suspects.intersection(item.parameters)}
    inputs = frozenset(network.inputs)

    def is_shown(output: str) -> bool:
        """Whether an output follows from states and inputs without any parameter that may be at fault."""
        asked = Question(targets=((output, 0),), observed=inputs, known=given, suspended=suspended, frames=1)
        try:
            find_route(network, asked)
        except StructureError:
            return False
        return True

    return inputs.union(name for name in network.outputs if name not in states and not is_shown(name)), given


def _sums(network: ComponentNetwork) -> frozenset[str]:
    return frozenset(state.sum for state in network.states)


def _question(network: ComponentNetwork, equation: Equation, allowed: frozenset[str] | None = None) -> Question:
    """Ask for the signals at an equation, which is left out, from the other equations or those allowed."""
    observed, given = known_signals(network)
    out = {item.name for item in network.equations} - allowed if allowed is not None else set()
    targets = ((name, back) for name, back in equation.signals if name not in observed and (name, back) not in given)
    return Question(
        targets=tuple(dict.fromkeys(targets)),
        observed=observed,
        known=given,
        suspended=frozenset({equation.name, *_sums(network), *out}),
        frames=1,
        title=f"signals at {equation.owner}",
    )


def independent_relations(network: ComponentNetwork) -> tuple[frozenset[str], ...]:
    """Give the smallest sets of equations that have one to spare and are independent, smallest first."""
    laws = [item for item in network.equations if item.name not in _sums(network)]
    found: dict[frozenset[str], int] = {}
    for law in laws:
        question = _question(network, law)
        try:
            steps = find_route(network, question).steps if question.targets else ()
        except StructureError:
            continue
        relation = frozenset({law.name, *(step.equation for step in steps)})
        found.setdefault(relation, len(found))
    suspects = {item.name: len(set(item.parameters).intersection(network.suspects)) for item in laws}
    order = sorted(found, key=lambda item: (len(item), sum(suspects[name] for name in item), found[item]))
    return independent(network, order)


def independent(network: ComponentNetwork, candidates: Iterable[frozenset[str]]) -> tuple[frozenset[str], ...]:
    """Give, in order, the sets of equations that say something which those before them do not."""
    observed, given = known_signals(network)
    chosen: list[frozenset[str]] = []
    for candidate in candidates:
        places: dict[SignalAt, int] = {}
        rows = []
        for name in sorted(candidate.union(*chosen)):
            open_ = (item for item in network.equation(name).signals if item[0] not in observed and item not in given)
            rows.append([places.setdefault(signal, len(places)) for signal in open_])
        if len(rows) - sum(row >= 0 for row in match(rows, len(places))) > len(chosen):  # once each unknown has one
            chosen.append(candidate)
    return tuple(chosen)


def side_of(network: ComponentNetwork, relation: frozenset[str], parameter: str, plant: NumericPlant) -> Side:
    """Give, in a relation, the law of a suspended component and the signals on its sides.

    Raises
    ------
    StructureError
        Where no law of the parameter in this relation has a closed form of its sides.
    """
    laws = [item for item in network.equations if item.name in relation and parameter in item.parameters]
    refusals = []
    for law in laws:
        try:
            return _closed_side(network, law, relation, plant)
        except StructureError as error:
            refusals.append(str(error))
    raise StructureError(refusals[0])


def _closed_side(network: ComponentNetwork, law: Equation, relation: frozenset[str], plant: NumericPlant) -> Side:
    question = _question(network, law, relation)
    route = find_route(network, question) if question.targets else None
    closed = answer_closed(network, question, route, plant)
    if closed.torn is not None:
        raise StructureError(f"{network.file}: {question.title} are not found in closed form")
    constants = {name: Number(float(value)) for name, value in plant.values.items() if name not in network.parameters}
    misfit = Line(name=MISFIT, value=substitute(in_frame(law, 0), dict(constants)))
    return Side(
        equation=law.name,
        suspended=law.parameters,
        relation=relation,
        roots=tuple(replace(root, lines=(*root.lines, misfit)) for root in closed.roots),
        formula=f"{to_text(misfit.value)} = 0; {closed.formula}",
    )
