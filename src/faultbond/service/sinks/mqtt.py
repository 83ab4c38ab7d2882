"""MQTT: how assets stand as messages that the broker keeps, and records as they come; it subscribes to nothing."""

import asyncio
import json
import ssl
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

import aiomqtt

from faultbond.errors import SinkError, reason_of
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord

KEEP_ALIVE = 10  # s between signs of life, so that a network that is cut is noticed
TIMEOUT = 10.0  # s for the broker to answer
GOODBYE = 2.0  # s for it to take our leave
QOS = 1  # at least once
ONLINE, OFFLINE = "online", "offline"


@dataclass(frozen=True, slots=True, kw_only=True)
class TargetBroker:
    """Where messages go. prefix: of all topics. tls: None where others may read along."""

    host: str
    port: int
    prefix: str
    shown: str
    user: str | None = None
    password: str | None = None
    tls: ssl.SSLContext | None = None


class MqttSink:
    """A sink of messages.

    Parameters
    ----------
    name : what the site calls it
    broker : where they go
    kinds : of records
    give_up : s without success after which a record is passed over; None: never
    """

    shows = True

    def __init__(self, name: str, broker: TargetBroker, *, kinds: frozenset[str], give_up: float | None = None) -> None:
        self.name, self.address, self.kinds, self.give_up = name, broker.shown, kinds, give_up
        self._broker = broker

    @asynccontextmanager
    async def opened(self) -> AsyncIterator["MqttLink"]:
        """Give the connection to the broker, which tells others when it is lost.

        Raises
        ------
        SinkError
            Where the broker cannot be reached, refuses, or has been lost.
        """
        broker = self._broker
        service = f"{broker.prefix}/service"
        client = aiomqtt.Client(
            broker.host,
            broker.port,
            username=broker.user,
            password=broker.password,
            tls_context=broker.tls,
            will=aiomqtt.Will(service, OFFLINE, qos=QOS, retain=True),
            keepalive=KEEP_ALIVE,
            timeout=TIMEOUT,
        )
        try:
            async with client:
                await client.publish(service, ONLINE, qos=QOS, retain=True)
                try:
                    yield MqttLink(client, broker.prefix)
                finally:  # by itself a broker tells the will only where the connection breaks
                    with suppress(aiomqtt.MqttError, TimeoutError):
                        await client.publish(service, OFFLINE, qos=QOS, retain=True, timeout=GOODBYE)
        except aiomqtt.MqttError as error:
            raise SinkError(f"{broker.shown}: {reason_of(error)}.") from error


class MqttLink:
    """See `contract.sink.Link`."""

    def __init__(self, client: aiomqtt.Client, prefix: str) -> None:
        self._client, self._prefix = client, prefix

    async def show(self, summary: Shown) -> None:
        """Let the broker keep how an asset stands."""
        await self._publish(f"{summary['name']}/status", summary, retain=True)

    async def pass_on(self, record: NamedRecord) -> None:
        """Tell a record; the broker has it when this returns."""
        await self._publish(f"{record.asset}/records/{record.kind}", record.told(), retain=False)

    async def lost(self) -> None:
        """Wait until the broker is lost."""
        async for _ in self._client.messages:
            await asyncio.sleep(0)

    async def _publish(self, topic: str, content: Shown, *, retain: bool) -> None:
        text = json.dumps(content, ensure_ascii=False, allow_nan=False, separators=(",", ":"))
        await self._client.publish(f"{self._prefix}/{topic}", text, qos=QOS, retain=retain)
