"""The interface of the off-line desk: who may, what is taken, and what comes back."""

import asyncio
import hashlib
import json
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import Any

import pytest

from asked import Asked, is_refused
from fake_desk import LARGEST, REPORT, FakeDesk
from faultbond.service.contract.messages import AuditEntry
from faultbond.service.offline.desk import OfflineDesk
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.web.application import application
from faultbond.service.web.offline_shapes import FileShape, JobShape, OfflineShape
from faultbond.service.web.route_parts import TOKEN
from faultbond.service.web.security import LocalGuard
from faultbond.service.web.shapes import MeShape
from faultbond.service.web.shield import POLICY, REPORT_POLICY

DESK = "/api/v1/offline"
BYTES = {"content-type": "application/octet-stream"}
JOB = f"{DESK}/jobs/{1:016x}"
ALL = [
    ("GET", DESK),
    ("POST", f"{DESK}/files?name=a.csv&kind=recording"),
    ("POST", f"{DESK}/jobs"),
    ("GET", JOB),
    ("DELETE", JOB),
    *(("GET", f"{JOB}/{what}") for what in ("report", "records", "analysis")),
]


def bring(
    asked: Asked, content: Any = b"time,flow\n0,1\n", name: str = "a.csv", kind: str = "recording", **told: Any
) -> Any:
    """Bring a file."""
    headers = BYTES | told.pop("headers", {})
    return asked("POST", f"{DESK}/files", params={"name": name, "kind": kind}, content=content, headers=headers)


def test_its_answers_have_the_shapes_that_it_describes(local: Asked) -> None:
    """What is given of all analyses fits the description, and the newest comes first."""
    told = OfflineShape.model_validate(local("GET", DESK).json(), strict=True)
    assert [item.id for item in told.jobs] == list(reversed(local.desk.jobs))
    for item in told.jobs:
        assert JobShape.model_validate(local("GET", f"{DESK}/jobs/{item.id}").json(), strict=True) == item
    assert {item.state for item in told.jobs} == {"waiting", "at work", "done", "failed", "stopped", "cut off"}


def test_a_real_desk_answers_in_the_same_shapes(tmp_path: Path) -> None:
    """A desk that is no fake gives the shapes, and what cannot be noted or is too much is refused with its status."""
    noted = []

    async def note(entry: AuditEntry) -> None:
        noted.append(entry)

    asked = Asked.__new__(Asked)
    asked.guard, asked.cookies, asked.token = LocalGuard(), {}, None
    desk = OfflineDesk(OfflineLimits(folder=str(tmp_path / "desk"), upload=2000, queue=1), {}, note)
    asked.app = application(FakeFaceless(), asked.guard, desk=desk)  # type: ignore[arg-type]
    asked.enter()
    model = FileShape.model_validate(bring(asked, b"name: x\n", "m.yaml", "model").json(), strict=True)
    for status in (201, 429):
        recording = FileShape.model_validate(bring(asked).json(), strict=True)
        answer = asked("POST", f"{DESK}/jobs", json={"recording": recording.id, "model": model.id})
        assert answer.status_code == status
        if status == 201:
            job = JobShape.model_validate(answer.json(), strict=True)
            model = FileShape.model_validate(bring(asked, b"name: x\n", "m.yaml", "model").json(), strict=True)
    OfflineShape.model_validate(asked("GET", DESK).json(), strict=True)
    assert (job.place, job.files[1].name) == (1, "m.yaml")
    assert is_refused(bring(asked, b"x" * 2001), 413, "2 kB at most")
    assert is_refused(asked("POST", f"{DESK}/jobs", json={"recording": recording.id, "asset": "pump"}), 429)
    assert asked("DELETE", f"{DESK}/jobs/{job.id}").json() == {"ok": True}
    assert is_refused(asked("GET", f"{DESK}/jobs/{job.id}"), 404)
    assert is_refused(asked("POST", f"{DESK}/jobs", json={"recording": recording.id, "asset": "pump"}), 404)
    assert [item.what for item in noted] == ["upload", "upload", "analysis", "upload", "upload", "removal"]


class FakeFaceless:
    """A service of which nothing is asked here."""


