"""Inputs that act with one parameter alone, as in G*u or K*u**0.8, or as one does, as in M + M0.

A wrong gain of the input is a change of the parameter in the one case, a bias of it in the other.
"""

from collections.abc import Callable, Iterator, Sequence
from operator import add, mul
from typing import Any

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.plant import Plant
from faultbond.equations.step import reference_inputs

TIMES = (1.37, 0.81)  # by which the input is larger
TOLERANCE = 1e-9  # of the larger of two values
TRIALS = 3  # points at which that is tried
SPREAD = (0.5, 2.0)  # of values about what they are
LATE = 5.0  # samples: a gain of an input that lags less comes about as early as a change of the parameter
MOST_POWER = 10.0
SECANTS = 30  # to the power with which the input acts
_Change = Callable[..., Any]  # gives a number, or some, changed by another: `operator.mul` or `operator.add`
Probe = Callable[[float, float], FloatArray]  # by what the input is changed, and the parameter


def factors_of_inputs(plant: Plant) -> tuple[int, ...]:
    """Give for each input the suspect parameter with which alone it acts, times a power of it; -1: there is none.

    An input with a longer lag has none: a gain of it comes as late as the input, and a change of the parameter at once.
    """
    function, points, parameters, found = _function(plant), list(_points(plant)), plant.graph.parameters, []
    for k, behind, named in _partners(plant):
        others = (j for j in named if parameters[j].nominal != 0.0)
        alike = (j for j in others if _act_together([_probe(function, point, (k, behind, j), mul) for point in points]))
        found.append(next(alike, -1))
    return tuple(found)


def terms_of_inputs(plant: Plant) -> tuple[tuple[int, float], ...]:
    """Give for each input the suspect parameter that acts as it does, and how much of it one of the input is; -1: none.

    Both in SI. Not of an input with a longer lag, see `factors_of_inputs`.
    """
    function, points, found = _function(plant), list(_points(plant)), []
    for k, behind, named in _partners(plant):
        sums = ((j, _part_of([_probe(function, point, (k, behind, j), add) for point in points])) for j in named)
        found.append(next(((j, part) for j, part in sums if part), (-1, 0.0)))
    return tuple(found)


def _function(plant: Plant) -> ca.Function:
    """Give what gives rates, readings and what is left of implicit laws."""
    values = ca.vertcat(plant.rates, plant.readings, plant.gap)
    return ca.Function("values", [plant.x, plant.u, plant.theta, plant.b, plant.z], [ca.densify(values)])


def _partners(plant: Plant) -> Iterator[tuple[int, list[int], list[int]]]:
    """Give each input, the states that lag behind it, and the suspect parameters; none of one that lags for long."""
    graph = plant.graph
    suspects = [j for j, known in enumerate(graph.parameters) if known.suspect]
    for k, item in enumerate(graph.inputs):
        lag = graph.parameter(item.lag).nominal if item.lag else 0.0
        behind = [j for j, store in enumerate(plant.network.states) if item.lag and store.owner == item.name]
        yield k, behind, suspects if lag <= LATE * (graph.sample_time or 0.0) else []


def _points(plant: Plant) -> Iterator[list[FloatArray]]:
    """Give states, inputs, parameters, errors and implicit signals where the plant may be.

    Inputs within what the model was fitted to, where that is known: at others a law may stand still, as that of a pipe
    whose pump does not lift the water.
    """
    generator = np.random.default_rng(0)
    wanders = [item.wanders for item in plant.graph.slow_errors]
    nominal, usual = np.array([item.nominal for item in plant.graph.parameters]), reference_inputs(plant)
    ranges = [
        item.fitted_range or (SPREAD[0] * u, SPREAD[1] * u) for item, u in zip(plant.graph.inputs, usual, strict=True)
    ]
    for _ in range(TRIALS):
        sizes = (plant.x.numel(), plant.u.numel(), None, plant.b.numel(), plant.z.numel())
        drawn = [generator.uniform(*SPREAD, nominal.shape if size is None else size) for size in sizes]
        drawn[1] = np.array([generator.uniform(*item) for item in ranges])
        drawn[2] *= nominal
        drawn[3] *= 0.01  # errors of laws are small,
        drawn[3][wanders] = 0.0  # and what wanders is at its usual value: it may be no part of that
        yield drawn


def _probe(
    function: ca.Function, point: list[FloatArray], places: tuple[int, list[int], int], change: _Change
) -> Probe:
    """Give what tells rates and readings with an input, what lags behind it, and a parameter changed; see `Probe`.

    places : of the input, of the states behind it, of which the rates are left out, and of the parameter
    """
    number, behind, parameter = places

    def values(by: float, meanwhile: float) -> FloatArray:
        x, u, theta = point[0].copy(), point[1].copy(), point[2].copy()
        u[number] = change(u[number], by)
        x[behind] = change(x[behind], by)
        theta[parameter] = change(theta[parameter], meanwhile)
        return np.delete(np.asarray(function(x, u, theta, *point[3:]))[:, 0], behind)

    return values


def _part_of(points: Sequence[Probe]) -> float:
    """Give how much more of a parameter does what one more of an input does, everywhere; 0: nothing does."""
    usual = points[0](0.0, 0.0)
    by_input, by_parameter = points[0](1.0, 0.0) - usual, points[0](0.0, 1.0) - usual
    if not np.all(np.isfinite([by_input, by_parameter])):
        return 0.0
    most = int(np.argmax(np.abs(by_input) / np.maximum(np.abs(usual), 1e-300)))
    if by_input[most] == 0.0 or by_parameter[most] == 0.0:
        return 0.0
    part = float(by_input[most] / by_parameter[most])
    is_so = all(_is_same(values(more, 0.0), values(0.0, part * more)) for values in points for more in TIMES)
    return part if is_so else 0.0


def _act_together(points: Sequence[Probe]) -> bool:
    """Tell whether an input that is larger and a parameter that is smaller change nothing; one alone does.

    By the same power of the input everywhere.
    """
    power = _power(points[0])
    return power is not None and all(
        _is_same(values(1.0, 1.0), values(times, times**-power)) and not _is_same(values(1.0, 1.0), values(times, 1.0))
        for values in points
        for times in TIMES
    )


def _is_same(one: FloatArray, other: FloatArray) -> bool:
    if not np.all(np.isfinite([one, other])):
        return False
    return bool(np.all(np.abs(one - other) <= TOLERANCE * np.maximum(np.abs(one), np.abs(other))))


def _power(values: Probe) -> float | None:
    """Give the power of the input that the parameter makes up for, by secants on what changes most, or None."""
    times, usual = TIMES[0], values(1.0, 1.0)
    changed = values(times, 1.0) - usual
    if not np.all(np.isfinite(changed)):
        return None
    most = int(np.argmax(np.abs(changed) / np.maximum(np.abs(usual), 1e-300)))
    one, two = 0.0, 1.0
    left_one, left_two = changed[most], (values(times, 1.0 / times) - usual)[most]
    for _ in range(SECANTS):
        if left_two == left_one or not np.isfinite(left_two):
            break
        one, two, left_one = two, two - left_two * (two - one) / (left_two - left_one), left_two
        if not abs(two) < MOST_POWER:
            return None
        left_two = (values(times, times**-two) - usual)[most]
    return two
