"""Rows and curves as bytes: little endian, of a stated version, with a checksum, and whole or refused.

A chunk that is dense has its bytes sorted by their place in the number, so that those that stay alike lie together, and
deflated. Rows come back to the last bit; curves, which are drawn and not computed with, have times as they are and all
else with the seven digits of single precision.
"""

import zlib
from collections.abc import Sequence
from dataclasses import fields
from struct import Struct
from typing import Any

import numpy as np
from numpy.typing import NDArray

from faultbond.arrays import FloatArray
from faultbond.errors import StoreError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Curves

VERSION = 1
_MAGIC = b"fb"
_HEAD = Struct("<2sBBIIII")  # magic, version, what is in it, rows, inputs, outputs, checksum of all but itself
_ROWS, _CURVES, _DENSE = 0, 1, 2
_QUALITY, _ARRIVED = 4, 8  # of rows: not all values are good; when they came is told, in ms since 1970
_UNTOLD = np.iinfo(np.int64).min  # the same of a row of which it is not
_LEVEL = 1  # of deflating: more takes three times as long for a twentieth of the bytes
_DOUBLE, _SINGLE, _COUNT, _LINE, _BYTE = (np.dtype(code) for code in ("<f8", "<f4", "<i4", "<i8", "u1"))

Array = NDArray[Any]


def pack_rows(rows: RowBlock, *, dense: bool) -> bytes:
    """Give rows as bytes."""
    kinds: tuple[np.dtype[Any], ...] = (_DOUBLE, _DOUBLE, _DOUBLE, _COUNT, _LINE)
    parts: tuple[Array, ...] = (rows.time, rows.u, rows.y, rows.saturated, rows.line)
    what, sizes = _ROWS, (len(rows), rows.u.shape[1], rows.y.shape[1])
    if rows.quality is not None:
        what, parts, kinds = what | _QUALITY, (*parts, rows.quality), (*kinds, _BYTE)
    if rows.arrived is not None:
        milliseconds = np.where(np.isnan(rows.arrived), _UNTOLD, np.rint(1e3 * np.nan_to_num(rows.arrived)))
        what, parts, kinds = what | _ARRIVED, (*parts, milliseconds), (*kinds, _LINE)
    return _pack(what, sizes, parts, kinds, dense=dense)


def unpack_rows(data: bytes, title: str) -> RowBlock:
    """Give the rows in some bytes; `title` is what an error calls them.

    Raises
    ------
    StoreError
        Where they are damaged.
    """
    (n, n_u, n_y), payload = _payload(data, _ROWS, title)
    shapes = [(1, _DOUBLE), (n_u, _DOUBLE), (n_y, _DOUBLE), (1, _COUNT), (1, _LINE)]
    if data[3] & _QUALITY:
        shapes.append((n_u + n_y, _BYTE))
    if data[3] & _ARRIVED:
        shapes.append((1, _LINE))
    time, u, y, saturated, line, *more = _arrays(payload, n, shapes, dense=_is_dense(data))
    return RowBlock(
        time=time[:, 0],
        u=u,
        y=y,
        saturated=saturated[:, 0].astype(np.intp),
        line=line[:, 0].astype(np.intp),
        quality=more[0] if data[3] & _QUALITY else None,
        arrived=_moments(more[-1][:, 0]) if data[3] & _ARRIVED else None,
    )


def _moments(milliseconds: Array) -> FloatArray:
    """Give s since 1970 (n,), nan where it is not told."""
    return np.where(milliseconds == _UNTOLD, np.nan, milliseconds / 1e3)


def pack_curves(curves: Curves, *, dense: bool) -> bytes:
    """Give curves as bytes."""
    parts = (curves.time, curves.inputs, curves.measured, curves.expected, curves.sd, curves.cusum)
    sizes = (len(curves), curves.inputs.shape[1], curves.measured.shape[1])
    return _pack(_CURVES, sizes, parts, (_DOUBLE, *[_SINGLE] * 5), dense=dense)


