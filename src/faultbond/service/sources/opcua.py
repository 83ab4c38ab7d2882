"""OPC UA: values of a server by subscription. Nothing here writes, calls or adds; a test reads this file for it."""

import asyncio
from collections.abc import AsyncGenerator, Mapping, Sequence
from contextlib import AsyncExitStack, suppress
from dataclasses import dataclass
from typing import Any

from asyncua import ua
from asyncua.client.client import Client
from asyncua.common.node import Node
from asyncua.common.subscription import DataChangeEvent, OverflowPolicy, StatusChangeEvent, Subscription
from asyncua.crypto import security_policies
from asyncua.ua.attribute_ids import AttributeIds
from asyncua.ua.object_ids import ObjectIds
from asyncua.ua.uaerrors import UaError

from faultbond.errors import FaultbondError, SourceError, reason_of
from faultbond.io.row_block import Quality
from faultbond.io.times import unix_seconds
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.intake import Intake, Reading
from faultbond.service.sources.opcua_identity import certificate_of, read_identity
from faultbond.service.sources.options import SourceOptions
from faultbond.service.sources.queue import ArrivalQueue, connected

POLICIES: Mapping[str, Any] = {
    "Basic256Sha256": security_policies.SecurityPolicyBasic256Sha256,
    "Aes128_Sha256_RsaOaep": security_policies.SecurityPolicyAes128Sha256RsaOaep,
    "Aes256_Sha256_RsaPss": security_policies.SecurityPolicyAes256Sha256RsaPss,
}
GATHER = 0.1  # s between what goes out
KEPT_BY_SERVER = 1000  # values of a node between two of its messages; more than one, or fast changes are lost
WAITING = 100_000  # values between the network and us, beyond which the connection is given up
TIMEOUT = 10.0  # s for the server to answer
GOODBYE = 3.0  # s for it to take leave
DEEPEST, MOST_NODES = 8, 20_000  # of a search by name
OVERFLOW_BITS = 0x480  # of a status: the server has dropped values before this one
OVERFLOW = "overflow"
AGAIN = 30.0  # s after which it is asked again for what an asset lacks
PERIOD = 0.03  # s: what comes at 100 Hz is on the page nearly as soon as by MQTT; where less comes, fewer messages do
LOST = (UaError, OSError, asyncio.TimeoutError, ConnectionError)


@dataclass(frozen=True, slots=True, kw_only=True)
class Server:
    """Where values come from. policy: of the encryption; empty: there is none. period: s between messages.

    space: number or address of the name space in which columns are looked up by name; empty: all of them.
    """

    url: str
    shown: str
    user: str | None = None
    password: str | None = None
    policy: str = ""
    certificate: str = ""
    key: str = ""
    server_certificate: str = ""
    period: float = PERIOD
    space: str = ""


