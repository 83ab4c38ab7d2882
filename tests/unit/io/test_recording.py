"""Reading and writing recordings."""

import io
import math
import os
import sys
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from threading import Thread
from time import process_time

import numpy as np
import pytest

from faultbond.errors import RecordingError
from faultbond.io.grid import Counts, Grid, Row, on_grid
from faultbond.io.recording import Column, Columns, read_blocks, read_rows, write_recording
from faultbond.io.text_cells import TextCells
from faultbond.io.times import parse_time
from faultbond.model.graph import TimeColumn, Unit

COLUMNS = Columns(
    time=TimeColumn(),
    inputs=(Column(header="u", unit=Unit("percent"), role="input u"),),
    outputs=(
        Column(header="level", unit=Unit("cm", 0.01), role="sensor level"),
        Column(header="heat", unit=Unit("degC", 1.0, 273.15), role="sensor heat"),
    ),
    sample_time=2.0,
)
NO_TIME = Columns(time=TimeColumn(column=None), inputs=COLUMNS.inputs, outputs=(), sample_time=2.0)


def read(tmp_path: Path, text: str | bytes, columns: Columns = COLUMNS) -> list[Row]:
    """Give the rows of a file with this text."""
    path = tmp_path / "rec.csv"
    path.write_bytes(text if isinstance(text, bytes) else text.encode())
    return list(read_rows(path, columns))


def flat(rows: list[Row]) -> list[list[float]]:
    """Give time, u and y of rows as plain numbers."""
    return [[row.time, *row.u.tolist(), *row.y.tolist()] for row in rows]


def agree(rows: list[Row], expected: list[list[float]]) -> bool:
    """Whether rows hold these numbers, nan being equal to nan."""
    return np.allclose(flat(rows), expected, rtol=1e-12, equal_nan=True)


def test_values_are_converted_to_si(tmp_path: Path) -> None:
    """Columns are found by name in any order, others are ignored, units are applied."""
    rows = read(tmp_path, "heat,other,u,time,level\n20,x,50,7.5,120\n")
    assert agree(rows, [[7.5, 50.0, 1.2, 293.15]])
    assert rows[0].line == 2


def test_values_at_an_end_of_the_range_are_saturated(tmp_path: Path) -> None:
    """A value at an end or beyond, whatever the units round, is nan and counted; so is one at 0."""
    level = Column(header="level", unit=Unit("cm", 0.01), role="sensor level", lower=0.0, upper=math.nextafter(2.1, 3))
    text = "time,level\n0,0\n1,-5\n2,0.001\n3,209.999\n4,210\n5,1e9\n6,\n"
    for column, ends in ((level, [1, 1, 0, 0, 1, 1, 0]), (replace(level, upper=math.inf), [1, 1, 0, 0, 0, 0, 0])):
        columns = Columns(time=TimeColumn(), inputs=(), outputs=(column,), sample_time=1.0)
        rows = read(tmp_path, text, columns)
        assert [row.saturated for row in rows] == ends
        assert [math.isnan(row.y[0]) for row in rows] == [*map(bool, ends[:-1]), True]


def test_inputs_beyond_their_range_are_missing(tmp_path: Path) -> None:
    """A value beyond the range of an input is nan and counted; one at an end is as it should be."""
    valve = Column(header="valve", unit=Unit("percent", 1.0), role="input valve", lower=0.0, upper=100.0)
    columns = Columns(time=TimeColumn(), inputs=(valve,), outputs=(), sample_time=1.0)
    rows = read(tmp_path, "time,valve\n0,0\n1,100\n2,100.5\n3,-1\n4,1e300\n", columns)
    assert [row.saturated for row in rows] == [0, 0, 1, 1, 1]
    assert [math.isnan(row.u[0]) for row in rows] == [False, False, True, True, True]


@pytest.mark.parametrize("text", ["", "  ", "x", "nan", "inf", "-inf", "1e999", "1_0", "0x10", "1.5z"])
def test_what_is_no_number_is_nan(tmp_path: Path, text: str) -> None:
    """Empty, unreadable and not finite values are nan; the others of the row stay."""
    ((time, u, level, heat),) = flat(read(tmp_path, f"time,u,level,heat\n1,{text},100,0\n"))
    assert math.isnan(u)
    assert (time, level, heat) == (1.0, 1.0, 273.15)


