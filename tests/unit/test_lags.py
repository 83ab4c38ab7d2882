"""Lags of inputs and sensors: stores of the first order that the model file states by a time constant."""

import json
from functools import cache
from pathlib import Path

import numpy as np
import pytest
from rich.console import Console
from scipy.stats import gamma

from faultbond.algebra.routes.questions import all_questions
from faultbond.analysis.sensor_advice import readable_signals
from faultbond.cli import DONE, main
from faultbond.equations.component_network import build_components
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.errors import ModelError
from faultbond.fit.innovations import watch_recording
from faultbond.fit.samples import healthy_recording
from faultbond.io.recording import write_recording
from faultbond.model.builder import ModelBuilder
from faultbond.model.graph import BondGraph
from faultbond.model.rewrite import NewParameter, rewrite
from faultbond.model.text import parse_model
from faultbond.report.inventory import Inventory, print_check
from faultbond.report.suspects import owner_title
from faultbond.runtime.core import Core
from faultbond.runtime.monitor import Monitor
from faultbond.simulate import Fault, Inputs, Simulation, simulate
from faultbond.synthesis.engine import build_core
from faultbond.synthesis.specify import build_spec
from made import run, samples_of
from plants import pumped_tank

TANK = """\
name: tank with lags
sample_time: 1 s
max_faults: 1
inputs: {u: {unit: percent, lag: {value: 8 s, accuracy: 10 %, suspect: yes}}}
components:
  pump: {type: Sf, law: f = G*u, parameters: {G: 0.01 m^3/s/percent}}
  tank: {type: C, law: e = q/A, parameters: {A: 5 m^2}}
  outlet: {type: R, law: f = K*sqrt(e), parameters: {K: 0.35 m^2.5/s}}
junctions: {line: 1, node: 0}
bonds: [pump -> line -> node -> tank, node -> outlet]
sensors:
  flow: {reads: line.f, unit: m^3/s, noise: 0.004 m^3/s, lag: 4 s}
  level: {reads: node.e, unit: m, noise: 5 mm}
"""
LAG = "lag: {value: 8 s, accuracy: 10 %, suspect: yes}"
BLOCKS = """\
name: one block
sample_time: 0.5 s
inputs: {u: {lag: 2 s}}
blocks: {gain: {law: x = P*u, parameters: {P: 3}}}
sensors: {y: {reads: x, noise: 1, lag: 5 s}}
"""
STATIC = "name: s\nsample_time: none\ninputs: {u: {lag: 2 s}}\nblocks: {a: {law: x = 2*u}}\nsensors: {y: {reads: x}}\n"
LEVELS = (33.0, 60.0, 41.0, 66.0, 50.0)


@cache
def tank() -> tuple[BondGraph, Core]:
    """The tank and its core."""
    graph = parse_model(TANK)
    return graph, build_core(build_plant(graph), build_spec(build_step_model(build_plant(graph))))


def recorded(*faults: Fault) -> Simulation:
    """A recording of the tank whose pump moves every minute."""
    time = np.arange(300.0)
    values = np.repeat(LEVELS, 60)[:, None]
    return simulate(tank()[0], Inputs(time=time, values=values), faults, seed=4, start={"tank.q": 10.0})


