"""From Python: the other verbs give the records and the text of the command line."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faultbond as fb
from faultbond.cli import main
from faultbond.errors import FaultbondError

EXAMPLES = Path(__file__).parents[3] / "examples"
MODEL, HEALTHY = EXAMPLES / "rc" / "model.yaml", EXAMPLES / "rc" / "healthy.csv"


@pytest.fixture
def short(tmp_path: Path) -> Path:
    """Give the first rows of a healthy recording."""
    path = tmp_path / "short.csv"
    path.write_text("".join(HEALTHY.read_text().splitlines(keepends=True)[:801]))
    return path


def told(words: list[str], path: Path) -> list[dict[str, Any]]:
    """Give the records of a command."""
    assert main([*words, "--json", str(path)]) == 0
    return [json.loads(line) for line in path.read_text().splitlines()]


def plainly(record: object) -> Any:
    """Give a record as a file has it."""
    return json.loads(json.dumps(record))


def test_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What was understood is the record and the text of `check`."""
    found = fb.check(MODEL)
    assert [plainly(dict(found.record))] == told(["check", str(MODEL)], tmp_path / "told.jsonl")
    assert str(found).split() == capsys.readouterr().out.split()
    assert found["model"] == "RC circuit"
    structure = fb.check(EXAMPLES / "structures" / "three_tanks.yaml")
    assert structure["structure"]["unknowns"]


def test_check_on_data(tmp_path: Path, short: Path) -> None:
    """A model on trial gets the record of `check --data`."""
    found = fb.check(MODEL, data=[short], promise="2 day")
    words = ["check", str(MODEL), "--data", str(short), "--promise", "2 day"]
    (record,) = told(words, tmp_path / "told.jsonl")
    assert plainly(dict(found.record)) == record
    assert record["promise"] == 2 * 86400


