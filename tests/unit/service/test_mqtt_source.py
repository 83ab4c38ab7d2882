"""Messages of a real broker."""

import asyncio
import json
import math
import subprocess
import sys
import time
from functools import partial
from pathlib import Path

import numpy as np
import pytest
from benchmarks.shared.broker import MOSQUITTO, Mosquitto

from arriving import COLUMNS, WAITS, Gathered, gather, listening, n_rows, subscriber
from faultbond.errors import FaultbondError, SourceError
from faultbond.io.recording import Column, Columns
from faultbond.model.graph import TimeColumn, Unit
from faultbond.service.contract.source import Subscriber
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions

aiomqtt = pytest.importorskip("aiomqtt", reason="needs aiomqtt: pip install 'faultbond[mqtt]'")
pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="needs the broker mosquitto")
HOLDS = SourceOptions(hold={"one": ("u",)})


def heard(
    broker: Mosquitto,
    messages: list[tuple[str, object]],
    n: int,
    topic: str = "plant/#",
    items: tuple[Subscriber, ...] = (),
    options: SourceOptions | None = None,
) -> Gathered:
    """Publish messages while a source listens, until so many rows of each asset have come."""

    async def play() -> Gathered:
        chosen = items or (subscriber(),)
        source = open_source(f"mqtt://127.0.0.1:{broker.port}/{topic}", chosen, options)
        async with (
            listening(source, lambda found: all(n_rows(n, item.asset)(found) for item in chosen)) as task,
            aiomqtt.Client("127.0.0.1", broker.port) as client,
        ):
            for name, payload in messages:
                text = payload if isinstance(payload, bytes) else json.dumps(payload)
                await client.publish(name, text, qos=1)
            return await asyncio.wait_for(task, WAITS)

    return asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


def test_an_object_is_a_row(broker: Mosquitto) -> None:
    """Values by column with a time, in the units of the model; a list holds several; a time may be ISO."""
    messages: list[tuple[str, object]] = [
        ("plant/one", {"time": 10.0, "u": 50, "y": 2.5, "z": 20}),
        ("plant/one", [{"time": 11, "u": 50, "y": 3, "z": 20}, {"timestamp": "1970-01-01T00:00:12Z", "y": 4, "z": 21}]),
        ("plant/one", {"time": 13, "u": None, "y": "5", "z": {"value": 22, "quality": "bad"}}),
    ]
    found = heard(broker, messages, 4, options=HOLDS)
    expected = [
        [10.0, 50.0, 2500.0, 293.15],
        [11.0, 50.0, 3000.0, 293.15],
        [12.0, 50.0, 4000.0, 294.15],
        [13.0, math.nan, 5000.0, math.nan],
    ]
    np.testing.assert_allclose(found.rows(), expected)
    assert found.counts() == {"bad": 1}


@pytest.mark.parametrize("session", [False, True])
def test_what_comes_while_nobody_listens_is_kept_where_it_is_asked_for(broker: Mosquitto, *, session: bool) -> None:
    """For a client with a name, from the first time on that it was there."""
    more = "&session=1" if session else ""

    async def play() -> Gathered:
        address = f"mqtt://127.0.0.1:{broker.port}/plant/#?client=tank{more}"
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            for k in range(3):
                row = json.dumps({"time": 10.0 + k, "u": 50, "y": 2.5, "z": 20})
                if k == 1:
                    await client.publish("plant/one", row, qos=1)
                    continue
                source = open_source(address, (subscriber(),), HOLDS)
                async with listening(source, partial(has_come, 10.0 + k)) as task:
                    await client.publish("plant/one", row, qos=1)
                    found = await asyncio.wait_for(task, WAITS)
        return found

    found = asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    assert times(found) == ([11.0, 12.0] if session else [12.0])


def has_come(time: float, found: Gathered) -> bool:
    """Whether a row of a time has."""
    return time in times(found)


def times(found: Gathered) -> list[float]:
    """The times of all rows."""
    return [float(time) for item in found.arrivals for time in item.rows.time]


