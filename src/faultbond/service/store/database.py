"""The SQLite file of a store: opened, known for one, and what can go wrong with it in one line each."""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from faultbond.errors import StoreError

APPLICATION = 0x46424E44  # "FBND", by which a file is known for a store
FORMAT = 1
WAIT = 10.0  # s for another program that holds the file, such as one that copies it
LONGEST_LOG = 2**22  # bytes that the file of transactions keeps once they are in the store
PORTION = 512  # pages that are moved in a transaction, which takes as much room beside the file
TABLES = """
CREATE TABLE assets (number INTEGER PRIMARY KEY, name TEXT NOT NULL UNIQUE, log INTEGER);
CREATE TABLE logs (
    number INTEGER PRIMARY KEY, asset INTEGER NOT NULL, model_sha256 TEXT NOT NULL,
    n_inputs INTEGER NOT NULL, n_outputs INTEGER NOT NULL,
    rows INTEGER NOT NULL DEFAULT 0, points INTEGER NOT NULL DEFAULT 0, deeds INTEGER NOT NULL DEFAULT 0,
    cursor TEXT NOT NULL DEFAULT '""', arrived REAL NOT NULL DEFAULT 0, time REAL, UNIQUE (asset, model_sha256));
CREATE TABLE enrolments (
    log INTEGER PRIMARY KEY, asset INTEGER NOT NULL, came INTEGER NOT NULL, content TEXT NOT NULL);
CREATE TABLE pieces (
    number INTEGER PRIMARY KEY, log INTEGER NOT NULL, kind INTEGER NOT NULL, first INTEGER NOT NULL,
    count INTEGER NOT NULL, arrived REAL NOT NULL, low REAL, high REAL, content BLOB NOT NULL);
CREATE TABLE chunks (
    number INTEGER PRIMARY KEY, log INTEGER NOT NULL, kind INTEGER NOT NULL, first INTEGER NOT NULL,
    count INTEGER NOT NULL, dense INTEGER NOT NULL, arrived REAL NOT NULL, low REAL, high REAL, overview BLOB,
    content BLOB NOT NULL);
CREATE INDEX chunks_in_order ON chunks (log, kind, first, count, dense, low, high);
CREATE INDEX chunks_by_arrival ON chunks (arrived);
CREATE TABLE records (
    number INTEGER PRIMARY KEY, id TEXT NOT NULL UNIQUE, asset INTEGER NOT NULL, came INTEGER NOT NULL,
    sample INTEGER NOT NULL, time REAL, kind TEXT NOT NULL, content TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE INDEX records_of_assets ON records (asset, kind);
CREATE TABLE contested (
    number INTEGER PRIMARY KEY, id TEXT NOT NULL, content TEXT NOT NULL, UNIQUE (id, content));
CREATE TABLE deeds (
    number INTEGER PRIMARY KEY AUTOINCREMENT, log INTEGER NOT NULL, asset INTEGER NOT NULL, place INTEGER NOT NULL,
    rows INTEGER NOT NULL, time REAL, came INTEGER NOT NULL, content TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE INDEX deeds_in_order ON deeds (log, place);
CREATE TABLE checkpoints (
    number INTEGER PRIMARY KEY, log INTEGER NOT NULL, rows INTEGER NOT NULL, deeds INTEGER NOT NULL,
    checksum INTEGER NOT NULL, content BLOB NOT NULL);
CREATE INDEX checkpoints_of_logs ON checkpoints (log);
"""


