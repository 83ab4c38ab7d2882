"""Expressions as quotients of polynomials, and back."""

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from math import gcd, lcm

from faultbond.algebra.solving.polynomial import (
    Polynomial,
    Space,
    add,
    common_monomial,
    constant,
    multiply,
    power,
    primitive,
    scale,
)
from faultbond.equations.numeric import exact
from faultbond.model.expression import Binary, Expression, Name, Negative, Number

_MAX_EXPONENT = 16
_LONG = 100


@dataclass(frozen=True, slots=True)
class NotRationalError(Exception):
    """The expression is no quotient of polynomials."""


@dataclass(frozen=True, slots=True, kw_only=True)
class Quotient:
    """numerator / denominator, in the names of a space."""

    numerator: Polynomial
    denominator: Polynomial
    space: Space


def quotient(expression: Expression, space: Space) -> tuple[Polynomial, Polynomial]:
    """Give numerator and denominator of an expression; numbers count as the decimals that they are.

    Raises
    ------
    NotRationalError
        Where the expression uses functions, or powers that are not whole numbers.
    """
    match expression:
        case Number(value):
            number = exact(value)
            return constant(number.numerator), constant(number.denominator)
        case Name(text):
            return space.name(text), constant(1)
        case Negative(operand):
            above, below = quotient(operand, space)
            return scale(above, -1), below
        case Binary("**", base, exponent):
            return _power(quotient(base, space), _whole(exponent), space)
        case Binary(operator, left, right):
            return _combined(operator, quotient(left, space), quotient(right, space), space)
    raise NotRationalError


def _whole(exponent: Expression) -> int:
    match exponent:
        case Number(value) if value == int(value) and value <= _MAX_EXPONENT:
            return int(value)
        case Negative(Number(value)) if value == int(value) and value <= _MAX_EXPONENT:
            return -int(value)
    raise NotRationalError


def _power(base: tuple[Polynomial, Polynomial], exponent: int, space: Space) -> tuple[Polynomial, Polynomial]:
    above, below = base if exponent >= 0 else base[::-1]
    return power(above, abs(exponent), space), power(below, abs(exponent), space)


def _combined(
    operator: str, one: tuple[Polynomial, Polynomial], two: tuple[Polynomial, Polynomial], space: Space
) -> tuple[Polynomial, Polynomial]:
    (above, below), (above_2, below_2) = one, two
    match operator:
        case "*":
            return multiply(above, above_2, space), multiply(below, below_2, space)
        case "/":
            return multiply(above, below_2, space), multiply(below, above_2, space)
        case "+" | "-":
            sign = 1 if operator == "+" else -1
            if below == below_2:
                return add(above, above_2, sign), below
            left, right = multiply(above, below_2, space), multiply(above_2, below, space)
            return add(left, right, sign), multiply(below, below_2, space)
    raise NotRationalError


def specialise(polynomial: Polynomial, space: Space, values: Mapping[str, Fraction], into: Space) -> Polynomial:
    """Give a polynomial with numbers for some names, times what makes its coefficients whole and coprime.

    Parameters
    ----------
    polynomial, space : with all names
    values : numbers for some of them
    into : the space of the names that are left
    """
    sums: dict[int, Fraction] = {}
    for monomial, coefficient in polynomial.items():
        total, key = Fraction(coefficient), 0
        for name, exponent in space.powers(monomial).items():
            if name in values:
                total *= values[name] ** exponent
            else:
                key += exponent << into.shifts[name]
        sums[key] = sums.get(key, Fraction(0)) + total
    below = lcm(*(total.denominator for total in sums.values()))
    whole = {key: int(total * below) for key, total in sums.items() if total}
    return primitive(whole, into, 0)


def to_expression(polynomial: Polynomial, space: Space, outer: Collection[str] = ()) -> Expression:
    """Give a polynomial as an expression in a fixed order: common factors first, then grouped by the outer names.

    Example: `J dt omega_0 - J dt omega_1` with the outer names J and dt becomes `J*dt*(omega_0 - omega_1)`.
    """
    sign, size = _signed(polynomial, space, outer)
    return Negative(size) if sign < 0 else size


