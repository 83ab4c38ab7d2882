"""Values of a real OPC UA server, in the same process."""

import ast
import asyncio
import importlib
import math
import re
import shutil
import subprocess
import sys
import time
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from contextlib import asynccontextmanager
from dataclasses import replace
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from benchmarks.shared.broker import free_port

from arriving import COLUMNS, WAITS, Gathered, gather, listening, subscriber
from faultbond.arrays import FloatArray
from faultbond.errors import FaultbondError, SourceError
from faultbond.io.recording import Column, Columns
from faultbond.model.graph import TimeColumn, Unit
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions

asyncua = pytest.importorskip("asyncua", reason="needs asyncua: pip install 'faultbond[opcua]'")

ua = asyncua.ua
opcua = importlib.import_module("faultbond.service.sources.opcua")
EXACT = SourceOptions(unencrypted=True, hold={"one": ()}, together=0.0, patience=0.5)
SOURCE = Path(__file__).parents[3] / "src/faultbond/service/sources/opcua.py"
PAGE = Path(__file__).parents[3] / "docs/service.md"


class Plant:
    """A server with the variables of an asset, written as a plant would."""

    def __init__(self, port: int) -> None:
        self.port, self.server = port, asyncua.Server()
        self.variables: dict[str, Any] = {}

    async def start(
        self, begins: Mapping[str, Any] | None = None, *, trusted: Path | None = None, **secure: str
    ) -> "Plant":
        """Start it with variables of the types of their first values; `secure`: certificate and key.

        trusted: the folder of the certificates that are; None: all are.
        """
        await self.server.init()
        if trusted is not None:
            self.server.set_certificate_validator(await only(trusted))
        self.server.set_endpoint(f"opc.tcp://127.0.0.1:{self.port}/plant")
        policy = ua.SecurityPolicyType.Basic256Sha256_SignAndEncrypt if secure else ua.SecurityPolicyType.NoSecurity
        self.server.set_security_policy([policy])
        if secure:
            await self.server.load_certificate(secure["certificate"])
            await self.server.load_private_key(secure["key"])
        space = await self.server.register_namespace("urn:plant")
        folder = await self.server.nodes.objects.add_object(space, "one")
        for name, first in (begins or dict.fromkeys("uyz", 0.0)).items():
            self.variables[name] = await folder.add_variable(ua.NodeId(name, space), name, first)
        await self.server.start()
        return self

    async def write(self, name: str, value: Any, moment: float, status: int = 0) -> None:
        """Give a variable a value of a moment."""
        stamp = datetime.fromtimestamp(moment, UTC).replace(tzinfo=None)
        data = ua.DataValue(ua.Variant(value), ua.StatusCode(status), SourceTimestamp=stamp)
        await self.server.write_attribute_value(self.variables[name].nodeid, data)


async def only(folder: Path) -> Any:
    """Give what looks at all that a certificate of a client has to be, and whether it is in a folder."""
    store = asyncua.crypto.truststore.TrustStore([folder], [])
    await store.load()
    options = asyncua.crypto.validator.CertificateValidatorOptions
    return asyncua.crypto.validator.CertificateValidator(options.TRUSTED_VALIDATION | options.PEER_CLIENT, store)


@asynccontextmanager
async def running(
    port: int, begins: Mapping[str, Any] | None = None, *, trusted: Path | None = None, **secure: str
) -> AsyncIterator[Plant]:
    """Run a plant."""
    plant = await Plant(port).start(begins, trusted=trusted, **secure)
    try:
        yield plant
    finally:
        await plant.server.stop()


def listened(
    act: Callable[[Plant], Awaitable[None]],
    enough: Callable[[Gathered], bool],
    options: SourceOptions = EXACT,
    path: str = "/plant",
    begins: Mapping[str, Any] | None = None,
) -> Gathered:
    """Let a plant act while a source listens."""

    async def play() -> Gathered:
        port = free_port()
        async with running(port, begins) as plant:
            source = open_source(f"opc.tcp://127.0.0.1:{port}{path}", [subscriber()], options)
            async with listening(source, enough) as task:
                await act(plant)
                return await asyncio.wait_for(task, WAITS)

    return asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


def has_time(moment: float) -> Callable[[Gathered], bool]:
    """Give what tells whether a row of a time has come."""
    return lambda found: bool(found.arrivals) and moment in found.rows()[:, 0]


