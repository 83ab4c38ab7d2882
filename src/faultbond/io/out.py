"""Where a verb writes: text for people, JSON lines for programs."""

import json
import math
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import TextIO

STANDARD_OUTPUT = "-"


@dataclass(frozen=True, slots=True, kw_only=True)
class Out:
    """Two streams, either of which may be None: then what is written to it is dropped."""

    text: TextIO | None
    json: TextIO | None

    def say(self, line: str = "") -> None:
        """Write a line for people."""
        if self.text is not None:
            self.text.write(f"{line}\n")

    def record(self, record: Mapping[str, object]) -> None:
        """Write one JSON record and flush it; a number that is not finite becomes null."""
        if self.json is not None:
            self.json.write(json.dumps(_finite(record), ensure_ascii=False, allow_nan=False) + "\n")
            self.json.flush()


@contextmanager
def open_out(target: str | None) -> Iterator[Out]:
    """Open the streams of a verb.

    Parameters
    ----------
    target : file for the records, None for no records; `-` is standard output, which then holds nothing else
    """
    if target is None:
        yield Out(text=sys.stdout, json=None)
    elif target == STANDARD_OUTPUT:
        yield Out(text=None, json=sys.stdout)
    else:
        with Path(target).open("w", encoding="utf-8", newline="\n") as stream:
            yield Out(text=sys.stdout, json=stream)


def _finite(value: object) -> object:
    """Replace nan and infinity, which JSON lacks, by None."""
    if isinstance(value, float):
        return value if math.isfinite(value) else None
    if isinstance(value, Mapping):
        return {key: _finite(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_finite(item) for item in value]
    return value