@pytest.mark.parametrize(
    ("text", "new", "message"),
    [
        ("lag: 4 s", "lag: 4 m", "model.yaml:12: sensor flow: lag is in m, but s is expected"),
        ("lag: 4 s", "lag: 0 s", "sensor flow: lag is a time above 0, such as `3 s`"),
        ("lag: 4 s", "lag: -1 s", "sensor flow: lag is a time above 0"),
        ("lag: 4 s", "lag: soon", "sensor flow: lag `soon` is not a quantity"),
        ("lag: 4 s", "lag: [4 s]", "sensor flow: lag must be a table"),
        ("lag: 4 s", "lag: {accuracy: 5 %}", "sensor flow: lag: `value` is missing; state the time constant"),
        ("lag: 4 s", "lag: {value: 4 s, nominal: 3}", "sensor flow: lag: unknown key `nominal`"),
        ("lag: 4 s", "lag: {value: 4 s, range: [-1 s, 9 s]}", "range must not go below 0; nothing acts before"),
        ("lag: 4 s", "lag: {value: 4 s, accuracy: 1 m}", "accuracy is in m, but s is expected"),
        ("lag: 4 s", "lag: {value: 4 s, order: 0}", "order is a whole number from 1 to 8, not `0`"),
        ("lag: 4 s", "lag: {value: 4 s, order: 2.5}", "order is a whole number from 1 to 8, not `2.5`"),
        ("lag: 4 s", "lag: 4 s, rate_limit: 1 m^3/s^2", "sensor flow: unknown key `rate_limit`"),
        (LAG, f"{LAG}, rate_limit: 2 percent", "input u: rate_limit is in percent, but percent/s is expected"),
        (LAG, f"{LAG}, rate_limit: 0 percent/s", "input u: rate_limit is a rate above 0, such as `5 percent/s`"),
        (
            f"{LAG}}}}}\ncomponents:\n  pump: {{type: Sf, law: f = G*u, parameters: {{",
            f"{LAG}, rate_limit: 2 percent/s}}}}\ncomponents:\n  pump: {{type: Sf, law: f = G*u, parameters: "
            "{u_rate_limit: 3, ",
            "parameter `u_rate_limit` is already a rate limit on line 4",
        ),
        (
            LAG,
            "rate_limit: 2 percent/s",
            "rate_limit: it needs a `lag` beside it; state `lag: {value: 1 s, accuracy: 50 %}`",
        ),
        (
            LAG,
            f"{LAG}, rate_limit: {{value: 2 percent/s, range: [-1 percent/s, 9 percent/s]}}",
            "range must not go below 0; its size is meant",
        ),
        (
            "{G: 0.01 m^3/s/percent}",
            "{G: 0.01 m^3/s/percent, u_lag: 2}",
            "parameter `u_lag` is already a lag on line 4",
        ),
        (
            "{K: 0",
            "{flow_lag: 1, K: 0",
            "sensor flow: lag: its parameter is called `flow_lag`, and so is a parameter on line 8",
        ),
    ],
)
def test_mistakes(text: str, new: str, message: str) -> None:
    """What is no lag is refused by name and line."""
    with pytest.raises(ModelError) as caught:
        parse_model(TANK.replace(text, new))
    assert message in str(caught.value)


def test_nothing_lags_without_time() -> None:
    """A network whose rows stand by themselves has no lag."""
    with pytest.raises(ModelError, match=r"input u: lag: with `sample_time: none` each row stands by itself"):
        parse_model(STATIC)


def test_a_lag_is_a_parameter_of_its_owner() -> None:
    """It is trusted unless it says otherwise, has the accuracy of the model, and belongs to the input or sensor."""
    graph = parse_model(TANK)
    own, trusted = graph.parameter("u_lag"), graph.parameter("flow_lag")
    assert (own.nominal, own.accuracy, own.change, own.suspect, own.owner) == (8.0, 0.8, 16.0, True, "u")
    assert (trusted.nominal, trusted.accuracy, trusted.suspect) == (4.0, 0.03 * 4.0, False)
    assert [owner_title(graph, item) for item in (own, trusted)] == ["input u", "flow sensor"]


def test_text_and_builder_say_the_same() -> None:
    """The canonical text reads back, and the builder takes the same words."""
    graph = parse_model(BLOCKS)
    built = ModelBuilder("one block", sample_time="0.5 s").input("u", lag="2 s")
    built.block("gain", "x = P*u", parameters={"P": 3}).sensor("y", "x", noise=1, lag="5 s")
    assert graph.text == parse_model(graph.text).text == built.build().text
    text = parse_model(TANK).text
    assert "lag: {value: 8 s, accuracy: 10 %, suspect: yes}" in text
    assert "lag: 4 s" in text
    assert parse_model(text).text == text


