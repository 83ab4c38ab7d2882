"""All values of a set of suspects that give the same outputs: the other roots, and whether there are any at all.

A rank is local: the motor's {R, C} is identifiable near every value, and yet has a second solution far away. Here
noise-free outputs of a long run are fitted from a fixed set of starts, within the parameters' ranges. The fits follow
every root that the starts lead to; one far outside their reach can be missed.

Source: thesis 6.1.2, which takes two roots on four samples for two explanations; a longer record discards all but the
swap of the two time constants.
"""

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from faultbond.analysis.fitting import Fit, Side, fit, long_run
from faultbond.analysis.sensitivity import Experiment, Recursion, build_recursion, sensitivities
from faultbond.dynamics.step import StepModel
from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph
from faultbond.types import BoolArray, FloatArray

FACTOR = 1.3
STARTS = {1: (0.1, 0.3, 0.8, 2.0, 6.0), 2: (0.15, 0.5, 1.3, 4.5)}  # factors of nominal, by size of the set
FEW_STARTS = (0.4, 1.6)  # for larger sets
MOST_STARTS = 64  # per set
_SAME = 1e-4  # solutions nearer than this, relative, are one
_MANY = 3  # more solutions than this, and than this part of the starts, are a continuum


@dataclass(frozen=True, slots=True, kw_only=True)
class OtherSolutions:
    """All values of a set of suspects that give the outputs of one of them, SI, in the order of `parameters`.

    others : without `true`; empty where it is unique
    continuum : whether there are infinitely many: the set is not identifiable
    """

    parameters: tuple[str, ...]
    true: tuple[float, ...]
    others: tuple[tuple[float, ...], ...]
    continuum: bool

    @property
    def unique(self) -> bool:
        """Whether the outputs leave one set of values."""
        return not self.others and not self.continuum


@dataclass(frozen=True, slots=True, kw_only=True)
class Reach:
    """How many of some random behaviours a set can explain with values in range: a lower bound."""

    parameters: tuple[str, ...]
    reached: int
    tried: int


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Bench:
    """A plant with the run along which its outputs are compared."""

    graph: BondGraph
    recursion: Recursion
    run: Experiment

    def side(self, thetas: Sequence[FloatArray], free: Sequence[Sequence[int]]) -> Side:
        """Give lanes that begin at these values."""
        mask = np.zeros((len(thetas), len(self.graph.parameters)), dtype=bool)
        for row, places in enumerate(free):
            mask[row, list(places)] = True
        return Side(theta=np.array(thetas), free=mask, start=np.tile(self.run.start, (len(thetas), 1)))

    def inside(self, theta: FloatArray) -> bool:
        """Whether all parameters are in their ranges."""
        return all(item.lower <= value <= item.upper for item, value in zip(self.graph.parameters, theta, strict=True))

    def outputs(self, thetas: Sequence[FloatArray]) -> list[FloatArray]:
        """Give the outputs (n_samples, n_outputs) of plants for which the run was chosen."""
        found = sensitivities(self.recursion, [replace(self.run, theta=theta) for theta in thetas])
        return [item.y for item in found if item is not None]

    def starts(self, size: int) -> list[tuple[float, ...]]:
        """Give the factors at which the fits of a set begin."""
        return list(product(STARTS.get(size, FEW_STARTS), repeat=size))[:MOST_STARTS]


def bench_of(model: StepModel, thetas: Sequence[FloatArray] = ()) -> Bench:
    """Give the plant with a long run along which it has a solution with these parameters too."""
    recursion = build_recursion(model.plant)
    return Bench(graph=model.plant.graph, recursion=recursion, run=long_run(model, recursion, thetas))


def places_of(graph: BondGraph, names: Sequence[str]) -> list[int]:
    """Give the positions of parameters.

    Raises
    ------
    ModelError
        Where one is unknown.
    """
    known = [item.name for item in graph.parameters]
    for name in names:
        if name not in known:
            raise ModelError(f"{graph.file}: no parameter {name}; there are {', '.join(known)}")
    return [known.index(name) for name in names]


