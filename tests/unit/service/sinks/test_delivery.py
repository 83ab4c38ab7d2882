"""Records are told in order, each until it was taken, at least once; and no sink disturbs another one."""

import asyncio
from collections.abc import Awaitable, Callable

import pytest

from faultbond.errors import RefusedError, SinkError, StoreError
from faultbond.service.contract.messages import NamedRecord
from faultbond.service.sinks import delivery
from memory_store import MemoryStore
from telling import Told, ToldSite, summary, until

LONGEST = 30.0  # s that anything takes on a busy machine


def play(site: ToldSite, course: Callable[[ToldSite], Awaitable[None]]) -> None:
    """Let the sinks run beside what a test does."""

    async def all_of_it() -> None:
        running = asyncio.create_task(site.deliveries.run())
        try:
            await course(site)
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)

    asyncio.run(asyncio.wait_for(all_of_it(), LONGEST))


@pytest.fixture(autouse=True)
def soon(monkeypatch: pytest.MonkeyPatch) -> None:
    """Try again soon."""
    monkeypatch.setattr(delivery, "FIRST_DELAY", 0.02)


def test_records_are_told_in_order_and_only_of_the_wanted_kinds() -> None:
    """Those that come, and those that were there before the sink was begun."""

    async def course(site: ToldSite) -> None:
        await until(lambda: site.told == first)
        more = site.find("accepted", "detection")
        await until(lambda: site.told == [*first, more[1]])
        await until(lambda: site.health()["behind"] == 0)
        assert (site.health()["told"], site.health()["ok"]) == (4, True)

    site = ToldSite(Told())
    first = site.find("detection", "diagnosis", "diagnosis")
    play(site, course)


def test_a_new_sink_is_not_told_what_was_before_it() -> None:
    """Only what comes from now on; after that it goes on where it was."""
    site = ToldSite(Told("other"))
    site.find("detection", "diagnosis")
    later = ToldSite(Told(), store=site.store)
    found = later.find("diagnosis")

    async def course(site: ToldSite) -> None:
        await until(lambda: site.told == found)

    play(later, course)
    again = ToldSite(Told(), store=site.store)
    more = again.find("detection")

    async def more_of_it(site: ToldSite) -> None:
        await until(lambda: site.told)
        assert site.told == more

    play(again, more_of_it)


