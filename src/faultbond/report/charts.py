"""The charts of the page as plain data: numbers in the model file's units, thinned, ready for JSON."""

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.model.graph import BondGraph, Unit
from faultbond.report.numbers import Notation, exponent_of, is_unix, power_of_ten, unit_text
from faultbond.report.suspects import title_of, unit_of
from faultbond.report.thin import thin
from faultbond.report.verdict import best_group, last_diagnosis, set_key, set_name
from faultbond.runtime.history import Candidate, Diagnosis, History, Suspect
from faultbond.types import FloatArray

POINTS = 4000  # per trace
ALL_POINTS = 120_000  # numbers of the whole page, so that many sensors still give a small file
LEADING = 6  # candidates with a line of their own
ESTIMATES = 4  # charts of parameters
DIGITS = 6  # significant, of every number

Json = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Trace:
    """One line of a chart; `sd` draws a band of `factor` standard deviations about it."""

    label: str
    values: FloatArray
    color: str  # name of a colour of the style sheet
    sd: FloatArray | None = None
    factor: float = 2.0
    width: float = 1.6
    stepped: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chart:
    """Lines over a common time axis; `level` is a horizontal line with a name, `limits` are further ones."""

    title: str
    unit: str
    time: FloatArray
    traces: tuple[Trace, ...]
    level: tuple[float, str] | None = None
    limits: tuple[float, ...] = ()
    lowest: float | None = None
    highest: float | None = None
    relative_to: float | None = None  # adds an axis in per cent of this value


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Section:
    """Charts under one heading."""

    title: str
    text: str
    charts: tuple[Chart, ...]


def sections(graph: BondGraph, history: History) -> tuple[Section, ...]:
    """Give all charts of a run, by heading; headings without a chart are left out."""
    found = (
        Section(
            title="Measured and expected",
            text="The band is two standard deviations about what the healthy model expects.",
            charts=_sensor_charts(graph, history),
        ),
        Section(title="Inputs", text="As recorded.", charts=_input_charts(graph, history)),
        Section(
            title="Detector",
            text="How far each statistic is on its way to its limit; the alarm is raised at 1.",
            charts=_detector_charts(graph, history),
        ),
        Section(
            title="Probability of each explanation",
            text="After the alarm; all tested sets together make 100 %.",
            charts=_probability_charts(graph, history),
        ),
        Section(
            title="Estimates",
            text="What the best explanations suspect; the band is one standard deviation.",
            charts=_estimate_charts(graph, history),
        ),
    )
    return tuple(section for section in found if section.charts)