def test_a_fitted_lag_is_written_where_it_stood() -> None:
    """Both forms take a new value."""
    new = [NewParameter(name="u_lag", nominal="9 s", others=(("accuracy", "2 %"),))]
    new += [NewParameter(name="flow_lag", nominal="3 s", others=(("accuracy", "1 %"),))]
    text = rewrite(TANK, parse_model(TANK), new, [])
    assert "lag: {value: 9 s, accuracy: 2 %, suspect: yes}" in text
    assert "lag: {value: 3 s, accuracy: 1 %}" in text


def test_two_lags_in_a_row_are_exact() -> None:
    """After a step of the input the sensor shows the closed form of two stores, from rest at the first row."""
    time = np.arange(0.0, 30.0, 0.5)
    values = np.where(time < 5.0, 1.0, 4.0)[:, None]
    made = simulate(parse_model(BLOCKS), Inputs(time=time, values=values), seed=None)
    late = np.maximum(time - 5.0, 0.0)
    part = 1.0 - (5.0 * np.exp(-late / 5.0) - 2.0 * np.exp(-late / 2.0)) / (5.0 - 2.0)
    assert made.outputs[:, 0] == pytest.approx(3.0 * (1.0 + 3.0 * part), rel=1e-7)
    assert made.state_names == ("u.lagged", "y.lagged")


@pytest.mark.parametrize("order", [2, 3, 8])
def test_a_lag_of_higher_order_is_a_row_of_stores(order: int) -> None:
    """After a step an input and a sensor come as the sum of so many exponential times does; the mean is the lag."""
    text = BLOCKS.replace("{lag: 2 s}", f"{{lag: {{value: 2 s, order: {order}}}}}").replace(", lag: 5 s", "")
    other = BLOCKS.replace("lag: 5 s", f"lag: {{value: 2 s, order: {order}}}").replace("{u: {lag: 2 s}}", "{u: {}}")
    time = np.arange(0.0, 20.0, 0.5)
    values = np.where(time < 5.0, 1.0, 4.0)[:, None]
    for model in (parse_model(text), parse_model(other)):
        made = simulate(model, Inputs(time=time, values=values), seed=None)
        part = gamma.cdf(time - 5.0, order, scale=2.0 / order)
        assert made.outputs[:, 0] == pytest.approx(3.0 * (1.0 + 3.0 * part), rel=1e-6)
        assert len(made.state_names) == order
        assert parse_model(model.text).text == model.text
    assert (parse_model(text).inputs[0].order, parse_model(other).sensors[0].order) == (order, order)


def test_nothing_is_asked_of_what_stands_between_stages() -> None:
    """Of three stages the last has a name, as that of a single one has; no route is asked for of the others."""
    titles = []
    for text in (BLOCKS, BLOCKS.replace("{lag: 2 s}", "{lag: {value: 2 s, order: 3}}")):
        graph = parse_model(text)
        network = build_components(graph, build_plant(graph).network)
        titles.append([item.title for item in all_questions(network, 1)])
    assert titles[0] == titles[1]
    assert "state u.lagged" in titles[0]


@pytest.mark.parametrize(("first", "last"), [(10.0, 70.0), (70.0, 10.0)])
def test_an_input_moves_at_its_highest_rate(first: float, last: float) -> None:
    """Far from where it is to be it moves so fast and no faster, both ways; near there as a lag does."""
    text = BLOCKS.replace("{lag: 2 s}", "{unit: percent, lag: 2 s, rate_limit: 4 percent/s}").replace(", lag: 5 s", "")
    time = np.arange(0.0, 40.0, 0.5)
    values = np.where(time < 5.0, first, last)[:, None]
    made = simulate(parse_model(text), Inputs(time=time, values=values), seed=None)
    acts, side = made.outputs[:, 0] / 3.0, np.sign(last - first)
    ramp = time < 5.0 + (60.0 - 4.0 * 2.0) / 4.0  # 8 from its end the lag is as fast
    late = time - 18.0
    expected = np.where(ramp, 4.0 * np.maximum(time - 5.0, 0.0), 60.0 - 8.0 * np.exp(-late / 2.0))
    assert acts == pytest.approx(first + side * expected, abs=0.02)


