"""The file that keeps a run: read before it, written at its end and, of a live one, every minute."""

import time
from contextlib import suppress
from dataclasses import replace
from pathlib import Path

from faultbond.app.course import Course
from faultbond.errors import RecordingError
from faultbond.io.files import locked
from faultbond.io.out import Out
from faultbond.io.record_file import Mark
from faultbond.io.saved import Saved, read_saved, refuse_strange, write_saved
from faultbond.model.graph import BondGraph
from faultbond.types import Method

EVERY = 60.0  # s between two writings of a live run


def read_before(path: Path | None, graph: BondGraph, method: Method | None = None) -> Saved | None:
    """Give the run that a new one, of a method, goes on from; None where there is no file yet.

    Raises
    ------
    RecordingError
        Where the file is of another model or method, is damaged, or cannot be written at the end.
    """
    if path is None:
        return None
    if not path.parent.is_dir():
        raise RecordingError(f"{path}: there is no folder {path.parent}. Create it, or name another file.")
    if not path.exists():
        return None
    if not path.is_file():
        raise RecordingError(f"{path}: this is no file, so no run can be kept in it. Name a file.")
    saved = read_saved(path)
    refuse_other(str(path), saved, graph)
    if method not in (None, saved.method):
        raise RecordingError(
            f"{path}: it was saved by --method {saved.method.value}. Give that method, or name another file."
        )
    return saved


def refuse_other(path: str, saved: Saved, graph: BondGraph) -> None:
    """Refuse a run of another model, or one that cannot be of this plant.

    Raises
    ------
    RecordingError
        Where it is one of them; `path` is what it calls the run.
    """
    if saved.model_sha256 == graph.sha256:
        refuse_strange(path, saved, graph)
        return
    other = f"the model {saved.model!r}" if saved.model != graph.name else "an earlier form of this model"
    raise RecordingError(
        f"{path}: it was saved with {other}; {graph.file} differs from it. "
        "Take the model file that it was saved with, or delete it to begin anew."
    )


class Keeper:
    """Writes a run to its file.

    Parameters
    ----------
    path : the file
    course : the run
    method : its method
    out : where its records are written
    records : up to where a file held the records of the run before
    stamp : see `stamp_of`, before the run before was read
    """

    def __init__(
        self,
        path: Path,
        course: Course,
        method: Method,
        out: Out,
        records: Mark | None = None,
        stamp: tuple[int, int] | None = None,
    ) -> None:
        self._path, self._course, self._method, self._out, self._records = path, course, method, out, records
        self._failing = False
        self._written = time.monotonic()
        self._stamp = stamp
        self._found = course.found

    def write(self, *, last: bool = False) -> None:
        """Write the run as it is now, if it has begun; where that cannot be, say so once, and at the end, and go on.

        What a person has decided in the file until then is heeded, so that it is not lost.
        """
        with locked(self._path):
            self._heed()
            saved = self._course.saved(self._method)
            if saved is not None:
                self._write(saved, last=last)
            self._stamp = stamp_of(self._path)
        self._written, self._found = time.monotonic(), self._course.found

    def _heed(self) -> None:
        mine = self._course.saved(self._method) if self._is_replaced() else None
        if mine is None:
            return
        with suppress(RecordingError):  # the file is of something else by now; it is written anew
            other = read_saved(self._path)
            if (other.model_sha256, other.method) == (mine.model_sha256, mine.method):
                self._course.heed(other.found)

    def _is_replaced(self) -> bool:
        return stamp_of(self._path) not in (None, self._stamp)

    def _write(self, saved: Saved, *, last: bool) -> None:
        """Write the file; the records that it stands behind are on the disk before it is."""
        try:
            self._records = self._out.mark() or self._records
            write_saved(self._path, replace(saved, records=self._records))
        except OSError as error:
            if last or not self._failing:
                other = error.filename not in (None, str(self._path))  # the file of records
                reason = f"{error.filename}: {error.strerror}" if other else error.strerror or str(error)
                more = "" if last else "; it goes on and tries again"
                self._out.warn(f"{self._path}: the run cannot be kept ({reason}){more}.")
            self._failing = True
            return
        if self._failing:
            self._out.warn(f"{self._path}: the run is kept again.")
        self._failing = False

    def look(self) -> None:
        """Of a live run: write the file where a person decided in it, at an alarm, and if that was long ago."""
        known, now = self._found, self._course.found
        due = (known.detections, known.accepted) != (now.detections, now.accepted)
        if due or self._is_replaced() or time.monotonic() - self._written >= EVERY:
            self.write()


def stamp_of(path: Path | None) -> tuple[int, int] | None:
    """Give what changes when a file is replaced; None where there is none that can be read."""
    try:
        about = path.stat() if path is not None else None
    except OSError:
        return None
    return (about.st_mtime_ns, about.st_ino) if about is not None else None
