"""Sensors and inputs without values, and rows out of order: said, and no plant is called healthy that nobody saw."""

import json
import re
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond import run
from faultbond.app.presence import HARDLY, LEAST_SILENCE, SHARE_OF_SILENCE, Presence
from faultbond.cli import main
from faultbond.contract.silence import SENSOR, seconds
from made import EXAMPLES

MODEL = str(EXAMPLES / "dc_motor_current" / "model.yaml")
ROWS = 900
Rows = list[list[str]]


def rows_of(count: int = ROWS) -> tuple[list[str], Rows]:
    """Give the header and some rows of the motor whose current is measured: time, V, omega, i."""
    recording = (EXAMPLES / "dc_motor_current" / "healthy.csv").read_text().splitlines()
    header, *rows = [line.split(",") for line in recording[: count + 1]]
    return header, rows


def recording_in(folder: Path, rows: Rows) -> str:
    """Write a recording, and give its name."""
    path = folder / "recording.csv"
    path.write_text("\n".join(map(",".join, [rows_of(0)[0], *rows])) + "\n")
    return str(path)


def without(rows: Rows, column: int, first: int, last: int) -> Rows:
    """Give rows of which some have no value in a column."""
    return [[*cells[:column], "", *cells[column + 1 :]] if first <= k < last else cells for k, cells in enumerate(rows)]


def end_of(folder: Path) -> dict[str, Any]:
    """Give the last record that a run has written into a folder."""
    record: dict[str, Any] = json.loads((folder / "records.jsonl").read_text().splitlines()[-1])
    return record


def test_a_sensor_that_never_reads_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The verdict says which sensors have watched; text, page, standard error and record say which has not."""
    recording, page = recording_in(tmp_path, without(rows_of()[1], 3, 0, ROWS)), tmp_path / "page.html"
    records = str(tmp_path / "records.jsonl")
    assert main(["run", MODEL, recording, "--json", records, "--report", str(page)]) == 0
    said, note = capsys.readouterr(), "he sensor i gave no value: what only it would show was not watched."
    told = " ".join(said.out.split())
    assert "No fault found by omega in 900 samples" in told
    assert f"T{note}" in told
    assert said.err == f"faultbond: t{note}\n"
    text = page.read_text()
    assert f"T{note}" in text
    assert 'class="verdict partial"' in text
    assert end_of(tmp_path)["silent"] == [{"name": "i", "role": "sensor", "values": 0, "since": None, "until": None}]


@pytest.mark.parametrize(
    ("column", "first", "last", "fact"),
    [
        (3, 300, ROWS, "the sensor i gave a value in 300 of 900 samples, none from 5.98 s on"),
        (3, 0, 700, "the sensor i gave a value in 200 of 900 samples, none before 14 s"),
        (3, 300, 500, "the sensor i gave a value in 700 of 900 samples, none from 5.98 s to 10 s"),
        (1, 600, ROWS, "the input V gave a value in 600 of 900 samples, none from 11.98 s on"),
    ],
)
def test_a_long_silence_is_told(
    column: int, first: int, last: int, fact: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A sensor or an input that begins late, ends early or is away for a while is told with the times."""
    main(["run", MODEL, recording_in(tmp_path, without(rows_of()[1], column, first, last)), "--json", "-"])
    assert f"faultbond: {fact}: " in capsys.readouterr().err


