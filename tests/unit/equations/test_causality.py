"""Causal strokes of plants whose causality is known by hand."""

from pathlib import Path

import pytest

from faultbond.equations.causality import Causality, assign_causality
from faultbond.equations.constraint_network import build_network
from faultbond.equations.sequence import Loop, sequence
from faultbond.errors import CausalityError
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def circuit(components: str, junctions: str, bonds: str, reads: str) -> BondGraph:
    """A circuit with a voltage source and a sensor; the source stands in line 5 of its file, the rest follow."""
    return parse_model(
        "name: circuit\nsample_time: 10 ms\ninputs: {V: {unit: V}}\ncomponents:\n  source: {type: Se, law: e = V}\n"
        f"{components}\njunctions: {{{junctions}}}\nbonds: [{bonds}]\nsensors: {{y: {{reads: {reads}, noise: 1}}}}\n",
        file="circuit.yaml",
    )


def loops(graph: BondGraph, causality: Causality) -> list[Loop]:
    """The algebraic loops of a plant."""
    return [step for step in sequence(build_network(graph, causality)) if isinstance(step, Loop)]


def receivers(graph: BondGraph, causality: Causality) -> dict[str, str]:
    """For each bond, as text, the node that receives effort."""
    return {f"{graph.bonds[k].tail} -> {graph.bonds[k].head}": node for k, node in causality.strokes}


def test_motor_stores_integrate() -> None:
    """L and J of the DC motor integrate, no store is differentiated, and no causality is chosen at will."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    found = assign_causality(graph)
    assert found.integral == ("L", "J")
    assert found.derivative == ()
    assert found.free == ()
    assert not loops(graph, found)


def test_motor_strokes_are_those_on_paper() -> None:
    """The source gives effort, both inertias and only they receive it on their junctions, the gyrator gives two."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    assert receivers(graph, assign_causality(graph)) == {
        "source -> armature": "armature",
        "armature -> R": "armature",
        "armature -> L": "L",
        "armature -> K": "armature",
        "K -> shaft": "shaft",
        "shaft -> J": "J",
        "shaft -> C": "shaft",
    }


