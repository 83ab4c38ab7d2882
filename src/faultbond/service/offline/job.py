"""A file that was brought, and a job that is made of files, as they are kept beside them."""

import json
from collections.abc import Mapping
from dataclasses import asdict, dataclass, replace
from enum import Enum
from typing import Any, Self

from faultbond.service.contract.offline import FileKind, JobResult


class JobState(Enum):
    """How a job stands; the value is the word of the interface."""

    WAITING = "waiting"
    RUNNING = "at work"
    DONE = "done"
    FAILED = "failed"
    STOPPED = "stopped"
    CUT_OFF = "cut off"


ENDED = frozenset({JobState.DONE, JobState.FAILED, JobState.STOPPED, JobState.CUT_OFF})


@dataclass(frozen=True, slots=True, kw_only=True)
class BroughtFile:
    """A file. name: by which its owner knows it, for people alone. who: brought it. at: when, Unix s."""

    id: str
    name: str
    kind: FileKind
    size: int
    sha256: str
    who: str
    at: float

    def shown(self) -> dict[str, Any]:
        """Give it as JSON."""
        return asdict(self) | {"kind": self.kind.value}

    @classmethod
    def of(cls, told: Mapping[str, Any]) -> Self:
        """Give it from what `shown` gave."""
        return cls(**{**told, "kind": FileKind(told["kind"])})


@dataclass(frozen=True, slots=True, kw_only=True)
class Job:
    """An analysis.

    asset: whose model it takes; empty where one was brought. model: name of the model file. recording: of the file in
    the job's folder. files: that were brought for it. began, ended: Unix s; None: not yet. said: a sentence on what
    came of it, or why nothing did. verdict: `fault`, `healthy`, `none`; empty where it did not come so far. candidates,
    remarks: see `outcome`.
    """

    id: str
    who: str
    at: float
    asset: str
    model: str
    recording: str
    files: tuple[BroughtFile, ...]
    analyse: bool
    state: JobState = JobState.WAITING
    began: float | None = None
    ended: float | None = None
    said: str = ""
    verdict: str = ""
    candidates: tuple[Mapping[str, Any], ...] = ()
    remarks: tuple[str, ...] = ()
    results: tuple[JobResult, ...] = ()

    def begun(self, at: float) -> "Job":
        """Give it at work."""
        return replace(self, state=JobState.RUNNING, began=at)

    def over(self, at: float, state: JobState, said: str) -> "Job":
        """Give it ended without results."""
        return replace(self, state=state, ended=at, said=said)

    def shown(self) -> dict[str, Any]:
        """Give it as JSON."""
        lists = {name: list(getattr(self, name)) for name in ("candidates", "remarks")}
        told = asdict(self) | lists | {"state": self.state.value, "results": [item.value for item in self.results]}
        return told | {"files": [item.shown() for item in self.files]}

    def text(self) -> str:
        """Give it as it is kept."""
        return json.dumps(self.shown())

    @classmethod
    def of(cls, text: str) -> Self:
        """Give it from what is kept.

        Raises
        ------
        ValueError
            Where it cannot be read.
        """
        try:
            told = json.loads(text)
            told |= {"state": JobState(told["state"]), "results": tuple(JobResult(item) for item in told["results"])}
            told |= {"files": tuple(BroughtFile.of(item) for item in told["files"])}
            return cls(**{**told, **{name: tuple(told[name]) for name in ("candidates", "remarks")}})
        except (KeyError, TypeError) as error:
            raise ValueError(str(error)) from error
