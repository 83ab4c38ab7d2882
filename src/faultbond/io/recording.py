"""Recordings: rows of CSV or Parquet, of standard input, or of a table in memory, in SI units.

Only the columns that the model names are read. A value that is empty, unreadable, not finite or at an end of its range
is nan in its row; a file that is no recording is one `RecordingError`. Source: docs/commands.md.
"""

import csv
import difflib
import math
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.errors import NoRowError, RecordingError
from faultbond.io.csv_text import MAX_LINE, Lines, Pieces, delimiter_of, opened_text, reading, records_in
from faultbond.io.files import STANDARD_INPUT, replaced_text
from faultbond.io.memory_table import MemoryTable, Recording
from faultbond.io.parquet import is_parquet, parquet_records
from faultbond.io.row_block import Row, RowBlock, block_of_rows
from faultbond.io.text_cells import TextCells
from faultbond.io.times import WITH_COMMA, finite_number, moment_of
from faultbond.model.graph import BondGraph, Input, Sensor, TimeColumn, Unit

MAX_PLAIN = 100_000  # the same of a line that is not looked at more closely
STRANGE = '"\0_'  # what a line with plain numbers has not: quotations, what is no text, and digits grouped as in Python
AROUND_COMMAS = (";", "\t")  # separators beside which a comma is the decimal mark of a number
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

    def headers(self, header: Sequence[str]) -> list[str]:
        """Give what stands above them in a recording with such a header."""
        return [column.header for column in self.needed(header)]


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


def read_rows(source: Recording, columns: Columns, texts: TextCells | None = None) -> Iterator[Row]:
    """Give the rows of a recording in SI as they stand, one by one.

    Parameters
    ----------
    source : path of a CSV or Parquet file; `-` is CSV on standard input; or a table
    columns : what to read and in which units
    texts : is given the cells that hold text where numbers belong

    Raises
    ------
    RecordingError
        When the file cannot be read, is no table, lacks a column, or has numbers with decimal commas.
    """
    texts = texts or TextCells()
    if isinstance(source, MemoryTable):
        return (block.row(k) for block in _table_blocks(source, columns, texts) for k in range(len(block)))
    if str(source) == STANDARD_INPUT:
        return _csv_rows(source, columns, "standard input", texts)
    if is_parquet(Path(source)):
        return _rows(parquet_records(Path(source), columns.headers), columns, str(source), texts)
    return _csv_rows(source, columns, str(source), texts)


def read_blocks(source: Recording, columns: Columns, texts: TextCells | None = None) -> Iterator[RowBlock]:
    """Give the same rows in blocks: of a CSV file some thousand at once, of standard input what is there.

    Of a table all, of all else, which may be slow, single ones.

    Rows before an error come before it. On standard input a record that is no row is passed over, as `texts` is told,
    and counts as a row without a time; but where it is the first one: then all are likely so. Parameters and errors
    are those of `read_rows`.
    """
    texts = texts or TextCells()
    if isinstance(source, MemoryTable):
        return _table_blocks(source, columns, texts)
    path = Path(source)
    if str(source) == STANDARD_INPUT:
        return _csv_blocks(source, columns, "standard input", texts)
    if not path.is_file() or is_parquet(path):
        return (block_of_rows([row]) for row in read_rows(source, columns, texts))
    return _csv_blocks(path, columns, str(path), texts)


