"""Parameters that go with a signal, as laws do not say: which, with what, by about which power."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.constraint_network import build_network
from faultbond.equations.step import StepModel
from faultbond.fit.bend import bend_by
from faultbond.fit.imperfections import TEMPERATURE, Imperfection, Kind, assignments, parameter_name, power_of
from faultbond.model.expression import (
    Binary,
    Call,
    Expression,
    Name,
    Number,
    exponents,
    factors,
    names,
    powers,
    rebuilt,
)
from faultbond.model.graph import BondGraph, Check, Component
from faultbond.model.parser import to_text
from faultbond.types import CheckKind, ElementType

MOST = 60  # curves that are tried at once; a parameter and what it may go with
FOREIGN = 1.25  # times what the best gains over what its laws speak of
BENDABLE = (ElementType.R, ElementType.SE, ElementType.SF, ElementType.BLOCK)
DIFFERENCE = 3  # signals of a sum of which one is the difference of the others


@dataclass(frozen=True, slots=True, kw_only=True)
class Bendable:
    """A parameter that may go with something.

    acts_on : signals that its laws relate, and sensors that show it
    spoken : what its laws raise to a power, and further signals and inputs in them
    near : efforts and flows of stores at their ports; others : further inputs, or what a sensor shows of them
    """

    parameter: str
    acts_on: frozenset[str]
    spoken: tuple[Expression, ...]
    near: tuple[Expression, ...]
    others: tuple[Expression, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Law:
    """A law by its canonical signals and inputs, those that it is solved for, and stores at its ports.

    bases : what it raises to a power, of more than a name; outside : signals and inputs that stand elsewhere
    left : what stands alone on its left; factors : by which the right is multiplied
    """

    parameters: frozenset[str]
    named: tuple[str, ...]
    given: frozenset[str]
    bases: tuple[Expression, ...]
    outside: tuple[str, ...]
    near: tuple[str, ...]
    bends: bool
    left: str
    factors: frozenset[str]


def bendable_parameters(model: StepModel) -> tuple[Bendable, ...]:
    """Give the parameters that may go with something: of laws, but of stores or those that keep power, and of sensors.

    What is 0 while healthy, as a leak, shows nothing of what it would go with. None goes with what its law gives, or
    that would have to be solved anew; where a law is part of a loop, with inputs alone. What a law raises to a power
    stands for all in it: a film that goes with a flow does so also where the flow is another than the pump's speed lets
    expect.
    """
    laws = _laws(model)
    found = []
    for item in model.plant.graph.parameters:
        own = [law for law in laws if item.name in law.parameters]
        if item.nominal != 0.0 and all(law.bends for law in own):
            found.append(_bendable(model.plant.graph, item.name, own))
    return tuple(item for item in found if item.acts_on)


def _bendable(graph: BondGraph, parameter: str, laws: Sequence[_Law]) -> Bendable:
    inputs, numbers = [item.name for item in graph.inputs], _numbers(graph)
    named = frozenset(name for law in laws for name in law.named)
    given = frozenset[str]().union(*(law.given for law in laws))
    is_ordered = all(law.given for law in laws)
    free = named - given if is_ordered else named & set(inputs)
    shown = [item for item in graph.sensors if parameter in names(item.reads)]
    spoken: list[Expression] = []
    for law in laws:
        bases = [one for one in law.bases if parameter not in names(one) and not set(names(one)) & (named - free)]
        named_by = law.outside if bases else law.named
        spoken += [*bases, *(one for name in named_by if name in free for one in _spoken(law, name, parameter))]
    shown_by = [name for item in shown for name in names(item.reads) if name not in numbers]
    spoken += [Name(name) for name in shown_by if name in inputs or not laws]
    within = {name for one in spoken for name in names(one)}
    near = [name for law in laws for name in law.near if is_ordered and name not in given | within]
    others = [_shown_of(graph, name, parameter) for name in inputs if name not in within]
    return Bendable(
        parameter=parameter,
        acts_on=named | {item.name for item in shown},
        spoken=tuple(dict.fromkeys(spoken)),
        near=tuple(map(Name, dict.fromkeys(near))),
        others=tuple(dict.fromkeys(others)),
    )


def _spoken(law: _Law, name: str, parameter: str) -> tuple[Expression, ...]:
    """Give what a parameter may go with, of a signal of its law.

    Where the law is `e = K*f*abs(f)`, e/K stands for the flow, so that a change of K is found as large as it is: over e
    itself e/K**(1 - n) would go with the flow. What stands alone on the left of another law stands for nothing in it.
    """
    if name != law.left:
        return (Name(name),)
    return (Binary("/", Name(name), Name(parameter)),) if parameter in law.factors else ()


def _shown_of(graph: BondGraph, name: str, parameter: str) -> Expression:
    """Give what a sensor shows of an input, as the flow of a pump of its speed, where one does; else the input."""
    parameters = {item.name for item in graph.parameters}
    known = _numbers(graph) | {item.name for item in graph.inputs}
    for item in graph.sensors:
        read = set(names(item.reads))
        if name in read and read & parameters and read <= known - {parameter}:
            return item.reads
    return Name(name)


def _numbers(graph: BondGraph) -> set[str]:
    """Give the names that stand for numbers."""
    return {item.name for item in graph.parameters} | {item.name for item in graph.constants}


def _laws(model: StepModel) -> list[_Law]:
    graph, network = model.plant.graph, model.plant.network
    acting = {f"{item.name}.lagged": Name(item.name) for item in graph.inputs if item.lag}

    def stated(one: Expression) -> Expression:  # an input that lags is called as the laws call it
        return acting.get(one.text, one) if isinstance(one, Name) else one

    solved = {(item.owner, item.signal) for item in assignments(model.plant.steps)}
    parameters, numbers = {item.name for item in graph.parameters}, _numbers(graph)
    found = []
    for part in graph.components:
        residuals = [rebuilt(item.residual, stated) for item in network.constraints if item.owner == part.name]
        for law, residual in zip(part.laws, residuals, strict=True):
            raised = dict(powers(residual))
            bases = [one for one in raised if _is_base(one) and set(names(one)) - numbers]
            named = tuple(name for name in names(residual) if name not in numbers)
            alone = residual.left if isinstance(residual, Binary) and residual.operator == "-" else residual
            degrees = any(graph.signal_unit(name).text == TEMPERATURE for name in names(law.left))
            found.append(
                _Law(
                    parameters=frozenset(parameters & set(names(residual)) - exponents(residual)),
                    named=named,
                    given=frozenset(name for name in named if (part.name, name) in solved),
                    bases=tuple(bases),
                    outside=tuple(name for name in names(_without(residual, bases)) if name in named),
                    near=_near(model, part),
                    bends=part.type in BENDABLE and not law.store and not degrees,  # a part of degrees is nothing
                    left=alone.text if isinstance(law.left, Name) and isinstance(alone, Name) else "",
                    factors=factors(law.right),
                )
            )
    return found


def _is_base(one: Expression) -> bool:
    """Whether what is raised to a power stands for all in it; a bow that an earlier fit has written has a logarithm."""
    return not isinstance(one, Name) and not (isinstance(one, Call) and one.function == "log")


def _without(expression: Expression, parts: Collection[Expression]) -> Expression:
    return rebuilt(expression, lambda one: Number(1.0) if one in parts else one)


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


def movers_of(model: StepModel) -> dict[str, Expression]:
    """Give all with which parameters may go, by its text."""
    found = (one for item in bendable_parameters(model) for one in (*item.spoken, *item.near, *item.others))
    return {to_text(one): one for one in found}


def possible_curves(
    model: StepModel, courses: Mapping[str, FloatArray], known_off: Collection[str]
) -> tuple[Imperfection, ...]:
    """Give the curves that a plant may have, each with a power of 0.

    Of a large plant not all; over inputs of which the laws do not speak only where these are known to be off. Bows over
    what they do speak of come last.

    Parameters
    ----------
    model : the plant
    courses : of what parameters may go with, by its text, at many moments, SI, (n,) each
    known_off : signals and sensors of which it is known that they are off
    """
    items = bendable_parameters(model)
    pairs = [(item, one) for item in items for one in item.spoken]
    pairs += [(item, one) for item in items for one in item.near]
    pairs += [(item, one) for item in items if item.acts_on & set(known_off) for one in item.others]
    numbers = _numbers(model.plant.graph)
    asked = [(*pair, False) for pair in pairs]
    asked += [(item, one, True) for item in items for one in item.spoken if item.parameter not in names(one)]
    made = (_curve(item, one, courses.get(to_text(one), np.zeros(0)), numbers, bowed) for item, one, bowed in asked)
    found: dict[str, Imperfection] = {}  # by the name of the power; the first is that which a law raises to one
    for curve in made:
        if curve is not None:
            found.setdefault(parameter_name(curve), curve)
    apart = {name for name, item in found.items() if item.kind is Kind.BOW and not _has_power(item, found)}
    return tuple(item for name, item in found.items() if name not in apart)[:MOST]


def _has_power(bow: Imperfection, found: Mapping[str, Imperfection]) -> bool:
    """Tell whether the power over the same, beside which a bow is fitted, is among what was found, by its name."""
    power = power_of(bow)
    name = parameter_name(power)
    return name in found and found[name].key == power.key


def _curve(
    item: Bendable, by: Expression, course: FloatArray, numbers: Collection[str], bowed: bool
) -> Imperfection | None:
    name = "_".join(name for name in names(by) if name not in numbers)
    is_own = by in item.spoken
    bend = bend_by(by, name, course, own=is_own, bowed=bowed)
    if bend is None:
        return None
    kind = Kind.BOW if bowed else Kind.CURVE
    return Imperfection(kind=kind, place=item.parameter, bend=bend, size=0.0, foreign=not is_own)


def likeliest_curves(asked: Iterable[tuple[Imperfection, float]]) -> list[tuple[Imperfection, float]]:
    """Give curves and what they would gain, the likeliest first.

    Over what its laws do not speak of one has to gain FOREIGN times as much as the best of the parameter over what they
    do.

    asked : curves and what they would gain, nats
    """
    order = sorted(asked, key=lambda item: item[1])
    own = {item.place: gain for item, gain in order if not item.foreign}  # the last is the largest
    worthy = [(item, gain) for item, gain in order if not item.foreign or gain > FOREIGN * own.get(item.place, 0.0)]
    return worthy[::-1]
