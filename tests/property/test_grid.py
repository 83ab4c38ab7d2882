"""Laws of the grid, for rows that nobody would write by hand."""

import math
import random
from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.io.grid import LOOK_BACK, Counts, Grid, GridPoint, Row, on_grid

STEPS = st.sampled_from([0.02, 0.5, 1.0, 3.0])


def row(time: float, number: float = 0.0) -> Row:
    """Give a row whose only output is its number."""
    return Row(time=time, u=np.array([1.0]), y=np.array([number]))


def points_of(rows: list[Row], step: float | None, *, live: bool = False) -> tuple[list[tuple[float, ...]], Counts]:
    """Give index, time, dt and values of all points, and the counts."""
    grid = Grid(step, live=live)
    points: list[tuple[float, ...]] = [
        (point.index, point.time, point.dt, float(point.u[0]), float(point.y[0])) for point in on_grid(rows, grid)
    ]
    return points, grid.counts


def same(one: list[tuple[float, ...]], other: list[tuple[float, ...]]) -> bool:
    """Whether two lists of points agree, nan being equal to nan."""
    return np.array_equal(np.array(one), np.array(other), equal_nan=True)


@st.composite
def rising_rows(draw: st.DrawFn) -> tuple[list[Row], float]:
    """Give rows in order of time around a grid: jittered, with gaps, several per step or fewer; and the step."""
    step = draw(STEPS)
    start = draw(st.floats(-1e6, 1e6))
    gaps = draw(st.lists(st.floats(0.05, 4.0), min_size=1, max_size=150))
    times = start + step * np.cumsum(gaps)
    return [row(float(time), float(number)) for number, time in enumerate(times)], step


@st.composite
def clean_rows(draw: st.DrawFn) -> tuple[list[Row], float]:
    """Give rows that sit near their grid points, none missing; and the step."""
    step = draw(STEPS)
    jitter = draw(st.lists(st.floats(-0.4, 0.4), min_size=1, max_size=100))
    jitter[0] = 0.0
    return [row(step * (number + shift), float(number)) for number, shift in enumerate(jitter)], step


@given(rising_rows(), st.randoms(use_true_random=False))
def test_shuffled_rows_give_the_same_points(case: tuple[list[Row], float], chance: random.Random) -> None:
    """A file whose rows lie up to 60 rows from their place gives the points of the sorted file."""
    rows, step = case
    shuffled = list(rows)
    for first in range(0, len(rows), LOOK_BACK + 1):
        block = shuffled[first : first + LOOK_BACK + 1]
        chance.shuffle(block)
        shuffled[first : first + LOOK_BACK + 1] = block
    expected, counts = points_of(rows, step)
    points, other_counts = points_of(shuffled, step)
    assert same(points, expected)
    newest = np.maximum.accumulate([item.time for item in shuffled])
    late = int(sum(item.time < limit for item, limit in zip(shuffled, newest, strict=True)))
    known = (counts.samples, counts.missing, counts.unused)
    assert other_counts == Counts(samples=known[0], missing=known[1], unused=known[2], late=late)


@given(rising_rows())
def test_number_and_times_of_points(case: tuple[list[Row], float]) -> None:
    """Points stand one step apart from the first row to the point nearest to the last one."""
    rows, step = case
    points, counts = points_of(rows, step)
    span = (rows[-1].time - rows[0].time) / step
    assert len(points) == math.floor(span + 0.5) + 1 == counts.samples
    assert [point[0] for point in points] == list(range(len(points)))
    assert [point[1] for point in points] == pytest.approx([rows[0].time + step * k for k in range(len(points))])
    assert [point[2] for point in points] == [0.0] + [step] * (len(points) - 1)


@given(rising_rows())
def test_the_nearest_row_serves(case: tuple[list[Row], float]) -> None:
    """Each point has the row that a search through all rows finds nearest, or nan beyond half a step."""
    rows, step = case
    points, counts = points_of(rows, step)
    times = np.array([item.time for item in rows])
    for _, time, _, _, number in points:
        distance = np.abs(times - time)
        if math.isnan(number):
            assert distance.min() >= 0.5 * step * (1 - 1e-6)
        else:
            assert distance[int(number)] == pytest.approx(distance.min(), abs=1e-6 * step)
            assert distance.min() <= 0.5 * step * (1 + 1e-6)
    assert counts.missing == sum(math.isnan(point[4]) for point in points)


