"""Keys on faults of instruments, limits of drifts, false alarms, and checks by hand."""

import math
from dataclasses import replace

import pytest

from faultbond.errors import ModelError
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.model.parser import to_text
from faultbond.model.text import dump_model, parse_model
from faultbond.types import CheckKind

PLANT = """\
name: vessel
sample_time: 1 s
inputs: {Q: {unit: l/min}}
components:
  pump: {type: Sf, law: f = G*Q, parameters: {G: 1}}
  vessel: {type: C, law: e = q/A, parameters: {A: 0.2 m^2}}
  outlet: {type: R, law: f = K*sqrt(e), parameters: {K: 1e-4 m^2.5/s}}
junctions: {node: 0}
bonds: [pump -> node -> vessel, node -> outlet]
sensors: {level: {reads: vessel.e, unit: cm, noise: 2 mm}, bare: {reads: vessel.e, noise: 2 mm}}
"""
STATIC = """\
sample_time: none
inputs: {x: {}}
blocks: {b: {law: y = K*x, parameters: {K: 2}}}
sensors: {s: {reads: y}}
"""
LOGIC = """\
sample_time: none
inputs: {x: {unit: logic}}
blocks: {b: {law: y = ~x}}
sensors: {s: {reads: y, unit: logic}}
"""


def read(*changes: tuple[str, str], more: str = "", base: str = PLANT) -> BondGraph:
    """Give the plant with texts replaced and lines added; it also reads back from its canonical text."""
    for old, new in changes:
        assert base.count(old) == 1
        base = base.replace(old, new)
    graph = parse_model(base + more)
    again = parse_model(graph.text)
    assert dump_model(again) == graph.text
    assert [replace(item, line=0) for item in again.checks] == [replace(item, line=0) for item in graph.checks]
    assert again.time_between_false_alarms == graph.time_between_false_alarms
    return graph


def suspects(graph: BondGraph) -> list[str]:
    """Give the inputs and sensors that may fail."""
    found = [item.name for item in graph.inputs if item.suspect]
    return found + [item.name for item in graph.sensors if item.suspect]


def test_instruments_are_suspects() -> None:
    """Every input and sensor is a suspect, but for those that say no."""
    assert suspects(read()) == ["Q", "level", "bare"]
    assert suspects(read(("unit: l/min", "unit: l/min, suspect: no"))) == ["level", "bare"]
    assert suspects(read(("unit: cm", "unit: cm, suspect: no"))) == ["Q", "bare"]


def test_instruments_are_trusted_together() -> None:
    """`instrument_faults: no` trusts all that say nothing, and is the same plant as `suspect: no` at each."""
    trusted = read(more="instrument_faults: no\n")
    assert suspects(trusted) == []
    assert suspects(read(("unit: cm", "unit: cm, suspect: yes"), more="instrument_faults: no\n")) == ["level"]
    singly = read(
        ("l/min}", "l/min, suspect: no}"), ("cm,", "cm, suspect: no,"), ("noise: 2 mm}}", "noise: 2 mm, suspect: no}}")
    )
    assert singly.sha256 == trusted.sha256 != read().sha256
    assert read(more="instrument_faults: yes\n").sha256 == read().sha256


@pytest.mark.parametrize("text", [STATIC, LOGIC])
def test_static_networks_have_no_instrument_faults(text: str) -> None:
    """Where there is no time, no input and no sensor is a suspect, and the text does not say so."""
    graph = read(base=text)
    assert suspects(graph) == []
    assert "suspect" not in graph.text


def test_measuring_range() -> None:
    """The range of a sensor is kept in SI; an end may be infinite, and without a unit the sensor's law decides."""
    assert [(item.lower, item.upper) for item in read().sensors] == [(-math.inf, math.inf)] * 2
    graph = read(("unit: cm", "unit: cm, range: [0, 2 m]"), ("bare: {", "bare: {range: [-inf, 90 cm], "))
    assert [(item.lower, item.upper) for item in graph.sensors] == [(0.0, 2.0), (-math.inf, 0.9)]
    assert read(("unit: cm", "unit: cm, range: any")).sha256 == read().sha256


