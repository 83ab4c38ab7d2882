"""The thesis' static systems through `watch`, against its tables and the errata: values of golden G4 to G13."""

from collections.abc import Iterable
from dataclasses import replace
from fractions import Fraction
from itertools import combinations
from math import sqrt
from pathlib import Path

import numpy as np
import pytest
import sympy as sp

from faultbond.contract.findings import Candidate, Detection, Diagnosis
from faultbond.io.grid import Grid, GridPoint, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model
from faultbond.networks.detection import watch
from faultbond.networks.hypothesis import is_consistent
from faultbond.networks.logic.diagnoses import explains, logic_network
from faultbond.networks.propagation import suspend
from faultbond.networks.static_network import READING, Observation, StaticNetwork, observation, static_network
from faultbond.sets import conflict_sets, hypotheses, minimal_diagnoses, minimal_hitting_sets
from faultbond.thesis.tables import Solved, solve_suspects, table_of_pairs, table_of_singles, table_relations

EXAMPLES = Path(__file__).parents[2] / "examples" / "thesis"


def reports(figure: str) -> tuple[Detection, list[Diagnosis]]:
    """Give what watching the observations of a figure reports."""
    graph = load_model(EXAMPLES / f"{figure}.yaml")
    rows = read_rows(EXAMPLES / f"{figure}.csv", columns_of(graph))
    first, *rest = watch(graph, on_grid(rows, Grid(None)))
    assert isinstance(first, Detection)
    return first, [item for item in rest if isinstance(item, Diagnosis)]


def observed(figure: str, rows: Iterable[tuple[float, ...]] = ()) -> tuple[StaticNetwork, list[Observation]]:
    """Give the network of a figure and its observations, or others."""
    network = static_network(load_model(EXAMPLES / f"{figure}.yaml"))
    count = len(network.graph.inputs)
    points = [
        GridPoint(index=k, time=float(k), dt=0.0, u=np.array(row[:count], float), y=np.array(row[count:], float))
        for k, row in enumerate(rows)
    ]
    if not points:
        stated = read_rows(EXAMPLES / f"{figure}.csv", columns_of(network.graph))
        points = list(on_grid(stated, Grid(None)))
    return network, [observation(network, point) for point in points]


def numbers(solved: Solved) -> list[tuple[sp.Expr, ...]]:
    """Give the exact solutions in rising order."""
    return sorted((tuple(point.values()) for point in solved.points), key=lambda item: float(item[0]))


def solutions(candidates: Iterable[Candidate]) -> dict[tuple[str, ...], list[tuple[float, ...]]]:
    """Give the estimates by set of parameters, in rising order."""
    found: dict[tuple[str, ...], list[tuple[float, ...]]] = {}
    for item in candidates:
        found.setdefault(item.parameters, []).append(tuple(suspect.estimate for suspect in item.suspects))
    return {names: sorted(values) for names, values in found.items()}


def test_figure_3_4() -> None:
    """The output 32 instead of 24 is explained by i = 8/3 or by ii = 4, exactly (G7)."""
    detection, (diagnosis,) = reports("fig_3_4")
    assert detection.signals == ("D",)
    assert solutions(diagnosis.candidates) == {("i",): [(8 / 3,)], ("ii",): [(4.0,)]}
    assert all(suspect.sd == 0.0 for item in diagnosis.candidates for suspect in item.suspects)


def test_table_3_3() -> None:
    """After the first observation M1 = 4 or M2 = 4; the second leaves M2 = 4 (G6)."""
    _, (first, second) = reports("fig_3_12")
    assert solutions(first.candidates) == {("M1",): [(4.0,)], ("M2",): [(4.0,)]}
    assert solutions(second.candidates) == {("M2",): [(4.0,)]}


def test_table_3_4() -> None:
    """The first observation has five single diagnoses, two of them by each root of the square (G8)."""
    _, (first, _) = reports("fig_3_14")
    expected = {("M1",): [(-16 / 3,), (8 / 3,)], ("M2",): [(-7.5,), (4.5,)], ("M3",): [(27.75,)]}
    assert solutions(first.candidates) == expected


