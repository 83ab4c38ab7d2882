"""The answers of the interface and what is sent to it, as the description of it shows them.

Answers come from the service as plain objects in these shapes and go out as they are; tests hold the two together.
Later versions add keys.
"""

import unicodedata
from typing import Annotated, Literal, Self

from pydantic import AfterValidator, BaseModel, ConfigDict, Field, model_validator

from faultbond.service.contract.messages import DECISIONS, LONGEST_SHELF, Action, Ne107

Finite = float | None  # null where a value is missing or not finite
Finites = list[Finite]
StatusWord = Literal["NORMAL", "FAILURE", "CHECK_FUNCTION", "OFF_SPEC", "MAINTENANCE_REQUIRED"]
MonitoringWord = Literal["initialising", "running", "no data", "stopped"]
LONGEST_TEXT = 2000
MOST_TARGETS = 100
LONGEST_SHELVING = LONGEST_SHELF / 60.0  # min


def _readable(text: str) -> str:
    """Refuse what no store keeps and no person reads: control characters, and halves of characters."""
    if any(unicodedata.category(letter) in {"Cc", "Cs"} and letter not in "\n\t" for letter in text):
        raise ValueError("it has control characters")
    return text


Readable = Annotated[str, AfterValidator(_readable)]


class Shape(BaseModel):
    """What all shapes have in common: later versions may add keys to an answer."""

    model_config = ConfigDict(extra="allow")


class RefusalShape(Shape):
    """What every 4xx and 5xx says. error: a sentence for the person."""

    ok: Literal[False]
    error: str
    status: int


class MeShape(Shape):
    """Who asks.

    token: to be sent with every POST and DELETE as `X-Faultbond-Token`. actions: those that the role allows.
    may_analyse: whether it allows the off-line desk, and there is one.
    """

    name: str
    role: Literal["view", "operate", "engineer"]
    token: str
    actions: list[str]
    may_analyse: bool
    can_log_out: bool


class LoginShape(BaseModel):
    """Name and password."""

    model_config = ConfigDict(extra="forbid")
    name: Readable = Field(max_length=200)
    password: str = Field(max_length=1000)


class DoneShape(Shape):
    """That something was done of which there is no more to say."""

    ok: Literal[True]


class HealthShape(Shape):
    """Whether the service is well; to who is logged in also of its parts, how each stands and since when (Unix s)."""

    ok: bool


class AlarmShape(Shape):
    """An alarm. since: of its last change, null where none was ever raised; time, change_time: when raised, and onset.

    These are by the clock of the samples; shelved_until: Unix s.
    """

    state: str
    since: Finite
    acknowledged_by: str | None = None
    shelved_until: Finite = None
    signals: list[str] = []
    time: Finite = None
    change_time: Finite = None


class BestShape(Shape):
    """The likeliest explanation."""

    names: str | list[str]
    probability: float


class SummaryShape(Shape):
    """An asset in a line. status: by NAMUR NE 107, status_code its number. since: of the status, Unix s."""

    name: str
    model: str
    status: StatusWord
    status_code: Annotated[int, Field(ge=min(Ne107), le=max(Ne107))]
    monitoring: MonitoringWord
    headline: str
    since: float
    time: Finite
    samples: int
    operation: str
    alarm: AlarmShape | None
    best: BestShape | None


class SiteShape(Shape):
    """All that is watched. now: Unix s. troubles: what of the service itself does not work, a sentence each."""

    name: str
    version: str
    now: float
    source: str
    assets: list[SummaryShape]
    troubles: list[str]


class SignalShape(Shape):
    """A signal of an asset."""

    name: str
    role: Literal["sensor", "input"]
    unit: str
    in_use: bool


class SuspectShape(Shape):
    """A suspect of a candidate; texts with units of the model file."""

    name: str
    component: str
    nominal: str
    estimate: str
    sd: str = ""
    change: str


class CandidateShape(Shape):
    """A candidate. group: it is the best, or cannot be told from it."""

    suspects: list[SuspectShape]
    kinds: list[str]
    probability: float
    percent: str
    group: bool


class CheckShape(Shape):
    """What to do next, and why."""

    what: str
    why: str


class EventShape(Shape):
    """What happened by itself. time: of samples. alarm: one was raised. behind: number of the entry before."""

    time: Finite
    text: str
    alarm: bool
    behind: int


class RankingShape(Shape):
    """Probability of the candidates over time: for each name a list as long as `time`."""

    time: list[float]
    names: list[str]
    probability: list[Finites]


class EntryShape(Shape):
    """An entry of the journal. at: Unix s. undone_by: number of the deed that took it back."""

    number: int
    at: float
    who: str
    action: str
    comment: str
    target: list[str]
    undone_by: int | None


class AssetShape(Shape):
    """All that is known of an asset. drawing: SVG. suspicion: probability by component. may: what makes sense.

    picture: tells that of the process from another one; empty: there is none.
    """

    summary: SummaryShape
    drawing: str
    picture: str
    suspicion: dict[str, float]
    signals: list[SignalShape]
    cusum_limit: float
    verdict: str | list[str]
    rows: list[CandidateShape]
    several: bool
    checks: list[CheckShape]
    notes: list[str]
    events: list[EventShape]
    ranking: RankingShape
    counts: dict[str, int]
    journal: list[EntryShape]
    may: list[str]


class CurvesShape(Shape):
    """What is drawn over time; by signal, in its unit."""

    time: list[float]
    inputs: dict[str, Finites]
    measured: dict[str, Finites]
    expected: dict[str, Finites]
    sd: dict[str, Finites]
    cusum: dict[str, Finites]


class DeedShape(BaseModel):
    """What a person does.

    target: names of the suspects of a candidate, of accept, reject and repaired. minutes: how long to shelve, needed
    there. undone: number of the deed to take back, needed by undo.
    """

    model_config = ConfigDict(extra="forbid")
    action: Action
    comment: Readable = Field(default="", max_length=LONGEST_TEXT)
    target: list[Annotated[Readable, Field(max_length=200)]] = Field(default=[], max_length=MOST_TARGETS)
    minutes: float | None = Field(default=None, gt=0, le=LONGEST_SHELVING, allow_inf_nan=False)
    undone: int | None = Field(default=None, ge=1, le=2**53)

    @model_validator(mode="after")
    def complete(self) -> Self:
        """Refuse a deed that lacks what it needs, and one with more than that.

        Raises
        ------
        ValueError
            Where it is one of these.
        """
        needs = {
            "minutes": (self.minutes is not None, self.action is Action.SHELVE),
            "target": (bool(self.target), self.action in DECISIONS),
            "undone": (self.undone is not None, self.action is Action.UNDO),
        }
        for name, (is_there, is_needed) in needs.items():
            if is_there != is_needed:
                raise ValueError(f"{self.action.value} {'needs' if is_needed else 'takes no'} `{name}`")
        return self