def test_short_and_empty_lines(tmp_path: Path) -> None:
    """Fields that are not there are nan, and an empty line is no row."""
    rows = read(tmp_path, "time,u,level,heat\n1,5\n\n2\n")
    assert agree(rows, [[1, 5, math.nan, math.nan], [2, math.nan, math.nan, math.nan]])


def test_empty_lines_before_the_header(tmp_path: Path) -> None:
    """They are passed over too, and what stands between fields is told by the header."""
    rows = read(tmp_path, "\n\ntime;u;level;heat\n1;5;100;0\n")
    assert agree(rows, [[1, 5, 1.0, 273.15]])
    assert rows[0].line == 4


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="needs named pipes")
def test_a_pipe_is_read_once(tmp_path: Path) -> None:
    """What was read of a pipe to see what it holds would be missing."""
    pipe = tmp_path / "pipe"
    os.mkfifo(pipe)
    text = "time,u,level,heat\n1,5,100,0\n"
    writer = Thread(target=pipe.write_text, args=(text,))
    writer.start()
    rows = list(read_rows(str(pipe), COLUMNS))
    writer.join()
    assert agree(rows, [[1, 5, 1.0, 273.15]])


@pytest.mark.parametrize(
    ("text", "seconds"),
    [
        ("1970-01-01T00:01:00", 60.0),
        ("1970-01-01 00:01:00.5", 60.5),
        ("1970-01-01T00:01:00Z", 60.0),
        ("1970-01-01T02:01:00+02:00", 60.0),
        ("19700101T000100", 60.0),
        ("-12.5", -12.5),
        ("yesterday", math.nan),
        ("", math.nan),
    ],
)
def test_times(tmp_path: Path, text: str, seconds: float) -> None:
    """A time is seconds, or ISO 8601 in UTC where it names no zone; anything else is nan."""
    (row,) = read(tmp_path, f"time,u,level,heat\n{text},1,1,1\n")
    assert row.time == pytest.approx(seconds, nan_ok=True)


def test_unit_of_time(tmp_path: Path) -> None:
    """A time column in milliseconds gives seconds, and its name is free."""
    columns = Columns(
        time=TimeColumn(column="t_ms", unit=Unit("ms", 1e-3)), inputs=(), outputs=COLUMNS.outputs[:1], sample_time=1.0
    )
    assert flat(read(tmp_path, "t_ms,level\n1500,1\n", columns)) == [[1.5, 0.01]]


@pytest.mark.parametrize(
    ("rows", "where", "what"),
    [
        ("0,02,5,100,20\n", 2, "this row has 5 fields, the header 4"),
        ("0,5,100,20\n1,5,100,5,20,5\n", 3, "this row has 6 fields, the header 4"),
        ('0,5,"100,25",20\n', 2, "'level' is '100,25'"),
        ('"0,02",5,100,20\n', 2, "'time' is '0,02'"),
        ('0,",5e-3",100,20\n', 2, "'u' is ',5e-3'"),
    ],
)
def test_decimal_commas_are_refused(tmp_path: Path, rows: str, where: int, what: str) -> None:
    """A number with a decimal comma would shift the columns, or pass for a missing value: both are one error."""
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, f"time,u,level,heat\n{rows}")
    assert str(caught.value).startswith(f"{tmp_path / 'rec.csv'}:{where}: {what}. Decimal commas? Write")


@pytest.mark.parametrize("mark", [";", "\t"])
def test_a_comma_between_other_separators_is_the_decimal_mark(tmp_path: Path, mark: str) -> None:
    """The way in which a German spreadsheet writes a recording; the day of a date comes first."""
    rows = "31.5.2026 10:00:00,5;-0,5;1,5e2;,25;1.5\n31.05.2026 10:00:01;1;100;1,2,3;x\n"
    moments = [parse_time("2026-05-31T10:00:00.5"), parse_time("2026-05-31T10:00:01Z")]
    wanted = [[moments[0], -0.5, 1.5, 273.4], [moments[1], 1.0, 1.0, math.nan]]
    assert agree(read(tmp_path, f"time;u;level;heat;note\n{rows}".replace(";", mark)), wanted)


