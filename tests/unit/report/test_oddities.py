"""What `check` asks about: things that can be stated and are hardly meant."""

import pytest

from faultbond.model.text import parse_model
from faultbond.report.oddities import oddities

ROOM = """
name: room
sample_time: 5 s
inputs: {heat: {unit: W}, t_out: {unit: degC}}
components:
  burner: {type: Sf, law: f = eta*heat, parameters: {eta: {nominal: 1, accuracy: 5 %}}}
  air: {type: C, law: q = Cm*e, parameters: {Cm: 1 MJ/K}}
  walls: {type: R, law: f = UW*e, parameters: {UW: 150 W/K}}
  outside: {type: Se, law: e = t_out}
junctions: {inside: 0, wall: 1}
bonds: [burner -> inside -> air, inside -> wall, wall -> walls, wall -> outside]
sensors: {T: {reads: inside.e, unit: degC, noise: 0.1 K}}
"""


@pytest.mark.parametrize(
    ("right", "wrong", "told"),
    [
        ("accuracy: 5 %", "accuracy: 5", "eta may be off by 500 % while healthy"),
        ("wall -> outside", "outside -> wall", "write `outside -> wall` as `wall -> outside`"),
    ],
)
def test_what_is_hardly_meant_is_asked(right: str, wrong: str, told: str) -> None:
    """A right model has nothing odd; each mistake is told by itself, with what to write."""
    assert list(oddities(parse_model(ROOM))) == []
    (one,) = oddities(parse_model(ROOM.replace(right, wrong)))
    assert told in one


def test_temperatures_may_both_flow_out_of_a_junction() -> None:
    """Then they add up too; of other domains, as of sources in a row, nothing is said."""
    (told,) = oddities(parse_model(ROOM.replace("inside -> wall, wall -> walls", "wall -> inside, wall -> walls")))
    assert "wall adds the temperatures of inside and outside" in told
    assert "write `wall -> outside` as `outside -> wall`" in told
    row = """
name: cells
sample_time: 1 s
inputs: {a: {unit: V}, b: {unit: V}}
components: {one: {type: Se, law: e = a}, two: {type: Se, law: e = b}, R: {type: R, parameters: {R: 3 ohm}}}
junctions: {loop: 1}
bonds: [one -> loop -> R, two -> loop]
sensors: {i: {reads: loop.f, unit: A, noise: 1 mA}}
"""
    assert list(oddities(parse_model(row))) == []


SHED = ROOM.replace(
    "  outside:", "  vent: {type: R, law: f = K*(open/full)**2*e, parameters: {K: 300 W/K}}\n  outside:"
).replace("inputs: {", "constants: {full: 100 percent}\ninputs: {open: {unit: percent}, ")


@pytest.mark.parametrize(
    ("bonds", "told"),
    [
        ("wall -> walls, wall -> vent", True),
        ("wall -> beside, beside -> walls, beside -> vent", False),
    ],
)
def test_what_can_be_shut_stands_beside_others(bonds: str, told: bool) -> None:
    """A vent in a row with a wall stops the heat through that as well; both ways side by side are joined otherwise."""
    text = SHED.replace("wall -> walls", bonds)
    if not told:
        text = text.replace("wall: 1}", "wall: 1, beside: 0}")
    found = list(oddities(parse_model(text)))
    assert len(found) == told
    for one in found:
        assert "walls and vent are in a row at wall: where vent lets nothing through, nor does walls" in one
        assert "`wall -> beside -> walls, beside -> vent` with `beside: 0` among the junctions" in one
    open_always = text.replace("(open/full)**2", "(2 + open/full)")
    assert list(oddities(parse_model(open_always))) == []
