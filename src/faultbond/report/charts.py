"""The charts of a run: what was measured and expected, inputs, detector, probabilities; estimates are in `tracks`."""

from collections.abc import Mapping, Sequence

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Diagnosis, History
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.chart import Chart, ChartLine, ChartSection
from faultbond.report.numbers import Notation, unit_text
from faultbond.report.tracks import estimate_charts, forecast_charts
from faultbond.report.verdict import open_diagnosis, set_key, set_name

LEADING = 6  # candidates with a line of their own


def sections(graph: BondGraph, history: History) -> tuple[ChartSection, ...]:
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
    charts = []
    for k, sensor in enumerate(graph.sensors):
        unit = sensor.unit
        expected = ChartLine(
            label="expected",
            values=_from_si(history.expected[:, k], unit),
            color="expected",
            sd=history.expected_sd[:, k] / unit.factor,
            width=1.8,
        )
        measured = ChartLine(
            label="measured", values=_from_si(history.measured[:, k], unit), color="measured", width=1.0
        )
        label = unit_text(unit.text, Notation.PRINT)
        shade = _not_explained(history, sensor.name)
        charts.append(Chart(title=sensor.name, unit=label, time=history.time, traces=(measured, expected), shade=shade))
    return tuple(charts)


def _not_explained(history: History, sensor: str) -> tuple[float, float, str] | None:
    """Give the time over which no candidate explains a sensor."""
    diagnosis = open_diagnosis(history)
    found = diagnosis.unexplained if diagnosis else None
    return (found.since, found.until, "not explained") if found and found.signal == sensor else None


def _from_si(values: FloatArray, unit: Unit) -> FloatArray:
    return (values - unit.offset) / unit.factor


def _input_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per unit of the inputs."""
    by_unit: dict[str, list[ChartLine]] = {}
    for k, item in enumerate(graph.inputs):
        traces = by_unit.setdefault(unit_text(item.unit.text, Notation.PRINT), [])
        values = _from_si(history.inputs[:, k], item.unit)
        traces.append(ChartLine(label=item.name, values=values, color=f"line{len(traces) % 7}", stepped=True))
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
        ChartLine(label=name, values=values, color=f"line{k % 7}", width=1.3)
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
        ChartLine(label=set_name(graph, leading[sets]), values=100.0 * values, color=f"line{k % 7}", width=2.0)
        for k, (sets, values) in enumerate(lines.items())
    ]
    if any(len(row) > len(leading) for row in table):
        traces.append(ChartLine(label="all others", values=100.0 * rest, color="rest", width=1.3))
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
