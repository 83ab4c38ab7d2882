"""MQTT: messages of a broker, JSON or Sparkplug B; it subscribes and publishes nothing."""

import asyncio
import ssl
from collections.abc import AsyncGenerator, Callable, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

import aiomqtt
from paho.mqtt.client import topic_matches_sub

from faultbond.errors import SourceError, reason_of
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.intake import RETAINED, Intake
from faultbond.service.sources.json_payload import JsonForm
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.queue import ArrivalQueue, connected
from faultbond.service.sources.sparkplug_topic import CERTIFICATES, NAMESPACE, is_sparkplug, whole_node

if TYPE_CHECKING:
    from faultbond.service.sources.sparkplug import EdgeNodes

GATHER = 0.1  # s between what goes out
KEEP_ALIVE = 10  # s between signs of life, so that a network that is cut is noticed
TIMEOUT = 10.0  # s for the broker to answer
MOST_TOPICS = 10_000  # whose readers are remembered
REFUSED = 128  # lowest reason code of a subscription that says no


@dataclass(frozen=True, slots=True, kw_only=True)
class Broker:
    """Where messages come from. tls: None where the traffic may be read by others. shown: without the password.

    has_births: whether it is asked for births of Sparkplug B that it may have kept. session: whether it keeps for the
    client what comes while that is away.
    """

    host: str
    port: int
    shown: str
    user: str | None = None
    password: str | None = None
    client: str | None = None
    qos: int = 1
    tls: ssl.SSLContext | None = None
    has_births: bool = True
    session: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class _Reader:
    """An asset that reads some topics, for as long as the broker is there."""

    filter: str
    intake: Intake
    form: JsonForm


class MqttSource:
    """A source of messages; how a broker is lost is told by `SourceError`.

    Parameters
    ----------
    broker : where they come from
    filters : of the topics, by asset
    subscribers : the assets
    options : how values become rows
    edge_nodes : what reads Sparkplug B; None where nobody does
    """

    def __init__(
        self,
        broker: Broker,
        filters: Mapping[str, str],
        subscribers: Sequence[Subscriber],
        options: SourceOptions,
        edge_nodes: "type[EdgeNodes] | None" = None,
    ) -> None:
        self._broker, self._filters, self._edge_nodes = broker, dict(filters), edge_nodes
        self._subscribers, self._options = tuple(subscribers), options
        self._queue = ArrivalQueue(subscribers, options.most_waiting)

    @property
    def address(self) -> str:
        """What the user called it, without the password."""
        return self._broker.shown

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give rows as they come; a broker does not go back, so a cursor means nothing.

        Raises
        ------
        SourceError
            Where the broker cannot be reached, refuses, or has been lost.
        """
        broker, readers = self._broker, [self._reader(item) for item in self._subscribers]
        told = [(item.filter, item.intake) for item in readers if is_sparkplug(item.filter)]
        nodes = self._edge_nodes(told) if self._edge_nodes is not None else None
        client = aiomqtt.Client(
            broker.host,
            broker.port,
            username=broker.user,
            password=broker.password,
            identifier=broker.client,
            clean_session=not broker.session,
            tls_context=broker.tls,
            keepalive=KEEP_ALIVE,
            timeout=TIMEOUT,
            queue_type=_receiving(_Dispatch(readers, nodes)),
        )
        try:
            async with client:
                for wanted in dict.fromkeys(wanted for item in readers for wanted in self._wanted(item.filter)):
                    await self._subscribe(client, wanted)
                yield connected(self._subscribers[0])
                lost = asyncio.ensure_future(anext(client.messages))
                try:
                    while not (await asyncio.wait({lost}, timeout=GATHER))[0]:
                        for reader in readers:
                            reader.intake.look()
                        for found in self._queue.drain():
                            yield found
                    raise _reason(lost)
                finally:
                    await _given_up(lost)
        except aiomqtt.MqttError as error:
            for reader in readers:
                reader.intake.close()
            for found in self._queue.drain():
                yield found
            raise SourceError(f"{broker.shown}: {reason_of(error)}.") from error
        finally:
            for reader in readers:
                reader.intake.close()

    def _reader(self, subscriber: Subscriber) -> _Reader:
        intake = Intake(subscriber, self._options, self._queue)
        form = JsonForm(
            columns=intake.columns.keys(), time=subscriber.columns.time.column or "time", unit=intake.time_unit
        )
        return _Reader(filter=self._filters[subscriber.asset], intake=intake, form=form)

    def _wanted(self, topics: str) -> list[str]:
        """Give what is subscribed to for a filter; kept births come last, so that none is missed between."""
        if not is_sparkplug(topics):
            return [topics]
        kept = [f"{CERTIFICATES}/{whole_node(topics)}"] if self._broker.has_births else []
        return [whole_node(topics), *kept]

    async def _subscribe(self, client: aiomqtt.Client, wanted: str) -> None:
        """Ask for the messages of some topics."""
        codes = await client.subscribe(wanted, qos=self._broker.qos)
        is_refused = any((code if isinstance(code, int) else code.value) >= REFUSED for code in codes)
        if is_refused and not wanted.startswith(CERTIFICATES):  # those are a help, where they are
            raise SourceError(
                f"{self._broker.shown}: the broker lets {self._broker.user or 'nobody'} not read {wanted}."
            )


def _receiving(take: Callable[[aiomqtt.Message], None]) -> type[asyncio.Queue[aiomqtt.Message]]:
    """Give a queue that hands over what is put into it, so that only ours, which counts what it drops, fills up."""

    class Receiving(asyncio.Queue[aiomqtt.Message]):
        def put_nowait(self, item: aiomqtt.Message) -> None:
            take(item)

    return Receiving


class _Dispatch:
    """Gives each message to those who read its topic. It is called by the network and never fails."""

    def __init__(self, readers: Sequence[_Reader], nodes: "EdgeNodes | None") -> None:
        self._readers = [item for item in readers if not is_sparkplug(item.filter)]
        self._nodes = nodes
        self._known: dict[str, tuple[list[_Reader], list[str]]] = {}

    def __call__(self, message: aiomqtt.Message) -> None:
        topic = str(message.topic)
        if self._nodes is not None and topic.startswith((f"{NAMESPACE}/", f"{CERTIFICATES}/")):
            data: Any = message.payload
            self._nodes.take(topic, bytes(data or b""), is_kept=message.retain)
        if topic not in self._known:
            if len(self._known) >= MOST_TOPICS:
                self._known.clear()
            readers = [item for item in self._readers if topic_matches_sub(item.filter, topic)]
            self._known[topic] = readers, topic.split("/")
        readers, levels = self._known[topic]
        payload: Any = message.payload
        for reader in readers:
            readings, wrong = reader.form.readings(bytes(payload or b""), levels)
            if wrong:
                reader.intake.count(wrong)
            if message.retain:
                of_now = [item for item in readings if item.time is not None or item.column in reader.intake.held]
                if len(of_now) < len(readings):
                    reader.intake.count(RETAINED)
                readings = of_now
            reader.intake.take(readings)


def _reason(lost: "asyncio.Future[aiomqtt.Message]") -> aiomqtt.MqttError:
    """Give why a connection ended."""
    error = lost.exception()
    return error if isinstance(error, aiomqtt.MqttError) else aiomqtt.MqttError("it closed the connection")


async def _given_up(task: "asyncio.Future[aiomqtt.Message]") -> None:
    """Cancel what waits for the connection."""
    task.cancel()
    with suppress(asyncio.CancelledError, aiomqtt.MqttError, StopAsyncIteration):
        await task