def test_range_of_an_input() -> None:
    """What an input can be is kept in SI, in its unit, and in the text of the model."""
    graph = read(("unit: l/min", "unit: l/min, range: [-inf, 6 l/min]"))
    (flow,) = graph.inputs
    assert flow.lower == -math.inf
    assert flow.upper == pytest.approx(1e-4)
    assert "range: [-inf, 6 l/min]" in graph.text
    assert read(("unit: l/min", "unit: l/min, range: any")).sha256 == read().sha256


def test_limits() -> None:
    """A limit is a value in SI, on either side of the nominal or on both."""
    for text, limits in (("5e-5 m^2.5/s", (5e-5,)), ("[2e-4]", (2e-4,)), ("[2e-4, 5e-5 m^2.5/s]", (5e-5, 2e-4))):
        graph = read(("{K: 1e-4 m^2.5/s}", f"{{K: {{nominal: 1e-4 m^2.5/s, limit: {text}}}}}"))
        assert graph.parameter("K").limits == limits
    assert read().parameter("K").limits == ()


def test_time_between_false_alarms() -> None:
    """It is a time in seconds, None where nothing is promised."""
    assert read().time_between_false_alarms is None
    assert read(more="time_between_false_alarms: 30 days\n").time_between_false_alarms == 30 * 86400


def test_false_alarms() -> None:
    """They are counted; none are known unless stated."""
    assert read().false_alarms == 0
    assert read(more="false_alarms: 12\n").false_alarms == 12


def test_checks() -> None:
    """A component is looked at, an input moved, a signal measured; a cost alone may stand for a table."""
    more = """\
checks:
  outlet: 20
  vessel: {}
  pump:
  Q: {move: 6 l/min, cost: 0.5}
  jug: {reads: 2*outlet.f, unit: l/min, noise: 0.6 l/min, cost: 5}
"""
    checks = {item.name: item for item in read(more=more).checks}
    assert [item.kind for item in checks.values()] == [*[CheckKind.COMPONENT] * 3, CheckKind.INPUT, CheckKind.SIGNAL]
    assert [item.cost for item in checks.values()] == [20.0, 1.0, 1.0, 0.5, 5.0]
    assert [item.line for item in checks.values()] == [12, 13, 14, 15, 16]
    assert checks["Q"].move == pytest.approx(1e-4)
    jug = checks["jug"]
    assert jug.reads is not None
    assert (to_text(jug.reads), jug.unit.text) == ("2*outlet.f", "l/min")
    assert jug.noise == pytest.approx(1e-5)
    assert dict(read(more=more).defaults)["cost of vessel, pump"] == "1"


@pytest.mark.parametrize("word", ["no", "false"])
def test_an_input_that_nobody_can_move(word: str) -> None:
    """It says so, and says so again when it is written."""
    graph = read(more=f"checks: {{Q: {{move: {word}, cost: 2}}}}\n")
    assert [(item.name, item.move, item.cost) for item in graph.checks] == [("Q", 0.0, 2.0)]
    assert parse_model(dump_model(graph)).checks[0].move == 0.0


def test_checks_of_networks() -> None:
    """Blocks, and signals of a block network, are checked too; what is measured may have the signal's name."""
    checks = read(base=STATIC, more="checks: {b: 2, x: {move: 1}, y: {reads: y}}\n").checks
    assert [(item.kind.value, item.noise) for item in checks] == [("component", 0.0), ("input", 0.0), ("signal", 0.0)]
    logic = read(base=LOGIC, more="checks: {b: 2, x: {}, y: {reads: y, unit: logic}}\n").checks
    assert [item.kind.value for item in logic] == ["component", "input", "signal"]


