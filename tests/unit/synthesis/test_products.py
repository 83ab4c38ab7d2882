"""Inputs that act with one parameter alone, times a power of them, or as one does."""

import pytest

from faultbond.contract.couples import plan_couples
from faultbond.equations.plant import build_plant
from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.products import factors_of_inputs, terms_of_inputs

TANK = """
name: tank
sample_time: 1 s
max_faults: 2
constants: {full: 100 percent}
inputs: {speed: {unit: percent}, valve: {unit: percent}}
components:
  pump: {type: Sf, law: f = G*speed, parameters: {G: 2e-5 m^3/s/percent}}
  vessel: {type: C, law: q = A*e, parameters: {A: 1e-4 m^3/Pa}}
  outlet: {type: R, law: f = K*valve*sqrt(e), parameters: {K: 1e-7 m^3/s/Pa^0.5/percent}}
junctions: {node: 0}
bonds: [pump -> node -> vessel, node -> outlet]
sensors: {level: {reads: node.e, unit: Pa, noise: 20 Pa}, drain: {reads: outlet.f, noise: 1e-5 m^3/s}}
"""


@pytest.mark.parametrize(
    ("old", "new", "found"),
    [
        ("", "", ("G", "K")),
        ("K*valve*sqrt(e)", "sqrt(e)*valve*K", ("G", "K")),
        ("K*valve*sqrt(e)", "K*sqrt(e*valve**2)", ("G", "K")),
        ("K*valve*sqrt(e)", "K*valve*(valve/full)*sqrt(e)", ("G", "K")),
        ("K*valve*sqrt(e)", "K*valve*(valve/full)**-0.3*sqrt(e)", ("G", "K")),
        ("K: 1e-7 m^3/s/Pa^0.5/percent", "K: {nominal: 1e-7 m^3/s/Pa^0.5/percent, wander: 5 % over 1 h}", ("G", "K")),
        ("K*valve*sqrt(e)", "K*valve*exp(valve/full)*sqrt(e)", ("G", "")),
        ("K*valve*sqrt(e)", "K*(valve + 1)*sqrt(e)", ("G", "")),
        ("K*valve*sqrt(e)", "K*valve*sqrt(e)*(1 + speed/full)", ("", "K")),
        ("reads: node.e", "reads: node.e*(1 + speed/full)", ("", "K")),
        ("speed: {", "speed: {lag: 3 s, ", ("G", "K")),
        ("speed: {", "speed: {lag: 6 s, ", ("", "K")),
        ("G: 2e-5 m^3/s/percent", "G: {nominal: 2e-5 m^3/s/percent, suspect: no}", ("", "K")),
        ("law: f = G*speed", "law: f = 3*G*speed", ("G", "K")),
        ("law: f = G*speed", 'law: "f = G*max(speed, full/20)"', ("G", "K")),  # at rest it stands still
    ],
)
def test_which_input_acts_with_which_parameter(old: str, new: str, found: tuple[str, str]) -> None:
    """Where the input is larger and the parameter smaller, by some power of that, nothing else may change.

    A lag of a few samples parts them for these only, and who knows when a fault began.
    """
    graph = parse_model(TANK.replace(old, new) if old else TANK)
    factors = factors_of_inputs(build_plant(graph))
    assert tuple("" if k < 0 else graph.parameters[k].name for k in factors) == found


@pytest.mark.parametrize(
    ("law", "unit", "found"),
    [
        ("G + 2*speed", "percent", ("G", 2.0)),
        ("speed - 4*G", "percent", ("G", -0.25)),
        ("(speed + G)*sqrt(G2)", "percent", ("G", 1.0)),
        ("speed**2/full + G", "percent", ("", 0.0)),
        ("G*speed", "", ("", 0.0)),
        ("speed*G2 + G", "percent", ("", 0.0)),  # G2 wanders
        ("full*(sin(speed/full) + sin(G/full))", "percent", ("", 0.0)),
    ],
)
def test_which_parameter_acts_as_an_input_does(law: str, unit: str, found: tuple[str, float]) -> None:
    """Where one more of the input is so much more of the parameter; a lag of a few samples does not part them."""
    named = f"G: {{nominal: 3 {unit}, change: 1 {unit}}}" + (", G2: {nominal: 1, suspect: no}" if "G2" in law else "")
    text = TANK.replace(
        "law: f = G*speed, parameters: {G: 2e-5 m^3/s/percent}", f"law: f = q0*({law}), parameters: {{{named}}}"
    )
    text = text.replace("full: 100 percent", "full: 100 percent, q0: 1e-5 m^3/s/percent")
    for lag, is_late in (("", False), ("lag: 3 s, ", False), ("lag: 6 s, ", True)):
        graph = parse_model(text.replace("speed: {", f"speed: {{{lag}"))
        k, part = terms_of_inputs(build_plant(graph))[0]
        told = ("" if k < 0 else graph.parameters[k].name, part)
        assert told == (("", 0.0) if is_late else (found[0], pytest.approx(found[1])))


@pytest.mark.parametrize(("fitted", "found"), [("", ""), ("fitted_range: [300 percent, 400 percent], ", "G")])
def test_it_is_asked_where_the_model_was_fitted(fitted: str, found: str) -> None:
    """Below twice its full speed this pump goes on as it is."""
    text = TANK.replace("law: f = G*speed", 'law: "f = G*max(speed, 2*full)"').replace("speed: {", f"speed: {{{fitted}")
    graph = parse_model(text)
    factor = factors_of_inputs(build_plant(graph))[0]
    assert ("" if factor < 0 else graph.parameters[factor].name) == found


def test_a_gain_beside_another_fault_is_alike_with_a_step_beside_it() -> None:
    """Of an input with such a parameter, beside each other suspect; beside the parameter itself nothing is alike."""
    spec = build_engine(parse_model(TANK))[1].spec
    names = [item.name for item in spec.parameters]

    def called(hypothesis: int) -> frozenset[str]:
        found = {item.name for item in spec.instruments_in(hypothesis)} | {names[k] for k in spec.members(hypothesis)}
        return frozenset(found if hypothesis >= 0 else ())

    found = {}
    for couple in plan_couples(spec):
        if couple.slot >= len(spec.hypotheses):
            found[called(couple.hypothesis)] = called(couple.alike), called(couple.gains)
    wanted: dict[frozenset[str], tuple[frozenset[str], frozenset[str]]] = {}
    for both in found:
        gaining = next((one for one in ("speed", "valve") if one in both), "")
        factor = {"speed": "G", "valve": "K", "": ""}[gaining]
        is_same = not gaining or factor in both
        alike = frozenset() if is_same else both - {gaining} | {factor}
        wanted[both] = alike, frozenset() if is_same else frozenset({gaining})
    assert found == wanted
    assert len(found) == 4 * 3 + 6
