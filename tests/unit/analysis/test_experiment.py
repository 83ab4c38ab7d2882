"""Random runs on which a plant is judged."""

import numpy as np
import pytest

from faultbond.analysis.experiment import INPUT_KINDS, random_experiments
from faultbond.analysis.ranks import reduce
from faultbond.analysis.sensitivity import Experiment, build_recursion
from faultbond.analysis.testable import generic_run
from faultbond.equations.step import StepModel
from plants import example, positions, stated


def experiments(model: StepModel) -> tuple[Experiment, ...]:
    """The random runs of a plant."""
    return random_experiments(model, build_recursion(model.plant))


def test_inputs_stay_in_their_range_and_move() -> None:
    """Percentages lie between 20 and 100, and once go both ways; others have the decades, in their unit, and signs."""
    *one_way, both_ways = experiments(example("tank"))
    for found, least in (*((item, 20.0) for item in one_way), (both_ways, -100.0)):
        assert found.inputs.min() >= least
        assert found.inputs.max() <= 100.0
        assert np.ptp(found.inputs, axis=0).min() > 40.0
    assert both_ways.inputs.min() < -20.0
    motor = experiments(example("dc_motor", ("V: {unit: V, noise: 0.16 V}", "V: {unit: mV, noise: 0.16 V}")))
    for found, (decades, signed) in zip(motor, INPUT_KINDS, strict=True):
        sizes = np.log10(np.abs(found.inputs) * 1e3)
        assert decades[0] <= sizes.min() < sizes.max() <= decades[1]
        assert (found.inputs.min() < 0) == signed


TWO_STAGES = (
    "name: two stages\nsample_time: 0.1 s\ninputs: {V: {unit: V}}\ncomponents:\n"
    "  S1: {type: Se, law: e = V}\n  R1: {type: R, parameters: {R1: 1 ohm}}\n  C1: {type: C, parameters: {C1: 2 mF}}\n"
    "  S2: {type: Se, law: e = V}\n  R2: {type: R, parameters: {R2: 5 ohm}}\n  C2: {type: C, parameters: {C2: 8 F}}\n"
    "junctions: {l1: 1, l2: 1}\nbonds: [S1 -> l1 -> R1, l1 -> C1, S2 -> l2 -> R2, l2 -> C2]\n"
    "sensors: {v: {reads: C1.e + C2.e, noise: 1e-3}}\n"
)


def test_steps_cover_the_time_constants() -> None:
    """Steps range from below the shortest time constant, 2 ms, to above the longest, 40 s, whatever the sample time."""
    for found in experiments(stated(TWO_STAGES)):
        assert found.dt[0] == 0.0
        assert 0.6e-3 <= found.dt[1:].min() < 10e-3
        assert 20.0 < found.dt.max() <= 120.0


def test_a_plant_that_only_integrates() -> None:
    """Without a time constant the steps are some samples long."""
    model = example("watersafe/tank4.yaml")
    for found in experiments(model):
        assert 1.0 < found.dt[1:].min() < found.dt.max() < 100.0


def test_the_same_model_gives_the_same_runs() -> None:
    """Runs are drawn from a seed: a verdict does not change from call to call."""
    for one, two in zip(experiments(example("dc_motor")), experiments(example("dc_motor")), strict=True):
        assert np.array_equal(one.inputs, two.inputs)
        assert np.array_equal(one.theta, two.theta)
        assert np.array_equal(one.dt, two.dt)


def test_parameters_are_near_nominal_and_in_range() -> None:
    """Parameters scatter by some per cent, by their scale where the nominal is 0, and stay in their range."""
    model = example("watersafe/tanks.yaml")
    nominal = np.array([item.nominal for item in model.plant.graph.parameters])
    scale = np.array([item.scale for item in model.plant.graph.parameters])
    for found in experiments(model):
        off = np.abs(found.theta - nominal) / scale
        assert off.max() < 0.3
        assert np.sum(off > 0) >= len(off) / 4  # a leak cannot be negative: half of them are cut off at zero
        assert all(value >= item.lower for value, item in zip(found.theta, model.plant.graph.parameters, strict=True))


def test_a_store_that_nothing_fills_begins_full_once() -> None:
    """Without an input a capacitor is empty in the nominal run; the last run begins at about one volt and shows R*C."""
    model = stated(
        "name: cooling\nsample_time: 1 s\ncomponents:\n  C: {type: C, parameters: {C: 2 F}}\n"
        "  R: {type: R, parameters: {R: 5 ohm}}\njunctions: {n: 0}\nbonds: [n -> C, n -> R]\n"
        "sensors: {v: {reads: n.e, unit: V, noise: 10 mV}}\n"
    )
    found = experiments(model)
    assert len(found) == len(INPUT_KINDS) + 1
    assert [float(item.start[0]) for item in found[:-1]] == [0.0] * len(INPUT_KINDS)
    assert found[-1].start[0] == pytest.approx(2.0, rel=0.4)
    assert reduce([generic_run(model)]).rank.value == 1
    assert len(experiments(example("dc_motor"))) == len(INPUT_KINDS)


def test_a_narrow_range_holds() -> None:
    """A parameter that may not fall is never drawn below its nominal value."""
    model = example("dc_motor", ("{R: 3 ohm}", "{R: {nominal: 3 ohm, range: [3 ohm, 3.01 ohm]}}"))
    (place,) = positions(model, "R")
    values = [float(found.theta[place]) for found in experiments(model)]
    assert all(3.0 <= value <= 3.01 for value in values)
    assert {3.0, 3.01} & set(values)
