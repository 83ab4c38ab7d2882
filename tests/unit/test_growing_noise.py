"""Sensors whose noise grows with the reading: in the file, the simulated plant, the filter, and a fit."""

from functools import cache

import numpy as np
import pytest
from rich.console import Console

from faultbond.app.likelihood import likelihood_engine
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import ModelError
from faultbond.fit.identification import fit_plant
from faultbond.fit.outcome import noises_of
from faultbond.fit.session import build_fit, free_parameters
from faultbond.model.rewrite import NewSize, rewrite
from faultbond.model.text import parse_model
from faultbond.report.inventory import Inventory, print_check
from faultbond.runtime.core import Core
from faultbond.simulate import Fault, Inputs, Simulation, simulate
from faultbond.synthesis.engine import build_engine
from faultbond.synthesis.specify import build_spec
from made import run, samples_of

TANK = """\
name: one tank
sample_time: 1 s
max_faults: 1
inputs: {u: {unit: percent}}
components:
  pump: {type: Sf, law: f = G*u, parameters: {G: 0.01 m^3/s/percent}}
  tank: {type: C, law: e = q/A, parameters: {A: {nominal: 5 m^2, suspect: no}}}
  outlet: {type: R, law: f = K*sqrt(e), parameters: {K: 0.35 m^2.5/s}}
junctions: {line: 1, node: 0}
bonds: [pump -> line -> node -> tank, node -> outlet]
sensors:
  flow: {reads: line.f, unit: l/s, noise: 2 l/s + 2 %}
  level: {reads: node.e, unit: m, noise: 5 mm + 1 %}
"""
SIZE = TANK.replace(" + 2 %", "").replace(" + 1 %", "")


@cache
def engine(text: str = TANK) -> Core:
    """A core of the tank."""
    return build_engine(parse_model(text))[1]


