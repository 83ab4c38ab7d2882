"""A server of ours: a client reads how assets stand, over an encrypted channel, and can change nothing."""

import asyncio
import math
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.broker import free_port

from faultbond.errors import FaultbondError, SinkError
from faultbond.service.contract.face import Shown
from faultbond.service.contract.sink import Sink
from faultbond.service.sinks.opening import open_sinks
from faultbond.service.sinks.options import SinkOptions

asyncua = pytest.importorskip("asyncua", reason="needs asyncua: pip install 'faultbond[opcua]'")
ua = asyncua.ua
SETTING = "Basic256Sha256,SignAndEncrypt,{certificate},{key},{server}"
BEST = {
    "names": "K1 of pipe",
    "probability": 0.75,
    "components": ["pipe"],
    "parameters": {"K1": {"nominal": 1.0, "estimate": 1.5, "sd": 0.1}, "K2": {"nominal": 2.0, "estimate": None}},
}


def stands(**changed: Any) -> Shown:
    """How an asset stands."""
    usual = {
        "name": "pump",
        "status": "FAILURE",
        "status_code": 1,
        "monitoring": "running",
        "headline": "Alärm.",
        "since": 1.7e9,
        "alarm": {"state": "unacknowledged"},
        "best": BEST,
    }
    return usual | changed


class Plant:
    """The files of both sides, and where the server is."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.port = folder, free_port()
        (folder / "word").write_text("open sesame\n")

    async def prepare(self) -> None:
        """Make certificates."""
        from asyncua.crypto import cert_gen  # noqa: PLC0415 - an extra

        for side in ("server", "client"):
            key, certificate = self.folder / f"{side}.key.pem", self.folder / f"{side}.der"
            await cert_gen.setup_self_signed_certificate(key, certificate, f"urn:here:{side}", "localhost", [], {})
        (self.folder / "server.key.pem").rename(self.folder / "server.key")  # PEM, as `openssl -keyout` calls it

    @property
    def sink(self) -> Sink:
        options = SinkOptions(
            name="plc",
            to=f"opc.tcp://127.0.0.1:{self.port}/faultbond",
            where="site.yaml:5: tell plc: to",
            user="reader",
            password_file=str(self.folder / "word"),
            certificate=str(self.folder / "server.der"),
            key=str(self.folder / "server.key"),
        )
        return open_sinks([options], {})[0]

    @asynccontextmanager
    async def client(self, user: str = "reader", word: str = "open sesame") -> AsyncIterator[Any]:
        """Give a client that is in."""
        client = asyncua.Client(f"opc.tcp://127.0.0.1:{self.port}/faultbond", timeout=10.0)
        client.application_uri = "urn:here:client"
        files = {"certificate": "client.der", "key": "client.key.pem", "server": "server.der"}
        paths = {name: str(self.folder / file) for name, file in files.items()}
        await client.set_security_string(SETTING.format(**paths))
        client.set_user(user)
        client.set_password(word)
        async with client:
            yield client


def play(folder: Path, course: Callable[[Plant, Any], Awaitable[None]]) -> None:
    """Let a server run, which was told how an asset stands."""

    async def all_of_it() -> None:
        plant = Plant(folder)
        await plant.prepare()
        async with plant.sink.opened() as link:
            await link.show(stands())
            await course(plant, link)

    asyncio.run(asyncio.wait_for(all_of_it(), 60.0))


async def values(client: Any) -> dict[str, Any]:
    """Give all variables of the pump."""
    space = await client.get_namespace_index("urn:faultbond")
    folder = await client.nodes.objects.get_child([f"{space}:pump"])
    return {(await node.read_browse_name()).Name: await node.read_value() for node in await folder.get_children()}


def test_a_client_reads_how_an_asset_stands(tmp_path: Path) -> None:
    """Its status as DeviceHealth has it, the best explanation with its values; and again where that changes."""

    async def course(plant: Plant, link: Any) -> None:
        async with plant.client() as client:
            found = await values(client)
            assert (found["DeviceHealth"], found["Status"], found["Headline"]) == (1, "FAILURE", "Alärm.")
            assert (found["AlarmState"], found["BestHypothesis"]) == ("unacknowledged", "K1 of pipe")
            assert found["Since"].replace(tzinfo=UTC).timestamp() == 1.7e9
            assert (found["BestProbability"], found["BestParameters"]) == (0.75, ["K1", "K2"])
            assert found["BestNominals"] == [1.0, 2.0]
            assert found["BestEstimates"][0] == 1.5
            assert math.isnan(found["BestEstimates"][1])
            await link.show(stands(status="NORMAL", status_code=0, alarm=None, best=None))
            found = await values(client)
            assert (found["DeviceHealth"], found["AlarmState"], found["BestHypothesis"]) == (0, "normal", "")
            assert found["BestParameters"] == []
            assert math.isnan(found["BestProbability"])

    play(tmp_path, course)


def test_a_client_changes_nothing(tmp_path: Path) -> None:
    """It neither writes a variable nor adds one."""

    async def course(plant: Plant, link: Any) -> None:
        async with plant.client() as client:
            space = await client.get_namespace_index("urn:faultbond")
            node = client.get_node(ua.NodeId("pump.Status", space))
            with pytest.raises(ua.UaStatusCodeError):
                await node.write_value("NORMAL")
            with pytest.raises(ua.UaStatusCodeError):
                await client.nodes.objects.add_variable(space, "mine", 1.0)
            assert await node.read_value() == "FAILURE"

    play(tmp_path, course)


def test_who_does_not_log_in_reads_nothing(tmp_path: Path) -> None:
    """Neither with another password, nor as admin, nor as nobody, nor without encryption."""

    async def course(plant: Plant, link: Any) -> None:
        for user, word in (("reader", "open sesam"), ("admin", ""), ("admin", "open sesame"), ("reader", "")):
            with pytest.raises(ua.UaError):
                async with plant.client(user, word):
                    pass
        plain = asyncua.Client(f"opc.tcp://127.0.0.1:{plant.port}/faultbond", timeout=5.0)
        for is_named in (False, True):
            if is_named:
                plain.set_user("reader")
                plain.set_password("open sesame")
            with pytest.raises((ua.UaError, ConnectionError, TimeoutError, OSError)):
                async with plain:
                    pass

    play(tmp_path, course)


def test_a_port_that_is_taken_is_told_in_a_line(tmp_path: Path) -> None:
    """And tried again by who runs the sink."""

    async def course(plant: Plant, link: Any) -> None:
        with pytest.raises(SinkError, match=rf"^opc.tcp://127.0.0.1:{plant.port}/faultbond: .*in use"):
            async with plant.sink.opened():
                pass

    play(tmp_path, course)


def test_there_is_no_way_without_certificate_and_password(tmp_path: Path) -> None:
    """It is refused before anything is opened."""
    here = str(tmp_path)
    bare = SinkOptions(name="plc", to="opc.tcp://127.0.0.1:4841", where="site.yaml:5")
    for options in (bare, replace(bare, user="reader"), replace(bare, certificate=here, key=here, user="reader")):
        with pytest.raises(FaultbondError, match=r"site\.yaml:5: give a `certificate` and its `key`, and the `user`"):
            open_sinks([options], {})
