"""Parameters that go with a signal, as laws do not say: which, with what, by about which power."""

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.constraint_network import build_network
from faultbond.equations.step import StepModel
from faultbond.fit.bend import bend_by
from faultbond.fit.imperfections import TEMPERATURE, Imperfection, Kind, assignments
from faultbond.model.expression import Binary, Name, names, walk
from faultbond.model.graph import Check, Component
from faultbond.types import CheckKind, ElementType

SHARES = (0.02, 0.06, 0.2)  # by which the parameter changes (sd), for the powers that are tried
MOST = 60  # curves that are tried at once; a parameter and what it may go with
FOREIGN = 1.25  # times what the best gains over what its laws speak of
BENDABLE = (ElementType.R, ElementType.SE, ElementType.SF, ElementType.BLOCK)
DIFFERENCE = 3  # signals of a sum of which one is the difference of the others


@dataclass(frozen=True, slots=True, kw_only=True)
class Bendable:
    """A parameter that may go with something.

    acts_on : signals that its laws relate, and sensors that show it
    spoken : signals and inputs that stand in the laws; near : efforts and flows of stores at their ports
    others : further inputs
    """

    parameter: str
    acts_on: frozenset[str]
    spoken: tuple[str, ...]
    near: tuple[str, ...]
    others: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """A law by its canonical signals and inputs, those that it is solved for, and stores at its ports."""

    parameters: frozenset[str]
    named: tuple[str, ...]
    given: frozenset[str]
    near: tuple[str, ...]
    bends: bool


def bendable_parameters(model: StepModel) -> tuple[Bendable, ...]:
    """Give the parameters that may go with something: not those of stores, or of laws that keep power.

    None goes with what its law gives, or that would have to be solved anew; where a law is part of a loop, with inputs
    alone.
    """
    graph, laws = model.plant.graph, _laws(model)
    inputs = tuple(item.name for item in graph.inputs)
    found = []
    for item in graph.parameters:
        own = [law for law in laws if item.name in law.parameters]
        if not own or not all(law.bends for law in own):
            continue
        given = frozenset[str]().union(*(law.given for law in own))
        within = all(law.given for law in own)
        shown = [known for known in graph.sensors if item.name in names(known.reads)]
        named = [name for law in own for name in law.named] + [name for known in shown for name in names(known.reads)]
        spoken = [name for name in dict.fromkeys(named) if name in inputs or (within and name in _signals(own) - given)]
        near = [name for law in own for name in law.near if within and name not in (*spoken, *given)]
        found.append(
            Bendable(
                parameter=item.name,
                acts_on=_signals(own) | {known.name for known in shown},
                spoken=tuple(spoken),
                near=tuple(dict.fromkeys(near)),
                others=tuple(name for name in inputs if name not in spoken),
            )
        )
    return tuple(found)


def _signals(laws: Iterable[_Law]) -> frozenset[str]:
    return frozenset(name for law in laws for name in law.named)


def _laws(model: StepModel) -> list[_Law]:
    graph, network = model.plant.graph, model.plant.network
    solved = {(item.owner, item.signal) for item in assignments(model.plant.steps)}
    parameters = {item.name for item in graph.parameters}
    numbers = parameters | {item.name for item in graph.constants} | {item.name for item in network.states}
    found = []
    for part in graph.components:
        residuals = [item.residual for item in network.constraints if item.owner == part.name]
        for law, residual in zip(part.laws, residuals, strict=True):
            known = names(residual)
            named = tuple(name for name in known if name not in numbers)
            powers = {
                name
                for one in walk(residual)
                if isinstance(one, Binary) and one.operator == "**"
                for name in names(one.right)
            }
            given = frozenset(name for name in named if (part.name, name) in solved)
            degrees = any(graph.signal_unit(name).text == TEMPERATURE for name in names(law.left))
            bends = part.type in BENDABLE and not law.store and not degrees  # a part of degrees depends on their zero
            found.append(
                _Law(
                    parameters=frozenset(parameters & set(known) - powers),
                    named=named,
                    given=given,
                    near=_near(model, part),
                    bends=bends,
                )
            )
    return found


