"""Memory that is free goes back to the system.

After the work of an alarm the C library keeps what was freed, in case it is needed again: in a service that runs for
months that looks like a leak, and other programs do without it.
"""

import ctypes
import gc
from collections.abc import Callable
from functools import cache
from typing import Any

M_MMAP_THRESHOLD, M_ARENA_MAX = -3, -8  # of glibc's malloc.h
LARGE = 128 * 1024  # bytes; glibc's own limit rises to the largest piece that was ever free, and stays there
ARENAS = 2  # parts of memory that threads share, each with a reserve; glibc would have up to eight a processor


def keep_little() -> None:
    """Let the C library keep little in reserve, where it is glibc: a large piece goes back as soon as it is free."""
    choose = _function("mallopt", ctypes.c_int, ctypes.c_int)
    if choose is not None:
        choose(M_MMAP_THRESHOLD, LARGE)
        choose(M_ARENA_MAX, ARENAS)


def give_back() -> None:
    """Give back what is free: objects that hold only each other, and what the C library has in reserve, if it is glibc.

    Python by itself looks for such objects when a quarter more has come to stay: in a service megabytes.
    """
    gc.collect()
    trim = _function("malloc_trim", ctypes.c_size_t)
    if trim is not None:
        trim(0)


@cache
def _function(name: str, *takes: type) -> Callable[..., Any] | None:
    try:
        found = getattr(ctypes.CDLL(None), name)
    except (AttributeError, OSError, TypeError):  # no such function; no such library; none by that name, as on Windows
        return None
    found.argtypes, found.restype = takes, ctypes.c_int
    return found  # type: ignore[no-any-return]
