"""All values of a set of suspects that give the same outputs: the other roots, and whether there are any at all.

A rank is local: the motor's {R, C} is identifiable near every value, and yet has a second solution far away. Here
noise-free outputs of a random run are fitted from a fixed set of starts, within the parameters' ranges, and what is
found is tried again along a longer run. The fits follow every root that the starts lead to; one far outside their reach
can be missed.

Source: thesis 6.1.2, which takes two roots on four samples for two explanations; a longer record discards all but the
swap of the two time constants.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import product
from time import thread_time

import numpy as np

from faultbond.analysis.comparison import (
    NO_TIME,
    Allowance,
    Bench,
    FittedLane,
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

    def size(self) -> int:
        """How many parameters it has."""
        return len(self.places)

    def solutions(
        self, others: Sequence[FloatArray] = (), *, continuum: bool = False, skipped: str = ""
    ) -> OtherSolutions:
        """Give what was found of it, still without names; `others` are all parameters of each."""
        true, *rest = (tuple(theta[list(self.places)].tolist()) for theta in (self.true, *others))
        found = () if continuum else tuple(rest)
        return OtherSolutions(parameters=(), true=true, others=found, continuum=continuum, skipped=skipped)


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
    graph, found = model.plant.graph, dict[int, OtherSolutions]()
    places = [tuple(places_of(graph, names)) for names in hypotheses]
    sets = [
        _Set(number=k, places=chosen, true=changed(graph, chosen, [factor] * len(chosen)))
        for k, chosen in enumerate(places)
    ]
    search, lanes, left = _Search(model, Allowance(seconds=seconds)), _FIRST_LANES, sorted(sets, key=_Set.size)
    while left:  # some at a time, as many as the pace so far allows
        n_starts = len(left[0].starts[0])
        count = sum(item.size() == left[0].size() for item in left[: max(1, lanes // n_starts)])
        begun = thread_time()
        found |= search.look(left[:count])
        pace = max(thread_time() - begun, 1e-3) / (count * n_starts)
        lanes, left = int(min(1e4, max(search.clock.left, 0.0) / (2.0 * pace))), left[count:]
    return tuple(replace(found[k], parameters=tuple(names)) for k, names in enumerate(hypotheses))


class _Search:
    """Sets looked at some at a time, until the time is over."""

    def __init__(self, model: StepModel, clock: Allowance) -> None:
        self.clock, self.short, self.long = clock, _Kept(short_benches(model)), _Kept(long_benches(model))

    def look(self, sets: list[_Set]) -> dict[int, OtherSolutions]:
        """Look at some sets, each on the first bench along which its plant has outputs; by their numbers."""
        found: dict[int, OtherSolutions] = {}
        for bench in self.short:
            if not sets or self.clock.over():
                break
            outputs, good = bench.outputs([item.true for item in sets], self.clock)
            here = [(item, y) for item, y, able in zip(sets, outputs, good, strict=True) if able]
            if here:
                found |= self._answers(bench, here)
            sets = [item for item, able in zip(sets, good, strict=True) if not able]
        reason = NO_TIME if self.clock.over() else NO_RUN
        return found | {item.number: item.solutions(skipped=reason) for item in sets}

    def _answers(self, bench: Bench, asked: list[tuple[_Set, FloatArray]]) -> dict[int, OtherSolutions]:
        """Find the roots of sets with their data: from few starts, from more where there is doubt, on a longer run."""
        roots: dict[int, list[FittedLane]] = {item.number: [] for item, _ in asked}
        tried, cut = dict.fromkeys(roots, 0), set[int]()
        doubt = set(roots)
        for further in (0, 1):
            some = [(item, data) for item, data in asked if item.number in doubt - cut]
            owners = [item for item, _ in some for _ in item.starts[further]]
            data = [data for item, data in some for _ in item.starts[further]]
            factors = [begin for item, _ in some for begin in item.starts[further]]
            doubt = set()
            known = [item.true for item in owners]
            fits = bench.fits([item.places for item in owners], factors, data, known, stop=self.clock.over)
            for item, fit in zip(owners, fits, strict=True):
                tried[item.number] += 1
                if not fit.done:
                    cut.add(item.number)
                if not fit.home:
                    doubt.add(item.number)
                    roots[item.number] += [fit] if fit.exact else []
        found = {}
        for item, _ in asked:
            if item.number in cut:
                found[item.number] = item.solutions(skipped=NO_TIME)
                continue
            most = max(_MANY, tried[item.number] // _MANY)
            mine = self._apart(bench, item, roots[item.number])
            if 0 < len(mine) <= most:
                mine = self._apart(bench, item, self._confirmed(item, mine))
            found[item.number] = item.solutions([root.theta for root in mine], continuum=len(mine) > most)
        return found

    def _apart(self, bench: Bench, item: _Set, roots: list[FittedLane]) -> list[FittedLane]:
        """Give the roots in range that differ from the true values and from each other, the nearest first."""
        kept: list[FittedLane] = []
        for root in sorted(roots, key=lambda root: bench.distance(root.theta, item.true)):
            known = [item.true, *(other.theta for other in kept)]
            if bench.inside(root.theta) and all(bench.distance(root.theta, other) > _SAME for other in known):
                kept.append(root)
        return kept

    def _confirmed(self, item: _Set, roots: list[FittedLane]) -> list[FittedLane]:
        """Give the roots that a longer run leaves, as it gives them; all where there is none that the plant can do."""
        for bench in self.long:
            outputs, good = bench.outputs([item.true], Allowance(seconds=None))
            if not good[0]:
                continue
            lanes = lanes_of([root.theta for root in roots], bench.course.run.start, [item.places] * len(roots))
            lanes.start[:] = [root.start for root in roots]
            data = np.repeat(outputs, len(roots), axis=0)
            result = fit_lanes(bench.course, lanes, bench.nominal, data, stop=self.clock.long_over)
            return [
                replace(roots[lane], theta=result.theta[0][lane], start=result.start[lane])
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
        starts = list(product(STARTS.get(len(places), FEW_STARTS), repeat=len(places)))[:MOST_STARTS]
        tasks = list(product(starts, range(behaviours)))
        fits = bench.fits([places] * len(tasks), [item for item, _ in tasks], [data[row] for _, row in tasks])
        pairs = zip(tasks, fits, strict=True)
        reached = {row for (_, row), found in pairs if found.exact and bench.inside(found.theta)}
        results.append(Reach(parameters=tuple(names), reached=len(reached), tried=behaviours))
    return tuple(results)
