"""Which elements give what they can only take, and what is said of them."""

import pytest

from faultbond.equations.passivity import active_elements
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.report.shortcomings import active_sentence, active_texts

TABLES = "tables: {curve: {points: [[-1, -1], [1, 1]]}}\n"
MODEL = """\
name: vessel
sample_time: 1 s
constants: {K_c: -2 Pa*s^2/m^6}
inputs: {Q: {unit: m^3/s}, u: {unit: percent}}
components:
  pump: {type: Sf, law: f = Q}
  part: {PART}
  outlet: {type: R, law: f = k*e, parameters: {k: 1 m^3/s/Pa}}
junctions: {node: 0}
bonds: [pump -> node -> part, node -> outlet]
sensors: {level: {reads: part.e, unit: Pa, noise: 1 Pa}}
"""


def with_part(text: str) -> BondGraph:
    """Give a model with this element in it."""
    return parse_model(MODEL.replace("PART", text) + (TABLES if "table(" in text else ""))


@pytest.mark.parametrize(
    ("part", "numbers"),
    [
        ("type: R, parameters: {a: -3 Pa*s/m^3}", ("a",)),
        ("type: R, law: e = a*f*abs(f), parameters: {a: -3}", ("a",)),
        ("type: R, law: f = sign(e)*sqrt(abs(e)/a)*u, parameters: {a: 3}", None),
        ("type: R, law: f = a*u*e, parameters: {a: -3}", ("a",)),
        ("type: R, law: e/a = f, parameters: {a: -3}", ("a",)),
        ("type: R, law: e = a*b*f, parameters: {a: -3, b: 2}", ("a",)),
        ("type: R, law: e = -a*f, parameters: {a: 3}", ()),
        ("type: R, law: e = K_c*f*abs(f)", ("K_c",)),
        ("type: R, law: 'e = -a*table(f, curve)', parameters: {a: 3}", ()),
        ("type: C, parameters: {a: -3 m^3/Pa}", ("a",)),
        ("type: C, law: e = a*q, parameters: {a: -3}", ("a",)),
        ("type: C, law: e = q/a, parameters: {a: -3}", ("a",)),
    ],
)
def test_what_gives_is_told_with_its_numbers(part: str, numbers: tuple[str, ...] | None) -> None:
    """A resistance or store of the wrong sign is found, and the number below zero that is why."""
    found = active_elements(with_part(part))
    assert [item.numbers for item in found] == ([] if numbers is None else [numbers])
    assert all(item.component.name == "part" for item in found)


@pytest.mark.parametrize(
    "part",
    [
        "type: R, parameters: {a: 3 Pa*s/m^3}",
        "type: R, law: e = a*f + b*f*abs(f), parameters: {a: 3, b: -1e-3}",  # falls off, as a lamp does
        "type: R, law: e = a*f + b*f*abs(f), parameters: {a: -3, b: 1}",
        "type: R, law: e = a*b*f, parameters: {a: -3, b: -2}",
        "type: R, law: e = -a*f, parameters: {a: -3}",
        "type: R, law: e = a*(1 + b*u)*f, parameters: {a: 3, b: -0.01}",
        "type: R, law: e = a*f*outlet.f, parameters: {a: -3}",  # its sign is that of another flow
        "type: R, law: e = a*tanh(f/b), parameters: {a: 3, b: 2}",
        "type: C, law: e = a*q + b*q**3, parameters: {a: -3, b: 1}",
        "type: C, law: e = a + q/b, parameters: {a: -3, b: 1}",  # a pressure that it begins from
    ],
)
def test_what_may_be_below_zero_is_passed_over(part: str) -> None:
    """A number below zero with which an element still takes power somewhere is no matter."""
    assert active_texts(with_part(part)) == []
    assert active_sentence(with_part(part)) == ""


def test_the_words_name_the_number_its_line_and_the_cure() -> None:
    """The user's name, the value in the user's unit, the line, and what to do stand in one line."""
    told = active_texts(with_part("type: R, parameters: {a: -3 kPa*s/m^3}"))
    assert told == [
        "a is -3 kPa*s/m^3, so part gives power: state it above zero, or turn the sign in the law (model.yaml:7)",
    ]
    (store,) = active_texts(with_part("type: C, parameters: {a: -3 m^3/Pa}"))
    assert "so the content of part falls as it is filled" in store
    (law,) = active_texts(with_part("type: R, law: e = -a*f, parameters: {a: 3}"))
    assert law.startswith("part gives power by its law")
    assert "turn a sign in the law (model.yaml:7)" in law
