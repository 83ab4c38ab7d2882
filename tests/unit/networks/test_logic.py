"""All smallest diagnoses of a logic network."""

import re

import pytest

from faultbond.errors import StructureError
from faultbond.model.logic import Gate, GateFunction, GateSet, LogicNetwork
from faultbond.model.text import parse_model
from faultbond.networks.logic import diagnoses as logic
from faultbond.networks.logic.diagnoses import explains, logic_network, minimum_diagnoses, predict
from made_circuits import made_scenario, multiplier

FULL_ADDER = """
name: full adder
sample_time: none
inputs: {A: {unit: logic}, B: {unit: logic}, C: {unit: logic}}
blocks:
  X1: {law: x = A ^ B}
  A1: {law: y = A & B}
  A2: {law: z = x & C}
  X2: {law: s = x ^ C}
  O1: {law: c = y | z}
sensors: {D: {reads: s, unit: logic}, E: {reads: c, unit: logic}}
"""
SEEN = {"A": True, "B": False, "C": True, "D": True, "E": False}  # figure 3.7


def adder(**laws: str) -> LogicNetwork:
    """Give the full adder, some of its blocks written anew."""
    text = FULL_ADDER
    for name, entry in laws.items():
        text = re.sub(rf"  {name}: .*", f"  {name}: {entry}", text)
    return logic_network(parse_model(text))


def sets(*texts: str) -> tuple[GateSet, ...]:
    """Give diagnoses from `X1 A2`."""
    return tuple(frozenset(text.split()) for text in texts)


def test_the_full_adder_of_the_thesis() -> None:
    """G10: {X1} is the smallest; with X1 trusted, {X2, A2} and {X2, O1} are."""
    assert minimum_diagnoses(adder(), [SEEN]) == sets("X1")
    trusted = adder(X1="{law: x = A ^ B, suspect: no}")
    assert minimum_diagnoses(trusted, [SEEN]) == sets("A2 X2", "X2 O1")
    assert minimum_diagnoses(adder(), [SEEN | {"A": False, "B": True}]) == sets("X1")


def test_what_explains_the_full_adder() -> None:
    """G10: {O1} alone does not; {X2, A2, A1} does, without being minimal."""
    assert not explains(adder(), frozenset({"O1"}), [SEEN])
    assert not explains(adder(), frozenset(), [SEEN])
    for diagnosis in sets("X2 A2 A1", "X2 A2", "X2 O1", "X1"):
        assert explains(adder(), diagnosis, [SEEN])


def test_a_healthy_network_has_the_empty_diagnosis() -> None:
    """Nothing is abnormal; no observation at all says nothing either."""
    healthy = {"A": True, "B": False, "C": True, "D": False, "E": True}
    assert minimum_diagnoses(adder(), [healthy]) == (frozenset(),)
    assert minimum_diagnoses(adder(), []) == (frozenset(),)


def test_healthy_observations_rule_nothing_out() -> None:
    """An abnormal gate may be right by chance, so rows that contradict nothing change nothing."""
    healthy = {"A": False, "B": False, "C": False, "D": False, "E": False}
    assert minimum_diagnoses(adder(), [healthy, SEEN, SEEN]) == minimum_diagnoses(adder(), [SEEN])


def test_every_observation_is_explained() -> None:
    """The same gates are abnormal in all rows, and give what they like in each."""
    other = {"A": False, "B": False, "C": True, "D": True, "E": True}  # E should be 0
    assert minimum_diagnoses(adder(), [other]) == sets("A1", "A2", "O1")
    both = sets("X1 A1", "X1 A2", "X1 O1", "A2 X2", "X2 O1")
    assert set(minimum_diagnoses(adder(), [SEEN, other])) == {*both, frozenset({"X1", "X2"})}


def test_what_nothing_explains() -> None:
    """Without a suspect on the way to what is wrong there is no diagnosis."""
    trusted = adder(X1="{law: x = A ^ B, suspect: no}", X2="{law: s = x ^ C, suspect: no}")
    assert minimum_diagnoses(trusted, [SEEN]) == ()


def test_what_is_not_seen_is_free() -> None:
    """Without E any of three gates explains D, and what only E depends on explains nothing."""
    seen = {name: value for name, value in SEEN.items() if name != "E"}
    assert minimum_diagnoses(adder(), [seen]) == sets("X1", "X2")


def test_an_unknown_input_may_have_had_any_value() -> None:
    """With C unknown the row is possible; with A and D known it is not, whatever B was."""
    unknown = {name: value for name, value in SEEN.items() if name != "C"}
    assert minimum_diagnoses(adder(), [unknown]) == (frozenset(),)
    impossible = {"A": False, "C": False, "E": True}
    assert minimum_diagnoses(adder(), [impossible]) == sets("A1", "A2", "O1")
    assert explains(adder(), frozenset({"A1"}), [impossible])
    assert not explains(adder(), frozenset({"X1"}), [impossible])


