"""Fits to recordings of real rigs."""

import json
import os
from pathlib import Path
from typing import Any

import pytest

from faultbond.cli import DONE, main
from faultbond.io.examples import example

DATA = os.environ.get("FAULTBOND_DATA")
pytestmark = pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")


def fitted(name: str, recordings: list[str], tmp_path: Path, *extra: str, text: str | None = None) -> dict[str, Any]:
    """Fit an example to recordings; give the record. The fitted model is `new.yaml`."""
    model = tmp_path / "model.yaml"
    model.write_text(text or (example(name) / "model.yaml").read_text(encoding="utf-8"), encoding="utf-8")
    files = [str(Path(DATA or "") / name / item) for item in recordings]
    target = tmp_path / "record.json"
    new = tmp_path / "new.yaml"
    assert main(["fit", str(model), *files, "-o", str(new), "--json", str(target), *extra]) == DONE
    return dict(json.loads(target.read_text(encoding="utf-8")))


def watched(name: str, recording: str, tmp_path: Path) -> dict[str, Any]:
    """Watch a recording with the fitted model; give the last record."""
    target = tmp_path / "run.jsonl"
    file = Path(DATA or "") / name / recording
    assert main(["run", str(tmp_path / "new.yaml"), str(file), "--json", str(target)]) == DONE
    return dict(json.loads(target.read_text(encoding="utf-8").splitlines()[-1]))


@pytest.mark.parametrize("scrambled", [False, True])
def test_the_carriage_within_one_per_cent(scrambled: bool, tmp_path: Path) -> None:
    """Published mass and frictions of the carriage within 1 %, from nominal values near and far; no alarm then."""
    text = (example("emps") / "model.yaml").read_text(encoding="utf-8")
    if scrambled:
        text = text.replace("95.1089 kg", "130 kg").replace("203.5034", "120").replace("20.3935 N", "35 N")
    record = fitted("emps", ["emps.csv"], tmp_path, "--starts", "1", text=text)
    found = {item["name"]: item for item in record["parameters"]}
    for name, published in (("M", 95.1089), ("Fv", 203.5034), ("Fc", 20.3935)):
        assert found[name]["estimate"] == pytest.approx(published, rel=0.01)
        assert abs(found[name]["estimate"] - published) < 3.0 * found[name]["sd"]
    assert watched("emps", "emps.csv", tmp_path)["detections"] == 0


def test_the_tanks_keep_their_values(tmp_path: Path) -> None:
    """The cascaded tanks' fit foretells the level within 0.05 V, simulates it within 0.3 V, and does not alarm."""
    record = fitted("cascaded_tanks", ["estimation.csv"], tmp_path, "--starts", "1")
    (recording,) = record["recordings"]
    assert recording["prediction_error"]["yEst"] < 0.05
    assert recording["simulation_error"]["yEst"] < 0.3
    assert all(abs(item["estimate"] - item["nominal"]) < 3.0 * item["sd"] for item in record["parameters"])
    assert watched("cascaded_tanks", "estimation.csv", tmp_path)["detections"] == 0


def test_the_heat_capacity_of_the_pipe(tmp_path: Path) -> None:
    """Two recordings of the pipe give the heat capacity of water and steel, 452 kJ/K, within two standard errors."""
    extra = ("--per-recording", "T_0", "--free", "C_pipe", "--starts", "1")
    record = fitted("pipe", ["ULg151202.csv", "ULg151204_1.csv"], tmp_path, *extra)
    (found,) = record["parameters"]
    assert abs(found["estimate"] - 452e3) < 2.0 * found["sd"]
    assert found["sd"] < 0.05 * 452e3
