"""Who may do what on the page: roles, passwords, sessions. No web framework is needed here.

On the loopback address nobody logs in, and who can open the page may do all. Elsewhere people log in by name and
password; what is kept of a password is its scrypt hash, and of a session its hash.
"""

import hashlib
import hmac
import secrets
import time
from base64 import b64decode, b64encode
from collections import deque
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from enum import IntEnum
from typing import Protocol

from faultbond.errors import FaultbondError
from faultbond.service.contract.messages import Action

SCRYPT_N = 1 << 15  # with r 8 and p 3: 32 MiB and some 0.2 s a try, as OWASP's password storage sheet asks
SCRYPT_R = 8
SCRYPT_P = 3
SCRYPT_MEMORY = 1 << 26  # bytes that a stored hash may ask for
SALT = 16  # bytes
LIFETIME = 12 * 3600.0  # s without a request or an open page after which a session ends; a shift
MOST_SESSIONS = 1000  # the one that was used least lately goes first
WINDOW = 300.0  # s in which failed logins count
FAILURES_OF_NAME = 5  # in that time, of one name from one address
FAILURES_OF_ADDRESS = 20
MOST_ADDRESSES = 10_000  # of which failures are remembered
LONGEST_PASSWORD = 1000  # characters


class Role(IntEnum):
    """What a person may do; each role may do what the ones before it may."""

    VIEW = 1
    OPERATE = 2
    ENGINEER = 3


ENGINEERS = frozenset({Action.SUPPRESS, Action.UNSUPPRESS, Action.OUT_OF_SERVICE, Action.IN_SERVICE})


def needed(action: Action) -> Role:
    """Give the role that an action needs: what silences an asset for good is an engineer's, all else an operator's."""
    return Role.ENGINEER if action in ENGINEERS else Role.OPERATE


@dataclass(frozen=True, slots=True, kw_only=True)
class Person:
    """Who asks. token: must come with every deed, so that no other page can make the browser do one."""

    name: str
    role: Role
    token: str

    def actions(self) -> list[str]:
        """Give what this person may do, as words of the interface."""
        return [action.value for action in Action if self.role >= needed(action)]


class TooManyTriesError(FaultbondError):
    """Logins are refused for a while. The argument is for how many seconds."""

    def __init__(self, seconds: float) -> None:
        super().__init__(f"Too many failed logins. Try again in {seconds:.0f} s.")
        self.seconds = seconds


class Guard(Protocol):
    """Knows who asks."""

    @property
    def asks_login(self) -> bool:
        """Whether people log in."""

    def who(self, session: str | None) -> Person | None:
        """Give the person of a session, the value of the cookie; None where there is none."""

    def login(self, name: str, password: str, address: str) -> str | None:
        """Begin a session and give its cookie; None where name and password do not belong together. Slow by intent.

        Raises
        ------
        TooManyTriesError
            Where there were too many failures lately.
        """

    def logout(self, session: str | None) -> None:
        """End a session."""


class LocalGuard:
    """Guard of the loopback address: who is on this machine is an engineer."""

    asks_login = False

    def __init__(self) -> None:
        self._person = Person(name="local", role=Role.ENGINEER, token=secrets.token_urlsafe())

    def who(self, session: str | None) -> Person | None:
        """Give the one person that there is."""
        return self._person

    def login(self, name: str, password: str, address: str) -> str | None:
        """Refuse: there is nobody to log in."""
        return None

    def logout(self, session: str | None) -> None:
        """Do nothing."""


def hashed(password: str, salt: bytes | None = None) -> str:
    """Give the hash of a password as it is kept: `scrypt$N$r$p$salt$hash`.

    Example
    -------
    >>> matches("correct horse", hashed("correct horse")), matches("Correct horse", hashed("correct horse"))
    (True, False)
    """
    salt = secrets.token_bytes(SALT) if salt is None else salt
    found = _scrypt(password, salt, SCRYPT_N, SCRYPT_R, SCRYPT_P)
    return f"scrypt${SCRYPT_N}${SCRYPT_R}${SCRYPT_P}${b64encode(salt).decode()}${b64encode(found).decode()}"


def matches(password: str, kept: str) -> bool:
    """Tell whether a password is the one of a hash, in a time that does not tell how near it came.

    Raises
    ------
    FaultbondError
        Where the hash is not one that `hashed` gave.
    """
    salt, wanted, n, r, p = _parsed(kept)
    return hmac.compare_digest(_scrypt(password, salt, n, r, p), wanted)


