"""The thesis' static systems through `watch`, against its tables and the errata: values of golden G4 to G13."""

from collections.abc import Iterable
from math import sqrt
from pathlib import Path

import pytest

from faultbond.analysis.static import watch
from faultbond.io.grid import Grid, on_grid
from faultbond.io.recording import columns_of, read_rows
from faultbond.model.text import load_model
from faultbond.runtime.history import Candidate, Detection, Diagnosis

EXAMPLES = Path(__file__).parents[2] / "examples" / "thesis"


def reports(figure: str) -> tuple[Detection, list[Diagnosis]]:
    """Give what watching the observations of a figure reports."""
    graph = load_model(EXAMPLES / f"{figure}.yaml")
    rows = read_rows(EXAMPLES / f"{figure}.csv", columns_of(graph))
    first, *rest = watch(graph, on_grid(rows, Grid(None)))
    assert isinstance(first, Detection)
    return first, [item for item in rest if isinstance(item, Diagnosis)]


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
