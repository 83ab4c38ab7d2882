"""The service at work: arrivals and deeds go through one worker in order, and what is in the store is told to all."""

import asyncio
import logging
import threading
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from contextlib import aclosing, suppress
from dataclasses import dataclass, field
from functools import partial
from typing import Any

from faultbond.errors import SourceError, StoreError
from faultbond.report.numbers import clock_text, duration_text
from faultbond.service.contract.face import Request, Shown
from faultbond.service.contract.messages import Action, Arrivals, AuditEntry, Deed
from faultbond.service.contract.part import ServicePart
from faultbond.service.contract.sink import Sink
from faultbond.service.contract.source import LiveSource, Subscriber
from faultbond.service.contract.store import Forgotten, LogStore
from faultbond.service.hub import Hub
from faultbond.service.memory import give_back
from faultbond.service.offline.desk import OfflineDesk
from faultbond.service.sinks.delivery import Deliveries
from faultbond.service.sinks.measures import ServiceMeasures, families
from faultbond.service.sinks.openmetrics import exposition
from faultbond.service.site import Site
from faultbond.service.site_log import AssetPlan, Done, SiteLog
from faultbond.service.site_view import SiteView
from faultbond.service.supervisor import RestartPolicy, supervise
from faultbond.service.wall_clock import WallClock

MOST_WAITING = 1000  # arrivals and deeds between the sources and the worker; more wait in the sources
MOST_TOGETHER = 200  # of them that make one transaction
MOST_ROWS = 5000  # in it, and those of one arrival
LONGEST_TURN = 0.5  # s that it should take, after which others may ask; after an alarm a row takes many times as long
TICK = 1.0  # s between two looks at who has gone silent
FORGET_EVERY = 600.0  # s between two looks at what is too old
GIVE_BACK_EVERY = 60.0  # s between two times at which memory that is free goes back to the system
FIRST_DELAY, LONGEST_DELAY = 1.0, 60.0  # s before a source that was lost is opened again
RETRY = 1.0  # s before the store is tried again
DEED_PATIENCE = 10.0  # s that who wants something waits, as for a server that begins anew, before that is refused
LONGEST_STEP = 30.0  # s that the worker may be at one step, before it is taken for stuck
LOST = "source lost"  # the name under which it is counted
SETTLING = 0.05  # s between two looks at whether what came of a source is in the store

_LOG = logging.getLogger(__name__)

Open = Callable[[str, Sequence[Subscriber]], LiveSource]


@dataclass(slots=True)
class _Feed:
    """A source. pending: arrivals of it that are not in the store yet."""

    source: LiveSource
    assets: tuple[str, ...]
    part: ServicePart
    pending: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class _Wish:
    """A deed that somebody waits for. taken: once it is being done, and cannot be called off."""

    deed: Deed
    answer: "asyncio.Future[Deed]"
    taken: asyncio.Event = field(default_factory=asyncio.Event)


def _stands_alone(item: Arrivals | _Wish) -> bool:
    """Whether nothing is done together with an item: what takes back reads the log, in which all before it must be."""
    return isinstance(item, _Wish) and item.deed.action is Action.UNDO


def _is_called_off(item: Arrivals | _Wish) -> bool:
    """Whether who wanted it waits no longer, and has been told that it is not done."""
    return isinstance(item, _Wish) and item.answer.cancelled()


def _n_rows(item: Arrivals | _Wish) -> int:
    return len(item.rows) if isinstance(item, Arrivals) else 0


