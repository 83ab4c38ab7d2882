"""A compiled engine as a shared library, called through ctypes; needs numpy only."""

import ctypes
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.errors import GenerationError
from faultbond.types import FloatArray

LANES = 8  # filters per call of the compiled step


@dataclass(frozen=True, slots=True, eq=False)
class CompiledEngine:
    """Engine that runs compiled C, eight lanes at a time."""

    library: ctypes.CDLL
    n_innovations: int
    compiler: str
    slot_engine: "CompiledEngine | None" = None

    @property
    def slot(self) -> "CompiledEngine":
        """The engine of lanes with a slot; itself, if it is that."""
        return self.slot_engine or self

    @property
    def title(self) -> str:
        """What it is, in words."""
        return f"compiled C, {LANES} lanes ({self.compiler})"

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes over a block of samples; see `Engine.advance`."""
        n = lanes.shape[1]
        padded = -(-n // LANES) * LANES
        numbers = np.empty((lanes.shape[0], padded))
        numbers[:, :n] = lanes
        numbers[:, n:] = lanes[:, :1]  # spare lanes repeat the first
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        innovations = np.empty((rows.shape[0], self.n_innovations, padded))
        self.library.faultbond_advance(
            ctypes.c_int64(padded),
            ctypes.c_int64(rows.shape[0]),
            ctypes.c_void_p(rows.ctypes.data),
            ctypes.c_void_p(numbers.ctypes.data),
            ctypes.c_void_p(innovations.ctypes.data),
        )
        return np.ascontiguousarray(numbers[:, :n]), innovations[:, :, :n]


def load_engine(path: Path, n_innovations: int, compiler: str, slot: CompiledEngine | None = None) -> CompiledEngine:
    """Load a compiled engine; `slot` is that of lanes with a slot.

    Raises
    ------
    GenerationError
        Where the library cannot be loaded on this machine.
    """
    try:
        library = ctypes.CDLL(str(path))
    except OSError as problem:
        raise GenerationError(f"{path}: the compiled engine cannot be loaded ({problem}); remove it") from problem
    library.faultbond_advance.restype = None
    return CompiledEngine(library, n_innovations, compiler, slot)
