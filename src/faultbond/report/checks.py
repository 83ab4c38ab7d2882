"""What to do next, in words: the checks of a diagnosis that would tell its candidates apart."""

from dataclasses import dataclass

from faultbond.contract.findings import Advice, Diagnosis
from faultbond.model.graph import BondGraph
from faultbond.report.numbers import Notation, duration_text, with_unit
from faultbond.report.suspects import instrument_title, with_article
from faultbond.types import CheckKind

SHOWN_CHECKS = 4


@dataclass(frozen=True, slots=True, kw_only=True)
class CheckRow:
    """One check, all text."""

    action: str
    parts: str  # what it would tell from what
    gain: str
    cost: str  # empty where all cost the same


def check_rows(graph: BondGraph, diagnosis: Diagnosis, notation: Notation) -> tuple[CheckRow, ...]:
    """Give the best checks, the best first."""
    same = len({item.cost for item in diagnosis.advice}) < 2
    return tuple(
        CheckRow(
            action=action(graph, item, notation),
            parts=partition(graph, item),
            gain=f"{item.gain:.2f} bits",
            cost="" if same else f"{item.cost:g}",
        )
        for item in diagnosis.advice[:SHOWN_CHECKS]
    )


def action(graph: BondGraph, item: Advice, notation: Notation) -> str:
    """Say what to do: `look at the pipe`."""
    match item.kind:
        case CheckKind.COMPONENT:
            known = any(part.name == item.target for part in graph.components)
            return f"{'look at' if known else 'check'} {with_article(_owner(graph, item.target))}"
        case CheckKind.SIGNAL:
            return f"measure {item.target} by hand"
        case CheckKind.INPUT:
            unit = graph.input(item.target).unit
            value = None if item.value is None else with_unit(unit.from_si(item.value), unit.text, notation, digits=3)
            wait = "" if item.within is None else f" and wait {duration_text(item.within, digits=2)}"
            return f"move {item.target}{'' if value is None else f' to {value}'}{wait}"


def partition(graph: BondGraph, item: Advice) -> str:
    """Say what a check would tell apart, `pipe from valve or leak`; each once, however many parameters it has."""
    groups = [[" with ".join(_owner(graph, name) for name in chosen) for chosen in group] for group in item.separates]
    return " from ".join(" or ".join(dict.fromkeys(group)) for group in groups)


def _owner(graph: BondGraph, name: str) -> str:
    """Name a component as it is, a sensor or an input as such."""
    return name if any(item.name == name for item in graph.components) else instrument_title(graph, name)
