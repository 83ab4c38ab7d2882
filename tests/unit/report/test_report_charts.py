"""The charts of estimates and forecasts."""

import json
from dataclasses import replace

import numpy as np
import pytest

from fake import kind_of, moving, suspect, tank_graph, tank_history, wrong
from faultbond.contract.findings import Candidate, Diagnosis, Forecast, History, Suspect, Unexplained
from faultbond.report.chart import Chart, ChartLine, payload
from faultbond.report.run_figures import chart_sections, estimate_charts, forecast_charts
from faultbond.types import FaultKind

GRAPH = tank_graph()  # flow in l/min, pressure in kPa
RUN = tank_history(GRAPH, samples=1200)
LIMIT = Forecast(limit=4.8e11, time=1800.0, earliest=1500.0, latest=2500.0)


def run_of(*candidates: Candidate) -> History:
    """Give a run with one diagnosis for each candidate, 20 s apart, the last one at 1180 s."""
    times = 1180.0 - 20.0 * np.arange(len(candidates))[::-1]
    diagnoses = [Diagnosis(time=float(t), candidates=(item,)) for t, item in zip(times, candidates, strict=True)]
    return replace(RUN, diagnoses=tuple(diagnoses))


def only(charts: tuple[Chart, ...]) -> Chart:
    """Give the one chart."""
    (chart,) = charts
    return chart


@pytest.mark.parametrize(
    ("found", "kind", "title", "unit", "value", "level"),
    [
        (wrong("flow.bias", 0.0, 1e-3 / 60, 1e-5 / 60), FaultKind.BIAS, "bias of flow sensor", "l/min", 1.0, 0.0),
        (wrong("flow.gain", 1.0, 1.2, 0.01), FaultKind.GAIN, "gain of flow sensor", "", 1.2, 1.0),
        (
            wrong("pressure.stuck", None, 9100.0, 2.0),
            FaultKind.STUCK,
            "value at which the pressure sensor is stuck",
            "kPa",
            9.1,
            None,
        ),
        (wrong("u_in.bias", 0.0, 5.0, 1.0), FaultKind.BIAS, "bias of input u_in", "%", 5.0, 0.0),
    ],
)
def test_instruments_have_charts(
    found: Suspect, kind: FaultKind, title: str, unit: str, value: float, level: float | None
) -> None:
    """What is wrong with an instrument is drawn in its unit, without a nominal line where there is none."""
    chart = only(estimate_charts(GRAPH, run_of(*[kind_of(found, (kind, 1.0))] * 3)))
    assert (chart.title, chart.unit) == (title, unit)
    assert chart.traces[0].values == pytest.approx([value] * 3)
    assert (None if chart.level is None else chart.level[0]) == level
    assert payload(RUN.time, (), [chart])["charts"]


def test_other_kinds_of_an_instrument_are_not_mixed_in() -> None:
    """While the kind was another one the estimate was of something else, and is not drawn."""
    bias = kind_of(wrong("flow.bias", 0.0, 1e-5, 1e-6), (FaultKind.BIAS, 1.0))
    gain = kind_of(wrong("flow.gain", 1.0, 1.1, 0.01), (FaultKind.GAIN, 1.0))
    assert only(estimate_charts(GRAPH, run_of(bias, bias, gain))).time.tolist() == [1180.0]


def test_each_suspect_of_a_pair_has_its_own_chart() -> None:
    """A chart has the values of its own parameter, and names the one that it goes with."""
    pair = Candidate(
        suspects=(suspect(GRAPH, "K1", 1.5, 0.1), suspect(GRAPH, "K4", 0.5, 0.1)), probability=1.0, group=True
    )
    first, second = estimate_charts(GRAPH, run_of(pair, pair))
    assert (first.title, second.title) == ("K1 of pipe, together with K4", "K4 of outlet, together with K1")
    assert first.traces[0].values == pytest.approx([1.5 * 2.41e11] * 2)
    assert second.traces[0].values == pytest.approx([0.5 * 2.35e-6] * 2)


def test_a_fault_that_comes_and_goes_shows_what_is_in_force() -> None:
    """While it is gone the nominal value is in force; a step has no such line."""
    leak = suspect(GRAPH, "K6", 8.0, 0.1)
    kinds = (FaultKind.INTERMITTENT, 1.0)
    run = run_of(*(kind_of(leak, kinds, there=there) for there in (True, False, True)))
    traces = only(estimate_charts(GRAPH, run)).traces
    assert [trace.label for trace in traces] == ["estimate", "in force"]
    assert traces[1].values == pytest.approx([8.32e-5, 1.04e-5, 8.32e-5])
    assert len(only(estimate_charts(GRAPH, run_of(kind_of(leak, (FaultKind.STEP, 1.0))))).traces) == 1


