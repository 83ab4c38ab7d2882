"""OPC UA: how assets stand as variables of a server of ours, which clients may read and nobody may write.

Traffic is signed and encrypted, and who reads logs in; there is no way to do without.
Source: OPC 10000-100 (DI) for the numbers of DeviceHealth; OPC 10000-4, 7.38, for what a user name shows.
"""

import asyncio
import hmac
from collections.abc import AsyncIterator, Mapping
from contextlib import asynccontextmanager
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

from asyncua import ua
from asyncua.crypto.permission_rules import SimpleRoleRuleset, User, UserRole
from asyncua.server.server import Server
from asyncua.server.user_managers import UserManager
from asyncua.ua.uaerrors import UaError

from faultbond.errors import FaultbondError, SinkError, reason_of
from faultbond.service.contract.face import Shown
from faultbond.service.contract.messages import NamedRecord
from faultbond.service.sources.opcua_identity import read_identity

SPACE = "urn:faultbond"
POLICIES = (
    ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt,
    ua.SecurityPolicyType.Aes128Sha256RsaOaep_SignAndEncrypt,
    ua.SecurityPolicyType.Aes256Sha256RsaPss_SignAndEncrypt,
)
VARIABLES = {  # of each asset, with their types
    "DeviceHealth": ua.VariantType.Int32,
    "Status": ua.VariantType.String,
    "Monitoring": ua.VariantType.String,
    "Headline": ua.VariantType.String,
    "Since": ua.VariantType.DateTime,
    "AlarmState": ua.VariantType.String,
    "BestHypothesis": ua.VariantType.String,
    "BestProbability": ua.VariantType.Double,
    "BestParameters": ua.VariantType.String,
    "BestNominals": ua.VariantType.Double,
    "BestEstimates": ua.VariantType.Double,
}
LISTS = frozenset({"BestParameters", "BestNominals", "BestEstimates"})


@dataclass(frozen=True, slots=True, kw_only=True)
class OwnServer:
    """Where others read. certificate, key: files by which we are known. user, password: what they log in with."""

    url: str
    certificate: str
    key: str
    user: str
    password: str


class OpcUaSink:
    """A sink of how assets stand, for who comes and reads.

    Parameters
    ----------
    name : what the site calls it
    server : where they read
    """

    shows, kinds, give_up = True, frozenset[str](), None

    def __init__(self, name: str, server: OwnServer) -> None:
        self.name, self.address = name, server.url
        self._server = server

    @asynccontextmanager
    async def opened(self) -> AsyncIterator["OpcUaLink"]:
        """Give the running server.

        Raises
        ------
        SinkError
            Where it cannot listen, or its certificate cannot be used.
        """
        told = self._server
        server = Server(user_manager=_Door(told.user, told.password))
        try:
            await server.init()
            server.allow_remote_admin(False)
            server.set_endpoint(told.url)
            server.set_server_name("faultbond")
            own = await asyncio.to_thread(read_identity, told.certificate, told.key)
            if own.name:
                await server.set_application_uri(own.name)
            rules = SimpleRoleRuleset()  # type: ignore[no-untyped-call]
            server.set_security_policy(list(POLICIES), permission_ruleset=rules)
            server.set_identity_tokens([ua.UserNameIdentityToken])
            await server.load_certificate(own.certificate)
            await server.load_private_key(own.key)
            space = await server.register_namespace(SPACE)
            await server.start()
        except (OSError, UaError, ValueError, FaultbondError) as error:
            raise SinkError(f"{told.url}: {reason_of(error)}.") from error
        try:
            yield OpcUaLink(server, space)
        finally:
            await server.stop()


class OpcUaLink:
    """See `contract.sink.Link`."""

    def __init__(self, server: Server, space: int) -> None:
        self._server, self._space = server, space
        self._known: dict[str, dict[str, ua.NodeId]] = {}

    async def show(self, summary: Shown) -> None:
        """Write the variables of an asset; those of one that is new are made."""
        name, now = summary["name"], ua.DateTime.now(UTC)
        values = {
            key: ua.DataValue(
                ua.Variant(value, VARIABLES[key], is_array=key in LISTS), SourceTimestamp=now, ServerTimestamp=now
            )
            for key, value in variables_of(summary).items()
        }
        if name not in self._known:
            self._known[name] = await self._made(name, values)
        for key, value in values.items():
            await self._server.write_attribute_value(self._known[name][key], value)

    async def pass_on(self, record: NamedRecord) -> None:
        """Tell nothing: a variable has no past."""

    async def lost(self) -> None:
        """Wait for ever: others come to us."""
        await asyncio.Event().wait()

    async def _made(self, name: str, values: Mapping[str, ua.DataValue]) -> dict[str, ua.NodeId]:
        """Make the object of an asset, and give the nodes of its variables."""
        space, parent = self._space, self._server.nodes.objects
        folder = await parent.add_object(ua.NodeId.from_string(f"ns={space};s={name}"), f"{space}:{name}")
        nodes = {key: ua.NodeId.from_string(f"ns={space};s={name}.{key}") for key in values}
        for key, node in nodes.items():
            await folder.add_variable(node, f"{space}:{key}", values[key].Value)
        return nodes


def variables_of(summary: Shown) -> dict[str, Any]:
    """Give the variables of an asset; of the best explanation those in SI, empty where there is none."""
    best = summary["best"] or {}
    parameters = best.get("parameters", {})
    return {
        "DeviceHealth": summary["status_code"],
        "Status": summary["status"],
        "Monitoring": summary["monitoring"],
        "Headline": summary["headline"],
        "Since": datetime.fromtimestamp(summary["since"], UTC),
        "AlarmState": (summary["alarm"] or {}).get("state", "normal"),
        "BestHypothesis": best.get("names", ""),
        "BestProbability": best.get("probability", float("nan")),
        "BestParameters": list(parameters),
        "BestNominals": [_number(item["nominal"]) for item in parameters.values()],
        "BestEstimates": [_number(item["estimate"]) for item in parameters.values()],
    }


def _number(value: float | None) -> float:
    return float("nan") if value is None else value


class _Door(UserManager):
    """Lets in who knows the password, to read; asyncua's own lets in anybody, and lets who says he is admin write."""

    def __init__(self, user: str, password: str) -> None:
        self._known = _both(user, password)

    def get_user(
        self, iserver: object, username: str | None = None, password: str | None = None, certificate: object = None
    ) -> User | None:
        """Give who logs in; None: nobody."""
        is_known = hmac.compare_digest(_both(username, password), self._known)
        return User(role=UserRole.User, name=username) if is_known else None


def _both(user: str | None, password: str | bytes | None) -> bytes:
    word = password if isinstance(password, bytes) else (password or "").encode()
    return (user or "").encode() + b"\0" + word
