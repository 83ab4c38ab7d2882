"""Units of bonds are inferred; a contradiction names the law that is wrong."""

import pytest

from faultbond.errors import ModelError
from faultbond.model.text import parse_model

PLANT = """sample_time: 1 s
inputs: {{V: {{unit: V}}, pos: {{unit: percent}}}}
constants: {{V0: 1 V, A0: 2 A}}
components:
  source: {{type: Se, law: e = V}}
  R: {{type: R, law: {law}, parameters: {{R: {value}}}}}
  L: {{type: I, parameters: {{L: 2 H}}}}
junctions: {{loop: 1}}
bonds: [source -> loop -> R, loop -> L]
sensors: {{i: {{reads: loop.f, unit: A, noise: 1 mA}}}}
"""


@pytest.mark.parametrize(
    ("law", "value"),
    [
        ("e = R*f", "3 ohm"),
        ("e = R*f", "3"),
        ("e = R*f + 3", "3 ohm"),
        ("e = R*f*(100 - pos)", "3 ohm/percent"),
        ("e = R*f*exp(f/A0)", "3 ohm"),
        ("e = R*sqrt(f)", "3 V/A^0.5"),
        ("e = R*f**3", "3 V/A^3"),
        ("e = R*f**(1/3)", "3 V/A^(1/3)"),
        ("e = max(R*f, 0)", "3 ohm"),
        ("e = R*f + V0*sign(f)", "3 ohm"),
        ("e = where(f > 0, R*f, -R*f)", "3 ohm"),
        ("e = V0*(f/A0)**R", "2"),
        ("e = V0*tanh(f/R)", "2 A"),
        ("f = A0*(exp(e/R) - 1)", "25 mV"),
        ("e = R*f*sqrt(2)*cos(0)", "3 ohm"),
        ("e = V0*f**(R/A0)", "3"),
        ("e = R*f + 0*source.e", "3"),
    ],
)
def test_consistent_laws_load(law: str, value: str) -> None:
    """A law whose two sides agree, or whose units cannot be followed, is read."""
    assert parse_model(PLANT.format(law=f"'{law}'", value=value)).parameter("R").owner == "R"


@pytest.mark.parametrize(
    ("law", "value", "message"),
    [
        ("e = R*f", "3 F", r"^model.yaml:6: law of R: the two sides disagree: `R.e` is in V, `R\*R.f` in "),
        ("e = 3*f + 0*R", "3 V", r"^model.yaml:6: law of R: .*disagree"),
        ("e = R*f + A0", "3 ohm", r"two sides of `\+` in `R\*R.f \+ A0` disagree: `R\*R.f` is in V, `A0` in A"),
        ("e = R*exp(f)", "3 V", r"argument of exp\(\), `R.f`, must be dimensionless but is in A; divide it by"),
        ("e = R*loop.q + f*R", "3", r"`R\*loop.q` is in the unit of `R.f\*R` times s"),
        ("e = max(R, f)*f", "3 ohm", r"arguments of max\(\) in `max\(R, R.f\)` disagree"),
        ("e = where(f > e, R*f, 0)", "3 ohm", r"two sides of `>` in `R.f > R.e` disagree"),
        ("e = where(f > 0, R*f, f)", "3 ohm", r"two results of where\(\)"),
        ("e = abs(R)*f", "3 A", r"`abs\(R\)\*R.f` in A\^2"),
        ("e = min(R, 5)*f", "3 V", r"law of R"),
        ("e = R*f", "3 ohm/percent", r"`percent` goes from 0 to 100 .*: state `constants: {full: 100 percent}` and"),
        ("e = R*f*(100 - pos)", "3 ohm", r"kg\*m\^2\*percent/A/s\^3"),
    ],
)
def test_contradiction_names_the_law(law: str, value: str, message: str) -> None:
    """The message names file, line, law and the two dimensions."""
    with pytest.raises(ModelError, match=message):
        parse_model(PLANT.format(law=f"'{law}'", value=value))


def test_wrong_sensor_unit_is_the_sensors_fault() -> None:
    """A sensor in another unit than what it reads is named, not a law."""
    text = PLANT.format(law="e = R*f", value="3 ohm").replace("unit: A, noise: 1 mA", "unit: V, noise: 1 mV")
    with pytest.raises(ModelError, match=r"^model.yaml:10: sensor i: `loop.f` is in A, but its unit in V"):
        parse_model(text)


def test_stores_integrate() -> None:
    """Start values of q and p have the dimension of the integral."""
    good = PLANT.format(law="e = R*f", value="3 ohm").replace("{L: 2 H}}", "{L: 2 H}, start: {p: 1 V*s, sd: 10 %}}")
    start = parse_model(good).component("L").start
    assert start is not None
    assert (start.mean, start.sd) == (1.0, 0.1)
    with pytest.raises(ModelError, match=r"start of L: `L.p` is in V\*s, but the start in V"):
        parse_model(good.replace("p: 1 V*s", "p: 1 V"))


def test_power_need_not_be_power() -> None:
    """A level as effort is fine: e*f is no power then."""
    text = """sample_time: 1 s
inputs: {Q: {unit: cm^3/s}}
components: {pump: {type: Sf, law: f = Q}, tank: {type: C, law: e = q/A, parameters: {A: 10 cm^2}}}
bonds: pump -> tank
sensors: {level: {reads: tank.e, unit: cm, noise: 1 mm}}
"""
    assert parse_model(text).sensors[0].noise == pytest.approx(0.001)


def test_huge_products_are_left_undetermined() -> None:
    """Laws with hundreds of unknown units load in seconds, not hours."""
    names = [f"P{i}" for i in range(900)]
    rows = []
    for i in range(300):
        factors = "*".join(names[(i * 7 + k * 31) % 900] for k in range(40))
        owned = ", ".join(f"{name}: 3" for name in names[3 * i : 3 * i + 3])
        rows.append(
            f"  R{i}: {{type: R, law: e = f*{factors}*{'*'.join(names[3 * i : 3 * i + 3])}, parameters: {{{owned}}}}}"
        )
    bonds = ", ".join(f"j -> R{i}" for i in range(300))
    text = "sample_time: 1 s\ncomponents:\n" + "\n".join(rows) + f"\njunctions: {{j: 0}}\nbonds: [{bonds}]\n"
    assert len(parse_model(text + "sensors: {e: {reads: j.e, noise: 1}}").parameters) == 900
