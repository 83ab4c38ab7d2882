"""What is to be found, as a vector without bounds, and what was known before.

A parameter whose range has one sign is found by its logarithm, relative to nominal; any other by its factor. Sizes of
noise are found by their logarithms, an unknown start by parts of its size. Declared accuracies are the prior.
"""

from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.fit.likelihood import Layout
from faultbond.model.graph import Parameter

FURTHEST = 1e3  # a parameter is at most so many times larger or smaller than nominal
INSIDE = 3.0  # accuracies; a parameter that a fit puts farther from where it was declared strays
NOISE_PRIOR = 3.0  # sd of the logarithm of a size of noise: a factor of 20 either way


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Unknowns:
    """Places in q of what is to be found: parameters first, then sizes of noise. All arrays are (n,), per unknown.

    logarithmic: the unknown is the logarithm of the factor (of the sd in SI, of noise), else the factor; nominal, lower
    and upper are values of it. prior: its sd before the data.
    """

    places: IntArray
    parameters: tuple[Parameter, ...]
    logarithmic: BoolArray
    nominal: FloatArray
    prior: FloatArray
    lower: FloatArray
    upper: FloatArray

    @property
    def n_theta(self) -> int:
        """How many of them are parameters."""
        return len(self.parameters)

    def fill(self, base: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Give q (n_q,) with the unknowns at their values (n,), and the slope (n,) of each entry by its unknown."""
        q, n = base.copy(), self.n_theta
        entries = values.copy()
        entries[:n] = np.where(self.logarithmic[:n], np.exp(values[:n]), values[:n])
        q[self.places] = entries
        slopes = np.ones(len(values))
        slopes[:n] = np.where(self.logarithmic[:n], entries[:n], 1.0)
        return q, slopes

    def widened(self, times: float | FloatArray) -> FloatArray:
        """Give the prior (n,) with accuracies that many times wider, one for all or (n_theta,)."""
        return np.concatenate([times * self.prior[: self.n_theta], self.prior[self.n_theta :]])


def is_logarithmic(item: Parameter) -> bool:
    """Tell whether a parameter is found by its logarithm, since it stays on its side of zero."""
    return (item.nominal > 0.0 and item.lower >= 0.0) or (item.nominal < 0.0 and item.upper <= 0.0)


def is_absent(item: Parameter) -> bool:
    """Tell whether what a parameter stands for is not there while healthy, as a leak: 0, from where it only goes up."""
    return item.suspect and item.nominal == 0.0 < item.accuracy and 0.0 in (item.lower, item.upper)


def unknowns_of(
    layout: Layout,
    base: FloatArray,
    parameters: tuple[tuple[int, Parameter], ...],
    noises: tuple[int, ...],
    *,
    grow: bool = False,
) -> Unknowns:
    """Give the unknowns.

    What is absent while healthy stays inside its declared accuracy: of a model that lacks something any leak explains
    a part, and a leak of healthy recordings hides that of a fault.

    Parameters
    ----------
    layout : of q
    base : float array, shape (n_q,), as the model file states it
    parameters : those to be found, with their places in q
    noises : places in q of the sizes of noise, and of the memories, to be found
    grow : whether slow errors may be larger than declared; one that may explains away whatever the model does wrong
    """
    logs = [is_logarithmic(item) for _, item in parameters]
    nominal, prior, lower, upper = [], [], [], []
    for (place, item), log in zip(parameters, logs, strict=True):
        ends = sorted((item.lower / item.scale, item.upper / item.scale))
        nominal.append(0.0 if log else base[place])
        prior.append(item.accuracy / abs(item.scale))
        if is_absent(item):
            ends = [min(max(end, -INSIDE * prior[-1]), INSIDE * prior[-1]) for end in ends]
        lower.append(np.log(max(ends[0], 1.0 / FURTHEST)) if log else ends[0])
        upper.append(np.log(min(ends[1], FURTHEST)) if log else ends[1])
    several = len(noises)
    own = base[list(noises)]
    bounded = [not grow and layout.n_p + layout.n_y <= place < layout.first_memory for place in noises]
    return Unknowns(
        places=np.array([*(place for place, _ in parameters), *noises], dtype=np.intp),
        parameters=tuple(item for _, item in parameters),
        logarithmic=np.array([*logs, *([True] * several)], dtype=bool),
        nominal=np.array([*nominal, *own]),
        prior=np.array([*prior, *([NOISE_PRIOR] * several)]),
        lower=np.array([*lower, *(own - np.log(1e8))]),
        upper=np.array([*upper, *(own + np.where(bounded, 0.0, np.log(1e8)))]),
    )
