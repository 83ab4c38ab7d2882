"""The index of models for which it is known."""

import pytest
from benchmarks.shared import published

from faultbond.diagnosability.index import low_index, structural_index
from faultbond.diagnosability.overdetermined import minimal_sets
from faultbond.errors import StructureError


def test_pendulum_has_index_three() -> None:
    """The length of a pendulum is differentiated twice; index 3, as in Pantelides 1988."""
    assert structural_index(published.structure(published.PENDULUM)) == (3, (1, 1, 0, 0, 2, 1, 1, 0, 0))


def test_differential_equations_alone_have_index_zero() -> None:
    """A rate that follows from its state needs no differentiation, and no variable is without a derivative but it."""
    assert structural_index(published.structure("r x\nd x = r")) == (1, (0, 0))


def test_index_needs_a_square_model() -> None:
    """A model with an equation too many, or too few, has no index."""
    with pytest.raises(StructureError, match="these are 2 equations in 1 variables, of which 1 are determined"):
        structural_index(published.structure("x\nx"))
    with pytest.raises(StructureError, match="of which 1 are determined"):
        structural_index(published.structure("x y"))


@pytest.mark.parametrize(
    ("table", "count"),
    [
        (published.WATER_TANK, 15),
        (published.THREE_TANK, 5),
        (published.ELECTRIC_MOTOR, 3),
        (published.INDUCTION_MOTOR, 4),
        (published.ENGINE, 206),
    ],
)
def test_published_counts(table: str, count: int) -> None:
    """As many minimal sets of the published models are of low index as published."""
    model = published.structure(table)
    assert sum(low_index(model, found) for found in minimal_sets(model.equations, model.n_variables)) == count
