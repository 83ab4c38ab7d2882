"""A slow and plainly right store in memory, which keeps every row, point, record and deed by itself."""

import copy
import json
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from math import inf, isnan, nan

import numpy as np

from faultbond.errors import ForgottenError, StoreError
from faultbond.io.row_block import Row, RowBlock, block_of_rows
from faultbond.service.contract.messages import AuditEntry, Curves, Deed, NamedRecord
from faultbond.service.contract.store import Commit, Enrolment, Forgotten, LogPlace
from faultbond.service.store.peaks import thinned

KEPT = 3  # checkpoints of a log


@dataclass
class SlowLog:
    """The log of an asset and a model. rows: each with the moment of its arrival; None where it is forgotten."""

    enrolment: Enrolment
    rows: list[tuple[float, Row] | None] = field(default_factory=list)
    points: list[tuple[float, Curves] | None] = field(default_factory=list)
    deeds: list[Deed] = field(default_factory=list)
    times: list[float] = field(default_factory=list)  # of deeds: that of the last row before with a time, else nan
    checkpoints: list[LogPlace] = field(default_factory=list)
    cursor: str = ""
    arrived: float = 0.0


class MemoryStore:
    """See `faultbond.service.contract.store.LogStore`; what is asked of each method stands there."""

    def __init__(self) -> None:
        self.logs: dict[tuple[str, str], SlowLog] = {}
        self.newest: dict[str, str] = {}
        self.order: list[tuple[str, str]] = []
        self.came: list[tuple[NamedRecord | Deed, float]] = []
        self.lost: set[int] = set()  # places there of what is forgotten
        self.contested: list[tuple[str, object]] = []
        self.places: dict[str, int] = {}
        self.noted: list[AuditEntry] = []

    def enrol(self, enrolment: Enrolment) -> LogPlace:
        key = (enrolment.asset, enrolment.model_sha256)
        log = self.logs.setdefault(key, SlowLog(enrolment))
        log.enrolment = enrolment
        self.newest[enrolment.asset] = enrolment.model_sha256
        self.order = [item for item in self.order if item != key] + [key]
        newest = log.checkpoints[-1] if log.checkpoints else LogPlace()
        return replace(newest, rows=len(log.rows), cursor=log.cursor)

    def commit(self, parts: Sequence[Commit]) -> None:
        logs, came, contested = copy.deepcopy((self.logs, self.came, self.contested))
        for part in parts:
            if part.asset not in self.newest:
                raise StoreError(f"there is no asset {part.asset}")
            log = logs[part.asset, self.newest[part.asset]]
            self._grow(log, part)
            found: tuple[NamedRecord | Deed, ...] = (*part.records, *part.deeds)
            if part.rows is None:
                found = (*part.deeds, *part.records)
            for item in found:
                if isinstance(item, NamedRecord):
                    self._tell(item, came, contested)
                else:
                    self._do(item, log, came)
            if part.checkpoint is not None:
                stand = LogPlace(
                    checkpoint=part.checkpoint, checkpoint_rows=len(log.rows), checkpoint_deeds=len(log.deeds)
                )
                log.checkpoints = [*log.checkpoints, stand][-KEPT:]
        self.logs, self.came, self.contested = logs, came, contested

    def _grow(self, log: SlowLog, part: Commit) -> None:
        widths = (log.enrolment.n_inputs, log.enrolment.n_outputs)
        if part.rows is not None:
            if (part.rows.u.shape[1], part.rows.y.shape[1]) != widths:
                raise StoreError("rows of another model")
            log.arrived = part.arrived
            log.rows += [(log.arrived, part.rows.row(k)) for k in range(len(part.rows))]
        if part.rows is not None or part.cursor:
            log.cursor = part.cursor
        if part.curves is not None:
            if (part.curves.inputs.shape[1], part.curves.measured.shape[1]) != widths:
                raise StoreError("curves of another model")
            log.points += [(log.arrived, _point(part.curves, k)) for k in range(len(part.curves))]

    def _tell(
        self, item: NamedRecord, came: list[tuple[NamedRecord | Deed, float]], contested: list[tuple[str, object]]
    ) -> None:
        known = (other for k, (other, _) in enumerate(came) if k not in self.lost)
        before = [other for other in known if isinstance(other, NamedRecord) and other.id == item.id]
        content = json.loads(json.dumps(item.content))
        if not before:
            came.append((replace(item, content=content), item.time))
        elif json.dumps(before[0].content) != json.dumps(content) and (item.id, content) not in contested:
            contested.append((item.id, content))

    def _do(self, item: Deed, log: SlowLog, came: list[tuple[NamedRecord | Deed, float]]) -> None:
        if item.number or item.rows != len(log.rows):
            raise StoreError("a deed is not in its place")
        times = [row[1].time for row in log.rows if row is not None and not isnan(row[1].time)]
        number = 1 + sum(isinstance(other, Deed) for other, _ in came)
        log.times.append(times[-1] if times else nan)
        log.deeds.append(replace(item, number=number))
        came.append((log.deeds[-1], log.times[-1]))

    def log_after(self, asset: str, rows: int, deeds: int) -> Iterator[RowBlock | Deed]:
        log = self._log(asset)
        if any(row is None for row in log.rows[rows:]):
            raise ForgottenError("rows are forgotten")
        return self._between(log, range(rows, len(log.rows)), log.deeds[deeds:])

    def log_between(
        self, asset: str, begin: float | None = None, end: float | None = None, model_sha256: str | None = None
    ) -> Iterator[RowBlock | Deed]:
        log = self._log(asset, model_sha256)
        kept = [k for k, row in enumerate(log.rows) if row is not None and _inside(row[1].time, begin, end)]
        deeds = [deed for deed, time in zip(log.deeds, log.times, strict=True) if _inside(time, begin, end)]
        return self._between(log, kept, deeds)

    def _between(self, log: SlowLog, kept: Sequence[int], deeds: Sequence[Deed]) -> Iterator[RowBlock | Deed]:
        left = [*deeds]
        for k in kept:
            while left and left[0].rows <= k:
                yield left.pop(0)
            found = log.rows[k]
            assert found is not None
            yield block_of_rows([found[1]])
        yield from left

    def enrolments(self, asset: str | None = None) -> Iterator[Enrolment]:
        return (self.logs[key].enrolment for key in self.order if asset in (None, key[0]))

    def records(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord]:
        listed = self.journal(asset, kinds=kinds, begin=begin, end=end)
        found = [item for item in listed if isinstance(item, NamedRecord)]
        return iter(found if newest is None else found[len(found) - min(newest, len(found)) :])

    def note(self, entry: AuditEntry) -> None:
        self.noted.append(replace(entry, about=json.loads(json.dumps(dict(entry.about))), number=len(self.noted) + 1))

    def audit(self) -> Iterator[AuditEntry]:
        return iter(self.noted)

    def reader(self, name: str) -> tuple[int, int]:
        newest = sum(isinstance(item, NamedRecord) for item, _ in self.came)
        return self.places.setdefault(name, newest), newest

    def records_behind(self, number: int, most: int) -> list[tuple[int, NamedRecord]]:
        told = ((k, item) for k, (item, _) in enumerate(self.came) if isinstance(item, NamedRecord))
        kept = [(n, item) for n, (k, item) in enumerate(told, 1) if k not in self.lost and n > number]
        return kept[:most]

    def advance(self, name: str, number: int) -> None:
        self.places[name] = number

    def deeds(self, asset: str | None = None, *, newest: int | None = None) -> Iterator[Deed]:
        found = [item for item in self.journal(asset) if isinstance(item, Deed)]
        return iter(found if newest is None else found[len(found) - min(newest, len(found)) :])

    def journal(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord | Deed]:
        kept = (item for k, item in enumerate(self.came) if k not in self.lost)
        found = [item for item, time in kept if asset in (None, item.asset) and _inside(time, begin, end)]
        found = [item for item in found if isinstance(item, Deed) or not kinds or item.kind in kinds]
        if newest is None:
            return iter(found)
        is_deed = [isinstance(item, Deed) for item in found]
        return (item for k, item in enumerate(found) if is_deed[k:].count(is_deed[k]) <= newest)

    def curves(
        self, asset: str, begin: float | None = None, end: float | None = None, most: int | None = None
    ) -> Curves | None:
        if asset not in self.newest:
            return None
        points = [item[1] for item in self._log(asset).points if item is not None]
        points = [point for point in points if _inside(float(point.time[0]), begin, end)]
        if not points:
            return None
        names = ("time", "inputs", "measured", "expected", "sd", "cusum")
        found = Curves(**{name: np.concatenate([getattr(point, name) for point in points]) for name in names})
        return found if most is None else thinned(found, most)

    def retain(self, *, older_than: float | None = None, at_most: int | None = None) -> Forgotten:
        gone = self.forget_rows(older_than=older_than, at_most=at_most)
        return replace(gone, diagnoses=self.forget_diagnoses())

    def forget_rows(self, *, older_than: float | None = None, at_most: int | None = None) -> Forgotten:
        """Forget by age what may go; at_most: all that may go, unless it is larger than any store."""
        limit = -inf if older_than is None else older_than
        if at_most is not None and at_most < 2**40:
            limit = inf
        rows = points = 0
        for log in self.logs.values():
            needed = log.checkpoints[0].checkpoint_rows if log.checkpoints else 0
            for k, row in enumerate(log.rows[:needed]):
                if row is not None and row[0] < limit:
                    log.rows[k], rows = None, rows + 1
            for k, point in enumerate(log.points):
                if point is not None and point[0] < limit:
                    log.points[k], points = None, points + 1
        return Forgotten(rows=rows, points=points)

    def forget_diagnoses(self) -> int:
        """Forget those of an asset from before its first row, but for the last of each alarm."""
        before = len(self.lost)
        for asset in self.newest:
            rows = [row for key, log in self.logs.items() if key[0] == asset for row in log.rows if row is not None]
            begin = min((row[1].time for row in rows if not isnan(row[1].time)), default=inf)
            told = [(k, item) for k, (item, _) in enumerate(self.came) if item.asset == asset and k not in self.lost]
            for (k, item), (_, following) in pairwise([(k, x) for k, x in told if isinstance(x, NamedRecord)]):
                if item.kind == "diagnosis" and item.time >= begin:
                    break
                if item.kind == following.kind == "diagnosis":
                    self.lost.add(k)
        return len(self.lost) - before

    def reserve(self) -> str:
        return ""

    def close(self) -> None:
        """Nothing is left open."""

    def _log(self, asset: str, model_sha256: str | None = None) -> SlowLog:
        key = (asset, model_sha256 or self.newest.get(asset, ""))
        if key not in self.logs:
            raise StoreError(f"there is no asset {asset}")
        return self.logs[key]


def _point(curves: Curves, k: int) -> Curves:
    """One point of curves; values, not times, in the seven digits that are kept of what is only drawn."""
    names = ("inputs", "measured", "expected", "sd", "cusum")
    values = {name: getattr(curves, name)[k : k + 1].astype(np.float32).astype(np.float64) for name in names}
    return Curves(time=curves.time[k : k + 1], **values)


def _inside(time: float, begin: float | None, end: float | None) -> bool:
    """Whether a moment is in a period; one that is none is in the period of all."""
    if begin is None and end is None:
        return True
    return (begin is None or time >= begin) and (end is None or time <= end)
