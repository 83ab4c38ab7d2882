"""Operating states: outside its condition a model, or a sensor, is not judged, and after it all goes on."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import heated
from faultbond.app.identification import read_points
from faultbond.cli.program import main
from faultbond.contract.findings import Diagnosis
from faultbond.contract.samples import STATUSES, Reports, Samples, Status
from faultbond.errors import NoVerdictError
from faultbond.fit.samples import judged_parts
from faultbond.io.recording import write_recording
from faultbond.model.text import load_model, parse_model
from faultbond.runtime.fleet import Fleet
from faultbond.runtime.monitor import Monitor
from faultbond.synthesis.compile import find_compiler
from faultbond.synthesis.engine import build_engine
from pumped import TEXT, VALID, core, course, watched

pytestmark = pytest.mark.skipif(find_compiler() is None, reason="no C compiler on this machine")
OFF = ((600, 1000), (1800, 2300), (2900, 3100))
OUTSIDE = STATUSES.index(Status.OUTSIDE)


def diagnoses(blocks: list[Reports]) -> list[Diagnosis]:
    """All of them, in order."""
    return [block.diagnosis for block in blocks if block.diagnosis is not None]


def alarm(blocks: list[Reports]) -> float | None:
    """When it was raised; None: it was not."""
    return next((block.detection.time for block in blocks if block.detection is not None), None)


def first(blocks: list[Reports]) -> tuple[str, ...]:
    """The parameters of the best candidate at the end."""
    return diagnoses(blocks)[-1].candidates[0].parameters


def test_a_pump_that_is_off_is_no_fault() -> None:
    """A healthy plant whose pump is off at times does not alarm; by a model that knows nothing of it, it does."""
    samples = course(OFF, 3600)
    blocks = watched(Monitor(core()), samples)
    assert alarm(blocks) is None
    status = np.concatenate([block.status for block in blocks])
    outside = [k for a, b in OFF for k in range(a, b + 20)]
    assert np.flatnonzero(status == OUTSIDE).tolist() == outside
    assert (alarm(watched(Monitor(core(states=False)), samples[:1100])) or 0.0) >= OFF[0][0]


@pytest.mark.parametrize(("parameter", "factor"), [("K", 0.9), ("Rp", 1.4), ("C", 0.7), ("Ro", 0.8)])
def test_a_fault_has_its_name_whenever_it_begins(parameter: str, factor: float) -> None:
    """What goes wrong while the pump runs is found then, and what goes wrong while it is off is found after that."""
    for begins, expected, rows in ((1300, 1300, 1800), (2000, 2320, 2900)):
        blocks = watched(Monitor(core()), course(OFF, rows, (parameter, factor, begins)))
        assert expected < (alarm(blocks) or 0.0) < expected + 300
        assert first(blocks) == (parameter,)


def test_nothing_changes_while_the_model_does_not_hold() -> None:
    """Sums and likelihoods stand still, and what is told again and again is the same; the states are wide after it."""
    samples, monitor = course(OFF, 2400, ("Rp", 1.4, 1200)), Monitor(core())
    watched(monitor, samples[:1800])
    sums, lane = monitor.numbers("sensors.cusum"), monitor.numbers("healthy.lane")
    likelihoods = [monitor.lane(k)[-1] for k in range(4)]
    blocks = watched(monitor, samples[1800:2320])
    told = diagnoses(blocks)
    assert len(told) == 26
    before = told[0]
    for found in told:
        assert [item.parameters for item in found.candidates] == [item.parameters for item in before.candidates]
        # a drift of something else that is hardly one goes on meanwhile, and with it what is within the accuracy
        assert found.candidates[0].probability == pytest.approx(before.candidates[0].probability, abs=1e-7)
    assert [monitor.lane(k)[-1] for k in range(4)] == likelihoods
    assert (monitor.numbers("sensors.cusum") == sums).all()
    assert monitor.numbers("healthy.lane")[:5] == pytest.approx(lane[:5], rel=1e-12)
    last = watched(monitor, samples[2320:2321])[-1].last
    assert last.status is Status.DIAGNOSING
    assert np.sqrt(last.variance[1]) > 1e4


def test_an_alarm_outlives_a_long_pause() -> None:
    """A fault whose alarm is long past the samples that are kept when the pump runs again still has its name."""
    blocks = watched(Monitor(core()), course(((520, 1500),), 1900, ("C", 0.7, 470)))
    assert 470 < (alarm(blocks) or 0.0) < 520
    assert first(blocks) == ("C",)


@pytest.mark.parametrize("at", [700, 1005, 1019, 1021, 1990])
def test_a_restart_makes_no_difference(at: int) -> None:
    """A run that is saved and goes on, within a time in which nothing is judged or just after it, ends the same."""
    samples, whole = course(OFF, 2400, ("K", 0.9, 900)), Monitor(core())
    watched(whole, samples)
    begun = Monitor(core())
    watched(begun, samples[:at])
    again = Monitor(core(), begun.save())
    watched(again, samples[at:])
    assert (again.save() == whole.save()).all()


def test_a_run_may_begin_while_the_model_does_not_hold() -> None:
    """Then it begins where it does, and not with what was before."""
    blocks = watched(Monitor(core()), course(((0, 300),), 900))
    status = np.concatenate([block.status for block in blocks])
    assert (status[:320] == OUTSIDE).all()
    assert status[320] == STATUSES.index(Status.STARTING)
    assert alarm(blocks) is None


def test_a_fleet_judges_each_asset_by_its_own_state() -> None:
    """Assets that are off at different times find what monitors of their own do."""
    runs = [course(((600 + 50 * k, 900 + 40 * k),), 1500, ("K", 0.9, 800) if k % 2 else None, seed=k) for k in range(5)]
    fleet = Fleet(core(), len(runs))
    u, y = np.stack([run.u for run in runs]), np.stack([run.y for run in runs])
    events = fleet.block(runs[0].time, u, y)
    raised = {item.asset: item.detection.time for item in events if item.detection is not None}
    alone = {k: time for k, run in enumerate(runs) if (time := alarm(watched(Monitor(core()), run))) is not None}
    assert raised == alone
    assert set(raised) == {1, 3}


def test_a_sensor_has_a_state_of_its_own() -> None:
    """Where one does not read as stated the others are judged; a fault that they show is found meanwhile."""
    text = TEXT.replace("noise: 2e-6 m^3/s}", "noise: 2e-6 m^3/s, valid_when: {when: running == 1, settling: 5 s}}")
    core_of_it = build_engine(parse_model(text))[1]
    samples = course((), 1200)
    off = (np.arange(1200) >= 400) & (np.arange(1200) < 700)
    samples = replace(samples, u=np.column_stack([samples.u[:, 0], 1.0 - off]), y=samples.y.copy())
    samples.y[off, 0] = 0.0
    blocks = watched(Monitor(core_of_it), samples)
    left_out = np.concatenate([block.left_out for block in blocks])
    assert np.flatnonzero(left_out[:, 0]).tolist() == list(range(400, 705))
    assert not left_out[:, 1].any()
    assert alarm(blocks) is None
    leaking = course((), 1200, ("Ro", 0.8, 450))
    assert (
        450
        < (
            alarm(watched(Monitor(core_of_it), replace(samples, y=np.column_stack([samples.y[:, 0], leaking.y[:, 1]]))))
            or 0
        )
        < 700
    )


def test_inputs_under_which_a_law_has_no_value_do_no_harm() -> None:
    """While a pump stands its speed is 0, and the model divides by it; the filter goes on after that."""
    text = VALID + TEXT.replace("e = K*speed**2", "e = K*speed**3/speed + log(speed/speed)*one").replace(
        "inputs:", "constants: {one: 1 Pa}\ninputs:"
    )
    samples = course(((600, 1000),), 1500)
    stands = np.where(samples.u[:, 1] > 0.0, samples.u[:, 0], 0.0)
    blocks = watched(
        Monitor(build_engine(parse_model(text))[1]), replace(samples, u=np.column_stack([stands, samples.u[:, 1]]))
    )
    status = {STATUSES[k] for block in blocks for k in block.status}
    assert Status.LOST not in status
    assert alarm(blocks) is None


def test_a_condition_may_be_logged_when_it_changes() -> None:
    """Where the state is told only when it changes, it is what it was told last."""
    samples = course(OFF, 1500)
    told = np.r_[True, np.diff(samples.u[:, 1]) != 0.0]
    seldom = replace(samples, u=np.column_stack([samples.u[:, 0], np.where(told, samples.u[:, 1], np.nan)]))
    blocks, usual = watched(Monitor(core()), seldom), watched(Monitor(core()), samples)
    for one, other in zip(blocks, usual, strict=True):
        assert (one.left_out == other.left_out).all()
    assert alarm(blocks) is None


def recording(path: Path, samples: Samples) -> Path:
    """A file of samples."""
    columns = {"time": samples.time, "speed": samples.u[:, 0], "running": samples.u[:, 1]}
    write_recording(path, columns | {"flow": samples.y[:, 0], "level": samples.y[:, 1]})
    return path


def model(folder: Path) -> Path:
    """A file of the model."""
    path = folder / "pumped.yaml"
    path.write_text(VALID + TEXT)
    return path


def test_records_tell_what_was_not_judged(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`run` counts it, marks diagnoses that are told meanwhile, and says why there is no verdict where none is."""
    path, out = model(tmp_path), tmp_path / "found.jsonl"
    faulty = recording(tmp_path / "faulty.csv", course(OFF, 2000, ("Rp", 1.4, 1500)))
    assert main(["run", str(path), str(faulty), "--json", str(out)]) == 1
    capsys.readouterr()
    lines = out.read_text().splitlines()
    assert '"outside": 620' in lines[-1]
    assert sum('"outside": true' in line for line in lines) == 10
    off = recording(tmp_path / "off.csv", course(((15, 400),), 400))
    assert main(["run", str(path), str(off)]) == 4
    assert "the model holds, by `valid_when`, in 15 of 400 samples" in capsys.readouterr().err


