"""What is written is nothing that is read, no two outputs are one file, and each can be written."""

import os
import stat
from collections.abc import Iterable
from pathlib import Path
from typing import TextIO

from faultbond.errors import FaultbondError
from faultbond.io.files import descriptor, identity

Read = tuple[object, str]  # what a file has in common with other names of it, and what it is


def refuse_outputs(read: Iterable[Read], written: Iterable[tuple[Path, str]]) -> None:
    """Refuse outputs that would destroy something, before anything is touched.

    Parameters
    ----------
    read : files that are read
    written : paths that are written, and what each of them is to be, such as `the report`

    Raises
    ------
    FaultbondError
        Where an output is also an input or another output, or cannot be written.
    """
    known = {found: what for found, what in read if found is not None}
    for path, what in written:
        _check_place(path)
        found = identity(path)
        if found in known:
            raise FaultbondError(
                f"{path}: this is {known[found]} and would be {what} too. Name another file for {what}."
            )
        if found is not None:
            known[found] = what


def redirected(stream: TextIO) -> object:
    """Give what a file to which a standard stream was redirected has in common with its name; None of no file."""
    try:
        found = os.fstat(stream.fileno())
    except (OSError, ValueError, AttributeError):
        return None
    return (found.st_dev, found.st_ino) if stat.S_ISREG(found.st_mode) else None


def _check_place(path: Path) -> None:
    if descriptor(path) is not None:
        return
    if path.is_dir():
        raise FaultbondError(f"{path}: this is a folder. Name a file.")
    if not path.parent.is_dir():
        raise FaultbondError(f"{path}: there is no folder {path.parent}. Create it, or name another file.")
    if not os.access(path if path.exists() else path.parent, os.W_OK):
        raise FaultbondError(f"{path}: it cannot be written: permission denied. Name another file.")
