"""One self-contained HTML page about a fit: measured and simulated, what is left, its autocorrelation, the values."""

from collections.abc import Sequence

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.fit.whiteness import Whiteness
from faultbond.model.graph import BondGraph
from faultbond.report.chart import Chart, ChartLine, ChartSection, in_unit, payload
from faultbond.report.fit_result import (
    HEADER,
    Fitted,
    doubt_sentences,
    fit_verdict,
    noise_rows,
    parameter_rows,
    remarks,
    size_lines,
)
from faultbond.report.html import render_page
from faultbond.report.numbers import MINUS, Notation, duration_text, unit_text
from faultbond.report.quiet_result import Quieted, quiet_parts, quiet_verdict

_WIDTH, _HEIGHT, _LEFT = 720.0, 120.0, 34.0  # px, of a drawing of correlations


def render_fit(fitted: Fitted, graph: BondGraph, quieted: Quieted | None = None) -> str:
    """Give the page about a fit as HTML text.

    Parameters
    ----------
    fitted : the fit
    graph : the model as it was given
    quieted : what else was done to it, with `--until-quiet`
    """
    found, records = fitted.found, fitted.found.records
    time, begins = _times(fitted)
    sections = _sections(fitted, time)
    data = payload(time, (), [chart for section in sections for chart in section.charts])
    marks = [{"x": begin - float(time[0]), "label": str(r)} for r, begin in enumerate(begins, start=1)]
    known, white = sum(item.determined for item in fitted.estimates), sum(item.white for item in found.whiteness)
    span = sum(float(item.time[-1] - item.time[0]) for item in records)
    return render_page(
        "fitted.html.j2",
        sections,
        data | {"marks": marks if len(marks) > 1 else []},
        {
            "name": fitted.graph.name,
            "state": "healthy" if _is_good(fitted, quieted) else "open",
            "verdict": _verdict(fitted, quieted),
            "facts": [
                ("Recordings", ", ".join(item.name for item in records)),
                ("Made by", f"faultbond {fitted.version}"),
            ],
            "cards": [
                ("Parameters", f"{known} of {len(fitted.estimates)}", "fixed by the data"),
                ("Sensors", f"{white} of {len(found.whiteness)}", "with nothing but white noise left"),
                ("Samples", f"{sum(len(item.time) for item in records)}", duration_text(span)),
                ("Search", f"{found.reached} of {found.starts}", "starts end at the same values"),
                ("Contradicted", str(len(found.contradicted)), "accuracies declared too small"),
            ],
            "header": HEADER,
            "rows": parameter_rows(fitted),
            "remarks": labelled(remarks(fitted)),
            "parts": [(part, labelled(part.lines)) for part in quiet_parts(graph, quieted)] if quieted else [],
            "noises": list(noise_rows(fitted)),
            "sizes": list(size_lines(fitted)),
            "correlations": [(item.sensor, _correlation_drawing(item)) for item in found.whiteness],
        },
    )


def _is_good(fitted: Fitted, quieted: Quieted | None) -> bool:
    """Whether nothing is left to be done."""
    return (
        fitted.found.summit.settled and not fitted.strays and not fitted.alarms and (quieted is None or quieted.quiet)
    )


def _verdict(fitted: Fitted, quieted: Quieted | None) -> str:
    """Say in some sentences what came of it, as on the terminal."""
    told = [fit_verdict(fitted), *doubt_sentences(fitted)]
    told.append(quiet_verdict(quieted) if quieted else "")
    return " ".join(text for text in told if text)


def labelled(told: Sequence[tuple[str, str]]) -> list[str]:
    """Give lines with their labels in front; what has none belongs to the one above."""
    found, label = [], ""
    for own, text in told:
        label = own or label
        found.append(f"{label}: {text}" if label else text)
    return found


