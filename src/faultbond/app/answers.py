"""The functions of a plant that `analyse` answers, within a time: routes always, closed forms as long as it lasts."""

from dataclasses import dataclass
from math import comb

from faultbond.algebra.route import Question
from faultbond.algebra.routes.functions import Function, Preference, answer, asked, trial_record
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solve import SolvingLimits
from faultbond.analysis.comparison import Allowance
from faultbond.app.wishes import Wishes
from faultbond.equations.component_network import ComponentNetwork
from faultbond.errors import StructureError
from faultbond.io.cache import cache_folder
from faultbond.model.graph import BondGraph

MOST_SETS = 300  # of suspects that are given a route
MOST_EQUATIONS = 150  # of a plant that routes are looked for in: one alone of a larger one takes minutes
ROUTE_SECONDS = 8.0  # of processor time, for all routes together, beside that of the closed forms
PARTS_OF_PATIENCE = 4  # of the time for all closed forms that one may take


@dataclass(frozen=True, slots=True, kw_only=True)
class Answers:
    """The functions that were answered; how many closed forms, and how many whole answers, there was no time for."""

    found: tuple[Function, ...]
    forms_left_out: int
    routes_left_out: int


def answers(graph: BondGraph, network: ComponentNetwork, wishes: Wishes) -> Answers:
    """Answer every function of thesis 4.2; closed forms for sets of up to `wishes.closed` suspects.

    Closed forms of parameters are looked for first; when `wishes.patience` is over, the others and the noise of the
    routes that are left are left out. So are routes when their own time is over.

    Raises
    ------
    StructureError
        Where the plant is too large for routes.
    """
    most = MOST_EQUATIONS * wishes.budget
    if len(network.equations) > most:
        raise StructureError(
            f"{graph.file}: {graph.name} has {len(network.equations)} equations, and routes are looked for in up to "
            f"{most}; raise --budget to {-(-len(network.equations) // MOST_EQUATIONS)}"
        )
    plant = plant_of(graph)
    largest = _largest(len(network.suspects), max(graph.max_faults, wishes.closed))
    preference, folder = Preference(wishes.preference), cache_folder() / "closed_forms"
    patience = wishes.patience * wishes.budget
    limits = SolvingLimits(seconds=patience / PARTS_OF_PATIENCE)
    questions = asked(network, largest)
    record = trial_record(network, plant, largest)
    clock, patient = Allowance(seconds=ROUTE_SECONDS * wishes.budget + patience), Allowance(seconds=patience)
    found: dict[int, Function] = {}
    for k in sorted(range(len(questions)), key=lambda k: _turn(questions[k])):
        if clock.over():
            break
        timely = not patient.over()
        cache = folder if timely and is_wanted(questions[k], wishes) else None
        judged = record if timely or preference is Preference.NOISE else None
        found[k] = answer(network, questions[k], plant, judged, preference=preference, cache=cache, limits=limits)
    told = tuple(found[k] for k in sorted(found))
    wanted = (item for item in told if is_wanted(item.question, wishes))
    return Answers(
        found=told,
        forms_left_out=sum(item.route is not None and item.solution is None for item in wanted),
        routes_left_out=len(questions) - len(told),
    )


def _largest(n_suspects: int, wanted: int) -> int:
    """Give the size up to which there are few enough sets that each can have its route."""
    size, total = 1, n_suspects
    while size < min(wanted, n_suspects) and total + comb(n_suspects, size + 1) <= MOST_SETS:
        size += 1
        total += comb(n_suspects, size)
    return size


def is_wanted(question: Question, wishes: Wishes) -> bool:
    """Whether a closed form was asked for."""
    return wishes.closed > 0 and _size(question) <= wishes.closed


def _size(question: Question) -> int:
    """Number of parameters asked for."""
    return sum(isinstance(target, str) for target in question.targets)


def _turn(question: Question) -> tuple[bool, int]:
    """Order in which closed forms are looked for: small sets of parameters, then signals."""
    size = _size(question)
    return not size, size
