"""What a store offers. The log of an asset, rows and deeds in their order, is the truth; all else follows from it.

A checkpoint is the state behind a number of rows. After a stop the asset is restored from the last one, and the rows
and decisions behind it pass once more: the same input gives the same records, of the same names.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Protocol

from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import AuditEntry, Curves, Deed, NamedRecord


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Commit:
    """What came of some arrivals of an asset, or of a deed; written all or not at all.

    rows, arrived, cursor: see `Arrivals`; None: there were none. curves, records: what the asset made of them.
    deeds: what people did, behind the rows. checkpoint: the state behind all of that; None: none was made.
    """

    asset: str
    rows: RowBlock | None = None
    arrived: float = 0.0
    cursor: str = ""
    curves: Curves | None = None
    records: tuple[NamedRecord, ...] = ()
    deeds: tuple[Deed, ...] = ()
    checkpoint: bytes | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class LogPlace:
    """Where an asset's log stands.

    rows: that it has. cursor: of the last arrivals. checkpoint: the newest, behind `checkpoint_rows` rows and
    `checkpoint_deeds` deeds; None where there is none.
    """

    rows: int = 0
    cursor: str = ""
    checkpoint: bytes | None = None
    checkpoint_rows: int = 0
    checkpoint_deeds: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class Enrolment:
    """An asset as the store knows it. n_inputs, n_outputs: of its model, by which rows and curves are read."""

    asset: str
    model_sha256: str
    label: str
    text: str
    n_inputs: int
    n_outputs: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Forgotten:
    """What a call let go. rows: of logs. points: of curves. is_any: whether anything went, so that more may be left.

    diagnoses: those of rows that are forgotten, but for the last of each alarm.
    """

    rows: int = 0
    points: int = 0
    diagnoses: int = 0

    @property
    def is_any(self) -> bool:
        """Whether anything went."""
        return self.rows + self.points + self.diagnoses > 0


class LogStore(Protocol):
    """Keeps logs, records and checkpoints. Calls come from one thread at a time.

    Every method raises `StoreError` where the store cannot be read or written, in words that name it and what to do.
    What `commit` was given is safe when it returns, and a record is kept once however often it is given.
    """

    def enrol(self, enrolment: Enrolment) -> LogPlace:
        """Make an asset known and tell where its log stands.

        One of another model has another log; the old one is kept, and goes on where its model comes back, so that a
        grid point of an asset and a model is there once.
        """

    def commit(self, parts: Sequence[Commit]) -> None:
        """Write what came of some arrivals and deeds, all or nothing; on the disk when this returns.

        Who tries again gives the same parts: a store that could not hear whether they were written then finds out.
        """

    def log_after(self, asset: str, rows: int, deeds: int) -> Iterator[RowBlock | Deed]:
        """Give rows and deeds of the log behind so many of each, in their order.

        Raises
        ------
        ForgottenError
            Where rows among them are forgotten: what is passed again must be whole.
        """

    def log_between(
        self, asset: str, begin: float | None = None, end: float | None = None, model_sha256: str | None = None
    ) -> Iterator[RowBlock | Deed]:
        """Give what is kept of a log in a period of its rows' clock, in its order; a deed is at the last row before it.

        model_sha256: of which model the log is; None: of that with which the asset was enrolled last.
        """

    def enrolments(self, asset: str | None = None) -> Iterator[Enrolment]:
        """Give what was enrolled, that which was enrolled last at the end."""

    def journal(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord | Deed]:
        """Give records and deeds in the order in which they came, of a period as in `log_between`.

        kinds: of records; none: all. newest: only so many of the records, and so many of the deeds.
        """

    def records(
        self,
        asset: str | None = None,
        *,
        kinds: Sequence[str] = (),
        begin: float | None = None,
        end: float | None = None,
        newest: int | None = None,
    ) -> Iterator[NamedRecord]:
        """Give records in the order in which they came, of a period of their clock; `newest`: only so many."""

    def deeds(self, asset: str | None = None, *, newest: int | None = None) -> Iterator[Deed]:
        """Give what people did, in order; `newest`: only so many."""

    def note(self, entry: AuditEntry) -> None:
        """Write what a person did that is about no asset; on the disk when this returns.

        Who tries again gives the same entry, which is then written once.
        """

    def audit(self) -> Iterator[AuditEntry]:
        """Give what was noted, in order."""

    def reader(self, name: str) -> tuple[int, int]:
        """Make a reader of records known; give behind which of them it stands, and which is the newest.

        Records are numbered in the order in which they came. A reader that was not known stands behind the newest.
        """

    def records_behind(self, number: int, most: int) -> list[tuple[int, NamedRecord]]:
        """Give the first so many records behind that of a number, each with its own."""

    def advance(self, name: str, number: int) -> None:
        """Let a reader stand behind the record of a number; on the disk when this returns."""

    def curves(
        self, asset: str, begin: float | None = None, end: float | None = None, most: int | None = None
    ) -> Curves | None:
        """Give curves of a period, None where there are none; of more than `most` points those that show all peaks."""

    def retain(self, *, older_than: float | None = None, at_most: int | None = None) -> Forgotten:
        """Forget rows and curves, and diagnoses of rows that are forgotten, but the last of each alarm; give what went.

        Those go that arrived before a time, and the oldest of a store that has more than `at_most` bytes, until it is
        a little smaller than that. What the newest checkpoint needs stays. Where much has to go, a call lets some of it
        go; who asks again until none goes lets others have the store in between.
        """

    def reserve(self) -> str:
        """Have again what room is kept for when the disk is full.

        Gives a line that says what is wrong where it cannot be had, though the store can be written; else empty.
        """

    def close(self) -> None:
        """Close it."""
