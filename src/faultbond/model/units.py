"""Units: text to SI factor, offset and dimension.

Our own small grammar reads `255 Pa^0.5*s/m^3/percent^2`; the usual words such as `kPa` stand in a table. Pint is asked
only about other single words, so no text of the user reaches its expression evaluator. It is imported then.
Percent is a base unit (0..100, never a fraction), rad is 1, temperatures are K inside.
"""

import math
import re
from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from functools import cache, lru_cache
from importlib import import_module
from typing import Any

from faultbond.errors import ModelError
from faultbond.model.graph import Unit
from faultbond.model.parser import MAX_EXPONENT, number_text
from faultbond.model.source import closest, shown

MAX_UNIT_LENGTH = 100
MAX_PARENTHESES = 10

_SYMBOLS = {
    "kilogram": "kg",
    "meter": "m",
    "second": "s",
    "ampere": "A",
    "kelvin": "K",
    "mole": "mol",
    "candela": "cd",
    "percent": "percent",
}
_BASES = {symbol: name for name, symbol in _SYMBOLS.items()}
_COMMON = (  # what a misspelt unit may have been meant to be
    *("m", "cm", "mm", "km", "m^2", "s", "ms", "min", "h", "day", "kg", "g", "t", "K", "degC", "degF", "mol"),
    *("A", "mA", "V", "mV", "kV", "ohm", "kohm", "Mohm", "F", "mF", "uF", "nF", "H", "mH", "uH", "W", "kW", "MW"),
    *("J", "kJ", "Hz", "kHz", "N", "kN", "Pa", "kPa", "MPa", "bar", "mbar", "psi", "rad", "deg", "rpm"),
    *("l", "L", "ml", "percent", "C"),
)
# What engineers write that is no unit here, or another one: `Nm` counts yarn, `cfm` is a hundredth of a fermi.
_MEANT = {
    **{"lpm": "l/min", "lps": "l/s", "gpm": "gal/min", "cfm": "ft^3/min", "cmh": "m^3/h", "Nm3": "m^3", "rev": "turn"},
    **{"Nm": "N*m", "kNm": "kN*m", "mNm": "mN*m", "Nms": "N*m*s", "Watt": "W", "Watts": "W", "Ohm": "ohm", "HP": "hp"},
    **{"Celsius": "degC", "Kelvin": "K", "barg": "bar", "bara": "bar", "psig": "psi", "psia": "psi"},
}
# Words that need no pint, whose import takes longer than reading a model: factor, unit, and offset where there is one.
# A test compares them with pint's.
_WORDS: Mapping[str, tuple[str | float, str] | tuple[str | float, str, float]] = {
    **{"cm": ("0.01", "m"), "mm": ("0.001", "m"), "um": ("1e-6", "m"), "km": ("1000", "m"), "g": ("0.001", "kg")},
    **{"ms": ("0.001", "s"), "min": ("60", "s"), "h": ("3600", "s"), "day": ("86400", "s"), "days": ("86400", "s")},
    **{"t": ("1000", "kg"), "l": ("0.001", "m^3"), "L": ("0.001", "m^3"), "ml": ("1e-6", "m^3"), "mA": ("0.001", "A")},
    **{"degC": ("1", "K", 273.15), "degF": (0.5555555555555556, "K", 255.37222222222223), "Hz": ("1", "1/s")},
    **{"kHz": ("1000", "Hz"), "rpm": (0.10471975511965977, "1/s"), "deg": (0.017453292519943295, "rad")},
    **{"N": ("1", "kg*m/s^2"), "kN": ("1000", "N"), "J": ("1", "N*m"), "kJ": ("1000", "J"), "W": ("1", "J/s")},
    **{"kW": ("1000", "W"), "MW": ("1e6", "W"), "Pa": ("1", "N/m^2"), "kPa": ("1000", "Pa"), "MPa": ("1e6", "Pa")},
    **{"bar": ("1e5", "Pa"), "mbar": ("100", "Pa"), "psi": (6894.7572931683635, "Pa"), "C": ("1", "A*s")},
    **{"V": ("1", "W/A"), "mV": ("0.001", "V"), "kV": ("1000", "V"), "ohm": ("1", "V/A"), "kohm": ("1000", "ohm")},
    **{"Mohm": ("1e6", "ohm"), "F": ("1", "C/V"), "mF": ("0.001", "F"), "uF": ("1e-6", "F"), "nF": ("1e-9", "F")},
    **{"H": ("1", "V*s/A"), "mH": ("0.001", "H"), "uH": ("1e-6", "H")},
}
_TOKEN = re.compile(
    r"(?P<space> +)|(?P<name>[A-Za-zµμΩ°][A-Za-z0-9_µμΩ°]*)|(?P<number>\d+(?:\.\d+)?)|(?P<operator>\*\*|[-*/^()])"
)