def check_hash(kept: str) -> None:
    """Refuse what is not a hash that `hashed` gave.

    Raises
    ------
    FaultbondError
        Where it is not one.
    """
    _parsed(kept)


def _parsed(kept: str) -> tuple[bytes, bytes, int, int, int]:
    try:
        kind, n, r, p, salt, found = kept.split("$")
        numbers = int(n), int(r), int(p)
        parts = b64decode(salt, validate=True), b64decode(found, validate=True)
    except ValueError:
        raise FaultbondError("A password's hash is to read scrypt$N$r$p$salt$hash. Make one anew.") from None
    fits = 128 * numbers[0] * numbers[1] <= SCRYPT_MEMORY // 2 and numbers[2] <= 16 and len(parts[1]) == 32
    if kind != "scrypt" or not fits or min(numbers) < 1 or numbers[0] < 2 or numbers[0] & (numbers[0] - 1):
        raise FaultbondError("A password's hash has numbers that scrypt does not take here. Make one anew.")
    return *parts, *numbers


def _scrypt(password: str, salt: bytes, n: int, r: int, p: int) -> bytes:
    return hashlib.scrypt(
        password.encode("utf-8", "surrogatepass"), salt=salt, n=n, r=r, p=p, maxmem=SCRYPT_MEMORY, dklen=32
    )


@dataclass(slots=True, kw_only=True)
class _Session:
    person: Person
    used: float


@dataclass(slots=True, kw_only=True)
class LoginGuard:
    """Guard of people with passwords.

    users: hash of the password, as `hashed` gives it, and role, by name. clock: seconds that only grow.
    """

    users: Mapping[str, tuple[str, Role]]
    clock: Callable[[], float] = time.monotonic
    lifetime: float = LIFETIME
    asks_login: bool = field(default=True, init=False)
    _sessions: dict[str, _Session] = field(default_factory=dict, init=False, repr=False)
    _failures: dict[tuple[str, ...], deque[float]] = field(default_factory=dict, init=False, repr=False)
    _nobody: str = field(default="", init=False, repr=False)

    def __post_init__(self) -> None:
        for kept, _ in self.users.values():
            check_hash(kept)
        self._nobody = hashed(secrets.token_urlsafe())  # who is not known takes as long as who is

    def who(self, session: str | None) -> Person | None:
        """Give the person of a session that has not ended, and go on with it."""
        key = _digest(session or "")
        found = self._sessions.get(key)
        if found is None:
            return None
        now = self.clock()
        if now - found.used > self.lifetime:
            del self._sessions[key]
            return None
        found.used = now
        return found.person

    def login(self, name: str, password: str, address: str) -> str | None:
        """Begin a session, or remember that this failed."""
        now = self.clock()
        limits = {(address, name): FAILURES_OF_NAME, (address,): FAILURES_OF_ADDRESS}
        for key, most in limits.items():
            self._check_tries(key, most, now)
        kept, role = self.users.get(name, (self._nobody, Role.VIEW))
        is_right = len(password) <= LONGEST_PASSWORD and matches(password, kept)
        if not is_right or name not in self.users:
            self._remember_failure(limits, now)
            return None
        self._failures.pop((address, name), None)
        session = secrets.token_urlsafe()
        while len(self._sessions) >= MOST_SESSIONS:
            del self._sessions[min(self._sessions, key=lambda key: self._sessions[key].used)]
        person = Person(name=name, role=role, token=secrets.token_urlsafe())
        self._sessions[_digest(session)] = _Session(person=person, used=now)
        return session

    def logout(self, session: str | None) -> None:
        """End a session, so that its cookie is worth nothing."""
        self._sessions.pop(_digest(session or ""), None)

    def _check_tries(self, key: tuple[str, ...], most: int, now: float) -> None:
        times = self._failures.get(key)
        while times and now - times[0] > WINDOW:
            times.popleft()
        if times and len(times) >= most:
            raise TooManyTriesError(max(1.0, WINDOW - (now - times[0])))

    def _remember_failure(self, keys: Mapping[tuple[str, ...], int], now: float) -> None:
        for key, most in keys.items():
            self._failures.setdefault(key, deque(maxlen=most)).append(now)
        while len(self._failures) > MOST_ADDRESSES:
            del self._failures[next(iter(self._failures))]


def _digest(session: str) -> str:
    """Give what is kept of a session: who reads the memory of the service cannot go on with it."""
    return hashlib.sha256(session.encode("utf-8", "surrogatepass")).hexdigest()
