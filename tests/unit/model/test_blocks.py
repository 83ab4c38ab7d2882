"""Block networks in the model file: names, laws, stores, logic, static networks, and every mistake in one line."""

from pathlib import Path

import pytest

from faultbond.errors import ModelError
from faultbond.model.builder import ModelBuilder
from faultbond.model.expression import Binary, Call, Name, Number
from faultbond.model.graph import LOGIC_UNIT, BondGraph
from faultbond.model.parser import to_text
from faultbond.model.text import load_model, parse_model
from faultbond.types import ElementType, TimeGrid

EXAMPLES = Path(__file__).parents[3] / "examples" / "thesis"
ADDER = (EXAMPLES / "fig_3_7.yaml").read_text()
TANKS = """\
name: two tanks
sample_time: 1 s
constants: {g: 9.81 m/s^2}
inputs: {u: {unit: m^3/s}}
blocks:
  upper: {law: der(h1) = (u - q1)/A1, parameters: {A1: 2 m^2}}
  pipe: {law: q1 = K1*sqrt(g*h1), parameters: {K1: 0.016 m^2}}
  lower: {law: der(h2) = (q1 - q2)/A2, parameters: {A2: 2 m^2}, start: {h2: 1 m, sd: 5 cm}}
  outlet: {law: 0 = q2 - K2*sqrt(g*h2), parameters: {K2: {nominal: 0.016 m^2, suspect: no}}, signals: [q2]}
  gauge: {law: level = h2, suspect: no}
sensors:
  upper_level: {reads: h1, unit: cm, noise: 1 cm}
  h2: {reads: h2, unit: cm, noise: 1 cm}
slow_error: {q1: 2 % over 100 s, upper_level: 1 cm over 60 s}
"""


def block(law: str, *, inputs: str = "u: {}", more: str = "") -> BondGraph:
    """Give the static network of one block with one law."""
    return parse_model(
        f"sample_time: none\ninputs: {{{inputs}}}\nblocks: {{b: {{law: '{law}'{more}}}}}\nsensors: {{s: {{reads: y}}}}"
    )


def test_a_block_network_is_the_same_record() -> None:
    """Blocks are components without ports; there are no junctions and no bonds; signals have no dot."""
    graph = parse_model(TANKS)
    assert graph.is_block_network
    assert {item.type for item in graph.components} == {ElementType.BLOCK}
    assert [item.name for item in graph.components] == ["upper", "pipe", "lower", "outlet", "gauge"]
    assert (graph.junctions, graph.bonds) == ((), ())
    assert graph.block_signals == ("h1", "q1", "h2", "q2", "level")
    assert graph.component("pipe").parameters == ("K1",)
    assert not load_model(EXAMPLES / "rc.yaml").is_block_network


def test_laws_define_signals_and_stores() -> None:
    """`q1 = ..` defines a signal, `der(h1) = ..` a store, `0 = ..` nothing."""
    graph = parse_model(TANKS)
    laws = {item.name: item.laws[0] for item in graph.components}
    assert (laws["pipe"].signal, laws["pipe"].store) == ("q1", None)
    assert (laws["upper"].signal, laws["upper"].store) == ("h1", "h1")
    assert (laws["outlet"].signal, laws["outlet"].store) == (None, None)
    assert graph.component("outlet").signals == ("q2",)


def test_a_start_is_in_si() -> None:
    """The known start of a block's store is converted; the others are listed as solved."""
    graph = parse_model(TANKS)
    start = graph.component("lower").start
    assert start is not None
    assert (start.mean, start.sd) == (1.0, 0.05)
    assert ("start of upper", "solved from the first samples") in graph.defaults


def test_a_block_may_have_several_laws() -> None:
    """A list of laws is one block, which owns what they define."""
    graph = parse_model(
        "sample_time: none\ninputs: {u: {}}\nblocks: {b: {law: [x = 2*u, y = x + 1]}}\nsensors: {s: {reads: y}}"
    )
    assert graph.block_signals == ("x", "y")
    assert len(graph.components) == 1


def test_slow_errors_of_signals_and_of_sensors() -> None:
    """A name without a dot is a signal or a sensor, whichever there is."""
    first, second = parse_model(TANKS).slow_errors
    assert (first.unit.text, second.unit.text) == ("", "cm")
    assert (first.target, first.is_sensor, first.relative) == ("q1", False, True)
    assert (second.target, second.is_sensor, second.sd) == ("upper_level", True, 0.01)
    assert all(not error.is_sensor for error in load_model(EXAMPLES.parent / "tank" / "model.yaml").slow_errors)


