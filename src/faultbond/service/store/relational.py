"""A store in the tables of a database: written in transactions, and read in the order in which things came."""

import heapq
import json
import zlib
from collections import deque
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, replace
from math import inf, isfinite, nan
from operator import itemgetter
from typing import Any, TypeVar
from uuid import uuid4

import numpy as np

from faultbond.arrays import BoolArray, FloatArray
from faultbond.errors import ForgottenError, StoreError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Action, AuditEntry, Curves, Deed, NamedRecord
from faultbond.service.contract.store import Commit, Enrolment, Forgotten, LogPlace
from faultbond.service.store.checkpoints import stand_of, write_checkpoint
from faultbond.service.store.chunks import curves_at
from faultbond.service.store.database import Database
from faultbond.service.store.peaks import thinned
from faultbond.service.store.retention import forget
from faultbond.service.store.tail import (
    CURVES,
    KINDS,
    LARGE,
    OVERVIEW,
    ROWS,
    Log,
    append,
    blocks_after,
    chunk_title,
    chunks_between,
    find_tails,
    merge,
)

PAGE = 500  # records or deeds that are read at once
MOST_UNNOTED = 16  # entries that may come again
LEAST_EFFORT = 64  # of merging in a commit; see `tail.merge`
_LOG = "SELECT number, asset, n_inputs, n_outputs, rows, points, deeds, cursor, arrived, time FROM logs"

_READERS = "CREATE TABLE IF NOT EXISTS readers (name TEXT PRIMARY KEY, place BIGINT NOT NULL)"  # not in older stores
_AUDIT = "CREATE TABLE IF NOT EXISTS audit (number BIGINT PRIMARY KEY, content TEXT NOT NULL, checksum BIGINT NOT NULL)"
_NEVER = 2**62  # number that no row of a table has

Written = TypeVar("Written")