def test_a_highest_rate_is_a_parameter_of_its_input() -> None:
    """It is a suspect unless it says otherwise, reads back, and is written where it stood."""
    stated = TANK.replace(LAG, f"{LAG}, rate_limit: 2 percent/s")
    graph = parse_model(stated)
    own = graph.parameter("u_rate_limit")
    assert (own.nominal, own.unit.text, own.suspect, own.owner) == (2.0, "percent/s", True, "u")
    trusted = parse_model(stated.replace("2 percent/s", "{value: 2 percent/s, suspect: no}"))
    assert not trusted.parameter("u_rate_limit").suspect
    assert "rate_limit: {value: 2 percent/s, suspect: no}" in trusted.text
    assert owner_title(graph, own) == "input u"
    assert graph.lags == {"u_lag", "u_rate_limit", "flow_lag"}
    assert parse_model(graph.text).text == graph.text
    new = [NewParameter(name="u_rate_limit", nominal="3 percent/s", others=(("accuracy", "2 %"),))]
    assert "rate_limit: {value: 3 percent/s, accuracy: 2 %}" in rewrite(stated, graph, new, [])
    built = ModelBuilder("b", sample_time="1 s").input("u", unit="percent", lag="2 s", rate_limit="1 percent/s")
    built.block("gain", "x = P*u", parameters={"P": 3}).sensor("y", "x", noise=1)
    assert built.build().parameter("u_rate_limit").nominal == 1.0


def test_a_drive_that_has_become_slow_is_found() -> None:
    """A valve that travels at a quarter of its rate from some time on is named, with its rate."""
    text = TANK.replace(LAG, "lag: 1 s, rate_limit: {value: 4 percent/s, accuracy: 10 %}")
    graph = parse_model(text.replace(", lag: 4 s", ""))
    core = build_core(build_plant(graph), build_spec(build_step_model(build_plant(graph))))
    inputs = Inputs(time=np.arange(300.0), values=np.repeat(LEVELS, 60)[:, None])
    start = {"tank.q": 5.0 * (0.01 * LEVELS[0] / 0.35) ** 2}
    for faults in ((), (Fault(parameter="u_rate_limit", value=1.0, start=110.0),)):
        made = simulate(graph, inputs, faults, seed=4, start=start)
        monitor, _ = run(core, samples_of(made.time, made.inputs, made.outputs))
        assert (monitor.number("clock.alarm") >= 0) == bool(faults)
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("u_rate_limit",)
    assert best.suspects[0].estimate == pytest.approx(1.0, abs=0.1)
    assert best.probability > 0.9


def test_the_filter_steps_as_the_plant_does() -> None:
    """One step of the discrete model follows the closed form to its second order."""
    model = build_step_model(build_plant(parse_model(BLOCKS)))
    v, u = np.array([1.0, 3.0, 1.0, 1.0, 1.0]), [4.0]  # u.lagged, y.lagged, and the factors of P and both lags
    for _ in range(20):
        v[:2] = model.predict(v, u, [], 0.5)[0].full()[:, 0]
    part = 1.0 - (5.0 * np.exp(-2.0) - 2.0 * np.exp(-5.0)) / 3.0
    assert v[:2] == pytest.approx([4.0 - 3.0 * np.exp(-5.0), 3.0 * (1.0 + 3.0 * part)], rel=2e-3)


def test_what_lags_is_felt_later() -> None:
    """No sensor follows an input with a lag at once, and nobody is asked to measure what lags."""
    lagging, plain = parse_model(TANK), parse_model(TANK.replace("lag: {value: 8 s, accuracy: 10 %, suspect: yes}", ""))
    model, other = (build_step_model(build_plant(item)) for item in (lagging, plain))
    assert model.direct == ((), ())
    assert other.direct == ((), ())  # the flow meter lags, too
    assert not [name for name in readable_signals(model) if "lagged" in name]
    bare = parse_model(TANK.replace(", lag: 4 s", "").replace("lag: {value: 8 s, accuracy: 10 %, suspect: yes}", ""))
    assert build_step_model(build_plant(bare)).direct == ((0,), ())


