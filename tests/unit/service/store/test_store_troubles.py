"""What a store says when it cannot be written or read: one line with what to do, and nothing acknowledged is lost."""

import os
import sqlite3
import subprocess
import sys
from collections.abc import Iterator
from contextlib import closing
from dataclasses import replace
from multiprocessing import get_context
from multiprocessing.connection import Connection
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.disk import mounted

from faultbond.errors import StoreError
from faultbond.service.contract.messages import AuditEntry
from faultbond.service.contract.store import Commit, LogStore
from faultbond.service.store.database import FORMAT
from faultbond.service.store.opening import open_store
from faultbond.service.store.relational import RelationalStore
from faultbond.service.store.sqlite import SqliteDatabase
from stored import deed, enrolment, flat, some_curves, some_rows, told

IS_ROOT = hasattr(os, "geteuid") and os.geteuid() == 0


def filled(place: str | Path, n: int = 3000, *, each: int = 100, checkpoint: bytes = b"state") -> RelationalStore:
    """A store with rows of one asset, and a checkpoint at its end."""
    store = open_store(place, reserve=0)
    store.enrol(enrolment())
    for first in range(0, n, each):
        store.commit([batch(first, each)])
    store.commit([Commit(asset="pump", checkpoint=checkpoint)])
    return store


def batch(first: int, n: int, asset: str = "pump") -> Commit:
    """Rows of an asset and what came of them."""
    return Commit(
        asset=asset,
        rows=some_rows(first, n),
        arrived=float(first),
        cursor=str(first + n),
        curves=some_curves(first, n),
        records=(told(asset, first),),
    )


def damage(path: Path, place: int, n: int = 64) -> None:
    """Write nonsense into a file."""
    with path.open("r+b") as stream:
        stream.seek(place)
        stream.write(bytes(range(1, n + 1)))


def one_line(error: pytest.ExceptionInfo[StoreError], place: str | Path) -> str:
    """What an error says, which names the store and is one line."""
    text = str(error.value)
    assert text.startswith(f"{place}: ")
    assert "\n" not in text
    return text


@pytest.fixture
def small_disk(tmp_path: Path) -> Iterator[Path]:
    """A disk of 24 MB."""
    with mounted(tmp_path / "disk", "24m") as place:
        if place is None:
            pytest.skip("a disk in memory cannot be mounted here")
        yield place


def test_a_full_disk(small_disk: Path) -> None:
    """A full disk takes the reserve, then refuses; what was acknowledged is there; after forgetting it goes on."""
    path = small_disk / "plant.db"
    lack = f"{path}: the disk is almost full, with no room for the 8 MB kept in reserve. Free some of it."
    store = open_store(path, reserve=2**23)
    assert store.reserve() == ""
    store.enrol(enrolment())
    done = 0

    def write() -> None:
        nonlocal done
        while True:
            store.commit([batch(done * 1000, 1000), Commit(asset="pump", checkpoint=b"x" * 5000)])
            done += 1

    with pytest.raises(StoreError, match=r"the disk is full\. Free some of it; what was acknowledged is kept") as error:
        write()
    one_line(error, path)
    assert store.reserve() == lack
    assert list(store.records()) == [told("pump", 1000 * k) for k in range(done)]
    assert store.retain(at_most=3_000_000).rows > 0
    assert path.stat().st_size < 6_000_000
    assert store.reserve() == ""
    first = done
    with pytest.raises(StoreError, match="the disk is full"):
        write()
    assert done > first + 50
    store.close()
    again = open_store(path, reserve=0)
    assert again.enrol(enrolment()).rows == done * 1000
    assert len(list(again.records())) == done
    again.close()


def test_the_reserve_comes_back(small_disk: Path) -> None:
    """Once there is room again, it is kept in reserve again."""
    path = small_disk / "plant.db"
    ballast = small_disk / "ballast"
    ballast.write_bytes(b"x" * 2**23)
    store = open_store(path, reserve=2**23)
    assert store.reserve().startswith(f"{path}: the disk is almost full, with no room for the 8 MB kept in reserve")
    ballast.unlink()
    assert store.reserve() == ""
    assert os.stat(f"{path}.reserve").st_blocks * 512 >= 2**23, "a file with holes keeps no room"
    store.close()


def test_a_file_that_may_not_grow(tmp_path: Path) -> None:
    """Where SQLite itself says that the disk is full, nothing of the commit is there, and the next ones go on."""
    store = filled(tmp_path / "plant.db", 300)
    pages = store._database.number("PRAGMA page_count")
    store._database.rows(f"PRAGMA max_page_count={pages + 2}")
    with pytest.raises(StoreError, match="the disk is full"):
        store.commit([batch(300, 900), Commit(asset="pump", checkpoint=b"x" * 100_000)])
    store._database.rows("PRAGMA max_page_count=100000")
    assert len(list(store.records())) == 3
    store.commit([batch(300, 100)])
    assert flat(store.log_after("pump", 0, 0)) == flat([some_rows(0, 400)])
    store.close()


