"""`faultbond serve` as a program: what it says, what it refuses, and that a kill loses nothing."""

import json
import re
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from dataclasses import replace
from io import StringIO
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.disk import fill, mounted

from faultbond.cli import main
from faultbond.errors import FaultbondError
from faultbond.io.out import Out
from faultbond.io.row_block import RowBlock
from faultbond.service.program import serve
from faultbond.service.site import Site, SiteAsset, User
from faultbond.service.store.opening import open_store
from faultbond.service.store.reserve_file import DEFAULT_SIZE
from faultbond.service.web.security import hashed, matches
from loop_asset import MODEL, RECORDING, plant

httpx = pytest.importorskip("httpx", reason="there is no httpx: pip install httpx")
pytest.importorskip("uvicorn", reason='there is no uvicorn: pip install "faultbond[serve]"')

QUIET = Out(text=None, json=None)
ALL = 2400  # samples of the recording
LONGEST = 90.0  # s that anything takes on a busy machine


def free_port() -> int:
    """Give a port that nobody has."""
    with socket.create_server(("127.0.0.1", 0)) as door:
        return int(door.getsockname()[1])


@contextmanager
def served(folder: Path, port: int, *words: str) -> Iterator["subprocess.Popen[str]"]:
    """Run the program until the test is done with it."""
    command = [sys.executable, "-m", "faultbond", "serve", str(MODEL), "--port", str(port), *words]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def until(port: int, is_so: Callable[[dict[str, Any]], bool]) -> dict[str, Any]:
    """Ask for the loop until something holds of it."""
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        try:
            (found,) = httpx.get(f"http://127.0.0.1:{port}/api/v1/site", timeout=5.0).json()["assets"]
        except httpx.TransportError:
            found = None
        if found is not None and is_so(found):
            return dict(found)
        time.sleep(0.05)
    raise TimeoutError("the service")


def test_a_killed_service_goes_on_and_tells_nothing_twice(tmp_path: Path) -> None:
    """Killed three times while a recording is played, it has all records of one that was not, each once."""
    source = ("--source", f"file:{RECORDING}?speed=20", "--store", "kept.sqlite", "--json", "records.jsonl")
    port, samples = free_port(), 0
    for k in range(3):
        with served(tmp_path, port, *source):
            samples = until(port, lambda found, k=k: found["samples"] > 250 * (k + 1))["samples"]  # type: ignore[misc]
    assert samples > 750
    with served(tmp_path, port, *source) as process:
        shown = until(port, lambda found: found["samples"] >= ALL)
        assert shown["status"] == "FAILURE"
        process.send_signal(signal.SIGTERM)
        assert process.wait(LONGEST) == 128 + signal.SIGTERM
    other = ("--source", f"file:{RECORDING}?speed=max", "--store", "whole.sqlite")
    with served(tmp_path, port, *other) as process:
        until(port, lambda found: found["samples"] >= ALL)
        process.send_signal(signal.SIGINT)
        assert process.wait(LONGEST) == 128 + signal.SIGINT
        said, complained = process.communicate()
        assert said == f"rlc: http://127.0.0.1:{port}/ - Ctrl-C stops it.\n"
        assert re.fullmatch(r"(.* warning: file:.* has ended\n)?", complained)  # as fast as the recording goes
    kept, whole = (open_store(tmp_path / name, writes=False) for name in ("kept.sqlite", "whole.sqlite"))
    assert [(item.id, item.content) for item in kept.records()] == [(item.id, item.content) for item in whole.records()]
    assert not kept.contested()
    lines = [json.loads(line) for line in (tmp_path / "records.jsonl").read_text().splitlines()]
    known = {item.id: item.content for item in kept.records()}
    assert lines[0]["id"] == next(iter(known))  # told before the last start
    assert all({k: v for k, v in line.items() if k not in {"asset", "id"}} == known[line["id"]] for line in lines)


def full_is_told(process: "subprocess.Popen[str]", told: Callable[[str], bool]) -> None:
    """A start on a full disk waits and says so, or has what opens the store from before, and its page tells."""
    lines: list[str] = []

    def listen() -> None:
        assert process.stderr is not None
        for line in process.stderr:
            lines.append(line)  # noqa: PERF402 - each as it comes

    threading.Thread(target=listen, daemon=True).start()
    end = time.monotonic() + LONGEST
    while time.monotonic() < end:
        if any("The service begins once it can be used" in line for line in lines):
            return
        with suppress(httpx.TransportError):
            if told("the disk is full"):
                return
        time.sleep(0.05)
    raise TimeoutError("the service")


