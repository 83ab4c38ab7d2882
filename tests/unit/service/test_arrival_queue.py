"""What waits between the network and who takes it."""

import math

import numpy as np
import pytest

from arriving import subscriber
from faultbond.io.row_block import Quality, Row
from faultbond.service.sources import intake as module
from faultbond.service.sources.intake import Intake, Reading
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.queue import AT_ONCE, ArrivalQueue


class Moments:
    """Clocks that stand where a test puts them: s of the machine, and since 1970."""

    at = 0.0

    def monotonic(self) -> float:
        """Give s of the machine."""
        return 50.0 + self.at

    def time(self) -> float:
        """Give s since 1970."""
        return 1e9 + self.at


def row(time: float) -> Row:
    """Give a row."""
    return Row(time=time, u=np.zeros(1), y=np.zeros(2))


def test_the_oldest_rows_are_dropped_and_counted() -> None:
    """Of each asset by itself; what was given is not given again, nor counted again."""
    queue = ArrivalQueue([subscriber("one"), subscriber("two")], 3)
    for k in range(5):
        queue.put("one", row(float(k)))
    queue.put("two", row(7.0))
    one, two = queue.drain()
    assert one.rows.time.tolist() == [2.0, 3.0, 4.0]
    assert (dict(one.counts), dict(two.counts)) == ({"dropped": 2}, {})
    assert [*queue.drain()] == []


def test_many_rows_go_on_in_portions() -> None:
    """In order, with what comes meanwhile; what was counted is told once."""
    queue = ArrivalQueue([subscriber("one")], 3 * AT_ONCE)
    for k in range(2 * AT_ONCE + 1):
        queue.put("one", row(float(k)))
    queue.count("one", "bad")
    draining = queue.drain()
    found = [next(draining)]
    queue.put("one", row(-1.0))
    found += draining
    assert [len(item.rows) for item in found] == [AT_ONCE, AT_ONCE, 2]
    times = np.concatenate([item.rows.time for item in found])
    np.testing.assert_array_equal(times, [*range(2 * AT_ONCE + 1), -1.0])
    assert [dict(item.counts) for item in found] == [{"bad": 1}, {}, {}]


def test_what_is_counted_is_told_without_a_row() -> None:
    """A block without rows has the shape of the asset."""
    queue = ArrivalQueue([subscriber("one")], 3)
    queue.count("one", "bad", 2)
    (found,) = queue.drain()
    assert (len(found.rows), found.rows.u.shape, found.rows.y.shape) == (0, (0, 1), (0, 2))
    assert dict(found.counts) == {"bad": 2}


def test_values_that_nobody_takes_are_bounded_and_counted(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where who takes rows stands still, as many as may wait are there, the rest is counted; each value is judged."""
    now = Moments()
    monkeypatch.setattr(module, "time", now)
    options = SourceOptions(most_waiting=10, patience=0.05, together=0.0, hold={"one": ("u",)})
    queue = ArrivalQueue([subscriber("one")], options.most_waiting)
    intake = Intake(subscriber("one"), options, queue)
    for k in range(25):
        intake.take([Reading(column=name, value=float(k), time=float(k)) for name in "uyz"])
        now.at += 1.0
    intake.take([Reading(column="y", value=1.0, time=99.0, quality=Quality.BAD)])
    intake.take([Reading(column="z", value="on", time=99.0)])
    intake.look()
    now.at += 0.1
    intake.look()
    intake.take([Reading(column="y", value=1.0, time=100.0)])  # not complete: it goes when all is closed
    intake.close()
    (found,) = queue.drain()
    assert found.rows.time.tolist() == [*map(float, range(17, 25)), 99.0, 100.0]
    assert dict(found.counts) == {"dropped": 17, "bad": 1, "unreadable": 1}
    assert math.isnan(found.rows.y[-2, 0])
    assert found.rows.u[-1, 0] == 24.0
    assert found.rows.quality is not None
    good, bad = [Quality.GOOD] * 3, [Quality.GOOD, Quality.BAD, Quality.GOOD]
    assert found.rows.quality.tolist() == [*[good] * 8, bad, good]
    assert found.rows.arrived is not None
    came = [*range(17, 25), 25.0, 25.1]  # not when they were taken on
    np.testing.assert_allclose(found.rows.arrived - 1e9, came, rtol=0, atol=1e-6)


def test_what_waits_goes_on_while_nobody_asks() -> None:
    """Else it would grow without bounds while who takes rows stands still."""
    queue = ArrivalQueue([subscriber("one")], 10)
    intake = Intake(subscriber("one"), SourceOptions(hold={"one": ("u",)}), queue)
    intake._looked -= module.LONGEST
    intake.take([Reading(column=name, value=1.0, time=1.0) for name in "uyz"])
    (found,) = queue.drain()
    assert found.rows.time.tolist() == [1.0]


def test_what_holds_is_forgotten_for_later_rows_only() -> None:
    """A row that was complete before keeps it."""
    queue = ArrivalQueue([subscriber("one")], 10)
    intake = Intake(subscriber("one"), SourceOptions(hold={"one": ("u",)}), queue)
    intake.take([Reading(column=name, value=1.0, time=1.0) for name in "uyz"])
    intake.forget(["u"])
    intake.take([Reading(column=name, value=1.0, time=2.0) for name in "yz"])
    intake.close()
    (found,) = queue.drain()
    assert found.rows.u[0, 0] == 1.0
    assert math.isnan(found.rows.u[1, 0])
