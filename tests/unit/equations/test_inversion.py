"""Closed forms: put back into their relation they give zero, and they are the root that is meant."""

import math
from collections.abc import Callable
from functools import reduce
from operator import add, mul, sub, truediv

import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from faultbond.equations.inversion import isolate, linear_solution, terms
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number
from faultbond.model.parser import parse_expression, to_text

COEFFICIENTS = ("a", "b", "c", "d")
Values = dict[str, float]

quick = settings(max_examples=150, deadline=None)
sizes = st.floats(0.1, 10.0)
signed = st.builds(lambda size, sign: size * sign, sizes, st.sampled_from([1.0, -1.0]))
values_of = st.fixed_dictionaries(dict.fromkeys(COEFFICIENTS, signed))


def value(expression: Expression, given_: Values) -> float:
    """Plain value of an expression, roots by the textbook."""
    match expression:
        case Number(number):
            return number
        case Name(text):
            return given_[text]
        case Negative(operand):
            return -value(operand, given_)
        case Binary(operator, left, right):
            one, two = value(left, given_), value(right, given_)
            return OPERATORS[operator](one, two)
        case Call(function, arguments):
            parts = [value(argument, given_) for argument in arguments]
            return FUNCTIONS[function](*parts)
    raise AssertionError(expression)


def signed_root(a: float, b: float, c: float) -> float:
    """The root of a z|z| + b z + c = 0 on the side where the sum changes its sign; a and b of one sign."""
    side = -math.copysign(1.0, c * a)
    return side * (-abs(b) + math.sqrt(b * b + 4.0 * abs(a) * abs(c))) / (2.0 * abs(a))


def upper_root(a: float, b: float, c: float) -> float:
    """The larger root of a z^2 + b z + c = 0."""
    return max((-b + side * math.sqrt(max(b * b - 4.0 * a * c, 0.0))) / (2.0 * a) for side in (1.0, -1.0))


OPERATORS: dict[str, Callable[[float, float], float]] = {
    "+": add,
    "-": sub,
    "*": mul,
    "/": truediv,
    "**": math.pow,
}
FUNCTIONS: dict[str, Callable[..., float]] = {
    "signed_root": signed_root,
    "upper_root": upper_root,
    "abs": abs,
    "sign": lambda x: math.copysign(1.0, x),
    "exp": math.exp,
    "log": math.log,
    "sqrt": math.sqrt,
}

constants = st.recursive(
    st.sampled_from(COEFFICIENTS).map(Name) | sizes.map(Number),
    lambda inner: st.builds(Binary, st.sampled_from("+-*/"), inner, inner) | inner.map(Negative),
    max_leaves=3,
)


def lines(signal: Expression) -> st.SearchStrategy[Expression]:
    """Random expressions that are linear in `signal`, written in all ways."""
    return st.recursive(
        st.just(signal) | constants,
        lambda inner: st.one_of(
            st.builds(Binary, st.sampled_from("+-"), inner, inner),
            st.builds(lambda one, two: Binary("*", one, two), constants, inner),
            st.builds(lambda one, two: Binary("*", two, one), constants, inner),
            st.builds(lambda one, two: Binary("/", two, one), constants, inner),
            inner.map(Negative),
        ),
        max_leaves=8,
    )


def scale_of(residual: Expression, given_: Values) -> float:
    """Size of the terms of a residual: what rounding is measured against."""
    return sum(abs(value(term, given_)) for term in terms(residual)) + 1e-9


@given(lines(Name("z")), values_of)
@quick
def test_linear_relation(residual: Expression, values: Values) -> None:
    """The solution of any relation that is linear in a signal, however written, gives zero when put back."""
    try:
        ends = [value(residual, values | {"z": end}) for end in (-1.0, 0.0, 1.0)]
    except ZeroDivisionError:
        assume(False)
    slope = (ends[2] - ends[0]) / 2.0
    assume(0.01 < abs(slope) < 1e4 and max(map(abs, ends)) < 1e4)
    solution = isolate(residual, "z")
    assert solution is not None, to_text(residual)
    found = value(solution, values)
    assert found == pytest.approx(-ends[1] / slope, rel=1e-6, abs=1e-6 * max(map(abs, ends)))


@pytest.mark.parametrize(
    "text",
    [
        "a*z*abs(z) + b*z - c",
        "a*abs(z)*z - (c - b*z)",
        "-(a*(z*abs(z)) + z*b) + c",
        "(z/a)*abs(z/a) - c",
        "b*abs(-2*z)*z + a*z*abs(z)/3 - c + z*b",
        "c - a*abs(z)*z",
        "-a*z*abs(z) - b*z + c",
    ],
)
@given(sizes, sizes, st.floats(-10.0, 10.0).filter(lambda c: abs(c) > 1e-3))
@settings(max_examples=25, deadline=None)
def test_turbulent_flow(text: str, a: float, b: float, c: float) -> None:
    """The root of a turbulent relation is real, gives zero, and has the sign of what drives it."""
    residual, values = parse_expression(text), {"a": a, "b": b, "c": c}
    solution = isolate(residual, "z")
    assert isinstance(solution, Call)
    assert solution.function == "signed_root"
    found = value(solution, values)
    assert math.copysign(1.0, found) == math.copysign(1.0, c)
    assert abs(value(residual, values | {"z": found})) <= 1e-9 * scale_of(residual, values | {"z": found})


