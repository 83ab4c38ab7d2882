"""Random plants: strokes are consistent, and the order of computation is one that can be computed."""

from collections.abc import Iterable

import casadi as ca
import numpy as np
from hypothesis import HealthCheck, assume, given, settings
from strategies import Mapping, as_text, plants

from faultbond.equations.causality import Causality, assign_causality
from faultbond.equations.constraint_network import ConstraintNetwork, build_network
from faultbond.equations.evaluate import evaluate
from faultbond.equations.inversion import terms
from faultbond.equations.sequence import Assignment, Loop, Step, sequence, slope_name
from faultbond.errors import CausalityError, StructureError
from faultbond.model.expression import Expression, names
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.types import ElementType, JunctionType

slow = [HealthCheck.too_slow, HealthCheck.filter_too_much]  # many random plants have no causality
fast = settings(max_examples=100, deadline=None, suppress_health_check=slow)


def causal(plant: Mapping) -> tuple[BondGraph, Causality]:
    """The graph of a random plant and its causality; plants that have none are passed over."""
    graph = parse_model(as_text(plant))
    try:
        return graph, assign_causality(graph)
    except CausalityError:
        assume(False)
        raise


def ordered(plant: Mapping) -> tuple[BondGraph, ConstraintNetwork, tuple[Step, ...]]:
    """The graph of a random plant, its network and its steps; plants that have none are passed over."""
    graph, causality = causal(plant)
    network = build_network(graph, causality)
    try:
        return graph, network, sequence(network)
    except StructureError:
        assume(False)
        raise


@given(plants())
@fast
def test_one_bond_sets_each_junction(plant: Mapping) -> None:
    """Exactly one bond brings effort to each 0-junction, and takes it from each 1-junction (which sets its flow)."""
    graph, causality = causal(plant)
    strokes = dict(causality.strokes)
    assert set(strokes) == set(range(len(graph.bonds)))
    for junction in graph.junctions:
        bonds = [k for k, bond in enumerate(graph.bonds) if junction.name in (bond.tail, bond.head)]
        received = sum(strokes[k] == junction.name for k in bonds)
        assert (received if junction.type is JunctionType.ZERO else len(bonds) - received) == 1


@given(plants())
@fast
def test_elements_keep_their_causality(plant: Mapping) -> None:
    """Sources give what they are, transformers receive effort once, gyrators twice or never, stores as reported."""
    graph, causality = causal(plant)
    strokes = dict(causality.strokes)
    for item in graph.components:
        bonds = [k for k, bond in enumerate(graph.bonds) if item.name in (bond.tail, bond.head)]
        received = sum(strokes[k] == item.name for k in bonds)
        allowed = {
            ElementType.SE: {0},
            ElementType.SF: {1},
            ElementType.C: {0} if item.name in causality.integral else {1},
            ElementType.I: {1} if item.name in causality.integral else {0},
            ElementType.R: {0, 1},
            ElementType.TF: {1},
            ElementType.GY: {0, 2},
        }
        assert received in allowed[item.type]
    stores = {item.name for item in graph.components if item.type.is_store}
    assert {*causality.integral, *causality.derivative} == stores
    assert len(causality.integral) + len(causality.derivative) == len(stores)


def known_before(graph: BondGraph, network: ConstraintNetwork) -> set[str]:
    """Names whose values are given at every instant."""
    given_ = {*(p.name for p in graph.parameters), *(c.name for c in graph.constants), *(i.name for i in graph.inputs)}
    return given_ | {state.name for state in network.states}


@given(plants())
@fast
def test_each_step_uses_only_what_is_known(plant: Mapping) -> None:
    """Every signal is computed exactly once, from states, inputs, parameters and signals of earlier steps."""
    graph, network, steps = ordered(plant)
    known = known_before(graph, network)
    dependent = {store.name for store in network.dependent}
    computed: list[str] = []

    def learn(signal: str, used: Iterable[str]) -> None:
        assert set(used) <= known, f"{signal} needs {set(used) - known}"
        known.add(signal)
        computed.append(signal)
        if signal in dependent:  # its slopes by the states follow from it
            known.update(slope_name(signal, state.name) for state in network.states)

    for step in steps:
        if isinstance(step, Assignment):
            learn(step.signal, names(step.expression))
            continue
        assert len(step.residuals) == len(step.tears)
        for tear in step.tears:
            learn(tear, names(step.closed) if step.closed is not None else ())
        for part in step.inner:
            learn(part.signal, names(part.expression))
        for residual in step.residuals:
            assert set(names(residual)) <= known
    assert sorted(computed) == sorted(network.signals)


def number(expression: Expression, values: dict[str, float]) -> float:
    """Value of an expression; nan or inf where it has none."""
    return float(evaluate(expression, {name: ca.SX(value) for name, value in values.items()}))


def linear_tears(loop: Loop, values: dict[str, float]) -> dict[str, float]:
    """Tears of a linear loop, from its misfit at zero and at each unit; loops that are not linear are passed over."""

    def misfit(tears: np.ndarray) -> np.ndarray:
        trial = values | dict(zip(loop.tears, tears.tolist(), strict=True))
        for part in loop.inner:
            trial[part.signal] = number(part.expression, trial)
        return np.array([number(residual, trial) for residual in loop.residuals])

    zero = misfit(np.zeros(len(loop.tears)))
    with np.errstate(invalid="ignore"):  # of loops that have no value there, which are passed over
        slope = np.array([misfit(unit) - zero for unit in np.eye(len(loop.tears))]).T
    assume(np.all(np.isfinite(slope)) and np.linalg.cond(slope) < 1e8)
    found = np.linalg.solve(slope, -zero)
    assume(np.max(np.abs(misfit(found))) <= 1e-9 * np.max(np.abs(zero)) + 1e-12)
    return dict(zip(loop.tears, found.tolist(), strict=True))


@given(plants())
@fast
def test_solution_satisfies_every_law(plant: Mapping) -> None:
    """Computed step by step with random numbers, the signals satisfy every law and every junction sum."""
    graph, network, steps = ordered(plant)
    assume(not network.dependent)
    generator = np.random.default_rng(1)
    values = {name: float(generator.uniform(0.5, 2.0)) for name in sorted(known_before(graph, network))}
    for step in steps:
        if isinstance(step, Assignment):
            values[step.signal] = number(step.expression, values)
            continue
        if step.closed is not None:
            values[step.tears[0]] = number(step.closed, values)
        else:
            values |= linear_tears(step, values)
        for part in step.inner:
            values[part.signal] = number(part.expression, values)
    assume(all(np.isfinite(value) and abs(value) < 1e4 for value in values.values()))
    for constraint in network.constraints:
        size = sum(abs(number(term, values)) for term in terms(constraint.residual))
        misfit = number(constraint.residual, values)  # nan for e/f = X at rest
        assert np.isnan(misfit) or abs(misfit) <= 1e-6 * size + 1e-9
