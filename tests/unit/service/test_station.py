"""The service at work: sources that fail and come back, a store that does, people, and who listens."""

import asyncio
import subprocess
import sys
import threading
import time
from collections.abc import AsyncGenerator, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import pytest

from desk_bench import parts
from faultbond.errors import FaultbondError, StoreError
from faultbond.io.row_block import RowBlock
from faultbond.model.graph import BondGraph
from faultbond.report import drawing
from faultbond.service.asset import Asset
from faultbond.service.contract.face import Request
from faultbond.service.contract.messages import Action, Arrivals, AuditEntry, Deed, NamedRecord
from faultbond.service.contract.offline import FileKind
from faultbond.service.contract.store import Commit, Forgotten
from faultbond.service.offline.desk import OfflineDesk
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.site_view import REGULAR
from faultbond.service.station import FORGET_EVERY
from faultbond.service.store.opening import open_store
from loop_asset import FOUND, rows
from memory_store import MemoryStore
from played import QUICK, TIMEOUT, TODAY, Clock, Played, PlayedSource, play
from postgres import PostgresServer
from stored import flat


class FailingStore(MemoryStore):
    """One that cannot be written, or read, for a while."""

    failures = unread = 0
    lack = ""

    def reserve(self) -> str:
        return self.lack

    def journal(self, asset: str | None = None, **wanted: Any) -> Iterator[NamedRecord | Deed]:
        if self.unread:
            self.unread -= 1
            raise StoreError("kept.sqlite: the server is gone.")
        return super().journal(asset, **wanted)

    def commit(self, parts: Sequence[Commit]) -> None:
        if self.failures:
            self.failures -= 1
            raise StoreError("kept.sqlite: the disk is full.")
        super().commit(parts)


def test_a_plant_is_drawn_once_and_when_it_is_looked_at(monkeypatch: pytest.MonkeyPatch) -> None:
    """A start with many assets waits for no drawing, nor for the libraries that draw."""
    drawn, draw = list[str](), drawing.draw

    def noted(graph: BondGraph, strokes: Mapping[int, str] | None = None) -> str:
        drawn.append(graph.name)
        return draw(graph, strokes)

    monkeypatch.setattr(drawing, "draw", noted)

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(100))
        before = len(drawn)
        shown = [played.service.asset(name)["drawing"] for name in ("loop", "other", "loop")]  # of one model
        assert (before, len(drawn), len(set(shown))) == (0, 1, 1)
        assert "<svg" in shown[0]

    play(Played(assets=("loop", "other")), course)
    code = "import sys, faultbond.service.program; print([name for name in ('scipy', 'casadi') if name in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout == "[]\n"


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
        (event,) = asset["events"]
        assert event["text"].startswith("Alarm raised, seen in ")
        assert (event["alarm"], event["behind"]) == (True, 0)
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
        played.steady.now += 9.9
        assert played.summary["monitoring"] == "running"
        played.steady.now += 0.2
        assert (played.summary["monitoring"], played.summary["status"]) == ("no data", "CHECK_FUNCTION")
        assert played.summary["headline"].startswith("No data for 10 s.")

    play(Played(last=600), course)


def test_what_cannot_be_read_is_no_data() -> None:
    """A source that gives nothing but what it counts is silent."""

    class Garbled(PlayedSource):
        async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
            while True:
                yield Arrivals(asset="loop", rows=rows().part(slice(0)), arrived=0.0, counts={"unreadable": 1})
                await asyncio.sleep(0.01)

    async def course(played: Played) -> None:
        await played.until(lambda: played.service.asset("loop")["counts"].get("unreadable", 0) > 3)
        assert (played.summary["monitoring"], played.summary["status"]) == ("no data", "CHECK_FUNCTION")
        assert played.service.health()["ok"]

    play(Played(opened=lambda _, subscribers: Garbled(Clock(), subscribers)), course)