def _near(model: StepModel, part: Component) -> tuple[str, ...]:
    """Give the efforts and flows of stores that act at the ports of an element, or whose difference does."""
    graph, network = model.plant.graph, model.plant.network
    ports = [f"{part.name}.{signal}" for signal in "ef"] if part.type in BENDABLE[:-1] else []
    checks = tuple(Check(name=name, kind=CheckKind.SIGNAL, reads=Name(name)) for name in ports)
    at_ports = build_network(replace(graph, checks=checks), model.plant.causality).by_hand
    signals = {name for item in at_ports for name in names(item)}
    junctions = {item.name for item in graph.junctions} if part.type is ElementType.R else set()
    sums = [set(names(item.residual)) for item in network.constraints if item.owner in junctions]
    near = signals.union(*(item for item in sums if item & signals and len(item) <= DIFFERENCE))
    partners = (store.partner for store in network.states if store.partner is not None)
    return tuple(name for name in partners if name in near)


def signals_to_go_with(model: StepModel) -> tuple[str, ...]:
    """Give the signals with which parameters may go, inputs apart, each once."""
    inputs = {item.name for item in model.plant.graph.inputs}
    found = (name for item in bendable_parameters(model) for name in (*item.spoken, *item.near))
    return tuple(name for name in dict.fromkeys(found) if name not in inputs)


def possible_curves(
    model: StepModel, courses: Mapping[str, FloatArray], known_off: Collection[str]
) -> tuple[Imperfection, ...]:
    """Give the curves that a plant may have, each with the power by which its parameter changes by a hundredth (sd).

    Of a large plant not all; over inputs of which the laws do not speak only where these are known to be off.

    Parameters
    ----------
    model : the plant
    courses : of signals and inputs at many moments, SI, (n,) each
    known_off : signals and sensors of which it is known that they are off
    """
    items = bendable_parameters(model)
    pairs = [(item, name) for item in items for name in item.spoken]
    pairs += [(item, name) for item in items for name in item.near]
    pairs += [(item, name) for item in items if item.acts_on & set(known_off) for name in item.others]
    found = (_curve(item, by, courses.get(by, np.zeros(0))) for item, by in pairs)
    return tuple(item for item in found if item is not None)[:MOST]


def _curve(item: Bendable, by: str, course: FloatArray) -> Imperfection | None:
    bend = bend_by(by, course, own=by in item.spoken)
    if bend is None:
        return None
    size = 0.01 / float(np.std(bend.logarithm(course)))
    return Imperfection(kind=Kind.CURVE, place=item.parameter, bend=bend, size=size)


def likeliest_curves(model: StepModel, asked: Iterable[tuple[Imperfection, float]]) -> list[tuple[Imperfection, float]]:
    """Give each curve with the power that gains most, and that gain; the likeliest first.

    Over what its laws do not speak of one has to gain FOREIGN times as much as the best of the parameter over what they
    do.

    asked : curves and what they would gain, nats
    """
    spoken = {(item.parameter, name) for item in bendable_parameters(model) for name in item.spoken}
    order = sorted(asked, key=lambda item: item[1])
    best = sorted({item.key: (item, gain) for item, gain in order}.values(), key=lambda item: item[1])
    own = {item.place: gain for item, gain in best if (item.place, item.by) in spoken}  # the last is the largest
    worthy = [
        (item, gain)
        for item, gain in best
        if (item.place, item.by) in spoken or gain > FOREIGN * max(own.get(item.place, 0.0), 0.0)
    ]
    return sorted(worthy, key=lambda item: item[1], reverse=True)


def powers_of(curve: Imperfection) -> tuple[Imperfection, ...]:
    """Give a curve with the powers that are tried."""
    return tuple(replace(curve, size=sign * 100.0 * part * curve.size) for part in SHARES for sign in (-1.0, 1.0))
