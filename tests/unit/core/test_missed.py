"""What led and did not explain the data for a while does not explain them later either."""

import numpy as np
import pytest

from cell_course import ACCEPTED, cell, course, rows
from faultbond.contract.core_settings import core_settings
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from made import changed

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
LONG = int(core_settings()["MISSED_SAMPLES"])
ROW = 290  # long after an alarm
OFF = 1e6  # of a sum: far above its limit, for as long as these samples


def explained() -> Monitor:
    """A monitor whose leading hypothesis explains the data now."""
    monitor = Monitor(cell(), course().saved[ROW])
    assert monitor.copy().conclude().unexplained is None
    return monitor


def leading(monitor: Monitor) -> int:
    """The number of the hypothesis that leads."""
    return int(monitor.conclude().candidates[0].hypothesis)


def noted(monitor: Monitor, hypothesis: int, samples: int) -> Monitor:
    """One that knows that a hypothesis was off at the second sensor for so many samples."""
    known = samples * (np.arange(len(monitor.numbers("missed.samples"))) == hypothesis)
    return changed(
        monitor,
        **{"missed.samples": known, "missed.signal": 1, "missed.sd": 2.5, "missed.since": 130.0, "missed.until": 137.0},
    )


@pytest.mark.parametrize(("samples", "is_told"), [(LONG - 1, False), (LONG, True)])
def test_what_did_not_explain_the_data_for_long_is_unexplained_for_good(samples: int, *, is_told: bool) -> None:
    """With the sensor that was off then, by how much, and when; a saved state knows it, too."""
    monitor = explained()
    after = noted(monitor, leading(monitor), samples)
    found = after.conclude()
    assert repr(found.candidates) == repr(monitor.conclude().candidates)
    if not is_told:
        assert found.unexplained is None
        return
    assert found.unexplained is not None
    told = found.unexplained
    assert (told.signal, told.sd, told.since, told.until) == (cell().spec.outputs[1].name, 2.5, 130.0, 137.0)
    assert after.save().tobytes() == Monitor(cell(), after.save()).save().tobytes()


def test_another_hypothesis_is_not_touched_by_it() -> None:
    """What one did not explain says nothing of what leads now."""
    monitor = explained()
    assert noted(monitor, 1 - min(leading(monitor), 1), 10 * LONG).conclude().unexplained is None


def test_samples_are_counted_of_what_leads_while_it_is_off_and_of_nothing_else() -> None:
    """As many as were judged since the diagnosis before; what is told of the past counts no further."""
    monitor = explained()
    best = leading(monitor)
    others = np.arange(len(monitor.numbers("missed.samples"))) != best

    times: list[float] = []

    def counted(start: Monitor) -> tuple[float, float, float]:
        """The part of the samples up to the next diagnosis that counts; since and until when it was off."""
        before, judged = start.numbers("missed.samples"), start.number("missed.judged")
        last = start.take(rows()[ROW:]).last
        assert last.diagnosis is not None
        times.append(last.diagnosis.time)
        told = {name: start.numbers(f"missed.{name}") for name in ("samples", "since", "until")}
        assert not told["samples"][others].any()
        assert start.number("missed.judged") > judged
        part = (told["samples"][best] - before[best]) / (start.number("missed.judged") - judged)
        return float(part), float(told["since"][best]), float(told["until"][best])

    assert counted(monitor.copy()) == (0.0, 0.0, 0.0)
    part, since, until = counted(changed(monitor, **{"bank.sums": OFF}))
    assert part == 1.0
    assert since < until == times[-1]
    assert counted(noted(monitor, best, LONG)) == (0.0, 130.0, 137.0)


def test_a_decision_forgets_it() -> None:
    """What is accepted is the healthy model of what comes, and begins anew."""
    monitor = Monitor(cell(), course().saved[ACCEPTED - 1])
    best = leading(monitor)
    known = noted(monitor, best, LONG)
    known.accept(best)
    assert not known.numbers("missed.samples").any()
    assert int(known.number("missed.judged")) == 0
