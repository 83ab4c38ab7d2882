"""All values of a set of suspects that give the same outputs: the other roots, and whether there are any at all.

A rank is local: the motor's {R, C} is identifiable near every value, and yet has a second solution far away. Here
noise-free outputs of a random run are fitted from a fixed set of starts, within the parameters' ranges, and what is
found is tried again along a longer run. The fits follow every root that the starts lead to; one far outside their reach
can be missed.

Source: thesis 6.1.2, which takes two roots on four samples for two explanations; a longer record discards all but the
swap of the two time constants.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import product
from time import thread_time

import numpy as np

from faultbond.analysis.comparison import (
    NO_TIME,
    Allowance,
    Bench,
    bench_for,
    changed,
    long_benches,
    places_of,
    short_benches,
)
from faultbond.analysis.levenberg_marquardt import fit_lanes
from faultbond.analysis.trajectories import lanes_of
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel

FACTOR = 1.3
SECONDS = 2.0  # of processor time, for all sets together
STARTS = {1: (0.1, 0.3, 0.8, 2.0, 6.0), 2: (0.15, 0.5, 1.3, 4.5)}  # factors of nominal, by size of the set
FEW_STARTS = (0.4, 1.6)  # for larger sets
MOST_STARTS = 64  # per set
NO_RUN = "no finite solution with these values"
_FIRST_LANES = 8  # of the first batch, until the speed is known
_SAME = 1e-4  # solutions nearer than this, relative, are one
_MANY = 3  # more solutions than this, and than this part of the starts, are a continuum


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSolutions:
    """All values of a set of suspects that give the outputs of one of them, SI, in the order of `parameters`.

    others : without `true`; empty where it is unique
    continuum : whether there are infinitely many: the set is not identifiable
    skipped : why the set was not looked at; empty if it was
    """

    parameters: tuple[str, ...]
    true: tuple[float, ...]
    others: tuple[tuple[float, ...], ...] = ()
    continuum: bool = False
    skipped: str = ""

    @property
    def unique(self) -> bool:
        """Whether the set was looked at and the outputs leave one set of values."""
        return self.roots == 1

    @property
    def roots(self) -> int | None:
        """How many values give the same outputs; None: infinitely many, or not looked at."""
        return None if self.continuum or self.skipped else 1 + len(self.others)


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How many of some random behaviours a set can explain with values in range: a lower bound."""

    parameters: tuple[str, ...]
    reached: int
    tried: int


Factors = tuple[float, ...]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Set:
    """A set of suspects: its number in the question, its positions, and all parameters of the plant that has them."""

    number: int
    places: tuple[int, ...]
    true: FloatArray

    @property
    def starts(self) -> tuple[list[Factors], list[Factors]]:
        """Give the factors at which fits begin: those that are always tried, and those for sets in doubt."""
        values, size = STARTS.get(len(self.places), FEW_STARTS), len(self.places)
        every = list(product(values, repeat=size))[:MOST_STARTS]
        ends = {values[0], values[-1]}
        return [item for item in every if ends >= {*item}], [item for item in every if not ends >= {*item}]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Root:
    """All parameters, and the start, with which a plant gives the outputs of a set."""

    owner: _Set
    theta: FloatArray
    start: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Found:
    """What fits of some sets came to: other roots, the sets (by number) in doubt, and those without time to the end."""

    roots: list[_Root]
    doubt: set[int]
    cut: set[int]


def other_solutions(
    model: StepModel, hypotheses: Sequence[Sequence[str]], factor: float = FACTOR, *, seconds: float | None = SECONDS
) -> tuple[OtherSolutions, ...]:
    """Give the values of each set that give the same outputs as the set with its nominals times `factor`.

    Small sets come first. What there is no time for, and what has no finite solution, is returned as skipped.

    Parameters
    ----------
    model : the plant
    hypotheses : sets of parameter names
    factor : of all parameters of the set
    seconds : processor time after which no further set is begun; None: no limit

    Raises
    ------
    ModelError
        Where a name is unknown.
    StructureError
        Where the nominal plant has no finite solution along any run.
    """
    graph = model.plant.graph
    places = [tuple(places_of(graph, names)) for names in hypotheses]
    sets = [
        _Set(number=k, places=chosen, true=changed(graph, chosen, [factor] * len(chosen)))
        for k, chosen in enumerate(places)
    ]
    search = _Search(model, Allowance(seconds=seconds))
    if sets:
        search.look(sorted(sets, key=lambda item: len(item.places)))
    return tuple(search.solutions(item, tuple(names)) for item, names in zip(sets, hypotheses, strict=True))


