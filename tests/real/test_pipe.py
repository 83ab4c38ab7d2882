"""The hot-water pipe."""

import json
import os
from pathlib import Path

import pytest

from faultbond.cli import DONE, main
from faultbond.io.examples import example
from faultbond.model.text import load_model
from faultbond.synthesis.engine import build_model

MODEL = example("pipe") / "model.yaml"
DATA = os.environ.get("FAULTBOND_DATA")


def test_the_model_builds() -> None:
    """A temperature for each lump of water and one for the thermometer."""
    graph = load_model(MODEL)
    model = build_model(graph)
    columns = [item.column for item in graph.inputs] + [item.column for item in graph.sensors]
    assert columns == [
        "mass_flow_kg_s",
        "water_in_degC",
        "water_out_degC",
    ]
    assert len(model.states) == 21
    assert not model.plant.implicit


@pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")
@pytest.mark.parametrize(("name", "rows"), [("ULg150801", 274), ("ULg151202", 179), ("ULg151204_1", 109)])
def test_no_alarm_on_a_healthy_recording(name: str, rows: int, tmp_path: Path) -> None:
    """Fronts of hot and cold water at three flows, rows at uneven times."""
    records = tmp_path / "records.jsonl"
    recording = Path(DATA or "") / "pipe" / f"{name}.csv"
    assert main(["run", str(MODEL), str(recording), "--json", str(records)]) == DONE
    lines = [json.loads(line) for line in records.read_text(encoding="utf-8").splitlines()]
    assert [line["record"] for line in lines] == ["run", "end"]
    assert lines[-1]["detections"] == 0
    assert lines[-1]["missing"] == 0
    assert lines[-1]["samples"] == rows
