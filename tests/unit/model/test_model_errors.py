"""Every mistake in a model file is one line: file and line, what is wrong, what to do."""

from pathlib import Path

import pytest

from faultbond.errors import ModelError
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"
TANK = (EXAMPLES / "tank" / "model.yaml").read_text()
MOTOR = (EXAMPLES / "dc_motor" / "model.yaml").read_text()
K6 = "K6: {nominal: 1.04e-5 m^3/s, change: 1000 %}"

IN_TANK = [  # what stands in the tank's file, what stands there instead, line, message
    ("law: e = K8", "lwa: e = K8", 10, "component pump: unknown key `lwa`; did you mean `law`"),
    ("sample_time", "sampletime", 3, "model: unknown key `sampletime`; did you mean `sample_time`"),
    ("settling: 12", "setling: 12", 7, "input u_in: unknown key `setling`; did you mean `settling`"),
    ("nominal: 1", "nominl: 1", 16, "parameter K6: unknown key `nominl`; did you mean `nominal`"),
    ("reads: sqrt", "read: sqrt", 20, "sensor flow: unknown key `read`; did you mean `reads`"),
    ("type: Se", "type: SE", 10, "component pump: unknown type `SE`; did you mean `Se`"),
    ("type: Se, ", "", 10, "component pump: `type` is missing; it is one of R, C, I"),
    ("line: 1", "line: 2", 17, "junction line: unknown type `2`; it is 0"),
    ("line: 1", "line: 1, tank: 0", 17, r"`tank` is both a junction and a component \(also model.yaml:14\)"),
    ("K1*f", "K_1*f", 11, "law of pipe: unknown name `K_1`; did you mean `K1`"),
    ("K1*f", "vessel*f", 11, "`vessel` is a part, not a number; name one of its signals, such as `vessel.e`"),
    ("K1*f", "K1*vesel.e", 11, "no component or junction `vesel`; did you mean `vessel`"),
    ("K1*f", "K1*line.e*f", 11, "1-junction line has no signal `e`; it has line.f, line.q"),
    ("K1*f", "K1*tank.e1*f", 11, "component tank has no signal `e1`; it has tank.e, tank.f, tank.q, tank.p"),
    ("f = K6", "f = K6*e", 16, "law of leak: `e` is set by the rest of the plant"),
    ("f = K6", "f = K6*leak.e", 16, "law of leak: `e` is set by the rest of the plant"),
    ("e = K3*q", "e = K3*f", 14, "law of tank names no `q`; the law of a C element relates e, q"),
    (
        "e = K1*f*abs(f)",
        "e = K1",
        11,
        "law of pipe names no `f`; .* relates e, f; one that does not depend .* `type: Se`",
    ),
    (
        "e = K1*f*abs(f)",
        "f = K1",
        11,
        "law of pipe names no `e`; .* relates e, f; one that does not depend .* `type: Sf`",
    ),
    (
        "e = K1*f*abs(f)",
        "f = K1*(vessel.e**2 - tank.e**2)",
        11,
        r"names no `e`; .*; between these `e` is `tank.e - vessel.e` or .*: `tank.*` is `e\*\(tank.e \+ vessel.e\)`",
    ),
    ("e = K1*f*abs(f)", "[e = K1*f, e = K1*f]", 11, "component pipe has 2 laws; an R element needs one law"),
    ("law: e = K8, ", "", 10, "component pump: `law` is missing; write `law: e = V`"),
    (
        "law: e = K3*q, parameters: {K3",
        "parameters: {K5: 3, K3",
        14,
        "`law` is missing; without one it needs exactly one",
    ),
    ("K8: 64650 Pa", "K8: 64650 Pa, K9: 3", 10, "no law and no sensor names parameter `K9`"),
    ("K8: 64650 Pa", "K1: 64650 Pa", 11, "parameter `K1` is already a parameter on line 10; state it once"),
    ("K8: 64650 Pa", "u_in: 64650 Pa", 10, "parameter `u_in` is already an input on line 7; rename one"),
    ("K8: 64650 Pa", "K_meter: 64650 Pa", 10, "parameter `K_meter` is already a constant on line 5; rename one"),
    ("K8: 64650 Pa", "q: 64650 Pa", 10, "parameter `q`: the name is reserved"),
    ("K8: 64650 Pa", "if: 64650 Pa", 10, "parameter `if`: the name is reserved"),
    ("K8: 64650 Pa", "8K: 64650 Pa", 10, "`8K` is not a name; a name is a letter, then"),
    ("K8: 64650 Pa", "K8: 5 %", 10, "parameter K8: `5 %` is relative"),
    ("K8: 64650 Pa", "K8: much", 10, "parameter K8: `much` is not a quantity"),
    ("K8: 64650 Pa", "K8: [1 Pa]", 10, "parameter K8 must be a table"),
    ("K8: 64650 Pa", "K8: {change: 5 %}", 10, "parameter K8: `nominal` is missing"),
    (K6, "K6: 0 m^3/s", 16, "the nominal is 0, so `accuracy` must be a size of its own; write `accuracy: 2 m\\^3/s`"),
    (K6, "K6: {nominal: 0, accuracy: 1 l/s}", 16, "the nominal is 0, so `change` must be a size of its own"),
    (K6, "K6: {nominal: 1 l/s, change: 0 %}", 16, "`change` must be a finite size above 0"),
    (K6, "K6: {nominal: 1 l/s, accuracy: 1 Pa}", 16, "accuracy is in Pa, but m\\^3/s is expected"),
    (K6, "K6: {nominal: 1, accuracy: 1 Pa}", 16, "accuracy is in Pa, but the thing itself has no unit"),
    (K6, "K6: {nominal: 1 l/s, range: 5}", 16, "range is `\\[lowest, highest\\]` or `any`"),
    (K6, "K6: {nominal: 1 l/s, range: [2, 3]}", 16, "the nominal must lie between the two ends"),
    (K6, "K6: {nominal: 1 l/s, range: [0 Pa, 3]}", 16, "range is in Pa, but m\\^3/s is expected"),
    (K6, "K6: {nominal: 1 l/s, suspect: maybe}", 16, "suspect is `yes` or `no`, not `maybe`"),
    (
        "f = K4*u_out",
        "f = u_out*K4/(K6 - K6)",
        15,
        "divides by zero at the nominal K4 = .*; change the law or the value",
    ),
    ("e = K8", "e = K8*log(K8 - K8)", 10, "`log\\(K8 - K8\\)` is not a finite number at the nominal K8 = 64650"),
    ("e = K8", "e = K8*K8**16**2", 10, "an exponent above 16"),
    ("pump -> line", "line -> pump", 10, "Se element pump has 2 bonds and needs one"),
    (
        "line -> orifice",
        "orifice -> line",
        18,
        "bond `orifice -> line`: R element orifice receives power; write `line -> orifice`",
    ),
    (
        "line -> orifice",
        "line -> orifice -> vessel",
        18,
        "it stands between line and vessel: write `line -> between -> vessel, between -> orifice`, with a 1-junction",
    ),
    ("vessel -> leak", "vesel -> leak", 18, "no component or junction `vesel`; did you mean `vessel`"),
    ("vessel -> leak", "vessel", 18, "bond `vessel`: one part only; write `a -> b`"),
    ("vessel -> leak", "vessel - leak", 18, "`vessel - leak` is not a name; write `a -> b -> c`"),
    ("vessel -> leak", "vessel -> vessel", 18, "joins a part to itself"),
    ("vessel -> leak", "vessel -> leak, vessel -> leak", 18, "bond `vessel -> leak` stands twice, first on line 18"),
    ("vessel -> leak", "pump -> leak", 18, "bond `pump -> leak` joins two sources"),
    ("vessel -> leak", "tank -> pipe", 18, "C element tank receives power; put a junction between the two"),
    (", vessel -> leak", "", 16, "Sf element leak has no bond and needs one; connect it under `bonds`"),
    ("vessel: 0", "vessel: 0, spare: 1", 17, "junction spare has no bond"),
    ("reads: vessel.e", "reads: 2*K_meter", 21, "sensor pressure: `2\\*K_meter` is always the same"),
    (
        ", noise: 180 Pa",
        "",
        21,
        "sensor pressure: `noise` is missing; state its standard deviation, such as `noise: 180 Pa`",
    ),
    ("K3: 1.30e5", "K3: 1,30e5", 14, r"`30e5 Pa/m\^3` is not a name; .*A decimal comma\? Write a point"),
    ("noise: 180 Pa", "noise: 2 %", 21, "noise is relative; say of what, such as `2 % of 8.9 kPa`"),
    ("noise: 180 Pa", "noise: 0 Pa", 21, "noise must be above 0"),
    ("noise: 180 Pa", "noise: 1e300 Pa", 21, r"noise is 1e\+300 in SI, as nothing real is"),
    ("noise: 180 Pa", "noise: 1e-300 Pa", 21, "noise is 1e-300 in SI, as nothing real is"),
    ("settling: 12 s", "settling: 1e300 s", 7, "settling is longer than any plant runs"),
    ("noise: 180 Pa", "noise: 180 m", 21, "noise is in m, but Pa is expected"),
    ("noise: 180 Pa", "noise: -180 Pa", 21, "`-180 Pa` is negative"),
    ("unit: Pa, noise: 180 Pa", "noise: 180 m", 21, "sensor pressure: `vessel.e` is in Pa, but its noise in m"),
    ("  pressure:", "  u_in:", 21, "sensor u_in: an input has this name too"),
    (
        "noise: 180 Pa",
        "noise: 180 Pa, column: flow",
        21,
        "sensor pressure: its column 'flow' is that of the sensor flow too; state the `column` of each",
    ),
    ("line.f: 2 %", "lin.f: 2 %", 22, "no component or junction `lin`; did you mean `line`"),
    ("line.f: 2 %", "line.e: 2 %", 22, "1-junction line has no signal `e`"),
    ("line.f: 2 %", "flo: 2 %", 22, "slow_error flo: no sensor `flo`; did you mean `flow`"),
    ("line.f: 2 %", "line.f: 2 cm", 22, "`line.f` is in m\\^3/s, but its size in m"),
    ("line.f: 2 %", "flow: 2 cm", 22, "slow_error flow: size is in m, but m\\^3/s is expected"),
    ("line.f: 2 % over 600 s", "line.f: {size: 2 % over 600 s, after: u_in}", 22, "`after` and `each` belong together"),
    ("line.f: 2 % over 600 s", "line.f: {after: u_in, each: 3}", 22, "`size` is missing"),
    (
        "line.f: 2 % over 600 s",
        "line.f: {size: 2 % over 600 s, after: u_in, each: 3}",
        *(22, "`each` needs an absolute size"),
    ),
    (
        "line.f: 2 % over 600 s",
        "flow: {size: 2 l/s over 600 s, after: u_inn, each: 3}",
        *(22, "after: no input `u_inn`; did you mean `u_in`"),
    ),
    (
        "line.f: 2 % over 600 s",
        "flow: {size: 2 l/s over 600 s, after: u_in, each: 3 l/s}",
        *(22, "each is in m\\^3/s, but m\\^3/percent/s is expected for input u_in"),
    ),
    ("e = K8,", "e = min(K8, K8),", 10, "unknown key `K8\\)`; put quotes round a text with a comma"),
    ("accuracy: 3 %", "accuracy: 3 Pa", 4, "accuracy of the model is relative, such as `3 %`"),
    ("sample_time: 1 s", "sample_time: 1", 3, "sample_time `1` needs a time unit, such as `1 s`"),
    ("sample_time: 1 s", "sample_time: 0 s", 3, "sample_time must be above 0"),
    ("sample_time: 1 s", "sample_time: none", 3, "sample_time `none` is for block networks; a bond graph needs a time"),
    ("sample_time: 1 s", "sample_time: 1 s\nmax_faults: 0", 4, "max_faults is a whole number from 1 to 10, not `0`"),
    ("sample_time: 1 s", "sample_time: 1 s\nmax_faults: two", 4, "max_faults is a whole number"),
    ("sample_time: 1 s", "sample_time: 1 s\nblocks: {}", 10, "`components` stands beside `blocks`; a model is a"),
    ("sample_time: 1 s", "sample_time: 1 s\ntime: t_s", 4, "time is `{column: .., unit: ..}` or `none`"),
    ("sample_time: 1 s", "sample_time: 1 s\ntime: {unit: m}", 4, "time: unit is m, not a time"),
    ("sample_time: 1 s", "sample_time: variable\ntime: none", 4, "`time: none` needs a fixed sample_time"),
    ("sample_time: 1 s", "sample_time: 1 s\nwarm_up: long", 4, "warm_up `long` is not a quantity"),
    ("name: water tank", "name: ", 2, "name is empty; state it or leave the key out"),
    ("unit: percent", "unit: logic", 7, "input u_in: logic signals belong to block networks"),
    ("unit: percent", "unit: percents2", 7, "input u_in: `percents2` is not a unit"),
    ("unit: percent", "noise: 3 %", 7, "input u_in: noise is relative; say of what"),
    ("accuracy: 3 %", "accuracy: 3 %\naccuracy: 4 %", 5, "`accuracy` stands twice, first on line 4"),
    ("accuracy: 3 %", "accuracy: &a 3 %", 4, "anchor `&a`; remove it"),
    ("accuracy: 3 %", "accuracy: *a", 4, "alias `\\*a`; write the value out"),
    ("accuracy: 3 %", "accuracy: !!float 3", 4, "tag `tag:yaml.org,2002:float`; remove it"),
    ("accuracy: 3 %", "accuracy: !!python/object:os.system x", 4, "tag `tag:yaml.org,2002:python/object:os.system`"),
    ("accuracy: 3 %", "accuracy: [3 %", 5, "not YAML: "),
    ("accuracy: 3 %", "\taccuracy: 3 %", 4, "not YAML: "),
    ("accuracy: 3 %", "[a]: 3 %", 4, "a key must be a plain word"),
    ("accuracy: 3 %", "<<: {a: b}", 4, "model: unknown key `<<`"),
    ("accuracy: 3 %", "accuracy: 3 \x07", 4, "character U\\+0007 cannot stand in a model"),
]

