"""`run --method classic`: the thesis' method through the command line."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.classic import Classic
from faultbond.cli import main
from faultbond.contract.samples import Samples
from faultbond.model.text import load_model
from faultbond.thesis.offline.build import build_classic

EXAMPLES = Path(__file__).parents[2] / "examples"
MODEL = EXAMPLES / "dc_motor" / "model.yaml"
ROWS = 600  # at 50 Hz; R changes at 6 s
CLASSIC = ["--method", "classic"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with faulty.csv."""
    place = tmp_path_factory.mktemp("recordings")
    inputs = str(EXAMPLES / "dc_motor" / "healthy.csv")
    whole = place / "whole.csv"
    common = ["simulate", str(MODEL), "--inputs", inputs, "--seed", "1", "--fault", "R=x4@6"]
    assert main([*common, "-o", str(whole)]) == 0
    lines = whole.read_text().splitlines(keepends=True)
    (place / "faulty.csv").write_text("".join(lines[: ROWS + 1]))
    return place


def run(folder: Path, first: int, end: int, *options: str, code: int) -> list[dict[str, Any]]:
    """Run some rows and give the records."""
    header, *rows = (folder / "faulty.csv").read_text().splitlines(keepends=True)
    part, target = folder / "part.csv", folder / "part.jsonl"
    target.unlink(missing_ok=True)  # else a run that goes on adds to it
    part.write_text("".join([header, *rows[first:end]]))
    assert main(["run", str(MODEL), str(part), *CLASSIC, "--json", str(target), *options]) == code
    return [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()]


@pytest.fixture(scope="module")
def whole(folder: Path) -> list[dict[str, Any]]:
    """Give the records of a run over all rows."""
    return run(folder, 0, ROWS, "--report", str(folder / "classic.html"), code=1)


def test_it_finds_a_fault_in_the_same_records(whole: list[dict[str, Any]], folder: Path) -> None:
    """The records are those of any method, the first one names it, and the fault is found after it was made."""
    kinds = [record["record"] for record in whole]
    assert kinds == ["run", "detection", *["diagnosis"] * (len(whole) - 3), "end"]
    assert whole[0]["method"] == "classic"
    assert 6.0 < whole[1]["time"] < 10.0
    best = whole[-2]["candidates"][0]
    assert set(best["parameters"]) == {"R"}
    assert best["parameters"]["R"]["estimate"] > 1.5 * best["parameters"]["R"]["nominal"]
    assert whole[-2]["advice"] == []
    assert (whole[-1]["samples"], whole[-1]["detections"]) == (ROWS, 1)
    page = (folder / "classic.html").read_text(encoding="utf-8")
    assert "algorithms, 11 functions" in page


def test_a_run_cut_in_two_is_the_whole_run(folder: Path, whole: list[dict[str, Any]]) -> None:
    """A kept run goes on to the last digit, from before the alarm and from after it."""
    state = str(folder / "x.state")
    told = []
    for first, end, code in ((0, 250, 0), (250, 560, 1), (560, ROWS, 1)):
        told += run(folder, first, end, "--state", state, code=code)
    assert [record for record in whole if record not in told] == []


def sample(time: float, voltage: float, speed: float) -> Samples:
    """Give one sample at 50 Hz."""
    dt = np.array([0.02 if time else 0.0])
    return Samples(time=np.array([time]), dt=dt, u=np.array([[voltage]]), y=np.array([[speed]]))


def test_the_statistic_alarms_at_its_limit(whole: list[dict[str, Any]], folder: Path) -> None:
    """The report's statistic is a share of the limit: above it at the alarm, below it before."""
    watcher = Classic(*build_classic(load_model(MODEL)))
    limit = watcher.spec.thresholds.cusum_limit
    rows = [[float(cell) for cell in line.split(",")] for line in (folder / "faulty.csv").read_text().split()[1:]]
    alarm = whole[1]["sample"]
    shares = []
    for time, voltage, speed in rows[: alarm + 1]:
        report = watcher.take(sample(time, voltage, speed)).last
        shares.append(float(report.cusum.max()) / limit)
    assert shares[-1] > 1.0
    assert max(shares[watcher.asleep : -2]) < 1.0


def test_what_it_does_not_do_is_refused(
    folder: Path, whole: list[dict[str, Any]], capsys: pytest.CaptureFixture[str]
) -> None:
    """One line each for a network without time, and for a file of the other method."""
    faulty, state = str(folder / "faulty.csv"), str(folder / "refused.state")
    run(folder, 0, ROWS, "--state", state, code=1)
    capsys.readouterr()
    for arguments, message in (
        (["run", str(MODEL), faulty, "--state", state], "it was saved by --method classic"),
        (["run", str(EXAMPLES / "thesis" / "fig_3_7.yaml"), faulty, *CLASSIC], "leave out --method classic"),
    ):
        assert main(arguments) == 2
        shown = capsys.readouterr().err
        assert message in shown
        assert shown.count("\n") == 1


def test_a_short_recording_has_no_verdict(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """As long as the alarms are off nothing is said of the plant."""
    run(folder, 0, 28, code=4)
    assert "the recording ended after 28 samples, and the alarms are off for the first" in capsys.readouterr().err


def test_a_person_accepts_and_rejects(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The best candidate of a kept run becomes the new healthy model; a rejected one leaves its place to the next."""
    state = str(folder / "decided.state")
    before = run(folder, 0, 560, "--state", state, code=1)[-2]["candidates"]
    assert main(["reject", str(MODEL), state, *before[1]["parameters"], "--json", str(folder / "r.jsonl")]) == 0
    _, diagnosis = [json.loads(line) for line in (folder / "r.jsonl").read_text().splitlines()]
    assert before[1]["parameters"].keys() not in [item["parameters"].keys() for item in diagnosis["candidates"]]
    capsys.readouterr()
    assert main(["accept", str(MODEL), state, "R"]) == 0
    assert "R (" in capsys.readouterr().out
    after = run(folder, 560, ROWS, "--state", state, code=0)
    assert [record["record"] for record in after] == ["run", "end"]
    assert main(["accept", str(MODEL), state]) == 2
    assert "There is no alarm to explain" in capsys.readouterr().err


def test_after_a_time_of_unknown_length_it_begins_anew() -> None:
    """What was remembered of the signals is dropped, the number of the sample is not."""
    watcher = Classic(*build_classic(load_model(MODEL)))
    for k in range(60):
        report = watcher.take(sample(0.02 * k, 5.0, 0.1)).last
    assert report.status.name == "WATCHING"
    watcher.resume()
    index = int(watcher.save()["index"])
    assert watcher.take(sample(99.0, 5.0, 0.1)).last.status.name == "STARTING"
    assert (index, int(watcher.save()["index"])) == (60, 61)