def test_analyse(tmp_path: Path, short: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """An analysis has the record and the text of `analyse`, and what is asked for most by name."""
    found = fb.analyse(MODEL, data=short, within="2 s", closed=0)
    words = ["analyse", str(MODEL), "--data", str(short), "--within", "2 s", "--closed", "0"]
    (record,) = told(words, tmp_path / "told.jsonl")
    assert plainly(dict(found.record)) == record
    assert str(found).split() == capsys.readouterr().out.split()
    assert found.detectable == {"R": True, "C": True}
    assert found.isolable["R"]["C"] == record["isolable"]["R"]["C"]
    assert {"R": found.smallest_fault["R"]["within"]} == {"R": record["smallest_fault"]["R"]["within"]}
    assert "<pre>" in found._repr_html_()


def test_code_and_trace(tmp_path: Path) -> None:
    """Closed forms and the search of the thesis are those of `analyse --code` and `--trace`."""
    (record,) = told(["analyse", str(MODEL), "--code", "python"], tmp_path / "told.jsonl")
    assert fb.code(MODEL, "python") == record["text"]
    (record,) = told(["analyse", str(MODEL), "--trace", "R"], tmp_path / "told.jsonl")
    assert plainly(dict(fb.trace(MODEL, "R").record)) == record


def test_fit(tmp_path: Path, short: Path) -> None:
    """A fit has the record of `fit`, and its model is the file that it writes, which a run takes."""
    output = tmp_path / "fitted.yaml"
    words = ["fit", str(MODEL), str(short), "--starts", "1", "--fixed", "R", "-o", str(output)]
    (record,) = told(words, tmp_path / "told.jsonl")
    found = fb.fit(MODEL, short, starts=1, fixed="R")
    assert plainly(dict(found.record)) | {"output": str(output)} == record
    assert found.model.text == output.read_text()
    assert found.parameters["C"]["estimate"] == record["parameters"][0]["estimate"]
    assert found.noise["V_C"]["found"] == record["noise"][0]["found"]
    assert found.quieted is None
    found.report(tmp_path / "fit.html")
    assert "RC circuit" in (tmp_path / "fit.html").read_text()


def test_simulate(tmp_path: Path, short: Path) -> None:
    """A simulation is the file that `simulate` writes; a frame of inputs is as good as their file."""
    words = ["simulate", str(MODEL), "--inputs", str(short), "--fault", "C=x1.6@8", "--seed", "3", "--spread", "3 %"]
    assert main([*words, "-o", str(tmp_path / "cli.csv")]) == 0
    found = fb.simulate(MODEL, short, faults="C=x1.6@8", seed=3, spread="3 %", output=tmp_path / "api.csv")
    assert (tmp_path / "api.csv").read_text() == (tmp_path / "cli.csv").read_text()
    assert found.seed == 3
    frame = found.to_frame()
    table = np.genfromtxt(short, delimiter=",", names=True)
    inputs = {name: table[name] for name in ("time", "V")}
    again = fb.simulate(MODEL, inputs, faults=["C=x1.6@8"], seed=3, spread=0.03, start=dict(found.start)).to_frame()
    assert np.array_equal(again["V_C"], frame["V_C"])
    result = fb.run(MODEL, frame)
    assert result.verdict == "fault"


def test_models_built_in_python(short: Path) -> None:
    """A bond graph that was built in Python is a model, with the text of a file, and the other way round."""
    graph = fb.load_model(MODEL)
    assert fb.run(graph, short).verdict == "healthy"
    again = fb.Model(graph.text)
    assert again.graph.sha256 == graph.sha256
    assert [(item.name, item.nominal, item.unit.text) for item in again.parameters] == [
        ("R", 1e4, "kohm"),
        ("C", pytest.approx(1e-4), "uF"),
    ]
    assert (again.inputs[0].column, again.sensors[0].unit.text) == ("V", "V")


WORDS: dict[str, object] = {
    "name": "RC circuit",
    "sample_time": "0.02 s",
    "max_faults": 1,
    "accuracy": "3 %",
    "inputs": {"V": {"unit": "V", "noise": "0.1 V"}},
    "components": {
        "source": {"type": "Se", "law": "e = V"},
        "R": {"type": "R", "parameters": {"R": {"nominal": "10 kohm", "suspect": True}}},
        "C": {"type": "C", "law": None, "parameters": {"C": "100 uF"}},
    },
    "junctions": {"loop": 1},
    "bonds": ["source -> loop -> R", "loop -> C"],
    "sensors": {"V_C": {"reads": "C.e", "unit": "V", "noise": "0.1 V"}},
}


def test_a_model_of_words(tmp_path: Path, short: Path) -> None:
    """A model is stated in Python by the words of its file, and goes into a file and back."""
    model = fb.Model(**WORDS)  # type: ignore[arg-type]
    assert fb.run(model, short).verdict == "healthy"
    assert "  R: {type: R, parameters: {R: {nominal: 10 kohm, suspect: yes}}}\n" in model.text
    model.save(tmp_path / "rc.yaml")
    again = fb.load(tmp_path / "rc.yaml")
    assert (again.text, again.graph.sha256) == (model.text, model.graph.sha256)
    assert fb.Model(fb.dump_model(model.graph)).graph.sha256 == fb.load(MODEL).graph.sha256
    for wrong, message in (
        ({"inputs": {"V": {"units": "V"}}}, "model RC circuit: .*`units`"),
        ({"inputs": {"V": {"noise": {3}}}}, "model RC circuit: inputs: a set cannot stand here"),
        ({"input": {}}, "model RC circuit: .*`input`.*`inputs`"),
    ):
        with pytest.raises(FaultbondError, match=message):
            fb.Model(**(WORDS | wrong))  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match="name: give the text of a model file, or its words, not both"):
        fb.Model(MODEL.read_text(), name="twice")


def test_a_model_is_saved(tmp_path: Path) -> None:
    """A model writes its file."""
    model = fb.example("tank")
    model.save(tmp_path / "tank.yaml")
    assert fb.load(tmp_path / "tank.yaml").text == model.text
    assert repr(model).startswith("<Model 'water tank' of ")


def test_frames_are_fitted_together(short: Path) -> None:
    """Several frames are as good as their files, and are told apart by numbers."""
    table = np.genfromtxt(short, delimiter=",", names=True)
    columns = {name: table[name] for name in table.dtype.names or ()}
    parts = [{name: values[part] for name, values in columns.items()} for part in (slice(300), slice(300, None))]
    found = fb.check(MODEL, data=parts)
    assert [item["recording"] for item in found["recordings"]] == ["the recording 1", "the recording 2"]
    for given, message in (([parts[0], parts[0]], "given twice"), ([], "at least one recording")):
        with pytest.raises(FaultbondError, match=message):
            fb.fit(MODEL, given)


