"""The service at work: sources that fail and come back, a store that does, people, and who listens."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Iterator, Mapping, Sequence
from typing import Any

import pytest

from faultbond.errors import FaultbondError, SourceError, StoreError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.face import Request, Shown
from faultbond.service.contract.messages import Action, Arrivals, Deed
from faultbond.service.contract.source import LiveSource, Subscriber
from faultbond.service.contract.store import Commit, LogStore
from faultbond.service.site import Site, SiteAsset
from faultbond.service.station import Service
from faultbond.service.store.opening import open_store
from loop_asset import FOUND, plant, rows
from memory_store import MemoryStore
from postgres import PostgresServer
from stored import flat

TIMEOUT = 60.0


class Clock:
    """Unix seconds that a test sets."""

    def __init__(self) -> None:
        self.now = 1000.0

    def __call__(self) -> float:
        return self.now


class PlayedSource:
    """Gives portions of rows from its cursor on, each after `pace` s. lost_at: where it is lost. ends: lets it end."""

    address = "played:"

    def __init__(
        self, clock: Clock, portion: int = 50, last: int = FOUND, lost_at: int | None = None, pace: float = 0.0
    ) -> None:
        self.clock, self.portion, self.last, self.lost_at, self.pace = clock, portion, last, lost_at, pace
        self.begun: list[str] = []
        self.ends = asyncio.Event()

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """See `LiveSource`."""
        first = int(cursors.get("loop") or 0)
        self.begun.append(str(first))
        while first < self.last:
            if self.lost_at is not None and first >= self.lost_at:
                self.lost_at = None
                raise SourceError("played: is gone")
            last = min(first + self.portion, self.last)
            if self.pace:
                await asyncio.sleep(self.pace)
            some: RowBlock = rows().part(slice(first, last))
            yield Arrivals(asset="loop", rows=some, arrived=self.clock(), cursor=str(last), counts={"dropped": 1})
            first = last
        await self.ends.wait()


class FailingStore(MemoryStore):
    """One that cannot be written, or read, for a while."""

    failures = unread = 0

    def deeds(self, asset: str | None = None, *, newest: int | None = None) -> Iterator[Deed]:
        if self.unread:
            self.unread -= 1
            raise StoreError("kept.sqlite: the server is gone.")
        return super().deeds(asset, newest=newest)

    def commit(self, parts: Sequence[Commit]) -> None:
        if self.failures:
            self.failures -= 1
            raise StoreError("kept.sqlite: the disk is full.")
        super().commit(parts)


class Played:
    """A service that watches the loop in a test."""

    def __init__(self, store: LogStore | None = None, **source: Any) -> None:
        self.clock, self.store = Clock(), store or MemoryStore()
        self.source = PlayedSource(self.clock, **source)
        site = Site(name="hall", assets=(SiteAsset(name="loop", plant=plant(), source="played:"),))
        self.service = Service(site, self.store, self._opened, clock=self.clock)

    def _opened(self, address: str, subscribers: Sequence[Subscriber]) -> LiveSource:
        assert [item.asset for item in subscribers] == ["loop"]
        return self.source

    @property
    def summary(self) -> Shown:
        """The summary of the loop."""
        (found,) = self.service.site()["assets"]
        return dict(found)

    async def until(self, is_so: Callable[[], bool]) -> None:
        """Wait for something."""
        while not is_so():
            await asyncio.sleep(0.01)

    def passed(self, n: int) -> bool:
        """Whether so many samples have passed."""
        return int(self.summary["samples"]) >= n

    async def do(self, action: Action, *target: str, minutes: float | None = None) -> Shown:
        """Do something as Anna."""
        wish = Request(asset="loop", action=action, who="anna", comment="so", target=target, minutes=minutes)
        return await self.service.do(wish)


def play(played: Played, course: Callable[[Played], Awaitable[None]]) -> None:
    """Run a service beside what a test does with it, and stop it then."""

    async def all_of_it() -> None:
        running = asyncio.create_task(played.service.run())
        doing = asyncio.ensure_future(course(played))
        await asyncio.wait((running, doing), return_when=asyncio.FIRST_COMPLETED)
        running.cancel()
        await asyncio.gather(running, return_exceptions=True)
        await doing

    asyncio.run(asyncio.wait_for(all_of_it(), TIMEOUT))


def test_an_alarm_is_shown_acknowledged_and_accepted() -> None:
    """From quiet rows to a decision, as the page sees it."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(700))
        await played.until(lambda: played.summary["best"] is not None)
        shown = played.summary
        assert (shown["status"], shown["monitoring"], shown["alarm"]["state"]) == (
            "FAILURE",
            "running",
            "unacknowledged",
        )
        entry = await played.do(Action.ACKNOWLEDGE)
        assert (entry["who"], entry["action"], entry["comment"], entry["number"]) == ("anna", "acknowledge", "so", 1)
        assert played.summary["alarm"]["state"] == "acknowledged"
        asset = played.service.asset("loop")
        assert {"accept", "reject", "repaired"} <= set(asset["may"])
        assert asset["counts"]["dropped"] == FOUND // 50
        best = asset["rows"][0]
        assert asset["suspicion"][best["suspects"][0]["component"]] > 0.3
        await played.do(Action.ACCEPT, *best["target"])
        assert (played.summary["status"], played.summary["alarm"]) == ("NORMAL", None)
        asset = played.service.asset("loop")
        assert "undo" in asset["may"]
        assert [item["action"] for item in asset["journal"]] == ["accept", "acknowledge"]
        await played.do(Action.UNDO)
        assert played.summary["status"] == "FAILURE"
        assert played.service.asset("loop")["journal"][1]["undone_by"] == 3
        with pytest.raises(FaultbondError, match="loop: its alarm is not shelved"):
            await played.do(Action.UNSHELVE)
        with pytest.raises(KeyError):
            await played.service.do(Request(asset="pump", action=Action.SHELVE, who="anna"))

    play(Played(), course)


