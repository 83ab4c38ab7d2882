"""What led and was far off does not explain the data later either."""

import numpy as np
import pytest

from cell_course import ACCEPTED, cell, course, rows
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from made import changed

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
LIMIT = cell().spec.thresholds.cusum_limit
ROW = 290  # long after an alarm


def explained() -> Monitor:
    """A monitor whose leading hypothesis explains the data now."""
    monitor = Monitor(cell(), course().saved[ROW])
    assert monitor.copy().conclude().unexplained is None
    return monitor


def leading(monitor: Monitor) -> int:
    """The number of the hypothesis that leads."""
    return int(monitor.conclude().candidates[0].hypothesis)


def noted(monitor: Monitor, hypothesis: int) -> Monitor:
    """One that knows that a hypothesis was far off at the second sensor once."""
    known = np.arange(len(monitor.numbers("bank.missed.is_noted"))) == hypothesis
    was = {"signal": 1, "sd": 2.5, "since": 130.0, "until": 137.0}
    return changed(monitor, **{"missed.is_noted": known, **{f"missed.{name}": value for name, value in was.items()}})


def test_what_was_far_off_is_unexplained_for_good() -> None:
    """With the sensor that was off then, by how much, and when; a saved state knows it, too."""
    monitor = explained()
    after = noted(monitor, leading(monitor))
    found = after.conclude()
    assert repr(found.candidates) == repr(monitor.conclude().candidates)
    assert found.unexplained is not None
    told = found.unexplained
    assert (told.signal, told.sd, told.since, told.until) == (cell().spec.outputs[1].name, 2.5, 130.0, 137.0)
    assert after.save().tobytes() == Monitor(cell(), after.save()).save().tobytes()


def test_another_hypothesis_is_not_touched_by_it() -> None:
    """What one did not explain says nothing of what leads now."""
    monitor = explained()
    assert noted(monitor, 1 - min(leading(monitor), 1)).conclude().unexplained is None


@pytest.mark.parametrize(("sum_now", "is_off", "is_kept"), [(0.5, False, False), (1.3, True, False), (2.0, True, True)])
def test_what_leads_is_noted_where_it_is_far_off(sum_now: float, *, is_off: bool, is_kept: bool) -> None:
    """Sums in limits: a model that is not exact passes one at times."""
    monitor = changed(explained(), **{"bank.sums": sum_now * LIMIT})
    best = leading(monitor)
    last = monitor.take(rows()[ROW:]).last.diagnosis
    assert last is not None
    assert (last.unexplained is not None) == is_off
    assert np.flatnonzero(monitor.numbers("bank.missed.is_noted")).tolist() == [best] * is_kept
    if is_kept:
        assert last.unexplained is not None
        until = [last.unexplained.until, last.time]
        assert [monitor.numbers("bank.missed.until")[best]] * 2 == until
        assert monitor.numbers("bank.missed.since")[best] == last.unexplained.since


def test_it_is_told_since_when_it_first_was() -> None:
    """And until when it last was."""
    monitor = changed(noted(explained(), leading(explained())), **{"bank.sums": 3.0 * LIMIT})
    best = leading(monitor)
    last = monitor.take(rows()[ROW:]).last.diagnosis
    assert last is not None
    assert monitor.numbers("bank.missed.since")[best] == 130.0
    assert monitor.numbers("bank.missed.until")[best] == last.time > 137.0


def test_a_decision_forgets_it() -> None:
    """What is accepted is the healthy model of what comes, and begins anew."""
    monitor = Monitor(cell(), course().saved[ACCEPTED - 1])
    best = leading(monitor)
    known = noted(monitor, best)
    known.accept(best)
    assert not known.numbers("bank.missed.is_noted").any()
