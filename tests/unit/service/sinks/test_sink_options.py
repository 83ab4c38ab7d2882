"""What a site file says of whom it tells, and how mistakes in that are told."""

import re
from pathlib import Path

import pytest

from faultbond.errors import FaultbondError
from faultbond.service.sinks.opening import is_read, metrics_token, open_sinks
from faultbond.service.sinks.options import KINDS, SinkOptions
from faultbond.service.site import Site, read_site
from faultbond.service.web.security import hashed
from loop_asset import MODEL

PAGE = Path("docs/service.md").resolve()


def site(folder: Path, *lines: str) -> Site:
    """Read a site with an asset, whose `tell` has these lines, from line 5 on."""
    path = folder / "site.yaml"
    text = ["source: mqtt://plant/hall/{asset}/+", "assets:", f"  loop: {{model: {MODEL}}}", "tell:"]
    path.write_text("\n".join([*text, *(f"  {line}" for line in lines), ""]))
    return read_site(path)


def test_a_site_tells_several(tmp_path: Path) -> None:
    """With a word for its address alone, or with more; paths are taken from where the file lies."""
    for name in ("s", "ca"):
        (tmp_path / name).touch()
    found = site(
        tmp_path,
        "scada: mqtt://broker/found",
        "tickets: {to: 'https://desk/in', kinds: [detection, accepted], give_up: 3 h, secret_file: s, authority: ca}",
    )
    assert found.tell == (
        SinkOptions(name="scada", to="mqtt://broker/found", where=f"{tmp_path}/site.yaml:5: tell scada"),
        SinkOptions(
            name="tickets",
            to="https://desk/in",
            where=f"{tmp_path}/site.yaml:6: tell tickets",
            kinds=("detection", "accepted"),
            give_up=10800.0,
            secret_file=str(tmp_path / "s"),
            authority=str(tmp_path / "ca"),
        ),
    )
    assert found.tell[0].kinds == KINDS
    (scada,) = open_sinks(found.tell[:1], found.topics())
    assert (scada.name, scada.address, scada.kinds) == ("scada", "mqtt://broker/found", frozenset(KINDS))


def opened(folder: Path, line: str) -> None:
    """Open what a site says."""
    found = site(folder, line)
    metrics_token(found.tell)
    open_sinks(found.tell, found.topics())


@pytest.mark.parametrize(
    ("line", "told"),
    [
        ("a: {kinds: detection}", "site.yaml:5: tell a: `to` is missing; write `to: ADDRESS`"),
        ("a: {to: mqtt://b/f, kind: x}", "site.yaml:5: tell a: unknown key `kind`; did you mean `kinds`?"),
        (
            "a: {to: mqtt://b/f, kinds: [detections]}",
            "tell a: kinds `detections` is no kind of records; did you mean `detection`?",
        ),
        ("a: broker", "site.yaml:5: tell a: to: expected mqtt://HOST/PREFIX, mqtts://HOST/PREFIX, https://HOST/PATH"),
        ("a: ftp://b/f", "expected mqtt://HOST/PREFIX"),
        ("a: mqtt:///f", "name the host"),
        ("a: https://b:99999/f", "its host or port cannot be read (Port out of range 0-65535)"),
        ("a: https://b/f g", "name the host"),
        ("a: mqtt://me:secret@b/f", "a password does not stand in an address"),
        ("a: https://me@b/f", "no user stands in the address"),
        ("a: mqtt://b", "'' is no prefix of topics"),
        ("a: mqtt://b/f/+", "'f/+' is no prefix of topics"),
        ("a: mqtt://b/$SYS", "'$SYS' is no prefix of topics"),
        ("a: mqtt://b/f?qos=1", "is no prefix of topics"),
        ("a: mqtt://b/hall/loop", "it would tell on topics that loop reads, hall/loop/+. Take another prefix."),
        ("a: mqtt://elsewhere/hall/loop/found", "it would tell on topics that loop reads"),
        ("a: {to: mqtt://b/f, secret_file: short}", "tell a: `secret_file` means nothing with mqtt."),
        ("a: {to: https://b/f, user: x}", "`user` means nothing with https."),
        (
            "a: {to: https://b/f, secret_file: no}",
            "tell a: secret_file: FOLDER/no cannot be read: No such file or directory",
        ),
        ("a: {to: https://b/f, secret_file: short}", "tell a: secret_file: the secret is short; take 16 bytes or more"),
        ("a: {to: https://b/f, secret_file: base}", "what stands behind whsec_ in secret_file is no Base64"),
        ("a: {to: https://b/f, token_file: lines}", "has to hold one line of printable text"),
        ("a: {to: https://b/f, authority: short}", "authority, certificate or key cannot be used"),
        ("a: {to: mqtt://b/f, password_file: short}", "there is a password without a `user`"),
        ("a: metrics", "name a `token_file`"),
        ("a: {to: metrics, give_up: 1 h}", "`give_up` means nothing with metrics"),
    ],
)
def test_a_mistake_is_told_by_its_line(tmp_path: Path, line: str, told: str) -> None:
    """Before anything is connected."""
    (tmp_path / "short").write_text("sesame")
    (tmp_path / "base").write_text("whsec_!!!!")
    (tmp_path / "lines").write_text("a\r\nX-Other: b")
    with pytest.raises(FaultbondError) as caught:
        opened(tmp_path, line)
    assert told.replace("FOLDER", str(tmp_path)) in str(caught.value)
    assert "site.yaml:5: " in str(caught.value)


