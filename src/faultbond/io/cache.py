"""The cache: a folder of files that save work, some of them code that is run.

A file is believed only if the folder and the file are the user's (or the system's) and nobody else may write them, and
if a checksum at its end, over its name and content, says that it is whole and in its place; else it is as good as not
there, and made again. It is read once, and what was checked is what is used. Each file is written beside its place and
renamed into it, so that several processes can write and read at once. What was not used for longest makes room; who
reads such a file at that moment reads it to its end.
"""

import os
import secrets
import shutil
import stat
import tempfile
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass
from hashlib import sha256
from pathlib import Path
from time import time

from faultbond.errors import CacheError

LIBRARY, PREPARED = ".so", ".plant"  # endings of compiled code, and of what else is known of a plant
MOST_FILES = 2000  # to look at all of them takes some milliseconds; a plant has five
MOST_BYTES = 200_000_000
_CHECKSUM = 32  # bytes at the end of a file
_DRAFT = ".draft-"  # how names of what is not in its place begin
_ABANDONED = 3600.0  # s after which a draft is nobody's any more
_OURS_ONLY = 0o700


def cache_folder() -> Path:
    """Give the folder of the cache: `FAULTBOND_CACHE`, else the user's cache folder.

    A user who has no home, as in some containers, has one below the system's folder for temporary files.
    """
    chosen, base = os.environ.get("FAULTBOND_CACHE"), os.environ.get("XDG_CACHE_HOME")
    if chosen:
        return Path(chosen)
    try:
        return (Path(base) if base else Path.home() / ".cache") / "faultbond"
    except RuntimeError:
        return Path(tempfile.gettempdir()) / f"faultbond-{os.getuid()}"


class _Folder:
    """The folder of the cache, held open: what is done in it is done in this one, whatever takes its name meanwhile."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.number: int | None = None  # the open folder, where the system can work in one
        if os.open in os.supports_dir_fd:
            self.number = os.open(path, os.O_RDONLY | os.O_DIRECTORY | os.O_NOFOLLOW | os.O_CLOEXEC)

    @property
    def is_ours(self) -> bool:
        """Whether only this user, or the system's, may write in it."""
        return _is_ours(self.path.stat() if self.number is None else os.fstat(self.number))

    def place(self, name: str) -> str:
        """Give the path of a file for calls that take `dir_fd`."""
        return name if self.number is not None else str(self.path / name)

    def close(self) -> None:
        """Let go of it."""
        if self.number is not None:
            os.close(self.number)

    @property
    def fixed_path(self) -> Path:
        """A path that leads to this folder, if the system has one, whatever takes the name of the folder meanwhile."""
        fixed = Path(f"/proc/self/fd/{self.number}")
        return fixed if self.number is not None and fixed.is_dir() else self.path

    def read(self, name: str) -> bytes | None:
        """Give the content of a file that can be believed, and note that it was used."""
        flags = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0) | getattr(os, "O_CLOEXEC", 0)
        try:
            number = os.open(self.place(name), flags, dir_fd=self.number)
        except OSError:
            return None
        with os.fdopen(number, "rb") as stream, suppress(OSError):
            about = os.fstat(number)
            if not stat.S_ISREG(about.st_mode) or not _is_ours(about):
                return None
            sealed = stream.read()
            content = sealed[:-_CHECKSUM]
            if sealed != _sealed(name, content):
                return None
            with suppress(OSError):
                os.utime(number if os.utime in os.supports_fd else self.path / name)
            return content
        return None

    def write(self, name: str, content: bytes) -> None:
        """Write a file as a whole; who reads it meanwhile gets the one before."""
        draft = f"{_DRAFT}{secrets.token_hex(8)}"
        flags = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_BINARY", 0) | getattr(os, "O_CLOEXEC", 0)
        try:
            with os.fdopen(os.open(self.place(draft), flags, _OURS_ONLY, dir_fd=self.number), "wb") as stream:
                stream.write(_sealed(name, content))
            os.replace(self.place(draft), self.place(name), src_dir_fd=self.number, dst_dir_fd=self.number)
        except BaseException:
            self._remove(draft)
            raise

    def sizes(self) -> list[int]:
        """Give the bytes of each file that was put there."""
        found = []
        for name in os.listdir(self.path if self.number is None else self.number):
            with suppress(OSError):
                about = os.stat(self.place(name), dir_fd=self.number, follow_symlinks=False)
                if name.endswith((LIBRARY, PREPARED)) and not stat.S_ISDIR(about.st_mode):
                    found.append(about.st_size)
        return found

    def make_room(self, keep: str) -> None:
        """Remove drafts that were left behind, and what was not used for longest, until the rest is within bounds."""
        found = []
        for name in os.listdir(self.path if self.number is None else self.number):
            with suppress(OSError):
                about = os.stat(self.place(name), dir_fd=self.number, follow_symlinks=False)
                if name.startswith(_DRAFT) and time() - about.st_mtime > _ABANDONED:
                    self._remove(name)
                    shutil.rmtree(self.fixed_path / name, ignore_errors=True)
                elif name.endswith((LIBRARY, PREPARED)) and not stat.S_ISDIR(about.st_mode):
                    found.append((name == keep, about.st_mtime_ns, about.st_size, name))
        found.sort()
        n_files, n_bytes = len(found), sum(size for _, _, size, _ in found)
        for _, _, size, name in found[:-1]:
            if n_files <= MOST_FILES and n_bytes <= MOST_BYTES:
                break
            self._remove(name)
            n_files, n_bytes = n_files - 1, n_bytes - size

    def _remove(self, name: str) -> None:
        with suppress(OSError):
            os.unlink(self.place(name), dir_fd=self.number)


