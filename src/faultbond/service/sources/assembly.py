"""Rows from values that come one by one.

The policy: values of one source time are one row, and so are those whose times differ by no more than `together`. A row
is complete when every signal has a value in it; a signal that holds takes its last value up to the time of the row,
which waits `settle` since its first value came unless it is known by then. Complete rows go out in the order of their
times, which for a row means to wait for those before it; none waits longer than `patience`, and what lacks then is
missing. What comes later than its row, or twice, is a row of its own: the grid, which takes the rows, judges and counts
them.
"""

import math
from bisect import bisect_left, bisect_right, insort
from collections.abc import Iterable, Sequence
from typing import NamedTuple

from faultbond.io.row_block import Quality

MOST_ROWS = 10_000  # that wait; where there are more, the oldest go out as they are
MOST_HELD = 1_000  # values of a signal that holds, of which the older half is forgotten where there are more
_Held = tuple[float, int, float, Quality]  # time, number of arrival, value, its quality


class RawRow(NamedTuple):
    """Source time, s, the values of the signals, nan where there is none, their qualities, and when the last came."""

    time: float
    values: tuple[float, ...]
    qualities: tuple[Quality, ...]
    came: float


class _Begun:
    """A row that waits. first, last: when its first and its last value came. number: of its begin."""

    __slots__ = ("first", "has", "last", "number", "qualities", "time", "values")

    def __init__(self, time: float, first: float, number: int, n_signals: int) -> None:
        self.time, self.first, self.last, self.number = time, first, first, number
        self.values, self.qualities = [math.nan] * n_signals, [Quality.GOOD] * n_signals
        self.has: set[int] = set()

    def take(self, signal: int, value: float, quality: Quality) -> None:
        self.values[signal], self.qualities[signal] = value, quality
        self.has.add(signal)

    def raw(self) -> RawRow:
        return RawRow(self.time, tuple(self.values), tuple(self.qualities), self.last)


class Assembly:
    """Makes rows of values. It has no clock: what comes, comes with the moment at which it does.

    Parameters
    ----------
    n_signals : how many values a row has
    hold : numbers of the signals that hold; where all do, each value begins a row
    patience : s that a row waits
    together : s by which the times of the values of a row may differ
    settle : s that a complete row waits for what holds
    """

    def __init__(
        self, n_signals: int, *, hold: Sequence[int] = (), patience: float, together: float = 0.0, settle: float = 0.0
    ) -> None:
        self._n, self._patience, self._together = n_signals, patience, together
        self._settle = settle
        self._held: dict[int, list[_Held]] = {k: [] for k in hold}
        self._awaited = frozenset(range(n_signals)) - frozenset(hold)
        self._rows: list[_Begun] = []  # by time, then by number
        self._newest = -math.inf  # time of the newest row that has gone out
        self._untimed: list[RawRow] = []
        self._number = 0

    def add(self, signal: int, value: float, time: float, now: float, quality: Quality = Quality.GOOD) -> None:
        """Take a value of a signal, nan where it is bad, with its source time in s, at a moment in s."""
        self._number += 1
        if not math.isfinite(time):
            alone = _Begun(math.nan, now, self._number, self._n)
            alone.take(signal, value, quality)
            self._untimed.append(alone.raw())
            return
        held = self._held.get(signal)
        if held is not None:
            insort(held, (time, self._number, value, quality))
            if len(held) > MOST_HELD:
                del held[: MOST_HELD // 2]
            if self._awaited:
                return
        row = self._open(signal, time) or self._begin(time, now)
        row.take(signal, value, quality)
        row.last = now

    def forget(self, signals: Iterable[int]) -> None:
        """Forget the last values of signals that hold; those of others are in their rows."""
        for signal in signals:
            if signal in self._held:
                self._held[signal].clear()

    def ready(self, now: float) -> list[RawRow]:
        """Give the rows that go out at a moment."""
        found, left, is_held_up = list[_Begun](), list[_Begun](), False
        surplus = len(self._rows) - MOST_ROWS
        for k, row in enumerate(self._rows):
            is_complete = row.has >= self._awaited and self._is_settled(row, now)
            is_late = row.time <= self._newest
            if k < surplus or now >= row.first + self._patience or (is_complete and (is_late or not is_held_up)):
                found.append(row)
            else:
                left.append(row)
                is_held_up = is_held_up or not is_late
        return self._out(found, left)

    def _is_settled(self, row: _Begun, now: float) -> bool:
        """Whether no value is awaited any more that may hold in a row."""
        return now >= row.first + self._settle or all(held and held[-1][0] >= row.time for held in self._held.values())

    def finish(self) -> list[RawRow]:
        """Give all that waits."""
        return self._out(self._rows, [])

    def _open(self, signal: int, time: float) -> _Begun | None:
        """Give the row that a value belongs to: of its time or, if there is none, of the time that is nearest."""
        reach = self._together
        first = bisect_left(self._rows, time - reach, key=lambda row: row.time)
        last = bisect_right(self._rows, time + reach, key=lambda row: row.time)
        rows = [row for row in self._rows[first:last] if signal not in row.has]
        return min(rows, key=lambda row: (abs(row.time - time), row.number), default=None)

    def _begin(self, time: float, now: float) -> _Begun:
        row = _Begun(time, now, self._number, self._n)
        insort(self._rows, row, key=lambda item: (item.time, item.number))
        return row

    def _out(self, found: Sequence[_Begun], left: list[_Begun]) -> list[RawRow]:
        """Let rows go out, with what holds in them; the others go on waiting."""
        untimed, self._untimed, self._rows = self._untimed, [], left
        rows = list[RawRow]()
        for row in found:
            self._newest = max(self._newest, row.time)
            for signal, held in self._held.items():
                if signal not in row.has:
                    place = bisect_right(held, row.time + self._together, key=lambda item: item[0])
                    if place:
                        row.take(signal, *held[place - 1][2:])
            rows.append(row.raw())
        return untimed + rows