@pytest.mark.parametrize(
    ("prefix", "wanted", "expected"),
    [
        ("found", "#", True),
        ("found", "plant/#", False),
        ("found", "+", True),
        ("found/by/us", "+/status", False),
        ("plant/found", "plant/#", True),
        ("plant/found", "plant/+/flow", True),
        ("plant/found", "plant/tank/flow", False),
        ("plant/found", "plant", False),
        ("plant", "plant/tank/status", True),
        ("plant", "$share/group/plant/+", True),
        ("found", "$share/group/plant/+", False),
        ("Plant", "plant/#", False),
    ],
)
def test_where_we_tell_is_kept_apart_from_where_we_read(prefix: str, wanted: str, expected: bool) -> None:
    """Any topic below the prefix that a filter has is one too many."""
    assert is_read(prefix, wanted) is expected


def test_a_token_for_metrics_is_there_once(tmp_path: Path) -> None:
    """In a file."""
    (tmp_path / "token").write_text("let me in\n")
    found = site(tmp_path, "a: {to: metrics, token_file: token}", "b: {to: metrics, token_file: token}")
    assert metrics_token(found.tell[:1]) == "let me in"
    assert open_sinks(found.tell, found.topics()) == ()
    with pytest.raises(FaultbondError, match=r"site\.yaml:6: tell b: there is a for metrics already"):
        metrics_token(found.tell)
    assert metrics_token(()) == ""


def test_the_site_of_the_page_is_one(tmp_path: Path) -> None:
    """Its file can be read as it stands there, and all of its sinks opened."""
    page = PAGE.read_text(encoding="utf-8")
    (text,) = [block for block in re.findall(r"```text\n(.*?)```", page, flags=re.S) if "\ntell:" in block]
    for name in ("pump.yaml", "tank.yaml"):
        (tmp_path / name).write_text(MODEL.read_text())
    (tmp_path / "tank.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 9 9"><rect id="R"/></svg>')
    for name in ("hook.txt", "token.txt", "secret.txt"):
        (tmp_path / name).write_text("0123456789abcdef\n")
    assert "scrypt$..." in text
    (tmp_path / "site.yaml").write_text(text.replace("scrypt$...", hashed("open sesame")))
    found = read_site(tmp_path / "site.yaml")
    assert [sink.name for sink in open_sinks(found.tell, found.topics())] == ["scada", "tickets"]
    assert metrics_token(found.tell) == "0123456789abcdef"
