"""Regions of a circuit: a suspect gate and all that reaches what is seen only through it.

In a smallest diagnosis of one observation every abnormal gate gives the opposite of what it should, and no region
holds two of them, since the gate at its root alone would do for both. So the roots are searched, and each root is then
replaced by every gate of its region that can give it the same value; the regions do not depend on each other.
Source: Siddiqi and Huang, "Hierarchical diagnosis of multiple faults" (IJCAI 2007); Metodi, Stern, Kalech, Codish, "A
novel SAT-based approach to model based diagnosis" (JAIR 2014); the exchange by simulation is ours.
"""

import heapq
from collections import defaultdict
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

from faultbond.networks.logic.circuit import NOWHERE, Circuit, dominators, gate_word, simulate_gates


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Regions:
    """Immediate dominator of each signal, and the root of the region in which it lies; NOWHERE where there is none."""

    dominator: tuple[int, ...]
    root: tuple[int, ...]


def find_regions(circuit: Circuit, seen: Sequence[int]) -> Regions:
    """Give the regions: the root is the outermost suspect among a signal and its dominators.

    Parameters
    ----------
    circuit : gates in causal order
    seen : observed signals
    """
    above = dominators(circuit, seen)
    root = [NOWHERE] * len(above)
    for node in reversed(circuit.nodes):
        outer = NOWHERE if above[node.output] == NOWHERE else root[above[node.output]]
        root[node.output] = node.output if outer == NOWHERE and node.component is not None else outer
    return Regions(dominator=tuple(above), root=tuple(root))


def exchanges(
    circuit: Circuit, regions: Regions, inputs: Sequence[bool], sets: Sequence[Sequence[int]]
) -> list[list[list[int]]]:
    """Give, for each set and each of its roots, the signals of suspects that may stand for the root.

    Parameters
    ----------
    circuit : gates in causal order
    regions : of the circuit
    inputs : value of each input
    sets : smallest diagnoses whose members are roots, each by their signals
    """
    full = (1 << len(sets)) - 1  # one case for each set
    flips: dict[int, int] = defaultdict(int)
    for case, roots in enumerate(sets):
        for signal in roots:
            flips[signal] |= 1 << case
    words = simulate_gates(circuit, [full if value else 0 for value in inputs], full, flips)
    readers: list[list[int]] = [[] for _ in circuit.names]  # outputs of the gates that read each signal
    for node in circuit.nodes:
        for signal in node.inputs:
            readers[signal].append(node.output)
    reach: dict[int, int] = {}  # cases in which a change of the signal changes its root
    able: dict[int, dict[int, int]] = defaultdict(dict)  # by root and suspect, cases in which this can stand for it
    for node in reversed(circuit.nodes):
        signal, root, above = node.output, regions.root[node.output], regions.dominator[node.output]
        if root not in flips:
            continue
        if signal == root:
            reach[signal] = flips[root]
        elif further := reach.get(above, 0):
            reach[signal] = further & _changes(circuit, readers, words, flips, signal, above, full)
        if node.component is not None and reach.get(signal):
            able[root][signal] = reach[signal]
    return [
        [[signal for signal, cases in able[root].items() if cases >> case & 1] for root in roots]
        for case, roots in enumerate(sets)
    ]


def _changes(
    circuit: Circuit,
    readers: Sequence[Sequence[int]],
    words: Sequence[int],
    flips: Mapping[int, int],
    signal: int,
    target: int,
    full: int,
) -> int:
    """Give the cases in which the opposite of a signal gives the opposite of its dominator."""
    changed = {signal: words[signal] ^ full}
    waiting = [*readers[signal]]
    heapq.heapify(waiting)
    while waiting:
        reader = heapq.heappop(waiting)  # causal order: what it reads is settled
        if reader in changed:
            continue
        node = circuit.node(reader)
        before = words[reader] ^ flips.get(reader, 0)
        after = gate_word(node, {item: changed.get(item, words[item]) for item in node.inputs}, full)
        if reader == target:
            return before ^ after
        if before != after:
            changed[reader] = after
            for item in readers[reader]:
                heapq.heappush(waiting, item)
    return 0