MISTAKES: dict[str, tuple[Callable[[], object], str]] = {
    "prior": (lambda: fb.fit(MODEL, HEALTHY, prior="strong"), "prior 'strong': expected widened"),
    "starts": (lambda: fb.fit(MODEL, HEALTHY, starts=0), "starts=0: expected a whole number from 1 to 100"),
    "starts as text": (lambda: fb.fit(MODEL, HEALTHY, starts="x"), "starts='x': expected a whole"),  # type: ignore[arg-type]
    "a list": (lambda: fb.simulate(MODEL, HEALTHY, lag=[3]), r"lag=\[3\]: expected a time"),  # type: ignore[arg-type]
    "the model": (lambda: fb.fit(MODEL, HEALTHY, output=MODEL), "this is the model and would be the output too"),
    "a recording": (lambda: fb.run(MODEL, HEALTHY, report=HEALTHY), "is a recording and would be the report too"),
    "no folder": (lambda: fb.run(MODEL, HEALTHY, json="nowhere/x"), "there is no folder nowhere"),
    "names": (lambda: fb.analyse(MODEL, separate=["R,"]), "expected names"),
    "twice": (lambda: fb.trace(MODEL, "R", "R"), "a name stands there twice"),
    "both": (lambda: fb.analyse(MODEL, fewest=True, least_noise=True), "give one of them"),
    "a form": (lambda: fb.code(MODEL, "rust"), "form 'rust': expected python, c or latex"),
    "a time": (lambda: fb.analyse(MODEL, within="3 V"), "within: "),
    "less than nothing": (lambda: fb.simulate(MODEL, HEALTHY, spread=-1), "spread -1: expected a finite number"),
    "without a limit": (lambda: fb.simulate(MODEL, HEALTHY, lag=np.inf), "lag inf: expected a finite number"),
    "a part": (lambda: fb.simulate(MODEL, HEALTHY, spread="3 V"), "spread='3 V': expected a percentage"),
    "a fault": (lambda: fb.simulate(MODEL, HEALTHY, faults="C=?"), "^fault 'C=\\?': expected NAME=VALUE@TIME"),
    "a folder": (lambda: fb.example("tank").save("nowhere/model.yaml"), "nowhere/model.yaml: it cannot be written"),
    "text of a model": (lambda: fb.run(MODEL.read_text(), HEALTHY), r"^a text of several lines: .*`Model\(text\)`"),
    "no output": (lambda: fb.generate(MODEL, None), "output: NoneType, where a path is expected"),  # type: ignore[arg-type]
    "a dict": (
        lambda: fb.generate(MODEL, "x.html", web=True, recording={"time": [0]}),  # type: ignore[arg-type]
        "recording: dict, where a path is expected",
    ),
    "a parameter": (lambda: fb.trace(MODEL, "K"), "no parameter K; there are R, C"),
}


NUL = "a\0b"
NO_PATHS: list[Callable[[], object]] = [
    lambda: fb.run(MODEL, NUL),
    lambda: fb.run(MODEL, Path(NUL)),
    lambda: fb.run(MODEL, HEALTHY, report=NUL),
    lambda: fb.run(MODEL, HEALTHY, state=NUL),
    lambda: fb.run(MODEL, HEALTHY, json=NUL),
    lambda: fb.run(NUL, HEALTHY),
    lambda: fb.load(MODEL).save(NUL),
    lambda: fb.simulate(MODEL, HEALTHY, output=NUL),
    lambda: fb.fit(MODEL, NUL),
    lambda: fb.generate(MODEL, NUL),
    lambda: fb.accept(MODEL, NUL),
    lambda: fb.reject(MODEL, NUL, "C"),
    lambda: fb.Monitor.restore(NUL),
]


@pytest.mark.parametrize("call", NO_PATHS)
def test_no_path_has_a_nul(call: Callable[[], object]) -> None:
    """A text that no file can be called by is told as such, whoever takes it."""
    with pytest.raises(FaultbondError, match=r"no path has the character NUL|not a file name"):
        call()


