"""A broker is told: what it keeps, what passes, and what others see where we are gone."""

import asyncio
import json
from collections.abc import Awaitable, Callable
from pathlib import Path
from typing import Any

import pytest
from benchmarks.shared.broker import MOSQUITTO, Mosquitto

from faultbond.errors import SinkError
from faultbond.service.contract.sink import Sink
from faultbond.service.sinks import delivery
from faultbond.service.sinks.opening import open_sinks
from faultbond.service.sinks.options import SinkOptions
from stored import told
from telling import ToldSite, summary, until

pytest.importorskip("aiomqtt", reason="there is no aiomqtt")
from broker_reader import Reader  # needs it

pytestmark = pytest.mark.skipif(MOSQUITTO is None, reason="there is no mosquitto")


def sink(broker: Mosquitto, **more: Any) -> Sink:
    options = SinkOptions(name="one", to=f"mqtt://127.0.0.1:{broker.port}/hall/found", where="site.yaml:1", **more)
    (found,) = open_sinks([options], {})
    return found


def read(broker: Mosquitto, course: Callable[[Reader], Awaitable[None]]) -> None:
    """Read beside what a test does."""

    async def all_of_it() -> None:
        reader = Reader(broker)
        reading = asyncio.create_task(reader.run())
        try:
            await course(reader)
        finally:
            reading.cancel()
            await asyncio.gather(reading, return_exceptions=True)

    asyncio.run(asyncio.wait_for(all_of_it(), 60.0))


def test_how_assets_stand_is_kept_and_records_pass(broker: Mosquitto) -> None:
    """Below the prefix; who comes later is told by the broker how assets stood last, and that we are here."""

    async def course(reader: Reader) -> None:
        stands, record = summary("pump", "FAILURE", "Alärm."), told("pump", 3)
        async with sink(broker).opened() as link:
            await until(lambda: reader.of("hall/found/service"))
            await link.show(stands)
            await link.pass_on(record)
            await until(lambda: reader.of("hall/found/pump/records/detection"))
            later = Reader(broker)
            reading = asyncio.create_task(later.run())
            await until(lambda: len(later.heard) == 2)
            reading.cancel()
            assert sorted(later.heard) == [
                ("hall/found/pump/status", reader.of("hall/found/pump/status")[0], True),
                ("hall/found/service", "online", True),
            ]
        assert json.loads(reader.of("hall/found/pump/status")[0]) == stands
        assert json.loads(reader.of("hall/found/pump/records/detection")[0]) == record.told()
        await until(lambda: reader.of("hall/found/service") == ["online", "offline"])

    read(broker, course)


def test_a_broker_that_is_gone_for_a_while_gets_all_of_it(broker: Mosquitto, monkeypatch: pytest.MonkeyPatch) -> None:
    """Records that came meanwhile, and all that it had kept and lost."""
    monkeypatch.setattr(delivery, "FIRST_DELAY", 0.05)
    monkeypatch.setattr(delivery, "LONGEST_DELAY", 0.2)
    service, status, topic = "hall/found/service", "hall/found/pump/status", "hall/found/pump/records/detection"

    async def course(reader: Reader) -> None:
        async def told_of(site: ToldSite) -> None:
            site.deliveries.see([summary("pump", "NORMAL")])
            first = site.find("detection")
            await until(lambda: reader.of(status) and reader.of(topic))
            await asyncio.to_thread(broker.kill)
            await until(lambda: not site.health()["ok"])
            second = site.find("detection", "detection")
            await asyncio.to_thread(broker.start)
            await until(lambda: len(reader.of(topic)) >= 3)
            await until(lambda: site.health()["ok"] and site.health()["behind"] == 0)
            ids = [json.loads(text)["id"] for text in reader.of(topic)]
            assert list(dict.fromkeys(ids)) == [*first, *second]
            await until(lambda: len(reader.of(status)) >= 2 and len(reader.of(service)) >= 2)
            assert json.loads(reader.of(status)[-1])["status"] == "NORMAL"
            assert reader.of(service)[-1] == "online"

        site = ToldSite(sink(broker))
        running = asyncio.create_task(site.deliveries.run())
        try:
            await told_of(site)
        finally:
            running.cancel()
            await asyncio.gather(running, return_exceptions=True)
        await until(lambda: reader.of(service)[-1] == "offline")

    read(broker, course)


def test_a_broker_that_refuses_or_is_not_there_is_told_in_a_line(tmp_path: Path) -> None:
    """With the address."""
    passwords = tmp_path / "passwords"
    passwords.write_text("")
    passwords.chmod(0o600)
    found = Mosquitto(tmp_path, "allow_anonymous false", f"password_file {passwords}")
    found.start()
    (tmp_path / "secret").write_text("sesame")

    async def opened() -> None:
        async with sink(found, user="us", password_file=str(tmp_path / "secret")).opened():
            pass

    try:
        with pytest.raises(SinkError, match=rf"^mqtt://127.0.0.1:{found.port}/hall/found: .*(?i:not authori)"):
            asyncio.run(opened())
    finally:
        found.kill()
    with pytest.raises(SinkError, match="refused"):
        asyncio.run(opened())
