"""The charts of what is suspected: estimates from diagnosis to diagnosis, and where a drift leads."""

from math import isfinite

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Candidate, Forecast, History, Suspect
from faultbond.model.graph import BondGraph
from faultbond.report.chart import Chart, ChartLine
from faultbond.report.numbers import Notation, unit_text
from faultbond.report.suspects import title_of, unit_of
from faultbond.report.verdict import best_group, last_diagnosis
from faultbond.types import FaultKind

CHARTS = 4  # suspects shown
FARTHEST = 3.0  # a forecast is drawn so many times as far as its median


def estimate_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per suspect of the best group."""
    return tuple(_estimate_chart(graph, history, *found) for found in _suspects(history)[:CHARTS])


def forecast_charts(graph: BondGraph, history: History) -> tuple[Chart, ...]:
    """Give one chart per limit that a drift of the best group is on its way to."""
    last = last_diagnosis(history)
    return tuple(
        _forecast_chart(graph, history, candidate, suspect, item)
        for candidate, suspect in _suspects(history)[:CHARTS]
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
    shown = [
        ChartLine(
            label="estimate",
            values=(estimates - unit.offset) / unit.factor,
            color="line0",
            sd=sds / unit.factor,
            factor=1.0,
        )
    ]
    if candidate.kind is FaultKind.INTERMITTENT:
        values = (acting - unit.offset) / unit.factor
        shown.append(ChartLine(label="in force", values=values, color="line1", stepped=True))
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
    end = _end(now, item)
    ahead = np.unique([now, end, *(moment for moment in moments.values() if moment is not None and moment < end)])
    clock = np.concatenate([times, ahead[ahead > now]])
    past = np.full(len(clock) - len(times), np.nan)
    traces = [
        ChartLine(
            label="estimate",
            values=np.concatenate([(estimates - unit.offset) / unit.factor, past]),
            color="line0",
            sd=np.concatenate([sds / unit.factor, past]),
            factor=1.0,
        )
    ]
    for (label, moment), color in zip(moments.items(), ("line1", "line0", "line2"), strict=True):
        if moment is not None and moment > now:
            part = np.clip((clock - now) / (moment - now), 0.0, 1.0)
            line = suspect.estimate + part * (item.limit - suspect.estimate)
            line[(clock < now) | (clock > moment)] = np.nan
            traces.append(ChartLine(label=label, values=(line - unit.offset) / unit.factor, color=color, width=1.3))
    return Chart(
        title=f"{title_of(graph, suspect)}, on its way to the limit",
        unit=unit_text(unit.text, Notation.PRINT),
        time=clock,
        traces=tuple(traces),
        limits=(unit.from_si(item.limit),),
        ahead_from=now,
    )


def _end(now: float, item: Forecast) -> float:
    """Give the time up to which a forecast is drawn."""
    median = now if item.time is None else item.time
    farthest = now + FARTHEST * max(median - now, 1e-9)
    return farthest if item.latest is None else min(item.latest, farthest)
