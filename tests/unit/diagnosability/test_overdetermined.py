"""Classes, minimal overdetermined sets and minimal supports of models known by hand or from publications."""

import pytest
from benchmarks.shared import published

from faultbond.diagnosability.classes import classes, redundancy
from faultbond.diagnosability.overdetermined import minimal_sets, minimal_supports, signatures
from faultbond.equations.matching import match
from faultbond.errors import StructureError
from low_index import low_index

# x by three sensors; y from x, and measured; z from y only
X, Y, Z = range(3)
SENSORS = ((X,), (X,), (X,), (X, Y), (Y,), (Y, Z))


def test_redundancy_counts_what_is_to_spare() -> None:
    """Three sensors of x and one of y are three equations more than x and y need."""
    assert redundancy(SENSORS, 3) == 3
    assert redundancy(((X, Y), (Y, Z)), 3) == 0


def test_classes_are_checked_together() -> None:
    """A law and the sensor behind it are checked only together, two sensors of one variable each by itself."""
    assert classes(SENSORS, match(SENSORS, 3)) == (0, 1, 2, 3, 3, -1)


def test_classes_inside_a_loop() -> None:
    """Three equations in two variables of a loop are checked only together; two of them are not checked at all."""
    x, y, z = range(3)
    loop = ((x,), (x,), (x, y, z), (x, y, z), (y, z))
    assert classes(loop, match(loop, 3)) == (0, 1, 2, 2, 2)
    square = ((x,), (x,), (x, y, z), (x, y, z))
    assert classes(square, match(square, 3)) == (0, 0, -1, -1)


def test_minimal_sets_by_hand() -> None:
    """Each pair of sensors of x is one test, each sensor of x with the law and the sensor of y another."""
    pairs = {(0, 1), (0, 2), (1, 2)}
    assert set(minimal_sets(SENSORS, 3)) == pairs | {(0, 3, 4), (1, 3, 4), (2, 3, 4)}


def test_supports_by_hand() -> None:
    """With faults in the first sensor and in the law, each support has all that the other leaves."""
    assert minimal_supports(SENSORS, 3, [0, 3]) == ((0, 1, 2), (1, 2, 3, 4))


def test_supports_of_every_fault_are_minimal_sets() -> None:
    """With a fault in every equation the minimal supports are the minimal sets."""
    assert minimal_supports(SENSORS, 3, range(6)) == minimal_sets(SENSORS, 3)


def test_nothing_to_test() -> None:
    """A model without redundancy has no sets, nor has a redundant one without faults a support."""
    assert minimal_sets(((X, Y), (Y, Z)), 3) == ()
    assert minimal_sets((), 0) == ()
    assert minimal_supports(SENSORS, 3, []) == ()
    assert minimal_supports(SENSORS, 3, [5]) == ()


def test_too_many_sets_are_refused_early() -> None:
    """Forty sensors of one variable have 780 pairs; a lower limit stops the search with advice."""
    assert len(minimal_sets(((X,),) * 40, 1)) == 780
    with pytest.raises(
        StructureError, match="more than 100 minimal overdetermined sets, or too many to search through: take fewer"
    ):
        minimal_sets(((X,),) * 40, 1, limit=100)


def test_limit_holds_for_huge_numbers() -> None:
    """A model whose sets nobody could list stops at the limit as well."""
    ladder = [(k // 4, k // 4 + 1) for k in range(400)]
    with pytest.raises(StructureError, match="more than 1000 minimal"):
        minimal_sets(ladder, 101, limit=1000)


def test_signatures() -> None:
    """A test responds to the faults that enter its equations."""
    table = signatures([(0, 1), (1, 3, 4)], [0, 3, 4])
    assert table.tolist() == [[True, False, False], [False, True, True]]
    assert signatures([], [0]).shape == (0, 1)


@pytest.mark.parametrize(
    ("table", "sets", "supports"),
    [
        (published.WATER_TANK, 17, 10),
        (published.THREE_TANK, 6, 4),
        (published.ELECTRIC_MOTOR, 3, 3),
        (published.INDUCTION_MOTOR, 9, 2),
        (published.ENGINE, 4496, 144),
    ],
)
def test_published_counts(table: str, sets: int, supports: int) -> None:
    """The published models have as many minimal sets and supports as published."""
    model = published.structure(table)
    assert len(minimal_sets(model.equations, model.n_variables)) == sets
    assert len(minimal_supports(model.equations, model.n_variables, model.faults)) == supports


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
def test_published_counts_of_low_index(table: str, count: int) -> None:
    """As many minimal sets of the published models are of low index as published."""
    model = published.structure(table)
    assert sum(low_index(model, found) for found in minimal_sets(model.equations, model.n_variables)) == count
