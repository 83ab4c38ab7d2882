"""An off-line desk that is none: analyses in all conditions, the same at every start, for tests of the page."""

import shutil
import weakref
from collections.abc import AsyncIterator
from dataclasses import replace
from hashlib import sha256
from pathlib import Path
from tempfile import mkdtemp

from faultbond.errors import FaultbondError, StoreError
from faultbond.service.contract.face import Shown
from faultbond.service.contract.offline import FileKind, JobOrder, JobResult, LargeFileError, TooManyError
from faultbond.service.offline.job import BroughtFile, Job, JobState
from faultbond.service.offline.shelf import ending_of

NOW = 1_795_000_900.0
LARGEST = 5000  # bytes of a file
QUEUE = 5
REPORT = "<!doctype html><html lang=en><title>r</title><script>document.title += '!'</script><h1>No fault found.</h1>"
PIPE = {
    "names": ["K1"],
    "components": ["pipe"],
    "kind": "step",
    "probability": 0.997,
    "percent": "99.7",
    "group": True,
    "change": "+81 %",
}
BIAS = PIPE | {
    "names": ["pressure.bias", "K1"],
    "components": ["pressure", "pipe"],
    "kind": "bias",
    "probability": 0.0007,
    "percent": "<0.1",
    "group": False,
}


def brought(name: str, kind: FileKind = FileKind.RECORDING, *, number: int = 1, who: str = "emma") -> BroughtFile:
    """A file that somebody brought."""
    return BroughtFile(
        id=f"{number:016x}", name=name, kind=kind, size=152_471, sha256="0" * 64, who=who, at=NOW - 3600.0
    )


class FakeDesk:
    """Analyses in all conditions. `is_full` makes deeds fail."""

    def __init__(self) -> None:
        self._folder = Path(mkdtemp(prefix="desk"))
        weakref.finalize(self, shutil.rmtree, self._folder, ignore_errors=True)
        self.is_full = False
        self.files: dict[str, BroughtFile] = {}
        self.ordered: list[JobOrder] = []
        plain = Job(
            id="",
            who="emma",
            at=NOW - 600.0,
            asset="tank_1",
            model="tank.yaml",
            recording="recording.csv",
            files=(brought("plant-2026-11-17.csv"),),
            analyse=False,
        )
        model = (brought("night shift.csv"), brought("pump 7.yaml", FileKind.MODEL), brought("c.csv", FileKind.TABLE))
        jobs = [
            replace(
                plain.begun(NOW - 550.0).over(NOW - 541.0, JobState.DONE, "Most likely the pipe changed: K1 rose."),
                verdict="fault",
                candidates=(PIPE, BIAS),
                remarks=("flow gave no value from 12:02 to 12:04.",),
                results=(JobResult.REPORT, JobResult.RECORDS, JobResult.ANALYSIS),
            ),
            replace(
                plain.begun(NOW - 500.0).over(NOW - 491.0, JobState.DONE, "No fault found."),
                verdict="healthy",
                results=(JobResult.REPORT, JobResult.RECORDS),
            ),
            plain.begun(NOW - 450.0).over(NOW - 449.0, JobState.FAILED, "recording.csv: there is no column `flow`."),
            plain.begun(NOW - 440.0).over(
                NOW - 100.0, JobState.STOPPED, "It took longer than 10 min, and was stopped."
            ),
            plain.begun(NOW - 90.0).over(NOW - 60.0, JobState.CUT_OFF, "It was cut off by a restart of the service."),
            replace(plain.begun(NOW - 12.0), files=model, asset="", model="pump 7.yaml"),
            plain,
        ]
        self.jobs = {f"{k:016x}": replace(job, id=f"{k:016x}", at=NOW - 700.0 + k) for k, job in enumerate(jobs, 1)}

    def shown(self) -> Shown:
        """Give all of it."""
        limits = {
            "upload": LARGEST,
            "seconds": 600.0,
            "memory": 4_000_000_000,
            "queue": QUEUE,
            "jobs": 50,
            "days": 7.0,
            "parquet": True,
        }
        jobs = [self.job(name) for name in reversed(self.jobs)]
        return {"limits": limits, "assets": ["tank_1", "tank_2"], "jobs": jobs}

    def job(self, job: str) -> Shown:
        """Give a job."""
        told = self.jobs[job]
        waiting = [name for name, item in self.jobs.items() if item.state is JobState.WAITING]
        place = waiting.index(job) + 1 if job in waiting else None
        return {**told.shown(), "place": place, "share": 0.4 if told.state is JobState.RUNNING else None}

    def result(self, job: str, what: JobResult) -> Path:
        """Give the file of a result."""
        if what not in self.jobs[job].results:
            raise KeyError(what)
        path = self._folder / what.value
        path.write_text(
            {JobResult.REPORT: REPORT, JobResult.RECORDS: '{"record": "end"}\n'}.get(what, "K1 can be found.\n")
        )
        return path

    async def take(self, name: str, kind: FileKind, who: str, content: AsyncIterator[bytes]) -> Shown:
        """Take a file."""
        ending_of(name, kind)
        self._check()
        found = b""
        async for part in content:
            found += part
            if len(found) > LARGEST:
                raise LargeFileError(f"It is too large. A {kind.value} has 5 kB at most.")
        if not found:
            raise FaultbondError("It is empty.")
        file = replace(
            brought(name, kind, number=100 + len(self.files), who=who),
            size=len(found),
            sha256=sha256(found).hexdigest(),
        )
        self.files[file.id] = file
        return file.shown()

    async def order(self, order: JobOrder) -> Shown:
        """Let a job wait."""
        self._check()
        if sum(job.state is JobState.WAITING for job in self.jobs.values()) >= QUEUE:
            raise TooManyError(f"{QUEUE} analyses wait, which is the limit.", 30.0)
        numbers = [order.recording, *([order.model] if order.model else []), *order.tables]
        files = tuple(self.files[number] for number in numbers)
        if order.asset not in ("tank_1", "tank_2", ""):
            raise KeyError(order.asset)
        if files[0].kind is not FileKind.RECORDING:
            raise FaultbondError(f"{files[0].name} was brought as a {files[0].kind.value}, and is no recording.")
        number = f"{len(self.jobs) + 1:016x}"
        self.jobs[number] = Job(
            id=number,
            who=order.who,
            at=NOW,
            asset=order.asset,
            model=files[1].name if order.model else "tank.yaml",
            recording="recording.csv",
            files=files,
            analyse=order.analyse,
        )
        self.ordered.append(order)
        return self.job(number)

    async def remove(self, job: str, who: str) -> None:
        """Remove a job."""
        self.jobs[job]
        self._check()
        del self.jobs[job]

    def _check(self) -> None:
        if self.is_full:
            raise StoreError("store.db: the disk is full. Free some space.")
