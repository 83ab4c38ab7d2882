"""The tool of a generated project that compares records: what it asks of them, and what not."""

import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

COMPILER = shutil.which("gcc")
SOURCE = Path(str(files("faultbond"))) / "synthesis" / "templates" / "compare.c"
LINE = (
    '{"record": "diagnosis", "time": 2.5, "candidates": ['
    '{"components": ["a{"], "parameters": {"A": {"estimate": 3.25}}, "probability": 1.0}, '
    '{"components": ["b"], "parameters": {"B": {"estimate": 7.5}}, "probability": 2e-30}], "samples": 7}\n'
)

pytestmark = pytest.mark.skipif(COMPILER is None, reason="needs a C compiler")


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The tool, compiled."""
    made = tmp_path_factory.mktemp("compare") / "compare"
    subprocess.run([str(COMPILER), "-std=c99", "-Wall", "-Werror", str(SOURCE), "-lm", "-o", str(made)], check=True)
    return made


@pytest.mark.parametrize(
    ("found", "code"),
    [
        (LINE, 0),
        (LINE.replace("3.25", "3.250001"), 0),
        (LINE.replace("3.25", "3.2501"), 1),
        (LINE.replace('"a{"', '"c"'), 1),
        (LINE.replace("7.5", "8.5").replace("2e-30", "1e-28"), 0),
        (LINE.replace('"b"', '"c"').replace('"B"', '"C"'), 0),
        (LINE.replace("2e-30", "2e-3"), 1),
        (LINE.replace('"samples": 7', '"samples": 8'), 1),
        (LINE + LINE, 1),
    ],
)
def test_numbers_are_close_and_what_is_hopeless_is_passed_over(
    found: str, code: int, program: Path, tmp_path: Path
) -> None:
    """Digits count of what is likely, of what is not nothing does; texts and whole numbers are equal."""
    (tmp_path / "expected").write_text(LINE)
    (tmp_path / "found").write_text(found)
    told = [str(program), str(tmp_path / "expected"), str(tmp_path / "found"), "1e-6"]
    assert subprocess.run(told, capture_output=True, check=False).returncode == code
