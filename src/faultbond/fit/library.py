"""The likelihood of a model, compiled: a shared library that is called through ctypes."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import casadi as ca
import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import GenerationError
from faultbond.fit.likelihood import Advanced

_LANES = 8  # of a call, or some times as many: all widths of the compiled step divide it


@dataclass(frozen=True, slots=True, eq=False)
class CompiledLikelihood:
    """Filters of a likelihood as compiled C, several lanes at a time."""

    library: ctypes.CDLL
    n_seen: int
    n_innovations: int

    def advance(self, common: FloatArray, lanes: FloatArray, samples: FloatArray) -> Advanced:
        """Filter over a block of samples (n, n_sample); see `Likelihood.advance`.

        common : shape (n_common,); lanes : shape (n_numbers, n_lanes)
        """
        n, rows = lanes.shape[1], np.ascontiguousarray(samples, dtype=np.float64)
        padded = -(-n // _LANES) * _LANES
        numbers = np.empty((lanes.shape[0], padded))
        numbers[:, :n] = lanes
        numbers[:, n:] = lanes[:, :1]  # spare lanes repeat the first
        after, seen = np.array(common, dtype=np.float64), np.empty((rows.shape[0], self.n_seen))
        innovations = np.empty((rows.shape[0], self.n_innovations, padded))
        self.library.faultbond_advance(
            ctypes.c_int64(padded),
            ctypes.c_int64(rows.shape[0]),
            *(ctypes.c_void_p(item.ctypes.data) for item in (rows, after, seen, numbers, innovations)),
        )
        return Advanced(after, np.ascontiguousarray(numbers[:, :n]), seen, innovations[:, :, :n])


def load_likelihood(path: Path, function: ca.Function) -> CompiledLikelihood:
    """Load a compiled likelihood, `function` as C.

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
    return CompiledLikelihood(library, function.numel_out(1), function.numel_out(3))
