"""Sparkplug B through a real broker: wills, kept births, a broker that is killed, and how much it takes."""

import asyncio
import sys
import time
from collections.abc import Iterable
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.broker import Mosquitto

from arriving import COLUMNS, WAITS, Gathered, listening, n_rows, subscriber
from faultbond.errors import SourceError
from faultbond.io.recording import Column, Columns
from faultbond.model.graph import TimeColumn, Unit
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions
from loop_asset import plant, rows
from played import Played, play
from sparkplug_node import EdgeNode, Message, metric

aiomqtt = pytest.importorskip("aiomqtt", reason="there is no aiomqtt: pip install 'faultbond[mqtt]'")
pytest.importorskip("google.protobuf", reason="there is no protobuf: pip install 'faultbond[mqtt]'")
N = 120  # rows of the loop that are told


@pytest.fixture(autouse=True)
def quick(monkeypatch: pytest.MonkeyPatch) -> None:
    """Let a source be opened again at once."""
    monkeypatch.setattr("faultbond.service.station.FIRST_DELAY", 0.1)
    monkeypatch.setattr("faultbond.service.station.LONGEST_DELAY", 0.2)


def address(broker: Mosquitto, device: str = "/loop") -> str:
    """Give where the device is read."""
    return f"mqtt://127.0.0.1:{broker.port}/spBv1.0/hall/+/gateway{device}"


def connected(broker: Mosquitto, node: EdgeNode | None = None) -> Any:
    """Give a client, with the last will of a node."""
    topic, data = node.death() if node is not None else ("", b"")
    will = aiomqtt.Will(topic, data, qos=1) if node is not None else None
    return aiomqtt.Client("127.0.0.1", broker.port, will=will)


async def send(client: Any, messages: Iterable[Message], *, retain: bool = False) -> None:
    """Publish messages as a node does."""
    for name, data in messages:
        await client.publish(name, data, qos=int(retain), retain=retain)


def told(k: int, *, names: bool) -> list[bytes]:
    """Give a row of the loop as metrics."""
    columns = [item.header for item in (*plant().columns.inputs, *plant().columns.outputs)]
    found = rows()
    values = [*found.u[k].tolist(), *found.y[k].tolist()]
    at = float(found.time[k])
    return [
        metric(name if names else None, value, alias=j, at=at, is_typed=names)
        for j, (name, value) in enumerate(zip(columns, values, strict=True))
    ]


def test_a_service_has_no_data_from_a_will_until_the_next_birth(broker: Mosquitto) -> None:
    """A node that is cut off is dead by the will that it left; the asset is never normal before its device is born."""

    async def course(played: Played) -> None:
        await played.announced.is_connected.wait()
        node = EdgeNode(bd_seq=1)
        client = connected(broker, node)
        await client.__aenter__()
        begun = [node.birth(), node.device_birth(*told(0, names=True), device="loop")]
        await send(client, [*begun, *(node.data(*told(k, names=False), device="loop") for k in range(1, N))])
        await played.until(lambda: played.passed(N))
        assert played.summary["monitoring"] == "running"
        client._client._sock_close()  # the wire is cut: no goodbye
        await played.until(lambda: played.summary["monitoring"] == "no data")
        assert played.summary["status"] == "CHECK_FUNCTION"
        dead = "edge node gateway is dead, and what it sent is of the past until its next birth."
        assert played.summary["headline"] == f"No data for 0 s: {dead}"
        again = EdgeNode(bd_seq=2)
        async with connected(broker, again) as client:
            await send(client, [again.birth(at=5.0), again.data(*told(N, names=True), device="loop")])
            await played.until(lambda: played.service.asset("loop")["counts"].get("unborn", 0) > 0)
            assert played.summary["monitoring"] == "no data"
            await send(client, [again.device_birth(*told(N, names=True), device="loop", at=6.0)])
            await played.until(lambda: played.passed(N + 1))
            await played.until(lambda: played.summary["monitoring"] == "running")
        assert played.service.asset("loop")["counts"]["deaths"] == 1

    played = Played(opened=lambda _, subscribers: open_source(address(broker), subscribers))
    play(played, course)
    (log,) = played.store.logs.values()
    found = [item[1].time for item in log.rows if item is not None]
    np.testing.assert_allclose(found, rows().time[: N + 1])


