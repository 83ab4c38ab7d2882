"""The functions of a plant that `analyse` answers, within a time: routes always, closed forms as long as it lasts."""

from collections.abc import Sequence
from math import comb
from time import monotonic

from faultbond.algebra.route import Question
from faultbond.algebra.routes.functions import Function, Preference, answer, asked, trial_record
from faultbond.algebra.solving.backward_euler import plant_of
from faultbond.algebra.solving.solve import SolvingLimits
from faultbond.app.wishes import Wishes
from faultbond.equations.component_network import ComponentNetwork
from faultbond.io.cache import cache_folder
from faultbond.model.graph import BondGraph

MOST_SETS = 300  # of suspects that are given a route
PARTS_OF_PATIENCE = 4  # of the time for all closed forms that one may take


def answers(graph: BondGraph, network: ComponentNetwork, wishes: Wishes) -> tuple[Function, ...]:
    """Answer every function of thesis 4.2; closed forms for sets of up to `wishes.closed` suspects.

    Closed forms of parameters are looked for first; when `wishes.patience` is over, the others and the noise of the
    routes that are left are left out.
    """
    plant = plant_of(graph)
    largest = _largest(len(network.suspects), max(graph.max_faults, wishes.closed))
    record = trial_record(network, plant, largest)
    preference, folder = Preference(wishes.preference), cache_folder() / "closed_forms"
    limits = SolvingLimits(seconds=wishes.patience / PARTS_OF_PATIENCE)
    end = monotonic() + wishes.patience
    questions = asked(network, largest)
    found: dict[int, Function] = {}
    for k in sorted(range(len(questions)), key=lambda k: _turn(questions[k])):
        timely = monotonic() < end
        cache = folder if timely and is_wanted(questions[k], wishes) else None
        judged = record if timely or preference is Preference.NOISE else None
        found[k] = answer(network, questions[k], plant, judged, preference=preference, cache=cache, limits=limits)
    return tuple(found[k] for k in range(len(questions)))


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


def left_out(found: Sequence[Function], wishes: Wishes) -> int:
    """Give the number of closed forms that were asked for and that there was no time for."""
    asked_for = (item for item in found if is_wanted(item.question, wishes))
    return sum(item.route is not None and item.solution is None for item in asked_for)


def _size(question: Question) -> int:
    """Number of parameters asked for."""
    return sum(isinstance(target, str) for target in question.targets)


def _turn(question: Question) -> tuple[bool, int]:
    """Order in which closed forms are looked for: small sets of parameters, then signals."""
    size = _size(question)
    return not size, size
