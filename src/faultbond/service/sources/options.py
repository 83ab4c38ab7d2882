"""What a site says of a source beside its address."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType

NAMES: Mapping[str, Mapping[str, str]] = MappingProxyType({})


@dataclass(frozen=True, slots=True, kw_only=True)
class SourceOptions:
    """How to log in, what is where, and how values become rows; what an address says goes before.

    nodes: OPC UA, by asset and column the node. topics: MQTT, by asset the filter of its topics, by which the address'
    is replaced. hold: by asset, columns whose last value holds until the next one; None: inputs that are held.
    patience: s that a row waits for its values; together: s by which their times may differ; None: by the sample time.
    user, password_file, authority, certificate, key: files and names of the log-in. server_certificate: OPC UA, the
    only one that is trusted. unencrypted: OPC UA, whether the traffic may be read by others.
    most_waiting: rows of an asset that wait for who takes them, before the oldest are dropped and counted.
    """

    nodes: Mapping[str, Mapping[str, str]] = field(default_factory=lambda: NAMES)
    topics: Mapping[str, str] = field(default_factory=lambda: MappingProxyType({}))
    hold: Mapping[str, tuple[str, ...]] | None = None
    patience: float | None = None
    together: float | None = None
    user: str = ""
    password_file: str = ""
    authority: str = ""
    certificate: str = ""
    key: str = ""
    server_certificate: str = ""
    unencrypted: bool = False
    most_waiting: int = 100_000
