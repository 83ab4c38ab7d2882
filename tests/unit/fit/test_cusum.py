"""Sums along a whole recording are those of its samples, added one after the other."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.contract.spec import Thresholds
from faultbond.fit.cusum import added, heights_along, heights_of, no_sums

SETTINGS = Thresholds(
    cusum_drift=0.4, cusum_limit=9.0, cusum_clip=4.0, fast_drift=1.6, fast_limit=5.0, scatter_ratio=1.8,
    scatter_limit=12.0,
)  # fmt: skip


def one_by_one(scores: FloatArray, use: FloatArray, forget: FloatArray, anew: FloatArray) -> FloatArray:
    """The sums after each sample, by the slow way."""
    sums, found = no_sums(*scores.shape[1:]), []
    for t in range(len(scores)):
        sums = replace(sums, before=np.where(anew[t], np.nan, sums.before))
        sums = added(SETTINGS, sums, scores[t], use[t], forget[t])
        found.append(heights_of(SETTINGS, sums))
    return np.array(found).reshape(-1, 3, *scores.shape[1:]).swapaxes(0, 1)


@pytest.mark.parametrize("seed", range(8))
def test_along_is_one_by_one(seed: int) -> None:
    """With scores that are missing or wild, are not used, or have nothing before them to be compared with."""
    rng = np.random.default_rng(seed)
    n, shape = int(rng.integers(1, 400)), (2, 3)
    scores = rng.normal(0.0, rng.choice([0.5, 1.0, 3.0]), (n, *shape)) + rng.choice([-0.5, 0.0, 1.0], (n, 1, 3))
    scores[rng.random((n, *shape)) < 0.1] = rng.choice([np.nan, np.inf, 40.0])
    use = rng.random((n, 1, 3)) < rng.choice([0.05, 0.9, 1.0])
    forget, anew = (rng.random((n, 1, 3)) < rng.choice([0.0, 0.05, 0.4]) for _ in range(2))
    expected = one_by_one(scores, use, forget, anew)
    assert heights_along(SETTINGS, scores, use, forget, anew) == pytest.approx(expected, abs=1e-9)
    assert seed or expected.max() > SETTINGS.cusum_limit


def test_of_no_samples() -> None:
    """There are no sums of none."""
    none = np.zeros((0, 2), dtype=bool)
    assert heights_along(SETTINGS, np.zeros((0, 2)), none, none, none).shape == (3, 0, 2)


def test_a_sum_does_not_lose_digits_in_a_long_run() -> None:
    """After a hundred thousand quiet samples it is the same as from the start of what is not quiet."""
    rng = np.random.default_rng(5)
    tail = rng.normal(0.5, 1.0, (200, 1))
    quiet = np.zeros((100_000, 1))
    none, all_ = np.zeros((100_200, 1), dtype=bool), np.ones((100_200, 1), dtype=bool)
    anew = none.copy()
    anew[100_000] = True
    whole = heights_along(SETTINGS, np.concatenate([quiet, tail]), all_, none, anew)
    assert whole[:, 100_000:] == pytest.approx(
        heights_along(SETTINGS, tail, all_[:200], none[:200], none[:200]), abs=1e-9
    )
