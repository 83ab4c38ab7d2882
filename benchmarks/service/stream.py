"""20 signals at 100 Hz, from a broker or an OPC UA server through core and store to a page."""

import asyncio
import json
import subprocess
import sys
import tempfile
import time
from collections.abc import Awaitable, Callable
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import aiomqtt
import numpy as np

from benchmarks.service.ladder import STEP, model, recording
from benchmarks.service.served import Served, events
from benchmarks.shared.broker import MOSQUITTO, Mosquitto, free_port
from benchmarks.shared.page import Row
from faultbond.arrays import FloatArray

SETTLED = 10.0  # s before anything is measured: the start of the filter, and of the program
MEASURED = 60.0  # s
LATEST = 120.0  # s that a machine with other things to do may be behind
Sent = list[tuple[float, float]]  # the time of each sample, and when it was sent
Play = Callable[[], Awaitable[Sent]]


@dataclass
class _Seen:
    """When each sample came to the page, by its own time, s."""

    came: dict[float, float] = field(default_factory=dict)

    async def follow(self, address: str) -> None:
        """Listen as a page does."""
        async for name, told in events(address, "ladder"):
            if name == "samples":
                now = time.time()
                self.came.update((moment, now) for moment in told["time"])


async def _publish(port: int, names: list[str], values: FloatArray, last: float) -> Sent:
    """Publish a row each 10 ms."""
    sent = Sent()
    async with aiomqtt.Client("127.0.0.1", port) as client:
        begin = time.time()
        for k, row in enumerate(values):
            moment = round(begin + STEP * k, 3)
            if moment > last:
                break
            await asyncio.sleep(moment - time.time())
            await client.publish(
                "plant/ladder", json.dumps({"time": moment, **dict(zip(names, row.tolist(), strict=True))}), qos=1
            )
            sent.append((moment, time.time()))
    return sent


async def _measured(service: Served, play: Play) -> tuple[float, Sent, _Seen]:
    """Give the share of a core, what was sent while that was measured, and what the page saw.

    The share is processor time by what takes it at 100 Hz, so that other work of the machine changes little of it.
    """
    seen = _Seen()
    watching = asyncio.create_task(seen.follow(service.address))
    playing = asyncio.ensure_future(play())
    await asyncio.sleep(SETTLED)
    first, before = max(seen.came, default=0.0), service.processor_time()
    sent = [item for item in await playing if item[0] > first]
    async with asyncio.timeout(LATEST):
        while max(seen.came) < sent[-1][0] - STEP / 2.0:
            await asyncio.sleep(0.1)
    share = (service.processor_time() - before) / (len(sent) * STEP)
    watching.cancel()
    with suppress(asyncio.CancelledError):
        await watching
    return share, sent, seen


def rows() -> list[Row]:
    """Measure, and give lines of the table."""
    return [*_of_mqtt(), *_of_opcua()]


def _of_mqtt() -> list[Row]:
    if MOSQUITTO is None:
        return []
    names, values = recording(round((SETTLED + MEASURED + 5.0) / STEP))
    with tempfile.TemporaryDirectory() as name:
        broker = Mosquitto(Path(name))
        broker.start()

        def play() -> Awaitable[Sent]:
            return _publish(broker.port, names, values, time.time() + SETTLED + MEASURED + 1.0)

        try:
            return _through("MQTT", f"mqtt://127.0.0.1:{broker.port}/plant/+", play)
        finally:
            broker.kill()


def _of_opcua() -> list[Row]:
    port = free_port()
    with tempfile.TemporaryDirectory() as name:
        file = Path(name) / "sent.json"
        command = [sys.executable, "-m", "benchmarks.service.opcua_plant", str(port)]
        words = [str(SETTLED + MEASURED + 1.0), str(file)]
        pipe = subprocess.PIPE
        with subprocess.Popen([*command, *words], stdin=pipe, stdout=pipe, text=True) as plant:
            next(iter(plant.stdout or ()))  # it is ready

            async def play() -> Sent:
                print("begin", file=plant.stdin, flush=True)
                await asyncio.to_thread(next, iter(plant.stdout or ()))  # it is done
                return [(moment, at) for moment, at in json.loads(file.read_text(encoding="utf-8"))]

            try:
                return _through("OPC UA", f"opc.tcp://127.0.0.1:{port}/plant?security=none", play)
            finally:
                plant.kill()


def _through(by: str, address: str, play: Play) -> list[Row]:
    """Let a service take what is played, and say how."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "ladder.yaml").write_text(model(), encoding="utf-8")
        with Served(folder, "ladder.yaml", "--source", address) as service:
            share, sent, seen = asyncio.run(_measured(service, play))
            (asset,) = service.until(lambda told: True)["assets"]
    grid = np.array(sorted(seen.came))
    nearest = [grid[np.argmin(np.abs(grid - moment))] for moment, _ in sent]
    lost = sum(abs(at - moment) > 0.6 * STEP for at, (moment, _) in zip(nearest, sent, strict=True))
    late = np.array([seen.came[at] - when for at, (_, when) in zip(nearest, sent, strict=True)])
    p50, p99 = 1e3 * np.quantile(late, [0.5, 0.99])
    told = f"{len(sent)} samples, {asset['status']}"
    return [
        Row(
            figure=f"20 signals at 100 Hz by {by} through core, store and page ({told}): share of a core",
            asked="15 %",
            got=f"{100 * share:.1f} %",
            met=bool(share < 0.15),
        ),
        Row(figure="the same: lost", asked="0", got=str(lost), met=lost == 0),
        Row(
            figure="the same: from sample to page, 99th percentile",
            asked="250 ms",
            got=f"{p99:.0f} ms (half of them {p50:.0f} ms)",
            met=bool(p99 < 250),
        ),
    ]
