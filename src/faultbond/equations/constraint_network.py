"""The constraint network of a plant: signals merged over junctions, one residual per law and junction sum.

Junction equalities are merged away, so a signal that many bonds share has one name: that of the junction where there
is one (`vessel.e`, `line.f`), else that of the component (`tank.f`). A block network is one already: its signals keep
their names (`y`), and the rate of a store is a signal, `der(y)`. Source: thesis 3.2.3, 3.3; blocks 3.4, 3.9.
"""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace

from faultbond.equations.causality import Causality
from faultbond.equations.tables import with_curves
from faultbond.errors import ModelError
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, Number, names, rename
from faultbond.model.graph import BondGraph, Check, Input, Sensor, SlowError
from faultbond.model.parser import to_text
from faultbond.types import ElementType, JunctionType


@dataclass(frozen=True, slots=True, kw_only=True)
class Constraint:
    """`residual = 0`, by the component or junction `owner`."""

    owner: str
    residual: Expression
    line: int


@dataclass(frozen=True, slots=True, kw_only=True)
class Store:
    """A stored quantity (`tank.q`) and the signal that is its rate of change (`tank.f`); `y` and `der(y)` of blocks.

    lag: the parameter that is the time constant of an input or a sensor with a lag; empty of other stores.
    source: the input that such a store follows; empty where it follows what a sensor reads.
    owner: the input or sensor that lags.
    """

    name: str
    rate: str
    component: str | None = None  # None: an integrated signal that only a sensor or a law reads
    partner: str | None = None  # the co-energy signal: effort of a C, flow of an I
    lag: str = ""
    source: str = ""
    owner: str = ""

    @property
    def is_stage(self) -> bool:
        """Whether it is within a lag of several stages, not the last of them: nothing shows or follows it."""
        return bool(self.lag) and self.name != f"{self.owner}.lagged"


@dataclass(frozen=True, slots=True, kw_only=True)
class ConstraintNetwork:
    """Signals and constraints in canonical names.

    signals: unknown at an instant, given states, inputs and parameters.
    states: independent stores. dependent: stores in derivative causality; their quantity is one of the signals.
    readings: one expression per sensor. by_hand: one per signal that a person can measure, in the order of the checks.
    sensed: one expression per sensor, what it would read without its lag.
    """

    signals: tuple[str, ...]
    constraints: tuple[Constraint, ...]
    states: tuple[Store, ...]
    dependent: tuple[Store, ...]
    readings: tuple[Expression, ...]
    slow_errors: tuple[SlowError, ...]
    free: tuple[str, ...] = ()  # unknown inputs
    inputs: tuple[str, ...] = ()  # those that are measured
    by_hand: tuple[Expression, ...] = ()
    sensed: tuple[Expression, ...] = ()


class _Names:
    """Union of signal names that are one signal."""

    def __init__(self) -> None:
        self.parent: dict[str, str] = {}
        self.rank: dict[str, int] = {}

    def add(self, name: str, rank: int) -> None:
        self.parent.setdefault(name, name)
        self.rank[name] = max(rank, self.rank.get(name, 0))

    def find(self, name: str) -> str:
        root = name
        while self.parent[root] != root:
            root = self.parent[root]
        while self.parent[name] != root:
            self.parent[name], name = root, self.parent[name]
        return root

    def join(self, first: str, second: str) -> None:
        """Merge two signals; the name of higher rank (junction over component over bond) stays."""
        one, two = self.find(first), self.find(second)
        if one != two:
            keep, drop = (one, two) if self.rank[one] >= self.rank[two] else (two, one)
            self.parent[drop] = keep


def build_network(graph: BondGraph, causality: Causality) -> ConstraintNetwork:
    """Give the constraint network of a bond graph whose causality is known, or of a block network.

    Raises
    ------
    ModelError
        Where an expression reads a signal that does not exist.
    """
    network = _block_network(graph) if graph.is_block_network else _bonded_network(graph, causality)
    return _lagging(graph, _curved(graph, network))


def _curved(graph: BondGraph, network: ConstraintNetwork) -> ConstraintNetwork:
    """Write out what is looked up in tables."""
    tables = {item.name: item for item in graph.tables}
    return replace(
        network,
        constraints=tuple(replace(item, residual=with_curves(item.residual, tables)) for item in network.constraints),
        readings=tuple(with_curves(item, tables) for item in network.readings),
        by_hand=tuple(with_curves(item, tables) for item in network.by_hand),
    )