def test_rows_without_a_value_of_a_sensor_are_no_data() -> None:
    """After the same patience as no rows, though inputs have values; and all that tells when data came says so."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(300))
        assert (played.summary["monitoring"], played.summary["status"]) == ("running", "NORMAL")
        came = f'last_arrival_timestamp_seconds{{asset="loop"}} {TODAY:.0f}'
        assert came in played.service.metrics(0)
        played.steady.now += 10.5
        played.clock.now += 10.5
        played.source.holds.set()
        await played.until(lambda: played.passed(600))
        assert (played.summary["monitoring"], played.summary["status"]) == ("no data", "CHECK_FUNCTION")
        assert played.summary["headline"] == "No data for 10 s: what came last has no usable value of any sensor."
        assert came in played.service.metrics(0)
        assert 'asset_running{asset="loop"} 0' in played.service.metrics(0)

    play(Played(last=600, hold_at=300, deaf_at=300), course)


def test_sensors_that_read_rarely_have_data_between_their_values() -> None:
    """Three times as long as from one value to the next; an outage does not count as such a time."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(600))
        (rows,) = [item for item in played.store.log_after("loop", 0, 0) if isinstance(item, RowBlock)][-1:]

        def later(seconds: float) -> str:
            played.steady.now += seconds
            return str(played.summary["monitoring"])

        def comes() -> None:
            played.service._view.note(Arrivals(asset="loop", rows=rows, arrived=0.0))

        for _ in range(REGULAR):  # a few outages are no pace
            assert later(60.0) == "no data"
            comes()
        assert (later(179.0), later(2.0)) == ("running", "no data")
        assert later(3600.0) == "no data"
        comes()
        assert (later(179.0), later(2.0)) == ("running", "no data")

    play(Played(last=600), course)


def test_the_page_of_an_open_alarm_says_why_there_are_no_data() -> None:
    """Beside the verdict as it was last, while rows still come and when none do."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND - 50))
        assert (played.summary["monitoring"], played.summary["status"]) == ("running", "FAILURE")
        before = played.service.asset("loop")["verdict"]
        played.steady.now += 60.0
        assert played.service.asset("loop")["verdict"] == f"No data for 60 s. {before}"
        played.source.holds.set()
        await played.until(lambda: played.passed(FOUND))
        shown = played.service.asset("loop")["verdict"]
        told = "No data for 60 s: what came last has no usable value of any sensor."
        assert shown.startswith(f"{told} ")
        assert "%" in shown
        assert played.summary["headline"].startswith(f"{told} Alarm at ")

    play(Played(hold_at=FOUND - 50, deaf_at=FOUND - 50), course)


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


def test_what_is_written_as_all_ends_is_told_yet() -> None:
    """Nobody tells it after the next start: it is in the store by then, and what follows begins behind it."""
    told, written = list[str](), threading.Event()

    class Slow(MemoryStore):
        """One that takes its time once a record is in it."""

        def commit(self, parts: Sequence[Commit]) -> None:
            super().commit(parts)
            if any(part.records for part in parts):
                written.set()
                time.sleep(0.2)

    def hear(done: Any) -> None:
        told.extend(item.id for item in done.outcome.records)

    async def course(played: Played) -> None:
        await played.until(written.is_set)

    store = Slow()
    play(Played(store, hear=hear), course)
    assert written.is_set()
    assert told == [item.id for item in store.records()]


def test_a_disk_that_is_almost_full_is_told(monkeypatch: pytest.MonkeyPatch) -> None:
    """By /health, and on each page as soon as it is so, while all goes on; and that it is over."""
    monkeypatch.setattr("faultbond.service.station.TICK", 0.05)
    store = FailingStore()

    async def course(played: Played) -> None:
        told: list[list[str]] = []

        async def hear() -> None:
            async for name, content in played.service.listen(1000):
                if name == "service":
                    told.append(content["troubles"])

        hearing = asyncio.create_task(hear())
        await played.until(lambda: played.passed(200))
        assert (played.service.health()["ok"], played.service.site()["troubles"]) == (True, [])
        store.lack = "kept.sqlite: the disk is almost full."
        await played.until(lambda: len(told) == 1)
        assert not played.service.health()["ok"]
        assert played.service.site()["troubles"] == told[0] == ["disk: kept.sqlite: the disk is almost full."]
        await played.do(Action.SUPPRESS)
        store.lack = ""
        await played.until(lambda: len(told) == 2)
        assert told[1] == []
        assert played.service.health()["ok"]
        hearing.cancel()

    play(Played(store, last=300), course)


def test_an_asset_says_that_its_data_cannot_be_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Who sees no data reads why, also where the source gives them."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.05)
    store = FailingStore()

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(200))
        store.failures = 10**6
        await played.until(lambda: bool(played.service.health()["parts"]["store"]["trouble"]))
        played.steady.now += 60.0
        shown = played.summary
        assert (shown["status"], shown["monitoring"]) == ("CHECK_FUNCTION", "no data")
        assert shown["headline"].startswith("No data for 60 s: kept.sqlite: the disk is full.")
        store.failures = 0

    play(Played(store, portion=10, pace=0.02), course)


def test_who_wants_something_while_the_store_is_gone_is_refused_in_time(monkeypatch: pytest.MonkeyPatch) -> None:
    """What waited behind what cannot be written is called off: it is not done later, when nobody knows of it."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.05)
    monkeypatch.setattr("faultbond.service.station.DEED_PATIENCE", 0.3)
    store = FailingStore()

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(300))
        store.failures = 10**6
        with pytest.raises(StoreError, match=r"disk is full. It is tried again until it is written"):
            await played.do(Action.SUPPRESS)
        with pytest.raises(StoreError, match=r"disk is full. Nothing was done; try again"):
            await played.do(Action.OUT_OF_SERVICE)
        with pytest.raises(StoreError, match=r"Nothing was done"):
            await played.do(Action.UNDO)
        store.failures = 0
        await played.until(lambda: played.service.health()["ok"])
        await played.do(Action.UNSUPPRESS)
        assert [item.action for item in store.deeds()] == [Action.SUPPRESS, Action.UNSUPPRESS]

    play(Played(store, last=300), course)


