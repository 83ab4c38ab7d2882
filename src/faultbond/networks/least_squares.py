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
_SINGULAR = 1e-9


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Data:
    """Observations as arrays, nan where missing: u (n_inputs, n), y (n_sensors, n)."""

    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class BestValues:
    """The best values of free parameters, their standard deviations (inf: not determined), and the sum of squares.

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
    own = np.maximum(read.output_noise[:, None], EXACT * _sizes(data.y)).T
    off = np.where(real, data.y.T - np.where(real, y.T, 0.0), np.inf)
    gap = np.where(there, np.clip(off, -_FARTHEST * own, _FARTHEST * own), 0.0)
    slopes, cover = (np.where((there & real)[:, :, None], item, 0.0) for item in (-by_x, by_u))
    slopes = np.clip(np.nan_to_num(slopes), -_FARTHEST * own[:, :, None], _FARTHEST * own[:, :, None])
    largest = _LARGEST_SHARE * own[:, :, None] / np.where(read.input_noise > 0.0, read.input_noise, 1.0)
    cover = np.clip(np.nan_to_num(cover), -largest, largest) * read.input_noise
    root = _root(cover, own)
    return np.asarray(np.linalg.solve(root, gap[:, :, None])[:, :, 0]), np.asarray(np.linalg.solve(root, slopes))


def _root(cover: FloatArray, own: FloatArray) -> FloatArray:
    """Give a lower root of the covariance `cover cover' + own^2` (n, m, m) without its squares, which lose a small own.

    Parameters
    ----------
    cover : what the noise of each input does to the readings, (n, m, n_inputs)
    own : noise of the sensors, (n, m)
    """
    spread = np.concatenate([cover, own[:, :, None] * np.eye(own.shape[1])], axis=2)
    upper = np.array(np.linalg.qr(spread.transpose(0, 2, 1), mode="r"), dtype=np.float64)
    return upper.transpose(0, 2, 1)


def _sizes(y: FloatArray) -> FloatArray:
    """Give what a reading's rounding is relative to: its size, else the largest of its sensor."""
    sizes = np.abs(np.nan_to_num(y))
    largest = sizes.max(axis=1, initial=0.0, keepdims=True)
    return np.where(sizes > 0.0, sizes, np.where(largest > 0.0, largest, 1.0))


def fit(
    read: Reader, start: FloatArray, scale: FloatArray, bounds: tuple[FloatArray, FloatArray], data: Data
) -> BestValues:
    """Give the values of the free parameters, the same in all observations, with the least misfit near a start.

    Parameters
    ----------
    read : the readings as a function of the free parameters
    start, scale : values to start from, and their sizes, (p,)
    bounds : lowest and highest values, (p,) each
    data : the observations
    """

    def gaps(t: FloatArray) -> FloatArray:
        return whitened(read, t * scale, data)[0].ravel()

    def slopes(t: FloatArray) -> FloatArray:
        return np.asarray((whitened(read, t * scale, data)[1] * scale).reshape(-1, len(start)))

    low, high = np.sort([bounds[0] / scale, bounds[1] / scale], axis=0)
    inside = np.clip(start / scale, low + 1e-9, high - 1e-9)
    done = least_squares(gaps, inside, jac=slopes, bounds=(low, high), xtol=1e-12, ftol=1e-12, gtol=1e-12)
    sd, rank = _deviations(slopes(done.x))
    return BestValues(values=done.x * scale, sd=sd * np.abs(scale), misfit=float(2.0 * done.cost), rank=rank)


def _deviations(slopes: FloatArray) -> tuple[FloatArray, int]:
    """Give the standard deviations of a linear fit, inf for what the observations leave open, and the rank."""
    _, singular, rows = np.linalg.svd(np.linalg.qr(slopes, mode="r"), full_matrices=True)
    full = np.zeros(slopes.shape[1])
    full[: len(singular)] = singular
    known = full > _SINGULAR * max(full.max(initial=0.0), 1e-300)
    variance = np.sum((rows[known] / full[known, None]) ** 2, axis=0)
    free = np.any(np.abs(rows[~known]) > 1e-6, axis=0)
    return np.asarray(np.where(free, np.inf, np.sqrt(variance))), int(known.sum())


def limit(chance: float, count: int) -> float:
    """Give the sum of squares of `count` normal errors that is exceeded with a chance; no limit of none."""
    return float(chdtri(count, chance)) if count > 0 else np.inf


def contradicting(read: Reader, sensors: Sequence[str], data: Data) -> tuple[str, ...]:
    """Give the sensors that disagree with the healthy network beyond their noise; none where it explains all.

    Parameters
    ----------
    read : the readings of the healthy network, nothing free
    sensors : their names
    data : one observation
    """
    gaps, _ = whitened(read, np.zeros(0), data)
    if float(np.sum(gaps**2)) <= limit(DETECTED, int(readable(read, data).sum())):
        return ()
    alone = [
        Data(u=data.u, y=np.where(np.arange(len(sensors))[:, None] == k, data.y, np.nan)) for k in range(len(sensors))
    ]
    far = np.array([np.abs(whitened(read, np.zeros(0), item)[0]).max() for item in alone])
    wrong = (far > np.sqrt(limit(DETECTED, 1))) | (far == far.max())
    return tuple(name for name, off in zip(sensors, wrong, strict=True) if off)
