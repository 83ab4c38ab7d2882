"""Sparkplug B: births tell what is what, deaths what is not of now any more, and the data between them are read.

Nothing is sent, also not the wish for a rebirth: that is a command to the plant. What goes by an alias that no birth
has named is counted and waits for the next birth. A broker that keeps births ("Sparkplug aware") gives them at once.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from types import MappingProxyType

from paho.mqtt.client import topic_matches_sub

from faultbond.io.row_block import Quality
from faultbond.service.sources.intake import RETAINED, UNKNOWN, UNREADABLE, Intake, Reading
from faultbond.service.sources.json_payload import MOST_BYTES, MOST_OBJECTS, OVERSIZED
from faultbond.service.sources.sparkplug_payload import Metric, SparkplugPayload, typed_value
from faultbond.service.sources.sparkplug_topic import NAMESPACE, Sender, node_of, topic_of

MOST_SENDERS = 10_000  # nodes, readers of topics, and names of an asset, that are remembered
MOST_DEVICES = 1000  # of a node, whose births or deaths are remembered
SEQUENCE = 256  # numbers of messages, after which they begin anew
BD_SEQ = "bdSeq"  # the metric by which a death is known to be of a birth
CONTROLS = ("Node Control/", "Device Control/")  # metrics that are commands
UNBORN, SEQUENCE_GAP, DEATHS = "unborn", "sequence gap", "deaths"


@dataclass(frozen=True, slots=True, kw_only=True)
class _Birth:
    """What a birth told. at: s; names: by alias; types: by name."""

    at: float = 0.0
    names: Mapping[int, str] = field(default_factory=lambda: MappingProxyType({}))
    types: Mapping[str, int] = field(default_factory=lambda: MappingProxyType({}))


UNTOLD = _Birth()
_Value = tuple[str, object, float | None, Quality]  # name, value, time in s, quality


@dataclass(slots=True)
class _Node:
    """An edge node as it was seen since the broker is there.

    seq: number of its last message. bd_seq: of its session. births: by device, of what lives. gone: devices that died.
    is_followed: whether its birth or death was seen, so that what has no birth does not live.
    """

    seq: int | None = None
    bd_seq: object = None
    births: dict[str, _Birth] = field(default_factory=dict)
    gone: set[str] = field(default_factory=set)
    is_followed: bool = False

    def is_dead(self, device: str) -> bool:
        """Whether a device, or the node itself, has died or is to be born anew."""
        return device not in self.births and (self.is_followed or device in self.gone)


class _Reader:
    """An asset that reads some of the nodes and devices."""

    def __init__(self, wanted: str, intake: Intake) -> None:
        self.filter, self.node_filter, self._intake = wanted, node_of(wanted), intake
        self._columns: dict[tuple[Sender, str], str | None] = {}
        self._given: dict[Sender, set[str]] = {}  # columns that came, of who lives
        self._told: str | None = None

    def count(self, name: str, number: int = 1) -> None:
        """Count what is in no row."""
        self._intake.count(name, number)

    def take(self, sender: Sender, values: Iterable[_Value]) -> bool:
        """Take values of who lives; gives whether the asset has a column for one of them."""
        readings = [
            Reading(column=column, value=value, time=moment, quality=quality)
            for name, value, moment, quality in values
            if (column := self._column(sender, name)) is not None
        ]
        if readings:
            self._given.setdefault(sender, set()).update(item.column for item in readings)
            self._intake.take(readings)
            self._tell("")
        return bool(readings)

    def is_born(self, sender: Sender) -> None:
        """Forget what held before a birth."""
        self._intake.forget(self._given.get(sender, ()))

    def lacks(self, sender: Sender) -> None:
        """Take it that values came of which nobody knows what they are."""
        if not self._given and not self._told:
            self._tell(f"{_called(sender)} sends what only its birth would name, and this has not been seen yet")

    def loses(self, senders: Iterable[Sender], why: str) -> None:
        """Take it that what came of some is of the past."""
        for sender in senders:
            self._intake.forget(self._given.pop(sender, ()))
        if not self._given:
            self._tell(why)

    def given_of(self, node: Sender) -> list[Sender]:
        """Give who of a node gave values and lives."""
        return [sender for sender in self._given if sender[:2] == node[:2]]

    def _tell(self, why: str) -> None:
        if why != self._told:
            self._told = why
            self._intake.tell_stale(why)

    def _column(self, sender: Sender, name: str) -> str | None:
        """Give the column that is the end of a metric's path, the longest if there are several; None: there is none."""
        key = sender, name
        if key not in self._columns:
            if len(self._columns) >= MOST_SENDERS:
                self._columns.clear()
            path = "/".join(["", *filter(None, sender), name])
            fits = [column for column in self._intake.columns if path.endswith(f"/{column}")]
            self._columns[key] = max(fits, key=len, default=None)
        return self._columns[key]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Message:
    """A message. own: who reads its node or device; concerned: who reads anything of its node. is_kept: from before."""

    sender: Sender
    content: SparkplugPayload
    metrics: Sequence[Metric]
    own: Sequence[_Reader]
    concerned: Sequence[_Reader]
    is_kept: bool


