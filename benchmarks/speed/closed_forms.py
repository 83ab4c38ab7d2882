"""How fast routes are found and solved: the motor's fifteen hypotheses, the tank's, ladders.

    python -m benchmarks.speed.closed_forms [--json FILE] [--markdown FILE]

Wall time. Cold is a process of its own with an empty cache, from start to end, imports included; cached the same
process with the cache that the first one left. What is in the tables is measured in one process, imports done.
"""

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

from benchmarks.shared.ladders import ladder_text
from benchmarks.shared.page import as_markdown, as_text, machine, today, write_part
from faultbond.algebra.route import Question
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of
from faultbond.algebra.solving.solution import Solution
from faultbond.algebra.solving.solve import solve, solve_cached
from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components
from faultbond.equations.constraint_network import build_network
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).resolve().parents[2] / "examples"
HEADER = ("plant", "parameters", "equations", "block", "kind", "real roots", "closed forms", "route", "solve")
SECTIONS = (2, 4, 6, 8, 10, 12)


@dataclass(frozen=True, slots=True, kw_only=True)
class Solved:
    """One hypothesis: its route and its solution. Times in seconds."""

    plant: str
    parameters: str
    equations: int
    block: int
    kind: str
    real_roots: int | None
    closed_forms: int
    route: float
    solve: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Whole:
    """All fifteen hypotheses of the motor. Times in seconds; `inner` for routes and solutions alone."""

    cold: float
    cached: float
    inner_cold: float
    inner_cached: float


def numbered(graph: BondGraph) -> tuple[ComponentNetwork, NumericPlant]:
    """Give the component network of a plant and its numbers."""
    return build_components(graph, build_network(graph, assign_causality(graph))), plant_of(graph)


def solved(
    network: ComponentNetwork, plant: NumericPlant, targets: tuple[str, ...], folder: Path | None = None
) -> Solved:
    """Find and solve the route to some parameters; with a folder through the cache."""
    begin = time.perf_counter()
    route = find_route(network, Question(targets=targets, observed=network.observed, unknown=targets))
    middle = time.perf_counter()
    found: Solution = solve_cached(network, route, plant, folder) if folder else solve(network, route, plant)
    end = time.perf_counter()
    return Solved(
        plant=network.name,
        parameters=" ".join(targets),
        equations=len(route.steps),
        block=route.largest_block,
        kind=found.kind.value,
        real_roots=found.real_roots,
        closed_forms=len(found.roots),
        route=middle - begin,
        solve=end - middle,
    )


def example(folder: str, cache: Path | None = None) -> list[Solved]:
    """Solve all single and double faults of an example."""
    network, plant = numbered(load_model(EXAMPLES / folder / "model.yaml"))
    chosen = [targets for size in (1, 2) for targets in combinations(network.suspects, size)]
    return [solved(network, plant, targets, cache) for targets in chosen]


def ladders() -> list[Solved]:
    """Solve for the resistor in the middle of ladders of which the last voltage is measured."""
    return [solved(*numbered(parse_model(ladder_text(n))), (f"R{n // 2}",)) for n in SECTIONS]


def whole_motor() -> Whole:
    """Time processes that solve the motor, with an empty and with a full cache."""
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for _ in range(2):
            begin = time.perf_counter()
            command = [sys.executable, "-m", "benchmarks.speed.closed_forms", "--inner", folder]
            done = subprocess.run(command, check=True, capture_output=True, text=True, env=dict(os.environ))
            times.append((time.perf_counter() - begin, float(done.stdout)))
    (cold, inner_cold), (cached, inner_cached) = times
    return Whole(cold=cold, cached=cached, inner_cold=inner_cold, inner_cached=inner_cached)


def cells(row: Solved) -> tuple[str, ...]:
    """Give one line of the table."""
    counts = (row.equations, row.block, row.kind, "-" if row.real_roots is None else row.real_roots, row.closed_forms)
    return row.plant, row.parameters, *map(str, counts), f"{1e3 * row.route:.1f} ms", f"{1e3 * row.solve:.0f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How fast routes are found and solved.")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all numbers to FILE, in seconds")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the tables into the page FILE")
    parser.add_argument("--inner", metavar="FOLDER", type=Path, help="solve the motor with this cache, print the time")
    chosen = parser.parse_args(argv)
    if chosen.inner is not None:
        rows = example("dc_motor", chosen.inner)
        print(sum(row.route + row.solve for row in rows))
        return
    whole = whole_motor()
    words = (
        f"motor, all 15 hypotheses, routes and closed forms: {whole.cold:.2f} s cold, {whole.cached:.2f} s cached; "
        f"of which routes and solutions {whole.inner_cold:.2f} s and {whole.inner_cached:.3f} s"
    )
    print(words, flush=True)
    rows = [*example("dc_motor"), *example("tank"), *ladders()]
    table = [cells(row) for row in rows]
    note = f"{today()}; {machine()}"
    print(f"\n{as_text(HEADER, table)}\n\n{note}")
    if chosen.json is not None:
        report = {"note": note, "motor": asdict(whole), "solved": [asdict(row) for row in rows]}
        chosen.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if chosen.markdown is not None:
        text = f"`python -m benchmarks.speed.closed_forms`\n\n{note}.\n\n{words}.\n\n{as_markdown(HEADER, table)}"
        write_part(chosen.markdown, "closed forms", text)


if __name__ == "__main__":
    main()
