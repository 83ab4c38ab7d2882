"""The equations of one time frame: which there are, what they are called, and what is known in them."""

from pathlib import Path

import pytest

from faultbond.equations.causality import assign_causality
from faultbond.equations.component_network import ComponentNetwork, build_components, frame_name, in_frame
from faultbond.equations.constraint_network import build_network
from faultbond.errors import StructureError
from faultbond.model.parser import to_text
from faultbond.model.text import parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"


def components(text: str) -> ComponentNetwork:
    """The component network of a model text."""
    graph = parse_model(text)
    return build_components(graph, build_network(graph, assign_causality(graph)))


def example(name: str) -> ComponentNetwork:
    """The component network of a built-in plant."""
    return components((EXAMPLES / name / "model.yaml").read_text(encoding="utf-8"))


def laws(network: ComponentNetwork) -> dict[str, str]:
    """The residuals by name."""
    return {item.name: to_text(item.residual) for item in network.equations}


def test_motor() -> None:
    """The ten equations of figure A.2; the measured signals carry the names of input and sensor."""
    assert laws(example("dc_motor")) == {
        "K.1": "K.e1 - K*omega",
        "K.2": "K.e2 - K*armature.f",
        "R": "R.e - R*armature.f",
        "L": "L.e - L*L.rate",
        "L.sum": "dt*L.rate - (armature.f - armature.f@1)",
        "J": "J.e - J*J.rate",
        "J.sum": "dt*J.rate - (omega - omega@1)",
        "C": "C.e - C*omega",
        "armature": "V - R.e - L.e - K.e1",
        "shaft": "K.e2 - J.e - C.e",
    }


def test_states_and_what_is_known() -> None:
    """A linear store carries its effort or flow, with a rate of its own; inputs and sensors are known."""
    motor = example("dc_motor")
    assert [(item.signal, item.rate, item.sum) for item in motor.states] == [
        ("armature.f", "L.rate", "L.sum"),
        ("omega", "J.rate", "J.sum"),
    ]
    assert motor.observed == {"V", "omega"}
    assert motor.suspects == ("R", "L", "K", "J", "C")


def test_sensor_of_more_than_a_signal_is_an_equation_without_weight() -> None:
    """The flow meter of the tank reads a root; the pressure is simply the effort of the vessel."""
    tank = example("tank")
    assert to_text(tank.equation("flow").residual) == "flow - sqrt(orifice.e/K_meter)"
    assert tank.equation("flow").weight == 0
    assert tank.equation("tank.sum").weight == 1
    assert ("pressure", 1) in tank.equation("tank.sum").signals


def test_a_parameter_in_two_laws_stands_in_both() -> None:
    """The gyrator has one parameter and two equations."""
    motor = example("dc_motor")
    assert [item.name for item in motor.equations if "K" in item.parameters] == ["K.1", "K.2"]


@pytest.mark.parametrize("law", ["q = A*e**2", "q = A*e*u", "q = A*e + 1"])
def test_other_stores_carry_their_content(law: str) -> None:
    """A store whose content is not a plain multiple of its effort sums the content itself."""
    network = components(
        "sample_time: 1 s\ninputs: {u: {}}\ncomponents:\n  source: {type: Sf, law: f = u}\n"
        f"  tank: {{type: C, law: '{law}', parameters: {{A: 2}}}}\njunctions: {{node: 0}}\n"
        "bonds: [source -> node -> tank]\nsensors: {level: {reads: node.e, noise: 0.1}}\n"
    )
    assert to_text(network.equation("tank.sum").residual) == "dt*tank.f - (tank.q - tank.q@1)"
    assert network.states[0].signal == "tank.q"


BLOCKS = (
    "sample_time: 1 s\ninputs: {u: {}}\nblocks:\n  pair: {law: ['der(x) = a*(u - x)', 'der(y) = b*(x - y)'], "
    "parameters: {a: 2, b: 3}}\nsensors: {out: {reads: y, noise: 0.1}}\n"
)


def test_a_block_with_two_stores_has_two_sums() -> None:
    """Their equations have names of their own."""
    assert [item.name for item in components(BLOCKS).equations] == ["pair.1", "pair.2", "pair.x.sum", "pair.y.sum"]


