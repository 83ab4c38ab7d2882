"""Who may ask for `/metrics`, and in which form it comes."""

from collections.abc import Callable

import pytest

from asked import Asked
from fake_face import FakeFace
from faultbond.service.web.application import application
from faultbond.service.web.security import LoginGuard, Role

TOKEN = "let me in, please"  # noqa: S105 - of a test


@pytest.fixture
def measured(users: dict[str, tuple[str, Role]]) -> Asked:
    """An application behind a login that knows a token."""
    asked = Asked(FakeFace(), LoginGuard(users=users))
    asked.app = application(asked.face, asked.guard, metrics_token=TOKEN)
    return asked


def test_it_comes_as_open_metrics(local: Asked) -> None:
    """With its media type, and packed where that is taken."""
    answer = local("GET", "/metrics")
    assert answer.headers["content-type"] == "application/openmetrics-text; version=1.0.0; charset=utf-8"
    assert answer.text == "# TYPE viewers gauge\nviewers 0\n# EOF\n"
    assert answer.headers["content-encoding"] == "gzip"
    assert "content-encoding" not in local("GET", "/metrics", headers={"accept-encoding": "identity"}).headers


@pytest.mark.parametrize("shown", ["", "Bearer let me in", "Bearer ", f"Basic {TOKEN}", f"Bearer {TOKEN}x", "Bearer ä"])
def test_who_shows_no_token_is_refused(measured: Asked, shown: str) -> None:
    """In the one shape, with the way in."""
    answer = measured("GET", "/metrics", headers={"authorization": shown.encode("latin-1")} if shown else {})  # type: ignore[dict-item]
    assert (answer.status_code, answer.json()["status"], answer.headers["www-authenticate"]) == (401, 401, "Bearer")


def test_who_shows_the_token_measures_and_does_nothing_else(measured: Asked) -> None:
    """A person of any role needs none."""
    shown = {"authorization": f"Bearer {TOKEN}"}
    assert measured("GET", "/metrics", headers=shown).status_code == 200
    assert measured("GET", "/api/v1/site", headers=shown).status_code == 401
    assert measured.enter("viola")("GET", "/metrics").status_code == 200


def test_without_a_token_of_the_site_none_is_right(guarded: Callable[..., Asked]) -> None:
    """Not even an empty one."""
    for shown in ("Bearer", "Bearer ", "bearer  "):
        assert guarded()("GET", "/metrics", headers={"authorization": shown}).status_code == 401
