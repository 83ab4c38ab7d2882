"""Rows in blocks are put on the grid as they are one by one, wherever they are parted."""

import math
from collections.abc import Callable, Iterable, Iterator
from dataclasses import replace
from itertools import chain, pairwise
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.errors import RecordingError
from faultbond.io import grid as module
from faultbond.io.frozen import Frozen
from faultbond.io.grid import LOOK_BACK, MAX_GAP, Grid, GridPoint, Row
from faultbond.io.row_block import block_of_rows

NOISE = [0.01, 0.3]


@st.composite
def recordings(draw: st.DrawFn) -> list[Row]:
    """Rows that mostly follow each other, in runs long and short, with all that can be wrong between them."""
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    time, times = draw(st.sampled_from([0.0, -7.3, 1.6e9])), list[float]()
    for _ in range(draw(st.integers(1, 5))):
        pace = draw(st.sampled_from([1.0, 1.0, 0.31, 0.5, 2.0, 0.9999, 20.0]))
        absent = draw(st.sampled_from([0.0, 0.0, 0.05]))
        jitter = draw(st.sampled_from([0.0, 0.0, 0.3, 0.7]))
        for _ in range(draw(st.sampled_from([1, 3, 15, 70, 130]))):
            time += pace
            if generator.uniform() < absent:
                continue
            times.append(time + jitter * float(generator.uniform()) * pace)
            if generator.uniform() < absent:  # as if rows had overtaken each other
                times[-2:] = times[:-3:-1]
        time += draw(st.sampled_from([0.0, 0.0, 5.0, -3.0, -30.0, -90.0, -1000.0, MAX_GAP - 1.0, 650.0, 1e5]))
        if draw(st.booleans()) or not times:
            last, first = (times[-1], times[0]) if times else (time, time)
            times.append(draw(st.sampled_from([math.nan, math.inf, last, first, last - 1.5])))
    values = generator.choice([0.0, 0.001, 0.002, 0.5, math.nan], (len(times), 3), p=[0.55, 0.3, 0.05, 0.05, 0.05])
    if draw(st.booleans()):
        values = np.nan_to_num(values)
    held = generator.uniform(size=len(times)) < draw(st.sampled_from([0.0, 0.99]))  # sensors that stand still
    for k in np.flatnonzero(held)[1:]:
        values[k, 1:] = values[k - 1, 1:]
    saturated = generator.integers(0, 2, len(times))
    return [
        Row(time=t, u=values[k, :1], y=values[k, 1:], saturated=int(saturated[k]), line=k + 2)
        for k, t in enumerate(times)
    ]


def said(point: GridPoint) -> tuple[Any, ...]:
    """Give all of a point, nan as itself."""
    return (point.index, point.time, point.dt, point.resumes, point.u.tobytes(), point.y.tobytes())


def standing(grid: Grid) -> Any:
    """Give where a grid stands, and how a later one would go on."""
    clock = grid.clock
    if clock is None:
        return grid.counts
    rows = [(row.time, row.u.tobytes(), row.y.tobytes(), row.saturated, row.line) for row in clock.placed]
    frozen = clock.frozen.tobytes() if clock.frozen is not None else None
    return repr(replace(clock, placed=(), frozen=None)), rows, frozen


def portions(rows: list[Row], cuts: list[int]) -> list[list[Row]]:
    """Give rows in the portions in which they come."""
    edges = [0, *sorted({cut % len(rows) for cut in cuts} - {0}), len(rows)]
    return [rows[first:last] for first, last in pairwise(edges)]


def in_blocks(grid: Grid, rows: list[Row]) -> Iterator[GridPoint]:
    """Give the points of rows that come as a block."""
    return chain.from_iterable(block.points() for block in grid.push_block(block_of_rows(rows)))


def one_by_one(grid: Grid, rows: list[Row]) -> Iterator[GridPoint]:
    """Give the points of rows that come one by one."""
    return chain.from_iterable(map(grid.push, rows))