def _lagging(graph: BondGraph, network: ConstraintNetwork) -> ConstraintNetwork:
    """Put stores of first order between an input with a lag and what it acts on, and before a sensor with one.

    What lags is the signal `u.lagged`, with T der(u.lagged) = u - u.lagged; all that names the input `u` sees that.
    Of a lag of order n it is the last of n stages, each with T/n; where an input has a highest rate that one moves by
    it at most.
    """
    behind = {item.name: f"{item.name}.lagged" for item in graph.inputs if item.lag}
    constraints = [
        replace(item, residual=rename(item.residual, lambda name: behind.get(name, name)))
        for item in network.constraints
    ]
    readings, by_hand = (
        [rename(item, lambda name: behind.get(name, name)) for item in items]
        for items in (network.readings, network.by_hand)
    )
    sensed = tuple(readings)
    stores: list[Store] = []

    def follow(item: Input | Sensor, what: Expression, source: str) -> Expression:
        for stage in range(1, item.order + 1):
            last = stage == item.order
            name = f"{item.name}.lagged{'' if last else stage}"
            store = Store(name=name, rate=f"der({name})", lag=item.lag, source=source, owner=item.name)
            gap: Expression = Binary("/", Binary("-", what, Name(name)), Name(item.lag))
            if item.order > 1:
                gap = Binary("*", Number(float(item.order)), gap)
            if last and isinstance(item, Input) and item.rate_limit:
                most = Name(item.rate_limit)
                gap = Call("max", (Call("min", (gap, most)), Negative(most)))
            law = Constraint(owner=f"{item.name}.lag", residual=Binary("-", Name(store.rate), gap), line=item.line)
            stores.append(store)
            constraints.append(law)
            what = Name(name)
        return what

    for item in graph.inputs:
        if item.lag:
            follow(item, Name(item.name), item.name)
    for k, sensor in enumerate(graph.sensors):
        if sensor.lag:
            readings[k] = follow(sensor, readings[k], "")
    return replace(
        network,
        signals=(*network.signals, *(store.rate for store in stores)),
        constraints=tuple(constraints),
        states=(*network.states, *stores),
        readings=tuple(readings),
        by_hand=tuple(by_hand),
        sensed=sensed,
    )


def _bonded_network(graph: BondGraph, causality: Causality) -> ConstraintNetwork:
    """Give signals and laws of a bond graph, without lags."""
    table = _merge_signals(graph)
    expressions = [
        *(side for item in graph.components for law in item.laws for side in (law.left, law.right)),
        *(sensor.reads for sensor in graph.sensors),
    ]
    stores: list[Store] = []
    dependent: list[Store] = []
    for item in graph.components:
        if item.type.is_store:
            quantity, rate, partner = ("q", "f", "e") if item.type is ElementType.C else ("p", "e", "f")
            store = Store(
                name=f"{item.name}.{quantity}",
                rate=table.find(f"{item.name}.{rate}"),
                component=item.name,
                partner=table.find(f"{item.name}.{partner}"),
            )
            (stores if item.name in causality.integral else dependent).append(store)
    stores += _integrals(graph, expressions, {store.name for store in (*stores, *dependent)}, table)
    known = {store.name for store in (*stores, *dependent)}

    def canonical(name: str) -> str:
        if "." not in name or name in known:
            return name
        return table.find(name)

    constraints = [*_junction_sums(graph, table)]
    for item in graph.components:
        for law in item.laws:
            residual = Binary("-", rename(law.left, canonical), rename(law.right, canonical))
            constraints.append(Constraint(owner=item.name, residual=residual, line=law.line))
    signals = dict.fromkeys(table.find(name) for name in table.parent)
    signals |= dict.fromkeys(store.name for store in dependent)
    return ConstraintNetwork(
        signals=tuple(signals),
        constraints=tuple(constraints),
        states=tuple(stores),
        dependent=tuple(dependent),
        readings=tuple(rename(sensor.reads, canonical) for sensor in graph.sensors),
        free=tuple(item.name for item in graph.unknown_inputs),
        inputs=tuple(item.name for item in graph.inputs),
        slow_errors=tuple(replace(error, target=canonical(error.target)) for error in graph.slow_errors),
        by_hand=tuple(
            _by_hand(graph, item, item.reads, canonical, {*known, *table.parent})
            for item in graph.checks
            if item.reads is not None
        ),
    )


