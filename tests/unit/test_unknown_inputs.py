"""An input that nobody measures: read and written, estimated, no fault of its own, and honest about what it hides."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from benchmarks.trust.wandering import watched
from scipy.integrate import solve_ivp

from faultbond.analysis.ranks import reduce
from faultbond.analysis.testable import generic_run, judge
from faultbond.arrays import FloatArray
from faultbond.cli import DONE, main
from faultbond.contract.samples import Samples
from faultbond.errors import ModelError
from faultbond.model.dump import dump_model
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Effects, Inputs, simulate
from faultbond.synthesis.engine import build_engine, build_model

STEP, RESISTANCE, INDUCTANCE, CONSTANT, INERTIA, FRICTION = 0.02, 1.0, 0.5, 0.6, 0.05, 0.02

MODEL = """\
name: drive with a load
sample_time: 0.02 s
inputs:
  V: {unit: V}
  load: {unit: N*m, unknown: 0.6 N*m over 3 s}
components:
  source: {type: Se, law: e = V}
  winding: {type: R, parameters: {Ra: 1 ohm}}
  coil: {type: I, parameters: {L: {nominal: 0.5 H, suspect: no}}, start: {p: 0, sd: 0.01}}
  motor: {type: GY, parameters: {k: {nominal: 0.6 N*m/A, suspect: no, accuracy: 1 %}}}
  rotor: {type: I, parameters: {J: 0.05 kg*m^2}, start: {p: 0, sd: 0.01}}
  bearing: {type: R, parameters: {d: 0.02 N*m*s/rad}}
  torque: {type: Se, law: e = load}
junctions: {electric: 1, shaft: 1}
bonds: [source -> electric, electric -> winding, electric -> coil, electric -> motor -> shaft, shaft -> rotor]
sensors:
  i: {reads: electric.f, unit: A, noise: 0.02 A}
  w: {reads: shaft.f, unit: rad/s, noise: 0.05 rad/s}
