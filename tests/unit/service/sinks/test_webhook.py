"""Records as posts: what a receiver gets, what it may answer, and that each is the same however often it comes."""

import asyncio
import base64
import hashlib
import hmac
import json
import ssl
from collections.abc import Iterator
from contextlib import suppress
from typing import Any

import pytest

from faultbond.errors import RefusedError, SinkError
from faultbond.service.contract.messages import NamedRecord
from faultbond.service.contract.sink import Sink
from faultbond.service.sinks import webhook
from faultbond.service.sinks.opening import open_sinks
from faultbond.service.sinks.options import SinkOptions
from receiver import Receiver, listening
from stored import told

SECRET = b"0123456789abcdef"
RECORD = told("pump", 7, candidates=[{"components": ["pümp"], "probability": 0.5, "sd": None}])


@pytest.fixture
def receiver() -> Iterator[Receiver]:
    with listening(Receiver()) as found:
        yield found


def hook(port: int, **more: Any) -> Sink:
    """A sink that posts there."""
    scheme = more.pop("scheme", "http")
    options = SinkOptions(name="tickets", to=f"{scheme}://127.0.0.1:{port}/hook?of=us", where="site.yaml:1", **more)
    (found,) = open_sinks([options], {})
    return found


def passed_on(sink: Sink, *records: NamedRecord) -> None:
    """Tell records."""

    async def all_of_it() -> None:
        async with sink.opened() as link:
            for record in records:
                await link.pass_on(record)

    asyncio.run(all_of_it())


def test_a_post_has_the_record_and_its_name(receiver: Receiver) -> None:
    """The body is a line of `serve --json`; two posts of a record have the same name and content."""
    passed_on(hook(receiver.port), RECORD, RECORD)
    (headers, body), (again, same) = receiver.taken
    assert json.loads(body) == {"record": "detection", "asset": "pump", "id": RECORD.id, **RECORD.content}
    assert headers["idempotency-key"] == headers["webhook-id"] == again["webhook-id"] == RECORD.id
    assert headers["content-type"] == "application/json"
    assert headers["host"] == f"127.0.0.1:{receiver.port}"
    assert body == same
    assert "webhook-signature" not in headers


def test_a_post_is_signed_as_standard_webhooks_has_it(receiver: Receiver, tmp_path: Any) -> None:
    """By name, time and body, with a secret as it stands in its file, or in Base64; and shows a token."""
    for kept in (SECRET, b"whsec_" + base64.b64encode(SECRET)):
        file, token = tmp_path / "secret", tmp_path / "token"
        file.write_bytes(kept + b"\n")
        token.write_text("let me in\n")
        passed_on(hook(receiver.port, secret_file=str(file), token_file=str(token)), RECORD)
    for headers, body in receiver.taken:
        signed = f"{headers['webhook-id']}.{headers['webhook-timestamp']}.".encode() + body
        expected = base64.b64encode(hmac.new(SECRET, signed, hashlib.sha256).digest()).decode()
        assert headers["webhook-signature"] == f"v1,{expected}"
        assert headers["authorization"] == "Bearer let me in"


@pytest.mark.parametrize("status", [301, 401, 404, 408, 429, 500, 503])
def test_what_is_no_success_is_to_be_tried_again(receiver: Receiver, status: int) -> None:
    """Also where somebody has to mend something first; the receiver says when."""
    receiver.answers, receiver.after = [status], "30"
    with pytest.raises(SinkError, match=rf"^http://127.0.0.1:{receiver.port}: it answered {status} ") as caught:
        passed_on(hook(receiver.port), RECORD)
    assert not isinstance(caught.value, RefusedError)
    assert caught.value.after == 30.0
    assert receiver.taken == []


@pytest.mark.parametrize("status", [400, 413, 415, 422])
def test_a_record_is_refused_for_what_it_is(receiver: Receiver, status: int) -> None:
    """Which is another thing than that the other side is not well."""
    receiver.answers = [status]
    with pytest.raises(RefusedError, match=str(status)):
        passed_on(hook(receiver.port), RECORD)


async def answers(text: bytes, *, then_waits: bool = False) -> list[bytes]:
    """Post to what answers with a text, and give the first lines of what it was asked."""
    asked = []

    async def answer(reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        asked.append((await reader.readuntil(b"\r\n\r\n")).splitlines()[0])
        writer.write(text)
        with suppress(ConnectionError):
            if then_waits:
                await reader.read()
        writer.close()

    async with await asyncio.start_server(answer, "127.0.0.1", 0) as server:
        port = server.sockets[0].getsockname()[1]
        async with hook(port).opened() as link:
            await link.pass_on(RECORD)
    return asked


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"", "0 bytes read"),
        (b"SSH-2.0-OpenSSH\r\n\r\n", "does not speak HTTP"),
        (b"HTTP/1.1 abc\r\n\r\n", "does not speak HTTP"),
        (b"HTTP/1.1 204 No Content\r\n", "bytes read"),
        (b"HTTP/1.1 204 No\r\nA: " + b"x" * 100_000 + b"\r\n\r\n", "limit"),
    ],
)
def test_what_does_not_answer_as_it_should_is_lost(text: bytes, words: str) -> None:
    """One line of why, and no record counts as told."""
    with pytest.raises(SinkError, match=words):
        asyncio.run(answers(text))


def test_an_answer_is_taken_without_its_body_and_after_one_on_the_way() -> None:
    """Nobody waits for what is not read, and the record is told once; what counts is the answer behind that."""
    on_the_way = b"HTTP/1.1 100 Continue\r\n\r\nHTTP/1.1 %s\r\nContent-Length: 9999\r\n\r\n"
    assert asyncio.run(answers(on_the_way % b"200 OK", then_waits=True)) == [b"POST /hook?of=us HTTP/1.1"]
    with pytest.raises(SinkError, match="it answered 503 Busy"):
        asyncio.run(answers(on_the_way % b"503 Busy", then_waits=True))


def test_who_does_not_answer_is_not_waited_for(monkeypatch: pytest.MonkeyPatch) -> None:
    """For longer than some seconds."""
    monkeypatch.setattr(webhook, "TIMEOUT", 0.2)
    with pytest.raises(SinkError, match="no answer in time"):
        asyncio.run(answers(b"HTTP/1.1 ", then_waits=True))


def test_nobody_there_is_told_in_a_line(receiver: Receiver) -> None:
    """With the address, without its path, in which secrets may be."""
    with pytest.raises(SinkError, match=r"^http://127.0.0.1:1: Connection refused"):
        passed_on(hook(1), RECORD)


def test_a_receiver_is_known_by_its_certificate(receiver: Receiver) -> None:
    """What cannot show one that is trusted is told nothing."""
    with pytest.raises(SinkError, match=r"(?i)ssl|wrong version"):
        passed_on(hook(receiver.port, scheme="https"), RECORD)
    sink = hook(receiver.port, scheme="https")
    assert sink._hook.tls.verify_mode is ssl.CERT_REQUIRED  # type: ignore[attr-defined]
    assert receiver.seen == 0
