"""Causal strokes by the sequential causality assignment procedure (SCAP).

Source: thesis 3.2.1 (strokes) and Karnopp, Margolis, Rosenberg, System Dynamics, section 5.2 (the procedure):
sources first, then stores in integral causality, then what is left at will; after each choice the junctions and
transformers pass on what follows from it.
"""

from dataclasses import dataclass

from faultbond.errors import CausalityError
from faultbond.model.graph import Bond, BondGraph, Component, Junction
from faultbond.types import ElementType, JunctionType

Strokes = dict[int, str]  # bond -> the node that receives effort (where the stroke stands)


@dataclass(frozen=True, slots=True, kw_only=True)
class Causality:
    """Result of SCAP.

    strokes: bond index -> name of the node that receives effort. integral, derivative: names of stores. free: elements
    or bonds that took a causality at will; each is a sign of an algebraic loop.
    """

    strokes: tuple[tuple[int, str], ...]
    integral: tuple[str, ...]
    derivative: tuple[str, ...]
    free: tuple[str, ...]


class _ConflictError(Exception):
    """Two causes for one signal; the message says which."""


class _Assigner:
    """Strokes under construction. `assign` passes consequences on and raises `_ConflictError` where two causes meet."""

    def __init__(self, graph: BondGraph) -> None:
        self.graph = graph
        self.strokes: Strokes = {}
        parts: tuple[Component | Junction, ...] = (*graph.components, *graph.junctions)
        self.bonds_at: dict[str, list[int]] = {item.name: [] for item in parts}
        for index, bond in enumerate(graph.bonds):
            self.bonds_at[bond.tail].append(index)
            self.bonds_at[bond.head].append(index)
        self.junctions = {item.name: item for item in graph.junctions}
        self.elements = {item.name: item for item in graph.components}

    def other(self, index: int, node: str) -> str:
        """Give the node at the far end of a bond."""
        bond = self.graph.bonds[index]
        return bond.head if bond.tail == node else bond.tail

    def assign(self, index: int, receiver: str) -> None:
        """Let `receiver` receive the effort of a bond, and all that follows."""
        pending = [(index, receiver)]
        while pending:
            bond, node = pending.pop()
            if bond in self.strokes:
                if self.strokes[bond] != node:
                    raise _ConflictError(self._contradiction(bond, node))
                continue
            self.strokes[bond] = node
            tail, head = self.graph.bonds[bond].tail, self.graph.bonds[bond].head
            for end in (tail, head):
                if end in self.junctions:
                    pending += self._follow_junction(end)
                elif self.elements[end].type in (ElementType.TF, ElementType.GY):
                    pending += self._follow_two_port(end)

    def _contradiction(self, bond: int, node: str) -> str:
        """Say which junction would get two causes if `node` received the effort of a bond that is fixed otherwise."""
        for junction in (self.graph.bonds[bond].tail, self.graph.bonds[bond].head):
            if junction in self.junctions:
                strokes = {**self.strokes, bond: node}
                setters = self._setters(junction, strokes)
                if len(setters) > 1:
                    return self._two_causes(junction, setters)
        return f"bond {_title(self.graph.bonds[bond])} would need a stroke at both ends"

    def _setters(self, junction: str, strokes: Strokes) -> list[int]:
        """Give the bonds that set the effort of a 0-junction, or the flow of a 1-junction."""
        zero = self.junctions[junction].type is JunctionType.ZERO
        return [k for k in self.bonds_at[junction] if k in strokes and (strokes[k] == junction) == zero]

    def _two_causes(self, junction: str, setters: list[int]) -> str:
        kind = self.junctions[junction].type
        signal = "effort" if kind is JunctionType.ZERO else "flow"
        titles = " and by ".join(self.other(k, junction) for k in setters[:2])
        return f"{kind.value}-junction {junction} has its {signal} set by {titles}; only one bond may set it"

    def attempt(self, index: int, receiver: str) -> str | None:
        """Assign; on a conflict restore the strokes and give its description."""
        saved = dict(self.strokes)
        try:
            self.assign(index, receiver)
        except _ConflictError as conflict:
            self.strokes = saved
            return str(conflict)
        return None

    def _follow_junction(self, node: str) -> list[tuple[int, str]]:
        """Exactly one bond sets the effort of a 0-junction, the flow of a 1-junction."""
        zero = self.junctions[node].type is JunctionType.ZERO
        bonds = self.bonds_at[node]
        setters = self._setters(node, self.strokes)
        unset = [k for k in bonds if k not in self.strokes]
        if len(setters) > 1:
            raise _ConflictError(self._two_causes(node, setters))
        if setters:
            return [(k, self.other(k, node) if zero else node) for k in unset]
        if len(unset) == 1:
            return [(unset[0], node if zero else self.other(unset[0], node))]
        if not unset:
            signal = "effort" if zero else "flow"
            raise _ConflictError(f"nothing sets the {signal} of {self.junctions[node].type.value}-junction {node}")
        return []

    def _follow_two_port(self, node: str) -> list[tuple[int, str]]:
        """A transformer passes effort through, a gyrator turns effort into flow."""
        first, second = self.bonds_at[node]
        transformer = self.elements[node].type is ElementType.TF
        consequences = []
        for known, wanted in ((first, second), (second, first)):
            if known in self.strokes:
                receives = self.strokes[known] == node
                at_node = receives != transformer
                consequences.append((wanted, node if at_node else self.other(wanted, node)))
        return consequences


