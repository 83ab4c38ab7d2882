"""Inputs that act as a product with one parameter alone: a wrong gain of the one is a change of the other."""

from collections.abc import Iterator

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import Plant

TIMES = 1.37  # by which the input is larger and the parameter smaller
TOLERANCE = 1e-9  # of the larger of two values
TRIALS = 3  # points at which that is tried
SPREAD = (0.5, 2.0)  # of values about what they are


def factors_of_inputs(plant: Plant) -> tuple[int, ...]:
    """Give for each input the suspect parameter with which alone it acts, as a product; -1: there is none.

    An input with a lag has none: a gain of it comes as late as the input, and a change of the parameter at once.
    """
    values = ca.vertcat(plant.rates, plant.readings, plant.gap)
    function = ca.Function("values", [plant.x, plant.u, plant.theta, plant.b, plant.z], [ca.densify(values)])
    points = list(_points(plant))
    found = []
    for k in range(len(plant.graph.inputs)):
        named = (j for j, known in enumerate(plant.graph.parameters) if known.suspect and known.nominal != 0.0)
        alike = (j for j in named if all(_is_product(function, point, k, j) for point in points))
        found.append(next(alike, -1))
    return tuple(found)


def _points(plant: Plant) -> Iterator[list[FloatArray]]:
    generator = np.random.default_rng(0)
    nominal = np.array([item.nominal for item in plant.graph.parameters])
    for _ in range(TRIALS):
        sizes = (plant.x.numel(), plant.u.numel(), None, plant.b.numel(), plant.z.numel())
        drawn = [generator.uniform(*SPREAD, nominal.shape if size is None else size) for size in sizes]
        drawn[2] *= nominal
        drawn[3] *= 0.01  # errors of laws are small
        yield drawn


def _is_product(function: ca.Function, point: list[FloatArray], number: int, parameter: int) -> bool:
    """Tell whether an input that is larger and a parameter that is as much smaller change nothing; one alone does."""

    def values(larger: float, smaller: float) -> FloatArray:
        u, theta = point[1].copy(), point[2].copy()
        u[number] *= larger
        theta[parameter] /= smaller
        return np.asarray(function(point[0], u, theta, *point[3:]))[:, 0]

    usual, both, alone = values(1.0, 1.0), values(TIMES, TIMES), values(TIMES, 1.0)
    if not np.all(np.isfinite([usual, both, alone])):
        return False
    size = TOLERANCE * np.maximum(np.abs(usual), np.abs(both))
    return bool(np.all(np.abs(both - usual) <= size) and np.any(np.abs(alone - usual) > size))
