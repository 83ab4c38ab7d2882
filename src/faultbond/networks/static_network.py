"""A static network: its laws in the order in which signals follow, its readings, its suspects, and observations of it.

Numbers are exact: a decimal of a model or a recording is the fraction that it stands for. Source: thesis 3.4.1.
"""

from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass, replace
from math import isfinite

from faultbond.equations.numeric import Real, exact, numeric_value
from faultbond.errors import StructureError
from faultbond.io.grid import GridPoint
from faultbond.model.expression import Name
from faultbond.model.graph import BondGraph
from faultbond.networks.reader import Reader, reader
from faultbond.networks.relations import BlockLaw, equation, holds, magnitude, shortened, size
from faultbond.types import TimeGrid

READING = "reading of "  # start of a name that no user can write


@dataclass(frozen=True, slots=True, kw_only=True)
class Known:
    """Values by name, and the sizes of the terms that they are sums of."""

    values: Mapping[str, Real]
    sizes: Mapping[str, float]


@dataclass(frozen=True, slots=True, kw_only=True)
class Observation:
    """One row: inputs and readings by name, and the sensors that have a reading.

    healthy: all that follows from the inputs with nominal parameters, where `with_healthy` has added it.
    """

    index: int
    time: float
    values: Mapping[str, Real]
    sensors: tuple[str, ...]
    healthy: Known | None = None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class StaticNetwork:
    """A network of blocks without time.

    laws: each before its signal is used, as far as that can be; `is_explicit` where it can be throughout. readings:
    what sensors read. values: constants and nominal parameters. suspects: parameters, or blocks where `of_blocks`.
    reader: readings as a function of all suspected parameters; None where signals do not simply follow.
    """

    graph: BondGraph
    laws: tuple[BlockLaw, ...]
    readings: tuple[BlockLaw, ...]
    values: Mapping[str, Real]
    suspects: tuple[str, ...]
    of_blocks: bool
    is_explicit: bool
    reader: Reader | None

    @property
    def is_noisy(self) -> bool:
        """Whether a sensor or an input has noise."""
        noises = [item.noise for item in self.graph.sensors] + [item.noise for item in self.graph.inputs]
        return any(noise > 0.0 for noise in noises)


def static_network(graph: BondGraph) -> StaticNetwork:
    """Give the equations of a model of static numeric blocks.

    Raises
    ------
    StructureError
        if the model has a time, is logic, or has nothing to suspect; with noise, also if a signal does not follow.
    """
    if graph.grid is not TimeGrid.NONE or not graph.is_block_network or graph.is_logic:
        raise StructureError(f"{graph.file}: a static network of numbers needs `blocks` and `sample_time: none`")
    parameters = tuple(item.name for item in graph.parameters if item.suspect)
    blocks = graph.suspect_blocks
    if not (parameters or blocks):
        raise StructureError(f"{graph.file}: every block and parameter has `suspect: no`; leave one to be suspected")
    laws = [equation(law.left, law.right, block=item.name) for item in graph.components for law in item.laws]
    ordered, rest = _in_order(laws, graph.block_signals)
    values = {item.name: exact(item.value) for item in graph.constants}
    values |= {item.name: exact(item.nominal) for item in graph.parameters}
    network = StaticNetwork(
        graph=graph,
        laws=(*ordered, *rest),
        readings=tuple(equation(Name(READING + item.name), item.reads, sensor=item.name) for item in graph.sensors),
        values=values,
        suspects=parameters or blocks,
        of_blocks=not parameters,
        is_explicit=not rest,
        reader=None,
    )
    free = {name: float(values[name]) for name in parameters}
    try:
        return replace(network, reader=reader(graph, network.laws, values, free))
    except StructureError:
        if network.is_noisy:
            raise
        return network


def _in_order(laws: list[BlockLaw], signals: Iterable[str]) -> tuple[list[BlockLaw], list[BlockLaw]]:
    """Sort laws so that each signal is defined before it is used; laws in loops and other equations are left over."""
    waiting, missing = list(laws), set(signals)
    found: list[BlockLaw] = []
    while True:
        ready = [law for law in waiting if law.signal and missing.isdisjoint(law.uses)]
        if not ready:
            return found, waiting
        found += ready
        missing -= {law.signal for law in ready if law.signal}
        waiting = [law for law in waiting if law not in ready]


def observation(network: StaticNetwork, point: GridPoint) -> Observation:
    """Give what a row of a recording tells; values that are missing are left out."""
    graph = network.graph
    values: dict[str, Real] = {}
    for item, value in zip(graph.inputs, point.u, strict=True):
        if isfinite(value):
            values[item.name] = exact(value)
    read = [(item.name, value) for item, value in zip(graph.sensors, point.y, strict=True) if isfinite(value)]
    values.update({READING + name: exact(value) for name, value in read})
    return Observation(index=point.index, time=point.time, values=values, sensors=tuple(name for name, _ in read))


def with_healthy(network: StaticNetwork, seen: Observation) -> Observation:
    """Give an observation with what follows from its inputs in the healthy network."""
    values = {**network.values, **seen.values}
    known = Known(values=values, sizes={name: magnitude(value) for name, value in values.items()})
    return replace(seen, healthy=followed(network, known, None))


def healthy_of(network: StaticNetwork, seen: Observation) -> Known:
    """Give what follows from the inputs of an observation in the healthy network."""
    return seen.healthy or with_healthy(network, seen).healthy or Known(values={}, sizes={})


def followed(network: StaticNetwork, known: Known, changed: Mapping[str, Real] | None) -> Known:
    """Give what is known with what laws make of it, in their order.

    Parameters
    ----------
    network : the network
    known : values, for `changed` those of all signals
    changed : values that differ from those known; only what depends on them is computed. None: everything
    """
    values, sizes = {**known.values, **(changed or {})}, dict(known.sizes)
    sizes.update({name: magnitude(value) for name, value in (changed or {}).items()})
    fresh = set(changed or ())
    for law in network.laws:
        if law.signal is None or (changed is not None and fresh.isdisjoint(law.uses)):
            continue
        if all(name in values for name in law.uses):
            values[law.signal], sizes[law.signal] = (
                shortened(numeric_value(law.right, values)),
                size(law.right, values, sizes),
            )
            fresh.add(law.signal)
    return Known(values=values, sizes=sizes)


def wrong_readings(network: StaticNetwork, seen: Observation, known: Known) -> Iterator[BlockLaw]:
    """Give the readings of an observation that what is known contradicts."""
    read = (item for item in network.readings if item.sensor in seen.sensors)
    told = (item for item in read if known.values.keys() >= {*item.names})
    return (item for item in told if not holds(item, known.values, known.sizes))


def conflicts(network: StaticNetwork, seen: Observation) -> list[frozenset[str]]:
    """Give, for each reading that contradicts the healthy network, the suspects that it follows from.

    They cannot all be healthy. None are given where signals do not simply follow, or the observation lacks `healthy`.
    """
    if not network.is_explicit or seen.healthy is None:
        return []
    wrong = list(wrong_readings(network, seen, seen.healthy))
    if not wrong:
        return []
    before = {} if network.of_blocks else {name: frozenset({name}) for name in network.suspects}
    for law in network.laws:
        own = {law.block} & set(network.suspects) if network.of_blocks else frozenset[str]()
        before[law.signal or ""] = frozenset(own).union(*(before.get(name, ()) for name in law.uses))
    return [frozenset().union(*(before.get(name, ()) for name in item.names)) for item in wrong]
