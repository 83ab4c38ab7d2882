"""One service a store: a lock that the system takes back however its holder ends."""

import os
import sys
from pathlib import Path

from faultbond.errors import StoreError

if sys.platform != "win32":
    from fcntl import LOCK_EX, LOCK_NB, flock


class StoreLock:
    """Keeps other services away from a store until it is released; where the system knows no locks, nobody is.

    A file of its own is locked: SQLite loses its own locks when somebody closes the file of its database.

    Parameters
    ----------
    store : its file

    Raises
    ------
    StoreError
        Where another one holds it, or the file cannot be made.
    """

    def __init__(self, store: Path) -> None:
        path = store.with_name(f"{store.name}.lock")
        try:
            self._file = os.open(path, os.O_RDWR | os.O_CREAT | os.O_CLOEXEC, 0o600)
        except OSError as error:
            raise StoreError(
                f"{store}: cannot be written: {error.strerror}. Name a place where faultbond may write."
            ) from error
        if sys.platform == "win32":
            return
        try:
            flock(self._file, LOCK_EX | LOCK_NB)
        except BlockingIOError as error:
            self.release()
            raise StoreError(f"{store}: another service writes it. Stop that one, or name another store.") from error
        except OSError:  # as on some network file systems
            return

    def release(self) -> None:
        """Let others have it; the file stays, since one that is removed could be locked by two."""
        os.close(self._file)
