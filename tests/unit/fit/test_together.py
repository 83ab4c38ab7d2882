"""What a fit leaves open of several parameters goes together: what is declared of it, and in which file."""

import json
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any, cast

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.cli import DONE, main
from faultbond.fit.outcome import LEAST_ACCURACY, Estimate, correlations_of
from faultbond.io.recording import write_recording
from faultbond.model.correlations import is_definite
from faultbond.model.graph import Correlation, Parameter, Unit
from faultbond.model.text import load_model
from faultbond.report.fit_result import _new_parameter, _parameter_row
from faultbond.report.numbers import MINUS
from faultbond.report.together import together_texts

MODEL = """# a circuit
name: circuit
sample_time: 0.02 s
accuracy: 4 %
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 kohm}}
  C: {type: C, parameters: {C: 100 uF}}   # it is old
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {V_C: {reads: C.e, unit: V, noise: 0.1 V}}
"""


def recording(path: Path) -> Path:
    """Write what a circuit whose time constant is 1 s shows of a voltage that jumps."""
    generator, shown = np.random.default_rng(1), [0.0]
    voltage = np.where(np.arange(1500) // 100 % 2 == 0, 6.0, -2.0)
    for value in voltage[:-1]:
        shown.append(value + np.exp(-0.02) * (shown[-1] - value))
    noisy = np.array(shown) + 0.1 * generator.standard_normal(len(shown))
    time = np.asarray(0.02 * np.arange(len(voltage)), dtype=np.float64)
    write_recording(path, {"time": time, "V": np.asarray(voltage, dtype=np.float64), "V_C": noisy})
    return path


def fitted(model: Path, data: Path, new: Path, *options: str) -> dict[str, Any]:
    """Fit, and give the record."""
    target = new.with_suffix(".json")
    words = ["fit", str(model), str(data), "-o", str(new), "--starts", "1", *options, "--json", str(target)]
    assert main(words) == DONE
    return dict(json.loads(target.read_text(encoding="utf-8")))


def test_a_circuit_whose_product_shows(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """R and C stay as uncertain as declared, but not their product; the next fit writes it anew, or takes it away."""
    model, data, new = tmp_path / "model.yaml", recording(tmp_path / "a.csv"), tmp_path / "new.yaml"
    model.write_text(MODEL, encoding="utf-8")
    record = fitted(model, data, new)
    one, other = (item["accuracy"] / item["estimate"] for item in record["parameters"])
    own = (LEAST_ACCURACY / one) ** 2  # of a variance, which is of this parameter alone
    assert one == pytest.approx(other, rel=0.1)
    assert one > 0.025
    (together,) = load_model(new).correlations
    assert together.value == pytest.approx(-(1.0 - own), abs=0.02)
    assert record["correlations"] == [{"parameters": ["R", "C"], "value": together.value}]
    product = np.sqrt(one**2 + other**2 + 2 * together.value * one * other)
    assert product == pytest.approx(np.sqrt(2.0) * LEAST_ACCURACY, rel=0.1)
    assert (
        f"R and C {MINUS}{-together.value:g}: their product is known to {100 * product:.1f} %"
        in capsys.readouterr().out
    )
    assert "# it is old\n" in new.read_text(encoding="utf-8")
    fitted(new, data, tmp_path / "again.yaml")
    (again,) = load_model(tmp_path / "again.yaml").correlations
    assert -1.0 < again.value < -0.3
    fitted(new, data, tmp_path / "fixed.yaml", "--fixed", "R")
    assert load_model(tmp_path / "fixed.yaml").correlations == ()
    assert main(["check", str(new)]) == DONE
    assert f"R and C {MINUS}{-together.value:g}: their product" in capsys.readouterr().out


def test_of_parameters_that_are_hardly_known_no_ratio_is_told() -> None:
    """A product that is known to 310 % is not known."""
    one, other = (SimpleNamespace(name=name, nominal=2.0, accuracy=4.4) for name in "RC")
    together = Correlation(one="R", other="C", value=-0.5)
    parameters = cast("dict[str, Parameter]", {"R": one, "C": other})
    assert together_texts(parameters, [together]) == [f"R and C {MINUS}0.5"]
    one.accuracy = other.accuracy = 0.2
    assert together_texts(parameters, [together]) == [f"R and C {MINUS}0.5: their product is known to 10 %"]


POT = """name: pot
sample_time: 1 s
accuracy: 5 %
inputs: {u: {unit: percent}}
constants: {all: 100 percent}
components:
  heater: {type: Sf, law: f = P*u/all, parameters: {P: 1 kW}}
  water: {type: C, law: q = C*e, parameters: {C: 4 kJ/K}}
  loss: {type: R, law: f = UA*e, parameters: {UA: 20 W/K}}
junctions: {pot: 0}
bonds: [heater -> pot, pot -> water, pot -> loss]
sensors: {T: {reads: pot.e, unit: K, noise: 0.1 K}}
"""


@pytest.mark.parametrize("off", [{"P": 1.4}, {"C": 1.4}, {"UA": 0.6}, {}], ids=["P", "C", "UA", "none"])
def test_of_what_shows_ratios_the_fewest_are_off(off: dict[str, float], tmp_path: Path) -> None:
    """Power, heat store and loss have a scale in common: one that is far off is found, and the others stay as known."""
    factors = {"P": 1.0, "C": 1.0, "UA": 1.0} | off
    generator = np.random.default_rng(5)
    power = np.repeat(generator.uniform(0.0, 100.0, 20), 100)
    decay, hot, shown = np.exp(-20.0 * factors["UA"] / (4000.0 * factors["C"])), 0.0, []
    for value in power:
        shown.append(hot + 0.1 * generator.standard_normal())
        hot = decay * hot + (1.0 - decay) * 10.0 * value * factors["P"] / (20.0 * factors["UA"])
    data, model = tmp_path / "a.csv", tmp_path / "model.yaml"
    write_recording(data, {"time": np.arange(float(len(power))), "u": power, "T": np.array(shown)})
    model.write_text(POT, encoding="utf-8")
    record = fitted(model, data, tmp_path / "new.yaml")
    assert {item["name"]: item["estimate"] / item["nominal"] for item in record["parameters"]} == pytest.approx(
        factors, rel=0.02
    )
    assert all(item["accuracy"] < 0.05 * item["estimate"] for item in record["parameters"])
    assert [name for name, times in record["widened"].items() if times > 1.5] == list(off)
    (alike,) = record["alike"]
    assert alike == pytest.approx({"P": 0.1, "C": 0.1, "UA": 0.1}, rel=0.01)


def estimate(name: str, nominal: float, sd: float, accuracy: float) -> Estimate:
    """A parameter of which this is left open."""
    unit = Unit("")
    parameter = Parameter(name=name, owner=name, nominal=nominal, unit=unit, accuracy=0.1, change=2, lower=-9, upper=9)
    return Estimate(
        parameter=parameter,
        value=nominal,
        sd=sd,
        alone=sd,
        inflation=1.0,
        accuracy=accuracy,
        determined=True,
        at_end=False,
    )


def test_what_is_found_of_a_temperature_is_told_in_kelvin() -> None:
    """A per cent of degC would be one of K: 0.7 % of 14.8 degC, and a change by 1.1 % from 18 degC."""
    for text, unit in (("degC", Unit("degC", 1.0, 273.15)), ("degF", Unit("degF", 5 / 9, 459.67 * 5 / 9))):
        told = estimate("T_cellar", 291.15, 0.3, 2.0)
        told = replace(told, value=288.0, parameter=replace(told.parameter, unit=unit))
        written = _new_parameter(told)
        assert written.nominal.endswith(f" {text}")
        assert dict(written.others)["accuracy"] == "2 K"
        assert _parameter_row(told, is_added=False)[-3:-1] == (f"{MINUS}3.15 K", "2 K")
        assert unit.rate == Unit("K/s")
    other = replace(estimate("R", 10.0, 0.1, 0.2), value=9.0)
    assert dict(_new_parameter(other).others)["accuracy"] == "2.3 %"
    assert _parameter_row(other, is_added=False)[-3:-1] == (f"{MINUS}10 %", "2.3 %")


def found_with(covariance: FloatArray, estimates: list[Estimate]) -> Any:
    """As much of a fit as counts: its covariance, in factors, and a noise behind the parameters."""
    n = len(estimates)
    whole = np.eye(n + 1)
    whole[:n, :n] = covariance
    unknowns = SimpleNamespace(
        parameters=[item.parameter for item in estimates], fill=lambda base, values: (values, np.ones(n + 1))
    )
    return SimpleNamespace(
        plant=SimpleNamespace(unknowns=unknowns, base=None),
        summit=SimpleNamespace(point=SimpleNamespace(values=np.ones(n + 1))),
        certainty=SimpleNamespace(covariance=whole),
    )


def test_what_is_declared_is_the_common_part() -> None:
    """Of each variance the least accuracy is its own; the sign is that of the values, one of which is negative."""
    estimates = [estimate("A", 2.0, 0.10, 0.10), estimate("B", -1.0, 0.04, 0.04), estimate("C", 1.0, 0.008, 0.01)]
    together = np.array([[1.0, 0.9, 0.9], [0.9, 1.0, 0.9], [0.9, 0.9, 1.0]]) * 1e-4
    found = correlations_of(found_with(together, estimates), estimates)
    shared = np.sqrt(1.0 - (0.02 / 0.10) ** 2) * np.sqrt(1.0 - (0.01 / 0.04) ** 2)
    assert found == {("A", "B"): pytest.approx(-0.9 * shared, abs=0.01)}  # C is known as well as it can be
    assert -0.9 * shared < found["A", "B"]  # rounded towards 0


def test_what_seems_to_move_by_itself_is_not_common() -> None:
    """A friction that moves by 8 % on healthy data is not tied to that of the next bearing more closely than that."""
    estimates = [estimate("A", 1.0, 0.10, 0.10), estimate("B", 1.0, 0.10, 0.10)]
    together = np.array([[1.0, 0.98], [0.98, 1.0]]) * 1e-2
    alone = correlations_of(found_with(together, estimates), estimates)["A", "B"]
    found = correlations_of(found_with(together, estimates), estimates, {"A": 0.08, "B": 0.005})["A", "B"]
    assert found == pytest.approx(alone * np.sqrt((1.0 - 0.8**2) / (1.0 - 0.1**2)), abs=0.01)
    assert correlations_of(found_with(together, estimates), estimates, {"A": 0.2}) == {}


def test_what_is_less_sure_than_may_be_declared_goes_with_nothing() -> None:
    """Its declared accuracy is a bound, not what was found."""
    estimates = [estimate("A", 1.0, 0.5, 0.2), estimate("B", 1.0, 0.04, 0.04)]
    assert correlations_of(found_with(np.array([[1.0, 0.9], [0.9, 1.0]]), estimates), estimates) == {}


@pytest.mark.parametrize("seed", range(20))
def test_what_is_left_out_or_rounded_leaves_the_rest_possible(seed: int) -> None:
    """A few directions that nothing fixes, of many parameters: what is declared is definite, and about right."""
    generator, n = np.random.default_rng(seed), 9
    open_ways = generator.standard_normal((n, 3)) * generator.uniform(0.05, 1.0, 3)
    covariance = (open_ways @ open_ways.T + 1e-6 * np.eye(n)) * 0.01
    sds = np.sqrt(np.diag(covariance))
    estimates = [estimate(f"P{k}", 1.0, float(sd), max(float(sd), 0.01)) for k, sd in enumerate(sds)]
    found = correlations_of(found_with(covariance, estimates), estimates)
    assert is_definite(found)
    shared = np.array([item.shared() for item in estimates])
    right = covariance / np.outer(sds, sds) * np.outer(shared, shared)
    for i in range(n):
        for j in range(i + 1, n):
            value = found.get((f"P{i}", f"P{j}"), 0.0)
            assert value == pytest.approx(right[i, j], abs=0.1 if value == 0.0 else 0.02)


def test_all_parameters_at_their_least_go_with_nothing() -> None:
    """Well known parameters are each as well known as a plant stays the same."""
    estimates = [replace(estimate(name, 1.0, 0.002, 0.01)) for name in "AB"]
    assert correlations_of(found_with(np.array([[1.0, 0.99], [0.99, 1.0]]), estimates), estimates) == {}
