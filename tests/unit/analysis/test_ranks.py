"""Ranks and bases of many sets at once, against numpy's for each."""

from itertools import combinations

import numpy as np
import pytest

from faultbond.analysis.ranks import ReducedSensitivities, above_noise, bases, set_ranks, told_rank
from faultbond.arrays import FloatArray


def seen(matrix: FloatArray) -> ReducedSensitivities:
    """What a made-up plant shows."""
    n = matrix.shape[1]
    return ReducedSensitivities(
        outputs=("y",),
        parameters=tuple(f"P{k}" for k in range(n)),
        steps=np.ones(n),
        relative=np.ones(n, dtype=bool),
        columns=matrix,
        row_outputs=np.zeros(len(matrix), dtype=np.intp),
        lengths=np.ones(n),
        matrix=matrix,
        rank=told_rank(np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)),
    )


def dependent() -> FloatArray:
    """Columns of which some are zero, some depend on others, and one nearly does."""
    rng = np.random.default_rng(11)
    base = rng.standard_normal((8, 4))
    mixed = [base[:, 0] * -2.0, base[:, 0] + base[:, 1], np.zeros(8), base[:, 2] + 1e-8 * base[:, 3]]
    return np.column_stack([base[:, :3], *mixed])


@pytest.mark.parametrize("size", [1, 2, 3, 4])
def test_ranks_of_sets(size: int) -> None:
    """The rank of each set is that of its columns, exact dependence found, a trace of 1e-8 kept."""
    matrix = dependent()
    sets = list(combinations(range(matrix.shape[1]), size))
    ranks, doubts = set_ranks(seen(matrix), sets)
    wanted = [int(np.linalg.matrix_rank(matrix[:, chosen], tol=1e-11)) for chosen in sets]
    assert ranks.tolist() == wanted
    assert not doubts.any()
    assert min(wanted) < size


def test_a_set_larger_than_the_rank() -> None:
    """More columns than there are directions have the rank of the space, whatever rounding leaves of the others."""
    for seed in range(20):
        matrix = np.random.default_rng(seed).standard_normal((3, 5))
        for size in (3, 4, 5):
            ranks, doubts = set_ranks(seen(matrix), list(combinations(range(5), size)))
            assert set(ranks.tolist()) == {3}
            assert not doubts.any()


@pytest.mark.parametrize("size", [1, 2, 3])
def test_bases_of_sets(size: int) -> None:
    """A basis is orthonormal and holds the columns of its set, also of two that differ by a trace."""
    matrix = dependent()
    sets = list(combinations((1, 2, 6), size))
    for chosen, base in zip(sets, bases(seen(matrix), sets), strict=True):
        assert base.T @ base == pytest.approx(np.eye(size), abs=1e-14)
        columns = matrix[:, chosen]
        assert base @ (base.T @ columns) == pytest.approx(columns, abs=1e-14)


def test_a_column_that_is_zero_spans_nothing() -> None:
    """Of a parameter without effect the basis is zero."""
    assert np.array_equal(bases(seen(dependent()), [(5,)]), np.zeros((1, 8, 1)))


def test_an_effect_below_three_noises_is_hidden() -> None:
    """Of effects of 40, 4 and 2 noises two are seen; the rank says which was kept and which dropped."""
    found = above_noise(seen(np.diag([40.0, 4.0, 2.0])), np.ones(3)).rank
    assert found.value == 2
    assert [found.kept, found.dropped] == pytest.approx([0.1, 0.05])
    assert above_noise(seen(np.diag([40.0, 4.0, 2.0])), np.full(3, 2.0)).rank.value == 3
