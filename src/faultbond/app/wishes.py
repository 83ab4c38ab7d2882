"""What an analysis is asked for."""

from dataclasses import dataclass

from faultbond.errors import ModelError
from faultbond.model.graph import BondGraph


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What an analysis is asked for beside the usual.

    data: recording, or None. within: s, for the smallest faults; None takes 300 samples. separate: sets of parameters
    that an input shall tell apart; none: those that look alike with inputs at rest. closed: largest set of parameters
    solved in closed form. patience: s, for all closed forms together. preference: which of several routes, a value of
    `faultbond.algebra.routes.functions.Preference`.
    """

    data: str | None = None
    within: float | None = None
    separate: tuple[tuple[str, ...], ...] = ()
    closed: int = 1
    patience: float = 4.0
    preference: str = "fewest frames"


def check_names(graph: BondGraph, names: tuple[str, ...]) -> None:
    """Refuse names that are no parameters.

    Raises
    ------
    ModelError
    """
    known = [item.name for item in graph.parameters]
    for name in names:
        if name not in known:
            raise ModelError(f"{graph.file}: no parameter {name}; there are {', '.join(known) or 'none'}")