@contextmanager
def _opened(*, make: bool = False) -> Iterator[_Folder]:
    """Open the folder.

    Raises
    ------
    CacheError
        Where others may write it.
    OSError
        Where it is not there, or cannot be read.
    """
    path = cache_folder()
    if make:
        path.mkdir(mode=_OURS_ONLY, parents=True, exist_ok=True)
    if path.is_symlink():
        raise CacheError(f"{path}: this is a link, and what it leads to may change. Set FAULTBOND_CACHE to the folder.")
    folder = _Folder(path)
    try:
        if not folder.is_ours:  # others may put a library of theirs there
            raise CacheError(
                f"{path}: others own this folder or may write it, and it holds code that is run. "
                f"Take it back, `chmod go-w {path}`, or set FAULTBOND_CACHE to a folder of your own."
            )
        yield folder
    finally:
        folder.close()


def read_kept(name: str) -> bytes | None:
    """Give the content of a file of the cache; None where there is none that can be believed.

    Raises
    ------
    CacheError
        Where others may write the cache.
    """
    try:
        with _opened() as folder:
            return folder.read(name)
    except OSError:
        return None


def write_kept(name: str, content: bytes) -> None:
    """Put a file in the cache, and remove what it has no room for.

    Raises
    ------
    CacheError
        Where others may write the cache.
    OSError
        Where it cannot be written.
    """
    with _opened(make=True) as folder:
        folder.write(name, content)
        with suppress(OSError):
            folder.make_room(name)


@dataclass(frozen=True, slots=True, kw_only=True)
class CacheUse:
    """What the cache holds, and whether it can be used.

    n_files, n_bytes : of what was put there
    mode : permissions as `ls -l` writes them; None where there is no such folder yet
    refused : why nothing in it is believed; None where it is
    writable : whether something can be put there
    """

    folder: Path
    n_files: int
    n_bytes: int
    mode: str | None
    refused: str | None
    writable: bool


def cache_use() -> CacheUse:
    """Look at the cache, which is left as it is."""
    path = cache_folder()
    sizes: list[int] = []
    refused = mode = None
    with suppress(OSError):
        mode = stat.filemode(path.lstat().st_mode)
    try:
        with _opened() as folder:
            sizes = folder.sizes()
    except CacheError as problem:
        refused = str(problem)
    except OSError:  # it is not there, or no folder
        pass
    return CacheUse(
        folder=path,
        n_files=len(sizes),
        n_bytes=sum(sizes),
        mode=mode,
        refused=refused,
        writable=refused is None and _can_be_filled(path),
    )


def _can_be_filled(path: Path) -> bool:
    """Whether a folder can be written, or else be made."""
    nearest = next((item for item in (path, *path.absolute().parents) if item.exists()), None)
    return nearest is not None and nearest.is_dir() and os.access(nearest, os.W_OK | os.X_OK)


@dataclass(frozen=True, slots=True, kw_only=True)
class Library:
    """Compiled code. name: of its file in the cache, which tells what it was compiled from."""

    name: str
    content: bytes


@contextmanager
def loadable(libraries: Sequence[Library]) -> Iterator[list[Path]]:
    """Give paths of files that the system loads these libraries from, as long as this is entered.

    They are copies, in the cache, where code can be run, or else among temporary files, in a folder that nobody else
    may enter: what is loaded is what was checked, and nobody cuts it short while it runs. Where no file can be written,
    as on a full disk, they are the files of the cache itself, checked once more.

    Raises
    ------
    CacheError
        Where others may write the cache.
    OSError
        Where there is neither.
    """
    with ExitStack() as stack:
        folder = None
        with suppress(OSError):
            folder = stack.enter_context(_opened())
        try:
            paths = _copies(libraries, _draft_folder(stack, folder))
        except OSError:
            if folder is None or any(folder.read(item.name) != item.content for item in libraries):
                raise
            paths = [folder.fixed_path / item.name for item in libraries]
        yield paths


def _draft_folder(stack: ExitStack, folder: _Folder | None) -> Path:
    """Make a folder that lasts as long as the stack, in another one, or else among temporary files."""
    if folder is not None:
        with suppress(OSError):
            return Path(stack.enter_context(tempfile.TemporaryDirectory(dir=folder.fixed_path, prefix=_DRAFT)))
    return Path(stack.enter_context(tempfile.TemporaryDirectory()))


def _copies(libraries: Sequence[Library], work: Path) -> list[Path]:
    paths = [work / item.name for item in libraries]
    for path, item in zip(paths, libraries, strict=True):
        path.write_bytes(item.content)
    return paths


def _is_ours(about: os.stat_result) -> bool:
    """Whether only this user, or the system's, may write a file."""
    if not hasattr(os, "geteuid"):
        return True
    return about.st_uid in (os.geteuid(), 0) and not about.st_mode & (stat.S_IWGRP | stat.S_IWOTH)


def _sealed(name: str, content: bytes) -> bytes:
    """Give a content with its checksum."""
    return content + sha256(name.encode() + b"\0" + content).digest()
