"""From Python: a run gives what the command line records, in whatever the recording comes, at once or row by row."""

import json
import subprocess
import sys
from collections.abc import Callable
from decimal import Decimal
from pathlib import Path
from typing import Any

import numpy as np
import pandas
import polars
import pyarrow
import pytest

import faultbond as fb
from faultbond.cli import main
from faultbond.contract.json_records import decision_record, detection_record, diagnosis_record
from faultbond.errors import FaultbondError

EXAMPLES = Path(__file__).parents[3] / "examples"
MODEL, RECORDING = EXAMPLES / "rc" / "model.yaml", EXAMPLES / "rc" / "fault_capacitor.csv"
ROWS = 1500  # the alarm is at 1008


@pytest.fixture(scope="module")
def short(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give the first rows of a recording with a fault."""
    path = tmp_path_factory.mktemp("short") / "short.csv"
    path.write_text("".join(RECORDING.read_text().splitlines(keepends=True)[: ROWS + 1]))
    return path


@pytest.fixture(scope="module")
def told(short: Path) -> list[dict[str, Any]]:
    """Give the records of the command line."""
    target = short.with_suffix(".jsonl")
    assert main(["run", str(MODEL), str(short), "--json", str(target)]) == 1
    return records(target)


def records(path: Path) -> list[dict[str, Any]]:
    """Give the records of a file."""
    return [json.loads(line) for line in path.read_text().splitlines()]


def of(kind: str, told: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Give the records of a kind."""
    return [item for item in told if item["record"] == kind]


def plainly(record: object) -> Any:
    """Give a record as a file has it."""
    return json.loads(json.dumps(record))


def check_same(result: fb.Result, told: list[dict[str, Any]]) -> None:
    """A result says what the records of the command line say."""
    assert plainly([detection_record(item) for item in result.detections]) == of("detection", told)
    assert plainly([diagnosis_record(item) for item in result.diagnoses]) == of("diagnosis", told)
    assert {"record": "end", "silent": []} | dict(result.counts) == of("end", told)[0]


def test_a_run_gives_what_the_command_line_records(short: Path, told: list[dict[str, Any]], tmp_path: Path) -> None:
    """Alarms, diagnoses, candidates and counts are those of the records; the file of records is the same one."""
    result = fb.run(fb.load(MODEL), short, json=tmp_path / "records.jsonl", report=tmp_path / "report.html")
    assert (result.verdict, result.no_verdict) == ("fault", "")
    check_same(result, told)
    assert (tmp_path / "records.jsonl").read_text() == short.with_suffix(".jsonl").read_text()
    assert "RC circuit" in (tmp_path / "report.html").read_text()
    last = of("diagnosis", told)[-1]["candidates"]
    assert len(result.candidates) == len(last)
    for item, record in zip(result.candidates, last, strict=True):
        assert (list(item.components), item.probability, item.group) == (
            record["components"],
            record["probability"],
            record["group"],
        )
        assert (item.kind, dict(item.kinds), item.present) == (record["kind"], record["kinds"], record["present"])
        si = {name: (value.nominal_si, value.estimate_si, value.sd_si) for name, value in item.parameters.items()}
        assert si == {name: tuple(value[key] for key in KEYS) for name, value in record["parameters"].items()}


KEYS = ("nominal", "estimate", "sd")


def test_values_are_in_the_units_of_the_model(short: Path) -> None:
    """A value is given in the unit of the model file, and in SI beside it."""
    best = fb.run(MODEL, short).best
    assert best is not None
    found = best.parameters["C"]
    assert (found.unit, found.nominal) == ("uF", 100.0)
    assert found.nominal_si == pytest.approx(1e-4)
    assert found.estimate == pytest.approx(1e6 * found.estimate_si)
    assert found.sd == pytest.approx(1e6 * found.sd_si)
    assert str(best).startswith("C: C 100 -> 1")


def test_a_static_network_is_run_alike(tmp_path: Path) -> None:
    """A network without time gives its minimal diagnoses, and says that it has no curves."""
    model, rows = EXAMPLES / "thesis" / "fig_3_12.yaml", EXAMPLES / "thesis" / "fig_3_12.csv"
    main(["run", str(model), str(rows), "--json", str(tmp_path / "told.jsonl")])
    found, result = records(tmp_path / "told.jsonl"), fb.run(model, rows)
    assert plainly([detection_record(item) for item in result.detections]) == of("detection", found)
    assert plainly(diagnosis_record(result.diagnoses[-1])) == of("diagnosis", found)[-1]
    assert {"record": "end", "silent": []} | dict(result.counts) == of("end", found)[0]
    assert result.best is not None
    assert "contradicts the healthy network" in str(result)
    assert ": row 0 contradicts the healthy network: " in result._repr_html_()
    for curves in (result.to_frame, result.plot, lambda: result.report(tmp_path / "no.html")):
        with pytest.raises(FaultbondError, match="a network without time has no curves"):
            curves()
    with pytest.raises(FaultbondError, match="is diagnosed row by row, by `run`"):
        fb.Monitor(model)


def columns(path: Path) -> dict[str, Any]:
    """Give the columns of a recording as arrays."""
    table = np.genfromtxt(path, delimiter=",", names=True)
    return {name: table[name] for name in table.dtype.names or ()}


FRAMES: dict[str, Callable[[dict[str, Any]], object]] = {
    "dict": dict,
    "pandas": pandas.DataFrame,
    "polars": polars.DataFrame,
    "pyarrow": pyarrow.table,
}


@pytest.mark.parametrize("kind", FRAMES)
def test_frames_give_the_result_of_the_file(kind: str, short: Path, told: list[dict[str, Any]]) -> None:
    """A frame of any library gives what its file gives."""
    check_same(fb.run(MODEL, FRAMES[kind](columns(short))), told)


def pushed(monitor: fb.Monitor, path: Path, first: int = 0, last: int | None = None) -> list[dict[str, Any]]:
    """Give the records of what a monitor says to rows of a file."""
    found, values = [], columns(path)
    for k in range(first, len(values["time"]) if last is None else last):
        event = monitor.update(values["time"][k], {"V": values["V"][k], "V_C": values["V_C"][k]})
        if event is not None and event.detection is not None:
            found.append(plainly(detection_record(event.detection)))
        if event is not None and event.diagnosis is not None:
            found.append(plainly(diagnosis_record(event.diagnosis)))
            assert event.time == found[-1]["time"]
    return found


def test_row_by_row_gives_what_a_run_gives(short: Path, told: list[dict[str, Any]]) -> None:
    """A monitor says at each row what the run of the whole recording records, and at the end its last diagnosis."""
    monitor = fb.Monitor(fb.load(MODEL))
    found = pushed(monitor, short)
    last = monitor.finish()
    if last is not None and last.diagnosis is not None:
        found.append(plainly(diagnosis_record(last.diagnosis)))
    assert found == [item for item in told if item["record"] in ("detection", "diagnosis")]
    assert {"record": "end", "silent": []} | dict(monitor.counts) == of("end", told)[0]
    assert (monitor.verdict, monitor.no_verdict) == ("fault", "")
    assert monitor.best is not None
    assert monitor.best.components == ("C",)


@pytest.mark.parametrize("cut", [1, 10, 700, 1009, 1012, 1060])
def test_saved_anywhere_it_goes_on(cut: int, short: Path, told: list[dict[str, Any]], tmp_path: Path) -> None:
    """A monitor that is saved and restored says the same as one that was not; its file knows the model."""
    monitor = fb.Monitor(MODEL)
    found = pushed(monitor, short, 0, cut)
    monitor.save(tmp_path / "plant.state")
    restored = fb.Monitor.restore(tmp_path / "plant.state")
    assert restored.model == fb.load(MODEL)
    found += pushed(restored, short, cut)
    known = [item for item in told if item["record"] in ("detection", "diagnosis")]
    assert found == known[: len(found)]
    assert len(found) >= len(known) - 1  # the last one is that of the end


def test_the_file_is_that_of_a_kept_run(short: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What a monitor saved the command line accepts in, and what that kept a monitor goes on from."""
    monitor, state = fb.Monitor(MODEL), tmp_path / "plant.state"
    pushed(monitor, short)
    monitor.save(state)
    assert main(["accept", str(MODEL), str(state), "C"]) == 0
    assert "C" in capsys.readouterr().out
    restored = fb.Monitor.restore(state)
    assert (restored.detection, restored.accepted[-1].candidate.components) == (None, ("C",))
    kept = tmp_path / "kept.state"
    result = fb.run(MODEL, short, state=kept)
    followed = fb.Monitor.restore(kept, MODEL)
    assert followed.detection == result.detection
    assert decision_record(followed.accept())["components"] == ["C"]
    with pytest.raises(FaultbondError, match=r"^nothing is named"):
        fb.reject(MODEL, kept)
    decided = fb.accept(MODEL, kept, "C", repaired=True)
    assert (decided.repaired, decided.candidate.components) == (True, ("C",))
    with pytest.raises(FaultbondError, match="no alarm to explain"):
        fb.reject(MODEL, kept, "C")


def test_a_person_decides(short: Path) -> None:
    """A candidate is accepted, said to be repaired, or rejected, by its name; without an alarm nothing is."""
    monitor = fb.Monitor(MODEL)
    with pytest.raises(FaultbondError, match="no alarm to explain"):
        monitor.accept()
    pushed(monitor, short)
    with pytest.raises(FaultbondError, match="pump: nothing that is suspected is called so"):
        monitor.accept("pump")
    with pytest.raises(FaultbondError, match="name the candidate"):
        monitor.reject()
    assert f"fault, {monitor.counts['samples']} samples, since " in monitor._repr_html_()
    assert "<td>C</td>" in monitor._repr_html_()
    assert monitor.reject("C").candidate.components == ("C",)
    assert monitor.best is not None
    assert monitor.best.components != ("C",)
    assert monitor.repaired().repaired
    assert monitor.detection is None
    assert not monitor.candidates


def test_a_rule_decides(short: Path, tmp_path: Path) -> None:
    """With `accept` a run and a monitor accept as the command line does."""
    target = tmp_path / "told.jsonl"
    main(["run", str(MODEL), str(short), "--accept", "auto", "--json", str(target)])
    accepted = of("accepted", records(target))
    result = fb.run(MODEL, short, accept="auto")
    assert plainly([decision_record(item) for item in result.accepted]) == accepted
    monitor = fb.Monitor(MODEL, accept=0.95)
    pushed(monitor, short)
    assert plainly([decision_record(item) for item in monitor.accepted]) == accepted
    assert accepted


ROW = {"V": 1.0, "V_C": 0.0}
MISTAKES: dict[str, tuple[Callable[[], object], str]] = {
    "no model": (lambda: fb.run(3, ROW), "int: this is no model. Give what `load` gives"),  # type: ignore[arg-type]
    "no file": (lambda: fb.load("nowhere.yaml"), "nowhere.yaml: cannot be read"),
    "no recording": (lambda: fb.run(MODEL, 3), "int: this is no recording"),
    "a column": (lambda: fb.run(MODEL, {"time": [0.0], "v": [1.0], "V_C": [1.0]}), "Did you mean 'v'"),
    "time that goes back": (
        lambda: fb.run(MODEL, {"time": np.arange(99.0)[::-1], "V": np.ones(99), "V_C": np.ones(99)}),
        "the recording: row 2: most rows are earlier than all before.*Sort them by time",
    ),
    "a method": (lambda: fb.run(MODEL, ROW, method="best"), "method='best': expected bank or classic"),
    "a level": (lambda: fb.run(MODEL, ROW, accept=0.2), "accept=0.2: expected auto, or a probability"),
    "no folder": (lambda: fb.run(MODEL, RECORDING, state="nowhere/x.state"), "there is no folder nowhere"),
    "an example": (lambda: fb.example("moon"), "there is no example 'moon'. There are "),
    "a first row": (lambda: fb.Monitor(MODEL).update(0.0, {"V": 1.0}), "the first row: no column 'V_C'"),
    "no row": (lambda: fb.Monitor(MODEL).update(0.0, 3.0), "float: expected values by column"),  # type: ignore[arg-type]
    "a list": (lambda: fb.Monitor(MODEL).update(0.0, ROW | {"V": [1.0]}), "column 'V' is a list. Give a number"),
    "a time": (lambda: fb.Monitor(MODEL).update("noon", ROW), "time 'noon': expected seconds"),
    "nothing to save": (lambda: fb.Monitor(MODEL).save("x.state"), "nothing to save before the first row"),
    "no state": (lambda: fb.Monitor.restore("nowhere.state"), "nowhere.state: cannot be read"),
}


@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_are_the_users(kind: str) -> None:
    """A mistake is one error that names what is wrong and what is expected."""
    call, message = MISTAKES[kind]
    with pytest.raises(FaultbondError, match=message) as caught:
        call()
    assert "\n" not in str(caught.value)


def test_times_of_rows() -> None:
    """A row's time is a number, a date and time of Python or numpy, or an ISO text; they are the same moment."""
    moment = pandas.Timestamp("2026-03-01T12:00:00Z")
    for time in ("2026-03-01T12:00:00Z", moment.to_pydatetime(), moment, np.datetime64("2026-03-01T12:00:00")):
        monitor = fb.Monitor(MODEL)
        assert monitor.update(time, ROW) is None
        assert monitor.counts["time"] == moment.timestamp()


def test_values_of_rows() -> None:
    """A value is any number, a text of one, or none; what is missing is counted."""
    monitor = fb.Monitor(MODEL)
    for k, value in enumerate((1, 1.0, Decimal(1), np.float32(1.0), "1", 1)):
        monitor.update(0.02 * k, {"V": value, "V_C": 0.0, "more": object()})
    assert monitor.counts["missing"] == 0
    for k, value in enumerate((None, float("nan"), pandas.NA, ""), start=6):
        monitor.update(0.02 * k, {"V": value, "V_C": 0.0})
    monitor.update(0.2, {"V_C": 0.0})
    assert (monitor.counts["missing"], monitor.counts["samples"]) == (5, 11)


def test_results_show_themselves(short: Path) -> None:
    """A result prints what the command line prints, shows a table in a notebook, and cannot be changed."""
    result = fb.run(MODEL, short)
    assert "Fault detected at" in str(result)
    assert "<td>C</td>" in result._repr_html_()
    assert result.best is not None
    assert result.detection is not None
    assert "<td>C</td>" in result.best._repr_html_()
    assert f"<th>time</th><td>{result.detection.time:.9g}</td>" in result.detection._repr_html_()
    assert "best C: C" in repr(result)
    with pytest.raises(AttributeError):
        result.model = fb.load(MODEL)  # type: ignore[misc]
    frame = result.to_frame()
    assert list(frame) == ["time", "V", "V_C", "V_C_expected", "V_C_expected_sd"]
    assert frame.units["V_C_expected"] == "V"
    assert frame.n_rows == ROWS
    assert np.array_equal(frame["V_C"], columns(short)["V_C"])
    with pytest.raises(ValueError, match="read-only"):
        frame["V"][0] = 1.0
    assert frame.to_pandas().equals(pandas.DataFrame(frame))
    assert frame.to_polars().equals(polars.DataFrame(frame))
    assert frame.to_arrow()["V"].equals(pyarrow.table(frame)["V"])
    assert pyarrow.RecordBatchReader.from_stream(frame).read_all()["V"].equals(frame.to_arrow()["V"])
    assert f"{ROWS} rows" in frame._repr_html_()


def test_what_is_not_installed_is_told(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who lacks a library is told how to install it."""
    result = fb.run(MODEL, short)
    for name, call in (
        ("matplotlib", result.plot),
        ("pandas", result.to_frame().to_pandas),
        ("polars", result.to_frame().to_polars),
        ("pyarrow", result.to_frame().to_arrow),
        ("pyarrow", result.to_frame().__arrow_c_stream__),
    ):
        monkeypatch.setitem(sys.modules, name, None)
        with pytest.raises(FaultbondError, match=r"pip install"):
            call()


def test_a_plot_shows_sensors_and_candidates(short: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A figure has a part for each sensor, and one for the candidates; lines are where the alarm is."""
    monkeypatch.setenv("MPLBACKEND", "agg")
    result = fb.run(MODEL, short)
    figure = result.plot()
    assert [part.get_ylabel() for part in figure.axes] == ["V_C (V)", "probability"]
    measured = figure.axes[0].get_lines()[0]
    assert np.array_equal(np.asarray(measured.get_ydata()), result.to_frame()["V_C"])
    assert figure.axes[1].get_lines()[0].get_label() == "C"


def test_the_package_is_light() -> None:
    """Importing the package loads no library, and its functions stay functions when packages of their names load."""
    code = (
        "import sys, faultbond as fb\n"
        "assert not {'numpy', 'casadi', 'yaml', 'pint', 'rich', 'pandas', 'matplotlib'} & {*sys.modules}\n"
        "import faultbond.fit.pace, faultbond.simulate\n"
        "print(fb.fit.__module__, fb.simulate.__module__)\n"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.split() == ["faultbond.api.verbs"] * 2


@pytest.mark.parametrize("given", [True, np.bool_(True), "Bad Input", {"a": 1}])
def test_a_monitor_takes_numbers_only(given: object) -> None:
    """Truth values and texts that are no number are refused by the column; signs that there is no value are none."""
    monitor = fb.Monitor(fb.example("rc"))
    with pytest.raises(fb.FaultbondError, match=r"column 'V_C' is .* Give a number"):
        monitor.update(0.0, {"V": 5.0, "V_C": given})
    for k, value in enumerate(["", "n/a", "NaN", None, "4.5", 4.5]):
        monitor.update(0.02 * k, {"V": 5.0, "V_C": value})
    assert (monitor.counts["samples"], monitor.counts["missing"]) == (6, 4)


def test_a_column_that_comes_later_is_a_mistake() -> None:
    """A name that is misspelt in a later row is told with those of the first row; one may be left out."""
    monitor = fb.Monitor(fb.example("rc"))
    monitor.update(0.0, {"V": 5.0, "V_C": 0.0, "remark": "begun"})
    monitor.update(0.02, {"V": 5.0})
    with pytest.raises(fb.FaultbondError, match="no column 'V_c' was in the first row, which had V, V_C, remark"):
        monitor.update(0.04, {"V": 5.0, "V_c": 0.1})
    assert repr(monitor) == "<Monitor of 'RC circuit': none, 2 samples>"


def test_truth_values_are_no_numbers_and_texts_no_truth_values(tmp_path: Path) -> None:
    """A column of them, accept=True and watch_only="no" are refused in a line."""
    model = fb.example("rc")
    rows = {"time": [0.0, 0.02, 0.04], "V": [1.0, 1.0, 1.0], "V_C": [True, False, True]}
    with pytest.raises(fb.FaultbondError, match=r"column 'V_C' \(sensor V_C\) holds truth values"):
        fb.run(model, rows)
    with pytest.raises(fb.FaultbondError, match="accept=True: expected auto, or a probability"):
        fb.Monitor(model, accept=True)
    with pytest.raises(fb.FaultbondError, match="watch_only='no': expected True or False"):
        fb.generate(model, tmp_path / "plant", watch_only="no")  # type: ignore[arg-type]
    made = fb.simulate(model, {"time": [0.0, 0.02, 0.04], "V": [1.0, 1.0, 1.0]}, seed=1)
    assert repr(made) == "<Simulation of 'RC circuit': 3 samples, 0 s to 0.04 s, seed 1>"


def test_a_result_tells_a_sensor_that_never_read() -> None:
    """Its name is in `silent`, and in what a notebook shows."""
    model = fb.example("dc_motor_current")
    table = {
        "time": 0.02 * np.arange(400), "V": np.full(400, 20.0), "omega": np.full(400, np.nan), "i": np.full(400, 0.5)
    }  # fmt: skip
    result = fb.run(model, table)
    assert [(item.name, item.values) for item in result.silent] == [("omega", 0)]
    assert result.detection is not None or "The sensor omega gave no value" in result._repr_html_()


def test_a_plant_is_not_called_healthy_by_half_of_its_sensors() -> None:
    """No fault was found by the others: that is `partial`, of a result and of a monitor, with the names of the rest."""
    model = fb.example("dc_motor_current")
    whole = np.genfromtxt(model.recordings["healthy"], delimiter=",", names=True)[:600]
    table = {name: whole[name].copy() for name in ("time", "V", "omega", "i")}
    assert fb.run(model, table).verdict == "healthy"
    table["i"][:] = np.nan
    result = fb.run(model, table)
    assert result.verdict == "partial"
    assert repr(result) == "<Result of 'DC motor with current': partial, not watched: i>"
    monitor = fb.Monitor(model)
    for time, *values in zip(*table.values(), strict=True):
        monitor.update(time, dict(zip(("V", "omega", "i"), values, strict=True)))
    assert monitor.verdict == "partial"
    assert repr(monitor).endswith(", not watched: i>")


HIDDEN = """
name: filling
sample_time: 1 s
max_faults: 1
constants: {p0: 60 bar}
inputs: {ps: {unit: bar}}
components:
  orifice: {type: Sf, law: "f = K*sqrt(max(ps - vessel.e, 0))", parameters: {K: 1e-8 m^3/s/Pa^0.5}}
  store: {type: C, law: q = C*e, parameters: {C: 1e-9 m^3/Pa}}
  outlet: {type: Sf, law: "f = -L*max(vessel.e - p0, 0)", parameters: {L: 1e-11 m^3/s/Pa}}
junctions: {vessel: 0}
bonds: [orifice -> vessel -> store, outlet -> vessel]
sensors: {p: {reads: vessel.e, unit: bar, noise: 0.1 bar}}
"""


def test_what_was_not_tested_is_told_after_an_alarm(tmp_path: Path) -> None:
    """A leak that shows from 60 bar on is in no hypothesis of a model that was never fitted, and others are no answer.

    In a notebook none of them is told as likely. Once it is known where the supply is, the leak is the answer.
    """
    model = tmp_path / "model.yaml"
    model.write_text(HIDDEN, encoding="utf-8")
    time = np.arange(800.0)
    inputs = {"time": time, "ps": np.where(time % 200.0 < 100.0, 160.0, 140.0)}
    made = fb.simulate(fb.load(model), inputs, faults="L=x2@400", seed=1, start={"store.q": "0.012 m^3"})
    told = fb.run(fb.load(model), made.to_frame())
    hint = "It was not tested whether L changed, of which no run with the model showed anything"
    assert hint in str(told)
    assert "contradicted" in repr(told)
    assert "%" not in repr(told)
    assert "The data contradict them all" in told._repr_html_()
    assert "%" not in told._repr_html_()
    model.write_text(
        HIDDEN.replace("{unit: bar}}\ncomp", "{unit: bar, fitted_range: [130, 170]}}\ncomp"), encoding="utf-8"
    )
    known = fb.run(fb.load(model), made.to_frame())
    assert hint not in str(known)
    assert known.best is not None
    assert known.best.parameters["L"].estimate == pytest.approx(2e-11, rel=0.1)
    assert "%" in repr(known)
