"""Smallest diagnoses of random logic networks against trying every set and every value."""

import time
from collections.abc import Callable, Mapping, Sequence
from itertools import combinations, product

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.model.logic import Gate, GateFunction, GateSet, LogicNetwork, SignalValues
from faultbond.networks.logic.answers import Case, smallest_sets
from faultbond.networks.logic.circuit import build_circuit
from faultbond.networks.logic.diagnoses import explains, minimum_diagnoses, predict
from made_circuits import made_scenario, random_circuit

MAX_GATES = 6


@st.composite
def networks(draw: st.DrawFn, *, shared: bool = False) -> LogicNetwork:
    """Draw a network of few gates, some of them trusted; with `shared` some fail together."""
    inputs = tuple(f"i{number}" for number in range(draw(st.integers(1, 3))))
    signals = list(inputs)
    gates = []
    for number in range(draw(st.integers(1, MAX_GATES))):
        function = draw(st.sampled_from(list(GateFunction)))
        count = 1 if function.is_unary else draw(st.integers(1, 3))
        sources = tuple(draw(st.sampled_from(signals)) for _ in range(count))
        name = f"g{draw(st.integers(0, number)) if shared else number}"
        trusted = draw(st.integers(0, 4)) == 0
        gates.append(Gate(name=name, function=function, output=f"z{number}", inputs=sources, trusted=trusted))
        signals.append(f"z{number}")
    shuffled = draw(st.permutations(gates))
    return LogicNetwork(name="drawn", gates=tuple(shuffled), inputs=inputs, outputs=())


@st.composite
def observed(draw: st.DrawFn, network: LogicNetwork, *, inputs_known: bool = True) -> dict[str, bool]:
    """Draw an observation of all inputs, or some, and of some other signals."""
    others = [gate.output for gate in network.gates]
    seen = draw(st.lists(st.sampled_from(others), min_size=1, max_size=4, unique=True))
    given_inputs = network.inputs if inputs_known else draw(st.lists(st.sampled_from(network.inputs), unique=True))
    return {name: draw(st.booleans()) for name in (*given_inputs, *seen)}


FORMULAS: dict[GateFunction, Callable[[Sequence[bool]], bool]] = {
    GateFunction.AND: all,
    GateFunction.OR: any,
    GateFunction.NAND: lambda values: not all(values),
    GateFunction.NOR: lambda values: not any(values),
    GateFunction.XOR: lambda values: sum(values) % 2 == 1,
    GateFunction.XNOR: lambda values: sum(values) % 2 == 0,
    GateFunction.NOT: lambda values: not values[0],
    GateFunction.BUFFER: lambda values: values[0],
}


def possible(network: LogicNetwork, abnormal: GateSet, seen: SignalValues) -> bool:
    """Whether some values of all signals agree with the healthy gates and with what was seen."""
    names = [*network.inputs, *(gate.output for gate in network.gates)]
    healthy = [gate for gate in network.gates if gate.trusted or gate.name not in abnormal]
    for values in product([False, True], repeat=len(names)):
        case = dict(zip(names, values, strict=True))
        if all(case[name] == value for name, value in seen.items()) and all(
            FORMULAS[gate.function]([case[name] for name in gate.inputs]) == case[gate.output] for gate in healthy
        ):
            return True
    return False


def tried(network: LogicNetwork, rows: Sequence[SignalValues]) -> set[GateSet]:
    """Give all smallest sets by trying every one."""
    for size in range(len(network.suspects) + 1):
        sets = map(frozenset, combinations(network.suspects, size))
        found = {item for item in sets if all(possible(network, item, row) for row in rows)}
        if found:
            return found
    return set()


def check(network: LogicNetwork, rows: Sequence[Mapping[str, bool]]) -> None:
    """Compare, each diagnosis being given once."""
    found = minimum_diagnoses(network, rows)
    assert len(found) == len(set(found))
    assert set(found) == tried(network, rows)


@settings(max_examples=100, deadline=None)
@given(st.data())
def test_one_observation(data: st.DataObject) -> None:
    """With all inputs known: regions and exchanges lose nothing and add nothing."""
    network = data.draw(networks())
    check(network, [data.draw(observed(network))])


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_several_observations(data: st.DataObject) -> None:
    """The same gates for all rows, other values in each; unknown inputs too."""
    network = data.draw(networks())
    check(network, [data.draw(observed(network, inputs_known=data.draw(st.booleans()))) for _ in range(2)])


@settings(max_examples=40, deadline=None)
@given(st.data())
def test_gates_that_fail_together(data: st.DataObject) -> None:
    """A component of several gates counts once."""
    network = data.draw(networks(shared=True))
    check(network, [data.draw(observed(network))])


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_what_explains(data: st.DataObject) -> None:
    """`explains` agrees with trying all values of all signals."""
    network = data.draw(networks(shared=True))
    row = data.draw(observed(network, inputs_known=data.draw(st.booleans())))
    abnormal = frozenset(data.draw(st.lists(st.sampled_from(network.suspects or ("none",)), max_size=3)))
    assert explains(network, abnormal, [row]) == possible(network, abnormal, row)


@settings(max_examples=50, deadline=None)
@given(st.data())
def test_prediction(data: st.DataObject) -> None:
    """What a healthy network gives is the only way for all its signals."""
    network = data.draw(networks())
    inputs = {name: data.draw(st.booleans()) for name in network.inputs}
    values = predict(network, inputs)
    assert possible(network, frozenset(), values)
    name = data.draw(st.sampled_from([gate.output for gate in network.gates]))
    assert not possible(network, frozenset(), values | {name: not values[name]})


@pytest.mark.parametrize("xor", [0.0, 0.4])
@pytest.mark.parametrize("n_faults", [1, 2, 3])
def test_regions_agree_with_all_gates(xor: float, n_faults: int) -> None:
    """On circuits of 60 gates: the search over roots, exchanged, gives what the search over all gates gives."""
    network = random_circuit(12, 60, 6, seed=n_faults, xor=xor)
    _, after, injected = made_scenario(network, n_faults, seed=n_faults)
    circuit = build_circuit(network, network.outputs)
    found = minimum_diagnoses(network, [after])
    case = Case(
        inputs=tuple(after[name] for name in network.inputs),
        seen=tuple((circuit.names.index(name), after[name]) for name in network.outputs),
    )
    everything = smallest_sets(circuit, [case], network.suspects, strict=False, deadline=time.perf_counter() + 60)
    assert set(found) == {frozenset(item) for item in everything}
    assert all(explains(network, item, [after]) for item in found)
    assert len(found[0]) <= len(injected)
