"""Equations of a static network, and when two values of a signal agree."""

from collections.abc import Mapping
from dataclasses import dataclass
from fractions import Fraction
from math import inf, isfinite

from faultbond.equations.numeric import Real, numeric_value
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, names

TOLERANCE = 1e-9  # two values of a signal agree within this part of the larger one
MAX_BITS = 2000  # of an exact value
ROUNDING = 1e-13  # and within this part of the terms that they are sums of, for data that are no exact decimals


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockLaw:
    """A law of a block, or what a sensor reads: left = right.

    names: all that it names. signal: what a law gives in terms of others, if it does; `uses` are then the others.
    """

    left: Expression
    right: Expression
    names: tuple[str, ...]
    uses: tuple[str, ...]
    signal: str | None = None
    block: str = ""
    sensor: str = ""


def equation(left: Expression, right: Expression, *, block: str = "", sensor: str = "") -> BlockLaw:
    """Give the equation left = right."""
    used = names(right)
    every = tuple(dict.fromkeys((*names(left), *used)))
    if isinstance(left, Name) and block and left.text not in used:
        return BlockLaw(left=left, right=right, names=every, uses=used, signal=left.text, block=block)
    return BlockLaw(left=left, right=right, names=every, uses=every, block=block, sensor=sensor)


def holds(equation: BlockLaw, known: Mapping[str, Real], sizes: Mapping[str, float]) -> bool:
    """Whether both sides agree, to rounding; not where one has no real value."""
    left, right = numeric_value(equation.left, known), numeric_value(equation.right, known)
    if not (isfinite(left) and isfinite(right)):
        return False
    if left == right:
        return True
    larger = max(magnitude(left), magnitude(right))
    terms = max(size(equation.left, known, sizes), size(equation.right, known, sizes))
    return magnitude(left - right) <= TOLERANCE * larger + ROUNDING * terms


def shortened(value: Real) -> Real:
    """Give a fraction of very many digits in floating point, others as they are."""
    if isinstance(value, Fraction) and value.numerator.bit_length() + value.denominator.bit_length() > MAX_BITS:
        try:
            return float(value)
        except OverflowError:
            return inf
    return value


def magnitude(value: Real) -> float:
    """Give the size of a value, infinite beyond the range of floating point."""
    try:
        return abs(float(value))
    except OverflowError:
        return inf


def size(expression: Expression, known: Mapping[str, Real], sizes: Mapping[str, float]) -> float:
    """Give the size of the terms that a value is the sum of: what rounding is relative to."""
    match expression:
        case Name(text):
            return sizes[text]
        case Negative(operand):
            return size(operand, known, sizes)
        case Binary("+" | "-", left, right):
            return size(left, known, sizes) + size(right, known, sizes)
        case Binary("*", left, right):
            return size(left, known, sizes) * size(right, known, sizes)
        case Binary("/", left, right):
            divisor = magnitude(numeric_value(right, known))
            return size(left, known, sizes) / divisor if divisor else 0.0
        case Call("abs" | "min" | "max", arguments):
            return max(size(argument, known, sizes) for argument in arguments)
    return magnitude(numeric_value(expression, known))
