"""Different suspects with exactly the same outputs: golden value G23, and pairs that a sensor cannot separate."""

from fractions import Fraction
from pathlib import Path

import pytest

from faultbond.analysis.twins import compare, twins
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"
NOMINAL = {"R": Fraction(3), "L": Fraction(5, 2), "K": Fraction(2), "J": Fraction(3, 2), "C": Fraction(2, 5)}

TANK_WITH_TWO_PIPES = """
name: two pipes
sample_time: 1 s
inputs: {u: {unit: m^3/s}}
components:
  inflow: {type: Sf, law: f = u}
  tank: {type: C, law: e = q/A, parameters: {A: 2}}
  one: {type: R, law: e = R1*f, parameters: {R1: 3}}
  two: {type: R, law: e = R2*f, parameters: {R2: 5}}
junctions: {node: 0, outlet: 1}
bonds: [inflow -> node -> tank, node -> outlet -> one, outlet -> two]
sensors: {level: {reads: node.e, noise: 0.01}}
"""


@pytest.fixture(scope="module")
def motor() -> StepModel:
    """Give the motor seen from voltage and speed."""
    return build_step_model(build_plant(load_model(EXAMPLES / "dc_motor" / "model.yaml")))


def lumps(factors: dict[str, Fraction]) -> tuple[Fraction, Fraction, Fraction]:
    """Give the three combinations on which the speed of the motor depends, exactly."""
    value = {name: nominal * factors.get(name, Fraction(1)) for name, nominal in NOMINAL.items()}
    r, ell, k, j, c = value.values()
    return j * ell / k, (j * r + ell * c) / k, (r * c + k**2) / k


@pytest.mark.parametrize("s", [Fraction(1, 3), Fraction(7, 5), Fraction(11)])
def test_the_twins_of_the_motor_are_exact(s: Fraction) -> None:
    """{R s, C/s} = {L/s, J s} and {R s, J/s} = {L/s, C s}: all three lumps agree as fractions."""
    assert lumps({"R": s, "C": 1 / s}) == lumps({"L": 1 / s, "J": s}) != lumps({})
    assert lumps({"R": s, "J": 1 / s}) == lumps({"L": 1 / s, "C": s}) != lumps({})


def test_the_twins_of_the_motor_are_found_with_their_powers(motor: StepModel) -> None:
    """G23 is found, as powers of one size, and no fault is so imitated for every size: none is always a twin."""
    found = {(item.first, item.second): item for item in twins(motor)}
    assert not any(item.always for item in found.values())
    for first, second in ((("R", "C"), ("L", "J")), (("R", "J"), ("L", "C"))):
        item = found[first, second]
        assert item.first_powers is not None
        assert item.second_powers is not None
        one, two = item.first_powers, item.second_powers
        assert one[0] == -one[1] == -two[0] == two[1] != 0
    assert found[("R", "C"), ("L", "J")].words == "{R s, C/s} looks exactly like {L/s, J s}, for any s > 0"


def test_every_match_has_the_same_lumps(motor: StepModel) -> None:
    """Faults said to look alike have the same three lumps, also where no simple power describes the family."""
    found = twins(motor, [(("R", "K"), ("L", "C")), (("L", "C"), ("J", "K"))])
    assert len(found) == 2
    for item in found:
        assert item.first_powers is None
        assert "and so for other sizes" in item.words
        for match in item.matches:
            one = lumps({name: Fraction(value) for name, value in zip(item.first, match.first, strict=True)})
            two = lumps({name: Fraction(value) for name, value in zip(item.second, match.second, strict=True)})
            assert [float(value) for value in one] == pytest.approx([float(value) for value in two], rel=1e-6)


def test_two_pipes_in_series_are_always_twins() -> None:
    """Of two resistances in series only the sum acts: each can do what the other does; the tank's area cannot."""
    model = build_step_model(build_plant(parse_model(TANK_WITH_TWO_PIPES)))
    (found,) = twins(model, [(("R1",), ("R2",)), (("R1",), ("A",))])
    assert (found.first, found.second, found.always) == (("R1",), ("R2",), True)
    assert found.words == "whatever {R1} does, {R2} can do as well"


def test_every_pair_of_the_circuit_is_a_twin_of_every_other() -> None:
    """Of resistor, coil and capacitor only two combinations act: whatever one pair does, another can do."""
    model = build_step_model(build_plant(load_model(EXAMPLES / "rlc" / "model.yaml")))
    found = twins(model)
    assert all(item.always and not item.matches for item in found)
    assert {frozenset({item.first, item.second}) for item in found} == {
        frozenset({("C", "R"), ("C", "L")}),
        frozenset({("C", "R"), ("R", "L")}),
        frozenset({("C", "L"), ("R", "L")}),
    }


def test_unlike_faults_have_no_twins(motor: StepModel) -> None:
    """Two singles of the motor have independent effects, so neither imitates the other."""
    assert twins(motor, [(("R",), ("C",)), (("L",), ("K",))]) == ()


def test_what_there_is_no_time_for_is_counted(motor: StepModel) -> None:
    """Without time the pairs whose ranks allow twins are left out; the others are told by their ranks."""
    compared = compare(motor, [(("R",), ("C",)), (("R", "C"), ("L", "J"))], seconds=0.0)
    assert (compared.found, compared.compared, compared.left_out) == ((), 1, 1)
