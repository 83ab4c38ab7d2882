"""Sets that cannot be told apart, exactly or nearly, and the reasons given."""

from collections.abc import Iterable
from dataclasses import replace
from itertools import combinations

import numpy as np
import pytest

from faultbond.analysis import groups as module
from faultbond.analysis.groups import NEAR_ANGLE, groups, largest_angles, near_groups, near_pairs
from faultbond.analysis.ranks import ReducedSensitivities, reduce, told_rank
from faultbond.analysis.testable import generic_run, judge, sets_to_test
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from plants import TANK_SENSORS, circuit, example, named, positions, run


def chosen(seen: ReducedSensitivities, largest: int) -> tuple[tuple[int, ...], ...]:
    """The sets that the bank would test."""
    return sets_to_test(judge(seen, range(len(seen.parameters)), largest)).sets


def generic(model: StepModel, largest: int = 1) -> list[tuple[list[tuple[str, ...]], str]]:
    """Groups and reasons, everything excited."""
    seen = reduce([generic_run(model)])
    return [(named(model, group.sets), group.reason) for group in groups(seen, chosen(seen, largest))]


def of_columns(*columns: list[float], relative: bool = True, lengths: FloatArray | None = None) -> ReducedSensitivities:
    """What a made-up plant shows on two sensors, rows in turn."""
    matrix = np.array(columns, dtype=np.float64).T
    n = matrix.shape[1]
    return ReducedSensitivities(
        outputs=("flow", "pressure"),
        parameters=tuple("ABCDEFGH"[:n]),
        steps=np.ones(n),
        relative=np.full(n, relative),
        columns=matrix,
        row_outputs=np.arange(len(matrix)) % 2,
        lengths=np.ones(n) if lengths is None else lengths,
        matrix=matrix,
        rank=told_rank(np.asarray(np.linalg.svd(matrix, compute_uv=False), dtype=np.float64)),
    )


def test_the_motor_has_no_groups() -> None:
    """No two of the motor's fifteen testable sets look exactly alike."""
    assert generic(example("dc_motor"), 2) == []


def test_only_a_product_acts() -> None:
    """Of the RC circuit only the product R C shows in the voltage of C."""
    assert generic(example("rc")) == [([("R",), ("C",)], "only R*C acts")]


def test_only_a_sum_acts() -> None:
    """Where the tank's flow itself is measured, only the sum of the resistances of pipe and orifice acts."""
    model = example("tank", (TANK_SENSORS, TANK_SENSORS.replace("sqrt(orifice.e/K_meter)", "line.f")))
    assert generic(model) == [([("K1",), ("K2",)], "only K1 + K2 acts")]


def test_only_a_difference_acts() -> None:
    """Of two sources against each other only the difference acts."""
    model = circuit(
        "  A: {type: Se, law: e = A, parameters: {A: 9 V}}\n  B: {type: Se, law: e = -B, parameters: {B: 4 V}}\n"
        "  R: {type: R, parameters: {R: 10 ohm}}\n  L: {type: I, parameters: {L: 2 H}}",
        "line: 1",
        "source -> line -> R, line -> L, A -> line, B -> line",
        "i: {reads: line.f, unit: A, noise: 1 mA}",
    )
    assert generic(model) == [([("A",), ("B",)], "only A - B acts")]


def test_only_powers_act() -> None:
    """A product of powers is found with whole exponents."""
    model = circuit(
        "  R: {type: R, law: e = A**2*f/sqrt(B)*D, parameters: {A: 3, B: 4, D: 2 ohm}}\n"
        "  L: {type: I, parameters: {L: 2 H}}",
        "line: 1",
        "source -> line -> R, line -> L",
        "i: {reads: line.f, unit: A, noise: 1 mA}",
    )
    assert generic(model) == [([("A",), ("B",), ("D",)], "only A**4*D**2/B acts")]


