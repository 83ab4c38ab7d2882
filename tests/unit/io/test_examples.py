"""Built-in examples and their place in the wheel."""

import shutil
import tomllib
from pathlib import Path

import pytest

from faultbond.errors import FaultbondError
from faultbond.io import examples

ROOT = Path(__file__).parents[3]


def test_the_tank_of_the_source_tree() -> None:
    """In a source tree the example is the folder that people edit."""
    assert examples.example("tank") == ROOT / "examples" / "tank"


def test_the_tank_of_a_wheel(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """The wheel copies the tank to where an installed faultbond looks for it."""
    settings = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))
    copies = settings["tool"]["hatch"]["build"]["targets"]["wheel"]["force-include"]
    for source, target in copies.items():
        shutil.copytree(ROOT / source, tmp_path / target)
    monkeypatch.setattr(examples, "PACKAGE", tmp_path / "faultbond")
    assert examples.example("tank") == tmp_path / "faultbond" / "_examples" / "tank"


def test_an_unknown_example() -> None:
    """A name without a folder is an error that names it, and those that there are."""
    with pytest.raises(FaultbondError, match=r"no example 'rocket'\. There are .*rc, .*tank"):
        examples.example("rocket")
