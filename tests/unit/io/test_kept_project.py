"""A project that the cache keeps: the same to the last letter, and only for what it was made for."""

from collections.abc import Callable
from dataclasses import fields, replace
from pathlib import Path
from typing import Any

import pytest

from faultbond.io.cache import read_kept, write_kept
from faultbond.io.kept_project import Project, ProjectIdentity, read_project, write_project
from faultbond.io.prepared import Identity

PLANT = Identity(model="m", stem="model", code="c", compiler="cc", processor="p")
IDENTITY = ProjectIdentity(plant=PLANT, target="native", lanes_at_most=None, watch_only=False)
PROJECT = Project(
    model="a plant, µ",
    lanes=12,
    state_bytes=100,
    work_bytes=20,
    saved_bytes=80,
    test_fault=None,
    files=(("Makefile", 'all:\n\techo "µ\\n"\n'), ("core/core.c", "")),
)


@pytest.fixture(autouse=True)
def cache_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for each test."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@pytest.mark.parametrize("fault", [None, "K1"])
def test_it_comes_back_as_it_was(fault: str | None) -> None:
    """All of it, whether a parameter is at fault in its test or none."""
    project = replace(PROJECT, test_fault=fault)
    assert read_project(IDENTITY) is None
    write_project(IDENTITY, project)
    assert read_project(IDENTITY) == project


OTHERS: dict[str, Any] = {"plant": replace(PLANT, code="other"), "target": "x", "lanes_at_most": 1, "watch_only": True}


@pytest.mark.parametrize("name", [item.name for item in fields(ProjectIdentity)])
def test_it_is_for_one_plant_and_wish(name: str) -> None:
    """What was made for another plant, or asked for otherwise, is not found; nor where it took the other's place."""
    write_project(IDENTITY, PROJECT)
    other = replace(IDENTITY, **{name: OTHERS[name]})
    assert read_project(other) is None
    content = read_kept(IDENTITY.file)
    assert content is not None
    write_kept(other.file, content)
    assert read_project(other) is None


@pytest.mark.parametrize(
    "damage",
    [
        lambda content: b"",
        lambda content: content[:-20],
        lambda content: b"[]",
        lambda content: content.replace(b'"lanes":12', b'"lanes":"12"'),
        lambda content: content.replace(b'["core/core.c",""]', b'["core/core.c"]'),
        lambda content: b"[" * 100_000,
    ],
)
def test_what_is_damaged_is_as_good_as_not_there(damage: Callable[[bytes], bytes]) -> None:
    """No error: it is made again."""
    write_project(IDENTITY, PROJECT)
    content = read_kept(IDENTITY.file)
    assert content is not None
    write_kept(IDENTITY.file, damage(content))
    assert read_project(IDENTITY) is None


def test_without_a_cache_nothing_is_kept(cache_of_its_own: Path) -> None:
    """A cache that cannot be written is no error."""
    cache_of_its_own.write_text("a file, no folder")
    write_project(IDENTITY, PROJECT)
    assert read_project(IDENTITY) is None
