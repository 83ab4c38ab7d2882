"""Hypotheses of a static network with noise: constant parameters fitted to all observations, and tested.

Unlike without noise, a rejection is not for ever: more observations allow a larger misfit. Since the least misfit
only grows with them, a hypothesis is not fitted again before it may pass.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import combinations
from math import inf

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.networks.hypothesis import Hypothesis, advance
from faultbond.networks.least_squares import (
    REJECTED,
    BestValues,
    Data,
    data_of,
    fit_parameters,
    limit,
    ranges_of,
    readable,
)
from faultbond.networks.numeric_search import starts
from faultbond.networks.polynomial_roots import ExactPoint, value_of
from faultbond.networks.reader import Reader, reader
from faultbond.networks.static_network import READING, Observation, StaticNetwork, healthy_of

ROOTS_FROM = 4  # first observations: later ones start from the fits so far


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class FittedHypothesis:
    """A hypothesis as far as it is fitted.

    found: the fits; of blocks, whose signals are free in every observation, one without values. allowed: the largest
    misfit that passes. freedom: of blocks, readings of the first `count` observations less unknowns.
    """

    suspects: tuple[str, ...]
    read: Reader
    found: tuple[BestValues, ...] = ()
    allowed: float = inf
    freedom: int = 0
    count: int = 0

    @property
    def fits(self) -> tuple[BestValues, ...]:
        """The fits that pass."""
        return tuple(item for item in self.found if item.misfit <= self.allowed)

    @property
    def least(self) -> float:
        """The least misfit so far."""
        return min((item.misfit for item in self.found), default=0.0)


def trials(
    network: StaticNetwork, before: Mapping[tuple[str, ...], FittedHypothesis], rows: Sequence[Observation]
) -> dict[tuple[str, ...], FittedHypothesis]:
    """Give the hypotheses after one observation more, up to the least size at which one passes.

    Parameters
    ----------
    network : a network with noise
    before : the hypotheses after the observation before
    rows : all observations since the detection
    """
    after = dict(before)
    data = data_of(network, rows)
    for size in range(1, min(network.graph.max_faults, len(network.suspects)) + 1):
        passed = False
        for suspects in combinations(network.suspects, size):
            held = after.get(suspects) or FittedHypothesis(suspects=suspects, read=_reader(network, suspects))
            after[suspects] = (_of_blocks if network.of_blocks else _of_parameters)(network, held, rows, data)
            passed |= bool(after[suspects].fits)
        if passed:
            break
    return after


def _reader(network: StaticNetwork, suspects: tuple[str, ...]) -> Reader:
    if network.reader is not None and not network.of_blocks:
        return network.reader.of(suspects)
    laws = [law for law in network.laws if law.block not in suspects]
    free = [law.signal for law in network.laws if law.block in suspects]
    return reader(network.graph, laws, network.values, {name: 1.0 for name in free if name is not None})


def _of_parameters(
    network: StaticNetwork, held: FittedHypothesis, rows: Sequence[Observation], data: Data
) -> FittedHypothesis:
    readings = int(readable(held.read, data).sum())
    if held.least > limit(REJECTED, readings):
        return replace(held, allowed=0.0)
    scale, bounds = ranges_of(network, held.suspects)
    found: list[BestValues] = []
    for start in _starts(network, held, rows, data):
        solution = fit_parameters(held.read, start, scale, bounds, data)
        if not any(_same(solution, other, scale) for other in found):
            found.append(solution)
    rank = max(item.rank for item in found)
    return replace(held, found=tuple(found), allowed=limit(REJECTED, max(readings - rank, 1)))


def _starts(
    network: StaticNetwork, held: FittedHypothesis, rows: Sequence[Observation], data: Data
) -> list[FloatArray]:
    """Give what to start from: the fits so far; at first, also the nominal values and the roots of single readings.

    Where the nominal values give no real number, multiples of them are tried too.
    """
    if held.found and len(rows) > ROOTS_FROM:
        return [item.values for item in held.found]
    roots = _first_roots(network, held.suspects, rows) if len(rows) <= ROOTS_FROM else ()
    nominal = np.array([float(network.values[name]) for name in held.suspects])
    exact = [np.array([float(value_of(point[name])) for name in held.suspects]) for point in roots]
    # A fit goes nowhere from values that give no real number where there is a reading.
    is_real = np.isfinite(held.read(nominal, data.u)[0][readable(held.read, data)]).all()
    further = [] if is_real else [nominal * item for item in starts(len(held.suspects))]
    return [nominal, *(item.values for item in held.found), *exact, *further]


def _first_roots(
    network: StaticNetwork, suspects: tuple[str, ...], rows: Sequence[Observation]
) -> tuple[ExactPoint, ...]:
    """Give the values that explain as many readings as they are, exactly, for want of noise-free ones."""
    alone: list[Observation] = []
    held = Hypothesis(suspects=suspects)
    for row in rows:
        for sensor in row.sensors:
            others = {READING + name for name in row.sensors if name != sensor}
            values = {name: value for name, value in row.values.items() if name not in others}
            alone.append(replace(row, values=values, sensors=(sensor,)))
            held = advance(network, held, alone)
            if not held.systems:
                return held.points
    return ()


def _same(one: BestValues, other: BestValues, scale: FloatArray) -> bool:
    """Whether a fit is no other than one found before, which is no worse."""
    near = np.where(np.isfinite(one.sd), 0.1 * one.sd, inf) + 1e-6 * np.abs(scale)
    return other.misfit < one.misfit + 1.0 and bool(np.all(np.abs(one.values - other.values) <= near))


def _of_blocks(
    network: StaticNetwork, held: FittedHypothesis, rows: Sequence[Observation], data: Data
) -> FittedHypothesis:
    """Fit the free signals of the observations that are new; each observation has its own."""
    if held.least > limit(REJECTED, int(readable(held.read, data).sum())):
        return replace(held, allowed=0.0)
    misfit, freedom = held.least, held.freedom
    for k in range(held.count, len(rows)):
        healthy = healthy_of(network, rows[k]).values
        start = np.array([float(healthy.get(name, 1.0)) for name in held.read.free])
        scale = np.where(start == 0.0, 1.0, np.abs(start))
        one = Data(u=data.u[:, k : k + 1], y=data.y[:, k : k + 1])
        found = fit_parameters(held.read, start, scale, (np.full(len(start), -inf), np.full(len(start), inf)), one)
        misfit += found.misfit
        freedom += int(readable(held.read, one).sum()) - found.rank
    none = np.zeros(0)
    total = BestValues(values=none, sd=none, misfit=misfit, rank=0)
    allowed = limit(REJECTED, max(freedom, 1))
    return replace(held, found=(total,), allowed=allowed, freedom=freedom, count=len(rows))


def left(after: Mapping[tuple[str, ...], FittedHypothesis]) -> tuple[FittedHypothesis, ...]:
    """Give the hypotheses of the least size that pass."""
    passing = [item for item in after.values() if item.fits]
    least = min((len(item.suspects) for item in passing), default=0)
    return tuple(item for item in passing if len(item.suspects) == least)
