"""What a site file may say, and how mistakes in it are told."""

import asyncio
import socket
from contextlib import aclosing, closing
from dataclasses import replace
from pathlib import Path

import pytest

from faultbond.cli.program import main
from faultbond.errors import FaultbondError
from faultbond.service.contract.messages import Arrivals
from faultbond.service.contract.source import Subscriber
from faultbond.service.offline.limits import OfflineLimits
from faultbond.service.site import PORT, SIMULATED, read_site, site_of
from faultbond.service.sources.opening import open_source
from faultbond.service.sources.options import SourceOptions
from faultbond.service.store.opening import open_store
from faultbond.service.web.security import hashed

MODEL = Path("examples/rlc/model.yaml").resolve()


def written(folder: Path, text: str) -> Path:
    """Write a site file with a model beside it."""
    (folder / "loop.yaml").write_text(MODEL.read_text())
    path = folder / "site.yaml"
    path.write_text(text)
    return path


def test_a_site_file_names_all(tmp_path: Path) -> None:
    """Each asset has its model, source and rule, or those of the site; paths are taken from where the file lies."""
    text = """\
name: hall 7
store: kept.sqlite
source: mqtt://broker/plant/+
accept: 0.99
listen: {address: 0.0.0.0, port: 9000, certificate: page.pem, key: page.key, names: [plant.example, hall]}
keep: {days: 30}
assets:
  left: {model: loop.yaml}
  right: {model: loop.yaml, source: "file:right.csv", accept: 0.9}
  far: {model: loop.yaml, topic: hall/far, hold: [V_I]}
  twin: {model: loop.yaml, source: "sim:?speed=9&inputs=last%20week.csv&seed=2"}
  same: {model: loop.yaml, source: "sim:?inputs=/kept/last.csv"}
  plc: {model: loop.yaml, source: "opc.tcp://plc", nodes: {V_R: ns=2;s=R}}
connection: {user: anna, password_file: secret.txt}
users:
  anna: {role: operate, password: "HASH"}
"""
    (tmp_path / "secret.txt").write_text("open sesame\n")
    site = read_site(written(tmp_path, text.replace("HASH", hashed("open sesame"))))
    assert (site.name, site.host, site.port, site.days) == ("hall 7", "0.0.0.0", 9000, 30.0)  # noqa: S104
    assert (site.certificate, site.key) == (str(tmp_path / "page.pem"), str(tmp_path / "page.key"))
    assert (site.names, site.unencrypted) == (("plant.example", "hall"), False)
    assert site.store == str(tmp_path / "kept.sqlite")
    assert [(item.name, item.source, item.accept) for item in site.assets] == [
        ("left", "mqtt://broker/plant/+", 0.99),
        ("right", f"file:{tmp_path}/right.csv", 0.9),
        ("far", "mqtt://broker/plant/+", 0.99),
        ("twin", f"sim:?speed=9&inputs={tmp_path}/last%20week.csv&seed=2", 0.99),
        ("same", "sim:?inputs=/kept/last.csv", 0.99),
        ("plc", "opc.tcp://plc", 0.99),
    ]
    options = site.options("mqtt://broker/plant/+")
    assert (options.topics, site.options("opc.tcp://plc").nodes) == ({"far": "hall/far"}, {"plc": {"V_R": "ns=2;s=R"}})
    assert options.hold == {"far": ("V_I",)}
    assert (options.user, options.password_file) == ("anna", str(tmp_path / "secret.txt"))
    assert site.users["anna"].role == "operate"


def test_of_a_sparkplug_device_all_of_its_node_is_read(tmp_path: Path) -> None:
    """So nobody is told there; each asset may name a device of its own, or another kind of topic."""
    text = """\
source: mqtt://broker/spBv1.0/hall/+/gateway/{asset}
assets:
  left: {model: loop.yaml}
  right: {model: loop.yaml, topic: spBv1.0/hall/+/other}
  plain: {model: loop.yaml, topic: hall/plain}
"""
    found = read_site(written(tmp_path, text)).topics()
    assert found == {
        "left": "spBv1.0/hall/+/gateway/#",
        "right": "spBv1.0/hall/+/other/#",
        "plain": "hall/plain",
    }


