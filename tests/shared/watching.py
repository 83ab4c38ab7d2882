"""The generated program `watch` of built-in plants, linked with the cores of `run`, and what `run` says beside it."""

import io
import json
import math
import os
import re
import subprocess
from contextlib import redirect_stderr, redirect_stdout
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any
from unittest.mock import patch

from faultbond.cli import main
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.io.recording import columns_of
from faultbond.model.graph import BondGraph
from faultbond.synthesis.columns_text import columns_text
from faultbond.synthesis.compile import CORE
from faultbond.synthesis.engine import build
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.names_text import names_text
from faultbond.synthesis.specify import build_spec
from in_c import PROGRAM, SANITIZERS, WARNINGS
from made import EXAMPLES, graph_of

MEMORY = Path(__file__).with_name("plant_memory.c")
SANITIZED = "rc"  # the plant whose program is under sanitizers, which take long to compile
CLOSE = 1e-9  # part by which numbers may differ
REMARKS = ("its row is not used", "it counts as missing", "than sample_time, ")  # of cells and of the pace of rows

Record = dict[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class Said:
    """What a run left: exit code, lines on standard output and error."""

    code: int
    out: tuple[str, ...]
    err: str

    @property
    def records(self) -> list[Record]:
        """The records, in order."""
        return [json.loads(line) for line in self.out]

    def of(self, *kinds: str) -> list[str]:
        """The lines of records of these kinds."""
        return [line for line in self.out if json.loads(line)["record"] in kinds]


def generated_texts(graph: BondGraph) -> dict[str, str]:
    """The generated headers of a model, by name."""
    plant = build_plant(graph)
    spec = build_spec(build_step_model(plant))
    return {
        "model.h": model_text(spec, build_step_model(plant, all_inputs=True)),
        "names.h": names_text(spec),
        "columns.h": columns_text(spec, columns_of(graph)),
    }


def write_texts(graph: BondGraph, folder: Path) -> tuple[str, ...]:
    """Write the generated headers into a folder, and give where a compiler finds all."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, text in generated_texts(graph).items():
        (folder / name).write_text(text)
    return (f"-I{folder}", f"-I{CORE}", "-iquote", str(PROGRAM))


@cache
def watch_program(name: str, folder: Path) -> Path:
    """The program of a built-in plant; made once for all who share a folder."""
    place = folder / name
    target = place / "watch"
    if target.exists():
        return target
    made = folder / f"{name}.{os.getpid()}"
    places = write_texts(graph_of(name), made)
    (made / "core.so").write_bytes(build(graph_of(name)).library.content)
    texts = (str(PROGRAM / "main.c"), str(MEMORY))
    target = made / "made"
    options = ("-std=c99", *WARNINGS, *(("-O1", "-g", *SANITIZERS) if name == SANITIZED else ("-O0",)), *places)
    command = ["gcc", *options, *texts, str(made / "core.so"), "-lm", "-o", str(target)]
    done = subprocess.run(command, check=False, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    place.mkdir(exist_ok=True)
    target.replace(place / "watch")
    return place / "watch"


def watched(program: Path, recording: bytes, *arguments: str) -> Said:
    """What the program says to a recording on standard input."""
    done = subprocess.run([program, *arguments], input=recording, capture_output=True, check=False)
    return Said(code=done.returncode, out=tuple(done.stdout.decode().splitlines()), err=done.stderr.decode())


def ran(model: Path, recording: bytes, *arguments: str) -> Said:
    """What `faultbond run MODEL - --json -` says to it."""
    out, err, stdin = io.StringIO(), io.StringIO(), io.TextIOWrapper(io.BytesIO(recording), encoding="utf-8")
    with patch("sys.stdin", stdin), redirect_stdout(out), redirect_stderr(err):
        code = main(["run", str(model), "-", "--json", "-", *arguments])
    return Said(code=code, out=tuple(out.getvalue().splitlines()), err=err.getvalue())


def example_of(name: str) -> Path:
    """The model file of a built-in plant."""
    return EXAMPLES / name / "model.yaml"


def assert_same(one: Said, other: Said) -> None:
    """The same exit code, words on standard error, and records but for the last digits of numbers.

    What `run` remarks of cells and of the pace of rows is its own.
    """
    assert _without_remarks(one.err) == _without_remarks(other.err)
    assert one.code == other.code
    assert len(one.out) == len(other.out)
    for a, b in zip(one.records, other.records, strict=True):
        assert difference(a, b) == ""


def _without_remarks(said: str) -> list[str]:
    """Give lines of standard error but for remarks on text in columns, also within a line, and on the pace of rows."""
    lines = [line for line in said.splitlines() if not any(words in line for words in REMARKS)]
    return [re.sub(r"(?<=before the year 9999)[^.]*'[^']*'", "", line) for line in lines]


def difference(one: Any, other: Any, place: str = "") -> str:
    """Where two records differ by more than the last digits of numbers, in order of keys too; empty where nowhere."""
    if isinstance(one, float) and isinstance(other, float):
        return "" if math.isclose(one, other, rel_tol=CLOSE) else f"{place}: {one!r}, {other!r}"
    if type(one) is not type(other):
        return f"{place}: {one!r}, {other!r}"
    if isinstance(one, dict) and isinstance(other, dict):
        if list(one) != list(other):
            return f"{place}: {list(one)}, {list(other)}"
        return next((found for key in one if (found := difference(one[key], other[key], f"{place}.{key}"))), "")
    if isinstance(one, list) and isinstance(other, list) and len(one) == len(other):
        return next((found for k in range(len(one)) if (found := difference(one[k], other[k], f"{place}.{k}"))), "")
    return "" if one == other else f"{place}: {one!r}, {other!r}"