class Service:
    """Watches a site and answers for it; it has the face that the page asks.

    Parameters
    ----------
    site : what is watched
    store : that keeps it
    open_source : gives the source of an address, for who it feeds
    hear : is given what came of every item once it is in the store
    sinks : tell others what is found
    clock : gives Unix s, of the system's clock, which may be set
    steady : gives s that only grow, by which it is known who is silent
    policy : how often a source may fail unforeseen
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
        steady: Callable[[], float] = time.monotonic,
        policy: RestartPolicy | None = None,
    ) -> None:
        self._site, self._store, self._clock, self._steady = site, store, clock, steady
        self._hear = hear or (lambda _: None)
        self._assets = {item.name: ServicePart(name=f"asset {item.name}", since=clock()) for item in site.assets}
        plans = [AssetPlan(name=item.name, plant=item.plant, accept=item.accept) for item in site.assets]
        self._log = SiteLog(plans, store, give_up=self._give_up)
        self._version = next(iter(self._log.assets.values())).spec.version
        self._lock = threading.Lock()  # of assets and store, between the worker and those who ask
        self._sinks = Deliveries(sinks, store, self._lock, clock)
        addresses = dict.fromkeys(item.source for item in site.assets)
        self._feeds = tuple(self._feed(address, open_source) for address in addresses)
        self._fed = {name: feed for feed in self._feeds for name in feed.assets}
        own = (ServicePart(name=name, since=clock()) for name in ("worker", "store", "disk", "page"))
        self._core, self._kept, self._disk, self._telling = own
        parts = {name: (feed.part, self._kept, self._assets[name]) for name, feed in self._fed.items()}
        self._view = SiteView(site, self._log, store, self._lock, clock, steady, parts)
        self._wall = WallClock(clock, steady)
        self._answered = steady()  # when the worker was seen at work or idle
        self._policy = policy or RestartPolicy()
        plants = {item.name: item.plant for item in site.assets}
        self.desk = OfflineDesk(site.offline, plants, self.note, clock) if site.offline is not None else None
        self._off_line = ServicePart(name="off line", since=clock())
        self._hub = Hub()
        self._inbox: asyncio.Queue[Arrivals | _Wish] = asyncio.Queue(MOST_WAITING)
        self._most_rows = MOST_ROWS  # that are taken together, as fast as they have gone of late
        self._next: Arrivals | _Wish | None = None  # taken from it, to be done by itself

    async def run(self) -> None:
        """Watch until cancelled, or until what cannot be begun anew fails; then keep all assets as they stand.

        A source that fails unforeseen is begun anew, an asset that does is given up. The worker and its store are
        neither: what they were at may be half done, and is whole after a restart.
        """
        with ThreadPoolExecutor(1, thread_name_prefix="core") as worker:
            try:
                async with asyncio.TaskGroup() as tasks:
                    for feed in self._feeds:
                        tasks.create_task(self._supervised(partial(self._pump, feed), feed.part))
                    tasks.create_task(self._work(worker))
                    tasks.create_task(self._look(worker))
                    tasks.create_task(self._supervised(self._tick, self._telling))
                    tasks.create_task(self._sinks.run())
                    if self.desk is not None:
                        tasks.create_task(self._supervised(self.desk.run, self._off_line))
            except ExceptionGroup as failed:
                raise failed.exceptions[0] from failed
            finally:
                self._view.is_stopped = True
                self._hub.close()
                with self._lock:
                    self._log.close()

    @property
    def is_alive(self) -> bool:
        """Whether the worker answers; one that is stuck needs another process."""
        return self._steady() - self._answered < LONGEST_STEP

    # What the page asks: see `face.Face`.

    def site(self) -> Shown:
        """Give the overview."""
        return {
            "name": self._site.name,
            "version": self._version,
            "now": self._clock(),
            "source": ", ".join(feed.source.address for feed in self._feeds),
            "assets": self._view.summaries(),
            "troubles": self._troubles(),
        }

    def asset(self, name: str) -> Shown:
        """Give an asset."""
        return self._view.asset(name)

    def picture(self, name: str) -> str:
        """Give the picture of the process of an asset; empty where there is none."""
        return self._view.picture(name)

    def curves(self, name: str, begin: float | None, end: float | None, most: int) -> Shown:
        """Give curves of an asset, those of the memory where no period is given."""
        return self._view.curves(name, begin, end, most)

    def report(self, name: str) -> str:
        """Give the report of what an asset saw lately."""
        return self._view.report(name)

    def health(self) -> Mapping[str, Any]:
        """Tell which parts work."""
        failed = [part for part in self._assets.values() if part.is_given_up]
        parts = (*(feed.part for feed in self._feeds), *failed)
        shown = {part.name: part.shown() for part in parts} | self._own_parts()
        return {
            "ok": all(part["ok"] for part in shown.values()) and not self._view.is_stopped,
            "clock_jumps": self._wall.n_jumps,
            "parts": shown,
        }

    def metrics(self, viewers: int) -> str:
        """Give what is measured, as OpenMetrics has it."""
        service = ServiceMeasures(
            version=self._version,
            sources={name: not feed.part.trouble for name, feed in self._fed.items()},
            store_works=not self._kept.trouble,
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
            Where it cannot be kept yet, and is tried again; or where nothing was done, as it says then.
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
        wish = _Wish(deed=deed, answer=asyncio.get_running_loop().create_future())
        try:
            async with asyncio.timeout(DEED_PATIENCE):
                await self._inbox.put(wish)
                await wish.taken.wait()
        except TimeoutError:
            if not wish.taken.is_set():  # it may have been at the same moment
                wish.answer.cancel()
                why = self._kept.trouble or "The service is busy."
                raise StoreError(f"{why} Nothing was done; try again.") from None
        await wish.answer
        return await asyncio.to_thread(self._view.newest_deed, request.asset)

    async def note(self, entry: AuditEntry) -> None:
        """Keep what a person did that is about no asset; it is on the disk when this returns.

        Raises
        ------
        StoreError
            Where it cannot be kept, for as long as who wants something waits.
        """
        clock = asyncio.get_running_loop().time
        ends = clock() + DEED_PATIENCE
        while (error := await asyncio.to_thread(self._noted, entry, ends - clock())) is not None:
            if clock() + RETRY >= ends:
                raise StoreError(f"{error} Nothing was done; try again.")
            await asyncio.sleep(RETRY)

    def _noted(self, entry: AuditEntry, patience: float) -> StoreError | None:
        """Keep what a person did, once others let go of the store; give why that cannot be."""
        if not self._lock.acquire(timeout=max(patience, 0.0)):
            return StoreError(self._kept.trouble or "The service is busy.")
        try:
            self._store.note(entry)
        except StoreError as error:
            return error
        finally:
            self._lock.release()
        return None

    # The tasks.

    async def _supervised(self, work: Callable[[], Awaitable[None]], part: ServicePart) -> None:
        """Do the work of a part that can be begun anew."""
        await supervise(work, part, policy=self._policy, clock=self._clock, steady=time.monotonic)

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
                        feed.part.works(self._clock())
                        delay = FIRST_DELAY
                        if arrivals:
                            feed.pending += 1
                            await self._inbox.put(arrivals)
                feed.part.ends(self._clock())
                return
            except SourceError as error:
                if not feed.part.trouble:
                    await asyncio.to_thread(self._view.count, feed.assets, LOST)
                feed.part.fails(str(error), self._clock())
            await asyncio.sleep(delay)
            delay = min(2.0 * delay, LONGEST_DELAY)

    async def _work(self, worker: ThreadPoolExecutor) -> None:
        """Take what comes; what is in the store when all is to end is told yet, as nobody tells it later."""
        while True:
            turn = asyncio.create_task(self._pass_on(worker, await self._gathered()))
            try:
                await asyncio.shield(turn)
            except asyncio.CancelledError:
                if not self._kept.trouble:
                    await asyncio.wait([turn], timeout=LONGEST_STEP)
                turn.cancel()
                raise

    async def _pass_on(self, worker: ThreadPoolExecutor, items: Sequence[Arrivals | _Wish]) -> None:
        """Pass items on to the assets, write what came of them, and tell it."""
        begun, n_rows = time.monotonic(), sum(map(_n_rows, items))
        done, error = await asyncio.get_running_loop().run_in_executor(worker, self._take, items)
        if n_rows:
            fitting = n_rows * LONGEST_TURN / max(time.monotonic() - begun, 1e-6)
            self._most_rows = int(min(max(fitting, 1.0), MOST_ROWS))
        if error is not None:
            await self._settle(worker, items, error)
        self._answer(items, done)
        if self._hub.n_listeners:
            await self._tell(worker, done)
        for item in items:
            if isinstance(item, Arrivals):
                self._fed[item.asset].pending -= 1

    async def _tell(self, worker: ThreadPoolExecutor, done: Sequence[Done]) -> None:
        """Tell what was done, once the store can be read for that; who listens misses what else cannot be told."""
        while True:
            try:
                news = await asyncio.get_running_loop().run_in_executor(worker, self._view.news, done)
            except StoreError as error:
                self._kept.fails(str(error), self._clock())
                await asyncio.sleep(RETRY)
            except Exception as error:
                if not self._telling.trouble:
                    self._telling.breaks(error, self._clock(), is_over=False)
                return
            else:
                break
        self._kept.works(self._clock())
        for name, content in news:
            self._hub.publish(name, content)

    def _own_parts(self) -> dict[str, Mapping[str, Any]]:
        """Give how all stands that is about no asset in particular."""
        desk = () if self.desk is None else (self._off_line,)
        parts = (self._working(), self._kept, self._disk, self._telling, *desk)
        return {part.name: part.shown() for part in parts} | {**self._sinks.health()}

    def _troubles(self) -> list[str]:
        """Say what of it does not work, a sentence each."""
        return [f"{name}: {part['trouble']}" for name, part in self._own_parts().items() if not part["ok"]]

    def _reserve(self) -> None:
        """See that the store has its reserve."""
        with self._lock:
            lack = self._store.reserve()
        if lack:
            self._disk.fails(lack, self._clock())
        else:
            self._disk.works(self._clock())

    async def _look(self, worker: ThreadPoolExecutor) -> None:
        """See again and again that the worker answers."""
        while True:
            await asyncio.get_running_loop().run_in_executor(worker, int)
            self._answered = self._steady()
            await asyncio.sleep(TICK)

    def _working(self) -> ServicePart:
        """Give how the worker stands."""
        silence = self._steady() - self._answered
        if self.is_alive:
            self._core.works(self._clock())
        else:
            told = f"it has been at one step for {duration_text(silence, digits=2)}"
            self._core.fails(told, self._clock() - silence)
        return self._core

    async def _gathered(self) -> list[Arrivals | _Wish]:
        """Wait for an item, and give it with all that have come besides."""
        first, self._next = self._next or await self._inbox.get(), None
        items, n_rows = [first], _n_rows(first)
        while (
            len(items) < MOST_TOGETHER
            and n_rows < self._most_rows
            and not self._inbox.empty()
            and not _stands_alone(first)
        ):
            item = self._inbox.get_nowait()
            if _stands_alone(item):
                self._next = item
                break
            items.append(item)
            n_rows += _n_rows(item)
        items = [item for item in items if not _is_called_off(item)]
        for item in items:
            if isinstance(item, _Wish):
                item.taken.set()
        return items

    def _take(self, items: Sequence[Arrivals | _Wish]) -> tuple[list[Done], StoreError | None]:
        """Pass items on and write what came of them, so that nobody sees what is not written, unless that fails."""
        with self._lock:
            done = self._log.take([item.deed if isinstance(item, _Wish) else item for item in items])
            for item, what in zip(items, done, strict=True):
                if isinstance(item, Arrivals):
                    self._view.note(item, is_dropped=what.error is not None)
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
            self._kept.fails(str(error), self._clock())
            await asyncio.sleep(RETRY)
            error = await asyncio.get_running_loop().run_in_executor(worker, self._settled)
        self._kept.works(self._clock())

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

    def _give_up(self, asset: str, error: Exception) -> None:
        """Note that an asset is not watched any more; the others are."""
        self._assets[asset].breaks(error, self._clock(), is_over=True)

    async def _tick(self) -> None:
        """Tell who has gone silent, or whose shelf has ended."""
        known: dict[str, tuple[Any, ...]] = {}
        troubles, forgotten, given_back = list[str](), self._steady(), self._steady()
        while True:
            await asyncio.sleep(TICK)
            moved = self._wall.jumped()
            if moved:
                self._set_clock(moved)
            if self._steady() - forgotten >= FORGET_EVERY:
                went = await asyncio.to_thread(self._forget)
                forgotten = forgotten if went.is_any else self._steady()  # there may be more, after those who wait
            if self._steady() - given_back >= GIVE_BACK_EVERY:
                await asyncio.to_thread(give_back)
                given_back = self._steady()
            await asyncio.to_thread(self._reserve)
            if troubles != self._troubles():
                troubles = self._troubles()
                self._hub.publish("service", {"troubles": troubles})
            summaries = await asyncio.to_thread(self._view.summaries)
            self._sinks.see(summaries)
            for summary in summaries:
                now = tuple(str(summary[key]) for key in ("status", "monitoring", "alarm"))
                if known.get(summary["name"], now) != now:
                    self._hub.publish("summary", summary)
                known[summary["name"]] = now

    def _set_clock(self, moved: float) -> None:
        """Tell that the clock of the machine was set, and go on with moments of before by the new one."""
        told = (
            f"The clock of this machine was set {'forward' if moved > 0.0 else 'back'} by {duration_text(abs(moved))}"
        )
        _LOG.warning("%s.", told)
        own = (self._core, self._kept, self._disk, self._telling)
        for part in (*(feed.part for feed in self._feeds), *self._assets.values(), *own):
            part.since += moved
        self._view.set_clock(moved, f"{told}; it was then {clock_text(self._clock())}.")

    def _forget(self) -> Forgotten:
        """Forget rows and curves that are too old, and the oldest of a store that is too large; give what went."""
        days, size = self._site.days, self._site.size
        if days is None and size is None:
            return Forgotten()
        older_than = None if days is None else self._wall.believed() - 86400.0 * days
        with self._lock, suppress(StoreError):  # a store that fails is told where it is written
            return self._store.retain(older_than=older_than, at_most=size)
        return Forgotten()

    def _feed(self, address: str, open_source: Open) -> _Feed:
        fed = [item for item in self._site.assets if item.source == address]
        subscribers = [Subscriber(asset=item.name, columns=item.plant.columns, graph=item.plant.graph) for item in fed]
        source = open_source(address, subscribers)
        part = ServicePart(name=source.address, since=self._clock())
        return _Feed(source=source, assets=tuple(item.name for item in fed), part=part)