def test_a_file_is_brought_and_ordered(local: Asked) -> None:
    """A file goes as it is, comes back with its digest, and an order takes it with who gave it."""
    content = b"time,flow\n0,1\n"
    answer = bring(local, content, "Anlage 7.csv")
    told = FileShape.model_validate(answer.json(), strict=True)
    assert (answer.status_code, told.name, told.size) == (201, "Anlage 7.csv", len(content))
    assert told.sha256 == hashlib.sha256(content).hexdigest()
    answer = local("POST", f"{DESK}/jobs", json={"recording": told.id, "asset": "tank_1", "analyse": True})
    assert (answer.status_code, JobShape.model_validate(answer.json(), strict=True).state) == (201, "waiting")
    order = local.desk.ordered[-1]
    assert (order.who, order.asset, order.model, order.analyse) == ("local", "tank_1", "", True)


def test_results_come_as_they_are(local: Asked) -> None:
    """A report runs as a stranger, records are lines, and what there is not is not there."""
    report = local("GET", f"{JOB}/report")
    assert (report.text, report.headers["content-type"]) == (REPORT, "text/html; charset=utf-8")
    assert report.headers["content-security-policy"] == REPORT_POLICY
    records = local("GET", f"{JOB}/records")
    assert [json.loads(line) for line in records.text.splitlines()] == [{"record": "end"}]
    assert records.headers["content-disposition"].startswith("attachment")
    assert records.headers["content-security-policy"] == POLICY
    assert records.headers["x-content-type-options"] == "nosniff"
    assert local("GET", f"{JOB}/analysis").headers["content-type"] == "text/plain; charset=utf-8"
    for path in (f"{DESK}/jobs/{2:016x}/analysis", f"{DESK}/jobs/{3:016x}/report", f"{DESK}/jobs/{99:016x}/report"):
        assert is_refused(local("GET", path), 404)


@pytest.mark.parametrize(("method", "path"), ALL)
@pytest.mark.parametrize(("name", "status"), [(None, 401), ("viola", 403), ("otto", 403)])
def test_it_is_an_engineers(
    guarded: Callable[..., Asked], name: str | None, status: int, method: str, path: str
) -> None:
    """Who is not logged in, who may only look, and an operator see nothing of it and do nothing."""
    asked = guarded(name)
    before = dict(asked.desk.jobs)
    content = json.dumps({"recording": "0" * 16, "asset": "tank_1"}).encode()
    headers = {"content-type": "application/json"} if path.endswith("jobs") else BYTES
    told: dict[str, Any] = {} if method == "GET" else {"content": content, "headers": headers}
    answer = asked(method, path, **told)
    assert is_refused(answer, status)
    assert (asked.desk.files, asked.desk.jobs, asked.desk.ordered) == ({}, before, [])
    assert "plant-2026" not in answer.text


def test_who_may_is_told_so(guarded: Callable[..., Asked]) -> None:
    """The page knows who may, and that nobody may where there is no desk."""
    for name, may in (("viola", False), ("otto", False), ("emma", True)):
        assert MeShape.model_validate(guarded(name)("GET", "/api/v1/me").json(), strict=True).may_analyse is may
    without = guarded("emma")
    without.app = application(without.face, without.guard)
    assert without("GET", "/api/v1/me").json()["may_analyse"] is False
    assert is_refused(without("GET", DESK), 404)


@pytest.mark.parametrize(("method", "path"), [item for item in ALL if item[0] != "GET"])
@pytest.mark.parametrize("headers", [{TOKEN: ""}, {TOKEN: "x"}, {"origin": "http://evil.example"}])
def test_what_changes_something_comes_from_our_page(
    local: Asked, method: str, path: str, headers: dict[str, str]
) -> None:
    """Without the token, with another, or from a page of another site nothing is taken, ordered or removed."""
    kind = {"content-type": "application/json"} if path.endswith("jobs") else BYTES
    before = dict(local.desk.jobs)
    content = json.dumps({"recording": "0" * 16, "asset": "tank_1"}).encode()
    assert is_refused(local(method, path, content=content, headers=kind | headers), 403)
    assert (local.desk.files, local.desk.jobs) == ({}, before)


@pytest.mark.parametrize(
    ("told", "status", "text"),
    [
        ({"name": "a.exe"}, 415, "A recording is a file that ends in .csv"),
        ({"name": "a.csv", "kind": "model"}, 415, "A model is a file that ends in .yaml"),
        ({"name": "../a.csv", "kind": "table"}, 415, "The name of a table is plain"),
        ({"name": ""}, 422, "name"),
        ({"name": "a" * 201}, 422, "name"),
        ({"name": "a\0.csv"}, 422, "control characters"),
        ({"kind": "program"}, 422, "kind"),
        ({"content": b""}, 409, "It is empty"),
        ({"content": b"x" * (LARGEST + 1)}, 413, "at most"),
        ({"headers": {"content-type": "text/csv"}}, 415, "Send the file as application/octet-stream"),
        ({"headers": {"content-type": "multipart/form-data; boundary=x"}}, 415, "octet-stream"),
    ],
)
def test_what_is_no_such_file_is_refused(local: Asked, told: dict[str, Any], status: int, text: str) -> None:
    """A wrong name, kind, size or type of body is refused in one sentence."""
    assert is_refused(bring(local, **told), status, text)
    assert local.desk.files == {}


