"""The plots of all pages, in a browser without a window: what is drawn of samples, told of them, and done with them."""

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from fake import TANK_STROKES, counts_of, tank_graph, tank_history
from faultbond.report.html import NUMBERS, STATIC, render_report

PAGE = """<!doctype html><meta charset="utf-8"><style>{style}</style><body><figure></figure>
<script>{library}</script><script>{script}</script>
<script>
window.told = [];
const fill = CanvasRenderingContext2D.prototype.fillText;
CanvasRenderingContext2D.prototype.fillText = function (text, ...more) {{
  window.told.push(text);
  fill.call(this, text, ...more);
}};
const times = Array.from({{ length: 101 }}, (_, k) => k);
const line = (label, color, value, more) => ({{ label, color, width: 2, values: () => times.map(value), ...more }});
function show(options, view) {{
  window.told.length = 0;
  window.plot?.remove();
  window.plot = new Plot(document.querySelector("figure"), {{ title: "flow", ...options }});
  draw(view);
}}
const draw = (view) => window.plot.draw({{ times, begin: 0, end: 100, marks: [], isClock: false, ...view }});
// Pixels of a colour with a name, where it is opaque, by columns of the canvas.
function inked(name) {{
  const pen = plot.drawn.ctx, {{ width, height, data }} = pen.getImageData(0, 0, pen.canvas.width, pen.canvas.height);
  const found = new Array(width).fill(0), wanted = parseInt(`ff${{paintOf(name).slice(1)}}`, 16);
  for (let k = 0; k < width * height; k++) {{
    const [red, green, blue, opaque] = data.subarray(4 * k, 4 * k + 4);
    if ((opaque << 24 | red << 16 | green << 8 | blue) >>> 0 === wanted) found[k % width]++;
  }}
  return found;
}}
const inkedBetween = (name, from, to) => {{
  const columns = inked(name), at = (time) => Math.round(plot.drawn.valToPos(time, "x", true));
  return columns.slice(at(from), at(to)).reduce((sum, value) => sum + value, 0);
}};
const pixel = (time, value) => {{
  const at = [plot.drawn.valToPos(time, "x", true), plot.drawn.valToPos(value, "y", true)];
  return [...plot.drawn.ctx.getImageData(...at, 1, 1).data];
}};
const wordsOf = (row) => row.innerText.replace(/\\s+/g, " ").trim();
const legend = () => [...document.querySelectorAll(".u-series:not(.edge)")].slice(1).map(wordsOf);
</script>"""


