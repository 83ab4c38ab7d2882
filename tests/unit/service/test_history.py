"""What a store keeps can be listed, written as a recording that gives the same records, and passed again."""

import json
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from faultbond.app.plant import find_plant
from faultbond.app.wishes import Wanted
from faultbond.cli import main
from faultbond.contract.json_records import diagnosis_record
from faultbond.errors import FaultbondError
from faultbond.io.out import Out, finite
from faultbond.io.recording import columns_of, read_blocks
from faultbond.io.row_block import Quality, RowBlock, joined_rows
from faultbond.model.graph import Unit
from faultbond.service import history
from faultbond.service.asset import Asset
from faultbond.service.contract.messages import Action, AuditEntry, Deed, NamedRecord
from faultbond.service.contract.store import Commit, Enrolment
from faultbond.service.history import Excerpt, columns_in_units, line_of, tell_history
from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore
from made import EXAMPLES
from postgres import PostgresServer
from stored import deed, enrolment, some_rows, told

TANK, RECORDING = EXAMPLES / "tank" / "model.yaml", EXAMPLES / "tank" / "fault_pipe.csv"
SILENT = Out(text=None, json=None)


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A store in which the tank was watched through a fault that a person then accepted, and some rows more."""
    path = tmp_path_factory.mktemp("kept") / "plant.db"
    plant = find_plant(TANK, Wanted())
    asset = Asset("tank", plant)
    store = open_store(path, reserve=0)
    store.enrol(
        Enrolment(
            asset="tank",
            model_sha256=asset.spec.model_sha256,
            label=plant.document[0],
            text=plant.document[1],
            n_inputs=2,
            n_outputs=2,
        )
    )
    rows = joined_rows([*read_blocks(RECORDING, columns_of(plant.graph))])
    for first in range(0, 2400, 100):
        feed(store, asset, rows.part(slice(first, first + 100)), first)
    decision = Deed(asset="tank", action=Action.ACCEPT, at=5e3, who="Ada", rows=2400, target=("K1",), comment="seen")
    store.commit([Commit(asset="tank", deeds=(decision,), records=asset.do(decision, 0).records)])
    for first in range(2400, 3000, 100):
        feed(store, asset, rows.part(slice(first, first + 100)), first)
    store.close()
    return path


def feed(store: RelationalStore, asset: Asset, rows: RowBlock, first: int) -> None:
    """Watch some rows, and keep what came of them."""
    found = asset.take(rows)
    part = Commit(
        asset="tank", rows=rows, arrived=float(first), records=found.records, curves=found.curves, cursor=str(first)
    )
    store.commit([part])


def of_kinds(records: list[dict[str, Any]], *kinds: str) -> list[dict[str, Any]]:
    """Records of some kinds, without what only the store knows."""
    own = ("id", "asset")
    return [{key: item[key] for key in item if key not in own} for item in records if item["record"] in kinds]


def listed(kept: Path | str, target: Path, *arguments: str) -> list[dict[str, Any]]:
    """The records that `history` writes."""
    assert main(["history", str(kept), "--json", str(target), *arguments]) == 0
    return [json.loads(line) for line in target.read_text().splitlines()]


def test_the_journal(kept: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Records and deeds come in the order in which they were: alarm, diagnoses, what a person did, what followed."""
    records = listed(kept, tmp_path / "all.json")
    kinds = [item["record"] for item in records]
    assert kinds[0] == "detection"
    place = kinds.index("deed")
    assert kinds[place : place + 2] == ["deed", "accepted"]
    assert set(kinds[1:place]) == {"diagnosis"}
    assert records[place] == {
        "record": "deed",
        "asset": "tank",
        "number": 1,
        "at": 5e3,
        "who": "Ada",
        "action": "accept",
        "target": ["K1"],
        "comment": "seen",
        "until": None,
        "undone": None,
        "rows": 2400,
    }
    lines = capsys.readouterr().out.splitlines()
    said = [line.partition("  ")[2] for line in lines]  # without the time
    assert all(one != other for one, other in pairwise(said))
    assert 5 < len(lines) < len(records)
    assert "tank  detection, by flow" in lines[0]
    assert ", begun about 1489 s" in lines[0]
    place = lines.index("5000 s  tank  entry 1, Ada: accept K1: seen")
    assert lines[place + 1].startswith("2399 s  tank  accepted, K1, by person")
    assert "K1 " in lines[place - 1]
    later = listed(kept, tmp_path / "later.json", "--from", "2000", "--to", "2399")
    assert later == [item for item in records if item["record"] == "deed" or item["time"] >= 2000]
    assert listed(kept, tmp_path / "none.json", "--from", "1970-01-01T02:00:00") == []


