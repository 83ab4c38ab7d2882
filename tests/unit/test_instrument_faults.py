"""Faults of sensors and inputs, and faults that come and go, in simulated recordings."""

import json
from dataclasses import replace
from itertools import islice
from pathlib import Path

import numpy as np
import pytest

from faultbond.arrays import FloatArray
from faultbond.cli import main
from faultbond.errors import ModelError
from faultbond.io import parse_fault
from faultbond.model.graph import BondGraph, Unit
from faultbond.model.text import load_model
from faultbond.simulate import Decide, Fault, Inputs, Policy, Simulation, fault_in_si, simulate

EXAMPLES = Path(__file__).parents[2] / "examples"
TIME: FloatArray = np.arange(0.0, 60.0)
VALUES = np.column_stack([np.where(TIME < 40, 60.0, 30.0), np.full(60, 40.0)])
FLOW, PRESSURE = 0, 1


@pytest.fixture(scope="module")
def tank() -> BondGraph:
    """Give the water tank; its sensors are flow and pressure, its inputs u_in and u_out in percent."""
    return load_model(EXAMPLES / "tank" / "model.yaml")


def made(graph: BondGraph, *faults: str, seed: int | None = 1, values: FloatArray = VALUES) -> Simulation:
    """Simulate with faults as they are written."""
    asked = [fault_in_si(parse_fault(text), graph) for text in faults]
    return simulate(graph, Inputs(time=TIME, values=values), asked, seed=seed, start={"tank.q": 0.05})


def test_bias_is_added_to_the_reading(tank: BondGraph) -> None:
    """From its time on the sensor shows so much more; all else stays as it was, the noise too."""
    healthy, faulty = made(tank), made(tank, "flow.bias=1.4e-5@20")
    off = faulty.outputs - healthy.outputs
    np.testing.assert_allclose(off[:20, FLOW], 0.0, atol=0)
    np.testing.assert_allclose(off[20:, FLOW], 1.4e-5, rtol=1e-9)
    np.testing.assert_array_equal(faulty.outputs[:, PRESSURE], healthy.outputs[:, PRESSURE])
    np.testing.assert_array_equal(faulty.states, healthy.states)
    np.testing.assert_array_equal(faulty.inputs, healthy.inputs)


def test_bias_grows_along_a_ramp(tank: BondGraph) -> None:
    """A sensor that drifts is off by a straight line, then by the value at its end."""
    off = (made(tank, "pressure.bias=100@20..30").outputs - made(tank).outputs)[:, PRESSURE]
    np.testing.assert_allclose(off[20:31], np.arange(11) * 10.0, atol=1e-9)
    np.testing.assert_allclose(off[31:], 100.0, rtol=1e-9)


@pytest.mark.parametrize("text", ["flow.gain=1.1@20", "flow.gain=x1.1@20"])
def test_gain_multiplies_the_reading_and_not_its_noise(tank: BondGraph, text: str) -> None:
    """The healthy gain is 1, so a value and a factor are the same."""
    quiet, healthy, faulty = made(tank, seed=None), made(tank), made(tank, text)
    off = (faulty.outputs - healthy.outputs)[:, FLOW]
    np.testing.assert_allclose(off[20:], 0.1 * quiet.outputs[20:, FLOW], rtol=1e-9)
    assert not off[:20].any()


def test_a_gain_is_of_the_unit_of_the_model_file(tank: BondGraph) -> None:
    """What a thermometer in degC shows is multiplied, not the kelvin inside; stuck at a value it has no gain."""
    zero = 5000.0  # Pa, as if the pressure were counted from there
    unit = replace(tank.sensors[PRESSURE].unit, offset=zero)
    graph = replace(tank, sensors=(tank.sensors[FLOW], replace(tank.sensors[PRESSURE], unit=unit)))
    quiet, faulty = made(graph, seed=None), made(graph, "pressure.gain=1.1@20", seed=None)
    shown = quiet.outputs[20:, PRESSURE] - zero
    np.testing.assert_allclose(faulty.outputs[20:, PRESSURE] - zero, 1.1 * shown, rtol=1e-12)
    both = made(graph, "pressure.gain=1.1@20", "pressure.stuck=200@20").outputs[20:, PRESSURE]
    np.testing.assert_allclose(both, zero + 200.0 * unit.factor, rtol=1e-12)


def test_stuck_sensor_shows_its_last_reading(tank: BondGraph) -> None:
    """It holds what it showed last, noise included; with a value it shows that."""
    healthy = made(tank).outputs[:, PRESSURE]
    held = made(tank, "pressure.stuck@20").outputs[:, PRESSURE]
    assert set(held[20:]) == {healthy[19]}
    np.testing.assert_array_equal(held[:20], healthy[:20])
    assert set(made(tank, "pressure.stuck=0@20").outputs[20:, PRESSURE]) == {0.0}
    assert set(made(tank, "pressure.stuck@0").outputs[:, PRESSURE]) == {healthy[0]}


