"""A store in a server: what its user is told, and that a server or a connection that is lost loses nothing."""

import threading
import time
from collections.abc import Iterator
from dataclasses import replace

import pytest
from benchmarks.shared.broker import free_port

from faultbond.errors import StoreError
from faultbond.service.contract.messages import AuditEntry
from faultbond.service.contract.store import Commit
from faultbond.service.store.opening import open_store
from postgres import DeafLine, PostgresServer
from stored import deed, enrolment, flat, some_curves, some_rows, told

RESTARTS = 2


def portion(first: int, n: int) -> Commit:
    """Rows, a record and a deed."""
    return Commit(
        asset="pump",
        rows=some_rows(first, n),
        arrived=float(first),
        cursor=str(first + n),
        curves=some_curves(first, n),
        records=(told("pump", first),),
        deeds=(deed("pump", first + n),),
    )


def is_whole(place: str, n: int, each: int) -> None:
    """A store has so many rows, and the records and deeds of their portions, each once."""
    store = open_store(place)
    stand = store.enrol(enrolment())
    assert (stand.rows, stand.cursor) == (n, str(n))
    log = flat(store.log_after("pump", 0, 0))
    assert [item for item in log if isinstance(item, tuple)] == flat([some_rows(0, n)])
    assert list(store.records()) == [told("pump", first) for first in range(0, n, each)]
    deeds = [deed("pump", first + each) for first in range(0, n, each)]
    assert list(store.deeds()) == [replace(item, number=k + 1) for k, item in enumerate(deeds)]
    curves = store.curves("pump")
    assert curves is not None
    assert len(curves) == n
    assert store.contested() == []
    store.close()


@pytest.fixture
def line(postgres: PostgresServer) -> Iterator[DeafLine]:
    """A way to the server that loses answers."""
    found = DeafLine(postgres)
    yield found
    found.close()


def test_a_server_that_is_killed(postgres: PostgresServer) -> None:
    """Killed and started again while rows are written, it has all, once, and it is told meanwhile."""
    place = postgres.url()
    store = open_store(place)
    store.enrol(enrolment())
    over = threading.Event()

    def restart() -> None:
        for _ in range(RESTARTS):
            time.sleep(0.3)
            postgres.restart()
        over.set()

    killer = threading.Thread(target=restart)
    killer.start()
    done, complained = 0, set[str]()
    while not over.is_set() or done % 50:
        parts = [portion(10 * done, 10)]
        while True:
            try:
                store.commit(parts)
                break
            except StoreError as error:
                complained.add(str(error))
                time.sleep(0.05)
        done += 1
    killer.join()
    store.close()
    is_whole(place, 10 * done, 10)
    assert complained
    assert all(line.startswith(f"{place}: the ") and "\n" not in line for line in complained)
    assert {line.split(": the ", 1)[1].split()[0] for line in complained} <= {"server", "connection"}


def test_a_commit_whose_end_was_not_heard(postgres: PostgresServer, line: DeafLine) -> None:
    """It is refused, since nobody knows; the same parts once more are written once, and others behind them."""
    place = line.url("deaf")
    store = open_store(place)
    store.enrol(enrolment())
    for first in range(0, 100, 10):
        line.deaf = first % 20 == 0
        parts = [portion(first, 10)]
        if line.deaf:
            with pytest.raises(StoreError, match=r"the connection to the server is lost \(.*What was acknowledged is"):
                store.commit(parts)
            assert not line.deaf
            store.retain(older_than=0.0)  # others write meanwhile
        store.commit(parts)
    assert store.enrol(enrolment()).rows == 100
    store.close()
    is_whole(postgres.url("deaf"), 100, 10)


def test_a_note_whose_end_was_not_heard(postgres: PostgresServer, line: DeafLine) -> None:
    """It is refused, since nobody knows; the same one once more is written once, and one of the same words, too."""
    store = open_store(line.url("noted"))
    for _ in range(2):
        entry = AuditEntry(at=1.0, who="emma", what="upload", about={"size": 7})
        line.deaf = True
        with pytest.raises(StoreError, match="the connection to the server is lost"):
            store.note(entry)
        store.note(entry)
    assert [(item.number, item.who) for item in store.audit()] == [(1, "emma"), (2, "emma")]
    store.close()


