"""What a site file may say, and how mistakes in it are told."""

from pathlib import Path

import pytest

from faultbond.errors import FaultbondError
from faultbond.service.site import PORT, SIMULATED, read_site, site_of
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
  far: {model: loop.yaml, topic: hall/far, nodes: {V_R: ns=2;s=R}, hold: [V_I]}
connection: {user: anna, password_file: secret.txt}
users:
  anna: {role: operate, password: "HASH"}
"""
    site = read_site(written(tmp_path, text.replace("HASH", hashed("open sesame"))))
    assert (site.name, site.host, site.port, site.days) == ("hall 7", "0.0.0.0", 9000, 30.0)  # noqa: S104
    assert (site.certificate, site.key) == (str(tmp_path / "page.pem"), str(tmp_path / "page.key"))
    assert (site.names, site.unencrypted) == (("plant.example", "hall"), False)
    assert site.store == str(tmp_path / "kept.sqlite")
    assert [(item.name, item.source, item.accept) for item in site.assets] == [
        ("left", "mqtt://broker/plant/+", 0.99),
        ("right", "file:right.csv", 0.9),
        ("far", "mqtt://broker/plant/+", 0.99),
    ]
    options = site.options("mqtt://broker/plant/+")
    assert (options.topics, options.nodes) == ({"far": "hall/far"}, {"far": {"V_R": "ns=2;s=R"}})
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
    ],
)
def test_a_mistake_is_told_by_its_line(tmp_path: Path, text: str, told: str) -> None:
    """Expected and found, in a line."""
    with pytest.raises(FaultbondError) as caught:
        read_site(written(tmp_path, text))
    assert told in str(caught.value)


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
