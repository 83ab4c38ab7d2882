"""Conflicts, hitting sets and diagnoses, as algebra of finite sets; nothing here knows what an element is.

A conflict is a set of elements that cannot all be healthy, a hitting set meets every conflict, a diagnosis is a set of
elements whose suspension makes everything else consistent. Results come in one order, smallest first, whatever the
order of what is given. Source: Reiter, Artificial Intelligence 32 (1987); thesis 6.1, 6.4 to 6.6.
"""

from collections.abc import Callable, Collection, Hashable, Iterable, Iterator, Mapping
from dataclasses import dataclass
from itertools import combinations
from math import inf
from typing import Generic, TypeVar

H = TypeVar("H", bound=Hashable)


@dataclass(frozen=True, slots=True, kw_only=True)
class Diagnoses(Generic[H]):
    """What a search by testing found: minimal diagnoses, the conflicts met on the way, the number of tests."""

    sets: tuple[frozenset[H], ...]
    conflicts: tuple[frozenset[H], ...]
    tests: int


def ordered(elements: Iterable[H]) -> list[H]:
    """Give each element once, in one order: texts and numbers by value, others by what `repr` shows."""
    unique = list(set(elements))
    for kind in (str, int):
        if all(isinstance(element, kind) for element in unique):
            return sorted(unique)  # type: ignore[type-var]  # all are of one kind that has an order
    return sorted(unique, key=lambda element: (type(element).__name__, repr(element)))


def by_size(sets: Iterable[frozenset[H]]) -> tuple[frozenset[H], ...]:
    """Give each set once, by size and then by its elements."""
    unique = set(sets)
    place = {element: k for k, element in enumerate(ordered(element for item in unique for element in item))}
    return tuple(sorted(unique, key=lambda item: (len(item), sorted(place[element] for element in item))))


def smallest(sets: Iterable[Collection[H]]) -> tuple[frozenset[H], ...]:
    """Give the sets that contain no other of them."""
    kept: list[frozenset[H]] = []
    for item in by_size(frozenset(given) for given in sets):
        if not any(other <= item for other in kept):
            kept.append(item)
    return tuple(kept)


def largest(sets: Iterable[Collection[H]]) -> tuple[frozenset[H], ...]:
    """Give the sets that no other of them contains, such as the largest sets that can be tested (thesis 6.5)."""
    kept: list[frozenset[H]] = []
    for item in reversed(by_size(frozenset(given) for given in sets)):
        if not any(item <= other for other in kept):
            kept.append(item)
    return by_size(kept)


@dataclass(frozen=True, slots=True)
class _Node:
    """A partial hitting set S of MMCS: S, CAND, uncov, and crit[f], the conflicts that f alone in S meets."""

    chosen: int
    candidates: int
    uncovered: int
    critical: tuple[int, ...]