def test_what_cannot_be_told_is_tried_later_and_later_and_nothing_is_lost_or_overtaken(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """The delay doubles while nothing is taken, and is short again then; the log has one line for each change."""
    caplog.set_level("INFO")
    sink = Told()

    async def course(site: ToldSite) -> None:
        sink.fails = [SinkError("told: is busy") for _ in range(4)]
        found = site.find("detection", "diagnosis")
        await until(lambda: len(sink.opened_at) == 3)
        assert (site.health()["ok"], site.health()["trouble"], site.health()["since"]) == (False, "told: is busy", 1000)
        await until(lambda: sink.records == found)
        assert site.health()["ok"]
        gaps = [after - before for before, after in zip(sink.opened_at, sink.opened_at[1:], strict=False)]
        for least, gap in zip((0.02, 0.04, 0.08, 0.16), gaps, strict=True):
            assert gap >= least
        sink.fails = [SinkError("told: is busy")]
        begun = asyncio.get_running_loop().time()
        site.find("detection")
        await until(lambda: len(sink.records) == 3)
        assert asyncio.get_running_loop().time() - begun < 0.16

    play(ToldSite(sink), course)
    assert caplog.messages == ["told: is busy", f"{sink.address}: works again after 0 s."] * 2


def test_the_other_side_may_want_to_be_left_alone_for_a_while() -> None:
    """It is, also where that is longer than the delay."""
    sink = Told()

    async def course(site: ToldSite) -> None:
        sink.fails = [SinkError("told: is busy", after=0.4)]
        site.find("detection")
        await until(lambda: sink.records)
        assert sink.opened_at[1] - sink.opened_at[0] >= 0.4

    play(ToldSite(sink), course)


def test_a_record_that_is_refused_for_what_it_is_holds_the_others_up_for_a_few_tries_only() -> None:
    """Then it is counted as given up, and the next one is told."""
    sink = Told()

    async def course(site: ToldSite) -> None:
        sink.fails = [RefusedError("told: does not like it") for _ in range(delivery.TRIES)]
        found = site.find("detection", "diagnosis")
        await until(lambda: sink.records)
        assert sink.records == found[1:]
        assert site.health()["given_up_records"] == 1
        sink.fails = [RefusedError("told: does not like it") for _ in range(delivery.TRIES - 1)]
        more = site.find("detection")
        await until(lambda: sink.records[-1:] == more)
        assert site.health()["given_up_records"] == 1
        sink.fails = [RefusedError("told: does not like it") for _ in range(delivery.TRIES)]
        site.find("detection")
        await until(lambda: site.health()["given_up_records"] == 2)
        assert site.health()["ok"]

    play(ToldSite(sink), course)


def test_records_are_given_up_only_where_the_site_says_so_and_after_that_time() -> None:
    """Counted, one with each try; without a word of it they wait for ever."""
    short, patient = Told("short", give_up=60.0), Told("patient")

    async def course(site: ToldSite) -> None:
        for sink in (short, patient):
            sink.fails = [SinkError("told: is gone") for _ in range(8)]
        found = site.find("detection", "diagnosis", "diagnosis")
        await until(lambda: not site.health("short")["ok"])
        site.clock.now += 61.0
        await until(lambda: site.health("short")["given_up_records"] == 3)
        short.fails.clear()
        more = site.find("detection")
        await until(lambda: short.records == more)
        await until(lambda: patient.records == [*found, *more])
        assert site.health("patient")["given_up_records"] == 0

    play(ToldSite(short, patient), course)


def test_a_sink_that_fails_unforeseen_disturbs_neither_the_others_nor_the_service(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    """It is told of, and begun again."""
    monkeypatch.setattr(delivery, "LONGEST_DELAY", 0.1)
    broken, well = Told("broken"), Told("well")

    async def course(site: ToldSite) -> None:
        broken.fails = [ZeroDivisionError("oh")]
        found = site.find("detection")
        await until(lambda: well.records == found)
        await until(lambda: not site.health("broken")["ok"])
        assert site.health("broken")["trouble"] == "ZeroDivisionError: oh"
        await until(lambda: broken.records == found)

    play(ToldSite(broken, well), course)


def test_only_the_newest_of_how_assets_stand_is_told_and_only_where_it_changed() -> None:
    """What changed while nobody was there is told once; after a loss all is told again."""
    sink, other = Told(shows=True), Told("other")

    async def course(site: ToldSite) -> None:
        sink.is_shut = True
        for status in ("NORMAL", "FAILURE"):
            site.deliveries.see([summary("a", status), summary("b", "NORMAL")])
        sink.is_shut = False
        await until(lambda: len(sink.shown) == 2)
        assert sink.shown == [("a", "FAILURE"), ("b", "NORMAL")]
        site.deliveries.see([summary("a", "FAILURE", "No data for 10 s."), summary("b", "OFF_SPEC")])
        await until(lambda: len(sink.shown) == 3)
        sink.lost_now.set()
        await until(lambda: len(sink.shown) == 5)
        assert sink.shown[2:] == [("b", "OFF_SPEC"), ("a", "FAILURE"), ("b", "OFF_SPEC")]
        assert other.shown == []

    play(ToldSite(sink, other), course)


class FailingStore(MemoryStore):
    """One that cannot be read for a while."""

    failures = 2

    def records_behind(self, number: int, most: int) -> list[tuple[int, NamedRecord]]:
        if self.failures:
            self.failures -= 1
            raise StoreError("kept.sqlite: cannot be read.")
        return super().records_behind(number, most)


def test_a_store_that_cannot_be_read_is_tried_again() -> None:
    """And is told of until it can."""

    async def course(site: ToldSite) -> None:
        await until(lambda: not site.health()["ok"])
        await until(lambda: site.health()["ok"])
        found = site.find("detection")
        await until(lambda: site.told == found)

    play(ToldSite(Told(), store=FailingStore()), course)
