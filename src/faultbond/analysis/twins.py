"""Twins: different sets of suspects whose faults give exactly the same outputs, always or in certain proportions.

A winding and a bearing of the motor that change in one proportion look exactly like a coil and a rotor that change in
another. Sets whose ranks allow it are compared on noise-free outputs of a long run: small faults of both that cancel
give the direction, fits of both at once follow it to large ones. Only what passes through the healthy plant is found.

Source: thesis 6.1.2 and 6.5 speak of the motor's equivalent sets; the search is ours.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations

import numpy as np

from faultbond.analysis.fitting import fit, fit_together
from faultbond.analysis.ranks import Reduced, reduce
from faultbond.analysis.sensitivity import sensitivities
from faultbond.analysis.solutions import Bench, bench_of, changed, places_of
from faultbond.dynamics.step import StepModel
from faultbond.model.graph import BondGraph
from faultbond.types import FloatArray

SIZES = (0.7, 1.3, 1.7)  # of the leading parameter of a family
DRAWS = 2  # random faults of one set to be imitated by another
DRAWN = (0.7, 1.5)  # range of their factors
MOST_PAIRS = 100  # followed of each kind, in the order given
_STEEPEST = 4.0  # largest power at which a family is looked for
_SIMPLE = 1e-5  # an exponent so near a simple fraction is that fraction

Sides = tuple[list[int], list[int]]


@dataclass(frozen=True, slots=True, kw_only=True)
class Match:
    """A fault of one set and one of another with the same outputs, in factors of the nominals."""

    first: tuple[float, ...]
    second: tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Twins:
    """Two sets of suspects that can give the same outputs.

    always : whether the second can imitate whatever the first does
    matches : faults of one and the other that look alike, along the family through the healthy plant; fewer than the
        sizes asked for where the ranges end it
    first_powers, second_powers : where each parameter of the family is nominal * s**power, those powers
    """

    first: tuple[str, ...]
    second: tuple[str, ...]
    always: bool
    matches: tuple[Match, ...]
    first_powers: tuple[Fraction, ...] | None = None
    second_powers: tuple[Fraction, ...] | None = None

    @property
    def words(self) -> str:
        """Say it in one sentence."""
        if self.always:
            return f"whatever {_set(self.first)} does, {_set(self.second)} can do as well"
        if self.first_powers is not None and self.second_powers is not None:
            one, two = (_scaled(*item) for item in ((self.first, self.first_powers), (self.second, self.second_powers)))
            return f"{one} looks exactly like {two}, for any s > 0"
        match = self.matches[-1]
        one, two = (_times(*item) for item in ((self.first, match.first), (self.second, match.second)))
        return f"{one} looks exactly like {two}, and so for other sizes"


def twins(
    model: StepModel,
    pairs: Sequence[tuple[Sequence[str], Sequence[str]]] | None = None,
    sizes: Sequence[float] = SIZES,
) -> tuple[Twins, ...]:
    """Give the pairs of sets that can give exactly the same outputs, always or along a family of faults.

    Parameters
    ----------
    model : the plant
    pairs : sets to be compared; default all sets of one size of up to two suspects; families are followed where
        the two have no common member
    sizes : factors of the leading parameter at which a family is followed

    Raises
    ------
    ModelError, StructureError
        Where a name is unknown, or a plant has no finite solution.
    """
    graph = model.plant.graph
    pairs = pairs if pairs is not None else _all_pairs(graph)
    sides = [(places_of(graph, one), places_of(graph, other)) for one, other in pairs]
    bench = bench_of(model)
    run = sensitivities(bench.recursion, [bench.run])[0]
    if run is None:
        return ()
    reduced = reduce([run])
    tangents = [_tangent(reduced, *both) for both in sides]
    alike = [k for k, (one, other) in enumerate(sides) if len(tangents[k]) == len(one) == len(other)][:MOST_PAIRS]
    always = _always(model, [sides[k] for k in alike])
    imitated = {k for k, found in zip(alike, always, strict=True) if found}
    apart = [k for k, (one, other) in enumerate(sides) if len(tangents[k]) == 1 and not {*one} & {*other}][:MOST_PAIRS]
    families = _families(bench, [sides[k] for k in apart], [tangents[k][0] for k in apart], sizes)
    matches = dict(zip(apart, families, strict=True))
    return tuple(
        _twins(graph, sides[k], k in imitated, matches.get(k, ()), sizes)
        for k in range(len(sides))
        if k in imitated or matches.get(k)
    )


def _all_pairs(graph: BondGraph) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    names = [item.name for item in graph.parameters if item.suspect]
    sets = [chosen for size in (1, 2) for chosen in combinations(names, size)]
    return [(a, b) for a, b in combinations(sets, 2) if len(a) == len(b)]


def _tangent(reduced: Reduced, one: list[int], other: list[int]) -> FloatArray:
    """Give a basis, (n, |one| + |other|), of small faults of both sets whose outputs are the same.

    Empty where a set is not identifiable: then it is no twin, it explains itself in many ways.
    """
    nothing = np.zeros((0, len(one) + len(other)))
    if any(len(_silent(reduced, reduced.matrix[:, places])) for places in (one, other)):
        return nothing
    found = _silent(reduced, np.hstack([reduced.matrix[:, one], -reduced.matrix[:, other]]))
    return np.asarray(found / reduced.lengths[[*one, *other]]) if len(found) else nothing


def _silent(reduced: Reduced, columns: FloatArray) -> FloatArray:
    """Give a basis of the combinations of columns that do not show."""
    _, values, right = np.linalg.svd(columns)
    return np.asarray(right[int(np.sum(values > reduced.rank.low)) :])


def _always(model: StepModel, sides: Sequence[Sides]) -> list[bool]:
    """Give for each pair whether random faults of the first are imitated by the second, within its range."""
    if not sides:
        return []
    graph, rng = model.plant.graph, np.random.default_rng(0)
    plants = [changed(graph, one, rng.uniform(*DRAWN, len(one)).tolist()) for one, _ in sides for _ in range(DRAWS)]
    bench = bench_of(model, plants)
    data = bench.outputs(plants)
    lanes = [
        (row, sides[row // DRAWS][1], factors)
        for row in range(len(data))
        for factors in bench.starts(len(sides[row // DRAWS][1]))
    ]
    side = bench.side([changed(graph, places, f) for _, places, f in lanes], [places for _, places, _ in lanes])
    found = fit(bench.recursion, bench.run, side, np.array([data[row] for row, _, _ in lanes]))
    good = np.zeros(len(data), dtype=bool)
    for (row, _, _), theta, exact in zip(lanes, found.theta[0], found.exact, strict=True):
        good[row] |= exact and bench.inside(theta)
    return [bool(np.all(pair)) for pair in good.reshape(-1, DRAWS)]


def _families(
    bench: Bench, sides: Sequence[Sides], directions: Sequence[FloatArray], sizes: Sequence[float]
) -> list[tuple[Match, ...]]:
    """Follow each one-parameter family from the healthy plant: the leading parameter of the first set has the size."""
    first_thetas, second_thetas, free = [], [], []
    for (one, other), direction in zip(sides, directions, strict=True):
        moves = np.abs(direction[: len(one)])
        lead = int(np.argmax(moves > 0.99 * moves.max()))  # the first of those that move most
        powers = np.clip(direction / direction[lead], -_STEEPEST, _STEEPEST)
        for size in sizes:
            factors = (size**powers).tolist()
            first_thetas.append(changed(bench.graph, one, factors[: len(one)]))
            second_thetas.append(changed(bench.graph, other, factors[len(one) :]))
            free.append([place for place in one if place != one[lead]])
    if not free:
        return []
    first = bench.side(first_thetas, free)
    second = bench.side(second_thetas, [other for _, other in sides for _ in sizes])
    found = fit_together(bench.recursion, bench.run, first, second)
    lanes = list(zip(*found.theta, found.exact, strict=True))
    return [
        tuple(
            _match(bench, both, one, other)
            for one, other, exact in lanes[k * len(sizes) : (k + 1) * len(sizes)]
            if exact and bench.inside(one) and bench.inside(other)
        )
        for k, both in enumerate(sides)
    ]


def _match(bench: Bench, sides: Sides, first: FloatArray, second: FloatArray) -> Match:
    reference = np.array([item.scale for item in bench.graph.parameters])
    shift = np.array([1.0 if item.nominal == 0.0 else 0.0 for item in bench.graph.parameters])
    return Match(
        first=tuple(float(value) for value in (first / reference + shift)[sides[0]]),
        second=tuple(float(value) for value in (second / reference + shift)[sides[1]]),
    )


def _twins(graph: BondGraph, sides: Sides, always: bool, matches: tuple[Match, ...], sizes: Sequence[float]) -> Twins:
    one, other = sides
    names = [item.name for item in graph.parameters]
    plain = all(graph.parameters[place].nominal != 0.0 for place in (*one, *other))
    powers = _powers(matches, sizes) if plain and len(matches) == len(sizes) else None
    return Twins(
        first=tuple(names[place] for place in one),
        second=tuple(names[place] for place in other),
        always=always,
        matches=matches,
        first_powers=None if powers is None else powers[: len(one)],
        second_powers=None if powers is None else powers[len(one) :],
    )


def _powers(matches: tuple[Match, ...], sizes: Sequence[float]) -> tuple[Fraction, ...] | None:
    """Give the powers of the size, if they are the same simple fractions for every size."""
    factors = np.array([[*match.first, *match.second] for match in matches])
    found = np.log(factors) / np.log(np.asarray(sizes))[:, None]
    simple = [Fraction(float(value)).limit_denominator(4) for value in found[0]]
    away = np.abs(found - np.array([float(value) for value in simple]))
    return tuple(simple) if bool(np.all(away < _SIMPLE)) else None


def _set(names: Sequence[str]) -> str:
    return "{" + ", ".join(names) + "}"


def _scaled(names: Sequence[str], powers: Sequence[Fraction]) -> str:
    return _set([_term(name, power) for name, power in zip(names, powers, strict=True)])


def _term(name: str, power: Fraction) -> str:
    size = "s" if abs(power) == 1 else f"s^{abs(power)}" if abs(power).denominator == 1 else f"s^({abs(power)})"
    return name if power == 0 else f"{name} {size}" if power > 0 else f"{name}/{size}"


def _times(names: Sequence[str], factors: Sequence[float]) -> str:
    return _set([f"{name} x{factor:.3g}" for name, factor in zip(names, factors, strict=True)])
