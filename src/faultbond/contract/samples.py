"""Samples, as methods of diagnosis take them, and what they say of each."""

from dataclasses import dataclass
from enum import Enum

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.contract.findings import Detection, Diagnosis


class Status(Enum):
    """What a method is doing; the value is the message. The core numbers them in this order."""

    WAITING = "waiting for a first value of every input"
    STARTING = "gathering samples to solve the start"
    WARMING = "learning the parameters; alarms are off"
    WATCHING = "watching"
    DIAGNOSING = "a fault was detected; the bank is running"
    LOST = "the healthy filter lost the plant; it starts anew"
    OUTSIDE = "the model does not hold now; nothing is judged"


STATUSES = tuple(Status)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Sample:
    """One grid point: `time` and `dt` since the one before (s), `u` (n_inputs,), `y` (n_outputs,); SI; nan: missing."""

    time: float
    dt: float
    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Samples:
    """A block of n grid points: `time`, `dt` (n,), s; `u` (n, n_inputs), `y` (n, n_outputs), SI; nan: missing."""

    time: FloatArray
    dt: FloatArray
    u: FloatArray
    y: FloatArray

    def __len__(self) -> int:
        return len(self.time)

    @property
    def first(self) -> Sample:
        """The first of them."""
        return Sample(time=float(self.time[0]), dt=float(self.dt[0]), u=self.u[0], y=self.y[0])

    def __getitem__(self, place: slice) -> "Samples":
        return Samples(time=self.time[place], dt=self.dt[place], u=self.u[place], y=self.y[place])


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Report:
    """What one sample brought; nan: nothing yet.

    expected, variance : (n_outputs,), reading of the healthy plant, SI, and variance of the measured one, SI squared
    cusum : (n_outputs,), largest sum of each sensor, in the scale of the slow ones
    slow : (n_slow_errors,), slow errors in declared sd
    wild : values that were refused, or cut, since they lie far beyond all that was seen
    left_out : (n_outputs,), whether the model, or the sensor, does not hold, so that the reading is not judged
    """

    status: Status
    expected: FloatArray
    variance: FloatArray
    cusum: FloatArray
    slow: FloatArray
    left_out: BoolArray
    wild: int = 0
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None

    @property
    def alone(self) -> "Reports":
        """The same as a block of one sample."""
        return Reports(
            status=np.array([STATUSES.index(self.status)], dtype=np.intp),
            wild=np.array([self.wild], dtype=np.intp),
            left_out=self.left_out[None],
            expected=self.expected[None],
            variance=self.variance[None],
            cusum=self.cusum[None],
            slow=self.slow[None],
            detection=self.detection,
            diagnosis=self.diagnosis,
        )


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Reports:
    """What n samples brought, see `Report`; a detection and a diagnosis are of the last of them.

    status, wild : (n,), the former by its place in `STATUSES`
    expected, variance, cusum, left_out : (n, n_outputs)
    slow : (n, n_slow_errors)
    """

    status: IntArray
    wild: IntArray
    expected: FloatArray
    variance: FloatArray
    cusum: FloatArray
    slow: FloatArray
    left_out: BoolArray
    detection: Detection | None = None
    diagnosis: Diagnosis | None = None

    def __len__(self) -> int:
        return len(self.status)

    @property
    def last(self) -> Report:
        """What the last sample brought."""
        return Report(
            status=STATUSES[self.status[-1]],
            expected=self.expected[-1],
            variance=self.variance[-1],
            cusum=self.cusum[-1],
            slow=self.slow[-1],
            left_out=self.left_out[-1],
            wild=int(self.wild[-1]),
            detection=self.detection,
            diagnosis=self.diagnosis,
        )
