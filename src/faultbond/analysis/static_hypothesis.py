"""Hypotheses of a static network without noise: which values of the suspended parameters explain every observation.

A hypothesis holds only if one value of each of its parameters explains all observations (thesis 3.7.1). Its state
after some observations is a set of points, and systems of equations with infinitely many solutions; an observation
takes points away and turns systems into points. What is rejected stays rejected.
"""

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from itertools import product

from faultbond.analysis.static_network import (
    TOLERANCE,
    Observation,
    Propagated,
    StaticNetwork,
    equations_of,
    propagate,
    without_readings,
)
from faultbond.analysis.static_search import Found, search
from faultbond.analysis.static_solve import (
    NotPolynomialError,
    Point,
    System,
    number,
    polynomial_cases,
    real_points,
    value_of,
)
from faultbond.structure.numeric import exact

MAX_SYSTEMS = 64
MAX_SEARCHED = 40  # observations that a search looks at; all are checked


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Hypothesis:
    """Suspended parameters, or blocks, and what explains the observations so far.

    points: solutions that are left; of blocks the empty one. systems: equations, each with infinitely many solutions,
    one of which is near the nominal values: `nearest`. At the start everything is possible.
    """

    suspects: tuple[str, ...]
    points: tuple[Point, ...] = ()
    systems: tuple[System, ...] = ((),)
    nearest: Point | None = None

    @property
    def is_possible(self) -> bool:
        """Whether anything explains the observations."""
        return bool(self.points or self.systems)


def advance(network: StaticNetwork, held: Hypothesis, rows: Sequence[Observation]) -> Hypothesis:
    """Give the state of a hypothesis after one observation more, the last of `rows`."""
    if network.of_blocks:
        consistent = is_consistent(network, held.suspects, rows[-1])
        return replace(held, points=({},) if consistent else (), systems=())
    points = [point for point in held.points if explains(network, point, rows[-1])]
    systems: list[System] = []
    if held.systems:
        found = equations_of(network, rows[-1], held.suspects, {})
        if found.conflict is not None:
            return replace(held, points=(), systems=(), nearest=None)
        try:
            systems, more = _combined(held, found, rows[-1])
        except NotPolynomialError:
            return _searched(network, held, rows)
        points += [point for point in more if all(explains(network, point, row) for row in rows)]
    after = replace(held, points=tuple(_distinct(points)), systems=tuple(systems), nearest=None)
    if after.is_possible and not (after.systems and not after.points):
        return after
    return _confirmed(network, held, after, rows)


def _combined(held: Hypothesis, found: Propagated, seen: Observation) -> tuple[list[System], list[Point]]:
    """Give the systems with infinitely many solutions, and the points, that all branches lead to."""
    cases = polynomial_cases(found, held.suspects, str(seen.index))
    if len(cases) * len(held.systems) > MAX_SYSTEMS:
        raise NotPolynomialError
    systems: list[System] = []
    points: list[Point] = []
    for system, case in product(held.systems, cases):
        joined = tuple(dict.fromkeys((*system, *case)))
        solutions = real_points(joined, held.suspects)
        if solutions is None:
            systems.append(joined)
        else:
            points += solutions
    return list(dict.fromkeys(systems)), points


def _distinct(points: Iterable[Point]) -> list[Point]:
    kept: list[Point] = []
    for point in points:
        values = {name: float(value_of(value)) for name, value in point.items()}
        others = ({name: float(value_of(value)) for name, value in other.items()} for other in kept)
        if not any(all(abs(values[n] - o[n]) <= 1e-12 * abs(o[n]) for n in values) for o in others):
            kept.append(point)
    return kept


def _confirmed(
    network: StaticNetwork, before: Hypothesis, after: Hypothesis, rows: Sequence[Observation]
) -> Hypothesis:
    """Look for a real solution by search: of systems, and where rounding of the data may have hidden the exact one."""
    found = _search(network, after.suspects, rows)
    if not found:
        return replace(after, systems=())
    if not found[0].free:
        points = [_point(item) for item in found]
        return replace(after, points=tuple(points), systems=())
    return replace(after, systems=after.systems or before.systems or ((),), nearest=_point(found[0]))


def _searched(network: StaticNetwork, held: Hypothesis, rows: Sequence[Observation]) -> Hypothesis:
    found = _search(network, held.suspects, rows)
    points = tuple(_point(item) for item in found if not item.free)
    free = next((item for item in found if item.free), None)
    if free is None:
        return replace(held, points=points, systems=(), nearest=None)
    return replace(held, points=points, systems=((),), nearest=_point(free))


def _search(network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation]) -> list[Found]:
    """Give solutions by search that explain all rows."""
    some = rows[:MAX_SEARCHED]
    systems = [equations_of(network, row, suspects, {}) for row in some]
    if any(system.conflict is not None for system in systems):
        return []
    nominal = {name: float(network.values[name]) for name in suspects}
    found = search(systems, nominal, [without_readings(network, row) for row in some])
    return [item for item in found if all(explains(network, _point(item), row) for row in rows)]


def _point(found: Found) -> Point:
    return {name: number(exact(value)) for name, value in found.values.items()}


def explains(network: StaticNetwork, point: Point, seen: Observation) -> bool:
    """Whether values of parameters, within their ranges, explain an observation, by the original equations."""
    values = {name: value_of(value) for name, value in point.items()}
    for name, value in values.items():
        item = network.graph.parameter(name)
        slack = TOLERANCE * abs(float(value))
        if not item.lower - slack <= float(value) <= item.upper + slack:
            return False
    return _has_solution(network, equations_of(network, seen, point, values), seen)


def is_consistent(network: StaticNetwork, blocks: Iterable[str], seen: Observation) -> bool:
    """Whether an observation can be explained with some blocks suspended, whose outputs are then free.

    Source: thesis 3.6 and 6.4.1.
    """
    return _has_solution(network, equations_of(network, seen, blocks, {}), seen)


def _has_solution(network: StaticNetwork, found: Propagated, seen: Observation) -> bool:
    """Whether signals exist that meet what propagation left."""
    if found.conflict is not None:
        return False
    if not found.open:
        return True
    try:
        for system in polynomial_cases(found, (), ""):
            for point in real_points(system, ()) or ():
                values = {name.removesuffix("@"): value_of(value) for name, value in point.items()}
                if propagate(found.open, {**found.known, **values}).conflict is None:
                    return True
    except NotPolynomialError:
        pass
    return bool(search([found], {}, [without_readings(network, seen)]))