class Unnoting(MemoryStore):
    """One that cannot note so many times."""

    failures = 0

    def note(self, entry: AuditEntry) -> None:
        if self.failures:
            self.failures -= 1
            raise StoreError("kept.sqlite: the server is gone.")
        super().note(entry)


def test_what_is_noted_waits_for_the_store_as_deeds_do(monkeypatch: pytest.MonkeyPatch) -> None:
    """What a person does beside the assets is kept once the store is back, and refused where that takes too long."""
    monkeypatch.setattr("faultbond.service.station.RETRY", 0.01)
    store = Unnoting()
    entry = AuditEntry(at=TODAY, who="emma", what="upload")

    async def course(played: Played) -> None:
        store.failures = 3
        await played.service.note(entry)
        assert [(item.who, item.what) for item in store.audit()] == [("emma", "upload")]
        monkeypatch.setattr("faultbond.service.station.DEED_PATIENCE", 0.3)
        store.failures = 10**6
        with pytest.raises(StoreError, match=r"the server is gone. Nothing was done; try again"):
            await played.service.note(entry)
        store.failures = 0
        with played.service._lock, pytest.raises(StoreError, match=r"The service is busy. Nothing was done"):
            await played.service.note(entry)
        assert len(list(store.audit())) == 1

    play(Played(store, last=50), course)


def test_what_waits_is_taken_in_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    """However much came at once, as after a night without the service: others may ask between two of them."""
    monkeypatch.setattr("faultbond.service.station.MOST_ROWS", 120)
    monkeypatch.setattr("faultbond.service.station.LONGEST_TURN", float("inf"))
    taken: list[int] = []

    class Listing(MemoryStore):
        def commit(self, parts: Sequence[Commit]) -> None:
            taken.append(sum(len(part.rows) for part in parts if part.rows is not None))
            super().commit(parts)

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))

    play(Played(Listing(), portion=50), course)
    assert sum(taken) == FOUND
    assert max(taken) == 150  # the portion with which there are enough is the last


