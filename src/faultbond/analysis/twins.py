"""Twins: different sets of suspects whose faults give exactly the same outputs, always or in certain proportions.

A winding and a bearing of the motor that change in one proportion look exactly like a coil and a rotor that change in
another. Sets whose ranks allow it are compared on noise-free outputs of a long run: small faults of both that cancel
give the direction, fits of both at once follow it to large ones. Only what passes through the healthy plant is found.

Source: thesis 6.1.2 and 6.5 speak of the motor's equivalent sets; the search is ours.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from fractions import Fraction
from itertools import combinations, product
from math import comb
from typing import TypeVar

import numpy as np

from faultbond.analysis.comparison import Allowance, Bench, changed, places_of, short_benches
from faultbond.analysis.levenberg_marquardt import fit_together
from faultbond.analysis.other_roots import FEW_STARTS, STARTS
from faultbond.analysis.ranks import ReducedSensitivities, reduce
from faultbond.analysis.testable import generic_run
from faultbond.analysis.trajectories import lanes_of
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.model.graph import BondGraph

SIZES = (0.7, 1.3, 1.7)  # of the leading parameter of a family
DRAWS = 2  # random faults of one set to be imitated by another
DRAWN = (0.7, 1.5)  # range of their factors
SECONDS = 1.0  # of processor time, for all pairs together
_PART = 25  # pairs at a time
_STEEPEST = 4.0  # largest power at which a family is looked for
_PARALLEL = 0.999  # cosine; two effects that are one have a larger one
_SIMPLE = 1e-5  # an exponent so near a simple fraction is that fraction

PairPlaces = tuple[list[int], list[int]]
_T = TypeVar("_T")


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
            both = ((self.first, self.first_powers), (self.second, self.second_powers))
            one, two = (_set([_term(*item) for item in zip(*side, strict=True)]) for side in both)
            return f"{one} looks exactly like {two}, for any s > 0"
        match = self.matches[-1]
        one, two = (
            _set([f"{name} x{factor:.3g}" for name, factor in zip(*side, strict=True)])
            for side in ((self.first, match.first), (self.second, match.second))
        )
        return f"{one} looks exactly like {two}, and so for other sizes"


@dataclass(frozen=True, slots=True, kw_only=True)
class Comparison:
    """The twins among pairs of sets; how many pairs were compared, and how many not, for want of time or of a run."""

    found: tuple[Twins, ...]
    compared: int
    left_out: int


def twins(
    model: StepModel,
    pairs: Sequence[tuple[Sequence[str], Sequence[str]]] | None = None,
    sizes: Sequence[float] = SIZES,
) -> tuple[Twins, ...]:
    """Give the pairs of sets that can give exactly the same outputs; see `compare`, without a limit in time."""
    return compare(model, pairs, sizes, seconds=None).found


def compare(
    model: StepModel,
    pairs: Sequence[tuple[Sequence[str], Sequence[str]]] | None = None,
    sizes: Sequence[float] = SIZES,
    *,
    largest: int = 2,
    seconds: float | None = SECONDS,
) -> Comparison:
    """Give the pairs of sets that can give exactly the same outputs, always or along a family of faults.

    Parameters
    ----------
    model : the plant
    pairs : sets to be compared; default all sets of one size of up to `largest` suspects; families are followed where
        the two have no common member
    sizes : factors of the leading parameter at which a family is followed
    largest : 1 or 2; with 1 the pairs of sets of two count as left out
    seconds : processor time after which no further pairs are compared; None: no limit

    Raises
    ------
    ModelError
        Where a name is unknown.
    StructureError
        Where the nominal plant has no finite solution along any run.
    """
    graph, clock = model.plant.graph, Allowance(seconds=seconds)
    every = comb(comb(sum(item.suspect for item in graph.parameters), 2), 2)
    unformed = every if pairs is None and largest < 2 else 0
    if pairs is None:
        names = [item.name for item in graph.parameters if item.suspect]
        pairs = [pair for k in range(1, largest + 1) for pair in combinations(combinations(names, k), 2)]
    sides = [(places_of(graph, one), places_of(graph, other)) for one, other in pairs]
    reduced = reduce([generic_run(model)])
    tangents = _tangents(reduced, sides)
    alike = [k for k, (one, other) in enumerate(sides) if len(tangents[k]) == len(one) == len(other)]
    apart = [k for k, (one, other) in enumerate(sides) if len(tangents[k]) == 1 and not {*one} & {*other}]
    if not alike and not apart:
        return Comparison(found=(), compared=len(pairs), left_out=unformed)
    bench = next(short_benches(model))
    always = _in_parts(alike, clock, lambda part: _always(bench, [sides[k] for k in part], clock))
    families = _in_parts(
        apart,
        clock,
        lambda part: _families(bench, [sides[k] for k in part], [tangents[k][0] for k in part], sizes, clock),
    )
    unknown = {*(k for k in alike if always[k] is None), *(k for k in apart if families[k] is None)}
    return Comparison(
        found=tuple(
            _twins(graph, sides[k], bool(always.get(k)), families.get(k) or (), sizes)
            for k in range(len(sides))
            if always.get(k) or families.get(k)
        ),
        compared=len(pairs) - len(unknown),
        left_out=len(unknown) + unformed,
    )


def _in_parts(
    chosen: Sequence[int], clock: Allowance, work: Callable[[Sequence[int]], Sequence[_T | None]]
) -> dict[int, _T | None]:
    """Do the work for some at a time; None for what there is no time for."""
    found: dict[int, _T | None] = dict.fromkeys(chosen)
    for first in range(0, len(chosen), _PART):
        part = chosen[first : first + _PART]
        if clock.over():
            break
        results = work(part)
        if not clock.over():  # else they were cut short
            found |= dict(zip(part, results, strict=True))
    return found


def _tangents(reduced: ReducedSensitivities, sides: Sequence[PairPlaces]) -> list[FloatArray]:
    """Give for each pair a basis, (n, |one| + |other|), of small faults of both sets whose outputs are the same.

    Empty where a set is not identifiable: then it is no twin, it explains itself in many ways. Two single suspects have
    one only if their effects are nearly parallel.
    """
    lengths = np.linalg.norm(reduced.matrix, axis=0)
    unit = reduced.matrix / np.where(lengths > 0.0, lengths, 1.0)
    parallel = np.abs(unit.T @ unit) > _PARALLEL
    tangents = []
    for one, other in sides:
        tangent = np.zeros((0, len(one) + len(other)))
        skew = len(one) == len(other) == 1 and not parallel[one[0], other[0]]
        if not skew and not any(len(_silent(reduced, reduced.matrix[:, places])) for places in (one, other)):
            found = _silent(reduced, np.hstack([reduced.matrix[:, one], -reduced.matrix[:, other]]))
            tangent = found / reduced.lengths[[*one, *other]] if len(found) else tangent
        tangents.append(tangent)
    return tangents


def _silent(reduced: ReducedSensitivities, columns: FloatArray) -> FloatArray:
    """Give a basis of the combinations of columns that do not show."""
    _, values, right = np.linalg.svd(columns)
    return np.asarray(right[int(np.sum(values > reduced.rank.low)) :])


def _always(bench: Bench, sides: Sequence[PairPlaces], clock: Allowance) -> list[bool | None]:
    """Give for each pair whether random faults of the first are imitated by the second, within its range.

    None where they have no finite solution.
    """
    graph, rng = bench.graph, np.random.default_rng(0)
    plants = [changed(graph, one, rng.uniform(*DRAWN, len(one)).tolist()) for one, _ in sides for _ in range(DRAWS)]
    outputs, able = bench.outputs(plants, clock)
    rows, places, factors = list[int](), list[list[int]](), list[tuple[float, ...]]()
    for row in np.flatnonzero(able).tolist():
        other = sides[row // DRAWS][1]
        for begin in product(STARTS.get(len(other), FEW_STARTS), repeat=len(other)):
            rows.append(row)
            places.append(other)
            factors.append(begin)
    good = np.zeros(len(plants), dtype=bool)
    fits = bench.fits(places, factors, [outputs[row] for row in rows], stop=clock.over)
    for row, found in zip(rows, fits, strict=True):
        good[row] |= found.exact and bench.inside(found.theta)
    pairs = zip(good.reshape(-1, DRAWS), able.reshape(-1, DRAWS), strict=True)
    return [bool(found.all()) if known.all() else None for found, known in pairs]


def _families(
    bench: Bench,
    sides: Sequence[PairPlaces],
    directions: Sequence[FloatArray],
    sizes: Sequence[float],
    clock: Allowance,
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
    start = bench.course.run.start
    first = lanes_of(first_thetas, start, free)
    second = lanes_of(second_thetas, start, [other for _, other in sides for _ in sizes])
    found = fit_together(bench.course, first, second, bench.nominal, stop=clock.over)
    lanes = list(zip(*found.theta, found.exact, strict=True))
    scale = np.array([item.scale for item in bench.graph.parameters])
    shift = np.array([1.0 if item.nominal == 0.0 else 0.0 for item in bench.graph.parameters])
    return [
        tuple(
            Match(
                first=tuple((one / scale + shift)[both[0]].tolist()),
                second=tuple((other / scale + shift)[both[1]].tolist()),
            )
            for one, other, exact in lanes[k * len(sizes) : (k + 1) * len(sizes)]
            if exact and bench.inside(one) and bench.inside(other)
        )
        for k, both in enumerate(sides)
    ]


def _twins(
    graph: BondGraph, sides: PairPlaces, always: bool, matches: tuple[Match, ...], sizes: Sequence[float]
) -> Twins:
    """Say what was found of a pair, with powers of the size if they are the same simple fractions for every size."""
    one, other = sides
    names, powers = [item.name for item in graph.parameters], None
    plain = all(graph.parameters[place].nominal != 0.0 for place in (*one, *other))
    if plain and len(matches) == len(sizes):
        factors = np.array([[*match.first, *match.second] for match in matches])
        found = np.log(factors) / np.log(np.asarray(sizes))[:, None]
        simple = tuple(Fraction(float(value)).limit_denominator(4) for value in found[0])
        away = np.abs(found - np.array([float(value) for value in simple]))
        powers = simple if np.all(away < _SIMPLE) else None
    return Twins(
        first=tuple(names[place] for place in one),
        second=tuple(names[place] for place in other),
        always=always,
        matches=matches,
        first_powers=None if powers is None else powers[: len(one)],
        second_powers=None if powers is None else powers[len(one) :],
    )


def _set(names: Sequence[str]) -> str:
    return "{" + ", ".join(names) + "}"


def _term(name: str, power: Fraction) -> str:
    size = "s" if abs(power) == 1 else f"s^{abs(power)}" if abs(power).denominator == 1 else f"s^({abs(power)})"
    return name if power == 0 else f"{name} {size}" if power > 0 else f"{name}/{size}"
