"""The plant in continuous time: rates of the states and readings of the sensors as SX graphs.

    dx/dt = rates(x, u, theta, b),  y = readings(x, u, theta, b)

x: stored quantities; u: inputs; theta: parameters; b: slow errors; all SI (relative slow errors as fractions).
"""

from collections.abc import Iterator
from dataclasses import dataclass

import casadi as ca

from faultbond.equations.causality import Causality, assign_causality
from faultbond.equations.constraint_network import ConstraintNetwork, Store, build_network
from faultbond.equations.evaluate import evaluate
from faultbond.equations.inversion import isolate
from faultbond.equations.linear import eliminate
from faultbond.equations.sequence import Assignment, Loop, Step, sequence, slope_name
from faultbond.model.expression import Binary, Name, names
from faultbond.model.graph import BondGraph, SlowError


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class CoEnergy:
    """The effort of a C, or flow of an I, as a coordinate in place of its content.

    value: of the content x and theta; content: of `symbol` and theta, the inverse.
    """

    name: str
    value: ca.SX
    symbol: ca.SX
    content: ca.SX


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Plant:
    """Symbols and graphs of a plant.

    x (n_states, 1), u (n_inputs, 1), theta (n_parameters, 1), b (n_slow_errors, 1): column symbols, SI. z: symbols of
    implicitly solved signals, with `gap(x, u, theta, b, z) = 0`; signals that have a closed form are not among them.
    rates (n_states, 1), readings (n_outputs, 1), by_hand (n_signals, 1), what a person can measure: functions of all
    symbols.
    """

    graph: BondGraph
    causality: Causality
    network: ConstraintNetwork
    steps: tuple[Step, ...]
    x: ca.SX
    u: ca.SX
    theta: ca.SX
    b: ca.SX
    z: ca.SX
    rates: ca.SX
    readings: ca.SX
    by_hand: ca.SX
    gap: ca.SX
    implicit: tuple[str, ...]
    co_energy: tuple[CoEnergy | None, ...]  # per state: effort of a C, flow of an I; None: its content is the state


def build_plant(graph: BondGraph) -> Plant:
    """Give the continuous-time equations of a bond graph.

    Raises
    ------
    CausalityError, StructureError
        Where causes conflict, or equations and signals do not balance.
    """
    causality = assign_causality(graph)
    network = build_network(graph, causality)
    steps = sequence(network, graph.file)
    x = _column("x", len(network.states))
    u = _column("u", len(graph.inputs))
    theta = _column("theta", len(graph.parameters))
    b = _column("b", len(graph.slow_errors))
    values: dict[str, ca.SX] = {item.name: ca.SX(item.value) for item in graph.constants}
    values |= {item.name: u[k] for k, item in enumerate(graph.inputs)}
    values |= {item.name: theta[k] for k, item in enumerate(graph.parameters)}
    usual = values.copy()
    values |= {item.target: values[item.target] + scale * b[k] for k, item, scale in _wanders(graph)}
    states = {state.name: x[k] for k, state in enumerate(network.states)}
    values |= states
    usual |= states
    solver = _Solver(network, values, x, b)
    for step in steps:
        solver.take(step)
    readings = []
    for sensor, expression in zip(graph.sensors, network.readings, strict=True):
        readings.append(_in_error(network, sensor.name, evaluate(expression, values), b))
    return Plant(
        graph=graph,
        causality=causality,
        network=network,
        steps=steps,
        x=x,
        u=u,
        theta=theta,
        b=b,
        z=ca.vertcat(*solver.unknowns) if solver.unknowns else ca.SX(0, 1),
        rates=ca.vertcat(*(values[state.rate] for state in network.states)) if network.states else ca.SX(0, 1),
        readings=ca.vertcat(*readings),
        by_hand=ca.vertcat(*(evaluate(item, values) for item in network.by_hand)) if network.by_hand else ca.SX(0, 1),
        gap=ca.vertcat(*solver.gaps) if solver.gaps else ca.SX(0, 1),
        implicit=tuple(solver.implicit),
        co_energy=tuple(_co_energy(store, graph, network, steps, usual) for store in network.states),
    )


