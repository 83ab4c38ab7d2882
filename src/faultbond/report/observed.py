"""What the observations of a network without time say, as text."""

from collections.abc import Sequence
from dataclasses import dataclass
from math import isinf

from rich.console import Console
from rich.text import Text

from faultbond.contract.findings import Candidate, Detection, Diagnosis, Suspect
from faultbond.model.graph import BondGraph
from faultbond.report.console import facts, set_plain, table
from faultbond.report.numbers import figure, join, unit_text, with_noun
from faultbond.report.suspects import unit_of
from faultbond.report.verdict import contradiction_sentence

HEADER = ("component", "parameter", "nominal", "value", "unit")
SHOWN_SETS = 20  # candidates shown; the records hold all


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
    """Print what was found; a console that is no terminal gets `console.PLAIN_WIDTH` columns."""
    set_plain(console)
    observations = with_noun(seen.rows, "observation")
    facts(console, [("Model", seen.name), ("Sensors", join(seen.sensors)), ("Rows", observations)])
    if not seen.watched:
        console.print(Text("No verdict: no row has a value of a sensor.", style="bold yellow"))
        return
    if seen.detection is None or seen.diagnosis is None:
        console.print(Text(f"Nothing contradicts the healthy network in {observations}.", style="bold green"))
        return
    console.print(Text(contradiction_sentence(seen.detection), style="bold red"))
    console.print()
    candidates = seen.diagnosis.candidates
    if seen.graph is not None and any(candidate.suspects for candidate in candidates):
        rows = []
        for candidate in candidates[:SHOWN_SETS]:
            cells = [_cells(seen.graph, suspect) for suspect in candidate.suspects]
            owners, *columns = zip(*cells, strict=True) if cells else [("",)] * len(HEADER)
            rows.append(("\n+ ".join(owners), *map("\n".join, columns)))
        table(console, HEADER, rows, right=("nominal",), whole=("nominal", "value"))
    else:
        for candidate in candidates[:SHOWN_SETS]:
            console.print(Text(f" {{{', '.join(candidate.components)}}}"), highlight=False)
    if len(candidates) > SHOWN_SETS:
        console.print(Text(f"... and {len(candidates) - SHOWN_SETS} more; --json writes all", style="dim"))
    console.print(Text(sets_verdict(candidates), style="bold"))


def _cells(graph: BondGraph, suspect: Suspect) -> tuple[str, ...]:
    """Give the cells of a suspect; where many values explain the same, one of them as an example."""
    unit = unit_of(graph, suspect.parameter)
    value = unit.from_si(suspect.estimate)
    text = f"{value:.6g}"
    if isinf(suspect.sd):
        text = f"not determined, such as {text}"
    elif suspect.sd > 0.0:
        text = figure(value, unit.difference_from_si(suspect.sd)).both()
    nominal = f"{unit.from_si(suspect.nominal or 0.0):.6g}"
    return suspect.component, suspect.parameter, nominal, text, unit_text(unit.text)


def sets_verdict(candidates: Sequence[Candidate]) -> str:
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