def test_figure_3_17_is_not_the_only_diagnosis() -> None:
    """Two observations leave three pairs with eight solutions: (2, 15) is not the only one (G8, E3)."""
    _, (_, second) = reports("fig_3_14")
    found = solutions(second.candidates)
    assert found["M1", "M3"] == [(2.0, 15.0), (6.0, -81.0)]
    root = sqrt(30)
    expected = [((-1 - root) / 2, 63 / 2 + root), ((-1 + root) / 2, 63 / 2 - root)]
    assert found["M2", "M3"] == [pytest.approx(pair, rel=1e-14) for pair in expected]
    assert len(found["M1", "M2"]) == 4
    for m1, m2 in found["M1", "M2"]:
        assert (3 * m1 + 2 * m2) ** 2 + 16 == pytest.approx(160, rel=1e-12)
        assert (2 * m1 + 2 * m2) ** 2 + 8 == pytest.approx(94, rel=1e-12)


def test_probabilities_are_shared() -> None:
    """Sets of one size are equally likely, and a set shares its probability among its solutions."""
    _, (first, second) = reports("fig_3_14")
    assert [item.probability for item in first.candidates] == pytest.approx([1 / 6, 1 / 6, 1 / 6, 1 / 6, 1 / 3])
    assert sum(item.probability for item in second.candidates) == pytest.approx(1.0)
    assert all(item.group for item in second.candidates)


def test_table_6_1() -> None:
    """The first observation is explained by A = -2/5, B = 3 or C = 1; from the second on only B = 3 is left (G4)."""
    _, (first, second, third) = reports("fig_6_1")
    assert solutions(first.candidates) == {("A",): [(-0.4,)], ("B",): [(3.0,)], ("C",): [(1.0,)]}
    assert solutions(second.candidates) == solutions(third.candidates) == {("B",): [(3.0,)]}


def test_figure_6_13() -> None:
    """out2 = 170 instead of 180 is explained by C or by E alone, D alone is not enough (G11)."""
    detection, (diagnosis,) = reports("fig_6_13")
    assert detection.signals == ("out2",)
    assert [item.components for item in diagnosis.candidates] == [("C",), ("E",)]
    assert [item.suspects for item in diagnosis.candidates] == [(), ()]


def test_table_3_4_and_3_5_exactly() -> None:
    """All roots of both observations are exact: fractions, and roots of 86 (G8)."""
    first, second = table_of_singles(*observed("fig_3_14"))
    assert numbers(first["M1"]) == [(sp.Rational(-16, 3),), (sp.Rational(8, 3),)]
    assert numbers(first["M2"]) == [(sp.Rational(-15, 2),), (sp.Rational(9, 2),)]
    assert numbers(first["M3"]) == [(sp.Rational(111, 4),)]
    root = sp.sqrt(86) / 2
    assert numbers(second["M1"]) == [(-2 - root,), (-2 + root,)]
    assert numbers(second["M2"]) == [(-1 - root,), (-1 + root,)]
    assert numbers(second["M3"]) == [(sp.Integer(29),)]
    printed = {"M1": [-6.6368, 2.6368], "M2": [-5.6368, 3.6368]}
    for name, values in printed.items():
        assert [float(value) for (value,) in numbers(second[name])] == pytest.approx(values, abs=5e-5)


def test_pairs_of_figure_3_17_exactly() -> None:
    """The pairs that two observations leave have exact values, (2, 15) and (6, -81) among them (G8, E3)."""
    (pairs,) = table_of_pairs(*observed("fig_3_14"))
    assert numbers(pairs["M1", "M3"]) == [(2, 15), (6, -81)]
    root = sp.sqrt(30)
    low, high = numbers(pairs["M2", "M3"])
    assert sp.simplify(low[0] - (-1 - root) / 2) == sp.simplify(low[1] - (sp.Rational(63, 2) + root)) == 0
    assert sp.simplify(high[0] - (-1 + root) / 2) == sp.simplify(high[1] - (sp.Rational(63, 2) - root)) == 0
    assert len(numbers(pairs["M1", "M2"])) == 4


