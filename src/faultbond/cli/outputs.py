"""What a verb writes is nothing that it reads, no two of its outputs are one file, and each can be written."""

import argparse
import os
import stat
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import TextIO

from faultbond.app.wishes import DEMO
from faultbond.errors import FaultbondError
from faultbond.io.examples import example
from faultbond.io.files import STANDARD_INPUT, descriptor, identity
from faultbond.io.out import STANDARD_OUTPUT

READ = {"model": "the model", "recording": "the recording", "recordings": "a recording", "data": "a recording"}
READ |= {"inputs": "the recording of inputs"}
WRITTEN = {"state": "the state", "output": "the output", "report": "the report", "json": "the file of records"}


def check_outputs(arguments: argparse.Namespace) -> None:
    """Refuse outputs that would destroy something, before anything is touched.

    Raises
    ------
    FaultbondError
        Where an output is also an input or another output, or cannot be written.
    """
    known = {identity_: what for identity_, what in _read(arguments) if identity_ is not None}
    if (shown := _redirected(sys.stdout)) in known:
        raise FaultbondError(f"standard output goes to {known[shown]}, which would be changed while it is read.")
    for name, what in WRITTEN.items():
        value = getattr(arguments, name, None)
        if value is None or (name == "json" and value == STANDARD_OUTPUT):
            continue
        if str(value) == STANDARD_OUTPUT:
            raise FaultbondError(f"-: only records go to standard output, by --json -. Name a file for {what}.")
        path = Path(value)
        _check_place(path)
        found = identity(path)
        if found in known:
            raise FaultbondError(
                f"{path}: this is {known[found]} and would be {what} too. Name another file for {what}."
            )
        if found is not None:
            known[found] = what


def _read(arguments: argparse.Namespace) -> Iterator[tuple[object, str]]:
    """Give what is read, by what it has in common with other names of it."""
    for name, what in READ.items():
        values = getattr(arguments, name, None)
        for value in values if isinstance(values, list) else [values]:
            if value is None:
                continue
            if str(value) == STANDARD_INPUT and name != "model":
                yield _redirected(sys.stdin), f"{what}, on standard input,"
            else:
                yield identity(Path(value)), what
    if arguments.verb == "demo":
        for path in example(DEMO).iterdir():
            yield identity(path), "a file of the example"


def _redirected(stream: TextIO) -> object:
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
