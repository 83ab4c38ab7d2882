"""Structural algorithms against their definitions, by brute force on random small models."""

from collections import Counter
from collections.abc import Callable, Iterable, Iterator, Sequence
from functools import cache
from itertools import combinations, combinations_with_replacement

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.sparse import csr_array
from scipy.sparse.csgraph import maximum_bipartite_matching

from faultbond.diagnosability.classes import classes
from faultbond.diagnosability.isolability import Interpretation, isolability
from faultbond.diagnosability.overdetermined import minimal_sets, minimal_supports
from faultbond.diagnosability.placement import sensors_to_detect, sensors_to_isolate
from faultbond.diagnosability.structural import StructuralModel
from faultbond.equations import matching
from faultbond.equations.matching import (
    DulmageMendelsohnPart,
    blocks,
    closure,
    decompose,
    match,
    redundant,
    undetermined,
)

Rows = tuple[tuple[int, ...], ...]

N_VARIABLES = 6
few = settings(max_examples=60, deadline=None)


def rows_in(n_variables: int, *, least: int = 0, most: int = 8) -> st.SearchStrategy[Rows]:
    """Random equations in some variables."""
    row = st.sets(st.integers(0, n_variables - 1), max_size=3).map(lambda item: tuple(sorted(item)))
    return st.lists(row, min_size=least, max_size=most).map(tuple)


rows = rows_in(N_VARIABLES)
redundant_rows = st.integers(1, N_VARIABLES).flatmap(lambda n: rows_in(n, least=5, most=9))


@st.composite
def dynamic(draw: st.DrawFn) -> StructuralModel:
    """A model of one or two states, with faults in up to three of its algebraic equations."""
    n_states = draw(st.integers(1, 2))
    n_variables = 2 * n_states + draw(st.integers(0, 1))
    algebraic = draw(rows_in(n_variables, least=1, most=5))
    faults = draw(st.lists(st.integers(0, len(algebraic) - 1), max_size=3))
    return StructuralModel(
        equations=algebraic + tuple((2 * k, 2 * k + 1) for k in range(n_states)),
        n_variables=n_variables,
        faults=tuple(faults),
        differentials=tuple((len(algebraic) + k, 2 * k, 2 * k + 1) for k in range(n_states)),
    )


@st.composite
def determined(draw: st.DrawFn) -> StructuralModel:
    """A model of three or four variables in which each is determined, with up to three faults."""
    n_variables = draw(st.integers(3, 4))
    others = draw(st.lists(st.sets(st.integers(0, n_variables - 1), max_size=2), min_size=n_variables, max_size=5))
    equations = tuple(tuple(sorted({k} | row if k < n_variables else row)) for k, row in enumerate(others))
    faults = draw(st.lists(st.integers(0, len(equations) - 1), min_size=1, max_size=3, unique=True))
    return StructuralModel(equations=equations, n_variables=n_variables, faults=tuple(faults))


@cache
def rank(equations: Rows, free: int = (1 << N_VARIABLES) - 1) -> int:
    """Size of a largest matching, by trying every variable for every equation; `free` has a bit for each left."""
    if not equations:
        return 0
    first, rest = equations[0], equations[1:]
    tried = [1 + rank(rest, free & ~(1 << variable)) for variable in first if free >> variable & 1]
    return max([rank(rest, free), *tried])


def of(equations: Sequence[Sequence[int]], chosen: Iterable[int]) -> Rows:
    """Some equations, in an order that helps the cache."""
    return tuple(sorted(tuple(equations[equation]) for equation in chosen))


def checked(equations: Rows, chosen: frozenset[int]) -> frozenset[int]:
    """By definition: the equations without which the others determine as many variables."""
    whole = rank(of(equations, chosen))
    return frozenset(e for e in chosen if rank(of(equations, chosen - {e})) == whole)


def subsets(items: Iterable[int]) -> Iterator[frozenset[int]]:
    """All subsets, smallest first."""
    given_items = list(items)
    for size in range(len(given_items) + 1):
        yield from map(frozenset, combinations(given_items, size))


