"""An off-line desk in a folder of its own, and somebody who brings models and recordings."""

import asyncio
import time
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from typing import Any

from faultbond.app.plant import WatchedPlant
from faultbond.service.contract.messages import AuditEntry
from faultbond.service.contract.offline import FileKind, JobOrder
from faultbond.service.offline.desk import OfflineDesk
from faultbond.service.offline.limits import OfflineLimits
from made import EXAMPLES

TANK = EXAMPLES / "tank"
ENDS = 150.0  # s that a test waits
ROWS = 1701  # of the recording, with the fault and a verdict
MODEL = (TANK / "model.yaml").read_bytes()
RC = EXAMPLES / "rc"
RECORDING = b"".join((TANK / "fault_pipe.csv").read_bytes().splitlines(keepends=True)[: ROWS + 1])


async def parts(content: bytes, size: int = 7000) -> AsyncIterator[bytes]:
    """Give a content as it comes over a wire."""
    for first in range(0, len(content), size):
        yield content[first : first + size]


class Bench:
    """A desk, and somebody who brings things. noted: what is kept of that."""

    def __init__(self, limits: OfflineLimits, plants: dict[str, WatchedPlant]) -> None:
        self.limits, self.plants = limits, plants
        self.noted: list[AuditEntry] = []
        self.refuses: Exception | None = None
        self.now = time.time()
        self.desk = self.made()

    def made(self) -> OfflineDesk:
        """Make the desk, as where the service begins."""
        return OfflineDesk(self.limits, self.plants, self.note, lambda: self.now)

    async def note(self, entry: AuditEntry) -> None:
        """Keep what somebody did, or refuse to."""
        if self.refuses is not None:
            raise self.refuses
        self.noted.append(entry)

    async def bring(
        self, content: bytes = RECORDING, name: str = "plant.csv", kind: str = "recording", who: str = "emma"
    ) -> str:
        """Bring a file and give its number."""
        told = await self.desk.take(name, FileKind(kind), who, parts(content))
        return str(told["id"])

    async def order(self, content: bytes = RECORDING, name: str = "plant.csv", **more: Any) -> str:
        """Bring a recording, order its analysis by the tank's model, and give the job's number."""
        wanted = {"who": "emma", "asset": "tank"} | more
        wanted = {key: value for key, value in wanted.items() if not (key == "asset" and "model" in more)}
        told = await self.desk.order(JobOrder(recording=await self.bring(content, name), **wanted))
        return str(told["id"])

    async def until(self, job: str, *states: str) -> Any:
        """Wait until a job stands so, and give it."""
        async with asyncio.timeout(ENDS):
            while (told := self.desk.job(job))["state"] not in (states or ("done", "failed", "stopped", "cut off")):
                await asyncio.sleep(0.02)
        return told

    @asynccontextmanager
    async def at_work(self) -> AsyncIterator[None]:
        """Let the desk do what is ordered."""
        running = asyncio.create_task(self.desk.run())
        try:
            yield
        finally:
            running.cancel()
            with suppress(asyncio.CancelledError):
                await running
