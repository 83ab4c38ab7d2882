"""What a store forgets: chunks of rows and curves, by age and by size, and never what a checkpoint needs.

A log can be passed on from each of its checkpoints, the oldest of them included, since a newer one may be damaged.
"""

from math import inf

from faultbond.service.store.database import Database
from faultbond.service.store.tail import CHUNKS, PIECES, ROWS

AT_ONCE = 256  # chunks in a transaction
AT_A_CALL = 16  # transactions, so that arrivals do not wait long where much has to go at once
_DISPENSABLE = """
    SELECT number, kind, count, length(content) FROM {0} AS chunk
    WHERE arrived<? AND (kind<>? OR first+count<=(
        SELECT coalesce(min(checkpoints.rows), 0) FROM checkpoints WHERE checkpoints.log=chunk.log))
    ORDER BY arrived, number LIMIT ?
"""


def forget(database: Database, *, older_than: float | None, at_most: int | None) -> int:
    """Forget chunks, those that came first first, and give how many rows of logs went.

    A chunk goes once its newest row arrived before `older_than`; chunks go until the store has `at_most` bytes. Where
    much has to go, a call lets only some of it go, and so gives more than 0.
    """
    gone, left = 0, AT_A_CALL
    while older_than is not None and left and (found := _forget_some(database, older_than, None)) is not None:
        gone, left = gone + found, left - 1
    while at_most is not None and left and (excess := database.used() - at_most) > 0:
        found = _forget_some(database, inf, excess)
        if found is None:
            break
        gone, left = gone + found, left - 1
    database.shrink()
    return gone


def _forget_some(database: Database, older_than: float, excess: int | None) -> int | None:
    """Forget some chunks, no more than `excess` bytes ask for; None where there is none that may go."""
    rows = 0
    with database.transaction():
        table = CHUNKS
        found = database.rows(_DISPENSABLE.format(table), older_than, ROWS.number, AT_ONCE)
        if not found:  # the newest of each log
            table = PIECES
            found = database.rows(_DISPENSABLE.format(table), older_than, ROWS.number, AT_ONCE)
        for number, kind, count, size in found:
            database.change(f"DELETE FROM {table} WHERE number=?", number)  # noqa: S608
            rows += count if kind == ROWS.number else 0
            if excess is not None:
                excess -= size
                if excess <= 0:
                    break
    return rows if found else None
