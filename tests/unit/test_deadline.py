"""A deadline ends what is under way where it is told, and only what it bounds."""

import pytest

from faultbond.app import deadline
from faultbond.app.deadline import Deadline

UP = "what was under way is left: the time is up"


def test_a_step_ends_where_it_tells_after_its_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """Half of 100 s are gone after 50; what is not bounded is told whenever it is."""
    now, told = [1000.0], list[str]()
    monkeypatch.setattr(deadline, "monotonic", lambda: now[0])
    clock = Deadline(told.append, 100.0)

    def step() -> str:
        clock("first")
        now[0] += 30.0
        clock("second")
        return "done"

    assert clock.in_time(0.5, step) == "done"
    assert clock.has(0.5)
    assert clock.in_time(0.5, step) is None
    assert not clock.has(0.5)
    assert clock.has(0.7)
    clock("after it")
    assert told == ["first", "second", "first", UP, "after it"]


def test_an_error_is_no_end_of_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """It goes on to who asked, and what follows is not bounded any more."""
    now = [0.0]
    monkeypatch.setattr(deadline, "monotonic", lambda: now[0])
    told = list[str]()
    clock = Deadline(told.append, 1.0)

    def wrong() -> None:
        raise ValueError("wrong")

    with pytest.raises(ValueError, match="wrong"):
        clock.in_time(0.5, wrong)
    now[0] = 10.0
    clock("more")
    assert told == ["more"]
