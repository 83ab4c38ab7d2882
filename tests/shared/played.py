"""A service that watches the loop in a test: rows from a recording at once, losses, and clocks that a test sets."""

import asyncio
from collections.abc import AsyncGenerator, Awaitable, Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from arriving import Announced
from faultbond.errors import SourceError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.face import Request, Shown
from faultbond.service.contract.messages import Action, Arrivals
from faultbond.service.contract.source import LiveSource, Subscriber
from faultbond.service.contract.store import LogStore
from faultbond.service.site import Site, SiteAsset
from faultbond.service.station import Service
from faultbond.service.supervisor import RestartPolicy
from loop_asset import FOUND, plant, rows
from memory_store import MemoryStore

TIMEOUT = 300.0  # s after which a test hangs, however busy the machine is
TODAY = 1_795_000_000.0  # Unix s
QUICK = RestartPolicy(most=3, delay=0.01, longest=0.02)


class Clock:
    """Seconds that a test sets."""

    def __init__(self, now: float = 1000.0) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


class PlayedSource:
    """Gives portions of rows from its cursor on. lost_at: where it is lost, so many times. pace: s between portions.
    jump: from which row on its clock is set, by so many s. hold_at: where it waits for `holds`.
    deaf_at: from which row on no sensor gives a value.

    ends: lets it end.
    """

    address = "played:"

    def __init__(
        self,
        clock: Clock,
        subscribers: Sequence[Subscriber],
        *,
        portion: int = 50,
        last: int = FOUND,
        lost_at: int | None = None,
        loss: Exception | None = None,
        losses: int = 1,
        pace: float = 0.0,
        jump: tuple[int, float] | None = None,
        hold_at: int | None = None,
        deaf_at: int | None = None,
    ) -> None:
        self.clock, self.subscribers, self.portion, self.last, self.pace = clock, subscribers, portion, last, pace
        self.lost_at, self.loss, self.losses = lost_at, loss or SourceError("played: is gone"), losses
        self.jump, self.hold_at, self.deaf_at = jump, hold_at, deaf_at
        self.begun: list[str] = []
        self.ends, self.holds = asyncio.Event(), asyncio.Event()

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """See `LiveSource`."""
        first = int(cursors.get("loop") or 0)
        self.begun.append(str(first))
        while first < self.last:
            if self.lost_at is not None and first >= self.lost_at and self.losses:
                self.losses -= 1
                raise self.loss
            last = min(first + self.portion, self.last)
            some: RowBlock = rows().part(slice(first, last))
            if self.jump is not None and first >= self.jump[0]:
                some = replace(some, time=some.time + self.jump[1])
            if self.deaf_at is not None and first >= self.deaf_at:
                some = replace(some, y=np.full_like(some.y, np.nan))
            for item in self.subscribers:
                yield Arrivals(
                    asset=item.asset, rows=some, arrived=self.clock(), cursor=str(last), counts={"dropped": 1}
                )
            first = last
            await asyncio.sleep(self.pace)
            if self.hold_at is not None and first >= self.hold_at:
                await self.holds.wait()
        await self.ends.wait()


class Played:
    """A service that watches the loop in a test. announced: its source."""

    announced: Announced

    def __init__(
        self,
        store: LogStore | None = None,
        *,
        assets: Sequence[str] = ("loop",),
        hear: Callable[[object], None] | None = None,
        steady: Callable[[], float] | None = None,
        opened: Callable[[str, Sequence[Subscriber]], LiveSource] | None = None,
        more: Mapping[str, Any] | None = None,
        **source: Any,
    ) -> None:
        self.clock, self.steady = Clock(TODAY), Clock()
        self.store: Any = store or MemoryStore()
        self._said, self.source = source, PlayedSource(self.clock, ())
        opened = self._opened if opened is None else opened

        def announced(address: str, subscribers: Sequence[Subscriber]) -> LiveSource:
            self.announced = Announced(opened(address, subscribers))
            return self.announced

        listed = tuple(SiteAsset(name=name, plant=plant(), source="played:") for name in assets)
        site = Site(**{"name": "hall", "assets": listed, **(more or {})})
        self.service = Service(
            site,
            self.store,
            announced,
            hear=hear,
            clock=self.clock,
            steady=steady or self.steady,
            policy=QUICK,
        )

    def _opened(self, address: str, subscribers: Sequence[Subscriber]) -> LiveSource:
        self.source = PlayedSource(self.clock, subscribers, **self._said)
        return self.source

    @property
    def summary(self) -> Shown:
        """The summary of the loop."""
        return dict(self.service.site()["assets"][0])

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