def test_a_third_observation_tells_the_pair() -> None:
    """With M1 = 2 and M3 = 15 in a third observation, only (2, 15) is left (E3)."""
    network, rows = observed("fig_3_14", [(3, 2, 4, 160), (2, 2, 2, 94), (1, 3, 1, 79)])
    verdicts = {
        pair: numbers(solve_suspects(network, pair, rows)) for pair in (("M1", "M2"), ("M1", "M3"), ("M2", "M3"))
    }
    assert verdicts == {("M1", "M2"): [], ("M1", "M3"): [(2, 15)], ("M2", "M3"): []}


@pytest.mark.parametrize(
    ("outputs", "m1", "m2"),
    [((10, 8), (3.987, 2.471), (4.013, 3.944)), ((10.082, 8.003), (4.068, 2.473), (4.054, 3.947))],
)
def test_table_3_6(outputs: tuple[float, float], m1: tuple[float, float], m2: tuple[float, float]) -> None:
    """The printed columns belong to the outputs 10 and 8; the outputs that are printed give others (G9, E2)."""
    rows = [(1.013, 1.987, outputs[0]), (2.016, 1.006, outputs[1])]
    table = table_of_singles(*observed("fig_3_12", rows))
    assert [float(row["M1"].points[0]["M1"]) for row in table] == pytest.approx(m1, abs=5e-4)
    assert [float(row["M2"].points[0]["M2"]) for row in table] == pytest.approx(m2, abs=5e-4)


def test_table_3_6_with_noise_declared() -> None:
    """Stated noise lets M2 = 4 pass where exact arithmetic rejects everything (thesis 3.8)."""
    graph = load_model(EXAMPLES / "fig_3_12.yaml")
    rows = [(1.013, 1.987, 10.082), (2.016, 1.006, 8.003)]
    points = [
        GridPoint(index=k, time=float(k), dt=0.0, u=np.array(row[:2]), y=np.array(row[2:]))
        for k, row in enumerate(rows)
    ]
    *_, exact = watch(replace(graph, max_faults=1), points)
    assert isinstance(exact, Diagnosis)
    assert exact.candidates == ()
    inputs = tuple(replace(item, noise=0.02) for item in graph.inputs)
    noisy = replace(graph, inputs=inputs, sensors=tuple(replace(item, noise=0.05) for item in graph.sensors))
    *_, last = watch(noisy, points)
    assert isinstance(last, Diagnosis)
    ((suspect,),) = (item.suspects for item in last.candidates)
    assert suspect.parameter == "M2"
    assert abs(suspect.estimate - 4.0) < 2.0 * suspect.sd < 0.2


def test_table_6_1_upper_part() -> None:
    """Each observation alone gives A, B and C; only B is the same in all (G4; the text's 0.66 is 2/3, E15)."""
    table = table_of_singles(*observed("fig_6_1"))
    a, b, c = ([row[name].points[0][name] for row in table] for name in "ABC")
    assert a == [sp.Rational(-2, 5), 0, sp.Rational(4, 5)]
    assert b == [3, 3, 3]
    assert c == [1, sp.Rational(2, 3), -2]


def test_table_6_1_lower_part() -> None:
    """One observation ties two parameters by a relation (G4)."""
    network, rows = observed("fig_6_1")
    pairs = list(combinations(network.suspects, 2))
    found = [{pair: table_relations(network, pair, row)[0].text for pair in pairs} for row in rows]
    assert [row["B", "C"] for row in found] == ["B = 17/3 - 2*C/3", "B = 27/5 - 3*C/5", "B = 13/3 - C/3"]
    assert [row["A", "C"] for row in found] == ["A = 14/5 - 4*C/5", "A = 12/5 - 3*C/5", "A = 8/5 - C/5"]
    assert [row["A", "B"] for row in found] == ["A = 18/B - 4", "A = 15/B - 3", "A = 9/B - 1"]