@pytest.mark.parametrize(
    ("name", "what"), [("u_0", "a sample of u"), ("out_12", "a sample of out"), ("dt", "the sample time")]
)
def test_a_number_with_the_name_of_a_sample_is_refused(name: str, what: str) -> None:
    """In a closed form `u_0` is the newest sample of `u`, and `dt` the sample time."""
    with pytest.raises(StructureError, match=f"{name} is also the name of {what}; rename it"):
        components(BLOCKS.replace("a*(", f"{name}*(").replace("parameters: {a", f"parameters: {{{name}"))


@pytest.mark.parametrize(
    ("old", "new", "what"),
    [
        ("inputs: {u:", "inputs: {dt:", "dt is also the name of the sample time"),
        ("sensors: {out:", "sensors: {dt:", "dt is also the name of the sample time"),
        ("sensors: {out:", "sensors: {b:", "b is also the name of a sensor"),
    ],
)
def test_a_sensor_with_the_name_of_a_number_is_refused(old: str, new: str, what: str) -> None:
    """The equations of a frame know each thing by its name alone."""
    text = BLOCKS.replace("(u - x)", "(dt - x)") if "inputs" in new else BLOCKS
    with pytest.raises(StructureError, match=rf"model.yaml:\d+: {what}; rename"):
        components(text.replace(old, new))


def test_frames() -> None:
    """In frame 1 the sum of a store relates samples 1 and 2; the newest sample is number 0."""
    assert to_text(in_frame(example("dc_motor").equation("J.sum"), 1)) == "dt*J.rate_1 - (omega_1 - omega_2)"
    assert frame_name(("omega", 0)) == "omega_0"


def test_two_sensors_of_one_signal() -> None:
    """The second says that it reads what the first reads."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8")
    twice = text.replace("sensors: {", "sensors: {again: {reads: C.e, unit: V, noise: 0.1 V}, ")
    assert laws(components(twice))["V_C"] == "V_C - again"


def test_order_for_a_search() -> None:
    """Two-ports come first, junctions and sensors last; in a junction what leads on to another part comes first."""
    motor = example("dc_motor")
    assert [item.name for item in motor.equations][:2] == ["K.1", "K.2"]
    assert [item.name for item in motor.equations][-2:] == ["armature", "shaft"]
    assert motor.equation("armature").signals[0] == ("K.e1", 0)
    assert [item.name for item in example("tank").equations][-1] == "flow"


def test_integrated_signals_are_states() -> None:
    """A position that a sensor reads is a state of no component, and its rate is a speed."""
    emps = example("emps")
    (position,) = (state for state in emps.states if state.component is None)
    assert (position.signal, position.rate, position.sum) == ("q_meas_m", "axis.f", "axis.q.sum")


def test_dependent_stores_are_states_too() -> None:
    """A capacitor on a source has a sum like any other; its voltage is the input."""
    net = components(
        "name: x\nsample_time: 1 s\ninputs: {V: {unit: V}}\ncomponents:\n  s: {type: Se, law: e = V}\n"
        "  C: {type: C, parameters: {X: 1 F}}\njunctions: {n: 0}\nbonds: [s -> n -> C]\n"
        "sensors: {i: {reads: C.f, unit: A, noise: 1 mA}}\n"
    )
    assert laws(net)["C.sum"] == "dt*C.rate - (V - V@1)"
    assert [(state.signal, state.rate) for state in net.states] == [("V", "C.rate")]
    assert "s" not in laws(net)


def test_a_source_that_is_more_than_an_input_is_an_equation() -> None:
    """`e = -V` is no other name of V."""
    net = components(
        "name: x\nsample_time: 1 s\ninputs: {V: {unit: V}}\ncomponents:\n  s: {type: Se, law: e = -V}\n"
        "  R: {type: R, parameters: {R: 1 ohm}}\njunctions: {n: 1}\nbonds: [s -> n -> R]\n"
        "sensors: {i: {reads: n.f, unit: A, noise: 1 mA}}\n"
    )
    assert laws(net)["s"] == "s.e - -V"
