"""Inputs that are not held until the next row: in the simulated plant, in the step, in the filter, and in a fit.

They go linearly from row to row, or a row holds what acted until then.
"""

from functools import cache
from itertools import pairwise

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from faultbond.app.likelihood import likelihood_engine
from faultbond.arrays import FloatArray
from faultbond.equations.plant import build_plant
from faultbond.equations.step import StepModel, build_step_model
from faultbond.errors import ModelError
from faultbond.fit.likelihood import build_begin, layout_of, nominal_q
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, Policy, Simulation, simulate
from faultbond.synthesis.engine import build_engine
from made import run, samples_of

RC = """\
name: two circuits
sample_time: 0.1 s
max_faults: 1
inputs: {V: {unit: V, hold: linear}, W: {unit: V}}
components:
  source: {type: Se, law: e = V}
  R: {type: R, parameters: {R: 10 ohm}}
  C: {type: C, parameters: {C: 50 mF}}
  held: {type: Se, law: e = W}
  R2: {type: R, parameters: {R2: 20 ohm}}
  C2: {type: C, parameters: {C2: 10 mF}}
junctions: {one: 1, two: 1}
bonds: [source -> one, one -> R, one -> C, held -> two, two -> R2, two -> C2]
sensors: {v: {reads: C.e, unit: V, noise: 2 mV}, w: {reads: C2.e, unit: V, noise: 2 mV}}
"""
STEP = RC.replace(", hold: linear", "")
NEXT = RC.replace("hold: linear", "hold: next")
TIME = np.arange(0.0, 30.0, 0.1)


@cache
def graph(text: str = RC) -> BondGraph:
    """The circuits."""
    return parse_model(text)


@cache
def engine(text: str = RC) -> Core:
    """Their core."""
    return build_engine(graph(text))[1]


def course() -> FloatArray:
    """Inputs that move at every row."""
    return np.stack([5.0 + 4.0 * np.sin(2.0 * TIME) + np.sin(9.0 * TIME), 3.0 + np.cos(4.0 * TIME)], axis=1)


def recorded(seed: int | None = None, *faults: Fault, text: str = RC) -> Simulation:
    """A recording of the circuits."""
    return simulate(graph(text), Inputs(time=TIME, values=course()), faults, seed=seed)


def test_mistakes() -> None:
    """Another word, or a network without time, is refused by name and line."""
    ways = (
        "hold is `last`, it stays until the next row, `next`, it was so since the row before, or `linear`, not `cubic`"
    )
    with pytest.raises(ModelError, match=f":4: input V: {ways}"):
        parse_model(RC.replace("linear", "cubic"))
    with pytest.raises(ModelError, match="input V: hold: with `row_time` a sample is the mean of the rows about it"):
        parse_model(RC.replace("sample_time: 0.1 s", "sample_time: 0.1 s\nrow_time: 0.02 s").replace("linear", "next"))
    static = (
        "name: s\nsample_time: none\ninputs: {u: {hold: linear}}\nblocks: {a: {law: x = 2*u}}\nsensors: {y: {reads: x}}"
    )
    with pytest.raises(ModelError, match="input u: hold: with `sample_time: none` each row stands by itself"):
        parse_model(static)


def test_the_text_says_it() -> None:
    """It is in the canonical text, where it is not the default, and the builder knows the word."""
    assert "V: {unit: V, hold: linear}" in graph().text
    assert parse_model(RC.replace("hold: linear", "hold: last")).text == graph(STEP).text
    assert parse_model(graph().text).inputs[0].linear
    built = (
        ModelBuilder("m", sample_time="1 s")
        .input("u", hold="linear")
        .block("a", "der(x) = u")
        .sensor("y", "x", noise=1)
    )
    assert built.build().inputs[0].linear


def test_the_plant_sees_a_line_between_rows() -> None:
    """The simulated plant is that of an integrator that interpolates, also where a fault begins between two rows."""
    made = recorded(None, Fault(parameter="R", value=25.0, start=12.34))
    values = course()

    def rate(t: float, x: FloatArray) -> list[float]:
        resistance = 10.0 if t < 12.34 else 25.0
        return [(float(np.interp(t, TIME, values[:, 0])) - x[0]) / (resistance * 0.05)]

    ends, start = [0.0], [0.0]
    for begin, end in pairwise(TIME.tolist()):
        for first, last in ((begin, min(max(12.34, begin), end)), (min(max(12.34, begin), end), end)):
            if last > first:
                start = solve_ivp(rate, (first, last - 1e-12), start, rtol=1e-11, atol=1e-12).y[:, -1].tolist()
        ends.append(start[0])
    assert made.outputs[:, 0] == pytest.approx(ends, abs=1e-7)


def test_a_held_input_stays_beside_it() -> None:
    """The other input is held as ever."""
    both, plain = recorded(), simulate(graph(STEP), Inputs(time=TIME, values=course()), seed=None)
    assert both.outputs[:, 1] == pytest.approx(plain.outputs[:, 1], abs=1e-9)
    assert np.abs(both.outputs[:, 0] - plain.outputs[:, 0]).max() > 0.05


@pytest.mark.parametrize("text", [RC, NEXT])
def test_an_operator_sees_the_same_plant(text: str) -> None:
    """Inputs that are decided row by row act as those known beforehand."""
    values = dict(zip(TIME.tolist(), course().tolist(), strict=True))
    fault = Fault(parameter="R", value=25.0, start=12.34)
    found = simulate(graph(text), Policy(time=TIME, begin=lambda: lambda time, seen: values[time]), [fault], seed=3)
    assert found.outputs == pytest.approx(recorded(3, fault, text=text).outputs, abs=1e-9)


