"""What the terminal, the page and `reject` say of candidates that were accepted or rejected."""

from dataclasses import replace
from io import StringIO

from rich.console import Console

from fake import TANK_STROKES, counts_of, suspect, tank_diagnosis, tank_graph, tank_history, wrong
from faultbond.contract.findings import Candidate, Decider, Decision, Detection, History, Unexplained, Untested
from faultbond.report.html import render_report
from faultbond.report.numbers import Notation
from faultbond.report.terminal import print_diagnosis
from faultbond.report.verdict import RunCounts, accepted_sentence, ranking_text, rejected_sentence, verdict_sentence
from faultbond.types import FaultKind

GRAPH = tank_graph()
PIPE = Candidate(suspects=(suspect(GRAPH, "K1", 1.85, 0.03),), probability=0.997, group=True)


def decided(*, after: float, again: bool = False, by: Decider = Decider.RULE) -> History:
    """A run whose fault was accepted some time after the alarm; perhaps with another alarm at its end."""
    history = tank_history(GRAPH)
    alarm = history.detections[0]
    later = Detection(time=4900.0, sample=4900, change_time=4880.0, signals=("pressure",))
    accepted = Decision(time=alarm.time + after, candidate=PIPE, by=by)
    diagnoses = tuple(item for item in history.diagnoses if item.time <= accepted.time)
    return replace(
        history,
        accepted=(accepted,),
        detections=(alarm, later) if again else (alarm,),
        open=later if again else None,
        diagnoses=(*diagnoses, tank_diagnosis(GRAPH, 4919.0, 19.0)) if again else diagnoses,
    )


def printed(history: History) -> str:
    """The text for a file, on one line."""
    out = StringIO()
    print_diagnosis(Console(file=out), GRAPH, history, engine_title="test engine", counts=counts_of(history))
    return " ".join(out.getvalue().split())


def page(history: History) -> str:
    """The page of a run."""
    return render_report(GRAPH, history, TANK_STROKES, "test engine", "0", counts_of(history))


def test_what_is_accepted_against_the_data_is_told() -> None:
    """Accepting a value that is next to the old one, or what is hardly likely, is said to help little."""
    one = suspect(GRAPH, "K1", 1.5, 0.02)
    sure = Candidate(suspects=(one,), probability=0.9, group=True)

    def told(candidate: Candidate) -> str:
        return accepted_sentence(GRAPH, Decision(time=90.0, candidate=candidate, by=Decider.PERSON))

    assert told(sure).endswith("It is the new normal.")
    assert told(replace(sure, probability=0.001, group=False)).endswith(
        "It is the new normal. The data speak against it, so the next alarm may be the same one."
    )
    assert one.nominal is not None
    near = replace(sure, suspects=(replace(one, estimate=1.0009 * one.nominal),))
    assert told(near).endswith("It is within 0.1 % of what was normal before, so the next alarm may be the same one.")
    assert told(replace(near, suspects=(*near.suspects, one))).endswith("It is the new normal.")
    assert told(replace(sure, probability=0.001)).endswith("It is the new normal.")


def test_an_accepted_fault_is_told_and_not_diagnosed_any_more() -> None:
    """Text and page say what was accepted, when and by whom, and that nothing else was found; there is no table."""
    history = decided(after=300.0)
    text = printed(history)
    told = "Accepted by rule at 3036 s: pipe K1 (99.7 %); K1 rose from 2.41e11 to 4.46e11 Pa*s^2/m^6 (+85 %). It is the"
    assert f"{told} new normal." in text
    assert text.endswith("Accepted as the new normal: pipe K1 at 3036 s. No other fault was found.")
    assert "Diagnosis at" not in text
    found = page(history)
    assert "No other fault was found." in found
    assert '"label":"accepted"' in found
    assert "Ranked explanations" not in found


def test_the_next_fault_is_the_one_that_is_diagnosed() -> None:
    """Alarms and what was accepted stand in the order of time, then the diagnosis of the alarm that is open."""
    text = printed(decided(after=300.0, again=True, by=Decider.PERSON))
    places = [text.index(part) for part in ("Fault detected at 2736 s", "Accepted at 3036 s", "detected at 4900 s")]
    assert places == sorted(places)
    assert "Diagnosis at 4919 s" in text
    assert "Cannot yet be told apart" in text
    assert "<dt>Accepted</dt><dd>pipe K1 at 3036 s</dd>" in page(decided(after=300.0, again=True))


