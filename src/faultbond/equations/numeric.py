"""Values and slopes of expressions, in floating point or exactly.

Exact means fractions: a literal number counts as the decimal that was written. Roots of numbers that are no squares,
and functions such as `exp`, leave the fractions and give floating point.
"""

import math
from collections.abc import Callable, Collection, Mapping, Sequence
from fractions import Fraction
from functools import lru_cache
from typing import Any

from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number

Real = float | Fraction  # whole numbers among them
Slopes = dict[str, Real]  # derivative by each name; absent where it is zero

NAN = math.nan
_COMPARISONS: dict[str, Callable[[Real, Real], bool]] = {
    "<": lambda a, b: a < b,
    "<=": lambda a, b: a <= b,
    ">": lambda a, b: a > b,
    ">=": lambda a, b: a >= b,
    "==": lambda a, b: a == b,
    "!=": lambda a, b: a != b,
}


MAX_BITS = 1022  # of a whole number in floating point, with one to spare


@lru_cache(maxsize=4096)
def exact(value: float) -> Fraction:
    """Give the fraction that the shortest decimal of a number stands for.

    Example
    -------
    >>> exact(0.4)
    Fraction(2, 5)
    """
    return Fraction(repr(float(value)))


def is_nan(value: Real) -> bool:
    """Whether a number is none."""
    return isinstance(value, float) and math.isnan(value)


def numeric_value(expression: Expression, values: Mapping[str, Real]) -> Real:
    """Give the value of an expression; nan where it has no real value, or one beyond floating point.

    Exact if all values that it needs are fractions and it uses `+ - * /`, whole powers, `abs sign min max where` and
    roots of squares only.
    """
    try:
        return _in_reach(_slopes(expression, values, frozenset())[0])
    except (ArithmeticError, ValueError):
        return NAN


def condition_holds(condition: Expression, values: Mapping[str, Real]) -> bool:
    """Whether a condition is true; `values` maps names of inputs and constants to SI values."""
    match condition:
        case Binary("and", left, right):
            return condition_holds(left, values) and condition_holds(right, values)
        case Binary("or", left, right):
            return condition_holds(left, values) or condition_holds(right, values)
        case Binary(operator, left, right) if operator in _COMPARISONS:
            return _COMPARISONS[operator](numeric_value(left, values), numeric_value(right, values))
    return bool(numeric_value(condition, values))


def slopes(expression: Expression, values: Mapping[str, Real], names: Collection[str]) -> tuple[Real, Slopes]:
    """Give the value of an expression and its derivatives by some names; (nan, {}) where there is no real value."""
    try:
        value, by = _slopes(expression, values, names)
    except (ArithmeticError, ValueError):
        return NAN, {}
    return _in_reach(value), {name: _in_reach(slope) for name, slope in by.items()}


def _in_reach(value: Real) -> Real:
    """Give a value that floating point can hold, too; nan for one that is larger."""
    if not isinstance(value, Fraction | int):
        return value
    return NAN if value.numerator.bit_length() - value.denominator.bit_length() > MAX_BITS else value


def _slopes(expression: Expression, values: Mapping[str, Real], names: Collection[str]) -> tuple[Real, Slopes]:
    match expression:
        case Number(value):
            return (int(value) if value.is_integer() else exact(value)), {}
        case Name(text):
            return values[text], ({text: 1} if text in names else {})
        case Negative(operand):
            inner, by = _slopes(operand, values, names)
            return -inner, {name: -slope for name, slope in by.items()}
        case Binary("**", base, exponent):
            return _power(_slopes(base, values, names), _slopes(exponent, values, names))
        case Binary(operator, left, right):
            return _binary(operator, _slopes(left, values, names), _slopes(right, values, names))
        case Call("where", (Binary(operator, left, right), yes, no)):
            holds = _COMPARISONS[operator](numeric_value(left, values), numeric_value(right, values))
            return _slopes(yes if holds else no, values, names)
        case Call(("min" | "max") as function, arguments):
            parts = [_slopes(argument, values, names) for argument in arguments]
            return (min if function == "min" else max)(parts, key=lambda part: part[0])
        case Call(function, (argument,)):
            inner, by = _slopes(argument, values, names)
            result, slope = FUNCTIONS[function](inner, bool(by))
            return result, {name: slope * each for name, each in by.items()}
    raise ValueError(expression)


def combine(one: Slopes, scale_one: Real, two: Slopes, scale_two: Real) -> Slopes:
    """Give scale_one * one + scale_two * two."""
    result = {name: scale_one * slope for name, slope in one.items()}
    for name, slope in two.items():
        result[name] = result[name] + scale_two * slope if name in result else scale_two * slope
    return result