def valid(equations: Rows, matched: Sequence[int]) -> bool:
    """Whether each matched variable is in its equation, and no equation determines two."""
    used = [equation for equation in matched if equation >= 0]
    contained = all(variable in equations[e] for variable, e in enumerate(matched) if e >= 0)
    return contained and len(used) == len(set(used))


@given(rows)
def test_matching_is_largest(equations: Rows) -> None:
    """No matching is larger: not the one of scipy, nor any found by trying all."""
    matched = match(equations, N_VARIABLES)
    assert valid(equations, matched)
    size = sum(equation >= 0 for equation in matched)
    assert size == rank(tuple(sorted(equations)))
    table = np.array([[variable in row for variable in range(N_VARIABLES)] for row in equations], dtype=np.int8)
    if equations:
        assert size == np.sum(maximum_bipartite_matching(csr_array(table)) >= 0)


@given(rows)
def test_earlier_equations_are_preferred(equations: Rows) -> None:
    """The matched equations are the first independent ones, one by one."""
    first: list[int] = []
    for equation in range(len(equations)):
        if rank(of(equations, [*first, equation])) > len(first):
            first.append(equation)
    assert sorted(e for e in match(equations, N_VARIABLES) if e >= 0) == first


@given(rows)
def test_large_models_are_matched_as_well(equations: Rows) -> None:
    """The matching for large models is a largest one too."""
    matched = matching.match_any(equations, N_VARIABLES)
    assert valid(equations, matched)
    assert sum(e >= 0 for e in matched) == rank(tuple(sorted(equations)))


@given(rows)
def test_parts_by_definition(equations: Rows) -> None:
    """Over-determined: equations to spare. Under-determined: variables that a largest matching may leave out."""
    parts = decompose(equations, N_VARIABLES)
    every = frozenset(range(len(equations)))
    assert set(parts.over.equations) == checked(equations, every)
    whole = rank(tuple(sorted(equations)))
    free = {v for v in range(N_VARIABLES) if rank(tuple(sorted(equations)), (1 << N_VARIABLES) - 1 - (1 << v)) == whole}
    assert set(parts.under.variables) == free
    assert len(parts.just.equations) == len(parts.just.variables)
    for kind in ("equations", "variables"):
        together = [item for part in (parts.over, parts.just, parts.under) for item in getattr(part, kind)]
        assert sorted(together) == list(range(len(equations) if kind == "equations" else N_VARIABLES))


@given(rows, st.data())
def test_order_does_not_matter_for_parts(equations: Rows, data: st.DataObject) -> None:
    """Equations and variables in another order fall into the same parts, whichever matching is found."""
    order = data.draw(st.permutations(range(len(equations))))
    renamed = data.draw(st.permutations(range(N_VARIABLES)))
    shuffled = tuple(tuple(renamed[variable] for variable in equations[equation]) for equation in order)
    one, other = decompose(equations, N_VARIABLES), decompose(shuffled, N_VARIABLES)
    for part, found in ((one.over, other.over), (one.just, other.just), (one.under, other.under)):
        back = DulmageMendelsohnPart(
            equations=tuple(sorted(order[equation] for equation in found.equations)),
            variables=tuple(sorted(renamed.index(variable) for variable in found.variables)),
        )
        assert part == back


@given(rows)
def test_closure_is_computable(equations: Rows) -> None:
    """A closure contains an equation for each of its variables unless one of them is undetermined, and no more."""
    matched = match(equations, N_VARIABLES)
    free = undetermined(equations, N_VARIABLES, matched)
    for target in range(N_VARIABLES):
        needed, variables = closure([target], equations, matched)
        assert (len(needed) == len(variables)) == free.isdisjoint(variables)
        assert {v for e in needed for v in equations[e]} | {target} == set(variables)