def test_a_store_in_a_server(kept: Path, tmp_path: Path, postgres: PostgresServer) -> None:
    """The same rows, records and deeds in a server give the same journal and the same recording."""
    source, place = open_store(kept, writes=False), postgres.url()
    target = open_store(place)
    for new in source.enrolments():
        target.enrol(new)
    rows = joined_rows([item for item in source.log_between("tank") if isinstance(item, RowBlock)])
    passed = 0
    for item in source.journal():
        if isinstance(item, NamedRecord):
            target.commit([Commit(asset="tank", records=(item,))])
        else:
            before = rows.part(slice(passed, item.rows))
            target.commit([Commit(asset="tank", rows=before, deeds=(replace(item, number=0),))])
            passed = item.rows
    target.commit([Commit(asset="tank", rows=rows.part(slice(passed, len(rows))))])
    target.close()
    source.close()
    assert listed(place, tmp_path / "server.json") == listed(kept, tmp_path / "file.json")
    for store, name in ((place, "server.csv"), (kept, "file.csv")):
        assert main(["history", str(store), "-o", str(tmp_path / name), "--from", "100", "--to", "2500"]) == 0
    assert (tmp_path / "server.csv").read_bytes() == (tmp_path / "file.csv").read_bytes()


@pytest.mark.parametrize("ending", ["csv", "parquet"])
def test_a_recording_gives_the_same_records(kept: Path, tmp_path: Path, ending: str) -> None:
    """What is written is read by `run` to the last bit, and gives the records of the service up to the decision."""
    pytest.importorskip("pyarrow")
    target = tmp_path / f"tank.{ending}"
    assert main(["history", str(kept), "-o", str(target), "--to", "2399"]) == 0
    graph = find_plant(TANK, Wanted()).graph
    found = joined_rows([*read_blocks(target, columns_of(graph))])
    store = open_store(kept, writes=False)
    rows = [item for item in store.log_between("tank", end=2399.0) if isinstance(item, RowBlock)]
    expected = joined_rows(rows)
    for name in ("time", "u", "y"):
        np.testing.assert_array_equal(getattr(found, name), getattr(expected, name))
    out = tmp_path / "run.json"
    assert main(["run", str(TANK), str(target), "--json", str(out)]) == 1
    again = [json.loads(line) for line in out.read_text().splitlines()]
    before = [history.record_of(item) for item in store.records(kinds=("detection", "diagnosis"))]
    first = of_kinds(again, "detection", "diagnosis")
    live = [item for item in of_kinds(before, "detection", "diagnosis") if float(item["time"]) <= 2399]
    assert len(live) > 5
    assert first[: len(live)] == live
    store.close()


def test_a_report_of_a_period(kept: Path, tmp_path: Path) -> None:
    """The period is passed again with what was decided in it: the report tells the fault, and that it was accepted."""
    target = tmp_path / "tank.html"
    record = listed(kept, tmp_path / "done.json", "-o", str(target))
    assert record == [{"record": "history", "asset": "tank", "output": str(target), "model": str(TANK)}]
    page = target.read_text()
    assert "<html" in page
    assert "Accepted" in page
    store = open_store(kept, writes=False)
    (enrolled,) = store.enrolments()
    course = history.replayed(store, enrolled, Excerpt()).course
    assert [item.candidate.parameters for item in course.found.accepted] == [("K1",)]
    assert course.found.open is None
    quiet = history.replayed(store, enrolled, Excerpt(begin=0.0, end=1400.0))
    assert not quiet.course.found.detections
    assert quiet.course.counts.samples == 1401
    store.close()


def test_a_report_of_a_period_that_begins_inside_an_alarm(kept: Path) -> None:
    """It says what was found live, of the period alone; and none of what was accepted before is found again."""
    store = open_store(kept, writes=False)
    (enrolled,) = store.enrolments()
    raised = next(store.records(kinds=("detection",)))
    (live,) = store.records(kinds=("diagnosis",), end=2399.0, newest=1)
    run = history.replayed(store, enrolled, Excerpt(begin=2000.0, end=live.time))
    assert run.trace is not None
    seen = run.trace.history()
    assert (seen.time[0], seen.time[-1], run.course.counts.samples) == (2000.0, live.time, live.time - 1999)
    assert run.course.found.open is not None
    assert run.course.found.open.time == raised.time
    assert finite(diagnosis_record(seen.diagnoses[-1])) == live.content
    page = run.page().replace("\xa0", " ")
    assert "No fault found" not in page
    assert f"<strong>{raised.time:g} s</strong>" in page
    later = history.replayed(store, enrolled, Excerpt(begin=2450.0, end=2990.0)).course
    assert (later.found.open, later.found.detections, later.counts.samples) == (None, 1, 541)
    store.close()