def test_values_of_topics_become_rows(broker: Mosquitto) -> None:
    """A column is named by its topic; without a time that of the arrival is taken; what lacks is missing in time."""
    messages: list[tuple[str, object]] = [
        ("plant/u", {"value": 40, "time": 1}),
        ("plant/z/value", {"value": 20, "time": 1}),
        ("plant/y", {"value": 1, "time": 1, "quality": 64}),
        ("plant/y", {"value": 2, "time": 2}),
        ("plant/y", 3.5),
        ("plant/z", b"21.5"),
    ]
    found = heard(broker, messages, 3, options=SourceOptions(patience=3.0, hold={"one": ("u",)})).rows()
    np.testing.assert_allclose(found[0], [1.0, 40.0, 1000.0, 293.15])
    np.testing.assert_allclose(found[1], [2.0, 40.0, 2000.0, math.nan])
    assert abs(found[2, 0] - time.time()) < 30.0
    np.testing.assert_allclose(found[2, 1:], [40.0, 3500.0, 294.65])


def test_what_is_no_message_is_counted(broker: Mosquitto) -> None:
    """Nothing of it stops the source: no JSON, deep JSON, no column, a text for a number, a megabyte, odd times."""
    last = {"time": 9, "u": 1, "y": 1, "z": 1}
    messages: list[tuple[str, object]] = [
        ("plant/x", b"{"),
        ("plant/x", b"\xff\xfe"),
        ("plant/x", b"[" * 100_000),
        ("plant/x", b"9" * 5000),
        ("plant/x", {"other": 1}),
        ("plant/x", 5),
        ("plant/x", b""),
        ("plant/x", b'{"u": 1' + b" " * 2**20 + b"}"),
        ("plant/x", {"time": 1, "u": 1, "y": "on", "z": {"value": [1]}}),
        ("plant/x", {"time": "soon", "u": 1, "y": 1, "z": 1}),
        ("plant/x", b'{"time": 2, "u": 1e999, "y": NaN, "z": true}'),
        ("plant/x", last),
    ]
    found = heard(broker, messages, 5)
    counts = found.counts()
    assert counts["oversized"] == 1
    assert counts["unknown"] == 2
    assert counts["unreadable"] == 5 + 2
    rows = found.rows()
    assert np.isnan(rows[np.isnan(rows[:, 0])][:, 1:]).any()
    np.testing.assert_allclose(rows[rows[:, 0] == 2.0][0], [2.0, math.nan, math.nan, 274.15])
    np.testing.assert_allclose(rows[rows[:, 0] == 9.0][0], [9.0, 1.0, 1000.0, 274.15])


def test_each_asset_has_its_topics(broker: Mosquitto) -> None:
    """`{asset}` in the address, and topics of the site, tell whose a message is."""
    items = (subscriber("one"), subscriber("two"), subscriber("three"))
    row = {"time": 1, "u": 1, "y": 1, "z": 1}
    messages: list[tuple[str, object]] = [
        ("plant/two/x", row | {"y": 2}),
        ("hall/x", row | {"y": 3}),
        ("plant/one/x", row),
    ]
    found = heard(broker, messages, 1, "plant/{asset}/+", items, SourceOptions(topics={"three": "hall/#"}))
    assert [found.rows(name)[0, 2] for name in ("one", "two", "three")] == [1000.0, 2000.0, 3000.0]


def test_a_retained_value_without_a_time_is_not_of_now(broker: Mosquitto) -> None:
    """It is counted; of a column that holds it is the last value, and one with a time is a row."""

    async def play() -> Gathered:
        async with aiomqtt.Client("127.0.0.1", broker.port) as client:
            for name, payload in (("u", b"30"), ("y", b"7"), ("z", b'{"value": 5, "time": 3}')):
                await client.publish(f"plant/{name}", payload, qos=1, retain=True)
        source = open_source(f"mqtt://127.0.0.1:{broker.port}/plant/+?patience=0.2", [subscriber()], HOLDS)
        return await gather(source, n_rows(1))

    found = asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    np.testing.assert_allclose(found.rows(), [[3.0, math.nan, math.nan, 278.15]])
    assert found.counts() == {"retained": 1}


