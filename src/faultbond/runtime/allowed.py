"""What the numbers of a saved state may be; checked before any of them is used."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import RecordingError

BEGIN_ANEW = "Delete its file to begin anew."
LARGEST = 2.0**52  # whole numbers up to it, and their sums, are exact


@dataclass(frozen=True, slots=True, kw_only=True)
class Allowed:
    """Ends of an array's values; whether they are whole numbers, may be absent (nan), or without end."""

    least: float = -np.inf
    most: float = np.inf
    whole: bool = False
    nan: bool = False
    infinite: bool = False

    def admits(self, values: FloatArray) -> bool:
        """Whether all values (...,) are allowed."""
        unknown, endless = np.isnan(values), np.isinf(values)
        known = values[~unknown]
        fractions = values[~unknown & ~endless] % 1.0 if self.whole else known[:0]
        return bool(
            (self.nan or not unknown.any())
            and (self.infinite or not endless.any())
            and np.all((known >= self.least) & (known <= self.most))
            and not fractions.any()
        )


FINITE = Allowed()
POSITIVE = Allowed(least=0.0)
ANYTHING = Allowed(nan=True, infinite=True)
FLAG = Allowed(least=0.0, most=1.0, whole=True)
COUNT = Allowed(least=0.0, most=LARGEST, whole=True)
COUNT_OR_NONE = Allowed(least=-1.0, most=LARGEST, whole=True)  # -1: not yet


def fitting(
    fresh: Mapping[str, FloatArray], saved: Mapping[str, FloatArray], allowed: Mapping[str, Allowed]
) -> dict[str, FloatArray]:
    """Give saved numbers that are like those of a fresh state.

    Parameters
    ----------
    fresh : all numbers by name, of the right shapes
    saved : what was saved
    allowed : what is allowed, by name; all others are finite

    Raises
    ------
    RecordingError
        Where names or shapes differ, or a number cannot be.
    """
    if {name: values.shape for name, values in fresh.items()} != {name: saved[name].shape for name in saved}:
        raise RecordingError(f"the saved state was made by another version of faultbond. {BEGIN_ANEW}")
    for name, values in saved.items():
        if not allowed.get(name, FINITE).admits(values):
            raise RecordingError(f"the saved state is damaged: {name!r} has a value that no run has. {BEGIN_ANEW}")
    return dict(saved)
