"""Frozen sensors are counted, and quantised ones are not."""

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.io.frozen import FROZEN_AFTER, Frozen
from faultbond.io.grid import Grid, Row, on_grid


def count(values: FloatArray, noise: float) -> list[int]:
    """Give by how much the count of one sensor grows at each value."""
    frozen = Frozen(np.array([noise]))
    return [frozen.add(np.array([value])) for value in values]


def noisy(n: int = 200, resolution: float = 0.01) -> FloatArray:
    """Give readings of a sensor with noise of 1, rounded."""
    return np.round(np.random.default_rng(1).normal(size=n) / resolution) * resolution


def test_a_frozen_sensor_is_counted() -> None:
    """From the 60th equal value on all of them count, each once; missing ones between them do not."""
    values = np.concatenate([noisy(), np.full(FROZEN_AFTER + 40, 0.123), [np.nan], [0.123], noisy()])
    found = count(values, 1.0)
    assert sum(found) == FROZEN_AFTER + 41
    assert found.index(FROZEN_AFTER) == 200 + FROZEN_AFTER - 1
    assert set(found) == {0, 1, FROZEN_AFTER}


@pytest.mark.parametrize(("resolution", "noise"), [(1.0, 1.0), (0.01, 0.01), (0.01, 0.0)])
def test_a_coarse_sensor_may_repeat_itself(resolution: float, noise: float) -> None:
    """A value that repeats says nothing where the resolution is not much finer than the noise."""
    values = np.concatenate([noisy(resolution=resolution), np.full(500, 2.0)])
    assert sum(count(values, noise)) == 0


def test_fewer_repeats_do_not_count() -> None:
    """One repeat less than needed is not counted."""
    values = np.concatenate([noisy(), np.full(FROZEN_AFTER - 1, 0.123), noisy()])
    assert sum(count(values, 1.0)) == 0


def test_each_sensor_counts_by_itself() -> None:
    """Two sensors that are frozen count twice; the grid gives the sum."""
    still = [Row(time=float(k), u=np.zeros(0), y=np.array([0.001 * (k < 2) * k, noisy()[k], 5.0])) for k in range(150)]
    grid = Grid(1.0, noise=(1.0, 1.0, 1.0))
    list(on_grid(still, grid))
    assert grid.counts.frozen == 148
    both = [Row(time=item.time, u=item.u, y=item.y[[0, 0]]) for item in still]
    grid = Grid(1.0, noise=(1.0, 1.0))
    list(on_grid(both, grid))
    assert grid.counts.frozen == 2 * 148
