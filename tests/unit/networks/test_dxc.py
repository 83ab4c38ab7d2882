"""Circuit XML and scenarios."""

import re
from pathlib import Path

import pytest

from faultbond.errors import ModelError, RecordingError
from faultbond.model.document import is_circuit
from faultbond.model.logic import Gate, GateFunction, LogicNetwork
from faultbond.networks.logic.diagnoses import minimum_diagnoses
from faultbond.networks.logic.dxc import MAX_BYTES, read_circuit, read_scenario
from made_circuits import circuit_text, made_scenario, multiplier, random_circuit, scenario_text

SCENARIO = """sensors @0 { i1 = true, o1 = false };
faultInjection @5000 isInjection = true, fault = { gate1 = faulty }, parameters = {};
faultInjection @5000 isInjection = true, fault = { gate2 = faulty }, parameters = {};
sensors @6000 { i1 = true, o1 = true };
ambiguityGroup @7000 size = 2, minCardinality = 1, diagnoses = { { gate1 }, { gate2, gate3 } };

normalizationFactor = 0.5;
"""


def circuit(components: str, connections: str) -> str:
    """Give a catalogue from `name type` and `one other`, each separated by `;`."""
    pairs = [part.split() for part in components.split(";")]
    wires = [part.split() for part in connections.split(";") if part.strip()]
    body = "".join(
        f"<component><name>{name}</name><componentType>{kind}</componentType></component>\n" for name, kind in pairs
    )
    joints = "".join(f"<connection><c1>{one}</c1><c2>{other}</c2></connection>\n" for one, other in wires)
    return (
        "<systemCatalog><systems><system><systemName> small </systemName>\n"
        f"<components>{body}</components><connections>{joints}</connections></system></systems></systemCatalog>"
    )


GATE = "g and2; g.o wire; g.i1 wire; g.i2 wire"
SMALL = circuit(f"a port; b port; s port; {GATE}", "g.o s; g.i1 a; g.i2 b")


def read(folder: Path, text: str) -> LogicNetwork:
    """Read a circuit from its text."""
    path = folder / "c.xml"
    path.write_text(text, encoding="utf-8")
    return read_circuit(path)


def refuse(folder: Path, text: str, message: str) -> None:
    """Check that a circuit is refused with one line that starts with the file."""
    with pytest.raises(ModelError, match=message) as caught:
        read(folder, text)
    assert str(caught.value).startswith(f"{folder / 'c.xml'}:")
    assert "\n" not in str(caught.value)


def test_a_circuit_is_recognised_by_its_suffix() -> None:
    """Circuits end in .xml, whatever the case."""
    assert is_circuit("74182.xml")
    assert is_circuit(Path("a") / "B.XML")
    assert not is_circuit("model.yaml")


def test_wiring_is_one_signal(tmp_path: Path) -> None:
    """Ports, probes and wires that are connected are one signal, named by the port, else the probe, else the pin."""
    text = circuit(
        "a port; s port; z probe; k xor2; k.o wire; k.i1 wire; k.i2 wire; "
        "n inverter; n.o wire; n.i1 wire; m buffer; m.o wire; m.i1 wire",
        "n.i1 a; n.o z; z m.i1; m.o k.i1; k.i2 z; s k.o",
    )
    network = read(tmp_path, text)
    assert network.name == "small"
    assert network.inputs == ("a",)
    assert network.outputs == ("s",)
    assert network.gates == (
        Gate(name="k", function=GateFunction.XOR, output="s", inputs=("m.o", "z")),
        Gate(name="n", function=GateFunction.NOT, output="z", inputs=("a",)),
        Gate(name="m", function=GateFunction.BUFFER, output="m.o", inputs=("z",)),
    )


