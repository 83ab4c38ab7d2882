"""The same number of filters of the same size, as others write them: FilterPy's, and plain loops that numba compiles.

Each filter predicts, takes the readings and gives their log-likelihood, as ours do. But their model costs nothing:
slopes and expected readings are constant and there before, and nothing is linearised twice. So the filtering alone is
compared, and ours has its model to do besides.
"""

import warnings
from collections.abc import Callable, Sequence
from contextlib import suppress
from importlib import import_module
from math import log, pi
from typing import Any

import numpy as np

from benchmarks.shared.turns import Work
from faultbond.arrays import FloatArray

kalman: Any = None
numba: Any = None
with warnings.catch_warnings():
    warnings.simplefilter("ignore")  # of what they import
    with suppress(ImportError):
        kalman = import_module("filterpy.kalman")
    with suppress(ImportError):
        numba = import_module("numba")

SEED = 8
Sizes = Sequence[tuple[int, int]]  # (number of filters, length of their vector)


def by_filterpy(sizes: Sizes, n_outputs: int, samples: int) -> Work | None:
    """Give the work of some samples on FilterPy's extended Kalman filters; None where it is not installed."""
    if kalman is None:
        return None
    reading, expected = np.zeros(n_outputs), np.zeros(n_outputs)

    def prepare() -> list[tuple[Any, FloatArray]]:
        made = []
        for count, n in sizes:
            transition, slopes = _system(n, n_outputs)
            for _ in range(count):
                one = kalman.ExtendedKalmanFilter(dim_x=n, dim_z=n_outputs)
                one.x, one.F, one.Q, one.R = np.zeros(n), transition, 1e-4 * np.eye(n), np.eye(n_outputs)
                made.append((one, slopes))
        return made

    def run(filters: list[tuple[Any, FloatArray]]) -> float:
        total = 0.0
        for _ in range(samples):
            for one, slopes in filters:
                one.predict()
                one.update(reading, _given, _given, args=(slopes,), hx_args=(expected,))
                total += one.log_likelihood
        return total

    return Work(prepare=prepare, run=run, count=samples)


def by_numba(sizes: Sizes, n_outputs: int, samples: int) -> Work | None:
    """Give the work of some samples on filters in plain loops, compiled by numba; None where it is not installed."""
    if numba is None:
        return None
    kernel: Callable[..., None] = numba.njit(_filters)
    parts = numba.njit(_predict), numba.njit(_update)
    reading = np.zeros(n_outputs)

    def prepare() -> list[tuple[FloatArray, ...]]:
        return [
            (np.zeros((count, n)), np.repeat(np.eye(n)[None], count, axis=0), np.zeros(count), *_system(n, n_outputs))
            for count, n in sizes
        ]

    def run(banks: list[tuple[FloatArray, ...]]) -> None:
        for _ in range(samples):
            for bank in banks:
                kernel(*parts, *bank, reading)

    return Work(prepare=prepare, run=run, count=samples)


def _system(n: int, n_outputs: int) -> tuple[FloatArray, FloatArray]:
    """Give slopes of the step (n, n), stable, and of the readings (n_outputs, n), all of them not zero."""
    generator = np.random.default_rng(SEED)
    return 0.95 * np.eye(n) + generator.normal(0.0, 0.01, (n, n)), generator.normal(0.0, 1.0, (n_outputs, n))


def _given(_: object, value: FloatArray) -> FloatArray:
    return value


def _filters(
    predict: Any, update: Any, x: Any, covariance: Any, likelihood: Any, transition: Any, slopes: Any, reading: Any
) -> None:
    """Take one sample into filters: x (count, n), covariance (count, n, n), likelihood (count,)."""
    count, n = x.shape
    moved, moved_mean, gain = np.empty((n, n)), np.empty(n), np.empty(n)
    for k in range(count):
        predict(x[k], covariance[k], transition, moved, moved_mean)
        likelihood[k] += update(x[k], covariance[k], slopes, reading, gain)


def _predict(x: Any, p: Any, transition: Any, moved: Any, moved_mean: Any) -> None:
    n = len(x)
    for i in range(n):
        total = 0.0
        for j in range(n):
            total += transition[i, j] * x[j]
        moved_mean[i] = total
        for j in range(n):
            total = 0.0
            for m in range(n):
                total += transition[i, m] * p[m, j]
            moved[i, j] = total
    for i in range(n):
        x[i] = moved_mean[i]
        for j in range(i, n):
            total = 1e-4 if i == j else 0.0
            for m in range(n):
                total += moved[i, m] * transition[j, m]
            p[i, j] = p[j, i] = total


def _update(x: Any, p: Any, slopes: Any, reading: Any, gain: Any) -> float:
    """Take the readings, one after the other, of noise 1; give their log-likelihood."""
    n, gained = len(x), 0.0
    for y in range(len(reading)):
        spread, off = 1.0, reading[y]
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += p[i, j] * slopes[y, j]
            gain[i] = total
            off -= slopes[y, i] * x[i]
            spread += slopes[y, i] * total
        for i in range(n):
            x[i] += gain[i] * off / spread
            for j in range(i, n):
                p[i, j] -= gain[i] * gain[j] / spread
                p[j, i] = p[i, j]
        gained -= 0.5 * (off * off / spread + log(2.0 * pi * spread))
    return gained
