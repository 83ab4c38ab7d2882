"""What a service manager is told of the service, as systemd asks it of a unit with `Type=notify`: sd_notify(3).

It is a few lines of text in a datagram to the socket that the environment names. Where it names none, nothing is told.
"""

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Mapping
from enum import Enum

LONGEST_STATUS = 1000  # characters
PATIENCE = 0.5  # s; who does not take it in this time does not hold the service up any longer
USUAL = 10.0  # s between two lines about the service where no sign of life is asked for


class UnitState(Enum):
    """What is told; the value is the line."""

    READY = "READY=1"
    ALIVE = "WATCHDOG=1"
    STOPPING = "STOPPING=1"


class ServiceManager:
    """Who started the service, if it wants to be told how it is.

    Parameters
    ----------
    environment : of the process: `NOTIFY_SOCKET`, `WATCHDOG_USEC`, `WATCHDOG_PID`
    """

    def __init__(self, environment: Mapping[str, str] = os.environ) -> None:
        named = environment.get("NOTIFY_SOCKET", "")
        self._address = named if named[:1] in ("/", "@") and hasattr(socket, "AF_UNIX") else ""
        usec, pid = (environment.get(name, "") for name in ("WATCHDOG_USEC", "WATCHDOG_PID"))
        ours = not pid or pid == str(os.getpid())
        self._watchdog = float(usec) * 1e-6 if self._address and ours and usec.isdecimal() and int(usec) else None

    @property
    def listens(self) -> bool:
        """Whether there is somebody to tell."""
        return bool(self._address)

    @property
    def watchdog(self) -> float | None:
        """The longest time between two signs of life, s; None: none are asked for."""
        return self._watchdog

    def tell(self, *states: UnitState, status: str = "") -> None:
        """Tell what is so now.

        Parameters
        ----------
        states : what is so from now on
        status : a line for people
        """
        if not self._address:
            return
        told = [*(item.value for item in states), *([f"STATUS={_one_line(status)}"] if status else [])]
        address = f"\0{self._address[1:]}" if self._address[0] == "@" else self._address
        with contextlib.suppress(OSError), socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as sent:
            sent.settimeout(PATIENCE)
            sent.sendto("\n".join(told).encode(), address)


async def reassure(manager: ServiceManager, is_alive: Callable[[], bool], status: Callable[[], str]) -> None:
    """Give signs of life, twice in the time in which one is wanted, for as long as there is life.

    This runs in the loop, so there are none either where that is stuck.
    """
    period = USUAL if manager.watchdog is None else 0.5 * manager.watchdog
    while manager.listens:
        if is_alive():
            manager.tell(UnitState.ALIVE, status=status())
        await asyncio.sleep(period)


def _one_line(text: str) -> str:
    return " ".join(text.split())[:LONGEST_STATUS]