def test_a_static_network_needs_little() -> None:
    """Without time there is no warm-up, the time column is optional, and sensors need no noise."""
    graph = load_model(EXAMPLES / "fig_6_1.yaml")
    assert (graph.grid, graph.sample_time, graph.warm_up) == (TimeGrid.NONE, None, 0.0)
    assert (graph.time.column, graph.time.optional) == ("time", True)
    assert [item.noise for item in graph.sensors] == [0.0]
    assert ("noise of Vi, Vo", "0") in graph.defaults
    assert ("time", "column `time` in s, else the number of the row") in graph.defaults


def test_noise_may_be_stated_in_a_static_network() -> None:
    """A stated noise of 0, and one above it, read back."""
    text = (EXAMPLES / "fig_6_1.yaml").read_text()
    for noise, size in (("0", 0.0), ("0.5", 0.5)):
        graph = parse_model(text.replace("{reads: s}", f"{{reads: s, noise: {noise}}}"))
        assert graph.sensors[0].noise == size
        assert f"noise: {noise}" in graph.text


def test_a_stated_time_column_is_needed() -> None:
    """Only the default time column may be absent."""
    text = (EXAMPLES / "fig_6_1.yaml").read_text()
    assert not parse_model(f"{text}time: {{column: when}}\n").time.optional
    assert parse_model(f"{text}time: none\n").time.column is None


def test_logic() -> None:
    """Gates are expressions of `& | ^ ~`; inputs and sensors are of the unit logic."""
    graph = parse_model(ADDER)
    assert graph.is_logic
    assert {item.unit for item in graph.inputs} == {item.unit for item in graph.sensors} == {LOGIC_UNIT}
    assert graph.component("X1").laws[0].right == Binary("^", Name("A"), Name("B"))
    assert not load_model(EXAMPLES / "fig_6_13.yaml").is_logic


def test_logic_binds_as_in_python() -> None:
    """`~` binds most, then `&`, `^`, `|`; the text has no parentheses that are not needed."""
    graph = parse_model(ADDER.replace("c = y | z", "c = ~y & 1 | z ^ (x | 0) & A"))
    law = graph.component("O1").laws[0].right
    assert law == Binary(
        "|",
        Binary("&", Call("not", (Name("y"),)), Number(1.0)),
        Binary("^", Name("z"), Binary("&", Binary("|", Name("x"), Number(0.0)), Name("A"))),
    )
    assert to_text(law) == "~y & 1 | z ^ (x | 0) & A"


def test_suspects_are_blocks_where_no_parameter_is() -> None:
    """Blocks are suspects unless trusted; with a suspect parameter those without one are structure (thesis 3.7)."""
    assert parse_model(ADDER).suspect_blocks == ("X1", "A1", "A2", "X2", "O1")
    trusted = ADDER.replace("law: c = y | z", "law: c = y | z, suspect: no")
    assert parse_model(trusted).suspect_blocks == ("X1", "A1", "A2", "X2")
    assert load_model(EXAMPLES / "fig_3_12.yaml").suspect_blocks == ()
    assert load_model(EXAMPLES / "rc.yaml").suspect_blocks == ()
    parameters = "K: {nominal: 3, suspect: no}"
    assert block("y = K*u", more=f", parameters: {{{parameters}}}").suspect_blocks == ("b",)


def test_a_trusted_block_trusts_its_parameters() -> None:
    """`suspect: no` of a block holds for what it owns."""
    graph = block("y = K*u", more=", parameters: {K: 3}, suspect: no")
    assert not graph.parameter("K").suspect
    assert not graph.components[0].suspect
    assert parse_model(graph.text).text == graph.text


