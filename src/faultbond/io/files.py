"""Files that are written as a whole: beside their place, and then renamed into it.

What is no file of its own, such as a pipe, `/dev/null` or `/dev/stdout`, cannot be replaced and is written as it is.
"""

import io
import os
import re
import secrets
import shutil
import stat
import sys
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import BinaryIO, TextIO

if sys.platform != "win32":
    from fcntl import LOCK_EX, flock

_STANDARD = {"/dev/stdin": 0, "/dev/stdout": 1, "/dev/stderr": 2}
_DESCRIPTOR = re.compile(r"/(?:dev|proc/self)/fd/(\d+)")
_LONGEST = 50  # characters of a name that its draft repeats

STANDARD_INPUT = "-"


@contextmanager
def locked(path: Path) -> Iterator[None]:
    """Keep others who ask for it away from a file while it is read and replaced.

    Where the system cannot lock its folder, as on Windows and on some network file systems, nobody is kept away.
    """
    parent, folder = path.resolve().parent, None
    if sys.platform != "win32":
        with suppress(OSError):
            folder = os.open(parent, os.O_RDONLY)
            flock(folder, LOCK_EX)
    try:
        yield
    finally:
        if folder is not None:
            os.close(folder)


@contextmanager
def replaced(path: Path, *, lasting: bool = True) -> Iterator[BinaryIO]:
    """Open a file to be written anew; until all is written, and if anything fails, there is what was there before.

    lasting : whether it is on the disk before it takes its place, so that a power cut loses neither; it takes 5 ms

    Raises
    ------
    OSError
        Where it cannot be written; it names the file.
    """
    try:
        if is_stream(path):
            with open_stream(path) as stream:
                yield stream
            return
        target = path.resolve()  # what a link points to is replaced, not the link
        draft = target.with_name(f".{target.name[:_LONGEST]}.{secrets.token_hex(4)}")
        if target.exists() and not os.access(target.parent, os.W_OK):
            draft = target  # nothing can be written beside it
        try:
            with draft.open("wb") as stream:
                yield stream
                stream.flush()
                if lasting:
                    os.fsync(stream.fileno())
            if draft != target:
                with suppress(OSError):
                    shutil.copymode(target, draft)
                draft.replace(target)
        finally:
            if draft != target:
                draft.unlink(missing_ok=True)
    except OSError as error:
        raise named(error, path) from error


@contextmanager
def replaced_text(path: Path, *, lasting: bool = True) -> Iterator[TextIO]:
    """Open a text file as `replaced` does; UTF-8, line breaks as they are written."""
    with replaced(path, lasting=lasting) as stream:
        text = io.TextIOWrapper(stream, encoding="utf-8", newline="")
        try:
            yield text
        finally:
            text.detach()


def named(error: OSError, path: Path) -> OSError:
    """Give what the system refused as an error that names the user's file."""
    return OSError(error.errno, error.strerror or str(error), str(path))


def is_stream(path: Path) -> bool:
    """Whether a path is an open descriptor, a pipe or a device."""
    if descriptor(path) is not None:
        return True
    try:
        return not stat.S_ISREG(path.stat().st_mode)
    except OSError:
        return False


def open_stream(path: Path) -> BinaryIO:
    """Open a pipe or device for writing; what is open already is shared, at the place where it stands."""
    opened = descriptor(path)
    if opened is None:
        return path.open("wb")
    return os.fdopen(os.dup(opened), "wb")


def descriptor(path: Path) -> int | None:
    """Give the number of the open file that a path such as `/dev/stdout` stands for."""
    text = str(path)
    found = _DESCRIPTOR.fullmatch(text)
    return int(found[1]) if found else _STANDARD.get(text)


def identity(path: Path) -> object:
    """Give what two paths of one file have in common; None of what is no file, which may be given twice."""
    if is_stream(path):
        return None
    try:
        found = path.stat()
    except OSError:
        return path.resolve()
    return found.st_dev, found.st_ino
