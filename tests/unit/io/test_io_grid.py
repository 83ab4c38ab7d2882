"""The grid by example: each case of the recordings page once."""

import math
from time import process_time

import numpy as np
import pytest

from faultbond.errors import RecordingError
from faultbond.io.grid import LATEST, LOOK_BACK, PATIENCE, Counts, Grid, GridPoint, Row, on_grid


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
    """A file puts a late row in its place, a live stream that has just begun leaves it out; both count it."""
    times = [0.0, 2.0, 1.0, 3.0]
    assert run(times) == ([0.0, 2.0, 1.0, 3.0], Counts(samples=4, late=1))
    values, counts = run(times, live=True)
    assert values == pytest.approx([0.0, math.nan, 1.0, 3.0], nan_ok=True)
    assert counts == Counts(samples=4, missing=1, late=1)


@pytest.mark.parametrize("late", [1, PATIENCE])
def test_a_live_stream_waits_for_a_row_that_is_absent(late: int) -> None:
    """Rows after a gap are held until the absent one comes, and then all are given in order."""
    times = [float(time) for time in range(30)]
    times.insert(20 + late, times.pop(20))
    grid = Grid(1.0, live=True)
    given = [[point.time for point in grid.push(row)] for row in rows(*times)]
    assert [len(points) for points in given] == [*[1] * 20, *[0] * late, late + 1, *[1] * (9 - late)]
    assert [time for points in given for time in points] == sorted(times)
    assert grid.counts == Counts(samples=30, late=1)


def test_a_live_stream_gives_up_a_row_that_is_lost() -> None:
    """After five more rows the point is empty, and the row, if it still comes, is late; the end waits for nothing."""
    times = [float(time) for time in range(30) if time != 20]
    times.insert(20 + PATIENCE + 1, 20.0)
    grid = Grid(1.0, live=True)
    given = [len(list(grid.push(row))) for row in rows(*times)]
    assert given == [*[1] * 20, *[0] * PATIENCE, PATIENCE + 2, 0, *[1] * (29 - 20 - PATIENCE - 1)]
    assert list(grid.finish()) == []
    assert grid.counts == Counts(samples=30, missing=1, late=1)
    short = Grid(1.0, live=True)
    assert [point.time for point in on_grid(rows(*times[:23]), short)] == [float(time) for time in range(24)]


def test_a_live_stream_that_is_slower_than_the_grid_is_not_held_up() -> None:
    """Where every second point has no row, none of them is awaited."""
    grid = Grid(1.0, live=True)
    assert [len(list(grid.push(row))) for row in rows(*(2.0 * number for number in range(40)))] == [1, *[2] * 39]


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
    """A row whose time is unreadable, or milliseconds or more that pass for seconds, is left out and counted."""
    values, counts = run([0.0, math.nan, 2.0, math.inf, 1.7e12, -1e18])
    assert values == pytest.approx([0.0, math.nan, 2.0], nan_ok=True)
    assert counts == Counts(samples=3, missing=1, untimed=4)


def test_sorting_reaches_60_samples_when_rows_are_many() -> None:
    """With ten rows a sample, 60 samples are 600 rows, and a row that late is still sorted in."""
    times = [number / 10 for number in range(2000)]
    moved = times[:1000] + times[1001:1590] + [times[1000]] + times[1590:]
    values, counts = run(moved)
    assert counts.late == 1
    assert values[100] == moved.index(100.0)


def points_of(rows: list[Row], step: float | None = 1.0, *, live: bool = False) -> tuple[list[GridPoint], Counts]:
    """Give the points of rows, and the counts."""
    grid = Grid(step, live=live)
    return list(on_grid(rows, grid)), grid.counts


@pytest.mark.parametrize("live", [False, True])
def test_a_gap_is_filled_up_to_600_points(live: bool) -> None:
    """Up to 600 points without a row are given; after more of them the grid begins anew at the next row."""
    points, counts = points_of(rows(0.0, 1.0, 602.0), live=live)
    assert len(points) == 603
    assert counts == Counts(samples=603, missing=600)
    points, counts = points_of(rows(0.0, 1.0, 602.6, 603.6), live=live)
    assert [(point.index, point.time, point.dt, point.resumes) for point in points] == [
        *((0, 0.0, 0.0, False), (1, 1.0, 1.0, False)),
        *((2, 602.6, 1.0, True), (3, 603.6, 1.0, False)),
    ]
    assert counts == Counts(samples=4, clock_jumps=1)


