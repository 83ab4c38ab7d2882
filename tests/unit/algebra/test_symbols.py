"""Trees to sympy, common divisors, factors and real roots."""

from fractions import Fraction
from math import isclose

import numpy as np
import pytest
import sympy
from sympy.polys.rings import PolyElement

from faultbond.algebra.solving.polynomial import Ratio, divide, quotient, quotient_expression, space_of
from faultbond.algebra.solving.symbols import common_divisor, factors_with, lowest_terms, real_roots, to_sympy
from faultbond.equations.numeric import numeric_value
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Expression, Name
from faultbond.model.parser import parse_expression, to_text

SPACE = space_of(["x", "y", "z"])
VALUES = {"x": 1.7, "y": 0.6, "z": 2.3}
LAWS = [
    "x*y - z/x + 0.5*y**2",
    "sqrt(x)/y + x**-2",
    "-(x - y)*exp(-x)",
    "where(x > y, abs(z - x), min(x, y, z))",
    "max(x, 3)*sign(y - x)",
    "log(x) + tanh(y)/cos(z) - sin(x)*tan(y)",
    "x**0.5 - 2.41e11*y",
]


def polynomial(text: str) -> PolyElement:
    """The numerator of an expression."""
    return quotient(parse_expression(text), SPACE)[0]


@pytest.mark.parametrize("text", LAWS)
def test_same_value_in_sympy(text: str) -> None:
    """A law has the same value in sympy."""
    law = parse_expression(text)
    values = {sympy.Symbol(name, real=True): value for name, value in VALUES.items()}
    assert isclose(float(to_sympy(law).subs(values)), float(numeric_value(law, VALUES)), rel_tol=1e-12)


def test_numbers_are_decimals() -> None:
    """0.4 is two fifths, not the nearest binary fraction."""
    assert to_sympy(parse_expression("0.4*x")) == sympy.Rational(2, 5) * sympy.Symbol("x", real=True)


def test_names_are_never_read_as_text() -> None:
    """A name that would mean something to sympy's reader stays a name."""
    assert to_sympy(Name("pi")) == sympy.Symbol("pi", real=True) != sympy.pi
    assert not to_sympy(Name("armature.f_0")).is_number


def test_logic_is_refused() -> None:
    """What has no counterpart is named."""
    with pytest.raises(StructureError, match="logic"):
        to_sympy(Binary("&", Name("x"), Name("y")))


def test_common_divisor_of_products() -> None:
    """The divisor that was multiplied in is found, numbers and monomials included."""
    shared = polynomial("6*x*(x*y - z + 1)")
    found = common_divisor(shared * polynomial("x + y"), shared * polynomial("x*z - 2"), SPACE)
    assert found in (shared, -shared)


def test_common_divisor_agrees_with_sympy() -> None:
    """Random products have the divisor that sympy finds for their expressions."""
    rng = np.random.default_rng(1)
    for _ in range(10):
        a, b, c = (_random(rng) for _ in range(3))
        if not (a and b and c):
            continue
        one, two = a * c, b * c
        ours = _expanded(common_divisor(one, two, SPACE))
        theirs = sympy.gcd(_expanded(one), _expanded(two))
        assert sympy.expand(ours - theirs) == 0 or sympy.expand(ours + theirs) == 0


def _random(rng: np.random.Generator) -> PolyElement:
    """A polynomial of at most four terms."""
    result = SPACE.ring.zero
    for _ in range(4):
        powers = tuple(int(rng.integers(3)) for _ in SPACE.place)
        result += SPACE.ring.from_dict({powers: int(rng.integers(1, 5))}) * int(rng.choice([-1, 1]))
    return result


def written(value: PolyElement) -> Expression:
    """A polynomial as an expression."""
    return quotient_expression(Ratio(numerator=value, denominator=SPACE.ring.one, space=SPACE))


def _expanded(value: PolyElement) -> sympy.Expr:
    return sympy.expand(to_sympy(written(value)))


def test_lowest_terms() -> None:
    """A quotient loses what is common to both sides."""
    above, below = lowest_terms(polynomial("2*x*(x + y)**2"), polynomial("6*x*y*(x + y)"), SPACE)
    assert divide(polynomial("x + y"), above, SPACE) == 1
    assert below == polynomial("3*y")


def test_factors() -> None:
    """A product falls into the factors that hold the unknown."""
    product = polynomial("(x**2*y - z)*(x*z + y - 1)*(y - z)")
    found = {to_text(written(factor)) for factor in factors_with(product, "x", SPACE)}
    assert found == {"x**2*y - z", "x*z + y - 1"}


def test_irreducible_is_left_alone() -> None:
    """A polynomial without factors is given back as it is."""
    value = polynomial("x**3*y - x*z + y + 1")
    assert factors_with(value, "x", SPACE) == (value,)


def test_rational_roots_are_exact() -> None:
    """(3x - 1)(x + 2)(x^2 + 1)(x - 5): three real roots, as fractions."""
    space = space_of(["x"])
    product = quotient(parse_expression("(3*x - 1)*(x + 2)*(x**2 + 1)*(x - 5)"), space)[0]
    coefficients = [product.get((power,), 0) for power in range(5, -1, -1)]
    found = real_roots(coefficients)
    assert [round(root, 15) for root in found] == [Fraction(-2), round(Fraction(1, 3), 15), Fraction(5)]


def test_roots_of_quadratics() -> None:
    """Perfect squares give fractions, others the root to many digits, negative discriminants none, double roots one."""
    assert real_roots([6, -5, 1]) == (Fraction(1, 3), Fraction(1, 2))
    assert abs(real_roots([1, 0, -2])[1] ** 2 - 2) < Fraction(1, 10**20)
    assert real_roots([1, 0, 2]) == ()
    assert real_roots([1, -2, 1]) == (Fraction(1),)


def test_names_are_no_ranges() -> None:
    """A name that sympy's reader would take for several stays one."""
    space = space_of(["x:3", "a b"])
    assert quotient(Binary("*", Name("x:3"), Name("a b")), space)[0] == space.ring.gens[0] * space.ring.gens[1]