def _times(fitted: Fitted) -> tuple[FloatArray, tuple[float, ...]]:
    """Give a clock that runs through all recordings, and where each begins; a single recording keeps its own."""
    pieces, begins, offset = list[FloatArray](), list[float](), 0.0
    for r, record in enumerate(fitted.found.records):
        begin = float(record.time[0])
        shift = 0.0 if r == 0 else offset - begin
        pieces.append(record.time + shift)
        begins.append(begin + shift)
        step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else 1.0
        offset = float(record.time[-1]) + shift + 2.0 * step
        pieces.append(np.array([offset - step]))
    return np.concatenate(pieces[:-1]), tuple(begins)


def _sections(fitted: Fitted, time: FloatArray) -> tuple[ChartSection, ...]:
    found = fitted.found
    measured = _joined([record.y for record in found.records])
    simulated = _joined(found.simulated)
    left = _joined([course.standardised for course in found.courses])
    compared, rests = [], []
    for k, sensor in enumerate(fitted.graph.sensors):
        first, second = (in_unit(values[:, k], sensor.unit) for values in (measured, simulated))
        traces = (
            ChartLine(label="measured", values=first, color="measured", width=1.0),
            ChartLine(label="simulated", values=second, color="expected", width=1.8),
        )
        label = unit_text(sensor.unit.text, Notation.PRINT)
        compared.append(Chart(title=sensor.name, unit=label, time=time, traces=traces))
        rest = (ChartLine(label="what is left", values=left[:, k], color="line0", width=1.0),)
        rests.append(Chart(title=sensor.name, unit="standard deviations", time=time, traces=rest, level=(0.0, "")))
    return (
        ChartSection(
            title="Measured and simulated",
            text="Simulated: the fitted plant under the recorded inputs alone, from the start that was found.",
            charts=tuple(compared),
        ),
        ChartSection(
            title="What is left from sample to sample",
            text="Each reading less what the readings before it foretold.",
            charts=tuple(rests),
        ),
    )


def _joined(parts: Sequence[FloatArray]) -> FloatArray:
    """Give values of all recordings, (n, n_outputs) each, one after the other, with a row of nan between."""
    gap = np.full((1, parts[0].shape[1]), np.nan)
    return np.concatenate([piece for part in parts for piece in (part, gap)][:-1])


def _correlation_drawing(item: Whiteness) -> str:
    """Draw the autocorrelation of a sensor's residuals as bars over the lag."""
    values = item.correlation
    middle, reach = _HEIGHT / 2.0, _HEIGHT / 2.0 - 12.0
    if not len(values):
        return f'<svg class="correlation" viewBox="0 0 {_WIDTH:.0f} 20"><text x="0" y="14">{item.words}</text></svg>'
    top = max(float(np.max(np.abs(values))), 2.0 * item.bound, 0.05)
    step = (_WIDTH - _LEFT) / len(values)
    band = reach * item.bound / top
    bars = "".join(
        f'<rect class="bar-of" x="{_LEFT + k * step + 0.2 * step:.1f}" width="{0.6 * step:.1f}" '
        f'y="{min(middle, middle - reach * value / top):.1f}" height="{abs(reach * value / top):.1f}"/>'
        for k, value in enumerate(values)
    )
    texts = "".join(
        f'<text x="0" y="{y + 4.0:.1f}">{text}</text>'
        for y, text in ((middle - reach, f"{top:.2g}"), (middle, "0"), (middle + reach, f"{MINUS}{top:.2g}"))
    )
    lags = "".join(
        f'<text x="{_LEFT + (lag - 0.5) * step:.1f}" y="{_HEIGHT:.1f}" text-anchor="middle">{lag}</text>'
        for lag in (1, *range(10, len(values) + 1, 10))
    )
    return (
        f'<svg class="correlation" viewBox="0 0 {_WIDTH:.0f} {_HEIGHT + 4.0:.0f}" role="img">'
        f'<rect class="bound" x="{_LEFT}" y="{middle - band:.1f}" width="{_WIDTH - _LEFT}" height="{2 * band:.1f}"/>'
        f'<line class="axis" x1="{_LEFT}" x2="{_WIDTH}" y1="{middle}" y2="{middle}"/>{bars}{texts}{lags}</svg>'
    )
