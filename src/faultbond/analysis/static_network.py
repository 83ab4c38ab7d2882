"""A static network as equations: what each block and each sensor states of one observation, and what follows directly.

Numbers are exact: a decimal of a model or a recording is the fraction that it stands for. Source: thesis 3.4, 3.5.
"""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from math import inf, isfinite, isnan

from faultbond.errors import StructureError
from faultbond.io.grid import GridPoint
from faultbond.model.expression import Binary, Call, Expression, Name, Negative, names
from faultbond.model.graph import BondGraph
from faultbond.structure.isolate import linear_solution
from faultbond.structure.numeric import Value, evaluate, exact
from faultbond.types import TimeGrid

TOLERANCE = 1e-9  # two values of a signal agree within this part of the larger one
ROUNDING = 1e-13  # and within this part of the terms that they are sums of, for data that are no exact decimals
READING, FOLLOWS = "reading of ", "value of "  # starts of names that no user can write


@dataclass(frozen=True, slots=True, kw_only=True)
class Equation:
    """A law of a block, or what a sensor reads: left = right, naming `names`."""

    left: Expression
    right: Expression
    names: tuple[str, ...]
    block: str = ""
    sensor: str = ""


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """One row: what is known by name, inputs and readings, and the sensors that have a reading."""

    index: int
    time: float
    values: Mapping[str, Value]
    sensors: tuple[str, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class StaticNetwork:
    """A network of blocks without time.

    equations: laws in an order of propagation as far as there is one, then sensors. values: constants and nominal
    parameters. suspects: parameters, or blocks where `of_blocks`.
    """

    graph: BondGraph
    equations: tuple[Equation, ...]
    values: Mapping[str, Value]
    suspects: tuple[str, ...]
    of_blocks: bool

    @property
    def is_noisy(self) -> bool:
        """Whether a sensor or an input has noise."""
        noises = [item.noise for item in self.graph.sensors] + [item.noise for item in self.graph.inputs]
        return any(noise > 0.0 for noise in noises)


@dataclass(frozen=True, slots=True, kw_only=True)
class Propagated:
    """What follows from what is known: all known values, equations with unknowns left, and a contradiction if any."""

    known: Mapping[str, Value]
    open: tuple[Equation, ...]
    conflict: Equation | None


def static_network(graph: BondGraph) -> StaticNetwork:
    """Give the equations of a model of static numeric blocks.

    Raises
    ------
    StructureError
        if the model has a time, is logic, or has nothing to suspect.
    """
    if graph.grid is not TimeGrid.NONE or not graph.is_block_network or graph.is_logic:
        raise StructureError(f"{graph.file}: a static network of numbers needs `blocks` and `sample_time: none`")
    parameters = tuple(item.name for item in graph.parameters if item.suspect)
    blocks = graph.suspect_blocks
    if not (parameters or blocks):
        raise StructureError(f"{graph.file}: every block and parameter has `suspect: no`; leave one to be suspected")
    laws = [
        Equation(left=law.left, right=law.right, names=_names(law.left, law.right), block=block.name)
        for block in graph.components
        for law in block.laws
    ]
    sensors = [_reading(item.name, item.reads) for item in graph.sensors]
    trusted = {item.name: exact(item.value) for item in graph.constants}
    return StaticNetwork(
        graph=graph,
        equations=(*_in_order(laws, graph.block_signals), *sensors),
        values={**trusted, **{item.name: exact(item.nominal) for item in graph.parameters}},
        suspects=parameters or blocks,
        of_blocks=not parameters,
    )


def _names(*sides: Expression) -> tuple[str, ...]:
    return tuple(dict.fromkeys(name for side in sides for name in names(side)))


def _reading(sensor: str, reads: Expression) -> Equation:
    left = Name(READING + sensor)
    return Equation(left=left, right=reads, names=_names(left, reads), sensor=sensor)


def _equal(one: str, other: str) -> Equation:
    return Equation(left=Name(one), right=Name(other), names=(one, other))


def _in_order(laws: list[Equation], signals: Iterable[str]) -> list[Equation]:
    """Sort laws so that each signal is defined before it is used; laws in loops and other equations come last."""
    waiting, missing = list(laws), set(signals)
    found: list[Equation] = []
    while True:
        ready = [law for law in waiting if defines(law) and not (set(law.names) & missing) - {defines(law)}]
        if not ready:
            return [*found, *waiting]
        found += ready
        missing -= {defines(law) for law in ready}
        waiting = [law for law in waiting if law not in ready]


def defines(law: Equation) -> str | None:
    """Give the signal that a law gives in terms of others, if it does."""
    if isinstance(law.left, Name) and not law.sensor and law.left.text not in names(law.right):
        return law.left.text
    return None


def observation(network: StaticNetwork, point: GridPoint) -> Observation:
    """Give what a row of a recording tells; values that are missing are left out."""
    graph = network.graph
    values: dict[str, Value] = {}
    for item, value in zip(graph.inputs, point.u, strict=True):
        if isfinite(value):
            values[item.name] = exact(value)
    read = [(item.name, value) for item, value in zip(graph.sensors, point.y, strict=True) if isfinite(value)]
    values.update({READING + name: exact(value) for name, value in read})
    return Observation(index=point.index, time=point.time, values=values, sensors=tuple(name for name, _ in read))


def equations_of(
    network: StaticNetwork, seen: Observation, suspended: Iterable[str], values: Mapping[str, Value]
) -> Propagated:
    """Give what follows from one observation with suspects suspended.

    A suspended parameter that follows stays unknown, with an equation more that gives its value.

    Parameters
    ----------
    network : the network
    seen : the observation
    suspended : parameters whose values, or blocks whose laws, are not used
    values : values of suspended parameters, where they are to be tried
    """
    blocks = set(suspended) if network.of_blocks else set()
    parameters = set() if network.of_blocks else set(suspended)  # a block may have the name of a parameter
    known = {name: value for name, value in network.values.items() if name not in parameters}
    known.update(seen.values)
    known.update(values)
    dropped = {READING + item.name for item in network.graph.sensors} - known.keys()
    equations = [law for law in network.equations if law.block not in blocks and not dropped & set(law.names)]
    found = propagate(equations, known)
    own = [] if found.conflict else sorted(parameters & found.known.keys() - values.keys())
    left = {name: value for name, value in found.known.items() if name not in own}
    left.update({FOLLOWS + name: found.known[name] for name in own})
    return replace(found, known=left, open=(*found.open, *(_equal(name, FOLLOWS + name) for name in own)))


def propagate(equations: Iterable[Equation], known: Mapping[str, Value]) -> Propagated:
    """Follow equations with one unknown until none is left, checking those without unknowns (thesis 3.4.1)."""
    found = dict(known)
    sizes = {name: magnitude(value) for name, value in found.items()}
    waiting = list(equations)
    while True:
        left = []
        for equation in waiting:
            unknown = [name for name in equation.names if name not in found]
            if not unknown:
                if not holds(equation, found, sizes):
                    return Propagated(known=found, open=(), conflict=equation)
            elif len(unknown) > 1 or not _follow(equation, unknown[0], found, sizes):
                left.append(equation)
                continue
            if unknown and isnan(found[unknown[0]]):
                return Propagated(known=found, open=(), conflict=equation)
        if len(left) == len(waiting):
            return Propagated(known=found, open=tuple(left), conflict=None)
        waiting = left


def _follow(equation: Equation, name: str, found: dict[str, Value], sizes: dict[str, float]) -> bool:
    """Add the value of the only unknown of an equation, if the equation gives it directly."""
    definition = _definition(equation, name)
    if definition is None:
        return False
    value = evaluate(definition, found)
    if isnan(value) and definition not in (equation.left, equation.right):
        return False  # the unknown has no influence here, such as a factor of 0
    found[name], sizes[name] = value, size(definition, found, sizes)
    return True


def _definition(equation: Equation, name: str) -> Expression | None:
    for one, other in ((equation.left, equation.right), (equation.right, equation.left)):
        if one == Name(name) and name not in names(other):
            return other
    return linear_solution(Binary("-", equation.left, equation.right), name)


def holds(equation: Equation, known: Mapping[str, Value], sizes: Mapping[str, float]) -> bool:
    """Whether both sides agree, to rounding; not where one has no real value."""
    left, right = evaluate(equation.left, known), evaluate(equation.right, known)
    if not (isfinite(left) and isfinite(right)):
        return False
    if left == right:
        return True
    larger = max(magnitude(left), magnitude(right))
    terms = max(size(equation.left, known, sizes), size(equation.right, known, sizes))
    return magnitude(left - right) <= TOLERANCE * larger + ROUNDING * terms


def magnitude(value: Value) -> float:
    """Give the size of a value, infinite beyond the range of floating point."""
    try:
        return abs(float(value))
    except OverflowError:
        return inf


def size(expression: Expression, known: Mapping[str, Value], sizes: Mapping[str, float]) -> float:
    """Give the size of the terms that a value is the sum of: what rounding is relative to."""
    match expression:
        case Name(text):
            return sizes[text]
        case Negative(operand):
            return size(operand, known, sizes)
        case Binary("+" | "-", left, right):
            return size(left, known, sizes) + size(right, known, sizes)
        case Binary("*", left, right):
            return size(left, known, sizes) * size(right, known, sizes)
        case Binary("/", left, right):
            divisor = magnitude(evaluate(right, known))
            return size(left, known, sizes) / divisor if divisor else 0.0
        case Call("abs" | "min" | "max", arguments):
            return max(size(argument, known, sizes) for argument in arguments)
    return magnitude(evaluate(expression, known))


def without_readings(network: StaticNetwork, seen: Observation) -> dict[str, Value]:
    """Give the signals of the healthy network as far as they follow from the inputs alone."""
    inputs = {name: value for name, value in seen.values.items() if not name.startswith(READING)}
    return dict(equations_of(network, replace(seen, values=inputs, sensors=()), (), {}).known)