def test_builder_knows_the_keys() -> None:
    """Builder and file give the same canonical text."""
    plant = ModelBuilder(
        "vessel", sample_time="1 s", time_between_false_alarms="2 weeks", false_alarms=2, instrument_faults=False
    )
    plant.input("Q", unit="l/min", range=["0 l/min", "inf"], suspect=True)
    plant.bond("pump -> node -> vessel").bond("node -> outlet").junction("node", 0)
    plant.component("pump", "Sf", law="f = G*Q", parameters={"G": 1})
    plant.component("vessel", "C", law="e = q/A", parameters={"A": "0.2 m^2"})
    limited = {"nominal": "1e-4 m^2.5/s", "limit": ["5e-5", "3e-4"]}
    plant.component("outlet", "R", law="f = K*sqrt(e)", parameters={"K": limited})
    plant.sensor("level", "vessel.e", unit="cm", noise="2 mm", range=["0 cm", "inf"])
    plant.sensor("bare", "vessel.e", noise="2 mm", suspect=True)
    plant.check("outlet", cost=20).check("Q", move="6 l/min").check("jug", reads="outlet.f", unit="l/min", noise=1)
    text = read(
        ("unit: l/min", "unit: l/min, range: [0, inf], suspect: yes"),
        ("unit: cm", "unit: cm, range: [0, inf]"),
        ("bare: {", "bare: {suspect: yes, "),
        ("{K: 1e-4 m^2.5/s}", "{K: {nominal: 1e-4 m^2.5/s, limit: [5e-5, 3e-4]}}"),
        more="time_between_false_alarms: 2 weeks\nfalse_alarms: 2\ninstrument_faults: no\n"
        "checks: {outlet: 20, Q: {move: 6}, jug: {reads: outlet.f, unit: l/min, noise: 1}}\n",
    ).text
    assert plant.build().text == text


SENSOR, K = "unit: cm", "{K: 1e-4 m^2.5/s}"
WRONG = [  # what stands in the file, what stands there instead, line, message
    ("l/min}", "l/min, suspect: maybe}", 3, "input Q: suspect is `yes` or `no`, not `maybe`"),
    (SENSOR, "unit: cm, suspect: 5", 10, "sensor level: suspect is `yes` or `no`"),
    ("name:", "instrument_faults: none\nname:", 1, "instrument_faults is `yes` or `no`, not `none`"),
    ("l/min}", "l/min, range: 5}", 3, r"input Q: range is `\[lowest, highest\]` or `any`"),
    ("l/min}", "l/min, range: [0 Pa, 5]}", 3, "input Q: range is in Pa, but"),
    ("l/min}", "l/min, range: [5, 1]}", 3, "input Q: range: the lowest value must be below the highest"),
    (SENSOR, "unit: cm, range: 5 cm", 10, r"sensor level: range is `\[lowest, highest\]` or `any`"),
    (SENSOR, "unit: cm, range: [0 Pa, 5]", 10, "sensor level: range is in Pa, but m is expected"),
    (SENSOR, "unit: cm, range: [5, 1]", 10, "sensor level: range: the lowest value must be below the highest"),
    ("bare: {", "bare: {range: [0 Pa, 1 Pa], ", 10, "sensor bare: range is in Pa, but m is expected"),
    (
        "bare: {reads: vessel.e, noise: 2 mm}",
        "bare: {reads: vessel.e, noise: 1, range: [0 Pa, 1 Pa]}",
        *(10, "sensor bare: `vessel.e` is in m, but its range in Pa"),
    ),
    (K, "{K: {nominal: 1, limit: 5 %}}", 7, "parameter K: limit `5 %` is relative"),
    (K, "{K: {nominal: 1 m^2.5/s, limit: 5 Pa}}", 7, "parameter K: limit is in Pa, but"),
    (K, "{K: {nominal: 1, limit: 1}}", 7, "parameter K: limit is one value other than the nominal"),
    (K, "{K: {nominal: 1, limit: [2, 3]}}", 7, "parameter K: limit is one value other than the nominal"),
    (K, "{K: {nominal: 1, limit: []}}", 7, "parameter K: limit is one value other than the nominal"),
    (K, "{K: {nominal: 1, limit: -1}}", 7, "parameter K: limit must lie within the range"),
    (K, "{K: {nominal: 1, limit: inf}}", 7, "parameter K: limit must lie within the range"),
    ("name:", "time_between_false_alarms: 0 s\nname:", 1, "time_between_false_alarms must be above 0, such as"),
    ("name:", "false_alarms: -1\nname:", 1, "false_alarms is a whole number from 0 to 1000000, not `-1`"),
    ("name:", "false_alarms: 3 d\nname:", 1, "false_alarms is a whole number from 0 to 1000000, not `3 d`"),
    ("name:", "time_between_false_alarms: 30\nname:", 1, "time_between_false_alarms `30` needs a time unit"),
    ("name:", "checks: {outlt: 1}\nname:", 1, "check outlt: no component or input `outlt`; did you mean `outlet`"),
    ("name:", "checks: {K: 1}\nname:", 1, "check K: no component or input `K`; name its component `outlet`"),
    ("name:", "checks: {zzz: 1}\nname:", 1, "no component or input `zzz`; give `reads` to measure a signal by hand"),
    ("name:", "checks: {level: 1}\nname:", 1, "check level: a sensor has this name; name a component"),
    ("name:", "checks: {Q: {reads: vessel.e}}\nname:", 1, "check Q: an input has this name; remove `reads`"),
    ("name:", "checks: {outlet: {reads: vessel.e}}\nname:", 1, "check outlet: a component has this name"),
    ("name:", "checks: {outlet: {move: 1}}\nname:", 1, "check outlet: only an input is moved; remove `move`"),
    ("name:", "checks: {outlet: {unit: m}}\nname:", 1, "check outlet: `unit` goes with `reads`"),
    ("name:", "checks: {outlet: {noise: 1}}\nname:", 1, "check outlet: `noise` goes with `reads`"),
    ("name:", "checks: {outlet: 5 EUR}\nname:", 1, "check outlet: cost"),
    ("name:", "checks: {outlet: 5 kg}\nname:", 1, "check outlet: cost is a number above 0 without a unit"),
    ("name:", "checks: {outlet: 0}\nname:", 1, "check outlet: cost is a number above 0 without a unit"),
    ("name:", "checks: {outlet: {costs: 1}}\nname:", 1, "check outlet: unknown key `costs`; did you mean `cost`"),
    ("name:", "checks: {8: 1}\nname:", 1, "checks: `8` is not a name"),
    ("name:", "checks: {Q: {move: 5 m}}\nname:", 1, r"check Q: move is in m, but m\^3/s is expected"),
    ("name:", "checks: {Q: {move: 0}}\nname:", 1, "check Q: move is a size above 0, such as `10 percent`, or `no`"),
    ("name:", "checks: {j: {reads: outlet.f}}\nname:", 1, "check j: `noise` is missing; state its standard deviation"),
    ("name:", "checks: {j: {reads: 3, noise: 1}}\nname:", 1, "check j: `3` is always the same"),
    ("name:", "checks: {j: {reads: node.e, noise: 1 Pa}}\nname:", 1, "check j: `node.e` is in m, but its noise in Pa"),
    ("name:", "checks: {j: {reads: node.e, noise: 1, move: 1}}\nname:", 1, "check j: a signal is measured, not moved"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), WRONG)
