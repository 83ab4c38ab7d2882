"""Payloads of Sparkplug B: what of Tahu's sparkplug_b.proto a reader of values needs; all else in them is passed over.

protobuf reads them, by a description that is built here, so that nothing is generated and no version of a compiler
binds. What holds a data set, a template or bytes is not opened.
"""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from google.protobuf.message import DecodeError, Message

from faultbond.io.row_block import Quality
from faultbond.service.sources.json_payload import MOST_OBJECTS, OPC_GOOD, OPC_UNCERTAIN

PACKAGE = "faultbond.sparkplug"
COMPRESSED = "SPBV1.0_COMPRESSED"  # the uuid of a payload whose body is another one
QUALITY = "Quality"  # name of the property that tells it
STALE = 500  # as Sparkplug tells it: bad
SEVERITY = 30  # bit from which on qualities of Ignition tell how bad they are
SIGNED = {1: 8, 2: 16, 3: 32, 4: 64}  # bits of Int8 to Int64, by number of the type
_Field = descriptor_pb2.FieldDescriptorProto
MESSAGES = {  # name, number and type of fields, those behind None in one `oneof value`; a type may be another message
    "PropertyValue": (
        ("is_null", 2, _Field.TYPE_BOOL),
        None,
        ("int_value", 3, _Field.TYPE_UINT32),
        ("long_value", 4, _Field.TYPE_UINT64),
    ),
    "PropertySet": (("keys", 1, [_Field.TYPE_STRING]), ("values", 2, ["PropertyValue"])),
    "Metric": (
        ("name", 1, _Field.TYPE_STRING),
        ("alias", 2, _Field.TYPE_UINT64),
        ("timestamp", 3, _Field.TYPE_UINT64),
        ("datatype", 4, _Field.TYPE_UINT32),
        ("is_null", 7, _Field.TYPE_BOOL),
        ("properties", 9, "PropertySet"),
        None,
        ("int_value", 10, _Field.TYPE_UINT32),
        ("long_value", 11, _Field.TYPE_UINT64),
        ("float_value", 12, _Field.TYPE_FLOAT),
        ("double_value", 13, _Field.TYPE_DOUBLE),
        ("boolean_value", 14, _Field.TYPE_BOOL),
        ("string_value", 15, _Field.TYPE_STRING),
        ("bytes_value", 16, _Field.TYPE_BYTES),
        ("dataset_value", 17, _Field.TYPE_BYTES),
        ("template_value", 18, _Field.TYPE_BYTES),
    ),
    "Payload": (
        ("timestamp", 1, _Field.TYPE_UINT64),
        ("metrics", 2, ["Metric"]),
        ("seq", 3, _Field.TYPE_UINT64),
        ("uuid", 4, _Field.TYPE_STRING),
    ),
}


def _payload_class() -> type[Message]:
    """Give what reads payloads."""
    file = descriptor_pb2.FileDescriptorProto(name=f"{PACKAGE}.proto", package=PACKAGE, syntax="proto2")
    for name, fields in MESSAGES.items():
        message, is_choice = file.message_type.add(name=name), False
        for field in fields:
            if field is None:
                message.oneof_decl.add(name="value")
                is_choice = True
                continue
            called, number, kind = field
            label = _Field.LABEL_REPEATED if isinstance(kind, list) else _Field.LABEL_OPTIONAL
            of = kind[0] if isinstance(kind, list) else kind
            made = message.field.add(name=called, number=number, label=label)
            if isinstance(of, str):
                made.type, made.type_name = _Field.TYPE_MESSAGE, f".{PACKAGE}.{of}"
            else:
                made.type = of
            if is_choice:
                made.oneof_index = 0
    pool = descriptor_pool.DescriptorPool()
    pool.AddSerializedFile(file.SerializeToString())
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(f"{PACKAGE}.Payload"))


_PAYLOAD = _payload_class()


@dataclass(frozen=True, slots=True, kw_only=True)
class Metric:
    """A metric as it came.

    name: empty where it goes by its alias. time: of its source, s; None where neither it nor the payload has one.
    datatype: its number; 0 where none is told. value: None where it is null or absent, whole numbers as they travel.
    """

    name: str
    alias: int | None
    time: float | None
    datatype: int
    value: object
    quality: Quality


@dataclass(frozen=True, slots=True, kw_only=True)
class SparkplugPayload:
    """A payload. time: at which it was sent, s; seq: its number; None where it has none. size: number of metrics."""

    time: float | None
    seq: int | None
    size: int
    message: Any

    @classmethod
    def of(cls, data: bytes) -> "SparkplugPayload":
        """Read a payload.

        Raises
        ------
        ValueError
            Where it is damaged or compressed.
        """
        message: Any
        try:
            message = _PAYLOAD.FromString(data)
        except DecodeError as error:
            raise ValueError(str(error)) from error
        if message.uuid == COMPRESSED:
            raise ValueError("compressed")
        seq = message.seq if message.HasField("seq") else None
        return cls(time=_seconds(message), seq=seq, size=len(message.metrics), message=message)

    def metrics(self) -> Iterator[Metric]:
        """Give its metrics, of too many the first.

        Raises
        ------
        ValueError
            Where a text in one is none.
        """
        for item in self.message.metrics[:MOST_OBJECTS]:
            moment = _seconds(item)
            yield Metric(
                name=_text(item.name),
                alias=item.alias if item.HasField("alias") else None,
                time=self.time if moment is None else moment,
                datatype=item.datatype,
                value=_value(item),
                quality=_quality(item.properties) if item.HasField("properties") else Quality.GOOD,
            )


def typed_value(value: object, datatype: int) -> object:
    """Give a value as its type means it: signed numbers travel as two's complement, of 32, 64 or their own bits.

    Example
    -------
    >>> [typed_value(value, 1) for value in (5, 0xFF, 0xFFFFFFFF)], typed_value(0xFF, 5)
    ([5, -1, -1], 255)
    """
    bits = SIGNED.get(datatype)
    if bits is None or type(value) is not int:
        return value
    value &= (1 << bits) - 1
    return value - (1 << bits) if value >> (bits - 1) else value


def _seconds(item: Any) -> float | None:
    return item.timestamp / 1000.0 if item.HasField("timestamp") else None


def _text(found: Any) -> str:
    """Give a text; what is no UTF-8 comes as bytes, or is refused by protobuf itself."""
    if not isinstance(found, str):
        raise ValueError("a text is no UTF-8")
    return found


def _value(item: Any) -> object:
    """Give a value; what is none of its own, as a data set, is no number and told as a text is."""
    which = item.WhichOneof("value")
    if which is None or item.is_null:
        return None
    if which in ("bytes_value", "dataset_value", "template_value"):
        return "object"
    found: object = getattr(item, which)
    return _text(found) if which == "string_value" else found


def _quality(properties: Any) -> Quality:
    """Give the quality that properties tell: of Sparkplug (0, 192, 500), of OPC, or of Ignition (its upper bits)."""
    for key, told in zip(properties.keys, properties.values, strict=False):
        which = told.WhichOneof("value")
        if key != QUALITY or which is None or told.is_null:
            continue
        number = getattr(told, which) & 0xFFFFFFFF
        severity = number >> SEVERITY
        if severity >= 2 or number == STALE:
            return Quality.BAD
        if severity == 1:
            return Quality.UNCERTAIN
        return Quality.GOOD if number >= OPC_GOOD else Quality.UNCERTAIN if number >= OPC_UNCERTAIN else Quality.BAD
    return Quality.GOOD
