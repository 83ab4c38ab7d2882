"""Room on the disk that is kept, so that a store whose disk is full goes on for a while and can be made smaller.

To forget rows needs room, too: a transaction is written beside the store before it is one with it. So the first half is
for what comes, and the second for what goes; it has to hold the file of transactions, see `sqlite.LONGEST_LOG`.
"""

import os
import shutil
from contextlib import suppress
from pathlib import Path

DEFAULT_SIZE = 2**25  # bytes


class ReserveFile:
    """A file beside a store that holds nothing but room.

    Parameters
    ----------
    store : the file of the store
    size : bytes; 0: none are kept
    """

    def __init__(self, store: Path, size: int = DEFAULT_SIZE) -> None:
        self._path, self.size = store.with_name(f"{store.name}.reserve"), size

    @property
    def is_whole(self) -> bool:
        """Whether all of it is there."""
        return self._held() >= self.size

    def renew(self) -> bool:
        """Take what is missing of it, if the disk has as much again to spare; tell whether it is whole."""
        if self.is_whole:
            return True
        try:
            if shutil.disk_usage(self._path.parent).free < 2 * self.size - self._held():
                return False
            self._fill()
        except OSError:
            self.give_up(all_of_it=True)
        return self.is_whole

    def give_up(self, *, all_of_it: bool) -> bool:
        """Give its room to the store, or the first half of it; tell whether there was any."""
        left = 0 if all_of_it else self.size // 2
        with suppress(OSError):
            if self._path.stat().st_size > left:
                os.truncate(self._path, left)
                return True
        return False

    def _held(self) -> int:
        """Give how many bytes there are of it."""
        try:
            return self._path.stat().st_size
        except OSError:
            return 0

    def _fill(self) -> None:
        """Take the room at once: a file with holes in it would hold none."""
        with self._path.open("wb") as stream:
            if hasattr(os, "posix_fallocate"):
                os.posix_fallocate(stream.fileno(), 0, self.size)
                return
            for _ in range(0, self.size, 2**16):
                stream.write(b"\xff" * 2**16)
