"""Maximum matching of equations and variables, and what follows from it: parts, closures, blocks.

Plain integers throughout. An equation is an index into a sequence, its entry the variables (unknowns) it contains. A
matching says for each variable which equation determines it, -1 for none; no equation determines two variables.

Sources: Hopcroft and Karp 1973 (a matching is largest if and only if no path augments it); Dulmage and Mendelsohn
1958 and Pothen and Fan 1990 (the three parts, by alternating paths, and the blocks of the square part); Tarjan 1972
(strongly connected components).
"""

from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

Equations = Sequence[Sequence[int]]

_LARGE = 20_000  # entries; from here on Hopcroft and Karp's algorithm in C is faster than one path at a time


@dataclass(frozen=True, slots=True, kw_only=True)
class DulmageMendelsohnPart:
    """Equations and variables of a part of a model, ascending."""

    equations: tuple[int, ...]
    variables: tuple[int, ...]


@dataclass(frozen=True, slots=True, kw_only=True)
class Decomposition:
    """The parts of a model by Dulmage and Mendelsohn; they do not depend on the matching.

    over : more equations than variables, each variable determined even without any one of the equations
    just : as many equations as variables, none to spare
    under : more variables than equations; its variables are undetermined
    """

    over: DulmageMendelsohnPart
    just: DulmageMendelsohnPart
    under: DulmageMendelsohnPart


def match(equations: Equations, n_variables: int, start: Sequence[int] = ()) -> tuple[int, ...]:
    """Give for each variable the equation that determines it, or -1: as many as possible.

    start: a matching of the first variables, such as of a model that has grown since.

    Earlier equations come first: an equation that is left over could not be matched without unmatching one before it.
    (Models of more than 20 000 entries are matched in C without this preference.)
    """
    if sum(map(len, equations)) > _LARGE:
        return match_any(equations, n_variables)
    matched = [*start, *[-1] * (n_variables - len(start))]
    held = holdings(equations, matched)
    lost: set[int] = set()  # variables from which no path leads to a free one, now and later
    for equation, variables in enumerate(equations):
        if held[equation] >= 0:
            continue
        for variable in variables:
            if matched[variable] < 0:
                matched[variable], held[equation] = equation, variable
                break
        else:
            augment(equation, equations, matched, held, lost)
    return tuple(matched)


def match_any(equations: Equations, n_variables: int) -> tuple[int, ...]:
    """Give for each variable the equation that determines it, or -1: as many as possible, none preferred; in C."""
    starts = np.cumsum([0, *map(len, equations)])
    entries = np.fromiter((v for variables in equations for v in variables), dtype=np.intp, count=int(starts[-1]))
    table = csr_array((np.ones(len(entries), dtype=np.int8), entries, starts), shape=(len(equations), n_variables))
    table.sum_duplicates()
    return tuple(int(equation) for equation in maximum_bipartite_matching(table, perm_type="row"))


def augment(equation: int, equations: Equations, matched: list[int], held: list[int], lost: set[int]) -> bool:
    """Match one more equation along the shortest alternating path to a free variable; False where there is none.

    Parameters
    ----------
    equation : the equation to match
    equations : for each equation its variables
    matched : for each variable the equation that determines it, or -1; changed in place
    held : for each equation the variable that it determines, or -1; changed in place
    lost : variables from which no path leads to a free one; grows where there is no path
    """
    came: dict[int, int] = {}  # variable -> the equation from which the path reached it
    queue = [equation]
    for source in queue:
        for variable in equations[source]:
            if variable in came or variable in lost:
                continue
            came[variable] = source
            if matched[variable] < 0:
                free = variable
                while free >= 0:  # turn the path round: each equation takes the variable by which the path left it
                    taker = came[free]
                    matched[free], held[taker], free = taker, free, held[taker]  # in the end -1, where the path began
                return True
            queue.append(matched[variable])
    lost.update(came)
    return False


def undetermined(equations: Equations, n_variables: int, matched: Sequence[int]) -> frozenset[int]:
    """Give the variables that the equations do not fix: those of the under-determined part.

    A variable is undetermined if an alternating path leads to it from a variable that no equation determines.
    """
    held = holdings(equations, matched)
    found = {variable for variable in range(n_variables) if matched[variable] < 0}
    if not found:
        return frozenset()
    containing = incidence(equations, n_variables)
    queue = list(found)
    for variable in queue:
        for equation in containing[variable]:
            other = held[equation]
            if other >= 0 and other not in found:
                found.add(other)
                queue.append(other)
    return frozenset(found)


def redundant(equations: Equations, matched: Sequence[int]) -> frozenset[int]:
    """Give the equations of the over-determined part: each may be left out, and its variables are fixed all the same.

    An equation is redundant if an alternating path leads to it from an equation that determines nothing.
    """
    held = holdings(equations, matched)
    found = {equation for equation, variable in enumerate(held) if variable < 0}
    queue = list(found)
    for equation in queue:
        for variable in equations[equation]:
            other = matched[variable]
            if other >= 0 and other not in found:
                found.add(other)
                queue.append(other)
    return frozenset(found)


