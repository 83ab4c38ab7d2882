"""Our expressions as those of sympy, our polynomials there and back. No text is ever read: trees become trees.

sympy finds common divisors and factors of polynomials in many names; both are asked for small ones only.
"""

from collections.abc import Callable, Sequence
from fractions import Fraction
from functools import lru_cache
from math import gcd as whole_gcd
from math import isqrt
from random import Random
from typing import Any

import sympy
from sympy.polys.domains import ZZ
from sympy.polys.rings import PolyElement, PolyRing
from sympy.polys.rootisolation import dup_isolate_real_roots_sqf
from sympy.polys.sqfreetools import dup_sqf_part

from faultbond.algebra.solving.polynomial import (
    Polynomial,
    Space,
    common_monomial,
    degree,
    divide,
    multiply,
    primitive,
    uses,
)
from faultbond.equations.numeric import exact
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number

_FUNCTIONS: dict[str, Callable[..., Any]] = {
    "abs": sympy.Abs,
    "sign": sympy.sign,
    "sqrt": sympy.sqrt,
    "exp": sympy.exp,
    "log": sympy.log,
    "sin": sympy.sin,
    "cos": sympy.cos,
    "tan": sympy.tan,
    "tanh": sympy.tanh,
    "min": sympy.Min,
    "max": sympy.Max,
}
_COMPARISONS = {"<": sympy.Lt, "<=": sympy.Le, ">": sympy.Gt, ">=": sympy.Ge}
MAX_GCD_TERMS = 400
MAX_FACTOR_TERMS = 100
PRIME = 2**61 - 1
_PROBES = 3
_ROOT_BITS = 70


def to_sympy(expression: Expression) -> sympy.Expr:
    """Give an expression of sympy, all names real symbols, numbers as the decimals that they are."""
    match expression:
        case Number(value):
            number = exact(value)
            return sympy.Rational(number.numerator, number.denominator)
        case Name(text):
            return sympy.Symbol(text, real=True)
        case Negative(operand):
            return -to_sympy(operand)
        case Binary(operator, left, right) if operator in _COMPARISONS:
            return _COMPARISONS[operator](to_sympy(left), to_sympy(right))
        case Binary(operator, left, right):
            return _arithmetic(operator, to_sympy(left), to_sympy(right))
        case Call("where", (condition, yes, no)):
            return sympy.Piecewise((to_sympy(yes), to_sympy(condition)), (to_sympy(no), True))
        case Call(function, arguments) if function in _FUNCTIONS:
            return _FUNCTIONS[function](*map(to_sympy, arguments))
    raise StructureError(f"{expression} has no counterpart among real expressions; logic is not solved for")


def _arithmetic(operator: str, left: sympy.Expr, right: sympy.Expr) -> sympy.Expr:
    match operator:
        case "+":
            return left + right
        case "-":
            return left - right
        case "*":
            return left * right
        case "/":
            return left / right
        case "**":
            return left**right
    raise StructureError(f"the operator {operator} is not solved for; logic belongs to static networks")


@lru_cache(maxsize=64)
def _ring(names: tuple[str, ...]) -> PolyRing:
    return PolyRing(names, ZZ)


def _element(polynomial: Polynomial, space: Space, names: tuple[str, ...]) -> PolyElement:
    ring = _ring(names)
    shifts = [space.shifts[name] for name in names]
    return ring.from_dict(
        {tuple(monomial >> shift & 0xFFF for shift in shifts): value for monomial, value in polynomial.items()}
    )


def _polynomial(element: PolyElement, space: Space, names: tuple[str, ...]) -> Polynomial:
    shifts = [space.shifts[name] for name in names]
    return {
        sum(power << shift for power, shift in zip(powers, shifts, strict=True)): int(value)
        for powers, value in element.items()
    }


def _used(polynomials: tuple[Polynomial, ...], space: Space) -> tuple[str, ...]:
    return tuple(name for name in space.names if any(uses(item, space.mask([name])) for item in polynomials))


