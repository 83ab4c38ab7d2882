"""A run kept in a file: the numbers of its method, where its grid stands, and what it has found and was told.

The file is an archive of arrays, the small things in it one JSON text. It is replaced as a whole, and checked as a
whole before any of it is used.
"""

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from pathlib import Path
from typing import Any
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
from faultbond.runtime.rule import Sure
from faultbond.types import Method

FORMAT = 2  # of the file; one of another format is refused
_NUMBERS, _ROWS, _FROZEN = "numbers.", "rows.", "frozen"


@dataclass(frozen=True, slots=True, kw_only=True)
class FoundSoFar:
    """What a run has found so far.

    detections: alarms. watched: points with a measured value at which the alarms were on. waiting: points before every
    input had a value. wild: values that were refused since the plant did not follow them. open: the detection that
    nothing was accepted for yet. rejected: candidates that were ruled out since then. sure: what the rule has in mind.
    """

    detections: int = 0
    watched: int = 0
    waiting: int = 0
    wild: int = 0
    open: Detection | None = None
    accepted: tuple[Decision, ...] = ()
    rejected: tuple[Decision, ...] = ()
    sure: Sure = field(default_factory=Sure)

    def with_detection(self, detection: Detection) -> "FoundSoFar":
        """Give this after one more alarm."""
        return replace(self, detections=self.detections + 1, open=detection, rejected=(), sure=Sure())

    def with_accepted(self, accepted: Decision) -> "FoundSoFar":
        """Give this after a candidate was accepted."""
        return replace(self, open=None, accepted=(*self.accepted, accepted), rejected=(), sure=Sure())

    def with_rejected(self, rejected: Decision) -> "FoundSoFar":
        """Give this after a candidate was ruled out."""
        return replace(self, rejected=(*self.rejected, rejected), sure=Sure())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Saved:
    """A run that can go on.

    numbers: what the method remembers, by name. records: up to where its file of records holds them, if there is one.
    """

    model: str
    model_sha256: str
    version: str
    method: Method
    numbers: Mapping[str, FloatArray]
    clock: GridClock
    found: FoundSoFar
    records: Mark | None = None


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


_LIMITS = TypeLimits(
    least={Counts: 0, Mark: 0, FoundSoFar: 0, Detection: 0, _About: 0}, not_finite=frozenset({Suspect, Forecast})
)
_MISTAKES = (BadZipFile, EOFError, KeyError, NotImplementedError, OverflowError, RecursionError, TypeError, ValueError)


def write_saved(path: Path, saved: Saved) -> None:
    """Write a run to a file, which is replaced as a whole; who reads it meanwhile gets the one before."""
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
    )
    arrays = {_NUMBERS + name: values for name, values in saved.numbers.items()}
    for name in ("time", "u", "y"):
        arrays[_ROWS + name] = np.array([getattr(row, name) for row in clock.placed])
    if clock.frozen is not None:
        arrays[_FROZEN] = clock.frozen
    with replaced(path) as stream:
        write_archive(stream, asdict(about), arrays)


def read_saved(path: Path) -> Saved:
    """Give the run that `write_saved` wrote.

    Raises
    ------
    RecordingError
        Where the file cannot be read, is not of this kind, or is damaged.
    """
    try:
        return _saved(*read_archive(path))
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}.") from error
    except _MISTAKES as error:
        raise RecordingError(_strange(path)) from error


def refuse_strange(path: Path, saved: Saved, graph: BondGraph) -> None:
    """Refuse a run that is whole, but cannot be one of this plant.

    Raises
    ------
    RecordingError
        Where it knows other sensors, inputs, parameters or components, or its clock stands where no grid comes to.
    """
    clock, names = saved.clock, _names(graph)
    n_u, n_y = len(graph.inputs), len(graph.sensors)
    rows_fit = all(row.u.shape == (n_u,) and row.y.shape == (n_y,) for row in clock.placed)
    frozen_fits = clock.frozen is None or (clock.frozen.shape == (3, n_y) and COUNT.admits(clock.frozen[2]))
    if not (rows_fit and frozen_fits and _told(saved.found) <= names and _ticks(clock, graph.sample_time)):
        raise RecordingError(_strange(path))


def _strange(path: Path) -> str:
    return (
        f"{path}: this is not a state that this version of faultbond saved, or it is damaged. "
        "Name another file, or delete it to begin anew."
    )


def _saved(told: dict[str, Any], arrays: dict[str, FloatArray]) -> Saved:
    """Put a run together; anything that is missing or of another form raises."""
    if told["format"] != FORMAT:
        raise ValueError(told["format"])
    about = typed(_About, told, _LIMITS)
    first, start, usual, last_index, last_time = about.clock
    return Saved(
        model=about.model,
        model_sha256=about.model_sha256,
        version=about.version,
        method=about.method,
        numbers={name.removeprefix(_NUMBERS): arrays[name] for name in arrays if name.startswith(_NUMBERS)},
        clock=GridClock(
            counts=about.counts,
            placed=_rows(*(arrays[_ROWS + name] for name in ("time", "u", "y"))),
            origin=(first, start),
            usual=usual,
            last_index=last_index,
            last_time=last_time,
            frozen=arrays.get(_FROZEN),
            firsts=about.firsts,
        ),
        found=about.found,
        records=about.records,
    )


def _rows(times: FloatArray, inputs: FloatArray, outputs: FloatArray) -> tuple[Row, ...]:
    """Give the last rows that were placed, in the order of time."""
    if not (0 < len(times) <= LOOK_BACK and np.all(np.abs(times) <= LATEST) and np.all(np.diff(times) >= 0.0)):
        raise ValueError("times of rows")
    return tuple(Row(time=float(time), u=u, y=y) for time, u, y in zip(times, inputs, outputs, strict=True))


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


def _told(found: FoundSoFar) -> set[str]:
    """Give the names of all that was found and decided."""
    decided = [item.candidate for item in (*found.accepted, *found.rejected)]
    named = {name.partition(".")[0] for item in decided for name in (*item.parameters, *item.components)}
    return named | set(found.open.signals if found.open is not None else ())


def _names(graph: BondGraph) -> set[str]:
    """Give the names of all that can be found in a plant."""
    parts = {item.name for item in graph.parameters} | {item.name for item in graph.components}
    return parts | {item.name for item in graph.inputs} | {item.name for item in graph.sensors}
