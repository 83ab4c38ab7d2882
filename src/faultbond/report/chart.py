"""A chart as plain data: numbers in the model file's units, thinned, ready for JSON."""

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import History
from faultbond.report.numbers import exponent_of, is_unix, power_of_ten
from faultbond.report.thin import thin

POINTS = 4000  # per trace
ALL_POINTS = 120_000  # numbers of the whole page, so that many sensors still give a small file
DIGITS = 6  # significant, of every number

Json = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChartLine:
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
    """Lines over a time axis; `level` is a horizontal line with a name, `limits` are further ones."""

    title: str
    unit: str
    time: FloatArray
    traces: tuple[ChartLine, ...]
    level: tuple[float, str] | None = None
    limits: tuple[float, ...] = ()
    lowest: float | None = None
    highest: float | None = None
    relative_to: float | None = None  # adds an axis in per cent of this value
    shade: tuple[float, float, str] | None = None  # begin and end on the clock, and what is between them
    ahead_from: float | None = None  # the chart has a time axis of its own, and goes beyond this time, which is now


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChartSection:
    """Charts under one heading."""

    title: str
    text: str
    charts: tuple[Chart, ...]


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
    shade = chart.shade
    levels = [*([chart.level] if chart.level else []), *((limit, "limit") for limit in chart.limits)]
    return {
        "unit": scale,
        "x": _numbers(chart.time[rows] - start, 9),
        "levels": [[_number(value / shrink), label] for value, label in levels],
        "lowest": chart.lowest,
        "highest": chart.highest,
        "relativeTo": _number(chart.relative_to / shrink) if chart.relative_to else None,
        "shade": [_number(shade[0] - start, 9), _number(shade[1] - start, 9), shade[2]] if shade else None,
        "now": None if chart.ahead_from is None else _number(chart.ahead_from - start, 9),
        "traces": [
            {
                "label": trace.label,
                "color": trace.color,
                "width": trace.width,
                "stepped": trace.stepped,
                "factor": trace.factor,
                "y": _numbers(_over(trace.values[rows], shrink)),
                "sd": None if trace.sd is None else _numbers(_over(trace.sd[rows], shrink)),
            }
            for trace in chart.traces
        ],
    }


def _over(values: FloatArray, shrink: float) -> FloatArray:
    """Divide; a spread that dwarfs the values may lie beyond all numbers."""
    with np.errstate(over="ignore"):
        return np.asarray(values / shrink)


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
