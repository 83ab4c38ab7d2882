"""Text where numbers belong is told, once for each column; what is written for no value is not."""

from pathlib import Path

import pytest

from faultbond.cli import main
from faultbond.io.memory_table import table_of
from faultbond.io.recording import Columns, columns_of, read_blocks, read_rows
from faultbond.io.text_cells import MOST, TextCells
from faultbond.model.text import load_model
from made import EXAMPLES

MODEL = EXAMPLES / "rc" / "model.yaml"
HEADER = ["time", "V", "V_C"]


def columns() -> Columns:
    """Give the columns of the circuit."""
    return columns_of(load_model(MODEL))


def rows_with(cells: dict[tuple[int, int], str], count: int = 900) -> list[list[str]]:
    """Give rows of the healthy circuit in which some cells, by line and column, hold something else."""
    lines = (EXAMPLES / "rc" / "healthy.csv").read_text().splitlines()[1 : count + 1]
    rows = [line.split(",") for line in lines]
    for (line, column), text in cells.items():
        rows[line - 2][column] = text
    return rows


def file_with(folder: Path, cells: dict[tuple[int, int], str]) -> str:
    """Write such rows as a recording, and give its name."""
    path = folder / "recording.csv"
    path.write_text("\n".join(map(",".join, [HEADER, *rows_with(cells)])) + "\n")
    return str(path)


TEXTS = {(40, 2): "n/a", (62, 1): " #REF! ", (90, 2): "bad", (95, 2): "3.2 V", (99, 0): "soon"}
TOLD = {
    "column 'V_C' (sensor V_C), line 40: 'n/a' is no number; it counts as missing, and so with 2 more cells of text "
    "there",
    "column 'V' (input V), line 62: '#REF!' is no number; it counts as missing",
    "column 'time', line 99: 'soon' is no time; its row is not used",
}


@pytest.mark.parametrize("read", [read_rows, read_blocks])
@pytest.mark.parametrize("quoted", ["", '"1.0"'])
def test_the_first_text_of_each_column_is_told(read: object, quoted: str, tmp_path: Path) -> None:
    """Row by row and many lines at once, the column, its role, the line and the text are named, with how many more."""
    path, found = file_with(tmp_path, TEXTS | ({(3, 1): quoted} if quoted else {})), TextCells()
    for _ in (read_blocks if read is read_blocks else read_rows)(path, columns(), found):
        pass
    assert set(found.sentences()) == TOLD


def test_what_is_written_for_no_value_is_silent(tmp_path: Path) -> None:
    """Empty cells, nan, null and inf are how loggers write that there is no value."""
    words = ["", "  ", "nan", "NaN", "-nan", "null", "NULL", "inf", "-Infinity", "1e999"]
    path, found = file_with(tmp_path, {(k + 5, 2): word for k, word in enumerate(words)}), TextCells()
    assert sum(map(len, read_blocks(path, columns(), found))) == 900
    assert found.sentences() == ()


def test_a_table_in_memory_tells_its_row() -> None:
    """Text among the values of a column in memory is told by its row."""
    rows = rows_with({(40, 2): "n/a"})
    table = table_of(
        {name: [float(x) if x != "n/a" else x for x in cells] for name, *cells in zip(HEADER, *rows, strict=True)}
    )
    found = TextCells("row")
    assert sum(map(len, read_blocks(table, columns(), found))) == 900
    assert found.sentences() == ("column 'V_C' (sensor V_C), row 39: 'n/a' is no number; it counts as missing",)


def test_of_many_columns_the_first_are_told() -> None:
    """Of more columns than are worth a line each, it is said how many they are."""
    found = TextCells()
    for k in range(MOST + 3):
        found.add(f"c{k}", "sensor s", 2, "m3/s")
    assert len(found.sentences()) == MOST + 1
    assert found.sentences()[-1] == "so with 3 more columns"


@pytest.mark.parametrize("verb", ["run", "fit", "check"])
def test_the_verbs_say_it_once(verb: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`run` says it in its text, and all say it once on standard error."""
    path = file_with(tmp_path, TEXTS)
    more = {"run": [path], "fit": [path, "-o", str(tmp_path / "fitted.yaml")], "check": ["--data", path]}
    assert main([verb, str(MODEL), *more[verb]]) == 0
    said = capsys.readouterr()
    before = "" if verb == "run" else f"{path}: "
    for told in TOLD:
        assert said.err.count(f"faultbond: {before}{told}.\n") == 1
        assert (f"{told[0].upper()}{told[1:]}." in " ".join(said.out.split())) is (verb == "run")


def test_a_network_without_time_says_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """So does a run on observations that stand by themselves."""
    folder = EXAMPLES / "thesis"
    header, *rows = (folder / "fig_3_7.csv").read_text().splitlines()
    path = tmp_path / "rows.csv"
    path.write_text("\n".join([header, *rows, ",".join(["1"] * header.count(",") + ["off"])]) + "\n")
    main(["run", str(folder / "fig_3_7.yaml"), str(path)])
    assert f"line {len(rows) + 2}: 'off' is no number" in capsys.readouterr().err
