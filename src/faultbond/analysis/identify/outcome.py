"""What a fit means for the model: values, what is to be written into the file, and what the data did not tell."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.analysis.identify.fit import Fit
from faultbond.model.graph import BondGraph, Parameter, Sensor
from faultbond.types import FloatArray

LEAST_ACCURACY = 0.01  # of a value: no plant stays the same to better; a smaller one is kept where it is declared
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


@dataclass(frozen=True, slots=True, kw_only=True)
class NoiseFound:
    """The noise of a sensor; SI. sd: of `found`."""

    sensor: Sensor
    found: float
    sd: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Silence:
    """Parameters that change together, in parts of their values, without the sensors showing it."""

    changes: tuple[tuple[str, float], ...]


def estimates_of(found: Fit) -> tuple[Estimate, ...]:
    """Give the parameters that were fitted, in the order of the model."""
    unknowns, certainty = found.plant.unknowns, found.certainty
    q, slopes = unknowns.fill(found.plant.base, found.summit.point.values)
    values = found.summit.point.values
    estimates = []
    for k, item in enumerate(unknowns.parameters):
        factor, unit = float(q[unknowns.places[k]]), abs(float(slopes[k]) * item.scale)
        sd = float(certainty.sd[k]) * unit
        value = factor * item.scale
        estimates.append(
            Estimate(
                parameter=item,
                value=value,
                sd=sd,
                alone=float(certainty.alone[k]) * unit,
                inflation=float(certainty.inflation[k]),
                accuracy=max(sd, min(LEAST_ACCURACY * abs(value), item.accuracy)),
                determined=bool(certainty.determined[k]),
                at_end=bool(
                    values[k] - unknowns.lower[k] < AT_END or unknowns.upper[k] - values[k] < AT_END,
                ),
            )
        )
    return tuple(estimates)


def noises_of(found: Fit, graph: BondGraph) -> tuple[NoiseFound, ...]:
    """Give the noise of the sensors that was found."""
    unknowns, n, n_p = found.plant.unknowns, found.plant.unknowns.n_theta, found.plant.layout.n_p
    noises = []
    for k, place in enumerate(unknowns.places[n:], start=n):
        j = int(place) - n_p
        if j < len(graph.sensors):
            size = float(np.exp(found.summit.point.values[k]))
            noises.append(NoiseFound(sensor=graph.sensors[j], found=size, sd=size * float(found.certainty.sd[k])))
    return tuple(noises)


def silences_of(found: Fit) -> tuple[Silence, ...]:
    """Give the combinations that the data do not fix."""
    names = [item.name for item in found.plant.unknowns.parameters]
    return tuple(
        Silence(changes=tuple((name, float(part)) for name, part in zip(names, row, strict=True) if part))
        for row in found.certainty.silent
    )


def residual_sizes(found: Fit) -> tuple[tuple[FloatArray, FloatArray], ...]:
    """Give the root mean square of innovations and of simulation errors, (n_outputs,) each, for each recording; SI."""
    return tuple(
        (_size(item.innovations), _size(np.where(record.use, record.y, np.nan) - alone))
        for item, alone, record in zip(found.courses, found.simulated, found.records, strict=True)
    )


def _size(errors: FloatArray) -> FloatArray:
    counts = np.maximum(np.isfinite(errors).sum(axis=0), 1)
    return np.asarray(np.sqrt(np.nansum(errors**2, axis=0) / counts))


def names_of(estimates: Sequence[Estimate], *, determined: bool) -> tuple[str, ...]:
    """Give the names of the parameters that the data fix, or of those that they do not."""
    return tuple(item.parameter.name for item in estimates if item.determined is determined)