def assign_causality(graph: BondGraph) -> Causality:
    """Give every bond its causal stroke; a block network has no bonds, and its stores integrate.

    Raises
    ------
    CausalityError
        Where two sources (or what follows from them) set one signal; names the junction and both causes.
    """
    if graph.is_block_network:
        stores = [item.name for item in graph.components if any(law.store for law in item.laws)]
        return Causality(strokes=(), integral=tuple(stores), derivative=(), free=())
    work = _Assigner(graph)
    for item in graph.components:
        if item.type.is_source:
            bond = work.bonds_at[item.name][0]
            receiver = work.other(bond, item.name) if item.type is ElementType.SE else item.name
            problem = work.attempt(bond, receiver)
            if problem:
                raise CausalityError(
                    f"{graph.file}:{item.line}: {problem} (found at source {item.name}); "
                    "let one of them be a store or a resistor, or put one between them"
                )
    for item in graph.components:
        if item.type.is_store:
            bond = work.bonds_at[item.name][0]
            if bond not in work.strokes:
                _prefer(work, bond, _integral_receiver(work, item.name), item.name, item.line)
    free = []
    for item in graph.components:  # what is left at will: resistors first (as conductances), then inner bonds
        bond = work.bonds_at[item.name][0]
        if item.type is ElementType.R and bond not in work.strokes:
            free.append(item.name)
            _prefer(work, bond, item.name, item.name, item.line)
    for index, inner in enumerate(graph.bonds):
        if index not in work.strokes:
            free.append(_title(inner))
            _prefer(work, index, inner.head, _title(inner), inner.line)
    stores = [item.name for item in graph.components if item.type.is_store]
    integral = [name for name in stores if work.strokes[work.bonds_at[name][0]] == _integral_receiver(work, name)]
    return Causality(
        strokes=tuple(sorted(work.strokes.items())),
        integral=tuple(integral),
        derivative=tuple(name for name in stores if name not in integral),
        free=tuple(free),
    )


def _integral_receiver(work: _Assigner, name: str) -> str:
    """A C in integral causality gives effort, an I receives it."""
    bond = work.bonds_at[name][0]
    return work.other(bond, name) if work.elements[name].type is ElementType.C else name


def _prefer(work: _Assigner, bond: int, receiver: str, name: str, line: int) -> None:
    """Assign the preferred stroke, or the opposite one where that contradicts what is fixed."""
    problem = work.attempt(bond, receiver)
    if problem and work.attempt(bond, work.other(bond, receiver)):
        raise CausalityError(f"{work.graph.file}:{line}: no causality fits {name}: {problem}; look at its bonds")


def _title(bond: Bond) -> str:
    return f"{bond.tail} -> {bond.head}"
