"""The file of records of a run: it can be read while it grows, and the run that goes on from this one goes on in it.

Each record is written at once, as one line. The file of a kept run (`io.saved`) says up to where its records were on
the disk when it was saved. Lines after that were written before the run was killed; they stay, and when the rows they
are of are given again, they are not written again. Only a line that is cut short is taken out.
"""

import json
import os
from collections.abc import Callable, Iterator
from contextlib import suppress
from dataclasses import dataclass
from errno import ENOSPC
from hashlib import sha256
from pathlib import Path
from typing import IO

from faultbond.io.files import descriptor, is_stream, named, open_stream

MAX_BACKLOG = 10_000_000  # bytes of records that wait for a disk that is full; further ones are dropped
_BLOCK = 2**20
_OF_EVERY_RUN = ("run", "end")  # records that belong to one start of the program


@dataclass(frozen=True, slots=True, kw_only=True)
class Mark:
    """Up to where a file holds the records of a run. path: its name. length: bytes. sha256: of these bytes."""

    path: str
    length: int
    sha256: str


class RecordFile:
    """Writes records, a line each.

    What is in the file before is touched only once the run is `settled`: until then lines are held back, unless there
    is nothing to lose.

    Parameters
    ----------
    path : file, pipe or device
    warn : tells the user a line
    title : what the user calls it, if that is not the path
    """

    def __init__(self, path: Path, warn: Callable[[str], None], title: str = "") -> None:
        self._path, self._warn, self._title = path, warn, title or str(path)
        self._stream: IO[bytes] | None = None
        self._is_file = not is_stream(path)
        self._existed = path.exists()
        self._settled = not self._is_file
        self._held: list[bytes] = []
        self._rest = b""  # what could not be written yet
        self._failing, self._dropped = False, 0
        self._goes_on = self._is_journal = False
        self._before: Mark | None = None
        self._known: set[bytes] = set()  # lines after the mark
        self._length, self._hash = 0, sha256()

    @property
    def is_terminal(self) -> bool:
        """Whether somebody sees what is written."""
        opened = descriptor(self._path)
        return opened is not None and os.isatty(opened)

    def go_on(self, before: Mark | None) -> None:
        """Write after what is there; `before`: up to where the records of the run reach that this one goes on from."""
        self._goes_on, self._before = True, before

    def append(self) -> None:
        """Write after what is there, whatever that is: each record says itself what it is of."""
        self._goes_on = self._is_journal = True

    def write(self, line: str) -> None:
        """Write a line that ends in a line break, unless it is there from before the run was killed."""
        data = line.encode()
        if self._stream is None:
            if not self._settled and self._existed and self._path.stat().st_size:
                self._held.append(data)
                return
            self._open()
        if data in self._known:
            self._known.remove(data)
            return
        self._push(data)

    def settle(self) -> None:
        """From now on the run is under way, and what was held back is written."""
        if self._settled:
            return
        self._settled = True
        held, self._held = self._held, []
        for data in held:
            self.write(data.decode())

    def mark(self) -> Mark | None:
        """Put all on the disk and say how much it is; None of a pipe or device, or where nothing was written.

        Raises
        ------
        OSError
            Where there are records that could not be written.
        """
        if self._stream is None or not self._is_file:
            return None
        self._push(b"")
        try:
            if self._rest:
                raise OSError(None, "records are not written yet")
            os.fsync(self._stream.fileno())
        except OSError as error:
            raise named(error, self._path) from error
        return Mark(path=str(self._path.resolve()), length=self._length, sha256=self._hash.hexdigest())

    def complete(self) -> None:
        """Refuse to leave records unwritten.

        Raises
        ------
        OSError
            Where there are some.
        """
        if self._rest or self._dropped:
            raise OSError(ENOSPC, "records could not be written", self._title)

    def close(self) -> None:
        """Close the file; of a run that did not get under way nothing is left in it."""
        if self._stream is None:
            return
        self._push(b"")
        if self._rest or self._dropped:
            lost = self._rest.count(b"\n") + self._dropped
            self._warn(f"{self._title}: {lost} record{'s' * (lost != 1)} could not be written.")
        self._stream.close()
        if self._settled:
            return
        if self._existed:
            os.truncate(self._path, 0)
        else:
            self._path.unlink(missing_ok=True)

    def _open(self) -> None:
        try:
            if not self._is_file:
                self._stream = open_stream(self._path)
            elif self._goes_on and self._path.exists():
                self._stream = self._path.open("rb+", buffering=0)
                self._find_end(self._stream)
            else:
                if self._goes_on and self._before is not None and self._before.path == str(self._path.resolve()):
                    self._warn(f"{self._title}: the records of the runs before are gone; it begins anew.")
                self._stream = self._path.open("wb", buffering=0)
        except OSError as error:
            raise named(error, self._path) from error

    def _find_end(self, stream: IO[bytes]) -> None:
        """Go to where the next record belongs, and see which are there already."""
        before = self._before
        for block in _blocks(stream, before.length if before is not None else 0):
            self._account(block)
        if before is not None and (self._length, self._hash.hexdigest()) == (before.length, before.sha256):
            lines = stream.read().splitlines(keepends=True)
            torn = lines.pop() if lines and not lines[-1].endswith(b"\n") else b""
            self._known = {line for line in lines if _kind(line) not in _OF_EVERY_RUN}
            self._account(b"".join(lines))
        else:
            torn = self._foreign_end(stream)
        if torn:
            stream.truncate(self._length)
        stream.seek(self._length)

    def _foreign_end(self, stream: IO[bytes]) -> bytes:
        """Go to the end of what another run has written, say so, and give the record there that is cut short."""
        stream.seek(0)
        self._length, self._hash, last = 0, sha256(), b""
        while block := stream.read(_BLOCK):
            lines = (last + block).splitlines(keepends=True)
            last = b"" if lines[-1].endswith(b"\n") else lines.pop()
            self._account(b"".join(lines))
        if (self._length or last) and not self._is_journal:
            self._warn(f"{self._title}: it is not as the kept run left it; records follow on what is there.")
        if not last or (last.startswith(b"{") and _kind(last) is None):
            return last
        stream.seek(self._length + len(last))
        stream.write(b"\n")
        self._account(last + b"\n")
        return b""

    def _account(self, data: bytes) -> None:
        self._hash.update(data)
        self._length += len(data)

    def _push(self, data: bytes) -> None:
        """Write bytes after those that could not be written before; where the disk is full, they wait."""
        if len(self._rest) + len(data) > MAX_BACKLOG:
            self._dropped += 1
        else:
            self._rest += data
        if self._stream is None or not self._rest:
            return
        try:
            while self._rest:
                count = os.write(self._stream.fileno(), self._rest)
                self._account(self._rest[:count])
                self._rest = self._rest[count:]
        except BrokenPipeError:
            self._rest = b""
            raise
        except OSError as error:
            if not self._failing:
                self._warn(f"{self._title}: records cannot be written: {error.strerror or error}.")
            self._failing = True
            return
        if self._failing:
            self._warn(f"{self._title}: records are written again.")
        self._failing = False


def holds_records(path: Path, mark: Mark) -> bool:
    """Whether a file begins with the records up to a mark."""
    if not path.is_file() or path.stat().st_size < mark.length:
        return False
    total = sha256()
    with path.open("rb") as stream:
        for block in _blocks(stream, mark.length):
            total.update(block)
        return stream.tell() == mark.length and total.hexdigest() == mark.sha256


def _blocks(stream: IO[bytes], length: int) -> Iterator[bytes]:
    """Give the first bytes of a file, so many or all that there are, in parts."""
    while length > 0 and (block := stream.read(min(length, _BLOCK))):
        yield block
        length -= len(block)


def _kind(line: bytes) -> object:
    """Give the kind of a record; None of a line that is none."""
    with suppress(ValueError):
        found = json.loads(line)
        return found.get("record", "") if isinstance(found, dict) else ""
    return None