instrument_faults: no
""".replace("shaft -> rotor]", "shaft -> rotor, shaft -> bearing, shaft -> torque]")
KNOWN = MODEL.replace(", unknown: 0.6 N*m over 3 s", "")
WITHOUT = MODEL.replace("  load: {unit: N*m, unknown: 0.6 N*m over 3 s}\n", "constants: {load: 0 N*m}\n")


@cache
def core(text: str) -> Core:
    """Give the core of a model."""
    return build_engine(parse_model(text))[1]


def drive(seed: int, rows: int = 3000, *, resistance: float = RESISTANCE, at: int = 0) -> tuple[Samples, FloatArray]:
    """Give what a drive shows whose load goes its own way, and the load; resistance: of its winding from row `at`."""
    random = np.random.default_rng(seed)
    time = np.asarray(STEP * np.arange(rows), dtype=np.float64)
    voltage = np.repeat(random.choice([6.0, 12.0, 18.0, 24.0], rows // 100 + 1), 100)[:rows]
    load, decay = 0.6 * random.standard_normal(rows), np.exp(-STEP / 3.0)
    for k in range(1, rows):
        load[k] = decay * load[k - 1] + np.sqrt(1.0 - decay**2) * load[k]
    shown, state = np.zeros((rows, 2)), np.zeros(2)
    for first in range(0, rows - 1, 100):
        last = min(first + 100, rows - 1)

        def rates(t: float, x: FloatArray, volts: float = voltage[first], first: int = first) -> list[float]:
            ohms = resistance if first >= at and at else RESISTANCE
            current = (volts - ohms * x[0] - CONSTANT * x[1]) / INDUCTANCE
            torque = CONSTANT * x[0] - FRICTION * x[1] - float(np.interp(t, time, load))
            return [current, torque / INERTIA]

        span = slice(first, last + 1)
        solved = solve_ivp(rates, (time[first], time[last]), state, t_eval=time[span], max_step=STEP, rtol=1e-7)
        shown[span], state = solved.y.T, solved.y[:, -1]
    y = shown + np.array([0.02, 0.05]) * random.standard_normal((rows, 2))
    steps = np.concatenate([[0.0], np.full(rows - 1, STEP)])
    return Samples(time=time, dt=steps, u=voltage[:, None], y=y), load


def test_it_is_read_and_written() -> None:
    """It has no column, and comes back from the canonical text; its usual value may be stated."""
    graph = parse_model(MODEL)
    assert [item.name for item in graph.inputs] == ["V"]
    assert [(item.name, item.value) for item in graph.unknown_inputs] == [("load", 0.0)]
    assert dump_model(parse_model(dump_model(graph))) == dump_model(graph)
    usual = parse_model(MODEL.replace("over 3 s", "over 3 s, usual: 2 N*m"))
    assert usual.unknown_inputs[0].value == 2.0
    assert "usual: 2 N*m" in dump_model(usual)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("unknown: 0.6 N*m over 3 s, column: m", r"input load: column: nobody measures it, as `unknown` says"),
        ("unknown: 0.6 N*m over 3 s, suspect: yes", r"input load: suspect: .* make it a parameter with a `wander`"),
        ("usual: 2 N*m", r"input load: usual: it goes with `unknown`"),
        ("unknown: 5 % over 3 s", r"input load: unknown: a part of 0 is nothing"),
        ("unknown: 5 V over 3 s", r"input load: unknown is in .*, but .* is expected"),
        ("unknown: 0.6 N*m", r"input load: unknown: .* write its standard deviation and its memory"),
    ],
)
def test_what_makes_no_sense_is_refused(text: str, message: str) -> None:
    """Errors name the input and say what was expected."""
    with pytest.raises(ModelError, match=message):
        parse_model(MODEL.replace("unknown: 0.6 N*m over 3 s", text))


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_a_load_that_nobody_measures_is_followed(seed: int) -> None:
    """The plant is quiet, and the load is known from current and speed; who says that there is none gets alarms."""
    samples, load = drive(seed)
    alarm, _, off = watched(Monitor(core(MODEL)), samples)
    assert alarm is None
    found = 0.6 * off[500:, 0]
    assert np.corrcoef(found, load[500:])[0, 1] > 0.9
    assert watched(Monitor(core(WITHOUT)), samples)[0] is not None


def test_a_fault_beside_it_is_found() -> None:
    """A winding with 60 % more resistance is found and named while the load goes its own way."""
    samples, _ = drive(4, 2600, resistance=1.6, at=2000)
    alarm, found, _ = watched(Monitor(core(MODEL)), samples)
    assert alarm is not None
    assert alarm.sample >= 2000
    assert found is not None
    (first,) = found.candidates[0].suspects
    assert first.parameter == "Ra"
    assert first.estimate == pytest.approx(1.6, rel=0.05)


def test_what_it_hides_is_not_testable() -> None:
    """Friction and inertia act as the load does, so data tell of the winding only; with the load measured, of all."""
    tested = {}
    for name, text in (("unknown", MODEL), ("known", KNOWN)):
        model = build_model(parse_model(text))
        reduced = reduce([generic_run(model)])
        suspects = [k for k, item in enumerate(model.plant.graph.parameters) if item.suspect]
        verdicts = judge(reduced, suspects, 1).verdicts
        tested[name] = {model.plant.graph.parameters[v.parameters[0]].name for v in verdicts if v.identifiable}
    assert tested == {"unknown": {"Ra"}, "known": {"Ra", "J", "d"}}
    spec = core(MODEL).spec
    assert [[spec.parameters[k].name for k in item] for item in spec.hypotheses] == [["Ra"]]


def test_analyse_says_so(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """`analyse` tells that faults of rotor and bearing cannot be seen."""
    path = tmp_path / "drive.yaml"
    path.write_text(MODEL)
    assert main(["analyse", str(path), "--json", str(tmp_path / "found.jsonl")]) == DONE
    (found,) = map(json.loads, (tmp_path / "found.jsonl").read_text().splitlines())
    assert found["detectable"] == {"Ra": True, "J": False, "d": False}
    smallest = found["smallest_fault"]
    assert list(smallest)[:3] == [name for name in ("Ra", "J", "d") if name in smallest]
    assert {name: smallest[name]["value"] is None for name in ("Ra", "J", "d")} == {"Ra": False, "J": True, "d": True}
    assert smallest["d"]["reason"] == "what load may do hides it"
    assert "Traceback" not in capsys.readouterr().err


def test_simulated_it_moves() -> None:
    """Asked for, the load goes as far and as long as declared; else it stays at its usual value."""
    graph = parse_model(MODEL)
    time = np.arange(0.0, 120.0, STEP)
    inputs = Inputs(time=time, values=np.full((time.size, 1), 12.0))
    usual, moving = (simulate(graph, inputs, noise=False, effects=Effects(wander=on)) for on in (False, True))
    assert usual.parameters.shape == moving.parameters.shape == (time.size, len(graph.parameters))
    assert np.std(usual.outputs[1000:, 1]) < 1e-3
    friction = FRICTION + CONSTANT**2 / RESISTANCE
    assert np.std(moving.outputs[1000:, 1]) == pytest.approx(0.6 / friction, rel=0.5)


def test_the_thesis_method_refuses_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    """Method `classic` knows no unknown input, and says which one the model has."""
    path, recording = tmp_path / "drive.yaml", tmp_path / "rows.csv"
    path.write_text(MODEL)
    recording.write_text("time,V,i,w\n" + "".join(f"{0.02 * k},12,1,1\n" for k in range(50)))
    assert main(["run", str(path), str(recording), "--method", "classic"]) != DONE
    assert "knows no unknown input, and load is one" in capsys.readouterr().err
