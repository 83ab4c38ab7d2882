"""Plant simulation: against exact solutions, and the rules of inputs, faults, noise and imperfections."""

from pathlib import Path
from runpy import run_path

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.linalg import expm
from scipy.optimize import brentq

from faultbond.arrays import FloatArray
from faultbond.errors import ModelError, StructureError
from faultbond.io import parse_fault
from faultbond.model.graph import BondGraph
from faultbond.model.text import load_model, parse_model
from faultbond.simulate import Decide, Effects, Fault, Inputs, Policy, columns, fault_in_si, random_steps, simulate
from faultbond.simulate.integrate import Integrator
from faultbond.simulate.truth import healthy_parameters

EXAMPLES = Path(__file__).parents[2] / "examples"


@pytest.fixture
def motor() -> BondGraph:
    """The DC motor."""
    return load_model(EXAMPLES / "dc_motor_current" / "model.yaml")


@pytest.fixture
def tank() -> BondGraph:
    """The water tank."""
    return load_model(EXAMPLES / "tank" / "model.yaml")


def model(folder: Path, text: str) -> BondGraph:
    """Load a model from its text."""
    path = folder / "model.yaml"
    path.write_text(text, encoding="utf-8")
    return load_model(path)


def circuit(folder: Path, components: str, bonds: str, sensors: str, junctions: str = "{loop: 1}") -> BondGraph:
    """Load an electric circuit with a voltage source V and sensors read without noise, 100 samples per second."""
    return model(
        folder,
        "name: circuit\nsample_time: 10 ms\ninputs: {V: {unit: V}}\ncomponents:\n"
        f"  source: {{type: Se, law: e = V}}\n{components}\njunctions: {junctions}\n"
        f"bonds: [{bonds}]\nsensors: {{{sensors}}}\n",
    )


def held(matrix: FloatArray, column: FloatArray, u: FloatArray, step: float, start: FloatArray) -> FloatArray:
    """Give the exact states of dx/dt = matrix x + column u for an input that is held from row to row."""
    n = len(start)
    block = np.zeros((n + 1, n + 1))
    block[:n, :n], block[:n, n] = matrix, column
    exact = expm(block * step)
    states = [start]
    for value in u[:-1]:
        states.append(exact[:n, :n] @ states[-1] + exact[:n, n] * value)
    return np.array(states)


def grid(rows: int, seconds: float) -> FloatArray:
    """Give equal steps of time from 0."""
    return np.asarray(np.arange(rows) * seconds, dtype=np.float64)


def steps(rows: int, seconds: float, low: float = 2.0, high: float = 12.0) -> Inputs:
    """Give one input of random steps."""
    time = grid(rows, seconds)
    generator = np.random.default_rng(3)
    values = random_steps(time, generator, low=low, high=high, shortest=20 * seconds, longest=80 * seconds)
    return Inputs(time=time, values=values[:, None])


def test_motor_follows_the_matrix_exponential(motor: BondGraph) -> None:
    """States of a linear plant are exact to eight digits, which also proves the zero-order hold."""
    inputs = steps(2000, 0.02)
    made = simulate(motor, inputs, seed=None)
    R, L, K, J, C = (motor.parameter(name).nominal for name in "RLKJC")
    matrix = np.array([[-R / L, -K / J], [K / L, -C / J]])  # momenta of L and J
    exact = held(matrix, np.array([1.0, 0.0]), inputs.values[:, 0], 0.02, np.zeros(2))
    assert made.state_names == ("L.p", "J.p")
    np.testing.assert_allclose(made.states, exact, rtol=0, atol=1e-8 * np.abs(exact).max())
    np.testing.assert_allclose(made.outputs, exact[:, ::-1] / [J, L], rtol=0, atol=1e-7)


def test_step_fault_between_rows_is_exact(motor: BondGraph) -> None:
    """A resistance that doubles in the middle of a sample acts from that moment."""
    time = np.array([0.0, 1.0, 2.0])
    made = simulate(
        motor, Inputs(time=time, values=np.full((3, 1), 8.0)), [Fault(parameter="R", factor=2, start=1.3)], seed=None
    )
    R, L, K, J, C = (motor.parameter(name).nominal for name in "RLKJC")
    state = np.zeros(3)
    state[2] = 8.0
    for resistance, seconds in ((R, 1.3), (2 * R, 0.7)):
        matrix = np.array([[-resistance / L, -K / J, 1.0], [K / L, -C / J, 0.0], [0.0, 0.0, 0.0]])
        state = expm(matrix * seconds) @ state
    np.testing.assert_allclose(made.states[2], state[:2], rtol=1e-8)
    assert made.parameters[:, 0].tolist() == [R, R, 2 * R]


