"""What a plant can show on a given recording: the same sensitivities with its inputs and its samples.

A recording of at most `MOST_SAMPLES` rows is taken whole. A longer one is looked at twice: as a whole, in blocks of
equal numbers of rows with their mean inputs, which shows what is slow; and the window of consecutive rows in which the
inputs move most, which shows what is fast. Each is a run from a start of its own. Of a block one reading counts, so
what is said of noise is on the safe side.
"""

from math import ceil

import numpy as np

from faultbond.analysis.sensitivity import Experiment, Recursion, Sensitivity, sensitivity
from faultbond.dynamics.step import StepModel
from faultbond.errors import RecordingError
from faultbond.types import FloatArray

MOST_SAMPLES = 600


def recorded_runs(
    model: StepModel, recursion: Recursion, times: FloatArray, inputs: FloatArray, start: FloatArray
) -> tuple[Sensitivity, ...]:
    """Give the nominal plant along a recording, one run or two.

    Parameters
    ----------
    model, recursion : the plant
    times : float array, shape (n,), s, rising
    inputs : float array, shape (n, n_inputs), SI; where nan, the value before is held
    start : float array, shape (n_states,), stored quantities before the first row, SI

    Raises
    ------
    RecordingError
        Where an input has no value at all, or there are no rows.
    StructureError
        Where the equations have no finite solution along the way.
    """
    held = _held(model, np.asarray(inputs, dtype=np.float64))
    if len(times) <= MOST_SAMPLES:
        return (sensitivity(recursion, _experiment(model, times, held, start)),)
    block = ceil(len(times) / (MOST_SAMPLES // 2))
    first = np.arange(0, len(times), block)
    means = np.add.reduceat(held, first, axis=0) / np.diff(np.append(first, len(times)))[:, None]
    whole = sensitivity(recursion, _experiment(model, times[first], means, start))
    begin = _busiest(held, MOST_SAMPLES // 2)
    window = slice(begin, begin + MOST_SAMPLES // 2)
    there = whole.x[begin // block]
    return whole, sensitivity(recursion, _experiment(model, times[window], held[window], there))


def _experiment(model: StepModel, times: FloatArray, inputs: FloatArray, start: FloatArray) -> Experiment:
    return Experiment(
        start=start,
        inputs=inputs,
        dt=np.diff(times, prepend=times[:1]),
        theta=np.array([item.nominal for item in model.plant.graph.parameters]),
        implicit=model.reference_implicit,
    )


def _held(model: StepModel, inputs: FloatArray) -> FloatArray:
    """Give the inputs with absent values held, those before the first value taken from it."""
    graph = model.plant.graph
    if not len(inputs):
        raise RecordingError(f"{graph.name}: the recording has no rows; give one that has")
    here = np.isfinite(inputs)
    for k, item in enumerate(graph.inputs):
        if not here[:, k].any():
            raise RecordingError(f"no row has a value of the input {item.name}; check its column `{item.column}`")
    last = np.maximum.accumulate(np.where(here, np.arange(len(inputs))[:, None], -1), axis=0)
    last = np.where(last < 0, np.argmax(here, axis=0), last)
    return np.take_along_axis(inputs, last, axis=0)


def _busiest(inputs: FloatArray, length: int) -> int:
    """Give where the window of so many rows begins in which the inputs move most, each relative to its range."""
    span = np.ptp(inputs, axis=0)
    moves = np.abs(np.diff(inputs, axis=0)) / np.where(span > 0, span, 1.0)
    total = np.concatenate([[0.0], np.cumsum(moves.sum(axis=1))])
    return int(np.argmax(total[length - 1 :] - total[: len(total) - length + 1]))
