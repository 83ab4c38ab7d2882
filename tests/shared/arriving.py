"""What comes of a source, gathered for tests."""

import asyncio
from collections import Counter
from collections.abc import AsyncGenerator, AsyncIterator, Callable, Mapping, Sequence
from contextlib import aclosing, asynccontextmanager
from dataclasses import dataclass, field
from functools import cache

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.io.examples import example
from faultbond.io.recording import Column, Columns, columns_of
from faultbond.io.row_block import RowBlock
from faultbond.model.graph import BondGraph, TimeColumn, Unit
from faultbond.model.text import load_model
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import LiveSource, Subscriber

WAITS = 60.0  # s for what comes at once where the machine has nothing else to do
COLUMNS = Columns(
    time=TimeColumn(),
    inputs=(Column(header="u", unit=Unit("percent"), role="input u", lower=0.0, upper=100.0),),
    outputs=(
        Column(header="y", unit=Unit("kPa", 1000.0), role="sensor y"),
        Column(header="z", unit=Unit("degC", 1.0, 273.15), role="sensor z"),
    ),
    sample_time=1.0,
)


@cache
def tank() -> BondGraph:
    """Give the built-in tank."""
    return load_model(example("tank") / "model.yaml")


def subscriber(asset: str = "one", columns: Columns = COLUMNS) -> Subscriber:
    """Give an asset that reads these columns; its model is the tank."""
    return Subscriber(asset=asset, columns=columns, graph=tank())


def tank_subscriber(asset: str = "tank") -> Subscriber:
    """Give the built-in tank as an asset."""
    graph = tank()
    return Subscriber(asset=asset, columns=columns_of(graph), graph=graph)


@dataclass
class Gathered:
    """All arrivals, in order."""

    arrivals: list[Arrivals] = field(default_factory=list)

    def of(self, asset: str) -> list[Arrivals]:
        """Give those of an asset."""
        return [item for item in self.arrivals if item.asset == asset]

    def rows(self, asset: str = "one") -> FloatArray:
        """Give time, inputs and outputs of all rows of an asset, (n, 1 + n_inputs + n_outputs)."""
        return np.concatenate([table(item.rows) for item in self.of(asset)])

    def counts(self, asset: str = "one") -> dict[str, int]:
        """Give all that was counted of an asset."""
        found: Counter[str] = Counter()
        for item in self.of(asset):
            found.update(item.counts)
        return dict(found)

    @property
    def cursors(self) -> dict[str, str]:
        """Where the source stands for each asset."""
        return {item.asset: item.cursor for item in self.arrivals}


def table(rows: RowBlock) -> FloatArray:
    """Give rows as one array."""
    return np.column_stack([rows.time, rows.u, rows.y])


async def gather(
    source: LiveSource,
    enough: Callable[[Gathered], bool] = lambda found: False,
    cursors: Mapping[str, str] | None = None,
    into: Gathered | None = None,
) -> Gathered:
    """Take what comes until it is enough, or the source ends."""
    found = Gathered() if into is None else into
    async with aclosing(source.arrivals(cursors or {})) as arrivals:
        async for item in arrivals:
            found.arrivals.append(item)
            if enough(found):
                break
    return found


@asynccontextmanager
async def listening(
    source: LiveSource, enough: Callable[[Gathered], bool] = lambda found: False, into: Gathered | None = None
) -> AsyncIterator[asyncio.Task[Gathered]]:
    """Gather meanwhile, once the source has its other side; the task ends when it is enough, or the source fails."""
    found = Gathered() if into is None else into
    before = len(found.arrivals)
    task = asyncio.create_task(gather(source, enough, into=found))
    try:
        while len(found.arrivals) == before and not task.done():
            await asyncio.sleep(0.005)
        yield task
    finally:
        task.cancel()


class Announced:
    """A source that says when it first has its other side.

    Parameters
    ----------
    source : what it is
    """

    def __init__(self, source: LiveSource) -> None:
        self._source, self.is_connected = source, asyncio.Event()

    @property
    def address(self) -> str:
        """See `LiveSource`."""
        return self._source.address

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """See `LiveSource`."""
        async with aclosing(self._source.arrivals(cursors)) as arrivals:
            async for item in arrivals:
                self.is_connected.set()
                yield item


def gathered(
    source: LiveSource,
    enough: Callable[[Gathered], bool] = lambda found: False,
    cursors: Mapping[str, str] | None = None,
    seconds: float = WAITS,
) -> Gathered:
    """Do so in a loop of its own, within some time."""

    async def limited() -> Gathered:
        return await asyncio.wait_for(gather(source, enough, cursors), seconds)

    return asyncio.run(limited())


def n_rows(number: int, asset: str = "one") -> Callable[[Gathered], bool]:
    """Give what tells whether so many rows of an asset have come."""
    return lambda found: sum(len(item.rows) for item in found.of(asset)) >= number


def text_of(rows: Sequence[Sequence[object]], header: str = "time,u,y,z") -> str:
    """Give CSV text."""
    return "\n".join([header, *(",".join(map(str, row)) for row in rows)]) + "\n"