def test_slow_rows_are_taken_in_smaller_portions(monkeypatch: pytest.MonkeyPatch) -> None:
    """As after an alarm, of which each takes many times as long: who asks meanwhile is not kept waiting for all."""
    monkeypatch.setattr("faultbond.service.station.LONGEST_TURN", 0.1)
    taken: list[int] = []

    class Slow(MemoryStore):
        def commit(self, parts: Sequence[Commit]) -> None:
            n_rows = sum(len(part.rows) for part in parts if part.rows is not None)
            taken.append(n_rows)
            time.sleep(2e-3 * n_rows)
            super().commit(parts)

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))

    play(Played(Slow(), portion=5), course)
    assert sum(taken) == FOUND
    assert max(taken[len(taken) // 2 :]) <= 55  # a tenth of a second's rows, and the portion that makes them enough


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
    monkeypatch.setattr("faultbond.service.station.DEED_PATIENCE", 300.0)  # a server may take long to begin
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
        assert played.service.health()["parts"]["played:"]["trouble"] == "played: has ended"

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


def test_a_source_that_fails_unforeseen_is_begun_anew_behind_what_came(caplog: pytest.LogCaptureFixture) -> None:
    """Nothing is there twice or missing, and the log has the traceback."""
    played = Played(lost_at=500, loss=ZeroDivisionError("by nothing"))

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))
        part = played.service.health()["parts"]["played:"]
        assert (part["ok"], part["restarts"]) == (True, 1)
        assert played.source.begun == ["0", "500"]

    play(played, course)
    (log,) = played.store.logs.values()
    assert len(log.rows) == FOUND
    (failed,) = [record for record in caplog.records if record.exc_info]
    assert failed.getMessage() == "played: failed unforeseen (ZeroDivisionError: by nothing) and is begun anew."


def test_a_source_that_fails_too_often_is_given_up() -> None:
    """Its assets are not judged any more, and say why; what was seen stays there, and people go on deciding."""
    played = Played(lost_at=FOUND, loss=ZeroDivisionError("by nothing"), losses=99, last=FOUND + 1)

    async def course(played: Played) -> None:
        await played.until(lambda: bool(played.service.health()["parts"]["played:"]["given_up"]))
        health = played.service.health()
        assert (health["ok"], health["parts"]["played:"]["restarts"]) == (False, QUICK.most)
        shown = played.summary
        assert (shown["status"], shown["monitoring"], shown["samples"]) == ("CHECK_FUNCTION", "stopped", FOUND)
        assert shown["headline"].startswith(
            "Not watched: played: failed unforeseen (ZeroDivisionError: by nothing) and is given up; restart the "
            "service once it is mended. Alarm at "
        )
        assert (await played.do(Action.ACKNOWLEDGE))["who"] == "anna"
        assert len(played.source.begun) == QUICK.most + 1

    play(played, course)


class PoisonError(Exception):
    """What no asset foresees."""


