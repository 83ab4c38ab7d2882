"""The off-line desk: what is brought is bounded, what is ordered is done as by the command line, nothing is lost."""

import asyncio
import errno
import hashlib
import io
import json
import os
import signal
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from contextlib import suppress
from pathlib import Path
from typing import Any

import pytest

from desk_bench import ENDS, MODEL, RC, RECORDING, TANK, Bench
from faultbond.app.plant import WatchedPlant
from faultbond.errors import FaultbondError, StoreError
from faultbond.service.contract.offline import (
    FileKind,
    JobOrder,
    JobResult,
    LargeFileError,
    TooManyError,
    TooSlowError,
    WrongKindError,
)
from faultbond.service.offline import desk as desk_module
from faultbond.service.offline import outcome as outcome_module
from faultbond.service.offline.child import CONFINED
from faultbond.service.offline.job import Job, JobState
from faultbond.service.offline.limits import OfflineLimits

Made = Callable[..., Bench]


def in_time(work: Any) -> Any:
    """Do it, not for ever."""

    async def bounded() -> Any:
        return await asyncio.wait_for(work, 200.0)

    return asyncio.run(bounded())


def failing(error: Exception) -> Callable[..., Any]:
    """Give what does nothing but fail."""

    def fails(*_: Any, **__: Any) -> Any:
        raise error

    return fails


def test_it_gives_what_the_command_line_writes(bench: Made, compiled: Path, tmp_path: Path) -> None:
    """Report and records are those of `run` on the same files, byte for byte, by a model that is brought."""
    made = bench(compiled)

    async def done() -> Any:
        async with made.at_work():
            model = await made.bring(MODEL, "Pumpe 7 (neu).yaml", "model")
            return await made.until(await made.order(name="../../etc/Anlage.CSV", model=model))

    told = in_time(done())
    (tmp_path / "model.yaml").write_bytes(MODEL)
    (tmp_path / "other name.csv").write_bytes(RECORDING)
    words = ["run", "model.yaml", "other name.csv", "--json", "r.jsonl", "--report", "r.html"]
    by_hand = subprocess.run(
        [sys.executable, "-m", "faultbond", *words],
        cwd=tmp_path,
        capture_output=True,
        text=True,
        check=False,
        timeout=100,
    )
    assert (by_hand.returncode, told["state"], told["verdict"]) == (1, "done", "fault")
    assert made.desk.result(told["id"], JobResult.REPORT).read_bytes() == (tmp_path / "r.html").read_bytes()
    assert made.desk.result(told["id"], JobResult.RECORDS).read_bytes() == (tmp_path / "r.jsonl").read_bytes()
    assert told["said"].startswith("Most likely the pipe changed: K1 rose from")
    best = told["candidates"][0]
    assert (best["names"], best["components"], best["kind"], best["group"]) == (["K1"], ["pipe"], "step", True)
    assert best["change"].endswith("%")
    assert (told["model"], told["files"][0]["name"]) == ("Pumpe 7 (neu).yaml", "../../etc/Anlage.CSV")
    assert told["results"] == ["report", "records"]


@pytest.mark.parametrize(("unexplained", "percent"), [(None, "97.5"), ({"signal": "p"}, "")])
def test_what_the_data_contradict_is_not_told_as_likely(
    unexplained: dict[str, str] | None, percent: str, tmp_path: Path
) -> None:
    """The last diagnosis counts, and none of its candidates has a percentage where nothing explains the data."""
    value = {"nominal": 1.0, "estimate": 2.0, "sd": 0.1}
    candidate = {
        "components": ["pipe"],
        "parameters": {"K1": value},
        "probability": 0.975,
        "kind": "step",
        "group": True,
    }
    last = {"record": "diagnosis", "time": 9.0, "candidates": [candidate], "unexplained": unexplained}
    (tmp_path / "r.jsonl").write_text(json.dumps({**last, "candidates": []}) + "\n" + json.dumps(last) + "\n")
    (told,) = outcome_module._candidates(tmp_path / "r.jsonl")
    assert (told["names"], told["percent"], told["probability"]) == (["K1"], percent, 0.975)


