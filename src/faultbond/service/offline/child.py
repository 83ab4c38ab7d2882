"""A process that does one analysis, within limits, and is ended with all that it began."""

import asyncio
import json
import os
import signal
import sys
from collections.abc import Callable, Sequence
from contextlib import suppress
from pathlib import Path

from faultbond.service.offline.limits import OfflineLimits

PACKAGES = Path(__file__).parents[3]  # where this package is, beside those that it needs or not
CONFINED = Path(__file__).with_name("confined.py")
OPEN_FILES = 256
MERCY = 5  # s of a processor between the signal of its limit and the end
PASSED = (  # of the environment; no password is among them
    *("PATH", "CC", "LD_LIBRARY_PATH", "FAULTBOND_HASTY"),
    *("OPENBLAS_CORETYPE", "OPENBLAS_L2_SIZE"),  # last digits go by them: drawings are laid out as by the command line
)
WORDS, ERRORS = "words.txt", "errors.txt"  # what it says on standard output, and on standard error


async def run_confined(
    words: Sequence[str],
    *,
    place: Path,
    out: Path,
    limits: OfflineLimits,
    seconds: float,
    begun: Callable[[int], None],
) -> int | None:
    """Run the command line in a folder; give its exit code, None where its time was over.

    Parameters
    ----------
    words : verb and arguments
    place : folder in which it works
    out : folder for what it says, with a folder `tmp` for what it needs meanwhile beside it
    limits : of it
    seconds : after which it is killed
    begun : is told the number of the process
    """
    program = [sys.executable, "-P", "-m", "faultbond", *words]
    confined = [sys.executable, "-I", str(CONFINED), json.dumps(_limits(limits)), str(os.getpid()), *program]
    with (out / WORDS).open("wb") as said, (out / ERRORS).open("wb") as wrong:
        child = await asyncio.create_subprocess_exec(
            *confined,
            cwd=place,
            env=_environment(out.parent / "tmp", Path(limits.folder) / "cache"),
            stdin=asyncio.subprocess.DEVNULL,
            stdout=said,
            stderr=wrong,
            start_new_session=True,  # a group of its own, which is ended as one
        )
    begun(child.pid)
    try:
        async with asyncio.timeout(max(seconds, 0.0)):
            return await child.wait()
    except TimeoutError:
        return None
    finally:
        with suppress(ProcessLookupError):  # whatever it began, and it where it is still there
            os.killpg(child.pid, signal.SIGKILL)
        await asyncio.shield(child.wait())


def _limits(limits: OfflineLimits) -> dict[str, tuple[int, int]]:
    processor = max(int(limits.processor), 1)
    return {
        "RLIMIT_AS": (limits.memory, limits.memory),
        "RLIMIT_CPU": (processor, processor + MERCY),
        "RLIMIT_FSIZE": (limits.results, limits.results),
        "RLIMIT_NOFILE": (OPEN_FILES, OPEN_FILES),
        "RLIMIT_CORE": (0, 0),
    }


def _environment(tmp: Path, cache: Path) -> dict[str, str]:
    """Give what a child knows of its surroundings: where programs, this package and its own folders are."""
    own = {name: os.environ[name] for name in PASSED if name in os.environ}
    threads = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS"), "1")  # each takes address space
    return {
        **own,
        **threads,
        "HOME": str(tmp),
        "TMPDIR": str(tmp),
        "LANG": "C.UTF-8",
        "PYTHONPATH": str(PACKAGES),
        "PYTHONDONTWRITEBYTECODE": "1",
        "FAULTBOND_CACHE": str(cache),  # of its own: what people bring must not push out what watches plants
    }


def share_read(process: int, file: str, size: int) -> float | None:
    """Give how much of a file a process has read, from 0 to 1; None where the system does not tell."""
    place = Path(f"/proc/{process}")
    with suppress(OSError, ValueError, StopIteration):
        for item in (place / "fd").iterdir():
            if os.readlink(item).endswith(f"/{file}"):
                lines = (place / "fdinfo" / item.name).read_text(encoding="ascii").splitlines()
                position = next(int(line.split()[1]) for line in lines if line.startswith("pos:"))
                return min(position / max(size, 1), 1.0)
    return None