def test_commas_and_points_in_one_row_are_refused(tmp_path: Path) -> None:
    """One of them may separate thousands; in a column that nobody needs they do no harm."""
    with pytest.raises(RecordingError, match=r"rec\.csv:2: 'u' is '1,234' and 'level' is '0\.5'\. Decimal commas or"):
        read(tmp_path, "time;u;level;heat\n1;1,234;0.5;20\n")
    assert flat(read(tmp_path, "time;u;level;heat;note\n1;1;2.5;20;0,5\n")) == [[1.0, 1.0, 0.025, 293.15]]


def test_empty_fields_beyond_the_header_are_accepted(tmp_path: Path) -> None:
    """A separator at the end of every row, as some loggers write it, shifts nothing."""
    assert agree(
        read(tmp_path, "time,u,level,heat\n1,5,100,0,\n2,5,100,0, ,\n"), [[1, 5, 1, 273.15], [2, 5, 1, 273.15]]
    )


def test_no_time_column(tmp_path: Path) -> None:
    """Without a time column row n is at n times the sample time."""
    assert flat(read(tmp_path, "u\n5\n6\n7\n", NO_TIME)) == [[0.0, 5.0], [2.0, 6.0], [4.0, 7.0]]


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_other_delimiters_and_a_byte_order_mark(tmp_path: Path, delimiter: str) -> None:
    """Semicolons and tabs are understood, and so is the mark that spreadsheets put first."""
    text = "\ufefftime,u,level,heat\r\n1,2,3,4\r\n".replace(",", delimiter)
    assert agree(read(tmp_path, text), [[1.0, 2.0, 0.03, 277.15]])


def test_a_missing_column_is_named(tmp_path: Path) -> None:
    """The message has the file, the column, what it is for, the columns found, and the closest of them."""
    with pytest.raises(RecordingError) as caught:
        read(tmp_path, "time,u,Levels,heat\n1,2,3,4\n")
    message = "no column 'level' (sensor level); found: time, u, Levels, heat. Did you mean 'Levels'? State that as "
    message += "`column` in the model file."
    assert str(caught.value) == f"{tmp_path / 'rec.csv'}: {message}"


def test_a_missing_column_without_a_likeness(tmp_path: Path) -> None:
    """Where nothing is close, the message says how to name the column; long lists are cut."""
    header = ",".join(f"c{number}" for number in range(50))
    with pytest.raises(RecordingError, match=r"no column 'time' \(time\); found: c0, .* and 30 more\. Name it"):
        read(tmp_path, f"{header}\n1\n")


BAD_FILES = {
    "empty": (b"", "it is empty"),
    "spaces": (b"\n  \n", "it is empty"),
    "header": (b"time,u,level,heat\n", "no row below the header"),
    "numbers": (b"1,2,3,4\n2,3,4,5\n", "first row holds numbers"),
    "twice": (b"time,u,u,level,heat\n1,2,3,4,5\n", "appears 2 times"),
    "binary": (bytes(range(256)) * 100, "not text"),
    "latin": (b"\x80\xfe\xff" * 100, "not text"),
    "zeros": (b"\0" * 2_000_000, "a line of more than"),
    "line": (b"x" * 1_000_000, "a line of more than"),
    "wide": (b"x," * 500_000, "a line of more than"),
    "later": (b"time,u,level,heat\n1,2,3,4\n" + b"9" * 1_000_000 + b"\n", "rec.csv:3: a line of more than"),
    "field": (b"time,u,level,heat\n1,2,3," + b"9" * 150_000 + b"\n", "rec.csv:2: this is not a row"),
    "quote": (b'time,u,level,heat\n"1,2,3,4\n' + b"2,3,4,5\n" * 1000, "rec.csv:2: a quotation mark"),
    "fake parquet": (b"PAR1" + b"\0" * 100, "Parquet"),
}


