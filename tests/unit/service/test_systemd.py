"""What a service manager hears, at a socket as systemd opens it."""

import asyncio
import os
import signal
import socket
import subprocess
import sys
import threading
import time
from collections.abc import Iterator, Sequence
from pathlib import Path

import pytest

from faultbond.service.contract.store import Commit
from faultbond.service.systemd import ServiceManager, UnitState, reassure
from loop_asset import MODEL
from memory_store import MemoryStore
from played import Played

LONGEST = 90.0  # s that anything takes on a busy machine


class Manager:
    """The socket of a service manager."""

    def __init__(self, address: str) -> None:
        self.address = address
        self.heard = socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM)
        self.heard.bind(f"\0{address[1:]}" if address[0] == "@" else address)

    def next(self, longest: float = LONGEST) -> dict[str, str]:
        """Give what is told next; nothing where nothing comes in time."""
        self.heard.settimeout(longest)
        try:
            lines = self.heard.recv(65536).decode().splitlines()
        except TimeoutError:
            return {}
        return dict(line.split("=", 1) for line in lines)

    def until(self, key: str) -> dict[str, str]:
        """Give what is told when a key comes."""
        while key not in (told := self.next()):
            assert told, key
        return told

    def environment(self, **more: str) -> dict[str, str]:
        """Give what systemd adds to the environment."""
        return {"NOTIFY_SOCKET": self.address, **more}


@pytest.fixture(params=["path", "abstract"])
def manager(request: pytest.FixtureRequest, tmp_path: Path) -> Iterator[Manager]:
    """A manager that listens at a path, or at a name without one."""
    abstract = f"@faultbond/{os.getpid()}/{request.node.name}"
    found = Manager(str(tmp_path / "notify") if request.param == "path" else abstract)
    yield found
    found.heard.close()


def test_states_and_a_line_are_told_together(manager: Manager) -> None:
    """In one datagram, a line each, as sd_notify(3) has it."""
    ServiceManager(manager.environment()).tell(UnitState.READY, status="two\nlines  of it")
    assert manager.heard.recv(100) == b"READY=1\nSTATUS=two lines of it"


@pytest.mark.parametrize("address", ["", "relative", "vsock:2:1234"])
def test_nobody_is_told_where_nobody_listens(address: str) -> None:
    """What is no socket of this kind is left alone."""
    found = ServiceManager({"NOTIFY_SOCKET": address, "WATCHDOG_USEC": "1000000"})
    found.tell(UnitState.READY)
    assert (found.listens, found.watchdog) == (False, None)
    asyncio.run(asyncio.wait_for(reassure(found, lambda: True, lambda: ""), 1.0))


def test_a_manager_that_is_gone_does_no_harm(tmp_path: Path) -> None:
    """What it is told is lost, and once it is back it hears what is told then."""
    told = ServiceManager({"NOTIFY_SOCKET": str(tmp_path / "notify")})
    told.tell(UnitState.READY)
    came = Manager(str(tmp_path / "notify"))
    told.tell(UnitState.STOPPING)
    assert came.next() == {"STOPPING": "1"}
    came.heard.close()


