"""What sensors show of what they read, and what acts of the inputs that are recorded, faults of them included.

Healthy or not, an instrument gives gain * value + bias + noise, in its own unit, or, while it is stuck, what it gave
before.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.model.graph import Input, Sensor
from faultbond.simulate.truth import Fault, is_there, value_over_time
from faultbond.types import FaultKind

FREE = -1  # not stuck


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Instruments:
    """How sensors, or inputs, are at each row.

    gain, bias, noise : (n, n_items), SI; a gain of a unit whose 0 is elsewhere, as of degC, has its part in the bias
    growth : (n_items,), by how much of its own the noise grows, per SI of what is shown without it
    held : (n, n_items), number of the row whose value stays, `FREE` where the instrument is not stuck
    """

    gain: FloatArray
    bias: FloatArray
    noise: FloatArray
    growth: FloatArray
    held: IntArray

    def show(self, values: FloatArray, draws: FloatArray) -> FloatArray:
        """Give what is shown of all rows, (n, n_items), SI.

        Parameters
        ----------
        values : float array, shape (n, n_items), SI
        draws : float array, shape (n, n_items); standard normal, or 0 for no noise
        """
        shown = self.gain * values + self.bias
        shown = shown + self.noise * np.hypot(1.0, self.growth * shown) * draws
        for row, k in np.argwhere(self.held != FREE):
            shown[row, k] = shown[self.held[row, k], k]
        return np.asarray(shown)

    def show_row(self, row: int, values: FloatArray, draws: FloatArray, before: FloatArray) -> FloatArray:
        """Give what is shown in one row, (n_items,), SI; `before`: what was shown up to it, (n, n_items)."""
        shown = self.gain[row] * values + self.bias[row]
        shown = shown + self.noise[row] * np.hypot(1.0, self.growth * shown) * draws
        for k in np.flatnonzero(self.held[row] != FREE):
            shown[k] = before[self.held[row, k], k]
        return np.asarray(shown)


def instruments(items: Sequence[Sensor | Input], faults: Sequence[Fault], time: FloatArray) -> Instruments:
    """Give how instruments are at the rows.

    Parameters
    ----------
    items : sensors, or inputs
    faults : of any part
    time : float array, shape (n,), s
    """
    shape = (time.size, len(items))
    found = Instruments(
        gain=np.ones(shape),
        bias=np.zeros(shape),
        growth=np.array([item.growth if isinstance(item, Sensor) else 0.0 for item in items]),
        noise=np.tile([item.noise for item in items], (time.size, 1)).reshape(shape),
        held=np.full(shape, FREE, dtype=np.intp),
    )
    for k, item in enumerate(items):
        own = [fault for fault in faults if fault.instrument == item.name]
        for kind, field, healthy in (
            (FaultKind.GAIN, found.gain, 1.0),
            (FaultKind.BIAS, found.bias, 0.0),
            (FaultKind.NOISE, found.noise, item.noise),
        ):
            field[:, k] = value_over_time(
                healthy, [fault for fault in own if fault.kind == kind.value], time, after=True
            )
        found.bias[:, k] += (
            1.0 - found.gain[:, k]
        ) * item.unit.offset  # a gain is of the unit: in degC it is none of kelvin
        for fault in sorted(own, key=lambda fault: fault.start):
            if fault.kind == FaultKind.STUCK.value:
                _stick(found, k, fault, time)
    return found


def _stick(found: Instruments, k: int, fault: Fault, time: FloatArray) -> None:
    """Let an instrument be stuck while the fault is there."""
    there = is_there(fault, time, after=True)
    if fault.value is not None:
        found.gain[there, k], found.noise[there, k], found.bias[there, k] = 0.0, 0.0, fault.value
        found.held[there, k] = FREE
        return
    begins = np.flatnonzero(there & ~np.concatenate([[False], there[:-1]]))
    rows = np.flatnonzero(there)
    last = np.maximum(begins[np.searchsorted(begins, rows, side="right") - 1] - 1, 0)
    found.held[rows, k] = np.where(last < rows, last, FREE)
