"""A run kept in a file: the numbers of its method, where its grid stands, and what it has found and was told.

The file is an archive of arrays (`numpy.savez`), the small things in it one JSON text. It is replaced as a whole.
"""

import json
import os
from collections.abc import Mapping
from dataclasses import asdict, dataclass, field, replace
from enum import Enum
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from faultbond.errors import RecordingError
from faultbond.io.grid import Clock, Counts, Row
from faultbond.runtime.history import Candidate, Decider, Decision, Detection, Forecast, Suspect
from faultbond.runtime.rule import Sure
from faultbond.types import FaultKind, FloatArray, Method

FORMAT = 1  # of the file; one of another format is refused
_NUMBERS, _ROWS, _FROZEN = "numbers.", "rows.", "frozen"


@dataclass(frozen=True, slots=True, kw_only=True)
class Found:
    """What a run has found so far.

    detections: alarms. watched: points with a measured value at which the alarms were on. waiting: points before every
    input had a value. open: the detection that nothing was accepted for yet. rejected: candidates that were ruled out
    since then. sure: what the rule has in mind.
    """

    detections: int = 0
    watched: int = 0
    waiting: int = 0
    open: Detection | None = None
    accepted: tuple[Decision, ...] = ()
    rejected: tuple[Decision, ...] = ()
    sure: Sure = field(default_factory=Sure)

    def with_detection(self, detection: Detection) -> "Found":
        """Give this after one more alarm."""
        return replace(self, detections=self.detections + 1, open=detection, rejected=(), sure=Sure())

    def with_accepted(self, accepted: Decision) -> "Found":
        """Give this after a candidate was accepted."""
        return replace(self, open=None, accepted=(*self.accepted, accepted), rejected=(), sure=Sure())

    def with_rejected(self, rejected: Decision) -> "Found":
        """Give this after a candidate was ruled out."""
        return replace(self, rejected=(*self.rejected, rejected), sure=Sure())


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Saved:
    """A run that can go on. numbers: what the method remembers, by name."""

    model: str
    model_sha256: str
    version: str
    method: Method
    numbers: Mapping[str, FloatArray]
    clock: Clock
    found: Found


def write_saved(path: Path, saved: Saved) -> None:
    """Write a run to a file, which is replaced as a whole; who reads it meanwhile gets the one before."""
    clock = saved.clock
    about = {
        "format": FORMAT,
        "model": saved.model,
        "model_sha256": saved.model_sha256,
        "version": saved.version,
        "method": saved.method.value,
        "counts": asdict(clock.counts),
        "clock": [*clock.origin, clock.usual, clock.last_index, clock.last_time],
        "found": asdict(saved.found),
    }
    arrays = {_NUMBERS + name: values for name, values in saved.numbers.items()}
    for name in ("time", "u", "y"):
        arrays[_ROWS + name] = np.array([getattr(row, name) for row in clock.placed])
    if clock.frozen is not None:
        arrays[_FROZEN] = clock.frozen
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("wb") as stream:
            np.savez(stream, about=np.array(json.dumps(about, default=_word)), **arrays)  # type: ignore[arg-type]
            stream.flush()
            os.fsync(stream.fileno())
        draft.replace(path)
    finally:
        draft.unlink(missing_ok=True)


def read_saved(path: Path) -> Saved:
    """Give the run that `write_saved` wrote.

    Raises
    ------
    RecordingError
        Where the file cannot be read, or is not of this kind.
    """
    try:
        with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
            arrays = {name: archive[name] for name in archive.files}
        about = json.loads(str(arrays.pop("about")))
        return _saved(about, arrays)
    except OSError as error:
        raise RecordingError(f"{path}: cannot be read: {error.strerror or error}.") from error
    except (AttributeError, BadZipFile, EOFError, IndexError, KeyError, TypeError, ValueError) as error:
        raise RecordingError(
            f"{path}: this is not a state that this version of faultbond saved. "
            "Name another file, or delete it to begin anew."
        ) from error


def _saved(about: dict[str, Any], arrays: dict[str, FloatArray]) -> Saved:
    """Put a run together; anything that is missing or of another form raises."""
    if about["format"] != FORMAT:
        raise ValueError(about["format"])
    rows = zip(*(arrays[_ROWS + name] for name in ("time", "u", "y")), strict=True)
    first, start, usual, last_index, last_time = about["clock"]
    return Saved(
        model=about["model"],
        model_sha256=about["model_sha256"],
        version=about["version"],
        method=Method(about["method"]),
        numbers={name.removeprefix(_NUMBERS): arrays[name] for name in arrays if name.startswith(_NUMBERS)},
        clock=Clock(
            counts=Counts(**about["counts"]),
            placed=tuple(Row(time=float(time), u=u, y=y) for time, u, y in rows),
            origin=(first, start),
            usual=usual,
            last_index=last_index,
            last_time=last_time,
            frozen=arrays.get(_FROZEN),
        ),
        found=_found(about["found"]),
    )


def _found(found: dict[str, Any]) -> Found:
    return Found(
        detections=found["detections"],
        watched=found["watched"],
        waiting=found["waiting"],
        open=None if found["open"] is None else _detection(found["open"]),
        accepted=tuple(_decision(item) for item in found["accepted"]),
        rejected=tuple(_decision(item) for item in found["rejected"]),
        sure=Sure(**found["sure"]),
    )


def _detection(item: dict[str, Any]) -> Detection:
    return Detection(**(item | {"signals": tuple(item["signals"])}))


def _decision(item: dict[str, Any]) -> Decision:
    return Decision(time=item["time"], candidate=_candidate(item["candidate"]), by=Decider(item["by"]))


def _candidate(item: dict[str, Any]) -> Candidate:
    read = {
        "suspects": tuple(_suspect(suspect) for suspect in item["suspects"]),
        "blocks": tuple(item["blocks"]),
        "kind": FaultKind(item["kind"]),
        "kinds": tuple((FaultKind(kind), share) for kind, share in item["kinds"]),
    }
    return Candidate(**(item | read))


def _suspect(item: dict[str, Any]) -> Suspect:
    return Suspect(**(item | {"forecasts": tuple(Forecast(**forecast) for forecast in item["forecasts"])}))


def _word(value: object) -> object:
    """Give the word of an enumeration."""
    if isinstance(value, Enum):
        return value.value
    raise TypeError(type(value).__name__)