@pytest.fixture(scope="module")
def sheet(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A page with nothing but a plot."""
    static = {path.name: path.read_text(encoding="utf-8") for path in STATIC.iterdir() if path.is_file()}
    file = tmp_path_factory.mktemp("plot") / "plot.html"
    file.write_text(
        PAGE.format(
            style=static["uPlot.min.css"] + static["report.css"] + static["plot.css"],
            library=static["uPlot.iife.min.js"],
            script=NUMBERS.read_text(encoding="utf-8") + static["plot.js"],
        ),
        encoding="utf-8",
    )
    return file


@pytest.fixture
def opened(browser: Any) -> Iterator[Callable[[Path], Any]]:
    """Opens a file, which complains of nothing."""
    pages, wrong = [], []

    def made(file: Path) -> Any:
        page = browser.new_page(viewport={"width": 800, "height": 600}, color_scheme="light")
        page.on("pageerror", lambda problem: wrong.append(str(problem)))
        page.goto(file.as_uri())
        pages.append(page)
        return page

    yield made
    for page in pages:
        page.close()
    assert wrong == []


@pytest.fixture
def shown(opened: Callable[[Path], Any], sheet: Path) -> Any:
    """The page with nothing but a plot."""
    return opened(sheet)


def test_a_gap_breaks_a_line(shown: Any) -> None:
    """Between the samples that there are, and nowhere else; a lone sample is a point."""
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k > 30 && k < 60 ? null : k)] })")
    ink = [shown.evaluate(f"inkedBetween('line0', {span})") for span in ("5, 25", "32, 58", "65, 95")]
    assert ink[1] == 0 < min(ink[0], ink[2])
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k === 50 ? 1 : null)] })")
    assert shown.evaluate("inkedBetween('line0', 48, 52)") > 10
    assert shown.evaluate("inkedBetween('line0', 0, 45)") == 0


def test_what_is_not_shown_yet_is_not_drawn(shown: Any) -> None:
    """Of known samples the first ones are drawn, on the axis of all; the values told are of the last one shown."""
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k)] }, { shown: 41 })")
    assert shown.evaluate("inkedBetween('line0', 5, 38)") > 0
    assert shown.evaluate("inkedBetween('line0', 42, 100)") == 0
    assert shown.evaluate("[legend()[0], plot.drawn.scales.y.max]") == ["a 40", 106]
    shown.mouse.move(700, 100)
    assert shown.evaluate("legend()[0]") == "a 40"
    shown.evaluate("draw({ shown: 81 })")
    assert shown.evaluate("inkedBetween('line0', 42, 78)") > 0
    assert shown.evaluate("legend()[0]") == "a 80"


def test_samples_that_come_are_drawn_in_the_same_plot(shown: Any) -> None:
    """Nothing is built anew for them, and the values told are theirs; a plot takes the room that there is."""
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k)] })")
    shown.evaluate("window.first = plot.drawn; times.push(101, 102); draw({ end: 102 })")
    assert shown.evaluate("[legend()[0], plot.drawn === window.first]") == ["a 102", True]
    shown.set_viewport_size({"width": 390, "height": 600})
    shown.wait_for_timeout(100)
    assert shown.evaluate("[plot.drawn === window.first, plot.drawn.width <= 390]") == [True, True]


def test_axes_have_true_minus_signs_and_short_numbers(shown: Any) -> None:
    """A power of ten stands in the unit, the seconds at the last number, and a clock tells days and hours."""
    shown.evaluate("show({ unit: 'Pa', lines: [line('a', 'line0', (k) => 2e6 * (k - 50) / 50)] })")
    assert shown.inner_text("figcaption .in") == "10⁶\u00a0Pa"
    told = shown.evaluate("told")
    assert {"\u22122", "\u22121", "0", "1", "2", "20", "100 s"} <= set(told)
    assert shown.evaluate("legend()[0]") == "a 2.00"
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k / 100)] })")
    assert {"0.00", "0.25", "1.00"} <= set(shown.evaluate("told"))
    day = 1_700_006_400  # 2023-11-15
    shown.evaluate(f"""(() => {{
      const hours = times.map((k) => {day} - 7200 + 144 * k);
      const view = {{ times: hours, begin: hours[0], end: hours[100], isClock: true }};
      show({{ lines: [line('a', 'line0', (k) => k)] }}, view);
    }})()""")
    assert {"23:00", "11-15", "01:00"} <= set(shown.evaluate("told"))


def test_the_best_is_on_top(shown: Any) -> None:
    """Of probabilities the first is drawn last, but told first, and none is told to be 0 or 100."""
    lines = "[line('best', 'line0', () => 100), line('other', 'line1', () => 100), line('rest', 'line2', () => 0)]"
    shown.evaluate(f"show({{ unit: '%', lowest: 0, highest: 100, lines: {lines} }})")
    assert shown.evaluate("inkedBetween('line0', 10, 90)") > 0
    assert shown.evaluate("inkedBetween('line1', 10, 90)") == 0
    assert shown.evaluate("legend()") == ["best >99.9", "other >99.9", "rest <0.1"]
    shown.evaluate("plot.name([line('new', 'line3', () => 50)]); draw()")
    assert shown.evaluate("[legend(), inkedBetween('line3', 10, 90) > 0]") == [["new 50.0"], True]


def test_levels_marks_and_bands_are_drawn(shown: Any) -> None:
    """A limit is in the plot whatever the samples are, and a band about its line, which the axis need not reach."""
    banded = "line('a', 'line0', () => 1, { sd: () => times.map(() => 1) })"
    marks = "[{ time: 50, label: 'onset' }, { time: 60, label: 'alarm' }]"
    shown.evaluate(f"show({{ levels: [[2, 'limit']], lines: [{banded}] }}, {{ marks: {marks}, shade: [10, 20] }})")
    told = shown.evaluate("told")
    assert {"limit", "onset", "alarm"} <= set(told)
    assert shown.evaluate("plot.drawn.scales.y.max") == pytest.approx(2.06)
    assert shown.evaluate("inkedBetween('level', 5, 95)") > 300
    assert shown.evaluate("[pixel(33, 1.7)[3], pixel(13, 1.03)[3], pixel(33, 0.97)[3]].every((value) => value > 0)")
    shown.evaluate(f"show({{ isBandWhole: true, lines: [{banded}] }})")
    assert shown.evaluate("[plot.drawn.scales.y.min, plot.drawn.scales.y.max]") == pytest.approx([-1.24, 3.24])


def test_a_plot_is_named_and_follows_the_theme(shown: Any) -> None:
    """Who cannot see it hears what it is; its colours are those of the page that turned dark."""
    shown.evaluate("show({ lines: [line('a', 'line0', (k) => k)] })")
    assert shown.get_attribute("canvas", "aria-label") == "flow over time"
    assert shown.get_attribute("canvas", "role") == "img"
    light = shown.evaluate("[paintOf('line0'), plot.drawn]")[0]
    shown.emulate_media(color_scheme="dark")
    shown.wait_for_timeout(100)
    assert shown.evaluate("paintOf('line0')") != light
    assert shown.evaluate("inkedBetween('line0', 5, 95)") > 0


@pytest.fixture(scope="module")
def report(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The page of a run with a fault."""
    graph = tank_graph()
    history = tank_history(graph)
    file = tmp_path_factory.mktemp("report") / "report.html"
    file.write_text(
        render_report(graph, history, TANK_STROKES, "test engine", "1.2.3", counts_of(history)), encoding="utf-8"
    )
    return file


def test_the_plots_of_a_report_are_zoomed_together(opened: Callable[[Path], Any], report: Path) -> None:
    """A period that is dragged in one is shown by all, a pointer tells values of all, and a double click goes back."""
    page = opened(report)
    spans = "[...new Set([...living].map(({ drawn }) => [drawn.scales.x.min, drawn.scales.x.max].join()))]"
    (whole,) = page.evaluate(spans)
    assert page.locator("canvas").count() == page.locator("figure").count() > 4
    page.locator(".u-over").nth(1).scroll_into_view_if_needed()
    box = page.locator(".u-over").nth(1).bounding_box()
    page.mouse.move(box["x"] + 0.25 * box["width"], box["y"] + 50)
    times = page.locator(".u-series:first-child .u-value").all_inner_texts()
    assert len(set(times[:4])) == 1
    page.mouse.down()
    page.mouse.move(box["x"] + 0.5 * box["width"], box["y"] + 50, steps=4)
    page.mouse.up()
    (chosen,) = page.evaluate(spans)
    begin, end = map(float, whole.split(","))
    expected = [begin + share * (end - begin) for share in (0.25, 0.5)]
    assert list(map(float, chosen.split(","))) == pytest.approx(expected, abs=0.01 * (end - begin))
    page.mouse.dblclick(box["x"] + 50, box["y"] + 50)
    assert page.evaluate(spans) == [whole]


def test_the_plots_of_a_report_are_printed_in_light_colours(opened: Callable[[Path], Any], report: Path) -> None:
    """A dark page is light on paper, where plots shrink to its width, and dark again afterwards."""
    page = opened(report)
    page.emulate_media(color_scheme="dark")
    page.wait_for_timeout(100)
    paint = "paintOf('line0')"
    dark = page.evaluate(paint)
    page.evaluate("dispatchEvent(new Event('beforeprint'))")
    assert page.evaluate(paint) == "#0b5fa5"
    page.evaluate("living.forEach((plot) => plot.watch.disconnect())")  # nothing is drawn anew on paper
    page.emulate_media(media="print")
    page.set_viewport_size({"width": 500, "height": 600})
    for canvas in page.locator("canvas").all():
        box = canvas.bounding_box()
        assert box["width"] < 480 < 5 * box["height"]
    page.evaluate("dispatchEvent(new Event('afterprint'))")
    assert page.evaluate(paint) == dark != "#0b5fa5"
