"""A run of the generated program that is kept in a file goes on as if it had not ended."""

import json
import signal
import subprocess
import time
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from made import EXAMPLES
from watching import Said, assert_same, example_of, ran, watched

Programs = Callable[[str], Path]
TOLD = ("detection", "diagnosis", "accepted")
REFUSED = (
    "this is not a state that this program saved, or it is damaged. Name another file, or delete it to begin anew."
)
LINES = (EXAMPLES / "rc" / "fault_capacitor.csv").read_bytes().splitlines(keepends=True)[:1400]


def rows(first: int, last: int | None) -> bytes:
    """The header and some rows."""
    return b"".join([LINES[0], *LINES[1:][first:last]])


def in_parts(program: Path, state: Path, cuts: list[int]) -> list[Said]:
    """What is said to a recording that is cut at some rows, with its state kept between the parts."""
    state.unlink(missing_ok=True)
    ends = [0, *cuts, len(LINES)]
    options = ("--state", str(state), "--accept", "auto")
    return [watched(program, rows(a, b), *options) for a, b in pairwise(ends)]


@given(st.lists(st.integers(10, len(LINES) - 10), min_size=1, max_size=3, unique=True).map(sorted))
@settings(max_examples=6, deadline=None)
def test_a_recording_may_be_cut_anywhere(
    programs: Programs, tmp_path_factory: pytest.TempPathFactory, cuts: list[int]
) -> None:
    """Parts of a recording, one after the other, have the records of the whole, and end with its counts.

    Where a part ends while an alarm is open, its last diagnosis comes in addition.
    """
    whole = watched(programs("rc"), rows(0, None), "--accept", "auto")
    parts = in_parts(programs("rc"), tmp_path_factory.mktemp("kept") / "run.state", cuts)
    found = []
    for part in parts:
        told, end = part.of(*TOLD), part.records[-1]
        extra = told and json.loads(told[-1])["time"] == end["time"] and told[-1] not in whole.out
        found += told[:-1] if extra else told
    assert found == whole.of(*TOLD)
    assert parts[-1].records[-1] == whole.records[-1]
    assert [part.records[0]["continues"] for part in parts[1:]] == [part.records[-1]["time"] for part in parts[:-1]]


def test_a_cut_recording_is_as_that_of_run(programs: Programs, tmp_path: Path) -> None:
    """Each part has what `run --state` says to it, exit codes and the end too; the whole again has nothing new.

    One part ends where a diagnosis is due, which is not told twice.
    """
    for k, (first, last) in enumerate([(0, 900), (900, 1030), (1030, 1049), (1049, None), (0, None)]):
        kept = [("--state", str(tmp_path / name)) for name in ("own", "python")]
        one, other = (
            watched(programs("rc"), rows(first, last), *kept[0]),
            ran(example_of("rc"), rows(first, last), *kept[1]),
        )
        assert_same(one, other)
        assert one.code == (0, 1, 1, 1, 2)[k]


def test_a_stream_that_breaks_off_is_kept_up_to_there(programs: Programs, tmp_path: Path) -> None:
    """Its records end as those of `run`, and the rows after the fault in it go on from the last one before."""
    broken = rows(0, 1200) + b"1," + b"7" * 140_000 + b"\n" + rows(1200, 1210)
    for k, data in enumerate((broken, rows(1200, None))):
        kept = [("--state", str(tmp_path / name)) for name in ("own", "python")]
        one, other = watched(programs("rc"), data, *kept[0]), ran(example_of("rc"), data, *kept[1])
        assert_same(one, other)
        assert one.code == (2, 1)[k]
        assert one.records[-1]["samples"] == (1200, len(LINES) - 1)[k]


