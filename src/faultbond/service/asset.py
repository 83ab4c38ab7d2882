"""An asset under watch: what it remembers follows from its log alone, rows and deeds in their order."""

import json
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import asdict, dataclass

from faultbond.app.course import Course, Following
from faultbond.app.decision import NO_ALARM, chosen_hypothesis
from faultbond.app.kept_run import refuse_other
from faultbond.app.plant import WatchedPlant
from faultbond.app.plant_run import PlantRun, new_grid, watcher_of
from faultbond.app.wishes import Wanted
from faultbond.contract.findings import Decision, Detection, Diagnosis, History
from faultbond.contract.json_records import diagnosis_record
from faultbond.contract.samples import Status
from faultbond.errors import FaultbondError, StoreError
from faultbond.io.grid import Counts, PointBlock, RowBlock
from faultbond.io.out import Out, finite
from faultbond.io.saved import Saved, bytes_of_saved, saved_from
from faultbond.io.typed import TypeLimits, typed
from faultbond.report.verdict import open_diagnosis
from faultbond.runtime.trace import Trace
from faultbond.service.alarm import Alarm
from faultbond.service.contract.messages import DECISIONS, Action, Curves, Deed, NamedRecord
from faultbond.types import Method

RECENT = 1200  # grid points that are kept in memory at least, for the report
MOST_UNDOS = 4  # decisions that can be taken back; each keeps the state before it, in memory and in every checkpoint
_CLOSING = frozenset({"accepted"})  # kinds of records with which an alarm returns to normal


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Consequence:
    """What rows or a deed brought: records in their order, curves of the new grid points; None: there are none."""

    records: tuple[NamedRecord, ...] = ()
    curves: Curves | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _Kept:
    """What a checkpoint has beside the run. turn: see `Asset`; status: message of what the method was doing.

    undo: of each `Undo` three numbers in a row, the first its size; zeros where there is none.
    """

    alarm: Alarm
    turn: int
    status: str
    undo: tuple[int, ...] = ()


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Undo:
    """How to take a decision back: a checkpoint from before it, behind so many rows and deeds of the log."""

    checkpoint: bytes
    rows: int
    deeds: int


