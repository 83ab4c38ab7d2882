"""Correlations between parameters in a model file: read, checked, written, put into a file that has none."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.errors import ModelError
from faultbond.model.amend import with_correlations
from faultbond.model.builder import ModelBuilder
from faultbond.model.correlations import correlation_rows, is_definite
from faultbond.model.graph import BondGraph, Correlation
from faultbond.model.text import dump_model, parse_model

TEXT = """\
name: chain
sample_time: 1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  a: {type: R, parameters: {A: 3 ohm}}
  b: {type: R, parameters: {B: {nominal: 2 ohm, accuracy: 0 ohm}}}
  c: {type: C, parameters: {C: 1 F}}
  d: {type: I, parameters: {D: 4 H}}
junctions: {line: 1}
bonds: [source -> line -> a, line -> b, line -> c, line -> d]
sensors: {i: {reads: line.f, unit: A, noise: 1 mA}}
"""


def graph_of(stated: str) -> BondGraph:
    """The chain with these correlations."""
    return parse_model(f"{TEXT}correlations: {stated}\n")


def pairs(graph: BondGraph) -> dict[tuple[str, str], float]:
    """Correlations by names."""
    return {(item.one, item.other): item.value for item in graph.correlations}


def test_pairs_are_read_in_the_order_of_the_model() -> None:
    """Whichever way round they are stated, and kept by the canonical text."""
    graph = graph_of("{D: {A: 0.5, C: -0.25}, A: {C: 0.125}}")
    assert pairs(graph) == {("A", "C"): 0.125, ("A", "D"): 0.5, ("C", "D"): -0.25}
    assert graph.correlated == ((0, 2, 0.125), (0, 3, 0.5), (2, 3, -0.25))
    assert [replace(item, line=0) for item in parse_model(graph.text).correlations] == [
        replace(item, line=0) for item in graph.correlations
    ]
    assert "correlations:\n  A: {C: 0.125, D: 0.5}\n  C: {D: -0.25}\n" in graph.text
    assert parse_model(TEXT).correlations == ()
    assert "correlations" not in parse_model(TEXT).text


@pytest.mark.parametrize(
    ("stated", "problem"),
    [
        ("{A: {X: 0.5}}", r"model.yaml:13: correlation of A and X: no parameter is called `X`; known: A, B, C, D"),
        ("{A: {c: 0.5}}", r"no parameter is called `c`; did you mean `C`\?"),
        ("{A: {A: 0.5}}", r"correlation of A and A: a parameter goes with itself anyway; remove it"),
        ("{A: {D: 0.5}, D: {A: 0.5}}", r"correlation of D and A is stated twice, before at line 13; remove one"),
        ("{A: {D: 1}}", r"correlation of A and D is a number between -1 and 1, such as `0.9`, not `1`"),
        ("{A: {D: 50 %}}", r"correlation of A and D.*`50 %`"),
        ("{A: {D: 0.5 V}}", r"is a number between -1 and 1"),
        ("{A: {B: 0.5}}", r"B has accuracy 0, so it is known exactly; state how well it is known, or remove it"),
        ("{A: 0.5}", r"correlations of A must be a table"),
        (
            "{A: {C: 0.9, D: 0.9}, C: {D: 0.5}}",
            r"correlations: A and C 0.9, A and D 0.9, C and D 0.5 cannot all be; .* multiply all by 0.955",
        ),
    ],
)
def test_what_cannot_be_is_refused(stated: str, problem: str) -> None:
    """Each complaint names the pair, what was expected, and what to do."""
    with pytest.raises(ModelError, match=problem):
        graph_of(stated)


def test_the_factor_that_is_advised_is_enough() -> None:
    """Multiplied by it the numbers are taken, and with a little more they are not."""
    numbers = np.array([0.9, 0.9, 0.5])
    for factor, right in ((0.955, True), (0.957, False)):
        ac, ad, cd = factor * numbers
        assert is_definite({("A", "C"): ac, ("A", "D"): ad, ("C", "D"): cd}) == right


def test_definite_is_what_eigenvalues_say() -> None:
    """Against numpy, on matrices about the border."""
    generator = np.random.default_rng(1)
    names, seen = ["A", "B", "C", "D"], set()
    for _ in range(200):
        matrix = np.eye(4)
        chosen = {}
        for i in range(4):
            for j in range(i):
                matrix[i, j] = matrix[j, i] = chosen[names[j], names[i]] = float(generator.uniform(-0.9, 0.9))
        right = bool(np.linalg.eigvalsh(matrix)[0] > 1e-6)
        assert is_definite(chosen) == right
        seen.add(right)
    assert seen == {True, False}


def test_static_networks_have_none() -> None:
    """Where each row stands by itself no filter learns, so they are refused."""
    text = "name: n\nsample_time: none\nblocks:\n  g: {law: y = K*x, parameters: {K: 2}}\n"
    text += "  h: {law: z = L*y, parameters: {L: 3}}\ninputs: {x: {}}\nsensors: {z: {reads: z}}\n"
    text += "correlations: {K: {L: 0.5}}\n"
    with pytest.raises(ModelError, match="correlations: with `sample_time: none` each row stands by itself"):
        parse_model(text)


def test_a_plant_in_python_has_them_too() -> None:
    """`ModelBuilder.correlation` states a pair."""
    made = ModelBuilder("loop", sample_time="1 s").input("V", unit="V").component("s", "Se", law="e = V")
    made.component("r", "R", parameters={"R": "1 ohm"}).component("c", "C", parameters={"C": "1 F"}).junction("l", 1)
    made.component("i", "I", parameters={"L": "1 H"}).bond("s -> l -> r").bond("l -> c").bond("l -> i")
    made.sensor("a", "l.f", unit="A", noise="1 mA").correlation("R", "C", 0.5).correlation("R", "L", -0.25)
    assert pairs(made.build()) == {("R", "C"): 0.5, ("R", "L"): -0.25}
    with pytest.raises(ModelError, match="model loop: correlations of X: no parameter is called `X`"):
        made.correlation("X", "C", 0.5).build()


WRITTEN = {"A": {"C": "0.5", "D": "0.25"}}


@pytest.mark.parametrize(
    "text",
    [
        TEXT,
        TEXT + "correlations: {A: {D: -0.5}}\n",
        TEXT + "correlations:\n  C: {D: -0.5}\n  A:\n    D: 0.3  # so it was\n",
        TEXT.replace("junctions:", "correlations:\n  C: {D: -0.5}\njunctions:"),
        TEXT.rstrip(),
    ],
)
def test_they_are_put_into_a_file(text: str) -> None:
    """In place of those that stand there, else at its end; the rest of the file stays."""
    found = with_correlations(text, WRITTEN)
    assert correlation_rows(parse_model(found).correlations) == WRITTEN
    assert found.count("correlations:") == 1
    assert all(line in found for line in TEXT.splitlines())
    without = with_correlations(found, {})
    assert "correlations" not in without
    assert dump_model(parse_model(without)) == dump_model(parse_model(TEXT))


def test_they_are_put_into_a_file_on_one_line() -> None:
    """A file that is one flow mapping stays one."""
    text = "{name: c, sample_time: 1 s, inputs: {V: {}}, components: {s: {type: Se, law: e = V}, a: {type: R, "
    text += "parameters: {A: 3}}, c: {type: C, parameters: {C: 1}}}, junctions: {l: 1}, bonds: [s -> l -> a, l -> c], "
    text += "sensors: {i: {reads: l.f, noise: 1}}}"
    found = with_correlations(text, {"A": {"C": "0.5"}})
    assert parse_model(found).correlations == (Correlation(one="A", other="C", value=0.5, line=1),)