GATE = """\
name: surge tank and gate
sample_time: 2 s
inputs: {reservoir: {unit: m}, tailwater: {unit: m}, gate: {unit: percent, lag: {value: 2 s, accuracy: 10 %}}}
components:
  lake: {type: Se, law: e = reservoir}
  tunnel: {type: R, law: e = Kt*f*abs(f), parameters: {Kt: 0.01 s^2/m^5}}
  tunnel_water: {type: I, law: p = It*f, parameters: {It: 20.4 s^2/m^2}}
  shaft: {type: C, law: e = q/As, parameters: {As: 60 m^2}}
  water: {type: I, law: p = Ip*f, parameters: {Ip: 6.1 s^2/m^2}}
  turbine: {type: R, law: e = f*abs(f)/(Cg*gate)**2, parameters: {Cg: 0.0283 m^2.5/s/percent}}
  river: {type: Se, law: e = tailwater}
junctions: {headrace: 1, node: 0, line: 1}
bonds: [lake -> headrace -> tunnel, headrace -> tunnel_water, headrace -> node -> shaft, node -> line -> water,
        line -> turbine, line -> river]
sensors:
  level: {reads: node.e, unit: m, noise: 1.2 cm}
  flow: {reads: line.f, unit: m^3/s, noise: 0.15 m^3/s}
  head: {reads: turbine.e, unit: m, noise: 0.25 m}
"""


def test_a_lag_of_an_input_makes_no_sensor_blind() -> None:
    """Where a plant runs far from the reference, what an input has come to is as well known as its record."""
    graph = parse_model(GATE)
    core = build_core(build_plant(graph), build_spec(build_step_model(build_plant(graph))))
    (lagged,) = (item for item in core.spec.states if item.name == "gate.lagged")
    assert (lagged.noise, lagged.drift <= 50.0) == (0.0, True)
    generator = np.random.default_rng(3)
    levels = np.full(600, 82.0), np.full(600, 2.0)
    values = np.column_stack([*levels, np.repeat(generator.uniform(40.0, 70.0, 10), 60)])
    made = simulate(graph, Inputs(time=2.0 * np.arange(600.0), values=values), (), seed=4)
    record = healthy_recording("a", samples_of(made.time, made.inputs, made.outputs), core)
    (seen,) = watch_recording(core, record)
    assert np.nanstd(seen.scores[100:], axis=0) == pytest.approx(1.0, abs=0.15)


@pytest.mark.parametrize("order", ["4 s", "{value: 4 s, order: 3}"])
def test_settling_holds_beside_a_lag(order: str) -> None:
    """What would feel the input at once but for lags, its own or that of the input, is not judged after a step."""
    settling = TANK.replace("unit: percent", "unit: percent, settling: 20 s").replace("lag: 4 s", f"lag: {order}")
    models = [build_step_model(build_plant(parse_model(text))) for text in (settling, TANK)]
    assert [model.felt for model in models] == [((0,), ()), ((), ())]
    graph = parse_model(settling)
    core = build_core(build_plant(graph), build_spec(models[0]))
    made = simulate(graph, Inputs(time=np.arange(120.0), values=np.repeat(LEVELS[:2], 60)[:, None]), (), seed=4)
    record = healthy_recording("a", samples_of(made.time, made.inputs, made.outputs), core)
    assert np.flatnonzero(~record.use[:, 0]).tolist() == list(range(60, 80))
    assert record.use[:, 1].all()


def test_settling_of_one_input_is_not_that_of_another() -> None:
    """Only what settles is felt in spite of a lag; and a parameter that a sensor feels beside it counts as settling."""
    other = TANK.replace("{u: {", "{w: {unit: percent, lag: 5 s}, u: {").replace("f = G*u", "f = G*u + G*w")
    settling = other.replace(f"percent, {LAG}", f"percent, settling: 20 s, {LAG}").replace(", lag: 4 s", "")
    model = build_step_model(build_plant(parse_model(settling)))
    assert (model.direct, model.felt) == (((), ()), ((1,), ()))
    times = {item.name: item.settling for item in build_spec(model).parameters}
    assert (times["G"], times["A"]) == (20.0, 0.0)


