"""Rows of a recording in SI, one by one or many at once in arrays."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import IntEnum
from hashlib import sha256
from math import nan
from typing import Any, TypeVar

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import ByteArray, FloatArray, IntArray

A = TypeVar("A", bound=NDArray[Any])


class Quality(IntEnum):
    """How good a source says that a value is; of a bad one there is no number."""

    GOOD = 0
    UNCERTAIN = 1
    BAD = 2


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Row:
    """One row of a recording: time in seconds, u (n_inputs,) and y (n_outputs,) in SI, nan where there is no value.

    saturated: how many sensors were at an end of their range, and inputs beyond theirs; their values are nan. quality:
    a `Quality` for each value, (n_inputs + n_outputs,); None: all are good. arrived: when it came, s since 1970; nan:
    it is not told.
    """

    time: float
    u: FloatArray
    y: FloatArray
    saturated: int = 0
    line: int = 0
    quality: ByteArray | None = None
    arrived: float = nan

    def repeats(self, other: "Row") -> bool:
        """Whether this is the other row once more."""
        same = self.time == other.time and np.array_equal(self.u, other.u, equal_nan=True)
        return same and np.array_equal(self.y, other.y, equal_nan=True)

    def digest(self) -> str:
        """Give what tells this row from others: a clock that was set back repeats times, never a row to a digit."""
        values = np.concatenate([[self.time], self.u, self.y])
        values[np.isnan(values)] = np.nan  # there are many
        return sha256(values.tobytes()).hexdigest()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class RowBlock:
    """Rows one after the other, each as in `Row`.

    time (n_rows,), u (n_rows, n_inputs), y (n_rows, n_outputs); saturated, line: (n_rows,), whole numbers; quality
    (n_rows, n_inputs + n_outputs), or None where all are good; arrived (n_rows,), or None where it is told of none.
    """

    time: FloatArray
    u: FloatArray
    y: FloatArray
    saturated: IntArray
    line: IntArray
    quality: ByteArray | None = None
    arrived: FloatArray | None = None

    def __len__(self) -> int:
        return len(self.time)

    def row(self, k: int) -> Row:
        """Give one of the rows."""
        return Row(
            time=float(self.time[k]),
            u=self.u[k],
            y=self.y[k],
            saturated=int(self.saturated[k]),
            line=int(self.line[k]),
            quality=None if self.quality is None else self.quality[k],
            arrived=nan if self.arrived is None else float(self.arrived[k]),
        )

    def part(self, chosen: slice | IntArray) -> "RowBlock":
        """Give some of the rows: those of a slice, or at some places (n_chosen,)."""
        return RowBlock(
            time=self.time[chosen],
            u=self.u[chosen],
            y=self.y[chosen],
            saturated=self.saturated[chosen],
            line=self.line[chosen],
            quality=None if self.quality is None else self.quality[chosen],
            arrived=None if self.arrived is None else self.arrived[chosen],
        )


def block_of_rows(rows: Sequence[Row]) -> RowBlock:
    """Give rows, one at least, as a block."""
    arrived = np.array([row.arrived for row in rows])
    return RowBlock(
        time=np.array([row.time for row in rows]),
        u=np.array([row.u for row in rows]),
        y=np.array([row.y for row in rows]),
        saturated=np.array([row.saturated for row in rows]),
        line=np.array([row.line for row in rows]),
        quality=_stacked([row.quality for row in rows], [_good((row.u.size + row.y.size,)) for row in rows], np.array),
        arrived=None if np.isnan(arrived).all() else arrived,
    )


def joined_rows(blocks: Sequence[RowBlock]) -> RowBlock:
    """Give the rows of blocks, one at least, as one."""
    if len(blocks) == 1:
        return blocks[0]
    good = [_good((len(item), item.u.shape[1] + item.y.shape[1])) for item in blocks]
    untold = [np.full(len(item), nan) for item in blocks]
    return RowBlock(
        time=np.concatenate([item.time for item in blocks]),
        u=np.concatenate([item.u for item in blocks]),
        y=np.concatenate([item.y for item in blocks]),
        saturated=np.concatenate([item.saturated for item in blocks]),
        line=np.concatenate([item.line for item in blocks]),
        quality=_stacked([item.quality for item in blocks], good, np.concatenate),
        arrived=_stacked([item.arrived for item in blocks], untold, np.concatenate),
    )


def _good(shape: tuple[int, ...]) -> ByteArray:
    return np.full(shape, Quality.GOOD, dtype=np.uint8)


def _stacked(parts: Sequence[A | None], usual: Sequence[A], stack: Callable[[list[A]], A]) -> A | None:
    """Give parts as one, of those that are not told what is usual; None where none is told."""
    if all(part is None for part in parts):
        return None
    return stack([other if part is None else part for part, other in zip(parts, usual, strict=True)])