@given(clean_rows())
def test_live_equals_file_on_clean_data(case: tuple[list[Row], float]) -> None:
    """With one row near every point, live and file give the same, and nothing is counted."""
    rows, step = case
    live, live_counts = points_of(rows, step, live=True)
    file, counts = points_of(rows, step)
    assert same(live, file)
    assert live_counts == counts == Counts(samples=len(rows))


@given(clean_rows())
def test_live_gives_each_point_at_once(case: tuple[list[Row], float]) -> None:
    """Live, the point of a row comes with the row."""
    rows, step = case
    grid = Grid(step, live=True)
    for number, item in enumerate(rows):
        points: list[GridPoint] = list(grid.push(item))
        assert [point.index for point in points] == [number]
    assert list(grid.finish()) == []


@given(
    st.lists(st.floats(-1e3, 1e3) | st.sampled_from([math.nan, math.inf, -math.inf, 0.0, 1.0]), max_size=200),
    st.sampled_from([None, 0.5, 7.0]),
    st.booleans(),
)
def test_random_times_never_raise(times: list[float], step: float | None, live: bool) -> None:
    """Any times give points in order between two jumps of the clock, and every row is accounted for at most once."""
    points, counts = points_of([row(time) for time in times], step, live=live)
    readable = [time for time in times if math.isfinite(time)]
    assert counts.untimed == len(times) - len(readable)
    assert counts.samples == len(points)
    assert counts.late + counts.duplicate <= len(readable)
    assert [point[0] for point in points] == list(range(len(points)))
    assert sum(not one[1] < other[1] for one, other in pairwise(points)) <= counts.clock_jumps
    if step is None:
        assert counts.late + counts.duplicate + len(points) >= len(readable)


@given(rising_rows())
def test_variable_steps_are_those_of_the_rows(case: tuple[list[Row], float]) -> None:
    """Without a grid every row is a point, and dt is the true interval."""
    rows, _ = case
    points, counts = points_of(rows, None)
    times = [item.time for item in rows]
    assert [point[1] for point in points] == times
    assert [point[2] for point in points] == [0.0, *np.diff(times)]
    assert counts == Counts(samples=len(rows))


@given(clean_rows(), st.randoms(use_true_random=False), st.booleans())
def test_rows_that_are_absent(case: tuple[list[Row], float], chance: random.Random, live: bool) -> None:
    """Without some of its rows a recording gives the same points, but nan where a row is absent."""
    rows, step = case
    kept = [item for number, item in enumerate(rows) if number in (0, len(rows) - 1) or chance.random() < 0.95]
    points, counts = points_of(kept, step, live=live)
    present = {float(item.y[0]) for item in kept}
    nothing = (math.nan, math.nan)
    whole, _ = points_of(rows, step)
    expected = [(*point[:3], *(point[3:] if point[4] in present else nothing)) for point in whole]
    assert same(points, expected)
    assert counts == Counts(samples=len(rows), missing=len(rows) - len(kept))


@given(st.integers(100, 300), st.floats(75.0, 1e6), STEPS, st.booleans())
def test_a_clock_set_back_loses_nothing(first: int, back: float, step: float, live: bool) -> None:
    """Whenever and however far the clock is set back, each row serves a point, in the order of arrival."""
    times = [step * number for number in range(first)] + [step * (first + number - back) for number in range(100)]
    points, counts = points_of([row(time, float(number)) for number, time in enumerate(times)], step, live=live)
    assert [point[4] for point in points] == list(range(len(times)))
    assert [point[1] for point in points] == pytest.approx(times)
    assert counts == Counts(samples=len(times), clock_jumps=1)


@given(rising_rows(), st.sampled_from([None, 0.5, 7.0]), st.booleans())
def test_every_row_is_accounted_for(case: tuple[list[Row], float], step: float | None, live: bool) -> None:
    """A row in order serves a point or is counted as unused, on any grid."""
    rows, _ = case
    points, counts = points_of(rows, step, live=live)
    assert len(rows) == counts.unused + sum(not math.isnan(point[4]) for point in points)
    assert counts == Counts(samples=len(points), missing=counts.missing, unused=counts.unused)