class EdgeNodes:
    """The nodes and devices that some assets read; made anew with each connection. It never fails on what comes.

    Parameters
    ----------
    intakes : of the assets, each with the filter of what it reads
    """

    def __init__(self, intakes: Iterable[tuple[str, Intake]]) -> None:
        self._readers = [_Reader(wanted, intake) for wanted, intake in intakes]
        self._known: dict[Sender, tuple[list[_Reader], list[_Reader]]] = {}
        self._nodes: dict[tuple[str, str], _Node] = {}

    def take(self, topic: str, payload: bytes, *, is_kept: bool) -> None:
        """Take a message. is_kept: whether the broker had it from before."""
        told = topic_of(topic)
        if told is None or (told.is_certificate and not is_kept):  # a new one came as the birth itself, too
            return
        own, concerned = self._reading(told.sender)
        if not concerned:
            return
        heard = own if told.sender.device else concerned
        content, wrong = None, RETAINED if is_kept and told.kind != "BIRTH" else ""
        if len(payload) > MOST_BYTES:
            wrong = OVERSIZED
        if not wrong:
            try:
                content = SparkplugPayload.of(payload)
                metrics = tuple(content.metrics()) if heard else ()
                wrong = OVERSIZED if content.size > MOST_OBJECTS else ""
            except ValueError:
                content, wrong = None, UNREADABLE
        if wrong:
            _count(heard, wrong)
        if content is not None:
            message = _Message(
                sender=told.sender, content=content, metrics=metrics, own=own, concerned=concerned, is_kept=is_kept
            )
            HANDLED[told.kind](self._node(told.sender), message)

    def _reading(self, sender: Sender) -> tuple[list[_Reader], list[_Reader]]:
        """Give who reads a node or device, and whom its node concerns."""
        if sender not in self._known:
            if len(self._known) >= MOST_SENDERS:
                self._known.clear()
            node = f"{NAMESPACE}/{sender.group}/any/{sender.node}"
            topic = f"{node}/{sender.device}" if sender.device else node
            self._known[sender] = (
                [item for item in self._readers if topic_matches_sub(item.filter, topic)],
                [item for item in self._readers if topic_matches_sub(item.node_filter, node)],
            )
        return self._known[sender]

    def _node(self, sender: Sender) -> _Node:
        if sender[:2] not in self._nodes:
            if len(self._nodes) >= MOST_SENDERS:
                del self._nodes[next(iter(self._nodes))]
            self._nodes[sender[:2]] = _Node()
        return self._nodes[sender[:2]]


def _birth(node: _Node, message: _Message) -> None:
    """Take what a birth names, and its values if it is of now."""
    sender, metrics, at = message.sender, message.metrics, message.content.time or 0.0
    if message.is_kept and (sender.device in node.births or node.is_dead(sender.device)):
        return  # what was seen of now goes before
    if sender.device:
        _follow(node, message)
        if not message.own:  # only its number counts
            return
        _make_room(node, message)
    else:
        node.bd_seq = _session(metrics)
    if not (sender.device or message.is_kept):
        node.seq, node.is_followed = message.content.seq, True
        node.gone.clear()
        node.births = {device: birth for device, birth in node.births.items() if birth.at >= at}  # they overtook it
        for reader in message.concerned:
            for lost in reader.given_of(sender):
                if lost.device and lost.device not in node.births:
                    reader.loses([lost], f"{_called(lost)} has not been born again since its node was")
    node.births[sender.device] = _Birth(
        at=at,
        names={item.alias: item.name for item in metrics if item.alias is not None},
        types={item.name: item.datatype for item in metrics},
    )
    if message.is_kept:  # what it names is of now, what it measured is not
        return
    for reader in message.own:
        reader.is_born(sender)
    values, _ = _values(node.births[sender.device], metrics)
    for reader in message.own:
        if not reader.take(sender, values) and values:
            reader.count(UNKNOWN)


