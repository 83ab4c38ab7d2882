"""Rows of a recording, put on the grid of times at which the engine steps.

Nothing about a row's time is an error once a recording runs: rows may be missing, late, repeated or between two grid
points, and the clock may be set; each case has one defined outcome that is counted. Source: docs/commands.md.
"""

import heapq
import math
from collections import Counter, deque
from collections.abc import Iterable, Iterator, Sequence
from copy import copy
from dataclasses import asdict, dataclass
from itertools import chain
from typing import TypeVar

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.errors import RecordingError, RowError
from faultbond.io.frozen import Frozen
from faultbond.io.grid_points import GridPoint, PointBlock, blocks_of_points, empty_points
from faultbond.io.row_block import Row, RowBlock, block_of_rows, joined_rows
from faultbond.io.row_means import RowMeans

__all__ = ["Counts", "Grid", "GridClock", "GridPoint", "PointBlock", "Row", "RowBlock", "blocks_of_points", "on_grid"]

LOOK_BACK = 60  # a row of a file may be this many samples late and still be used
PATIENCE = 5  # rows of a live stream that wait, in order, for one that is absent before them
MAX_WAITING = 100_000  # rows held back for sorting, however short their steps are
MAX_GAP = 600  # grid points without a row that are given; after more of them the grid begins anew
MAX_FILLED = 10_000_000  # the same where the clock is steady; more are an error
GAP = 1.5  # usual intervals between two rows beyond which one between them is absent
LATEST = 253402300799.0  # s, in Unix seconds the end of the year 9999; what is beyond was not given in seconds
CLOCK_ROWS = 10  # rows in a row that are too old, and go on from each other: the clock was set back
SHORTEST = 2 * LOOK_BACK  # rows that are worth a block
SHORTEST_LIVE = 5  # the same of a live stream
KEPT_FIRSTS = 20  # recordings, or parts of them, that are known when they are given again
Time = TypeVar("Time", float, FloatArray)


@dataclass(frozen=True, slots=True, kw_only=True)
class Counts:
    """What was passed and what was wrong with it.

    samples: grid points. missing: grid points at which a value is absent or not finite. late: rows older than the
    newest one. duplicate: rows whose time was seen before. untimed: rows whose time cannot be read. unused: rows in
    time whose grid point is served by another. clock_jumps: points that resume after a change of the clock or a long
    gap. saturated: values at an end of their range. frozen: values of sensors that stay the same.
    """

    samples: int = 0
    missing: int = 0
    late: int = 0
    duplicate: int = 0
    untimed: int = 0
    unused: int = 0
    clock_jumps: int = 0
    saturated: int = 0
    frozen: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridClock:
    """Where a grid stands that holds nothing back: enough for a later recording to go on from there.

    counts: what has been passed. placed: the last rows. origin: index and time of the point at which the grid began.
    usual: interval of rows before it began anew. last_index, last_time: of the last point. frozen: (3, n_outputs), what
    is remembered of values that stay the same, see `Frozen`. firsts: digests of the rows with which the last recordings
    began.
    """

    counts: Counts
    placed: tuple[Row, ...]
    origin: tuple[int, float]
    usual: float
    last_index: int
    last_time: float
    frozen: FloatArray | None = None
    firsts: tuple[str, ...] = ()