@pytest.mark.parametrize("suffix", ["", "-wal"])
def test_a_file_that_somebody_removes(tmp_path: Path, suffix: str) -> None:
    """Nothing is acknowledged that would be in no file; what is put back goes on."""
    path = tmp_path / "plant.db"
    store = filled(path, 300)
    gone = tmp_path / f"plant.db{suffix}"
    gone.rename(tmp_path / "elsewhere")
    for _ in range(2):
        with pytest.raises(StoreError, match="was removed, moved or replaced") as error:
            store.commit([batch(300, 10)])
        one_line(error, path)
    (tmp_path / "elsewhere").rename(gone)
    store.commit([batch(300, 100)])
    store.close()
    again = open_store(path)
    assert flat(again.log_after("pump", 0, 0)) == flat([some_rows(0, 400)])
    again.close()


@pytest.mark.skipif(IS_ROOT, reason="nothing is forbidden to this user")
def test_a_folder_that_may_not_be_written(tmp_path: Path) -> None:
    """Where the folder cannot be written, there is no store for a service; what is there can be read."""
    path = tmp_path / "plant.db"
    filled(path, 300).close()
    tmp_path.chmod(0o500)
    with pytest.raises(StoreError, match="cannot be written"):
        open_store(path)
    reader = open_store(path, writes=False)
    assert len(list(reader.records())) == 3
    reader.close()


def test_a_disk_that_may_only_be_read(tmp_path: Path) -> None:
    """On a disk that may only be read, a service is refused and a reader finds all."""
    place = tmp_path / "disk"
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", "size=3m", "none", str(place)]
    if not IS_ROOT or subprocess.run(command, check=False, capture_output=True).returncode:
        pytest.skip("a disk in memory cannot be mounted here")
    try:
        path = place / "plant.db"
        filled(path, 300).close()
        subprocess.run(["mount", "-o", "remount,ro", str(place)], check=True)
        with pytest.raises(StoreError, match="cannot be written") as error:
            open_store(path)
        one_line(error, path)
        reader = open_store(path, writes=False)
        assert len(list(reader.records())) == 3
        assert flat(reader.log_after("pump", 0, 0)) == flat([some_rows(0, 300)])
        with pytest.raises(StoreError, match="cannot be written"):
            reader.commit([batch(300, 1)])
        reader.close()
    finally:
        subprocess.run(["umount", str(place)], check=True)


def test_one_service_a_store(place: str) -> None:
    """A second service is refused while the first has the store, in this process or another, and not after it."""
    first = filled(place, 100)
    with pytest.raises(StoreError, match=r"another service writes it\. Stop that one") as error:
        open_store(place)
    one_line(error, place)
    code = "import sys; from faultbond.service.store.opening import open_store as S; S(sys.argv[1])"
    done = subprocess.run([sys.executable, "-c", code, place], capture_output=True, text=True, check=False)
    assert "another service writes it" in done.stderr
    first.close()
    open_store(place).close()


