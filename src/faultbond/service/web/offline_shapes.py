"""The answers of the off-line desk and what is sent to it, as the description of the interface shows them."""

from typing import Annotated, Literal, Self

from pydantic import BaseModel, ConfigDict, Field, model_validator

from faultbond.service.web.shapes import Finite, Readable, Shape

FileNumber = Annotated[str, Field(pattern="^[0-9a-f]{16}$")]
MOST_TABLES = 10  # of a model
VerdictWord = Literal["", "fault", "healthy", "none"]  # empty: it did not come so far
StateWord = Literal["waiting", "at work", "done", "failed", "stopped", "cut off"]


class FileShape(Shape):
    """A file that was brought. size: bytes. at: Unix s."""

    id: FileNumber
    name: str
    kind: Literal["recording", "model", "table"]
    size: int
    sha256: str
    who: str
    at: float


class ExplanationShape(Shape):
    """A candidate of the last diagnosis. group: it is the best, or cannot be told from it."""

    names: list[str]
    components: list[str]
    kind: str
    probability: float
    percent: str
    group: bool
    change: str


class JobShape(Shape):
    """An analysis.

    at, began, ended: Unix s. asset: whose model it takes; empty where one was brought. model: name of its file.
    recording: name of it in messages; files[0] has the name under which it was brought. place: in the queue, from 1.
    share: of the recording that was read, null where that is not known. said: a sentence on what came of it, or why
    nothing did. verdict: empty where it did not come so far. results: what there is to be had.
    """

    id: FileNumber
    who: str
    at: float
    asset: str
    model: str
    recording: str
    files: list[FileShape]
    analyse: bool
    state: StateWord
    place: int | None
    share: Finite
    began: Finite
    ended: Finite
    said: str
    verdict: VerdictWord
    candidates: list[ExplanationShape]
    remarks: list[str]
    results: list[Literal["report", "records", "analysis"]]


class LimitsShape(Shape):
    """What an analysis may take.

    upload, memory: bytes. seconds: by the clock. queue: that wait. jobs, days: that are kept, and for how long.
    parquet: whether a recording may be that.
    """

    upload: int
    seconds: float
    memory: int
    queue: int
    jobs: int
    days: float
    parquet: bool


class OfflineShape(Shape):
    """All of the off-line desk; assets: whose models may be taken; jobs: the newest first. now: Unix s."""

    now: float
    limits: LimitsShape
    assets: list[str]
    jobs: list[JobShape]


class OrderShape(BaseModel):
    """What is to be analysed, by the model of an asset or one that was brought, with its tables; files by `id`."""

    model_config = ConfigDict(extra="forbid")
    recording: FileNumber
    asset: Annotated[Readable, Field(max_length=200)] | None = None
    model: FileNumber | None = None
    tables: list[FileNumber] = Field(default=[], max_length=MOST_TABLES)
    analyse: bool = False

    @model_validator(mode="after")
    def complete(self) -> Self:
        """Refuse an order without a model, and one with two.

        Raises
        ------
        ValueError
            Where it is one of these.
        """
        if bool(self.asset) == bool(self.model):
            raise ValueError("an analysis takes the model of an `asset`, or a `model` that was brought")
        if self.tables and not self.model:
            raise ValueError("`tables` belong to a `model` that was brought")
        return self
