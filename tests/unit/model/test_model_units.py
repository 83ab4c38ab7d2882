"""Units and quantities: SI values, dimensions, and what is refused."""

import subprocess
import sys

import pytest

from faultbond.errors import ModelError
from faultbond.model import units
from faultbond.model.quantities import duration, quantity, spread, spread_over
from faultbond.model.text import parse_model
from faultbond.model.units import DIMENSIONLESS, measure, unit


@pytest.mark.parametrize(
    ("text", "value", "dimension"),
    [
        ("64650 Pa", 64650.0, "Pa"),
        ("1017.9 cm^2", 0.10179, "m^2"),
        ("20 mA", 0.02, "A"),
        ("0.005 cm/(cm^3/s)", 50.0, "s/m^2"),
        ("255 Pa^0.5*s/m^3/percent^2", 255.0, "kg^0.5/m^3.5/percent^2"),
        ("3 percent", 3.0, "percent"),
        ("20 degC", 293.15, "K"),
        ("3 W/degC", 3.0, "kg*m^2/K/s^3"),
        ("2 V*s/rad", 2.0, "V*s"),
        ("1 uF", 1e-6, "F"),
        ("6 l/min", 1e-4, "m^3/s"),
        ("1e3 1/s", 1000.0, "1/s"),
        ("-2 m**-2", -2.0, "1/m^2"),
        ("180 deg", 3.141592653589793, "1"),
        ("5 µm", 5e-6, "m"),
    ],
)
def test_quantities_are_si_inside(text: str, value: float, dimension: str) -> None:
    """A quantity gives its SI value; percent and rad stay as they are."""
    found = quantity(text)
    assert found.value == pytest.approx(value, rel=1e-15)
    assert str(found.dimension) == dimension


def test_percent_is_never_a_fraction() -> None:
    """100 percent is 100 of a unit that nothing else has."""
    assert unit("percent").to_si(100.0) == 100.0
    assert measure("percent").dimension != DIMENSIONLESS


def test_temperature_noise_is_a_difference() -> None:
    """A spread in degC has no offset."""
    assert spread("0.5 degC").difference() == 0.5
    assert unit("degC").difference_from_si(0.5) == 0.5


ROOM = """name: room
sample_time: 60 s
inputs: {T_o: {unit: degC}}
components:
  outside: {type: Se, law: e = T_o}
  wall: {type: R, law: f = UA*e, parameters: {UA: 100 W/K}}
  room: {type: C, law: e = q/C, parameters: {C: 5e6 J/K}}
junctions: {line: 1}
bonds: [outside -> line -> wall, line -> room]
sensors: {T: {reads: room.e, unit: degC, noise: 0.1 K}}
"""


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("unit: degC, noise", "unit: C, noise"),
        ("T_o: {unit: degC}", "T_o: {unit: C}"),
        ("law: e = T_o}", "law: e = T_o + T_1, parameters: {T_1: 5 C}}"),
    ],
)
def test_a_temperature_in_coulombs_is_told_what_to_write(old: str, new: str) -> None:
    """Who writes `C` of a temperature hears of `degC`; who mixes up other units does not."""
    with pytest.raises(ModelError, match="`C` is the coulomb; write `degC` for degrees Celsius"):
        parse_model(ROOM.replace(old, new), file="room.yaml")
    with pytest.raises(ModelError, match="noise is in m, but K is expected; use a unit such as `degC`"):
        parse_model(ROOM.replace("0.1 K", "0.1 m"), file="room.yaml")


def test_percent_sign_is_relative() -> None:
    """`3 %` refers to a value, `2 % of 8.9 kPa` has its own."""
    assert spread("3 %").difference(-200.0) == 6.0
    assert spread("2 % of 8.9 kPa").difference() == 178.0
    assert spread("3 %").is_relative
    assert not spread("2 % of 8.9 kPa").is_relative


def test_slow_error_has_a_memory() -> None:
    """A slow error gives a spread and seconds."""
    sd, memory = spread_over("0.2 cm over 40 s")
    assert (sd.difference(), memory) == (0.002, 40.0)


