"""The charts of a run: measured and expected, inputs, detector, probabilities, estimates, and where a drift leads."""

from math import isfinite

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Forecast, History, Suspect
from faultbond.model.graph import BondGraph
from faultbond.report.chart import Chart, ChartLine, ChartSection, in_unit
from faultbond.report.numbers import Notation, unit_text
from faultbond.report.suspects import title_of, unit_of
from faultbond.report.verdict import best_group, last_diagnosis, open_diagnosis, set_name
from faultbond.types import FaultKind

LEADING = 6  # candidates with a line of their own
TRACKS = 4  # suspects whose estimates are shown
FARTHEST = 3.0  # a forecast is drawn so many times as far as its median


def chart_sections(graph: BondGraph, history: History) -> tuple[ChartSection, ...]:
    """Give all charts of a run, by heading; headings without a chart are left out."""
    found = (
        ChartSection(
            title="Measured and expected",
            text="The band is two standard deviations about what the healthy model expects.",
            charts=_sensor_charts(graph, history),
        ),
        ChartSection(title="Inputs", text="As recorded.", charts=_input_charts(graph, history)),
        ChartSection(
            title="Detector",
            text="How far each statistic is on its way to its limit; the alarm is raised at 1.",
            charts=_detector_charts(graph, history),
        ),
        ChartSection(
            title="Probability of each explanation",
            text="After the alarm; all tested sets together make 100 %.",
            charts=_probability_charts(graph, history),
        ),
        ChartSection(
            title="Estimates",
            text="What the best explanations suspect; the band is one standard deviation.",
            charts=estimate_charts(graph, history),
        ),
        ChartSection(
            title="Forecast",
            text="Where a drift leads: early, median and late are reached with a probability of 5, 50 and 95 %.",
            charts=forecast_charts(graph, history),
        ),
    )
    return tuple(section for section in found if section.charts)


def _sensor_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    diagnosis = open_diagnosis(history)
    found = diagnosis.unexplained if diagnosis else None
    charts = []
    for k, sensor in enumerate(graph.sensors):
        unit = sensor.unit
        measured, expected = (in_unit(values[:, k], unit) for values in (history.measured, history.expected))
        sd = history.expected_sd[:, k] / unit.factor
        traces = (
            ChartLine(label="measured", values=measured, color="measured", width=1.0),
            ChartLine(label="expected", values=expected, color="expected", sd=sd, width=1.8),
        )
        shade = (found.since, found.until, "not explained") if found and found.signal == sensor.name else None
        label = unit_text(unit.text, Notation.PRINT)
        charts.append(Chart(title=sensor.name, unit=label, time=history.time, traces=traces, shade=shade))
    return tuple(charts)


def _input_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per unit of the inputs."""
    by_unit: dict[str, list[ChartLine]] = {}
    for k, item in enumerate(graph.inputs):
        traces = by_unit.setdefault(unit_text(item.unit.text, Notation.PRINT), [])
        values = in_unit(history.inputs[:, k], item.unit)
        traces.append(ChartLine(label=item.name, values=values, color=f"line{len(traces) % 7}", stepped=True))
    return tuple(
        Chart(title=", ".join(trace.label for trace in traces), unit=unit, time=history.time, traces=tuple(traces))
        for unit, traces in by_unit.items()
    )


def _detector_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give all statistics in one chart, each divided by its limit."""
    names = [f"CUSUM of {sensor.name}" for sensor in graph.sensors]
    names += history.slow_names
    shares = [*(history.cusum / history.cusum_limit).T, *np.abs(history.slow / history.slow_limits).T]
    if not shares:
        return ()
    traces = tuple(
        ChartLine(label=name, values=values, color=f"line{k % 7}", width=1.3)
        for k, (name, values) in enumerate(zip(names, shares, strict=True))
    )
    title = "statistic as a share of its limit"
    return (Chart(title=title, unit="", time=history.time, traces=traces, level=(1.0, "limit"), lowest=0.0),)


def _probability_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Draw the candidates worth a line: the best of the end, then those that once were most probable."""
    diagnoses = [diagnosis for diagnosis in history.diagnoses if diagnosis.candidates]
    if not diagnoses:
        return ()
    table = [{_set_key(candidate): candidate.probability for candidate in item.candidates} for item in diagnoses]
    known = {_set_key(candidate): candidate for item in diagnoses for candidate in item.candidates}
    peak = {key: max(row.get(key, 0.0) for row in table) for key in known}
    final = _set_key(diagnoses[-1].candidates[0])
    leading = sorted(known, key=lambda key: (key != final, -peak[key]))[:LEADING]
    lines = {key: np.array([row.get(key, 0.0) for row in table]) for key in leading}
    traces = [
        ChartLine(label=set_name(graph, known[key]), values=100.0 * values, color=f"line{k % 7}", width=2.0)
        for k, (key, values) in enumerate(lines.items())
    ]
    if any(len(row) > len(leading) for row in table):
        rest = np.maximum(1.0 - np.sum(list(lines.values()), axis=0), 0.0)
        traces.append(ChartLine(label="all others", values=100.0 * rest, color="rest", width=1.3))
    times = np.array([diagnosis.time for diagnosis in diagnoses])
    return (Chart(title="probability", unit="%", time=times, traces=tuple(traces), lowest=0.0, highest=100.0),)


def _set_key(candidate: Candidate) -> tuple[str, ...]:
    """Give what a candidate is called throughout a run, while the kind of fault of an instrument may change."""
    return tuple(suspect.parameter.split(".")[0] + "." * ("." in suspect.parameter) for suspect in candidate.suspects)


def estimate_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per suspect of the best group."""
    return tuple(_estimate_chart(graph, history, *found) for found in _suspects(history)[:TRACKS])


