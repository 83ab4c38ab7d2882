"""20 signals at 100 Hz, from a broker through core and store to a page."""

import asyncio
import json
import shutil
import tempfile
import time
from contextlib import suppress
from dataclasses import dataclass, field
from pathlib import Path

import aiomqtt
import numpy as np

from benchmarks.service.served import Served, events
from benchmarks.shared.broker import MOSQUITTO, Mosquitto
from benchmarks.shared.page import Row
from faultbond.arrays import FloatArray
from faultbond.model.text import parse_model
from faultbond.simulate import Inputs, simulate

SECTIONS = 6
STEP = 0.01  # s
SETTLED = 10.0  # s before anything is measured: the start of the filter, and of the program
MEASURED = 60.0  # s


def model() -> str:
    """Give a ladder of resistors and capacitors that reads each voltage and current: 18 sensors and 2 inputs."""
    parts = ["  source: {type: Se, law: e = u}", "  load: {type: Sf, law: f = i_load}"]
    junctions, bonds, last = list[str](), list[str](), "source"
    sensors = list[str]()
    for k in range(1, SECTIONS + 1):
        parts.append(f"  R{k}: {{type: R, parameters: {{R{k}: 2 ohm}}}}")
        parts.append(f"  C{k}: {{type: C, parameters: {{C{k}: 0.3 F}}}}")
        junctions += [f"line{k}: 1", f"node{k}: 0"]
        bonds += [f"{last} -> line{k} -> R{k}", f"line{k} -> node{k} -> C{k}"]
        sensors.append(f"  v{k}: {{reads: node{k}.e, unit: V, noise: 10 mV}}")
        sensors.append(f"  i{k}: {{reads: line{k}.f, unit: A, noise: 10 mA}}")
        sensors.append(f"  c{k}: {{reads: C{k}.f, unit: A, noise: 10 mA}}")
        last = f"node{k}"
    lines = ("name: ladder", f"sample_time: {STEP} s", "max_faults: 1", "time: {column: time}")
    inputs = ("inputs:", "  u: {unit: V}", "  i_load: {unit: A}", "components:", *parts)
    joined = (f"junctions: {{{', '.join(junctions)}}}", f"bonds: [{', '.join([*bonds, f'{last} -> load'])}]")
    return "\n".join((*lines, *inputs, *joined, "sensors:", *sensors, ""))


def recording(n: int) -> tuple[list[str], FloatArray]:
    """Give names and values (n, 20) of a healthy ladder whose voltage and load move."""
    graph = parse_model(model())
    when: FloatArray = STEP * np.arange(n, dtype=np.float64)
    values = np.column_stack([5.0 + (when // 7 % 2), 0.2 * (when // 11 % 2)])
    made = simulate(graph, Inputs(time=when, values=values), [], seed=1)
    names = [item.name for item in graph.inputs] + [item.name for item in graph.sensors]
    return names, np.column_stack([made.inputs, made.outputs])


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


async def _publish(port: int, names: list[str], values: FloatArray, last: float) -> list[float]:
    """Publish a row each 10 ms, and give the times that they had."""
    sent = list[float]()
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
            sent.append(moment)
    return sent


async def _measured(service: Served, port: int) -> tuple[float, list[float], _Seen]:
    """Give the share of a core, the times of what was sent while it was measured, and what the page saw."""
    names, values = recording(round((SETTLED + MEASURED + 5.0) / STEP))
    seen, end = _Seen(), time.time() + SETTLED + MEASURED
    watching = asyncio.create_task(seen.follow(service.address))
    publishing = asyncio.create_task(_publish(port, names, values, end))
    await asyncio.sleep(SETTLED)
    begin, before = time.time(), service.processor_time()
    sent = await publishing
    share = (service.processor_time() - before) / (time.time() - begin)
    await asyncio.sleep(2.0)
    watching.cancel()
    with suppress(asyncio.CancelledError):
        await watching
    return share, [moment for moment in sent if moment > begin], seen


def rows() -> list[Row]:
    """Measure, and give lines of the table."""
    if MOSQUITTO is None:
        return []
    folder = Path(tempfile.mkdtemp())
    try:
        (folder / "ladder.yaml").write_text(model(), encoding="utf-8")
        broker = Mosquitto(folder)
        broker.start()
        try:
            with Served(folder, "ladder.yaml", "--source", f"mqtt://127.0.0.1:{broker.port}/plant/+") as service:
                share, sent, seen = asyncio.run(_measured(service, broker.port))
                (asset,) = service.until(lambda told: True)["assets"]
        finally:
            broker.kill()
    finally:
        shutil.rmtree(folder)
    grid = np.array(sorted(seen.came))
    nearest = [grid[np.argmin(np.abs(grid - moment))] for moment in sent]
    lost = sum(abs(at - moment) > 0.6 * STEP for at, moment in zip(nearest, sent, strict=True))
    late = np.array([seen.came[at] - moment for at, moment in zip(nearest, sent, strict=True)])
    p50, p99 = 1e3 * np.quantile(late, [0.5, 0.99])
    told = f"{len(sent)} samples, {asset['status']}"
    return [
        Row(
            figure=f"20 signals at 100 Hz by MQTT through core, store and page ({told}): share of a core",
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