def test_bare_number_takes_the_unit_at_hand() -> None:
    """A number without unit is in the unit of the thing it belongs to."""
    assert quantity("2", default=measure("cm")).value == 0.02
    assert quantity("2").dimension is None


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("3 pA*", "is not a unit: a unit is expected, not `the end`"),
        ("3 kpascal2", "unknown unit `kpascal2`; did you mean `kpascal\\^2`"),
        ("3 KPa", "did you mean `kPa`"),
        ("3 lpm", "unknown unit `lpm`; did you mean `l/min`"),
        ("3 Nm", "unknown unit `Nm`; did you mean `N\\*m`"),
        ("3 Nm3/h", "unknown unit `Nm3`; did you mean `m\\^3`"),
        ("3 kg m", "put `\\*` or `/` between units"),
        ("3 m^99", "a power above 16"),
        ("3 (m^16)^16", "a power above 16"),
        ("3 m^m", "a power must be a short number"),
        ("3 (m", "a `\\)` is missing"),
        ("3 " + "(" * 40, "too many parentheses"),
        ("3 " + "m*" * 60, "a unit of 119 characters|a unit of 120 characters"),
        ("3 Ym^16*Ym^16", "a power above 16|too large or too small"),
        ("3 m;s", "`;` cannot stand in a unit"),
        ("3 m/%", "write `percent` for a unit of 0..100"),
        ("3 dB", "unknown unit `dB`"),
        ("3 %", "is relative"),
        ("1e999 m", "is too large"),
        ("1e308 km", "is too large"),
        ("nan m", "is not a quantity"),
        ("inf", "is not a quantity"),
        ("0x10 m", "is not a quantity"),
        ("1,000 kg", "`1,000 kg` is not a quantity: a comma in its number"),
        ("1,234.5 m", "`1,234.5 m` is not a quantity: a comma in its number"),
        ("0,6 ohm", r"`0,6 ohm` is not a quantity: a decimal comma\? Write `0.6 ohm`"),
        ("9**9**9 m", "cannot stand|is not a|unit is expected"),
        ("x" * 10**6, "a quantity of 1000000 characters"),
    ],
)
def test_hostile_quantities_are_refused(text: str, message: str) -> None:
    """What is not a number and a unit is one clear ModelError."""
    with pytest.raises(ModelError, match=message) as error:
        quantity(text, "m:1: ")
    assert str(error.value).startswith("m:1: ")


@pytest.mark.parametrize(
    ("text", "message"),
    [("1", "needs a time unit, such as `1 s`"), ("1 m", "is in m, not a time"), ("-1 s", "is negative")],
)
def test_time_needs_a_unit_of_time(text: str, message: str) -> None:
    """A duration without unit could be anything."""
    with pytest.raises(ModelError, match=message):
        duration(text)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("2 %", "write its standard deviation and its memory"),
        ("2 % over 0 s", "has no memory"),
        ("2 % for 3 Pa over 4 s", "is not understood"),
        ("-2 % over 4 s", "is negative"),
    ],
)
def test_slow_errors_of_another_form_are_refused(text: str, message: str) -> None:
    """A slow error has one form."""
    with pytest.raises(ModelError, match=message):
        spread_over(text)


def test_pint_is_not_imported_with_the_package() -> None:
    """Importing the model package does not import pint; the first unit that no table has does."""
    code = (
        "import sys, faultbond.model.text; from faultbond.model.units import unit; assert 'pint' not in sys.modules; "
        "unit('kPa*s/m^3'); assert 'pint' not in sys.modules; "
        "unit('furlong'); assert 'pint' in sys.modules"
    )
    subprocess.run([sys.executable, "-W", "error", "-c", code], check=True)


@pytest.mark.parametrize("word", [*units._WORDS, *units._BASES])
def test_the_table_says_what_pint_says(word: str) -> None:
    """A word of the table is to the last digit what pint makes of it; percent alone is ours."""
    assert units._word(word) == units._asked(word) or word == "percent"
