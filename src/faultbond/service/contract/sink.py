"""What a sink offers, by which a service tells others what it finds."""

from contextlib import AbstractAsyncContextManager
from typing import Protocol

from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord


class Link(Protocol):
    """The open way to the other side of a sink. Where that is lost all of it raises `SinkError`."""

    async def show(self, summary: Shown) -> None:
        """Tell how an asset stands now; see `face.Face` for the keys."""

    async def pass_on(self, record: NamedRecord) -> None:
        """Tell a record; the other side has it when this returns. It may come again, and is the same then.

        Raises
        ------
        RefusedError
            Where the other side is there and does not take this record.
        """

    async def lost(self) -> None:
        """Wait until the other side is lost; never return where that cannot be known."""


class Sink(Protocol):
    """Tells others. It is opened by `opened`, and closes what it opened; nothing of it writes into the plant.

    name: what the site calls it; its place among the records is kept by that. kinds: of records that it is given.
    shows: whether it wants to know how assets stand. give_up: s without success after which a record is passed over.
    """

    @property
    def name(self) -> str:
        """What the site calls it."""

    @property
    def address(self) -> str:
        """Where it tells, without secrets."""

    @property
    def kinds(self) -> frozenset[str]:
        """Kinds of the records that it is given."""

    @property
    def shows(self) -> bool:
        """Whether it is told how assets stand."""

    @property
    def give_up(self) -> float | None:
        """For how long a record is tried, s; None: for ever."""

    def opened(self) -> AbstractAsyncContextManager[Link]:
        """Open it; raises `SinkError` where that fails."""