def test_table_6_2() -> None:
    """Observations 1 and 2 give the same pairs as 2 and 3; each has B + C = 7 and A B = 6 (G4)."""
    for table in table_of_pairs(*observed("fig_6_1")):
        assert numbers(table["B", "C"]) == [(3, 4)]
        assert numbers(table["A", "C"]) == [(sp.Rational(6, 5), 2)]
        assert numbers(table["A", "B"]) == [(2, 3)]


def test_conflicts_of_table_6_1() -> None:
    """Sets that no constant values of the other parameters explain are conflicts; {B} and {A, C} meet them (G5, E8)."""
    network, rows = observed("fig_6_1")
    tested = (frozenset[str](), *hypotheses("ABC", 2))
    verdicts = {item: solve_suspects(network, tuple(sorted(item)), rows).explains for item in tested}
    conflicts = conflict_sets("ABC", verdicts)
    assert conflicts == (frozenset("AB"), frozenset("BC"), frozenset("ABC"))
    assert minimal_hitting_sets(conflicts) == (frozenset("B"), frozenset("AC"))
    (pair,) = solve_suspects(network, ("A", "C"), rows).points
    assert pair == {"A": sp.Rational(6, 5), "C": 2}


@pytest.mark.parametrize("inputs", [{"A": True, "B": False}, {"A": False, "B": True}])
def test_full_adder(inputs: dict[str, bool]) -> None:
    """The full adder has the minimal diagnoses {X1}, {X2, A2} and {X2, O1}: there is no O2 (G10, E1)."""
    network = logic_network(load_model(EXAMPLES / "fig_3_7.yaml"))
    seen = {**inputs, "C": True, "D": True, "E": False}
    found = minimal_diagnoses(network.suspects, lambda suspended: explains(network, suspended, [seen]))
    assert found.sets == (frozenset({"X1"}), frozenset({"A2", "X2"}), frozenset({"O1", "X2"}))
    assert minimal_hitting_sets(found.sets) == (frozenset({"X1", "X2"}), frozenset({"A2", "O1", "X1"}))
    assert not explains(network, frozenset({"O1"}), [seen])
    assert explains(network, frozenset({"X2", "A2", "A1"}), [seen])


def test_full_adder_by_watching() -> None:
    """Of the three diagnoses the smallest is reported (G10)."""
    detection, (diagnosis,) = reports("fig_3_7")
    assert detection.signals == ("D", "E")
    assert [item.components for item in diagnosis.candidates] == [("X1",)]


@pytest.mark.parametrize("reading", [170, 90, 400])
def test_all_diagnoses_of_figure_6_13(reading: float) -> None:
    """C, E and three pairs are minimal, D and the larger set {C, D} are not (G11)."""
    network, (seen,) = observed("fig_6_13", [(2, 3, 2, 4, 11, reading)])
    found = minimal_diagnoses(network.suspects, lambda suspended: is_consistent(network, suspended, seen))
    assert found.sets == tuple(map(frozenset, ("C", "E", "AB", "AD", "BD")))
    assert is_consistent(network, "CD", seen)
    assert not is_consistent(network, "D", seen)


def test_signals_of_figure_6_13() -> None:
    """Healthy signals are as printed; with C suspended S3 is open, not 30 (G11, E13)."""
    network, (seen,) = observed("fig_6_13")
    inputs = {name: value for name, value in seen.values.items() if not name.startswith(READING)}
    alone = replace(seen, values=inputs, sensors=())
    healthy = suspend(network, alone, (), {}).known
    assert [healthy[name] for name in ("S1", "S2", "S3", "out1", "out2")] == [6, 5, 30, 11, 180]
    without = suspend(network, alone, ("C",), {}).known
    assert "S3" not in without
    assert suspend(network, seen, ("C",), {}).known["S3"] == Fraction(170, 6)
