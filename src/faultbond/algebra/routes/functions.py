"""The functions that fault analysis needs of a plant, each with its route, its noise gain and its closed form.

Source: thesis 4.2 (which functions), 4.3 (why they are worked out beforehand), 4.4 (how).
"""

from contextlib import suppress
from dataclasses import dataclass, replace
from enum import Enum
from pathlib import Path

from faultbond.algebra.route import Question, Route
from faultbond.algebra.routes import questions
from faultbond.algebra.routes.fewest import fewest_components
from faultbond.algebra.routes.matched import alternatives, find_route
from faultbond.algebra.routes.unroll import open_targets
from faultbond.algebra.solving.backward_euler import FrameRecord, NumericPlant
from faultbond.algebra.solving.noise import NoiseGain, noise_gain, nominal_record
from faultbond.algebra.solving.solution import Solution
from faultbond.algebra.solving.solve import SolvingLimits, solve_cached
from faultbond.equations.component_network import ComponentNetwork, frame_name
from faultbond.errors import StructureError

MOST_ALTERNATIVES = 12  # routes among which the least noisy is looked for
SPARE_FRAMES = 8


class Preference(Enum):
    """Which of several routes is taken."""

    FRAMES = "fewest frames"
    COMPONENTS = "fewest components"
    NOISE = "least noise"


@dataclass(frozen=True, slots=True, kw_only=True)
class Function:
    """An answered question.

    gain : None where the nominal plant cannot be simulated
    solution : None where it was not asked for
    refusal : why there is no route; empty where there is one
    """

    question: Question
    route: Route | None = None
    gain: NoiseGain | None = None
    solution: Solution | None = None
    refusal: str = ""


def asked(network: ComponentNetwork, largest: int) -> tuple[Question, ...]:
    """Give the questions whose answers are not simply measured, with parameters of sets up to a size.

    Of the rate of a state this is the state one sample before; the difference from the state now is the rate.
    """
    every = questions.all_questions(network, largest)
    return tuple(replace(question, targets=targets) for question in every if (targets := open_targets(question)))


def choose_route(
    network: ComponentNetwork,
    question: Question,
    preference: Preference,
    plant: NumericPlant,
    record: FrameRecord | None,
) -> Route:
    """Give the route that is preferred; of a causal question the one along causality, whatever is preferred.

    Raises
    ------
    StructureError
        Where there is none; names what stays undetermined.
    """
    if question.causal:
        return find_route(network, question)
    if preference is Preference.COMPONENTS:
        return fewest_components(network, question)
    if preference is Preference.NOISE and record is not None:
        routes = alternatives(network, question, MOST_ALTERNATIVES)  # of equal ones the shorter is better
        return min(routes, key=lambda route: (noise_gain(network, route, plant, record).worst, len(route.steps)))
    return find_route(network, question)


def answer(
    network: ComponentNetwork,
    question: Question,
    plant: NumericPlant,
    record: FrameRecord | None,
    *,
    preference: Preference = Preference.FRAMES,
    cache: Path | None = None,
    limits: SolvingLimits | None = None,
) -> Function:
    """Answer one question; with a `cache` folder for solutions, also in closed form where there is one.

    The record is of the nominal plant, long enough for the route; None where that cannot be simulated.
    """
    try:
        route = choose_route(network, question, preference, plant, record)
    except StructureError as error:
        return Function(question=question, refusal=str(error))
    gain = None
    if record is not None:
        with suppress(StructureError):
            gain = noise_gain(network, route, plant, record)
    return Function(
        question=question,
        route=route,
        gain=gain,
        solution=solve_cached(network, route, plant, cache, limits) if cache is not None else None,
    )


def trial_record(network: ComponentNetwork, plant: NumericPlant, largest: int) -> FrameRecord | None:
    """Give a record of the nominal plant that is long enough for every route to sets of that size, if there is one."""
    frames = SPARE_FRAMES + len(network.states) + len(network.parameters[:largest])
    try:
        return nominal_record(network, plant, frames)
    except StructureError:
        return None


def equations_passed(network: ComponentNetwork, route: Route) -> tuple[str, ...]:
    """Give the parts of the plant passed through with their frames, `R_0`, in the order of the route; no sensors."""
    parts = {item.name for item in network.equations if item.weight}
    return tuple(frame_name((step.equation, step.frame)) for step in route.steps if step.equation in parts)


def components_passed(network: ComponentNetwork, route: Route) -> tuple[str, ...]:
    """Give the components and junctions passed through, each once."""
    owners = {item.name: item.owner for item in network.equations if item.weight}
    return tuple(dict.fromkeys(owners[step.equation] for step in route.steps if step.equation in owners))
