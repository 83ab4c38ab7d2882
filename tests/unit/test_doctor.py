"""`doctor` tells what is there, what works, and what to do where it does not."""

import json
import tomllib
from pathlib import Path
from typing import Any

import pytest

from faultbond.app.installation import GIVES, requirements
from faultbond.cli import build_parser, main
from faultbond.cli.completion import verbs_of

ROOT = Path(__file__).parents[2]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache that is not there yet."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def asked(tmp_path: Path) -> tuple[int, dict[str, Any]]:
    """Give the exit code and the record; findings by name."""
    target = tmp_path / "doctor.json"
    code = main(["doctor", "--json", str(target)])
    record = json.loads(target.read_text(encoding="utf-8"))
    record["checks"] = {item["name"]: item for item in record["checks"]}
    return code, record


def test_all_is_well(tmp_path: Path, cache: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Where all is there the exit code is 0, every package has a line with its version, and nothing was kept."""
    code, record = asked(tmp_path)
    lines = capsys.readouterr().out.splitlines()
    assert (code, record["works"], record["cache"]) == (0, True, str(cache))
    assert record["checks"]["compiling"]["state"] == "ok"
    assert "compiled and called" in record["checks"]["compiling"]["told"]
    for name in ("casadi", "numpy", "pyyaml", "C compiler", "cache", "[parquet]", "watching plants"):
        assert [line for line in lines if line.split(None, 1)[1:] and line[8:].startswith(name)] != [], name
    packages = [item for item in record["checks"].values() if item["group"] in {"library", "extra"}]
    assert {item["state"] for item in packages} <= {"ok", "absent"}  # none that is there is called broken
    assert not cache.exists()


def test_without_a_compiler(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a C compiler models can be read and no plant be watched: exit code 4, and what to install."""
    monkeypatch.setenv("PATH", str(tmp_path))
    monkeypatch.delenv("CC", raising=False)
    monkeypatch.setattr("faultbond.synthesis.compile.find_spec", lambda name: None)
    code, record = asked(tmp_path)
    assert (code, record["works"], record["compiler"]) == (4, False, None)
    checks = record["checks"]
    assert checks["C compiler"]["state"] == "fails"
    assert "pip install 'faultbond[compiler]'" in checks["C compiler"]["advice"]
    assert "compiling" not in checks
    assert (checks["reading models"]["state"], checks["watching plants"]["state"]) == ("ok", "fails")
    assert "compiler" in checks["watching plants"]["advice"]


def test_a_compiler_that_fails(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A compiler that is there and does not compile is told with what it says."""
    broken = tmp_path / "broken-cc"
    broken.write_text('#!/bin/sh\necho "error: no licence" >&2\nexit 1\n')
    broken.chmod(0o755)
    monkeypatch.setenv("CC", str(broken))
    code, record = asked(tmp_path)
    assert code == 4
    assert "no licence" in record["checks"]["compiling"]["told"]


def test_a_cache_that_cannot_be_written(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Without a place to keep compiled models all verbs work, and each run compiles: exit code 0."""
    (tmp_path / "file").touch()
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "file" / "cache"))
    code, record = asked(tmp_path)
    assert (code, record["works"]) == (0, True)
    assert record["checks"]["cache"]["state"] == "less"
    assert "FAULTBOND_CACHE" in record["checks"]["cache"]["advice"]
    assert record["checks"]["starting at once"]["state"] == "less"


def test_a_cache_of_others(tmp_path: Path, cache: Path) -> None:
    """A cache that others may write is refused by `run`, so it is told, with its permissions as they should be."""
    cache.mkdir()
    cache.chmod(0o777)
    code, record = asked(tmp_path)
    assert (code, record["checks"]["cache"]["state"]) == (4, "fails")
    assert "chmod go-w" in record["checks"]["cache"]["told"]
    cache.chmod(0o700)
    (cache / "some.so").write_bytes(bytes(12_300_000))
    code, record = asked(tmp_path)
    assert code == 0
    assert "cache: 1 file, 12.3 of 200 MB, drwx------" in record["checks"]["cache"]["told"]


def test_a_library_that_is_missing_or_too_old(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """A package that is needed and is not there, is too old, or is broken is named with how to install it."""
    needs = ["nowhere-to-be-had>=2", "numpy>=99", 'nor-this>=1; extra == "parquet"']
    monkeypatch.setattr("faultbond.app.installation.requires", lambda name: needs)
    code, record = asked(tmp_path)
    assert code == 4
    found = {name: record["checks"][name]["state"] for name in ("nowhere-to-be-had", "numpy", "[parquet]")}
    assert found == {"nowhere-to-be-had": "fails", "numpy": "fails", "[parquet]": "absent"}
    assert record["checks"]["numpy"]["advice"] == "pip install 'numpy>=99'"
    assert record["checks"]["reading models"]["state"] == "fails"


def test_requirements_are_those_of_the_project() -> None:
    """What is looked for is what the project declares, and each extra says what it is for."""
    read = {(item.package, item.least) for item in requirements() if not item.extra}
    assert read == {tuple(text.split(">=")) for text in PROJECT["dependencies"]}
    assert set(GIVES) >= set(PROJECT["optional-dependencies"])


def test_abilities_name_every_verb(tmp_path: Path) -> None:
    """What works is told of each verb, but of the two that always work."""
    _, record = asked(tmp_path)
    told = [record["checks"][name]["told"] for name in ("reading models", "watching plants")]
    verbs = {verb.name for verb in verbs_of(build_parser())} - {"doctor", "completion"}
    assert {word for text in told for word in text.split(", ")} == verbs
