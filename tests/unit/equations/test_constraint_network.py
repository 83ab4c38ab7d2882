"""The constraint network of block networks: signals, stores, rates and what follows from them."""

import casadi as ca
import pytest

from faultbond.cli import main
from faultbond.equations.causality import assign_causality
from faultbond.equations.constraint_network import ConstraintNetwork, build_network
from faultbond.equations.plant import Plant, build_plant
from faultbond.errors import ModelError, StructureError
from faultbond.io.examples import example
from faultbond.model.expression import Binary, Name
from faultbond.model.parser import parse_expression
from faultbond.model.text import parse_model

TANKS = """\
name: two tanks
sample_time: 1 s
max_faults: 1
inputs: {u: {unit: m^3/s}}
blocks:
  outlet: {law: 0 = q2 - K2*sqrt(h2), parameters: {K2: 0.05 m^2.5/s}, signals: [q2]}
  lower: {law: der(h2) = (q1 - q2)/A2, parameters: {A2: {nominal: 1.5 m^2, suspect: no}}, start: {h2: 1 m, sd: 5 cm}}
  pipe: {law: q1 = K1*sqrt(h1), parameters: {K1: 0.05 m^2.5/s}}
  upper: {law: der(h1) = (u - q1)/A1, parameters: {A1: {nominal: 2 m^2, suspect: no}}}
sensors:
  level1: {reads: h1, unit: cm, noise: 1 cm}
  level2: {reads: h2, unit: cm, noise: 1 cm}
slow_error: {q1: 2 % over 100 s}
"""
PENDULUM = """\
sample_time: 10 ms
constants: {L: 1, g: 9.81}
blocks:
  moves: {law: [der(x) = vx, der(y) = vy, der(vx) = -T*x, der(vy) = -T*y - g]}
  rod: {law: 0 = x**2 + y**2 - L**2, signals: [T]}
sensors: {s: {reads: x, noise: 0.1}}
"""


def network(text: str) -> ConstraintNetwork:
    """Give the constraint network of a model text."""
    graph = parse_model(text)
    return build_network(graph, assign_causality(graph))


def values(plant: Plant, x: list[float], u: list[float], b: list[float]) -> tuple[list[float], list[float]]:
    """Give rates and readings of the nominal plant."""
    function = ca.Function("f", [plant.x, plant.u, plant.theta, plant.b], [plant.rates, plant.readings])
    rates, readings = function(x, u, [item.nominal for item in plant.graph.parameters], b)
    return rates.full()[:, 0].tolist(), readings.full()[:, 0].tolist()


def test_signals_and_stores_keep_their_names() -> None:
    """A store is the signal of its block, its rate a signal `der(h1)`; other signals are as in the file."""
    found = network(TANKS)
    assert found.signals == ("q2", "q1", "der(h2)", "der(h1)")
    assert [(item.name, item.rate, item.component) for item in found.states] == [
        ("h2", "der(h2)", "lower"),
        ("h1", "der(h1)", "upper"),
    ]
    assert found.dependent == ()
    assert found.readings == (Name("h1"), Name("h2"))
    assert found.slow_errors[0].target == "q1"


def test_a_law_is_the_difference_of_its_sides() -> None:
    """Each law gives one residual, of the block that states it."""
    found = network(TANKS)
    assert [item.owner for item in found.constraints] == ["outlet", "lower", "pipe", "upper"]
    assert found.constraints[2].residual == parse_difference("q1", "K1*sqrt(h1)")
    assert found.constraints[0].residual == parse_model(TANKS).component("outlet").laws[0].right
    assert [item.line for item in found.constraints] == [6, 7, 8, 9]


def test_what_is_measured_by_hand_is_known() -> None:
    """A check may read what the model knows; an integral that neither a sensor nor a law reads is none of it."""
    text = (example("dc_motor") / "model.yaml").read_text(encoding="utf-8")
    check = "checks: {turned: {reads: shaft.q, unit: rad, noise: 0.1 rad}}\n"
    with pytest.raises(
        ModelError, match=r":\d+: check turned reads shaft.q, of which nothing is known.*Let a sensor read"
    ):
        network(text + check)
    known = network(
        text + check.replace("shaft.q", "shaft.f").replace("unit: rad, noise: 0.1 rad", "unit: rad/s, noise: 1")
    )
    assert known.by_hand == (Name("shaft.f"),)
    assert known.states == network(text).states


def parse_difference(left: str, right: str) -> Binary:
    """Give left - right."""
    return Binary("-", parse_expression(left), parse_expression(right))


def test_a_block_network_has_no_strokes() -> None:
    """Causality has nothing to assign; blocks with stores integrate."""
    causality = assign_causality(parse_model(TANKS))
    assert (causality.strokes, causality.derivative, causality.free) == ((), (), ())
    assert causality.integral == ("lower", "upper")


def test_rates_follow_from_the_laws_in_any_order() -> None:
    """The plant has the rates of the equations, whichever order the blocks have and whatever is implicit."""
    plant = build_plant(parse_model(TANKS))
    rates, readings = values(plant, [0.81, 0.64], [0.06], [0.0])
    assert rates == pytest.approx([(0.05 * 0.8 - 0.05 * 0.9) / 1.5, (0.06 - 0.05 * 0.8) / 2], rel=1e-9)
    assert readings == [0.64, 0.81]


def test_a_slow_error_on_a_signal_acts_on_all_that_read_it() -> None:
    """An error of the flow between the tanks changes the rates of both."""
    plant = build_plant(parse_model(TANKS))
    exact, off = (values(plant, [0.81, 0.64], [0.06], [error])[0] for error in (0.0, 0.1))
    change = 0.1 * 0.05 * 0.8
    assert off == pytest.approx([exact[0] + change / 1.5, exact[1] - change / 2], rel=1e-9)


def test_loops_between_blocks_are_solved() -> None:
    """Two blocks that feed each other are an algebraic loop: y = 2 (u - y/4), so y = 4 u / 3."""
    blocks = "blocks: {a: {law: x = u - y/4}, b: {law: y = 2*x}}"
    text = f"sample_time: none\ninputs: {{u: {{}}}}\n{blocks}\nsensors: {{s: {{reads: y}}}}"
    assert values(build_plant(parse_model(text)), [], [3.0], [])[1] == pytest.approx([4.0])


def test_too_many_equations_are_named() -> None:
    """A network that does not balance is loaded, and refused where it has to be solved, by block and signal."""
    with pytest.raises(StructureError, match=r"undetermined .*; superfluous: the law of rod"):
        build_plant(parse_model(PENDULUM))
    assert [store.name for store in network(PENDULUM).states] == ["x", "y", "vx", "vy"]


def test_two_tanks_from_file_to_verdict(tmp_path_factory: pytest.TempPathFactory) -> None:
    """A network with two stores and an implicit law is simulated and watched like a bond graph."""
    folder = tmp_path_factory.mktemp("tanks")
    model, inputs, faulty, records = (folder / name for name in ("tanks.yaml", "in.csv", "out.csv", "run.jsonl"))
    model.write_text(TANKS)
    inputs.write_text("\n".join(["time,u", *(f"{k},{(0.05, 0.06, 0.045)[k // 100 % 3]}" for k in range(500))]) + "\n")
    common = ["simulate", str(model), "--inputs", str(inputs), "--seed", "1", "-o", str(faulty)]
    assert main([*common, "--fault", "K2=x0.8@300"]) == 0
    assert main(["run", str(model), str(faulty), "--json", str(records)]) == 1
    assert '"components": ["outlet"]' in records.read_text().splitlines()[-2].partition('"probability"')[0]