def minimal_hitting_sets(conflicts: Iterable[Collection[H]], max_size: int | None = None) -> tuple[frozenset[H], ...]:
    """Give all minimal hitting sets, smallest first.

    Without conflicts this is the empty set alone; an empty conflict has no hitting set.

    Parameters
    ----------
    conflicts : sets of hashable elements
    max_size : size of the largest set wanted; None: all

    Source
    ------
    Reiter 1987, definition 4.3; found by MMCS of Murakami and Uno, Discrete Applied Mathematics 170 (2014), section 4,
    which needs no closed tree and thus not the correction of Greiner, Smith and Wilkerson, Artificial Intelligence 41
    (1989). Each set is reached once. Comments quote MMCS.

    Example
    -------
    >>> [sorted(item) for item in minimal_hitting_sets([{"A", "B", "C"}, {"A", "B"}, {"B", "C"}])]
    [['B'], ['A', 'C']]
    """
    minimal = smallest(conflicts)  # a set that meets every smallest conflict meets all
    elements = ordered(element for conflict in minimal for element in conflict)
    place = {element: v for v, element in enumerate(elements)}
    # Sets are integers: bit v is element v, or bit F is conflict F.
    masks = [sum(1 << place[element] for element in conflict) for conflict in minimal]
    covers = [sum(1 << k for k, mask in enumerate(masks) if mask >> v & 1) for v in range(len(elements))]
    found = []
    stack = [_Node(0, (1 << len(elements)) - 1, (1 << len(masks)) - 1, ())]
    while stack:
        node = stack.pop()
        left = sorted((masks[k] & node.candidates for k in _bits(node.uncovered)), key=int.bit_count)
        if max_size is not None and len(node.critical) + _disjoint(left) > max_size:
            continue
        if not node.uncovered:
            found.append(frozenset(elements[v] for v in _bits(node.chosen)))
            continue
        # "choose F from uncov": the one with fewest candidates. "C := CAND and F; CAND := CAND without C"
        candidates = node.candidates & ~left[0]
        for v in _bits(left[0]):  # "for each v in C"
            met = covers[v]
            critical = tuple(own & ~met for own in node.critical)  # "Update_crit_uncov(v, crit[], uncov)"
            if all(critical):  # "if crit[f] is not empty for each f in S then call MMCS(S with v); CAND := CAND with v"
                uncovered = node.uncovered
                stack.append(_Node(node.chosen | 1 << v, candidates, uncovered & ~met, (*critical, uncovered & met)))
                candidates |= 1 << v
    return by_size(found)


def _disjoint(conflicts: Iterable[int]) -> float:
    """Give a number of elements that it takes at least to meet some conflicts: one for each of disjoint ones."""
    total, seen = 0, 0
    for conflict in conflicts:
        if not conflict:
            return inf
        if not conflict & seen:
            total, seen = total + 1, seen | conflict
    return total


def _bits(mask: int) -> Iterator[int]:
    """Give the places of the ones of an integer, lowest first."""
    while mask:
        low = mask & -mask
        yield low.bit_length() - 1
        mask ^= low


def minimal_diagnoses(
    suspects: Iterable[H],
    is_consistent: Callable[[frozenset[H]], bool],
    max_size: int | None = None,
    explain: Callable[[frozenset[H]], Collection[H]] | None = None,
) -> Diagnoses[H]:
    """Find the minimal diagnoses by testing, smallest first.

    Reiter's tree, breadth first: a set that misses a known conflict is not tested but grows by an element of it; a set
    that contains a diagnosis is not tested at all. No conflict is pruned from the tree, so that all are found.

    Parameters
    ----------
    suspects : what may be at fault
    is_consistent : whether the observations can be explained with a set suspended; if so, then with any larger one
    max_size : size of the largest set tested; None: all
    explain : gives, for a set just found inconsistent, a conflict free of it: a set of other suspects that cannot all
        be healthy. The smaller it is, the fewer tests follow. None: all other suspects.

    Source
    ------
    Reiter 1987, section 4; de Kleer and Williams, Artificial Intelligence 32 (1987).
    """
    everyone = frozenset(suspects)
    found: list[frozenset[H]] = []
    conflicts: list[frozenset[H]] = []
    tests = 0
    level: tuple[frozenset[H], ...] = (frozenset(),)
    while level:
        below: set[frozenset[H]] = set()
        for candidate in level:
            if any(known <= candidate for known in found):
                continue
            conflict = next((known for known in conflicts if not known & candidate), None)
            if conflict is None:
                tests += 1
                if is_consistent(candidate):
                    found.append(candidate)
                    continue
                conflict = frozenset(explain(candidate)) if explain is not None else everyone - candidate
                conflicts.append(conflict)
            if max_size is None or len(candidate) < max_size:
                below.update(candidate | {element} for element in conflict)
        level = by_size(below)
    return Diagnoses(sets=tuple(found), conflicts=by_size(conflicts), tests=tests)


def hypotheses(suspects: Iterable[H], max_size: int | None = None) -> tuple[frozenset[H], ...]:
    """Give all sets of suspects but the empty one, 2^N - 1 without a limit of size, smallest first (thesis 3.10)."""
    elements = ordered(suspects)
    top = len(elements) if max_size is None else min(max_size, len(elements))
    return tuple(frozenset(item) for size in range(1, top + 1) for item in combinations(elements, size))


