"""The newest states of an asset, deflated, each with its checksum: where one is damaged, that before it serves."""

import zlib
from collections.abc import Callable

from faultbond.service.contract.store import LogPlace
from faultbond.service.store.database import Database
from faultbond.service.store.tail import Log

KEPT = 3  # of each log
LEVEL = 1  # of deflating: the tank's healthy state of 1 MB becomes 0.27 MB in 9 ms, and no smaller at higher levels


def write_checkpoint(database: Database, log: Log, content: bytes) -> None:
    """Write the state of an asset as it is behind all of its log, and forget the oldest, inside a transaction."""
    kept = zlib.compress(content, LEVEL)
    database.insert(
        "checkpoints",
        log=log.number,
        rows=log.rows,
        deeds=log.deeds,
        checksum=zlib.crc32(kept),
        content=kept,
    )
    newest = "SELECT number FROM checkpoints WHERE log=? ORDER BY number DESC LIMIT ?"
    forgotten = f"DELETE FROM checkpoints WHERE log=? AND number NOT IN ({newest})"  # noqa: S608 - words are ours
    database.change(forgotten, log.number, log.number, KEPT)


def stand_of(database: Database, log: Log, tell: Callable[[str], None]) -> LogPlace:
    """Give where a log stands, with the newest checkpoint that is whole; `tell` hears of one that is not."""
    statement = "SELECT rows, deeds, checksum, content FROM checkpoints WHERE log=? ORDER BY number DESC"
    for rows, deeds, checksum, content in database.rows(statement, log.number):
        if zlib.crc32(content) == checksum:
            return LogPlace(
                rows=log.rows,
                cursor=log.cursor,
                checkpoint=zlib.decompress(content),
                checkpoint_rows=rows,
                checkpoint_deeds=deeds,
            )
        tell(
            f"{database.name}: the state of {log.name!r} behind row {rows} is damaged on the disk; that before it is "
            "taken. Check the disk."
        )
    return LogPlace(rows=log.rows, cursor=log.cursor)
