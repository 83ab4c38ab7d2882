"""The generated program as a text: clean in C and C++ for every sort of model, and what it says to how it is called."""

import re
import subprocess
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import pytest

from driven import graph_of
from in_c import LANGUAGES, PROGRAM, WARNINGS
from made import EXAMPLES, spec_of
from watching import watched, write_texts

LONGEST = 60  # lines of a function
HEALTHY = EXAMPLES / "rc" / "healthy.csv"
FORBIDDEN = {"malloc", "calloc", "realloc", "free", "strdup", "alloca"}
Programs = Callable[[str], Path]


@pytest.mark.parametrize("name", ["no input", "no state", "reserve", "smooth"])
def test_every_sort_of_model_has_a_clean_program(name: str, tmp_path: Path) -> None:
    """No compiler has a word to say, in C99 and in C++17, also where inputs, states or names lack."""
    places = write_texts(graph_of(name), tmp_path)
    for language in LANGUAGES.values():
        command = [*language, *WARNINGS, "-fsyntax-only", *places, str(PROGRAM / "main.c")]
        done = subprocess.run(command, check=False, capture_output=True, text=True)
        assert (done.returncode, done.stderr) == (0, "")


def test_it_asks_for_no_memory(tmp_path: Path) -> None:
    """Nothing that the program calls gives memory; all of it is there from the start."""
    places = write_texts(graph_of("no state"), tmp_path)
    target = tmp_path / "main.o"
    subprocess.run(["gcc", "-std=c99", "-O0", *places, "-c", str(PROGRAM / "main.c"), "-o", str(target)], check=True)
    names = subprocess.run(["nm", "-u", str(target)], capture_output=True, text=True, check=True).stdout.split()
    assert "fwrite" in names
    assert not FORBIDDEN & set(names)


def test_functions_are_short() -> None:
    """No function of the program has more lines than a screen."""
    long: dict[str, int] = {}
    for file in sorted(PROGRAM.iterdir()):
        lines = file.read_text(encoding="utf-8").splitlines()
        for first, line in enumerate(lines):
            if line == "{":
                length = lines.index("}", first) - first
                long |= {f"{file.name}: {lines[first - 1]}": length} if length > LONGEST else {}
    assert long == {}


def test_help_and_version_are_told(programs: Programs) -> None:
    """Options, exit codes, the name of the model, its hash and the version are shown."""
    shown = watched(programs("rc"), b"", "--help")
    assert shown.code == 0
    assert {"--state", "--accept", "accept", "reject", "--repaired"} <= set(re.findall("[-a-z]+", "\n".join(shown.out)))
    version = watched(programs("rc"), b"", "--version")
    assert (version.code, version.err) == (0, "")
    assert re.fullmatch(
        rf'watch of "RC circuit", [0-9a-f]{{64}}, made by faultbond {spec_of("rc").version}', version.out[0]
    )


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (("--accept",), "--accept expects auto, or a probability from 0.5 to 1, such as 0.99"),
        (("--accept", "0.3"), "0.3: --accept expects auto"),
        (("--accept", "1.5"), "1.5: --accept expects auto"),
        (("--accept", "nan"), "nan: --accept expects auto"),
        (("--accept", "0.9x"), "0.9x: --accept expects auto"),
        (("--state",), "--state: name a file"),
        (("--accept=0.3",), "0.3: --accept expects auto"),
        (("--stat=x",), "--stat: there is no such argument. See --help."),
        (("rows.csv",), "rows.csv: there is no such argument. See --help."),
        (("--repaired",), "--repaired: there is no such argument. See --help."),
        (("accept",), "--state: name the file that keeps the run"),
    ],
)
def test_a_mistake_in_the_command_is_told_in_one_line(
    programs: Programs, arguments: tuple[str, ...], words: str
) -> None:
    """What is wrong and what was expected; exit code 2, and no record."""
    said = watched(programs("rc"), HEALTHY.read_bytes(), *arguments)
    assert (said.code, said.out) == (2, ())
    assert words in said.err
    assert said.err.count("\n") == 1


def test_records_that_cannot_be_written_are_told(programs: Programs) -> None:
    """On a full disk the verdict stands, and how many records are lost is said; where nobody reads, it ends."""
    command = [programs("rc")]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, input=HEALTHY.read_bytes(), stdout=full, stderr=subprocess.PIPE, check=False)
    assert done.returncode == 0
    told = [
        f"faultbond: standard output: {words}."
        for words in ("records cannot be written: No space left on device", "2 records could not be written")
    ]
    assert done.stderr.decode().splitlines() == told
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.PIPE) as running:
        assert running.stdout is not None
        assert running.stdin is not None
        assert running.stderr is not None
        running.stdout.close()
        with suppress(BrokenPipeError):
            running.stdin.write(HEALTHY.read_bytes())
            running.stdin.close()
        assert running.stderr.read() == b""
    assert running.returncode == 141
