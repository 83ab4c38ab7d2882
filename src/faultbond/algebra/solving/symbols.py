"""What sympy knows of polynomials in many names: common divisors, factors, real roots; and laws as its expressions.

No text is ever read: trees become trees. Divisors and factors are asked for of small polynomials only.
"""

import operator as op
from collections.abc import Callable, Mapping, Sequence
from fractions import Fraction
from math import gcd as whole_gcd
from math import isqrt
from random import Random
from typing import Any

import sympy
from sympy.polys.densebasic import dup_strip
from sympy.polys.domains import ZZ
from sympy.polys.factortools import dup_factor_list
from sympy.polys.galoistools import gf_gcd, gf_trunc
from sympy.polys.rings import PolyElement, PolyRing
from sympy.polys.rootisolation import dup_isolate_real_roots_sqf
from sympy.polys.sqfreetools import dup_sqf_part

from faultbond.algebra.solving.polynomial import (
    Powers,
    Space,
    common_monomial,
    degree,
    divide,
    image,
    limited_product,
    primitive,
)
from faultbond.equations.numeric import exact
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": sympy.Abs,
    "min": sympy.Min,
    "max": sympy.Max,
    **{name: getattr(sympy, name) for name in ("sign", "sqrt", "exp", "log", "sin", "cos", "tan", "tanh")},
}
_OPERATORS: dict[str, Callable[..., Any]] = {
    **{"+": op.add, "-": op.sub, "*": op.mul, "/": op.truediv, "**": op.pow},
    **{"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge},
}
MAX_GCD_TERMS = 400
MAX_FACTOR_TERMS = 100
PRIME = 2**61 - 1
_PROBES = 3
_ROOT_BITS = 70


def to_sympy(expression: Expression) -> sympy.Expr:
    """Give an expression of sympy, all names real symbols, numbers as the decimals that they are.

    Raises
    ------
    StructureError
        Where the expression is logic.
    """
    match expression:
        case Number(value):
            number = exact(value)
            return sympy.Rational(number.numerator, number.denominator)
        case Name(text):
            return sympy.Symbol(text, real=True)
        case Negative(operand):
            return -to_sympy(operand)
        case Binary(operator, left, right) if operator in _OPERATORS:
            return _OPERATORS[operator](to_sympy(left), to_sympy(right))
        case Call("where", (condition, yes, no)):
            return sympy.Piecewise((to_sympy(yes), to_sympy(condition)), (to_sympy(no), True))
        case Call(function, arguments) if function in _FUNCTIONS:
            return _FUNCTIONS[function](*map(to_sympy, arguments))
    raise StructureError(f"{expression} has no counterpart among real expressions; logic is not solved for")


def _within(polynomials: Sequence[PolyElement]) -> tuple[list[PolyElement], tuple[int, ...]]:
    """Give polynomials in a ring of the names that they use, and the places of these in theirs."""
    ring = polynomials[0].ring
    used = tuple(k for k in range(ring.ngens) if any(powers[k] for item in polynomials for powers in item))
    smaller = PolyRing([ring.symbols[k] for k in used], ZZ)
    return [
        smaller.from_dict({tuple(powers[k] for k in used): value for powers, value in item.items()})
        for item in polynomials
    ], used


def common_divisor(one: PolyElement, two: PolyElement, space: Space) -> PolyElement:
    """Give the greatest common divisor of two polynomials that are not zero.

    Of polynomials with more than `MAX_GCD_TERMS` terms only common numbers and monomials are found.
    """
    shared = common_monomial([*one, *two], range(space.ring.ngens))
    factor = one.new({shared: whole_gcd(*one.values(), *two.values())})
    left, right = (
        primitive(item.new({tuple(map(op.sub, powers, shared)): value for powers, value in item.items()}), space)
        for item in (one, two)
    )
    if min(len(left), len(right)) == 1 or len(left) + len(right) > MAX_GCD_TERMS or _coprime(left, right, space):
        return factor
    (left, right), _ = _within((left, right))
    return limited_product(factor, left.gcd(right).set_ring(space.ring), space)


def _coprime(one: PolyElement, two: PolyElement, space: Space) -> bool:
    """Whether two polynomials have no common divisor, by the degree of that of their images in each name.

    Random numbers modulo a prime stand for the other names, so that a common divisor could hide with a probability of
    about degree / prime only; what is said to have one is looked at closely.
    """
    rng = Random(0)  # noqa: S311 - probes, no secret
    names = [name for name, k in space.place.items() if any(powers[k] for item in (one, two) for powers in item)]
    values = {name: rng.randrange(2, PRIME) for name in names}
    values |= {name: 0 for name in space.place if name not in values}
    for name in names:
        others = {other: value for other, value in values.items() if other != name}
        images = [gf_trunc(_dense(image(item, space, others)), PRIME) for item in (one, two)]
        if all(len(item) > 1 for item in images) and len(gf_gcd(*images, PRIME, ZZ)) > 1:
            return False
    return True


def _dense(coefficients: Mapping[Powers, int]) -> list[int]:
    """Give the coefficients in one name, the highest first."""
    return [coefficients.get((power,), 0) for power in range(max(coefficients)[0], -1, -1)]


def factors_with(polynomial: PolyElement, name: str, space: Space) -> tuple[PolyElement, ...]:
    """Give the factors in which a name occurs, each once; the polynomial itself where none are found.

    Numbers in place of the other names tell first whether there can be any: an irreducible image has no factors, and
    almost every image of an irreducible polynomial is irreducible (Hilbert).
    """
    if len(polynomial) > MAX_FACTOR_TERMS:
        return (polynomial,)
    for seed in range(_PROBES):
        rng = Random(seed)  # noqa: S311 - probes, no secret
        numbers = {other: rng.randint(2, 99) for other in space.place if other != name}
        _, parts = dup_factor_list(dup_strip(_dense(image(polynomial, space, numbers))), ZZ)
        if len(parts) < 2 and all(count == 1 for _, count in parts):
            return (polynomial,)
    ((inner,), _) = _within((polynomial,))
    found = [part.set_ring(space.ring) for part, _ in inner.factor_list()[1]]
    return tuple(part for part in found if degree(part, name, space))


def lowest_terms(above: PolyElement, below: PolyElement, space: Space) -> tuple[PolyElement, PolyElement]:
    """Give a quotient without common divisors."""
    if not above:
        return above, space.ring.one
    shared = common_divisor(above, below, space)
    reduced = divide(above, shared, space), divide(below, shared, space)
    if reduced[0] is None or reduced[1] is None:
        return above, below
    return reduced[0], reduced[1]


def real_roots(coefficients: Sequence[int]) -> tuple[Fraction, ...]:
    """Give the different real roots of a polynomial in ascending order, exact where they are rational and it is easy.

    Others are good to about 70 binary digits of their size. Source: isolation by continued fractions, as sympy has it
    (Akritas and Strzebonski 2005), then bisection.

    Parameters
    ----------
    coefficients : the highest power first; not all zero
    """
    whole = dup_strip(list(coefficients))
    if len(whole) < 2:
        return ()
    if len(whole) == 2:
        return (Fraction(-whole[1], whole[0]),)
    if len(whole) == 3:
        return _quadratic_roots(*whole)
    square_free = dup_sqf_part(whole, ZZ)
    intervals = dup_isolate_real_roots_sqf(square_free, ZZ)
    plain = [int(value) for value in square_free]
    return tuple(_bisected(plain, _fraction(lower), _fraction(upper)) for lower, upper in intervals)


def _fraction(value: Any) -> Fraction:
    return Fraction(int(value.numerator), int(value.denominator))


def _quadratic_roots(a: int, b: int, c: int) -> tuple[Fraction, ...]:
    inside = b * b - 4 * a * c
    if inside < 0:
        return ()
    shift = 2 * max(0, 80 - inside.bit_length() // 2)
    root = Fraction(isqrt(inside << shift), 1 << shift // 2)
    return tuple(sorted({(-b - root) / (2 * a), (-b + root) / (2 * a)}))


def _bisected(coefficients: list[int], lower: Fraction, upper: Fraction) -> Fraction:
    def value(x: Fraction) -> int:
        total, above, below = 0, x.numerator, x.denominator
        scale_ = 1
        for coefficient in coefficients:
            total = total * above + coefficient * scale_
            scale_ *= below
        return total

    if lower == upper or not value(lower):
        return lower
    if not value(upper):
        return upper
    rising = value(upper) > 0
    for _ in range(400):
        middle = (lower + upper) / 2
        if upper - lower <= abs(middle) / 2**_ROOT_BITS:
            break
        here = value(middle)
        if not here:
            return middle
        lower, upper = (lower, middle) if (here > 0) == rising else (middle, upper)
    return (lower + upper) / 2