def test_who_listens_hears_all_samples_and_the_diagnosis() -> None:
    """Curves of every grid point in order, and the asset whenever something was found."""

    async def course(played: Played) -> None:
        times: list[float] = []
        names: set[str] = set()
        async for name, content in played.service.listen(1000):
            names.add(name)
            times += content["time"] if name == "samples" else []
            if len(times) >= FOUND - 50 and name == "asset":
                break
        assert times == sorted(set(times))
        assert {"samples", "summary", "asset"} <= names

    play(Played(portion=10), course)


def test_a_source_that_is_lost_is_opened_again_behind_what_came(monkeypatch: pytest.MonkeyPatch) -> None:
    """Nothing is there twice or missing, and the page says so meanwhile."""
    monkeypatch.setattr("faultbond.service.station.FIRST_DELAY", 0.3)

    async def course(played: Played) -> None:
        await played.until(lambda: not played.service.health()["ok"])
        part = played.service.health()["parts"]["played:"]
        assert (part["ok"], part["trouble"]) == (False, "played: is gone")
        await played.until(lambda: played.passed(FOUND))
        assert played.source.begun == ["0", "500"]
        assert played.service.health()["ok"]

    played = Played(lost_at=500)
    play(played, course)
    assert len(flat(played.store.log_after("loop", 0, 0))) == FOUND


def test_no_data_is_never_normal() -> None:
    """Ten samples and ten seconds after the last row; and at the begin."""

    async def course(played: Played) -> None:
        assert (played.summary["monitoring"], played.summary["status"]) == ("no data", "CHECK_FUNCTION")
        await played.until(lambda: played.passed(600))
        assert (played.summary["monitoring"], played.summary["status"]) == ("running", "NORMAL")
        played.clock.now += 9.9
        assert played.summary["monitoring"] == "running"
        played.clock.now += 0.2
        assert (played.summary["monitoring"], played.summary["status"]) == ("no data", "CHECK_FUNCTION")
        assert played.summary["headline"].startswith("No data for 10 s.")

    play(Played(last=600), course)


def test_a_store_that_cannot_be_written_stops_nothing_and_loses_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """It is tried again; who wants something is told, and what was asked for is done once the disk has room."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.05)
    store = FailingStore()

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(300))
        store.failures = 3
        with pytest.raises(StoreError, match=r"disk is full. It is tried again until it is written"):
            await played.do(Action.SUPPRESS)
        assert not played.service.health()["parts"]["store"]["ok"]
        await played.until(lambda: played.service.health()["ok"])
        assert [item.action for item in store.deeds()] == [Action.SUPPRESS]

    play(Played(store, last=300), course)


def test_a_store_that_cannot_be_read_stops_nothing(monkeypatch: pytest.MonkeyPatch) -> None:
    """What is to be told of an asset is told once its journal can be read, and the page says so meanwhile."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.05)
    store = FailingStore()

    async def course(played: Played) -> None:
        store.unread = 3
        troubles: set[str] = set()

        async def look() -> None:
            while True:
                troubles.add(played.service.health()["parts"]["store"]["trouble"])
                await asyncio.sleep(0.001)

        looking = asyncio.create_task(look())
        async for name, _ in played.service.listen(1000):
            if name == "asset":
                break
        await played.until(lambda: played.passed(FOUND) and played.service.health()["ok"])
        looking.cancel()
        assert troubles == {"", "kept.sqlite: the server is gone."}

    play(Played(store), course)


