"""The likelihood of a model, compiled: a shared library that is called through ctypes."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import GenerationError
from faultbond.fit.side_by_side import parts_side_by_side
from faultbond.runtime.core import LANES, padded


@dataclass(frozen=True, slots=True, eq=False)
class CompiledLikelihood:
    """Filters of a plant with given parameters as compiled C, several lanes at a time.

    n_seen : numbers that are told of a sample
    """

    library: ctypes.CDLL
    n_seen: int

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter over a block of samples (n, n_sample); see `Likelihood.advance`.

        lanes : shape (n_numbers, n_lanes)
        """
        n, numbers, rows = lanes.shape[1], padded(lanes), np.ascontiguousarray(samples, dtype=np.float64)
        seen = np.empty((len(rows), self.n_seen, numbers.shape[1]))
        sizes = (ctypes.c_int64(item) for item in (numbers.shape[1], len(rows)))
        shared = (*sizes, *(ctypes.c_void_p(item.ctypes.data) for item in (rows, numbers, seen)))

        def advance_some(first: int) -> None:
            self.library.faultbond_advance(ctypes.c_int64(first), ctypes.c_int64(first + LANES), *shared)

        for _ in parts_side_by_side(advance_some, range(0, numbers.shape[1], LANES)):
            pass
        return np.ascontiguousarray(numbers[:, :n]), seen[:, :, :n]


def load_likelihood(path: Path, n_outputs: int) -> CompiledLikelihood:
    """Load a compiled likelihood of a plant with so many sensors.

    Raises
    ------
    GenerationError
        Where the library cannot be loaded on this machine.
    """
    try:
        library = ctypes.CDLL(str(path))
    except OSError as problem:
        raise GenerationError(f"{path}: the compiled likelihood cannot be loaded ({problem}); remove it") from problem
    library.faultbond_advance.restype = None
    return CompiledLikelihood(library, 2 * n_outputs)