def test_valves_that_stand_still() -> None:
    """With constant valves K1 and K7, K4 and K6 look alike, alone and with others; their effects are compared."""
    model = example("tank")
    seen = reduce([run(model, np.tile([60.0, 40.0], (60, 1)), 30.0, [0.02])])
    found = {tuple(named(model, group.sets)): group.reason for group in groups(seen, chosen(seen, 2))}
    K1, K4, K6, K7 = (model.plant.graph.parameter(name).nominal for name in ("K1", "K4", "K6", "K7"))
    by_valve = f"1 % of K7 acts as about {2 * K7**2 * 40.0**4 / K1:.2g} % of K1"
    assert found[("K1",), ("K7",)] == by_valve
    assert found[("K4",), ("K6",)] == f"1 % of K6 acts as about {K6 / (40.0 * K4):.2g} % of K4"
    assert found[("K1", "K2"), ("K2", "K7")] == by_valve
    assert found[("K1", "K4"), ("K1", "K6"), ("K7", "K4"), ("K7", "K6")] == "they act through the same 2 combinations"


def test_groups_are_those_of_the_definition() -> None:
    """Two sets share a group where their union has the rank of each: by brute force on random dependent columns."""
    rng = np.random.default_rng(4)
    base = rng.standard_normal((12, 4))
    mixes = [base[:, 0], base[:, 0] * 3, base[:, 1], base[:, 0] + base[:, 1], base[:, 2], base[:, 3], -2 * base[:, 3]]
    seen = of_columns(*(list(column / np.linalg.norm(column)) for column in mixes))
    for size in (1, 2, 3):
        sets = [item for item in combinations(range(7), size) if rank(seen, item) == size]
        pairs = {frozenset(pair) for group in groups(seen, sets) for pair in combinations(group.sets, 2)}
        wanted = {frozenset((a, b)) for a, b in combinations(sets, 2) if rank(seen, {*a, *b}) == size}
        assert pairs == wanted
        assert wanted


def rank(seen: ReducedSensitivities, members: Iterable[int]) -> int:
    """Rank of some columns."""
    return int(np.linalg.matrix_rank(seen.columns[:, np.array(list(members))]))


def test_sets_that_explain_anything_are_one_group() -> None:
    """Sets as large as the rank all look alike."""
    seen = of_columns([1, 0, 0, 0], [0, 1, 0, 0], [0.6, 0.8, 0, 0])
    (found,) = groups(seen, list(combinations(range(3), 2)))
    assert (found.sets, found.reason) == (((0, 1), (0, 2), (1, 2)), "each of them explains anything")


def test_what_does_not_show_is_one_group() -> None:
    """Where no sensor sees anything of the parameters, they look alike for that reason."""
    model = circuit(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  C: {type: C, parameters: {C: 10 mF}}",
        "line: 1",
        "source -> line -> R, line -> C",
        "v: {reads: source.e, unit: V, noise: 1 mV}",
    )
    assert generic(model) == [([("R",), ("C",)], "none of them shows")]


def test_the_angle_between_sets() -> None:
    """The angle is the largest principal one: two planes of space meet in a line, but differ."""
    one = np.array([[[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]]])
    tilt = np.radians(7.0)
    two = np.array([[[1.0, 0.0], [0.0, np.cos(tilt)], [0.0, np.sin(tilt)]]])
    assert largest_angles(one, two) == pytest.approx([7.0])
    assert largest_angles(one, one) == pytest.approx([0.0], abs=1e-12)


def test_near_groups() -> None:
    """Two suspects four degrees apart are a near group, with the part and the sensor that tell them apart."""
    tilt = np.radians(4.0)
    seen = of_columns([1, 0, 0, 0], [np.cos(tilt), np.sin(tilt), 0, 0], [0, 0, 1, 0])
    found = near_groups(seen, [(0,), (1,), (2,), (0, 2), (1, 2)])
    assert [item.sets for item in found] == [((0,), (1,))]  # with C beside each it follows from this
    assert found[0].angle == pytest.approx(4.0)
    assert found[0].reason == "what {B} does, {A} does too but for 7 %, most of it in pressure"
    assert near_groups(seen, [(0,), (1,), (2,)], threshold=3.9) == ()
    assert NEAR_ANGLE > 4.0