def test_a_manager_that_does_not_read_does_no_harm(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """It is told what its socket holds, in order, and nobody waits for it to take more."""
    monkeypatch.setattr("faultbond.service.systemd.PATIENCE", 0.001)
    deaf = Manager(str(tmp_path / "notify"))
    told = ServiceManager(deaf.environment())
    for number in range(1000):
        told.tell(status=str(number))
    heard = []
    while found := deaf.next(0.1):
        heard.append(found["STATUS"])
    assert 0 < len(heard) < 1000
    assert heard == [str(number) for number in range(len(heard))]
    deaf.heard.close()


@pytest.mark.parametrize(
    ("more", "wanted"),
    [
        ({}, None),
        ({"WATCHDOG_USEC": "3000000"}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": str(os.getpid())}, 3.0),
        ({"WATCHDOG_USEC": "3000000", "WATCHDOG_PID": "1"}, None),
        ({"WATCHDOG_USEC": "0"}, None),
        ({"WATCHDOG_USEC": "often"}, None),
    ],
)
def test_signs_of_life_are_asked_for_by_the_environment(more: dict[str, str], wanted: float | None) -> None:
    """For this process, in microseconds."""
    assert ServiceManager({"NOTIFY_SOCKET": "/run/notify", **more}).watchdog == wanted


def test_a_stuck_worker_gives_no_sign_of_life(manager: Manager, monkeypatch: pytest.MonkeyPatch) -> None:
    """As long as its store does not return; then it goes on."""
    monkeypatch.setattr("faultbond.service.station.LONGEST_STEP", 0.5)
    monkeypatch.setattr("faultbond.service.station.TICK", 0.05)
    stuck, free = threading.Event(), threading.Event()

    class Stuck(MemoryStore):
        def commit(self, parts: Sequence[Commit]) -> None:
            if stuck.is_set():
                free.wait(LONGEST)
            super().commit(parts)

    told = ServiceManager(manager.environment(WATCHDOG_USEC="200000"))
    played, is_over = Played(Stuck(), steady=time.monotonic, portion=1, pace=0.02), threading.Event()

    async def watch() -> None:
        running = asyncio.create_task(played.service.run())
        reassuring = asyncio.create_task(reassure(told, lambda: played.service.is_alive, lambda: "well"))
        await played.until(is_over.is_set)
        running.cancel()
        reassuring.cancel()
        await asyncio.gather(running, reassuring, return_exceptions=True)

    watching = threading.Thread(target=asyncio.run, args=(watch(),))
    watching.start()
    try:
        for _ in range(5):
            assert manager.until("WATCHDOG")["STATUS"] == "well"
        stuck.set()
        end = time.monotonic() + 20.0
        while manager.next(1.5):
            assert time.monotonic() < end
        assert manager.next(1.0) == {}
        stuck.clear()
        free.set()
        manager.until("WATCHDOG")
    finally:
        free.set()
        is_over.set()
        watching.join()


@pytest.mark.parametrize("is_alive", [True, False])
def test_who_is_not_alive_gives_no_sign_of_life(manager: Manager, is_alive: bool) -> None:
    """Though its loop runs."""
    told = ServiceManager(manager.environment(WATCHDOG_USEC="20000"))
    with pytest.raises(TimeoutError):
        asyncio.run(asyncio.wait_for(reassure(told, lambda: is_alive, lambda: "well"), 0.3))
    assert (manager.next(0.1) == {"WATCHDOG": "1", "STATUS": "well"}) is is_alive


def test_the_program_tells_when_it_is_ready_alive_and_stopping(manager: Manager, tmp_path: Path) -> None:
    """From its start to a signal, with what is wrong in the line for people."""
    source = ("--source", f"file:{tmp_path / 'absent.csv'}", "--store", "kept.sqlite", "--port", "0")
    command = [sys.executable, "-m", "faultbond", "serve", str(MODEL), *source]
    environment = os.environ | manager.environment(WATCHDOG_USEC="400000")
    with subprocess.Popen(command, cwd=tmp_path, env=environment, stdout=subprocess.DEVNULL) as process:
        try:
            assert manager.next() == {"STATUS": "reads its store"}
            assert manager.next() == {"READY": "1"}
            assert {manager.until("WATCHDOG")["WATCHDOG"] for _ in range(3)} == {"1"}
            while "absent.csv" not in (status := manager.until("STATUS")["STATUS"]):
                assert status == "all parts work"
            process.send_signal(signal.SIGTERM)
            assert manager.until("STOPPING") == {"STOPPING": "1", "STATUS": "keeps its assets as they stand"}
            assert process.wait(LONGEST) == 128 + signal.SIGTERM
        finally:
            process.kill()
