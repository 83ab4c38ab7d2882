"""Words, tables and charts about any diagnosis that a run may give, numbers without sense included."""

import json
import math
from dataclasses import replace
from pathlib import Path

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.contract.findings import (
    Advice,
    Candidate,
    Detection,
    Diagnosis,
    Forecast,
    History,
    Suspect,
    Unexplained,
)
from faultbond.contract.json_records import diagnosis_record
from faultbond.model.text import load_model
from faultbond.report import RunCounts, render_report
from faultbond.report.chart import payload
from faultbond.report.numbers import Notation
from faultbond.report.run_figures import chart_sections
from faultbond.report.verdict import table_rows, verdict_sentence
from faultbond.types import CheckKind, FaultKind

GRAPH = load_model(Path(__file__).parents[2] / "examples" / "tank" / "model.yaml")
ROWS = 40
NUMBERS = st.floats(allow_nan=True, allow_infinity=True)
SIZES = st.floats(0, 1e12) | st.just(math.inf) | st.just(math.nan)
TIMES = st.none() | st.floats(0, 1e12)
OF_SENSORS = ("bias", "gain", "stuck", "noise")


@st.composite
def suspects(draw: st.DrawFn) -> Suspect:
    """Give a parameter, or what is wrong with a sensor or input."""
    parameter = draw(st.sampled_from(GRAPH.parameters))
    name, component, nominal = parameter.name, parameter.owner, draw(st.sampled_from([parameter.nominal, 0.0]))
    if draw(st.booleans()):
        component = draw(st.sampled_from(["flow", "pressure", "u_in"]))
        word = "bias" if component == "u_in" else draw(st.sampled_from(OF_SENSORS))
        name, nominal = f"{component}.{word}", {"gain": 1.0, "noise": 2.8e-6}.get(word, 0.0)
        if word == "stuck":
            return Suspect(parameter=name, component=component, nominal=None, estimate=draw(NUMBERS), sd=draw(SIZES))
    moves = draw(st.booleans())
    forecasts = st.builds(Forecast, limit=st.floats(-1e12, 1e12), time=TIMES, earliest=TIMES, latest=TIMES)
    return Suspect(
        parameter=name,
        component=component,
        nominal=nominal,
        estimate=draw(NUMBERS),
        sd=draw(SIZES),
        rate=draw(NUMBERS) if moves else None,
        rate_sd=draw(SIZES) if moves else None,
        forecasts=tuple(draw(st.lists(forecasts, max_size=2))) if moves else (),
    )


@st.composite
def candidates(draw: st.DrawFn) -> Candidate:
    """Give a candidate of any kinds."""
    members = draw(st.lists(suspects(), min_size=1, max_size=3, unique_by=lambda item: item.parameter))
    kinds = draw(st.lists(st.sampled_from(FaultKind), min_size=1, max_size=3, unique=True))
    return Candidate(
        suspects=tuple(members),
        probability=draw(st.floats(0, 1)),
        group=draw(st.booleans()),
        kind=kinds[0],
        kinds=tuple((kind, 1.0 / len(kinds)) for kind in kinds),
        present=draw(st.booleans()),
    )


ADVICE = st.builds(
    Advice,
    kind=st.just(CheckKind.INPUT),
    target=st.just("u_in"),
    gain=st.floats(0, 3),
    cost=st.floats(0, 9),
    separates=st.just(((("pipe",),), (("flow",), ("pipe", "leak")))),
    value=st.none() | st.floats(0, 100),
    within=st.none() | st.floats(1, 1e6),
)
UNEXPLAINED = st.builds(
    Unexplained,
    signal=st.just("flow"),
    sd=st.floats(0, 100),
    since=st.floats(0, ROWS),
    until=st.floats(0, ROWS),
)


@st.composite
def histories(draw: st.DrawFn) -> History:
    """Give a short run with an alarm and some diagnoses."""
    start = draw(st.sampled_from([0.0, 1.7e9]))
    alarm = Detection(time=start + 9.0, sample=9, change_time=start + 3.0, signals=("flow",))
    flat = np.zeros((ROWS, 2))
    found = [
        Diagnosis(
            time=start + ROWS - 1.0,
            candidates=tuple(draw(st.lists(candidates(), min_size=1, max_size=3))),
            unexplained=draw(st.none() | UNEXPLAINED),
            advice=tuple(draw(st.lists(ADVICE, max_size=2))),
        )
        for _ in range(draw(st.integers(1, 2)))
    ]
    return History(
        time=start + np.arange(float(ROWS)),
        measured=flat,
        expected=flat,
        expected_sd=flat + 1.0,
        inputs=flat,
        cusum=flat,
        slow=flat,
        cusum_limit=25.0,
        slow_limits=np.full(2, 1.6),
        slow_names=("line.f", "outlet.f"),
        detections=(alarm,),
        open=alarm,
        diagnoses=tuple(found),
    )


@given(histories())
@settings(max_examples=60, deadline=None)
def test_everything_can_be_told(history: History) -> None:
    """There is always a sentence, a table and charts without nan, and the sentence is sure of nothing unexplained."""
    last = history.diagnoses[-1]
    for notation in Notation:
        verdict = verdict_sentence(GRAPH, history, RunCounts(samples=ROWS), notation)
        assert verdict.endswith(".")
        assert verdict.startswith("None of the modelled faults") is (last.unexplained is not None)
        assert len(table_rows(GRAPH, last, notation)) == len(last.candidates)
    charts = [chart for part in chart_sections(GRAPH, history) for chart in part.charts]
    json.dumps(payload(history.time, (), charts), allow_nan=False)
    assert len(diagnosis_record(last)) > 3


@given(histories())
@settings(max_examples=8, deadline=None)
def test_every_page_is_whole(history: History) -> None:
    """The page is made, and ends where it should."""
    page = render_report(GRAPH, replace(history), None, "engine", "1", RunCounts(samples=ROWS))
    assert page.rstrip().endswith("</html>")
