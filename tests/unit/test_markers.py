"""Numbers that stand for no value: after an alarm the verdict says so."""

import csv
from pathlib import Path

import numpy as np
import pytest

from faultbond.app.markers import TIMES, markers_in
from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.io.grid import PointBlock
from faultbond.model.text import load_model
from made import EXAMPLES

MODEL = EXAMPLES / "tank" / "model.yaml"
FLOW = 1e-4


def points(flow: FloatArray) -> list[PointBlock]:
    """Points of 1 s with these readings of the flow meter, SI, in two blocks."""
    n = len(flow)
    parts = slice(n // 2), slice(n // 2, n)
    times, y = np.arange(n, dtype=np.float64), np.stack([flow, np.full(n, 1e4)], axis=1)
    none, u = np.zeros(n, dtype=bool), np.full((n, 2), 40.0)
    return [
        PointBlock(index=np.arange(n)[k], time=times[k], dt=np.ones(n)[k], u=u[k], y=y[k], resumes=none[k])
        for k in parts
    ]


@pytest.mark.parametrize(
    ("marker", "times", "text"),
    [
        (-9999.0, 30, "-9999"),
        (-999.9, 30, "-999.9"),
        (99999.0, TIMES, "99999"),
        (-9999.0, TIMES - 1, None),  # a reading may be so by chance
        (-9998.0, 30, None),  # any other number is a reading
        (1.2 * FLOW, 30, None),
    ],
)
def test_nines_that_come_again_far_from_all_else_are_told(marker: float, times: int, text: str | None) -> None:
    """In the unit of the column."""
    graph = load_model(MODEL)
    (flow,) = (item for item in graph.sensors if item.name == "flow")
    readings = FLOW * (1.0 + 0.1 * np.sin(np.arange(600.0)))
    readings[100 : 100 + times] = marker * flow.unit.factor
    found = markers_in(graph, points(readings))
    assert [(item.column.name, item.text, item.times) for item in found] == ([("flow", text, times)] if text else [])


def test_nines_among_readings_of_that_size_are_readings() -> None:
    """A speed of 999 rpm is one."""
    graph = load_model(MODEL)
    (flow,) = (item for item in graph.sensors if item.name == "flow")
    readings = np.linspace(900.0, 1100.0, 600) * flow.unit.factor
    readings[200:260] = 999.0 * flow.unit.factor
    assert markers_in(graph, points(readings)) == ()
    readings = np.linspace(900.0, 998.9, 600) * flow.unit.factor
    readings[-60:] = 999.0 * flow.unit.factor
    assert markers_in(graph, points(readings)) == ()  # the highest, but the next one is near
    assert markers_in(graph, []) == ()
    assert markers_in(graph, points(np.full(600, np.nan))) == ()
    assert markers_in(graph, points(np.full(600, -9999.0 * flow.unit.factor))) == ()  # nothing to compare it with


def test_the_verdict_says_it_first(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recorder that wrote -9999 for a while, without a fault."""
    with (EXAMPLES / "tank" / "healthy.csv").open() as stream:
        rows = list(csv.reader(stream))[:2000]
    place = rows[0].index("pressure")
    for row in rows[1000:1300]:
        row[place] = "-9999"
    recording = tmp_path / "r.csv"
    recording.write_text("\n".join(",".join(row) for row in rows))
    assert main(["run", str(MODEL), str(recording)]) == 1
    said = " ".join(capsys.readouterr().out.split())
    assert "pressure is -9999 in 300 samples: where that is how a recorder says that it has no value, leave" in said
    assert said.index("-9999 in 300") < said.index("Most likely")