def test_stiff_plant_follows_the_matrix_exponential(tmp_path: Path) -> None:
    """A mode ten thousand times faster than the sample time dies out, and the slow one is exact."""
    graph = circuit(
        tmp_path,
        "  R: {type: R, parameters: {R: 10 kohm}}\n  L: {type: I, parameters: {L: 10 mH}}\n"
        "  C: {type: C, parameters: {C: 10 uF}}",
        "source -> loop -> R, loop -> L, loop -> C",
        "v: {reads: C.e, unit: V, noise: 1 mV}",
    )
    inputs = steps(300, 0.01)
    made = simulate(graph, inputs, seed=None)
    matrix = np.array([[-1e4 / 1e-2, -1 / 1e-5], [1 / 1e-2, 0.0]])
    exact = held(matrix, np.array([1.0, 0.0]), inputs.values[:, 0], 0.01, np.zeros(2))
    assert made.error < 1e-8
    np.testing.assert_allclose(made.states / np.abs(exact).max(axis=0), exact / np.abs(exact).max(axis=0), atol=1e-8)


def test_a_kink_is_not_taken_for_stiffness(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """No method comes nearer than some 1e-6 where laws have kinks, and the implicit one takes ten times as long."""

    def radau(_: Integrator) -> None:
        pytest.fail("it is not stiff")

    monkeypatch.setattr(Integrator, "_radau", radau)
    graph = model(
        tmp_path,
        "name: rectifier\nsample_time: 10 ms\ninputs: {V: {unit: V, hold: linear}}\ncomponents:\n"
        "  source: {type: Se, law: e = V}\n  C: {type: C, parameters: {C: 20 mF}}\n"
        "  D: {type: R, law: 'f = max(e - e0, 0)/R', parameters: {R: 2 ohm, e0: 0.7 V}}\n"
        "  G: {type: R, law: f = e/Rp, parameters: {Rp: 3 ohm}}\njunctions: {loop: 1, node: 0}\n"
        "bonds: [source -> loop -> D, loop -> node -> C, node -> G]\n"
        "sensors: {v: {reads: C.e, unit: V, noise: 1 mV}}\n",
    )
    time = grid(400, 0.01)
    inputs = Inputs(time=time, values=(2.0 * np.sin(31.0 * time))[:, None])
    made = simulate(graph, inputs, seed=None)

    def rate(moment: float, state: FloatArray) -> FloatArray:
        across = np.interp(moment, time, inputs.values[:, 0]) - state / 20e-3
        return np.asarray(np.maximum(across - 0.7, 0.0) / 2.0 - state / 20e-3 / 3.0)

    exact = [np.zeros(1)]
    for k in range(399):
        span = (time[k], time[k + 1] - 1e-9)
        exact.append(solve_ivp(rate, span, exact[-1], rtol=1e-9, atol=1e-13, max_step=1e-3).y[:, -1])
    assert 1e-8 < made.error < 1e-5
    np.testing.assert_allclose(made.states, np.array(exact), atol=1e-5 * np.max(exact))


def test_tank_keeps_its_water(tank: BondGraph) -> None:
    """What is stored is what flowed in less what flowed out."""
    time = np.arange(0.0, 600.0)
    values = np.column_stack([np.full(time.size, 60.0), np.full(time.size, 40.0)])
    made = simulate(tank, Inputs(time=time, values=values), seed=None, start={"tank.q": 0.05})
    out = tank.parameter("K4").nominal * 40 + tank.parameter("K6").nominal
    flow = made.outputs[:, 0]  # the meter is exact at nominal K2, but for the smoothing of sqrt (1e-6)
    gained = np.sum(0.5 * (flow[1:] + flow[:-1])) - out * (time[-1] - time[0])
    np.testing.assert_allclose(made.states[-1, 0] - made.states[0, 0], gained, rtol=5e-6)
    np.testing.assert_allclose(made.outputs[:, 1], tank.parameter("K3").nominal * made.states[:, 0], rtol=1e-9)


def test_tank_flow_solves_the_pressure_balance(tank: BondGraph) -> None:
    """Pump, pipe, meter, valve and vessel balance at every row (thesis chapter 7)."""
    time = np.arange(0.0, 50.0)
    values = np.column_stack([np.linspace(10, 90, 50), np.full(50, 40.0)])
    made = simulate(tank, Inputs(time=time, values=values), seed=None, start={"tank.q": 0.05})
    K1, K2, K7, K8 = (tank.parameter(name).nominal for name in ("K1", "K2", "K7", "K8"))
    flow, pressure = made.outputs.T
    lost = (K1 + K2 + K7**2 * (100 - values[:, 0]) ** 4) * flow**2
    np.testing.assert_allclose(lost + pressure, K8, rtol=3e-6)  # sqrt is smoothed by 1e-6


def test_input_of_a_row_acts_from_that_row_on(tmp_path: Path) -> None:
    """A sensor that reads the input directly shows the value of its own row; a store shows it one row later."""
    graph = circuit(
        tmp_path,
        "  R: {type: R, parameters: {R: 1 ohm}}\n  C: {type: C, parameters: {C: 1 F}}",
        "source -> loop -> R, loop -> C",
        "i: {reads: loop.f, unit: A, noise: 1 mA}, v: {reads: C.e, unit: V, noise: 1 mV}",
    )
    values = np.zeros((5, 1))
    values[2] = 1.0
    made = simulate(graph, Inputs(time=np.arange(5.0), values=values), seed=None)
    np.testing.assert_allclose(made.outputs[:3], [[0, 0], [0, 0], [1, 0]], atol=1e-12)
    np.testing.assert_allclose(made.outputs[3, 1], 1 - np.exp(-1.0), rtol=1e-8)


def test_ramp_reaches_its_value(tank: BondGraph) -> None:
    """A ramp begins at the healthy value, is straight, and stays at its end."""
    time = np.arange(0.0, 100.0)
    values = np.tile([60.0, 40.0], (100, 1))
    fault = Fault(parameter="K1", value=4.45e11, start=20.5, end=60.5)
    made = simulate(tank, Inputs(time=time, values=values), [fault], seed=1, effects=Effects(spread=0.03))
    K1 = made.parameters[:, [item.name for item in tank.parameters].index("K1")]
    assert K1[0] != tank.parameter("K1").nominal
    np.testing.assert_allclose(K1[:21], K1[0], rtol=0)
    np.testing.assert_allclose(np.diff(K1[21:61]), (4.45e11 - K1[0]) / 40, rtol=1e-9)
    np.testing.assert_allclose(K1[61:], 4.45e11, rtol=1e-12)


def test_ramp_acts_as_it_is_reported(tmp_path: Path) -> None:
    """The charge behind a conductance that grows in a straight line is the integral of that line."""
    graph = model(
        tmp_path,
        "name: leak\nsample_time: 1 s\ncomponents:\n  pump: {type: Sf, law: f = Q, parameters: {Q: 1 m^3/s}}\n"
        "  tank: {type: C, parameters: {A: 1 m^2}, law: e = q/A}\njunctions: {node: 0}\n"
        "bonds: [pump -> node -> tank]\nsensors: {h: {reads: tank.q, unit: m^3, noise: 1 m^3}}\n",
    )
    inputs = Inputs(time=np.arange(11.0), values=np.zeros((11, 0)))
    made = simulate(graph, inputs, [Fault(parameter="Q", value=3.0, start=2.0, end=6.0)], seed=None)
    np.testing.assert_allclose(made.states[[2, 6, 10], 0], [2.0, 10.0, 22.0], rtol=1e-12)


def test_faults_of_one_parameter_follow_each_other(motor: BondGraph) -> None:
    """The second fault begins from where the first one has brought the parameter; factors are of the healthy value."""
    faults = [Fault(parameter="R", factor=1.0, start=6.0, end=8.0), Fault(parameter="R", factor=2.0, start=2.0)]
    made = simulate(motor, Inputs(time=np.arange(10.0), values=np.ones((10, 1))), faults, seed=None)
    assert made.parameters[:, 0].tolist() == [3, 3, 6, 6, 6, 6, 6, 4.5, 3, 3]


def test_fault_text_is_converted_to_si() -> None:
    """A value on the command line is in the model file's unit."""
    graph = load_model(EXAMPLES / "rc" / "model.yaml")
    assert fault_in_si(parse_fault("C=130@20"), graph).value == pytest.approx(130e-6)
    assert fault_in_si(parse_fault("C=x1.3@20..30"), graph) == Fault(parameter="C", factor=1.3, start=20.0, end=30.0)


@pytest.mark.parametrize(
    ("fault", "message"),
    [
        (Fault(parameter="k1", value=1.0, start=1.0), r"no parameter k1; did you mean K1\?"),
        (Fault(parameter="K1", start=1.0), "either a finite value or a finite factor"),
        (Fault(parameter="K1", value=1.0, factor=2.0, start=1.0), "either a finite value or a finite factor"),
        (Fault(parameter="K1", value=1.0, start=50.0), "begins at 50 s, but the last row is at 9 s"),
        (Fault(parameter="K1", value=1.0, start=5.0, end=4.0), "ends at 4 s, before it begins"),
    ],
)
def test_fault_that_cannot_be_is_refused(tank: BondGraph, fault: Fault, message: str) -> None:
    """A wrong fault is a ModelError that says what is wrong."""
    with pytest.raises(ModelError, match=message):
        simulate(tank, Inputs(time=np.arange(10.0), values=np.full((10, 2), 50.0)), [fault])


def test_wrong_inputs_and_starts_are_refused(tank: BondGraph) -> None:
    """Missing values, wrong shapes, unordered times and unknown states are ModelErrors."""
    time, values = np.arange(10.0), np.full((10, 2), 50.0)
    gap = values.copy()
    gap[4, 1] = np.nan
    with pytest.raises(ModelError, match=r"input u_out has no value at 4 s \(row 5\)"):
        simulate(tank, Inputs(time=time, values=gap))
    with pytest.raises(ModelError, match=r"shape \(10, 1\), expected \(rows, inputs\) = \(10, 2\)"):
        simulate(tank, Inputs(time=time, values=values[:, :1]))
    with pytest.raises(ModelError, match="increase from row to row"):
        simulate(tank, Inputs(time=time[::-1], values=values))
    with pytest.raises(ModelError, match=r"start of tanq\.q: no such state; did you mean tank\.q\?"):
        simulate(tank, Inputs(time=time, values=values), start={"tanq.q": 0.05})
    with pytest.raises(ModelError, match="a curve error is given for u_inn"):
        simulate(tank, Inputs(time=time, values=values), effects=Effects(curve={"u_inn": 0.03}))


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


def test_a_room_does_not_begin_at_absolute_zero() -> None:
    """A store of heat whose start nobody knows is refused, with the option to give; then it is as warm as told."""
    graph = parse_model(ROOM, file="room.yaml")
    inputs = Inputs(time=np.array([0.0, 60.0]), values=np.full((2, 1), 278.15))
    with pytest.raises(ModelError, match=r"T begins at -273\.15 degC.* start of room\.q .*`--start 'room\.q=\.\.\.'`"):
        simulate(graph, inputs, seed=None)
    warm = simulate(graph, inputs, seed=None, start={"room.q": 5e6 * 293.15})
    assert warm.outputs[0, 0] == pytest.approx(293.15)


def test_noise_has_the_declared_size(motor: BondGraph) -> None:
    """Sensors and inputs carry their declared noise, and the plant feels the true input."""
    inputs = steps(20000, 0.02)
    quiet, noisy = simulate(motor, inputs, seed=None), simulate(motor, inputs, seed=7)
    deviations = np.hstack([noisy.inputs - quiet.inputs, noisy.outputs - quiet.outputs])
    declared = np.array([0.16, 0.06, 0.02])
    # The sd of 20 000 samples has a relative sd of 0.5 %; five of these are 2.5 %.
    np.testing.assert_allclose(deviations.std(axis=0), declared, rtol=0.025)
    np.testing.assert_allclose(deviations.mean(axis=0) / declared, 0, atol=5 / np.sqrt(20000))
    np.testing.assert_array_equal(noisy.true_inputs, quiet.inputs)
    np.testing.assert_array_equal(noisy.states, quiet.states)


def test_same_seed_gives_the_same_bytes(motor: BondGraph) -> None:
    """A recording is decided by its seed, and a fault changes nothing before it begins."""
    inputs, effects = steps(500, 0.02), Effects(spread=0.015)
    one = simulate(motor, inputs, seed=5, effects=effects)
    two = simulate(motor, inputs, seed=5, effects=effects)
    other = simulate(motor, inputs, seed=6, effects=effects)
    fault = simulate(motor, inputs, [Fault(parameter="R", factor=2, start=5.0)], seed=5, effects=effects)
    assert one.outputs.tobytes() == two.outputs.tobytes()
    assert not np.array_equal(one.outputs, other.outputs)
    np.testing.assert_allclose(fault.outputs[:251], one.outputs[:251], rtol=0, atol=1e-9)
    assert np.abs(fault.outputs[300:] - one.outputs[300:]).max() > 0.1


def test_spread_stays_within_its_limits(motor: BondGraph) -> None:
    """Every parameter of a plant is off by at most the spread, each by another part."""
    nominal = np.array([item.nominal for item in motor.parameters])
    plants = [healthy_parameters(motor, 0.03, np.random.default_rng(seed)) for seed in range(50)]
    parts = np.array(plants) / nominal - 1
    assert 0.028 < np.abs(parts).max() <= 0.03
    assert np.unique(parts).size == parts.size


def test_lag_delays_inputs_with_a_settling(tank: BondGraph) -> None:
    """Behind a lag of 3 s the outlet follows 1 - exp(-t/3), so the volume lost in between is known."""
    time = np.arange(0.0, 60.0)
    values = np.tile([50.0, 20.0], (60, 1))
    values[10:, 1] = 60.0
    closed = {"start": {"tank.q": 0.05}, "seed": None}
    quick = simulate(tank, Inputs(time=time, values=values), **closed)  # type: ignore[arg-type]
    slow = simulate(tank, Inputs(time=time, values=values), effects=Effects(lag=3.0), **closed)  # type: ignore[arg-type]
    late = tank.parameter("K4").nominal * 40.0 * 3.0
    np.testing.assert_allclose(slow.states[-1, 0] - quick.states[-1, 0], late, rtol=0.02)
    np.testing.assert_array_equal(slow.inputs, quick.inputs)


def test_curve_bends_inputs_in_percent(tank: BondGraph) -> None:
    """An opening of 25 % with a curve error of 4 % acts as 26 %; half open acts as half open."""
    time = np.arange(0.0, 10.0)
    for opening, acting in ((25.0, 26.0), (50.0, 50.0), (75.0, 72.0)):
        shown, true = (np.tile([opening, 40.0], (10, 1)), np.tile([acting, 40.0], (10, 1)))
        bent = simulate(tank, Inputs(time=time, values=shown), seed=None, effects=Effects(curve={"u_in": 0.04}))
        straight = simulate(tank, Inputs(time=time, values=true), seed=None)
        np.testing.assert_allclose(bent.outputs, straight.outputs, rtol=1e-9, atol=1e-9)
        np.testing.assert_array_equal(bent.inputs, shown)


def test_policy_sees_the_row_before(motor: BondGraph) -> None:
    """A controller gets the readings of the row before; its inputs simulated as known inputs give the same outputs."""
    time = grid(400, 0.02)
    seen: list[FloatArray] = []

    def begin() -> Decide:
        seen.clear()

        def decide(_: float, outputs: FloatArray) -> list[float]:
            seen.append(outputs.copy())
            return [12.0 if not outputs[0] > 2.0 else 0.0]

        return decide

    made = simulate(motor, Policy(time=time, begin=begin), seed=4)
    again = simulate(motor, Inputs(time=time, values=made.true_inputs), seed=4)
    assert np.all(np.isnan(seen[0]))
    np.testing.assert_allclose(np.array(seen[1:]), made.outputs[:-1], rtol=0, atol=1e-7)
    np.testing.assert_array_equal(again.outputs, made.outputs)
    assert set(made.true_inputs[:, 0]) == {0.0, 12.0}


def test_policy_with_a_lag_equals_known_inputs(tank: BondGraph) -> None:
    """Lag, curve and fault act alike whether inputs are known or decided on the way."""
    time = np.arange(0.0, 200.0)
    effects = Effects(spread=0.03, lag=3.0, curve=0.03)
    fault = [Fault(parameter="K6", value=8e-5, start=100.5)]

    def decide(moment: float, _: FloatArray) -> list[float]:
        return [30.0 + 40.0 * (moment > 50), 40.0]

    values = np.array([decide(moment, time) for moment in time])
    decided = simulate(tank, Policy(time=time, begin=lambda: decide), fault, effects=effects, start={"tank.q": 0.05})
    known = simulate(tank, Inputs(time=time, values=values), fault, effects=effects, start={"tank.q": 0.05})
    np.testing.assert_array_equal(decided.outputs, known.outputs)


def test_policy_must_give_every_input(tank: BondGraph) -> None:
    """A policy that gives too few or not finite inputs is a ModelError."""
    with pytest.raises(ModelError, match="expected 2 finite inputs"):
        simulate(tank, Policy(time=np.arange(3.0), begin=lambda: lambda *_: [50.0]))


def test_inertias_coupled_by_a_transformer(tmp_path: Path) -> None:
    """Two inertias behind a gear are one: J1 + n^2 J2 with n = speed of J2 over speed of J1 (derivative causality)."""
    graph = model(
        tmp_path,
        "name: gear\nsample_time: 0.1 s\ninputs: {T: {unit: N*m}}\ncomponents:\n"
        "  drive: {type: Se, law: e = T}\n  J1: {type: I, parameters: {J1: 2 kg*m^2}}\n"
        "  gear: {type: TF, parameters: {n: 3}}\n  J2: {type: I, parameters: {J2: 0.5 kg*m^2}}\n"
        "  D: {type: R, parameters: {D: 0.2 N*m*s/rad}}\njunctions: {fast: 1, slow: 1}\n"
        "bonds: [drive -> fast -> J1, fast -> gear -> slow -> J2, slow -> D]\n"
        "sensors:\n  w1: {reads: fast.f, unit: rad/s, noise: 1 rad/s}\n"
        "  w2: {reads: slow.f, unit: rad/s, noise: 1 rad/s}\n",
    )
    inputs = steps(300, 0.1)
    made = simulate(graph, inputs, seed=None)
    inertia, damping = 2.0 + 9.0 * 0.5, 9.0 * 0.2
    exact = held(np.array([[-damping / inertia]]), np.array([1 / inertia]), inputs.values[:, 0], 0.1, np.zeros(1))
    np.testing.assert_allclose(made.outputs, np.hstack([exact, 3 * exact]), rtol=0, atol=1e-8 * np.abs(exact).max())


def test_diode_loop_is_solved_to_convergence(tmp_path: Path) -> None:
    """An exponential law in series with a resistor has no closed form; the current is that of a bracketing solver."""
    graph = circuit(
        tmp_path,
        "  R: {type: R, parameters: {R: 100 ohm}}\n"
        "  D: {type: R, law: 'f = Is*(exp(e/Vt) - 1)', parameters: {Is: 1e-9 A, Vt: 0.05 V}}",
        "source -> loop -> R, loop -> D",
        "i: {reads: loop.f, unit: A, noise: 1 mA}",
    )
    time = grid(200, 0.01)
    voltage = 5 * np.sin(6 * time)
    made = simulate(graph, Inputs(time=time, values=voltage[:, None]), seed=None)

    def current(total: float) -> float:
        across = brentq(lambda e: total - 100e-9 * np.expm1(e / 0.05) - e, -6, 1, xtol=1e-15)
        return 1e-9 * float(np.expm1(across / 0.05))

    np.testing.assert_allclose(made.outputs[:, 0], [current(total) for total in voltage], rtol=1e-9, atol=1e-15)


def test_diode_charges_a_capacitor(tmp_path: Path) -> None:
    """A store behind an implicit loop: charge and integral of the current agree, and a diode lets nothing back."""
    graph = circuit(
        tmp_path,
        "  R: {type: R, parameters: {R: 100 ohm}}\n  C: {type: C, parameters: {C: 1 mF}}\n"
        "  D: {type: R, law: 'f = Is*(exp(e/Vt) - 1)', parameters: {Is: 1e-9 A, Vt: 0.05 V}}",
        "source -> loop -> R, loop -> D, loop -> C",
        "i: {reads: loop.f, unit: A, noise: 1 mA}, v: {reads: C.e, unit: V, noise: 1 mV}",
    )
    time = grid(400, 0.001)
    voltage = np.where(time < 0.2, 5.0, 0.0)
    made = simulate(graph, Inputs(time=time, values=voltage[:, None]), seed=None)
    current, stored = made.outputs.T
    half = slice(0, 200)
    moved = np.sum(0.5 * (current[half][1:] + current[half][:-1])) * 0.001
    np.testing.assert_allclose(stored[199] * 1e-3, moved, rtol=1e-4)
    np.testing.assert_allclose(stored[399], stored[200] - 1e-9 * 0.199 / 1e-3, rtol=1e-9)
    assert made.error < 1e-6


def test_plant_that_explodes_is_refused(tmp_path: Path) -> None:
    """A state that grows without limit in finite time is a StructureError, not a recording of nan."""
    graph = model(
        tmp_path,
        "name: runaway\nsample_time: 1 s\ncomponents:\n  feed: {type: Sf, law: f = k*tank.q**2, "
        "parameters: {k: 1 m^-3/s}}\n  tank: {type: C, parameters: {A: 1 m^2}, law: e = q/A}\njunctions: {node: 0}\n"
        "bonds: [feed -> node -> tank]\nsensors: {h: {reads: tank.q, unit: m^3, noise: 1 m^3}}\n",
    )
    with pytest.raises(StructureError, match="cannot be integrated"):
        simulate(graph, Inputs(time=np.arange(5.0), values=np.zeros((5, 0))), start={"tank.q": 1.0})


def test_columns_are_in_the_units_of_the_model(tmp_path: Path) -> None:
    """Columns carry the headers and units of the model file, time first, with the digits asked for."""
    graph = circuit(
        tmp_path,
        "  R: {type: R, parameters: {R: 3 ohm}}",
        "source -> loop -> R",
        "i: {reads: loop.f, unit: mA, noise: 1 mA, column: current}",
    )
    made = simulate(graph, Inputs(time=np.array([5.0, 6.0]), values=np.array([[1.0], [2.0]])), seed=None)
    table = columns(graph, made, digits=4)
    assert list(table) == ["time", "V", "current"]
    assert table["current"].tolist() == [333.3, 666.7]
    assert table["time"].tolist() == [5.0, 6.0]


def test_recording_cannot_be_changed(motor: BondGraph) -> None:
    """Arrays of a simulation are read-only."""
    made = simulate(motor, steps(10, 0.02))
    with pytest.raises(ValueError, match="read-only"):
        made.outputs[0, 0] = 1.0


@pytest.mark.parametrize("name", ["tank", "dc_motor", "dc_motor_current", "rc", "rlc"])
def test_example_recordings_are_those_of_their_script(name: str) -> None:
    """The healthy recording of an example is what its script makes."""
    script = EXAMPLES / name / f"make_{name}.py"
    module = run_path(str(script))
    graph = load_model(EXAMPLES / name / "model.yaml")
    table = columns(graph, module["record"](graph, seed=1), digits=6)
    with (EXAMPLES / name / "healthy.csv").open(encoding="utf-8") as stream:
        assert stream.readline().strip().split(",") == list(table)
        stored = np.loadtxt(stream, delimiter=",")
    made = np.column_stack(list(table.values()))
    size = np.abs(made).max(axis=0)
    np.testing.assert_allclose(stored / size, made / size, rtol=0, atol=2e-5)


TIME = np.arange(0.0, 10.0, 0.02)


def test_without_noise_the_plant_is_the_same(motor: BondGraph) -> None:
    """Instruments show what is, of the plant that the seed gives, with its faults."""
    inputs = Inputs(time=TIME, values=np.full((len(TIME), 1), 6.0))
    fault = Fault(parameter="R", factor=1.5, start=TIME[len(TIME) // 2])
    effects = Effects(spread=0.05)
    quiet = simulate(motor, inputs, [fault], seed=4, noise=False, effects=effects)
    noisy = simulate(motor, inputs, [fault], seed=4, effects=effects)
    assert np.array_equal(quiet.parameters, noisy.parameters)
    assert np.array_equal(quiet.states, noisy.states)
    assert np.array_equal(quiet.inputs, inputs.values)
    assert not np.array_equal(noisy.inputs, inputs.values)
    plain = simulate(motor, inputs, [fault], seed=4, noise=False)
    assert np.array_equal(plain.outputs, simulate(motor, inputs, [fault], seed=None).outputs)
    assert not np.array_equal(plain.outputs, quiet.outputs)


def test_noise_is_no_fault_without_noise(motor: BondGraph) -> None:
    """A sensor that is to scatter where nothing does is refused."""
    inputs = Inputs(time=TIME, values=np.full((len(TIME), 1), 6.0))
    with pytest.raises(ModelError, match=r"omega\.noise without noise shows nothing; leave out one of the two"):
        simulate(motor, inputs, [Fault(parameter="omega.noise", factor=3.0, start=TIME[1])], noise=False)