def test_the_model_of_an_asset_is_that_which_is_watched(bench: Made, compiled: Path) -> None:
    """An order by an asset takes its model, and a healthy recording of it is told as that."""
    made = bench(compiled)

    async def done() -> Any:
        async with made.at_work():
            return await made.until(await made.order((TANK / "healthy.csv").read_bytes()))

    told = in_time(done())
    assert (told["state"], told["asset"], told["verdict"]) == ("done", "tank", "healthy")
    assert (told["said"], told["candidates"]) == ("No fault found in 4920 samples (82 min).", [])
    assert (Path(made.limits.folder) / "jobs" / told["id"] / "in" / "model.yaml").read_bytes() == MODEL


def test_it_tells_what_could_be_found(bench: Made) -> None:
    """With `analyse` there is what that says of the model, too."""
    made = bench()

    async def done() -> Any:
        async with made.at_work():
            model = await made.bring((RC / "model.yaml").read_bytes(), "rc.yaml", "model")
            recording = (RC / "healthy.csv").read_bytes()
            return await made.until(await made.order(recording, model=model, analyse=True))

    told = in_time(done())
    assert (told["state"], told["remarks"], told["results"]) == ("done", [], ["report", "records", "analysis"])
    analysis = made.desk.result(told["id"], JobResult.ANALYSIS).read_text()
    assert analysis.startswith("RC circuit  model.yaml")
    assert "{R} and {C}" in analysis


def test_mistakes_are_the_line_of_the_command_line(bench: Made) -> None:
    """A recording or a model with a mistake ends in the one line that says it, and leaves no report."""
    made = bench()

    async def done() -> list[Any]:
        async with made.at_work():
            broken = await made.bring(MODEL.replace(b"sample_time", b"sample_thyme"), "m.yaml", "model")
            bad = [
                await made.order(b"a,b\n1,2\n"),
                await made.order(model=broken),
                await made.order(b"\x89PNG\r\n\0" * 99),
            ]
            return [await made.until(job) for job in bad]

    first, second, third = in_time(done())
    assert {item["state"] for item in (first, second, third)} == {"failed"}
    assert first["said"].startswith("recording.csv: ")
    assert second["said"].startswith("model.yaml:")
    assert "sample_thyme" in second["said"]
    assert "Traceback" not in third["said"]
    assert [item["results"] for item in (first, second, third)] == [[], [], []]