def test_an_asset_that_fails_unforeseen_is_given_up_and_the_others_go_on(monkeypatch: pytest.MonkeyPatch) -> None:
    """Its log ends before what it failed at, so that a mended faultbond goes on from there; nothing half is kept."""
    monkeypatch.setattr("faultbond.service.site_log.EVERY", 0.0)
    take = Asset.take

    def poisoned(asset: Asset, some: RowBlock) -> Any:
        taken = take(asset, some)
        if asset.name == "loop" and asset.counts.samples > 350:
            raise PoisonError("at a row")
        return taken

    store = MemoryStore()
    with monkeypatch.context() as patched:
        patched.setattr(Asset, "take", poisoned)

        async def course(played: Played) -> None:
            await played.until(lambda: played.service.site()["assets"][1]["samples"] >= FOUND)
            loop, other = played.service.site()["assets"]
            assert (loop["status"], loop["monitoring"]) == ("CHECK_FUNCTION", "stopped")
            assert loop["headline"].startswith("Not watched: asset loop failed unforeseen (PoisonError: at a row)")
            assert (other["status"], other["monitoring"]) == ("FAILURE", "running")
            health = played.service.health()
            assert [name for name, part in health["parts"].items() if not part["ok"]] == ["asset loop"]
            counts = played.service.asset("loop")["counts"]
            assert counts["dropped"] == FOUND - 350 + FOUND // 50  # one of each portion by its source
            with pytest.raises(FaultbondError, match="loop: it failed and is not watched"):
                await played.do(Action.SUPPRESS)

        play(Played(store, assets=("loop", "other")), course)
    assert {asset: len(log.rows) for (asset, _), log in store.logs.items()} == {"loop": 350, "other": FOUND}

    async def mended(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))
        assert played.summary["status"] == "FAILURE"
        assert played.service.asset("loop")["counts"].keys() == {"samples", "dropped"}

    play(Played(store, assets=("loop", "other")), mended)


def test_what_cannot_be_told_does_not_end_the_watch(monkeypatch: pytest.MonkeyPatch) -> None:
    """A defect of what the page shows is no reason to stop looking at the plant."""

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("faultbond.service.site_view.curves_of", broken)

    async def course(played: Played) -> None:
        async def listens() -> None:
            async for _ in played.service.listen():
                pass

        listening = asyncio.create_task(listens())
        await played.until(lambda: played.passed(FOUND))
        await played.until(lambda: not played.service.health()["parts"]["page"]["ok"])
        assert played.summary["status"] == "FAILURE"
        listening.cancel()

    play(Played(), course)


def test_what_cannot_be_begun_anew_ends_the_service_with_what_it_was() -> None:
    """Not with a group of errors that says nothing; what was taken until then is kept."""

    def broken(done: object) -> None:
        if played.summary["samples"] >= 300:
            raise ZeroDivisionError

    store = MemoryStore()
    played = Played(store, hear=broken)
    with pytest.raises(ZeroDivisionError):
        asyncio.run(asyncio.wait_for(played.service.run(), TIMEOUT))
    (log,) = store.logs.values()
    assert log.checkpoints[-1].checkpoint_rows == len(log.rows) >= 300
    assert played.summary["monitoring"] == "stopped"


HOUR = 3600.0


@pytest.mark.parametrize("moved", [HOUR, -HOUR])
def test_a_clock_that_is_set_is_told_and_changes_nothing_that_is_seen(
    moved: float, caplog: pytest.LogCaptureFixture
) -> None:
    """Nobody is silent by it, for no time at all and not for an hour; what is shown since when moves with it."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(600))
        since = played.summary["since"]
        played.steady.now += 5.0
        played.clock.now += 5.0 + moved
        assert (played.summary["monitoring"], played.summary["status"]) == ("running", "NORMAL")
        await played.until(lambda: played.service.health()["clock_jumps"] == 1)
        assert (played.summary["monitoring"], played.summary["status"]) == ("running", "NORMAL")
        assert played.summary["since"] == since + moved
        assert played.service.health()["ok"]
        (note,) = played.service.asset("loop")["notes"]
        way = "forward" if moved > 0.0 else "back"
        assert note.startswith(f"The clock of this machine was set {way} by 60 min; it was then 2026-11-1")
        played.steady.now += 5.1
        assert played.summary["monitoring"] == "no data"

    play(Played(last=600), course)
    assert [message for message in caplog.messages if "clock" in message] != []


def test_a_shelf_ends_by_the_clock_of_people() -> None:
    """It is a time of day, which is kept; a clock that is set forward ends it, which calls too early, not too late."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND))
        await played.do(Action.SHELVE, minutes=30.0)
        played.steady.now += HOUR
        assert played.summary["alarm"]["state"] == "shelved"
        played.clock.now += HOUR
        assert played.summary["alarm"]["state"] == "unacknowledged"

    play(Played(), course)