class OpcUaSource:
    """A source of values of an OPC UA server; how it is lost is told by `SourceError`.

    Parameters
    ----------
    server : where they come from
    subscribers : the assets
    options : which node is which column, and how values become rows

    Raises
    ------
    FaultbondError
        Where a node is told of what is no column, or is none.
    """

    def __init__(self, server: Server, subscribers: Sequence[Subscriber], options: SourceOptions) -> None:
        self._server, self._subscribers, self._options = server, tuple(subscribers), options
        self._told = {item.asset: _told_nodes(item, options.nodes.get(item.asset, {})) for item in subscribers}
        self._queue = ArrivalQueue(subscribers, options.most_waiting)

    @property
    def address(self) -> str:
        """What the user called it, without the password."""
        return self._server.shown

    async def arrivals(self, cursors: Mapping[str, str]) -> AsyncGenerator[Arrivals, None]:
        """Give rows as they come; a server does not go back, so a cursor means nothing.

        Raises
        ------
        FaultbondError
            A `SourceError`, where the server cannot be reached, refuses, lacks a node of each asset, or has been lost;
            and where it has by now what only some lacked, which are told as stale until then.
        """
        intakes = {item.asset: Intake(item, self._options, self._queue) for item in self._subscribers}
        reason: BaseException | None = None
        try:
            async with AsyncExitStack() as stack:
                client = await self._connected(stack)
                taking, lacking = await self._taking(client, intakes, stack)
                yield connected(self._subscribers[0])
                again = asyncio.get_running_loop().time() + AGAIN
                while not (await asyncio.wait({taking}, timeout=GATHER))[0]:
                    for intake in intakes.values():
                        intake.look()
                    for found in self._queue.drain():
                        yield found
                    if lacking and asyncio.get_running_loop().time() >= again:
                        await self._ask_again(client, lacking)
                        again = asyncio.get_running_loop().time() + AGAIN
                reason = taking.exception()
        except LOST as error:
            reason = error
        finally:
            for intake in intakes.values():
                intake.close()
        for found in self._queue.drain():
            yield found
        raise self._lost(reason)

    def _lost(self, reason: BaseException | None) -> FaultbondError:
        """Give the error that says why there is nothing more."""
        if isinstance(reason, FaultbondError):
            return reason
        why = "the server ended the subscription" if reason is None else reason_of(reason)
        return SourceError(f"{self._server.shown}: {why}.")

    async def _connected(self, stack: AsyncExitStack) -> Client:
        """Give the connection; it is closed at the end."""
        server = self._server
        client = Client(server.url, timeout=TIMEOUT)
        if server.user:
            client.set_user(server.user)
            client.set_password(server.password or "")
        if server.policy:
            theirs = server.server_certificate
            try:
                own = await asyncio.to_thread(read_identity, server.certificate, server.key)
                trusted = await asyncio.to_thread(certificate_of, theirs) if theirs else None
            except FaultbondError as error:  # as while they are renewed
                raise SourceError(f"{server.shown}: {error}") from error
            client.application_uri = own.name or client.application_uri
            await client.set_security(
                POLICIES[server.policy],
                certificate=own.certificate,
                private_key=own.key,
                server_certificate=trusted,
                mode=ua.MessageSecurityMode.SignAndEncrypt,
            )
        stack.push_async_callback(_leave, client)
        await client.connect()
        return client

    async def _taking(
        self, client: Client, intakes: Mapping[str, Intake], stack: AsyncExitStack
    ) -> tuple["asyncio.Task[None]", dict[str, Intake]]:
        """Subscribe to all nodes; give the task that takes their values until they end, and assets that lack some."""
        found, lacking = await self._nodes(client, intakes)
        targets: dict[ua.NodeId, list[tuple[Intake, str]]] = {}
        for asset, nodes in found.items():
            for column, node in nodes.items():
                targets.setdefault(node, []).append((intakes[asset], column))
        subscription = await client.create_subscription(
            self._server.period * 1000.0, queue_maxsize=WAITING, overflow=OverflowPolicy.DISCONNECT
        )
        answers = await _watched(subscription, list(targets))
        for node, answer in zip(targets, answers, strict=True):
            if not isinstance(answer, ua.StatusCode):
                continue
            for intake, column in targets[node]:
                told = f"{node.to_string()} ({column} of {intake.asset}) cannot be read: {answer.name}"
                lacking.setdefault(intake.asset, f"{self._server.shown}: {told}.")
        if len(lacking) == len(intakes):
            raise SourceError(next(iter(lacking.values())))
        for asset, why in lacking.items():
            intakes[asset].tell_stale(why)
        for asset in intakes.keys() - lacking.keys():
            intakes[asset].tell_stale("")
        of = {node: [item for item in takes if item[0].asset not in lacking] for node, takes in targets.items()}
        task = asyncio.create_task(_take(subscription, of))
        stack.push_async_callback(_given_up, task)
        return task, {asset: intakes[asset] for asset in lacking}

    async def _ask_again(self, client: Client, lacking: Mapping[str, Intake]) -> None:
        """End the connection where the server has by now what an asset lacked.

        Raises
        ------
        SourceError
            Which asset has it.
        """
        for asset, nodes in (await self._nodes(client, lacking))[0].items():
            answers = await client.read_attributes([client.get_node(node) for node in nodes.values()])
            if not any(isinstance(item.StatusCode, ua.StatusCode) and item.StatusCode.is_bad() for item in answers):
                raise SourceError(f"{self._server.shown}: it has all of {asset} by now.")

    async def _nodes(
        self, client: Client, intakes: Mapping[str, Intake]
    ) -> tuple[dict[str, dict[str, ua.NodeId]], dict[str, str]]:
        """Give the node of each column of each asset, as it is told, else by its name; and what assets lack."""
        found, lacking = dict[str, dict[str, ua.NodeId]](), dict[str, str]()
        by_name: dict[str, list[tuple[tuple[str, ...], ua.NodeId]]] | None = None
        for asset, intake in intakes.items():
            nodes = dict(self._told[asset])
            asked = [name for name in intake.columns if name not in nodes]
            if asked and by_name is None:
                by_name = await self._browsed(client, {name for item in intakes.values() for name in item.columns})
            try:
                nodes |= {name: self._chosen(asset, name, (by_name or {}).get(name, [])) for name in asked}
            except SourceError as error:
                lacking[asset] = str(error)
            else:
                found[asset] = nodes
        return found, lacking

    def _chosen(self, asset: str, column: str, nodes: Sequence[tuple[tuple[str, ...], ua.NodeId]]) -> ua.NodeId:
        """Give the one node that has the name of a column; of several the one below the name of the asset."""
        below = [item for item in nodes if asset in item[0]] or list(nodes)
        if len(below) == 1:
            return below[0][1]
        named = ", ".join(node.to_string() for _, node in below[:5])
        problem = f"{len(below)} variables are called {column!r} ({named})" if below else f"no variable {column!r}"
        raise SourceError(f"{self._server.shown}: {problem}. Name the node of {column} for {asset}.")

    async def _browsed(self, client: Client, names: set[str]) -> dict[str, list[tuple[tuple[str, ...], ua.NodeId]]]:
        """Give the variables with some names, and the names of what they are in."""
        space = self._server.space
        wanted = None if not space else int(space) if space.isdecimal() else await client.get_namespace_index(space)
        found: dict[str, list[tuple[tuple[str, ...], ua.NodeId]]] = {}
        level: list[tuple[tuple[str, ...], Node]] = [((), client.get_objects_node())]
        seen = {ua.NodeId(ua.Int32(ObjectIds.Server))}
        for _ in range(DEEPEST):
            below: list[tuple[tuple[str, ...], Node]] = []
            for path, node in level:
                for item in await node.get_children_descriptions():
                    target = ua.NodeId(item.NodeId.Identifier, item.NodeId.NamespaceIndex)
                    if target in seen or len(seen) > MOST_NODES:
                        continue
                    seen.add(target)
                    name = item.BrowseName.Name or ""
                    is_wanted = wanted is None or target.NamespaceIndex == wanted
                    if item.NodeClass is ua.NodeClass.Variable and name in names and is_wanted:
                        found.setdefault(name, []).append((path, target))
                    below.append(((*path, name), client.get_node(target)))
            level = below
        return found


