"""Overdetermined sets of equations: the smallest ones that a test can be made of, and what they respond to.

A set of equations is proper structurally overdetermined (PSO) if each of its equations is checked by the others, and
minimal (MSO) if it contains no smaller such set; then it has one equation more than variables. It is a test equation
support (TES) if no larger PSO set has the same faults, and minimal (MTES) if it contains no other TES: it responds to
faults that no test can tell apart. Sets are ascending tuples, in ascending order.

Sources: Krysander, Aslund and Nyberg, An efficient algorithm for finding minimal overconstrained subsystems for
model-based diagnosis, IEEE Trans. SMC-A 38 (2008). Krysander, Aslund and Frisk, A structural algorithm for finding
testable sub-models and multiple fault isolability analysis, DX 2010.
"""

from collections.abc import Collection, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from faultbond.arrays import BoolArray
from faultbond.diagnosability.classes import ClassSearch, search_classes
from faultbond.equations.matching import Equations, augment, holdings, match, redundant
from faultbond.errors import StructureError

EquationSet = tuple[int, ...]

MAX_SETS = 20_000  # of an engine with four equations to spare there are 4496
STEPS_PER_SET = 3  # a search that takes more than this many steps for each set of the limit is given up


@dataclass(frozen=True, slots=True)
class _Kept:
    """Marked equations that stay in all smaller sets, with a matching of them and of all that are not marked.

    spare : how many of them find no variable. From 1 on they are a test by themselves, and hide all larger ones.
    """

    equations: frozenset[int]
    matched: list[int]
    held: list[int]
    spare: int


@dataclass(frozen=True, slots=True)
class _Proper:
    """A PSO set under search: its equations, a matching, and what may be taken away.

    rank : how many marked equations can be taken away at once, each with a class of its own; 1: all are in one class
    allowed : the marked equations that may be taken away
    """

    equations: list[int]
    matched: list[int]  # variable -> equation; entries of variables that the set does not contain mean nothing
    held: list[int]  # equation -> variable or -1
    rank: int
    allowed: frozenset[int]
    kept: _Kept


def minimal_sets(equations: Equations, n_variables: int, *, limit: int = MAX_SETS) -> tuple[EquationSet, ...]:
    """Give all MSO sets: the smallest sets in which every equation is checked by the others.

    Raises
    ------
    StructureError
        Where there are more than `limit`, or too many to search through; their number grows exponentially with the
        redundancy.

    Source
    ------
    Krysander, Aslund and Nyberg 2008. Ours: all classes of a set come from one search (see `classes`), and a set of
    redundancy 2 gives its minimal sets at once, since without any class redundancy 1 is left.
    """
    return _collect(equations, n_variables, range(len(equations)), limit, "minimal overdetermined sets")


def minimal_supports(
    equations: Equations, n_variables: int, faults: Iterable[int], *, limit: int = MAX_SETS
) -> tuple[EquationSet, ...]:
    """Give all MTES: for each smallest set of faults that a test can respond to, all equations that can take part.

    Parameters
    ----------
    equations : for each equation its variables
    n_variables : variables are 0 .. n_variables - 1
    faults : the equation of each fault
    limit : number of sets to stop at

    Raises
    ------
    StructureError
        As in `minimal_sets`.

    Source
    ------
    Krysander, Aslund and Frisk 2010: the search of 2008, in which only equations with faults are taken away, until all
    that are left are in one class. With a fault in every equation these are the MSO sets.
    """
    return _collect(equations, n_variables, faults, limit, "minimal testable sets")


def _collect(
    equations: Equations, n_variables: int, marked: Iterable[int], limit: int, what: str
) -> tuple[EquationSet, ...]:
    found = []
    for steps, item in enumerate(_minimal(equations, n_variables, frozenset(marked)), 1):
        if item is not None:
            found.append(item)
        if len(found) > limit or steps > STEPS_PER_SET * limit:
            raise StructureError(
                f"there are more than {limit} {what}, or too many to search through: take fewer sensors or a part of "
                "the model, or raise the limit"
            )
    return tuple(sorted(found))


