"""What a store forgets: chunks of rows and curves, by age and by size, and never what a checkpoint needs.

A log can be passed on from each of its checkpoints, the oldest of them included, since a newer one may be damaged.
With rows go the diagnoses that were made of them, but for the last one of each alarm: an alarm that stays open gives
many, each a hundred times as large as a row.
"""

from collections import Counter
from collections.abc import Iterator
from itertools import islice, pairwise
from math import inf

from faultbond.service.contract.store import Forgotten
from faultbond.service.store.database import Database
from faultbond.service.store.tail import CHUNKS, CURVES, PIECES, ROWS

AT_ONCE = 256  # chunks in a transaction
DIAGNOSES = 500  # that are looked at, and go, together
AT_A_CALL = 16  # transactions, so that arrivals do not wait long where much has to go at once
SLACK = 50  # part of its size by which a store is smaller once it forgot, so that it need not forget with each row
_DISPENSABLE = """
    SELECT number, kind, count, length(content) FROM {0} AS chunk
    WHERE arrived<? AND (kind<>? OR first+count<=(
        SELECT coalesce(min(checkpoints.rows), 0) FROM checkpoints WHERE checkpoints.log=chunk.log))
    ORDER BY arrived, number LIMIT ?
"""

_DIAGNOSES = "SELECT number, time FROM records WHERE asset=? AND kind='diagnosis' AND number>? ORDER BY number LIMIT ?"


def forget(database: Database, *, older_than: float | None, at_most: int | None) -> Forgotten:
    """Forget chunks, those that came first first, and diagnoses of what is forgotten; give what went.

    A chunk goes once its newest row arrived before `older_than`. Where the store has more than `at_most` bytes, chunks
    go until it is smaller than that by a part of `SLACK`. Where much has to go, a call lets only some of it go.
    """
    gone, left, diagnoses = Counter[int](), AT_A_CALL, 0
    while older_than is not None and left and (found := _forget_some(database, older_than, None)):
        gone, left = gone + found, left - 1
    if at_most is not None and database.used() > at_most:
        goal = at_most - at_most // SLACK
        while left and (excess := database.used() - goal) > 0 and (found := _forget_some(database, inf, excess)):
            gone, left = gone + found, left - 1
            diagnoses += _forget_diagnoses(database)
    diagnoses += _forget_diagnoses(database)
    database.shrink()
    return Forgotten(rows=gone[ROWS.number], points=gone[CURVES.number], diagnoses=diagnoses)


def _forget_diagnoses(database: Database) -> int:
    """Forget some diagnoses from before the first row that is kept, but for the last of each alarm; give how many."""
    gone = 0
    for found in (_superseded(database, *item) for item in _begins(database)):
        while gone < DIAGNOSES * AT_A_CALL and (numbers := [*islice(found, DIAGNOSES)]):
            marks = ", ".join("?" * len(numbers))
            with database.transaction():
                database.change(f"DELETE FROM records WHERE number IN ({marks})", *numbers)  # noqa: S608
            gone += len(numbers)
    return gone


def _begins(database: Database) -> Iterator[tuple[int, float]]:
    """Give the number of each asset with the time of the first row of it that is kept; without any, inf."""
    for (asset,) in database.rows("SELECT number FROM assets ORDER BY number"):
        kept = [
            database.number(
                f"SELECT min(low) FROM {table} WHERE kind=? AND log IN (SELECT number FROM logs WHERE asset=?)",  # noqa: S608
                ROWS.number,
                asset,
            )
            for table in (CHUNKS, PIECES)
        ]
        yield asset, min((moment for moment in kept if moment is not None), default=inf)


def _superseded(database: Database, asset: int, begin: float) -> Iterator[int]:
    """Give the numbers of diagnoses of an asset from before a moment that another one follows in the same alarm."""
    others = database.rows("SELECT number FROM records WHERE asset=? AND kind<>'diagnosis' ORDER BY number", asset)
    turns, after = iter([*(number for (number,) in others), inf]), 0
    turn = next(turns)
    while len(found := database.rows(_DIAGNOSES, asset, after, DIAGNOSES)) > 1:
        for (number, time), (following, _) in pairwise(found):
            if time is not None and time >= begin:
                return
            while turn < number:
                turn = next(turns)
            if following < turn:
                yield number
        after = found[-1][0] - 1  # what follows the last one is not known yet


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
