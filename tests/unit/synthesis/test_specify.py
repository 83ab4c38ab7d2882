"""The contract of a model: what is not stated in its file is worked out here."""

from pathlib import Path

import pytest

from faultbond.model.text import parse_model
from faultbond.synthesis.engine import build_model
from faultbond.synthesis.specify import build_spec

EXAMPLES = Path(__file__).resolve().parents[3] / "examples"
MOTOR = (EXAMPLES / "dc_motor" / "model.yaml").read_text(encoding="utf-8")


def test_states_that_a_sensor_reads_get_process_noise() -> None:
    """A state gets a fiftieth of the noise of the sensor that reads it; one that no sensor reads gets none."""
    noise = {state.name: state.noise for state in build_spec(build_model(parse_model(MOTOR))).states}
    assert noise == {"armature.f": 0.0, "shaft.f": pytest.approx(0.02 * 0.06)}


def test_healthy_value_may_scatter_about_the_end_of_its_range() -> None:
    """A healthy value at an end of its range may be estimated four accuracies beyond; elsewhere the range holds."""
    text = MOTOR.replace("{R: 3 ohm}", "{R: {nominal: 3 ohm, range: [3 ohm, 9 ohm]}}")
    limits = {item.name: item for item in build_spec(build_model(parse_model(text))).parameters}
    assert limits["R"].lower == pytest.approx(1.0 - 4.0 * 0.03)
    assert limits["R"].upper == pytest.approx(3.0)
    assert (limits["L"].lower, limits["L"].upper) == (0.02, 50.0)


def test_sets_that_explain_anything_get_no_filter() -> None:
    """A tank seen through its level fixes two numbers: of its three parameters no pair can be contradicted."""
    spec = build_spec(build_model(parse_model((EXAMPLES / "watersafe" / "tank4.yaml").read_text(encoding="utf-8"))))
    assert spec.hypotheses == ((0,), (1,), (2,))
    assert spec.explain_anything == ((0, 1), (0, 2), (1, 2))


def test_a_plant_in_which_all_explains_anything_keeps_its_smallest_sets() -> None:
    """Of a resistor and a capacitor only the product shows; each alone is still estimated."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8").replace("max_faults: 1", "max_faults: 2")
    assert build_spec(build_model(parse_model(text))).hypotheses == ((0,), (1,))


def test_only_what_is_identifiable_explains_anything() -> None:
    """Of the motor's sets of up to four, triples explain anything; quadruples are not identifiable, and not named."""
    spec = build_spec(build_model(parse_model(MOTOR.replace("sample_time:", "max_faults: 4\nsample_time:"))))
    assert {len(chosen) for chosen in spec.hypotheses} == {1, 2}
    assert [len(chosen) for chosen in spec.explain_anything] == [3] * 10


def test_of_two_sensors_of_a_state_the_better_counts() -> None:
    """A second, coarser sensor of the speed leaves the process noise as it is."""
    text = MOTOR.replace("sensors: {", "sensors: {coarse: {reads: shaft.f, unit: rad/s, noise: 6 rad/s}, ")
    assert "coarse" in text
    noise = {state.name: state.noise for state in build_spec(build_model(parse_model(text))).states}
    assert noise["shaft.f"] == pytest.approx(0.02 * 0.06)


def test_an_inaccurate_parameter_stays_positive() -> None:
    """A healthy value known to one half only may be estimated down to a fiftieth of it, not to zero or below."""
    text = MOTOR.replace("{R: 3 ohm}", "{R: {nominal: 3 ohm, accuracy: 50 %}}")
    limits = {item.name: item for item in build_spec(build_model(parse_model(text))).parameters}
    assert limits["R"].lower == pytest.approx(0.02)


def test_what_is_a_step_of_an_input() -> None:
    """A hundredth of the range of a valve in percent, six standard deviations of a noisy voltage."""
    tank = (EXAMPLES / "tank" / "model.yaml").read_text(encoding="utf-8")
    assert [(item.step, item.step_part) for item in build_spec(build_model(parse_model(tank))).inputs] == [
        (1.0, 0.0)
    ] * 2
    (voltage,) = build_spec(build_model(parse_model(MOTOR))).inputs
    assert voltage.step == pytest.approx(6 * 0.16)
    assert voltage.step_part == 0.01


def test_warm_up_is_not_longer_for_rounding() -> None:
    """6.9 s are 23 samples of 0.3 s, though their quotient is a trifle more; 20 samples at least."""
    text = MOTOR.replace("sample_time: 0.02 s", "sample_time: 0.3 s\nwarm_up: 6.9 s")
    assert "warm_up" in text
    assert build_spec(build_model(parse_model(text))).thresholds.warm_up_samples == 23
    assert build_spec(build_model(parse_model(MOTOR))).thresholds.warm_up_samples == 20


@pytest.mark.parametrize("start", ["", ", start: {q: 0 C, sd: 1 uC}", ", start: {q: 1 mC, sd: 1 uC}"])
def test_a_store_may_keep_its_content_however_full_it_begins(start: str) -> None:
    """The voltage of a capacitor whose charge goes on jumps as the inverse of C, also of one that begins empty."""
    text = (EXAMPLES / "rc" / "model.yaml").read_text(encoding="utf-8")
    spec = build_spec(build_model(parse_model(text.replace("{C: 100 uF}", f"{{C: 100 uF}}{start}"))))
    (state,) = spec.states
    assert [(spec.parameters[index].name, power) for index, power in state.jumps] == [("C", -1.0)]
    assert state.start_mean == pytest.approx(10.0 if "1 mC" in start else 0.0)


@pytest.mark.parametrize(("fitted", "inflow"), [("", 1.0), (", fitted_range: [8 m^3/s, 12 m^3/s]", 11.0)])
def test_process_noise_is_that_of_where_the_plant_was(fitted: str, inflow: float) -> None:
    """A square of a level of 22 m feels it eleven times as well as one of 2 m, at an inflow of one unit."""
    text = f"""
sample_time: 1 s
accuracy: 5 %
inputs: {{u: {{unit: m^3/s{fitted}}}}}
components:
  feed: {{type: Sf, law: f = u}}
  tank: {{type: C, law: e = q/A, parameters: {{A: 1 m^2}}}}
  pipe: {{type: R, law: f = e/R, parameters: {{R: 2 s/m^2}}}}
junctions: {{level: 0}}
bonds: [feed -> level -> tank, level -> pipe]
sensors: {{squared: {{reads: tank.e**2, unit: m^2, noise: 1 m^2}}}}
"""
    (state,) = build_spec(build_model(parse_model(text))).states
    assert state.noise == pytest.approx(0.02 / (2.0 * 2.0 * inflow), rel=1e-3)
