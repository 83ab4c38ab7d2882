"""`run` on recordings that are not as they should be: no false alarm, the fault is found, and all is counted."""

import json
from collections.abc import Callable, Iterable, Iterator
from datetime import UTC, datetime, timedelta, timezone
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app import methods
from faultbond.app.engine import build_watcher
from faultbond.cli import main
from faultbond.io.prepared import Identity
from faultbond.model.graph import BondGraph
from faultbond.runtime.core import Core

EXAMPLES = Path(__file__).parents[2] / "examples"
STEP = 0.02
ROWS = 900
FAULT = 12.0  # s
DEFECTS = ("missing", "late", "duplicate", "untimed", "unused", "clock_jumps", "saturated", "frozen", "wild")

Rows = list[list[str]]
Edit = Callable[[Rows], Iterable[list[str]]]


@pytest.fixture(scope="module", autouse=True)
def built_once() -> Iterator[None]:
    """Build the engine of a model once for all runs."""
    known: dict[str, Core] = {}

    def build(graph: BondGraph, identity: Identity | None = None) -> Core:
        if graph.sha256 not in known:
            known[graph.sha256] = build_watcher(graph, identity)
        return known[graph.sha256]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(methods, "build_watcher", build)
        yield


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Give a folder with recordings of the RC circuit, healthy and faulty, at its rate and at twice its rate."""
    place = tmp_path_factory.mktemp("rough")
    text = (EXAMPLES / "rc" / "model.yaml").read_text()
    assert "sample_time: 0.02 s" in text
    (place / "model.yaml").write_text(text)
    (place / "fast.yaml").write_text(text.replace("sample_time: 0.02 s", "sample_time: 0.01 s"))
    for name, model, step in (("", "model", STEP), ("_fast", "fast", STEP / 2)):
        rows = [f"{k * step:.2f},{(5, 9, 3, 7)[int(k * step / 1.1) % 4]}" for k in range(round(ROWS * STEP / step))]
        inputs = place / f"inputs{name}.csv"
        inputs.write_text("\n".join(["time,V", *rows]) + "\n")
        common = ["simulate", str(place / f"{model}.yaml"), "--inputs", str(inputs), "--seed", "3"]
        assert main([*common, "-o", str(place / f"healthy{name}.csv")]) == 0
        assert main([*common, "--fault", f"C=160@{FAULT}", "-o", str(place / f"faulty{name}.csv")]) == 0
    return place


def watched(model: Path, recording: Path, target: Path) -> tuple[int, list[dict[str, Any]]]:
    """Give the exit code and the records of a run."""
    code = main(["run", str(model), str(recording), "--json", str(target)])
    return code, [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()]


def spoiled(source: Path, target: Path, edit: Edit) -> Path:
    """Write a changed copy of a recording; `edit` gets the cells of the rows below the header."""
    header, *rows = source.read_text().splitlines()
    changed = edit([row.split(",") for row in rows])
    target.write_text("\n".join([header, *(",".join(cells) for cells in changed)]) + "\n")
    return target


def counted(end: dict[str, Any]) -> dict[str, int]:
    """Give the defects that were found."""
    return {name: end[name] for name in DEFECTS if end[name]}


def iso(moment: datetime, hours: float) -> str:
    """Give a moment as the clock of a time zone shows it, with the zone."""
    return moment.astimezone(timezone(timedelta(hours=hours))).isoformat()


def as_iso(rows: Rows, zone: Callable[[int], float], *, named: bool) -> Rows:
    """Give rows with ISO times from a zone by row, named or not."""
    begin = datetime(2026, 10, 25, 0, 59, 50, tzinfo=UTC)
    times = [iso(begin + timedelta(seconds=float(cells[0])), zone(k)) for k, cells in enumerate(rows)]
    return [[text if named else text[:-6], *cells[1:]] for text, cells in zip(times, rows, strict=True)]


def winter(row: int) -> float:
    """Give the hours that the clock of central Europe is ahead, set back after 10 s."""
    return 2.0 if row < 500 else 1.0


def some(rows: Rows, seed: int) -> Rows:
    """Give rows of which about 5 % are missing and the others are a little out of order."""
    chance = np.random.default_rng(seed)
    kept = [cells for k, cells in enumerate(rows) if k == 0 or chance.random() < 0.95]
    return sorted(kept, key=lambda cells: float(cells[0]) + chance.uniform(0, 20 * STEP) * (float(cells[0]) > 1))


ROUGH: dict[str, tuple[str, Edit, set[str]]] = {
    "as it should be": ("", lambda rows: rows, set()),
    "twice the rate": ("_fast", lambda rows: rows, {"unused"}),
    "half the rate": ("", lambda rows: rows[::2], {"missing"}),
    "a rate that changes": ("", lambda rows: [*rows[:300:2], *rows[300:450], *rows[450::3]], {"missing"}),
    "every row twice": ("", lambda rows: [cells for cells in rows for _ in range(2)], {"duplicate"}),
    "rows missing and out of order": ("", lambda rows: some(rows, 1), {"missing", "late"}),
    "a time zone that changes": ("", lambda rows: as_iso(rows, winter, named=True), set()),
    "local time in autumn": ("", lambda rows: as_iso(rows, winter, named=False), {"clock_jumps"}),
    "local time in spring": (
        "",
        lambda rows: as_iso(rows, lambda row: 1.0 + (row >= 500), named=False),
        {"clock_jumps"},
    ),
}


DIAGNOSED = ("twice the rate", "half the rate", "rows missing and out of order", "local time in autumn")


@pytest.mark.parametrize(("case", "fault"), [*((case, False) for case in ROUGH), *((case, True) for case in DIAGNOSED)])
def test_rough_recordings(case: str, fault: bool, folder: Path, tmp_path: Path) -> None:
    """A healthy plant raises no alarm, a faulty one is diagnosed, and the last record counts what was wrong."""
    name, edit, defects = ROUGH[case]
    recording = spoiled(folder / f"{'faulty' if fault else 'healthy'}{name}.csv", tmp_path / "r.csv", edit)
    code, found = watched(folder / "model.yaml", recording, tmp_path / "r.jsonl")
    assert code == fault
    assert counted(found[-1]).keys() == defects
    if fault:
        assert set(found[-2]["candidates"][0]["parameters"]) == {"C"}
        assert found[1]["sample"] == pytest.approx(FAULT / STEP, abs=60)


@pytest.mark.parametrize("length", [150, 590, 700])
def test_a_gap_in_which_the_plant_goes_on(length: int, folder: Path, tmp_path: Path) -> None:
    """Inputs may change in a gap, short or long: the states are then uncertain, and no alarm is raised."""
    for first in (145, 170):
        edit: Edit = lambda rows, first=first: [*rows[:first], *rows[first + length :]]  # type: ignore[misc]  # noqa: E731
        recording = spoiled(folder / "healthy.csv", tmp_path / "r.csv", edit)
        code, found = watched(folder / "model.yaml", recording, tmp_path / "r.jsonl")
        assert (code, found[-1]["watched"] > 100) == (0, True)
        assert counted(found[-1]) == ({"clock_jumps": 1} if length > 600 else {"missing": length})


def test_a_fault_after_a_gap_and_a_gap_after_a_fault(folder: Path, tmp_path: Path) -> None:
    """A gap hides no fault, whether it comes before, after or at the onset.

    Whether R or C has changed shows at the onset only, so that a gap there leaves both.
    """
    for first, last, names in ((450, 580, {"C"}), (700, 790, {"C"}), (150, 770, {"C", "R"})):
        edit: Edit = lambda rows, first=first, last=last: [*rows[:first], *rows[last:]]  # type: ignore[misc]  # noqa: E731
        recording = spoiled(folder / "faulty.csv", tmp_path / "r.csv", edit)
        code, found = watched(folder / "model.yaml", recording, tmp_path / "r.jsonl")
        assert code == 1
        group = {
            name: item
            for found in found[-2]["candidates"]
            if found["group"]
            for name, item in found["parameters"].items()
        }
        assert group.keys() == names
        assert group["C"]["estimate"] == pytest.approx(160e-6, rel=0.1)


def test_rows_that_go_backwards_are_refused(folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A recording whose rows are in the wrong order is refused; a few late rows are not."""
    model = EXAMPLES / "rc" / "model.yaml"
    for edit, code in ((lambda rows: rows[::-1], 2), (lambda rows: [rows[k ^ 1] for k in range(900)], 0)):
        capsys.readouterr()
        recording = spoiled(folder / "healthy.csv", tmp_path / "r.csv", edit)
        assert main(["run", str(model), str(recording)]) == code
        assert ("most rows are earlier than all before" in capsys.readouterr().err) == (code == 2)