def unpack_curves(data: bytes, title: str) -> Curves:
    """Give the curves in some bytes; `title` is what an error calls them.

    Raises
    ------
    StoreError
        Where they are damaged.
    """
    (n, n_u, n_y), payload = _payload(data, _CURVES, title)
    shapes = ((1, _DOUBLE), (n_u, _SINGLE), *[(n_y, _SINGLE)] * 4)
    time, inputs, measured, expected, sd, cusum = (
        values.astype(np.float64) for values in _arrays(payload, n, shapes, dense=_is_dense(data))
    )
    return Curves(time=time[:, 0], inputs=inputs, measured=measured, expected=expected, sd=sd, cusum=cusum)


def joined_curves(parts: Sequence[Curves]) -> Curves:
    """Give curves, one at least, as one."""
    if len(parts) == 1:
        return parts[0]
    return Curves(
        **{item.name: np.concatenate([getattr(part, item.name) for part in parts]) for item in fields(Curves)}
    )


def curves_at(curves: Curves, chosen: slice | NDArray[Any]) -> Curves:
    """Give some points of curves: those of a slice, or at some places (n_chosen,)."""
    return Curves(**{item.name: getattr(curves, item.name)[chosen] for item in fields(Curves)})


def _pack(
    what: int, sizes: tuple[int, int, int], parts: Sequence[Array], kinds: Sequence[Any], *, dense: bool
) -> bytes:
    with np.errstate(over="ignore", invalid="ignore"):  # what is beyond single precision is drawn as infinite
        stored = [np.ascontiguousarray(values.T, kind) for values, kind in zip(parts, kinds, strict=True)]
    if dense:
        payload = zlib.compress(b"".join(_sorted(values) for values in stored), _LEVEL)
    else:
        payload = b"".join(values.tobytes() for values in stored)
    code = what | (_DENSE if dense else 0)
    checksum = zlib.crc32(payload, zlib.crc32(_HEAD.pack(_MAGIC, VERSION, code, *sizes, 0)))
    return _HEAD.pack(_MAGIC, VERSION, code, *sizes, checksum) + payload


def _sorted(values: Array) -> bytes:
    """Give the first bytes of all numbers, then their second ones, and so on."""
    return values.view(np.uint8).reshape(-1, values.itemsize).T.tobytes()


def _is_dense(data: bytes) -> bool:
    return bool(data[3] & _DENSE)


def _payload(data: bytes, what: int, title: str) -> tuple[tuple[int, int, int], bytes]:
    """Give the sizes and the content behind the head, once both are seen to be whole."""
    if len(data) < _HEAD.size:
        raise StoreError(_damaged(title, f"{len(data)} bytes are too few"))
    magic, version, code, n, n_u, n_y, checksum = _HEAD.unpack_from(data)
    payload = data[_HEAD.size :]
    if magic != _MAGIC:
        raise StoreError(_damaged(title, "they do not begin as they should"))
    if version != VERSION:
        raise StoreError(f"{title}: of format {version}, and this faultbond reads {VERSION}. Take a newer faultbond.")
    if zlib.crc32(payload, zlib.crc32(_HEAD.pack(magic, version, code, n, n_u, n_y, 0))) != checksum:
        raise StoreError(_damaged(title, "the checksum differs"))
    if code & ~(_DENSE | _QUALITY | _ARRIVED) != what:
        raise StoreError(_damaged(title, "they are of another kind"))
    return (n, n_u, n_y), payload


def _damaged(title: str, reason: str) -> str:
    return f"{title}: damaged on the disk ({reason}). Check the disk, and take a copy of the store from before."


def _arrays(payload: bytes, n: int, shapes: Sequence[tuple[int, Any]], *, dense: bool) -> list[Array]:
    """Give arrays of n rows, each so many columns wide, of a content whose checksum is right."""
    found, first = [], 0
    content = zlib.decompress(payload) if dense else payload
    for width, kind in shapes:
        size = n * width * kind.itemsize
        part = np.frombuffer(content, np.uint8, size, first)
        if dense:
            part = np.ascontiguousarray(part.reshape(kind.itemsize, -1).T).reshape(-1)
        found.append(part.view(kind).reshape(width, n).T)
        first += size
    return found
