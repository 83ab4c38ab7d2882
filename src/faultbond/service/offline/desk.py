"""The off-line desk: takes files and orders, and lets one analysis after the other be done."""

import asyncio
import hashlib
import logging
import secrets
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Callable, Iterator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import replace
from importlib.util import find_spec
from itertools import count
from pathlib import Path

from faultbond.app.plant import WatchedPlant
from faultbond.errors import FaultbondError
from faultbond.model.document import MAX_BYTES
from faultbond.report.byte_size import size_text
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import AuditEntry
from faultbond.service.contract.offline import (
    FileKind,
    JobOrder,
    JobResult,
    LargeFileError,
    TooManyError,
    TooSlowError,
)
from faultbond.service.offline.child import run_confined, share_read
from faultbond.service.offline.job import ENDED, BroughtFile, Job, JobState
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.offline.outcome import FILES, outcome_of, remark_on_analysis, results_in
from faultbond.service.offline.shelf import MODEL, Shelf, ending_of

MOST_FILES = 20  # that no job has taken
FORGOTTEN = 3600.0  # s after which such a file is removed
AT_ONCE = 4  # files that come at a time
WINDOW, MOST_IN_IT = 600.0, 60  # s, and the files that one person brings in it
SILENCE = 30.0  # s for which nothing of a file may come
WHOLE = FORGOTTEN / 2  # s in which all of it comes: slow ones must not hold all places for ever
PORTION = 2**20  # bytes that are written at once
CUT_OFF = "It was cut off by a restart of the service. Order it again."
EVERY = 60.0  # s between two looks at what is too old
RUN = "run", MODEL
_LOG = logging.getLogger(__name__)

Note = Callable[[AuditEntry], Awaitable[None]]


