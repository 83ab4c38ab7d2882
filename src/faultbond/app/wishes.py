"""What the verbs are asked for."""

from dataclasses import dataclass
from math import inf
from pathlib import Path
from typing import TYPE_CHECKING

from faultbond.errors import FaultbondError
from faultbond.types import Method

if TYPE_CHECKING:
    from faultbond.io.memory_table import Recording

DEMO = "tank"  # the example that the demo runs

WITHIN = 600.0  # s that a fit until quiet takes, if nobody says


@dataclass(frozen=True, slots=True, kw_only=True)
class Wishes:
    """What an analysis is asked for beside the usual.

    data: recording, or None. within: s, for the smallest faults; None takes 300 samples. separate: sets of parameters
    that an input shall tell apart; none: those that look alike with inputs at rest. closed: largest set of parameters
    solved in closed form. patience: s, for all closed forms together. preference: which of several routes, a value of
    `faultbond.algebra.routes.functions.Preference`. budget: how many times the usual time and size each search has.
    """

    data: "Recording | None" = None
    within: float | None = None
    separate: tuple[tuple[str, ...], ...] = ()
    closed: int = 1
    patience: float = 4.0
    preference: str = "fewest frames"
    budget: int = 1


@dataclass(frozen=True, slots=True, kw_only=True)
class FitWishes:
    """What is to be fitted, and how.

    fixed: parameters that are known. free: the only ones to be found; None: all others. prior: what declared
    accuracies count for, the name of a `Prior`. starts, seed: of the search. own: parameters that each recording has
    for itself, such as the temperature at its start; they are not written. until_quiet: whether what the recordings
    call for is added to the model. within: s that this may take.
    """

    fixed: tuple[str, ...] = ()
    free: tuple[str, ...] | None = None
    prior: str = "widened"
    starts: int = 4
    seed: int = 0
    own: tuple[str, ...] = ()
    until_quiet: bool = False
    within: float = WITHIN


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfections:
    """What a simulated plant has and its model leaves out.

    spread: healthy parameters differ from nominal by up to this part. lag: s, of inputs with a declared settling.
    curve: largest error, as a part, of the curve of an input in percent. wander: whether what wanders does so.

    Raises
    ------
    FaultbondError
        Where one is negative, or without a limit.
    """

    spread: float = 0.0
    lag: float = 0.0
    curve: float = 0.0
    wander: bool = False

    def __post_init__(self) -> None:
        for name in ("spread", "lag", "curve"):
            if not 0.0 <= getattr(self, name) < inf:
                raise FaultbondError(f"{name} {getattr(self, name):g}: expected a finite number, 0 or more")


@dataclass(frozen=True, slots=True, kw_only=True)
class Wanted:
    """How a plant is watched. accept: probability from which a rule accepts a diagnosis. state: file that keeps it."""

    method: Method = Method.BANK
    report: Path | None = None
    accept: float | None = None
    state: Path | None = None
