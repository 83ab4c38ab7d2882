"""Doubtful numbers of a fit in words: far outside what was declared."""

import re
from collections.abc import Sequence

from faultbond.contract.json_records import Record
from faultbond.fit.stray import Stray, doubts_of
from faultbond.model.rewrite import MARK
from faultbond.report.numbers import MINUS, join


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
