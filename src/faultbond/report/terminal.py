"""The diagnosis as text: what was watched, when the alarm came, and the ranked table."""

from collections.abc import Iterator
from itertools import zip_longest
from typing import Literal

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from faultbond.contract.findings import Diagnosis, History
from faultbond.model.graph import BondGraph
from faultbond.report.advising import check_rows
from faultbond.report.decided import rejected_sentence
from faultbond.report.numbers import Notation, clock_text, duration_text
from faultbond.report.verdict import (
    RunCounts,
    TableRow,
    accepted_sentence,
    detection_sentence,
    open_diagnosis,
    remainder_text,
    span_of,
    table_rows,
    untested_sentence,
    verdict_sentence,
)

PLAIN_WIDTH = 100  # columns where the output is a file or a pipe
TABLE_WIDTH = 112  # the same for the ranked table, whose units are long
GROUP_MARK = "●"
CONTRADICTED = "The data contradict them all; the percentages tell only which comes nearest."
WHOLE = ("kind", "nominal", "estimate ± sd", "change", "%")  # columns that are not folded


def print_diagnosis(
    console: Console, graph: BondGraph, history: History, *, engine_title: str, counts: RunCounts, untested: str = ""
) -> None:
    """Print what a run found.

    Parameters
    ----------
    console : where to print; one that is no terminal is set to `PLAIN_WIDTH` columns
    graph : the plant, for names and units
    history : traces, detections and diagnoses of the run
    engine_title : the engine in words
    counts : samples passed, and defects of the recording
    untested : sets that no data can contradict, in words
    """
    if not console.is_terminal:
        console.width = PLAIN_WIDTH
    for label, text in _watched(graph, history, engine_title, counts):
        console.print(Text.assemble((f"{label:<9}", "dim"), text), highlight=False)
    console.print()
    for event in _events(graph, history):
        console.print(event)
    diagnosis = open_diagnosis(history)
    if diagnosis:
        console.print(_heading(diagnosis))
        _print_table(console, graph, diagnosis)
        if untested:
            console.print(Text(f"Not tested, since each would explain anything: {untested}.", style="dim"))
        _print_checks(console, graph, diagnosis)
    style = "bold" if history.detections else "bold yellow" if counts.no_verdict else "bold green"
    console.print(Text(verdict_sentence(graph, history, counts, Notation.FILE), style=style))


def _watched(graph: BondGraph, history: History, engine_title: str, counts: RunCounts) -> tuple[tuple[str, str], ...]:
    step = f"every {duration_text(graph.sample_time)}" if graph.sample_time else "as the rows come"
    sensors = ", ".join(sensor.name for sensor in graph.sensors)
    defects = counts.defects()
    span = ""
    if len(history.time):
        first, last = (clock_text(float(history.time[end])) for end in (0, -1))
        span = f", {first} to {last} ({duration_text(span_of(history))})"
    return (
        ("Model", graph.name),
        ("Sensors", f"{sensors}; {step}"),
        ("Engine", engine_title),
        ("Samples", f"{counts.samples}{span}" + (f"; {defects}" if defects else "")),
    )


def _events(graph: BondGraph, history: History) -> list[Text]:
    """Give a line for each detection and each candidate that was accepted or rejected, in the order of time."""
    found = [(item.time, Text(detection_sentence(item), style="bold red")) for item in history.detections]
    accepted = [(item.time, Text(accepted_sentence(graph, item))) for item in history.accepted]
    rejected = [(item.time, Text(rejected_sentence(graph, item))) for item in history.rejected]
    return [text for _, text in sorted([*found, *accepted, *rejected], key=lambda event: event[0])]


def _heading(diagnosis: Diagnosis) -> Text:
    return Text.assemble("\n", ("Diagnosis", "bold underline"), (f"  at {clock_text(diagnosis.time)}", "dim"))


def _print_table(console: Console, graph: BondGraph, diagnosis: Diagnosis) -> None:
    rows = table_rows(graph, diagnosis, Notation.FILE)
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), header_style="dim")
    for name in ("component", "kind", "parameter", "nominal", "estimate ± sd", "unit", "change", "%"):
        side: Literal["right", "left"] = "right" if name in ("nominal", "change", "%") else "left"
        table.add_column(name, justify=side, overflow="fold", no_wrap=name in WHOLE)
    table.add_column("", min_width=1)
    several = sum(row.group for row in rows) > 1
    for row in rows:
        for line in _lines(row, GROUP_MARK if row.group and several else ""):
            table.add_row(*map(Text, line), style="bold" if row.group else None)
    width = console.width
    if not console.is_terminal:
        console.width = TABLE_WIDTH
    console.print(table)
    console.width = width
    if remainder := remainder_text(diagnosis, rows):
        console.print(Text(remainder, style="dim"))
    if several:
        console.print(Text(f"{GROUP_MARK} not yet distinguishable from the best", style="dim"))
    if diagnosis.unexplained is not None:
        console.print(Text(CONTRADICTED, style="dim"))
    if left := untested_sentence(diagnosis):
        console.print(Text(left, style="dim"))
    console.print()


def _print_checks(console: Console, graph: BondGraph, diagnosis: Diagnosis) -> None:
    rows = check_rows(graph, diagnosis, Notation.FILE)
    if not rows:
        return
    console.print(Text.assemble(("What to check next", "bold underline"), ("  best first", "dim")))
    for row in rows:
        cost = f", cost {row.cost}" if row.cost else ""
        console.print(Text.assemble(f" {row.action}", (f": tells {row.parts} ({row.gain}{cost})", "dim")))
    console.print()


def _lines(row: TableRow, mark: str) -> Iterator[tuple[str, ...]]:
    """Give the lines of one candidate: one for each suspect and each rate, and each kind of fault."""
    first = True
    for kind, item in zip_longest(row.kinds, row.suspects):
        cells = (item.component, kind or "") if item else ("", kind)
        values = (item.parameter, item.nominal, item.estimate, item.unit, item.change) if item else ("",) * 5
        yield (*cells, *values, *((row.percent, mark) if first else ("", "")))
        first = False
