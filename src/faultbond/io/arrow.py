"""Columns of any table that speaks the Arrow PyCapsule protocol, read without a library of Arrow.

Source: the Arrow C data interface and C stream interface (arrow.apache.org/docs/format), read by `ctypes`.
"""

import ctypes
from collections.abc import Iterator, Sequence
from ctypes import POINTER, Structure, c_char_p, c_int, c_int64, c_void_p, pythonapi
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.errors import RecordingError

NUMBERS = {
    "c": np.int8,
    "C": np.uint8,
    "s": np.int16,
    "S": np.uint16,
    "i": np.int32,
    "I": np.uint32,
    "l": np.int64,
    "L": np.uint64,
    "e": np.float16,
    "f": np.float32,
    "g": np.float64,
}
MOMENTS = {"tss": "s", "tsm": "ms", "tsu": "us", "tsn": "ns", "tdm": "ms"}
SPANS = {"tDs": "s", "tDm": "ms", "tDu": "us", "tDn": "ns"}
OFFSETS = {"u": np.int32, "z": np.int32, "U": np.int64, "Z": np.int64}
VIEW = 16  # bytes of a text that is a view: length, then the text or where it stands
SHORT = 12  # bytes of a text that stands in its view


class _Schema(Structure):
    pass


class _Array(Structure):
    pass


class _Stream(Structure):
    pass


_Release = ctypes.CFUNCTYPE(None, c_void_p)
_Schema._fields_ = [
    ("format", c_char_p),
    ("name", c_char_p),
    ("metadata", c_void_p),
    ("flags", c_int64),
    ("n_children", c_int64),
    ("children", POINTER(POINTER(_Schema))),
    ("dictionary", POINTER(_Schema)),
    ("release", _Release),
    ("private_data", c_void_p),
]
_Array._fields_ = [
    ("length", c_int64),
    ("null_count", c_int64),
    ("offset", c_int64),
    ("n_buffers", c_int64),
    ("n_children", c_int64),
    ("buffers", POINTER(c_void_p)),
    ("children", POINTER(POINTER(_Array))),
    ("dictionary", POINTER(_Array)),
    ("release", _Release),
    ("private_data", c_void_p),
]
_Stream._fields_ = [
    ("get_schema", ctypes.CFUNCTYPE(c_int, POINTER(_Stream), POINTER(_Schema))),
    ("get_next", ctypes.CFUNCTYPE(c_int, POINTER(_Stream), POINTER(_Array))),
    ("get_last_error", ctypes.CFUNCTYPE(c_char_p, POINTER(_Stream))),
    ("release", _Release),
    ("private_data", c_void_p),
]
_pointer_of = ctypes.PYFUNCTYPE(c_void_p, ctypes.py_object, c_char_p)(("PyCapsule_GetPointer", pythonapi))


class ArrowTable:
    """The columns of a table, copied when they are asked for.

    Parameters
    ----------
    table : has `__arrow_c_stream__`
    """

    def __init__(self, table: Any) -> None:
        self._capsule = table.__arrow_c_stream__()  # it owns the stream, and lets go of it
        self._stream = _Stream.from_address(_pointer_of(self._capsule, b"arrow_array_stream"))
        self._schema = _Schema()
        self._check(self._stream.get_schema(self._stream, self._schema))
        if self._schema.format != b"+s":
            raise RecordingError("the table: its rows have no columns with names. Give a table.")
        self._fields = [self._schema.children[k].contents for k in range(self._schema.n_children)]
        self._batches = list(self._read())
        self.names = [(item.name or b"").decode() for item in self._fields]

    def __del__(self) -> None:
        for item in (*getattr(self, "_batches", ()), getattr(self, "_schema", None)):
            if item is not None and item.release:
                item.release(ctypes.addressof(item))

    def column(self, place: int) -> NDArray[Any]:
        """Give a column, (n_rows,): numbers, moments, or Python objects; what is null is nan, no moment, or None.

        Raises
        ------
        RecordingError
            Where what it holds is no number, moment or text.
        """
        parts = [
            _values(self._fields[place], batch.children[place].contents, self.names[place], batch.offset)[
                : batch.length
            ]
            for batch in self._batches
        ]
        return np.concatenate(parts) if parts else np.zeros(0)

    def _read(self) -> Iterator[_Array]:
        while True:
            batch = _Array()
            self._check(self._stream.get_next(self._stream, batch))
            if not batch.release:
                return
            yield batch

    def _check(self, code: int) -> None:
        if code:
            told = self._stream.get_last_error(self._stream) or b""
            raise RecordingError(f"the table: it cannot be read ({told.decode(errors='replace').strip() or code}).")


