"""Who came in, who went and who was refused is in the audit, and no flood of refusals fills it."""

import asyncio
from collections.abc import Callable

import pytest
from starlette.requests import Request

from asked import Asked, is_refused
from fake_face import FakeFace
from faultbond.service.web import audit_trail
from faultbond.service.web.audit_trail import WINDOW, AuditTrail

FROM = {"address": "127.0.0.1"}
ASKED = Request({"type": "http", "method": "GET", "path": "/x", "client": ("10.0.0.7", 4), "headers": []})


def noted(face: FakeFace) -> list[tuple[str, str, dict[str, str]]]:
    """Give what, who and about of each entry."""
    return [(item.what, item.who, dict(item.about)) for item in face.noted]


def test_who_comes_and_goes_is_noted(guarded: Callable[..., Asked]) -> None:
    """A login and a logout are entries, with who it was and from where; no password is in any."""
    asked = guarded("otto")
    asked("POST", "/api/v1/logout")
    assert noted(asked.face) == [("login", "otto", FROM), ("logout", "otto", FROM)]
    assert all(item.at > 1e9 for item in asked.face.noted)


def test_where_nobody_logs_in_nobody_logs_out(local: Asked) -> None:
    """Who sits at the machine writes no entries by logging out of nothing."""
    assert local("POST", "/api/v1/logout").status_code == 200
    assert local.face.noted == []


def test_a_burst_of_failed_logins_is_two_entries(guarded: Callable[..., Asked]) -> None:
    """The first that failed, and the first that was not tried any more; another name has its own."""
    asked = guarded()
    for name in ("otto", "nobody"):
        for _ in range(8):
            asked("POST", "/api/v1/login", json={"name": name, "password": "wrong"})
    told = [(what, name, FROM) for name in ("otto", "nobody") for what in ("login failed", "logins refused")]
    assert noted(asked.face) == told


def test_who_asks_for_more_than_the_role_allows_is_noted(guarded: Callable[..., Asked]) -> None:
    """With what was asked for and the role that it takes, also where that hangs on the deed; once of many."""
    asked = guarded("viola")
    asked.do(action="acknowledge")
    asked("GET", "/api/v1/offline")
    asked.enter("otto")
    for _ in range(3):
        assert is_refused(asked.do(action="suppress"), 403)
    deed = {**FROM, "asked": "POST /api/v1/assets/tank_2/deeds"}
    assert [item for item in noted(asked.face) if item[0] != "login"] == [
        ("refused", "viola", {**deed, "needs": "operate"}),
        ("refused", "viola", {**FROM, "asked": "GET /api/v1/offline", "needs": "engineer"}),
        ("refused", "otto", {**deed, "needs": "engineer"}),
    ]


def test_a_flood_of_names_is_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """No more than so many refusals are noted in an hour, whoever they are of; after it they are again."""
    monkeypatch.setattr(audit_trail, "MOST_REFUSED", 3)
    now, face = [0.0], FakeFace()
    trail = AuditTrail(face, clock=lambda: now[0])

    def refused(*names: str) -> list[str]:
        face.noted.clear()
        for name in names:
            asyncio.run(trail.tell_refused("login failed", name, ASKED))
        return [item.who for item in face.noted]

    assert refused("a", "a", "b", "c", "d", "e") == ["a", "b", "c"]
    now[0] = WINDOW + 1.0
    assert refused("d", "a") == ["d", "a"]


def test_a_full_store_keeps_nobody_out(guarded: Callable[..., Asked], caplog: pytest.LogCaptureFixture) -> None:
    """Who looks why it is full has to come in; that it is not in the audit stands in the log."""
    asked = guarded()
    asked.face.is_full = True
    asked.enter("otto")
    assert asked("GET", "/api/v1/me").status_code == 200
    assert "login of 'otto' from 127.0.0.1 is not in the audit" in caplog.text