def test_a_commit_that_did_not_arrive(
    postgres: PostgresServer, line: DeafLine, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Where the connection is lost before it, it is opened again and nobody notices; within it all is written later."""
    place = line.url("lost")
    store = open_store(place)
    store.enrol(enrolment())
    line.cut()
    store.commit([portion(0, 10)])
    line.cut()
    assert [item.sample for item in store.records()] == [0]
    parts = [portion(10, 10)]
    write = store._database.change

    def written(statement: str, *values: object) -> None:
        write(statement, *values)
        line.cut()

    monkeypatch.setattr(store._database, "change", written)
    with pytest.raises(StoreError, match="the connection to the server is lost"):
        store.commit(parts)
    monkeypatch.undo()
    store.commit(parts)
    store.close()
    is_whole(postgres.url("lost"), 20, 10)


@pytest.mark.parametrize("writes", [True, False])
def test_another_service_that_had_it_meanwhile(line: DeafLine, postgres: PostgresServer, *, writes: bool) -> None:
    """Who lost the store to another one does not write behind what it does not know of, but says so."""
    name = f"taken_{writes}".lower()
    first = open_store(line.url(name))
    first.enrol(enrolment())
    first.commit([portion(0, 10)])
    with pytest.raises(StoreError, match="another service writes it"):
        open_store(postgres.url(name))
    line.cut()
    second = open_store(postgres.url(name))
    second.enrol(enrolment())
    if writes:
        second.commit([portion(10, 10)])
    with pytest.raises(StoreError, match="another service writes it"):
        first.commit([portion(10, 10)])
    second.close()
    for _ in range(2):
        with pytest.raises(StoreError, match="another service has had it since this one lost it"):
            first.commit([portion(10, 10)])
    first.close()
    is_whole(postgres.url(name), 20 if writes else 10, 10)


def test_what_its_user_may_do(postgres: PostgresServer) -> None:
    """Missing rights are named; who may only read can read."""
    place = postgres.url("guarded_hall")
    store = open_store(place)
    store.enrol(enrolment())
    store.commit([portion(0, 10)])
    store.close()
    poor = postgres.url("guarded_hall", user="poor")
    with postgres.session() as other:
        other.execute("CREATE ROLE poor LOGIN")
    for address, lacking in ((postgres.url(user="poor"), "database postgres"), (poor, "schema guarded_hall")):
        with pytest.raises(StoreError, match=rf"may not do that \(permission denied for {lacking}\)\. Grant the right"):
            open_store(address)
    with postgres.session() as other:
        other.execute("GRANT USAGE ON SCHEMA guarded_hall TO poor")
        other.execute("GRANT SELECT ON ALL TABLES IN SCHEMA guarded_hall TO poor")
    reader = open_store(poor, writes=False)
    assert len(flat(reader.log_after("pump", 0, 0))) == 11
    with pytest.raises(StoreError, match="cannot be written"):
        reader.commit([portion(10, 10)])
    reader.close()
    with pytest.raises(StoreError, match="may not do that"):
        open_store(poor)


def test_a_server_that_does_not_let_in(postgres: PostgresServer) -> None:
    """One line says why, with the address and without the password."""
    with postgres.session() as other:
        other.execute("CREATE ROLE guarded LOGIN PASSWORD 'open sesame'")
        other.execute("CREATE SCHEMA other")
        other.execute("CREATE TABLE other.notes (x INTEGER)")
    wrong = postgres.url("x", user="guarded:sesame")
    for address, reason in (
        (postgres.url("x", database="nowhere"), 'database "nowhere" does not exist. Make it'),
        (postgres.url("x", user="nobody"), 'role "nobody" does not exist'),
        (wrong, 'password authentication failed for user "guarded". Give it in ~/.pgpass'),
        (postgres.url("x", user="guarded"), "no password supplied"),
        (f"postgresql://ann:sesame@127.0.0.1:{free_port()}/x", "the server cannot be reached: Conn"),
        ("postgresql://ann:sesame@127.0.0.1/x?port=door", "invalid"),
        ("postgresql://ann:sesame@127.0.0.1/x?colour=sesame", "this is no address of PostgreSQL"),
        (postgres.url("other"), "this is a database, but no store of faultbond"),
    ):
        with pytest.raises(StoreError) as error:
            open_store(address)
        said = str(error.value)
        assert reason in said
        assert said.startswith(address.replace(":sesame@", "@").partition("?")[0])
        assert "sesame" not in said
        assert "\n" not in said
    with postgres.session() as other:
        other.execute("DROP ROLE guarded")


def test_a_table_that_another_program_has_locked(postgres: PostgresServer, monkeypatch: pytest.MonkeyPatch) -> None:
    """What another program keeps locked is refused after a while, and goes on once it lets go."""
    monkeypatch.setattr("faultbond.service.store.postgresql.WAIT", 50)
    store = open_store(postgres.url("held"))
    store.enrol(enrolment())
    parts = [portion(0, 10)]
    with postgres.session() as other, other.transaction():
        other.execute("LOCK TABLE held.pieces IN ACCESS EXCLUSIVE MODE")
        with pytest.raises(StoreError, match="another program has locked it"):
            store.commit(parts)
    store.commit(parts)
    store.close()
    is_whole(postgres.url("held"), 10, 10)


def test_a_server_that_does_not_sync(postgres: PostgresServer) -> None:
    """Who keeps a store where a loss of power may lose it is told; what a session may choose is chosen safe."""
    heard: list[str] = []
    with postgres.session() as other:
        other.execute("ALTER SYSTEM SET fsync=off")
        other.execute("ALTER SYSTEM SET synchronous_commit=off")
        other.execute("SELECT pg_reload_conf()")
        while other.execute("SHOW fsync").fetchone() != ("off",):
            time.sleep(0.01)
        store = open_store(postgres.url(), tell=heard.append)
        assert store._database.number("SHOW synchronous_commit") == "on"
        other.execute("ALTER SYSTEM RESET ALL")
        other.execute("SELECT pg_reload_conf()")
    assert len(heard) == 1
    assert "does not sync its disk (fsync=off)" in heard[0]
    store.close()
