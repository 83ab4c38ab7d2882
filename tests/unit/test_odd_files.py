"""Files as people have them: what is odd in one is said by its name, with what to do; nothing is taken in silence."""

from pathlib import Path

import pytest

from faultbond.app.rows import FEW
from faultbond.cli import main
from made import EXAMPLES

MODEL = EXAMPLES / "rc" / "model.yaml"
TEXT = MODEL.read_text()
HEADER, *LINES = (EXAMPLES / "rc" / "healthy.csv").read_text().splitlines()[:401]
ROWS = [line.split(",") for line in LINES]


def recording(folder: Path, rows: list[list[str]], header: str = HEADER, encoding: str = "utf-8") -> str:
    """Write a recording, and give its name."""
    path = folder / "odd.csv"
    path.write_bytes(("\n".join([header, *map(",".join, rows)]) + "\n").encode(encoding))
    return str(path)


def timed(factor: float) -> list[list[str]]:
    """Give the rows with other times."""
    return [[f"{factor * float(cells[0]):.9g}", *cells[1:]] for cells in ROWS]


def said_of(arguments: list[str], capsys: pytest.CaptureFixture[str]) -> tuple[int, str]:
    """Give the exit code, and what is said on standard error."""
    code = main(arguments)
    return code, capsys.readouterr().err