def test_two_ports_on_one_signal_are_both_seen(tmp_path: Path) -> None:
    """A second port is a trusted copy of the first."""
    network = read(tmp_path, circuit(f"a port; b port; s port; t port; {GATE}", "g.o s; g.o t; g.i1 a; g.i2 b"))
    assert network.outputs == ("s", "t")
    assert network.suspects == ("g",)
    assert network.gates[-1] == Gate(name="t", function=GateFunction.BUFFER, output="t", inputs=("s",), trusted=True)


def test_two_ports_without_a_gate_are_one_input(tmp_path: Path) -> None:
    """The second of two ports that feed one gate is a trusted copy of the first, which alone is an input."""
    network = read(tmp_path, circuit(f"a port; b port; s port; {GATE}", "g.o s; g.i1 a; g.i2 b; a b"))
    assert (network.inputs, network.outputs) == (("a",), ("b", "s"))
    assert minimum_diagnoses(network, [{"a": True, "b": True, "s": False}]) == (frozenset({"g"}),)
    assert minimum_diagnoses(network, [{"b": True, "s": True}]) == (frozenset(),)
    assert minimum_diagnoses(network, [{"a": True, "b": False}]) == ()


def test_pins_are_counted_from_one(tmp_path: Path) -> None:
    """A wire `g.i0` is no pin, and in particular not the output."""
    text = circuit("a port; s port; g inverter; g.o wire; g.i1 wire; g.i0 wire", "g.o s; g.i1 a; g.i0 a")
    assert read(tmp_path, text).gates == (Gate(name="g", function=GateFunction.NOT, output="s", inputs=("a",)),)


@pytest.mark.parametrize("network", [random_circuit(8, 40, 5, seed=1, xor=0.2), multiplier(4)])
def test_what_is_written_is_read(tmp_path: Path, network: LogicNetwork) -> None:
    """A made circuit comes back as it was, with inputs of gates in order."""
    back = read(tmp_path, circuit_text(network))
    assert (back.name, set(back.inputs), set(back.outputs)) == (network.name, set(network.inputs), set(network.outputs))
    assert back.gates == network.gates


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("<systemCatalog>", r"c\.xml:1: not XML"),
        ("<a/>", "no circuit in it"),
        ('<!DOCTYPE a [<!ENTITY b "c">]>\n<a>&b;</a>', r"c\.xml:1: a document type is not read"),
        (circuit("a port", ""), "no gate in it"),
        (circuit("a port; a port", ""), r"c\.xml:2: component a stands twice"),
        (SMALL.replace("<name>g</name>", "<name/>"), "a component has no name"),
        (SMALL.replace("and2", "and"), None),
        (SMALL.replace("and2", "mux2"), r"c\.xml:5: g is of type 'mux2'. Known are and, or"),
        (SMALL.replace("and2", "and3"), r"c\.xml:5: and3 g needs the wires g\.o and g\.i1 to g\.i3"),
        (SMALL.replace("and2", "and9999"), "needs the wires"),
        (SMALL.replace("and2", "inverter"), r"needs the wires g\.o and g\.i1\. Declare"),
        (SMALL.replace("<c2>b</c2>", "<c2>x</c2>"), r"c\.xml:11: connection to 'x', which is no port"),
        (SMALL.replace("<c2>b</c2>", "<c2>g</c2>"), "connection to 'g', which is no port"),
        (circuit(f"a port; s port; {GATE}", "g.o s; g.i1 a"), "gate g: nothing drives its input g.i2"),
    ],
)
def test_what_is_no_circuit(tmp_path: Path, text: str, message: str | None) -> None:
    """One line tells file, line, what is wrong and what to do; a gate's number of inputs need not be told."""
    if message is None:
        assert read(tmp_path, text) == read(tmp_path, SMALL)
    else:
        refuse(tmp_path, text, message)


def test_what_is_no_text(tmp_path: Path) -> None:
    """A file that is missing, not UTF-8 or too large is refused."""
    path = tmp_path / "c.xml"
    with pytest.raises(ModelError, match="No such file"):
        read_circuit(path)
    path.write_bytes(b"\xff\xfe<")
    with pytest.raises(ModelError, match="not UTF-8"):
        read_circuit(path)
    with path.open("wb") as stream:
        stream.truncate(MAX_BYTES + 1)
    with pytest.raises(ModelError, match="more than the 64 MB"):
        read_circuit(path)


