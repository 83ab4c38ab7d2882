"""What further unknowns would gain once everything else has followed them."""

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.fit.objective import Evaluation
from faultbond.fit.score import score_gains

NEW, FOLLOWING, FIXED = [4, 5, 6], [0, 1, 2], [3]  # of seven unknowns
MOVES = np.isin(np.arange(7), FOLLOWING)


def found(seed: int) -> Evaluation:
    """Give a parabola of seven unknowns whose sizes differ by many orders of magnitude."""
    generator = np.random.default_rng(seed)
    sizes = 10.0 ** generator.uniform(-6.0, 6.0, 7)
    root = generator.normal(size=(7, 12)) * sizes[:, None]
    return Evaluation(value=0.0, score=root @ generator.normal(size=12), information=root @ root.T)


def highest(parabola: Evaluation, prior: FloatArray, places: list[int]) -> float:
    """Give how high a parabola is at its top, where only some unknowns move."""
    curved, slope = (parabola.information + np.diag(prior))[np.ix_(places, places)], parabola.score[places]
    sizes = np.sqrt(np.diag(curved))
    root = np.linalg.cholesky(curved / np.outer(sizes, sizes))
    return 0.5 * float(np.sum(np.linalg.solve(root, slope / sizes) ** 2))


@pytest.mark.parametrize("seed", range(5))
def test_a_gain_is_that_of_the_top_of_the_parabola(seed: int) -> None:
    """Above the top without what is new, where also all moves that follows."""
    parabola = found(seed)
    prior = np.diag(parabola.information) * np.random.default_rng(seed).uniform(0.0, 0.1, 7)
    groups = [[4], [6], [4, 5], NEW]
    expected = [highest(parabola, prior, FOLLOWING + group) - highest(parabola, prior, FOLLOWING) for group in groups]
    assert score_gains(parabola, prior, MOVES, groups) == pytest.approx(expected, rel=1e-6)


def test_what_others_do_as_well_gains_nothing() -> None:
    """Though its slope is large: what is new is the sum of two that follow."""
    parabola = found(1)
    mixed = np.eye(7)
    mixed[4] = mixed[0] + mixed[1]
    same = Evaluation(value=0.0, score=mixed @ parabola.score, information=mixed @ parabola.information @ mixed.T)
    assert score_gains(same, np.zeros(7), MOVES, [[4]]) == [0.0]
    assert abs(same.score[4]) > 0.0


def test_a_plant_without_a_course_gains_nothing() -> None:
    """Whatever was asked."""
    nothing = Evaluation(value=-np.inf, score=np.full(7, np.nan), information=np.full((7, 7), np.nan))
    assert score_gains(nothing, np.zeros(7), MOVES, [[4], [5, 6]]) == [0.0, 0.0]
