"""How fast routes are found and solved: the motor's fifteen hypotheses, the tank's, ladders.

    python -m benchmarks.speed.closed_forms [--markdown FILE]

Wall time. Cold is a process of its own with an empty cache, from start to end, imports included; cached the same
process with the cache that the first one left. What is in the tables is measured in one process, imports done.
"""

import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from itertools import combinations
from pathlib import Path

from benchmarks.shared.ladders import components_of, ladder_text
from benchmarks.shared.page import arguments, note, publish
from benchmarks.shared.plants import graph_of
from faultbond.algebra.route import Question
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solve import solve, solve_cached
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model

HEADER = ("plant", "parameters", "equations", "block", "kind", "real roots", "closed forms", "route", "solve")
SECTIONS = (2, 4, 6, 8, 10, 12)
INNER = "from benchmarks.speed.closed_forms import inner; inner({!r})"

Solved = tuple[tuple[str, ...], float]  # cells of a line, and the time of route and solution, s


def solved(graph: BondGraph, chosen: Sequence[tuple[str, ...]], folder: Path | None = None) -> list[Solved]:
    """Find and solve the routes to sets of parameters of a plant; with a folder through the cache."""
    network, plant = components_of(graph), plant_of(graph)
    found: list[Solved] = []
    for targets in chosen:
        begin = time.perf_counter()
        route = find_route(network, Question(targets=targets, observed=network.observed, unknown=targets))
        middle = time.perf_counter()
        solution = solve_cached(network, route, plant, folder) if folder else solve(network, route, plant)
        end = time.perf_counter()
        roots = "-" if solution.real_roots is None else str(solution.real_roots)
        cells = (network.name, " ".join(targets), str(len(route.steps)), str(route.largest_block), solution.kind.value)
        times = (f"{1e3 * (middle - begin):.1f} ms", f"{1e3 * (end - middle):.0f} ms")
        found.append(((*cells, roots, str(len(solution.roots)), *times), end - begin))
    return found


def example(folder: str, cache: Path | None = None) -> list[Solved]:
    """Solve all single and double faults of an example."""
    names = components_of(graph_of(folder)).suspects
    return solved(graph_of(folder), [targets for size in (1, 2) for targets in combinations(names, size)], cache)


def ladders() -> list[Solved]:
    """Solve for the resistor in the middle of ladders of which the last voltage is measured."""
    return [line for n in SECTIONS for line in solved(parse_model(ladder_text(n)), [(f"R{n // 2}",)])]


def inner(folder: str) -> None:
    """Solve the motor with the cache in a folder, and print the time."""
    print(sum(taken for _, taken in example("dc_motor", Path(folder))))


def whole_motor() -> str:
    """Tell the times of processes that solve the motor, with an empty and with a full cache."""
    with tempfile.TemporaryDirectory() as folder:
        times = []
        for _ in range(2):
            begin = time.perf_counter()
            command = [sys.executable, "-c", INNER.format(folder)]
            done = subprocess.run(command, check=True, capture_output=True, text=True)
            times.append((time.perf_counter() - begin, float(done.stdout)))
    (cold, inner_cold), (cached, inner_cached) = times
    return (
        f"motor, all 15 hypotheses, routes and closed forms: {cold:.2f} s cold, {cached:.2f} s cached; "
        f"of which routes and solutions {inner_cold:.2f} s and {inner_cached:.3f} s."
    )


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    chosen = arguments("How fast routes are found and solved.", argv)
    words = whole_motor()
    lines = [cells for cells, _ in (*example("dc_motor"), *example("tank"), *ladders())]
    publish("speed.closed_forms", chosen, note(), words, (HEADER, lines))


if __name__ == "__main__":
    main()