def test_a_forecast_goes_from_now_to_the_limit() -> None:
    """Three lines lead from the estimate of now to the limit, each at its time; the past is drawn before them."""
    past = kind_of(moving(GRAPH, "K1", 1.5, 7.5e7, LIMIT), (FaultKind.DRIFT, 1.0))
    last = kind_of(moving(GRAPH, "K1", 1.82, 7.5e7, LIMIT), (FaultKind.DRIFT, 1.0))
    chart = only(forecast_charts(GRAPH, run_of(past, last)))
    assert chart.ahead_from == 1180.0
    assert chart.limits == (4.8e11,)
    assert chart.time.tolist() == [1160.0, 1180.0, 1500.0, 1800.0, 2500.0]
    lines = {trace.label: trace.values for trace in chart.traces}
    assert list(lines) == ["estimate", "early", "median", "late"]
    for label, end in (("early", 2), ("median", 3), ("late", 4)):
        assert lines[label][[1, end]] == pytest.approx([1.82 * 2.41e11, 4.8e11])
        assert np.isnan(lines[label][0])
        assert np.isnan(lines[label][end + 1 :]).all()
    assert np.isnan(lines["estimate"][2:]).all()
    drawn = payload(RUN.time, (), [chart])["charts"]
    assert isinstance(drawn, list)
    assert drawn[0]["now"] == 1180


@pytest.mark.parametrize(
    ("kind", "forecast"),
    [
        (FaultKind.STEP, LIMIT),
        (FaultKind.DRIFT, replace(LIMIT, time=None, latest=None)),
        (FaultKind.DRIFT, replace(LIMIT, time=None, earliest=None, latest=None)),
    ],
)
def test_no_forecast_without_a_way_to_the_limit(kind: FaultKind, forecast: Forecast) -> None:
    """A step goes nowhere, and a limit that is not reached has no line."""
    assert forecast_charts(GRAPH, run_of(kind_of(moving(GRAPH, "K1", 1.82, 7.5e7, forecast), (kind, 1.0)))) == ()


def test_a_limit_that_may_never_be_reached_ends_the_chart_early() -> None:
    """Without a latest time, and with one far away, the chart goes three times as far as the median."""
    for latest in (None, 1e9):
        drift = kind_of(moving(GRAPH, "K1", 1.82, 7.5e7, replace(LIMIT, latest=latest)), (FaultKind.DRIFT, 1.0))
        chart = only(forecast_charts(GRAPH, run_of(drift)))
        assert chart.time[-1] == pytest.approx(1180.0 + 3 * 620.0)


def test_limits_are_drawn_with_the_estimate_of_a_drift() -> None:
    """The limit is a line of the chart of estimates, where there is a forecast for it."""
    drift = kind_of(moving(GRAPH, "K1", 1.82, 7.5e7, LIMIT), (FaultKind.DRIFT, 1.0))
    assert only(estimate_charts(GRAPH, run_of(drift))).limits == (4.8e11,)
    assert chart_sections(GRAPH, run_of(drift))[-1].title == "Forecast"


def test_time_that_nothing_explains_is_shaded() -> None:
    """The chart of the sensor that is off shows since when, and no other chart does."""
    drift = kind_of(suspect(GRAPH, "K1", 1.5, 0.1), (FaultKind.STEP, 1.0))
    run = run_of(drift)
    off = Unexplained(signal="pressure", sd=3.0, since=1000.0, until=1180.0)
    run = replace(run, diagnoses=(replace(run.diagnoses[0], unexplained=off),))
    shades = [chart.shade for chart in chart_sections(GRAPH, run)[0].charts]
    assert shades == [None, (1000.0, 1180.0, "not explained")]
    assert [chart.shade for chart in chart_sections(GRAPH, run_of(drift))[0].charts] == [None, None]


def test_a_spread_beyond_all_numbers() -> None:
    """Beside a value that is next to nothing, a spread may be too large for any number; it is left out."""
    trace = ChartLine(label="estimate", values=np.full(3, 1e-297), color="line0", sd=np.full(3, 1e12))
    chart = Chart(title="K1", unit="", time=np.arange(3.0), traces=(trace,))
    text = json.dumps(payload(RUN.time, (), [chart])["charts"], allow_nan=False)
    assert '"y": [1, 1, 1], "sd": [null, null, null]' in text