def test_mistakes(old: str, new: str, line: int, message: str) -> None:
    """Each mistake is one line: file and line, what is wrong, what to do."""
    with pytest.raises(ModelError, match=rf"^model.yaml:{line}: .*{message}") as raised:
        read((old, new))
    assert "\n" not in str(raised.value)


@pytest.mark.parametrize(
    ("base", "old", "new", "message"),
    [
        (STATIC, "x: {}", "x: {suspect: no}", "input x: suspect: with `sample_time: none` there are no faults of"),
        (STATIC, "reads: y", "reads: y, suspect: no", "sensor s: suspect: with `sample_time: none` there are no"),
        (STATIC, "blocks", "instrument_faults: no\nblocks", "instrument_faults: with `sample_time: none`"),
        (STATIC, "blocks", "time_between_false_alarms: 1 h\nblocks", "time_between_false_alarms: with `sample_time"),
        (STATIC, "K: 2", "K: {nominal: 2, limit: 3}", "parameter K: limit: with `sample_time: none` nothing drifts"),
        (STATIC, "blocks", "checks: {y: {reads: 2*y}}\nblocks", "a signal has this name too, and the check reads"),
        (LOGIC, "reads: y", "reads: y, range: any", "sensor s: range: a logic signal has no range"),
        (LOGIC, "blocks", "checks: {x: {move: 1}}\nblocks", "check x: move: a logic input has two values"),
        (LOGIC, "blocks", "checks: {j: {reads: y}}\nblocks", "check j: input x is logic, and a network is all logic"),
    ],
)
def test_mistakes_without_time(base: str, old: str, new: str, message: str) -> None:
    """What has no meaning without time, or in logic, is refused."""
    with pytest.raises(ModelError, match=message):
        read((old, new), base=base)