@pytest.mark.parametrize("moved", [HOUR, -HOUR])
def test_a_clock_of_the_source_that_is_set_raises_no_alarm_and_hides_none(moved: float) -> None:
    """As of values that come without a time of their own: each row is used, each record is there once."""

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(700))
        assert played.summary["alarm"] is None
        played.source.holds.set()
        await played.until(lambda: played.summary["best"] is not None)
        assert (played.summary["status"], played.summary["monitoring"]) == ("FAILURE", "running")

    some: dict[str, Any] = {"portion": 25, "pace": 0.001, "hold_at": 720, "last": FOUND + 50}
    still, moving = Played(**some), Played(**some, jump=(400, moved))
    play(still, course)
    play(moving, course)
    counts = moving.service.asset("loop")["counts"]
    assert counts["clock_jumps"] == 1
    assert counts.keys() == {"samples", "clock_jumps", "dropped"}
    records = list(moving.store.records())
    assert len({item.id for item in records}) == len(records)
    assert not moving.store.contested
    detections = [[item for item in played.store.records() if item.kind == "detection"] for played in (still, moving)]
    assert [len(found) for found in detections] == [1, 1]
    assert abs(detections[1][0].time - moved - detections[0][0].time) < 1.0


class Retaining(MemoryStore):
    """One that notes what it was asked to forget."""

    def __init__(self) -> None:
        super().__init__()
        self.asked: list[tuple[float | None, int | None]] = []

    def retain(self, *, older_than: float | None = None, at_most: int | None = None) -> Forgotten:
        self.asked.append((older_than, at_most))
        return Forgotten(points=5 if len(self.asked) == 1 else 0)


@pytest.mark.parametrize(
    ("more", "asked"),
    [
        ({}, []),
        ({"size": 10**9}, [(None, 10**9)]),
        ({"days": 2.0}, [(TODAY - 2 * 86400.0, None)]),
        ({"days": 2.0, "size": 10**9}, [(TODAY - 2 * 86400.0, 10**9)]),
    ],
)
def test_what_is_kept_is_bounded_by_age_and_by_size(
    monkeypatch: pytest.MonkeyPatch, more: dict[str, Any], asked: list[Any]
) -> None:
    """From time to time the store forgets what is too old and too much, as the site says, until nothing more goes."""
    monkeypatch.setattr("faultbond.service.station.TICK", 0.01)
    store = Retaining()

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(100))
        played.steady.now += FORGET_EVERY
        await played.until(lambda: len(store.asked) >= 2 * len(asked))
        await asyncio.sleep(0.2)

    play(Played(store, more=more), course)
    assert store.asked == 2 * asked


def test_what_people_bring_is_in_the_store(tmp_path: Path) -> None:
    """The off-line desk of a service notes in its store, is a part of its health, and is there only if wanted."""
    limits = OfflineLimits(folder=str(tmp_path / "desk"))

    async def course(played: Played) -> None:
        desk = played.service.desk
        assert desk is not None
        assert desk.shown()["assets"] == ["loop"]
        await desk.take("a.csv", FileKind.RECORDING, "emma", parts(b"time,V\n"))
        assert played.service.health()["parts"]["off line"]["ok"]
        (entry,) = played.store.audit()
        assert (entry.who, entry.what, entry.about["size"]) == ("emma", "upload", 7)

    play(Played(more={"offline": limits}), course)
    assert Played().service.desk is None


def test_a_desk_that_fails_does_not_end_the_watch(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What nobody foresaw at the off-line desk begins it anew, and is told; plants are watched all the while."""
    times = []

    async def broken(self: OfflineDesk) -> None:
        times.append(self)
        raise RuntimeError("unforeseen")

    monkeypatch.setattr(OfflineDesk, "run", broken)

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(FOUND) and len(times) > QUICK.most)
        await played.until(lambda: played.service.health()["parts"]["off line"]["given_up"])
        assert played.summary["monitoring"] == "running"

    play(Played(more={"offline": OfflineLimits(folder=str(tmp_path / "desk"))}), course)
