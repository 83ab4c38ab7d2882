"""Logic networks: what a healthy one gives, and all smallest sets of gates that explain what was seen.

Weak fault models: an abnormal gate's output is anything, anew in every observation. Source: thesis 3.6; Reiter, "A
theory of diagnosis from first principles" (1987); de Kleer and Williams, "Diagnosing multiple faults" (1987).
"""

import time
from collections.abc import Iterable
from itertools import product
from math import prod

from faultbond.errors import StructureError
from faultbond.model.expression import NOT, Binary, Call, Expression, Name, Number
from faultbond.model.graph import BondGraph
from faultbond.model.logic import Gate, GateFunction, GateSet, LogicNetwork, SignalValues
from faultbond.networks.logic.answers import Case, smallest_sets
from faultbond.networks.logic.circuit import Circuit, build_circuit, simulate_gates
from faultbond.networks.logic.regions import exchanges, find_regions

TIME_LIMIT = 60.0  # s
MAX_DIAGNOSES = 1_000_000
MAX_OPEN = 20  # signals of which `explains` tries every combination

_OPERATORS = {"&": GateFunction.AND, "|": GateFunction.OR, "^": GateFunction.XOR}
_CONSTANTS = {0.0: GateFunction.OR, 1.0: GateFunction.AND}  # of no inputs


def predict(network: LogicNetwork, inputs: SignalValues) -> dict[str, bool]:
    """Give the value of every signal of the healthy network.

    Parameters
    ----------
    network : gates between signals
    inputs : value of each input of the network; other keys are ignored

    Raises
    ------
    StructureError
        When an input has no value, or the network is not sound: a loop of gates, a signal set twice or not at all.
    """
    circuit = build_circuit(network, [gate.output for gate in network.gates])
    missing = [name for name in network.inputs if name not in inputs]
    if missing:
        raise StructureError(f"{network.name}: no value of input {', '.join(missing)}. Give one.")
    words = simulate_gates(circuit, [int(inputs[name]) for name in network.inputs], 1)
    return {name: bool(word) for name, word in zip(circuit.names, words, strict=True)}


def minimum_diagnoses(
    network: LogicNetwork, observations: Iterable[SignalValues], *, time_limit: float = TIME_LIMIT
) -> tuple[GateSet, ...]:
    """Give all diagnoses of minimum cardinality that agree with every observation.

    The empty diagnosis is the only one of a healthy network; there is none where no set of suspects explains what was
    seen. In the order of the network's gates.

    Parameters
    ----------
    network : gates between signals
    observations : values of signals, inputs among them; an input without value may have had any
    time_limit : s

    Raises
    ------
    StructureError
        When the network is not sound, an observed signal is unknown, the time is over, or there are more diagnoses
        than fit in memory.
    """
    deadline = time.perf_counter() + time_limit
    circuit, cases = _numbered(network, observations)
    open_cases = list(dict.fromkeys(case for case in cases if not _is_healthy(circuit, case)))
    if not open_cases:
        return (frozenset(),)
    suspects = [node.component for node in circuit.nodes if node.component is not None]
    each_once = list(dict.fromkeys(suspects))
    if len(open_cases) == 1 and None not in open_cases[0].inputs and len(suspects) == len(each_once):
        sets = _by_regions(circuit, open_cases[0], deadline)
    else:
        sets = smallest_sets(circuit, open_cases, each_once, strict=False, deadline=deadline)
    names = network.suspects
    place = {name: index for index, name in enumerate(names)}
    ordered = sorted(tuple(sorted(place[name] for name in found)) for found in sets)
    return tuple(frozenset(names[index] for index in indices) for indices in ordered)


