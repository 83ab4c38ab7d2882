"""Doubtful numbers of a model in words: far outside what was declared, of a fit too, or of a sign that cannot be."""

import re
from collections.abc import Iterator, Sequence

from faultbond.contract.json_records import Record
from faultbond.contract.spec import EngineSpec
from faultbond.equations.passivity import Active, active_elements
from faultbond.fit.stray import Stray, doubts_of
from faultbond.model.graph import BondGraph
from faultbond.model.rewrite import MARK
from faultbond.report.numbers import MINUS, join, with_unit

MOVED = 1.0  # accuracies by which a healthy parameter seems to move; more is told of a model


def stray_texts(strays: Sequence[Stray]) -> list[str]:
    """Say how far parameters are from what was declared, with which others, and what that means."""
    if not strays:
        return []
    told = []
    for item in strays:
        side = "above" if item.accuracies > 0.0 else "below"
        partners = f", together with {join(list(item.partners))}" if item.partners else ""
        told.append(f"{item.parameter.name} {abs(item.accuracies):.0f} accuracies {side} what was declared{partners}")
    places = join(list(stray_places(strays)))
    told.append(f"the model lacks something there, or the numbers were wrong: look at {places} before you trust it")
    doubts = join(list(doubts_of(strays)))
    if doubts:
        told.append(f"`run` will not be sure which of {doubts} a fault is of, unless it is larger than that")
    return told


def stray_sentence(strays: Sequence[Stray]) -> str:
    """Say in a sentence which parameters are doubtful, and what to do; empty where none is."""
    if not strays:
        return ""
    names = join([item.parameter.name for item in strays])
    are, number = ("are", "the numbers") if len(strays) > 1 else ("is", "the number")
    where = join(list(stray_places(strays)))
    return (
        f"{names} {are} far outside what was declared: mend the model at {where}, or correct {number} that it states, "
        "and fit again."
    )


def stray_remark(strays: Sequence[Stray]) -> str:
    """Say the same on the line of a comment; empty where none strays."""
    if not strays:
        return ""
    names = [f"{item.parameter.name} ({item.accuracies:+.0f} accuracies{_beside(item)})" for item in strays]
    told = join(names).replace("-", MINUS)
    return f" DOUBTFUL, far outside what was declared: {told}; look at {join(list(stray_places(strays)))}."


def _beside(item: Stray) -> str:
    return f"{_WITH}{join(list(item.partners))}" if item.partners else ""


_REMARK = re.compile(r" DOUBTFUL, far outside what was declared.*?; look at [^.]*\.")
_BEFORE, _WITH = " before an earlier fit", ", with "
_SHARED = re.compile(rf"(\w+) \([^()]*{_WITH}([^()]*)\)")


def earlier_doubt(text: str) -> str:
    """Give what the first line of a model says that an earlier fit found doubtful, to be said again; empty: nothing.

    By now that is what the model declares, so nothing of it is far away any more.
    """
    first = text.partition("\n")[0]
    found = _REMARK.search(first) if first.startswith(MARK) else None
    return "" if found is None else found[0].replace("declared:", f"declared{_BEFORE}:")


def shared_by(doubt: str) -> dict[str, tuple[str, ...]]:
    """Give with which others values were doubtful, so that how far each may be off was declared."""
    return {name: tuple(re.split(", | and ", others)) for name, others in _SHARED.findall(doubt)}


def doubt_texts(doubt: str) -> list[str]:
    """Say what an earlier fit found doubtful."""
    if not doubt:
        return []
    told = doubt.removeprefix(" DOUBTFUL, ")
    return [f"{told} If the law has been mended, delete the first line of the file"]


def stray_records(strays: Sequence[Stray]) -> list[Record]:
    """Give what is told of them as records."""
    return [
        {
            "parameter": item.parameter.name,
            "accuracies": item.accuracies,
            "goes_with": list(item.partners),
            "look_at": list(stray_places([item])),
        }
        for item in strays
    ]


def stray_places(strays: Sequence[Stray]) -> tuple[str, ...]:
    """Give the components of the parameters that strayed."""
    return tuple(dict.fromkeys(item.parameter.owner for item in strays))


def doubtful(graph: BondGraph) -> Iterator[tuple[str, str]]:
    """Give the parameters of a model that seem to change by more than their accuracies, and what to say of each."""
    for item in graph.parameters:
        times = item.healthy_change / item.accuracy if item.accuracy > 0.0 else 0.0
        if times > MOVED:
            yield (
                item.name,
                f"{item.name} seems to move by {times:.1f} accuracies (sd) while healthy: the law of {item.owner}, or "
                "what is measured there, lacks something; a fault has to be larger to be told for sure",
            )


def active_texts(graph: BondGraph) -> list[str]:
    """Say which elements give what they can only take or store, which numbers are why, and what to do."""
    return [_active_text(graph, item) for item in active_elements(graph)]


def _active_text(graph: BondGraph, found: Active) -> str:
    part = found.component
    gives = f"the content of {part.name} falls as it is filled" if part.type.is_store else f"{part.name} gives power"
    if not found.numbers:
        return (
            f"{gives} by its law, with the numbers above zero, too: turn a sign in the law ({graph.file}:{part.line})"
        )
    stated = {item.name: (item.nominal, item.unit, item.line) for item in graph.parameters}
    stated |= {item.name: (item.value, item.unit, item.line) for item in graph.constants}
    told = []
    for name in found.numbers:
        value, unit, _ = stated[name]
        told.append(f"{name} is {with_unit(unit.from_si(value), unit.text)}")
    where = f"{graph.file}:{stated[found.numbers[0]][2] or part.line}"
    return f"{join(told)}, so {gives}: state it above zero, or turn the sign in the law ({where})"


def active_sentence(graph: BondGraph) -> str:
    """Say the same in sentences after an alarm; empty where every element is what it is called."""
    told = "; ".join(active_texts(graph))
    return f"{told}. Mend that first: no alarm of such a model tells anything of the plant." if told else ""


def hidden_suspects(spec: EngineSpec) -> tuple[str, ...]:
    """Name the suspects that no hypothesis changes alone, nor would explain anything."""
    told = {
        k for chosen in (*spec.hypotheses, *spec.reserve, *spec.explain_anything) if len(chosen) == 1 for k in chosen
    }
    return tuple(item.name for k, item in enumerate(spec.parameters) if item.suspect and k not in told)


def hidden_sentence(spec: EngineSpec) -> str:
    """Say after an alarm what it was not put down to, since no data seemed to fix it; empty where all was tested."""
    hidden = list(hidden_suspects(spec))
    told = f"It was not tested whether {join(hidden)} changed, of which no run with the model showed anything"
    return f"{told}: such a fault is put down to others." if hidden else ""