def test_the_builder_gives_the_model_of_the_file() -> None:
    """A block network in Python is the one of the file."""
    plant = ModelBuilder("two tanks", sample_time="1 s").constant("g", "9.81 m/s^2").input("u", unit="m^3/s")
    plant.block("upper", "der(h1) = (u - q1)/A1", parameters={"A1": "2 m^2"})
    plant.block("pipe", "q1 = K1*sqrt(g*h1)", parameters={"K1": "0.016 m^2"})
    start = {"h2": "1 m", "sd": "5 cm"}
    plant.block("lower", "der(h2) = (q1 - q2)/A2", parameters={"A2": "2 m^2"}, start=start)
    trusted: dict[str, dict[str, str | bool]] = {"K2": {"nominal": "0.016 m^2", "suspect": False}}
    plant.block("outlet", ["0 = q2 - K2*sqrt(g*h2)"], parameters=trusted, signals=["q2"])
    plant.block("gauge", "level = h2", suspect=False)
    plant.sensor("upper_level", "h1", unit="cm", noise="1 cm").sensor("h2", "h2", unit="cm", noise="1 cm")
    plant.slow_error("q1", "2 % over 100 s").slow_error("upper_level", "1 cm over 60 s")
    assert plant.build().text == parse_model(TANKS).text


def test_the_builder_of_a_static_network() -> None:
    """Sensors of a static network need no noise in Python either; a bond does not belong to it."""
    plant = ModelBuilder("gain", sample_time="none").input("u").block("b", "y = 2*u").sensor("y", "y")
    assert plant.build().grid is TimeGrid.NONE
    with pytest.raises(ModelError, match="model gain: `bonds` stands beside `blocks`"):
        plant.bond("b -> b").build()


@pytest.mark.parametrize("path", sorted(EXAMPLES.glob("*.yaml")), ids=lambda path: path.stem)
def test_canonical_text_reads_back(path: Path) -> None:
    """The canonical text of every example gives itself."""
    graph = load_model(path)
    assert parse_model(graph.text).text == graph.text


