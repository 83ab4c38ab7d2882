"""Why faults are not detectable, and why they cannot be told apart, by structure: the equations and unknowns at fault.

A class of k equations of the over-determined part has k - 1 unknowns that stand in no other class: without one of its
equations the others only find these, and check nothing. So whatever enters a class enters all tests that use it.
Equations outside the over-determined part find unknowns of their own, in blocks, and nothing checks these.

Sources: Krysander, Aslund and Nyberg, IEEE Trans. SMC-A 38 (2008), the canonical decomposition of the over-determined
part; Dulmage and Mendelsohn 1958.
"""

from dataclasses import dataclass

from faultbond.diagnosability.classes import classes
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations.matching import blocks, decompose, holdings, match, redundant


@dataclass(frozen=True, slots=True, kw_only=True)
class Alike:
    """Detectable faults of which none can be told from another, in mixed causality.

    faults : ascending
    equations : the class that they enter, ascending
    variables : the unknowns that these equations alone contain or find, one fewer than equations; ascending
    """

    faults: tuple[int, ...]
    equations: tuple[int, ...]
    variables: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Hidden:
    """A fault that is not detectable, in mixed causality.

    open : unknowns of its equation that nothing fixes; where there are none:
    equations, variables : the block of equations that it enters, and the unknowns that these find and nothing checks
    """

    fault: int
    open: tuple[int, ...] = ()
    equations: tuple[int, ...] = ()
    variables: tuple[int, ...] = ()


def alike_faults(model: StructuralModel) -> tuple[Alike, ...]:
    """Give the groups of two or more faults that cannot be told apart, in the order of their first faults."""
    label = classes(model.equations, match(model.equations, model.n_variables))
    groups: dict[int, list[int]] = {}
    for fault, equation in enumerate(model.faults):
        if label[equation] >= 0:
            groups.setdefault(label[equation], []).append(fault)
    found = []
    for lowest, faults in groups.items():
        if len(faults) > 1:
            together = tuple(equation for equation, other in enumerate(label) if other == lowest)
            rest = [
                row if other >= 0 and other != lowest else () for row, other in zip(model.equations, label, strict=True)
            ]
            checked = redundant(rest, match(rest, model.n_variables))
            elsewhere = {variable for equation in checked for variable in rest[equation]}
            own = {variable for equation in together for variable in model.equations[equation]} - elsewhere
            found.append(Alike(faults=tuple(faults), equations=together, variables=tuple(sorted(own))))
    return tuple(found)


def hidden_faults(model: StructuralModel) -> tuple[Hidden, ...]:
    """Give the faults that are not detectable, and why, in order."""
    matched = match(model.equations, model.n_variables)
    parts = decompose(model.equations, model.n_variables, matched)
    over, under, free = set(parts.over.equations), set(parts.under.equations), set(parts.under.variables)
    held = holdings(model.equations, matched)
    block_of = {
        equation: block for block in blocks(model.equations, matched, parts.just.equations) for equation in block
    }
    found = []
    for fault, equation in enumerate(model.faults):
        if equation in under:
            missing = tuple(variable for variable in model.equations[equation] if variable in free)
            found.append(Hidden(fault=fault, open=missing))
        elif equation not in over:
            block = block_of[equation]
            found.append(Hidden(fault=fault, equations=block, variables=tuple(sorted(held[one] for one in block))))
    return tuple(found)