def given_by(
    grid: Grid, push: Callable[[Grid, list[Row]], Iterator[GridPoint]], parts: list[list[Row]]
) -> tuple[list[Any], str]:
    """Give the points that each portion of rows completes, those of the end, and the error at their end."""
    found: list[Any] = []
    try:
        for part in parts:
            found.append("rows")
            found.extend(map(said, push(grid, part)))
        found.append("end")
        found.extend(map(said, grid.finish()))
    except RecordingError as error:
        return found, str(error)
    return found, ""


@settings(deadline=None)
@given(
    rows=recordings(),
    cuts=st.lists(st.integers(0, 10_000), max_size=6),
    step=st.sampled_from([1.0, 1.0, 0.7, 2.0, None]),
    live=st.booleans(),
    steady=st.booleans(),
    shortest=st.sampled_from([1, 5, 2 * LOOK_BACK]),
    before=st.sampled_from(["nothing", "the first half", "the first half, given again"]),
)
def test_blocks_and_rows_give_the_same_points(
    rows: list[Row], cuts: list[int], step: float | None, live: bool, steady: bool, shortest: int, before: str
) -> None:
    """Points, counts, what is remembered and errors are those of single rows, to the last digit, also after a run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "SHORTEST", shortest)
        patch.setattr(module, "SHORTEST_LIVE", shortest)
        patch.setattr(module, "MAX_FILLED", 2000)
        clock = None
        if before != "nothing":
            earlier, half = Grid(step, live=live, noise=NOISE), len(rows) // 2
            if given_by(earlier, one_by_one, [rows[:half]])[1] == "":
                clock = earlier.clock
                rows = rows if "again" in before else rows[half:]
        one, other = (Grid(step, live=live, steady=steady, noise=NOISE, clock=clock) for _ in range(2))
        parted = portions(rows, cuts)
        assert given_by(one, in_blocks, parted) == given_by(other, one_by_one, parted)
        assert one.counts == other.counts
        assert standing(one) == standing(other)


@pytest.mark.parametrize(("live", "held"), [(False, LOOK_BACK + 1), (True, 0)])
def test_long_recordings_pass_in_blocks(live: bool, held: int, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rows that are in order are not taken one by one, but for the first few; those of a live stream are not held."""
    rows = [Row(time=float(k), u=np.zeros(1), y=np.array([k, -k])) for k in range(5000)]
    taken: list[Row] = []
    push = Grid._push

    def noted(self: Grid, row: Row) -> Iterable[GridPoint]:
        taken.append(row)
        return push(self, row)

    monkeypatch.setattr(Grid, "_push", noted)
    grid = Grid(1.0, noise=NOISE, live=live)
    assert sum(map(len, grid.push_block(block_of_rows(rows)))) == 5000 - held
    assert 0 < len(taken) <= 2 * LOOK_BACK


def test_a_live_stream_in_blocks_that_becomes_fast() -> None:
    """Whether a row waits goes by the pace of the last 60 rows before it, not by that of a block."""
    paces = [*200 * [2.0], *65 * [1.0], 2.0, *20 * [1.0]]
    rows = [Row(time=time, u=np.zeros(1), y=np.zeros(2)) for time in np.cumsum(paces).tolist()]
    one, other = (Grid(1.0, live=True) for _ in range(2))
    parts = [rows[:190], rows[190:266], rows[266:]]  # the row that is late comes last in its portion
    found = given_by(other, one_by_one, parts)
    assert given_by(one, in_blocks, parts) == found


@given(seed=st.integers(0, 2**32 - 1), cuts=st.lists(st.integers(0, 300), max_size=3))
def test_frozen_values_are_counted_alike(seed: int, cuts: list[int]) -> None:
    """Values that stay the same are counted in blocks as they are one by one."""
    generator = np.random.default_rng(seed)
    y = generator.choice([0.0, 0.001, 1.0, np.nan], (300, 2), p=[0.6, 0.05, 0.05, 0.3])
    y[generator.uniform(size=300) < 0.5] = [0.25, np.nan]
    y[150:250, 0] = 0.7
    one, other = Frozen(np.array(NOISE)), Frozen(np.array(NOISE))
    edges = [0, *sorted(set(cuts)), 300]
    total = sum(one.add_block(y[first:last]) for first, last in pairwise(edges) if last > first)
    assert total == sum(other.add(values) for values in y)
    assert np.array_equal(one.memory, other.memory, equal_nan=True)