class Grid:
    """Takes rows in the order of arrival and gives grid points in the order of time.

    From a file, rows are sorted first and the row nearest to a grid point serves it. Live, a row serves its grid point
    at once, and a later row for the same point is not used; only where rows that came without gaps lack one, it waits
    until that has come or is too late. Where the clock was set back, or rows are absent for long, the grid begins anew
    at the next row.

    Parameters
    ----------
    sample_time : seconds between grid points; None steps from row to row
    live : whether a point has to be given as soon as its first row is there and no row before it is absent
    steady : whether the clock is never set: every gap is filled, however long, and rows that are too old are dropped
    noise : standard deviations of the sensors in SI, to count those that are frozen
    clock : where an earlier grid stood, from which this one goes on with the first row that is later; None: anew
    same : with a clock, whether rows go on in the recording of it, as in a log: none is given again, however it begins
    row_time : seconds between rows, of which those about a grid point are averaged; None: none is
    held : with it, whether each input stays until the next grid point, see `RowMeans`
    """

    def __init__(
        self,
        sample_time: float | None,
        *,
        live: bool = False,
        steady: bool = False,
        noise: Sequence[float] = (),
        clock: GridClock | None = None,
        same: bool = False,
        row_time: float | None = None,
        held: Sequence[bool] = (),
    ) -> None:
        if sample_time is not None and not 0.0 < sample_time < math.inf:
            raise RecordingError(f"sample_time is {sample_time:g} s: a grid needs a positive number of seconds.")
        self._step = sample_time
        self._live = live
        self._steady = steady
        self._frozen = Frozen(np.array(noise, dtype=float), clock.frozen if clock else None) if noise else None
        self._tally: Counter[str] = Counter()
        self._waiting: list[tuple[float, int, bool, Row]] = []  # heap of rows not yet placed: time, arrival, late
        self._arrivals = 0
        self._newest = -math.inf
        self._behind: list[Row] = []  # the last rows, if they are too old and go on from each other
        self._placed: deque[Row] = deque(maxlen=LOOK_BACK)  # the last rows placed
        self._times: deque[float] = deque(maxlen=LOOK_BACK)  # their times
        self._origin: tuple[int, float] | None = None  # index and time of the point at which the grid began
        self._usual = 0.0  # interval of rows before the grid began anew
        self._last_index, self._last_time = -1, math.nan
        self._passed = -math.inf  # rows up to this time were passed by an earlier grid
        self._firsts: tuple[str, ...] = clock.firsts if clock else ()
        self._began = same and clock is not None  # whether a row with a time has come
        self._follow, self._n_gaps = (
            clock is not None,
            0,
        )  # whether any row followed another; how often too much was absent
        self.n_rows, self.n_dropped, self.n_again = 0, 0, 0  # taken by this grid; too late; with the time of another
        self._best: tuple[int, float, Row] | None = None  # newest grid point: index, distance and nearest row so far
        self._means: RowMeans | None = None
        if row_time is not None and sample_time is not None:
            self._means = RowMeans(sample_time, row_time, clock.origin[1] if clock else None, held)
        if clock is None:
            return
        self._tally.update(asdict(clock.counts))
        self._placed.extend(clock.placed)
        self._times.extend(row.time for row in clock.placed)
        self._newest = self._times[-1]
        if not self._live:  # a recording that has grown is given again; of a stream, its first row tells that
            self._passed = self._newest
        self._origin, self._usual = clock.origin, clock.usual
        self._last_index, self._last_time = clock.last_index, clock.last_time

    @property
    def clock(self) -> GridClock | None:
        """Where the grid stands, as if nothing were held back; None before the first point."""
        if self._origin is None or self._last_index < 0:
            return None
        return GridClock(
            counts=self.counts,
            placed=tuple(self._placed),
            origin=self._origin,
            usual=self._usual,
            last_index=self._last_index,
            last_time=self._last_time,
            frozen=self._frozen.memory if self._frozen is not None else None,
            firsts=self._firsts,
        )

    @property
    def holds_back(self) -> bool:
        """Whether there are rows that `clock` does not know, but for those of the sample that is being averaged."""
        return bool(self._waiting or self._behind) or self._best is not None

    @property
    def counts(self) -> Counts:
        """What has been passed so far."""
        return Counts(**self._tally)

    def copy(self) -> "Grid":
        """Give another grid that stands where this one does."""
        other = copy(self)
        for name in ("_frozen", "_tally", "_waiting", "_behind", "_placed", "_times", "_means"):
            setattr(other, name, copy(getattr(self, name)))
        return other

    def go_back(self, earlier: "Grid") -> None:
        """Stand where a copy of this grid stands, which is not used any more."""
        self.__dict__ = earlier.__dict__

    def push(self, row: Row) -> Iterable[GridPoint]:
        """Take one row and give the points that are complete with it, often none."""
        if self._means is None:
            return self._push(row)
        return chain.from_iterable([self._push(mean) for mean in self._means.push(row)])

    def _push(self, row: Row) -> Iterable[GridPoint]:
        """Take one row, or the mean of some."""
        if not abs(row.time) <= LATEST:
            self._tally["untimed"] += 1
            return ()
        if not self._began:
            first = row.digest()
            if first in self._firsts:  # the recording is given again: pass over what earlier grids had of it
                self._passed = self._newest
            self._firsts = (*(item for item in self._firsts if item != first), first)[-KEPT_FIRSTS:]
            self._began = True
        if row.time <= self._passed:
            self._tally["duplicate"] += 1
            return ()
        self._passed = -math.inf
        self.n_rows += 1
        if not self._too_old(row):
            self._give_up_behind()
            return self._take(row)
        reach = LOOK_BACK * (self._step or math.inf)
        if self._behind and not 0.0 < row.time - self._behind[-1].time <= reach:  # it does not follow the last one
            self._give_up_behind()
        self._behind.append(row)
        if len(self._behind) < CLOCK_ROWS:
            return ()
        rows, self._behind = self._behind, []  # the clock was set back: the grid begins anew with these rows
        points = [self._release(0, final=True), self._serve_best()]
        self._begin_anew()
        self._newest = -math.inf
        points += [self._take(row) for row in rows]
        return chain.from_iterable(points)

    def push_block(self, rows: RowBlock) -> Iterator[PointBlock]:
        """Take rows and give the points that are complete with them, the same as `push` gives row by row.

        Rows that go on from each other in time are placed together; around all others, and where there is no step, rows
        are taken one by one.
        """
        if self._means is not None:
            means = [mean for k in range(len(rows)) for mean in self._means.push(rows.row(k))]
            if not means:
                return
            rows = block_of_rows(means)
        shortest, others = (SHORTEST_LIVE, PATIENCE + 1) if self._live else (SHORTEST, LOOK_BACK)
        first = 0
        while first < len(rows):
            n_regular = self._count_regular(rows.time[first:]) if len(rows) - first >= shortest else 0
            if n_regular >= shortest:
                last = first + n_regular
                points = self._take_regular(rows.part(slice(first, last)))
                if points is not None:
                    yield points
            else:
                last = min(first + n_regular + others, len(rows))
                one_by_one = (self._push(rows.row(k)) for k in range(first, last))
                yield from blocks_of_points(chain.from_iterable(one_by_one))
            first = last

    def _count_regular(self, time: FloatArray) -> int:
        """Give how many of these rows, (n_rows,), follow all that came before, in order and without too long a gap.

        Of a live stream, those that besides await none that is absent before them.
        """
        waiting = sorted(self._waiting)
        halted = not self._began or self._behind or self._passed > -math.inf or any(late for _, _, late, _ in waiting)
        if halted or self._step is None or self._origin is None or len(waiting) + len(time) > MAX_WAITING:
            return 0
        if not self._newest <= (waiting[-1][0] if waiting else self._times[-1]) or (self._live and waiting):
            return 0
        time = time[: _n_true(np.abs(time) <= LATEST)]
        steps = np.diff(np.concatenate([[self._times[-1], *(item[0] for item in waiting)], time]))
        regular = (steps > 0.0) & ~(steps / self._step - 1.0 > MAX_GAP)
        if self._live:
            regular &= ~self._await(time)
        return max(_n_true(regular) - len(waiting), 0)

    def _await(self, time: FloatArray) -> BoolArray:
        """Whether rows at these times, (n_rows,), would wait as `_awaits` says, if each is placed before the next."""
        every = np.concatenate([self._times, time])
        rows = len(self._times) + np.arange(len(time))
        n_before = np.minimum(rows, LOOK_BACK)
        usual = (every[rows - 1] - every[rows - n_before]) / np.maximum(n_before - 1, 1)
        position = self._position(time, self._origin or (0, 0.0), self._step or 1.0)
        index = np.concatenate([[self._last_index], np.floor(position[:-1] + 0.5)])
        gap = (n_before >= CLOCK_ROWS) & (time - every[rows - 1] > GAP * usual)
        return np.asarray(gap & (position >= np.maximum.accumulate(index) + 1.5))

    def _take_regular(self, rows: RowBlock) -> PointBlock | None:
        """Take rows that follow all that came before, as `_take` and `_release` do one by one."""
        step, keep = self._step or 0.0, 0 if self._live else LOOK_BACK
        self.n_rows += len(rows)
        self._follow = True
        waiting = sorted(self._waiting)
        if waiting:
            rows = joined_rows((block_of_rows([item[3] for item in waiting]), rows))
        newest, n_waiting = float(rows.time[-1]), len(waiting)
        n_settled = int(np.count_nonzero(rows.time <= newest - keep * step))
        n_placed = max(min(n_settled, len(rows) - keep), 0)
        arrivals = range(self._arrivals + 1, self._arrivals + 1 + len(rows) - n_waiting)
        kept = [
            waiting[k] if k < n_waiting else (float(rows.time[k]), arrivals[k - n_waiting], False, rows.row(k))
            for k in range(n_placed, len(rows))
        ]
        self._waiting, self._arrivals, self._newest = kept, self._arrivals + len(arrivals), newest
        return self._place_regular(rows.part(slice(n_placed))) if n_placed else None

    def _place_regular(self, rows: RowBlock) -> PointBlock | None:
        """Assign rows to their grid points, as `_place` does one by one."""
        last = [rows.row(k) for k in range(max(len(rows) - LOOK_BACK, 0), len(rows))]
        self._placed.extend(last)
        self._times.extend(row.time for row in last)
        position = self._position(rows.time, self._origin or (0, 0.0), self._step or 1.0)
        index = np.floor(position + 0.5).astype(np.intp)
        distance = np.abs(position - index)
        n_passed = int(np.searchsorted(index, self._last_index, side="right"))
        self._tally["unused"] += n_passed
        if n_passed == len(rows):
            return None
        rows, index, distance = rows.part(slice(n_passed, None)), index[n_passed:], distance[n_passed:]
        if self._best is not None:
            rows = joined_rows((block_of_rows([self._best[2]]), rows))
            index, distance = np.append(self._best[0], index), np.append(self._best[1], distance)
        chosen = _first_of_each(index) if self._live else _nearest(index, distance)
        self._tally["unused"] += len(index) - len(chosen)
        if not self._live:
            chosen, newest = chosen[:-1], int(chosen[-1])
            self._best = (int(index[newest]), float(distance[newest]), rows.row(newest))
        return self._serve_regular(index[chosen], rows.part(chosen)) if len(chosen) else None

    def _serve_regular(self, index: IntArray, rows: RowBlock) -> PointBlock:
        """Give the points of rows, and the empty ones between, as `_serve` does one by one."""
        first, (began, start), step = self._last_index + 1, self._origin or (0, 0.0), self._step or 0.0
        every = np.arange(first, index[-1] + 1)
        place = index - first
        times, u, y = start + (every - began) * step, rows.u, rows.y
        values = np.full((len(every), u.shape[1]), np.nan), np.full((len(every), y.shape[1]), np.nan)
        values[0][place], values[1][place] = u, y
        resumes = np.zeros(len(every), dtype=bool)
        resumes[place] = (index == began) & (began > 0)
        self._last_index, self._last_time = int(index[-1]), float(times[-1])
        complete = np.isfinite(u).all(axis=1) & np.isfinite(y).all(axis=1)
        self._tally["samples"] += len(every)
        self._tally["missing"] += len(every) - int(complete.sum())
        self._tally["clock_jumps"] += int(resumes.sum())
        self._tally["saturated"] += int(rows.saturated.sum())
        if self._frozen is not None:
            self._tally["frozen"] += self._frozen.add_block(y)
        dt = np.where(every == 0, 0.0, step)
        return PointBlock(index=every, time=times, dt=dt, u=values[0], y=values[1], resumes=resumes)

    def finish(self) -> Iterable[GridPoint]:
        """Give the points that were held back; to be called once, after the last row."""
        rest = [self._push(mean) for mean in self._means.finish()] if self._means is not None else []
        self._give_up_behind()
        return chain(chain.from_iterable(rest), self._release(0, final=True), self._serve_best())

    def _take(self, row: Row) -> Iterable[GridPoint]:
        """Let a row wait for those that may precede it."""
        late = row.time < self._newest
        self._newest = max(self._newest, row.time)
        self._arrivals += 1
        heapq.heappush(self._waiting, (row.time, self._arrivals, late, row))
        return self._release(0 if self._live else LOOK_BACK)

    def _too_old(self, row: Row) -> bool:
        """Whether there is no place for a row any more, and it is not one of the last rows sent again.

        There is none either where a row that waits has its time and other values: the clock may have been set back by
        less than what rows wait to be sorted.
        """
        if self._steady:
            return False
        if row.time < self._newest and any(o.time == row.time and not o.repeats(row) for *_, o in self._waiting):
            return True
        if self._times:
            return row.time < self._times[-1] and not any(row.repeats(other) for other in self._placed)
        n, step = len(self._waiting), self._step
        if step is None:  # the mean interval of the first rows, which all wait
            step = (self._newest - self._waiting[0][0]) / (n - 1) if n >= CLOCK_ROWS else math.inf
        return row.time < self._newest - step * MAX_GAP

    def _give_up_behind(self) -> None:
        """Drop the rows that were too old; they were late after all, or repeats."""
        known = {*self._times, *(row.time for *_, row in self._waiting)}
        for row in self._behind:
            self._tally["duplicate" if row.time in known else "late"] += 1
            self.n_dropped += row.time not in known
        self._behind.clear()

    def _begin_anew(self) -> None:
        """Forget where the grid began; the next row begins it."""
        self._usual = self._interval() or self._usual
        self._placed.clear()
        self._times.clear()
        self._origin = None

    def _release(self, keep: int, *, final: bool = False) -> Iterable[GridPoint]:
        """Place the oldest waiting rows, but keep those that a row yet to come may precede; all if it is `final`."""
        settled = self._newest - keep * (self._step or 0.0)
        points: list[Iterable[GridPoint]] = []
        while len(self._waiting) > keep and (self._waiting[0][0] <= settled or len(self._waiting) > MAX_WAITING):
            if not final and self._awaits(self._waiting[0][0]):
                break
            _, _, late, row = heapq.heappop(self._waiting)
            if row.time in self._times:
                self._tally["duplicate"] += 1
                self.n_again += 1
                continue
            self._tally["late"] += late
            if not self._times or row.time > self._times[-1]:
                points.append(self._place(row))
            else:
                self.n_dropped += 1
        return chain.from_iterable(points) if points else ()

    def _awaits(self, time: float) -> bool:
        """Whether a live row waits for one that is absent before it, as none has been of late."""
        usual = self._interval() if self._live else 0.0
        if not usual or self._step is None or self._origin is None or len(self._waiting) > PATIENCE:
            return False
        gap = time - self._times[-1] > GAP * usual  # a rate below that of the grid leaves points empty, too
        return gap and self._position(time, self._origin, self._step) >= self._last_index + 1.5

    def _place(self, row: Row) -> Iterable[GridPoint]:
        """Assign a row to its grid point; rows come here in the order of time, each time once."""
        before: Iterable[GridPoint] = ()
        if self._origin is not None and self._jumps(row):
            before = self._serve_best()
            self._begin_anew()
        self._placed.append(row)
        self._times.append(row.time)
        if self._origin is None:
            self._origin = (self._last_index + 1, row.time)
        if self._step is None:
            return chain(before, self._serve(self._last_index + 1, row))
        position = self._position(row.time, self._origin, self._step)
        index = math.floor(position + 0.5)
        if index <= self._last_index:
            self._tally["unused"] += 1
            return before
        if self._live:
            return chain(before, self._serve(index, row))
        best, distance = self._best, abs(position - index)  # the nearest row of the newest point may be yet to come
        if best is not None and best[0] == index:
            self._tally["unused"] += 1
        if best is None or best[0] < index or distance < best[1]:
            self._best = (index, distance, row)
        return chain(before, self._serve(best[0], best[2]) if best is not None and best[0] < index else ())

    @staticmethod
    def _position(time: Time, origin: tuple[int, float], step: float) -> Time:
        """Give where a time, or each of some, lies on the grid, in points."""
        return origin[0] + (time - origin[1]) / step

    def _jumps(self, row: Row) -> bool:
        """Whether too much is absent before a row for the gap to be filled."""
        step = self._step or (0.0 if self._steady else self._interval())
        gap = (row.time - self._times[-1]) / step - 1.0 if step else 0.0  # points without a row
        if not gap > MAX_GAP:
            self._follow = True
            return False
        self._n_gaps += 1
        strange = not self._follow and self._n_gaps > CLOCK_ROWS
        if strange or (self._steady and gap > MAX_FILLED):
            raise RowError(
                row.line,
                f"the time jumps from {self._times[-1]:.15g} s to {row.time:.15g} s, more than "
                f"{MAX_GAP if strange else MAX_FILLED:,} samples of {self._step or self._interval():g} s. "
                "Check the unit of the time column and sample_time.",
            )
        return not self._steady

    @property
    def repeats_times(self) -> bool:
        """Whether most rows have the time of another one, and the others are too few for the grid, if there is one."""
        usual, step = self._interval() or self._usual, self._step
        return 2 * self.n_again > self.n_rows and (step is None or usual > GAP * step or not usual)

    def _interval(self) -> float:
        """Give the mean interval of the last rows; 0 as long as they are few."""
        n = len(self._times)
        return (self._times[-1] - self._times[0]) / (n - 1) if n >= CLOCK_ROWS else 0.0

    def _serve_best(self) -> Iterable[GridPoint]:
        """Give the newest point, if it was held back for a nearer row."""
        best, self._best = self._best, None
        return self._serve(best[0], best[2]) if best is not None else ()

    def _serve(self, index: int, row: Row) -> Iterable[GridPoint]:
        """Give the empty points before `index`, if any, and the point of the row."""
        first, (began, start) = self._last_index + 1, self._origin or (0, row.time)
        step, resumes = self._step, index == began > 0
        time = row.time if step is None else start + (index - began) * step
        dt = (self._usual if resumes else time - self._last_time) if step is None else step
        u, y = row.u, row.y
        point = GridPoint(index=index, time=time, dt=dt if index else 0.0, u=u, y=y, resumes=resumes)
        self._last_index, self._last_time = index, time
        complete = bool(np.isfinite(u).all() and np.isfinite(y).all())
        self._tally["samples"] += index - first + 1
        self._tally["missing"] += index - first + (not complete)
        self._tally["clock_jumps"] += resumes
        self._tally["saturated"] += row.saturated
        if self._frozen is not None:
            self._tally["frozen"] += self._frozen.add(y)
        if index == first:
            return (point,)
        times = (start + (k - began) * (step or 0.0) for k in range(first, index))
        return chain(empty_points(first, times, step or 0.0, row), (point,))


def _n_true(flags: BoolArray) -> int:
    """Give how many of the first of some flags, (n,), are true."""
    return len(flags) if flags.all() else int(np.argmin(flags))


def _first_of_each(index: IntArray) -> IntArray:
    """Give, of each run of equal indices, (n_rows,), the place of the first."""
    return np.flatnonzero(np.diff(index, prepend=index[0] - 1))


def _nearest(index: IntArray, distance: FloatArray) -> IntArray:
    """Give, of each run of equal indices, the place of the first with the smallest distance; all (n_rows,)."""
    starts = _first_of_each(index)
    if len(starts) == len(index):
        return starts
    runs = np.repeat(np.arange(len(starts)), np.diff(starts, append=len(index)))
    least = np.flatnonzero(distance == np.minimum.reduceat(distance, starts)[runs])
    return least[np.unique(runs[least], return_index=True)[1]]


def on_grid(rows: Iterable[Row], grid: Grid) -> Iterator[GridPoint]:
    """Give the grid points of all rows; `grid.counts` then tells what was wrong with them."""
    for row in rows:
        yield from grid.push(row)
    yield from grid.finish()
