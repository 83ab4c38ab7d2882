"""Hypotheses of a static network without noise: which values of the suspended parameters explain every observation.

A hypothesis holds only if one value of each of its parameters explains all observations (thesis 3.7.1). Its state
after some observations is a set of points, and systems of equations with infinitely many solutions; an observation
takes points away and turns systems into points. What is rejected stays rejected.
"""

from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from faultbond.equations.numeric import exact
from faultbond.model.expression import Call, walk
from faultbond.networks.explicit import agrees, is_explicit, reading_equations
from faultbond.networks.least_squares import data_of, fit_parameters, ranges_of
from faultbond.networks.numeric_search import Found, same, search_solutions, starts
from faultbond.networks.polynomial_roots import (
    ExactPoint,
    NotPolynomialError,
    PolynomialSystem,
    number,
    polynomial_cases,
    real_points,
    value_of,
)
from faultbond.networks.propagation import Propagated, propagate, suspend, without_readings
from faultbond.networks.relations import TOLERANCE, BlockLaw
from faultbond.networks.static_network import Observation, StaticNetwork

MAX_SYSTEMS = 64
MAX_SEARCHED = 40  # observations that a search looks at; all are checked


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """Suspended parameters, or blocks, and what explains the observations so far.

    points: solutions that are left; of blocks the empty one. systems: equations, each with infinitely many solutions.
    At the start everything is possible. searched: points were searched for, so that there may be others.
    """

    suspects: tuple[str, ...]
    points: tuple[ExactPoint, ...] = ()
    systems: tuple[PolynomialSystem, ...] = ((),)
    searched: bool = False

    @property
    def is_possible(self) -> bool:
        """Whether anything explains the observations."""
        return bool(self.points or self.systems)


def advance(network: StaticNetwork, held: Hypothesis, rows: Sequence[Observation]) -> Hypothesis:
    """Give the state of a hypothesis after one observation more, the last of `rows`."""
    if network.of_blocks:
        consistent = is_consistent(network, held.suspects, rows[-1])
        return replace(held, points=({},) if consistent else (), systems=())
    points = [point for point in held.points if _explains(network, point, rows[-1])]
    if held.searched and not points:
        return _searched(network, held, rows)
    systems = list(held.systems)
    if systems:
        joined = None
        try:
            pairs = list(product(systems, equations_of_parameters(network, held.suspects, rows[-1])))
            if len(pairs) <= MAX_SYSTEMS:
                joined = [_joined(system, case, held.suspects) for system, case in pairs]
        except NotPolynomialError:
            pass
        if joined is None:
            return _searched(network, held, rows)
        systems = list(dict.fromkeys(system for system, _ in joined if system is not None))
        points += [
            point for _, found in joined for point in found if all(_explains(network, point, row) for row in rows)
        ]
        if joined and not (points or systems) and len(held.suspects) > 1:
            # Rounding of the data may have hidden a solution near the nominal values from exact arithmetic. Where that
            # is free, the newest observation says what others said, but for rounding.
            near = next(_fits(network, held.suspects, rows, starts(len(held.suspects))[:1]), None)
            if near is not None:
                points, systems = ([], list(held.systems)) if near.free else ([_point(near)], [])
    return replace(held, points=tuple(_distinct(points)), systems=tuple(systems))


def equations_of_parameters(
    network: StaticNetwork, suspects: tuple[str, ...], seen: Observation
) -> list[PolynomialSystem]:
    """Give what an observation says of suspended parameters, one system for each combination of branches."""
    if is_explicit(network, seen):
        try:
            system = reading_equations(network, suspects, seen)
        except NotPolynomialError:
            pass
        else:
            return [] if system is None else [system]
    found = suspend(network, seen, suspects, {})
    return [] if found.conflict is not None else polynomial_cases(found, suspects, str(seen.index))


def _joined(
    system: PolynomialSystem, case: PolynomialSystem, suspects: tuple[str, ...]
) -> tuple[PolynomialSystem | None, list[ExactPoint]]:
    """Give the system with a case added as long as solutions are infinitely many, else the points.

    One equation is added after the other: those after the points are known are left to the check, which bears rounding.
    """
    private = any(symbol.name not in suspects for item in case for symbol in item.free_symbols)
    for step in (case,) if private else ((item,) for item in case):
        system = tuple(dict.fromkeys((*system, *step)))
        found = real_points(system, suspects)
        if found is not None:
            return None, found
    return system, []


def _distinct(points: Iterable[ExactPoint]) -> list[ExactPoint]:
    kept: list[ExactPoint] = []
    for point in points:
        values = {name: float(value_of(value)) for name, value in point.items()}
        others = ({name: float(value_of(value)) for name, value in other.items()} for other in kept)
        if not any(all(abs(values[n] - o[n]) <= 1e-12 * abs(o[n]) for n in values) for o in others):
            kept.append(point)
    return kept


