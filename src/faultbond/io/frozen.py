"""Sensors whose value stays the same to the last digit although they have noise; only counted.

A reading of a healthy sensor repeats itself where its resolution is coarse beside its noise, so a sensor is judged only
once it has shown a step much smaller than its declared noise, and only after many repeats.
"""

import numpy as np

from faultbond.arrays import FloatArray

FROZEN_AFTER = 60  # values one after the other that are the same
FINE = 0.5  # a sensor resolves its noise if it has moved by less than this many standard deviations


class Frozen:
    """Counts the values of sensors that are frozen, those before a sensor was judged so among them.

    Parameters
    ----------
    noise : standard deviation by sensor, shape (n_outputs,), SI; 0 is never judged
    memory : of another one that saw the values before; None: there were none
    """

    def __init__(self, noise: FloatArray, memory: FloatArray | None = None) -> None:
        self._noise = noise
        nothing = np.repeat([[np.nan], [np.inf], [1.0]], len(noise), axis=1)
        self._last, self._finest, same = nothing if memory is None else memory
        self._same = same.astype(np.intp)  # values that are like the last one, itself among them

    @property
    def memory(self) -> FloatArray:
        """What is remembered: last value, finest step, values alike, shape (3, n_outputs)."""
        return np.array([self._last, self._finest, self._same])

    def add(self, y: FloatArray) -> int:
        """Take the values of one point, shape (n_outputs,), SI, and give by how much the count grows."""
        seen = np.isfinite(y)
        moved = np.abs(y - self._last)
        new = seen & ~(moved == 0.0)
        self._finest = np.where(new & (moved > 0.0), np.minimum(self._finest, moved), self._finest)
        self._same = np.where(new, 1, self._same + seen)
        self._last = np.where(seen, y, self._last)
        grown = np.where(self._same == FROZEN_AFTER, FROZEN_AFTER, self._same > FROZEN_AFTER)
        return int((grown * (seen & (self._finest < FINE * self._noise))).sum())

    def add_block(self, y: FloatArray) -> int:
        """Take the values of many points, shape (n_points, n_outputs), as `add` does one after the other."""
        seen = np.isfinite(y)
        values = np.concatenate([self._last[None], y])
        rows = np.arange(len(values))[:, None]
        latest = np.maximum.accumulate(np.where(np.isfinite(values), rows, 0), axis=0)
        held = np.take_along_axis(values, latest, axis=0)  # the last value up to each point
        moved = np.abs(y - held[:-1])
        new = seen & ~(moved == 0.0)
        steps = np.where(new & (moved > 0.0), moved, np.inf)
        finest = np.minimum.accumulate(np.concatenate([self._finest[None], steps]), axis=0)
        n_seen = np.cumsum(seen, axis=0)
        before = np.where(new, n_seen - 1, -self._same)  # values that are not like the present one
        same = n_seen - np.maximum.accumulate(before, axis=0)
        grown = np.where(same == FROZEN_AFTER, FROZEN_AFTER, same > FROZEN_AFTER)
        self._last, self._finest, self._same = held[-1], finest[-1], same[-1]
        return int((grown * (seen & (finest[1:] < FINE * self._noise))).sum())
