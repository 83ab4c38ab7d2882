"""Elements that give what they can only take: resistances below zero, stores whose content falls as it is filled.

A law is tried at flows (contents, efforts) of many sizes and both signs, with nominal parameters. An element that takes
power at any of them is left alone: a coefficient of a quadratic law may be below zero, a resistance by itself not.
Source: thesis 3.2.2 (R dissipates, C and I store); Willems, Arch. Rational Mech. Anal. 45 (1972) 321 (dissipativity).
"""

import math
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass

from faultbond.equations.inversion import linear_solution
from faultbond.equations.numeric import slopes
from faultbond.equations.tables import with_curves
from faultbond.model.expression import Binary, Expression, Name, names
from faultbond.model.graph import BondGraph, Component
from faultbond.types import ElementType

SIZES = tuple(10.0**k for k in range(-12, 13, 2))  # of the signal that a law is tried at, SI
OTHERS = (0.0, 1e-3, 1.0, 50.0, 1e3)  # inputs, and signals of other components there; the latter of both signs
PAIRS = {ElementType.R: ("e", "f"), ElementType.C: ("e", "q"), ElementType.I: ("f", "p")}  # what its law relates


@dataclass(frozen=True, slots=True, kw_only=True)
class Active:
    """A component that gives power wherever it is tried, and the numbers below zero that are why; none: its law is."""

    component: Component
    numbers: tuple[str, ...]


def active_elements(graph: BondGraph) -> tuple[Active, ...]:
    """Give the R, C and I elements that are no such elements with the numbers that the model states."""
    known = {item.name: item.nominal for item in graph.parameters}
    known |= {item.name: item.value for item in graph.constants}
    return tuple(_active(graph, known))


def _active(graph: BondGraph, known: Mapping[str, float]) -> Iterator[Active]:
    for item in graph.components:
        law = _characteristic(graph, item)
        if law is None or not _gives(graph, item, *law, known):
            continue
        below = [name for name in names(law[1]) if known.get(name, 0.0) < 0.0]
        guilty = tuple(name for name in below if not _gives(graph, item, *law, {**known, name: -known[name]}))
        yield Active(component=item, numbers=guilty)


def _characteristic(graph: BondGraph, item: Component) -> tuple[str, Expression] | None:
    """Give the signal that the law of an R, C or I is tried at, and the other one as a function of it."""
    if item.type not in PAIRS or len(item.laws) != 1:
        return None
    curves = {table.name: table for table in graph.tables}
    left, right = (with_curves(side, curves) for side in (item.laws[0].left, item.laws[0].right))
    pair = [f"{item.name}.{letter}" for letter in PAIRS[item.type]]
    for signal, other in (pair, reversed(pair)):
        if left == Name(signal) and signal not in names(right):
            return other, right
    for signal, other in (pair, reversed(pair)):
        solution = linear_solution(Binary("-", left, right), signal)
        if solution is not None and signal not in names(solution):
            return other, solution
    return None


def _gives(graph: BondGraph, item: Component, at: str, function: Expression, known: Mapping[str, float]) -> bool:
    """Whether an element gives power (of a store: whether its content falls) at all that it is tried at."""
    further = [name for name in names(function) if name != at and name not in known]
    signs = set()
    for values in _about(graph, further):
        for size in (sign * size for size in SIZES for sign in (1.0, -1.0)):
            value, by = slopes(function, {**known, **values, at: size}, {at})
            found = float(by.get(at, 0.0)) if item.type.is_store else float(value) * size
            if math.isfinite(found) and found != 0.0:
                signs.add(found > 0.0)
    return signs == {False}


def _about(graph: BondGraph, further: Iterable[str]) -> Iterator[dict[str, float]]:
    """Give values that inputs and signals of other components may have; an input stays within its range."""
    wanted = tuple(further)
    inputs = {item.name: item for item in graph.inputs}
    for size in OTHERS:
        for sign in (1.0, -1.0):
            yield {
                name: min(max(size, inputs[name].lower), inputs[name].upper) if name in inputs else sign * size
                for name in wanted
            }