def test_a_disk_that_others_fill(tmp_path: Path) -> None:
    """It is told, stops neither page nor program, a start waits it out, and once there is room nothing is missing."""
    port = free_port()
    with mounted(tmp_path / "disk", "80m") as disk:
        if disk is None:
            pytest.skip("a disk in memory cannot be mounted here")
        source = ("--source", f"file:{RECORDING}?speed=20", "--store", str(disk / "kept.sqlite"))

        def told(word: str) -> bool:
            site = httpx.get(f"http://127.0.0.1:{port}/api/v1/site", timeout=5.0).json()
            return any(word in text for text in site["troubles"])

        with served(tmp_path, port, *source) as process:
            until(port, lambda found: found["samples"] > 100)
            assert not told("")
            fill(disk / "ballast")
            until(port, lambda found: told("kept in reserve"))
            (disk / "kept.sqlite.reserve").unlink(missing_ok=True)
            fill(disk / "more")
            until(port, lambda found: told("the disk is full"))
            assert httpx.get(f"http://127.0.0.1:{port}/health", timeout=5.0).status_code == 503
            assert httpx.get(f"http://127.0.0.1:{port}/api/v1/assets/rlc", timeout=5.0).status_code == 200
            process.send_signal(signal.SIGTERM)
            _, complained = process.communicate(timeout=LONGEST)
            assert "Traceback" not in complained
            assert complained.splitlines()[-1].startswith(f"{disk}/kept.sqlite: the disk is full")
        fill(disk / "rest")  # what the service gave back as it ended
        with served(tmp_path, port, *source) as process:
            full_is_told(process, told)
            process.send_signal(signal.SIGTERM)
            assert process.wait(LONGEST) == 128 + signal.SIGTERM
        with served(tmp_path, port, *source) as process:
            full_is_told(process, told)
            for name in ("ballast", "more", "rest"):
                (disk / name).unlink()
            until(port, lambda found: found["samples"] >= ALL and not told(""))
            assert (disk / "kept.sqlite.reserve").stat().st_size == DEFAULT_SIZE
            process.send_signal(signal.SIGTERM)
            process.wait(LONGEST)
        kept = open_store(disk / "kept.sqlite", writes=False)
        times = [time for block in kept.log_after("rlc", 0, 0) if isinstance(block, RowBlock) for time in block.time]
        assert (len(times), len(set(times))) == (ALL, ALL)
        kept.close()


def site(**changed: Any) -> Site:
    """Give a site of the loop."""
    return Site(**{"name": "loop", "assets": (SiteAsset(name="loop", plant=plant()),)} | changed)


@pytest.mark.parametrize("host", ["0.0.0.0", "192.0.2.1", "plant.example"])  # noqa: S104
def test_who_can_be_reached_from_elsewhere_needs_users(host: str) -> None:
    """Nobody from elsewhere is an engineer."""
    with pytest.raises(FaultbondError, match=f"listen: {host} can be reached from elsewhere, and there are no users"):
        serve(site(host=host), out=QUIET)


def test_who_can_be_reached_from_elsewhere_needs_tls_or_a_word() -> None:
    """Nobody reads passwords on the way, unless somebody says that another one sees to it."""
    users = {"anna": User(name="anna", role="view", password=hashed("open sesame"))}
    open_door = site(host="0.0.0.0", users=users)  # noqa: S104
    with pytest.raises(FaultbondError, match=r"listen: 0.0.0.0 can be reached .* passwords could be read on the way"):
        serve(open_door, out=QUIET, check=True)
    serve(replace(open_door, unencrypted=True), out=QUIET, check=True)
    for host in ("127.0.0.2", "::1", "localhost"):
        serve(site(host=host), out=QUIET, check=True)


def test_who_is_asked_through_a_proxy_needs_users() -> None:
    """To this machine all who come through it come from here."""
    with pytest.raises(FaultbondError, match=r"listen: names: whoever asks for plant.example through a proxy"):
        serve(site(names=("plant.example",)), out=QUIET, check=True)


