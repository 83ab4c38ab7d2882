"""Curves with fewer points show every peak."""

from dataclasses import fields

import numpy as np
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from faultbond.service.contract.messages import Curves
from faultbond.service.store.chunks import curves_at
from faultbond.service.store.peaks import thinned
from stored import some_curves

VALUES = st.one_of(st.just(np.nan), st.floats(-9, 9))


@given(st.data(), st.integers(1, 60), st.integers(2, 30), st.booleans())
def test_every_part_keeps_its_extremes(data: st.DataObject, n: int, most: int, sorted_time: bool) -> None:
    """Between two points that are left, nothing of the whole curve lies outside of what they span."""
    time = data.draw(arrays(np.float64, n, elements=st.floats(0, 100)))
    time = np.sort(time) if sorted_time else time
    values = data.draw(arrays(np.float64, (n, 2), elements=VALUES))
    curves = Curves(time=time, inputs=values, measured=values, expected=values, sd=values, cusum=values)
    found = thinned(curves, most)
    assert len(found) <= max(most, 2)
    if n <= most:
        assert found is curves
        return
    assert np.isin(found.time, time).all()
    assert (found.time[0], found.time[-1]) == (time[0], time[-1])
    for column in range(2):
        whole, left = values[:, column], found.measured[:, column]
        assert np.isin(left[~np.isnan(left)], whole).all(), "no value is made up"
        covered(time, whole, found.time, left, in_order=sorted_time)


def covered(time: np.ndarray, whole: np.ndarray, kept: np.ndarray, left: np.ndarray, *, in_order: bool) -> None:
    """Every value lies between those that are left at moments around its own."""
    for moment, value in zip(time, whole, strict=True):
        if np.isnan(value):
            continue
        near = left
        if in_order:
            before, after = np.searchsorted(kept, moment, "left"), np.searchsorted(kept, moment, "right")
            near = left[max(before - 1, 0) : after + 1]
        assert np.nanmin(near) <= value <= np.nanmax(near)


def test_a_peak_of_one_point() -> None:
    """A spike of one sample among a million is there, in the part of the time where it was, and so is the gap."""
    curves = some_curves(0, 1_000_000)
    curves.measured[777_777, 0] = 50.0
    curves.measured[300_000:400_000, 1] = np.nan
    found = thinned(curves, 1000)
    assert 990 <= len(found) <= 1000
    (place,) = np.flatnonzero(found.measured[:, 0] == 50.0)
    assert abs(found.time[place] - 777_777) <= 2000
    gone = found.time[np.isnan(found.measured[:, 1])]
    assert abs(gone[0] - 300_000) <= 2000
    assert abs(gone[-1] - 400_000) <= 2000


def test_the_order_within_a_part() -> None:
    """Where a curve falls, its largest value comes first, so that the line through the points follows it."""
    time = np.arange(8.0)
    ramp = np.stack([time, -time], axis=1)
    found = thinned(Curves(time=time, inputs=ramp, measured=ramp, expected=ramp, sd=ramp, cusum=ramp), 4)
    assert found.time.tolist() == [0.0, 3.0, 4.0, 7.0]
    assert found.measured.tolist() == [[0.0, 0.0], [3.0, -3.0], [4.0, -4.0], [7.0, -7.0]]


def test_points_are_chosen_of_all_curves() -> None:
    """A part of curves is the same part of each of them."""
    part = curves_at(some_curves(0, 10), slice(3, 5))
    assert [len(getattr(part, item.name)) for item in fields(Curves)] == [2] * 6