def test_values_missing_here_and_there_are_no_silence(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Half of the values missing, a sensor five times slower, and a gap of all rows are told by the counts alone."""
    chance = np.random.default_rng(1)
    rows = [[*cells[:2], cells[2] if chance.random() < 0.5 else "", cells[3] if not k % 5 else ""]
            for k, cells in enumerate(rows_of()[1])]  # fmt: skip
    records = str(tmp_path / "records.jsonl")
    assert main(["run", MODEL, recording_in(tmp_path, [*rows[:300], *rows[500:]]), "--json", records]) == 0
    assert (end_of(tmp_path)["silent"], capsys.readouterr().err) == ([], "")


@pytest.mark.parametrize("seed", range(3))
def test_presence_is_counted_alike_in_blocks_of_any_size(seed: int) -> None:
    """In blocks or one by one: values, and the longest silence, as they are found by looking at all samples."""
    chance = np.random.default_rng(seed)
    there = chance.random((700, 4)) < chance.choice([0.01, 0.05, 0.5, 1.0], 4)
    there[chance.integers(700) :, 0] = False
    time = np.cumsum(chance.random(700))
    told = []
    for size in (1, 7, 700):
        presence = Presence("abcd", SENSOR)
        for first in range(0, 700, size):
            presence.add(there[first : first + size], time[first : first + size])
        told.append(presence.silent(700))
    assert told[0] == told[1] == told[2]
    for k, name in enumerate("abcd"):
        places = [-1, *np.flatnonzero(there[:, k]), 700]
        longest = max(b - a - 1 for a, b in pairwise(places))
        is_silent = (len(places) - 2) * HARDLY < 700 or longest > max(LEAST_SILENCE, 700 / SHARE_OF_SILENCE)
        found = [item for item in told[0] if item.name == name]
        assert len(found) == is_silent
        for item in found:
            since = -1 if item.since is None else int(np.searchsorted(time, item.since))
            until = 700 if item.until is None else int(np.searchsorted(time, item.until))
            assert (item.values, until - since - 1) == (len(places) - 2, longest)
            assert item.sentence(seconds).startswith(f"the sensor {name} gave ")


def shuffled(rows: Rows) -> Rows:
    """Give rows in any order."""
    return [rows[k] for k in np.random.default_rng(2).permutation(len(rows))]


def in_two_clocks(rows: Rows) -> Rows:
    """Give rows of which every other has a date for a time."""
    return [
        [f"2026-05-01T10:00:{float(cells[0]):05.2f}Z" if k % 2 else cells[0], *cells[1:]]
        for k, cells in enumerate(rows)
    ]


@pytest.mark.parametrize("fault", [False, True])
@pytest.mark.parametrize("edit", [shuffled, in_two_clocks])
def test_rows_out_of_order_give_no_verdict(
    edit: Any, fault: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where many rows came too late to be used, nothing is said of the plant, alarm or not; the record counts them."""
    rows = [[*cells[:2], "30" if fault and k > 600 else cells[2], cells[3]] for k, cells in enumerate(rows_of()[1])]
    records = str(tmp_path / "records.jsonl")
    page = tmp_path / "report.html"
    assert main(["run", MODEL, recording_in(tmp_path, edit(rows)), "--json", records, "--report", str(page)]) == 4
    said, dropped = capsys.readouterr(), end_of(tmp_path)["dropped"]
    assert dropped > 400
    told = f"o verdict: {dropped} of 900 rows came too late to be used; sort the rows by time."
    assert f"N{told}" in " ".join(said.out.split())
    assert f"faultbond: n{told}\n" in said.err
    for text in (said.out, page.read_text()):
        assert not any(word in text for word in ("Fault detected", "Most likely", "Diagnosis", "Detected at"))


def test_in_python_rows_out_of_order_name_nothing() -> None:
    """A result without a verdict says so where it is shown, and shows no candidates, although there was an alarm."""
    header, rows = rows_of()
    bent = shuffled([[*cells[:2], "30" if k > 600 else cells[2], cells[3]] for k, cells in enumerate(rows)])
    result = run(MODEL, {name: [float(row[k]) for row in bent] for k, name in enumerate(header)})
    assert result.detection is not None
    assert repr(result) == "<Result of 'DC motor with current': none>"
    assert "No verdict." in result._repr_html_()
    assert "<td>" not in result._repr_html_()


def cut(rows: Rows) -> Rows:
    """Give rows of which only whole seconds are told."""
    return [[str(int(float(cells[0]))), *cells[1:]] for cells in rows]


def test_times_that_are_cut_to_whole_seconds_give_no_verdict(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A line says how many rows are of no use, and what to do; with `time: none` they all are of use."""
    recording = recording_in(tmp_path, cut(rows_of()[1]))
    assert main(["run", MODEL, recording]) == 4
    told = "882 of 900 rows have the time of another row, as where times are cut to whole seconds;"
    cure = "write times with all their digits, or, of rows at even steps, state `time: none` in the model file."
    said = capsys.readouterr()
    assert f"No verdict: {told} {cure}" in " ".join(said.out.split())
    assert said.err == f"faultbond: no verdict: {told} {cure}\n"
    assert main(["check", MODEL, "--data", recording]) == 2
    assert capsys.readouterr().err == f"{recording}: {told} {cure}\n"
    counted = tmp_path / "counted.yaml"
    counted.write_text(Path(MODEL).read_text().replace("sample_time:", "time: none\nsample_time:", 1))
    assert main(["run", str(counted), recording, "--json", str(tmp_path / "records.jsonl")]) == 0
    assert (end_of(tmp_path)["samples"], end_of(tmp_path)["duplicate"]) == (900, 0)


def test_rows_of_one_second_are_no_harm_where_samples_are_a_second(tmp_path: Path) -> None:
    """The first row of each sample serves it, as where the other ones lie between samples; of a few repeats alike."""
    slow = tmp_path / "slow.yaml"
    slow.write_text(Path(MODEL).read_text().replace("sample_time: 0.02 s", "sample_time: 1 s", 1))
    recording = recording_in(tmp_path, cut(rows_of(3000)[1]))
    assert main(["run", str(slow), recording]) == 0
    rows = rows_of()[1]
    assert main(["run", MODEL, recording_in(tmp_path, [*rows, *rows[-400:]])]) == 0


def test_a_few_late_rows_do_no_harm(tmp_path: Path) -> None:
    """Rows that are sorted in are none that are dropped, and one in a hundred that is dropped costs no verdict."""
    rows = rows_of()[1]
    late = [*rows[:100], rows[102], rows[100], rows[101], *rows[103:]]
    for place in range(800, 200, -100):
        late.insert(place, late.pop(place - 100))
    records = str(tmp_path / "records.jsonl")
    assert main(["run", MODEL, recording_in(tmp_path, late), "--json", records]) == 0
    assert (end_of(tmp_path)["late"], end_of(tmp_path)["dropped"]) == (8, 6)


@pytest.mark.parametrize("verb", ["check", "fit", "analyse", "simulate"])
def test_other_verbs_refuse_rows_out_of_order(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each of them needs the whole recording; a line says how many rows are of no use, and what to do."""
    recording, target = recording_in(tmp_path, shuffled(rows_of()[1])), str(tmp_path / "target")
    more = {
        "check": ["--data", recording],
        "fit": [recording, "-o", target],
        "analyse": ["--data", recording],
        "simulate": ["--inputs", recording, "-o", target],
    }
    assert main([verb, MODEL, *more[verb]]) == 2
    err = capsys.readouterr().err
    assert err.startswith(f"{recording}: ")
    assert err.endswith(" rows came too late to be used; sort the rows by time, or check the column of `time`.\n")
    assert err.count("\n") == 1


def test_check_names_the_column_that_gave_hardly_a_value(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`check --data` goes on with the rest, and names the recording and the column."""
    recording = recording_in(tmp_path, without(rows_of()[1], 3, 100, ROWS))
    assert main(["check", MODEL, "--data", recording]) == 0
    told = "column 'i': the sensor i gave a value in 100 of 900 samples, none from 1.98 s on."
    assert capsys.readouterr().err == f"faultbond: {recording}: {told}\n"


def stood(rows: Rows, first: int, last: int) -> Rows:
    """Give rows in which the current stays as it was at one of them."""
    return [[*cells[:3], rows[first][3]] if first <= k < last else cells for k, cells in enumerate(rows)]


@pytest.mark.parametrize(
    ("first", "last", "noise", "is_said"),
    [
        (200, 500, "50 A", True),
        (ROWS - 100, ROWS, "50 A", True),  # to the end
        (200, 280, "50 A", False),  # less than a tenth of the recording
        (200, 500, "0.1 mA", False),  # it does not resolve so small a noise
    ],
)
def test_a_sensor_that_stands_still_is_told(
    first: int, last: int, noise: str, is_said: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Where its noise is declared so large that no alarm comes, a fault hides there; the text says since when."""
    text = Path(MODEL).read_text(encoding="utf-8")
    model = tmp_path / "model.yaml"
    (line,) = (line for line in text.splitlines() if line.lstrip().startswith("i:") and "noise" in line)
    model.write_text(text.replace(line, re.sub(r"noise: [^,}]*", f"noise: {noise}", line)), encoding="utf-8")
    rows = stood(rows_of()[1], first, last)
    main(["run", str(model), recording_in(tmp_path, rows)])
    said = " ".join(capsys.readouterr().out.split())
    since, until = (f"{float(rows[k][0]):g} s" for k in (first, last - 1))
    told = f"the same to the last digit, from {since} to {until}: stuck, unless nothing moved then."
    assert (told in said) is is_said
    assert ("stuck, unless" in said) is is_said
