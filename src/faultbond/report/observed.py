"""What the observations of a network without time say, as text."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from math import isinf

from rich import box
from rich.console import Console
from rich.table import Table
from rich.text import Text

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect
from faultbond.model.graph import BondGraph, Unit
from faultbond.report.numbers import Notation, figure, unit_text
from faultbond.report.suspects import unit_of
from faultbond.report.terminal import PLAIN_WIDTH
from faultbond.report.verdict import join

LISTED = 20  # candidates shown; the records hold all


@dataclass(frozen=True, slots=True, kw_only=True)
class Observed:
    """A network, what its observations say, and how many there were; `graph` where it has parameters.

    watched: observations with a reading.
    """

    name: str
    sensors: tuple[str, ...]
    rows: int
    watched: int
    detection: Detection | None
    diagnosis: Diagnosis | None
    graph: BondGraph | None = None


def print_observed(console: Console, seen: Observed) -> None:
    """Print what was found; a console that is no terminal is set to `PLAIN_WIDTH` columns."""
    if not console.is_terminal:
        console.width = PLAIN_WIDTH
    observations = f"{seen.rows} observation{'s'[: seen.rows != 1]}"
    for label, text in (("Model", seen.name), ("Sensors", join(seen.sensors)), ("Rows", observations)):
        console.print(Text.assemble((f"{label:<9}", "dim"), text), highlight=False)
    console.print()
    if not seen.watched:
        console.print(Text("No verdict: no row has a value of a sensor.", style="bold yellow"))
        return
    if seen.detection is None or seen.diagnosis is None:
        console.print(Text(f"Nothing contradicts the healthy network in {observations}.", style="bold green"))
        return
    where = f"row {seen.detection.sample}"
    console.print(Text(f"{where} contradicts the healthy network: {join(seen.detection.signals)}.", style="bold red"))
    console.print()
    candidates = seen.diagnosis.candidates
    if candidates and seen.graph is not None and any(candidate.suspects for candidate in candidates):
        console.print(_values(seen.graph, candidates[:LISTED]))
    else:
        for line in _sets(candidates[:LISTED]):
            console.print(Text(line), highlight=False)
    if len(candidates) > LISTED:
        console.print(Text(f"... and {len(candidates) - LISTED} more; --json writes all", style="dim"))
    console.print(Text(verdict(candidates), style="bold"))


def verdict(candidates: Sequence[Candidate]) -> str:
    """Say how many sets explain all observations since the first contradiction."""
    sets = {(candidate.parameters, candidate.blocks) for candidate in candidates}
    if not sets:
        return (
            "No set of suspects explains these observations; the network is built otherwise, or max_faults is too low."
        )
    size = len(candidates[0].parameters) + len(candidates[0].blocks)
    what = "suspect" if size == 1 else f"set of {size} suspects"
    if len(sets) == 1:
        values = "" if len(candidates) == 1 else f", with {len(candidates)} possible values"
        return f"One {what} explains every observation since then{values}."
    several = "suspects" if size == 1 else f"sets of {size} suspects"
    return f"{len(sets)} {several} explain every observation since then, each alone; nothing tells them apart yet."


def _sets(candidates: Sequence[Candidate]) -> Iterator[str]:
    for candidate in candidates:
        yield f" {{{', '.join(candidate.components)}}}"


def _values(graph: BondGraph, candidates: Sequence[Candidate]) -> Table:
    table = Table(box=box.SIMPLE_HEAD, pad_edge=False, padding=(0, 1), header_style="dim")
    for name in ("component", "parameter"):
        table.add_column(name, overflow="fold")
    table.add_column("nominal", justify="right")
    table.add_column("value")
    table.add_column("unit", overflow="fold")
    for candidate in candidates:
        table.add_row(*_cells(graph, candidate.suspects))
    return table


def _cells(graph: BondGraph, suspects: Sequence[Suspect]) -> tuple[str, ...]:
    units = [unit_of(graph, suspect.parameter) for suspect in suspects]
    values = [_value(suspect, unit) for suspect, unit in zip(suspects, units, strict=True)]
    return (
        "\n+ ".join(suspect.component for suspect in suspects),
        "\n".join(suspect.parameter for suspect in suspects),
        "\n".join(f"{unit.from_si(suspect.nominal or 0.0):.6g}" for suspect, unit in zip(suspects, units, strict=True)),
        "\n".join(values),
        "\n".join(unit_text(unit.text, Notation.FILE) for unit in units),
    )


def _value(suspect: Suspect, unit: Unit) -> str:
    """Give a value with its standard deviation; where many values explain the same, one of them as an example."""
    value = unit.from_si(suspect.estimate)
    if isinf(suspect.sd):
        return f"not determined, such as {value:.6g}"
    if suspect.sd > 0.0:
        return figure(value, unit.difference_from_si(suspect.sd)).both(Notation.FILE)
    return f"{value:.6g}"
