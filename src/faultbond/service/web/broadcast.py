"""What happens, told to all viewers of the page: the service is listened to once, and each event is written once.

The answer to a viewer is a stream of server-sent events. It begins with what is so now, `site` and `asset`, and goes
on with what happens; both come in one stream so that nothing can overtake. `alive` comes at least every few seconds: a
page that hears nothing for longer has lost the service and says so.
"""

import asyncio
import json
import logging
import time
from collections import deque
from collections.abc import AsyncGenerator, Callable
from contextlib import aclosing, suppress
from functools import partial

from starlette.responses import StreamingResponse
from starlette.types import Receive, Scope, Send

from faultbond.errors import FaultbondError
from faultbond.service.contract.face import Face, Shown

MOST = 100  # events that may wait for a viewer, beside one summary of each asset
VIEWERS = 1000  # at a time
GATHER = 0.08  # s for which events are gathered, so that a fast plant does not cost a message each
ALIVE = 2.0  # s between signs of life
STALL = 20.0  # s for which a viewer may take nothing
RETRY = b"retry: 2000\n\n"  # ms before a browser's own listener tries again
FORWARD = {"x-accel-buffering": "no"}  # a proxy that gathers would hold events back

_LOG = logging.getLogger(__name__)


class BusyError(FaultbondError):
    """There are as many viewers as can be served."""


class Notice:
    """Something that happened; it is written when the first viewer takes it, and not again for the others."""

    __slots__ = ("_summary", "_written", "name", "shown")

    def __init__(self, name: str, shown: Shown) -> None:
        self.name = name
        self.shown = shown
        self._written: bytes | None = None
        self._summary: Notice | None = None

    @property
    def asset(self) -> str | None:
        """The asset that it is about."""
        told = self.shown.get("summary", self.shown)
        found = told.get("asset", told.get("name"))
        return found if isinstance(found, str) else None

    def summary(self) -> "Notice":
        """Give what those hear of it who look at another asset; of an event named `asset`."""
        if self._summary is None:
            self._summary = Notice("summary", self.shown["summary"])
        return self._summary

    def written(self) -> bytes:
        """Give it as it goes over the wire."""
        if self._written is None:
            text = json.dumps(self.shown, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
            self._written = f"event: {self.name}\ndata: {text}\n\n".encode()
        return self._written


class Viewer:
    """What waits for one viewer. asset: of which it wants all; of the others it gets summaries only."""

    def __init__(self, asset: str | None) -> None:
        self.asset = asset
        self.is_over = False
        self.woken = asyncio.Event()
        self._waiting: deque[Notice] = deque()
        self._summaries: dict[str | None, Notice] = {}

    def begin(self, site: Shown, asset: Shown | None) -> None:
        """Let wait what is so now, before what has happened since it was asked for."""
        if asset is not None:
            self._waiting.appendleft(Notice("asset", asset))
        self._waiting.appendleft(Notice("site", site))

    def put(self, event: Notice) -> None:
        """Let an event wait; a viewer for which too many wait is over."""
        if self.is_over:
            return
        if event.name == "summary":
            self._summaries[event.asset] = event
        elif event.name == "asset" and event.asset != self.asset:
            self._summaries[event.asset] = event.summary()
        elif event.asset in (None, self.asset):
            self._waiting.append(event)
            if event.name == "asset":
                self._summaries.pop(event.asset, None)  # there is a newer one inside
        else:
            return
        if len(self._waiting) > MOST:
            self.end()
        self.woken.set()

    def end(self) -> None:
        """Give no more than what was taken."""
        self.is_over = True
        self._waiting.clear()
        self._summaries.clear()
        self.woken.set()

    def taken(self) -> bytes:
        """Take all that waits, the summaries last: they are the newest."""
        events = [*self._waiting, *self._summaries.values()]
        self._waiting.clear()
        self._summaries.clear()
        self.woken.clear()
        return b"".join(event.written() for event in events)


class Broadcast:
    """All viewers of a service. It listens while there is one."""

    def __init__(self, face: Face) -> None:
        self._face = face
        self._viewers: set[Viewer] = set()
        self._task: asyncio.Task[None] | None = None

    def __len__(self) -> int:
        return len(self._viewers)

    async def admit(self, asset: str | None) -> Viewer:
        """Make room for a viewer, and let wait for it what is so now.

        The service is asked in a thread: it may be busy, and other viewers are told all the while.

        Raises
        ------
        BusyError
            Where there are too many.
        KeyError
            Where there is no such asset.
        StoreError
            Where what is kept of it cannot be read.
        """
        if len(self._viewers) >= VIEWERS:
            raise BusyError(f"{VIEWERS} pages are open, which is the limit. Close some.")
        viewer = Viewer(asset)
        self._viewers.add(viewer)
        if self._task is None or self._task.done():
            self._task = asyncio.create_task(self._pass_on(), name="page events")
        try:
            viewer.begin(*await asyncio.to_thread(self._now, asset))
        except BaseException:
            self.leave(viewer)
            raise
        return viewer

    def _now(self, asset: str | None) -> tuple[Shown, Shown | None]:
        return self._face.site(), None if asset is None else self._face.asset(asset)

    async def follow(self, viewer: Viewer, is_known: Callable[[], bool]) -> AsyncGenerator[bytes, None]:
        """Give what a viewer is told until it is over, or the person is not known any more."""
        yield RETRY + alive() + viewer.taken()
        while not viewer.is_over and is_known():
            with suppress(TimeoutError):
                async with asyncio.timeout(ALIVE):
                    await viewer.woken.wait()
                    await asyncio.sleep(GATHER)
            told = viewer.taken()
            if not viewer.is_over:
                yield told or alive()

    def leave(self, viewer: Viewer) -> None:
        """Forget a viewer; behind the last one nobody listens."""
        self._viewers.discard(viewer)
        if not self._viewers and self._task is not None:
            self._task.cancel()
            self._task = None

    def close(self) -> None:
        """Send all viewers away, as where the service stops."""
        for viewer in self._viewers:
            viewer.end()

    async def _pass_on(self) -> None:
        """Hear what happens; where that ends, all viewers do, and begin anew with what is so then."""
        try:
            async for name, shown in self._face.listen():
                event = Notice(name, shown)
                for viewer in self._viewers:
                    viewer.put(event)
        except Exception:
            _LOG.exception("the page's events failed")
        self.close()


def alive() -> bytes:
    """Give the sign of life, with the time by the clock of the service."""
    return Notice("alive", {"now": time.time()}).written()


class EventStream(StreamingResponse):
    """The answer to a viewer, who is cut off if it takes nothing for long."""

    media_type = "text/event-stream"

    def __init__(self, broadcast: Broadcast, viewer: Viewer, is_known: Callable[[], bool]) -> None:
        self._events = broadcast.follow(viewer, is_known)
        self._leave = partial(broadcast.leave, viewer)
        super().__init__(self._events, headers=FORWARD)

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, and forget the viewer however that ends."""
        try:
            await super().__call__(scope, receive, send)
        finally:
            self._leave()

    async def stream_response(self, send: Send) -> None:
        """Send events until they end or cannot be sent; then there is no end, so that the server closes it."""
        await send({"type": "http.response.start", "status": self.status_code, "headers": self.raw_headers})
        with suppress(TimeoutError):
            async with aclosing(self._events) as chunks:
                async for chunk in chunks:
                    async with asyncio.timeout(STALL):
                        await send({"type": "http.response.body", "body": chunk, "more_body": True})
            await send({"type": "http.response.body", "body": b"", "more_body": False})
