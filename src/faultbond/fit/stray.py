"""Parameters that a fit puts far outside their declared accuracies, and what they went with.

Who declares an accuracy knows something. A value that is many accuracies off is a wrong number sometimes; more often
the model lacks something, and this parameter takes its part, mostly together with others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.certainty import SEVERAL, SHOWN, Certainty
from faultbond.fit.identification import Fit, Prior
from faultbond.fit.outcome import Estimate
from faultbond.fit.unknowns import FURTHEST, INSIDE, is_logarithmic
from faultbond.model.graph import BondGraph, Parameter

HELD = INSIDE * (1.0 - 1e-6)  # what stands at this end is kept from straying
TRADED = 0.5  # correlation beyond which a parameter goes with another
ABOUT_ALIKE = 0.5  # of the largest part in a scale that parameters have in common


@dataclass(frozen=True, slots=True, kw_only=True)
class Stray:
    """A parameter that strayed, and the others of which it is hardly told apart.

    accuracies : by how many of its declared ones it is off, with the sign
    moves : by how much it moved, and by about how much they did with it, if more than was declared; SI, by name,
        itself first
    """

    parameter: Parameter
    accuracies: float
    moves: tuple[tuple[str, float], ...]

    @property
    def partners(self) -> tuple[str, ...]:
        """The parameters that it went with."""
        return tuple(name for name, _ in self.moves[1:])


def strayed_by(item: Parameter, value: float) -> float:
    """Give by how many of its declared accuracies a value of a parameter, SI, is off, as the prior measures it."""
    if item.accuracy <= 0.0:
        return 0.0
    if is_logarithmic(item):
        return math.log(max(value / item.nominal, 1.0 / FURTHEST)) * abs(item.nominal) / item.accuracy
    return (value - item.nominal) / item.accuracy


def strays_of(graph: BondGraph, found: Fit, estimates: Sequence[Estimate]) -> tuple[Stray, ...]:
    """Give the parameters that strayed, the farthest first.

    None where declared accuracies were not to count. A lag that was found is no constant of the plant.

    Parameters
    ----------
    graph : the plant
    found : the fit
    estimates : of all parameters that were fitted, in their order
    """
    if found.prior is Prior.NONE:
        return ()
    n = len(estimates)
    slopes = found.plant.unknowns.fill(found.plant.base, found.summit.point.values)[1][:n]
    units = slopes * np.array([item.parameter.scale for item in estimates])
    strays = []
    for k, item in enumerate(estimates):
        off = strayed_by(item.parameter, item.value)
        if abs(off) <= HELD or item.stays_zero or item.parameter.name in graph.lags:
            continue
        moved = abs(item.value - item.parameter.nominal)
        covariance = _without_scales(found.certainty, k)[:n, :n] * np.outer(units, units)  # SI
        sds = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
        with_it = np.abs(covariance[k]) / (sds[k] * sds)
        moves = (moved * np.abs(covariance[k]) / sds[k] ** 2).tolist()
        others = tuple(
            (other.parameter.name, moves[j])
            for j, other in enumerate(estimates)
            if j != k
            and with_it[j] > TRADED
            and moves[j] > other.parameter.accuracy
            and other.parameter.name not in graph.lags
        )
        strays.append(Stray(parameter=item.parameter, accuracies=off, moves=((item.parameter.name, moved), *others)))
    return tuple(sorted(strays, key=lambda one: -abs(one.accuracies)))


def _without_scales(certainty: Certainty, k: int) -> FloatArray:
    """Give the covariance of the unknowns, (n, n), where no scale that many others have in common moves beside one, k.

    Data that show no such scale let all go along with one that is off. That it is off alone is likelier than that all
    others are by the same part.
    """
    covariance, rows = certainty.covariance, certainty.silent.copy()
    alike = np.all((rows == 0.0) | (np.abs(rows) > ABOUT_ALIKE * SHOWN), axis=1)
    rows = rows[alike & (rows[:, k] != 0.0) & (np.count_nonzero(rows, axis=1) > SEVERAL)]
    rows[:, k] = 0.0
    wide = np.zeros((len(rows), len(covariance)))
    wide[:, : rows.shape[1]] = rows
    held = wide @ covariance
    return np.asarray(covariance - held.T @ np.linalg.pinv(held @ wide.T, hermitian=True) @ held)


def doubts_of(strays: Sequence[Stray]) -> dict[str, float]:
    """Give by how much parameters may be off since one strayed with another, SI, by name.

    One that strayed alone is told by the data alone; which of several is to be blamed, no fault tells either.
    """
    doubts: dict[str, float] = {}
    for item in strays:
        for name, size in item.moves if item.partners else ():
            doubts[name] = max(doubts.get(name, 0.0), size)
    return doubts
