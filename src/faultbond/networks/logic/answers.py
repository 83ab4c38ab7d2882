"""Smallest sets of abnormal components that agree with what was seen, by answer sets (clingo).

Each component may be abnormal; an abnormal gate may give the opposite of what its function says. The solver finds all
sets of minimum cardinality. Source: Gebser, Kaminski, Kaufmann, Schaub, "Multi-shot ASP solving with clingo" (2019).
"""

import time
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import clingo
from clingo.backend import Backend

from faultbond.errors import StructureError
from faultbond.model.logic import GateFunction
from faultbond.networks.logic.circuit import Circuit, NumberedGate

# All optima, from below by unsatisfiable cores: quick where few gates explain much.
OPTIONS = ("--opt-mode=optN", "--models=0", "--opt-strategy=usc,k,0,7", "--warn=none")
PROJECTED = ("--project=show",)  # each set of shown atoms once; costs time, and is needed where more atoms are open


@dataclass(frozen=True, slots=True, kw_only=True)
class Case:
    """One observation: value of each input, None where it is not known, and of each signal that was seen."""

    inputs: tuple[bool | None, ...]
    seen: tuple[tuple[int, bool], ...]


@dataclass(slots=True)
class _Program:
    """Rules under way. A literal is an atom of the solver or its negative; `true` holds always."""

    backend: Backend
    true: int

    def choice(self, *given: int) -> int:
        """Give an atom that may hold or not, and only if those given do."""
        atom = self.backend.add_atom()
        self.backend.add_rule([atom], given, choice=True)
        return atom

    def conjunction(self, literals: Iterable[int]) -> int:
        """Give a literal that holds if all do."""
        parts = dict.fromkeys(literal for literal in literals if literal != self.true)
        if any(-literal in parts or literal == -self.true for literal in parts):
            return -self.true
        if len(parts) < 2:
            return next(iter(parts), self.true)
        atom = self.backend.add_atom()
        self.backend.add_rule([atom], list(parts))
        return atom

    def exclusive(self, one: int, other: int) -> int:
        """Give a literal that holds if exactly one does."""
        for known, open_ in ((one, other), (other, one)):
            if abs(known) == self.true:
                return -open_ if known > 0 else open_
        if abs(one) == abs(other):
            return -self.true if one == other else self.true
        atom = self.backend.add_atom()
        self.backend.add_rule([atom], [one, -other])
        self.backend.add_rule([atom], [-one, other])
        return atom

    def gate(self, node: NumberedGate, literals: Sequence[int]) -> int:
        """Give the literal of a healthy gate's output; `literals` those of all signals."""
        inputs = [literals[signal] for signal in node.inputs]
        match node.function:
            case GateFunction.AND:
                result = self.conjunction(inputs)
            case GateFunction.OR:
                result = -self.conjunction([-literal for literal in inputs])
            case _:
                result = -self.true
                for literal in inputs:
                    result = self.exclusive(result, literal)
        return -result if node.inverted else result


def smallest_sets(
    circuit: Circuit, cases: Sequence[Case], suspects: Collection[str], *, strict: bool, deadline: float
) -> list[tuple[str, ...]]:
    """Give all smallest sets of components whose being abnormal makes every case consistent; none if there is none.

    Parameters
    ----------
    circuit : gates in causal order
    cases : observations
    suspects : components that may be abnormal
    strict : an abnormal gate always gives the opposite; else it may also be right. Being strict loses no smallest set
        of a single case whose inputs are all known, if each suspect has one gate.
    deadline : when to stop, on the clock of `time.perf_counter`

    Raises
    ------
    StructureError
        When the time is over.
    """
    control = clingo.Control(OPTIONS if strict else OPTIONS + PROJECTED)
    with control.backend() as backend:
        true = backend.add_atom()
        backend.add_rule([true], [])
        program = _Program(backend, true)
        abnormal: dict[str, int] = {}
        for name in suspects:
            atom = backend.add_atom(clingo.Function("abnormal", [clingo.String(name)]))
            backend.add_rule([atom], [], choice=True)
            abnormal[name] = atom
        for case in cases:
            literals = [program.choice() if value is None else true if value else -true for value in case.inputs]
            for node in circuit.nodes:
                literal = program.gate(node, literals)
                atom = None if node.component is None else abnormal.get(node.component)
                if atom is not None:
                    literal = program.exclusive(literal, atom if strict else program.choice(atom))
                literals.append(literal)
            for signal, value in case.seen:
                backend.add_rule([], [-literals[signal] if value else literals[signal]])
        backend.add_minimize(0, [(atom, 1) for atom in abnormal.values()])
    found: list[tuple[str, ...]] = []

    def take(model: clingo.Model) -> None:
        if model.optimality_proven:
            found.append(tuple(symbol.arguments[0].string for symbol in model.symbols(shown=True)))

    with control.solve(on_model=take, async_=True) as handle:
        left = deadline - time.perf_counter()
        if left <= 0 or not handle.wait(left):
            handle.cancel()
            raise StructureError(
                "the search for the smallest diagnoses did not end in time"
                f"{f'; {len(found)} were found so far' if found else ''}. Allow more time, or observe more signals."
            )
    return found
