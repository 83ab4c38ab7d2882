"""The rule that accepts a diagnosis without a person: how long a candidate has to be sure, and what ends that."""

from dataclasses import fields, replace
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

import pumped
from cell_course import ACCEPTED, REJECTED, cell, course, rows
from faultbond.runtime.candidates import diagnosis_of
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from faultbond.thesis.online.rule import take_diagnosis
from faultbond.thesis.online.state import ClassicState, with_nothing_sure
from made import changed

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
NOTHING = (-1, -1, -1)


def said(
    monitor: Monitor,
    hypothesis: int,
    *,
    probability: float = 0.99,
    share: float = 1.0,
    doubt: bool = False,
    alone: bool = True,
    n: int = 2,
    mismatch: float = 0.0,
    stopped: float = np.nan,
) -> Any:
    """Let the diagnosis that was given last have this best candidate of so many; `share`: of its likeliest kind."""
    found = monitor._found[0]
    best, other = found["candidates"][:2]
    found["n_candidates"], found["is_unexplained"], found["signal"] = n, doubt, 0
    found["mismatch"] = mismatch
    best["hypothesis"], best["probability"], best["group"] = hypothesis, probability, 1
    best["n_suspects"], best["suspects"]["stopped"][0] = 1, stopped
    best["n_kinds"], best["shares"][:2] = 2, (share, 1.0 - share)
    other["hypothesis"], other["probability"], other["group"] = hypothesis + 1, 1.0 - probability, not alone
    other["n_kinds"], other["shares"][:2] = 1, (1.0, 0.0)
    return found


def sure(monitor: Monitor) -> tuple[int, ...]:
    """What the rule has in mind."""
    return tuple(int(monitor.number(f"sure.{name}")) for name in ("hypothesis", "since", "clear_since"))


def taken(monitor: Monitor, sample: int, hypothesis: int = 1, **more: Any) -> tuple[Monitor, int | None]:
    """The monitor after a diagnosis at a sample, and which hypothesis the rule accepts."""
    after = changed(monitor, **{"clock.index": sample + 1})
    said(after, hypothesis, **more)
    return after, after.sure(0.95)


def test_nothing_is_sure_where_the_model_may_be_off() -> None:
    """A single tested set has all of the probability then, too, and is not accepted by the rule."""
    monitor, found = taken(Monitor(cell()), 100, probability=1.0, mismatch=0.5)
    assert (sure(monitor), found) == (NOTHING, None)


def test_what_acts_of_an_input_whose_record_stopped_is_nothing_to_go_on_by() -> None:
    """Its meter has stuck for sure, and what to correct by is not known: no rule accepts that."""
    monitor, found = taken(Monitor(cell()), 100, probability=1.0, stopped=40.0)
    assert (sure(monitor), found) == (NOTHING, None)


def test_sure_for_long_enough() -> None:
    """A candidate is accepted once it has been sure without a break for 200 samples."""
    monitor, found = taken(Monitor(cell()), 100)
    assert (sure(monitor), found) == ((1, 100, 100), None)
    monitor, found = taken(monitor, 299)
    assert (sure(monitor), found) == ((1, 100, 100), None)
    assert taken(monitor, 300)[1] == 1


@pytest.mark.parametrize("doubtful", [{"probability": 0.9}, {"doubt": True}, {"alone": False}, {"n": 0}])
def test_any_doubt_begins_anew(doubtful: dict[str, Any]) -> None:
    """A probability below the level, another candidate alike, data that none explains: nothing is sure any more."""
    monitor, found = taken(taken(Monitor(cell()), 100)[0], 300, **doubtful)
    assert (sure(monitor), found) == (NOTHING, None)


def test_another_candidate_counts_for_itself() -> None:
    """What another hypothesis was sure for does not count."""
    monitor, found = taken(taken(Monitor(cell()), 100)[0], 300, 2)
    assert (sure(monitor), found) == ((2, 300, 300), None)


def test_where_the_kind_stays_open() -> None:
    """A set that is sure while its kind is not is accepted after 600 samples; a kind that becomes clear counts anew."""
    monitor, _ = taken(Monitor(cell()), 100, share=0.9)
    assert sure(monitor) == (1, 100, -1)
    assert taken(monitor, 699, share=0.9)[1] is None
    assert taken(monitor, 700, share=0.9)[1] == 1
    clear, _ = taken(monitor, 300)
    assert sure(clear) == (1, 100, 300)
    assert taken(clear, 499)[1] is None
    assert taken(clear, 500)[1] == 1
    assert sure(taken(clear, 320, share=0.9)[0]) == (1, 100, -1)


