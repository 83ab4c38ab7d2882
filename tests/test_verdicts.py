"""The verdict on every built-in example, through the command line."""

import json
from pathlib import Path

import numpy as np
import pytest

from faultbond.cli import DONE, FAULT_DETECTED, main

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"

FAULTS = {  # folder -> fault recording, time of the fault, suspects and their true values, relative error allowed
    "tank": ("fault_pipe.csv", 1500.0, {"K1": 1.85 * 2.41e11}, 0.10),
    "dc_motor": ("fault_winding.csv", 20.0, {"R": 6.0}, 0.05),
    "dc_motor_current": ("fault_triple.csv", 20.0, {"R": 6.0, "L": 5.0, "J": 2.25}, 0.05),
    "rlc": ("fault_capacitor.csv", 20.0, {"C": 0.067}, 0.05),
    "rc": ("fault_capacitor.csv", 20.0, {"C": 1.3e-4}, 0.05),
}


def records(capsys: pytest.CaptureFixture[str], folder: str, recording: str, code: int) -> list[dict[str, object]]:
    """Run a recording of an example and give its records."""
    place = EXAMPLES / folder
    assert main(["run", str(place / "model.yaml"), str(place / recording), "--json", "-"]) == code
    return [json.loads(line) for line in capsys.readouterr().out.splitlines()]


