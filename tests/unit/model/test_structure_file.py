"""Structures in model files: what is read, in which forms, and what is refused."""

import re

import jsonschema
import pytest
import yaml

from faultbond.errors import ModelError
from faultbond.model.schema import model_schema
from faultbond.model.structure import Derivative, FurtherSensor, Structure, StructureEquation
from faultbond.model.text import parse_any, parse_model

TANKS = """name: two tanks
structure:
  unknowns: [h1, h2, q, dh1, dh2]
  known: [u, y]
  faults: [leak, clog]
  parameters: [A, K]
  equations:
    upper: [dh1, q, u, leak]
    lower: [dh2, q, h2]
    pipe: [q, h1, h2, clog]
    level: [y, h2]
  derivatives: {dh1: h1, dh2: h2}
  further_sensors: {h1: 2, q: {cost: 3, suspect: yes}}
"""


def read(text: str) -> Structure:
    """The structure of a text."""
    found = parse_any(text, "tanks.yaml")
    assert isinstance(found, Structure)
    return found


def test_lists_of_names() -> None:
    """Names in an equation are sorted by what they are listed as."""
    found = read(TANKS)
    assert found.name == "two tanks"
    assert found.equations[0] == StructureEquation(name="upper", unknowns=("dh1", "q"), known=("u",), faults=("leak",))
    assert [item.name for item in found.equations] == ["upper", "lower", "pipe", "level"]
    assert found.derivatives == (
        Derivative(name="d h1/dt", rate="dh1", quantity="h1"),
        Derivative(name="d h2/dt", rate="dh2", quantity="h2"),
    )
    assert found.further_sensors == (
        FurtherSensor(signal="h1", cost=2.0),
        FurtherSensor(signal="q", cost=3.0, suspect=True),
    )
    assert found.states_sensors
    assert found.states_costs
    assert found.unused == ()


def test_texts_count_for_their_names_alone() -> None:
    """A law says the same as the list of what stands in it, whatever its functions, numbers and parameters."""
    laws = """
    upper: A*dh1 = u - q - leak
    lower: "A*dh2 - q + K*sqrt(max(h2, 1.5e-3))"
    pipe: q == sign(h1 - h2)*K*(1 + clog)*abs(h1 - h2)^0.5/pi
    level: y = h2
"""
    text = re.sub(r"(?s)\n    upper.*(?=  derivatives)", laws, TANKS)

    def content(found: Structure) -> list[tuple[set[str], set[str], set[str]]]:
        return [({*item.unknowns}, {*item.known}, {*item.faults}) for item in found.equations]

    assert content(read(text)) == content(read(TANKS))
    assert read(text).derivatives == read(TANKS).derivatives


@pytest.mark.parametrize("rate", ["dx = der(x)", "der(x) = dx", "[dx, x, diff]"])
def test_rates_among_the_equations(rate: str) -> None:
    """An equation that says no more than that one unknown is the rate of another is a derivative, under its name."""
    found = read(
        f"structure: {{unknowns: [x, dx], known: [y], equations: [[y, x], '{rate}', [dx, x]]}}".replace(
            "'[", "["
        ).replace("]'", "]")
    )
    assert found.derivatives == (Derivative(name="e2", rate="dx", quantity="x"),)
    assert [item.name for item in found.equations] == ["e1", "e3"]


def test_rates_without_a_name() -> None:
    """`der(x)` in a law is the rate of x: that which has a name, else one more unknown, which needs no list."""
    found = read("structure: {unknowns: [x], known: [u], equations: {a: der(x) = u - x, b: 0 = der(x) + 2*x}}")
    assert found.unknowns == ("x", "der(x)")
    assert found.derivatives == (Derivative(name="d x/dt", rate="der(x)", quantity="x"),)
    named = read("structure: {unknowns: [x, v], known: [u], equations: {a: der(x) = u - x, b: v = der(x)}}")
    assert named.derivatives == (Derivative(name="b", rate="v", quantity="x"),)
    assert named.equations[0].unknowns == ("v", "x")


def test_what_stands_nowhere_is_told() -> None:
    """Listed signals that no equation names are left out, and known to be."""
    found = read("structure: {unknowns: [x, z], known: [y, w], equations: [[x, y], [x]]}")
    assert (found.unknowns, found.unused) == (("x",), ("z", "w"))


def test_sensors_by_default() -> None:
    """Where nothing is said, every unknown but rates can be measured, at the same cost."""
    found = read(TANKS.partition("  further_sensors")[0])
    assert found.further_sensors == tuple(FurtherSensor(signal=name) for name in ("h1", "h2", "q"))
    assert not found.states_sensors
    listed = read(re.sub(r"further_sensors: .*", "further_sensors: [q, h1]", TANKS))
    assert listed.further_sensors == (FurtherSensor(signal="q"), FurtherSensor(signal="h1"))


