"""What a source of live values offers."""

from collections.abc import AsyncGenerator, Mapping
from dataclasses import dataclass
from typing import Protocol

from faultbond.io.recording import Columns
from faultbond.model.graph import BondGraph
from faultbond.service.contract.messages import Arrivals


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Subscriber:
    """An asset that a source feeds. columns: what is read for it, with units. graph: its model."""

    asset: str
    columns: Columns
    graph: BondGraph


class LiveSource(Protocol):
    """Gives arrivals until it ends or is cancelled. It is opened by `arrivals`, and closes what it opened.

    A source that loses its other side says so by `SourceError`; who runs it begins again, behind the cursors of what
    has come. Arrivals with nothing in them say that it has its other side again. Nothing here writes into the plant.
    """

    @property
    def address(self) -> str:
        """What the user called it, without secrets."""

    def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give what comes, from behind these cursors by asset; an asset without one is begun."""
