"""Recordings: rows of CSV or Parquet, of standard input, or of a table in memory, in SI units.

Only the columns that the model names are read. A value that is empty, unreadable, not finite or at an end of its range
is nan in its row; a file that is no recording is one `RecordingError`. Source: docs/commands.md.
"""

import csv
import difflib
import io
import math
import sys
from codecs import getincrementaldecoder
from collections import deque
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from types import ModuleType
from typing import Any, BinaryIO, TextIO

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import RecordingError
from faultbond.io.files import STANDARD_INPUT, replaced_text
from faultbond.io.memory_table import MemoryTable, Recording
from faultbond.io.row_block import Row, RowBlock, block_of_rows
from faultbond.io.times import WITH_COMMA, finite_number, moment_of
from faultbond.model.graph import BondGraph, Input, Sensor, TimeColumn, Unit

MAX_LINE = 200_000  # characters
MAX_PLAIN = 100_000  # the same of a line that is not looked at more closely
STRANGE = '"\0_'  # what a line with plain numbers has not: quotations, what is no text, and digits grouped as in Python
READ_AHEAD = 2**17  # characters
MAX_RECORD_LINES = 100  # a quoted text may hold line breaks
SHOWN_COLUMNS = 20
FORMULA = (*"=+-@", "\t", "\r")  # what a cell begins with that a spreadsheet runs
ROUNDING = 1e-9  # of an end of a range: a value so close to it is at the end


@dataclass(frozen=True, slots=True, kw_only=True)
class Column:
    """A column that the model needs: its header, its unit, and what it is, for messages (`sensor flow`).

    lower, upper: ends of its range in SI; a value there or beyond is saturated, of an input only one beyond.
    """

    header: str
    unit: Unit
    role: str
    lower: float = -math.inf
    upper: float = math.inf


@dataclass(frozen=True, slots=True, kw_only=True)
class Columns:
    """All that a model needs of a recording.

    sample_time: gives rows their time where there is no time column; None, as of a static network, is taken as 1 s.
    first_time: of the first row, where there is no time column.
    """

    time: TimeColumn
    inputs: tuple[Column, ...]
    outputs: tuple[Column, ...]
    sample_time: float | None
    first_time: float = 0.0

    def needed(self, header: Sequence[str]) -> tuple[Column, ...]:
        """Give every column to look for: time, where there is one, then inputs, then outputs."""
        column = self.time.column
        if column is None or (self.time.optional and column not in header):
            return (*self.inputs, *self.outputs)
        return (Column(header=column, unit=self.time.unit, role="time"), *self.inputs, *self.outputs)


def columns_of(graph: BondGraph, *, sensors: bool = True) -> Columns:
    """Give the columns that a model needs; without `sensors` only those that drive a simulation."""

    def column(item: Input | Sensor, what: str) -> Column:
        role = f"{what} {item.name}"
        return Column(header=item.column, unit=item.unit, role=role, lower=item.lower, upper=item.upper)

    return Columns(
        time=graph.time,
        inputs=tuple(column(item, "input") for item in graph.inputs),
        outputs=tuple(column(item, "sensor") for item in graph.sensors if sensors),
        sample_time=graph.sample_time,
    )


def read_rows(source: Recording, columns: Columns) -> Iterator[Row]:
    """Give the rows of a recording in SI as they stand, one by one.

    Parameters
    ----------
    source : path of a CSV or Parquet file; `-` is CSV on standard input; or a table
    columns : what to read and in which units

    Raises
    ------
    RecordingError
        When the file cannot be read, is no table, lacks a column, or has numbers with decimal commas.
    """
    if isinstance(source, MemoryTable):
        return (block.row(k) for block in _table_blocks(source, columns) for k in range(len(block)))
    if str(source) == STANDARD_INPUT:
        return _rows(_csv_records(source, "standard input"), columns, "standard input")
    parquet = _is_parquet(Path(source))
    records = _parquet_records(Path(source), columns) if parquet else _csv_records(source, str(source))
    return _rows(records, columns, str(source))


