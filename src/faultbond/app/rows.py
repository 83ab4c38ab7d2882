"""Recordings as the verbs read them."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, nullcontext
from itertools import accumulate, chain, islice
from pathlib import Path

from faultbond.errors import RecordingError
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.grid import GridPoint, Row
from faultbond.io.out import Out
from faultbond.runtime.state import Sample

FIRST = 50  # rows by which the order of a recording is judged

Follow = Callable[[Iterable[Row]], Iterable[Row]]


def no_time(recording: str) -> str:
    """Say that a recording has no time."""
    return (
        f"{recording}: no row has a time that can be read, before the year 9999. "
        "Check the column and unit of `time`: is it in ms or ns?"
    )


def begun(rows: Iterator[Row], recording: str) -> Iterator[Row]:
    """Read the first rows now.

    Raises
    ------
    RecordingError
        Where most of them are earlier than all before: rows that are a little late are sorted in, these could not be.
    """
    first = list(islice(rows, FIRST))
    earliest = accumulate((row.time for row in first), min)
    back = [row for before, row in zip(earliest, first[1:], strict=False) if row.time < before]
    if 2 * len(back) > len(first):
        raise RecordingError(
            f"{recording}: line {back[0].line}: most rows are earlier than all before, so hardly any are of use. "
            "Sort them by time, or check the column of `time`."
        )
    return chain(first, rows)


def sample_of(point: GridPoint) -> Sample:
    """Give a grid point as the monitor takes it."""
    return Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)


def progress(recording: str, out: Out) -> AbstractContextManager[Follow]:
    """Give a progress bar for a file where somebody sees it."""
    if recording == STANDARD_INPUT or out.is_mixed or not sys.stderr.isatty():
        return nullcontext(iter)
    from faultbond.report.progress import progress_bar  # noqa: PLC0415 - loads rich

    return progress_bar(_count_lines(Path(recording)))


def _count_lines(path: Path) -> int | None:
    """Give the number of rows of a CSV file, about; None of another, and of a pipe, which can be read but once."""
    if not path.is_file() or path.suffix.lower() in (".parquet", ".pq"):
        return None
    with path.open("rb") as stream:
        return sum(block.count(b"\n") for block in iter(lambda: stream.read(2**20), b"")) - 1
