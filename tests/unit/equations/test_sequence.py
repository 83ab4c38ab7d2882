"""The order of computation of plants whose order is known by hand, and what cannot be ordered."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from faultbond.equations.causality import assign_causality
from faultbond.equations.constraint_network import Constraint, ConstraintNetwork, Store, build_network
from faultbond.equations.plant import build_plant
from faultbond.equations.sequence import Assignment, Loop, sequence, slope_name
from faultbond.equations.step import build_step_model
from faultbond.errors import StructureError
from faultbond.model.expression import Binary, Name, names
from faultbond.model.graph import SlowError
from faultbond.model.parser import parse_expression
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def network_of(signals: str, **laws: str) -> ConstraintNetwork:
    """A network of the signals in `signals`, with one residual per owner."""
    constraints = [Constraint(owner=owner, residual=parse_expression(text), line=0) for owner, text in laws.items()]
    return ConstraintNetwork(
        signals=tuple(signals.split()),
        constraints=tuple(constraints),
        states=(),
        dependent=(),
        readings=(),
        slow_errors=(),
    )


def resistors(text: str, junctions: str, bonds: str) -> ConstraintNetwork:
    """The network of resistors on a voltage source."""
    components = "".join(f"  {name}: {{type: R, parameters: {{{name}: 2 ohm}}}}\n" for name in text.split())
    graph = parse_model(
        "name: net\nsample_time: 1 s\ninputs: {V: {unit: V}}\ncomponents:\n  source: {type: Se, law: e = V}\n"
        f"{components}junctions: {{{junctions}}}\nbonds: [{bonds}]\nsensors: {{y: {{reads: source.f, noise: 1}}}}\n"
    )
    return build_network(graph, assign_causality(graph))


def test_chain_in_order() -> None:
    """Relations given backwards are put in the order in which they can be computed, each solved for its own signal."""
    steps = sequence(network_of("p.x p.y p.z", last="p.z - 2*p.y", middle="p.x - p.y/3", first="p.x - A"))
    assert [(step.signal, step.owner) for step in steps if isinstance(step, Assignment)] == [
        ("p.x", "first"),
        ("p.y", "middle"),
        ("p.z", "last"),
    ]
    assert len(steps) == 3


def test_no_needless_loop() -> None:
    """Two relations in two unknowns of which one holds a single unknown are two steps, not a loop."""
    steps = sequence(network_of("p.x p.y", both="p.x + p.y - A", one="p.y - B"))
    assert [type(step) for step in steps] == [Assignment, Assignment]


def test_motor_has_no_loop() -> None:
    """All signals of the DC motor follow one by one from its two states."""
    graph = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    network = build_network(graph, assign_causality(graph))
    steps = sequence(network)
    assert all(isinstance(step, Assignment) for step in steps)
    assert len(steps) == len(network.signals)


def test_tank_loop_is_torn_at_the_flow_in_closed_form() -> None:
    """The three resistances of the tank are one loop, torn at their common flow, with a closed form."""
    graph = load_model(EXAMPLES / "tank" / "model.yaml")
    (loop,) = (s for s in sequence(build_network(graph, assign_causality(graph))) if isinstance(s, Loop))
    assert loop.tears == ("line.f",)
    assert {part.signal for part in loop.inner} == {"pipe.e", "orifice.e", "valve.e"}
    assert loop.closed is not None
    assert "line.f" not in names(loop.closed)


def test_divider_needs_one_tear() -> None:
    """The loop of a divider with two resistors in parallel is torn at a single signal, in closed form."""
    network = resistors("Ra Rb Rc", "line: 1, node: 0", "source -> line -> Ra, line -> node -> Rb, node -> Rc")
    (loop,) = (step for step in sequence(network) if isinstance(step, Loop))
    assert len(loop.tears) == 1
    assert len(loop.inner) == 4
    assert loop.closed is not None


def test_bridge_needs_one_tear() -> None:
    """In a bridge of five resistors all follows from one branch current, so one tear is enough."""
    network = resistors(
        "R1 R2 R3 R4 R5",
        "top: 0, left: 0, right: 0, b1: 1, b2: 1, b5: 1",
        "source -> top, top -> b1 -> left, b1 -> R1, top -> b2 -> right, b2 -> R2, left -> R3, right -> R4, "
        "left -> b5 -> right, b5 -> R5",
    )
    (loop,) = (step for step in sequence(network) if isinstance(step, Loop))
    assert len(loop.tears) == 1


def test_mesh_needs_two_tears() -> None:
    """Three nodes, each tied to both others and to the source, need two tears: after one no node has one unknown."""
    ties = {"ta": ("top", "a"), "tb": ("top", "b"), "tc": ("top", "c"), "ab": ("a", "b"), "bc": ("b", "c")}
    ties |= {"ac": ("a", "c")}
    network = resistors(
        " ".join(f"R{name}" for name in ties) + " Rg",
        "top: 0, a: 0, b: 0, c: 0, " + ", ".join(f"{name}: 1" for name in ties),
        "source -> top, a -> Rg, " + ", ".join(f"{u} -> {n} -> {v}, {n} -> R{n}" for n, (u, v) in ties.items()),
    )
    (loop,) = (step for step in sequence(network) if isinstance(step, Loop))
    assert len(loop.tears) == 2
    assert len(loop.residuals) == 2


def test_relation_without_closed_form_is_a_loop_of_its_own() -> None:
    """A single relation that cannot be inverted is left to an iteration over its one signal."""
    (step,) = sequence(network_of("p.x", odd="p.x + exp(p.x) - A"))
    assert isinstance(step, Loop)
    assert step.tears == ("p.x",)
    assert step.closed is None
    assert step.inner == ()


@pytest.mark.parametrize("order", ["pump hose", "hose pump"])
def test_nothing_is_divided_by_what_a_pump_may_not_do(order: str) -> None:
    """Of a node between a pump and a hose the temperature has a value, too, while the pump stands still."""
    parts = {
        "pump": "{type: Sf, law: f = c*speed*(hot - node.e), parameters: {c: 2 W/K}}",
        "hose": "{type: R, law: f = G*(e - cold), parameters: {G: 3 W/K}}",
    }
    graph = parse_model(
        "name: mixing\nsample_time: 1 s\nconstants: {hot: 350 K, cold: 290 K}\ninputs: {speed: {}}\ncomponents:\n"
        + "".join(f"  {name}: {parts[name]}\n" for name in order.split())
        + "junctions: {node: 0}\nbonds: [pump -> node -> hose]\nsensors: {T: {reads: node.e, unit: K, noise: 0.1 K}}\n"
    )
    model = build_step_model(build_plant(graph))
    for speed, told in ((0.0, 290.0), (1.5, 320.0)):
        assert model.readings(np.ones(2), [speed], np.zeros(0))[0].full().item() == pytest.approx(told)


def test_slow_error_decides_the_tear() -> None:
    """The signal with a slow error is the tear of its loop, so that its error acts on what follows from it."""
    network = resistors("Ra Rb Rc", "line: 1, node: 0", "source -> line -> Ra, line -> node -> Rb, node -> Rc")
    assert network.slow_errors == ()
    for signal in ("line.f", "Rb.f", "Rc.f", "node.e", "Ra.e"):
        error = SlowError(target=signal, sd=0.02, relative=True, memory=60.0)
        (loop,) = (s for s in sequence(replace(network, slow_errors=(error,))) if isinstance(s, Loop))
        assert loop.tears == (signal,)


def test_rate_of_a_dependent_store_follows_from_the_states() -> None:
    """The rate of a store that cannot integrate is computed after its content, through its slope by the state."""
    network = ConstraintNetwork(
        signals=("s.x", "d.q", "d.f", "s.f"),
        constraints=(
            Constraint(owner="s", residual=parse_expression("s.x - s.q/A"), line=0),
            Constraint(owner="d", residual=parse_expression("d.q - B*s.x"), line=0),
            Constraint(owner="n", residual=parse_expression("s.f + d.f - U"), line=0),
        ),
        states=(Store(name="s.q", rate="s.f", component="s"),),
        dependent=(Store(name="d.q", rate="d.f", component="d"),),
        readings=(),
        slow_errors=(),
    )
    steps = sequence(network)
    assert [getattr(step, "signal", None) for step in steps[:2]] == ["s.x", "d.q"]
    loop = steps[2]
    assert isinstance(loop, Loop)
    assert {*loop.tears, *(part.signal for part in loop.inner)} == {"d.f", "s.f"}
    used = {name for part in loop.inner for name in names(part.expression)}
    used |= {name for residual in loop.residuals for name in names(residual)}
    assert slope_name("d.q", "s.q") in used


@pytest.mark.parametrize(
    ("signals", "laws", "message"),
    [
        (
            "p.x p.y p.z",
            {"one": "p.x - A", "two": "p.x - p.y"},
            r"^plant\.yaml: .*undetermined p\.z; superfluous: the law of none;",
        ),
        ("p.x", {"one": "p.x - A", "two": "p.x - B"}, r"undetermined none; superfluous: the law of (one|two);"),
        (
            "p.x p.y p.z",
            {"one": "p.x - A", "two": "p.x - B", "three": "p.y - p.z"},
            r"undetermined p\.(y|z); superfluous: the law of (one|two);",
        ),
    ],
)
def test_what_does_not_balance_is_named(signals: str, laws: dict[str, str], message: str) -> None:
    """Signals that nothing fixes and relations too many are named in the error, with the model's file."""
    with pytest.raises(StructureError, match=message):
        sequence(network_of(signals, **laws), "plant.yaml")


def test_order_does_not_depend_on_how_the_plant_is_written() -> None:
    """The same relations in another order give steps with the same signals and the same number of tears."""
    laws = {"one": "p.x + p.y - A", "two": "p.x - 2*p.y - p.z", "three": "p.z - 3*p.y"}
    there = sequence(network_of("p.x p.y p.z", **laws))
    back = sequence(network_of("p.z p.y p.x", **dict(reversed(list(laws.items())))))
    assert [len(step.tears) for step in (*there, *back) if isinstance(step, Loop)] == [1, 1]


def test_residual_of_a_rate_is_linear() -> None:
    """The relation of a dependent rate is `rate - slope * state rate`, which closes in the state's own relation."""
    network = ConstraintNetwork(
        signals=("d.q", "d.f"),
        constraints=(Constraint(owner="d", residual=Binary("-", Name("d.q"), Name("A")), line=0),),
        states=(),
        dependent=(Store(name="d.q", rate="d.f", component="d"),),
        readings=(),
        slow_errors=(),
    )
    steps = sequence(network)
    assert [step.signal for step in steps if isinstance(step, Assignment)] == ["d.q", "d.f"]