def test_a_broker_that_was_killed_is_lost_and_found(broker: Mosquitto) -> None:
    """What has come comes out, then one line names the broker; opened again it listens on, and none is told before."""

    async def play() -> None:
        source = open_source(f"mqtt://me:secret@127.0.0.1:{broker.port}/plant/one", [subscriber()])
        found = Gathered()
        async with (
            listening(source, into=found) as task,
            aiomqtt.Client("127.0.0.1", broker.port) as client,
        ):
            await client.publish("plant/one", json.dumps({"time": 1, "u": 1, "y": 1, "z": 1}), qos=1)
            await client.publish("plant/one", json.dumps({"time": 2, "y": 1}), qos=1)
            await client.publish("plant/one", "{", qos=1)  # told at once, so that those before it have come
            while "unreadable" not in found.counts():
                await asyncio.sleep(0.005)
            await asyncio.to_thread(broker.kill)
            with pytest.raises(SourceError, match=rf"^mqtt://me:\*\*\*@127.0.0.1:{broker.port}/plant/one: \S+"):
                await asyncio.wait_for(task, WAITS)
        assert found.rows()[:, 0].tolist() == [1.0, 2.0]
        with pytest.raises(SourceError, match="refused"):
            await gather(source)
        await asyncio.to_thread(broker.start)
        async with (
            listening(source, n_rows(1)) as again,
            aiomqtt.Client("127.0.0.1", broker.port) as client,
        ):
            await client.publish("plant/one", json.dumps({"time": 3, "u": 1, "y": 1, "z": 1}), qos=1)
            assert (await asyncio.wait_for(again, WAITS)).rows()[:, 0].tolist() == [3.0]

    asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))