def read_blocks(source: Recording, columns: Columns) -> Iterator[RowBlock]:
    """Give the same rows in blocks: of a CSV file some thousand at once, of standard input what is there.

    Of a table all, of all else, which may be slow, single ones.

    Rows before an error come before it. Parameters and errors are those of `read_rows`.
    """
    if isinstance(source, MemoryTable):
        return _table_blocks(source, columns)
    path = Path(source)
    if str(source) == STANDARD_INPUT:
        return _csv_blocks(source, columns, "standard input")
    if not path.is_file() or _is_parquet(path):
        return (block_of_rows([row]) for row in read_rows(source, columns))
    return _csv_blocks(path, columns, str(path))


def write_recording(path: str | Path, columns: Mapping[str, FloatArray]) -> None:
    """Write columns of equal length as CSV, the header first; nan becomes an empty field.

    Parameters
    ----------
    path : file to write, replaced if it exists
    columns : values by header, each of shape (n_rows,), in the units in which they are to be read

    Raises
    ------
    RecordingError
        Where the path is that of a Parquet file, or a spreadsheet would run a header.
    """
    if Path(path).suffix.lower() in (".parquet", ".pq"):
        raise RecordingError(f"{path}: only CSV is written. Choose a name that ends in .csv.")
    for name in columns:
        if name.startswith(FORMULA):
            raise RecordingError(
                f"{path}: a spreadsheet would run the column {name!r} as a formula. Name it otherwise, with `column` "
                "in the model file."
            )
    with replaced_text(Path(path)) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for values in zip(*columns.values(), strict=True):
            writer.writerow([f"{value:.15g}" if math.isfinite(value) else "" for value in values])


def row_reader(columns: Columns, header: Sequence[str], title: str) -> Callable[[int, Sequence[object]], Row]:
    """Give the function that makes a row of its number, from 1, and its values in the order of a header.

    Raises
    ------
    RecordingError
        Where the header lacks a column.
    """
    layout = _Layout(columns, header, title)
    return lambda count, values: layout.row(count, count, values)


