"""Thinning of long traces: fewer points, the same picture."""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import FloatArray


def thin(traces: Sequence[FloatArray], limit: int) -> NDArray[np.int64]:
    """Choose the samples to draw, common to all traces of a chart.

    Of each of equally long buckets the smallest and the largest value of each trace is kept, the first and the last
    sample always. A gap (nan) is kept where it covers at least half a bucket; where nothing is thinned, all are.

    Parameters
    ----------
    traces : float arrays, each of shape (n_samples,), any unit
    limit : number of points that should not be passed by more than one point per bucket and trace, for gaps

    Returns
    -------
    int array, increasing
    """
    size = len(traces[0]) if traces else 0
    if size <= limit:
        return np.arange(size)
    buckets = max(1, limit // (2 * len(traces)))
    edges = np.linspace(0, size, buckets + 1).astype(np.int64)
    kept = {0, size - 1}
    for first, end in pairwise(edges):
        for trace in traces:
            kept.update(first + k for k in _telling(trace[first:end]))
    return np.array(sorted(kept), dtype=np.int64)


def _telling(part: FloatArray) -> list[int]:
    """Give the places of the smallest and largest value, and of a long gap."""
    gaps = np.isnan(part)
    chosen = [] if gaps.all() else [int(np.nanargmin(part)), int(np.nanargmax(part))]
    if 2 * gaps.sum() >= len(part) > 0:
        chosen.append(int(np.argmax(gaps)))
    return chosen
