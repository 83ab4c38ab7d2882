"""One self-contained HTML page about a fit: measured and simulated, what is left, its autocorrelation, the values."""

from collections.abc import Callable, Sequence
from importlib import resources

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined

from faultbond.arrays import FloatArray
from faultbond.contract.findings import History
from faultbond.fit.whiteness import Whiteness
from faultbond.report.chart import Chart, ChartLine, ChartSection, payload
from faultbond.report.fitted import (
    HEADER,
    Fitted,
    noise_rows,
    parameter_row,
    remarks,
    size_lines,
    verdict,
)
from faultbond.report.numbers import Notation, duration_text, unit_text

_STATIC = resources.files("faultbond.report") / "static"
_WIDTH, _HEIGHT, _LEFT = 720.0, 120.0, 34.0  # px, of a drawing of correlations


def render_fit(fitted: Fitted) -> str:
    """Give the page about a fit as HTML text."""
    environment = Environment(
        loader=PackageLoader("faultbond.report", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False, "ensure_ascii": False}
    parts = _sections(fitted)
    return environment.get_template("fitted.html.j2").render(
        name=fitted.graph.name,
        state="healthy" if fitted.found.summit.settled else "open",
        verdict=verdict(fitted),
        facts=_facts(fitted),
        cards=_cards(fitted),
        header=HEADER,
        rows=[parameter_row(item) for item in fitted.estimates],
        remarks=[text for _, text in remarks(fitted)],
        noises=list(noise_rows(fitted)),
        sizes=list(size_lines(fitted)),
        sections=parts,
        correlations=[(item.sensor, correlation_drawing(item)) for item in fitted.found.whiteness],
        data=_payload(fitted, [chart for part in parts for chart in part.charts]),
        style=_static("uPlot.min.css") + _static("report.css"),
        library=_static("uPlot.iife.min.js"),
        licence=_static("uPlot.LICENSE"),
        script=_static("report.js"),
    )


def _static(name: str) -> str:
    return (_STATIC / name).read_text(encoding="utf-8")


def _facts(fitted: Fitted) -> list[tuple[str, str]]:
    return [
        ("Recordings", ", ".join(fitted.recordings)),
        ("Made by", f"faultbond {fitted.version}"),
    ]


def _cards(fitted: Fitted) -> list[tuple[str, str, str]]:
    found = fitted.found
    span = sum(float(item.time[-1] - item.time[0]) for item in found.records)
    known = sum(item.determined for item in fitted.estimates)
    white = sum(item.white for item in found.whiteness)
    return [
        ("Parameters", f"{known} of {len(fitted.estimates)}", "fixed by the data"),
        ("Sensors", f"{white} of {len(found.whiteness)}", "with nothing but white noise left"),
        ("Samples", f"{sum(len(item.time) for item in found.records)}", duration_text(span)),
        ("Search", f"{found.reached} of {found.starts}", "starts end at the same values"),
        ("Contradicted", str(len(found.contradicted)), "accuracies declared too small"),
    ]


def _joined(fitted: Fitted, part: Callable[[int], FloatArray]) -> FloatArray:
    """Give values of all recordings one after the other, with a gap between."""
    pieces: list[FloatArray] = []
    for r in range(len(fitted.found.records)):
        values = part(r)
        pieces += [values, np.full((1, *values.shape[1:]), np.nan)]
    return np.concatenate(pieces[:-1])


def _times(fitted: Fitted) -> tuple[FloatArray, tuple[float, ...]]:
    """Give a clock that runs through all recordings, and where each begins; a single recording keeps its own."""
    records = fitted.found.records
    pieces, begins, offset = list[FloatArray](), list[float](), 0.0
    for r, record in enumerate(records):
        begin = float(record.time[0])
        shift = 0.0 if r == 0 else offset - begin
        pieces.append(record.time + shift)
        begins.append(begin + shift)
        step = float(np.median(np.diff(record.time))) if len(record.time) > 1 else 1.0
        offset = float(record.time[-1]) + shift + 2.0 * step
        pieces.append(np.array([offset - step]))
    return np.concatenate(pieces[:-1]), tuple(begins)


def _sections(fitted: Fitted) -> tuple[ChartSection, ...]:
    time, _ = _times(fitted)
    sensors = range(len(fitted.graph.sensors))
    return (
        ChartSection(
            title="Measured and simulated",
            text="Simulated: the fitted plant under the recorded inputs alone, from the start that was found.",
            charts=tuple(_compared(fitted, k, time) for k in sensors),
        ),
        ChartSection(
            title="What is left from sample to sample",
            text="Each reading less what the readings before it foretold.",
            charts=tuple(_left(fitted, k, time) for k in sensors),
        ),
    )


def _compared(fitted: Fitted, k: int, time: FloatArray) -> Chart:
    """Draw a sensor as measured and as simulated."""
    found, sensor = fitted.found, fitted.graph.sensors[k]
    unit = sensor.unit
    measured = _joined(fitted, lambda r: found.records[r].y[:, k])
    alone = _joined(fitted, lambda r: found.simulated[r][:, k])
    traces = (
        ChartLine(label="measured", values=(measured - unit.offset) / unit.factor, color="measured", width=1.0),
        ChartLine(label="simulated", values=(alone - unit.offset) / unit.factor, color="expected", width=1.8),
    )
    return Chart(title=sensor.name, unit=unit_text(unit.text, Notation.PRINT), time=time, traces=traces)


def _left(fitted: Fitted, k: int, time: FloatArray) -> Chart:
    """Draw what is left of a sensor."""
    rest = _joined(fitted, lambda r: fitted.found.courses[r].standardised[:, k])
    trace = ChartLine(label="what is left", values=rest, color="line0", width=1.0)
    title = fitted.graph.sensors[k].name
    return Chart(title=title, unit="standard deviations", time=time, traces=(trace,), level=(0.0, ""))


def _payload(fitted: Fitted, charts: Sequence[Chart]) -> dict[str, object]:
    time, begins = _times(fitted)
    nothing = np.zeros((len(time), 0))
    history = History(
        time=time,
        measured=nothing,
        expected=nothing,
        expected_sd=nothing,
        inputs=nothing,
        cusum=nothing,
        slow=nothing,
        cusum_limit=1.0,
        slow_limit=1.0,
        slow_names=(),
        detections=(),
        diagnoses=(),
    )
    found = payload(history, charts)
    marks = [{"x": begin - float(time[0]), "label": str(r)} for r, begin in enumerate(begins, start=1)]
    return found | {"marks": marks if len(marks) > 1 else []}


def correlation_drawing(item: Whiteness) -> str:
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
        for y, text in ((middle - reach, f"{top:.2g}"), (middle, "0"), (middle + reach, f"\N{MINUS SIGN}{top:.2g}"))
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