def test_a_scenario(tmp_path: Path) -> None:
    """Observations in seconds, the injected faults, the true group, and what its score is divided by."""
    path = tmp_path / "a.000.scn"
    path.write_text(SCENARIO, encoding="utf-8")
    scenario = read_scenario(path)
    assert scenario.name == "a.000"
    assert [(item.time, item.values) for item in scenario.observations] == [
        (0.0, {"i1": True, "o1": False}),
        (6.0, {"i1": True, "o1": True}),
    ]
    assert scenario.injected == {"gate1", "gate2"}
    assert scenario.cardinality == 1
    assert scenario.diagnoses == (frozenset({"gate1"}), frozenset({"gate2", "gate3"}))
    assert scenario.normalization == 0.5


def test_a_scenario_without_truth(tmp_path: Path) -> None:
    """What a file does not tell is None; what a later version may add is passed over."""
    network = multiplier(3)
    path = tmp_path / "a.scn"
    before, after, injected = made_scenario(network, 2, seed=1)
    path.write_text(scenario_text(before, after, injected) + "note @9 text;", encoding="utf-8")
    scenario = read_scenario(path)
    assert [item.values for item in scenario.observations] == [before, after]
    assert scenario.injected == injected
    assert (scenario.diagnoses, scenario.cardinality, scenario.normalization) == (None, None, None)


def test_observations_stand_in_the_order_of_time(tmp_path: Path) -> None:
    """The order of lines does not matter."""
    path = tmp_path / "a.scn"
    path.write_text("sensors @20 { a = true };\nsensors @10 { a = false };", encoding="utf-8")
    assert [item.time for item in read_scenario(path).observations] == [0.01, 0.02]


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("sensors", "measured", "a.scn: no observation"),
        ("@0 {", "@ {", "a.scn:1: '' is not a number"),
        ("@6000", "@6.0.0", "a.scn:4: '6.0.0' is not a number"),
        ("o1 = true", "o1 = maybe", "a.scn:4: 'o1 = maybe' is no observation"),
        ("o1 = true", "i1 = true", "a.scn:4: i1 is observed twice"),
        ("{ i1 = true, o1 = true }", "i1 = true", "a.scn:4: expected values in braces"),
        ("size = 2", "size = 3", "a.scn:5: size = 3, but 2 diagnoses"),
        ("diagnoses = {", "sets = {", "a.scn:5: expected diagnoses"),
        ("= 0.5", "= half", "a.scn:7: 'half' is not a number"),
        ("= 0.5", "= 0", "a.scn:7: normalizationFactor 0 is not positive"),
        ("0.5;", "0.5", "a.scn:7: 'normalizationFactor = 0.5' does not end"),
        ("normalizationFactor", "%", "a.scn:7: '% = 0.5' is no statement"),
    ],
)
def test_what_is_no_scenario(tmp_path: Path, old: str, new: str, message: str) -> None:
    """One line tells file, line, and what is wrong."""
    path = tmp_path / "a.scn"
    path.write_text(SCENARIO.replace(old, new), encoding="utf-8")
    with pytest.raises(RecordingError, match=re.escape(message)):
        read_scenario(path)


@pytest.mark.parametrize("length", range(0, len(SCENARIO) - 3, 7))
def test_a_scenario_that_is_cut_off(tmp_path: Path, length: int) -> None:
    """Is either refused or, cut between two statements, read without what is missing."""
    path = tmp_path / "a.scn"
    text = SCENARIO[:length].rstrip()
    path.write_text(text, encoding="utf-8")
    if text.endswith(";"):
        assert read_scenario(path).normalization is None
    else:
        with pytest.raises(RecordingError):
            read_scenario(path)
