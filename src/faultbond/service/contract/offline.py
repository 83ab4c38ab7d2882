"""What the page asks of the off-line desk: files that people bring, and analyses of them, one after the other.

Objects are plain JSON as in `face`; times are Unix seconds.
"""

from collections.abc import AsyncIterator, Sequence
from dataclasses import dataclass
from enum import Enum
from pathlib import Path
from typing import Protocol

from faultbond.errors import FaultbondError
from faultbond.service.contract.face import Shown


class FileKind(Enum):
    """What a file is brought as; the value is the word of the interface."""

    RECORDING = "recording"
    MODEL = "model"
    TABLE = "table"


class JobResult(Enum):
    """What an analysis leaves; the value is the word of the interface."""

    REPORT = "report"
    RECORDS = "records"
    ANALYSIS = "analysis"


class LargeFileError(FaultbondError):
    """A file is larger than files may be."""


class WrongKindError(FaultbondError):
    """A file is none of its kind by its name."""


class TooSlowError(FaultbondError):
    """A file does not come on."""


class TooManyError(FaultbondError):
    """It is too much at a time. seconds: after which to try again."""

    def __init__(self, message: str, seconds: float) -> None:
        super().__init__(message)
        self.seconds = seconds


@dataclass(frozen=True, slots=True, kw_only=True)
class JobOrder:
    """What is to be analysed. asset: whose model; empty: `model`, with its `tables`. All files by their ids."""

    who: str
    recording: str
    asset: str = ""
    model: str = ""
    tables: Sequence[str] = ()
    analyse: bool = False


class Desk(Protocol):
    """Takes files and orders. It never touches what watches the plants.

    A file: `id`, `name`, `kind`, `size`, `sha256`, `who`, `at`. A job: `id`, `who`, `at`, `model` (name of its file),
    `asset`, `recording` (name in the job's folder), `files` (a list of files), `analyse`, `state` (a value of
    `job.JobState`), `place` (in the queue, from 1; None), `began`, `ended`, `share` (of the recording that was read,
    None where that is not known), `said`, `verdict` (`fault`, `healthy`, `none` or empty), `candidates`, `remarks`,
    `results` (values of `JobResult`).
    """

    def shown(self) -> Shown:
        """Give `limits`, `assets` (names), and `jobs`, the newest first."""

    def job(self, job: str) -> Shown:
        """Give a job. Raises KeyError where there is none."""

    async def take(self, name: str, kind: FileKind, who: str, content: AsyncIterator[bytes]) -> Shown:
        """Take a file; it is on the disk, and noted, when this returns.

        Raises
        ------
        WrongKindError
            Where its name is none of such a file.
        LargeFileError
            Where there is more of it than may be; no more than that is read.
        TooSlowError
            Where it does not come on.
        TooManyError
            Where too many files came of late, or come now.
        FaultbondError
            Where there is no room.
        StoreError
            Where it cannot be noted.
        """

    async def order(self, order: JobOrder) -> Shown:
        """Let an analysis wait for its turn; it is on the disk, and noted, when this returns.

        Raises
        ------
        KeyError
            Where there is no such file of this person, or no such asset.
        TooManyError
            Where as many wait as may.
        FaultbondError
            Where the files do not belong together.
        StoreError
            Where it cannot be noted.
        """

    async def remove(self, job: str, who: str) -> None:
        """Stop a job where it is at work, and remove it with all its files. Raises KeyError and StoreError."""

    def result(self, job: str, what: JobResult) -> Path:
        """Give the file of a result. Raises KeyError where there is none."""