def test_little_is_enough(tmp_path: Path) -> None:
    """A model for each asset; all else has a default."""
    site = read_site(written(tmp_path, "assets: {loop: {model: loop.yaml}}\n"))
    assert (site.name, site.port, site.days, dict(site.users)) == ("site", PORT, None, {})
    assert [(item.source, item.accept) for item in site.assets] == [(SIMULATED, None)]


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name: x\n", "site.yaml: `assets` is missing; write `assets: {NAME: {model: FILE}}`"),
        ("assets: {}\n", "site.yaml:1: assets are none; write `assets: {NAME: {model: FILE}}`"),
        ("assets: {a: {model: loop.yaml}}\nport: 1\n", "site.yaml:2: site: unknown key `port`; known: name, store"),
        ("assets:\n  a:\n    modle: x\n", "site.yaml:3: asset a: unknown key `modle`; did you mean `model`?"),
        ("assets:\n  a b: {model: loop.yaml}\n", "site.yaml:2: assets: `a b` is not a name"),
        ("assets:\n  a: {source: x}\n", "site.yaml:2: asset a: `model` is missing; write `model: FILE`"),
        ("assets: {a: {model: no.yaml}}\n", "site.yaml:1: asset a: model: there is no file "),
        ("assets: {a: {model: loop.yaml}}\naccept: 2\n", "site.yaml:2: accept is a number from 0.5 to 1, not `2`"),
        (
            "assets: {a: {model: loop.yaml}}\nlisten: {certificate: a.pem}\n",
            "site.yaml:2: listen: certificate is nothing without its `key`; name both files",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nlisten: {key: a.pem}\n",
            "listen: key is nothing without its `certificate`; name both files",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nlisten: {certificate: a, key: b, unencrypted: yes}\n",
            "listen: unencrypted is not so with a certificate; leave one of them out",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nlisten: {unencrypted: 1}\n",
            "listen: unencrypted is `yes` or `no`, not `1`",
        ),
        ("assets: {a: {model: loop.yaml}}\nlisten: {port: x}\n", "listen: port is a number from 0 to 65535, not `x`"),
        (
            "assets: {a: {model: loop.yaml}}\nusers: {b: {role: boss}}\n",
            "user b: `password` is missing; write the hash",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nusers:\n  b.c@d:\n    role: operator\n    password: x\n",
            "site.yaml:4: user b.c@d: role `operator` is no role; did you mean `operate`?",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nusers:\n  b:\n    role: view\n    password: open sesame\n",
            "site.yaml:5: user b: password is to be a hash, as `faultbond serve --hash` prints it",
        ),
        ("assets: {a: {model: loop.yaml}}\nusers: b\n", "site.yaml:2: users must be a table"),
        ("assets: [a]\n", "site.yaml:1: assets must be a table `{key: value, ...}`, not a list"),
        (
            "assets:\n  a: {model: loop.yaml, source: '-', topic: x}\n",
            "site.yaml:2: asset a: topic means nothing with the source -; it is of mqtt:// and mqtts://",
        ),
        (
            "assets: {a: {model: loop.yaml}}\nconnection:\n  key: no.key\n",
            "site.yaml:3: connection: key: FOLDER/no.key cannot be read: No such file or directory",
        ),
        ("", "site.yaml:1: the site file is empty"),
        ("- a\n", "site.yaml:1: a site file is a table of `key: value`"),
    ],
)
def test_a_mistake_is_told_by_its_line(tmp_path: Path, text: str, told: str) -> None:
    """Expected and found, in a line."""
    with pytest.raises(FaultbondError) as caught:
        read_site(written(tmp_path, text))
    assert told.replace("FOLDER", str(tmp_path)) in str(caught.value)


MISTAKES = """\
name: hall
store: no/such/folder/kept.sqlite
source: mqqt://broker/plant/{asset}/+
listen: {port: 99999, certificate: no.pem, key: no.key}
keeep: {days: 2}
assets:
  a: {model: no.yaml}
  b c: {model: loop.yaml}
  d: {model: loop.yaml}
  e: {model: loop.yaml, source: "mqtt://broker/plant/{aset}/+"}
  f: {model: loop.yaml, source: "mqtt://broker/plant/+", topic: "plant/{asset}/all"}
users:
  anna: {role: boss, password: open sesame}
tell:
  scada: amqp://broker/x
  hook: {to: "https://desk/in", secret_file: short.txt, kinds: [detections]}
  desk: {to: "https://desk/in", secret_file: short.txt}
  f: {to: mqtt://broker/plant/f}
"""


