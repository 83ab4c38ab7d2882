"""A grid that goes on from where another one stood gives what one grid gives."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.io.grid import LOOK_BACK, Counts, Grid, GridPoint, Row, on_grid

Told = tuple[int, float, float, float, bool]


@st.composite
def cut_rows(draw: st.DrawFn) -> tuple[list[Row], list[int], float | None]:
    """Rows near grid points with gaps and repeated values, places at which they are cut, and the step."""
    step = draw(st.sampled_from([None, 0.02, 1.0]))
    size = step or 1.0
    steps = draw(st.lists(st.sampled_from([1, 1, 1, 1, 2, 7, 700]), min_size=2, max_size=90))
    # Less than a quarter, since the first row is the origin: no row is as near to one point as to the next.
    off = draw(st.lists(st.floats(-0.24, 0.24), min_size=len(steps), max_size=len(steps)))
    values = draw(st.lists(st.sampled_from([0.1, 0.101, np.nan]), min_size=len(steps), max_size=len(steps)))
    times = (np.cumsum(steps) + np.array(off)) * size
    rows = [Row(time=float(t), u=np.ones(1), y=np.array([y])) for t, y in zip(times, values, strict=True)]
    cuts = draw(st.lists(st.integers(1, len(rows) - 1), max_size=3, unique=True))
    return rows, sorted(cuts), step


def told(points: list[GridPoint]) -> list[Told]:
    """Points as tuples; nan as a number that does not occur."""
    return [(p.index, p.time, p.dt, float(np.nan_to_num(p.y[0], nan=-9.0)), p.resumes) for p in points]


@given(cut_rows(), st.booleans())
def test_cut_rows_give_the_same_points_and_counts(case: tuple[list[Row], list[int], float | None], live: bool) -> None:
    """Wherever the rows are cut, points and counts are those of one grid, to the last bit."""
    rows, cuts, step = case
    whole = Grid(step, live=live, noise=[0.01])
    expected = told(list(on_grid(rows, whole)))
    points: list[Told] = []
    clock = None
    for first, end in zip([0, *cuts], [*cuts, len(rows)], strict=True):
        grid = Grid(step, live=live, noise=[0.01], clock=clock)
        points += told(list(on_grid(rows[first:end], grid)))
        clock = grid.clock
    assert points == expected
    assert clock is not None
    assert clock.counts == whole.counts


@given(cut_rows())
def test_rows_given_again_are_passed_over(case: tuple[list[Row], list[int], float | None]) -> None:
    """A recording that has grown gives only its new rows; the others are counted as duplicates."""
    rows, cuts, step = case
    cut = cuts[0] if cuts else 1
    first = Grid(step)
    list(on_grid(rows[:cut], first))
    again, only = (Grid(step, clock=first.clock) for _ in range(2))
    assert told(list(on_grid(rows, again))) == told(list(on_grid(rows[cut:], only)))
    assert again.counts == replace(only.counts, duplicate=cut)


def test_a_point_is_given_once() -> None:
    """A later row near a point that was given at the cut is not used, however near it is."""
    first = Grid(1.0)
    rows = [Row(time=t, u=np.zeros(0), y=np.zeros(0)) for t in (0.0, 0.7)]
    assert [point.index for point in on_grid(rows, first)] == [0, 1]
    later = [Row(time=t, u=np.zeros(0), y=np.zeros(0)) for t in (1.0, 2.0)]
    second = Grid(1.0, clock=first.clock)
    assert [point.index for point in on_grid(later, second)] == [2]
    assert second.counts == Counts(samples=3, unused=1)


def test_a_live_clock_that_was_set_back() -> None:
    """A stream is not given again: if its rows are all old, its clock was set back, and it begins anew."""
    first = Grid(1.0, live=True)
    list(on_grid([Row(time=1e6 + t, u=np.zeros(0), y=np.zeros(0)) for t in range(5)], first))
    second = Grid(1.0, live=True, clock=first.clock)
    points = list(on_grid([Row(time=float(t), u=np.zeros(0), y=np.zeros(0)) for t in range(30)], second))
    assert [point.resumes for point in points] == [True, *[False] * 29]
    assert (second.counts.clock_jumps, second.counts.duplicate) == (1, 0)


def test_late_rows_after_the_cut() -> None:
    """Rows of before that come among those of after are late, as in one recording."""
    first = Grid(1.0)
    list(on_grid([Row(time=float(t), u=np.zeros(0), y=np.zeros(0)) for t in range(5)], first))
    second = Grid(1.0, clock=first.clock)
    times = (5.0, 3.5, 6.0)
    points = list(on_grid([Row(time=t, u=np.zeros(0), y=np.zeros(0)) for t in times], second))
    assert [point.time for point in points] == [5.0, 6.0]
    assert second.counts.late == 1


def test_before_the_first_point_there_is_nothing_to_go_on_from() -> None:
    """A grid without a row has no clock, and what is kept of one is bounded."""
    assert Grid(1.0).clock is None
    grid = Grid(1.0)
    list(on_grid([Row(time=float(t), u=np.zeros(0), y=np.zeros(0)) for t in range(200)], grid))
    assert grid.clock is not None
    assert len(grid.clock.placed) == LOOK_BACK
    assert grid.clock.last_time == pytest.approx(199.0)