def test_noise_grows_by_a_factor_or_to_a_value(tank: BondGraph) -> None:
    """The same draws are scaled; a factor is of the declared noise."""
    quiet, healthy = (made(tank, seed=seed).outputs[:, PRESSURE] for seed in (None, 1))
    for text in ("pressure.noise=x3@20", f"pressure.noise={3 * tank.sensors[PRESSURE].noise}@20"):
        noisy = made(tank, text).outputs[:, PRESSURE]
        np.testing.assert_allclose((noisy - quiet)[20:], 3 * (healthy - quiet)[20:], rtol=1e-9)
        np.testing.assert_array_equal(noisy[:20], healthy[:20])


def test_bias_of_an_input_acts_and_is_not_recorded(tank: BondGraph) -> None:
    """The plant gets more than is recorded, as if the input had been that."""
    raised = VALUES.copy()
    raised[20:, 0] += 5.0
    faulty, truth = made(tank, "u_in.bias=5@20"), made(tank, values=raised)
    np.testing.assert_array_equal(faulty.outputs, truth.outputs)
    np.testing.assert_array_equal(faulty.inputs, VALUES)
    np.testing.assert_array_equal(faulty.true_inputs, raised)


def test_stuck_and_wrong_inputs(tank: BondGraph) -> None:
    """A stuck input goes on acting while the record moves; a gain acts on the recorded value."""
    held = made(tank, "u_in.stuck@30")
    assert set(held.true_inputs[:, 0]) == {60.0}
    assert held.inputs[-1, 0] == 30.0
    assert made(tank, "u_out.gain=0.5@30").true_inputs[[29, 30], 1].tolist() == [40.0, 20.0]


def test_noise_of_an_input_is_recorded_and_does_not_act() -> None:
    """A noisy meter of an input does not shake the plant."""
    motor = load_model(EXAMPLES / "dc_motor" / "model.yaml")
    inputs = Inputs(time=np.arange(50.0) * 0.02, values=np.full((50, 1), 8.0))
    asked = [fault_in_si(parse_fault("V.noise=x3@0.5"), motor)]
    healthy, faulty = (simulate(motor, inputs, faults, seed=2) for faults in ([], asked))
    np.testing.assert_allclose((faulty.inputs - 8)[25:], 3 * (healthy.inputs - 8)[25:], rtol=1e-9)
    np.testing.assert_array_equal(faulty.outputs, healthy.outputs)


def test_parameter_that_comes_and_goes(tank: BondGraph) -> None:
    """There for 4.5 s, gone for 10 s, and so on, at the moment and not at the next row; once without the second."""
    index = [item.name for item in tank.parameters].index("K6")
    nominal = tank.parameters[index].nominal
    leak = made(tank, "K6=8e-5@10.5,4.5/10", seed=None)
    there = (TIME >= 10.5) & ((TIME - 10.5) % 14.5 < 4.5)
    np.testing.assert_array_equal(leak.parameters[:, index], np.where(there, 8e-5, nominal))
    once = made(tank, "K6=8e-5@10.5,4.2", seed=None)
    np.testing.assert_array_equal(once.parameters[:, index], np.where((TIME > 10) & (TIME < 15), 8e-5, nominal))
    lost = (made(tank, seed=None).states - once.states)[:, 0]
    np.testing.assert_allclose(lost[20], 4.2 * (8e-5 - nominal), rtol=0.02)


def test_gone_means_what_was_before(tank: BondGraph) -> None:
    """A fault that goes leaves the value that an earlier fault had brought."""
    index = [item.name for item in tank.parameters].index("K1")
    both = made(tank, "K1=3e11@10", "K1=4e11@20,5/5", seed=None).parameters[:, index]
    assert both[[9, 10, 20, 25, 30, 35]].tolist() == [2.41e11, 3e11, 4e11, 3e11, 4e11, 3e11]


def test_sensor_that_sticks_now_and_then(tank: BondGraph) -> None:
    """Each time it holds the reading of the moment before."""
    healthy = made(tank).outputs[:, FLOW]
    found = made(tank, "flow.stuck@10,5/10").outputs[:, FLOW]
    stuck = (TIME >= 10) & ((TIME - 10) % 15 < 5)
    before = TIME.astype(int) - ((TIME.astype(int) - 10) % 15) - 1
    np.testing.assert_array_equal(found, np.where(stuck, healthy[np.maximum(before, 0)], healthy))