@pytest.mark.parametrize("live", [False, True])
@pytest.mark.parametrize("back", [80.0, 3600.0, 1e9])
def test_a_clock_that_is_set_back(live: bool, back: float) -> None:
    """The grid goes on with the rows of the new clock, none of which is lost; the first point says that it resumes."""
    times = [float(number) for number in range(300)] + [300.5 - back + number for number in range(300)]
    points, counts = points_of(rows(*times), live=live)
    assert [point.y[0] for point in points] == list(range(600))
    assert [point.time for point in points] == times
    assert {point.dt for point in points[1:]} == {1.0}
    assert [point.index for point in points if point.resumes] == [300]
    assert counts == Counts(samples=600, clock_jumps=1)


def test_a_clock_that_is_set_back_a_little() -> None:
    """Live, ten rows behind the newest show it; in a file, rows up to 60 samples back are out of order."""
    times = [float(number) for number in range(100)] + [70.5 + number for number in range(100)]
    assert points_of(rows(*times), live=True)[1] == Counts(samples=200, clock_jumps=1)
    points, counts = points_of(rows(*times))
    assert [point.time for point in points] == [float(number) for number in range(171)]
    assert counts == Counts(samples=171, late=29, unused=29)


@pytest.mark.parametrize("live", [False, True])
def test_an_hour_in_autumn_at_a_row_a_minute(live: bool) -> None:
    """Rows that repeat the times of those before with other values are of a clock that was set back, however little."""
    times = [60.0 * number for number in range(200)] + [60.0 * number for number in range(140, 400)]
    points, counts = points_of(rows(*times), 60.0, live=live)
    assert [point.time for point in points] == times
    assert counts == Counts(samples=460, clock_jumps=1)


def test_single_rows_with_the_time_of_others_are_duplicates() -> None:
    """A few of them are no clock that was set back."""
    times = [float(number) for number in range(100)]
    again = times[:50] + times[30:38] + times[50:]
    points, counts = points_of(rows(*again))
    assert [point.time for point in points] == times
    assert counts == Counts(samples=100, duplicate=8)


@pytest.mark.parametrize("live", [False, True])
def test_nine_old_rows_are_late(live: bool) -> None:
    """Fewer than ten rows that are too old are late, and so are more of them that do not go on from each other."""
    new = [float(number) for number in range(300)]
    apart = [-1e9 + 100.0 * number for number in range(30)]
    for old in ([100.5 + number for number in range(9)], [100.5 - number for number in range(30)], apart):
        points, counts = points_of(rows(*new[:200], *old, *new[200:]), live=live)
        assert [point.time for point in points] == new
        assert counts == Counts(samples=300, late=len(old))


@pytest.mark.parametrize("live", [False, True])
def test_rows_that_are_sent_again(live: bool) -> None:
    """A block of the last rows that comes a second time, with the same values, is no change of the clock."""
    first = rows(*(float(number) for number in range(200)))
    points, counts = points_of([*first[:100], *first[50:100], *first[100:]], live=live)
    assert [point.y[0] for point in points] == list(range(200))
    assert counts == Counts(samples=200, duplicate=50)


def test_a_first_row_with_a_wild_time() -> None:
    """A clock that is wrong at first, before or after the right time, costs one point."""
    for wild in (-1e9, 1e9):
        points, counts = points_of(rows(wild, *(float(number) for number in range(100))))
        assert [point.y[0] for point in points] == list(range(101))
        assert counts == Counts(samples=101, clock_jumps=1)


@pytest.mark.parametrize("live", [False, True])
def test_rows_that_are_too_far_apart(live: bool) -> None:
    """Where no row follows another, the unit of time is wrong: an error that says so, with the line."""
    times = [1000.0 * number for number in range(100)]
    with pytest.raises(RecordingError, match=r"line 1[34]: the time jumps from .* 600 samples of 1 s"):
        run(times, live=live)
    assert run(times[:8], live=live)[1] == Counts(samples=8, clock_jumps=7)
    with pytest.raises(RecordingError, match=r"line 1[34]: the time jumps from .* 600 samples of 1 s"):
        list(on_grid(rows(*times), Grid(1.0, steady=True)))  # not millions of points, each without a value
    later = [*range(50), *times[1:]]
    assert run([float(time) for time in later], live=live)[1] == Counts(samples=149, clock_jumps=99)


