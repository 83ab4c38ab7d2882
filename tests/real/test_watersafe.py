"""Four tanks of a real rig. A switching of an outlet valve that the model is not told of is a leak of known size.

The recording is not part of the project.
"""

import csv
import json
import os
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from benchmarks.peers.watersafe import Hidden, Results, exceptions, tables

from faultbond.cli import DONE, FAULT_DETECTED, main
from faultbond.model.text import load_model

FOLDER = Path(__file__).parents[2] / "examples" / "watersafe"
TANK4, TANKS = FOLDER / "tank4.yaml", FOLDER / "tanks.yaml"
DATA = os.environ.get("FAULTBOND_DATA")
needs_data = pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")

Rows = list[dict[str, str]]


def recording(target: Path, first: int, end: int, edit: Callable[[Rows], None] = lambda _: None) -> str:
    """Write a changed copy of the rows from second `first` to before `end`."""
    with (Path(DATA or "") / "watersafe" / "watersafe.csv").open(encoding="utf-8", newline="") as stream:
        rows = [row for row in csv.DictReader(stream) if first <= float(row["t_s"]) < end]
    edit(rows)
    with target.open("w", encoding="utf-8", newline="") as out:
        writer = csv.DictWriter(out, rows[0])
        writer.writeheader()
        writer.writerows(rows)
    return str(target)


def run(model: Path, rows: str, folder: Path) -> tuple[int, list[dict[str, Any]]]:
    """Give the exit code and the records of a run."""
    records = folder / "records.jsonl"
    code = main(["run", str(model), rows, "--json", str(records)])
    return code, [json.loads(line) for line in records.read_text(encoding="utf-8").splitlines()]


def group_of(diagnosis: dict[str, Any]) -> list[set[str]]:
    """Give the sets that cannot be told from the best one, best first."""
    return [set(item["parameters"]) for item in diagnosis["candidates"] if item["group"]]


def test_the_models_name_their_suspects() -> None:
    """Names of parameters and columns are what users and scripts rely on."""
    tank4, tanks = load_model(TANK4), load_model(TANKS)
    assert {item.name for item in tank4.parameters} == {"A4", "Q4", "G4"}
    assert {item.name for item in tanks.parameters} == {f"{kind}{k}" for kind in "AGL" for k in range(1, 5)}
    assert [item.column for item in tank4.inputs] == ["FS_A4"]
    assert [item.column for item in tank4.sensors] == ["LS_A4"]
    flows = [f"FS_{side}{k}" for side in "AC" for k in range(1, 5)]
    assert [item.column for item in tanks.inputs] == flows
    assert [item.column for item in tanks.sensors] == [f"LS_A{k}" for k in range(1, 5)]


def test_the_tables_count_what_was_found() -> None:
    """Only switchings of 9.8 cm3/s and more, or of unknown size, are asked for; what is not first is named."""
    right = Hidden(time=1.0, valve="VA_C1", change=15.0, delay=60.0, right_tank=True, right_leak=True, leak_listed=True)
    area = Hidden(time=2.0, valve="VA_C2", change=-15.0, delay=80.0, best=("A2",), right_tank=True, leak_listed=True)
    missed = Hidden(time=3.0, valve="VA_C3", change=None, delay=None)
    small = Hidden(time=4.0, valve="VA_C4", change=2.4, delay=None)
    results = Results(windows=(), healthy=(), hidden=(right, area, missed, small))
    *_, (_, header, rows) = tables(results)
    assert header[1:] == ("detected", "median", "90 %", "right tank", "right leak first", "leak in the group")
    assert rows[0][1:] == ("2 of 3", "70 s", "78 s", "2", "1", "2")
    assert rows[3][1:] == ("0 of 1", "-", "-", "0", "0", "0")
    assert exceptions(results) == ["VA_C2 at 2 s by -15.0 cm3/s: A2 first", "VA_C3 at 3 s by -: missed"]


@needs_data
@pytest.mark.parametrize(("first", "opening", "end"), [(400, 749, 1109), (4003, 4352, 4712)])
def test_an_opened_outlet_of_tank_4(tmp_path: Path, first: int, opening: int, end: int) -> None:
    """It is found; without inflow the area fits alike; in the end it is the outlet, of its size."""
    code, found = run(TANK4, recording(tmp_path / "window.csv", first, end), tmp_path)
    assert code == FAULT_DETECTED
    alarm = found[1]
    assert opening < alarm["time"] <= opening + 100
    assert alarm["signals"] == ["LS_A4"]
    diagnoses = [record for record in found if record["record"] == "diagnosis"]
    assert diagnoses[0]["time"] <= alarm["time"] + 100  # all lanes have begun by then
    early = group_of(diagnoses[0])
    assert {"Q4"} in early
    assert {"A4"} in early
    last = diagnoses[-1]["candidates"][0]
    assert last["components"] == ["demand4"]
    assert set(last["parameters"]) == {"Q4"}
    assert 15e-6 < last["parameters"]["Q4"]["estimate"] < 21e-6  # by its meter 18e-6
    assert group_of(diagnoses[-1]) == [{"Q4"}]


@needs_data
@pytest.mark.parametrize("first", [0, 2000])
def test_no_alarm_on_healthy_tanks(tmp_path: Path, first: int) -> None:
    """Waves, hysteresis and balance errors of a real rig are no fault."""
    code, found = run(TANKS, recording(tmp_path / "healthy.csv", first, 5000), tmp_path)
    assert code == DONE
    assert [record["record"] for record in found] == ["run", "end"]
    assert found[-1]["samples"] == 5000 - first


@needs_data
def test_a_hidden_switching_is_a_leak_of_its_tank(tmp_path: Path) -> None:
    """C2 opens at 1469 s by 16 cm3/s while its meter is made to stay where it was."""

    def hide(rows: Rows) -> None:
        before = [row["FS_C2"] for row in rows if float(row["t_s"]) < 1469]
        for row in rows[len(before) :]:
            row["FS_C2"] = before[-1]

    code, found = run(TANKS, recording(tmp_path / "hidden.csv", 800, 1769, hide), tmp_path)
    assert code == FAULT_DETECTED
    alarm, last = found[1], found[-2]
    assert 1469 < alarm["time"] <= 1469 + 100
    assert alarm["signals"] == ["LS_A2"]
    assert {"L2"} in group_of(last)
    best = last["candidates"][0]["parameters"]
    assert set(best) == {"L2"}
    assert 12e-6 < best["L2"]["estimate"] < 20e-6
