"""200 pages that look at one service."""

import asyncio
import tempfile
import time
from collections import Counter
from contextlib import suppress
from pathlib import Path

import numpy as np

from benchmarks.service.served import Served, events
from benchmarks.shared.page import Row

VIEWERS = 200
MEASURED = 30.0  # s
SPEED = 10  # samples of the tank in a second


async def _follow(address: str, came: dict[float, list[float]], ready: asyncio.Semaphore) -> None:
    """Look at the tank, and note when each sample came."""
    async for name, told in events(address, "tank"):
        if name == "asset":
            ready.release()
        if name == "samples":
            now = time.time()
            for moment in told["time"]:
                came.setdefault(moment, []).append(now)


async def _measured(service: Served) -> tuple[float, dict[float, list[float]]]:
    came: dict[float, list[float]] = {}
    ready = asyncio.Semaphore(0)
    viewers = [asyncio.create_task(_follow(service.address, came, ready)) for _ in range(VIEWERS)]
    async with asyncio.timeout(60.0):
        for _ in viewers:
            await ready.acquire()
    came.clear()
    begin, before = time.time(), service.processor_time()
    await asyncio.sleep(MEASURED)
    share = (service.processor_time() - before) / (time.time() - begin)
    for viewer in viewers:
        viewer.cancel()
    for viewer in viewers:
        with suppress(asyncio.CancelledError):
            await viewer
    return share, came


def rows() -> list[Row]:
    """Measure, and give lines of the table."""
    with tempfile.TemporaryDirectory() as folder, Served(Path(folder), "--source", f"sim:?speed={SPEED}") as service:
        service.until(lambda told: told["assets"][0]["samples"] > 0)
        share, came = asyncio.run(_measured(service))
    moments = sorted(came)[SPEED:-SPEED]  # all were there from the first to the last of them
    counts = Counter(len(came[moment]) for moment in moments)
    # the first page that is told has what the service takes; the others may not be much later
    spread = np.array([max(came[moment]) - min(came[moment]) for moment in moments])
    behind = sum(count for told, count in counts.items() if told != VIEWERS)
    return [
        Row(
            figure=f"{VIEWERS} pages on the tank at {SPEED} samples a second: samples that did not come to each",
            asked="0",
            got=f"{behind} of {len(moments)}",
            met=behind == 0,
        ),
        Row(
            figure="the same: between the first and the last page that a sample comes to, 99th percentile",
            asked="",
            got=f"{1e3 * np.quantile(spread, 0.99):.0f} ms; {100 * share:.0f} % of a core",
            met=None,
        ),
    ]
