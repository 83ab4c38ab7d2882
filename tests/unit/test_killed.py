"""Runs that are killed or stopped: what they recorded is in their file once, and they go on where they were kept."""

import json
import os
import random
import signal
import subprocess
import sys
import threading
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from faultbond.app import course, signals
from faultbond.app.signals import Stopped, Stopping
from faultbond.cli import main
from faultbond.io.grid import PointBlock
from faultbond.io.out import open_out
from faultbond.io.record_file import Mark, RecordFile
from faultbond.io.saved import read_saved

MODEL = Path(__file__).parents[2] / "examples" / "rc" / "model.yaml"
ROWS = 900  # at 50 Hz; C changes at 2 s, R at 9 s
KILLS = int(os.environ.get("FAULTBOND_KILLS", "6"))
PROGRAM = [sys.executable, "-m", "faultbond"]


@pytest.fixture(autouse=True)
def signals_are_heard() -> Iterator[None]:
    """What a shell starts in the background ignores some signals, and so does all that it starts; here they count."""
    before = [signal.signal(signal.SIGINT, signal.default_int_handler), signal.signal(signal.SIGHUP, signal.SIG_DFL)]
    yield
    for number, handler in zip((signal.SIGINT, signal.SIGHUP), before, strict=True):
        signal.signal(number, handler)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a recording in which two parameters change one after the other."""
    place = tmp_path_factory.mktemp("killed")
    rows = [f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS)]
    (place / "inputs.csv").write_text("\n".join(["time,V", *rows]) + "\n")
    faults = ["--fault", "C=160@2", "--fault", "R=x1.6@9"]
    common = ["simulate", str(MODEL), "--inputs", str(place / "inputs.csv"), "--seed", "1", *faults]
    assert main([*common, "-o", str(place / "two.csv")]) == 0
    return place / "two.csv"


def command(recording: str, folder: Path, *options: str) -> list[str]:
    """Give the command of a run that is kept."""
    kept = ["--state", str(folder / "x.state"), "--json", str(folder / "x.jsonl")]
    return [*PROGRAM, "run", str(MODEL), recording, "--accept", "auto", *kept, *options]


def records(path: Path) -> list[dict[str, Any]]:
    """Give the records of a file, each line of which is one."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def found(told: Sequence[dict[str, Any]]) -> Counter[str]:
    """Give what was found, without the records with which every start begins and ends."""
    return Counter(json.dumps(record) for record in told if record["record"] not in ("run", "end"))


def fed_and_killed(rows: Sequence[str], folder: Path, chance: random.Random) -> None:
    """Feed rows to a run and kill it somewhere on the way, or just after they were taken."""
    before = (folder / "x.jsonl").stat().st_size if (folder / "x.jsonl").exists() else 0
    process = subprocess.Popen(command("-", folder), stdin=subprocess.PIPE, stdout=subprocess.DEVNULL)
    assert process.stdin is not None
    part = rows[: chance.randrange(2, len(rows) + 1)]
    killer = threading.Timer(chance.choice([0.3, 1.0, 1.5, 2.5]) * chance.random() + 0.3, process.kill)
    try:
        process.stdin.write("".join(part).encode())
        process.stdin.flush()
        killer.start()
    except BrokenPipeError:
        pass
    process.wait()
    killer.cancel()
    process.stdin.close()
    assert process.returncode == -signal.SIGKILL
    if before:
        assert (folder / "x.jsonl").stat().st_size > 0