@pytest.mark.parametrize(("row", "decided"), [(ACCEPTED, "accept"), (REJECTED, "reject")])
def test_a_decision_begins_anew(row: int, decided: str) -> None:
    """What was sure is kept and comes back; after a decision nothing is, and one that is refused changes nothing."""
    monitor = changed(
        Monitor(cell(), course().saved[row - 1]), **{"sure.hypothesis": 1, "sure.since": 5, "sure.clear_since": 7}
    )
    monitor = Monitor(cell(), monitor.save())
    assert sure(monitor) == (1, 5, 7)
    with pytest.raises(Exception, match="no candidate of the number"):
        getattr(monitor, decided)(10**6)
    assert sure(monitor) == (1, 5, 7)
    getattr(monitor, decided)(monitor.conclude().candidates[-1].hypothesis)
    assert sure(monitor) == NOTHING
    assert sure(Monitor(cell())) == NOTHING


def nothing() -> ClassicState:
    """A state of method `classic` without numbers."""
    return with_nothing_sure(ClassicState(**{item.name: np.zeros(0) for item in fields(ClassicState)}))  # type: ignore[arg-type]


TOLD = st.fixed_dictionaries(
    {
        "hypothesis": st.sampled_from([1, 1, 1, 2]),
        "probability": st.sampled_from([0.97, 0.97, 0.95, 0.9]),
        "share": st.sampled_from([1.0, 0.99, 0.9]),
        "doubt": st.sampled_from([False] * 9 + [True]),
        "alone": st.sampled_from([True] * 9 + [False]),
    }
)


@settings(max_examples=50, deadline=None)
@given(course=st.lists(st.tuples(st.sampled_from([20, 20, 200, 400]), TOLD), min_size=1, max_size=12))
def test_both_methods_have_one_rule(course: list[tuple[int, dict[str, Any]]]) -> None:
    """That of `classic`, which has no core, accepts the same at the same samples, and has the same in mind."""
    monitor, classic, sample = Monitor(cell()), nothing(), 0
    for step, told in course:
        sample += step
        monitor, found = taken(monitor, sample, **told)
        diagnosis = diagnosis_of(cell().spec, said(monitor, **told))
        classic, expected = take_diagnosis(replace(classic, index=sample + 1), diagnosis, 0.95)
        assert found == expected
        assert sure(monitor) == (classic.sure, classic.sure_since, classic.clear_since)


def test_samples_that_are_not_judged_do_not_count() -> None:
    """While the pump is off nothing is judged, so nothing becomes sure by that."""
    samples = pumped.course([(200, 300)], 300)
    monitor = Monitor(pumped.core())
    monitor.take(samples[:210])
    since = {"sure.since": 5, "sure.clear_since": 7, "settled.now.since": 6, "settled.now.clear_since": 8}
    monitor = changed(monitor, **since)
    monitor.take(samples[210:240])
    assert {name: int(monitor.number(name)) for name in since} == {name: value + 30 for name, value in since.items()}


def test_samples_at_which_the_model_does_not_hold_do_not_pass() -> None:
    """Neither do those since an alarm, nor those of a warm-up that is not over."""
    samples = pumped.course([(200, 300)], 300)
    monitor = Monitor(pumped.core())
    monitor.take(samples[:230])
    for begun, outside in ((220, 10), (150, 0)):
        after = changed(monitor, **{"clock.begun": begun, "clock.alarm": 225, "alarm.outside": 3})
        after.take(samples[230:240])
        assert (after.number("clock.begun"), after.number("alarm.outside")) == (begun + outside, 13)


@pytest.mark.parametrize(("ago", "is_kept"), [(100, True), (60, False)])
def test_what_was_sure_is_kept_in_mind_though_its_kind_stays_open(ago: int, *, is_kept: bool) -> None:
    """A sensor off by a part or by a constant: what is kept in mind is not corrected by, so the set will do."""
    row, samples = 255, rows()
    monitor = Monitor(cell(), course().saved[row])
    best = monitor.conclude().candidates[0]
    assert best.probability > 0.99 > best.kinds[0][1]
    since = int(monitor.number("clock.index")) - ago
    now = {"hypothesis": best.hypothesis, "since": since, "clear_since": -1}
    monitor = changed(monitor, **{f"settled.now.{name}": value for name, value in now.items()})
    monitor.take(samples[row : row + 20])
    assert int(monitor.number("settled.now.since")) == since
    assert monitor.number("settled.hypothesis") == (best.hypothesis if is_kept else -1)
