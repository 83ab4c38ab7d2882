"""`analyse` and `check` on equations without laws, and what the other verbs say to them."""

import json
from pathlib import Path
from typing import Any

import pytest

from faultbond.cli import main

EXAMPLES = Path(__file__).parents[2] / "examples"
TANKS = EXAMPLES / "structures" / "three_tanks.yaml"
SENSORS = ["a: [x, ya]", "b: [x, yb]", "c: [x, yc]"]


def written(folder: Path, equations: list[str], more: str = "", names: str = "unknowns: [x, z]") -> Path:
    """A structure of two unknowns in a file."""
    path = folder / "plant.yaml"
    known = "known: [u, ya, yb, yc]"
    lines = "\n".join(f"    {item}" for item in equations)
    path.write_text(f"structure:\n  {names}\n  {known}\n  faults: [f, g]\n  equations:\n{lines}\n{more}\n")
    return path


def record_of(model: Path, folder: Path, *options: str) -> Any:
    """The record of an analysis."""
    target = folder / "record.json"
    assert main(["analyse", str(model), "--json", str(target), *options]) == 0
    (line,) = target.read_text(encoding="utf-8").splitlines()
    return json.loads(line)


def test_three_tanks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Of the published tanks it says what is published, in text and record alike."""
    record = record_of(TANKS, tmp_path)
    text = " ".join(capsys.readouterr().out.split())
    assert record["record"] == "structure"
    assert record["redundancy"] == 2
    assert all(record["detectable"].values())
    assert record["groups"] == [["fV2", "fV3", "fT3"]]
    assert "cannot be told apart {fV2, fV3, fT3}: valve2, valve3, tank3 and d p3/dt are checked only together" in text
    assert record["group_reasons"][0].endswith("the others only find p3, q3 and dp3")
    assert record["tests"]["mso"] == len(record["sets"]) == 6
    assert ["fV1", "fT1", "fT2"] in record["tests"]["mtes"]
    ways = {tuple(item["faults"]): item["ways"] for item in record["sets"]}
    assert ways["fV1", "fV2", "fV3", "fT2", "fT3"] == ["integral"]
    assert ways["fV1", "fT1", "fT2"] == ["integral", "derivative"]
    assert not record["by_causality"]["integral"]["isolable"]["fT1"]["fV1"]
    assert "by integrating only fV2, fV3, fT1, fT2 and fT3 cannot be told from fV1" in text
    assert record["sensors"]["detect"]["choices"] == [{"sensors": [], "cost": 0}]
    assert record["sensors"]["isolate"]["choices"][0] == {"sensors": ["q3"], "cost": 2.0}
    assert "to tell all apart a sensor of q3, at a cost of 2" in text


def test_what_nothing_checks(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A fault that does not show is named with the unknown that its equation is needed for, and a sensor is advised."""
    model = written(tmp_path, [*SENSORS[:2], "law: [z, x, u, f]", "last: [x, g]"])
    record = record_of(model, tmp_path)
    text = " ".join(capsys.readouterr().out.split())
    reason = "law is needed to find z, and nothing checks it"
    assert record["not_detectable"] == [{"fault": "f", "reason": reason}]
    assert f"detectable all but f not detectable f: {reason}" in text
    assert "to detect all a sensor of z" in text
    assert [item["part"] for item in record["equations"]] == ["over", "over", "just", "over"]


