"""Memory that is free goes back to the system, once a minute."""

import asyncio
import platform
import subprocess
import sys
import weakref

import pytest

from faultbond.service import memory
from faultbond.service.station import GIVE_BACK_EVERY
from played import Played, play

BETWEEN = """
from pathlib import Path
from faultbond.service.memory import give_back

def resident():
    return 4096 * int(Path("/proc/self/statm").read_text().split()[1])

pieces = [bytes(1000 + k % 977) for k in range(50000)]
few = pieces[::50]  # so that what is freed lies between what is not
del pieces
before = resident()
give_back()
print(before - resident())
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_what_was_freed_between_what_was_not_goes_back() -> None:
    """Tens of megabytes, which the C library keeps else."""
    done = subprocess.run([sys.executable, "-c", BETWEEN], capture_output=True, text=True, check=True)
    assert int(done.stdout) > 40e6


def test_objects_that_hold_only_each_other_go() -> None:
    """However few they are."""

    class Held:
        def __init__(self) -> None:
            self.itself = self

    seen = weakref.ref(Held())
    assert seen() is not None
    memory.give_back()
    assert seen() is None


LARGE = """
import numpy as np
from faultbond.service.memory import keep_little

def resident():
    return 4096 * int(open("/proc/self/statm").read().split()[1])

if ASKED:
    keep_little()
np.ones(2**21)  # a piece of 16 MB that is free again: from now on glibc would keep as much
before = resident()
pieces = [np.ones(2**19) for _ in range(6)]
few = [np.ones(40) for _ in range(2000)]
del pieces
print(resident() - before)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_large_pieces_go_back_as_soon_as_they_are_free() -> None:
    """Tens of megabytes, which the C library keeps else where something small came to lie behind them."""
    kept = []
    for asked in (False, True):
        program = LARGE.replace("ASKED", str(asked))
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        kept.append(int(done.stdout))
    assert kept[0] > 20e6
    assert kept[1] < 3e6


THREADS = """
import ctypes, threading
from faultbond.service.memory import keep_little

if ASKED:
    keep_little()
met = threading.Barrier(6)

def work():
    kept = [bytes(1000 + k) for k in range(1000)]
    met.wait()

threads = [threading.Thread(target=work) for _ in range(6)]
for thread in threads:
    thread.start()
for thread in threads:
    thread.join()
library = ctypes.CDLL(None)
library.malloc_info(0, ctypes.c_void_p.in_dll(library, "stdout"))
library.fflush(None)
"""


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="another C library")
def test_threads_share_what_is_kept_for_them() -> None:
    """Six threads have two parts of memory, and not one each."""
    parts = []
    for asked in (False, True):
        program = THREADS.replace("ASKED", str(asked))
        done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True)
        parts.append(done.stdout.count("<heap nr="))
    assert parts[0] > memory.ARENAS
    assert parts[1] == memory.ARENAS


def test_a_library_that_has_no_such_function_is_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """As where the C library is another one."""
    monkeypatch.setattr("ctypes.CDLL", lambda name: object())
    memory._function.cache_clear()
    memory.give_back()
    memory.keep_little()
    assert memory._function("malloc_trim") is None
    memory._function.cache_clear()


def test_a_service_gives_it_back_once_a_minute(monkeypatch: pytest.MonkeyPatch) -> None:
    """And not at each look at its parts."""
    monkeypatch.setattr("faultbond.service.station.TICK", 0.01)
    given = list[None]()
    monkeypatch.setattr("faultbond.service.station.give_back", lambda: given.append(None))

    async def course(played: Played) -> None:
        await played.until(lambda: played.passed(20))
        await asyncio.sleep(0.1)
        assert not given
        played.steady.now += GIVE_BACK_EVERY
        await played.until(lambda: bool(given))
        await asyncio.sleep(0.1)

    play(Played(), course)
    assert len(given) == 1
