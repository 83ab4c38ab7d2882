"""Who came in, who went, and who was refused: entries of the audit log, of a burst of refusals one."""

import logging
import time
from collections.abc import Callable

from fastapi import Request

from faultbond.errors import StoreError
from faultbond.service.contract.face import Face
from faultbond.service.contract.messages import AuditEntry

WINDOW = 3600.0  # s in which what is refused alike is one entry
MOST_REFUSED = 100  # entries of refusals in that time: who floods the door with names must not fill the store
LONGEST_PATH = 200  # characters of what was asked that are kept
_LOG = logging.getLogger(__name__)


def address_of(request: Request) -> str:
    """Give from where somebody asks."""
    return request.client.host if request.client else ""


class AuditTrail:
    """Notes what people did at the door. Where the store cannot be written they come in all the same, to see why.

    Parameters
    ----------
    face : the service, which keeps the entries
    clock : gives s that only grow
    """

    def __init__(self, face: Face, clock: Callable[[], float] = time.monotonic) -> None:
        self._face, self._clock = face, clock
        self._refused: dict[tuple[str, ...], float] = {}  # when each was noted, the oldest first

    async def tell(self, what: str, who: str, request: Request, **about: str) -> None:
        """Note it; it is on the disk when this returns."""
        entry = AuditEntry(at=time.time(), who=who, what=what, about={"address": address_of(request), **about})
        try:
            await self._face.note(entry)
        except StoreError as error:
            _LOG.warning("%s of %r from %s is not in the audit: %s", what, who, address_of(request), error)

    async def tell_refused(self, what: str, who: str, request: Request, **about: str) -> None:
        """Note what was refused, unless the same was lately or much else was."""
        now, key = self._clock(), (what, who, address_of(request), *about.values())
        while self._refused and now - next(iter(self._refused.values())) > WINDOW:
            del self._refused[next(iter(self._refused))]
        if key in self._refused or len(self._refused) >= MOST_REFUSED:
            return
        self._refused[key] = now
        await self.tell(what, who, request, **about)

    async def tell_role(self, who: str, needs: str, request: Request) -> None:
        """Note that somebody asked for what takes another role."""
        asked = f"{request.method} {request.url.path}"[:LONGEST_PATH]
        await self.tell_refused("refused", who, request, asked=asked, needs=needs)
