"""The words and rows about a run."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from fake import counts_of, kind_of, moving, suspect, tank_graph, tank_history, with_last, wrong
from faultbond.contract.findings import Candidate, Diagnosis, History, Superseded, Suspect, Unexplained, Walk
from faultbond.io.examples import example
from faultbond.model.graph import BondGraph, Unit
from faultbond.model.text import parse_model
from faultbond.report.numbers import Notation
from faultbond.report.reservations import course_sentences, mismatch_sentence, superseded_sentence
from faultbond.report.suspects import UNDETERMINED, unit_of
from faultbond.report.verdict import (
    RunCounts,
    detection_sentence,
    fault_probabilities,
    remainder_text,
    table_rows,
    verdict_sentence,
    view_of,
)
from faultbond.types import FaultKind, TimeGrid

GRAPH = tank_graph()


@pytest.fixture(scope="module")
def history() -> History:
    """Give a run with a fault."""
    return tank_history(GRAPH, samples=1200)


def sentence(history: History, *candidates: Candidate) -> str:
    """Give the verdict when these are the last candidates."""
    return verdict_sentence(GRAPH, with_last(history, candidates), RunCounts(samples=9), Notation.FILE)


def test_verdict_names_component_and_values(history: History) -> None:
    """A clear winner is named with its component, both values, the change and how sure it is."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    told = "Most likely the pipe changed: K1 rose from 2.41e11 to 4.43e11 Pa*s^2/m^6 (+84 %)"
    assert sentence(history, best) == f"{told}, 99.3 % sure."
    assert sentence(history, replace(best, kinds=())) == f"{told}."  # a method that has no chances


def test_of_two_faults_a_model_of_one_was_not_asked(history: History) -> None:
    """Where `max_faults` is 1 the verdict is sure of one fault alone, and says so; where it is not sure it does not."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    one, counts, last = replace(GRAPH, max_faults=1), RunCounts(samples=9), with_last(history, (best,))
    told = verdict_sentence(one, last, counts, Notation.FILE)
    assert told == f"{sentence(history, best).removesuffix('.')} if only one thing is at fault."
    other = kind_of(suspect(GRAPH, "K8", 0.9, 0.02), (FaultKind.STEP, 1.0), probability=0.4)
    both = with_last(history, (replace(best, probability=0.6), other))
    assert verdict_sentence(one, both, counts, Notation.FILE) == verdict_sentence(GRAPH, both, counts, Notation.FILE)


def test_a_set_as_large_as_max_faults_says_what_was_not_asked(history: History) -> None:
    """Of a pair where `max_faults` is 2 the verdict is sure of two at most; not where it is 3, or no third is left."""
    pair = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    pair = replace(pair, suspects=(*pair.suspects, suspect(GRAPH, "K8", 0.9, 0.02)))
    two, counts, last = replace(GRAPH, max_faults=2), RunCounts(samples=9), with_last(history, (pair,))
    told = verdict_sentence(two, last, counts, Notation.FILE)
    assert told.endswith(", 99.3 % sure if no more than 2 things are at fault.")
    three = replace(GRAPH, max_faults=3)
    assert verdict_sentence(three, last, counts, Notation.FILE).endswith(", 99.3 % sure.")
    sensors = tuple(replace(item, suspect=False) for item in GRAPH.sensors)
    inputs = tuple(replace(item, suspect=False) for item in GRAPH.inputs)
    small = replace(two, parameters=two.parameters[:2], sensors=sensors, inputs=inputs)
    some = [item.name for item in small.parameters]
    known = replace(pair, suspects=tuple(suspect(GRAPH, name, 1.2, 0.02) for name in some))
    told = verdict_sentence(small, with_last(history, (known,)), counts, Notation.FILE)
    assert told.endswith(", 99.3 % sure.")


def test_what_none_explains_may_be_more_than_was_tested(history: History) -> None:
    """Where no candidate explains the data, sets larger than `max_faults` are named as not tested."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last, counts = with_last(history, (best,)), RunCounts(samples=9)
    off = Unexplained(signal="flow", since=7.0, until=7.0, sd=5.0)
    last = replace(last, diagnoses=(replace(last.diagnoses[-1], unexplained=off),))
    pairs = ", nor two of which both move or stick, or one scatters or comes and goes"
    for most, words, more in ((1, "one fault at once was", ""), (2, "2 faults at once were", pairs)):
        told = verdict_sentence(replace(GRAPH, max_faults=most), last, counts, Notation.FILE)
        assert f" More than {words} not tested (`max_faults: {most}`){more}. Nearest comes" in told


