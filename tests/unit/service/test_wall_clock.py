"""A clock that somebody sets, beside one that only grows."""

from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from faultbond.service.wall_clock import DOUBTED, LEAST, WallClock
from played import Clock

steps = st.lists(st.tuples(st.floats(0.1, 1e5), st.sampled_from([0.0, 3600.0, -3600.0, 1e7])), max_size=20)


@given(steps)
def test_each_jump_is_told_once(taken: Sequence[tuple[float, float]]) -> None:
    """At the look after it, by its size, and whatever time passed meanwhile."""
    clock, steady = Clock(), Clock()
    found = WallClock(clock, steady)
    for passed, moved in taken:
        steady.now += passed
        clock.now += passed + moved
        assert found.jumped() == pytest.approx(moved, abs=1e-3)
    assert found.n_jumps == sum(moved != 0.0 for _, moved in taken)


@given(steps)
def test_what_is_believed_is_never_later_than_without_the_jumps_of_a_day(taken: Sequence[tuple[float, float]]) -> None:
    """A jump forward counts after a day, one back at once."""
    clock, steady = Clock(), Clock()
    found, jumps = WallClock(clock, steady), list[tuple[float, float]]()
    for passed, moved in taken:
        steady.now += passed
        clock.now += passed + moved
        jumps += [(steady.now, moved)]
        found.jumped()
        lately = sum(by for at, by in jumps if by > 0.0 and steady.now - at < DOUBTED)
        assert found.believed() == pytest.approx(clock.now - lately, abs=1e-2)


def test_a_clock_that_is_led_to_the_right_time_does_not_jump() -> None:
    """However far it goes in the end."""
    clock, steady = Clock(), Clock()
    found = WallClock(clock, steady)
    for _ in range(100):
        steady.now += 1.0
        clock.now += 1.0 + 0.9 * LEAST
        assert found.jumped() == 0.0
