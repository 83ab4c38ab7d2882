"""What a run needs of a plant, kept in the cache: it then starts without reading the model, deriving or compiling.

Such a file is for one model file, to the byte, and for one faultbond, compiler and processor; it says so itself, and is
believed only where that is what is asked for.
"""

import json
import os
import sys
from collections.abc import Iterator
from contextlib import suppress
from dataclasses import asdict, dataclass
from enum import Enum
from hashlib import sha256
from pathlib import Path
from typing import Any, TypeVar

from faultbond.contract.spec import SPEC_CLASSES, EngineSpec
from faultbond.io.cache import PREPARED, Library, read_kept, write_kept
from faultbond.io.recording import Column, Columns
from faultbond.io.typed import TypeLimits, typed
from faultbond.model.graph import TimeColumn, Unit

FORMAT = 1
_T = TypeVar("_T")
_PACKAGE = Path(__file__).parents[1]
_NUMBERS = TypeLimits(not_finite=frozenset({*SPEC_CLASSES, Column, Columns, TimeColumn, Unit}))


@dataclass(frozen=True, slots=True, kw_only=True)
class Identity:
    """What a prepared plant is for.

    model: SHA-256 of the bytes of the model file. stem: of its name, which names a model that has no other name.
    code: see `code_identity`. compiler, processor: for which it was compiled.
    """

    model: str
    stem: str
    code: str
    compiler: str
    processor: str
    format: int = FORMAT

    @property
    def file(self) -> str:
        """The name of its file."""
        return kept_name(self)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Prepared:
    """All that a run needs of a plant. compiler: what made the library."""

    spec: EngineSpec
    columns: Columns
    compiler: str
    library: Library


@dataclass(frozen=True, slots=True, kw_only=True)
class _Told:
    """What the file tells in JSON, in front of the library. name, size: of that."""

    identity: Identity
    spec: EngineSpec
    columns: Columns
    compiler: str
    name: str
    size: int


def read_prepared(identity: Identity) -> Prepared | None:
    """Give what the cache has for a plant; None where that is nothing, or is damaged.

    Raises
    ------
    CacheError
        Where others may write the cache.
    """
    text, _, library = (read_kept(identity.file) or b"").partition(b"\n")
    told = told_in(text, _Told, _NUMBERS)
    if told is None or told.identity != identity or told.size != len(library):
        return None
    return Prepared(
        spec=told.spec,
        columns=told.columns,
        compiler=told.compiler,
        library=Library(name=told.name, content=library),
    )


def write_prepared(identity: Identity, prepared: Prepared) -> None:
    """Keep what a run needs of a plant, where there is a cache that can be written."""
    told = _Told(
        identity=identity,
        spec=prepared.spec,
        columns=prepared.columns,
        compiler=prepared.compiler,
        name=prepared.library.name,
        size=len(prepared.library.content),
    )
    with suppress(OSError):
        write_kept(identity.file, b"".join((json_line(told), b"\n", prepared.library.content)))


def kept_name(identity: Any) -> str:
    """Give the name of the file that the cache keeps under an identity, a dataclass."""
    return sha256(json_line(identity)).hexdigest()[:32] + PREPARED


def told_in(line: bytes, kind: type[_T], limits: TypeLimits | None = None) -> _T | None:
    """Give what a line of `json_line` tells, of some dataclass; None where it is damaged."""
    try:
        return typed(kind, json.loads(line), limits)
    except (ValueError, TypeError, RecursionError):
        return None


def json_line(told: Any) -> bytes:
    """Give a dataclass as JSON of one line; numbers to the last digit, also those that JSON has no word for."""
    return json.dumps(asdict(told), default=_plain, separators=(",", ":")).encode()


def code_identity() -> str:
    """Give what changes with faultbond: its version, and size and time of each of its files."""
    installed = {name for folder in sys.path for name in _versions(folder)}
    return sha256("\n".join((*sorted(installed), *sorted(_files(_PACKAGE)))).encode()).hexdigest()


def _versions(folder: str) -> Iterator[str]:
    """Give the versions that are installed in a folder, as the names of their records."""
    with suppress(OSError):
        for name in os.listdir(folder or "."):
            if name.startswith("faultbond-") and name.endswith((".dist-info", ".egg-info")):
                yield name


def _files(folder: Path) -> Iterator[str]:
    """Give name, size and time of each file below a folder, but of those that Python writes itself."""
    with os.scandir(folder) as entries:
        for entry in entries:
            if entry.is_dir():
                if entry.name != "__pycache__":
                    yield from _files(Path(entry.path))
            else:
                about = entry.stat()
                yield f"{os.path.relpath(entry.path, _PACKAGE)} {about.st_size} {about.st_mtime_ns}"


def _plain(value: Any) -> object:
    if isinstance(value, Enum):
        return value.value
    raise TypeError(value)
