"""Trajectories by backward Euler and their derivatives."""

from collections.abc import Callable, Sequence
from fractions import Fraction

import numpy as np
import pytest

from faultbond.analysis.sensitivity import Experiment, Sensitivity, build_recursion, sensitivities, sensitivity
from faultbond.arrays import FloatArray
from faultbond.equations.step import StepModel
from faultbond.errors import StructureError
from faultbond.model.graph import Input, Sensor
from plants import circuit, example, run, stated

LEAK = (
    "K6: {nominal: 1.04e-5 m^3/s, change: 1000 %}",
    "K6: {nominal: 0 m^3/s, accuracy: 1e-6 m^3/s, change: 2e-5 m^3/s}",
)

ROOM = """
name: room
sample_time: 60 s
inputs: {outside: {unit: degC}, heat: {unit: W}}
components:
  weather: {type: Se, law: e = outside}
  heater: {type: Sf, law: f = heat}
  wall: {type: R, parameters: {R: 20 mK/W}}
  room: {type: C, parameters: {C: 200 kJ/K}}
junctions: {through: 1, inside: 0}
bonds: [weather -> through -> wall, through -> inside -> room, heater -> inside]
sensors: {air: {reads: inside.e, unit: degC, noise: 0.1 K}, loss: {reads: through.f, unit: W, noise: 5 W}}
"""


def rectifier(knee: float = 1.0) -> StepModel:
    """A diode, a resistor and a capacitor in series: the current has no closed form."""
    return circuit(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  C: {type: C, parameters: {C: 10 mF}}\n"
        "  D: {type: R, law: f = Is*(exp(e/knee) - 1), parameters: {Is: 1 mA}}",
        "line: 1",
        "source -> line -> R, line -> D, line -> C",
        "i: {reads: line.f, unit: A, noise: 1 mA}",
        extra=f"constants: {{knee: {knee} V}}\n",
    )


def test_the_motor_follows_the_exact_recursion() -> None:
    """The speed of the motor at rest under five voltages is that of exact rational arithmetic (G1)."""
    wanted = ["25/39", "6685/6084", "1442965/949104", "198611245/148060224", "35677432645/23097394944"]
    voltages = np.array([0.0, 10.0, 4.0, 6.0, -2.0, 8.0])  # the first is not used: it acts on no step
    found = run(example("dc_motor"), voltages, 0.5, [0.0, 0.0])
    assert found.y[1:, 0] == pytest.approx([float(Fraction(text)) for text in wanted], rel=1e-14)


def case(name: str) -> tuple[StepModel, FloatArray, FloatArray, float]:
    """A plant with inputs that jump, its start and its step."""
    rng = np.random.default_rng(1)
    match name:
        case "tank":
            return example("tank", LEAK), rng.uniform(20, 90, (12, 2)), np.array([0.04]), 60.0
        case "motor":
            return example("dc_motor_current"), rng.uniform(-9, 9, (12, 1)), np.array([1.0, -2.0]), 0.3
        case "room":
            return stated(ROOM), rng.uniform([263.0, 100.0], [293.0, 900.0], (12, 2)), np.array([5.8e7]), 600.0
    return rectifier(), rng.uniform(-2, 5, (12, 1)), np.array([0.01]), 0.05


def slopes(function: Callable[[FloatArray], FloatArray], at: FloatArray, steps: FloatArray) -> FloatArray:
    """Central differences, extrapolated once; the changed number is the last axis."""
    found = []
    for k, step in enumerate(steps):
        move = np.zeros(len(at))
        move[k] = 1e-3 * step
        coarse = (function(at + move) - function(at - move)) / 2e-3
        fine = (function(at + move / 2) - function(at - move / 2)) / 1e-3
        found.append((4 * fine - coarse) / 3)
    return np.stack(found, axis=-1)


