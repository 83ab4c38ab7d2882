"""The newest states of an asset, each with its checksum: where one is damaged, that before it serves."""

import zlib
from collections.abc import Callable

from faultbond.service.contract.store import LogPlace
from faultbond.service.store.database import Database
from faultbond.service.store.tail import Log

KEPT = 3  # of each log


def write_checkpoint(database: Database, log: Log, content: bytes) -> None:
    """Write the state of an asset as it is behind all of its log, and forget the oldest, inside a transaction."""
    database.insert(
        "checkpoints",
        log=log.number,
        rows=log.rows,
        deeds=log.deeds,
        checksum=zlib.crc32(content),
        content=content,
    )
    older = "SELECT number FROM checkpoints WHERE log=? ORDER BY number DESC LIMIT -1 OFFSET ?"
    database.change(f"DELETE FROM checkpoints WHERE number IN ({older})", log.number, KEPT)  # noqa: S608


def stand_of(database: Database, log: Log, tell: Callable[[str], None]) -> LogPlace:
    """Give where a log stands, with the newest checkpoint that is whole; `tell` hears of one that is not."""
    statement = "SELECT rows, deeds, checksum, content FROM checkpoints WHERE log=? ORDER BY number DESC"
    for rows, deeds, checksum, content in database.rows(statement, log.number):
        if zlib.crc32(content) == checksum:
            return LogPlace(
                rows=log.rows,
                cursor=log.cursor,
                checkpoint=content,
                checkpoint_rows=rows,
                checkpoint_deeds=deeds,
            )
        tell(
            f"{database.path}: the state of {log.name!r} behind row {rows} is damaged on the disk; that before it is "
            "taken. Check the disk."
        )
    return LogPlace(rows=log.rows, cursor=log.cursor)
