"""The component network: what holds within one time frame, and from a frame to the one before.

Frame 0 is the newest sample, frame 1 the sample before it, and so on. An equation stands once in every frame; it
relates signals of its own frame and, in the sum of a store, of the frame before: `shaft.f@1` is one frame earlier.
Stores follow backward Euler, as in the thesis. The parameter of a linear store acts on the rate of its effort or flow:
`L.e = L*L.rate`, and `L.sum` is `L.rate*dt = i - i@1`. Any other store sums its content: `tank.sum` is
`dt*tank.f = tank.q - tank.q@1`. Measured signals carry the name of their input or sensor.
Source: thesis 3.9, 4.1 and figure A.2.
"""

from collections import Counter
from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass

from faultbond.equations.constraint_network import Constraint, ConstraintNetwork, Store
from faultbond.equations.inversion import collect, linear_solution, substitute
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Expression, Name, names, rename
from faultbond.model.graph import BondGraph

SAMPLE_TIME = "dt"
PREVIOUS = "@1"

SignalAt = tuple[str, int]  # a signal, and how many frames back


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """`residual = 0` in every frame.

    name: of a component `R`, of the laws of a two-port `K.1` and `K.2`, of the sum of a store `L.sum`, of a junction
    `armature`, of a sensor `flow`. signals: every signal it relates with the frames back, in the order in which a
    search looks at them. weight: 1 for a part of the plant, 0 for a sensor, where components passed are counted.
    """

    name: str
    owner: str
    residual: Expression
    signals: tuple[SignalAt, ...]
    parameters: tuple[str, ...]
    weight: int = 1
    line: int = 0


@dataclass(frozen=True, slots=True, kw_only=True)
class FrameState:
    """A signal that reaches from one frame into the next; `sum` names the equation that carries it.

    rate: the signal that is its change in a second. component: the store, if it is one. is_stage: whether it stands
    within a lag of several stages.
    """

    signal: str
    rate: str
    sum: str
    component: str | None
    is_stage: bool = False


@dataclass(frozen=True, slots=True, kw_only=True)
class ComponentNetwork:
    """The equations of one frame.

    signals: all that equations relate. inputs, outputs: those known in every frame, by name of input and sensor.
    parameters: all that laws name; suspects: those that a fault may change. file: for messages.
    """

    name: str
    equations: tuple[Equation, ...]
    signals: tuple[str, ...]
    inputs: tuple[str, ...]
    outputs: tuple[str, ...]
    states: tuple[FrameState, ...]
    parameters: tuple[str, ...]
    suspects: tuple[str, ...]
    file: str = "model"

    @property
    def observed(self) -> frozenset[str]:
        """Signals known in every frame."""
        return frozenset((*self.inputs, *self.outputs))

    def equation(self, name: str) -> Equation:
        """Give the equation of that name; KeyError if there is none."""
        return {item.name: item for item in self.equations}[name]


@dataclass(frozen=True, slots=True, kw_only=True)
class _Draft:
    """An equation in the names of the bond graph."""

    name: str
    owner: str
    residual: Expression
    order: tuple[str, ...]
    weight: int = 1
    line: int = 0


