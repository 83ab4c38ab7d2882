"""The built-in plants and a real rig as bond graphs."""

import math
import time
from dataclasses import replace
from pathlib import Path

import pytest

from faultbond.model.graph import BondGraph
from faultbond.model.parser import parse_expression, to_text
from faultbond.model.text import dump_model, load_model, parse_model
from faultbond.types import ElementType, JunctionType, TimeGrid

EXAMPLES = Path(__file__).parents[3] / "examples"

RIG = """
name: two levels of a rig
sample_time: 1 s
time: {column: t_s, unit: s}
accuracy: 5 %
inputs: {inflow: {column: FS_A4, unit: cm^3/s}, outflow: {column: FS_C4, unit: cm^3/s}}
components:
  meter4:  {type: Sf, law: f = G4*inflow, parameters: {G4: 1}}
  tank3:   {type: C, law: e = q/A3, parameters: {A3: 1017.9 cm^2}}
  tank4:   {type: C, law: e = q/A4, parameters: {A4: 1017.9 cm^2}}
  demand4: {type: Sf, law: f = outflow}
  leak4:   {type: Sf, law: f = L4, parameters: {L4: {nominal: 0 cm^3/s, accuracy: 2 cm^3/s, change: 50 cm^3/s}}}
junctions: {node3: 0, line4: 1, node4: 0}
bonds: [meter4 -> line4, node3 -> line4 -> node4, node3 -> tank3, node4 -> tank4, node4 -> demand4, node4 -> leak4]
sensors: {LS_A4: {reads: node4.e, unit: cm, noise: 0.1 cm}}
slow_error:
  demand4.f: 0.5 cm^3/s over 600 s
  LS_A4: {size: 0.2 cm over 40 s, after: [inflow, outflow], each: 0.005 cm/(cm^3/s)}
"""


@pytest.fixture
def tank() -> BondGraph:
    """The water tank."""
    return load_model(EXAMPLES / "tank" / "model.yaml")


@pytest.fixture
def rig() -> BondGraph:
    """Part of a rig with other columns and units."""
    return parse_model(RIG)


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*/model.yaml")), ids=lambda path: path.parent.name)
def test_examples_read_back(path: Path) -> None:
    """Every example loads, and its canonical text is a fixed point."""
    graph = load_model(path)
    assert dump_model(parse_model(graph.text, file=str(path))) == graph.text


def test_laws_have_full_names(tank: BondGraph) -> None:
    """Own signals carry the component's name."""
    (law,) = tank.component("pipe").laws
    assert (to_text(law.left), to_text(law.right)) == ("pipe.e", "K1*pipe.f*abs(pipe.f)")
    assert law.line == 11
    assert tank.sensors[0].reads == parse_expression("sqrt(orifice.e/K_meter)")


def test_parameters_have_spreads(tank: BondGraph) -> None:
    """Accuracy and change are absolute and in SI; the range keeps the sign."""
    k1, k6 = tank.parameter("K1"), tank.parameter("K6")
    assert (k1.nominal, k1.owner, k1.unit.text) == (2.41e11, "pipe", "Pa*s^2/m^6")
    assert (k1.accuracy, k1.change) == pytest.approx((0.03 * 2.41e11, 2 * 2.41e11))
    assert (k1.lower, k1.upper) == (0.0, math.inf)
    assert k6.change == pytest.approx(10 * 1.04e-5)


def test_chains_are_bonds(tank: BondGraph) -> None:
    """A chain of arrows is a bond for each."""
    assert [(bond.tail, bond.head) for bond in tank.bonds[:3]] == [
        ("pump", "line"),
        ("line", "pipe"),
        ("line", "orifice"),
    ]
    assert tank.junctions[0].type is JunctionType.ONE


def test_every_default_is_listed(tank: BondGraph) -> None:
    """What the file does not state is in the list of defaults, like with like."""
    assert tank.defaults == (
        ("time", "column `time` in s"),
        ("max_faults", "2"),
        ("noise of u_in, u_out", "0"),
        ("column of u_in, u_out, flow, pressure", "its name"),
        ("range of K8, K1, K2, K7, K3, K4, K6", "0 or more"),
        ("change of K8, K1, K2, K7, K3, K4", "200 %"),
        ("start of tank", "solved from the first samples"),
        ("warm_up", "180 s"),
    )