@pytest.mark.parametrize("name", BAD_FILES)
def test_what_is_no_recording_is_one_error(tmp_path: Path, name: str) -> None:
    """A file that is no recording is refused quickly, in one line that names it."""
    content, message = BAD_FILES[name]
    begin = process_time()
    with pytest.raises(RecordingError, match=message) as caught:
        read(tmp_path, content)
    assert process_time() - begin < 10.0
    assert str(caught.value).startswith(str(tmp_path / "rec.csv"))
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize("name", ["absent.csv", "."])
def test_a_file_that_cannot_be_opened(tmp_path: Path, name: str) -> None:
    """A path that is no readable file is a recording error with the system's reason."""
    with pytest.raises(RecordingError, match="cannot be read: "):
        list(read_rows(tmp_path / name, COLUMNS))


def test_standard_input_gives_rows_as_they_come(monkeypatch: pytest.MonkeyPatch) -> None:
    """A row is there as soon as its line is, and the stream stays open at the end."""
    reader, writer = os.pipe()
    with os.fdopen(reader, encoding="utf-8") as stdin, os.fdopen(writer, "w", encoding="utf-8") as plant:
        monkeypatch.setattr(sys, "stdin", stdin)
        grid = Grid(1.0, live=True)
        points = on_grid(read_rows("-", COLUMNS), grid)
        plant.write("time,u,level,heat\n5,1,2,3\n")
        plant.flush()
        assert next(points).time == 5.0
        plant.write("6,1,2,\n")
        plant.flush()
        assert next(points).time == 6.0
        plant.close()
        assert list(points) == []
        assert not stdin.closed
    assert grid.counts == Counts(samples=2, missing=1)


def test_a_line_of_standard_input_that_is_no_row_is_told_once_and_passed_over(monkeypatch: pytest.MonkeyPatch) -> None:
    """It counts as a row without a time, wherever blocks begin; the first row of all is refused, and so is a file's."""
    told: list[str] = []
    text = "time,u,level,heat\n5,1,2,3\n6,1,2,3,4\n7,1,2,3\n8,1,2,3,4\n"
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.encode())))
    texts, grid = TextCells(tell=told.append), Grid(1.0, live=True)
    blocks = [*read_blocks("-", COLUMNS, texts)]
    times = [float(time) for block in blocks for time in block.time]
    np.testing.assert_array_equal(times, [5.0, math.nan, 7.0, math.nan])
    assert [int(line) for block in blocks for line in block.line] == [2, 3, 4, 5]
    assert told == [
        "standard input:3: this row has 5 fields, the header 4. Decimal commas? Write numbers with a point; a text "
        "that holds a separator needs quotation marks. The line is passed over."
    ]
    assert texts.passed_over == 2
    for block in blocks:
        list(grid.push_block(block))
    assert grid.counts.untimed == 2
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"u,v\n1,2\n1,2,3\n1,2\n")))
    times = [float(time) for block in read_blocks("-", NO_TIME) for time in block.time]
    np.testing.assert_array_equal(times, [0.0, math.nan, 4.0])  # it was a row of the logger
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(text.replace("5,1,2,3", "5,1,2,3,4").encode())))
    with pytest.raises(RecordingError, match=r"^standard input:2: this row has 5 fields"):
        list(read_blocks("-", COLUMNS))


def test_standard_input_is_named_in_errors(monkeypatch: pytest.MonkeyPatch) -> None:
    """Errors speak of standard input, not of a file called `-`."""
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BytesIO(b"")))
    with pytest.raises(RecordingError, match=r"^standard input: it is empty"):
        list(read_rows("-", COLUMNS))


def test_what_is_written_is_read_back(tmp_path: Path) -> None:
    """Columns come back as they were written, nan as a missing value, times to the microsecond."""
    path = tmp_path / "out.csv"
    time = 1.7e9 + np.array([0.0, 0.1, 0.2])
    write_recording(path, {"time": time, "u": np.array([0.1 + 0.2, math.nan, 1e-9])})
    assert path.read_text().splitlines()[:2] == ["time,u", "1700000000,0.3"]
    rows = list(read_rows(path, Columns(time=TimeColumn(), inputs=COLUMNS.inputs, outputs=(), sample_time=None)))
    assert [row.time for row in rows] == pytest.approx(time, abs=1e-6, rel=0)
    assert [float(row.u[0]) for row in rows] == pytest.approx([0.3, math.nan, 1e-9], nan_ok=True)


