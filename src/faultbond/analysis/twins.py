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
from faultbond.analysis.ranks import reduce
from faultbond.analysis.sensitivity import sensitivities
from faultbond.analysis.solutions import Bench, bench_of
from faultbond.dynamics.step import StepModel
from faultbond.model.graph import BondGraph
from faultbond.types import BoolArray, FloatArray

SIZES = (0.7, 1.3, 1.7)  # of the leading parameter of a family
DRAWS = 2  # random faults of one set to be imitated by another
_SIMPLE = 1e-5  # an exponent so near a simple fraction is that fraction
_FLAT = 1e-7  # singular value, relative, of a combination that does not show


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
    pairs : sets to be compared; default all sets of up to two suspects without a common member
    sizes : factors of the leading parameter at which a family is followed

    Raises
    ------
    ModelError, StructureError
        Where a name is unknown, or a plant has no finite solution.
    """
    bench = bench_of(model)
    pairs = pairs if pairs is not None else _all_pairs(bench.graph)
    sides = [(bench.places(one), bench.places(other)) for one, other in pairs]
    run = sensitivities(bench.recursion, [bench.run])[0]
    matrix = reduce([run]).matrix * reduce([run]).lengths if run is not None else np.zeros((0, 0))
    tangents = [_tangent(matrix, one, other) for one, other in sides]
    always = _always(bench, sides, tangents)
    families = _families(bench, sides, tangents, sizes)
    return tuple(
        _twins(bench.graph, *sides[k], bool(always[k]), families.get(k, ()), sizes)
        for k in range(len(sides))
        if always[k] or k in families
    )


def _all_pairs(graph: BondGraph) -> list[tuple[tuple[str, ...], tuple[str, ...]]]:
    names = [item.name for item in graph.parameters if item.suspect]
    sets = [chosen for size in (1, 2) for chosen in combinations(names, size)]
    return [(a, b) for a, b in combinations(sets, 2) if len(a) == len(b) and not set(a) & set(b)]


def _tangent(matrix: FloatArray, one: list[int], other: list[int]) -> FloatArray:
    """Give a basis, (n, |one| + |other|), of small faults of both sets whose outputs are the same."""
    columns = np.hstack([matrix[:, one], -matrix[:, other]])
    lengths = np.linalg.norm(columns, axis=0)
    lengths = np.where(lengths > 0, lengths, 1.0)
    _, values, right = np.linalg.svd(columns / lengths)
    rank = int(np.sum(values > _FLAT * max(values.max(initial=0.0), 1e-300)))
    return np.asarray(right[rank:] / lengths)


def _always(bench: Bench, sides: list[tuple[list[int], list[int]]], tangents: list[FloatArray]) -> BoolArray:
    """Give for each pair whether random faults of the first are imitated by the second, within its range."""
    rng = np.random.default_rng(0)
    result = np.zeros(len(sides), dtype=bool)
    chosen = [k for k, (one, other) in enumerate(sides) if len(tangents[k]) == len(one) == len(other)]
    if not chosen:
        return result
    wanted = [sides[k][0] for k in chosen for _ in range(DRAWS)]
    data = bench.outputs([bench.changed(places, rng.uniform(0.7, 1.5, len(places)).tolist()) for places in wanted])
    lanes = [
        (row, sides[chosen[row // DRAWS]][1], factors)
        for row in range(len(data))
        for factors in bench.starts(len(sides[chosen[row // DRAWS]][1]))
    ]
    side = bench.side([bench.changed(places, f) for _, places, f in lanes], [places for _, places, _ in lanes])
    found = fit(bench.recursion, bench.run, side, np.array([data[row] for row, _, _ in lanes]))
    good = np.zeros(len(data), dtype=bool)
    for (row, _, _), theta, exact in zip(lanes, found.theta[0], found.exact, strict=True):
        good[row] |= exact and bench.inside(theta)
    result[chosen] = good.reshape(-1, DRAWS).all(axis=1)
    return result


def _families(
    bench: Bench,
    sides: list[tuple[list[int], list[int]]],
    tangents: list[FloatArray],
    sizes: Sequence[float],
) -> dict[int, tuple[Match, ...]]:
    """Follow each one-parameter family from the healthy plant: the leading parameter of the first set has the size."""
    lanes: list[tuple[int, int, FloatArray, FloatArray]] = []
    for k, (one, other) in enumerate(sides):
        if len(tangents[k]) != 1:
            continue
        direction = tangents[k][0]
        if not np.abs(direction[: len(one)]).max(initial=0.0) > 0.0:
            continue
        lead = int(np.argmax(np.abs(direction[: len(one)])))
        powers = direction / direction[lead]
        for size in sizes:
            factors = (size ** np.clip(powers, -4.0, 4.0)).tolist()
            first_start = bench.changed(one, factors[: len(one)])
            lanes.append((k, one[lead], first_start, bench.changed(other, factors[len(one) :])))
    if not lanes:
        return {}
    first = bench.side([item[2] for item in lanes], [[p for p in sides[k][0] if p != lead] for k, lead, _, _ in lanes])
    second = bench.side([item[3] for item in lanes], [sides[k][1] for k, _, _, _ in lanes])
    found = fit_together(bench.recursion, bench.run, first, second)
    families: dict[int, list[Match]] = {}
    for (k, _, _, _), one_theta, other_theta, exact in zip(lanes, *found.theta, found.exact, strict=True):
        if exact and bench.inside(one_theta) and bench.inside(other_theta):
            families.setdefault(k, []).append(_match(bench, sides[k], one_theta, other_theta))
    return {k: tuple(matches) for k, matches in families.items()}


def _match(bench: Bench, sides: tuple[list[int], list[int]], first: FloatArray, second: FloatArray) -> Match:
    reference = np.array([item.scale for item in bench.graph.parameters])
    shift = np.array([1.0 if item.nominal == 0.0 else 0.0 for item in bench.graph.parameters])
    return Match(
        first=tuple(float(value) for value in (first / reference + shift)[sides[0]]),
        second=tuple(float(value) for value in (second / reference + shift)[sides[1]]),
    )


def _twins(
    graph: BondGraph, one: list[int], other: list[int], always: bool, matches: tuple[Match, ...], sizes: Sequence[float]
) -> Twins:
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
