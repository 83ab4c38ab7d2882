"""One self-contained HTML page about a run; it opens from a file and needs no network."""

from collections.abc import Mapping
from importlib import resources

from faultbond.contract.findings import Diagnosis, History
from faultbond.model.graph import BondGraph
from faultbond.report.chart import ChartSection, payload
from faultbond.report.drawing import STRONGEST, draw, graph_title
from faultbond.report.numbers import (
    NO_BREAK,
    TIMES,
    Notation,
    clock_text,
    duration_text,
    kept_together,
    probability_text,
)
from faultbond.report.run_figures import chart_sections
from faultbond.report.suspects import instrument_title
from faultbond.report.template import page_template
from faultbond.report.verdict import RunCounts, RunView, decided_text, fault_probabilities, judged, view_of

SHOWN = 0.005  # instruments less likely at fault have no number
CHIPS = 24  # of more instruments only those with a number are named
STATIC = resources.files("faultbond.report") / "static"
NUMBERS = resources.files("faultbond") / "browser" / "numbers.js"  # as the plots write them


def render_report(
    graph: BondGraph,
    history: History,
    strokes: Mapping[int, str] | None,
    engine_title: str,
    version: str,
    counts: RunCounts,
) -> str:
    """Give the page about a run as HTML text.

    Parameters
    ----------
    graph : the plant
    history : traces, detections and diagnoses of the run
    strokes : node at which the causal stroke of each bond stands, by bond index; None: none are drawn
    engine_title : the engine in words
    version : of faultbond
    counts : samples passed, and defects of the recording
    """
    history = judged(history, counts)
    view = view_of(graph, history, counts, Notation.PRINT)
    told = view.diagnosis if not view.contradicted else None
    facts = {"Sensors": view.sensors, "Sampled": view.step, "Recording": view.period, "Engine": engine_title}
    facts |= {"Made by": f"faultbond {version}", "Accepted": decided_text(graph, history.accepted)}
    facts |= {"Rejected": decided_text(graph, history.rejected)}
    facts |= {"Not watched": " ".join(view.notes)}
    always = ("Sensors", "Sampled", "Engine", "Made by")
    sections = chart_sections(graph, history)
    start = float(history.time[0]) if len(history.time) else 0.0
    marks = [mark for item in history.detections for mark in ((item.change_time, "onset"), (item.time, "alarm"))]
    marks += [
        (item.time, "over" if item.is_of_nothing else "accepted") for item in history.accepted if item.time >= start
    ]
    return render_page(
        "report.html.j2",
        sections,
        payload(history.time, marks, [chart for section in sections for chart in section.charts]),
        {
            "name": graph.name,
            "state": view.state,
            "view": view,
            "verdict": _unbroken(view.verdict),
            "caveats": [_unbroken(text) for text in view.remarks],
            "cards": _cards(history, view, counts),
            "facts": [(label, text) for label, text in facts.items() if text or label in always],
            "drawing": draw(graph, strokes, fault_probabilities(told, instruments=False) if told else None),
            "instruments": _instruments(graph, told) if told else [],
            "drawing_title": graph_title(graph),
            "blocks_drawn": graph.is_block_network,
            "strokes_drawn": bool(strokes),
        },
    )


def render_page(
    template: str, sections: tuple[ChartSection, ...], data: Mapping[str, object], told: Mapping[str, object]
) -> str:
    """Give a page with charts as HTML text.

    Parameters
    ----------
    template : its file, beside this module
    sections : the charts, by heading
    data : what the page's script draws
    told : all else that the template names
    """
    static = {path.name: path.read_text(encoding="utf-8") for path in STATIC.iterdir() if path.is_file()}
    return page_template("report", template).render(
        sections=sections,
        data=data,
        style=static["uPlot.min.css"] + static["plot.css"] + static["report.css"],
        library=static["uPlot.iife.min.js"],
        licence=static["uPlot.LICENSE"],
        script="\n".join((NUMBERS.read_text(encoding="utf-8"), static["plot.js"], static["report.js"])),
        **told,
    )


def _unbroken(sentence: str) -> str:
    """Keep a number and its power of ten, and a number and its per cent sign or unit of time, on one line."""
    return kept_together(sentence).replace(f" {TIMES} ", f"{NO_BREAK}{TIMES}{NO_BREAK}")


def _instruments(graph: BondGraph, diagnosis: Diagnosis) -> list[tuple[str, str, str]]:
    """Give sensors and inputs, which the drawing of the plant does not show: title, opacity of its colour, per cent."""
    found = fault_probabilities(diagnosis, instruments=True)
    names = [*(item.name for item in graph.sensors), *(item.name for item in graph.inputs)]
    shares = {name: found.get(name, 0.0) for name in names}
    return [
        (
            instrument_title(graph, name),
            f"{STRONGEST * share:.3f}",
            f"{probability_text(share)} %" if share >= SHOWN else "",
        )
        for name, share in shares.items()
        if share >= SHOWN or len(shares) <= CHIPS
    ]


def _cards(history: History, view: RunView, counts: RunCounts) -> list[tuple[str, str, str]]:
    """Give the summary: name, value, remark."""
    cards = []
    if history.detections:
        last = history.detections[-1]
        start = float(history.time[0]) if len(history.time) else 0.0
        delay = last.time - last.change_time  # less than none where the clock was set back
        after = f"{duration_text(last.time - start)} after the start" if last.time >= start else "in the run before"
        cards = [
            ("Detected at", clock_text(last.time), after),
            ("Estimated onset", clock_text(last.change_time), "begin of the change"),
            *([("Delay", duration_text(delay), "from onset to alarm")] if delay >= 0.0 else []),
            ("Seen in", ", ".join(last.signals) or "slow error", "signal that raised the alarm"),
        ]
        if len(history.detections) > 1:
            cards.append(("Alarms", str(len(history.detections)), "shown: the last"))
    cards.append(("Samples", f"{counts.samples:,}".replace(",", "\N{NARROW NO-BREAK SPACE}"), view.span))
    cards.append(("Recording", view.defects or "complete", "defects of the data" if view.defects else "no sample lost"))
    return cards
