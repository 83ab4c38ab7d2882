"""A recording that is read in blocks has the rows, and the mistakes, of one that is read row by row."""

from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from faultbond.errors import RecordingError
from faultbond.io import csv_text as module
from faultbond.io.grid import Row
from faultbond.io.recording import Column, Columns, RowFeed, read_blocks, read_rows
from faultbond.model.graph import TimeColumn, Unit

CELSIUS = Unit("degC", 1.0, 273.15)
COLUMNS = Columns(
    time=TimeColumn(column="time", unit=Unit("ms", 0.001)),
    inputs=(Column(header="u", unit=Unit("percent"), role="input u", lower=0.0, upper=100.0),),
    outputs=(
        Column(header="y", unit=CELSIUS, role="sensor y", lower=250.0, upper=400.0),
        Column(header="z", unit=Unit("kPa", 1000.0), role="sensor z"),
    ),
    sample_time=0.5,
)
UNTIMED = Columns(
    time=TimeColumn(column="moment", optional=True),
    inputs=COLUMNS.inputs,
    outputs=COLUMNS.outputs,
    sample_time=0.25,
    first_time=7.0,
)
ODD = (
    *("", " ", "nan", "inf", "-1e999", "1_000", "x", "1,5", '"1"', '"1\n2"', "\u0661", "#3", "1e-320", "0x10", "5,"),
    *("101", "-5", "0.1", " 7 ", "1\t", "126.85", "-23.15", "5e3;2", "\0", '"', "\x0b1", "1\x85", "1\u2028"),
    *("2024-01-01T00:00:00Z", "2024-13-01", "1.2.2024 10:00:00,5", "1,2,3"),
)


@st.composite
def texts(draw: st.DrawFn) -> str:
    """CSV with mostly plain numbers."""
    generator = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    header = draw(st.permutations(["time", "u", "y", "z", "note"]))
    odd = st.lists(st.tuples(st.integers(0, 59), st.integers(0, 4), st.sampled_from(ODD)), max_size=6)
    delimiter, end = draw(st.sampled_from([",", ",", ";", "\t"])), draw(st.sampled_from(["\n", "\n", "\r\n", "\r"]))
    n_rows = draw(st.integers(0, 60))
    rows = [[repr(float(value)) for value in line] for line in generator.uniform(0.0, 120.0, (n_rows, 5)).round(3)]
    if delimiter != "," and draw(st.booleans()):
        rows = [[text.replace(".", ",") for text in row] for row in rows]
    for line, place, text in draw(odd):
        if line < n_rows:
            rows[line][place] = text
    for line in draw(st.lists(st.integers(0, 59), max_size=2)):
        if line < n_rows:
            rows[line] = draw(st.sampled_from([[], [""], rows[line][:3], [*rows[line], ""], [*rows[line], "7"]]))
    last = draw(st.sampled_from(["", end]))
    return end.join(delimiter.join(row) for row in [header, *rows]) + last


def row_of(row: Row) -> tuple[Any, ...]:
    """Give all of a row, nan as itself."""
    return (np.float64(row.time).tobytes(), row.u.tobytes(), row.y.tobytes(), row.saturated, row.line)


def all_rows(path: Path, columns: Columns) -> tuple[list[Any], str]:
    """Give the rows, and the error at their end."""
    found: list[Any] = []
    try:
        found.extend(map(row_of, read_rows(path, columns)))
    except RecordingError as error:
        return found, str(error)
    return found, ""


def all_blocks(path: Path, columns: Columns) -> tuple[list[Any], str]:
    """Give the same of blocks."""
    found: list[Any] = []
    try:
        for block in read_blocks(path, columns):
            found += [row_of(block.row(k)) for k in range(len(block))]
    except RecordingError as error:
        return found, str(error)
    return found, ""


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(text=texts(), ahead=st.sampled_from([1, 40, 300, 2**17]), columns=st.sampled_from([COLUMNS, UNTIMED]))
def test_blocks_have_the_rows_of_a_recording(text: str, ahead: int, columns: Columns, tmp_path: Path) -> None:
    """Rows, their lines, what is saturated and what is refused are the same to the last bit, wherever it is parted."""
    path = tmp_path / "recording.csv"
    path.write_bytes(text.encode())
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "READ_AHEAD", ahead)
        assert all_blocks(path, columns) == all_rows(path, columns)


