"""One self-contained HTML page about a run; it opens from a file and needs no network."""

import re
from collections.abc import Mapping
from importlib import resources

from jinja2 import Environment, PackageLoader, StrictUndefined

from faultbond.contract.findings import Diagnosis, History
from faultbond.model.graph import BondGraph
from faultbond.report.advising import check_rows
from faultbond.report.chart import payload
from faultbond.report.charts import sections
from faultbond.report.drawing import STRONGEST, draw, graph_title
from faultbond.report.numbers import TIMES, Notation, clock_text, duration_text, probability_text
from faultbond.report.suspects import instrument_title
from faultbond.report.verdict import (
    RunCounts,
    component_probabilities,
    decided_text,
    instrument_probabilities,
    open_diagnosis,
    remainder_text,
    span_of,
    table_rows,
    untested_sentence,
    verdict_sentence,
)

SHOWN = 0.005  # instruments less likely at fault have no number
CHIPS = 24  # of more instruments only those with a number are named
NO_BREAK = "\N{NO-BREAK SPACE}"
STATIC = resources.files("faultbond.report") / "static"


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
    environment = Environment(
        loader=PackageLoader("faultbond.report", "."),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.policies["json.dumps_kwargs"] = {"separators": (",", ":"), "allow_nan": False, "ensure_ascii": False}
    diagnosis = open_diagnosis(history)
    parts = sections(graph, history)
    rows = table_rows(graph, diagnosis, Notation.PRINT) if diagnosis else ()
    return environment.get_template("report.html.j2").render(
        name=graph.name,
        state=_state(history, counts),
        verdict=_unbroken(verdict_sentence(graph, history, counts, Notation.PRINT)),
        cards=_cards(history, counts),
        facts=_facts(graph, history, engine_title, version),
        diagnosed_at=clock_text(diagnosis.time) if diagnosis else "",
        rows=rows,
        several=sum(row.group for row in rows) > 1,
        remainder=remainder_text(diagnosis, rows) if diagnosis else "",
        left_out=untested_sentence(diagnosis) if diagnosis else "",
        doubtful=diagnosis is not None and diagnosis.unexplained is not None,
        checks=check_rows(graph, diagnosis, Notation.PRINT) if diagnosis else (),
        drawing=draw(graph, strokes, _heat(diagnosis)),
        instruments=_instruments(graph, diagnosis),
        drawing_title=graph_title(graph),
        blocks_drawn=graph.is_block_network,
        strokes_drawn=bool(strokes),
        sections=parts,
        data=payload(history, [chart for part in parts for chart in part.charts]),
        style=_static("uPlot.min.css") + _static("report.css"),
        library=_static("uPlot.iife.min.js"),
        licence=_static("uPlot.LICENSE"),
        script=_static("report.js"),
    )


def _unbroken(sentence: str) -> str:
    """Keep a number and its power of ten, and a number and its per cent sign or unit of time, on one line."""
    sentence = re.sub(r"(\d) (s|min|h|d|UTC)\b", rf"\1{NO_BREAK}\2", sentence)
    return sentence.replace(" %", f"{NO_BREAK}%").replace(f" {TIMES} ", f"{NO_BREAK}{TIMES}{NO_BREAK}")


def _heat(diagnosis: Diagnosis | None) -> dict[str, float] | None:
    """Give the probability that each component changed; None where there is nothing to colour."""
    return component_probabilities(diagnosis) if diagnosis and diagnosis.unexplained is None else None


def _instruments(graph: BondGraph, diagnosis: Diagnosis | None) -> list[tuple[str, str, str]]:
    """Give sensors and inputs, which the drawing of the plant does not show: title, opacity of its colour, per cent."""
    if diagnosis is None or diagnosis.unexplained is not None:
        return []
    shares = instrument_probabilities(diagnosis)
    names = [item.name for item in graph.sensors] + [item.name for item in graph.inputs]
    told = names if len(names) <= CHIPS else [name for name in names if shares.get(name, 0.0) >= SHOWN]
    return [
        (
            instrument_title(graph, name),
            f"{STRONGEST * shares.get(name, 0.0):.3f}",
            f"{probability_text(shares[name])} %" if shares.get(name, 0.0) >= SHOWN else "",
        )
        for name in told
    ]


def _state(history: History, counts: RunCounts) -> str:
    """Give the kind of verdict, which chooses title and colour of the page."""
    if history.detections:
        return "fault"
    return "open" if counts.no_verdict else "healthy"


def _static(name: str) -> str:
    return (STATIC / name).read_text(encoding="utf-8")


def _cards(history: History, counts: RunCounts) -> list[tuple[str, str, str]]:
    """Give the summary: name, value, remark."""
    cards = []
    if history.detections:
        last = history.detections[-1]
        start = float(history.time[0]) if len(history.time) else 0.0
        after = f"{duration_text(last.time - start)} after the start" if last.time >= start else "in the run before"
        cards = [
            ("Detected at", clock_text(last.time), after),
            ("Estimated onset", clock_text(last.change_time), "begin of the change"),
            ("Delay", duration_text(last.time - last.change_time), "from onset to alarm"),
            ("Seen in", ", ".join(last.signals) or "slow error", "signal that raised the alarm"),
        ]
        if len(history.detections) > 1:
            cards.append(("Alarms", str(len(history.detections)), "shown: the last"))
    defects = counts.defects()
    span = duration_text(span_of(history))
    cards.append(("Samples", f"{counts.samples:,}".replace(",", "\N{NARROW NO-BREAK SPACE}"), span))
    cards.append(("Recording", defects or "complete", "defects of the data" if defects else "no sample lost"))
    return cards


def _facts(graph: BondGraph, history: History, engine_title: str, version: str) -> list[tuple[str, str]]:
    step = f"every {duration_text(graph.sample_time)}" if graph.sample_time else "as the rows come"
    facts = [
        ("Sensors", ", ".join(sensor.name for sensor in graph.sensors)),
        ("Sampled", step),
        ("Engine", engine_title),
        ("Made by", f"faultbond {version}"),
    ]
    if history.accepted:
        facts.append(("Accepted", decided_text(graph, history.accepted)))
    if history.rejected:
        facts.append(("Rejected", decided_text(graph, history.rejected)))
    if len(history.time):
        first, last = (clock_text(float(history.time[end])) for end in (0, -1))
        facts.insert(2, ("Recording", f"{first} to {last}"))
    return facts
