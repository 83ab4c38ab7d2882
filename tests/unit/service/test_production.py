"""The files of docs/production.md: what stands in them is what the program knows."""

import configparser
import re
import shlex
import shutil
import sqlite3
import subprocess
from contextlib import closing
from pathlib import Path

import pytest

from faultbond.cli import build_parser
from faultbond.cli.program import INTERNAL_ERROR, USER_MISTAKE
from faultbond.errors import FaultbondError
from faultbond.io.row_block import RowBlock
from faultbond.service.contract.messages import Arrivals
from faultbond.service.door import refuse_open_door
from faultbond.service.site import read_site
from faultbond.service.site_log import AssetPlan, SiteLog
from faultbond.service.store.opening import open_store
from faultbond.service.web.security import hashed
from loop_asset import FOUND, plant, rows

FOLDER = Path("examples/service").resolve()
PAGE = Path("docs/production.md").resolve()
PLACEHOLDER = "hash, as `faultbond serve --hash` prints it"
ANALYSE = shutil.which("systemd-analyze")


def unit() -> configparser.ConfigParser:
    """Read the unit."""
    found = configparser.ConfigParser(interpolation=None, strict=False)
    found.optionxform = str  # type: ignore[assignment,method-assign]
    found.read(FOLDER / "faultbond.service")
    return found


def verified(path: Path) -> "subprocess.CompletedProcess[str]":
    """Let systemd read a unit."""
    return subprocess.run([str(ANALYSE), "verify", str(path)], check=False, capture_output=True, text=True)


@pytest.mark.skipif(ANALYSE is None, reason="there is no systemd-analyze: apt install systemd")
def test_systemd_takes_the_unit(tmp_path: Path) -> None:
    """Without a complaint, and with little exposed."""
    text = (FOLDER / "faultbond.service").read_text()
    (tmp_path / "faultbond.service").write_text(text.replace("/opt/faultbond/bin/faultbond", "/bin/true"))
    checked = verified(tmp_path / "faultbond.service")
    assert (checked.returncode, checked.stderr) == (0, "")
    (tmp_path / "faultbond.service").write_text(text.replace("WatchdogSec", "WatchDog") + "Bad=1\n")
    checked = verified(tmp_path / "faultbond.service")
    assert "WatchDog" in checked.stderr  # the check sees what is no key


def test_the_unit_agrees_with_the_program() -> None:
    """Its command is one that there is; what is not started again is a mistake, and a stop is none."""
    service = unit()["Service"]
    arguments = build_parser().parse_args(shlex.split(service["ExecStart"])[1:])
    assert (arguments.verb, str(arguments.site)) == ("serve", "/etc/faultbond/site.yaml")
    assert service["Type"] == "notify"
    assert service["RestartPreventExitStatus"] == str(USER_MISTAKE)
    assert service["SuccessExitStatus"] == str(128 + 15)
    assert str(INTERNAL_ERROR) not in service["RestartPreventExitStatus"]


def test_the_container_is_made_of_what_there_is() -> None:
    """It copies files of the project, installs extras that there are, and starts a verb of the program."""
    text = (FOLDER / "Containerfile").read_text()
    root = FOLDER.parents[1]
    copied = [words.split()[:-1] for words in re.findall(r"^COPY (?!--)(.+)$", text, flags=re.M)]
    assert [name for names in copied for name in names if not (root / name).exists()] == []
    (extras,) = re.findall(r"/sources\[(.+)\]", text)
    known = re.findall(r"^(\w+) = \[", (root / "pyproject.toml").read_text(), flags=re.M)
    assert {"serve", "mqtt", "opcua", "postgres"} <= set(extras.split(",")) <= set(known)
    assert f'pip install "faultbond[{extras}]"' in PAGE.read_text(encoding="utf-8")
    (command,) = re.findall(r"^CMD (\[.+\])$", text, flags=re.M)
    assert build_parser().parse_args(re.findall(r'"([^"]+)"', command)).verb == "serve"


def test_the_site_file_is_one(tmp_path: Path) -> None:
    """But for the model and the password, which are the user's; the door that it asks for is one that may be open."""
    (tmp_path / "models").mkdir()
    for name in ("model.yaml", "model.svg"):
        shutil.copy(FOLDER.parent / "tank" / name, tmp_path / "models" / name.replace("model", "tank"))
    for name in ("broker.secret", "plant.pem"):
        (tmp_path / name).touch()
    path = tmp_path / "site.yaml"
    text = (FOLDER / "site.yaml").read_text().replace(PLACEHOLDER, hashed("open sesame"))
    path.write_text(text)
    site = read_site(path)
    assert site.users["anna"].role == "engineer"
    assert site.assets[0].picture is not None
    refuse_open_door(site)
    path.write_text(re.sub(r"  (certificate|key): page.*\n", "", text))
    with pytest.raises(FaultbondError, match="passwords could be read on the way"):
        refuse_open_door(read_site(path))


def test_a_backup_is_a_store_that_goes_on(tmp_path: Path) -> None:
    """Made as the page says, while the store is written; what came later is not in it, and passes again."""
    plan = AssetPlan(name="loop", plant=plant())

    def taken(log: SiteLog, first: int, last: int) -> None:
        block: RowBlock = rows().part(slice(first, last))
        log.take([Arrivals(asset="loop", rows=block, arrived=0.0, cursor=str(last))])
        log.settle()

    store = open_store(tmp_path / "kept.sqlite")
    log = SiteLog([plan], store)
    taken(log, 0, 500)
    with (
        closing(sqlite3.connect(tmp_path / "kept.sqlite")) as source,
        closing(sqlite3.connect(tmp_path / "copy")) as copy,
    ):
        source.backup(copy)
    taken(log, 500, FOUND)
    records = list(store.records())
    store.close()
    copied = open_store(tmp_path / "copy")
    again = SiteLog([plan], copied)
    assert (again.rows("loop"), again.cursors["loop"]) == (500, "500")
    taken(again, 500, FOUND)
    assert [(item.id, item.content) for item in copied.records()] == [(item.id, item.content) for item in records]
    assert records
    copied.close()