@given(rows)
def test_blocks_are_in_order_and_indivisible(equations: Rows) -> None:
    """Each block needs earlier ones only, and within a block every equation needs every other."""
    matched = match(equations, N_VARIABLES)
    found = blocks(equations, matched)
    place = {equation: k for k, block in enumerate(found) for equation in block}
    assert len(place) == sum(map(len, found)) == sum(e >= 0 for e in matched)
    needs = {e: {matched[v] for v in equations[e] if matched[v] >= 0} for e in place}
    assert all(place[other] <= place[equation] for equation in place for other in needs[equation])
    for block in found:
        inside = {block[0]}
        while more := {o for e in block for o in needs[e] & set(block) if e in inside and o not in inside}:
            inside |= more
        backward = {block[0]}
        while more := {e for e in block if needs[e] & backward and e not in backward}:
            backward |= more
        assert inside == backward == set(block)


@given(rows)
def test_classes_by_definition(equations: Rows) -> None:
    """The class of an equation is what is no longer checked without it."""
    matched = match(equations, N_VARIABLES)
    label = classes(equations, matched)
    over = checked(equations, frozenset(range(len(equations))))
    assert over == redundant(equations, matched) == {e for e, lowest in enumerate(label) if lowest >= 0}
    for equation in over:
        own = over - checked(equations, frozenset(range(len(equations))) - {equation})
        assert {e for e in over if label[e] == label[equation]} == own
        assert label[equation] == min(own)


@given(redundant_rows)
@few
def test_minimal_sets_are_minimal_and_complete(equations: Rows) -> None:
    """The MSO sets are the smallest nonempty sets that check themselves; each is given once."""
    smallest: list[frozenset[int]] = []
    for chosen in subsets(range(len(equations))):
        if chosen and checked(equations, chosen) == chosen and not any(known < chosen for known in smallest):
            smallest.append(chosen)
    assert minimal_sets(equations, N_VARIABLES) == tuple(sorted(tuple(sorted(chosen)) for chosen in smallest))


@given(redundant_rows, st.sets(st.integers(0, 8), max_size=7))
@few
def test_minimal_supports_by_definition(equations: Rows, drawn: set[int]) -> None:
    """A support is a set that checks itself, responds to a fault, and is the largest with these faults."""
    faults = {equation for equation in drawn if equation < len(equations)}
    proper = [chosen for chosen in subsets(range(len(equations))) if checked(equations, chosen) == chosen]
    supports = [
        one
        for one in proper
        if one & faults and not any(one < other and other & faults == one & faults for other in proper)
    ]
    smallest = [one for one in supports if not any(other < one for other in supports)]
    assert minimal_supports(equations, N_VARIABLES, faults) == tuple(sorted(tuple(sorted(one)) for one in smallest))


def matchings(equations: Rows, chosen: list[int], variables: list[int]) -> Iterator[dict[int, int]]:
    """All ways of giving each variable an equation of its own: variable -> equation."""
    if not variables:
        yield {}
        return
    for equation in chosen:
        if variables[0] in equations[equation]:
            rest = [other for other in chosen if other != equation]
            for more in matchings(equations, rest, variables[1:]):
                yield {variables[0]: equation, **more}


def admissible(model: StructuralModel, way: dict[int, int], interpretation: Interpretation) -> bool:
    """Whether a matching uses the differential equations as an interpretation allows."""
    if interpretation is Interpretation.INTEGRAL:
        return all(way.get(rate) != equation for equation, rate, _ in model.differentials)
    for equation, rate, quantity in model.differentials:
        if way.get(quantity) == equation:
            return False
        if way.get(rate) == equation:  # to be differentiated, the quantity must not depend on the rate
            needed = {quantity}
            while more := {v for known in needed for v in model.equations[way[known]]} - needed:
                needed |= more
            if rate in needed:
                return False
    return True


def largest_checked(model: StructuralModel, chosen: frozenset[int], interpretation: Interpretation) -> frozenset[int]:
    """By definition: the union of all sets that check themselves and compute their variables admissibly."""
    if interpretation is Interpretation.MIXED:
        return checked(model.equations, chosen)
    found: frozenset[int] = frozenset()
    for part in subsets(chosen):
        if not part <= found and checked(model.equations, part) == part:
            variables = sorted({variable for equation in part for variable in model.equations[equation]})
            ways = matchings(model.equations, sorted(part), variables)
            if any(admissible(model, way, interpretation) for way in ways):
                found |= part
    return found


