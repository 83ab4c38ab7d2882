"""Rows of a recording in SI, one by one or many at once in arrays."""

from collections.abc import Sequence
from dataclasses import dataclass
from hashlib import sha256

import numpy as np

from faultbond.arrays import FloatArray, IntArray


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Row:
    """One row of a recording: time in seconds, u (n_inputs,) and y (n_outputs,) in SI, nan where there is no value.

    saturated: how many sensors were at an end of their range, and inputs beyond theirs; their values are nan.
    """

    time: float
    u: FloatArray
    y: FloatArray
    saturated: int = 0
    line: int = 0

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

    time (n_rows,), u (n_rows, n_inputs), y (n_rows, n_outputs); saturated, line: (n_rows,), whole numbers.
    """

    time: FloatArray
    u: FloatArray
    y: FloatArray
    saturated: IntArray
    line: IntArray

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
        )

    def part(self, chosen: slice | IntArray) -> "RowBlock":
        """Give some of the rows: those of a slice, or at some places (n_chosen,)."""
        return RowBlock(
            time=self.time[chosen],
            u=self.u[chosen],
            y=self.y[chosen],
            saturated=self.saturated[chosen],
            line=self.line[chosen],
        )


def block_of_rows(rows: Sequence[Row]) -> RowBlock:
    """Give rows, one at least, as a block."""
    return RowBlock(
        time=np.array([row.time for row in rows]),
        u=np.array([row.u for row in rows]),
        y=np.array([row.y for row in rows]),
        saturated=np.array([row.saturated for row in rows]),
        line=np.array([row.line for row in rows]),
    )


def joined(one: RowBlock, other: RowBlock) -> RowBlock:
    """Give the rows of two blocks as one."""
    return RowBlock(
        time=np.concatenate([one.time, other.time]),
        u=np.concatenate([one.u, other.u]),
        y=np.concatenate([one.y, other.y]),
        saturated=np.concatenate([one.saturated, other.saturated]),
        line=np.concatenate([one.line, other.line]),
    )
