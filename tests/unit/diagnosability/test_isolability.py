"""Detectability and isolability of models whose answer is known by hand or published."""

import numpy as np
import pytest
from benchmarks.shared import published

from faultbond.diagnosability.isolability import Interpretation, checked_equations, isolability
from faultbond.diagnosability.structural import StructuralModel

MIXED, INTEGRAL, DERIVATIVE = Interpretation.MIXED, Interpretation.INTEGRAL, Interpretation.DERIVATIVE

# Two states, each measured, and a law of the two rates: one law for two rates, so these have to be differentiated.
RATES = """
d x1 = r1
d x2 = r2
x1 | f1
x2 | f2
r1 r2 | f3
"""
# Each rate by the other state, and one law of the states: neither is known before both are integrated.
STATES = """
d x1 = r1
d x2 = r2
r1 x2 | f1
r2 x1 | f2
x1 x2 | f3
"""
# x1 by integration, x2 from it, the rate of x2 by differentiation.
BOTH = """
d x1 = r1
d x2 = r2
d x3 = r3
r1 | f1
x1 x2 | f2
x3 | f3
r2 r3 | f4
"""
# One rate is known, the other follows from it by a law.
ONE_RATE = """
d x1 = r1
d x2 = r2
r1 r2 | f1
r1 | f2
x1 | f3
x2 | f4
"""


def answers(table: str, interpretation: Interpretation) -> list[list[int]]:
    """Isolability with the detectability as last row."""
    found = isolability(published.structure(table), interpretation)
    return [*found.isolable.astype(int).tolist(), found.detectable.astype(int).tolist()]


def test_one_test_finds_but_does_not_isolate() -> None:
    """Two sensors of one variable: a fault of either shows, and neither can be told from the other."""
    assert answers("x | f1\nx | f2", MIXED) == [[0, 0], [0, 0], [1, 1]]


def test_three_sensors_isolate() -> None:
    """With a third sensor each pair of sensors is a test without the third."""
    assert answers("x | f1\nx | f2\nx", MIXED) == [[0, 1], [1, 0], [1, 1]]


def test_what_is_not_detectable_is_not_isolable() -> None:
    """A fault that nothing checks cannot be told from another, while the other can be told from it."""
    assert answers("x | f1\nx | f2\nx\nx y | f3", MIXED) == [[0, 1, 1], [1, 0, 1], [0, 0, 0], [1, 1, 0]]


def test_faults_of_one_equation() -> None:
    """Two faults of one equation cannot be told apart."""
    assert answers("x | f1 f2\nx\nx", MIXED) == [[0, 0], [0, 0], [1, 1]]


@pytest.mark.parametrize(
    ("table", "able"),
    [(RATES, {MIXED, DERIVATIVE}), (STATES, {MIXED, INTEGRAL}), (BOTH, {MIXED})],
    ids=["differentiated", "integrated", "both"],
)
def test_what_an_interpretation_can_check(table: str, able: set[Interpretation]) -> None:
    """A model that needs differentiation, integration, or both is checked by the interpretations that allow it."""
    for interpretation in Interpretation:
        detectable = isolability(published.structure(table), interpretation).detectable
        assert detectable.all() if interpretation in able else not detectable.any()


def test_causal_isolability_need_not_be_symmetric() -> None:
    """Without the law of two rates one of them is still integrated; without that one neither is known."""
    found = isolability(published.structure(ONE_RATE), INTEGRAL).isolable
    assert found[1, 0]
    assert not found[0, 1]


def test_static_models_do_not_depend_on_the_interpretation() -> None:
    """Without differential equations all interpretations agree."""
    assert answers(published.COMMAULT, INTEGRAL) == answers(published.COMMAULT, MIXED)
    assert answers(published.COMMAULT, DERIVATIVE) == answers(published.COMMAULT, MIXED)


def test_no_faults() -> None:
    """A model without faults has an empty matrix."""
    assert isolability(StructuralModel(equations=((0,), (0,)), n_variables=1)).isolable.shape == (0, 0)


def test_results_cannot_be_changed() -> None:
    """The matrices are read-only."""
    found = isolability(published.structure(published.COMMAULT))
    with pytest.raises(ValueError, match="read-only"):
        found.isolable[0, 0] = True


def test_checked_equations_of_a_part() -> None:
    """Of some equations of a model, those are checked that the others of these check."""
    model = published.structure(published.WATER_TANK)
    assert checked_equations(model, MIXED, range(11)) == set(range(11))
    assert checked_equations(model, MIXED, [2, 3, 9, 10]) == frozenset()


@pytest.mark.parametrize(
    ("table", "ones"),
    [
        (published.WATER_TANK, (6, 6, 6)),
        (published.THREE_TANK, (12, 17, 22)),
        (published.ELECTRIC_MOTOR, (6, 6, 6)),
        (published.INDUCTION_MOTOR, (2, 2, 4)),
        (published.ENGINE, (11, 51, 90)),
    ],
)
def test_published_counts(table: str, ones: tuple[int, int, int]) -> None:
    """As many pairs cannot be told apart, in mixed, integral and derivative causality, as published."""
    found = [isolability(published.structure(table), kind).isolable for kind in (MIXED, INTEGRAL, DERIVATIVE)]
    assert tuple(int(np.sum(~matrix)) for matrix in found) == ones


def test_commault() -> None:
    """The first two faults of Commault's example cannot be told apart, nor the last two; as published."""
    assert (~isolability(published.structure(published.COMMAULT)).isolable).astype(int).tolist() == [
        [1, 1, 0, 0],
        [1, 1, 0, 0],
        [0, 0, 1, 1],
        [0, 0, 1, 1],
    ]