IN_TANKS = [  # what stands in the tanks' file, what stands there instead, line, message
    ("blocks:", "bonds: [a -> b]\nblocks:", 5, "`bonds` stands beside `blocks`; a model is a block network, or"),
    ("  upper: {law", "  upper: {type: R, law", 6, "block upper: unknown key `type`; known: law, parameters, signals"),
    ("  upper: {law", "  upper: {lwa", 6, "block upper: unknown key `lwa`; did you mean `law`"),
    ("law: level = h2, ", "", 10, "block gauge: `law` is missing; write one, such as `law: y = 2\\*x`"),
    ("law: level = h2", "law: []", 10, "block gauge: `law` is missing"),
    ("level = h2", "level + h2", 10, "law of gauge: `level \\+ h2` is not a law"),
    (
        "level = h2",
        "q1 = h2",
        10,
        "law of gauge: signal `q1` is already that of block pipe on line 7; a signal has one",
    ),
    ("level = h2", "der(q1) = h2", 10, "law of gauge: signal `q1` is already that of block pipe on line 7"),
    ("level = h2", "q2 = h2", 10, "law of gauge: signal `q2` is already that of block outlet on line 9"),
    ("level = h2", "u = h2", 10, "law of gauge: `u` is already an input; a law defines a signal of its own. Write the"),
    ("level = h2", "A1 = h2", 10, "law of gauge: `A1` is already a parameter; a law defines a signal of its own"),
    ("level = h2", "g = h2", 10, "law of gauge: `g` is already a constant"),
    ("level = h2", "min = h2", 10, "law of gauge: `min`: the name is reserved for functions"),
    ("level = h2", "gauge.y = h2", 10, "law of gauge: `gauge.y`: signals of blocks have no dot; write `y`"),
    ("level = h2", "level = lower.h2", 10, "law of gauge: `lower.h2`: signals of blocks have no dot; write `h2`"),
    ("level = h2", "level = lower", 10, "`lower` is a block, not a signal; name one of its signals, such as `h2`"),
    ("level = h2", "level = H2", 10, "law of gauge: unknown name `H2`; did you mean `h2`"),
    ("level = h2", "level = zzz", 10, "law of gauge: unknown name `zzz`; a signal stands left in a law, or under"),
    ("level = h2", "2*der(level) = h2", 10, "`2\\*der\\(level\\) = h2`: a rate stands alone on the left of a law"),
    ("level = h2", "level = der(h2)", 10, "`level = der\\(h2\\)`: a rate stands alone on the left of a law, as in"),
    ("level = h2", "der(2*h2) = u", 10, "`der` takes the name of one signal, as in `der\\(y\\) = x/P`"),
    ("level = h2", "der(a.b) = u", 10, "`der` takes the name of one signal"),
    ("level = h2", "der() = u", 10, "`der` takes the name of one signal"),
    (
        "level = h2",
        "level = h2^2",
        10,
        "`h2 \\^ 2`: `\\^` is logic, but no input and no sensor is; write `\\*\\*` for a",
    ),
    ("level = h2", "'level = ~h2'", 10, "`~h2`: `~` is logic, but no input and no sensor is; give inputs and sensors"),
    ("level = h2", "level = h2 + q1", 10, "`h2` is in m, `q1` in m\\^3/s; mend the law or the unit of a parameter"),
    ("level = h2", "level = h2/0", 10, "divides by zero"),
    (
        "[q2]",
        "q2 q3",
        9,
        "block outlet: signals: `q2 q3` is not a name; write a list of names, such as `signals: \\[T\\]`",
    ),
    ("[q2]", "[q2, A1]", 9, "block outlet: signals: `A1` is already a parameter"),
    ("[q2]", "[q2, h1]", 9, "block outlet: signals: signal `h1` is already that of block upper on line 6"),
    ("[q2]", "{q2: 1}", 9, "block outlet: signals must be a list"),
    ("[q2]", "[]", 8, "law of lower: unknown name `q2`"),
    ("{h2: 1 m, sd", "{q2: 1 m, sd", 8, "start of lower: unknown key `q2`; known: h2, sd"),
    (", sd: 5 cm", "", 8, "start of lower: `sd` is missing; write `start: {h2: .., sd: ..}`"),
    ("h2: 1 m, sd: 5 cm", "h2: 1 Pa, sd: 5 Pa", 8, "start of h2: `h2` is in m, but the start in Pa"),
    ("[q2]", "[q2], start: {q2: 1, sd: 1}", 9, "start of outlet: a block with a start has one law `der\\(..\\) = ..`"),
    ("law: level = h2", "law: der(sd) = u, start: {sd: 1}", 10, "`sd` is the standard deviation here; rename"),
    ("A1: 2 m^2", "h2: 2 m^2", 8, "law of lower: `h2` is already a parameter"),
    ("A1: 2 m^2", "der: 2 m^2", 6, "parameter `der`: the name is reserved for functions"),
    ("A1: 2 m^2", "A1: 2 m^2, A9: 3", 6, "block upper: no law and no sensor names parameter `A9`"),
    (
        "A1: 2 m^2",
        "A1: {nominal: 2, suspect: yes}}, suspect: no, signals: {",
        6,
        "parameter A1 is a suspect, but block",
    ),
    ("suspect: no}\ns", "suspect: maybe}\ns", 10, "block gauge: suspect is `yes` or `no`, not `maybe`"),
    ("reads: h1,", "reads: 2*3,", 12, "sensor upper_level: `2\\*3` is always the same; name a signal such as `y`"),
    ("reads: h1,", "reads: der(h1),", 12, "`der\\(h1\\)`: a rate is no signal"),
    ("reads: h1,", "reads: h3,", 12, "sensor upper_level: reads: unknown name `h3`; a signal stands left in a law"),
    ("reads: h1,", "reads: q1,", 12, "`q1` is in m\\^3/s, but its unit in m"),
    (
        "reads: h2,",
        "reads: h1,",
        13,
        "sensor h2: a signal has this name too, and the sensor reads `h1`; rename one and",
    ),
    (", noise: 1 cm}\n  h2", "}\n  h2", 12, "sensor upper_level: `noise` is missing"),
    ("cm, noise: 1 cm}\n  h2", "logic}\n  h2", 2, "sensor upper_level is logic, and logic networks are static; write"),
    ("q1: 2 %", "h2: 2 %", 14, "a sensor and a signal have this name; rename the sensor and state its `column`"),
    ("q1: 2 %", "h1: 2 %", 14, "slow_error h1: `h1` is a store; add a block with `law: y = h1` and put the error on"),
    ("q1: 2 %", "q3: 2 %", 14, "slow_error q3: no sensor `q3`; write a sensor's name or a signal such as `y`"),
    ("q1: 2 %", "pipe.q1: 2 %", 14, "no sensor `pipe.q1`"),
    ("q1: 2 %", "zz: 2 %", 14, "write a sensor's name or a signal such as `y`"),
    ("sample_time: 1 s", "sample_time: none", 14, "slow_error: with `sample_time: none` each row stands by itself"),
]