@pytest.mark.parametrize(
    ("u_in", "u_out", "told"),
    [
        ("settling: 12 s", "settling: 12 s", "It was not tested whether u_in and u_out have become slower to act ("),
        (
            "lag: 3 s",
            "suspect: yes",
            "It was not tested whether u_in has become slower to act (`lag` with",
        ),
        ("lag: {value: 3 s, suspect: yes}", "suspect: yes", ""),
        ("lag: 3 s, rate_limit: 2 percent/s", "suspect: yes", ""),
        (
            "lag: 3 s, rate_limit: {value: 2 percent/s, suspect: no}",
            "settling: 12 s",
            "whether u_in and u_out have become slower to act (`rate_limit` and `lag` with `suspect: yes`)",
        ),
        ("lag: 3 s, suspect: no", "settling: 12 s, suspect: no", ""),
    ],
)
def test_what_none_explains_may_be_an_actuator_that_is_slow(u_in: str, u_out: str, told: str, history: History) -> None:
    """Of inputs that take a while to act and may be at fault, where their lag is no suspect."""
    text = (example("tank") / "model.yaml").read_text(encoding="utf-8")
    text = text.replace("u_in:  {unit: percent, settling: 12 s}", f"u_in: {{unit: percent, {u_in}}}")
    graph = parse_model(text.replace("u_out: {unit: percent, settling: 12 s}", f"u_out: {{unit: percent, {u_out}}}"))
    best = kind_of(suspect(graph, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last = with_last(history, (best,))
    off = Unexplained(signal="flow", since=7.0, until=7.0, sd=5.0)
    last = replace(last, diagnoses=(replace(last.diagnoses[-1], unexplained=off),))
    found = verdict_sentence(graph, last, RunCounts(samples=9), Notation.FILE)
    assert told in found
    assert ("slower to act" in found) is bool(told)


@pytest.mark.parametrize(
    ("lag", "said"), [("lag: 3 s", True), ("lag: {value: 3 s, suspect: yes}", False), ("lag: 3 s, suspect: no", False)]
)
def test_what_none_explains_may_be_a_meter_that_is_slow(lag: str, history: History, *, said: bool) -> None:
    """Of sensors with a lag that may be at fault, where that is no suspect."""
    text = (example("tank") / "model.yaml").read_text(encoding="utf-8")
    graph = parse_model(text.replace("reads: vessel.e,", f"reads: vessel.e, {lag},"))
    best = kind_of(suspect(graph, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last, off = with_last(history, (best,)), Unexplained(signal="flow", since=7.0, until=7.0, sd=5.0)
    last = replace(last, diagnoses=(replace(last.diagnoses[-1], unexplained=off),))
    found = verdict_sentence(graph, last, RunCounts(samples=9), Notation.FILE)
    told = "It was not tested whether pressure has become slower to read (`lag` with `suspect: yes`)."
    assert (told in found) is said


@pytest.mark.parametrize(
    ("kind", "settling", "said"),
    [
        (FaultKind.INTERMITTENT, "settling: 12 s", True),
        (FaultKind.INTERMITTENT, "suspect: yes", False),
        (FaultKind.BIAS, "settling: 12 s", False),
    ],
)
def test_an_input_that_is_off_at_times_may_be_slow(
    kind: FaultKind, settling: str, history: History, *, said: bool
) -> None:
    """One that became slower is off after each of its moves, and right again, so where that is not asked it is said."""
    text = (example("tank") / "model.yaml").read_text(encoding="utf-8")
    graph = parse_model(text.replace("u_in:  {unit: percent, settling: 12 s}", f"u_in: {{unit: percent, {settling}}}"))
    off = Suspect(component="u_in", parameter="u_in.bias", nominal=0.0, estimate=-4.0, sd=0.2)
    last = with_last(history, (kind_of(off, (kind, 1.0), probability=0.999),))
    told = " ".join(course_sentences(graph, last, last.diagnoses[-1]))
    assert ("whether u_in has become slower to act" in told) is said
    assert ("which is off after each move and right again." in told) is said


def test_a_clock_that_was_set_back_gives_no_time_below_none(history: History) -> None:
    """Where a recording ends before it begins its length is that of its samples, and no delay is told."""
    ends = np.array([30.0, 10.0])
    back = replace(history, time=ends, detections=(), diagnoses=(), open=None)
    told = verdict_sentence(GRAPH, back, RunCounts(samples=90, clock_jumps=1), Notation.FILE)
    assert told == "No fault found in 90 samples (90 s)."
    (alarm,) = history.detections
    late = detection_sentence(replace(alarm, time=10.0, change_time=30.0))
    assert late.endswith("it has shown since about 30 s (by the clock as it was before it was set back).")


def test_an_early_verdict_says_so(history: History) -> None:
    """A verdict within 200 samples of the alarm is called early; later, of a run before, or of `classic` it is not."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last = with_last(history, (best,))
    (alarm,) = last.detections
    soon = last.diagnoses[-1]

    def told(after: float, of: History = last, by: Candidate = best) -> str:
        return " ".join(course_sentences(GRAPH, of, replace(soon, time=alarm.time + after, candidates=(by,))))

    assert told(1.0) == "This is early, 1 sample after the alarm: up to 200 it may still change."
    assert told(199.0).startswith("This is early, 199 samples after the alarm")
    assert told(200.0) == ""
    assert told(1000.0, replace(last, time=last.time[-1:])) == ""  # without a report few rows are kept
    assert told(50.0, replace(last, detections=())) == ""
    assert told(50.0, replace(last, open=None)) == ""
    assert told(50.0, by=replace(best, kinds=())) == ""
    assert (
        told(50.0)
        in view_of(
            GRAPH,
            replace(last, diagnoses=(replace(soon, time=alarm.time + 50.0),)),
            RunCounts(samples=9),
            Notation.FILE,
        ).verdict
    )


def test_a_model_that_was_never_fitted_may_be_what_is_wrong(history: History) -> None:
    """That is said where nothing explains the data or the alarm came soon, and not of a model that was fitted."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last = with_last(history, (best,))
    (alarm,), plain = last.detections, last.diagnoses[-1]
    off = replace(plain, unexplained=Unexplained(signal="flow", since=7.0, until=7.0, sd=5.0))

    def told(diagnosis: Diagnosis = plain, sample: int = 500, graph: BondGraph = GRAPH) -> str:
        return " ".join(course_sentences(graph, replace(last, open=replace(alarm, sample=sample)), diagnosis))

    wrong = "If nothing is wrong with the plant, the model leaves something out"
    assert told() == ""
    assert told(sample=499).startswith(f"The alarm came after 499 samples. {wrong}")
    assert told(off).startswith(wrong)
    assert told(replace(off, mismatch=0.9)) == ""
    assert wrong in told(replace(off, mismatch=0.5, strained=("K2",)))
    fitted = replace(GRAPH, inputs=(replace(GRAPH.inputs[0], fitted_range=(0.0, 1.0)), *GRAPH.inputs[1:]))
    assert told(off, graph=fitted) == told(sample=1, graph=fitted) == ""
    sensed = replace(GRAPH, sensors=(replace(GRAPH.sensors[0], fitted_range=(0.0, 1.0)), *GRAPH.sensors[1:]))
    assert told(off, graph=sensed) == ""
    assert told(off, graph=replace(GRAPH, grid=TimeGrid.NONE)) == ""


def test_a_fault_that_is_gone_does_not_explain_what_was_off_all_the_while(history: History) -> None:
    """That is said where the alarm came of another parameter since the start, and the best candidate is gone now."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.INTERMITTENT, 1.0), probability=0.993)
    gone = replace(best, present=False)
    last = with_last(history, (gone,))
    (alarm,), plain = last.detections, last.diagnoses[-1]
    alarm = replace(alarm, sample=500)

    def told(walk: Walk | None, **changed: Any) -> str:
        open_since = replace(last, open=replace(alarm, walk=walk))
        return " ".join(course_sentences(GRAPH, open_since, replace(plain, **changed)))

    other = Walk(parameter="K2", sd=4.4, from_start=True)
    assert told(other).startswith("The alarm came since K2 had to be moved too far from the start on; a fault that is")
    assert told(other, candidates=(best,)) == told(None) == told(replace(other, from_start=False)) == ""
    assert told(other, mismatch=0.5) == ""
    same = told(replace(other, parameter="K1"))
    assert same.startswith("Yet the alarm came since K1 had to be moved from the start on: the model may have taken a")
    assert told(replace(other, parameter="K1"), candidates=(best,)) == ""
    assert not told(other, unexplained=Unexplained(signal="flow", since=7.0, until=7.0, sd=5.0)).startswith("The alarm")


def test_what_did_not_fit_for_a_while_is_told_beside_what_is_claimed(history: History) -> None:
    """Not where nothing is claimed, for which there are other words, nor of a fault that is known by now."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.993)
    last = with_last(history, (best,))
    (alarm,), plain = last.detections, last.diagnoses[-1]
    missed = Unexplained(signal="pressure", since=700.0, until=840.0, sd=2.04)

    def told(found: Unexplained | None = missed, **changed: Any) -> str:
        return " ".join(course_sentences(GRAPH, replace(last, open=alarm, missed=found), replace(plain, **changed)))

    assert told(None) == ""
    assert told() == (
        "Between 700 s and 840 s pressure was off all the same, by up to 2 standard deviations: something else may "
        "have changed then. To see what, run with `--state` up to 700 s, accept this fault (`faultbond accept`), and "
        "go on from there."
    )
    assert (
        "off all the same" in view_of(GRAPH, replace(last, missed=missed), RunCounts(samples=9), Notation.FILE).verdict
    )
    assert told(mismatch=0.5) == told(superseded=Superseded(components=("tank",), until=600.0)) == ""
    assert "off all the same" not in told(unexplained=missed)


def test_what_lies_within_the_accuracy_is_not_claimed(history: History) -> None:
    """Where that is likelier than the best candidate, the best only comes nearest; else it is told beside."""
    best = kind_of(suspect(GRAPH, "K1", 2.45, 0.01), (FaultKind.STEP, 1.0), probability=0.1)
    diagnosis = replace(with_last(history, (best,)).diagnoses[-1], within_accuracy=0.9)
    shown = replace(history, diagnoses=(*history.diagnoses, diagnosis))
    told = verdict_sentence(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    assert told.startswith(
        "Something was otherwise, but nothing is further off than healthy parts may be (`accuracy`, `healthy_change`, "
        "`healthy_bias`), 90 % sure: no fault is claimed."
    )
    assert "Nearest comes a change of the pipe: K1 " in told
    view = view_of(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    assert view.left_out.startswith(
        "With 90.0 % nothing that is tested changed by more than it may while healthy: each percentage"
    )
    less = replace(history, diagnoses=(*history.diagnoses, replace(diagnosis, within_accuracy=0.05)))
    told = verdict_sentence(GRAPH, less, RunCounts(samples=9), Notation.FILE)
    assert told.startswith("Most likely the pipe changed")


def test_a_model_that_is_off_is_told_with_its_cure(history: History) -> None:
    """Where what counts as healthy raised the alarm the best only comes nearest, however well it fits."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.1)
    shown = with_last(history, (best,))
    walk = Walk(parameter="K3", sd=4.7, from_start=True)
    alarm = replace(shown.detections[-1], walk=walk)
    diagnosis = replace(shown.diagnoses[-1], mismatch=0.9)
    shown = replace(shown, detections=(alarm,), open=alarm, diagnoses=(diagnosis,))
    told = verdict_sentence(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    off = "Most likely the model is off (90.0 %): K3, which counts as healthy, had to move too far. Declare the "
    assert told.startswith(off)
    assert (
        "accuracy of K3 larger, or that it wanders, or mend what moves it. Nearest comes a change of the pipe" in told
    )
    view = view_of(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    evenly = "each percentage above has an even share of that in it."
    assert view.left_out == f"With 90.0 % the model is off: {evenly}"
    both = (replace(best, probability=0.53), replace(best, probability=0.47))
    left = mismatch_sentence(replace(diagnosis, mismatch=0.9, candidates=both))
    assert left == f"With 90.0 % the model is off: {evenly} If it is right after all, the first is at 80.0 %."
    nowhere = Unexplained(signal="flow", sd=2.0, since=0.0, until=1.0)  # then no percentages are shown
    assert mismatch_sentence(replace(diagnosis, mismatch=0.9, candidates=both, unexplained=nowhere)) == ""


def test_a_suspect_that_walks_where_no_fit_was_is_not_claimed(history: History) -> None:
    """What it had to move for may be the law."""
    shown = with_last(history, (kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.5),))
    alarm = replace(shown.detections[-1], walk=Walk(parameter="K1", sd=4.7, from_start=True))
    diagnosis = replace(shown.diagnoses[-1], mismatch=0.5)
    shown = replace(shown, detections=(alarm,), open=alarm, diagnoses=(diagnosis,))
    told = verdict_sentence(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    assert told.startswith(
        "K1 had to move too far while an input was where no recording of the fit had it. A law that is off there does "
        "that as well as a fault (50.0 %): no fault is claimed. Nearest comes a change of the pipe"
    )


@pytest.mark.parametrize(("names", "said"), [(("pipe",), "pipe was"), (("pump", "leak"), "pump and leak were")])
def test_what_is_superseded_is_told_in_the_right_number(names: tuple[str, ...], said: str) -> None:
    """Of one part, and of two."""
    does = "does" if len(names) == 1 else "do"
    told = superseded_sentence(Superseded(components=names, until=12.0))
    assert told.startswith(f"Up to 12 s {said} sure to be at fault, and {does} not explain what came then.")


@pytest.mark.parametrize("walker", ["", "K1"])
def test_what_is_trusted_and_has_changed_is_told(walker: str, history: History) -> None:
    """Where no suspect changed, what counts as healthy did: that is told, also where a suspect raised the alarm."""
    trusted = (replace(item, suspect=item.name not in ("K3", "K6")) for item in GRAPH.parameters)
    graph = replace(GRAPH, parameters=tuple(trusted))
    best = kind_of(suspect(graph, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.05)
    shown = with_last(history, (best,))
    walk = Walk(parameter=walker, sd=4.7, from_start=True) if walker else None
    alarm = replace(shown.detections[-1], walk=walk)
    diagnosis = replace(shown.diagnoses[-1], mismatch=0.93, elsewhere=("K3", "K6"))
    shown = replace(shown, detections=(alarm,), open=alarm, diagnoses=(diagnosis,))
    told = verdict_sentence(graph, shown, RunCounts(samples=9), Notation.FILE)
    assert told == (
        "Most likely the model is off (93.0 %): no suspect changed, but K3 and K6, which count as healthy, are "
        "far from where they are declared. Of what may fail say `suspect: yes`; else mend what moves them."
    )
    hidden = verdict_sentence(
        GRAPH, shown, RunCounts(samples=9), Notation.FILE
    )  # suspects of which no run shows anything
    assert hidden == (
        "Most likely nothing that was tested changed (93.0 %): K3 and K6, which were not, are far from where they are "
        "declared."
    )


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("K3",), "K3 far from where it was, which counts as healthy then. Either it changed"),
        (("K3", "K6"), "K3 and K6 far from where they were, which count as healthy then. Either they changed"),
    ],
)
def test_what_the_nearest_takes_along_is_told(names: tuple[str, ...], said: str, history: History) -> None:
    """With what comes nearest, which is not claimed."""
    best = kind_of(suspect(GRAPH, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.5)
    shown = with_last(history, (best,))
    diagnosis = replace(shown.diagnoses[-1], mismatch=0.5, strained=names)
    shown = replace(shown, diagnoses=(diagnosis,))
    told = verdict_sentence(GRAPH, shown, RunCounts(samples=9), Notation.FILE)
    assert told.startswith(f"What comes nearest explains the data only with {said} besides, at another time, or the")
    assert "(50.0 %): no fault is claimed. Nearest comes a change of " in told
    assert mismatch_sentence(diagnosis).startswith("With 50.0 % more changed, or the model is off: ")


def test_a_model_that_is_known_to_alarm_is_told_with_its_cure(history: History) -> None:
    """Also where something walked, as long as that is not why it is held to be off."""
    graph = replace(GRAPH, false_alarms=2)
    best = kind_of(suspect(graph, "K1", 1.838, 0.025), (FaultKind.STEP, 1.0), probability=0.3)
    shown = with_last(history, (best,))
    walked = replace(shown.detections[-1], walk=Walk(parameter="K1", sd=4.7, from_start=True))
    diagnosis = replace(shown.diagnoses[-1], mismatch=2 / 3)
    for alarm in (shown.detections[-1], walked):
        shown = replace(shown, detections=(alarm,), open=alarm, diagnoses=(diagnosis,))
        told = verdict_sentence(graph, shown, RunCounts(samples=9), Notation.FILE)
        off = "Most likely the model is off (66.7 %): it is known to alarm on healthy data (`false_alarms: 2`). "
        assert told.startswith(off + "`faultbond fit`")
        assert detection_sentence(alarm, is_known_to_alarm=True).startswith("Alarm at ")
        assert "Nearest comes a change of the pipe" in told
        view = view_of(graph, shown, RunCounts(samples=9), Notation.FILE)
        assert view.left_out.startswith("With 66.7 % the model is off: ")


def test_verdict_of_a_pair_names_both(history: History) -> None:
    """A pair is one explanation with two owners, also where a value fell."""
    pair = (suspect(GRAPH, "K1", 1.5, 0.1), suspect(GRAPH, "K4", 0.5, 0.1))
    text = sentence(history, Candidate(suspects=pair, probability=0.97, group=True))
    assert "the pipe and the outlet changed" in text
    assert "K4 fell from 2.35e-6" in text


def couple(first: Suspect, second: Suspect, kind: FaultKind) -> Candidate:
    """A fault of a kind, and a parameter that changed beside it."""
    return Candidate(suspects=(first, second), probability=0.97, group=True, kind=kind, kinds=((kind, 1.0),))


@pytest.mark.parametrize(
    ("first", "kind", "text"),
    [
        (wrong("flow.bias", 0.0, 1e-3 / 60.0, 2e-5 / 60.0), FaultKind.BIAS, "flow reads 1.000 l/min too high (bias)"),
        (wrong("flow.bias", 0.0, 1e-6, 1e-6), FaultKind.BIAS, "flow's bias may still be 0"),
        (wrong("flow.stuck", None, 1e-4, 1e-7), FaultKind.STUCK, "flow is stuck at 6.000 l/min"),
        (wrong("flow.bias", 0.0, 1e-3, np.inf), FaultKind.BIAS, f"the bias of flow is {UNDETERMINED}"),
    ],
)
def test_verdict_of_an_instrument_with_a_component(
    history: History, first: Suspect, kind: FaultKind, text: str
) -> None:
    """Both are at fault, and it is said which of them reads wrongly."""
    told = sentence(history, couple(first, suspect(GRAPH, "K4", 0.5, 0.01), kind))
    assert "the flow sensor and the outlet are at fault: " in told
    assert f"{text}; K4 fell from 2.35e-6" in told


def test_verdict_of_a_drift_beside_a_step(history: History) -> None:
    """One moves, the other changed: neither word is used of both, also where nothing explains the data."""
    one = couple(moving(GRAPH, "K1", 1.5, 1e8), suspect(GRAPH, "K4", 0.5, 0.01), FaultKind.DRIFT)
    told = sentence(history, one)
    assert "the pipe and the outlet are at fault: K1 is " in told
    assert "and rises by" in told
    assert told.count(" per ") == 1
    both = replace(one, suspects=(one.suspects[0], moving(GRAPH, "K4", 0.5, -1e-10)))
    assert "the pipe and the outlet drift: " in sentence(history, both)


def test_group_of_several_is_not_decided(history: History) -> None:
    """Where several cannot be told apart all are named, and so is what they share."""
    group = [
        Candidate(suspects=(suspect(GRAPH, "K6", 3.0, 0.1),), probability=0.6, group=True),
        Candidate(
            suspects=(suspect(GRAPH, "K6", 3.0, 0.1), suspect(GRAPH, "K4", 1.3, 0.1)), probability=0.3, group=True
        ),
        Candidate(suspects=(suspect(GRAPH, "K1", 1.3, 0.1),), probability=0.1, group=False),
    ]
    text = sentence(history, *group)
    assert text.startswith("Cannot yet be told apart: leak K6 (60 %) and leak K6 with outlet K4 (30 %);")
    assert "pipe" not in text
    assert text.endswith("All contain K6 of the leak.")


def test_each_of_a_set_has_its_own_kind(history: History) -> None:
    """Where one drifts, or is an instrument, the word stands behind that one."""
    drifting = couple(moving(GRAPH, "K1", 1.5, 1e8), suspect(GRAPH, "K4", 0.5, 0.01), FaultKind.DRIFT)
    gain = couple(wrong("u_in.gain", 1.0, 0.6, 0.02), wrong("flow.bias", 0.0, 1e-4, 1e-5), FaultKind.GAIN)
    text = sentence(history, replace(drifting, probability=0.6), replace(gain, probability=0.4))
    assert "pipe K1 drifting with outlet K4 (60 %) and input u_in gain with flow sensor bias (40 %)" in text
    ramp = replace(drifting.suspects[1], began=10.0, ended=50.0)
    both = replace(drifting, suspects=(drifting.suspects[0], ramp), probability=0.4)
    text = sentence(history, replace(drifting, probability=0.6), both)
    assert "pipe K1 drifting with outlet K4 changed over a while (40 %)" in text


def test_unknown_value_is_called_so(history: History) -> None:
    """An estimate as uncertain as a faulty value is beforehand is not printed as a number."""
    loose = Candidate(suspects=(suspect(GRAPH, "K1", 1.5, 1.95),), probability=0.99, group=True)
    assert f"K1 is {UNDETERMINED}" in sentence(history, loose)
    row = table_rows(GRAPH, Diagnosis(time=0.0, candidates=(loose,)), Notation.FILE)[0]
    assert (row.suspects[0].estimate, row.suspects[0].change) == (UNDETERMINED, "")


def test_no_fault_states_samples_and_time() -> None:
    """A healthy run says how much was looked at."""
    run = tank_history(GRAPH, samples=4920, fault=False)
    assert verdict_sentence(GRAPH, run, counts_of(run), Notation.FILE) == "No fault found in 4920 samples (82 min)."


def test_detection_without_diagnosis_says_so(history: History) -> None:
    """An alarm right before the end of the data still gives a sentence."""
    run = replace(history, diagnoses=())
    assert "no diagnosis yet" in verdict_sentence(GRAPH, run, counts_of(run), Notation.FILE)


def test_alarm_names_signal_onset_and_delay(history: History) -> None:
    """The alarm is dated on the recording's clock."""
    text = detection_sentence(history.detections[0])
    assert text == "Fault detected at 876 s in flow; it has shown since about 609 s (delay 4.45 min)."


def test_alarm_by_a_walk_names_the_parameter(history: History) -> None:
    """And from when on it was there."""
    alarm = replace(history.detections[0], walk=Walk(parameter="K1", sd=8.04, from_start=False))
    text = detection_sentence(alarm)
    assert text.startswith(
        "Fault detected at 876 s, by K1, which the healthy model had to move 8.0 times as far as is usual;"
    )
    assert "it began after 609 s" in text
    first = detection_sentence(replace(alarm, walk=Walk(parameter="K1", sd=3.6, from_start=True)))
    assert first.endswith("3.6 times as far as its accuracy: it was there from 609 s on.")
    all_ = detection_sentence(replace(alarm, walk=Walk(parameter="K1", sd=3.4, from_start=False, together=True)))
    assert "by K1 and others, which the healthy model had to move 3.4 times as far as is usual;" in all_


def test_a_value_that_still_moves_is_told_as_such(history: History) -> None:
    """Beside what it is."""
    last = history.diagnoses[-1]
    best = last.candidates[0]
    moving = replace(best, suspects=tuple(replace(item, moved=6.0) for item in best.suspects))
    run = replace(
        history, diagnoses=(*history.diagnoses[:-1], replace(last, candidates=(moving, *last.candidates[1:])))
    )
    assert "still moves" not in verdict_sentence(GRAPH, history, counts_of(history), Notation.FILE)
    assert "(this value still moves)" in verdict_sentence(GRAPH, run, counts_of(run), Notation.FILE)


def test_of_an_input_whose_record_has_stopped_no_value_is_told(history: History) -> None:
    """What acts is not known then, whichever kind of fault comes nearest; beside another suspect it is told alike."""
    still = replace(wrong("u_in.bias", 0.0, -6.8, 0.1), stopped=1500.0, moved=6.0)
    best = kind_of(still, (FaultKind.INTERMITTENT, 1.0), probability=0.993, there=False)
    told = "its record has stood still since 1500 s, so its meter has stuck"
    assert (
        sentence(history, best)
        == f"Most likely the input u_in is at fault: {told}, and what acts is not known, 99.3 % sure."
    )
    (row,) = table_rows(GRAPH, with_last(history, (best,)).diagnoses[-1], Notation.FILE)
    assert row.kinds == ("record stands",)
    both = replace(best, suspects=(still, suspect(GRAPH, "K1", 1.838, 0.025)), kind=FaultKind.BIAS)
    assert "u_in's record has stood still since 1500 s, so its meter has stuck; K1 rose" in sentence(history, both)


def test_table_is_short_and_counts_the_rest(history: History) -> None:
    """At most eight rows are shown, and the rest is counted with a bound that holds."""
    first = history.diagnoses[0]
    rows = table_rows(GRAPH, first, Notation.FILE)
    assert len(rows) == 8
    text = remainder_text(first, rows)
    assert text.startswith(f"... and {len(first.candidates) - 8} more below ")
    assert float(text.split()[-2]) / 100.0 >= first.candidates[8].probability


def test_negligible_candidates_are_not_listed() -> None:
    """When one explanation is sure only two others are shown for comparison."""
    sure = tank_history(GRAPH).diagnoses[-1]
    rows = table_rows(GRAPH, sure, Notation.FILE)
    assert len(rows) == 3
    assert remainder_text(sure, rows) == f"... and {len(sure.candidates) - 3} more below 0.1 %"


@pytest.mark.parametrize("off", [0.0, 0.5])
def test_an_even_share_of_what_tells_none_apart_is_no_finding(off: float) -> None:
    """Sets that have that alone are counted, not listed; as much that the data say of them is."""
    names = ("K1", "K2", "K3", "K4", "K7", "K8")
    of_sets = (0.4 + off / 6, *(5 * [(0.6 - off) / 5 + off / 6]))
    candidates = tuple(
        replace(kind_of(suspect(GRAPH, name, 1.5, 0.1), (FaultKind.STEP, 1.0), probability=share), group=False)
        for name, share in zip(names, of_sets, strict=True)
    )
    told = Diagnosis(time=0.0, candidates=candidates, mismatch=off)
    assert len(table_rows(GRAPH, told, Notation.FILE)) == 6
    sure = tuple(replace(item, probability=off / 6) for item in candidates[1:])
    told = replace(told, candidates=(replace(candidates[0], probability=1.0 - 5 * off / 6), *sure))
    assert len(table_rows(GRAPH, told, Notation.FILE)) == 3


def test_where_the_data_contradict_all_nothing_is_called_likely(history: History) -> None:
    """They are ranked, and counted, by nearness alone; nor is it told how likely it is that nothing is at fault."""
    found = Unexplained(signal="flow", sd=4.0, since=1.0, until=9.0)
    contradicted = replace(history.diagnoses[0], unexplained=found, within_accuracy=0.4)
    rows = table_rows(GRAPH, contradicted, Notation.FILE)
    assert {(row.percent, row.probability) for row in rows} == {("", 0.0)}
    assert [row.suspects for row in rows] == [
        row.suspects for row in table_rows(GRAPH, history.diagnoses[0], Notation.FILE)[: len(rows)]
    ]
    assert remainder_text(contradicted, rows) == f"... and {len(contradicted.candidates) - len(rows)} more"
    shown = replace(history, diagnoses=(contradicted,))
    assert view_of(GRAPH, shown, RunCounts(samples=9), Notation.FILE).left_out == ""


def test_component_probability_sums_over_sets(history: History) -> None:
    """A component is as probable as all sets together that contain it."""
    diagnosis = history.diagnoses[0]
    expected = sum(c.probability for c in diagnosis.candidates if "pipe" in c.components)
    assert fault_probabilities(diagnosis, instruments=False)["pipe"] == pytest.approx(expected)


def test_a_sensor_is_no_component_of_the_same_name() -> None:
    """Where a sensor bears the name of a component its faults do not colour the component."""
    found = (
        Candidate(suspects=(wrong("pipe.bias", 0.0, 1.0, 0.1),), probability=0.7, group=True),
        Candidate(suspects=(suspect(GRAPH, "K1", 1.5, 0.1),), probability=0.3, group=True),
    )
    diagnosis = Diagnosis(time=0.0, candidates=found)
    assert fault_probabilities(diagnosis, instruments=False) == {"pipe": 0.3}
    assert fault_probabilities(diagnosis, instruments=True) == {"pipe": 0.7}


def test_values_are_in_units_of_the_model_file(history: History) -> None:
    """A parameter given in bar is reported in bar."""
    parameters = tuple(replace(p, unit=Unit("bar", 1e5)) if p.name == "K8" else p for p in GRAPH.parameters)
    graph = replace(GRAPH, parameters=parameters)
    best = Candidate(suspects=(suspect(GRAPH, "K8", 0.5, 0.01),), probability=0.99, group=True)
    text = verdict_sentence(graph, with_last(history, (best,)), RunCounts(samples=9), Notation.FILE)
    assert "K8 fell from 0.6465 to 0.323 bar" in text


def test_bias_of_a_sensor_has_its_unit_without_offset() -> None:
    """The bias of a sensor is a difference in the sensor's unit."""
    assert unit_of(GRAPH, "pressure.bias") == Unit("kPa", 1e3)
    assert unit_of(GRAPH, "pressure.gain").text == ""