def test_what_a_killed_run_recorded_is_there_once(recording: Path, tmp_path: Path) -> None:
    """However often a run is killed, when all rows were given no record is lost and none is there twice."""
    chance = random.Random(3)  # noqa: S311 - no secret
    lines = recording.read_text().splitlines(keepends=True)
    assert main(["run", str(MODEL), str(recording), "--accept", "auto", "--json", str(tmp_path / "whole.jsonl")]) == 1
    expected = found(records(tmp_path / "whole.jsonl"))
    assert sum(expected.values()) > 10
    for round_ in range(KILLS):
        state = tmp_path / "x.state"
        rows = lines
        if state.exists() and chance.random() < 0.5:  # the rows after those that were kept, or all of them again
            last = read_saved(state).clock.last_time
            rows = [lines[0], *(line for line in lines[1:] if float(line.split(",")[0]) > last + 1e-9)]
        if len(rows) > 3:
            fed_and_killed(rows, tmp_path, chance)
        if chance.random() < 0.2 or round_ == KILLS - 1:  # to the end, and from the beginning again
            finish(recording, tmp_path, expected)
    finish(recording, tmp_path, expected)


def finish(recording: Path, folder: Path, expected: Counter[str]) -> None:
    """Give the whole recording to the run, compare, and take away what it kept."""
    done = subprocess.run(
        command(str(recording), folder), stdout=subprocess.DEVNULL, stderr=subprocess.PIPE, check=False
    )
    told = records(folder / "x.jsonl")
    assert found(told) == expected, done.stderr
    assert (told[0]["record"], told[-1]["record"]) == ("run", "end")
    (folder / "x.state").unlink()


@pytest.mark.parametrize(
    ("number", "code"),
    [(signal.SIGINT, 130), (signal.SIGTERM, 143), (signal.SIGHUP, 129)],
    ids=["INT", "TERM", "HUP"],
)
def test_signals_end_a_run_in_order(number: signal.Signals, code: int, recording: Path, tmp_path: Path) -> None:
    """A live run that is stopped writes its `end`, is kept up to its last row, goes on from there, and says nothing."""
    lines = recording.read_text().splitlines(keepends=True)
    with subprocess.Popen(command("-", tmp_path), stdin=subprocess.PIPE, stderr=subprocess.PIPE) as process:
        assert process.stdin is not None
        assert process.stderr is not None
        process.stdin.write("".join(lines[:201]).encode())
        process.stdin.flush()
        wait_until_read(tmp_path / "x.jsonl", "diagnosis")
        process.send_signal(number)
        assert process.wait(30) == code
        assert process.stderr.read() == b""
    told = records(tmp_path / "x.jsonl")
    assert told[-1]["record"] == "end"
    assert told[-1]["samples"] == read_saved(tmp_path / "x.state").clock.counts.samples
    assert subprocess.run(command(str(recording), tmp_path), stdout=subprocess.DEVNULL, check=False).returncode == 1
    told = records(tmp_path / "x.jsonl")
    assert [item["record"] for item in told if item["record"] != "diagnosis"] == [
        *("run", "detection", "end", "run", "accepted", "detection", "end")
    ]


def wait_until_read(path: Path, kind: str) -> None:
    """Wait for a kind of record in a file."""
    for _ in range(1500):
        if path.exists() and f'"{kind}"' in path.read_text():
            return
        threading.Event().wait(0.02)
    pytest.fail(f"no {kind}")


