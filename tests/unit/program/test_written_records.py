"""The generated program says what `run -` says, record by record."""

import re
from collections.abc import Callable
from pathlib import Path

import pytest

from made import EXAMPLES
from watching import assert_same, difference, example_of, ran, watched

FAULTS = {  # recordings, and how many of their rows: up to some diagnoses
    "tank": ("fault_pipe", 1570),
    "dc_motor": ("fault_winding", 1150),
    "dc_motor_current": ("fault_triple", 1045),
    "rc": ("fault_capacitor", 1100),
    "rlc": ("fault_capacitor", 940),
    "three_tank": ("fault_valve1", 202),
}
HEALTHY = 600
Programs = Callable[[str], Path]


def rows_of(name: str, recording: str, rows: int) -> bytes:
    """The header and some rows of a recording of a built-in plant."""
    lines = (EXAMPLES / name / f"{recording}.csv").read_bytes().splitlines(keepends=True)
    return b"".join(lines[: rows + 1])


@pytest.mark.parametrize("name", FAULTS)
def test_every_example_says_the_same(name: str, programs: Programs) -> None:
    """Of each built-in plant, its healthy recording has a run and an end, its faulty one all that `run` finds."""
    for (recording, count), code in ((("healthy", HEALTHY), 0), (FAULTS[name], 1)):
        rows = rows_of(name, recording, count)
        said = watched(programs(name), rows)
        assert_same(said, ran(example_of(name), rows))
        assert said.code == code
        assert len(said.of("diagnosis")) >= 2 * code


def test_what_a_rule_accepts_is_told(programs: Programs) -> None:
    """With --accept a diagnosis is accepted at the same sample, and the run goes on as it does in Python."""
    rows = rows_of("rc", "fault_capacitor", 1600)
    said = watched(programs("rc"), rows, "--accept", "auto")
    assert_same(said, ran(example_of("rc"), rows, "--accept", "auto"))
    assert len(said.of("accepted")) == 1


def test_rows_of_all_sorts_are_counted_alike(programs: Programs) -> None:
    """Late, repeated, untimed, absent and wild rows, and another order of columns, end in the same records."""
    lines = [line.split(",") for line in rows_of("rc", "healthy", 300).decode().splitlines()]
    columns = [[*reversed(line)] for line in lines]
    columns[40], columns[41] = columns[41], columns[40]
    columns[60] = columns[59]
    columns[80][-1], columns[90][0], columns[95][0] = "soon", "", "1e9"
    rows = "\n".join([*map(",".join, [*columns[:120], *columns[140:]]), ""]).encode()
    said = watched(programs("rc"), rows)
    assert_same(said, ran(example_of("rc"), rows))
    end = said.records[-1]
    assert min(end[name] for name in ("missing", "duplicate", "untimed", "wild")) > 0


@pytest.mark.parametrize(
    ("change", "code"),
    [
        (lambda lines: lines[:11], 4),  # too few
        (lambda lines: lines[:1], 2),
        (lambda lines: [], 2),
        (lambda lines: ["time,nothing", *lines[1:]], 2),
        (lambda lines: [lines[0], *(f"soon{line}" for line in lines[1:50])], 2),
        (lambda lines: [line.rpartition(",")[0] + (",i" if k == 0 else ",") for k, line in enumerate(lines)], 2),
        (lambda lines: [lines[0], *(line.rpartition(",")[0] + "," for line in lines[1:])], 4),
        (lambda lines: [lines[0], *(re.sub(",[^,]*,", ",,", line) for line in lines[1:])], 4),
    ],
)
def test_why_there_is_no_verdict_is_said_alike(
    change: Callable[[list[str]], list[str]], code: int, programs: Programs
) -> None:
    """Too few rows, no column, no time, an input or a sensor without values: the same words, and the same exit code."""
    rows = "\n".join([*change(rows_of("rc", "healthy", 300).decode().splitlines()), ""]).encode()
    said = watched(programs("rc"), rows)
    assert_same(said, ran(example_of("rc"), rows))
    assert said.code == code


def test_a_difference_is_seen() -> None:
    """What compares records sees another order of keys, another number, and another kind of value."""
    assert difference({"a": 1.0, "b": [1, 2]}, {"a": 1.0 + 1e-12, "b": [1, 2]}) == ""
    for other in ({"b": [1, 2], "a": 1.0}, {"a": 1.0, "b": [1, 3]}, {"a": 1, "b": [1, 2]}, {"a": 1.1, "b": [1, 2]}):
        assert difference({"a": 1.0, "b": [1, 2]}, other) != ""


def test_silent_signals_and_rows_out_of_order_are_told_alike(programs: Programs) -> None:
    """The program names what gives no value, and has no verdict of rows in any order, or of times that are cut."""
    header, *rows = rows_of("dc_motor_current", "healthy", 600).decode().splitlines()
    cells = [line.split(",") for line in rows]
    no_current = [",".join(line[:3]) + "," for line in cells]
    no_input = [f"{line[0]},{line[1] if k < 300 else ''},{line[2]},{line[3]}" for k, line in enumerate(cells)]
    turned = [rows[(k * 371) % 600] for k in range(600)]
    cut = [",".join([str(int(float(line[0]))), *line[1:]]) for line in cells]
    for lines, code in ((no_current, 0), (no_input, 0), (turned, 4), (cut, 4)):
        given = "\n".join([header, *lines, ""]).encode()
        said, expected = watched(programs("dc_motor_current"), given), ran(example_of("dc_motor_current"), given)
        assert_same(said, expected)
        assert (said.code, said.err) == (code, expected.err)
        assert said.err.count("\n") == 1