class OfflineDesk:
    """Keeps files and jobs in a folder, and does the jobs in their order while it runs; see `contract.offline.Desk`.

    Parameters
    ----------
    limits : how much a job may take
    plants : the assets whose models may be taken, by name
    note : keeps what a person did
    clock : gives Unix s
    """

    def __init__(
        self,
        limits: OfflineLimits,
        plants: Mapping[str, WatchedPlant],
        note: Note,
        clock: Callable[[], float] = time.time,
    ) -> None:
        folder = Path(limits.folder).absolute()  # a child works elsewhere
        self._limits, self._plants = replace(limits, folder=str(folder)), plants
        self._note, self._clock = note, clock
        self._shelf = Shelf(folder)
        self._jobs: dict[str, Job] = {}
        self._work: dict[str, asyncio.Task[None]] = {}  # of jobs that are at work
        self._processes: dict[str, int] = {}
        self._shares: dict[str, float] = {}
        self._woken = asyncio.Event()
        self._coming = 0  # files that come now
        self._to_come: dict[str, int] = {}  # bytes that those may still have, by their numbers
        self._placing = asyncio.Lock()
        self._brought: dict[str, deque[float]] = {}
        self._ordering = asyncio.Lock()
        for job in self._shelf.jobs():
            cut = job.state is JobState.RUNNING
            self._keep(job.over(clock(), JobState.CUT_OFF, CUT_OFF) if cut else job)

    # What the page asks: see `contract.offline.Desk`.

    def shown(self) -> Shown:
        """Give limits, assets and jobs, the newest first."""
        limits = self._limits
        told = {name: getattr(limits, name) for name in ("upload", "seconds", "memory", "queue", "jobs", "days")}
        told["parquet"] = find_spec("pyarrow") is not None
        jobs = sorted(self._jobs.values(), key=lambda job: (job.at, job.id), reverse=True)
        return {"limits": told, "assets": list(self._plants), "jobs": [self._shown(job) for job in jobs]}

    def job(self, job: str) -> Shown:
        """Give a job."""
        return self._shown(self._jobs[job])

    def result(self, job: str, what: JobResult) -> Path:
        """Give the file of a result.

        Raises
        ------
        KeyError
            Where there is none.
        """
        if what not in self._jobs[job].results:
            raise KeyError(what)
        return self._shelf.out(job) / FILES[what]

    async def take(self, name: str, kind: FileKind, who: str, content: AsyncIterator[bytes]) -> Shown:
        """Take a file."""
        ending_of(name, kind)
        self._meter(who)
        self._coming += 1
        try:
            most = self._limits.upload if kind is FileKind.RECORDING else min(MAX_BYTES, self._limits.upload)
            number, place = await self._begin_file(most)
            try:
                size, digest = await self._receive(content, number, place, kind)
                file = BroughtFile(id=number, name=name, kind=kind, size=size, sha256=digest, who=who, at=self._clock())
                with _kept():
                    await asyncio.to_thread(self._shelf.keep_file, file)
                await self._tell(who, "upload", file.shown())
            except BaseException:
                self._shelf.remove_file(number)
                raise
            finally:
                self._to_come.pop(number, None)
        finally:
            self._coming -= 1
        return file.shown()

    async def order(self, order: JobOrder) -> Shown:
        """Let an analysis wait for its turn; see `contract.offline.Desk` for what else it may raise.

        Raises
        ------
        TooManyError
            Where as many wait as may.
        """
        async with self._ordering:  # a file is of one job, and the queue no longer than it may be
            waiting = sum(job.state is JobState.WAITING for job in self._jobs.values())
            if waiting >= self._limits.queue:
                raise TooManyError(f"{waiting} analyses wait, which is the limit. Try again once one is done.", 30.0)
            files = self._files_of(order)
            plant = self._plants[order.asset] if order.asset else None
            job = Job(
                id=secrets.token_hex(8),
                who=order.who,
                at=self._clock(),
                asset=order.asset,
                model=Path(plant.document[0]).name if plant else files[1].name,
                recording=_recording_name(files, plant),
                files=tuple(files),
                analyse=order.analyse,
            )
            with _kept():
                await asyncio.to_thread(self._shelf.begin_job, job, lambda place: _copy_model(plant, place))
            try:
                about = {"job": job.id, "asset": job.asset, "files": [file.sha256 for file in files]}
                await self._tell(order.who, "analysis", about)
            except BaseException:
                self._shelf.remove_job(job.id)
                raise
            self._jobs[job.id] = job
            self._woken.set()
            return self._shown(job)

    async def remove(self, job: str, who: str) -> None:
        """Stop a job where it is at work, and remove it."""
        told = self._jobs[job]
        await self._tell(who, "removal", {"job": job, "of": told.who, "state": told.state.value})
        self._jobs.pop(job, None)
        if (task := self._work.get(job)) is not None:
            task.cancel()
            with suppress(asyncio.CancelledError):
                await asyncio.shield(asyncio.gather(task, return_exceptions=True))
        await asyncio.to_thread(self._shelf.remove_job, job)

    # The work.

    async def run(self) -> None:
        """Do what is ordered until cancelled; what is at work then is cut off, and what waits goes on waiting."""
        try:
            while True:
                self._begin_next()
                self._woken.clear()
                with suppress(TimeoutError):
                    async with asyncio.timeout(EVERY):
                        await self._woken.wait()
                await self._forget()
        finally:
            tasks = [*self._work.values()]
            for task in tasks:
                task.cancel()
            await asyncio.gather(*tasks, return_exceptions=True)

    def _begin_next(self) -> None:
        """Begin the jobs whose turn it is."""
        for job in [job for job in self._jobs.values() if job.state is JobState.WAITING]:
            if len(self._work) >= self._limits.at_once:
                return
            self._keep(job.begun(self._clock()))
            self._work[job.id] = asyncio.create_task(self._do(job.id), name=f"off line {job.id}")

    async def _do(self, name: str) -> None:
        """Do a job, and keep what came of it, whatever that is."""
        try:
            done = await self._done(self._jobs[name])
        except asyncio.CancelledError:
            if name in self._jobs:
                self._keep(self._jobs[name].over(self._clock(), JobState.CUT_OFF, CUT_OFF))
            raise
        except Exception as error:  # the desk goes on with the next one
            _LOG.exception("the off-line analysis %s failed unforeseen", name)
            done = self._jobs[name].over(self._clock(), JobState.FAILED, f"The service failed at this: {error}")
        finally:
            self._work.pop(name, None)
            self._processes.pop(name, None)
            self._shares.pop(name, None)
            self._shelf.clear(name)
            self._woken.set()
        if name in self._jobs:
            self._keep(done)

    async def _done(self, job: Job) -> Job:
        """Give a job with what came of it."""
        out, limits = self._shelf.out(job.id), self._limits
        ends = asyncio.get_running_loop().time() + limits.seconds
        wanted = ("--json", f"../out/{FILES[JobResult.RECORDS]}", "--report", f"../out/{FILES[JobResult.REPORT]}")
        code = await self._confined(job, (*RUN, job.recording, *wanted), ends)
        found = await asyncio.to_thread(outcome_of, code, out, limits)
        remarks = found.remarks
        if job.analyse and found.state is JobState.DONE:
            code = await self._confined(job, ("analyse", MODEL), ends)
            told = await asyncio.to_thread(remark_on_analysis, code, out, limits)
            remarks = (*remarks, *filter(None, (told,)))
        return replace(
            job.over(self._clock(), found.state, found.said),
            verdict=found.verdict,
            candidates=found.candidates,
            remarks=remarks,
            results=results_in(out),
        )

    async def _confined(self, job: Job, words: tuple[str, ...], ends: float) -> int | None:
        return await run_confined(
            words,
            place=self._shelf.place(job.id),
            out=self._shelf.out(job.id),
            limits=self._limits,
            seconds=ends - asyncio.get_running_loop().time(),
            begun=lambda process: self._processes.__setitem__(job.id, process),
        )

    # What comes, and what goes.

    def _meter(self, who: str) -> None:
        """Refuse a file where too many came."""
        now, times = self._clock(), self._brought.setdefault(who, deque(maxlen=MOST_IN_IT))
        if self._coming >= AT_ONCE:
            raise TooManyError(f"{AT_ONCE} files come at this moment, which is the limit. Try again.", 5.0)
        if len(times) == MOST_IN_IT and 0.0 <= now - times[0] < WINDOW:
            seconds = WINDOW - (now - times[0])
            raise TooManyError(f"{MOST_IN_IT} files came in ten minutes. Try again in {seconds:.0f} s.", seconds)
        times.append(now)

    async def _begin_file(self, most: int) -> tuple[str, Path]:
        """Make the folder, and room in it for so many bytes more; give a number for a new file, and its place.

        Raises
        ------
        FaultbondError
            Where there is no room.
        """
        async with self._placing:  # room is given once
            await asyncio.to_thread(self._shelf.make)
            await asyncio.to_thread(self._shelf.remove_files_before, self._clock() - FORGOTTEN)
            with _kept():
                n_files = self._shelf.n_files()
            if n_files >= MOST_FILES:
                raise FaultbondError(f"{MOST_FILES} files lie there that no analysis has taken. Try again in an hour.")
            if not await self._has_room(most):
                told = size_text(self._limits.room)
                raise FaultbondError(f"There is no room: what is here fills the {told} that it may. Try again later.")
            with _kept():
                number, place = self._shelf.begin_file()
            self._to_come[number] = most
            return number, place

    async def _has_room(self, size: int) -> bool:
        """Remove the oldest that ended until there is room for so many bytes more; tell whether there is then.

        What may still come of other files is counted before what is there, so that no part of them is passed over.
        """
        while sum(self._to_come.values()) + await asyncio.to_thread(self._shelf.used) + size > self._limits.room:
            if (oldest := next((job for job in self._jobs.values() if job.state in ENDED), None)) is None:
                return False
            await self._forget_job(oldest.id)
        return True

    async def _receive(
        self, content: AsyncIterator[bytes], number: str, place: Path, kind: FileKind
    ) -> tuple[int, str]:
        """Write what comes, in the room that its number has; give its size and its digest."""
        most = self._to_come[number]
        size, digest, gathered = 0, hashlib.sha256(), bytearray()
        clock = asyncio.get_running_loop().time
        ends = clock() + WHOLE
        with _kept(), place.open("xb") as stream:  # also what its close writes
            while True:
                try:
                    async with asyncio.timeout_at(min(clock() + SILENCE, ends)):
                        part = await anext(content, None)
                except TimeoutError:
                    if clock() >= ends:
                        raise TooSlowError(f"It did not come within {WHOLE / 60:.0f} min.") from None
                    raise TooSlowError(f"Nothing more of it came for {SILENCE:.0f} s.") from None
                if part is not None:
                    size += len(part)
                    if size > most:
                        raise LargeFileError(f"It is too large. A {kind.value} has {size_text(most)} at most.")
                    gathered += part
                if gathered and (part is None or len(gathered) >= PORTION):
                    digest.update(gathered)
                    await asyncio.to_thread(stream.write, bytes(gathered))
                    self._to_come[number] = most - size
                    gathered.clear()
                if part is None:
                    break
        if not size:
            raise FaultbondError("It is empty.")
        return size, digest.hexdigest()

    def _files_of(self, order: JobOrder) -> list[BroughtFile]:
        """Give the files of an order: the recording, the model where one is brought, and its tables."""
        wanted = [(order.recording, FileKind.RECORDING)]
        if order.model:
            wanted.append((order.model, FileKind.MODEL))
        wanted += [(number, FileKind.TABLE) for number in order.tables]
        files = [self._shelf.file(number) for number, _ in wanted]
        for file, (number, kind) in zip(files, wanted, strict=True):
            if file.who != order.who:
                raise KeyError(number)
            if file.kind is not kind:
                raise FaultbondError(f"{file.name} was brought as a {file.kind.value}, and is no {kind.value}.")
        names = [file.name for file in files if file.kind is FileKind.TABLE]
        if len({number for number, _ in wanted}) < len(wanted) or len(set(names)) < len(names):
            raise FaultbondError("A file is named twice.")
        return files

    async def _forget(self) -> None:
        """Remove what is too old, or more than is kept."""
        ended = [job for job in self._jobs.values() if job.state in ENDED]
        oldest = self._clock() - 86400.0 * self._limits.days
        for k, job in enumerate(ended):
            if len(ended) - k > self._limits.jobs or (job.ended or job.at) < oldest:
                await self._forget_job(job.id)
        await self._has_room(0)
        await asyncio.to_thread(self._shelf.remove_files_before, self._clock() - FORGOTTEN)

    async def _forget_job(self, name: str) -> None:
        self._jobs.pop(name, None)
        await asyncio.to_thread(self._shelf.remove_job, name)

    def _keep(self, job: Job) -> None:
        """Keep how a job stands now."""
        before = self._jobs.get(job.id)
        self._jobs[job.id] = job
        if job != before:
            try:
                self._shelf.keep_job(job)
            except OSError as error:  # it is known until the service ends
                _LOG.warning("off line: how %s stands cannot be kept: %s", job.id, error)

    async def _tell(self, who: str, what: str, about: Shown) -> None:
        about = {key: value for key, value in about.items() if key not in ("who", "at")}
        await self._note(AuditEntry(at=self._clock(), who=who, what=what, about=about))

    def _shown(self, job: Job) -> Shown:
        """Give a job as the page shows it."""
        waiting = [item.id for item in self._jobs.values() if item.state is JobState.WAITING]
        place = waiting.index(job.id) + 1 if job.id in waiting else None
        share = None
        if (process := self._processes.get(job.id)) is not None:
            now = share_read(process, job.recording, job.files[0].size)
            share = max(now or 0.0, self._shares.get(job.id, 0.0)) or None
            self._shares[job.id] = share or 0.0
        return {**job.shown(), "place": place, "share": share}