def test_a_port_that_is_taken_is_told(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """In a line, with what to do; until then it has begun as ever, and keeps little memory in reserve."""
    begun = list[None]()
    monkeypatch.setattr("faultbond.service.program.keep_little", lambda: begun.append(None))
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
        told = rf"127.0.0.1:{port}: cannot listen there: [^.(]*\. Name another by --port"  # each thing once
        with pytest.raises(FaultbondError, match=told):
            serve(site(port=port, store=str(tmp_path / "kept.sqlite")), out=QUIET)
    assert begun


def test_a_check_says_what_would_be_watched(capsys: pytest.CaptureFixture[str]) -> None:
    """And touches nothing."""
    assert main(["serve", str(MODEL), "--source", "file:live.csv", "--check", "--accept", "0.99"]) == 0
    said = capsys.readouterr().out
    assert "from file:live.csv; accepts what is 0.99 sure" in said
    assert "Kept in faultbond.sqlite. Page: 127.0.0.1:8350. People: whoever is at this machine." in said
    place = "postgresql://ann:secret@127.0.0.1:1/plant"
    assert main(["serve", str(MODEL), "--check", "--store", place, "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["store"] == "postgresql://ann@127.0.0.1:1/plant"
    assert main(["serve", str(MODEL), "--check", "--store", place]) == 0
    assert "Kept in postgresql://ann@127.0.0.1:1/plant. Page" in capsys.readouterr().out
    assert main(["serve", str(MODEL), "--source", "fiel:live.csv", "--check"]) == 2
    assert "Did you mean file:?" in capsys.readouterr().err


def test_what_does_not_go_together_is_refused(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A site file names models, sources and store."""
    path = tmp_path / "site.yaml"
    path.write_text(f"assets: {{loop: {{model: {MODEL}}}}}\n")
    assert main(["serve", "--site", str(path), "--source", "-"]) == 2
    assert "stand in the site file" in capsys.readouterr().err
    assert main(["serve", "--site", str(path), "--check", "--json", "-"]) == 0
    (record,) = map(json.loads, capsys.readouterr().out.splitlines())
    assert (record["record"], [item["name"] for item in record["assets"]]) == ("site", ["loop"])


def test_the_log_is_written_as_asked(tmp_path: Path) -> None:
    """A source that is not there is one event, and a defect one with its traceback."""
    source = ("--source", f"file:{tmp_path / 'absent.csv'}", "--log", "json")
    port = free_port()
    with served(tmp_path, port, *source) as process:
        until(port, lambda found: "absent.csv" in found["headline"])
        process.send_signal(signal.SIGTERM)
        _, complained = process.communicate(timeout=LONGEST)
    (told,) = map(json.loads, complained.splitlines())
    assert (told["level"], told["logger"]) == ("warning", "faultbond.service.contract.part")
    assert told["message"].startswith(f"file:{tmp_path / 'absent.csv'}: ")


def test_a_reader_that_goes_away_ends_it_in_one_line(tmp_path: Path) -> None:
    """As in `faultbond serve ... --json - | head -1`: no traceback, and the exit code of a broken pipe."""
    with served(tmp_path, free_port(), "--source", f"file:{RECORDING}?speed=max", "--json", "-") as process:
        assert process.stdout is not None
        assert process.stderr is not None
        process.stdout.close()
        assert process.wait(LONGEST) == 128 + signal.SIGPIPE
        told = [line for line in process.stderr.read().splitlines() if "has ended" not in line]
    assert len(told) == 1
    assert "Nobody reads standard output any more" in told[0]


def test_what_nobody_foresaw_ends_with_its_traceback(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    """In the log, since nobody can run it once more for that; the exit code is that of a defect."""

    def broken(*_: object) -> None:
        raise ZeroDivisionError

    monkeypatch.setattr("faultbond.service.site_log.SiteLog.settle", broken)
    monkeypatch.chdir(tmp_path)
    assert main(["serve", str(MODEL), "--port", "0", "--log", "journal"]) == 3
    complained = capsys.readouterr().err.splitlines()
    assert "<2>The service ends; started again, it goes on from its log." in complained
    assert "<2>ZeroDivisionError" in complained
    assert complained[-1].startswith("faultbond: internal error: ZeroDivisionError")


def test_a_password_is_hashed(monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]) -> None:
    """What is printed lets its owner in, and nobody else."""
    monkeypatch.setattr(sys, "stdin", StringIO("open sesame\n"))
    assert main(["serve", "--hash"]) == 0
    kept = capsys.readouterr().out.strip()
    assert matches("open sesame", kept)
    assert not matches("open sesam", kept)
    monkeypatch.setattr(sys, "stdin", StringIO("sesame\n"))
    assert main(["serve", "--hash"]) == 2
    assert capsys.readouterr().err == "the password has 6 characters; take 8 or more.\n"