@dataclass(frozen=True, slots=True)
class Dimension:
    """Powers of the base units kg m s A K mol cd percent, sorted by name, none zero; `dimensions` adds unknown ones."""

    powers: tuple[tuple[str, Fraction], ...] = ()

    def __mul__(self, other: "Dimension") -> "Dimension":
        powers = dict(self.powers)
        for base, power in other.powers:
            powers[base] = powers.get(base, Fraction(0)) + power
        return dimension_of(powers)

    def __truediv__(self, other: "Dimension") -> "Dimension":
        return self * other ** Fraction(-1)

    def __pow__(self, exponent: Fraction) -> "Dimension":
        return dimension_of({base: power * exponent for base, power in self.powers})

    def __str__(self) -> str:
        """Give the usual symbol (`Pa`) or base units (`m^3/s`); `1` if dimensionless."""
        return _derived().get(self) or self.base_text() or "1"

    def base_text(self) -> str:
        """Give the coherent SI unit in base units, one that `unit()` reads; empty if dimensionless."""
        up = "*".join(_power(base, power) for base, power in self.powers if power > 0)
        down = "".join(f"/{_power(base, -power)}" for base, power in self.powers if power < 0)
        return f"{up or '1'}{down}" if self.powers else ""


def _power(base: str, power: Fraction) -> str:
    symbol = _SYMBOLS[base]
    if power.denominator in (1, 2, 4, 5):
        return symbol if power == 1 else f"{symbol}^{number_text(float(power))}"
    return f"{symbol}^({power})"


def dimension_of(powers: Mapping[str, Fraction]) -> Dimension:
    """Give the dimension with these powers of base units."""
    return Dimension(tuple(sorted((base, power) for base, power in powers.items() if power != 0)))


DIMENSIONLESS = Dimension()
SECOND = dimension_of({"second": Fraction(1)})


def coulomb_hint(one: Dimension, other: Dimension) -> str:
    """Say what to write where two dimensions differ as those of `C` and of a temperature do; empty: they do not."""
    powers = dict((one / other).powers)
    kelvins = powers.pop("kelvin", Fraction(0))
    meant = bool(kelvins) and powers == {"ampere": -kelvins, "second": -kelvins}
    return "`C` is the coulomb; write `degC` for degrees Celsius" if meant else ""


def percent_hint(one: Dimension, other: Dimension) -> str:
    """Say what to write where two dimensions differ by a power of `percent` alone; empty: they do not."""
    meant = [name for name, _ in (one / other).powers] == ["percent"]
    advice = "`percent` goes from 0 to 100 and is a unit: state `constants: {full: 100 percent}` and divide by `full`"
    return advice if meant else ""


@cache
def _derived() -> dict[Dimension, str]:
    """Give the usual symbols of derived units, for messages."""
    return {measure(symbol).dimension: symbol for symbol in ("N", "Pa", "J", "W", "V", "ohm", "F", "H", "C", "V*s")}