def test_a_sensor_without_any_value(folder: Path, tmp_path: Path) -> None:
    """A column without a number leaves the plant to the other sensors."""
    model = EXAMPLES / "dc_motor_current" / "model.yaml"
    inputs = tmp_path / "inputs.csv"
    inputs.write_text("time,V\n" + "".join(f"{k * STEP:.2f},{(5, 9, 3)[k // 70 % 3]}\n" for k in range(500)))
    for fault, code in (([], 0), (["--fault", "C=x2@5"], 1)):
        whole = tmp_path / "whole.csv"
        assert main(["simulate", str(model), "--inputs", str(inputs), *fault, "--seed", "1", "-o", str(whole)]) == 0
        header = whole.read_text().splitlines()[0].split(",")
        place = header.index("i")

        def edit(rows: Rows, place: int = place) -> Rows:
            return [[*cells[:place], "n/a", *cells[place + 1 :]] for cells in rows]

        got, found = watched(model, spoiled(whole, tmp_path / "r.csv", edit), tmp_path / "r.jsonl")
        assert (got, counted(found[-1])) == (code, {"missing": 500})


def test_saturated_and_frozen_values(folder: Path, tmp_path: Path) -> None:
    """Values at the end of a range are not used, and a sensor that stays the same is counted."""
    model = tmp_path / "model.yaml"
    text = (folder / "model.yaml").read_text()
    model.write_text(text.replace("reads: C.e,", "reads: C.e, range: [0 V, 7 V],"))

    def clipped(rows: Rows) -> Rows:
        return [[*cells[:-1], f"{min(float(cells[-1]), 7.0):g}"] for cells in rows]

    recording = spoiled(folder / "healthy.csv", tmp_path / "r.csv", clipped)
    at_end = sum(row.endswith(",7") for row in recording.read_text().splitlines())
    code, found = watched(model, recording, tmp_path / "r.jsonl")
    assert (code, counted(found[-1])) == (0, {"missing": at_end, "saturated": at_end})
    assert at_end > 100

    def still(rows: Rows) -> Rows:
        return [*rows[:800], *([*cells[:-1], rows[800][-1]] for cells in rows[800:])]

    recording = spoiled(folder / "healthy.csv", tmp_path / "r.csv", still)
    _, found = watched(folder / "model.yaml", recording, tmp_path / "r.jsonl")
    assert counted(found[-1]) == {"frozen": 100}
