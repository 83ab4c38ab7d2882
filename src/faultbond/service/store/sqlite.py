"""The store in one file of SQLite: it needs nothing installed, others read it meanwhile, and it survives any stop.

Transactions are written ahead (WAL) and synced each (synchronous=FULL), so what `commit` was given is on the disk when
it returns.
Source: sqlite.org/wal.html, and pragma.html under `synchronous` and `auto_vacuum`.
"""

import sqlite3
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any
from urllib.parse import quote

from faultbond.errors import AbsentStoreError, StoreError, UnreadyStoreError
from faultbond.service.store.database import FORMAT, TABLES
from faultbond.service.store.lock import StoreLock
from faultbond.service.store.reserve_file import DEFAULT_SIZE, ReserveFile

APPLICATION = 0x46424E44  # "FBND", by which a file is known for a store
WAIT = 10.0  # s for another program that holds the file, such as one that copies it
LONGEST_LOG = 2**22  # bytes that the file of transactions keeps once they are in the store
PORTION = 512  # pages that are moved in a transaction, which takes as much room beside the file
SPARE = 256  # pages that stay in the file without content, beside a sixteenth of all
PASSING = ("SQLITE_FULL", "SQLITE_BUSY", "SQLITE_LOCKED")  # that others may mend while it is waited for
SHRUNK = 4096  # pages that a call gives back to the disk