@given(dynamic(), st.sampled_from(Interpretation))
@settings(max_examples=150, deadline=None)
def test_isolability_by_definition(model: StructuralModel, interpretation: Interpretation) -> None:
    """A fault is isolable from another if what does not contain the other's equation still checks its own."""
    every = frozenset(range(len(model.equations)))
    found = isolability(model, interpretation)
    over = largest_checked(model, every, interpretation)
    assert found.detectable.tolist() == [equation in over for equation in model.faults]
    for g, removed in enumerate(model.faults):
        left = largest_checked(model, every - {removed}, interpretation)
        assert found.isolable[:, g].tolist() == [equation in left for equation in model.faults]


@given(dynamic(), st.sampled_from(Interpretation))
def test_a_fault_of_its_own_equation_is_the_same_fault(model: StructuralModel, interpretation: Interpretation) -> None:
    """A parameter as unknown, with an equation that carries its fault, is found and told apart just as before."""
    n_equations = len(model.equations)
    contents = [list(row) for row in model.equations]
    for k, equation in enumerate(model.faults):
        contents[equation].append(model.n_variables + k)
    contents += [[model.n_variables + k] for k in range(len(model.faults))]
    explicit = StructuralModel(
        equations=tuple(map(tuple, contents)),
        n_variables=model.n_variables + len(model.faults),
        faults=tuple(n_equations + k for k in range(len(model.faults))),
        differentials=model.differentials,
    )
    one, other = isolability(model, interpretation), isolability(explicit, interpretation)
    assert np.array_equal(one.detectable, other.detectable)
    assert np.array_equal(one.isolable, other.isolable)


def with_sensors(model: StructuralModel, sensors: Sequence[int], faulty: bool) -> StructuralModel:
    """A model with further sensors; with a fault for each, if they can have any."""
    n_equations = len(model.equations)
    return StructuralModel(
        equations=model.equations + tuple((variable,) for variable in sensors),
        n_variables=model.n_variables,
        faults=model.faults + tuple(n_equations + k for k in range(len(sensors)) if faulty),
    )


def smallest(places: Sequence[int], good: Callable[[Sequence[int]], bool]) -> set[tuple[int, ...]]:
    """The smallest collections of at most four sensors that are good enough, by trying all."""
    found: list[tuple[int, ...]] = []
    for size in range(5):
        for sensors in combinations_with_replacement(sorted(places), size):
            if not any(Counter(known) <= Counter(sensors) for known in found) and good(sensors):
                found.append(sensors)
    return set(found)


@given(determined(), st.sets(st.integers(0, 2), min_size=1))
@few
def test_sensors_to_detect_by_trying_all(model: StructuralModel, places: set[int]) -> None:
    """The sets are the smallest ones that detect all that a sensor at every place detects."""

    def detected(sensors: Sequence[int]) -> list[bool]:
        found = isolability(with_sensors(model, sensors, faulty=False)).detectable
        return [bool(value) for value in found]

    best = detected([*places])
    assert set(sensors_to_detect(model, places)) == smallest([*places], lambda item: detected(item) == best)


@given(determined(), st.sets(st.integers(0, 2), min_size=1), st.booleans())
@few
def test_sensors_to_isolate_by_trying_all(model: StructuralModel, places: set[int], faulty: bool) -> None:
    """The sets are the smallest ones that find and tell apart all that three sensors at every place do."""
    n_faults = len(model.faults)

    def apart(sensors: Sequence[int]) -> tuple[list[bool], list[list[bool]], bool]:
        found = isolability(with_sensors(model, sensors, faulty))
        seen, either = found.detectable, found.isolable | np.eye(len(found.detectable), dtype=np.bool_)
        of_sensors = either[n_faults:] & either[:, n_faults:].T | ~seen
        return seen[:n_faults].tolist(), either[:n_faults, :n_faults].tolist(), bool(of_sensors.all())

    best = apart([*places] * 3)
    expected = smallest([*places], lambda item: apart(item) == best)
    sets = sensors_to_isolate(model, places, faulty=places if faulty else ())
    assert {sensors for sensors in sets if len(sensors) < 5} == expected