class _Layout:
    """Where the columns of a model stand in a recording, and how its records become rows.

    Parameters
    ----------
    columns : what to read
    header : the first record of the recording
    title : its name, for messages

    Raises
    ------
    RecordingError
        Where a column is not there, or is there twice.
    """

    def __init__(self, columns: Columns, header: Sequence[object], title: str) -> None:
        self.header = [str(name).strip() for name in header]
        if not any(self.header):
            raise RecordingError(f"{title}: it is empty. The first row must name the columns.")
        needed = columns.needed(self.header)
        for column in needed:
            if self.header.count(column.header) != 1:
                raise RecordingError(_no_column(column, self.header, title))
        self._columns, self._title = columns, title
        self._clock = self.header.index(needed[0].header) if needed and needed[0].role == "time" else None
        inputs, outputs = columns.inputs, columns.outputs
        self._inputs, self._outputs = ([self.header.index(item.header) for item in of] for of in (inputs, outputs))
        self._lowest, self._highest = ends(outputs, inwards=True)
        self._least, self._most = ends(inputs, inwards=False)

    def row(self, count: int, line: int, values: Sequence[object]) -> Row:
        """Give the row of a record; `count` is its number, from 1.

        Raises
        ------
        RecordingError
            Where it has too many fields, or decimal commas.
        """
        columns, clock, header, where = self._columns, self._clock, self.header, f"{self._title}:{line}"
        if any(str(value).strip() for value in values[len(header) :]):  # no field is then sure to be its column's
            raise RecordingError(
                f"{where}: this row has {len(values)} fields, the header {len(header)}. Decimal commas? "
                "Write numbers with a point; a text that holds a separator needs quotation marks."
            )
        if clock is None:
            moment = columns.first_time + (count - 1) * (columns.sample_time or 1.0)
        else:
            moment = moment_of(_field(values, clock), columns.time.unit)
        u, y = _numbers(values, self._inputs, columns.inputs), _numbers(values, self._outputs, columns.outputs)
        if math.isnan(moment) or np.isnan(u).any() or np.isnan(y).any():
            for k in (*(() if clock is None else (clock,)), *self._inputs, *self._outputs):
                text = _field(values, k)
                if isinstance(text, str) and WITH_COMMA.fullmatch(text):  # it would pass for a missing value
                    found = f"{header[k]!r} is {text.strip()!r}"
                    raise RecordingError(f"{where}: {found}. Decimal commas? Write numbers with a point.")
        saturated, beyond = (y <= self._lowest) | (y >= self._highest), (u < self._least) | (u > self._most)
        y[saturated], u[beyond] = math.nan, math.nan
        return Row(time=moment, u=u, y=y, saturated=int(saturated.sum() + beyond.sum()), line=line)

    def block(self, count: int, line: int, lines: Sequence[str], delimiter: str) -> RowBlock | None:
        """Give the rows of lines, each a record with as many fields as the header, as `row` does for each of them.

        None where there may be decimal commas. `count`, `line`: numbers of the first.
        """
        columns, n = self._columns, len(lines)
        places = [*(() if self._clock is None else (self._clock,)), *self._inputs, *self._outputs]
        units = [*(() if self._clock is None else (columns.time.unit,)), *(item.unit for item in columns.inputs)]
        units += [item.unit for item in columns.outputs]
        numbers = _plain_numbers(lines, delimiter, places)
        fields = None
        if numbers is None:  # not all of them are numbers
            fields = [*zip(*csv.reader(lines, delimiter=delimiter), strict=True)]
            numbers = np.array([[finite_number(text) for text in fields[place]] for place in places]).T
        numbers[~np.isfinite(numbers)] = math.nan
        numbers = np.array([unit.factor for unit in units]) * numbers + np.array([unit.offset for unit in units])
        if self._clock is None:
            numbered = np.arange(count - 1, count - 1 + n, dtype=np.float64)
            time = columns.first_time + numbered * (columns.sample_time or 1.0)
            values = numbers
        else:
            time, values = numbers[:, 0].copy(), numbers[:, 1:]
            if fields is not None:
                for k in np.flatnonzero(np.isnan(time)):
                    time[k] = moment_of(fields[self._clock][k], columns.time.unit)
        if fields is not None:
            strange = np.flatnonzero(np.isnan(time) | np.isnan(values).any(axis=1))
            if any("," in fields[place][k] for k in strange for place in places):
                return None
        return self._judged(time, values, line)

    def table(self, table: MemoryTable) -> RowBlock:
        """Give the rows of a table, as `row` does for each of them.

        Raises
        ------
        RecordingError
            Where a column holds neither numbers nor text, or its text is no number, or has decimal commas.
        """
        columns = self._columns
        every = [table.numbers(item.header, item.role, item.unit) for item in (*columns.inputs, *columns.outputs)]
        clock = columns.needed(self.header)[:1] if self._clock is not None else ()
        moments = [table.moments(item.header, item.role, item.unit) for item in clock]
        n = next((len(values) for values in (*moments, *every)), 0)
        for item, values in zip((*clock, *columns.inputs, *columns.outputs), (*moments, *every), strict=True):
            if len(values) != n:
                counts = f"column {item.header!r} has {len(values)} values, others {n}"
                raise RecordingError(f"{self._title}: {counts}. Give one value for each row.")
        if not n:
            raise RecordingError(_no_row(self._title))
        rows = columns.first_time + np.arange(n, dtype=np.float64) * (columns.sample_time or 1.0)
        return self._judged(
            moments[0] if moments else np.asarray(rows, dtype=np.float64), np.array(every).reshape(len(every), n).T, 1
        )

    def _judged(self, time: FloatArray, values: FloatArray, line: int) -> RowBlock:
        """Give rows without the values that are at an end of their range; values (n_rows, n_inputs + n_outputs), SI."""
        u, y = values[:, : len(self._inputs)].copy(), values[:, len(self._inputs) :].copy()
        saturated, beyond = (y <= self._lowest) | (y >= self._highest), (u < self._least) | (u > self._most)
        y[saturated], u[beyond] = math.nan, math.nan
        n_saturated = np.asarray(saturated.sum(axis=1) + beyond.sum(axis=1))
        return RowBlock(time=time, u=u, y=y, saturated=n_saturated, line=np.arange(line, line + len(time)))


def _plain_numbers(lines: Sequence[str], delimiter: str, places: Sequence[int]) -> FloatArray | None:
    """Give the fields at some places of all lines, shape (n_lines, n_places); None if one of them is no number."""
    wanted, back = np.unique(places, return_inverse=True)
    try:
        found = np.loadtxt(lines, delimiter=delimiter, comments=None, usecols=tuple(wanted.tolist()), ndmin=2)
    except ValueError:
        return None
    return found[:, back] if len(found) == len(lines) else None


