"""Sources that are cut off under a service that goes on: a broker, the network to it, a file."""

import asyncio
import json
from collections.abc import Awaitable, Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.broker import Mosquitto

from faultbond.io.row_block import Quality
from faultbond.service.contract.face import Shown
from faultbond.service.sources.opening import open_source
from loop_asset import plant, rows
from played import TIMEOUT, Played, play

HEADERS = [item.header for item in (*plant().columns.inputs, *plant().columns.outputs)]
TIME = plant().columns.time.column or "time"
N = 240  # rows that are told in the end, a third before the cut, a third behind it, and a third later


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a source be opened again at once."""
    monkeypatch.setattr("faultbond.service.station.FIRST_DELAY", 0.1)
    monkeypatch.setattr("faultbond.service.station.LONGEST_DELAY", 0.2)


def said(k: int) -> dict[str, float]:
    """Give a row by columns."""
    found = rows()
    values = [*found.u[k].tolist(), *found.y[k].tolist()]
    return {TIME: float(found.time[k])} | dict(zip(HEADERS, values, strict=True))


def qualified(k: int, quality: str) -> dict[str, Any]:
    """Give a row by columns, each value with a quality unless that is good."""
    row = said(k)
    return row if quality == "good" else row | {name: {"value": row[name], "quality": quality} for name in HEADERS}


def part_of(played: Played) -> Mapping[str, Any]:
    """Give how the source is, by the health."""
    return dict(next(iter(played.service.health()["parts"].values())))


async def lost(played: Played, told: str) -> Shown:
    """Wait until the source is lost, and all that follows for the asset; gives its summary."""
    await played.until(lambda: not part_of(played)["ok"])
    assert told in part_of(played)["trouble"]
    assert not played.service.health()["ok"]
    played.steady.now += 11.0
    shown = played.summary
    assert (shown["status"], shown["monitoring"]) == ("CHECK_FUNCTION", "no data")
    assert told in shown["headline"]
    return shown


def assert_whole(played: Played, n_lost: int = 1) -> None:
    """All rows are there once, in order; the loss is counted."""
    (log,) = played.store.logs.values()
    found = [item[1].time for item in log.rows if item is not None]
    np.testing.assert_allclose(found, rows().time[:N])
    assert played.service.asset("loop")["counts"]["source lost"] == n_lost
    assert part_of(played)["restarts"] == 0


async def publish(broker: Mosquitto, first: int, last: int, *, quality: str = "good") -> None:
    """Publish some rows, with values of a quality."""
    import aiomqtt  # noqa: PLC0415 - an extra

    async with aiomqtt.Client("127.0.0.1", broker.port) as client:
        for k in range(first, last):
            await client.publish("plant/loop", json.dumps(qualified(k, quality)), qos=1)


def followed(address: str, course: Callable[[Played], Awaitable[None]]) -> Played:
    """Run a service at a source beside what a test does with that."""
    played = Played(opened=lambda _, subscribers: open_source(address, subscribers))
    play(played, course)
    return played


def test_a_broker_that_is_killed_and_started_again(broker: Mosquitto) -> None:
    """The service goes on with what comes then, and is well before anything does."""

    async def course(played: Played) -> None:
        await played.announced.is_connected.wait()
        await publish(broker, 0, N // 3)
        await played.until(lambda: played.passed(N // 3))
        broker.kill()
        await lost(played, "mqtt://127.0.0.1")
        await asyncio.to_thread(broker.start)
        await played.until(lambda: bool(part_of(played)["ok"]))
        await publish(broker, N // 3, N)
        await played.until(lambda: played.passed(N))
        assert played.summary["monitoring"] == "running"

    assert_whole(followed(f"mqtt://127.0.0.1:{broker.port}/plant/loop", course))


def test_values_that_all_turn_bad_are_no_data(broker: Mosquitto) -> None:
    """The source works and rows come, but nothing is watched; it is again once values are good."""

    async def course(played: Played) -> None:
        await played.announced.is_connected.wait()
        await publish(broker, 0, N // 3)
        await played.until(lambda: played.passed(N // 3))
        played.steady.now += 11.0
        await publish(broker, N // 3, 2 * N // 3, quality="bad")
        await played.until(lambda: played.passed(2 * N // 3))
        assert part_of(played)["ok"]
        shown = played.summary
        assert (shown["status"], shown["monitoring"]) == ("CHECK_FUNCTION", "no data")
        assert shown["headline"] == "No data for 11 s: what came last has no usable value of any sensor."
        await publish(broker, 2 * N // 3, N)
        await played.until(lambda: played.passed(N))
        assert played.summary["monitoring"] == "running"

    played = followed(f"mqtt://127.0.0.1:{broker.port}/plant/loop", course)
    (log,) = played.store.logs.values()
    kept = [item[1].quality for item in log.rows if item is not None]
    bad = [row is not None and bool((row == Quality.BAD).all()) for row in kept]
    assert bad == [N // 3 <= k < 2 * N // 3 for k in range(N)]


class Wire:
    """A wire to a broker that can be cut so that nobody hears of it."""

    def __init__(self, port: int) -> None:
        self.port, self.is_cut = port, False
        self._tasks: set[asyncio.Task[None]] = set()
        self._server: asyncio.Server | None = None

    async def lay(self) -> int:
        """Give the port of its near end."""
        self._server = await asyncio.start_server(self._join, "127.0.0.1", 0)
        return int(self._server.sockets[0].getsockname()[1])

    async def take_away(self) -> None:
        """Close it."""
        for task in self._tasks:
            task.cancel()
        if self._server is not None:
            self._server.close()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _join(self, near_in: asyncio.StreamReader, near_out: asyncio.StreamWriter) -> None:
        if self.is_cut:
            near_out.close()
            return
        far_in, far_out = await asyncio.open_connection("127.0.0.1", self.port)
        for source, target in ((near_in, far_out), (far_in, near_out)):
            self._tasks.add(asyncio.create_task(self._pass_on(source, target)))

    async def _pass_on(self, source: asyncio.StreamReader, target: asyncio.StreamWriter) -> None:
        while data := await source.read(65536):
            if not self.is_cut:
                target.write(data)
                await target.drain()
        target.close()


def test_a_network_that_is_cut(broker: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> None:
    """Nobody closes the connection; it is noticed by the signs of life that fail to come."""
    monkeypatch.setattr("faultbond.service.sources.mqtt.KEEP_ALIVE", 1)
    monkeypatch.setattr("faultbond.service.sources.mqtt.TIMEOUT", 1.0)

    async def whole() -> Played:
        wire = Wire(broker.port)
        address = f"mqtt://127.0.0.1:{await wire.lay()}/plant/loop"
        played = Played(opened=lambda _, subscribers: open_source(address, subscribers))
        running = asyncio.create_task(played.service.run())
        try:
            await played.announced.is_connected.wait()
            await publish(broker, 0, N // 3)
            await played.until(lambda: played.passed(N // 3))
            wire.is_cut = True
            await lost(played, "mqtt://127.0.0.1")
            wire.is_cut = False
            await played.until(lambda: bool(part_of(played)["ok"]))
            await publish(broker, N // 3, N)
            await played.until(lambda: played.passed(N))
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
            await wire.take_away()
        return played

    assert_whole(asyncio.run(asyncio.wait_for(whole(), TIMEOUT)))


def write(path: Path, first: int, last: int) -> None:
    """Write some rows at the end of a file, which is begun where it is not there."""
    is_new = not path.exists()
    with path.open("a") as stream:
        if is_new:
            stream.write(",".join([TIME, *HEADERS]) + "\n")
        for k in range(first, last):
            stream.write(",".join(map(repr, said(k).values())) + "\n")


def test_a_file_that_is_rotated_and_then_gone_for_a_while(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Rotation is no loss, and nothing is read twice; a file that is gone is one, until it is back."""
    monkeypatch.setattr("faultbond.service.sources.growing_file.GONE", 0.3)
    path = tmp_path / "live.csv"

    async def course(played: Played) -> None:
        await lost(played, "No such file")
        write(path, 0, 0)
        await played.until(lambda: bool(part_of(played)["ok"]))
        write(path, 0, N // 3)
        await played.until(lambda: played.passed(N // 3))
        path.rename(tmp_path / "live.csv.1")
        write(path, N // 3, 2 * N // 3)
        await played.until(lambda: played.passed(2 * N // 3))
        assert part_of(played)["ok"]
        path.unlink()
        await lost(played, "the file is gone")
        path.touch()
        await played.until(lambda: bool(part_of(played)["ok"]))
        path.unlink()
        write(path, 2 * N // 3, N)
        await played.until(lambda: played.passed(N))
        assert played.summary["monitoring"] == "running"

    played = followed(f"file:{path}", course)
    assert_whole(played, n_lost=2)