def test_the_hash_names_the_content() -> None:
    """Comments and forms do not change the hash of a structure; its equations do."""
    assert read(TANKS).sha256 == read(f"# a comment\n{TANKS}").sha256
    assert read(TANKS).sha256 != read(TANKS.replace("[y, h2]", "[y, h1]")).sha256


MISTAKES = [  # what stands in the file, what stands there instead, line, message
    ("[y, h2]", "[y, h3]", 11, "equation level: unknown name `h3`; list it under unknowns, known, faults, parameters"),
    ("u, leak]", "u, leek]", 8, r"equation upper: unknown name `leek`; did you mean `leak`\? Else list it under unkno"),
    ("[y, h2]", "y = h2 + leek", 11, "equation level: unknown name `leek`; did you mean `leak`"),
    ("[y, h2]", "[y, h2, y]", 11, "equation level names `y` twice"),
    ("[y, h2]", "[]", 11, "equation level is empty; list what stands in it"),
    ("[y, h2]", "A = 2*K = u", 11, "equation level: cannot read `= u`"),
    ("[y, h2]", "y = h2 $ 3", 11, r"equation level: cannot read `\$ 3` in `y = h2 \$ 3`"),
    ("[y, h2]", "sqrt(2) = 3", 11, r"equation level: `sqrt\(2\) = 3` names nothing that is listed"),
    ("[y, h2]", "y = der(2*h2)", 11, r"equation level: `der` takes the name of one unknown, as in `der\(x\)`"),
    ("[y, h2]", "h2 = 2*der(y)", 11, "equation level: `y` is known, and only unknowns have rates"),
    ("known: [u, y]", "known: [u, q]", 4, "known: `q` is already an unknown on line 3; list it once"),
    ("[leak, clog]", "[leak, clog, lost]", 5, "fault `lost` stands in no equation; put it into the one that it makes"),
    ("dh1: h1,", "dh1: u,", 12, "derivative dh1: `u` is known, and only unknowns have rates; give what is measured"),
    ("dh1: h1,", "h1: h1,", 12, "derivative h1: `h1` cannot be its own rate"),
    ("dh1: h1,", "dh1: h2,", 12, "derivative dh2: `dh1` is already the rate of `h2`; remove one"),
    ("{h1: 2,", "{y: 2,", 13, "further sensor y: it is known; only an unknown of some equation can be measured"),
    ("{h1: 2,", "{h1: 2 m,", 13, "further sensor h1: cost is a number above 0, without a unit"),
    ("{h1: 2,", "{h1: -1,", 13, "further sensor h1: cost is a number above 0"),
    ("unknowns: [h1, h2, q, dh1, dh2]", "", 2, r"structure: `unknowns` is missing; list them: `\[x1, x2\]`"),
    ("  known:", "  knwon:", 4, "structure: unknown key `knwon`; did you mean `known`"),
    ("name:", "sample_time: 1 s\nname:", 1, "`sample_time` stands beside `structure`, which has no laws"),
    ("name:", "naem:", 1, "model: unknown key `naem`; did you mean `name`"),
    ("[h1, h2, q,", "[h1, h2, 3q,", 3, "unknowns: `3q` is not a name"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), MISTAKES)
def test_mistakes(old: str, new: str, line: int, message: str) -> None:
    """Every mistake is one line: file and line, what is wrong, what to do."""
    assert old in TANKS
    with pytest.raises(ModelError, match=rf"^tanks.yaml:{line}: .*{message}"):
        parse_any(TANKS.replace(old, new, 1), "tanks.yaml")


def test_a_structure_is_no_model_with_laws() -> None:
    """Who needs laws says so in one line, and what there is instead."""
    with pytest.raises(ModelError, match=r"^t.yaml:2: two tanks is a `structure`: it has no laws.*`analyse MODEL`$"):
        parse_model(TANKS, "t.yaml")


def test_the_schema_knows_structures() -> None:
    """The schema takes a structure in all its forms, alone, and refuses a misspelt key in it."""
    validator = jsonschema.Draft202012Validator(model_schema())
    for text in (TANKS, "structure: {unknowns: x, equations: [[x], 2*x = 3]}", TANKS.replace("{h1: 2, q", "{h1: , q")):
        validator.validate(yaml.safe_load(text))
    for old, new in (("known:", "knwon:"), ("name:", "sample_time: 1 s\nname:"), ("[y, h2]", "[y, 2]")):
        assert not validator.is_valid(yaml.safe_load(TANKS.replace(old, new, 1)))