def conflict_sets(suspects: Iterable[H], verdicts: Mapping[frozenset[H], bool]) -> tuple[frozenset[H], ...]:
    """Give the conflicts that tests have shown: the complement of each hypothesis that does not explain (6.4.2).

    Parameters
    ----------
    suspects : all components that may fail
    verdicts : for each tested hypothesis, whether it explains the behaviour
    """
    everyone = frozenset(suspects)
    return by_size(everyone - tested for tested, explains in verdicts.items() if not explains)


def common_subsets(sets: Iterable[Collection[H]]) -> tuple[frozenset[H], ...]:
    """Give what two or more of the sets share, all such sets but the empty one (thesis 6.4.2)."""
    given = {frozenset(item) for item in sets}
    shared: set[frozenset[H]] = set()
    for item in by_size(given):
        shared |= {item & other for other in (given - {item}) | shared}
    return by_size(shared - {frozenset()})


def hypotheses_left(verdicts: Mapping[frozenset[H], bool]) -> tuple[frozenset[H], ...]:
    """Give the hypotheses that tests of the largest testable sets leave: the tested that explain, and their parts.

    A part of a hypothesis that failed fails too; nothing is said about sets that no tested one contains.

    Parameters
    ----------
    verdicts : for each tested hypothesis, whether it explains the behaviour

    Source
    ------
    Thesis 6.4.2 and 6.5.
    """
    failed = [tested for tested, explains in verdicts.items() if not explains]
    explaining = largest(tested for tested, explains in verdicts.items() if explains)
    parts = {part for tested in explaining for part in hypotheses(tested)}
    return by_size(part for part in parts if not any(part <= tested for tested in failed))


def without_cleared(sets: Iterable[Collection[H]], cleared: Iterable[Collection[H]]) -> tuple[frozenset[H], ...]:
    """Apply the rule of 6.4.2 to hitting sets of a limited number of conflicts.

    A hitting set H1 loses a proper subset S that is known not to be a conflict, unless another hitting set H2 has
    nothing in common with S. With all minimal hitting sets of conflicts that contradict no cleared set, there is always
    such an H2; the rule thus works where hitting sets were cut off at a size, or where verdicts were made from noise.

    Parameters
    ----------
    sets : the hitting sets that were gathered
    cleared : sets that have been shown not to be conflicts

    Source
    ------
    Thesis 6.4.2, the rule on proper subsets, as written.
    """
    current = by_size(frozenset(item) for item in sets)
    trusted = by_size(frozenset(item) for item in cleared)
    while True:
        reduced = by_size(_without_first(item, trusted, current) for item in current)
        if reduced == current:
            return current
        current = reduced


def _without_first(
    item: frozenset[H], cleared: tuple[frozenset[H], ...], all_sets: tuple[frozenset[H], ...]
) -> frozenset[H]:
    """Take the first cleared part out of a hitting set that no other hitting set is free of."""
    for part in cleared:
        if part and part < item and all(part & other for other in all_sets if other != item):
            return item - part
    return item


def hitting_index(diagnosis: Collection[H], error_indices: Mapping[frozenset[H], float], limit: float = 0.5) -> float:
    """Give how badly a diagnosis hits the sets with a large error index and misses those with a small one.

    Sum of (limit - error index) over the sets that it hits, plus the error indices of those that it does not hit, each
    error index at most `limit`.

    Parameters
    ----------
    diagnosis : set of elements
    error_indices : error index of each tested potential conflict, 1 being an error of 100 %
    limit : largest error index that counts

    Source
    ------
    Thesis 6.6, the sum in the text.
    """
    own = frozenset(diagnosis)
    limited = [(tested, min(index, limit)) for tested, index in error_indices.items()]
    return sum(limit - index for tested, index in limited if own & tested) + sum(
        index for tested, index in limited if not own & tested
    )
