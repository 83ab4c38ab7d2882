"""A small disk in memory that tests fill; to mount one takes root and Linux."""

import subprocess
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


@contextmanager
def mounted(place: Path, size: str) -> Iterator[Path | None]:
    """Mount a disk of a size such as `24m`, and give its folder; None where that cannot be."""
    place.mkdir()
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "none", str(place)]
    try:
        is_there = subprocess.run(command, check=False, capture_output=True).returncode == 0
    except FileNotFoundError:
        is_there = False
    try:
        yield place if is_there else None
    finally:
        if is_there:
            unmount = ["umount", "--lazy", str(place)]
            subprocess.run(unmount, check=True)


def fill(file: Path) -> None:
    """Take all room that is left, by a file."""
    with file.open("wb", buffering=0) as stream:
        for size in (2**20, 2**12, 1):
            with suppress(OSError):
                while True:
                    stream.write(bytes(size))