def test_a_row_may_hold_what_acted_until_then() -> None:
    """The plant is then one whose inputs are each recorded a row before, and so is the step of the filter."""
    made, shifted = recorded(text=NEXT), np.roll(course(), -1, axis=0)
    before = simulate(graph(STEP), Inputs(time=TIME, values=shifted), seed=None)
    assert made.outputs[1:, 0] == pytest.approx(before.outputs[1:, 0] + 0.0, abs=1e-9)
    assert made.outputs[:, 1] == pytest.approx(recorded().outputs[:, 1], abs=1e-9)
    model, v = build_step_model(build_plant(graph(NEXT))), np.array([1.3, 0.2, *np.ones(4)])
    one, two = model.follow(v, [4.0, 2.0], [7.0, 5.0], [], 0.1), model.predict(v, [7.0, 2.0], [], 0.1)
    assert one[0].full() == pytest.approx(two[0].full(), abs=1e-14)
    assert one[1].full() == pytest.approx(two[1].full(), abs=1e-14)


def step_model(resistance: str = "10 ohm", capacity: str = "50 mF") -> StepModel:
    """The circuits in discrete time."""
    text = RC.replace("{R: 10 ohm}", f"{{R: {resistance}}}").replace("{C: 50 mF}", f"{{C: {capacity}}}")
    return build_step_model(build_plant(parse_model(text)))


@pytest.mark.parametrize(("dt", "error"), [(0.1, 7e-4), (0.05, 1.9e-4)])
def test_the_step_is_of_second_order(dt: float, error: float) -> None:
    """From rest, on a ramp from 1 V to 3 V, the step is the closed form but for an error that falls by squares."""
    v = np.array([1.0, 0.0, *np.ones(4)])
    u = np.array([1.0, 0.0])
    x = step_model().follow(v, u, [1.0 + 2.0 * dt, 0.0], [], dt)[0].full()[:, 0]
    exact = 1.0 + 2.0 * (dt - 0.5 * (1.0 - np.exp(-dt / 0.5)))
    assert abs(x[0] - exact) < error * dt
    assert x[1] == 0.0


def test_what_is_fast_follows_without_error() -> None:
    """What is far faster than a step ends where the input ends; with the mean of both rows it would be half off."""
    v, u = np.array([1.0, 0.0, *np.ones(4)]), np.array([1.0, 0.0])
    x = step_model("1 mohm", "1 mF").follow(v, u, [3.0, 0.0], [], 0.1)[0].full()[:, 0]
    assert x[0] == pytest.approx(3.0 - 2e-5, abs=1e-5)


def test_held_is_a_special_case() -> None:
    """Where the input does not move, both ways of a step are one."""
    model, v = step_model(), np.array([1.3, 0.2, *np.ones(4)])
    one, two = model.follow(v, [4.0, 2.0], [4.0, 2.0], [], 0.1), model.predict(v, [4.0, 2.0], [], 0.1)
    assert one[0].full() == pytest.approx(two[0].full(), abs=1e-14)
    assert one[1].full() == pytest.approx(two[1].full(), abs=1e-14)
    assert model.predict is model.predict


def scores(text: str, made: Simulation) -> FloatArray:
    """Innovations of the healthy filter in their sd, (n, 2), without the first 20 samples."""
    _, reports = run(engine(text), samples_of(made.time, made.inputs, made.outputs))
    pairs = list(zip(made.outputs, reports, strict=True))[20:]
    return np.array([(y - report.expected) / np.sqrt(report.variance) for y, report in pairs])


@pytest.mark.parametrize("text", [RC, NEXT])
def test_the_filter_goes_with_the_line(text: str) -> None:
    """On a recording of such a plant innovations are as declared; a model that holds the input is ever surprised."""
    made = recorded(8, text=text)
    right, wrong = scores(text, made), scores(STEP, made)
    assert np.sqrt((right**2).mean(axis=0)) == pytest.approx(1.0, abs=0.15)
    assert (wrong[:, 0] ** 2).mean() > 10.0
    assert (wrong[:, 1] ** 2).mean() == pytest.approx((right[:, 1] ** 2).mean(), rel=0.2)


@pytest.mark.parametrize("text", [RC, NEXT])
def test_a_fit_goes_with_the_line(text: str) -> None:
    """At the true parameters the likelihood foretells a noiseless recording, to the error of its step."""
    made = recorded(text=text)
    assert foretold(text, made) < 5e-3
    assert foretold(STEP, made) > 0.05


def foretold(text: str, made: Simulation) -> float:
    """The largest innovation of the likelihood of a model on a noiseless recording, V."""
    model = build_step_model(build_plant(graph(text)))
    start, size = build_begin(model)(nominal_q(model), [0.0, 0.0]).full(), layout_of(model)
    samples, place = np.zeros((99, size.n_sample)), size.sample_fields
    samples[:, place["dt"]], samples[:, place["u_before"]] = 0.1, made.inputs[:99]
    samples[:, place["u"]], samples[:, place["y"]] = made.inputs[1:100], made.outputs[1:100]
    return float(np.abs(likelihood_engine(model).advance(start, samples)[1][:, :2]).max())