def test_all_mistakes_are_told_in_their_order(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Each in a line, with that of the file; what follows from another one is left out."""
    path = written(tmp_path, MISTAKES)
    (tmp_path / "short.txt").write_text("short")
    assert main(["serve", "--site", str(path), "--check"]) == 2
    told = capsys.readouterr()
    assert told.out == ""
    lines = [line.removeprefix(f"{path}:") for line in told.err.splitlines()]
    assert [line.split(".")[0] for line in lines] == [
        f"2: store {tmp_path}/no/such/folder/kept",
        "3: source 'mqqt://broker/plant/{asset}/+': expected sim:, file:PATH, -, mqtt://HOST/TOPIC, mqtts://HOST/TOPIC "
        "or opc",
        "4: listen: port is a number from 0 to 65535, not `99999`",
        f"4: listen: certificate {tmp_path}/no",
        "5: site: unknown key `keeep`; did you mean `keep`?",
        f"7: asset a: model: there is no file {tmp_path}/no",
        "8: assets: `b c` is not a name; a name is a letter, then letters, digits and `_`, 64 characters at most",
        "10: source mqtt://broker/plant/{aset}/+: 'plant/{aset}/+' is no topic for e",
        "13: user anna: role `boss` is no role; known: view, operate, engineer",
        "13: user anna: password is to be a hash, as `faultbond serve --hash` prints it",
        "15: tell scada: to: expected mqtt://HOST/PREFIX, mqtts://HOST/PREFIX, https://HOST/PATH, "
        "http://HOST/PATH, opc",
        "16: tell hook: kinds `detections` is no kind of records; did you mean `detection`?",
        "16: tell hook: secret_file: the secret is short; take 16 bytes or more",
        "17: tell desk: secret_file: the secret is short; take 16 bytes or more",
        "18: tell f: it would tell on topics that f reads, plant/f/all",
    ]


def test_a_check_says_what_would_not_do_now(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A port that is taken, a server that is not there, a file that is not there yet: they may be another day."""
    with socket.create_server(("127.0.0.1", 0)) as door:
        port = door.getsockname()[1]
        text = f"store: postgresql://a:secret@127.0.0.1:1/plant\nlisten:\n  port: {port}\nassets:\n"
        path = written(tmp_path, f"{text}  loop: {{model: loop.yaml, source: 'file:live.csv'}}\n")
        assert main(["serve", "--site", str(path), "--check"]) == 0
    lines = [line.removeprefix(f"faultbond: {path}:") for line in capsys.readouterr().err.splitlines()]
    assert [line.partition(". ")[0] for line in lines] == [
        "1: postgresql://a@127.0.0.1:1/plant: the server cannot be reached: Connection refused",
        f"3: 127.0.0.1:{port}: somebody listens there already",
        f"5: source file:{tmp_path}/live.csv: there is no such file yet",
    ]


def test_a_file_that_is_no_store_is_told_by_a_check(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """It is left as it was, and one that is a store may be written by a service meanwhile."""
    path = written(tmp_path, "store: loop.yaml\nassets: {loop: {model: loop.yaml}}\n")
    assert main(["serve", "--site", str(path), "--check"]) == 2
    assert f"{path}:1: {tmp_path}/loop.yaml: this is no store of faultbond" in capsys.readouterr().err
    assert (tmp_path / "loop.yaml").read_text() == MODEL.read_text()
    path.write_text("store: kept.sqlite\nassets: {loop: {model: loop.yaml}}\n")
    with closing(open_store(tmp_path / "kept.sqlite", reserve=0)):
        assert main(["serve", "--site", str(path), "--check"]) == 0


def test_a_command_line_names_assets_by_their_files() -> None:
    """By the folder where the file is called `model.yaml`; without one there is the tank."""
    told = {"source": None, "store": None, "port": None, "accept": None}
    assert [item.name for item in site_of([], **told).assets] == ["tank"]
    assert [item.name for item in site_of([MODEL], **told).assets] == ["rlc"]
    with pytest.raises(FaultbondError, match="there is an asset rlc already"):
        site_of([MODEL, MODEL], **told)


def test_a_network_without_time_is_refused() -> None:
    """There is nothing to watch."""
    with pytest.raises(FaultbondError, match="no samples to watch"):
        site_of([MODEL.parents[1] / "thesis" / "fig_3_7.yaml"], source=None, store=None, port=None, accept=None)


def test_limits_of_what_people_bring(tmp_path: Path) -> None:
    """Limits that are not said have their usual values; the folder is beside the store, or where the file says."""
    text = "assets: {loop: {model: loop.yaml}}\nstore: data/kept.sqlite\n"
    usual = OfflineLimits(folder=str(tmp_path / "data/kept.sqlite-offline"))
    assert read_site(written(tmp_path, text)).offline == usual
    assert read_site(written(tmp_path, f"{text}offline: yes\n")).offline == usual
    assert read_site(written(tmp_path, f"{text}offline: no\n")).offline is None
    told = "{folder: desk, upload: 1.5 GB, time: 1 h, processor: 30 min, memory: 8 GB, results: 2 GB, at_once: 2, "
    told += "queue: 9, jobs: 3, days: 0.5, room: 1 TB}"
    assert read_site(written(tmp_path, f"{text}offline: {told}\n")).offline == OfflineLimits(
        folder=str(tmp_path / "desk"),
        upload=1_500_000_000,
        seconds=3600.0,
        processor=1800.0,
        memory=8 * 10**9,
        results=2 * 10**9,
        at_once=2,
        queue=9,
        jobs=3,
        days=0.5,
        room=10**12,
    )
    server = "assets: {loop: {model: loop.yaml}}\nstore: postgresql://db/plant\n"
    assert read_site(written(tmp_path, server)).offline == replace(usual, folder=str(tmp_path / "site-offline"))
    one = site_of([MODEL], source=None, store="a.sqlite", port=None, accept=None)
    assert one.offline == replace(usual, folder="a.sqlite-offline")


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("name: " + "x" * 2**20, "site.yaml: more than 1048576 bytes; let several services watch the site"),
        ("name: [" + "b, " * 6000 + "]", "more than 5000 entries in one list or table; let several services watch"),
        ("name: " + "[" * 20, "levels of nesting; a site file needs 5"),
        ("name: \x07", "cannot stand in a site file"),
    ],
)
def test_too_much_for_a_site_file(tmp_path: Path, text: str, told: str) -> None:
    """What the reader of models refuses of a site file is told in the words of a site file."""
    with pytest.raises(FaultbondError) as refused:
        read_site(written(tmp_path, text))
    assert told in str(refused.value)
    assert "model" not in str(refused.value)


