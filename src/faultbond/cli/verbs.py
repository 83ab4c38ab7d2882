"""What the command line needs of the verbs, and what every verb's arguments share."""

import argparse
import os
from collections.abc import Callable, Mapping
from math import nan
from pathlib import Path
from typing import Never, Protocol, TypeAlias

from faultbond.app import FitWishes, Imperfections, Wanted, Wishes
from faultbond.app.wishes import SURE
from faultbond.errors import FaultbondError
from faultbond.io.faults import FaultRequest
from faultbond.io.out import Out
from faultbond.model.quantities import duration, spread
from faultbond.types import EngineChoice, Verdict

DONE, FAULT_DETECTED, NO_VERDICT = 0, 1, 4
ENGINE = "FAULTBOND_ENGINE"
LOWEST_LEVEL = 0.5  # a diagnosis that is less likely than its opposite is accepted by no rule


class Verbs(Protocol):
    """What the command line needs of `faultbond.app`."""

    def check(self, model: Path, *, engine: EngineChoice, out: Out) -> None:
        """Tell what was understood of a model."""

    def analyse(self, model: Path, *, wishes: Wishes, out: Out) -> bool:
        """Tell what can be found and told apart, and give whether anything could be told."""

    def print_code(self, model: Path, form: str, *, wishes: Wishes, out: Out) -> None:
        """Print the closed forms as code."""

    def trace(self, model: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Print the thesis' search for a route."""

    def check_data(
        self, model: Path, recordings: tuple[str, ...], *, promise: float | None, engine: EngineChoice, out: Out
    ) -> None:
        """Put a model on trial on healthy recordings."""

    def fit(
        self,
        model: Path,
        recordings: tuple[str, ...],
        *,
        wishes: FitWishes,
        output: Path | None,
        report: Path | None,
        engine: EngineChoice,
        out: Out,
    ) -> None:
        """Fit a model to healthy recordings."""

    def simulate(
        self,
        model: Path,
        *,
        inputs: str,
        faults: tuple[FaultRequest, ...],
        seed: int | None,
        imperfections: Imperfections,
        start: Mapping[str, float],
        output: Path,
        out: Out,
    ) -> None:
        """Write a recording of the simulated plant; `inputs` is a path or `-`."""

    def run(self, model: Path, recording: str, *, wanted: Wanted, out: Out) -> Verdict:
        """Watch a recording, a path or `-`, and give the verdict."""

    def accept(self, model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Take a candidate of a kept run, without names the best, as the new healthy model."""

    def reject(self, model: Path, state: Path, names: tuple[str, ...], *, out: Out) -> None:
        """Rule a candidate of a kept run out."""

    def demo(self, *, report: Path, engine: EngineChoice, out: Out) -> None:
        """Find a fault in the built-in water tank and write the report."""


Call = Callable[[argparse.Namespace, Verbs, Out], int]


class Parser(argparse.ArgumentParser):
    """An argument parser whose complaint is one line."""

    def error(self, message: str) -> Never:
        """Refuse the arguments."""
        raise FaultbondError(f"{self.prog}: {message}. See: {self.prog} --help")


Subparsers: TypeAlias = "argparse._SubParsersAction[Parser]"


def add_verb(verbs: Subparsers, name: str, call: Call, summary: str, example: str) -> argparse.ArgumentParser:
    """Add a verb with what all verbs share."""
    parser = verbs.add_parser(
        name,
        help=summary,
        description=f"{summary[0].upper()}{summary[1:]}.",
        epilog=f"Example: {example}",
        allow_abbrev=False,
    )
    parser.add_argument("--json", metavar="FILE", help="write the result as JSON lines; - is standard output")
    parser.set_defaults(call=call)
    return parser


def add_model(parser: argparse.ArgumentParser) -> None:
    """Add the model file argument."""
    parser.add_argument("model", metavar="MODEL", type=Path, help="model file, YAML")


def add_engine(parser: argparse.ArgumentParser) -> None:
    """Add the choice of the engine."""
    parser.add_argument(
        "--engine",
        choices=[choice.value for choice in EngineChoice],
        help=f"c: compiled, vm: without a compiler, auto: c where there is a compiler (default: ${ENGINE}, else auto)",
    )


def engine(arguments: argparse.Namespace) -> EngineChoice:
    """Give the engine of the option, else of the environment."""
    name: str = arguments.engine or os.environ.get(ENGINE) or EngineChoice.AUTO.value
    known = [choice.value for choice in EngineChoice]
    if name not in known:
        raise FaultbondError(f"{ENGINE}={name}: no such engine; set it to one of {', '.join(known)}.")
    return EngineChoice(name)


def part(text: str) -> float:
    """Read a percentage as a part of 1."""
    found = spread(text)
    if not found.is_relative:
        raise FaultbondError(f"{text!r} is no percentage. Write it as in --spread '3 %'.")
    return found.ratio


def time(text: str) -> float:
    """Read a length of time in seconds."""
    return duration(text)


def whole(text: str) -> int:
    """Read a whole number that is not negative."""
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise FaultbondError(f"--seed {text}: expected a whole number from 0, such as 1")
    return value


def level(text: str) -> float:
    """Read a probability from which a diagnosis is accepted."""
    if text == "auto":
        return SURE
    try:
        value = float(text)
    except ValueError:
        value = nan
    if not LOWEST_LEVEL <= value <= 1.0:
        raise FaultbondError(
            f"--accept {text}: expected auto, or a probability from {LOWEST_LEVEL:g} to 1, such as 0.99"
        )
    return value