def test_only_csv_is_written(tmp_path: Path) -> None:
    """A name that promises Parquet is refused before anything is written."""
    with pytest.raises(RecordingError, match="only CSV is written"):
        write_recording(tmp_path / "out.parquet", {"time": np.zeros(1)})
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("name", ["=1+1", "+A1", "-A1", "@SUM(A1)", "\t=1", "\r=1"])
def test_no_cell_is_a_formula(tmp_path: Path, name: str) -> None:
    """A header that a spreadsheet would run is refused before anything is written; a negative number is none."""
    with pytest.raises(RecordingError, match="a spreadsheet would run the column"):
        write_recording(tmp_path / "out.csv", {"time": np.zeros(1), name: np.zeros(1)})
    assert list(tmp_path.iterdir()) == []
    write_recording(tmp_path / "out.csv", {"time": np.zeros(1), "u": -np.ones(1)})
    assert (tmp_path / "out.csv").read_text() == "time,u\n0,-1\n"


def test_parquet_gives_the_same_rows(tmp_path: Path) -> None:
    """Numbers, empty cells, times and numbers kept as text are read from Parquet as from CSV."""
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    table = pyarrow.table(
        {
            "heat": pyarrow.array(["20", "x"]),
            "other": [[1], [2]],
            "level": pyarrow.array([120, None], pyarrow.int32()),
            "u": pyarrow.array([50.0, math.inf]),
            "time": pyarrow.array([60 * 10**9, 61 * 10**9 + 1], pyarrow.timestamp("ns")),
        }
    )
    path = tmp_path / "rec.parquet"
    parquet.write_table(table, path)
    (tmp_path / "rec.dat").write_bytes(path.read_bytes())
    for name in ("rec.parquet", "rec.dat"):
        rows = flat(list(read_rows(tmp_path / name, COLUMNS)))
        assert rows[0] == pytest.approx([60.0, 50.0, 1.2, 293.15])
        assert rows[1] == pytest.approx([61.0, math.nan, math.nan, math.nan], nan_ok=True)


def test_parquet_without_a_column(tmp_path: Path) -> None:
    """A Parquet file that lacks a column gives the message of a CSV file."""
    pyarrow = pytest.importorskip("pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    parquet.write_table(pyarrow.table({"time": [0.0], "u": [1.0]}), tmp_path / "rec.parquet")
    with pytest.raises(RecordingError, match=r"no column 'level' \(sensor level\); found: time, u\."):
        list(read_rows(tmp_path / "rec.parquet", COLUMNS))


def test_parquet_needs_pyarrow(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without pyarrow the message says what to install."""
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    (tmp_path / "rec.parquet").write_bytes(b"PAR1")
    with pytest.raises(RecordingError, match=r"pip install 'faultbond\[parquet\]'"):
        list(read_rows(tmp_path / "rec.parquet", COLUMNS))


@pytest.mark.skipif("FAULTBOND_DATA" not in os.environ, reason="needs recordings that are not part of the project")
def test_a_real_recording() -> None:
    """The rig with four tanks is read whole: 5000 samples a second apart, of which the first is empty."""
    columns = Columns(
        time=TimeColumn(column="t_s"),
        inputs=(Column(header="FS_A4", unit=Unit("cm^3/s", 1e-6), role="input"),),
        outputs=(Column(header="LS_A4", unit=Unit("cm", 0.01), role="sensor"),),
        sample_time=1.0,
    )
    grid = Grid(1.0)
    points = list(on_grid(read_rows(Path(os.environ["FAULTBOND_DATA"]) / "watersafe" / "watersafe.csv", columns), grid))
    assert grid.counts.samples == len(points) == points[-1].time + 1
    assert (grid.counts.late, grid.counts.duplicate, grid.counts.untimed) == (0, 0, 0)
    assert math.isnan(points[0].u[0])
    assert points[0].y[0] == pytest.approx(0.190577)


def test_iso_times_agree_with_datetime(tmp_path: Path) -> None:
    """A zone is respected to the second, in summer too."""
    moment = datetime(2024, 7, 1, 12, 30, tzinfo=UTC)
    (row,) = read(tmp_path, f"time,u,level,heat\n{moment.isoformat()},1,1,1\n")
    assert row.time == moment.timestamp()
