"""Compiling the emitted C in process, once per model, version, compiler and processor.

Several processes may start at once: each compiles to a file of its own and renames it into place, so nobody ever sees
half a library. A library is code: it is loaded only from a folder, and as a file, that nobody else may write, and if a
checksum at its end, over its name and content, says that it is whole and in its place; else it is built anew.
"""

import os
import platform
import shlex
import shutil
import stat
import subprocess
import sys
import tempfile
from hashlib import sha256
from importlib.util import find_spec
from pathlib import Path

from faultbond.errors import CacheError, GenerationError

FLAGS = (
    "-O3",
    "-march=native",
    "-fno-math-errno",
    "-fno-trapping-math",
    "-shared",
    "-fPIC",
    "-std=gnu11",
    "-w",
)
_TIMEOUT = 600.0
_CHECKSUM = 32  # bytes at the end of a library, behind what the loader reads


def cache_folder() -> Path:
    """Give the folder for compiled engines: `FAULTBOND_CACHE`, else the user's cache folder.

    A user who has no home, as in some containers, has one below the system's folder for temporary files.
    """
    chosen, base = os.environ.get("FAULTBOND_CACHE"), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen)
    try:
        return (Path(base) if base else Path.home() / ".cache") / "faultbond"
    except RuntimeError:
        return Path(tempfile.gettempdir()) / f"faultbond-{os.getuid()}"


def find_compiler() -> tuple[str, ...] | None:
    """Give the command of a C compiler: `CC`, `cc`, `gcc`, `clang`, or the ziglang package; None if there is none."""
    try:
        chosen = tuple(shlex.split(os.environ.get("CC", "")))  # with options, `gcc -O2`, as a shell reads them
    except ValueError:  # quotation marks stay open
        chosen = ()
    for command in (chosen, ("cc",), ("gcc",), ("clang",)):
        if command and shutil.which(command[0]):
            return command
    if find_spec("ziglang") is not None:
        return (sys.executable, "-m", "ziglang", "cc")
    return None


def compile_library(source: str, compiler: tuple[str, ...]) -> Path:
    """Give the path of the shared library of a C source, compiling it if the cache does not hold it.

    Raises
    ------
    GenerationError
        Where the compiler fails; carries its first message.
    CacheError
        Where others may write the cache.
    """
    folder = cache_folder()
    key = sha256("\0".join((source, *compiler, *FLAGS, _processor())).encode()).hexdigest()[:32]
    library = folder / f"{key}.so"
    try:
        folder.mkdir(mode=0o700, parents=True, exist_ok=True)
        if not _is_ours(folder.stat()):  # others may put a library of theirs there
            raise CacheError(
                f"{folder}: others own this folder or may write it, and it holds code that is run. "
                f"Take it back, `chmod go-w {folder}`, or set FAULTBOND_CACHE to a folder of your own."
            )
        if _is_whole(library):
            return library
        with tempfile.TemporaryDirectory(dir=folder) as work:
            built = _compile(source, compiler, Path(work))
            built.write_bytes(_sealed(key, built.read_bytes()))
            built.chmod(0o700)
            built.replace(library)
    except OSError as problem:
        raise GenerationError(f"{folder}: the cache cannot be written ({problem}); set FAULTBOND_CACHE") from problem
    return library


def _is_ours(about: os.stat_result) -> bool:
    """Whether only this user, or the system's, may write a file."""
    if not hasattr(os, "geteuid"):
        return True
    return about.st_uid in (os.geteuid(), 0) and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _is_whole(library: Path) -> bool:
    """Whether a library is there, ours, undamaged and under its own name."""
    try:
        about = library.lstat()
        if not stat.S_ISREG(about.st_mode) or not _is_ours(about):
            return False
        content = library.read_bytes()
    except OSError:
        return False
    return content == _sealed(library.stem, content[:-_CHECKSUM])


def _sealed(key: str, content: bytes) -> bytes:
    """Give a library with its checksum."""
    return content + sha256(key.encode() + content).digest()


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
