"""Rules of MISRA C:2012: the table of those that are not followed is right; `make golden` counts the places anew."""

import os
import re
import shutil
import subprocess
from importlib.resources import files
from pathlib import Path

import pytest

from compiled_once import made_once
from faultbond.cli import main

TANK = Path(__file__).parents[2] / "examples" / "tank" / "model.yaml"
TABLE = Path(str(files("faultbond"))) / "synthesis" / "templates" / "misra.txt"
ADVISORY = "2.3 2.4 2.5 5.9 8.9 10.5 11.5 12.1 12.3 13.3 13.4 15.5 17.8 18.4 20.1 20.5 20.10"
COUNTED = re.compile(r"^(\d+\.\d+) +(required|advisory|\?) +(\d+) +(\d+)(.*)$", re.MULTILINE)
NEAR = 0.1  # of the places of a rule that is violated often: what a change of the code may add unnoticed
FEW = 5

pytestmark = [
    pytest.mark.skipif(shutil.which("make") is None, reason="there is no make"),
    pytest.mark.skipif(shutil.which("awk") is None, reason="there is no awk"),
    pytest.mark.skipif(shutil.which("cppcheck") is None, reason="there is no cppcheck: apt install cppcheck"),
]


def table() -> dict[str, list[str]]:
    """The rows of the table by rule: kind, places in the library and in the program, why."""
    rows = (line.split(" | ") for line in TABLE.read_text().splitlines() if not line.startswith("#"))
    return {rule: told for rule, *told in rows}


def misra(folder: Path) -> subprocess.CompletedProcess[str]:
    """Run `make misra` in a project."""
    return subprocess.run(["make", "-s", "-C", str(folder), "misra"], capture_output=True, text=True, check=False)


def places_of(folder: Path) -> Path:
    """Let cppcheck look at a project, which takes half a minute; at the same bytes once, whatever their rules are."""
    texts = [path for path in sorted(folder.rglob("*")) if path.is_file() and path.parent.name != "check"]
    version = subprocess.run(["cppcheck", "--version"], capture_output=True, text=True, check=True).stdout
    told = (version, *(f"{path.relative_to(folder)}: {path.read_text(encoding='utf-8')}" for path in texts))
    target = folder / "build" / "misra-places.txt"
    target.parent.mkdir()

    def looked() -> bytes:
        done = misra(folder)
        assert target.exists(), done.stdout + done.stderr
        return target.read_bytes()

    return made_once(told, target, looked)


def rewrite(counted: dict[str, tuple[str, str]]) -> None:
    """Put counts into the table."""
    rows = {rule: [kind, *counted.get(rule, places), why] for rule, (kind, *places, why) in table().items()}
    head = [line for line in TABLE.read_text().splitlines() if line.startswith("#")]
    TABLE.write_text("\n".join([*head, *(" | ".join((rule, *told)) for rule, told in rows.items())]) + "\n")


def near(told: str, found: str) -> bool:
    """Whether a count is about what is told."""
    return abs(int(told) - int(found)) <= max(FEW, NEAR * int(told))


def test_the_rules_that_are_not_followed_are_those_of_the_table(tmp_path: Path) -> None:
    """Each rule violated has its reason, its kind and its places; none is in the table that is followed now."""
    folder = tmp_path / "tank"
    assert main(["generate", str(TANK), "-o", str(folder)]) == 0
    assert places_of(folder).stat().st_size > 0
    done = misra(folder)
    found = {rule: (library, program) for rule, _, library, program, _ in COUNTED.findall(done.stdout)}
    assert (done.returncode, len(found) > 0) == (0, True), done.stdout + done.stderr
    if os.environ.get("FAULTBOND_GOLDEN") == "rewrite":
        rewrite(found)
        return
    rows = table()
    unseen = (["-", "-"], ["0", "0"])  # by cppcheck; in this model
    assert set(found) == {rule for rule, (_, *places, _) in rows.items() if places not in unseen}
    assert all(near(told, places[k]) for rule, places in found.items() for k, told in enumerate(rows[rule][1:3]))
    assert " ".join(rule for rule, (kind, *_) in rows.items() if kind == "advisory") == ADVISORY
    assert all(f"| {rule} | {' | '.join(told)} |" in (folder / "README.md").read_text() for rule, told in rows.items())

    kept = folder / "check" / "misra.txt"
    kept.write_text(kept.read_text().replace("\n15.7 |", "\n# 15.7 |"))
    refused = misra(folder)
    assert refused.returncode != 0
    assert "15.7" in refused.stdout
    assert "not in check/misra.txt: 1" in refused.stdout
