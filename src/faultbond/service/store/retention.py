"""What a store forgets: chunks of rows and curves, by age and by size, and never what a checkpoint needs.

A log can be passed on from each of its checkpoints, the oldest of them included, since a newer one may be damaged.
"""

from collections import Counter
from math import inf

from faultbond.service.contract.store import Forgotten
from faultbond.service.store.database import Database
from faultbond.service.store.tail import CHUNKS, CURVES, PIECES, ROWS

AT_ONCE = 256  # chunks in a transaction
AT_A_CALL = 16  # transactions, so that arrivals do not wait long where much has to go at once
SLACK = 50  # part of its size by which a store is smaller once it forgot, so that it need not forget with each row
_DISPENSABLE = """
    SELECT number, kind, count, length(content) FROM {0} AS chunk
    WHERE arrived<? AND (kind<>? OR first+count<=(
        SELECT coalesce(min(checkpoints.rows), 0) FROM checkpoints WHERE checkpoints.log=chunk.log))
    ORDER BY arrived, number LIMIT ?
"""


def forget(database: Database, *, older_than: float | None, at_most: int | None) -> Forgotten:
    """Forget chunks, those that came first first, and give what went.

    A chunk goes once its newest row arrived before `older_than`. Where the store has more than `at_most` bytes, chunks
    go until it is smaller than that by a part of `SLACK`. Where much has to go, a call lets only some of it go.
    """
    gone, left = Counter[int](), AT_A_CALL
    while older_than is not None and left and (found := _forget_some(database, older_than, None)):
        gone, left = gone + found, left - 1
    if at_most is not None and database.used() > at_most:
        goal = at_most - at_most // SLACK
        while left and (excess := database.used() - goal) > 0 and (found := _forget_some(database, inf, excess)):
            gone, left = gone + found, left - 1
    database.shrink()
    return Forgotten(rows=gone[ROWS.number], points=gone[CURVES.number])


def _forget_some(database: Database, older_than: float, excess: int | None) -> Counter[int]:
    """Forget some chunks, no more than `excess` bytes ask for; give how much of each kind went."""
    gone = Counter[int]()
    with database.transaction():
        table = CHUNKS
        found = database.rows(_DISPENSABLE.format(table), older_than, ROWS.number, AT_ONCE)
        if not found:  # the newest of each log
            table = PIECES
            found = database.rows(_DISPENSABLE.format(table), older_than, ROWS.number, AT_ONCE)
        for number, kind, count, size in found:
            database.change(f"DELETE FROM {table} WHERE number=?", number)  # noqa: S608
            gone[kind] += count
            if excess is not None:
                excess -= size
                if excess <= 0:
                    break
    return gone
