"""Memory that is free goes back to the system.

After the work of an alarm the C library keeps what was freed, in case it is needed again: in a service that runs for
months that looks like a leak, and other programs do without it.
"""

import ctypes
from collections.abc import Callable
from functools import cache
from typing import Any


def give_back() -> None:
    """Give back what the C library holds in reserve, where it is one that does so when asked, as glibc's."""
    trim = _trim()
    if trim is not None:
        trim(0)


@cache
def _trim() -> Callable[[int], Any] | None:
    try:
        trim = ctypes.CDLL(None).malloc_trim
    except (AttributeError, OSError, TypeError):  # no such function; no such library; none by that name, as on Windows
        return None
    trim.argtypes, trim.restype = (ctypes.c_size_t,), ctypes.c_int
    return trim