def test_method_classic_says_that_it_has_no_states(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It judges every row, so it is refused."""
    rows = recording(tmp_path / "rows.csv", course((), 100))
    assert main(["run", str(model(tmp_path)), str(rows), "--method", "classic"]) == 2
    assert "knows no `valid_when`" in capsys.readouterr().err


def test_a_fit_takes_the_rows_for_which_the_model_holds(tmp_path: Path) -> None:
    """Each time between two pauses is fitted by itself; one that is too short is left out."""
    path = model(tmp_path)
    graph = parse_model(path.read_text())
    points = read_points(graph, str(recording(tmp_path / "rows.csv", course(((200, 300), (340, 500)), 700))))
    parts = judged_parts("rows.csv", points, core())
    assert [(name, part[0].time, part[-1].time) for name, part in parts] == [
        ("rows.csv, part 1", 0.0, 199.0),
        ("rows.csv, part 2", 520.0, 699.0),
    ]
    with pytest.raises(NoVerdictError, match="nowhere does the model hold for 40 samples in a row"):
        judged_parts("rows.csv", points[320:520], core())


def test_a_fit_finds_the_plant_in_spite_of_pauses(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """The fitted parameters are those of the plant while it runs."""
    rows, fitted = (
        recording(tmp_path / "rows.csv", course(((300, 500),), 900, ("Rp", 1.2, 0))),
        tmp_path / "fitted.yaml",
    )
    assert main(["fit", str(model(tmp_path)), str(rows), "-o", str(fitted), "--free", "Rp"]) == 0
    capsys.readouterr()
    assert parse_model(fitted.read_text()).parameter("Rp").nominal == pytest.approx(1.2 * 4e10, rel=0.12)
    assert "valid_when" in fitted.read_text()


@pytest.mark.parametrize(("lag", "order"), [(False, 1), (True, 1), (True, 2)])
def test_a_law_without_a_value_does_no_harm_where_its_sensor_is_not_valid(*, lag: bool, order: int) -> None:
    """A heater at rest divides by no flow: a healthy room does not alarm, and a weak heater has its name."""
    healthy = heated.course(1400, lag=lag, order=order)
    blocks = watched(Monitor(heated.core(lag=lag, order=order)), healthy)
    assert alarm(blocks) is None
    status = np.concatenate([block.status for block in blocks])
    assert np.flatnonzero(status == STATUSES.index(Status.STARTING)).max() < 30  # it never lost the plant
    faulty = heated.course(1400, lag=lag, order=order, gain=0.8, begins=700)
    blocks = watched(Monitor(heated.core(lag=lag, order=order)), faulty)
    assert 700 <= (alarm(blocks) or 0.0) < 800
    assert first(blocks) == ("G",)


def written(folder: Path, model: str, samples: Samples) -> tuple[Path, Path]:
    """Write the model of the room, and a recording."""
    (folder / "heated.yaml").write_text(model, encoding="utf-8")
    columns = {"time": samples.time, "power": samples.u[:, 0], "flow": samples.u[:, 1]}
    write_recording(folder / "resting.csv", columns | {"inside": samples.y[:, 0], "blown": samples.y[:, 1]})
    return folder / "heated.yaml", folder / "resting.csv"


def test_a_run_tells_what_it_did_not_judge(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Text and report count the readings that were left out since their sensor was not valid."""
    paths, page = written(tmp_path, heated.text(), heated.course(500)), tmp_path / "report.html"
    assert main(["run", *map(str, paths), "--report", str(page)]) == 0
    told = "190 readings of sensors not judged (their `valid_when`)"  # 160 s at rest, and 30 s after them
    assert told in " ".join(capsys.readouterr().out.split())
    assert told in page.read_text(encoding="utf-8")


def test_check_tells_states_means_and_what_is_not_tested(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`check` shows when a sensor is valid, that noise is of means of rows, and which parameters are not tested."""
    model = heated.text().replace("sample_time: 1 s\n", "sample_time: 1 s\nrow_time: 0.25 s\n")
    model = model.replace("{K: 50 W/K}", "{K: {nominal: 50 W/K, suspect: no}}")
    paths, out = written(tmp_path, model, heated.course(10)), tmp_path / "check.jsonl"
    assert main(["check", str(paths[0]), "--json", str(out)]) == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "valid when blown: flow > still, and has been for 30 s" in told
    assert "noise of means (sd)" in told
    assert "0.05 K" in told  # half of 0.1 K of a row
    assert "rows every 0.25 s; each sample is the mean of 4, and noise is told of that mean" in told
    assert "not tested K, blown_lag: trusted" in told
    record = json.loads(out.read_text(encoding="utf-8"))
    assert record["row_time"] == 0.25
    assert [item["valid_when"] for item in record["sensors"]] == [None, {"when": "flow > still", "settling": 30.0}]


@pytest.mark.parametrize("lag", [False, True])
def test_a_fit_leaves_out_rows_in_which_a_sensor_has_no_value(tmp_path: Path, *, lag: bool) -> None:
    """Where the sensor is not valid its law is not asked; the parameters are found all the same."""
    model = heated.text(lag=lag).replace("G: 1}", "G: 1.2}")
    paths, fitted = written(tmp_path, model, heated.course(900, lag=lag)), tmp_path / "fitted.yaml"
    assert main(["fit", *map(str, paths), "-o", str(fitted), "--starts", "1", "--fixed", "C"]) == 0
    assert load_model(fitted).parameter("G").nominal == pytest.approx(1.0, abs=0.02)


def test_a_law_without_a_value_is_told_with_sensor_and_time(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where nothing says when the sensor is valid, the fit names it, the recording, and the first such time."""
    paths = written(tmp_path, heated.text(valid=False, lag=False), heated.course(600, lag=False))
    assert main(["fit", *map(str, paths), "--starts", "1"]) == 2
    assert "resting.csv: at 300 s what the sensor blown reads has no finite value" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("declared", "told"), [("lag: 2 s", "a longer `lag:` of blown than 2 s"), ("", "a `lag:` of blown")]
)
def test_a_lag_that_is_too_short_is_told_with_how_much_is_missing(
    tmp_path: Path, capsys: pytest.CaptureFixture[str], declared: str, told: str
) -> None:
    """The hint of `check --data` asks for a longer lag where one is declared, and estimates what is missing of 6 s."""
    model = heated.text().replace("lag: 6 s", declared).replace(", ,", ",")
    paths, out = written(tmp_path, model, heated.course(1400)), tmp_path / "check.jsonl"
    assert main(["check", str(paths[0]), "--data", str(paths[1]), "--json", str(out)]) == 0
    (late,) = json.loads(out.read_text(encoding="utf-8"))["late"]
    assert (late["sensor"], late["of"]) == ("blown", "power")
    assert late["by"] == pytest.approx(4.0 if declared else 6.0, rel=0.25)
    assert told in " ".join(capsys.readouterr().out.split())
