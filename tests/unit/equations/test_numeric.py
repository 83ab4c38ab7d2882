"""Values of expressions: exact where that is possible, nan where there is none."""

import math
from fractions import Fraction

import pytest

from faultbond.equations.numeric import Real, numeric_value, slopes, solve_linear, square_root
from faultbond.model.expression import Call, Name
from faultbond.model.parser import parse_expression

X: dict[str, Real] = {"x": Fraction(3)}
EXACT = {
    "x/3 + 1/3": Fraction(4, 3),
    "2**-2*x": Fraction(3, 4),
    "0.1*x": Fraction(3, 10),
    "sqrt(x/12)": Fraction(1, 2),
    "sqrt(4)/3": Fraction(2, 3),
    "abs(-x)*sign(-x)": Fraction(-3),
    "min(x, 5/2, 4) + max(x, 7/2)": Fraction(6),
    "where(x > 2, x**3, 1/0)": Fraction(27),
}


@pytest.mark.parametrize("text", EXACT)
def test_fractions_stay_fractions(text: str) -> None:
    """Arithmetic, whole powers, sizes, branches and roots of squares are exact."""
    found = numeric_value(parse_expression(text), X)
    assert found == EXACT[text]
    assert not isinstance(found, float)


@pytest.mark.parametrize("text", ["1/(x - 3)", "sqrt(-x)", "log(x - 3)", "(-x)**0.5", "exp(1000*x)"])
def test_no_real_value_is_nan(text: str) -> None:
    """What has no real value, or none that a number can hold, is nan; so are its slopes absent."""
    assert math.isnan(numeric_value(parse_expression(text), X))
    value, by = slopes(parse_expression(text), X, ["x"])
    assert math.isnan(value)
    assert by == {}


def test_slopes_are_exact_too() -> None:
    """The slope of a quotient of fractions is a fraction."""
    assert slopes(parse_expression("1/x"), X, ["x"]) == (Fraction(1, 3), {"x": Fraction(-1, 9)})
    assert slopes(parse_expression("x**3 - 2*x"), X, ["x"]) == (Fraction(21), {"x": Fraction(25)})


def test_only_wanted_slopes() -> None:
    """Names that are not asked for have no slope."""
    assert slopes(parse_expression("x*y"), {**X, "y": Fraction(2)}, ["y"])[1] == {"y": Fraction(3)}


def test_unknown_functions_are_nan() -> None:
    """Logic has no number."""
    assert math.isnan(numeric_value(Call("not", (Name("x"), Name("x"))), X))


def test_whole_numbers_in_a_system() -> None:
    """A system of whole numbers has fractions for a solution, and a singular one none."""
    assert solve_linear([{0: 3, 1: 1}, {0: 1, 1: -1}], [1, 1]) == [Fraction(1, 2), Fraction(-1, 2)]
    assert solve_linear([{0: 3, 1: 7}, {0: 1, 1: Fraction(7, 3)}], [1, 1]) is None
    assert solve_linear([{}], [1]) is None


def test_square_roots() -> None:
    """Squares of fractions have fractions for roots."""
    assert square_root(Fraction(9, 16)) == Fraction(3, 4)
    assert square_root(2) == math.sqrt(2.0)
