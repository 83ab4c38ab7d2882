"""A run kept in a file: the numbers of its method, where its grid stands, and what it has found and was told.

The file is an archive of arrays, the small things in it one JSON text. It is replaced as a whole, and checked as a
whole before any of it is used.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from io import BytesIO
from pathlib import Path
from typing import IO
from zipfile import BadZipFile

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.contract.findings import Decision, Detection, Forecast, Suspect
from faultbond.errors import RecordingError
from faultbond.io.archive import read_archive, write_archive
from faultbond.io.files import replaced
from faultbond.io.grid import LATEST, LOOK_BACK, MAX_GAP, Counts, GridClock, Row
from faultbond.io.record_file import Mark
from faultbond.io.typed import TypeLimits, typed
from faultbond.model.graph import BondGraph
from faultbond.runtime.allowed import COUNT
from faultbond.types import Method

FORMAT = 3  # of the file; one of another format is refused
_NUMBERS, _ROWS, _FROZEN = "numbers.", "rows.", "frozen"
_STRANGE = (
    "this is not a state that this version of faultbond saved, or it is damaged. "
    "Name another file, or delete it to begin anew."
)
_NO_STATE = "this is not the file of a run, as `run --state FILE` writes it. Name that."


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundSoFar:
    """What a run has found so far.

    detections: alarms. watched: points with a measured value at which the alarms were on. waiting: points before every
    input had a value. wild: values that were refused since the plant did not follow them. outside: points at
    which the model did not hold. sensors_outside: readings of sensors that did not, at others. open: the detection that
    nothing was accepted for yet. rejected: candidates that were ruled out since then.
    """

    detections: int = 0
    watched: int = 0
    waiting: int = 0
    wild: int = 0
    outside: int = 0
    sensors_outside: int = 0
    open: Detection | None = None
    accepted: tuple[Decision, ...] = ()
    rejected: tuple[Decision, ...] = ()

    def with_counts(self, *, watched: int, waiting: int, wild: int, outside: int, sensors_outside: int) -> "FoundSoFar":
        """Give this after some more points, by how much each number grows."""
        return replace(
            self,
            watched=self.watched + watched,
            waiting=self.waiting + waiting,
            wild=self.wild + wild,
            outside=self.outside + outside,
            sensors_outside=self.sensors_outside + sensors_outside,
        )

    def with_detection(self, detection: Detection) -> "FoundSoFar":
        """Give this after one more alarm."""
        return replace(self, detections=self.detections + 1, open=detection, rejected=())

    def with_accepted(self, accepted: Decision) -> "FoundSoFar":
        """Give this after a candidate was accepted."""
        return replace(self, open=None, accepted=(*self.accepted, accepted), rejected=())

    def with_rejected(self, rejected: Decision) -> "FoundSoFar":
        """Give this after a candidate was ruled out."""
        return replace(self, rejected=(*self.rejected, rejected))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Saved:
    """A run that can go on.

    numbers: what the method remembers, by name. records: up to where its file of records holds them, if there is one.
    document: the model file's path and text, if they are kept.
    """

    model: str
    model_sha256: str
    version: str
    method: Method
    numbers: Mapping[str, FloatArray]
    clock: GridClock
    found: FoundSoFar
    records: Mark | None = None
    document: tuple[str, str] | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class _About:
    """What the file tells in JSON. clock: index and time of `origin`, then `usual`, `last_index`, `last_time`."""

    format: int
    model: str
    model_sha256: str
    version: str
    method: Method
    counts: Counts
    clock: tuple[int, float, float, int, float]
    firsts: tuple[str, ...]
    found: FoundSoFar
    records: Mark | None
    document: tuple[str, str] | None = None


_LIMITS = TypeLimits(
    least={Counts: 0, Mark: 0, FoundSoFar: 0, Detection: 0, _About: 0}, not_finite=frozenset({Suspect, Forecast})
)
_MISTAKES = (BadZipFile, EOFError, KeyError, NotImplementedError, OverflowError, RecursionError, TypeError, ValueError)


def write_saved(path: Path, saved: Saved) -> None:
    """Write a run to a file, which is replaced as a whole; who reads it meanwhile gets the one before."""
    with replaced(path) as stream:
        _write(stream, saved)


def bytes_of_saved(saved: Saved) -> bytes:
    """Give a run as what `write_saved` writes."""
    stream = BytesIO()
    _write(stream, saved)
    return stream.getvalue()


def _write(stream: IO[bytes], saved: Saved) -> None:
    clock = saved.clock
    about = _About(
        format=FORMAT,
        model=saved.model,
        model_sha256=saved.model_sha256,
        version=saved.version,
        method=saved.method,
        counts=clock.counts,
        clock=(*clock.origin, clock.usual, clock.last_index, clock.last_time),
        firsts=clock.firsts,
        found=saved.found,
        records=saved.records,
        document=saved.document,
    )
    arrays = {_NUMBERS + name: values for name, values in saved.numbers.items()}
    for name in ("time", "u", "y"):
        arrays[_ROWS + name] = np.array([getattr(row, name) for row in clock.placed])
    if clock.frozen is not None:
        arrays[_FROZEN] = clock.frozen
    write_archive(stream, asdict(about), arrays)


def read_saved(path: Path) -> Saved:
    """Give the run that `write_saved` wrote.

    Raises
    ------
    RecordingError
        Where the file cannot be read, is not of this kind, or is damaged.
    """
    return _read(path, str(path))


def saved_from(content: bytes, name: str) -> Saved:
    """Give the run that `bytes_of_saved` gave.

    Parameters
    ----------
    content : its bytes
    name : what an error calls it

    Raises
    ------
    RecordingError
        Where it is not of this kind, or is damaged.
    """
    return _read(content, name)


def _read(source: Path | bytes, path: str) -> Saved:
    try:
        told, arrays = read_archive(source)
        if told["format"] != FORMAT:
            raise ValueError(told["format"])
        about = typed(_About, told, _LIMITS)
        first, start, usual, last_index, last_time = about.clock
        times, u, y = (arrays[_ROWS + name] for name in ("time", "u", "y"))
        if not (0 < len(times) <= LOOK_BACK and np.all(np.abs(times) <= LATEST) and np.all(np.diff(times) >= 0.0)):
            raise ValueError("times of rows")
        rows = zip(times, u, y, strict=True)
        return Saved(
            model=about.model,
            model_sha256=about.model_sha256,
            version=about.version,
            method=about.method,
            numbers={name.removeprefix(_NUMBERS): arrays[name] for name in arrays if name.startswith(_NUMBERS)},
            clock=GridClock(
                counts=about.counts,
                placed=tuple(Row(time=float(time), u=u_k, y=y_k) for time, u_k, y_k in rows),
                origin=(first, start),
                usual=usual,
                last_index=last_index,
                last_time=last_time,
                frozen=arrays.get(_FROZEN),
                firsts=about.firsts,
            ),
            found=about.found,
            records=about.records,
            document=about.document,
        )
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}.") from error
    except _MISTAKES as error:
        raise RecordingError(f"{path}: {_STRANGE if _was_archive(source) else _NO_STATE}") from error


def _was_archive(source: Path | bytes) -> bool:
    """Whether something begins as a saved run does, or is empty: else it may be anything, and worth to be kept."""
    if isinstance(source, bytes):
        return source[:2] in (b"PK", b"")
    with source.open("rb") as stream:
        return stream.read(2) in (b"PK", b"")


def refuse_strange(path: str, saved: Saved, graph: BondGraph) -> None:
    """Refuse a run that is whole, but cannot be one of this plant.

    Raises
    ------
    RecordingError
        Where it knows other sensors, inputs, parameters or components, or its clock stands where no grid comes to.
    """
    clock, found = saved.clock, saved.found
    n_u, n_y = len(graph.inputs), len(graph.sensors)
    rows_fit = all(row.u.shape == (n_u,) and row.y.shape == (n_y,) for row in clock.placed)
    frozen_fits = clock.frozen is None or (clock.frozen.shape == (3, n_y) and COUNT.admits(clock.frozen[2]))
    names = {item.name for of in (graph.parameters, graph.components, graph.inputs, graph.sensors) for item in of}
    decided = [item.candidate for item in (*found.accepted, *found.rejected)]
    told = {name.partition(".")[0] for item in decided for name in (*item.parameters, *item.components)}
    told |= set(found.open.signals if found.open is not None else ())
    if not (rows_fit and frozen_fits and told <= names and _ticks(clock, graph.sample_time)):
        raise RecordingError(f"{path}: {_STRANGE}")


def _ticks(clock: GridClock, step: float | None) -> bool:
    """Whether a grid with this step, None from row to row, can stand so."""
    (first, start), last = clock.origin, clock.placed[-1].time
    counted = 0 <= first <= clock.last_index == clock.counts.samples - 1
    near = max(abs(start), abs(clock.last_time), abs(last)) <= LATEST and clock.usual >= 0.0
    if not (counted and near) or step is None:
        return counted and near
    expected = start + (clock.last_index - first) * step
    return (
        math.isclose(expected, clock.last_time, rel_tol=1e-9, abs_tol=step) and abs(last - expected) <= MAX_GAP * step
    )
