"""How often somebody may ask: as often as a person does, and each by themselves."""

from collections.abc import Callable
from typing import Any

import pytest

from asked import Asked, is_refused
from faultbond.service.web import application, request_rate
from faultbond.service.web.request_rate import RequestRate

LIMITS = [
    ("DEEDS", lambda asked: asked.do(action="out of service")),
    ("CURVES", lambda asked: asked("GET", "/api/v1/assets/tank_1/curves")),
    ("REPORTS", lambda asked: asked("GET", "/api/v1/assets/tank_1/report")),
]


def test_a_bucket_fills_again() -> None:
    """So many at once, then one each time that a share of the minute has passed; others have their own."""
    now = [0.0]
    bucket = RequestRate(most=30, clock=lambda: now[0])
    assert [bucket.wait("a") for _ in range(30)] == [0.0] * 30
    assert bucket.wait("a") == pytest.approx(2.0)
    assert bucket.wait("b") == 0.0
    now[0] = 1.0
    assert bucket.wait("a") == pytest.approx(1.0)
    now[0] = 2.0
    assert [bucket.wait("a") > 0.0 for _ in range(2)] == [False, True]
    now[0] = 1000.0
    assert [bucket.wait("a") > 0.0 for _ in range(31)] == [False] * 30 + [True]


def test_who_asks_is_not_remembered_for_ever(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of too many the one that asked least lately is forgotten."""
    monkeypatch.setattr(request_rate, "MOST_KEYS", 2)
    bucket = RequestRate(most=1, clock=lambda: 0.0)
    assert [key for key in ("a", "b", "a", "c", "a", "b") if bucket.wait(key)] == ["a", "a"]


@pytest.mark.parametrize(("name", "ask"), LIMITS)
def test_a_session_that_asks_too_often_waits(
    name: str, ask: Callable[[Asked], Any], guarded: Callable[..., Asked], monkeypatch: pytest.MonkeyPatch
) -> None:
    """It is told for how long; another session of the same person is served."""
    monkeypatch.setattr(application, name, 1)
    asked = guarded("emma")
    assert ask(asked).status_code in {200, 201}
    answer = ask(asked)
    assert is_refused(answer, 429, "Too many requests")
    assert 0 < int(answer.headers["retry-after"]) <= 60
    assert ask(asked.enter("emma")).status_code != 429