@pytest.fixture(scope="module")
def kept(programs: Programs, tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The file of a run in alarm."""
    state = tmp_path_factory.mktemp("kept") / "run.state"
    assert watched(programs("rc"), rows(0, 1060), "--state", str(state)).code == 1
    return state.read_bytes()


@given(st.data())
@settings(max_examples=25, deadline=None)
def test_a_damaged_file_is_refused(
    programs: Programs, kept: bytes, tmp_path_factory: pytest.TempPathFactory, data: st.DataObject
) -> None:
    """A file with another byte, without an end, or with more, is refused in one line, and stays as it is."""
    at = data.draw(st.one_of(st.integers(0, 2000), st.integers(0, len(kept) - 1)))
    turned = kept[:at] + bytes([kept[at] ^ data.draw(st.integers(1, 255))]) + kept[at + 1 :]
    damaged = data.draw(st.sampled_from([turned, kept[:at], kept + b"\0"]))
    state = tmp_path_factory.mktemp("kept") / "run.state"
    state.write_bytes(damaged)
    said = watched(programs("rc"), rows(1060, None), "--state", str(state))
    other = "it was saved with another model, or another form of this one."
    assert said.err in (
        f"{state}: {REFUSED}\n",
        f"{state}: {other} Take the program that saved it, or delete it to begin anew.\n",
    )
    assert (said.code, said.out, state.read_bytes()) == (2, (), damaged)


def test_the_file_of_another_model_is_refused(programs: Programs, kept: bytes, tmp_path: Path) -> None:
    """The program of one model does not go on from a run of another."""
    state = tmp_path / "run.state"
    state.write_bytes(kept)
    said = watched(programs("rlc"), b"", "--state", str(state))
    assert said.code == 2
    assert "it was saved with another model" in said.err


def test_a_file_that_cannot_be_written_is_told_first(programs: Programs, tmp_path: Path) -> None:
    """Where no file can be, the program says so before it reads a row."""
    state = tmp_path / "nowhere" / "run.state"
    said = watched(programs("rc"), rows(0, None), "--state", str(state))
    assert (said.code, said.out) == (2, ())
    assert said.err == f"{state}: no run can be kept there: No such file or directory. Name another file.\n"


def begun(program: Path, state: Path) -> "subprocess.Popen[bytes]":
    """A program that has taken rows up to after an alarm, and waits for more."""
    running = subprocess.Popen(
        [program, "--state", state], stdin=subprocess.PIPE, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL
    )
    assert running.stdin is not None
    running.stdin.write(rows(0, 1060))
    running.stdin.flush()
    patience = time.monotonic() + 60.0
    while not state.exists():
        assert time.monotonic() < patience
        time.sleep(0.02)
    return running


def test_a_run_that_is_killed_goes_on_from_its_alarm(programs: Programs, tmp_path: Path) -> None:
    """The file is written at the alarm, so that after a kill the same rows, given again, have the same diagnoses."""
    state = tmp_path / "run.state"
    running = begun(programs("rc"), state)
    running.kill()
    running.communicate()
    again = watched(programs("rc"), rows(0, None), "--state", str(state))
    whole = watched(programs("rc"), rows(0, None))
    told = again.of("detection", "diagnosis")
    assert len(told) > 2
    assert whole.of("detection", "diagnosis")[-len(told) :] == told
    assert [item.name for item in tmp_path.iterdir()] == ["run.state"]


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM, signal.SIGHUP])
def test_a_signal_ends_a_run_in_order(programs: Programs, tmp_path: Path, number: signal.Signals) -> None:
    """A program that is asked to stop while it waits writes its end, keeps the run, and tells the signal."""
    state = tmp_path / "run.state"
    running = begun(programs("rc"), state)
    running.send_signal(number)
    out = running.communicate()[0].decode().splitlines()
    assert running.returncode == 128 + number
    assert json.loads(out[-1])["record"] == "end"
    assert json.loads(out[-2])["record"] == "diagnosis"
    rest = watched(programs("rc"), rows(0, None), "--state", str(state))
    whole = watched(programs("rc"), rows(0, None))
    samples = json.loads(out[-1])["samples"]
    assert 1000 < samples <= 1060
    assert rest.records[-1]["samples"] == whole.records[-1]["samples"]
    assert rest.of("diagnosis")[-3:] == whole.of("diagnosis")[-3:]
