"""A monitor of one plant: rows go in one by one, what is found comes out."""

import os
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from datetime import datetime
from decimal import Decimal
from html import escape
from numbers import Real
from types import MappingProxyType

import numpy as np

from faultbond.api.options import PathLike, file_of, level_of, method_of, names_of, spelled
from faultbond.api.plant_model import Model, ModelLike, as_model
from faultbond.api.ranked import RankedCandidate, ranked, table_html
from faultbond.api.result import SHOWN, told_silent, told_verdict
from faultbond.app.course import Finding
from faultbond.app.decision import NO_ALARM, chosen_hypothesis
from faultbond.app.kept_run import read_before
from faultbond.app.plant import find_plant
from faultbond.app.plant_run import begin, columns_after
from faultbond.app.wishes import Wanted
from faultbond.contract.findings import Decision, Detection, Diagnosis
from faultbond.contract.silence import Silent
from faultbond.errors import FaultbondError, ModelError, RecordingError
from faultbond.io.grid import GridPoint, Row, blocks_of_points
from faultbond.io.out import Out
from faultbond.io.recording import row_reader
from faultbond.io.saved import Saved, read_saved, write_saved
from faultbond.io.times import finite_number, is_not_finite
from faultbond.model.document import is_circuit
from faultbond.model.graph import BondGraph
from faultbond.report.reservations import CONTRADICTED
from faultbond.types import Method, TimeGrid

NO_VALUE = ("", "-", "na", "n/a", "null", "none", "<na>")  # texts that stand where there is no value
RowTime = float | str | datetime | np.datetime64


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Event:
    """What a row brought: an alarm, a diagnosis, or a candidate that was accepted by rule; each may be None.

    time: of the last of them, s. candidates: those of the diagnosis, best first.
    """

    time: float
    detection: Detection | None
    diagnosis: Diagnosis | None
    accepted: Decision | None
    graph: BondGraph

    @property
    def candidates(self) -> tuple[RankedCandidate, ...]:
        """The candidates of the diagnosis, best first, in the units of the model file; none without one."""
        return ranked(self.diagnosis, self.graph)

    @property
    def best(self) -> RankedCandidate | None:
        """The best candidate; None without a diagnosis."""
        return self.candidates[0] if self.candidates else None


def _refuse_strange(name: str, value: object) -> None:
    """Refuse what is neither a number, as a text, too, nor a sign that there is none."""
    if isinstance(value, str):
        if value.strip().lower() in NO_VALUE or np.isfinite(finite_number(value)) or is_not_finite(value):
            return
        raise RecordingError(f"column {name!r} is {value[:40]!r}. Give a number, or None where there is none.")
    is_truth = isinstance(value, bool | np.bool_)
    if not is_truth and (value is None or isinstance(value, Real | Decimal) or repr(value) == "<NA>"):
        return
    raise RecordingError(f"column {name!r} is a {type(value).__name__}. Give a number.")


