"""Arrays and one JSON text in a file of `numpy.savez`, believed only once all of it was checked.

Nothing is unpacked, and no memory is asked for, beyond the size of the file itself; a checksum over the content tells
what was damaged.
"""

import json
import math
import re
from collections.abc import Mapping
from enum import Enum
from hashlib import sha256
from io import BytesIO
from pathlib import Path
from typing import IO, Any
from zipfile import ZIP_STORED, ZipFile, ZipInfo

import numpy as np

from faultbond.arrays import FloatArray

MAX_SIZE = 2**29  # bytes; the bank of a large plant takes a tenth of it
ABOUT, CHECKSUM = "about", "checksum"
_SUFFIX = ".npy"
_ENCRYPTED = 0x1  # bit of the flags of a member
_HEADER = re.compile(rb"\{'descr': '<(f8|U\d{1,9})', 'fortran_order': False, 'shape': \([\d, ]{0,99}\), \} *\n")


def write_archive(stream: IO[bytes], about: Mapping[str, Any], arrays: Mapping[str, FloatArray]) -> None:
    """Write a JSON text and arrays of floats by name, of any shape, with their checksum."""
    text = json.dumps(about, default=_word)
    floats = {name: np.array(values, dtype="<f8", order="C") for name, values in arrays.items()}
    texts = {ABOUT: np.array(text), CHECKSUM: np.array(_checksum(text, floats))}
    np.savez(stream, allow_pickle=False, **texts, **floats)


def read_archive(source: Path | bytes) -> tuple[dict[str, Any], dict[str, FloatArray]]:
    """Give the JSON object and the arrays that `write_archive` wrote, to a file or into memory.

    Raises
    ------
    OSError
        Where the file cannot be read.
    ValueError, BadZipFile
        Where it is not of this kind, or damaged.
    """
    size = len(source) if isinstance(source, bytes) else source.stat().st_size
    if size > MAX_SIZE:
        raise ValueError(f"larger than {MAX_SIZE} bytes")
    with ZipFile(BytesIO(source) if isinstance(source, bytes) else source) as archive:
        members = archive.infolist()
        if len({member.filename for member in members}) < len(members):
            raise ValueError("a name appears twice")
        if sum(member.file_size for member in members) > size:
            raise ValueError("more than the file holds")
        arrays = {member.filename.removesuffix(_SUFFIX): _member(archive, member) for member in members}
    texts = [arrays.pop(name) for name in (ABOUT, CHECKSUM)]
    if any(values.dtype.kind != "U" or values.shape != () for values in texts):
        raise ValueError("no text")
    text, checksum = map(str, texts)
    if any(values.dtype != np.dtype("<f8") for values in arrays.values()):
        raise ValueError("an array is not of floats")
    if checksum != _checksum(text, arrays):
        raise ValueError("the checksum differs")
    about = json.loads(text)
    if not isinstance(about, dict):
        raise ValueError("no object")
    return about, arrays


def _member(archive: ZipFile, member: ZipInfo) -> Any:
    """Give one array, whose header must tell the size that is there."""
    if member.compress_type != ZIP_STORED or member.flag_bits & _ENCRYPTED or not member.filename.endswith(_SUFFIX):
        raise ValueError(f"{member.filename} is not stored as an array")
    stream = BytesIO(archive.read(member))
    if np.lib.format.read_magic(stream) != (1, 0) or not _HEADER.match(stream.getvalue(), stream.tell() + 2):
        raise ValueError(f"{member.filename} is of another format")
    shape, _, kind = np.lib.format.read_array_header_1_0(stream)
    if math.prod(shape) * kind.itemsize != member.file_size - stream.tell():
        raise ValueError(f"{member.filename} is not of the size that it tells")
    stream.seek(0)
    return np.lib.format.read_array(stream, allow_pickle=False)


def _checksum(text: str, arrays: Mapping[str, FloatArray]) -> str:
    """Give the checksum of all that is written."""
    total = sha256(text.encode())
    for name in sorted(arrays):
        total.update(f"\0{name}{arrays[name].shape}".encode())
        total.update(arrays[name].tobytes())
    return total.hexdigest()


def _word(value: object) -> object:
    """Give the word of an enumeration."""
    if isinstance(value, Enum):
        return value.value
    raise TypeError(type(value).__name__)
