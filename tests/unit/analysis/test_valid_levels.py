"""Levels of inputs at which a model holds: met where they can be, as near to the usual ones as they can be."""

from dataclasses import replace

import numpy as np
import pytest

from faultbond.analysis.operation import usual_runs
from faultbond.analysis.valid_levels import Level, valid_levels
from faultbond.equations.numeric import condition_holds
from faultbond.equations.plant import build_plant
from faultbond.equations.step import build_step_model
from faultbond.model.graph import BondGraph
from faultbond.model.text import parse_model
from faultbond.synthesis.specify import build_spec
from pumped import TEXT


def pumped(valid: str, flow: str = "") -> BondGraph:
    """The pumped tank under some condition; `flow`: more of its flow meter."""
    more = f"constants: {{least: 20 percent}}\n{f'valid_when: {valid}' if valid else ''}\n"
    noise = "noise: 2e-6 m^3/s"
    return parse_model(more + TEXT.replace(noise, noise + flow))


@pytest.mark.parametrize(
    ("valid", "levels", "expected"),
    [
        ("running == 1", [50.0, 0.3], [Level(value=50.0, moves=True), Level(value=1.0, moves=False)]),
        ("running > 0.2", [50.0, 1.0], [Level(value=50.0, moves=True), Level(value=1.0, moves=True)]),
        (
            "running > 0.2 and running < 0.5",
            [50.0, 0.3],
            [Level(value=50.0, moves=True), Level(value=0.3, moves=False)],
        ),
        ("speed > 30", [50.0, 0.0], [Level(value=75.0, moves=True), Level(value=0.0, moves=True)]),
        ("speed > least and running != 0", [50.0, 0.0], [Level(value=50.0, moves=True), Level(value=1.0, moves=True)]),
        ("running == 2 or running == 1", [50.0, 0.0], [Level(value=50.0, moves=True), Level(value=2.0, moves=False)]),
        ("running > 1 and running < 0", [50.0, 0.0], [Level(value=50.0, moves=True), Level(value=0.0, moves=True)]),
    ],
)
def test_conditions_are_met(valid: str, levels: list[float], expected: list[Level]) -> None:
    """Where they hold all along a move, else where they hold; what cannot be met leaves a level where it was."""
    assert list(valid_levels(pumped(valid), levels, 0.5)) == expected


def test_the_model_goes_before_its_sensors() -> None:
    """A sensor that reads in another state only does not keep the model from holding."""
    found = valid_levels(pumped("running == 1", ", valid_when: running == 0"), [50.0, 0.0], 0.5)
    assert found[1] == Level(value=1.0, moves=False)
    assert valid_levels(pumped("", ", valid_when: running == 3"), [50.0, 0.0], 0.5)[1] == Level(value=3.0, moves=False)


def test_a_level_in_a_unit_with_an_offset_moves_about_its_zero() -> None:
    """20 degC moves from 10 to 30 degC, not by half of 293 K."""
    graph = parse_model(
        "name: wall\nsample_time: 1 s\nconstants: {limit: 9 degC}\nvalid_when: t > limit\ninputs: {t: {unit: degC}}\n"
        "components: {s: {type: Se, law: e = t}, r: {type: R, law: e = R*f, parameters: {R: 1 K/W}}}\n"
        "junctions: {j: 1}\nbonds: [s -> j -> r]\nsensors: {q: {reads: j.f, unit: W, noise: 1 W}}\n"
    )
    assert valid_levels(graph, [293.15], 0.5)[0] == Level(value=293.15, moves=True)
    colder = replace(graph.inputs[0], lower=280.0, upper=283.0)
    assert not valid_levels(replace(graph, inputs=(colder,)), [283.0], 0.5)[0].moves


def test_a_usual_run_is_one_in_which_the_model_holds() -> None:
    """At each of its samples; what a condition says nothing of moves all the same."""
    graph = pumped("running == 1")
    model = build_step_model(build_plant(graph))
    run = next(usual_runs(model, build_spec(model), 300))
    u = np.array([sample.u for sample in run.samples])
    assert graph.valid_when is not None
    assert all(condition_holds(graph.valid_when.condition, {"speed": a, "running": b}) for a, b in u)
    assert np.ptp(u[:, 0]) > 0.5 * u[:, 0].mean()
