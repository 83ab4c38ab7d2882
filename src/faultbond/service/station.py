"""The service at work: arrivals and deeds go through one worker in order, and what is in the store is told to all."""

import asyncio
import threading
import time
from collections.abc import AsyncIterator, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing, suppress
from dataclasses import dataclass
from typing import Any

from faultbond.errors import SourceError, StoreError
from faultbond.service.contract.face import Request, Shown
from faultbond.service.contract.messages import Action, Arrivals, Deed
from faultbond.service.contract.sink import Sink
from faultbond.service.contract.source import LiveSource, Subscriber
from faultbond.service.contract.store import LogStore
from faultbond.service.hub import Hub
from faultbond.service.sinks.delivery import Deliveries
from faultbond.service.sinks.measures import ServiceMeasures, families
from faultbond.service.sinks.openmetrics import exposition
from faultbond.service.site import Site
from faultbond.service.site_log import AssetPlan, Done, SiteLog
from faultbond.service.site_view import SiteView

MOST_WAITING = 1000  # arrivals and deeds between the sources and the worker; more wait in the sources
MOST_TOGETHER = 200  # of them that make one transaction
TICK = 1.0  # s between two looks at who has gone silent
FORGET_EVERY = 600.0  # s between two looks at what is too old
FIRST_DELAY, LONGEST_DELAY = 1.0, 60.0  # s before a source that was lost is opened again
RETRY = 1.0  # s before the store is tried again
SETTLING = 0.05  # s between two looks at whether what came of a source is in the store

Open = Callable[[str, Sequence[Subscriber]], LiveSource]


@dataclass(slots=True)
class _Feed:
    """A source.

    pending: arrivals of it that are not in the store yet. trouble: why it gives nothing now, since when; empty: it
    does. ended: it has nothing more.
    """

    source: LiveSource
    assets: tuple[str, ...]
    pending: int = 0
    trouble: str = ""
    since: float = 0.0
    ended: bool = False


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Wish:
    """A deed that somebody waits for."""

    deed: Deed
    answer: "asyncio.Future[Deed]"


def _stands_alone(item: Arrivals | _Wish) -> bool:
    """Whether nothing is done together with an item: what takes back reads the log, in which all before it must be."""
    return isinstance(item, _Wish) and item.deed.action is Action.UNDO