IN_MOTOR = [
    ("type: GY,", "type: GY, law: e1 = K*f2,", 10, "component K has 1 law; a GY element needs two laws"),
    ("type: GY,", "type: GY, law: [e1 = K*f2, e1 = K*f2],", 10, "law of K names no `f1`; the law of a GY element"),
    ("K -> shaft ->", "K, shaft -> K, shaft ->", 10, "GY element K has 2 bonds in and 0 out and needs one of each"),
    ("R: {type: R,", "R: {type: R, start: {q: 1, sd: 1},", 8, "start of R: only C and I elements have a start"),
    ("L: {type: I,", "L: {type: I, start: {q: 1, sd: 1},", 9, "start of L: unknown key `q`; known: p, sd"),
    ("L: {type: I,", "L: {type: I, start: 0,", 9, "start of L is a table; write `start: {p: .., sd: ..}`"),
    ("L: {type: I,", "L: {type: I, start: {p: 1},", 9, "start of L: `sd` is missing; write `start: {p: .., sd: ..}`"),
    ("L: {type: I,", "L: {type: I, start: {p: 1 V, sd: 1},", 9, "start of L: `L.p` is in V\\*s, but the start in V"),
    ("L: {type: I,", "L: {type: I, start: {p: 1 V*s, sd: 1 V},", 9, "start of L: sd is in V, but V\\*s is expected"),
]


