"""How fast a plant moves beside how often it is sampled: where slower samples would tell as much, slow faults are late.

What no model knows of is allowed for at each sample, and the memory of the alarms is a number of samples. So a plant
that is sampled a hundred times while nothing in it can have moved had better be sampled less often, by means of rows.
"""

from collections.abc import Sequence
from math import floor, inf, log10

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel, reference_inputs

MANY = 100.0  # samples in the shortest time in which something moves, from which on fewer do as well
ENOUGH = 10.0  # samples in that time
MOVED = 0.01  # of the largest value of an input; less is no move


def slower_step(model: StepModel, inputs: Sequence[FloatArray]) -> float | None:
    """Give a longer time between samples that is short enough, s; None: that stated is right, or rows are averaged.

    The shortest time in which something moves is that of the fastest time constant of the nominal plant, lags included,
    of an input that settles, of a slow error, or from one move of an input to the next.

    Parameters
    ----------
    model : the plant in discrete time
    inputs : (N, n_inputs), of recordings, each on the grid of samples
    """
    graph = model.plant.graph
    step = graph.sample_time
    if step is None or graph.row_time is not None:
        return None
    stated = [item.settling for item in graph.inputs if item.settling] + [item.memory for item in graph.slow_errors]
    pauses = [step * _pause(u[:, k]) for u in inputs for k in range(u.shape[1])]
    shortest = min([_fastest(model), *stated, *pauses])
    if not MANY * step <= shortest < inf:
        return None
    most = shortest / ENOUGH / step  # samples
    power = 10.0 ** floor(log10(most))
    return step * max(part * power for part in (1.0, 2.0, 5.0) if part * power <= most)


def _fastest(model: StepModel) -> float:
    """Give the fastest time constant of the nominal plant in use, s."""
    n_x, graph = len(model.states), model.plant.graph
    v = np.zeros(model.v.numel())
    v[:n_x] = model.reference_state
    first = n_x + model.plant.b.numel()
    nominal = np.array([item.nominal for item in graph.parameters])
    v[first : first + len(nominal)] = nominal / np.asarray(model.scales)
    slopes = model.rates(v, reference_inputs(model.plant), model.reference_implicit)[1].full()[:, :n_x]
    if not n_x or not np.isfinite(slopes).all():
        return 0.0
    fastest = float(np.max(np.abs(np.linalg.eigvals(slopes))))
    return 1.0 / fastest if fastest > 0.0 else inf


def _pause(course: FloatArray) -> float:
    """Give how many samples an input (N,) usually stays where it is; inf where it never moves."""
    moves = np.flatnonzero(np.abs(np.diff(course)) > MOVED * np.max(np.abs(course), initial=0.0))
    return float(np.median(np.diff(moves))) if len(moves) > 1 else inf