def test_warm_up_covers_slow_errors(tank: BondGraph) -> None:
    """The warm-up is 0.3 of the longest memory of the plant, and 20 samples at least."""
    assert tank.warm_up == 180.0
    assert load_model(EXAMPLES / "dc_motor" / "model.yaml").warm_up == pytest.approx(0.4)


def test_default_laws() -> None:
    """R, I and GY with one parameter need no law."""
    motor = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    texts = {
        item.name: [f"{to_text(law.left)} = {to_text(law.right)}" for law in item.laws] for item in motor.components
    }
    assert texts["R"] == ["R.e = R*R.f"]
    assert texts["L"] == ["L.p = L*L.f"]
    assert texts["K"] == ["K.e1 = K*K.f2", "K.e2 = K*K.f1"]
    assert motor.component("K").type is ElementType.GY
    assert ("law of R", "e = R*f") in motor.defaults


def test_rig_units_and_columns(rig: BondGraph) -> None:
    """Columns and units of a real recording come out in SI."""
    assert (rig.time.column, rig.input("inflow").column, rig.sensors[0].column) == ("t_s", "FS_A4", "LS_A4")
    assert rig.input("inflow").unit.factor == 1e-6
    assert rig.sensors[0].noise == 0.001
    assert rig.parameter("G4").unit.text == ""


def test_rig_nominal_zero(rig: BondGraph) -> None:
    """A nominal of 0 has absolute spreads and any sign."""
    leak = rig.parameter("L4")
    assert leak.nominal == 0.0
    assert (leak.accuracy, leak.change) == pytest.approx((2e-6, 5e-5))
    assert (leak.lower, leak.upper) == (-math.inf, math.inf)
    assert leak.scale == leak.change


def test_rig_slow_errors(rig: BondGraph) -> None:
    """A slow error is relative or absolute, of a signal or of a sensor."""
    flow, level = rig.slow_errors
    assert (flow.target, flow.relative, flow.memory) == ("demand4.f", False, 600.0)
    assert flow.sd == pytest.approx(5e-7)
    assert (level.is_sensor, level.sd, level.after, level.each) == (True, 0.002, ("inflow", "outflow"), (50.0, 50.0))


def test_variable_grid() -> None:
    """A model without a fixed sample time has none, and a warm-up of 20 s at least."""
    graph = parse_model((EXAMPLES / "rc" / "model.yaml").read_text().replace("0.02 s", "variable"))
    assert (graph.grid, graph.sample_time, graph.warm_up) == (TimeGrid.VARIABLE, None, 20.0)


def test_name_defaults_to_the_file() -> None:
    """Without a name the model is called as its file."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text().replace("name: RC circuit\n", "")
    graph = parse_model(text, file="plants/boiler.yaml")
    assert graph.name == "boiler"
    assert graph.file == "plants/boiler.yaml"
    assert ("name", "the file's name") in graph.defaults


def test_integrals_are_signals() -> None:
    """A sensor may read the integral of a flow or of an effort."""
    text = (
        (EXAMPLES / "dc_motor" / "model.yaml")
        .read_text()
        .replace("shaft.f, unit: rad/s, noise: 0.06 rad/s", "shaft.q, unit: deg, noise: 1 deg")
    )
    assert to_text(parse_model(text).sensors[0].reads) == "shaft.q"


def test_layout_does_not_change_the_text() -> None:
    """Comments, quotes and spaces do not reach the canonical text."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text()
    other = "# a comment\n" + text.replace("10 kohm", '"10   kohm"').replace("e = V", "e  =  (V)")
    assert parse_model(other).text == parse_model(text).text


def test_changed_graph_writes_what_is_no_default_any_more(tank: BondGraph) -> None:
    """A fitted parameter keeps its spreads, although they were defaults before."""
    fitted = [replace(item, nominal=1.1 * item.nominal) if item.name == "K1" else item for item in tank.parameters]
    again = parse_model(dump_model(replace(tank, parameters=tuple(fitted), max_faults=3)))
    assert again.parameter("K1").nominal == 1.1 * 2.41e11
    assert again.parameter("K1").change == tank.parameter("K1").change
    assert again.parameter("K1").accuracy == tank.parameter("K1").accuracy
    assert again.max_faults == 3
    assert dict(again.defaults)["change of K8, K2, K7, K3, K4"] == "200 %"


def test_loading_does_not_blow_up(tank: BondGraph) -> None:
    """A plant of seven elements loads in no more than seconds of processor time, however slow the machine."""
    begun = time.process_time()
    parse_model(tank.text)
    assert time.process_time() - begun < 3.0