def test_a_file_that_another_program_has_locked(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another program keeps locked is refused after a while, and goes on once it lets go."""
    monkeypatch.setattr("faultbond.service.store.sqlite.WAIT", 0.05)
    path = tmp_path / "plant.db"
    store = filled(path, 100)
    other = sqlite3.connect(path, isolation_level=None)
    other.execute("BEGIN IMMEDIATE")
    with pytest.raises(StoreError, match="another program has locked it") as error:
        store.commit([batch(100, 100)])
    one_line(error, path)
    other.execute("ROLLBACK")
    other.close()
    store.commit([batch(100, 100)])
    assert len(list(store.records())) == 2
    store.close()


@pytest.mark.parametrize("content", [b"not a database, but long enough to be taken for one" * 30, b"short"])
def test_no_database(tmp_path: Path, content: bytes) -> None:
    """A file that is something else is refused, and stays as it is."""
    path = tmp_path / "notes.txt"
    path.write_bytes(content)
    for writes in (True, False):
        with pytest.raises(StoreError, match="no store of faultbond") as error:
            open_store(path, writes=writes)
        one_line(error, path)
    assert path.read_bytes() == content


def test_another_database(tmp_path: Path) -> None:
    """A database of another program is refused, and stays as it is."""
    path = tmp_path / "other.db"
    other = sqlite3.connect(path)
    other.execute("CREATE TABLE t (x)")
    other.commit()
    other.close()
    before = path.read_bytes()
    with pytest.raises(StoreError, match="this is a database, but no store of faultbond") as error:
        open_store(path)
    one_line(error, path)
    assert path.read_bytes() == before


def test_a_newer_format(place: str) -> None:
    """A store of a later faultbond is refused with both formats."""
    store = filled(place, 100)
    if isinstance(store._database, SqliteDatabase):
        store._database.rows(f"PRAGMA user_version={FORMAT + 1}")
    else:
        with store._database.transaction():
            store._database.change("UPDATE faultbond SET format=format+1")
    store.close()
    for writes in (True, False):
        with pytest.raises(StoreError, match=f"of format {FORMAT + 1}, and this faultbond knows format {FORMAT}"):
            open_store(place, writes=writes)


def test_there_is_no_store(place: str, tmp_path: Path) -> None:
    """Who only reads makes no file."""
    for _ in range(2):
        with pytest.raises(StoreError, match="there is no such store"):
            open_store(place, writes=False)
    assert list(tmp_path.iterdir()) == []


def test_damaged_pages(tmp_path: Path) -> None:
    """Nonsense in the pages of the tables is told in one line, whatever is read."""
    path = tmp_path / "plant.db"
    filled(path, 5000).close()
    size = path.stat().st_size
    for place in range(4096, size, 4096):
        damage(path, place)

    def read() -> None:
        store = open_store(path, reserve=0)
        store.enrol(enrolment())
        list(store.log_after("pump", 0, 0))

    with pytest.raises(StoreError, match="it is damaged") as error:
        read()
    one_line(error, path)


def replace_bytes(store: RelationalStore, table: str, column: str, value: bytes | str, where: str = "1=1") -> None:
    """Change what is in a table behind the store's back."""
    with store._database.transaction():
        store._database.change(f"UPDATE {table} SET {column}=? WHERE {where}", value)  # noqa: S608 - ours


def test_a_damaged_chunk_is_named(place: str) -> None:
    """Rows that are not what was written are refused by their numbers and asset; the others can be read."""
    store = filled(place, 3000)
    content = store._database.number("SELECT content FROM chunks WHERE kind=0 AND first=1000")
    other = content[:-9] + bytes([content[-9] ^ 4]) + content[-8:]
    replace_bytes(store, "chunks", "content", other, "kind=0 AND first=1000")
    reason = r"rows 1001 to 2000 of 'pump': damaged on the disk \(the checksum differs"
    with pytest.raises(StoreError, match=reason) as error:
        flat(store.log_after("pump", 0, 0))
    one_line(error, place)
    assert flat(store.log_after("pump", 2000, 0)) == flat([some_rows(2000, 1000)])
    store.close()


def test_a_damaged_entry_of_the_audit_is_named(place: str) -> None:
    """An entry of the audit that is not what was written is refused by its number; old stores have none."""
    store = filled(place, 300)
    with closing(open_store(place, writes=False)) as reader:
        assert list(reader.audit()) == []
    store.note(AuditEntry(at=1.0, who="emma", what="upload"))
    replace_bytes(store, "audit", "content", '{"at": 1.0, "who": "otto", "what": "upload", "about": {}}', "number=1")
    with pytest.raises(StoreError, match="entry 1 of the audit is damaged on the disk"):
        list(store.audit())
    store.close()


@pytest.mark.parametrize(("table", "what"), [("records", "record 'pump/a/100/detection'"), ("deeds", "entry 1")])
def test_a_damaged_record_is_named(place: str, table: str, what: str) -> None:
    """A record or an entry of the journal that is not what was written is refused by its name."""
    store = filled(place, 300)
    store.commit([Commit(asset="pump", deeds=(deed("pump", 300),))])
    replace_bytes(store, table, "content", '{"record": "other"}', "number=1" if table == "deeds" else "sample=100")
    with pytest.raises(StoreError, match=f"{what}.* is damaged on the disk"):
        list(store.journal())
    store.close()


def test_a_damaged_checkpoint(place: str) -> None:
    """The state before a damaged one serves, its rows are still there, and it is told; so is the one before that."""
    heard = list[str]()
    store = filled(place, 2000, checkpoint=b"first")
    for k, name in enumerate((b"second", b"third", b"fourth")):
        store.commit([batch(2000 + 1000 * k, 1000), Commit(asset="pump", checkpoint=name)])
    assert store._database.number("SELECT count(*) FROM checkpoints") == 3
    store.retain(older_than=np.inf)
    for rows, left in ((5000, b"third"), (4000, b"second")):
        replace_bytes(store, "checkpoints", "content", b"nonsense", f"rows={rows}")
        store.close()
        store = open_store(place, tell=heard.append, reserve=0)
        stand = store.enrol(enrolment())
        assert stand.checkpoint == left
        expected = flat([some_rows(stand.checkpoint_rows, 5000 - stand.checkpoint_rows)])
        assert flat(store.log_after("pump", stand.checkpoint_rows, stand.checkpoint_deeds)) == expected
    assert len(heard) == 3
    assert f"{place}: the state of 'pump' behind row 5000 is damaged on the disk" in heard[0]
    replace_bytes(store, "checkpoints", "content", b"nonsense")
    assert store.enrol(enrolment()).checkpoint is None
    with pytest.raises(StoreError, match="rows of 'pump' from 1 on are forgotten"):
        list(store.log_after("pump", 0, 0))
    store.close()


def test_a_record_that_comes_again_otherwise(place: str) -> None:
    """The first is kept, the other beside it, the commit stands, and it is told each time."""
    heard: list[str] = []
    store = open_store(place, tell=heard.append, reserve=0)
    store.enrol(enrolment())
    store.commit([Commit(asset="pump", records=(told("pump", 3, value=1.0),))])
    for _ in range(2):
        store.commit(
            [Commit(asset="pump", records=(told("pump", 3, value=1.0), told("pump", 3, value=2.0)), cursor="x")]
        )
    assert list(store.records()) == [told("pump", 3, value=1.0)]
    assert store.contested() == [("pump/a/3/detection", {"record": "detection", "value": 2.0})]
    assert len(heard) == 2
    assert "record 'pump/a/3/detection' of 'pump' came again with another content" in heard[0]
    assert store.enrol(enrolment()).cursor == "x"
    store.close()


@pytest.mark.parametrize(
    ("part", "reason"),
    [
        (Commit(asset="nobody", cursor="x"), "there is no asset 'nobody'"),
        (Commit(asset="pump", rows=some_rows(0, 3, n_inputs=2)), "rows with 2 inputs and 2 sensors"),
        (Commit(asset="pump", curves=some_curves(0, 3, n_outputs=1)), "curves with 1 inputs and 1 sensors"),
        (Commit(asset="pump", deeds=(deed("pump", 7),)), "it is behind 7 rows, not 110"),
    ],
)
def test_a_part_that_does_not_fit(place: str, part: Commit, reason: str) -> None:
    """One part that is wrong refuses the commit, and no other part of it is written, nor counted."""
    store, done = filled(place, 100), Commit(asset="pump", deeds=(deed("pump", 110),))
    with pytest.raises(StoreError, match=reason):
        store.commit([batch(100, 10), done, part])
    assert store.enrol(enrolment()).rows == 100
    assert len(list(store.records())) == 1
    store.commit([batch(100, 10), done])
    assert flat(store.log_after("pump", 0, 0)) == flat([some_rows(0, 110), replace(done.deeds[0], number=1)])
    store.close()


def watch(place: str, pipe: Connection) -> None:
    """Read a store again and again until told to stop; what is read must be whole each time."""
    reader: LogStore = open_store(place, writes=False)
    reads, rows = 0, 0
    try:
        while not pipe.poll():
            records = [item.sample for item in reader.records("pump")]
            assert records == list(range(0, 50 * len(records), 50))
            found = flat(reader.log_after("pump", 0, 0))
            assert [item[-1] for item in found if isinstance(item, tuple)] == [1000 * k + 1 for k in range(len(found))]
            assert len(found) >= rows
            rows = len(found)
            curves = reader.curves("pump", most=100)
            assert curves is None or len(curves) <= 100
            reads += 1
            if reads == 3:
                pipe.send(rows)
    except BaseException as error:
        pipe.send(repr(error))
        raise
    finally:
        reader.close()


def test_readers_while_one_writes(place: str) -> None:
    """Several other processes read a store that grows and whose chunks are merged, and find it whole."""
    store = open_store(place, reserve=0)
    store.enrol(enrolment())
    store.commit([batch(0, 50)])
    processes, pipes, context = [], [], get_context("spawn")
    for _ in range(3):
        here, there = context.Pipe()
        processes.append(context.Process(target=watch, args=(place, there)))
        processes[-1].start()
        pipes.append(here)
    first = 50
    while not all(pipe.poll(0.001) for pipe in pipes) and first < 100_000:
        store.commit([batch(first, 50)])
        first += 50
    for process, pipe in zip(processes, pipes, strict=True):
        rows = pipe.recv()
        assert isinstance(rows, int), rows
        assert 0 < rows <= first
        pipe.send("stop")
        process.join(60)
        assert process.exitcode == 0
    store.close()
