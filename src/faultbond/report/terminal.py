"""The diagnosis as text: what was watched, when the alarm came, and the ranked table."""

from itertools import zip_longest

from rich.console import Console
from rich.text import Text

from faultbond.contract.findings import History
from faultbond.model.graph import BondGraph
from faultbond.report.console import facts, set_plain, table
from faultbond.report.numbers import Notation
from faultbond.report.verdict import RunCounts, TableRow, view_of

TABLE_WIDTH = 140  # columns of the ranked table at most, where the output is a file or a pipe: units and names are long
GROUP_MARK = "●"
WHOLE = ("kind", "nominal", "estimate ± sd", "change", "%")  # columns that are not folded
RIGHT = ("nominal", "change", "%")
STYLES = {"fault": "bold", "open": "bold yellow", "partial": "bold yellow", "healthy": "bold green"}


def print_diagnosis(
    console: Console, graph: BondGraph, history: History, *, engine_title: str, counts: RunCounts, untested: str = ""
) -> None:
    """Print what a run found.

    Parameters
    ----------
    console : where to print; one that is no terminal is set to `console.PLAIN_WIDTH` columns
    graph : the plant, for names and units
    history : traces, detections and diagnoses of the run
    engine_title : the engine in words
    counts : samples passed, and defects of the recording
    untested : sets that no data can contradict, in words
    """
    set_plain(console)
    view = view_of(graph, history, counts, Notation.FILE)
    span = f", {view.period} ({view.span})" if view.period else ""
    samples = f"{counts.samples}{span}" + (f"; {view.defects}" if view.defects else "")
    watched = [("Model", graph.name), ("Sensors", f"{view.sensors}; {view.step}")]
    facts(console, [*watched, ("Engine", engine_title), ("Samples", samples)])
    for text, alarm in view.events:
        console.print(Text(text, style="bold red" if alarm else ""))
    if view.diagnosis:
        console.print(Text.assemble("\n", ("Diagnosis", "bold underline"), (f"  at {view.diagnosed_at}", "dim")))
        width = console.width
        console.width = width if console.is_terminal else TABLE_WIDTH
        _print_ranked(console, view.rows, GROUP_MARK if view.several else "")
        console.width = width
        alike = f"{GROUP_MARK} not yet distinguishable from the best" if view.several else ""
        for note in filter(None, (view.remainder, alike, view.contradicted, view.left_out)):
            console.print(Text(note, style="dim"))
        console.print()
        if untested:
            console.print(Text(f"Not tested, since each would explain anything: {untested}.", style="dim"))
        if view.checks:
            console.print(Text.assemble(("What to check next", "bold underline"), ("  best first", "dim")))
            for check in view.checks:
                cost = f", cost {check.cost}" if check.cost else ""
                tells = f": tells {check.parts} ({check.gain}{cost})"
                console.print(Text.assemble(f" {check.action}", (tells, "dim")))
            console.print()
    for note in view.notes:
        console.print(Text(note, style="yellow"))
    console.print(Text(view.verdict, style=STYLES[view.state]))
    for remark in view.remarks:
        console.print()
        console.print(Text(remark))


def _print_ranked(console: Console, rows: tuple[TableRow, ...], mark: str) -> None:
    """Print the table: a line for each suspect and each rate of a candidate, and for each kind of fault."""
    is_likely = any(row.percent for row in rows)
    header = ("component", "kind", "parameter", "nominal", "estimate ± sd", "unit", "change", *["%"] * is_likely, "")
    body, styles = [], []
    for row in rows:
        of_row = (mark if row.group else "",)
        ends = [(row.percent, *of_row) if is_likely else of_row]
        for kind, item, end in zip_longest(row.kinds, row.suspects, ends):
            texts = (item.parameter, item.nominal, item.estimate, item.unit, item.change) if item else ("",) * 5
            body.append((item.component if item else "", kind or "", *texts, *(end or ("",) * len(ends[0]))))
            styles.append("bold" if row.group else "")
    table(console, header, body, right=RIGHT, whole=WHOLE, styles=styles)
