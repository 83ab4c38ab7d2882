"""An edge node of Sparkplug B for tests: it writes payloads by hand, from the text of the specification."""

import struct
from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

Message = tuple[str, bytes]
INT8, INT32, INT64, UINT64, FLOAT, DOUBLE, BOOLEAN, STRING, DATASET = 1, 3, 4, 8, 9, 10, 11, 12, 16
QUALITY_TYPE = 3  # Int32


def varint(number: int) -> bytes:
    """Write a whole number by groups of seven bits."""
    found = bytearray()
    while number >= 0x80:
        found.append(number & 0x7F | 0x80)
        number >>= 7
    return bytes([*found, number])


def whole(number: int, value: int | None) -> bytes:
    """Write a field that is a whole number."""
    return b"" if value is None else varint(number << 3) + varint(value)


def counted(number: int, value: bytes | str | None) -> bytes:
    """Write a field that is bytes, a text or a message."""
    data = value.encode() if isinstance(value, str) else value
    return b"" if data is None else varint(number << 3 | 2) + varint(len(data)) + data


def value_field(value: Any, datatype: int) -> bytes:
    """Write a value as its type is written."""
    if datatype in (4, 8, 13):
        return whole(11, value % 2**64)
    if datatype <= 7:
        return whole(10, value % 2**32)
    if datatype == FLOAT:
        return varint(12 << 3 | 5) + struct.pack("<f", value)
    if datatype == DOUBLE:
        return varint(13 << 3 | 1) + struct.pack("<d", value)
    if datatype == BOOLEAN:
        return whole(14, int(value))
    return counted(15 if datatype == STRING else 17, value)


def metric(
    name: str | None = None,
    value: Any = None,
    datatype: int = DOUBLE,
    *,
    alias: int | None = None,
    at: float | None = None,
    is_typed: bool = True,
    quality: int | None = None,
    is_historical: bool = False,
) -> bytes:
    """Write a metric; without a value it is null."""
    told = b""
    if quality is not None:
        told = counted(1, "Quality") + counted(2, whole(1, QUALITY_TYPE) + whole(3, quality % 2**32))
    return b"".join(
        (
            counted(1, name),
            whole(2, alias),
            whole(3, None if at is None else round(at * 1000)),
            whole(4, datatype if is_typed else None),
            whole(5, 1 if is_historical else None),
            whole(7, 1) if value is None else b"",
            counted(9, told or None),
            b"" if value is None else value_field(value, datatype),
        )
    )


def payload(metrics: Sequence[bytes], *, at: float | None = None, seq: int | None = None) -> bytes:
    """Write a payload."""
    time = whole(1, None if at is None else round(at * 1000))
    return time + b"".join(counted(2, item) for item in metrics) + whole(3, seq)


@dataclass
class EdgeNode:
    """A node that numbers its messages. bd_seq: of its session."""

    bd_seq: int = 0
    group: str = "hall"
    name: str = "gateway"
    seq: int = field(default=-1, init=False)

    def topic(self, kind: str, device: str = "") -> str:
        """Give where a message goes."""
        return "/".join(filter(None, ("spBv1.0", self.group, kind, self.name, device)))

    def birth(self, *metrics: bytes, at: float = 0.0) -> Message:
        """Give its birth, from which messages are numbered."""
        self.seq = -1
        session = metric("bdSeq", self.bd_seq, INT64, at=at)
        rebirth = metric("Node Control/Rebirth", False, BOOLEAN, at=at)
        return self.sent("NBIRTH", "", [session, rebirth, *metrics], at)

    def death(self) -> Message:
        """Give its last will, which has no number."""
        return self.topic("NDEATH"), payload([metric("bdSeq", self.bd_seq, INT64)], at=0.0)

    def sent(self, kind: str, device: str, metrics: Sequence[bytes], at: float | None = 0.0) -> Message:
        """Give a message of its own or of a device."""
        self.seq = (self.seq + 1) % 256
        return self.topic(kind, device), payload(metrics, at=at, seq=self.seq)

    def device_birth(self, *metrics: bytes, device: str = "pump", at: float = 0.0) -> Message:
        """Give the birth of a device."""
        return self.sent("DBIRTH", device, metrics, at)

    def device_death(self, device: str = "pump", at: float = 0.0) -> Message:
        """Give the death of a device."""
        return self.sent("DDEATH", device, [], at)

    def data(self, *metrics: bytes, device: str = "pump", at: float | None = 0.0) -> Message:
        """Give values, of a device or, where it is empty, of the node."""
        return self.sent("DDATA" if device else "NDATA", device, metrics, at)
