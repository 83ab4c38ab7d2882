"""Passwords, sessions and failed logins."""

import time

import pytest

from faultbond.errors import FaultbondError
from faultbond.service.contract.messages import Action
from faultbond.service.web import security
from faultbond.service.web.security import (
    FAILURES_OF_ADDRESS,
    FAILURES_OF_NAME,
    WINDOW,
    LoginGuard,
    Role,
    TooManyTriesError,
    hashed,
    matches,
    needed,
)


class Clock:
    """A clock that stands until it is moved."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


@pytest.fixture(autouse=True)
def _cheap(monkeypatch: pytest.MonkeyPatch) -> None:
    """Hashes that take no time; the usual ones are asked for below."""
    monkeypatch.setattr(security, "SCRYPT_N", 16)


@pytest.fixture
def clock() -> Clock:
    """The time of the guard."""
    return Clock()


@pytest.fixture
def guard(clock: Clock) -> LoginGuard:
    """A guard who knows two people."""
    users = {"otto": (hashed("hands on"), Role.OPERATE), "emma": (hashed("all of it"), Role.ENGINEER)}
    return LoginGuard(users=users, clock=clock)


def test_a_password_is_known_by_its_hash() -> None:
    """The right password fits, another does not, and two hashes of one password differ by their salt."""
    kept = hashed("pässwörd \ud800")
    assert matches("pässwörd \ud800", kept)
    assert not matches("passwörd \ud800", kept)
    assert kept != hashed("pässwörd \ud800")
    assert kept.startswith("scrypt$16$8$3$")


def test_the_usual_hash_costs_something(monkeypatch: pytest.MonkeyPatch) -> None:
    """To try a password takes the memory and time that the scheme asks for."""
    monkeypatch.undo()
    start = time.perf_counter()
    assert hashed("a").startswith("scrypt$32768$8$3$")
    assert time.perf_counter() - start > 0.02


@pytest.mark.parametrize(
    "kept",
    [
        "",
        "plain",
        "scrypt$16$8$1$AAAA",
        "bcrypt$16$8$1$AAAA$" + 43 * "A" + "=",
        "scrypt$15$8$1$AAAA$" + 43 * "A" + "=",
        "scrypt$16$8$1$AAAA$AAAA",
        "scrypt$1048576$8$1$AAAA$" + 43 * "A" + "=",
        "scrypt$16$8$1000$AAAA$" + 43 * "A" + "=",
        "scrypt$-16$8$1$AAAA$" + 43 * "A" + "=",
        "scrypt$16$8$1$%%%%$" + 43 * "A" + "=",
    ],
)
def test_what_is_no_hash_is_refused_at_the_start(kept: str) -> None:
    """A guard does not begin with a hash that is none, or that would take all memory."""
    with pytest.raises(FaultbondError, match="A password's hash"):
        LoginGuard(users={"otto": (kept, Role.VIEW)})


def test_a_session_ends_when_nobody_uses_it(guard: LoginGuard, clock: Clock) -> None:
    """A session goes on while it is used, and ends a shift behind the last use."""
    session = guard.login("otto", "hands on", "10.0.0.7")
    clock.now += 0.9 * guard.lifetime
    assert guard.who(session).name == "otto"  # type: ignore[union-attr]
    clock.now += 0.9 * guard.lifetime
    assert guard.who(session) is not None
    clock.now += 1.1 * guard.lifetime
    assert guard.who(session) is None
    assert guard.who(None) is guard.who("") is guard.who("\ud800") is None


def test_sessions_are_bounded(guard: LoginGuard, clock: Clock, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of too many sessions the one that was used least lately ends, and no session is kept in clear."""
    monkeypatch.setattr(security, "MOST_SESSIONS", 2)
    sessions = []
    for _ in range(3):
        clock.now += 1.0
        sessions.append(guard.login("otto", "hands on", "10.0.0.7"))
    assert [guard.who(item) is not None for item in sessions] == [False, True, True]
    assert not set(sessions) & set(guard._sessions)


def test_failures_of_a_name_count_by_address(guard: LoginGuard, clock: Clock) -> None:
    """After some failures a name is not tried from there, not even with the right password; elsewhere it is."""
    for _ in range(FAILURES_OF_NAME):
        assert guard.login("otto", "wrong", "10.0.0.7") is None
    with pytest.raises(TooManyTriesError, match="Try again in 300 s"):
        guard.login("otto", "hands on", "10.0.0.7")
    assert guard.login("otto", "hands on", "10.0.0.8") is not None
    assert guard.login("emma", "all of it", "10.0.0.7") is not None
    clock.now += WINDOW + 1.0
    assert guard.login("otto", "hands on", "10.0.0.7") is not None


def test_failures_of_an_address_count_over_names(guard: LoginGuard) -> None:
    """Who tries many names from one address is stopped too."""
    for k in range(FAILURES_OF_ADDRESS):
        assert guard.login(f"name{k}", "wrong", "10.0.0.7") is None
    with pytest.raises(TooManyTriesError):
        guard.login("emma", "all of it", "10.0.0.7")


def test_failures_are_remembered_of_a_bounded_number(guard: LoginGuard, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who fails under ever new names does not fill the memory."""
    monkeypatch.setattr(security, "MOST_ADDRESSES", 10)
    for k in range(30):
        guard.login("x", "wrong", f"10.0.0.{k}")
    assert len(guard._failures) == 10


def test_an_unknown_name_is_hashed_too(guard: LoginGuard, monkeypatch: pytest.MonkeyPatch) -> None:
    """Whether there is a name cannot be told by how long the answer takes."""
    asked = []

    def compared(password: str, kept: str) -> bool:
        asked.append(kept)
        return False

    monkeypatch.setattr(security, "matches", compared)
    guard.login("nobody", "x", "a")
    guard.login("otto", "x", "a")
    assert [kept.split("$")[:4] for kept in asked] == [["scrypt", "16", "8", "3"]] * 2


def test_roles_hold_what_the_lower_ones_hold() -> None:
    """Nobody acts by looking, and each action belongs to operators or to engineers."""
    assert {needed(action) for action in Action} == {Role.OPERATE, Role.ENGINEER}
    assert needed(Action.ACKNOWLEDGE) < needed(Action.SUPPRESS)