def write_recording(path: str | Path, columns: Mapping[str, FloatArray], *, digits: int | None = 15) -> None:
    """Write columns of equal length as CSV, the header first; nan becomes an empty field.

    Parameters
    ----------
    path : file to write, replaced if it exists
    columns : values by header, each of shape (n_rows,), in the units in which they are to be read
    digits : of each number; None: as few as give it back to the last bit

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
    written = repr if digits is None else f"{{:.{digits}g}}".format
    with replaced_text(Path(path)) as stream:
        writer = csv.writer(stream, lineterminator="\n")
        writer.writerow(columns)
        for values in zip(*(column.tolist() for column in columns.values()), strict=True):
            writer.writerow([written(value) if math.isfinite(value) else "" for value in values])


def row_reader(columns: Columns, header: Sequence[str], title: str) -> Callable[[int, Sequence[object]], Row]:
    """Give the function that makes a row of its number, from 1, and its values in the order of a header.

    Raises
    ------
    RecordingError
        Where the header lacks a column.
    """
    layout = _Layout(columns, header, title, TextCells())
    return lambda count, values: layout.row(count, count, values)


class _Layout:
    """Where the columns of a model stand in a recording, and how its records become rows.

    Parameters
    ----------
    columns : what to read
    header : the first record of the recording
    title : its name, for messages
    texts : is given the cells that hold text where numbers belong
    delimiter : what separates the fields of a text; where it is no comma, one in a number is its decimal mark

    Raises
    ------
    RecordingError
        Where a column is not there, or is there twice.
    """

    def __init__(
        self, columns: Columns, header: Sequence[object], title: str, texts: TextCells, delimiter: str = ""
    ) -> None:
        self.header = [str(name).strip() for name in header]
        if not any(self.header):
            raise RecordingError(f"{title}: it is empty. The first row must name the columns.")
        needed = columns.needed(self.header)
        for column in needed:
            if self.header.count(column.header) != 1:
                others = frozenset(item.header for item in needed if item is not column)
                raise RecordingError(_no_column(column, others, self.header, title))
        self._columns, self._title, self._texts, self._delimiter = columns, title, texts, delimiter
        clock = needed[:1] if needed and needed[0].role == "time" else ()
        self._needed = (*clock, *columns.inputs, *columns.outputs)  # in the order in which they are looked at
        self._clock = self.header.index(clock[0].header) if clock else None
        inputs, outputs = columns.inputs, columns.outputs
        self._inputs, self._outputs = ([self.header.index(item.header) for item in of] for of in (inputs, outputs))
        self._places = (*(() if self._clock is None else (self._clock,)), *self._inputs, *self._outputs)
        self._lowest, self._highest = ends(outputs, inwards=True)
        self._least, self._most = ends(inputs, inwards=False)

    def row(self, count: int, line: int, values: Sequence[object]) -> Row:
        """Give the row of a record; `count` is its number, from 1.

        Raises
        ------
        NoRowError
            Where it has too many fields, or decimal commas.
        """
        columns, clock, header, where = self._columns, self._clock, self.header, f"{self._title}:{line}"
        if any(str(value).strip() for value in values[len(header) :]):  # no field is then sure to be its column's
            raise NoRowError(
                f"{where}: this row has {len(values)} fields, the header {len(header)}. Decimal commas? "
                "Write numbers with a point; a text that holds a separator needs quotation marks."
            )
        if self._delimiter in AROUND_COMMAS:
            values = self._with_points(values, where)
        if clock is None:
            moment = columns.first_time + (count - 1) * (columns.sample_time or 1.0)
        else:
            moment = moment_of(_field(values, clock), columns.time.unit)
        u, y = _numbers(values, self._inputs, columns.inputs), _numbers(values, self._outputs, columns.outputs)
        if math.isnan(moment) or np.isnan(u).any() or np.isnan(y).any():
            found = (*(() if clock is None else (moment,)), *u, *y)
            for k, item, value in zip(self._places, self._needed, found, strict=True):
                text = _field(values, k)
                if isinstance(text, str) and WITH_COMMA.fullmatch(text):  # it would pass for a missing value
                    wrong = f"{header[k]!r} is {text.strip()!r}"
                    raise NoRowError(f"{where}: {wrong}. Decimal commas? Write numbers with a point.")
                if math.isnan(value):
                    self._texts.add(item.header, item.role, line, text)
        saturated, beyond = (y <= self._lowest) | (y >= self._highest), (u < self._least) | (u > self._most)
        y[saturated], u[beyond] = math.nan, math.nan
        return Row(time=moment, u=u, y=y, saturated=int(saturated.sum() + beyond.sum()), line=line)

    def _with_points(self, values: Sequence[object], where: str) -> Sequence[object]:
        """Give a record whose numbers have decimal points, of one whose numbers may have commas.

        Raises
        ------
        NoRowError
            Where some have commas and some points: one of these may separate thousands.
        """
        found = list(values)
        written = [(k, text) for k in self._places if isinstance(text := _field(values, k), str)]
        with_comma = [(k, text) for k, text in written if WITH_COMMA.fullmatch(text)]
        for k, text in with_comma:
            found[k] = text.replace(",", ".")
        with_point = [(k, text) for k, text in written if "." in text and not math.isnan(finite_number(text))]
        if with_comma and with_point:
            (k, comma), (j, point) = with_comma[0], with_point[0]
            both = f"{self.header[k]!r} is {comma.strip()!r} and {self.header[j]!r} is {point.strip()!r}"
            raise NoRowError(f"{where}: {both}. Decimal commas or points? Write all numbers with one of them.")
        return found

    def nothing(self, line: int) -> Row:
        """Give a row that says nothing, not even when."""
        u, y = (np.full(len(places), math.nan) for places in (self._inputs, self._outputs))
        return Row(time=math.nan, u=u, y=y, saturated=0, line=line)

    def block(self, count: int, line: int, lines: Sequence[str]) -> RowBlock | None:
        """Give the rows of lines, each a record with as many fields as the header, as `row` does for each of them.

        None where there may be decimal commas beside other marks. `count`, `line`: numbers of the first.
        """
        columns, n, places, delimiter = self._columns, len(lines), self._places, self._delimiter
        units = [*(() if self._clock is None else (columns.time.unit,)), *(item.unit for item in columns.inputs)]
        units += [item.unit for item in columns.outputs]
        numbers = _plain_numbers(lines, delimiter, places)
        fields = None
        if numbers is None:  # not all of them are numbers
            records: Iterable[Sequence[object]] = csv.reader(lines, delimiter=delimiter)
            if delimiter in AROUND_COMMAS:
                try:
                    records = [self._with_points(record, "") for record in records]
                except NoRowError:
                    return None
            fields = [*zip(*records, strict=True)]
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
            lost = np.isnan(numbers) if self._clock is None else np.column_stack([np.isnan(time), np.isnan(values)])
            for k, j in np.argwhere(lost):
                self._texts.add(self._needed[j].header, self._needed[j].role, line + int(k), fields[places[j]][k])
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
            for row, text in table.texts(item.header, np.isnan(values)):
                self._texts.add(item.header, item.role, row, text)
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


def _rows(
    records: Iterator[tuple[int, Sequence[object]]], columns: Columns, title: str, texts: TextCells, delimiter: str = ""
) -> Iterator[Row]:
    """Turn records into rows; the first record is the header."""
    layout = _Layout(columns, next(records, (0, ()))[1], title, texts, delimiter)
    count = 0
    for count, (line, values) in enumerate(records, start=1):
        yield layout.row(count, line, values)
    if count == 0:
        raise RecordingError(_no_row(title))


def _no_row(title: str) -> str:
    return f"{title}: there is no row below the header."


def _table_blocks(table: MemoryTable, columns: Columns, texts: TextCells) -> Iterator[RowBlock]:
    """Turn a table in memory into rows, all at once."""
    yield _Layout(columns, table.names, str(table), texts).table(table)


def _csv_blocks(source: str | Path, columns: Columns, title: str, texts: TextCells) -> Iterator[RowBlock]:
    """Turn CSV text into rows, many lines at a time where each of them is a plain record."""
    with reading(title), opened_text(source) as stream:
        body = _Body(Lines(stream, title), columns, title, texts)
        yield from body.passing_over(body.refused) if str(source) == STANDARD_INPUT else body.blocks()
        if body.count == 0:
            raise RecordingError(_no_row(title))


class _Body:
    """The records below the header of a CSV text. count: how many were passed."""

    def __init__(self, lines: Lines, columns: Columns, title: str, texts: TextCells) -> None:
        self.lines, self.count, self._title = lines, 0, title
        self._delimiter = delimiter_of(lines, title)
        header = next(records_in(lines, self._delimiter, title), (0, ()))[1]
        self._layout = _Layout(columns, header, title, texts, self._delimiter)
        self._texts = texts

    def passing_over(self, refuse: Callable[[RecordingError], Iterable[RowBlock]]) -> Iterator[RowBlock]:
        """Give the same of what cannot be given again; `refuse` gives what stands for a record that is none."""
        while True:
            try:
                yield from self.blocks()
                return
            except RecordingError as error:
                yield from refuse(error)
                self.count += 1

    def refused(self, error: RecordingError) -> Iterator[RowBlock]:
        """Give what stands for a record of a live stream that is no row, see `read_blocks`; else the error stays."""
        if not isinstance(error, NoRowError) or not self.count:
            raise error
        self._texts.pass_over(str(error))
        yield block_of_rows([self._layout.nothing(self.lines.number)])

    def blocks(self) -> Iterator[RowBlock]:
        """Give the rows up to the end of the text; those before an error come before it."""
        lines, layout = self.lines, self._layout
        while ahead := lines.ahead():
            plain = _are_plain(ahead, self._delimiter, len(layout.header))
            block = layout.block(self.count + 1, lines.number + 1, ahead) if plain else None
            if block is not None:
                lines.skip()
                self.count += len(block)
                yield block
                continue
            rows: list[Row] = []
            try:
                for line, values in records_in(lines, self._delimiter, self._title):
                    rows.append(layout.row(self.count + len(rows) + 1, line, values))
                    if lines.is_at_end:
                        break
            except (RecordingError, OSError):
                self.count += len(rows)
                if rows:
                    yield block_of_rows(rows)
                raise
            if rows:
                self.count += len(rows)
                yield block_of_rows(rows)


class RowFeed:
    """Rows of CSV text whose bytes come in pieces, read by the rules of `read_blocks`; where that ends, this goes on.

    A line waits until it is whole, and a quoted text until its quotation mark is closed.

    refused: how many records were no rows, as with decimal commas or too many fields; they are passed over.
    """

    def __init__(self, columns: Columns, title: str) -> None:
        self._columns, self._title = columns, title
        self._pieces = Pieces()
        self._lines = Lines(self._pieces, title)
        self._body: _Body | None = None
        self._held, self._beyond, self._begun = b"", False, False
        self.refused = 0

    @property
    def waiting(self) -> int:
        """How many bytes wait for more."""
        return len(self._held)

    @property
    def has_header(self) -> bool:
        """Whether the line that names the columns has come."""
        return self._body is not None

    @property
    def stand(self) -> tuple[int, int]:
        """How many records and lines have come, by which another feed goes on."""
        return (self._body.count if self._body is not None else 0), self._lines.number

    def go_on(self, stand: tuple[int, int]) -> None:
        """Count on from where another feed stood, once the header has come."""
        if self._body is not None:
            self._body.count, self._lines.number = stand

    def push(self, data: bytes, *, final: bool = False) -> list[RowBlock]:
        """Take bytes and give the rows that are whole with them; `final`: no more will come.

        Raises
        ------
        RecordingError
            Where the header is none, or lacks a column.
        """
        self._held += data
        whole = self._whole(final=final)
        if not whole:
            return []
        text = whole.decode("utf-8" if self._begun else "utf-8-sig", "replace")
        self._begun = True
        self._pieces.text += text
        if self._body is None:
            if not text.strip():  # empty lines before the header
                return []
            self._body = _Body(self._lines, self._columns, self._title, TextCells())
        return list(self._body.passing_over(self._refuse))

    def _refuse(self, _: RecordingError) -> Iterable[RowBlock]:
        self.refused += 1
        return ()

    def _whole(self, *, final: bool) -> bytes:
        """Take from what is held the lines that are whole."""
        if self._beyond:  # the rest of a line that was too long
            _, end, self._held = self._held.partition(b"\n")
            self._beyond = not end
        cut = len(self._held) if final else self._held.rfind(b"\n") + 1
        if not final and len(self._held) - cut >= MAX_LINE:
            self.refused += 1
            self._beyond, self._held = True, self._held[:cut]
        whole = self._held[:cut]
        if not final and whole.count(b'"') % 2 and len(whole) < MAX_LINE:
            return b""
        self._held = self._held[cut:]
        return whole


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


def _no_column(column: Column, others: frozenset[str], header: list[str], title: str) -> str:
    """Say that a column is not there, or is there twice, and what is there; none that others read is meant."""
    if column.header in header:
        often = f"column {column.header!r} ({column.role}) appears {header.count(column.header)} times"
        return f"{title}: {often}. Leave one of them."
    if all(not math.isnan(finite_number(name)) for name in header):
        return f"{title}: the first row holds numbers; it must name the columns, among them {column.header!r}."
    found = ", ".join(name[:40] for name in header[:SHOWN_COLUMNS])
    more = f" and {len(header) - SHOWN_COLUMNS} more" if len(header) > SHOWN_COLUMNS else ""
    by_lower = {name[:100].lower(): name[:100] for name in header[:1000] if name not in others}
    close = difflib.get_close_matches(column.header.lower(), by_lower, n=1)
    advice = (
        f"Did you mean '{by_lower[close[0]]}'? State that as `column` in the model file."
        if close
        else "Name it in the model file with `column`."
    )
    return f"{title}: no column {column.header!r} ({column.role}); found: {found}{more}. {advice}"


def _csv_rows(source: str | Path, columns: Columns, title: str, texts: TextCells) -> Iterator[Row]:
    """Turn CSV text into rows, one by one."""
    with reading(title), opened_text(source) as stream:
        lines = Lines(stream, title)
        delimiter = delimiter_of(lines, title)
        yield from _rows(records_in(lines, delimiter, title), columns, title, texts, delimiter)
