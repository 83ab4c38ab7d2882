"""What a model may leave out, and can be added to it: slow errors, offsets, curves, wander, lags, noise of inputs.

A law says one thing and the plant does nearly the same; how nearly is the size of a slow error, and how long it stays
the same is its memory. A transient error is one that is there after an input has moved, the larger the farther it has.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from enum import Enum
from math import inf

import numpy as np

from faultbond.arrays import FloatArray
from faultbond.equations.sequence import Assignment, Step
from faultbond.equations.step import StepModel
from faultbond.fit.bend import Bend
from faultbond.fit.likelihood import Layout, felt_moves
from faultbond.model.expression import Binary, Expression, Name, exponents, rebuilt
from faultbond.model.graph import BondGraph, Component, Parameter, Relation, SlowError, Unit
from faultbond.model.parser import to_text
from faultbond.types import Hold

MOST_FOLLOWED = 60  # states, slow errors and noise of inputs of a filter in which all is tried at once
LEAST_PLACES = 6  # slow errors that are tried however large the plant is
LAG_ACCURACY, LAG_CHANGE = 0.1, 2.0  # parts of a lag, or of a highest rate, that was found
TERM_ACCURACY, TERM_CHANGE = 1.0, 2.0  # parts of an offset, or of the power of a curve, that was found
TEMPERATURE = "K"  # unit of what has no zero of its own
HIDDEN = 0.01  # of a sensor's noise: the size of an error that is there after moves of an input alone
UNTRIED = 1e-12  # size of what is only a possibility, in the unit of what it is an error of


class Kind(Enum):
    """What is added to a model; the value is the word in records."""

    RELATIVE = "relative slow error"
    ABSOLUTE = "slow error"
    WANDER = "wander"
    TRANSIENT = "transient error"
    INPUT_NOISE = "noise"
    LAG = "lag"
    ORDER = "order of lag"
    RATE_LIMIT = "rate limit"
    OFFSET = "offset"
    CURVE = "curve"
    BOW = "bow"
    HOLD = "linear hold"
    NEXT = "next hold"


KIND_HOLDS = {Kind.HOLD: Hold.LINEAR, Kind.NEXT: Hold.NEXT}
FORMS = (*KIND_HOLDS, Kind.ORDER)  # what is another form of something, and has no number that is fitted
LATE = (Kind.LAG, Kind.RATE_LIMIT, *FORMS)
CURVES = (Kind.CURVE, Kind.BOW)  # of a parameter
TERMS = (Kind.OFFSET, *CURVES)  # of laws


@dataclass(frozen=True, slots=True, kw_only=True)
class Imperfection:
    """Something that a model may leave out: of which kind, of what, how large, over which time (s).

    size : standard deviation, SI or in parts; of a lag its time constant, s, and of its order that; of a rate limit the
    highest rate, SI; of an offset that, SI; of a curve the power with which a parameter goes with a signal, of a bow
    that of the square of the logarithm; of a transient error how much larger it is for each unit by which an input
    moves; a hold has none
    memory : of what is slow; of a rate limit the time constant beside it, which comes with it where there was none
    law : of an offset the component that gives the signal, and which of its laws does
    bend : of a curve, what the parameter goes with
    after : of a transient error, the input
    order : of a lag, in how many stages it comes
    foreign : whether a curve goes with what the laws of its parameter do not speak of
    """

    kind: Kind
    place: str
    is_sensor: bool = False
    size: float = UNTRIED
    memory: float = 1.0
    law: tuple[str, int] = ("", 0)
    bend: Bend | None = None
    after: str = ""
    order: int = 1
    foreign: bool = False

    @property
    def by(self) -> str:
        """What a curve goes with; empty of all else."""
        return to_text(self.bend.by) if self.bend else ""

    @property
    def key(self) -> tuple[Kind, str]:
        """What it is without its size."""
        more = f" over {self.by}" if self.by else f" after {self.after}" if self.after else ""
        return self.kind, f"{self.place}{more}"

    @property
    def is_slow(self) -> bool:
        """Whether it has a memory."""
        return self.kind in (Kind.RELATIVE, Kind.ABSOLUTE, Kind.WANDER, Kind.TRANSIENT)

    @property
    def is_relative(self) -> bool:
        """Whether its size is a part of what it is of."""
        return self.kind in (Kind.RELATIVE, Kind.WANDER)

    @property
    def is_parameter(self) -> bool:
        """Whether it is a further parameter of the plant."""
        return self.kind in (Kind.LAG, Kind.RATE_LIMIT, *TERMS)

    @property
    def is_late(self) -> bool:
        """Whether by it something comes late, or is another between rows."""
        return self.kind in LATE

    @property
    def is_definite(self) -> bool:
        """Whether it says what happens, and not only how far something may be off."""
        return self.is_late or self.kind in CURVES

    def is_more_than(self, other: "Imperfection") -> bool:
        """Tell whether it is more than the other, of the same place, and does what that does.

        A lag in more stages, a rate limit, which has a lag, or a bow, which has a power.
        """
        if self.kind is Kind.BOW:
            return (other.kind, other.place, other.by) == (Kind.CURVE, self.place, self.by)
        if self.place != other.place or other.kind is not Kind.LAG:
            return False
        return self.kind is Kind.RATE_LIMIT or (self.kind is Kind.LAG and self.order > other.order)

    @property
    def words(self) -> str:
        """What it is, without its size."""
        kind, what = self.key
        stages = f" in {self.order} stages" if self.order > 1 else ""
        return f"{kind.value} of {what}{stages}"


def law_signals(model: StepModel) -> tuple[str, ...]:
    """Give the signals that laws of components without a store give, in the order of the network."""
    network, plant = model.plant.network, model.plant
    owners = {item.name for item in plant.graph.components if not item.type.is_store}
    given = {item.signal for item in assignments(plant.steps) if item.owner in owners}
    given -= {store.rate for store in network.states}
    return tuple(name for name in network.signals if name in given)


def laws_of_signals(model: StepModel) -> dict[str, tuple[str, int]]:
    """Give the signals that stand alone on the left of a law: the component, and which of its laws, from 0."""
    found = {}
    for part in model.plant.graph.components:
        own = (item.residual for item in model.plant.network.constraints if item.owner == part.name)
        for number, (law, residual) in enumerate(zip(part.laws, own, strict=True)):
            match law.left, residual:
                case Name(), Binary("-", Name(signal), _):
                    found[signal] = part.name, number
    return found


def signals_behind(model: StepModel) -> dict[str, str]:
    """Give the signals that a law gives which is written the other way round, with what stands on its left.

    Of `e = K*f*abs(f)` that may give the flow. Of a component with one law alone: which of several it is nobody keeps.
    """
    lefts: dict[str, list[str]] = {}
    for signal, (owner, _) in laws_of_signals(model).items():
        lefts.setdefault(owner, []).append(signal)
    one_law = {item.name for item in model.plant.graph.components if len(item.laws) == 1}
    return {
        item.signal: lefts[item.owner][0]
        for item in assignments(model.plant.steps)
        if item.owner in one_law & set(lefts) and item.signal != lefts[item.owner][0]
    }


def assignments(steps: tuple[Step, ...]) -> Iterator[Assignment]:
    """Give what is assigned in the steps, also within loops."""
    for step in steps:
        if isinstance(step, Assignment):
            yield step
        else:
            yield from step.inner


def possible(graph: BondGraph, signals: tuple[str, ...], n_states: int = 0) -> tuple[Imperfection, ...]:
    """Give what may be missing: slow errors of sensors and of the signals of laws, wander, noise of inputs.

    What the model declares may be larger than declared; a signal has one slow error, a part of its value or absolute. A
    part of a temperature depends on where that begins, so it has none.

    Parameters
    ----------
    graph : the plant
    signals : of its laws
    n_states : of the plant; of a large one not all is tried
    """
    most = max(MOST_FOLLOWED - n_states - len(graph.inputs), LEAST_PLACES)
    found = [_declared(item) for item in graph.slow_errors if not item.after and (item.relative or not item.wanders)]
    taken = {item.target for item in graph.slow_errors}
    sensors = [
        Imperfection(kind=Kind.ABSOLUTE, place=item.name, is_sensor=True)
        for item in graph.sensors
        if item.name not in taken
    ]
    laws = [
        Imperfection(kind=kind, place=name)
        for name in signals
        for kind in (Kind.RELATIVE, Kind.ABSOLUTE)
        if name not in taken and not (kind is Kind.RELATIVE and graph.signal_unit(name).text == TEMPERATURE)
    ]
    errors = (*found, *[*sensors, *laws][: max(most - len(found), 0)])
    scattering = [item for item in graph.inputs if not item.smooth]
    noises = [Imperfection(kind=Kind.INPUT_NOISE, place=item.name, size=item.noise) for item in scattering]
    wanders = [Imperfection(kind=Kind.WANDER, place=name) for name in _unseen(graph) if name not in taken]
    return (*found, *[*sensors, *laws, *wanders][: max(most - len(found), 0)], *_transients(graph, errors), *noises)


def _transients(graph: BondGraph, errors: Sequence[Imperfection]) -> Iterator[Imperfection]:
    """Give the transient errors of sensors of which a slow error is tried, after each input."""
    followed = {(item.target, name) for item in graph.slow_errors for name in item.after}
    for item in errors:
        if item.is_sensor and item.kind is Kind.ABSOLUTE:
            for known in graph.inputs:
                if (item.place, known.name) not in followed:
                    yield replace(item, kind=Kind.TRANSIENT, after=known.name, size=UNTRIED)


def _unseen(graph: BondGraph) -> Iterator[str]:
    """Give the parameters whose wander is not the slow error of a signal: of stores, and of laws with several.

    An exponent stays what it is.
    """
    nominals = {item.name: item.nominal for item in graph.parameters}
    raised = frozenset().union(*(exponents(law.right) for item in graph.components for law in item.laws))
    for item in graph.components:
        stores = item.type.is_store or any(law.store for law in item.laws)
        if stores or len(item.parameters) > 1:
            yield from (name for name in item.parameters if nominals[name] != 0.0 and name not in raised)


def kind_of(item: SlowError) -> Kind:
    """Give what a declared slow error is."""
    return Kind.WANDER if item.wanders else Kind.RELATIVE if item.relative else Kind.ABSOLUTE


def _declared(item: SlowError) -> Imperfection:
    kind = kind_of(item)
    return Imperfection(kind=kind, place=item.target, is_sensor=item.is_sensor, size=item.sd, memory=item.memory)


def with_imperfections(graph: BondGraph, added: tuple[Imperfection, ...]) -> BondGraph:
    """Give a plant with imperfections, in place of those of the same kind that it declares for the same thing."""
    errors, inputs = list(graph.slow_errors), list(graph.inputs)
    for item in added:
        if item.is_parameter or item.kind is Kind.ORDER:
            continue
        if not item.is_slow:
            k = next(k for k, known in enumerate(inputs) if known.name == item.place)
            hold = KIND_HOLDS.get(item.kind)
            inputs[k] = replace(inputs[k], hold=hold) if hold else replace(inputs[k], noise=max(item.size, UNTRIED))
            continue
        own = item.place, item.is_relative
        at = next((k for k, known in enumerate(errors) if (known.target, known.relative) == own), len(errors))
        errors[at : at + 1] = [_error(graph, item, errors[at] if at < len(errors) else None)]
    graph = replace(graph, slow_errors=tuple(errors), inputs=tuple(inputs))
    for item in added:
        if item.is_late and item.kind not in KIND_HOLDS:
            graph = _late(graph, item)
        elif item.is_parameter:
            graph = _with_term(graph, item)
    return graph


def _error(graph: BondGraph, item: Imperfection, known: SlowError | None) -> SlowError:
    """Give a slow error with an imperfection that was found of it.

    known : as it is declared, or was found by now
    """
    if item.kind is not Kind.TRANSIENT:
        new = known or SlowError(
            target=item.place,
            sd=0.0,
            relative=item.is_relative,
            memory=0.0,
            is_sensor=item.is_sensor,
            wanders=item.kind is Kind.WANDER,
        )
        return replace(new, sd=item.size, memory=item.memory)
    noise = next(sensor.noise for sensor in graph.sensors if sensor.name == item.place)
    new = known or SlowError(target=item.place, sd=HIDDEN * noise, relative=False, memory=0.0, is_sensor=True)
    each = new.by_input | {item.after: item.size}
    return replace(new, memory=item.memory, after=tuple(each), each=tuple(each.values()))


def _late(graph: BondGraph, item: Imperfection) -> BondGraph:
    """Give a plant in which an input or a sensor lags, or an input that does moves so fast at most.

    Where it does already, by so much.
    """
    if item.kind is Kind.ORDER:
        return _lagging(graph, item.place, parameter_name(lag_of(item)), round(item.size))
    name, is_limit = parameter_name(item), item.kind is Kind.RATE_LIMIT
    if is_limit and not graph.input(item.place).lag:
        graph = _late(graph, lag_of(item))
    parameters = {known.name: known for known in graph.parameters}
    is_known = name in parameters
    known = parameters.get(name) or Parameter(
        name=name,
        owner=item.place,
        nominal=1.0,
        unit=graph.input(item.place).unit.rate if is_limit else Unit("s"),
        accuracy=0,
        change=0,
        lower=0,
        upper=inf,
        suspect=is_limit,  # a drive becomes slow by itself
    )
    size = item.size
    parameters[name] = replace(known, nominal=size, accuracy=LAG_ACCURACY * size, change=LAG_CHANGE * size)
    graph = replace(graph, parameters=tuple(parameters.values()))
    if is_limit:
        inputs = (replace(one, rate_limit=name) if one.name == item.place else one for one in graph.inputs)
        return replace(graph, inputs=tuple(inputs))
    return _lagging(graph, item.place, name, 0 if is_known else item.order)


def lag_of(item: Imperfection) -> Imperfection:
    """Give the lag beside a rate limit, or of which an order is."""
    return replace(item, kind=Kind.LAG, size=item.memory)


def _lagging(graph: BondGraph, place: str, lag: str, order: int = 0) -> BondGraph:
    """Give a plant in which an input or a sensor lags by a parameter, in so many stages; 0: in as many as it does."""
    inputs = (replace(one, lag=lag, order=order or one.order) if one.name == place else one for one in graph.inputs)
    sensors = (replace(one, lag=lag, order=order or one.order) if one.name == place else one for one in graph.sensors)
    return replace(graph, inputs=tuple(inputs), sensors=tuple(sensors))


def _with_term(graph: BondGraph, item: Imperfection) -> BondGraph:
    """Give a plant in which laws have a further term; where they do already, one of this size."""
    name, parameters = parameter_name(item), {known.name: known for known in graph.parameters}
    owner, size = parameters[item.place].owner if item.by else item.law[0], abs(item.size)
    term = Parameter(
        name=name,
        owner=owner,
        nominal=item.size,
        unit=Unit(""),
        accuracy=TERM_ACCURACY * size or 1.0,
        change=TERM_CHANGE * size or 1.0,
        lower=-inf,
        upper=inf,
        suspect=False,
    )
    with_term = replace(graph, parameters=tuple((parameters | {name: term}).values()))
    if name in parameters:
        return with_term
    part = graph.component(owner)
    part = replace(part, parameters=(*part.parameters, name))
    if item.bend is None:
        laws = list(part.laws)
        laws[item.law[1]] = replace(laws[item.law[1]], right=Binary("+", laws[item.law[1]].right, Name(name)))
        part = replace(part, laws=tuple(laws))
    with_term = _with_part(with_term, part)
    if item.bend is None:
        return with_term
    factor = item.bend.factor(name)
    return _rewritten(with_term, lambda one: Binary("*", one, factor) if one == Name(item.place) else one)


def _with_part(graph: BondGraph, part: Component) -> BondGraph:
    return replace(graph, components=tuple(part if known.name == part.name else known for known in graph.components))


def _rewritten(graph: BondGraph, change: Callable[[Expression], Expression]) -> BondGraph:
    """Give a plant whose laws and sensors have every part of their expressions changed."""

    def law(item: Relation) -> Relation:
        return replace(item, left=rebuilt(item.left, change), right=rebuilt(item.right, change))

    parts = (replace(item, laws=tuple(map(law, item.laws))) for item in graph.components)
    sensors = (replace(item, reads=rebuilt(item.reads, change)) for item in graph.sensors)
    return replace(graph, components=tuple(parts), sensors=tuple(sensors))


def without_lag(graph: BondGraph, item: Imperfection) -> BondGraph:
    """Give a plant in which an input or a sensor does not lag, as before `with_imperfections`."""
    name = parameter_name(item)
    inputs = (replace(known, lag="", order=1) if known.lag == name else known for known in graph.inputs)
    sensors = (replace(known, lag="", order=1) if known.lag == name else known for known in graph.sensors)
    parameters = (known for known in graph.parameters if known.name != name)
    return replace(graph, parameters=tuple(parameters), inputs=tuple(inputs), sensors=tuple(sensors))


def without_curve(graph: BondGraph, item: Imperfection) -> BondGraph:
    """Give a plant in which a parameter goes with nothing more than before `with_imperfections`."""
    name = parameter_name(item)
    part = graph.component(graph.parameter(name).owner)
    graph = _with_part(graph, replace(part, parameters=tuple(known for known in part.parameters if known != name)))
    factor = item.bend.factor(name) if item.bend else Name(name)

    def straight(one: Expression) -> Expression:
        return one.left if isinstance(one, Binary) and (one.operator, one.right) == ("*", factor) else one

    parameters = tuple(known for known in graph.parameters if known.name != name)
    return _rewritten(replace(graph, parameters=parameters), straight)


def without_slow_error(graph: BondGraph, item: Imperfection) -> BondGraph:
    """Give a plant without a slow error that it has, or without what that has of the moves of an input.

    What the other of the two says of the same sensor stays.
    """
    own, kept = (item.place, item.is_relative), list[SlowError]()
    hidden = {sensor.name: HIDDEN * sensor.noise for sensor in graph.sensors}
    for known in graph.slow_errors:
        if (known.target, known.relative) != own:
            kept.append(known)
            continue
        each = {name: x for name, x in known.by_input.items() if name != item.after}
        sd = known.sd if item.after else hidden.get(known.target, 0.0)
        if each or (item.after and sd > hidden.get(known.target, 0.0)):
            kept.append(replace(known, sd=sd, after=tuple(each), each=tuple(each.values())))
    return replace(graph, slow_errors=tuple(kept))


def power_of(bow: Imperfection) -> Imperfection:
    """Give the power of the same parameter over the same, so that the bow may have its end anywhere."""
    bend = replace(bow.bend, bowed=False) if bow.bend else None
    return replace(bow, kind=Kind.CURVE, bend=bend, size=0.0)


def parameter_name(item: Imperfection) -> str:
    """Give the name of the parameter that is the size of a lag, a rate limit, an offset, or the power of a curve."""
    by = f"_by_{item.bend.name}" if item.bend else ""
    words = f"{item.place}{by}" if item.kind is Kind.CURVE else f"{item.place}_{item.kind.value}{by}"
    return words.replace(".", "_").replace(" ", "_")


def size_place(graph: BondGraph, layout: Layout, item: Imperfection) -> int:
    """Give where the size of an imperfection of a plant stands in q."""
    if item.is_parameter:
        return [known.name for known in graph.parameters].index(parameter_name(item))
    first, number = layout.first_noise + layout.n_y, _number(graph, item) if item.is_slow else 0
    if item.kind is Kind.TRANSIENT:
        return layout.first_each + felt_moves(graph).index((number, item.after))
    if item.is_slow:
        return first + number
    noisy = [known.name for known in graph.inputs if known.noise > 0.0]
    return first + layout.n_b + noisy.index(item.place)


def memory_place(graph: BondGraph, layout: Layout, item: Imperfection) -> int:
    """Give where the memory of a slow error of a plant stands in q."""
    return layout.first_memory + _number(graph, item)


def _number(graph: BondGraph, item: Imperfection) -> int:
    wanted = item.place, item.is_relative
    return [(known.target, known.relative) for known in graph.slow_errors].index(wanted)


def found_in(
    graph: BondGraph, layout: Layout, q: FloatArray, opened: Sequence[Imperfection]
) -> tuple[Imperfection, ...]:
    """Give imperfections of a plant with the sizes and memories of q (n_q,)."""
    found = []
    for item in opened:
        if item.kind in FORMS:
            found.append(item)
            continue
        place = size_place(graph, layout, item)
        if item.is_parameter:
            found.append(replace(item, size=float(q[place] * graph.parameters[place].scale)))
            if item.kind is Kind.RATE_LIMIT:
                lag = size_place(graph, layout, lag_of(item))
                found[-1] = replace(found[-1], memory=float(q[lag] * graph.parameters[lag].scale))
            continue
        size = float(np.exp(q[place]))
        memory = float(np.exp(q[memory_place(graph, layout, item)])) if item.is_slow else item.memory
        found.append(replace(item, size=size, memory=memory))
    return tuple(found)
