"""How fast a bond graph becomes state equations, beside BondGraphTools, and how fast `analyse` answers.

    python -m benchmarks.speed.equations [--markdown FILE]

Ladders of resistors and capacitors from the model's text to the equations of motion, and a plant of 20 components and
3 sensors through the whole of `faultbond analyse` as a process of its own. Wall times of one run; BondGraphTools, where
it is installed (`pip install --group bench`), solves the same ladder in the same run up to a size that does not take a
minute.
"""

import tempfile
import time
import warnings
from collections.abc import Callable, Iterator, Sequence
from functools import partial
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.shared.clock import timed_program
from benchmarks.shared.ladders import ladder_text, six_tanks
from benchmarks.shared.page import arguments, note, publish
from faultbond.equations.plant import Plant, build_plant
from faultbond.model.text import parse_model

peer: Any
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    try:
        peer = import_module("BondGraphTools")
    except ImportError:
        peer = None

HEADER = ("work", "ours", "BondGraphTools", "asked")
SECTIONS = ((16, 0.05), (100, 1.0))
COMPARED = 16  # sections up to which BondGraphTools is asked
FIRST_ASKED, WHOLE_ASKED = 1.0, 10.0  # s


def best_of(work: Callable[[], object], rounds: int) -> float:
    """Give the shortest wall time of a piece of work, s."""
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


def ours(text: str) -> Plant:
    """Give the state equations of a model."""
    return build_plant(parse_model(text))


def theirs(sections: int) -> object:
    """Give the state equations of a ladder as BondGraphTools reduces them."""
    model = peer.new(name="ladder")
    source = peer.new("Se", value=1)
    peer.add(model, source)
    last = source
    for _ in range(sections):
        line, node = peer.new("1"), peer.new("0")
        resistor, capacitor = peer.new("R", value=2), peer.new("C", value=3)
        peer.add(model, line, node, resistor, capacitor)
        for tail, head in ((last, line), (line, resistor), (line, node), (node, capacitor)):
            peer.connect(tail, head)
        last = node
    return model.constitutive_relations


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Give the table, line by line."""
    for sections, asked in SECTIONS:
        work = partial(ours, ladder_text(sections))
        work()  # units are read once
        compare = peer is not None and sections <= COMPARED
        beside = f"{best_of(partial(theirs, sections), 1):.3g} s" if compare else "-"
        what = f"ladder of {sections} sections to state equations"
        yield what, f"{1000 * best_of(work, 5):.3g} ms", beside, f"{asked:g} s"
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "six_tanks.yaml").write_text(six_tanks(), encoding="utf-8")
        first, whole = timed_program("analyse", "six_tanks.yaml", folder=folder)
    yield "analyse, 20 components and 3 sensors: first line", f"{first:.2g} s", "-", f"{FIRST_ASKED:g} s"
    yield "the same, whole", f"{whole:.2g} s", "-", f"{WHOLE_ASKED:g} s"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How fast a bond graph becomes equations, and how fast it is analysed.", argv)
    publish("speed.equations", chosen, note(), (HEADER, list(rows())))


if __name__ == "__main__":
    main()
