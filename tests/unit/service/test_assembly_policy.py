"""The policy by which values become rows, case by case."""

import math

import pytest

from faultbond.io.row_block import Quality
from faultbond.service.sources import assembly as module
from faultbond.service.sources.assembly import Assembly, RawRow


def plain(rows: list[RawRow]) -> list[tuple[float, tuple[float, ...]]]:
    """Times and values of rows whose qualities are of no matter."""
    return [(item.time, item.values) for item in rows]


def test_a_signal_that_holds_takes_its_last_value_up_to_the_row() -> None:
    """Also where that comes later than the row is complete, and not one that is of a later time."""
    assembly = Assembly(2, hold=[0], patience=1.0)
    assembly.add(1, 10.0, 0.0, 0.0)
    assert repr(plain(assembly.ready(0.0))) == "[(0.0, (nan, 10.0))]"
    assembly.add(0, 5.0, 1.0, 0.0)
    assembly.add(0, 7.0, 3.0, 0.0)
    assert assembly.ready(0.0) == []
    for time in (1.0, 2.0, 3.0):
        assembly.add(1, time, time, 0.1)
    assert plain(assembly.ready(0.1)) == [(1.0, (5.0, 1.0)), (2.0, (5.0, 2.0)), (3.0, (7.0, 3.0))]
    assembly.add(0, math.nan, 4.0, 0.2)  # bad until a good one comes
    assembly.add(1, 5.0, 5.0, 0.2)
    assert math.isnan(plain(assembly.ready(0.2))[0][1][0])


def test_where_all_hold_each_value_is_a_row() -> None:
    """Values on change only are still rows, with the last of the others."""
    assembly = Assembly(2, hold=[0, 1], patience=1.0)
    assembly.add(0, 1.0, 0.0, 0.0)
    assembly.add(1, 2.0, 0.0, 0.0)
    assembly.add(0, 3.0, 4.0, 0.0)
    assert plain(assembly.ready(0.0)) == [(0.0, (1.0, 2.0)), (4.0, (3.0, 2.0))]


def test_a_complete_row_waits_for_the_one_before_it() -> None:
    """So that the grid need not take it for late; once that is given up, or is late itself, it waits no more."""
    assembly = Assembly(2, patience=1.0)
    assembly.add(0, 1.0, 0.0, 0.0)
    assembly.add(0, 2.0, 1.0, 0.5)
    assembly.add(1, 2.0, 1.0, 0.5)
    assert assembly.ready(0.9) == []
    assert repr(plain(assembly.ready(1.0))) == "[(0.0, (1.0, nan)), (1.0, (2.0, 2.0))]"
    assembly.add(1, 1.0, 0.0, 1.1)  # late
    assembly.add(0, 3.0, 2.0, 1.1)
    assembly.add(1, 3.0, 2.0, 1.1)
    assert plain(assembly.ready(1.1)) == [(2.0, (3.0, 3.0))]
    assert repr(plain(assembly.ready(2.1))) == "[(0.0, (nan, 1.0))]"


def test_a_row_came_when_its_last_value_did() -> None:
    """Not when the first did, nor when it went out; one without a time comes by itself."""
    assembly = Assembly(2, patience=1.0)
    assembly.add(0, 1.0, 5.0, 0.2)
    assembly.add(1, 2.0, 5.0, 0.7)
    assembly.add(1, 2.0, math.nan, 0.8)
    assert [row.came for row in assembly.ready(0.9)] == [0.8, 0.7]


def test_times_that_are_near_are_one_row() -> None:
    """The exact time goes before the nearest, and a signal is in a row once."""
    assembly = Assembly(2, patience=1.0, together=0.5)
    for signal, time in ((0, 0.0), (0, 0.3), (1, 0.3), (1, 0.1)):
        assembly.add(signal, 10 * time + signal, time, 0.0)
    assert plain(assembly.ready(0.0)) == [(0.0, (0.0, 2.0)), (0.3, (3.0, 4.0))]


def test_a_value_without_a_time_is_a_row_for_the_grid_to_count() -> None:
    """It waits for nobody."""
    assembly = Assembly(2, hold=[0], patience=1.0)
    assembly.add(1, 1.0, math.nan, 0.0)
    assembly.add(0, 1.0, math.inf, 0.0)
    assert repr(plain(assembly.ready(0.0))) == "[(nan, (nan, 1.0)), (nan, (1.0, nan))]"
    assert assembly.ready(2.0) == []


def test_a_complete_row_settles_until_what_holds_is_known() -> None:
    """By a value of its time or later, or by time; so what comes a moment after the rest is in the row."""
    assembly = Assembly(3, hold=[0, 1], patience=1.0, settle=0.1)
    assembly.add(2, 1.0, 5.0, 0.0)
    assembly.add(0, 7.0, 5.0, 0.05)
    assert assembly.ready(0.05) == []
    assembly.add(1, 8.0, 5.0, 0.06)
    (found,) = assembly.ready(0.06)
    assert (found.values, found.came) == ((7.0, 8.0, 1.0), 0.0)  # when the last value came that was awaited
    assembly.add(2, 2.0, 6.0, 1.0)
    assembly.add(1, 9.0, 9.0, 1.0)
    assert assembly.ready(1.09) == []
    assert plain(assembly.ready(1.1)) == [(6.0, (7.0, 8.0, 2.0))]


def test_what_waits_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """Beyond it the oldest rows go out as they are, and old values of what holds are forgotten."""
    monkeypatch.setattr(module, "MOST_ROWS", 10)
    monkeypatch.setattr(module, "MOST_HELD", 10)
    assembly = Assembly(3, hold=[2], patience=1e9)
    for k in range(25):
        assembly.add(0, float(k), float(k), 0.0)
        assembly.add(2, float(k), float(k), 0.0)
    rows = plain(assembly.ready(0.0))
    assert [time for time, _ in rows] == [*map(float, range(15))]
    assert len(assembly._held[2]) <= 10


def test_a_value_keeps_its_quality() -> None:
    """One that holds has it in each row for which it holds; where nothing came nothing is wrong."""
    assembly = Assembly(3, hold=[0], patience=1.0)
    assembly.add(0, 5.0, 0.0, 0.0, Quality.UNCERTAIN)
    assembly.add(1, math.nan, 1.0, 0.0, Quality.BAD)
    assembly.add(2, 2.0, 1.0, 0.0)
    assembly.add(1, 1.0, 2.0, 0.0)
    found = assembly.ready(1.0)
    good, uncertain, bad = Quality
    assert [item.qualities for item in found] == [(uncertain, bad, good), (uncertain, good, good)]