@pytest.mark.parametrize(
    ("order", "status", "text"),
    [
        ({}, 422, "recording"),
        ({"recording": "x"}, 422, "recording"),
        ({"recording": "0" * 16}, 422, "takes the model of an `asset`"),
        ({"recording": "0" * 16, "asset": "a", "model": "1" * 16}, 422, "takes the model of an `asset`"),
        ({"recording": "0" * 16, "asset": "a", "tables": ["1" * 16]}, 422, "`tables` belong"),
        ({"recording": "0" * 16, "model": "1" * 16, "tables": ["1" * 16] * 11}, 422, "tables"),
        ({"recording": "0" * 16, "asset": "tank_1", "path": "/etc/passwd"}, 422, "path"),
        ({"recording": "0" * 16, "asset": "tank_1"}, 404, "no such file"),
    ],
)
def test_what_is_no_order_is_refused(local: Asked, order: dict[str, Any], status: int, text: str) -> None:
    """An order without a recording, with no model or two, or with more than that is refused in one sentence."""
    assert is_refused(local("POST", f"{DESK}/jobs", json=order), status, text)


def test_a_body_is_not_read_beyond_what_may_come(local: Asked) -> None:
    """Of a body without end no more is taken than a file may have; an order's is small."""
    sent = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal sent
        for _ in range(100_000):
            sent += 1000
            yield b"x" * 1000

    assert is_refused(bring(local, endless()), 413)
    assert sent <= 20 * LARGEST
    order = json.dumps({"recording": "0" * 16, "asset": "x" * 70_000})
    assert is_refused(local("POST", f"{DESK}/jobs", content=order, headers={"content-type": "application/json"}), 413)


def test_what_cannot_be_kept_says_why(local: Asked) -> None:
    """Where the store cannot be written nothing is taken, begun or removed, and the sentence of the store comes."""
    recording = bring(local).json()["id"]
    local.desk.is_full = True
    assert is_refused(bring(local), 503, "the disk is full")
    assert is_refused(local("POST", f"{DESK}/jobs", json={"recording": recording, "asset": "tank_1"}), 503)
    assert is_refused(local("DELETE", JOB), 503)
    assert local("GET", JOB).status_code == 200


def test_a_queue_that_is_full_says_when_to_come_again(local: Asked) -> None:
    """Who orders more than may wait is told so, and after what time to try again."""
    for _ in range(4):
        recording = bring(local).json()["id"]
        assert local("POST", f"{DESK}/jobs", json={"recording": recording, "asset": "tank_1"}).status_code == 201
    answer = local("POST", f"{DESK}/jobs", json={"recording": bring(local).json()["id"], "asset": "tank_1"})
    assert is_refused(answer, 429, "5 analyses wait")
    assert answer.headers["retry-after"] == "30"


def test_the_fake_is_as_the_real_one() -> None:
    """The desk of these tests and of those of the page gives the shapes, too."""
    told = {"now": 0.0, **FakeDesk().shown()}
    OfflineShape.model_validate(told, strict=True)
    assert asyncio.iscoroutinefunction(FakeDesk.take)


def test_a_file_that_is_broken_off_is_no_failure(local: Asked, caplog: pytest.LogCaptureFixture) -> None:
    """Who goes away while a file comes leaves nothing of it, and no error in the log."""
    parts: list[dict[str, Any]] = [
        {"type": "http.request", "body": b"time", "more_body": True},
        {"type": "http.disconnect"},
    ]
    headers = {"host": "localhost", TOKEN.lower(): str(local.token), **BYTES}
    scope = {
        "type": "http",
        "method": "POST",
        "path": f"{DESK}/files",
        "query_string": b"kind=recording&name=a.csv",
        "headers": [(name.encode(), text.encode()) for name, text in headers.items()],
    }
    sent: list[Any] = []

    async def receive() -> dict[str, Any]:
        return parts.pop(0)

    async def send(message: Any) -> None:
        sent.append(message)

    asyncio.run(local.app(scope, receive, send))
    assert sent[0]["status"] == 400
    assert local.desk.files == {}
    assert "failed" not in caplog.text
