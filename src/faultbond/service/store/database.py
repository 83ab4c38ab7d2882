"""What a store asks of a database: tables that are the same in each, and transactions."""

from contextlib import AbstractContextManager
from typing import Any, Protocol

FORMAT = 1
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
CREATE TABLE contested (number INTEGER PRIMARY KEY, id TEXT NOT NULL, content TEXT NOT NULL);
CREATE TABLE deeds (
    number INTEGER PRIMARY KEY, log INTEGER NOT NULL, asset INTEGER NOT NULL, place INTEGER NOT NULL,
    rows INTEGER NOT NULL, time REAL, came INTEGER NOT NULL, content TEXT NOT NULL, checksum INTEGER NOT NULL);
CREATE INDEX deeds_in_order ON deeds (log, place);
CREATE TABLE checkpoints (
    number INTEGER PRIMARY KEY, log INTEGER NOT NULL, rows INTEGER NOT NULL, deeds INTEGER NOT NULL,
    checksum INTEGER NOT NULL, content BLOB NOT NULL);
CREATE INDEX checkpoints_of_logs ON checkpoints (log);
"""


class Database(Protocol):
    """An open database that holds one store.

    Statements are those that all databases know, with `?` for values. All methods raise `StoreError` where the database
    cannot be read or written, in one line that names it and says what to do.
    """

    name: str
    writes: bool

    def close(self) -> None:
        """Close it, and let another service have it."""

    def rows(self, statement: str, *values: object) -> list[Any]:
        """Give what a statement finds."""

    def number(self, statement: str, *values: object) -> Any:
        """Give the one number that a statement finds; None where it finds none."""

    def has_table(self, name: str) -> bool:
        """Whether there is a table, which an older store may not have."""

    def insert(self, table: str, **values: object) -> int:
        """Write a row of a table, inside a transaction, and give its number, the next one of the table."""

    def change(self, statement: str, *values: object) -> None:
        """Change something, inside a transaction."""

    def transaction(self, turn: str = "") -> AbstractContextManager[None]:
        """Write all of what is written inside or nothing; it is on the disk at the end.

        turn: a name of what is written, for `has_written`.
        """

    def has_written(self, turn: str) -> bool:
        """Whether the last transaction with a turn had this one: one that failed, but whose end was only not heard."""

    def reading(self) -> AbstractContextManager[None]:
        """Read all that is read inside as it was at one moment."""

    def used(self) -> int:
        """Give how many bytes hold something."""

    def shrink(self) -> None:
        """Give room that holds nothing back to the disk, where that is for the store to do."""

    def reserve(self) -> str:
        """Have again what room is kept for when the disk is full; give in a line what is wrong, else nothing."""

    def make_room(self, error: BaseException, *, all_of_it: bool) -> bool:
        """Make room where something could not be written for want of it; tell whether it is worth another try.

        all_of_it: give up all that is kept in reserve, as what follows makes the store smaller.
        """
