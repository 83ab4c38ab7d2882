"""What a store forgets, how small it is then, and how small what it keeps is."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest

from faultbond.errors import StoreError
from faultbond.service.contract.store import Commit, Forgotten
from faultbond.service.store import retention, tail
from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore
from stored import deed, enrolment, flat, some_curves, some_rows, told


def grown(store: RelationalStore, first: int, last: int, *, each: int = 50, asset: str = "pump") -> None:
    """Commit rows that arrive at their own time, with a checkpoint at the end."""
    for begin in range(first, last, each):
        store.commit(
            [
                Commit(
                    asset=asset,
                    rows=some_rows(begin, each),
                    arrived=float(begin),
                    curves=some_curves(begin, each),
                    records=(told(asset, begin),),
                    deeds=(deed(asset, begin + each),) if begin % 1000 == 0 else (),
                )
            ]
        )
    store.commit([Commit(asset=asset, checkpoint=b"state")])


def begun(place: str | Path) -> RelationalStore:
    """An empty store with one asset."""
    found = open_store(place, reserve=0)
    found.enrol(enrolment())
    return found


@pytest.fixture
def store(place: str) -> Iterator[RelationalStore]:
    """An empty store of each kind with one asset."""
    found = begun(place)
    yield found
    found.close()


def test_forgetting_by_age(store: RelationalStore) -> None:
    """Large chunks that arrived before a time go, rows and curves; records and deeds stay, and the log goes on."""
    grown(store, 0, 10_000)
    assert store.retain(older_than=4500.0) == Forgotten(rows=4000, points=4000)
    assert flat(store.log_after("pump", 10_000, 10)) == []
    kept = [item for item in flat(store.log_between("pump")) if isinstance(item, tuple)]
    assert kept == flat([some_rows(4000, 6000)])
    curves = store.curves("pump")
    assert curves is not None
    assert (curves.time[0], curves.time[-1]) == (4000.0, 9999.0)
    assert len(list(store.records())) == 200
    assert len(list(store.deeds())) == 10
    with pytest.raises(StoreError, match="rows of 'pump' from 1 on are forgotten"):
        list(store.log_after("pump", 0, 0))
    grown(store, 10_000, 10_100)
    assert store.enrol(enrolment()).rows == 10_100
    assert len([item for item in flat(store.log_after("pump", 4000, 0)) if isinstance(item, tuple)]) == 6100


def test_diagnoses_go_with_their_rows(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """But the last of each alarm, and none of rows that are kept; numbers of those that stay are as before."""
    monkeypatch.setattr(retention, "DIAGNOSES", 3)
    kinds = {100: "detection", 1900: "accepted", 2000: "detection"}
    for first in range(0, 6000, 50):
        record = told("pump", first, kinds.get(first, "diagnosis"))
        store.commit([Commit(asset="pump", rows=some_rows(first, 50), arrived=float(first), records=(record,))])
    store.commit([Commit(asset="pump", checkpoint=b"state")])
    store.enrol(enrolment("fan"))
    store.commit([Commit(asset="fan", records=tuple(told("fan", k, "diagnosis") for k in (1, 2)))])
    names = {number: item.id for number, item in store.records_behind(0, 1000)}
    monkeypatch.setattr(retention, "AT_A_CALL", 10)
    calls = [*iter(lambda: store.retain(older_than=4500.0), Forgotten())]
    assert [call.diagnoses for call in calls] == [30, 30, 15]
    assert sum(call.rows for call in calls) == 4000
    kept = [(item.sample, item.kind) for item in store.records("pump")]
    assert kept[:5] == [
        (50, "diagnosis"),
        (100, "detection"),
        (1850, "diagnosis"),
        (1900, "accepted"),
        (1950, "diagnosis"),
    ]
    assert kept[5:] == [(2000, "detection"), *((first, "diagnosis") for first in range(4000, 6000, 50))]
    assert [item.sample for item in store.records("fan")] == [2]
    assert all(names[number] == item.id for number, item in store.records_behind(0, 1000))
    assert store.retain(older_than=4500.0) == Forgotten()


def test_what_checkpoints_need_stays(store: RelationalStore) -> None:
    """Without a checkpoint all rows stay, whatever is asked for; with some, those behind the oldest that is kept."""
    store.commit([Commit(asset="pump", rows=some_rows(0, 5000), curves=some_curves(0, 5000))])
    assert store.retain(older_than=np.inf, at_most=0) == Forgotten(points=5000)
    assert store.curves("pump") is None, "nothing needs curves"
    grown(store, 5000, 7000)
    assert store.retain(older_than=np.inf).rows == 7000
    for first in (7000, 8000, 9000):
        grown(store, first, first + 1000)
    assert store.retain(older_than=np.inf).rows == 1000
    assert [item for item in flat(store.log_after("pump", 8000, 8)) if isinstance(item, tuple)] == flat(
        [some_rows(8000, 2000)]
    )
    with pytest.raises(StoreError, match="from 8000 on are forgotten"):
        list(store.log_after("pump", 7999, 8))


def test_forgetting_by_size(store: RelationalStore) -> None:
    """The oldest go until the store is that small, and no more than that."""
    grown(store, 0, 20_000, each=500)
    before = store._database.used()
    gone = store.retain(at_most=before // 2).rows
    assert before * 0.4 < store._database.used() <= before // 2
    assert 20_000 * 0.4 < gone < 20_000 * 0.8
    kept = [item for item in flat(store.log_between("pump")) if isinstance(item, tuple)]
    assert kept == flat([some_rows(gone, 20_000 - gone)])


def test_the_file_becomes_smaller(tmp_path: Path) -> None:
    """By size the oldest go until the file is that small, and the place on the disk is given back."""
    path = tmp_path / "plant.db"
    store = begun(path)
    grown(store, 0, 60_000, each=500)
    store._database.shrink()
    before = path.stat().st_size
    limit = before // 3
    gone = store.retain(at_most=limit).rows
    slack = limit // 16 + 260 * 4096
    assert limit // 2 < path.stat().st_size < limit + slack
    assert 60_000 * 0.4 < gone < 60_000 * 0.9
    kept = [item for item in flat(store.log_between("pump")) if isinstance(item, tuple)]
    assert kept == flat([some_rows(gone, 60_000 - gone)])
    assert len(list(store.records())) == 120


def test_the_file_stops_growing(tmp_path: Path) -> None:
    """A store that forgets while it is written stays as large as it may be, with its file of transactions."""
    path, sizes = tmp_path / "plant.db", []
    store = begun(path)
    for first in range(0, 40_000, 2000):
        grown(store, first, first + 2000, each=100)
        store.retain(at_most=400_000)
        wal = path.with_name(f"{path.name}-wal")
        sizes.append(path.stat().st_size + (wal.stat().st_size if wal.exists() else 0))
    assert max(sizes) < 400_000 + 300 * 4096


def test_at_its_bound_a_store_forgets_seldom(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """What goes leaves room for what comes, so that a store that is as large as it may be need not forget each time."""
    monkeypatch.setattr(tail, "LARGE", 50)
    grown(store, 0, 20_000, each=500)
    limit = store._database.used()
    went = []
    for first in range(20_000, 22_000, 50):
        grown(store, first, first + 50)
        went.append(store.retain(at_most=limit).is_any)
        assert store._database.used() <= limit
    assert 1 <= sum(went) <= 10


def test_what_goes_of_curves_alone_is_told(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where only curves may go, a call that lets some go says so: who asks until none goes frees all of them."""
    store.commit([Commit(asset="pump", rows=some_rows(0, 5000), curves=some_curves(0, 5000))])
    monkeypatch.setattr(retention, "AT_ONCE", 1)
    monkeypatch.setattr(retention, "AT_A_CALL", 2)
    calls = [*iter(lambda: store.retain(older_than=np.inf), Forgotten())]
    assert [(call.rows, call.points) for call in calls] == [(0, 2000), (0, 2000), (0, 1000)]
    assert store.curves("pump") is None