def test_open_unknowns(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where unknowns are open they are named, and sensors are found that fix and check them."""
    model = written(tmp_path, ["law: [x, z, u, f]", "law2: [x, z, g]", "law3: [z, w]"], names="unknowns: [x, z, w]")
    record = record_of(model, tmp_path)
    text = " ".join(capsys.readouterr().out.split())
    assert record["redundancy"] == 0
    assert "none: nothing can be checked, so no fault shows" in text
    assert "detectable none" in text
    model = written(tmp_path, ["law: [x, z, w, u, f]", "law3: [z, v, g]"], names="unknowns: [x, z, w, v]")
    record = record_of(model, tmp_path)
    assert record["open"] == ["x", "z", "w", "v"]
    assert record["not_detectable"][0]["reason"] == "law contains x, z and w, which nothing fixes"
    assert record["sensors"]["detect"]["choices"] == [{"sensors": ["x", "w", "v"], "cost": 3.0}]
    assert record["sensors"]["isolate"]["choices"] == [{"sensors": ["x", "z", "w", "v"], "cost": 4.0}]
    assert "to detect all sensors of x, w and v" in " ".join(capsys.readouterr().out.split())


def test_what_no_sensor_helps(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Two faults of one equation stay together whatever is measured, and that is said."""
    record = record_of(written(tmp_path, [*SENSORS[:2], "law: [z, x, f, g]"]), tmp_path)
    text = " ".join(capsys.readouterr().out.split())
    assert record["sensors"]["never_groups"] == [["f", "g"]]
    assert "never told apart {f, g}: both enter law" in text
    assert "to tell all apart a sensor of z, as far as these sensors can" in text


def test_faults_of_several_equations(tmp_path: Path) -> None:
    """A fault of two equations counts as an unknown, and is told from another one that enters only one of them."""
    record = record_of(
        written(tmp_path, ["a: [x, f]", "b: [x, f, g]", "c: [x]", "d: [x]", "e: [z, x]", "h: [z]"]), tmp_path
    )
    assert record["isolable"]["f"]["g"]
    assert record["isolable"]["g"]["f"]
    assert [item["name"] for item in record["equations"]][-1] == "f = 0"


def test_no_faults(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Without faults there is what the equations determine, and the tests."""
    path = tmp_path / "plant.yaml"
    path.write_text("structure: {unknowns: [x], equations: [[x], [x]]}")
    record = record_of(path, tmp_path)
    assert record["tests"] == {"mso": 1, "mtes": []}
    assert "Which faults show" not in capsys.readouterr().out


def test_too_many_tests(tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there are too many tests that is said, with those of the faults; --budget raises the limit."""
    monkeypatch.setattr("faultbond.app.structure_study.MOST_TESTS", 10)
    model = written(tmp_path, [*(f"s{k}: [x]" for k in range(7)), "law: [z, x, f]", "last: [z, g]"])
    record = record_of(model, tmp_path)
    assert record["tests"]["mso"] is None
    assert record["tests"]["mtes"] == [["f", "g"]]
    assert "more than 10, or too many to search through; --budget raises the limit" in " ".join(
        capsys.readouterr().out.split()
    )
    assert record_of(model, tmp_path, "--budget", "5")["tests"]["mso"] == 28


def test_few_ways(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where there is no time to look at all tests, the smallest of each set of faults are looked at first."""
    monkeypatch.setattr("faultbond.app.structure_study.MOST_WAYS", 2)
    model = written(
        tmp_path,
        ["a: [x]", "b: [x]", "c: [x]", "d: [x, f]", "e: [z, dz]", "h: [z, g]", "i: [dz]"],
        "  derivatives: {dz: z}",
        "unknowns: [x, z, dz]",
    )
    sets = record_of(model, tmp_path)["sets"]
    assert [item["faults"] for item in sets if item["ways"] is not None] == [[], ["f"]]
    assert [item["faults"] for item in sets[:4]] == [[], [], ["f"], []]


def test_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`check` shows what was understood, with the default that holds."""
    target = tmp_path / "record.json"
    model = EXAMPLES / "structures" / "electric_motor.yaml"
    assert main(["check", str(model), "--json", str(target)]) == 0
    text = " ".join(capsys.readouterr().out.split())
    assert "winding I, der(I), w V fR" in text
    assert "default further_sensors: every unknown but rates, each at a cost of 1, trusted" in text
    structure = json.loads(target.read_text(encoding="utf-8"))["structure"]
    assert structure["equations"]["winding"] == ["I", "der(I)", "w", "V", "fR"]
    assert structure["derivatives"] == {"der(I)": "I", "der(w)": "w"}


@pytest.mark.parametrize(
    "words",
    [
        "run {} rec.csv",
        "fit {} rec.csv",
        "simulate {} --inputs rec.csv -o out.csv",
        "accept {} plant.state",
        "reject {} plant.state f",
        "check {} --data rec.csv",
        "analyse {} --trace fV1",
        "analyse {} --code c",
    ],
)
def test_verbs_that_need_laws(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    """They say in one line that there are no laws, and what to do."""
    assert main(words.format(TANKS).split()) == 2
    told = capsys.readouterr().err
    assert "three tanks in a row is a `structure`: it has no laws, and laws are needed here: `blocks`" in told
    assert told.count("\n") == 1


@pytest.mark.parametrize(
    "option", ["--data rec.csv", "--within 60|s", "--separate a b", "--closed 2", "--fewest", "--least-noise"]
)
def test_options_that_need_laws(option: str, capsys: pytest.CaptureFixture[str]) -> None:
    """An option that asks for values is refused by its name."""
    assert main(["analyse", str(TANKS), *(word.replace("|", " ") for word in option.split())]) == 2
    assert (
        f"{option.partition(' ')[0]} asks for values, and a structure has no laws; leave it out"
        in capsys.readouterr().err
    )
