"""A store with records, sinks that note what they are told of it, and what tests wait for."""

import asyncio
import threading
from collections.abc import AsyncIterator, Callable
from contextlib import asynccontextmanager
from typing import Any

from faultbond.errors import SinkError
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord
from faultbond.service.contract.sink import Sink
from faultbond.service.contract.store import Commit
from faultbond.service.sinks.delivery import Deliveries
from memory_store import MemoryStore
from stored import enrolment, told


class Told:
    """A sink that notes what it is told. fails: errors that come first, one at each record."""

    address, kinds = "told:", frozenset({"detection", "diagnosis"})

    def __init__(self, name: str = "one", *, shows: bool = False, give_up: float | None = None) -> None:
        self.name, self.shows, self.give_up = name, shows, give_up
        self.fails: list[Exception] = []
        self.records: list[str] = []
        self.shown: list[tuple[str, str]] = []
        self.opened_at: list[float] = []
        self.is_shut = False
        self.lost_now = asyncio.Event()

    @asynccontextmanager
    async def opened(self) -> AsyncIterator["Told"]:
        self.opened_at.append(asyncio.get_running_loop().time())
        if self.is_shut:
            raise SinkError("told: nobody is there")
        yield self

    async def show(self, summary: Shown) -> None:
        self.shown.append((summary["name"], summary["status"]))

    async def pass_on(self, record: NamedRecord) -> None:
        await asyncio.sleep(0)
        if self.fails:
            raise self.fails.pop(0)
        self.records.append(record.id)

    async def lost(self) -> None:
        await self.lost_now.wait()
        self.lost_now.clear()
        raise SinkError("told: is gone")


class Clock:
    """Unix seconds that a test sets."""

    now = 1000.0

    def __call__(self) -> float:
        return self.now


class ToldSite:
    """A store with an asset, and sinks that are told of it."""

    def __init__(self, *sinks: Sink, store: MemoryStore | None = None) -> None:
        self.store, self.clock, self.sinks = store or MemoryStore(), Clock(), sinks
        self.store.enrol(enrolment())
        self.deliveries = Deliveries(sinks, self.store, threading.Lock(), self.clock)
        self.number = len(list(self.store.records()))

    @property
    def told(self) -> list[str]:
        """The records that the first sink was told."""
        first = self.sinks[0]
        assert isinstance(first, Told)
        return first.records

    def find(self, *kinds: str) -> list[str]:
        """Let records come into the store, and give their names."""
        records = []
        for kind in kinds:
            self.number += 1
            records.append(told("pump", self.number, kind))
        self.store.commit([Commit(asset="pump", records=tuple(records))])
        self.deliveries.hear(records)
        return [item.id for item in records]

    def health(self, name: str = "one") -> Shown:
        """Give what is told of a sink."""
        return self.deliveries.health()[f"tell {name}"]


async def until(is_so: Callable[[], Any]) -> None:
    """Wait for something."""
    while not is_so():
        await asyncio.sleep(0.005)


def summary(name: str, status: str, headline: str = "", **more: object) -> Shown:
    """How an asset stands."""
    rest = dict.fromkeys(("monitoring", "operation", "alarm", "best"))
    return {"name": name, "status": status, "headline": headline, **rest, **more}
