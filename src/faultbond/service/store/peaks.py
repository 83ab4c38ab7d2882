"""Fewer points of curves, in which every peak is still seen."""

import numpy as np

from faultbond.arrays import FloatArray, IntArray
from faultbond.service.contract.messages import Curves

_VALUES = ("inputs", "measured", "expected", "sd", "cusum")


def thinned(curves: Curves, most: int) -> Curves:
    """Give curves of at most so many points, two at least; as they are if they have no more.

    Of each part of the time, all parts equally long, two points are left, at its first and last moment. Between them
    every curve has its least and its largest value there, in the order in which it went; where no value is, nan. So a
    curve through them covers what the curve through all points covers, and no value is made up.

    Source
    ------
    The M4 aggregation of Jugel and others, VLDB 2014, section 4, without the first and last value of each part.
    """
    most = max(most, 2)
    if len(curves) <= most:
        return curves
    first = _begins(curves.time, most // 2)
    last = np.append(first[1:], len(curves)) - 1
    places = np.stack([first, last], axis=1).reshape(-1)
    kept = np.ones(len(places), dtype=bool)
    kept[1::2] = last > first  # one point of a part that has but one
    values = {name: _ends(getattr(curves, name), first, last)[kept] for name in _VALUES}
    return Curves(time=curves.time[places[kept]], **values)


def _begins(time: FloatArray, parts: int) -> IntArray:
    """Give the first points of parts of the time; of equally many points where the clock was set back."""
    span = time[-1] - time[0]
    if not (np.isfinite(span) and span > 0.0 and np.all(np.diff(time) >= 0.0)):
        return np.arange(parts, dtype=np.intp) * len(time) // parts
    part = np.minimum((time - time[0]) / span * parts, parts - 1).astype(np.intp)
    return np.concatenate([[0], np.flatnonzero(np.diff(part)) + 1]).astype(np.intp)


def _ends(values: FloatArray, first: IntArray, last: IntArray) -> FloatArray:
    """Give least and largest values of parts, (2 n_parts, n_columns): first that which is nearer to where it began."""
    least, largest = np.fmin.reduceat(values, first, axis=0), np.fmax.reduceat(values, first, axis=0)
    falls = values[last] < values[first]
    found = np.stack([np.where(falls, largest, least), np.where(falls, least, largest)], axis=1)
    return found.reshape(2 * len(first), values.shape[1])
