"""Several faults one after another, and runs that go on from a file."""

import io
import json
import sys
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import course
from faultbond.app import kept_run as keeping
from faultbond.app.methods import build_method
from faultbond.cli import main
from faultbond.contract.findings import (
    Candidate,
    Decider,
    Decision,
    Detection,
    Forecast,
    Suspect,
)
from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.errors import FaultbondError, RecordingError
from faultbond.io.grid import Counts, Grid, GridClock, Row
from faultbond.io.out import Out
from faultbond.io.saved import FoundSoFar, Saved, read_saved, write_saved
from faultbond.model.text import load_model
from faultbond.runtime.trace import Trace
from faultbond.types import FaultKind, Method

EXAMPLES = Path(__file__).parents[2] / "examples"
MODEL = EXAMPLES / "rc" / "model.yaml"
ROWS = 600  # at 50 Hz; C changes at 2 s, R at 9 s
CUT = 200  # in the diagnosis of C


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with two.csv, in which two parameters change one after the other."""
    place = tmp_path_factory.mktemp("recordings")
    rows = [f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS)]
    (place / "inputs.csv").write_text("\n".join(["time,V", *rows]) + "\n")
    faults = ["--fault", "C=160@2", "--fault", "R=x1.6@9"]
    common = ["simulate", str(MODEL), "--inputs", str(place / "inputs.csv"), "--seed", "1", *faults]
    assert main([*common, "-o", str(place / "two.csv")]) == 0
    return place


@pytest.fixture(scope="module")
def whole(folder: Path) -> list[dict[str, Any]]:
    """Give the records of a run over all rows, in which a rule accepts."""
    return run(folder, 0, ROWS, "--accept", "auto")


def run(folder: Path, first: int, end: int, *options: str, code: int = 1) -> list[dict[str, Any]]:
    """Run some rows and give the records."""
    header, *rows = (folder / "two.csv").read_text().splitlines(keepends=True)
    part, target = folder / "part.csv", folder / "part.jsonl"
    part.write_text("".join([header, *rows[first:end]]))
    target.unlink(missing_ok=True)  # else a run that goes on adds to it
    assert main(["run", str(MODEL), str(part), "--json", str(target), *options]) == code
    return [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()] if target.exists() else []


def kinds(records: list[dict[str, Any]]) -> list[str]:
    """Give what happened, in order, without diagnoses."""
    return [record["record"] for record in records if record["record"] != "diagnosis"]


def test_a_rule_accepts_and_the_next_fault_is_found(whole: list[dict[str, Any]]) -> None:
    """The sure candidate becomes the new normal, with its values and who decided; the next alarm is of the next one."""
    assert kinds(whole) == ["run", "detection", "accepted", "detection", "end"]
    first, accepted, second, end = (item for item in whole if item["record"] not in ("run", "diagnosis"))
    assert (accepted["components"], accepted["kind"], accepted["by"]) == (["C"], "step", "rule")
    assert accepted["parameters"]["C"]["estimate"] == pytest.approx(160e-6, rel=0.1)
    assert accepted["probability"] > 0.95
    assert accepted["time"] - first["time"] >= 200 * 0.02 - 1e-9
    assert 8.5 < second["change_time"] < second["time"] < 10.0
    assert end["detections"] == 2
    last = whole[-2]["candidates"][0]
    assert set(last["parameters"]) == {"R"}
    assert last["parameters"]["R"]["estimate"] == pytest.approx(16e3, rel=0.1)


def test_without_a_rule_nobody_accepts(folder: Path) -> None:
    """Only who asks for it has candidates accepted; until then there is one detection."""
    assert kinds(run(folder, 0, ROWS)) == ["run", "detection", "end"]


@pytest.mark.parametrize("cuts", [[12, 15, CUT], [130, 350]])
def test_a_run_cut_in_pieces_is_the_whole_run(cuts: list[int], folder: Path, whole: list[dict[str, Any]]) -> None:
    """Runs that go on from each other give the records of one run, to the last digit; each also ends with its own."""
    state = folder / f"{cuts[0]}.state"
    ends = [*cuts, ROWS]
    pieces = [
        run(folder, first, end, "--accept", "auto", "--state", str(state), code=1 if end > 125 else 4)
        for first, end in zip([0, *cuts], ends, strict=True)
    ]
    told = [record for piece in pieces for record in piece]
    assert [record for record in whole if record not in told] == []
    extra = [record["record"] for record in told if record not in whole]
    assert set(extra) <= {"run", "end", "diagnosis"}
    assert extra.count("diagnosis") <= len(cuts)
    assert [piece[0]["continues"] for piece in pieces] == [None, *(pytest.approx((end - 1) * 0.02) for end in cuts)]
    assert pieces[-1][-1] == whole[-1]


def test_a_person_accepts(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The best candidate of a kept run becomes the new normal; the run that goes on finds the next fault only."""
    state = str(folder / "person.state")
    run(folder, 0, 300, "--state", state)
    capsys.readouterr()
    assert main(["accept", str(MODEL), state]) == 0
    assert "Accepted at 5.98 s: C (" in capsys.readouterr().out
    assert main(["accept", str(MODEL), state]) == 2
    assert "There is no alarm to explain" in capsys.readouterr().err
    assert kinds(run(folder, 300, 420, "--state", state, code=0)) == ["run", "end"]
    assert "Accepted at 5.98 s: C (" in capsys.readouterr().out
    after = run(folder, 420, ROWS, "--state", state)
    assert kinds(after) == ["run", "detection", "end"]
    assert after[-1]["detections"] == 2
    assert set(after[-2]["candidates"][0]["parameters"]) == {"R"}