@pytest.mark.parametrize(
    ("lag", "line"),
    [
        ("lag: 4 s", "u 8 s, flow 4 s"),
        ("range: any", "u 8 s"),
        ("lag: {value: 4 s, order: 3}", "u 8 s, flow 4 s in 3 stages"),
    ],
)
def test_check_tells_of_lags(lag: str, line: str) -> None:
    """`check` lists the lags, and about where what lags begins."""
    shown = checked(TANK.replace("lag: 4 s", lag))
    assert line in shown
    assert "u.lagged; start: about where u is" in shown
    assert "felt at once" not in shown


def test_check_asks_for_a_lag() -> None:
    """Where a sensor feels an input at once, `check` says what to do if that is not so."""
    shown = checked(TANK.replace(", lag: 4 s", "").replace(", lag: {value: 8 s, accuracy: 10 %, suspect: yes}", ""))
    assert "felt at once" in shown
    assert "u: if it takes time to act, or a sensor to follow, state its `lag`" in shown


def test_check_tells_of_a_settling_that_does_nothing() -> None:
    """A sensor that feels an input at once is needed for it to do something."""
    stated = TANK.replace(", lag: 4 s", "").replace(LAG, "settling: 5 s")
    assert "does nothing" not in checked(stated)
    idle = checked("\n".join(line for line in stated.splitlines() if "flow:" not in line))
    assert "u: no sensor feels it at once, so that it does nothing; state a `lag`" in " ".join(idle.split())
    assert "but for a lag" not in idle
    lagging = TANK.replace(LAG, f"settling: 5 s, {LAG}")
    assert "does nothing" not in checked(lagging)  # the flow meter would feel it at once but for the lags
    idle = checked("\n".join(line for line in lagging.splitlines() if "flow:" not in line))
    assert "u: no sensor feels it at once, or but for a lag: it does nothing" in " ".join(idle.split())


def checked(text: str) -> str:
    """What `check` prints of a model."""
    graph = parse_model(text)
    model = build_step_model(build_plant(graph))
    console = Console(width=100, record=True, quiet=True)
    console.quiet = False
    with console.capture() as capture:
        print_check(console, Inventory(graph=graph, model=model, spec=build_spec(model), engine="C"))
    return capture.get()


def test_it_begins_where_the_input_is() -> None:
    """What no sensor shows of an input that lags is known from the record of the input, to about a tenth of it."""
    graph = parse_model("\n".join(line for line in TANK.splitlines() if "flow:" not in line).replace("5 mm", "2 m"))
    core = build_core(build_plant(graph), build_spec(build_step_model(build_plant(graph))))
    time, values = np.arange(20.0), np.full((20, 1), LEVELS[0])
    made = simulate(graph, Inputs(time=time, values=values), seed=4, start={"tank.q": 10.0})
    monitor, _ = run(core, samples_of(time, made.inputs, made.outputs))
    mean, covariance = core.solve_start(np.array([monitor.row(k)[0] for k in range(20)]))
    place = [item.name for item in core.spec.states].index("u.lagged")
    assert core.spec.states[place].follows == [item.name for item in graph.inputs].index("u")
    assert abs(mean[place] - LEVELS[0]) < 3.0
    assert 0.1 * LEVELS[0] < np.sqrt(covariance[place, place]) < 3.1 * (0.1 * LEVELS[0] + 1.0)


def test_the_healthy_plant_is_quiet() -> None:
    """Nothing surprises the filter, from the first sample on."""
    made = recorded()
    _, reports = run(tank()[1], samples_of(made.time, made.inputs, made.outputs))
    assert not any(report.detection for report in reports)


