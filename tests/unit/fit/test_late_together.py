"""Much that comes behind is asked for together, and what only seems to goes."""

import json
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.app import quiet_fit
from faultbond.cli import DONE, main
from faultbond.errors import StructureError
from faultbond.fit import lags
from faultbond.fit.foothold import Footing
from faultbond.fit.imperfections import Imperfection, Kind
from faultbond.io.recording import write_recording
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate

STEP = 0.05  # s
LADDER = """
name: ladder
sample_time: 50 ms
accuracy: 3 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R1: {type: R, law: e = R1*f, parameters: {R1: 1 kohm}}
  C1: {type: C, law: q = C1*e, parameters: {C1: 200 uF}}
  R2: {type: R, law: e = R2*f, parameters: {R2: 2 kohm}}
  C2: {type: C, law: q = C2*e, parameters: {C2: 150 uF}}
  load: {type: R, law: e = R3*f, parameters: {R3: 5 kohm}}
junctions: {line: 1, first: 0, between: 1, second: 0}
bonds: [source -> line, line -> R1, line -> first, first -> C1, first -> between, between -> R2, between -> second,
        second -> C2, second -> load]
sensors:
  v1: {reads: first.e, unit: V, noise: 10 mV}
  v2: {reads: second.e, unit: V, noise: 10 mV}
  i: {reads: line.f, unit: mA, noise: 0.02 mA}
"""
LAGS = {"v1": 0.12, "v2": 0.2, "i": 0.15}


def fitted(folder: Path, truth: str) -> dict[str, Any]:
    """Fit the ladder until quiet to recordings of the true one; give the record of what was done."""
    (folder / "first.yaml").write_text(LADDER, encoding="utf-8")
    for seed in (1, 2):
        moves = np.repeat(np.random.default_rng(seed).choice([-4.0, -1.0, 2.0, 5.0], 40), 30)
        made = simulate(parse_model(truth), Inputs(time=STEP * np.arange(1200.0), values=moves[:, None]), seed=seed)
        names = zip(("v1", "v2", "i"), made.outputs.T, strict=True)
        write_recording(folder / f"{seed}.csv", {"time": made.time, "V": made.inputs[:, 0]} | dict(names))
    words = [folder / "first.yaml", folder / "1.csv", folder / "2.csv", "-o", folder / "new.yaml"]
    target = folder / "records.jsonl"
    assert main(["fit", *map(str, words), "--until-quiet", "--starts", "1", "--json", str(target)]) == DONE
    lines = map(json.loads, target.read_text(encoding="utf-8").splitlines())
    return next(item for item in lines if item["record"] == "quiet")


@pytest.fixture(autouse=True)
def _no_sizes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(quiet_fit, "smallest_of_each", lambda *_: [(), ()])


def test_sensors_that_all_lag_are_found_in_one_round(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each with its own time, in spite of an input that seems to lag as well."""
    truth = LADDER
    for name, time in LAGS.items():
        truth = truth.replace(f"{name}: {{reads", f"{name}: {{lag: {time} s, reads")
    found = fitted(tmp_path, truth)
    assert "together, since many seem to lag" in capsys.readouterr().err
    times = {item["of"]: item["size"] for item in found["added"] if item["kind"] == "lag"}
    assert times == {name: pytest.approx(time, rel=0.15) for name, time in LAGS.items()}
    assert found["quiet"]
    assert found["rounds"] <= 2


def test_one_input_that_lags_is_not_taken_for_its_sensors(tmp_path: Path) -> None:
    """All three come behind, and one lag explains it."""
    found = fitted(tmp_path, LADDER.replace("{unit: V}", "{unit: V, lag: 0.15 s}"))
    assert [(item["kind"], item["of"]) for item in found["added"]] == [("lag", "V")]
    assert found["added"][0]["size"] == pytest.approx(0.15, rel=0.1)
    assert found["quiet"]


def test_they_are_asked_for_together_once(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of three that seem to lag; where that is in vain, each is asked for by itself, and two are no crowd."""
    names, told = ["v1", "v2", "i"], list[str]()

    def hinted(*_: object) -> list[tuple[Imperfection, float]]:
        return [(Imperfection(kind=Kind.LAG, place=name, is_sensor=True), 100.0) for name in names]

    def without_order(*_: object) -> Any:
        raise StructureError

    monkeypatch.setattr(lags, "late_ones", hinted)
    search = SimpleNamespace(trained=(), step=STEP, idle={}, refused={}, asked_together=frozenset())
    search.tell, search.ground_with = told.append, without_order
    stand = Footing(graph=parse_model(LADDER), values={}, starts={})
    seen = []
    for tried in (["v1", "v2"], ["v1", "v2", "i"], ["v1", "v2", "i"], ["v1", "v2", "i", "w"]):
        names[:] = tried
        assert lags.late_together(cast(Any, search), stand) is None
        seen.append(len(told))
    assert seen == [0, 1, 1, 2]