class Service:
    """Watches a site and answers for it; it has the face that the page asks.

    Parameters
    ----------
    site : what is watched
    store : that keeps it
    open_source : gives the source of an address, for who it feeds
    hear : is given what came of every item once it is in the store
    sinks : tell others what is found
    clock : gives Unix s
    """

    def __init__(
        self,
        site: Site,
        store: LogStore,
        open_source: Open,
        *,
        hear: Callable[[Done], None] | None = None,
        sinks: Sequence[Sink] = (),
        clock: Callable[[], float] = time.time,
    ) -> None:
        self._site, self._store, self._clock = site, store, clock
        self._hear = hear or (lambda _: None)
        self._log = SiteLog(
            [AssetPlan(name=item.name, plant=item.plant, accept=item.accept) for item in site.assets], store
        )
        self._version = next(iter(self._log.assets.values())).spec.version
        self._began = clock()
        self._lock = threading.Lock()  # of assets and store, between the worker and those who ask
        self._view = SiteView(site, self._log, store, self._lock, clock)
        self._sinks = Deliveries(sinks, store, self._lock, clock)
        addresses = dict.fromkeys(item.source for item in site.assets)
        self._feeds = tuple(self._feed(address, open_source) for address in addresses)
        self._fed = {name: feed for feed in self._feeds for name in feed.assets}
        self._hub = Hub()
        self._inbox: asyncio.Queue[Arrivals | _Wish] = asyncio.Queue(MOST_WAITING)
        self._next: Arrivals | _Wish | None = None  # taken from it, to be done by itself
        self._store_trouble = ""

    async def run(self) -> None:
        """Watch until cancelled, or until a part fails unforeseen; then keep all assets as they stand."""
        with ThreadPoolExecutor(1, thread_name_prefix="core") as worker:
            try:
                async with asyncio.TaskGroup() as tasks:
                    for feed in self._feeds:
                        tasks.create_task(self._pump(feed))
                    tasks.create_task(self._work(worker))
                    tasks.create_task(self._tick())
                    tasks.create_task(self._sinks.run())
            except ExceptionGroup as failed:
                raise failed.exceptions[0] from failed
            finally:
                self._view.is_stopped = True
                self._hub.close()
                with self._lock:
                    self._log.close()

    # What the page asks: see `face.Face`.

    def site(self) -> Shown:
        """Give the overview."""
        return {
            "name": self._site.name,
            "version": self._version,
            "now": self._clock(),
            "source": ", ".join(feed.source.address for feed in self._feeds),
            "assets": self._view.summaries(),
        }

    def asset(self, name: str) -> Shown:
        """Give an asset."""
        return self._view.asset(name)

    def curves(self, name: str, begin: float | None, end: float | None, most: int) -> Shown:
        """Give curves of an asset, those of the memory where no period is given."""
        return self._view.curves(name, begin, end, most)

    def report(self, name: str) -> str:
        """Give the report of what an asset saw lately."""
        return self._view.report(name)

    def health(self) -> Mapping[str, Any]:
        """Tell which parts work."""
        parts: dict[str, Shown] = {
            feed.source.address: {
                "ok": not feed.trouble and not feed.ended,
                "trouble": feed.trouble or ("it has ended" if feed.ended else ""),
                "since": feed.since or self._began,
            }
            for feed in self._feeds
        }
        parts["store"] = {"ok": not self._store_trouble, "trouble": self._store_trouble, "since": self._began}
        parts |= self._sinks.health()
        return {"ok": all(part["ok"] for part in parts.values()) and not self._view.is_stopped, "parts": parts}

    def metrics(self, viewers: int) -> str:
        """Give what is measured, as OpenMetrics has it."""
        service = ServiceMeasures(
            version=self._version,
            sources={name: not feed.trouble and not feed.ended for name, feed in self._fed.items()},
            store_works=not self._store_trouble,
            sinks={item.sink.name: item.health() for item in self._sinks.all},
            viewers=viewers,
        )
        return exposition(families(self._view.measures(), service))

    def listen(self, most: int = 100) -> AsyncIterator[tuple[str, Shown]]:
        """Give what happens from now on."""
        return self._hub.listen(most)

    async def do(self, request: Request) -> Shown:
        """Do what a person wants, in its place among the rows.

        Raises
        ------
        KeyError
            Where there is no such asset.
        FaultbondError
            Where it makes no sense now.
        StoreError
            Where it cannot be kept yet.
        """
        now = self._clock()
        if request.asset not in self._log.assets:
            raise KeyError(request.asset)
        deed = Deed(
            asset=request.asset,
            action=request.action,
            at=now,
            who=request.who,
            rows=0,
            comment=request.comment,
            target=tuple(request.target),
            until=now + 60.0 * request.minutes if request.minutes is not None else None,
            undone=request.undone,
        )
        answer: asyncio.Future[Deed] = asyncio.get_running_loop().create_future()
        await self._inbox.put(_Wish(deed=deed, answer=answer))
        await answer
        return await asyncio.to_thread(self._view.newest_deed, request.asset)

    # The tasks.

    async def _pump(self, feed: _Feed) -> None:
        """Take what a source gives; open it again, later and later, where it is lost."""
        delay = FIRST_DELAY
        while True:
            while feed.pending:  # then its cursors are known
                await asyncio.sleep(SETTLING)
            cursors = {name: at for name, at in self._log.cursors.items() if name in feed.assets}
            try:
                async with aclosing(feed.source.arrivals(cursors)) as coming:
                    async for arrivals in coming:
                        feed.trouble, feed.since, delay = "", 0.0, FIRST_DELAY
                        feed.pending += 1
                        await self._inbox.put(arrivals)
                feed.ended, feed.since = True, self._clock()
                return
            except SourceError as error:
                feed.trouble, feed.since = str(error), feed.since or self._clock()
            await asyncio.sleep(delay)
            delay = min(2.0 * delay, LONGEST_DELAY)

    async def _work(self, worker: ThreadPoolExecutor) -> None:
        """Pass items on to the assets, write what came of them, and tell it."""
        loop = asyncio.get_running_loop()
        while True:
            items = await self._gathered()
            done, error = await loop.run_in_executor(worker, self._take, items)
            if error is not None:
                await self._settle(worker, items, error)
            self._answer(items, done)
            if self._hub.n_listeners:
                for name, content in await loop.run_in_executor(worker, self._view.news, done):
                    self._hub.publish(name, content)
            for item in items:
                if isinstance(item, Arrivals):
                    self._fed[item.asset].pending -= 1

    async def _gathered(self) -> list[Arrivals | _Wish]:
        """Wait for an item, and give it with all that have come besides."""
        first, self._next = self._next or await self._inbox.get(), None
        items = [first]
        while len(items) < MOST_TOGETHER and not self._inbox.empty() and not _stands_alone(first):
            item = self._inbox.get_nowait()
            if _stands_alone(item):
                self._next = item
                break
            items.append(item)
        return items

    def _take(self, items: Sequence[Arrivals | _Wish]) -> tuple[list[Done], StoreError | None]:
        """Pass items on and write what came of them, so that nobody sees what is not written, unless that fails."""
        with self._lock:
            for item in items:
                if isinstance(item, Arrivals):
                    self._view.note(item)
            done = self._log.take([item.deed if isinstance(item, _Wish) else item for item in items])
            try:
                self._log.settle()
            except StoreError as error:
                return done, error
            return done, None

    async def _settle(
        self, worker: ThreadPoolExecutor, items: Sequence[Arrivals | _Wish], error: StoreError | None
    ) -> None:
        """Say to who waits that it could not be written, and try until it is."""
        for item in items:
            if isinstance(item, _Wish) and not item.answer.done():
                item.answer.set_exception(StoreError(f"{error} It is tried again until it is written."))
        while error is not None:
            self._store_trouble = str(error)
            await asyncio.sleep(RETRY)
            error = await asyncio.get_running_loop().run_in_executor(worker, self._settled)
        self._store_trouble = ""

    def _settled(self) -> StoreError | None:
        with self._lock:
            try:
                self._log.settle()
            except StoreError as error:
                return error
            return None

    def _answer(self, items: Sequence[Arrivals | _Wish], done: Sequence[Done]) -> None:
        for item, what in zip(items, done, strict=True):
            self._hear(what)
            self._sinks.hear(what.outcome.records)
            if not isinstance(item, _Wish) or item.answer.done():
                continue
            if what.error is not None:
                item.answer.set_exception(what.error)
            elif what.deed is not None:
                item.answer.set_result(what.deed)

    async def _tick(self) -> None:
        """Tell who has gone silent, or whose shelf has ended."""
        known: dict[str, tuple[Any, ...]] = {}
        forgotten = self._clock()
        while True:
            await asyncio.sleep(TICK)
            if self._site.days is not None and self._clock() - forgotten >= FORGET_EVERY:
                forgotten = self._clock()
                await asyncio.to_thread(self._forget, forgotten - 86400.0 * self._site.days)
            summaries = await asyncio.to_thread(self._view.summaries)
            self._sinks.see(summaries)
            for summary in summaries:
                now = tuple(str(summary[key]) for key in ("status", "monitoring", "alarm"))
                if known.get(summary["name"], now) != now:
                    self._hub.publish("summary", summary)
                known[summary["name"]] = now

    def _forget(self, older_than: float) -> None:
        """Forget rows and curves from before a time."""
        with self._lock, suppress(StoreError):  # a store that fails is told where it is written
            self._store.retain(older_than=older_than)

    def _feed(self, address: str, open_source: Open) -> _Feed:
        fed = [item for item in self._site.assets if item.source == address]
        subscribers = [Subscriber(asset=item.name, columns=item.plant.columns, graph=item.plant.graph) for item in fed]
        return _Feed(source=open_source(address, subscribers), assets=tuple(item.name for item in fed))
