"""From a bond graph to what method `classic` needs on-line: the thesis' off-line part (4.5.1)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

from faultbond import sets
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of
from faultbond.contract.spec import EngineSpec
from faultbond.equations.component_network import SAMPLE_TIME, ComponentNetwork, build_components, frame_name
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import StructureError
from faultbond.model.graph import BondGraph
from faultbond.synthesis.specify import build_spec
from faultbond.thesis.offline.functions import (
    Closed,
    answer_closed,
    expected,
    from_before,
    from_samples,
    read_by,
    state_signals,
)
from faultbond.thesis.offline.sides import MISFIT, RedundantSet, Side, reaching, relations, side_of
from faultbond.thesis.offline.tapes import compile_batch, compile_torn
from faultbond.thesis.online.plan import Batch, ClassicPlan, Sides
from faultbond.thesis.online.settings import Erratum, Settings
from faultbond.types import TimeGrid


@dataclass(frozen=True, slots=True, kw_only=True)
class _Functions:
    """All closed forms of a plant."""

    samples: tuple[Closed | None, ...]
    before: tuple[Closed, ...]
    outputs: tuple[Closed, ...]
    sides: tuple[Side, ...]


def build_classic(graph: BondGraph, settings: Settings | None = None) -> tuple[EngineSpec, ClassicPlan]:
    """Give the specification of a bond graph and the plan by which method `classic` watches it.

    Parameters
    ----------
    graph : the plant
    settings : default those that work

    Raises
    ------
    StructureError
        Where the plant has no time, or a function that the method needs has neither a closed form nor a few
        guesses that solve it.
    """
    settings = settings or Settings()
    if graph.grid is TimeGrid.NONE:
        raise StructureError(f"{graph.file}: method `classic` follows a plant in time, and {graph.name} has none")
    plant = build_plant(graph)
    spec = build_spec(build_step_model(plant))
    spec = replace(spec, hypotheses=_up_to(spec.hypotheses, settings.largest))
    network = build_components(graph, plant.network)
    numbers = plant_of(graph)
    tested = largest_sets(spec.hypotheses)
    functions = _functions(network, numbers, settings)
    return spec, _plan(graph, spec, network, functions, settings, tested)


def _up_to(hypotheses: Iterable[tuple[int, ...]], largest: int | None) -> tuple[tuple[int, ...], ...]:
    return tuple(item for item in hypotheses if largest is None or len(item) <= largest)


def largest_sets(hypotheses: Iterable[Sequence[int]]) -> tuple[tuple[int, ...], ...]:
    """Give the sets that no other contains: those that are tested; about the rest is reasoned (thesis 6.4.2, 6.5)."""
    return tuple(tuple(sorted(item)) for item in sets.largest(hypotheses))


def _functions(network: ComponentNetwork, numbers: NumericPlant, settings: Settings) -> _Functions:
    inputs_only = Erratum.INPUTS in settings.printed
    samples = from_samples(network)
    before = [
        from_before(network, state, network.outputs if inputs_only else read_by(network, found))
        for state, found in zip(state_signals(network), samples, strict=True)
    ]
    outputs = [expected(network, output, inputs_only=inputs_only) for output in network.outputs]
    return _Functions(
        samples=tuple(None if item is None else answer_closed(network, *item, numbers) for item in samples),
        before=tuple(answer_closed(network, *item, numbers) for item in before),
        outputs=tuple(answer_closed(network, *item, numbers) for item in outputs),
        sides=tuple(side for relation in relations(network) for side in _sides(network, relation, numbers)),
    )


def _sides(network: ComponentNetwork, relation: RedundantSet, numbers: NumericPlant) -> tuple[Side, ...]:
    """Give the laws of a relation that may be left over, one for each suspect in it."""
    found: dict[str, Side] = {}
    refusal = None
    for name in network.suspects:
        if any(name in network.equation(equation).parameters for equation in relation.equations):
            try:
                side = side_of(network, relation, name, numbers)
            except StructureError as error:
                refusal = error
                continue
            found.setdefault(side.equation, side)
    if refusal is not None and not found:
        raise refusal
    return tuple(found.values())


def _plan(
    graph: BondGraph,
    spec: EngineSpec,
    network: ComponentNetwork,
    functions: _Functions,
    settings: Settings,
    tested: tuple[tuple[int, ...], ...],
) -> ClassicPlan:
    states = state_signals(network)
    rates = {state.signal: state.rate for state in network.states}
    depth = _depth(functions)
    answers = [*functions.samples, *functions.before, *functions.outputs]
    guessed = [name for item in answers if item is not None and item.torn is not None for name in item.torn.guessed]
    places = _places(network, states, depth, guessed)
    sides = tuple(_described(network, spec, side) for side in functions.sides)
    return ClassicPlan(
        settings=settings,
        accuracy=_accuracy(graph) if settings.accuracy is None else settings.accuracy,
        names=tuple(places),
        parameter_places=tuple(places[item.name] for item in spec.parameters),
        sample_places=tuple(
            tuple(places[frame_name((name, frame))] for frame in range(depth))
            for name in (*network.inputs, *network.outputs)
        ),
        states=states,
        now=tuple(places[frame_name((name, 0))] for name in states),
        before=tuple(places[frame_name((name, 1))] for name in states),
        rates=tuple(-1 if rates[name] in states else places[frame_name((rates[name], 0))] for name in states),
        points=_points(spec, settings),
        from_samples=_compiled(functions.samples, places),
        from_before=_compiled(functions.before, places),
        expected=_compiled(functions.outputs, places),
        misfits=compile_batch([(side.roots, MISFIT) for side in functions.sides], places),
        algebraic=tuple(not _passes_a_store(network, item) for item in functions.outputs),
        sides=sides,
        uses=tuple(_uses(functions.sides, sides, spec, chosen) for chosen in tested),
        tested=tested,
        hypotheses=spec.hypotheses,
        formulas=_formulas(states, functions),
    )


def _compiled(functions: Sequence[Closed | None], places: Mapping[str, int]) -> Batch:
    closed = [None if item is None or item.torn else (item.roots, item.targets[0]) for item in functions]
    searches = [
        (compile_torn(item.torn, item.targets[0], places), (row,))
        for row, item in enumerate(functions)
        if item is not None and item.torn is not None
    ]
    return (*compile_batch(closed, places), *searches)


def _points(spec: EngineSpec, settings: Settings) -> tuple[int, ...]:
    """Give the length of the parabola of each input and output; inputs without declared noise are not filtered."""
    own = dict(settings.lengths)
    usual = 16 if Erratum.SIXTEEN in settings.printed and settings.length == 17 else settings.length
    inputs = (own.get(item.name, usual if item.noise > 0.0 else 1) for item in spec.inputs)
    return (*inputs, *(own.get(item.name, usual) for item in spec.outputs))


def _depth(functions: _Functions) -> int:
    """Give the number of frames of samples that a function needs, two at least."""
    routes = [item.route for item in functions.samples if item is not None and item.route is not None]
    return max((route.observations for route in routes), default=1) + 1


def _places(network: ComponentNetwork, states: Sequence[str], depth: int, guessed: Sequence[str]) -> dict[str, int]:
    """Number what functions may be given: the sample time, parameters, samples by frame, states, rates, guesses."""
    samples = [frame_name((name, frame)) for name in (*network.inputs, *network.outputs) for frame in range(depth)]
    given = [frame_name((name, frame)) for name in states for frame in (0, 1)]
    rates = [frame_name((state.rate, 0)) for state in network.states]
    names = dict.fromkeys((SAMPLE_TIME, *network.parameters, *samples, *given, *rates, *guessed))
    return {name: k for k, name in enumerate(names)}


def _accuracy(graph: BondGraph) -> float:
    """Give the index n: 1 less the relative accuracy of the parameters, of the middle one where they differ."""
    relative = sorted(item.accuracy / abs(item.nominal) for item in graph.parameters if item.nominal and item.suspect)
    middle = relative[len(relative) // 2] if relative else 0.0
    return max(0.0, 1.0 - middle)


def _passes_a_store(network: ComponentNetwork, closed: Closed) -> bool:
    sums = {state.sum for state in network.states}
    return closed.route is not None and any(step.equation in sums for step in closed.route.steps)


def _described(network: ComponentNetwork, spec: EngineSpec, side: Side) -> Sides:
    parameters, inputs = reaching(network, side)
    return Sides(
        equation=side.equation,
        parameters=frozenset(k for k, item in enumerate(spec.parameters) if item.name in parameters),
        inputs=frozenset(k for k, item in enumerate(spec.inputs) if item.name in inputs),
        formula=side.formula,
    )


def _uses(
    sides: Sequence[Side], described: Sequence[Sides], spec: EngineSpec, chosen: Sequence[int]
) -> tuple[int, ...]:
    """Choose what a set is estimated from: in each relation that it touches, the law of its first member there."""
    names = [spec.parameters[index].name for index in chosen]
    found: dict[frozenset[str], int] = {}
    for name in names:  # first choice: a law of its own
        for k, side in enumerate(sides):
            if name in side.suspended:
                found.setdefault(side.relation, k)
    for k, side in enumerate(sides):
        if described[k].parameters.intersection(chosen):
            found.setdefault(side.relation, k)
    return tuple(sorted(found.values()))


def _formulas(states: Sequence[str], functions: _Functions) -> tuple[tuple[str, str], ...]:
    nothing = "not from samples: too many of them would be needed"
    named = [
        (f"state {state}", nothing if item is None else item.formula)
        for state, item in zip(states, functions.samples, strict=True)
    ]
    named += [(item.question.title, item.formula) for item in (*functions.before, *functions.outputs)]
    return (*named, *((f"law of {side.equation}", side.formula) for side in functions.sides))
