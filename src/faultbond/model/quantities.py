"""Quantities of the model file: `64650 Pa`, `3 %`, `2 % of 8.9 kPa`, `0.2 cm over 40 s`."""

import math
import re
from collections.abc import Iterable
from dataclasses import dataclass

from faultbond.errors import ModelError
from faultbond.model.graph import Unit
from faultbond.model.parser import number_text
from faultbond.model.source import shown
from faultbond.model.units import SECOND, Dimension, Measure, measure

MAX_QUANTITY_LENGTH = 200

_NUMBER = re.compile(r"\s*([+-]?(?:[0-9]+\.?[0-9]*|\.[0-9]+)(?:[eE][+-]?[0-9]{1,3})?)(?=[^0-9A-Za-z_.]|$)\s*")
_COMMA = re.compile(r"\s*[+-]?[0-9]+,[0-9]")
_DECIMAL_COMMA = re.compile(r"\s*[+-]?[0-9]+,(?![0-9]{3}(?![0-9]))[0-9]+(?![0-9.,])")  # surely not one of thousands
NO_UNIT = Unit("")


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number and its unit; `measure` is None where no unit was written."""

    number: float
    measure: Measure | None

    @property
    def unit(self) -> Unit:
        """The unit as written; `NO_UNIT` if none was."""
        return self.measure.unit if self.measure else NO_UNIT

    @property
    def dimension(self) -> Dimension | None:
        """The dimension; None if no unit was written."""
        return self.measure.dimension if self.measure else None

    @property
    def value(self) -> float:
        """SI value."""
        return self.unit.to_si(self.number)

    @property
    def difference(self) -> float:
        """SI value as a difference: without the offset of a temperature."""
        return self.unit.factor * self.number


@dataclass(frozen=True, slots=True)
class Spread:
    """A standard deviation: a quantity, or `ratio` of a size (`3 %`; `of` None: of the value in question)."""

    absolute: Quantity | None = None
    ratio: float = 0.0
    of: Quantity | None = None

    @property
    def is_relative(self) -> bool:
        """Whether it needs a value before it is a number."""
        return self.absolute is None and self.of is None

    @property
    def quantity(self) -> Quantity | None:
        """The quantity that carries its unit; None if it is relative."""
        return self.absolute or self.of

    def difference(self, size: float = 0.0) -> float:
        """SI standard deviation; `size` is the SI value that a relative one refers to."""
        if self.absolute is not None:
            return self.absolute.difference
        return self.ratio * abs(self.of.difference if self.of else size)


def quantity(text: str, where: str = "", default: Measure | None = None) -> Quantity:
    """Give the quantity of a text.

    Parameters
    ----------
    text : a number, or a number and a unit
    where : start of every error message
    default : the unit of a number without one

    Raises
    ------
    ModelError
        where it is none, is relative, or too large.

    Example
    -------
    >>> quantity("20 mA").value
    0.02
    """
    number, rest = _number(text, where, "a number and a unit, such as `64650 Pa`")
    if rest.startswith("%"):
        raise ModelError(f"{where}`{shown(text)}` is relative; write `percent` for a unit of 0..100, or give a value")
    result = Quantity(number, measure(rest, where) if rest else default)
    if not (math.isfinite(result.value) and math.isfinite(result.difference)):
        raise ModelError(f"{where}`{shown(text)}` is too large for a number; rescale it")
    return result


def spread(text: str, where: str = "", default: Measure | None = None) -> Spread:
    """Give the standard deviation of a text: `180 Pa`, `3 %` or `2 % of 8.9 kPa`.

    Raises
    ------
    ModelError
        where it is none, or negative.

    Example
    -------
    >>> spread("2 % of 8.9 kPa").difference()
    178.0
    """
    number, rest = _number(text, where, "a number and a unit, or a percentage, such as `180 Pa` or `3 %`")
    if rest.startswith("%"):
        tail = rest[1:].strip()
        word, _, size = tail.partition(" ")
        if tail and (word != "of" or not size.strip()):
            raise ModelError(f"{where}`{shown(text)}` is not understood; write `3 %` or `2 % of 8.9 kPa`")
        result = Spread(ratio=number / 100, of=quantity(size, where, default) if tail else None)
    else:
        result = Spread(absolute=quantity(text, where, default))
    if number < 0:
        raise ModelError(f"{where}`{shown(text)}` is negative; a standard deviation is 0 or more")
    return result


def duration(text: str, where: str = "") -> float:
    """Give a time in seconds; its unit must be stated.

    Raises
    ------
    ModelError
        where it is none, has no unit of time, or is negative.

    Example
    -------
    >>> duration("10 min")
    600.0
    """
    result = quantity(text, where)
    if result.dimension is None:
        raise ModelError(f"{where}`{shown(text)}` needs a time unit, such as `{number_text(result.number)} s`")
    if result.dimension != SECOND:
        raise ModelError(f"{where}`{shown(text)}` is in {result.dimension}, not a time; write it in s, min or h")
    if result.value < 0:
        raise ModelError(f"{where}`{shown(text)}` is negative; a time is 0 or more")
    return result.value


def spread_over(
    text: str, where: str = "", default: Measure | None = None, what: str = "slow error"
) -> tuple[Spread, float]:
    """Give the standard deviation and the memory in seconds of a slow error, or of `what` it is, `2 % over 600 s`.

    Raises
    ------
    ModelError
        where it is none, or has no memory.

    Example
    -------
    >>> spread_over("0.5 cm^3/s over 10 min")[1]
    600.0
    """
    parts = re.split(r"\sover\s", text[: MAX_QUANTITY_LENGTH + 1])
    if len(parts) != 2:
        problem = f"is not a {what}; write its standard deviation and its memory, such as `2 % over 600 s`"
        raise ModelError(f"{where}`{shown(text)}` {problem}")
    memory = duration(parts[1], where)
    if memory == 0:
        raise ModelError(f"{where}`{shown(text)}` has no memory; what has none is noise of a sensor or input")
    return spread(parts[0], where, default), memory


def shared_factor(units: Iterable[Unit]) -> float:
    """Give the SI factor that all units share; 1 (SI) if they differ."""
    factors = {item.factor for item in units}
    return factors.pop() if len(factors) == 1 else 1.0


def _number(text: str, where: str, wanted: str) -> tuple[float, str]:
    """Split a text into its number and the rest."""
    if len(text) > MAX_QUANTITY_LENGTH:
        raise ModelError(f"{where}a quantity of {len(text)} characters; at most {MAX_QUANTITY_LENGTH} are read")
    if _DECIMAL_COMMA.match(text):
        raise ModelError(
            f"{where}`{shown(text)}` is not a quantity: a decimal comma? Write `{shown(text.replace(',', '.', 1))}`"
        )
    if _COMMA.match(text):
        raise ModelError(
            f"{where}`{shown(text)}` is not a quantity: a comma in its number; write it without, as 1000.5"
        )
    match = _NUMBER.match(text)
    if match is None:
        raise ModelError(f"{where}`{shown(text)}` is not a quantity; write {wanted}")
    value = float(match[1])
    if not math.isfinite(value):
        raise ModelError(f"{where}`{shown(text)}` is too large for a number; rescale it")
    return value, text[match.end() :].strip()
