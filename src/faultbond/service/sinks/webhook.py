"""Webhook: each record is a POST to another program, signed where there is a secret.

The headers are those of Standard Webhooks, by which receivers check the signature, and the name of the record once more
as Idempotency-Key: who has seen it before has nothing to do.
Source: standardwebhooks.com, specification 1.0.0; RFC 9112 for the message.
"""

import asyncio
import base64
import hashlib
import hmac
import json
import ssl
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

from faultbond.errors import RefusedError, SinkError, reason_of
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord

TIMEOUT = 10.0  # s for all of a POST
REFUSALS = frozenset({400, 413, 415, 422})  # of this record; all other answers may be others later
LARGEST_HEAD = 2**16  # bytes of an answer before its body, which nobody reads


@dataclass(frozen=True, slots=True, kw_only=True)
class Hook:
    """Where records go.

    named: the host as the address has it. path: with its query; like that it may be a secret, and is not in `shown`.
    token: of the Authorization header. secret: of signatures.
    """

    host: str
    port: int
    named: str
    path: str
    shown: str
    tls: ssl.SSLContext | None = None
    token: str = ""
    secret: bytes = b""


class Webhook:
    """A sink of records over HTTP.

    Parameters
    ----------
    name : what the site calls it
    hook : where they go
    kinds : of records
    give_up : s without success after which a record is passed over; None: never
    """

    shows = False

    def __init__(self, name: str, hook: Hook, *, kinds: frozenset[str], give_up: float | None = None) -> None:
        self.name, self.address, self.kinds, self.give_up = name, hook.shown, kinds, give_up
        self._hook = hook

    @asynccontextmanager
    async def opened(self) -> AsyncIterator["WebhookLink"]:
        """Give the way; nothing is connected before there is something to tell."""
        yield WebhookLink(self._hook)


class WebhookLink:
    """See `contract.sink.Link`."""

    def __init__(self, hook: Hook) -> None:
        self._hook = hook

    async def show(self, summary: Shown) -> None:
        """Tell nothing: who wants to know how assets stand asks."""

    async def lost(self) -> None:
        """Wait for ever: there is no connection between two records."""
        await asyncio.Event().wait()

    async def pass_on(self, record: NamedRecord) -> None:
        """Post a record.

        Raises
        ------
        SinkError
            Where the other side cannot be reached, or does not say that it has it.
        RefusedError
            Where it refuses this record for what it is.
        """
        hook = self._hook
        try:
            async with asyncio.timeout(TIMEOUT):
                answer = await _answer(hook, request(hook, record, time.time()))
        except (OSError, EOFError, ValueError, asyncio.LimitOverrunError) as error:
            raise SinkError(f"{hook.shown}: {reason_of(error)}.") from error
        status = answer.status
        if 200 <= status < 300:
            return
        told = f"{hook.shown}: it answered {status}{f' {answer.reason}' if answer.reason else ''}."
        if status in REFUSALS:
            raise RefusedError(told)
        if 300 <= status < 400:
            told += " Name the address to which it wants to send us."
        raise SinkError(told, after=answer.after)


def request(hook: Hook, record: NamedRecord, now: float) -> bytes:
    """Give the message of a record; now: Unix s.

    The body has the record as `serve --json` writes it. The signature is HMAC-SHA256 of name, time and body.
    """
    body = json.dumps(record.told(), ensure_ascii=False, allow_nan=False, separators=(",", ":")).encode()
    stamp = f"{now:.0f}"
    headers = {
        "Host": hook.named,
        "User-Agent": "faultbond",
        "Content-Type": "application/json",
        "Content-Length": str(len(body)),
        "Idempotency-Key": record.id,
        "webhook-id": record.id,
        "webhook-timestamp": stamp,
        "Connection": "close",
    }
    if hook.secret:
        found = hmac.digest(hook.secret, f"{record.id}.{stamp}.".encode() + body, hashlib.sha256)
        headers["webhook-signature"] = f"v1,{base64.b64encode(found).decode()}"
    if hook.token:
        headers["Authorization"] = f"Bearer {hook.token}"
    lines = [f"POST {hook.path} HTTP/1.1", *(f"{name}: {value}" for name, value in headers.items()), "", ""]
    return "\r\n".join(lines).encode() + body


@dataclass(frozen=True, slots=True, kw_only=True)
class _Answer:
    """What came back. after: s for which it wants to be left alone."""

    status: int
    reason: str
    after: float


async def _answer(hook: Hook, message: bytes) -> _Answer:
    """Send a message and give the answer; an answer on the way to one is passed over."""
    reader, writer = await asyncio.open_connection(hook.host, hook.port, ssl=hook.tls, limit=LARGEST_HEAD)
    try:
        writer.write(message)
        with suppress(ConnectionError):  # it may have answered before it read all
            await writer.drain()
        while True:
            found = _parsed(await reader.readuntil(b"\r\n\r\n"))
            if found.status >= 200:
                return found
    finally:
        writer.transport.abort()  # all was said; a farewell could last
        with suppress(OSError):
            await writer.wait_closed()


def _parsed(head: bytes) -> _Answer:
    """Give what the head of an answer says.

    Raises
    ------
    ValueError
        Where it is none.
    """
    first, *lines = head.decode("latin-1").split("\r\n")
    protocol, _, rest = first.partition(" ")
    status, _, reason = rest.partition(" ")
    if not (protocol.startswith("HTTP/1.") and len(status) == 3 and status.isdecimal()):
        raise ValueError("what answers there does not speak HTTP/1.1")
    after = next((line.partition(":")[2].strip() for line in lines if line.lower().startswith("retry-after:")), "")
    return _Answer(status=int(status), reason=reason.strip()[:100], after=float(after) if after.isdecimal() else 0.0)