def test_a_simulation_is_driven_by_a_file_beside_the_site_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A recording that drives a plant is found beside the site file, wherever the service is started."""
    (tmp_path / "site").mkdir()
    (tmp_path / "site" / "drive it.csv").write_text("time,V_I\n" + "".join(f"{k / 40},{k % 7}\n" for k in range(200)))
    path = written(tmp_path / "site", 'assets: {loop: {model: loop.yaml, source: "sim:?inputs=drive%20it.csv"}}\n')
    monkeypatch.chdir(tmp_path)
    site = read_site(Path("site") / path.name)
    (asset,) = site.assets
    subscriber = Subscriber(asset="loop", columns=asset.plant.columns, graph=asset.plant.graph)
    source = open_source(asset.source, [subscriber], SourceOptions())

    async def first() -> Arrivals:
        async with aclosing(source.arrivals({})) as arrivals:
            return await anext(arrivals)

    assert asyncio.run(first()).asset == "loop"


def test_a_store_is_bounded_by_size(tmp_path: Path) -> None:
    """`keep` says an age, a size, or both."""
    for keep, kept in (
        ("{size: 20 GB}", (None, 20 * 10**9)),
        ("{days: 9, size: 500MB}", (9.0, 5 * 10**8)),
        ("{days: 9}", (9.0, None)),
    ):
        site = read_site(written(tmp_path, f"assets: {{loop: {{model: loop.yaml}}}}\nkeep: {keep}\n"))
        assert (site.days, site.size) == kept


@pytest.mark.parametrize(
    ("text", "told"),
    [
        ("keep: {size: 1 MB}", "site.yaml:2: keep: size is a size such as `20 GB`, from 10 MB on, not `1 MB`"),
        ("keep: {size: 20 GiB}", "keep: size is a size such as `20 GB`, from 10 MB on, not `20 GiB`"),
        ("keep: {size: -1 GB}", "keep: size is a size"),
        ("keep: {size: 9999999 TB}", "keep: size is a size"),
        ("offline: maybe", "site.yaml:2: offline is `yes` or `no`, not `maybe`"),
        ("offline: {memory: 1 MB}", "offline: memory is a size such as `20 GB`, from 100 MB on, not `1 MB`"),
        ("offline: {time: 10}", "offline: time `10` needs a time unit"),
        ("offline: {time: 1 year}", "offline: time is a time from 1 s to 604800 s, not `1 year`"),
        ("offline: {at_once: 1.5}", "offline: at_once is a whole number, not `1.5`"),
        ("offline: {at_once: 0}", "offline: at_once is a number from 1 to 64, not `0`"),
        ("offline: {uplod: 1 GB}", "offline: unknown key `uplod`; did you mean `upload`?"),
        (
            "offline: {room: 102 MB}",
            "offline: room: there is no room for a recording and its model; "
            "`room` is `upload` (100 MB) and 2.1 MB at least",
        ),
        ("offline: {upload: 9.998 GB}", "offline: upload: there is no room for a recording and its model"),
        ("offline: []", "offline"),
    ],
)
def test_mistakes_in_limits(tmp_path: Path, text: str, told: str) -> None:
    """A size, a time or a number that is none, or out of its range, is one line."""
    with pytest.raises(FaultbondError) as refused:
        read_site(written(tmp_path, f"assets: {{loop: {{model: loop.yaml}}}}\n{text}\n"))
    assert told in str(refused.value)
    assert "\n" not in str(refused.value)
