"""A CSV file that grows, followed at its end; or a recording, replayed at a speed.

A file is followed as `tail -F` does: where it is replaced, what is left of the old one is read first; where it is cut
off or written anew, reading begins anew. A record that is none is passed over and counted.
"""

import asyncio
import json
import math
import os
import time
from collections import Counter
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from typing import BinaryIO

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import RecordingError, SourceError
from faultbond.io.recording import RowFeed, read_blocks
from faultbond.io.row_block import RowBlock, joined_rows
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.queue import connected, no_rows

POLL = 0.2  # s between two looks at a file that does not grow
MOST_READ = 2**16  # bytes at once; some thousand rows, so that who takes them is soon done
MARK = 256  # bytes before the place, by which a file that was written anew is known
UNREADABLE, BEGUN_ANEW = "unreadable", "begun anew"
GONE = 5.0  # s for which a file may be absent, as between the two steps in which logs are rotated
TICK = 0.1  # s between what a replay gives


@dataclass(frozen=True, slots=True, kw_only=True)
class _Place:
    """Where reading stands: bytes, records and lines that were passed, and the digest of the last of these bytes."""

    place: int = 0
    rows: int = 0
    lines: int = 0
    mark: str = ""

    @classmethod
    def of(cls, cursor: str) -> "_Place | None":
        """Read a cursor; None where it is none of this source."""
        with suppress(ValueError, TypeError, KeyError):
            fields = json.loads(cursor)
            numbers = {name: int(fields[name]) for name in ("place", "rows", "lines")}
            return cls(**numbers, mark=str(fields["mark"]))
        return None

    def text(self) -> str:
        """Give it as a cursor."""
        return json.dumps({"place": self.place, "rows": self.rows, "lines": self.lines, "mark": self.mark})