def _rows(records: Iterator[tuple[int, Sequence[object]]], columns: Columns, title: str) -> Iterator[Row]:
    """Turn records into rows; the first record is the header."""
    layout = _Layout(columns, next(records, (0, ()))[1], title)
    count = 0
    for count, (line, values) in enumerate(records, start=1):
        yield layout.row(count, line, values)
    if count == 0:
        raise RecordingError(_no_row(title))


def _no_row(title: str) -> str:
    return f"{title}: there is no row below the header."


def _table_blocks(table: MemoryTable, columns: Columns) -> Iterator[RowBlock]:
    """Turn a table in memory into rows, all at once."""
    yield _Layout(columns, table.names, str(table)).table(table)


def _csv_blocks(source: str | Path, columns: Columns, title: str) -> Iterator[RowBlock]:
    """Turn CSV text into rows, many lines at a time where each of them is a plain record."""
    count = 0
    with _reading(title), _text(source) as stream:
        lines = _Lines(stream, title)
        delimiter = _delimiter(lines, title)
        layout = _Layout(columns, next(_records(lines, delimiter, title), (0, ()))[1], title)
        while ahead := lines.ahead():
            plain = _are_plain(ahead, delimiter, len(layout.header))
            block = layout.block(count + 1, lines.number + 1, ahead, delimiter) if plain else None
            if block is not None:
                lines.skip()
                count += len(block)
                yield block
                continue
            rows: list[Row] = []
            try:
                for line, values in _records(lines, delimiter, title):
                    rows.append(layout.row(count + len(rows) + 1, line, values))
                    if lines.is_at_end:
                        break
            except (RecordingError, OSError):
                if rows:
                    yield block_of_rows(rows)
                raise
            if rows:
                count += len(rows)
                yield block_of_rows(rows)
        if count == 0:
            raise RecordingError(_no_row(title))


def _are_plain(lines: Sequence[str], delimiter: str, n_fields: int) -> bool:
    """Whether each line is a record with so many fields, for sure."""
    text = "".join(lines)
    if any(letter in text for letter in STRANGE) or max(map(len, lines)) >= MAX_PLAIN:
        return False
    return {line.count(delimiter) for line in lines} == {n_fields - 1} and (n_fields > 1 or all(map(str.strip, lines)))


def _numbers(values: Sequence[object], places: Sequence[int], columns: tuple[Column, ...]) -> FloatArray:
    """Give the SI values at some places of a record."""
    pairs = zip(places, columns, strict=True)
    return np.array(
        [column.unit.to_si(finite_number(_field(values, place))) for place, column in pairs], dtype=np.float64
    )


def _field(values: Sequence[object], place: int) -> object:
    """Give one field of a record; a short record has empty fields at its end."""
    return values[place] if place < len(values) else None


def ends(columns: tuple[Column, ...], *, inwards: bool) -> tuple[FloatArray, FloatArray]:
    """Give the ends of the ranges in SI, each of shape (n_columns,), moved inwards or outwards by what units round."""
    lower = np.array([column.lower for column in columns], dtype=np.float64)
    upper = np.array([column.upper for column in columns], dtype=np.float64)
    sizes = np.where(np.isfinite(lower), np.abs(lower), 0.0), np.where(np.isfinite(upper), np.abs(upper), 0.0)
    width = (ROUNDING if inwards else -ROUNDING) * np.maximum(*sizes)
    return lower + width, upper - width


def _no_column(column: Column, header: list[str], title: str) -> str:
    """Say that a column is not there, or is there twice, and what is there."""
    if column.header in header:
        return f"{title}: column {column.header!r} ({column.role}) appears {header.count(column.header)} times."
    if all(not math.isnan(finite_number(name)) for name in header):
        return f"{title}: the first row holds numbers; it must name the columns, among them {column.header!r}."
    found = ", ".join(name[:40] for name in header[:SHOWN_COLUMNS])
    more = f" and {len(header) - SHOWN_COLUMNS} more" if len(header) > SHOWN_COLUMNS else ""
    by_lower = {name[:100].lower(): name[:100] for name in header[:1000]}
    close = difflib.get_close_matches(column.header.lower(), by_lower, n=1)
    advice = f"Did you mean '{by_lower[close[0]]}'?" if close else "Name it in the model file with `column`."
    return f"{title}: no column {column.header!r} ({column.role}); found: {found}{more}. {advice}"


