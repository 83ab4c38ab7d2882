"""The log of an asset in chunks: what comes is a small one, and small ones at its end become large ones.

A large chunk is dense, and one of curves has an overview, its points thinned, so that a long period can be drawn
without reading all of it. It is made inside the transaction of some commit, of a few assets at a time: so no commit
waits for those of all.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, Generic, Protocol, TypeVar

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.io.row_block import RowBlock
from faultbond.service.store.chunks import (
    curves_at,
    joined_curves,
    joined_rows,
    pack_curves,
    pack_rows,
    unpack_curves,
    unpack_rows,
)
from faultbond.service.store.database import Database
from faultbond.service.store.peaks import thinned

LARGE = 1000  # rows of a large chunk; one that is made of small ones has less than twice as many
OVERVIEW = 32  # points that stand for a large chunk
_AT_ONCE = 16  # chunks that are read at once


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
    """The small chunks of one kind at the end of a log: number of their first row, and how many rows they have."""

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
    """Give the tails of a log as the file has them."""
    statement = "SELECT min(first), sum(count) FROM chunks WHERE log=? AND kind=? AND dense=0"
    found = [database.rows(statement, log, kind.number)[0] for kind in KINDS]
    return tuple(Tail() if first is None else Tail(first=first, count=count) for first, count in found)


def append(database: Database, log: Log, kind: ChunkKind[Strip], first: int, block: Strip) -> Tail:
    """Write rows behind the others of a log, the first of which is number `first`, and give its tail then."""
    tail = log.tails[kind.number]
    for begin in range(0, len(block), LARGE):
        part = kind.part(block, slice(begin, begin + LARGE))
        dense = len(part) == LARGE and tail.count == 0
        _write(database, log, kind, first + begin, part, arrived=log.arrived, dense=dense)
        if not dense:
            tail = Tail(first=tail.first if tail.count else first + begin, count=tail.count + len(part))
    return tail


def merge(database: Database, log: Log, kind: ChunkKind[Any], at_most: int) -> tuple[Log, int]:
    """Make large chunks of small ones while there are enough; give the log then, and of how many rows that was done."""
    tail, done = log.tails[kind.number], 0
    while tail.count >= LARGE and done < at_most:
        found = _first_of(database, log, kind, tail)
        count = sum(piece[2] for piece in found)
        blocks = [kind.unpack(piece[4], title(database, log.name, kind, piece[1], piece[2])) for piece in found]
        for piece in found:
            database.change("DELETE FROM chunks WHERE number=?", piece[0])
        arrived = max(piece[3] for piece in found)
        _write(database, log, kind, found[0][1], kind.join(blocks), arrived=arrived, dense=True)
        statement = "SELECT min(first) FROM chunks WHERE log=? AND kind=? AND dense=0"
        first = database.number(statement, log.number, kind.number)
        tail = Tail(first=first or 0, count=tail.count - count)
        done += count
    tails = tuple(tail if item is kind else log.tails[item.number] for item in KINDS)
    return replace(log, tails=tails), done


def title(database: Database, name: str, kind: ChunkKind[Any], first: int, count: int) -> str:
    """Give what messages call a chunk."""
    return f"{database.path}: {kind.word} {first + 1} to {first + count} of {name!r}"


def _first_of(database: Database, log: Log, kind: ChunkKind[Any], tail: Tail) -> list[Any]:
    """Give number, first, count, arrived, content of the first small chunks, enough for a large one, with no hole."""
    found: list[Any] = []
    statement = (
        "SELECT number, first, count, arrived, content FROM chunks WHERE log=? AND kind=? AND dense=0 AND first>=? "
        "ORDER BY first LIMIT ?"
    )
    for piece in database.rows(statement, log.number, kind.number, tail.first, LARGE):
        if found and found[-1][1] + found[-1][2] != piece[1]:  # some between were forgotten
            break
        found.append(piece)
        if piece[1] + piece[2] - found[0][1] >= LARGE:
            break
    return found


def _write(
    database: Database, log: Log, kind: ChunkKind[Strip], first: int, block: Strip, *, arrived: float, dense: bool
) -> None:
    """Write one chunk."""
    low, high = _ends(block.time)
    database.insert(
        "chunks",
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
    place = "log=? AND kind=? AND first>? AND first<? AND first+count>?"
    statement = f"SELECT first, count, content FROM chunks WHERE {place}{wanted} ORDER BY first LIMIT ?"  # noqa: S608
    while first < until:
        least = first - 2 * LARGE  # that which holds `first` may begin so much before
        found = database.rows(statement, log.number, kind.number, least, until, first, *limits, _AT_ONCE)
        for number, count, content in found:
            block = kind.unpack(content, title(database, log.name, kind, number, count))
            begins = max(first, number)
            yield begins, kind.part(block, slice(begins - number, until - number))
            first = number + count
        if len(found) < _AT_ONCE:
            return


def chunks_between(
    database: Database, log: Log, kind: ChunkKind[Any], begin: float | None, end: float | None
) -> list[Any]:
    """Give number, first, count, dense, low, high of the chunks of a log in a period, in order."""
    wanted, limits = _within(begin, end)
    statement = "SELECT number, first, count, dense, low, high FROM chunks WHERE log=? AND kind=?"
    return database.rows(f"{statement}{wanted} ORDER BY first", log.number, kind.number, *limits)


def _within(begin: float | None, end: float | None) -> tuple[str, list[float]]:
    """Give what chunks of a period fulfil, and its values."""
    wanted = "" if begin is None else " AND high>=?"
    return wanted + ("" if end is None else " AND low<=?"), [limit for limit in (begin, end) if limit is not None]