def test_a_file_that_is_watched_can_be_stopped(
    recording: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Ctrl-C while a file is read waits until a block of rows has been taken, and tells what was found by then."""
    taken = course.Course.take

    def take(self: course.Course, points: PointBlock) -> None:
        if points.index[0] <= 300 <= points.index[-1]:
            os.kill(os.getpid(), signal.SIGINT)
        taken(self, points)

    monkeypatch.setattr(course.Course, "take", take)
    assert main(command(str(recording), tmp_path)[3:]) == 130
    end = records(tmp_path / "x.jsonl")[-1]
    assert end["record"] == "end"
    assert read_saved(tmp_path / "x.state").clock.counts.samples == end["samples"] > 300
    told = capsys.readouterr()
    assert f"Samples  {end['samples']}," in told.out
    assert "Fault detected at " in told.out
    assert told.err.endswith("faultbond: stopped: the rows that follow were not looked at.\n")
    monkeypatch.undo()
    assert main(command(str(recording), tmp_path)[3:]) == 1
    assert records(tmp_path / "x.jsonl")[-1]["samples"] == ROWS


@pytest.mark.parametrize(
    "called", [PROGRAM, [str(Path(sys.executable).with_name("faultbond"))]], ids=["module", "script"]
)
@pytest.mark.parametrize("delay", [0.1, 0.2, 0.4, 0.8, 1.2])
def test_ctrl_c_while_it_starts_is_quiet(called: list[str], delay: float, recording: Path, tmp_path: Path) -> None:
    """While modules are loaded and an engine is compiled Ctrl-C ends the program without a word, and leaves nothing."""
    words = [*called, *command("-", tmp_path)[3:]]
    cache = {"FAULTBOND_CACHE": str(tmp_path / "cache")}
    with subprocess.Popen(words, stdin=subprocess.PIPE, stderr=subprocess.PIPE, env=os.environ | cache) as process:
        assert process.stderr is not None
        if delay == 0.1:  # as soon as the package is being loaded
            wait_for_module(process.pid)
        else:
            threading.Event().wait(delay)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) in (130, -signal.SIGINT)
        assert process.stderr.read() == b""
    assert not (tmp_path / "x.state").exists()


def wait_for_module(number: int) -> None:
    """Wait until a program has loaded numpy, with which the package begins."""
    for _ in range(3000):
        if "numpy" in Path(f"/proc/{number}/maps").read_text():
            return
        threading.Event().wait(0.002)
    pytest.fail("it does not start")


def test_a_signal_that_a_library_swallows_ends_the_run() -> None:
    """What was raised while a library was loaded, and caught there, is raised again before the first row is taken."""
    with Stopping():
        with suppress(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
        with Stopping() as inner, pytest.raises(Stopped):
            next(inner.between(iter([1])))


def test_a_signal_that_comes_twice_at_once_is_one(monkeypatch: pytest.MonkeyPatch) -> None:
    """`timeout` sends it to a program and to its group, which is no hurry; somebody who insists takes longer."""
    with Stopping() as stopping:
        with pytest.raises(Stopped):
            os.kill(os.getpid(), signal.SIGTERM)
        os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Stopped):
            os.kill(os.getpid(), signal.SIGINT)
        assert stopping.noted == signal.SIGTERM
        with Stopping():  # as when the first one has unwound what was inside
            os.kill(os.getpid(), signal.SIGTERM)
        clock = iter((0.3, 0.4, 0.6))  # s after the first
        first = stopping._came[signal.SIGTERM]
        monkeypatch.setattr(signals, "monotonic", lambda: first + next(clock))
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGTERM)
        with pytest.raises(Stopped):  # a burst does not put off who insists
            os.kill(os.getpid(), signal.SIGTERM)


def test_a_signal_that_is_ignored_stays_so(recording: Path, tmp_path: Path) -> None:
    """Under `nohup` a run goes on when its terminal is closed."""
    words = command("-", tmp_path)
    quiet = "import os, signal, sys; signal.signal(signal.SIGHUP, signal.SIG_IGN); os.execv(sys.argv[1], sys.argv[1:])"
    with subprocess.Popen([sys.executable, "-c", quiet, *words], stdin=subprocess.PIPE) as process:
        assert process.stdin is not None
        process.stdin.writelines(recording.read_bytes().splitlines(keepends=True)[:100])
        process.stdin.flush()
        wait_until_read(tmp_path / "x.jsonl", "run")
        process.send_signal(signal.SIGHUP)
        process.stdin.writelines(recording.read_bytes().splitlines(keepends=True)[100:])
        process.stdin.close()
        assert process.wait(60) == 1


# The file of records of runs that go on from each other

LINES = [json.dumps({"record": "x", "k": k}) + "\n" for k in range(5)]


def written(path: Path, lines: Sequence[str], before: Mark | None = None, *, goes_on: bool = True) -> Mark:
    """Write lines as a run does, and give the mark after them."""
    told: list[str] = []
    file = RecordFile(path, told.append)
    if goes_on:
        file.go_on(before)
    for line in lines:
        file.write(line)
    file.settle()
    mark = file.mark()
    assert mark is not None
    file.close()
    path.with_suffix(".told").write_text("\n".join(told))
    return mark


def test_records_after_the_mark_are_not_written_twice(tmp_path: Path) -> None:
    """Lines that were written after the run was kept stay, one cut short goes, and the rest follows."""
    path = tmp_path / "r.jsonl"
    mark = written(path, LINES[:2], goes_on=False)
    with path.open("a") as stream:
        stream.write(LINES[2] + LINES[3][:9])
    again = written(path, LINES[2:], mark)
    assert path.read_text() == "".join(LINES)
    assert again.length == len("".join(LINES))
    assert path.with_suffix(".told").read_text() == ""
    path.rename(tmp_path / "moved")  # by another name it is still the same
    written(tmp_path / "moved", LINES[:1], again)
    assert (tmp_path / "moved").read_text() == "".join([*LINES, LINES[0]])
    assert (tmp_path / "moved.told").read_text() == ""


@pytest.mark.parametrize(
    ("there", "after", "told"),
    [
        (None, "", "the records of the runs before are gone"),
        ("", "", ""),
        (LINES[0], LINES[0], "it is not as the kept run left it"),
        (LINES[0] + LINES[1][:9], LINES[0], "it is not as the kept run left it"),
        ("a note of mine", "a note of mine\n", "it is not as the kept run left it"),
        (LINES[0] + LINES[4] + LINES[2], LINES[0] + LINES[4] + LINES[2], "it is not as the kept run left it"),
    ],
)
def test_a_file_that_is_not_as_it_was_left(there: str | None, after: str, told: str, tmp_path: Path) -> None:
    """Of a file that was cut, changed, replaced or taken away nothing more is lost, and it is said."""
    path = tmp_path / "r.jsonl"
    mark = written(path, LINES[:3], goes_on=False)
    path.unlink()
    if there is not None:
        path.write_text(there)
    written(path, [LINES[3]], mark)
    assert path.read_text() == after + LINES[3]
    assert told in path.with_suffix(".told").read_text()
    assert bool(told) == bool(path.with_suffix(".told").read_text())


def test_a_new_run_begins_its_file_anew(tmp_path: Path) -> None:
    """Without a kept run to go on from, records take the place of what was there."""
    path = tmp_path / "r.jsonl"
    path.write_text("old\n")
    with open_out(str(path), grows=True) as out:
        out.record({"record": "run"})
        assert path.read_text() == "old\n"
        out.settle()
        assert path.read_text() == '{"record": "run"}\n'


def test_a_decision_is_not_written_into_the_records_of_the_run(
    recording: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """`accept` refuses the file that the next run will go on in, writes another one, and the next run goes on."""
    rows = recording.read_text().splitlines(keepends=True)
    part = tmp_path / "part.csv"
    part.write_text("".join(rows[:300]))
    words = [word for word in command(str(part), tmp_path)[3:] if word not in ("--accept", "auto")]
    assert main(words) == 1
    decide = ["accept", str(MODEL), str(tmp_path / "x.state"), "C", "--json"]
    before = (tmp_path / "x.jsonl").read_bytes()
    assert main([*decide, str(tmp_path / "x.jsonl")]) == 2
    assert "there are the records of the run in" in capsys.readouterr().err
    assert (tmp_path / "x.jsonl").read_bytes() == before
    assert main([*decide, str(tmp_path / "decided.jsonl")]) == 0
    part.write_text("".join(rows))
    assert main(words) == 1
    kinds = [item["record"] for item in records(tmp_path / "x.jsonl") if item["record"] != "diagnosis"]
    assert kinds == ["run", "detection", "end", "run", "detection", "end"]