def test_tank_has_one_free_choice() -> None:
    """The three resistances in series of the tank leave one free choice and one loop of exactly those three."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    found = assign_causality(graph)
    assert found.integral == ("tank",)
    assert found.derivative == ()
    assert len(found.free) == 1
    assert found.free[0] in {"pipe", "orifice", "valve"}
    (loop,) = loops(graph, found)
    assert set(loop.owners) == {"pipe", "orifice", "valve", "line"}


def test_divider_is_an_algebraic_loop() -> None:
    """A resistor before two resistors in parallel, without any store, needs a free choice and makes one loop."""
    graph = circuit(
        "  Ra: {type: R, parameters: {Ra: 2 ohm}}\n  Rb: {type: R, parameters: {Rb: 3 ohm}}\n"
        "  Rc: {type: R, parameters: {Rc: 5 ohm}}",
        "line: 1, node: 0",
        "source -> line -> Ra, line -> node -> Rb, node -> Rc",
        "node.e",
    )
    found = assign_causality(graph)
    assert found.free
    (loop,) = loops(graph, found)
    assert {"Ra", "Rb", "Rc"} <= set(loop.owners)


def test_dependent_stores_are_differentiated() -> None:
    """A C across a voltage source and the second of two inertias on one flow cannot integrate."""
    graph = circuit(
        "  C1: {type: C, parameters: {C1: 1 mF}}\n  L1: {type: I, parameters: {L1: 1 H}}\n"
        "  L2: {type: I, parameters: {L2: 2 H}}",
        "node: 0, line: 1",
        "source -> node -> C1, node -> line -> L1, line -> L2",
        "line.f",
    )
    found = assign_causality(graph)
    assert "C1" in found.derivative
    assert len(found.derivative) == 2
    assert len({"L1", "L2"} & set(found.derivative)) == 1
    assert set(found.integral) == {"L1", "L2"} - set(found.derivative)
    assert found.free == ()


def test_transformer_passes_and_gyrator_turns() -> None:
    """Behind a transformer a flow source still sets the flow, behind a gyrator it sets the effort."""
    for kind, laws, giver in (
        ("TF", '["e1 = X*e2", "f2 = X*f1"]', "end"),
        ("GY", '["e1 = X*f2", "e2 = X*f1"]', "joint"),
    ):
        graph = circuit(
            f"  push: {{type: Sf, law: f = V}}\n  joint: {{type: {kind}, law: {laws}, parameters: {{X: 2}}}}\n"
            "  load: {type: R, parameters: {Y: 3}}\n  rest: {type: R, parameters: {Z: 3}}",
            "start: 1, end: 1, other: 1",
            "push -> start -> joint -> end -> load, source -> other -> rest",
            "end.f",
        )
        assert receivers(graph, assign_causality(graph))["joint -> end"] == ("joint" if giver == "end" else "end")


def test_choice_that_leads_to_a_contradiction_is_undone() -> None:
    """Two inertias tied by two transformers cannot integrate; each choice that fails leaves no stroke behind."""
    law = 'law: ["e1 = X{0}*e2", "f2 = X{0}*f1"], parameters: {{X{0}: 2}}'
    graph = circuit(
        f"  T1: {{type: TF, {law.format(1)}}}\n  T2: {{type: TF, {law.format(2)}}}\n"
        "  M1: {type: I, parameters: {M1: 1}}\n  M2: {type: I, parameters: {M2: 1}}\n"
        "  R: {type: R, parameters: {R: 1}}",
        "one: 1, two: 1, other: 1",
        "one -> M1, two -> M2, one -> T1 -> two, two -> T2 -> one, source -> other -> R",
        "R.f",
    )
    assert assign_causality(graph).derivative == ("M1", "M2")


@pytest.mark.parametrize(
    ("junction", "kind", "law", "signal"), [("0", "Se", "e = 2*V", "effort"), ("1", "Sf", "f = V", "flow")]
)
def test_two_sources_of_one_signal(junction: str, kind: str, law: str, signal: str) -> None:
    """Two sources of the same signal of a junction are refused at the line of the second one, and all are named."""
    first = "e = V" if kind == "Se" else "f = V"
    graph = circuit(
        f"  supply: {{type: {kind}, law: {first}}}\n  battery: {{type: {kind}, law: {law}}}\n"
        "  R: {type: R, parameters: {R: 3}}\n  Q: {type: R, parameters: {Q: 3}}",
        f"node: {junction}, other: 1",
        "supply -> node -> R, battery -> node, source -> other -> Q",
        "Q.e",
    )
    message = rf"^circuit\.yaml:7: {junction}-junction node has its {signal} set by supply and by battery;"
    with pytest.raises(CausalityError, match=message):
        assign_causality(graph)


def test_conflict_names_file_line_and_source() -> None:
    """Two voltage sources in parallel are refused at the line of the second one, which is named with its junction."""
    graph = circuit(
        "  battery: {type: Se, law: e = 2*V}\n  R: {type: R, parameters: {R: 3}}",
        "node: 0",
        "source -> node -> R, battery -> node",
        "R.f",
    )
    with pytest.raises(CausalityError, match=r"^circuit\.yaml:6: .*\bnode\b.*source battery.*; let one of them"):
        assign_causality(graph)


def test_conflict_found_through_a_transformer() -> None:
    """A conflict that a source causes further away is still reported at a line of the file and names its junction."""
    graph = circuit(
        "  battery: {type: Se, law: e = 2*V}\n  T: {type: TF, parameters: {T: 2}}\n  R: {type: R, parameters: {R: 3}}",
        "left: 0, right: 0",
        "source -> left -> T -> right -> R, battery -> right",
        "R.f",
    )
    with pytest.raises(CausalityError, match=r"^circuit\.yaml:6: 0-junction right has its effort set by T and by bat"):
        assign_causality(graph)