def test_plain_numbers_come_in_large_blocks(tmp_path: Path) -> None:
    """A recording of plain numbers is read some thousand rows at once, one with gaps too; a long line ends it."""
    lines = [f"{k},{k % 100},50.5,{'' if k % 1000 == 7 else k}" for k in range(20_000)]
    path = tmp_path / "recording.csv"
    path.write_text("\n".join(["time,u,y,z", *lines]))
    sizes = [len(block) for block in read_blocks(path, COLUMNS)]
    assert sum(sizes) == 20_000
    assert len(sizes) < 10
    path.write_text("\n".join(["time,u,y,z", *lines[:500], "1" * 300_000]))
    rows, error = all_blocks(path, COLUMNS)
    assert len(rows) == 500
    assert "502: a line of more than" in error
    assert (rows, error) == all_rows(path, COLUMNS)


@settings(deadline=None, suppress_health_check=[HealthCheck.function_scoped_fixture])
@given(
    text=texts(),
    cuts=st.lists(st.integers(0, 3000), max_size=20),
    columns=st.sampled_from([COLUMNS, UNTIMED]),
    mark=st.sampled_from([b"", b"\xef\xbb\xbf"]),
)
def test_pieces_have_the_rows_of_a_recording(
    text: str, cuts: list[int], columns: Columns, mark: bytes, tmp_path: Path
) -> None:
    """Bytes that come in pieces, cut anywhere, give the rows of the whole file up to its first mistake."""
    path, data = tmp_path / "recording.csv", mark + text.encode()
    path.write_bytes(data)
    rows, error = all_rows(path, columns)
    feed, found = RowFeed(columns, str(path)), list[Any]()
    ends = [*sorted(min(cut, len(data)) for cut in cuts), len(data)]
    for begin, end in zip([0, *ends], ends, strict=False):
        for block in feed.push(data[begin:end], final=end == len(data) and begin < end):
            found += [row_of(block.row(k)) for k in range(len(block))]
    assert found[: len(rows)] == rows
    assert error == "" or "no row" in error or feed.refused > 0
    assert error != "" or (feed.refused == 0 and len(found) == len(rows))


def test_a_line_waits_until_it_is_whole() -> None:
    """Half a line, and a quotation that is not closed, wait and are counted; what is too long is refused, no more."""
    feed = RowFeed(COLUMNS, "feed")
    assert feed.push(b"\n\ntime,u,y,z,note\n1000,50,20,1,ok\n2000,5")[0].row(0).time == 1.0
    assert feed.waiting == len(b"2000,5")
    assert feed.push(b'0,20,1,ok\n3000,50,20,1,"one\n') == []
    blocks = feed.push(b'two"\n')
    assert [float(time) for block in blocks for time in block.time] == [2.0, 3.0]
    assert feed.push(b"9" * 300_000) == []
    assert feed.refused == 1
    blocks = feed.push(b"9,9\n4000,50,20,1,ok\n5000,50,20,1,ok,surplus\n6000,1,2,3\n")
    assert [float(time) for block in blocks for time in block.time] == [4.0, 6.0]
    assert feed.refused == 2


def test_a_feed_goes_on_where_another_stood() -> None:
    """Rows without a time are numbered on, and lines counted on, from where the feed before stood."""
    first, second = RowFeed(UNTIMED, "feed"), RowFeed(UNTIMED, "feed")
    first.push(b"u,y,z\n1,2,3\n4,5,6\n")
    assert not second.has_header
    second.push(b"u,y,z\n")
    assert second.has_header
    second.go_on(first.stand)
    (block,) = second.push(b"7,8,9\n")
    assert (block.time[0], block.line[0]) == (7.0 + 2 * 0.25, 4)