@pytest.mark.parametrize("folder", FAULTS)
def test_healthy_plant_raises_no_alarm(folder: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The healthy recording of each example ends without a detection."""
    found = records(capsys, folder, "healthy.csv", DONE)
    assert [record["record"] for record in found] == ["run", "end"]
    assert found[-1]["detections"] == 0


@pytest.mark.parametrize("folder", FAULTS)
def test_fault_is_named_and_measured(folder: str, capsys: pytest.CaptureFixture[str]) -> None:
    """The fault of each example is detected after it began, ranked first, and its value is right within its margin."""
    recording, began, truth, margin = FAULTS[folder]
    found = records(capsys, folder, recording, FAULT_DETECTED)
    detection = next(record for record in found if record["record"] == "detection")
    assert isinstance(detection["time"], float)
    assert detection["time"] >= began
    last = [record for record in found if record["record"] == "diagnosis"][-1]
    candidates = last["candidates"]
    assert isinstance(candidates, list)
    best = candidates[0]["parameters"]
    assert set(best) == set(truth)
    for name, value in truth.items():  # the true plant is off by up to 1.5 % (tank: 3 %) before the fault already
        assert best[name]["estimate"] == pytest.approx(value, rel=margin)


def test_the_gain_of_an_input_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A pump that gives 0.8 of what it is told, whatever that is, is told as that, and by how much."""
    place, made = EXAMPLES / "tank", tmp_path / "gain.csv"
    words = ("--inputs", str(place / "healthy.csv"), "--spread", "2 %", "--seed", "11", "--fault", "u_in.gain=0.8@2459")
    assert main(["simulate", str(place / "model.yaml"), *words, "-o", str(made)]) == DONE
    capsys.readouterr()
    assert main(["run", str(place / "model.yaml"), str(made), "--json", "-"]) == FAULT_DETECTED
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    best = [record for record in found if record["record"] == "diagnosis"][-1]["candidates"][0]
    assert best["probability"] > 0.9
    assert best["kind"] == "gain"
    gain = best["parameters"]["u_in.gain"]
    assert gain["estimate"] == pytest.approx(0.8, abs=max(0.02, 3.0 * gain["sd"]))


COLLECTOR = """
name: collector
sample_time: 10 s
inputs: {G: {unit: W/m^2}}
constants: {area: 8 m^2, Ta: 20 degC}
blocks:
  glass: {law: qs = eta*area*G, parameters: {eta: 0.79}}
  absorber: {law: der(T) = (qs - UA*(T - Ta))/C, parameters: {UA: 30 W/K, C: 48 kJ/K}}
sensors: {Tc: {reads: T, unit: degC, noise: 0.1 degC}}
"""


def test_an_input_that_a_parameter_multiplies_is_in_the_group_with_it(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """A meter of irradiance that reads too little and glass that lets more through are one and the same."""
    (tmp_path / "model.yaml").write_text(COLLECTOR, encoding="utf-8")
    random = np.random.default_rng(3)
    rows, T, level = ["time,G,Tc"], 60.0, 700.0
    for k in range(700):
        if k % 40 == 0:
            level = round(float(random.uniform(400.0, 900.0)), 1)
        shown = level * (0.8 if k >= 400 else 1.0)
        rows.append(f"{10 * k},{shown:.2f},{T + 0.1 * random.standard_normal():.3f}")
        T += 10.0 * (0.79 * 8.0 * level - 30.0 * (T - 20.0)) / 48e3
    (tmp_path / "dust.csv").write_text("\n".join(rows), encoding="utf-8")
    assert main(["run", str(tmp_path / "model.yaml"), str(tmp_path / "dust.csv"), "--json", "-"]) == FAULT_DETECTED
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    last = [record for record in found if record["record"] == "diagnosis"][-1]
    group = {name: item for one in last["candidates"] if one["group"] for name, item in one["parameters"].items()}
    assert set(group) == {"eta", "G.gain"}
    assert group["G.gain"]["estimate"] == pytest.approx(1.25, rel=0.03)


DIVIDER = """
name: divider
sample_time: 0.1 s
inputs: {V: {unit: V}}
components:
  source: {type: Se, law: e = V}
  Ra: {type: R, parameters: {Ra: 1 kohm}}
  Rb: {type: R, parameters: {Rb: 2 kohm}}
  Rc: {type: R, parameters: {Rc: 3 kohm}}
junctions: {a: 1, n: 0}
bonds: [source -> a -> Ra, a -> n -> Rb, n -> Rc]
sensors: {v: {reads: n.e, unit: V, noise: 10 mV}}
"""


def test_fault_is_not_explained_away(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """A step of 30 noises in a plant without memory alarms, though its parameters could explain it; they share it."""
    (tmp_path / "model.yaml").write_text(DIVIDER)
    noise = np.random.default_rng(1).normal(0.0, 0.01, 600)
    lines = ["time,V,v"]
    for k in range(600):
        V = 5.0 + 2.0 * ((k // 40) % 3)
        lines.append(f"{0.1 * k:.1f},{V},{V * 1.2 / 2.2 * (1.0 if k < 300 else 0.9) + noise[k]:.5f}")
    (tmp_path / "rec.csv").write_text("\n".join(lines))
    code = main(["run", str(tmp_path / "model.yaml"), str(tmp_path / "rec.csv"), "--json", "-"])
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    assert code == FAULT_DETECTED
    assert 30.0 <= found[1]["time"] <= 32.0
    group = {tuple(item["parameters"]) for item in found[-2]["candidates"] if item["group"]}
    assert {("Ra",), ("Rb",), ("Rc",)} <= group


@pytest.mark.parametrize("gain", [0.87, 1.12])
def test_a_wrong_gain_of_a_store_s_sensor_is_not_the_store_for_sure(
    gain: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """Data hardly tell a gauge that reads a part of what there is from a tank that is wider: both are told."""
    place, made = EXAMPLES / "tank", tmp_path / "gain.csv"
    words = ("--inputs", str(place / "healthy.csv"), "--seed", "1", "--fault", f"pressure.gain=x{gain}@2000")
    assert main(["simulate", str(place / "model.yaml"), *words, "-o", str(made)]) == DONE
    capsys.readouterr()
    assert main(["run", str(place / "model.yaml"), str(made), "--json", "-"]) == FAULT_DETECTED
    found = [json.loads(line) for line in capsys.readouterr().out.splitlines()]
    last = [record for record in found if record["record"] == "diagnosis"][-1]
    group = [item for item in last["candidates"] if item["group"]]
    assert ["pressure"] in [item["components"] for item in group]
    assert group[0]["probability"] < 0.9