@pytest.mark.parametrize("kind", MISTAKES)
def test_mistakes_of_options(kind: str) -> None:
    """An option that is wrong is named, with what is expected."""
    call, message = MISTAKES[kind]
    with pytest.raises(FaultbondError, match=message):
        call()


def test_generate(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A project, or an FMU, is that of the command line, with its record and its text."""
    found = fb.generate(MODEL, tmp_path / "from_python", target="wasm32-wasi", watch_only=True)
    words = ["generate", str(MODEL), "-o", str(tmp_path / "by_command"), "--target", "wasm32-wasi"]
    (record,) = told([*words, "--watch-only"], tmp_path / "told.jsonl")
    assert plainly(dict(found.record)) == record | {"output": str(tmp_path / "from_python")}
    assert str(found) == capsys.readouterr().out.strip().replace("by_command", "from_python")
    texts = [
        {str(file.relative_to(tmp_path / name)): file.read_text() for file in (tmp_path / name).rglob("*.*")}
        for name in ("from_python", "by_command")
    ]
    assert texts[0] == texts[1]
    assert fb.generate(MODEL, tmp_path / "rc.fmu", fmu=3, watch_only=True)["fmi"] == 3
    assert (tmp_path / "rc.fmu").exists()


@pytest.mark.parametrize(
    ("wrong", "problem"),
    [
        ({"target": "vax"}, "no such target"),
        ({"fmu": 4}, "from 2 to 3"),
        ({"fmu": 2, "target": "wasm32-wasi"}, "for this machine"),
        ({"web": True, "fmu": 2}, "it writes a page"),
        ({"web": True}, "ends in .html"),
        ({"recording": "rows.csv"}, "only a page"),
        ({"lanes_at_most": 0}, "from 1"),
        ({"lanes_at_most": 50, "watch_only": True}, "give it, or"),
    ],
)
def test_what_cannot_be_generated(wrong: dict[str, Any], problem: str, tmp_path: Path) -> None:
    """Options that cannot be are refused before anything is built."""
    with pytest.raises(FaultbondError, match=problem):
        fb.generate(MODEL, tmp_path / "folder", **wrong)
    assert not (tmp_path / "folder").exists()


def test_what_python_is_given_by_mistake(tmp_path: Path) -> None:
    """Values of a wrong type are told in a line, as is what they should be."""
    inputs = {"time": np.arange(5) * 0.02, "V": np.ones(5)}
    with pytest.raises(FaultbondError, match="expected values by state"):
        fb.simulate(MODEL, inputs, start="C.q=1 mC")  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match="3: expected a text"):
        fb.simulate(MODEL, inputs, faults=3)  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match=r"\['R'\]: expected a text"):
        fb.accept(MODEL, tmp_path / "state", ["R"])  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match="NoneType: expected the path"):
        fb.load(None)  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match="NoneType: expected the text of a model file"):
        fb.Model()
    with pytest.raises(FaultbondError, match=r"several lines: .*`Model\(text\)` takes a text"):
        fb.load(MODEL.read_text())
    with pytest.raises(FaultbondError, match="path: NoneType, where a path is expected"):
        fb.Monitor.restore(None)  # type: ignore[arg-type]
    with pytest.raises(FaultbondError, match=r"Simulation: this is no recording. Give its `to_frame\(\)`"):
        fb.run(MODEL, fb.simulate(MODEL, inputs))
    with pytest.raises(FaultbondError, match=r"column 'time' .* holds text, such as 'noon'. Give seconds, or dates"):
        fb.run(MODEL, {**inputs, "time": ["noon"] * 5, "V_C": np.ones(5)})
    with pytest.raises(FaultbondError, match=r"^the recording: row 12: the time jumps"):
        fb.run(MODEL, {"time": 1e6 * np.arange(20), "V": np.ones(20), "V_C": np.ones(20)})


def test_names_are_offered() -> None:
    """What a notebook completes are the public names."""
    assert {"load", "run", "Monitor"} <= set(dir(fb))
    assert not {"lazily", "interrupt"} & set(dir(fb))


def test_check_settings(capsys: pytest.CaptureFixture[str]) -> None:
    """The text of a check has the numbers of the method where they are asked for."""
    assert main(["check", str(MODEL), "--settings"]) == 0
    assert str(fb.check(MODEL, settings=True)).split() == capsys.readouterr().out.split()