@pytest.mark.parametrize(
    ("limits", "said"),
    [
        ({"seconds": 0.5}, "It took longer than 0.5 s, and was stopped."),
        ({"processor": 1.0, "seconds": 50.0}, "It took more than 1 s of a processor, and was stopped."),
        ({"memory": 150_000_000}, "It took more memory than the 150 MB of a process, and was stopped."),
        ({"results": 20_000}, "A file that it wrote grew beyond 20 kB, and it was stopped."),
    ],
)
def test_what_takes_too_much_is_stopped(
    bench: Made, compiled: Path, limits: dict[str, Any], said: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A job that takes too long, too much of a processor, memory or disk is stopped, and told; the next one is done."""
    monkeypatch.setenv("FAULTBOND_HASTY", "0")  # what is compiled for users takes more than a second wherever it is
    made = bench(None if "processor" in limits else compiled, **limits)

    async def done() -> Any:
        async with made.at_work():
            return await made.until(await made.order())

    told = in_time(done())
    assert (told["state"], told["said"], told["verdict"]) == ("stopped", said, "")
    assert not (Path(made.limits.folder) / "jobs" / told["id"] / "tmp").exists()


def test_a_bomb_is_stopped(bench: Made, compiled: Path) -> None:
    """A small Parquet file that becomes large in memory ends at a limit."""
    pyarrow = pytest.importorskip("pyarrow", reason="there is no pyarrow")
    parquet = pytest.importorskip("pyarrow.parquet")
    n = 40_000_000
    header = RECORDING.split(b"\n", 1)[0].decode().strip().split(",")
    column = pyarrow.repeat(pyarrow.scalar("7" * 100), n // 20)
    stream = pyarrow.BufferOutputStream()
    parquet.write_table(pyarrow.table(dict.fromkeys(header, column)), stream, compression="zstd", row_group_size=n)
    content = stream.getvalue().to_pybytes()
    assert len(content) < 1_000_000
    made = bench(compiled, memory=900_000_000, seconds=12.0)

    async def done() -> Any:
        async with made.at_work():
            return await made.until(await made.order(content, "bomb.parquet"))

    assert in_time(done())["state"] == "stopped"


def processes_of(group: int) -> list[int]:
    """Give the processes of a group that are no corpses."""
    found = []
    for place in Path("/proc").glob("[0-9]*"):
        with suppress(OSError):
            state, _, of = (place / "stat").read_text().rpartition(") ")[2].split()[:3]
            found += [int(place.name)] if int(of) == group and state != "Z" else []
    return found


def gone(group: int) -> None:
    """Wait until there is no process of a group any more."""
    ends = time.monotonic() + ENDS
    while processes_of(group) and time.monotonic() < ends:
        time.sleep(0.01)


@pytest.mark.skipif(sys.platform != "linux", reason="only Linux tells a process that another is gone")
@pytest.mark.parametrize("killed", ["service", "program"])
def test_what_a_program_began_ends_with_the_service(tmp_path: Path, killed: str) -> None:
    """Where the service or the program of a job is killed, and so ends nothing that it began, that is ended, too."""
    begun = tmp_path / "begun"
    script = f"sleep 300 & echo $$ > {begun}; exec sleep 300"
    limits = json.dumps({"RLIMIT_CPU": [600, 605]})
    start = (
        "import os, subprocess, sys\n"
        f"words = ['-I', {str(CONFINED)!r}, {limits!r}, str(os.getpid()), '/bin/sh', '-c', {script!r}]\n"
        "subprocess.Popen([sys.executable, *words], start_new_session=True).wait()"
    )
    with subprocess.Popen([sys.executable, "-c", start], stdin=subprocess.DEVNULL) as service:
        ends = time.monotonic() + ENDS
        while not (begun.exists() and begun.read_text()) and time.monotonic() < ends:
            time.sleep(0.01)
        program = int(begun.read_text())
        n_before = len(processes_of(program))
        os.kill(service.pid if killed == "service" else program, signal.SIGKILL)
    gone(program)
    assert (n_before, processes_of(program)) == (3, [])  # the program, who watches it, and what it began


def test_all_that_a_job_began_ends_with_it(bench: Made) -> None:
    """A job that is removed while a compiler is at work for it leaves no process and no file."""
    made = bench()

    async def done() -> tuple[int, list[int], str]:
        async with made.at_work():
            job = await made.order()
            async with asyncio.timeout(60.0):
                # the program, who watches it, and a compiler
                while len(processes_of(process := made.desk._processes.get(job, -1))) < 3:
                    await asyncio.sleep(0.01)
            before = len(processes_of(process))
            await made.desk.remove(job, "otto")
            await asyncio.to_thread(gone, process)
            return before, processes_of(process), job

    before, left, job = in_time(done())
    assert (before >= 3, left) == (True, [])
    assert list((Path(made.limits.folder) / "jobs").iterdir()) == []
    with pytest.raises(KeyError):
        made.desk.job(job)
    assert [(item.who, item.what) for item in made.noted][-1] == ("otto", "removal")


def test_a_child_knows_little(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a job runs in has none of the service's environment but where programs are, and dies with the service."""
    monkeypatch.setenv("PGPASSWORD", "secret")
    monkeypatch.setenv("FAULTBOND_SOURCE_PASSWORD", "secret")
    made = bench()

    async def done() -> tuple[str, str]:
        async with made.at_work():
            job = await made.order()
            await made.until(job, "at work")
            while job not in made.desk._processes:
                await asyncio.sleep(0.01)
            place = Path("/proc") / str(made.desk._processes[job])
            for _ in range(500):
                if "confined.py" not in (place / "cmdline").read_text():
                    break
                await asyncio.sleep(0.01)
            return (place / "environ").read_text(), (place / "limits").read_text()

    environment, limits = in_time(done())
    assert "secret" not in environment
    known = {item.partition("=")[0] for item in environment.split("\0") if item}
    assert known <= {
        "PATH",
        "HOME",
        "TMPDIR",
        "LANG",
        "CC",
        "LD_LIBRARY_PATH",
        "OPENBLAS_CORETYPE",
        "OPENBLAS_L2_SIZE",
        "FAULTBOND_HASTY",
        "FAULTBOND_CACHE",
        "PYTHONPATH",
        "PYTHONDONTWRITEBYTECODE",
        "OMP_NUM_THREADS",
        "OPENBLAS_NUM_THREADS",
    }
    for line in (
        "Max address space         4000000000",
        "Max cpu time              600",
        "Max file size             500000000",
    ):
        assert line in limits


def test_a_folder_may_be_relative(tank: WatchedPlant, tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """What a job compiles is kept for the next one, and beside its files there is nothing, also by a relative name."""
    monkeypatch.chdir(tmp_path)
    made = Bench(OfflineLimits(folder="desk"), {"tank": tank})

    async def done() -> Any:
        async with made.at_work():
            return await made.until(await made.order())

    told = in_time(done())
    assert told["state"] == "done"
    assert any(item.is_file() for item in (tmp_path / "desk" / "cache").rglob("*.so"))
    names = sorted(item.name for item in (tmp_path / "desk" / "jobs" / told["id"] / "in").iterdir())
    assert names == ["model.yaml", "recording.csv"]


def test_a_file_that_is_too_large_is_refused_while_it_comes(bench: Made) -> None:
    """No more is read of a file than may come, nothing of it stays, and nothing is noted; an empty one is none."""
    made = bench(upload=100_000)
    taken = 0

    async def endless() -> AsyncIterator[bytes]:
        nonlocal taken
        while True:
            taken += 10_000
            yield b"x" * 10_000

    async def done() -> None:
        with pytest.raises(LargeFileError, match="A recording has 100 kB at most"):
            await made.desk.take("a.csv", FileKind.RECORDING, "emma", endless())
        with pytest.raises(LargeFileError, match="A model has"):
            await made.desk.take("a.yaml", FileKind.MODEL, "emma", endless())
        with pytest.raises(FaultbondError, match="It is empty"):
            await made.bring(b"")

    in_time(done())
    assert taken <= 2 * 110_000
    assert list((Path(made.limits.folder) / "files").iterdir()) == []
    assert made.noted == []


def test_a_model_is_bounded_as_where_it_is_read(bench: Made) -> None:
    """A model or a table has a MiB at most, however large recordings may be."""
    made = bench()
    for name, kind in (("a.yaml", "model"), ("a.csv", "table")):
        with pytest.raises(LargeFileError, match=r"has 1\.05 MB at most"):
            in_time(made.bring(b"x" * (2**20 + 1), name, kind))


def test_a_file_that_does_not_come_on_is_refused(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who holds a connection and sends nothing is not waited for for ever."""
    monkeypatch.setattr(desk_module, "SILENCE", 0.05)
    made = bench()

    async def silent() -> AsyncIterator[bytes]:
        yield b"a"
        await asyncio.sleep(60.0)

    with pytest.raises(TooSlowError, match="Nothing more of it came"):
        in_time(made.desk.take("a.csv", FileKind.RECORDING, "emma", silent()))
    assert list((Path(made.limits.folder) / "files").iterdir()) == []


def test_a_file_that_comes_too_slowly_is_refused(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Who sends a little again and again does not hold a place for ever."""
    monkeypatch.setattr(desk_module, "WHOLE", 0.1)
    made = bench()

    async def dripping() -> AsyncIterator[bytes]:
        while True:
            yield b"a"
            await asyncio.sleep(0.01)

    with pytest.raises(TooSlowError, match="It did not come within"):
        in_time(made.desk.take("a.csv", FileKind.RECORDING, "emma", dripping()))
    assert list((Path(made.limits.folder) / "files").iterdir()) == []


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("a.exe", "recording"),
        ("a.csv", "model"),
        ("a", "recording"),
        ("a.csv.gz", "recording"),
        ("a.csv/../../b.csv", "table"),
        ("../curve.csv", "table"),
        ("/etc/curve.csv", "table"),
        ("a/b.csv", "table"),
        ("a\\b.csv", "table"),
        (".hidden.csv", "table"),
        ("curve.csv\n", "table"),
        ("a\0.csv", "table"),
        ("-rf.csv", "table"),
        ("x" * 101 + ".csv", "table"),
    ],
)
def test_names_are_checked(bench: Made, name: str, kind: str) -> None:
    """A name that is none of its kind is refused, and that of a table, which a model may say, is a plain word."""
    made = bench()
    with pytest.raises(WrongKindError):
        in_time(made.bring(b"x", name, kind))


@pytest.mark.parametrize(
    "name", ["../../../../tmp/evil.csv", "/etc/passwd.csv", "..\\evil.csv", "a\0b.csv", "nul.csv", "x" * 190 + ".csv"]
)
def test_names_are_no_paths(bench: Made, tmp_path: Path, name: str) -> None:
    """Wherever a recording's name leads, its file is where the desk puts it, under a name of the desk's own."""
    made = bench()

    async def done() -> str:
        return await made.order(name=name)

    job = in_time(done())
    files = sorted(str(item.relative_to(tmp_path)) for item in tmp_path.rglob("*") if item.is_file())
    assert files == [
        f"desk/jobs/{job}/about.json",
        f"desk/jobs/{job}/in/model.yaml",
        f"desk/jobs/{job}/in/recording.csv",
    ]


@pytest.mark.parametrize("number", ["../../x", "..", "", "0" * 15, "g" * 16, "0" * 17, "0" * 16, "/etc/passwd"])
def test_numbers_are_no_paths(bench: Made, number: str) -> None:
    """A file or a job that there is not, by whatever number, is not there."""
    made = bench()

    async def done() -> None:
        recording = await made.bring()
        for order in (
            JobOrder(who="emma", recording=number, asset="tank"),
            JobOrder(who="emma", recording=recording, model=number or "x"),
        ):
            with pytest.raises(KeyError):
                await made.desk.order(order)
        with pytest.raises(KeyError):
            await made.desk.remove(number, "emma")
        for ask in (made.desk.job, lambda job: made.desk.result(job, JobResult.REPORT)):
            with pytest.raises(KeyError):
                ask(number)

    in_time(done())


def test_an_order_takes_its_files_once_and_of_their_kind(bench: Made) -> None:
    """A file that another brought, that is of another kind, that is named twice or is in a job already is refused."""
    made = bench()

    async def done() -> None:
        mine, theirs, model = (
            await made.bring(),
            await made.bring(who="otto"),
            await made.bring(MODEL, "m.yaml", "model"),
        )
        curves = [await made.bring(b"1,2\n", "c.csv", "table") for _ in range(2)]
        for recording, asset in ((theirs, "tank"), (mine, "pump")):
            with pytest.raises(KeyError):
                await made.desk.order(JobOrder(who="emma", recording=recording, asset=asset))
        for order, told in (
            (JobOrder(who="emma", recording=model, asset="tank"), "was brought as a model"),
            (JobOrder(who="emma", recording=mine, model=model, tables=curves), "named twice"),
            (JobOrder(who="emma", recording=mine, model=model, tables=curves[:1] * 2), "named twice"),
        ):
            with pytest.raises(FaultbondError, match=told):
                await made.desk.order(order)
        await made.desk.order(JobOrder(who="emma", recording=mine, asset="tank"))
        with pytest.raises(KeyError):
            await made.desk.order(JobOrder(who="emma", recording=mine, asset="tank"))

    in_time(done())


def test_orders_wait_in_a_queue_that_is_bounded(bench: Made) -> None:
    """Five orders wait in their order, the sixth is refused, and its file stays for another try."""
    made = bench()

    async def done() -> list[str]:
        jobs = [await made.order() for _ in range(5)]
        assert [made.desk.job(job)["place"] for job in jobs] == [1, 2, 3, 4, 5]
        recording = await made.bring()
        with pytest.raises(TooManyError, match="5 analyses wait"):
            await made.desk.order(JobOrder(who="emma", recording=recording, asset="tank"))
        await made.desk.remove(jobs[1], "emma")
        await made.desk.order(JobOrder(who="emma", recording=recording, asset="tank"))
        return jobs

    jobs = in_time(done())
    assert [made.desk.job(job)["place"] for job in (jobs[0], *jobs[2:])] == [1, 2, 3, 4]


def test_one_is_at_work_at_a_time(bench: Made) -> None:
    """While one analysis is at work the next waits; with `at_once: 2` two are."""
    for at_once in (1, 2):
        made = bench(at_once=at_once)

        async def done(made: Bench = made) -> list[str]:
            async with made.at_work():
                jobs = [await made.order() for _ in range(3)]
                await made.until(jobs[0], "at work")
                await asyncio.sleep(0.2)
                return [made.desk.job(job)["state"] for job in jobs]

        states = in_time(done())
        assert states.count("at work") == at_once
        assert states.count("waiting") == 3 - at_once
        for item in made.desk.shown()["jobs"]:
            in_time(made.desk.remove(item["id"], "emma"))


def test_nothing_is_lost_by_a_restart(bench: Made) -> None:
    """What was at work when the service was killed is told as cut off, what waited goes on, and what is done stays."""
    made = bench()

    async def killed() -> list[str]:
        jobs = [await made.order() for _ in range(3)]
        made.desk._keep(made.desk._jobs[jobs[0]].begun(made.now))
        return jobs

    jobs = in_time(killed())
    made.desk = made.made()
    told = [made.desk.job(job) for job in jobs]
    assert [item["state"] for item in told] == ["cut off", "waiting", "waiting"]
    assert told[0]["said"] == "It was cut off by a restart of the service. Order it again."
    made.desk = made.made()
    assert [made.desk.job(job) for job in jobs] == told


def test_what_is_at_work_at_an_orderly_end_is_cut_off(bench: Made) -> None:
    """A service that is stopped ends the process of a job, and says so after its next start."""
    made = bench()

    async def stopped() -> tuple[str, int]:
        async with made.at_work():
            job = await made.order()
            await made.until(job, "at work")
            while job not in made.desk._processes:
                await asyncio.sleep(0.01)
            process = made.desk._processes[job]
        return job, process

    job, process = in_time(stopped())
    assert processes_of(process) == []
    assert made.made().job(job)["state"] == "cut off"


def test_what_is_damaged_on_the_disk_is_told(bench: Made, caplog: pytest.LogCaptureFixture) -> None:
    """A job that cannot be read any more does not keep the service from its start, and is told in the log."""
    made = bench()
    job, whole = in_time(made.order()), in_time(made.order())
    (Path(made.limits.folder) / "jobs" / job / "about.json").write_text('{"id": 3}')
    (Path(made.limits.folder) / "jobs" / ".half").mkdir()
    assert [item["id"] for item in made.made().shown()["jobs"]] == [whole]
    assert "this job cannot be read any more" in caplog.text
    assert sorted(item.name for item in (Path(made.limits.folder) / "jobs").iterdir()) == [whole]


def test_what_cannot_be_read_for_a_while_is_left(
    bench: Made, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """A job that cannot be read at one start, as for want of open files, is there at the next one."""
    made = bench()
    job = in_time(made.order())
    with monkeypatch.context() as patch:
        patch.setattr(Path, "read_text", failing(OSError(errno.EMFILE, "Too many open files")))
        assert made.made().shown()["jobs"] == []
    assert "this job cannot be read now: Too many open files. It is left as it is." in caplog.text
    assert [item["id"] for item in made.made().shown()["jobs"]] == [job]


def test_what_is_half_made_is_no_job(bench: Made) -> None:
    """A job that was written but not given its name, and one under another's name, are removed, and not shown."""
    made = bench()
    half, other, whole = (in_time(made.order()) for _ in range(3))
    jobs = Path(made.limits.folder) / "jobs"
    (jobs / half).rename(jobs / f".{half}")
    (jobs / other).rename(jobs / ("0" * 16))
    assert [item["id"] for item in made.made().shown()["jobs"]] == [whole]
    assert [item.name for item in jobs.iterdir()] == [whole]


def test_a_job_takes_its_files_all_or_none(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where a job cannot be written its files stay for another try, and links are not needed for it."""
    made = bench()
    full = OSError(errno.ENOSPC, "No space left on device")

    async def done() -> None:
        recording = await made.bring()
        order = JobOrder(who="emma", recording=recording, asset="tank")
        with monkeypatch.context() as patch:
            patch.setattr(Job, "text", failing(full))
            with pytest.raises(FaultbondError, match="It cannot be kept: No space left"):
                await made.desk.order(order)
        assert list((Path(made.limits.folder) / "jobs").iterdir()) == []
        monkeypatch.setattr(os, "link", failing(PermissionError(errno.EPERM, "Operation not permitted")))
        job = (await made.desk.order(order))["id"]
        assert (Path(made.limits.folder) / "jobs" / job / "in" / "recording.csv").read_bytes() == RECORDING
        assert list((Path(made.limits.folder) / "files").iterdir()) == []

    in_time(done())


def test_a_folder_that_cannot_be_read_is_told(
    bench: Made, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """The service begins, and its desk goes on, without a folder that it may not read."""
    made = bench()
    in_time(made.order())
    denied = failing(PermissionError(errno.EACCES, "Permission denied"))
    monkeypatch.setattr(Path, "iterdir", denied)
    monkeypatch.setattr(Path, "is_dir", denied)
    desk = made.made()
    assert desk.shown()["jobs"] == []
    assert "the analyses in it cannot be read: Permission denied" in caplog.text
    in_time(desk._forget())


def test_what_vanishes_while_it_is_counted_is_passed_over(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """A folder that is removed while sizes are added up does not keep a file from coming."""
    made = bench()
    job = in_time(made.order())
    scandir = os.scandir

    def vanishing(place: Any) -> Any:
        if Path(place).name == job:
            raise FileNotFoundError(errno.ENOENT, "No such file or directory")
        return scandir(place)

    monkeypatch.setattr(os, "scandir", vanishing)
    in_time(made.bring())


def test_a_full_disk_is_told(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """Where the content cannot be begun or ended, as where it cannot go on, that is one line, and nothing stays."""
    made = bench()
    full = OSError(errno.ENOSPC, "No space left on device")
    opened = Path.open

    class Full(io.FileIO):
        def write(self, _: Any) -> int:
            raise full

    def buffered(place: Path, mode: str, **more: Any) -> Any:
        return io.BufferedWriter(Full(place, mode)) if mode == "xb" else opened(place, mode, **more)

    for given in (failing(full), buffered):
        with monkeypatch.context() as patch:
            patch.setattr(Path, "open", given)
            with pytest.raises(FaultbondError, match="It cannot be kept: No space left"):
                in_time(made.bring(b"a,b\n"))
        assert list((Path(made.limits.folder) / "files").iterdir()) == []


def test_all_that_is_brought_is_noted(bench: Made) -> None:
    """Who brought what, how large, and its digest are kept, and so are orders and removals."""
    made = bench()
    job = in_time(made.order(name="Anlage.csv"))
    in_time(made.desk.remove(job, "otto"))
    upload, order, removal = made.noted
    assert (upload.who, upload.what, upload.at) == ("emma", "upload", made.now)
    assert (upload.about["name"], upload.about["size"]) == ("Anlage.csv", len(RECORDING))
    assert upload.about["sha256"] == hashlib.sha256(RECORDING).hexdigest()
    assert (order.what, order.about["job"], order.about["files"]) == ("analysis", job, [upload.about["sha256"]])
    assert (removal.who, removal.about) == ("otto", {"job": job, "of": "emma", "state": "waiting"})


def test_what_cannot_be_noted_is_not_taken(bench: Made) -> None:
    """Where the store cannot be written nothing is taken, begun or removed."""
    made = bench()

    async def done() -> None:
        recording, job = await made.bring(), await made.order()
        made.refuses = StoreError("the disk is full.")
        with pytest.raises(StoreError):
            await made.bring()
        with pytest.raises(StoreError):
            await made.desk.order(JobOrder(who="emma", recording=recording, asset="tank"))
        with pytest.raises(StoreError):
            await made.desk.remove(job, "emma")
        assert [item["id"] for item in made.desk.shown()["jobs"]] == [job]

    in_time(done())
    assert len(list((Path(made.limits.folder) / "jobs").iterdir())) == 1


def test_files_that_come_are_metered(bench: Made, monkeypatch: pytest.MonkeyPatch) -> None:
    """One person brings so many files in some time, so many come at once, and so many lie about."""
    monkeypatch.setattr(desk_module, "MOST_IN_IT", 3)
    made = bench()

    async def done() -> None:
        for _ in range(3):
            await made.bring(b"x")
        with pytest.raises(TooManyError, match="3 files came in ten minutes") as refused:
            await made.bring(b"x")
        assert refused.value.seconds == desk_module.WINDOW
        await made.bring(b"x", who="otto")
        made.now += desk_module.WINDOW
        await made.bring(b"x")
        monkeypatch.setattr(desk_module, "MOST_FILES", 5)
        with pytest.raises(FaultbondError, match="5 files lie there"):
            await made.bring(b"x")
        monkeypatch.setattr(desk_module, "AT_ONCE", 0)
        with pytest.raises(TooManyError, match="at this moment"):
            await made.bring(b"x", who="anna")

    in_time(done())


def test_old_ones_make_room(bench: Made) -> None:
    """Jobs that ended go with their age, beyond their number and where room is needed; those that wait never do."""
    made = bench(jobs=2, days=1.0)

    async def ended(n: int) -> list[str]:
        jobs = []
        for _ in range(n):
            made.now += 1.0
            jobs.append(await made.order())
            made.desk._keep(made.desk._jobs[jobs[-1]].over(made.now, JobState.DONE, "done"))
        return jobs

    async def done() -> None:
        waits = await made.order()
        jobs = await ended(4)
        await made.desk._forget()
        assert {item["id"] for item in made.desk.shown()["jobs"]} == {waits, *jobs[2:]}
        made.now += 86401.0
        await made.desk._forget()
        assert {item["id"] for item in made.desk.shown()["jobs"]} == {waits}
        assert [item.name for item in (Path(made.limits.folder) / "jobs").iterdir()] == [waits]

    in_time(done())


def test_room_is_bounded(bench: Made) -> None:
    """What ended first makes room for what comes; where nothing may go a file is refused."""
    made = bench(upload=200_000, room=250_000)

    async def done() -> None:
        first = await made.order()
        made.desk._keep(made.desk._jobs[first].over(made.now, JobState.DONE, "done"))
        second = await made.order()
        assert [item["id"] for item in made.desk.shown()["jobs"]] == [second]
        with pytest.raises(FaultbondError, match="There is no room: what is here fills the 250 kB"):
            await made.bring()
        with pytest.raises(FaultbondError, match="There is no room"):
            await made.bring(MODEL, "m.yaml", "model")  # as large as a model may be

    in_time(done())


def test_room_is_kept_for_what_comes(bench: Made) -> None:
    """Of files that come at once none takes the room of another; what did not come of one is free again."""
    made = bench(upload=200_000, room=450_000)
    going_on = asyncio.Event()

    async def halting() -> AsyncIterator[bytes]:
        yield b"x" * 50_000
        await going_on.wait()
        yield b"x" * 50_000

    async def done() -> None:
        desk = made.desk
        coming = [asyncio.create_task(desk.take("a.csv", FileKind.RECORDING, "emma", halting())) for _ in range(3)]
        refused, _ = await asyncio.wait(coming, return_when=asyncio.FIRST_COMPLETED)
        assert [str(task.exception()).partition(":")[0] for task in refused] == ["There is no room"]
        going_on.set()
        await asyncio.gather(*coming, return_exceptions=True)
        assert desk._shelf.used() > 200_000
        await made.bring(b"x" * 200_000)
        assert desk._shelf.used() <= 450_000

    in_time(done())


def test_room_is_looked_at_by_what_may_come(bench: Made) -> None:
    """Beside a model there is room for a recording, and beside a recording for a model, where `room` is for both."""
    made = bench(upload=5 * 2**20, room=7 * 2**20)

    async def done() -> None:
        model, recording = (b"x" * 2**20, "m.yaml", "model"), (b"x" * (5 * 2**20),)
        for first, second in ((model, recording), (recording, model)):
            numbers = [await made.bring(*first), await made.bring(*second)]
            with pytest.raises(FaultbondError, match="There is no room"):
                await made.bring(b"x", "c.csv", "table")
            for number in numbers:
                made.desk._shelf.remove_file(number)

    in_time(done())


def test_what_jobs_write_is_bounded(bench: Made) -> None:
    """Where results fill the room the oldest jobs that ended go, as many as need be, though nothing comes."""
    made = bench(upload=200_000, room=1_000_000)

    async def done() -> None:
        jobs = []
        for _ in range(3):
            made.now += 1.0
            jobs.append(await made.order())
            made.desk._keep(made.desk._jobs[jobs[-1]].over(made.now, JobState.DONE, "done"))
        await made.desk._forget()
        assert [item["id"] for item in made.desk.shown()["jobs"]] == jobs[::-1]
        out = made.desk._shelf.out(jobs[2])
        (out / "records.jsonl").write_bytes(b"x" * (1_000_000 - made.desk._shelf.used() + 1))
        await made.desk._forget()
        assert [item["id"] for item in made.desk.shown()["jobs"]] == jobs[:0:-1]

    in_time(done())