def forecast_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per limit that a drift of the best group is on its way to."""
    last = last_diagnosis(history)
    return tuple(
        _forecast_chart(graph, history, candidate, suspect, item)
        for candidate, suspect in _suspects(history)[:TRACKS]
        if candidate.kind is FaultKind.DRIFT and isfinite(suspect.estimate)
        for item in suspect.forecasts
        if last is not None and item.time is not None and item.time > last.time
    )


def _suspects(history: History) -> list[tuple[Candidate, Suspect]]:
    """Give the suspects of the best group at the end, each with the best candidate that has it."""
    last = last_diagnosis(history)
    chosen: dict[str, tuple[Candidate, Suspect]] = {}
    for candidate in best_group(last) if last else ():
        for suspect in candidate.suspects:
            chosen.setdefault(suspect.parameter, (candidate, suspect))
    return list(chosen.values())


def _track(history: History, candidate: Candidate, suspect: Suspect) -> tuple[FloatArray, ...]:
    """Give times, estimates, standard deviations, and values that act, of a suspect as one candidate sees it; SI."""
    rows = [
        (diagnosis.time, item.estimate, item.sd, item.estimate if found.present else item.nominal)
        for diagnosis in history.diagnoses
        for found in diagnosis.candidates
        if found.parameters == candidate.parameters
        for item in found.suspects
        if item.parameter == suspect.parameter
    ]
    return tuple(np.array(rows, dtype=np.float64).T)


def _estimate_chart(graph: BondGraph, history: History, candidate: Candidate, suspect: Suspect) -> Chart:
    """Draw a suspect from diagnosis to diagnosis; `suspect` is its last state."""
    unit = unit_of(graph, suspect.parameter)
    times, estimates, sds, acting = _track(history, candidate, suspect)
    values = in_unit(estimates, unit)
    shown = [ChartLine(label="estimate", values=values, color="line0", sd=sds / unit.factor, factor=1.0)]
    if candidate.kind is FaultKind.INTERMITTENT:
        shown.append(ChartLine(label="in force", values=in_unit(acting, unit), color="line1", stepped=True))
    others = [other for other in candidate.parameters if other != suspect.parameter]
    nominal = None if suspect.nominal is None else unit.from_si(suspect.nominal)
    return Chart(
        title=title_of(graph, suspect) + (f", together with {', '.join(others)}" if others else ""),
        unit=unit_text(unit.text, Notation.PRINT),
        time=times,
        traces=tuple(shown),
        level=None if nominal is None else (nominal, "nominal"),
        limits=tuple(unit.from_si(item.limit) for item in suspect.forecasts),
        relative_to=nominal or None,
    )


def _forecast_chart(
    graph: BondGraph, history: History, candidate: Candidate, suspect: Suspect, item: Forecast
) -> Chart:
    """Draw a drift up to now, and from there to a limit."""
    unit = unit_of(graph, suspect.parameter)
    times, estimates, sds, _ = _track(history, candidate, suspect)
    now = float(times[-1])
    moments = {"early": item.earliest, "median": item.time, "late": item.latest}
    median = now if item.time is None else item.time
    farthest = now + FARTHEST * max(median - now, 1e-9)  # up to here the forecast is drawn
    end = farthest if item.latest is None else min(item.latest, farthest)
    ahead = np.unique([now, end, *(moment for moment in moments.values() if moment is not None and moment < end)])
    clock = np.concatenate([times, ahead[ahead > now]])
    past = np.full(len(clock) - len(times), np.nan)
    values, sd = (np.concatenate([part, past]) for part in (in_unit(estimates, unit), sds / unit.factor))
    traces = [ChartLine(label="estimate", values=values, color="line0", sd=sd, factor=1.0)]
    for (label, moment), color in zip(moments.items(), ("line1", "line0", "line2"), strict=True):
        if moment is not None and moment > now:
            part = np.clip((clock - now) / (moment - now), 0.0, 1.0)
            line = suspect.estimate + part * (item.limit - suspect.estimate)
            line[(clock < now) | (clock > moment)] = np.nan
            traces.append(ChartLine(label=label, values=in_unit(line, unit), color=color, width=1.3))
    return Chart(
        title=f"{title_of(graph, suspect)}, on its way to the limit",
        unit=unit_text(unit.text, Notation.PRINT),
        time=clock,
        traces=tuple(traces),
        limits=(unit.from_si(item.limit),),
        ahead_from=now,
    )
