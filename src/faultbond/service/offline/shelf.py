"""The folder of the off-line desk: what was brought and waits to be used, and a folder for each job.

All names in it are ours, but those of tables, which a model names and which are plain words: see `TABLE`.
"""

import json
import logging
import os
import re
import secrets
import shutil
from collections.abc import Callable, Iterator
from contextlib import suppress
from pathlib import Path

from faultbond.errors import FaultbondError
from faultbond.io.files import replaced_text
from faultbond.service.contract.offline import FileKind, WrongKindError
from faultbond.service.offline.job import BroughtFile, Job

ENDINGS = {
    FileKind.RECORDING: (".csv", ".parquet", ".pq"),
    FileKind.MODEL: (".yaml", ".yml"),
    FileKind.TABLE: (".csv",),
}
TABLE = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_ .-]{0,99}\.csv")
NUMBER = re.compile(r"[0-9a-f]{16}")
MODEL = "model.yaml"
ABOUT, CONTENT = "about.json", "content"
_OURS_ONLY = 0o700
_LOG = logging.getLogger(__name__)


def ending_of(name: str, kind: FileKind) -> str:
    """Give the ending of a file's name, which says what is in it.

    Raises
    ------
    WrongKindError
        Where it is none of its kind, or a table has a name that is no plain one.
    """
    found = next((item for item in ENDINGS[kind] if name.lower().endswith(item)), None)
    if found is None:
        raise WrongKindError(f"A {kind.value} is a file that ends in {' or '.join(ENDINGS[kind])}.")
    if kind is FileKind.TABLE and not TABLE.fullmatch(name):
        raise WrongKindError(
            "The name of a table is plain: letters, digits, spaces, `_`, `.` and `-`, 100 at most, then .csv."
        )
    return found