def explains(network: LogicNetwork, abnormal: GateSet, observations: Iterable[SignalValues]) -> bool:
    """Whether every observation agrees with these components being abnormal: all that they could give is tried.

    Parameters
    ----------
    network : gates between signals
    abnormal : names of components; those that are trusted stay healthy
    observations : values of signals; an input without value may have had any

    Raises
    ------
    StructureError
        When the network is not sound, an observed signal is unknown, or there are too many ways to try.
    """
    circuit, cases = _numbered(network, observations)
    flippable = [node.output for node in circuit.nodes if node.component in abnormal]
    for case in cases:
        unknown = [signal for signal, value in enumerate(case.inputs) if value is None]
        if len(flippable) + len(unknown) > MAX_OPEN:
            raise StructureError(
                f"{len(flippable)} abnormal gates and {len(unknown)} unknown inputs leave more than 2^{MAX_OPEN} ways. "
                "Ask for fewer."
            )
        full = (1 << (1 << (len(flippable) + len(unknown)))) - 1
        # Words whose bits together take every combination: 0101.., 0011.., and so on.
        periods = [(signal, 1 << k) for k, signal in enumerate((*flippable, *unknown))]
        words = {signal: full // ((1 << 2 * period) - 1) * ((1 << period) - 1) for signal, period in periods}
        inputs = [words.get(signal, full if value else 0) for signal, value in enumerate(case.inputs)]
        given = simulate_gates(circuit, inputs, full, words)
        agree = full
        for signal, value in case.seen:
            agree &= given[signal] if value else ~given[signal]
        if not agree:
            return False
    return True


def logic_network(graph: BondGraph) -> LogicNetwork:
    """Give the gates of a block network of logic; a sensor is a signal of its own name.

    Parameters
    ----------
    graph : block network whose inputs and sensors have the unit logic

    Raises
    ------
    StructureError
        When a law is not of the form `signal = expression`.
    """
    signals = set(graph.block_signals)
    suspects = set(graph.suspect_blocks)
    gates: list[Gate] = []
    for component in graph.components:
        for law in component.laws:
            if not isinstance(law.left, Name) or law.left.text not in signals:
                raise StructureError(
                    f"{graph.file}:{law.line}: block {component.name}: a law of logic sets a signal, as in "
                    "`c = y | z`. Write that signal on its left."
                )
            trusted = component.name not in suspects
            gates += _gates(component.name, law.left.text, law.right, trusted)
    for sensor in graph.sensors:
        if sensor.reads != Name(sensor.name):
            gates += _gates(sensor.name, sensor.name, sensor.reads, trusted=True)
    return LogicNetwork(
        name=graph.name,
        gates=tuple(gates),
        inputs=tuple(item.name for item in graph.inputs),
        outputs=tuple(item.name for item in graph.sensors),
    )


def _numbered(network: LogicNetwork, observations: Iterable[SignalValues]) -> tuple[Circuit, list[Case]]:
    """Give what the observed signals depend on, and the observations by the numbers of their signals."""
    rows = tuple(observations)
    seen = dict.fromkeys(name for row in rows for name in row if name not in network.inputs)
    circuit = build_circuit(network, seen)
    number = {name: index for index, name in enumerate(circuit.names)}
    inputs = circuit.names[: circuit.n_inputs]
    return circuit, [
        Case(
            inputs=tuple(row.get(name) for name in inputs),
            seen=tuple(sorted((number[name], value) for name, value in row.items() if number[name] >= len(inputs))),
        )
        for row in rows
    ]


def _is_healthy(circuit: Circuit, case: Case) -> bool:
    """Whether the healthy circuit gives what was seen, unknown inputs taken as 0; then the case rules nothing out."""
    words = simulate_gates(circuit, [int(bool(value)) for value in case.inputs], 1)
    return all(words[signal] == value for signal, value in case.seen)


def _by_regions(circuit: Circuit, case: Case, deadline: float) -> list[tuple[str, ...]]:
    """Give the smallest diagnoses of one observation: sets of roots, and what each root may be exchanged for."""
    regions = find_regions(circuit, [signal for signal, _ in case.seen])
    roots = {
        node.component: node.output
        for node in circuit.nodes
        if node.component is not None and regions.root[node.output] == node.output
    }
    sets = smallest_sets(circuit, [case], list(roots), strict=True, deadline=deadline)
    signals = [[roots[name] for name in names] for names in sets]
    choices = exchanges(circuit, regions, [bool(value) for value in case.inputs], signals)
    count = sum(prod(map(len, choice)) for choice in choices)
    if count > MAX_DIAGNOSES:
        raise StructureError(f"{count} diagnoses of {len(sets[0])} gates each are too many. Observe more signals.")
    owner = [*([""] * circuit.n_inputs), *(node.component or "" for node in circuit.nodes)]
    return [tuple(owner[signal] for signal in members) for choice in choices for members in product(*choice)]


def _gates(name: str, output: str, expression: Expression, trusted: bool) -> list[Gate]:
    """Give the gate that sets `output`, after trusted ones for the parts of its expression."""
    gates: list[Gate] = []

    def place(part: Expression, outermost: bool) -> str:
        arguments: tuple[Expression, ...]
        match part:
            case Name(text) if not outermost:
                return text
            case Name():
                function, arguments = GateFunction.BUFFER, (part,)
            case Number(value) if value in _CONSTANTS:
                function, arguments = _CONSTANTS[value], ()
            case Call(called, arguments) if called == NOT:
                function = GateFunction.NOT
            case Binary(operator, left, right) if operator in _OPERATORS:
                function, arguments = _OPERATORS[operator], (left, right)
            case _:
                raise StructureError(f"{part} is not logic. Write signals, 0, 1 and the operators & | ^ ~.")
        inputs = tuple(place(argument, False) for argument in arguments)
        signal = output if outermost else f"{output}.{len(gates)}"  # no name of a user has a dot
        gates.append(Gate(name=name, function=function, output=signal, inputs=inputs, trusted=trusted or not outermost))
        return signal

    place(expression, True)
    return gates