def _by_hand(
    graph: BondGraph, check: Check, reads: Expression, canonical: Callable[[str], str], signals: set[str]
) -> Expression:
    """Give what is measured by hand; an integral that nothing else reads is no state, so nothing is known of it."""
    for name in names(reads):
        if "." in name and name not in signals:
            raise ModelError(
                f"{graph.file}:{check.line}: check {check.name} reads {name}, of which nothing is known, since no "
                "sensor and no law reads it. Let a sensor read it, or remove the check."
            )
    return rename(reads, canonical)


def _block_network(graph: BondGraph) -> ConstraintNetwork:
    """Give the laws of the blocks as they stand; der(y) on the left of a law makes y a store."""
    laws = [(item.name, law) for item in graph.components for law in item.laws]
    stores = [
        Store(name=law.store, rate=to_text(law.left), component=owner) for owner, law in laws if law.store is not None
    ]
    states = {store.name for store in stores}
    constraints = []
    for owner, law in laws:  # left - right, where a rate is the signal `der(y)`; `0 = x` is x itself
        left = Name(to_text(law.left)) if law.store is not None else law.left
        residual = law.right if left == Number(0.0) else Binary("-", left, law.right)
        constraints.append(Constraint(owner=owner, residual=residual, line=law.line))
    return ConstraintNetwork(
        signals=(*(name for name in graph.block_signals if name not in states), *(store.rate for store in stores)),
        constraints=tuple(constraints),
        states=tuple(stores),
        dependent=(),
        readings=tuple(sensor.reads for sensor in graph.sensors),
        free=tuple(item.name for item in graph.unknown_inputs),
        inputs=tuple(item.name for item in graph.inputs),
        slow_errors=graph.slow_errors,
        by_hand=tuple(item.reads for item in graph.checks if item.reads is not None),
    )


def _merge_signals(graph: BondGraph) -> _Names:
    """Name the two signals of each bond and merge the equal ones."""
    table = _Names()
    junctions = {item.name: item for item in graph.junctions}
    elements = {item.name: item for item in graph.components}
    for index, bond in enumerate(graph.bonds):
        for letter in "ef":
            table.add(_bond_signal(graph, index, letter), 0)
        for node, port in ((bond.tail, "2"), (bond.head, "1")):
            if node in junctions:
                letter = "e" if junctions[node].type is JunctionType.ZERO else "f"
                table.add(f"{node}.{letter}", 2)
                table.join(f"{node}.{letter}", _bond_signal(graph, index, letter))
            else:
                suffix = port if elements[node].type.n_ports == 2 else ""
                for letter in "ef":
                    table.add(f"{node}.{letter}{suffix}", 1)
                    table.join(f"{node}.{letter}{suffix}", _bond_signal(graph, index, letter))
    return table


def _bond_signal(graph: BondGraph, index: int, letter: str) -> str:
    bond = graph.bonds[index]
    return f"{bond.tail}->{bond.head}#{index}.{letter}"


def _junction_sums(graph: BondGraph, table: _Names) -> Iterable[Constraint]:
    """Flows sum to zero at a 0-junction, efforts at a 1-junction; positive along the half arrow into it."""
    for junction in graph.junctions:
        letter = "f" if junction.type is JunctionType.ZERO else "e"
        terms: list[Expression] = []
        for index, bond in enumerate(graph.bonds):
            if junction.name in (bond.tail, bond.head):
                term = Name(table.find(_bond_signal(graph, index, letter)))
                terms.append(term if bond.head == junction.name else Negative(term))
        total: Expression = terms[0] if terms else Number(0.0)
        for term_ in terms[1:]:
            total = Binary("-", total, term_.operand) if isinstance(term_, Negative) else Binary("+", total, term_)
        yield Constraint(owner=junction.name, residual=total, line=junction.line)


def _integrals(graph: BondGraph, expressions: list[Expression], known: set[str], table: _Names) -> list[Store]:
    """Stores for integrated signals that somebody reads: `shaft.q` is the integral of a flow, `node.p` of an effort."""
    found: dict[str, Store] = {}
    for expression in expressions:
        for name in names(expression):
            part, _, letter = name.partition(".")
            if letter in ("q", "p") and name not in known and name not in found:
                rate = f"{part}.{'f' if letter == 'q' else 'e'}"
                if rate not in table.parent:
                    raise ModelError(
                        f"{graph.file}: {name} is read, but {part} has no single "
                        f"{'flow' if letter == 'q' else 'effort'} to integrate"
                    )
                found[name] = Store(name=name, rate=table.find(rate))
            elif letter and name not in known and name not in found and name not in table.parent:
                raise ModelError(f"{graph.file}: {name} is read, but {part} has no such signal")
    return list(found.values())
