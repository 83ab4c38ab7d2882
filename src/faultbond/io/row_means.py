"""Rows averaged for the samples that they are nearest to, in the order of arrival.

A reading that jumps among the rows of one sample, as at the moment at which something breaks, has a mean at which the
plant never was: to the filter it would be far off by what a mean scatters. So it is left out, which costs one sample.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import RowError
from faultbond.io.row_block import Row

TOO_SELDOM = 1.5  # times the stated time between rows that their usual one may be
FIRST_ROWS = 20  # by which it is judged
JUMP = 4.0  # standard deviations by which a jump must explain the rows of a sample better than a straight line does
LEAST_ROWS = 5  # of a sample in which a jump is looked for
SCATTER_ROWS = 1000.0  # over which the scatter from row to row is a mean
KNOWN_ROWS = 100  # from which on it is known well enough for a jump to be seen
_ON_GRID = 1e-6  # of a sample; a row that is so near to its begin is at it
_ROUNDING = 1e-24  # of the square of a value: what is less is no jump


class RowMeans:
    """Gives the mean of the rows about each sample as one row, when the first of the next sample has come.

    An input that stays where it is until the next sample acts between the two: of such a one the mean is that of the
    rows from this sample on up to the next, and the sample is given when that has come. A value that is absent in some
    rows is the mean of the others, and a reading that jumps is absent. A row that is older than the sample which is
    gathered is given as it is, and so is one whose time cannot be read: the grid knows what to do with them.

    Parameters
    ----------
    sample_time : seconds between samples
    row_time : seconds between rows, as the model file states them
    origin : s, time of a sample; None: that of the first row
    held : whether each input stays until the next sample; none where it is empty
    """

    def __init__(
        self, sample_time: float, row_time: float, origin: float | None = None, held: Sequence[bool] = ()
    ) -> None:
        self._held = np.array(held, dtype=bool)
        self._slot = 0  # number of the sample from which on the last rows were gathered
        self._since: list[FloatArray] = []  # inputs of these
        self._made: tuple[Row, ...] = ()  # samples that wait for the mean of what acts until the next one
        self._step, self._row_time = sample_time, row_time
        self._origin = origin
        self._index: int | None = None
        self._rows: list[Row] = []
        self._seen, self._first, self._last = 0, math.nan, -math.inf
        self._scatter: FloatArray | None = None  # variance of each sensor from row to row, and of how many rows
        self._learned: FloatArray | None = None

    def push(self, row: Row) -> Iterable[Row]:
        """Take one row, and give what is complete with it.

        Raises
        ------
        RecordingError
            Where rows come so seldom that their means have more noise than the model file says.
        """
        if not self._held.any():
            return self._gathered(row)
        begins = self._origin is None or self._is_set_back(row)
        found = tuple(self._gathered(row))
        if self._origin is None or (found and found[-1] is row):
            return found
        if begins:
            done, self._made = (*self._acted(math.inf), *found), ()
            self._slot, self._since = 0, [row.u]
            return done
        self._made += found
        slot = math.floor((row.time - self._origin) / self._step + _ON_GRID)
        done = self._acted(self._origin + slot * self._step) if slot > self._slot else ()
        self._since = [*(self._since if slot == self._slot else ()), row.u]
        self._slot = slot
        return done

    def _acted(self, before: float) -> tuple[Row, ...]:
        """Give the samples before a time that wait for what acts until the next one; of whom that is known, with it."""
        done = tuple(item for item in self._made if item.time < before - _ON_GRID * self._step)
        self._made = self._made[len(done) :]
        if not done or not self._since or self._origin is None:
            return done
        mean, begin = _mean(self._since), self._origin + self._slot * self._step
        acts = self._held & np.isfinite(mean)
        return tuple(
            replace(item, u=np.where(acts, mean, item.u)) if abs(item.time - begin) < 0.5 * self._step else item
            for item in done
        )

    def _is_set_back(self, row: Row) -> bool:
        """Whether the clock was set back before a row."""
        return row.time < self._last - self._step * FIRST_ROWS

    def _gathered(self, row: Row) -> Iterable[Row]:
        """Take one row, and give the means about samples that are complete with it."""
        if not math.isfinite(row.time) or row.time == self._last:
            return (row,)
        if self._origin is None:
            self._origin = row.time
        index = math.floor((row.time - self._origin) / self._step + 0.5)
        if self._index is not None and index < self._index:
            if self._is_set_back(row):
                done = self._mean_about()
                self._origin, self._index, self._rows, self._last = row.time, 0, [row], row.time
                return done
            return (row,)
        done = self._mean_about() if index != self._index else ()
        self._index, self._last = index, max(self._last, row.time)
        self._rows = [*self._rows, row]  # a copy of this keeps its own
        self._judge(row)
        return done

    def finish(self) -> tuple[Row, ...]:
        """Give what was gathered last, if there is any."""
        self._made += self._mean_about()
        return self._acted(math.inf)

    def _mean_about(self) -> tuple[Row, ...]:
        """Give the mean of the rows about a sample that were gathered last, if there are any."""
        rows, self._rows = self._rows, []
        if not rows or self._index is None or self._origin is None:
            return ()
        return (
            Row(
                time=self._origin + self._index * self._step,
                u=_mean([row.u for row in rows]),
                y=self._steady(np.array([row.y for row in rows])),
                saturated=sum(row.saturated for row in rows),
                line=rows[0].line,
            ),
        )

    def _steady(self, y: FloatArray) -> FloatArray:
        """Give the mean of readings (n, n_outputs), nan of those that jump by more than their scatter; learn that."""
        found, square = _mean(list(y)), np.diff(y, axis=0) ** 2 / 2.0
        told = np.isfinite(square).sum(axis=0)
        total = np.nansum(square, axis=0)
        if self._scatter is None or self._learned is None:
            self._scatter, self._learned = np.zeros(y.shape[1]), np.zeros(y.shape[1])
        if len(y) >= LEAST_ROWS:
            for j in np.flatnonzero((self._learned >= KNOWN_ROWS) & np.isfinite(y).all(axis=0)):
                if _jump(y[:, j]) > JUMP**2 * max(self._scatter[j], _ROUNDING * found[j] ** 2):
                    found[j] = np.nan  # what is left without the jump teaches: a sensor may have been still for long
                    total[j], told[j] = total[j] - square[:, j].max(), told[j] - 1
        self._learned = self._learned + told
        new = np.divide(total, told, out=self._scatter.copy(), where=told > 0)
        weight = told / np.clip(self._learned, 1.0, SCATTER_ROWS)
        self._scatter = self._scatter + (new - self._scatter) * np.minimum(weight, 1.0)
        return found

    def _judge(self, row: Row) -> None:
        """Refuse a recording whose first rows come too seldom."""
        self._first = row.time if self._seen == 0 else self._first
        self._seen += 1
        usual = (row.time - self._first) / (FIRST_ROWS - 1)
        if self._seen == FIRST_ROWS and usual > TOO_SELDOM * self._row_time:
            raise RowError(
                row.line,
                f"the rows come every {usual:.6g} s, but by the model file every {self._row_time:g} s, so their "
                "means have more noise than it says. Mend `row_time`, or remove it.",
            )


def _jump(y: FloatArray) -> float:
    """Give by how much squares (n,) are less about two levels, of which one follows the other, than about a line."""
    n, apart = len(y), y - y.mean()
    place = np.arange(n) - (n - 1) / 2.0
    by_line = float(place @ apart) ** 2 / float(place @ place)
    first, total = np.cumsum(apart)[:-1], np.arange(1, n)
    by_levels = float(np.max(first**2 * n / (total * (n - total))))
    return by_levels - by_line


def _mean(values: Sequence[FloatArray]) -> FloatArray:
    """Give the mean of the numbers in each column of rows (n,); nan where there is none."""
    table = np.array(values)
    there = np.isfinite(table)
    count = there.sum(axis=0)
    total = np.where(there, table, 0.0).sum(axis=0)
    found: FloatArray = np.divide(total, count, out=np.full(table.shape[1], np.nan), where=count > 0)
    return found
