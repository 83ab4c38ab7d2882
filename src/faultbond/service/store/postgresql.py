"""The store in a schema of a PostgreSQL server, for sites that have one and its backups.

A commit is on the server's disk when it returns (synchronous_commit), and one service has the schema, by an advisory
lock of its session. Where the connection is lost, the next call opens it again. If that was while a commit was on its
way, nobody heard whether it was written: so each has a name, its turn, which is written with it. The turn also tells
whether another service had the store meanwhile, since it begins with one of its own.
Source: PostgreSQL 15, sections 13.3.5 (advisory locks), 20.5.1 (synchronous_commit) and 34.1.2 (connection settings).
"""

import logging
import re
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from typing import Any
from uuid import uuid4

import psycopg
from psycopg.conninfo import conninfo_to_dict

from faultbond.errors import AbsentStoreError, StoreError, UnreadyStoreError
from faultbond.service.store.address import FORM, ServerAddress
from faultbond.service.store.database import FORMAT, TABLES

APPLICATION = 0x46424E44  # "FBND", by which its locks are known
WAIT = 10_000  # ms for another program that holds a table
LOCK_WAIT = 1_000  # ms for the server to note that a service which held the schema has gone
OURS = {  # of the connection, unless the address says otherwise: a server that is gone is noted within some seconds
    "application_name": "faultbond",
    "connect_timeout": "3",
    "keepalives_idle": "5",
    "keepalives_interval": "2",
    "keepalives_count": "3",
    "tcp_user_timeout": "10000",
}
SESSION = {  # so does the server with a service that is gone, which else would keep its lock
    "tcp_keepalives_idle": "5",
    "tcp_keepalives_interval": "2",
    "tcp_keepalives_count": "3",
}
PASSING = ("53100", "55P03")  # a disk that is full, a lock: others may mend it while it is waited for
STATE = "CREATE TABLE faultbond (format BIGINT NOT NULL, turn TEXT NOT NULL)"
INCOMPRESSIBLE = ("pieces content", "chunks content", "chunks overview", "checkpoints content")
USED = " + ".join(
    f"(SELECT coalesce(sum(length(content)), 0) FROM {table})"  # noqa: S608 - ours
    for table in ("pieces", "chunks", "records", "deeds", "checkpoints")
)

logging.getLogger("psycopg").addHandler(logging.NullHandler())  # what it warns of is raised, too


