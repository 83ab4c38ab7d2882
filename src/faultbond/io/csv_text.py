"""CSV text as it comes: of a file, of standard input at its own pace, or piece by piece; its lines and records.

Source: docs/commands.md.
"""

import csv
import io
import sys
from codecs import getincrementaldecoder
from collections import deque
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import BinaryIO, TextIO

from faultbond.errors import NoRowError, RecordingError
from faultbond.io.files import STANDARD_INPUT

MAX_LINE = 200_000  # characters
READ_AHEAD = 2**17  # characters
NO_TEXT = "this is not text in UTF-8. Recordings are CSV or Parquet files; export a spreadsheet as CSV."
MAX_RECORD_LINES = 100  # a quoted text may hold line breaks


class Pieces:
    """Text that is put here piece by piece."""

    def __init__(self) -> None:
        self.text = ""

    def read(self, most: int) -> str:
        """Give all that is there."""
        text, self.text = self.text, ""
        return text


@contextmanager
def reading(title: str) -> Iterator[None]:
    """Turn what can go wrong with a file into one message.

    Raises
    ------
    RecordingError
        Where the file cannot be read.
    """
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{title}: cannot be read: {error.strerror or error}.") from error


@contextmanager
def opened_text(source: str | Path) -> Iterator["TextIO | Arriving"]:
    """Open a text file, or standard input without closing it at the end.

    Raises
    ------
    RecordingError
        Where standard input is closed.
    """
    if str(source) != STANDARD_INPUT:
        with Path(source).open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            yield stream
        return
    if sys.stdin is None:  # the program was started without one
        raise RecordingError("standard input: cannot be read: it is closed. Give it rows, or name a file.")
    yield Arriving(sys.stdin.buffer)


class Arriving:
    """Text that arrives at its own pace: whole lines as soon as they are there."""

    def __init__(self, stream: BinaryIO) -> None:
        self._stream = stream
        self._decoder = getincrementaldecoder("utf-8-sig")("replace")
        self._text = ""

    def read(self, most: int) -> str:
        """Give all whole lines that are there, one at least; at the end what is left, then nothing."""
        while (end := self._text.rfind("\n") + 1) == 0 and len(self._text) < most and self._more():
            pass
        end = end or len(self._text)
        text, self._text = self._text[:end], self._text[end:]
        return text

    def _more(self) -> bool:
        """Wait for more; tell whether any came."""
        found = self._stream.read1(READ_AHEAD) if hasattr(self._stream, "read1") else self._stream.readline()
        self._text += self._decoder.decode(found, final=not found)
        return bool(found)


class Lines:
    """The lines of a stream as they come, none of them beyond all measure.

    number : how many were given
    """

    def __init__(self, stream: TextIO | Arriving | Pieces, title: str) -> None:
        self._stream, self._title = stream, title
        self.number = 0
        self._ahead: deque[str] = deque()
        self._begun = ""  # a line that is not whole yet

    def __iter__(self) -> "Lines":
        return self

    def __next__(self) -> str:
        if not self.ahead():
            raise StopIteration
        line = self._ahead.popleft()
        self.number += 1
        where = f"{self._title}:{self.number}"
        if len(line) >= MAX_LINE:
            raise RecordingError(f"{where}: a line of more than {MAX_LINE:,} characters is no row of a recording.")
        if "\0" in line:
            raise NoRowError(f"{where}: {NO_TEXT}")
        return line

    def put_back(self, lines: Sequence[str]) -> None:
        """Take back the lines that were given last."""
        self._ahead.extendleft(reversed(lines))
        self.number -= len(lines)

    def ahead(self) -> Sequence[str]:
        """Give the lines that are read, but not given yet; if there are none, read some. Nothing is checked."""
        while not self._ahead and (text := self._stream.read(READ_AHEAD)):
            self._ahead.extend(io.StringIO(self._begun + text, newline=""))
            has_end = self._ahead[-1].endswith("\n") or len(self._ahead[-1]) >= MAX_LINE
            self._begun = "" if has_end else self._ahead.pop()
        if not self._ahead and self._begun:
            self._ahead.append(self._begun)
            self._begun = ""
        return self._ahead

    def skip(self) -> None:
        """Count the lines that are read as given."""
        self.number += len(self._ahead)
        self._ahead.clear()

    @property
    def is_at_end(self) -> bool:
        """Whether all lines that are read were given."""
        return not self._ahead


def delimiter_of(lines: Lines, title: str) -> str:
    """Give what separates the fields, by the first line that is not empty.

    Raises
    ------
    RecordingError
        Where this is not text in UTF-8.
    """
    head: list[str] = []
    for line in lines:
        head.append(line)
        if line.strip("\r\n"):
            break
    first = head[-1] if head else ""
    if first.count("\ufffd") > len(first) // 10:
        raise RecordingError(f"{title}:{len(head)}: {NO_TEXT}")
    lines.put_back(head)
    return max(",;\t", key=first.count)


def records_in(lines: Lines, delimiter: str, title: str) -> Iterator[tuple[int, Sequence[str]]]:
    """Give (line, fields) of each record; empty lines are passed over.

    Raises
    ------
    RecordingError
        Where a quotation is never closed, or a line is no row of a CSV file.
    """
    reader = csv.reader(lines, delimiter=delimiter)
    try:
        before = lines.number
        for fields in reader:
            if lines.number - before > MAX_RECORD_LINES:
                raise RecordingError(f"{title}:{before + 1}: a quotation mark is opened here and never closed.")
            before = lines.number
            if fields:
                yield before, fields
    except csv.Error as error:
        raise RecordingError(f"{title}:{lines.number}: this is not a row of a CSV file ({error}).") from error