def decompose(equations: Equations, n_variables: int, matched: Sequence[int] | None = None) -> Decomposition:
    """Give the over-, the just and the under-determined part of a model.

    Source: Dulmage and Mendelsohn 1958; Pothen and Fan 1990. Equations without variables belong to the over-determined
    part, variables without equations to the under-determined one.
    """
    chosen = match(equations, n_variables) if matched is None else matched
    held = holdings(equations, chosen)
    over = redundant(equations, chosen)
    # A variable that no equation determines is never met on a path from a left-over equation: it would augment.
    fixed = {variable for equation in over for variable in equations[equation]}
    free = undetermined(equations, n_variables, chosen)
    under = {equation for equation, variable in enumerate(held) if variable in free}
    return Decomposition(
        over=_part(over, fixed),
        just=_part(
            (equation for equation in range(len(equations)) if equation not in over and equation not in under),
            (variable for variable in range(n_variables) if variable not in fixed and variable not in free),
        ),
        under=_part(under, free),
    )


def closure(
    targets: Iterable[int], equations: Equations, matched: Sequence[int]
) -> tuple[tuple[int, ...], tuple[int, ...]]:
    """Give the equations that the target variables need along a matching, and all variables of these, ascending.

    Where a variable among those given has no equation (`matched` is -1), the targets cannot be computed; a target is
    always among the variables.
    """
    variables = dict.fromkeys(targets)
    queue = list(variables)
    found = set()
    for variable in queue:
        equation = matched[variable]
        if equation < 0 or equation in found:
            continue
        found.add(equation)
        for other in equations[equation]:
            if other not in variables:
                variables[other] = None
                queue.append(other)
    return tuple(sorted(found)), tuple(sorted(variables))


def blocks(
    equations: Equations, matched: Sequence[int], chosen: Collection[int] | None = None
) -> tuple[tuple[int, ...], ...]:
    """Give the matched equations in blocks that have to be solved at once, in an order in which they can be.

    A block is a strongly connected component of the graph in which an equation points to those that determine its
    variables (Tarjan 1972); one equation is the usual case. This is the block triangular form. Equations of a block
    ascend; of blocks that do not need each other, the one met first from the lowest equation on comes first.

    Parameters
    ----------
    equations : for each equation its variables
    matched : for each variable the equation that determines it, or -1
    chosen : equations to order, for example those of a closure; None: all that determine a variable
    """
    held = holdings(equations, matched)
    wanted = range(len(equations)) if chosen is None else sorted(chosen)
    allowed = {equation for equation in wanted if held[equation] >= 0}
    order: dict[int, int] = {}  # equation -> when it was met
    low: dict[int, int] = {}  # equation -> earliest equation on the stack that it leads to
    stack: list[int] = []
    waiting: set[int] = set()  # what is on the stack
    found: list[tuple[int, ...]] = []
    for root in wanted:
        if root not in allowed or root in order:
            continue
        calls = [(root, iter(equations[root]))]
        order[root] = low[root] = len(order)
        stack.append(root)
        waiting.add(root)
        while calls:
            equation, rest = calls[-1]
            for variable in rest:
                other = matched[variable]
                if other not in allowed:
                    continue
                if other not in order:
                    order[other] = low[other] = len(order)
                    stack.append(other)
                    waiting.add(other)
                    calls.append((other, iter(equations[other])))
                    break
                if other in waiting:
                    low[equation] = min(low[equation], order[other])
            else:
                calls.pop()
                if calls:
                    low[calls[-1][0]] = min(low[calls[-1][0]], low[equation])
                if low[equation] == order[equation]:
                    start = len(stack) - 1
                    while stack[start] != equation:
                        start -= 1
                    found.append(tuple(sorted(stack[start:])))
                    waiting.difference_update(stack[start:])
                    del stack[start:]
    return tuple(found)


def holdings(equations: Equations, matched: Sequence[int]) -> list[int]:
    """Give for each equation the variable it determines, or -1."""
    held = [-1] * len(equations)
    for variable, equation in enumerate(matched):
        if equation >= 0:
            held[equation] = variable
    return held


def incidence(equations: Equations, n_variables: int) -> list[list[int]]:
    """Give for each variable the equations that contain it, ascending."""
    containing: list[list[int]] = [[] for _ in range(n_variables)]
    for equation, variables in enumerate(equations):
        for variable in variables:
            containing[variable].append(equation)
    return containing


def _part(equations: Iterable[int], variables: Iterable[int]) -> DulmageMendelsohnPart:
    return DulmageMendelsohnPart(equations=tuple(sorted(equations)), variables=tuple(sorted(variables)))
