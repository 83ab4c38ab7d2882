"""Sinks at work: each is its own task, which is lost and begun again without anybody else noticing.

Records are told in the order in which they came, each until the other side has it, at least once: after a kill those of
the last second are told again, as they were. What waits is in the store, so nothing has to be dropped. Of how assets
stand only the newest is told.
"""

import asyncio
import logging
import threading
import time
from collections import Counter
from collections.abc import Callable, Coroutine, Iterable, Mapping, Sequence
from contextlib import suppress

from faultbond.errors import FaultbondError, RefusedError, SinkError, StoreError
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord
from faultbond.service.contract.part import ServicePart
from faultbond.service.contract.sink import Link, Sink
from faultbond.service.contract.store import LogStore
from faultbond.service.sinks.outbox import Outbox

FIRST_DELAY, LONGEST_DELAY = 1.0, 60.0  # s before a sink that was lost is opened again
LONGEST_WISH = 600.0  # s for which the other side may want to be left alone
KEEP = 1.0  # s between two writings of how far a sink has come
TRIES = 5  # after which a record that is refused for what it is, is passed over
STANDING = ("status", "monitoring", "operation", "alarm", "best")  # what is told when one of these changes

_LOG = logging.getLogger(__name__)


class Delivery:
    """One sink at work.

    part: whether it tells, or why it does not; it does, too, where nothing was to be told yet.
    counts: records told and given up, summaries told, and how often the sink was lost.

    Parameters
    ----------
    sink : that tells
    outbox : what it has not told yet
    clock : gives Unix s
    """

    def __init__(self, sink: Sink, outbox: Outbox, clock: Callable[[], float]) -> None:
        self.sink, self._outbox, self._clock = sink, outbox, clock
        self.part = ServicePart(name=sink.address, since=clock())
        self.counts = Counter[str]()
        self._delay = FIRST_DELAY
        self._known: dict[str, Shown] = {}
        self._changed: dict[str, Shown] = {}
        self._refused = 0
        self._is_of_store = False
        self._woken = asyncio.Event()
        self._kept_at = time.monotonic()

    def health(self) -> Shown:
        """Tell whether it works, since when it does or does not, and what it told."""
        return {
            "ok": not self.part.trouble,
            "trouble": self.part.trouble,
            "since": self.part.since,
            "told": self.counts["told"],
            "given_up_records": self.counts["given up"],
            "behind": self._outbox.behind,
        }

    def hear(self, records: int) -> None:
        """Note that there are more records."""
        self._outbox.behind += records
        self._woken.set()

    def see(self, summaries: Iterable[Shown]) -> None:
        """Note how assets stand."""
        for summary in summaries if self.sink.shows else ():
            name = summary["name"]
            before = self._known.get(name)
            if before is None or any(before[key] != summary[key] for key in STANDING):
                self._known[name] = self._changed[name] = summary
                self._woken.set()

    async def run(self) -> None:
        """Tell until cancelled; where the other side is lost, begin again, later and later."""
        while True:
            try:
                async with self.sink.opened() as link:
                    self._changed = dict(self._known)  # the other side may have forgotten them
                    await _first_of(self._tell(link), link.lost())
            except (SinkError, StoreError) as error:
                wish = error.after if isinstance(error, SinkError) else 0.0
                self._note_trouble(error)
            except Exception as error:  # else a mistake in a sink would end the watching
                _LOG.exception("%s failed unforeseen", self.sink.address)
                wish = LONGEST_DELAY
                self._note_trouble(error)
            await asyncio.sleep(max(self._delay, min(wish, LONGEST_WISH)))
            self._delay = min(2.0 * self._delay, LONGEST_DELAY)

    def close(self) -> None:
        """Let the store know how far it came."""
        with suppress(StoreError):
            if not self._outbox.is_kept:
                self._outbox.keep()

    async def _tell(self, link: Link) -> None:
        while True:
            self._woken.clear()
            await self._show(link)
            waiting = await asyncio.to_thread(self._outbox.waiting)
            if self._is_of_store:
                self._note_success()
            for number, record in waiting:
                if record.kind in self.sink.kinds:
                    await self._pass_on(link, number, record)
                self._outbox.pass_by(number)
                await self._show(link)
            if not waiting:
                with suppress(TimeoutError):
                    await asyncio.wait_for(self._woken.wait(), None if self._outbox.is_kept else KEEP)
            if not self._outbox.is_kept and time.monotonic() - self._kept_at >= KEEP:
                await asyncio.to_thread(self._outbox.keep)
                self._kept_at = time.monotonic()

    async def _show(self, link: Link) -> None:
        """Tell how those assets stand that stand otherwise than was told."""
        while self._changed:
            name, summary = next(iter(self._changed.items()))
            await link.show(summary)
            self.counts["shown"] += 1
            self._note_success()
            if self._changed.get(name) is summary:
                del self._changed[name]

    async def _pass_on(self, link: Link, number: int, record: NamedRecord) -> None:
        """Tell a record, or pass it over where that is hopeless."""
        try:
            await link.pass_on(record)
        except SinkError as error:
            is_refused = isinstance(error, RefusedError)
            self._refused += is_refused
            if not (self._refused >= TRIES or self._is_hopeless()):
                raise
            self.counts["given up"] += 1
            self._refused = 0
            _LOG.error("%s: record %s is given up: %s", self.sink.address, record.id, error)
            if not is_refused:
                self._outbox.pass_by(number)
                raise
            self._note_success()  # it is there, and takes others
        else:
            self.counts["told"] += 1
            self._refused = 0
            self._note_success()

    def _is_hopeless(self) -> bool:
        limit = self.sink.give_up
        return limit is not None and bool(self.part.trouble) and self._clock() - self.part.since > limit

    def _note_trouble(self, error: Exception) -> None:
        why = str(error) if isinstance(error, FaultbondError) else f"{type(error).__name__}: {error}"
        self.part.fails(why, self._clock())
        self._is_of_store = isinstance(error, StoreError)
        self.counts["lost"] += 1

    def _note_success(self) -> None:
        self.part.works(self._clock())
        self._delay, self._is_of_store = FIRST_DELAY, False


class Deliveries:
    """All sinks of a site at work.

    Parameters
    ----------
    sinks : that tell
    store : that has the records
    lock : of the store
    clock : gives Unix s
    """

    def __init__(
        self, sinks: Sequence[Sink], store: LogStore, lock: threading.Lock, clock: Callable[[], float]
    ) -> None:
        self.all = tuple(Delivery(sink, Outbox(sink.name, store, lock), clock) for sink in sinks)

    def hear(self, records: Sequence[NamedRecord]) -> None:
        """Note records that are in the store now."""
        for item in self.all if records else ():
            item.hear(len(records))

    def see(self, summaries: Sequence[Shown]) -> None:
        """Note how assets stand."""
        for item in self.all:
            item.see(summaries)

    async def run(self) -> None:
        """Tell until cancelled."""
        try:
            async with asyncio.TaskGroup() as tasks:
                for item in self.all:
                    tasks.create_task(item.run())
        finally:
            for item in self.all:
                item.close()

    def health(self) -> Mapping[str, Shown]:
        """Tell which sinks work, and what they told."""
        return {f"tell {item.sink.name}": item.health() for item in self.all}


async def _first_of(*doing: Coroutine[None, None, None]) -> None:
    """Do several things until the first of them ends, and raise what ended it."""
    tasks = [asyncio.ensure_future(item) for item in doing]
    try:
        done, _ = await asyncio.wait(tasks, return_when=asyncio.FIRST_COMPLETED)
        for task in done:
            task.result()
    finally:
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)
