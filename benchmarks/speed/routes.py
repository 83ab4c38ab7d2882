"""How long routes take: the thesis' search beside matching and integer programming.

    python -m benchmarks.speed.routes [--markdown FILE]

On the motor all sets of parameters; on ladders, where the search explodes unless there are sensors everywhere, one
parameter in the middle and two at the ends. Processor time, the best of three where it is short.
"""

import time
from collections.abc import Callable, Iterator, Sequence
from itertools import combinations

from benchmarks.shared.ladders import example, ladder
from benchmarks.shared.page import arguments, note, publish
from faultbond.algebra.routes.fewest import fewest_components
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.equations.component_network import ComponentNetwork
from faultbond.thesis.search import Ending, search_route

SECTIONS = (2, 3, 4, 5, 6, 8, 10, 12)
SENSORS = ("ends", "ends+i", "all")
STATES = 20_000  # at which the search is given up here
SHORT = 0.1  # s; what is shorter is measured three times
HEADER = "plant | parameters | equations | frames | samples | largest block | matching | fewest | integer programming"
HEADER += " | search | states expanded | search takes"


def measure(plant: str, network: ComponentNetwork, names: tuple[str, ...]) -> tuple[str, ...]:
    """Answer one question by the three methods, and time them."""
    question = parameters(network, names)
    route = find_route(network, question)
    search = search_route(network, question, limit=STATES)
    by_search = ("given up", f"> {search.expanded}", "")
    if search.route is not None:
        again = search.ending is not Ending.LIMIT
        taken = _time(lambda: search_route(network, question, limit=STATES)) if again else "nan ms"
        by_search = (str(len(search.route.steps)), str(search.expanded), taken)
    return (
        *(plant, ", ".join(names), str(len(route.steps)), str(route.frames), str(route.observations)),
        *(str(route.largest_block), _time(lambda: find_route(network, question))),
        str(len(fewest_components(network, question).steps)),
        _time(lambda: fewest_components(network, question)),
        *by_search,
    )


def _time(work: Callable[[], object]) -> str:
    taken: list[float] = []
    while len(taken) < 3 and sum(taken) < SHORT:
        begin = time.process_time()
        work()
        taken.append(time.process_time() - begin)
    return f"{1e3 * min(taken):.1f} ms"


def rows() -> Iterator[tuple[str, ...]]:
    """Give the lines: all sets of parameters of the motor, and questions about ladders."""
    for folder in ("dc_motor", "dc_motor_current"):
        network = example(folder)
        for size in range(1, len(network.suspects) + 1):
            for names in combinations(network.suspects, size):
                yield measure(folder, network, names)
    for sensors in SENSORS:
        for sections in SECTIONS:
            network = ladder(sections, sensors)
            for names in ((f"C{(sections + 1) // 2}",), ("R1", f"C{sections}")):
                yield measure(f"{sections} sections, {sensors}", network, names)


def main(argv: Sequence[str] | None = None) -> None:
    """Measure, print, write."""
    publish("speed.routes", arguments("How long routes take.", argv), note(), (HEADER.split(" | "), list(rows())))


if __name__ == "__main__":
    main()
