"""Conflicts, hitting sets and diagnoses: the thesis' examples, the corner cases, the number of tests."""

import numpy as np
import pytest

from faultbond.sets import (
    by_size,
    common_subsets,
    conflict_sets,
    hitting_index,
    hypotheses,
    hypotheses_left,
    largest,
    minimal_diagnoses,
    minimal_hitting_sets,
    ordered,
    smallest,
    without_cleared,
)

TABLE_6_4 = {
    frozenset("ABC"): True,
    frozenset("ABD"): False,
    frozenset("ACD"): False,
    frozenset("BCD"): True,
}
ERROR_INDICES = {frozenset("A"): 0.05, frozenset("B"): 0.6, frozenset("C"): 0.5, frozenset("D"): 0.03}


def sets(*texts: str) -> tuple[frozenset[str], ...]:
    """Give sets of letters."""
    return tuple(frozenset(text) for text in texts)


def test_conflicts_of_table_6_1_have_two_hitting_sets() -> None:
    """Conflicts ABC, AB, BC are met by {B} and by {A, C}; the thesis names only {B} (G5, E8)."""
    assert minimal_hitting_sets(sets("ABC", "AB", "BC")) == sets("B", "AC")


def test_conflicts_of_the_full_adder_have_three_hitting_sets() -> None:
    """Conflicts {X1, X2} and {X1, A2, O1} are met by {X1}, {X2, A2}, {X2, O1} (G10, E1)."""
    found = minimal_hitting_sets([("X1", "X2"), ("X1", "A2", "O1")])
    assert found == (frozenset({"X1"}), frozenset({"A2", "X2"}), frozenset({"O1", "X2"}))


def test_reiters_example() -> None:
    """The conflicts of Reiter's figure 4 have the six minimal hitting sets of his tree."""
    conflicts = [{2, 4, 5}, {1, 2, 3}, {1, 3, 5}, {2, 4, 6}, {2, 4}, {2, 3, 5}, {1, 6}]
    found = minimal_hitting_sets(conflicts)
    assert found == tuple(map(frozenset, ({1, 2}, {1, 3, 4}, {1, 4, 5}, {2, 3, 6}, {2, 5, 6}, {3, 4, 6})))


def test_no_conflict_and_an_empty_conflict() -> None:
    """Nothing to hit: the empty set does it. An empty conflict: nothing does it."""
    assert minimal_hitting_sets([]) == (frozenset(),)
    assert minimal_hitting_sets([set(), {"A"}]) == ()


def test_elements_of_any_hashable_kind_come_in_one_order() -> None:
    """Numbers sort as numbers, mixed kinds by what they show."""
    assert ordered([10, 9, 10]) == [9, 10]
    assert ordered([(2, "b"), "a", 1]) == [1, "a", (2, "b")]
    assert minimal_hitting_sets([{10, 9}]) == (frozenset({9}), frozenset({10}))


def test_dozens_of_conflicts_over_a_hundred_elements() -> None:
    """Of forty random conflicts over a hundred elements, the smallest hitting sets are minimal."""
    random = np.random.default_rng(1)
    conflicts = [frozenset(random.choice(100, 4, replace=False).tolist()) for _ in range(40)]
    found = minimal_hitting_sets(conflicts, max_size=14)
    assert len(found) == 45
    for item in found:
        assert all(item & conflict for conflict in conflicts)
        assert not any(all((item - {element}) & conflict for conflict in conflicts) for element in item)
    assert minimal_hitting_sets(conflicts, max_size=13) == ()


def test_supersets_of_a_diagnosis_are_not_tested() -> None:
    """Of 16 sets of four suspects, those with A are not tested again once A explains."""
    tested = []

    def is_consistent(suspended: frozenset[str]) -> bool:
        tested.append(suspended)
        return "A" in suspended

    found = minimal_diagnoses("ABCD", is_consistent)
    assert found.sets == sets("A")
    assert found.tests == len(tested) == len(set(tested)) == 1 + 4 + 3 + 1
    assert not any("A" in item for item in tested if len(item) > 1)


def test_a_small_conflict_saves_tests() -> None:
    """A conflict {B, C} told at the first test leaves two singles to test instead of eight, and no larger set."""
    found = minimal_diagnoses("ABCDEFGH", lambda out: bool(out & set("BC")), explain=lambda _: "BC")
    assert found.sets == sets("B", "C")
    assert found.conflicts == sets("BC")
    assert found.tests == 3


