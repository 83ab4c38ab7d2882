"""A logic network in integers: order, cones, many simulations at once, dominators.

A word is an integer whose bit k is the value of a signal in case k; so one pass over the gates simulates all cases.
"""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from graphlib import CycleError, TopologicalSorter

from faultbond.errors import StructureError
from faultbond.model.logic import GateFunction, LogicNetwork

NOWHERE = -1  # immediate dominator of a signal that is seen, or leads to what is seen by separate ways
UNSEEN = -2  # while dominators are sought: leads nowhere, as far as is known
CONSTANTS = (GateFunction.AND, GateFunction.OR)  # without inputs: 1 and 0

_INVERTED = {
    GateFunction.NAND: GateFunction.AND,
    GateFunction.NOR: GateFunction.OR,
    GateFunction.XNOR: GateFunction.XOR,
    GateFunction.NOT: GateFunction.XOR,
}


@dataclass(frozen=True, slots=True)
class NumberedGate:
    """A gate: and, or, xor of the signals `inputs`, inverted or not; `component` None where it is trusted."""

    output: int
    function: GateFunction
    inverted: bool
    inputs: tuple[int, ...]
    component: str | None


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Circuit:
    """Signals numbered, inputs first, then the outputs of `nodes`, which stand in causal order."""

    names: tuple[str, ...]
    n_inputs: int
    nodes: tuple[NumberedGate, ...]

    def node(self, signal: int) -> NumberedGate:
        """Give the gate that drives a signal; inputs have none."""
        return self.nodes[signal - self.n_inputs]


def build_circuit(network: LogicNetwork, seen: Iterable[str]) -> Circuit:
    """Number the signals of a network and put its gates in causal order.

    Parameters
    ----------
    network : gates between named signals
    seen : names of the observed signals; what does not lead to them is left out

    Raises
    ------
    StructureError
        When a signal is set twice or not at all, a gate has no inputs, or gates form a loop.
    """
    drivers: dict[str, int] = {}  # the gate that sets a signal, by its place
    inputs = set(network.inputs)
    for place, gate in enumerate(network.gates):
        signal, count = gate.output, len(gate.inputs)
        if signal in drivers or signal in inputs:
            other = network.gates[drivers[signal]].name if signal in drivers else "an input"
            raise StructureError(f"{network.name}: signal {signal} is set by {gate.name} and by {other}. Keep one.")
        if count != 1 and (gate.function.is_unary or (count == 0 and gate.function not in CONSTANTS)):
            raise StructureError(
                f"{network.name}: {gate.function.value} {gate.name} has {count} inputs; "
                f"it needs {'one' if gate.function.is_unary else 'at least one'}."
            )
        drivers[signal] = place
    order = _causal_order(network, drivers, seen)
    names = (*network.inputs, *order)
    number = {name: index for index, name in enumerate(names)}
    nodes = []
    for signal in order:
        gate = network.gates[drivers[signal]]
        function = GateFunction.XOR if gate.function.is_unary else _INVERTED.get(gate.function, gate.function)
        sources = tuple(number[name] for name in gate.inputs)
        component = None if gate.trusted else gate.name
        nodes.append(NumberedGate(number[signal], function, gate.function in _INVERTED, sources, component))
    return Circuit(names=names, n_inputs=len(network.inputs), nodes=tuple(nodes))


def _causal_order(network: LogicNetwork, drivers: Mapping[str, int], seen: Iterable[str]) -> list[str]:
    """Give the signals set by gates that what is seen depends on, each after those that it is made of."""
    inputs = set(network.inputs)
    needed: dict[str, tuple[str, ...]] = {}
    waiting = [*seen]
    while waiting:
        signal = waiting.pop()
        if signal in needed or signal in inputs:
            continue
        if signal not in drivers:
            raise StructureError(f"{network.name}: nothing sets signal {signal}. Make it an input or a gate's output.")
        needed[signal] = network.gates[drivers[signal]].inputs
        waiting.extend(needed[signal])
    try:
        return [signal for signal in TopologicalSorter(needed).static_order() if signal in needed]
    except CycleError as problem:
        around = dict.fromkeys(network.gates[drivers[signal]].name for signal in problem.args[1])
        raise StructureError(
            f"{network.name}: gates {', '.join(around)} form a loop. Cut it: a logic network has no memory."
        ) from problem


def simulate_gates(
    circuit: Circuit, inputs: Sequence[int], full: int, flips: Mapping[int, int] | None = None
) -> list[int]:
    """Give the word of every signal.

    Parameters
    ----------
    circuit : what to simulate
    inputs : word of each input
    full : the word of ones, one for each case
    flips : by signal, the cases in which its gate gives the opposite of what it should
    """
    words = [*inputs, *([0] * len(circuit.nodes))]
    flips = flips or {}
    for node in circuit.nodes:
        words[node.output] = gate_word(node, words, full) ^ flips.get(node.output, 0)
    return words


def gate_word(node: NumberedGate, words: Sequence[int] | Mapping[int, int], full: int) -> int:
    """Give the word that a healthy gate makes of the words of its inputs."""
    match node.function:
        case GateFunction.AND:
            result = full
            for signal in node.inputs:
                result &= words[signal]
        case GateFunction.OR:
            result = 0
            for signal in node.inputs:
                result |= words[signal]
        case _:
            result = 0
            for signal in node.inputs:
                result ^= words[signal]
    return result ^ full if node.inverted else result


def dominators(circuit: Circuit, seen: Iterable[int]) -> list[int]:
    """Give each signal's immediate dominator: the next signal that all its ways to what is seen have in common.

    Parameters
    ----------
    circuit : signals in causal order
    seen : observed signals

    Source
    ------
    Cooper, Harvey, Kennedy 2001, "A simple, fast dominance algorithm", on the reversed graph, which has no cycles.
    """
    above = [UNSEEN] * len(circuit.names)
    depth = [0] * len(circuit.names)
    for signal in seen:
        above[signal] = NOWHERE
    for node in reversed(circuit.nodes):  # all readers of a signal come before the gate that sets it
        if above[node.output] == UNSEEN:
            continue
        depth[node.output] = 1 + (depth[above[node.output]] if above[node.output] != NOWHERE else 0)
        for signal in node.inputs:
            if above[signal] == UNSEEN:
                above[signal] = node.output
            else:
                above[signal] = _common(above[signal], node.output, above, depth)
    return [max(item, NOWHERE) for item in above]


def _common(one: int, other: int, above: Sequence[int], depth: Sequence[int]) -> int:
    """Give the nearest signal that dominates both, themselves included."""
    while one != other and NOWHERE not in (one, other):
        if depth[one] >= depth[other]:
            one = above[one]
        else:
            other = above[other]
    return one if one == other else NOWHERE
