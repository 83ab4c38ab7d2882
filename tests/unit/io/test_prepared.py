"""What a run needs of a plant, kept: the same to the last bit, and only for what it was made for."""

import json
import math
import os
from dataclasses import fields, replace
from functools import cache
from pathlib import Path
from typing import Any

import pytest

from faultbond.contract.spec import EngineSpec, Thresholds
from faultbond.errors import FaultbondError
from faultbond.io import cache as folder
from faultbond.io import prepared as module
from faultbond.io.cache import Library
from faultbond.io.prepared import Identity, Prepared, code_identity, read_prepared, write_prepared
from faultbond.io.recording import columns_of
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.specify import build_spec
from faultbond.types import TimeGrid

EXAMPLES = Path(__file__).parents[3] / "examples"
MODELS = sorted(EXAMPLES.glob("*/*.yaml"))
LIBRARY = Library(name="one.so", content=b"one\n\0\ntwo")
IDENTITY = Identity(model="m", stem="model", code="c", compiler="cc", processor="p")


@pytest.fixture(autouse=True)
def cache_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A cache of its own for each test."""
    monkeypatch.setenv("FAULTBOND_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


@cache
def plant(path: Path) -> tuple[BondGraph, EngineSpec] | None:
    """Give the model of a file with its specification; None of what has no time, or is no model by itself."""
    try:
        graph = load_model(path)
    except FaultbondError:
        return None
    return None if graph.grid is TimeGrid.NONE else (graph, build_spec(build_model(graph)))


def made(name: str = "tank") -> Prepared:
    """Give a plant to be kept."""
    found = plant(EXAMPLES / name / "model.yaml")
    assert found is not None
    return Prepared(spec=found[1], columns=columns_of(found[0]), compiler="cc -O2", library=LIBRARY)


@pytest.mark.parametrize("path", MODELS, ids=lambda path: f"{path.parent.name}/{path.name}")
def test_specifications_come_back_as_they_were(path: Path) -> None:
    """The specification and the columns of each example are read as they were written, with the same hash."""
    found = plant(path)
    if found is None:
        pytest.skip("not a plant in time")
    graph, spec = found
    columns = columns_of(graph)
    write_prepared(IDENTITY, Prepared(spec=spec, columns=columns, compiler="cc -O2", library=LIBRARY))
    back = read_prepared(IDENTITY)
    assert back is not None
    assert (back.spec, back.columns, back.compiler, back.library) == (spec, columns, "cc -O2", LIBRARY)
    assert hash(back.spec) == hash(spec)
    assert repr(back.spec) == repr(spec)  # types too: a whole number is no float
    assert repr(back.columns) == repr(columns)


def test_there_are_plants_among_the_examples() -> None:
    """The test above has something to compare."""
    assert sum(plant(path) is not None for path in MODELS) >= 8


def test_odd_numbers_come_back() -> None:
    """Numbers that JSON has no word for, and those at the ends of what floats can be, come back to the last bit."""
    odd = Thresholds(
        cusum_drift=math.inf, cusum_limit=-math.inf, cusum_clip=math.nan, fast_drift=-0.0, fast_limit=5e-324,
        scatter_ratio=0.1 + 0.2, scatter_limit=1.7976931348623157e308,
    )  # fmt: skip
    usual = made()
    write_prepared(IDENTITY, replace(usual, spec=replace(usual.spec, thresholds=odd)))
    back = read_prepared(IDENTITY)
    assert back is not None
    for item in fields(Thresholds):
        one, other = getattr(back.spec.thresholds, item.name), getattr(odd, item.name)
        assert repr(one) == repr(other), item.name


@pytest.mark.parametrize("name", [item.name for item in fields(Identity)])
def test_it_is_for_one_model_compiler_and_processor(name: str) -> None:
    """What was made for another model, faultbond, compiler, processor or format is not found."""
    write_prepared(IDENTITY, made())
    changes: dict[str, Any] = {name: 2 if name == "format" else "other"}
    other = replace(IDENTITY, **changes)
    assert read_prepared(other) is None
    assert read_prepared(IDENTITY) is not None


def test_what_says_that_it_is_another_is_not_believed() -> None:
    """A whole file with the right name, in which another identity stands, is not believed."""
    other = replace(IDENTITY, model="another")
    write_prepared(other, made())
    content = folder.read_kept(other.file)
    assert content is not None
    folder.write_kept(IDENTITY.file, content)
    assert read_prepared(IDENTITY) is None


@pytest.mark.parametrize("change", ["word", "size", "name", "missing", "more", "text", "deep"])
def test_what_is_of_another_form_is_not_believed(change: str) -> None:
    """A whole file with something else in it is not believed."""
    write_prepared(IDENTITY, made())
    content = folder.read_kept(IDENTITY.file)
    assert content is not None
    head, _, rest = content.partition(b"\n")
    told = json.loads(head)
    if change == "word":
        told["spec"]["parameters"][0]["nominal"] = "1"
    elif change == "size":
        told["size"] += 1
    elif change == "name":
        told["name"] = ["more.so"]
    elif change == "missing":
        del told["spec"]["states"]
    elif change == "more":
        told["spec"]["more"] = 1
    head = {"text": b"nonsense", "deep": b"[" * 100_000}.get(change, json.dumps(told).encode())
    folder.write_kept(IDENTITY.file, head + b"\n" + rest)
    assert read_prepared(IDENTITY) is None


def test_the_code_is_known_by_its_files(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """Another version, or a file that was changed, added or removed, is another faultbond."""
    package, installed = tmp_path / "package", tmp_path / "site"
    (package / "core").mkdir(parents=True)
    installed.mkdir()
    monkeypatch.setattr(module, "_PACKAGE", package)
    monkeypatch.syspath_prepend(str(installed))
    source = package / "core" / "core.c"
    seen = {code_identity()}
    for change in (
        lambda: source.write_text("int x;"),
        lambda: source.write_text("int xy;"),
        lambda: os.utime(source, (1e9, 1e9)),
        lambda: source.rename(package / "core.c"),
        lambda: (package / "core" / "Makefile").write_text("all:"),  # a template
        (installed / "faultbond-9.9.dist-info").mkdir,
    ):
        change()
        assert code_identity() not in seen
        assert code_identity() == code_identity()
        seen.add(code_identity())
    (package / "__pycache__").mkdir()
    (package / "__pycache__" / "core.pyc").write_text("")
    assert code_identity() in seen
