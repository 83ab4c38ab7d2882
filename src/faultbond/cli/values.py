"""How the values of options are read; what is none is told in a line that says what was expected."""

import argparse
from collections.abc import Callable
from math import isnan, nan

from faultbond.errors import FaultbondError, ModelError
from faultbond.io.times import moment_of
from faultbond.model.graph import Unit
from faultbond.types import LOWEST_LEVEL, SURE


def name_list(text: str) -> tuple[str, ...]:
    """Read names with commas between.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    found = tuple(item.strip() for item in text.split(","))
    if not all(found):
        raise FaultbondError(f"{text!r}: expected names with commas between, such as R,L")
    if len(set(found)) < len(found):
        raise FaultbondError(f"{text!r}: a name stands there twice; give each once")
    return found


def whole_number(option: str, least: int, most: int) -> Callable[[str], int]:
    """Give the function that reads a whole number between two others.

    Raises
    ------
    FaultbondError
        Where it is none.
    """

    def read(text: str) -> int:
        if not (text.isascii() and text.isdigit() and least <= int(text) <= most):
            raise FaultbondError(f"{option} {text}: expected a whole number from {least} to {most}")
        return int(text)

    return read


def seed(text: str) -> int:
    """Read a whole number that is not negative.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    try:
        value = int(text)
    except ValueError:
        value = -1
    if value < 0:
        raise FaultbondError(f"--seed {text}: expected a whole number from 0, such as 1")
    return value


def time_span(text: str) -> float:
    """Read a duration, s.

    Raises
    ------
    ArgumentTypeError
        Where it is none; argparse tells it with the option.
    """
    from faultbond.model.quantities import duration  # noqa: PLC0415 - loads what reads units; `run` needs none

    try:
        return duration(text)
    except ModelError as error:
        raise argparse.ArgumentTypeError(str(error)) from error


def start(text: str) -> tuple[str, float]:
    """Read the start of a state; SI.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    from faultbond.model.quantities import quantity  # noqa: PLC0415

    name, equals, value = text.partition("=")
    if not equals:
        raise FaultbondError(f"--start {text!r}: expected STATE=VALUE, such as 'tank.q=0.05 m^3'.")
    return name.strip(), quantity(value, f"--start {text!r}: ").value


def part(text: str) -> float:
    """Read a percentage as a part of 1.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    from faultbond.model.quantities import spread  # noqa: PLC0415

    found = spread(text)
    if not found.is_relative:
        raise FaultbondError(f"{text!r} is no percentage. Write it as in --spread '3 %'.")
    return found.ratio


def level(text: str) -> float:
    """Read a probability from which a diagnosis is accepted.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
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


def moment(text: str) -> float:
    """Read a moment of a recording's clock, s.

    Raises
    ------
    FaultbondError
        Where it is none.
    """
    found = moment_of(text, Unit("s"))
    if isnan(found):
        raise FaultbondError(f"{text!r}: expected seconds, or a time such as 2026-11-23T14:00:00, which is UTC.")
    return found
