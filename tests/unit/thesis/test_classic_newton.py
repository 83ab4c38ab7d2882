"""Newton's method beside the plant, for many models at once."""

import numpy as np
import pytest

from faultbond.algebra.solving.solution import Line, Root
from faultbond.arrays import FloatArray
from faultbond.model.parser import parse_expression
from faultbond.thesis.offline.tape_writer import compile_roots
from faultbond.thesis.online.newton import solve_torn
from faultbond.thesis.online.tape import NewtonTape

PLACES = {"x": 0, "z": 1, "a": 2, "before": 3}


def search(*misfits: str, about: tuple[float, ...] = (1.0,), start: bool = False) -> NewtonTape:
    """A search for x, and z where there are two misfits, that are zero; its result is x + 1."""
    named = [Line(name=f"misfit {k}", value=parse_expression(text)) for k, text in enumerate(misfits)]
    lines = (*named, Line(name="result", value=parse_expression("x + 1")))
    program = compile_roots([Root(lines=lines)], (*(line.name for line in named), "result"), PLACES)
    guessed = (0, 1)[: len(misfits)]
    starts = (3,) if start else (-1,) * len(misfits)
    return NewtonTape(program=program, guessed=guessed, starts=starts, about=about)


def solved(item: NewtonTape, a: FloatArray, before: FloatArray | None = None) -> FloatArray:
    """The result for each lane."""
    nothing = np.array([np.nan])
    with np.errstate(all="ignore"):
        found: FloatArray = solve_torn(item, [nothing, nothing, a, nothing if before is None else before], a.size)[0]
    return found


def test_each_lane_finds_its_own_root() -> None:
    """x + tanh(x/0.002) = a has one root for every a, though its slope jumps at zero."""
    a = np.array([-3.0, -1.0, -0.2, 0.0, 0.5, 1.0, 40.0])
    x = solved(search("x + tanh(x/0.002) - a"), a) - 1.0
    assert x + np.tanh(x / 0.002) == pytest.approx(a, abs=1e-7)


def test_it_begins_where_the_signal_was() -> None:
    """Of two roots that is found which is near the signal one frame earlier."""
    a = np.full(2, 4.0)
    assert solved(search("x**2 - a", start=True), a, np.array([1.0, -1.0])) == pytest.approx([3.0, -1.0])


def test_two_guesses_are_found_together() -> None:
    """Two misfits in two unknowns."""
    a = np.array([3.0, 5.0])
    x = solved(search("x*z - a", "x - z - 2", about=(2.0, 0.5)), a) - 1.0
    assert x * (x - 2.0) == pytest.approx(a)


def test_no_solution_is_nan() -> None:
    """A lane without a root, or where the misfit has no value, is nan and does not disturb the others."""
    a = np.array([-1.0, 9.0])
    found = solved(search("x**2 - a"), a)
    assert np.isnan(found[0])
    assert found[1] == pytest.approx(4.0)
    assert np.isnan(solved(search("sqrt(a) - x*x"), a)[0])