def recorded(seed: int | None, *faults: Fault, rows: int = 600) -> Simulation:
    """A recording of the tank whose pump moves every minute."""
    values = np.repeat(np.random.default_rng(1).uniform(20.0, 80.0, rows // 60 + 1), 60)[:rows, None]
    start = {"tank.q": 5.0 * (0.01 * values[0, 0] / 0.35) ** 2}
    return simulate(
        parse_model(TANK), Inputs(time=np.arange(float(rows)), values=values), faults, seed=seed, start=start
    )


def test_it_is_read_in_the_units_of_the_sensor() -> None:
    """A size and a part: both are independent, and the text says them again."""
    flow, level = parse_model(TANK).sensors
    assert (flow.noise, flow.part) == pytest.approx((2e-3, 0.02))
    assert flow.noise_at(0.5) == pytest.approx(np.hypot(2e-3, 0.01))
    assert level.noise_at(-2.0) == pytest.approx(np.hypot(5e-3, 0.02))
    text = parse_model(TANK).text
    assert "noise: 2 l/s + 2 %" in text
    assert parse_model(text).text == text
    assert parse_model(SIZE).sensors[0].noise_at(0.5) == 2e-3


@pytest.mark.parametrize(
    ("new", "message"),
    [
        ("2 % + 2 l/s", "sensor flow: noise is a size and a part of the reading, in this order"),
        ("2 l/s + 2 l/s", "sensor flow: noise is a size and a part of the reading, such as"),
        ("2 l/s + much", "sensor flow: noise `much` is not a quantity"),
        ("2 m + 2 %", "sensor flow: noise is in m, but"),
        ("0 l/s + 2 %", "sensor flow: noise must be above 0"),
        ("2 l/s + -2 %", "sensor flow: noise `-2 %` is negative"),
    ],
)
def test_mistakes(new: str, message: str) -> None:
    """What is no such noise is refused by name and line."""
    with pytest.raises(ModelError, match=r"model.yaml:12: ") as caught:
        parse_model(TANK.replace("2 l/s + 2 %", new))
    assert message in str(caught.value)


def test_no_part_of_degrees() -> None:
    """A part of a reading whose unit begins somewhere is refused, and so is one where there is no time."""
    warm = (
        "name: w\nsample_time: 1 s\ninputs: {u: {}}\nblocks: {a: {law: der(T) = u - T}}\n"
        "sensors: {t: {reads: T, unit: degC, noise: 1 K + 1 %}}"
    )
    with pytest.raises(ModelError, match="a part of a reading in degC depends on where degC begins"):
        parse_model(warm)
    static = "name: s\nsample_time: none\ninputs: {u: {}}\nblocks: {a: {law: x = 2*u}}\n"
    with pytest.raises(ModelError, match="with `sample_time: none` noise is a size"):
        parse_model(static + "sensors: {y: {reads: x, noise: 1 + 2 %}}")


def test_the_simulated_sensor_scatters_so() -> None:
    """What is recorded is off by as much as stated, at small readings and at large ones."""
    made, true = recorded(5, rows=12000), recorded(None, rows=12000)
    for k, sensor in enumerate(parse_model(TANK).sensors):
        off = (made.outputs - true.outputs)[:, k] / [sensor.noise_at(y) for y in true.outputs[:, k]]
        for half in (
            true.outputs[:, k] < np.median(true.outputs[:, k]),
            true.outputs[:, k] > np.median(true.outputs[:, k]),
        ):
            assert off[half].std() == pytest.approx(1.0, abs=0.04)


def test_the_filter_expects_so_much() -> None:
    """The variance of a reading is what the noise is at the reading that is expected, not at that which is measured."""
    made = recorded(5)
    core = engine()
    monitor, reports = run(core, samples_of(made.time, made.inputs, made.outputs))
    assert monitor.number("clock.alarm") < 0
    flow = parse_model(TANK).sensors[0]
    for report in reports[100:]:
        noise = flow.noise_at(report.expected[0])
        assert noise**2 < report.variance[0] < 1.1 * noise**2
    scores = np.array([(y - r.expected) / np.sqrt(r.variance) for y, r in zip(made.outputs, reports, strict=True)])[30:]
    assert scores.std(axis=0) == pytest.approx(1.0, abs=0.08)
    alarmed, _ = run(engine(SIZE), samples_of(made.time, made.inputs, made.outputs))
    assert alarmed.number("clock.alarm") >= 0


def test_faults_are_named_and_valued() -> None:
    """A narrowed outlet is found and valued by the filters of the bank too, and a sensor that scatters more."""
    made = recorded(6, Fault(parameter="K", factor=0.8, start=300.0))
    monitor, _ = run(engine(), samples_of(made.time, made.inputs, made.outputs))
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("K",)
    assert abs(best.suspects[0].estimate - 0.28) < 4.0 * best.suspects[0].sd < 0.02
    noisy = recorded(7, Fault(parameter="flow.noise", value=8e-3, start=300.0))
    monitor, _ = run(engine(), samples_of(noisy.time, noisy.inputs, noisy.outputs))
    assert 300.0 < monitor.number("alarm.time") < 420.0
    assert monitor.conclude().candidates[0].parameters == ("flow.noise",)


def test_a_fit_finds_the_factor() -> None:
    """Of a model that states half of both the noise is found twice as large."""
    made = recorded(8)
    graph = parse_model(TANK.replace("2 l/s + 2 %", "1 l/s + 1 %").replace("5 mm + 1 %", "2.5 mm + 0.5 %"))
    points, model = samples_of(made.time, made.inputs, made.outputs), build_step_model(build_plant(graph))
    core = build_engine(graph)[1]
    plant, records, begin = build_fit(model, likelihood_engine(model), core, [("made", points)], free_parameters(graph))
    found = noises_of(fit_plant(plant, records, begin, starts=1), graph)
    assert [item.found / item.declared for item in found] == pytest.approx([2.0, 2.0], rel=0.08)


def test_a_text_with_other_noise() -> None:
    """Both numbers of a noise are multiplied."""
    text = rewrite(TANK, parse_model(TANK), [], [NewSize(name="flow", times=1.5)])
    assert "noise: 3 l/s + 3 %" in text


def test_check_prints_it() -> None:
    """`check` says both."""
    console, graph = Console(width=200), parse_model(TANK)
    model = build_step_model(build_plant(graph))
    with console.capture() as seen:
        print_check(console, Inventory(graph=graph, model=model, spec=build_spec(model), engine="C"))
    assert "2 l/s + 2 %" in seen.get()