def _fits(
    network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation], factors: Iterable[tuple[float, ...]]
) -> Iterator[Found]:
    """Give solutions that explain all rows, by fits from multiples of the nominal values."""
    if network.reader is None:
        return
    scale, bounds = ranges_of(network, suspects)
    data, read = data_of(network, rows), network.reader.of(suspects)
    for factor in factors:
        best = fit_parameters(read, np.array(factor) * scale, scale, bounds, data)
        values = dict(zip(suspects, best.values.tolist(), strict=True))
        found = Found(values=values, free=best.rank < len(suspects))
        if all(_explains(network, _point(found), row) for row in rows):
            yield found


def _searched(network: StaticNetwork, held: Hypothesis, rows: Sequence[Observation]) -> Hypothesis:
    found = list(some_solutions(network, held.suspects, rows))
    points = tuple(_point(item) for item in found if not item.free)
    systems = ((),) if any(item.free for item in found) else ()
    return replace(held, points=points, systems=systems, searched=True)


def some_solutions(network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation]) -> Iterator[Found]:
    """Give some solutions that explain all rows, the first near the nominal values if it can be.

    The last one may be `free`: there are others as near.
    """
    if network.reader is not None:
        distinct: list[Found] = []
        for item in _fits(network, suspects, rows, starts(len(suspects))):
            if not any(same(item, other) for other in distinct):
                distinct.append(item)
                yield item
            if item.free:
                return
        return
    some = rows[:MAX_SEARCHED]
    systems = [suspend(network, row, suspects, {}) for row in some]
    if all(system.conflict is None for system in systems):
        nominal = {name: float(network.values[name]) for name in suspects}
        found = search_solutions(systems, nominal, [without_readings(network, row) for row in some])
        yield from (item for item in found if all(_explains(network, _point(item), row) for row in rows))


def _point(found: Found) -> ExactPoint:
    return {name: number(exact(value)) for name, value in found.values.items()}


def _explains(network: StaticNetwork, point: ExactPoint, seen: Observation) -> bool:
    """Whether values of parameters, within their ranges, explain an observation, by the original equations."""
    values = {name: value_of(value) for name, value in point.items()}
    for name, value in values.items():
        item = network.graph.parameter(name)
        slack = TOLERANCE * abs(float(value))
        if not item.lower - slack <= float(value) <= item.upper + slack:
            return False
    if is_explicit(network, seen):
        return agrees(network, seen, values)
    return _has_solution(network, suspend(network, seen, point, values), seen)


def is_consistent(network: StaticNetwork, blocks: Iterable[str], seen: Observation) -> bool:
    """Whether an observation can be explained with some blocks suspended, whose outputs are then free.

    Source: thesis 3.6 and 6.4.1.
    """
    return _has_solution(network, suspend(network, seen, blocks, {}), seen)


def _has_solution(network: StaticNetwork, found: Propagated, seen: Observation) -> bool:
    """Whether signals exist that meet what propagation left."""
    if found.conflict is not None:
        return False
    needed = replace(found, open=_entangled(found))
    if not needed.open:
        return True
    try:
        unknown = {name for item in needed.open for name in item.names} - needed.known.keys()
        for kept in ((), unknown):  # where signals were eliminated, branches cannot be checked
            if any(_is_solved(needed, system) for system in polynomial_cases(needed, kept, "")):
                return True
    except NotPolynomialError:
        pass
    return bool(search_solutions([needed], {}, [without_readings(network, seen)]))


def _entangled(found: Propagated) -> tuple[BlockLaw, ...]:
    """Leave out laws whose signal is in no other equation: it is then whatever they give."""
    left = found.open
    while True:
        count = Counter(name for item in left for name in item.names)
        kept = tuple(
            item for item in left if item.signal is None or item.signal in found.known or count[item.signal] > 1
        )
        if len(kept) == len(left):
            return kept
        left = kept


def _is_solved(found: Propagated, system: PolynomialSystem) -> bool:
    """Whether polynomials have a solution that meets what propagation left.

    One equation is added after the other: where the first ones give a value, the others are checks and bear rounding.
    """
    for count in range(min(1, len(system)), len(system) + 1):
        for point in real_points(system[:count], ()) or ():
            values = {name.removesuffix("@"): value_of(value) for name, value in point.items()}
            left = propagate(found.open, {**found.known, **values})
            sides = (side for item in left.open for side in (item.left, item.right))
            has_cases = any(isinstance(part, Call) for side in sides for part in walk(side))
            # A solution of one case may lie outside of it.
            if left.conflict is None and (not left.open or (count == len(system) and not has_cases)):
                return True
    return False