def test_a_block_of_two_laws_fails_as_one() -> None:
    """A half adder whose outputs are both wrong is one fault, in a row with one wrong output too."""
    text = """
name: two
sample_time: none
inputs: {A: {unit: logic}, B: {unit: logic}}
blocks:
  H: {law: [s = A ^ B, c = A & B]}
  N: {law: n = ~s}
  M: {law: m = ~c}
sensors: {D: {reads: n, unit: logic}, E: {reads: m, unit: logic}}
"""
    network = logic_network(parse_model(text))
    assert network.suspects == ("H", "N", "M")
    both = {"A": True, "B": True, "D": False, "E": True}  # right: D 1, E 0
    assert minimum_diagnoses(network, [both]) == sets("H")
    one = {"A": True, "B": True, "D": False, "E": False}
    assert minimum_diagnoses(network, [one]) == sets("H", "N")
    assert explains(network, frozenset({"H"}), [both, one])


def test_a_region_gives_all_its_gates() -> None:
    """In a chain every gate can make the end wrong; beside it only those that what they meet lets through."""
    text = """
name: chain
sample_time: none
inputs: {A: {unit: logic}, B: {unit: logic}}
blocks:
  P: {law: p = ~A}
  Q: {law: q = p & B}
  R: {law: r = ~q}
  S: {law: s = r | A}
sensors: {D: {reads: s, unit: logic}}
"""
    network = logic_network(parse_model(text))
    assert minimum_diagnoses(network, [{"A": False, "B": True, "D": True}]) == sets("P", "Q", "R", "S")
    assert minimum_diagnoses(network, [{"A": False, "B": False, "D": False}]) == sets("Q", "R", "S")
    assert minimum_diagnoses(network, [{"A": True, "B": True, "D": False}]) == sets("S")


def test_predict_gives_every_signal() -> None:
    """Signals that no sensor reads among them."""
    expected = {"x": True, "y": False, "z": True, "s": False, "c": True, "D": False, "E": True}
    assert predict(adder(), SEEN) == {"A": True, "B": False, "C": True} | expected
    with pytest.raises(StructureError, match=r"full adder: no value of input B, C\. Give one\."):
        predict(adder(), {"A": True})


def test_laws_of_blocks() -> None:
    """Precedence, negation, constants and parts of a law; only the whole law is a suspect."""
    network = adder(O1="{law: c = ~(y | z & 1) ^ ~0 | 0}")
    (law,) = (gate for gate in network.gates if gate.output == "c")
    assert (law.function, law.trusted) == (GateFunction.OR, False)
    assert all(gate.trusted for gate in network.gates if gate.name == "O1" and gate.output != "c")
    assert network.suspects == adder().suspects
    for case in range(8):
        inputs = {name: bool(case >> bit & 1) for bit, name in enumerate("ABC")}
        assert predict(network, inputs)["c"] == predict(adder(), inputs)["c"]


def test_sensors_read_expressions() -> None:
    """A sensor is a trusted gate, or the signal of its name itself."""
    text = FULL_ADDER.replace("D: {reads: s,", "D: {reads: ~s,").replace("E: {reads: c,", "E: {reads: A & c,")
    network = logic_network(parse_model(text))
    assert network.outputs == ("D", "E")
    values = predict(network, SEEN)
    assert (values["D"], values["E"], values["s"]) == (True, True, False)
    own = logic_network(parse_model(FULL_ADDER.replace("E: {reads: c,", "c: {reads: c,")))
    assert [gate.name for gate in own.gates if gate.output == "c"] == ["O1"]
    assert minimum_diagnoses(own, [{"A": False, "B": False, "C": False, "c": True}]) == sets("A1", "A2", "O1")


def test_an_unknown_signal_is_refused() -> None:
    """What was seen must be a signal of the network."""
    with pytest.raises(StructureError, match="nothing sets signal F"):
        minimum_diagnoses(adder(), [SEEN | {"F": True}])


def test_the_time_limit() -> None:
    """A search that takes too long stops with one line that tells what to do; a healthy network needs none."""
    assert minimum_diagnoses(adder(), [], time_limit=0.0) == (frozenset(),)
    with pytest.raises(StructureError, match=r"did not end in time.*Allow more time, or observe more signals"):
        minimum_diagnoses(adder(), [SEEN], time_limit=0.0)


def test_too_many_diagnoses_are_refused(monkeypatch: pytest.MonkeyPatch) -> None:
    """Never a silent cut."""
    other = {"A": False, "B": False, "C": True, "D": True, "E": True}
    monkeypatch.setattr(logic, "MAX_DIAGNOSES", 2)
    with pytest.raises(StructureError, match="3 diagnoses of 1 gate"):
        minimum_diagnoses(adder(), [other])


def test_too_many_ways_are_refused() -> None:
    """`explains` tries all that abnormal gates could give, up to a bound."""
    gates = tuple(
        Gate(name=f"g{number}", function=GateFunction.BUFFER, output=f"z{number}", inputs=("a",))
        for number in range(30)
    )
    network = LogicNetwork(name="wide", gates=gates, inputs=("a",), outputs=())
    seen = {"a": True} | {gate.output: False for gate in gates}
    with pytest.raises(StructureError, match="30 abnormal gates and 0 unknown inputs"):
        explains(network, frozenset(network.suspects), [seen])


def test_diagnoses_stand_in_the_order_of_the_gates() -> None:
    """The same network gives the same list, whatever order the solver finds them in."""
    network = multiplier(6)
    _, after, _ = made_scenario(network, 2, seed=3)
    place = {name: index for index, name in enumerate(network.suspects)}
    found = [sorted(place[name] for name in diagnosis) for diagnosis in minimum_diagnoses(network, [after])]
    assert len(found) > 1
    assert found == sorted(found)