def test_rows_after_a_hole_are_merged_apart(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where small chunks between others went, since the clock of arrivals was set back, those around it stay apart."""
    monkeypatch.setattr(tail, "LARGE", 10)
    for k, arrived in enumerate([9.0, 1.0, 9.0]):
        store.commit([Commit(asset="pump", rows=some_rows(3 * k, 3), arrived=arrived, checkpoint=b"x")])
    for _ in range(3):
        store.commit([Commit(asset="pump", checkpoint=b"x")])
    assert store.retain(older_than=5.0).rows == 3
    for k in range(3, 9):
        store.commit([Commit(asset="pump", rows=some_rows(3 * k, 3), arrived=9.0)])
    assert flat(store.log_between("pump")) == flat([some_rows(0, 3), some_rows(6, 21)])
    assert flat(store.log_after("pump", 9, 0)) == flat([some_rows(9, 18)])
    assert store._database.rows("SELECT first, count FROM chunks WHERE dense=1 ORDER BY first") == [(0, 3), (6, 12)]


def test_small_chunks_become_large_ones(store: RelationalStore) -> None:
    """After a day of rows, one a commit, few chunks are left, and each row takes fewer bytes than its numbers."""
    for first in range(0, 3050):
        rows = some_rows(first, 1, n_inputs=1, n_outputs=2)
        store.commit([Commit(asset="pump", rows=rows, curves=some_curves(first, 1))])
    found = store._database.rows(
        "SELECT kind, dense, count(*), sum(count) FROM chunks GROUP BY kind, dense ORDER BY 1, 2"
    )
    assert found == [(0, 0, 31, 992), (0, 1, 2, 2048), (1, 0, 31, 992), (1, 1, 2, 2048)]
    assert store._database.number("SELECT count(*) FROM pieces") == 2 * 10
    size = store._database.number("SELECT sum(length(content)) FROM chunks WHERE kind=0 AND dense=1")
    assert size < 2048 * 8 * 4
    assert flat(store.log_after("pump", 0, 0)) == flat([some_rows(0, 3050)])


def test_no_commit_merges_all_assets(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """Chunks of assets that come in step are merged a few assets at a time, and all in the end."""
    monkeypatch.setattr(tail, "LARGE", 100)
    names = [f"a{k}" for k in range(24)]
    for name in names:
        store.enrol(enrolment(name))
    most = before = 0
    for first in range(0, 150):
        store.commit([Commit(asset=name, rows=some_rows(first, 1)) for name in names])
        merged = store._database.number("SELECT count(*) FROM chunks WHERE dense=1")
        most = max(most, merged - before)
        before = merged
    assert before == len(names)
    assert most <= 8


def test_much_goes_in_portions(store: RelationalStore, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where much has to go a call lets some of it go, so that others need not wait; calls until 0 let all of it go."""
    grown(store, 0, 10_000, each=1000)
    monkeypatch.setattr(retention, "AT_ONCE", 2)
    monkeypatch.setattr(retention, "AT_A_CALL", 2)
    calls = [*iter(lambda: store.retain(older_than=8500.0), Forgotten())]
    assert len(calls) > 2
    assert sum(call.rows for call in calls) == 9000
    assert len([item for item in flat(store.log_between("pump")) if isinstance(item, tuple)]) == 1000
