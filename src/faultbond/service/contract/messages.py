"""What the parts of the service pass on to each other. Frozen data; times are Unix seconds, values SI."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum, IntEnum
from types import MappingProxyType
from typing import Any

from faultbond.arrays import FloatArray
from faultbond.contract.json_records import Record
from faultbond.io.row_block import RowBlock

LONGEST_SHELF = 24 * 3600.0  # s that an alarm is shelved; who wants more takes it out of service
NOTHING: Mapping[str, int] = MappingProxyType({})


class Ne107(IntEnum):
    """Status of an asset or component, by NAMUR NE 107, as OPC UA for devices numbers it."""

    NORMAL = 0
    FAILURE = 1
    CHECK_FUNCTION = 2
    OFF_SPEC = 3
    MAINTENANCE_REQUIRED = 4


class Monitoring(Enum):
    """Whether an asset is being watched, beside its status: no data is never normal."""

    INITIALISING = "initialising"
    RUNNING = "running"
    NO_DATA = "no data"
    STOPPED = "stopped"


class Action(Enum):
    """What a person does; the value is the word in the journal and in the interface of the page."""

    ACKNOWLEDGE = "acknowledge"
    SHELVE = "shelve"
    UNSHELVE = "unshelve"
    SUPPRESS = "suppress"
    UNSUPPRESS = "unsuppress"
    OUT_OF_SERVICE = "out of service"
    IN_SERVICE = "in service"
    ACCEPT = "accept"
    REJECT = "reject"
    REPAIRED = "repaired"
    UNDO = "undo"


DECISIONS = frozenset({Action.ACCEPT, Action.REJECT, Action.REPAIRED})  # they change what the filters believe


@dataclass(frozen=True, slots=True, kw_only=True)
class Deed:
    """What a person did.

    at: when, by the clock of the service. rows: of the asset's log that were before it. target: names of the suspects
    of a candidate, of a decision. until: when shelving ends. undone: number of the deed that an `undo` takes back.
    number: of the deed in the store, from 1; 0 before it is there.
    """

    asset: str
    action: Action
    at: float
    who: str
    rows: int
    comment: str = ""
    target: tuple[str, ...] = ()
    until: float | None = None
    undone: int | None = None
    number: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class AuditEntry:
    """What a person did that is about no asset, or what was refused.

    at: when, by the clock of the service. who: by the name that was given. what: of it, in a word or two. about: plain
    JSON by name, such as the name, size and SHA-256 of a file. number: of the entry in the store, from 1; 0 before it
    is there.
    """

    at: float
    who: str
    what: str
    about: Mapping[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    number: int = 0


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Arrivals:
    """Rows of one asset that came together, in the order of arrival.

    arrived: when, s since 1970, unless the rows tell it of each. cursor: where the source stands behind them, a text
    that it understands when it begins again; empty where it cannot go back. counts: what else came since the arrivals
    before and is not in `rows`, by name: `dropped` (the queue was full), `bad` and `uncertain` (values by quality,
    of which a bad one is nan in its row). stale: why all values of the asset are of the past though its source works, a
    sentence; empty: they are of now; None: as before.
    """

    asset: str
    rows: RowBlock
    arrived: float
    cursor: str = ""
    counts: Mapping[str, int] = field(default_factory=lambda: NOTHING)
    stale: str | None = None

    def __bool__(self) -> bool:
        """Whether there is something in them."""
        return bool(len(self.rows) or self.counts) or self.stale is not None


@dataclass(frozen=True, slots=True, kw_only=True)
class NamedRecord:
    """A record, as `run` writes it, with a name of its own: the same sample gives the same name, however often.

    id: asset, model, grid point and kind. sample: grid point. time: of the recording's clock.
    """

    id: str
    asset: str
    sample: int
    time: float
    kind: str
    content: Record

    def told(self) -> Record:
        """Give it as others are told: with its asset and name."""
        return {"record": self.kind, "asset": self.asset, "id": self.id, **self.content}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Curves:
    """What is drawn of grid points: time (n,), inputs (n, n_inputs), all others (n, n_outputs); SI, nan where none."""

    time: FloatArray
    inputs: FloatArray
    measured: FloatArray
    expected: FloatArray
    sd: FloatArray
    cusum: FloatArray

    def __len__(self) -> int:
        return len(self.time)
