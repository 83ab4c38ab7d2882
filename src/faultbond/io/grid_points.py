"""Grid points: what the engine takes at each of its steps, one by one or many at once in arrays."""

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import BoolArray, FloatArray, IntArray
from faultbond.errors import RecordingError
from faultbond.io.row_block import Row

MAX_BLOCK = 4096  # points that are made one by one and given together


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class GridPoint:
    """One step of the engine: `dt` seconds after the point before it (0 for the first).

    u (n_inputs,), y (n_outputs,): SI, as in `Row`; nan where there is no value.
    resumes: what was between the point before and this one is not known, as the clock was set or rows are absent for
    too long; `dt` is then one sample.
    """

    index: int
    time: float
    dt: float
    u: FloatArray
    y: FloatArray
    resumes: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class PointBlock:
    """Grid points one after the other, each as in `GridPoint`.

    index, time, dt, resumes: (n_points,); u (n_points, n_inputs), y (n_points, n_outputs).
    """

    index: IntArray
    time: FloatArray
    dt: FloatArray
    u: FloatArray
    y: FloatArray
    resumes: BoolArray

    def __len__(self) -> int:
        return len(self.index)

    def points(self) -> Iterator[GridPoint]:
        """Give them one by one."""
        for k in range(len(self)):
            yield GridPoint(
                index=int(self.index[k]),
                time=float(self.time[k]),
                dt=float(self.dt[k]),
                u=self.u[k],
                y=self.y[k],
                resumes=bool(self.resumes[k]),
            )


def blocks_of_points(points: Iterable[GridPoint]) -> Iterator[PointBlock]:
    """Give points in blocks; those before an error come before it."""
    gathered: list[GridPoint] = []
    try:
        for point in points:
            gathered.append(point)
            if len(gathered) == MAX_BLOCK:
                yield _block_of_points(gathered)
                gathered = []
    except RecordingError:
        if gathered:
            yield _block_of_points(gathered)
        raise
    if gathered:
        yield _block_of_points(gathered)


def _block_of_points(points: Sequence[GridPoint]) -> PointBlock:
    return PointBlock(
        index=np.array([point.index for point in points]),
        time=np.array([point.time for point in points]),
        dt=np.array([point.dt for point in points]),
        u=np.array([point.u for point in points]),
        y=np.array([point.y for point in points]),
        resumes=np.array([point.resumes for point in points]),
    )


def empty_points(first: int, times: Iterable[float], step: float, like: Row) -> Iterator[GridPoint]:
    """Give the points from `first` on at some times, for which there is no row."""
    u, y = np.full_like(like.u, np.nan), np.full_like(like.y, np.nan)
    u.setflags(write=False)
    y.setflags(write=False)
    for index, time in enumerate(times, start=first):
        yield GridPoint(index=index, time=time, dt=step, u=u, y=y)
