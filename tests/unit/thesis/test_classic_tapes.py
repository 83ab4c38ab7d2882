"""Closed forms as programs of plain data."""

import numpy as np
import pytest

from faultbond.algebra.solving.branches import Condition
from faultbond.algebra.solving.solution import Line, Root
from faultbond.equations.numeric import numeric_value as plainly
from faultbond.model.expression import Binary, Name, Number
from faultbond.model.parser import parse_expression
from faultbond.thesis.offline.tape_writer import compile_roots
from faultbond.thesis.online.tape import run_program

PLACES = {"a": 0, "b": 1, "c": 2}


@pytest.mark.parametrize(
    "text",
    [
        "a*b - c/a",
        "-(a - b)**5 + a**0.5",
        "sqrt(abs(a - c)) + sign(b - a)*(a + b)",
        "where(a > b, a*c, log(b))",
        "where(a <= b, sin(a), cos(b)) + tan(c/10) + tanh(a)",
        "min(a, b, c)*max(a, 2) - 2",
        "a**(-2) + b**15",
    ],
)
def test_a_program_computes_the_expression(text: str) -> None:
    """For many values at once it gives what the expression gives for each."""
    expression = parse_expression(text)
    generator = np.random.default_rng(5)
    values = generator.uniform(0.2, 3.0, size=(3, 20))
    program = compile_roots([Root(lines=(Line(name="x", value=expression),))], ("x",), PLACES)
    found = run_program(program, list(values))[0]
    wanted = [float(plainly(expression, dict(zip("abc", column, strict=True)))) for column in values.T.tolist()]
    assert np.broadcast_to(found, 20) == pytest.approx(wanted, rel=1e-12)


def test_equal_parts_are_computed_once() -> None:
    """A sum that stands in two lines and two roots is one instruction."""
    part = Binary("+", Name("a"), Name("b"))
    lines = (Line(name="x", value=Binary("*", part, part)), Line(name="y", value=Binary("-", Name("x"), part)))
    program = compile_roots([Root(lines=lines), Root(lines=lines)], ("y",), PLACES)
    assert [name for name, _ in program.code] == ["+", "*", "-"]


def test_the_first_root_that_holds_counts() -> None:
    """Each lane takes the first root whose conditions hold; where none does the first is taken as it is."""
    up = Root(lines=(Line(name="x", value=Name("a")),), conditions=(Condition(expression=Name("b")),))
    down = Root(lines=(Line(name="x", value=Number(-1.0)),), conditions=(Condition(expression=Name("c")),))
    program = compile_roots([up, down], ("x",), PLACES)
    b, c = np.array([1.0, 1.0, -1.0, -1.0]), np.array([1.0, -1.0, 1.0, -1.0])
    assert run_program(program, [np.array([7.0]), b, c])[0].tolist() == [7.0, 7.0, -1.0, 7.0]


def test_a_root_without_a_value_gives_way() -> None:
    """A root of a negative number is nan, and another root that holds is taken in its place."""
    up = Root(lines=(Line(name="x", value=parse_expression("sqrt(a)")),))
    other = Root(lines=(Line(name="x", value=Name("b")),))
    with np.errstate(all="ignore"):
        both = run_program(compile_roots([up, other], ("x",), PLACES), [np.array([-1.0, 4.0]), np.full(2, 9.0)])
        alone = run_program(compile_roots([up], ("x",), PLACES), [np.array([-1.0, 4.0])])
    assert both[0].tolist() == [9.0, 2.0]
    assert np.isnan(alone[0, 0])


def test_a_name_without_a_place_is_an_error() -> None:
    """A closed form in names that the environment does not have is refused."""
    with pytest.raises(KeyError, match="d"):
        compile_roots([Root(lines=(Line(name="x", value=Name("d")),))], ("x",), PLACES)