class Database:
    """An open store file.

    Parameters
    ----------
    path : the file; one that is not there is made where it may be written
    writes : whether it may be written; else only what is there is read, beside a service that writes it

    Raises
    ------
    StoreError
        Where it cannot be opened, or is no store that this faultbond knows.
    """

    def __init__(self, path: Path, *, writes: bool) -> None:
        self.path = path
        if not writes and not path.is_file():
            raise StoreError(f"{path}: there is no such store. Name the file that `faultbond serve` writes.")
        with self.told():
            self._connection = self._opened(writes=writes)
            try:
                self._know(writes=writes)
            except BaseException:
                self._connection.close()
                raise

    def close(self) -> None:
        """Close it; the last one who does leaves all in one file."""
        with self.told():
            self._connection.close()

    def rows(self, statement: str, *values: object) -> list[Any]:
        """Give what a statement finds.

        Raises
        ------
        StoreError
            Where the file cannot be read.
        """
        with self.told():
            return self._connection.execute(statement, values).fetchall()

    def number(self, statement: str, *values: object) -> Any:
        """Give the one number that a statement finds; None where it finds none.

        Raises
        ------
        StoreError
            Where the file cannot be read.
        """
        found = self.rows(statement, *values)
        return found[0][0] if found else None

    def insert(self, table: str, **values: object) -> int:
        """Write a row of a table, inside a transaction, and give its number."""
        marks = ", ".join("?" * len(values))
        statement = f"INSERT INTO {table} ({', '.join(values)}) VALUES ({marks})"  # noqa: S608 - names are ours
        return int(self._connection.execute(statement, tuple(values.values())).lastrowid or 0)

    def change(self, statement: str, *values: object) -> int:
        """Change something, inside a transaction, and give how many rows of a table that were."""
        return self._connection.execute(statement, values).rowcount

    @contextmanager
    def transaction(self) -> Iterator[None]:
        """Write all of what is written inside or nothing; it is on the disk at the end.

        Raises
        ------
        StoreError
            Where it cannot be written; then nothing was.
        """
        with self.told():
            self._connection.execute("BEGIN IMMEDIATE")
            try:
                yield
                self._connection.execute("COMMIT")
            except BaseException:
                with suppress(sqlite3.Error):
                    if self._connection.in_transaction:  # else SQLite has taken it back itself
                        self._connection.execute("ROLLBACK")
                raise

    @contextmanager
    def reading(self) -> Iterator[None]:
        """Read all that is read inside as it was at one moment."""
        with self.told():
            self._connection.execute("BEGIN")
            try:
                yield
            finally:
                self._connection.execute("COMMIT")

    @contextmanager
    def told(self) -> Iterator[None]:
        """Turn what goes wrong with the file into one line.

        Raises
        ------
        StoreError
            What went wrong.
        """
        try:
            yield
        except sqlite3.Error as error:
            raise store_error(self.path, error) from error

    def used(self) -> int:
        """Give how many bytes of the file hold something."""
        pages = self.number("PRAGMA page_count") - self.number("PRAGMA freelist_count")
        return int(pages * self.number("PRAGMA page_size"))

    def shrink(self, spare: int, at_most: int) -> None:
        """Give pages without content back to the disk: all but a sixteenth and some, and only so many at once."""
        free = self.number("PRAGMA freelist_count") - spare - self.number("PRAGMA page_count") // 16
        for first in range(0, min(free, at_most), PORTION):
            with self.told():  # not by `execute`, which ends after the first page
                self._connection.executescript(f"PRAGMA incremental_vacuum({min(free - first, PORTION)})")
            self.settle()
        self.settle()

    def settle(self) -> None:
        """Bring all transactions from their own file into that of the store, so that it takes no room any more."""
        self.rows("PRAGMA wal_checkpoint(TRUNCATE)")

    def _opened(self, *, writes: bool) -> sqlite3.Connection:
        place = f"file:{quote(str(self.path.absolute()))}"
        beside = self.path.with_name(f"{self.path.name}-wal")
        modes = ["mode=rwc"] if writes else ["mode=ro"] if beside.exists() else ["mode=ro", "immutable=1"]
        for mode in modes:  # the last one where the folder cannot be written, and nobody writes the store
            found = sqlite3.connect(
                f"{place}?{mode}", uri=True, timeout=WAIT, isolation_level=None, check_same_thread=False
            )
            try:
                found.execute("SELECT count(*) FROM sqlite_master").fetchone()
            except sqlite3.Error as error:
                found.close()
                if mode == modes[-1] or not str(getattr(error, "sqlite_errorname", "")).startswith("SQLITE_CANTOPEN"):
                    raise
            else:
                return found
        raise NotImplementedError("there is a last mode")

    def _know(self, *, writes: bool) -> None:
        """Make the tables of a new file, and refuse what is no store of this format."""
        application, version, tables = (
            self.number(statement)
            for statement in (
                "PRAGMA application_id",
                "PRAGMA user_version",
                "SELECT count(*) FROM sqlite_master",
            )
        )
        if application != APPLICATION and not (writes and application == version == tables == 0):
            raise StoreError(f"{self.path}: this is a database, but no store of faultbond. Name another file.")
        if version > FORMAT:
            raise StoreError(
                f"{self.path}: of format {version}, and this faultbond knows format {FORMAT}. Take a newer faultbond, "
                "or name another file."
            )
        if not writes:
            return
        if not tables:
            self._make()
        for setting in ("journal_mode=WAL", "synchronous=FULL", f"journal_size_limit={LONGEST_LOG}"):
            self.rows(f"PRAGMA {setting}")

    def _make(self) -> None:
        self.rows("PRAGMA auto_vacuum=INCREMENTAL")  # before the first table
        with self.transaction():
            for statement in TABLES.split(";\n"):
                self.change(statement)
            self.rows(f"PRAGMA application_id={APPLICATION}")
            self.rows(f"PRAGMA user_version={FORMAT}")


def is_full(error: BaseException | None) -> bool:
    """Whether something went wrong since the disk, or the room that the store may take of it, is full."""
    return getattr(error, "sqlite_errorname", "") == "SQLITE_FULL"


def store_error(path: Path, error: sqlite3.Error) -> StoreError:
    """Give what SQLite refused as an error that says what it means for the user, and what to do."""
    name = str(getattr(error, "sqlite_errorname", ""))
    known = {
        "SQLITE_FULL": "the disk is full. Free some of it; what was acknowledged is kept.",
        "SQLITE_READONLY": "it cannot be written. Give faultbond the right to write it and its folder.",
        "SQLITE_CANTOPEN": "it cannot be opened. Name a file in a folder that faultbond may read and write.",
        "SQLITE_PERM": "it cannot be opened. Give faultbond the right to read and write it.",
        "SQLITE_NOTADB": "this is no store of faultbond, or its beginning is damaged. Name another file.",
        "SQLITE_CORRUPT": "it is damaged. Take a copy from before, or move it away; a new one is then begun.",
        "SQLITE_BUSY": "another program has locked it. Stop that one, or wait until it is done.",
        "SQLITE_LOCKED": "another program has locked it. Stop that one, or wait until it is done.",
        "SQLITE_IOERR": "the disk cannot be read or written. Check the disk; what was acknowledged is kept.",
    }
    told = next((text for key, text in known.items() if name.startswith(key)), "")
    return StoreError(f"{path}: {told or f'it cannot be used: {error}.'}")
