"""Matchings, parts, closures and blocks of models small enough to be checked by eye, and of one that is large."""

import pytest

from faultbond.equations import matching
from faultbond.equations.matching import (
    DulmageMendelsohnPart,
    blocks,
    closure,
    decompose,
    match,
    redundant,
    undetermined,
)

# a = given; b = a; c with d, twice; e = c; f with g, once; a again, by a sensor
A, B, C, D, E, F, G = range(7)
PLANT = ((A,), (A, B), (C, D), (C, D, B), (C, E), (F, G), (A,))


def test_each_variable_by_one_equation() -> None:
    """A matching gives a variable an equation that contains it, and no equation to two variables."""
    matched = match(PLANT, 7)
    used = [equation for equation in matched if equation >= 0]
    assert len(used) == len(set(used)) == 6
    assert all(variable in PLANT[equation] for variable, equation in enumerate(matched) if equation >= 0)


def test_a_choice_is_revised() -> None:
    """Where equations take the variables that others need, a path through all of them makes room."""
    assert match(((0, 1), (1, 2), (2, 3), (0,)), 4) == (3, 0, 1, 2)


def test_earlier_equations_come_first() -> None:
    """Of equations that compete for a variable, the first ones keep a variable, whichever it is."""
    assert match(((0,), (0,), (0, 1), (1,)), 2) == (0, 2)
    assert match(((0, 1), (0, 1), (0, 1)), 2) == (0, 1)


def test_nothing_to_match() -> None:
    """Models without equations, without variables or without entries have a matching, and parts."""
    assert match((), 2) == (-1, -1)
    assert match(((), ()), 0) == ()
    assert decompose(((), ()), 0).over == DulmageMendelsohnPart(equations=(0, 1), variables=())
    assert decompose((), 2).under == DulmageMendelsohnPart(equations=(), variables=(0, 1))
    assert blocks((), ()) == ()


def test_parts_of_the_plant() -> None:
    """A variable measured twice is over-determined, a square rest just, two unknowns in one equation under."""
    parts = decompose(PLANT, 7)
    assert parts.over == DulmageMendelsohnPart(equations=(0, 6), variables=(A,))
    assert parts.just == DulmageMendelsohnPart(equations=(1, 2, 3, 4), variables=(B, C, D, E))
    assert parts.under == DulmageMendelsohnPart(equations=(5,), variables=(F, G))


def test_what_is_undetermined_and_redundant() -> None:
    """The functions for single parts agree with the decomposition."""
    matched = match(PLANT, 7)
    assert undetermined(PLANT, 7, matched) == {F, G}
    assert redundant(PLANT, matched) == {0, 6}


def test_closure_of_a_target() -> None:
    """A target needs the equation that determines it and, in turn, what this one contains; not the rest."""
    matched = match(PLANT, 7)
    assert closure([B], PLANT, matched) == ((0, 1), (A, B))
    assert closure([E], PLANT, matched) == ((0, 1, 2, 3, 4), (A, B, C, D, E))
    assert closure([], PLANT, matched) == ((), ())


def test_closure_shows_what_is_missing() -> None:
    """A closure of what cannot be computed contains a variable without an equation."""
    matched = match(PLANT, 7)
    assert any(matched[variable] < 0 for variable in closure([F, G], PLANT, matched)[1])


def test_blocks_in_order() -> None:
    """Equations that need each other's variables form a block, and blocks come before those that need them."""
    matched = match(PLANT, 7)
    assert blocks(PLANT, matched) == ((0,), (1,), (2, 3), (4,), (5,))
    assert blocks(PLANT, matched, closure([B], PLANT, matched)[0]) == ((0,), (1,))


def test_blocks_of_a_reversed_chain() -> None:
    """A chain given backwards is put in the order of computation."""
    equations = (*((k, k + 1) for k in range(5)), (5,))
    assert blocks(equations, match(equations, 6)) == ((5,), (4,), (3,), (2,), (1,), (0,))


def test_blocks_leave_out_what_is_not_chosen() -> None:
    """What chosen equations need of others is taken as known."""
    equations = ((0, 1), (0, 1))
    assert blocks(equations, match(equations, 2), [1]) == ((1,),)


def test_large_models_have_the_same_parts(monkeypatch: pytest.MonkeyPatch) -> None:
    """The matching in C, for large models, leads to the same parts."""
    parts = decompose(PLANT, 7)
    monkeypatch.setattr(matching, "_LARGE", 0)
    assert decompose(PLANT, 7) == parts


def test_long_chain() -> None:
    """A chain of fifty thousand equations, a hundred thousand entries, is matched and ordered; nothing is recursive."""
    n = 50_000
    chain = (*((k, k + 1) for k in range(n)), (n,))
    matched = match(chain, n + 1)
    assert min(matched) >= 0
    assert blocks(chain, matched) == tuple((k,) for k in range(n, -1, -1))
    assert closure([0], chain, matched)[0] == tuple(range(n + 1))