def _values(field: _Schema, array: _Array, name: str, skipped: int = 0) -> NDArray[Any]:
    """Give the values of an array from the first one that counts, (n,)."""
    kind = field.format.decode()
    first, stop = array.offset + skipped, array.offset + array.length
    if field.dictionary:
        words = _values(field.dictionary.contents, array.dictionary.contents, name)
        places = _numbers(array, NUMBERS[kind], stop)[first:]
        gone = ~_valid(array, first, stop)
        found = np.array([None if lost else words[k] for k, lost in zip(places, gone, strict=True)], dtype=object)
        return found
    if kind == "n":
        return np.full(stop - first, np.nan)
    valid = _valid(array, first, stop)
    if kind in NUMBERS or kind == "b":
        numbers = _bits(array.buffers[1], stop) if kind == "b" else _numbers(array, NUMBERS[kind], stop)
        return numbers[first:].copy() if valid.all() else np.where(valid, numbers[first:].astype(float), np.nan)
    if kind == "tdD":
        return _dated(_numbers(array, np.int32, stop)[first:].astype("datetime64[D]").astype("datetime64[s]"), valid)
    if kind[:3] in MOMENTS or kind in SPANS:
        unit = MOMENTS.get(kind[:3]) or SPANS[kind]
        of = "datetime64" if kind[:3] in MOMENTS else "timedelta64"
        return _dated(_numbers(array, np.int64, stop)[first:].astype(f"{of}[{unit}]"), valid)
    if kind in OFFSETS or kind in ("vu", "vz"):
        texts = _views(array, first, stop) if kind[0] == "v" else _texts(array, OFFSETS[kind], first, stop)
        return np.array([text if there else None for text, there in zip(texts, valid, strict=True)], dtype=object)
    raise RecordingError(f"the table: column {name!r} holds neither numbers nor times nor text (Arrow type {kind!r}).")


def _numbers(array: _Array, kind: Any, stop: int) -> NDArray[Any]:
    """Give the numbers of an array from the start of its memory up to the last that counts, (stop,)."""
    return _memory(array.buffers[1], stop * np.dtype(kind).itemsize).view(kind)


def _memory(address: int | None, size: int) -> NDArray[np.uint8]:
    """Give some bytes at an address, (size,), as they stand there."""
    if not address or not size:
        return np.zeros(size, dtype=np.uint8)
    return np.ctypeslib.as_array(ctypes.cast(address, POINTER(ctypes.c_uint8)), (size,))


def _bits(address: int | None, stop: int) -> NDArray[np.bool_]:
    """Give the first bits of a memory, (stop,), lowest first."""
    return np.unpackbits(_memory(address, -(-stop // 8)), count=stop, bitorder="little").astype(bool)


def _valid(array: _Array, first: int, stop: int) -> NDArray[np.bool_]:
    """Tell which of the values are there, (stop - first,)."""
    there = array.n_buffers > 0 and bool(array.buffers[0]) and array.null_count != 0
    return _bits(array.buffers[0], stop)[first:] if there else np.ones(stop - first, dtype=bool)


def _dated(moments: NDArray[Any], valid: NDArray[np.bool_]) -> NDArray[Any]:
    moments = moments.copy()
    moments[~valid] = "NaT"
    return moments


def _texts(array: _Array, kind: Any, first: int, stop: int) -> Sequence[str]:
    """Give texts that stand one behind the other."""
    ends = _memory(array.buffers[1], (stop + 1) * np.dtype(kind).itemsize).view(kind)
    text = _memory(array.buffers[2], int(ends[stop]) if len(ends) else 0).tobytes()
    return [text[ends[k] : ends[k + 1]].decode(errors="replace") for k in range(first, stop)]


def _views(array: _Array, first: int, stop: int) -> Sequence[str]:
    """Give texts that stand in their views, or in one of several memories."""
    views = _memory(array.buffers[1], stop * VIEW)
    sizes = _memory(array.buffers[array.n_buffers - 1], 8 * (array.n_buffers - 3)).view(np.int64)
    pools = [_memory(array.buffers[2 + k], int(size)) for k, size in enumerate(sizes)]
    texts = []
    for k in range(first, stop):
        view = views[VIEW * k : VIEW * (k + 1)]
        length, _, pool, begin = (int(item) for item in view.view(np.int32))
        found = view[4 : 4 + length] if length <= SHORT else pools[pool][begin : begin + length]
        texts.append(found.tobytes().decode(errors="replace"))
    return texts