def test_a_report_whose_alarm_cannot_be_seen_any_more(kept: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where rows from before the alarm are forgotten, it says that one stood open, and what was found live."""
    monkeypatch.setattr(history, "LEAD", -1000)  # no row from before the period
    store = open_store(kept, writes=False)
    (enrolled,) = store.enrolments()
    page = history.replayed(store, enrolled, Excerpt(begin=2000.0, end=2100.0)).page().replace("\xa0", " ")
    raised = next(store.records(kinds=("detection",)))
    assert f"The alarm of {raised.time:g} s stood open when this period began, and what was found live was K1" in page
    assert "No fault found" not in page
    store.close()


def test_what_is_left_of_alarms() -> None:
    """An alarm counts until it was repaired, or over, is open until something was accepted, and again once undone."""
    raised = told("pump", 3)
    accepted, repaired = (told("pump", 5, "accepted", repaired=is_so, components=["pipe"]) for is_so in (False, True))
    accept, seen, undo = (deed("pump", 6, action) for action in (Action.ACCEPT, Action.ACKNOWLEDGE, Action.UNDO))
    cases: list[tuple[list[NamedRecord | Deed], int, bool]] = [
        ([], 0, False),
        ([raised], 1, True),
        ([raised, accept, accepted], 1, False),
        ([raised, accept, repaired], 0, False),
        ([raised, accept, accepted, raised, accept, repaired], 1, False),
        ([raised, accept, repaired, seen, undo], 1, True),
        ([raised, accept, accepted, raised], 2, True),
        ([raised, accept, accepted, raised, told("pump", 9, "accepted", repaired=False, components=[])], 1, False),
    ]
    for journal, unrepaired, is_open in cases:
        left = history._alarms(journal, "pump/a/")
        assert (len(left.unrepaired), left.open is not None) == (unrepaired, is_open)
    assert history._alarms([raised], "pump/b/").open is None  # of another model


def test_units_come_back_to_the_last_bit() -> None:
    """A value in the unit of the model file becomes the same number in SI as it was before."""
    rng = np.random.default_rng(3)
    for unit in (Unit("degC", 1.0, 273.15), Unit("kPa", 1000.0), Unit("cm^3/s", 1e-6), Unit("l/min", 1e-3 / 60)):
        read = np.round(rng.normal(20, 5, 2000), 3)
        values = unit.factor * read + unit.offset
        written = history._in_unit(values, unit)
        np.testing.assert_array_equal(unit.factor * written + unit.offset, values)
        np.testing.assert_array_equal(written, read)  # not 20.200000000000003


def test_columns_of_a_log() -> None:
    """Columns are those that the model file names; a log of several blocks and deeds is one recording."""
    graph = find_plant(TANK, Wanted()).graph
    blocks: list[RowBlock | Deed] = [some_rows(0, 3, n_inputs=2), deed("tank", 3), some_rows(3, 2, n_inputs=2)]
    columns = columns_in_units(graph, blocks)
    assert list(columns) == ["time", "u_in", "u_out", "flow", "pressure"]
    assert columns["time"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0]


def test_the_qualities_of_a_log_are_columns_too() -> None:
    """Of what was not good throughout, beside it; rows of before, and of blocks that are good, count as good."""
    graph = find_plant(TANK, Wanted()).graph
    quality = np.zeros((2, 4), dtype=np.uint8)
    quality[1, 2], quality[0, 0] = Quality.BAD, Quality.UNCERTAIN
    doubted = replace(some_rows(3, 2, n_inputs=2), quality=quality)
    columns = columns_in_units(graph, [some_rows(0, 3, n_inputs=2), doubted])
    assert list(columns) == ["time", "u_in", "u_in.quality", "u_out", "flow", "flow.quality", "pressure"]
    assert columns["u_in.quality"].tolist() == [0.0, 0.0, 0.0, 1.0, 0.0]
    assert columns["flow.quality"].tolist() == [0.0, 0.0, 0.0, 0.0, 2.0]


def test_when_rows_came_is_a_column_too(tmp_path: Path) -> None:
    """Each row has the moment at which it came, or that at which those came that came with it."""
    store = open_store(tmp_path / "plant.db", reserve=0)
    store.enrol(replace(enrolment("tank"), text=TANK.read_text(), n_inputs=2, n_outputs=2))
    alone = replace(some_rows(3, 2, n_inputs=2), arrived=np.array([50.25, 51.5]))
    store.commit([Commit(asset="tank", rows=some_rows(0, 3, n_inputs=2), arrived=49.0)])
    store.commit([Commit(asset="tank", rows=alone, arrived=52.0)])
    target = tmp_path / "a.csv"
    tell_history(store, Excerpt(), output=target, out=SILENT)
    cells = [line.split(",")[-1] for line in target.read_text().splitlines()]
    assert cells == ["time.arrived", "49.0", "49.0", "49.0", "50.25", "51.5"]
    store.close()


@pytest.mark.parametrize(
    ("wanted", "output", "reason"),
    [
        (Excerpt(asset="nobody"), None, "nobody: the store has no such asset; it has pump, fan"),
        (Excerpt(), "a.csv", "The store has the assets pump, fan; name the one that a.csv is to be of"),
        (Excerpt(asset="pump"), "a.txt", "what to write is told by the name's ending"),
        (
            Excerpt(asset="pump", begin=90.0),
            "a.csv",
            "pump: there is no row from 90 s to now; what is kept begins at 0 s",
        ),
        (Excerpt(asset="fan"), "a.html", "fan: there is no row"),
    ],
)
def test_what_cannot_be_written(tmp_path: Path, wanted: Excerpt, output: str | None, reason: str) -> None:
    """One line says what is wrong, and no file is made."""
    store = open_store(tmp_path / "plant.db", reserve=0)
    for name in ("pump", "fan"):
        store.enrol(enrolment(name))
    store.commit([Commit(asset="pump", rows=some_rows(0, 9), records=(told("pump", 3),))])
    target = tmp_path / output if output is not None else None
    with pytest.raises(FaultbondError, match=reason):
        tell_history(store, wanted, output=target, out=SILENT)
    assert target is None or not target.exists()
    store.close()


def test_an_older_model(tmp_path: Path) -> None:
    """A period in which another model was in force is written with that model's names."""
    store = open_store(tmp_path / "plant.db", reserve=0)
    text = TANK.read_text()
    for k, name in enumerate(("flow", "current_flow")):
        new = Enrolment(
            asset="tank",
            model_sha256=f"{k}" * 64,
            label="m.yaml",
            text=text.replace("  flow:     {", f"  {name}: {{"),
            n_inputs=2,
            n_outputs=2,
        )
        assert k == 0 or name in new.text
        store.enrol(new)
        store.commit([Commit(asset="tank", rows=some_rows(100 * k, 10, n_inputs=2))])
    for begin, name in ((0.0, "flow"), (100.0, "current_flow")):
        target = tmp_path / f"{name}.csv"
        tell_history(store, Excerpt(begin=begin, end=begin + 9), output=target, out=SILENT)
        lines = target.read_text().splitlines()
        assert lines[0] == f"time,u_in,u_out,{name},pressure,time.arrived"
        assert len(lines) == 11
    store.close()


def test_a_line_of_each_kind() -> None:
    """What a person did says until when, and what it took back."""
    shelved = Deed(asset="pump", action=Action.SHELVE, at=10.0, who="Ada", rows=0, until=70.0, number=4)
    assert line_of(shelved) == "10 s  pump  entry 4, Ada: shelve until 70 s"
    undone = Deed(asset="pump", action=Action.UNDO, at=10.0, who="Ada", rows=0, undone=4, number=5)
    assert line_of(undone) == "10 s  pump  entry 5, Ada: undo entry 4"
    told = {"record": "accepted", "parameters": ["R"], "by": "person", "repaired": True}
    mended = NamedRecord(id="1", asset="pump", sample=10, time=10.0, kind="accepted", content=told)
    assert line_of(mended) == "10 s  pump  repaired, R, by person"
    found = [{"parameters": ["R"], "probability": 0.925, "group": True}, {"parameters": ["C"], "probability": 0.05}]
    content: dict[str, object] = {"record": "diagnosis", "candidates": found}
    likely = NamedRecord(id="2", asset="pump", sample=10, time=10.0, kind="diagnosis", content=content)
    assert line_of(likely) == "10 s  pump  diagnosis, R 92.5 %"


def test_a_period_that_ends_before_it_begins_is_refused(kept: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is a slip of the pen, and no empty history."""
    assert main(["history", str(kept), "--from", "20", "--to", "10"]) == 2
    assert "The period begins behind its end" in capsys.readouterr().err


def test_what_is_about_no_asset_is_listed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What people brought and ordered is listed behind the journal, and not with that of an asset or a period."""
    path = tmp_path / "plant.db"
    store = open_store(path, reserve=0)
    store.enrol(enrolment("pump"))
    about = {"name": "night.csv", "size": 7, "sha256": "ab", "asset": "", "files": ["ab", "cd"]}
    store.note(AuditEntry(at=1_795_000_000.0, who="emma", what="upload", about=about))
    store.close()
    (record,) = listed(path, tmp_path / "all.json")
    assert record == {
        "record": "audit",
        "number": 1,
        "at": 1_795_000_000.0,
        "who": "emma",
        "what": "upload",
        "about": about,
    }
    said = capsys.readouterr().out
    assert said.endswith("audit 1, emma: upload, name night.csv, size 7, sha256 ab, files ab cd\n")
    assert listed(path, tmp_path / "one.json", "--asset", "pump") == []
    assert listed(path, tmp_path / "later.json", "--from", "1") == []
