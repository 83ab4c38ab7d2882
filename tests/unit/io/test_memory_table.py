"""Recordings in memory: frames, tables and dicts are read as files are."""

from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import polars
import pyarrow
import pytest

from faultbond.errors import RecordingError
from faultbond.io.memory_table import MemoryTable, table_of
from faultbond.io.recording import Columns, columns_of, read_blocks, read_rows
from faultbond.io.row_block import RowBlock
from faultbond.model.text import parse_model

MODEL = """
name: vessel
sample_time: 1 s
inputs: {drive: {column: pump, unit: percent}}
components:
  feed: {type: Sf, law: f = G*drive, parameters: {G: 2 cm^3/s/percent}}
  tank: {type: C, law: e = q/A, parameters: {A: 150 cm^2}}
junctions: {node: 0}
bonds: [feed -> node -> tank]
sensors: {level: {reads: node.e, unit: cm, noise: 0.2 cm, range: [0 cm, 90 cm]}}
"""
TIMES = [datetime(2026, 3, 1, 12, 0, k, tzinfo=UTC) for k in range(5)]
DATA: dict[str, list[Any]] = {
    "time": [moment.isoformat() for moment in TIMES],
    "pump": [10, 20, 30, 40, 50],
    "level": [1.5, None, 2.5, 95.0, float("nan")],
    "remark": ["", "a remark that is longer than a view", "x", None, "y"],
}


def columns() -> Columns:
    """Give the columns of the model."""
    return columns_of(parse_model(MODEL))


def block(frame: object) -> RowBlock:
    """Give the rows of what is in memory."""
    (found,) = read_blocks(table_of(frame), columns())
    return found


class Stream:
    """A table that speaks the protocol of Arrow and nothing else."""

    def __init__(self, table: Any) -> None:
        self._table = table

    def __arrow_c_stream__(self, requested_schema: object = None) -> object:
        """Give the stream."""
        return self._table.__arrow_c_stream__(requested_schema)


def dated(data: dict[str, list[Any]]) -> dict[str, list[Any]]:
    """Give the same with times that are no text."""
    return data | {"time": TIMES}


def sliced() -> Any:
    """Give a table in pieces, of which each stands in the midst of memory."""
    longer = pyarrow.table({name: [values[0], *values, values[0]] for name, values in dated(DATA).items()})
    return pyarrow.concat_tables([longer.slice(1, 2), longer.slice(3, 3)])


FRAMES: dict[str, Callable[[], object]] = {
    "dict": lambda: DATA,
    "dict of arrays": lambda: {name: np.array(values, dtype=object) for name, values in dated(DATA).items()},
    "dict of moments": lambda: (
        DATA | {"time": np.array([moment.replace(tzinfo=None) for moment in TIMES], dtype="datetime64[ms]")}
    ),
    "pandas": lambda: pandas.DataFrame(DATA),
    "pandas with dates": lambda: pandas.DataFrame(dated(DATA)),
    "pandas with an index": lambda: pandas.DataFrame(dated(DATA)).set_index("time"),
    "polars": lambda: polars.DataFrame(DATA),
    "polars with dates": lambda: polars.DataFrame(dated(DATA)),
    "pyarrow": lambda: pyarrow.table(DATA),
    "pyarrow with dates": lambda: pyarrow.table(dated(DATA)),
    "pieces": sliced,
    "views": lambda: Stream(polars.DataFrame(DATA)),
    "a dictionary": lambda: pyarrow.table(DATA | {"time": pyarrow.array(DATA["time"]).dictionary_encode()}),
    "a row batch": lambda: Stream(pyarrow.table(dated(DATA)).to_batches()[0].slice(0)),
}


@pytest.mark.parametrize("kind", FRAMES)
def test_frames_are_read_as_files_are(kind: str, tmp_path: Path) -> None:
    """Each kind of frame has the rows of the file with the same text: times, units, ranges, and what is missing."""
    path = tmp_path / "file.csv"
    lines = zip(*([*map(str, values)] for values in DATA.values()), strict=True)
    path.write_text("".join(",".join(line).replace("None", "") + "\n" for line in [tuple(DATA), *lines]))
    (of_file,), found = read_blocks(path, columns()), block(FRAMES[kind]())
    for name in ("time", "u", "y", "saturated"):
        assert np.array_equal(getattr(found, name), getattr(of_file, name), equal_nan=True), name
    assert found.time[0] == TIMES[0].timestamp()
    assert found.saturated.tolist() == [0, 0, 0, 1, 0]
    rows = list(read_rows(table_of(FRAMES[kind]()), columns()))
    assert [row.time for row in rows] == found.time.tolist()


MISTAKES: dict[str, tuple[object, str]] = {
    "a column that is called otherwise": (
        {"time": [0.0], "Pump": [1.0], "level": [1.0]},
        "the recording: no column 'pump' .input drive.; found: time, Pump, level. Did you mean 'Pump'",
    ),
    "lengths": ({"time": [0, 1], "pump": [1, 2], "level": [1]}, "column 'level' has 1 values, others 2"),
    "no rows": ({"time": [], "pump": [], "level": []}, "there is no row"),
    "a number": ({"time": 0, "pump": [1], "level": [1]}, "column 'time' is one value. Give one value for each row"),
    "a matrix": ({"time": [0], "pump": np.ones((1, 2)), "level": [1]}, r"'pump' is an array of shape \(1, 2\)"),
    "text": ({"time": [0], "pump": ["on"], "level": [1]}, "'pump' .input drive. holds text, such as 'on'"),
    "commas": ({"time": [0], "pump": ["1,5"], "level": [1]}, "'pump' is '1,5'. Decimal commas"),
    "dates": (
        pandas.DataFrame({"time": [0], "pump": TIMES[:1], "level": [1]}),
        "'pump' .input drive. holds a timestamp",
    ),
    "complex": ({"time": [0], "pump": [1j], "level": [1]}, "holds complex numbers"),
    "lists": ({"time": [0], "pump": [[1, 2]], "level": [1]}, "'pump' is an array"),
    "lists of several lengths": ({"time": [0, 1], "pump": [[1, 2], [1]], "level": [1, 1]}, "Give one value for each"),
    "structs": (pyarrow.table({"time": [0], "pump": [{"a": 1}], "level": [1]}), "'pump' holds neither numbers nor"),
    "a column twice": (pandas.DataFrame(np.ones((2, 4)), columns=["time", "pump", "pump", "level"]), "appears 2 times"),
    "a list": ([1, 2], "list: this is no recording. Give a path, a data frame"),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_are_named(kind: str) -> None:
    """Who gives something else is told the column, and what is expected."""
    given, message = MISTAKES[kind]
    with pytest.raises(RecordingError, match=message):
        block(given)


def test_only_columns_of_the_model_are_read() -> None:
    """A column that the model does not name may hold anything."""
    frame = pandas.DataFrame({"time": [0.0], "pump": [1.0], "level": [1.0], "strange": [object()]})
    assert block(frame).u.tolist() == [[1.0]]
    asked: list[int] = []

    def column(place: int) -> Any:
        asked.append(place)
        return np.zeros(1)

    list(read_blocks(MemoryTable("the table", ["a", "time", "b", "pump", "level"], column), columns()))
    assert {*asked} == {1, 3, 4}


def test_what_arrow_gives_is_let_go() -> None:
    """A table that was read leaves nothing of it behind."""
    before = pyarrow.total_allocated_bytes()
    for _ in range(20):
        block(pyarrow.table({"time": np.arange(1e4), "pump": np.arange(1e4), "level": np.arange(1e4)}))
    assert pyarrow.total_allocated_bytes() <= before