@contextmanager
def _reading(title: str) -> Iterator[None]:
    """Turn what can go wrong with a file into one message."""
    try:
        yield
    except OSError as error:
        raise RecordingError(f"{title}: cannot be read: {error.strerror or error}.") from error


@contextmanager
def _text(source: str | Path) -> Iterator["TextIO | _Arriving"]:
    """Open a text file, or standard input without closing it at the end."""
    if str(source) != STANDARD_INPUT:
        with Path(source).open(encoding="utf-8-sig", errors="replace", newline="") as stream:
            yield stream
        return
    if sys.stdin is None:  # the program was started without one
        raise RecordingError("standard input: cannot be read: it is closed. Give it rows, or name a file.")
    yield _Arriving(sys.stdin.buffer)


class _Arriving:
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


class _Lines:
    """The lines of a stream as they come, none of them beyond all measure.

    number : how many were given
    """

    def __init__(self, stream: TextIO | _Arriving, title: str) -> None:
        self._stream, self._title = stream, title
        self.number = 0
        self._ahead: deque[str] = deque()
        self._begun = ""  # a line that is not whole yet

    def __iter__(self) -> "_Lines":
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
            raise RecordingError(f"{where}: this is not text. Recordings are CSV or Parquet files.")
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


def _delimiter(lines: _Lines, title: str) -> str:
    """Give what separates the fields, by the first line that is not empty."""
    head: list[str] = []
    for line in lines:
        head.append(line)
        if line.strip("\r\n"):
            break
    first = head[-1] if head else ""
    if first.count("\ufffd") > len(first) // 10:
        raise RecordingError(f"{title}:{len(head)}: this is not text. Recordings are CSV or Parquet files.")
    lines.put_back(head)
    return max(",;\t", key=first.count)


def _records(lines: _Lines, delimiter: str, title: str) -> Iterator[tuple[int, Sequence[str]]]:
    """Give (line, fields) of each record; empty lines are passed over."""
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


def _csv_records(source: str | Path, title: str) -> Iterator[tuple[int, Sequence[object]]]:
    """Give (line, fields) of a CSV text, header first."""
    with _reading(title), _text(source) as stream:
        lines = _Lines(stream, title)
        yield from _records(lines, _delimiter(lines, title), title)


def _is_parquet(path: Path) -> bool:
    """Whether a file says that it is Parquet, by its name or its first bytes."""
    if path.suffix.lower() in (".parquet", ".pq"):
        return True
    if not path.is_file():  # what is read of a pipe is gone
        return False
    with _reading(str(path)), path.open("rb") as stream:
        return stream.read(4) == b"PAR1"


def _parquet_records(path: Path, columns: Columns) -> Iterator[tuple[int, Sequence[object]]]:
    """Give (row, fields) of a Parquet file, header first; only needed columns are loaded."""
    try:
        import pyarrow  # noqa: PLC0415 - optional
        import pyarrow.parquet  # noqa: PLC0415 - optional
    except ImportError as error:
        raise RecordingError(
            f"{path}: reading Parquet needs pyarrow. Install it with: pip install 'faultbond[parquet]'"
        ) from error
    with _reading(str(path)):
        try:
            file = pyarrow.parquet.ParquetFile(path)
            found = file.schema_arrow.names
            yield 0, found
            wanted = [column.header for column in columns.needed(found)]
            number = 0
            for batch in file.iter_batches(columns=wanted):
                by_name = {name: _python_values(batch.column(name), pyarrow) for name in wanted}
                nothing = [None] * batch.num_rows
                for fields in zip(*(by_name.get(name, nothing) for name in found), strict=True):
                    number += 1
                    yield number, fields
        except (pyarrow.ArrowException, OverflowError, ValueError) as error:  # the latter of values beyond Python's
            reason = str(error).partition("\n")[0]
            raise RecordingError(f"{path}: this is not a Parquet file that can be read ({reason}).") from error


def _python_values(column: Any, pyarrow: ModuleType) -> list[object]:
    """Give a Parquet column as Python objects; times are cut to microseconds, which `datetime` can hold."""
    if pyarrow.types.is_timestamp(column.type):
        column = column.cast(pyarrow.timestamp("us", tz=column.type.tz), safe=False)
    return list(column.to_pylist())
