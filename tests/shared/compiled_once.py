"""What compilers make of texts, kept from one run of the tests to the next: of the same bytes they make the same."""

import os
import shutil
import stat
import subprocess
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from functools import cache
from hashlib import sha256
from pathlib import Path
from types import MappingProxyType

from faultbond.io.cache import cache_folder
from faultbond.synthesis.compile import CORE, compiler_identity, processor

SOURCE = Path(str(CORE)).parent
HERE = Path(__file__).parent
KEPT = cache_folder() / "tests"  # of the whole run, whatever cache a test has
MOST_BYTES = 600_000_000
NOTHING: Mapping[str, str] = MappingProxyType({})
READING = {"-S", "-fsyntax-only"}  # of a compiler that is asked only whether it has a word to say


def compiled_once(text: str, target: Path, command: Sequence[str], headers: Mapping[str, str] = NOTHING) -> Path:
    """Compile a text with a command into a file, unless that was done before; what the compiler says is the failure.

    headers : texts by their names, which are written beside the file and found there
    """

    def compiled() -> bytes:
        source = target.with_name(f"{target.stem}_text.c")
        source.write_text(text)
        for name, content in headers.items():
            target.with_name(name).write_text(content)
        words = [*command, f"-I{target.parent}", str(source), "-o", str(target), "-lm"]
        done = subprocess.run(words, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[:4000]
        return b"" if READING & {*command} else target.read_bytes()

    told = (text, *headers, *headers.values(), *_around(), compiler_identity(tuple(command)), processor())
    return made_once(told, target, compiled)


def made_once(told: Sequence[str], target: Path, make: Callable[[], bytes]) -> Path:
    """Make a file, unless that was done before of all that is told; `make` gives what is kept of it."""
    kept = KEPT / sha256("\0".join(told).encode()).hexdigest()
    with suppress(OSError):
        if _is_ours(KEPT) and _is_ours(kept):  # it is code that is run
            os.utime(kept)
            shutil.copy(kept, target)
            return target
    content = make()
    with suppress(OSError):  # without a place to keep it, it is made again the next time
        _keep(kept, content)
    return target


@cache
def _around() -> tuple[str, ...]:
    """All that such a text may include."""
    folders = (SOURCE / "core", SOURCE / "program", HERE, HERE.parent / "fuzz")
    places = (path for folder in folders for path in folder.iterdir())
    return tuple(path.read_text(encoding="utf-8") for path in sorted(places) if path.suffix in {".c", ".h"})


def _keep(place: Path, content: bytes) -> None:
    """Put a file into its place as a whole; what was not used for longest makes room."""
    KEPT.mkdir(mode=0o700, parents=True, exist_ok=True)
    if not _is_ours(KEPT):
        return
    draft = place.with_suffix(f".{os.getpid()}")
    draft.write_bytes(content)
    draft.chmod(0o700)
    draft.replace(place)
    room = MOST_BYTES
    for path, size in _newest_first():
        room -= size
        if room < 0:
            path.unlink(missing_ok=True)


def _is_ours(path: Path) -> bool:
    """Whether only this user, or the system's, may write a file or a folder, and it is no link to another."""
    about = path.lstat()
    others = stat.S_IWGRP | stat.S_IWOTH
    return about.st_uid in (os.geteuid(), 0) and not stat.S_ISLNK(about.st_mode) and not about.st_mode & others


def _newest_first() -> Iterator[tuple[Path, int]]:
    """All files with their sizes."""
    found = []
    for path in KEPT.iterdir():
        with suppress(OSError):  # another process made room
            about = path.stat()
            found.append((about.st_mtime_ns, path, about.st_size))
    yield from ((path, size) for _, path, size in sorted(found, reverse=True))
