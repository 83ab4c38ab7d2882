"""The three tanks of the toolbox: plant, controller and faults as published, and what the benchmark makes of them."""

import math
from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from benchmarks.peers import three_tank
from scipy.interpolate import CubicSpline

from faultbond.io import columns_of, read_rows
from faultbond.model.text import load_model
from faultbond.simulate import Fault, Inputs, columns, simulate

FOLDER = Path(__file__).parents[2] / "examples" / "three_tank"
SCRIPT = run_path(str(FOLDER / "make_three_tank.py"))
GRAPH = load_model(FOLDER / "model.yaml")


@pytest.mark.parametrize(("name", "seed", "faults"), [("healthy", 1, []), ("fault_valve1", 2, [SCRIPT["RAMP"]["V1"]])])
def test_recordings_are_those_of_the_script(name: str, seed: int, faults: list[Fault]) -> None:
    """The script makes the recordings that lie beside it."""
    made = np.column_stack(list(columns(GRAPH, SCRIPT["record"](GRAPH, seed, faults), digits=6).values()))
    rows = list(read_rows(FOLDER / f"{name}.csv", columns_of(GRAPH)))
    stored = np.array([[row.time, *row.u, *row.y] for row in rows])
    np.testing.assert_allclose(stored, made, rtol=0, atol=1e-5)


def test_level_follows_its_reference() -> None:
    """At rest p1 is what the reference says; the optimal gains leave all poles of the loop on the left."""
    gains, lead = SCRIPT["feedback"]()
    closed = SCRIPT["A"] - np.outer(SCRIPT["B"], gains)
    assert np.linalg.eigvals(closed).real.max() < -0.2
    assert np.linalg.solve(-closed, SCRIPT["B"] * lead)[0] == pytest.approx(1.0, abs=1e-12)


@pytest.mark.parametrize("fault", ["", *three_tank.ASKED])
def test_bond_graph_is_the_published_plant(fault: str) -> None:
    """Fed with the same flow, finely sampled, the bond graph records what the published equations give."""
    faults = [SCRIPT["RAMP"][fault]] if fault else []
    given = SCRIPT["record"](GRAPH, None, faults)
    fine = np.linspace(0.0, 20.0, 4001)
    q0 = CubicSpline(given.time, given.inputs)(fine + 0.5 * fine[1])  # each stretch holds its middle
    ours = simulate(GRAPH, Inputs(time=fine, values=q0), faults, seed=None)
    np.testing.assert_allclose(ours.outputs[::20], given.outputs, rtol=0, atol=2e-4)


def test_faults_are_found_and_a_healthy_plant_is_left_alone() -> None:
    """Each ramp is found within 3 s, none in a healthy run; valve 3 and tank 3 share, T1 and the input, not T2."""
    found = {fault: three_tank.play((fault, 11, three_tank.ROWS)) for fault in ("", *three_tank.ASKED)}
    assert found[""].alarm is None
    assert found[""].late == ()
    for fault in three_tank.ASKED:
        assert 0.2 < found[fault].delay(found[fault].alarm) < 3.0
        assert fault in found[fault].early
    assert {"V3", "T3"} <= set(found["V3"].late) & set(found["T3"].late)
    assert found["T1"].late == ("T1", "q0.bias")  # a leak that takes of what the input brings is an error of that input
    assert found["T2"].late == ("T2",)


def test_alarm_of_the_residuals_takes_three_in_a_row(monkeypatch: pytest.MonkeyPatch) -> None:
    """Two samples beyond a limit are none, three are, at the third; nothing counts before 6 s."""
    recording = three_tank.record("", 5)
    seen = np.zeros((three_tank.ROWS, 3))
    monkeypatch.setattr(three_tank, "limits", lambda: (1.0, 1.0, 1.0))
    monkeypatch.setattr(three_tank, "residuals", lambda _: seen)
    seen[10:20, 0] = 2.0
    seen[100:102, 1] = -2.0
    seen[102, 2] = 2.0
    assert three_tank.judge(recording) is None
    seen[102, 1] = -2.0
    assert three_tank.judge(recording) == pytest.approx(10.2)


def test_line_of_the_table() -> None:
    """A run with an alarm before the fault, or none, counts as missed; the line tells groups and how often."""
    runs = [
        three_tank.Outcome(fault="V3", seed=k, alarm=alarm, early=early, late=("T3", "V3"), residuals=other)
        for k, (alarm, early, other) in enumerate([(7.0, ("V3",), 7.5), (7.5, ("V2",), None), (3.0, ("V3",), 8.0)])
    ]
    cells = three_tank.row("V3", runs)
    assert cells[:5] == ("V3", "4.35 s, none missed", "1.50 s, never", "1", "falls short")
    assert cells[5:] == ("2.00 s, never", "1", "67 %", "100 %", "T3, V3 (3)")
    assert three_tank.row("V3", runs[:2])[4] == "met"
    assert math.isinf(runs[2].delay(runs[2].alarm))
    assert three_tank.false_alarms("Healthy", runs) == "Healthy: false alarms in 3 of 3 runs, of the residuals in 2."