class RelationalStore:
    """A store in a database; see `contract.store.LogStore`.

    A record that comes again with another content is told of by `tell` and kept beside the first, see `contested`, and
    the commit stands: people and other programs have seen the first, and who refused the second would refuse it after
    every start, with all other assets' parts.

    Parameters
    ----------
    database : that holds it, and is closed with it
    tell : is given one line of what the operator should know
    """

    def __init__(self, database: Database, *, tell: Callable[[str], None] = lambda _: None) -> None:
        self._database, self._tell = database, tell
        self._logs: dict[str, Log] = {}
        self._came: int | None = None
        self._failed: tuple[Commit, ...] = ()  # parts of the last commit, and its turn, where it failed
        self._turn = ""
        self._unnoted = deque[AuditEntry](maxlen=MOST_UNNOTED)  # entries that were given, but maybe not written

    def close(self) -> None:
        """Close it, and let another service have it."""
        self._database.close()

    def enrol(self, enrolment: Enrolment) -> LogPlace:
        """Make an asset known and tell where its log stands; see `contract.store.LogStore`."""
        log = self._writing(lambda: self._enrol(enrolment))
        self._logs[enrolment.asset] = log
        return stand_of(self._database, log, self._tell)

    def commit(self, parts: Sequence[Commit]) -> None:
        """Write what came of some arrivals and deeds, all or nothing; on the disk when this returns.

        Raises
        ------
        StoreError
            Where it cannot be written, an asset is not enrolled, or a part does not fit its log. Nothing is then; or,
            where a server was lost, what is found out when the same parts come again, and they are written once.
        """
        again = tuple(parts) == self._failed  # a part equals none but itself
        if again and self._database.has_written(self._turn):
            self._failed = ()
            return
        self._failed, self._turn = tuple(parts), self._turn if again else uuid4().hex
        logs, came, told = self._writing(lambda: self._commit(parts, self._turn))
        self._failed = ()
        self._logs.update(logs)
        self._came = came
        for line in told:
            self._tell(line)

    def log_after(self, asset: str, rows: int, deeds: int) -> Iterator[RowBlock | Deed]:
        """Give rows and deeds of the log behind so many of each, in their order; see `contract.store.LogStore`."""
        log = self._log(asset)
        done = self._deeds("log=? AND place>? AND place<=?", [log.number, deeds, log.deeds])
        return _interleaved(self._whole(log, rows), (deed for _, deed in done))

    def log_between(
        self, asset: str, begin: float | None = None, end: float | None = None, model_sha256: str | None = None
    ) -> Iterator[RowBlock | Deed]:
        """Give what is kept of a log in a period; see `contract.store.LogStore`."""
        log = self._log(asset, model_sha256)
        wanted, limits = _period(begin, end)
        done = self._deeds(f"log=? AND place<=?{wanted}", [log.number, log.deeds, *limits])
        blocks = blocks_after(self._database, log, ROWS, 0, begin=begin, end=end)
        inside = ((first, block, _inside(block.time, begin, end)) for first, block in blocks)
        return _interleaved(inside, (deed for _, deed in done))

    def enrolments(self, asset: str | None = None) -> Iterator[Enrolment]:
        """Give what was enrolled, that which was enrolled last at the end."""
        wanted, values = ("", ()) if asset is None else (" WHERE asset=?", (self._asset(asset),))
        for (text,) in self._database.rows(f"SELECT content FROM enrolments{wanted} ORDER BY came", *values):  # noqa: S608
            yield Enrolment(**json.loads(text))

    def records(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord]:
        """Give records in the order in which they came; see `contract.store.LogStore`."""
        return (told for _, told in self._told(asset, kinds, begin, end, newest))

    def deeds(self, asset: str | None = None, *, newest: int | None = None) -> Iterator[Deed]:
        """Give what people did, in order; `newest`: only so many."""
        wanted, values = self._chosen(asset, None, None)
        first = self._first("deeds", wanted, values, newest)
        return (deed for _, deed in self._deeds(wanted, values, first))

    def journal(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord | Deed]:
        """Give records and deeds in the order in which they came, of a period; see `contract.store.LogStore`."""
        wanted, values = self._chosen(asset, begin, end)
        found: list[Iterator[tuple[int, NamedRecord | Deed]]] = [
            self._told(asset, kinds, begin, end, newest),
            self._deeds(wanted, values, self._first("deeds", wanted, values, newest)),
        ]
        merged = heapq.merge(*found, key=itemgetter(0))
        return (item for _, item in merged)

    def note(self, entry: AuditEntry) -> None:
        """Write what a person did that is about no asset; see `contract.store.LogStore`.

        Raises
        ------
        StoreError
            Where it cannot be written; or where a server was lost, what is found out when the same entry comes again.
        """
        again = any(item is entry for item in self._unnoted)
        if not again:
            self._unnoted.append(entry)
        self._writing(lambda: self._note(entry, again=again))
        self._unnoted = deque((item for item in self._unnoted if item is not entry), MOST_UNNOTED)

    def audit(self) -> Iterator[AuditEntry]:
        """Give what was noted, in order."""
        if not self._database.has_table("audit"):
            return
        for number, content, checksum in self._paged("audit", "number, content, checksum", "1=1", (), 0):
            self._check(content, checksum, f"entry {number} of the audit")
            yield AuditEntry(number=number, **json.loads(content))

    def reader(self, name: str) -> tuple[int, int]:
        """Make a reader of records known; give its place, and the newest; see `contract.store.LogStore`."""
        return self._writing(lambda: self._reader(name))

    def records_behind(self, number: int, most: int) -> list[tuple[int, NamedRecord]]:
        """Give the first so many records behind that of a number, each with its own."""
        some = "SELECT number FROM records WHERE number>? ORDER BY number LIMIT ?"
        numbers = [row[0] for row in self._database.rows(some, number, most)]
        told = self._records("number<=?", [numbers[-1] if numbers else number], number + 1)
        return [(place, record) for place, (_, record) in zip(numbers, told, strict=True)]

    def advance(self, name: str, number: int) -> None:
        """Let a reader stand behind the record of a number; on the disk when this returns."""
        self._writing(lambda: self._advance(name, number))

    def contested(self) -> list[tuple[str, object]]:
        """Give id and content of what came again otherwise than it is kept, in the order in which it came."""
        found = self._database.rows("SELECT id, content FROM contested ORDER BY number")
        return [(name, json.loads(text)) for name, text in found]

    def curves(
        self, asset: str, begin: float | None = None, end: float | None = None, most: int | None = None
    ) -> Curves | None:
        """Give curves of a period, None where there are none; of more than `most` points those that show all peaks."""
        if self._asset(asset) is None:
            return None
        with self._database.reading():
            parts = [part for part in self._curves(self._log(asset), begin, end, most) if len(part)]
        if not parts:
            return None
        found = CURVES.join(parts)
        return found if most is None else thinned(found, most)

    def retain(self, *, older_than: float | None = None, at_most: int | None = None) -> Forgotten:
        """Forget rows, curves and diagnoses of these, never another record or a deed; see `contract.store.LogStore`.

        A large chunk goes as a whole, once all of it may go. So does what the oldest checkpoint that is kept needs.
        """
        try:
            return self._writing(
                lambda: forget(self._database, older_than=older_than, at_most=at_most), makes_room=True
            )
        finally:
            self._logs.clear()  # tails are others now

    def reserve(self) -> str:
        """Have again what room is kept for a full disk, and say what is wrong; see `contract.store.LogStore`."""
        return self._database.reserve()

    def _note(self, entry: AuditEntry, *, again: bool) -> None:
        kept = {"at": entry.at, "who": entry.who, "what": entry.what, "about": dict(entry.about)}
        content = json.dumps(kept)
        with self._database.transaction():
            self._database.change(_AUDIT)
            if again and self._database.number("SELECT count(*) FROM audit WHERE content=?", content):
                return
            number = int(self._database.number("SELECT max(number) FROM audit") or 0) + 1
            values = (number, content, zlib.crc32(content.encode()))
            self._database.change("INSERT INTO audit VALUES (?, ?, ?)", *values)

    def _reader(self, name: str) -> tuple[int, int]:
        with self._database.transaction():
            self._database.change(_READERS)
            newest = int(self._database.number("SELECT max(number) FROM records") or 0)
            self._database.change("INSERT INTO readers VALUES (?, ?) ON CONFLICT (name) DO NOTHING", name, newest)
            return int(self._database.number("SELECT place FROM readers WHERE name=?", name)), newest

    def _advance(self, name: str, number: int) -> None:
        with self._database.transaction():
            self._database.change("UPDATE readers SET place=? WHERE name=?", number, name)

    def _enrol(self, enrolment: Enrolment) -> Log:
        with self._database.transaction():
            database = self._database
            asset = self._asset(enrolment.asset)
            if asset is None:
                asset = database.insert("assets", name=enrolment.asset)
            last = database.number("SELECT max(came) FROM enrolments") or 0
            statement = "SELECT number FROM logs WHERE asset=? AND model_sha256=?"
            number = database.number(statement, asset, enrolment.model_sha256)
            if number is None:
                sizes = {"n_inputs": enrolment.n_inputs, "n_outputs": enrolment.n_outputs}
                number = database.insert("logs", asset=asset, model_sha256=enrolment.model_sha256, **sizes)
            database.change(
                "INSERT INTO enrolments (log, asset, came, content) VALUES (?, ?, ?, ?) ON CONFLICT (log) DO UPDATE "
                "SET came=excluded.came, content=excluded.content",
                number,
                asset,
                last + 1,
                json.dumps(asdict(enrolment)),
            )
            database.change("UPDATE assets SET log=? WHERE number=?", number, asset)
            return self._log(enrolment.asset, enrolment.model_sha256)

    def _commit(self, parts: Sequence[Commit], turn: str) -> tuple[dict[str, Log], int, list[str]]:
        """Write parts in one transaction; give the logs then, the number of what came last, and what is to be told."""
        logs: dict[str, Log] = {}
        told: list[str] = []
        n_rows = sum(len(part.rows) for part in parts if part.rows is not None)
        with self._database.transaction(turn):
            came = self._last_came()
            for part in parts:
                log = self._grown(logs.get(part.asset) or self._log(part.asset), part)
                log, came = self._write_found(log, part, came, told)
                if part.checkpoint is not None:
                    write_checkpoint(self._database, log, part.checkpoint)
                logs[part.asset] = log
            self._merge(logs, 2 * (LEAST_EFFORT + 2 * len(parts) + n_rows // LARGE))
            for log in logs.values():
                self._database.change(
                    "UPDATE logs SET rows=?, points=?, deeds=?, cursor=?, arrived=?, time=? WHERE number=?",
                    log.rows,
                    log.points,
                    log.deeds,
                    json.dumps(log.cursor),
                    log.arrived,
                    log.time,
                    log.number,
                )
        return logs, came, told

    def _grown(self, log: Log, part: Commit) -> Log:
        """Write the rows and curves of a part, and give its log then."""
        tails, arrived = list(log.tails), log.arrived
        cursor, n_rows, points, time = log.cursor, log.rows, log.points, log.time
        if part.rows is not None or part.cursor:
            cursor = part.cursor
        if part.rows is not None:
            self._check_width(log, "rows", part.rows.u.shape[1], part.rows.y.shape[1])
            arrived = part.arrived
            rows = part.rows
            if rows.arrived is None:
                rows = replace(rows, arrived=np.full(len(rows), arrived))
            tails[ROWS.number] = append(self._database, log, ROWS, n_rows, rows, arrived)
            known = part.rows.time[np.isfinite(part.rows.time)]
            time = float(known[-1]) if len(known) else time
            n_rows += len(part.rows)
        if part.curves is not None:
            self._check_width(log, "curves", part.curves.inputs.shape[1], part.curves.measured.shape[1])
            tails[CURVES.number] = append(self._database, log, CURVES, points, part.curves, arrived)
            points += len(part.curves)
        return replace(log, cursor=cursor, rows=n_rows, points=points, time=time, arrived=arrived, tails=tuple(tails))

    def _write_found(self, log: Log, part: Commit, came: int, told: list[str]) -> tuple[Log, int]:
        """Write the records and deeds of a part: what rows gave before the deeds, what deeds alone gave behind them."""
        items: tuple[NamedRecord | Deed, ...] = (*part.records, *part.deeds)
        if part.rows is None:
            items = (*part.deeds, *part.records)
        for item in items:
            came += 1
            if isinstance(item, Deed):
                log = replace(log, deeds=log.deeds + 1)
                self._write_deed(log, item, came)
            else:
                self._write_record(log, item, came, told)
        return log, came

    def _write_deed(self, log: Log, deed: Deed, came: int) -> None:
        """Write a deed as the newest of a log that has it counted."""
        if deed.number or deed.rows != log.rows:
            what = f"has the number {deed.number}" if deed.number else f"is behind {deed.rows} rows, not {log.rows}"
            raise StoreError(
                f"{self._database.name}: what {deed.who!r} did to {log.name!r} cannot be kept: it {what}, and so would "
                "not be in its place when the log is passed again. Do it once more."
            )
        kept = asdict(deed) | {"action": deed.action.value}
        content = json.dumps({key: kept[key] for key in kept if key not in ("asset", "rows", "number")})
        self._database.insert(
            "deeds",
            log=log.number,
            asset=log.asset,
            place=log.deeds,
            rows=deed.rows,
            time=log.time,
            came=came,
            content=content,
            checksum=zlib.crc32(content.encode()),
        )

    def _write_record(self, log: Log, record: NamedRecord, came: int, told: list[str]) -> None:
        """Write a record, once."""
        content = json.dumps(record.content)
        before = self._database.number("SELECT content FROM records WHERE id=?", record.id)
        if before is None:
            self._database.insert(
                "records",
                id=record.id,
                asset=log.asset,
                came=came,
                sample=record.sample,
                time=record.time if isfinite(record.time) else None,
                kind=record.kind,
                content=content,
                checksum=zlib.crc32(content.encode()),
            )
        elif before != content:
            known = "SELECT number FROM contested WHERE id=? AND content=?"
            if self._database.number(known, record.id, content) is None:
                self._database.insert("contested", id=record.id, content=content)
            told.append(
                f"{self._database.name}: record {record.id!r} of {log.name!r} came again with another content. The "
                "first is kept, as it was told; the other beside it. Please report it: the same rows have to give the "
                "same records."
            )

    def _merge(self, logs: dict[str, Log], at_most: int) -> None:
        """Make chunks of pieces and large ones of small ones, with about so much effort."""
        for name in [*logs]:
            for kind in KINDS:
                if at_most > 0:
                    logs[name], done = merge(self._database, logs.pop(name), kind, at_most)
                    at_most -= done

    def _writing(self, write: Callable[[], Written], *, makes_room: bool = False) -> Written:
        """Write; where there is no room and some can be made, write once more."""
        try:
            return write()
        except BaseException as error:
            self._logs.clear()  # what is in the database counts
            self._came = None
            if not self._database.make_room(error, all_of_it=makes_room):
                raise
        return write()

    def _log(self, asset: str, model_sha256: str | None = None) -> Log:
        """Give where a log stands, that of the model with which the asset was enrolled last where none is named."""
        if model_sha256 is None and asset in self._logs:
            return self._logs[asset]
        if model_sha256 is None:
            wanted, values = "number=(SELECT log FROM assets WHERE name=?)", [asset]
        else:
            wanted, values = "asset=(SELECT number FROM assets WHERE name=?) AND model_sha256=?", [asset, model_sha256]
        found = self._database.rows(f"{_LOG} WHERE {wanted}", *values)
        if not found:
            of = f" with the model {model_sha256[:12]}" if model_sha256 else ""
            raise StoreError(f"{self._database.name}: there is no asset {asset!r}{of}. Enrol it first.")
        number, of_asset, n_inputs, n_outputs, rows, points, deeds, cursor, arrived, time = found[0]
        log = Log(
            number=number,
            asset=of_asset,
            name=asset,
            n_inputs=n_inputs,
            n_outputs=n_outputs,
            rows=rows,
            points=points,
            deeds=deeds,
            cursor=json.loads(cursor),
            arrived=arrived,
            time=time,
            tails=find_tails(self._database, number),
        )
        if model_sha256 is None and self._database.writes:  # else another one may write it
            self._logs[asset] = log
        return log

    def _asset(self, name: str) -> int | None:
        """Give the number of an asset; None where there is none of that name."""
        found: int | None = self._database.number("SELECT number FROM assets WHERE name=?", name)
        return found

    def _last_came(self) -> int:
        """Give the number of the record or deed that came last."""
        if self._came is None:
            newest = [f"SELECT came FROM {table} ORDER BY number DESC LIMIT 1" for table in ("records", "deeds")]  # noqa: S608
            self._came = max(int(self._database.number(statement) or 0) for statement in newest)
        return self._came

    def _check_width(self, log: Log, what: str, n_inputs: int, n_outputs: int) -> None:
        """Refuse rows or curves of another model."""
        if (n_inputs, n_outputs) != (log.n_inputs, log.n_outputs):
            raise StoreError(
                f"{self._database.name}: {what} with {n_inputs} inputs and {n_outputs} sensors cannot be those of "
                f"{log.name!r}, which was enrolled with {log.n_inputs} and {log.n_outputs}. Enrol its model first."
            )

    def _chosen(
        self, asset: str | None, begin: float | None, end: float | None, kinds: Sequence[str] = ()
    ) -> tuple[str, list[object]]:
        """Give what records, of some kinds or all, or deeds of an asset and a period fulfil, and its values."""
        wanted, limits = _period(begin, end)
        if kinds:
            wanted = f"{wanted} AND kind IN ({', '.join('?' * len(kinds))})"
        if asset is None:
            return f"1=1{wanted}", [*limits, *kinds]
        return f"asset=?{wanted}", [self._asset(asset), *limits, *kinds]

    def _first(self, table: str, wanted: str, values: Sequence[object], newest: int | None) -> int:
        """Give the number of the first of the newest rows of a table that fulfil something."""
        if newest is None:
            return 0
        some = f"SELECT number FROM {table} WHERE {wanted} ORDER BY number DESC LIMIT ?"  # noqa: S608 - words are ours
        first = self._database.number(f"SELECT min(number) FROM ({some}) AS newest", *values, max(newest, 0))  # noqa: S608
        return _NEVER if first is None else int(first)

    def _paged(self, table: str, what: str, wanted: str, values: Sequence[object], first: int) -> Iterator[Any]:
        """Give what is asked of rows of a table, their number first, from number `first` on, a page at a time."""
        statement = f"SELECT {what} FROM {table} WHERE {wanted} AND number>=? ORDER BY number LIMIT ?"  # noqa: S608
        while found := self._database.rows(statement, *values, first, PAGE):
            yield from found
            first = found[-1][0] + 1

    def _told(
        self, asset: str | None, kinds: Sequence[str], begin: float | None, end: float | None, newest: int | None
    ) -> Iterator[tuple[int, NamedRecord]]:
        """Give the records that are asked for, each with the number by which it came."""
        wanted, values = self._chosen(asset, begin, end, kinds)
        return self._records(wanted, values, self._first("records", wanted, values, newest))

    def _records(self, wanted: str, values: Sequence[object], first: int = 0) -> Iterator[tuple[int, NamedRecord]]:
        """Give records that fulfil something, each with the number by which it came."""
        names = "(SELECT name FROM assets WHERE assets.number=asset)"
        what = f"number, id, {names}, came, sample, time, kind, content, checksum"
        for row in self._paged("records", what, wanted, values, first):
            _, name, asset, came, sample, time, kind, content, checksum = row
            self._check(content, checksum, f"record {name!r}")
            told = NamedRecord(
                id=name,
                asset=asset,
                sample=sample,
                time=nan if time is None else time,
                kind=kind,
                content=json.loads(content),
            )
            yield came, told

    def _deeds(self, wanted: str, values: Sequence[object], first: int = 0) -> Iterator[tuple[int, Deed]]:
        """Give deeds that fulfil something, each with the number by which it came."""
        what = "number, (SELECT name FROM assets WHERE assets.number=asset), rows, came, content, checksum"
        for number, asset, rows, came, content, checksum in self._paged("deeds", what, wanted, values, first):
            self._check(content, checksum, f"entry {number} of the journal")
            kept = json.loads(content)
            kept |= {"action": Action(kept["action"]), "target": tuple(kept["target"])}
            yield came, Deed(asset=asset, rows=rows, number=number, **kept)

    def _check(self, content: str, checksum: int, what: str) -> None:
        """Refuse a text that is not as it was written."""
        if zlib.crc32(content.encode(errors="replace")) != checksum:
            raise StoreError(
                f"{self._database.name}: {what} is damaged on the disk. Check the disk, and take a copy of the store "
                "from before."
            )

    def _whole(self, log: Log, rows: int) -> Iterator[tuple[int, RowBlock, BoolArray]]:
        """Give the rows of a log behind some, of which none may be missing."""
        for first, block in blocks_after(self._database, log, ROWS, rows):
            if first != rows:
                break
            yield first, block, np.ones(len(block), dtype=bool)
            rows += len(block)
        if rows < log.rows:
            raise ForgottenError(
                f"{self._database.name}: rows of {log.name!r} from {rows + 1} on are forgotten, and none of its kept "
                "states is behind them, so it cannot go on from there. Move the store away; a new one is then begun."
            )

    def _curves(self, log: Log, begin: float | None, end: float | None, most: int | None) -> Iterator[Curves]:
        """Give curves of a period in order; of a long one, overviews of the chunks that are in it as a whole."""
        chunks = chunks_between(self._database, log, CURVES, begin, end)
        coarse = most is not None and sum(chunk[3] for chunk in chunks) * OVERVIEW >= most * LARGE
        for table, number, first, count, dense, low, high in chunks:
            inside = (begin is None or low >= begin) and (end is None or high <= end)
            part = "overview" if coarse and dense and inside else "content"
            data = self._database.number(f"SELECT {part} FROM {table} WHERE number=?", number)  # noqa: S608
            curves = CURVES.unpack(data, chunk_title(self._database, log.name, CURVES, first, count))
            yield curves if inside else curves_at(curves, _inside(curves.time, begin, end))


def _period(begin: float | None, end: float | None) -> tuple[str, list[float]]:
    """Give what has its time in a period, and its values; without one also what has no time."""
    wanted = "" if begin is None else " AND time>=?"
    return wanted + ("" if end is None else " AND time<=?"), [limit for limit in (begin, end) if limit is not None]


def _inside(time: FloatArray, begin: float | None, end: float | None) -> BoolArray:
    """Give whether moments are in a period, (n,); all are where there is none."""
    if begin is None and end is None:
        return np.ones(len(time), dtype=bool)
    return (time >= (-inf if begin is None else begin)) & (time <= (inf if end is None else end))


def _interleaved(blocks: Iterator[tuple[int, RowBlock, BoolArray]], deeds: Iterator[Deed]) -> Iterator[RowBlock | Deed]:
    """Give the chosen rows of blocks, and deeds where they belong.

    blocks: number of the first row, rows, and which of them are chosen.
    """
    deed = next(deeds, None)
    for first, block, chosen in blocks:
        begin = 0
        while deed is not None and deed.rows < first + len(block):
            stop = max(deed.rows - first, begin)
            yield from _some(block, chosen, begin, stop)
            yield deed
            begin, deed = stop, next(deeds, None)
        yield from _some(block, chosen, begin, len(block))
    if deed is not None:
        yield deed
    yield from deeds


def _some(block: RowBlock, chosen: BoolArray, begin: int, end: int) -> Iterator[RowBlock]:
    """Give the chosen ones of some rows of a block, if there are any."""
    places = begin + np.flatnonzero(chosen[begin:end])
    if len(places) == len(block):
        yield block
    elif len(places):
        yield block.part(places)
