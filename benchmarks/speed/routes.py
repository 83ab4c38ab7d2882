"""How long routes take: the thesis' search beside matching and integer programming.

    python -m benchmarks.speed.routes [--json FILE] [--markdown FILE]

On the motor all sets of parameters; on ladders, where the search explodes unless there are sensors everywhere, one
parameter in the middle and two at the ends. Processor time, the best of three where it is short.
"""

import argparse
import json
import time
from collections.abc import Callable, Iterator, Sequence
from dataclasses import asdict, dataclass
from itertools import combinations
from pathlib import Path

from benchmarks.shared.ladders import example, ladder
from benchmarks.shared.page import as_markdown, as_text, machine, today, write_part
from faultbond.algebra.routes.fewest import fewest_components
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.equations.component_network import ComponentNetwork
from faultbond.thesis.search import Ending, search_route

SECTIONS = (2, 3, 4, 5, 6, 8, 10, 12)
SENSORS = ("ends", "ends+i", "all")
STATES = 20_000  # at which the search is given up here
SHORT = 0.1  # s; what is shorter is measured three times


@dataclass(frozen=True, slots=True, kw_only=True)
class Measured:
    """One question: the route by matching, and the processor time, s, of each method.

    searched : equations of the search's route; None where it was given up
    expanded : states that the search looked at
    """

    plant: str
    parameters: tuple[str, ...]
    equations: int
    frames: int
    observations: int
    largest_block: int
    matching: float
    fewest: int
    integer: float
    searched: int | None
    expanded: int
    search: float


def measure(plant: str, network: ComponentNetwork, names: tuple[str, ...]) -> Measured:
    """Answer one question by the three methods."""
    question = parameters(network, names)
    route = find_route(network, question)
    search = search_route(network, question, limit=STATES)
    return Measured(
        plant=plant,
        parameters=names,
        equations=len(route.steps),
        frames=route.frames,
        observations=route.observations,
        largest_block=route.largest_block,
        matching=_time(lambda: find_route(network, question)),
        fewest=len(fewest_components(network, question).steps),
        integer=_time(lambda: fewest_components(network, question)),
        searched=len(search.route.steps) if search.route is not None else None,
        expanded=search.expanded,
        search=_time(lambda: search_route(network, question, limit=STATES))
        if search.ending is not Ending.LIMIT
        else float("nan"),
    )


def _time(work: Callable[[], object]) -> float:
    taken: list[float] = []
    while len(taken) < 3 and sum(taken) < SHORT:
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return min(taken)


def motors() -> Iterator[Measured]:
    """All sets of parameters of the motor."""
    for folder in ("dc_motor", "dc_motor_current"):
        network = example(folder)
        for size in range(1, len(network.suspects) + 1):
            for names in combinations(network.suspects, size):
                yield measure(folder, network, names)


def ladders() -> Iterator[Measured]:
    """One parameter in the middle and two at the ends of ladders."""
    for sensors in SENSORS:
        for sections in SECTIONS:
            network = ladder(sections, sensors)
            for names in ((f"C{(sections + 1) // 2}",), ("R1", f"C{sections}")):
                yield measure(f"{sections} sections, {sensors}", network, names)


HEADER = (
    "plant",
    "parameters",
    "equations",
    "frames",
    "samples",
    "largest block",
    "matching",
    "fewest",
    "integer programming",
    "search",
    "states expanded",
    "search takes",
)


def _cells(row: Measured) -> tuple[str, ...]:
    counts = (row.equations, row.frames, row.observations, row.largest_block)
    given_up = row.searched is None
    return (
        row.plant,
        ", ".join(row.parameters),
        *(str(count) for count in counts),
        _milli(row.matching),
        str(row.fewest),
        _milli(row.integer),
        "given up" if given_up else str(row.searched),
        f"> {row.expanded}" if given_up else str(row.expanded),
        "" if given_up else _milli(row.search),
    )


def _milli(seconds: float) -> str:
    return f"{1e3 * seconds:.1f} ms"


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    parser = argparse.ArgumentParser(description="How long routes take.")
    parser.add_argument("--json", metavar="FILE", type=Path, help="write all numbers to FILE, in seconds")
    parser.add_argument("--markdown", metavar="FILE", type=Path, help="put the table into the page FILE")
    chosen = parser.parse_args(argv)
    rows = [*motors(), *ladders()]
    cells = [_cells(row) for row in rows]
    print(as_text(HEADER, cells))
    note = f"{today()}; {machine()}"
    print(f"\n{note}")
    if chosen.json is not None:
        report = {"note": note, "routes": [asdict(row) for row in rows]}
        chosen.json.write_text(json.dumps(report, indent=1) + "\n", encoding="utf-8")
    if chosen.markdown is not None:
        write_part(
            chosen.markdown, "routes", f"`python -m benchmarks.speed.routes`\n\n{note}.\n\n{as_markdown(HEADER, cells)}"
        )


if __name__ == "__main__":
    main()