def _co_energy(
    store: Store, graph: BondGraph, network: ConstraintNetwork, steps: tuple[Step, ...], values: dict[str, ca.SX]
) -> CoEnergy | None:
    """Give the co-energy of a store whose law holds nothing but content, co-energy, parameters and constants.

    None where a sensor reads the content itself, at once or with a lag: docs/decisions/005-filter-states.md.
    """
    if any(store.name in names(what) for what in network.sensed):
        return None
    places = {item.name for item in network.states if item.partner is None}  # integrals, such as a position
    own = {store.name, *places, *(item.name for item in graph.parameters), *(item.name for item in graph.fixed)}
    step = next((s for s in steps if isinstance(s, Assignment) and s.signal == store.partner), None)
    if step is None or step.owner != store.component or not set(names(step.expression)) <= own:
        return None
    partner = str(store.partner)
    content = isolate(Binary("-", Name(partner), step.expression), store.name)
    if content is None:
        return None
    symbol = ca.SX.sym(partner)
    return CoEnergy(
        name=partner,
        value=evaluate(step.expression, values),
        symbol=symbol,
        content=evaluate(content, {**values, partner: symbol}),
    )


def _column(name: str, size: int) -> ca.SX:
    return ca.SX.sym(name, size) if size else ca.SX(0, 1)


def _in_error(network: ConstraintNetwork, name: str, value: ca.SX, b: ca.SX) -> ca.SX:
    """Give the value of a signal or sensor with its own slow errors."""
    for k, error in enumerate(network.slow_errors):
        if error.target == name and not error.wanders:
            value = value * (1 + b[k]) if error.relative else value + b[k]
    return value


def _wanders(graph: BondGraph) -> Iterator[tuple[int, SlowError, float]]:
    """Give what wanders, with its place in b, and what 1 of that is, SI: see docs/decisions/022-wandering.md."""
    nominals = {item.name: item.nominal for item in graph.parameters}
    for k, item in enumerate(graph.slow_errors):
        if item.wanders:
            yield k, item, nominals[item.target] if item.relative else 1.0


class _Solver:
    """Takes the steps in order and fills in the graph of each signal.

    A slow error acts on a signal after the signal is solved: what reads it from then on sees it in error, the relations
    that gave it do not (else a loop would absorb the error).
    """

    def __init__(self, network: ConstraintNetwork, values: dict[str, ca.SX], x: ca.SX, b: ca.SX) -> None:
        self.network = network
        self.values = values
        self.x = x
        self.b = b
        self.unknowns: list[ca.SX] = []
        self.gaps: list[ca.SX] = []
        self.implicit: list[str] = []
        self.dependent = {store.name: store for store in network.dependent}

    def take(self, step: Step) -> None:
        """Add the signals of one step."""
        if isinstance(step, Assignment):
            self._set(step.signal, evaluate(step.expression, self.values))
        else:
            for tear, value in zip(step.tears, self._solve(step), strict=True):
                self._set(tear, value)
            for part in step.inner:
                self._set(part.signal, evaluate(part.expression, self.values))

    def _set(self, signal: str, value: ca.SX) -> None:
        value = _in_error(self.network, signal, value, self.b)
        self.values[signal] = value
        if signal in self.dependent:
            slopes = self._slopes(value)
            for k, state in enumerate(self.network.states):
                self.values[slope_name(signal, state.name)] = slopes[0, k]

    def _slopes(self, value: ca.SX) -> ca.SX:
        """Derivatives by the states, also through the implicit signals found so far."""
        slopes = ca.jacobian(value, self.x)
        if not self.unknowns:
            return slopes
        z, gap = ca.vertcat(*self.unknowns), ca.vertcat(*self.gaps)
        through = eliminate(ca.jacobian(gap, z), ca.jacobian(gap, self.x))
        return slopes - ca.jacobian(value, z) @ through

    def _solve(self, loop: Loop) -> list[ca.SX]:
        if loop.closed is not None:
            return [evaluate(loop.closed, self.values)]
        guesses = [ca.SX.sym(f"z_{tear}") for tear in loop.tears]
        trial = {**self.values, **dict(zip(loop.tears, guesses, strict=True))}
        for part in loop.inner:
            trial[part.signal] = evaluate(part.expression, trial)
        gap = ca.vertcat(*(evaluate(residual, trial) for residual in loop.residuals))
        column = ca.vertcat(*guesses)
        slope = ca.jacobian(gap, column)
        if not ca.depends_on(slope, column):
            return ca.vertsplit(eliminate(slope, -ca.substitute(gap, column, ca.SX.zeros(column.shape))))
        self.unknowns += guesses
        self.gaps += ca.vertsplit(gap)
        self.implicit += loop.tears
        return guesses
