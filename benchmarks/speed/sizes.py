"""How large things are: ladders from text to engine, and the code of the on-line part."""

import tempfile
from importlib.resources import files
from pathlib import Path

import numpy as np

from benchmarks.shared.clock import CACHE
from benchmarks.shared.ladders import ladder_text
from benchmarks.shared.turns import spread, used
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.text import parse_model
from faultbond.synthesis.model_text import model_text
from faultbond.synthesis.specify import build_spec

ROUNDS = 3
LADDERS = {20: "8 s", 40: "20 s"}  # stores
LARGEST = "1 MB"
BUILD = """
import sys
from faultbond import load_model
from faultbond.synthesis.engine import build_engine

build_engine(load_model(sys.argv[1]))
"""

Rows = list[tuple[str, str, str]]


def ladders() -> Rows:
    """Give what ladders take from the model file to the engine, and how long their text is."""
    found: Rows = []
    for stores, asked in LADDERS.items():
        text = ladder_text(stores).replace("sample_time: 1 s", "sample_time: 1 s\nmax_faults: 1")
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder, "ladder.yaml")
            path.write_text(text, encoding="utf-8")
            taken = [used("-c", BUILD, str(path), settings={CACHE: f"{folder}/{k}"}) for k in range(ROUNDS)]
        times = spread(np.array([item.processor for item in taken]), ".2f")
        wall = spread(np.array([item.wall for item in taken]), ".2f")
        told = f"{times} s, its compilers included; wall {wall} s"
        plant = build_plant(parse_model(text))
        made = model_text(build_spec(build_step_model(plant)), build_step_model(plant, all_inputs=True))
        found.append((f"ladder of {stores} stores, sets of one, from the model file to the engine", asked, told))
        found.append((f"ladder of {stores} stores: text of the model as C", LARGEST, f"{len(made) / 1e6:.3f} MB"))
    return found


def lines() -> Rows:
    """Count the lines of the on-line part and of what makes it."""
    python = _lines("runtime", ".py") + _lines("synthesis", ".py")
    return [
        ("lines of Python in `runtime` and `synthesis`", "2,500", f"{python:,}"),
        ("lines of C in `core`", "", f"{_lines('core', '.h', '.c'):,}"),
    ]


def _lines(package: str, *ends: str) -> int:
    found = (item for item in files("faultbond").joinpath(package).iterdir() if item.name.endswith(ends))
    return sum(len(item.read_text(encoding="utf-8").splitlines()) for item in found)