@pytest.mark.parametrize(("old", "new", "line", "message"), IN_TANK)
def test_mistakes_in_the_tank(old: str, new: str, line: int, message: str) -> None:
    """The message starts with file and line and says what is wrong."""
    assert old in TANK
    with pytest.raises(ModelError, match=rf"^model.yaml:{line}: .*{message}") as error:
        parse_model(TANK.replace(old, new, 1))
    assert "\n" not in str(error.value)


@pytest.mark.parametrize(("old", "new", "line", "message"), IN_MOTOR)
def test_mistakes_in_the_motor(old: str, new: str, line: int, message: str) -> None:
    """Two-ports and stores are checked too."""
    assert old in MOTOR
    with pytest.raises(ModelError, match=rf"^model.yaml:{line}: .*{message}"):
        parse_model(MOTOR.replace(old, new, 1))


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "^model.yaml:1: the model is empty; start with `name:`"),
        ("# nothing", "^model.yaml:1: the model is empty"),
        ("text", "^model.yaml:1: a model is a table"),
        ("- a", "^model.yaml:1: a model is a table"),
        ("%YAML 1.1\n---\na: b", "^model.yaml:1: a `%` directive"),
        ("a: b\n---\nc: d", "^model.yaml: more than one document"),
        ("name: x", "^model.yaml: `sample_time` is missing"),
        ("sample_time: 1 s", "^model.yaml: no components"),
        ("sample_time: 1 s\ncomponents: []", "^model.yaml:2: components must be a table"),
        ("sample_time: 1 s\ncomponents: {}", "^model.yaml:2: no components"),
        ("sample_time: 1 s\ncomponents: {a: {type: R}}", "^model.yaml: no bonds"),
        ("sample_time: 1 s\ncomponents: {a: {type: R}}\nbonds: {}", "^model.yaml:3: bonds must be a list"),
        (
            "sample_time: 1 s\ncomponents: {a: {type: R}}\nbonds: [[a]]",
            "^model.yaml:3: a bond must be a text, not a list",
        ),
        ("sample_time: 1 s\nname: " + "x" * 101, "100 characters at most"),
        ("name: " + "x" * 2**20, "more than 1048576 bytes"),
        ("a: " + "[" * 20, "more than 10 levels of nesting"),
        ("a: [" + "b, " * 6000 + "]", "more than 5000 entries"),
    ],
)
def test_texts_that_are_no_model(text: str, message: str) -> None:
    """What is not a model at all is refused too."""
    with pytest.raises(ModelError, match=message):
        parse_model(text)