def _told_nodes(subscriber: Subscriber, told: Mapping[str, str]) -> dict[str, ua.NodeId]:
    """Give the nodes of the columns of which they are told."""
    columns = [item.header for item in (*subscriber.columns.inputs, *subscriber.columns.outputs)]
    found = {}
    for column, text in told.items():
        where = f"{subscriber.asset}: nodes: {column}"
        if column not in columns:
            raise FaultbondError(f"{where} is no column of the asset. There are {', '.join(dict.fromkeys(columns))}.")
        try:
            found[column] = ua.NodeId.from_string(text)
        except UaError as error:
            raise FaultbondError(
                f"{where}: {text!r} is no node. Write it like ns=2;s=Tank.level or ns=2;i=7."
            ) from error
    return found


async def _watched(subscription: Subscription, nodes: Sequence[ua.NodeId]) -> list[int | ua.StatusCode]:
    """Ask for every value of some nodes, also for one that is as before at a later time, and give the answers.

    A server that does not know how to do the latter is asked for changes.
    """
    every = ua.DataChangeFilter(Trigger=ua.DataChangeTrigger.StatusValueTimestamp)
    answers = await subscription.create_monitored_items(
        [_request(node, number, every) for number, node in enumerate(nodes, start=1)]
    )
    for k, answer in enumerate(answers):
        if isinstance(answer, ua.StatusCode) and "Filter" in answer.name:
            (answers[k],) = await subscription.create_monitored_items([_request(nodes[k], len(nodes) + 1 + k, None)])
    return answers


def _request(node: ua.NodeId, number: int, every: ua.DataChangeFilter | None) -> ua.MonitoredItemCreateRequest:
    """Give the request for the values of a node."""
    wanted = ua.MonitoringParameters()
    wanted.ClientHandle, wanted.SamplingInterval = ua.UInt32(number), ua.Double(0.0)
    wanted.QueueSize, wanted.DiscardOldest = ua.UInt32(KEPT_BY_SERVER), True
    if every is not None:
        wanted.Filter = every
    request = ua.MonitoredItemCreateRequest()
    request.ItemToMonitor.NodeId, request.ItemToMonitor.AttributeId = node, AttributeIds.Value
    request.MonitoringMode, request.RequestedParameters = ua.MonitoringMode.Reporting, wanted
    return request


async def _take(subscription: Subscription, targets: Mapping[ua.NodeId, Sequence[tuple[Intake, str]]]) -> None:
    """Take values until the subscription ends."""
    async for event in subscription:
        if isinstance(event, StatusChangeEvent):
            raise ConnectionError(event.notification.Status.name)
        if not isinstance(event, DataChangeEvent):
            continue
        data: ua.DataValue = event.data.monitored_item.Value
        status = data.StatusCode.value if data.StatusCode is not None else 0
        for intake, column in targets[event.node.nodeid]:
            if status & OVERFLOW_BITS == OVERFLOW_BITS:
                intake.count(OVERFLOW)
            intake.take([_reading(column, event.value, data, status)])


def _reading(column: str, value: object, data: ua.DataValue, status: int) -> Reading:
    """Give a value with its quality and the time of its source, else that of the server."""
    moment = data.SourceTimestamp or data.ServerTimestamp
    quality = (Quality.GOOD, Quality.UNCERTAIN, Quality.BAD, Quality.BAD)[status >> 30]
    return Reading(
        column=column,
        value=value if value is None or isinstance(value, bool | int | float | str) else "object",
        time=None if moment is None else unix_seconds(moment),
        quality=quality,
    )


async def _leave(client: Client) -> None:
    """Close a connection, also one that is broken."""
    with suppress(*LOST):
        await asyncio.wait_for(client.disconnect(), GOODBYE)


async def _given_up(task: "asyncio.Task[None]") -> None:
    """Cancel what takes values."""
    task.cancel()
    with suppress(asyncio.CancelledError, FaultbondError, *LOST):
        await task
