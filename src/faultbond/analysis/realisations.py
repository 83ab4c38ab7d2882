"""The detector with many realisations of noise, compiled: a shared library that is called through ctypes."""

import ctypes
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import BoolArray, FloatArray
from faultbond.errors import GenerationError

LANES = 8  # realisations of a call, or some times as many: all widths of the compiled loops divide it


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Realisations:
    """What goes on after each onset without a fault, in m realisations; see `synthesis/realisations.c`.

    noise (w, o, n_outputs, m): innovations, in their sd. slow (w, o, n_slow, m): slow errors that alarm, in declared
    sd; limits (n_slow,): theirs. begun (o, n_outputs, n_sums, m): the sums before. counted, blanked (w, o, n_outputs):
    whether the sums take the value, or forget those before.
    """

    noise: FloatArray
    slow: FloatArray
    limits: FloatArray
    begun: FloatArray
    counted: BoolArray
    blanked: BoolArray


@dataclass(frozen=True, slots=True, eq=False)
class CompiledDetector:
    """The sums of a detector with some limits, of many realisations at once."""

    library: ctypes.CDLL

    def alarms(self, given: Realisations, effects: FloatArray, strayed: FloatArray, factor: FloatArray) -> BoolArray:
        """Give whether each fault c, `factor` times as large, raises the alarm after each onset, (c, o, m).

        Parameters
        ----------
        given : without a fault
        effects : shape (w, c, o, n_outputs), on innovations
        strayed : shape (w, c, o, n_slow), on slow errors
        factor : shape (c, o, m)
        """
        n = factor.shape[2]
        spare = -n % LANES
        size = (*effects.shape, strayed.shape[-1], n + spare)
        found = np.empty((*factor.shape[:2], n + spare), dtype=np.uint8)
        widened = (_widened(item, spare) for item in (factor, given.noise, given.slow, given.begun))
        arrays: list[NDArray[Any]] = [
            np.array(size, dtype=np.int64),
            *(np.ascontiguousarray(item, dtype=np.float64) for item in (effects, strayed, *widened)),
            *(np.ascontiguousarray(item, dtype=np.uint8) for item in (given.counted, given.blanked)),
            np.ascontiguousarray(given.limits, dtype=np.float64),
            found,
        ]
        self.library.faultbond_detector(*(ctypes.c_void_p(item.ctypes.data) for item in arrays))
        return found[:, :, :n].astype(bool)


def _widened(values: FloatArray, spare: int) -> FloatArray:
    """Give the same for so many more realisations, which repeat the last one."""
    return np.concatenate([values, *[values[..., -1:]] * spare], axis=-1)


def load_detector(path: Path) -> CompiledDetector:
    """Load a compiled detector.

    Raises
    ------
    GenerationError
        Where the library cannot be loaded on this machine.
    """
    try:
        library = ctypes.CDLL(str(path))
    except OSError as problem:
        raise GenerationError(f"{path}: the compiled detector cannot be loaded ({problem}); remove it") from problem
    library.faultbond_detector.restype = None
    return CompiledDetector(library)
