"""From the address of a store to the store."""

from collections.abc import Callable
from pathlib import Path

from faultbond.errors import StoreError
from faultbond.service.store.address import ServerAddress, store_address
from faultbond.service.store.database import Database
from faultbond.service.store.relational import RelationalStore
from faultbond.service.store.reserve_file import DEFAULT_SIZE
from faultbond.service.store.sqlite import SqliteDatabase

EXTRA = 'PostgreSQL needs more: install it by `pip install "faultbond[postgres]"`.'


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
    address : a file, or `postgresql://USER@HOST/DATABASE`; what is not there is made where it may be written
    tell : is given one line of what the operator should know, such as of a state that is damaged
    writes : False: only read, also beside a service that writes it
    reserve : bytes of the disk that are kept beside a file for when the disk is full

    Raises
    ------
    StoreError
        Where it cannot be opened, is none of this format, or another service writes it.
    """
    place = address if isinstance(address, Path) else store_address(address)
    if isinstance(place, ServerAddress):
        return RelationalStore(_in_server(place, tell, writes=writes), tell=tell)
    return RelationalStore(SqliteDatabase(place, writes=writes, reserve=reserve), tell=tell)


def _in_server(place: ServerAddress, tell: Callable[[str], None], *, writes: bool) -> Database:
    try:
        from faultbond.service.store.postgresql import PostgresqlDatabase  # noqa: PLC0415 - an extra
    except ImportError as error:
        raise StoreError(f"{place.shown}: {EXTRA}") from error
    return PostgresqlDatabase(place, tell=tell, writes=writes)
