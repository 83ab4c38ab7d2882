"""What a verb writes is nothing that it reads, no two of its outputs are one file, and each can be written."""

import argparse
import sys
from collections.abc import Iterator
from pathlib import Path

from faultbond.app.outputs import redirected, refuse_outputs
from faultbond.app.wishes import DEMO
from faultbond.errors import FaultbondError
from faultbond.io.examples import example
from faultbond.io.files import STANDARD_INPUT, identity
from faultbond.io.out import STANDARD_OUTPUT

READ = {"model": "the model", "recording": "the recording", "recordings": "a recording", "data": "a recording"}
READ |= {"inputs": "the recording of inputs", "models": "a model", "site": "the site file", "kept": "the store"}
WRITTEN = {
    "state": "the state",
    "store": "the store",
    "output": "the output",
    "report": "the report",
    "json": "the file of records",
}


def check_outputs(arguments: argparse.Namespace) -> None:
    """Refuse outputs that would destroy something, before anything is touched.

    Raises
    ------
    FaultbondError
        Where an output is also an input or another output, or cannot be written.
    """
    read = list(_read(arguments))
    known = {found: what for found, what in read if found is not None}
    if (shown := redirected(sys.stdout)) in known:
        raise FaultbondError(f"standard output goes to {known[shown]}, which would be changed while it is read.")
    refuse_outputs(read, _written(arguments))


def _written(arguments: argparse.Namespace) -> Iterator[tuple[Path, str]]:
    """Give what is written to files."""
    for name, what in WRITTEN.items():
        value = getattr(arguments, name, None)
        if value is None or (name == "json" and value == STANDARD_OUTPUT):
            continue
        if name == "store" and "://" in value:  # in a server
            continue
        if str(value) == STANDARD_OUTPUT:
            raise FaultbondError(f"-: only records go to standard output, by --json -. Name a file for {what}.")
        yield Path(value), what


def _read(arguments: argparse.Namespace) -> Iterator[tuple[object, str]]:
    """Give what is read, by what it has in common with other names of it."""
    for name, what in READ.items():
        values = getattr(arguments, name, None)
        for value in values if isinstance(values, list) else [values]:
            if value is None:
                continue
            if str(value) == STANDARD_INPUT and name != "model":
                yield redirected(sys.stdin), f"{what}, on standard input,"
            else:
                yield identity(Path(value)), what
    if arguments.verb == "demo":
        for path in example(DEMO).iterdir():
            yield identity(path), "a file of the example"
