"""The likelihood of a model, compiled: a shared library that is called through ctypes."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import GenerationError

_LANES = 8  # filters per call of the compiled step


@dataclass(frozen=True, slots=True, eq=False)
class CompiledLikelihood:
    """Filters of a likelihood as compiled C, eight at a time."""

    library: ctypes.CDLL
    n_innovations: int
    compiler: str

    @property
    def title(self) -> str:
        """What it is, in words."""
        return f"compiled C, {_LANES} lanes ({self.compiler})"

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes (n_numbers, n_lanes) over a block of samples (n_samples, n_sample); see `Engine.advance`."""
        n, rows = lanes.shape[1], np.ascontiguousarray(samples, dtype=np.float64)
        padded = -(-n // _LANES) * _LANES
        numbers = np.empty((lanes.shape[0], padded))
        numbers[:, :n] = lanes
        numbers[:, n:] = lanes[:, :1]  # spare lanes repeat the first
        innovations = np.empty((rows.shape[0], self.n_innovations, padded))
        self.library.faultbond_advance(
            ctypes.c_int64(padded),
            ctypes.c_int64(rows.shape[0]),
            ctypes.c_void_p(rows.ctypes.data),
            ctypes.c_void_p(numbers.ctypes.data),
            ctypes.c_void_p(innovations.ctypes.data),
        )
        return np.ascontiguousarray(numbers[:, :n]), innovations[:, :, :n]


def load_likelihood(path: Path, n_innovations: int, compiler: str) -> CompiledLikelihood:
    """Load a compiled likelihood.

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
    return CompiledLikelihood(library, n_innovations, compiler)
