"""Runs on which a plant is judged: random ones near its nominal behaviour, and a recording.

A random run excites all that the plant has: inputs jump at every sample, over decades and in both signs, and the steps
in time range from the fastest to the slowest time constant, so that no mode hides. The rank of what is seen does not
depend on such choices, except by accident; several runs guard against accidents.
"""

from math import ceil

import numpy as np

from faultbond.analysis.equilibrium import reference
from faultbond.analysis.sensitivity import Experiment, Recursion
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel, reference_inputs

PARAMETER_SPREAD = 0.05  # of nominal; of `scale` where the nominal is 0
START_SPREAD = 0.1
PERCENT_RANGE = (20.0, 100.0)
BOTH_WAYS = (-100.0, 100.0)
# Decades of the sizes of other inputs, in units of the model file, and whether they change sign.
INPUT_KINDS = (((-0.5, 1.0), False), ((-0.5, 1.0), True), ((1.0, 2.0), False), ((-4.0, -1.0), True))
_LEAST_SAMPLES, _MOST_SAMPLES = 25, 600
_SPARE = 1.5  # readings per unknown
_STEP_RANGE = (0.3, 3.0)  # of the fastest and the slowest time constant
_FAR = 1e5  # a time constant so many samples long or short is none
_EMPTY = 1e-9  # SI, an effort or a flow that is none
_NO_MODE = 10.0  # samples per step where the plant only integrates


def random_experiments(
    model: StepModel, recursion: Recursion, seed: int = 0, *, sudden: bool = False
) -> tuple[Experiment, ...]:
    """Give one random run for each of `INPUT_KINDS`, then those for what they miss, all of the same length.

    One is for a store that is empty in the nominal run, as all are where there is no input: the size of its effort or
    flow is drawn about one SI unit, so that what it shows while it empties is seen. One has inputs in percent of both
    signs: a valve may go both ways, and what it drives with it, unless its range begins at 0. One has inputs within
    where they were in the recordings of a fit, if that is known: elsewhere a law with `max` or `where` may show
    nothing, as an orifice whose supply has less pressure than what it fills. Where changes are
    `sudden`, they come after healthy samples, enough to tell the start.
    """
    graph, begin = model.plant.graph, reference(model).contents
    rng = np.random.default_rng(seed)
    n_unknown = len(graph.parameters) + len(model.states)
    told = max(1, len(graph.sensors) - len(graph.unknown_inputs))  # values of a sample that tell of what is constant
    n = int(np.clip(ceil((_SPARE * n_unknown + 10) / told), _LEAST_SAMPLES, _MOST_SAMPLES))
    onset = int(np.clip(ceil((_SPARE * len(begin) + 10) / told), 0, _MOST_SAMPLES)) * sudden
    n += onset
    shortest, longest = _step_range(model, recursion, begin)
    kinds = [(begin, *kind, PERCENT_RANGE, False) for kind in INPUT_KINDS]
    empty = np.abs(model.reference_state) < _EMPTY
    if empty.any():
        nominal = np.array([item.nominal for item in graph.parameters])
        filled = model.contents(np.where(empty, 1.0, model.reference_state), nominal).full()[:, 0]
        kinds.append((filled, *INPUT_KINDS[0], PERCENT_RANGE, False))
    if any(item.unit.text == "percent" and item.lower < 0.0 for item in graph.inputs):
        kinds.append((begin, *INPUT_KINDS[1], BOTH_WAYS, False))
    if any(item.fitted_range is not None for item in graph.inputs):
        kinds.append((begin, *INPUT_KINDS[0], PERCENT_RANGE, True))
    found = []
    for start, decades, signed, percent, as_fitted in kinds:
        dt = np.exp(rng.uniform(np.log(shortest), np.log(longest), n))
        dt[0] = 0.0
        theta = [
            np.clip(item.nominal + PARAMETER_SPREAD * item.scale * rng.standard_normal(), item.lower, item.upper)
            for item in graph.parameters
        ]
        begun = start * (1.0 + START_SPREAD * rng.standard_normal(len(start)))
        inputs = np.zeros((n, len(graph.inputs)))  # that jump at every sample
        for k, item in enumerate(graph.inputs):
            if as_fitted and item.fitted_range is not None:
                inputs[:, k] = rng.uniform(*item.fitted_range, n)
            elif item.unit.text == "percent":
                inputs[:, k] = rng.uniform(max(percent[0], item.lower), percent[1], n)
            else:
                sizes = 10.0 ** rng.uniform(*decades, n)
                values = sizes * rng.choice([-1.0, 1.0], n) if signed else sizes
                inputs[:, k] = [item.unit.to_si(float(value)) for value in values]
        found.append(
            Experiment(
                start=begun,
                inputs=inputs,
                dt=dt,
                theta=np.array(theta),
                implicit=model.reference_implicit,
                onset=onset,
            )
        )
    return tuple(found)


def _step_range(model: StepModel, recursion: Recursion, contents: FloatArray) -> tuple[float, float]:
    """Give the shortest and the longest step that the plant's time constants ask for, in seconds."""
    graph = model.plant.graph
    grid = graph.sample_time if graph.sample_time is not None else 1.0
    n_x = len(model.states)
    nominal = np.array([item.nominal for item in graph.parameters])
    u, z = reference_inputs(model.plant), model.reference_implicit
    point = (contents, z, contents, u, nominal, np.ones(1))
    slope = recursion.misfit(*(item[None] for item in point))[1][0]
    slope = np.where(np.isfinite(slope), slope, 0.0)  # then the step is only less well chosen
    matrix = np.eye(n_x) - slope[:n_x, :n_x]
    if len(z):
        matrix = matrix + slope[:n_x, n_x:] @ np.linalg.lstsq(slope[n_x:, n_x:], slope[n_x:, :n_x], rcond=None)[0]
    speeds = np.abs(np.linalg.eigvals(matrix))
    constants = 1.0 / speeds[(speeds * grid < _FAR) & (speeds * grid > 1.0 / _FAR)]
    if not len(constants):
        constants = np.array([_NO_MODE * grid])
    return _STEP_RANGE[0] * float(constants.min()), _STEP_RANGE[1] * float(constants.max())
