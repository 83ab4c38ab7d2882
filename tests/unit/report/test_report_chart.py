"""Thinning keeps the picture."""

import numpy as np

from faultbond.report.chart import thin


def test_extremes_survive() -> None:
    """A single spike in each of two traces of 100,000 samples is still there, and few points are left."""
    first, second = np.sin(np.arange(100_000) / 5000.0), np.zeros(100_000)
    first[43_210], second[77_777] = 9.0, -9.0
    rows = thin([first, second], 4000)
    assert {0, 43_210, 77_777, 99_999} <= set(rows.tolist())
    assert len(rows) <= 4002
    assert (np.diff(rows) > 0).all()


def test_short_traces_are_left_alone() -> None:
    """A trace that is short enough keeps every sample, gaps too."""
    trace = np.array([1.0, np.nan, 2.0])
    assert thin([trace], 10).tolist() == [0, 1, 2]


def test_long_gaps_survive() -> None:
    """A gap of many buckets is still a gap, and the samples at its edges are still near it."""
    trace = np.ones(50_000)
    trace[20_000:30_000] = np.nan
    rows = thin([trace], 1000)
    gaps = rows[np.isnan(trace[rows])]
    assert len(gaps) > 50
    assert abs(int(gaps.min()) - 20_000) < 200


def test_only_gaps() -> None:
    """A trace without a single value does not fail."""
    assert len(thin([np.full(10_000, np.nan)], 100)) > 0