def build_components(graph: BondGraph, network: ConstraintNetwork) -> ComponentNetwork:
    """Give the component network of a plant whose constraint network is known.

    Raises
    ------
    StructureError
        Where a parameter or constant has the name of a sample, such as `V_0` beside the input `V`, or of a sensor, or
        anything is called `dt`.
    """
    stores = (*network.states, *network.dependent)
    owners = Counter(store.component or store.name for store in stores)
    sums, carried, linear = {}, {}, {}
    for store in stores:  # the sum has the name of the component, and its own where a block has several
        owner = store.component or store.name
        sums[store.name] = f"{owner}.{store.name}.sum" if owners[owner] > 1 else f"{owner}.sum"
        carried[store.name] = store.name, store.rate  # what goes from frame to frame, and its rate
        if _is_linear(store, network, graph):
            linear[store.component] = store
            carried[store.name] = str(store.partner), f"{owner}.rate"
    aliases, redundant = _aliases(graph, network)
    drafts = [
        *_laws(graph, network, linear),
        *(_sum(store, sums[store.name], *carried[store.name]) for store in stores),
    ]
    for sensor, reading in zip(graph.sensors, network.readings, strict=True):
        if sensor.name in redundant:  # reads more than a plain signal
            name, gap = sensor.name, Binary("-", Name(sensor.name), reading)
            drafts.append(_Draft(name=name, owner=name, residual=gap, order=names(gap), weight=0, line=sensor.line))
    # Two-ports first, since they lead on to other parts; then components as written; junctions and sensors last.
    position = {item.name: (item.type.n_ports != 2, k) for k, item in enumerate(graph.components)}
    drafts.sort(key=lambda draft: position.get(draft.owner, (True, len(position))))
    equations = tuple(_equation(draft, aliases, graph) for draft in drafts if not _is_alias(draft, aliases))
    signals = dict.fromkeys(signal for item in equations for signal, _ in item.signals)
    _check_names(graph, {*signals, *(item.name for item in graph.inputs)}, bool(stores))
    return ComponentNetwork(
        name=graph.name,
        equations=equations,
        signals=tuple(signals),
        inputs=tuple(item.name for item in graph.inputs),
        outputs=tuple(item.name for item in graph.sensors),
        states=tuple(
            FrameState(
                signal=aliases.get(signal, signal),
                rate=aliases.get(rate, rate),
                sum=sums[store.name],
                component=store.component,
                is_stage=store.is_stage,
            )
            for store in stores
            for signal, rate in [carried[store.name]]
        ),
        parameters=tuple(item.name for item in graph.parameters),
        suspects=tuple(item.name for item in graph.parameters if item.suspect),
        file=graph.file,
    )


def _is_linear(store: Store, network: ConstraintNetwork, graph: BondGraph) -> bool:
    """Whether content = coefficient * co-energy by a law of parameters and constants, and only that law reads it."""
    users = [item for item in network.constraints if store.name in names(item.residual)]
    read = any(store.name in names(reading) for reading in network.readings)
    if store.partner is None or len(users) != 1 or read or users[0].owner != store.component:
        return False
    still = {item.name for item in graph.parameters} | {item.name for item in graph.fixed}
    if not set(names(users[0].residual)) <= {store.name, store.partner, *still}:
        return False
    content = linear_solution(users[0].residual, store.name)
    return content is not None and set(collect(content, store.partner) or ()) == {(1, 0)}


def _aliases(graph: BondGraph, network: ConstraintNetwork) -> tuple[dict[str, str], frozenset[str]]:
    """Give the input or sensor that each signal simply is, and the sensors that are no other name of a signal."""
    aliases: dict[str, str] = {}
    inputs = {item.name for item in graph.inputs}
    for constraint in network.constraints:
        match constraint.residual:
            case Binary("-", Name(one), Name(two)) if (one in inputs) != (two in inputs):
                signal, source = (two, one) if one in inputs else (one, two)
                if signal in network.signals:
                    aliases.setdefault(signal, source)
    states = {store.name for store in (*network.states, *network.dependent)}
    redundant = []
    for sensor, reading in zip(graph.sensors, network.readings, strict=True):
        signal = reading.text if isinstance(reading, Name) else ""
        if signal in {*network.signals, *states} and signal not in aliases:
            aliases[signal] = sensor.name
        else:
            redundant.append(sensor.name)
    return aliases, frozenset(redundant)


def _laws(graph: BondGraph, network: ConstraintNetwork, linear: Mapping[str | None, Store]) -> Iterable[_Draft]:
    """Junction sums and component laws; the law of a linear store in its rate form."""
    total = Counter(item.owner for item in network.constraints)
    seen: Counter[str] = Counter()
    for item in network.constraints:
        seen[item.owner] += 1
        name = item.owner if total[item.owner] == 1 else f"{item.owner}.{seen[item.owner]}"
        residual = item.residual
        if item.owner in linear:  # differentiated once: the content becomes its rate, the co-energy becomes its own
            store = linear[item.owner]
            rate = Name(f"{store.component}.rate")
            residual = substitute(residual, {store.name: Name(store.rate), str(store.partner): rate})
        yield _Draft(
            name=name, owner=item.owner, residual=residual, order=_signal_order(residual, item, graph), line=item.line
        )