def payload(history: History, charts: Sequence[Chart]) -> Json:
    """Give everything that the page's script draws, fit for `json.dumps` without nan."""
    start = float(history.time[0]) if len(history.time) else 0.0
    end = float(history.time[-1]) if len(history.time) else 1.0
    arrays = sum(len(chart.traces) + sum(trace.sd is not None for trace in chart.traces) + 1 for chart in charts)
    points = max(200, min(POINTS, ALL_POINTS // max(arrays, 1)))
    marks = [
        {"x": _number(moment - start), "label": label}
        for detection in history.detections
        for moment, label in ((detection.change_time, "onset"), (detection.time, "alarm"))
    ]
    marks += [{"x": _number(item.time - start), "label": "accepted"} for item in history.accepted if item.time >= start]
    return {
        "start": start,
        "length": end - start,
        "calendar": is_unix(start),
        "marks": marks,
        "charts": [_chart_json(chart, start, points) for chart in charts],
    }


def _chart_json(chart: Chart, start: float, points: int) -> Json:
    rows = thin([trace.values for trace in chart.traces], points)
    exponent = _axis_exponent(chart)
    shrink = 10.0**exponent
    scale = f"{power_of_ten(exponent)} {chart.unit}".strip() if exponent else chart.unit
    levels = [*([chart.level] if chart.level else []), *((limit, "limit") for limit in chart.limits)]
    return {
        "unit": scale,
        "x": _numbers(chart.time[rows] - start, 9),
        "levels": [[_number(value / shrink), label] for value, label in levels],
        "lowest": chart.lowest,
        "highest": chart.highest,
        "relativeTo": _number(chart.relative_to / shrink) if chart.relative_to else None,
        "traces": [
            {
                "label": trace.label,
                "color": trace.color,
                "width": trace.width,
                "stepped": trace.stepped,
                "factor": trace.factor,
                "y": _numbers(trace.values[rows] / shrink),
                "sd": None if trace.sd is None else _numbers(trace.sd[rows] / shrink),
            }
            for trace in chart.traces
        ],
    }


def _axis_exponent(chart: Chart) -> int:
    values = np.concatenate([trace.values for trace in chart.traces])
    finite = np.abs(values[np.isfinite(values)])
    return exponent_of(float(finite.max())) if len(finite) else 0


def _numbers(values: FloatArray, digits: int = DIGITS) -> list[float | int | None]:
    return [_number(float(value), digits) for value in values]


def _number(value: float, digits: int = DIGITS) -> float | int | None:
    """Round for JSON: whole numbers as integers, not finite as null."""
    if not math.isfinite(value):
        return None
    rounded = float(f"{value:.{digits}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


def _sensor_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    charts = []
    for k, sensor in enumerate(graph.sensors):
        unit = sensor.unit
        expected = Trace(
            label="expected",
            values=_from_si(history.expected[:, k], unit),
            color="expected",
            sd=history.expected_sd[:, k] / unit.factor,
            width=1.8,
        )
        measured = Trace(label="measured", values=_from_si(history.measured[:, k], unit), color="measured", width=1.0)
        label = unit_text(unit.text, Notation.PRINT)
        charts.append(Chart(title=sensor.name, unit=label, time=history.time, traces=(measured, expected)))
    return tuple(charts)


def _from_si(values: FloatArray, unit: Unit) -> FloatArray:
    return (values - unit.offset) / unit.factor


def _input_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per unit of the inputs."""
    by_unit: dict[str, list[Trace]] = {}
    for k, item in enumerate(graph.inputs):
        traces = by_unit.setdefault(unit_text(item.unit.text, Notation.PRINT), [])
        values = _from_si(history.inputs[:, k], item.unit)
        traces.append(Trace(label=item.name, values=values, color=f"line{len(traces) % 7}", stepped=True))
    return tuple(
        Chart(title=", ".join(trace.label for trace in traces), unit=unit, time=history.time, traces=tuple(traces))
        for unit, traces in by_unit.items()
    )


def _detector_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give all statistics in one chart, each divided by its limit."""
    names = [f"CUSUM of {sensor.name}" for sensor in graph.sensors]
    shares = [history.cusum[:, k] / history.cusum_limit for k in range(history.cusum.shape[1])]
    names += [f"slow error of {name}" for name in history.slow_names]
    shares += [np.abs(history.slow[:, k]) / history.slow_limit for k in range(history.slow.shape[1])]
    if not shares:
        return ()
    traces = tuple(
        Trace(label=name, values=values, color=f"line{k % 7}", width=1.3)
        for k, (name, values) in enumerate(zip(names, shares, strict=True))
    )
    title = "statistic as a share of its limit"
    return (Chart(title=title, unit="", time=history.time, traces=traces, level=(1.0, "limit"), lowest=0.0),)


def _probability_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    diagnoses = [diagnosis for diagnosis in history.diagnoses if diagnosis.candidates]
    if not diagnoses:
        return ()
    table = [{set_key(candidate): candidate.probability for candidate in d.candidates} for d in diagnoses]
    leading = _leading(diagnoses)
    lines = {sets: np.array([row.get(sets, 0.0) for row in table]) for sets in leading}
    rest = np.maximum(1.0 - np.sum(list(lines.values()), axis=0), 0.0)
    traces = [
        Trace(label=set_name(graph, leading[sets]), values=100.0 * values, color=f"line{k % 7}", width=2.0)
        for k, (sets, values) in enumerate(lines.items())
    ]
    if any(len(row) > len(leading) for row in table):
        traces.append(Trace(label="all others", values=100.0 * rest, color="rest", width=1.3))
    times = np.array([diagnosis.time for diagnosis in diagnoses])
    return (Chart(title="probability", unit="%", time=times, traces=tuple(traces), lowest=0.0, highest=100.0),)


def _leading(diagnoses: Sequence[Diagnosis]) -> Mapping[tuple[str, ...], Candidate]:
    """Give the candidates worth a line: the best of the end, then those that once were most probable."""
    known: dict[tuple[str, ...], Candidate] = {}
    peak: dict[tuple[str, ...], float] = {}
    for diagnosis in diagnoses:
        for candidate in diagnosis.candidates:
            sets = set_key(candidate)
            known[sets] = candidate
            peak[sets] = max(peak.get(sets, 0.0), candidate.probability)
    final = set_key(diagnoses[-1].candidates[0])
    order = sorted(known, key=lambda sets: (sets != final, -peak[sets]))
    return {sets: known[sets] for sets in order[:LEADING]}


def _estimate_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per suspect of the best group."""
    last = last_diagnosis(history)
    if last is None:
        return ()
    chosen: dict[str, tuple[Candidate, Suspect]] = {}
    for candidate in best_group(last):
        for suspect in candidate.suspects:
            chosen.setdefault(suspect.parameter, (candidate, suspect))
    return tuple(_estimate_chart(graph, history, *found) for found in list(chosen.values())[:ESTIMATES])


def _estimate_chart(graph: BondGraph, history: History, candidate: Candidate, suspect: Suspect) -> Chart:
    """Draw a suspect as one candidate sees it, from diagnosis to diagnosis; `suspect` is its last state."""
    unit = unit_of(graph, suspect.parameter)
    rows = [
        (diagnosis.time, item.estimate, item.sd)
        for diagnosis in history.diagnoses
        for found in diagnosis.candidates
        if found.parameters == candidate.parameters
        for item in found.suspects
        if item.parameter == suspect.parameter
    ]
    times, estimates, sds = np.array(rows).T
    others = [other for other in candidate.parameters if other != suspect.parameter]
    nominal = None if suspect.nominal is None else unit.from_si(suspect.nominal)
    return Chart(
        title=title_of(graph, suspect) + (f", together with {', '.join(others)}" if others else ""),
        unit=unit_text(unit.text, Notation.PRINT),
        time=times,
        traces=(
            Trace(label="estimate", values=_from_si(estimates, unit), color="line0", sd=sds / unit.factor, factor=1.0),
        ),
        level=None if nominal is None else (nominal, "nominal"),
        limits=tuple(unit.from_si(item.limit) for item in suspect.forecasts),
        relative_to=nominal or None,
    )
