"""The log of an asset in chunks: what comes is a piece, some pieces become a chunk, and small chunks a large one.

Pieces have no index: they are few, and of all assets together, so that a commit writes few pages of the disk. A large
chunk is dense, and one of curves has an overview, its points thinned, so that a long period can be drawn without all of
it being read. All this happens inside the transaction of some commit, for a few assets at a time: no commit waits for
those of all.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.io.row_block import RowBlock, joined_rows
from faultbond.service.store.chunks import (
    curves_at,
    joined_curves,
    pack_curves,
    pack_rows,
    unpack_curves,
    unpack_rows,
)
from faultbond.service.store.database import Database
from faultbond.service.store.peaks import thinned

LARGE = 1000  # rows of a large chunk; one that is made of small ones has less than twice as many
OVERVIEW = 32  # points that stand for a large chunk
MANY = 32  # pieces that become a chunk, unless their rows are enough for a large one before
PIECES, CHUNKS = "pieces", "chunks"  # tables
_AT_ONCE = 16  # chunks that are read at once
_ALL = 2**62


class Timed(Protocol):
    """What has a moment of each of its rows. time: (n,)."""

    @property
    def time(self) -> FloatArray:
        """The moments, (n,)."""

    def __len__(self) -> int: ...


Strip = TypeVar("Strip", bound=Timed)


@dataclass(frozen=True, slots=True, kw_only=True)
class ChunkKind(Generic[Strip]):
    """Rows, or curves: what the store calls them, and how they become bytes and come back."""

    number: int
    word: str
    pack: Callable[..., bytes]
    unpack: Callable[[bytes, str], Strip]
    join: Callable[[Sequence[Strip]], Strip]
    part: Callable[[Strip, Any], Strip]
    overview: Callable[[Strip], bytes | None]


ROWS = ChunkKind(
    number=0,
    word="rows",
    pack=pack_rows,
    unpack=unpack_rows,
    join=joined_rows,
    part=RowBlock.part,
    overview=lambda _: None,
)
CURVES = ChunkKind(
    number=1,
    word="points",
    pack=pack_curves,
    unpack=unpack_curves,
    join=joined_curves,
    part=curves_at,
    overview=lambda curves: pack_curves(thinned(curves, OVERVIEW), dense=False),
)
KINDS: tuple[ChunkKind[Any], ...] = (ROWS, CURVES)


@dataclass(frozen=True, slots=True, kw_only=True)
class Tail:
    """The end of one kind of a log that is to be merged.

    pieces: their numbers; rows: that they have. first: number of the first row of the small chunks before them, and
    count: how many rows these have.
    """

    pieces: tuple[int, ...] = ()
    rows: int = 0
    first: int = 0
    count: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Log:
    """Where the log of an asset and a model stands.

    rows, points, deeds: how many have come. cursor: of the last arrivals. arrived: when these came. time: of its last
    row that has one; None: of none. tails: by kind.
    """

    number: int
    asset: int
    name: str
    n_inputs: int
    n_outputs: int
    rows: int = 0
    points: int = 0
    deeds: int = 0
    cursor: str = ""
    arrived: float = 0.0
    time: float | None = None
    tails: tuple[Tail, ...] = (Tail(), Tail())


def find_tails(database: Database, log: int) -> tuple[Tail, ...]:
    """Give the tails of a log as the database has them."""
    small = "SELECT min(first), sum(count) FROM chunks WHERE log=? AND kind=? AND dense=0"
    pieces = "SELECT number, count FROM pieces WHERE log=? AND kind=? ORDER BY first"
    tails = []
    for kind in KINDS:
        first, count = database.rows(small, log, kind.number)[0]
        found = database.rows(pieces, log, kind.number)
        numbers, rows = tuple(item[0] for item in found), sum(item[1] for item in found)
        tails.append(Tail(pieces=numbers, rows=rows, first=first or 0, count=int(count or 0)))
    return tuple(tails)


def append(database: Database, log: Log, kind: ChunkKind[Strip], first: int, block: Strip, arrived: float) -> Tail:
    """Write rows behind the others of a log, the first of which is number `first`, and give its tail then."""
    tail = log.tails[kind.number]
    for begin in range(0, len(block), LARGE):
        part = kind.part(block, slice(begin, begin + LARGE))
        if len(part) == LARGE and not tail.pieces and not tail.count:
            _write_chunk(database, log, kind, first + begin, part, arrived=arrived)
        else:
            low, high = _ends(part.time)
            number = database.insert(
                PIECES,
                log=log.number,
                kind=kind.number,
                first=first + begin,
                count=len(part),
                arrived=arrived,
                low=low,
                high=high,
                content=kind.pack(part, dense=False),
            )
            pieces, rows = (*tail.pieces, number), tail.rows + len(part)
            tail = Tail(pieces=pieces, rows=rows, first=tail.first, count=tail.count)
    return tail


def merge(database: Database, log: Log, kind: ChunkKind[Any], at_most: int) -> tuple[Log, int]:
    """Make chunks of pieces, and large chunks of small ones, where there are enough; give the log then, and the effort.

    That is how many pieces, chunks and thousands of rows were touched, and it ends some way behind `at_most`.
    """
    tail, done = log.tails[kind.number], 0
    while (len(tail.pieces) >= MANY or tail.rows >= LARGE) and done < at_most:
        marks = ", ".join("?" * len(tail.pieces))
        place = f"FROM pieces WHERE number IN ({marks}) ORDER BY first"
        found = _united(database, log, kind, PIECES, place, tail.pieces)
        gone = {piece[0] for piece in found}
        count = sum(piece[2] for piece in found)
        is_large = count >= LARGE and not tail.count
        tail = Tail(
            pieces=tuple(number for number in tail.pieces if number not in gone),
            rows=tail.rows - count,
            first=tail.first if tail.count or is_large else found[0][1],
            count=tail.count if is_large else tail.count + count,
        )
        _write_united(database, log, kind, found, dense=is_large)
        done += len(found) + count // LARGE
    small = "FROM chunks WHERE log=? AND kind=? AND dense=0"
    while tail.count >= LARGE and done < at_most:
        place, values = f"{small} AND first>=? ORDER BY first LIMIT ?", (log.number, kind.number, tail.first, LARGE)
        found = _united(database, log, kind, CHUNKS, place, values)
        _write_united(database, log, kind, found, dense=True)
        count = sum(piece[2] for piece in found)
        first = database.number(f"SELECT min(first) {small}", log.number, kind.number)
        tail = replace(tail, first=first or 0, count=tail.count - count)
        done += len(found) + count // LARGE
    if not done:
        return log, 0
    tails = tuple(tail if item is kind else log.tails[item.number] for item in KINDS)
    return replace(log, tails=tails), done


def chunk_title(database: Database, name: str, kind: ChunkKind[Any], first: int, count: int) -> str:
    """Give what messages call a chunk."""
    return f"{database.name}: {kind.word} {first + 1} to {first + count} of {name!r}"


def _united(
    database: Database, log: Log, kind: ChunkKind[Any], table: str, place: str, values: Sequence[object]
) -> list[Any]:
    """Take the first chunks at some place out of their table, enough for a large one at most, with no hole between.

    Gives number, first, count, arrived and the rows of each.
    """
    found: list[Any] = []
    for number, first, count, arrived, content in database.rows(
        f"SELECT number, first, count, arrived, content {place}",
        *values,
    ):
        if found and found[-1][1] + found[-1][2] != first:  # some between were forgotten
            break
        block = kind.unpack(content, chunk_title(database, log.name, kind, first, count))
        found.append((number, first, count, arrived, block))
        if first + count - found[0][1] >= LARGE:
            break
    marks = ", ".join("?" * len(found))
    database.change(f"DELETE FROM {table} WHERE number IN ({marks})", *(item[0] for item in found))  # noqa: S608
    return found


def _write_united(database: Database, log: Log, kind: ChunkKind[Any], found: Sequence[Any], *, dense: bool) -> None:
    """Write one chunk of what `_united` has found."""
    block, arrived = kind.join([item[4] for item in found]), max(item[3] for item in found)
    _write_chunk(database, log, kind, found[0][1], block, arrived=arrived, dense=dense)


def _write_chunk(
    database: Database,
    log: Log,
    kind: ChunkKind[Strip],
    first: int,
    block: Strip,
    *,
    arrived: float,
    dense: bool = True,
) -> None:
    """Write one chunk."""
    low, high = _ends(block.time)
    database.insert(
        CHUNKS,
        log=log.number,
        kind=kind.number,
        first=first,
        count=len(block),
        dense=int(dense),
        arrived=arrived,
        low=low,
        high=high,
        overview=kind.overview(block) if dense else None,
        content=kind.pack(block, dense=dense),
    )


def _ends(time: FloatArray) -> tuple[float | None, float | None]:
    """Give the first and the last moment; None where there is none."""
    known = time[np.isfinite(time)]
    return (float(known.min()), float(known.max())) if len(known) else (None, None)


def blocks_after(
    database: Database,
    log: Log,
    kind: ChunkKind[Strip],
    first: int,
    *,
    begin: float | None = None,
    end: float | None = None,
) -> Iterator[tuple[int, Strip]]:
    """Give what is kept of the rows that a log has now, from number `first` on, each block with its first number.

    A part at a time is read: chunks may be merged meanwhile, and all rows come all the same. begin, end: only chunks
    with a row in that period.
    """
    until = log.rows if kind is ROWS else log.points
    wanted, limits = _within(begin, end)
    what = "SELECT first, count, content FROM"
    place = f"WHERE log=? AND kind=? AND first>? AND first<? AND first+count>?{wanted} ORDER BY first LIMIT ?"
    while first < until:
        least = first - 2 * LARGE  # that which holds `first` may begin so much before
        values = (log.number, kind.number, least, until, first, *limits)
        with database.reading():
            found = database.rows(f"{what} chunks {place}", *values, _AT_ONCE)
            is_last = len(found) < _AT_ONCE
            if is_last:
                found += database.rows(f"{what} pieces {place}", *values, _ALL)
        for number, count, content in found:
            block = kind.unpack(content, chunk_title(database, log.name, kind, number, count))
            begins = max(first, number)
            yield begins, kind.part(block, slice(begins - number, until - number))
            first = number + count
        if is_last:
            return


def chunks_between(
    database: Database, log: Log, kind: ChunkKind[Any], begin: float | None, end: float | None
) -> list[Any]:
    """Give table, number, first, count, dense, low, high of what is kept of a log in a period, in order."""
    wanted, limits = _within(begin, end)
    values = (log.number, kind.number, *limits)
    place = f"WHERE log=? AND kind=?{wanted} ORDER BY first"
    what = "number, first, count, {0}, low, high FROM"
    large = database.rows(f"SELECT 'chunks', {what.format('dense')} chunks {place}", *values)
    return large + database.rows(f"SELECT 'pieces', {what.format('0')} pieces {place}", *values)


def _within(begin: float | None, end: float | None) -> tuple[str, list[float]]:
    """Give what chunks of a period fulfil, and its values."""
    wanted = "" if begin is None else " AND high>=?"
    return wanted + ("" if end is None else " AND low<=?"), [limit for limit in (begin, end) if limit is not None]