def test_a_known_conflict_saves_a_test() -> None:
    """{C} misses the conflict {D, E} that the test of {B} told, so it grows untested."""
    conflicts = sets("BC", "DE")

    def explain(suspended: frozenset[str]) -> frozenset[str]:
        return next(conflict for conflict in conflicts if not conflict & suspended)

    found = minimal_diagnoses("ABCDE", lambda out: all(out & conflict for conflict in conflicts), explain=explain)
    assert found.sets == sets("BD", "BE", "CD", "CE")
    assert found.tests == 1 + 1 + 4


def test_nothing_explains() -> None:
    """Where no set explains there is no diagnosis, and all suspects together are a conflict."""
    found = minimal_diagnoses("AB", lambda _: False)
    assert found.sets == ()
    assert found.tests == 4
    assert frozenset("AB") in found.conflicts


def test_a_healthy_plant_has_the_empty_diagnosis() -> None:
    """If everything is consistent, nothing is at fault, by one test."""
    found = minimal_diagnoses("AB", lambda _: True)
    assert (found.sets, found.conflicts, found.tests) == ((frozenset(),), (), 1)


def test_number_of_hypotheses() -> None:
    """N components have 2^N - 1 hypotheses: 15 for four, 31 for five (G14)."""
    assert len(hypotheses("ABCD")) == 15
    assert len(hypotheses("ABCDE")) == 31
    assert hypotheses("ABC", 2) == sets("A", "B", "C", "AB", "AC", "BC")
    assert hypotheses("AB", 7) == sets("A", "B", "AB")


def test_table_6_4_by_conflicts() -> None:
    """The failed hypotheses of table 6.4 are the conflicts {B} and {C}, hit by {B, C} (G12)."""
    assert conflict_sets("ABCD", TABLE_6_4) == sets("B", "C")
    assert minimal_hitting_sets(conflict_sets("ABCD", TABLE_6_4)) == sets("BC")


def test_table_6_4_by_common_subsets() -> None:
    """The two hypotheses that explain share {B, C}; these three are reported (G12)."""
    assert common_subsets(item for item, explains in TABLE_6_4.items() if explains) == sets("BC")
    assert hypotheses_left(TABLE_6_4) == sets("BC", "ABC", "BCD")


def test_the_rule_keeps_what_table_6_4_reports() -> None:
    """{A} and {D} are no conflicts, but {B, C} has nothing in common with them, so all three stay (G12)."""
    reported = sets("BC", "ABC", "BCD")
    assert without_cleared(reported, sets("A", "D")) == reported


def test_the_rule_takes_out_a_cleared_subset() -> None:
    """Without another hitting set free of {A}, the subset {A} goes out of {A, B, C}."""
    assert without_cleared(sets("ABC"), sets("A")) == sets("BC")
    assert without_cleared(sets("ABC", "AD"), sets("A")) == sets("D", "BC")  # both at once
    assert without_cleared(sets("ABC", "D"), sets("A")) == sets("D", "ABC")
    assert without_cleared(sets("A"), sets("A")) == sets("A")  # not a proper subset


def test_common_subsets_of_three() -> None:
    """Sharing is counted for two and for more sets."""
    assert common_subsets(sets("ABCD", "ABCE", "ABFG")) == sets("AB", "ABC")
    assert common_subsets(sets("AB", "CD")) == ()
    assert common_subsets(sets("AB")) == ()


def test_smallest_and_largest_sets() -> None:
    """Supersets and subsets are dropped, equal sets are kept once."""
    given = sets("ABC", "AB", "BC", "AB", "D")
    assert smallest(given) == sets("D", "AB", "BC")
    assert largest(given) == sets("D", "ABC")
    assert by_size(sets("BC", "A", "AD")) == sets("A", "AD", "BC")


@pytest.mark.parametrize(("diagnosis", "index"), [("BC", 0.08), ("ABC", 0.48), ("B", 0.58), ("A", 1.48)])
def test_hitting_index(diagnosis: str, index: float) -> None:
    """The hitting index is the sum of thesis 6.6, worked by hand (G13)."""
    assert hitting_index(diagnosis, ERROR_INDICES) == pytest.approx(index, abs=1e-12)


def test_another_limit_of_the_error_index() -> None:
    """With a limit of 1, an index of 0.6 counts as it is."""
    assert hitting_index("B", ERROR_INDICES, limit=1.0) == pytest.approx(0.4 + 0.05 + 0.5 + 0.03, abs=1e-12)
