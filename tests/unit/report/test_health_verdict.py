"""What a trial on healthy data comes to, in a sentence."""

import pytest

from faultbond.fit.false_alarms import Rate
from faultbond.fit.trial import Health
from faultbond.report.health import health_verdict


def health(*, peak: float = 0.4, between: float = 1e9, walk: float = 0.3) -> Health:
    """Give what a trial brought for which 1e6 s were promised: all is well but what is given."""
    rate = Rate(name="V", kind="sensor", peak=peak, between=between, mean=0.0, spread=1.0, memory=1.0)
    return Health(
        promise=1e6,
        step=1.0,
        records=(),
        watches=(),
        rates=(rate,),
        regions=(),
        moments=(),
        trials=(),
        walk=walk,
        walker="R",
        strayed={},
        late=(),
        mirrored=(),
    )


@pytest.mark.parametrize("peak", [0.4, 1.3])
def test_a_parameter_that_walks_too_far_is_named_with_its_cure(peak: float) -> None:
    """Neither noise nor a time between false alarms, which may be long, says what is wrong then."""
    assert "keeps the promise" in health_verdict(health())
    told = health_verdict(health(walk=1.35, peak=peak))
    assert "does not keep the promise: the healthy model has to move R as far as for an alarm." in told
    assert "Declare the accuracy of R larger" in told
    assert "every" not in told


def test_what_alarms_by_its_sums_says_so() -> None:
    """Where no parameter walks, it is what it was."""
    assert "does not keep the promise: it alarms on them." in health_verdict(health(peak=1.3))
    assert "a false alarm every" in health_verdict(health(between=1e4))
