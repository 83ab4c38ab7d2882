"""From the address of a store to the store."""

from collections.abc import Callable
from pathlib import Path

from faultbond.service.store.relational import RelationalStore
from faultbond.service.store.reserve_file import DEFAULT_SIZE
from faultbond.service.store.sqlite import SqliteDatabase


def open_store(
    address: str | Path,
    *,
    tell: Callable[[str], None] = lambda _: None,
    writes: bool = True,
    reserve: int = DEFAULT_SIZE,
) -> RelationalStore:
    """Give the store of an address.

    Parameters
    ----------
    address : a file; one that is not there is made where it may be written
    tell : is given one line of what the operator should know, such as of a disk that is full
    writes : False: only read, also beside a service that writes it
    reserve : bytes of the disk that are kept beside a file for when the disk is full

    Raises
    ------
    StoreError
        Where it cannot be opened, is none of this format, or another service writes it.
    """
    database = SqliteDatabase(Path(address), tell=tell, writes=writes, reserve=reserve)
    return RelationalStore(database, tell=tell)
