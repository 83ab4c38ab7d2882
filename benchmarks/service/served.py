"""The service as a program of its own, with what it takes of the machine; Linux."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from types import TracebackType
from typing import Any

import httpx

LONGEST = 120.0  # s that a start may take: a first one compiles


class Served:
    """The service, until the block ends.

    Parameters
    ----------
    folder : where it runs and keeps its store
    words : of the command, behind `serve`
    """

    def __init__(self, folder: Path, *words: str) -> None:
        self._folder, self._words = folder, words
        with socket.create_server(("127.0.0.1", 0)) as door:
            self.port = int(door.getsockname()[1])
        self.address = f"http://127.0.0.1:{self.port}"
        self._running: subprocess.Popen[bytes] | None = None

    def __enter__(self) -> "Served":
        """Start it."""
        self.start()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, at: TracebackType | None) -> None:
        """Stop it."""
        if self._running is not None and self._running.poll() is None:
            self._running.send_signal(signal.SIGTERM)
            self._running.wait(30.0)

    @property
    def _process(self) -> "subprocess.Popen[bytes]":
        if self._running is None:
            raise RuntimeError("it has not been started")
        return self._running

    def start(self) -> float:
        """Start it, and give s until it answers."""
        begin = time.monotonic()
        self.begin()
        self.until(lambda told: True)
        return time.monotonic() - begin

    def begin(self) -> None:
        """Start it, and do not wait until it answers."""
        command = [sys.executable, "-m", "faultbond", "serve", *self._words, "--port", str(self.port)]
        said = (self._folder / "said.txt").open("ab")
        self._running = subprocess.Popen(command, cwd=self._folder, stdout=said, stderr=said)
        said.close()

    def kill(self) -> None:
        """Kill it, as by `kill -9`."""
        self._process.kill()
        self._process.wait()

    def until(self, is_so: Callable[[dict[str, Any]], bool], longest: float = LONGEST) -> dict[str, Any]:
        """Wait until something holds of the overview, and give that.

        Raises
        ------
        TimeoutError
            Where it does not.
        """
        end = time.monotonic() + longest
        while time.monotonic() < end:
            try:
                told = dict(httpx.get(f"{self.address}/api/v1/site", timeout=5.0).json())
                if is_so(told):
                    return told
            except httpx.TransportError:
                if self._process.poll() is not None:
                    raise TimeoutError((self._folder / "said.txt").read_text(encoding="utf-8")) from None
            time.sleep(0.02)
        raise TimeoutError("the service")

    def do(self, asset: str, action: str, **more: object) -> dict[str, Any]:
        """Do something about an asset, and give the entry of the journal.

        Raises
        ------
        httpx.HTTPError
            Where it is refused, with the service's words, or the service is gone.
        """
        token = httpx.get(f"{self.address}/api/v1/me", timeout=30.0).json()["token"]
        answer = httpx.post(
            f"{self.address}/api/v1/assets/{asset}/deeds",
            json={"action": action, **more},
            headers={"x-faultbond-token": token},
            timeout=30.0,
        )
        if answer.is_error:
            raise httpx.HTTPStatusError(answer.text, request=answer.request, response=answer)
        return dict(answer.json())

    def try_to_do(self, asset: str, action: str, **more: object) -> bool:
        """Do something about an asset, unless the service is too busy at this moment; tell whether it was done."""
        try:
            self.do(asset, action, **more)
        except httpx.HTTPStatusError as error:
            if error.response.status_code == httpx.codes.SERVICE_UNAVAILABLE:
                return False
            raise
        return True

    def processor_time(self) -> float:
        """Give how long it has computed, s."""
        fields = Path(f"/proc/{self._process.pid}/stat").read_text(encoding="utf-8").rpartition(")")[2].split()
        return (int(fields[11]) + int(fields[12])) / os.sysconf("SC_CLK_TCK")

    def memory(self) -> float:
        """Give the memory that it has, MB."""
        lines = Path(f"/proc/{self._process.pid}/status").read_text(encoding="utf-8").splitlines()
        return int(next(line.split()[1] for line in lines if line.startswith("VmRSS"))) / 1e3


async def events(address: str, asset: str = "") -> AsyncIterator[tuple[str, dict[str, Any]]]:
    """Give what a page is told."""
    asked = {"asset": asset} if asset else {}
    async with (
        httpx.AsyncClient(timeout=None) as client,  # noqa: S113 - it lasts
        client.stream("GET", f"{address}/api/v1/events", params=asked) as answer,
    ):
        name = ""
        async for line in answer.aiter_lines():
            if line.startswith("event: "):
                name = line.removeprefix("event: ")
            elif line.startswith("data: "):
                yield name, json.loads(line.removeprefix("data: "))
