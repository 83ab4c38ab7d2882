"""People and applications that tests of the page share; skipped where the parts of the service are absent."""

from collections.abc import Callable

import pytest

pytest.importorskip("httpx", reason="there is no httpx: pip install httpx")
pytest.importorskip("fastapi", reason='there is no fastapi: pip install "faultbond[serve]"')

from asked import PASSWORDS, Asked
from fake_face import FakeFace
from faultbond.service.web import security
from faultbond.service.web.security import LocalGuard, LoginGuard, Role, hashed


@pytest.fixture
def users(monkeypatch: pytest.MonkeyPatch) -> dict[str, tuple[str, Role]]:
    """People with each role, with hashes that take no time."""
    monkeypatch.setattr(security, "SCRYPT_N", 16)
    return {name: (hashed(password), role) for name, (password, role) in PASSWORDS.items()}


@pytest.fixture
def local() -> Asked:
    """The application on the loopback address, and who sits there."""
    return Asked(FakeFace(), LocalGuard()).enter()


@pytest.fixture
def guarded(users: dict[str, tuple[str, Role]]) -> Callable[..., Asked]:
    """The application behind a login, and somebody who is in, or nobody."""

    def made(name: str | None = None) -> Asked:
        asked = Asked(FakeFace(), LoginGuard(users=users))
        return asked.enter(name) if name else asked

    return made