def test_a_person_rejects(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A rejected candidate is out, the others share what it had, and who then accepts takes the next one."""
    state = str(folder / "rejected.state")
    before = run(folder, 0, 300, "--state", state)[-2]["candidates"]
    capsys.readouterr()
    assert main(["reject", str(MODEL), state, "C", "--json", str(folder / "r.jsonl")]) == 0
    rejected, diagnosis = [json.loads(line) for line in (folder / "r.jsonl").read_text().splitlines()]
    assert (rejected["record"], rejected["components"], rejected["by"]) == ("rejected", ["C"], "person")
    assert rejected["parameters"] == before[0]["parameters"]
    left = {item["components"][0]: item["probability"] for item in diagnosis["candidates"]}
    assert left["C"] == 0.0
    rest = sum(item["probability"] for item in before[1:])
    for item in before[1:]:
        assert left[item["components"][0]] == pytest.approx(item["probability"] / rest, rel=1e-6, abs=1e-12)
    shown = capsys.readouterr().out
    assert "Rejected at 5.98 s: C, step" in shown
    assert "What is left:\n" in shown
    found = read_saved(Path(state)).found
    assert found.open is not None
    assert len(found.rejected) == 1
    assert main(["reject", str(MODEL), state, "C"]) == 2
    assert "C: rejected already" in capsys.readouterr().err
    run(folder, 300, 320, "--state", state)
    assert "Rejected at 5.98 s: C, step" in capsys.readouterr().out
    assert main(["reject", str(MODEL), state, "nobody"]) == 2
    told = capsys.readouterr().err
    assert told.startswith("nobody: nothing that is suspected is called so. There are R, C, ")
    assert main(["reject", str(MODEL), state, "C", "R", "V_C"]) == 2
    assert "C, R, V_C: no candidate has just these components" in capsys.readouterr().err


def test_what_an_open_alarm_of_before_says(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A run that finds an alarm standing diagnoses on, tells of that alarm, and ends with exit code 1."""
    state = str(folder / "open.state")
    run(folder, 0, CUT, "--state", state)
    capsys.readouterr()
    assert kinds(run(folder, CUT, 260, "--state", state)) == ["run", "end"]
    shown = capsys.readouterr().out
    assert "Fault detected at 2." in shown
    assert "Most likely C changed" in shown
    assert "Samples  60, " in shown


def test_rows_that_were_there_before_are_passed_over(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording that has grown may be given again; one without a later row is a mistake that is told."""
    state = str(folder / "grown.state")
    run(folder, 0, 300, "--accept", "auto", "--state", state)
    records = run(folder, 0, ROWS, "--accept", "auto", "--state", state)
    assert records[-1]["duplicate"] == 300
    assert records[-1]["samples"] == ROWS
    assert kinds(records) == ["run", "accepted", "detection", "end"]
    capsys.readouterr()
    run(folder, 0, 300, "--state", state, code=2)
    assert "no row is later than 11.98 s, where the saved run ended" in capsys.readouterr().err


def test_without_a_time_column_the_clock_goes_on(tmp_path: Path, folder: Path) -> None:
    """Rows that have no time follow on the last one of the run before."""
    lines = (folder / "two.csv").read_text().splitlines()
    model, state, target = tmp_path / "m.yaml", tmp_path / "x.state", tmp_path / "x.jsonl"
    model.write_text(MODEL.read_text() + "time: none\n")
    for first, end in ((1, 51), (51, 91)):
        rows = [line.partition(",")[2] for line in (lines[0], *lines[first:end])]
        (tmp_path / "r.csv").write_text("\n".join(rows) + "\n")
        assert main(["run", str(model), str(tmp_path / "r.csv"), "--state", str(state), "--json", str(target)]) == 0
    end_record = json.loads(target.read_text().splitlines()[-1])
    assert end_record["time"] == pytest.approx(89 * 0.02)
    assert (end_record["samples"], end_record["missing"]) == (90, 0)


class Arriving(io.RawIOBase):
    """Gives one text after the other, none longer than what is asked for."""

    def __init__(self, lines: Iterator[bytes]) -> None:
        self.left = lines

    def readable(self) -> bool:
        return True

    def readinto(self, buffer: Any) -> int:
        line = next(self.left, b"")
        buffer[: len(line)] = line
        return len(line)


def live(folder: Path, monkeypatch: pytest.MonkeyPatch, rows: list[str], *options: str) -> int:
    """Run rows that come on standard input, each text of its own."""
    stream = Arriving(row.encode() for row in rows)
    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(stream, max(map(len, rows)))))
    return main(["run", str(MODEL), "-", "--json", str(folder / "live.jsonl"), *options])


def test_a_live_run_is_kept_and_heeds_what_is_decided(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A live run writes its file at the alarm; what `accept` changes there is done to the run, which goes on."""
    rows = (folder / "two.csv").read_text().splitlines(keepends=True)
    state = folder / "live.state"
    taken = course.Course.take

    def take(self: course.Course, points: Any, **options: bool) -> int:
        if points.index[0] == 300:
            assert main(["accept", str(MODEL), str(state), "C"]) == 0
        return taken(self, points, **options)

    monkeypatch.setattr(course.Course, "take", take)
    assert live(folder, monkeypatch, rows, "--state", str(state)) == 1
    records = [json.loads(line) for line in (folder / "live.jsonl").read_text().splitlines()]
    assert kinds(records) == ["run", "detection", "accepted", "detection", "end"]
    decided = next(record for record in records if record["record"] == "accepted")
    assert (decided["time"], decided["by"]) == (pytest.approx(6.0), "person")
    found = read_saved(state).found
    assert [item.time for item in found.accepted] == [decided["time"]]
    assert found.detections == 2


@pytest.mark.parametrize("absent", [0, 3])
def test_what_is_kept_at_an_alarm_does_not_go_by_how_rows_arrive(
    absent: int, folder: Path, whole: list[dict[str, Any]], monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of rows that arrived together, those after the alarm are not in the file that is written at it."""
    rows = (folder / "two.csv").read_text().splitlines(keepends=True)
    alarm = 1 + round(next(record["time"] for record in whole if record["record"] == "detection") / 0.02)
    del rows[alarm - absent : alarm - absent + bool(absent)]  # those after it wait for it, and then come with one row
    written: list[list[Any]] = []
    assert live(folder, monkeypatch, rows) == 1
    told = (folder / "live.jsonl").read_text()
    for lines in (["".join(rows)], rows):
        kept: list[Any] = []
        monkeypatch.setattr(keeping, "write_saved", lambda _, saved, kept=kept: kept.append(saved))
        assert live(folder, monkeypatch, lines, "--state", str(folder / "never.state")) == 1
        assert (folder / "live.jsonl").read_text() == told
        written.append([(item.clock.last_time, item.clock.counts, item.numbers["state"].tobytes()) for item in kept])
    assert written[0] == written[1]
    assert written[0][0][1].samples < alarm + 10 < written[0][-1][1].samples == ROWS


@pytest.mark.parametrize("stopped", [False, True])
def test_a_decision_after_the_last_row_is_heeded(stopped: bool, folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a person decided since then is not lost when the stream ends, or is stopped."""
    rows = (folder / "two.csv").read_text().splitlines()
    state = folder / f"last {stopped}.state"

    def lines() -> Iterator[bytes]:
        yield from (f"{line}\n".encode() for line in rows[:400])
        assert main(["accept", str(MODEL), str(state), "C"]) == 0
        if stopped:
            raise KeyboardInterrupt

    monkeypatch.setattr(sys, "stdin", io.TextIOWrapper(io.BufferedReader(Arriving(lines()), 1)))
    code = main(["run", str(MODEL), "-", "--json", str(folder / "live.jsonl"), "--state", str(state)])
    assert code == (130 if stopped else 1)
    records = [json.loads(line) for line in (folder / "live.jsonl").read_text().splitlines()]
    assert [item["components"] for item in records if item["record"] == "accepted"] == [["C"]]
    assert [item.by.value for item in read_saved(state).found.accepted] == ["person"]


def test_a_live_run_heeds_rejections(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What `reject` rules out in the file of a live run is out in the run."""
    rows = (folder / "two.csv").read_text().splitlines(keepends=True)[:350]
    state = folder / "ruled_out.state"
    taken = course.Course.take

    def take(self: course.Course, points: Any, **options: bool) -> int:
        if points.index[0] == 300:
            assert main(["reject", str(MODEL), str(state), "C"]) == 0
        return taken(self, points, **options)

    monkeypatch.setattr(course.Course, "take", take)
    assert live(folder, monkeypatch, rows, "--state", str(state)) == 1
    records = [json.loads(line) for line in (folder / "live.jsonl").read_text().splitlines()]
    assert kinds(records) == ["run", "detection", "rejected", "end"]
    left = {item["components"][0]: item["probability"] for item in records[-2]["candidates"]}
    assert left["C"] == 0.0


class Refuser:
    """A watcher that decides nothing; only what a course asks of it at once is there."""

    spec = EngineSpec(
        model="m",
        model_sha256="",
        version="0",
        sample_time=1.0,
        states=(),
        slow_errors=(),
        parameters=(),
        inputs=(),
        outputs=(),
        loops=(),
        hypotheses=(),
        thresholds=Thresholds(),
    )

    def accept(self, hypothesis: int, *, repaired: bool = False) -> Candidate:
        """Refuse."""
        raise FaultbondError(str(hypothesis))


def test_decisions_that_come_too_late_are_passed_over() -> None:
    """What was decided of an alarm before the one that is open, or of a candidate that is gone, changes nothing."""
    first, second = (Detection(time=t, sample=int(t), change_time=t, signals=()) for t in (4.0, 9.0))
    running = course.Course(cast("Any", Refuser()), Grid(1.0), course.Following(out=Out(text=None, json=None)))
    running.found = FoundSoFar().with_detection(first)
    decided = running.found.with_accepted(kept().found.accepted[0])
    running.heed(decided)  # the watcher refuses
    assert running.found.open == first
    other = kept().found.rejected[0]
    running.found = running.found.with_rejected(other).with_detection(second)  # what was rejected then may be it now
    for late in (decided, FoundSoFar().with_detection(first).with_rejected(other)):
        running.heed(late)
        assert running.found == FoundSoFar(detections=2, open=second)


def test_what_is_decided_of_another_plant_is_passed_over(folder: Path, tmp_path: Path) -> None:
    """A file of another model, or with a candidate that no model has, decides nothing of a run and does not stop it."""
    state = tmp_path / "x.state"
    run(folder, 0, 250, "--state", str(state))
    saved = read_saved(state)
    running = course.Course(
        build_method(load_model(MODEL), Method.BANK, saved.numbers),
        Grid(0.02, clock=saved.clock),
        course.Following(out=Out(text=None, json=None)),
        saved,
    )
    keeper = keeping.Keeper(state, running, Method.BANK, Out(text=None, json=None), None, keeping.stamp_of(state))
    first = kept().found.accepted[0]
    for hypothesis, sha in ((500, saved.model_sha256), (0, "another")):
        decided = replace(first, candidate=replace(first.candidate, hypothesis=hypothesis))
        other = replace(saved, model_sha256=sha, found=saved.found.with_accepted(decided))
        write_saved(state, other)
        keeper.look()
        assert running.found.accepted == saved.found.accepted
        assert read_saved(state).found == running.found


def test_a_decision_that_came_before_the_file_is_written_is_heeded(folder: Path, tmp_path: Path) -> None:
    """What a person decided since the run last looked is in the run, not overwritten by it."""
    state = tmp_path / "x.state"
    run(folder, 0, 250, "--state", str(state))
    stamp, saved = keeping.stamp_of(state), read_saved(state)
    assert main(["accept", str(MODEL), str(state), "C"]) == 0
    running = course.Course(
        build_method(load_model(MODEL), Method.BANK, saved.numbers),
        Grid(0.02, clock=saved.clock),
        course.Following(out=Out(text=None, json=None)),
        saved,
    )
    keeping.Keeper(state, running, Method.BANK, Out(text=None, json=None), None, stamp).write(last=True)
    assert [item.candidate.components for item in read_saved(state).found.accepted] == [("C",)]


class Choosy(Refuser):
    """A watcher that rejects one hypothesis only."""

    def reject(self, hypothesis: int) -> Candidate:
        """Reject the third, refuse any other."""
        if hypothesis != 3:
            raise FaultbondError(str(hypothesis))
        return replace(kept().found.accepted[0].candidate, hypothesis=3)


def test_a_rejection_that_is_refused_does_not_take_the_next_one_along() -> None:
    """Of what a person ruled out meanwhile, all that is still listed is ruled out, recorded and told."""
    alarm, trace = Detection(time=4.0, sample=4, change_time=4.0, signals=()), Trace(Refuser.spec)
    following = course.Following(out=Out(text=None, json=None), trace=trace)
    running = course.Course(cast("Any", Choosy()), Grid(1.0), following)
    running.found = FoundSoFar().with_detection(alarm)
    gone, there = (
        replace(item, candidate=replace(item.candidate, hypothesis=k))
        for item, k in zip(kept().found.rejected * 2, (2, 3), strict=True)
    )
    running.heed(running.found.with_rejected(gone).with_rejected(there))
    assert [item.candidate.hypothesis for item in running.found.rejected] == [3]
    assert [item.candidate.hypothesis for item in trace.history().rejected] == [3]


def test_of_many_faults_before_the_last_ones_are_told() -> None:
    """However many candidates were accepted in the runs before, a run tells of the last five again, and keeps all."""
    many = FoundSoFar()
    for k in range(9):
        many = many.with_accepted(replace(kept().found.accepted[0], time=float(k)))
    trace = Trace(Refuser.spec)
    following = course.Following(out=Out(text=None, json=None), trace=trace)
    running = course.Course(cast("Any", Refuser()), Grid(1.0), following, replace(kept(), found=many))
    assert [item.time for item in trace.history().accepted] == [4.0, 5.0, 6.0, 7.0, 8.0]
    assert len(running.found.accepted) == 9


def test_a_live_run_that_is_stopped_is_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Ctrl-C ends a live run with its file written up to the last point."""
    rows = (folder / "two.csv").read_text().splitlines(keepends=True)
    state = folder / "stopped.state"
    taken = course.Course.take

    def take(self: course.Course, points: Any, **options: bool) -> int:
        if points.index[-1] >= 50:
            raise KeyboardInterrupt
        return taken(self, points, **options)

    with monkeypatch.context() as patch:
        patch.setattr(course.Course, "take", take)
        assert live(folder, patch, rows, "--state", str(state)) == 130
    assert read_saved(state).clock.counts.samples >= 50


def test_a_live_run_writes_at_times(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without an alarm the file is written whenever a minute has passed."""
    clock = iter(range(0, 10**6, 2))
    monkeypatch.setattr("time.monotonic", lambda: float(next(clock)))
    written: list[int] = []
    monkeypatch.setattr(keeping, "write_saved", lambda _, saved: written.append(saved.clock.counts.samples))
    rows = (folder / "two.csv").read_text().splitlines(keepends=True)[:92]
    live(folder, monkeypatch, rows, "--state", str(folder / "times.state"))
    assert 2 <= len(written) <= 5
    assert written[-1] == 91


def other_arrays(path: Path) -> None:
    """Replace a file by an archive of something else."""
    with path.open("wb") as stream:
        np.savez(stream, x=np.zeros(3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda path: path.write_bytes(b"time,level\n0,1\n"), "this is not the file of a run, as `run --state FILE`"),
        (lambda path: path.write_bytes(b""), "this is not a state that this version of faultbond saved"),
        (lambda path: path.write_bytes(path.read_bytes()[:2000]), "this is not a state"),
        (other_arrays, "this is not a state"),
        (lambda path: resaved(path, model_sha256="0"), "it was saved with an earlier form of this model"),
        (lambda path: resaved(path, model="other", model_sha256="0"), "it was saved with the model 'other'"),
        (lambda path: resaved(path, numbers={"index": np.zeros(())}), "made by another version of faultbond"),
    ],
)
def test_a_file_that_cannot_be_gone_on_from(
    change: Callable[[Path], object], message: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file of something else is refused in one line that says what to do, and is left as it is."""
    state = tmp_path / "x.state"
    write_saved(state, kept())
    resaved(state, model_sha256=load_model(MODEL).sha256, model="RC circuit")
    change(state)
    before = state.read_bytes()
    assert main(["run", str(MODEL), str(folder / "two.csv"), "--state", str(state)]) == 2
    shown = capsys.readouterr().err
    assert message in shown
    assert shown.count("\n") == 1
    assert state.read_bytes() == before


def test_where_nothing_can_be_kept(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A folder that is not there, a file that is not there yet, and a network without time are told before the run."""
    two = str(folder / "two.csv")
    assert main(["run", str(MODEL), two, "--state", str(tmp_path / "no" / "x.state")]) == 2
    assert "there is no folder" in capsys.readouterr().err
    assert main(["accept", str(MODEL), str(tmp_path / "x.state")]) == 2
    assert "there is no such file. `faultbond run MODEL REC --state" in capsys.readouterr().err
    static = EXAMPLES / "thesis" / "fig_3_7.yaml"
    for option in (["--state", "x"], ["--accept", "auto"]):
        assert main(["run", str(static), two, *option]) == 2
        assert f"leave out {option[0]}" in capsys.readouterr().err


def kept() -> Saved:
    """Give a small run with everything in it that can be."""
    suspect = Suspect(
        parameter="C",
        component="C",
        nominal=None,
        estimate=1.5,
        sd=float("nan"),
        rate=1e-3,
        rate_sd=1e-5,
        forecasts=(Forecast(limit=2.0, time=500.0, earliest=None, latest=float("inf")),),
    )
    candidate = Candidate(
        suspects=(suspect,),
        probability=0.9,
        group=True,
        kind=FaultKind.DRIFT,
        kinds=((FaultKind.DRIFT, 0.8), (FaultKind.STEP, 0.2)),
        present=False,
    )
    found = FoundSoFar(
        detections=2,
        watched=7,
        waiting=1,
        open=Detection(time=4.0, sample=4, change_time=3.0, signals=("V_C",)),
        accepted=(Decision(time=2.0, candidate=candidate, by=Decider.PERSON),),
        rejected=(Decision(time=4.0, candidate=replace(candidate, hypothesis=3), by=Decider.PERSON),),
    )
    row = Row(time=0.1 + 0.2, u=np.array([1 / 3]), y=np.array([np.nan]))
    clock = GridClock(
        counts=Counts(samples=9, late=1), placed=(row, row), origin=(0, 0.1), usual=0.02, last_index=8, last_time=0.26
    )
    return Saved(
        model="m",
        model_sha256="ab",
        version="0",
        method=Method.BANK,
        numbers={"index": np.array(8.0), "held": np.array([np.nan, np.inf, 1 / 3])},
        clock=clock,
        found=found,
    )


def resaved(path: Path, **changes: Any) -> None:
    """Change a file that keeps a run."""
    write_saved(path, replace(read_saved(path), **changes))


def test_what_is_kept_comes_back(tmp_path: Path) -> None:
    """Every number comes back to the last bit, and everything that was found and decided."""
    before = kept()
    write_saved(tmp_path / "x", before)
    after = read_saved(tmp_path / "x")
    assert repr(after.found) == repr(before.found)  # nan differs from itself
    assert (after.model, after.method, after.version) == (before.model, before.method, before.version)
    assert {k: v.tobytes() for k, v in after.numbers.items()} == {k: v.tobytes() for k, v in before.numbers.items()}
    assert (after.clock.counts, after.clock.origin) == (before.clock.counts, before.clock.origin)
    assert (after.clock.last_index, after.clock.last_time, after.clock.usual) == (8, 0.26, 0.02)
    assert len(after.clock.placed) == 2
    assert after.clock.placed[0].repeats(before.clock.placed[0])


def test_a_file_is_replaced_as_a_whole(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who reads while a file is written gets the one before, whole; if writing fails it stays, and no draft is left."""
    path = tmp_path / "x"
    write_saved(path, kept())
    before = path.read_bytes()
    with path.open("rb") as reader:
        write_saved(path, replace(kept(), model="another"))
        assert reader.read() == before
    before = path.read_bytes()

    def fail(*_: object, **__: object) -> None:
        raise OSError

    monkeypatch.setattr(np, "savez", fail)
    with pytest.raises(OSError):  # noqa: PT011 - any
        write_saved(path, kept())
    assert path.read_bytes() == before
    assert list(tmp_path.iterdir()) == [path]
    with pytest.raises(RecordingError, match="cannot be read: No such file"):
        read_saved(tmp_path / "y")
