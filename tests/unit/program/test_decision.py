"""A person decides of a run that the generated program keeps, without Python."""

import json
import subprocess
import time
from collections.abc import Callable
from pathlib import Path

import pytest

from faultbond.cli import main
from made import EXAMPLES
from watching import Said, difference, example_of, ran, watched

Programs = Callable[[str], Path]
LINES = (EXAMPLES / "rc" / "fault_capacitor.csv").read_bytes().splitlines(keepends=True)
ALARMED = b"".join(LINES[:1080])
REST = b"".join([LINES[0], *LINES[1080:1400]])


@pytest.fixture
def states(programs: Programs, tmp_path: Path) -> tuple[str, str]:
    """The same run in alarm, kept by the program and by Python."""
    own, other = str(tmp_path / "own"), str(tmp_path / "python")
    watched(programs("rc"), ALARMED, "--state", own)
    ran(example_of("rc"), ALARMED, "--state", other)
    return own, other


def decided(states: tuple[str, str], programs: Programs, tmp_path: Path, verb: str, *names: str) -> Said:
    """Decide the same in both files, compare what is said, and what the run says that goes on; give the former."""
    said = watched(programs("rc"), b"", "--state", states[0], verb, *names)
    told = tmp_path / "told.jsonl"
    assert main([verb, str(example_of("rc")), states[1], *names, "--json", str(told)]) == said.code == 0
    for one, line in zip(said.records, told.read_text().splitlines(), strict=True):
        assert difference(one, json.loads(line)) == ""
    after = watched(programs("rc"), REST, "--state", states[0]), ran(example_of("rc"), REST, "--state", states[1])
    assert [difference(a, b) for a, b in zip(after[0].records, after[1].records, strict=True)] == [""] * len(
        after[0].out
    )
    return said


@pytest.mark.parametrize("names", [(), ("C",), ("C", "--repaired")])
def test_a_candidate_is_accepted(
    states: tuple[str, str], programs: Programs, tmp_path: Path, names: tuple[str, ...]
) -> None:
    """The best candidate, one that is named, or one that is mended, as the verb `accept` takes it."""
    said = decided(states, programs, tmp_path, "accept", *names)
    assert [record["record"] for record in said.records] == ["accepted"]
    assert said.records[0]["repaired"] == ("--repaired" in names)


def test_a_candidate_is_rejected(states: tuple[str, str], programs: Programs, tmp_path: Path) -> None:
    """One that is ruled out is gone, the diagnosis that is left is told, and it cannot be ruled out again."""
    said = decided(states, programs, tmp_path, "reject", "R")
    assert [record["record"] for record in said.records] == ["rejected", "diagnosis"]


def test_what_cannot_be_decided_is_said(
    states: tuple[str, str], programs: Programs, capsys: pytest.CaptureFixture[str]
) -> None:
    """A name that no candidate has, one that is gone, and a run without an alarm are told in one line, as by Python."""
    program, state = programs("rc"), states[0]
    before = Path(state).read_bytes()
    for names, words in (
        (("accept", "nobody"), "nobody: nothing that is suspected is called so. There are R, C, V_C, V.\n"),
        (("accept", "v_x"), "v_x: nothing that is suspected is called so. Did you mean V_C?\n"),
        (
            ("reject", "C,nobody.bias", "v_x"),
            "nobody, v_x: nothing that is suspected is called so. Did you mean V_C?\n",
        ),
        (("accept", "R,C"), "R, C: no candidate has just these components. Name those of one candidate of the diag"),
        (("reject",), "watch: reject: name the parts of a candidate"),
    ):
        said = watched(program, b"", "--state", state, *names)
        assert (said.code, said.out) == (2, ())
        assert said.err.startswith(words)
        assert said.err.count("\n") == 1
        if len(names) > 1:
            assert main([names[0], str(example_of("rc")), states[1], *names[1:]]) == 2
            assert capsys.readouterr().err == said.err
    assert Path(state).read_bytes() == before
    assert watched(program, b"", "--state", state, "accept").code == 0
    said = watched(program, b"", f"--state={state}", "accept")
    assert (said.code, said.err) == (2, "There is no alarm to explain, so nothing to accept or reject.\n")


@pytest.mark.parametrize("verb", [("accept",), ("accept", "C", "--repaired"), ("reject", "R")])
def test_a_run_that_goes_on_heeds_what_is_decided_in_its_file(
    verb: tuple[str, ...], programs: Programs, tmp_path: Path
) -> None:
    """A decision in the file of a running program is done at its next row, told as a record, and not written over."""
    program, state = programs("rc"), tmp_path / "state"
    command = [str(program), "--state", str(state)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE) as running:
        assert running.stdin is not None
        assert running.stdout is not None
        running.stdin.write(ALARMED)
        running.stdin.flush()
        begun = [json.loads(running.stdout.readline()) for _ in range(3)]
        assert [record["record"] for record in begun] == ["run", "detection", "diagnosis"]
        deadline = time.monotonic() + 20.0
        while not state.exists():
            assert time.monotonic() < deadline
            time.sleep(0.01)
        decided = watched(program, b"", "--state", str(state), *verb).records[0]
        running.stdin.write(LINES[1080])
        running.stdin.flush()
        told = json.loads(running.stdout.readline())
        while told["record"] == "diagnosis":  # of the rows before
            told = json.loads(running.stdout.readline())
        running.stdin.close()
        rest = [json.loads(line) for line in running.stdout]
    for key in ("record", "components", "by"):  # its kind may be another one by now
        assert told[key] == decided[key]
    assert told.get("repaired") == decided.get("repaired")
    again = watched(program, b"", "--state", str(state), *verb)
    assert again.code == 2  # nothing is open any more, or the same is ruled out already
    left = [record for record in rest if record["record"] == "diagnosis"]
    assert bool(left) == (verb[0] == "reject")
    assert not any(
        "R" in item["parameters"] and item["probability"] for record in left for item in record["candidates"]
    )