class _Follower:
    """One file, read for one asset. It blocks while it reads, so it is called in a thread."""

    def __init__(self, path: Path, subscriber: Subscriber, cursor: str) -> None:
        self._path, self._subscriber = path, subscriber
        self._cursor = _Place.of(cursor)
        self._is_other = bool(cursor) and self._cursor is None
        self._stream: BinaryIO | None = None
        self._feed = RowFeed(subscriber.columns, str(path))
        self._place = 0  # bytes that were read
        self._tail = b""  # the last of them
        self._tally: Counter[str] = Counter()
        self._missed: float | None = None  # since when there is no file

    def close(self) -> None:
        """Close the file."""
        if self._stream is not None:
            self._stream.close()
            self._stream = None

    def poll(self) -> Arrivals | None:
        """Give what is new, or None."""
        try:
            blocks = self._new()
            stand = self._stand() if blocks or +self._tally else None
        except OSError as error:
            raise SourceError(f"{self._path}: cannot be read: {error.strerror or error}.") from error
        except RecordingError as error:
            raise SourceError(str(error)) from error
        if stand is None:
            return None
        counts, self._tally = dict(+self._tally), Counter()
        return Arrivals(
            asset=self._subscriber.asset,
            rows=all_rows(blocks, self._subscriber),
            arrived=time.time(),
            cursor=stand.text(),
            counts=counts,
        )

    def _new(self) -> list[RowBlock]:
        """Read on, and see to it that it is still the same file."""
        stream = self._stream or self._open()
        if self._was_written_anew(stream):
            self._tally[UNREADABLE] += bool(self._feed.waiting)
            self._begin_anew()
            return self._read()
        blocks = self._read()
        if blocks or not self._was_replaced(stream):
            return blocks
        blocks = self._read()  # what came before its name went to another
        if self._feed.waiting or not blocks:
            blocks += self._push(b"", final=True)
            self._begin_anew()
        return blocks

    def _open(self) -> BinaryIO:
        """Open the file where the cursor says, or at its begin where it is not that file any more."""
        stream, wanted = self._begin(), self._cursor
        if wanted is None:
            self._tally[BEGUN_ANEW] += self._is_other
            return stream
        self._cursor = None  # when it is opened again, it is for another file
        if wanted.mark != _digest(_before(stream, wanted.place)) or not self._pass_header(stream, wanted.place):
            self._begin_anew()
            return self._stream or stream
        self._feed.go_on((wanted.rows, wanted.lines))
        stream.seek(wanted.place)
        self._place, self._tail = wanted.place, _before(stream, wanted.place) or b""
        return stream

    def _begin(self) -> BinaryIO:
        """Open the file at its begin."""
        self.close()
        self._stream = stream = self._path.open("rb", buffering=0)
        self._feed, self._place, self._tail = RowFeed(self._subscriber.columns, str(self._path)), 0, b""
        return stream

    def _begin_anew(self) -> None:
        self._begin()
        self._tally[BEGUN_ANEW] += 1

    def _pass_header(self, stream: BinaryIO, end: int) -> bool:
        """Read the header once more, so that the feed knows it."""
        while not self._feed.has_header and stream.tell() < end:
            self._feed.push(stream.readline())
        return self._feed.has_header

    def _read(self) -> list[RowBlock]:
        """Read on."""
        data = self._stream.read(MOST_READ) if self._stream is not None else b""
        return self._push(data, final=False) if data else []

    def _push(self, data: bytes, *, final: bool) -> list[RowBlock]:
        """Pass on what was read."""
        refused = self._feed.refused
        blocks = self._feed.push(data, final=final)
        self._place, self._tail = self._place + len(data), (self._tail + data)[-MARK:]
        if self._feed.refused > refused:
            self._tally[UNREADABLE] += self._feed.refused - refused
        return blocks

    def _stand(self) -> _Place:
        """Give where reading stands, behind the last whole line."""
        rows, lines = self._feed.stand
        place = self._place - self._feed.waiting
        before = _before(self._stream, place) if self._stream is not None else None
        return _Place(place=place, rows=rows, lines=lines, mark=_digest(before))

    def _was_written_anew(self, stream: BinaryIO) -> bool:
        """Whether what was read does not stand in the file any more."""
        return _before(stream, self._place) != self._tail

    def _was_replaced(self, stream: BinaryIO) -> bool:
        """Whether another file has the name now.

        Raises
        ------
        SourceError
            Where none has had it for some time.
        """
        own = os.fstat(stream.fileno())
        try:
            named = self._path.stat()
        except FileNotFoundError:
            self._missed = time.monotonic() if self._missed is None else self._missed
            if time.monotonic() - self._missed > GONE:
                raise SourceError(f"{self._path}: the file is gone.") from None
            return False
        self._missed = None
        return (own.st_dev, own.st_ino) != (named.st_dev, named.st_ino)


def _before(stream: BinaryIO, place: int) -> bytes | None:
    """Give the bytes before a place; None of a file that is shorter."""
    begin = max(place - MARK, 0)
    found = os.pread(stream.fileno(), place - begin, begin)
    return found if len(found) == place - begin else None


def _digest(found: bytes | None) -> str:
    return "none" if found is None else sha256(found).hexdigest()


def all_rows(blocks: Sequence[RowBlock], subscriber: Subscriber) -> RowBlock:
    """Give the rows of blocks, also of none, as one block."""
    found = no_rows(subscriber)
    for block in blocks:
        found = joined_rows((found, block))
    return found


