"""Rows of a recording, put on the grid of times at which the engine steps.

Nothing about a row's time is an error: rows may be missing, late, repeated or between two grid points, and each case
has one defined outcome that is counted. Source: docs/commands.md.
"""

import heapq
import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np

from faultbond.errors import RecordingError
from faultbond.types import FloatArray

LOOK_BACK = 60  # a row of a file may be this many samples late and still be used
MAX_WAITING = 100_000  # rows held back for sorting, however short their steps are
MAX_GAP = 10_000_000  # grid points


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Row:
    """One row of a recording: time in seconds, u (n_inputs,) and y (n_outputs,) in SI, nan where there is no value."""

    time: float
    u: FloatArray
    y: FloatArray
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridPoint:
    """One step of the engine: `dt` seconds after the point before it (0 for the first), values as in `Row`."""

    index: int
    time: float
    dt: float
    u: FloatArray
    y: FloatArray


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What was passed and what was wrong with it.

    samples: grid points. missing: grid points at which a value is absent or not finite. late: rows older than the
    newest one. duplicate: rows whose time was seen before. untimed: rows whose time cannot be read.
    """

    samples: int = 0
    missing: int = 0
    late: int = 0
    duplicate: int = 0
    untimed: int = 0


class Grid:
    """Takes rows in the order of arrival and gives grid points in the order of time.

    From a file, rows are sorted first and the row nearest to a grid point serves it. Live, a row serves its grid point
    at once: a later row for the same point is not used, and a late one is dropped.

    Parameters
    ----------
    sample_time : seconds between grid points; None steps from row to row
    live : whether a point has to be given as soon as its first row is there
    """

    def __init__(self, sample_time: float | None, *, live: bool = False) -> None:
        if sample_time is not None and not 0.0 < sample_time < math.inf:
            raise RecordingError(f"sample_time is {sample_time:g} s: a grid needs a positive number of seconds.")
        self._step = sample_time
        self._live = live
        self._tally: Counter[str] = Counter()
        self._waiting: list[tuple[float, int, bool, Row]] = []  # heap of rows not yet placed: time, arrival, late
        self._arrivals = 0
        self._newest = -math.inf
        self._placed: deque[float] = deque(maxlen=LOOK_BACK)  # times of the last rows placed
        self._start = math.nan
        self._last_index = -1
        self._last_time = math.nan
        self._best: tuple[int, float, Row] | None = None  # newest grid point: index, distance and nearest row so far

    @property
    def counts(self) -> Counts:
        """What has been passed so far."""
        return Counts(**self._tally)

    def push(self, row: Row) -> Iterable[GridPoint]:
        """Take one row and give the points that are complete with it, often none."""
        if not math.isfinite(row.time):
            self._tally["untimed"] += 1
            return ()
        late = row.time < self._newest
        self._newest = max(self._newest, row.time)
        self._arrivals += 1
        heapq.heappush(self._waiting, (row.time, self._arrivals, late, row))
        return self._release(0 if self._live else LOOK_BACK)

    def finish(self) -> Iterable[GridPoint]:
        """Give the points that were held back; to be called once, after the last row."""
        points = [self._release(0)]
        if self._best is not None:
            index, _, row = self._best
            points.append(self._serve(index, row))
            self._best = None
        return chain.from_iterable(points)

    def _release(self, keep: int) -> Iterable[GridPoint]:
        """Place the oldest waiting rows, but keep those that a row yet to come may precede."""
        settled = self._newest - keep * (self._step or 0.0)
        points: list[Iterable[GridPoint]] = []
        while len(self._waiting) > keep and (self._waiting[0][0] <= settled or len(self._waiting) > MAX_WAITING):
            _, _, late, row = heapq.heappop(self._waiting)
            if row.time in self._placed:
                self._tally["duplicate"] += 1
                continue
            self._tally["late"] += late
            if not self._placed or row.time > self._placed[-1]:
                self._placed.append(row.time)
                points.append(self._place(row))
        return chain.from_iterable(points) if points else ()

    def _place(self, row: Row) -> Iterable[GridPoint]:
        """Assign a row to its grid point; rows come here in the order of time, each time once."""
        if math.isnan(self._start):
            self._start = row.time
        if self._step is None:
            return self._serve(self._last_index + 1, row)
        position = (row.time - self._start) / self._step
        if not position - max(self._last_index, self._best[0] if self._best else 0) <= MAX_GAP:
            raise RecordingError(self._gap(row))
        index = math.floor(position + 0.5)
        if self._live:
            return self._serve(index, row) if index > self._last_index else ()
        return self._prefer(index, abs(position - index), row)

    def _prefer(self, index: int, distance: float, row: Row) -> Iterable[GridPoint]:
        """Keep the nearest row of the newest grid point; give the point before it once it cannot change any more."""
        best = self._best
        if best is None or best[0] < index or distance < best[1]:
            self._best = (index, distance, row)
        return self._serve(best[0], best[2]) if best is not None and best[0] < index else ()

    def _gap(self, row: Row) -> str:
        """Say that a jump in time is too large to be filled."""
        before = self._placed[-2] if len(self._placed) > 1 else self._start
        where = f"line {row.line}: " if row.line else ""
        return (
            f"{where}the time jumps from {before:.15g} s to {row.time:.15g} s, more than {MAX_GAP:,} samples of "
            f"{self._step:g} s. Check the unit of the time column and sample_time."
        )

    def _serve(self, index: int, row: Row) -> Iterable[GridPoint]:
        """Give the empty points before `index`, if any, and the point of the row."""
        first = self._last_index + 1
        time = row.time if self._step is None else self._start + index * self._step
        dt = (time - self._last_time if self._step is None else self._step) if index > 0 else 0.0
        point = GridPoint(index=index, time=time, dt=dt, u=row.u, y=row.y)
        self._last_index, self._last_time = index, time
        self._tally["samples"] += index - first + 1
        complete = bool(np.isfinite(row.u).all() and np.isfinite(row.y).all())
        self._tally["missing"] += index - first + (not complete)
        if index == first:
            return (point,)
        return chain(_empty_points(first, index, self._start, self._step or 0.0, row), (point,))


def _empty_points(first: int, end: int, start: float, step: float, like: Row) -> Iterator[GridPoint]:
    """Give the points from `first` to before `end`, for which there is no row."""
    u, y = np.full_like(like.u, np.nan), np.full_like(like.y, np.nan)
    u.setflags(write=False)
    y.setflags(write=False)
    for index in range(first, end):
        yield GridPoint(index=index, time=start + index * step, dt=step, u=u, y=y)


def on_grid(rows: Iterable[Row], grid: Grid) -> Iterator[GridPoint]:
    """Give the grid points of all rows; `grid.counts` then tells what was wrong with them."""
    for row in rows:
        yield from grid.push(row)
    yield from grid.finish()