def _data(node: _Node, message: _Message) -> None:
    """Take values of who lives; those of the others, and those that no birth has named, are counted."""
    sender, metrics = message.sender, message.metrics
    _follow(node, message)
    if node.is_dead(sender.device):
        values, n_unborn = list[_Value](), len(metrics)
    else:
        values, n_unborn = _values(node.births.get(sender.device, UNTOLD), metrics)
    for reader in message.own:
        reader.take(sender, values)
        if n_unborn:
            reader.count(UNBORN, n_unborn)
            reader.lacks(sender)


def _death(node: _Node, message: _Message) -> None:
    """Take it that a device is dead, or a node with all its devices; of another session it says nothing."""
    sender = message.sender
    why = f"{_called(sender)} is dead, and what it sent is of the past until its next birth"
    if sender.device:
        _follow(node, message)
        if not message.own:
            return
        node.births.pop(sender.device, None)
        if len(node.gone) < MOST_DEVICES:
            node.gone.add(sender.device)
        _count(message.own, DEATHS)
        for reader in message.own:
            reader.loses([sender], why)
        return
    session = _session(message.metrics)
    if None not in (session, node.bd_seq) and session != node.bd_seq:
        _count(message.concerned, UNKNOWN)
        return
    node.births.clear()
    node.gone.clear()
    node.seq, node.is_followed = None, True
    _count(message.concerned, DEATHS)
    for reader in message.concerned:
        reader.loses(reader.given_of(sender), why)


HANDLED = {"BIRTH": _birth, "DATA": _data, "DEATH": _death}


def _make_room(node: _Node, message: _Message) -> None:
    """Forget the device that was born first where one more is too many."""
    node.gone.discard(message.sender.device)
    if message.sender.device in node.births or len(node.births) - ("" in node.births) < MOST_DEVICES:
        return
    lost = message.sender._replace(device=next(filter(None, node.births)))
    del node.births[lost.device]
    for reader in message.concerned:
        reader.loses([lost], f"{_called(lost)} is one of too many devices, and is known again by its next birth")


def _follow(node: _Node, message: _Message) -> None:
    """See whether a message follows the one before it."""
    seq = message.content.seq
    if seq is None or message.is_kept:
        return
    if node.seq is not None and seq != (node.seq + 1) % SEQUENCE:
        _count(message.concerned, SEQUENCE_GAP)
    node.seq = seq


def _values(birth: _Birth, metrics: Iterable[Metric]) -> tuple[list[_Value], int]:
    """Give the values that can be read, and how many of which nobody knows the name or, of whole numbers, the type."""
    values, n_unborn = list[_Value](), 0
    for item in metrics:
        name = item.name or birth.names.get(-1 if item.alias is None else item.alias, "")
        datatype = item.datatype or birth.types.get(name, 0)
        if not name or (type(item.value) is int and not datatype):
            n_unborn += 1
        elif name != BD_SEQ and not name.startswith(CONTROLS):
            values.append((name, typed_value(item.value, datatype), item.time, item.quality))
    return values, n_unborn


def _session(metrics: Iterable[Metric]) -> object:
    """Give the number by which a death belongs to a birth; None where it is not told."""
    return next((item.value for item in metrics if item.name == BD_SEQ), None)


def _called(sender: Sender) -> str:
    """Give what people call a node or device."""
    return f"device {sender.device} of {sender.node}" if sender.device else f"edge node {sender.node}"


def _count(readers: Iterable[_Reader], name: str) -> None:
    for reader in readers:
        reader.count(name)
