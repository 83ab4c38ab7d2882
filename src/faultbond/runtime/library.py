"""A compiled engine as a shared library, called through ctypes; needs numpy only."""

import ctypes
import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import GenerationError

LANES = 8  # filters per call of the compiled step
_ALIGNED = 64  # bytes, at which the memory of a call begins
WORTH = 2_000_000  # numbers of lanes, taken over all samples, that are worth a thread: some 10 ms of work


@dataclass(frozen=True, slots=True, eq=False)
class CompiledEngine:
    """Engine that runs compiled C, eight lanes at a time."""

    library: ctypes.CDLL
    n_innovations: int
    compiler: str
    slot_engine: "CompiledEngine | None" = None
    work_size: int = 0  # bytes of memory that a call needs beside the stack

    @property
    def slot(self) -> "CompiledEngine":
        """The engine of lanes with a slot; itself, if it is that."""
        return self.slot_engine or self

    @property
    def title(self) -> str:
        """What it is, in words."""
        return f"compiled C, {LANES} lanes ({self.compiler})"

    def advance(self, lanes: FloatArray, samples: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Filter all lanes (n_numbers, n_lanes) over a block of samples (n_samples, n_sample); see `Engine.advance`.

        Lanes know nothing of each other, so where they are many, as at the alarm of a large bank, each processor takes
        a part of them, with the same result.
        """
        rows = np.ascontiguousarray(samples, dtype=np.float64)
        calls = -(-lanes.shape[1] // LANES)
        n_threads = min(_processors(), calls, lanes.size * len(rows) // WORTH)
        if n_threads < 2:
            return self._advance(rows, lanes)
        edges = [LANES * (calls * k // n_threads) for k in range(n_threads)]
        parts = [lanes[:, first:last] for first, last in pairwise([*edges, lanes.shape[1]])]
        with ThreadPoolExecutor(n_threads) as pool:
            done = list(pool.map(partial(self._advance, rows), parts))
        following, innovations = zip(*done, strict=True)
        return np.concatenate(following, axis=1), np.concatenate(innovations, axis=2)

    def _advance(self, rows: FloatArray, lanes: FloatArray) -> tuple[FloatArray, FloatArray]:
        n = lanes.shape[1]
        padded = -(-n // LANES) * LANES
        numbers = np.empty((lanes.shape[0], padded))
        numbers[:, :n] = lanes
        numbers[:, n:] = lanes[:, :1]  # spare lanes repeat the first
        innovations = np.empty((rows.shape[0], self.n_innovations, padded))
        memory = np.empty(self.work_size + _ALIGNED, dtype=np.uint8) if self.work_size else None
        self.library.faultbond_advance(
            ctypes.c_int64(padded),
            ctypes.c_int64(rows.shape[0]),
            ctypes.c_void_p(rows.ctypes.data),
            ctypes.c_void_p(numbers.ctypes.data),
            ctypes.c_void_p(innovations.ctypes.data),
            ctypes.c_void_p(memory.ctypes.data + -memory.ctypes.data % _ALIGNED if memory is not None else None),
        )
        return np.ascontiguousarray(numbers[:, :n]), innovations[:, :, :n]


def _processors() -> int:
    """Give the number of processors that this process may use."""
    return len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1


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
    library.faultbond_work_size.restype = ctypes.c_int64
    return CompiledEngine(library, n_innovations, compiler, slot, int(library.faultbond_work_size()))
