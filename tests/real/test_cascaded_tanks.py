"""The cascaded tanks."""

import json
import os
from pathlib import Path

import pytest

from faultbond.cli import DONE, main
from faultbond.io.examples import example
from faultbond.model.text import load_model
from faultbond.synthesis.engine import build_model

MODEL = example("cascaded_tanks") / "model.yaml"
DATA = os.environ.get("FAULTBOND_DATA")


def test_the_model_builds() -> None:
    """Two levels, the upper one not measured."""
    graph = load_model(MODEL)
    model = build_model(graph)
    columns = [item.column for item in graph.inputs] + [item.column for item in graph.sensors]
    assert columns == ["uEst", "yEst"]
    assert model.states == ("node_1.e", "node_2.e")
    assert not model.plant.implicit


@pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")
def test_no_alarm_on_a_healthy_recording(tmp_path: Path) -> None:
    """68 minutes, in which the tanks overflow."""
    records = tmp_path / "records.jsonl"
    recording = Path(DATA or "") / "cascaded_tanks" / "estimation.csv"
    assert main(["run", str(MODEL), str(recording), "--json", str(records)]) == DONE
    lines = [json.loads(line) for line in records.read_text(encoding="utf-8").splitlines()]
    assert [line["record"] for line in lines] == ["run", "end"]
    assert lines[-1]["detections"] == 0
    assert lines[-1]["missing"] == 0
    assert lines[-1]["samples"] == 1024