async def three_rows(plant: Plant) -> None:
    """Write rows of 100 s, 101 s, 102 s, the second with bad and uncertain values."""
    for k in range(3):
        bad = ua.StatusCodes.BadSensorFailure if k == 1 else ua.StatusCodes.Good
        uncertain = ua.StatusCodes.UncertainLastUsableValue if k == 1 else ua.StatusCodes.Good
        await plant.write("u", 10.0 + k, 100.0 + k)
        await plant.write("y", 20.0 + k, 100.0 + k, bad)
        await plant.write("z", 30.0 + k, 100.0 + k, uncertain)


@pytest.mark.parametrize("by_name", [True, False])
def test_rows_have_source_times_and_qualities(*, by_name: bool) -> None:
    """Nodes are found by the columns' names or as they are told; a bad value is nan; bad and uncertain are counted."""
    nodes = {} if by_name else {"one": {name: f"ns=2;s={name}" for name in "uyz"}}
    options = SourceOptions(unencrypted=True, hold={"one": ()}, together=0.0, patience=0.5, nodes=nodes)
    found = listened(three_rows, has_time(102.0), options, "/plant?ns=urn:plant")
    rows = found.rows()
    rows = rows[(rows[:, 0] >= 100.0) & (rows[:, 0] < 1e6)]
    expected = [
        [100.0, 10.0, 20_000.0, 303.15],
        [101.0, 11.0, math.nan, 304.15],
        [102.0, 12.0, 22_000.0, 305.15],
    ]
    np.testing.assert_allclose(rows, expected)
    assert found.counts() == {"bad": 1, "uncertain": 1}


def test_values_that_are_no_numbers_are_counted() -> None:
    """A text and a list are missing in their row; a truth value is 0 or 1."""

    async def act(plant: Plant) -> None:
        await plant.write("u", True, 100.0)
        await plant.write("y", "on", 100.0)
        await plant.write("z", [1.0, 2.0], 100.0)

    def enough(seen: Gathered) -> bool:
        return has_time(100.0)(seen) and 2500.0 in seen.rows()[:, 2]  # of the first values, whose rows wait

    found = listened(act, enough, begins={"u": False, "y": "2.5", "z": [1.0]})
    rows = found.rows()
    np.testing.assert_allclose(rows[rows[:, 0] == 100.0], [[100.0, 1.0, math.nan, math.nan]])
    assert found.counts() == {"unreadable": 3}  # of z the first one, too


def test_a_value_that_stays_comes_at_each_of_its_times() -> None:
    """A sensor that shows the same twice is not missing the second time."""

    async def act(plant: Plant) -> None:
        for k in range(3):
            for name in "uyz":
                await plant.write(name, 5.0, 100.0 + k)

    rows = listened(act, has_time(102.0)).rows()
    np.testing.assert_allclose(rows[(rows[:, 0] >= 100.0) & (rows[:, 0] < 1e6)][:, 1:], [[5.0, 5000.0, 278.15]] * 3)


def test_an_input_on_change_only_holds() -> None:
    """It is in every row of the sensors, as what it was last."""

    async def act(plant: Plant) -> None:
        await plant.write("u", 40.0, 99.0)
        for k in range(3):
            await plant.write("y", 1.0 + k, 100.0 + k)
            await plant.write("z", 1.0 + k, 100.0 + k)

    options = SourceOptions(unencrypted=True, hold={"one": ("u",)}, together=0.0)
    rows = listened(act, has_time(102.0), options).rows()
    assert rows[(rows[:, 0] >= 100.0) & (rows[:, 0] < 1e6), 1].tolist() == [40.0] * 3


def test_a_node_that_is_not_there_is_told() -> None:
    """By the name of its column or as it was given, and what to do."""

    async def nothing(plant: Plant) -> None:
        return

    nodes = {"one": {"u": "ns=2;s=u", "y": "ns=2;s=gone", "z": "ns=2;s=z"}}
    options = SourceOptions(unencrypted=True, nodes=nodes)
    with pytest.raises(SourceError, match=r"ns=2;s=gone \(y of one\) cannot be read: BadNodeIdUnknown"):
        listened(nothing, lambda found: False, options)
    with pytest.raises(SourceError, match=r"no variable 'u'\. Name the node of u for one"):
        listened(nothing, lambda found: False, EXACT, "/plant?ns=0")


