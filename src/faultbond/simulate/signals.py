"""Test signals for inputs."""

from collections.abc import Sequence
from math import pi

import numpy as np

from faultbond.arrays import FloatArray


def random_steps(
    time: FloatArray, generator: np.random.Generator, *, low: float, high: float, shortest: float, longest: float
) -> FloatArray:
    """Give steps of random height, each held for a random time.

    Parameters
    ----------
    time : float array, shape (n,), s, increasing
    generator : source of heights and durations
    low, high : range of the heights
    shortest, longest : range of the durations, s

    Returns
    -------
    float array, shape (n,)
    """
    values = np.empty(time.size)
    height, until = 0.0, -np.inf
    for row, moment in enumerate(time):
        if moment >= until:
            height = generator.uniform(low, high)
            until = moment + generator.uniform(shortest, longest)
        values[row] = height
    return values


def sines(time: FloatArray, tones: Sequence[tuple[float, float, float]]) -> FloatArray:
    """Give a sum of sines, shape (n,); each tone is (amplitude, frequency in Hz, phase in rad)."""
    return np.asarray(sum((a * np.sin(2 * pi * f * time + phase) for a, f, phase in tones), np.zeros(time.size)))