def _binary(operator: str, left: tuple[Real, Slopes], right: tuple[Real, Slopes]) -> tuple[Real, Slopes]:
    (a, by_a), (b, by_b) = left, right
    match operator:
        case "+":
            return a + b, combine(by_a, 1, by_b, 1) if by_b else by_a
        case "-":
            return a - b, combine(by_a, 1, by_b, -1) if by_b else by_a
        case "*":
            return a * b, combine(by_a, b, by_b, a) if by_a or by_b else {}
        case "/":
            value = _over(a, b)
            return value, combine(by_a, _over(1, b), by_b, _over(-value, b)) if by_a or by_b else {}
    raise ValueError(operator)


def _over(above: Real, below: Real) -> Real:
    """Give above / below, a fraction where both are whole."""
    return Fraction(above, below) if isinstance(above, int) and isinstance(below, int) else above / below


def _power(base: tuple[Real, Slopes], exponent: tuple[Real, Slopes]) -> tuple[Real, Slopes]:
    (a, by_a), (n, by_n) = base, exponent
    if n == int(n) and not by_n:
        whole = int(n)
        a = Fraction(a) if isinstance(a, int) and whole < 1 else a
        slope = whole * a ** (whole - 1) if by_a and whole else 0
        return a**whole, {name: slope * inner for name, inner in by_a.items()}
    value = math.pow(a, n)
    by: Slopes = {name: n * value / a * slope for name, slope in by_a.items()}
    return value, combine(by, 1, by_n, value * math.log(a)) if by_n else by


def square_root(value: Real) -> Real:
    """Give the root, a fraction where it is one."""
    if isinstance(value, int | Fraction) and value >= 0:
        above, below = math.isqrt(value.numerator), math.isqrt(value.denominator)
        if above * above == value.numerator and below * below == value.denominator:
            return Fraction(above, below)
    return math.sqrt(value)


def _sqrt(value: Real, sloped: bool) -> tuple[Real, Real]:
    root = square_root(value)
    return root, (1 / (2 * root) if sloped else 0)


def _plain(function: Callable[[float], float], slope: Callable[[float], float]) -> Callable[[Real, bool], Any]:
    return lambda value, sloped: (function(float(value)), slope(float(value)) if sloped else 0)


FUNCTIONS: dict[str, Callable[[Real, bool], tuple[Real, Real]]] = {  # value and slope
    "abs": lambda value, _: (-value, Fraction(-1)) if value < 0 else (value, Fraction(1)),
    "sign": lambda value, _: (Fraction((value > 0) - (value < 0)), 0),
    "sqrt": _sqrt,
    "exp": _plain(math.exp, math.exp),
    "log": _plain(math.log, lambda value: 1.0 / value),
    "sin": _plain(math.sin, math.cos),
    "cos": _plain(math.cos, lambda value: -math.sin(value)),
    "tan": _plain(math.tan, lambda value: 1.0 + math.tan(value) ** 2),
    "tanh": _plain(math.tanh, lambda value: 1.0 - math.tanh(value) ** 2),
    "atanh": _plain(math.atanh, lambda value: 1.0 / (1.0 - value * value)),
}


def solve_linear(rows: Sequence[Mapping[int, Real]], right: Sequence[Real]) -> list[Real] | None:
    """Give x with rows x = right, by elimination in the arithmetic of the entries; None where it is singular.

    Parameters
    ----------
    rows : one mapping from column to entry for each of as many rows as columns
    right : one value for each row
    """
    work = [(dict(row), value) for row, value in zip(rows, right, strict=True)]
    order: list[tuple[int, dict[int, Real], Real]] = []
    while work:
        work.sort(key=lambda item: len(item[0]))
        row, value = work.pop(0)
        row = {column: entry for column, entry in row.items() if entry}
        if not row:
            return None
        column = max(row, key=lambda key: (abs(row[key]), -key))
        pivot = row.pop(column)
        row, value = {key: _over(entry, pivot) for key, entry in row.items()}, _over(value, pivot)
        order.append((column, row, value))
        for position, (other, there) in enumerate(work):
            if factor := other.pop(column, 0):
                for key, entry in row.items():
                    other[key] = other.get(key, 0) - factor * entry
                work[position] = (other, there - factor * value)
    found: dict[int, Real] = {}
    for column, row, value in reversed(order):
        found[column] = value - sum((entry * found[key] for key, entry in row.items()), start=Fraction(0))
    return [found[column] for column in range(len(rows))]