@pytest.mark.parametrize(
    "text", ["a*z**2 + b*z + c", "c + z*(b + z*a)", "z*z*a - (-c - b*z)", "abs(z)*abs(a*z) + b*z + c"]
)
@given(signed, signed, signed)
@settings(max_examples=40, deadline=None)
def test_one_way_square(text: str, a: float, b: float, c: float) -> None:
    """A square is solved for its upper root, whatever the sign of its leading coefficient."""
    values = {"a": abs(a) if "abs" in text else a, "b": b, "c": c}
    assume(b * b - 4.0 * values["a"] * c > 1e-3)
    residual = parse_expression(text)
    solution = isolate(residual, "z")
    assert isinstance(solution, Call)
    assert solution.function == "upper_root"
    found = value(solution, values)
    assert abs(value(residual, values | {"z": found})) <= 1e-9 * scale_of(residual, values | {"z": found})
    assert found >= -b / (2.0 * values["a"])


def layer(kind: str, inner: Expression, name: str) -> Expression:
    """An expression around `inner`: a function, or a sum or product with a named coefficient on one side."""
    if kind in {"exp", "log", "sqrt"}:
        return Call(kind, (inner,))
    if kind == "negative":
        return Negative(inner)
    other = Name(name)
    return Binary(kind[-1], other, inner) if kind.startswith("other") else Binary(kind[0], inner, other)


LAYERS = [
    "exp",
    "log",
    "sqrt",
    "negative",
    *(f"{sign} other" for sign in "+-*/"),
    *(f"other {sign}" for sign in "+-*/"),
]


def once(signal: Expression) -> st.SearchStrategy[Expression]:
    """Random expressions in which `signal` occurs once, below functions that have an inverse."""
    kinds = st.lists(st.tuples(st.sampled_from(LAYERS), st.sampled_from(COEFFICIENTS)), min_size=1, max_size=5)
    return kinds.map(lambda chosen: reduce(lambda inner, item: layer(item[0], inner, item[1]), chosen, signal))


@given(once(Name("z")), values_of, sizes)
@quick
def test_signal_that_occurs_once(expression: Expression, values: Values, true: float) -> None:
    """A signal that occurs once, below functions with an inverse, is found again from the value of the expression."""
    try:
        target, near = (value(expression, values | {"z": z}) for z in (true, true * (1 + 1e-6)))
    except (ValueError, ZeroDivisionError, OverflowError):
        assume(False)
    assume(1e-3 < abs(target) < 1e6 and 1e-4 < abs((near - target) / (1e-6 * true)) < 1e4)
    solution = isolate(Binary("-", expression, Name("target")), "z")
    assert solution is not None, to_text(expression)
    assert value(solution, values | {"target": target}) == pytest.approx(true, rel=1e-5)


@pytest.mark.parametrize(
    "text",
    [
        "z + exp(z) - a",
        "z**3 - a",
        "a*abs(z) - b",
        "sin(z) - a",
        "tanh(z) + b",
        "min(z, a) - b",
        "where(z > 0, z, 2*z) - a",
        "z*abs(z - a) - b",
        "a*z*z + b*z*abs(z) - c",
        "a**z - b",
        "z/(z + a) - b",
        "a - b",
    ],
)
def test_what_has_no_closed_form(text: str) -> None:
    """A relation without a closed form here, or without the signal at all, has no solution rather than a wrong one."""
    assert isolate(parse_expression(text), "z") is None


@pytest.mark.parametrize(
    "text",
    [
        "a*b*sign(z)*sqrt(abs(z)) - c",
        "c - sqrt(abs(z))*a*sign(z)/b",
        "a + b*(sign(z - c)*sqrt(abs(z - c)))/d",
        "-(sign(2*z + c)*sqrt(abs(2*z + c))) - a + sign(c)*sqrt(abs(c))",
    ],
)
@quick
@given(values=values_of)
def test_orifice(text: str, values: Values) -> None:
    """A root with the sign of what is under it has one inverse, whichever way the flow goes."""
    residual = parse_expression(text)
    found = isolate(residual, "z")
    assert found is not None
    z = value(found, values)
    assert value(residual, values | {"z": z}) == pytest.approx(0.0, abs=1e-9 * (1.0 + abs(z)))


def test_roots_of_other_things_are_no_orifice() -> None:
    """Sign and root have to be of the same."""
    assert isolate(parse_expression("a*sign(z)*sqrt(abs(z - b)) - c"), "z") is None


def test_only_lines_are_linear() -> None:
    """`linear_solution` refuses what is not a line, though `isolate` solves it."""
    for text in ("a*z*abs(z) - b", "a*z*z - b", "exp(z) - b", "a/z - b"):
        assert linear_solution(parse_expression(text), "z") is None
        assert isolate(parse_expression(text), "z") is not None


def test_solution_does_not_hold_the_signal() -> None:
    """The solution is free of the signal, also where its terms cancel only in part."""
    solution = isolate(parse_expression("a*z - b*(z - c) + d"), "z")
    assert solution is not None
    assert value(solution, {"a": 5.0, "b": 2.0, "c": 3.0, "d": 1.0}) == pytest.approx(-7.0 / 3.0, rel=1e-12)