def test_where_pairs_differ_most() -> None:
    """Of two pairs that differ in two directions, the larger difference is named."""
    small, large = np.radians(1.0), np.radians(5.0)
    seen = of_columns(
        [1, 0, 0, 0],
        [0, 1, 0, 0],
        [np.cos(small), 0, 0, np.sin(small)],
        [0, np.cos(large), np.sin(large), 0],
    )
    (found,) = near_groups(seen, [(0, 1), (2, 3)])
    assert found.angle == pytest.approx(5.0)
    assert found.reason == "what {C, D} does, {A, B} does too but for 8.7 %, most of it in flow"


def test_near_groups_take_one_of_each_exact_group() -> None:
    """Of suspects that look exactly alike one is compared with others."""
    tilt = np.radians(4.0)
    seen = of_columns([1, 0, 0], [-1, 0, 0], [np.cos(tilt), np.sin(tilt), 0], [0, 0, 1])
    singles = [(0,), (1,), (2,), (3,)]
    alike = groups(seen, singles)
    assert [group.sets for group in alike] == [((0,), (1,))]
    assert [item.sets for item in near_groups(seen, singles, alike)] == [((0,), (2,))]


def test_noise_decides_which_sets_are_near() -> None:
    """The tank's leak and outlet differ only while the outlet valve moves: the noisier the pressure, the nearer K3."""
    model = example("tank")
    rng = np.random.default_rng(2)
    found = run(model, rng.uniform(20, 90, (60, 2)), 60.0, [0.02])
    K1, K8 = positions(model, "K1", "K8")
    angles = []
    for noise in ([2.8e-6, 180.0], [2.8e-6, 18000.0]):
        seen = reduce([found], np.array(noise))
        angles.append(near_groups(seen, [(K1,), (K8,)], threshold=90.0)[0].angle)
    assert angles[0] != pytest.approx(angles[1], rel=0.05)


def test_near_pairs_are_those_of_the_definition() -> None:
    """Near are the pairs below the angle that no smaller pair explains: by brute force on sets of one, two, three."""
    rng = np.random.default_rng(7)
    base = rng.standard_normal((9, 3))
    columns = np.hstack([base, base + 0.05 * rng.standard_normal((9, 3)), base[:, :1] + base[:, 1:2]])
    columns /= np.linalg.norm(columns, axis=0)
    seen = of_columns(*(list(column) for column in columns.T))
    sets = [item for size in (1, 2, 3) for item in combinations(range(7), size)]
    close = {
        frozenset((a, b))
        for a, b in combinations(sets, 2)
        if len(a) == len(b) and sines(columns, a, b).max() <= np.sin(np.radians(10.0))
    }
    wanted = {pair for pair in close if not shared(pair) or frozenset(rests(pair)) not in close}
    found = near_pairs(seen, sets, [], 10.0)
    assert {frozenset(pair) for pair, _ in found} == wanted
    assert {len(pair[0]) for pair, _ in found} == {1, 2, 3}
    assert len(wanted) < len(close)
    for (one, two), angle in found:
        assert np.sin(np.radians(angle)) == pytest.approx(sines(columns, one, two).max(), rel=1e-9)


def sines(columns: FloatArray, one: tuple[int, ...], two: tuple[int, ...]) -> FloatArray:
    """Sines of the principal angles."""
    first, second = (np.linalg.qr(columns[:, list(chosen)])[0] for chosen in (one, two))
    return np.asarray(np.linalg.svd(second - first @ (first.T @ second), compute_uv=False))


def shared(pair: frozenset[tuple[int, ...]]) -> set[int]:
    """What both sets hold."""
    one, two = pair
    return set(one) & set(two)


def rests(pair: frozenset[tuple[int, ...]]) -> list[tuple[int, ...]]:
    """The sets without what both hold."""
    return [tuple(k for k in chosen if k not in shared(pair)) for chosen in pair]