def _signed(polynomial: Polynomial, space: Space, outer: Collection[str]) -> tuple[int, Expression]:
    """Give the sign of an expression and the rest of it; the sign is negative where all terms are."""
    if not polynomial:
        return 1, Number(0.0)
    sign = -1 if all(coefficient < 0 for coefficient in polynomial.values()) else 1
    content = sign * gcd(*polynomial.values())
    common = common_monomial(polynomial, space)
    inner = {monomial - common: coefficient // content for monomial, coefficient in polynomial.items()}
    if len(inner) == 1:
        return sign, _term(abs(content), common, space)
    body = _sum(inner, space, outer)
    if not common and abs(content) == 1:
        return sign, body
    return sign, Binary("*", _term(abs(content), common, space), body)


def _sum(polynomial: Polynomial, space: Space, outer: Collection[str]) -> Expression:
    """Give a sum of two or more terms; one that is added comes first."""
    mask = space.mask(name for name in outer if name in space.shifts)
    groups: dict[int, Polynomial] = {}
    for monomial in sorted(polynomial, key=lambda item: _rank(item, space)):
        groups.setdefault(monomial & mask, {})[monomial & ~mask] = polynomial[monomial]
    if len(groups) == 1:
        parts = [_signed({monomial: coefficient}, space, ()) for monomial, coefficient in polynomial.items()]
        keys = list(polynomial)
    else:
        parts = [_product(key, _signed(group, space, ()), space) for key, group in groups.items()]
        keys = list(groups)
    ordered = [part for _, part in sorted(zip(keys, parts, strict=True), key=lambda item: _rank(item[0], space))]
    first = next((k for k, (sign, _) in enumerate(ordered) if sign > 0), 0)
    ordered.insert(0, ordered.pop(first))
    return _folded(ordered)


def _folded(parts: Sequence[tuple[int, Expression]]) -> Expression:
    """Give a sum of signed parts; a long one as a sum of sums, so that no tree gets too deep."""
    if len(parts) > _LONG:
        return _folded([(1, _folded(parts[k : k + _LONG])) for k in range(0, len(parts), _LONG)])
    sign, result = parts[0]
    result = Negative(result) if sign < 0 else result
    for sign, part in parts[1:]:
        result = Binary("+" if sign > 0 else "-", result, part)
    return result


def _product(monomial: int, signed: tuple[int, Expression], space: Space) -> tuple[int, Expression]:
    sign, inner = signed
    if not monomial:
        return sign, inner
    factor = _term(1, monomial, space)
    return sign, factor if inner == Number(1.0) else Binary("*", factor, inner)


def _rank(monomial: int, space: Space) -> tuple[int, ...]:
    """Order of terms: higher powers of earlier names first."""
    powers = space.powers(monomial)
    return tuple(-powers.get(name, 0) for name in space.names)


def _term(coefficient: int, monomial: int, space: Space) -> Expression:
    """Give coefficient * monomial, coefficient above 0."""
    result: Expression | None = None if coefficient == 1 and monomial else Number(float(coefficient))
    powers = space.powers(monomial)
    for name in space.names:
        if name in powers:
            factor: Expression = Name(name)
            factor = factor if powers[name] == 1 else Binary("**", factor, Number(float(powers[name])))
            result = factor if result is None else Binary("*", result, factor)
    return Number(1.0) if result is None else result


def quotient_expression(value: Quotient, outer: Collection[str] = ()) -> Expression:
    """Give numerator / denominator as an expression."""
    sign, above = _signed(value.numerator, value.space, outer)
    sign_below, below = _signed(value.denominator, value.space, outer)
    result = above if below == Number(1.0) else Binary("/", above, below)
    return Negative(result) if sign * sign_below < 0 else result
