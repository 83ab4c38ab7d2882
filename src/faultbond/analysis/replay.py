"""What a plant can show on a given recording: the same sensitivities with its inputs and its samples.

A recording of at most `MOST_SAMPLES` rows is taken whole. A longer one is looked at twice: as a whole, in blocks of
equal numbers of rows with their mean inputs, which shows what is slow; and the window of consecutive rows in which the
inputs move most, which shows what is fast. Each is a run from a start of its own. Of a block one reading counts, so
what is said of noise is on the safe side.

A start that is off would let the plant settle along the run, and so show what a plant at rest does not show. So it is
fitted to the readings, with the healthy parameters free within their accuracy. Readings that are absent show nothing.
"""

from collections.abc import Sequence
from dataclasses import replace
from math import ceil

import numpy as np

from faultbond.analysis.reading_noise import usual_noise
from faultbond.analysis.sensitivity import (
    Experiment,
    Recursion,
    Sensitivity,
    no_solution,
    sensitivities,
    sensitivity,
    still,
)
from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.spec import root_of
from faultbond.equations.step import StepModel
from faultbond.errors import NoVerdictError, RecordingError

MOST_SAMPLES = 600
_FITS = 3  # steps of least squares towards the start
_WORTH = 0.99  # of the misfit; a step that leaves more of it is the last
_EXACT = 1e-3  # of its usual size, the noise of a sensor that has none


def recorded_runs(
    model: StepModel,
    recursion: Recursion,
    times: FloatArray,
    inputs: FloatArray,
    start: FloatArray,
    readings: FloatArray | None = None,
) -> tuple[Sensitivity, ...]:
    """Give the nominal plant along a recording, one run or two.

    Parameters
    ----------
    model, recursion : the plant
    times : float array, shape (n,), s, rising
    inputs : float array, shape (n, n_inputs), SI; where nan, the value before is held
    start : float array, shape (n_states,), stored quantities before the first row, SI
    readings : float array, shape (n, n_outputs), SI; nan where absent. None: all are there, and the start is right

    Raises
    ------
    RecordingError
        Where an input has no value at all, or there are no rows.
    StructureError
        Where the equations have no finite solution along the way.
    """
    held = _held(model, np.asarray(inputs, dtype=np.float64))
    if len(times) <= MOST_SAMPLES:
        return (_run(recursion, _experiment(model, times, held, start), readings),)
    block = ceil(len(times) / (MOST_SAMPLES // 2))
    first = np.arange(0, len(times), block)
    read = None if readings is None else _means(readings, first)
    whole = _run(recursion, _experiment(model, times[first], _means(held, first), start), read)
    span, length = np.ptp(held, axis=0), MOST_SAMPLES // 2
    moves = np.abs(np.diff(held, axis=0)) / np.where(span > 0, span, 1.0)
    total = np.concatenate([[0.0], np.cumsum(moves.sum(axis=1))])
    begin = int(np.argmax(total[length - 1 :] - total[: len(total) - length + 1]))  # where the inputs move most
    window = slice(begin, begin + length)
    read = None if readings is None else readings[window]
    return whole, _run(recursion, _experiment(model, times[window], held[window], whole.x[begin // block]), read)


def sudden_runs(model: StepModel, recursion: Recursion, runs: Sequence[Sensitivity]) -> tuple[Sensitivity, ...]:
    """Give runs of `recorded_runs` again, for changes that come in their middle, with stores that keep their contents.

    Instruments are among what changes.

    Raises
    ------
    StructureError
        Where the equations have no finite solution along the way.
    """
    found = []
    for run in runs:
        experiment = replace(
            _experiment(model, run.times, run.inputs, run.x[0]), theta=run.theta, onset=len(run.times) // 2
        )
        (again,) = sensitivities(recursion, [experiment], instruments=True)
        if again is None:
            raise no_solution(recursion)
        here = (run.by_theta != 0.0).any(axis=2, keepdims=True) | (run.by_start != 0.0).any(axis=2, keepdims=True)
        found.append(_shown(again, here))
    return tuple(found)


def _means(values: FloatArray, first: IntArray) -> FloatArray:
    """Give the means of the values that are there in blocks of rows that begin at `first`; nan where there is none."""
    here = np.isfinite(values)
    sums = np.add.reduceat(np.where(here, values, 0.0), first, axis=0)
    counts = np.add.reduceat(here.astype(np.float64), first, axis=0)
    return np.where(counts > 0, sums / np.maximum(counts, 1.0), np.nan)


def _run(recursion: Recursion, experiment: Experiment, readings: FloatArray | None) -> Sensitivity:
    """Give a run as its readings show it, from the start that fits them best."""
    run = sensitivity(recursion, experiment)
    if readings is None:
        return run
    move, misfit = _fit(recursion, run, readings)
    for _ in range(_FITS if len(run.states) else 0):
        (moved,) = sensitivities(recursion, [replace(experiment, start=run.x[0] + move)])
        if moved is None:
            break
        move, left = _fit(recursion, moved, readings)
        if left < misfit:
            run = moved
        if not left < _WORTH * misfit:
            break
        misfit = left
    here = np.isfinite(readings)[:, :, None]
    return _shown(run, here)


def _shown(run: Sensitivity, here: BoolArray) -> Sensitivity:
    """Give a run with nothing where no reading is, (n_samples, n_outputs, 1)."""
    return replace(
        run,
        by_theta=still(run.by_theta * here),
        by_start=still(run.by_start * here),
        by_unknown=still(run.by_unknown * here),
    )


def _fit(recursion: Recursion, run: Sensitivity, readings: FloatArray) -> tuple[FloatArray, float]:
    """Give the change of the start that fits the readings best, and the misfit that is left without it.

    Healthy parameters may be off by their accuracy: they are fitted beside, and what they explain is no misfit.
    """
    graph = recursion.plant.graph
    noise = usual_noise(graph.sensors, (run,))
    noise = np.where(noise > 0, noise, _EXACT * np.sqrt(np.mean(run.y**2, axis=0)) + 1e-300)
    accuracies = np.array([item.accuracy for item in graph.parameters])
    parts = root_of(accuracies, graph.correlated) / run.steps[:, None]
    here = np.isfinite(readings)
    off = ((readings - run.y) / noise)[here]
    by_theta = ((run.by_theta / noise[:, None]) @ parts)[here]
    by_start = (run.by_start / noise[:, None])[here]
    free = np.zeros((len(parts), by_start.shape[1]))
    known = np.vstack([by_theta, np.eye(len(parts))])
    off = np.concatenate([off, np.zeros(len(parts))])
    left = off - known @ np.linalg.lstsq(known, off, rcond=None)[0]
    lengths = np.linalg.norm(by_start, axis=0)
    scales = np.where(lengths > 0, lengths, 1.0)
    columns = np.hstack([np.vstack([by_start / scales, free]), known])
    move = np.linalg.lstsq(columns, off, rcond=None)[0][: len(scales)] / scales
    return np.asarray(move), float(left @ left)


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
            raise NoVerdictError(f"no row has a value of the input {item.name}; check its column `{item.column}`")
    last = np.maximum.accumulate(np.where(here, np.arange(len(inputs))[:, None], -1), axis=0)
    last = np.where(last < 0, np.argmax(here, axis=0), last)
    return np.take_along_axis(inputs, last, axis=0)