@pytest.mark.parametrize(
    ("stated", "healthy"),
    [
        ("value: 2 s, accuracy: 10 %", "2 s"),
        ("value: 0.1 s, accuracy: 0.1 s, change: 5 s, range: [0 s, 60 s]", "0.01 s"),  # it follows at once
    ],
)
def test_a_fast_actuator_that_has_become_slow(stated: str, healthy: str) -> None:
    """A valve that lags by 6 s from some time on is named and valued, whether it had a lag before or hardly any."""
    fast = TANK.replace(", lag: 4 s", "")
    true = parse_model(fast.replace("value: 8 s, accuracy: 10 %", f"value: {healthy}"))
    graph = parse_model(fast.replace("value: 8 s, accuracy: 10 %", stated))
    core = build_core(build_plant(graph), build_spec(build_step_model(build_plant(graph))))
    values = np.random.default_rng(101).uniform(30.0, 70.0, 10)
    inputs = Inputs(time=np.arange(600.0), values=np.repeat(values, 60)[:, None])
    start = {"tank.q": 5.0 * (0.01 * values[0] / 0.35) ** 2}
    for faults in ((), (Fault(parameter="u_lag", value=6.0, start=200.0),)):
        made = simulate(true, inputs, faults, seed=101, start=start)
        monitor, _ = run(core, samples_of(made.time, made.inputs, made.outputs))
        assert (monitor.number("clock.alarm") >= 0) == bool(faults)
    assert 240.0 < monitor.number("alarm.time") < 260.0  # after its next move
    best = monitor.conclude().candidates[0]
    assert best.parameters == ("u_lag",)
    assert best.suspects[0].estimate == pytest.approx(6.0, abs=0.3)


def test_a_slow_actuator_is_found() -> None:
    """A valve that lags twice as long from some time on is named, with its time constant."""
    made = recorded(Fault(parameter="u_lag", value=20.0, start=110.0))
    monitor = Monitor(tank()[1])
    for sample in samples_of(made.time, made.inputs, made.outputs):
        monitor.step(sample)
    best = monitor.conclude().candidates[0]
    assert [item.parameter for item in best.suspects] == ["u_lag"]
    assert best.suspects[0].component == "u"
    assert best.suspects[0].estimate == pytest.approx(20.0, abs=4.0 * best.suspects[0].sd)
    assert best.probability > 0.9


def test_a_lag_that_differs_between_recordings_is_known_to_no_better(tmp_path: Path) -> None:
    """Lags of 2.4, 3 and 3.6 s on three days: a fit says by how much it moves, and writes an accuracy that says so."""
    text = pumped_tank(speed=", lag: {value: 3 s, accuracy: 30 %}")
    (tmp_path / "model.yaml").write_text(text)
    time = np.arange(900.0)
    inputs = Inputs(time=time, values=np.repeat((50.0, 70.0, 40.0, 60.0, 45.0, 65.0, 55.0, 75.0, 50.0), 100)[:, None])
    days = []
    for k, lag in enumerate((2.4, 3.0, 3.6)):
        made = simulate(parse_model(text.replace("value: 3 s", f"value: {lag} s")), inputs, seed=70 + k)
        columns = {"time": time, "u": made.inputs[:, 0], "flow": made.outputs[:, 0] * 1e3, "level": made.outputs[:, 1]}
        days.append(str(tmp_path / f"day{k}.csv"))
        write_recording(tmp_path / f"day{k}.csv", columns)
    written = tmp_path / "fitted.yaml"
    assert main(["fit", str(tmp_path / "model.yaml"), *days, "-o", str(written), "--json", str(tmp_path / "f")]) == DONE
    (record,) = [item for item in map(json.loads, (tmp_path / "f").read_text().splitlines()) if item["record"] == "fit"]
    moved = {item["parameter"]: item["size"] for item in record["wanders"]}
    known = parse_model(written.read_text()).parameter("u_lag")
    assert 0.1 < moved["u_lag"] < 0.4
    assert known.accuracy >= moved["u_lag"] * known.nominal
    told = {item["name"]: item for item in record["parameters"]}["u_lag"]
    assert told["sd"] < 0.5 * told["accuracy"]  # the standard error alone would say that it is known far better
