"""Passes what happens on to all who listen; who is too slow is cut off, and never keeps the others waiting."""

import asyncio
from collections.abc import AsyncIterator
from typing import Any

Message = tuple[str, dict[str, Any]]


class Hub:
    """Used in one event loop."""

    def __init__(self) -> None:
        self._listeners: set[asyncio.Queue[Message | None]] = set()
        self.n_cut_off = 0

    @property
    def n_listeners(self) -> int:
        """How many listen now."""
        return len(self._listeners)

    def publish(self, name: str, content: dict[str, Any]) -> None:
        """Pass a message on."""
        for queue in list(self._listeners):
            if queue.qsize() >= queue.maxsize - 1:
                self._listeners.discard(queue)
                self.n_cut_off += 1
                queue.put_nowait(None)
            else:
                queue.put_nowait((name, content))

    def close(self) -> None:
        """Let all who listen end."""
        for queue in self._listeners:
            while queue.full():
                queue.get_nowait()
            queue.put_nowait(None)
        self._listeners.clear()

    async def listen(self, most: int) -> AsyncIterator[Message]:
        """Give messages until the hub closes, or `most` wait."""
        queue: asyncio.Queue[Message | None] = asyncio.Queue(most + 1)  # the last place is for the end
        self._listeners.add(queue)
        try:
            while (message := await queue.get()) is not None:
                yield message
        finally:
            self._listeners.discard(queue)
