"""A real water loop in which a valve closes and opens again; only the flow feels it.

The recordings are not part of the project.
"""

import json
import os
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.peers.skab import LARGE, MODEL, Label, Run, form, gives_way, read_labels, summary, turned_over

from faultbond.cli import DONE, FAULT_DETECTED, main
from faultbond.model.text import load_model, parse_model

DATA = os.environ.get("FAULTBOND_DATA")
FOLDER = Path(DATA or "") / "skab"
LABELS = read_labels(FOLDER / "labels.csv") if DATA else ()
needs_data = pytest.mark.skipif(not DATA, reason="FAULTBOND_DATA is not set")


def run(label: Label, folder: Path) -> tuple[int, list[dict[str, Any]]]:
    """Give the exit code and the records of a run."""
    records = folder / "records.jsonl"
    code = main(["run", str(MODEL), str(FOLDER / f"{label.name}.csv"), "--json", str(records)])
    return code, [json.loads(line) for line in records.read_text(encoding="utf-8").splitlines()]


def group_of(diagnosis: dict[str, Any]) -> set[str]:
    """Give the components of the sets that cannot be told apart."""
    return {name for item in diagnosis["candidates"] if item["group"] for name in item["components"]}


def made_run(
    label: Label, alarm: float | None, group: tuple[str, ...] = (), rows: tuple[int, int, int] = (0, 0, 0)
) -> Run:
    """Give a run of which only this is known."""
    return Run(
        label=label,
        gives_way=640.0,
        alarm=alarm,
        cusum=9.0,
        limit=25.0,
        group=group,
        last=(),
        rows=rows,
        shared=1.0,
    )


def test_the_model_names_its_suspects() -> None:
    """Names of components, parameters and columns are what users and scripts rely on."""
    graph = load_model(MODEL)
    assert [item.name for item in graph.components] == ["pump", "pipe", "valve"]
    assert {item.name for item in graph.parameters} == {"H", "K_pipe", "K_valve"}
    assert not graph.inputs
    assert [item.column for item in graph.sensors] == ["Volume Flow RateRMS"]


def test_the_fall_of_the_flow_is_found() -> None:
    """It is where the ramp begins, and None where the drop drowns in noise."""
    times = np.arange(1200.0)
    flow = np.interp(times, [633.0, 655.0], [32.0, 29.0]) + np.random.default_rng(3).normal(0.0, 0.4, 1200)
    flow[::25] = np.nan
    label = Label(name="made", begin=600.0, end=1020.0, dwell=(660.0, 960.0), drop=9.4)
    found = gives_way(times, flow, label)
    assert found is not None
    assert abs(found - 633.0) <= 3.0
    assert gives_way(times, flow, Label(name="made", begin=600.0, end=1020.0, dwell=(660.0, 960.0), drop=0.5)) is None


def test_the_summary_counts_alarms_before_the_fault_as_misses() -> None:
    """An alarm before the valve is turned is too early, one after it opens again too late."""
    label = Label(name="made", begin=600.0, end=1020.0, dwell=(660.0, 960.0), drop=9.4)
    runs = [made_run(label, alarm) for alarm in (599.0, 650.0, 656.0, 970.0, None)]
    words = summary(runs)
    assert f"Drops of {LARGE:g} % and more: 2 of 5 detected, 53 s after the valve was first turned" in words
    assert "13 s after the flow gave way" in words
    assert "Alarms before the closing: 1 of 5" in words


def test_rows_are_counted_over_all_runs() -> None:
    """F1 is of the rows of all runs together: 300 told rightly of 400 told and 420 true ones."""
    label = Label(name="made", begin=600.0, end=1020.0, dwell=(660.0, 960.0), drop=9.4)
    runs = [
        made_run(label, 599.0, ("pump",), (100, 180, 210)),
        made_run(label, 650.0, ("pump", "valve"), (200, 220, 210)),
    ]
    assert form("law", runs) == ("law", f"{600 / 820:.3f}", "1 of 2", "1 of 2", "0 of 2")


def test_resistances_are_the_same_plant() -> None:
    """Turned over, the laws give the same drop at the same flow, and are known to the same flow."""
    declared, turned = load_model(MODEL), parse_model(turned_over())
    for name in ("pipe", "valve"):
        before, after = declared.parameter(f"K_{name}"), turned.parameter(f"R_{name}")
        assert after.nominal == pytest.approx(before.nominal**-2, rel=0.01)
        assert after.accuracy / after.nominal == pytest.approx(2.0 * before.accuracy / before.nominal)


@needs_data
@pytest.mark.parametrize("label", LABELS, ids=[label.name for label in LABELS])
def test_a_closing_valve(label: Label, tmp_path: Path) -> None:
    """No alarm before it; drops of 5 % and more are found, and pump, pipe and valve are not told apart."""
    code, found = run(label, tmp_path)
    if label.drop >= LARGE:
        assert code == FAULT_DETECTED
    if code == DONE:
        return
    alarm, start = found[1], found[1]["time"] - found[1]["sample"]
    assert alarm["record"] == "detection"
    assert alarm["time"] - start >= label.begin
    assert alarm["signals"] == ["flow"]
    if label.drop >= LARGE:
        assert alarm["time"] - start <= label.dwell[0] + 10.0
    for diagnosis in found:
        if diagnosis["record"] == "diagnosis" and diagnosis["time"] - start < label.dwell[1]:
            assert group_of(diagnosis) >= {"pump", "pipe", "valve"}
