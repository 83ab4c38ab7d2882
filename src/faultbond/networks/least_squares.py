"""Static networks with noise: fits over all observations by least squares, and tests of the misfit.

Readings carry the noise of their sensor and, to first order, that of the inputs, in common where they share one.
Healthy parameters have their nominal values. Source: thesis 3.8 (noise on observations); the test is that of the sum
of squares of normal errors.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from scipy.optimize import least_squares
from scipy.special import chdtri

from faultbond.arrays import BoolArray, FloatArray
from faultbond.networks.reader import Reader
from faultbond.networks.static_network import READING, Observation, StaticNetwork

DETECTED = 1e-6  # chance that an observation of the healthy network is taken for a fault
REJECTED = 1e-3  # chance that the true hypothesis is rejected after an observation
EXACT = 1e-9  # relative standard deviation of a reading without noise, beside others with noise
_FARTHEST = 1e15  # largest misfit, and slope, in standard deviations
_LARGEST_SHARE = 1e12  # largest noise from an input, in standard deviations of the sensor
_SINGULAR = 1e-9  # relative; slopes in a direction below it tell nothing
_MOVES = 1e-6  # part of an unknown in such a direction


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """Observations as arrays, nan where missing: u (n_inputs, n), y (n_sensors, n)."""

    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestValues:
    """The best values of free parameters (p,), SI, their sd (inf: not determined), and the sum of squares in sd.

    rank: how many combinations of them the observations determine.
    """

    values: FloatArray
    sd: FloatArray
    misfit: float
    rank: int


def data_of(network: StaticNetwork, rows: Sequence[Observation]) -> Data:
    """Give observations as arrays."""
    nothing = float("nan")
    inputs = [[float(row.values.get(item.name, nothing)) for row in rows] for item in network.graph.inputs]
    readings = [[float(row.values.get(READING + item.name, nothing)) for row in rows] for item in network.graph.sensors]
    return Data(u=np.array(inputs).reshape(-1, len(rows)), y=np.array(readings).reshape(-1, len(rows)))


def ranges_of(network: StaticNetwork, suspects: Sequence[str]) -> tuple[FloatArray, tuple[FloatArray, FloatArray]]:
    """Give the sizes of parameters, and their lowest and highest values, (p,) each, SI."""
    items = [network.graph.parameter(name) for name in suspects]
    bounds = np.array([item.lower for item in items]), np.array([item.upper for item in items])
    return np.array([item.scale for item in items]), bounds


def readable(read: Reader, data: Data) -> BoolArray:
    """Tell which readings say something, (m, n): those measured whose inputs are there."""
    lacking = (read.needs[:, :, None] & ~np.isfinite(data.u)[None, :, :]).any(axis=1)
    return np.asarray(np.isfinite(data.y) & ~lacking)


def whitened(read: Reader, x: FloatArray, data: Data) -> tuple[FloatArray, FloatArray]:
    """Give misfits in their standard deviations (n, m) and slopes by the free values (n, m, p); 0 where unreadable.

    The weights are those of the free values given (effective variance); slopes leave out the slopes of the weights.
    Where free values give no real number, the misfit is that of a reading as far off as can be.

    Parameters
    ----------
    read : the readings as a function
    x : free values (p,)
    data : the observations
    """
    y, by_x, by_u = read(x, data.u)
    there, real = readable(read, data).T, np.isfinite(y).T
    sizes = np.abs(np.nan_to_num(data.y))  # what rounding of a reading is relative to, if not 0
    largest_size = sizes.max(axis=1, initial=0.0, keepdims=True)
    sizes = np.where(sizes > 0.0, sizes, np.where(largest_size > 0.0, largest_size, 1.0))
    own = np.maximum(read.output_noise[:, None], EXACT * sizes).T
    off = np.where(real, data.y.T - np.where(real, y.T, 0.0), np.inf)
    gap = np.where(there, np.clip(off, -_FARTHEST * own, _FARTHEST * own), 0.0)
    slopes, cover = (np.where((there & real)[:, :, None], item, 0.0) for item in (-by_x, by_u))
    slopes = np.clip(np.nan_to_num(slopes), -_FARTHEST * own[:, :, None], _FARTHEST * own[:, :, None])
    largest = _LARGEST_SHARE * own[:, :, None] / np.where(read.input_noise > 0.0, read.input_noise, 1.0)
    cover = np.clip(np.nan_to_num(cover), -largest, largest) * read.input_noise
    # A lower root of the covariance `cover cover' + own^2`, (n, m, m), without its squares, which lose a small own.
    spread = np.concatenate([cover, own[:, :, None] * np.eye(own.shape[1])], axis=2)
    root = np.array(np.linalg.qr(spread.transpose(0, 2, 1), mode="r"), dtype=np.float64).transpose(0, 2, 1)
    return np.asarray(np.linalg.solve(root, gap[:, :, None])[:, :, 0]), np.asarray(np.linalg.solve(root, slopes))


def fit_parameters(
    read: Reader, start: FloatArray, scale: FloatArray, bounds: tuple[FloatArray, FloatArray], data: Data
) -> BestValues:
    """Give the values of the free parameters, the same in all observations, with the least misfit near a start.

    Parameters
    ----------
    read : the readings as a function of the free parameters
    start, scale : values to start from, and their sizes, (p,), SI
    bounds : lowest and highest values, (p,) each, SI
    data : the observations
    """

    def gaps(t: FloatArray) -> FloatArray:
        return whitened(read, t * scale, data)[0].ravel()

    def slopes(t: FloatArray) -> FloatArray:
        return np.asarray((whitened(read, t * scale, data)[1] * scale).reshape(-1, len(start)))

    low, high = np.sort([bounds[0] / scale, bounds[1] / scale], axis=0)
    inside = np.clip(start / scale, low + 1e-9, high - 1e-9)
    done = least_squares(gaps, inside, jac=slopes, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    singular, rows, free = directions(slopes(done.x))
    sd = np.where(free, np.inf, np.sqrt(np.sum((rows / singular[:, None]) ** 2, axis=0)))
    return BestValues(values=done.x * scale, sd=sd * np.abs(scale), misfit=float(2.0 * done.cost), rank=len(singular))


def directions(slopes: FloatArray) -> tuple[FloatArray, FloatArray, BoolArray]:
    """Give what linear equations with these slopes (n, p) determine of their unknowns, to rounding.

    Returns
    -------
    singular, rows, free : (rank,), (rank, p), (p,)
        Singular values, their directions, and whether an unknown can move without changing anything.
    """
    _, found, rows = np.linalg.svd(np.linalg.qr(slopes, mode="r"), full_matrices=True)
    singular = found[found > _SINGULAR * max(found.max(initial=0.0), 1e-300)]
    rank = len(singular)
    return singular, rows[:rank], np.asarray(np.any(np.abs(rows[rank:]) > _MOVES, axis=0))


def limit(chance: float, count: int) -> float:
    """Give the sum of squares of `count` normal errors that is exceeded with a chance; no limit of none."""
    return float(chdtri(count, chance)) if count > 0 else np.inf