def test_no_sensors() -> None:
    """Without sensors there is nothing to compare."""
    text = TANK[: TANK.index("sensors:")]
    with pytest.raises(ModelError, match=r"^model.yaml: no sensors, so nothing can be compared"):
        parse_model(text)


def test_too_many_parts() -> None:
    """Components and junctions together are 2000 at most."""
    rows = "\n".join(f"  R{i}: {{type: R}}" for i in range(2001))
    with pytest.raises(ModelError, match=r"^model.yaml:2: 2001 components and 0 junctions; at most 2000 together"):
        parse_model(f"sample_time: 1 s\ncomponents:\n{rows}\nbonds: []\n")


def test_files_that_cannot_be_read(tmp_path: Path) -> None:
    """A missing file, a folder and a file in another encoding are refused by name."""
    with pytest.raises(ModelError, match=r"none.yaml: cannot be read: No such file"):
        load_model(tmp_path / "none.yaml")
    with pytest.raises(ModelError, match=r"cannot be read: Is a directory"):
        load_model(tmp_path)
    with pytest.raises(ModelError, match=r"cannot be read"):
        load_model("a\0b")
    path = tmp_path / "latin.yaml"
    path.write_bytes("name: x\n# Behälter".encode("latin-1"))
    with pytest.raises(ModelError, match=r"latin.yaml:2: not UTF-8 text; save the file as UTF-8"):
        load_model(path)
    path.write_bytes(b" " * (2**20 + 1))
    with pytest.raises(ModelError, match=r"latin.yaml: more than 1048576 bytes"):
        load_model(path)


def test_message_has_the_path_as_given(tmp_path: Path) -> None:
    """The message starts with the path that the user gave, so that an editor can jump there."""
    path = tmp_path / "plant.yaml"
    path.write_text(TANK.replace("K1*f", "K9*f"))
    with pytest.raises(ModelError) as error:
        load_model(path)
    assert str(error.value).startswith(f"{path}:11: law of pipe: unknown name `K9`")


def test_byte_order_mark_is_skipped() -> None:
    """A file with a byte order mark is read."""
    assert parse_model("\ufeff" + TANK).name == "water tank"


def test_a_recording_in_place_of_a_model_is_told(tmp_path: Path) -> None:
    """Whoever names both the wrong way round is told which comes first."""
    recording = tmp_path / "r.csv"
    recording.write_text("time,level\n0,1\n")
    with pytest.raises(ModelError, match=r"r\.csv:1: this seems to be a recording; name the model before it"):
        load_model(recording)
