"""The discrete-time step: order, damping, slopes and the iteration of implicit relations."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import (
    MAX_SUBSTEPS,
    StepModel,
    _passed_on,
    _usual_input,
    build_step_model,
    is_guessed,
    reference_inputs,
)
from faultbond.errors import StructureError
from faultbond.model.text import load_model, parse_model

EXAMPLES = Path(__file__).parents[3] / "examples"


LAGGING = """
name: lagging
sample_time: 1 s
inputs: {V: {unit: V, lag: {value: 1 s, accuracy: 10 %}}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C: {type: C, parameters: {C: 50 F}}
junctions: {loop: 1}
bonds: [source -> loop -> R, loop -> C]
sensors: {v: {reads: C.e, unit: V, noise: 0.1 V}}
"""


def example(name: str) -> StepModel:
    """The step of a built-in plant."""
    return build_step_model(build_plant(load_model(EXAMPLES / name / "model.yaml")))


def stated(components: str, junctions: str, bonds: str, sample_time: str = "10 ms", extra: str = "") -> StepModel:
    """The step of a plant with one input V and a sensor of the flow `line.f`."""
    text = (
        f"name: plant\nsample_time: {sample_time}\ninputs: {{V: {{unit: V}}}}\n{extra}components:\n"
        f"  source: {{type: Se, law: e = V}}\n{components}\njunctions: {{{junctions}}}\nbonds: [{bonds}]\n"
        "sensors: {i: {reads: line.f, unit: A, noise: 1 mA}}\n"
    )
    return build_step_model(build_plant(parse_model(text)))


def rectifier(knee: str = "1 V") -> StepModel:
    """A diode, a resistor of 10 ohm and a capacitor in series: the current has no closed form."""
    return stated(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  C: {type: C, parameters: {C: 10 mF}}\n"
        "  D: {type: R, law: f = Is*(exp(e/knee) - 1), parameters: {Is: 1 mA}}",
        "line: 1",
        "source -> line -> R, line -> D, line -> C",
        extra=f"constants: {{knee: {knee}}}\n",
    )


def nominal(model: StepModel, *states: float) -> FloatArray:
    """Joint vector with these states, no slow error and no input noise, and nominal parameters."""
    v = np.zeros(model.v.numel())
    v[: len(states)] = states
    first = len(model.states) + model.plant.b.numel()
    v[first : first + len(model.plant.graph.parameters)] = [
        0.0 if item.nominal == 0.0 else 1.0 for item in model.plant.graph.parameters
    ]
    return v


def run(model: StepModel, v: FloatArray, u: list[float], seconds: float, steps: int) -> FloatArray:
    """States after some equal steps."""
    v, z = v.copy(), model.reference_implicit
    for _ in range(steps):
        x, _, solved = model.predict(v, u, z, seconds / steps)
        v[: len(model.states)], z = x.full()[:, 0], solved.full()[:, 0]
    return v[: len(model.states)]


def motor_rates(_t: float, x: FloatArray) -> list[float]:
    """Rates of current and speed of the motor of the examples at 7 V."""
    R, L, K, J, C = 3.0, 2.5, 2.0, 1.5, 0.4
    return [(7.0 - R * x[0] - K * x[1]) / L, (K * x[0] - C * x[1]) / J]


def tank_rates(_t: float, x: FloatArray) -> list[float]:
    """Rate of the pressure of the tank of the examples with both valves at 70 % and 60 %."""
    flow = np.sqrt((64650.0 - x[0]) / (2.41e11 + 5.08e11 + 255.0**2 * 30.0**4))
    return [1.3e5 * (flow - 2.35e-6 * 60.0 - 1.04e-5)]


@pytest.mark.parametrize(
    ("name", "rates", "u", "start", "seconds"),
    [
        ("dc_motor_current", motor_rates, [7.0], [0.5, -1.0], 2.0),
        ("tank", tank_rates, [70.0, 60.0], [2000.0], 3000.0),
    ],
)
def test_error_falls_by_four_when_the_step_is_halved(
    name: str, rates: Callable[[float, FloatArray], list[float]], u: list[float], start: list[float], seconds: float
) -> None:
    """The step is of second order: half the step, a quarter of the distance to the exact solution."""
    model = example(name)
    exact = solve_ivp(rates, (0.0, seconds), start, rtol=1e-12, atol=1e-12, method="DOP853").y[:, -1]
    errors = [np.linalg.norm(run(model, nominal(model, *start), u, seconds, n) - exact) for n in (8, 16, 32)]
    assert errors[0] < 0.1 * np.linalg.norm(exact - start)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.25)
    assert errors[1] / errors[2] == pytest.approx(4.0, rel=0.15)


@pytest.mark.parametrize("voltage", [5.0, 0.0, -5.0])
def test_fast_modes_die_out(voltage: float) -> None:
    """A coil a thousand times faster than the sample time is at rest after one step, without overshoot or ringing."""
    model = stated(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  L: {type: I, parameters: {L: 10 mH}}",
        "line: 1",
        "source -> line -> R, line -> L",
        sample_time="1 s",
    )
    assert model.substeps == MAX_SUBSTEPS
    start, final = 1.0, voltage / 10.0
    v = nominal(model, start)
    for _ in range(3):
        v[0] = float(model.predict(v, [voltage], model.reference_implicit, 1.0)[0])
        assert abs(v[0] - final) < 1e-3 * abs(start - final)
        assert (v[0] - final) * (start - final) >= -1e-9


def test_damping_grows_with_stiffness() -> None:
    """The stiffer a mode, the less of it is left after a step (the trapezoidal rule would leave all, sign reversed)."""
    left = []
    for inductance in ("10 mH", "1 mH", "0.1 mH"):
        model = stated(
            f"  R: {{type: R, parameters: {{R: 10 ohm}}}}\n  L: {{type: I, parameters: {{L: {inductance}}}}}",
            "line: 1",
            "source -> line -> R, line -> L",
        )
        left.append(abs(float(model.predict(nominal(model, 1.0), [0.0], model.reference_implicit, 100.0)[0])))
    assert left[0] < 1e-3
    assert left[2] < left[1] < left[0]


def test_no_time_no_change() -> None:
    """A step of no time leaves the state to the last bit, and its slope is that of the state by itself."""
    for model in (example("tank"), example("dc_motor_current"), rectifier()):
        n = len(model.states)
        v = nominal(model, *np.linspace(1.0, 2.0, n))
        u = np.full(model.u.numel(), 3.0)
        x, slope, _ = model.predict(v, u, model.reference_implicit, 0.0)
        assert np.array_equal(x.full()[:, 0], v[:n])
        assert np.array_equal(slope.full(), np.eye(n, v.size))


def differences(function: Callable[[FloatArray], FloatArray], v: FloatArray) -> FloatArray:
    """Slopes by central differences."""
    columns = []
    for k in range(v.size):
        move = np.zeros(v.size)
        move[k] = 1e-5 * max(1.0, abs(v[k]))
        columns.append((function(v + move) - function(v - move)) / (2.0 * move[k]))
    return np.array(columns).T


CYLINDER = """
name: cylinder
sample_time: 1 ms
inputs: {Q: {unit: m^3/s}}
components:
  pump: {type: Sf, law: f = Q}
  oil: {type: C, law: e = beta*q/(V + A*rod.q), parameters: {beta: 1e9 Pa, V: 1e-3 m^3}}
  piston: {type: TF, law: [e2 = A*e1, f1 = A*f2], parameters: {A: 10 cm^2}}
  mass: {type: I, parameters: {m: 100 kg}}
  spring: {type: C, law: e = k*q, parameters: {k: 50 kN/m}}
junctions: {chamber: 0, rod: 1}
bonds: [pump -> chamber -> oil, chamber -> piston -> rod -> mass, rod -> spring]
sensors: {p: {reads: chamber.e, unit: bar, noise: 0.1 bar}, x: {reads: READS, unit: mm, noise: 0.1 mm}}
"""


def test_a_store_that_a_sensor_reads_has_its_content_as_state() -> None:
    """A spring is estimated by its force, and by its deflection where that is measured."""
    by = {
        reads: build_step_model(build_plant(parse_model(CYLINDER.replace("READS", reads)))).states
        for reads in ("rod.q", "spring.q")
    }
    assert "spring.e" in by["rod.q"]
    assert "spring.q" in by["spring.q"]


@pytest.mark.parametrize("reads", ["rod.q", "spring.q"])
def test_a_lag_adds_a_state_and_leaves_the_others_as_they_are(reads: str) -> None:
    """What a sensor reads chooses the states; that it lags adds its own: `fit` passes on what it knows by state."""
    text = CYLINDER.replace("READS", reads)
    states = build_step_model(build_plant(parse_model(text))).states
    lagging = text.replace("noise: 0.1 mm}", "noise: 0.1 mm, lag: 5 ms}")
    assert build_step_model(build_plant(parse_model(lagging))).states == (*states, "x.lagged")


def test_pressure_over_a_volume_that_moves_is_a_state() -> None:
    """Oil whose volume depends on a position has the pressure as state, which moves with volume flow and piston."""
    model = build_step_model(build_plant(parse_model(CYLINDER.replace("READS", "rod.q"))))
    states = list(model.states)
    assert "chamber.e" in states
    p, f, x, Q = 40e5, 0.3, 0.02, 2e-4
    at = {"chamber.e": p, "rod.f": f, "rod.q": x, "spring.e": 900.0}
    v = nominal(model, *(at.get(name, f) for name in states))
    rates = dict(zip(states, model.rates(v, [Q], [])[0].full()[:, 0], strict=True))
    volume = 1e-3 + 1e-3 * x
    content = p * volume / 1e9
    moved = 1e9 * (content + 1e-6 * (Q - 1e-3 * f)) / (volume + 1e-3 * 1e-6 * f)
    assert rates["chamber.e"] == pytest.approx((moved - p) / 1e-6, rel=1e-5)
    assert rates["rod.q"] == pytest.approx(f)


PLACES = [("tank", (30000.0,), [70.0, 60.0]), ("dc_motor_current", (1.0, 2.0), [5.0]), ("rectifier", (0.3,), [3.0])]


def model_at(name: str, states: tuple[float, ...]) -> tuple[StepModel, FloatArray]:
    """A model and a joint vector where nothing is zero."""
    model = rectifier() if name == "rectifier" else example(name)
    v = nominal(model, *states)
    v[len(states) :] += 0.01 * np.arange(1, v.size - len(states) + 1)
    v[len(states) : parameters_of(model)[0]] = (
        0.0  # where parameters are concerned slopes are those without slow errors
    )
    return model, v


def parameters_of(model: StepModel) -> tuple[int, int]:
    """The places of the parameters in v, first and after the last."""
    first = len(model.states) + model.plant.b.numel()
    return first, first + model.plant.theta.numel()


def test_where_inputs_are_taken_to_be() -> None:
    """At three quarters of where they were, else of what they can be; half of a percentage; else at one unit."""
    stated = {
        "a": "unit: V, range: [-10 V, 30 V]",
        "b": "unit: V, range: [0 V, 30 V], fitted_range: [4 V, 8 V]",
        "c": "unit: percent",
        "d": "unit: kPa, range: [0 kPa, inf]",
    }
    graph = parse_model(
        "name: net\nsample_time: none\ninputs: {"
        + ", ".join(f"{name}: {{{text}}}" for name, text in stated.items())
        + "}\nblocks: {sum: {law: x = a + b + P*c + Q*d, parameters: {P: 1 V/percent, Q: 1 V/kPa}}}\n"
        "sensors: {y: {reads: x}}\n"
    )
    assert [_usual_input(item) for item in graph.inputs] == pytest.approx([20.0, 7.0, 50.0, 1000.0])
    assert [is_guessed(item) for item in graph.inputs] == [False, False, False, True]


def test_slopes_by_parameters_do_not_hold_the_slow_errors() -> None:
    """With slow errors at work values and other slopes change; the slopes by parameters are those without them."""
    model, v = model_at("tank", (30000.0,))
    u, z, (first, last) = reference_inputs(model.plant), model.reference_implicit, parameters_of(model)
    erring = v.copy()
    erring[len(model.states) : first] = 0.1
    for function in (model.rates, model.measure):
        calm, wild = (function(place, u, z) for place in (v, erring))
        (value, slope), (other, other_slope) = ((found[0].full(), found[1].full()) for found in (calm, wild))
        assert np.array_equal(slope[:, first:last], other_slope[:, first:last])
        if function is model.rates:
            assert np.any(value != other)
            assert np.any(slope[:, :first] != other_slope[:, :first])


@pytest.mark.parametrize(("name", "states", "u"), PLACES)
def test_slopes_of_readings_are_exact(name: str, states: tuple[float, ...], u: list[float]) -> None:
    """Slopes of the readings equal central differences, also through an implicit relation."""
    model, v = model_at(name, states)
    z = model.measure(v, u, model.reference_implicit)[2]
    _, slope, _ = model.measure(v, u, z)
    wanted = differences(lambda w: model.measure(w, u, z)[0].full()[:, 0], v)
    assert np.abs(slope.full() - wanted).max(axis=1) == pytest.approx(0.0, abs=1e-6 * np.abs(wanted).max())


@pytest.mark.parametrize(("name", "states", "u"), PLACES)
def test_slopes_of_rates_are_exact(name: str, states: tuple[float, ...], u: list[float]) -> None:
    """Slopes of the rates equal central differences, with the implicit signals solved anew at each of them."""
    model, v = model_at(name, states)

    def rates(w: FloatArray) -> FloatArray:
        solved = model.measure(w, u, model.reference_implicit)[2]
        return np.asarray(model.rates(w, u, solved)[0].full()[:, 0])

    solved = model.measure(v, u, model.reference_implicit)[2]
    wanted = differences(rates, v)
    size = np.abs(wanted).max(axis=1, keepdims=True)
    assert np.max(np.abs(model.rates(v, u, solved)[1].full() - wanted) / size) < 1e-6


@pytest.mark.parametrize(("name", "states", "u"), PLACES)
def test_slopes_of_the_step(name: str, states: tuple[float, ...], u: list[float]) -> None:
    """Slopes of the step equal central differences but for a part that falls with the third power of the step."""
    model, v = model_at(name, states)
    n, dt = len(states), model.plant.graph.sample_time
    assert dt is not None
    errors = []
    for part in (8.0, 4.0):

        def step(w: FloatArray, time: float = part * dt) -> FloatArray:
            return np.asarray(model.predict(w, u, model.reference_implicit, time)[0].full()[:, 0])

        slope = model.predict(v, u, model.reference_implicit, part * dt)[1].full()
        wanted = differences(step, v)
        size = np.abs(wanted).max(axis=1, keepdims=True)
        errors.append(float(np.max(np.abs(slope - wanted) / size)))
        assert np.max(np.abs(slope[:, :n] - wanted[:, :n])) < 1e-4 * np.max(np.abs(wanted[:, :n]))
    assert errors[1] < 1e-3
    assert errors[1] < max(errors[0] / 5.0, 1e-7)
    slope = model.predict(v, u, model.reference_implicit, dt)[1].full()
    wanted = differences(lambda w: model.predict(w, u, model.reference_implicit, dt)[0].full()[:, 0], v)
    assert np.max(np.abs(slope - wanted) / np.abs(wanted).max(axis=1, keepdims=True)) < 1e-5


def current_misfit(model: StepModel, knee: float, before: float, after: float) -> float:
    """Relative misfit of the diode's law in the first reading after a jump of the voltage."""
    v = nominal(model, 0.0)
    z = model.reference_implicit
    for _ in range(30):
        z = model.measure(v, [before], z)[2].full()[:, 0]
    current = float(model.measure(v, [after], z)[0])
    law = 1e-3 * (np.exp((after - 10.0 * current) / knee) - 1.0)
    return float(abs(current - law) / abs(current))


@pytest.mark.parametrize("after", [0.5, 1.0, 5.0, -5.0])
def test_iteration_follows_a_jump(after: float) -> None:
    """An implicit relation is satisfied at once after a jump of the input."""
    assert current_misfit(rectifier(), 1.0, 0.5, after) < 1e-10


@pytest.mark.parametrize("after", [1.0, 5.0])
def test_iteration_follows_a_jump_of_a_steep_diode(after: float) -> None:
    """The relation of a diode with the usual knee of 26 mV is satisfied at once after a jump of the input."""
    assert current_misfit(rectifier("26 mV"), 0.026, 0.1, after) < 1e-10


def test_iteration_stands_still_at_its_solution() -> None:
    """Solving again from the solution does not move it beyond rounding."""
    model = rectifier()
    v = nominal(model, 0.2)
    z = model.measure(v, [3.0], model.reference_implicit)[2]
    again = model.measure(v, [3.0], z)[2]
    assert float(again) == pytest.approx(float(z), rel=1e-12)


def unsolvable(law: str) -> StepModel:
    """A plant whose loop asks a resistor for less effort than it ever has."""
    return stated(
        f"  R: {{type: R, law: e = A*({law}), parameters: {{A: 1 V}}}}\n  C: {{type: C, parameters: {{C: 1 F}}}}",
        "line: 1",
        "source -> line -> R, line -> C",
        extra="constants: {I0: 1 A}\n",
    )


def test_relation_without_solution_is_refused() -> None:
    """A loop that has no real solution at nominal parameters is refused with its signals, when the model is built."""
    with pytest.raises(StructureError, match=r"no solution was found for the loop of .* at nominal parameters"):
        unsolvable("3 + sin(f/I0)")


@pytest.mark.parametrize("law", ["20 + f/I0 + (f/I0)**4", "10*(exp(f/I0) + exp(-f/I0))"])
def test_steep_relation_without_solution_is_refused(law: str) -> None:
    """A loop without real solution is refused however large its misfit is far away."""
    with pytest.raises(StructureError, match=r"no solution was found for the loop of .* at nominal parameters"):
        unsolvable(law)


def test_direct_inputs() -> None:
    """An input reaches a reading directly where no store stands between them."""
    assert example("dc_motor_current").direct == ((), ())
    assert example("tank").direct == ((0,), ())
    assert example("rlc").direct == ((0,),)
    assert rectifier().direct == ((0,),)


def test_coordinates_and_contents_are_inverse() -> None:
    """Efforts and flows as coordinates turn into contents and back for any parameters."""
    model = example("rlc")
    assert model.states == ("C.e", "L.f")
    theta = [0.04, 25.0, 4.0]
    names = [item.name for item in model.plant.graph.parameters]
    C, _, L = (theta[names.index(name)] for name in ("C", "R", "L"))
    x = [3.0, 0.2]
    contents = model.contents(x, theta).full()[:, 0]
    assert contents == pytest.approx([C * x[0], L * x[1]], rel=1e-12)
    assert model.coordinates(contents, theta).full()[:, 0] == pytest.approx(x, rel=1e-12)


def test_plant_of_two_sources_has_a_step() -> None:
    """One parameter and no state: the joint vector is a scalar and still passes."""
    model = build_step_model(
        build_plant(
            parse_model(
                "name: p\nsample_time: 1 s\ninputs: {V: {unit: V}}\ncomponents:\n  source: {type: Se, law: e = V}\n"
                "  sink: {type: Sf, law: f = Q, parameters: {Q: 3 A}}\njunctions: {line: 0}\n"
                "bonds: [source -> line, line -> sink]\nsensors: {i: {reads: sink.f, unit: A, noise: 1 mA}}\n"
            )
        )
    )
    assert model.measure([2.0], [5.0], [])[0] == 2.0 * 3.0


ROW_OF_TANKS = (
    "name: row\nsample_time: 1 s\ncomponents:\n  pump: {type: Se, law: e = P, parameters: {P: 50 kPa}}\n"
    + "".join(
        f"  pipe{k}: {{type: R, law: e = R{k}*f*abs(f), parameters: {{R{k}: 2e11 Pa*s^2/m^6}}}}\n"
        f"  tank{k}: {{type: C, law: e = A{k}*q, parameters: {{A{k}: 1.3e5 Pa/m^3}}}}\n"
        for k in (1, 2, 3)
    )
    + "junctions: {l1: 1, n1: 0, l2: 1, n2: 0, l3: 1, n3: 0}\n"
    "bonds: [pump -> l1 -> pipe1, l1 -> n1 -> tank1, n1 -> l2 -> pipe2, l2 -> n2 -> tank2, n2 -> l3 -> pipe3, "
    "l3 -> n3 -> tank3]\nsensors: {p: {reads: n3.e, unit: Pa, noise: 100 Pa}}\n"
)


def test_empty_tanks_in_a_row_fill() -> None:
    """Equal levels make a turbulent pipe's slope endless; the reference run leaves that start and the tanks fill."""
    model = build_step_model(build_plant(parse_model(ROW_OF_TANKS)))
    first, second, third = model.reference_state
    assert 5e4 > first > second > third > 0.0
    exact = solve_ivp(
        lambda _t, x: 1.3e5 * np.diff([-np.sqrt((5e4 - x[0]) / 2e11), *-np.sqrt((x[:-1] - x[1:]) / 2e11), 0.0]),
        (0.0, 100.0),
        [2.0, 1.0, 0.0],
        rtol=1e-8,
    ).y[:, -1]
    assert model.reference_state[:2] == pytest.approx(exact[:2], rel=0.1)
    assert model.substeps < MAX_SUBSTEPS


def test_a_start_without_a_finite_effort_is_left() -> None:
    """A gas spring that is empty at the start has an endless pressure; the reference run begins at a finite one."""
    model = stated(
        "  R: {type: R, parameters: {R: 10 ohm}}\n  C: {type: C, law: e = A/q, parameters: {A: 1 V*A*s}}",
        "line: 1",
        "source -> line -> R, line -> C",
    )
    assert np.isfinite(model.reference_state).all()


@pytest.mark.parametrize("name", ["tank", "rlc", "dc_motor_current"])
def test_reference_follows_the_step(name: str) -> None:
    """Where one step a sample is enough, the reference run ends where a hundred of them by `predict` do."""
    model = example(name)
    assert model.substeps == 1
    v = nominal(model)
    starts = {item.name: item.start.mean for item in model.plant.graph.components if item.start is not None}
    contents = [starts.get(state.component or "", 0.0) for state in model.plant.network.states]
    theta = [item.nominal for item in model.plant.graph.parameters]
    n = len(model.states)
    v[:n] = model.coordinates(contents, theta).full()[:, 0]
    grid = model.plant.graph.sample_time or 1.0
    z = model.reference_implicit
    for _ in range(100):
        x, _, found = model.predict(v, reference_inputs(model.plant), z, grid)
        v[:n], z = x.full()[:, 0], found.full()[:, 0]
    assert v[:n] == pytest.approx(model.reference_state, rel=1e-9)


@pytest.mark.parametrize(
    ("lag", "substeps"), [(0.01, 4), (0.1, 4), (0.3, 4), (0.6, 4), (0.7, 3), (1.0, 2), (1.9, 2), (2.1, 1), (30.0, 1)]
)
def test_a_lag_is_near_however_short(lag: float, substeps: int) -> None:
    """What is left of a move after each sample is off by less than 0.4 % of it, with no more than four substeps."""
    text = LAGGING.replace("1 s,", f"{lag} s,")
    model = build_step_model(build_plant(parse_model(text)))
    assert model.substeps == substeps
    place = next(k for k, store in enumerate(model.plant.network.states) if store.lag)
    v = nominal(model, *np.zeros(len(model.states)))
    for k in range(1, 6):
        v[: len(model.states)] = model.predict(v, [1.0], model.reference_implicit, 1.0)[0].full()[:, 0]
        assert 1.0 - v[place] == pytest.approx(np.exp(-k / lag), abs=0.004)


@pytest.mark.parametrize(
    ("sample_time", "substeps"), [("240 ms", 1), ("260 ms", 2), ("1 s", 4), ("10 s", MAX_SUBSTEPS)]
)
def test_substeps_are_a_quarter_of_the_fastest_time_constant(sample_time: str, substeps: int) -> None:
    """A resistor and a coil settle in L/R = 1 s; so a sample of a quarter of that needs one step, a longer one more."""
    parts = "  winding: {type: R, parameters: {R: 2 ohm}}\n  coil: {type: I, parameters: {L: 2 H}}"
    model = stated(parts, "line: 1", "source -> line -> winding, line -> coil", sample_time)
    assert model.substeps == substeps


def test_the_step_is_built_once() -> None:
    """The function of the step is built at its first use, and is the same from then on."""
    model = example("rc")
    assert model.predict is model.predict


def test_a_loop_is_felt_only_by_what_it_drives() -> None:
    """Two loops without a store between them: a sensor follows at once the input of its own loop, not of the other."""
    loops = [
        f"s{k}: {{type: Se, law: 'e = u{k} - A{k}*exp(circuit{k}.f/one)', parameters: {{A{k}: 1 V}}}}, "
        f"r{k}: {{type: R, law: e = R{k}*f, parameters: {{R{k}: 1 ohm}}}}"
        for k in (1, 2)
    ]
    graph = parse_model(
        "name: two loops\nsample_time: 1 s\nconstants: {one: 1 A}\ninputs: {u1: {unit: V}, u2: {unit: V}}\n"
        f"components: {{{loops[0]}, {loops[1]}}}\n"
        "junctions: {circuit1: 1, circuit2: 1}\nbonds: [s1 -> circuit1 -> r1, s2 -> circuit2 -> r2]\n"
        "sensors: {i1: {reads: circuit1.f, unit: A, noise: 1 A}, i2: {reads: circuit2.f, unit: A, noise: 1 A}}\n"
    )
    model = build_step_model(build_plant(graph))
    assert model.z.numel() == 2
    assert model.direct == ((0,), (1,))


def test_implicit_signals_follow_what_their_equations_hold() -> None:
    """The first equation fixes the second signal, the second the third, the third the first by the second."""
    within = np.array([[0, 1, 0], [0, 0, 1], [1, 1, 0]], dtype=bool)
    assert _passed_on(within).astype(int).tolist() == [[1, 0, 1], [1, 0, 0], [0, 1, 0]]
    assert _passed_on(np.array([[1, 1], [0, 0]], dtype=bool)).all()  # no equation for each: anything may be
