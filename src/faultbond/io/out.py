"""Where a verb writes: text for people, JSON lines for programs."""

import io
import json
import math
import os
import sys
from collections.abc import Callable, Iterator, Mapping
from contextlib import closing, contextmanager, suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TextIO

from faultbond.errors import plain
from faultbond.io.files import replaced_text
from faultbond.io.record_file import Mark, RecordFile

STANDARD_OUTPUT = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Out:
    """Two streams, either of which may be None: then what is written to it is dropped.

    replaces: file that the records take the place of at the end, if they do. hear: is given each record, too.
    """

    text: TextIO | None
    json: TextIO | RecordFile | None
    replaces: Path | None = None
    hear: Callable[[Mapping[str, object]], None] | None = None

    def say(self, line: str = "") -> None:
        """Write a line for people."""
        if self.text is not None:
            self.text.write(f"{plain(line)}\n")

    def warn(self, line: str) -> None:
        """Write a line for people on standard error."""
        warn(line)

    def lose_text(self, error: OSError) -> None:
        """Go on without text, since standard output cannot be written."""
        warn(f"standard output: {error.strerror or error}.")
        drop_output()

    def record(self, record: Mapping[str, object]) -> None:
        """Write one JSON record and flush it; a number that is not finite becomes null."""
        if self.hear is not None:
            self.hear(record)
        if self.json is None:
            return
        self.json.write(json.dumps(finite(record), ensure_ascii=False, allow_nan=False) + "\n")
        if not isinstance(self.json, RecordFile):
            self.json.flush()

    def go_on(self, before: Mark | None) -> None:
        """Of a run that goes on from another: write records after those of the one before."""
        if isinstance(self.json, RecordFile):
            self.json.go_on(before)

    def append(self) -> None:
        """Of what is begun again and again: write records after those that are in their file."""
        if isinstance(self.json, RecordFile):
            self.json.append()

    def settle(self) -> None:
        """Of a run: its start has not failed, so records may take the place of what was in their file before."""
        if isinstance(self.json, RecordFile):
            self.json.settle()

    def mark(self) -> Mark | None:
        """Put the records on the disk and say up to where their file holds them; None where they are in no file."""
        return self.json.mark() if isinstance(self.json, RecordFile) else None

    @property
    def has_records(self) -> bool:
        """Whether records are taken at all."""
        return self.json is not None or self.hear is not None

    @property
    def is_silent(self) -> bool:
        """Whether nothing is written anywhere, as where a program asks for results."""
        return self.text is None and not self.has_records

    @property
    def is_mixed(self) -> bool:
        """Whether records come on a terminal."""
        return isinstance(self.json, RecordFile) and self.json.is_terminal


@contextmanager
def open_out(target: str | None, *, grows: bool = False) -> Iterator[Out]:
    """Open the streams of a verb; what was in a file before stays there until the verb has something to put there.

    Parameters
    ----------
    target : file for the records, None for no records; `-` is standard output, which then holds nothing else
    grows : whether the file can be read while the verb runs; otherwise it is replaced as a whole at its end

    Raises
    ------
    OSError
        At the end, where the file cannot be written.
    """
    if target is None:
        yield Out(text=sys.stdout, json=None)
    elif target == STANDARD_OUTPUT and _number(sys.stdout) is None:  # nothing but a buffer of the program that calls
        yield Out(text=None, json=sys.stdout)
    elif target == STANDARD_OUTPUT:
        with closing(RecordFile(Path(f"/dev/fd/{_number(sys.stdout)}"), warn, "standard output")) as file:
            yield Out(text=None, json=file)
            if not grows:
                file.complete()
    elif grows:
        with closing(RecordFile(Path(target), warn)) as file:
            yield Out(text=sys.stdout, json=file)
            file.settle()
    else:
        whole = io.StringIO()
        yield Out(text=sys.stdout, json=whole, replaces=Path(target))
        with replaced_text(Path(target)) as stream:
            stream.write(whole.getvalue())


def drop_output() -> None:
    """Let nothing more be written to standard output; else the interpreter complains when it flushes at the end."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 1)


def _number(stream: TextIO) -> int | None:
    """Give the number of the open file behind a stream."""
    try:
        return stream.fileno()
    except (OSError, ValueError):
        return None


def warn(line: str) -> None:
    """Write a line for people on standard error, if there is one."""
    with suppress(OSError, ValueError):
        sys.stderr.write(f"faultbond: {line}\n")


def finite(value: Any) -> Any:
    """Give a record with None in place of nan and infinity, which JSON lacks."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [finite(item) for item in value]
    return value
