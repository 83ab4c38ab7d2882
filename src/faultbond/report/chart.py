"""A chart as plain data: numbers in the model file's units, thinned to fewer points that show the same, for JSON."""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import FloatArray
from faultbond.model.graph import Unit
from faultbond.report.numbers import exponent_of, is_unix, power_of_ten

POINTS = 4000  # per trace
ALL_POINTS = 120_000  # numbers of the whole page, so that many sensors still give a small file
DIGITS = 6  # significant, of every number

Json = dict[str, object]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ChartLine:
    """One line of a chart, `values` (n,); `sd` (n,) draws a band of `factor` standard deviations about it."""

    label: str
    values: FloatArray
    color: str  # name of a colour of the style sheet
    sd: FloatArray | None = None
    factor: float = 2.0
    width: float = 1.6
    stepped: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Chart:
    """Lines over a time axis, `time` (n,), s; `level` is a horizontal line with a name, `limits` are further ones."""

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


def in_unit(values: FloatArray, unit: Unit) -> FloatArray:
    """Give SI values, of any shape, in a unit of the model file."""
    return (values - unit.offset) / unit.factor


def payload(time: FloatArray, marks: Iterable[tuple[float, str]], charts: Sequence[Chart]) -> Json:
    """Give everything that the page's script draws, fit for `json.dumps` without nan.

    Parameters
    ----------
    time : (n,), s, on the clock of the recording
    marks : moments on that clock, s, and their labels
    charts : all charts of the page
    """
    start, end = (float(time[0]), float(time[-1])) if len(time) else (0.0, 1.0)
    arrays = sum(len(chart.traces) + sum(trace.sd is not None for trace in chart.traces) + 1 for chart in charts)
    points = max(200, min(POINTS, ALL_POINTS // max(arrays, 1)))
    return {
        "start": start,
        "length": end - start,
        "calendar": is_unix(start),
        "marks": [{"x": _number(moment - start), "label": label} for moment, label in marks],
        "charts": [_chart_json(chart, start, points) for chart in charts],
    }


def _chart_json(chart: Chart, start: float, points: int) -> Json:
    rows = thin([trace.values for trace in chart.traces], points)
    values = np.concatenate([trace.values for trace in chart.traces])
    exponent = exponent_of(float(np.abs(values[np.isfinite(values)]).max(initial=0.0)))
    shrink = 10.0**exponent
    levels = [*([chart.level] if chart.level else []), *((limit, "limit") for limit in chart.limits)]
    with np.errstate(over="ignore"):  # a spread that dwarfs the values may lie beyond all numbers
        traces = [
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
        ]
    return {
        "unit": f"{power_of_ten(exponent)} {chart.unit}".strip() if exponent else chart.unit,
        "x": _numbers(chart.time[rows] - start, 9),
        "levels": [[_number(value / shrink), label] for value, label in levels],
        "lowest": chart.lowest,
        "highest": chart.highest,
        "relativeTo": _number(chart.relative_to / shrink) if chart.relative_to else None,
        "shade": [*(_number(end - start, 9) for end in chart.shade[:2]), chart.shade[2]] if chart.shade else None,
        "now": None if chart.ahead_from is None else _number(chart.ahead_from - start, 9),
        "traces": traces,
    }


def _numbers(values: FloatArray, digits: int = DIGITS) -> list[float | int | None]:
    return [_number(float(value), digits) for value in values]


def _number(value: float, digits: int = DIGITS) -> float | int | None:
    """Round for JSON: whole numbers as integers, not finite as null."""
    if not math.isfinite(value):
        return None
    rounded = float(f"{value:.{digits}g}")
    return int(rounded) if rounded.is_integer() and abs(rounded) < 1e15 else rounded


def thin(traces: Sequence[FloatArray], limit: int) -> NDArray[np.int64]:
    """Choose the samples to draw, common to all traces of a chart.

    Of each of equally long buckets the smallest and the largest value of each trace is kept, the first and the last
    sample always. A gap (nan) is kept where it covers at least half a bucket; where nothing is thinned, all are.

    Parameters
    ----------
    traces : float arrays, each of shape (n_samples,), any unit
    limit : number of points that should not be passed by more than one point per bucket and trace, for gaps

    Returns
    -------
    int array, (n_kept,), increasing
    """
    size = len(traces[0]) if traces else 0
    if size <= limit:
        return np.arange(size)
    buckets = max(1, limit // (2 * len(traces)))
    edges = np.linspace(0, size, buckets + 1).astype(np.int64)
    kept = {0, size - 1}
    for first, end in pairwise(edges):
        for trace in traces:
            part = trace[first:end]
            gaps = np.isnan(part)
            if not gaps.all():
                kept |= {first + int(np.nanargmin(part)), first + int(np.nanargmax(part))}
            if 2 * gaps.sum() >= len(part) > 0:
                kept.add(first + int(np.argmax(gaps)))
    return np.array(sorted(kept), dtype=np.int64)
