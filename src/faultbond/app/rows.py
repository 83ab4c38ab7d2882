"""Recordings as the verbs read them."""

import sys
from collections.abc import Callable, Iterable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext
from itertools import accumulate, chain
from pathlib import Path
from time import monotonic

from faultbond.contract.samples import Sample
from faultbond.errors import RecordingError, RowError
from faultbond.io.files import STANDARD_INPUT
from faultbond.io.grid import Grid, GridPoint, RowBlock
from faultbond.io.grid_points import MAX_BLOCK
from faultbond.io.memory_table import MemoryTable, Recording
from faultbond.io.out import Out
from faultbond.io.text_cells import TextCells

FEW = 10  # rows of whose pace nothing is said
OFTEN = 20  # of so many rows one may have the time of another
FIRST = 50  # rows by which the order of a recording is judged

QUICK, SLOW = 0.05, 0.1  # s; rows that take less are passed on in larger portions, those that take more in smaller
PORTION = 256  # rows, to begin with

Follow = Callable[[Iterable[RowBlock]], Iterable[RowBlock]]


def called(recording: Recording) -> str:
    """Give what messages call a recording."""
    return "standard input" if str(recording) == STANDARD_INPUT else str(recording)


@contextmanager
def naming(recording: Recording) -> Iterator[None]:
    """Let what is wrong with a row tell of which recording it is.

    Raises
    ------
    RecordingError
        Instead of a `RowError`.
    """
    try:
        yield
    except RowError as error:
        word = "row" if isinstance(recording, MemoryTable) else "line"
        where = f"{word} {error.line}: " if error.line else ""
        raise RecordingError(f"{called(recording)}: {where}{error.problem}") from error


def no_time(recording: Recording, texts: TextCells | None = None) -> str:
    """Say that a recording has no time, and what stands in its place."""
    told = texts.first("time") if texts is not None else ""
    return (
        f"{called(recording)}: no row has a time that can be read, before the year 9999{told}. "
        "Check the column and unit of `time`: seconds, or dates as 2026-05-31 10:00:00 or 31.5.2026 10:00:00, are "
        "read; ms and ns need `unit`."
    )


def texts_of(recording: Recording) -> TextCells:
    """Give what collects the cells of a recording that hold text where numbers belong."""
    return TextCells("row" if isinstance(recording, MemoryTable) else "line", _say)


def _say(what: str) -> None:
    sys.stderr.write(f"faultbond: {what}\n")


def pace_of(grid: Grid, step: float | None) -> tuple[str, ...]:
    """Say that most rows stand closer or farther apart than samples do, s, or that many have one time; else nothing."""
    counts, n = grid.counts, grid.n_rows
    if not step or n < FEW:
        return ()
    if OFTEN * counts.duplicate > n and not grid.repeats_times:
        what = f"{counts.duplicate} of {n} rows have the time of another row: of these the first counts"
        return (f"{what}; if that is not meant, check `time`, and put what belongs to one time into one row",)
    if 2 * counts.unused > n:
        what = f"{counts.unused} of {n} rows were not used: they are closer than sample_time, {step:g} s"
    elif 2 * n < counts.samples and not counts.clock_jumps and not grid.n_again and not grid.n_dropped:
        what = f"there are {n} rows for {counts.samples} samples: they are farther apart than sample_time, {step:g} s"
    else:
        return ()
    return (f"{what}; if that is not meant, check it and the unit of `time`",)


def begun(blocks: Iterator[RowBlock], recording: Recording) -> Iterator[RowBlock]:
    """Read the first rows now.

    Raises
    ------
    RecordingError
        Where most of them are earlier than all before: rows that are a little late are sorted in, these could not be.
    """
    first: list[RowBlock] = []
    while sum(map(len, first)) < FIRST and (block := next(blocks, None)) is not None:
        first.append(block)
    times = [float(time) for block in first for time in block.time][:FIRST]
    lines = [int(line) for block in first for line in block.line][:FIRST]
    earliest = accumulate(times, min)
    back = [line for before, time, line in zip(earliest, times[1:], lines[1:], strict=False) if time < before]
    if 2 * len(back) > len(times):
        where = f"{recording}: {'row' if isinstance(recording, MemoryTable) else 'line'} {back[0]}"
        raise RecordingError(
            f"{where}: most rows are earlier than all before, so hardly any are of use. "
            "Sort them by time, or check the column of `time`."
        )
    return chain(first, blocks)


def portions(blocks: Iterable[RowBlock]) -> Iterator[RowBlock]:
    """Give rows in portions that take a moment to be worked on, so that who asks to stop need not wait."""
    size = PORTION
    for block in blocks:
        first = 0
        while first < len(block):
            last, began = min(first + size, len(block)), monotonic()
            yield block.part(slice(first, last))
            first, took = last, monotonic() - began
            if took < QUICK:
                size = min(2 * size, MAX_BLOCK)
            elif took > SLOW:
                size = max(size // 2, 1)


def sample_of(point: GridPoint) -> Sample:
    """Give a grid point as the monitor takes it."""
    return Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)


def progress(recording: Recording, out: Out) -> AbstractContextManager[Follow]:
    """Give a progress bar for a file where somebody sees it."""
    unseen = isinstance(recording, MemoryTable) or out.is_silent or out.is_mixed or not sys.stderr.isatty()
    if unseen or str(recording) == STANDARD_INPUT:
        return nullcontext(iter)
    from faultbond.report.progress import progress_bar  # noqa: PLC0415 - loads rich

    return progress_bar(_count_lines(Path(str(recording))))


def _count_lines(path: Path) -> int | None:
    """Give the number of rows of a CSV file, about; None of another, and of a pipe, which can be read but once."""
    if not path.is_file() or path.suffix.lower() in (".parquet", ".pq"):
        return None
    with path.open("rb") as stream:
        return sum(block.count(b"\n") for block in iter(lambda: stream.read(2**20), b"")) - 1
