"""`fit` and `check --data`: from the command line to the file, the record and the report."""

import json
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

import winding
from faultbond.app.identification import _lines
from faultbond.cli import DONE, main
from faultbond.cli.program import NO_VERDICT, USER_MISTAKE
from faultbond.fit.identification import Fit
from faultbond.io.recording import write_recording
from faultbond.model.text import load_model, parse_model
from faultbond.report.fit_result import Fitted
from faultbond.types import STEP

MODEL = winding.MODEL.replace("time_between_false_alarms: 1 h\n", "")
R, L, NOISE = 3.6, 2.0, 0.02


def write_current(path: Path, *, rows: int = 800, seed: int = 1, resistance: float = R) -> Path:
    """Write a recording of the motor's winding under a voltage that jumps."""
    rng = np.random.default_rng(seed)
    h, current, values = 0.02, 0.0, []
    voltage = np.where(np.arange(rows) // 50 % 2 == 0, 6.0, -2.0)
    for k in range(rows):
        values.append(current + NOISE * rng.standard_normal())
        decay = np.exp(-resistance / L * h)
        current = decay * current + (1.0 - decay) * voltage[k] / resistance
    write_recording(
        path, {"time": np.asarray(h * np.arange(rows), dtype=np.float64), "V": voltage, "i": np.array(values)}
    )
    return path


def write_change(path: Path, *, seed: int = 1) -> Path:
    """Write a recording of a winding that changes in the middle."""
    first = write_current(path, seed=seed).read_text(encoding="utf-8").splitlines()
    second = write_current(path, seed=seed, resistance=1.3 * R).read_text(encoding="utf-8").splitlines()
    path.write_text("\n".join([*first[:401], *second[401:]]) + "\n", encoding="utf-8")
    return path


def call(*arguments: object) -> dict[str, Any]:
    """Run a verb that writes one record, and give it."""
    target = Path(str(arguments[1])).parent / "record.json"
    assert main([*map(str, arguments), "--json", str(target)]) == DONE
    return dict(json.loads(target.read_text(encoding="utf-8")))


@pytest.fixture
def model(tmp_path: Path) -> Path:
    """Write the model file."""
    path = tmp_path / "model.yaml"
    path.write_text(MODEL, encoding="utf-8")
    return path


def test_parameters_and_noise_are_found(model: Path, tmp_path: Path) -> None:
    """Values 20 % off nominal are found within three standard errors, which are small, and so is the noise."""
    record = call("fit", model, write_current(tmp_path / "a.csv"), "-o", tmp_path / "new.yaml")
    found = {item["name"]: item for item in record["parameters"]}
    for name, truth in (("R", R), ("L", L)):
        assert abs(found[name]["estimate"] - truth) < 3.0 * found[name]["sd"]
        assert found[name]["sd"] < 0.01 * truth
        assert found[name]["determined"]
    assert record["noise"][0]["found"] == pytest.approx(NOISE, rel=0.1)
    assert record["whiteness"][0]["white"]
    assert record["widened"]["R"] > 2.0
    assert not record["stopped"]


@pytest.mark.parametrize("rows", [60, 120, 400])
def test_a_narrow_prior_does_not_hold_what_the_data_contradict(rows: int, model: Path, tmp_path: Path) -> None:
    """However few the data are, if they are clear: a value at half the truth, declared to 1 %, is given up."""
    model.write_text(MODEL.replace("nominal: 2.5 H, accuracy: 5 %", "nominal: 1 H, accuracy: 1 %"), encoding="utf-8")
    recording = write_current(tmp_path / "a.csv", rows=rows)
    found = call("fit", model, recording, "-o", tmp_path / "new.yaml")
    (coil,) = (item for item in found["parameters"] if item["name"] == "L")
    assert abs(coil["estimate"] - L) < 3.0 * coil["sd"]
    assert coil["sd"] < 0.05 * L
    assert found["widened"]["L"] > 5.0


@pytest.mark.parametrize(("rows", "told"), [(25, True), (60, False)])
def test_few_samples_are_called_few(
    rows: int, told: bool, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What so few say of so many values is little, whatever its standard deviations are."""
    recording = write_current(tmp_path / "a.csv", rows=rows)
    assert main(["fit", str(model), str(recording), "-o", str(tmp_path / "new.yaml")]) == DONE
    assert (f"{rows} samples for " in capsys.readouterr().out) is told


@pytest.mark.parametrize(("prior", "told"), [("widened", True), ("none", False)])
def test_accuracies_that_do_not_count_are_not_called_wrong(
    prior: str, told: bool, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Without a prior the declared accuracies are not compared with the data, so nothing is said of them."""
    recording = write_current(tmp_path / "a.csv")
    assert main(["fit", str(model), str(recording), "-o", str(tmp_path / "new.yaml"), "--prior", prior]) == DONE
    assert ("contradict those declared" in capsys.readouterr().out) is told


def test_what_a_search_added_was_declared_by_nobody() -> None:
    """So nothing is said of an accuracy that was stated of it."""
    found = cast("Fit", SimpleNamespace(contradicted={"L": 2.0, "V_lag": 1.7}))
    fitted = Fitted(
        graph=parse_model(MODEL),
        found=found,
        version="",
        estimates=(),
        noises=(),
        silences=(),
        added=frozenset({"V_lag"}),
    )
    assert fitted.wider == {"L": 2.0}


def test_how_far_a_value_seems_to_move_is_written(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A resistance that is another one in each recording has a healthy change; a steady one takes it back again."""
    values = (3.2, 3.9, 3.4, 3.7)
    moving = [write_current(tmp_path / f"{k}.csv", seed=k, resistance=value) for k, value in enumerate(values)]
    new = tmp_path / "new.yaml"
    record = call("fit", model, *moving, "-o", new)
    found = {item["name"]: item for item in record["parameters"]}["R"]
    spread = float(np.sqrt(np.mean(np.square(np.array(values) - found["estimate"]))))
    assert found["healthy_change"] == pytest.approx(spread, rel=0.2)
    assert load_model(new).parameter("R").healthy_change == pytest.approx(found["healthy_change"], rel=0.1)
    assert "healthy data" in capsys.readouterr().out
    steady = [write_current(tmp_path / f"{k}.csv", seed=k) for k in range(4)]
    record = call("fit", new, *steady, "-o", tmp_path / "newer.yaml")
    found = {item["name"]: item for item in record["parameters"]}["R"]
    assert found["healthy_change"] < 0.5 * found["accuracy"]
    back = load_model(tmp_path / "newer.yaml").parameter("R")
    assert back.healthy_change == pytest.approx(0.5 * back.accuracy, rel=0.1)


def test_an_input_that_seems_off_by_nothing_is_not_said_to_be_off(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """What was stated is taken back in the file, and that is all."""
    text = model.read_text(encoding="utf-8")
    assert "V: {unit: V" in text
    model.write_text(text.replace("V: {unit: V", "V: {healthy_bias: 0.1 V, unit: V"), encoding="utf-8")
    steady = [write_current(tmp_path / f"{k}.csv", seed=k) for k in range(4)]
    call("fit", model, *steady, "-o", tmp_path / "new.yaml")
    assert load_model(tmp_path / "new.yaml").input("V").healthy_bias == 0.0
    assert "seems off" not in capsys.readouterr().out


def test_the_new_file_holds_what_was_found(model: Path, tmp_path: Path) -> None:
    """Only numbers change, and they are those of the record; accuracies are not below 1 %."""
    new = tmp_path / "new.yaml"
    record = call("fit", model, write_current(tmp_path / "a.csv"), "-o", new)
    graph = load_model(new)
    for item in record["parameters"]:
        back = graph.parameter(item["name"])
        assert back.nominal == pytest.approx(item["estimate"], rel=1e-3)
        assert back.accuracy == pytest.approx(item["accuracy"], rel=0.1)
        assert back.accuracy >= 0.0099 * back.nominal
    assert graph.sensors[0].noise == pytest.approx(record["noise"][0]["found"], rel=0.01)
    text = new.read_text(encoding="utf-8")
    assert "# a motor\n" in text
    assert "# winding\n" in text


def test_recordings_are_fitted_together(model: Path, tmp_path: Path) -> None:
    """Two recordings tell more than one."""
    first, second = (write_current(tmp_path / f"{k}.csv", seed=k) for k in (1, 2))
    one, two = call("fit", model, first), call("fit", model, first, second)
    assert [item["recording"] for item in two["recordings"]] == [str(first), str(second)]
    assert two["parameters"][0]["sd"] < 0.8 * one["parameters"][0]["sd"]


def test_what_is_simulated_says_where_it_begins(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A start that is stated, give or take something, is not found: a simulation from there may be far off for long."""
    stated = model.read_text(encoding="utf-8")
    for text, told in ((stated, True), (stated.replace(", start: {p: 0 V*s, sd: 0.001 V*s}", ""), False)):
        model.write_text(text, encoding="utf-8")
        assert main(["fit", str(model), str(write_current(tmp_path / "a.csv"))]) == DONE
        words = " ".join(capsys.readouterr().out.split())
        assert ("begun exactly at the stated start of L" in words) == told


def test_a_fixed_parameter_stays(model: Path, tmp_path: Path) -> None:
    """What is fixed is not fitted and not written."""
    new = tmp_path / "new.yaml"
    record = call("fit", model, write_current(tmp_path / "a.csv"), "--fixed", "L", "-o", new)
    assert [item["name"] for item in record["parameters"]] == ["R"]
    before, after = (load_model(path).parameter("L") for path in (model, new))
    assert replace(after, line=before.line) == before


def test_what_does_not_show_is_named(model: Path, tmp_path: Path) -> None:
    """At rest an inductance does not show: it is named, and keeps its accuracy."""
    rows = 300
    rng = np.random.default_rng(1)
    time = np.asarray(0.02 * np.arange(rows), dtype=np.float64)
    columns = {"time": time, "V": np.zeros(rows), "i": NOISE * rng.standard_normal(rows)}
    write_recording(tmp_path / "rest.csv", columns)
    record = call("fit", model, tmp_path / "rest.csv")
    assert not any(item["determined"] for item in record["parameters"])
    assert {name for item in record["alike"] for name in item} == {"R", "L"}
    assert record["parameters"][1]["sd"] == pytest.approx(0.05 * 2.5, rel=0.1)


def test_wild_readings_are_left_out(model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Five readings a million times too large change nothing, and are told, the first ones by sensor and time."""
    path = write_current(tmp_path / "a.csv")
    lines = path.read_text(encoding="utf-8").splitlines()
    places = (100, 333, 700, 720, 740)
    for k in places:
        lines[k] = lines[k].rsplit(",", 1)[0] + ",1e6"
    (tmp_path / "wild.csv").write_text("\n".join(lines) + "\n", encoding="utf-8")
    good, wild = call("fit", model, path), call("fit", model, tmp_path / "wild.csv")
    assert (good["wild"], wild["wild"], good["left_out"]) == (0, 5, [])
    times = [float(lines[k].split(",")[0]) for k in places]
    assert [item["time"] for item in wild["left_out"]] == pytest.approx(times)
    assert {(item["recording"], item["sensor"]) for item in wild["left_out"]} == {(str(tmp_path / "wild.csv"), "i")}
    named = ", ".join(f"i at {time:g} s" for time in times[:4])
    assert f"left out 5 readings far off all others: {named} and 1 more" in " ".join(capsys.readouterr().out.split())
    assert wild["parameters"][0]["estimate"] == pytest.approx(good["parameters"][0]["estimate"], rel=2e-3)


def test_a_parameter_that_changes_is_named(model: Path, tmp_path: Path) -> None:
    """A winding that changes in the middle of a recording is no steady one, and the middle is told."""
    steady = call("fit", model, write_current(tmp_path / "a.csv"))
    changing = call("fit", model, write_change(tmp_path / "both.csv"))
    assert steady["changes"] == []
    assert changing["changes"][0]["parameter"] == "R"
    assert changing["changes"][0]["time"] == pytest.approx(8.0, abs=1.0)


def test_a_model_that_alarms_on_its_recordings_says_so(
    model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """It counts its false alarms, in words and in the file; fitted to what it explains it knows of none any more."""
    steady, first, second = (tmp_path / f"{name}.csv" for name in ("steady", "first", "second"))
    write_current(steady)
    write_change(first)
    write_change(second, seed=2)
    record = call("fit", model, steady, first, second, "-o", tmp_path / "off.yaml")
    assert set(record["alarms"]) == {str(first), str(second)}
    assert load_model(tmp_path / "off.yaml").false_alarms == 2
    told = " ".join(capsys.readouterr().out.split())
    assert re.search(r"R, most of all about \S+ s of (first|second)\.csv\. Is it healthy\?", told)
    soonest = min((first, second), key=lambda path: record["alarms"][str(path)])
    assert f"It alarms on 2 of 3 healthy recordings, soonest on {soonest} at " in told
    assert call("fit", tmp_path / "off.yaml", steady, "-o", tmp_path / "right.yaml")["alarms"] == {}
    assert load_model(tmp_path / "right.yaml").false_alarms == 0
    told = " ".join(capsys.readouterr().out.split())
    assert "It alarms on no recording; how often it will, `faultbond check --data` says." in told


def test_the_report_is_a_page(model: Path, tmp_path: Path) -> None:
    """The report names the plant, its parameters and its sensor, and needs no network."""
    page = tmp_path / "fit.html"
    call("fit", model, write_current(tmp_path / "a.csv"), "--report", page)
    text = page.read_text(encoding="utf-8")
    assert "<h1>The data fix R and L. What is left is white. It alarms on no recording; how often it will, " in text
    assert "Autocorrelation" in text
    assert "http://" not in text.replace("http://www.w3.org", "")


@pytest.mark.parametrize(
    ("rows", "message", "code"),
    [
        ([], "there is no row below the header", USER_MISTAKE),
        (["0,1,2"], "1 readings can be used, and 3 values are to be found", NO_VERDICT),
        (["0,1,", "0.02,1,", "0.04,1,x"], "no row has a value of the sensor i", NO_VERDICT),
        (["0,,1", "0.02,,1", "0.04,,1"], "no row has a value of the input V", NO_VERDICT),
    ],
)
def test_recordings_with_too_little(
    rows: list[str], message: str, code: int, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A recording that tells nothing is refused in one line, and is no mistake where it has rows."""
    recording = tmp_path / "bad.csv"
    recording.write_text("\n".join(["time,V,i", *rows]) + "\n", encoding="utf-8")
    assert main(["fit", str(model), str(recording)]) == code
    error = capsys.readouterr().err
    assert message in error
    lines = [line for line in error.splitlines() if "counts as missing" not in line]  # told beside it
    assert len(lines) == 1


@pytest.mark.parametrize(
    ("extra", "message"),
    [
        (["--fixed", "Q"], "no parameter `Q`"),
        (["--starts", "0"], "--starts 0"),
        (["--fixed", "R", "--free", "R"], "both fixed and free"),
    ],
)
def test_wishes_that_make_no_sense(
    extra: list[str], message: str, model: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A wrong name or number is refused in one line."""
    assert main(["fit", str(model), str(write_current(tmp_path / "a.csv")), *extra]) == USER_MISTAKE
    assert message in capsys.readouterr().err


def test_a_right_model_keeps_its_promise(model: Path, tmp_path: Path) -> None:
    """The fitted model would hardly alarm; the one with a winding 20 % off would, and larger accuracies mend it."""
    recording, new = write_current(tmp_path / "a.csv"), tmp_path / "new.yaml"
    call("fit", model, recording, "-o", new)
    good = call("check", new, "--data", recording, "--promise", "1 h")
    assert good["kept"]
    assert good["statistics"][0]["spread"] == pytest.approx(1.0, abs=0.1)
    strict = tmp_path / "strict.yaml"
    strict.write_text(
        MODEL.replace("accuracy: 3 %", "accuracy: 0.1 %").replace("accuracy: 5 %", "accuracy: 0.1 %"), encoding="utf-8"
    )
    bad = call("check", strict, "--data", recording, "--promise", "1 h")
    assert not bad["kept"]
    assert bad["peak"] > 1.0
    assert bad["regions"]
    assert bad["moments"][0]["sensor"] == "i"


@pytest.mark.parametrize(("silent", "starts"), [(0.0, 2), (1e4, 0)])
def test_a_fit_that_takes_long_tells_in_a_file_what_it_does(
    model: Path,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
    capsys: pytest.CaptureFixture[str],
    silent: float,
    starts: int,
) -> None:
    """Where standard error is no terminal each start and stage is a line of it, from a while on; records have none."""
    monkeypatch.setattr("faultbond.app.identification._SILENT", silent)
    recording = write_current(tmp_path / "a.csv", rows=300)
    assert main(["fit", str(model), str(recording), "--starts", "2", "--json", "-"]) == DONE
    said = capsys.readouterr()
    told = said.err.splitlines()
    wanted = [f"faultbond: start {k + 1} of 2 ..." for k in range(starts)]
    assert [line for line in told if "start" in line] == wanted
    assert len(told) == len(set(told))
    assert bool(told) == bool(starts)
    assert {json.loads(line)["record"] for line in said.out.splitlines()} == {"fit"}


def test_a_fit_tells_how_far_it_is(
    model: Path, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """On a terminal each step of each start is told; what is told in lines leaves the steps out."""
    told: list[str] = []

    @contextmanager
    def spinning(_: object) -> Iterator[Callable[[str], None]]:
        yield told.append

    monkeypatch.setattr("faultbond.app.identification._spinning", spinning)
    monkeypatch.setattr("sys.stderr.isatty", lambda: True)
    recording = write_current(tmp_path / "a.csv", rows=300)
    assert main(["fit", str(model), str(recording), "--starts", "2"]) == DONE
    assert [text for text in told if STEP not in text][:2] == ["start 1 of 2", "start 2 of 2"]
    steps = [text for text in told if text.startswith(f"start 2 of 2{STEP}")]
    told_of = [re.fullmatch(rf"start 2 of 2{STEP}(\d+) of at most 60, (\d+) nats gained", text) for text in steps]
    numbers = [(int(item[1]), int(item[2])) for item in told_of if item]
    assert [k for k, _ in numbers] == list(range(1, len(steps) + 1))
    gains = [gain for _, gain in numbers]
    assert gains[0] == 0 < gains[-1]
    assert gains == sorted(gains)
    assert len(steps) > 2
    capsys.readouterr()
    tell = _lines(0.0)
    for text in told[:10]:
        tell(text)
    assert capsys.readouterr().err == "faultbond: start 1 of 2 ...\n"
