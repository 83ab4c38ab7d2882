"""What a fit means for the model: values, what is to be written into the file, and what the data did not tell."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from itertools import product

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.certainty import PARTNER, UNSURE
from faultbond.fit.identification import Fit
from faultbond.model.correlations import is_definite, scaled
from faultbond.model.graph import BondGraph, Parameter, Sensor, SlowError

LEAST_ACCURACY = 0.01  # of a value: no plant stays the same to better; a smaller one is kept where it is declared
LESS_SURE = 3.0  # standard errors, up to the declared accuracy, of what is no suspect: that it walks helps nobody
MOST_CHANGE = 0.5  # of `change`; a healthy value that is less sure could not be told from a fault
ZERO = 3.0  # standard errors within which a nominal value of 0 is kept
WORTH = (0.1, 0.05, 0.02, 0.0)  # correlations that are worth telling: as few as make sense without the others
MORE_DIGITS = (0, 1, 2, 3)  # that may be needed, lest they contradict each other
SHRUNK = 0.99  # by which all are multiplied where that is not enough
AT_END = 1e-6  # logarithms or factors from the end of a range


@dataclass(frozen=True, slots=True, kw_only=True)
class Estimate:
    """A parameter that was fitted; SI.

    sd: standard error. alone: what it would be without the declared accuracies. inflation: factor in both for errors
    that are not white. accuracy: what is to be declared. determined: whether the data alone fix it.
    """

    parameter: Parameter
    value: float
    sd: float
    alone: float
    inflation: float
    accuracy: float
    determined: bool
    at_end: bool

    @property
    def stays_zero(self) -> bool:
        """Whether a nominal value of 0 agrees with the data."""
        return self.parameter.nominal == 0.0 and abs(self.value) <= ZERO * self.sd

    @property
    def to_declare(self) -> float:
        """The accuracy that the model is to declare; about a nominal 0 that is kept it reaches what was found."""
        return math.hypot(self.accuracy, self.value) if self.stays_zero else self.accuracy

    def shared(self, moves: float = 0.0) -> float:
        """Give the part of what is declared that may go together with others.

        A plant does not stay the same to better than the least accuracy, nor than by how much it seems to move, each
        parameter by itself, so that part is its own; and so is all where a standard error says more than is declared.

        moves : standard deviation by which the parameter seems to change while healthy, SI
        """
        least = max(_least(self.value, self.parameter), moves)
        common = self.sd**2 - least**2 if self.sd <= self.accuracy else 0.0
        return math.sqrt(max(common, 0.0)) / self.to_declare if self.to_declare > 0.0 else 0.0


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFound:
    """The noise of a sensor, or the size of a slow error; SI, of a relative error in parts. sd: of `found`."""

    of: Sensor | SlowError
    declared: float
    found: float
    sd: float

    @property
    def name(self) -> str:
        """The sensor, or what is in error."""
        return self.of.name if isinstance(self.of, Sensor) else self.of.target

    @property
    def is_known(self) -> bool:
        """Whether the data tell the size; of noise that drowns in other errors they only tell that it is small."""
        return self.sd <= UNSURE * self.found

    @property
    def to_declare(self) -> float:
        """What the model is to declare: noise as found; a slow error is there for days that are worse than these."""
        return self.found if isinstance(self.of, Sensor) and self.is_known else self.declared

    @property
    def at_most(self) -> float:
        """How large it may be, as far as the data tell: what was found and two standard errors more."""
        return self.found + 2.0 * self.sd if self.is_known else 2.0 * (self.found + self.sd)


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """Parameters that change together, in parts of their values, without the sensors showing it."""

    changes: tuple[tuple[str, float], ...]


def _least(value: float, item: Parameter) -> float:
    """Give to what a parameter is known at best; SI."""
    return min(LEAST_ACCURACY * abs(value), item.accuracy)


def estimates_of(found: Fit) -> tuple[Estimate, ...]:
    """Give the parameters that were fitted, in the order of the model, as they are where those that stay 0 are 0.

    Those that stay are given as they were found. The others go with them as the fit says (mean of a normal
    distribution, given a part of it): with a leak that is written as none a pipe takes what had leaked.
    """
    values = found.summit.point.values
    estimates = _estimates_at(found, values)
    zeros = [k for k, item in enumerate(estimates) if item.stays_zero and item.value != 0.0]
    if not zeros:
        return estimates
    n, unknowns = len(estimates), found.plant.unknowns
    covariance = found.certainty.covariance[:n, :n]
    moved = values.copy()
    moved[:n] -= covariance[:, zeros] @ np.linalg.lstsq(covariance[np.ix_(zeros, zeros)], values[zeros], rcond=None)[0]
    moved[zeros] = values[zeros]
    return _estimates_at(found, np.clip(moved, unknowns.lower, unknowns.upper))


def _estimates_at(found: Fit, values: FloatArray) -> tuple[Estimate, ...]:
    """Give the parameters that were fitted with the unknowns at values (n,)."""
    unknowns, certainty = found.plant.unknowns, found.certainty
    q, slopes = unknowns.fill(found.plant.base, values)
    estimates = []
    for k, item in enumerate(unknowns.parameters):
        factor, unit = float(q[unknowns.places[k]]), abs(float(slopes[k]) * item.scale)
        sd = float(certainty.sd[k]) * unit
        value = factor * item.scale
        known = max(sd, _least(value, item))  # at least the standard error, and
        known = known if item.suspect else max(known, min(LESS_SURE * known, item.accuracy))
        grown = abs(value / item.nominal) if item.nominal != 0.0 else 1.0
        most = max(MOST_CHANGE * item.change * grown, item.accuracy)  # no more than a fault would change
        estimates.append(
            Estimate(
                parameter=item,
                value=value,
                sd=sd,
                alone=float(certainty.alone[k]) * unit,
                inflation=float(certainty.inflation[k]),
                accuracy=min(known, most),
                determined=bool(certainty.determined[k]),
                at_end=bool(
                    values[k] - unknowns.lower[k] < AT_END or unknowns.upper[k] - values[k] < AT_END,
                ),
            )
        )
    return tuple(estimates)


def loosened(estimates: Sequence[Estimate], parts: Mapping[str, float]) -> tuple[Estimate, ...]:
    """Give estimates whose accuracy is at least some part of the value: of constants that moved while healthy.

    parts : by names
    """
    least = [parts.get(item.parameter.name, 0.0) * abs(item.value) for item in estimates]
    return tuple(replace(item, accuracy=max(item.accuracy, size)) for item, size in zip(estimates, least, strict=True))


def correlations_of(
    found: Fit, estimates: Sequence[Estimate], moves: Mapping[str, float] | None = None
) -> dict[tuple[str, str], float]:
    """Give how what the fit leaves open of two parameters goes together, by pairs of names, as it is to be declared.

    Parameters
    ----------
    found : the fit
    estimates : of all parameters that were fitted, in their order
    moves : standard deviations by which they seem to change while healthy, SI
    """
    unknowns, n = found.plant.unknowns, len(estimates)
    covariance = found.certainty.covariance[:n, :n]
    sds = np.sqrt(np.maximum(np.diag(covariance), 1e-300))
    slopes = unknowns.fill(found.plant.base, found.summit.point.values)[1][:n]
    signs = np.sign(slopes * np.array([item.scale for item in unknowns.parameters]))
    shared = signs * np.array([item.shared((moves or {}).get(item.parameter.name, 0.0)) for item in estimates])
    together = covariance / np.outer(sds, sds) * np.outer(shared, shared)
    names = [item.parameter.name for item in estimates]
    every = {(names[i], names[j]): float(together[i, j]) for i in range(n) for j in range(i + 1, n)}
    for least, more in product(WORTH, MORE_DIGITS):
        pairs = {pair: _rounded(value, more) for pair, value in every.items() if abs(value) >= least}
        pairs = {pair: value for pair, value in pairs.items() if value != 0.0}
        if is_definite(pairs):
            return pairs
    while not is_definite(every):
        every = scaled(every, SHRUNK)
    return every


def _rounded(value: float, more: int) -> float:
    """Give a correlation, towards 0, with as many digits as tell how much is left of each once the other is known."""
    digits = max(2, math.ceil(-math.log10(max(1.0 - abs(value), 1e-12))) + 1) + more
    return math.trunc(value * 10.0**digits) / 10.0**digits


def noises_of(found: Fit, graph: BondGraph) -> tuple[NoiseFound, ...]:
    """Give the noise of the sensors and the sizes of slow errors that were found."""
    unknowns, n, first = found.plant.unknowns, found.plant.unknowns.n_theta, found.plant.layout.first_noise
    things: tuple[Sensor | SlowError, ...] = (*graph.sensors, *graph.slow_errors)
    noises = []
    for k, place in enumerate(unknowns.places[n:], start=n):
        thing = things[int(place) - first]
        size = float(np.exp(found.summit.point.values[k]))
        noises.append(
            NoiseFound(
                of=thing,
                declared=thing.noise if isinstance(thing, Sensor) else thing.sd,
                found=size,
                sd=size * float(found.certainty.sd[k]),
            )
        )
    return tuple(noises)


def silences_of(found: Fit) -> tuple[Silence, ...]:
    """Give the combinations that the data do not fix."""
    names = [item.name for item in found.plant.unknowns.parameters]
    return tuple(
        Silence(changes=tuple((name, float(part)) for name, part in zip(names, row, strict=True) if part))
        for row in found.certainty.silent
    )


def faint_of(found: Fit) -> tuple[tuple[tuple[str, ...], float], ...]:
    """Give combinations that the data fix less well than declared: names, and how well, in parts of their values."""
    unknowns = found.plant.unknowns
    accuracies, combinations = unknowns.prior[: unknowns.n_theta], []
    for row in np.abs(found.certainty.faint):
        chosen = np.flatnonzero(row > PARTNER * row.max())
        names = tuple(unknowns.parameters[k].name for k in chosen)
        combinations.append((names, float(np.max(row * accuracies))))
    return tuple(combinations)


def residual_sizes(found: Fit) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Give the root mean square of innovations and of simulation errors, (n_outputs,) each, for each recording; SI."""
    return tuple(
        (_size(item.innovations), _size(np.where(record.use, record.y, np.nan) - alone))
        for item, alone, record in zip(found.courses, found.simulated, found.records, strict=True)
    )


def _size(errors: FloatArray) -> FloatArray:
    counts = np.maximum(np.isfinite(errors).sum(axis=0), 1)
    return np.asarray(np.sqrt(np.nansum(errors**2, axis=0) / counts))
