"""What the verbs do, from the command line to the files."""

import io
import json
import subprocess
import sys
from collections.abc import Callable
from dataclasses import asdict
from itertools import pairwise
from pathlib import Path
from typing import Any

import pytest

import faultbond
from faultbond.app import demonstration
from faultbond.app import plant_run as watching
from faultbond.app.rows import progress
from faultbond.cli import main
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io import Grid, columns_of, on_grid, read_rows
from faultbond.io.out import Out
from faultbond.model.text import load_model
from faultbond.report.inventory import THRESHOLDS, LoopFound, loops_of, settings_of
from faultbond.report.progress import progress_bar
from faultbond.runtime.monitor import Monitor
from faultbond.runtime.trace import Trace
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).parents[2] / "examples"
MODEL = EXAMPLES / "rc" / "model.yaml"
ROWS = 500  # at 50 Hz
Edit = Callable[[list[str]], list[str]]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with inputs.csv, and healthy.csv and faulty.csv made from it."""
    place = tmp_path_factory.mktemp("recordings")
    rows = [f"{k * 0.02:.2f},{(5, 9, 3)[k // 40 % 3]}" for k in range(ROWS)]
    (place / "inputs.csv").write_text("\n".join(["time,V", *rows]) + "\n")
    common = ["simulate", str(MODEL), "--inputs", str(place / "inputs.csv"), "--seed", "1"]
    assert main([*common, "-o", str(place / "healthy.csv")]) == 0
    assert main([*common, "--fault", "C=160@4", "-o", str(place / "faulty.csv")]) == 0
    return place


def records(path: Path) -> list[dict[str, Any]]:
    """Give the records of a file."""
    return [json.loads(line) for line in path.read_text(encoding="utf-8").splitlines()]


def edited(source: Path, target: Path, edit: Edit) -> str:
    """Write a changed copy of a recording; `edit` gets the rows below the header."""
    header, *rows = source.read_text().splitlines()
    target.write_text("\n".join([header, *edit(rows)]) + "\n")
    return str(target)


def blank(column: int) -> Edit:
    """Give an edit that empties a column."""

    def edit(rows: list[str]) -> list[str]:
        cells = [row.split(",") for row in rows]
        return [",".join("" if k == column else cell for k, cell in enumerate(row)) for row in cells]

    return edit


def test_a_healthy_recording(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """No fault is exit code 0 and a sentence that says so; nothing stands on standard error."""
    assert main(["run", str(MODEL), str(folder / "healthy.csv")]) == 0
    shown = capsys.readouterr()
    assert f"No fault found in {ROWS} samples" in shown.out
    assert shown.err == ""


def test_a_fault(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fault is exit code 1, a verdict, a report with the curves, and a line that says where it is."""
    report = tmp_path / "report.html"
    assert main(["run", str(MODEL), str(folder / "faulty.csv"), "--report", str(report)]) == 1
    shown = capsys.readouterr()
    assert "Fault detected at 4." in shown.out
    assert "Most likely C changed" in shown.out
    assert shown.out.endswith(f"Report: {report}\n")
    assert shown.err == ""
    assert "Most likely C changed" in report.read_text(encoding="utf-8")