class SqliteDatabase:
    """An open store file; see `database.Database`.

    Parameters
    ----------
    path : the file; one that is not there is made where it may be written
    writes : whether it may be written; else only what is there is read, beside a service that writes it
    reserve : bytes of the disk that are kept for when it is full; see `reserve_file`

    Raises
    ------
    StoreError
        Where it cannot be opened, is none of this format, or another service writes it.
    """

    def __init__(
        self,
        path: Path,
        *,
        writes: bool = True,
        reserve: int = DEFAULT_SIZE,
    ) -> None:
        self.name, self.writes = str(path), writes
        self._path = path
        self._files: list[tuple[int, int] | None] = [None, None]  # known from the first transaction on
        if not writes and not path.is_file():
            raise AbsentStoreError(f"{path}: there is no such store. Name the file that `faultbond serve` writes.")
        self._lock = StoreLock(path) if writes else None
        try:
            with self.told():
                self._connection = self._opened()
                try:
                    self._know()
                except BaseException:
                    self._connection.close()
                    raise
        except BaseException:
            self._release()
            raise
        self._reserve = ReserveFile(path, reserve if writes else 0)
        self._reserve.renew()

    def close(self) -> None:
        """Close it, and let another service have it; the last one who closes it leaves all in one file."""
        try:
            with self.told():
                self._connection.close()
        finally:
            self._release()

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

    def has_table(self, name: str) -> bool:
        """Whether there is a table."""
        return bool(self.number("SELECT count(*) FROM sqlite_master WHERE type='table' AND name=?", name))

    def insert(self, table: str, **values: object) -> int:
        """Write a row of a table, inside a transaction, and give its number, the next one of the table."""
        marks = ", ".join("?" * len(values))
        statement = f"INSERT INTO {table} ({', '.join(values)}) VALUES ({marks})"  # noqa: S608 - names are ours
        return int(self._connection.execute(statement, tuple(values.values())).lastrowid or 0)

    def change(self, statement: str, *values: object) -> None:
        """Change something, inside a transaction."""
        self._connection.execute(statement, values)

    @contextmanager
    def transaction(self, turn: str = "") -> Iterator[None]:
        """Write all of what is written inside or nothing; it is on the disk at the end.

        Its turn is not kept: what failed is known not to be written.

        Raises
        ------
        StoreError
            Where it cannot be written; then nothing was.
        """
        found = self._found_files()
        if any(now != known is not None for now, known in zip(found, self._files, strict=True)):
            # SQLite would go on writing into what has no name any more.
            raise StoreError(
                f"{self._path}: the store was removed, moved or replaced while the service has it. Put it back, with "
                "the files beside it, or start the service again, which begins a new one."
            )
        self._files = found
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

    def has_written(self, turn: str) -> bool:
        """Tell that it is not; see `transaction`."""
        return False

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
            raise store_error(self._path, error) from error

    def used(self) -> int:
        """Give how many bytes of the file hold something."""
        pages = self.number("PRAGMA page_count") - self.number("PRAGMA freelist_count")
        return int(pages * self.number("PRAGMA page_size"))

    def shrink(self) -> None:
        """Give pages without content back to the disk, all but a sixteenth and some, and have the reserve again.

        Their room is used again for what comes next. Where much more is left than that needs, as after a smaller size
        was asked for, the file becomes smaller, by some MB each time, since that moves what is behind the holes.
        """
        free = self.number("PRAGMA freelist_count") - SPARE - self.number("PRAGMA page_count") // 16
        for first in range(0, min(free, SHRUNK), PORTION):
            with self.told():  # not by `execute`, which ends after the first page
                self._connection.executescript(f"PRAGMA incremental_vacuum({min(free - first, PORTION)})")
            self.settle()
        self.settle()
        self._reserve.renew()

    def reserve(self) -> str:
        """Have again the room that is kept for when the disk is full, and say what is wrong where it cannot be had."""
        if self._reserve.renew():
            return ""
        size = f"{self._reserve.size >> 20} MB"
        return f"{self._path}: the disk is almost full, with no room for the {size} kept in reserve. Free some of it."

    def make_room(self, error: BaseException, *, all_of_it: bool) -> bool:
        """Give up half of the reserve, or all of it, where the disk is full; tell whether there was any."""
        if not (is_full(error.__cause__) and self._reserve.give_up(all_of_it=all_of_it)):
            return False
        self.settle()
        return True

    def settle(self) -> None:
        """Bring all transactions from their own file into that of the store, so that it takes no room any more."""
        self.rows("PRAGMA wal_checkpoint(TRUNCATE)")

    def _found_files(self) -> list[tuple[int, int] | None]:
        """Give which files have the names of the store and of its transactions now; None: none has."""
        found: list[tuple[int, int] | None] = []
        for path in (self._path, self._path.with_name(f"{self._path.name}-wal")):
            try:
                seen = path.stat()
            except OSError:
                found.append(None)
            else:
                found.append((seen.st_dev, seen.st_ino))
        return found

    def _release(self) -> None:
        """Let another service have it."""
        if self._lock is not None:
            self._lock.release()
            self._lock = None

    def _opened(self) -> sqlite3.Connection:
        if self.writes:
            return self._tried("mode=rwc")
        try:
            return self._tried("mode=ro")
        except sqlite3.Error as error:
            is_forbidden = str(getattr(error, "sqlite_errorname", "")).startswith("SQLITE_CANTOPEN")
            if not is_forbidden or self._path.with_name(f"{self._path.name}-wal").exists():
                raise
        return self._tried("mode=ro&immutable=1")  # its folder cannot be written, and nobody writes the store

    def _tried(self, mode: str) -> sqlite3.Connection:
        place = f"file:{quote(str(self._path.absolute()))}?{mode}"
        found = sqlite3.connect(place, uri=True, timeout=WAIT, isolation_level=None, check_same_thread=False)
        try:
            found.execute("SELECT count(*) FROM sqlite_master").fetchone()
        except sqlite3.Error:
            found.close()
            raise
        return found

    def _know(self) -> None:
        """Make the tables of a new file, and refuse what is no store of this format."""
        application, version, tables = (
            self.number(statement)
            for statement in (
                "PRAGMA application_id",
                "PRAGMA user_version",
                "SELECT count(*) FROM sqlite_master",
            )
        )
        if application != APPLICATION and not (self.writes and application == version == tables == 0):
            raise StoreError(f"{self._path}: this is a database, but no store of faultbond. Name another file.")
        if version > FORMAT:
            raise StoreError(
                f"{self._path}: of format {version}, and this faultbond knows format {FORMAT}. Take a newer faultbond, "
                "or name another file."
            )
        if not self.writes:
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
    kind = UnreadyStoreError if name.startswith(PASSING) else StoreError
    return kind(f"{path}: {told or f'it cannot be used: {error}.'}")