class Monitor:
    """Watches one plant, live.

    Parameters
    ----------
    model : what `load` gives, or the path of a model file
    method : `bank` or `classic`
    accept : probability from which a diagnosis is accepted once it has been so sure for a while; `auto`: 0.95

    Raises
    ------
    FaultbondError
        Where something is wrong with the model or an option, or it has no time.

    Example
    -------
    >>> import faultbond as fb
    >>> monitor = fb.Monitor(fb.example("tank"))
    >>> monitor.update(0.0, {"u_in": 60.0, "u_out": 50.0, "flow": 1.2e-4, "pressure": 9000.0})
    >>> monitor.verdict, monitor.counts["samples"]
    ('none', 1)
    """

    def __init__(self, model: ModelLike, *, method: str = "bank", accept: float | str | None = None) -> None:
        self._begin(as_model(model), method_of(method), accept, None)

    def _begin(self, model: Model, method: Method, accept: float | str | None, before: Saved | None) -> None:
        if is_circuit(model.source) or model.graph.grid is TimeGrid.NONE:
            raise ModelError(f"{model.file}: a network without time is diagnosed row by row, by `run`.")
        self.model, self._method = model, method
        self._found: list[Finding] = []
        plant = find_plant(model.source, Wanted(method=method))
        self._columns = columns_after(plant, before)
        begun = begin(
            plant,
            Wanted(method=method, accept=level_of(accept)),
            before,
            out=Out(text=None, json=None),
            live=True,
            curves=False,
            hear=self._found.append,
        )
        self._watcher, self._course, self._grid = begun.run.watcher, begun.run.course, begun.grid
        self._read: Callable[[int, Sequence[object]], Row] | None = None
        self._header: tuple[str, ...] = ()
        self._known: frozenset[str] = frozenset()  # columns of the first row
        self._rows = 0

    @classmethod
    def restore(cls, path: PathLike, model: ModelLike | None = None, *, accept: float | str | None = None) -> "Monitor":
        """Go on from a file that `save`, or `run` with `state`, wrote.

        Parameters
        ----------
        path : the file
        model : to be watched; None takes that in the file
        accept : see `Monitor`

        Raises
        ------
        RecordingError
            Where the file cannot be read, is damaged, or is of another model.
        """
        file = file_of(path, "path")
        if model is None:
            document = read_saved(file).document
            if document is None:
                raise RecordingError(f"{path}: the model is not in it. Give it, too: Monitor.restore(path, model).")
            label, text = document
            restored = Model(text, file=label)
        else:
            restored = as_model(model)
        before = read_before(file, restored.graph)
        if before is None:
            raise RecordingError(f"{path}: there is no such file.")
        monitor = cls.__new__(cls)
        monitor._begin(restored, before.method, accept, before)
        return monitor

    def update(self, time: RowTime | None, values: Mapping[str, object]) -> Event | None:
        """Take a row, and tell what was found.

        Parameters
        ----------
        time : of the row: a number in the unit of the model's time column, a date and time, or an ISO text; None where
            the model has no time column
        values : by column, in the units of the model file; None or nan where there is none. The first row names all
            columns, later ones may leave out those without a value. Columns of the
            first row that the model does not name are ignored.

        Raises
        ------
        RecordingError
            Where the time cannot be read, the first row lacks a column, a later one has another, or a value is no
            number.
        """
        if not isinstance(values, Mapping):
            raise RecordingError(f"{type(values).__name__}: expected values by column, such as {{'flow': 1.2e-4}}.")
        row = self._row(time, values)
        self._found.clear()
        self._take(self._grid.push(row))
        return self._event()

    def finish(self) -> Event | None:
        """Pass on rows that wait for others, and tell what was found; the last diagnosis after an alarm."""
        self._found.clear()
        self._take(self._grid.finish())
        self._course.finish()
        return self._event()

    def __repr__(self) -> str:
        return f"<Monitor of {self.model.name!r}: {self._standing}>"

    def _repr_html_(self) -> str:
        is_contradicted = self.diagnosis is not None and self.diagnosis.unexplained is not None
        told = f"{self._standing}. {CONTRADICTED}" if is_contradicted else self._standing
        head = f"<p><b>{escape(self.model.name)}</b>: {escape(told)}</p>"
        return head + table_html(self.candidates, SHOWN, is_contradicted=is_contradicted)

    def accept(self, *names: str) -> Decision:
        """Take a candidate as the new normal; without names the best.

        Parameters
        ----------
        names : parameters or components of the candidate, or its sensor or input

        Raises
        ------
        FaultbondError
            Where there is no alarm to explain, or no such candidate.
        """
        return self._course.accept(self._chosen(spelled(names)))

    def repaired(self, *names: str) -> Decision:
        """Say that a candidate was the fault and is mended, nominal again. Arguments as of `accept`."""
        return self._course.accept(self._chosen(spelled(names)), repaired=True)

    def reject(self, *names: str) -> Decision:
        """Rule a candidate out, and with it all sets that contain it; the others share its probability.

        Parameters
        ----------
        names : parameters or components of the candidate, or its sensor or input

        Raises
        ------
        FaultbondError
            Where there is no alarm to explain, or no such candidate.
        """
        if not names:
            raise FaultbondError("reject: name the candidate to rule out.")
        return self._course.reject(self._chosen(spelled(names)))

    def save(self, path: PathLike) -> None:
        """Write the monitor to a file, the one of `run --state`; rows that wait for others are not in it.

        Raises
        ------
        FaultbondError
            Before the first row, and where the file cannot be written.
        """
        saved = self._course.saved(self._method)
        if saved is None:
            raise FaultbondError(f"{path}: there is nothing to save before the first row.")
        try:
            write_saved(file_of(path, "path"), saved)
        except OSError as error:
            raise FaultbondError(f"{os.fspath(path)}: it cannot be written: {error.strerror or error}.") from error

    @property
    def detection(self) -> Detection | None:
        """The alarm for which nothing was accepted yet, and that is not over by itself; None: all is as expected."""
        return self._course.found.open

    @property
    def diagnosis(self) -> Diagnosis | None:
        """What explains the alarm as of now, SI; None without one."""
        return self._course.diagnosis

    @property
    def candidates(self) -> tuple[RankedCandidate, ...]:
        """The candidates as of now, best first, in the units of the model file; none without an alarm."""
        return ranked(self.diagnosis, self.model.graph)

    @property
    def best(self) -> RankedCandidate | None:
        """The best candidate as of now; None without an alarm."""
        candidates = self.candidates
        return candidates[0] if candidates else None

    @property
    def accepted(self) -> tuple[Decision, ...]:
        """All that was accepted, SI."""
        return self._course.found.accepted

    @property
    def rejected(self) -> tuple[Decision, ...]:
        """What was ruled out since the alarm, SI."""
        return self._course.found.rejected

    @property
    def verdict(self) -> str:
        """`fault`, `healthy`, `partial` or `none`, as of `Result`, since this monitor began or was restored."""
        return told_verdict(self._course.verdict, self.silent)

    @property
    def no_verdict(self) -> str:
        """Why nothing can be said of the plant; empty where something can."""
        return self._course.no_verdict()

    @property
    def silent(self) -> tuple[Silent, ...]:
        """Sensors, then inputs, that have given no value, hardly any, or none for long."""
        return self._course.silent

    @property
    def counts(self) -> Mapping[str, int | float | None]:
        """The numbers of the record `end`, as of now: samples, missing, late, and so on."""
        record = self._course.end
        return MappingProxyType({key: value for key, value in record.items() if isinstance(value, int | float | None)})

    @property
    def _standing(self) -> str:
        """What it says as of now, in a few words."""
        since = f", since {self.detection.time:.9g} s" if self.detection is not None else ""
        return f"{self.verdict}, {self.counts['samples']} samples{since}{told_silent(self.silent)}"

    def _row(self, time: RowTime | None, values: Mapping[str, object]) -> Row:
        """Give a row as a recording would have it."""
        if self._read is None:
            self._read, self._header = self._reader(time, values)
            self._known = frozenset(map(str, values))
        for name in map(str, values):
            if name not in self._known and name != self._columns.time.column:
                known = ", ".join(sorted(self._known))
                raise RecordingError(f"no column {name!r} was in the first row, which had {known}.")
        clock = self._columns.time.column
        fields = [time if name == clock else values.get(name) for name in self._header]
        for name, value in zip(self._header, fields, strict=True):
            if name != clock:
                _refuse_strange(name, value)
        if isinstance(time, np.datetime64):
            fields[self._header.index(str(clock))] = time.astype("datetime64[us]").item()
        row = self._read(self._rows + 1, fields)
        if not np.isfinite(row.time):
            raise RecordingError(f"time {time!r}: expected seconds as the model file says, or an ISO time.")
        self._rows += 1
        return row

    def _reader(
        self, time: RowTime | None, values: Mapping[str, object]
    ) -> tuple[Callable[[int, Sequence[object]], Row], tuple[str, ...]]:
        clock = self._columns.time.column
        timed = [] if clock is None or (time is None and self._columns.time.optional) else [clock]
        header = (*timed, *(name for name in map(str, values) if name != clock))
        row_reader(self._columns, header, "the first row")  # is every column there?
        needed = tuple(item.header for item in self._columns.needed(header))
        return row_reader(self._columns, needed, "the row"), needed

    def _take(self, points: Iterable[GridPoint]) -> None:
        for block in blocks_of_points(points):
            self._course.take(block)

    def _event(self) -> Event | None:
        if not self._found:
            return None
        last = self._found[::-1]
        return Event(
            time=last[0].time,
            detection=next((item for item in last if isinstance(item, Detection)), None),
            diagnosis=next((item for item in last if isinstance(item, Diagnosis)), None),
            accepted=next((item for item in last if isinstance(item, Decision)), None),
            graph=self.model.graph,
        )

    def _chosen(self, names: tuple[str, ...]) -> int:
        diagnosis = self.diagnosis
        if diagnosis is None or not diagnosis.candidates:
            raise FaultbondError(NO_ALARM)
        return chosen_hypothesis(self._watcher, diagnosis, names_of(names) if names else ())