class Shelf:
    """The folder.

    Parameters
    ----------
    folder : made when it is first needed
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder

    def make(self) -> None:
        """Make it, for this user alone.

        Raises
        ------
        FaultbondError
            Where that cannot be.
        """
        try:
            for item in (self._folder, self._files, self._jobs, self._folder / "cache"):
                item.mkdir(mode=_OURS_ONLY, parents=item == self._folder, exist_ok=True)
        except OSError as error:
            raise FaultbondError(
                f"{self._folder}: it cannot be made: {error.strerror or error}. Name another `folder` under `offline`."
            ) from error

    @property
    def _files(self) -> Path:
        return self._folder / "files"

    @property
    def _jobs(self) -> Path:
        return self._folder / "jobs"

    def used(self) -> int:
        """Give how many bytes are in it, what was compiled not counted."""
        sizes = 0
        for top in (self._files, self._jobs):
            for folder, _, names in os.walk(top):  # which passes over what vanishes meanwhile
                for name in names:
                    with suppress(OSError):
                        sizes += Path(folder, name).lstat().st_size
        return sizes

    # Files

    def begin_file(self) -> tuple[str, Path]:
        """Give a number for a new file, and where its content goes."""
        number = secrets.token_hex(8)
        (self._files / number).mkdir(mode=_OURS_ONLY)
        return number, self._files / number / CONTENT

    def keep_file(self, file: BroughtFile) -> None:
        """Keep what is known of a file whose content is there."""
        with replaced_text(self._files / file.id / ABOUT) as stream:
            json.dump(file.shown(), stream)

    def file(self, number: str) -> BroughtFile:
        """Give a file that no job has taken.

        Raises
        ------
        KeyError
            Where there is none.
        """
        if NUMBER.fullmatch(number):
            with suppress(OSError, ValueError):
                return BroughtFile.of(json.loads((self._files / number / ABOUT).read_text(encoding="utf-8")))
        raise KeyError(number)

    def n_files(self) -> int:
        """Give how many files no job has taken."""
        return sum(1 for _ in self._numbered(self._files))

    def remove_file(self, number: str) -> None:
        """Remove a file."""
        shutil.rmtree(self._files / number, ignore_errors=True)

    def remove_files_before(self, at: float) -> None:
        """Remove files that have lain about since before a time."""
        with suppress(OSError):  # the folder cannot be read
            for item in self._numbered(self._files):
                with suppress(OSError):
                    if item.stat().st_mtime < at:
                        self.remove_file(item.name)

    # Jobs

    def place(self, job: str) -> Path:
        """Give the folder in which a job works; what it reads is there."""
        return self._jobs / job / "in"

    def out(self, job: str) -> Path:
        """Give the folder for what a job writes."""
        return self._jobs / job / "out"

    def begin_job(self, job: Job, given: Callable[[Path], None]) -> None:
        """Make a job's folder with its files, which are then no others'; all of it or nothing.

        given: writes what is not brought.
        """
        draft = self._jobs / f".{job.id}"
        try:
            for item in (draft, draft / "in", draft / "out", draft / "tmp"):
                item.mkdir(mode=_OURS_ONLY)
            given(draft / "in")
            for file in job.files:
                _put(self._files / file.id / CONTENT, draft / "in" / name_in_job(file, job))
            (draft / ABOUT).write_text(job.text(), encoding="utf-8")
            draft.rename(self._jobs / job.id)
        except BaseException:
            shutil.rmtree(draft, ignore_errors=True)
            raise
        for file in job.files:
            self.remove_file(file.id)

    def keep_job(self, job: Job) -> None:
        """Keep how a job stands."""
        with suppress(FileNotFoundError), replaced_text(self._jobs / job.id / ABOUT) as stream:  # it was removed
            stream.write(job.text())

    def jobs(self) -> Iterator[Job]:
        """Give all jobs, in the order in which they came.

        What is half made, or known to be damaged, is removed; what only cannot be read now is told and left.
        """
        found, items = [], []
        try:
            items = list(self._jobs.iterdir())
        except FileNotFoundError:
            pass  # nobody ordered anything yet
        except OSError as error:
            _LOG.warning("%s: the analyses in it cannot be read: %s", self._jobs, error.strerror or error)
        for item in items:
            try:
                job = Job.of((item / ABOUT).read_text(encoding="utf-8"))
                if job.id != item.name or not NUMBER.fullmatch(item.name):
                    raise ValueError(f"it is of {job.id}")
                found.append(job)
            except (FileNotFoundError, ValueError) as error:
                if not item.name.startswith("."):
                    _LOG.warning("%s: this job cannot be read any more (%s), and is removed.", item, error)
                shutil.rmtree(item, ignore_errors=True)
            except OSError as error:  # such as too many open files
                _LOG.warning("%s: this job cannot be read now: %s. It is left as it is.", item, error.strerror or error)
        return iter(sorted(found, key=lambda job: (job.at, job.id)))

    def clear(self, job: str) -> None:
        """Remove what a job needed only while it was at work."""
        shutil.rmtree(self._jobs / job / "tmp", ignore_errors=True)

    def remove_job(self, job: str) -> None:
        """Remove a job with all its files."""
        shutil.rmtree(self._jobs / job, ignore_errors=True)

    @staticmethod
    def _numbered(folder: Path) -> Iterator[Path]:
        return (item for item in folder.iterdir() if NUMBER.fullmatch(item.name)) if folder.is_dir() else iter(())


def _put(file: Path, place: Path) -> None:
    """Let a file be at a second place, too, so that nothing is lost where that fails halfway."""
    try:
        os.link(file, place)
    except OSError:  # there are file systems without links
        shutil.copyfile(file, place)


def name_in_job(file: BroughtFile, job: Job) -> str:
    """Give the name of a file in its job's folder: ours, but of tables."""
    match file.kind:
        case FileKind.RECORDING:
            return job.recording
        case FileKind.MODEL:
            return MODEL
        case FileKind.TABLE:
            return file.name