class PostgresqlDatabase:
    """A store in a server; see `database.Database`.

    Parameters
    ----------
    address : of it; its schema is made where there is none
    tell : is given one line of what the operator should know
    writes : whether it may be written; else only what is there is read, beside a service that writes it

    Raises
    ------
    StoreError
        Where it cannot be reached, is none of this format, or another service writes it.
    """

    def __init__(
        self, address: ServerAddress, *, tell: Callable[[str], None] = lambda _: None, writes: bool = True
    ) -> None:
        self.name, self.writes = address.shown, writes
        self._address = address
        self._numbers: dict[str, int] = {}
        self._turns: set[str] = set()  # of which that in the database is one, unless another service had it
        self._inside = False
        with self._told():
            self._connect()
            if writes and self.number("SHOW fsync") == "off":
                tell(f"{self.name}: the server does not sync its disk (fsync=off): a loss of power may lose the store.")

    def close(self) -> None:
        """Close it, and let another service have it."""
        self._connection.close()

    def rows(self, statement: str, *values: object) -> list[Any]:
        """Give what a statement finds."""
        with self._told():
            return self._asked(statement, values).fetchall()

    def number(self, statement: str, *values: object) -> Any:
        """Give the one number that a statement finds; None where it finds none."""
        found = self.rows(statement, *values)
        return found[0][0] if found else None

    def has_table(self, name: str) -> bool:
        """Whether there is a table."""
        return self.number("SELECT to_regclass(?)::text", name) is not None

    def insert(self, table: str, **values: object) -> int:
        """Write a row of a table, inside a transaction, and give its number, the next one of the table."""
        last = self._numbers.get(table)
        if last is None:
            last = self.number(f"SELECT max(number) FROM {table}") or 0  # noqa: S608 - names are ours
        number = self._numbers[table] = last + 1
        marks = ", ".join("?" * (len(values) + 1))
        statement = f"INSERT INTO {table} (number, {', '.join(values)}) VALUES ({marks})"  # noqa: S608 - names are ours
        self._execute(statement, (number, *values.values()))
        return number

    def change(self, statement: str, *values: object) -> None:
        """Change something, inside a transaction."""
        self._execute(statement, values)

    @contextmanager
    def transaction(self, turn: str = "") -> Iterator[None]:
        """Write all of what is written inside or nothing; it is on the server's disk at the end.

        Raises
        ------
        StoreError
            Where it cannot be written. Then nothing was, or `has_written` knows its turn.
        """
        with self._block("BEGIN"):
            if turn:
                self._turns.add(turn)
            with self._connection.pipeline():  # what is written is sent without waiting for each answer
                if turn:
                    self.change("UPDATE faultbond SET turn=?", turn)
                yield
        if turn:
            self._turns = {turn}

    def has_written(self, turn: str) -> bool:
        """Whether that was the turn of the last transaction that had one."""
        return bool(self.number("SELECT turn FROM faultbond") == turn)

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read all that is read inside as it was at one moment."""
        with self._block("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY"):
            yield

    def used(self) -> int:
        """Give how many bytes of content there are."""
        return int(self.number(f"SELECT {USED}"))

    def shrink(self) -> None:
        """Do nothing: the server uses the room of what is gone again."""

    def reserve(self) -> str:
        """Say nothing: the disk is the server's."""
        return ""

    def make_room(self, error: BaseException, *, all_of_it: bool) -> bool:
        """Tell that there is none: the disk is the server's."""
        return False

    @contextmanager
    def _block(self, begin: str) -> Iterator[None]:
        """Do all that is done inside in one transaction."""
        with self._told():
            self._asked(begin)
            self._inside = True
            try:
                yield
                self._execute("COMMIT")
            except BaseException:
                self._numbers.clear()
                with suppress(psycopg.Error):
                    if not self._connection.closed:
                        self._execute("ROLLBACK")
                raise
            finally:
                self._inside = False

    @contextmanager
    def _told(self) -> Iterator[None]:
        """Turn what goes wrong into one line."""
        try:
            yield
        except psycopg.Error as error:
            raise refusal_error(self.name, error) from error

    def _asked(self, statement: str, values: tuple[object, ...] = ()) -> "psycopg.Cursor[Any]":
        """Run a statement, over a new connection where the old one turns out to be lost and nothing hangs on it."""
        if not self._inside:
            if not self._connection.closed:
                try:
                    return self._execute(statement, values)
                except psycopg.OperationalError:
                    if not self._connection.closed:
                        raise
            self._connect()
        return self._execute(statement, values)

    def _execute(self, statement: str, values: tuple[object, ...] = ()) -> "psycopg.Cursor[Any]":
        return self._connection.cursor(binary=True).execute(statement.replace("?", "%s"), values)

    def _connect(self) -> None:
        """Open the connection, have the schema for this service, and know what is in it."""
        try:
            told = conninfo_to_dict(self._address.conninfo)
        except psycopg.ProgrammingError as error:  # whose text would show the password
            raise StoreError(f"{self.name}: this is no address of PostgreSQL. Expected {FORM}.") from error
        settings: dict[str, Any] = OURS | told
        try:
            self._connection = psycopg.connect(**settings, autocommit=True, client_encoding="utf8")
        except psycopg.OperationalError as error:
            raise unreached_error(self.name, error) from error
        self._numbers.clear()
        try:
            self._settle()
            if self.writes:
                self._have()
            self._know()
        except BaseException:
            self._connection.close()
            raise

    def _settle(self) -> None:
        """Say how this session is to be."""
        settings = SESSION | {"search_path": f'"{self._address.schema}"', "lock_timeout": str(WAIT)}
        if self._found("SHOW synchronous_commit") == "off":  # other values write on this server's disk, too
            settings["synchronous_commit"] = "on"
        if not self.writes:
            settings["default_transaction_read_only"] = "on"
        for name, value in settings.items():
            self._execute("SELECT set_config(?, ?, false)", (name, value))

    def _have(self) -> None:
        """Keep other services away for as long as this session lasts."""
        self._execute("SELECT set_config('lock_timeout', ?, false)", (str(LOCK_WAIT),))
        try:
            self._execute("SELECT pg_advisory_lock(?, hashtext(?))", (APPLICATION, self._address.schema))
        except psycopg.errors.LockNotAvailable as error:
            raise StoreError(
                f"{self.name}: another service writes it. Stop that one, or name another store."
            ) from error
        self._execute("SELECT set_config('lock_timeout', ?, false)", (str(WAIT),))

    def _know(self) -> None:
        """Make the tables of a new store, and refuse what is no store of this format, or was written by another."""
        there = "FROM pg_class JOIN pg_namespace AS place ON relnamespace=place.oid WHERE nspname=?"
        statement = f"SELECT count(*), count(*) FILTER (WHERE relname='faultbond') {there}"
        ((tables, ours),) = self._execute(statement, (self._address.schema,)).fetchall()
        if tables and not ours:
            raise StoreError(f"{self.name}: this is a database, but no store of faultbond. Name another schema.")
        if not ours and not self.writes:
            raise AbsentStoreError(
                f"{self.name}: there is no such store. Name the address that `faultbond serve` writes."
            )
        if not ours:
            self._make()
        state = f'SELECT format, turn FROM "{self._address.schema}".faultbond'  # noqa: S608 - so a missing right is told
        ((number, turn),) = self._execute(state).fetchall()
        if number > FORMAT:
            raise StoreError(
                f"{self.name}: of format {number}, and this faultbond knows format {FORMAT}. Take a newer faultbond, "
                "or name another store."
            )
        if not self._turns:
            turn = uuid4().hex
            if self.writes:
                self._execute("UPDATE faultbond SET turn=?", (turn,))
            self._turns = {turn}
        elif self.writes and turn not in self._turns:
            raise StoreError(
                f"{self.name}: another service has had it since this one lost it. Start this one anew, once the other "
                "has stopped."
            )

    def _make(self) -> None:
        """Make the tables; content that is deflated already is not compressed once more."""
        tables = TABLES.replace("INTEGER", "BIGINT").replace("REAL", "DOUBLE PRECISION").replace("BLOB", "BYTEA")
        statements = [*tables.split(";\n")[:-1], STATE, f"INSERT INTO faultbond VALUES ({FORMAT}, '')"]  # noqa: S608
        if self._found("SELECT to_regnamespace(?)::text", f'"{self._address.schema}"') is None:
            statements.insert(0, f'CREATE SCHEMA "{self._address.schema}"')
        for item in INCOMPRESSIBLE:
            table, column = item.split()
            statements.append(f"ALTER TABLE {table} ALTER {column} SET STORAGE EXTERNAL")
        with self._connection.transaction():
            for statement in statements:
                self._execute(statement)

    def _found(self, statement: str, *values: object) -> Any:
        """Give the one value that a statement finds over the new connection."""
        ((value,),) = self._execute(statement, values).fetchall()
        return value