@pytest.mark.parametrize("name", ["tank", "motor", "rectifier"])
def test_derivatives_are_those_of_the_trajectory(name: str) -> None:
    """Derivatives by parameters and start equal differences of trajectories, also through an implicit relation."""
    model, inputs, start, dt = case(name)
    theta = np.array([item.nominal for item in model.plant.graph.parameters])
    found = run(model, inputs, dt, start)
    by_theta = slopes(lambda value: run(model, inputs, dt, start, value).y, theta, found.steps)
    by_start = slopes(lambda value: run(model, inputs, dt, value).y, start, np.abs(start)) / np.abs(start)
    for mine, wanted in ((found.by_theta, by_theta), (found.by_start, by_start)):
        size = np.abs(wanted).max(axis=(0, 1))
        assert size.min() > 0
        assert np.all(np.abs(mine - wanted).max(axis=(0, 1)) <= 1e-6 * size)


@pytest.mark.parametrize("name", ["tank", "motor", "rectifier", "room"])
@pytest.mark.parametrize("onset", [0, 5])
def test_derivatives_by_instruments_are_those_of_what_is_recorded(name: str, onset: int) -> None:
    """A bias of a sensor adds its noise, of an input its largest value less acts; a gain multiplies it in its unit."""
    model, inputs, start, dt = case(name)
    graph, (n, n_u) = model.plant.graph, inputs.shape
    plain = run(model, inputs, dt, start)
    experiment = Experiment(
        start=start,
        inputs=inputs,
        dt=np.append(0.0, np.diff(plain.times)),
        theta=plain.theta,
        implicit=np.zeros(model.plant.z.numel()),
        onset=onset,
    )
    (found,) = sensitivities(build_recursion(model.plant), [experiment], instruments=True)
    assert found is not None
    there, zeros = (np.arange(n) >= onset)[:, None], np.array([item.unit.offset for item in graph.inputs])
    largest = np.abs(inputs).max(axis=0)

    def acting(size: FloatArray) -> FloatArray:
        bias, gain = size[:n_u], size[n_u:]
        return run(model, inputs + there * (-bias * largest + gain * (inputs - zeros)), dt, start).y

    wanted = slopes(acting, np.zeros(2 * n_u), np.ones(2 * n_u))
    first, n_y = len(graph.parameters), len(graph.sensors)
    kinds: list[tuple[Sequence[Sensor | Input], str]] = [
        (graph.sensors, "bias"),
        (graph.inputs, "bias"),
        (graph.inputs, "gain"),
    ]
    assert found.parameters[first:] == tuple(f"{item.name}.{word}" for of, word in kinds for item in of)
    assert found.steps[first:].tolist() == [*(item.noise for item in graph.sensors), *largest, *np.ones(n_u)]
    assert found.theta[first:].tolist() == [0.0] * (n_y + n_u) + [1.0] * n_u
    shown = there[:, :, None] * np.diag([item.noise for item in graph.sensors])
    assert found.by_theta[:, :, first : first + n_y] == pytest.approx(shown)
    size = np.abs(wanted).max(axis=(0, 1))
    assert size.min() > 0
    assert np.all(np.abs(found.by_theta[:, :, first + n_y :] - wanted).max(axis=(0, 1)) <= 1e-6 * size)


def test_steps_of_parameters() -> None:
    """A parameter is changed by its value, or by its scale where the nominal is zero."""
    model, inputs, start, dt = case("tank")
    theta = np.array([item.nominal for item in model.plant.graph.parameters])
    found = run(model, inputs, dt, start, 1.1 * theta)
    wanted = dict(zip(found.parameters, 1.1 * theta, strict=True)) | {"K6": 2e-5}
    assert dict(zip(found.parameters, found.steps, strict=True)) == pytest.approx(wanted)


