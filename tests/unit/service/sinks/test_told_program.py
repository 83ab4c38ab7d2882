"""`faultbond serve` with sinks, as a program: what is killed goes on telling, and --check says whom it would tell."""

import asyncio
import json
import signal
import socket
import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager, suppress
from pathlib import Path

import pytest
from benchmarks.shared.broker import MOSQUITTO, Mosquitto

from faultbond.cli import main
from faultbond.service.store.opening import open_store
from loop_asset import MODEL, RECORDING
from receiver import Receiver, listening

pytest.importorskip("uvicorn", reason='there is no uvicorn: pip install "faultbond[serve]"')
pytest.importorskip("aiomqtt", reason="there is no aiomqtt")
from broker_reader import Reader  # needs it

LONGEST = 90.0  # s that anything takes on a busy machine
SITE = """\
store: kept.sqlite
source: "file:{recording}?speed=12"
listen: {{port: {port}}}
assets: {{loop: {{model: {model}}}}}
tell:
  tickets: {{to: "http://127.0.0.1:{hook}/hook", secret_file: secret}}
  scada: {{to: "mqtt://127.0.0.1:{broker}/found", kinds: detection}}
"""


@contextmanager
def served(folder: Path) -> Iterator["subprocess.Popen[str]"]:
    """Run the program until the test is done with it."""
    command = [sys.executable, "-m", "faultbond", "serve", "--site", "site.yaml"]
    with subprocess.Popen(command, cwd=folder, stdout=subprocess.PIPE, stderr=subprocess.PIPE, text=True) as process:
        try:
            yield process
        finally:
            process.kill()


def until(is_so: Callable[[], bool]) -> None:
    end = time.monotonic() + LONGEST
    while not is_so():
        if time.monotonic() > end:
            raise TimeoutError
        time.sleep(0.02)


def ids(receiver: Receiver) -> list[str]:
    return [record["id"] for record in receiver.records()]


@pytest.mark.skipif(MOSQUITTO is None, reason="there is no mosquitto")
def test_killed_twice_it_tells_each_record_at_least_once_and_never_otherwise(tmp_path: Path, broker: Mosquitto) -> None:
    """To a receiver that fails now and then; and the broker says that it was gone."""
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
    (tmp_path / "secret").write_text("0123456789abcdef\n")
    receiver = Receiver(answers=[503, 500, 503])
    with listening(receiver):
        text = SITE.format(recording=RECORDING, model=MODEL, port=port, hook=receiver.port, broker=broker.port)
        (tmp_path / "site.yaml").write_text(text)
        for n in (1, 4):
            with served(tmp_path):
                until(lambda n=n: len(set(ids(receiver))) >= n)  # type: ignore[misc]
                receiver.answers = [503]
        until(lambda: kept(broker)[-1:] == ["offline"])
        with served(tmp_path) as process:
            until(lambda: told_all(tmp_path, receiver))
            assert kept(broker) == ["online"]
            until(
                lambda: [json.loads(text)["alarm"] is not None for text in kept(broker, "found/loop/status")] == [True]
            )
            process.send_signal(signal.SIGTERM)
            assert process.wait(LONGEST) == 128 + signal.SIGTERM
        assert kept(broker) == ["offline"]
    store = open_store(tmp_path / "kept.sqlite", writes=False)
    told = {item.id: item.told() for item in store.records()}
    assert list(dict.fromkeys(ids(receiver))) == [*told]
    assert all(record == told[record["id"]] for record in receiver.records())
    assert not store.contested()
    store.close()


def kept(broker: Mosquitto, topic: str = "found/service") -> list[str]:
    """Give what the broker has kept of a topic, which it tells who comes now."""

    async def heard() -> list[str]:
        reader = Reader(broker)
        with suppress(TimeoutError):
            await asyncio.wait_for(reader.run(), 0.3)
        return reader.of(topic)

    return asyncio.run(heard())


def told_all(folder: Path, receiver: Receiver) -> bool:
    """Whether the recording has passed, and all that was found in it has been told."""
    store = open_store(folder / "kept.sqlite", writes=False)
    try:
        found = [(item.id, item.sample) for item in store.records()]
    finally:
        store.close()
    return found[-1][1] >= 2380 and {name for name, _ in found} <= set(ids(receiver))


def test_a_check_says_whom_it_would_tell(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """And what is wrong with that."""
    (tmp_path / "secret").write_text("0123456789abcdef\n")
    path = tmp_path / "site.yaml"
    path.write_text(SITE.format(recording=RECORDING, model=MODEL, port=1, hook=2, broker=3))
    assert main(["serve", "--site", str(path), "--check"]) == 0
    said = capsys.readouterr().out
    assert "tickets: is told detection, diagnosis, accepted, rejected by http://127.0.0.1:2\n" in said
    assert "scada: is told detection, how assets stand by mqtt://127.0.0.1:3/found\n" in said
    (tmp_path / "secret").unlink()
    assert main(["serve", "--site", str(path), "--check"]) == 2
    assert "site.yaml:6: tell tickets: secret_file" in capsys.readouterr().err
