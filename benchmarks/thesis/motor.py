"""The thesis' motor for its tables: networks, records, and the letters that figures 4.4 and A.2 give to its signals."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from fractions import Fraction
from functools import cache
from itertools import combinations

from benchmarks.shared.ladders import components_of
from benchmarks.shared.plants import EXAMPLES
from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes.matched import find_route
from faultbond.algebra.routes.questions import parameters
from faultbond.algebra.solving.backward_euler import FrameRecord, NumericPlant, plant_of, simulate_frames
from faultbond.algebra.solving.solution import Solution
from faultbond.algebra.solving.solve import solve
from faultbond.equations.component_network import ComponentNetwork, Equation, frame_name
from faultbond.equations.inversion import substitute
from faultbond.equations.numeric import Real
from faultbond.model.expression import Expression, Name
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model

THESIS = EXAMPLES / "thesis"

NOMINAL = {"R": Fraction(3), "L": Fraction(5, 2), "J": Fraction(3, 2), "C": Fraction(2, 5), "K": Fraction(2)}
HALF = Fraction(1, 2)
VOLTS = (10, 4, 6, -2, 8)  # of the exact record, the oldest first
HYPOTHESES = tuple(names for size in (1, 2) for names in combinations("RLJCK", size))

FIGURE_4_4 = {  # the newest observation has index 1; l and e are changes in a step, not rates
    ("V", 0): "a",
    ("omega", 0): "b",
    ("C.e", 0): "c",
    ("omega", 1): "d",
    ("J.rate", 0): "e",
    ("J.e", 0): "f",
    ("K.e2", 0): "g",
    ("armature.f", 0): "h",
    ("R.e", 0): "i",
    ("K.e1", 0): "j",
    ("L.e", 0): "k",
    ("L.rate", 0): "l",
    ("armature.f", 1): "m",
}
FIGURE_A_2 = {  # the newest observation has index 0; l and e are rates
    "K.e1": "b",
    "R.e": "c",
    "L.e": "d",
    "L.rate": "e",
    "armature.f": "h",
    "K.e2": "i",
    "C.e": "j",
    "J.e": "k",
    "J.rate": "l",
}
PARTS = {  # names of figure A.2 for the equations
    "R": "R",
    "armature": "Ab",
    "K.1": "Kb",
    "L": "L",
    "L.sum": "Sb",
    "K.2": "Ka",
    "shaft": "Aa",
    "J": "J",
    "J.sum": "Sa",
    "C": "C",
}


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class System:
    """A model of examples/thesis: its component network and its numbers."""

    network: ComponentNetwork
    plant: NumericPlant

    def ask(self, question: Question) -> tuple[Route, Solution]:
        """Give the route that answers a question, and its closed form."""
        route = find_route(self.network, question)
        return route, solve(self.network, route, self.plant)

    def parameters(self, names: Sequence[str]) -> tuple[Route, Solution]:
        """Give the route to a set of parameters, and its closed form."""
        return self.ask(parameters(self.network, names))


@cache
def system(name: str) -> System:
    """Give one of the models."""
    graph = load_model(THESIS / f"{name}.yaml")
    return System(network=components_of(graph), plant=plant_of(graph))


def record_of(values: Mapping[str, Fraction], volts: Sequence[int] = VOLTS) -> FrameRecord:
    """Give the exact backward-Euler record of a motor at rest, two samples a second."""
    return simulate_frames(system("motor").network, values, {"V": tuple(map(Fraction, volts))}, HALF)


def samples(record: FrameRecord, back: int = 0, frames: int = 4) -> dict[str, Real]:
    """Give what is measured in the newest frames of a record, or of it some samples earlier."""
    end = len(record["omega"]) - 1 - back
    return {frame_name((name, k)): record[name][end - k] for name in ("V", "omega") for k in range(frames)}


def in_figure_4_4(expression: Expression) -> Expression:
    """Write an expression in the letters of figure 4.4."""
    letters: dict[str, Expression] = {}
    for signal, letter in FIGURE_4_4.items():
        letters[frame_name(signal)] = parse_expression(f"{letter}/dt") if letter in "el" else Name(letter)
    return substitute(expression, letters)


def signals_of(route: Route) -> str:
    """Give all signals that a route finds or uses, in the letters of figure 4.4."""
    found = [step.finds for step in route.steps if not isinstance(step.finds, str)]
    return ", ".join(sorted(FIGURE_4_4[signal] for signal in {*found, *route.samples, *route.known}))


def in_figure_a_2() -> ComponentNetwork:
    """Give the motor in the letters of figure A.2, with Ka and Kb two parameters as there."""
    network = system("motor").network
    return replace(
        network,
        equations=tuple(_renamed(item) for item in network.equations),
        signals=tuple(FIGURE_A_2.get(name, name) for name in network.signals),
        parameters=("Ka", "Kb", "R", "L", "J", "C"),
        suspects=("R", "L", "J", "C", "Ka", "Kb"),
    )


def _renamed(item: Equation) -> Equation:
    name = PARTS[item.name]
    return replace(
        item,
        name=name,
        signals=tuple((FIGURE_A_2.get(signal, signal), back) for signal, back in item.signals),
        parameters=tuple(name if parameter == "K" else parameter for parameter in item.parameters),
    )


def short(names: Iterable[str]) -> str:
    """Write names with their frames as figure A.2 does: `Sb0` for `Sb_0`."""
    return " ".join(name.replace("_", "") for name in names)
