"""From Python: the service, what it keeps, what is installed, and the demo are those of the command line."""

import json
import re
import signal
import subprocess
import sys
import threading
import time
from datetime import UTC, datetime
from pathlib import Path

import pytest

import faultbond as fb
from faultbond.cli import main
from faultbond.errors import FaultbondError

httpx = pytest.importorskip("httpx", reason="there is no httpx: pip install httpx")
pytest.importorskip("uvicorn", reason='there is no uvicorn: pip install "faultbond[serve]"')

EXAMPLES = Path(__file__).parents[3] / "examples"
MODEL, RECORDING = EXAMPLES / "rc" / "model.yaml", EXAMPLES / "rc" / "fault_capacitor.csv"
LONGEST = 90.0  # s that anything takes on a busy machine
SCRIPT = """import faultbond as fb
try:
    fb.serve({model!r}, source={source!r}, store="kept.sqlite", port=0, json="records.jsonl")
except KeyboardInterrupt:
    print("stopped")
"""


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """The folder of a service that a script ran, until it was told to stop."""
    folder = tmp_path_factory.mktemp("kept")
    script = SCRIPT.format(model=str(MODEL), source=f"file:{RECORDING}?speed=max")
    command = [sys.executable, "-c", script]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, text=True) as process:
        try:
            first = process.stdout.readline() if process.stdout is not None else ""
            address = first.partition(": ")[2].split()[0]
            assert [item["name"] for item in httpx.get(f"{address}api/v1/site").json()["assets"]] == ["rc"]
            end = time.monotonic() + LONGEST
            records = folder / "records.jsonl"
            while not (records.exists() and '"diagnosis"' in records.read_text()) and time.monotonic() < end:
                time.sleep(0.05)
            process.send_signal(signal.SIGINT)
            assert process.communicate(timeout=LONGEST)[0] == "stopped\n"
        finally:
            process.kill()
    return folder


def test_history(kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a service kept has the records and the text of `history`; a period is written as a recording."""
    store, target = kept / "kept.sqlite", tmp_path / "told.jsonl"
    found = fb.history(store)
    assert main(["history", str(store), "--json", str(target)]) == 0
    assert [json.loads(json.dumps(dict(item))) for item in found] == [
        json.loads(line) for line in target.read_text().splitlines()
    ]
    assert str(found) == capsys.readouterr().out
    assert "detection" in [item["record"] for item in found]
    begun = datetime.fromtimestamp(30.0, tz=UTC)
    later = fb.history(str(store), asset="rc", begin=begun, end="1970-01-01T00:00:40")
    assert [item for item in later if item["time"] < 30.0 or item["time"] > 40.0] == []
    assert 0 < len(later) < len(found)
    (written,) = fb.history(store, end=5.0, output=tmp_path / "begin.csv")
    assert (written["record"], fb.run(MODEL, tmp_path / "begin.csv").verdict) == ("history", "healthy")


def test_what_would_be_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """With `check` it is said what would be watched, and nothing is."""
    monkeypatch.chdir(tmp_path)
    found = fb.serve(MODEL, source=f"file:{RECORDING}", port=0, check=True)
    assert found is not None
    assert [item["name"] for item in found["assets"]] == ["rc"]
    assert str(found).startswith("rc: RC circuit")


def test_what_is_not_served(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A mistake of a word is told by its name, and where no signal arrives nothing is begun."""
    monkeypatch.chdir(tmp_path)
    with pytest.raises(FaultbondError, match="log='xml': expected plain, journal, json"):
        fb.serve(MODEL, log="xml")
    with pytest.raises(FaultbondError, match=r"^site.yaml: .*stand in the site file. Leave them out here"):
        fb.serve(MODEL, site="site.yaml")
    with pytest.raises(FaultbondError, match="begin='noon': expected seconds"):
        fb.history("kept.sqlite", begin="noon")
    for call in (
        lambda: fb.serve(MODEL, json="nowhere/records.jsonl"),
        lambda: fb.serve(MODEL, store="nowhere/kept.sqlite"),
        lambda: fb.demo(report="nowhere/report.html"),
    ):
        with pytest.raises(FaultbondError, match="there is no folder nowhere"):
            call()
    with pytest.raises(FaultbondError, match="this is a model and would be the store too"):
        fb.serve(MODEL, store=MODEL)
    with pytest.raises(FaultbondError, match=r"store='a.*': no path has the character NUL"):
        fb.history("a\0b")
    told = list[FaultbondError]()

    def begin() -> None:
        try:
            fb.serve(MODEL, port=0)
        except FaultbondError as error:
            told.append(error)

    beside = threading.Thread(target=begin)
    beside.start()
    beside.join()
    assert ["it needs the main thread" in str(error) for error in told] == [True]


def test_doctor(capsys: pytest.CaptureFixture[str]) -> None:
    """What is installed is the record and the text of `doctor`, but for times, and what others put into the cache."""
    found = fb.doctor()
    assert main(["doctor"]) == 0
    texts = str(found), capsys.readouterr().out
    ours, theirs = (re.sub(r"[\d.]+", "#", text).split() for text in texts)
    assert ours == theirs
    assert found["works"] is True
    assert repr(found).startswith("<Told of 'doctor': record, version")


def test_demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """The demo writes its report, and gives the records of its run; nothing is printed."""
    monkeypatch.chdir(tmp_path)
    found = fb.demo()
    assert capsys.readouterr().out == ""
    assert "What was made: at 1500 s" in str(found)
    assert (found[0]["record"], found[-1]["record"]) == ("run", "end")
    assert (tmp_path / "report.html").exists()
