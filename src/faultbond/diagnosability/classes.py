"""Redundancy and its grain: the classes of equations that are checked only together.

The over-determined part of a model is what other equations check. Without one of its equations e, a whole class of
equations is no longer checked, that of e; it is the same for each e of the class. Krysander, Aslund and Nyberg, IEEE
Trans. SMC-A 38 (2008), find a class by a decomposition of the model without e. Here all classes come from one search.

Say that an equation points to those that determine its variables. Equation e is checked if a path leads to it from an
equation that determines nothing: turned round, the path frees e of its variable. Without f it is still checked if e and
f can be freed at once, by two such paths that share no equation. By Menger's theorem there are none if and only if some
equation lies on all paths to e and on all paths to f, so if e and f have the same first dominator. Dominators: Cooper,
Harvey and Kennedy, A simple, fast dominance algorithm (2001), here in the order of a breadth-first search.
"""

from collections.abc import Collection, Sequence
from dataclasses import dataclass

from faultbond.equations.matching import Equations, decompose, holdings


@dataclass(frozen=True, slots=True)
class ClassSearch:
    """Breadth-first search of the over-determined part. Positions count from 1; 0 stands for the start.

    order : the equation at each position (at 0: -1)
    before : the position from which it was met; 0 for an equation that determines nothing
    top : the position of the first equation on all paths to it; the same within a class, and in the class itself
    """

    order: list[int]
    before: list[int]
    top: list[int]


def redundancy(equations: Equations, n_variables: int) -> int:
    """Give the number of equations that the over-determined part has beyond its variables."""
    over = decompose(equations, n_variables).over
    return len(over.equations) - len(over.variables)


def classes(equations: Equations, matched: Sequence[int]) -> tuple[int, ...]:
    """Give for each equation the lowest one of its class, or -1 outside the over-determined part."""
    found = search_classes(equations, matched, holdings(equations, matched), range(len(equations)))
    lowest: dict[int, int] = {}
    for equation, top in zip(found.order, found.top, strict=True):
        lowest[top] = min(equation, lowest.get(top, equation))
    label = [-1] * len(equations)
    for equation, top in zip(found.order[1:], found.top[1:], strict=True):
        label[equation] = lowest[top]
    return tuple(label)


def search_classes(
    equations: Equations, matched: Sequence[int], held: Sequence[int], active: Collection[int]
) -> ClassSearch:
    """Search the over-determined part of the `active` equations; `held` is the variable that each determines, or -1."""
    order = [-1, *(equation for equation in active if held[equation] < 0)]
    before = [0] * len(order)
    n_left_over = len(order)
    containing: dict[int, list[int]] = {}  # variable -> positions of the equations that contain it
    position = 1
    while position < len(order):
        for variable in equations[order[position]]:
            if variable in containing:
                containing[variable].append(position)
            else:  # an equation is met by the variable that it determines, so once
                containing[variable] = [position]
                order.append(matched[variable])
                before.append(position)
        position += 1
    pointing = [containing[held[equation]] for equation in order[n_left_over:]]
    top: list[int] = []
    for here, above in enumerate(_dominators(before, pointing)):
        top.append(top[above] if above else here)
    return ClassSearch(order, before, top)


def _dominators(before: list[int], pointing: list[list[int]]) -> list[int]:
    """Give for each position the last one, itself apart, that all paths to it share.

    Starts from the tree of the search and goes up until nothing changes. `pointing` are the positions that point to
    the last `len(pointing)` positions.
    """
    shared = before.copy()
    first = len(before) - len(pointing)
    changed = True
    while changed:
        changed = False
        for position, others in enumerate(pointing, first):
            one = shared[position]
            for pointer in others:
                other = pointer
                while one != other:  # go up to the nearest common position
                    if one > other:
                        one = shared[one]
                    else:
                        other = shared[other]
            if one != shared[position]:
                shared[position] = one
                changed = True
    return shared
