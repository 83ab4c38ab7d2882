"""From a bond graph to what method `classic` needs on-line: the thesis' off-line part (4.5.1)."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

from faultbond import sets
from faultbond.algebra.solving.backward_euler import NumericPlant, plant_of
from faultbond.contract.spec import EngineSpec
from faultbond.equations.component_network import SAMPLE_TIME, ComponentNetwork, build_components, frame_name
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import StructureError
from faultbond.model.expression import names
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
from faultbond.thesis.offline.sides import MISFIT, Side, independent_relations, side_of
from faultbond.thesis.offline.tape_writer import compile_batch, compile_torn
from faultbond.thesis.online.plan import ClassicPlan, Programs, Sides
from faultbond.thesis.online.settings import Erratum, Settings
from faultbond.types import TimeGrid


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
    if graph.unknown_inputs:
        name = graph.unknown_inputs[0].name
        raise StructureError(f"{graph.file}: method `classic` knows no unknown input, and {name} is one; use `bank`")
    plant = build_plant(graph)
    spec = build_spec(build_step_model(plant))
    largest = len(spec.parameters) if settings.largest is None else settings.largest
    spec = replace(spec, hypotheses=tuple(item for item in spec.hypotheses if len(item) <= largest))
    tested = largest_sets(spec.hypotheses)
    network, numbers = build_components(graph, plant.network), plant_of(graph)
    states = state_signals(network)

    # The functions: states from several samples, states and outputs from one and the states before, sides of laws.
    inputs_only = Erratum.INPUTS in settings.printed
    asked = from_samples(network)
    samples = [None if item is None else answer_closed(network, *item, numbers) for item in asked]
    hidden = [network.outputs if inputs_only else read_by(network, item) for item in asked]
    asked_before = (from_before(network, *item) for item in zip(states, hidden, strict=True))
    before = [answer_closed(network, *item, numbers) for item in asked_before]
    asked_outputs = (expected(network, output, inputs_only=inputs_only) for output in network.outputs)
    outputs = [answer_closed(network, *item, numbers) for item in asked_outputs]
    sides = [side for relation in independent_relations(network) for side in _sides(network, relation, numbers)]

    routes = [item.route for item in samples if item is not None and item.route is not None]
    depth = max((route.observations for route in routes), default=1) + 1  # frames of samples that a function needs
    answers = [item for item in (*samples, *before, *outputs) if item is not None]
    guessed = [name for item in answers if item.torn is not None for name in item.torn.guessed]
    places = _places(network, depth, guessed)
    rates = {state.signal: state.rate for state in network.states}
    sums = {state.sum for state in network.states}
    passed = [set() if item.route is None else {step.equation for step in item.route.steps} for item in outputs]
    described = [_described(network, spec, side) for side in sides]
    nothing = "not from samples: too many of them would be needed"
    formulas = [
        *((f"state {state}", item.formula if item else nothing) for state, item in zip(states, samples, strict=True)),
        *((item.question.title, item.formula) for item in (*before, *outputs)),
        *((f"law of {side.equation}", side.formula) for side in sides),
    ]
    return spec, ClassicPlan(
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
        from_samples=_compiled(samples, places),
        from_before=_compiled(before, places),
        expected=_compiled(outputs, places),
        misfits=compile_batch([(side.roots, MISFIT) for side in sides], places),
        algebraic=tuple(sums.isdisjoint(item) for item in passed),
        sides=tuple(described),
        uses=tuple(_uses(sides, described, spec, chosen) for chosen in tested),
        tested=tested,
        hypotheses=spec.hypotheses,
        formulas=tuple(formulas),
    )


def largest_sets(hypotheses: Iterable[Sequence[int]]) -> tuple[tuple[int, ...], ...]:
    """Give the sets that no other contains: those that are tested; about the rest is reasoned (thesis 6.4.2, 6.5)."""
    return tuple(tuple(sorted(item)) for item in sets.largest(hypotheses))


def _sides(network: ComponentNetwork, relation: frozenset[str], numbers: NumericPlant) -> tuple[Side, ...]:
    """Give the laws of a relation that may be left over, one for each suspect in it."""
    found: dict[str, Side] = {}
    refusal = None
    for name in network.suspects:
        if any(name in network.equation(equation).parameters for equation in relation):
            try:
                side = side_of(network, relation, name, numbers)
            except StructureError as error:
                refusal = error
                continue
            found.setdefault(side.equation, side)
    if refusal is not None and not found:
        raise refusal
    return tuple(found.values())


def _compiled(functions: Sequence[Closed | None], places: Mapping[str, int]) -> Programs:
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


def _places(network: ComponentNetwork, depth: int, guessed: Sequence[str]) -> dict[str, int]:
    """Number what functions may be given: the sample time, parameters, samples by frame, states, rates, guesses."""
    samples = [frame_name((name, frame)) for name in (*network.inputs, *network.outputs) for frame in range(depth)]
    given = [frame_name((name, frame)) for name in state_signals(network) for frame in (0, 1)]
    rates = [frame_name((state.rate, 0)) for state in network.states]
    every = dict.fromkeys((SAMPLE_TIME, *network.parameters, *samples, *given, *rates, *guessed))
    return {name: k for k, name in enumerate(every)}


def _accuracy(graph: BondGraph) -> float:
    """Give the index n: 1 less the relative accuracy of the parameters, of the middle one where they differ."""
    relative = sorted(item.accuracy / abs(item.nominal) for item in graph.parameters if item.nominal and item.suspect)
    middle = relative[len(relative) // 2] if relative else 0.0
    return max(0.0, 1.0 - middle)


def _described(network: ComponentNetwork, spec: EngineSpec, side: Side) -> Sides:
    """Give what the on-line part knows of a side: the parameters and inputs that it depends on, by index."""
    used = {name for root in side.roots for line in root.lines for name in names(line.value)}
    return Sides(
        equation=side.equation,
        parameters=frozenset(
            k for k, item in enumerate(spec.parameters) if item.name in used and item.name in network.parameters
        ),
        inputs=frozenset(
            k for k, item in enumerate(spec.inputs) if f"{item.name}_0" in used and item.name in network.inputs
        ),
        formula=side.formula,
    )


def _uses(
    sides: Sequence[Side], described: Sequence[Sides], spec: EngineSpec, chosen: Sequence[int]
) -> tuple[int, ...]:
    """Choose what a set is estimated from: in each relation that it touches, the law of its first member there."""
    own = [k for index in chosen for k, side in enumerate(sides) if spec.parameters[index].name in side.suspended]
    others = [k for k, item in enumerate(described) if item.parameters.intersection(chosen)]
    found: dict[frozenset[str], int] = {}
    for k in (*own, *others):
        found.setdefault(sides[k].relation, k)
    return tuple(sorted(found.values()))
