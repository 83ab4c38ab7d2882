"""Compiling the emitted C in process, once per model, version, compiler and processor.

Several processes may start at once: each compiles to a file of its own and renames it into place, so nobody ever sees
half a library.
"""

import os
import platform
import shutil
import subprocess
import sys
import tempfile
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from faultbond.errors import GenerationError

FLAGS = ("-O2", "-march=native", "-fno-math-errno", "-fno-trapping-math", "-shared", "-fPIC", "-std=gnu11", "-w")
_TIMEOUT = 600.0


def cache_folder() -> Path:
    """Give the folder for compiled engines: `FAULTBOND_CACHE`, else the user's cache folder."""
    chosen = os.environ.get("FAULTBOND_CACHE")
    base = Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")
    return Path(chosen) if chosen else base / "faultbond"


def find_compiler() -> tuple[str, ...] | None:
    """Give the command of a C compiler: `CC`, `cc`, `gcc`, `clang`, or the ziglang package; None if there is none."""
    for name in (os.environ.get("CC"), "cc", "gcc", "clang"):
        if name and shutil.which(name):
            return (name,)
    if find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc")
    return None


def compile_library(source: str, compiler: tuple[str, ...]) -> Path:
    """Give the path of the shared library of a C source, compiling it if the cache does not hold it.

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message.
    """
    folder = cache_folder()
    key = sha256("\0".join((source, *compiler, *FLAGS, _processor())).encode()).hexdigest()[:32]
    library = folder / f"{key}.so"
    if library.exists():
        return library
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryDirectory(dir=folder) as work:
            _compile(source, compiler, Path(work)).replace(library)
    except OSError as problem:
        raise GenerationError(f"{folder}: the cache cannot be written ({problem}); set FAULTBOND_CACHE") from problem
    return library


def _compile(source: str, compiler: tuple[str, ...], work: Path) -> Path:
    """Give the path of the library, compiled in the folder `work`."""
    text, built = work / "engine.c", work / "engine.so"
    text.write_text(source)
    command = [*compiler, *FLAGS, str(text), "-o", str(built), "-lm"]
    try:
        done = subprocess.run(command, capture_output=True, text=True, timeout=_TIMEOUT, check=False)  # noqa: S603 - our own text, no shell
    except (OSError, subprocess.TimeoutExpired) as problem:
        raise GenerationError(f"the C compiler {compiler[0]} did not finish: {problem}") from problem
    if done.returncode != 0:
        first = (done.stderr.strip() or "no message").splitlines()[0]
        raise GenerationError(f"the C compiler {compiler[0]} failed: {first}")
    return built


def _processor() -> str:
    """Name the machine's instruction set, so that a cache on a shared disk serves only like processors."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        return platform.machine() + platform.processor()
    flags = next((line for line in lines if line.startswith(("flags", "Features"))), "")
    return platform.machine() + flags