def refusal_error(name: str, error: psycopg.Error) -> StoreError:
    """Give what the server refused as an error that says what it means for the user, and what to do."""
    reason, state = _reason(error), error.sqlstate or ""
    known = {
        "53100": "the disk of the server is full. Free some of it; what was acknowledged is kept.",
        "42501": f"its user may not do that ({reason}). Grant the right, or let the user own the schema.",
        "25006": f"it cannot be written ({reason}). Name a server that is no standby.",
        "55P03": "another program has locked it. Stop that one, or wait until it is done.",
        "58030": "the server cannot read or write its disk. Check the disk; what was acknowledged is kept.",
        "XX001": "it is damaged. Take a backup from before.",
        "XX002": "an index of it is damaged. Let the server make it anew (REINDEX).",
    }
    lost = not state or state[:2] == "08" or state in ("57P01", "57P02", "57P03")
    if isinstance(error, psycopg.OperationalError) and lost:
        return UnreadyStoreError(
            f"{name}: the connection to the server is lost ({reason}). What was acknowledged is kept."
        )
    kind = UnreadyStoreError if state in PASSING else StoreError
    return kind(f"{name}: {known.get(state) or f'it cannot be used: {reason}.'}")


def unreached_error(name: str, error: psycopg.Error) -> StoreError:
    """Give why there is no connection, and what to do."""
    reason = _reason(error)
    known = {
        "password": "Give it in ~/.pgpass, in PGPASSWORD, or in the address.",
        "does not exist": "Make it on the server, or name another.",
        "pg_hba.conf": "Let the server admit this user from here.",
    }
    advice = next((text for words, text in known.items() if words in reason), "")
    kind = StoreError if advice else UnreadyStoreError  # it is there, and refuses
    return kind(f"{name}: the server cannot be reached: {reason}. {advice or 'Check the address, and that it runs.'}")


def _reason(error: psycopg.Error) -> str:
    """Give what went wrong in the words of the server, or of the driver."""
    line = (error.diag.message_primary or str(error)).strip().partition("\n")[0]
    return re.sub(r".*failed: (?:FATAL:\s+)?", "", line).rstrip(". ")
