"""Elimination: pivots without unknowns first, no degree raised in vain, nothing lost."""

from fractions import Fraction
from itertools import combinations
from time import thread_time

import pytest
from solved import example, route_to
from sympy.polys.rings import PolyElement

from faultbond.algebra.solving.elimination import ReducedSystem, SingularError, reduce_system
from faultbond.algebra.solving.polynomial import Space, TooLargeError, by_power, degree, image, quotient, space_of
from faultbond.algebra.solving.problem import Block, prepare
from faultbond.model.expression import names
from faultbond.model.parser import parse_expression

DEGREES: dict[tuple[str, ...], int] = {("R",): 1, ("L",): 1, ("J",): 1, ("C",): 1, ("K",): 2}
DEGREES |= {pair: 1 if pair in {("R", "L"), ("J", "C")} else 2 for pair in combinations("RLJCK", 2)}


def reduce(
    texts: list[str], signals: str, parameters: str = "", known: str = "a b c", max_terms: int = 2000
) -> tuple[ReducedSystem, Space]:
    """Eliminate from equations given as text."""
    space = space_of([*known.split(), *signals.split(), *parameters.split()], max_terms)
    polynomials = [quotient(parse_expression(text), space)[0] for text in texts]
    return reduce_system(polynomials, signals.split(), parameters.split(), space), space


def value(polynomial: PolyElement, space: Space, values: dict[str, Fraction]) -> Fraction:
    """The value of a polynomial."""
    return sum(image(polynomial, space, values).values(), Fraction(0))


def test_linear_equations() -> None:
    """Two linear equations leave nothing over, and the pivots compute the solution backwards."""
    reduced, space = reduce(["a*x + y - 3", "x - b*y"], "x y")
    assert reduced.rest == ()
    values = {"a": Fraction(2), "b": Fraction(5), "c": Fraction(1)}
    for pivot in reversed(reduced.pivots):
        values[pivot.unknown] = value(pivot.numerator, space, values) / value(pivot.denominator, space, values)
    assert 2 * values["x"] + values["y"] == 3
    assert values["x"] == 5 * values["y"]


def test_clean_pivots_come_first() -> None:
    """A signal is taken from where its coefficient is known, not from where it is multiplied by an unknown."""
    reduced, _ = reduce(["P*x - y", "y - a*x - b", "z - P*y", "z - c"], "x y z", "P")
    assert [pivot.clean for pivot in reduced.pivots][:2] == [True, True]


def test_division_by_an_unknown_adds_no_root() -> None:
    """P x = a, P^2 x + P y = b, y = c has one solution P = (b - a P)/c: the root P = 0 of the division is gone."""
    reduced, space = reduce(["P*x - a", "P**2*x + P*y - b", "y - c"], "x y", "P")
    assert reduced.rest == ()
    (pivot,) = (pivot for pivot in reduced.pivots if pivot.unknown == "P")
    assert degree(pivot.numerator, "P", space) == 0


@pytest.mark.parametrize("suspects", sorted(DEGREES), ids="".join)
def test_degrees_of_the_motor(suspects: tuple[str, ...]) -> None:
    """The polynomials that the motor's fifteen hypotheses leave have degree 1 or 2, as was computed independently."""
    network, plant = example("dc_motor")
    problem = prepare(network, route_to(network, *suspects), plant)
    degrees = [_degree_of(block) for block in problem.blocks]
    assert max(degrees) == DEGREES[suspects]


def _degree_of(block: Block) -> int:
    from_block = {name for residual in block.residuals for name in names(residual)}
    space = space_of(sorted(from_block | set(block.unknown)))
    polynomials = [quotient(residual, space)[0] for residual in block.residuals]
    signals = [name for name in block.unknown if name not in block.parameters]
    reduced = reduce_system(polynomials, signals, sorted(block.parameters), space)
    if not reduced.rest:
        return 1
    (name,), (polynomial,) = reduced.unknown, reduced.rest
    powers = by_power(polynomial, name, space)
    return max(powers) - min(powers)


def test_equations_without_linear_unknown() -> None:
    """x^2 + y^2 = a and x^2 - x y = b are reduced by one another to a polynomial in one unknown."""
    reduced, space = reduce(["x**2 + y**2 - 25", "x**2 - x*y + 3"], "x y")
    assert len(reduced.rest) == len(reduced.unknown) == 1
    values = {"x": Fraction(3), "y": Fraction(4)}
    values |= dict.fromkeys("abc", Fraction(0))
    assert value(reduced.rest[0], space, values) == 0


def test_contradiction() -> None:
    """Equations that contradict each other are refused."""
    with pytest.raises(SingularError, match="contradict"):
        reduce(["x + y - a", "x + y - b"], "x y")


def test_dependence() -> None:
    """Equations of which one follows from the others are refused."""
    with pytest.raises(SingularError, match="follows"):
        reduce(["x + y - a", "2*x + 2*y - 2*a"], "x y")


def test_growth_is_bounded() -> None:
    """An expression that outgrows its limit ends the elimination, at once."""
    sums = [f"x{k}*(a + b + c + {k})**3 - x{k + 1}*(a*b + c*a + b)**3 - {k}" for k in range(6)]
    unknown = " ".join(f"x{k}" for k in range(7))
    with pytest.raises(TooLargeError):
        reduce([*sums, "x6 - x0*(a - b)**3 - c"], unknown, max_terms=300)


def test_deadline() -> None:
    """Elimination stops when its time is up."""
    space = space_of(["a", "x", "y"])
    polynomials = [quotient(parse_expression(text), space)[0] for text in ("x - a*y", "x + y - 1")]
    with pytest.raises(TooLargeError):
        reduce_system(polynomials, ["x", "y"], [], space, thread_time() - 1.0)


def test_order_of_equations_does_not_matter() -> None:
    """The polynomial that is left is the same, up to its sign, whatever the order of the equations."""
    texts = ["P*x - y", "y*P - a*x - b", "x - c*P"]
    rests = []
    for order in ([0, 1, 2], [2, 0, 1], [1, 2, 0]):
        reduced, _ = reduce([texts[k] for k in order], "x y", "P")
        (rest,) = reduced.rest
        rests.append(rest if rest[max(rest)] > 0 else {key: -value_ for key, value_ in rest.items()})
    assert rests[0] == rests[1] == rests[2]
