"""What viewers are told: the state first, then what happens, and that who is slow is cut off."""

import asyncio
import json
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

import pytest

from asked import Asked, run
from fake_face import FakeFace
from faultbond.service.web import broadcast as module
from faultbond.service.web.broadcast import Broadcast, BusyError, EventStream, Notice
from faultbond.service.web.security import LocalGuard

Told = list[tuple[str, dict[str, Any]]]


@pytest.fixture(autouse=True)
def _fast(monkeypatch: pytest.MonkeyPatch) -> None:
    """Times that tests can wait for."""
    monkeypatch.setattr(module, "GATHER", 0.01)
    monkeypatch.setattr(module, "ALIVE", 0.2)
    monkeypatch.setattr(module, "STALL", 0.2)


def events_of(data: bytes) -> Told:
    """Give the events in what went over the wire."""
    found = []
    for block in data.decode().split("\n\n"):
        lines = dict(line.split(": ", 1) for line in block.splitlines())
        if "data" in lines:
            found.append((lines["event"], json.loads(lines["data"])))
    return found


class Wire:
    """A browser's end of a stream: takes what is sent, unless it is stalled."""

    def __init__(self) -> None:
        self.events: Told = []
        self.status = 0
        self.is_stalled = False
        self.is_ended = False
        self.gone = asyncio.Event()

    async def receive(self) -> dict[str, Any]:
        await self.gone.wait()
        return {"type": "http.disconnect"}

    async def send(self, message: Any) -> None:
        if self.is_stalled:
            await asyncio.sleep(60.0)
        if message["type"] == "http.response.start":
            self.status = message["status"]
        else:
            self.events += events_of(message["body"])
            self.is_ended = not message.get("more_body", False)

    async def until(self, is_so: Callable[[Told], bool]) -> None:
        while not is_so(self.events):
            await asyncio.sleep(0.005)


@asynccontextmanager
async def watched(asked: Asked, query: str = "") -> AsyncIterator[tuple[Wire, "asyncio.Task[None]"]]:
    """Open a stream of the application."""
    wire = Wire()
    cookies = "; ".join("=".join(item) for item in asked.cookies.items())
    scope = {
        "type": "http",
        "asgi": {"version": "3.0", "spec_version": "2.3"},
        "http_version": "1.1",
        "method": "GET",
        "path": "/api/v1/events",
        "raw_path": b"/api/v1/events",
        "query_string": query.encode(),
        "root_path": "",
        "scheme": "http",
        "headers": [
            (b"host", b"localhost"),
            (b"cookie", cookies.encode()),
        ],
        "client": ("127.0.0.1", 1),
        "server": ("localhost", 80),
    }
    task = asyncio.create_task(asked.app(scope, wire.receive, wire.send))
    try:
        yield wire, task
    finally:
        wire.gone.set()
        await asyncio.wait([task], timeout=5.0)


def names(told: Told) -> list[str]:
    """Give the names of events."""
    return [name for name, _ in told]


@pytest.mark.parametrize("query", ["", "asset=tank_2"])
def test_what_is_about_the_service_is_told_to_all(local: Asked, query: str) -> None:
    """Whatever they look at."""

    async def follow() -> None:
        async with watched(local, query) as (wire, _):
            await wire.until(lambda told: "site" in names(told))
            local.face.fail("store: the disk is full.")
            await wire.until(lambda told: ("service", {"troubles": ["store: the disk is full."]}) in told)

    asyncio.run(asyncio.wait_for(follow(), 20.0))


