"""Two things that change one after the other: what stands for both is not claimed; each is found if one is accepted."""

import json
from pathlib import Path
from typing import Any

import numpy as np
import pytest

import faultbond as fb
from faultbond.cli import main
from made import EXAMPLES

TANK = EXAMPLES / "tank"
FIRST, SECOND, THEN = "K1=x1.6@1230", "K2=x0.5@3140", 3140.0  # what a step of the flow sensor would look like by then


def watched(folder: Path, faults: list[str], *words: str, rows: int = 4920) -> list[dict[str, Any]]:
    """The records of `run` on a recording of the tank with some faults."""
    recording, records = folder / "recording.csv", folder / "records.jsonl"
    told = [word for fault in faults for word in ("--fault", fault)]
    healthy = folder / "healthy.csv"
    healthy.write_text("\n".join((TANK / "healthy.csv").read_text().splitlines()[: rows + 1]) + "\n")
    model = str(TANK / "model.yaml")
    simulated = ["simulate", model, "--inputs", str(healthy), *told, "--seed", "3", "-o", str(recording)]
    assert main(simulated) == 0
    main(["run", model, str(recording), "--json", str(records), *words])
    return [json.loads(line) for line in records.read_text().splitlines()]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Where the recording of both faults is."""
    return tmp_path_factory.mktemp("both")


@pytest.fixture(scope="module")
def records(folder: Path) -> list[dict[str, Any]]:
    """Those of both faults, of which nobody accepts the first."""
    return watched(folder, [FIRST, SECOND])


def test_what_stands_for_both_is_not_claimed(records: list[dict[str, Any]]) -> None:
    """The pipe is sure for half of an hour; what takes its place then is at most as likely as that more has changed."""
    told = [item for item in records if item["record"] == "diagnosis"]
    before = [item for item in told if item["time"] < THEN]
    assert all("superseded" not in item for item in before)
    assert before[-1]["candidates"][0]["components"] == ["pipe"]
    assert before[-1]["candidates"][0]["probability"] > 0.99
    last = told[-1]
    assert last["superseded"]["components"] == ["pipe"]
    assert THEN - 60.0 < last["superseded"]["until"] < THEN + 60.0
    assert last["mismatch"] == 0.5
    assert max(item["probability"] for item in last["candidates"]) < 0.52


def test_what_leads_to_the_end_is_not_claimed_either(tmp_path: Path) -> None:
    """A second change that is small: for minutes nothing explains it, then lanes of the first follow it."""
    told = [item for item in watched(tmp_path, [FIRST, "K4=x1.15@3140"]) if item["record"] == "diagnosis"]
    assert any(item["unexplained"] is not None for item in told)
    last = told[-1]
    assert last["unexplained"] is None
    assert last["candidates"][0]["components"] == last["superseded"]["components"] == ["pipe"]
    assert THEN - 60.0 < last["superseded"]["until"] < THEN + 60.0
    assert last["mismatch"] == 0.5
    assert last["candidates"][0]["probability"] < 0.52


def test_it_is_said_what_was_sure_and_what_to_do(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """In words, on the page, and without a claim."""
    page = tmp_path / "page.html"
    watched(tmp_path, [FIRST, SECOND], "--report", str(page))
    said = "pipe was sure to be at fault, and does not explain what came then."
    assert said in page.read_text()
    main(["run", str(TANK / "model.yaml"), str(tmp_path / "recording.csv")])
    text = " ".join(capsys.readouterr().out.split())
    assert f"Up to 3125 s {said}" in text
    assert "no fault is claimed" in text
    assert "`--accept auto`" in text
    assert "Most likely" not in text


def test_each_is_found_where_the_first_is_accepted(tmp_path: Path) -> None:
    """By the rule: nothing is superseded, and the orifice is found beside the pipe."""
    told = watched(tmp_path, [FIRST, SECOND], "--accept", "auto")
    assert [item["components"] for item in told if item["record"] == "accepted"] == [["pipe"], ["orifice"]]
    assert not [item for item in told if "superseded" in item]


def test_one_fault_supersedes_nothing(tmp_path: Path) -> None:
    """However long it lasts."""
    told = watched(tmp_path, [FIRST])
    assert not [item for item in told if "superseded" in item]
    assert [item for item in told if item["record"] == "diagnosis"][-1]["candidates"][0]["probability"] > 0.99


@pytest.mark.parametrize(("rejected", "superseded"), [("flow", ("pipe",)), ("pipe", None)])
def test_who_rejects_what_took_its_place_is_told_all_the_same(
    records: list[dict[str, Any]], folder: Path, rejected: str, superseded: tuple[str, ...] | None
) -> None:
    """What was sure before stays known, unless that is rejected: the next best is claimed no more than the last."""
    model = fb.load(TANK / "model.yaml")
    monitor, rows = fb.Monitor(model), np.genfromtxt(folder / "recording.csv", delimiter=",", names=True)
    columns = [name for name in rows.dtype.names or () if name != "time"]
    for number, row in enumerate(rows[:4700]):
        monitor.update(float(row["time"]), {name: float(row[name]) for name in columns})
        if number == 4400:
            assert monitor.diagnosis is not None
            assert monitor.diagnosis.superseded is not None
            monitor.reject(rejected)
    last = monitor.diagnosis
    assert last is not None
    assert (last.superseded.components if last.superseded is not None else None) == superseded
    assert (last.mismatch == 0.5) == (superseded is not None)


def test_what_takes_the_place_of_something_that_was_sure_for_minutes_only_is_not_claimed(tmp_path: Path) -> None:
    """A pump, then a pressure sensor: something else is sure for two minutes, and fits again later."""
    faults = ["K8=x0.401@2466", "pressure.bias=-2390@2571..2708"]
    told = [item for item in watched(tmp_path, faults) if item["record"] == "diagnosis"]
    last = told[-1]
    assert "pressure" not in last["candidates"][0]["components"]
    assert any(item["unexplained"] is not None for item in told)
    assert last["unexplained"] is None
    assert last["superseded"]["until"] < last["time"] - 600.0
    assert last["mismatch"] == 0.5
    assert last["candidates"][0]["probability"] < 0.52
