"""Parameters that a fit puts far outside their declared accuracies, and what they went with.

Who declares an accuracy knows something. A value that is many accuracies off is a wrong number sometimes; more often
the model lacks something, and this parameter takes its part, mostly together with others.
"""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.fit.identification import Fit, Prior
from faultbond.fit.outcome import Estimate
from faultbond.fit.unknowns import FURTHEST, is_logarithmic
from faultbond.model.graph import BondGraph, Parameter

INSIDE = 3.0  # accuracies; a parameter that a fit puts farther from where it was declared strays
TRADED = 0.5  # correlation beyond which a parameter goes with another


@dataclass(frozen=True, slots=True, kw_only=True)
class Stray:
    """A parameter that strayed, and the others of which it is hardly told apart.

    accuracies : by how many of its declared ones it is off, with the sign
    moves : by how much it moved, and by about how much they did with it; SI, by name, itself first
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
    lags = {item.lag for item in graph.inputs} | {item.lag for item in graph.sensors}
    n = len(estimates)
    slopes = found.plant.unknowns.fill(found.plant.base, found.summit.point.values)[1][:n]
    units = slopes * np.array([item.parameter.scale for item in estimates])
    covariance = found.certainty.covariance[:n, :n] * np.outer(units, units)  # SI
    sds = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    strays = []
    for k, item in enumerate(estimates):
        off = strayed_by(item.parameter, item.value)
        if abs(off) <= INSIDE or item.stays_zero or item.parameter.name in lags:
            continue
        moved = abs(item.value - item.parameter.nominal)
        with_it = covariance[k] / (sds[k] * sds)
        moves = [(item.parameter.name, moved)]
        moves += [
            (other.parameter.name, moved * abs(float(covariance[k, j])) / float(sds[k]) ** 2)
            for j, other in enumerate(estimates)
            if j != k and abs(with_it[j]) > TRADED and other.parameter.name not in lags
        ]
        strays.append(Stray(parameter=item.parameter, accuracies=off, moves=tuple(moves)))
    return tuple(sorted(strays, key=lambda one: -abs(one.accuracies)))


def doubts_of(strays: Sequence[Stray]) -> dict[str, float]:
    """Give by how much parameters may be off since one strayed with another, SI, by name.

    One that strayed alone is told by the data alone; which of several is to be blamed, no fault tells either.
    """
    doubts: dict[str, float] = {}
    for item in strays:
        for name, size in item.moves if item.partners else ():
            doubts[name] = max(doubts.get(name, 0.0), size)
    return doubts