def test_a_broker_that_was_killed_has_no_births(broker: Mosquitto) -> None:
    """After it values by alias wait for a birth: who knows what was missed? Names are read at once."""

    async def course() -> Gathered:
        source, found, node = open_source(address(broker, "/pump"), [subscriber()]), Gathered(), EdgeNode()
        values = [("u", 50.0), ("y", 2.5), ("z", 20.0)]
        named = [metric(name, value, alias=k, at=1.0) for k, (name, value) in enumerate(values)]
        short = [metric(None, value, alias=k, at=2.0, is_typed=False) for k, (_, value) in enumerate(values)]
        async with listening(source, into=found) as task, connected(broker) as client:
            await send(client, [node.birth(), node.device_birth(*named)])
            while not n_rows(1)(found):
                await asyncio.sleep(0.005)
            await asyncio.to_thread(broker.kill)
            with pytest.raises(SourceError):
                await asyncio.wait_for(task, WAITS)
        await asyncio.to_thread(broker.start)
        async with listening(source, n_rows(2), into=found) as task, connected(broker) as client:
            await send(client, [node.data(*short), node.data(*[metric(name, v, at=3.0) for name, v in values])])
            return await asyncio.wait_for(task, WAITS)

    found = asyncio.run(asyncio.wait_for(course(), 3.0 * WAITS))
    assert found.rows()[:, 0].tolist() == [1.0, 3.0]
    assert found.counts() == {"unborn": 3}


@pytest.mark.parametrize("asked", ["", "?births=0"])
def test_births_that_the_broker_keeps_are_taken(broker: Mosquitto, asked: str) -> None:
    """As brokers that know Sparkplug keep them, unless they are not asked for; a new one there is none of its own."""

    async def course() -> Gathered:
        node = EdgeNode()
        values = [("u", 50.0), ("y", 2.5), ("z", 20.0)]
        named = [metric(name, value, alias=k, at=1.0) for k, (name, value) in enumerate(values)]
        short = [metric(None, value, alias=k, at=2.0, is_typed=False) for k, (_, value) in enumerate(values)]
        births = [(f"$sparkplug/certificates/{name}", data) for name, data in (node.birth(), node.device_birth(*named))]
        async with connected(broker) as client:
            await send(client, births, retain=True)
            source = open_source(f"{address(broker, '/pump')}{asked}", [subscriber()])
            told = lambda seen: any(len(item.rows) or item.counts for item in seen.arrivals)  # noqa: E731
            async with listening(source, told) as task:
                await send(client, births, retain=True)
                await send(client, [node.data(*short)])
                return await asyncio.wait_for(task, WAITS)

    found = asyncio.run(asyncio.wait_for(course(), 3.0 * WAITS))
    if asked:
        assert found.counts() == {"unborn": 3}
    else:
        np.testing.assert_allclose(found.rows(), [[2.0, 50.0, 2500.0, 293.15]])
        assert found.counts() == {}


WIDE = Columns(
    time=TimeColumn(),
    inputs=COLUMNS.inputs,
    outputs=tuple(Column(header=f"s{k}", unit=Unit("Pa"), role=f"sensor s{k}") for k in range(19)),
    sample_time=0.01,
)


@pytest.mark.parametrize("one_by_one", [False, True])
def test_twenty_metrics_at_a_hundred_hertz(broker: Mosquitto, *, one_by_one: bool) -> None:
    """None is lost, whether a message has a row or one of 2000 values in a second."""
    n = 300

    async def course() -> tuple[Gathered, float]:
        options = SourceOptions(together=0.0, hold={"one": ()})
        source = open_source(address(broker, "/pump"), [subscriber("one", WIDE)], options)
        node, names = EdgeNode(), ["u", *(f"s{k}" for k in range(19))]
        async with listening(source, n_rows(n)) as task, connected(broker) as client:
            begun = time.monotonic()
            await send(client, [node.birth(at=time.time())])
            for k in range(n):
                await asyncio.sleep(max(begun + 0.01 * k - time.monotonic(), 0.0))
                now = time.time()
                row = [
                    metric(None if k else name, k + float(j), alias=j, at=now, is_typed=not k)
                    for j, name in enumerate(names)
                ]
                if not k:
                    await send(client, [node.device_birth(*row, at=now)])
                else:
                    parts = [[item] for item in row] if one_by_one else [row]
                    await send(client, [node.data(*part, at=now) for part in parts])
            return await asyncio.wait_for(task, WAITS), time.monotonic() - begun

    found, lasted = asyncio.run(asyncio.wait_for(course(), 3.0 * WAITS))
    np.testing.assert_array_equal(found.rows()[:, 2:], np.arange(n)[:, None] + np.arange(1, 20))
    late = np.concatenate([item.arrived - item.rows.time for item in found.arrivals if len(item.rows)])
    sys.stderr.write(f"p50 {np.median(late):.3f} s, p99 {np.quantile(late, 0.99):.3f} s, {lasted:.1f} s\n")
    assert found.counts() == {}