IN_ADDER = [
    (
        "sample_time: none",
        "sample_time: 1 s",
        3,
        "input A is logic, and logic networks are static; write `sample_time: n",
    ),
    (
        "law: x = A ^ B",
        "law: x = A + B",
        6,
        "law of X1: `A \\+ B`: `\\+` is for numbers, but input A is logic; write `&`",
    ),
    ("law: x = A ^ B", "law: x = -A", 6, "law of X1: `-A`: `-` is for numbers"),
    ("law: x = A ^ B", "law: x = abs(A)", 6, "law of X1: `abs\\(A\\)`: `abs` is for numbers"),
    ("law: x = A ^ B", "law: x = A & 2", 6, "law of X1: `A & 2`: `2` is a number"),
    ("law: x = A ^ B", "law: x = A ^ K, parameters: {K: 1}", 6, "law of X1: `A \\^ K`: `K` is a number"),
    (
        "law: x = A ^ B",
        "law: der(x) = A",
        6,
        "law of X1: `der\\(x\\)` makes a store, and with `sample_time: none` there is",
    ),
    (
        "A: {unit: logic}",
        "A: {unit: V}",
        4,
        "input A: input B is logic, and a network is all logic or all numbers; state",
    ),
    ("A: {unit: logic}", "A: {}", 4, "input A: input B is logic, and a network is all logic or all numbers"),
    ("A: {unit: logic}", "A: {unit: logic, noise: 1}", 4, "input A: a logic signal has no noise; remove it"),
    ("A: {unit: logic}", "A: {unit: logic, settling: 1 s}", 4, "input A: settling: with `sample_time: none`"),
    (
        "{reads: s, unit: logic}",
        "{reads: s}",
        11,
        "sensor D: input A is logic, and a network is all logic or all numbers",
    ),
    ("{reads: s, unit: logic}", "{reads: s + 1, unit: logic}", 11, "sensor D: reads: `s \\+ 1`: `\\+` is for numbers"),
    ("name: full", "warm_up: 3 s\nname: full", 2, "warm_up: with `sample_time: none` each row stands by itself"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), IN_TANKS)
def test_mistakes_in_the_tanks(old: str, new: str, line: int, message: str) -> None:
    """The message starts with file and line and says what is wrong."""
    assert old in TANKS
    with pytest.raises(ModelError, match=rf"^model.yaml:{line}: .*{message}") as error:
        parse_model(TANKS.replace(old, new, 1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("old", "new", "line", "message"), IN_ADDER)
def test_mistakes_in_the_adder(old: str, new: str, line: int, message: str) -> None:
    """Logic and numbers do not mix, and logic has no time."""
    assert old in ADDER
    with pytest.raises(ModelError, match=rf"^model.yaml:{line}: .*{message}") as error:
        parse_model(ADDER.replace(old, new, 1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("blocks: {}", "^model.yaml:2: no blocks; state them, such as"),
        ("blocks: []", "^model.yaml:2: blocks must be a table"),
        ("blocks: {b c: {law: y = 1}}", "^model.yaml:2: blocks: `b c` is not a name"),
        ("blocks: {b: {law: y = 1}}", "^model.yaml: no sensors, so nothing can be compared"),
        ("blocks:\n" + "".join(f"  b{k}: {{}}\n" for k in range(2001)), "^model.yaml:2: 2001 blocks; at most 2000"),
    ],
)
def test_texts_that_are_no_network(text: str, message: str) -> None:
    """What is not a block network at all is refused too."""
    with pytest.raises(ModelError, match=message):
        parse_model(f"sample_time: none\n{text}")


def test_names_of_bond_signals_are_free_in_blocks() -> None:
    """`e`, `f`, `q` and `p` mean nothing of their own in a block network."""
    graph = block("y = e*u", more=", parameters: {e: 3}")
    assert graph.parameter("e").nominal == 3.0


def test_a_network_without_inputs() -> None:
    """A network may have no inputs at all."""
    graph = parse_model("sample_time: none\nblocks: {b: {law: y = 3}}\nsensors: {s: {reads: y}}")
    assert graph.inputs == ()


def test_units_are_inferred_through_blocks() -> None:
    """A signal has the unit that its law gives, and its rate that per second."""
    text = "sample_time: 1 s\ninputs: {u: {unit: m^3/s}}\nblocks: {b: {law: der(V) = u}}\nsensors: {s: UNIT}"
    assert parse_model(text.replace("UNIT", "{reads: V, unit: l, noise: 1 l}")).sensors[0].noise == 0.001
    with pytest.raises(ModelError, match=r"`V` is in m\^3, but its unit in m"):
        parse_model(text.replace("UNIT", "{reads: V, unit: m, noise: 1 m}"))
