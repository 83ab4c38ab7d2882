"""The noise of the sensors along runs: where it grows with the reading, that at the usual size of their readings."""

from collections.abc import Sequence

import numpy as np

from faultbond.analysis.sensitivity import Sensitivity
from faultbond.arrays import FloatArray
from faultbond.model.graph import Sensor


def usual_noise(sensors: Sequence[Sensor], runs: Sequence[Sensitivity]) -> FloatArray:
    """Give the noise of the first outputs of runs, which are these sensors, (n_sensors,), SI."""
    squares = [np.mean(run.y[:, : len(sensors)] ** 2, axis=0) for run in runs if len(run.y)]
    usual = np.sqrt(np.mean(squares, axis=0)) if squares else np.zeros(len(sensors))
    return np.array([item.noise_at(float(size)) for item, size in zip(sensors, usual, strict=True)])
