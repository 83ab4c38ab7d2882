"""How fast a bond graph becomes state equations, beside BondGraphTools, and how fast `analyse` answers.

    python -m benchmarks.speed.equations [--markdown FILE]

Ladders of resistors and capacitors from the model's text to the equations of motion, and a plant of 20 components and
3 sensors through the whole of `faultbond analyse` as a process of its own. Wall times of one run; BondGraphTools, where
it is installed (`pip install --group bench`), solves the same ladder in the same run up to a size that does not take a
minute.
"""

import argparse
import subprocess
import sys
import tempfile
import time
import warnings
from collections.abc import Callable, Iterator
from importlib import import_module
from pathlib import Path
from typing import Any

from benchmarks.shared.ladders import ladder_text
from benchmarks.shared.page import Table, as_markdown, as_text, machine, today, write_part
from faultbond.equations.plant import build_plant
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
TANKS = 6


def best_of(work: Callable[[], object], rounds: int) -> float:
    """Give the shortest wall time of a piece of work, s."""
    times = []
    for _ in range(rounds):
        begin = time.perf_counter()
        work()
        times.append(time.perf_counter() - begin)
    return min(times)


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


def six_tanks() -> str:
    """Give a model of 20 components and 3 sensors: tanks in a row with turbulent pipes and leaks."""
    parts = ["  pump: {type: Se, law: e = P0, parameters: {P0: 50000 Pa}}"]
    junctions, bonds, last = [], [], "pump"
    for k in range(1, TANKS + 1):
        parts.append(f"  pipe{k}: {{type: R, law: e = R{k}*f*abs(f), parameters: {{R{k}: 2e11 Pa*s^2/m^6}}}}")
        parts.append(f"  tank{k}: {{type: C, law: e = q*A{k}, parameters: {{A{k}: 1.3e5 Pa/m^3}}}}")
        parts.append(f"  leak{k}: {{type: Sf, law: f = L{k}, parameters: {{L{k}: 1e-5 m^3/s}}}}")
        junctions += [f"line{k}: 1", f"node{k}: 0"]
        bonds += [f"{last} -> line{k} -> pipe{k}", f"line{k} -> node{k} -> tank{k}", f"node{k} -> leak{k}"]
        last = f"node{k}"
    parts.append("  out: {type: Sf, law: f = K*u, parameters: {K: 2.35e-6 m^3/s/percent}}")
    return "\n".join(
        [
            "name: six tanks",
            "sample_time: 1 s",
            "inputs: {u: {unit: percent}}",
            "components:",
            *parts,
            f"junctions: {{{', '.join(junctions)}}}",
            f"bonds: [{', '.join([*bonds, f'{last} -> out'])}]",
            "sensors: {f1: {reads: line1.f, unit: m^3/s, noise: 3e-6 m^3/s}, p3: {reads: node3.e, unit: Pa, "
            "noise: 180 Pa}, p6: {reads: node6.e, unit: Pa, noise: 180 Pa}}",
            "",
        ]
    )


def analysed(model: Path) -> tuple[float, float]:
    """Give the wall time of `faultbond analyse` until its first line, and until its end, s."""
    begin = time.perf_counter()
    with subprocess.Popen(
        [sys.executable, "-m", "faultbond", "analyse", str(model)], stdout=subprocess.PIPE, text=True
    ) as process:
        assert process.stdout is not None  # noqa: S101 - for the type
        process.stdout.readline()
        first = time.perf_counter() - begin
        process.stdout.read()
    return first, time.perf_counter() - begin


def rows() -> Iterator[tuple[str, str, str, str]]:
    """Give the table, line by line."""
    for sections, asked in SECTIONS:
        text = ladder_text(sections)
        build_plant(parse_model(text))  # units are read once
        ours = best_of(lambda text=text: build_plant(parse_model(text)), 5)  # type: ignore[misc]
        compare = peer is not None and sections <= COMPARED
        beside = f"{best_of(lambda n=sections: theirs(n), 1):.3g} s" if compare else "-"  # type: ignore[misc]
        yield f"ladder of {sections} sections to state equations", f"{1000 * ours:.3g} ms", beside, f"{asked:g} s"
    with tempfile.TemporaryDirectory() as folder:
        model = Path(folder) / "six_tanks.yaml"
        model.write_text(six_tanks(), encoding="utf-8")
        first, whole = analysed(model)
    yield "analyse, 20 components and 3 sensors: first line", f"{first:.2g} s", "-", f"{FIRST_ASKED:g} s"
    yield "the same, whole", f"{whole:.2g} s", "-", f"{WHOLE_ASKED:g} s"


def main() -> None:
    """Print the table, and put it into a page if asked."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="page to write the table into")
    arguments = parser.parse_args()
    table: Table = list(rows())
    print(as_text(HEADER, table))
    if arguments.markdown is not None:
        text = f"{as_markdown(HEADER, table)}\n\n{today()}, {machine()}."
        write_part(arguments.markdown, "equations", text)


if __name__ == "__main__":
    main()
