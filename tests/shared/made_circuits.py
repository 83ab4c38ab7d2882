"""Circuits made up in the likeness of well-known ones: random ones, a multiplier of nor cells, an error corrector."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from faultbond.model.logic import Gate, GateFunction, GateSet, LogicNetwork
from faultbond.networks.logic.circuit import build_circuit, simulate_gates

TRIES = 40  # scenarios of which the one with the most wrong outputs is kept
KINDS = ("and", "nand", "nand", "or", "nor")


@dataclass(frozen=True, slots=True)
class Maker:
    """Gates under way, each named by its number."""

    gates: list[Gate] = field(default_factory=list)

    def add(self, function: str, *inputs: str) -> str:
        """Add a gate and give the signal that it sets."""
        number = len(self.gates) + 1
        self.gates.append(
            Gate(name=f"gate{number}", function=GateFunction(function), output=f"z{number}", inputs=inputs)
        )
        return f"z{number}"

    def network(self, name: str, inputs: Sequence[str], outputs: Sequence[str]) -> LogicNetwork:
        """Give the finished network."""
        return LogicNetwork(name=name, gates=tuple(self.gates), inputs=tuple(inputs), outputs=tuple(outputs))


def random_circuit(n_inputs: int, n_gates: int, n_outputs: int, seed: int, xor: float = 0.05) -> LogicNetwork:
    """Give a random circuit whose gates read near signals mostly; a share `xor` of those with two inputs is xor.

    Every signal leads to an output; their number is about `n_outputs`, for small circuits it may be more.
    """
    random = np.random.default_rng(seed)
    maker = Maker()
    inputs = [f"i{number + 1}" for number in range(n_inputs)]
    signals, unread = [*inputs], dict.fromkeys(inputs)
    reach = max(20, n_gates // 6)
    for _ in range(n_gates):
        count = int(random.choice((1, 2, 2, 2, 3, 4)))
        chosen: dict[str, None] = {}
        while len(chosen) < count:
            pool = signals[-reach:]
            if unread and random.random() < (0.95 if len(unread) > n_outputs + n_inputs // 4 else 0.1):
                pool = list(unread)[-reach:] if random.random() < 0.7 else list(unread)
            chosen[pool[random.integers(len(pool))]] = None
            count = min(count, len(signals))
        function = _function(random, len(chosen), xor)
        signal = maker.add(function, *chosen)
        for item in chosen:
            unread.pop(item, None)
        signals.append(signal)
        unread[signal] = None
    return maker.network(f"random{n_gates}", inputs, [signal for signal in unread if signal not in inputs])


def _function(random: np.random.Generator, count: int, xor: float) -> str:
    """Draw the function of a gate."""
    if count == 1:
        return str(random.choice(("not", "buffer")))
    return "xor" if count == 2 and random.random() < xor else str(random.choice(KINDS))


def multiplier(width: int) -> LogicNetwork:
    """Give an array multiplier of adders made of nors."""
    maker = Maker()
    left, right = ([f"{letter}{number}" for number in range(width)] for letter in "ab")
    row: list[str] = [maker.add("and", item, right[0]) for item in left]
    outputs, top = [row.pop(0)], ""
    for factor in right[1:]:
        products = [maker.add("and", item, factor) for item in left]
        sums, carry = [], ""
        for product, above in zip(products, [*row, top], strict=True):
            terms = [item for item in (product, above, carry) if item]
            total, carry = _add(maker, terms)
            sums.append(total)
        outputs.append(sums[0])
        row, top = sums[1:], carry
    return maker.network(f"multiplier{width}", [*left, *right], [*outputs, *row, top])


def _add(maker: Maker, terms: Sequence[str]) -> tuple[str, str]:
    """Give sum and carry of one to three terms."""
    if len(terms) == 1:
        return terms[0], ""
    neither = maker.add("nor", *terms[:2])
    if len(terms) == 2:
        both = maker.add("and", *terms)
        return maker.add("nor", neither, both), both
    equal = maker.add("nor", *(maker.add("nor", term, neither) for term in terms[:2]))
    none = maker.add("nor", equal, terms[2])
    total = maker.add("nor", maker.add("nor", equal, none), maker.add("nor", terms[2], none))
    return total, maker.add("nor", neither, none)


def corrector(width: int, *, nands: bool) -> LogicNetwork:
    """Give an error corrector: parities of words, decoded, and the wrong bit turned; xor as gates or made of nands."""
    maker = Maker()
    data, checks = ([f"{letter}{number}" for number in range(count)] for letter, count in (("d", width), ("p", 8)))

    def xor(one: str, other: str) -> str:
        if not nands:
            return maker.add("xor", one, other)
        middle = maker.add("nand", one, other)
        return maker.add("nand", maker.add("nand", one, middle), maker.add("nand", other, middle))

    def parity(words: Sequence[str]) -> str:
        while len(words) > 1:
            words = [xor(*words[at : at + 2]) if at + 1 < len(words) else words[at] for at in range(0, len(words), 2)]
        return words[0]

    def covers(bit: int, check: int) -> bool:
        return (7 * bit + 3 * check) % 8 < 3

    wrong = [
        parity([*(word for bit, word in enumerate(data) if covers(bit, check)), maker.add("and", checks[check], "on")])
        for check in range(8)
    ]
    right = [maker.add("not", signal) for signal in wrong]
    outputs = []
    for bit, word in enumerate(data):
        pattern = [(wrong if covers(bit, check) else right)[check] for check in range(8)]
        outputs.append(xor(word, maker.add("and", *pattern)))
    return maker.network(f"corrector{width}{'n' if nands else ''}", [*data, *checks, "on"], outputs)


def observe(network: LogicNetwork, abnormal: GateSet, inputs: dict[str, bool]) -> dict[str, bool]:
    """Give inputs and outputs while abnormal gates give the opposite of what they should."""
    circuit = build_circuit(network, network.outputs)
    flips = {node.output: 1 for node in circuit.nodes if node.component in abnormal}
    words = dict(
        zip(
            circuit.names,
            simulate_gates(circuit, [int(inputs[name]) for name in network.inputs], 1, flips),
            strict=True,
        )
    )
    return inputs | {name: bool(words[name]) for name in network.outputs}


def made_scenario(network: LogicNetwork, n_faults: int, seed: int) -> tuple[dict[str, bool], dict[str, bool], GateSet]:
    """Give what is observed before and after, and the faults: of some random ones those with the most wrong outputs."""
    random = np.random.default_rng(seed)
    found = []
    for number in range(TRIES):
        inputs = {name: bool(random.integers(2)) for name in network.inputs}
        abnormal = frozenset(str(name) for name in random.choice(network.suspects, n_faults, replace=False))
        before, after = observe(network, frozenset(), inputs), observe(network, abnormal, inputs)
        found.append((sum(before[name] != after[name] for name in network.outputs), -number, before, after, abnormal))
    return max(found)[2:]


def circuit_text(network: LogicNetwork) -> str:
    """Give a network as system catalogue XML; its outputs must be set by gates."""
    outer = {*network.inputs, *network.outputs}
    kinds = dict.fromkeys([*network.inputs, *network.outputs], "port")
    kinds |= {gate.output: "probe" for gate in network.gates if gate.output not in outer}
    wires: list[tuple[str, str]] = []
    for gate in network.gates:
        kinds[gate.name] = _kind(gate)
        pins = [f"{gate.name}.o", *(f"{gate.name}.i{number + 1}" for number in range(len(gate.inputs)))]
        kinds |= dict.fromkeys(pins, "wire")
        wires += zip(pins, (gate.output, *gate.inputs), strict=True)
    components = "".join(
        f"        <component>\n          <name>{name}</name>\n          <componentType>{kind}</componentType>\n"
        "        </component>\n"
        for name, kind in kinds.items()
    )
    connections = "".join(
        f"        <connection>\n          <c1>{one}</c1>\n          <c2>{other}</c2>\n        </connection>\n"
        for one, other in wires
    )
    return (
        '<?xml version="1.0" encoding="UTF-8"?>\n'
        '<systemCatalog xmlns="urn:org:dx-competition:system">\n  <systems>\n    <system>\n'
        f"      <systemName>{network.name}</systemName>\n      <components>\n{components}      </components>\n"
        f"      <connections>\n{connections}      </connections>\n    </system>\n  </systems>\n</systemCatalog>\n"
    )


def _kind(gate: Gate) -> str:
    """Give the type of a gate as the files write it: and2, inverter."""
    if gate.function.is_unary:
        return "inverter" if gate.function is GateFunction.NOT else "buffer"
    return f"{gate.function.value}{len(gate.inputs)}"


def scenario_text(before: dict[str, bool], after: dict[str, bool], injected: GateSet) -> str:
    """Give a scenario without its truth."""

    def sensors(values: dict[str, bool]) -> str:
        return ", ".join(f"{name} = {str(value).lower()}" for name, value in values.items())

    faults = "".join(
        f"faultInjection @5000 isInjection = true, fault = {{ {name} = faulty }}, parameters = {{}};\n"
        for name in sorted(injected)
    )
    return f"sensors @0 {{ {sensors(before)} }};\n{faults}sensors @6000 {{ {sensors(after)} }};\n"