@pytest.mark.parametrize("knee", [1.0, 0.026])
@pytest.mark.parametrize("guess", [0.0, 500.0])
def test_the_readings_follow_the_laws(knee: float, guess: float) -> None:
    """Each sample satisfies the diode, steep or not, and the capacitor's step, also from a guess that leads nowhere."""
    model = rectifier(knee)
    inputs, dt = np.array([[0.1], [3.0], [-2.0], [5.0], [0.0], [1.0]]), 0.05
    steps = np.array([0.0, *[dt] * 5])
    theta = np.array([item.nominal for item in model.plant.graph.parameters])
    there = Experiment(
        start=np.array([1e-3]), inputs=inputs, dt=steps, theta=theta, implicit=np.array([guess] * model.z.numel())
    )
    found = sensitivity(build_recursion(model.plant), there)
    current, charge = found.y[:, 0], found.x[:, 0]
    drop = inputs[:, 0] - 10.0 * current - charge / 10e-3
    assert current == pytest.approx(1e-3 * np.expm1(drop / knee), rel=1e-9, abs=1e-15)
    assert np.diff(charge) == pytest.approx(dt * current[1:], rel=1e-9, abs=1e-15)
    assert charge[0] == 1e-3


def test_lanes_do_not_touch_one_another() -> None:
    """Runs side by side give what each gives alone, and one that blows up is None."""
    model, inputs, start, dt = case("motor")
    theta = np.array([item.nominal for item in model.plant.graph.parameters])
    steps = np.full(len(inputs), dt)
    steps[0] = 0.0
    several = [
        Experiment(start=begin, inputs=inputs, dt=steps, theta=theta, implicit=model.reference_implicit)
        for begin in (start, np.array([np.nan, 0.0]), -start)
    ]
    recursion = build_recursion(model.plant)
    found = sensitivities(recursion, several)
    assert found[1] is None
    for side, alone in ((found[0], several[0]), (found[2], several[2])):
        assert side is not None
        other = sensitivity(recursion, alone)
        for field in ("times", "x", "y", "by_theta", "by_start"):
            assert getattr(side, field) == pytest.approx(getattr(other, field), rel=1e-12)


def test_no_finite_solution() -> None:
    """A run without a finite solution is refused with the model's name."""
    with pytest.raises(StructureError, match="the equations of DC motor have no finite solution along this run"):
        run(example("dc_motor"), np.full(3, np.inf), 0.1, [0.0, 0.0])


def test_arrays_are_read_only() -> None:
    """No array of a sensitivity can be written to."""
    found: Sensitivity = run(example("rc"), np.ones(3), 0.1, [0.0])
    for name in ("times", "inputs", "x", "y", "theta", "steps", "by_theta", "by_start"):
        with pytest.raises(ValueError, match="read-only"):
            getattr(found, name)[...] = 0.0


@pytest.mark.parametrize("dt", [0.01, 1.0, 100.0])
def test_empty_tanks_in_a_row_fill(dt: float) -> None:
    """Between empty tanks a turbulent pipe has an endless slope; the step gets away from there, whatever its length."""
    pipes = "".join(
        f"  pipe{k}: {{type: R, law: e = R{k}*f*abs(f), parameters: {{R{k}: 2e11 V/A^2}}}}\n"
        f"  tank{k}: {{type: C, law: e = A{k}*q, parameters: {{A{k}: 1.3e5 V/A/s}}}}\n"
        for k in (1, 2, 3)
    )
    model = circuit(
        pipes,
        "l1: 1, n1: 0, l2: 1, n2: 0, l3: 1, n3: 0",
        "source -> l1 -> pipe1, l1 -> n1 -> tank1, n1 -> l2 -> pipe2, l2 -> n2 -> tank2, n2 -> l3 -> pipe3, "
        "l3 -> n3 -> tank3",
        "p: {reads: n3.e, unit: V, noise: 100 V}",
    )
    found = run(model, np.full(30, 5e4), dt, [0.0, 0.0, 0.0])
    levels = np.column_stack([np.full(30, 5e4), 1.3e5 * found.x])
    flows = np.sqrt(np.maximum(-np.diff(levels, axis=1), 0.0) / 2e11)
    rates = flows - np.column_stack([flows[:, 1:], np.zeros(30)])
    assert np.diff(found.x, axis=0)[3:] == pytest.approx(dt * rates[4:], rel=1e-3, abs=1e-9 * dt)
    assert (np.diff(found.x, axis=0) >= 0.0).all()