class GrowingFile:
    """A source that follows a file.

    Parameters
    ----------
    path : of the file
    subscribers : who reads it; each by its own columns
    """

    def __init__(self, path: Path, subscribers: Sequence[Subscriber]) -> None:
        self._path, self._subscribers = path, tuple(subscribers)

    @property
    def address(self) -> str:
        """The file."""
        return f"file:{self._path}"

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give what is in the file, and what comes; it does not end."""
        followers = [_Follower(self._path, item, cursors.get(item.asset, "")) for item in self._subscribers]
        is_told = False
        try:
            while True:
                is_idle = True
                for follower in followers:
                    found = await asyncio.to_thread(follower.poll)
                    if found is not None:
                        is_idle, is_told = False, True
                        yield found
                if not is_told:
                    is_told = True
                    yield connected(self._subscribers[0])
                if is_idle:
                    await asyncio.sleep(POLL)
        finally:
            for follower in followers:
                follower.close()


class Replay:
    """A source that gives a recording, CSV or Parquet, as `run` reads it, and ends with it.

    Parameters
    ----------
    path : of the recording
    subscribers : who reads it
    speed : times real time; infinite: as fast as it is taken. Steps back of its clock take no time.
    """

    def __init__(self, path: Path, subscribers: Sequence[Subscriber], speed: float) -> None:
        self._path, self._subscribers, self._speed = path, tuple(subscribers), speed

    @property
    def address(self) -> str:
        """The file and the speed."""
        return f"file:{self._path}?speed={'max' if math.isinf(self._speed) else f'{self._speed:g}'}"

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give the rows that are due, until there are no more."""
        tapes = [_Tape(self._path, item, cursors.get(item.asset, "")) for item in self._subscribers]
        begun = time.monotonic()
        while tapes:
            elapsed = (time.monotonic() - begun) * self._speed if math.isfinite(self._speed) else math.inf
            for tape in tuple(tapes):
                found = await asyncio.to_thread(tape.until, elapsed)
                if found is not None:
                    yield found
                if tape.is_at_end:
                    tapes.remove(tape)
            await asyncio.sleep(TICK if math.isfinite(self._speed) else 0.0)


class _Tape:
    """A recording that is given up to some time after the row at which it was begun. It blocks while it reads.

    is_at_end: whether all of it was given.
    """

    def __init__(self, path: Path, subscriber: Subscriber, cursor: str) -> None:
        self._path, self._subscriber = path, subscriber
        self._blocks = read_blocks(str(path), subscriber.columns)
        self._skipped = int(cursor) if cursor.isdecimal() else 0
        self._passed = 0
        self._ahead: RowBlock | None = None
        self._due = np.zeros(0)  # s after the begin at which each row ahead is due
        self._last: tuple[float, float] | None = None  # time of the last row that has one, and when it was due
        self.is_at_end = False

    def until(self, elapsed: float) -> Arrivals | None:
        """Give the next rows that are due, all of one block of the reader at most."""
        if self._ahead is None:
            self._ahead = self._next()
        if self._ahead is None:
            self.is_at_end = True
            return None
        n = int(np.searchsorted(self._due, elapsed, side="right"))
        if n == 0:
            return None
        rows, rest = self._ahead.part(slice(n)), self._ahead.part(slice(n, None))
        self._due, self._ahead = self._due[n:], rest if len(rest) else None
        self._passed += n
        return Arrivals(asset=self._subscriber.asset, rows=rows, arrived=time.time(), cursor=str(self._passed))

    def _next(self) -> RowBlock | None:
        """Read on, behind what was skipped."""
        try:
            for block in self._blocks:
                skipped = min(self._skipped - self._passed, len(block))
                self._passed += max(skipped, 0)
                if skipped < len(block):
                    rows = block.part(slice(max(skipped, 0), None))
                    self._due = self._when(rows)
                    return rows
        except RecordingError as error:
            raise SourceError(str(error)) from error
        return None

    def _when(self, rows: RowBlock) -> FloatArray:
        """Give when rows are due, (n_rows,), s, ascending: a row without a time with the one before it."""
        time, known = rows.time, np.isfinite(rows.time)
        if not known.any():
            return np.full(len(rows), self._last[1] if self._last else 0.0)
        first, begun = self._last or (float(time[known][0]), 0.0)
        steps = np.zeros(len(rows))
        steps[known] = np.maximum(np.diff(time[known], prepend=first), 0.0)
        due = begun + np.cumsum(steps)
        self._last = (float(time[known][-1]), float(due[-1]))
        return np.asarray(due)
