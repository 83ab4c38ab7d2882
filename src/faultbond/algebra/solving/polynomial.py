"""Sparse polynomials with whole coefficients in many names, and laws as quotients of them, there and back.

The arithmetic is that of sympy's rings; a polynomial is a mapping from monomials, a tuple of powers each, to
coefficients. Names become symbols as they are: no text is ever read.
"""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from heapq import heapify, heappop, heappush
from math import gcd, lcm, prod
from operator import neg, sub
from typing import TypeVar

import sympy
from sympy.polys.domains import ZZ
from sympy.polys.rings import PolyElement, PolyRing

from faultbond.equations.numeric import exact
from faultbond.model.expression import Binary, Expression, Name, Negative, Number

Powers = tuple[int, ...]  # a monomial, in the order of the names of a space
N = TypeVar("N", int, Fraction)

_MAX_EXPONENT = 16
_LONG = 100


class TooLargeError(Exception):
    """An expression outgrew its limit."""


class NotRationalError(Exception):
    """The expression is no quotient of polynomials."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Space:
    """The names of a set of polynomials with their places in a monomial, and the limit on the terms of one."""

    place: Mapping[str, int]
    ring: PolyRing
    max_terms: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Ratio:
    """numerator / denominator, in the names of a space."""

    numerator: PolyElement
    denominator: PolyElement
    space: Space


def space_of(names: Collection[str], max_terms: int = 20_000) -> Space:
    """Give the space of polynomials in some names."""
    ring = PolyRing([sympy.Symbol(name) for name in names], ZZ)
    return Space(place={name: k for k, name in enumerate(names)}, ring=ring, max_terms=max_terms)


def limited_product(left: PolyElement, right: PolyElement, space: Space) -> PolyElement:
    """Give left * right.

    Raises
    ------
    TooLargeError
        Where the product has too many terms; before the work, where it is not worth it.
    """
    if len(left) * len(right) > 20 * space.max_terms:
        raise TooLargeError
    result = left * right
    if len(result) > space.max_terms:
        raise TooLargeError
    return result


def limited_power(base: PolyElement, exponent: int, space: Space) -> PolyElement:
    """Give base ** exponent, exponent 0 or above, within the limits of `limited_product`."""
    result = space.ring.one
    for _ in range(exponent):
        result = limited_product(result, base, space)
    return result


def by_power(polynomial: PolyElement, name: str, space: Space) -> dict[int, PolyElement]:
    """Give the coefficients of a polynomial in one name: power -> polynomial in the others."""
    k = space.place[name]
    found: dict[int, dict[Powers, int]] = {}
    for powers, coefficient in polynomial.items():
        found.setdefault(powers[k], {})[*powers[:k], 0, *powers[k + 1 :]] = coefficient
    return {power: polynomial.new(terms) for power, terms in found.items()}


def degree(polynomial: PolyElement, name: str, space: Space) -> int:
    """Give the highest power of a name."""
    k = space.place[name]
    return max((powers[k] for powers in polynomial), default=0)


def common_monomial(polynomial: Collection[Powers], places: Iterable[int]) -> Powers:
    """Give the largest monomial with powers at some places that divides every term, of which there is one at least."""
    shared = list(places)
    for powers in polynomial:
        shared = [k for k in shared if powers[k]]
        if not shared:
            break
    return tuple(min(powers[k] for powers in polynomial) if k in shared else 0 for k in range(len(powers)))


def primitive(polynomial: PolyElement, space: Space, names: Iterable[str] = ()) -> PolyElement:
    """Give the polynomial without its whole content and its common monomial in some names."""
    if not polynomial:
        return polynomial
    content = gcd(*polynomial.values())
    common = common_monomial(polynomial, (space.place[name] for name in names))
    if content == 1 and not any(common):
        return polynomial
    return polynomial.new({tuple(map(sub, powers, common)): c // content for powers, c in polynomial.items()})


def divide(polynomial: PolyElement, divisor: PolyElement, space: Space) -> PolyElement | None:
    """Give polynomial / divisor where that leaves nothing over; None else, at the first term that does not divide.

    (sympy's `div` goes on to the rest, and looks for the leading term anew at every step.)
    """
    ring = space.ring
    lead = max(divisor)
    rest = [(powers, coefficient) for powers, coefficient in divisor.items() if powers != lead]
    work = dict(polynomial)
    queue = [tuple(map(neg, powers)) for powers in work]  # the leading one first
    heapify(queue)
    result: dict[Powers, int] = {}
    while queue:
        powers = tuple(map(neg, heappop(queue)))
        coefficient = work.pop(powers, 0)
        if not coefficient:
            continue
        quotient_, over = divmod(coefficient, divisor[lead])
        key = ring.monomial_div(powers, lead)
        if over or key is None or len(result) > space.max_terms:
            return None
        result[key] = quotient_
        for other, factor in rest:
            target = ring.monomial_mul(key, other)
            if target not in work:
                heappush(queue, tuple(map(neg, target)))
            work[target] = work.get(target, 0) - quotient_ * factor
    return polynomial.new(result)


def image(polynomial: PolyElement, space: Space, values: Mapping[str, N]) -> dict[Powers, N]:
    """Give a polynomial with numbers for some names: powers of the other names, in their order, -> coefficient."""
    given = [(k, values[name]) for name, k in space.place.items() if name in values]
    kept = [k for name, k in space.place.items() if name not in values]
    sums: dict[Powers, N] = {}
    for powers, coefficient in polynomial.items():
        total = prod((value ** powers[k] for k, value in given if powers[k]), start=int(coefficient))
        key = tuple(powers[k] for k in kept)
        sums[key] = sums.get(key, 0) + total
    return sums


def specialise(polynomial: PolyElement, space: Space, values: Mapping[str, Fraction], into: Space) -> PolyElement:
    """Give a polynomial with numbers for some names, times what makes its coefficients whole and coprime.

    Parameters
    ----------
    polynomial, space : with all names
    values : numbers for some of them
    into : the space of the names that are left, in the same order
    """
    sums = image(polynomial, space, values)
    below = lcm(*(int(total.denominator) for total in sums.values()))
    return primitive(into.ring.from_dict({key: int(total * below) for key, total in sums.items()}), into)


def quotient(expression: Expression, space: Space) -> tuple[PolyElement, PolyElement]:
    """Give numerator and denominator of an expression; numbers count as the decimals that they are.

    Raises
    ------
    NotRationalError
        Where the expression uses functions, or powers that are not whole numbers.
    """
    one = space.ring.one
    match expression:
        case Number(value):
            number = exact(value)
            return one * number.numerator, one * number.denominator
        case Name(text):
            return space.ring.gens[space.place[text]], one
        case Negative(operand):
            above, below = quotient(operand, space)
            return -above, below
        case Binary("**", base, (Number(value) | Negative(Number(value))) as exponent):
            if value != int(value) or value > _MAX_EXPONENT:
                raise NotRationalError
            above, below = quotient(base, space)
            power = -int(value) if isinstance(exponent, Negative) else int(value)
            above, below = (above, below) if power >= 0 else (below, above)
            return limited_power(above, abs(power), space), limited_power(below, abs(power), space)
        case Binary("+" | "-" | "*" | "/" as operator, left, right):
            (above, below), (above_2, below_2) = quotient(left, space), quotient(right, space)
            if operator == "/":
                above_2, below_2 = below_2, above_2
            if operator in "*/":
                return limited_product(above, above_2, space), limited_product(below, below_2, space)
            above_2 = above_2 if operator == "+" else -above_2
            if below == below_2:
                return above + above_2, below
            total = limited_product(above, below_2, space) + limited_product(above_2, below, space)
            return total, limited_product(below, below_2, space)
    raise NotRationalError


def quotient_expression(value: Ratio, outer: Collection[str] = ()) -> Expression:
    """Give a ratio as an expression in a fixed order: common factors first, then grouped by the outer names.

    Example: `J dt omega_0 - J dt omega_1` with the outer names J and dt becomes `J*dt*(omega_0 - omega_1)`.
    """
    names = tuple(value.space.place)
    places = frozenset(k for name, k in value.space.place.items() if name in outer)
    sign, above = _signed(value.numerator, names, places)
    sign_below, below = _signed(value.denominator, names, places)
    result = above if below == Number(1.0) else Binary("/", above, below)
    return Negative(result) if sign * sign_below < 0 else result


def _signed(polynomial: Mapping[Powers, int], names: Sequence[str], outer: frozenset[int]) -> tuple[int, Expression]:
    """Give the sign of an expression and the rest of it; the sign is negative where all terms are."""
    if not polynomial:
        return 1, Number(0.0)
    sign = -1 if all(coefficient < 0 for coefficient in polynomial.values()) else 1
    content = sign * gcd(*polynomial.values())
    common = common_monomial(polynomial, range(len(names)))
    inner = {tuple(map(sub, powers, common)): coefficient // content for powers, coefficient in polynomial.items()}
    if len(inner) == 1:
        return sign, _term(abs(content), common, names)
    body = _sum(inner, names, outer)
    if not any(common) and abs(content) == 1:
        return sign, body
    return sign, Binary("*", _term(abs(content), common, names), body)


def _sum(polynomial: Mapping[Powers, int], names: Sequence[str], outer: frozenset[int]) -> Expression:
    """Give a sum of two or more terms, higher powers of earlier names first, unless one that is added must begin."""
    groups: dict[Powers, dict[Powers, int]] = {}
    for powers, coefficient in sorted(polynomial.items(), reverse=True):
        key = tuple(power if k in outer else 0 for k, power in enumerate(powers))
        groups.setdefault(key, {})[tuple(map(sub, powers, key))] = coefficient
    ordered: list[tuple[int, Expression]] = []
    if len(groups) == 1:
        ordered = [_signed({powers: c}, names, frozenset()) for powers, c in sorted(polynomial.items(), reverse=True)]
    else:
        for key in sorted(groups, reverse=True):
            sign, inner = _signed(groups[key], names, frozenset())
            if any(key):
                factor = _term(1, key, names)
                inner = factor if inner == Number(1.0) else Binary("*", factor, inner)
            ordered.append((sign, inner))
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


def _term(coefficient: int, powers: Powers, names: Sequence[str]) -> Expression:
    """Give coefficient * monomial, coefficient above 0."""
    result: Expression | None = None if coefficient == 1 and any(powers) else Number(float(coefficient))
    for name, power in zip(names, powers, strict=True):
        if power:
            factor: Expression = Name(name) if power == 1 else Binary("**", Name(name), Number(float(power)))
            result = factor if result is None else Binary("*", result, factor)
    return Number(1.0) if result is None else result