def test_the_records_of_a_fault(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The records come in order, diagnoses are close together, and the last one is of the last sample."""
    target = tmp_path / "records.jsonl"
    assert main(["run", str(MODEL), str(folder / "faulty.csv"), "--json", str(target)]) == 1
    found = records(target)
    kinds = [record["record"] for record in found]
    assert kinds == ["run", "detection", *["diagnosis"] * (len(found) - 3), "end"]
    alarm, end = found[1], found[-1]
    times = [alarm["time"], *(record["time"] for record in found[2:-1])]
    assert max(b - a for a, b in pairwise(times)) <= 60 * 0.02
    assert len(set(times[1:])) == len(times[1:])
    assert times[-1] == end["time"] == pytest.approx((ROWS - 1) * 0.02)
    assert alarm["sample"] == pytest.approx(alarm["time"] / 0.02)
    assert 3.5 < alarm["change_time"] < alarm["time"]
    for record in found[2:-1]:
        assert sum(candidate["probability"] for candidate in record["candidates"]) == pytest.approx(1.0)
        assert record["candidates"][0]["group"] is True
    assert set(found[-2]["candidates"][0]["parameters"]) == {"C"}
    assert (end["samples"], end["detections"], end["missing"]) == (ROWS, 1, 0)
    assert "Most likely" in capsys.readouterr().out


def test_json_on_standard_output_is_alone(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """With `--json -` every line of standard output is a record, and nothing is kept for people."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(watching, "Trace", None)
        assert main(["run", str(MODEL), str(folder / "healthy.csv"), "--json", "-"]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert [json.loads(line)["record"] for line in lines] == ["run", "end"]


def test_without_a_report_no_curves_are_kept(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Text alone needs no memory that grows with the recording."""
    made: list[bool] = []

    def trace(spec: Any, *, curves: bool, lag: int) -> Trace:
        made.append(curves)
        return Trace(spec, curves=curves, lag=lag)

    monkeypatch.setattr(watching, "Trace", trace)
    main(["run", str(MODEL), str(folder / "healthy.csv")])
    assert made == [False]


def test_a_live_stream(folder: Path) -> None:
    """On standard input each record is written while the stream is still open."""
    rows = (folder / "faulty.csv").read_text().splitlines(keepends=True)
    command = [sys.executable, "-m", "faultbond", "run", str(MODEL), "-"]
    with subprocess.Popen(command, stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.writelines(rows[:-20])
        process.stdin.flush()
        seen = [json.loads(process.stdout.readline()) for _ in range(3)]
        assert [record["record"] for record in seen] == ["run", "detection", "diagnosis"]
        process.stdin.writelines(rows[-20:])
        process.stdin.close()
        last = json.loads(process.stdout.read().splitlines()[-1])
    assert process.returncode == 1
    assert (last["record"], last["samples"]) == ("end", ROWS)


def test_broken_rows_are_counted(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Missing, late, repeated and unreadable rows change no exit code and stand in the last record and in the text."""

    def spoil(rows: list[str]) -> list[str]:
        rows[100] = rows[100].rsplit(",", 1)[0] + ",oops"  # a value that cannot be read
        rows[120] = "noon" + rows[120][rows[120].index(",") :]  # a time that cannot be read
        del rows[140:143]
        rows.insert(200, rows[199])
        rows.insert(205, rows.pop(202))
        return rows

    target = tmp_path / "records.jsonl"
    spoiled = edited(folder / "healthy.csv", tmp_path / "spoiled.csv", spoil)
    assert main(["run", str(MODEL), spoiled, "--json", str(target)]) == 0
    end = records(target)[-1]
    assert {key: end[key] for key in ("samples", "missing", "late", "duplicate")} == {
        "samples": ROWS,
        "missing": 5,
        "late": 1,
        "duplicate": 1,
    }
    assert "5 missing, 1 late, 1 duplicate" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("edit", "reason"),
    [
        (lambda rows: rows[:12], "the recording ended after 12 samples, and the alarms are off for the first 20"),
        (blank(1), "no row has a value of the input V"),
        (blank(2), "no row has a value of the sensor V_C; check the column"),
    ],
)
def test_no_verdict(edit: Edit, reason: str, folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording that tells nothing of the plant is not called healthy, neither in text nor page nor record."""
    poor = edited(folder / "healthy.csv", tmp_path / "poor.csv", edit)
    page, target = tmp_path / "page.html", tmp_path / "records.jsonl"
    assert main(["run", str(MODEL), poor, "--report", str(page), "--json", str(target)]) == 4
    shown = capsys.readouterr()
    assert f"No verdict: {reason}." in shown.out
    assert shown.err == f"faultbond: no verdict: {reason}.\n"
    text = page.read_text(encoding="utf-8")
    assert reason in text
    assert "no verdict</title>" in text
    assert 'class="verdict open"' in text
    assert records(target)[-1]["watched"] == 0
    assert "no fault" not in (shown.out + text).lower()


def test_a_plant_without_a_sensor_in_use_has_no_verdict(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Readings of a sensor that was accepted as stuck tell nothing, so samples that have no other are not watched."""
    stuck = edited(folder / "healthy.csv", tmp_path / "stuck.csv", lambda rows: [*rows[:60], *map(frozen, rows[60:])])
    state, target = tmp_path / "state", tmp_path / "records.jsonl"
    assert main(["run", str(MODEL), stuck, "--state", str(state), "--json", str(target)]) == 1
    assert main(["accept", str(MODEL), str(state), "V_C"]) == 0
    before = records(target)[-1]["watched"]
    later = edited(folder / "faulty.csv", tmp_path / "later.csv", lambda rows: [shifted(row) for row in rows])
    assert main(["run", str(MODEL), later, "--state", str(state), "--json", str(target)]) == 4
    assert "no verdict: no row has a value of a sensor that is in use" in capsys.readouterr().err
    assert records(target)[-1]["watched"] == before


def frozen(row: str) -> str:
    """A row whose sensor reads 5 V whatever happens."""
    return row.rsplit(",", 1)[0] + ",5.0"


def shifted(row: str) -> str:
    """A row a day later."""
    time, rest = row.split(",", 1)
    return f"{float(time) + 86400.0},{rest}"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("time,W,V_C\n0,1,1\n", "no column 'V' (input V)"),
        ("time,V,V_C\n", "there is no row below the header"),
        ("time,V,V_C\nnow,1,1\n", "no row has a time that can be read"),
        ("\n".join(["time,V,V_C", *(f"{k}e9,1,1" for k in range(20))]), "Check the unit of the time column"),
    ],
)
def test_a_recording_that_cannot_be_used(
    text: str, message: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A file that is no recording of this plant is exit code 2 and one line."""
    recording = tmp_path / "r.csv"
    recording.write_text(text)
    assert main(["run", str(MODEL), str(recording)]) == 2
    shown = capsys.readouterr()
    assert message in shown.err
    assert (shown.out, shown.err.count("\n")) == ("", 1)


def test_columns_are_looked_for_before_the_engine_is_built(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A wrong file is refused at once."""
    monkeypatch.setattr(watching, "build_method", lambda *_: pytest.fail("the engine was built"))
    (tmp_path / "r.csv").write_text("time,W\n0,1\n")
    assert main(["run", str(MODEL), str(tmp_path / "r.csv")]) == 2


def test_a_fault_where_nothing_is_a_suspect(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A model file that lets nothing be a suspect has its alarm, and no candidates to accept; `classic` refuses it."""
    text = MODEL.read_text().replace("10 kohm", "{nominal: 10 kohm, suspect: no}")
    text = text.replace("100 uF", "{nominal: 100 uF, suspect: no}") + "instrument_faults: no\n"
    (tmp_path / "m.yaml").write_text(text)
    run = ["run", str(tmp_path / "m.yaml"), str(folder / "faulty.csv")]
    target, state = tmp_path / "r.jsonl", str(tmp_path / "x.state")
    assert main([*run, "--json", str(target), "--state", state, "--accept", "auto"]) == 1
    assert records(target)[-2]["candidates"] == []
    assert "A fault was detected" in capsys.readouterr().out
    assert main(["accept", str(tmp_path / "m.yaml"), state]) == 2
    assert "nothing to accept" in capsys.readouterr().err
    assert main([*run, "--method", "classic"]) == 2
    assert "tests sets of parameters, and none is a suspect" in capsys.readouterr().err


@pytest.mark.parametrize("verb", ["run", "fit", "simulate", "check --data", "demo"])
def test_without_a_compiler_one_line_says_what_to_install(
    verb: str, folder: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """Whatever needs an engine ends with one line on standard error, and nothing on standard output."""
    monkeypatch.setattr("faultbond.synthesis.compile.find_compiler", lambda: None)
    monkeypatch.chdir(tmp_path)
    data = str(folder / "healthy.csv")
    arguments = {
        "run": ["run", str(MODEL), data],
        "fit": ["fit", str(MODEL), data],
        "simulate": ["simulate", str(MODEL), "--inputs", data, "-o", "o.csv"],
        "check --data": ["check", str(MODEL), "--data", data],
        "demo": ["demo"],
    }[verb]
    assert main(arguments) == 2
    shown = capsys.readouterr()
    assert shown.err.count("\n") == 1
    assert shown.err.startswith("There is no C compiler. Install gcc or clang")
    assert "pip install 'faultbond[compiler]'" in shown.err
    assert shown.out == ""
    assert not list(tmp_path.glob("*.html"))


def test_what_needs_no_engine_needs_no_compiler(
    monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """`check` shows a model all the same, and says what a run would need."""
    monkeypatch.setattr("faultbond.synthesis.compile.find_compiler", lambda: None)
    assert main(["check", str(MODEL)]) == 0
    assert "none. There is no C compiler. Install gcc" in " ".join(capsys.readouterr().out.split())


def test_check_names_everything(capsys: pytest.CaptureFixture[str]) -> None:
    """`check` shows every part of the tank, its causality, its loop, its defaults and its settings."""
    tank = EXAMPLES / "tank" / "model.yaml"
    graph = load_model(tank)
    assert main(["check", str(tank)]) == 0
    shown = capsys.readouterr()
    parts = (graph.components, graph.parameters, graph.junctions, graph.inputs, graph.sensors, graph.constants)
    assert [item.name for part in parts for item in part if item.name not in shown.out] == []
    for text in ("e = K1*f*abs(f)", "pump ->| line", "line |-> orifice", "closed form", "derivative", "L-stable"):
        assert text in shown.out
    assert [what for what, _ in graph.defaults if what not in shown.out] == []
    assert max(map(len, shown.out.splitlines())) <= 100
    assert shown.err == ""


def test_check_as_one_record(capsys: pytest.CaptureFixture[str]) -> None:
    """`check --json -` is one object with the same in SI, every bond with its stroke."""
    assert main(["check", str(MODEL), "--json", "-"]) == 0
    record = json.loads(capsys.readouterr().out)
    assert record["record"] == "check"
    assert record["parameters"][0] == {
        "name": "R",
        "component": "R",
        "unit": "kohm",
        "nominal": 1e4,
        "accuracy": 300.0,
        "healthy_change": None,
        "change": 2e4,
        "range": [0.0, None],
        "limits": [],
        "suspect": True,
    }
    assert record["bonds"][-1] == {"tail": "loop", "head": "C", "stroke": "loop"}
    assert record["causality"] == {"integral": ["C"], "derivative": [], "free": []}
    assert record["states"][0]["start"] is None
    assert record["hypotheses"] == {"1": 2}
    assert record["settings"]["cusum_limit"] == 26.0
    assert {"what": "law of R", "value": "e = R*f"} in record["defaults"]


def test_every_setting_has_its_words() -> None:
    """No number of the method is shown by its bare name."""
    spec = build_spec(build_step_model(build_plant(load_model(MODEL))))
    assert set(asdict(spec.thresholds)) == set(THRESHOLDS)
    assert all(" " in meaning for _, meaning in settings_of(spec).values())


def test_loops_are_told() -> None:
    """A loop is told with its signals, the owners of its laws and the way it is solved."""
    loops = loops_of(build_step_model(build_plant(load_model(EXAMPLES / "tank" / "model.yaml"))))
    assert len(loops) == 1
    assert isinstance(loops[0], LoopFound)
    assert "line.f" in loops[0].signals
    assert {"pipe", "orifice", "valve"} <= set(loops[0].components)
    assert loops[0].solution == "closed form"


def test_simulate_is_repeatable_and_in_the_units_of_the_file(folder: Path, tmp_path: Path) -> None:
    """The same seed gives the same file, with the columns of the model; a value in the model's unit is that factor."""
    first, second = tmp_path / "1.csv", tmp_path / "2.csv"
    common = ["simulate", str(MODEL), "--inputs", str(folder / "inputs.csv"), "--seed", "1"]
    assert main([*common, "--fault", "C=x1.6@4", "-o", str(first)]) == 0
    assert main([*common, "--fault", "C=160@4", "-o", str(second)]) == 0
    assert first.read_text() == second.read_text() == (folder / "faulty.csv").read_text()
    header, row, *_ = first.read_text().splitlines()
    assert header == "time,V,V_C"
    assert float(row.split(",")[1]) == pytest.approx(5.0, abs=0.5)


def test_simulate_says_its_seed(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without `--seed` one is drawn and told, and it makes the same recording again."""
    common = ["simulate", str(MODEL), "--inputs", str(folder / "inputs.csv")]
    assert main([*common, "--json", "-", "-o", str(tmp_path / "1.csv")]) == 0
    record = json.loads(capsys.readouterr().out)
    assert (record["record"], record["samples"]) == ("simulate", ROWS)
    assert main([*common, "--seed", str(record["seed"]), "-o", str(tmp_path / "2.csv")]) == 0
    assert f"seed {record['seed']}" in capsys.readouterr().out
    assert (tmp_path / "1.csv").read_text() == (tmp_path / "2.csv").read_text()


def test_simulate_starts_where_the_recording_does(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """An open start is solved from the sensors of the recording, where it has them; `--start` is stronger."""
    first = tmp_path / "first.csv"
    common = ["simulate", str(MODEL), "--seed", "1", "--inputs"]
    assert main([*common, str(folder / "inputs.csv"), "--start", "C.q=0.4 mC", "-o", str(first)]) == 0
    assert "start, as given: C.q 0.0004 C\n" in capsys.readouterr().out
    assert main([*common, str(first), "-o", str(tmp_path / "second.csv"), "--json", "-"]) == 0
    start = json.loads(capsys.readouterr().out)["start"]
    assert start["C.q"] == pytest.approx(0.4e-3, rel=0.1)


def test_simulate_holds_absent_inputs(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Rows and values that lack are filled with the last input, and their number is told."""

    def spoil(rows: list[str]) -> list[str]:
        rows[100] = rows[100].split(",")[0] + ","
        return rows[:210] + rows[213:]

    source = edited(folder / "inputs.csv", tmp_path / "holes.csv", spoil)
    target = tmp_path / "filled.csv"
    assert main(["simulate", str(MODEL), "--inputs", source, "--seed", "1", "-o", str(target)]) == 0
    assert "4 samples lacked an input" in capsys.readouterr().out
    assert target.read_text() == (folder / "healthy.csv").read_text()


@pytest.mark.parametrize(
    ("called", "shown"),
    [
        (".venv/bin/faultbond", ".venv/bin/faultbond"),
        ("x/faultbond/__main__.py", "python -m faultbond"),
        ("/usr/bin/pytest", "faultbond"),
    ],
)
def test_commands_are_shown_as_they_can_be_typed(called: str, shown: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where `faultbond` is not on the path, the demo shows how it was called."""
    monkeypatch.setenv("PATH", "")
    monkeypatch.setattr(sys, "argv", [called])
    assert demonstration._program() == shown


def test_demo(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """`demo` finds the fault that was made, writes the report, and says what to try next; its exit code is 0."""
    monkeypatch.setattr(demonstration, "_program", lambda: "faultbond")
    monkeypatch.chdir(tmp_path)
    assert main(["demo"]) == 0
    shown = capsys.readouterr()
    assert shown.out.startswith("The built-in water tank")
    assert "Engine:" in shown.out.splitlines()[1]
    assert "Most likely the pipe changed: K1 rose" in shown.out
    assert "K1 of the pipe rose to 1.85 times" in shown.out
    assert "faultbond check" in shown.out
    assert (tmp_path / "report.html").stat().st_size > 100_000
    made = (EXAMPLES / "tank" / "make_tank.py").read_text(encoding="utf-8")
    assert 'Fault(parameter="K1", factor=1.85, start=1500.0)' in made


def test_a_progress_bar_passes_everything_on(capsys: pytest.CaptureFixture[str]) -> None:
    """The bar gives the items unchanged and writes nothing on standard output."""
    with progress_bar(200) as follow:
        assert list(follow(["rows"] * 200)) == ["rows"] * 200
    assert capsys.readouterr().out == ""


def test_a_bar_is_for_files_on_a_terminal(folder: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a terminal, or for a live stream, rows pass without a bar."""
    shown: list[int | None] = []
    monkeypatch.setattr("faultbond.report.progress.progress_bar", shown.append)
    monkeypatch.setattr(sys.stderr, "isatty", lambda: True)
    progress(str(folder / "healthy.csv"), Out(text=None, json=None))  # asked for by a program
    out = Out(text=io.StringIO(), json=None)
    for recording, terminal in (("-", True), (str(folder / "healthy.csv"), False), (str(folder / "healthy.csv"), True)):
        monkeypatch.setattr(sys.stderr, "isatty", lambda terminal=terminal: terminal)
        progress(recording, out)
    assert shown == [ROWS]


def test_the_python_interface(folder: Path) -> None:
    """The names of the package run a recording: load, build, watch, step, finish."""
    graph = faultbond.load_model(MODEL)
    _, core = build_engine(graph)
    monitor = Monitor(core)
    reports = []
    for point in on_grid(read_rows(folder / "faulty.csv", columns_of(graph)), Grid(graph.sample_time)):
        sample = faultbond.Sample(time=point.time, dt=point.dt, u=point.u, y=point.y)
        reports.append(monitor.step(sample))
    assert [report.status for report in (reports[0], reports[-1])] == [
        faultbond.Status.STARTING,
        faultbond.Status.DIAGNOSING,
    ]
    diagnosis = monitor.finish()
    assert diagnosis is not None
    assert diagnosis.candidates[0].parameters == ("C",)