@dataclass(frozen=True, slots=True)
class Measure:
    """A unit and its dimension."""

    unit: Unit
    dimension: Dimension


@dataclass(frozen=True, slots=True)
class _Product:
    """Part of a unit while it is read: exact factor where there is one."""

    factor: Fraction
    dimension: Dimension
    offset: float = 0.0

    def power(self, exponent: Fraction) -> "_Product":
        if exponent.denominator == 1:
            return _Product(self.factor**exponent.numerator, self.dimension**exponent)
        return _Product(Fraction(float(self.factor) ** float(exponent)), self.dimension**exponent)


@cache
def _registry() -> Any:
    """Give pint's registry, made once: importing it takes longer than reading a model."""
    return import_module("pint").UnitRegistry(on_redefinition="ignore", cache_folder=None)


@lru_cache(maxsize=4096)
def _word(name: str) -> _Product | None:
    """Give one word of a unit, such as `kPa`; None if nobody knows it."""
    if name == "rad":
        return _Product(Fraction(1), DIMENSIONLESS)
    if name in _BASES:
        return _Product(Fraction(1), dimension_of({_BASES[name]: Fraction(1)}))
    if name in _WORDS:
        factor, text, *offset = _WORDS[name]
        of = _Reader(text).whole()
        return _Product(Fraction(factor) * of.factor, of.dimension, *offset)
    return _asked(name)


def _asked(name: str) -> _Product | None:
    """Give one word as pint knows it."""
    registry = _registry()
    try:
        unit = registry.parse_units(name)
        factor, base = registry.get_base_units(unit)
        offset = float(registry.Quantity(0.0, unit).to_base_units().magnitude)
        if unit.dimensionless and "percent" in str(unit):
            return None
    except Exception:  # pint raises AssertionError, KeyError and its own for odd words
        return None
    powers = {key: Fraction(power).limit_denominator(64) for key, power in base._units.items() if key in _SYMBOLS}
    if (offset != 0.0 and dict(powers) != {"kelvin": 1}) or not math.isfinite(factor) or factor <= 0:
        return None  # logarithmic units: dB, pH
    return _Product(_tidy(float(factor)), dimension_of(powers), offset)


def _tidy(factor: float) -> Fraction:
    """Give a factor as a short decimal where rounding alone separates it from one: 1.0000000000000002e-06."""
    short = f"{factor:.10g}"
    return Fraction(short) if abs(float(short) - factor) <= 1e-14 * factor else Fraction(factor)


def unit(text: str, where: str = "") -> Unit:
    """Give the unit of a text such as `Pa*s^2/m^6`; the empty text is a unit that is not stated.

    Raises
    ------
    ModelError
        if the text is not a product of powers of known units.

    Example
    -------
    >>> unit("cm^2").to_si(1017.9)
    0.10179
    """
    return measure(text, where).unit


def measure(text: str, where: str = "") -> Measure:
    """Give the unit of a text with its dimension (dimensionless for the empty text).

    Raises
    ------
    ModelError
        where the text is no unit.
    """
    text = text.strip()
    if len(text) > MAX_UNIT_LENGTH:
        raise ModelError(f"{where}a unit of {len(text)} characters; at most {MAX_UNIT_LENGTH} are read")
    result = _measure(text)
    if isinstance(result, str):
        raise ModelError(where + result)
    return result


@lru_cache(maxsize=4096)
def _measure(text: str) -> Measure | str:
    """Give the unit, or what is wrong with its text."""
    if not text:
        return Measure(Unit(""), DIMENSIONLESS)
    try:
        product = _Reader(text).whole()
        factor = float(product.factor)
    except (OverflowError, ZeroDivisionError):
        return f"the unit `{shown(text)}` is too large or too small for a number"
    except ModelError as error:
        return str(error)
    if not (0 < factor < math.inf):
        return f"the unit `{shown(text)}` is too large or too small for a number"
    return Measure(Unit(text.replace(" ", "").replace("**", "^"), factor, product.offset), product.dimension)