def changed(graph: BondGraph, places: Sequence[int], factors: Sequence[float]) -> FloatArray:
    """Give all parameters with some of them changed; where the nominal is 0 by factor - 1 of the scale."""
    theta = np.array([item.nominal for item in graph.parameters])
    for place, factor in zip(places, factors, strict=True):
        item = graph.parameters[place]
        theta[place] = item.nominal * factor if item.nominal != 0.0 else item.scale * (factor - 1.0)
    return theta


def other_solutions(
    model: StepModel, hypotheses: Sequence[Sequence[str]], factor: float = FACTOR
) -> tuple[OtherSolutions, ...]:
    """Give the values of each set that give the same outputs as the set with its nominals times `factor`.

    Parameters
    ----------
    model : the plant
    hypotheses : sets of parameter names
    factor : of all parameters of the set

    Raises
    ------
    ModelError, StructureError
        Where a name is unknown, or a plant has no finite solution.
    """
    graph = model.plant.graph
    places = [places_of(graph, names) for names in hypotheses]
    if not places:
        return ()
    true = [changed(graph, chosen, [factor] * len(chosen)) for chosen in places]
    bench = bench_of(model, true)
    data = bench.outputs(true)
    lanes = [
        (number, changed(graph, chosen, factors))
        for number, chosen in enumerate(places)
        for factors in bench.starts(len(chosen))
    ]
    side = bench.side([theta for _, theta in lanes], [places[number] for number, _ in lanes])
    found = fit(bench.recursion, bench.run, side, np.array([data[number] for number, _ in lanes]))
    owners = np.array([number for number, _ in lanes])
    return tuple(
        _solutions(bench, tuple(names), places[number], true[number], found, owners == number)
        for number, names in enumerate(hypotheses)
    )


def _solutions(
    bench: Bench, names: tuple[str, ...], places: list[int], true: FloatArray, found: Fit, mine: BoolArray
) -> OtherSolutions:
    own = [theta for theta in found.theta[0][mine & found.exact] if bench.inside(theta)]
    kept: list[FloatArray] = []
    for theta in sorted(own, key=lambda theta: float(_distance(bench, theta, true))):
        if all(_distance(bench, theta, other) > _SAME for other in (*kept, true)):
            kept.append(theta)
    continuum = len(kept) > max(_MANY, int(mine.sum()) // _MANY)
    return OtherSolutions(
        parameters=names,
        true=tuple(float(value) for value in true[places]),
        others=() if continuum else tuple(tuple(float(value) for value in theta[places]) for theta in kept),
        continuum=continuum,
    )


def _distance(bench: Bench, one: FloatArray, other: FloatArray) -> float:
    """Give the largest relative difference of two sets of values; where the nominal is 0, in scales."""
    scale = np.array([abs(item.scale) for item in bench.graph.parameters])
    zero = np.array([item.nominal == 0.0 for item in bench.graph.parameters], dtype=bool)
    size = np.where(zero, scale, np.maximum(np.minimum(np.abs(one), np.abs(other)), 1e-12 * scale))
    return float(np.max(np.abs(one - other) / size, initial=0.0))


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
        Where a name is unknown, or a plant has no finite solution.
    """
    graph, rng = model.plant.graph, np.random.default_rng(seed)
    everything = [k for k, item in enumerate(graph.parameters) if item.suspect]
    drawn = np.exp(rng.uniform(np.log(low), np.log(high), (behaviours, len(everything))))
    plants = [changed(graph, everything, row.tolist()) for row in drawn]
    bench = bench_of(model, plants)
    data = bench.outputs(plants)
    results = []
    for names in hypotheses:
        places = places_of(graph, names)
        lanes = [(row, factors) for row in range(behaviours) for factors in bench.starts(len(places))]
        side = bench.side([changed(graph, places, factors) for _, factors in lanes], [places] * len(lanes))
        found = fit(bench.recursion, bench.run, side, np.array([data[row] for row, _ in lanes]))
        pairs = zip(lanes, found.theta[0], found.exact, strict=True)
        reached = {row for (row, _), theta, exact in pairs if exact and bench.inside(theta)}
        results.append(Reach(parameters=tuple(names), reached=len(reached), tried=behaviours))
    return tuple(results)