class Asset:
    """One plant under watch.

    undos: how to take decisions back, the latest last; those of before an alarm cannot be, nor more than `MOST_UNDOS`.
    turn: how often what a person decided turned the course, by which records of the same sample are told apart.

    Parameters
    ----------
    name : what the site calls it
    plant : its model
    checkpoint : of it, from which it goes on; None begins anew
    accept : probability from which a diagnosis is accepted by rule; None: a person accepts

    Raises
    ------
    StoreError
        Where the checkpoint is damaged, or of another model.
    FaultbondError
        Where something is wrong with the model.
    """

    def __init__(
        self, name: str, plant: WatchedPlant, checkpoint: bytes | None = None, *, accept: float | None = None
    ) -> None:
        self.name, self.plant, self.alarm = name, plant, Alarm()
        self.undos: tuple[Undo, ...] = ()
        self.turn = 0
        self._status: Status | None = None  # at the checkpoint
        before = self._opened(checkpoint) if checkpoint is not None else None
        self._watcher = watcher_of(plant, Wanted(), before)
        self.spec = self._watcher.spec
        self._grid = new_grid(self.spec, live=True, clock=before.clock if before else None, same=True)
        self._trace = Trace(self.spec, lag=self._watcher.lag, newest=RECENT)
        self._records: list[NamedRecord] = []
        out = Out(text=None, json=None, hear=self._tell)
        following = Following(out=out, trace=self._trace, level=accept)
        self._course = Course(self._watcher, self._grid, following, before)
        self.run = PlantRun(plant=plant, watcher=self._watcher, course=self._course, trace=self._trace)
        self._show_what_is_left()  # of before: the next diagnosis may be far

    def take(self, rows: RowBlock) -> Consequence:
        """Pass rows on in the order of arrival."""
        return self._pass(self._grid.push_block(rows))

    def do(self, deed: Deed, deeds: int) -> Consequence:
        """Do what a person wants; to take something back is not among it.

        Parameters
        ----------
        deed : what
        deeds : of the log that were before it

        Raises
        ------
        FaultbondError
            Where it makes no sense now.
        """
        if deed.action not in DECISIONS:
            self.alarm = self.alarm.after(deed)
            return Consequence()
        hypothesis, before = self._chosen(deed), self._bytes(())
        self.turn += 1
        if deed.action is Action.REJECT:
            self._course.reject(hypothesis)
            left = self._show_what_is_left()  # the next diagnosis may be far
            if left is not None:
                self._tell(diagnosis_record(left))
        else:
            self._course.accept(hypothesis, repaired=deed.action is Action.REPAIRED)
        kept = (Undo(checkpoint=before, rows=deed.rows, deeds=deeds),) if before is not None else ()
        self.undos = (*self.undos, *kept)[-MOST_UNDOS:] if kept else ()  # one goes only after those behind it
        return Consequence(records=self._told())

    def checkpoint(self) -> bytes | None:
        """Give what it remembers; None as long as rows wait for others, and before the first."""
        return self._bytes(self.undos)

    def _bytes(self, undos: Sequence[Undo]) -> bytes | None:
        saved = None if self._grid.holds_back else self._course.saved(Method.BANK)
        if saved is None:
            return None
        places = tuple(number for undo in undos for number in (len(undo.checkpoint), undo.rows, undo.deeds))
        status = (self.status or Status.WAITING).value
        kept = json.dumps(asdict(_Kept(alarm=self.alarm, turn=self.turn, status=status, undo=places))).encode()
        earlier = b"".join(undo.checkpoint for undo in undos)
        return len(kept).to_bytes(4, "little") + kept + earlier + bytes_of_saved(saved)

    @property
    def detection(self) -> Detection | None:
        """The alarm that is open."""
        return self._course.found.open

    @property
    def diagnosis(self) -> Diagnosis | None:
        """What explains it, as it was told last; None: nothing was told yet."""
        return open_diagnosis(self._trace.history(1))

    @property
    def accepted(self) -> tuple[Decision, ...]:
        """All that was accepted."""
        return self._course.found.accepted

    @property
    def time(self) -> float | None:
        """Time of the last grid point; None before the first."""
        clock = self._grid.clock
        return clock.last_time if clock is not None else None

    @property
    def counts(self) -> Counts:
        """What was passed and what was wrong with it, since the log began."""
        return self._grid.counts

    @property
    def wild(self) -> int:
        """How many values were refused as wild, since the log began."""
        return self._course.found.wild

    @property
    def status(self) -> Status | None:
        """What the method is doing; None before the first sample."""
        return self._trace.status or self._status

    def curves(self, newest: int) -> Curves:
        """Give curves of the last grid points, of those that are in memory."""
        seen = self._trace.history(newest)
        return Curves(
            time=seen.time,
            inputs=seen.inputs,
            measured=seen.measured,
            expected=seen.expected,
            sd=seen.expected_sd,
            cusum=seen.cusum,
        )

    def history(self, newest: int | None = None) -> History:
        """Give what was seen of the last grid points."""
        return self._trace.history(newest)

    def _opened(self, checkpoint: bytes) -> Saved:
        """Give the run of a checkpoint, and remember what else it has."""
        size = int.from_bytes(checkpoint[:4], "little")
        try:
            kept = typed(_Kept, json.loads(checkpoint[4 : 4 + size]), TypeLimits(least={_Kept: 0}))
            self._status = Status(kept.status)
        except (TypeError, ValueError) as error:
            raise StoreError(f"{self.name}: its checkpoint is damaged.") from error
        undos, begin = list[Undo](), 4 + size
        for n_bytes, rows, deeds in zip(*[iter(kept.undo)] * 3, strict=False):
            undos.append(Undo(checkpoint=checkpoint[begin : begin + n_bytes], rows=rows, deeds=deeds))
            begin += n_bytes
        saved = saved_from(checkpoint[begin:], f"checkpoint of {self.name}")
        refuse_other(f"checkpoint of {self.name}", saved, self.plant.graph)
        self.alarm, self.turn = kept.alarm, kept.turn
        self.undos = tuple(undo for undo in undos if undo.checkpoint)
        return saved

    def _pass(self, blocks: Iterable[PointBlock]) -> Consequence:
        n_points = 0
        for points in blocks:
            self._course.take(points)
            n_points += len(points)
        return Consequence(records=self._told(), curves=self.curves(n_points) if n_points else None)

    def _tell(self, record: Mapping[str, object]) -> None:
        """Take a record of the run, and let the alarm follow."""
        kind, sample, told = str(record["record"]), self._course.sample, finite(record)
        time = float(told["time"])
        if kind == "detection":
            self.alarm, self.undos = self.alarm.raised(time), ()
        elif kind in _CLOSING:
            self.alarm = self.alarm.returned(time)
        self._records.append(
            NamedRecord(
                id=f"{self.name}/{self.spec.model_sha256[:12]}/{self.turn}/{sample}/{kind}",
                asset=self.name,
                sample=sample,
                time=time,
                kind=kind,
                content=told,
            )
        )

    def _show_what_is_left(self) -> Diagnosis | None:
        """Show how the candidates stand now."""
        left = self._course.diagnosis
        if left is not None:
            self._trace.conclude(left)
        return left

    def _told(self) -> tuple[NamedRecord, ...]:
        told = tuple(self._records)
        self._records.clear()
        return told

    def _chosen(self, deed: Deed) -> int:
        diagnosis = self._course.diagnosis
        if diagnosis is None or not diagnosis.candidates:
            raise FaultbondError(f"{self.name}: {NO_ALARM}")
        if not deed.target:
            raise FaultbondError(f"{self.name}: name the suspects of the candidate to {deed.action.value}.")
        return chosen_hypothesis(self._watcher, diagnosis, tuple(deed.target))
