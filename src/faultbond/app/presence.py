"""Which inputs and sensors gave a value, and for how long they gave none: what they would show was not watched then."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.silence import INPUT, SENSOR, Silent

LEAST_SILENCE = 60  # samples without a value that are worth a word
SHARE_OF_SILENCE = 10  # the longest silence is told where it is more than this part of the samples: a tenth
HARDLY = 20  # so is a signal that gave less than this part of the values of the sensor that gave most: a twentieth


def silent_of(
    inputs: Sequence[str], sensors: Sequence[str], u: FloatArray, y: FloatArray, time: FloatArray
) -> tuple[Silent, ...]:
    """Give the sensors, then the inputs, of a recording that gave no value, hardly any, or none for long.

    Parameters
    ----------
    inputs, sensors : names
    u : (n_samples, n_inputs), nan where there is no value
    y : (n_samples, n_sensors), alike
    time : (n_samples,), s
    """
    moved, read = Presence(inputs, INPUT), Presence(sensors, SENSOR)
    told, shown = np.isfinite(u), np.isfinite(y)
    any_value = told.any(axis=1) | shown.any(axis=1)
    moved.add(told[any_value], time[any_value])
    read.add(shown[any_value], time[any_value])
    most = int(read.values.max(initial=0))
    return (*read.silent(most), *moved.silent(most))


class Presence:
    """Counts the values of inputs or of sensors.

    Parameters
    ----------
    names : of the signals
    role : `input` or `sensor`
    """

    def __init__(self, names: Sequence[str], role: str) -> None:
        n = len(names)
        self._names, self._role = tuple(names), role
        self.values: IntArray = np.zeros(n, dtype=np.int64)
        self._samples = 0
        self._last: IntArray = np.full(n, -1)  # sample of the last value
        self._last_time: FloatArray = np.full(n, np.nan)
        self._longest: IntArray = np.zeros(n, dtype=np.int64)  # samples of the longest silence that is over
        self._since: FloatArray = np.full(n, np.nan)  # the times of the values before and after it
        self._until: FloatArray = np.full(n, np.nan)

    def add(self, there: BoolArray, time: FloatArray) -> None:
        """Take samples: whether each signal has a value (n_samples, n), and their times (n_samples,), s.

        Samples without any value of any signal tell of a gap, not of a signal; they are left out before.
        """
        if len(there) == 0:
            return
        if there.all():  # nearly always
            self._end_silence(np.arange(len(self._names)), np.full(len(self._names), self._samples), time[0])
            self._last[:], self._last_time[:] = self._samples + len(there) - 1, time[-1]
        else:
            for k in np.flatnonzero(there.any(axis=0)):
                self._add_signal(int(k), np.flatnonzero(there[:, k]), time)
        self.values += there.sum(axis=0)
        self._samples += len(there)

    def _add_signal(self, k: int, places: IntArray, time: FloatArray) -> None:
        """Take the samples (n_values,) at which a signal has a value."""
        self._end_silence(np.array([k]), np.array([self._samples + places[0]]), time[places[0]])
        silences = np.diff(places) - 1
        if len(silences) and silences.max() > self._longest[k]:
            longest = int(np.argmax(silences))
            self._longest[k] = silences[longest]
            self._since[k], self._until[k] = time[places[longest]], time[places[longest + 1]]
        self._last[k], self._last_time[k] = self._samples + places[-1], time[places[-1]]

    def _end_silence(self, signals: IntArray, at: IntArray, time: float) -> None:
        """End the silence of some signals (n,) at some samples (n,)."""
        longer = at - self._last[signals] - 1 > self._longest[signals]
        chosen = signals[longer]
        self._longest[chosen] = at[longer] - self._last[chosen] - 1
        self._since[chosen], self._until[chosen] = self._last_time[chosen], time

    def silent(self, most: int) -> tuple[Silent, ...]:
        """Give the signals that gave no value, hardly any, or none for long.

        most : values of the sensor that gave most
        """
        return tuple(self._told(k) for k in range(len(self._names)) if self._is_silent(k, most))

    def _is_silent(self, k: int, most: int) -> bool:
        longest = max(int(self._longest[k]), self._samples - 1 - int(self._last[k]))
        is_long = longest > LEAST_SILENCE and longest * SHARE_OF_SILENCE > self._samples
        return self._samples > 0 and (is_long or self.values[k] * HARDLY < max(most, 1))

    def _told(self, k: int) -> Silent:
        ends = self._samples - 1 - self._last[k] >= self._longest[k]  # the longest silence is the one at the end
        since, until = (self._last_time[k], np.nan) if ends else (self._since[k], self._until[k])
        return Silent(
            name=self._names[k],
            role=self._role,
            values=int(self.values[k]),
            samples=self._samples,
            since=None if np.isnan(since) else float(since),
            until=None if np.isnan(until) else float(until),
        )