def test_of_very_many_pairs_the_nearest_are_kept(monkeypatch: pytest.MonkeyPatch) -> None:
    """Where more pairs are close than are looked at, the nearest of them are."""
    angles = np.radians([0.0, 1.0, 3.0, 6.0])
    seen = of_columns(*([float(np.cos(angle)), float(np.sin(angle))] for angle in angles))
    assert len(near_groups(seen, [(0,), (1,), (2,), (3,)])) == 6
    monkeypatch.setattr(module, "MOST_CLOSE", 2)
    found = near_groups(seen, [(0,), (1,), (2,), (3,)])
    assert [item.angle for item in found] == pytest.approx([1.0, 2.0])


def test_lots_that_rounding_makes_alike_are_left_alone(monkeypatch: pytest.MonkeyPatch) -> None:
    """Of sets whose shadows are alike as many are compared as allowed, the smallest lots first."""
    seen = of_columns([1, 0, 0], [-1, 0, 0], [2, 0, 0], [0, 1, 0], [0, 3, 0], [0, 0, 1])
    singles = [(k,) for k in range(6)]
    assert [group.sets for group in groups(seen, singles)] == [((0,), (1,), (2,)), ((3,), (4,))]
    monkeypatch.setattr(module, "MOST_COMPARED", 4)
    assert [group.sets for group in groups(seen, singles)] == [((3,), (4,))]


def test_followers_leave_room_for_others(monkeypatch: pytest.MonkeyPatch) -> None:
    """What follows from single suspects does not crowd out a pair of its own, however few pairs are looked at."""
    tilt = np.radians(0.1)
    seen = of_columns(
        [1, 0, 0, 0], [np.cos(tilt), np.sin(tilt), 0, 0], [0, 0, 1, 0], [0, 0, 0, 1], [0, 0.02, 1, 1], [0, 0, 1, -1]
    )
    monkeypatch.setattr(module, "MOST_CLOSE", 1)
    sets = [*((k,) for k in range(6)), (0, 2), (1, 2), (0, 3), (1, 3), (2, 3), (4, 5)]
    assert [pair for pair, _ in near_pairs(seen, sets, [])] == [((0,), (1,)), ((2, 3), (4, 5))]


def test_comparisons_are_bounded(monkeypatch: pytest.MonkeyPatch) -> None:
    """A size with more sets than can be compared has no near groups."""
    seen = of_columns([1, 0, 0], [1, 1e-3, 0], [0, 0, 1])
    assert len(near_groups(seen, [(0,), (1,), (2,)])) == 1
    monkeypatch.setattr(module, "MOST_COMPARED", 2)
    assert near_groups(seen, [(0,), (1,), (2,)]) == ()


def test_a_parameter_of_nominal_zero() -> None:
    """Without a nominal value a change in per cent means nothing: only the proportion is stated."""
    seen = replace(of_columns([1, 0], [0.5, 0]), relative=np.array([True, False]))
    assert groups(seen, [(0,), (1,)])[0].reason == "B acts as A does, in a fixed proportion"


def test_two_small_angles_at_once_are_near() -> None:
    """Pairs that differ by 8 degrees in each of two directions are 8 degrees apart, not 11."""
    c, s = float(np.cos(np.radians(8.0))), float(np.sin(np.radians(8.0)))
    seen = of_columns([1, 0, 0, 0, 0], [0, 1, 0, 0, 0], [c, 0, s, 0, 0], [0, c, 0, s, 0], [0, 0, 0, 0, 1])
    assert [pair for pair, _ in near_pairs(seen, [(0, 1), (2, 3)], ())] == [((0, 1), (2, 3))]


def test_equal_effects_of_equal_values_are_compared() -> None:
    """Where a sum and a product would both do, as at one point of operation with equal values, neither is claimed."""
    seen = of_columns([1, 0, 0], [1, 0, 0], [0, 1, 0])
    (group,) = groups(seen, [(0,), (1,), (2,)])
    assert group.reason == "1 % of B acts as about 1 % of A"
