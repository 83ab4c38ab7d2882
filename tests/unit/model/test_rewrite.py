"""Model files with other numbers."""

import pytest

from faultbond.errors import ModelError
from faultbond.model.rewrite import NewParameter, NewSize, rewrite
from faultbond.model.text import parse_model

TEXT = """# the plant
name: rc  # a name
sample_time: 0.1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}   # a resistor of 10 µm wire
  C:
    type: C
    parameters:
      C:
        nominal: 50 mF   # as printed on it
        change: 100 %
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {v: {reads: C.e, unit: V, noise: "0.1 V"}}
"""
NEW = [
    NewParameter(name="R", nominal="11.5 ohm", others=(("accuracy", "2 %"),)),
    NewParameter(name="C", nominal="52 mF", others=(("accuracy", "1.5 %"), ("change", "90 %"))),
]


def test_only_values_change() -> None:
    """Comments and layout stay; a key that was not there is added where its table is."""
    text = rewrite(TEXT, parse_model(TEXT), NEW, [NewSize(name="v", times=2.0)])
    expected = (
        TEXT.replace("{R: 10 ohm}", "{R: {nominal: 11.5 ohm, accuracy: 2 %}}")
        .replace("50 mF   # as printed on it\n", "52 mF   # as printed on it\n        accuracy: 1.5 %\n")
        .replace("100 %", "90 %")
        .replace('"0.1 V"', "0.2 V")
    )
    assert text == expected


def test_it_reads_back() -> None:
    """The new text says what was to be said."""
    graph = parse_model(rewrite(TEXT, parse_model(TEXT), NEW, [NewSize(name="v", times=2.0)], "a.csv"))
    assert graph.parameter("R").nominal == 11.5
    assert graph.parameter("R").accuracy == pytest.approx(0.23)
    assert graph.parameter("C").change == pytest.approx(0.9 * 0.052)
    assert graph.sensors[0].noise == 0.2


def test_the_remark_is_renewed() -> None:
    """The first line tells of the last rewriting that has anything to tell: larger sizes do not take doubts away."""
    graph = parse_model(TEXT)
    once = rewrite(TEXT, graph, NEW, [], "a.csv")
    twice = rewrite(once, graph, NEW, [], "b.csv")
    assert once == "# Fitted to a.csv\n" + rewrite(TEXT, graph, NEW, [])
    assert twice == once.replace("a.csv", "b.csv")
    assert rewrite(once, graph, [], []) == once


def test_a_value_that_is_not_there() -> None:
    """What does not stand in the text cannot be replaced, and is named."""
    with pytest.raises(ModelError, match=r"sensors\.w\.noise"):
        rewrite(TEXT, parse_model(TEXT), [], [NewSize(name="w", times=2.0)])