@contextmanager
def _kept() -> Iterator[None]:
    """Turn what goes wrong with the disk into one line.

    Raises
    ------
    FaultbondError
        What went wrong.
    """
    try:
        yield
    except OSError as error:
        raise FaultbondError(f"It cannot be kept: {error.strerror or error}.") from error


def _recording_name(files: list[BroughtFile], plant: WatchedPlant | None) -> str:
    """Give the name of the recording in its job's folder, where no table has it."""
    ending = ending_of(files[0].name, FileKind.RECORDING)
    taken = {file.name for file in files[1:]} | ({curve.file for curve in plant.graph.tables} if plant else set())
    names = (f"recording{f'_{k}' if k else ''}{ending}" for k in count())
    return next(name for name in names if name not in taken)


def _copy_model(plant: WatchedPlant | None, place: Path) -> None:
    """Write the model of an asset, as it is watched, with the tables that lie beside it; nothing where there is none.

    Raises
    ------
    FaultbondError
        Where a table is gone.
    """
    if plant is None:
        return
    label, text = plant.document
    (place / MODEL).write_text(text, encoding="utf-8", newline="")
    for curve in plant.graph.tables:
        if curve.file:
            try:
                (place / curve.file).write_bytes((Path(label).parent / curve.file).read_bytes())
            except OSError as error:
                raise FaultbondError(f"{curve.file}: this table of the model cannot be read any more.") from error