@pytest.mark.parametrize("by_name", [True, False])
def test_an_asset_that_lacks_a_node_is_told_and_the_others_go_on(
    *, by_name: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """It has no data until the server has the node; then all begins anew, and nothing of the others was lost."""
    monkeypatch.setattr(opcua, "AGAIN", 0.2)
    nodes = {"one": {name: f"ns=2;s={name}" for name in "uyz"}, "two": {} if by_name else {"u": "ns=2;s=late"}}
    options = replace(EXACT, nodes=nodes, hold={"one": (), "two": ()})
    lacked = "no variable 'u'" if by_name else r"ns=2;s=late (u of two) cannot be read: BadNodeIdUnknown"

    async def play() -> tuple[Gathered, str]:
        port, found = free_port(), Gathered()
        async with running(port, dict.fromkeys(("yu", "y", "z"), 0.0) if by_name else None) as plant:
            if by_name:
                nodes["one"]["u"] = "ns=2;s=yu"
                plant.variables["u"] = plant.variables["yu"]
            source = open_source(f"opc.tcp://127.0.0.1:{port}/plant", [subscriber("one"), subscriber("two")], options)
            async with listening(source, into=found) as task:
                await three_rows(plant)
                while not has_time(102.0)(found):
                    await asyncio.sleep(0.005)
                await asyncio.sleep(2.0 * (EXACT.patience or 0.0))  # after which rows go out that lack a value
                folder = await plant.server.nodes.objects.get_child("2:one")
                name = "u" if by_name else "late"
                await folder.add_variable(ua.NodeId(name, 2), name, 0.0)
                with pytest.raises(SourceError) as error:
                    await asyncio.wait_for(task, WAITS)
        return found, str(error.value)

    found, ended = asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    told = {item.asset: item.stale for item in found.arrivals if item.stale is not None}
    assert told["one"] == ""
    assert lacked in told["two"]
    assert {item.asset for item in found.arrivals if len(item.rows)} == {"one"}
    assert ended.endswith("/plant: it has all of two by now.")


@pytest.mark.parametrize(
    ("told", "reason"),
    [
        ({"flo": "ns=2;s=u"}, "one: nodes: flo is no column of the asset. There are u, y, z."),
        ({"u": "Tank.u"}, "one: nodes: u: 'Tank.u' is no node. Write it like ns=2;s=Tank.level or ns=2;i=7."),
    ],
)
def test_what_can_be_no_node_is_refused_before_anything_is_connected(told: dict[str, str], reason: str) -> None:
    """So `serve --check` says it too."""
    with pytest.raises(FaultbondError, match=re.escape(reason)):
        open_source("opc.tcp://127.0.0.1:4840", [subscriber("one")], replace(EXACT, nodes={"one": told}))


def test_a_server_that_was_stopped_is_lost_and_found() -> None:
    """What has come comes out, then one line names the server; opened again it goes on."""

    async def play() -> None:
        port, found = free_port(), Gathered()
        source = open_source(f"opc.tcp://127.0.0.1:{port}/plant", [subscriber()], EXACT)
        with pytest.raises(SourceError, match=rf"^opc.tcp://127.0.0.1:{port}/plant: \S"):
            await gather(source)
        async with running(port) as plant, listening(source, into=found) as task:
            await three_rows(plant)
            while not has_time(102.0)(found):
                await asyncio.sleep(0.005)
            await plant.server.stop()
            with pytest.raises(SourceError, match=rf"^opc.tcp://127.0.0.1:{port}/plant: \S"):
                await asyncio.wait_for(task, WAITS)
        async with running(port) as plant, listening(source, has_time(102.0)) as again:
            await three_rows(plant)
            await asyncio.wait_for(again, WAITS)

    asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


def test_traffic_is_encrypted_unless_it_is_said_otherwise(tmp_path: Path) -> None:
    """Without a certificate, and without the word, nothing is opened; with one rows come of a server that asks it."""
    with pytest.raises(FaultbondError, match="give a certificate and its key, or say security=none"):
        open_source("opc.tcp://127.0.0.1:4840", [subscriber()])
    with pytest.raises(FaultbondError, match="expected Basic256Sha256"):
        open_source("opc.tcp://127.0.0.1:4840?security=Basic256", [subscriber()])
    cert_gen = pytest.importorskip("asyncua.crypto.cert_gen")
    files = {who: (tmp_path / f"{who}.pem", tmp_path / f"{who}.der") for who in ("client", "server")}

    async def play() -> None:
        for key, certificate in files.values():
            await cert_gen.setup_self_signed_certificate(key, certificate, "urn:here:faultbond", "localhost", [], {})
        port = free_port()
        own_key, own = files["client"]
        options = SourceOptions(certificate=str(own), key=str(own_key), hold={"one": ()}, together=0.0)
        async with running(port, key=str(files["server"][0]), certificate=str(files["server"][1])) as plant:
            source = open_source(f"opc.tcp://127.0.0.1:{port}/plant", [subscriber()], options)
            async with listening(source, has_time(102.0)) as task:
                await three_rows(plant)
                await asyncio.wait_for(task, WAITS)
            with pytest.raises(SourceError):
                await gather(open_source(f"opc.tcp://127.0.0.1:{port}/plant?security=none", [subscriber()], options))

    asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


@pytest.mark.skipif(shutil.which("openssl") is None or shutil.which("bash") is None, reason="there is no openssl")
def test_a_certificate_made_as_the_docs_say_is_trusted_once_it_is_put_there(tmp_path: Path) -> None:
    """By a server that looks at all of it; until then it refuses, and the line says so."""
    cert_gen = pytest.importorskip("asyncua.crypto.cert_gen")
    pytest.importorskip("asyncua.crypto.validator")
    (commands,) = re.findall(r"```text\n(openssl req.*?)```", PAGE.read_text(encoding="utf-8"), re.DOTALL)
    subprocess.run(["bash", "-euc", commands], cwd=tmp_path, check=True, capture_output=True)
    (trusted := tmp_path / "trusted").mkdir()
    key, certificate = tmp_path / "server.pem", tmp_path / "server.der"
    options = SourceOptions(
        certificate=str(tmp_path / "opcua_certificate.pem"),
        key=str(tmp_path / "opcua_key.pem"),
        server_certificate=str(certificate),
        hold={"one": ()},
        together=0.0,
    )

    async def play() -> None:
        await cert_gen.setup_self_signed_certificate(key, certificate, "urn:here:server", "localhost", [], {})
        shutil.copy(certificate, trusted)  # a list of none is no list
        for is_trusted in (False, True):
            port = free_port()
            if is_trusted:
                shutil.copy(tmp_path / "faultbond.der", trusted)
            async with running(port, trusted=trusted, key=str(key), certificate=str(certificate)) as plant:
                source = open_source(f"opc.tcp://127.0.0.1:{port}/plant", [subscriber()], options)
                if not is_trusted:
                    with pytest.raises(SourceError, match="certificate is not trusted"):
                        await gather(source)
                    continue
                async with listening(source, has_time(102.0)) as task:
                    await three_rows(plant)
                    await asyncio.wait_for(task, WAITS)

    asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


def whole(found: Gathered) -> FloatArray:
    """Give the rows that lack nothing; the first values, each of its own time, are none."""
    rows = found.rows()
    return rows[np.isfinite(rows).all(axis=1)]


def test_twenty_signals_at_a_hundred_hertz() -> None:
    """None is lost, and rows come out soon."""
    n, names = 300, ("u", *(f"s{k}" for k in range(19)))
    wide = Columns(
        time=TimeColumn(),
        inputs=COLUMNS.inputs,
        outputs=tuple(Column(header=f"s{k}", unit=Unit("Pa"), role=f"sensor s{k}") for k in range(19)),
        sample_time=0.01,
    )

    async def play() -> tuple[Gathered, float]:
        port = free_port()
        plant = await Plant(port).start(dict.fromkeys(names, 0.0))
        try:
            source = open_source(f"opc.tcp://127.0.0.1:{port}/plant", [subscriber("one", wide)], EXACT)
            async with listening(source, lambda seen: bool(seen.arrivals) and len(whole(seen)) >= n) as task:
                begun, used = time.monotonic(), time.process_time()
                for k in range(n):
                    await asyncio.sleep(max(begun + 0.01 * k - time.monotonic(), 0.0))
                    moment = time.time()
                    for j, name in enumerate(names):
                        await plant.write(name, float(1 + (k + j) % 99), moment)
                found = await asyncio.wait_for(task, WAITS)
                return found, (time.process_time() - used) / (time.monotonic() - begun)
        finally:
            await plant.server.stop()

    found, share = asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    np.testing.assert_array_equal(whole(found)[:, 1:], 1 + (np.arange(n)[:, None] + np.arange(20)) % 99)
    late = np.concatenate([item.arrived - item.rows.time for item in found.arrivals])[-n:]
    figures = f"p50 {np.median(late):.3f} s, p99 {np.quantile(late, 0.99):.3f} s, {share:.1%} of one core, server too"
    sys.stderr.write(figures + "\n")
    assert float(np.quantile(late, 0.99)) < 1.0
    assert found.counts() == {}


def test_nothing_is_written_into_the_plant() -> None:
    """The module calls nothing whose name begins with write, set (but what the client is told), call, add or delete."""
    own = {"set_user", "set_password", "set_security", "setdefault", "add"}
    called = set()
    for node in ast.walk(ast.parse(SOURCE.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Attribute):
            called.add(node.attr)
    begins = ("write", "set", "call", "add", "delete", "register", "modify", "update", "activate", "history")
    assert {name for name in called if name.lower().startswith(begins)} - own == set()
