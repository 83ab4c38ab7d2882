"""A logic network in integers."""

import re
from collections.abc import Callable, Sequence
from itertools import product

import pytest

from faultbond.errors import StructureError
from faultbond.model.logic import Gate, GateFunction, LogicNetwork
from faultbond.networks.logic.circuit import NOWHERE, build_circuit, dominators, simulate_gates
from faultbond.networks.logic.regions import exchanges, find_regions

TRUTH: dict[str, Callable[[Sequence[bool]], bool]] = {
    "and": all,
    "or": any,
    "nand": lambda values: not all(values),
    "nor": lambda values: not any(values),
    "xor": lambda values: sum(values) % 2 == 1,
    "xnor": lambda values: sum(values) % 2 == 0,
    "not": lambda values: not values[0],
    "buffer": lambda values: values[0],
}


def network(*gates: str, inputs: str = "a b c", outputs: str = "") -> LogicNetwork:
    """Give a network from `z = and x y`, each gate named by what it sets; `z = and! x y` is trusted."""
    made = []
    for text in gates:
        output, _, function, *sources = text.split()
        made.append(
            Gate(
                name=output.upper(),
                function=GateFunction(function.rstrip("!")),
                output=output,
                inputs=tuple(sources),
                trusted=function.endswith("!"),
            )
        )
    return LogicNetwork(name="n", gates=tuple(made), inputs=tuple(inputs.split()), outputs=tuple(outputs.split()))


@pytest.mark.parametrize("function", list(GateFunction), ids=lambda item: item.value)
@pytest.mark.parametrize("count", [1, 2, 3, 4])
def test_every_gate_has_its_truth_table(function: GateFunction, count: int) -> None:
    """All cases are simulated at once, one bit each."""
    if function.is_unary and count > 1:
        return
    names = [f"i{number}" for number in range(count)]
    made = network(f"z = {function.value} {' '.join(names)}", inputs=" ".join(names))
    circuit = build_circuit(made, ["z"])
    cases = list(product([False, True], repeat=count))
    inputs = [sum(case[number] << bit for bit, case in enumerate(cases)) for number in range(count)]
    words = simulate_gates(circuit, inputs, (1 << len(cases)) - 1)
    expected = [TRUTH[function.value](case) for case in cases]
    assert [bool(words[-1] >> bit & 1) for bit in range(len(cases))] == expected


def test_a_flip_passes_on() -> None:
    """A gate that gives the opposite is seen where its readers let it through."""
    made = network("x = and a b", "y = or x c", "z = and x c")
    circuit = build_circuit(made, ["y", "z"])
    inputs = [0b11, 0b11, 0b10]  # c is 0 in the first case, 1 in the second
    x = circuit.names.index("x")
    words = dict(zip(circuit.names, simulate_gates(circuit, inputs, 0b11, {x: 0b11}), strict=True))
    assert (words["x"], words["y"], words["z"]) == (0b00, 0b10, 0b00)
    healthy = dict(zip(circuit.names, simulate_gates(circuit, inputs, 0b11), strict=True))
    assert (healthy["x"], healthy["y"], healthy["z"]) == (0b11, 0b11, 0b10)


def test_gates_stand_in_causal_order() -> None:
    """Whatever the order of the file, and without what leads to nothing that is seen."""
    made = network("z = and y a", "y = or x b", "dead = not y", "x = not c")
    assert build_circuit(made, ["z"]).names == ("a", "b", "c", "x", "y", "z")


@pytest.mark.parametrize(
    ("gates", "message"),
    [
        (("z = and y a", "y = or z b"), r"n: gates (Z, Y|Y, Z) form a loop. Cut it"),
        (("z = and y a",), "n: nothing sets signal y. Make it an input"),
        (("z = and a b", "z = or a b"), "n: signal z is set by Z and by Z. Keep one."),
        (("a = and b c", "z = not a"), "n: signal a is set by A and by an input. Keep one."),
        (("z = not a b",), "n: not Z has 2 inputs; it needs one"),
        (("z = nor",), "n: nor Z has 0 inputs; it needs at least one"),
    ],
)
def test_what_is_no_network(gates: tuple[str, ...], message: str) -> None:
    """The user's gate or signal is named."""
    with pytest.raises(StructureError, match=re.compile(message)):
        build_circuit(network(*gates), ["z"])


def test_constants_are_gates_without_inputs() -> None:
    """An and of nothing is 1, an or of nothing 0."""
    circuit = build_circuit(network("x = and", "y = or", "z = xor x y"), ["z"])
    words = dict(zip(circuit.names, simulate_gates(circuit, [0, 0, 0], 1), strict=True))
    assert (words["x"], words["y"], words["z"]) == (1, 0, 1)


def named_dominators(made: LogicNetwork, seen: str) -> dict[str, str]:
    """Give the immediate dominator of each signal by name, empty where there is none."""
    circuit = build_circuit(made, seen.split())
    above = dominators(circuit, [circuit.names.index(name) for name in seen.split()])
    return {
        name: "" if item == NOWHERE else circuit.names[item] for name, item in zip(circuit.names, above, strict=True)
    }


DIAMOND = ("p = not a", "q = and p b", "r = or p c", "s = xor q r", "z = not s")


def test_dominators_of_a_diamond() -> None:
    """Ways that part and meet again have the meeting point in common."""
    assert named_dominators(network(*DIAMOND), "z") == {
        "a": "p", "b": "q", "c": "r", "p": "s", "q": "s", "r": "s", "s": "z", "z": "",
    }  # fmt: skip


def test_what_is_seen_has_no_dominator() -> None:
    """A signal that is seen itself, or on the way of one branch, is dominated by nothing after it."""
    above = named_dominators(network(*DIAMOND), "z q")
    assert (above["q"], above["p"], above["r"]) == ("", "", "s")


def named_roots(made: LogicNetwork, seen: str) -> dict[str, str]:
    """Give the root of each gate's region, empty where there is none."""
    circuit = build_circuit(made, seen.split())
    root = find_regions(circuit, [circuit.names.index(name) for name in seen.split()]).root
    return {
        circuit.names[node.output]: "" if root[node.output] == NOWHERE else circuit.names[root[node.output]]
        for node in circuit.nodes
    }


def test_a_region_has_its_outermost_suspect_as_root() -> None:
    """Trusted gates are passed over at the outside only."""
    assert set(named_roots(network(*DIAMOND), "z").values()) == {"z"}
    trusted = network("p = not a", "q = and p b", "r = or p c", "s = xor! q r", "z = not! s")
    assert named_roots(trusted, "z") == {"p": "p", "q": "q", "r": "r", "s": "", "z": ""}
    inside = network("p = not a", "q = and p b", "r = or p c", "s = xor! q r", "z = not s")
    assert set(named_roots(inside, "z").values()) == {"z"}


def test_exchanges_depend_on_the_rest_of_the_set() -> None:
    """X and Y can stand for Z only where K, which is outside the region of Z, lets them through."""
    made = network("k = buffer c", "x = not a", "y = not x", "z = and y k")
    circuit = build_circuit(made, ["k", "z"])
    k, x, y, z = (circuit.names.index(name) for name in "kxyz")
    regions = find_regions(circuit, [k, z])
    assert [regions.root[signal] for signal in (k, x, y, z)] == [k, z, z, z]
    alone, together = exchanges(circuit, regions, [True, False, False], [[z], [k, z]])
    assert alone == [[z]]
    assert [sorted(signals) for signals in together] == [[k], sorted([x, y, z])]