def test_a_stream_begins_with_what_is_so_now(local: Asked) -> None:
    """The site and the asset come first, then each sample, and signs of life while nothing happens."""

    async def follow() -> None:
        async with watched(local, "asset=tank_2") as (wire, _):
            await wire.until(lambda told: names(told)[:3] == ["alive", "site", "asset"])
            local.face.tick()
            await wire.until(lambda told: {"samples", "summary"} <= set(names(told)))
            await wire.until(lambda told: names(told).count("alive") > 2)
            samples = [told for name, told in wire.events if name == "samples"]
            assert [item["asset"] for item in samples] == ["tank_2"]
            assert samples[0]["time"] == [local.face.time(local.face.now)]
            told_of = {told["name"] for name, told in wire.events if name == "summary"}
            assert told_of == {"tank_1", "tank_2", "tank_3", "tank_4", "motor_1", "motor_3"}

    run(follow())


def test_a_deed_is_told_to_all(local: Asked) -> None:
    """Who looks at the asset gets it whole, who looks at the overview its summary."""

    async def follow() -> None:
        async with watched(local, "asset=tank_2") as (near, _), watched(local) as (far, _):
            await near.until(lambda told: "asset" in names(told))
            await far.until(lambda told: "site" in names(told))
            await local._ask(
                "POST", "/api/v1/assets/tank_2/deeds", {}, "localhost", {"json": {"action": "acknowledge"}}
            )
            await near.until(lambda told: names(told).count("asset") == 2)
            await far.until(lambda told: "summary" in names(told))
            assert near.events[-1][1]["journal"][0]["action"] == "acknowledge"
            summary = [told for name, told in far.events if name == "summary"][-1]
            assert (summary["name"], summary["alarm"]["state"]) == ("tank_2", "acknowledged")
            assert "asset" not in names(far.events)

    run(follow())


def test_the_newest_summary_comes_last_and_once() -> None:
    """Of many summaries that waited the newest is told, and none that an asset told later has made old."""

    async def follow() -> None:
        face = FakeFace()
        viewer = await Broadcast(face).admit("tank_2")
        viewer.taken()
        for number in range(5):
            viewer.put(Notice("summary", {"name": "tank_1", "samples": number}))
        viewer.put(Notice("summary", {"name": "tank_2", "samples": 1}))
        viewer.put(Notice("asset", face.asset("tank_2")))
        told = events_of(viewer.taken())
        assert [(name, item.get("name"), item.get("samples")) for name, item in told] == [
            ("asset", None, None),
            ("summary", "tank_1", 4),
        ]

    run(follow())


def test_an_event_is_written_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """However many viewers there are, an event is made text for the first only."""
    written = []

    def dumps(shown: object, **_: object) -> str:
        written.append(shown)
        return "{}"

    monkeypatch.setattr(json, "dumps", dumps)
    event = Notice("summary", {"name": "a"})
    assert event.written() is event.written()
    assert len(written) == 1


def test_a_slow_listener_is_cut_off(local: Asked) -> None:
    """Who takes nothing is left, without an end, and forgotten; others are told all the while."""

    async def follow() -> None:
        broadcast = local.app.state.broadcast
        async with watched(local, "asset=tank_2") as (slow, task), watched(local, "asset=tank_2") as (quick, _):
            await slow.until(lambda told: "asset" in names(told))
            slow.is_stalled = True
            local.face.tick()
            await asyncio.wait_for(task, 5.0)
            assert not slow.is_ended
            assert len(broadcast) == 1
            await quick.until(lambda told: "samples" in names(told))

    run(follow())


def test_too_much_that_waits_ends_a_viewer() -> None:
    """A viewer for which too many events wait is over, and keeps none of them."""

    async def follow() -> None:
        face = FakeFace()
        broadcast = Broadcast(face)
        viewer = await broadcast.admit("tank_2")
        for _ in range(module.MOST):
            viewer.put(Notice("samples", {"asset": "tank_2"}))
        assert viewer.is_over
        chunks = [chunk async for chunk in broadcast.follow(viewer, lambda: True)]
        assert [names(events_of(chunk)) for chunk in chunks] == [["alive"]]
        broadcast.leave(viewer)

    run(follow())