class _Search:
    """Sets looked at some at a time, until the time is over."""

    def __init__(self, model: StepModel, clock: Allowance) -> None:
        self.clock = clock
        self.short = _Kept(short_benches(model))
        self.long = _Kept(long_benches(model))
        self.roots: dict[int, list[FloatArray]] = {}
        self.tried: dict[int, int] = {}
        self.skipped: dict[int, str] = {}

    def look(self, sets: list[_Set]) -> None:
        """Look at sets in the order given, some at a time, as many as the pace so far allows."""
        lanes, left = _FIRST_LANES, sets
        while left:
            n_starts = len(left[0].starts[0])
            count = sum(len(item.places) == len(left[0].places) for item in left[: max(1, lanes // n_starts)])
            begun = thread_time()
            self._batch(left[:count])
            pace = max(thread_time() - begun, 1e-3) / (count * n_starts)
            lanes, left = int(min(1e4, max(self.clock.left, 0.0) / (2.0 * pace))), left[count:]

    def solutions(self, item: _Set, names: tuple[str, ...]) -> OtherSolutions:
        """Say what was found of a set."""
        places = list(item.places)
        kept = self.roots.get(item.number, [])
        continuum = len(kept) > max(_MANY, self.tried.get(item.number, 0) // _MANY)
        return OtherSolutions(
            parameters=names,
            true=tuple(float(value) for value in item.true[places]),
            others=() if continuum else tuple(tuple(float(value) for value in theta[places]) for theta in kept),
            continuum=continuum,
            skipped=self.skipped.get(item.number, ""),
        )

    def _batch(self, sets: list[_Set]) -> None:
        left = sets
        for bench in self.short:
            if not left or self.clock.over():
                break
            outputs, good = bench.outputs([item.true for item in left], self.clock)
            here = [(item, y) for item, y, able in zip(left, outputs, good, strict=True) if able]
            if here:
                self._answer(bench, here)
            left = [item for item, able in zip(left, good, strict=True) if not able]
        for item in left:
            self.skipped[item.number] = NO_TIME if self.clock.over() else NO_RUN

    def _answer(self, bench: Bench, asked: list[tuple[_Set, FloatArray]]) -> None:
        """Find the roots of sets with their data: from few starts, from more where there is doubt, on a longer run."""
        found = self._fitted(bench, [(item, data, factors) for item, data in asked for factors in item.starts[0]])
        more = [(item, data) for item, data in asked if item.number in found.doubt and item.number not in found.cut]
        second = self._fitted(bench, [(item, data, factors) for item, data in more for factors in item.starts[1]])
        roots = [*found.roots, *second.roots]
        for item, _ in asked:
            if item.number in found.cut | second.cut:
                self.skipped[item.number] = NO_TIME
                continue
            mine = self._apart(bench, item, [root for root in roots if root.owner is item])
            if 0 < len(mine) <= max(_MANY, self.tried[item.number] // _MANY):
                mine = self._apart(bench, item, self._confirmed(item, mine))
            self.roots[item.number] = [root.theta for root in mine]

    def _fitted(self, bench: Bench, tasks: list[tuple[_Set, FloatArray, Factors]]) -> _Found:
        found = _Found(roots=[], doubt=set(), cut=set())
        step = bench.course.most_lanes
        for first in range(0, len(tasks), step):
            part = tasks[first : first + step]
            owners = [item for item, _, _ in part]
            thetas = [changed(bench.graph, item.places, factors) for item, _, factors in part]
            result = fit_lanes(
                bench.course,
                lanes_of(thetas, bench.course.run.start, [item.places for item in owners]),
                bench.nominal,
                np.array([data for _, data, _ in part]),
                known=np.array([item.true for item in owners]),
                stop=self.clock.over,
            )
            for lane, item in enumerate(owners):
                self.tried[item.number] = self.tried.get(item.number, 0) + 1
                if not result.done[lane]:
                    found.cut.add(item.number)
                if result.home[lane]:
                    continue
                found.doubt.add(item.number)
                if result.exact[lane]:
                    found.roots.append(_Root(owner=item, theta=result.theta[0][lane], start=result.start[lane]))
        return found

    def _apart(self, bench: Bench, item: _Set, roots: list[_Root]) -> list[_Root]:
        """Give the roots in range that differ from the true values and from each other, the nearest first."""
        kept: list[_Root] = []
        for root in sorted(roots, key=lambda root: bench.distance(root.theta, item.true)):
            known = [item.true, *(other.theta for other in kept)]
            if bench.inside(root.theta) and all(bench.distance(root.theta, other) > _SAME for other in known):
                kept.append(root)
        return kept

    def _confirmed(self, item: _Set, roots: list[_Root]) -> list[_Root]:
        """Give the roots that a longer run leaves, as it gives them; all where there is none that the plant can do."""
        for bench in self.long:
            outputs, good = bench.outputs([item.true], Allowance(seconds=None))
            if not good[0]:
                continue
            lanes = lanes_of([root.theta for root in roots], bench.course.run.start, [item.places] * len(roots))
            for lane, root in enumerate(roots):
                lanes.start[lane] = root.start
            data = np.repeat(outputs, len(roots), axis=0)
            result = fit_lanes(bench.course, lanes, bench.nominal, data, stop=self.clock.long_over)
            return [
                _Root(owner=item, theta=result.theta[0][lane], start=result.start[lane])
                for lane in np.flatnonzero(result.exact)
            ]
        return roots


class _Kept:
    """Benches made when they are first asked for."""

    def __init__(self, source: Iterator[Bench]) -> None:
        self.source, self.made = source, list[Bench]()

    def __iter__(self) -> Iterator[Bench]:
        """Give those that there are, then new ones."""
        yield from self.made
        for bench in self.source:
            self.made.append(bench)
            yield bench


def reachable(
    model: StepModel,
    hypotheses: Sequence[Sequence[str]],
    *,
    behaviours: int = 25,
    low: float = 0.5,
    high: float = 2.0,
    seed: int = 0,
) -> tuple[Reach, ...]:
    """Count for how many random plants each set has values in range that give the same outputs.

    Sets of as many suspects as the plant has independent effects always explain anything near the nominal, yet not
    with values that can be: a set can thus be ruled out by its range where no residual can.

    Parameters
    ----------
    model : the plant
    hypotheses : sets of parameter names
    behaviours : plants whose suspects are all drawn anew
    low, high : factors between which each is drawn, uniform in the logarithm
    seed : of the draws

    Raises
    ------
    ModelError, StructureError
        Where a name is unknown, or there is no run along which all plants have a finite solution.
    """
    graph, rng = model.plant.graph, np.random.default_rng(seed)
    everything = [k for k, item in enumerate(graph.parameters) if item.suspect]
    drawn = np.exp(rng.uniform(np.log(low), np.log(high), (behaviours, len(everything))))
    plants = [changed(graph, everything, row.tolist()) for row in drawn]
    bench, data = bench_for(model, plants)
    results = []
    for names in hypotheses:
        places = tuple(places_of(graph, names))
        starts = product(STARTS.get(len(places), FEW_STARTS), repeat=len(places))
        lanes = [(row, factors) for factors in list(starts)[:MOST_STARTS] for row in range(behaviours)]
        thetas = [changed(graph, places, factors) for _, factors in lanes]
        begin = lanes_of(thetas, bench.course.run.start, [places] * len(lanes))
        found = fit_lanes(bench.course, begin, bench.nominal, data[[row for row, _ in lanes]])
        pairs = zip(lanes, found.theta[0], found.exact, strict=True)
        reached = {row for (row, _), theta, exact in pairs if exact and bench.inside(theta)}
        results.append(Reach(parameters=tuple(names), reached=len(reached), tried=behaviours))
    return tuple(results)
