"""Topics of Sparkplug B: what a filter may be, what is subscribed to for it, and of whom a message is."""

import re
from typing import NamedTuple

NAMESPACE = "spBv1.0"
CERTIFICATES = "$sparkplug/certificates"  # below it brokers that know Sparkplug keep the last births
FORM = f"{NAMESPACE}/GROUP/+/NODE or {NAMESPACE}/GROUP/+/NODE/DEVICE"
FILTER = re.compile(rf"{re.escape(NAMESPACE)}/[^/#]+/\+/(#|[^/#]+(/(#|[^/#]+))?)")
KINDS = {4: ("NBIRTH", "NDATA", "NDEATH"), 5: ("DBIRTH", "DDATA", "DDEATH")}  # that are read, by levels of the topic


class Sender(NamedTuple):
    """An edge node, or a device of it; device is empty for the node itself."""

    group: str
    node: str
    device: str = ""


class SparkplugTopic(NamedTuple):
    """What a topic says of a message. kind: BIRTH, DATA or DEATH. is_certificate: whether brokers keep it there."""

    kind: str
    sender: Sender
    is_certificate: bool


def is_sparkplug(wanted: str) -> bool:
    """Whether a filter is of Sparkplug B."""
    return wanted.partition("/")[0] == NAMESPACE


def whole_node(wanted: str) -> str:
    """Give the filter of all that a node sends: its devices and itself are numbered together."""
    levels = wanted.split("/")[:4]
    return "/".join(levels if levels[-1] == "#" else [*levels, "#"])


def node_of(wanted: str) -> str:
    """Give the filter of what concerns the node of a filter."""
    return "/".join(wanted.split("/")[:4])


def topic_of(topic: str) -> SparkplugTopic | None:
    """Give what a topic says; None where it is of no message that is read.

    Example
    -------
    >>> topic_of("spBv1.0/hall/DDATA/gateway/pump").sender
    Sender(group='hall', node='gateway', device='pump')
    """
    own = topic.removeprefix(f"{CERTIFICATES}/")
    levels = own.split("/")
    if levels[0] != NAMESPACE or len(levels) not in KINDS or levels[2] not in KINDS[len(levels)]:
        return None
    return SparkplugTopic(levels[2][1:], Sender(levels[1], *levels[3:]), own != topic)