def test_a_controller_sees_the_faulty_sensor(tank: BondGraph) -> None:
    """What a policy decides follows from the wrong readings, and what acts is what its input lets through."""
    seen: list[FloatArray] = []

    def begin() -> Decide:
        seen.clear()

        def decide(_: float, outputs: FloatArray) -> list[float]:
            seen.append(outputs.copy())
            return [60.0, 50.0 if outputs[PRESSURE] > 8000.0 else 40.0]

        return decide

    faults = [Fault(parameter="pressure.bias", value=5000.0, start=20.0), Fault(parameter="u_out.stuck", start=40.0)]
    run = simulate(tank, Policy(time=TIME, begin=begin), faults, seed=3, start={"tank.q": 0.05})
    np.testing.assert_allclose(np.array(seen[1:]), run.outputs[:-1], rtol=0, atol=1e-6)
    assert set(run.true_inputs[21:, 1]) == {50.0}
    assert set(run.true_inputs[:20, 1]) == {40.0}


def test_units_of_instruments_are_those_of_the_model_file(tank: BondGraph) -> None:
    """A bias and a noise are differences, a stuck value is a value: only that knows the zero of degrees Celsius."""
    warm = replace(tank.sensors[PRESSURE], name="T", unit=Unit("degC", 1.0, 273.15))
    graph = replace(tank, sensors=(*tank.sensors, warm))
    for kind, expected in (("bias", 2.0), ("noise", 2.0), ("gain", 2.0), ("stuck", 275.15)):
        assert fault_in_si(parse_fault(f"T.{kind}=2@3"), graph).value == expected
    kilo = replace(tank.sensors[PRESSURE], name="p", unit=Unit("kPa", 1e3))
    graph = replace(tank, sensors=(*tank.sensors, kilo))
    for kind, expected in (("bias", 2e3), ("noise", 2e3), ("gain", 2.0), ("stuck", 2e3)):
        assert fault_in_si(parse_fault(f"p.{kind}=2@3"), graph).value == expected


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (Fault(parameter="flw.bias", value=1.0, start=1.0), r"no sensor or input flw; did you mean flow\?"),
        (Fault(parameter="flow", value=1.0, start=1.0), r"say what is wrong with it, such as flow\.bias"),
        (Fault(parameter="flow.bais", value=1.0, start=1.0), r"did you mean bias\?"),
        (Fault(parameter="flow.bias", factor=2.0, start=1.0), "its healthy value is 0"),
        (Fault(parameter="flow.stuck", factor=2.0, start=1.0), "stuck at a value, not at a factor"),
        (Fault(parameter="u_in.noise", factor=2.0, start=1.0), "its healthy value is 0"),
        (Fault(parameter="flow.noise", value=-1.0, start=1.0), "a noise is 0 or more"),
        (Fault(parameter="flow.bias", start=1.0), "either a finite value or a finite factor"),
        (Fault(parameter="flow.stuck", value=float("nan"), start=1.0), "either a finite value"),
        (Fault(parameter="K1", value=1.0, start=1.0, off=2.0), "lengths of time above 0 s"),
        (Fault(parameter="K1", value=1.0, start=1.0, on=0.0), "lengths of time above 0 s"),
        (Fault(parameter="K1", value=1.0, start=1.0, end=2.0, on=3.0), "either comes and goes or follows a ramp"),
        (Fault(parameter="K1", value=1.0, start=1.0, on=1e-9, off=1e-9), "more than 10000 times"),
    ],
)
def test_fault_that_cannot_be_is_refused(tank: BondGraph, fault: Fault, message: str) -> None:
    """A wrong fault is a ModelError that says what is wrong."""
    with pytest.raises(ModelError, match=message):
        simulate(tank, Inputs(time=TIME, values=VALUES), [fault])


def test_a_stuck_sensor_from_the_command_line(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """What `simulate` does to a sensor is what `run` says of it, in words and in the record."""
    folder, short = EXAMPLES / "rc", tmp_path / "inputs.csv"
    with (folder / "healthy.csv").open(encoding="utf-8") as source:
        short.write_text("".join(islice(source, 601)), encoding="utf-8")
    made_of = ["--inputs", str(short), "--fault", "V_C.stuck@6", "--seed", "1", "-o", str(tmp_path / "stuck.csv")]
    assert main(["simulate", str(folder / "model.yaml"), *made_of]) == 0
    capsys.readouterr()
    target = tmp_path / "records.jsonl"
    assert main(["run", str(folder / "model.yaml"), str(tmp_path / "stuck.csv"), "--json", str(target)]) == 1
    assert "Most likely the V_C sensor is at fault: it is stuck at" in capsys.readouterr().out
    lines = [json.loads(line) for line in target.read_text(encoding="utf-8").splitlines()]
    best = [line for line in lines if line["record"] == "diagnosis"][-1]["candidates"][0]
    assert (best["components"], best["kind"], best["present"]) == (["V_C"], "stuck", True)
    value = best["parameters"]["V_C.stuck"]
    assert value["nominal"] is None
    assert abs(value["estimate"] - float((tmp_path / "stuck.csv").read_text().splitlines()[-1].split(",")[-1])) < 0.1