def test_a_viewer_that_goes_is_forgotten(local: Asked) -> None:
    """When the last page is closed nobody listens to the service any more, and the next page is told again."""

    async def follow() -> None:
        broadcast = local.app.state.broadcast
        for _ in range(2):
            async with watched(local) as (wire, _):
                await wire.until(lambda told: "site" in names(told))
                await asyncio.sleep(0.02)
                assert len(local.face._queues) == 1
                local.face.tick()
                await wire.until(lambda told: "summary" in names(told))
            await asyncio.sleep(0.02)
            assert (len(broadcast), len(local.face._queues)) == (0, 0)

    run(follow())


@pytest.mark.parametrize("is_failure", [True, False])
def test_where_the_service_stops_the_stream_ends(
    local: Asked, is_failure: bool, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A page learns at once that the service stopped, or that its events failed."""

    async def failing(most: int = 100) -> AsyncIterator[tuple[str, dict[str, Any]]]:
        await asyncio.sleep(0.05)
        raise RuntimeError("broken")
        yield "summary", {}

    async def follow() -> None:
        if is_failure:
            monkeypatch.setattr(local.face, "listen", failing)
        async with watched(local) as (wire, task):
            await wire.until(lambda told: "site" in names(told))
            await asyncio.sleep(0.02)
            local.face.stop()
            await asyncio.wait_for(task, 5.0)
            assert wire.is_ended

    run(follow())
    assert ("the page's events failed" in caplog.text) == is_failure


def test_a_stream_ends_with_its_session(guarded: Callable[..., Asked]) -> None:
    """After a logout nothing more is told."""

    async def follow() -> None:
        asked = guarded()
        session = asked.guard.login("otto", "hands on", "a")
        asked.cookies = {"faultbond_session": session}  # type: ignore[dict-item]
        async with watched(asked) as (wire, task):
            await wire.until(lambda told: "site" in names(told))
            asked.guard.logout(session)
            await asyncio.wait_for(task, 5.0)
            assert wire.is_ended

    run(follow())


def test_viewers_are_bounded(local: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """One page too many is refused and told when to come again."""
    monkeypatch.setattr(module, "VIEWERS", 0)
    answer = local("GET", "/api/v1/events")
    assert (answer.status_code, answer.headers["retry-after"]) == (503, "10")

    async def follow() -> None:
        with pytest.raises(BusyError):
            await Broadcast(FakeFace()).admit(None)

    run(follow())


def test_numbers_that_are_none_are_not_sent() -> None:
    """What is no number never goes out as one."""
    with pytest.raises(ValueError, match="JSON compliant"):
        Notice("samples", {"asset": "a", "time": [float("nan")]}).written()


def test_a_proxy_does_not_hold_events_back(local: Asked) -> None:
    """The answer tells proxies and caches to pass it on at once."""

    async def follow() -> None:
        broadcast = Broadcast(local.face)
        viewer = await broadcast.admit(None)
        answer = EventStream(broadcast, viewer, lambda: LocalGuard().who(None) is not None)
        broadcast.leave(viewer)
        assert answer.headers["x-accel-buffering"] == "no"
        assert answer.headers["content-type"].startswith("text/event-stream")

    run(follow())


def test_while_the_service_is_busy_others_are_told(local: Asked, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who comes while the service cannot answer waits, and hears all from then on; nobody else waits."""
    free, asked_for = threading.Event(), local.face.site

    def busy() -> dict[str, Any]:
        assert free.wait(10.0)
        return asked_for()

    async def follow() -> None:
        async with watched(local, "asset=tank_2") as (early, _):
            await early.until(lambda told: "asset" in names(told))
            monkeypatch.setattr(local.face, "site", busy)
            async with watched(local, "asset=tank_2") as (late, _):
                await asyncio.sleep(0.05)
                local.face.tick()
                await early.until(lambda told: "samples" in names(told))
                assert late.events == []
                free.set()
                await late.until(lambda told: "samples" in names(told))
                assert names(late.events)[:3] == ["alive", "site", "asset"]

    run(follow())
