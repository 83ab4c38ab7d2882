"""What waits between the network and who takes it: bounded, and what is dropped is counted."""

import time
from collections import Counter, deque
from collections.abc import Iterator, Sequence

import numpy as np

from faultbond.io.row_block import Row, RowBlock, block_of_rows
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber

DROPPED = "dropped"
AT_ONCE = 2000  # rows that go on together, so that who takes them is soon done


class ArrivalQueue:
    """Rows by asset, in the order of arrival; where too many wait, the oldest is dropped.

    Parameters
    ----------
    subscribers : whose rows come here
    most : rows of an asset that may wait
    """

    def __init__(self, subscribers: Sequence[Subscriber], most: int) -> None:
        self._subscribers = {item.asset: item for item in subscribers}
        self._rows: dict[str, deque[Row]] = {asset: deque() for asset in self._subscribers}
        self._counts: dict[str, Counter[str]] = {asset: Counter() for asset in self._subscribers}
        self._stale: dict[str, str] = {}
        self._most = most

    def put(self, asset: str, row: Row) -> None:
        """Let a row wait."""
        rows = self._rows[asset]
        if len(rows) >= self._most:
            rows.popleft()
            self._counts[asset][DROPPED] += 1
        rows.append(row)

    def count(self, asset: str, name: str, number: int = 1) -> None:
        """Count what came and is in no row, or is in one as missing."""
        self._counts[asset][name] += number

    def tell_stale(self, asset: str, why: str) -> None:
        """Tell why the values of an asset are of the past; empty: they are of now."""
        self._stale[asset] = why

    def drain(self) -> Iterator[Arrivals]:
        """Give what waits, and what was counted since the last time."""
        for asset, rows in self._rows.items():
            if not rows and not +self._counts[asset] and asset not in self._stale:
                continue
            for _ in range(0, max(len(rows), 1), AT_ONCE):
                part = [rows.popleft() for _ in range(min(len(rows), AT_ONCE))]
                counts, self._counts[asset] = self._counts[asset], Counter()
                block = block_of_rows(part) if part else no_rows(self._subscribers[asset])
                yield Arrivals(
                    asset=asset,
                    rows=block,
                    arrived=time.time(),
                    counts=dict(+counts),
                    stale=self._stale.pop(asset, None),
                )


def connected(subscriber: Subscriber) -> Arrivals:
    """Give what says that a source has its other side, and nothing more."""
    return Arrivals(asset=subscriber.asset, rows=no_rows(subscriber), arrived=time.time())


def no_rows(subscriber: Subscriber) -> RowBlock:
    """Give a block without a row, for what there is to count only."""
    columns = subscriber.columns
    return RowBlock(
        time=np.zeros(0),
        u=np.zeros((0, len(columns.inputs))),
        y=np.zeros((0, len(columns.outputs))),
        saturated=np.zeros(0, dtype=np.intp),
        line=np.zeros(0, dtype=np.intp),
    )