@pytest.mark.parametrize(
    ("header", "told"),
    [
        (
            "Time,V,V_C",
            "no column 'time' (time); found: Time, V, V_C. Did you mean 'Time'? State that as `column` in the",
        ),
        ('time,"V [V]",V_C', "found: time, V [V], V_C. Name it in the model file with `column`."),
        ("time,V,V_C,V_C", "column 'V_C' (sensor V_C) appears 2 times. Leave one of them."),
    ],
)
def test_a_header_is_told_with_what_to_do(
    header: str, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A column that is called otherwise, or is there twice, is named with the cure."""
    rows = [[*cells, *cells[2 : 2 + header.count(",") - 2]] for cells in ROWS]
    code, err = said_of(["run", str(MODEL), recording(tmp_path, rows, header)], capsys)
    assert (code, err.count("\n")) == (2, 1)
    assert told in err


@pytest.mark.parametrize("verb", ["run", "check"])
def test_a_date_that_cannot_be_read_is_shown(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where no row has a time, the first text in its place is shown with its line."""
    path = recording(tmp_path, [["05/01/2026 10:00", *cells[1:]] for cells in ROWS])
    code, err = said_of([verb, str(MODEL), *(["--data"] if verb == "check" else []), path], capsys)
    assert code == 2
    assert "before the year 9999: line 2 of 'time' has '05/01/2026 10:00'. Check the column and unit of `time`" in err


@pytest.mark.parametrize("verb", ["run", "check", "fit"])
@pytest.mark.parametrize(
    ("factor", "told"),
    [
        (
            0.1,
            "359 of 400 rows were not used: they are closer than sample_time, 0.02 s; if that is not meant, check it",
        ),
        (10.0, "there are 400 rows for 3991 samples: they are farther apart than sample_time, 0.02 s; if that is not"),
        (1.0, ""),
    ],
)
def test_rows_at_another_pace_are_told(
    verb: str, factor: float, told: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Times in another unit, or another sample time, show in how far rows stand apart; those as stated do not."""
    path = recording(tmp_path, timed(factor))
    more = {"run": [path], "check": ["--data", path], "fit": [path, "-o", str(tmp_path / "fitted.yaml")]}
    _, err = said_of([verb, str(MODEL), *more[verb]], capsys)
    assert told in err
    assert bool(told) is ("if that is not meant" in err)
    few = recording(tmp_path, timed(factor)[: FEW - 1])
    assert "if that is not meant" not in said_of(["run", str(MODEL), few], capsys)[1]


def test_rows_of_one_time_are_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where all rows have the same time it is that which is said, not that the recording ended early."""
    path = recording(tmp_path, [["5", *cells[1:]] for cells in ROWS])
    told = "399 of 400 rows have the time of another row"
    assert f"no verdict: {told}" in said_of(["run", str(MODEL), path], capsys)[1]
    code, err = said_of(["check", str(MODEL), "--data", path], capsys)
    assert (code, told in err) == (2, True)


@pytest.mark.parametrize("verb", ["run", "check"])
def test_rows_that_are_given_twice_are_told(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """They are no error, but they may be: of sensors that are written one a row all but one are lost."""
    told = "400 of 800 rows have the time of another row: of these the first counts; if that is not meant, check `time`"
    path = recording(tmp_path, [cells for cells in ROWS for _ in range(2)])
    assert told in said_of([verb, str(MODEL), *(["--data"] if verb == "check" else []), path], capsys)[1]
    few = recording(tmp_path, [*ROWS[:12], *ROWS[10:]])
    assert "the time of another row" not in said_of(["run", str(MODEL), few], capsys)[1]


def test_a_switch_that_is_a_word_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of `ON` and `OFF` it is said what to write."""
    path = recording(tmp_path, [[cells[0], "ON" if k % 2 else "Off", cells[2]] for k, cells in enumerate(ROWS)])
    assert "line 2: 'Off' is no number, write 1 or 0 for it; it counts" in said_of(["run", str(MODEL), path], capsys)[1]


def test_a_sensor_without_any_value_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where no sensor gave a value, the line names it; and no start is solved from what nobody saw."""
    path = recording(tmp_path, [[*cells[:2], "nan"] for cells in ROWS])
    code, err = said_of(["run", str(MODEL), path], capsys)
    assert (code, err) == (4, "faultbond: no verdict: no row has a value of the sensor V_C; check the column.\n")
    assert main(["simulate", str(MODEL), "--inputs", path, "-o", str(tmp_path / "out.csv")]) == 0
    assert "from the first rows" not in capsys.readouterr().out


def test_a_sensor_that_stands_is_no_matter_of_units(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A sensor that gives one value all the time is stuck; nobody is told that an input were in another unit."""
    code, err = said_of(["run", str(MODEL), recording(tmp_path, [[*cells[:2], "0"] for cells in ROWS])], capsys)
    assert (code, err) == (1, "")


def test_a_recording_whose_time_begins_again_has_its_length(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two parts that both begin at 0 are as long as both."""
    assert main(["run", str(MODEL), recording(tmp_path, ROWS[:200] + ROWS[:200])]) == 0
    assert "No fault found in 400 samples (8 s)." in capsys.readouterr().out


def test_another_encoding_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """UTF-16, as spreadsheets write text, is told as what it is not."""
    code, err = said_of(["run", str(MODEL), recording(tmp_path, ROWS, encoding="utf-16")], capsys)
    assert code == 2
    assert ":1: this is not text in UTF-8. Recordings are CSV or Parquet files; export a spreadsheet as CSV." in err


def test_a_tab_in_a_model_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """YAML takes no tabs; the line and the cure are named."""
    path = tmp_path / "model.yaml"
    path.write_text(TEXT.replace("  source:", "\tsource:"))
    line = TEXT[: TEXT.index("  source:")].count("\n") + 1
    assert said_of(["check", str(path)], capsys) == (
        2,
        f"{path}:{line}: not YAML: a tab begins the line; indent with blanks\n",
    )


def test_an_input_that_nothing_names_is_told(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`check` names an input that no law, sensor or condition uses, since its column is asked for, and no other."""
    path = tmp_path / "model.yaml"
    path.write_text(TEXT.replace("inputs: {V:", "inputs: {T: {unit: degC}, V:"))
    assert main(["check", str(path)]) == 0
    assert "unused T: no law, sensor or condition names it" in " ".join(capsys.readouterr().out.split())
    assert main(["check", str(MODEL)]) == 0
    assert "unused" not in capsys.readouterr().out
