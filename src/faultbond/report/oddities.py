"""What a model states and its author has hardly meant: `check` asks whether it is so."""

from collections.abc import Iterator

from faultbond.fit.imperfections import TEMPERATURE
from faultbond.model.expression import Binary, Expression, Name
from faultbond.model.graph import BondGraph, Component
from faultbond.report.numbers import join
from faultbond.types import ElementType, JunctionType

MUCH = 1.0  # times its value that a parameter may be off while healthy


def oddities(graph: BondGraph) -> Iterator[str]:
    """Give what is worth a look, each in a sentence that says what to do if it was not meant."""
    yield from _wide_accuracies(graph)
    yield from _summed_temperatures(graph)
    yield from _shut_in_a_row(graph)


def _wide_accuracies(graph: BondGraph) -> Iterator[str]:
    """Of suspects that may be off by more than they are: `accuracy: 5` where 5 % was meant."""
    for item in graph.parameters:
        if item.suspect and item.accuracy > MUCH * abs(item.nominal) > 0.0:
            part = 100.0 * item.accuracy / abs(item.nominal)
            yield (
                f"{item.name} may be off by {part:.3g} % while healthy, and no change by less is a fault; of a part of "
                "its value write `accuracy: 5 %`"
            )


def _summed_temperatures(graph: BondGraph) -> Iterator[str]:
    """Of 1-junctions at which two temperatures add up, where heat flows by their difference."""
    types = {item.name: item.type for item in graph.components}
    for junction in graph.junctions:
        if junction.type is not JunctionType.ONE:
            continue
        into = [item.tail for item in graph.bonds if item.head == junction.name]
        out = [item.head for item in graph.bonds if item.tail == junction.name]
        if any(types.get(name) in (ElementType.TF, ElementType.GY, ElementType.I) for name in (*into, *out)):
            continue
        into, out = ([name for name in side if types.get(name) is not ElementType.R] for side in (into, out))
        hot = [*into, *out]
        known = all(graph.signal_unit(f"{name}.e").text == TEMPERATURE for name in hot)
        if len(hot) == 2 and known and len(into) != 1:
            one, other = sorted(hot, key=lambda name: types.get(name) is ElementType.SE)
            here, there = (f"{junction.name} -> {other}", f"{other} -> {junction.name}")
            turn = f"`{there}` as `{here}`" if other in into else f"`{here}` as `{there}`"
            yield (
                f"{junction.name} adds the temperatures of {join([one, other])}, where heat flows by their difference; "
                f"write {turn}"
            )


def _shut_in_a_row(graph: BondGraph) -> Iterator[str]:
    """Of what lets nothing through where an input is 0, in a row with another whose flow is stated by a law too."""
    parts = {item.name: item for item in graph.components}
    for junction in graph.junctions:
        if junction.type is not JunctionType.ONE:
            continue
        ends = [
            name for item in graph.bonds for name in (item.tail, item.head) if junction.name in (item.tail, item.head)
        ]
        flows = [name for name in ends if name in parts and _gives_flow(parts[name])]
        shut = [
            name for name in flows if any(_is_shut_by(parts[name].laws[0].right, item.name) for item in graph.inputs)
        ]
        if shut and len(flows) > 1:
            others = [name for name in flows if name != shut[0]]
            yield (
                f"{join(flows)} are in a row at {junction.name}: where {shut[0]} lets nothing through, nor does "
                f"{join(others)}; ways side by side are joined by a 0-junction, as `{junction.name} -> beside -> "
                f"{flows[0]}, beside -> {flows[1]}` with `beside: 0` among the junctions"
            )


def _gives_flow(part: Component) -> bool:
    return part.type is ElementType.R and len(part.laws) == 1 and part.laws[0].left == Name(f"{part.name}.f")


def _is_shut_by(law: Expression, name: str) -> bool:
    """Tell whether a law gives nothing where an input is 0: it is a factor."""
    match law:
        case Binary("*", left, right):
            return _is_shut_by(left, name) or _is_shut_by(right, name)
        case Binary("/" | "**", left, _):
            return _is_shut_by(left, name)
    return law == Name(name)