def test_an_alarm_without_a_diagnosis_is_not_explained_by_the_one_before() -> None:
    """What was found before the last fault was accepted says nothing about the next one."""
    history = decided(after=300.0, again=True)
    early = replace(history, diagnoses=history.diagnoses[:-1])
    sentence = verdict_sentence(GRAPH, early, RunCounts(samples=4920), Notation.FILE)
    assert sentence == "A fault was detected; there is no diagnosis yet."


def test_a_run_after_an_accepted_fault() -> None:
    """A run that goes on from one with an accepted fault, and finds none, says both."""
    history = replace(
        tank_history(GRAPH, fault=False), accepted=(Decision(time=-9.0, candidate=PIPE, by=Decider.RULE),)
    )
    text = printed(history)
    assert "Accepted by rule at -9 s: pipe K1" in text
    assert "No fault found in 4920 samples" in text
    assert '"label":"accepted"' not in page(history)


def test_an_alarm_of_the_run_before() -> None:
    """An alarm that stood open when the run began is told as one of before, not after a negative time."""
    history = tank_history(GRAPH)
    early = replace(history.detections[0], time=-30.0, change_time=-60.0)
    found = page(replace(history, detections=(early,)))
    assert "in the run before" in found
    assert "after the start" not in found


def test_what_was_rejected_is_told() -> None:
    """Text and page name what a person ruled out, in the order of time; the diagnosis goes on."""
    rejected = Decision(time=3000.0, candidate=PIPE, by=Decider.PERSON)
    history = replace(tank_history(GRAPH), rejected=(rejected,))
    text = printed(history)
    places = [text.index(part) for part in ("Fault detected at 2736 s", "Rejected at 3000 s: pipe K1", "Diagnosis at")]
    assert places == sorted(places)
    assert "<dt>Rejected</dt><dd>pipe K1 at 3000 s</dd>" in page(history)
    assert "<dt>Rejected</dt>" not in page(tank_history(GRAPH))


def test_what_is_left_after_a_rejection() -> None:
    """The rejected candidate is named with what it had; the list is short, without it, and counts the rest."""
    rejected = Decision(time=60.0, candidate=PIPE, by=Decider.PERSON)
    assert rejected_sentence(GRAPH, rejected) == (
        "Rejected at 60 s: pipe K1, step (99.7 %), and every set that contains it."
    )
    diagnosis = tank_diagnosis(GRAPH, 60.0, 0.0)
    left = [item for item in diagnosis.candidates if item.parameters != ("K1",)]
    out = next(item for item in diagnosis.candidates if item.parameters == ("K1",))
    ranked = replace(diagnosis, candidates=(*left, replace(out, probability=0.0)))
    lines = ranking_text(GRAPH, ranked).splitlines()
    assert lines[0] == "What is left:"
    assert len(lines) == 10
    assert lines[-1].strip() == f"... and {len(left) - 8} more"
    assert not any("K1, step" in line and "with" not in line for line in lines)


def test_what_falls_with_an_instrument() -> None:
    """With a rejected sensor all sets fall that contain it; of a sensor with a component there is none."""
    sensor = replace(PIPE, suspects=(wrong("flow.bias", 0.0, 1e-5, 1e-6),), kind=FaultKind.BIAS)
    both = replace(sensor, suspects=(*sensor.suspects, *PIPE.suspects))
    for candidate, more in ((sensor, ", and every set that contains it."), (both, ".")):
        told = rejected_sentence(GRAPH, Decision(time=60.0, candidate=candidate, by=Decider.PERSON))
        assert told.endswith(f", bias (99.7 %){more}")


def test_what_is_left_may_explain_nothing() -> None:
    """Where the best that is left contradicts the data, or sets are not tested, the list says so after its lines."""
    wrong = Unexplained(signal="flow", sd=0.5, since=20.0, until=60.0)
    left = Untested(sets=7, probability=0.02)
    *_, first, second = ranking_text(
        GRAPH, replace(tank_diagnosis(GRAPH, 60.0, 0.0), unexplained=wrong, untested=left)
    ).splitlines()
    assert first.startswith("None of the modelled faults explains this: the best fit is still 0.5 standard deviations")
    assert second == "Another 7 sets were not tested; the truth is among them with at most 2.0 %."