class _Reader:
    """Reads `product = power (('*' | '/') power)*`, `power = (word | 1 | '(' product ')') ['^' number]`.

    A number is `2`, `-0.5` or `(1/3)`.
    """

    def __init__(self, text: str) -> None:
        self.text, self.tokens, self.at, self.depth = text, list[str](), 0, 0
        at = 0
        while at < len(text):
            match = _TOKEN.match(text, at)
            if match is None:
                hint = "; write `percent` for a unit of 0..100" if text[at] == "%" else ""
                raise self.error(f"`{shown(text[at])}` cannot stand in a unit{hint}")
            if not match["space"]:
                self.tokens.append(match[0])
            at = match.end()

    def error(self, problem: str) -> ModelError:
        return ModelError(f"`{shown(self.text)}` is not a unit: {problem}")

    def peek(self) -> str:
        return self.tokens[self.at] if self.at < len(self.tokens) else ""

    def take(self) -> str:
        token = self.peek()
        self.at += 1
        return token

    def whole(self) -> _Product:
        result = self.product()
        if self.peek():
            raise self.error(f"`{shown(self.peek())}` is not expected; put `*` or `/` between units, as in `kg*m^2`")
        return result

    def product(self) -> _Product:
        result, alone = self.power(), True
        while self.peek() in ("*", "/"):
            sign = 1 if self.take() == "*" else -1
            factor, alone = self.power().power(Fraction(sign)), False
            result = _Product(result.factor * factor.factor, result.dimension * factor.dimension)
        self.check(result)
        return result if alone else _Product(result.factor, result.dimension)

    def check(self, product: _Product) -> None:
        if any(abs(power) > MAX_EXPONENT for _, power in product.dimension.powers):
            raise self.error(f"a power above {MAX_EXPONENT}")
        if max(product.factor.numerator, product.factor.denominator).bit_length() > 2000:
            raise OverflowError

    def power(self) -> _Product:
        base = self.base()
        if self.peek() not in ("^", "**"):
            return base
        self.take()
        result = base.power(self.exponent())
        self.check(result)
        return result

    def exponent(self) -> Fraction:
        brackets = self.peek() == "("
        self.at += brackets
        sign = -1 if self.peek() == "-" else 1
        self.at += sign < 0
        value = sign * self.digits()
        if brackets and self.peek() == "/":
            self.take()
            divisor = self.digits()
            value = value / divisor if divisor else Fraction(MAX_EXPONENT + 1)
        if brackets and self.take() != ")":
            raise self.error("a `)` is missing")
        if abs(value) > MAX_EXPONENT:
            raise self.error(f"a power above {MAX_EXPONENT}")
        return value

    def digits(self) -> Fraction:
        digits = self.take()
        if not digits[:1].isdigit() or len(digits) > 6:
            raise self.error("a power must be a short number, as in `m^2`, `Pa^0.5` or `m^(1/3)`")
        return Fraction(digits)

    def base(self) -> _Product:
        word = self.take()
        if word == "(":
            self.depth += 1
            if self.depth > MAX_PARENTHESES:
                raise self.error("too many parentheses")
            inside = self.product()
            if self.take() != ")":
                raise self.error("a `)` is missing")
            return inside
        if word == "1":
            return _Product(Fraction(1), DIMENSIONLESS)
        if not word or not (word[0].isalpha() or word[0] == "°"):
            raise self.error(f"a unit is expected, not `{shown(word) or 'the end'}`")
        known = None if word in _MEANT else _word(word)
        if known is None:
            letters = word.rstrip("0123456789")
            meant = _MEANT.get(word, f"{letters}^{word[len(letters) :]}")
            hint = f"did you mean `{meant}`?" if word in _MEANT or letters != word else closest(word, _COMMON)
            raise self.error(f"unknown unit `{shown(word)}`; {shown(hint) or 'units are written as in `kPa*s/m^3`'}")
        return known