def _signal_order(residual: Expression, law: Constraint, graph: BondGraph) -> tuple[str, ...]:
    """At a junction what leads on to another part comes first; in a law the effort comes before the flow."""
    used = names(residual)
    if law.owner in {item.name for item in graph.junctions}:
        two_ports = {item.name for item in graph.components if item.type.n_ports == 2}
        through = two_ports | {item.name for item in graph.junctions}
        return tuple(sorted(used, key=lambda name: name.partition(".")[0] not in through))
    return tuple(sorted(used, key=lambda name: not name.partition(".")[2].startswith("e")))


def _check_names(graph: BondGraph, signals: Collection[str], has_stores: bool) -> None:
    """Refuse a number with the name of a sensor or of a sample: the two could not be told apart in a closed form."""
    numbers = [(item.name, item.line) for item in graph.parameters]
    numbers += [(item.name, item.line) for item in graph.constants]
    sensors = [(item.name, item.line) for item in graph.sensors]
    inputs = [(item.name, item.line) for item in graph.inputs]
    for name, line in (*numbers, *inputs, *sensors) if has_stores else ():
        if name == SAMPLE_TIME:
            raise StructureError(f"{graph.file}:{line}: dt is also the name of the sample time; rename it")
    for name, line in numbers:
        signal, _, frame = name.rpartition("_")
        if frame.isdigit() and signal in signals:
            raise StructureError(f"{graph.file}:{line}: {name} is also the name of a sample of {signal}; rename it")
        if name in dict(sensors):
            advice = "rename one of them, and state the sensor's `column` if it is that"
            raise StructureError(f"{graph.file}:{line}: {name} is also the name of a sensor; {advice}")


def _sum(store: Store, name: str, state: str, rate: str) -> _Draft:
    """Backward Euler from the frame before: dt*rate - (state - state@1) = 0."""
    change = Binary("-", Name(state), Name(state + PREVIOUS))
    residual = Binary("-", Binary("*", Name(SAMPLE_TIME), Name(rate)), change)
    owner = store.component or store.name
    return _Draft(name=name, owner=owner, residual=residual, order=(rate, state, state + PREVIOUS))


def _is_alias(draft: _Draft, aliases: Mapping[str, str]) -> bool:
    """Whether an equation says no more than that a signal is an input."""
    match draft.residual:
        case Binary("-", Name(one), Name(two)):
            return aliases.get(one) == two or aliases.get(two) == one
    return False


def _equation(draft: _Draft, aliases: Mapping[str, str], graph: BondGraph) -> Equation:
    parameters = {item.name for item in graph.parameters}
    still = parameters | {item.name for item in graph.fixed} | {SAMPLE_TIME}

    def renamed(name: str) -> str:
        plain = name.removesuffix(PREVIOUS)
        return aliases.get(plain, plain) + name[len(plain) :]

    residual = rename(draft.residual, renamed)
    order = dict.fromkeys(renamed(name) for name in draft.order if name not in still)
    return Equation(
        name=draft.name,
        owner=draft.owner,
        residual=residual,
        signals=tuple((name.removesuffix(PREVIOUS), int(name.endswith(PREVIOUS))) for name in order),
        parameters=tuple(name for name in names(residual) if name in parameters),
        weight=draft.weight,
        line=draft.line,
    )


def in_frame(equation: Equation, frame: int) -> Expression:
    """Give the residual with every signal marked by its frame: `shaft.f_2`; parameters and constants stay.

    Example: in frame 1 the sum of a store relates `shaft.f_1` and `shaft.f_2`.
    """
    marked: dict[str, Expression] = {}
    for signal, back in equation.signals:
        marked[signal + PREVIOUS * back] = Name(frame_name((signal, frame + back)))
    return substitute(equation.residual, marked)


def frame_name(signal: SignalAt) -> str:
    """Give the name of a signal in a frame: `omega_0` is the newest sample of omega."""
    return f"{signal[0]}_{signal[1]}"
