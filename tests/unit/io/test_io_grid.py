"""The grid by example: each case of the recordings page once."""

import math
from time import process_time

import numpy as np
import pytest

from faultbond.errors import RecordingError
from faultbond.io.grid import LOOK_BACK, Counts, Grid, Row, on_grid


def rows(*times: float) -> list[Row]:
    """Give rows at some times; the output is the place in the list."""
    return [
        Row(time=time, u=np.zeros(1), y=np.array([float(place)]), line=place + 2) for place, time in enumerate(times)
    ]


def run(times: list[float], step: float | None = 1.0, *, live: bool = False) -> tuple[list[float], Counts]:
    """Give the output of every point, and the counts."""
    grid = Grid(step, live=live)
    return [float(point.y[0]) for point in on_grid(rows(*times), grid)], grid.counts


def test_a_gap_is_filled_with_nan() -> None:
    """Grid points without a row are there, hold nan, and count as missing."""
    values, counts = run([10.0, 11.0, 14.0])
    assert values == pytest.approx([0.0, 1.0, math.nan, math.nan, 2.0], nan_ok=True)
    assert counts == Counts(samples=5, missing=2)


def test_a_row_lacking_a_value_is_used_and_counted() -> None:
    """A nan in a row makes its point a missing one; the other values stay."""
    grid = Grid(1.0)
    row = Row(time=0.0, u=np.array([5.0]), y=np.array([math.nan, 2.0]))
    (point,) = on_grid([row], grid)
    assert (point.u[0], point.y[1]) == (5.0, 2.0)
    assert grid.counts == Counts(samples=1, missing=1)


def test_the_nearest_of_several_rows_wins_in_a_file() -> None:
    """Of three rows around a point the middle one serves it; live it is the first."""
    times = [0.0, 0.7, 1.1, 1.4, 2.0]
    assert run(times)[0] == [0.0, 2.0, 4.0]
    assert run(times, live=True)[0] == [0.0, 1.0, 4.0]


def test_a_late_row_is_sorted_in_or_dropped() -> None:
    """A file puts a late row in its place, a live stream leaves it out; both count it."""
    times = [0.0, 2.0, 1.0, 3.0]
    assert run(times) == ([0.0, 2.0, 1.0, 3.0], Counts(samples=4, late=1))
    values, counts = run(times, live=True)
    assert values == pytest.approx([0.0, math.nan, 1.0, 3.0], nan_ok=True)
    assert counts == Counts(samples=4, missing=1, late=1)


def test_a_row_beyond_the_look_back_is_dropped() -> None:
    """A row 60 samples late is sorted in, one of 61 is not; both are counted."""
    times = [float(time) for time in range(200)]
    for delay, missing in ((LOOK_BACK, 0), (LOOK_BACK + 1, 1)):
        moved = [time for time in times if time != 100.0]
        moved.insert(100 + delay, 100.0)
        _, counts = run(moved)
        assert counts == Counts(samples=200, missing=missing, late=1)


@pytest.mark.parametrize("live", [False, True])
def test_duplicates(live: bool) -> None:
    """The first row of a time counts; a repeat is a duplicate even when newer rows came between."""
    values, counts = run([0.0, 1.0, 1.0, 2.0, 1.0, 3.0], live=live)
    assert values == [0.0, 1.0, 3.0, 5.0]
    assert counts == Counts(samples=4, duplicate=2)


def test_rows_without_time() -> None:
    """A row whose time is unreadable is left out and counted."""
    values, counts = run([0.0, math.nan, 2.0, math.inf])
    assert values == pytest.approx([0.0, math.nan, 2.0], nan_ok=True)
    assert counts == Counts(samples=3, missing=1, untimed=2)


def test_sorting_reaches_60_samples_when_rows_are_many() -> None:
    """With ten rows a sample, 60 samples are 600 rows, and a row that late is still sorted in."""
    times = [number / 10 for number in range(2000)]
    moved = times[:1000] + times[1001:1590] + [times[1000]] + times[1590:]
    values, counts = run(moved)
    assert counts.late == 1
    assert values[100] == moved.index(100.0)


@pytest.mark.parametrize("live", [False, True])
def test_a_jump_in_time_is_an_error(live: bool) -> None:
    """More than ten million empty points are refused at once, with the line and what to check."""
    begin = process_time()
    with pytest.raises(RecordingError, match=r"line 4: the time jumps from 1 s to 20000000 s.*unit of the time column"):
        run([0.0, 1.0, 2e7], live=live)
    assert process_time() - begin < 5.0


def test_a_huge_time_is_an_error() -> None:
    """Numbers that overflow the index are refused too."""
    with pytest.raises(RecordingError, match="jumps"):
        run([-1e308, 1e308], 1e-3)


def test_points_before_a_jump_are_given_live() -> None:
    """What came before the jump has been given by then."""
    grid = Grid(1.0, live=True)
    points = on_grid(rows(0.0, 1.0, 1e12), grid)
    assert [next(points).index, next(points).index] == [0, 1]
    with pytest.raises(RecordingError, match="jumps"):
        next(points)
    assert grid.counts == Counts(samples=2)


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf])
def test_the_step_is_positive(step: float) -> None:
    """A grid without a positive, finite step is refused."""
    with pytest.raises(RecordingError, match="positive number of seconds"):
        Grid(step)