def test_passwords_open_and_are_not_shown(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Of a file, of the environment, of the address; a wrong one is told without itself."""
    secrets = tmp_path / "secrets"
    program = Path(str(MOSQUITTO)).with_name("mosquitto_passwd")
    made = next((path for path in (program, Path("/usr/bin/mosquitto_passwd")) if path.exists()), None)
    if made is None:
        pytest.skip("needs mosquitto_passwd")
    subprocess.run([str(made), "-b", "-c", str(secrets), "me", "open sesame"], check=True)
    secrets.chmod(0o644)
    guarded = Mosquitto(tmp_path, "allow_anonymous false", f"password_file {secrets}")
    guarded.start()
    place = f"127.0.0.1:{guarded.port}/plant/one"
    (tmp_path / "password").write_text("open sesame\n")

    async def opens(address: str, options: SourceOptions | None = None) -> bool:
        source = open_source(address, [subscriber()], options)
        assert "sesame" not in source.address
        async with listening(source) as task:
            if task.done():
                error = task.exception()
                assert isinstance(error, SourceError)
                assert "sesame" not in str(error)
            return not task.done()

    try:
        assert asyncio.run(opens(f"mqtt://me:open%20sesame@{place}"))
        assert not asyncio.run(opens(f"mqtt://me:sesame@{place}"))
        assert not asyncio.run(opens(f"mqtt://{place}"))
        monkeypatch.setenv("FAULTBOND_SOURCE_PASSWORD", "open sesame")
        assert asyncio.run(opens(f"mqtt://me@{place}"))
        monkeypatch.setenv("FAULTBOND_SOURCE_PASSWORD", "sesame")
        file = SourceOptions(password_file=str(tmp_path / "password"), user="me")
        assert asyncio.run(opens(f"mqtt://{place}", file))
    finally:
        guarded.kill()


@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")  # paho leaves a refused socket open
def test_tls_trusts_only_the_authority_that_is_given(tmp_path: Path) -> None:
    """With it rows come; without it the broker is not believed."""
    key, certificate = tmp_path / "key.pem", tmp_path / "certificate.pem"
    names = ["-subj", "/CN=127.0.0.1", "-addext", "subjectAltName=IP:127.0.0.1"]
    made = ["openssl", "req", "-x509", "-newkey", "rsa:2048", "-nodes", "-days", "2", "-keyout", str(key)]
    subprocess.run([*made, "-out", str(certificate), *names], check=True, capture_output=True)
    key.chmod(0o644)
    safe = Mosquitto(
        tmp_path, "allow_anonymous true", f"certfile {certificate}", f"keyfile {key}", f"cafile {certificate}"
    )
    safe.start()
    address = f"mqtts://127.0.0.1:{safe.port}/plant/one"

    async def play() -> None:
        with pytest.raises(SourceError, match=r"(?i)certificate verify failed"):
            await gather(open_source(address, [subscriber()]))
        source = open_source(address, [subscriber()], SourceOptions(authority=str(certificate)))
        params = aiomqtt.TLSParameters(ca_certs=str(certificate))
        async with (
            listening(source, n_rows(1)) as task,
            aiomqtt.Client("127.0.0.1", safe.port, tls_params=params) as client,
        ):
            await client.publish("plant/one", json.dumps({"time": 1, "u": 1, "y": 1, "z": 1}), qos=1)
            assert len((await asyncio.wait_for(task, WAITS)).rows()) == 1

    try:
        asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    finally:
        safe.kill()


WIDE = Columns(
    time=TimeColumn(),
    inputs=COLUMNS.inputs,
    outputs=tuple(Column(header=f"s{k}", unit=Unit("Pa"), role=f"sensor s{k}") for k in range(19)),
    sample_time=0.01,
)


@pytest.mark.parametrize("one_by_one", [False, True])
def test_twenty_signals_at_a_hundred_hertz(broker: Mosquitto, *, one_by_one: bool) -> None:
    """None is lost, and rows come out soon, whether a message holds a row or one value of 2000 in a second."""
    n = 300

    async def play() -> tuple[Gathered, float, float]:
        options = SourceOptions(together=0.0, hold={"one": ()})
        source = open_source(f"mqtt://127.0.0.1:{broker.port}/plant/#", [subscriber("one", WIDE)], options)
        names = ["u", *(f"s{k}" for k in range(19))]
        async with (
            listening(source, n_rows(n)) as task,
            aiomqtt.Client("127.0.0.1", broker.port) as client,
        ):
            begun = time.monotonic()
            used = time.process_time()
            for k in range(n):
                await asyncio.sleep(max(begun + 0.01 * k - time.monotonic(), 0.0))
                row = {name: k + j for j, name in enumerate(names)}
                now = time.time()
                if one_by_one:
                    for name, value in row.items():
                        await client.publish(f"plant/{name}", json.dumps({"time": now, "value": value}))
                else:
                    await client.publish("plant/one", json.dumps({"time": now, **row}))
            found = await asyncio.wait_for(task, WAITS)
            return found, time.process_time() - used, time.monotonic() - begun

    found, used, lasted = asyncio.run(asyncio.wait_for(play(), 3.0 * WAITS))
    rows = found.rows()
    np.testing.assert_array_equal(rows[:, 2:], np.arange(n)[:, None] + np.arange(1, 20))
    late = np.concatenate([item.arrived - item.rows.time for item in found.arrivals])
    figures = f"p50 {np.median(late):.3f} s, p99 {np.quantile(late, 0.99):.3f} s, {used / lasted:.1%} of one core"
    sys.stderr.write(figures + "\n")
    assert float(np.quantile(late, 0.99)) < 0.5
    assert found.counts() == {}


@pytest.mark.parametrize(
    ("address", "message"),
    [
        ("mqtt://", "name the host"),
        ("mqtt://host", "'' is no topic for one"),
        ("mqtt://host/a#", "'a#' is no topic"),
        ("mqtt://host/#/a", "'#/a' is no topic"),
        ("mqtt://host:port/a", "host or port cannot be read"),
        ("mqtt://host/a?session=1", r"session=1: the broker knows by client=NAME"),
        ("mqtt://host/a?session=1&client=x&qos=0", r"keeps none of qos=0"),
        ("mqtt://host/a?qos=3", "expected 0, 1 or 2"),
        ("mqtt://me:secret@host/a?patience=-1", "source mqtt://me:***@host/a: patience=-1"),
    ],
)
def test_mistakes_of_an_address_are_told(address: str, message: str) -> None:
    """In one line, without the password."""
    with pytest.raises(FaultbondError) as caught:
        open_source(address, [subscriber()])
    assert message in str(caught.value)
    assert "secret" not in str(caught.value)


def test_files_that_are_not_there_are_told(tmp_path: Path) -> None:
    """Before anything is connected."""
    gone = str(tmp_path / "gone")
    for address, options, message in (
        ("mqtt://host/a", SourceOptions(password_file=gone, user="me"), "password file"),
        ("mqtts://host/a", SourceOptions(authority=gone), "authority, certificate or key"),
        ("mqtt://host/a", SourceOptions(hold={"one": ("q",)}), "hold names 'q'"),
    ):
        with pytest.raises(FaultbondError, match=message):
            open_source(address, [subscriber()], options)
