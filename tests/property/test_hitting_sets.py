"""Hitting sets and diagnoses against brute force on random small families."""

from itertools import combinations

from hypothesis import given, settings
from hypothesis import strategies as st

from faultbond.sets import (
    conflict_sets,
    hitting_index,
    hypotheses,
    hypotheses_left,
    minimal_diagnoses,
    minimal_hitting_sets,
    smallest,
    without_cleared,
)

UNIVERSE = "ABCDEFG"
Sets = list[frozenset[str]]

some = st.frozensets(st.sampled_from(UNIVERSE), min_size=1, max_size=4)
families = st.lists(some, max_size=6)


def brute_force(conflicts: Sets) -> set[frozenset[str]]:
    """Give the minimal hitting sets by trying every set, smallest first."""
    found: list[frozenset[str]] = []
    for size in range(len(UNIVERSE) + 1):
        for item in map(frozenset, combinations(UNIVERSE, size)):
            if all(item & conflict for conflict in conflicts) and not any(known <= item for known in found):
                found.append(item)
    return set(found)


@given(families)
def test_hitting_sets_are_minimal_and_complete(conflicts: Sets) -> None:
    """The hitting sets are those that brute force finds, each once, smallest first."""
    found = minimal_hitting_sets(conflicts)
    assert set(found) == brute_force(conflicts)
    assert len(set(found)) == len(found)
    assert [len(item) for item in found] == sorted(len(item) for item in found)


@given(families, st.randoms(use_true_random=False))
def test_the_order_of_conflicts_does_not_matter(conflicts: Sets, random: object) -> None:
    """Shuffled conflicts give the same tuple."""
    shuffled = list(conflicts)
    random.shuffle(shuffled)  # type: ignore[attr-defined]
    assert minimal_hitting_sets(shuffled) == minimal_hitting_sets(conflicts)


@given(families)
def test_hitting_twice_gives_the_smallest_conflicts(conflicts: Sets) -> None:
    """The minimal hitting sets of the minimal hitting sets are the smallest conflicts."""
    assert set(minimal_hitting_sets(minimal_hitting_sets(conflicts))) == set(smallest(conflicts))


@given(families, st.integers(0, 4))
def test_a_limit_of_size_only_leaves_out(conflicts: Sets, size: int) -> None:
    """With a limit of size, exactly the larger hitting sets are missing."""
    assert set(minimal_hitting_sets(conflicts, size)) == {item for item in brute_force(conflicts) if len(item) <= size}


@given(families, st.integers(0, 5), st.booleans())
def test_diagnoses_by_testing_are_the_hitting_sets(conflicts: Sets, size: int, explained: bool) -> None:
    """Testing finds the hitting sets of the conflicts that the test obeys, with or without their being told."""

    def is_consistent(suspended: frozenset[str]) -> bool:
        return all(conflict & suspended for conflict in conflicts)

    def explain(suspended: frozenset[str]) -> frozenset[str]:
        return next(conflict for conflict in conflicts if not conflict & suspended)

    found = minimal_diagnoses(UNIVERSE, is_consistent, size, explain if explained else None)
    assert set(found.sets) == {item for item in brute_force(conflicts) if len(item) <= size}
    assert found.tests <= len(hypotheses(UNIVERSE, size)) + 1
    assert all(not is_consistent(frozenset(UNIVERSE) - conflict) for conflict in found.conflicts)


@given(families)
@settings(max_examples=60)
def test_largest_tests_leave_exactly_the_consistent_hypotheses(conflicts: Sets) -> None:
    """After testing all sets of N - 1 suspects, a hypothesis is left if it meets each conflict so shown."""
    verdicts = {
        tested: all(conflict & tested for conflict in conflicts) for tested in map(frozenset, combinations("ABCDE", 4))
    }
    shown = conflict_sets("ABCDE", verdicts)
    expected = {
        item for item in hypotheses("ABCDE", 4) if all(item & conflict for conflict in shown) and any(verdicts.values())
    }
    assert set(hypotheses_left(verdicts)) == expected


@given(families.filter(bool), st.lists(some, max_size=3))
def test_the_rule_on_subsets_never_acts_on_complete_hitting_sets(conflicts: Sets, cleared: Sets) -> None:
    """With all minimal hitting sets and true verdicts there is always the other hitting set that the rule asks for."""
    true = [item for item in cleared if not any(conflict <= item for conflict in conflicts)]
    found = minimal_hitting_sets(conflicts)
    assert without_cleared(found, true) == found


@given(st.dictionaries(some, st.floats(0.0, 2.0), min_size=1), some)
def test_hitting_index_of_nothing_and_of_everything(
    indices: dict[frozenset[str], float], diagnosis: frozenset[str]
) -> None:
    """The index of the empty set is the sum of the limited indices; hitting every set adds up to the opposite."""
    limited = sum(min(index, 0.5) for index in indices.values())
    assert abs(hitting_index(frozenset[str](), indices) - limited) < 1e-12
    assert abs(hitting_index(UNIVERSE, indices) - (0.5 * len(indices) - limited)) < 1e-12
    assert 0.0 <= hitting_index(diagnosis, indices) <= 0.5 * len(indices)