def _minimal(equations: Equations, n_variables: int, marked: frozenset[int]) -> Iterator[EquationSet | None]:
    """Give each minimal PSO set with a marked equation once, and None after a step that finds none.

    FindMSO(M, R) of Krysander, Aslund and Nyberg 2008; R, the equations that may be taken away, are `allowed`.
    """
    levels = [iter([_whole(equations, n_variables, marked)])]
    while levels:
        proper = next(levels[-1], None)
        if proper is None:
            levels.pop()
        elif proper.rank == 1:
            yield tuple(proper.equations)
        elif proper.rank > 1:
            found = search_classes(equations, proper.matched, proper.held, proper.equations)
            if proper.rank == 2:
                top_of = dict(zip(found.order, found.top, strict=True))
                ordered = [(equation, top_of[equation]) for equation in proper.equations]
                for left_out, equal in _marks(found, marked):
                    if equal <= proper.allowed:
                        yield tuple([equation for equation, top in ordered if top != left_out])
            else:
                levels.append(_smaller(equations, found, proper, marked))
            yield None


def _whole(equations: Equations, n_variables: int, marked: frozenset[int]) -> _Proper:
    """Give the over-determined part. Its rank: what its marked equations have to spare, if all others stay."""
    matched = match(equations, n_variables)
    over = redundant(equations, matched)
    others = match([() if e in marked or e not in over else row for e, row in enumerate(equations)], n_variables)
    lost = sum(equation in over for equation in matched) - sum(equation >= 0 for equation in others)
    return _Proper(
        equations=sorted(over),
        matched=list(matched),
        held=holdings(equations, matched),
        rank=len(marked & over) - lost,
        allowed=marked,
        kept=_Kept(frozenset(), list(others), holdings(equations, others), 0),
    )


def _marks(found: ClassSearch, marked: frozenset[int]) -> list[tuple[int, frozenset[int]]]:
    """Give the marked equations of each class that has any, with the position that stands for the class."""
    marks: dict[int, list[int]] = {}
    for equation, top in zip(found.order, found.top, strict=True):
        if equation in marked:
            marks.setdefault(top, []).append(equation)
    return [(top, frozenset(equal)) for top, equal in marks.items()]


def _smaller(equations: Equations, found: ClassSearch, proper: _Proper, marked: frozenset[int]) -> Iterator[_Proper]:
    """Give the PSO sets without one class.

    for each class [e] within R: R = R without [e]; FindMSO(M without [e], R)

    Ours: branches without results are cut. The classes before [e] stay in M; once they are a test by themselves, they
    are the only smaller set left.
    """
    marks = _marks(found, marked)
    removable = [(top, equal) for top, equal in marks if equal <= proper.allowed]
    stay = frozenset[int]().union(*(equal for _, equal in marks if not equal <= proper.allowed))
    allowed, kept = proper.allowed, _keep(equations, proper.kept, stay)
    for top, equal in removable:
        if kept.spare:
            break
        allowed -= equal
        yield _without(found, proper, top, allowed, kept)
        kept = _keep(equations, kept, equal)
    if kept.spare == 1:  # the set of the kept equations and of all unmarked ones that they check or that check them
        own = {equation for equation in proper.equations if equation not in marked or equation in kept.equations}
        over = redundant([row if equation in own else () for equation, row in enumerate(equations)], kept.matched) & own
        if kept.equations <= over:
            yield replace(proper, equations=[equation for equation in proper.equations if equation in over], rank=1)


def _keep(equations: Equations, kept: _Kept, more: frozenset[int]) -> _Kept:
    """Give what is kept with some more."""
    matched, held, spare = kept.matched.copy(), kept.held.copy(), kept.spare
    for equation in sorted(more - kept.equations):
        spare += not augment(equation, equations, matched, held, set())
    return _Kept(kept.equations | more, matched, held, spare)


def _without(found: ClassSearch, proper: _Proper, left_out: int, allowed: frozenset[int], kept: _Kept) -> _Proper:
    """Give the set without a class. Its first equation is freed by turning the path round that leads to it."""
    matched, held = proper.matched.copy(), proper.held.copy()
    position = left_out
    variable = held[found.order[position]]
    while position := found.before[position]:
        equation = found.order[position]
        matched[variable], held[equation], variable = equation, variable, held[equation]
    gone = {equation for equation, top in zip(found.order, found.top, strict=True) if top == left_out}
    return _Proper(
        equations=[equation for equation in proper.equations if equation not in gone],
        matched=matched,
        held=held,
        rank=proper.rank - 1,
        allowed=allowed,
        kept=kept,
    )


def signatures(sets: Sequence[Collection[int]], faults: Sequence[int]) -> BoolArray:
    """Give the fault signature matrix (n_sets, n_faults), True where the fault enters an equation of the set."""
    table = [[equation in equations for equation in faults] for equations in sets]
    return np.array(table, dtype=np.bool_).reshape(len(sets), len(faults))
