"""What verbs write: nothing that is read is destroyed, nothing half written is left, and a disk may be full."""

import json
import os
import resource
import subprocess
import sys
import tempfile
import threading
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from faultbond.app import kept_run as keeping
from faultbond.app.rows import _count_lines
from faultbond.cli import main
from faultbond.io import files
from faultbond.io.cache import cache_folder
from faultbond.io.examples import example
from faultbond.io.out import Out, open_out
from faultbond.io.record_file import Mark, holds_records

RC = Path(__file__).parents[2] / "examples" / "rc"
ROWS = 1200  # the fault begins at row 1000
FULL = OSError(28, "No space left on device")


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """Give a folder with a model, recordings, a state and links to them."""
    (tmp_path / "m.yaml").write_text((RC / "model.yaml").read_text())
    for name in ("healthy.csv", "fault_capacitor.csv"):
        (tmp_path / name).write_text("".join((RC / name).read_text().splitlines(keepends=True)[:ROWS]))
    (tmp_path / "soft").symlink_to(tmp_path / "m.yaml")
    (tmp_path / "hard").hardlink_to(tmp_path / "healthy.csv")
    (tmp_path / "old").write_text("kept\n")
    (tmp_path / "s.state").write_text("no state\n")
    return tmp_path


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("check m.yaml --json m.yaml", "m.yaml: this is the model and would be the file of records too"),
        ("check m.yaml --json soft", "soft: this is the model"),
        ("check m.yaml --data healthy.csv --json hard", "hard: this is a recording"),
        ("analyse m.yaml --data healthy.csv --json ./healthy.csv", "healthy.csv: this is a recording"),
        ("simulate m.yaml --inputs healthy.csv -o hard", "hard: this is the recording of inputs"),
        ("simulate m.yaml --inputs healthy.csv -o x.csv --json x.csv", "x.csv: this is the output"),
        ("run m.yaml healthy.csv --report m.yaml", "m.yaml: this is the model and would be the report too"),
        ("run m.yaml healthy.csv --state healthy.csv", "healthy.csv: this is the recording and would be the state too"),
        ("run m.yaml healthy.csv --state s.state --json s.state", "s.state: this is the state"),
        ("run m.yaml healthy.csv --report r.html --json r.html", "r.html: this is the report"),
        ("fit m.yaml healthy.csv -o m.yaml", "m.yaml: this is the model"),
        ("fit m.yaml fault_capacitor.csv healthy.csv --report hard", "hard: this is a recording"),
        ("accept m.yaml s.state --json s.state", "s.state: this is the state"),
        ("reject m.yaml m.yaml C", "m.yaml: this is the model and would be the state too"),
        ("demo --report r.html --json r.html", "r.html: this is the report"),
        ("run m.yaml healthy.csv --report -", "-: only records go to standard output"),
        ("run m.yaml healthy.csv --report no/r.html", "no/r.html: there is no folder no"),
        ("run m.yaml healthy.csv --json .", "this is a folder"),
    ],
)
def test_no_output_is_an_input(
    words: str, message: str, folder: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What is read, by whatever name, and what another output is, is refused in one line, and all is as it was."""
    monkeypatch.chdir(folder)
    before = {path.name: path.read_bytes() for path in folder.iterdir()}
    assert main(words.split()) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert shown.count("\n") == 1
    assert {path.name: path.read_bytes() for path in folder.iterdir()} == before


def test_the_example_of_demo_is_an_input(capsys: pytest.CaptureFixture[str]) -> None:
    """`demo` reads files, too, and does not overwrite them."""
    model = example("tank") / "model.yaml"
    before = model.read_bytes()
    assert main(["demo", "--report", str(model)]) == 2
    assert "this is a file of the example" in capsys.readouterr().err
    assert model.read_bytes() == before


def test_a_recording_on_standard_input_is_an_input(folder: Path) -> None:
    """A file that the shell feeds to a live run is not overwritten by its records."""
    recording = folder / "healthy.csv"
    before = recording.read_bytes()
    command = [sys.executable, "-m", "faultbond", "run", str(folder / "m.yaml"), "-", "--json", str(recording)]
    with recording.open("rb") as stream:
        done = subprocess.run(command, stdin=stream, capture_output=True, text=True, check=False)
    assert (done.returncode, recording.read_bytes()) == (2, before)
    assert "this is the recording, on standard input," in done.stderr


def test_a_recording_to_which_standard_output_goes_is_an_input(folder: Path) -> None:
    """Records on standard output are not added to the recording that is being read."""
    recording = folder / "healthy.csv"
    before = recording.read_bytes()
    command = [sys.executable, "-m", "faultbond", "run", str(folder / "m.yaml"), str(recording), "--json", "-"]
    with recording.open("ab") as stream:
        done = subprocess.run(command, stdout=stream, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, recording.read_bytes()) == (2, before)
    assert "standard output goes to the recording" in done.stderr


def test_a_pipe_is_read_once(tmp_path: Path) -> None:
    """A recording that comes through a pipe is not opened to count its rows."""
    recording = b"time,y\n0,1\n1,1\n"
    (tmp_path / "file.csv").write_bytes(recording)
    assert _count_lines(tmp_path / "file.csv") == 2
    reading, writing = os.pipe()
    os.write(writing, recording)
    os.close(writing)
    assert _count_lines(Path(f"/dev/fd/{reading}")) is None
    assert os.read(reading, 100) == recording
    os.close(reading)


def test_records_longer_than_any_file(tmp_path: Path) -> None:
    """A state that tells of more records than there are takes no memory."""
    (tmp_path / "j").write_bytes(b"x")
    assert not holds_records(tmp_path / "j", Mark(path=str(tmp_path), length=2**52, sha256="0"))


def test_a_stamp_of_what_cannot_be_looked_at(tmp_path: Path) -> None:
    """A path that is none any more has no stamp, and stops nothing."""
    (tmp_path / "file").write_bytes(b"x")
    assert keeping.stamp_of(tmp_path / "file" / "x.state") is None
    assert keeping.stamp_of(tmp_path / "file") is not None


def test_a_seed_below_zero(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A seed that no generator takes is a mistake of the command."""
    words = ["simulate", str(folder / "m.yaml"), "--inputs", str(folder / "healthy.csv"), "-o", str(folder / "z.csv")]
    assert main([*words, "--seed", "-1"]) == 2
    assert "--seed -1: expected a whole number" in capsys.readouterr().err


def test_a_user_without_a_home(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no home, engines are kept below the folder for temporary files."""

    def homeless() -> Path:
        raise RuntimeError

    monkeypatch.setattr(Path, "home", homeless)
    monkeypatch.delenv("XDG_CACHE_HOME", raising=False)
    monkeypatch.delenv("FAULTBOND_CACHE", raising=False)
    assert cache_folder().parent == Path(tempfile.gettempdir())


@pytest.mark.parametrize(
    "words",
    [
        "check nosuch.yaml --json old",
        "run m.yaml nosuch.csv --json old",
        "run m.yaml s.state --json old",
        "run m.yaml healthy.csv --state s.state --json old",
        "simulate m.yaml --inputs s.state -o old",
        "fit m.yaml s.state -o old",
    ],
)
def test_a_start_that_fails_touches_nothing(words: str, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where model, recording or state is wrong, what an output would replace stays."""
    monkeypatch.chdir(folder)
    assert main(words.split()) == 2
    assert (folder / "old").read_text() == "kept\n"


@pytest.mark.parametrize("existed", [False, True])
def test_a_live_run_that_does_not_start_leaves_its_records_as_they_were(existed: bool, folder: Path) -> None:
    """A wrong header, which comes after the start, leaves the file with what was in it, or no file."""
    target = folder / ("old" if existed else "new")
    command = [sys.executable, "-m", "faultbond", "run", str(folder / "m.yaml"), "-", "--json", str(target)]
    done = subprocess.run(command, input="time,x\n0,1\n", capture_output=True, text=True, check=False)
    assert done.returncode == 2
    assert target.exists() == existed
    assert not existed or target.read_text() == "kept\n"


def test_a_file_of_a_live_run_can_be_followed(folder: Path) -> None:
    """The first record of a new file is there before any row, and each further one as soon as it is known."""
    target, rows = folder / "live.jsonl", (folder / "fault_capacitor.csv").read_text().splitlines(keepends=True)
    command = [sys.executable, "-m", "faultbond", "run", str(folder / "m.yaml"), "-", "--json", str(target)]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.DEVNULL, text=True) as process:
        assert process.stdin is not None
        wait_for(lambda: target.exists() and target.read_text().count("\n") == 1)
        process.stdin.writelines(rows)
        process.stdin.flush()
        wait_for(lambda: '"detection"' in target.read_text())
        process.stdin.close()
    assert kinds(target)[-1] == "end"


def wait_for(ready: Callable[[], bool], seconds: float = 30.0) -> None:
    """Wait until something is so."""
    for _ in range(int(seconds / 0.02)):
        if ready():
            return
        threading.Event().wait(0.02)
    pytest.fail("it does not happen")


def kinds(path: Path) -> list[str]:
    """Give the kinds of the records in a file."""
    return [json.loads(line)["record"] for line in path.read_text(encoding="utf-8").splitlines()]


def test_pipes_and_devices_are_written_as_they_are(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A named pipe gets the records, and `/dev/null` takes any number of outputs."""
    pipe = folder / "pipe"
    os.mkfifo(pipe)
    got: list[str] = []
    reader = threading.Thread(target=lambda: got.append(pipe.read_text()))
    reader.start()
    assert main(["run", str(folder / "m.yaml"), str(folder / "healthy.csv"), "--json", str(pipe)]) == 0
    reader.join(30)
    assert [json.loads(line)["record"] for line in got[0].splitlines()] == ["run", "end"]
    null = ["--json", "/dev/null", "--report", "/dev/null"]
    assert main(["run", str(folder / "m.yaml"), str(folder / "healthy.csv"), *null]) == 0
    assert pipe.is_fifo()
    assert capsys.readouterr().err == ""


def test_standard_output_by_its_name(folder: Path) -> None:
    """`/dev/stdout` is what is open already, also where it is a file, and is not replaced."""
    target = folder / "out.txt"
    command = [sys.executable, "-m", "faultbond", "check", str(folder / "m.yaml"), "--json", "/dev/stdout"]
    with target.open("wb") as stream:
        subprocess.run(command, stdout=stream, check=True)
    lines = target.read_text(encoding="utf-8").splitlines()
    assert any(line.startswith('{"record": "check"') for line in lines)
    assert any("RC circuit" in line for line in lines if not line.startswith("{"))


def test_a_whole_file_is_replaced(tmp_path: Path) -> None:
    """A link stays a link, the mode of a file stays, and nothing is left beside it."""
    target, link = tmp_path / "x.json", tmp_path / "link"
    target.write_text("old")
    target.chmod(0o640)
    link.symlink_to(target)
    with open_out(str(link)) as out:
        out.record({"record": "new"})
        assert target.read_text() == "old"
    assert (link.is_symlink(), target.stat().st_mode & 0o777, target.read_text()) == (
        True,
        0o640,
        '{"record": "new"}\n',
    )
    assert sorted(path.name for path in tmp_path.iterdir()) == ["link", "x.json"]


def test_what_fails_half_way_leaves_what_was_there(tmp_path: Path) -> None:
    """A file that could not be written to its end is not there, not even in part."""
    target = tmp_path / "x"
    target.write_text("old")
    with pytest.raises(ValueError, match="no text"), files.replaced_text(target) as stream:
        stream.writelines(f"new {int(word)}" for word in ("1", "no text"))
    assert {path.name: path.read_text() for path in tmp_path.iterdir()} == {"x": "old"}


def limited(size: int) -> Callable[[], None]:
    """Give what limits the files that a program writes, as a full disk would."""
    return lambda: resource.setrlimit(resource.RLIMIT_FSIZE, (size, size))


def test_a_state_on_a_full_disk(folder: Path) -> None:
    """A run that cannot be kept gives its verdict all the same."""
    command = [sys.executable, "-m", "faultbond", "run", "m.yaml", "fault_capacitor.csv", "--state", "new.state"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, preexec_fn=limited(4096))
    assert done.returncode == 1
    assert "Most likely" in done.stdout
    assert done.stderr == "faultbond: new.state: the run cannot be kept (File too large).\n"
    assert not [path.name for path in folder.iterdir() if "new.state" in path.name]


@pytest.mark.parametrize("target", [None, "-", "/dev/full"])
def test_a_result_that_cannot_be_written(target: str | None, folder: Path) -> None:
    """Where a verb other than `run` cannot write what it was asked for, that is an error."""
    command = [sys.executable, "-m", "faultbond", "check", str(folder / "m.yaml")]
    command += [] if target is None else ["--json", target]
    with Path("/dev/full" if target != "/dev/full" else folder / "text").open("wb") as stdout:
        done = subprocess.run(command, stdout=stdout, stderr=subprocess.PIPE, text=True, check=False)
    assert done.returncode == 2
    assert ("/dev/full: " if target == "/dev/full" else "standard output: ") in done.stderr
    assert "No space left on device" in done.stderr


def test_a_report_on_a_full_disk(folder: Path) -> None:
    """The verdict and its exit code come all the same, the message names the file, and no part of it is left."""
    command = [sys.executable, "-m", "faultbond", "run", "m.yaml", "fault_capacitor.csv", "--report", "r.html"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, check=False, preexec_fn=limited(4096))
    assert done.returncode == 1
    assert "Most likely" in done.stdout
    assert done.stderr == "faultbond: r.html: the report cannot be written: File too large.\n"
    assert not [path.name for path in folder.iterdir() if "r.html" in path.name]


@pytest.mark.parametrize(
    ("options", "message"),
    [
        (["--json", "/dev/full"], "faultbond: /dev/full: records cannot be written: No space left on device.\n"),
        (["--report", "/dev/full"], "faultbond: /dev/full: the report cannot be written: No space left on device.\n"),
    ],
)
def test_a_full_device(options: list[str], message: str, folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Text and exit code of a run do not depend on where else it writes."""
    assert main(["run", str(folder / "m.yaml"), str(folder / "fault_capacitor.csv"), *options]) == 1
    shown = capsys.readouterr()
    assert "Most likely" in shown.out
    assert message in shown.err


def test_standard_output_that_is_full(folder: Path) -> None:
    """Where not even the text can be written, the exit code still tells, in one line and without a traceback."""
    command = [sys.executable, "-m", "faultbond", "run", str(folder / "m.yaml"), str(folder / "fault_capacitor.csv")]
    with Path("/dev/full").open("wb") as full:
        done = subprocess.run(command, stdout=full, stderr=subprocess.PIPE, text=True, check=False)
    assert (done.returncode, done.stderr.count("\n")) == (1, 1)
    assert "standard output" in done.stderr


def test_records_that_wait_for_the_disk(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """What a full disk does not take, and be it half a record, is written when there is space; either is said once."""
    target, written, space = tmp_path / "r.jsonl", os.write, [30]

    def write(number: int, data: bytes) -> int:
        count = min(len(data), space[0])
        if not count:
            raise FULL
        space[0] -= count
        return written(number, data[:count])

    monkeypatch.setattr("faultbond.io.record_file.os.write", write)
    with open_out(str(target), grows=True) as out:
        for k in range(4):
            out.record({"record": "x", "k": k})
        with pytest.raises(OSError, match="not written yet"):
            out.mark()
        assert capsys.readouterr().err == f"faultbond: {target}: records cannot be written: No space left on device.\n"
        space[0] = 10**6
        out.record({"record": "x", "k": 4})
    assert [json.loads(line)["k"] for line in target.read_text().splitlines()] == [0, 1, 2, 3, 4]
    assert capsys.readouterr().err == f"faultbond: {target}: records are written again.\n"


def test_a_run_that_cannot_be_kept_goes_on(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Monitoring goes on without its file, says so once, and when it can be written again says that."""
    full = [True]

    def write(path: Path, saved: Any) -> None:
        if full[0]:
            raise FULL
        path.write_text("saved")

    class Running:
        """A course that has begun."""

        found = None

        def saved(self, _: object) -> Any:
            """Give what is kept."""
            return ()

    monkeypatch.setattr(keeping, "write_saved", write)
    monkeypatch.setattr(keeping, "replace", lambda saved, **_: saved)
    state = tmp_path / "x.state"
    keeper = keeping.Keeper(state, Running(), None, Out(text=None, json=None))  # type: ignore[arg-type]
    for _ in range(3):
        keeper.write()
    shown = capsys.readouterr().err
    assert "x.state: the run cannot be kept" in shown
    assert shown.count("\n") == 1
    full[0] = False
    keeper.write()
    keeper.write()
    assert capsys.readouterr().err == f"faultbond: {state}: the run is kept again.\n"
    assert state.read_text() == "saved"
