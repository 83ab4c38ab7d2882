"""What the page asks of the service: all in names and units of the model file, ready to be shown.

Objects are plain JSON (dict, list, str, float, None where not finite). Times are Unix seconds or, of samples, those of
the recording's clock. docs/service.md lists the keys and which of them are stable.
"""

from collections.abc import AsyncIterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

from faultbond.service.contract.messages import Action, AuditEntry

Shown = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Request:
    """What a person wants done. minutes: how long to shelve. undone: number of the deed to take back."""

    asset: str
    action: Action
    who: str
    comment: str = ""
    target: Sequence[str] = ()
    minutes: float | None = None
    undone: int | None = None


class Face(Protocol):
    """The service as the page sees it.

    A summary of an asset: `name`, `model`, `status` (a name of `Ne107`), `status_code`, `monitoring` (a value of
    `Monitoring`), `headline` (a sentence), `since` (of the status, Unix s), `time` (of the last sample), `samples`,
    `operation` (`alarms on`, `waiting`, `outside`), `alarm` (None or `state`, `since`, `acknowledged_by`,
    `shelved_until`, `signals`, and of samples `time`, at which it was raised, and `change_time`), `best` (None or
    `names`, `probability`, `components`, and `parameters` as in a record, SI).

    An asset: `summary`, `drawing` (SVG whose groups carry `data-name`), `picture` (what tells the picture of the
    process from another one, empty where there is none), `suspicion` (probability by component),
    `signals` (list of `name`, `role` sensor or input, `unit`, `in_use`), `cusum_limit`, `verdict` (sentences), `rows`
    (candidates: `suspects` as a list of `name`, `component`, `nominal`, `estimate`, `sd`, `change` as texts with units;
    `kinds`, a list of texts, `probability`, `percent`, `group`), `several` (whether they cannot be told apart),
    `checks` (list of `what`, `why`), `notes`, `events` (newest first: `time`, `text`, `alarm`, `behind`), `ranking`
    (probability over time of the candidates: `time`, `names`, and `probability`, for each name a list as long as
    `time`), `counts` (by name), `journal` (newest first: `number`, `at`, `who`, `action`, `comment`, `target`,
    `undone_by`), `may` (the actions that make sense now).

    Curves: `time`, `inputs`, `measured`, `expected`, `sd`, `cusum`; all but the first and last two by signal, in its
    unit; `sd`, `cusum` by sensor.
    """

    def site(self) -> Shown:
        """Give `name`, `version`, `now`, `source`, `assets`, a list of summaries, and `troubles`.

        These are sentences that say what does not work of the service itself, such as its store; what is wrong with
        the source of an asset stands in its summary.
        """

    def asset(self, name: str) -> Shown:
        """Give an asset. Raises KeyError where there is none of that name, and StoreError."""

    def picture(self, name: str) -> str:
        """Give the picture of the process, SVG whose groups carry `data-component`; empty where there is none.

        Raises KeyError where there is no asset of that name.
        """

    def curves(self, name: str, begin: float | None, end: float | None, most: int) -> Shown:
        """Give curves of an asset, the newest where no period is given. Raises KeyError and StoreError."""

    def health(self) -> Mapping[str, Any]:
        """Give `ok`, and by part of the service whether it runs, and since when it does not."""

    def metrics(self, viewers: int) -> str:
        """Give what is measured, as OpenMetrics has it, with how many pages are open; asked in a thread."""

    async def do(self, request: Request) -> Shown:
        """Do what a person wants; it is on the disk when this returns. Gives the entry of the journal.

        Raises
        ------
        KeyError
            Where there is no such asset.
        FaultbondError
            Where it cannot be done now, in words for the person.
        StoreError
            Where it cannot be kept.
        """

    async def note(self, entry: AuditEntry) -> None:
        """Keep what a person did that is about no asset; it is on the disk when this returns. Raises StoreError."""

    def report(self, name: str) -> str:
        """Give the report of what the asset saw lately, a page of HTML. Raises KeyError."""

    def listen(self, most: int = 100) -> AsyncIterator[tuple[str, Shown]]:
        """Give what happens from now on, each with its name.

        They are `summary`, a summary; `samples`, curves of new points with the key `asset`; `asset`, an asset whose
        diagnosis, alarm or journal changed; and `service`, with `troubles` as in `site` once they are others. Who does
        not take `most` of them in time is cut off: the iterator ends, and it may listen anew.
        """
