"""Rows that another program writes: CSV on standard input."""

import asyncio
import os
import select
import time
from collections.abc import AsyncGenerator, Mapping, Sequence

from faultbond.errors import RecordingError, SourceError
from faultbond.io.recording import RowFeed
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.growing_file import UNREADABLE, all_rows

GATHER = 0.1  # s for which rows are gathered that go out together
PATIENCE = 0.5  # s after which a read that brought nothing is begun anew, so that it can be given up
MOST_READ = 2**16  # bytes that go out together
TITLE = "standard input"


class StandardInput:
    """A source that reads a stream of bytes to its end; it cannot go back.

    Parameters
    ----------
    subscribers : who reads it; each by its own columns
    file : number of the open file; 0 is standard input
    """

    def __init__(self, subscribers: Sequence[Subscriber], file: int = 0) -> None:
        self._subscribers, self._file = tuple(subscribers), file
        self._feeds = [RowFeed(item.columns, TITLE) for item in self._subscribers]
        self._data = b""

    @property
    def address(self) -> str:
        """What stands for standard input."""
        return "-"

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give rows as they come; a cursor means nothing here.

        Raises
        ------
        SourceError
            Where it cannot be read, is empty, or lacks a column.
        """
        is_final = False
        while not is_final:
            is_final = await asyncio.to_thread(self._read)
            data, self._data = self._data, b""
            for subscriber, feed in zip(self._subscribers, self._feeds, strict=True):
                found = _taken(subscriber, feed, data, final=is_final)
                if found is not None:
                    yield found
        if not all(feed.has_header for feed in self._feeds):
            raise SourceError(f"{TITLE}: it is empty. The first row must name the columns.")

    def _read(self) -> bool:
        """Read what comes within a short time, and tell whether that was the end.

        It is kept, so that nothing is lost where who waits for it gives up meanwhile.
        """
        begun, until = len(self._data), time.monotonic() + PATIENCE
        while (left := until - time.monotonic()) > 0.0 and len(self._data) < MOST_READ:
            try:
                if not select.select([self._file], [], [], left)[0]:
                    break
                piece = os.read(self._file, MOST_READ)
            except OSError as error:
                raise SourceError(f"{TITLE}: cannot be read: {error.strerror or error}.") from error
            if not piece:
                return True
            if len(self._data) == begun:
                until = time.monotonic() + GATHER
            self._data += piece
        return False


def _taken(subscriber: Subscriber, feed: RowFeed, data: bytes, *, final: bool) -> Arrivals | None:
    """Give the rows that are whole with some bytes; None where there is nothing to tell."""
    refused = feed.refused
    try:
        blocks: list[RowBlock] = feed.push(data, final=final)
    except RecordingError as error:
        raise SourceError(str(error)) from error
    counts = {UNREADABLE: feed.refused - refused} if feed.refused > refused else {}
    if not blocks and not counts:
        return None
    return Arrivals(asset=subscriber.asset, rows=all_rows(blocks, subscriber), arrived=time.time(), counts=counts)