def test_a_server_that_is_gone_for_a_while(monkeypatch: pytest.MonkeyPatch, postgres: PostgresServer) -> None:
    """Its service says so, goes on when it is back, and has all that it was told and what came meanwhile, once."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.05)
    place = postgres.url()
    store = open_store(place)

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(300))
        await asyncio.to_thread(postgres.stop)
        await played.until(lambda: not played.service.health()["ok"])
        trouble = played.service.health()["parts"]["store"]["trouble"]
        assert trouble.startswith(f"{place}: the ")
        wish = asyncio.create_task(played.do(Action.SUPPRESS))
        await asyncio.to_thread(postgres.start)
        await played.until(lambda: played.service.health()["ok"] and played.passed(FOUND))
        assert (await wish)["number"] == 1
        await played.until(lambda: played.summary["best"] is not None)

    play(Played(store, portion=10, pace=0.01), course)
    items = flat(store.log_after("loop", 0, 0))
    assert [item for item in items if isinstance(item, tuple)] == flat([rows().part(slice(0, FOUND))])
    assert [item.action for item in items if isinstance(item, Deed)] == [Action.SUPPRESS]
    ids = [item.id for item in store.records()]
    assert ids
    assert len(ids) == len(set(ids))
    assert store.contested() == []
    store.close()


def test_it_goes_on_where_it_stopped() -> None:
    """A second service on the same store knows the alarm, who saw it, and the cursor."""
    store = MemoryStore()

    async def first(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))
        await played.do(Action.SHELVE, minutes=30.0)

    async def second(played: Played) -> None:
        assert played.summary["alarm"]["state"] == "shelved"
        assert played.summary["samples"] == FOUND
        seen = played.service.curves("loop", None, None, 100)["time"]
        assert (len(seen) > 80, seen[-1]) == (True, rows().time[FOUND - 1])  # some rows were missing
        assert played.service.asset("loop")["rows"]
        await played.until(lambda: played.passed(FOUND + 100))
        assert played.source.begun == [str(FOUND)]

    play(Played(store), first)
    play(Played(store, last=FOUND + 100), second)


def test_the_end_of_a_source_is_told() -> None:
    """What has nothing more to give is not well, and is not opened again."""

    async def course(played: Played) -> None:
        played.source.ends.set()
        await played.until(lambda: not played.service.health()["ok"])
        assert played.service.health()["parts"]["played:"]["trouble"] == "it has ended"

    play(Played(last=100), course)


def test_a_report_and_curves_of_what_was_seen() -> None:
    """The page of `run`, and curves in the units of the model file, from memory and from the store alike."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))
        assert "<html" in played.service.report("loop")[:200]
        newest = played.service.curves("loop", None, None, 100)
        begin, end = newest["time"][0], newest["time"][-1]
        assert len(newest["time"]) == 100
        kept = played.service.curves("loop", begin, end, 1000)
        assert kept["time"] == newest["time"]
        assert kept["measured"] == newest["measured"]
        assert set(newest["inputs"]) == {"V_I"}
        with pytest.raises(KeyError):
            played.service.curves("pump", None, None, 100)

    play(Played(), course)


def test_what_is_not_foreseen_ends_the_service_with_what_it_was() -> None:
    """Not with a group of errors that says nothing; what was taken until then is kept."""
    store = MemoryStore()

    played = Played(store, last=300)
    played.source.ends.set()
    played.service._tick = broken  # type: ignore[method-assign]
    with pytest.raises(ZeroDivisionError):
        asyncio.run(asyncio.wait_for(played.service.run(), TIMEOUT))
    (log,) = store.logs.values()
    assert log.checkpoints[-1].checkpoint_rows == len(log.rows) > 0


async def broken() -> None:
    """Fail once something has come."""
    await asyncio.sleep(0.5)
    raise ZeroDivisionError