def test_a_steady_clock() -> None:
    """Where the clock is steady every gap is filled, up to ten million points at once, and old rows are dropped."""
    grid = Grid(1.0, steady=True)
    assert len(list(on_grid(rows(0.0, 5000.0, *(float(number) for number in range(100, 200))), grid))) == 5001
    begin = process_time()
    with pytest.raises(RecordingError, match=r"line 4: the time jumps from 1 s to 20000000 s.*unit of the time column"):
        list(on_grid(rows(0.0, 1.0, 2e7), Grid(1.0, steady=True)))
    assert process_time() - begin < 5.0
    with pytest.raises(RecordingError, match="jumps"):
        list(on_grid(rows(-LATEST, LATEST), Grid(1e-300, steady=True)))


def test_times_of_any_size() -> None:
    """However far two times lie apart, the grid begins anew; beyond the year 9999 they are none."""
    assert run([-LATEST, LATEST], 1e-300)[1] == Counts(samples=2, clock_jumps=1)
    assert run([-1e308, 1e308], 1e-3)[1] == Counts(untimed=2)


@pytest.mark.parametrize("live", [False, True])
def test_a_variable_grid_resumes(live: bool) -> None:
    """Without a grid, a gap of 600 usual intervals or a clock set back resumes with the usual interval."""
    times = [2.0 * number for number in range(100)]
    far, back = [time + 1e6 for time in times], [time - 1e6 for time in times]
    points, counts = points_of(rows(*times, *far, *back), None, live=live)
    assert [point.index for point in points if point.resumes] == [100, 200]
    assert {point.dt for point in points[1:]} == {2.0}
    assert [point.time for point in points] == [*times, *far, *back]
    assert counts == Counts(samples=300, clock_jumps=2)


@pytest.mark.parametrize("step", [1.0, None])
def test_a_clock_that_is_set_back_at_once(step: float | None) -> None:
    """While all rows still wait to be sorted, too, rows of the new clock are not put before those of the old one."""
    times = [float(number) for number in range(30)] + [number - 3600.0 for number in range(300)]
    points, counts = points_of(rows(*times), step)
    assert [point.time for point in points] == times
    assert counts == Counts(samples=330, clock_jumps=1)


@pytest.mark.parametrize("live", [False, True])
def test_other_sampling_rates(live: bool) -> None:
    """Of rows at twice the rate every second one serves; at half the rate every second point is missing."""
    points, counts = points_of(rows(*(number / 2 for number in range(199))), live=live)
    served = [point.y[0] for point in points]
    assert served == ([0.0, *(2.0 * k - 1 for k in range(1, 100))] if live else [2.0 * k for k in range(100)])
    assert counts == Counts(samples=100, unused=99)
    points, counts = points_of(rows(*(2.0 * number for number in range(100))), live=live)
    assert [point.y[0] for point in points[::2]] == list(range(100))
    assert counts == Counts(samples=199, missing=99)


def test_saturated_values_are_counted() -> None:
    """Values at an end of a range are counted at the points that their rows serve."""
    made = [Row(time=time, u=np.zeros(1), y=np.full(2, np.nan), saturated=2) for time in (0.0, 0.9, 1.0, 2.0)]
    assert points_of(made)[1] == Counts(samples=3, missing=3, unused=1, saturated=6)


@pytest.mark.parametrize("step", [0.0, -1.0, math.nan, math.inf])
def test_the_step_is_positive(step: float) -> None:
    """A grid without a positive, finite step is refused."""
    with pytest.raises(RecordingError, match="positive number of seconds"):
        Grid(step)


def test_a_stream_that_is_given_again() -> None:
    """A live grid that goes on passes over what it had where the first row is the same; else the clock was set back."""
    first = Grid(1.0, live=True)
    times = [float(k) for k in range(200)]
    assert len(list(on_grid(rows(*times[:120]), first))) == 120
    again = Grid(1.0, live=True, clock=first.clock)
    assert [point.time for point in on_grid(rows(*times), again)] == times[120:]
    assert again.counts == Counts(samples=200, duplicate=120)
    other = Grid(1.0, live=True, clock=first.clock)
    points = list(on_grid(rows(*times[1:]), other))  # the values are those of other rows
    assert (len(points), other.counts.clock_jumps) == (199, 1)