def common_divisor(one: Polynomial, two: Polynomial, space: Space) -> Polynomial:
    """Give the greatest common divisor of two polynomials that are not zero.

    Of polynomials with more than `MAX_GCD_TERMS` terms only common numbers and monomials are found.
    """
    shared = common_monomial({**one, **two}, space)
    left = primitive({monomial - shared: value for monomial, value in one.items()}, space, 0)
    right = primitive({monomial - shared: value for monomial, value in two.items()}, space, 0)
    factor = {shared: whole_gcd(*one.values(), *two.values())}
    names = _used((left, right), space)
    if min(len(left), len(right)) == 1 or len(left) + len(right) > MAX_GCD_TERMS or _coprime(left, right, space, names):
        return factor
    found = _element(left, space, names).gcd(_element(right, space, names))
    return multiply(factor, _polynomial(found, space, names), space)


def _coprime(one: Polynomial, two: Polynomial, space: Space, names: tuple[str, ...]) -> bool:
    """Whether two polynomials have no common divisor, by the degree of that of their images in each name.

    Random numbers modulo a prime stand for the other names, so that a common divisor could hide with a probability of
    about degree / prime only; what is said to have one is looked at closely.
    """
    rng = Random(0)  # noqa: S311 - probes, no secret
    values = {name: rng.randrange(2, PRIME) for name in names}
    for name in names:
        images = [_image(polynomial, name, values, space) for polynomial in (one, two)]
        if all(len(image) > 1 for image in images) and _common_degree(*images):
            return False
    return True


def _image(polynomial: Polynomial, name: str, values: dict[str, int], space: Space) -> list[int]:
    """Give the coefficients in one name modulo the prime, the highest first."""
    sums: dict[int, int] = {}
    for monomial, coefficient in polynomial.items():
        power, total = 0, coefficient
        for other, exponent in space.powers(monomial).items():
            if other == name:
                power = exponent
            else:
                total = total * pow(values[other], exponent, PRIME) % PRIME
        sums[power] = (sums.get(power, 0) + total) % PRIME
    return _trimmed([sums.get(power, 0) for power in range(max(sums), -1, -1)])


def _trimmed(coefficients: list[int]) -> list[int]:
    start = next((k for k, value in enumerate(coefficients) if value), len(coefficients))
    return coefficients[start:]


def _common_degree(one: list[int], two: list[int]) -> int:
    """Give the degree of the greatest common divisor, by Euclid modulo the prime."""
    while two:
        if len(one) < len(two):
            one, two = two, one
        factor = one[0] * pow(two[0], -1, PRIME)
        padded = two + [0] * (len(one) - len(two))
        one = _trimmed([(a - factor * b) % PRIME for a, b in zip(one, padded, strict=True)])
        one, two = (two, one) if len(one) < len(two) else (one, two)
    return len(one) - 1


def factors(polynomial: Polynomial, name: str, space: Space) -> tuple[Polynomial, ...]:
    """Give the factors in which a name occurs, each once; the polynomial itself where none are found.

    Numbers in place of the other names tell first whether there can be any: an irreducible image has no factors, and
    almost every image of an irreducible polynomial is irreducible (Hilbert).
    """
    names = _used((polynomial,), space)
    if len(polynomial) > MAX_FACTOR_TERMS or not all(_splits(polynomial, name, space, seed) for seed in range(_PROBES)):
        return (polynomial,)
    _, parts = _element(polynomial, space, names).factor_list()
    found = [_polynomial(part, space, names) for part, _ in parts]
    return tuple(part for part in found if degree(part, name, space))


def _splits(polynomial: Polynomial, name: str, space: Space, seed: int) -> bool:
    rng = Random(seed)  # noqa: S311 - probes, no secret
    values = {other: rng.randint(2, 99) for other in space.names if other != name}
    sums: dict[int, int] = {}
    for monomial, coefficient in polynomial.items():
        total, power = coefficient, 0
        for other, exponent in space.powers(monomial).items():
            if other == name:
                power = exponent
            else:
                total *= values[other] ** exponent
        sums[power] = sums.get(power, 0) + total
    image = _ring((name,)).from_dict({(power,): value for power, value in sums.items() if value})
    _, parts = image.factor_list()
    return len(parts) > 1 or any(count > 1 for _, count in parts)


def lowest_terms(above: Polynomial, below: Polynomial, space: Space) -> tuple[Polynomial, Polynomial]:
    """Give a quotient without common divisors."""
    if not above:
        return above, {0: 1}
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
    whole = _trimmed(list(coefficients))
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
